"""Errors of the surrogate on beams that training has not seen, and whether its intervals hold.

Errors are in percent of the yardstick of the quantity: of the value itself, of the length of the vector of force or
shift in a shear, of the loss 1 - k/k_0 of the sideways stiffness, of the critical depth. An interval holds the truth
if it holds every value that the own error of the finite elements allows, and a beam is covered if all of its states
are.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from analytic import beam
from geometry.arrays import Array
from geometry.design import BadInput
from geometry.loads import Load
from studies.output.goals import Goal
from studies.surrogate import surrogate_range
from studies.surrogate.prediction import DEEP, SLENDER, THICK, WIDE, Beams
from studies.validation.calibration import COVERAGE
from studies.validation.length_scales import fitted
from studies.validation.state_errors import StateError
from studies.validation.surrogate_fit import TrainingSet, press_outputs
from studies.validation.surrogate_study import Result
from studies.validation.training_beams import DIAMETER_MM, random_beams

GOALS = {"force": 2.0, "force_x": 2.0, "force_z": 2.0, "tilt": 3.0}
"""Largest 95th percentile of the errors, %, of presses and shears."""
DOUBT = 0.01
"""Probability that so few beams are covered as a goal refuses, if nine of ten are: a goal for each quantity and group
is refused by chance about once in as many goals as there are in a table."""
FINITE_NODES, FEWEST = 5, 30
"""Depths of training within the range of level finite in most beams; least number of beams of a comparison."""
REGIONS: dict[str, Callable[[StateError], bool]] = {
    "all": lambda _: True,
    f"slender, L/D above {SLENDER:g}": lambda one: one.L_over_D > SLENDER,
    "slender, thin magnet": lambda one: one.L_over_D > SLENDER and one.magnet_height_over_D <= THICK,
    f"thick magnet, above {THICK:g} D": lambda one: one.magnet_height_over_D > THICK,
    "wide thin magnet": lambda one: one.magnet_diameter_over_D > WIDE and one.magnet_height_over_D <= THICK,
    f"wide thin magnet, L/D to {SLENDER:g}": lambda one: (
        one.magnet_diameter_over_D > WIDE and one.magnet_height_over_D <= THICK and one.L_over_D <= SLENDER
    ),
    f"deep, depth above {DEEP:g} D": lambda one: one.kind in ("press", "shear") and one.depth_over_D > DEEP,
    "nu below 0.49": lambda one: one.nu < 0.49,
}


@dataclass(frozen=True, slots=True)
class Summary:
    """Errors of a quantity in a region.

    Attributes
    ----------
    median_percent, p95_percent, largest_percent : of the errors; NaN if any of them is unknown.
    covered_percent : share of states whose interval holds the truth.
    interval_percent, fem_error_percent : median half width, and median own error of the finite elements.
    covered_beams_percent : share of beams of which every interval holds the truth.
    least_covered_percent : its goal, the least share that is likely if nine of ten beams are covered.
    """

    kind: str
    quantity: str
    region: str
    beams: int
    states: int
    median_percent: float
    p95_percent: float
    largest_percent: float
    covered_percent: float
    interval_percent: float
    fem_error_percent: float
    covered_beams_percent: float
    least_covered_percent: float


@dataclass(frozen=True, slots=True)
class Trend:
    """95th percentiles of left-out errors of the press force with different trends, or of a formula alone, %."""

    compared: str
    beams: int
    surrogate_percent: float
    formula_percent: float


def summaries(rows: Sequence[StateError]) -> list[Summary]:
    """Return the statistics of each quantity in each region: over all first, then region by region."""
    quantities = list(dict.fromkeys((row.kind, row.quantity) for row in rows))
    table = []
    for region, belongs in REGIONS.items():
        for kind, name in quantities:
            own = [row for row in rows if (row.kind, row.quantity) == (kind, name) and belongs(row)]
            if own:
                table.append(_summary(kind, name, region, own))
    return table


def _summary(kind: str, name: str, region: str, rows: Sequence[StateError]) -> Summary:
    sizes = np.abs([row.error_percent for row in rows])
    covered: dict[int, bool] = {}
    for row in rows:
        covered[row.beam] = covered.get(row.beam, True) and row.covered
    count = len(covered)
    return Summary(
        kind=kind,
        quantity=name,
        region=region,
        beams=count,
        states=len(rows),
        median_percent=float(np.median(sizes)),
        p95_percent=float(np.percentile(sizes, 95)),
        largest_percent=float(sizes.max()),
        covered_percent=100 * float(np.mean([row.covered for row in rows])),
        interval_percent=float(np.median([row.interval_percent for row in rows])),
        fem_error_percent=float(np.median([row.fem_error_percent for row in rows])),
        covered_beams_percent=100 * sum(covered.values()) / count,
        least_covered_percent=100 * least_covered(count) / count,
    )


def least_covered(count: int) -> int:
    """Return how many of `count` beams must be covered: fewer have a probability below DOUBT if nine of ten are.

    >>> least_covered(20), least_covered(120)
    (14, 100)
    """
    return int(stats.binom.ppf(DOUBT, count, COVERAGE))


def goals(table: Sequence[Summary]) -> list[Goal]:
    """Return the goals of the errors and of the coverage, for each quantity and region."""
    found = []
    for row in table:
        name = f"{row.kind}, {row.quantity}, {row.region}"
        if row.kind in ("press", "shear") and row.quantity in GOALS:
            bound = GOALS[row.quantity]
            found.append(Goal(f"{name}: 95th percentile of the errors", row.p95_percent, bound, row.states, "%"))
        covered, least = row.covered_beams_percent, row.least_covered_percent
        found.append(Goal(f"{name}: beams that the intervals hold", covered, least, row.beams, "%", at_least=True))
    return found


def trends(result: Result) -> list[Trend]:
    """Compare the surrogate's forms with formulas as trends, and the formula of level finite alone with it.

    As a trend, a formula divides the force, and the process interpolates the ratio.
    """
    training = result.training
    logs, features = press_outputs(training.press)["force"], training.features
    table = []
    for level, nodes in (("paper", surrogate_range.PRESS_NODES), ("finite", FINITE_NODES)):
        forms = _formula_logs(training, level)[:, :nodes]
        rows = ~np.isnan(forms).any(axis=1)
        if rows.sum() >= FEWEST:
            own, other = (
                _left_out_percent(features[rows], values[rows])
                for values in (logs[:, :nodes], logs[:, :nodes] - forms)
            )
            table.append(Trend(f"level {level} as trend, against none", int(rows.sum()), own, other))
    test = result.test.set
    b = test.beams
    predicted = Beams(b.L, b.diameter, b.height, b.nu, b.edge, result.surrogate).press(test.press.depth)["force"]
    forms = _formula_logs(test, "finite")
    inside = ~np.isnan(forms)
    if inside.any():
        truth = test.press.quantities["force_z"]
        values = predicted.value, np.exp(forms) * test.press.depth**1.5
        surrogate, formula = (
            100 * float(np.percentile(np.abs(v - truth)[inside] / truth[inside], 95)) for v in values
        )
        name = "level finite alone, in its range, on unseen beams"
        table.append(Trend(name, int(inside.any(axis=1).sum()), surrogate, formula))
    return table


def _left_out_percent(x: Array, y: Array) -> float:
    predicted, _ = fitted(x, y).left_out()
    return 100 * float(np.percentile(np.abs(1 - np.exp(y - predicted)), 95))


def _formula_logs(states: TrainingSet, level: str) -> Array:
    """Return the logarithms of F / d^1.5 by a formula in its range, NaN outside, shape (n, depths)."""
    logs = np.full(states.press.depth.shape, np.nan)
    for k, row in enumerate(states.press.depth):
        design = states.beams.design(k)
        for i, depth in enumerate(row):
            load = Load(depth=float(depth) * DIAMETER_MM)
            try:
                if beam.outside(design, load, level):
                    continue
                force = beam.solve(design, load, level).force[2]
            except BadInput:
                continue
            logs[k, i] = math.log(force / DIAMETER_MM**2 / depth**1.5)
    return logs


def designs_per_second(result: Result, count: int = 10_000) -> Mapping[str, float]:
    """Return how many designs a CPU second takes, with intervals."""
    b = random_beams(count, 11)
    begin = time.process_time()
    beams = Beams(b.L, b.diameter, b.height, b.nu, b.edge, result.surrogate)
    beams.press(0.5 * beams.deepest[:, None])
    press = time.process_time()
    beams.shear(0.5 * beams.deepest[:, None], 0.5 * beams.farthest[:, None])
    beams.critical_depth()
    beams.first_mode(b.density_ratio)
    end = time.process_time()
    return {"press": count / (press - begin), "press, shear, critical depth and mode": count / (end - begin)}
