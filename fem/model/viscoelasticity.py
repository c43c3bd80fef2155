"""Two viscoelastic laws: what one time step adds to the elastic stress, and what it stores.

Both have branches i with shares g_i of the instantaneous modulus and times tau_i (`geometry.relaxation`), sum g_i +
rest = 1. Stresses are over E and positive in tension; times are in s. The bulk does not relax: pressure and bulk
modulus are those of the elastic law. S_iso is the second Piola-Kirchhoff stress of the design's isochoric energy with
the instantaneous modulus mu0, and C = F^T F.

"prony" (linear in the stress: Simo 1987, Holzapfel 1996) has overstresses Q_i,

    S = rest S_iso(C) + sum_i Q_i + p J C^-1,        dQ_i/dt + Q_i / tau_i = g_i dS_iso/dt.

The step is exact where S_iso is linear in time. With x = dt/tau, e = exp(-x) and w = (1 - e) / x

    Q_i(n+1) = e Q_i(n) + g_i w (S_iso(n+1) - S_iso(n)),

so S = (rest + sum g_i w_i) S_iso(C) + H, where H = sum_i e_i Q_i - g_i w_i S_iso(n) is known: the elastic element
with a scaled modulus, and a dead second Piola-Kirchhoff stress H of energy H : (C - 1) / 2. A body of nu = 0.5 that
is held has S(t) = G(t) / G(0) S(0) exactly. The law has no free energy at large strain: the energy that it stores is
that of small strain, the rest of the work is dissipated. In quick motions of large strain this rate becomes negative:
with a branch of 0.2 by 1 % of the largest power at a logarithmic strain of 0.1 or a shear of 0.4, by more than all of
it at a logarithmic strain of 1. Closed cycles in steady motion dissipate, up to a strain of 0.7 and a shear of 1.5
(`verify`, "sign of the dissipation at a point").

"finite" (Reese and Govindjee 1998 in the form of Kumar and Lopez-Pamies 2016) has neo-Hookean branches with a viscous
strain C_i of determinant 1. With Cbar = J^(-2/3) C

    W = rest W_law(C) + sum_i g_i mu0 / 2 (Cbar : C_i^-1 - 3),    dC_i/dt = (Cbar - (Cbar : C_i^-1)/3 C_i) / tau_i.

It dissipates g_i mu0 / (2 tau_i) (tr M^2 - (tr M)^2 / 3) >= 0, M = Cbar C_i^-1. The step is of second order and keeps
det C_i = 1: with l = Cbar(n) : C_i(n)^-1 / 3, x = l dt / tau and Cbar linear in time

    C_i(n+1) = X / det(X)^(1/3),    X = A + b Cbar(n+1),    A = exp(-x) C_i(n) + a Cbar(n),
    a = ((1 - e)/x - e) / l,        b = (1 - (1 - e)/x) / l.

C_i^-1 = det(X)^(1/3) X^-1 is (3/b) d(det(X)^(1/3)) / dCbar. So the step of a branch has the potential g_i mu0 / 2
(3/b) det(X)^(1/3), and its consistent tangent is symmetric. At small strain both laws agree.

Symmetric tensors have six components first, in the order of PAIRS. Arrays over the integration points have the shape
(..., t, m, q): angles, elements in the order of `nonlinear_system.System`, points of each. What a step adds to the
elements is added in loops that numba compiles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from fem.model import elements, material
from fem.model.elements import Elements
from geometry.arrays import Array, Ints
from geometry.compiled import compiled
from geometry.relaxation import Relaxation

ViscousLaw = Literal["prony", "finite"]

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Rows and columns of the six components of a symmetric tensor."""
PLACES: Ints = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""(3, 3) number of each entry among the six components."""
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""Shares of the six components in a product of two tensors."""
_SMALL = 1e-2
"""Step over tau below which series take the place of differences that lose digits. Their relative error there is at
most 7e-8, and 1.5e-5 in `curvature_weight`, which is an error's."""
_ROWS, _COLUMNS = np.array(PAIRS).T.copy()


def decay(x: Array) -> tuple[Array, Array]:
    """Return e = exp(-x) and w = (1 - e) / x of dt/tau, x >= 0.

    >>> [float(value) for value in decay(np.array(0.0))]
    [1.0, 1.0]
    """
    safe = np.where(x > 0, x, 1.0)
    return np.exp(-x), np.where(x > 0, -np.expm1(-safe) / safe, 1.0)


