"""The discrete nonlinear system of one scene: unknowns, residual and tangent.

The unknowns are q = [free displacements, motion of the rigid magnet, pressures]. Displacements that are clamped,
prescribed, or zero by symmetry (axis, mirror plane) are eliminated. Nodes on the magnet's surface follow its rigid
motion exactly: an element with such nodes has the magnet's unknowns beside its own. On a section of revolution
"displacements" are the fields of `fem.model.elements`, components of the harmonics.

The residual is the derivative of the potential

    Pi(q) = int W(F) + p (J - 1) - p^2 / (2 K) dV + energy of the plate's springs - work of dead loads.

Solutions are stationary points of it (saddle points, because of the pressure), not minima. Where the skin slips on
the plate there is no potential, and the tangent is unsymmetric.
"""

from __future__ import annotations

import copy
import functools
import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from fem.model import element_assembly, material, plate_contact
from fem.model.element_assembly import ElementAssembly, add_at
from fem.model.elements import SAME_PLACE, Elements, Surface
from fem.model.plate_contact import Plate
from fem.model.rigid_inclusion import RigidBody
from fem.model.sparse_pattern import Pattern
from fem.model.viscoelasticity import Overstress
from geometry.arrays import Array, Ints, Mask

NONE: Ints = np.empty(0, dtype=np.int64)
"""No nodes."""


@dataclass(frozen=True, slots=True)
class State:
    """Displacements and pressures of given unknowns.

    Attributes
    ----------
    q : (n,) unknowns.
    u : (nodes, fields) displacements.
    p : (corners, pressures) pressures; on the axis of a section those of the harmonics are 0.
    least_J : least volume ratio J at the integration points; NaN where not computed.
    """

    q: Array
    u: Array
    p: Array
    least_J: float = math.nan


@dataclass(frozen=True, slots=True)
class Assembly:
    """Residual, energy and tangent at a state; `forces` are the nodal ones before elimination.

    The tangent is the upper triangle of a symmetric matrix, or the whole unsymmetric matrix where the contact slips.
    `pressed` are the points (k, q) whose springs act; `without_plate` is the residual of the body alone, where the
    contact is condensed.
    """

    residual: Array
    energy: float
    forces: Array
    matrix: sp.csr_matrix | None
    symmetric: bool = True
    pressed: Mask | None = None
    without_plate: Array | None = None

    @property
    def tangent(self) -> sp.csr_matrix:
        """The tangent; `assemble` must have been called with `tangent`."""
        assert self.matrix is not None
        return self.matrix


