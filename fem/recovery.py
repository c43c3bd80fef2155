"""Displacement and its gradient at a point on the axis, recovered from the nodes around it.

The gradient of second-order elements jumps between cells and converges an order more slowly than their
displacements. So a cubic polynomial is fitted by least squares to the nodal displacements within PATCH local edge
lengths of the point, and its value and gradient are taken there (polynomial-preserving recovery: Zhang and Naga 2005,
SIAM J. Sci. Comput. 26, 1192). It is exact for cubic displacements. With edges of length h errors of the value fall
like h^4, of the gradient like h^3 (h^4 too where the patch is symmetric about the point).

Half bodies are mirrored at y = 0, and sections turned around the axis, so that the patch is round, and it is cut only
where the body ends.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from fem import elements
from fem.elements import Elements

Array = NDArray[np.float64]

DEGREE = 3
PATCH = 1.5
"""Radius of the patch over the mean edge length of the NEAREST cells around the point."""
NEAREST = 12
WORST, WIDER = 1e3, 1.25
"""Greatest condition number of a fit, and by what factor a patch grows whose nodes are too few for it."""
ON_PLANE = 1e-9
"""Nodes this near to y = 0, in units of D, are their own mirror images."""
POWERS = np.array([e for e in itertools.product(range(DEGREE + 1), repeat=3) if sum(e) <= DEGREE])


def gradient(e: Elements, u: Array, height: float, *, mirrored: bool) -> tuple[Array, Array]:
    """Displacement u_i (3,) and its gradient du_i/dX_j (3, 3) at the point (0, 0, height).

    Parameters
    ----------
    u : nodal displacements (n, 3), or the fields (n, fields) of a section.
    mirrored : whether a solid is one half, y >= 0, of a body that is symmetric about the plane y = 0.
    """
    points, values = _around(e, u) if e.dim == 2 else (e.nodes, u)
    if mirrored or e.dim == 2:
        other = points[:, 1] > ON_PLANE
        mirror = np.array([1.0, -1.0, 1.0])
        points = np.concatenate([points, points[other] * mirror])
        values = np.concatenate([values, values[other] * mirror])
    return fit(points - [0, 0, height], values, PATCH * edge(e, height))


def fit(points: Array, values: Array, radius: float) -> tuple[Array, Array]:
    """Value (f,) and gradient (f, 3) at the origin of the polynomial nearest to values (n, f) at points (n, 3).

    Residuals at a distance d are weighted by 1 - (d / radius)^2.
    """
    distance = np.linalg.norm(points, axis=1)
    while True:
        near = distance < radius
        weights = (1 - (distance[near] / radius) ** 2)[:, None]
        terms = np.prod((points[near, None] / radius) ** POWERS, axis=2)
        found, _, _, sizes = np.linalg.lstsq(weights * terms, weights * values[near], rcond=None)
        if (near.sum() >= len(POWERS) and sizes[0] < WORST * sizes[-1]) or near.all():
            first = [int(np.flatnonzero((np.eye(3)[j] == POWERS).all(axis=1))[0]) for j in range(3)]
            return found[0], found[first].T / radius
        radius *= WIDER


def _around(e: Elements, u: Array) -> tuple[Array, Array]:
    """Positions and displacements (n, 3) of a section's nodes in planes through the axis on the side y > 0.

    Twice as many planes, with their mirror images, tell all harmonics from those of the polynomial.
    """
    N = e.angles.harmonics
    angles = elements.around(N, 2 * N + DEGREE + 1)
    turns = elements.turns(angles.theta)
    places = np.stack([e.nodes[:, 0], np.zeros(len(e.nodes)), e.nodes[:, 1]], axis=1)
    points = np.einsum("ijt,nj->nti", turns, places).reshape(-1, 3)
    return points, np.einsum("ijt,tjf,nf->nti", turns, angles.E, u).reshape(-1, 3)


def edge(e: Elements, height: float) -> float:
    """Mean edge length of the cells nearest to a point on the axis."""
    corners = e.nodes[e.corners]
    point = np.zeros(e.dim)
    point[-1] = height
    near = np.argsort(np.linalg.norm(corners.mean(axis=1) - point, axis=1), kind="stable")[:NEAREST]
    pairs = itertools.combinations(range(e.dim + 1), 2)
    return float(np.mean([np.linalg.norm(corners[near, i] - corners[near, j], axis=1) for i, j in pairs]))
