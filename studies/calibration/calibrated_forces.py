"""Forces that readings of an estimated sensor give, with their 90 % intervals, and what rows would teach about it.

The magnet's shift s is the one that explains the readings best. An error of the unknowns theta then moves it, so that
the decoded force changes by

    dF = (dF/dtheta - dF/ds A^-1 J' W dr/dtheta) dtheta,     A = J' W J,   J = dr/ds,

with readings r and their weights W, and by the readings' noise, with the variance dF/ds A^-1 dF/ds'.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import rotation
from analytic.inverse.response_surface import force_and_load, workspace
from geometry.arrays import Array
from studies.calibration.sensor_fit import QUANTILE, Fit, Sensor, condensed, linearised, settle_shifts, slopes_of


@dataclass(frozen=True, slots=True, eq=False)
class DecodedForces:
    """Forces that readings give.

    Attributes
    ----------
    force, half_width : (n, 3) N, and half of the 90 % interval; NaN where no pose explains the readings.
    shift : (n, 3) mm.
    load : (n, 3) depth and shears of the plate, mm.
    misfit : (n,) root of the mean squared error of the readings over their standard deviation.
    """

    force: Array
    half_width: Array
    shift: Array
    load: Array
    misfit: Array


LARGEST_MISFIT = 5.0
"""Largest error of the readings, in their standard deviations, of a pose that explains them."""


def decode(found: Fit, readings: Array, warmer: Array, *, zeroed: bool = False) -> DecodedForces:
    """Decode readings (n, k), in the elements' unit, by an estimated sensor.

    zeroed : whether the readings were moved to those of the estimated sensor at rest, whose errors then fall out.
    """
    return decode_with(found, [found.covariance], readings, warmer, zeroed=zeroed)[0]


def decode_with(
    found: Fit, covariances: Sequence[Array], readings: Array, warmer: Array, *, zeroed: bool = False
) -> list[DecodedForces]:
    """Decode readings by a sensor whose unknowns have other covariances (p, p), which change the intervals only."""
    sensor, theta = found.sensor, found.theta
    count = readings.shape[1]
    measured = np.hstack([readings, np.full((len(readings), 6), np.nan)])
    known = np.isfinite(readings).all(axis=1)
    measured[~known] = np.nan
    W = sensor.weights(measured)
    start = sensor.starts(theta, measured)
    shift = settle_shifts(sensor, theta, start, measured, W, warmer)
    un = sensor.unknowns
    at, slope, noise = _decoding_slopes(sensor, theta, shift, W, warmer, zeroed=zeroed)
    misfit = np.sqrt(np.square((W * (np.nan_to_num(measured) - at))[:, :count]).mean(axis=1))
    F, noise = at[:, count : count + 3], found.growth * noise
    load = at[:, count + 3 :] - np.outer(sensor.value(theta, "stand_compliance") * F[:, 2], [1, 0, 0])
    load[:, 0] -= sensor.value(theta, "stand_zero")
    # errors of the polynomials at their samples
    model = np.array([sensor.mechanics.errors[1], sensor.mechanics.errors[1], sensor.mechanics.errors[2]]) / 2
    good: NDArray[np.bool_] = np.asarray(known & (misfit < LARGEST_MISFIT))
    F, shift, load = (np.where(good[:, None], each, np.nan) for each in (F, shift, load))
    decoded = []
    for covariance in covariances:
        variance = np.einsum("nfp,pq,nfq->nf", slope, covariance[np.ix_(un.free, un.free)], slope) + noise
        half = QUANTILE * np.sqrt(variance + np.square(model))
        decoded.append(DecodedForces(F, np.where(good[:, None], half, np.nan), shift, load, misfit))
    return decoded


def _decoding_slopes(
    sensor: Sensor, theta: Array, shift: Array, W: Array, warmer: Array, *, zeroed: bool
) -> tuple[Array, Array, Array]:
    """Return predictions (n, m) at shifts (n, 3), and of the force that their readings give: slopes by free unknowns
    (n, 3, f), and variances (n, 3) by the readings' noise."""
    free, count = sensor.unknowns.free, len(sensor.noise)
    at, by_shift, by_theta = slopes_of(sensor, theta, shift, warmer, free)
    if zeroed:
        rest = slopes_of(sensor, theta, np.zeros_like(shift), warmer, free)[2]
        by_theta[:, :count] -= rest[:, :count]
    Js, Jt = W[..., None] * by_shift, W[..., None] * by_theta
    by_shift, by_theta = (each[:, count : count + 3] for each in (by_shift, by_theta))
    A = np.einsum("nmi,nmj->nij", Js, Js)
    A += 1e-12 * (1 + np.trace(A, axis1=1, axis2=2))[:, None, None] * np.eye(3)
    moves = np.linalg.solve(A, np.einsum("nmi,nmp->nip", Js, Jt))
    slope = by_theta - np.einsum("nfi,nip->nfp", by_shift, moves)
    return at, slope, np.einsum("nfi,nij,nfj->nf", by_shift, np.linalg.inv(A), by_shift)


