"""Files of the study of cost and error: trade.csv, trade.png, TRADE.md, model_choice.json and confirm.csv."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from analytic import beam
from studies.output.atomic_files import write_text
from studies.output.checkpoint import solved_at
from studies.output.csv_tables import write_table
from studies.output.goals import page_lines
from studies.output.provenance import made
from studies.simulation.model_choice import Statement
from studies.validation import pages, trade_cases, trade_rule, trade_study
from studies.validation.pages import Row
from studies.validation.trade_cases import CALCULATED, KINDS, SHIPPED, SURROGATE
from studies.validation.trade_rule import COUNTED, percentile
from studies.validation.trade_study import QUANTITIES, errors_of, is_clear

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


COVERAGE = """\
Formulas and the surrogate ran on all designs that have a reference, the surrogate without friction; finite elements
on as many of the 24 designs as an hour of computing on one core allowed. Tetrahedra cost five to a hundred times as
much as the section model at level standard and are less accurate; a reference with friction costs a minute."""
CONFIRMATION = """\
The rule chooses a model for each of {designs} random designs, from which it does not follow, under each load of their
paths, for tolerances of {tolerances} %, and a finer one where the answer asks for it. `within` is the number of cases
whose true error of force, shift, tilt, readings and force along the shear is at most the tolerance; `worst` is the
largest error over the tolerance. `refused` are cases for which the rule knows no model, or none whose answer is known
to meet the tolerance, `unjudged` those without a reference or whose model was not run. {counts}. Goals: {share:.0%}
within, none above {factor:g}, every case judged, and in every kind some case."""


def cells(states: Sequence[Row]) -> list[Row]:
    """Return a row for each kind, model and level that ran on the chosen designs: cost and errors of its states.

    Formulas and the surrogate count inside their ranges only; level paper states none. `solved` are the states with
    an answer and a reference, `unclear_percent` is the share of errors that are less than three bars of their
    reference. Errors are median, 95th percentile and, over all counted quantities, the largest.
    """
    table = []
    for kind in KINDS:
        for model in COLOURS:
            for level in LEVELS:
                own = [s for s in states if (s["kind"], s["model"], s["level"]) == (kind, model, level)]
                own = [s for s in own if not s["confirming"]]
                if own:
                    table.append({"kind": kind, "model": model, "level": level, **_cell(own)})
    return table


def _cell(own: Sequence[Row]) -> Row:
    inside = [errors_of(s) for s in own if s["model"] != "formula" or not s["message"]]
    inside = [errors for errors in inside if errors]
    row: Row = {"designs": len({s["design"] for s in own}), "states": len(own), "solved": len(inside)}
    for name in QUANTITIES:
        middle, high, _ = _spread([errors[name][0] for errors in inside if name in errors])
        row |= {f"{name}_median_percent": middle, f"{name}_p95_percent": high}
    counted = [errors[name] for errors in inside for name in COUNTED if name in errors]
    unclear = sum(not is_clear(*error) for error in counted) / len(counted) if counted else math.nan
    largest = [max(errors[name][0] for name in COUNTED if name in errors) for errors in inside]
    # the surrogate refuses most paths outside its range as a whole, at no cost
    answered = [s for s in own if s["model"] != SURROGATE or s["status"] != "refused"] or list(own)
    ended = [s for s in answered if math.isfinite(s["cpu_s"])]
    costs = [s["cost"] for s in answered if s["cost"] is not None]
    row |= dict(zip(("worst_median_percent", "worst_p95_percent", "largest_percent"), _spread(largest), strict=True))
    return row | {
        "unclear_percent": 100 * unclear,
        "cpu_s": _median([s["cpu_s"] for s in ended]),
        "cost": _median(costs),
        "peak_MB": _median([s["peak_MB"] for s in ended]),
    }


def _median(values: Sequence[float]) -> float:
    return statistics.median(values) if values else math.nan


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    if not values:
        return math.nan, math.nan, math.nan
    return statistics.median(values), percentile(values), max(values)


def write(
    folder: Path,
    states: Sequence[Row],
    rule: Sequence[Statement],
    results: Sequence[Row],
    origin: str,
    command: str,
) -> None:
    """Write all files; confirm.csv and its tables only if the rule was confirmed."""
    write_table(folder / "trade.csv", states)
    write_text(folder / "model_choice.json", trade_rule.as_text(rule, made(command, origin)))
    table = cells(states)
    picture(folder / "trade.png", table)
    blocks = ["# Cost and error of every model", trade_study.ABOUT, "![Error over cost](trade.png)"]
    for kind in KINDS:
        if rows := [cell for cell in table if cell["kind"] == kind]:
            text = "Median / 95th percentile of the errors; `largest` is the largest error of all these quantities."
            blocks += [f"## {kind.capitalize()}", text, pages.markdown([_errors(row) for row in rows], digits=2)]
    ran = [
        {"kind": kind, "model": model}
        | {name: _designs(table, kind, model, name) for name in ("quick", "standard", "fine")}
        for kind in KINDS
        for model in trade_cases.MODELS[kind]
    ]
    blocks += ["## Which cells ran", COVERAGE, pages.markdown(ran)]
    blocks += ["## The rule", trade_rule.ABOUT, pages.markdown([_percents(each) for each in rule], digits=2)]
    if results:
        write_table(folder / "confirm.csv", results)
        blocks += _confirmation(results)
    lost = (
        f"{'random ' if s['confirming'] else ''}design {s['design']}, {s['kind']}, {s['model']} {s['level']}, "
        f"depth {s['depth_mm']:g} mm, shear {s['shear_mm']:g} mm: {s['status']}; {s['message']}"
        for s in states
        if s["status"] not in ("ok", "refused")
    )
    blocks += ["## States without an error", pages.listed(lost), solved_at(s["commit"] for s in states)]
    pages.write(folder / "TRADE.md", blocks, command, origin)


def _designs(table: Sequence[Row], kind: str, model: str, level: str) -> int:
    place = (kind, model, level)
    return next((c["designs"] for c in table if (c["kind"], c["model"], c["level"]) == place), 0)


def _errors(cell: Row) -> Row:
    """Return the cells of the page for one model: median / 95th percentile of each error, cost."""

    def both(name: str) -> str:
        middle, high = cell[f"{name}_median_percent"], cell[f"{name}_p95_percent"]
        return f"{pages.cell(middle, 2)} / {pages.cell(high, 2)}" if math.isfinite(middle) else ""

    row = {name: cell[name] for name in ("model", "level", "designs")}
    row["states"] = f"{cell['solved']} of {cell['states']}"
    shown = {"readings": "readings % FS"}
    names = ("force", "shift", "tilt", "readings", "sideways")
    row |= {shown.get(name, f"{name} %"): both(name) for name in names}
    row |= {"largest %": cell["largest_percent"], "unclear %": cell["unclear_percent"], "CPU s": cell["cpu_s"]}
    return row | {"cost": cell["cost"], "MB": None if cell["model"] in CALCULATED else round(cell["peak_MB"])}


def _percents(statement: Statement) -> Row:
    row: Row = {name: getattr(statement, name) for name in ("kind", "region", "model", "level")}
    bounds = {f"{name} %": getattr(statement, name) for name in COUNTED}
    row |= {name: getattr(statement, name) for name in ("designs", "states", "cost")}
    return row | {name: None if value is None else 100 * value for name, value in bounds.items()}


def _confirmation(results: Sequence[Row]) -> list[str]:
    numbers = {kind: len({each["design"] for each in results if each["kind"] == kind}) for kind in KINDS}
    text = CONFIRMATION.format(
        designs=len({each["design"] for each in results}),
        tolerances=", ".join(f"{100 * each:g}" for each in trade_rule.TOLERANCES),
        counts=", ".join(f"{kind.capitalize()}: {number} designs" for kind, number in numbers.items()),
        share=trade_rule.SHARE,
        factor=trade_rule.FACTOR,
    )
    verdict = "\n".join(page_lines(trade_rule.goals(results)))
    blocks = ["## Confirmation", text, verdict, pages.markdown(trade_rule.summary(results), digits=2)]
    worst = sorted((each for each in results if each["status"] == "exceeded"), key=lambda each: -each["error"])
    beyond = (
        f"{each['kind']}, design {each['design']}, depth {each['depth_mm']:g} mm, shear {each['shear_mm']:g} mm: "
        f"tolerance {100 * each['tolerance']:g} %, {each['model']}, error {100 * each['error']:.3g} %"
        for each in worst
    )
    return [*blocks, "Cases beyond the tolerance:", pages.listed(beyond)] if worst else blocks


def picture(path: Path, table: Sequence[Row]) -> None:
    """Plot the error over the cost, one panel for each kind; a line joins the models that no other one dominates."""
    from matplotlib.lines import Line2D

    from studies.output.table_plots import sheet

    with sheet(path, 13.0, 5.6, dpi=150) as figure:
        axes = figure.subplots(1, len(KINDS), sharey=True)
        for axis, kind in zip(axes, KINDS, strict=True):
            _panel(
                axis, [cell for cell in table if cell["kind"] == kind and math.isfinite(cell["worst_median_percent"])]
            )
            axis.set(title=kind, xlabel="CPU seconds of a path (s)")
        axes[0].set_ylabel("largest error of a state (%)")
        models = dict.fromkeys(cell["model"] for cell in table)
        handles = [
            Line2D([], [], marker=MARKERS[m], color=COLOURS[m], markersize=SIZES.get(m, 6), linestyle="", label=m)
            for m in models
        ]
        handles.append(Line2D([], [], color="#777777", linewidth=1, linestyle="--", label="not dominated"))
        handles.append(Line2D([], [], color="#777777", linewidth=1.2, marker="_", label="median to 95th percentile"))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)


def _panel(axis: Any, cells: Sequence[Row]) -> None:
    axis.set(xscale="log", yscale="log")
    for cell in cells:
        middle, high, model = cell["worst_median_percent"], cell["worst_p95_percent"], cell["model"]
        place, name = cell["cpu_s"], f"{model} {cell['level']}"
        colour, (side, height) = (
            COLOURS[model],
            LABELS.get(name, LABELS.get(cell["level"], LABELS[model])),
        )
        axis.plot([place] * 2, [middle, high], "-", color=colour, linewidth=1.2, alpha=0.6)
        axis.plot(place, high, "_", color=colour, markersize=7)
        axis.plot(place, middle, MARKERS[model], color=colour, markersize=SIZES.get(model, 6))
        axis.annotate(
            cell["level"],
            (place, middle),
            # bars of neighbours stand close to the right of a marker
            xytext=(9 if side == "left" else -4, 4 if height == "bottom" else -4),
            textcoords="offset points",
            fontsize=9,
            color=colour,
            ha=side,
            va=height,
        )
    points = sorted((cell["cpu_s"], cell["worst_median_percent"]) for cell in cells)
    front = [(s, e) for s, e in points if not any(other < s and error <= e for other, error in points)]
    axis.plot(*zip(*front, strict=True), "--", color="#777777", linewidth=1, zorder=0)
    axis.margins(x=0.2, y=0.1)
