"""Hyperelastic laws: one function per energy, with stress and tangent beside it.

The argument is the displacement gradient G = F - 1, not F: the stresses are written so that no digits are lost
when G is small (a contact of a nanometre has strains of 1e-12 far from the patch).

Near incompressibility is treated by a perturbed Lagrangian with an independent pressure p,

    Psi(F, p) = W(F) + p (J - 1) - p^2 / (2 K),        J = det F,

whose stationary point in p is p = K (J - 1), that is a volumetric energy K/2 (J - 1)^2. 1/K = 0 (nu = 0.5) is
allowed. W is isochoric, so p is minus the mean Cauchy pressure.

Every law has the shear modulus mu at small strain as its scale; what else it takes are pure numbers, so stresses are
proportional to mu at any strain.
"""

from __future__ import annotations

import functools
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEAST = 1e-15 - 1
_NONE: Array = np.empty(0)


class Kinematics(NamedTuple):
    """What every law needs of a displacement gradient G of shape (..., 3, 3)."""

    G: Array
    """Displacement gradient, shape (..., 3, 3)."""
    Jm1: Array
    """J - 1 to full relative precision, shape (...)."""
    H: Array
    """F^-T, shape (..., 3, 3)."""
    components: NDArray[np.int64] | None = None
    """Positions (c,) in a row-major 3 x 3 tensor that tangents are wanted for, all 9 if None. The others must
    not couple to them, as in a section of revolution."""
    tangent: bool = True
    """Whether tangents are wanted at all; if not, empty ones are returned."""


class Law(Protocol):
    """A law with its numbers: from kinematics, mu and a pressure to W, P and dP/dF, as `neo_hookean`."""

    def __call__(self, k: Kinematics, mu: Array | float, p: Array | float = ..., /) -> tuple[Array, Array, Array]: ...


def law(name: str, numbers: tuple[float, ...] = ()) -> Law:
    """The law of a name of `geometry.design.LAWS`, with its numbers in the order given there."""
    match name, numbers:
        case "neo-hookean", ():
            return neo_hookean
        case "mooney-rivlin", (share,):
            return functools.partial(mooney_rivlin, share=share)
        case "yeoh", (c2, c3):
            return functools.partial(yeoh, c2=c2, c3=c3)
        case "ogden", (alpha1, alpha2, share):
            return functools.partial(ogden, alphas=(alpha1, alpha2), shares=(1 - share, share))
    raise ValueError(f"there is no law {name} with {len(numbers)} numbers")


def kinematics(
    G: Array, Jm1: Array | None = None, components: NDArray[np.int64] | None = None, *, tangent: bool = True
) -> Kinematics:
    """Volume change (unless J - 1 is given) and F^-T of a displacement gradient, shape (..., 3, 3), J not zero."""
    if Jm1 is None:
        Jm1 = volume_change(G)
    F = G + np.eye(3)
    cof = np.empty_like(G)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            cof[..., i, a] = F[..., j, b] * F[..., k, c] - F[..., j, c] * F[..., k, b]
    return Kinematics(G, Jm1, cof / (1 + Jm1)[..., None, None], components, tangent)


def volume_change(G: Array) -> Array:
    """J - 1 of a displacement gradient, shape (..., 3, 3), to full relative precision."""
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
    return np.asarray(trace + second + third)


def lame(E: float, nu: float) -> tuple[float, float]:
    """Shear modulus and the inverse of the bulk modulus (0 for nu = 0.5).

    >>> lame(3.0, 0.5)
    (1.0, 0.0)
    """
    return E / (2 * (1 + nu)), 3 * (1 - 2 * nu) / E


def _vector(T: Array) -> Array:
    """Tensors (..., 3, 3) as row-major vectors (..., 9)."""
    return T.reshape(*T.shape[:-2], 9)


def _wanted(T: Array, k: Kinematics) -> Array:
    """The components of tensors (..., 3, 3) that tangents are wanted for, (..., c)."""
    return _vector(T) if k.components is None else _vector(T).take(k.components, axis=-1)


