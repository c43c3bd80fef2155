"""Integrals over the elements that do not depend on the law: displacement gradients, mass and pressures.

A batch is the m elements of a slice, with q points on the mesh and t angles each. The unknowns of an element are
ordered with the fields first: displacements (f, a), then pressures (n, c). `fem.model.elements` defines D,
V, E and C. Forces and stiffness: `fem.model.element_loops`.
"""

from __future__ import annotations

import numpy as np

from fem.model.elements import Elements
from geometry.arrays import Array


def gradient(e: Elements, part: slice, u: Array) -> Array:
    """Return the displacement gradients G, shape (3, 3, m, q t), of nodal fields u (n, fields)."""
    D, V = e.D[part], e.angles.V
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    g = (D.reshape(m, 3 * q, a) @ u[e.cells[part]]).reshape(m * q, 3, f)
    G = np.empty((3, 3, m * q, t))
    for J in range(3):
        G[:, J] = (g[:, J] @ V[:, :, J].reshape(3 * t, f).T).reshape(m * q, t, 3).transpose(2, 0, 1)
    return G.reshape(3, 3, m, q * t)


def volumes(e: Elements, part: slice = slice(None)) -> Array:
    """Return the weights of the integration points, shape (m, q t)."""
    return np.asarray((e.weights[part][..., None] * e.angles.weights).reshape(len(e.weights[part]), -1))


def mass(e: Elements, density: float) -> Array:
    """Return the integral of density du . du, shape (m, f, a, f, a)."""
    E = np.einsum("t,tif,tig->fg", e.angles.weights, e.angles.E, e.angles.E)
    section = np.swapaxes(e.shape, 0, 1) @ ((e.weights * density)[..., None] * e.shape)
    return np.asarray(np.einsum("fg,mab->mfagb", E, section))


def pressure_stiffness(e: Elements, v: Array) -> Array:
    """Return the integral of v dp dp, shape (m, n c, n c), for weighted values v (m, q t)."""
    C, M = e.angles.C, e.pressure_shape
    m, q = e.weights.shape
    n, c = C.shape[1], M.shape[1]
    H = v.reshape(m * q, -1) @ (C[:, :, None] * C[:, None, :]).reshape(-1, n * n)
    products = (M[:, :, None] * M[:, None, :]).reshape(q, c * c)
    K = np.swapaxes(H.reshape(m, q, n * n), 1, 2) @ products
    return np.ascontiguousarray(np.swapaxes(K.reshape(m, n, n, c, c), 2, 3)).reshape(m, n * c, n * c)
