"""Files of the study of cost and error: trade.csv, trade.png, TRADE.md, model_choice.json and confirm.csv."""

from __future__ import annotations

import math
import statistics
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from analytic import beam
from studies.output.checkpoint import solved_at
from studies.output.goals import page_lines
from studies.output.provenance import made
from studies.output.records import FlatRow
from studies.simulation.model_choice import Statement
from studies.validation import trade_cases, trade_rule, trade_study
from studies.validation.trade_cases import CALCULATED, KINDS, SHIPPED, SURROGATE, Kind
from studies.validation.trade_reference import QUANTITIES
from studies.validation.trade_rule import COUNTED, Confirmation, percentile
from studies.validation.trade_study import TradeState

FILES = ("trade.csv", "trade.png", "TRADE.md", "model_choice.json", "confirm.csv")
"""Files that `write` writes into a folder."""
LEVELS = (*beam.LEVELS, SHIPPED, "quick", "standard", "fine")
COLOURS = {
    "formula": "#D55E00",
    "surrogate": "#882255",
    "axisymmetric": "#0072B2",
    "harmonic": "#009E73",
    "half": "#CC79A7",
    "full": "#000000",
}
LABELS = {
    "formula": ("left", "bottom"),
    "tip": ("right", "top"),
    "magnet": ("right", "bottom"),
    "column": ("right", "top"),
    "surrogate": ("left", "bottom"),
    "axisymmetric": ("right", "top"),
    "harmonic": ("left", "top"),
    "harmonic quick": ("left", "bottom"),
    "half": ("right", "bottom"),
    "full": ("left", "bottom"),
}
"""Sides of labels by name, level or model, so that they do not overlap: anchors of the text."""
MARKERS = {"formula": "D", "surrogate": "*", "axisymmetric": "o", "harmonic": "s", "half": "^", "full": "v"}
SIZES = {"surrogate": 10}
"""Sizes of markers that need another one than 6 points."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Cost and errors of one model for one kind of scene, over all its states.

    Attributes
    ----------
    states : all states of presses or shears that the model should solve.
    solved : states with an answer and a reference.
    errors : median, 95th percentile and largest error of each quantity, percent; NaN where there is none.
    unclear : share of the errors that are less than three error bars of their reference.
    """

    kind: Kind
    model: str
    level: str
    designs: int
    states: int
    solved: int
    errors: dict[str, tuple[float, float, float]]
    worst: tuple[float, float, float]
    cpu_s: float
    cost: float
    peak_MB: float
    unclear: float

    @property
    def name(self) -> str:
        """Model and level."""
        return f"{self.model} {self.level}"

    def row(self) -> FlatRow:
        """Return the columns of the table of TRADE.md and of JSON: medians and 95th percentiles."""
        row: FlatRow = {
            "kind": self.kind,
            "model": self.model,
            "level": self.level,
            "designs": self.designs,
            "states": self.states,
            "solved": self.solved,
        }
        for name in QUANTITIES:
            middle, high, _ = self.errors[name]
            row |= {f"{name}_median_percent": middle, f"{name}_p95_percent": high}
        return row | {
            "largest_percent": self.worst[2],
            "unclear_percent": 100 * self.unclear,
            "cpu_s": self.cpu_s,
            "cost": self.cost,
            "peak_MB": self.peak_MB,
        }


def cells(states: Sequence[TradeState]) -> list[Cell]:
    """Return a cell for each kind, model and level that ran on the chosen designs.

    Formulas and the surrogate count inside their ranges only; level paper states none.
    """
    table = []
    for kind in KINDS:
        for model in COLOURS:
            for level in LEVELS:
                own = [s for s in states if (s.kind, s.model, s.level) == (kind, model, level) and not s.confirming]
                if own:
                    table.append(_cell(own))
    return table


def _cell(own: Sequence[TradeState]) -> Cell:
    first = own[0]
    inside = [s for s in own if s.errors and (s.model != "formula" or not s.outside)]
    errors = {name: _spread([s.errors[name].percent for s in inside if name in s.errors]) for name in QUANTITIES}
    counted = [s.errors[name] for s in inside for name in COUNTED if name in s.errors]
    # the surrogate refuses most paths outside its range as a whole, at no cost
    answered = [s for s in own if first.model != SURROGATE or s.status != "refused"] or own
    costs = [s.cost for s in answered if s.cost is not None]
    ended = [s for s in answered if math.isfinite(s.cpu_s)]
    return Cell(
        first.kind,
        first.model,
        first.level,
        len({s.design for s in own}),
        len(own),
        len(inside),
        errors,
        _spread([largest(s) for s in inside]),
        statistics.median(s.cpu_s for s in ended) if ended else math.nan,
        statistics.median(costs) if costs else math.nan,
        statistics.median(s.peak_MB for s in ended) if ended else math.nan,
        sum(not error.clear for error in counted) / len(counted) if counted else math.nan,
    )


