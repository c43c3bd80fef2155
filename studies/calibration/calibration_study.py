"""Study calibrate: a made sensor from bench rows, and its forces on held-out runs beside two regressions."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analytic import parts
from analytic.inverse.response_surface import Mechanics
from geometry.arrays import Array, Ints
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.calibration import (
    bench_file,
    calibrated_forces,
    calibration_file,
    force_regression,
    regression_study,
    sensor_fit,
)
from studies.calibration.bench_file import FORCES, MOTIONS, Bench
from studies.calibration.regression_study import ASSUMED_NOISE, MODEL, Recorded
from studies.calibration.sensor_fit import Fit, Sensor
from studies.inputs.option_groups import Calibrating, SourceOfLoad
from studies.inputs.units import IN_HEADS
from studies.inputs.user_input import design_text, pairs, parse_numbers
from studies.output import page_templates
from studies.output.atomic_files import write_text
from studies.output.figures import FREE, LOG, Figure, panels, rule, save, styles, thinned
from studies.output.result import Result, Rows, Table
from studies.parts.part_tolerances import Tolerances
from studies.parts.requirements import Requirements, design_table, full_scale
from studies.quantities import shown
from studies.sensing.decode_readings import QUANTILE
from studies.simulation import mechanics_sources

if TYPE_CHECKING:
    from studies.output.records import FlatRow

FILES = (
    *("CALIBRATION.md", "calibration.json", "design.toml", "calibration.png"),
    *("unknowns.csv", "held_out.csv", "learning.csv", "residuals.csv", "columns.csv", "decoders.csv"),
)
SIZES = (12, 30, 100, 300, 1000, 3000)
"""Numbers of rows of the learning curve."""
TOGETHER, IRRELEVANT = 0.9, 0.05
"""Correlation of two unknowns that is told; share of the force's variance below which it does not depend on them."""
SOLVED_ERROR = 0.01
"""Relative standard deviation of the forces of solved states: level standard is within 1 % (results/errors)."""
SAME = 0.9
"""Posterior over prior standard deviation from which the rows say nothing about an unknown."""
PATTERN = 4.0
"""Standard errors of the mean or of the correlation of neighbours beyond which residuals are no noise."""
OUTLIER, UNUSABLE = 6.0, 1.5
"""Misfit of a row over the median from which it is named; RMSE over that of the better regression from which a
calibration is called unusable."""
FEW, FIRST, ROUGH, LIKELY, BETTER = 24, 2, 8, 6, 3.0
"""Rows with which columns that are exchanged, reversed or turned are sought, steps of a first fit with each of them,
steps with those that then fit best, their number, and how much better the rows must fit."""
CHECK = "check which column is which element, the signs of the forces, and wrong rows"
COPY, WRONG = "repeats another one to the last digit: was it measured again?", "was it measured wrongly?"
TURNS: dict[str, tuple[list[int], list[float]]]
TURNS = {"90": ([1, 0], [1.0, -1.0]), "180": ([0, 1], [-1.0, -1.0]), "-90": ([1, 0], [-1.0, 1.0])}
"""Angles, deg, by which a sensor may be turned on its stand: columns and signs of x and y in its own axes."""
FAR, SURPRISING = 2.5, 3.0
"""Standard deviations of its prior beyond which an unknown contradicts it, where parts beyond two are sorted out; the
same of the distance between a prior and what rows and other priors say, which by chance reaches 2.5 for one of some
twenty unknowns in a tenth of the benches, and 3 hardly ever."""
MOST_ROWS = 3000
"""Most rows of a calibration; of more, evenly spaced ones are taken. Beyond some hundred they teach hardly anything
(see the learning curve), while time and memory grow in proportion."""
HELD = 80.0
"""Share of forces within their 90 % intervals, %, below which a model is off: two standard deviations of the share of
twelve presses along three axes."""
DOUBTED, CERTAIN = 3.0, 1000.0
"""Estimated over expected error of the forces from which such columns are sought, and how much better rows must fit
with them so that a bench is refused."""
METHODS = (MODEL, "linear ridge", "quadratic ridge")
LAGS = np.linspace(-0.2, 0.2, 41)
"""Lags of the force behind the readings that are tried, s."""


# Mechanics, sensor and lag


def mechanics_of(
    design: Design, responses: Path | None, solves: Mapping[str, Any] = {}
) -> tuple[Mechanics, str, float]:
    """Return the mechanics of a design, their source, and the relative standard deviation of their forces.

    responses : states of finite elements; None for states that are solved now, and kept in the store: polynomials of
        these follow other states within 0.3 %, while the surrogate misses sheared presses of wide beams by up to
        14 %, which a fit would take for another modulus.
    solves : store, workers and progress of `cases.answer` for these states.

    Raises
    ------
    BadInput, SolveFailed
        The file cannot be read, or finite elements know too few states of the design.
    """
    if responses is not None:
        found = mechanics_sources.source_of(design, SourceOfLoad(responses=responses))
        return found.law, f"finite elements ({responses.name})", SOLVED_ERROR
    try:
        found = mechanics_sources.of_finite_elements(design, solves)
    except (BadInput, SolveFailed) as error:
        raise type(error)(f"{error}: give --responses, states that magtip solve --json printed") from None
    return found.law, mechanics_sources.in_words(found), SOLVED_ERROR


