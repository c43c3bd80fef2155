"""Closed surfaces of triangles of the beam and of its magnet, made by revolving their profiles, and checks of them.

All lengths are in the unit of the `Shape` that is passed in. A half surface is the part y >= 0, closed at y = 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.meshing import exact_surfaces
from geometry.meshing.edge_lengths import Sizes

SHARE, FILLET = 0.12, 0.25
"""Largest envelope, as a fraction of the smallest edge length and of a fillet's radius.

It may be this large because vertices are projected to the exact surfaces afterwards.
"""
BATCH = 1 << 13
"""Pairs of a point and a triangle whose solid angles are computed at a time, so that they stay in the processor's
cache."""


def body(sizes: Sizes, half: bool) -> tuple[Array, Ints]:
    """Return the outer surface of the beam: points of shape (n, 3) and outward triangles of shape (m, 3)."""
    s = sizes.shape
    side = _line(sizes, (s.R, 0.0), (s.R, s.H))
    cuts = [0.0, math.acos(sizes.ring_radius / s.R), math.pi / 2] if sizes.ring else [0.0, math.pi / 2]
    dome = [_arc(sizes, (0.0, s.H), s.R, low, high)[1:] for low, high in pairwise(cuts)]
    return _revolve(sizes, np.vstack([side, *dome]), half)


def fin(sizes: Sizes, half: bool) -> tuple[Array, Ints]:
    """Return a narrow strip of triangles through the ring, normal to the dome, from inside the beam to outside.

    Strip and dome cross along the ring, so a mesh that conforms to both has edges along the ring. Points have shape
    (n, 3), triangles (m, 3).
    """
    s = sizes.shape
    x, y = _arc(sizes, (0.0, s.H), s.R, 0.0, math.acos(sizes.ring_radius / s.R))[-1]
    count = sizes.steps(x, y, half)
    shares = (1 - min(3 * sizes.ring, sizes.wall / 3) / s.R, 1.0, 1 + 1.5 * sizes.ring / s.R)
    circles = [_circle(share * x, s.H + share * (y - s.H), count, half) for share in shares]
    index = np.arange(count + 1) % len(circles[0])
    faces = [_strip(k * len(circles[0]) + index, (k + 1) * len(circles[0]) + index) for k in range(2)]
    return np.vstack(circles), np.vstack(faces)


def magnet(sizes: Sizes, half: bool) -> tuple[Array, Ints]:
    """Return the surface of the magnet: points of shape (n, 3) and outward triangles of shape (m, 3)."""
    s = sizes.shape
    a, b, rho = s.magnet_diameter / 2, s.magnet_height / 2, s.magnet_edge_radius if sizes.rounded else 0.0
    quarter = math.pi / 2
    parts = [_line(sizes, (a, sizes.centre - b + rho), (a, sizes.centre + b - rho))]
    if rho > 0:
        parts.insert(0, _arc(sizes, (a - rho, sizes.centre - b + rho), rho, -quarter, 0.0))
        parts.append(_arc(sizes, (a - rho, sizes.centre + b - rho), rho, 0.0, quarter))
    profile = np.vstack([part[1 if k else 0 :] for k, part in enumerate(parts)])
    return _revolve(sizes, profile, half)


def _line(sizes: Sizes, start: tuple[float, float], end: tuple[float, float]) -> Array:
    """Return points (r, z) on a line, shape (n, 2), spaced by the target edge length."""
    if math.dist(start, end) < 1e-9 * sizes.shape.R:
        return np.array([start])
    share = np.linspace(0, 1, 4001)[:, None]
    return _spaced(sizes, (1 - share) * np.array(start) + share * np.array(end), 1)


def _arc(sizes: Sizes, centre: tuple[float, float], radius: float, start: float, end: float) -> Array:
    """Return points (r, z) on an arc between two angles, rad, shape (n, 2), spaced by the target edge length."""
    angle = np.linspace(start, end, 4001)
    return _spaced(sizes, np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)]), 1)


def _spaced(sizes: Sizes, curve: Array, least: int) -> Array:
    """Return points of a finely sampled curve, shape (n, 2), spaced by the target edge length.

    least : least number of intervals.
    """
    # the cumulative number of edges along the curve: points lie where it takes evenly spaced values
    middle = (curve[1:] + curve[:-1]) / 2
    steps = np.hypot(*np.diff(curve, axis=0).T) / sizes.at(middle[:, 0], middle[:, 1])
    count = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0, count[-1], max(least, math.ceil(count[-1] - 0.25)) + 1)
    pick = np.round(np.interp(wanted, count, np.arange(len(curve)))).astype(int)
    return np.asarray(curve[np.unique(pick)])


def _revolve(sizes: Sizes, profile: Array, half: bool) -> tuple[Array, Ints]:
    """Return the closed surface of revolution of a profile (r, z), shape (n, 2), with rising z.

    Flat lids close the ends of a profile that do not lie on the axis.
    """
    points: list[Array] = []
    rings: list[Ints] = []
    first = 0
    for r, z in profile:
        n = 0
        if r > 1e-9 * sizes.shape.R:
            n = sizes.steps(r, z, half)
        ring = _circle(r, z, n, half)
        index = first + np.arange(n + 1) % len(ring)
        points.append(ring if n else np.array([[0.0, 0.0, z]]))
        rings.append(index)
        first += len(points[-1])
    faces = _lid(rings[0])[:, ::-1].tolist() + _lid(rings[-1]).tolist()
    for low, high in pairwise(rings):
        faces += _strip(low, high)
        if half:
            faces += [(low[-1], low[0], high[0]), (low[-1], high[0], high[-1])]
    # at points on the axis, a ring is a single point, and some triangles have two equal corners: leave these out
    t = np.array(faces, dtype=np.int64)
    proper = (t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 2] != t[:, 0])
    return np.vstack(points), t[proper]


def _circle(r: float, z: float, count: int, half: bool) -> Array:
    """Return points (n, 3) on a circle around the axis, or on its half y >= 0, with `count` steps between them."""
    angle = np.linspace(0, math.pi if half else 2 * math.pi, count + 1)[: None if half or count == 0 else -1]
    ring = np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)])
    if half and count:
        ring[[0, -1], 1] = 0
    return ring


def _lid(ring: Ints) -> Ints:
    """Return a fan of triangles over a flat ring; their normals point up."""
    return np.array([(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)], dtype=np.int64).reshape(-1, 3)


def _strip(low: Ints, high: Ints) -> list[tuple[int, int, int]]:
    """Return the outward triangles between two rings, which may have different numbers of points."""
    # the next triangle advances on the ring whose next point comes first, both measured as fractions of the circle
    i = j = 0
    faces = []
    while i < len(low) - 1 or j < len(high) - 1:
        below = (i + 1) * max(len(high) - 1, 1) if i < len(low) - 1 else math.inf
        above = (j + 1) * max(len(low) - 1, 1) if j < len(high) - 1 else math.inf
        if below <= above:
            faces.append((int(low[i]), int(low[i + 1]), int(high[j])))
            i += 1
        else:
            faces.append((int(low[i]), int(high[j + 1]), int(high[j])))
            j += 1
    return faces


def envelope(sizes: Sizes) -> float:
    """Return the envelope: the greatest distance between fTetWild's surface and the facets."""
    fillet = FILLET * sizes.shape.magnet_edge_radius if sizes.rounded else math.inf
    least = min(sizes.edge, sizes.rim, sizes.ring or math.inf)
    return min(SHARE * least, fillet, sizes.wall / 5)


