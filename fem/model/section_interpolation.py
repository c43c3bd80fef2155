"""Unknowns on another mesh from a state of a section of the same beam: a first guess for Newton's method.

Each node of the other section or of the tetrahedra lies at a point (r, z) of a triangle of the section, and in
tetrahedra at an angle theta. The triangle is curved, so the point's local coordinates are found by Newton's method,
from those in the straight triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fem.model import angular_fields, elements
from fem.model.elements import Elements
from fem.model.nonlinear_system import System
from geometry.arrays import Array, Ints

NEAREST, CORRECTIONS = 12, 3
"""Triangles, those with the nearest centres, among which that of a point is sought; and Newton steps for its local
coordinates, whose error is far below that of the guess after them."""
STRAIGHT = 1e-9
"""Largest distance of middle nodes from the middles of the sides of a straight triangle, over its size."""


@dataclass(frozen=True, slots=True)
class SectionInterpolation:
    """Interpolation from a section to another one with the same fields, or to tetrahedra of the half y >= 0.

    Attributes
    ----------
    section, other : the two systems.
    cells : (n,) triangle of each node of the other mesh.
    shape, pressure_shape : (n, 6) and (n, 3) shape functions of its nodes and corners there.
    E, C : in tetrahedra, (n, 3, f) displacement x, y, z of each field, and (n, k) pressure of each pressure field.
    """

    section: System
    other: System
    cells: Ints
    shape: Array
    pressure_shape: Array
    E: Array | None = None
    C: Array | None = None

    def __call__(self, q: Array) -> Array:
        """Return the unknowns on the other mesh for unknowns q of the section."""
        state, e = self.section.state(q), self.section.elements
        u = np.einsum("na,naf->nf", self.shape, state.u[e.cells[self.cells]])
        rows = np.zeros(len(e.nodes), dtype=np.int64)
        rows[self.section.corner_nodes] = np.arange(len(self.section.corner_nodes))
        p = np.einsum("nc,nck->nk", self.pressure_shape, state.p[rows[e.corners[self.cells]]])
        if self.E is not None and self.C is not None:
            u, p = np.einsum("nif,nf->ni", self.E, u), np.sum(self.C * p, axis=1, keepdims=True)
        return self.other.unknowns(u, p[self.other.corner_nodes], self.section.motion(q))


def interpolate_section(section: System, other: System) -> SectionInterpolation:
    """Return the interpolation from a section to another one with the same fields, or to tetrahedra of the half."""
    if other.elements.dim == 2:
        cells, local = _locate(section.elements, other.elements.nodes)
        return SectionInterpolation(section, other, cells, _shape_functions(local)[0], _barycentric(local))
    x, y, z = other.elements.nodes.T
    cells, local = _locate(section.elements, np.stack([np.hypot(x, y), z], axis=1))
    angles = section.elements.angles
    series = angular_fields.fields_at(np.arctan2(y, x), angles.harmonics, sines=angles.sines)
    E = np.einsum("ijn,njf->nif", angular_fields.rotations(series.theta), series.E)
    shape, _ = _shape_functions(local)
    return SectionInterpolation(section, other, cells, shape, _barycentric(local), E, series.C)


def _locate(e: Elements, points: Array) -> tuple[Ints, Array]:
    """Return the triangle of each point (n, 2), and the point's local coordinates (n, 2) in it."""
    corners = e.nodes[e.corners]
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(NEAREST, len(corners)))
    (a, b), (c, d) = np.moveaxis(corners[:, 1:] - corners[:, :1], 0, -1)
    r, z = (points[:, None] - corners[near, 0]).T.swapaxes(1, 2)
    area = a * d - b * c
    # local coordinates in the straight triangles, shape (n, near) each
    x, y = (d / area)[near] * r - (c / area)[near] * z, (a / area)[near] * z - (b / area)[near] * r
    # a point beside the straight triangles, at a curved side, belongs to the one that it is least outside of
    best = np.argmax(np.minimum(np.minimum(x, y), 1 - x - y), axis=1)
    each = np.arange(len(points))
    cells, local = near[each, best], np.stack([x[each, best], y[each, best]], axis=1)
    # side k of a straight triangle joins its corners k and k + 1, and has its middle node halfway
    halfway = (corners + corners[:, [1, 2, 0]]) / 2
    bent = np.abs(e.nodes[e.cells[:, 3:]] - halfway).max(axis=(1, 2)) > STRAIGHT * np.sqrt(np.abs(area))
    moved = np.flatnonzero(bent[cells])
    nodes = e.nodes[e.cells[cells[moved]]]
    for _ in range(CORRECTIONS):
        shape, slopes = _shape_functions(local[moved])
        off = points[moved] - np.einsum("na,nai->ni", shape, nodes)
        (a, b), (c, d) = np.moveaxis(np.einsum("nai,naj->nij", nodes, slopes), 0, -1)
        u, v = off.T
        local[moved] += np.stack([d * u - b * v, a * v - c * u], axis=1) / (a * d - b * c)[:, None]
    return cells, local


def _barycentric(local: Array) -> Array:
    """Return the barycentric coordinates (..., 3) of local coordinates (..., 2)."""
    return np.concatenate([1 - local.sum(axis=-1, keepdims=True), local], axis=-1)


def _shape_functions(local: Array) -> tuple[Array, Array]:
    """Return the quadratic shape functions (n, 6) of a triangle and their slopes (n, 6, 2) at local coordinates."""
    quadratic, _ = elements.bases(2)
    values, slopes = zip(*(quadratic.lbasis(local.T, i) for i in range(6)), strict=True)
    return np.stack(values, axis=-1), np.stack([slope.T for slope in slopes], axis=1)
