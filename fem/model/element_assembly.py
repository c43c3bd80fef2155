"""Integrals over the elements: forces, volumes and stiffness with the law, and matrices without it.

With V, C, D and M of `fem.model.elements`, displacement gradients and pressures at the points are

    G_iJ = sum_f V_iJf g_Jf,    g_Jf = sum_a D_Ja u_af,        p = sum_n C_n sum_c M_c p_cn.

Integrals over the angles come first and those over the section follow. With the weights w in stresses P and tangents
A of the law, F = 1 + G and J = det F, the forces r_af, volumes v_cn, stiffness K and coupling B of an element are

    r_af = sum_J D_Ja S_Jf,           S_Jf = sum_t V_iJf P_iJ,
    v_cn = sum M_c q_n,               q_n = sum_t C_n w (J - 1 - p / K),
    K_af,bg = sum_JL D_Ja H_JL,fg D_Lb,     H_JL,fg = sum_t V_iJf A_iJkL V_kLg,
    B_af,cn = sum_J D_Ja Y_J,fn M_c,        Y_J,fn = sum_t w V_iJf cof(F)_iJ C_n.

Loops that numba compiles lead from the nodes to the strains and pressures that the law needs, and from its stresses
and tangents to the nodes and the sparse matrix. The innermost ones run along elements or points, as those of the law
do: the processor then works on four to eight of them at once.

A batch is the m elements of a slice, with q points on the mesh and t angles each; n = q m. Arrays over its points
have the shape (..., t n): angle by angle, and for each of them point by point.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.model.elements import Elements
from fem.model.material import Law, kinematics
from fem.model.sparse_pattern import Pattern, Places
from fem.model.viscoelasticity import Overstress
from geometry.arrays import Array, Ints
from geometry.compiled import compiled

BATCH = 2048
"""Integration points and angles in a batch: few enough for the processor's cache, many enough for its vectors."""
ELEMENTS, PRESSURES, MAGNET, MAGNET_PRESSURES, COMPLIANCE, MOTION, FACETS = range(7)
"""Groups of matrices in the pattern: elements, and their coupling with the pressures; elements at the magnet with its
motion, and this with their pressures; pressures; motion of the magnet; facets of the skin."""


def mass(e: Elements, density: float) -> Array:
    """Return the integral of density du . du, shape (m, f, a, f, a)."""
    E = np.einsum("t,tif,tig->fg", e.angles.weights, e.angles.E, e.angles.E)
    meridian = np.swapaxes(e.shape, 0, 1) @ ((e.weights * density)[..., None] * e.shape)
    return np.asarray(np.einsum("fg,mab->mfagb", E, meridian))


def pressure_stiffness(e: Elements, inverse_K: Array) -> Array:
    """Return the integral of -dp dp / K, shape (m, c, n, c, n), for inverse bulk moduli (m, 1)."""
    C, M = e.angles.C, e.pressure_shape
    meridian = np.swapaxes(M, 0, 1) @ ((e.weights * inverse_K)[..., None] * M)
    return -np.einsum("ns,mcd->mcnds", C.T @ (e.angles.weights[:, None] * C), meridian)


@dataclass(frozen=True, slots=True)
class _Batch:
    """Some elements, and the strains at their points in the last state.

    part, near : which elements; and how many of them touch the magnet, the last ones.
    nodes : (a, m) and (c, m) nodes and rows of the pressures.
    shapes : (a, 3, q, m) D and (q, c) M.
    places : positions of volumes (n, c, m) in those of the corners, and of coupling (m, a, c, f n) and stiffness (m,
        a, a, pairs) in the tangent; -1 of what is not added.
    mu, w, modulus, soft : (t n,) shear moduli, weights, weighted shear moduli, and weights over bulk moduli.
    strain : displacement gradients (9, t n), J - 1 (t n,), and F^-T - 1 (9, t n).
    """

    part: slice
    near: int
    nodes: tuple[Ints, Ints]
    shapes: tuple[Array, Array]
    places: tuple[Places, Places, Places]
    mu: Array
    w: Array
    modulus: Array
    soft: Array
    strain: tuple[Array, Array, Array]

    def agrees(self, pressure: Array) -> bool:
        """Return whether strains and pressures (t n,) of two angles are equal."""
        return all(bool((a == b).all()) for a, b in (np.split(x, 2, axis=-1) for x in (self.strain[0], pressure)))


