"""Statistics of the states of `accuracy` by level, scene and quantity, and the goals that they miss."""

from __future__ import annotations

import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from studies.output import records
from studies.output.goals import Goal
from studies.output.records import FlatRow
from studies.validation.error_study import CLEAR, COVERAGE, GOALS, QUANTITIES, RESPONSES, SHARP, SHARPNESS, WIDER
from studies.validation.error_study_records import UNSTABLE, ErrorState, PathSolve

Key = TypeVar("Key", bound=Hashable)

LEAST_STATES = 8
"""Coverage and sharpness of fewer states are not compared with their goals."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """Statistics of true errors and estimates over several states.

    Attributes
    ----------
    coverage : share of the states whose true error is at most the estimate.
    sharpness : share of the states whose estimate is at most SHARP times the true error, or at most CLEAR.
    """

    states: int
    median_percent: float
    p95_percent: float
    max_percent: float
    coverage: float
    sharpness: float


@dataclass(frozen=True, slots=True)
class LevelErrors:
    """Errors of a quantity at an accuracy level, with their goal."""

    level: str
    model: str
    scene: str
    quantity: str
    statistics: Statistics = field(metadata={"prefix": ""})
    goal_percent: float

    @property
    def goal(self) -> Goal:
        """The goal of the largest error."""
        name = f"{self.model} {self.scene}, {self.quantity}, {self.level}, largest error"
        return Goal(name, self.statistics.max_percent, self.goal_percent, self.statistics.states, "%")

    def row(self) -> FlatRow:
        """Return the columns of ACCURACY.md, of a printed table and of JSON."""
        return records.flat(self) | {"met": self.goal.met}


@dataclass(frozen=True, slots=True)
class EstimateShares:
    """Errors of a quantity over all levels, of all designs or only of the odd ones."""

    model: str
    scene: str
    quantity: str
    designs: str
    statistics: Statistics = field(metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Return the columns of ACCURACY.md, of a printed table and of JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class ReferenceErrors:
    """Relative difference between the reference and a finer mesh in one state; NaN where a value is zero."""

    design: int
    scene: str
    depth_mm: float
    shear_mm: float
    force_percent: float
    shift_percent: float
    tilt_percent: float
    sideways_percent: float

    def row(self) -> FlatRow:
        """Return the columns of ACCURACY.md."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class MeshNoise:
    """Relative standard deviation of the half model's answers over meshes: mean and maximum over the states."""

    level: str
    scene: str
    quantity: str
    states: int
    mean_percent: float
    max_percent: float

    def row(self) -> FlatRow:
        """Return the columns of ACCURACY.md."""
        return records.flat(self)


def summary(states: Sequence[ErrorState]) -> list[LevelErrors]:
    """Return the statistics of each level, model, scene and quantity, in that order."""
    table = []
    groups = _grouped(ended_well(states), lambda state: (state.level, _model(state), state.scene))
    for (level, model, scene), members in groups.items():
        for name in QUANTITIES:
            if pairs := pairs_of(members, name):
                goal = 100 * WIDER.get(scene, GOALS)[level]
                table.append(LevelErrors(level, model, scene, name, _statistics(pairs), goal))
    return table


def shares(states: Sequence[ErrorState]) -> list[EstimateShares]:
    """Return the statistics of each scene and quantity over all levels, for all designs and for the odd ones."""
    table = []
    groups = _grouped(ended_well(states), lambda state: (_model(state), state.scene))
    for (model, scene), members in groups.items():
        for name in QUANTITIES:
            for designs, chosen in (("all", members), ("odd", [state for state in members if state.odd])):
                if pairs := pairs_of(chosen, name):
                    table.append(EstimateShares(model, scene, name, designs, _statistics(pairs)))
    return table


def references(states: Sequence[ErrorState]) -> list[ReferenceErrors]:
    """Return the differences between the reference and a finer mesh, in percent."""
    table = []
    for state in states:
        if state.level == "reference" and state.status == "ok":
            errors = {judged.quantity: 100 * judged.error for judged in state.judged}
            force, shift, tilt, sideways = (errors[name] for name in RESPONSES)
            place = state.design, state.scene, state.depth_mm, state.shear_mm
            table.append(ReferenceErrors(*place, force, shift, tilt, sideways))
    return table