def _tangent(k: Kinematics, x: Array, cross: Array) -> Array:
    """x H + H x, for x (..., c), and `cross` (...) times H_iL H_kJ, shape (..., c, c).

    With all nine components the points come last in memory: their loops are long, those over components are not.
    """
    if k.components is not None:
        A = x[..., :, None] * _wanted(k.H, k)[..., None, :]
        A = A + np.swapaxes(A, -1, -2)
        A += _pairs(cross[..., None, None] * k.H, k.H, k.components)
        return A
    X, H = (np.ascontiguousarray(v.reshape(-1, 9).T) for v in (x, k.H))
    A = X[:, None] * H
    A += H[:, None] * X
    left, right = (cross.ravel() * H).reshape(3, 1, 1, 3, -1), np.swapaxes(H.reshape(3, 3, -1), 0, 1)
    A.reshape(3, 3, 3, 3, -1)[...] += left * right[None, :, :, None]
    return np.moveaxis(A.reshape(9, 9, *x.shape[:-1]), (0, 1), (-2, -1))


def _restricted(A: Array, k: Kinematics) -> Array:
    """The components of a tangent (..., 9, 9) that are wanted."""
    return A if k.components is None else A[..., k.components[:, None], k.components]


def _cross(H: Array, components: NDArray[np.int64] | None = None) -> Array:
    """H_iL H_kJ as a matrix over the pairs (iJ), (kL), shape (..., 9, 9), or over some of them."""
    return _pairs(H, H, components)


def _pairs(X: Array, Y: Array, components: NDArray[np.int64] | None = None) -> Array:
    """X_iL Y_kJ as a matrix over the pairs (iJ), (kL), shape (..., 9, 9), or over some of them."""
    if components is not None:
        i, J = np.divmod(components, 3)
        first, second = 3 * i[:, None] + J, 3 * i + J[:, None]
        return np.asarray(_vector(X).take(first, axis=-1) * _vector(Y).take(second, axis=-1))
    product = np.einsum("...il,...kj->...ijkl", X, Y)
    return np.asarray(product.reshape(*X.shape[:-2], 9, 9))


def neo_hookean(k: Kinematics, mu: Array | float, p: Array | float = 0.0) -> tuple[Array, Array, Array]:
    """Isochoric neo-Hookean law, W = mu/2 (J^-2/3 tr(F^T F) - 3), and p (J - 1).

    P = mu J^-2/3 (F - I1/3 F^-T) + p J F^-T; the first is written as mu J^-2/3 [(G + G^T + G G^T) - (I1 - 3)/3] F^-T.

    Parameters
    ----------
    k : kinematics of G, shape (..., 3, 3).
    mu : shear modulus, a number or shape (...), MPa.
    p : pressure (minus the mean Cauchy pressure), a number or shape (...), MPa; its energy, stress and tangent are
        added to those of the law.

    Returns
    -------
    W (...), first Piola-Kirchhoff stress P (..., 3, 3), tangent dP/dF (..., 9, 9) or (..., c, c), MPa.
    """
    G, H = k.G, k.H
    turned = np.ascontiguousarray(np.swapaxes(G, -1, -2))
    strain = G + turned + G @ turned
    I1m3 = strain[..., 0, 0] + strain[..., 1, 1] + strain[..., 2, 2]
    log_J = np.log1p(k.Jm1)
    s = mu * np.exp(-2 / 3 * log_J)
    pJ = p * (1 + k.Jm1)
    W = mu / 2 * (np.exp(-2 / 3 * log_J) * I1m3 + 3 * np.expm1(-2 / 3 * log_J)) + p * k.Jm1
    P = s[..., None, None] * (strain @ H) + (pJ - s * I1m3 / 3)[..., None, None] * H
    if not k.tangent:
        return W, P, _NONE
    F9, H9 = _wanted(G + np.eye(3), k), _wanted(H, k)
    I1 = I1m3 + 3
    A = _tangent(k, (-2 / 3 * s)[..., None] * F9 + (s * I1 / 9 + pJ / 2)[..., None] * H9, s * I1 / 3 - pJ)
    diagonal = np.einsum("...ii->...i", A)
    diagonal += s[..., None]
    return W, P, A


