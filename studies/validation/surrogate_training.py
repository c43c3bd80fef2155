"""Beams for training, for the calibration of intervals, and for testing, and their finite-element states.

A Gaussian process extrapolates badly. So training begins with the corners of the range, and the scrambled Sobol
points that follow are stretched beyond it and cut at its faces: two of three lie on a face. Later points fill the
gaps between the first ones. Beams of calibration and test are independent random points, the same number in each
region of the beams, so that no region's intervals rest on a handful of beams: within a region they are drawn as a
user's would be, and training has not seen them.

States are presses, first modes, critical depths and glued shears, from the store or solved. A shear begins at a depth
between `SHALLOWEST_SHEAR` and the deepest press, but before the tip would buckle sideways: beyond that depth an
equilibrium depends on the path. So presses come first, and tell each beam's critical depth. The finite elements have
an error of their own. Answers bring estimates of it for force, shift and tilt; for the other quantities it is taken
for the difference from the same state on the coarser mesh (`States.compared`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
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
"""Factor by which the Sobol points of training are stretched from the centre of the cube, before they are cut at its
faces."""


@dataclass(frozen=True, slots=True)
class Beams:
    """Beams of the surrogate, arrays of shape (n,).

    Attributes
    ----------
    L, diameter, height : length of the beam, and size of its magnet, over D.
    nu : Poisson's ratio.
    edge : radius of the magnet's edges over the smaller side of its section.
    share : where the depth of its shear lies between the least and the largest one, 0 to 1 in the root of the depth.
    """

    L: Array
    diameter: Array
    height: Array
    nu: Array
    edge: Array
    share: Array

    def __len__(self) -> int:
        return len(self.L)

    def __getitem__(self, rows: slice | NDArray[Any]) -> Beams:
        return Beams(*(getattr(self, name)[rows] for name in self.__slots__))

    @property
    def in_range(self) -> NDArray[np.bool_]:
        """Which beams have enough silicone below the magnet for the surrogate, shape (n,)."""
        return surrogate_range.below(self.L, self.height) >= surrogate_range.LEAST_BELOW

    @property
    def density_ratio(self) -> Array:
        """Density of the magnet over that of the silicone, for the natural frequencies, shape (n,).

        It follows the last coordinate, which matters to shears only otherwise.
        """
        low, high = DENSITY_RATIO
        return np.asarray(np.round(low + (high - low) * self.share, DIGITS))

    def design(self, k: int) -> Design:
        """Return beam `k` as a design of D = 10 mm and E = 1 MPa."""
        D, smaller = DIAMETER_MM, min(float(self.diameter[k]), float(self.height[k]))
        return Design(
            D=D,
            L=_round(self.L[k]) * D,
            nu=_round(self.nu[k]),
            magnet_diameter=_round(self.diameter[k]) * D,
            magnet_height=_round(self.height[k]) * D,
            magnet_edge_radius=_round(self.edge[k] * smaller) * D,
            l0=10 * D,
        )


def _round(value: float) -> float:
    return round(float(value), DIGITS)


def training_beams(count: int, seed: int) -> Beams:
    """Return the first `count` beams of training; more beams keep the first ones."""
    points = qmc.Sobol(DIMENSIONS, rng=seed)
    found = corners()
    while len(found) < count:
        beams = of_cube(np.clip(0.5 + STRETCH * (points.random(1024) - 0.5), 0.0, 1.0))
        found = joined(found, beams[beams.in_range])
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
    for _ in range(40):
        middle = (low + high) / 2
        fits = _possible(_scaled(np.column_stack([unit[:, :2], middle, unit[:, 3:]])))
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    whole = _possible(_scaled(unit))
    return of_cube(np.column_stack([unit[:, :2], np.where(whole, unit[:, 2], low - 1e-4), unit[:, 3:]]))


def random_beams(count: int, seed: int) -> Beams:
    """Return independent random beams of the range."""
    rng = np.random.default_rng(seed)
    found = joined()
    while len(found) < count:
        beams = of_cube(rng.random((1024, DIMENSIONS)))
        found = joined(found, beams[beams.in_range])
    return found[:count]


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
    """Return the beams of all points of the unit cube."""
    low, high = LENGTH
    soft = 1 - 2 * POISSON[0]
    L = low * (high / low) ** unit[:, 0]
    d, h, edge = (a + (b - a) * unit[:, k] for k, (a, b) in ((1, DIAMETER), (2, HEIGHT), (4, EDGE)))
    nu = (1 - soft * unit[:, 3] ** 2) / 2
    L, d, h, nu, edge = (np.round(x, DIGITS) for x in (L, d, h, nu, edge))
    return Beams(L, d, h, nu, edge, unit[:, 5])


def _walled(beams: Beams) -> NDArray[np.bool_]:
    """Return which beams have enough silicone around their magnets."""
    return np.asarray(surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge) >= LEAST_WALL)


def _possible(beams: Beams) -> NDArray[np.bool_]:
    return np.asarray(_walled(beams) & beams.in_range)


def joined(*parts: Beams) -> Beams:
    """Return the beams of all parts."""
    empty = np.empty(0)
    return Beams(*(np.concatenate([empty, *(getattr(one, name) for one in parts)]) for name in Beams.__slots__))


# States

SAFE = 0.95
"""Deepest shear over the critical depth."""


@dataclass(frozen=True, slots=True)
class States:
    """States of beams at their depths or shears: arrays of shape (n, k), NaN where a solve failed.

    Attributes
    ----------
    depth, shear : position over D.
    quantities : by name, forces over E D^2, lengths over D, tilt in rad, frequencies over `frequency_unit`.
    errors : by name, estimated errors of the finite elements themselves; a name or a number (NaN) is missing where
        the error is unknown.
    """

    depth: Array
    shear: Array
    quantities: Mapping[str, Array]
    errors: Mapping[str, Array]

    @property
    def complete(self) -> NDArray[np.bool_]:
        """Which beams have all their states, shape (n,)."""
        return np.asarray(~np.isnan(next(iter(self.quantities.values()))).any(axis=1))

    def kept(self, rows: NDArray[Any]) -> States:
        """Return the states of some beams."""
        parts = ({name: q[rows] for name, q in part.items()} for part in (self.quantities, self.errors))
        return States(self.depth[rows], self.shear[rows], *parts)

    def joined(self, other: States) -> States:
        """Return the states of the beams of both."""
        parts = (
            {name: np.concatenate([q, theirs[name]]) for name, q in mine.items()}
            for mine, theirs in ((self.quantities, other.quantities), (self.errors, other.errors))
        )
        return States(np.concatenate([self.depth, other.depth]), np.concatenate([self.shear, other.shear]), *parts)

    def compared(self, coarse: States) -> States:
        """Return these states with errors, where they have none, that are the differences from coarser ones."""
        differences = {name: np.abs(q - coarse.quantities[name]) for name, q in self.quantities.items()}
        return replace(self, errors=differences | dict(self.errors))


def presses(solver: Solver, beams: Beams, depths: Array) -> States:
    """Return the states of frictionless presses to depths over D, shape (n, k), rising."""
    scenes = [
        Scene(beams.design(k), tuple(Load(depth=float(x) * DIAMETER_MM) for x in row), solver.accuracy)
        for k, row in enumerate(depths)
    ]
    return _states(depths, np.zeros_like(depths), solver.answers(scenes))


def shears(solver: Solver, beams: Beams, depth: Array, shears: Array) -> States:
    """Return the states of glued shears, over D, shape (n, k), rising, each at one depth, shape (n,)."""
    scenes = []
    for k, row in enumerate(shears):
        at = float(depth[k]) * DIAMETER_MM
        loads = tuple(Load(depth=at, shear_x=float(x) * DIAMETER_MM, friction="stick") for x in row)
        scenes.append(Scene(beams.design(k), loads, solver.accuracy, model="harmonic"))
    return _states(np.broadcast_to(depth[:, None], shears.shape), shears, solver.answers(scenes))


def critical_depths(solver: Solver, beams: Beams) -> States:
    """Return the critical depths over D, at most the deepest press of the surrogate; NaN where a search fails."""
    scenes = [Scene(beams.design(k), (Load(depth=1.0),), solver.accuracy) for k in range(len(beams))]
    deepest = surrogate_range.deepest(beams.L, beams.diameter, beams.height).tolist()
    found = []
    for (answer,), most in zip(solver.answers(scenes, "critical depth"), deepest, strict=True):
        depth = answer.values.get("critical_depth_over_D")
        if depth is None and answer.values.get("stable_to_over_D", 0.0) >= most - 1e-9:
            depth = most
        found.append(math.nan if depth is None else min(depth, most))
    return _single("depth", found)


def first_modes(solver: Solver, beams: Beams) -> States:
    """Return the lowest natural frequencies of the unloaded beams over `frequency_unit`."""
    rest, ratios = (Load(depth=0.0),), beams.density_ratio
    scenes = []
    for k in range(len(beams)):
        design = beams.design(k)
        design = replace(design, magnet_density=float(ratios[k]) * design.density)
        scenes.append(Scene(design, rest, solver.accuracy, model="axisymmetric"))
    lowest = [(answer.values.get("frequency") or [np.nan])[0] for (answer,) in solver.answers(scenes, "modes")]
    return _single("frequency", lowest)


def shear_depth(beams: Beams, press: States) -> Array:
    """Return the depth of each beam's shear, over D, shape (n,), above the depth at which its press buckles."""
    low = np.sqrt(surrogate_range.SHALLOWEST_SHEAR)
    critical = first_zero(press.depth, np.nan_to_num(press.quantities["sideways_ratio"], nan=-1.0))
    most = np.minimum(surrogate_range.deepest(beams.L, beams.diameter, beams.height), SAFE * critical)
    high = np.maximum(np.sqrt(most), low)
    return np.asarray(np.round((low + (high - low) * beams.share) ** 2, 5))


