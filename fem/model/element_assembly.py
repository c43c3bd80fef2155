"""Integrals over the elements: forces, volumes and stiffness with the law, and matrices without it.

With V, C, D and M of `fem.model.elements`, displacement gradients and pressures at the points are

    G_iJ = sum_f V_iJf g_Jf,    g_Jf = sum_a D_Ja u_af,        p = sum_n C_n sum_c M_c p_cn.

Integrals over the angles come first and those over the section follow. With the weights w in stresses P and tangents
A of the law, F = 1 + G and J = det F, the forces r_af, volumes v_cn, stiffness K and coupling B of an element are

    r_af = sum_J D_Ja S_Jf,           S_Jf = sum_t V_iJf P_iJ,
    v_cn = sum M_c q_n,               q_n = sum_t C_n w (J - 1 - p / K),
    K_af,bg = sum_JL D_Ja H_JL,fg D_Lb,     H_JL,fg = sum_t V_iJf A_iJkL V_kLg,
    B_af,cn = sum_J D_Ja Y_J,fn M_c,        Y_J,fn = sum_t w V_iJf cof(F)_iJ C_n.

Sums over the angles are products of matrices. Loops that numba compiles read and write the nodes, integrate over the
section, and add to the sparse matrix.

A batch is the m elements of a slice, with q points on the mesh and t angles each; n = m q. Arrays over its points
have the shape (..., t, n).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from fem.model.elements import Elements
from fem.model.material import Law, kinematics
from fem.model.sparse_pattern import Pattern
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

    part : which elements.
    near, beside : those of them that touch the magnet, in all elements and in those at the magnet; empty without.
    mu : (t n,) shear moduli.
    w, modulus, soft : (t, n) weights, weighted shear moduli, and weights over bulk moduli.
    G, Jm1, Hm1 : (9, t, n) displacement gradients, (t, n) J - 1, and (9, t, n) F^-T - 1.
    """

    part: slice
    near: slice
    beside: slice
    mu: Array
    w: Array
    modulus: Array
    soft: Array
    G: Array
    Jm1: Array
    Hm1: Array

    def agrees(self, pressure: Array) -> bool:
        """Return whether strains and pressures (t, n) are those of the first angle at all angles."""
        return bool((self.G[:, :1] == self.G).all() and (pressure == pressure[:1]).all())

    def along(self, values: Array) -> Array:
        """Return values (9, t n) in the order (3, 3 t, n): direction J, components i with angles, points."""
        t, n = self.w.shape
        return np.swapaxes(values.reshape(3, 3, t, n), 0, 1).reshape(3, 3 * t, n)


