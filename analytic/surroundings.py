"""Fields that the surroundings of a sensor add at points near it: uniform field, iron, other magnets.

Each of these is a function of points and of poses of the sensor's own magnet, because iron answers to its field: it
returns the field (m, p, 3) at points (p, 3), fixed in space, in m poses. All are in the sensor's frame (base at
z = 0, beam along z); lengths in mm, angles in rad, B in T.

**Iron plane.** A magnet in air before a half space of relative permeability mu_r (linear, not saturated): with the
reflection M in the plane, x -> x - 2 n n.(x - p), and the magnet's free field B_0, the half space adds in the air

    B(x) = -k M B_0(M x),    k = (mu_r - 1) / (mu_r + 1).

These are image charges of the opposite sign: the image of a magnet has its moment along the normal, and the reverse
of that along the plane. It is exact for a half space. A sheet is weaker: of thickness t it acts as one while mu_r t
is much more than the distance. Sources: Jackson, Classical Electrodynamics, section 4.4 (the electrostatic case).

**Iron spheroid** (ball, rod, disc) of half axes b, b and a along its axis, volume V: moment mu_0 m = V chi B_0 /
(1 + chi N) along each axis, with the demagnetising factors N (Osborn, Phys. Rev. 67, 1945, 351) and the mean B_0 of
the magnet's field over its volume, which gives the moment in any field (reciprocity: the spheroid is uniformly
magnetised by a uniform field). A ball has N = 1/3 and 3 V (mu_r - 1) / (mu_r + 2). Outside, a uniformly magnetised
spheroid is a row of dipoles between its foci, c = sqrt(a^2 - b^2) off its centre, whose density falls as
1 - x^2 / c^2, and the mean of a field without sources over its volume is that with these weights, too. A disc (a < b)
counts as small: its field and B_0 are those at its centre. What a field that varies along the iron magnetises beyond
the moment, and the answer of iron to iron and to the magnet, are left out: a rod is a rough figure where it is nearer
than half its length, and its ends are those of a spheroid, not of a cylinder.

**Other magnets** are exact cylinders, those of another sensor of the same design; **motors** are dipoles.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from analytic.hall import field_at
from analytic.magnet import MU_0
from geometry.arrays import Array
from geometry.design import BadInput, Design

FOCAL_POINTS = 24
"""Gauss points between the foci of a rod."""
IRON = 1000.0
"""Relative permeability of mild steel and of ferritic stainless steel in weak fields, a common round value; of pure
iron and of Permalloy it is higher, and an answer hardly depends on it from 100 on."""


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Poses of the sensor's magnet, and the depth of the plate on its tip.

    shift : (m, 3), mm. tilt : rotation vectors (m, 2), rad, as in `analytic.hall.field_at`. depth : (m,), mm.
    """

    shift: Array
    tilt: Array
    depth: Array

    def __len__(self) -> int:
        return len(self.shift)

    def field(self, design: Design, points: Array) -> Array:
        """Return the field (m, p, 3), T, of a design's magnet at points (p, 3), or (m, p, 3) of each pose, mm."""
        at = np.broadcast_to(points, (len(self), *points.shape[-2:]))
        shift, tilt = (np.repeat(rows, at.shape[1], axis=0) for rows in (self.shift, self.tilt))
        return field_at(at.reshape(-1, 3), design, shift, tilt, refuse=False).reshape(at.shape)


Surroundings = Callable[[Array, Poses], Array]


def uniform(B: Array) -> Surroundings:
    """Return a uniform field B (3,), T."""
    return lambda points, poses: np.broadcast_to(B, (len(poses), len(points), 3))


def gradient(G: Array, at: Array) -> Surroundings:
    """Return a field that grows from 0 at a point (3,), mm, by G (3, 3), T/mm, symmetric and without a trace."""
    return lambda points, poses: np.broadcast_to((points - at) @ G, (len(poses), len(points), 3))


@dataclass(frozen=True, slots=True, eq=False)
class IronPlane:
    """A half space of iron, whose surface passes through a point (3,), mm, and has a normal towards the sensor.

    touched : whether it is the plate that presses the tip, so that its surface comes down by the depth.
    """

    design: Design
    point: Array
    normal: Array
    permeability: float = IRON
    touched: bool = False

    def seen_from(self, place: Array) -> IronPlane:
        """Return it in the frame of a sensor at a place (3,), mm."""
        return replace(self, point=self.point - place)

    def __call__(self, points: Array, poses: Poses) -> Array:
        """Return the field; NaN where the magnet's centre or a point lies in the iron."""
        n = self.normal / np.linalg.norm(self.normal)
        down = poses.depth if self.touched else np.zeros(len(poses))
        surface = (self.point - down[:, None] * [0.0, 0.0, 1.0])[:, None]
        height = ((points - surface) @ n)[..., None]
        B = poses.field(self.design, points - 2 * height * n)
        strength = (self.permeability - 1) / (self.permeability + 1)
        magnet = (np.array([0.0, 0.0, self.design.H]) + poses.shift - surface[:, 0]) @ n
        inside = (height <= 0) | (magnet <= 0)[:, None, None]
        return np.where(inside, np.nan, strength * (2 * (B @ n)[..., None] * n - B))


