"""Forces that readings of an estimated sensor give, with their 90 % intervals, and what rows would teach about it.

The decoder is that of `analytic.decode`, with the estimated elements, magnet and forces. An error of the unknowns
theta moves the shift s that explains the readings best, so that the decoded force changes by

    dF = (dF/dtheta - dF/ds A^-1 J' W dr/dtheta) dtheta,     A = J' W J,   J = dr/ds,

with readings r and their weights W, and by the readings' noise, with the variance dF/ds A^-1 dF/ds'. A temperature T
that is not known (NaN) is taken for T_0, and moves the force in the same way, by dr/dT times `UNKNOWN`. Where an
ambient field is rejected, readings and slopes count less what a uniform field explains
(`analytic.inverse.ambient_field`), and the field that is found is what it has beyond that of the bench. Polynomials
of the mechanics add half of their largest errors at the samples.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analytic import decode as decoding
from analytic import parts
from analytic.decode import Decoder, Status, decoder
from analytic.inverse import ambient_field
from analytic.inverse.forward_model import rotation
from analytic.inverse.response_surface import (
    Mechanics,
    force_and_load,
    shifts_of_forces,
    shifts_of_loads,
    workspace,
)
from geometry.arrays import Array
from studies.calibration.sensor_fit import Fit, Sensor, condensed, linearised, slopes_of
from studies.quantities import shown
from studies.sensing import decode_readings
from studies.sensing.decode_readings import QUANTILE

UNKNOWN = 20.0
"""Standard deviation of a temperature that is not known, K: 90 % of sensors in use are within 33 K of T_0."""
ANGLES = (0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0)
"""Directions of forces along the plate that are tried, deg: those that a person can set."""


@dataclass(frozen=True, slots=True, eq=False)
class DecodedForces:
    """Forces that readings give.

    Attributes
    ----------
    status : of each row, as in `analytic.decode`.
    force, half_width : (n, 3) N, and half of the 90 % interval; NaN without a force.
    shift : (n, 3) mm.
    load : (n, 3) depth and shears of the plate, mm.
    ambient : columns `decode_readings.AMBIENT_COLUMNS` (n, 6); (n, 0) where no field is rejected.
    """

    status: list[Status]
    force: Array
    half_width: Array
    shift: Array
    load: Array
    ambient: Array


@functools.lru_cache(maxsize=4)
def coder_of(found: Fit, *, warm: bool) -> Decoder:
    """Return the decoder of an estimated sensor, with its elements, its magnet and its forces, at T_0.

    The ambient field is in the nulls of the elements. A normal force counts as none where its interval says so.

    warm : whether the temperatures of the readings are known.
    """
    sensor, theta = found.sensor, found.theta
    nominal, _ = parts.with_noise(parts.of_design(sensor.design))
    names = parts.columns(nominal)
    made = sensor.made(theta[None], names)
    elements = []
    for element, name, place in zip(nominal, names, made.element_offset[0], strict=True):
        gain = element.gain * float(sensor.value(theta, f"gain_{name}"))
        null = element.null + float(sensor.value(theta, f"null_{name}") + gain * ambient_of(found)[name])
        x, y, z = (element.position + place).tolist()
        elements.append(dataclasses.replace(element, position=(x, y, z), gain=gain, null=null))
    magnet = made.designs[0]
    assert magnet is not None
    sizes = {name: getattr(magnet, name) for name in ("magnet_diameter", "magnet_height")}
    # beyond noise and error of the unknowns, more than three readings contradict each other
    at_rest = np.zeros((1, 3))
    unknown = found.answers(sensor.design.E_now, at_rest, at_rest[:, :2], at_rest)[1][0] / QUANTILE
    if not warm:
        unknown = np.hypot(
            unknown, UNKNOWN * _by_temperature(sensor, theta, at_rest, np.zeros(1))[0, : len(elements)]
        )
    gains = np.array([element.gain for element in elements])
    return decoder(
        dataclasses.replace(found.design, **sizes),
        mechanics_of(found),
        elements=elements,
        deviation=np.hypot(unknown, math.sqrt(found.growth) * sensor.noise) / np.abs(gains),
        mount=(made.magnet_offset[0], made.magnet_tilt[0]),
        reject_ambient=found.rejects_ambient,
    )


def mechanics_of(found: Fit) -> Mechanics:
    """Return the mechanics of an estimated sensor: its factors multiply the nominal polynomials."""
    law, sensor = found.sensor.mechanics, found.sensor

    def value(name: str) -> float:
        return float(sensor.value(found.theta, name))

    def deeper(c: Array, factor: float, change: float) -> Array:
        """Return factor (1 + change (s_z / s_z,max - 1/2)) times the polynomial c[i, j] of U^i w^j."""
        rest, slope = np.pad(c, ((0, 0), (0, 1))), np.pad(c, ((0, 0), (1, 0)))
        return np.asarray(factor * ((1 - change / 2) * rest - change / law.sink * slope))

    modulus, sideways, aside, lean = map(value, ("modulus", "sideways", "press_aside", "lean"))
    lateral, normal = (deeper(c, modulus, value("stiffening")) for c in (law.lateral, law.normal))
    normal = np.pad(normal, ((0, 1), (0, 0))) + aside / law.reach**2 * np.pad(normal, ((1, 0), (0, 0)))
    at_rest = intervals(found, [found.covariance], np.zeros((1, 3)), np.zeros(1))[0]
    tilt, lateral_force, normal_force, *of_plate = law.errors
    of_lean = [lean * end * (1 + way * value("lean_deeper") / 2) for end in law.lean for way in (-1, 1)]
    return dataclasses.replace(
        law,
        tau=deeper(law.tau, lean, value("lean_deeper")),
        lean=(min(of_lean), max(of_lean)),
        lateral=sideways * lateral,
        normal=normal,
        errors=(lean * tilt, modulus * sideways * lateral_force, modulus * normal_force, *of_plate),
        slack=float(at_rest[0, 2]),
    )


def ambient_of(found: Fit) -> dict[str, float]:
    """Return what the ambient field adds to B.n of each element, T."""
    elements, field = parts.of_design(found.sensor.design), found.sensor.vector(found.theta, "ambient", "xyz")
    return {name: float(field @ e.direction) for name, e in zip(parts.columns(elements), elements, strict=True)}


def fields_of(found: Fit, readings: Array, warmer: Array) -> Array:
    """Return the field of the magnet at T_0 that readings (n, k), in the elements' unit, say for dT (n,), in T."""
    warmer = np.nan_to_num(warmer)
    field = decoding.field_of(coder_of(found, warm=True).forward.elements, readings)
    ambient = np.array(list(ambient_of(found).values()))
    gain, remanence = (
        1 + found.sensor.value(found.theta, name) * warmer for name in ("gain_per_K", "remanence_per_K")
    )
    return np.asarray(((field + ambient) / gain[:, None] - ambient) / remanence[:, None])


