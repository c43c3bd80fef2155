"""The nonlinear system of one scene: unknowns, residual and tangent.

Unknowns q = [free displacements, motion of the rigid magnet, pressures]. Displacements that are clamped, prescribed
or lie on the axis or mirror plane are eliminated; those on the magnet's face follow its rigid motion exactly,
element by element: an element with such nodes sees the magnet's unknowns beside its own.

The residual is the derivative of the potential

    Pi(q) = int W(F) + p (J - 1) - p^2 / (2 K) dV + energy of the plate's springs - work of dead loads,

which is stationary, not least, at a solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from fem import contact, material
from fem.contact import Plate
from fem.elements import Elements, Surface
from fem.linear import Pattern
from fem.rigid import RigidBody

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class State:
    """One point of the space of unknowns, spelled out.

    Attributes
    ----------
    q : (n,) unknowns.
    u : (nodes, dim) displacements.
    p : (corners,) pressures.
    """

    q: Array
    u: Array
    p: Array


@dataclass(frozen=True, slots=True)
class Assembly:
    """Residual, tangent (upper triangle) and energy at a state; forces are the nodal ones before elimination."""

    residual: Array
    tangent: sp.csr_matrix
    energy: float
    forces: Array


class System:
    """Elements, skin and constraints of one scene.

    Parameters
    ----------
    elements, surface : interior and skin.
    mu, inverse_K : shear modulus and inverse bulk modulus, numbers or one per element.
    fixed : (nodes, dim) mask of the displacements that are prescribed, as zero if nothing else is said.
    glued : nodes on the magnet's face (empty without a rigid magnet).
    centre : (dim,) the magnet's centre.
    dead : (nodes, dim) nodal forces that do not change with the deformation.
    law : the silicone's, isochoric.
    prescribed : (nodes, dim) what the fixed displacements are; read there only.

    Attributes
    ----------
    size, n_free, n_rigid, n_pressure : numbers of unknowns.
    free, eliminated : (nodes, dim) masks of the displacements that are unknowns, and
        of those that are fixed or follow the magnet.
    """

    def __init__(
        self,
        elements: Elements,
        surface: Surface | None,
        mu: float | Array,
        inverse_K: float | Array,
        fixed: NDArray[np.bool_],
        glued: Index,
        centre: Array,
        dead: Array | None = None,
        law: material.Law = material.neo_hookean,
        prescribed: Array | None = None,
    ) -> None:
        self.law = law
        self.elements, self.surface = elements, surface
        self.fixed = fixed
        self.dead = np.zeros(elements.nodes.shape) if dead is None else dead
        self.prescribed = np.zeros(elements.nodes.shape) if prescribed is None else prescribed
        m = len(elements.cells)
        self.mu = np.broadcast_to(np.asarray(mu, dtype=np.float64), (m,))[:, None]
        self.inverse_K = np.broadcast_to(np.asarray(inverse_K, dtype=np.float64), (m,))[:, None]
        self.glued = glued
        self.rigid = RigidBody(elements.nodes[glued] - centre) if len(glued) else None
        self._number(fixed)

    def _number(self, fixed: NDArray[np.bool_]) -> None:
        """Number the unknowns and build the sparse pattern."""
        e = self.elements
        n, dim = e.nodes.shape
        used = np.zeros((n, dim), dtype=bool)
        used[e.cells] = True
        free = used & ~fixed
        free[self.glued] = False
        self._reduced = np.full((n, dim), -1, dtype=np.int64)
        self._reduced[free] = np.arange(int(free.sum()))
        self.n_free = int(free.sum())
        self.n_rigid = self.rigid.size if self.rigid else 0
        corners, inverse = np.unique(e.corners, return_inverse=True)
        self.n_pressure = len(corners)
        self.corner_nodes = corners
        self._pressure = inverse.reshape(e.corners.shape)
        self.size = self.n_free + self.n_rigid + self.n_pressure
        self.free = free
        self.eliminated = used & ~free
        touches = np.zeros(n, dtype=bool)
        touches[self.glued] = True
        self._at_magnet = touches[e.cells].any(axis=1)
        u = self._reduced[e.cells].reshape(len(e.cells), -1)
        p = self._pressure + self.n_free + self.n_rigid
        inner = np.hstack([u, p])[~self._at_magnet]
        motion = np.broadcast_to(np.arange(self.n_rigid) + self.n_free, (int(self._at_magnet.sum()), self.n_rigid))
        outer = np.hstack([u[self._at_magnet], p[self._at_magnet], motion])
        self._dofs = np.hstack([u, p])
        single = np.arange(self.n_free, self.n_free + self.n_rigid, dtype=np.int64)[None]
        groups = [inner, outer, single]
        if self.surface is not None:
            facets = self._reduced[self.surface.nodes]
            groups += [np.ascontiguousarray(facets[..., i]) for i in range(dim)]
        self.pattern = Pattern(groups, self.size)

    def state(self, q: Array) -> State:
        """Displacements and pressures of unknowns q."""
        u = np.where(self.fixed, self.prescribed, 0.0)
        u[self.free] = q[: self.n_free]
        if self.rigid:
            u[self.glued] = self.rigid.displacement(self.motion(q))
        return State(q, u, q[self.n_free + self.n_rigid :])

    def motion(self, q: Array) -> Array:
        """Unknowns of the rigid magnet."""
        return q[self.n_free : self.n_free + self.n_rigid]

    def gradient(self, state: State) -> Array:
        """G = grad u at the quadrature points, shape (m, q, 3, 3)."""
        e = self.elements
        ue = state.u[e.cells].reshape(len(e.cells), 1, -1, 1)
        G = np.zeros((*e.weights.shape, 9))
        G[..., e.components] = (e.B @ ue)[..., 0]
        return G.reshape(*e.weights.shape, 3, 3)

    def least_J(self, state: State) -> float:
        """Least volume ratio J over the quadrature points."""
        return 1 + float(material.kinematics(self.gradient(state)).Jm1.min())

    def assemble(self, state: State, plate: Plate | None) -> Assembly:
        """Residual and tangent at a state with all J > 0."""
        e = self.elements
        k = material.kinematics(self.gradient(state))
        p = (e.pressure_shape @ state.p[self._pressure][..., None])[..., 0]
        W, P, A = self.law(k, self.mu)
        Pp, Ap, C = material.pressure_terms(k, p)
        w, comp = e.weights, e.components
        m, nq, _, nd = e.B.shape
        flat = e.B.reshape(m, -1, nd)
        stress = (w[..., None, None] * (P + Pp)).reshape(m, nq, 9)[..., comp].reshape(m, 1, -1)
        fu = (stress @ flat)[:, 0]
        tangent = (w[..., None, None] * (A + Ap))[..., comp[:, None], comp]
        Kuu = np.swapaxes(flat, 1, 2) @ (tangent @ e.B).reshape(m, -1, nd)
        volume = (w[..., None, None] * C).reshape(m, nq, 9)[..., comp]
        coupling = (volume[..., None, :] @ e.B)[..., 0, :]  # (m, q, nd)
        Kup = np.swapaxes(coupling, 1, 2) @ e.pressure_shape
        fp = (w * (k.Jm1 - p * self.inverse_K)) @ e.pressure_shape
        Kpp = -np.swapaxes(e.pressure_shape, 0, 1) @ ((w * self.inverse_K)[..., None] * e.pressure_shape)
        energy = float(np.sum(w * (W + p * k.Jm1 - p**2 * self.inverse_K / 2)))
        K = np.concatenate(
            [np.concatenate([Kuu, Kup], axis=2), np.concatenate([np.swapaxes(Kup, 1, 2), Kpp], axis=2)], axis=1
        )
        nodal, springs, spring_energy = self._springs(state, plate)
        nodal -= self.dead
        energy -= float(np.sum(self.dead * state.u))
        residual, forces, blocks = self._reduce(state, np.hstack([fu, fp]), K, nodal)
        matrix = self.pattern.assemble(blocks + springs)
        return Assembly(residual, matrix, energy + spring_energy, forces)

    def _springs(self, state: State, plate: Plate | None) -> tuple[Array, list[Array], float]:
        """Nodal forces, matrices per facet and direction, and energy of the plate's springs."""
        nodal = np.zeros(self.elements.nodes.shape)
        s = self.surface
        if s is None:
            return nodal, [], 0.0
        if plate is None:
            none = np.zeros((*s.nodes.shape, s.nodes.shape[1]))
            return nodal, [none] * self.elements.dim, 0.0
        residual, stiffness, energy = contact.traction(s, state.u, plate)
        np.add.at(nodal, s.nodes, np.swapaxes(s.shape, 0, 1) @ (s.weights[..., None] * residual))
        pairs = s.shape[:, :, None] * s.shape[:, None, :]
        blocks = np.tensordot(np.moveaxis(s.weights[..., None] * stiffness, -1, 0), pairs, axes=1)
        return nodal, list(blocks), energy

    def _reduce(self, state: State, f: Array, K: Array, nodal: Array) -> tuple[Array, Array, list[Array]]:
        """Residual, nodal forces and matrices once the magnet's nodes follow its motion; `nodal` are the springs'."""
        e = self.elements
        dim, nd = e.dim, e.B.shape[-1]
        forces = nodal
        np.add.at(forces, e.cells, f[:, :nd].reshape(len(f), -1, dim))
        residual = np.zeros(self.size)
        residual[: self.n_free] = forces[self.free]
        p = self._pressure + self.n_free + self.n_rigid
        residual += np.bincount(p.ravel(), weights=f[:, nd:].ravel(), minlength=self.size)
        inner, outer = K[~self._at_magnet], K[self._at_magnet]
        own = np.zeros((1, self.n_rigid, self.n_rigid))
        if self.rigid:
            motion = self.motion(state.q)
            T = np.zeros((*e.nodes.shape, self.n_rigid))
            T[self.glued] = self.rigid.derivative(motion)
            nr = self.n_rigid
            residual[self.n_free : self.n_free + nr] = np.einsum("ni,nir->r", forces, T)
            Te = np.zeros((len(outer), K.shape[1], nr))
            Te[:, :nd] = T[e.cells[self._at_magnet]].reshape(len(outer), nd, nr)
            KT = outer @ Te
            bottom = np.concatenate([np.swapaxes(KT, 1, 2), np.swapaxes(Te, 1, 2) @ KT], axis=2)
            outer = np.concatenate([np.concatenate([outer, KT], axis=2), bottom], axis=1)
            own[0] = self.rigid.curvature(motion, forces[self.glued])
        return residual, forces, [inner, outer, own]
