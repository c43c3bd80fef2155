"""Study calibrate: a made sensor from bench rows, its forces on held-out runs beside two regressions, and its files.

A calibration is a file of numbers (calibration.json): the nominal design, the polynomials of its mechanics, and the
unknowns of `studies.calibration.sensor_fit` with their covariance. `magtip decode --calibration` reads it.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import parts
from analytic.inverse.response_surface import Mechanics, of_formula, workspace
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.calibration import bench_file, sensor_fit
from studies.calibration.bench_file import FORCES, MOTIONS, Bench
from studies.calibration.sensor_fit import Fit, Sensor, Unknowns
from studies.inputs import table_input
from studies.inputs.option_groups import Decoding
from studies.inputs.user_input import design_text, parse_numbers
from studies.mechanics import surrogate_response
from studies.output import atomic_files, page_templates
from studies.output.atomic_files import write_text
from studies.output.figures import Figure, Guide, Look, picture, plot, table_of
from studies.output.result import Result, Table
from studies.sensing.decode_readings import of_file
from studies.sensitivity.made_sensors import Tolerances

if TYPE_CHECKING:
    import pandas as pd

    from studies.output.records import FlatRow

FILES = (
    *("CALIBRATION.md", "calibration.json", "design.toml", "calibration.png"),
    *("unknowns.csv", "held_out.csv", "learning.csv", "residuals.csv", "columns.csv"),
)
FORMAT = 1
"""Version of calibration.json."""
SIZES = (12, 30, 100, 300, 1000, 3000)
"""Numbers of rows of the learning curve."""
FOLDS = 5
"""Parts in which a single run is held out, each of consecutive rows."""
TOGETHER, IRRELEVANT = 0.9, 0.05
"""Correlation of two unknowns that is told; share of the force's variance below which it does not depend on them."""
SOLVED_ERROR = 0.01
"""Relative standard deviation of the forces of solved states: level standard is within 1 % (results/accuracy)."""
SAME = 0.9
"""Posterior over prior standard deviation from which the rows say nothing about an unknown."""
PATTERN = 4.0
"""Standard errors of the mean or of the correlation of neighbours beyond which residuals are no noise."""
OUTLIER, UNUSABLE = 6.0, 1.5
"""Misfit of a row over the median from which it is named; RMSE over that of the better regression from which a
calibration is called unusable."""
METHODS = ("calibration", "linear ridge", "quadratic ridge")
LAGS = np.linspace(-0.2, 0.2, 41)
"""Lags of the force behind the readings that are tried, s."""


# Mechanics, sensor and lag


def mechanics_of(design: Design, responses: Path | None) -> tuple[Mechanics, str, float]:
    """Return the mechanics of a design, their source, and the relative standard deviation of their forces.

    Raises
    ------
    BadInput
        The surrogate does not know the design, and no states of finite elements are given.
    """
    if responses is not None:
        return of_file(responses, design), f"finite elements ({responses.name})", SOLVED_ERROR
    try:
        beams = surrogate_response.beams_of([design])
        deepest = 0.999 * design.D * float(min(beams.deepest[0], beams.stable_to()[0]))
        farthest = 0.999 * design.D * float(beams.farthest[0])
        law = of_formula(lambda load: surrogate_response.respond(design, load).response, deepest, farthest)
        errors = surrogate_response.respond(design, _press(deepest / 2)).errors
    except BadInput as error:
        raise BadInput(
            f"{str(error).removesuffix(': take finite elements')}: give --responses, states of finite elements that "
            "magtip solve --json printed"
        ) from None
    return law, "surrogate of the finite elements", (errors["force"] or 0.0) / sensor_fit.QUANTILE


