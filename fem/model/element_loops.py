"""Forces and stiffness of the elements by compiled loops, in batches that fit the processor's cache."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from fem.model import elements_compiled, viscous_compiled
from fem.model.angular_fields import Angles
from fem.model.elements import Elements
from fem.model.material import Law, kinematics
from fem.model.overstress import Overstress
from fem.model.sparse_pattern import Pattern
from geometry.arrays import Array, Ints

BATCH = 1024
"""Integration points and angles in a batch: few enough for the processor's cache, many enough for its vectors."""
INNER, NEAR, PRESSURES, MOTION, FACETS = 0, 2, 4, 5, 6
"""Numbers of the groups of matrices in the pattern: elements apart from the magnet and at it, each followed by their
coupling with the pressures; pressures; motion of the magnet; facets of the skin."""
FEW_BATCHES = 4
"""Most batches whose strains are kept from `least_volume_change` to `assemble`: these are in the cache then."""
CURVE_BITS = 7
"""Bits of each coordinate along the curve that orders tetrahedra: 128 cubes along the beam, finer than most cells."""

NOTHING = np.empty((0, 0))


class Loops:
    """Compiled loops over the elements of one system.

    Parameters
    ----------
    mu, inverse_K : (m,) moduli of the elements.
    corners : (m, c) rows of the pressures.
    number, pressure_number : numbers of the unknown displacements and pressures; -1 where eliminated.
    pattern : sparse pattern; its groups are those of `System`.
    inner : number of elements that do not touch the magnet; they come first.
    first : number of the first unknown of the magnet's motion.
    compliance : (m, n c, n c) constant matrices of the pressures.
    """

    def __init__(
        self,
        elements: Elements,
        law: Law,
        mu: Array,
        inverse_K: Array,
        corners: Ints,
        number: Ints,
        pressure_number: Ints,
        pattern: Pattern,
        inner: int,
        first: int,
        compliance: Array,
    ) -> None:
        self._law = law
        self._mu, self._inverse_K = np.ascontiguousarray(mu), np.ascontiguousarray(inverse_K)
        self._elements, self._corners, self._pattern, self._first = elements, corners, pattern, first
        self._number, self._pressure_number = number, pressure_number
        self._carried = _carried_fields(elements.angles)
        self._products = _field_pairs(elements.angles, elements.cells.shape[1])
        # no batch has elements of both kinds, as the magnet's neighbours have more unknowns
        self._inner = [slice(a, b) for a, b in cut_batches(elements, 0, inner)]
        self._near = [slice(a, b) for a, b in cut_batches(elements, inner, len(elements.cells))]
        self._buffers: dict[tuple[str, tuple[int, ...]], Array] = {}
        self._few = len(self._inner) + len(self._near) <= FEW_BATCHES
        self._strained: Array | None = None
        self._constant = np.zeros(pattern.entries)
        self.add_matrices(compliance, corners, PRESSURES, self._pressure_number, self._constant)

    def least_volume_change(self, u: Array) -> float:
        """Return the least J - 1 at the integration points; nan where any is nan."""
        changes = [self._kinematics(part, u, full=self._few)[1].min() for part in (*self._inner, *self._near)]
        self._strained = u if self._few else None
        return float(np.min(changes))

    def assemble(
        self, u: Array, p: Array, T: Array, viscous: Overstress | None = None, *, tangent: bool
    ) -> tuple[float, Array, Array, Array]:
        """Return energy, nodal forces (nodes, f), volumes (corners, n), and entries (nnz,) of the tangent, or none.

        T : (nodes, f, r) derivative of the displacements by the magnet's motion.
        viscous : what a time step adds to the law; default: nothing.
        """
        forces, volumes, energy = np.zeros(u.shape), np.zeros(p.shape), 0.0
        data = self._constant.copy() if tangent else np.empty(0)
        for part in (*self._inner, *self._near):
            energy += self._add_batch(part, u, p, T, viscous, forces, volumes, data, tangent=tangent)
        self._strained = u if self._few else None
        return energy, forces, volumes, data

    def add_matrices(self, matrices: Array, nodes: Ints, group: int, number: Ints, data: Array) -> None:
        """Add the upper triangles of matrices (k, f a, f a), fields first, to entries of the tangent.

        Parameters
        ----------
        nodes : (k, a) rows of `number`, which holds the unknowns (-1 for an eliminated one).
        group : number of the group in the pattern.
        """
        pattern = self._pattern
        elements_compiled.add_matrices(
            np.ascontiguousarray(matrices),
            nodes,
            pattern.offsets[group],
            number,
            pattern.diagonal,
            pattern.inside,
            data,
        )

    def _buffer(self, name: str, *shape: int) -> Array:
        """Return an array for results of one batch; fresh memory would cost as much time as filling it."""
        key = name, shape
        if key not in self._buffers:
            self._buffers[key] = np.empty(shape)
        return self._buffers[key]

    def _kinematics(self, part: slice, u: Array, *, full: bool) -> tuple[Array, Array, Array]:
        """Return G (9, t, points), J - 1 (t points,) and F^-T - 1 (9, t points) of a batch.

        Displacements u whose strains are known are the same array: no array of displacements is written to later.

        full : whether to compute F^-T - 1; an empty array otherwise.
        """
        e = self._elements
        (m, q), (t, _, _, fields) = e.weights[part].shape, e.angles.V.shape
        own = str(part.start) if self._few else ""
        G, Jm1 = self._buffer("G" + own, 9, t, m * q), self._buffer("Jm1" + own, t * m * q)
        Hm1 = self._buffer("Hm1" + own, 9, t * m * q) if full else NOTHING
        if self._strained is not u:
            self._strained = None  # until all batches have those of u
            g = self._buffer("g", 3, fields, m * q)
            elements_compiled.evaluate_gradients(e.cells[part], e.D[part], e.angles.V, self._carried, u, g, G)
            kinematics(G.reshape(9, -1), Jm1, Hm1)
        return G, Jm1, Hm1

    def _add_batch(
        self,
        part: slice,
        u: Array,
        p: Array,
        T: Array,
        viscous: Overstress | None,
        forces: Array,
        volumes: Array,
        data: Array,
        *,
        tangent: bool,
    ) -> float:
        """Add forces, volumes and tangent of a batch to arrays; return its energy."""
        e = self._elements
        a, cells, corners, (m, q), t = (
            e.angles,
            e.cells[part],
            self._corners[part],
            e.weights[part].shape,
            len(e.angles.V),
        )
        shape, n = (t, m * q), t * m * q
        G, Jm1, Hm1 = self._kinematics(part, u, full=True)
        w, modulus, pressure, weighted = self._buffer("weights", 4, *shape)
        soft = self._buffer("soft", m * q)
        elements_compiled.weigh_points(
            self._mu[part], self._inverse_K[part], corners, e.weights[part], a.weights, e.pressure_shape, a.C, p,
            w, modulus, pressure, weighted, soft,
        )  # fmt: skip
        if viscous is not None:
            modulus *= viscous.factor
        W, P, A = self._buffer("W", n), self._buffer("P", 9, n), self._buffer("A", 9, 9, n if tangent else 0)
        self._law(G.reshape(9, -1), Jm1, Hm1, modulus.ravel(), weighted.ravel(), W, P, A, tangent=tangent)
        if viscous is not None:
            own = viscous.part(part)
            mu = np.tile(np.repeat(self._mu[part], q), t)
            add_overstress(own, G.reshape(9, -1), Jm1, mu, w.ravel(), W, P, A, tangent=tangent)
        energy = elements_compiled.integrate_forces(
            cells, corners, e.D[part], e.pressure_shape, a.V, a.C, self._carried, w, pressure, soft,
            Jm1.reshape(shape), W.reshape(shape), P.reshape(9, *shape), forces, volumes,
        )  # fmt: skip
        if tangent:
            Y = self._buffer("Y", 3, a.fields * a.pressures, m * q)
            elements_compiled.integrate_coupling(
                a.V, a.C, self._carried, w, Jm1.reshape(shape), Hm1.reshape(9, *shape), Y
            )
            self._add_tangent(part, self._stiffness(part, A.reshape(9, 9, *shape)), Y, T, data)
        return float(energy)

    def _stiffness(self, part: slice, A: Array) -> Array:
        """Return the stiffness (m, entries) of the elements of a batch, for weighted tangents A (9, 9, t, points)."""
        D, pairs = self._elements.D[part], self._products
        (m, _, _, a), (t, points) = D.shape, A.shape[2:]
        K = self._buffer("K", m, pairs.size)
        for group in pairs.groups:
            if t == 1:
                H = self._buffer("H", 9, points, group.count)
                elements_compiled.combine_tangents(A, group.terms, group.factors, H)
            else:
                rows = self._buffer("rows", 9, group.products.shape[1], points)
                elements_compiled.select_tangents(A, group.i.start, group.i.stop, group.k.start, group.k.stop, rows)
                H = self._buffer("H", 9, points, group.count)
                np.matmul(np.swapaxes(rows, 1, 2), group.products, out=H)
            elements_compiled.stiffness(D, H, group.first * a * a, K)
        return K

    def _add_tangent(self, part: slice, K: Array, Y: Array, T: Array, data: Array) -> None:
        """Add stiffness K (m, entries) and coupling Y of a batch to the entries of the tangent."""
        e, M = self._elements, self._elements.pressure_shape
        B = self._buffer("B", *e.cells[part].shape, M.shape[1] * Y.shape[1])
        elements_compiled.coupling(e.D[part], M, Y, B)
        self._scatter(part, K, B, T, data)

    def assemble_displacements(self, matrices: Array, T: Array) -> Array:
        """Return the entries (nnz,) of element matrices (m, f, a, f, a) without pressures."""
        where, data = self._products.where, np.zeros(self._pattern.entries)
        for part in (*self._inner, *self._near):
            own = matrices[part]
            K = self._buffer("K", len(own), self._products.size)
            K[:, where] = np.transpose(own, (0, 2, 1, 4, 3))
            self._scatter(part, K, self._no_coupling(part), T, data)
        return data

    def assemble_relaxing(self, u: Array, T: Array) -> Array:
        """Return the entries (nnz,) of `System.relaxing_stiffness` for displacements u."""
        e, data = self._elements, np.zeros(self._pattern.entries)
        for part in (*self._inner, *self._near):
            G, Jm1, Hm1 = self._kinematics(part, u, full=True)
            t, points = G.shape[1:]
            modulus = e.angles.weights[:, None] * (e.weights[part] * self._mu[part, None]).ravel()
            W, P, A = np.empty(t * points), np.empty((9, t * points)), np.zeros((9, 9, t * points))
            self._law(G.reshape(9, -1), Jm1, Hm1, modulus.ravel(), np.zeros(t * points), W, P, A, tangent=True)
            H = Hm1.reshape(3, 3, -1) + np.eye(3)[..., None]
            S = np.einsum("iJn,iLn->JLn", H, P.reshape(3, 3, -1))
            for i in range(3):
                A[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] -= S
            self._scatter(part, self._stiffness(part, A.reshape(9, 9, t, points)), self._no_coupling(part), T, data)
        return data

    def _no_coupling(self, part: slice) -> Array:
        """Return zeros in the shape of the coupling of a batch."""
        e = self._elements
        return np.zeros((*e.cells[part].shape, e.pressure_shape.shape[1] * e.angles.fields * e.angles.pressures))

    def _scatter(self, part: slice, K: Array, B: Array, T: Array, data: Array) -> None:
        """Add stiffness K (m, entries) and coupling B (m, a, c f n) of a batch to the entries of the tangent."""
        e, pattern, near = self._elements, self._pattern, part in self._near
        cells, corners, where = e.cells[part], self._corners[part], self._products.where
        offset, coupled = pattern.offsets[NEAR if near else INNER], pattern.offsets[NEAR + 1 if near else INNER + 1]
        first = self._near[0].start if near else 0
        own = slice(part.start - first, part.stop - first)
        matrix = pattern.diagonal, pattern.inside, data
        elements_compiled.add_symmetric(K, where, cells, offset[own], self._number, *matrix)
        elements_compiled.add_coupling(B, cells, corners, coupled[own], self._number, self._pressure_number, *matrix)
        if near:
            elements_compiled.add_motion(
                K, B, T, where, cells, corners, offset[own], coupled[own], self._number, self._pressure_number,
                self._first, *matrix,
            )  # fmt: skip


