"""The study that builds the surrogate: training beams, some of them where it is least sure, and a test on new beams.

The first training beams fill the range evenly. Each round then adds the beams, of a large random pool, whose shears
have the widest intervals, one after the other: every one narrows the intervals around it before the next is chosen.
Random beams at random depths and shears scale the intervals, and other such beams are the test, and serve for nothing
else. Both have the same number of beams in each region, so that none is judged by the others.

Errors are in percent of the yardstick of the quantity, as templates/surrogate.md.j2 says. An interval counts as
holding the truth only if it holds every value that the estimated error of the finite elements allows. A beam is
covered if the intervals of all of its states hold it.
"""

import itertools
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import linalg, stats

from fem.accuracy import QUICK, STANDARD, Accuracy, longer_edges
from geometry.arrays import Array
from geometry.bad_input import BadInput
from geometry.messages import Progress
from studies.beam import prediction, surrogate_file, surrogate_range
from studies.beam.beam_model import Quantity
from studies.beam.prediction import CRITICAL, DEEP, PRESS, SHEAR, SLENDER, STRAIN, THICK, WIDE
from studies.beam.surrogate_file import GaussianProcess, Group, Surrogate, correlation
from studies.cases import FiniteElements
from studies.inputs.option_groups import Whole
from studies.mechanics.solve_plan import Processes
from studies.output.figures import LOG, Figure, panels, save, styles
from studies.output.goals import Goal
from studies.output.provenance import versions
from studies.output.result import Result
from studies.validation import pages
from studies.validation.pages import Row
from studies.validation.surrogate import surrogate_training as training
from studies.validation.surrogate.surrogate_training import (
    COVERAGE,
    Beams,
    States,
    TrainingSet,
    compared,
    deepest,
    motions,
)

POOL = 1500
"""Random beams among which the next training beams are chosen."""
RANDOM_DEPTHS, RANDOM_SHEARS = 5, 2
"""Random depths of each press, and random shears, for calibration and test."""
CALIBRATION = 1000
"""Added to the seed for the beams of the calibration."""


class Extent(NamedTuple):
    """Numbers of beams: `first` in the corners and evenly spread, `rounds` where intervals are widest.

    In each region there are random beams for `calibration` of the intervals and for their `test`, some of them with
    their `critical` depth by `fem.analyses.stability`.
    """

    first: int = 200
    rounds: tuple[int, ...] = (80, 80, 80)
    calibration: int = 24
    test: int = 30
    critical: int = 10
    accuracy: Accuracy = STANDARD
    seed: int = 1


FEW = Extent(first=48, rounds=(8,), calibration=2, test=2, critical=1, accuracy=QUICK)
"""A study of some minutes, whose surrogate has errors of 10 %, and too few beams for goals of single regions."""


Unseen = tuple[TrainingSet, States, int]
"""Beams that training has not seen, critical depths of the first ones, and how many are left out as failed."""


class Outcome(NamedTuple):
    """The surrogate, its training set (None if it was trained before), and the test.

    `failed` are the beams that are left out of training and calibration because a state failed.
    """

    surrogate: Surrogate
    training: TrainingSet | None
    test: Unseen
    failed: tuple[int, int]

    def errors(self) -> pd.DataFrame:
        unseen, critical, _ = self.test
        tables = errors(self.surrogate, unseen), critical_errors(self.surrogate, unseen, critical)
        return pd.concat(tables, ignore_index=True)


