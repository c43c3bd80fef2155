"""Displacement and its gradient at a point on the axis, recovered from the nodes around it.

The gradient of second-order elements jumps between cells and converges one order more slowly than their
displacements. A cubic polynomial is therefore fitted by least squares to the nodal displacements within PATCH local
edge lengths of the point, and evaluated with its gradient at the point (polynomial-preserving recovery: Zhang and
Naga 2005, SIAM J. Sci. Comput. 26, 1192). The recovery is exact for cubic displacements. With edges of length h the
error of the value falls like h^4, and that of the gradient like h^3 (h^4 where the patch is symmetric about the
point).

Half bodies are mirrored at y = 0, and sections rotated around the axis, so that the patch is a full ball except where
the body ends.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fem.model import angular_fields
from fem.model.elements import SAME_PLACE, Elements
from geometry.arrays import Array, Ints

DEGREE = 3
"""Degree of the polynomial: one more than that of the elements."""
PATCH = 1.5
"""Radius of the patch over the mean edge length of the cells around the point."""
POWERS = np.array([e for e in itertools.product(range(DEGREE + 1), repeat=3) if sum(e) <= DEGREE])
FIRST = [int(np.flatnonzero((row == POWERS).all(axis=1))[0]) for row in (np.zeros(3), *np.eye(3))]
"""Positions of the terms 1, x, y, z among POWERS."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """Value and gradient at a point as weighted sums over the fields of the nodes around it.

    nodes : (m,) numbers of the nodes.
    shares : (4, 3, m, fields) weights for the displacement, then for its derivatives by x, y, z.
    """

    nodes: Ints
    shares: Array

    def __call__(self, u: Array) -> tuple[Array, Array]:
        """Return the displacement u_i (3,) and its gradient du_i/dX_j (3, 3), for nodal fields u (n, fields)."""
        recovered = np.tensordot(self.shares, u[self.nodes], axes=2)
        return recovered[0], recovered[1:].T


def build_recovery(e: Elements, height: float, *, mirrored: bool) -> Recovery:
    """Return the recovery of displacement and gradient at the point (0, 0, height), over D.

    mirrored : whether the body is symmetric about the plane y = 0, and a solid is its half y >= 0.
    """
    if e.dim == 2:
        nodes, points, turned = _revolved_nodes(e)
    else:
        nodes, points, turned = np.arange(len(e.nodes)), e.nodes, np.broadcast_to(np.eye(3), (len(e.nodes), 3, 3))
    if mirrored:
        imaged = points[:, 1] > SAME_PLACE
        mirror = np.array([1.0, -1.0, 1.0])
        points = np.concatenate([points, points[imaged] * mirror])
        turned = np.concatenate([turned, turned[imaged] * mirror[:, None]])
        nodes = np.concatenate([nodes, nodes[imaged]])
    near, weights = fit(points - [0, 0, height], PATCH * mean_edge_length(e, height))
    # the images of a node have its fields: their weights are added
    involved, image = np.unique(nodes[near], return_inverse=True)
    shares = np.zeros((len(involved), *turned.shape[1:], len(weights)))
    np.add.at(shares, image, turned[near][..., None] * weights.T[:, None, None])
    return Recovery(involved, np.ascontiguousarray(shares.transpose(3, 1, 0, 2)))


def fit(points: Array, radius: float) -> tuple[Ints, Array]:
    """Fit a polynomial to values at points (n, 3); return the weights of its value and derivatives at the origin.

    Residuals at a distance d are weighted by 1 - (d / radius)^2.

    Returns
    -------
    near : (m,) numbers of the points in the fit.
    weights : (4, m) factors on the values at these points.
    """
    distance = np.linalg.norm(points, axis=1)
    while True:
        near = np.flatnonzero(distance < radius)
        # the weight falls to zero at the rim: the fit does not jump when a node enters or leaves the patch
        weights = 1 - (distance[near] / radius) ** 2
        x = points[near] / radius
        powers = np.stack([np.ones_like(x), x, x * x, x * x * x])
        terms = np.prod([powers[POWERS[:, i], :, i].T for i in range(3)], axis=0)
        # a singular value decomposition also gives the condition number, which decides whether nodes are enough
        U, sizes, Vt = np.linalg.svd(weights[:, None] * terms, full_matrices=False)
        if (len(near) >= len(POWERS) and sizes[0] < 1e3 * sizes[-1]) or len(near) == len(points):
            shares = (Vt.T[FIRST] / sizes) @ U.T * weights
            shares[1:] /= radius
            return near, shares
        radius *= 1.25


def _revolved_nodes(e: Elements) -> tuple[Ints, Array, Array]:
    """Return a section's nodes in planes through the axis, at y > 0 without sine orders, shape (n,).

    Also return their positions (n, 3) and their displacements by their fields (n, 3, fields). There are enough planes
    to separate all harmonics of the section from those of the polynomial.
    """
    N, count = e.angles.harmonics, len(e.nodes)
    angles = angular_fields.fourier_fields(N, 2 * N + DEGREE + 1, sines=e.angles.sines)
    turns = angular_fields.rotations(angles.theta)
    places = np.stack([e.nodes[:, 0], np.zeros(count), e.nodes[:, 1]], axis=1)
    points = np.einsum("ijt,nj->tni", turns, places).reshape(-1, 3)
    displacements = np.repeat(np.einsum("ijt,tjf->tif", turns, angles.E), count, axis=0)
    return np.tile(np.arange(count), len(angles.theta)), points, displacements


def mean_edge_length(e: Elements, height: float) -> float:
    """Return the mean edge length of the twelve cells with the nearest centres to a point on the axis."""
    corners = e.nodes[e.corners]
    point = np.zeros(e.dim)
    point[-1] = height
    near = np.argsort(np.linalg.norm(corners.mean(axis=1) - point, axis=1), kind="stable")[:12]
    pairs = itertools.combinations(range(e.dim + 1), 2)
    return float(np.mean([np.linalg.norm(corners[near, i] - corners[near, j], axis=1) for i, j in pairs]))