@dataclass(frozen=True, slots=True)
class PairGroup:
    """Pairs of fields that carry the components i and k of the displacement.

    Attributes
    ----------
    first, count : number of the first pair, and of all.
    i, k : the components.
    products : (9, i k t, count) products V_iJf V_kLg for each J L.
    terms, factors : the products that are not zero, as rows J L, pair, i J, k L; empty with several angles.
    """

    first: int
    count: int
    i: slice
    k: slice
    products: Array
    terms: Ints
    factors: Array


@dataclass(frozen=True, slots=True)
class FieldPairs:
    """All pairs of fields f <= g in groups, and positions (a, f, a, f) in the `size` entries of an element matrix."""

    groups: list[PairGroup]
    where: Ints
    size: int


def add_overstress(
    viscous: Overstress, G: Array, Jm1: Array, mu: Array, w: Array, W: Array, P: Array, A: Array, *, tangent: bool
) -> None:
    """Add what a time step adds to the law, at the points of a batch, to energies, stresses and tangents.

    Parameters
    ----------
    mu, w : (n,) moduli and weights at the points.
    """
    if viscous.H is not None:
        viscous_compiled.add_dead_stress(G, viscous.H, w, W, P, A, tangent)
    for one in viscous.branches:
        viscous_compiled.add_branch(G, Jm1, one.A, one.b, one.share * mu, w, W, P, A, tangent)