def mooney_rivlin(
    k: Kinematics, mu: Array | float, p: Array | float = 0.0, *, share: float
) -> tuple[Array, Array, Array]:
    """Isochoric Mooney-Rivlin law, W = mu/2 [(1 - share) (I1' - 3) + share (I2' - 3)], I' of J^-1/3 F.

    I2'(F) = I1'(F^-T), so the second term is the neo-Hookean law of H = F^-T, with Q its stress:
    P = -H Q^T H, and dH = -H dF^T H gives the tangent. H - 1 = -G^T H keeps the digits of small strain.

    Parameters
    ----------
    share : C01 / (C10 + C01), with C10 + C01 = mu / 2.

    Returns
    -------
    As `neo_hookean`.
    """
    W1, P1, A1 = neo_hookean(k._replace(components=None), (1 - share) * mu, p)
    H = k.H
    inverse = Kinematics(-np.swapaxes(k.G, -1, -2) @ H, -k.Jm1 / (1 + k.Jm1), k.G + np.eye(3), tangent=k.tangent)
    W2, Q, B = neo_hookean(inverse, share * mu)
    P2 = -H @ np.swapaxes(Q, -1, -2) @ H
    W, P = W1 + W2, P1 + P2
    if not k.tangent:
        return W, P, _NONE
    cross = _cross(H)
    mixed = _pairs(H, P2)
    A2 = cross @ B @ cross - mixed - np.swapaxes(mixed, -1, -2)
    return W, P, _restricted(A1 + A2, k)


def yeoh(
    k: Kinematics, mu: Array | float, p: Array | float = 0.0, *, c2: float, c3: float
) -> tuple[Array, Array, Array]:
    """Isochoric Yeoh law, W = mu/2 (x + c2 x^2 + c3 x^3) with x = I1' - 3, I1' of J^-1/3 F.

    Parameters
    ----------
    c2, c3 : C20 / C10 and C30 / C10, with C10 = mu / 2.

    Returns
    -------
    As `neo_hookean`.
    """
    half, slope, A = neo_hookean(k, 1.0)
    x = 2 * half
    first = mu * (1 + 2 * c2 * x + 3 * c3 * x**2)
    second = mu * (2 * c2 + 6 * c3 * x)
    W, P = mu / 2 * x * (1 + c2 * x + c3 * x**2), first[..., None, None] * slope
    if not k.tangent:
        return _pressed(W, P, _NONE, k, p)
    slope9 = _wanted(slope, k)
    bend = (2 * second)[..., None, None] * slope9[..., :, None] * slope9[..., None, :]
    return _pressed(W, P, first[..., None, None] * A + bend, k, p)