def check_surface(points: Array, faces: Ints, epsilon: float, wall: float) -> None:
    """Raise ValueError for a surface with which fTetWild crashes, hangs or returns a wrong mesh.

    Parameters
    ----------
    points, faces : one or more closed surfaces with outward triangles, shapes (n, 3) and (m, 3).
    epsilon, wall : size of the envelope, and least distance between two surfaces, in the unit of `points`.

    Raises
    ------
    ValueError
        The input is empty, not finite, out of range, not closed or not outward, or the envelope does not fit.
    """
    if points.ndim != 2 or points.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise ValueError(f"points and faces must have shape (n, 3) and (m, 3); got {points.shape} and {faces.shape}")
    if not np.isfinite(points).all():
        raise ValueError("every coordinate of the surface must be a finite number")
    if faces.min() < 0 or faces.max() >= len(points):
        raise ValueError(f"faces must number points from 0 to {len(points) - 1}; got {faces.min()} to {faces.max()}")
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    # in a closed oriented surface each edge occurs once in either direction
    there, back = (np.sort(edges[:, k] * len(points) + edges[:, 1 - k]) for k in (0, 1))
    if not np.array_equal(there, back) or (np.diff(there) == 0).any():
        raise ValueError("the surface is not closed: every edge must belong to two triangles of opposite sense")
    if not np.einsum("ij,ij->", points[faces[:, 0]], np.cross(points[faces[:, 1]], points[faces[:, 2]])) > 0:
        raise ValueError("the surface must enclose a positive volume, with its triangles facing outward")
    if not epsilon > 0:
        raise ValueError(f"the envelope epsilon must be positive; got {epsilon:g}")
    if not wall > 2 * epsilon:
        raise ValueError(f"the envelope epsilon must be less than half the wall of {wall:g}; got {epsilon:g}")


