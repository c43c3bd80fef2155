"""Closed triangle surfaces of the beam and of its magnet, by revolving their profiles, and the size of their facets.

All lengths are in the unit of the `Shape` that is passed in. A half surface is the part y >= 0, closed at y = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from geometry.design import Shape

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GROWTH = 0.7
"""Growth of the edge length per length away from a refined place."""


@dataclass(frozen=True, slots=True)
class Sizes:
    """Target edge length as a function of the place in the half-plane (r, z).

    Attributes
    ----------
    bulk, tip, rim, edge : far from everything, at the tip, at the clamped outer edge, at the magnet's two edges.
    ring, ring_radius : on a ring around the axis on the dome, and its radius; 0 without a ring.
    """

    shape: Shape
    bulk: float
    tip: float
    rim: float
    edge: float
    ring: float = 0.0
    ring_radius: float = 0.0

    @classmethod
    def of(cls, shape: Shape, size: float, tip_size: float | None, ring: tuple[float, float] | None = None) -> Sizes:
        """The sizes that follow from the size in the bulk, which is at most half the radius."""
        bulk = min(size, shape.R / 2)
        edge = bulk / 2
        if shape.has_magnet:
            edge = min(edge, max(bulk / 4, shape.magnet_edge_radius / 2), 0.2 * shape.magnet_diameter)
        radius, at_ring = ring or (0.0, 0.0)
        clamp = bulk / 5 if ring else bulk / 2
        return cls(shape, bulk, min(tip_size or bulk / 2, bulk), clamp, edge, min(at_ring, bulk), radius)

    def finer(self, factor: float) -> Sizes:
        """All sizes multiplied by a factor."""
        names = ("bulk", "tip", "rim", "edge", "ring")
        return replace(self, **{name: factor * getattr(self, name) for name in names})

    @property
    def rounded(self) -> bool:
        """Whether the fillet of the magnet is large enough to be seen by the facets."""
        return self.shape.has_magnet and self.shape.magnet_edge_radius >= 0.25 * self.edge

    @property
    def ring_height(self) -> float:
        """z of the ring."""
        return self.shape.H + math.sqrt(self.shape.R**2 - self.ring_radius**2)

    def at(self, r: Floats, z: Floats) -> Floats:
        """Target edge length at points (r, z), arrays of one shape."""
        s = self.shape
        contact = 1.5 * 0.35 * s.R
        tip = self.tip + GROWTH * np.maximum(np.hypot(r, z - s.L) - contact, 0)
        rim = self.rim + GROWTH * np.hypot(r - s.R, z)
        size = np.minimum(np.minimum(tip, rim), self.bulk)
        if self.ring:
            away = np.hypot(r - self.ring_radius, z - self.ring_height)
            size = np.minimum(size, self.ring + GROWTH * np.maximum(away - self.ring, 0))
        if not s.has_magnet:
            return size
        a, b, rho = s.magnet_diameter / 2, s.magnet_height / 2, s.magnet_edge_radius
        across = np.abs(z - s.H)
        edge = self.edge + GROWTH * np.maximum(np.hypot(r - (a - rho), across - (b - rho)) - rho, 0)
        return np.asarray(np.minimum(np.minimum(size, edge), self._layer(r, z, a, b)))

    def _layer(self, r: Floats, z: Floats, a: float, b: float) -> Floats:
        """1.5 times the thickness of the silicone around the magnet, at least an eighth of the bulk size."""
        s = self.shape
        skin = np.where(z > s.H, np.abs(s.R - np.hypot(r, z - s.H)), np.abs(s.R - r))
        dr, dz = r - a, np.abs(z - s.H) - b
        magnet = np.hypot(np.maximum(dr, 0), np.maximum(dz, 0)) + np.abs(np.minimum(np.maximum(dr, dz), 0))
        return np.asarray(np.maximum(1.5 * (np.minimum(skin, np.abs(z)) + magnet), self.bulk / 8))


def body(sizes: Sizes, half: bool) -> tuple[Floats, Ints]:
    """Outer surface of the beam: points of shape (n, 3) and outward triangles of shape (m, 3)."""
    s = sizes.shape
    side = _line(sizes, (s.R, 0.0), (s.R, s.H))
    cuts = [0.0, math.acos(sizes.ring_radius / s.R), math.pi / 2] if sizes.ring else [0.0, math.pi / 2]
    dome = [_arc(sizes, (0.0, s.H), s.R, low, high)[1:] for low, high in pairwise(cuts)]
    return _revolve(sizes, np.vstack([side, *dome]), half)


def fin(sizes: Sizes, half: bool) -> tuple[Floats, Ints]:
    """A narrow strip through the ring, normal to the dome, from within the beam to without.

    A mesh that conforms to it and to the dome has edges along the ring, where they cross.
    """
    s = sizes.shape
    x, y = _arc(sizes, (0.0, s.H), s.R, 0.0, math.acos(sizes.ring_radius / s.R))[-1]
    count = _count(sizes, x, y, half)
    shares = (1 - min(3 * sizes.ring, s.wall / 3) / s.R, 1.0, 1 + 1.5 * sizes.ring / s.R)
    circles = [_circle(share * x, s.H + share * (y - s.H), count, half) for share in shares]
    index = np.arange(count + 1) % len(circles[0])
    faces = [_strip(k * len(circles[0]) + index, (k + 1) * len(circles[0]) + index) for k in range(2)]
    return np.vstack(circles), np.vstack(faces)


def magnet(sizes: Sizes, half: bool) -> tuple[Floats, Ints]:
    """Surface of the magnet: points of shape (n, 3) and outward triangles of shape (m, 3)."""
    s = sizes.shape
    a, b, rho = s.magnet_diameter / 2, s.magnet_height / 2, s.magnet_edge_radius if sizes.rounded else 0.0
    quarter = math.pi / 2
    parts = [_line(sizes, (a, s.H - b + rho), (a, s.H + b - rho))]
    if rho > 0:
        parts.insert(0, _arc(sizes, (a - rho, s.H - b + rho), rho, -quarter, 0.0))
        parts.append(_arc(sizes, (a - rho, s.H + b - rho), rho, 0.0, quarter))
    profile = np.vstack([part[1 if k else 0 :] for k, part in enumerate(parts)])
    return _revolve(sizes, profile, half)


def _line(sizes: Sizes, start: tuple[float, float], end: tuple[float, float]) -> Floats:
    if math.dist(start, end) < 1e-9 * sizes.shape.R:
        return np.array([start])
    share = np.linspace(0, 1, 4001)[:, None]
    return _spaced(sizes, (1 - share) * np.array(start) + share * np.array(end), 1)


def _arc(sizes: Sizes, centre: tuple[float, float], radius: float, start: float, end: float) -> Floats:
    angle = np.linspace(start, end, 4001)
    return _spaced(sizes, np.array(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)]), 1)


def _spaced(sizes: Sizes, curve: Floats, least: int) -> Floats:
    """Points of the curve, shape (n, 2), whose distances follow the sizes; at least `least` intervals."""
    middle = (curve[1:] + curve[:-1]) / 2
    steps = np.hypot(*np.diff(curve, axis=0).T) / sizes.at(middle[:, 0], middle[:, 1])
    count = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0, count[-1], max(least, math.ceil(count[-1] - 0.25)) + 1)
    pick = np.round(np.interp(wanted, count, np.arange(len(curve)))).astype(int)
    return np.asarray(curve[np.unique(pick)])


def _revolve(sizes: Sizes, profile: Floats, half: bool) -> tuple[Floats, Ints]:
    """Closed surface from a profile (r, z), shape (n, 2), of rising z, with flat lids where it ends off the axis."""
    points: list[Floats] = []
    rings: list[Ints] = []
    first = 0
    for r, z in profile:
        n = 0
        if r > 1e-9 * sizes.shape.R:
            n = _count(sizes, r, z, half)
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
    found = np.array(faces, dtype=np.int64)
    whole = (found[:, 0] != found[:, 1]) & (found[:, 1] != found[:, 2]) & (found[:, 2] != found[:, 0])
    return np.vstack(points), found[whole]


def _count(sizes: Sizes, r: float, z: float, half: bool) -> int:
    """Number of steps around the axis."""
    turn = math.pi if half else 2 * math.pi
    return max(math.ceil(turn * r / float(sizes.at(np.array(r), np.array(z)))), 6 if half else 12)


def _circle(r: float, z: float, count: int, half: bool) -> Floats:
    """Points (n, 3) in so many steps around the axis."""
    angle = np.linspace(0, math.pi if half else 2 * math.pi, count + 1)[: None if half or count == 0 else -1]
    ring = np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full_like(angle, z)])
    if half and count:
        ring[[0, -1], 1] = 0
    return ring


def _lid(ring: Ints) -> Ints:
    """Fan of triangles over a flat ring, seen from above."""
    return np.array([(ring[0], ring[k], ring[k + 1]) for k in range(1, len(ring) - 1)], dtype=np.int64).reshape(-1, 3)


def _strip(low: Ints, high: Ints) -> list[tuple[int, int, int]]:
    """Triangles between two rings of possibly different counts, outward."""
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
    """Greatest distance that fTetWild may stray from the facets."""
    fillet = 0.1 * sizes.shape.magnet_edge_radius if sizes.rounded else math.inf
    least = min(sizes.edge, sizes.rim, sizes.ring or math.inf)
    return min(0.05 * least, fillet, sizes.shape.wall / 8)


def check_surface(points: Floats, faces: Ints, epsilon: float, wall: float) -> None:
    """Refuse what makes fTetWild crash, hang or answer wrongly.

    Parameters
    ----------
    points, faces : shape (n, 3) and (m, 3): one or more closed surfaces, outward.
    epsilon, wall : size of the envelope and least distance between two surfaces, in the unit of `points`.

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
    there, back = (np.sort(edges[:, k] * len(points) + edges[:, 1 - k]) for k in (0, 1))
    if not np.array_equal(there, back) or (np.diff(there) == 0).any():
        raise ValueError("the surface is not closed: every edge must belong to two triangles of opposite sense")
    if not np.einsum("ij,ij->", points[faces[:, 0]], np.cross(points[faces[:, 1]], points[faces[:, 2]])) > 0:
        raise ValueError("the surface must enclose a positive volume, with its triangles facing outward")
    if not epsilon > 0:
        raise ValueError(f"the envelope epsilon must be positive; got {epsilon:g}")
    if not wall > 2 * epsilon:
        raise ValueError(f"the envelope epsilon must be less than half the wall of {wall:g}; got {epsilon:g}")