def decode(found: Fit, readings: Array, warmer: Array, offset: Array | None = None) -> DecodedForces:
    """Decode readings (n, k), in the elements' unit, by an estimated sensor; their rails do not count.

    offset : (k,) of a zero, T, as `analytic.time_series.zero_offset` returns it.
    """
    coder = coder_of(found, warm=bool(np.isfinite(warmer).all()))
    nowhere = np.array([-math.inf, math.inf]) * np.ones((len(coder.sigma), 1))
    coder = dataclasses.replace(coder, goal=coder.goal._replace(rails=nowhere))
    fields = fields_of(found, readings, warmer) + (0.0 if offset is None else offset)
    answer = decoding.decode(coder, fields)
    half, known = np.full_like(answer.force, np.nan), np.isfinite(answer.force).all(axis=1)
    zeroed = offset is not None
    (half[known],) = intervals(found, [found.covariance], answer.shift[known], warmer[known], zeroed=zeroed)
    ambient = ambient_columns(found, fields, answer.shift, warmer, zeroed=zeroed)
    return DecodedForces(answer.status, answer.force, half, answer.shift, answer.load, ambient)


def ambient_columns(found: Fit, fields: Array, shift: Array, warmer: Array, *, zeroed: bool) -> Array:
    """Return `decode_readings.AMBIENT_COLUMNS` (n, 6) of fields of the magnet (n, k), T, and shifts (n, 3) decoded
    from them; (n, 0) where no field is rejected. Half widths are by the noise and by what is left unknown."""
    columns = decode_readings.ambient_columns(coder_of(found, warm=True), fields, shift)
    known = np.isfinite(shift[:, 2])
    if not columns.shape[1] or not known.any():
        return columns
    sensor, free, at, count = found.sensor, found.sensor.unknowns.free, shift[known], len(found.sensor.noise)
    fit, cold = _field_fit(found), np.nan_to_num(warmer[known])
    by_shift, moves, by_theta = _moves(found, at, cold, zeroed=zeroed)
    errors = fit @ (by_theta[:, :count] - by_shift[:, :count] @ moves)
    variance = np.einsum("nip,pq,niq->ni", errors[..., :-1], found.covariance[np.ix_(free, free)], errors[..., :-1])
    variance[np.isnan(warmer[known])] += np.square(UNKNOWN * errors[np.isnan(warmer[known]), :, -1])
    # a reading changes the field by itself, and by the pose that follows from it
    Js, noise = _weighted(found, by_shift[:, :count]), np.diag(sensor.noise)
    by_noise = fit @ (
        noise - by_shift[:, :count] @ np.linalg.solve(_normal(Js), Js.swapaxes(1, 2) @ _weighted(found, noise))
    )
    variance += found.growth * np.square(by_noise).sum(axis=2)
    columns[known, 3:] = 1e6 * QUANTILE * np.sqrt(variance)
    return columns


