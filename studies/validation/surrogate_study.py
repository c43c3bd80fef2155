"""The study that builds the surrogate: training beams, some of them where it is least sure, and a test on new beams.

The first training beams fill the range evenly. Each round then adds the beams, of a large random pool, whose shears
have the widest intervals, one after the other: every one narrows the intervals around it before the next is chosen.
Random beams at random depths and shears scale the intervals, and other such beams are the test, and serve for nothing
else. Both have the same number of beams in each region, so that none is judged by the others.

Errors are in percent of the yardstick of the quantity: of the value itself, of the length of the vector of force or
shift in a shear, of the loss 1 - k/k_0 of the sideways stiffness, of the critical depth. They are differences from
finite elements at the level of training, whose own error is estimated: an interval counts as holding the truth only
if it holds every value that this estimate allows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from fem.accuracy import QUICK, STANDARD, Accuracy
from geometry.arrays import Array
from geometry.messages import Progress
from studies.mechanics import prediction, surrogate_range
from studies.mechanics.gaussian_process import GaussianProcess, correlation
from studies.mechanics.prediction import CRITICAL, Quantity
from studies.mechanics.solve_plan import Processes, Solver
from studies.mechanics.store import Store
from studies.mechanics.surrogate_file import Group, Surrogate
from studies.output.provenance import versions
from studies.validation.surrogate_fit import TrainingSet, quantiles_by_region, surrogate_of
from studies.validation.surrogate_training import (
    Beams,
    States,
    compared,
    critical_depths,
    density_ratio,
    first_modes,
    presses,
    random_beams,
    regional_beams,
    shear_depth,
    shears,
    training_beams,
)

POOL = 1500
"""Random beams among which the next training beams are chosen."""
RANDOM_DEPTHS, RANDOM_SHEARS = 5, 2
"""Random depths of each press, and random shears, for calibration and test."""
CALIBRATION = 1000
"""Added to the seed for the beams of the calibration."""


@dataclass(frozen=True, slots=True)
class Extent:
    """Size of the study.

    Attributes
    ----------
    first : number of training beams in the corners and evenly spread.
    rounds : number of beams that each round adds where intervals are widest.
    calibration, test : number of random beams of each region that scale the intervals, and that test them.
    critical : number of beams of each region, of both, with their critical depth by `fem.analyses.stability`.
    """

    first: int = 200
    rounds: tuple[int, ...] = (80, 80, 80)
    calibration: int = 24
    test: int = 20
    critical: int = 10
    accuracy: Accuracy = STANDARD
    seed: int = 1


FEW = Extent(first=48, rounds=(8,), calibration=2, test=2, critical=1, accuracy=QUICK)
"""A study of some minutes, whose surrogate has errors of 10 %."""


@dataclass(frozen=True, slots=True)
class Unseen:
    """Beams that training has not seen, with their states.

    Attributes
    ----------
    critical : critical depths of the first beams.
    failed : number of beams that are left out because a state failed.
    """

    set: TrainingSet
    critical: States
    failed: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """The surrogate, its training set, and the test.

    Attributes
    ----------
    failed : number of beams of training and of test that are left out because a state failed.
    """

    surrogate: Surrogate
    training: TrainingSet
    test: Unseen
    failed: tuple[int, int]

    def errors(self) -> Errors:
        """Errors in all states of the test."""
        import pandas as pd

        unseen = self.test.set, self.test.critical
        tables = errors(self.surrogate, unseen[0]), critical_errors(self.surrogate, *unseen)
        return pd.concat(tables, ignore_index=True)


def run(extent: Extent, store: Store, processes: Processes, progress: Progress | None = None) -> Outcome:
    """Build and test the surrogate; states that the store has are not solved again."""
    solver = Solver(store, processes, progress, extent.accuracy)
    states = training_states(solver, training_beams(extent.first, extent.seed))
    for k, count in enumerate(extent.rounds):
        surrogate = surrogate_of(states.complete(), {})
        more = widest(surrogate, random_beams(POOL, extent.seed + 2 + k), count)
        states = states.joined(training_states(solver, more))
    complete = states.complete()
    calibration = unseen(solver, extent.calibration, extent.critical, extent.seed + CALIBRATION)
    test = unseen(solver, extent.test, extent.critical, extent.seed + 1)
    about = {
        "accuracy": solver.accuracy.name,
        "beams": len(complete.beams),
        "calibration_beams": len(calibration.set.beams),
        "test_beams": len(test.set.beams),
        "versions": versions(),
    }
    surrogate = surrogate_of(complete, about)
    surrogate = recalibrated(surrogate, errors(surrogate, calibration.set))
    # the half widths of critical depths follow those of the sideways stiffness
    surrogate = recalibrated(surrogate, critical_errors(surrogate, calibration.set, calibration.critical))
    failed = len(states.beams) - len(complete.beams), test.failed
    return Outcome(surrogate, complete, test, failed)


def training_states(solver: Solver, beams: Beams) -> TrainingSet:
    """Return the states of training beams: at the nodes of the surrogate."""
    press = presses(solver, beams, surrogate_range.press_depths(beams.L, beams.diameter, beams.height))
    mode = first_modes(solver, beams)
    shear = shears(solver, beams, shear_depth(beams, press), surrogate_range.shears(beams.L))
    return TrainingSet(beams, press, mode, shear)


def unseen(solver: Solver, count: int, critical: int, seed: int) -> Unseen:
    """Return `count` random beams of each region with their states, and critical depths of the first ones."""
    states = random_states(solver, regional_beams(count, seed), seed)
    complete = states.complete()
    first = complete.beams[: critical * prediction.REGIONS]
    depths = compared(critical_depths(solver, first), critical_depths(solver.coarser(), first))
    return Unseen(complete, depths, len(states.beams) - len(complete.beams))


def random_states(solver: Solver, beams: Beams, seed: int) -> TrainingSet:
    """Return the states of beams at random depths and shears; those of the first do not depend on the others.

    All have an estimate of the finite elements' own error, which the coarser mesh gives where answers have none.
    """
    depths = random_depths(beams, np.random.default_rng((seed, 1)))
    sideways = random_shears(beams, np.random.default_rng((seed, 2)))
    press = presses(solver, beams, depths)
    sheared = shear_depth(beams, press)
    other = solver.coarser()
    return TrainingSet(
        beams,
        compared(press, presses(other, beams, depths)),
        compared(first_modes(solver, beams), first_modes(other, beams)),
        compared(shears(solver, beams, sheared, sideways), shears(other, beams, sheared, sideways)),
    )


def random_shears(beams: Beams, rng: np.random.Generator) -> Array:
    """Return random shears of beams over D, shape (n, RANDOM_SHEARS), rising."""
    least = surrogate_range.SHEAR_NODES[0] / 2
    part = np.sort(least + (1 - least) * rng.random((len(beams), RANDOM_SHEARS)), axis=1)
    return np.asarray(np.round(part * surrogate_range.farthest(beams.L)[:, None], 6))


def random_depths(beams: Beams, rng: np.random.Generator) -> Array:
    """Return random depths of beams over D, spread in their root, shape (n, RANDOM_DEPTHS), rising."""
    low, high = (
        np.sqrt(surrogate_range.SHALLOWEST),
        np.sqrt(surrogate_range.deepest(beams.L, beams.diameter, beams.height)),
    )
    share = np.sort(rng.random((len(beams), RANDOM_DEPTHS)), axis=1)
    return np.asarray(np.round((low + (high[:, None] - low) * share) ** 2, 6))


def widest(surrogate: Surrogate, pool: Beams, count: int) -> Beams:
    """Return the beams of a pool at which the next finite elements narrow the widest intervals.

    The width at a point is the spread of the shear's process, at a depth in the middle of the beam's range, times the
    mean quantile of its region.
    """
    group = surrogate.groups["shear"]
    x = prediction.features(pool.L, pool.diameter, pool.height, pool.nu, pool.edge)
    low, high = (
        np.sqrt(surrogate_range.SHALLOWEST_SHEAR),
        np.sqrt(surrogate_range.deepest(pool.L, pool.diameter, pool.height)),
    )
    depth = (low + (high - low) * pool.share) ** 2
    region = prediction.shear_region(prediction.beam_region(pool.L, pool.diameter, pool.height), depth)
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


# Errors in states, and the scaling of the intervals to them

PRESS_KIND, SHEAR_KIND, MODE_KIND, CRITICAL_KIND = "press", "shear", "mode", "critical depth"
"""Kinds of states."""
BEAM = ("L_over_D", "magnet_diameter_over_D", "magnet_height_over_D")
HALF = 0.5
"""Share of the range of the depths, in their roots, beyond which a press is deep."""


Errors = Any
"""A DataFrame with a row for each quantity of each state: beam, kind (press, shear, critical depth, mode), quantity,
the beam's numbers, depth_over_D, shear_over_D, fem, surrogate, and in percent of the yardstick error_percent,
interval_percent (half width of the 90 % interval) and fem_error_percent (NaN if it is unknown)."""


def scores(rows: Errors) -> Array:
    """Return the largest distance of the truth over the half width; infinite where any of the three is unknown."""
    score = (rows.error_percent.abs() + rows.fem_error_percent) / rows.interval_percent
    return np.where(np.isfinite(score), score, np.inf)


def errors(surrogate: Surrogate, states: TrainingSet) -> Errors:
    """Return the errors of a surrogate in all states of a set."""
    import pandas as pd

    predicted = _predicted(surrogate, states.beams)
    tables = [*_presses(states, predicted), *_shears(states, predicted), _modes(states, predicted)]
    return pd.concat(tables, ignore_index=True)


def critical_errors(surrogate: Surrogate, states: TrainingSet, critical: States) -> Errors:
    """Return the errors of the critical depths by `fem.analyses.stability` of the first beams, within the range."""
    if not len(critical["depth"]):
        return errors(surrogate, states).iloc[:0]
    first = states.beams[: len(critical["depth"])]
    predicted = _predicted(surrogate, first)
    deepest, true = predicted.deepest[:, None], critical["depth"]
    # a beam that is stable as far as the range goes by one of both counts as critical at its end
    value = np.minimum(predicted.critical_depth().value[:, None], deepest)
    exists = (true < deepest) | (value < deepest)
    shown = np.where(exists, true, np.nan)
    column = Quantity(value, value * predicted.critical_spread[:, None])
    one = {**critical, "depth": shown}
    return _rows(first, CRITICAL_KIND, "depth", one, "depth", column, value)


def _predicted(surrogate: Surrogate, b: Beams) -> prediction.Beams:
    return prediction.Beams(b.L, b.diameter, b.height, b.nu, b.edge, surrogate)


def recalibrated(surrogate: Surrogate, rows: Errors) -> Surrogate:
    """Return the surrogate with intervals scaled to the errors of random beams, by quantity and region.

    The intervals of presses are scaled apart in light and in deep ones.
    """
    kinds = dict.fromkeys(surrogate.groups, PRESS_KIND) | dict.fromkeys(("shear", "shear_skin"), SHEAR_KIND)
    kinds["mode"] = MODE_KIND
    return replace(
        surrogate, groups={name: _scaled(group, kinds[name], rows) for name, group in surrogate.groups.items()}
    )


def _scaled(group: Group, kind: str, rows: Errors) -> Group:
    quantiles: dict[str, Array] = {}
    for name, values in group.quantiles.items():
        wanted = (CRITICAL_KIND, "depth") if name == CRITICAL else (kind, name)
        own = rows[(rows.kind == wanted[0]) & (rows.quantity == wanted[1])]
        if own.empty:
            quantiles[name] = values
        elif wanted[0] == PRESS_KIND:
            # light and deep presses apart: the error of a light one is that of the contact's mesh
            deep = _shares(own) > HALF
            factors = [_factors(own[part]) for part in (~deep, deep)]
            quantiles[name] = values * np.where(prediction.root_shares() > HALF, factors[1], factors[0])
        else:
            # the quantiles of shears have the regions twice: above light and above deep presses
            quantiles[name] = values * np.tile(_factors(own), (len(values) // prediction.REGIONS, 1))
    return replace(group, quantiles=quantiles)


def _factors(rows: Errors) -> Array:
    """Return the quantile of the beams' scores in each region, shape (REGIONS, 1)."""
    beams = rows.assign(score=scores(rows)).groupby("beam", sort=False)
    first, worst = beams.first(), beams["score"].max().to_numpy()
    region = prediction.beam_region(*(first[name].to_numpy() for name in BEAM))
    return quantiles_by_region(worst[:, None], region, prediction.REGIONS)