def background(sizes: Sizes, half: bool) -> tuple[Floats, Ints, Floats]:
    """Sizing field on a grid around the beam: points (n, 3), tetrahedra (m, 4) and edge lengths (n,)."""
    s = sizes.shape
    margin = 0.02 * s.D
    low = np.array([-s.R, 0.0 if half else -s.R, 0.0]) - margin
    high = np.array([s.R, s.R, s.L]) + margin
    axes = [np.linspace(a, b, math.ceil((b - a) / (0.04 * s.D)) + 1) for a, b in zip(low, high, strict=True)]
    places = np.array([0.0, s.H - s.magnet_height / 2, s.H + s.magnet_height / 2, s.L])
    near = np.abs(axes[2][:, None] - places).min(axis=1) < s.D
    near[::8] = near[-1] = True
    axes[2] = axes[2][near]
    n = [len(axis) for axis in axes]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    if sizes.ring:
        grid, cells = _denser(grid, sizes, half)
        return grid, cells, sizes.at(np.hypot(grid[:, 0], grid[:, 1]), grid[:, 2])
    strides = np.array([n[1] * n[2], n[2], 1])
    corner = np.arange(len(grid)).reshape(n)[:-1, :-1, :-1].ravel()
    tets = []
    for order in permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(strides[list(order)])])
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        tets.append(corner[:, None] + (path[[0, 2, 1, 3]] if odd else path))
    return grid, np.vstack(tets), sizes.at(np.hypot(grid[:, 0], grid[:, 1]), grid[:, 2])