def demagnetising_factors(slenderness: float) -> tuple[float, float]:
    """Return the factors along and across the axis of a spheroid whose half axes are `slenderness` : 1 : 1.

    >>> [round(x, 6) for x in demagnetising_factors(1.0)], round(demagnetising_factors(10.0)[0], 6)
    ([0.333333, 0.333333], 0.020286)
    """
    r = slenderness
    if not 0 < r < math.inf:
        raise BadInput(f"the length of a piece of iron over its diameter must be positive; got {r:g}")
    if abs(r - 1) < 1e-4:
        along = 1 / 3 - 4 / 15 * (r - 1)
    elif r > 1:
        e = math.sqrt(r * r - 1)
        along = (r / e * math.acosh(r) - 1) / (r * r - 1)
    else:
        e = math.sqrt(1 - r * r)
        along = (1 - r / e * math.acos(r)) / (1 - r * r)
    return along, (1 - along) / 2


@dataclass(frozen=True, slots=True, eq=False)
class IronPiece:
    """A ball, rod or disc of iron as a spheroid.

    place, axis : (3,) centre, mm, and direction of its axis. diameter, length : across and along it, mm.
    """

    design: Design
    place: Array
    diameter: float
    length: float
    axis: Array
    permeability: float = IRON

    def seen_from(self, place: Array) -> IronPiece:
        """Return it in the frame of a sensor at a place (3,), mm."""
        return replace(self, place=self.place - place)

    def __call__(self, points: Array, poses: Poses) -> Array:
        """Return the field of the moment that the sensor's magnet induces."""
        t, chi = self.axis / np.linalg.norm(self.axis), self.permeability - 1
        half_focus = math.sqrt(max(self.length**2 - self.diameter**2, 0.0)) / 2
        nodes, weights = np.polynomial.legendre.leggauss(FOCAL_POINTS if half_focus else 1)
        weights = weights * (1 - nodes**2)
        weights, places = weights / weights.sum(), self.place + half_focus * nodes[:, None] * t
        B0 = np.einsum("p,mpi->mi", weights, poses.field(self.design, places))
        along, across = (chi / (1 + chi * N) for N in demagnetising_factors(self.length / self.diameter))
        induced = across * B0 + (along - across) * (B0 @ t)[:, None] * t
        volume = math.pi / 6 * self.diameter**2 * self.length
        fields = [_dipole_field(points - place, volume * induced) for place in places]
        return np.asarray(np.einsum("p,pmij->mij", weights, np.array(fields)))


def motor(place: Array, moment: Array) -> Surroundings:
    """Return the field of a dipole of a moment (3,), A m^2, at a place (3,), mm."""
    # mu0 m in T mm^3
    strength = 1e9 * MU_0 * moment
    return lambda points, poses: np.broadcast_to(
        _dipole_field(points - place, strength[None]), (len(poses), len(points), 3)
    )


def _dipole_field(x: Array, strength: Array) -> Array:
    """Return the field (m, p, 3), T, at points (p, 3), mm, from dipoles of mu0 m (m, 3), T mm^3."""
    d = np.linalg.norm(x, axis=-1, keepdims=True)
    unit = x / d
    along = np.einsum("pi,mi->mp", unit, strength)[..., None]
    return np.asarray((3 * along * unit - strength[:, None]) / (4 * math.pi * d**3))


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """The magnet of another sensor of the same design.

    place : (3,) the middle of its base, mm.
    shift, tilt : (3,) and (2,), the pose of its magnet under its own load, in its own frame.
    facing : whether it is turned by half a turn about x, as in the other jaw of a gripper.
    """

    design: Design
    place: Array
    shift: Array
    tilt: Array
    facing: bool = False

    def __call__(self, points: Array, poses: Poses) -> Array:
        """Return the field, which does not depend on the pose of the sensor's own magnet."""
        turn = np.array([1.0, -1.0, -1.0]) if self.facing else np.ones(3)
        own = Poses(self.shift[None], self.tilt[None], np.zeros(1))
        B = own.field(self.design, (points - self.place) * turn) * turn
        return np.broadcast_to(B, (len(poses), *points.shape))


def reach(design: Design, field: float) -> float:
    """Return the distance from the magnet's centre, at rest, beyond which its field is nowhere above `field`, T, mm.

    It is largest on the axis, on either side. 0 for a field that no point on the axis outside the magnet has.
    """
    from scipy.optimize import brentq

    half = design.magnet_height / 2

    def excess(log_distance: float) -> float:
        at = np.array([[0.0, 0.0, design.H + math.exp(log_distance)]])
        return math.log(float(np.linalg.norm(field_at(at, design))) / field)

    near, far = math.log(half * (1 + 1e-9)), math.log(1e4 * (half + design.magnet_diameter))
    if excess(near) <= 0:
        return 0.0
    return math.exp(brentq(excess, near, far, xtol=1e-9))