def curvature_weight(x: Array) -> Array:
    """Return the error of a step over g tau^2 d2S_iso/dt2: the integral that a linear S_iso leaves out.

    It is x/2 (1 + e) - (1 - e), which is x^3/12 for short steps.

    >>> bool(abs(curvature_weight(np.array(1e-3)) / (1e-9 / 12) - 1) < 1e-3)
    True
    """
    e, w = decay(x)
    return np.where(x < _SMALL, x**3 / 12 * (1 - x / 2), x / 2 * (1 + e) - w * x)


def contract(X: Array, Y: Array) -> Array:
    """Return X : Y of symmetric tensors (6, ...)."""
    return np.asarray(np.tensordot(TWICE, X * Y, axes=1))


def invert(X: Array) -> tuple[Array, Array]:
    """Return the inverses (6, ...) and determinants (...) of symmetric tensors (6, ...)."""
    inverses, determinants = np.empty(X.shape), np.empty(X.shape[1:])
    _invert_all(np.ascontiguousarray(X).reshape(6, -1), inverses.reshape(6, -1), determinants.ravel())
    return inverses, determinants


def cauchy_green(G: Array) -> Array:
    """Return C = F^T F (6, ...) of displacement gradients G = F - 1, shape (3, 3, ...)."""
    return np.stack([G[I, J] + G[J, I] + np.einsum("i...,i...->...", G[:, I], G[:, J]) + (I == J) for I, J in PAIRS])


def viscous_step(viscous: Array, before: Array, dt: Array) -> tuple[Array, Array]:
    """Return A (6, ...) and b (...) of one branch of the law "finite".

    viscous, before : C_i and Cbar at the start of the step, (6, ...).
    dt : length of the step over tau.
    """
    rate = contract(before, invert(viscous)[0]) / 3
    e, w = decay(rate * dt)
    x = rate * dt
    # 1 - w and w - e vanish with x: series keep their digits
    short = x < _SMALL
    late = np.where(short, x / 2 * (1 - x / 3 * (1 - x / 4)), 1 - w)
    early = np.where(short, x / 2 * (1 - 2 * x / 3 * (1 - 3 * x / 8)), w - e)
    return e * viscous + early / rate * before, late / rate


def branch_stress(A: Array, b: Array, C: Array, J: Array, mu: Array) -> tuple[Array, Array]:
    """Return energy (...) and stress S (6, ...) of one branch at the end of a step.

    A, b : from `viscous_step`.
    C, J : right Cauchy-Green tensor (6, ...) and volume ratio at the end of the step.
    mu : g_i mu0, (...).
    """
    W, S = np.empty(J.shape), np.empty(C.shape)
    flat = (np.ascontiguousarray(tensors).reshape(6, -1) for tensors in (A, C))
    _branch_stresses(*flat, np.ravel(b), np.ravel(J), W.ravel(), S.reshape(6, -1))
    return mu * W, mu * S


def overstress_energy(Q: Array, C: Array, mu: Array, shares: Array) -> Array:
    """Return the energy per volume (...) that the overstresses Q_i of the law "prony" store.

    It is the sum of |dev F Q_i F^T|^2 / (4 mu_i), exact at small strain. Since |dev F Q F^T|^2 is a quadratic form
    that all branches share, Q : (C Q C) - (Q : C)^2 / 3, only the sum of Q_i Q_i / mu_i enters.

    Q : (b, 6, ...).
    mu, shares : modulus (...), and mu_i over it (b,).
    """
    weighted = Q / (4 * shares.reshape(-1, *(1,) * (Q.ndim - 1)))
    energy = np.zeros(C.shape[1:])
    for a, (I, J) in enumerate(PAIRS):
        for b, (K, L) in enumerate(PAIRS[a:], a):
            form = (C[PLACES[I, K]] * C[PLACES[J, L]] + C[PLACES[I, L]] * C[PLACES[J, K]]) / 2 - C[a] * C[b] / 3
            pairs = np.einsum("b...,b...->...", weighted[:, a], Q[:, b])
            energy += ((1 if a == b else 2) * TWICE[a] * TWICE[b]) * form * pairs
    return np.asarray(energy / mu)


