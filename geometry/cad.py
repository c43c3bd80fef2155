"""Exact solids of the sensor.

Lengths are in mm and volumes in mm³, in the sensor's frame (see `geometry.design`). build123d takes seconds to
import, so only the functions that need it import it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Point, Vector
from geometry.bad_input import MeshError
from geometry.design import BadInput, Design, Shape
from geometry.hall_chips import CIRCLES

if TYPE_CHECKING:
    from build123d import BoundBox, Solid

Corner = tuple[float, float, float]
"""A corner of a profile: distance from the axis, height, fillet radius; all mm."""


def rounded(profile: Sequence[Corner]) -> list[tuple[Point, Point, Point | None]]:
    """Return the lines and fillet arcs of a profile, in order: start, end, and the centre of an arc or None.

    A fillet is tangent to both sides. A side of which the fillets leave nothing is omitted.
    """
    pieces: list[tuple[Point, Point, Point | None]] = []
    last = profile[0][:2]

    def to(end: Point, centre: Point | None = None) -> None:
        nonlocal last
        # to the CAD kernel, nearer points are one point
        if math.dist(last, end) >= 1e-7:
            pieces.append((last, end, centre))
            last = end

    for (x0, z0, _), (x, z, radius), (x2, z2, _) in zip(profile, profile[1:], profile[2:], strict=False):
        back, on = _unit(x0 - x, z0 - z), _unit(x2 - x, z2 - z)
        # tangent length = radius / tan(half the angle), from the cosine of the angle: exact at a right angle
        c = back[0] * on[0] + back[1] * on[1]
        reach = radius * math.sqrt((1 + c) / (1 - c))
        to((x + reach * back[0], z + reach * back[1]))
        if radius > 0:
            deep = reach / (1 + c)
            centre = (x + deep * (back[0] + on[0]), z + deep * (back[1] + on[1]))
            to((x + reach * on[0], z + reach * on[1]), centre)
    to(profile[-1][:2])
    return pieces


def turned(profile: Sequence[Corner]) -> Solid:
    """Return the solid of revolution about z of a profile that starts and ends on the axis.

    Fillets are exact arcs. The hemispherical tip, for example, is the corner (R, L) with a fillet of radius R.
    """
    import build123d as bd

    edges: list[Any] = []
    for start, end, centre in rounded(profile):
        a, b = (start[0], 0.0, start[1]), (end[0], 0.0, end[1])
        if centre is None:
            edges.append(bd.Edge.make_line(a, b))
        else:
            aside = _unit((start[0] + end[0]) / 2 - centre[0], (start[1] + end[1]) / 2 - centre[1])
            radius = math.dist(start, centre)
            middle = (centre[0] + radius * aside[0], 0.0, centre[1] + radius * aside[1])
            edges.append(bd.Edge.make_three_point_arc(a, middle, b))
    (x, z), (x0, z0) = profile[-1][:2], profile[0][:2]
    edges.append(bd.Edge.make_line((x, 0.0, z), (x0, 0.0, z0)))
    return bd.Solid.revolve(bd.Face(bd.Wire(edges)), 360, bd.Axis.Z)


def turned_volume(profile: Sequence[Corner]) -> float:
    """Return the exact volume of `turned(profile)`, pi times the integral of r² dz.

    >>> ball = [(0, 0, 0), (2, 0, 2), (2, 4, 2), (0, 4, 0)]
    >>> round(turned_volume(ball) / (4 / 3 * math.pi * 2**3), 12)
    1.0
    """
    total = 0.0
    for (r0, z0), (r1, z1), centre in rounded(profile):
        if centre is None:
            total += (z1 - z0) * (r0 * r0 + r0 * r1 + r1 * r1) / 3
            continue
        a, radius = centre[0], math.dist((r0, z0), centre)
        t0, t1 = (math.atan2(z - centre[1], r - a) for r, z in ((r0, z0), (r1, z1)))
        total += _arc(a, radius, t1) - _arc(a, radius, t0)
    return math.pi * abs(total)


def _arc(a: float, radius: float, t: float) -> float:
    """Return the antiderivative at t of (a + radius cos t)² radius cos t: r² dz along an arc."""
    s = math.sin(t)
    return radius * (a * a * s + a * radius * (t + s * math.cos(t)) + radius**2 * (s - s**3 / 3))


def _unit(x: float, z: float) -> Point:
    length = math.hypot(x, z)
    return (x / length, z / length)


def cut(body: Solid, *tools: Solid) -> Solid:
    """Cut `tools` from `body`; raise MeshError unless exactly one solid remains."""
    solids = body.cut(*tools).solids() if tools else [body]
    if len(solids) != 1:
        raise MeshError(f"a cut must leave one solid; it left {len(solids)}: check the part's dimensions")
    return solids[0]


def moved(solid: Solid, place: Vector) -> Solid:
    """Return the solid translated by a vector, mm. Both solids share their faces and the triangles of these faces."""
    import build123d as bd

    return bd.Solid(solid.wrapped.Moved(bd.Location(place).wrapped))


def intersection(first: Any, second: Any) -> list[Any]:
    """Return the shapes that two shapes share: build123d gives None, one shape or a list of shapes."""
    shapes = first.intersect(second)
    return [] if shapes is None else shapes if isinstance(shapes, list) else [shapes]


def common(first: Solid, second: Solid) -> list[Solid]:
    """Return the solids of the intersection of two solids; none if they only touch."""
    return [solid for shape in intersection(first, second) for solid in shape.solids()]


def overlap(first: Solid, second: Solid) -> float:
    """Return the volume of the intersection of two solids, mm³."""
    # an intersection takes long; solids whose boxes are apart share nothing
    if distance(first.bounding_box(optimal=False), second.bounding_box(optimal=False)) > 0:
        return 0.0
    return float(sum(solid.volume for solid in common(first, second)))


def distance(first: BoundBox, second: BoundBox) -> float:
    """Return the distance of two bounding boxes, mm: a lower bound for the distance of the bodies in them."""
    past = np.subtract(tuple(second.min), tuple(first.max)), np.subtract(tuple(first.min), tuple(second.max))
    return float(np.linalg.norm(np.maximum(np.maximum(*past), 0.0)))


def element_positions(design: Design) -> tuple[Vector, ...]:
    """Return the centres of the Hall plates of S1, S2 and S3, or three times that of each chip, mm."""
    s1 = design.H - design.l0
    if design.hall_layout != "three":
        r = design.chip_x
        return tuple((r * x, r * y + 0.0, s1) for x, y in CIRCLES[int(design.chip_count)] for _ in range(3))
    s23 = s1 + design.c
    return (0.0, 0.0, s1), (design.f, 0.0, s23), (0.0, design.f, s23)


def beam(design: Design | Shape) -> Solid:
    """Return the outer form of the silicone, mm: a cylinder with a hemisphere, from z = 0 to the tip at z = L."""
    R = design.D / 2
    return turned([(0, 0, 0), (R, 0, 0), (R, design.L, R), (0, design.L, 0)])


def magnet(design: Design | Shape) -> Solid:
    """Return the magnet with its rounded edges, centred at z = H, mm.

    Raises
    ------
    BadInput
        The design has no magnet.
    """
    if not design.magnet_diameter > 0:
        raise BadInput("magnet_diameter must be positive to draw the magnet; got 0 mm: this design has no magnet")
    return turned(_magnet(design))


def _magnet(design: Design | Shape) -> list[Corner]:
    a, b, rho = design.magnet_diameter / 2, design.magnet_height / 2, design.magnet_edge_radius
    low, high = design.H - b, design.H + b
    return [(0, low, 0), (a, low, rho), (a, high, rho), (0, high, 0)]


def silicone(design: Design | Shape) -> Solid:
    """Return the silicone, mm: the beam with a closed void for the magnet, or the whole beam without a magnet."""
    return cut(beam(design), magnet(design)) if design.magnet_diameter > 0 else beam(design)


def beam_volume(shape: Shape) -> float:
    """Return the exact volume of the beam, magnet included, in the cube of the shape's unit."""
    return math.pi * shape.R**2 * (shape.H + 2 * shape.R / 3)