def _denser(grid: Floats, sizes: Sizes, half: bool) -> tuple[Floats, Ints]:
    """The points (n, 3) of a grid with those of tubes around the ring, and the tetrahedra (m, 4) between them.

    The points are moved at random by little, or Delaunay's tetrahedra of a regular grid would not be unique.
    """
    low, high = grid.min(axis=0), grid.max(axis=0)
    r, z, h = sizes.ring_radius, sizes.ring_height, sizes.ring
    turn = np.arange(8) * math.pi / 4
    radii = h * 2.0 ** np.arange(max(math.ceil(math.log2(0.05 * sizes.shape.D / h)), 0) + 1)
    out = np.concatenate([[0.0], *(radius * np.cos(turn) for radius in radii)])
    up = np.concatenate([[0.0], *(radius * np.sin(turn) for radius in radii)])
    count = _count(sizes, r, z, half)
    margin = 2 / count if half else 0.0
    angle = np.linspace(-margin, (math.pi if half else 2 * math.pi) + margin, count + 3)[:, None]
    tubes = np.stack([(r + out) * np.cos(angle), (r + out) * np.sin(angle), z + up + 0 * angle], axis=-1)
    points = np.vstack([grid, tubes.reshape(-1, 3)])
    points = points[((points >= low) & (points <= high)).all(axis=1)]
    moved = points + np.random.default_rng(0).uniform(-0.1, 0.1, points.shape) * h
    points = np.where((points == low) | (points == high), points, np.clip(moved, low, high))
    tets = Delaunay(points).simplices.astype(np.int64)
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    six = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a))
    tets[six < 0] = tets[six < 0][:, [0, 2, 1, 3]]
    return points, tets[np.abs(six) > 1e-6 * h**3]