@dataclass(frozen=True, slots=True)
class Overstress:
    """What a step adds to the elastic law: a factor on its modulus, a dead stress, and branches.

    factor : factor on the isochoric law.
    H : (6, t, m, q) dead second Piola-Kirchhoff stress over E; None without.
    branches : A (6, t, m, q) and b (t, m, q) of `viscous_step`, and g_i mu0 over mu, of the law "finite".
    """

    factor: float
    H: Array | None = None
    branches: tuple[tuple[Array, Array, float], ...] = ()

    def part(self, elements: slice) -> Overstress:
        """Return the overstress of some elements, with points (t q m,)."""

        def pick(values: Array) -> Array:
            chosen = values[..., elements, :].swapaxes(-1, -2)
            return chosen.reshape(*chosen.shape[:-3], -1)

        H = None if self.H is None else pick(self.H)
        return Overstress(self.factor, H, tuple((pick(A), pick(b), share) for A, b, share in self.branches))

    def energy(self, C: Array, J: Array, mu: Array) -> Array:
        """Return the energy (...) over E beside the scaled law.

        C, J : right Cauchy-Green tensor (6, ...) and volume ratio (...).
        mu : shear modulus over E.
        """
        W = np.zeros(J.shape)
        if self.H is not None:
            unit = np.array([1.0, 1, 1, 0, 0, 0]).reshape(6, *(1,) * J.ndim)
            W = W + contract(self.H, C - unit) / 2
        for A, b, share in self.branches:
            W = W + branch_stress(A, b, C, J, share * mu)[0]
        return W

    def add(self, G: Array, Jm1: Array, mu: Array, w: Array, W: Array, P: Array, A: Array) -> None:
        """Add to energies, stresses and tangents, with moduli mu and weights w at the points of a batch."""
        if self.H is not None:
            add_dead_stress(G, self.H, w, W, P, A)
        for A0, b0, share in self.branches:
            add_branch(G, Jm1, A0, b0, share * mu, w, W, P, A)


@compiled
def add_dead_stress(G, H, w, W, P, A):
    """Add energy H : (C - 1) / 2, stress F H, and tangent delta_ik H_JL, times the weights."""
    n = len(w)
    weighted = np.empty((6, n))
    for a in range(6):
        row, stress = weighted[a], H[a]
        for x in range(n):
            row[x] = w[x] * stress[x]
    for i in range(3):
        for J in range(3):
            row, dead = P[3 * i + J], weighted[PLACES[i, J]]
            a, b, c = G[3 * i], G[3 * i + 1], G[3 * i + 2]
            first, second, third = weighted[PLACES[0, J]], weighted[PLACES[1, J]], weighted[PLACES[2, J]]
            slope = G[3 * i + J]
            for x in range(n):
                force = a[x] * first[x] + b[x] * second[x] + c[x] * third[x]
                row[x] += dead[x] + force
                W[x] += slope[x] * (dead[x] + force / 2)
            if A.shape[2]:
                for L in range(3):
                    out, stress = A[3 * i + J, 3 * i + L], weighted[PLACES[J, L]]
                    for x in range(n):
                        out[x] += stress[x]


@compiled
def _invert(X, out):
    """Write the inverse of a symmetric tensor (6,); return its determinant."""
    a, b, c, f, e, d = X[0], X[1], X[2], X[3], X[4], X[5]
    det = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    out[0], out[1], out[2] = (b * c - f * f) / det, (a * c - e * e) / det, (a * b - d * d) / det
    out[3], out[4], out[5] = (d * e - a * f) / det, (d * f - b * e) / det, (e * f - c * d) / det
    return det


@compiled
def _invert_all(X, inverses, determinants):
    for x in range(len(determinants)):
        determinants[x] = _invert(X[:, x], inverses[:, x])


@compiled
def _branch_stress(A, b, C, less, Ci, Xi, S):
    """Write C^-1, X^-1 and the stress of a branch over mu; return Y : C, det(X)^(1/3) and the energy over mu.

    X = A + b Cbar and Y = det(X)^(1/3) X^-1; less is J^(-2/3).
    """
    _invert(C, Ci)
    for a in range(6):
        S[a] = A[a] + b * less * C[a]
    root, trace = _invert(S, Xi) ** (1 / 3), 0.0
    for a in range(6):
        trace += (1.0 if a < 3 else 2.0) * root * Xi[a] * C[a]
    for a in range(6):
        S[a] = less * (root * Xi[a] - trace / 3 * Ci[a])
    return trace, root, (less * trace - 3) / 2


@compiled
def _branch_stresses(A, C, b, J, W, S):
    Ci, Xi = np.empty(6), np.empty(6)
    for x in range(len(W)):
        W[x] = _branch_stress(A[:, x], b[x], C[:, x], J[x] ** (-2 / 3), Ci, Xi, S[:, x])[2]