def largest(state: TradeState) -> float:
    """Return the largest error of the counted quantities in a state, percent."""
    return max(state.errors[name].percent for name in COUNTED if name in state.errors)


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    if not values:
        return math.nan, math.nan, math.nan
    return statistics.median(values), percentile(values), max(values)


def write(
    folder: Path,
    states: Sequence[TradeState],
    rule: Sequence[Statement],
    results: Sequence[Confirmation],
    origin: str,
    command: str,
) -> None:
    """Write all files; confirm.csv and its tables only if the rule was confirmed."""
    from studies.output.atomic_files import write_text
    from studies.output.csv_tables import write_table

    write_table(folder / "trade.csv", trade_study.trade_rows(states))
    write_text(folder / "model_choice.json", trade_rule.as_text(rule, made(command, origin)))
    table = cells(states)
    picture(folder / "trade.png", table)
    lines = ["# Cost and error of every model", "", *trade_study.ABOUT.splitlines(), ""]
    lines += ["![Error over cost](trade.png)", ""]
    for kind in KINDS:
        if rows := [cell for cell in table if cell.kind == kind]:
            lines += [f"## {kind.capitalize()}", "", *_errors_table(rows), ""]
    lines += ["## Which cells ran", "", *_coverage(table), ""]
    lines += ["## The rule", "", *trade_rule.ABOUT.splitlines(), ""]
    lines += [*_markdown([_percents(each) for each in rule]), ""]
    if results:
        write_table(folder / "confirm.csv", [each.row() for each in results])
        lines += [*_confirmation(results), ""]
    lines += ["## States without an error", "", *_left_out(states), ""]
    lines += [solved_at(state.commit for state in states), "", made(command, origin)]
    write_text(folder / "TRADE.md", "\n".join(lines) + "\n")


def _errors_table(rows: Sequence[Cell]) -> list[str]:
    """Return the table of one kind: median / 95th percentile of each error."""
    heads = [
        *("model", "level", "designs", "states", "force %", "shift %", "tilt %", "readings % FS", "sideways %"),
        *("largest %", "unclear %", "CPU s", "cost", "MB"),
    ]
    lines = [
        "Median / 95th percentile of the errors; `largest` is that of force, shift, tilt and readings.",
        "",
        f"| {' | '.join(heads)} |",
        "|---" * len(heads) + "|",
    ]
    for cell in rows:
        parts = {name: f"{_number(a)} / {_number(b)}" for name, (a, b, _) in cell.errors.items() if math.isfinite(a)}
        values = [
            *(cell.model, cell.level, str(cell.designs), f"{cell.solved} of {cell.states}"),
            *(parts.get(name, "") for name in ("force", "shift", "tilt", "readings", "sideways")),
            *(_number(cell.worst[2]), _number(100 * cell.unclear), _number(cell.cpu_s), _number(cell.cost)),
            "" if cell.model in CALCULATED else f"{cell.peak_MB:.0f}",
        ]
        lines.append(f"| {' | '.join(values)} |")
    return lines


def _coverage(table: Sequence[Cell]) -> list[str]:
    """State on how many designs each finite-element model ran."""
    text = (
        "Formulas and the surrogate ran on all designs that have a reference, the surrogate without friction; finite "
        f"elements on as many of the {trade_cases.STUDIED} "
        "designs as an hour of computing on one core allowed. Tetrahedra cost five to a hundred times as much as the "
        "section model at level standard and are less accurate; a reference with friction costs a minute."
    )
    lines = [*_wrapped(text), ""]
    heads = ["kind", "model", "quick", "standard", "fine"]
    lines += [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for kind in KINDS:
        for model in trade_cases.MODELS[kind]:
            counts = {c.level: c.designs for c in table if (c.kind, c.model) == (kind, model)}
            lines.append(f"| {kind} | {model} | {' | '.join(str(counts.get(name, 0)) for name in heads[2:])} |")
    return lines


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 116)


def _percents(statement: Statement) -> FlatRow:
    row = {"kind": statement.kind, "region": statement.region, "model": statement.model, "level": statement.level}
    bounds = {f"{name} %": getattr(statement, name) for name in COUNTED}
    shown = {name: None if value is None else 100 * value for name, value in bounds.items()}
    return row | {"designs": statement.designs, "states": statement.states, "cost": statement.cost} | shown


