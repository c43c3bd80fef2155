"""The rule that follows from costs and errors, and its confirmation on designs that it has not seen.

templates/trade.md.j2 says how a bound follows from errors.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict

import numpy as np

from geometry.design import BadInput
from studies.mechanics import model_choice
from studies.mechanics.model_choice import ANY_REGION, Choice, Statement
from studies.output import records
from studies.output.atomic_files import json_line
from studies.output.goals import Goal
from studies.validation import trade_cases
from studies.validation.pages import Row
from studies.validation.trade_cases import CALCULATED, SURROGATE, Kind
from studies.validation.trade_study import SOLIDS, errors_of, load_of

COUNTED = ("force", "shift", "tilt", "readings", "sideways")
"""Quantities that a tolerance bounds."""
BOUNDS = {"force": "force", "shift": "shift", "tilt": "tilt", "readings": "readings", "sideways": "along"}
"""Bounds of a statement, and the quantities from whose errors they follow."""
TOLERANCES = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
SHARE, FACTOR = 0.95, 1.5
"""Goals of the confirmation: share of the cases within the tolerance, largest error over the tolerance."""
LAST = "last draw"
"""Name of the results of the random designs that were drawn after the last change of the rule."""
FEWEST = 4
"""Least number of designs from which a bound of a formula or of the surrogate follows."""


def statements(states: Sequence[Row]) -> list[Statement]:
    """Return the statements that follow from the states of the chosen designs."""
    groups: dict[tuple[str, str, str, str], list[Row]] = {}
    for state in states:
        if errors_of(state) and not state["confirming"] and (state["model"] != "formula" or not state["message"]):
            place = state["kind"], _region(state), state["model"], state["level"]
            groups.setdefault(place, []).append(state)
    # a model of unknown cost is never the cheapest
    return [
        _statement(region, members)
        for (_, region, model, _), members in groups.items()
        if (model not in CALCULATED or len({state["design"] for state in members}) >= FEWEST)
        and any(math.isfinite(state["cost"]) for state in members)
    ]


def _region(state: Row) -> str:
    if state["model"] in SOLIDS:
        return ANY_REGION
    trial = trade_cases.trial(state["design"], state["kind"], "auto", confirm=state["confirming"])
    name = model_choice.region(trial.design, load_of(state), trial.magnet, state["kind"]).name
    return model_choice.formula_region(trial.design, name) if state["model"] == "formula" else name


def _statement(region: str, members: Sequence[Row]) -> Statement:
    first, designs = members[0], len({state["design"] for state in members})
    bounds = {
        name: _bound([_counted(state, quantity) for state in members if quantity in errors_of(state)], designs)
        for name, quantity in BOUNDS.items()
    }
    costs = [state["cost"] for state in members if math.isfinite(state["cost"])]
    force, shift = bounds.pop("force"), bounds.pop("shift")
    assert force is not None
    assert shift is not None
    return Statement(
        kind=first["kind"],
        region=region,
        model=first["model"],
        level=first["level"],
        designs=designs,
        states=len(members),
        cost=float(f"{statistics.median(costs):.3g}"),
        force=force,
        shift=shift,
        **bounds,
    )


def _counted(state: Row, name: str) -> float:
    """Return an error of a state, a fraction; at least the error bar of the reference."""
    return max(errors_of(state)[name]) / 100


def _bound(errors: Sequence[float], designs: int) -> float | None:
    """Return the bound that follows from errors on some designs, rounded up to three digits; None without errors."""
    if not errors:
        return None
    return model_choice.rounded_up((1 + 1 / designs) * max(errors), 3)


def as_text(rule: Sequence[Statement], origin: str) -> str:
    """Return the text of model_choice.json: the versions of the models, and a statement on each line."""
    rows = ",\n".join(json_line(records.known(asdict(each))) for each in rule)
    made = f'"made": {json.dumps(origin)}, "versions": {json.dumps(model_choice.versions())}'
    return f'{{{made}, "statements": [\n{rows}\n]}}\n'


def confirm(states: Sequence[Row], rule: Sequence[Statement]) -> Iterator[Row]:
    """Yield a row of confirm.csv for each tolerance, random design and load.

    `model` is the chosen model, empty if the rule refuses; `expected` its bound; `error` its largest true error of
    the counted quantities, a fraction, None if refused or without a reference.
    """
    models_of: dict[tuple[str, int, float, float], dict[tuple[str, str], Row]] = {}
    for state in states:
        if state["confirming"]:
            place = state["kind"], state["design"], state["depth_mm"], state["shear_mm"]
            models_of.setdefault(place, {})[state["model"], state["level"]] = state
    for (kind, design, depth, shear), models in models_of.items():
        for tolerance in TOLERANCES:
            row = {"kind": kind, "design": design, "depth_mm": depth, "shear_mm": shear, "tolerance": tolerance}
            yield row | _confirmed(tolerance, models, rule)


def _confirmed(tolerance: float, models: Mapping[tuple[str, str], Row], rule: Sequence[Statement]) -> Row:
    """Return the result of a case: the model of the rule, or a finer one where its answer asks for it."""
    some = next(iter(models.values()))
    load = load_of(some)
    trial = trade_cases.trial(some["design"], some["kind"], "auto", confirm=True)
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
        errors = errors_of(state)
        if not errors:
            return chosen | {"status": state["status"]}
        if not model_choice.unmet(choice, tolerance, trial.design, load, state["along_N"]):
            error = float(np.max([errors[name][0] for name in COUNTED if name in errors])) / 100
            return chosen | {"status": "within" if error <= tolerance else "exceeded", "error": error}
        choice = model_choice.finer(*case, choice, trial.magnet, rule=rule)
    return {"model": "", "status": "refused", "expected": None, "error": None}


def summary(results: Sequence[Row]) -> list[Row]:
    """Return the results by kind and tolerance, by tolerance over all kinds, and those of the last draw alone.

    `refused` are cases for which the rule knows no model that meets the tolerance, `unjudged` those without a
    reference, or whose chosen model was not run; `worst` is the largest error over the tolerance.
    """
    import pandas as pd

    if not results:
        return []
    frame = pd.DataFrame(results).astype({"error": float})
    parts = {kind: frame[frame.kind == kind] for kind in trade_cases.KINDS} | {"all": frame}
    parts[LAST] = frame[frame.design >= trade_cases.CONFIRMED - trade_cases.DRAWN]
    table = []
    for kind, part in parts.items():
        for tolerance, own in part.groupby("tolerance"):
            judged, refused = int(own.error.notna().sum()), int((own.status == "refused").sum())
            within = int((own.status == "within").sum())
            row = {"kind": kind, "tolerance_percent": 100 * tolerance, "cases": len(own), "refused": refused}
            row["unjudged"] = len(own) - judged - refused
            row["formulas"] = int(own.model.str.startswith("formula").sum())
            row["surrogate"] = int(own.model.str.startswith(SURROGATE).sum())
            row |= {"within": within, "share_percent": 100 * within / judged if judged else math.nan}
            table.append(row | {"worst": float(own.error.max()) / tolerance})
    return table


def goals(results: Sequence[Row], kinds: Sequence[Kind] = trade_cases.KINDS) -> list[Goal]:
    """Return the goals of the confirmation: every case is judged, and within the tolerance.

    Parameters
    ----------
    kinds : those that were to be confirmed; one without a judged case misses its goals.
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
