"""Beams for training, for the calibration of intervals, and for testing, and their finite-element states.

A Gaussian process extrapolates badly. So training begins with the corners of the range, and the scrambled Sobol
points that follow are stretched beyond it and cut at its faces: two of three lie on a face. Later points fill the
gaps between the first ones. Beams of calibration and test are independent random points, the same number in each
region of the beams, so that no region's intervals rest on a handful of beams.

States are presses, first modes, critical depths and glued shears, from the store or solved. A shear begins at a depth
between `SHALLOWEST_SHEAR` and the deepest press, but before the tip would buckle sideways: beyond that depth an
equilibrium depends on the path. So presses come first, and tell each beam's critical depth. The finite elements have
an error of their own. Answers bring estimates of it for force, shift and tilt; for the other quantities it is taken
for the difference from the same state on the coarser mesh (`compared`).
"""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from fem.scene import Scene
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Load, Response
from studies.mechanics import prediction, surrogate_range
from studies.mechanics.path_solver import Answer
from studies.mechanics.prediction import first_zero
from studies.mechanics.solve_plan import Solver
from studies.mechanics.surrogate_range import DENSITY_RATIO, DIAMETER, EDGE, HEIGHT, LEAST_WALL, LENGTH, POISSON

DIAMETER_MM = 10.0
"""D of the designs that are solved; the answers hold for every D."""
DIGITS = 5
"""Digits of the lengths over D: a design file can repeat a beam exactly."""
DIMENSIONS = 6
STRETCH = 1.2
"""Factor by which Sobol points are stretched from the centre of the cube, before they are cut at its faces."""
SAFE = 0.95
"""Deepest shear over the critical depth."""
Beams = Any
"""Beams of the surrogate, a record array of shape (n,) with fields BEAM."""
BEAM = np.dtype([(name, float) for name in ("L", "diameter", "height", "nu", "edge", "share")])
"""Length and size of the magnet over D, Poisson's ratio, radius of the magnet's edges over the smaller side of its
section; where the depth of its shear lies between the least and the largest one, 0 to 1 in the root of the depth."""
States = Mapping[str, Array]
"""States of beams by names: depth and shear over D, forces over E D^2, lengths over D, tilt in rad, frequencies over
`frequency_unit`, arrays of shape (n, k), NaN where a solve failed; and, behind `_error`, the estimated errors of the
finite elements themselves, NaN or missing where they are unknown."""


def in_range(beams: Beams) -> NDArray[np.bool_]:
    return np.asarray(surrogate_range.below(beams.L, beams.height) >= surrogate_range.LEAST_BELOW)


def deepest(beams: Beams) -> Array:
    return np.asarray(surrogate_range.deepest(beams.L, beams.diameter, beams.height))


def density_ratio(beams: Beams) -> Array:
    """Return the density of the magnet over that of the silicone, for the natural frequencies.

    It follows the last coordinate, which matters to shears only otherwise.
    """
    low, high = DENSITY_RATIO
    return np.asarray(np.round(low + (high - low) * beams.share, DIGITS))


def design(beam: Any) -> Design:
    """Return a beam as a design of D = 10 mm and E = 1 MPa."""
    L, diameter, height, nu, edge = (
        round(float(value), DIGITS)
        for value in (beam.L, beam.diameter, beam.height, beam.nu, beam.edge * min(beam.diameter, beam.height))
    )
    magnet: dict[str, Any] = {"magnet_diameter": diameter, "magnet_height": height, "magnet_edge_radius": edge}
    D = DIAMETER_MM
    return Design(D=D, L=L * D, nu=nu, l0=10 * D, **{name: value * D for name, value in magnet.items()})


def training_beams(count: int, seed: int) -> Beams:
    """Return the first `count` beams of training; more beams keep the first ones."""
    points = qmc.Sobol(DIMENSIONS, rng=seed)
    return _filled(corners(), count, lambda: np.clip(0.5 + STRETCH * (points.random(1024) - 0.5), 0.0, 1.0))


