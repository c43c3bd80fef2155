"""Hyperelastic laws: one function per energy, with stress and tangent beside it.

The argument is the displacement gradient G = F - 1, not F: the stresses are written so that no digits are lost
when G is small (a contact of a nanometre has strains of 1e-12 far from the patch).

Near incompressibility is treated by a perturbed Lagrangian with an independent pressure p,

    Psi(F, p) = W(F) + p (J - 1) - p^2 / (2 K),        J = det F,

whose stationary point in p is p = K (J - 1), that is a volumetric energy K/2 (J - 1)^2. 1/K = 0 (nu = 0.5) is
allowed. W is isochoric, so p is minus the mean Cauchy pressure.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DELTA9 = np.eye(9)


class Kinematics(NamedTuple):
    """What every law needs of a displacement gradient G of shape (..., 3, 3)."""

    G: Array
    """Displacement gradient, shape (..., 3, 3)."""
    Jm1: Array
    """J - 1 to full relative precision, shape (...)."""
    H: Array
    """F^-T, shape (..., 3, 3)."""


def kinematics(G: Array) -> Kinematics:
    """Volume change and F^-T of a displacement gradient, shape (..., 3, 3); J must not vanish."""
    F = G + np.eye(3)
    cof = np.empty_like(G)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            cof[..., i, a] = F[..., j, b] * F[..., k, c] - F[..., j, c] * F[..., k, b]
    trace = G[..., 0, 0] + G[..., 1, 1] + G[..., 2, 2]
    second = (
        G[..., 0, 0] * G[..., 1, 1]
        - G[..., 0, 1] * G[..., 1, 0]
        + G[..., 1, 1] * G[..., 2, 2]
        - G[..., 1, 2] * G[..., 2, 1]
        + G[..., 0, 0] * G[..., 2, 2]
        - G[..., 0, 2] * G[..., 2, 0]
    )
    third = (
        G[..., 0, 0] * (G[..., 1, 1] * G[..., 2, 2] - G[..., 1, 2] * G[..., 2, 1])
        - G[..., 0, 1] * (G[..., 1, 0] * G[..., 2, 2] - G[..., 1, 2] * G[..., 2, 0])
        + G[..., 0, 2] * (G[..., 1, 0] * G[..., 2, 1] - G[..., 1, 1] * G[..., 2, 0])
    )
    Jm1 = trace + second + third
    return Kinematics(G, Jm1, cof / (1 + Jm1)[..., None, None])


def lame(E: float, nu: float) -> tuple[float, float]:
    """Shear modulus and the inverse of the bulk modulus (0 for nu = 0.5).

    >>> lame(3.0, 0.5)
    (1.0, 0.0)
    """
    return E / (2 * (1 + nu)), 3 * (1 - 2 * nu) / E


def _cross(H: Array) -> Array:
    """H_iL H_kJ as a matrix over the pairs (iJ), (kL), shape (..., 9, 9)."""
    product = H[..., :, None, None, :] * np.swapaxes(H, -1, -2)[..., None, :, :, None]
    return np.asarray(product.reshape(*H.shape[:-2], 9, 9))


def neo_hookean(k: Kinematics, mu: Array | float) -> tuple[Array, Array, Array]:
    """Isochoric neo-Hookean law, W = mu/2 (J^-2/3 tr(F^T F) - 3).

    P = mu J^-2/3 (F - I1/3 F^-T), written as mu J^-2/3 [(G + G^T + G G^T) F^-T - (I1 - 3)/3 F^-T].

    Parameters
    ----------
    k : kinematics of G, shape (..., 3, 3).
    mu : shear modulus, a number or shape (...), MPa.

    Returns
    -------
    W (...), first Piola-Kirchhoff stress P (..., 3, 3), tangent dP/dF (..., 9, 9), MPa.
    """
    G, H = k.G, k.H
    strain = G + np.swapaxes(G, -1, -2) + G @ np.swapaxes(G, -1, -2)
    I1m3 = strain[..., 0, 0] + strain[..., 1, 1] + strain[..., 2, 2]
    log_J = np.log1p(k.Jm1)
    s = mu * np.exp(-2 / 3 * log_J)
    W = mu / 2 * (np.exp(-2 / 3 * log_J) * I1m3 + 3 * np.expm1(-2 / 3 * log_J))
    P = s[..., None, None] * (strain @ H - (I1m3 / 3)[..., None, None] * H)
    F9 = (G + np.eye(3)).reshape(*G.shape[:-2], 9)
    H9 = H.reshape(*G.shape[:-2], 9)
    I1 = I1m3 + 3
    left = (-2 / 3 * s)[..., None] * F9 + (s * I1 / 9)[..., None] * H9
    A = left[..., :, None] * H9[..., None, :]
    A = A + np.swapaxes(A, -1, -2) + s[..., None, None] * _DELTA9 + (s * I1 / 3)[..., None, None] * _cross(H)
    return W, P, A


def pressure_terms(k: Kinematics, p: Array) -> tuple[Array, Array, Array]:
    """Stress and tangent of p (J - 1), and their derivative by p.

    Returns
    -------
    P = p J F^-T (..., 3, 3), tangent (..., 9, 9), dP/dp = J F^-T (..., 3, 3).
    """
    J = 1 + k.Jm1
    cof = J[..., None, None] * k.H
    H9 = k.H.reshape(*k.H.shape[:-2], 9)
    A = (p * J)[..., None, None] * (H9[..., :, None] * H9[..., None, :] - _cross(k.H))
    return p[..., None, None] * cof, A, cof
