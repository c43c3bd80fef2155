"""The discrete nonlinear system of one scene: unknowns, residual and tangent.

The unknowns are q = [free displacements, motion of the rigid magnet, pressures]. Displacements that are clamped,
prescribed, or zero by symmetry (axis, mirror plane) are eliminated. Nodes on the magnet's surface follow its rigid
motion exactly: an element with such nodes has the magnet's unknowns beside its own. On a section of revolution
"displacements" are the fields of `fem.discretisation.elements`, components of the harmonics.

The residual is the derivative of the potential

    Pi(q) = int W(F) + p (J - 1) - p^2 / (2 K) dV + energy of the plate's springs - work of dead loads.

Solutions are stationary points of it (saddle points, because of the pressure), not minima. Where the skin slips on
the plate there is no potential, and the tangent is unsymmetric.
"""

from __future__ import annotations

import copy
import functools
import itertools
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem import material
from fem.contact import plate_contact
from fem.contact.plate_contact import Plate
from fem.discretisation import axisymmetric_loops, element_integrals, element_loops
from fem.discretisation.assembled_state import Assembly, State
from fem.discretisation.axisymmetric_loops import AxisymmetricLoops
from fem.discretisation.element_loops import FACETS, MOTION, Loops
from fem.discretisation.elements import Elements, Surface
from fem.discretisation.overstress import Overstress
from fem.discretisation.rigid_inclusion import RigidBody
from fem.solvers.sparse_pattern import Pattern, Side
from geometry.arrays import Array, Ints

CHUNK = 4096
"""Integration points per batch, so that their tensors stay in the processor's cache."""
NONE: Ints = np.empty(0, dtype=np.int64)
ON_AXIS = 1e-9
"""Radius over D below which a node lies on the axis."""