def random_beams(count: int, seed: int) -> Beams:
    rng = np.random.default_rng(seed)
    return _filled(of_cube(np.empty((0, DIMENSIONS))), count, lambda: rng.random((1024, DIMENSIONS)))


def _filled(found: Beams, count: int, draw: Callable[[], Array]) -> Beams:
    """Return some beams and, up to `count`, those in the range of points of the unit cube that are drawn."""
    while len(found) < count:
        beams = of_cube(draw())
        found = joined(found, beams[in_range(beams)])
    return found[:count]


def corners() -> Beams:
    """Return the corners of the range of L, diameter, height and nu, each with two edges and depths of its shear.

    A magnet that is too high for its beam is as high as the walls allow.
    """
    unit = np.array(list(itertools.product((0.0, 1.0), repeat=5)))
    # the share changes with the parity of the others: half of the corners of the six dimensions; mixed, so that the
    # first few differ in all of them
    unit = np.random.default_rng(0).permutation(np.column_stack([unit, unit.sum(axis=1) % 2]))
    low, high = np.zeros(len(unit)), unit[:, 2].copy()

    def possible(height: Array) -> NDArray[np.bool_]:
        beams = _scaled(np.column_stack([unit[:, :2], height, unit[:, 3:]]))
        return np.asarray(_walled(beams) & in_range(beams))

    for _ in range(40):
        middle = (low + high) / 2
        fits = possible(middle)
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    height = np.where(possible(unit[:, 2]), unit[:, 2], low - 1e-4)
    return of_cube(np.column_stack([unit[:, :2], height, unit[:, 3:]]))


def regional_beams(count: int, seed: int) -> Beams:
    """Return `count` independent random beams of each region, region after region in turn; more keep the first."""
    many = random_beams(100 * count * prediction.REGIONS, seed)
    region = prediction.beam_region(many.L, many.diameter, many.height)
    rows = [np.flatnonzero(region == k)[:count] for k in range(prediction.REGIONS)]
    return many[np.stack(rows, axis=1).ravel()]


def of_cube(unit: Array) -> Beams:
    """Return the beams of points of the unit cube, shape (n, 6), without those whose magnet leaves too thin a wall.

    The length is spread on a log scale. Poisson's ratio is spread in (1 - 2 nu)^(1/2): most silicones are close to
    0.5, and the response changes with 1 - 2 nu.
    """
    beams = _scaled(unit)
    return beams[_walled(beams)]


def _scaled(unit: Array) -> Beams:
    low, high = LENGTH
    soft = 1 - 2 * POISSON[0]
    L = low * (high / low) ** unit[:, 0]
    d, h, edge = (a + (b - a) * unit[:, k] for k, (a, b) in ((1, DIAMETER), (2, HEIGHT), (4, EDGE)))
    nu = (1 - soft * unit[:, 3] ** 2) / 2
    L, d, h, nu, edge = (np.round(x, DIGITS) for x in (L, d, h, nu, edge))
    return np.rec.fromarrays([L, d, h, nu, edge, unit[:, 5]], dtype=BEAM)


def _walled(beams: Beams) -> NDArray[np.bool_]:
    return np.asarray(surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge) >= LEAST_WALL)


def joined(*parts: Beams) -> Beams:
    return np.concatenate(parts).view(np.recarray)


# States


def compared(states: States, coarse: States) -> States:
    """Return states with errors, where they have none, that are the differences from coarser ones."""
    return {f"{name}_error": np.abs(q - coarse[name]) for name, q in states.items() if name in coarse} | dict(states)


def motions(solver: Solver, beams: Beams, depth: Array, shear: Array | float = 0.0) -> States:
    depth, shear = np.broadcast_arrays(depth, shear)
    glued, D = bool(shear.any()), DIAMETER_MM
    scenes = []
    for beam, depths, shears in zip(beams, depth.tolist(), shear.tolist(), strict=True):
        loads = (
            Load(d * D, x * D, friction="stick" if glued else "none") for d, x in zip(depths, shears, strict=True)
        )
        scenes.append(Scene(design(beam), tuple(loads), solver.accuracy, model="harmonic" if glued else "auto"))
    return _states(depth, shear, solver.answers(scenes))