def _shares(rows: Errors) -> Array:
    """Return where the depth of each press lies in the range of the depths, 0 to 1 in the roots."""
    low = np.sqrt(surrogate_range.SHALLOWEST)
    high = np.sqrt(surrogate_range.deepest(*(rows[name].to_numpy() for name in BEAM)))
    return np.asarray((np.sqrt(rows.depth_over_D.to_numpy()) - low) / (high - low))


def _presses(states: TrainingSet, predicted: prediction.Beams) -> Iterator[Errors]:
    press = states.press
    for name, quantity in predicted.press(press["depth"]).items():
        rod = 1 - quantity.value if name == "sideways_ratio" else quantity.value
        column = {"force": "force_z", "shift": "shift_z"}.get(name, name)
        yield _rows(states.beams, PRESS_KIND, name, press, column, quantity, rod)


def _shears(states: TrainingSet, predicted: prediction.Beams) -> Iterator[Errors]:
    shear = states.shear
    found = predicted.shear(shear["depth"], shear["shear"], beyond_stable=True)
    rods = prediction.yardsticks({name: quantity.value for name, quantity in found.items()})
    for name, quantity in found.items():
        yield _rows(states.beams, SHEAR_KIND, name, shear, name, quantity, rods[name])


def _modes(states: TrainingSet, predicted: prediction.Beams) -> Errors:
    quantity = predicted.first_mode(density_ratio(states.beams))
    column = Quantity(quantity.value[:, None], quantity.half_width[:, None])
    return _rows(states.beams, MODE_KIND, "frequency", states.mode, "frequency", column, column.value)


def _rows(b: Beams, kind: str, name: str, states: States, column: str, quantity: Quantity, rod: Array) -> Errors:
    """Return the errors of one quantity, arrays (n, k), without the states that do not exist.

    Parameters
    ----------
    column : name of the quantity in the states; those count the magnet's sinking as negative.
    """
    import pandas as pd

    true = states[column] * (-1.0 if column == "shift_z" else 1.0)
    own = states.get(f"{column}_error", np.full(true.shape, np.nan))
    at = np.nonzero(~np.isnan(true))
    beam, unit = at[0], 100 / np.abs(rod[at])
    return pd.DataFrame(
        {
            "beam": beam,
            "kind": kind,
            "quantity": name,
            "L_over_D": b.L[beam],
            "magnet_diameter_over_D": b.diameter[beam],
            "magnet_height_over_D": b.height[beam],
            "nu": b.nu[beam],
            "depth_over_D": states["depth"][at],
            "shear_over_D": states["shear"][at],
            "fem": true[at],
            "surrogate": quantity.value[at],
            "error_percent": unit * (quantity.value[at] - true[at]),
            "interval_percent": unit * quantity.half_width[at],
            "fem_error_percent": unit * own[at],
        }
    )