def planned(sensor: Sensor, shift: Array) -> Fit:
    """Return a sensor at the means of its priors, as certain as readings and forces at shifts (n, 3) will make it."""
    un, warmer = sensor.unknowns, np.zeros(len(shift))
    rows = sensor.predict(un.mean, shift, warmer)
    rows[:, len(sensor.noise) + 3 :] = np.nan
    r, Js, Jt = linearised(sensor, un.mean, shift, rows, sensor.weights(rows), warmer)
    covariance = np.zeros((len(un.mean), len(un.mean)))
    covariance[np.ix_(un.free, un.free)] = np.linalg.inv(condensed(r, Js, Jt, un, un.mean)[0])
    return Fit(sensor, un.mean, covariance, shift, np.zeros_like(rows), 1.0, 1)


def force_errors(found: Fit, shift: Array, count: int, rng: np.random.Generator) -> Array:
    """Return errors (count, n, 3), N, of decoded forces at shifts (n, 3) of sensors as uncertain as an estimated one.

    Each of `count` sensors has one error of the unknowns for all shifts; noise of the readings is left out.
    """
    sensor, free, warmer = found.sensor, found.sensor.unknowns.free, np.zeros(len(shift))
    rows = sensor.predict(found.theta, shift, warmer)
    rows[:, len(sensor.noise) :] = np.nan
    _, slope, _ = _decoding_slopes(sensor, found.theta, shift, sensor.weights(rows), warmer, zeroed=False)
    covariance = found.covariance[np.ix_(free, free)]
    draws = rng.multivariate_normal(np.zeros(len(free)), covariance, count, method="eigh")
    return np.asarray(np.einsum("nfp,sp->snf", slope, draws))


def relaxing_half_width(half: Array, slow: Array, force: Array, law_error: Array) -> Array:
    """Return half of the intervals (n, 3) of forces (n, 3) of a silicone that relaxes, from those of the slow ones.

    They are proportional to the force, which follows linearly from the slow one, and do not fall below those of
    slow loading; what another law would change (n,), N, is independent of them.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.linalg.norm(force, axis=1) / np.linalg.norm(slow, axis=1)
    return np.asarray(np.hypot(half * np.fmax(ratio, 1.0)[:, None], law_error[:, None]))


def poses_of(sensor: Sensor, load: Array) -> tuple[Array, Array, Array]:
    """Return shifts (n, 3), tilts (n, 2) and forces (n, 3) of the nominal sensor under loads (n, 3) of the plate, mm.

    They are NaN for a load that is no equilibrium of the mechanics' samples.
    """
    theta = sensor.unknowns.mean.copy()
    measured = np.hstack([np.full((len(load), len(sensor.noise) + 3), np.nan), load])
    for name in ("stand_zero", "stand_compliance"):
        if name in sensor.unknowns.names:
            theta[sensor.unknowns.names.index(name)] = 0.0
    W, warmer = sensor.weights(measured), np.zeros(len(load))
    # below a nanometre is rounding
    shift = np.round(settle_shifts(sensor, theta, sensor.starts(theta, measured), measured, W, warmer), 6)
    force, reached, _ = force_and_load(sensor.mechanics, np.ascontiguousarray(shift.T), contact=False)
    low, high = workspace(sensor.design, sensor.mechanics)
    slack = 1e-3 * sensor.design.D
    lost = ((shift < low - slack) | (shift > high + slack)).any(axis=1) | (np.abs(reached.T - load) > slack).any(
        axis=1
    )
    tilt = rotation(sensor.mechanics.tilt, np.ascontiguousarray(shift.T))
    shift[lost] = np.nan
    return shift, tilt.T, force.T


def force_variances(found: Fit, covariances: Sequence[Array], shift: Array) -> list[float]:
    """Return the mean variance of the force that readings at shifts (n, 3) give, N^2, for each covariance."""
    warmer = np.zeros(len(shift))
    readings = found.sensor.predict(found.theta, shift, warmer)[:, : len(found.sensor.noise)]
    decoded = decode_with(found, covariances, readings, warmer)
    return [float(np.nanmean(np.square(each.half_width / QUANTILE))) for each in decoded]


def next_press(found: Fit, candidates: Array) -> tuple[Array, float, float]:
    """Return the shift (3,) among candidates (n, 3) whose row, with readings and force, would help most.

    Returns
    -------
    shift, and the root of the mean variance of forces over the candidates, N, now and after it.
    """
    sensor, theta, un = found.sensor, found.theta, found.sensor.unknowns
    warmer = np.zeros(len(candidates))
    ideal = sensor.predict(theta, candidates, warmer)
    ideal[:, len(sensor.noise) + 3 :] = np.nan
    r, Js, Jt = linearised(sensor, theta, candidates, ideal, sensor.weights(ideal), warmer)
    now = np.linalg.inv(found.covariance[np.ix_(un.free, un.free)])
    prior = np.diag(1 / un.deviation[un.free] ** 2)
    covariances = [found.covariance]
    for k in range(len(candidates)):
        rows = slice(k, k + 1)
        added = condensed(r[rows], Js[rows], Jt[rows], un, theta)[0] - prior
        covariances.append(np.zeros_like(found.covariance))
        covariances[-1][np.ix_(un.free, un.free)] = np.linalg.inv(now + added / found.growth)
    before, *after = np.nan_to_num(force_variances(found, covariances, candidates), nan=math.inf).tolist()
    best = int(np.argmin(after))
    return candidates[best], math.sqrt(before), math.sqrt(after[best])