def build(extent: Extent, options: Mapping[str, Any], trained: Surrogate | None = None) -> Outcome:
    """Build and test a surrogate; `options` say where `cases.answer` solves and stores.

    `trained` : surrogate whose training is kept; its intervals alone are new.
    """
    fem = FiniteElements(extent.accuracy, options)
    complete, failed = None, 0
    if trained is None:
        states = _training(fem, extent)
        complete = states.complete()
        failed = len(states.beams) - len(complete.beams)
        about = {"accuracy": fem.accuracy.name, "beams": len(complete.beams)}
        trained = training.surrogate_of(complete, about)
    elif (level := trained.about["accuracy"]) != fem.accuracy.name:
        raise BadInput(
            f"--trained has accuracy {level}, and this run calibrates by {fem.accuracy.name}: give another"
        )
    else:
        trained = training.uncalibrated(trained)
    seen, critical, lost = unseen(fem, extent.calibration, extent.critical, extent.seed + CALIBRATION)
    test = unseen(fem, extent.test, extent.critical, extent.seed + 1)
    about = dict(trained.about) | {"calibration_beams": len(seen.beams), "test_beams": len(test[0].beams)}
    surrogate = replace(trained, about=about | {"versions": versions()})
    surrogate = recalibrated(surrogate, errors(surrogate, seen))
    # the half widths of critical depths follow those of the sideways stiffness
    surrogate = recalibrated(surrogate, critical_errors(surrogate, seen, critical))
    return Outcome(surrogate, complete, test, (failed, lost))


def _training(fem: FiniteElements, extent: Extent) -> TrainingSet:
    states = training_states(fem, training.training_beams(extent.first, extent.seed))
    for k, count in enumerate(extent.rounds):
        surrogate = training.surrogate_of(states.complete(), {})
        more = widest(surrogate, training.random_beams(POOL, extent.seed + 2 + k), count)
        states = states.joined(training_states(fem, more))
    return states


def training_states(fem: FiniteElements, beams: Beams) -> TrainingSet:
    press = motions(fem, beams, surrogate_range.press_depths(beams.L, beams.diameter, beams.height))
    mode = training.first_modes(fem, beams)
    shear = motions(fem, beams, training.shear_depth(beams, press)[:, None], surrogate_range.shears(beams.L))
    return TrainingSet(beams, press, mode, shear)


def coarser_of(fem: FiniteElements) -> FiniteElements:
    """Return the finite elements from which errors are estimated."""
    return fem._replace(accuracy=longer_edges(fem.accuracy))


def unseen(fem: FiniteElements, count: int, critical: int, seed: int) -> Unseen:
    """Return `count` random beams of each region with their states, and critical depths of the first ones."""
    states = random_states(fem, training.regional_beams(count, seed), seed)
    complete = states.complete()
    first = complete.beams[: critical * prediction.REGIONS]
    depths = compared(training.critical_depths(fem, first), training.critical_depths(coarser_of(fem), first))
    return complete, depths, len(states.beams) - len(complete.beams)


def random_states(fem: FiniteElements, beams: Beams, seed: int) -> TrainingSet:
    """Return the states of beams at random depths, spread in their root, and shears, RANDOM_DEPTHS and RANDOM_SHEARS.

    All have an estimate of the finite elements' own error, which the coarser mesh gives where answers have none.
    """

    def shares(stream: int, count: int) -> Array:
        return np.sort(np.random.default_rng((seed, stream)).random((len(beams), count)), axis=1)

    low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(deepest(beams))[:, None]
    depths = np.asarray(np.round((low + (high - low) * shares(1, RANDOM_DEPTHS)) ** 2, 6))
    least = surrogate_range.SHEAR_NODES[0] / 2
    share = np.sort(least + (1 - least) * shares(2, RANDOM_SHEARS), axis=1)
    sideways = np.asarray(np.round(share * surrogate_range.farthest(beams.L)[:, None], 6))
    press = motions(fem, beams, depths)
    sheared = training.shear_depth(beams, press)[:, None]
    other = coarser_of(fem)
    return TrainingSet(
        beams,
        compared(press, motions(other, beams, depths)),
        compared(training.first_modes(fem, beams), training.first_modes(other, beams)),
        compared(motions(fem, beams, sheared, sideways), motions(other, beams, sheared, sideways)),
    )


def widest(surrogate: Surrogate, pool: Beams, count: int) -> Beams:
    """Return the beams of a pool at which the next finite elements narrow the widest intervals.

    The width at a point is the spread of the shear's process, at a depth in the middle of the beam's range, times the
    mean quantile of its region.
    """
    group = surrogate.groups["shear"]
    x = prediction.features(pool.L, pool.diameter, pool.height, pool.nu, pool.edge)
    low, high = np.sqrt(surrogate_range.SHALLOWEST_SHEAR), np.sqrt(deepest(pool))
    depth = (low + (high - low) * pool.share) ** 2
    region = prediction.shear_region(prediction.beam_region(pool.L, pool.diameter, pool.height), depth)
    quantile = np.mean([values.mean(axis=1) for values in group.quantiles.values()], axis=0)
    points = prediction.shear_features(x, depth)
    return pool[widest_points(group.process, points, quantile[region], count)]