def _confirmation(results: Sequence[Confirmation]) -> list[str]:
    table = trade_rule.summary(results)
    verdict, *missed = page_lines(trade_rule.goals(results))
    designs = len({each.design for each in results})
    numbers = {kind: len({each.design for each in results if each.kind == kind}) for kind in KINDS}
    counts = ", ".join(f"{kind.capitalize()}: {number} designs" for kind, number in numbers.items())
    tolerances = ", ".join(f"{100 * each:g}" for each in trade_rule.TOLERANCES)
    text = (
        f"The rule chooses a model for each of {designs} random designs, from which it does not follow, under each "
        f"load of their paths, for tolerances of {tolerances} %, and a finer one where the answer asks for it. "
        "`within` is the number of cases whose true error of force, shift, tilt, readings and force along the shear "
        "is at most the tolerance; `worst` is the largest error over the tolerance. `refused` are cases for which "
        "the rule knows no model, or none whose answer is known to meet the tolerance, `unjudged` those without a "
        f"reference or whose model was not run. {counts}. Goals: {trade_rule.SHARE:.0%} within, none above "
        f"{trade_rule.FACTOR:g}, every case judged, and in every kind some case. {verdict}"
    )
    lines = [
        "## Confirmation",
        "",
        *_wrapped(text),
        "",
        *missed,
        "",
        *_markdown([row.row() for row in table]),
    ]
    worst = sorted((each for each in results if each.status == "exceeded"), key=lambda each: -(each.error or 0))
    if worst:
        lines += ["", "Cases beyond the tolerance:", ""]
        lines += [
            f"- {each.kind}, design {each.design}, depth {each.depth_mm:g} mm, shear {each.shear_mm:g} mm: tolerance "
            f"{100 * each.tolerance:g} %, {each.model}, error {100 * (each.error or 0):.3g} %"
            for each in worst
        ]
    return lines


def _left_out(states: Sequence[TradeState]) -> list[str]:
    bad = [s for s in states if s.status not in ("ok", "refused")]
    lines = [
        f"- {'random ' if s.confirming else ''}design {s.design}, {s.kind}, {s.model} {s.level}, "
        f"depth {s.load.depth:g} mm, shear {s.load.shear_x:g} mm: {s.status}; {s.outside}"
        for s in bad
    ]
    return list(dict.fromkeys(lines)) or ["None."]


def _markdown(rows: Sequence[FlatRow]) -> list[str]:
    heads = list(rows[0]) if rows else []
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in rows:
        cells = [_number(v) if isinstance(v, float) else "" if v is None else str(v) for v in row.values()]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _number(value: float) -> str:
    return f"{value:.2g}" if math.isfinite(value) and value < 100 else f"{value:.0f}" if math.isfinite(value) else ""


def picture(path: Path, table: Sequence[Cell]) -> None:
    """Plot the error over the cost, one panel for each kind; a line joins the models that no other one dominates."""
    from matplotlib.lines import Line2D

    from studies.output.table_plots import sheet

    with sheet(path, 13.0, 5.6, dpi=150) as figure:
        axes = figure.subplots(1, len(KINDS), sharey=True)
        for axis, kind in zip(axes, KINDS, strict=True):
            _panel(axis, [cell for cell in table if cell.kind == kind and math.isfinite(cell.worst[0])])
            axis.set(title=kind, xlabel="CPU seconds of a path (s)")
        axes[0].set_ylabel("largest error of a state (%)")
        models = dict.fromkeys(cell.model for cell in table)
        handles = [
            Line2D([], [], marker=MARKERS[m], color=COLOURS[m], markersize=SIZES.get(m, 6), linestyle="", label=m)
            for m in models
        ]
        handles.append(Line2D([], [], color="#777777", linewidth=1, linestyle="--", label="not dominated"))
        handles.append(Line2D([], [], color="#777777", linewidth=1.2, marker="_", label="median to 95th percentile"))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)


def _panel(axis: Any, cells: Sequence[Cell]) -> None:
    axis.set(xscale="log", yscale="log")
    for cell in cells:
        middle, high, _ = cell.worst
        colour, (side, height) = (
            COLOURS[cell.model],
            LABELS.get(cell.name, LABELS.get(cell.level, LABELS[cell.model])),
        )
        axis.plot([cell.cpu_s] * 2, [middle, high], "-", color=colour, linewidth=1.2, alpha=0.6)
        axis.plot(cell.cpu_s, high, "_", color=colour, markersize=7)
        axis.plot(cell.cpu_s, middle, MARKERS[cell.model], color=colour, markersize=SIZES.get(cell.model, 6))
        axis.annotate(
            cell.level,
            (cell.cpu_s, middle),
            # bars of neighbours stand close to the right of a marker
            xytext=(9 if side == "left" else -4, 4 if height == "bottom" else -4),
            textcoords="offset points",
            fontsize=9,
            color=colour,
            ha=side,
            va=height,
        )
    front = [c for c in cells if not any(o.cpu_s < c.cpu_s and o.worst[0] <= c.worst[0] for o in cells)]
    front.sort(key=lambda cell: cell.cpu_s)
    axis.plot([c.cpu_s for c in front], [c.worst[0] for c in front], "--", color="#777777", linewidth=1, zorder=0)
    axis.margins(x=0.2, y=0.1)