def intervals(
    found: Fit, covariances: Sequence[Array], shift: Array, warmer: Array, *, zeroed: bool = False
) -> list[Array]:
    """Return half of the 90 % intervals (n, 3) of forces that readings give at shifts (n, 3).

    covariances : (p, p) of the unknowns, one for each answer.
    warmer : T - T_0 (n,), NaN where the temperature is not known.
    zeroed : whether a zero moved the readings to those of the estimated sensor at rest, whose errors then fall out.
    """
    slope, noise, missed = _variances(found, shift, warmer, zeroed=zeroed)
    free = found.sensor.unknowns.free
    return [
        QUANTILE * np.sqrt(np.einsum("nfp,pq,nfq->nf", slope, own[np.ix_(free, free)], slope) + noise + missed)
        for own in covariances
    ]


def widths_beside_noise(found: Fit, shift: Array, *, zeroed: bool) -> Array:
    """Return half of the 90 % intervals (n, 3) of forces that readings give at shifts (n, 3) at T_0, without the
    stated noise of the readings and what the mechanics miss.

    Where readings tell a shift badly their noise is far larger than all else, and a difference of intervals is lost.
    """
    slope, noise, _ = _variances(found, shift, np.zeros(len(shift)), zeroed=zeroed)
    free = found.sensor.unknowns.free
    own = np.einsum("nfp,pq,nfq->nf", slope, found.covariance[np.ix_(free, free)], slope)
    return np.asarray(QUANTILE * np.sqrt(own + (1 - 1 / found.growth) * noise))


def variance_shares(found: Fit) -> dict[str, float]:
    """Return the shares of unknowns, noise and mechanics in the mean variance of a calibration's own forces."""
    slope, noise, missed = _variances(found, found.shift, np.zeros(len(found.shift)), zeroed=False)
    free = found.sensor.unknowns.free
    left = np.einsum("nfp,pq,nfq->nf", slope, found.covariance[np.ix_(free, free)], slope)
    mean = {"unknowns": left, "noise": noise, "mechanics": missed}
    whole = float(np.nanmean(left + noise + missed))
    return {name: float(np.nanmean(part)) / whole for name, part in mean.items()}


def _variances(found: Fit, shift: Array, warmer: Array, *, zeroed: bool) -> tuple[Array, Array, Array]:
    """Return, of forces that readings at shifts (n, 3) give, their slopes by free unknowns (n, 3, f), and variances
    (n, 3), N^2: by noise and an unknown temperature, and by what the mechanics miss."""
    cold, errors = np.isnan(warmer), found.sensor.mechanics.errors
    warmer = np.nan_to_num(warmer)
    slope, by_K, noise = _decoding_slopes(found, shift, warmer, zeroed=zeroed)
    noise = found.growth * noise
    noise[cold] += np.square(UNKNOWN * by_K[cold])
    missed = np.square(np.array([errors[1], errors[1], errors[2]]) / 2)
    return slope, noise, np.broadcast_to(missed, noise.shape)


