"""The viscous history of a body at its integration points.

Arrays over points have the shape (..., t, m, q): angles, elements in the order of `nonlinear_system.System`, points
of each. The two histories have the same methods: `overstress` before a step, `advance` after it. Equations:
`fem.model.viscoelasticity`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem.model import element_integrals, material
from fem.model import viscoelasticity as laws
from fem.model.elements import Elements
from fem.model.overstress import Overstress, ViscousBranch
from geometry.arrays import Array


@dataclass(frozen=True, slots=True)
class Branches:
    """Branches of the silicone in units of the given modulus.

    Attributes
    ----------
    shares, times : (b,) g_i of the instantaneous modulus, and tau_i in s.
    instantaneous : instantaneous modulus over the modulus E of the design, 1 or 1 / rest.
    """

    shares: Array
    times: Array
    instantaneous: float

    @property
    def rest(self) -> float:
        """Long-term over instantaneous modulus."""
        return 1 - float(self.shares.sum())

    @property
    def long_term(self) -> float:
        """Long-term modulus over E."""
        return self.instantaneous * self.rest

    @property
    def moduli(self) -> Array:
        """Moduli of the branches over E, (b,)."""
        return self.instantaneous * self.shares


@dataclass(frozen=True, slots=True)
class PointState:
    """Strain and elastic stress at the integration points of a state.

    Attributes
    ----------
    C : (6, t, m, q) right Cauchy-Green tensor.
    J : (t, m, q) volume ratio.
    W, S : (t, m, q) and (6, t, m, q) isochoric energy and second Piola-Kirchhoff stress with the modulus E.
    weights : (t, m, q) volumes of the points.
    mu : shear modulus of the elements, (m, 1).
    """

    C: Array
    J: Array
    W: Array
    S: Array
    weights: Array
    mu: Array

    def integral(self, values: Array) -> float:
        """Return the integral of values (t, m, q) over the body."""
        return float(np.vdot(self.weights, values))


@dataclass(frozen=True, slots=True)
class LinearHistory:
    """History of the law "prony": overstresses Q (b, 6, t, m, q) over E, and S_iso with E at the same time."""

    branches: Branches
    Q: Array
    S: Array

    def overstress(self, dt: float) -> Overstress:
        """Return what a step of length dt, s, adds."""
        own = self.branches
        e, w = laws.decay(dt / own.times)
        risen = float(own.moduli @ w)
        return Overstress(own.long_term + risen, np.tensordot(e, self.Q, axes=1) - risen * self.S)

    def advance(self, now: PointState, dt: float) -> LinearHistory:
        """Return the history after a step to a state."""
        own = self.branches
        e, w = laws.decay(dt / own.times)
        gained = now.S - self.S
        Q = np.empty_like(self.Q)
        # branch by branch, for all at once would need another array as large as Q
        for after, before, decayed, share in zip(Q, self.Q, e, own.moduli * w, strict=True):
            np.multiply(before, decayed, out=after)
            after += share * gained
        return replace(self, Q=Q, S=now.S)

    def stored(self, now: PointState) -> float:
        """Return the energy stored by the isochoric stresses."""
        own = self.branches
        energy = own.long_term * now.W
        if len(own.times):
            energy = energy + laws.overstress_energy(self.Q, now.C, now.mu, own.moduli)
        return now.integral(energy)

    def stress(self, now: PointState) -> Array:
        """Return the isochoric second Piola-Kirchhoff stress (6, t, m, q) at the state of the history."""
        return np.asarray(self.branches.long_term * now.S + self.Q.sum(axis=0))

    def revolve(self, angles: int) -> LinearHistory:
        """Return the history of a section without angles at several angles."""
        return replace(self, Q=np.repeat(self.Q, angles, axis=-3), S=np.repeat(self.S, angles, axis=-3))


@dataclass(frozen=True, slots=True)
class FiniteHistory:
    """History of the law "finite": viscous strains (b, 6, t, m, q), and Cbar (6, t, m, q) at the same time."""

    branches: Branches
    viscous: Array
    Cbar: Array

    def overstress(self, dt: float) -> Overstress:
        """Return what a step of length dt, s, adds."""
        branches = tuple(
            ViscousBranch(A, b, float(modulus))
            for (A, b), modulus in zip(self._steps(dt), self.branches.moduli, strict=True)
        )
        return Overstress(self.branches.long_term, branches=branches)

    def advance(self, now: PointState, dt: float) -> FiniteHistory:
        """Return the history after a step to a state."""
        Cbar = now.J ** (-2 / 3) * now.C
        viscous = [laws.viscous_strain(A, b, Cbar) for A, b in self._steps(dt)]
        return replace(self, viscous=np.array(viscous).reshape(self.viscous.shape), Cbar=Cbar)

    def stored(self, now: PointState) -> float:
        """Return the energy stored by the isochoric stresses."""
        energy = self.branches.long_term * now.W
        for modulus, Ci in zip(self.branches.moduli, self.viscous, strict=True):
            stretch = laws.contract(self.Cbar, laws.inverse(Ci)) - 3
            energy = energy + modulus * now.mu / 2 * stretch
        return now.integral(energy)

    def stress(self, now: PointState) -> Array:
        """Return the isochoric second Piola-Kirchhoff stress (6, t, m, q) at the state of the history."""
        S, still = self.branches.long_term * now.S, np.zeros(now.J.shape)
        for modulus, Ci in zip(self.branches.moduli, self.viscous, strict=True):
            # a step of length 0 leaves C_i as it is
            _, own = laws.branch_stress(Ci, still, now.C, now.J, modulus * now.mu)
            S = S + own
        return S

    def _steps(self, dt: float) -> list[tuple[Array, Array]]:
        """Return A and b of each branch after a step of length dt, s, as `viscoelasticity.viscous_step`."""
        return [
            laws.viscous_step(Ci, self.Cbar, dt / tau)
            for Ci, tau in zip(self.viscous, self.branches.times, strict=True)
        ]

    def revolve(self, angles: int) -> FiniteHistory:
        """Return the history of a section without angles at several angles."""
        return replace(
            self, viscous=np.repeat(self.viscous, angles, axis=-3), Cbar=np.repeat(self.Cbar, angles, axis=-3)
        )


def measure(e: Elements, law: material.Law, mu: Array, u: Array) -> PointState:
    """Return strain, energy and stress at the integration points, for nodal fields u and shear moduli mu (m, 1)."""
    (m, q), t = e.weights.shape, len(e.angles.theta)
    G = element_integrals.gradient(e, slice(0, m), u)
    Jm1, Hm1 = (values.reshape(*values.shape[:-1], m, q * t) for values in material.strains(G.reshape(9, -1)))
    H = Hm1.reshape(G.shape) + np.eye(3)[:, :, None, None]
    W, P, _ = material.evaluate(law, G, mu, tangent=False)
    # S = F^-1 P, and H = F^-T
    S = np.stack([np.einsum("i...,i...->...", H[:, I], P[:, J]) for I, J in laws.PAIRS])

    def by_angle(values: Array) -> Array:
        return np.ascontiguousarray(np.moveaxis(values.reshape(*values.shape[:-1], q, t), -1, -3))

    weights = e.angles.weights[:, None, None] * e.weights
    return PointState(by_angle(laws.cauchy_green(G)), by_angle(1 + Jm1), by_angle(W), by_angle(S), weights, mu)


History = LinearHistory | FiniteHistory


def at_rest(law: str, branches: Branches, points: tuple[int, int, int]) -> History:
    """Return the history of an undeformed body with points (t, m, q), by the law "prony" or "finite"."""
    count, zero = len(branches.times), np.zeros((6, *points))
    if law == "prony":
        return LinearHistory(branches, np.zeros((count, 6, *points)), zero)
    unit = zero.copy()
    unit[:3] = 1.0
    return FiniteHistory(branches, np.repeat(unit[None], count, axis=0), unit)
