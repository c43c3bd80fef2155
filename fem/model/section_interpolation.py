"""Unknowns on another mesh from a state of a section of the same beam: a first guess for Newton's method.

Each node of the other section lies in a triangle of the section. The triangle is curved, so the node's local
coordinates are found by Newton's method, from those in the straight triangle.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fem.model import elements
from fem.model.elements import SAME_PLACE, Elements
from fem.model.nonlinear_system import System
from geometry.arrays import Array, Ints

NEAREST, CORRECTIONS = 12, 3
"""Triangles, those with the nearest centres, among which that of a point is sought; and Newton steps for its local
coordinates, whose error is far below that of the guess after them."""


def interpolate_section(section: System, target: System, q: Array) -> Array:
    """Return the unknowns of another section with the same fields for those of a section."""
    state, e = section.state(q), section.elements
    cells, local = _locate(e, target.elements.nodes)
    u = np.einsum("na,naf->nf", _shape_functions(local)[0], state.u[e.cells[cells]])
    barycentric = np.concatenate([1 - local.sum(axis=1, keepdims=True), local], axis=1)
    p = np.einsum("nc,nck->nk", barycentric, state.p[np.searchsorted(section.corner_nodes, e.corners[cells])])
    return target.unknowns(u, p[target.corner_nodes], section.motion(q))


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
    bent = np.abs(e.nodes[e.cells[:, 3:]] - halfway).max(axis=(1, 2)) > SAME_PLACE * np.sqrt(np.abs(area))
    moved = np.flatnonzero(bent[cells])
    nodes = e.nodes[e.cells[cells[moved]]]
    for _ in range(CORRECTIONS):
        shape, slopes = _shape_functions(local[moved])
        off = points[moved] - np.einsum("na,nai->ni", shape, nodes)
        (a, b), (c, d) = np.moveaxis(np.einsum("nai,naj->nij", nodes, slopes), 0, -1)
        u, v = off.T
        local[moved] += np.stack([d * u - b * v, a * v - c * u], axis=1) / (a * d - b * c)[:, None]
    return cells, local


def _shape_functions(local: Array) -> tuple[Array, Array]:
    """Return the quadratic shape functions (n, 6) of a triangle and their slopes (n, 6, 2) at local coordinates."""
    quadratic, _ = elements.bases(2)
    values, slopes = zip(*(quadratic.lbasis(local.T, i) for i in range(6)), strict=True)
    return np.stack(values, axis=-1), np.stack([slope.T for slope in slopes], axis=1)
