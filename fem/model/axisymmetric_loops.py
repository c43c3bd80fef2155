"""Forces, stiffness and springs of a section without harmonics, by compiled loops over the elements.

They compute what `element_loops` computes, to rounding, and replace it where each call counts: an assembly is three
calls for each thousand points, beside that of the law.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.model import axisymmetric_compiled
from fem.model.element_loops import FACETS, INNER, NEAR, PRESSURES, add_overstress, cut_batches
from fem.model.elements import Elements, Surface
from fem.model.material import Law
from fem.model.overstress import Overstress
from fem.model.plate_contact import Plate
from fem.model.sparse_pattern import Pattern
from geometry.arrays import Array, Ints

NO_POINTS: NDArray[np.bool_] = np.empty((0, 0), dtype=bool)
COMPONENTS = (0, 2, 4, 6, 8)
"""Components of the gradient that the loops know, see `fem.model.angular_fields.Angles`."""


Stress = tuple[Array, Array, Array]
"""Energies (n,), stresses (9, n) and tangents (9, 9, n)."""


Norms = tuple[float, float, float]
"""Norms of the reactions, and of the residual's forces and volumes."""


@dataclass(frozen=True, slots=True)
class _Batch:
    """Some elements, and arrays for what is computed at their n points.

    Attributes
    ----------
    part : which elements.
    elements : cells, corners, D, M and w, see `axisymmetric_compiled`.
    mu, soft, modulus : shear moduli (m,), 1/K (m,), and shear moduli times weights (n,).
    strains : G (9, n), J - 1 (n,) and F^-T - 1 (9, n).
    pressures : pressures, and pressures times weights, (n,) each.
    stress : results of the law times weights.
    places : positions (m, 12, 12) and (m, 12, 3) of the entries of stiffness and coupling.
    """

    part: slice
    elements: tuple[Ints, Ints, Array, Array, Array]
    mu: Array
    soft: Array
    modulus: Array
    strains: tuple[Array, Array, Array]
    pressures: tuple[Array, Array]
    stress: Stress
    places: tuple[Ints, Ints]


@dataclass(frozen=True, slots=True)
class Skin:
    """Skin of a section.

    Attributes
    ----------
    nodes, shape, weights : see `fem.model.elements.Surface`.
    heights : (k, q) heights of the points.
    entries : (k, 3, 3) positions of the facets' entries for u_z.
    """

    nodes: Ints
    shape: Array
    weights: Array
    heights: Array
    entries: Ints


def knows(elements: Elements, surface: Surface | None = None) -> bool:
    """Return whether the loops know these elements and skin."""
    a = elements.angles
    return a.components == COMPONENTS and a.fields == 2 and (surface is None or surface.angles == 1)