class System:
    """Elements, skin and constraints of one scene.

    Parameters
    ----------
    elements, surface : interior and skin.
    mu, inverse_K : shear modulus and inverse bulk modulus, numbers or one per element.
    fixed : (nodes, fields) mask of the prescribed displacements, which are zero unless `prescribed` is given.
    glued : nodes on the magnet's surface (empty without a rigid magnet).
    rigid : motion of these nodes with the magnet.
    dead : (nodes, fields) nodal forces that do not change with the deformation.
    law : isochoric law of the silicone.
    prescribed : (nodes, fields) values of the fixed displacements, and those of the nodes on the magnet before its
        motion; other entries are ignored.
    held : (nodes, pressures) prescribed pressures, nan where they are unknowns; or None.

    Attributes
    ----------
    size, n_free, n_rigid, n_pressure : numbers of unknowns.
    free, eliminated : (nodes, fields) masks of the displacements that are unknowns, and of those that are fixed or
        follow the magnet.
    corner_nodes : nodes that carry pressures.
    viscous : what a time step of a viscoelastic law adds to the law; None without one.
    """

    def __init__(
        self,
        elements: Elements,
        surface: Surface | None,
        mu: float | Array,
        inverse_K: float | Array,
        fixed: NDArray[np.bool_],
        glued: Ints = NONE,
        rigid: RigidBody | None = None,
        dead: Array | None = None,
        law: material.Law = material.neo_hookean,
        prescribed: Array | None = None,
        held: Array | None = None,
    ) -> None:
        self.law = law
        self.viscous: Overstress | None = None
        self.surface = surface
        self.fixed = fixed
        self.dead = np.zeros(fixed.shape) if dead is None else dead
        self.prescribed = np.zeros(fixed.shape) if prescribed is None else prescribed
        self.glued, self.rigid = glued, rigid
        self._last: State | None = None
        touches = np.zeros(len(elements.nodes), dtype=bool)
        touches[glued] = True
        at_magnet = touches[elements.cells].any(axis=1)
        # elements at the magnet come last: only they have the unknowns of its motion
        order = np.lexsort((element_loops.places_on_curve(elements), at_magnet))
        m, self._free_cells = len(order), int(len(order) - at_magnet.sum())
        self.elements = replace(
            elements, cells=elements.cells[order], D=elements.D[order], weights=elements.weights[order]
        )
        self.mu = np.broadcast_to(np.asarray(mu, dtype=np.float64), (m,))[order, None]
        self.inverse_K = np.broadcast_to(np.asarray(inverse_K, dtype=np.float64), (m,))[order, None]
        step = max(CHUNK // (elements.weights.shape[1] * len(elements.angles.theta)), 1)
        cuts = [*range(0, self._free_cells, step), *range(self._free_cells, m, step), m]
        self._parts = [slice(a, b) for a, b in itertools.pairwise(cuts)]
        self._plain = axisymmetric_loops.knows(self.elements, surface)
        self._number_unknowns(fixed, held)
        self._build_pattern()

    def _number_unknowns(self, fixed: NDArray[np.bool_], held: Array | None) -> None:
        """Number the unknowns."""
        e = self.elements
        used = np.zeros(fixed.shape, dtype=bool)
        used[e.cells] = True
        free = used & ~fixed
        free[self.glued] = False
        self._reduced = np.full(fixed.shape, -1, dtype=np.int64)
        self._reduced[free] = np.arange(int(free.sum()))
        self._places = np.flatnonzero(free)
        self.n_free = int(free.sum())
        self.n_rigid = self.rigid.size if self.rigid else 0
        self.corner_nodes, corners = np.unique(e.corners, return_inverse=True)
        self._corners = corners.reshape(e.corners.shape)
        carried = np.ones((len(self.corner_nodes), e.angles.pressures), dtype=bool)
        carried[e.nodes[self.corner_nodes, 0] < ON_AXIS, 1:] = False
        self._held = np.zeros(carried.shape)
        if held is not None:
            carried &= np.isnan(held[self.corner_nodes])
            self._held = np.where(carried, 0.0, held[self.corner_nodes])
        self.n_pressure = int(carried.sum())
        first = self.n_free + self.n_rigid
        self._pressures = np.full(carried.shape, -1, dtype=np.int64)
        self._pressures[carried] = first + np.arange(self.n_pressure)
        self.size = first + self.n_pressure
        self.free, self.eliminated, self._carried = free, used & ~free, carried

    def _build_pattern(self) -> None:
        """Build the sparse pattern from the unknowns of each element, and the constant stiffness of the pressures."""
        e, inner, nodes = self.elements, self._free_cells, len(self.elements.nodes)
        motion = np.arange(self.n_free, self.n_free + self.n_rigid)
        cells, corners = e.cells, self._corners
        near, near_corners = cells[inner:], corners[inner:]
        magnet = Side(motion[None, None], np.array([[nodes]]), np.zeros(self.n_rigid, dtype=np.int64))
        outer = Side.whole(self._reduced, near).beside(magnet)
        pressures = Side.whole(self._pressures, corners, nodes + 1)
        groups = [
            self._stiffness_sides(cells[:inner]),
            self._coupling_sides(cells[:inner], corners[:inner]),
            (outer, outer),
            (outer, Side.whole(self._pressures, near_corners, nodes + 1)),
            (pressures, pressures),
            (magnet, magnet),
        ]
        if self.surface is not None:
            facets = Side.whole(self._reduced, self.surface.nodes)
            groups.append((facets, facets))
        sizes = np.concatenate([self.free.sum(axis=1), [self.n_rigid], self._carried.sum(axis=1)])
        self.pattern = Pattern(groups, sizes)
        self._p = pressures.unknowns[:, 0]
        whole = slice(0, len(e.cells))
        self._compliance = -element_integrals.pressure_stiffness(
            e, whole, element_integrals.volumes(e, whole) * self.inverse_K
        )

    def _stiffness_sides(self, cells: Ints) -> tuple[Side, Side]:
        """Return rows and columns of the pieces of `element_integrals.displacement_stiffness`."""
        e = self.elements
        if e.angles.components is not None:
            return (Side.whole(self._reduced, cells),) * 2
        first, second = (np.concatenate(f) for f in zip(*((p.first, p.second) for p in e.angles.pairs), strict=True))
        return Side.pieces(self._reduced, cells, first), Side.pieces(self._reduced, cells, second)

    def _coupling_sides(self, cells: Ints, corners: Ints) -> tuple[Side, Side]:
        """Return rows and columns of the pieces of `element_integrals.coupling`, for each pair of fields."""
        a = self.elements.angles
        fields, numbers = np.divmod(np.arange(a.fields * a.pressures), a.pressures)
        return (
            Side.pieces(self._reduced, cells, fields),
            Side.pieces(self._pressures, corners, numbers, len(self.elements.nodes) + 1),
        )

    @property
    def unknown_numbers(self) -> Ints:
        """(nodes, fields) numbers of the displacements' unknowns; -1 for a displacement that is none."""
        return self._reduced

    def state(self, q: Array) -> State:
        """Return displacements and pressures of unknowns q."""
        # a state is read several times, and no array of unknowns is written to later
        last = self._last
        if last is not None and last.q is q:
            return last
        u = np.where(self.fixed, self.prescribed, 0.0)
        u.ravel()[self._places] = q[: self.n_free]
        if self.rigid:
            u[self.glued] = self.prescribed[self.glued] + self.rigid.displacement(self.motion(q))
        p = self._held.copy()
        p[self._carried] = q[self.n_free + self.n_rigid :]
        self._last = state = State(q, u, p)
        return state

    def with_prescribed(self, u: Array, p: Array) -> System:
        """Return the system with other prescribed displacements (nodes, fields) and pressures (corners, n)."""
        system = copy.copy(self)
        system.prescribed, system._held, system._last = u, np.where(self._carried, 0.0, p), None
        return system

    def unknowns(self, u: Array, p: Array, motion: Array) -> Array:
        """Return the unknowns of displacements, pressures and the magnet's motion: the inverse of `state`."""
        return np.concatenate([u[self.free], motion, p[self._carried]])

    def motion(self, q: Array) -> Array:
        """Return the unknowns of the rigid magnet."""
        return q[self.n_free : self.n_free + self.n_rigid]

    def admissible(self, q: Array) -> State | None:
        """Return the state of unknowns q with its strains, or None where any silicone is inverted (J <= 0)."""
        if not np.isfinite(q).all():
            return None
        state, axisymmetric = self.state(q), self.axisymmetric
        if axisymmetric is not None or element_loops.usable(self.law, self.elements):
            if axisymmetric is not None:
                least = axisymmetric.least_volume_change(state.u, state.p)
            else:
                least = self._loops.least_volume_change(state.u)
            return State(state.q, state.u, state.p, least_J=1 + least) if least > -1 else None
        strains = self._strains(state)
        least = min((float(strain.Jm1.min()) for strain in strains), default=0.0)
        return replace(state, strains=strains, least_J=1 + least) if least > -1 else None

    def _strains(self, state: State) -> tuple[material.Strain, ...]:
        e = self.elements
        return tuple(material.strain(element_integrals.gradient(e, part, state.u)) for part in self._parts)

    def assemble(self, state: State, plate: Plate | None, *, tangent: bool = True) -> Assembly:
        """Assemble the residual and, with `tangent`, the tangent at a state with all J > 0."""
        axisymmetric = self.axisymmetric
        if axisymmetric is not None:
            return self._assemble_axisymmetric(axisymmetric, state, plate, tangent=tangent)
        compiled = element_loops.usable(self.law, self.elements)
        T = self._motion_derivative(state)
        if compiled:
            energy, forces, volumes, data = self._loops.assemble(state.u, state.p, T, self.viscous, tangent=tangent)
        else:
            energy, forces, volumes, groups = self._integrate(state, T, tangent)
        springs, blocks, spring_energy, symmetric = self._spring_terms(state, plate, tangent)
        forces += springs - self.dead
        energy += spring_energy - float(np.vdot(self.dead, state.u))
        residual = np.concatenate([forces[self.free], np.zeros(self.n_rigid), volumes[self._carried]])
        if self.rigid:
            residual[self.n_free : self.n_free + self.n_rigid] = np.einsum("nf,nfr->r", forces, T)
        if not tangent:
            return Assembly(residual, energy, forces, None)
        # a finite rotation is nonlinear in its angles: forces on the magnet contribute to the tangent
        own = self.rigid.curvature(self.motion(state.q), forces[self.glued]) if self.rigid else None
        if compiled:
            self._add_small_groups(own, blocks, data)
            matrix = self.pattern.with_data(data)
        else:
            matrix = self.pattern.assemble([*groups, own, *blocks])
        if not symmetric and blocks[0] is not None:
            matrix = self.pattern.unfold(matrix, blocks[0])
        return Assembly(residual, energy, forces, matrix, symmetric)

    def _assemble_axisymmetric(
        self, loops: AxisymmetricLoops, state: State, plate: Plate | None, *, tangent: bool
    ) -> Assembly:
        """Return `assemble` of a section without harmonics by compiled loops."""
        symmetric, blocks, forces = True, list[Array | None](), -self.dead
        energy, plain = -float(np.vdot(self.dead, state.u)), plate is None or plate.only_presses
        if not plain:
            springs, blocks, spring_energy, symmetric = self._spring_terms(state, plate, tangent)
            forces, energy = forces + springs, energy + spring_energy
        own, residual, norms, data = loops.assemble(
            state.u, state.p, forces, plate if plain else None, self.viscous, self.size, tangent=tangent
        )
        if not tangent:
            return Assembly(residual, energy + own, forces, None, norms=norms)
        if not plain:
            self._add_small_groups(None, blocks, data)
        matrix = self.pattern.with_data(data)
        if not symmetric and blocks[0] is not None:
            matrix = self.pattern.unfold(matrix, blocks[0])
        return Assembly(residual, energy + own, forces, matrix, symmetric, norms)

    def _integrate(self, state: State, T: Array, tangent: bool) -> tuple[float, Array, Array, list[Array | None]]:
        """Return energy, nodal forces and volumes, and matrices of the elements, by NumPy."""
        e, inner, moduli = self.elements, self._free_cells, (self.mu, self.inverse_K)
        strains = state.strains or self._strains(state)
        energy, fu, fp, K, C = element_integrals.integrate(
            e, self._parts, strains, self.law, moduli, state.p[self._corners], self.viscous, tangent=tangent
        )
        forces = element_integrals.sum_entries(e.places, fu, state.u.shape)
        rows = np.arange(state.p.size).reshape(state.p.shape)[self._corners]
        volumes = element_integrals.sum_entries(np.swapaxes(rows, 1, 2), fp, state.p.shape)
        if not tangent:
            return energy, forces, volumes, []
        outer = self._with_motion(T, K[inner:], C[inner:])
        return energy, forces, volumes, [K[:inner], C[:inner], *outer, self._compliance]

    @functools.cached_property
    def _loops(self) -> Loops:
        """The compiled loops over the elements."""
        numbers = self._reduced, self._pressures
        mu, inverse_K = self.mu[:, 0], self.inverse_K[:, 0]
        return Loops(
            self.elements, self.law, mu, inverse_K, self._corners, *numbers, self.pattern, self._free_cells,
            self.n_free, self._compliance,
        )  # fmt: skip

    @property
    def axisymmetric(self) -> AxisymmetricLoops | None:
        """The compiled loops of a section without harmonics; None for other models, and where NumPy is used."""
        return self._axisymmetric_loops if self._plain and element_loops.usable(self.law, self.elements) else None

    @functools.cached_property
    def _axisymmetric_loops(self) -> AxisymmetricLoops:
        """The compiled loops over elements and skin of a section without harmonics."""
        number, on_magnet = self._reduced.copy(), np.zeros(len(self.fixed), dtype=bool)
        on_magnet[self.glued] = True
        if self.rigid:
            number[self.glued, 1] = self.n_free
        mu, inverse_K = self.mu[:, 0], self.inverse_K[:, 0]
        return AxisymmetricLoops(
            self.elements, self.surface, self.law, mu, inverse_K, self._corners, number, self._pressures[:, 0],
            on_magnet, self.eliminated, self.pattern, self._compliance,
        )  # fmt: skip

    def _add_small_groups(self, motion: Array | None, facets: list[Array | None], data: Array) -> None:
        """Add matrices of the magnet's motion (r, r) and of the skin's facets (k, f a, f a) to entries (nnz,)."""
        if motion is not None:
            rows = np.arange(self.n_free, self.n_free + self.n_rigid)[None]
            self._loops.add_matrices(motion[None], np.zeros((1, 1), dtype=np.int64), MOTION, rows, data)
        if self.surface is not None and facets[0] is not None:
            self._loops.add_matrices(facets[0], self.surface.nodes, FACETS, self._reduced, data)

    def mass(self, density: float, magnet: Array, state: State | None = None) -> sp.csr_matrix:
        """Return the consistent mass matrix (upper triangle); pressures have no mass.

        Parameters
        ----------
        density : density of the silicone.
        magnet : (n_rigid,) the magnet's mass or moment of inertia for each of its unknowns.
        state : its magnet's rotation is the only part that matters; default: the undeformed state.
        """
        pieces = element_integrals.mass(self.elements, slice(None), np.full(len(self.elements.cells), density))
        return self.displacement_matrix(pieces, state or self.state(np.zeros(self.size)), magnet)

    def displacement_matrix(self, pieces: Array, state: State, magnet: Array) -> sp.csr_matrix:
        """Return a matrix (upper triangle) without pressures; `pieces` as in `element_integrals.mass`."""
        T = self._motion_derivative(state)
        if element_loops.usable(self.law, self.elements):
            data = self._loops.assemble_displacements(pieces, T)
            self._add_small_groups(np.diag(magnet), [None], data)
            return self.pattern.with_data(data)
        outer, _ = self._with_motion(T, pieces[self._free_cells :], None)
        blocks = [pieces[: self._free_cells], None, outer, None, None, np.diag(magnet)]
        return self.pattern.assemble([*blocks, *([None] * (self.surface is not None))])

    def _spring_terms(
        self, state: State, plate: Plate | None, tangent: bool
    ) -> tuple[Array, list[Array | None], float, bool]:
        """Return nodal forces, facet matrices and energy of the plate's springs, and whether these are symmetric."""
        nodal = np.zeros(self.fixed.shape)
        s = self.surface
        if s is None:
            return nodal, [], 0.0, True
        if plate is None:
            return nodal, [None], 0.0, True
        forces, blocks, energy, symmetric = plate_contact.assemble_springs(s, state.u, plate, tangent=tangent)
        np.add.at(nodal, s.nodes, forces)
        return nodal, [blocks], energy, symmetric

    def _motion_derivative(self, state: State) -> Array:
        """Return the derivative of the displacements by the magnet's motion, shape (nodes, fields, n_rigid)."""
        T = np.zeros((*self.fixed.shape, self.n_rigid))
        if self.rigid:
            T[self.glued] = self.rigid.derivative(self.motion(state.q))
        return T

    def _with_motion(self, T: Array, K: Array, C: Array | None) -> list[Array | None]:
        """Return the matrices of the elements at the magnet, bordered by the unknowns of its motion.

        T is from `_motion_derivative`; K and C are the pieces of the elements' stiffness, and their coupling or None.
        """
        if not len(K):
            return [None, None]
        e = self.elements
        K, m = element_integrals.join_pieces(e, K), len(K)
        Te = np.swapaxes(T[e.cells[self._free_cells :]], 1, 2).reshape(m, K.shape[1], self.n_rigid)
        KT, TK = K @ Te, np.swapaxes(Te, 1, 2)
        bottom = np.concatenate([np.swapaxes(KT, 1, 2), TK @ KT], axis=2)
        bordered = np.concatenate([np.concatenate([K, KT], axis=2), bottom], axis=1)
        if C is None:
            return [bordered, None]
        C = np.swapaxes(C, 2, 3).reshape(m, K.shape[1], self._p.shape[1])
        return [bordered, np.concatenate([C, TK @ C], axis=1)]
