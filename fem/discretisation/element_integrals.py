"""Integrals over a range of elements: displacement gradients, forces, stiffness and mass, in batches of arrays.

Integrands are passed at the integration points, already multiplied by the weights of these points. A batch is the m
elements of a slice, with q points on the mesh and t angles each. The unknowns of an element are ordered with the
fields first: displacements (f, a), then pressures (n, c). `fem.discretisation.elements` defines D, V, E and C.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fem import material
from fem.discretisation.elements import Elements
from fem.discretisation.overstress import Overstress
from geometry.arrays import Array, Ints


def integrate(
    e: Elements,
    parts: Sequence[slice],
    strains: Sequence[material.Strain],
    law: material.Law,
    moduli: tuple[Array, Array],
    p: Array,
    viscous: Overstress | None = None,
    *,
    tangent: bool,
) -> tuple[float, Array, Array, Array, Array]:
    """Return energy, forces (m, f a), volumes (m, n c), and pieces of stiffness and coupling, of all elements.

    Parameters
    ----------
    parts, strains : batches and the strains at their points.
    moduli : shear moduli and inverse bulk moduli, (m, 1) each.
    p : (m, c, n) pressures at the corners.
    viscous : what a time step adds to the law; default: nothing.
    tangent : if not, the pieces are empty.
    """
    fu, fp = np.empty((len(p), e.angles.fields * e.cells.shape[1])), np.empty((len(p), p[0].size))
    Kuu, Kup, energy = [np.empty(0)], [np.empty(0)], 0.0
    for part, strain in zip(parts, strains, strict=True):
        k = material.kinematics(strain, e.angles.components, tangent=tangent)
        pressures, w, mu, soft = pressure(e, part, p), volumes(e, part), moduli[0][part], moduli[1][part]
        # laws are linear in modulus and pressure: weighting these two is cheaper than weighting the tensors
        W, P, A = law(k, w * mu if viscous is None else w * (viscous.factor * mu), w * pressures)
        if viscous is not None:
            viscous.part(part).add(k, mu, w, W, P, A)
        energy += float(W.sum() - np.vdot(w * pressures * soft, pressures) / 2)
        fu[part] = displacement_forces(e, part, P)
        fp[part] = pressure_forces(e, part, w * (k.Jm1 - pressures * soft))
        if tangent:
            Kuu.append(displacement_stiffness(e, part, A))
            Kup.append(coupling(e, part, w * material.cofactor(k)))
    if not tangent:
        return energy, fu, fp, Kuu[0], Kup[0]
    return energy, fu, fp, np.concatenate(Kuu[1:]), np.concatenate(Kup[1:])


def material_stiffness(e: Elements, part: slice, u: Array, law: material.Law, mu: Array) -> Array:
    """Return the pieces of the stiffness of the isochoric law alone, without its geometric part.

    With the second Piola stress S of the law, dP_iJ/dF_kL = delta_ik S_JL + F_iM F_kN dS_MJ/dE_NL. The first term
    turns a stress with the material (geometric stiffness); the second one is returned. Pressures do not contribute.

    Parameters
    ----------
    u : nodal fields (n, fields).
    mu : shear moduli (m, 1) of the batch.
    """
    k = material.kinematics(material.strain(gradient(e, part, u)), e.angles.components)
    _, P, A = law(k, volumes(e, part) * mu, 0.0)
    S = np.einsum("iJ...,iL...->JL...", k.H, P)
    i, J = np.divmod(e.components, 3)
    A -= (i[:, None] == i)[..., None, None] * S[J[:, None], J]
    return displacement_stiffness(e, part, A)


def gradient(e: Elements, part: slice, u: Array) -> Array:
    """Return the displacement gradients G, shape (3, 3, m, q t), of nodal fields u (n, fields)."""
    D, V = e.D[part], e.angles.V
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    if e.B is not None:
        G = np.zeros((9, m, q))
        nodal = u.ravel()[e.places[part], None]
        G[e.components] = (e.B[part].reshape(m, -1, f * a) @ nodal).reshape(m, q, -1).transpose(2, 0, 1)
        return G.reshape(3, 3, m, q)
    g = (D.reshape(m, 3 * q, a) @ u[e.cells[part]]).reshape(m * q, 3, f)
    G = np.empty((3, 3, m * q, t))
    for J in range(3):
        G[:, J] = (g[:, J] @ V[:, :, J].reshape(3 * t, f).T).reshape(m * q, t, 3).transpose(2, 0, 1)
    return G.reshape(3, 3, m, q * t)


def pressure(e: Elements, part: slice, p: Array) -> Array:
    """Return the pressures at the points, shape (m, q t), from those at the corners (m, dim + 1, n)."""
    return np.asarray((e.pressure_shape @ p[part] @ e.angles.C.T).reshape(len(p[part]), -1))


def volumes(e: Elements, part: slice) -> Array:
    """Return the weights of the integration points, shape (m, q t)."""
    return np.asarray((e.weights[part][..., None] * e.angles.weights).reshape(len(e.weights[part]), -1))


def displacement_forces(e: Elements, part: slice, P: Array) -> Array:
    """Return the integral of P : dG/du, shape (m, f a), for weighted stresses P (3, 3, m, q t)."""
    D, V = e.D[part], e.angles.V
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    if e.B is not None:
        return np.asarray((_nonzero_components(e, P).reshape(m, 1, -1) @ e.B[part].reshape(m, -1, f * a))[:, 0])
    s = np.stack([_flatten_points(P[:, J], t) @ _flatten_fields(V[:, :, J]) for J in range(3)], axis=1)
    return np.asarray((np.swapaxes(s.reshape(m, 3 * q, f), 1, 2) @ D.reshape(m, 3 * q, a)).reshape(m, f * a))


def pressure_forces(e: Elements, part: slice, v: Array) -> Array:
    """Return the integral of v dp, shape (m, n c), for weighted values v (m, q t)."""
    m, q = e.weights[part].shape
    along = np.swapaxes(v.reshape(m, q, -1) @ e.angles.C, 1, 2)
    return np.asarray((along @ e.pressure_shape).reshape(m, -1))


def _nonzero_components(e: Elements, T: Array) -> Array:
    """Return the components of tensors (3, 3, m, q) that can differ from zero, shape (m, q, c)."""
    return T.reshape(9, *T.shape[2:])[e.components].transpose(1, 2, 0)


def _flatten_points(T: Array, t: int) -> Array:
    """Reshape vectors (3, m, q t) to one row per point of the mesh, shape (m q, 3 t)."""
    return T.reshape(3, -1, t).transpose(1, 0, 2).reshape(-1, 3 * t)


def _flatten_fields(V: Array) -> Array:
    """Reshape functions of the angle (t, 3, ...) to the row order of `_flatten_points`, shape (3 t, f)."""
    return np.swapaxes(V, 0, 1).reshape(3 * len(V), -1)


def displacement_stiffness(e: Elements, part: slice, A: Array) -> Array:
    """Return the integral of dG/du : A : dG/du, in pieces (m, s, k, k).

    A holds the weighted tangents (9, 9, m, q t), or (c, c, m, q) where few components of G differ from zero.

    With all components there is one piece (a, a) for each pair of fields in `e.angles.pairs`; the other pairs follow
    from the symmetry of A. With few components there is one piece of all fields, (f a, f a). The integral over the
    angles comes first and gives H_JL for each pair of derivatives; the integral over the section follows, K = sum D_J
    D_L H_JL. A solid has no angles to integrate over.
    """
    m, q, _, a = e.D[part].shape
    t, f = len(e.angles.theta), e.angles.fields
    if e.B is not None:
        B, A = e.B[part], np.ascontiguousarray(A.transpose(2, 3, 0, 1))
        return np.asarray(np.swapaxes(B.reshape(m, -1, f * a), 1, 2) @ (A @ B).reshape(m, -1, f * a))[:, None]
    if e.dim == 3:
        return _solid_stiffness(e.D[part], A)
    A, D, done = A.reshape(3, 3, 3, 3, m * q, t), e.D_products[part], 0
    # matrix products over long axes replace one einsum; components that a family does not carry are skipped
    K = np.empty((m, sum(len(pairs.first) for pairs in e.angles.pairs), a * a))
    for pairs in e.angles.pairs:
        s = len(pairs.first)
        H = np.empty((m * q, 3, 3, s))
        for J, L in np.ndindex(3, 3):
            tangents = A[pairs.i, J, pairs.k, L].transpose(2, 0, 1, 3).reshape(m * q, -1)
            np.matmul(tangents, pairs.products[J, L], out=H[:, J, L])
        np.matmul(np.swapaxes(H.reshape(m, 9 * q, s), 1, 2), D, out=K[:, done : done + s])
        done += s
    return K.reshape(m, -1, a, a)


def _solid_stiffness(D: Array, A: Array) -> Array:
    """Return the pieces K_ik, i <= k, of a solid: T_iJk = sum_L A_iJkL D_L at each point, K_ik = sum D_J T_iJk."""
    m, q, _, a = D.shape
    A = np.ascontiguousarray(A.reshape(81, m * q).T).reshape(m * q, 27, 3)
    T = (A @ D.reshape(m * q, 3, a)).reshape(m, q, 3, 3, 3, a)
    D = np.swapaxes(D.reshape(m, 3 * q, a), 1, 2)
    rows = [(D @ T[:, :, i, :, i:].reshape(m, 3 * q, -1)).reshape(m, a, -1, a) for i in range(3)]
    return np.concatenate([np.swapaxes(row, 1, 2) for row in rows], axis=1)


def join_pieces(e: Elements, K: Array) -> Array:
    """Return the symmetric element matrices (m, f a, f a) that are given in pieces (m, s, k, k)."""
    if e.B is not None:
        return K[:, 0]
    (m, _, a, _), n, done = K.shape, e.angles.fields, 0
    full = np.empty((m, n, a, n, a))
    for pairs in e.angles.pairs:
        for f, g in zip(pairs.first, pairs.second, strict=True):
            full[:, f, :, g], full[:, g, :, f] = K[:, done], np.swapaxes(K[:, done], 1, 2)
            done += 1
    return full.reshape(m, n * a, n * a)


def coupling(e: Elements, part: slice, B: Array) -> Array:
    """Return the integral of B : dG/du dp, shape (m, f, n, a, c), for weighted dP/dp = B (3, 3, m, q t)."""
    D, V, C, M = e.D[part], e.angles.V, e.angles.C, e.pressure_shape
    m, q, _, a = D.shape
    t, f = len(V), V.shape[-1]
    n, c = C.shape[1], M.shape[1]
    if e.B is not None:
        own = (_nonzero_components(e, B)[..., None] * M[:, None]).reshape(m, -1, c)
        return np.asarray(np.swapaxes(e.B[part].reshape(m, -1, f * a), 1, 2) @ own).reshape(m, f, 1, a, c)
    H = np.empty((m * q, 3, f * n))
    for J in range(3):
        H[:, J] = _flatten_points(B[:, J], t) @ _flatten_fields(np.einsum("tif,tn->tifn", V[:, :, J], C))
    products = (D[..., :, None] * M[:, None, None, :]).reshape(m, 3 * q, a * c)
    K = np.swapaxes(H.reshape(m, 3 * q, f * n), 1, 2) @ products
    return np.asarray(K.reshape(m, f, n, a, c))


def mass(e: Elements, part: slice, density: Array) -> Array:
    """Return the integral of density du . du for densities (m,), in the pieces of `displacement_stiffness`."""
    E = np.einsum("t,tif,tig->fg", e.angles.weights, e.angles.E, e.angles.E)
    section = np.swapaxes(e.shape, 0, 1) @ ((e.weights[part] * density[:, None])[..., None] * e.shape)
    if e.B is not None:
        m, a, _ = section.shape
        return np.asarray(np.einsum("fg,mab->mfagb", E, section).reshape(m, 1, len(E) * a, len(E) * a))
    own = np.concatenate([E[pairs.first, pairs.second] for pairs in e.angles.pairs])
    return np.asarray(own[:, None, None] * section[:, None])


def pressure_stiffness(e: Elements, part: slice, v: Array) -> Array:
    """Return the integral of v dp dp, shape (m, n c, n c), for weighted values v (m, q t)."""
    C, M = e.angles.C, e.pressure_shape
    m, q = e.weights[part].shape
    n, c = C.shape[1], M.shape[1]
    H = v.reshape(m * q, -1) @ (C[:, :, None] * C[:, None, :]).reshape(-1, n * n)
    products = (M[:, :, None] * M[:, None, :]).reshape(q, c * c)
    K = np.swapaxes(H.reshape(m, q, n * n), 1, 2) @ products
    return np.ascontiguousarray(np.swapaxes(K.reshape(m, n, n, c, c), 2, 3)).reshape(m, n * c, n * c)


def sum_entries(places: Ints, values: Array, shape: tuple[int, ...]) -> Array:
    """Return an array of a shape with values added at places, numbers in the flat array."""
    total = np.bincount(places.ravel(), weights=values.ravel(), minlength=math.prod(shape))
    return np.asarray(total.reshape(shape), dtype=np.float64)