def cut_batches(e: Elements, begin: int, end: int) -> list[tuple[int, int]]:
    """Return where the batches of the elements from `begin` to `end` begin and end; they are of nearly one size."""
    points = (end - begin) * e.weights.shape[1] * len(e.angles.theta)
    cuts = np.linspace(begin, end, -(-points // BATCH) + 1).astype(int).tolist()
    return list(itertools.pairwise(cuts))


def places_on_curve(e: Elements) -> Ints:
    """Return places (m,) of tetrahedra along a Morton curve, where neighbours follow each other; zeros for sections.

    Entries of the matrix that elements share are then still in the processor's cache: a tangent takes a fifth less.
    """
    places = np.zeros(len(e.cells), dtype=np.int64)
    if e.dim == 2 or not len(e.cells):
        return places
    centres = e.nodes[e.corners].mean(axis=1)
    low = centres.min(axis=0)
    cube = ((centres - low) / max(float(np.ptp(centres, axis=0).max()), 1e-9) * (2**CURVE_BITS - 1)).astype(np.int64)
    for bit in range(CURVE_BITS):
        for axis in range(3):
            places |= (cube[:, axis] >> bit & 1) << (3 * bit + axis)
    return places


def _carried_fields(angles: Angles) -> Ints:
    """Return the range of fields (3, 2) that have a component i."""
    ranges = np.zeros((3, 2), dtype=np.int64)
    for i in range(3):
        fields = np.flatnonzero(angles.V[:, i].any(axis=(0, 1)))
        if len(fields):
            ranges[i] = fields[0], fields[-1] + 1
    return ranges


def _field_pairs(angles: Angles, a: int) -> FieldPairs:
    """Return the pairs of fields of elements with a nodes."""
    where = np.zeros((a, angles.fields, a, angles.fields), dtype=np.int64)
    t, first, groups, node = len(angles.theta), 0, [], np.arange(a)
    for pairs in angles.pairs:
        count, i, k = len(pairs.first), pairs.i, pairs.k
        product = pairs.products.reshape(9, -1, count)
        terms, factors = np.zeros((0, 4), dtype=np.int64), np.zeros(0)
        if t == 1:
            JL, ik, pair = np.nonzero(product)
            own_i, own_k = i.start + ik // (k.stop - k.start), k.start + ik % (k.stop - k.start)
            terms, factors = (
                np.stack([JL, pair, 3 * own_i + JL // 3, 3 * own_k + JL % 3], axis=1),
                product[JL, ik, pair],
            )
        groups.append(PairGroup(first, count, i, k, np.ascontiguousarray(product), terms, factors))
        for s, (f, g) in enumerate(zip(pairs.first, pairs.second, strict=True)):
            # entries of a group: node of f, node of g, pair
            entries = first * a * a + (node[:, None] * a + node) * count + s
            where[:, f, :, g], where[:, g, :, f] = entries, entries.T
        first += count
    return FieldPairs(groups, where, first * a * a)
