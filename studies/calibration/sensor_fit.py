"""A made sensor estimated from bench rows: maximum a posteriori, its covariance, and the decoder that follows.

The magnet's shift s (3,) in each row is unknown too. With the polynomials of `analytic.inverse.response_surface` for
the nominal design (tau, k, n, d, g), the unknowns of the sensor and dT = T - T_0, a row has

    field at element i  B_i = b (1 + a dT) B(s + R(tilt) o, tilt + t) . n_i + (ambient field) . n_i
    reading             null_i + z_i + gain_i g_i (1 + c dT) B_i
    force on the tip    m (1 + h (s_z / s_z,max - 1/2)) (f k(s) s_x, f k(s) s_y, (1 + p U / U_max) n(s))
    depth, shear        d(s) + stand_zero + stand_compliance F_z,   g(s) (s_x, s_y)

with U = s_x^2 + s_y^2, factors m of the modulus, b of the polarisation and g_i of the gains, offset o and tilt t of
the magnet in the silicone, its larger diameter and height, offsets z_i of the elements, and their places, which shift
the field's argument the other way. What the made sensor's law, nu and sizes change in the mechanics is small and
smooth: a stiffening h with the depth, a factor f of the forces sideways, a change p of the press force by a shift
aside, and a factor l (1 + q (s_z / s_z,max - 1/2)) of the lean tau.

All unknowns have normal priors about the nominal sensor, whose standard
deviations follow from tolerances (`studies.parts.part_tolerances`): half of the largest deviation of a normal
one, 1/sqrt(3) of that of a uniform one.

What is measured has independent normal errors of known size. Gauss-Newton steps minimise the squared errors over
their variances, with the priors'; each row's shift is eliminated from the equations (Schur complement), so a step
costs a system of the size of the unknowns. Their covariance is the inverse of this system. Where the residuals exceed
the stated errors, the variances of all that was measured grow by chi^2 over its degrees of freedom (Birge, Phys. Rev.
40, 1932), until they fit; those of the priors stay, so that rows never make a sensor less known than it was.

Limits: forces are those of one branch of the mechanics, without hysteresis; what moves the magnet in the silicone
does not change the mechanics; a factor of the polarisation is the one at the working point, below that of the data
sheet for flat magnets. Lengths mm, angles rad, N, T.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from analytic import parts
from analytic.inverse.forward_model import rotation
from analytic.inverse.response_surface import Mechanics, force_and_load, workspace
from geometry.arrays import Array, Ints
from geometry.design import LEAST_WALL, BadInput, Design
from studies.calibration.bench_file import FORCES, MOTIONS, Bench
from studies.parts.part_tolerances import Tolerances, standard_deviation
from studies.sensing.decode_readings import QUANTILE
from studies.sensitivity.made_sensors import MadeSensors, made_readings

STEPS, LARGEST_STEP, SETTLED = 40, 0.05, 1e-7
"""Most Gauss-Newton steps; longest change of a shift in one, over D; relative fall of the sum at which they end."""
NOISE_ROUNDS, SAME_NOISE, LEAST_NOISE = 6, 0.05, 0.2
"""Most rounds in which the error of the forces is estimated; relative change that ends them; least error at rest over
that of all rows, since no row may count without limit."""
FEWEST_RESIDUALS = 3.0
"""Least sum of the freedom of residuals of forces that tells their error, two numbers; the freedom of one is 1 where
shift and unknowns take up nothing of it."""
TELLING = 0.99
"""Standard deviation of an unknown over that of its prior from which rows say too little to contradict it."""
GROWTH_ROUNDS, SAME_GROWTH = 6, 0.02
"""Most rounds in which the growth of the variances is estimated; relative change that ends them."""
SHARES = (1.0, 0.1, 0.01)
"""Shares of what priors leave unknown of each prediction, by which errors are wider at first."""
MOST_DAMPED = 1e3
"""Damping at which a row that still finds no better shift is at its best one."""
GRID, FEW_SHIFTS = (9, 9, 12), 40
"""Shifts along x, y and z among which each row starts, and number of them at which the effect of priors is taken."""
AMBIENT, STAND_ZERO, STAND_COMPLIANCE = 5e-5, 0.3, 0.01
"""Standard deviations of priors: ambient field (T, as the earth's), zero (mm) and compliance (mm/N) of the stand."""
FARTHEST = 30.0
"""Largest distance of a fixed value from its prior, in standard deviations."""
MOST_WIDER = 0.25
"""Largest deviation of a magnet's size over the size, where the silicone around it does not end before: a fit on its
way must not leave what can be a magnet."""
MOST_POSES = 20_000
"""Most shifts that are predicted at once, which takes some 20 MB."""
MECHANICS = 0.03
"""The same of what is unknown of the mechanics beside the modulus: stiffening, change of the press force aside, and
factors of lateral force and lean. Made sensors of another law, nu and magnet differ by some percent (`magtip validate
calibration`)."""
LEAN_DEEPER = 0.1
"""The same of the change of the lean over all depths: the surrogate's lean errs by up to 4 %, in light presses mostly
to the other side than in deep ones (three of five winners of `magtip size`)."""
WARMING = {"remanence_per_K": (-1.1e-3, 2e-4), "gain_per_K": (0.0, 5e-4)}
"""Priors of temperature coefficients, 1/K: NdFeB loses 0.09 to 0.13 % of its remanence per K."""


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Unknowns of a made sensor, with normal priors.

    Attributes
    ----------
    names, units : of the p unknowns.
    mean, deviation : (p,) of their priors; a deviation of 0 fixes the value.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    mean: Array
    deviation: Array

    @property
    def free(self) -> Ints:
        """Indices of the unknowns that are not fixed."""
        return np.flatnonzero(self.deviation > 0)


def place_of(reading: str) -> str:
    """Return the name of the part that has a reading.

    >>> place_of("S1"), place_of("chip2_-z")
    ('S1', 'chip2')
    """
    return reading.partition("_")[0]


def unknowns_of(
    design: Design,
    bench: Bench,
    made: Tolerances,
    *,
    freed: Sequence[str] = (),
    fixed: Mapping[str, float] = {},
    model_error: float = 0.0,
    stray: Array | float = 0.0,
) -> Unknowns:
    """Return the unknowns that a bench can have, with their priors.

    Parameters
    ----------
    freed : names whose prior is ten times as wide.
    fixed : values of unknowns that are not estimated.
    model_error : relative standard deviation of the model's forces.
    stray : standard deviations (k,) of what is constant in the readings beside the nulls, such as the field of
        neighbours at rest, in the elements' unit.
    """
    part, unit = ("hall", "V") if design.hall_layout == "three" else ("chip", "T")

    def sigma(name: str) -> float:  # in percent where the tolerance is
        return standard_deviation(name, made[name])

    rows = [
        ("modulus", "1", 1.0, math.hypot(sigma("E") / 100, model_error)),
        ("stiffening", "1", 0.0, MECHANICS),
        ("sideways", "1", 1.0, MECHANICS),
        ("press_aside", "1", 0.0, MECHANICS),
        ("lean", "1", 1.0, MECHANICS),
        ("lean_deeper", "1", 0.0, LEAN_DEEPER),
        ("remanence", "1", 1.0, sigma("remanence") / 100),
        *((f"wider_{name}", "mm", 0.0, sigma(f"magnet_{name}")) for name in ("diameter", "height")),
        *((f"magnet_{axis}", "mm", 0.0, sigma(f"magnet_{axis}")) for axis in "xyz"),
        *((f"tilt_{axis}", "rad", 0.0, math.radians(sigma("magnet_tilt"))) for axis in "xy"),
        *((f"gain_{name}", "1", 1.0, sigma(f"{part}_gain") / 100) for name in bench.readings),
        *(
            (f"null_{name}", unit, 0.0, math.hypot(sigma(f"{part}_null"), more))
            for name, more in zip(bench.readings, np.broadcast_to(stray, len(bench.readings)).tolist(), strict=True)
        ),
        *((f"ambient_{axis}", "T", 0.0, AMBIENT) for axis in "xyz"),
    ]
    # the axes of a chip are at one place; even of one chip it is not as if the magnet were displaced, whose offset
    # turns with the silicone: by micrometres at a lean of 0.1, which the readings resolve
    places = itertools.product(dict.fromkeys(map(place_of, bench.readings)), "xyz")
    rows += [(f"place_{name}_{axis}", "mm", 0.0, sigma(f"hall_{axis}")) for name, axis in places]
    if np.isfinite(bench.values(["depth_mm"])).any():
        rows += [("stand_zero", "mm", 0.0, STAND_ZERO), ("stand_compliance", "mm/N", 0.0, STAND_COMPLIANCE)]
    if "temperature_C" in bench.table:
        rows += [(name, "1/K", *prior) for name, prior in WARMING.items()]
    names, units, mean, deviation = zip(*rows, strict=True)
    for name in (*freed, *fixed):
        if name not in names:
            raise BadInput(f"there is no unknown {name!r}: choose one of {', '.join(names)}")
    if both := sorted({*freed} & {*fixed}):
        raise BadInput(f"{both[0]} is both in --free and in --fix: choose one")
    for name, value in fixed.items():
        k = names.index(name)
        if not abs(value - mean[k]) <= FARTHEST * (deviation[k] or 1.0):
            usual = f"{mean[k]:g} +- {deviation[k]:.2g} {units[k]}"
            raise BadInput(f"--fix {name}={value:g} is far from what a made sensor has, {usual}: check its value")
    means, wide = np.array(mean), np.array(deviation)
    for k, name in enumerate(names):
        wide[k] *= 0.0 if name in fixed else 10.0 if name in freed else 1.0
        means[k] = fixed.get(name, means[k])
    return Unknowns(names, units, means, wide)


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """What predicts bench rows: the nominal design, its mechanics, and errors of what is measured.

    Attributes
    ----------
    noise : (k,) standard deviations of the readings, in the elements' unit.
    force_noise, motion_noise : of forces at rest, N, and of depth and shears, mm.
    force_share : standard deviation of a force's component over the component, which adds to it: hysteresis, and what
        the mechanics miss.
    """

    design: Design
    mechanics: Mechanics
    unknowns: Unknowns
    noise: Array
    force_noise: float
    motion_noise: float = 0.02
    force_share: float = 0.0

    @property
    def temperature_C(self) -> float:
        """T_0 of the nominal sensor, C."""
        return self.design.temperature

    def value(self, theta: Array, name: str) -> Array:
        """Return an unknown of theta (..., p), or what it is where the bench has none."""
        names = self.unknowns.names
        return np.asarray(theta[..., names.index(name)]) if name in names else np.zeros(theta.shape[:-1])

    def vector(self, theta: Array, stem: str, ends: Sequence[str]) -> Array:
        return np.stack([self.value(theta, f"{stem}_{end}") for end in ends], axis=-1)

    def predict(self, theta: Array, shift: Array, warmer: Array) -> Array:
        """Return readings, forces and motions (n, k + 6) at shifts (n, 3), for dT (n,)."""
        return np.asarray(self.predict_all(theta[None], shift[None], warmer)[0])

    def predict_all(self, theta: Array, shift: Array, warmer: Array) -> Array:
        """Return readings, forces and motions (m, n, k + 6) of m sensors (m, p) at shifts (m, n, 3) of each."""
        count, rows, _ = shift.shape
        if count > 1 and count * rows > MOST_POSES:
            each = zip(theta, shift, strict=True)
            return np.stack([self.predict(own, at, warmer) for own, at in each])

        flat = shift.reshape(-1, 3).T
        force, load = (
            each.T.reshape(shift.shape) for each in force_and_load(self.mechanics, flat, contact=False)[:2]
        )
        tilt = rotation(self.mechanics.tilt, flat).T.reshape(count, rows, 2)
        reading, force = self.answers_all(theta, shift, tilt, force, warmer)
        zero, compliance = (self.value(theta, f"stand_{name}")[:, None] for name in ("zero", "compliance"))
        depth = load[..., 0] + zero + compliance * force[..., 2]
        return np.concatenate([reading, force, depth[..., None], load[..., 1:]], axis=-1)

    def answers_all(
        self, theta: Array, shift: Array, tilt: Array, force: Array, warmer: Array
    ) -> tuple[Array, Array]:
        """Return readings (m, n, k) and forces (m, n, 3) of m sensors (m, p) where the nominal one has these.

        Parameters
        ----------
        shift, tilt, force : of the nominal sensor (m, n, 3), (m, n, 2) and (m, n, 3), from any source.
        """

        def value(name: str) -> Array:
            return self.value(theta, name)[:, None]

        elements = parts.of_design(self.design)
        names = parts.columns(elements)
        share = -shift[..., 2] / self.mechanics.sink - 0.5
        lean = value("lean") * (1 + value("lean_deeper") * share)
        B = made_readings(self.made(theta, names), shift, lean[..., None] * tilt).field_T
        B = B * (value("remanence") * (1 + value("remanence_per_K") * warmer))[..., None]
        directions = np.array([element.direction for element in elements])
        B = B + (self.vector(theta, "ambient", "xyz") @ directions.T)[:, None]
        gain = self.vector(theta, "gain", names) * np.array([element.gain for element in elements])
        null = self.vector(theta, "null", names) + np.array([element.null for element in elements])
        reading = null[:, None] + gain[:, None] * B * (1 + value("gain_per_K") * warmer)[..., None]
        scale, sideways = value("modulus") * (1 + value("stiffening") * share), value("sideways")
        aside = np.square(shift[..., :2]).sum(axis=-1) / self.mechanics.reach**2
        sideways, press = np.broadcast_arrays(sideways, 1 + value("press_aside") * aside)
        return reading, scale[..., None] * force * np.stack([sideways, sideways, press], axis=-1)

    def made(self, theta: Array, names: Sequence[str]) -> MadeSensors:
        """Return sensors (m, p) with their displaced parts and their magnets; gains and nulls stay nominal."""
        count, design = len(theta), self.design
        size = np.array([design.magnet_diameter, design.magnet_height])
        most = np.minimum(MOST_WIDER * size, design.shape.wall - LEAST_WALL)
        wider = np.clip(self.vector(theta, "wider", ("diameter", "height")), -most, most)
        sizes = list(map(tuple, (wider + size).tolist()))
        # only the field is that of another magnet
        designs = {
            size: dataclasses.replace(design, magnet_diameter=size[0], magnet_height=size[1]) for size in {*sizes}
        }
        return MadeSensors(
            nominal=design,
            designs=tuple(designs[size] for size in sizes),
            refusals=("",) * count,
            fields={},
            magnet_offset=self.vector(theta, "magnet", "xyz"),
            magnet_tilt=self.vector(theta, "tilt", "xy"),
            element_offset=np.stack([self.vector(theta, f"place_{place_of(name)}", "xyz") for name in names], axis=1),
            gain_factor=np.ones((count, len(names))),
            null_shift=np.zeros((count, len(names))),
        )

    def weights(self, measured: Array) -> Array:
        """Return one over the standard deviation of what was measured (n, k + 6), 0 where nothing was."""
        count, k = len(measured), len(self.noise)
        of_force = self.force_errors(measured[:, k : k + 3])
        each = np.tile(self.noise, (count, 1)), of_force, np.full((count, 3), self.motion_noise)
        return np.where(np.isfinite(measured), 1 / np.hstack(each), 0.0)

    def force_errors(self, force: Array) -> Array:
        """Return the standard deviations (n, 3), N, of measured forces (n, 3)."""
        return np.asarray(np.hypot(self.force_noise, self.force_share * np.nan_to_num(force)))

    def starts(self, theta: Array, measured: Array) -> Array:
        """Return shifts (n, 3) near those of rows, from a grid over the workspace: the one that predicts best.

        What is measured counts with its error and with that which priors leave in its prediction.
        """
        grid, found, left = _start_grid(self, tuple(theta.tolist()))
        errors = np.concatenate([self.noise, np.repeat([self.force_noise, self.motion_noise], 3)])
        scale = np.hypot(left, errors)
        known, shift = np.isfinite(measured), np.zeros((len(measured), 3))
        for pattern in np.unique(known, axis=0):
            if not pattern.any():
                continue
            rows = (known == pattern).all(axis=1)
            tree = cKDTree((found / scale)[:, pattern])
            shift[rows] = grid[tree.query((measured[rows] / scale)[:, pattern])[1]]
        return shift


@functools.lru_cache(maxsize=4)
def _start_grid(sensor: Sensor, theta: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """Return shifts (n, 3) over the workspace, what a sensor predicts there (n, k + 6), and the standard deviations
    (k + 6,) of this by the priors of its unknowns, root mean square over these shifts.

    Corners of the workspace, farther sideways than all samples of the mechanics, are left out: polynomials may have
    the forces of other shifts there.
    """
    low, high = workspace(sensor.design, sensor.mechanics)
    # 0 sideways and at rest are points of the grid
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, [*high[:2], 0.0], GRID, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.hypot(grid[:, 0], grid[:, 1]) <= (1 + 1e-9) * high[0]]
    found = sensor.predict(np.array(theta), grid, np.zeros(len(grid)))
    defined = np.isfinite(found).all(axis=1)  # not so inside an element
    grid, found = grid[defined], found[defined]
    free, few = sensor.unknowns.free, grid[:: max(len(grid) // FEW_SHIFTS, 1)]
    _, _, by_theta = slopes_of(sensor, np.array(theta), few, np.zeros(len(few)), free)
    spread = np.square(by_theta * sensor.unknowns.deviation[free]).sum(axis=2)
    return grid, found, np.sqrt(spread.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """An estimated sensor.

    Attributes
    ----------
    sensor : what it was fitted with.
    theta, covariance : (p,) values of the unknowns, and their covariance (p, p), with `growth`.
    shift : (n, 3) the magnet's shift in each row.
    residual : (n, k + 6) measured less predicted, over the standard deviation; NaN where nothing was measured.
    chi2, freedom : sum of the squared residuals, and its mean for the stated errors: the number of what was measured
        less three shifts in each row, and less tr(C S) that the unknowns take up, where S is the rows' part of the
        system whose inverse is C.
    rejects_ambient : whether readings are decoded with a uniform field as three more unknowns, beside that of the
        bench.
    """

    sensor: Sensor
    theta: Array
    covariance: Array
    shift: Array
    residual: Array
    chi2: float
    freedom: float
    rejects_ambient: bool = False

    @property
    def growth(self) -> float:
        """Factor of the variances of what was measured: chi^2 over its degrees of freedom, at least 1."""
        return max(1.0, self.chi2 / max(self.freedom, 1.0))

    @property
    def deviation(self) -> Array:
        """Standard deviations (p,) of the unknowns."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def design(self) -> Design:
        """The nominal design with the estimated modulus and remanence."""
        E, remanence = (float(self.sensor.value(self.theta, name)) for name in ("modulus", "remanence"))
        nominal = self.sensor.design
        return dataclasses.replace(nominal, E=nominal.E * E, remanence=nominal.remanence * remanence)

    def answers(self, E: float, shift: Array, tilt: Array, force: Array) -> tuple[Array, Array, Array, Array]:
        """Return what the estimated sensor reads and feels where one of its design has these poses and forces.

        Parameters
        ----------
        E : modulus of the design at its temperature, MPa, to which its forces are proportional.
        shift, tilt, force : (n, 3), (n, 2) and (n, 3), such as those of finite elements.

        Returns
        -------
        readings (n, k), in the elements' unit, half of their 90 % intervals, forces (n, 3), and half of theirs.
        """
        sensor, free = self.sensor, self.sensor.unknowns.free
        thetas, steps = _moved(sensor, self.theta, free)
        warmer, force = np.zeros(len(shift)), force * (sensor.design.E_now / E)
        s, t, F = (np.repeat(each[None], len(thetas), axis=0) for each in (shift, tilt, force))
        both = np.concatenate(sensor.answers_all(thetas, s, t, F, warmer), axis=2)
        slope = np.moveaxis((both[1:] - both[0]) / steps[:, None, None], 0, -1)
        variance = np.einsum("nmp,pq,nmq->nm", slope, self.covariance[np.ix_(free, free)], slope)
        k, half = len(sensor.noise), QUANTILE * np.sqrt(variance)
        return both[0, :, :k], half[:, :k], both[0, :, k:], half[:, k:]

    def surprise(self) -> Array:
        """Return by how much the rows contradict each prior (p,), in standard deviations; 0 where they say nothing.

        It is the distance of the prior's mean from what the rows and all other priors say, over this distance's
        standard deviation, and equals (theta - mean) / sqrt(variance of the prior - variance of theta).
        """
        un = self.sensor.unknowns
        gained = np.square(un.deviation) - np.square(self.deviation)
        told = self.deviation < TELLING * un.deviation
        return np.where(told, (self.theta - un.mean) / np.sqrt(np.where(told, gained, 1.0)), 0.0)

    def correlation(self) -> Array:
        """Return the correlations (p, p); 0 for unknowns that are fixed."""
        size = np.where(self.deviation > 0, self.deviation, 1.0)
        return np.asarray(self.covariance / np.outer(size, size))


def measured_of(bench: Bench) -> Array:
    """Return readings, forces and motions (n, k + 6) of a bench, NaN for what was not measured."""
    return bench.values([*bench.readings, *FORCES, *MOTIONS])


def warmer_of(sensor: Sensor, bench: Bench) -> Array:
    """Return T - T_0 of all rows (n,); 0 where it was not measured."""
    return np.nan_to_num(bench.values(["temperature_C"])[:, 0] - sensor.temperature_C)


def fit(sensor: Sensor, measured: Array, warmer: Array) -> Fit:
    """Estimate the sensor from rows (n, k + 6).

    Errors fall to the stated ones from those with which the priors explain the rows: else exact readings of a sensor
    far from its priors hold shifts in wrong places. Where the residuals exceed the stated errors, the variances grow
    until they fit.
    """
    un, W, growth = sensor.unknowns, sensor.weights(measured), 1.0
    prior = np.diag(1 / un.deviation[un.free] ** 2)
    theta, shift = un.mean.copy(), _settled_at_priors(sensor, measured, W, warmer)
    for share in SHARES:
        theta, shift, _ = _minimised(sensor, theta, shift, measured, _weights_with(sensor, W, share), warmer)
    for _ in range(GROWTH_ROUNDS):
        theta, shift, _ = _minimised(sensor, theta, shift, measured, W / math.sqrt(growth), warmer)
        r, Js, Jt = linearised(sensor, theta, shift, measured, W, warmer)
        of_rows = (condensed(r, Js, Jt, un, theta)[0] - prior) / growth
        inverse = np.linalg.inv(of_rows + prior)
        # numbers beyond the shifts, less those that the unknowns take up
        freedom = int((W > 0).sum()) - 3 * len(measured) - float(np.einsum("pq,qp->", inverse, of_rows))
        covariance = np.zeros((len(theta), len(theta)))
        covariance[np.ix_(un.free, un.free)] = inverse
        residual = np.where(W > 0, r, np.nan)
        found = Fit(sensor, theta, covariance, shift, residual, float(np.square(r).sum()), freedom)
        if abs(found.growth / growth - 1) < SAME_GROWTH:
            break
        growth = found.growth
    return found


def misfit(sensor: Sensor, measured: Array, warmer: Array, steps: int) -> float:
    """Return the least squared errors of rows (n, k + 6) and unknowns over their variances, after some steps."""
    W = sensor.weights(measured)
    shift = _settled_at_priors(sensor, measured, W, warmer, steps)
    return _minimised(sensor, sensor.unknowns.mean.copy(), shift, measured, W, warmer, steps)[2]


def _settled_at_priors(sensor: Sensor, measured: Array, W: Array, warmer: Array, steps: int = STEPS) -> Array:
    theta = sensor.unknowns.mean
    known = _weights_with(sensor, W, 1.0)
    return settle_shifts(sensor, theta, sensor.starts(theta, measured), measured, known, warmer, steps)


def _weights_with(sensor: Sensor, W: Array, share: float) -> Array:
    """Return weights (n, k + 6) of errors to which a share of what the priors leave unknown is added."""
    _, _, left = _start_grid(sensor, tuple(sensor.unknowns.mean.tolist()))
    return np.where(W > 0, 1 / np.hypot(1 / np.where(W > 0, W, 1.0), share * left), 0.0)


def _minimised(
    sensor: Sensor, theta: Array, shift: Array, measured: Array, W: Array, warmer: Array, steps: int = STEPS
) -> tuple[Array, Array, float]:
    """Return unknowns, shifts and squared errors after Gauss-Newton steps that are damped where these rise."""
    un = sensor.unknowns
    free = un.free
    total, lever = _total(sensor, theta, shift, measured, W, warmer), 1e-3
    for _ in range(steps):
        r, Js, Jt = linearised(sensor, theta, shift, measured, W, warmer)
        S, g, A, B, gs = condensed(r, Js, Jt, un, theta)
        while True:
            step = np.linalg.solve(S + lever * np.diag(np.diag(S)), g)
            along = np.linalg.solve(A, (gs - np.einsum("nip,p->ni", B, step))[..., None])[..., 0]
            along *= np.minimum(1.0, LARGEST_STEP * sensor.design.D / np.maximum(np.abs(along).max(axis=1), 1e-12))[
                :, None
            ]
            trial = theta.copy()
            trial[free] += step
            after = _total(sensor, trial, shift + along, measured, W, warmer)
            if after <= total or lever > 1e6:
                break
            lever *= 10
        if not after <= total:
            break
        fall, theta, shift, total, lever = total - after, trial, shift + along, after, max(lever / 10, 1e-9)
        if fall <= SETTLED * max(total, 1.0):
            break
    return theta, shift, total


def fit_with_noise(sensor: Sensor, measured: Array, warmer: Array) -> Fit:
    """Estimate the sensor, and the standard deviations of forces and motions from its residuals.

    Three numbers of a row determine its shift, and the readings are the most exact ones: what is left is the error of
    the measured forces, that of the mechanics included. It is a constant and a share of the force, whose squares
    follow from a regression of the squared residuals. Where forces are more exact than readings, their residuals tell
    nothing, and the error that the sensor came with stays.
    """
    k, given = len(sensor.noise), sensor
    for _ in range(NOISE_ROUNDS):
        found = fit(sensor, measured, warmer)
        before = sensor.force_errors(measured[:, k : k + 3])
        sensor, is_measured = _with_noise_of(found, measured, warmer)
        if not is_measured:
            sensor = dataclasses.replace(sensor, force_noise=given.force_noise, force_share=given.force_share)
            break
        after = sensor.force_errors(measured[:, k : k + 3])
        if np.abs(after / before - 1).max() < SAME_NOISE:
            break
    return fit(sensor, measured, warmer)


def _with_noise_of(found: Fit, measured: Array, warmer: Array) -> tuple[Sensor, bool]:
    """Return the sensor with the errors of forces and motions that the residuals of a fit say, and whether they tell
    those of forces."""
    from scipy.optimize import nnls

    sensor, theta, k = found.sensor, found.theta, len(found.sensor.noise)
    W = sensor.weights(measured)
    r, Js, Jt = linearised(sensor, theta, found.shift, measured, W, warmer)
    S, _, A, B, _ = condensed(r, Js, Jt, sensor.unknowns, theta)
    # residuals are smaller than errors, by what shift and unknowns take up
    left = Jt - Js @ np.linalg.solve(A, B)
    freedom = 1 - np.einsum("nmi,nim->nm", Js, np.linalg.solve(A, np.swapaxes(Js, 1, 2)))
    freedom -= np.einsum("nmp,pq,nmq->nm", left, np.linalg.inv(S), left)
    known = (W > 0) & (freedom > 0.1)
    known[:, :k] = False
    variance = np.square(r / np.where(known, W, 1.0)) / np.where(known, freedom, 1.0)
    motion, known[:, k + 3 :] = known[:, k + 3 :].copy(), False
    if motion.any():
        sensor = dataclasses.replace(sensor, motion_noise=float(np.sqrt(variance[:, k + 3 :][motion].mean())))
    if freedom[known].sum() < FEWEST_RESIDUALS:
        return sensor, False
    size, weight = np.square(measured[known]), np.sqrt(freedom[known]) * W[known] ** 2
    table = np.stack([np.ones_like(size), size], axis=1) * weight[:, None]
    constant, share = nnls(table, variance[known] * weight)[0]
    constant = max(constant, LEAST_NOISE**2 * float(np.average(variance[known], weights=freedom[known])))
    return dataclasses.replace(sensor, force_noise=math.sqrt(constant), force_share=math.sqrt(share)), True


def _total(sensor: Sensor, theta: Array, shift: Array, measured: Array, W: Array, warmer: Array) -> float:
    """Return the squared errors of rows over their variances, with those of the unknowns from their priors."""
    un, off = sensor.unknowns, np.nan_to_num(measured) - sensor.predict(theta, shift, warmer)
    total = np.square(W * off).sum() + np.square((theta - un.mean)[un.free] / un.deviation[un.free]).sum()
    # a shift inside an element or magnet has no field
    return float(total) if np.isfinite(total) else math.inf


def slopes_of(sensor: Sensor, theta: Array, shift: Array, warmer: Array, free: Ints) -> tuple[Array, Array, Array]:
    """Return predictions (n, m), and their slopes by the shifts (n, m, 3) and by free unknowns (n, m, f)."""
    h, (moved_thetas, d) = 1e-5 * sensor.design.D, _moved(sensor, theta, free)
    thetas = np.concatenate([np.tile(theta, (3, 1)), moved_thetas])
    shifts = np.repeat(shift[None], len(thetas), axis=0)
    shifts[1:4] += h * np.eye(3)[:, None]
    at, *moved = sensor.predict_all(thetas, shifts, warmer)
    slopes = (np.array(moved) - at) / np.concatenate([np.full(3, h), d])[:, None, None]
    slopes = np.ascontiguousarray(np.moveaxis(slopes, 0, -1))
    return at, slopes[..., :3], slopes[..., 3:]


def _moved(sensor: Sensor, theta: Array, free: Ints) -> tuple[Array, Array]:
    """Return theta, and as rows below it (1 + f, p) with one free unknown moved each, and by how much (f,)."""
    step = 1e-3 * sensor.unknowns.deviation[free]
    return np.concatenate([theta[None], theta + step[:, None] * np.eye(len(theta))[free]]), step


def linearised(
    sensor: Sensor, theta: Array, shift: Array, measured: Array, W: Array, warmer: Array
) -> tuple[Array, Array, Array]:
    """Return weighted residuals (n, m) and weighted slopes of the predictions by shifts (n, m, 3) and unknowns."""
    at, Js, Jt = slopes_of(sensor, theta, shift, warmer, sensor.unknowns.free)
    return W * (np.nan_to_num(measured) - at), W[..., None] * Js, W[..., None] * Jt


def condensed(r: Array, Js: Array, Jt: Array, un: Unknowns, theta: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return the system S step = g of the free unknowns, and A, B and right side of the rows' shifts."""
    A = np.einsum("nmi,nmj->nij", Js, Js)
    # a direction in which a row tells nothing keeps its shift
    A += 1e-9 * np.trace(A, axis1=1, axis2=2)[:, None, None] * np.eye(3) + 1e-12 * np.eye(3)
    B, gs = np.einsum("nmi,nmp->nip", Js, Jt), np.einsum("nmi,nm->ni", Js, r)
    prior = 1 / un.deviation[un.free] ** 2
    inner = np.linalg.solve(A, np.concatenate([B, gs[..., None]], axis=2))
    S = np.einsum("nmp,nmq->pq", Jt, Jt) - np.einsum("nip,niq->pq", B, inner[..., :-1]) + np.diag(prior)
    g = np.einsum("nmp,nm->p", Jt, r) - np.einsum("nip,ni->p", B, inner[..., -1])
    return S, g - prior * (theta - un.mean)[un.free], A, B, gs


def settle_shifts(
    sensor: Sensor, theta: Array, shift: Array, measured: Array, W: Array, warmer: Array, steps: int = STEPS
) -> Array:
    """Return the shifts (n, 3) that explain each row best, for given unknowns, from shifts near them."""
    most, none = LARGEST_STEP * sensor.design.D, np.zeros(0, dtype=np.int64)
    known = np.nan_to_num(measured)
    cost = np.square(W * (known - sensor.predict(theta, shift, warmer))).sum(axis=1)
    lever = np.full(len(shift), 1e-3)
    for _ in range(steps):
        at, J, _ = slopes_of(sensor, theta, shift, warmer, none)
        J = W[..., None] * J
        A = np.einsum("nmi,nmj->nij", J, J)
        damp = lever[:, None, None] * np.einsum("nii->n", A)[:, None, None] / 3 * np.eye(3) + 1e-12 * np.eye(3)
        step = np.linalg.solve(A + damp, np.einsum("nmi,nm->ni", J, W * (known - at))[..., None])[..., 0]
        step *= np.minimum(1.0, most / np.maximum(np.abs(step).max(axis=1), 1e-12))[:, None]
        after = np.square(W * (known - sensor.predict(theta, shift + step, warmer))).sum(axis=1)
        better = after < cost  # NaN is not better
        shift = np.where(better[:, None], shift + step, shift)
        lever = np.where(better, np.maximum(lever / 10, 1e-12), lever * 10)
        moving = better & (cost - after > SETTLED * np.maximum(cost, 1.0))
        cost = np.where(better, after, cost)
        if not moving.any() and (better | (lever > MOST_DAMPED)).all():
            break
    return shift
