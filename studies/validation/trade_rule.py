"""The rule that follows from costs and errors, and its confirmation on designs that it has not seen.

ABOUT, which the report prints, says how a bound follows from errors.
"""

from __future__ import annotations

import json
import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass

from geometry.design import BadInput
from studies.output import records
from studies.output.atomic_files import json_line
from studies.output.goals import Goal
from studies.output.records import FlatRow
from studies.simulation import model_choice
from studies.simulation.model_choice import ANY_REGION, Choice, Statement
from studies.validation import trade_cases
from studies.validation.trade_cases import CALCULATED, SURROGATE, Kind
from studies.validation.trade_study import SOLIDS, TradeState

ABOUT = """\
A bound is the largest error of all states of a region, times 1 + 1/n for n designs. An error that is smaller than the
error bar of its reference counts as large as the bar. Formulas and the surrogate have bounds only inside their
ranges, and where at least four designs have states. The surrogate is chosen only if the half widths of its own 90 %
intervals for the loads in question meet the tolerance as well as its bound: the bound also covers readings and the
tenth of the cases beyond the intervals, and the intervals are wide where training beams are sparse. Tetrahedra, which
ran on few designs, have one bound for all regions of a kind.

The rule was corrected twice after random designs had shown it to be wrong. Small and large magnets are told apart
because a formula was 19 % off at a tolerance of 10 % (first draw, design 21). Bounds follow from the largest error,
no longer from its 95th percentile, because a light press at level quick was 1.6 % off at a tolerance of 1 % (second
draw, design 29). The last draw was made after both corrections. A third one came after it: the force along a shear
counts, which was up to 6.7 times a tolerance off where a slender beam is pressed nearly to its buckling load.
"""

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


def statements(states: Sequence[TradeState]) -> list[Statement]:
    """Return the statements that follow from the states of the chosen designs."""
    groups: dict[tuple[str, str, str, str], list[TradeState]] = {}
    for state in states:
        if state.errors and not state.confirming and (state.model != "formula" or not state.outside):
            groups.setdefault((state.kind, _region(state), state.model, state.level), []).append(state)
    # a model of unknown cost is never the cheapest
    return [
        _statement(region, members)
        for (_, region, model, _), members in groups.items()
        if (model not in CALCULATED or len({state.design for state in members}) >= FEWEST)
        and any(state.cost is not None for state in members)
    ]


def _region(state: TradeState) -> str:
    if state.model in SOLIDS:
        return ANY_REGION
    trial = trade_cases.trial(state.design, state.kind, "auto", confirm=state.confirming)
    name = model_choice.region(trial.design, state.load, trial.magnet, state.kind).name
    return model_choice.formula_region(trial.design, name) if state.model == "formula" else name


def _statement(region: str, members: Sequence[TradeState]) -> Statement:
    first, designs = members[0], len({state.design for state in members})
    bounds = {
        name: _bound([_counted(state, quantity) for state in members if quantity in state.errors], designs)
        for name, quantity in BOUNDS.items()
    }
    costs = [state.cost for state in members if state.cost is not None]
    force, shift = bounds.pop("force"), bounds.pop("shift")
    assert force is not None
    assert shift is not None
    return Statement(
        kind=first.kind,
        region=region,
        model=first.model,
        level=first.level,
        designs=designs,
        states=len(members),
        cost=float(f"{statistics.median(costs):.3g}"),
        force=force,
        shift=shift,
        **bounds,
    )


def _counted(state: TradeState, name: str) -> float:
    """Return an error of a state, a fraction; at least the error bar of the reference."""
    error = state.errors[name]
    return max(error.percent, error.bar_percent) / 100


def _bound(errors: Sequence[float], designs: int) -> float | None:
    """Return the bound that follows from errors on some designs, rounded up to three digits; None without errors."""
    if not errors:
        return None
    return model_choice.rounded_up((1 + 1 / designs) * max(errors), 3)


def percentile(values: Sequence[float], share: float = 0.95) -> float:
    """Return the least value that a share of the values does not exceed.

    >>> percentile([3.0, 1.0, 2.0, 4.0], 0.5)
    2.0
    """
    return sorted(values)[max(math.ceil(share * len(values)) - 1, 0)]


def as_text(rule: Sequence[Statement], origin: str) -> str:
    """Return the text of model_choice.json: the versions of the models, and a statement on each line."""
    rows = ",\n".join(json_line(records.known(asdict(each))) for each in rule)
    made = f'"made": {json.dumps(origin)}, "versions": {json.dumps(model_choice.versions())}'
    return f'{{{made}, "statements": [\n{rows}\n]}}\n'


@dataclass(frozen=True, slots=True)
class Confirmation:
    """A tolerance on a random design under one load: which model the rule chooses, and its true error.

    Attributes
    ----------
    model : chosen model; empty if the rule refuses.
    error : largest true error of the counted quantities, a fraction; None if refused or without a reference.
    """

    kind: str
    design: int
    depth_mm: float
    shear_mm: float
    tolerance: float
    model: str
    status: str
    expected: float | None = None
    error: float | None = None

    def row(self) -> FlatRow:
        """Return the columns of confirm.csv."""
        return records.flat(self)