def _press(depth: float) -> Any:
    from geometry.loads import Load

    return Load(depth=depth)


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
    X = _features(readings, 2, readings[known])
    scores = []
    for lag in LAGS:
        moved = _delayed(bench, force, lag)
        rows = known & np.isfinite(moved).any(axis=1)
        y = moved[rows][:, np.isfinite(moved[rows]).all(axis=0)]
        scores.append(np.square(y - X[rows] @ np.linalg.lstsq(X[rows], y, rcond=None)[0]).mean())
    best = int(np.argmin(scores))
    if scores[best] > 0.98 * scores[len(LAGS) // 2]:
        return 0.0
    if best in (0, len(LAGS) - 1):
        return None
    a, b, c = scores[best - 1 : best + 2]
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


# Held-out runs and regressions


def _features(readings: Array, degree: int, like: Array) -> Array:
    """Return powers and products of readings (n, k), standardised as those of `like`, up to a degree, with ones."""
    scale = like.std(axis=0)
    x = (readings - like.mean(axis=0)) / np.where(scale > 0, scale, 1.0)
    columns = [np.ones(len(x))]
    for d in range(1, degree + 1):
        columns += [x[:, list(c)].prod(axis=1) for c in itertools.combinations_with_replacement(range(x.shape[1]), d)]
    return np.stack(columns, axis=1)


def ridge(readings: Array, force: Array, asked: Array, degree: int) -> Array:
    """Return forces (m, 3) at readings (m, k) by ridge regression on rows (n, k) and (n, 3).

    The penalty is the one with the least generalised cross-validation (Golub, Heath and Wahba, Technometrics 21,
    1979). A component that was not measured is NaN.
    """
    X, at = (_features(each, degree, readings) for each in (readings, asked))
    found = np.full((len(asked), 3), np.nan)
    for k in range(3):
        known = np.isfinite(force[:, k])
        if known.sum() < 2:
            continue
        y, mean = force[known, k], force[known, k].mean()
        U, s, Vt = np.linalg.svd(X[known], full_matrices=False)
        part, best = U.T @ (y - mean), math.inf
        for penalty in np.geomspace(1e-8, 1e2, 41) * len(y):
            shrink = s**2 / (s**2 + penalty)
            left = np.square(y - mean - U @ (shrink * part)).sum() / max(len(y) - 1 - shrink.sum(), 1e-9) ** 2
            if left < best:
                best, weights = left, Vt.T @ (s / (s**2 + penalty) * part)
        found[:, k] = mean + at @ weights
    return found


def folds(bench: Bench, rows: Ints) -> Iterator[tuple[str, Ints, Ints]]:
    """Yield name, training rows and held-out rows: whole runs in turn, or parts of the only run."""
    run = bench.table["run"].to_numpy()[rows]
    if len(set(run)) > 1:
        for name in bench.runs:
            if (run == name).any():
                yield name, rows[run != name], rows[run == name]
    else:
        count = min(FOLDS, len(rows))
        for k, part in enumerate(np.array_split(rows, count), 1):
            yield f"part {k} of {count}", np.setdiff1d(rows, part), part


def _score(force: Array, truth: Array, full_scale: float) -> FlatRow:
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
        "rmse_percent": 100 * rmse / full_scale,
    }