class ElementAssembly:
    """Forces, volumes and stiffness of the elements of one system.

    mu, inverse_K : (m, 1) moduli of the elements.
    corners : (m, c) rows of the pressures.
    numbers : numbers of the unknown displacements (nodes, f), pressures (corners, n) and motion of the magnet (1, r);
        -1 where eliminated.
    pattern : sparse pattern with the groups above.
    inner : number of elements that do not touch the magnet; they come first.
    """

    def __init__(
        self,
        elements: Elements,
        law: Law,
        mu: Array,
        inverse_K: Array,
        corners: Ints,
        numbers: tuple[Ints, Ints, Ints],
        pattern: Pattern,
        inner: int,
    ) -> None:
        e, a = elements, elements.angles
        self._elements, self._law, self._inner, self._entries = e, law, inner, pattern.entries
        # (3, f, 3, t) gradients of the fields, direction J first, and (3, f n, 3, t) times the pressures' functions
        V, VC = a.V.transpose(2, 3, 1, 0), np.einsum("tiJf,tn->Jfnit", a.V, a.C)
        self._V, self._VC = np.ascontiguousarray(V), np.ascontiguousarray(VC).reshape(3, -1, 3, len(a.V))
        self._C, self._pairs = a.C, a.pairs
        of_cells = numbers[0][e.cells], numbers[1][corners]
        self._batches = [
            self._cut(slice(*ends), corners, mu, inverse_K, self._tangent_places(slice(*ends), *of_cells, pattern))
            for ends in cut_batches(e)
        ]
        self._magnet_places = _places_at_magnet(of_cells[0][inner:], of_cells[1][inner:], numbers[2], pattern)
        self._strained: tuple[Array, float] | None = None
        self._at_rest: tuple[float, Array, Array, Array] | None = None
        self._constant = np.zeros(pattern.entries)
        compliance = pattern.block_places(COMPLIANCE, of_cells[1])
        add_at(pressure_stiffness(e, inverse_K).ravel(), compliance.ravel(), self._constant)

    def _tangent_places(self, part: slice, u: Ints, p: Ints, pattern: Pattern) -> list[Places]:
        """Return places in the tangent, see `_Batch`, for the unknowns (m, a, f) and (m, c, n) of all elements."""
        u, p, (first, second), nodes = u[part], p[part], self._pairs.fields, np.arange(u.shape[1])
        coupling = pattern.places(PRESSURES, u[:, :, None, :, None], p[:, None, :, None, :], part)
        coupling = coupling.reshape(*coupling.shape[:3], -1)
        stiffness = pattern.places(ELEMENTS, u[:, :, None, first], u[:, None, :, second], part)
        # of one field, the entry of two nodes is that of the nodes in the other order too
        stiffness[:, (nodes[:, None, None] > nodes[:, None]) & (first == second)] = -1
        return [coupling, stiffness]

    def _cut(self, part: slice, corners: Ints, mu: Array, inverse_K: Array, in_tangent: list[Places]) -> _Batch:
        e, repeated = self._elements, self._elements.weights.shape[1] * len(self._C)
        w = np.outer(e.angles.weights, e.weights[part].T).ravel()
        shear, soft = (np.tile(values[part, 0], repeated) for values in (mu, inverse_K))
        count, columns = self._C.shape[1], np.ascontiguousarray(corners[part].T)
        volumes = (count * columns + np.arange(count)[:, None, None]).astype(np.int32)
        return _Batch(
            part,
            max(part.stop - max(part.start, self._inner), 0),
            (np.ascontiguousarray(e.cells[part].T), columns),
            (np.ascontiguousarray(e.D[part].transpose(3, 2, 1, 0)), e.pressure_shape),
            (volumes, *in_tangent),
            shear,
            w,
            w * shear,
            w * soft,
            (np.empty((9, len(w))), np.empty(len(w)), np.empty((9, len(w)))),
        )

    def least_volume_change(self, u: Array) -> float:
        """Return the least J - 1 at the integration points of displacements u, read-only; nan where any is nan."""
        if self._strained is None or self._strained[0] is not u:
            self._strained = None  # until all batches have the strains of u
            for b in self._batches:
                D, G = b.shapes[0], b.strain[0]
                write_gradients(u, b.nodes[0], D, self._V, G.reshape(3, 3, len(self._C), *D.shape[2:]))
                kinematics(*b.strain)
            self._strained = u, float(np.min([b.strain[1].min() for b in self._batches]))
        return self._strained[1]

    def assemble(
        self, u: Array, p: Array, T: Array, viscous: Overstress | None = None, *, tangent: bool
    ) -> tuple[float, Array, Array, Array]:
        """Return energy, nodal forces (nodes, f), volumes (corners, n), and entries (nnz,) of the tangent, or none.

        u, p : nodal displacements and pressures, read-only.
        T : (nodes, f, r) derivative of the displacements by the magnet's motion.
        viscous : what a time step adds to the law; default: nothing.
        """
        # every press of a list begins at rest
        if not tangent or viscous is not None or u.any() or p.any():
            return self._assemble(u, p, T, viscous, tangent=tangent)
        if self._at_rest is None:
            self._at_rest = self._assemble(u, p, T, None, tangent=True)
        energy, *arrays = self._at_rest
        forces, volumes, data = (array.copy() for array in arrays)
        return energy, forces, volumes, data

    def _assemble(
        self, u: Array, p: Array, T: Array, viscous: Overstress | None, *, tangent: bool
    ) -> tuple[float, Array, Array, Array]:
        self.least_volume_change(u)
        energy, forces, volumes, C = 0.0, np.zeros(u.shape), np.zeros(p.shape), self._C
        data, coupling, stiffness = self._constant.copy() if tangent else np.empty(0), [], []
        for batch in self._batches:
            (nodes, corners), (D, M) = batch.nodes, batch.shapes
            nodal = p.take(corners, axis=0).reshape(len(corners), -1)
            pressure = (C @ (M @ nodal).reshape(-1, p.shape[1]).T).ravel()
            # about an axisymmetric state both angles of a model of one order have one law
            once = self._elements.angles.of_one_order and viscous is None and batch.agrees(pressure)
            W, P, A = self._stresses(batch, pressure, viscous, tangent=tangent, share=2 if once else 1)
            energy += float(W.sum()) * (len(pressure) // len(W)) - float(np.vdot(batch.soft * pressure, pressure)) / 2
            change = batch.w * batch.strain[1] - batch.soft * pressure
            of_corners = M.T @ (C.T @ change.reshape(len(C), -1)).reshape(-1, len(M), corners.shape[1])
            add_at(of_corners.ravel(), batch.places[0].ravel(), volumes.ravel())
            add_forces(nodes, D, P, self._V, forces)
            if tangent:
                wJ = batch.w * (1 + batch.strain[1])
                cofactor = batch.strain[2] * wJ
                cofactor[::4] += wJ
                B = integrate_coupling(D, M, cofactor, self._VC)
                add_matrices(B, batch.places[1], data)
                coupling.append(B[..., B.shape[-1] - batch.near :])
                stiffness.append(self._add_stiffness(batch, A, data))
        if tangent:
            self._add_magnet(stiffness, coupling, T, data)
        return energy, forces, volumes, data

    def _stresses(
        self, batch: _Batch, pressure: Array, viscous: Overstress | None, *, tangent: bool, share: int = 1
    ) -> tuple[Array, Array, Array]:
        """Return energies (t n,), stresses (9, t n) and tangents (9, 9, t n), times the weights, of a batch.

        share : 2 for those of the first of two angles.
        """
        points = len(pressure) // share
        G, Jm1, Hm1 = (np.ascontiguousarray(x[..., :points]) for x in batch.strain)
        w, modulus = batch.w[:points], batch.modulus[:points]
        if viscous is not None:
            modulus = modulus * viscous.factor
        W, P, A = np.empty(points), np.empty((9, points)), np.empty((9, 9, points * tangent))
        self._law((G, Jm1, Hm1), modulus, w * pressure[:points], (W, P, A))
        if viscous is not None:
            viscous.part(batch.part).add(G, Jm1, batch.mu, w, W, P, A)
        return W, P, A

    def _add_stiffness(self, batch: _Batch, A: Array, data: Array) -> Array:
        """Add the stiffness of a batch, and return that of its elements at the magnet (a, a, pairs, near).

        A : (9, 9, t n) tangents times the weights, or (9, 9, n) where all angles agree.
        """
        D, n, at = batch.shapes[0], len(batch.w) // len(self._C), 0
        H, A = np.empty((9, self._pairs.fields.shape[1], n)), A.reshape(3, 3, 3, 3, -1, n)
        for i, k, products in self._pairs.groups:
            _, count, first, second, _ = products.shape
            rows = A[i : i + first, :, k : k + second].transpose(1, 3, 0, 2, 4, 5).reshape(9, -1, n)
            shares = products if A.shape[4] == len(self._C) else products.sum(axis=-1)
            np.matmul(shares.reshape(9, count, -1), rows, out=H[:, at : at + count])
            at += count
        H = H.reshape(3, 3, -1, *D.shape[2:])
        K = integrate_stiffness(D, H, self._pairs.fields)
        add_matrices(K, batch.places[2], data)
        return np.asarray(K[..., K.shape[-1] - batch.near :])

    def _add_magnet(self, stiffness: Sequence[Array], coupling: Sequence[Array], T: Array, data: Array) -> None:
        """Add to the tangent what elements at the magnet give to its motion.

        stiffness, coupling : (a, a, pairs, k) and (a, c, f n, k) of k elements, batch by batch; no coupling: none.
        """
        f, r = T.shape[1:]
        if not r:
            return
        cells, (with_u, with_p, alone) = self._elements.cells[self._inner :], self._magnet_places
        (k, a), (first, second), K = cells.shape, self._pairs.fields, np.zeros((*cells.shape, f, *cells.shape[1:], f))
        of_pairs = np.concatenate(stiffness, axis=-1)
        K[:, :, first, :, second], K[:, :, second, :, first] = (
            of_pairs.transpose(2, 3, 0, 1),
            of_pairs.transpose(2, 3, 1, 0),
        )
        slopes = T[cells].reshape(k, a * f, r)
        by_motion = K.reshape(k, a * f, a * f) @ slopes
        add_at(by_motion.ravel(), with_u, data)
        add_at((slopes.reshape(-1, r).T @ by_motion.reshape(-1, r)).ravel(), alone, data)
        if coupling:
            B = np.concatenate(coupling, axis=-1).reshape(a, -1, f, self._C.shape[1], k)
            along = slopes.swapaxes(1, 2) @ B.transpose(4, 0, 2, 1, 3).reshape(k, a * f, -1)
            add_at(along.ravel(), with_p, data)

    def add_motion(self, matrix: Array, data: Array) -> None:
        """Add a symmetric matrix (r, r) of the magnet's motion to entries of the tangent."""
        add_at(matrix.ravel(), self._magnet_places[2], data)

    def assemble_displacements(self, matrices: Array, T: Array) -> Array:
        """Return the entries (nnz,) of element matrices (m, f, a, f, a) without pressures."""
        data, (first, second) = np.zeros(self._entries), self._pairs.fields
        stiffness = matrices[:, first, :, second].transpose(2, 3, 0, 1)
        for batch in self._batches:
            add_matrices(np.ascontiguousarray(stiffness[..., batch.part]), batch.places[2], data)
        self._add_magnet([stiffness[..., self._inner :]], [], T, data)
        return data

    def assemble_relaxing(self, u: Array, T: Array) -> Array:
        """Return the entries (nnz,) of `System.relaxing_stiffness` for displacements u, read-only."""
        self.least_volume_change(u)
        data, stiffness = np.zeros(self._entries), []
        for batch in self._batches:
            _, P, A = self._stresses(batch, np.zeros(len(batch.w)), None, tangent=True)
            H = batch.strain[2].reshape(3, 3, -1) + np.eye(3)[..., None]
            S = np.einsum("iJn,iLn->JLn", H, P.reshape(3, 3, -1))
            for i in range(0, 9, 3):
                A[i : i + 3, i : i + 3] -= S
            stiffness.append(self._add_stiffness(batch, A, data))
        self._add_magnet(stiffness, [], T, data)
        return data


def _places_at_magnet(u: Ints, p: Ints, motion: Ints, pattern: Pattern) -> tuple[Places, Places, Places]:
    """Return the places of couplings (m, a, f, r) and (m, r, c, n) with the motion, and (r, r) of its own, in rows.

    u, p, motion : unknowns (m, a, f), (m, c, n) and (1, r).
    """
    with_u = pattern.places(MAGNET, u[:, :, None, :, None], motion)
    with_p = pattern.places(MAGNET_PRESSURES, motion[0, :, None], p[:, None, :, None])[:, 0].swapaxes(1, 2)
    return with_u.ravel(), with_p.ravel(), pattern.block_places(MOTION, motion[None]).ravel()


def cut_batches(e: Elements) -> list[tuple[int, int]]:
    """Return where the batches of the elements begin and end; they are of nearly one size."""
    cuts = np.linspace(0, len(e.cells), -(-e.weights.size * len(e.angles.theta) // BATCH) + 1)
    return list(itertools.pairwise(cuts.astype(int).tolist()))


@compiled
def add_at(values, places, data):
    """Add values to the entries at their places; -1: nowhere."""
    for i in range(len(places)):
        if places[i] >= 0:
            data[places[i]] += values[i]


@compiled
def add_matrices(values, places, data):
    """Add the matrices (..., m) of elements to the entries at their places (m, ...); -1: nowhere.

    Element by element: the entries of one lie together, those of all are beyond the processor's cache.
    """
    values = values.reshape(-1, len(places))
    for cell in range(len(places)):
        here = places[cell].ravel()
        for i in range(len(here)):
            if here[i] >= 0:
                data[here[i]] += values[i, cell]


@compiled
def write_gradients(u, nodes, D, V, G):
    """Write the displacement gradients G (3, 3, t, q, m) of elements with nodes (a, m)."""
    (a, _, q, m), t = D.shape, V.shape[3]
    here, g = np.empty(m), np.empty((q, m))
    G[:] = 0.0
    for f in range(u.shape[1]):
        for J in range(3):
            g[:] = 0.0
            for node in range(a):
                for cell in range(m):
                    here[cell] = u[nodes[node, cell], f]
                for point in range(q):
                    for cell in range(m):
                        g[point, cell] += D[node, J, point, cell] * here[cell]
            for i in range(3):
                for angle in range(t):
                    c = V[J, f, i, angle]
                    if c != 0.0:
                        for point in range(q):
                            for cell in range(m):
                                G[i, J, angle, point, cell] += c * g[point, cell]


@compiled
def _add_angles(c, values, out):
    """Add to out (n,) the sum of values (t n,) times c (t,), or of values (n,) that all angles share."""
    n = len(out)
    for angle in range(len(c)):
        if c[angle] != 0.0:
            part = values[angle * n % len(values) :]
            for x in range(n):
                out[x] += c[angle] * part[x]


@compiled
def add_forces(nodes, D, P, V, forces):
    """Add the forces of weighted stresses P (9, t n), or (9, n) where all angles agree, to those of the nodes."""
    a, _, q, m = D.shape
    S, here = np.empty((3, q * m)), np.empty(m)
    X = S.reshape(3, q, m)
    for f in range(V.shape[1]):
        S[:] = 0.0
        for J in range(3):
            for i in range(3):
                _add_angles(V[J, f, i], P[3 * i + J], S[J])
        for node in range(a):
            here[:] = 0.0
            for J in range(3):
                for point in range(q):
                    for cell in range(m):
                        here[cell] += D[node, J, point, cell] * X[J, point, cell]
            for cell in range(m):
                forces[nodes[node, cell], f] += here[cell]


@compiled
def integrate_coupling(D, M, cofactor, VC):
    """Return the coupling B (a, c, f n, m) for weighted cofactors (9, t n)."""
    (a, _, q, m), c = D.shape, M.shape[1]
    B, Y, along = np.zeros((a, c, VC.shape[1], m)), np.empty((3, q * m)), np.empty((q, m))
    X = Y.reshape(3, q, m)
    for s in range(VC.shape[1]):
        Y[:] = 0.0
        for J in range(3):
            for i in range(3):
                _add_angles(VC[J, s, i], cofactor[3 * i + J], Y[J])
        for node in range(a):
            along[:] = 0.0
            for J in range(3):
                for point in range(q):
                    for cell in range(m):
                        along[point, cell] += D[node, J, point, cell] * X[J, point, cell]
            for corner in range(c):
                here = B[node, corner, s]
                for point in range(q):
                    for cell in range(m):
                        here[cell] += M[point, corner] * along[point, cell]
    return B


@compiled
def integrate_stiffness(D, H, fields):
    """Return the stiffness K (a, a, pairs, m) of H (3, 3, pairs, q, m)."""
    a, _, q, m = D.shape
    K, X = np.zeros((a, a, H.shape[2], m)), np.empty((3, q, m))
    for s in range(H.shape[2]):
        equal = fields[0, s] == fields[1, s]
        for second in range(a):
            for J in range(3):
                for point in range(q):
                    for cell in range(m):
                        X[J, point, cell] = (
                            H[J, 0, s, point, cell] * D[second, 0, point, cell]
                            + H[J, 1, s, point, cell] * D[second, 1, point, cell]
                            + H[J, 2, s, point, cell] * D[second, 2, point, cell]
                        )
            for first in range(second + 1 if equal else a):
                here = K[first, second, s]
                for point in range(q):
                    for cell in range(m):
                        here[cell] += (
                            D[first, 0, point, cell] * X[0, point, cell]
                            + D[first, 1, point, cell] * X[1, point, cell]
                            + D[first, 2, point, cell] * X[2, point, cell]
                        )
                if equal:
                    K[second, first, s] = here
    return K