def critical_depths(solver: Solver, beams: Beams) -> States:
    """Return the critical depths over D, at most the deepest press of the surrogate; NaN where a search fails."""
    scenes = [Scene(design(beam), (Load(depth=1.0),), solver.accuracy) for beam in beams]
    found = []
    for (answer,), most in zip(solver.answers(scenes, "critical depth"), deepest(beams).tolist(), strict=True):
        depth = answer.values.get("critical_depth_over_D")
        if depth is None and answer.values.get("stable_to_over_D", 0.0) >= most - 1e-9:
            depth = most
        found.append(math.nan if depth is None else min(depth, most))
    return _single("depth", found)


def first_modes(solver: Solver, beams: Beams) -> States:
    scenes = []
    for beam, ratio in zip(beams, density_ratio(beams).tolist(), strict=True):
        one = design(beam)
        one = replace(one, magnet_density=ratio * one.density)
        scenes.append(Scene(one, (Load(depth=0.0),), solver.accuracy, model="axisymmetric"))
    lowest = [(answer.values.get("frequency") or [np.nan])[0] for (answer,) in solver.answers(scenes, "modes")]
    return _single("frequency", lowest)


def shear_depth(beams: Beams, press: States) -> Array:
    """Return the depth of each beam's shear, over D, shape (n,), above the depth at which its press buckles."""
    low = np.sqrt(surrogate_range.SHALLOWEST_SHEAR)
    critical = first_zero(press["depth"], np.nan_to_num(press["sideways_ratio"], nan=-1.0))
    most = np.minimum(deepest(beams), SAFE * critical)
    high = np.maximum(np.sqrt(most), low)
    return np.asarray(np.round((low + (high - low) * beams.share) ** 2, 5))


def _single(name: str, values: Sequence[float]) -> States:
    column = np.array(values, dtype=float)[:, None]
    return {"depth": np.zeros_like(column), "shear": np.zeros_like(column), name: column}


def _states(depth: Array, shear: Array, answers: Sequence[Sequence[Answer]]) -> States:
    """Return the quantities of answers, which are for D = DIAMETER_MM and E = 1 MPa, with the known errors."""
    D = DIAMETER_MM

    def table(read: Callable[[Answer, Response], Any]) -> Array:
        rows = [[np.nan if a.response is None else read(a, a.response) for a in row] for row in answers]
        return np.array(rows, dtype=float)

    quantities = {
        "force_x": 1 / D**2 * table(lambda _, r: r.force[0]),
        "force_z": 1 / D**2 * table(lambda _, r: r.force[2]),
        "shift_x": 1 / D * table(lambda _, r: r.shift[0]),
        "shift_z": 1 / D * table(lambda _, r: r.shift[2]),
        "tilt": table(lambda _, r: r.tilt),
        "contact_radius": 1 / D * table(lambda _, r: r.contact_radius),
        "strain": table(lambda a, _: a.values["largest_strain"]),
        "sideways_ratio": table(lambda a, _: a.values.get("sideways_stiffness_ratio")),
    }
    of_force, of_shift = (np.hypot(quantities[f"{name}_x"], quantities[f"{name}_z"]) for name in ("force", "shift"))
    errors = {
        "force_x_error": np.abs(quantities["force_x"]) * table(lambda a, _: a.estimates.get("sideways")),
        "force_z_error": of_force * table(lambda a, _: a.error_estimate),
        "shift_x_error": of_shift * table(lambda a, _: a.estimates.get("shift")),
        "shift_z_error": of_shift * table(lambda a, _: a.estimates.get("shift")),
        "tilt_error": np.abs(quantities["tilt"]) * table(lambda a, _: a.estimates.get("tilt")),
    }
    return {"depth": depth, "shear": shear, **quantities, **errors}