Rows = tuple[Ints, Ints]
"""Nodes (m, a) of elements, and numbers (nodes, f) of the unknowns of all nodes, -1 where eliminated."""


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
        self._elements, self._law, self._inner = e, law, inner
        self._corners, self._numbers, self._pattern = corners, numbers, pattern
        t = len(a.V)
        self._slopes = e.D.reshape(len(e.cells), -1, e.D.shape[3])
        self._at_nodes, self._at_corners = _incidence(e.cells, len(e.nodes)), _incidence(corners, len(numbers[1]))
        # (3, f, 3 t) gradients of the fields along each direction J, and (3, 3 t, f n) times the pressures' functions
        self._V = np.ascontiguousarray(a.V.transpose(2, 3, 1, 0)).reshape(3, a.fields, 3 * t)
        VC = np.einsum("tiJf,tn->Jitfn", a.V, a.C)
        self._VC = np.ascontiguousarray(VC).reshape(3, 3 * t, a.fields * a.pressures)
        self._pairs, self._where = a.pairs, a.pairs.places(e.cells.shape[1])
        self._batches = [self._cut(slice(*cut), mu, inverse_K) for cut in cut_batches(e)]
        self._strained: Array | None = None
        self._at_rest: tuple[float, Array, Array, Array] | None = None
        self._constant = np.zeros(pattern.entries)
        pressures = corners, numbers[1]
        self.add_matrices(pressure_stiffness(e, inverse_K), COMPLIANCE, pressures, self._constant)

    def _cut(self, part: slice, mu: Array, inverse_K: Array) -> _Batch:
        e, first = self._elements, max(part.start, self._inner)
        w = e.angles.weights[:, None] * e.weights[part].ravel()
        shear, soft = (np.tile(np.repeat(values[part], e.weights.shape[1]), len(w)) for values in (mu, inverse_K))
        near, beside = (
            slice(first, max(part.stop, first)),
            slice(first - self._inner, max(part.stop - self._inner, 0)),
        )
        strains = np.empty((9, *w.shape)), np.empty(w.shape), np.empty((9, *w.shape))
        return _Batch(part, near, beside, shear, w, w * shear.reshape(w.shape), w * soft.reshape(w.shape), *strains)

    def least_volume_change(self, u: Array) -> float:
        """Return the least J - 1 at the integration points of displacements u, read-only; nan where any is nan."""
        if self._strained is not u:
            self._strained = None  # until all batches have the strains of u
            e = self._elements
            g = (self._slopes @ u.take(e.cells, axis=0)).reshape(len(e.cells), -1, 3, u.shape[1])
            for batch in self._batches:
                (t, n), slopes = batch.w.shape, g[batch.part]
                G = np.swapaxes(self._V, 1, 2) @ slopes.transpose(2, 3, 0, 1).reshape(3, -1, n)
                batch.G.reshape(3, 3, t, n)[:] = np.swapaxes(G.reshape(3, 3, t, n), 0, 1)
                kinematics(batch.G.reshape(9, -1), batch.Jm1.ravel(), batch.Hm1.reshape(9, -1))
            self._strained = u
        return float(np.min([batch.Jm1.min() for batch in self._batches]))

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
        e, C, M, energy = self._elements, self._elements.angles.C, self._elements.pressure_shape, 0.0
        (m, q), f, n = e.weights.shape, u.shape[1], p.shape[1]
        S, change, nodal = np.empty((m, q, 3, f)), np.empty((m, q, n)), M @ p.take(self._corners, axis=0)
        data = self._constant.copy() if tangent else np.empty(0)
        for batch in self._batches:
            part = batch.part
            pressure = C @ nodal[part].reshape(-1, n).T
            # about an axisymmetric state both angles of a model of one order have one law
            once = e.angles.of_one_order and viscous is None and batch.agrees(pressure)
            W, P, A = self._stresses(batch, pressure, viscous, tangent=tangent, angles=1 if once else None)
            if once:
                W, P = np.tile(W, 2), np.tile(P, 2)
            energy += float(W.sum()) - float(np.vdot(batch.soft * pressure, pressure)) / 2
            S[part] = (self._V @ batch.along(P)).reshape(3, f, -1, q).transpose(2, 3, 0, 1)
            change[part] = ((batch.w * batch.Jm1 - batch.soft * pressure).T @ C).reshape(-1, q, n)
            if tangent:
                self._add_stiffness(batch, A, T, data)
                self._add_coupling(batch, T, data)
        forces = np.swapaxes(self._slopes, 1, 2) @ S.reshape(m, -1, f)
        volumes = M.T @ change
        return energy, self._at_nodes @ forces.reshape(-1, f), self._at_corners @ volumes.reshape(-1, n), data

    def _stresses(
        self, batch: _Batch, pressure: Array, viscous: Overstress | None, *, tangent: bool, angles: int | None = None
    ) -> tuple[Array, Array, Array]:
        """Return energies (t n,), stresses (9, t n) and tangents (9, 9, t n), times the weights, of a batch.

        angles : number of angles t, from the first one on; default: all.
        """
        at = slice(angles)
        G, Hm1 = (np.ascontiguousarray(gradient[:, at]).reshape(9, -1) for gradient in (batch.G, batch.Hm1))
        Jm1, w, weighted = batch.Jm1[at].ravel(), batch.w[at].ravel(), (batch.w * pressure)[at].ravel()
        modulus, points = (batch.modulus if viscous is None else batch.modulus * viscous.factor)[at].ravel(), len(w)
        W, P, A = np.empty(points), np.empty((9, points)), np.empty((9, 9, points * tangent))
        self._law((G, Jm1, Hm1), modulus, weighted, (W, P, A))
        if viscous is not None:
            viscous.part(batch.part).add(G, Jm1, batch.mu, w, W, P, A)
        return W, P, A

    def _add_stiffness(self, batch: _Batch, A: Array, T: Array, data: Array) -> None:
        """Add the stiffness of a batch, for weighted tangents A (9, 9, t n), or (9, 9, n) where all angles agree."""
        D, n, pairs = self._elements.D[batch.part], batch.w.shape[1], self._pairs
        H = np.empty((9, n, pairs.count))
        A, t = A.reshape(3, 3, 3, 3, -1, n), batch.w.shape[0]
        for i, k, at, products in pairs.groups:
            if A.shape[4] < t:
                products = products.reshape(9, -1, t, products.shape[2]).sum(axis=2)
            rows = A[i, :, k].transpose(1, 3, 0, 2, 4, 5).reshape(9, -1, n)
            np.matmul(np.swapaxes(rows, 1, 2), products, out=H[:, :, at])
        K = np.empty((len(D), D.shape[3], D.shape[3] * pairs.count))
        integrate_stiffness(D, H, K)
        self._scatter_stiffness(batch, K.reshape(len(D), -1), self._where, T, data)

    def _scatter_stiffness(self, batch: _Batch, K: Array, where: Ints, T: Array, data: Array) -> None:
        """Add stiffness K (m, entries), with entry (a, f, b, g) at `where`, to the displacements and the motion."""
        cells, number, _, motion = self._elements.cells, *self._numbers
        nodes = cells[batch.part], number
        self._add(K, where, self._pattern.offsets[ELEMENTS][batch.part], nodes, nodes, data)
        if batch.near.start == batch.near.stop:
            return
        near = cells[batch.near]
        (count, a), (f, r) = near.shape, T.shape[1:]
        slopes, at_magnet = T[near].reshape(count, a * f, r), (np.zeros((count, 1), dtype=np.int64), motion)
        by_motion = K[-count:, where.reshape(a * f, a * f)] @ slopes
        offset = self._pattern.offsets[MAGNET][batch.beside]
        self._add(by_motion.reshape(count, -1), _order(a, f, 1, r), offset, (near, number), at_magnet, data)
        self.add_motion(slopes.reshape(-1, r).T @ by_motion.reshape(-1, r), data)

    def _add_coupling(self, batch: _Batch, T: Array, data: Array) -> None:
        e, M, offsets = self._elements, self._elements.pressure_shape, self._pattern.offsets
        cells, corners, (number, pressure_number, motion) = e.cells, self._corners, self._numbers
        (m, a), (c, f, n) = cells[batch.part].shape, (M.shape[1], number.shape[1], pressure_number.shape[1])
        cofactor = batch.Hm1 * (batch.w * (1 + batch.Jm1))
        cofactor[::4] += batch.w * (1 + batch.Jm1)
        Y = np.swapaxes(np.swapaxes(batch.along(cofactor), 1, 2) @ self._VC, 0, 1)
        along = np.swapaxes(e.D[batch.part], 2, 3) @ Y.reshape(m, -1, 3, f * n)
        B = M.T @ along.reshape(m, -1, a * f * n)
        where, columns = _order(c, a, f, n).transpose(1, 2, 0, 3), (corners[batch.part], pressure_number)
        self._add(B.reshape(m, -1), where, offsets[PRESSURES][batch.part], (cells[batch.part], number), columns, data)
        count = batch.near.stop - batch.near.start
        if count:
            slopes, near = T[cells[batch.near]].reshape(count, a * f, -1), B[-count:].reshape(count, c, a * f, n)
            along = np.swapaxes(np.swapaxes(slopes, 1, 2)[:, None] @ near, 1, 2)
            at_magnet, columns = (
                (np.zeros((count, 1), dtype=np.int64), motion),
                (corners[batch.near], pressure_number),
            )
            offset = offsets[MAGNET_PRESSURES][batch.beside]
            self._add(along.reshape(count, -1), _order(1, T.shape[2], c, n), offset, at_magnet, columns, data)

    def _add(self, values: Array, where: Ints, offset: Ints, rows: Rows, columns: Rows, data: Array) -> None:
        """Add the upper triangles of element matrices to entries of the tangent, see `add_blocks`."""
        add_blocks(values, where, *rows, *columns, offset, (self._pattern.diagonal, self._pattern.inside), data)

    def add_matrices(self, matrices: Array, group: int, rows: Rows, data: Array) -> None:
        """Add the upper triangles of matrices (k, a, f, a, f) of a group of the pattern to entries of the tangent."""
        where = _order(*matrices.shape[1:])
        values = np.ascontiguousarray(matrices).reshape(len(matrices), where.size)
        self._add(values, where, self._pattern.offsets[group], rows, rows, data)

    def add_motion(self, matrix: Array, data: Array) -> None:
        """Add the upper triangle of a matrix (r, r) of the magnet's motion to entries of the tangent."""
        rows = np.zeros((1, 1), dtype=np.int64), self._numbers[2]
        self.add_matrices(matrix[None, None, :, None], MOTION, rows, data)

    def assemble_displacements(self, matrices: Array, T: Array) -> Array:
        """Return the entries (nnz,) of element matrices (m, f, a, f, a) without pressures."""
        data, (f, a) = np.zeros(self._pattern.entries), matrices.shape[1:3]
        where = _order(f, a, f, a).transpose(1, 0, 3, 2)
        for batch in self._batches:
            values = np.ascontiguousarray(matrices[batch.part]).reshape(-1, where.size)
            self._scatter_stiffness(batch, values, where, T, data)
        return data

    def assemble_relaxing(self, u: Array, T: Array) -> Array:
        """Return the entries (nnz,) of `System.relaxing_stiffness` for displacements u, read-only."""
        self.least_volume_change(u)
        data = np.zeros(self._pattern.entries)
        for batch in self._batches:
            _, P, A = self._stresses(batch, np.zeros(batch.w.shape), None, tangent=True)
            H = batch.Hm1.reshape(3, 3, -1) + np.eye(3)[..., None]
            S = np.einsum("iJn,iLn->JLn", H, P.reshape(3, 3, -1))
            for i in range(0, 9, 3):
                A[i : i + 3, i : i + 3] -= S
            self._add_stiffness(batch, A, T, data)
        return data