def winding(points: Floats, vertices: Floats, faces: Ints) -> Floats:
    """How often a closed outward surface winds around each of the points (n, 3): 1 inside, 0 outside."""
    total = np.zeros(len(points))
    for face in faces:
        a, b, c = (vertices[k] - points for k in face)
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        dots = [np.einsum("ij,ij->i", u, v) for u, v in ((a, b), (b, c), (c, a))]
        volume = np.einsum("ij,ij->i", a, np.cross(b, c))
        total += np.arctan2(volume, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
    return total / (2 * math.pi)


def project(x: Floats, on: dict[str, NDArray[np.bool_]], sizes: Sizes) -> Floats:
    """The points x of shape (3, n) moved to the closest points of the surfaces, and of the ring, that they are on."""
    shape = sizes.shape
    x = x.copy()
    if "symmetry" in on:
        x[1, on["symmetry"]] = 0
    x[2, on["base"]] = 0
    skin = on["skin"]
    rise = np.maximum(x[2, skin] - shape.H, 0)
    scale = shape.R / np.sqrt(x[0, skin] ** 2 + x[1, skin] ** 2 + rise**2)
    x[:2, skin] *= scale
    x[2, skin] += rise * (scale - 1)
    if "ring" in on:
        ring = on["ring"]
        x[:2, ring] *= sizes.ring_radius / np.hypot(x[0, ring], x[1, ring])
        x[2, ring] = sizes.ring_height
    if "magnet" in on:
        mask = on["magnet"]
        x[:, mask] = _on_magnet(x[:, mask], on["edge"][mask] if "edge" in on else None, shape)
    return x


def _on_magnet(x: Floats, edge: NDArray[np.bool_] | None, shape: Shape) -> Floats:
    """Closest points of the magnet's surface; nodes of a sharp `edge` go to the middle of the fillet."""
    rho = shape.magnet_edge_radius
    flat_r, flat_z = shape.magnet_diameter / 2 - rho, shape.magnet_height / 2 - rho
    r, up = np.hypot(x[0], x[1]), x[2] - shape.H
    dr, dz = r - flat_r, np.abs(up) - flat_z
    if edge is not None:
        dr, dz = np.where(edge, 1.0, dr), np.where(edge, 1.0, dz)
    corner = (dr > 0) & (dz > 0)
    length = np.where(corner, np.hypot(dr, dz), 1.0)
    to_r = np.where(corner, dr * rho / length, np.where(dr > dz, rho, dr))
    to_z = np.where(corner, dz * rho / length, np.where(dr > dz, dz, rho))
    scale = np.where(r > 0, (flat_r + to_r) / np.where(r > 0, r, 1.0), 1.0)
    return np.stack([x[0] * scale, x[1] * scale, shape.H + np.sign(up) * (flat_z + to_z)])


def beam_volume(shape: Shape) -> float:
    """Volume of the beam, magnet included."""
    return math.pi * shape.R**2 * (shape.H + 2 * shape.R / 3)


def magnet_volume(shape: Shape) -> float:
    """Volume of the magnet with its rounded edges."""
    a, b, rho = shape.magnet_diameter / 2, shape.magnet_height / 2, shape.magnet_edge_radius
    core = a - rho
    return 2 * math.pi * (a**2 * (b - rho) + core**2 * rho + core * math.pi * rho**2 / 2 + 2 * rho**3 / 3)
