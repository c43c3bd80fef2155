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

Symmetric tensors have six components first, in the order of PAIRS.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array

PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
"""Rows and columns of the six components of a symmetric tensor."""
PLACES: NDArray[np.int64] = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""(3, 3) number of each entry among the six components."""
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""Shares of the six components in a product of two tensors."""
_SMALL = 1e-2


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


def full(X: Array) -> Array:
    """Return the (3, 3, ...) form of symmetric tensors (6, ...)."""
    return np.asarray(X[PLACES])


def six(T: Array) -> Array:
    """Return the components (6, ...) of symmetric tensors (3, 3, ...)."""
    rows, columns = np.array(PAIRS).T
    return np.asarray(T[rows, columns])


def determinant(X: Array) -> Array:
    """Return the determinants of symmetric tensors (6, ...)."""
    a, b, c, f, e, d = X
    return np.asarray(a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e))


def inverse(X: Array) -> Array:
    """Return the inverses of symmetric tensors (6, ...)."""
    a, b, c, f, e, d = X
    return np.asarray(
        np.stack([b * c - f * f, a * c - e * e, a * b - d * d, d * e - a * f, d * f - b * e, e * f - c * d])
        / determinant(X)
    )


def cauchy_green(G: Array) -> Array:
    """Return C = F^T F (6, ...) of displacement gradients G = F - 1, shape (3, 3, ...)."""
    return np.stack([G[I, J] + G[J, I] + np.einsum("i...,i...->...", G[:, I], G[:, J]) + (I == J) for I, J in PAIRS])


def viscous_step(viscous: Array, before: Array, dt: Array) -> tuple[Array, Array]:
    """Return A (6, ...) and b (...) of one branch of the law "finite".

    Parameters
    ----------
    viscous, before : C_i and Cbar at the start of the step, (6, ...).
    dt : length of the step over tau.
    """
    rate = contract(before, inverse(viscous)) / 3
    e, w = decay(rate * dt)
    x = rate * dt
    # 1 - w and w - e vanish with x: series keep their digits
    short = x < _SMALL
    late = np.where(short, x / 2 * (1 - x / 3 * (1 - x / 4)), 1 - w)
    early = np.where(short, x / 2 * (1 - 2 * x / 3 * (1 - 3 * x / 8)), w - e)
    return e * viscous + early / rate * before, late / rate


def viscous_strain(A: Array, b: Array, after: Array) -> Array:
    """Return C_i at the end of a step, with Cbar (6, ...) there."""
    X = A + b * after
    return X / np.cbrt(determinant(X))


def branch_stress(A: Array, b: Array, C: Array, J: Array, mu: Array) -> tuple[Array, Array]:
    """Return potential (...) and stress S (6, ...) of one branch over one step.

    `fem.model.viscous_compiled.add_branch` adds both, and the tangent, to the elements.

    Parameters
    ----------
    A, b : from `viscous_step`.
    C, J : right Cauchy-Green tensor (6, ...) and volume ratio at the end of the step.
    mu : g_i mu0, (...).
    """
    less = J ** (-2 / 3)
    X = A + b * (less * C)
    Y = np.cbrt(determinant(X)) * inverse(X)
    trace = contract(Y, C)
    return mu / 2 * (less * trace - 3), mu * less * (Y - trace / 3 * inverse(C))


def dissipation_rate(viscous: Array, C: Array, J: Array, mu: Array, tau: float) -> Array:
    """Return the dissipation per volume and time of one branch of the law "finite", never negative.

    Parameters
    ----------
    viscous : C_i (6, ...).
    mu : g_i mu0.
    """
    M = np.einsum("ij...,jk...->ik...", full(J ** (-2 / 3) * C), full(inverse(viscous)))
    square = np.einsum("ij...,ji...->...", M, M)
    return np.asarray(mu / (2 * tau) * (square - np.einsum("ii...->...", M) ** 2 / 3))


def overstress_energy(Q: Array, C: Array, mu: Array, shares: Array) -> Array:
    """Return the energy per volume (...) that the overstresses Q_i of the law "prony" store.

    It is the sum of |dev F Q_i F^T|^2 / (4 mu_i), exact at small strain. Since |dev F Q F^T|^2 is a quadratic form
    that all branches share, Q : (C Q C) - (Q : C)^2 / 3, only the sum of Q_i Q_i / mu_i enters.

    Parameters
    ----------
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