class System:
    """Elements, skin and constraints of one scene.

    Parameters
    ----------
    elements, surface : interior and skin.
    moduli : shear modulus and inverse bulk modulus, numbers or one per element.
    fixed : (nodes, fields) mask of the prescribed displacements, which are zero unless `prescribed` is given.
    magnet : nodes on a rigid magnet's surface, and their motion with it.
    dead : (nodes, fields) nodal forces that do not change with the deformation.
    law : isochoric law of the silicone.
    prescribed : (nodes, fields) values of the fixed displacements, and those of the nodes on the magnet before its
        motion, other entries are ignored; and (nodes, pressures) prescribed pressures, nan where they are unknowns,
        or None.

    Attributes
    ----------
    size, n_free, n_rigid, n_pressure : numbers of unknowns.
    glued, rigid : the nodes of `magnet` (empty without), and their motion.
    components : which components of the magnet's motion are unknowns, see `RigidBody`; empty without.
    free, eliminated : (nodes, fields) masks of the displacements that are unknowns, and of those that are fixed or
        follow the magnet.
    unknown_numbers : (nodes, fields) numbers of the displacements' unknowns; -1 for a displacement that is none.
    corner_nodes : nodes that carry pressures.
    viscous : what a time step of a viscoelastic law adds to the law; None without one.
    """

    def __init__(
        self,
        elements: Elements,
        surface: Surface | None,
        moduli: tuple[float | Array, float | Array],
        fixed: Mask,
        magnet: tuple[Ints, RigidBody] | None = None,
        dead: Array | None = None,
        law: material.Law = material.neo_hookean,
        prescribed: tuple[Array, Array | None] | None = None,
    ) -> None:
        self.law = law
        self.viscous: Overstress | None = None
        self.surface = surface
        self.fixed = fixed
        self.dead = np.zeros(fixed.shape) if dead is None else dead
        self.prescribed, held = (np.zeros(fixed.shape), None) if prescribed is None else prescribed
        self._undeformed = np.where(fixed, self.prescribed, 0.0)
        self.glued = NONE if magnet is None else magnet[0]
        self.rigid = None if magnet is None else magnet[1]
        self._last: State | None = None
        touches = np.zeros(len(elements.nodes), dtype=bool)
        touches[self.glued] = True
        at_magnet = touches[elements.cells].any(axis=1)
        # elements at the magnet come last: only they have the unknowns of its motion
        order = np.argsort(at_magnet, kind="stable")
        m, self._free_cells = len(order), int(len(order) - at_magnet.sum())
        self.elements = replace(
            elements, cells=elements.cells[order], D=elements.D[order], weights=elements.weights[order]
        )
        self.mu, self.inverse_K = (
            np.broadcast_to(np.asarray(modulus, dtype=np.float64), (m,))[order, None] for modulus in moduli
        )
        self._number_unknowns(fixed, held)
        self._build_pattern()

    def _number_unknowns(self, fixed: Mask, held: Array | None) -> None:
        e = self.elements
        used = np.zeros(fixed.shape, dtype=bool)
        used[e.cells] = True
        free = used & ~fixed
        free[self.glued] = False
        self.unknown_numbers = np.full(fixed.shape, -1, dtype=np.int64)
        self.unknown_numbers[free] = np.arange(int(free.sum()))
        self._places = np.flatnonzero(free)
        self.n_free = int(free.sum())
        self.components = list(self.rigid.components) if self.rigid else []
        self.n_rigid = len(self.components)
        self.corner_nodes, corners = np.unique(e.corners, return_inverse=True)
        self._corners = corners.reshape(e.corners.shape)
        carried = np.ones((len(self.corner_nodes), e.angles.pressures), dtype=bool)
        carried[e.nodes[self.corner_nodes, 0] < SAME_PLACE, 1:] = False
        self._held = np.zeros(carried.shape)
        if held is not None:
            carried &= np.isnan(held[self.corner_nodes])
            self._held = np.where(carried, 0.0, held[self.corner_nodes])
        self.n_pressure = int(carried.sum())
        first = self.n_free + self.n_rigid
        self._pressures = np.full(carried.shape, -1, dtype=np.int64)
        self._pressures[carried] = first + np.arange(self.n_pressure)
        self.size = first + self.n_pressure
        self.free, self.eliminated, self._carried = free, used & ~free, np.flatnonzero(carried)

    def _build_pattern(self) -> None:
        e, inner, nodes = self.elements, self._free_cells, len(self.elements.nodes)
        cells, pressures, magnet = e.cells, nodes + 1 + self._corners, np.array([[nodes]])
        beside = np.full((len(cells) - inner, 1), nodes)
        # in the order of `element_assembly.ELEMENTS` and so on
        groups = [
            (cells, cells),
            (cells, pressures),
            (cells[inner:], beside),
            (beside, pressures[inner:]),
            (pressures, pressures),
            (magnet, magnet),
        ]
        skin = None
        if self.surface is not None:
            facets = self.surface.nodes
            groups.append((facets, facets))
            skin = self.unknown_numbers[facets]
        sizes = np.concatenate([self.free.sum(axis=1), [self.n_rigid], (self._pressures >= 0).sum(axis=1)])
        self.pattern = Pattern(groups, sizes, skin)

    @property
    def skin(self) -> Surface:
        """The surface, of a system that has one."""
        assert self.surface is not None
        return self.surface

    def state(self, q: Array) -> State:
        """Return displacements and pressures of unknowns q."""
        # a state is read several times, and no array of unknowns is written to later
        last = self._last
        if last is not None and last.q is q:
            return last
        u = self._undeformed.copy()
        u.ravel()[self._places] = q[: self.n_free]
        if self.rigid:
            u[self.glued] = self.prescribed[self.glued] + self.rigid.displacement(self.motion(q))
        p = self._held.copy()
        p.ravel()[self._carried] = q[self.n_free + self.n_rigid :]
        for values in (q, u, p):
            values.flags.writeable = False
        self._last = state = State(q, u, p)
        return state

    def with_prescribed(self, u: Array, p: Array) -> System:
        """Return the system with other prescribed displacements (nodes, fields) and pressures (corners, n)."""
        _ = self._loops  # all copies share them
        system = copy.copy(self)
        system.prescribed, system._held, system._last = u, np.where(self._pressures >= 0, 0.0, p), None
        system._undeformed = np.where(self.fixed, u, 0.0)
        return system

    def with_viscous(self, viscous: Overstress) -> System:
        """Return the system with what a time step adds to its law."""
        _ = self._loops  # all copies share them
        system = copy.copy(self)
        system.viscous = viscous
        return system

    def unknowns(self, u: Array, p: Array, motion: Array) -> Array:
        """Return the unknowns of displacements, pressures and the magnet's motion: the inverse of `state`.

        Or the residual, of forces and volumes.
        """
        return np.concatenate([u.take(self._places), motion, p.take(self._carried)])

    def motion(self, q: Array) -> Array:
        """Return the unknowns of the rigid magnet."""
        return q[self.n_free : self.n_free + self.n_rigid]

    def admissible(self, q: Array) -> State | None:
        """Return the state of unknowns q, or None where any silicone is inverted (J <= 0)."""
        if not np.isfinite(q).all():
            return None
        state = self.state(q)
        least = self._loops.least_volume_change(state.u)
        return State(q, state.u, state.p, 1 + least) if least > -1 else None

    def assemble(self, state: State, plate: Plate | None, *, tangent: bool = True) -> Assembly:
        """Assemble the residual and, with `tangent`, the tangent at a state with all J > 0."""
        T = self._motion_derivative(state)
        energy, forces, volumes, data = self._loops.assemble(state.u, state.p, T, self.viscous, tangent=tangent)
        blocks, symmetric, pressed = None, True, None
        energy -= float(np.vdot(self.dead, state.u))
        forces -= self.dead
        if plate is not None and self.surface is not None:
            of_springs = plate_contact.assemble_springs(self.surface, state.u, plate, tangent=tangent)
            springs, blocks, stored, symmetric, pressed = of_springs
            forces += self.surface.add_up(springs, len(forces))
            energy += stored
        residual = self.unknowns(forces, volumes, np.zeros(self.n_rigid))
        if self.rigid:
            residual[self.n_free : self.n_free + self.n_rigid] = np.einsum("nf,nfr->r", forces, T)
        if not tangent:
            return Assembly(residual, energy, forces, None, pressed=pressed)
        if self.rigid:
            # a finite rotation is nonlinear in its angles: forces on the magnet contribute to the tangent
            self._loops.add_motion(self.rigid.curvature(self.motion(state.q), forces[self.glued]), data)
        if blocks is not None:
            add_at(blocks.ravel(), self.pattern.skin_places, data)
        matrix = self.pattern.with_data(data)
        if not symmetric and blocks is not None:
            matrix = self.pattern.unfold(matrix, blocks)
        return Assembly(residual, energy, forces, matrix, symmetric, pressed)

    @functools.cached_property
    def _loops(self) -> ElementAssembly:
        motion = np.arange(self.n_free, self.n_free + self.n_rigid)[None]
        numbers = self.unknown_numbers, self._pressures, motion
        return ElementAssembly(
            self.elements, self.law, self.mu, self.inverse_K, self._corners, numbers, self.pattern, self._free_cells
        )

    def mass(self, density: float, magnet: Array | None = None, state: State | None = None) -> sp.csr_matrix:
        """Return the consistent mass matrix (upper triangle); pressures have no mass.

        Parameters
        ----------
        density : density of the silicone.
        magnet : (6,) the magnet's mass, three times, and its moments of inertia about y, x and z; None for zeros.
        state : its magnet's rotation is the only part that matters; default: the undeformed state.
        """
        matrices = element_assembly.mass(self.elements, density)
        T = self._motion_derivative(state or self.state(np.zeros(self.size)))
        data = self._loops.assemble_displacements(matrices, T)
        if magnet is not None:
            self._loops.add_motion(np.diag(magnet[self.components]), data)
        return self.pattern.with_data(data)

    def relaxing_stiffness(self, state: State) -> sp.csr_matrix:
        """Return the part of the tangent (upper triangle) that relaxes in a viscoelastic silicone.

        With the second Piola-Kirchhoff stress S of the isochoric law, dP_iJ/dF_kL = delta_ik S_JL + F_iM F_kN
        dS_MJ/dE_NL. The first term turns a stress with the material (geometric stiffness); the second one is
        returned. Pressures do not contribute.
        """
        return self.pattern.with_data(self._loops.assemble_relaxing(state.u, self._motion_derivative(state)))

    def _motion_derivative(self, state: State) -> Array:
        """Return the derivative of the displacements by the magnet's motion, shape (nodes, fields, n_rigid)."""
        T = np.zeros((*self.fixed.shape, self.n_rigid))
        if self.rigid:
            T[self.glued] = self.rigid.derivative(self.motion(state.q))
        return T