def magnet_volume(shape: Shape) -> float:
    """Return the exact volume of the magnet, 0 without one, in the cube of the shape's unit.

    >>> round(magnet_volume(Shape(8, 9, 4, 4, 2)) / (4 / 3 * math.pi * 2**3), 12)
    1.0
    """
    return turned_volume(_magnet(shape)) if shape.has_magnet else 0.0


@functools.lru_cache(maxsize=8)
def magnet_inertia(shape: Shape) -> tuple[float, float]:
    """Return the magnet's exact moments of inertia across and along its axis, about its centre, for unit density.

    With the radius r(z) of the rounded magnet they are the integrals of pi (r^4 / 4 + r^2 z^2) dz and of
    pi r^4 / 2 dz, in the fifth power of the shape's unit; 0 without a magnet.

    >>> across, along = magnet_inertia(Shape(8, 9, 4, 4, 2))
    >>> round(across / (8 / 15 * math.pi * 2**5), 12), round(along / (8 / 15 * math.pi * 2**5), 12)
    (1.0, 1.0)
    """
    if not shape.has_magnet:
        return 0.0, 0.0
    a, b, rho = shape.magnet_diameter / 2, shape.magnet_height / 2, shape.magnet_edge_radius
    middle = b - rho
    across, along = a**4 * middle / 4 + a**2 * middle**3 / 3, a**4 * middle / 2
    # the upper fillet, by the angle t of its arc; sixteen points are exact to rounding
    t, weights = np.polynomial.legendre.leggauss(16)
    t = math.pi / 4 * (1 + t)
    r, z, dz = a - rho + rho * np.cos(t), middle + rho * np.sin(t), math.pi / 4 * weights * rho * np.cos(t)
    across += float(dz @ (r**4 / 4 + r**2 * z**2))
    along += float(dz @ r**4) / 2
    return 2 * math.pi * across, 2 * math.pi * along
