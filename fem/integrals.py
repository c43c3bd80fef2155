"""Integrals over a range of elements: displacement gradients, forces, stiffness and mass, in batches of arrays.

What is integrated is given at the points of integration, already times their weights; these are the m elements of a
slice with q points in the mesh and t angles each. An element's unknowns have the fields first, (f, a), then come its
pressures, (n, c). See `fem.elements` for D, V, E and C.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem.elements import Elements

Array = NDArray[np.float64]


def gradient(e: Elements, part: slice, u: Array) -> Array:
    """Displacement gradients G, shape (m, q t, 3, 3), of nodal fields (n, fields)."""
    D, V = e.D[part], e.angles.V
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    if e.B is not None:
        few = np.zeros((m, q, 9))
        own = np.swapaxes(u[e.cells[part]], 1, 2).reshape(m, -1, 1)
        few[..., e.angles.components] = (e.B[part].reshape(m, -1, f * a) @ own).reshape(m, q, -1)
        return few.reshape(m, q, 3, 3)
    g = (D.reshape(m, 3 * q, a) @ u[e.cells[part]]).reshape(m * q, 3, f)
    G = np.empty((m * q, t, 3, 3))
    for J in range(3):
        G[..., J] = (g[:, J] @ V[:, :, J].reshape(3 * t, f).T).reshape(m * q, t, 3)
    return G.reshape(m, q * t, 3, 3)


def pressure(e: Elements, part: slice, p: Array) -> Array:
    """Pressures, shape (m, q t), of those at the corners of the elements (m, dim + 1, n)."""
    return np.asarray((e.pressure_shape @ p[part] @ e.angles.C.T).reshape(len(p[part]), -1))


def volumes(e: Elements, part: slice) -> Array:
    """Weights of the integration points, shape (m, q t)."""
    return np.asarray((e.weights[part][..., None] * e.angles.weights).reshape(len(e.weights[part]), -1))


def displacement_forces(e: Elements, part: slice, P: Array) -> Array:
    """Integral of P : dG/du, shape (m, f a), for weighted stresses P (m, q t, 3, 3)."""
    D, V = e.D[part], e.angles.V
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    if e.B is not None:
        few = P.reshape(m, q, 9)[..., e.angles.components].reshape(m, 1, -1)
        return np.asarray((few @ e.B[part].reshape(m, -1, f * a))[:, 0])
    P = P.reshape(m * q, t, 3, 3)
    s = np.stack([P[..., J].reshape(m * q, 3 * t) @ V[:, :, J].reshape(3 * t, f) for J in range(3)], axis=1)
    return np.asarray((np.swapaxes(s.reshape(m, 3 * q, f), 1, 2) @ D.reshape(m, 3 * q, a)).reshape(m, f * a))


def pressure_forces(e: Elements, part: slice, v: Array) -> Array:
    """Integral of v dp, shape (m, n c), for weighted values v (m, q t)."""
    m, q = e.weights[part].shape
    along = np.swapaxes(v.reshape(m, q, -1) @ e.angles.C, 1, 2)
    return np.asarray((along @ e.pressure_shape).reshape(m, -1))


def displacement_stiffness(e: Elements, part: slice, A: Array) -> Array:
    """Integral of dG/du : A : dG/du, shape (m, f a, f a), for weighted tangents A (m, q t, 9, 9) or (m, q, c, c).

    First over the angles, H_JL of the derivatives of the fields, then over the section: K = sum D_J D_L H_JL. Both
    are done for one pair of families of fields after the other.
    """
    D = e.D[part]
    m, q, _, a = D.shape
    t, f = len(e.angles.theta), e.angles.fields
    if e.B is not None:
        B = e.B[part]
        return np.asarray(np.swapaxes(B.reshape(m, -1, f * a), 1, 2) @ (A @ B).reshape(m, -1, f * a))
    A = A.reshape(m * q, t, 3, 3, 3, 3)
    products = (D[:, :, :, None, :, None] * D[:, :, None, :, None, :]).reshape(m, 9 * q, a * a)
    K = np.empty((m, f, a, f, a))
    for (first, i), (second, k), pairs in e.angles.pairs:
        n, o = first.stop - first.start, second.stop - second.start
        H = np.empty((m * q, 3, 3, n, o))
        for (J, L), pair in pairs.items():
            own = A[:, :, i, J, k, L].transpose(0, 2, 3, 1).reshape(m * q, -1) @ pair
            H[:, J, L] = own.reshape(-1, n, o)
            if first == second and J != L:
                H[:, L, J] = np.swapaxes(H[:, J, L], 1, 2)
        block = (np.swapaxes(H.reshape(m, 9 * q, n * o), 1, 2) @ products).reshape(m, n, o, a, a)
        K[:, first, :, second] = block.transpose(0, 1, 3, 2, 4)
        if first != second:
            K[:, second, :, first] = block.transpose(0, 2, 4, 1, 3)
    return K.reshape(m, f * a, f * a)


def coupling(e: Elements, part: slice, B: Array) -> Array:
    """Integral of B : dG/du dp, shape (m, f a, n c), for weighted derivatives dP/dp = B (m, q t, 3, 3)."""
    D, V, C, M = e.D[part], e.angles.V, e.angles.C, e.pressure_shape
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    n, c = C.shape[1], M.shape[1]
    if e.B is not None:
        few = B.reshape(m, q, 1, 9)[..., e.angles.components]
        return np.asarray(np.swapaxes((few @ e.B[part])[:, :, 0], 1, 2) @ M)
    B = B.reshape(m * q, t, 3, 3)
    H = np.empty((m * q, 3, f * n))
    for J in range(3):
        H[:, J] = B[..., J].reshape(m * q, 3 * t) @ np.einsum("tif,tn->tifn", V[:, :, J], C).reshape(3 * t, f * n)
    products = (D[..., :, None] * M[:, None, None, :]).reshape(m, 3 * q, a * c)
    K = np.swapaxes(H.reshape(m, 3 * q, f * n), 1, 2) @ products
    return np.ascontiguousarray(K.reshape(m, f, n, a, c).transpose(0, 1, 3, 2, 4)).reshape(m, f * a, n * c)


def mass(e: Elements, part: slice, density: Array) -> Array:
    """Integral of density du . du, shape (m, f a, f a), for densities (m,)."""
    m, _, _, a = e.D[part].shape
    f = e.angles.fields
    E = np.einsum("t,tif,tig->fg", e.angles.weights, e.angles.E, e.angles.E)
    section = np.swapaxes(e.shape, 0, 1) @ ((e.weights[part] * density[:, None])[..., None] * e.shape)
    return np.asarray(np.einsum("fg,mab->mfagb", E, section).reshape(m, f * a, f * a))


def pressure_stiffness(e: Elements, part: slice, v: Array) -> Array:
    """Integral of v dp dp, shape (m, n c, n c), for weighted values v (m, q t)."""
    C, M = e.angles.C, e.pressure_shape
    m, q = e.weights[part].shape
    n, c = C.shape[1], M.shape[1]
    H = v.reshape(m * q, -1) @ (C[:, :, None] * C[:, None, :]).reshape(-1, n * n)
    products = (M[:, :, None] * M[:, None, :]).reshape(q, c * c)
    K = np.swapaxes(H.reshape(m, q, n * n), 1, 2) @ products
    return np.ascontiguousarray(np.swapaxes(K.reshape(m, n, n, c, c), 2, 3)).reshape(m, n * c, n * c)