@compiled
def _sandwich(X, a, b):
    """Return an entry of (X_IK X_JL + X_IL X_JK) / 2, which maps dC to X dC X."""
    I, J, K, L = _ROWS[a], _COLUMNS[a], _ROWS[b], _COLUMNS[b]
    return (X[PLACES[I, K]] * X[PLACES[J, L]] + X[PLACES[I, L]] * X[PLACES[J, K]]) / 2


@compiled
def add_branch(G, Jm1, A0, b0, mu, w, W, P, A):
    """Add a branch of the law "finite", `_branch_stress`, with A0 (6, n), b0 and mu (n,).

    With X and Y as there, dY = det(X)^(1/3) b (Xi (Xi : dCbar) / 3 - Xi dCbar Xi), where
    Xi = X^-1 and dCbar = J^(-2/3) (dC - C (C^-1 : dC) / 3). P_iJ gains F_iI S_IJ, and its tangent delta_ik S_JL +
    F_iI F_kK (2 dS/dC)_IJKL.
    """
    C, Ci, Xi, S, along = np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    F, CC, inner, half = np.empty((3, 3)), np.empty((6, 6)), np.empty((6, 6)), np.empty((9, 6))
    for x in range(len(w)):
        for i in range(3):
            for J in range(3):
                F[i, J] = G[3 * i + J, x] + (1.0 if i == J else 0.0)
        for a in range(6):
            I, J = _ROWS[a], _COLUMNS[a]
            C[a] = F[0, I] * F[0, J] + F[1, I] * F[1, J] + F[2, I] * F[2, J]
        less, b = (1 + Jm1[x]) ** (-2 / 3), b0[x]
        trace, root, energy = _branch_stress(A0[:, x], b, C, less, Ci, Xi, S)
        scale = w[x] * mu[x] * less
        W[x] += w[x] * mu[x] * energy
        for a in range(6):
            S[a] *= w[x] * mu[x]
        for i in range(3):
            for J in range(3):
                for I in range(3):
                    P[3 * i + J, x] += F[i, I] * S[PLACES[I, J]]
        if not A.shape[2]:
            continue
        twice = 0.0
        for a in range(6):
            along[a] = 0.0
            for d in range(6):
                inner[a, d] = 2 * scale * less * root * b * (Xi[a] * Xi[d] / 3 - _sandwich(Xi, a, d))
                along[a] += inner[a, d] * (1.0 if d < 3 else 2.0) * C[d]
            twice += (1.0 if a < 3 else 2.0) * along[a] * C[a]
        for a in range(6):
            for d in range(6):
                CC[a, d] = (
                    inner[a, d]
                    - (along[a] * Ci[d] + Ci[a] * along[d]) / 3
                    + (twice / 9 - 2 / 9 * scale * trace) * Ci[a] * Ci[d]
                    + 2 / 3 * scale * trace * _sandwich(Ci, a, d)
                    - 2 / 3 * (Ci[a] * S[d] + S[a] * Ci[d])
                )
        _add_tangent(F, S, CC, half, x, A)