def _decoding_slopes(found: Fit, shift: Array, warmer: Array, *, zeroed: bool) -> tuple[Array, Array, Array]:
    """Return, of the force that readings at shifts (n, 3) give: slopes by free unknowns (n, 3, f) and by the
    temperature (n, 3), N/K, and variances (n, 3) by the readings' noise."""
    count = len(found.sensor.noise)
    by_shift, moves, by_theta = _moves(found, shift, warmer, zeroed=zeroed)
    Js = _weighted(found, by_shift[:, :count])
    by_shift, by_theta = (each[:, count : count + 3] for each in (by_shift, by_theta))
    slope = by_theta - np.einsum("nfi,nip->nfp", by_shift, moves)
    return (
        slope[..., :-1],
        slope[..., -1],
        np.einsum("nfi,nij,nfj->nf", by_shift, np.linalg.inv(_normal(Js)), by_shift),
    )


def _moves(found: Fit, shift: Array, warmer: Array, *, zeroed: bool) -> tuple[Array, Array, Array]:
    """Return slopes of predictions by shifts (n, m, 3), of the decoded shift by free unknowns and the temperature
    (n, 3, f + 1), and of predictions by these (n, m, f + 1)."""
    sensor, theta, count = found.sensor, found.theta, len(found.sensor.noise)

    def slopes(at: Array) -> tuple[Array, Array]:
        _, by_shift, by_theta = slopes_of(sensor, theta, at, warmer, sensor.unknowns.free)
        return by_shift, np.concatenate([by_theta, _by_temperature(sensor, theta, at, warmer)[..., None]], axis=2)

    by_shift, by_theta = slopes(shift)
    if zeroed:
        by_theta[:, :count] -= slopes(np.zeros_like(shift))[1][:, :count]
    Js, Jt = (_weighted(found, each[:, :count]) for each in (by_shift, by_theta))
    return by_shift, np.linalg.solve(_normal(Js), np.einsum("nmi,nmp->nip", Js, Jt)), by_theta


def _normal(J: Array) -> Array:
    """Return J'J (n, 3, 3) of weighted slopes (n, k, 3)."""
    A = np.einsum("nmi,nmj->nij", J, J)
    return np.asarray(A + 1e-12 * (1 + np.trace(A, axis1=1, axis2=2))[:, None, None] * np.eye(3))


def _weighted(found: Fit, slopes: Array) -> Array:
    """Return slopes (..., k, p) of readings over their noise, without what a uniform field explains if one is
    rejected."""
    if found.rejects_ambient:
        by_field = _gains(found)[:, None] * ambient_field.directions(parts.of_design(found.sensor.design))
        slopes = slopes - by_field @ (_field_fit(found) @ slopes)
    return np.asarray(slopes / found.sensor.noise[:, None])


def _field_fit(found: Fit) -> Array:
    """Return (3, k) the uniform field, T, that fits misfits of readings in the elements' unit best."""
    gains = _gains(found)
    weights = np.abs(gains) / found.sensor.noise
    return ambient_field.field_fit(parts.of_design(found.sensor.design), weights / weights.max()) / gains


def _gains(found: Fit) -> Array:
    elements = parts.of_design(found.sensor.design)
    gain = found.sensor.vector(found.theta, "gain", parts.columns(elements))
    return np.asarray(gain * np.array([element.gain for element in elements]))


def _by_temperature(sensor: Sensor, theta: Array, shift: Array, warmer: Array) -> Array:
    """Return by how much predictions (n, k + 6) at shifts (n, 3) change with each K."""
    return sensor.predict(theta, shift, warmer + 1) - sensor.predict(theta, shift, warmer)


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
    free, warmer = found.sensor.unknowns.free, np.zeros(len(shift))
    slope, _, _ = _decoding_slopes(found, shift, warmer, zeroed=False)
    covariance = found.covariance[np.ix_(free, free)]
    draws = rng.multivariate_normal(np.zeros(len(free)), covariance, count, method="eigh")
    return np.asarray(np.einsum("nfp,sp->snf", slope, draws))