def ended_well(states: Iterable[ErrorState]) -> list[ErrorState]:
    """Return the states with status "ok" at levels quick, standard and fine."""
    return [state for state in states if state.status == "ok" and state.level in GOALS]


def pairs_of(states: Iterable[ErrorState], name: str) -> list[tuple[float, float]]:
    """Return true error and estimate of a quantity in each state that has an error; an unknown estimate is NaN."""
    judged = [one for state in states for one in state.judged if one.quantity == name]
    return [(one.error, one.estimate) for one in judged if math.isfinite(one.error)]


def goals(states: Sequence[ErrorState]) -> list[Goal]:
    """Return the goals of the study: states compared, coverage and sharpness, largest error of each level."""
    lost = sum(state.status not in ("ok", *UNSTABLE) for state in states)
    posed = [Goal("states without a comparison", lost, 0, len(states))]
    for share in shares(states):
        numbers = share.statistics
        if share.designs != "all" or numbers.states < LEAST_STATES:
            continue
        where = f"{share.model} {share.scene}, {share.quantity}"
        for name, value, bound in (
            ("true errors that are at most the estimate", numbers.coverage, COVERAGE),
            (f"estimates that are at most {SHARP:g} times the true error", numbers.sharpness, SHARPNESS),
        ):
            posed.append(Goal(f"{where}, {name}", 100 * value, 100 * bound, numbers.states, "%", at_least=True))
    return posed + [errors.goal for errors in summary(states)]


def noise(states: Sequence[ErrorState]) -> list[MeshNoise]:
    """Return the spread of the half model's answers over meshes of practically the same size."""
    half = [state for state in states if state.model == "half" and state.status == "ok"]
    loads = _grouped(half, lambda s: (s.level, s.scene, s.design, s.magnet, s.depth_mm, s.shear_mm))
    spreads: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for (level, scene, *_), repeats in loads.items():
        solves = [state.solve for state in repeats if isinstance(state.solve, PathSolve)]
        if len(solves) < 2:
            continue
        for name, vectors in _vectors(solves).items():
            # a press has neither; a relative deviation would divide by mesh noise
            if scene in ("press", "pressed") and name in ("tilt", "sideways"):
                continue
            components = list(zip(*vectors, strict=True))
            size = math.hypot(*map(statistics.fmean, components))
            spreads[level, scene, name].append(math.hypot(*map(statistics.stdev, components)) / size)
    return [
        MeshNoise(*group, len(values), 100 * statistics.fmean(values), 100 * max(values))
        for group, values in spreads.items()
    ]


def _vectors(solves: Sequence[PathSolve]) -> dict[str, list[tuple[float, ...]]]:
    """Return each quantity of RESPONSES as vectors, one for each solve."""
    return {
        "force": [(solve.force_x_N, solve.force_z_N) for solve in solves],
        "shift": [(solve.shift_x_mm, solve.shift_z_mm) for solve in solves],
        "tilt": [(solve.tilt_rad,) for solve in solves],
        "sideways": [(solve.force_x_N,) for solve in solves],
    }


def _model(state: ErrorState) -> str:
    return "half" if state.model == "half" else "section"


def _grouped(states: Iterable[ErrorState], key: Callable[[ErrorState], Key]) -> dict[Key, list[ErrorState]]:
    groups: dict[Key, list[ErrorState]] = {}
    for state in states:
        groups.setdefault(key(state), []).append(state)
    return groups


def _statistics(pairs: Sequence[tuple[float, float]]) -> Statistics:
    """Return the statistics of pairs of true error and estimate."""
    true = sorted(error for error, _ in pairs)
    return Statistics(
        states=len(pairs),
        median_percent=100 * statistics.median(true),
        p95_percent=100 * true[min(len(true) - 1, math.ceil(0.95 * len(true)) - 1)],
        max_percent=100 * true[-1],
        coverage=sum(t <= e for t, e in pairs) / len(pairs),
        sharpness=sum(e <= max(SHARP * t, CLEAR) for t, e in pairs) / len(pairs),
    )