def _single(name: str, values: Sequence[float]) -> States:
    """Return the states of a quantity that each beam has once."""
    column = np.array(values, dtype=float)[:, None]
    none = np.zeros_like(column)
    return States(none, none, {name: column}, {})


def _states(depth: Array, shear: Array, answers: Sequence[Sequence[Answer]]) -> States:
    """Return the quantities of answers, which are for D = DIAMETER_MM and E = 1 MPa, with the known errors."""
    D = DIAMETER_MM

    def table(read: Callable[[Answer, Response], Any]) -> Array:
        rows = [[np.nan if a.response is None else read(a, a.response) for a in row] for row in answers]
        return np.array(rows, dtype=float)

    force, length = 1 / D**2, 1 / D
    quantities = {
        "force_x": force * table(lambda _, r: r.force[0]),
        "force_z": force * table(lambda _, r: r.force[2]),
        "shift_x": length * table(lambda _, r: r.shift[0]),
        "shift_z": length * table(lambda _, r: r.shift[2]),
        "tilt": table(lambda _, r: r.tilt),
        "contact_radius": length * table(lambda _, r: r.contact_radius),
        "strain": table(lambda a, _: a.values["largest_strain"]),
        "sideways_ratio": table(lambda a, _: a.values.get("sideways_stiffness_ratio")),
    }
    of_force, of_shift = (np.hypot(quantities[f"{name}_x"], quantities[f"{name}_z"]) for name in ("force", "shift"))
    errors = {
        "force_x": np.abs(quantities["force_x"]) * table(lambda a, _: a.estimates.get("sideways")),
        "force_z": of_force * table(lambda a, _: a.error_estimate),
        "shift_x": of_shift * table(lambda a, _: a.estimates.get("shift")),
        "shift_z": of_shift * table(lambda a, _: a.estimates.get("shift")),
        "tilt": np.abs(quantities["tilt"]) * table(lambda a, _: a.estimates.get("tilt")),
    }
    return States(depth, shear, quantities, errors)
