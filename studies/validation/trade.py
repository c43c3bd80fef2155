"""Study trade: cost and error of every model, the rule of --tolerance that follows, and its confirmation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from analytic import beam
from geometry.design import BadInput
from geometry.messages import Progress
from studies.output.atomic_files import write_text
from studies.output.figures import picture
from studies.output.goals import failures, page_lines
from studies.output.provenance import made, versions
from studies.output.result import Result, Table
from studies.output.text_tables import cell as number
from studies.report import verdict_figures
from studies.simulation.compare import part
from studies.simulation.model_choice import Statement
from studies.validation import pages, trade_cases, trade_rule, trade_study
from studies.validation.pages import Row
from studies.validation.trade_cases import CALCULATED, KINDS, SHIPPED, SURROGATE, Kind
from studies.validation.trade_rule import COUNTED
from studies.validation.trade_study import QUANTITIES, QUICK_KINDS, errors_of, is_clear

FILES = ("trade.csv", "trade.png", "TRADE.md", "model_choice.json", "confirm.csv")
"""Files that `write` writes into a folder."""
LEVELS = (*beam.LEVELS, SHIPPED, "quick", "standard", "fine")
MODELS = ("formula", "surrogate", "axisymmetric", "harmonic", "half", "full")


def run(
    progress: Progress, *, designs: int, confirm: bool, quick: bool, command: str, store: Path | None = None
) -> Result:
    """Measure every model on the first designs; the rule follows, and is confirmed on random designs if asked.

    Parameters
    ----------
    command : that model_choice.json names.
    """
    if not 2 <= designs <= trade_cases.STUDIED:
        raise BadInput(f"--designs must lie between 2 and {trade_cases.STUDIED}; got {designs}")
    origin = made(command, versions())
    first, second = (part(progress, *ends) or progress for ends in ((0.0, 0.5 if confirm else 1.0), (0.5, 1.0)))
    states = trade_study.run(first, designs, quick=quick, store=store)
    rule = trade_rule.statements(states)
    results = []
    if confirm:
        states += trade_study.run(second, designs, quick=quick, confirm=True, store=store)
        results = list(trade_rule.confirm(states, rule))
    kinds = (QUICK_KINDS if quick else KINDS) if confirm else ()
    return result(states, rule, results, kinds, origin)


def result(
    states: Sequence[Row], rule: Sequence[Statement], results: Sequence[Row], kinds: Sequence[Kind], origin: str
) -> Result:
    """Return the result of states and a rule.

    Parameters
    ----------
    results, kinds : of the confirmation, and the kinds that were to be confirmed; empty without it.
    """
    table, summary = cells(states), trade_rule.summary(results)
    records = [{name: value for name, value in row.items() if not name.startswith("worst_")} for row in table]
    first = ("kind", "model", "level", "force_p95_percent", "shift_p95_percent", "cpu_s", "cost")
    shown = [Table(title="Cost and error", rows=records, first=first)]
    if kinds:
        shown.append(Table(title="Confirmation", rows=summary))
    page = pages.rendered(
        "trade.md.j2",
        tables={kind: [_errors(row) for row in table if row["kind"] == kind] for kind in KINDS},
        ran=[_designs(table, kind, model) for kind in KINDS for model in trade_cases.MODELS[kind]],
        rule=[_percents(each) for each in rule],
        results=results,
        verdict=page_lines(trade_rule.goals(results)),
        summary=summary,
        tolerances=", ".join(f"{100 * each:g}" for each in trade_rule.TOLERANCES),
        designs=len({each["design"] for each in results}),
        counts={kind: len({each["design"] for each in results if each["kind"] == kind}) for kind in KINDS},
        share=f"{trade_rule.SHARE:.0%}",
        factor=trade_rule.FACTOR,
        worst=sorted((each for each in results if each["status"] == "exceeded"), key=lambda each: -each["error"]),
        lost=[state for state in states if state["status"] not in ("ok", "refused")],
    )
    text = trade_rule.as_text(rule, origin)
    return Result(
        title="Cost and error",
        records=[*records, *(summary if kinds else [])],
        shown=shown,
        tables={"trade": states} | ({"confirm": results} if results else {}),
        files={
            "model_choice.json": lambda path: write_text(path, text),
            "trade.png": partial(picture, rows=states, draw=verdict_figures.trade),
        },
        pages={"TRADE.md": page},
        failures=failures(trade_rule.goals(results, kinds)) if kinds else (),
    )


def cells(states: Sequence[Row]) -> list[Row]:
    """Return a row for each kind, model and level that ran on the chosen designs: cost and errors of its states.

    Formulas and the surrogate count inside their ranges only; level paper states none. `solved` are the states with
    an answer and a reference, `unclear_percent` is the share of errors that are less than three bars of their
    reference. Errors are median, 95th percentile and, over all counted quantities, the largest.
    """
    groups: dict[tuple[str, ...], list[Row]] = {}
    for state in states:
        if not state["confirming"]:
            groups.setdefault((state["kind"], state["model"], state["level"]), []).append(state)
    places = product(KINDS, MODELS, LEVELS)
    return [
        dict(zip(("kind", "model", "level"), place, strict=True)) | _cell(groups[place])
        for place in places
        if place in groups
    ]


def _cell(own: Sequence[Row]) -> Row:
    inside = [errors_of(s) for s in own if s["model"] != "formula" or not s["message"]]
    inside = [errors for errors in inside if errors]
    row: Row = {"designs": len({s["design"] for s in own}), "states": len(own), "solved": len(inside)}
    for name in QUANTITIES:
        middle, high, _ = _spread([errors[name][0] for errors in inside if name in errors])
        row |= {f"{name}_median_percent": middle, f"{name}_p95_percent": high}
    unclear = [not is_clear(*errors[name]) for errors in inside for name in COUNTED if name in errors]
    worst = _spread([max(errors[name][0] for name in COUNTED if name in errors) for errors in inside])
    # the surrogate refuses most paths outside its range as a whole, at no cost
    answered = [s for s in own if s["model"] != SURROGATE or s["status"] != "refused"] or list(own)
    ended = [s for s in answered if math.isfinite(s["cpu_s"])]
    row |= dict(zip(("worst_median_percent", "worst_p95_percent", "largest_percent"), worst, strict=True))
    return row | {
        "unclear_percent": 100 * float(np.mean(unclear)) if unclear else math.nan,
        "cpu_s": _spread([s["cpu_s"] for s in ended])[0],
        "cost": _spread([s["cost"] for s in answered if math.isfinite(s["cost"])])[0],
        "peak_MB": _spread([s["peak_MB"] for s in ended])[0],
    }


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    """Return median, 95th percentile (the least value that as many do not exceed) and largest value; NaN without any.

    >>> _spread([3.0, 1.0, 2.0])
    (2.0, 3.0, 3.0)
    """
    if not values:
        return math.nan, math.nan, math.nan
    high = sorted(values)[max(math.ceil(0.95 * len(values)) - 1, 0)]
    return float(np.median(values)), high, max(values)


def _designs(table: Sequence[Row], kind: str, model: str) -> Row:
    """Return on how many designs a model ran at each level."""
    own = {cell["level"]: cell["designs"] for cell in table if (cell["kind"], cell["model"]) == (kind, model)}
    return {"kind": kind, "model": model} | {name: own.get(name, 0) for name in ("quick", "standard", "fine")}


def _errors(cell: Row) -> Row:
    """Return the cells of the page for one model: median / 95th percentile of each error, cost."""

    def both(name: str) -> str:
        middle, high = cell[f"{name}_median_percent"], cell[f"{name}_p95_percent"]
        return f"{number(middle, 2)} / {number(high, 2)}" if math.isfinite(middle) else ""

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