def held_out(
    sensor: Sensor, measured: Array, warmer: Array, bench: Bench, rows: Ints, progress: Progress
) -> tuple[list[FlatRow], list[FlatRow], Array, Array]:
    """Return errors on held-out rows, the learning curve, and force and half width (n, 3) that each row's fold gives.

    The learning curve has the errors of sensors and regressions from fewer training rows, drawn with a seed.
    """
    k = len(sensor.noise)
    readings, truth = measured[:, :k], measured[:, k : k + 3]
    full_scale = float(np.nanmax(np.abs(truth)))
    table: list[FlatRow] = []
    curve: list[FlatRow] = []
    force, half = np.full_like(truth, np.nan), np.full_like(truth, np.nan)
    every = list(folds(bench, rows))
    for place, (name, train, test) in enumerate(every):
        progress(0.2 + 0.7 * place / len(every), f"without {name}")
        sizes = [size for size in SIZES if size < len(train)] if place < FOLDS else []
        for size in [*sizes, len(train)]:
            # with one seed the smaller sets are parts of the larger ones
            own = np.sort(np.random.default_rng(place).permutation(train)[:size])
            found = sensor_fit.fit(sensor, measured[own], warmer[own])
            decoded = sensor_fit.decode(found, readings[test], warmer[test])
            answers = [decoded.force] + [ridge(readings[own], truth[own], readings[test], n) for n in (1, 2)]
            for method, answer in zip(METHODS, answers, strict=True):
                score: FlatRow = {"method": method, "held_out": name}
                score |= _score(answer, truth[test], full_scale)
                curve.append(score | {"training_rows": size})
                if size == len(train):
                    table.append(score)
        force[test], half[test] = decoded.force, decoded.half_width
        inside = np.abs(decoded.force - truth[test]) <= np.hypot(
            decoded.half_width, sensor_fit.QUANTILE * sensor.force_noise
        )
        known = np.isfinite(decoded.force) & np.isfinite(truth[test])
        table[-len(METHODS)]["inside_percent"] = 100 * float(inside[known].mean()) if known.any() else math.nan
    return table, curve, force, half


# What the fit says


def unknown_rows(found: Fit) -> list[FlatRow]:
    """Return value, standard deviation and prior of each unknown."""
    un = found.sensor.unknowns
    return [
        {"name": name, "unit": unit, "value": value, "deviation": deviation, "prior": prior, "prior_deviation": wide}
        for name, unit, value, deviation, prior, wide in zip(
            un.names, un.units, found.theta.tolist(), found.deviation.tolist(), un.mean.tolist(),
            un.deviation.tolist(), strict=True,
        )
    ]  # fmt: skip


def sentences(found: Fit) -> list[str]:
    """Return what the rows cannot tell: unknowns that move together, and those that stay as uncertain as before."""
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
    total, *more = sensor_fit.force_variances(found, [found.covariance, *wider], found.shift)
    for group, along, variance in zip(groups, directions, more, strict=True):
        first = group[0]
        effect = ": the decoded force does not depend on it" if variance / total - 1 < IRRELEVANT else ""
        same, other = ([un.names[k] for k in group if along[k] * way > 0] for way in (1, -1))
        moves = f" {'move' if same[1:] else 'moves'} against {', '.join(other)}" if other else " move together"
        said.append(f"{', '.join(same)}{moves} ({np.abs(correlation[first, group[1:]]).min():.2f}){effect}")
    silent = [un.names[k] for k in un.free if found.deviation[k] > SAME * un.deviation[k]]
    if silent:
        said.append(f"these rows say nothing about {', '.join(silent)}, which keep their priors")
    return said


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


def _outliers(found: Fit, bench: Bench, rows: Ints) -> list[str]:
    """Return a sentence on the row that fits worst, if it is far from all others."""
    size = np.sqrt(np.nanmean(np.square(found.residual), axis=1))
    worst = int(np.argmax(size))
    if len(size) < 3 or not size[worst] > OUTLIER * np.median(size):
        return []
    run = bench.table["run"].to_numpy()
    at = 1 + int(np.count_nonzero(run[: rows[worst]] == run[rows[worst]]))
    times = size[worst] / np.median(size)
    text = f"row {at} of {run[rows[worst]]} fits {times:.2g} times worse than the others: was it measured wrongly?"
    return [text]