def confirm(states: Sequence[TradeState], rule: Sequence[Statement]) -> Iterator[Confirmation]:
    """Yield a result for each tolerance, random design and load."""
    cases: dict[tuple[Kind, int, float, float], dict[tuple[str, str], TradeState]] = {}
    for state in states:
        if state.confirming:
            place = state.kind, state.design, state.load.depth, state.load.shear_x
            cases.setdefault(place, {})[state.model, state.level] = state
    for place, models in cases.items():
        for tolerance in TOLERANCES:
            yield _confirmed(place, tolerance, models, rule)


def _confirmed(
    place: tuple[Kind, int, float, float],
    tolerance: float,
    models: Mapping[tuple[str, str], TradeState],
    rule: Sequence[Statement],
) -> Confirmation:
    """Return the result of a case: the model of the rule, or a finer one where its answer asks for it."""
    some = next(iter(models.values()))
    trial = trade_cases.trial(some.design, some.kind, "auto", confirm=True)
    case = trial.design, [some.load]
    try:
        choice: Choice | None = model_choice.choose(*case, tolerance, trial.magnet, rule=rule)
    except BadInput:
        choice = None
    while choice is not None:
        state = models.get((choice.model, choice.level_or_accuracy))
        if state is None:
            return Confirmation(*place, tolerance, choice.name, "not run", choice.bound)
        if not state.errors:
            return Confirmation(*place, tolerance, choice.name, state.status, choice.bound)
        if not model_choice.unmet(choice, tolerance, trial.design, some.load, state.along_N):
            error = max(state.errors[name].percent for name in COUNTED if name in state.errors) / 100
            status = "within" if error <= tolerance else "exceeded"
            return Confirmation(*place, tolerance, choice.name, status, choice.bound, error)
        choice = model_choice.finer(*case, choice, trial.magnet, rule=rule)
    return Confirmation(*place, tolerance, "", "refused")


@dataclass(frozen=True, slots=True)
class Confirmed:
    """Results of one tolerance and kind.

    Attributes
    ----------
    refused : cases for which the rule knows no model that meets the tolerance.
    unjudged : cases without a reference, or whose chosen model was not run.
    formulas, surrogate : cases for which the rule chooses formulas, and the surrogate.
    worst : largest error over the tolerance.
    """

    kind: str
    tolerance_percent: float
    cases: int
    refused: int
    unjudged: int
    formulas: int
    surrogate: int
    within: int
    share_percent: float
    worst: float

    @property
    def judged(self) -> int:
        """Number of cases with a true error."""
        return self.cases - self.refused - self.unjudged

    def row(self) -> FlatRow:
        """Return the columns of the table of TRADE.md."""
        return records.flat(self)


def summary(results: Sequence[Confirmation]) -> list[Confirmed]:
    """Return the results by kind and tolerance, by tolerance over all kinds, and those of the last draw alone."""
    table = []
    first = trade_cases.CONFIRMED - trade_cases.DRAWN
    for kind in (*trade_cases.KINDS, "all", LAST):
        for tolerance in TOLERANCES:
            own = [
                each
                for each in results
                if each.tolerance == tolerance
                and (kind in ("all", each.kind) or (kind == LAST and each.design >= first))
            ]
            judged = [each for each in own if each.error is not None]
            if not own:
                continue
            within = sum(each.status == "within" for each in judged)
            table.append(
                Confirmed(
                    kind,
                    100 * tolerance,
                    len(own),
                    sum(each.status == "refused" for each in own),
                    len(own) - len(judged) - sum(each.status == "refused" for each in own),
                    sum(each.model.startswith("formula") for each in own),
                    sum(each.model.startswith(SURROGATE) for each in own),
                    within,
                    100 * within / len(judged) if judged else math.nan,
                    max((each.error / tolerance for each in judged if each.error is not None), default=math.nan),
                )
            )
    return table


def goals(results: Sequence[Confirmation], kinds: Sequence[Kind] = trade_cases.KINDS) -> list[Goal]:
    """Return the goals of the confirmation: every case is judged, and within the tolerance.

    Parameters
    ----------
    kinds : those that were to be confirmed; one without a judged case misses its goals.
    """
    table = summary(results)
    posed = []
    for kind in (*kinds, "all", LAST):
        own = [row for row in table if row.kind == kind]
        posed.append(
            Goal(f"{kind}, cases without a judgement", sum(r.unjudged for r in own), 0, sum(r.cases for r in own))
        )
        if not any(row.judged for row in own):
            posed.append(Goal(f"{kind}, cases within the tolerance", None, 100 * SHARE, 0, "%", at_least=True))
        # a tolerance at which the rule refuses every case promises nothing
        for row in (row for row in own if row.judged):
            where = f"{kind}, tolerance {row.tolerance_percent:g} %"
            posed += [
                Goal(f"{where}, cases within it", row.share_percent, 100 * SHARE, row.judged, "%", at_least=True),
                Goal(f"{where}, largest error over it", row.worst, FACTOR, row.judged),
            ]
    return posed