def estimate_lag(bench: Bench) -> float | None:
    """Return by how much the forces lag behind the readings, s: where a quadratic regression explains them best.

    0 where another lag explains the forces hardly better; None without times, where rows are too few or too far
    apart to tell, and where the best lag lies at an end of `LAGS`.
    """
    time, force = bench.values(["time_s"])[:, 0], bench.values(FORCES)
    readings = bench.values(bench.readings)
    step = np.nanmedian(np.abs(np.diff(time))) if np.isfinite(time).sum() > 1 else math.inf
    known = np.isfinite(readings).all(axis=1) & np.isfinite(time)
    if not step < LAGS[-1] / 2 or known.sum() < 100:
        return None
    scale = readings[known].std(axis=0)
    scores = (readings - readings[known].mean(axis=0)) / np.where(scale > 0, scale, 1.0)
    X = np.column_stack([np.ones(len(scores)), force_regression.products(scores, 2)])
    misfits = []
    for lag in LAGS:
        moved = _delayed(bench, force, lag)
        rows = known & np.isfinite(moved).any(axis=1)
        y = moved[rows][:, np.isfinite(moved[rows]).all(axis=0)]
        misfits.append(np.square(y - X[rows] @ np.linalg.lstsq(X[rows], y, rcond=None)[0]).mean())
    best = int(np.argmin(misfits))
    if misfits[best] > 0.98 * misfits[len(LAGS) // 2]:
        return 0.0
    if best in (0, len(LAGS) - 1):
        return None
    a, b, c = misfits[best - 1 : best + 2]
    return float(LAGS[best] + (LAGS[1] - LAGS[0]) * (a - c) / (2 * (a - 2 * b + c)))


def _delayed(bench: Bench, values: Array, lag: float) -> Array:
    """Return values (n, k) as they are `lag` seconds later within each run; NaN beyond its ends."""
    moved = np.full_like(values, np.nan)
    time, run = bench.values(["time_s"])[:, 0], bench.table["run"].to_numpy()
    for name in bench.runs:
        own = np.flatnonzero(run == name)
        for k in range(values.shape[1]):
            known = own[np.isfinite(values[own, k]) & np.isfinite(time[own])]
            if len(known) > 1:
                moved[own, k] = np.interp(time[own] + lag, time[known], values[known, k], np.nan, np.nan)
                moved[own, k] = np.where(np.isfinite(values[own, k]), moved[own, k], np.nan)
    return moved


# Held-out runs


def _score(force: Array, truth: Array, full: float) -> FlatRow:
    """Return the errors of forces (n, 3) over the measured components; rows without a force are `lost`."""
    off = np.where(np.isfinite(truth), force - truth, 0.0)
    size = np.linalg.norm(off, axis=1)
    known = np.isfinite(size)
    rmse = float(np.sqrt(np.square(size[known]).mean())) if known.any() else math.nan
    worst = float(size[known].max()) if known.any() else math.nan
    return {
        "rows": len(truth),
        "lost": int((~known).sum()),
        "rmse_N": rmse,
        "worst_N": worst,
        "rmse_percent": 100 * rmse / full,
    }


def held_out(
    sensor: Sensor, measured: Array, warmer: Array, bench: Bench, rows: Ints, full: float, progress: Progress
) -> tuple[list[FlatRow], list[FlatRow], Array]:
    """Return errors on held-out rows, the learning curve, and the force (n, 3) that each row's fold gives.

    The learning curve has the errors of sensors and regressions from fewer training rows, drawn with a seed. Errors
    in percent are those of the force `full`, N.
    """
    k = len(sensor.noise)
    readings, truth = measured[:, :k], measured[:, k : k + 3]
    table: list[FlatRow] = []
    curve: list[FlatRow] = []
    force = np.full_like(truth, np.nan)
    every = list(force_regression.folds(bench, rows))
    whole = round(float(np.mean([len(train) for _, train, _ in every])))
    for place, (name, train, test) in enumerate(every):
        progress(0.2 + 0.7 * place / len(every), f"without {name}")
        sizes = [size for size in SIZES if size < len(train)] if place < force_regression.FOLDS else []
        for size in [*sizes, len(train)]:
            # with one seed the smaller sets are parts of the larger ones
            own = np.sort(np.random.default_rng(place).permutation(train)[:size])
            found = sensor_fit.fit(sensor, measured[own], warmer[own])
            decoded = calibrated_forces.decode(found, readings[test], warmer[test])
            answers = [decoded.force] + [
                force_regression.fit(readings[own], truth[own], n).force(readings[test]) for n in (1, 2)
            ]
            for method, answer in zip(METHODS, answers, strict=True):
                score: FlatRow = {"method": method, "held_out": name}
                score |= _score(answer, truth[test], full)
                # parts differ by a row or so
                curve.append(score | {"training_rows": whole if size == len(train) else size})
                if size == len(train):
                    table.append(score)
        force[test] = decoded.force
        inside = np.abs(decoded.force - truth[test]) <= np.hypot(
            decoded.half_width, QUANTILE * sensor.force_errors(truth[test])
        )
        known = np.isfinite(decoded.force) & np.isfinite(truth[test])
        table[-len(METHODS)]["inside_percent"] = 100 * float(inside[known].mean()) if known.any() else math.nan
    return table, curve, force


# What the fit says


def sentences(found: Fit) -> list[str]:
    """Return what the rows cannot tell: unknowns from each other, and those that stay as uncertain as before."""
    from scipy.sparse.csgraph import connected_components

    un, correlation = found.sensor.unknowns, found.correlation()
    said = []
    count, label = connected_components(np.abs(correlation) > TOGETHER)
    groups = [group for k in range(count) if len(group := np.flatnonzero(label == k)) > 1]
    directions = []
    for group in groups:
        along, first = np.zeros(len(found.theta)), group[0]
        along[group] = found.deviation[group] * np.sign(correlation[first, group])
        directions.append(along)
    # what the variance of the force gains where all are less certain by their deviations, along each other
    wider = [found.covariance + np.outer(along, along) for along in directions]
    total, *more = calibrated_forces.force_variances(found, [found.covariance, *wider], found.shift)
    for group, variance in zip(groups, more, strict=True):
        first = group[0]
        effect = ", but the decoded force does not depend on that" if variance / total - 1 < IRRELEVANT else ""
        least, others = np.abs(correlation[first, group[1:]]).min(), ", ".join(un.names[k] for k in group[1:])
        said.append(
            f"these rows hardly tell {un.names[first]} from {others} (correlation {least:.2f} in size){effect}"
        )
    silent = [un.names[k] for k in un.free if found.deviation[k] > SAME * un.deviation[k]]
    if silent:
        said.append(f"these rows say nothing about {', '.join(silent)}, which keep their priors")
    return said


def contradicted(found: Fit) -> list[int]:
    """Return the unknowns whose priors the rows contradict, the worst first."""
    un, away = found.sensor.unknowns, np.abs(found.surprise())
    beyond = (away > SURPRISING) | (np.abs(found.theta - un.mean) > FAR * un.deviation)
    return [k for k in np.argsort(-away).tolist() if beyond[k] and un.deviation[k] > 0]


def contradictions(found: Fit) -> list[str]:
    """Return a sentence that names the unknowns whose priors the rows contradict, if there are any."""
    un, away, worst = found.sensor.unknowns, np.abs(found.surprise()), contradicted(found)
    if not worst:
        return []
    named, first = ", ".join(f"{un.names[k]} by {away[k]:.2g}" for k in worst), worst[0]
    value, prior, wide = (float(each[first]) for each in (found.theta, un.mean, un.deviation))
    unit = "" if un.units[first] == "1" else f" {un.units[first]}"
    least = f"{un.names[first]} is estimated as {value:.4g} for {prior:.4g} +- {wide:.2g}{unit}"
    said = (
        f"the rows contradict the priors of {named} standard deviations ({least}): intervals of unknowns do not hold"
    )
    return [f"{said}; mend the design, state a wider --tolerance, or --free {un.names[first]}"]


def residual_rows(found: Fit, bench: Bench, rows: Ints) -> list[FlatRow]:
    """Return mean, spread and correlation of neighbours of the residuals of each run and channel.

    Residuals are over their stated standard deviation. `noise` is whether they may be independent errors: mean and
    correlation of neighbours within PATTERN standard errors of 0.
    """
    run, rows_of = bench.table["run"].to_numpy()[rows], []
    for name in bench.runs:
        for k, channel in enumerate([*bench.readings, *FORCES, *MOTIONS]):
            r = found.residual[run == name, k]
            r = r[np.isfinite(r)]
            if len(r) < 3:
                continue
            spread = float(r.std()) or 1.0
            near = float((r[1:] * r[:-1]).mean() / np.square(r).mean()) if r.any() else 0.0
            mean, root = float(r.mean()), math.sqrt(len(r))
            noise = abs(mean) * root < PATTERN * spread and abs(near) * root < PATTERN
            rows_of.append({
                "run": name, "channel": channel, "rows": len(r), "mean": mean, "spread": spread,
                "neighbours": near, "noise": noise,
            })  # fmt: skip
    return rows_of


def _place(bench: Bench, row: int) -> str:
    """Return which row of which run a row of all runs is, in words."""
    run = bench.table["run"].to_numpy()
    return f"row {1 + int(np.count_nonzero(run[:row] == run[row]))} of {run[row]}"


def _odd_rows(bench: Bench, full: NDArray[np.bool_]) -> tuple[list[str], list[str]]:
    """Return a sentence on rows that are left out, since a reading (n, k) lies at a rail, and one on exact copies.

    Either list is empty without such rows.
    """
    left_out = np.flatnonzero(full.any(axis=1))
    copies = np.flatnonzero(bench.table.duplicated([name for name in bench.table if name not in ("run", "time_s")]))
    element = bench.readings[int(full[left_out[0]].argmax())] if len(left_out) else ""
    at_rail, copied = (
        [f"{_place(bench, rows[0])}{f' (and {len(rows) - 1} more)' * (len(rows) > 1)} {text}"] if len(rows) else []
        for rows, text in (
            (left_out, f"is left out, because {element} lies at a rail of its element"),
            (copies, COPY),
        )
    )
    return at_rail, copied


def _estimated(
    fit: Callable[[Array, Array], Fit], expected: Sensor, measured: Array, warmer: Array
) -> tuple[Fit, bool, list[tuple[int, float]]]:
    """Return the sensor that a fit finds, whether columns look wrong, and the row far from all others, if any, with
    its misfit over the median."""

    def fitted(rows: Ints) -> tuple[Fit, bool]:
        found, truth = fit(measured[rows], warmer[rows]), measured[rows, len(expected.noise) :][:, :3]
        own, usual = (np.median(sensor.force_errors(truth)) for sensor in (found.sensor, expected))
        return found, bool(own > DOUBTED * usual or found.growth > 2 or contradicted(found))

    found, doubtful = fitted(np.arange(len(measured)))
    size = np.sqrt(np.nanmean(np.square(found.residual), axis=1))
    worst, times = int(np.argmax(size)), float(size.max() / np.median(size))
    if len(size) < 3 or not times > OUTLIER:
        return found, doubtful, []
    # one wrong row makes all columns look wrong
    doubtful = doubtful and fitted(np.delete(np.arange(len(measured)), worst))[1]
    return found, doubtful, [(worst, times)]


def mistaken(sensor: Sensor, measured: Array, warmer: Array, names: Sequence[str]) -> tuple[str, float]:
    """Return which columns are probably exchanged, reversed, turned or in another unit, in words, and how much better
    rows then fit; "" where no such rows fit much better.

    Mirrored layouts make some of these equal, such as S2 with S3 and Fx_N with Fy_N: all of them are named.
    """
    chosen = np.linspace(0, len(measured) - 1, min(len(measured), FEW)).round().astype(int)
    rows, warm = measured[chosen], warmer[chosen]
    given = sensor_fit.misfit(sensor, rows, warm, ROUGH)
    causes = {text: (one, other) for text, one, other in _causes(sensor, rows, names)}
    first = {text: sensor_fit.misfit(*other, warm, FIRST) for text, other in causes.items()}
    likely = sorted(first, key=first.__getitem__)[:LIKELY]
    better = {text: sensor_fit.misfit(*causes[text], warm, ROUGH) for text in causes if text in likely}
    best = min(better.values())
    if not BETTER * best < given:
        return "", 1.0
    found = [text for text, misfit in better.items() if misfit < 2 * best]
    ratio = given / best
    return f"probably {', or '.join(found)}: the rows then fit {ratio:.2g} times better", ratio


def _causes(sensor: Sensor, rows: Array, names: Sequence[str]) -> Iterator[tuple[str, Sensor, Array]]:
    """Yield what may be wrong with rows (n, k + 6), in words, and sensor and rows that would then be right."""
    k = len(names)
    null = np.array([element.null for element in parts.of_design(sensor.design)])
    for text, columns, signs in _columns_of_elements(names):
        yield text, sensor, np.hstack([null + signs * (rows[:, columns] - null[columns]), rows[:, k:]])
    force, moved = rows[:, k : k + 2], rows[:, k + 4 : k + 6]
    if np.isfinite(force).any():
        for j, name in enumerate(("Fx_N", "Fy_N")):
            if np.isfinite(force[:, j]).any():
                reversed_one = force * np.where(np.arange(2) == j, -1.0, 1.0)
                yield f"{name} has the wrong sign", sensor, _with_sideways(rows, k, reversed_one)
        yield "Fx_N is exchanged with Fy_N", sensor, _with_sideways(rows, k, force[:, ::-1])
        for angle, (order, sign) in TURNS.items():
            both = _with_sideways(rows, k, force[:, order] * sign, moved[:, order] * sign)
            yield f"the sensor is turned by {angle} deg about z on the stand", sensor, both
    for unit in ("mN", "g", "kg"):
        factor = IN_HEADS["N"][unit]
        # forces and their errors are in the same unit: smaller forces alone would fit better, whatever the cause
        scaled = dataclasses.replace(sensor, force_noise=factor * sensor.force_noise)
        yield f"the forces are in {unit} and not in N", scaled, rows * np.repeat([1.0, factor, 1.0], [k, 3, 3])


def _with_sideways(rows: Array, k: int, force: Array, moved: Array | None = None) -> Array:
    """Return rows (n, k + 6) with other forces and, if given, other shears along x and y, (n, 2) each."""
    changed = rows.copy()
    changed[:, k : k + 2] = force
    if moved is not None:
        changed[:, k + 4 : k + 6] = moved
    return changed


def _columns_of_elements(names: Sequence[str]) -> Iterator[tuple[str, Ints, Array]]:
    """Yield what may be wrong with the columns of the elements, in words, the column that holds each element's
    reading (k,), and its sign (k,): exchanges of two, and for each triple of axes, alike in all chips, all orders and
    signs."""
    k = len(names)
    for a, b in itertools.combinations(range(k), 2):
        order = np.arange(k)
        order[[a, b]] = b, a
        yield f"{names[a]} is exchanged with {names[b]}", order, np.ones(k)
    for sign, axes in itertools.product(itertools.product((1.0, -1.0), repeat=3), itertools.permutations(range(3))):
        signs, moved = np.tile(sign, k // 3), sum(j != at for j, at in enumerate(axes))
        order = np.concatenate([np.array(axes) + first for first in range(0, k, 3)])
        if not moved and sum(sign) == -3:
            yield "the magnet is upside down (set magnet_north to the other pole)", order, signs
        elif not moved and sum(sign) == 1 and k == 3:
            yield f"{names[int(np.argmin(sign))]} has the wrong sign", order, signs
        elif sum(sign) < 3 or moved > 2 or (moved and k > 3):
            held = (f"{'-' if way < 0 else ''}{names[at]}" for at, way in zip(order.tolist(), signs, strict=True))
            yield f"the readings {', '.join(names)} stand in the columns {', '.join(held)}", order, signs


def advice(found: Fit, needed: Requirements | None = None) -> str:
    """Return which next press would help most, in words: within the required loads, or else those of the rows."""
    if needed is not None:
        loads, within = needed.loads(dense=True), "the required loads"
    else:
        k, warmer = len(found.sensor.noise), np.zeros(len(found.shift))
        force = found.sensor.predict(found.theta, found.shift, warmer)[:, k : k + 3]
        press, aside = float(force[:, 2].max()), float(np.hypot(force[:, 0], force[:, 1]).max())
        loads = np.array([[press / 4, 0], [press / 2, 0], [press, 0], [press / 2, aside], [press, aside]])
        within = "the largest loads of the rows"
    candidates, _, _ = calibrated_forces.poses_under(found, loads)
    candidates = candidates[np.isfinite(candidates).all(axis=1)]
    if not len(candidates):
        return (
            f"no next press is advised, since the mechanics of this calibration reach none within {within}, such as "
            f"{loads[0, 0]:.3g} N"
        )
    best, now, after = calibrated_forces.next_press(found, candidates, candidates)
    at = found.sensor.predict(found.theta, candidates[[best]], np.zeros(1))[0, len(found.sensor.noise) :]
    x, y, z = at[:3] + 0.0
    return (
        f"the next press that helps most within {within}: {z:.3g} N with ({x:.2g}, {y:.2g}) N along (x, y); it "
        f"lowers the standard deviation of decoded forces from {shown(now, 'mN')} to {shown(after, 'mN')}"
    )


# The study


def run(
    design: Design,
    made: Tolerances,
    needed: Requirements | None,
    files: Sequence[Path],
    options: Calibrating,
    command: str,
    progress: Progress,
) -> Result:
    """Calibrate a sensor from files that a test stand recorded, by its model or by a regression.

    made : tolerances of the sensor, from which the priors follow.
    needed : its requirements, within which the next press lies, and of which errors are percentages; None: the
        loads of the rows.
    command : command line of the study, for the one of the other decoder.

    Raises
    ------
    BadInput
        The design has no magnet, or an option or a file cannot be read.
    """
    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0), so there is nothing to calibrate")
    force_noise = options.force_noise
    if force_noise is not None and not 0 < force_noise < math.inf:
        raise BadInput(f"--force-noise must be a number of N above 0; got {force_noise:g}")
    fixed = pairs("--fix", options.fix or [], "remanence=1")
    values = {name: parse_numbers(f"--fix {name}", text)[0] for name, text in fixed.items()}
    bench = bench_file.read(files, design, pairs("--column", options.columns or [], "S1=X0"), options.force_sign)
    recorded = dataclasses.replace(rows_of(design, bench), needed=needed)
    if options.decoder == "model":
        return modelled(design, recorded, options, (made, values), f"{command} --decoder regression", progress)[0]
    # the model beside it may fail, but not by an option
    sensor_fit.unknowns_of(design, bench, made, freed=options.free or [], fixed=values)
    if options.responses is not None:
        mechanics_of(design, options.responses)
    compared = regression_study.compared(design, recorded, options.force_noise)
    other = command.replace(" --decoder regression", "")
    try:
        model: Result | str = modelled(design, recorded, options, (made, values), command, progress)[0]
    except (BadInput, SolveFailed) as error:
        model = str(error)
    return regression_study.result(compared, model, other, figures)


def rows_of(design: Design, bench: Bench) -> Recorded:
    """Return the rows of a bench with forces at the times of the readings, and which of them count."""
    measured, k, lag = sensor_fit.measured_of(bench), len(bench.readings), estimate_lag(bench)
    truth = measured[:, k : k + 3]
    if lag:
        truth[:] = _delayed(bench, truth, lag)
    full = calibration_file.at_rails(design, measured[:, :k])
    complete = np.isfinite(measured[:, :k]).all(axis=1) & np.isfinite(truth).any(axis=1) & ~full.any(axis=1)
    usable = np.flatnonzero(complete)
    rows = usable[np.linspace(0, len(usable) - 1, min(len(usable), MOST_ROWS)).round().astype(int)]
    at_rail, copied = _odd_rows(bench, full)
    said = [*at_rail, *copied]
    if len(rows) < len(usable):
        said.append(f"{len(rows)} of {len(usable)} rows are used, evenly spaced: more would teach hardly anything")
    if len(bench.runs) == 1:
        said.append(regression_study.ONE_RUN)
    return Recorded(bench, measured, lag, rows, said, copied)


def modelled(
    design: Design,
    recorded: Recorded,
    options: Calibrating,
    known: tuple[Tolerances, Mapping[str, float]],
    other: str,
    progress: Progress,
    stray: Array | float = 0.0,
) -> tuple[Result, str]:
    """Return the calibration by the model of the sensor, and the content of calibration.json.

    known : tolerances, and values of unknowns that are not estimated.
    other : command of the regression.
    stray : of `sensor_fit.unknowns_of`.
    """
    bench, measured, rows, force_noise = recorded.bench, recorded.measured, recorded.rows, options.force_noise
    made, values = known
    solves = {"progress": lambda share, text: progress(0.1 * share, text)}
    law, source, error = mechanics_of(design, options.responses, solves)
    un = sensor_fit.unknowns_of(
        design, bench, made, freed=options.free or [], fixed=values, model_error=error, stray=stray
    )
    noise, noise_source = noise_of(design)
    k = len(noise)
    truth = measured[:, k : k + 3]
    largest = float(np.nanmax(np.abs(truth)))
    full, of_what = full_scale(recorded.needed, largest, "the largest component of all forces")
    sensor = Sensor(design, law, un, noise, force_noise or ASSUMED_NOISE * largest)
    warmer = sensor_fit.warmer_of(sensor, bench)
    progress(0.1, f"{len(rows)} rows")
    fit = partial(sensor_fit.fit if force_noise else sensor_fit.fit_with_noise, sensor)
    found, doubtful, worst = _estimated(fit, sensor, measured[rows], warmer[rows])
    odd = [f"{_place(bench, rows[k])} fits {times:.2g} times worse than the others: {WRONG}" for k, times in worst]
    hint, better = mistaken(sensor, measured[rows], warmer[rows], bench.readings) if doubtful else ("", 1.0)
    if better > CERTAIN:
        raise BadInput(f"the columns are not what their heads say: {hint}")
    check = " Else ".join([*recorded.copied, hint or CHECK])
    for name in ("modulus", "remanence"):
        if not (factor := float(sensor.value(found.theta, name))) > 0:
            raise BadInput(
                f"no sensor of this design has these rows, as its {name} would be {factor:.2g} times the design's: "
                f"{check}"
            )
    try:
        table, curve, force = held_out(found.sensor, measured, warmer, bench, rows, full, progress)
    except BadInput as error:
        raise BadInput(f"no sensor of this design has these rows ({error}): {check}") from None
    summary = summary_of(table)
    if not doubtful and not odd and _failures(summary, ""):
        hint, _ = mistaken(sensor, measured[rows], warmer[rows], bench.readings)
    cause, remedy = shortcoming(found, sensor, recorded.force, float(summary[0]["inside_percent"]))
    progress(0.95, "pictures")
    tables: dict[str, Rows] = {
        "unknowns": calibration_file.unknown_rows(found), "held_out": table, "learning": curve,
        "residuals": residual_rows(found, bench, rows), "columns": bench.understood,
        "decoders": regression_study.decoders(recorded, force, summary[0]),
    }  # fmt: skip
    origin: FlatRow = {
        "mechanics": source, "lag_s": recorded.lag, "full_scale": full, "of_what": of_what,
        "noise_source": noise_source,
        "estimated": found.sensor.force_noise != sensor.force_noise, "hint": hint,
        "cause": "" if hint else cause, "check": " Else ".join([*recorded.copied, hint or remedy]), "other": other,
    }  # fmt: skip
    drawn = partial(figures, truth[rows], force[rows], curve)
    said = [*recorded.said, *odd]
    if force_noise is None and not origin["estimated"]:
        said.append(
            "the readings are less exact than the forces, so their residuals do not tell the error of the forces: "
            f"{sensor.force_noise:.3g} N is assumed; state it by --force-noise"
        )
    return _result(found, bench, tables, origin, said, drawn, recorded.needed)


def noise_of(design: Design) -> tuple[Array, str]:
    """Return the standard deviations (k,) of the readings, in the elements' unit, and their source."""
    elements, source = parts.with_noise(parts.of_design(design))
    noise = np.array([element.noise_T * element.gain for element in elements])
    if not noise.all():
        name = "hall_noise" if elements[0].unit == "V" else "chip_noise"
        raise BadInput(
            f"the readings have neither noise nor a step in this design, so nothing weighs them: set {name}"
        )
    return noise, source


def _warnings(found: Fit, tables: Mapping[str, Rows], outliers: Sequence[str], own: FlatRow) -> list[str]:
    """Return what speaks against a calibration: residuals that are no noise, wrong rows, rows without a force."""
    wrong = sorted({row["channel"] for row in tables["residuals"] if not row["noise"]})
    said = []
    if found.growth > 2 or wrong:
        where = f" (channels {', '.join(wrong)})" if wrong else ""
        wider = f", and errors count {math.sqrt(found.growth):.3g} times as large" if found.growth > 1.1 else ""
        said.append(
            f"residuals are larger than the stated errors, or no noise{where}: the model lacks something{wider}"
        )
    said += contradictions(found)
    un, count = found.sensor.unknowns, len(found.sensor.unknowns.free)
    beyond = int(np.isfinite(found.residual).sum()) - 3 * len(found.shift)
    if beyond < count:
        kept = [un.names[k] for k in un.free if found.deviation[k] > SAME * un.deviation[k]]
        known = f", such as {', '.join(kept[:3])}" if kept else ""
        said.append(
            f"{len(found.shift)} rows give {beyond} numbers beyond the magnet's places for {count} unknowns: "
            f"tolerances decide the rest; press more often, or --fix what is known{known}"
        )
    said += outliers
    if lost := own["lost"]:
        said.append(f"{lost} of {own['rows']} held-out rows have no force by the calibration, and count in no error")
    return said


def shortcoming(found: Fit, expected: Sensor, truth: Array, inside: float) -> tuple[str, str]:
    """Return what the error of the model's forces comes from, in words, and what to do.

    expected : sensor with the errors that forces (n, 3) were expected to have.
    inside : share of held-out forces within their 90 % intervals, %.
    """
    if found.growth > 2:
        return f"the model is off: its residuals are {math.sqrt(found.growth):.2g} times the stated errors", CHECK
    own, usual = (float(np.median(sensor.force_errors(truth))) for sensor in (found.sensor, expected))
    if own > DOUBTED * usual:
        return f"the model is off: measured forces miss it by {own:.2g} N, where {usual:.2g} N were expected", CHECK
    if not inside >= HELD:
        return f"the model is off: its intervals hold {inside:.2g} % of the forces", CHECK
    share = calibrated_forces.variance_shares(found)
    most = max(share, key=lambda name: share[name])
    variance = f"makes {shown(share[most], 'percent', 2)} of the variance of its forces"
    if most == "noise":
        return f"noise of the readings {variance}", "average more readings"
    if most == "mechanics":
        return f"what the mechanics miss of any beam {variance}", "give --responses, states of this design"
    few = f"what {len(found.shift)} rows leave open of {len(found.sensor.unknowns.free)} unknowns {variance}"
    return few, "press more often"


def _failures(summary: Sequence[FlatRow], check: str, why: str = "", *, misread: bool = False) -> list[str]:
    """Return why a calibration is of no use: most rows have no force, or a regression is much better.

    check : what is to be checked then, the most probable cause first.
    why : what the error of the model comes from; "" if columns are wrong.
    misread : whether rows fit better as columns of other things: then any better regression is enough.
    """
    own, others = summary[0], [row["rmse_N"] for row in summary[1:] if math.isfinite(row["rmse_N"])]
    if not own["rows"] > 2 * own["lost"]:
        return [f"{own['lost']} of {own['rows']} held-out rows have no force: do not use this calibration; {check}"]
    if others and not own["rmse_N"] <= (1.0 if misread else UNUSABLE) * min(others):
        ratio = own["rmse_N"] / min(others)
        cause = f" ({why})" if why else ""
        return [
            f"a regression decodes these rows {ratio:.2g} times better{cause}: do not use this calibration; {check}"
        ]
    return []


def _result(
    found: Fit,
    bench: Bench,
    tables: Mapping[str, Rows],
    origin: FlatRow,
    outliers: Sequence[str],
    drawn: Callable[[], list[Figure]],
    needed: Requirements | None,
) -> tuple[Result, str]:
    sensor, design, summary = found.sensor, found.sensor.design, summary_of(tables["held_out"])
    said, warnings = [*sentences(found), advice(found, needed)], _warnings(found, tables, outliers, summary[0])
    best = regression_study.best_of(tables["decoders"][1:])
    why = regression_study.why_model(summary[0], best, str(origin["other"]))
    failures = [
        f"{text}, or take the regression: {origin['other']}" if best else text
        for text in _failures(summary, str(origin["check"]), str(origin["cause"]), misread=bool(origin["hint"]))
    ]
    if origin["hint"] and not failures:
        warnings.insert(0, origin["hint"])
    record: FlatRow = {
        "decoder": "model", "rows": len(found.shift), "runs": len(bench.runs), "mechanics": origin["mechanics"],
        "lag_s": origin["lag_s"], "chi2": found.chi2, "freedom": found.freedom, "growth": found.growth,
        "unknowns": tables["unknowns"], "held_out": tables["held_out"], "decoders": tables["decoders"],
        "sentences": said, "full_scale_N": origin["full_scale"],
    }  # fmt: skip
    page = page_templates.rendered(
        Path(__file__).with_name("CALIBRATION.md.j2"),
        **origin,
        **tables,
        record=record,
        summary=summary,
        said=said,
        warnings=warnings,
        why=why,
        force_noise=sensor.force_noise,
        force_share=100 * sensor.force_share,
        noise=dict(zip(bench.readings, sensor.noise.tolist(), strict=True)),
        curve=_curve(tables["learning"]) if regression_study.is_curve(tables["learning"]) else [],
    )
    text = calibration_file.as_text(
        found, origin["mechanics"], origin["lag_s"], regression_study.lasting(warnings), failures
    )
    result = Result(
        title="Calibration",
        records=[record],
        shown=[
            Table(title="Columns", rows=bench.understood),
            Table(title="Unknowns", rows=tables["unknowns"]),
            Table(title="Held-out rows", rows=summary),
            f"Errors in percent are those of {origin['of_what']}, {origin['full_scale']:.4g} N.",
            *(f"{page_templates.sentence(each)}." for each in said),
        ],
        tables=tables,
        files={
            "calibration.json": partial(write_text, text=text),
            "design.toml": partial(write_text, text=design_text(found.design) + design_table(needed)),
            "calibration.png": lambda path: save(path, drawn()),
        },
        pages={"CALIBRATION.md": page},
        warnings=warnings,
        failures=failures,
        design=dataclasses.asdict(design),
    )
    return result, text


def summary_of(table: Rows) -> list[FlatRow]:
    """Return the errors over all held-out rows, by method."""
    found = []
    for method in METHODS:
        own = [row for row in table if row["method"] == method]
        weight = np.array([row["rows"] - row["lost"] for row in own], dtype=float)
        square = np.array([row["rmse_N"] ** 2 for row in own])
        share = [row.get("inside_percent", math.nan) for row in own]
        rmse = math.sqrt(float(np.nansum(weight * square) / weight.sum())) if weight.sum() else math.nan
        first = own[0]
        found.append({
            "method": method,
            "rows": sum(row["rows"] for row in own),
            "lost": sum(row["lost"] for row in own),
            "rmse_N": rmse,
            "worst_N": max(row["worst_N"] for row in own),
            "rmse_percent": rmse * first["rmse_percent"] / first["rmse_N"] if first["rmse_N"] else math.nan,
            "inside_percent": float(np.average(share, weights=weight)) if weight.sum() else math.nan,
        })  # fmt: skip
    return found


def _curve(curve: Rows) -> list[FlatRow]:
    """Return the mean RMSE over the held-out parts, by number of training rows."""
    import pandas as pd

    frame = pd.DataFrame(curve)
    common = frame.groupby("training_rows").held_out.nunique()
    frame = frame[frame.training_rows.isin(common[common == common.max()].index)]
    wide = frame.pivot_table("rmse_N", "training_rows", "method", sort=True).reindex(columns=METHODS)
    return [
        {"training_rows": int(size)} | {f"{name} (N)": float(value) for name, value in row.items()}
        for size, row in wide.iterrows()
    ]


def figures(truth: Array, force: Array, curve: Rows) -> list[Figure]:
    """Return errors over measured forces (n, 3) of held-out rows, and the learning curve if there is one."""
    import altair as alt
    import pandas as pd

    shown = pd.DataFrame(truth, columns=list("xyz")).melt(var_name="series", value_name="measured force (N)")
    shown["series"] = shown["panel"] = "F" + shown.series
    shown["error (N)"] = (force - truth).T.ravel()
    shown = shown.dropna(ignore_index=True)
    drawn, note = thinned(shown, "error (N)")
    points = alt.Chart().transform_filter("datum.drawn").mark_point().encode(
        x=alt.X("measured force (N)", **FREE), y=alt.Y("error (N)", **FREE), **styles(shown["series"])
    )  # fmt: skip
    errors = Figure(
        "Error of decoded forces",
        "Decoded less measured force of rows that the calibration has not seen, over the measured force.",
        panels(alt.layer(*rule("y", 0.0), points), drawn, own="xy"),
        shown,
        note,
    )
    if not regression_study.is_curve(curve):
        return [errors]
    rows, error = "training rows", "RMSE on held-out rows (N)"
    learned = pd.DataFrame(curve).rename(columns={"training_rows": rows, "rmse_N": error, "method": "series"})
    learned = learned.groupby(["series", rows], sort=True)[error].mean().dropna().reset_index()
    lines = alt.Chart(learned).mark_line(point=True).encode(
        x=alt.X(rows, **LOG), y=alt.Y(error, **LOG), **styles(learned["series"])
    )  # fmt: skip
    about = "Mean error on held-out rows over the number of rows that a method was given."
    return [errors, Figure("Learning curve", about, lines, learned)]