def advice(found: Fit) -> str:
    """Return which next press would help most, in words."""
    low, high = workspace(found.sensor.design, found.sensor.mechanics)
    side, deep = 0.8 * high[0], 0.9 * low[2]
    grid = [[0.0, 0.0, w] for w in (deep / 4, deep / 2, deep)]
    grid += [[side * x, side * y, w] for w in (deep / 2, deep) for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    candidates = np.array(grid)
    best, now, after = sensor_fit.next_press(found, candidates)
    at = found.sensor.predict(found.theta, best[None], np.zeros(1))[0, len(found.sensor.noise) :]
    x, y, z = at[:3]
    return (
        f"the next press that helps most: {z:.3g} N with ({x:.2g}, {y:.2g}) N along (x, y); it lowers the standard "
        f"deviation of decoded forces from {1e3 * now:.3g} to {1e3 * after:.3g} mN"
    )


# The study


def run(
    design: Design,
    bench: Bench,
    tolerances: Tolerances,
    progress: Progress,
    *,
    responses: Path | None = None,
    freed: Sequence[str] = (),
    fixed: Mapping[str, float] = {},
    force_noise: float | None = None,
) -> Result:
    """Calibrate a sensor from bench rows.

    Parameters
    ----------
    responses : states of finite elements for the mechanics; default: the surrogate.
    freed, fixed : unknowns with a wide prior, and values of unknowns that are not estimated.
    force_noise : standard deviation of the measured forces, N; default: half a percent of the largest one.

    Raises
    ------
    BadInput
        The design has no magnet, the surrogate does not know it, or an unknown has no such name.
    """
    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0), so there is nothing to calibrate")
    if force_noise is not None and not 0 < force_noise < math.inf:
        raise BadInput(f"--force-noise must be a number of N above 0; got {force_noise:g}")
    progress(0.0, "mechanics")
    law, source, error = mechanics_of(design, responses)
    un = sensor_fit.unknowns_of(design, bench, tolerances, freed=freed, fixed=fixed, model_error=error)
    elements, noise_source = parts.with_noise(parts.of_design(design))
    noise = np.array([element.noise_T * element.gain for element in elements])
    if not noise.all():
        raise BadInput(
            "the readings have neither noise nor a step in this design, so nothing weighs them: set "
            f"{'hall_noise' if elements[0].unit == 'V' else 'chip_noise'}"
        )
    measured, k, lag = sensor_fit.measured_of(bench), len(noise), estimate_lag(bench)
    if lag:
        measured[:, k : k + 3] = _delayed(bench, measured[:, k : k + 3], lag)
    full_scale = float(np.nanmax(np.abs(measured[:, k : k + 3])))
    sensor = Sensor(design, law, un, noise, force_noise or 0.005 * full_scale)
    complete = np.isfinite(measured[:, :k]).all(axis=1) & np.isfinite(measured[:, k : k + 3]).any(axis=1)
    rows, warmer = np.flatnonzero(complete), sensor_fit.warmer_of(sensor, bench)
    progress(0.1, f"{len(rows)} rows")
    found = (sensor_fit.fit if force_noise else sensor_fit.fit_with_noise)(sensor, measured[rows], warmer[rows])
    table, curve, force, half = held_out(found.sensor, measured, warmer, bench, rows, progress)
    progress(0.95, "pictures")
    residuals, summary = residual_rows(found, bench, rows), _summary(table)
    origin = {
        "mechanics": source,
        "lag_s": lag,
        "full_scale": full_scale,
        "noise_source": noise_source,
        "estimated": force_noise is None,
    }
    result = _result(
        found, bench, (table, curve, summary, residuals), origin, _warnings(found, bench, rows, residuals, summary)
    )
    points = [
        {"component": name, "measured": t, "decoded": f, "half": h}
        for j, name in enumerate(FORCES)
        for t, f, h in zip(*(each[rows, j].tolist() for each in (measured[:, k : k + 3], force, half)), strict=True)
        if math.isfinite(t)
    ]
    drawn = {"calibration.png": partial(picture, rows=points, draw=partial(figures, curve=curve))}
    return dataclasses.replace(result, files={**result.files, **drawn})


