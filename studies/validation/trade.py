"""Study trade: cost and error of every model, the rule of --tolerance that follows, and its confirmation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analytic import beam
from geometry.design import BadInput
from geometry.messages import Progress
from studies.mechanics.model_choice import Statement
from studies.output.atomic_files import write_text
from studies.output.figures import picture
from studies.output.goals import failures, page_lines
from studies.output.provenance import made, versions
from studies.output.result import Result, Table
from studies.output.text_tables import cell as number
from studies.simulation.compare import part
from studies.validation import pages, trade_cases, trade_rule, trade_study
from studies.validation.pages import Row
from studies.validation.trade_cases import CALCULATED, KINDS, SHIPPED, SURROGATE, Kind
from studies.validation.trade_rule import COUNTED
from studies.validation.trade_study import CLEAR, QUANTITIES, QUICK_KINDS

if TYPE_CHECKING:
    import pandas as pd
from studies.web import verdict_figures

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
    import pandas as pd

    frame = pd.DataFrame(states)
    frame = frame[~frame.confirming.astype(bool)]
    order = {"kind": KINDS, "model": MODELS, "level": LEVELS}
    frame = frame.assign(**{name: pd.Categorical(frame[name], values) for name, values in order.items()})
    groups = frame.groupby(list(order), observed=True, sort=True)
    return [dict(zip(order, place, strict=True)) | _cell(own) for place, own in groups]


def _cell(own: pd.DataFrame) -> Row:
    names = [f"{name}_error_percent" for name in QUANTITIES]
    inside = own[((own.model != "formula") | (own.message == "")) & own[names].notna().any(axis=1)]
    row: Row = {"designs": own.design.nunique(), "states": len(own), "solved": len(inside)}
    for name in QUANTITIES:
        middle, high, _ = _spread(inside[f"{name}_error_percent"])
        row |= {f"{name}_median_percent": middle, f"{name}_p95_percent": high}
    counted, bars = (inside[[f"{name}_{kind}_percent" for name in COUNTED]].to_numpy() for kind in ("error", "bar"))
    known = np.isfinite(counted)
    unclear = CLEAR * bars[known] > counted[known]
    worst = _spread(inside[[f"{name}_error_percent" for name in COUNTED]].max(axis=1))
    # the surrogate refuses most paths outside its range as a whole, at no cost
    refused = (own.model == SURROGATE) & (own.status == "refused")
    answered = own if refused.all() else own[~refused]
    row |= dict(zip(("worst_median_percent", "worst_p95_percent", "largest_percent"), worst, strict=True))
    row["unclear_percent"] = 100 * float(unclear.mean()) if len(unclear) else math.nan
    return row | {name: float(answered[name].median()) for name in ("cpu_s", "cost", "peak_MB")}


def _spread(values: pd.Series) -> tuple[float, float, float]:
    """Return median, 95th percentile (the least value that as many do not exceed) and largest value, if any."""
    known = np.sort(values.dropna().to_numpy())
    if not len(known):
        return math.nan, math.nan, math.nan
    return float(np.median(known)), float(known[math.ceil(0.95 * len(known)) - 1]), float(known[-1])


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