def ogden(
    k: Kinematics, mu: Array | float, p: Array | float = 0.0, *, alphas: tuple[float, ...], shares: tuple[float, ...]
) -> tuple[Array, Array, Array]:
    """Isochoric Ogden law, W = sum_i 2 mu_i / alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3), l of J^-1/3 F.

    In logarithms h of the stretches, less their mean, the principal Kirchhoff stresses are
    tau_a = t_a - mean(t), t_a = sum_i 2 mu_i / alpha_i (exp(alpha_i h_a) - 1). The tangent in the principal frame
    holds divided differences of S_a = tau_a / l_a^2, sums of exponentials of h_a, over l_a^2: these are quotients of
    hyperbolic sines, exact for equal and nearly equal stretches alike.

    Parameters
    ----------
    alphas, shares : exponents, not 0, and mu_i / mu, which add up to 1.

    Returns
    -------
    As `neo_hookean`.
    """
    G = k.G
    twice = G + np.swapaxes(G, -1, -2) + np.swapaxes(G, -1, -2) @ G
    e, N = np.linalg.eigh(twice)
    h = np.log1p(np.maximum(e, _LEAST)) / 2
    middle = h.mean(axis=-1, keepdims=True)
    own = h - middle
    scale = np.asarray(mu, dtype=np.float64)[..., None]
    W, t, s = np.zeros_like(h), np.zeros_like(h), np.zeros_like(h)
    theta = np.zeros((*h.shape, 3))
    d, around = h[..., :, None] - h[..., None, :], h[..., :, None] + h[..., None, :]
    for alpha, share in zip(alphas, shares, strict=True):
        power = np.expm1(alpha * own)
        W += 2 * share / alpha**2 * power
        t += 2 * share / alpha * power
        s += 2 * share * (1 + power)
        weight = 2 * share / alpha * np.exp(-alpha * middle)[..., None]
        theta += weight * _quotient(alpha - 2, d, around)
    mean = t.mean(axis=-1, keepdims=True)
    inverse, n = np.exp(-2 * h), N + G @ N
    S = (t - mean) * inverse
    W = (scale * W).sum(axis=-1)
    P = scale[..., None] * ((n * S[..., None, :]) @ np.swapaxes(N, -1, -2))
    if not k.tangent:
        return _pressed(W, P, _NONE, k, p)
    constant = mean + sum(2 * share / alpha for alpha, share in zip(alphas, shares, strict=True))
    theta -= constant[..., None] * _quotient(-2.0, d, around)
    centred = np.eye(3) - 1 / 3
    D = centred @ (s[..., :, None] * centred)
    frame = (n[..., :, None, :, None] * N[..., None, :, None, :]).reshape(*G.shape[:-2], 9, 9)
    A = frame @ _principal_tangent(S, D, theta, inverse) @ np.swapaxes(frame, -1, -2)
    return _pressed(W, P, _restricted(scale[..., None] * A, k), k, p)


def _principal_tangent(S: Array, D: Array, theta: Array, inverse: Array) -> Array:
    """dP/dF over pairs of principal directions (spatial, material), shape (..., 9, 9).

    Parameters
    ----------
    S : principal second Piola-Kirchhoff stresses, shape (..., 3).
    D : derivative of the Kirchhoff stresses by the logarithmic strains, shape (..., 3, 3).
    theta : divided differences of S by the Green strains, shape (..., 3, 3).
    inverse : 1 / l^2, shape (..., 3).
    """
    M = np.zeros((*S.shape[:-1], 3, 3, 3, 3))
    for a in range(3):
        for b in range(3):
            M[..., a, a, b, b] += D[..., a, b] * inverse[..., a] * inverse[..., b]
            M[..., a, b, a, b] += S[..., b] * inverse[..., a]
            if a == b:
                M[..., a, a, a, a] -= 2 * S[..., a] * inverse[..., a]
            else:
                M[..., a, b, a, b] += theta[..., a, b] / 2
                M[..., a, b, b, a] += theta[..., a, b] / 2
    return np.asarray(M.reshape(*S.shape[:-1], 9, 9))


def _quotient(beta: float, d: Array, around: Array) -> Array:
    """(exp(beta x) - exp(beta y)) / (exp(2 x) - exp(2 y)) * 2 with d = x - y, around = x + y; d = 0 is its limit."""
    safe = np.where(d == 0, 1.0, d)
    ratio = np.where(d == 0, beta / 2, np.sinh(beta * safe / 2) / np.sinh(safe))
    return 2 * np.exp((beta / 2 - 1) * around) * ratio


def cofactor(k: Kinematics) -> Array:
    """J F^-T, the derivative of J by F, shape (..., 3, 3)."""
    return (1 + k.Jm1)[..., None, None] * k.H


def _pressed(W: Array, P: Array, A: Array, k: Kinematics, p: Array | float) -> tuple[Array, Array, Array]:
    """Energy, stress and tangent with those of p (J - 1)."""
    Pp, Ap = pressure_terms(k, p)
    return W + p * k.Jm1, P + Pp, A + Ap


def pressure_terms(k: Kinematics, p: Array | float) -> tuple[Array, Array]:
    """Stress P = p J F^-T (..., 3, 3) of p (J - 1), and its tangent (..., 9, 9) or (..., c, c)."""
    cof, pJ = cofactor(k), p * (1 + k.Jm1)
    A = _tangent(k, (pJ / 2)[..., None] * _wanted(k.H, k), -pJ) if k.tangent else _NONE
    return np.asarray(p)[..., None, None] * cof, A