def _warnings(
    found: Fit, bench: Bench, rows: Ints, residuals: Sequence[FlatRow], summary: Sequence[FlatRow]
) -> list[str]:
    """Return what speaks against a calibration: residuals that are no noise, wrong rows, a better regression."""
    wrong = sorted({row["channel"] for row in residuals if not row["noise"]})
    said = []
    if found.growth > 2 or wrong:
        where = f" (channels {', '.join(wrong)})" if wrong else ""
        wider = f", and all intervals are {math.sqrt(found.growth):.3g} times as wide" if found.growth > 1.1 else ""
        said.append(
            f"residuals are larger than the stated errors, or no noise{where}: the model lacks something{wider}"
        )
    said += _outliers(found, bench, rows)
    if lost := summary[0]["lost"]:
        said.append(
            f"{lost} of {summary[0]['rows']} held-out rows have no force by the calibration, and count in no error"
        )
    return said


def _failures(summary: Sequence[FlatRow]) -> list[str]:
    """Return why a calibration is of no use: most rows have no force, or a regression is much better."""
    own, others = summary[0], [row["rmse_N"] for row in summary[1:] if math.isfinite(row["rmse_N"])]
    check = "check which column is which element, the signs of the forces, and wrong rows"
    if not own["rows"] > 2 * own["lost"]:
        return [f"{own['lost']} of {own['rows']} held-out rows have no force: do not use this calibration; {check}"]
    if others and not own["rmse_N"] <= UNUSABLE * min(others):
        ratio = own["rmse_N"] / min(others)
        return [f"a regression decodes these rows {ratio:.2g} times better: do not use this calibration; {check}"]
    return []


def _result(
    found: Fit,
    bench: Bench,
    tables: tuple[Sequence[FlatRow], Sequence[FlatRow], Sequence[FlatRow], Sequence[FlatRow]],
    origin: FlatRow,
    warnings: Sequence[str],
) -> Result:
    """Return the result of a fit; `tables` are those of held-out rows, learning curve, summary and residuals."""
    (table, curve, summary, residuals), sensor = tables, found.sensor
    said, unknowns, design = [*sentences(found), advice(found)], unknown_rows(found), sensor.design
    record: FlatRow = {
        "rows": len(found.shift), "runs": len(bench.runs), "mechanics": origin["mechanics"],
        "lag_s": origin["lag_s"], "chi2": found.chi2, "freedom": found.freedom, "growth": found.growth,
        "unknowns": unknowns, "held_out": table, "sentences": said,
    }  # fmt: skip
    page = page_templates.rendered(
        Path(__file__).with_name("CALIBRATION.md.j2"),
        **origin,
        record=record,
        understood=bench.understood,
        unknowns=unknowns,
        table=table,
        summary=summary,
        residuals=residuals,
        said=said,
        warnings=warnings,
        force_noise=sensor.force_noise,
        noise=dict(zip(bench.readings, sensor.noise.tolist(), strict=True)),
        learning=_curve(curve),
    )
    factors = {name: float(sensor.value(found.theta, name)) for name in ("modulus", "remanence")}
    calibrated = dataclasses.replace(
        design, E=design.E * factors["modulus"], remanence=design.remanence * factors["remanence"]
    )
    text = as_text(found, origin["mechanics"], origin["lag_s"])
    return Result(
        title="Calibration",
        records=[record],
        shown=[
            Table(title="Columns", rows=bench.understood),
            Table(title="Unknowns", rows=unknowns),
            Table(title="Held-out rows", rows=summary),
            *(f"{each[0].upper()}{each[1:]}." for each in said),
        ],
        tables={
            "unknowns": unknowns, "held_out": table, "learning": curve, "residuals": residuals,
            "columns": list(bench.understood),
        },
        files={
            "calibration.json": partial(write_text, text=text),
            "design.toml": partial(write_text, text=design_text(calibrated)),
        },
        pages={"CALIBRATION.md": page},
        warnings=warnings,
        failures=_failures(summary),
        design=dataclasses.asdict(design),
    )  # fmt: skip


def _summary(table: Sequence[FlatRow]) -> list[FlatRow]:
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