def _incidence(cells: Ints, count: int) -> sp.csr_matrix:
    """Return the matrix (count, m a) that adds values at the nodes (m, a) of the elements."""
    nodes = cells.ravel()
    starts = np.append(0, np.cumsum(np.bincount(nodes, minlength=count)))
    return sp.csr_matrix((np.ones(cells.size), np.argsort(nodes, kind="stable"), starts), shape=(count, cells.size))


def _order(*shape: int) -> Ints:
    """Return the positions of the entries of an array of a shape."""
    return np.arange(math.prod(shape)).reshape(shape)


def cut_batches(e: Elements) -> list[tuple[int, int]]:
    """Return where the batches of the elements begin and end; they are of nearly one size."""
    cuts = np.linspace(0, len(e.cells), -(-e.weights.size * len(e.angles.theta) // BATCH) + 1)
    return list(itertools.pairwise(cuts.astype(int).tolist()))


@compiled
def integrate_stiffness(D, H, K):
    """Write K_a,bs = sum D_Ja H_JL,s D_Lb over the points, (m, a, b s); H is (9, n, s)."""
    (m, q, _, a), s = D.shape, H.shape[2]
    X = np.empty((3 * q, a * s))
    for cell in range(m):
        for point in range(q):
            x, slopes = cell * q + point, D[cell, point]
            for J in range(3):
                first, second, third = H[3 * J, x], H[3 * J + 1, x], H[3 * J + 2, x]
                for node in range(a):
                    d0, d1, d2 = slopes[0, node], slopes[1, node], slopes[2, node]
                    row = X[3 * point + J, node * s : (node + 1) * s]
                    for k in range(s):
                        row[k] = d0 * first[k] + d1 * second[k] + d2 * third[k]
        np.dot(D[cell].reshape(3 * q, a).T, X, K[cell])


@compiled
def add_blocks(values, where, rows, row_number, columns, column_number, offset, places, data):
    """Add the upper triangles of element matrices (m, entries) to the entries of the sparse matrix.

    where : (a, f, b, g) positions of the entries of fields f of the a-th row and g of the b-th column.
    rows, columns : (m, a) and (m, b) nodes, whose unknowns are numbered in `row_number` and `column_number`; -1 where
        eliminated.
    offset, places : (m, a, b) starts of the pairs of nodes; and diagonal and inside, see `sparse_pattern`.
    """
    diagonal, inside = places
    a, fields, b, column_fields = where.shape
    for cell in range(len(rows)):
        entries = values[cell]
        for first in range(a):
            row = rows[cell, first]
            for second in range(b):
                column = columns[cell, second]
                for f in range(fields):
                    i = row_number[row, f]
                    if i < 0:
                        continue
                    start = diagonal[i] + offset[cell, first, second]
                    for g in range(column_fields):
                        k = column_number[column, g]
                        if k >= i:
                            data[start + inside[k]] += entries[where[first, f, second, g]]
