"""Study trade: cost and error of every model, the rule of --tolerance that follows, and its confirmation.

templates/trade.md.j2 says how a bound follows from errors. States are the rows of trade.csv (`trade_study`).
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial

import numpy as np
import pandas as pd

from analytic import beam
from geometry.design import BadInput
from geometry.loads import Load
from geometry.messages import Progress
from studies.inputs.option_groups import Whole
from studies.mechanics import model_choice
from studies.mechanics.model_choice import ANY_REGION, Choice, Statement
from studies.output import records
from studies.output.atomic_files import json_line, write_text
from studies.output.figures import picture
from studies.output.goals import Goal
from studies.output.provenance import made, versions
from studies.output.result import Result, Table
from studies.output.text_tables import cell as number
from studies.simulation.compare import part
from studies.validation import pages, trade_study
from studies.validation.pages import Row
from studies.validation.trade_study import CALCULATED, KINDS, QUANTITIES, SURROGATE, Kind
from studies.web import verdict_figures

FILES = ("trade.csv", "trade.png", "TRADE.md", "model_choice.json", "confirm.csv")
LEVELS = (*beam.LEVELS, trade_study.SHIPPED, "quick", "standard", "fine")
MODELS = ("formula", "surrogate", "axisymmetric", "harmonic", "half", "full")
COUNTED = ("force", "shift", "tilt", "readings", "sideways")
"""Quantities that a tolerance bounds."""
TRUE = [f"{name}_error_percent" for name in QUANTITIES]
TOLERANCES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
SHARE, FACTOR = 0.95, 1.5
"""Goals of the confirmation: share of the cases within the tolerance, largest error over the tolerance."""
LAST = "last draw"
"""Name of the results of the random designs that were drawn after the last change of the rule."""
FEWEST = 4
"""Least number of designs from which a bound of a formula or of the surrogate follows."""


def run(
    progress: Progress, *, designs: Whole = 24, confirm: bool = False, quick: bool = False, command: str = ""
) -> Result:
    """Measure cost and true error of every model over the range of designs; the rule of --tolerance follows.

    The store keeps all answers, so that a run that was stopped continues there; the costs, up to half an hour, are
    measured again.

    Parameters
    ----------
    designs
        Number of designs, 2 to 24.
    confirm
        Check the rule on 78 random designs; exit status 3 if a goal is missed.
    quick
        Use the section models at accuracy quick in presses and glued shears only: seconds instead of an hour.
    """
    if not 2 <= designs <= trade_study.STUDIED:
        raise BadInput(f"--designs must lie between 2 and {trade_study.STUDIED}; got {designs}")
    origin = made(command, versions())
    first, second = (part(progress, *ends) or progress for ends in ((0.0, 0.5 if confirm else 1.0), (0.5, 1.0)))
    states = trade_study.run(first, designs, quick=quick)
    rule = statements(states)
    if not confirm:
        return result(states, rule, [], (), origin)
    random = trade_study.run(second, designs, quick=quick, confirm=True)
    results = list(confirmed(random, rule))
    states = pd.concat([states, random], ignore_index=True)
    return result(states, rule, results, trade_study.QUICK_KINDS if quick else KINDS, origin)


def result(
    states: pd.DataFrame, rule: Sequence[Statement], results: Sequence[Row], kinds: Sequence[Kind], origin: str
) -> Result:
    """Return the result of states and a rule; results and kinds to be confirmed are empty without confirmation."""
    table, confirmation, rows = cells(states), summary(results), pages.records(states)
    first = ("kind", "model", "level", "force_p95_percent", "shift_p95_percent", "cpu_s", "cost")
    shown = [Table(title="Cost and error", rows=table, first=first)]
    if kinds:
        shown.append(Table(title="Confirmation", rows=confirmation))
    text, ran = as_text(rule, origin), []
    for kind, model in ((one, model) for one in KINDS for model in trade_study.PLAN[one]["models"]):
        own = {cell["level"]: cell["designs"] for cell in table if (cell["kind"], cell["model"]) == (kind, model)}
        ran.append({"kind": kind, "model": model} | {name: own.get(name, 0) for name in LEVELS[-3:]})
    page = {
        "tables": {kind: [_errors(row) for row in table if row["kind"] == kind] for kind in KINDS},
        "ran": ran,
        "rule": [
            {name: getattr(each, name) for name in ("kind", "region", "model", "level", "designs", "states", "cost")}
            | {f"{name} %": None if (bound := getattr(each, name)) is None else 100 * bound for name in COUNTED}
            for each in rule
        ],
        "results": results,
        "summary": confirmation,
        "tolerances": ", ".join(f"{100 * each:g}" for each in TOLERANCES),
        "designs": len({each["design"] for each in results}),
        "counts": {kind: len({each["design"] for each in results if each["kind"] == kind}) for kind in KINDS},
        "share": f"{SHARE:.0%}",
        "factor": FACTOR,
        "worst": sorted((each for each in results if each["status"] == "exceeded"), key=lambda each: -each["error"]),
        "lost": pages.records(states[~states.status.isin(["ok", "refused"])]),
    }
    files = {"model_choice.json": lambda path: write_text(path, text)}
    files["trade.png"] = partial(picture, rows=rows, draw=verdict_figures.trade)
    tables = {"trade": rows} | ({"confirm": results} if results else {})
    more: Row = {"records": [*table, *(confirmation if kinds else [])], "shown": shown, "files": files}
    posed = goals(results, kinds) if kinds else None
    return pages.study("trade", "Cost and error", rows, page, goals=posed, tables=tables, **more)


def cells(states: pd.DataFrame) -> list[Row]:
    """Return a row for each kind, model and level that ran on the chosen designs: cost and errors of its states.

    Formulas and the surrogate count inside their ranges only; level paper states none. `solved` are the states with
    an answer and a reference, `unclear_percent` is the share of errors that are less than three bars of their
    reference. Errors are median, 95th percentile and, over all counted quantities, the largest.
    """
    frame = states[~states.confirming]
    order = {"kind": KINDS, "model": MODELS, "level": LEVELS}
    frame = frame.assign(**{name: pd.Categorical(frame[name], values) for name, values in order.items()})
    rows = []
    for place, own in frame.groupby(list(order), observed=True, sort=True):
        row: Row = dict(zip(order, place, strict=True)) | {"designs": own.design.nunique(), "states": len(own)}
        inside = own[counting(own)]
        row["solved"] = len(inside)
        for name in QUANTITIES:
            errors = inside[f"{name}_error_percent"]
            row |= {f"{name}_median_percent": errors.median(), f"{name}_p95_percent": pages.percentile(errors, 95)}
        counted, bars = (
            inside[[f"{name}_{kind}_percent" for name in COUNTED]].to_numpy() for kind in ("error", "bar")
        )
        unclear = (trade_study.CLEAR * bars > counted)[np.isfinite(counted)]
        row["largest_percent"] = float(pd.Series(counted.ravel()).max())
        row["unclear_percent"] = 100 * float(unclear.mean()) if len(unclear) else math.nan
        # the surrogate refuses most paths outside its range as a whole, at no cost
        refused = (own.model == SURROGATE) & (own.status == "refused")
        answered = own if refused.all() else own[~refused]
        rows.append(row | {name: float(answered[name].median()) for name in ("cpu_s", "cost", "peak_MB")})
    return rows


def counting(states: pd.DataFrame) -> pd.Series:
    """Return which states have errors, and are no formulas outside their range."""
    return ((states.model != "formula") | (states.message == "")) & states[TRUE].notna().any(axis=1)


def _errors(cell: Row) -> Row:
    """Return the cells of the page for one model: median / 95th percentile of each error, cost."""
    row = {name: cell[name] for name in ("model", "level", "designs")}
    row["states"] = f"{cell['solved']} of {cell['states']}"
    for name in COUNTED:
        middle, high = cell[f"{name}_median_percent"], cell[f"{name}_p95_percent"]
        both = f"{number(middle, 2)} / {number(high, 2)}" if math.isfinite(middle) else ""
        row["readings % FS" if name == "readings" else f"{name} %"] = both
    row |= {"largest %": cell["largest_percent"], "unclear %": cell["unclear_percent"], "CPU s": cell["cpu_s"]}
    return row | {"cost": cell["cost"], "MB": None if cell["model"] in CALCULATED else round(cell["peak_MB"])}


# The rule


def statements(states: pd.DataFrame) -> list[Statement]:
    """Return the statements that follow from the states of the chosen designs."""
    own = states[~states.confirming & counting(states)]
    regions = []
    for state in pages.records(own):
        trial = trade_study.trial(state["design"], state["kind"], "auto")
        name = model_choice.region(trial.design, load_of(state), trial.magnet, state["kind"]).name
        formula = state["model"] == "formula"
        name = model_choice.formula_region(trial.design, name) if formula else name
        regions.append(ANY_REGION if state["model"] in trade_study.SOLIDS else name)
    found = []
    names = ["kind", "region", "model", "level"]
    for values, group in own.assign(region=regions).groupby(names, sort=False):
        place: Row = dict(zip(names, values, strict=True))
        designs, cost = group.design.nunique(), group.cost.median()
        # a model of unknown cost is never the cheapest
        if (place["model"] in CALCULATED and designs < FEWEST) or math.isnan(cost):
            continue
        bounds: Row = {}
        for name in COUNTED:
            # an error counts at least as large as the bar of its reference
            of = "along" if name == "sideways" else name
            errors = group[[f"{of}_error_percent", f"{of}_bar_percent"]].max(axis=1) / 100
            largest = (1 + 1 / designs) * float(errors.max())
            bounds[name] = None if errors.isna().all() else model_choice.rounded_up(largest, 3)
        place |= {"designs": designs, "states": len(group), "cost": float(f"{cost:.3g}")}
        found.append(Statement(**place, **bounds))
    return found


def load_of(state: Row) -> Load:
    return Load(depth=state["depth_mm"], shear_x=state["shear_mm"], friction=state["friction"])


def as_text(rule: Sequence[Statement], origin: str) -> str:
    """Return the text of model_choice.json: the versions of the models, and a statement on each line."""
    rows = ",\n".join(json_line(records.known(asdict(each))) for each in rule)
    made = f'"made": {json.dumps(origin)}, "versions": {json.dumps(model_choice.versions())}'
    return f'{{{made}, "statements": [\n{rows}\n]}}\n'


# Confirmation


def confirmed(states: pd.DataFrame, rule: Sequence[Statement]) -> Iterator[Row]:
    """Yield a row of confirm.csv for each tolerance, random design and load.

    `model` is the chosen model, empty if the rule refuses; `expected` its bound; `error` its largest true error of
    the counted quantities, a fraction, None if refused or without a reference.
    """
    names = ["kind", "design", "depth_mm", "shear_mm"]
    for place, group in states[states.confirming].groupby(names, sort=False):
        models = {(state["model"], state["level"]): state for state in pages.records(group)}
        for tolerance in TOLERANCES:
            row = dict(zip(names, place, strict=True)) | {"tolerance": tolerance}
            yield row | _confirmed(tolerance, models, rule)


def _confirmed(tolerance: float, models: Mapping[tuple[str, str], Row], rule: Sequence[Statement]) -> Row:
    """Return the result of a case: the model of the rule, or a finer one where its answer asks for it."""
    some = next(iter(models.values()))
    load = load_of(some)
    trial = trade_study.trial(some["design"], some["kind"], "auto", confirm=True)
    case = trial.design, [load]
    try:
        choice: Choice | None = model_choice.choose(*case, tolerance, trial.magnet, rule=rule)
    except BadInput:
        choice = None
    while choice is not None:
        state = models.get((choice.model, choice.level_or_accuracy))
        chosen: Row = {"model": choice.name, "status": "not run", "expected": choice.bound, "error": None}
        if state is None:
            return chosen
        errors = [state[f"{name}_error_percent"] for name in COUNTED]
        if np.isnan(errors).all():
            return chosen | {"status": state["status"]}
        if not model_choice.unmet(choice, trial.design, load, state["along_N"]):
            error = float(np.nanmax(errors)) / 100
            return chosen | {"status": "within" if error <= tolerance else "exceeded", "error": error}
        choice = model_choice.finer(*case, choice, trial.magnet, rule=rule)
    return {"model": "", "status": "refused", "expected": None, "error": None}


def summary(results: Sequence[Row]) -> list[Row]:
    """Return the results by kind and tolerance, by tolerance over all kinds, and those of the last draw alone.

    `refused` are cases for which the rule knows no model that meets the tolerance, `unjudged` those without a
    reference, or whose chosen model was not run; `worst` is the largest error over the tolerance.
    """
    if not results:
        return []
    frame = pd.DataFrame(results).astype({"error": float})
    parts = {kind: frame[frame.kind == kind] for kind in KINDS} | {"all": frame}
    parts[LAST] = frame[frame.design >= trade_study.CONFIRMED - trade_study.DRAWN]
    table = []
    for kind, some in parts.items():
        for tolerance, own in some.groupby("tolerance"):
            judged, refused = int(own.error.notna().sum()), int((own.status == "refused").sum())
            within = int((own.status == "within").sum())
            row = {"kind": kind, "tolerance_percent": 100 * tolerance, "cases": len(own), "refused": refused}
            row["unjudged"] = len(own) - judged - refused
            row["formulas"] = int(own.model.str.startswith("formula").sum())
            row["surrogate"] = int(own.model.str.startswith(SURROGATE).sum())
            row |= {"within": within, "share_percent": 100 * within / judged if judged else math.nan}
            table.append(row | {"worst": float(own.error.max()) / tolerance})
    return table


def goals(results: Sequence[Row], kinds: Sequence[Kind] = KINDS) -> list[Goal]:
    """Return the goals of the confirmation: every case is judged, and within the tolerance.

    A kind that was to be confirmed and has no judged case misses its goals.
    """
    table = summary(results)
    posed = []
    for kind in (*kinds, "all", LAST):
        own = [row for row in table if row["kind"] == kind]
        unjudged, cases = (sum(row[name] for row in own) for name in ("unjudged", "cases"))
        posed.append(Goal(f"{kind}, cases without a judgement", unjudged, 0, cases))
        # a tolerance at which the rule refuses every case promises nothing
        known = [(row, row["cases"] - row["refused"] - row["unjudged"]) for row in own]
        known = [(row, judged) for row, judged in known if judged]
        if not known:
            posed.append(Goal(f"{kind}, cases within the tolerance", None, 100 * SHARE, 0, "%", at_least=True))
        for row, judged in known:
            where = f"{kind}, tolerance {row['tolerance_percent']:g} %"
            share = row["share_percent"]
            posed += [
                Goal(f"{where}, cases within it", share, 100 * SHARE, judged, "%", at_least=True),
                Goal(f"{where}, largest error over it", row["worst"], FACTOR, judged),
            ]
    return posed