@compiled
def _add_tangent(F, S, CC, half, x, A):
    """Add delta_ik S_JL + F_iI F_kK (2 dS/dC)_IJKL at point x; half (9, 6) is overwritten."""
    for i in range(3):
        for J in range(3):
            for d in range(6):
                half[3 * i + J, d] = 0.0
                for I in range(3):
                    half[3 * i + J, d] += F[i, I] * CC[PLACES[I, J], d]
    for e in range(9):
        for k in range(3):
            for L in range(3):
                total = S[PLACES[e % 3, L]] if e // 3 == k else 0.0
                for K in range(3):
                    total += F[k, K] * half[e, PLACES[K, L]]
                A[e, 3 * k + L, x] += total


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
class History:
    """History of the integration points by one of the two laws.

    Attributes
    ----------
    law : "prony" or "finite".
    relaxation : branches of the silicone.
    instantaneous : instantaneous modulus over the modulus E of the design, 1 or 1 / rest.
    internal : (b, 6, t, m, q) overstresses Q_i over E, or viscous strains C_i.
    last : (6, t, m, q) S_iso with the modulus E, or Cbar, at the same time.
    """

    law: ViscousLaw
    relaxation: Relaxation
    instantaneous: float
    internal: Array
    last: Array

    @property
    def times(self) -> Array:
        """(b,) times of the branches, s."""
        return np.array(self.relaxation.times)

    @property
    def moduli(self) -> Array:
        """(b,) moduli of the branches over E."""
        return self.instantaneous * np.array(self.relaxation.shares)

    @property
    def long_term(self) -> float:
        """Long-term modulus over E."""
        return self.instantaneous * self.relaxation.rest

    def overstress(self, dt: float) -> Overstress:
        """Return what a step of length dt, s, adds."""
        if self.law == "finite":
            branches = zip(self._viscous_steps(dt), self.moduli.tolist(), strict=True)
            return Overstress(self.long_term, branches=tuple((A, b, share) for (A, b), share in branches))
        e, w = decay(dt / self.times)
        risen = float(self.moduli @ w)
        return Overstress(self.long_term + risen, np.tensordot(e, self.internal, axes=1) - risen * self.last)

    def advance(self, now: PointState, dt: float) -> History:
        """Return the history after a step to a state."""
        internal = np.empty_like(self.internal)
        if self.law == "finite":
            Cbar = now.J ** (-2 / 3) * now.C
            for after, (A, b) in zip(internal, self._viscous_steps(dt), strict=True):
                X = A + b * Cbar
                np.divide(X, np.cbrt(invert(X)[1]), out=after)
            return replace(self, internal=internal, last=Cbar)
        e, w = decay(dt / self.times)
        gained = now.S - self.last
        # branch by branch, for all at once would need another array as large
        for after, before, decayed, share in zip(internal, self.internal, e, self.moduli * w, strict=True):
            np.multiply(before, decayed, out=after)
            after += share * gained
        return replace(self, internal=internal, last=now.S)

    def stored(self, now: PointState) -> float:
        """Return the energy stored by the isochoric stresses."""
        return now.integral(self.density(now))

    def density(self, now: PointState) -> Array:
        """Return the energy per volume that the isochoric stresses store, shape (t, m, q)."""
        energy = self.long_term * now.W
        if self.law == "finite":
            for modulus, Ci in zip(self.moduli, self.internal, strict=True):
                energy = energy + modulus * now.mu / 2 * (contract(self.last, invert(Ci)[0]) - 3)
        elif len(self.internal):
            energy = energy + overstress_energy(self.internal, now.C, now.mu, self.moduli)
        return np.asarray(energy)

    def stress(self, now: PointState) -> Array:
        """Return the isochoric second Piola-Kirchhoff stress (6, t, m, q) at the state of the history."""
        S = self.long_term * now.S
        if self.law == "prony":
            return np.asarray(S + self.internal.sum(axis=0))
        for modulus, Ci in zip(self.moduli, self.internal, strict=True):
            # a step of length 0 leaves C_i as it is
            S = S + branch_stress(Ci, np.zeros(now.J.shape), now.C, now.J, modulus * now.mu)[1]
        return S

    def _viscous_steps(self, dt: float) -> list[tuple[Array, Array]]:
        """Return A and b of each branch after a step of length dt, s."""
        return [viscous_step(Ci, self.last, dt / tau) for Ci, tau in zip(self.internal, self.times, strict=True)]

    def revolve(self, angles: int) -> History:
        """Return the history of a section without angles at several angles."""
        internal, last = (np.repeat(values, angles, axis=-3) for values in (self.internal, self.last))
        return replace(self, internal=internal, last=last)


def measure(e: Elements, law: material.Law, mu: Array, u: Array) -> PointState:
    """Return strain, energy and stress at the integration points, for nodal fields u and shear moduli mu (m, 1)."""
    (m, q), t = e.weights.shape, len(e.angles.theta)
    G = elements.gradient(e, slice(0, m), u)
    Jm1, Hm1 = (values.reshape(*values.shape[:-1], m, q * t) for values in material.strains(G.reshape(9, -1)))
    H = Hm1.reshape(G.shape) + np.eye(3)[:, :, None, None]
    W, P, _ = material.evaluate(law, G, mu, tangent=False)
    # S = F^-1 P, and H = F^-T
    S = np.stack([np.einsum("i...,i...->...", H[:, I], P[:, J]) for I, J in PAIRS])

    def by_angle(values: Array) -> Array:
        return np.ascontiguousarray(np.moveaxis(values.reshape(*values.shape[:-1], q, t), -1, -3))

    weights = e.angles.weights[:, None, None] * e.weights
    return PointState(by_angle(cauchy_green(G)), by_angle(1 + Jm1), by_angle(W), by_angle(S), weights, mu)


def at_rest(
    law: ViscousLaw, relaxation: Relaxation, points: tuple[int, int, int], instantaneous: float = 1.0
) -> History:
    """Return the history of an undeformed body with points (t, m, q); for the others see `History`."""
    last = np.zeros((6, *points))
    if law == "finite":
        last[:3] = 1.0
    return History(law, relaxation, instantaneous, np.repeat(last[None], len(relaxation.times), axis=0), last)