def _curve(curve: Sequence[FlatRow]) -> list[FlatRow]:
    """Return the mean RMSE over the held-out parts, by number of training rows."""
    import pandas as pd

    frame = pd.DataFrame(curve)
    common = frame.groupby("training_rows").held_out.nunique()
    frame = frame[frame.training_rows.isin(common[common == common.max()].index)]
    wide = frame.pivot_table("rmse_N", "training_rows", "method", sort=True)[list(METHODS)]
    return [
        {"training_rows": int(size)} | {f"{name} (N)": float(value) for name, value in row.items()}
        for size, row in wide.iterrows()
    ]


def figures(points: pd.DataFrame, curve: Sequence[FlatRow]) -> list[Figure]:
    """Return decoded over measured forces of held-out rows, and the learning curve."""
    import pandas as pd

    shown = points.assign(**{
        "measured force (N)": points.measured, "error of the decoded force (N)": points.decoded - points.measured,
        "series": points.component.str.removesuffix("_N"), "panel": points.component.str.removesuffix("_N"),
    })  # fmt: skip
    learned = pd.DataFrame(curve).rename(
        columns={"training_rows": "training rows (1)", "rmse_N": "RMSE on held-out rows (N)"}
    )
    learned = learned.groupby(["method", "training rows (1)"], sort=True)["RMSE on held-out rows (N)"].mean()
    return [
        plot(
            "Error of decoded forces",
            "Decoded less measured force of rows that the calibration has not seen, over the measured force.",
            shown,
            "measured force (N)",
            "error of the decoded force (N)",
            Look(line=False, guides=(Guide("y", 0.0, ""),), shared=False),
        ),
        plot(
            "Learning curve",
            "Mean error on held-out rows over the number of rows that a method was given.",
            learned.reset_index().rename(columns={"method": "series"}),
            "training rows (1)",
            "RMSE on held-out rows (N)",
            Look(log="xy"),
        ),
    ]


# The file of a calibration


def as_text(found: Fit, source: str, lag: float | None) -> str:
    """Return the text of calibration.json."""
    sensor = found.sensor
    law = {name: np.asarray(value).tolist() for name, value in dataclasses.asdict(sensor.mechanics).items()}
    record = {
        "format": FORMAT,
        "design": dataclasses.asdict(sensor.design),
        "mechanics_source": source,
        "lag_s": lag,
        "unknowns": unknown_rows(found),
        "covariance": found.covariance.tolist(),
        "growth": found.growth,
        "noise": sensor.noise.tolist(),
        "force_noise_N": sensor.force_noise,
        "temperature_C": sensor.temperature_C,
        "mechanics": law,
    }
    return json.dumps(record, indent=1) + "\n"


def read(path: Path) -> Fit:
    """Read calibration.json.

    Raises
    ------
    BadInput
        The file is no calibration, or of another version.
    """
    try:
        record = json.loads(table_input.text_of(path, "JSON"))
        if record["format"] != FORMAT:
            raise BadInput(f"{path} has format {record['format']}; this magtip reads {FORMAT}: calibrate again")
        law: Any = dict(record["mechanics"]) | {"errors": tuple(record["mechanics"]["errors"])}
        law |= {name: np.array(law[name]) for name in ("tau", "lateral", "normal", "depth", "shear")}
        rows = record["unknowns"]
        un = Unknowns(
            tuple(row["name"] for row in rows),
            tuple(row["unit"] for row in rows),
            np.array([row["prior"] for row in rows]),
            np.array([row["prior_deviation"] for row in rows]),
        )
        sensor = Sensor(
            Design(**record["design"]), Mechanics(**law), un, np.array(record["noise"]), record["force_noise_N"],
            temperature_C=record["temperature_C"],
        )  # fmt: skip
        theta = np.array([row["value"] for row in rows])
        # growth is in the covariance already; of the decoder's own noise it is the factor too
        nothing = np.zeros((0, 3))
        return Fit(sensor, theta, np.array(record["covariance"]), nothing, nothing, record["growth"], 1)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"{path} is no calibration ({error!r}): give calibration.json of magtip calibrate") from None