def in_body(x: Array, sizes: Sizes, half: bool) -> NDArray[np.bool_]:
    """Return a mask (n,) of the points, shape (n, 3), that lie inside the beam's surface of triangles."""

    def out(x: Array) -> Array:
        beyond = np.maximum(exact_surfaces.skin(x.T, sizes.shape).distance, -x[:, 2])
        return np.maximum(beyond, -x[:, 1]) if half else beyond

    return _inside(x, *body(sizes, half), out)


def in_magnet(x: Array, sizes: Sizes, half: bool) -> NDArray[np.bool_]:
    """Return a mask (n,) of the points, shape (n, 3), that lie inside the magnet's surface of triangles."""
    a, b = sizes.shape.magnet_diameter / 2, sizes.shape.magnet_height / 2

    def out(x: Array) -> Array:
        beyond = np.maximum(np.hypot(x[:, 0], x[:, 1]) - a, np.abs(x[:, 2] - sizes.centre) - b)
        return np.maximum(beyond, -x[:, 1]) if half else beyond

    return _inside(x, *magnet(sizes, half), out)


def _inside(x: Array, points: Array, faces: Ints, out: Callable[[Array], Array]) -> NDArray[np.bool_]:
    """Return a mask (n,) of the points x, shape (n, 3), that lie inside a closed surface of triangles.

    Winding numbers are exact but slow, so they are computed only near the surface. All other points are classified by
    the exact body.

    out : function that returns the signed distance of points, shape (n, 3), from the exact body, positive outside.
    """
    corners = points[faces]
    middles = (corners + np.roll(corners, 1, axis=1)) / 2
    # how far the triangles are from the exact body, sampled at their corners, edges and centres
    apart = np.abs(out(np.concatenate([corners, middles, corners.mean(axis=1)[:, None]], axis=1).reshape(-1, 3)))
    distance = out(x)
    near = np.abs(distance) <= 1.5 * apart.max()
    inside = np.asarray(distance < 0)
    inside[near] = winding(x[near], points, faces) > 0.5
    return inside


def winding(points: Array, vertices: Array, faces: Ints) -> Array:
    """Return the winding number of a closed outward surface about each point (n, 3): 1 inside, 0 outside.

    It is the sum of the signed solid angles of the triangles (van Oosterom and Strackee 1983) over 4 pi; the
    formula's arctangent is half a solid angle.
    """
    total = np.zeros(len(points))
    step = max(BATCH // max(len(points), 1), 1)
    for first in range(0, len(faces), step):
        # (3, batch, 1) or (3, 1, n): a coordinate of each corner and of each point
        a, b, c = (vertices[k].T[:, :, None] - points.T[:, None, :] for k in faces[first : first + step].T)
        la, lb, lc = (np.sqrt(_dot(side, side)) for side in (a, b, c))
        cross = [b[i - 2] * c[i - 1] - b[i - 1] * c[i - 2] for i in range(3)]
        total += np.arctan2(_dot(a, cross), la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb).sum(
            axis=0
        )
    return total / (2 * math.pi)


def _dot(u: Sequence[Array] | Array, v: Sequence[Array] | Array) -> Array:
    """Return the scalar products of vectors whose three components come first."""
    return np.asarray(u[0] * v[0] + u[1] * v[1] + u[2] * v[2])