class AxisymmetricLoops:
    """Compiled loops over the elements and the skin of one section.

    Parameters
    ----------
    mu, inverse_K : (m,) moduli of the elements.
    corners : (m, 3) rows of the pressures.
    number : (nodes, 2) numbers of the unknowns; u_z of the nodes on the magnet is its motion; -1 where eliminated.
    pressure_number : (corners,) the same of the pressures.
    on_magnet : (nodes,) mask of the nodes on the magnet.
    eliminated : (nodes, 2) mask of the displacements that are no unknowns.
    pattern : sparse pattern; its groups are those of `System`.
    compliance : (m, 3, 3) constant matrices of the pressures.
    """

    def __init__(
        self,
        elements: Elements,
        surface: Surface | None,
        law: Law,
        mu: Array,
        inverse_K: Array,
        corners: Ints,
        number: Ints,
        pressure_number: Ints,
        on_magnet: NDArray[np.bool_],
        eliminated: NDArray[np.bool_],
        pattern: Pattern,
        compliance: Array,
    ) -> None:
        self._law = law
        self._number, self._pressure_number, self._eliminated = number, pressure_number, eliminated
        self._pressures = int((pressure_number >= 0).sum())
        # the last entry is a dump for those that are not in the upper triangle
        self._constant = _compliance_entries(compliance, pressure_number[corners], pattern)
        places = self._place_elements(elements.cells, corners, on_magnet, pattern)
        cuts = cut_batches(elements, 0, len(elements.cells))
        most = max(end - begin for begin, end in cuts) * elements.weights.shape[1]
        # results of the law, which each batch overwrites
        self._stress = np.zeros(most), np.zeros(9 * most), np.zeros(81 * most)
        self._batches = [_batch(elements, slice(*cut), mu, inverse_K, corners, places, self._stress) for cut in cuts]
        self.skin = None if surface is None else _skin(surface, number, on_magnet, pattern)
        self._evaluated: Array | None = None

    def _place_elements(
        self, cells: Ints, corners: Ints, on_magnet: NDArray[np.bool_], pattern: Pattern
    ) -> tuple[Ints, Ints]:
        """Return the positions of the elements' stiffness (m, 12, 12) and coupling (m, 12, 3), see `_entries`."""
        (m, a), c = cells.shape, corners.shape[1]
        stiffness, coupling = np.empty((m, 2 * a, 2 * a), dtype=np.int64), np.empty((m, 2 * a, c), dtype=np.int64)
        offsets = tuple(pattern.offsets[group] for group in (INNER, INNER + 1, NEAR, NEAR + 1))
        axisymmetric_compiled.place_elements(
            cells, corners, self._number, self._pressure_number, on_magnet, *offsets, pattern.diagonal,
            pattern.inside, pattern.entries, stiffness, coupling,
        )  # fmt: skip
        return stiffness, coupling

    def least_volume_change(self, u: Array, p: Array) -> float:
        """Return the least J - 1 at the integration points; nan where any is nan."""
        flat = p[:, 0]
        least = [
            axisymmetric_compiled.strain_points(*one.elements, u, flat, *one.strains, *one.pressures)
            for one in self._batches
        ]
        # no array of displacements or pressures is written to later
        self._evaluated = u
        return least[0] if len(least) == 1 else float(np.min(least))

    def assemble(
        self,
        u: Array,
        p: Array,
        forces: Array,
        plate: Plate | None,
        viscous: Overstress | None,
        size: int,
        *,
        tangent: bool,
    ) -> tuple[float, Array, Norms, Array]:
        """Add nodal forces to `forces` (nodes, 2); return energy, residual (size,), its norms, and entries (nnz,).

        plate : a plate that `only_presses`, or None.
        viscous : what a time step adds to the law, or None.
        """
        if self._evaluated is not u:
            self.least_volume_change(u, p)
        volumes, energy, k = np.zeros(len(p)), 0.0, axisymmetric_compiled
        data = self._constant.copy() if tangent else self._constant
        for one in self._batches:
            self._evaluate_law(one, viscous, tangent=tangent)
            energy += k.add_elements(
                *one.elements, one.soft, one.pressures[0], *one.strains[1:], *one.stress, forces, volumes,
                *one.places, data, tangent,
            )  # fmt: skip
        if plate is not None:
            assert self.skin is not None
            s, chosen = self.skin, plate.pressed is not None
            energy += k.add_springs(
                s.nodes, s.shape, s.weights, s.heights, u, plate.height, plate.stiffness, chosen,
                plate.pressed if chosen else NO_POINTS, forces, s.entries, data, tangent,
            )  # fmt: skip
        residual = np.zeros(size)
        first = size - self._pressures
        norms = k.collect(forces, volumes, self._number, self._pressure_number, self._eliminated, first, residual)
        return energy, residual, norms, data[:-1]

    def _evaluate_law(self, one: _Batch, viscous: Overstress | None, *, tangent: bool) -> None:
        """Write energies, stresses and tangents, times the weights, at the points of a batch."""
        G, Jm1, Hm1 = one.strains
        modulus = one.modulus if viscous is None else one.modulus * viscous.factor
        self._law(G, Jm1, Hm1, modulus, one.pressures[1], *one.stress, tangent=tangent, step=2)
        if viscous is not None:
            own = viscous.part(one.part)
            w = one.elements[-1]
            add_overstress(own, G, Jm1, np.repeat(one.mu, w.shape[1]), w.ravel(), *one.stress, tangent=tangent)


def _batch(
    e: Elements, part: slice, mu: Array, inverse_K: Array, corners: Ints, places: tuple[Ints, Ints], stress: Stress
) -> _Batch:
    """Return the batch of some elements; `stress` are arrays for at least as many points."""
    w = e.weights[part] * e.angles.weights[0]
    n = w.size
    own = e.cells[part], corners[part], e.D[part], np.ascontiguousarray(e.pressure_shape), w
    return _Batch(
        part,
        own,
        mu[part],
        np.ascontiguousarray(inverse_K[part]),
        (w * mu[part, None]).ravel(),
        # the loops write five components of nine; the others stay zero
        (np.zeros((9, n)), np.zeros(n), np.zeros((9, n))),
        (np.zeros(n), np.zeros(n)),
        (stress[0][:n], stress[1][: 9 * n].reshape(9, n), stress[2][: 81 * n].reshape(9, 9, n)),
        (places[0][part], places[1][part]),
    )


def _compliance_entries(compliance: Array, unknowns: Ints, pattern: Pattern) -> Array:
    """Return the entries (nnz + 1,) of the matrices (m, 3, 3) of the pressures, whose numbers are (m, 3)."""
    places = _entries(pattern, unknowns[:, :, None], unknowns[:, None], pattern.offsets[PRESSURES])
    entries = np.bincount(places.ravel(), weights=compliance.ravel(), minlength=pattern.entries + 1)
    return np.asarray(entries, dtype=np.float64)


def _skin(surface: Surface, number: Ints, on_magnet: NDArray[np.bool_], pattern: Pattern) -> Skin:
    unknowns = np.where(on_magnet, -1, number[:, 1])[surface.nodes]
    entries = _entries(pattern, unknowns[:, :, None], unknowns[:, None], pattern.offsets[FACETS])
    heights, shape = np.ascontiguousarray(surface.points[..., 2]), np.ascontiguousarray(surface.shape)
    return Skin(np.ascontiguousarray(surface.nodes), shape, surface.weights, heights, entries)


def _entries(pattern: Pattern, rows: Ints, columns: Ints, offset: Ints) -> Ints:
    """Return the positions of entries in the upper triangle, and `pattern.entries` for those that are not in it.

    Parameters
    ----------
    rows, columns : numbers of the unknowns, -1 where eliminated.
    offset : starts of their pairs of blocks, see `sparse_pattern`.
    """
    upper = (rows >= 0) & (columns >= rows)
    return np.where(upper, pattern.diagonal[rows] + offset + pattern.inside[columns], pattern.entries)
