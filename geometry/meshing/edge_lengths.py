"""The target edge length of tetrahedra at every point of the beam, and its background grid for fTetWild.

Edges are short at the tip, where a plate touches, at the clamped outer edge, at the magnet's two edges and in thin
layers of silicone. Their length grows in proportion to the distance from these features. All lengths are in the unit
of the `Shape` that is passed in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.spatial import Delaunay

from geometry.arrays import Array, Ints
from geometry.design import Shape

GROWTH = 0.7
"""Growth of the edge length per unit of distance from a refined feature."""

TUBE = 0.05
"""Radius around a ring, in units of D, within which tubes of points refine the background grid.

The spacing of the grid alone, 0.04 D, is too coarse for the short edges at the ring.
"""


@dataclass(frozen=True, slots=True)
class Sizes:
    """The target edge length as a function of the point in the half-plane (r, z).

    Attributes
    ----------
    bulk, tip, rim, edge : edge lengths far from all features, at the tip, at the clamped outer edge, and at the
        magnet's two edges.
    centre : height of the magnet's centre.
    ring, ring_radius : edge length on a ring on the dome around the axis, and radius of the ring; 0 without a ring.
    """

    shape: Shape
    bulk: float
    tip: float
    rim: float
    edge: float
    centre: float
    ring: float = 0.0
    ring_radius: float = 0.0

    @classmethod
    def of(
        cls,
        shape: Shape,
        size: float,
        tip_size: float | None,
        ring: tuple[float, float] | None = None,
        centre: float | None = None,
    ) -> Sizes:
        """Return the sizes for an edge length `size` in the bulk, which is limited to half the radius.

        Parameters
        ----------
        tip_size : edge length at the tip; None: half of that in the bulk.
        ring : radius of the ring, and edge length on it.
        centre : height of the magnet's centre; None: H.
        """
        bulk = min(size, shape.R / 2)
        edge = bulk / 2
        if shape.has_magnet:
            edge = min(edge, max(bulk / 4, shape.magnet_edge_radius / 2), 0.2 * shape.magnet_diameter)
        radius, at_ring = ring or (0.0, 0.0)
        clamp = bulk / 5 if ring else bulk / 2
        tip = min(tip_size or bulk / 2, bulk)
        middle = shape.H if centre is None else centre
        return cls(shape, bulk, tip, clamp, edge, middle, min(at_ring, bulk), radius)

    def scaled(self, factor: float) -> Sizes:
        """Return the sizes in another unit of length."""
        places = {name: factor * getattr(self, name) for name in ("centre", "ring_radius")}
        return replace(self.finer(factor), shape=self.shape.scaled(factor), **places)

    def finer(self, factor: float) -> Sizes:
        """Return the sizes with every edge length multiplied by `factor`; the shape stays."""
        names = ("bulk", "tip", "rim", "edge", "ring")
        return replace(self, **{name: factor * getattr(self, name) for name in names})

    @property
    def rounded(self) -> bool:
        """True if the facets resolve the fillet of the magnet; a smaller fillet is meshed as a sharp edge."""
        return self.shape.has_magnet and self.shape.magnet_edge_radius >= 0.25 * self.edge

    @property
    def wall(self) -> float:
        """Least thickness of silicone around the magnet; for an enlarged magnet a lower bound of it."""
        s = self.shape
        if not s.has_magnet or self.centre == s.H:
            return s.wall
        a, b = s.magnet_diameter / 2, s.magnet_height / 2
        return min(self.centre - b, s.R - math.hypot(a, b))

    @property
    def ring_height(self) -> float:
        """Height z of the ring."""
        return self.shape.H + math.sqrt(self.shape.R**2 - self.ring_radius**2)

    def at(self, r: Array, z: Array) -> Array:
        """Return the target edge length at points (r, z); r, z and the result have the same shape."""
        s = self.shape
        # the tip's edge length holds within this distance of the tip: the zone of contact
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
        across = np.abs(z - self.centre)
        edge = self.edge + GROWTH * np.maximum(np.hypot(r - (a - rho), across - (b - rho)) - rho, 0)
        return np.asarray(np.minimum(np.minimum(size, edge), self._layer(r, z, a, b)))

    def steps(self, r: float, z: float, half: bool) -> int:
        """Return the number of edges of the target length on a circle around the axis, or on its half."""
        turn = math.pi if half else 2 * math.pi
        return max(math.ceil(turn * r / float(self.at(np.array(r), np.array(z)))), 6 if half else 12)

    def _layer(self, r: Array, z: Array, a: float, b: float) -> Array:
        """Return the edge length that a thin layer of silicone needs.

        This is 1.5 times the thickness of the layer between the magnet and the outer surface at the point, and at
        least an eighth of the bulk size.
        """
        s = self.shape
        skin = np.where(z > s.H, np.abs(s.R - np.hypot(r, z - s.H)), np.abs(s.R - r))
        dr, dz = r - a, np.abs(z - self.centre) - b
        magnet = np.hypot(np.maximum(dr, 0), np.maximum(dz, 0)) + np.abs(np.minimum(np.maximum(dr, dz), 0))
        return np.asarray(np.maximum(1.5 * (np.minimum(skin, np.abs(z)) + magnet), self.bulk / 8))


def background(sizes: Sizes, half: bool) -> tuple[Array, Ints, Array]:
    """Return the background grid around the beam: points (n, 3), tetrahedra (m, 4) and target edge lengths (n,).

    fTetWild interpolates the edge lengths linearly in the tetrahedra.
    """
    s = sizes.shape
    margin = 0.02 * s.D
    low = np.array([-s.R, 0.0 if half else -s.R, 0.0]) - margin
    high = np.array([s.R, s.R, s.L]) + margin
    axes = [np.linspace(a, b, math.ceil((b - a) / (0.04 * s.D)) + 1) for a, b in zip(low, high, strict=True)]
    places = np.array([0.0, sizes.centre - s.magnet_height / 2, sizes.centre + s.magnet_height / 2, s.H, s.L])
    near = np.abs(axes[2][:, None] - places).min(axis=1) < s.D
    # along a slender beam, far from all features, every eighth plane of the grid is enough
    near[::8] = near[-1] = True
    axes[2] = axes[2][near]
    n = [len(axis) for axis in axes]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    strides = np.array([n[1] * n[2], n[2], 1])
    corner = np.arange(len(axes[0]) * strides[0]).reshape(n)[:-1, :-1, :-1]
    points, denser = grid.reshape(-1, 3), np.empty((0, 4), dtype=np.int64)
    if sizes.ring:
        around = _around_ring(axes, sizes)
        own, denser = _denser(grid[tuple(around)].reshape(-1, 3), sizes, half)
        points, denser = np.vstack([points, own]), len(points) + denser
        kept = np.ones(corner.shape, dtype=bool)
        kept[tuple(slice(each.start, each.stop - 1) for each in around)] = False
        corner = corner[kept]
    # Kuhn's subdivision of each box into six tetrahedra: one for each path along edges from the lowest to the highest
    # corner; two corners are exchanged for odd permutations of the axes, so that all volumes are positive
    corner, tets = corner.ravel(), [denser]
    for order in permutations(range(3)):
        path = np.concatenate([[0], np.cumsum(strides[list(order)])])
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        tets.append(corner[:, None] + (path[[0, 2, 1, 3]] if odd else path))
    return points, np.vstack(tets), sizes.at(np.hypot(points[:, 0], points[:, 1]), points[:, 2])


def _around_ring(axes: list[Array], sizes: Sizes) -> list[slice]:
    """Return, for each axis, the slice of grid points of the smallest box that holds the ring and its tubes."""
    r, z, wide = sizes.ring_radius, sizes.ring_height, TUBE * sizes.shape.D
    slices = []
    for axis, middle, reach in zip(axes, (0.0, 0.0, z), (r + wide, r + wide, wide), strict=True):
        first = int(np.searchsorted(axis, middle - reach, side="right")) - 1
        slices.append(slice(max(first, 0), int(np.searchsorted(axis, middle + reach)) + 1))
    return slices


def _denser(grid: Array, sizes: Sizes, half: bool) -> tuple[Array, Ints]:
    """Add the points of tubes around the ring to a grid; return all points (n, 3) and their tetrahedra (m, 4).

    Points inside the box are displaced by small pseudo-random amounts of a fixed seed, because the Delaunay
    tetrahedra of a regular grid are not unique.
    """
    low, high = grid.min(axis=0), grid.max(axis=0)
    r, z, h = sizes.ring_radius, sizes.ring_height, sizes.ring
    turn = np.arange(8) * math.pi / 4
    radii = h * 2.0 ** np.arange(max(math.ceil(math.log2(TUBE * sizes.shape.D / h)), 0) + 1)
    out = np.concatenate([[0.0], *(radius * np.cos(turn) for radius in radii)])
    up = np.concatenate([[0.0], *(radius * np.sin(turn) for radius in radii)])
    count = sizes.steps(r, z, half)
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