def widest_points(process: GaussianProcess, points: Array, weight: Array, count: int) -> NDArray[np.int64]:
    """Return the indices of points (m, p) with the widest intervals, each after all before it have been added.

    `weight` is the factor on the spread at each point, shape (m,).
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

BEAM = ("L_over_D", "magnet_diameter_over_D", "magnet_height_over_D")
HALF = 0.5
"""Share of the range of the depths, in their roots, beyond which a press is deep."""


def scores(rows: pd.DataFrame) -> Array:
    """Return the largest distance of the truth over the half width; infinite where any of the three is unknown."""
    score = (rows.error_percent.abs() + rows.fem_error_percent) / rows.interval_percent
    return np.where(np.isfinite(score), score, np.inf)


def errors(surrogate: Surrogate, states: TrainingSet) -> pd.DataFrame:
    """Return the errors of a surrogate in all states of a set, a row for each quantity of each state.

    The error, the half width of the 90 % interval and the error of the finite elements themselves (NaN if it is
    unknown) are in percent of the yardstick.
    """
    b, press, shear = states.beams, states.press, states.shear
    predicted = _predicted(surrogate, b)
    tables = []
    for name, quantity in predicted.press(press["depth"]).items():
        rod = 1 - quantity.value if name == "sideways_ratio" else quantity.value
        column = {"force": "force_z", "shift": "shift_z"}.get(name, name)
        tables.append(_rows(b, "press", name, press, column, quantity, rod))
    found = predicted.shear(shear["depth"], shear["shear"], beyond_stable=True)
    rods = prediction.yardsticks({name: quantity.value for name, quantity in found.items()})
    tables += [_rows(b, "shear", name, shear, name, quantity, rods[name]) for name, quantity in found.items()]
    mode = predicted.first_mode(training.density_ratio(b))
    frequency = Quantity(mode.value[:, None], mode.half_width[:, None])
    tables.append(_rows(b, "mode", "frequency", states.mode, "frequency", frequency, frequency.value))
    return pd.concat(tables, ignore_index=True)


def critical_errors(surrogate: Surrogate, states: TrainingSet, critical: States) -> pd.DataFrame:
    """Return the errors of the critical depths by `fem.analyses.stability` of the first beams, within the range."""
    if not len(critical["depth"]):
        return errors(surrogate, states).iloc[:0]
    first = states.beams[: len(critical["depth"])]
    predicted = _predicted(surrogate, first)
    most, true = predicted.deepest[:, None], critical["depth"]
    # a beam that is stable as far as the range goes by one of both counts as critical at its end
    value = np.minimum(predicted.critical_depth().value[:, None], most)
    exists = (true < most) | (value < most)
    shown = np.where(exists, true, np.nan)
    column = Quantity(value, value * predicted.critical_spread[:, None])
    one = {**critical, "depth": shown}
    return _rows(first, "critical depth", "depth", one, "depth", column, value)


def _predicted(surrogate: Surrogate, b: Beams) -> prediction.Beams:
    return prediction.Beams(b.L, b.diameter, b.height, b.nu, b.edge, surrogate)


def recalibrated(surrogate: Surrogate, rows: pd.DataFrame) -> Surrogate:
    """Return the surrogate with intervals scaled to the errors of random beams, by quantity and region.

    A beam has one score, the largest one of its states, so that its intervals hold in all of them or count as lost.
    """
    kinds = dict.fromkeys(surrogate.groups, "press") | {"mode": "mode"}
    kinds |= dict.fromkeys(("shear", "shear_skin"), "shear")
    scaled = {name: _scaled(group, kinds[name], rows) for name, group in surrogate.groups.items()}
    return replace(surrogate, groups=scaled)


def _scaled(group: Group, kind: str, rows: pd.DataFrame) -> Group:
    quantiles: dict[str, Array] = {}
    for name, values in group.quantiles.items():
        wanted = ("critical depth", "depth") if name == CRITICAL else (kind, name)
        own = rows[(rows.kind == wanted[0]) & (rows.quantity == wanted[1])]
        if own.empty:
            quantiles[name] = values
        elif wanted[0] == "press":
            quantiles[name] = values * _press_factors(own)
        else:
            # the quantiles of shears have the regions twice: above light and above deep presses
            quantiles[name] = values * np.tile(_factors(own), (len(values) // prediction.REGIONS, 1))
    return replace(group, quantiles=quantiles)


def _press_factors(rows: pd.DataFrame) -> Array:
    """Return the factors on the quantiles of presses, by region and node, shape (REGIONS, PRESS_NODES).

    Errors of light presses are larger over their intervals than those of deep ones, which medians tell; one factor on
    both gives the coverage.
    """
    beam = [rows[name].to_numpy() for name in BEAM]
    low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(surrogate_range.deepest(*beam))
    deep = (np.sqrt(rows.depth_over_D.to_numpy()) - low) / (high - low) > HALF
    light_size, deep_size = (_factors(rows[part], partial(np.median, axis=0)) for part in (~deep, deep))
    region = prediction.beam_region(*beam)
    own = np.where(deep, deep_size[region, 0], light_size[region, 0])
    factor = _factors(rows.assign(interval_percent=rows.interval_percent * own))
    return np.asarray(factor * np.where(prediction.root_shares() > HALF, deep_size, light_size))


def _factors(rows: pd.DataFrame, quantile: Callable[[Array], Array] = training.conformal_quantile) -> Array:
    beams = rows.assign(score=scores(rows)).groupby("beam", sort=False)
    first, worst = beams.first(), beams["score"].max().to_numpy()
    region = prediction.beam_region(*(first[name].to_numpy() for name in BEAM))
    return training.quantiles_by_region(worst[:, None], region, quantile=quantile)


def _rows(
    b: Beams, kind: str, name: str, states: States, column: str, quantity: Quantity, rod: Array
) -> pd.DataFrame:
    """Return the errors of one quantity, `column` of the states (n, k), without the states that do not exist."""
    true = states[column]
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


# Goals of the test, and the files

GOALS = {"force": 2.0, "force_x": 2.0, "force_z": 2.0, "tilt": 3.0}
"""Largest 95th percentile of the errors, %, of presses and shears."""
QUANTITIES = (
    *(("press", name) for name in (*PRESS, *STRAIN)),
    *(("shear", name) for name in SHEAR),
    ("mode", "frequency"),
    ("critical depth", "depth"),
)
"""Kinds and quantities that are judged, also where no state has one."""
DOUBT, WORSE, POWER = 0.01, 0.8, 90.0
"""Probability that so few beams are covered as a goal refuses, if nine of ten are: a goal for each quantity and group
is refused by chance about once in as many goals as there are in a table. The test is large enough if a coverage of
WORSE, about that of intervals that are calibrated in two halves, misses the goal over all regions with a probability
of POWER, %."""
DEEPER = f"deep, depth above {DEEP:g} D"
SLENDER_ONES, THIN_ONES = f"L_over_D > {SLENDER}", f"magnet_height_over_D <= {THICK}"
WIDE_ONES = f"magnet_diameter_over_D > {WIDE} and {THIN_ONES}"
REGIONS = {
    "all": "beam == beam",
    f"slender, L/D above {SLENDER:g}": SLENDER_ONES,
    "slender, thin magnet": f"{SLENDER_ONES} and {THIN_ONES}",
    f"thick magnet, above {THICK:g} D": f"magnet_height_over_D > {THICK}",
    "wide thin magnet": WIDE_ONES,
    f"wide thin magnet, L/D to {SLENDER:g}": f"{WIDE_ONES} and L_over_D <= {SLENDER}",
    DEEPER: f"kind in ['press', 'shear'] and depth_over_D > {DEEP}",
    "nu below 0.49": "nu < 0.49",
}
"""Regions of the test: states of its table."""


def summaries(rows: pd.DataFrame) -> list[Row]:
    """Return the statistics of each quantity in each region, over all first; NaN if any error is unknown.

    `covered_beams_percent` is the share of beams of which every interval holds the truth; its goal,
    `least_covered_percent`, is the least share that is likely if nine of ten beams are covered, and `power_percent`
    the probability that a coverage of eight of ten misses it.
    """
    rows = rows.assign(size=rows.error_percent.abs(), covered=scores(rows) <= 1.0)
    tables = []
    for region, inside in REGIONS.items():
        groups = rows.query(inside).groupby(["kind", "quantity"], sort=False)
        table = groups.agg(
            beams=("beam", "nunique"),
            states=("beam", "size"),
            median_percent=("size", lambda own: np.median(own.to_numpy())),
            p95_percent=("size", lambda own: np.percentile(own.to_numpy(), 95)),
            largest_percent=("size", lambda own: own.max(skipna=False)),
            covered_percent=("covered", lambda own: 100 * own.mean()),
            interval_percent=("interval_percent", lambda own: np.median(own.to_numpy())),
            fem_error_percent=("fem_error_percent", lambda own: np.median(own.to_numpy())),
        )
        beams = rows.query(inside).groupby(["kind", "quantity", "beam"], sort=False)["covered"].all()
        covered = beams.groupby(["kind", "quantity"], sort=False).sum()
        table.insert(0, "region", region)
        least = [100 * least_covered(count) / count for count in table.beams]
        table = table.assign(covered_beams_percent=100 * covered / table.beams, least_covered_percent=least)
        tables.append(table.assign(power_percent=[100 * power(count) for count in table.beams]))
    return pages.records(pd.concat(tables).reset_index())


def least_covered(count: int) -> int:
    """Return how many of `count` beams must be covered: fewer have a probability below DOUBT if nine of ten are.

    >>> least_covered(20), least_covered(120)
    (14, 100)
    """
    return int(stats.binom.ppf(DOUBT, count, COVERAGE))


def power(count: int) -> float:
    """Return the probability that a coverage of WORSE misses the goal of `count` beams.

    >>> round(power(120), 3), round(power(180), 3)
    (0.785, 0.922)
    """
    return float(stats.binom.cdf(least_covered(count) - 1, count, WORSE))


def goals(table: Sequence[Row], failed: int, lost: int = 0, regions: Iterable[str] = REGIONS) -> list[Goal]:
    """Return the goals: number of beams, and errors and coverage of each quantity and region.

    No beam of the test or of the calibration is left out (`failed`, `lost`), and the test has power. A quantity or a
    region without a beam has no data, and misses its goals.
    """
    beams = max((row["beams"] for row in table), default=0)
    found = [
        Goal("beams left out of the test because a state failed", failed, 0, failed + beams),
        Goal("beams left out of the calibration because a state failed", lost, 0, lost + beams),
        Goal(f"tests that a coverage of {WORSE:.0%} misses", 100 * power(beams), POWER, beams, "%", at_least=True),
    ]
    rows = {(row["region"], row["kind"], row["quantity"]): row for row in table}
    for region, (kind, quantity) in itertools.product(regions, QUANTITIES):
        if region == DEEPER and kind not in ("press", "shear"):
            continue
        row = rows.get((region, kind, quantity), {"least_covered_percent": 100 * COVERAGE})
        name = f"{kind}, {quantity}, {region}"
        if kind in ("press", "shear") and quantity in GOALS:
            told = f"{name}: 95th percentile of the errors"
            found.append(Goal(told, row.get("p95_percent"), GOALS[quantity], row.get("states", 0), "%"))
        share, least = row.get("covered_beams_percent"), row["least_covered_percent"]
        told = f"{name}: beams that the intervals hold"
        found.append(Goal(told, share, least, row.get("beams", 0), "%", at_least=True))
    return found


def designs_per_second(outcome: Outcome, count: int = 10_000) -> Mapping[str, float]:
    b = training.random_beams(count, 11)
    begin = time.process_time()
    beams = _predicted(outcome.surrogate, b)
    beams.press(0.5 * beams.deepest[:, None])
    press = time.process_time()
    beams.shear(0.5 * beams.deepest[:, None], 0.5 * beams.farthest[:, None])
    beams.critical_depth()
    beams.first_mode(training.density_ratio(b))
    end = time.process_time()
    return {"press": count / (press - begin), "press, shear, critical depth and mode": count / (end - begin)}


ALL = ("all",)
"""Regions whose goals are judged in a quick run, which has too few beams in the others."""
FILES = ("SURROGATE.md", "surrogate.npz", "summary.csv", "errors.csv", "errors.png")


def run(
    progress: Progress,
    *,
    quick: bool = False,
    store: Path | None = None,
    workers: Whole | None = None,
    scheduler: str | None = None,
    trained: Path | None = None,
) -> Result:
    """Build the surrogate from finite elements, and test it on beams that it has not seen.

    Parameters
    ----------
    quick
        Use few beams and coarser meshes: some minutes, and errors of 10 %.
    store
        File of solved states; default: that of the user.
    workers
        Number of processes that solve; default: one for each core.
    scheduler
        Address of a Dask scheduler whose workers solve.
    trained
        File of a surrogate (surrogate.npz) whose training is kept; its intervals are calibrated and tested again.
    """
    extent = FEW if quick else Extent()
    kept = None if trained is None else surrogate_file.read(trained)
    with Processes(workers, scheduler).opened() as executor:
        outcome = build(extent, {"store": store, "workers": executor, "progress": progress}, kept)
    return result(outcome, extent.first, "quick" if quick else "full")


def result(outcome: Outcome, first: int, run: str = "full") -> Result:
    rows = outcome.errors()
    table = summaries(rows)
    columns = ("kind", "quantity", "region", "p95_percent", "covered_beams_percent", "least_covered_percent")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "surrogate.npz")
        surrogate_file.write(file, outcome.surrogate)
        size = file.stat().st_size / 1e6
    page = {"about": outcome.surrogate.about, "first": first, "table": table}
    page["failed"] = *outcome.failed, outcome.test[2]
    page |= {"kept": outcome.training is None, "worse": 100 * WORSE}
    page |= {"size": size, "speed": designs_per_second(outcome)}
    files: Row = {"surrogate.npz": lambda path: surrogate_file.write(path, outcome.surrogate)}
    files["errors.png"] = lambda path: save(path, figures(rows))
    more: Row = {"tables": {"summary": table, "errors": pages.records(rows)}, "files": files}
    posed = goals(table, outcome.test[2], outcome.failed[1], ALL if run == "quick" else REGIONS)
    more |= {"look": {"first": columns}, "run": run}
    return pages.study("surrogate", "Errors on unseen beams", table, page, goals=posed, **more)


EQUAL = "error = half width"
ENDS = (0.05, 50.0)
"""Half widths, %, at which the line of equal errors begins and ends."""
LEAST_ERROR = 1e-3
"""Least error of the picture, %; smaller errors are drawn at this value."""


def figures(rows: pd.DataFrame) -> list[Figure]:
    """Return the error of force and tilt over the half width of its interval, for presses and shears."""
    import altair as alt

    x, y = "half width of the 90 % interval (%)", "error on unseen beams (%)"
    data = rows[rows["quantity"].isin(["force", "force_x", "force_z", "tilt"])]
    points = {x: data["interval_percent"], y: data["error_percent"].abs().clip(lower=LEAST_ERROR)}
    points |= {"panel": data["kind"].astype(str), "series": data["quantity"].astype(str).str.replace("_", " along ")}
    equal = pd.DataFrame(itertools.product(dict.fromkeys(data["kind"]), ENDS), columns=["panel", x])
    data = pd.concat(
        [pd.DataFrame(points).assign(joined=False), equal.assign(series=EQUAL, joined=True, **{y: equal[x]})],
        ignore_index=True,
    )
    data = data.dropna(subset=[x, y], ignore_index=True)
    names = list(data["series"])
    base = alt.Chart().encode(x=alt.X(x, **LOG), y=alt.Y(y, **LOG))
    line = base.transform_filter("datum.joined").mark_line().encode(**styles(names, "color"))
    points = base.transform_filter("!datum.joined").mark_point().encode(**styles(names, lines=(EQUAL,)))
    title = "Errors and half widths of the surrogate"
    return [Figure(title, "", panels(alt.layer(points, line), data), data)]