def relaxing_half_width(half: Array, slow: Array, force: Array, law_error: Array, most: float) -> Array:
    """Return half of the intervals (n, 3) of forces (n, 3) of a silicone that relaxes, from those of the slow ones.

    They are proportional to the force, which follows linearly from the slow one, but do not fall below those of slow
    loading, and grow `most` times at most, where little is left of a force; what another law would change (n,), N, is
    independent of them.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.linalg.norm(force, axis=1) / np.linalg.norm(slow, axis=1)
    grown = np.fmin(np.fmax(ratio, 1.0), max(most, 1.0))
    return np.asarray(np.hypot(half * grown[:, None], law_error[:, None]))


def zero_doubts(found: Fit, offset: Array, *, warm: bool) -> list[str]:
    """Return a sentence if a zero moves the readings (k,), T, farther than what a calibration leaves open at rest.

    warm : whether the temperatures of the readings are known.
    """
    coder = coder_of(found, warm=warm)
    # a uniform field is none of the sensor's doubts where it is rejected
    far = np.abs(coder.goal.free @ offset if found.rejects_ambient else offset) > coder.goal.tolerance
    said = [
        f"{element.name} by {shown(abs(moved), 'mT', 2)} ({shown(most, 'mT', 2)})"
        for element, moved, most, is_far in zip(
            coder.forward.elements, offset.tolist(), coder.goal.tolerance.tolist(), far.tolist(), strict=True
        )
        if is_far
    ]
    if not said:
        return []
    much = f"the zero moves {', '.join(said)}, more than the calibration leaves open at rest (in brackets)"
    return [f"{much}: was the sensor pressed then, or has it changed?"]


def poses_of(sensor: Sensor, load: Array) -> tuple[Array, Array, Array]:
    """Return shifts (n, 3), tilts (n, 2) and forces (n, 3) of the nominal sensor under loads (n, 3) of the plate, mm.

    They are NaN for a load that is no equilibrium of the mechanics' samples.
    """
    law, aside = sensor.mechanics, np.hypot(load[:, 1], load[:, 2])
    u, w = shifts_of_loads(law, *workspace(sensor.design, law), load[:, 0], aside)
    way = load[:, 1:] / np.where(aside > 0, aside, 1.0)[:, None]
    shift = np.column_stack([u[:, None] * way, w])
    flat = np.ascontiguousarray(shift.T)
    return shift, rotation(law.tilt, flat).T, force_and_load(law, flat, contact=False)[0].T


def force_variances(found: Fit, covariances: Sequence[Array], shift: Array) -> list[float]:
    """Return the mean variance of the force that readings at shifts (n, 3) give, N^2, for each covariance."""
    wide = intervals(found, covariances, shift, np.zeros(len(shift)))
    return [float(np.nanmean(np.square(each / QUANTILE))) for each in wide]


def poses_under(found: Fit, loads: Array, angles: Sequence[float] = ANGLES) -> tuple[Array, Array, Array]:
    """Return shifts (n, 3), mm, forces (n, 3), N, and angles (n,), deg, of an estimated sensor under forces.

    Shifts are NaN for forces that no equilibrium of the mechanics' samples has; an angle is NaN without a force along
    the plate.

    loads : normal force and force along the plate (k, 2), N; the latter in each of the directions `angles`, deg.
    """
    rows = [(z, x, a) for z, x in loads.tolist() for a in (angles if x else (math.nan,))]
    normal, aside, angle = np.array(rows).T
    law = mechanics_of(found)
    u, w = shifts_of_forces(law, *workspace(found.sensor.design, law), aside, normal)
    way = np.radians(np.nan_to_num(angle))
    # no rounding where one of them is 0
    c, s = np.cos(way).round(15), np.sin(way).round(15)
    return np.stack([u * c, u * s, w], axis=1), np.stack([aside * c, aside * s, normal], axis=1), angle


def next_press(found: Fit, candidates: Array, over: Array) -> tuple[int, float, float]:
    """Return which of the shifts (n, 3) is that of the press whose readings and force would help most.

    Returns
    -------
    its number, and the root of the mean variance of forces over the shifts `over` (m, 3), N, now and after it.
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
    before, *after = np.nan_to_num(force_variances(found, covariances, over), nan=math.inf).tolist()
    best = int(np.argmin(after))
    return best, math.sqrt(before), math.sqrt(after[best])