# Decoding by a calibration

DECODED = (
    "status",
    *(
        f"{name}_{axis}_{unit}"
        for name, unit in (("force", "N"), ("half_width", "N"), ("shift", "mm"))
        for axis in "xyz"
    ),
)
"""Columns that decoding by a calibration adds: force, half of its 90 % interval, shift of the magnet."""
WHY = {
    "ok": "",
    "no_pose": "no pose of the magnet explains these readings: the sensor has changed, or a reading is wrong",
    "not_finite": "a reading is missing or not a finite number",
}


def decoded_rows(found: Fit, readings: Array) -> list[FlatRow]:
    """Return the columns DECODED of readings (n, k), in the elements' unit."""
    answer = sensor_fit.decode(found, readings, np.zeros(len(readings)))
    finite, known = (np.asarray(np.isfinite(each).all(axis=1)) for each in (readings, answer.force))
    status = np.where(known, "ok", np.where(finite, "no_pose", "not_finite"))
    shift = np.where(known[:, None], answer.shift, np.nan)
    numbers = np.hstack([answer.force, answer.half_width, shift])
    return [dict(zip(DECODED, (s, *n), strict=True)) for s, n in zip(status.tolist(), numbers.tolist(), strict=True)]


def decode(design: Design, decoding: Decoding, out: Path | None, *, as_json: bool) -> Result:
    """Decode one set of readings, or the rows of a table, by a calibration; without `out` a table is printed.

    Raises
    ------
    BadInput
        The calibration is of another design, an option contradicts it, or the readings cannot be read.
    """
    path = decoding.calibration
    assert path is not None
    for option, given in (
        ("--level", decoding.level),
        ("--responses", decoding.responses),
        ("--tolerance", decoding.tolerances),
        ("--units", decoding.units),
        ("--zero", decoding.zero),
        ("--ignore-tilt", decoding.ignore_tilt),
    ):
        if given:
            raise BadInput(f"{option} has no place beside --calibration, which fixes it: leave it out")
    found = read(path)
    if dataclasses.asdict(found.sensor.design) != dataclasses.asdict(design):
        raise BadInput(f"{path} is the calibration of another design: decode with the design that was calibrated")
    names = parts.columns(parts.of_design(design))
    if decoding.readings is not None:
        values = parse_numbers("--readings", decoding.readings)
        if len(values) != len(names):
            raise BadInput(f"--readings takes {len(names)} numbers, {','.join(names)}; got {len(values)}")
        (row,) = decoded_rows(found, np.array([values]))
        record = {"status": row["status"], "message": WHY[row["status"]], "level": "calibration", "readings": values}
        for name, unit in (("force", "N"), ("half_width", "N"), ("shift", "mm")):
            record[f"{name}_{unit}"] = [row[f"{name}_{axis}_{unit}"] for axis in "xyz"]
        return Result(
            title="Decoded", records=[record], failures=[] if row["status"] == "ok" else [record["message"]]
        )
    assert decoding.file is not None
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    raw, numbers = bench_file.read_readings(decoding.file, design)
    rows = [
        {**texts, **row}
        for texts, row in zip(raw.fillna("").to_dict("records"), decoded_rows(found, numbers), strict=True)
    ]
    table = table_of(rows).to_csv(index=False)
    if target is not None:
        atomic_files.write_text(target, table)
    elif not as_json:
        print(table, end="", flush=True)
    lost = sum(row["status"] != "ok" for row in rows)
    return Result(
        title="Decoded rows",
        records=rows if as_json and target is None else [],
        shown=[],
        remarks=[f"{lost} of {len(rows)} rows have no force"] if lost else [],
        failures=["no row has a force"] if lost == len(rows) else [],
    )
