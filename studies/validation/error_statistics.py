"""What the states of `accuracy` amount to: statistics by level, scene and quantity, and broken promises."""

from __future__ import annotations

import math
import statistics
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from studies.output import records
from studies.output.records import FlatRow
from studies.validation.error_study import CLEAR, COVERAGE, GOALS, QUANTITIES, RESPONSES, SHARP, SHARPNESS, WIDER
from studies.validation.error_study_records import ErrorState, PathSolve

Key = TypeVar("Key", bound=Hashable)

LEAST_STATES = 8
"""Fewer states than this allow no verdict on shares."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """True errors of several states, and how their estimates keep the promises.

    Attributes
    ----------
    coverage : share of the states whose true error is at most the estimate.
    sharpness : share of the states whose estimate is at most SHARP true errors, or CLEAR.
    """

    states: int
    median_percent: float
    p95_percent: float
    max_percent: float
    coverage: float
    sharpness: float


@dataclass(frozen=True, slots=True)
class LevelErrors:
    """Errors of a quantity at a level of accuracy, with its goal."""

    level: str
    model: str
    scene: str
    quantity: str
    statistics: Statistics = field(metadata={"prefix": ""})
    goal_percent: float
    met: bool

    def row(self) -> FlatRow:
        """Its columns in ACCURACY.md, in a printed table and in JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class EstimateShares:
    """Errors of a quantity over all levels, of all designs or of the odd ones."""

    model: str
    scene: str
    quantity: str
    designs: str
    statistics: Statistics = field(metadata={"prefix": ""})

    def row(self) -> FlatRow:
        """Its columns in ACCURACY.md, in a printed table and in JSON."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class ReferenceErrors:
    """How far the reference is from a finer mesh in one state; NaN where there is nothing to be relative to."""

    design: int
    scene: str
    depth_mm: float
    shear_mm: float
    force_percent: float
    shift_percent: float
    tilt_percent: float
    sideways_percent: float

    def row(self) -> FlatRow:
        """Its columns in ACCURACY.md."""
        return records.flat(self)


@dataclass(frozen=True, slots=True)
class MeshNoise:
    """Relative standard deviation of the half model's answers over its meshes: mean and greatest of the states."""

    level: str
    scene: str
    quantity: str
    states: int
    mean_percent: float
    max_percent: float

    def row(self) -> FlatRow:
        """Its columns in ACCURACY.md."""
        return records.flat(self)


def summary(states: Sequence[ErrorState]) -> list[LevelErrors]:
    """Statistics of each level, model, scene and quantity, in that order."""
    table = []
    groups = _grouped(ended_well(states), lambda state: (state.level, _model(state), state.scene))
    for (level, model, scene), members in groups.items():
        for name in QUANTITIES:
            if pairs := pairs_of(members, name):
                goal, worst = WIDER.get(scene, GOALS)[level], max(true for true, _ in pairs)
                table.append(LevelErrors(level, model, scene, name, _statistics(pairs), 100 * goal, worst <= goal))
    return table


def shares(states: Sequence[ErrorState]) -> list[EstimateShares]:
    """Coverage and sharpness of each scene and quantity over all levels, of all designs and of the odd ones."""
    table = []
    groups = _grouped(ended_well(states), lambda state: (_model(state), state.scene))
    for (model, scene), members in groups.items():
        for name in QUANTITIES:
            for designs, chosen in (("all", members), ("odd", [state for state in members if state.odd])):
                if pairs := pairs_of(chosen, name):
                    table.append(EstimateShares(model, scene, name, designs, _statistics(pairs)))
    return table


def references(states: Sequence[ErrorState]) -> list[ReferenceErrors]:
    """How far the reference is from a finer mesh, in percent of each quantity."""
    table = []
    for state in states:
        if state.level == "reference" and state.status == "ok":
            errors = {judged.quantity: 100 * judged.error for judged in state.judged}
            force, shift, tilt, sideways = (errors[name] for name in RESPONSES)
            place = state.design, state.scene, state.depth_mm, state.shear_mm
            table.append(ReferenceErrors(*place, force, shift, tilt, sideways))
    return table


def ended_well(states: Iterable[ErrorState]) -> list[ErrorState]:
    """The states of the levels that ended well."""
    return [state for state in states if state.status == "ok" and state.level in GOALS]


def pairs_of(states: Iterable[ErrorState], name: str) -> list[tuple[float, float]]:
    """True error and estimate of a quantity in the states that have both."""
    judged = [one for state in states for one in state.judged if one.quantity == name]
    return [(one.error, one.estimate) for one in judged if math.isfinite(one.error) and math.isfinite(one.estimate)]


def verdicts(states: Sequence[ErrorState]) -> list[str]:
    """One sentence for each promise that is not kept."""
    sentences = []
    for share in shares(states):
        numbers = share.statistics
        if share.designs != "all" or numbers.states < LEAST_STATES:
            continue
        where = f"{share.model} {share.scene}, {share.quantity}"
        if not numbers.coverage >= COVERAGE:
            sentences.append(f"{where}: {numbers.coverage:.0%} of the true errors lie below the estimate")
        if not numbers.sharpness >= SHARPNESS:
            sentences.append(f"{where}: {numbers.sharpness:.0%} of the estimates lie below {SHARP:g} true errors")
    for errors in summary(states):
        if not errors.met:
            where = f"{errors.model} {errors.scene}, {errors.quantity}, {errors.level}"
            worst = errors.statistics.max_percent
            sentences.append(f"{where}: an error of {worst:.2g} %, goal {errors.goal_percent:g} %")
    return sentences


def noise(states: Sequence[ErrorState]) -> list[MeshNoise]:
    """Spread of the half model's answers over meshes that differ in nothing but chance."""
    half = [state for state in states if state.model == "half" and state.status == "ok"]
    loads = _grouped(half, lambda s: (s.level, s.scene, s.design, s.magnet, s.depth_mm, s.shear_mm))
    spreads: dict[tuple[str, str, str], list[float]] = defaultdict(list)
    for (level, scene, *_), repeats in loads.items():
        solves = [state.solve for state in repeats if isinstance(state.solve, PathSolve)]
        if len(solves) < 2:
            continue
        for name, vectors in _vectors(solves).items():
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
    """Each quantity of RESPONSES as vectors, one for each solve."""
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
    """Of true errors and estimates."""
    true = sorted(error for error, _ in pairs)
    return Statistics(
        states=len(pairs),
        median_percent=100 * statistics.median(true),
        p95_percent=100 * true[min(len(true) - 1, math.ceil(0.95 * len(true)) - 1)],
        max_percent=100 * true[-1],
        coverage=sum(t <= e for t, e in pairs) / len(pairs),
        sharpness=sum(e <= max(SHARP * t, CLEAR) for t, e in pairs) / len(pairs),
    )
