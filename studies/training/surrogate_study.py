"""The study that builds the surrogate: training beams, some of them where it is least sure, and a test on new beams.

The first training beams fill the range evenly. Each round then adds the beams, of a large random pool, whose shears
have the widest intervals, one after the other: every one narrows the intervals around it before the next is chosen.
Random beams at random depths and shears scale the intervals, and other such beams are the test, and serve for nothing
else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from fem.accuracy import QUICK, STANDARD, Accuracy
from geometry.arrays import Array
from geometry.messages import Progress
from studies.exploration.needed_paths import Processes
from studies.exploration.store import Store
from studies.output.provenance import versions
from studies.surrogate import prediction, surrogate_range
from studies.surrogate.gaussian_process import GaussianProcess, correlation
from studies.surrogate.surrogate_file import Surrogate
from studies.training.state_errors import StateError, errors, recalibrated
from studies.training.surrogate_fit import TrainingSet, surrogate_of
from studies.training.training_beams import Beams, random_beams, training_beams
from studies.training.training_states import Solver, shear_depth

POOL = 1500
"""Random beams among which the next training beams are chosen."""
RANDOM_DEPTHS, RANDOM_SHEARS = 5, 3
"""Random depths of each press, and random shears, for calibration and test."""
CALIBRATION = 1000
"""Added to the seed for the beams of the calibration."""


@dataclass(frozen=True, slots=True)
class Extent:
    """Size of the study; of the first and of the test beams those with too thin a base are left out.

    Attributes
    ----------
    first : number of evenly spread training beams.
    rounds : number of beams that each round adds where intervals are widest.
    calibration : number of random beams that scale the intervals.
    test : number of beams of the test; `critical` of them also with their critical depth by `fem.stability`.
    """

    first: int = 300
    rounds: tuple[int, ...] = (100,)
    calibration: int = 120
    test: int = 220
    critical: int = 60
    accuracy: Accuracy = STANDARD
    seed: int = 1


FEW = Extent(first=40, rounds=(8,), calibration=12, test=12, critical=2, accuracy=QUICK)
"""A study of some minutes, whose surrogate has errors of 10 %."""


@dataclass(frozen=True, slots=True)
class Test:
    """Beams that training has not seen, with their states.

    Attributes
    ----------
    critical : critical depths of the first beams over D, infinite where there is none.
    """

    set: TrainingSet
    critical: Array


@dataclass(frozen=True, slots=True)
class Result:
    """The surrogate, its training set, and the test.

    Attributes
    ----------
    failed : number of beams of training and of test that are left out because a state failed.
    """

    surrogate: Surrogate
    training: TrainingSet
    test: Test
    failed: tuple[int, int]

    @property
    def errors(self) -> list[StateError]:
        """Errors in all states of the test."""
        return errors(self.surrogate, self.test.set, self.test.critical)


def run(extent: Extent, store: Store, processes: Processes, progress: Progress | None = None) -> Result:
    """Build and test the surrogate; states that the store has are not solved again."""
    solver = Solver(store, processes, progress, extent.accuracy)
    beams = training_beams(extent.first, extent.seed)
    beams = beams[beams.in_range]
    states = training_states(solver, beams)
    for k, count in enumerate(extent.rounds):
        surrogate = surrogate_of(states.complete(), {})
        pool = random_beams(POOL, extent.seed + 2 + k)
        more = widest(surrogate, pool[pool.in_range], count)
        states = states.joined(training_states(solver, more))
    complete = states.complete()
    calibration = random_states(solver, extent.calibration, extent.seed + CALIBRATION)
    test = random_states(solver, extent.test, extent.seed + 1)
    tested = test.complete()
    critical = solver.critical_depths(tested.beams[: extent.critical])
    about = {
        "accuracy": solver.accuracy.name,
        "beams": len(complete.beams),
        "test_beams": len(tested.beams),
        "versions": versions(),
    }
    surrogate = surrogate_of(complete, about)
    surrogate = recalibrated(surrogate, errors(surrogate, calibration.complete()))
    failed = len(states.beams) - len(complete.beams), len(test.beams) - len(tested.beams)
    return Result(surrogate, complete, Test(tested, critical), failed)


def training_states(solver: Solver, beams: Beams) -> TrainingSet:
    """Return the states of training beams: at the nodes of the surrogate."""
    press = solver.presses(beams, surrogate_range.press_depths(beams.L, beams.height))
    mode = solver.first_modes(beams)
    shear = solver.shears(beams, shear_depth(beams, press), surrogate_range.shears(beams.L))
    return TrainingSet(beams, press, mode, shear)


def random_states(solver: Solver, count: int, seed: int) -> TrainingSet:
    """Return the states of random beams in the range at random depths and shears."""
    beams, rng = random_beams(count, seed), np.random.default_rng(seed)
    depths, shears = random_depths(beams, rng), random_shears(beams, rng)
    inside = beams.in_range
    beams, depths, shears = beams[inside], depths[inside], shears[inside]
    press = solver.presses(beams, depths)
    mode = solver.first_modes(beams)
    return TrainingSet(beams, press, mode, solver.shears(beams, shear_depth(beams, press), shears))


def random_shears(beams: Beams, rng: np.random.Generator) -> Array:
    """Return random shears of beams over D, shape (n, RANDOM_SHEARS), rising."""
    least = surrogate_range.SHEAR_NODES[0] / 2
    part = np.sort(least + (1 - least) * rng.random((len(beams), RANDOM_SHEARS)), axis=1)
    return np.asarray(np.round(part * surrogate_range.farthest(beams.L)[:, None], 6))


def random_depths(beams: Beams, rng: np.random.Generator) -> Array:
    """Return random depths of beams over D, spread in their root, shape (n, RANDOM_DEPTHS), rising."""
    low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(surrogate_range.deepest(beams.L, beams.height))
    share = np.sort(rng.random((len(beams), RANDOM_DEPTHS)), axis=1)
    return np.asarray(np.round((low + (high[:, None] - low) * share) ** 2, 6))


def widest(surrogate: Surrogate, pool: Beams, count: int) -> Beams:
    """Return the beams of a pool at which the next finite elements narrow the widest intervals.

    The width at a point is the spread of the shear's process, at a depth in the middle of the beam's range, times the
    mean quantile of its region.
    """
    group = surrogate.groups["shear"]
    x = prediction.features(pool.L, pool.diameter, pool.height, pool.nu, pool.edge)
    low, high = np.sqrt(surrogate_range.SHALLOWEST_SHEAR), np.sqrt(surrogate_range.deepest(pool.L, pool.height))
    depth = (low + (high - low) * pool.share) ** 2
    region = prediction.shear_region(prediction.beam_region(pool.L, pool.height), depth)
    quantile = np.mean([values.mean(axis=1) for values in group.quantiles.values()], axis=0)
    points = prediction.shear_features(x, depth)
    return pool[widest_points(group.process, points, quantile[region], count)]


def widest_points(process: GaussianProcess, points: Array, weight: Array, count: int) -> NDArray[np.int64]:
    """Return the indices of points (m, p) with the widest intervals, each after all before it have been added.

    Parameters
    ----------
    weight : factor on the spread at each point, shape (m,).
    """
    k = correlation(points / process.lengths, process.x / process.lengths)
    v = linalg.solve_triangular(process.factor, k.T, lower=True)
    covariance = correlation(points / process.lengths, points / process.lengths) - v.T @ v
    chosen: list[int] = []
    for _ in range(min(count, len(points))):
        width = weight * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        width[chosen] = -1.0
        best = int(np.argmax(width))
        chosen.append(best)
        # condition on the new point: one step of a pivoted Cholesky factorisation
        column = covariance[:, best] / np.sqrt(covariance[best, best] + process.nugget)
        covariance -= np.outer(column, column)
    return np.array(chosen, dtype=np.int64)
