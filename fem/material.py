"""Hyperelastic laws: one function per energy, with its stress and tangent.

The argument is the displacement gradient G = F - 1, not F, and the stresses are written so that no digits are lost
when G is small (a contact of a nanometre has strains of 1e-12 far from the contact area).

Near incompressibility is treated by a perturbed Lagrangian with an independent pressure p,

    Psi(F, p) = W(F) + p (J - 1) - p^2 / (2 K),        J = det F.

It is stationary in p at p = K (J - 1), which gives the volumetric energy K/2 (J - 1)^2. 1/K = 0 (nu = 0.5) is
allowed. W is isochoric, so p is the mean Cauchy stress, positive in tension.

Components come first and points last, because loops are long over points: G and stresses have shape (3, 3, ...),
tangents (9, 9, ...) or, for a selection of c components, (c, c, ...).

Every law has the shear modulus mu at small strain as its scale. Its other constants are pure numbers, so stresses are
proportional to mu at any strain.
"""

from __future__ import annotations

import functools
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array

Components = tuple[int, ...]

_LEAST = 1e-15 - 1
_NONE: Array = np.empty(0)
_UP, _DOWN = np.array([1, 2, 0]), np.array([2, 0, 1])


class Kinematics(NamedTuple):
    """Quantities that every law computes from, for a displacement gradient G = F - 1."""

    G: Array
    """Displacement gradient, shape (3, 3, ...)."""
    Jm1: Array
    """J - 1 to full relative precision, shape (...)."""
    Hm1: Array
    """F^-T - 1 to full relative precision, shape (3, 3, ...)."""
    H: Array
    """F^-T, shape (3, 3, ...)."""
    components: Components | None = None
    """Positions in a row-major 3 x 3 tensor for which tangents are computed; None: all 9. The other components must
    not couple to them, as in a section of revolution."""
    tangent: bool = True
    """Whether tangents are computed; if not, empty arrays are returned."""


class Law(Protocol):
    """A law with its constants: maps kinematics, mu and a pressure to W, P and dP/dF, like `neo_hookean`."""

    def __call__(self, k: Kinematics, mu: Array | float, p: Array | float = ..., /) -> tuple[Array, Array, Array]: ...


def law(name: str, numbers: tuple[float, ...] = ()) -> Law:
    """Return the law of a name in `geometry.design.LAWS`, with its constants in the order given there."""
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


NEO_HOOKEAN, MOONEY_RIVLIN, YEOH, OGDEN = range(4)
"""Numbers of the laws, for loops that numba compiles."""


def numbered(law: Law) -> tuple[int, Array] | None:
    """Return number and constants (3,) of a law from `law`; None for any other function."""
    constants = law.keywords if isinstance(law, functools.partial) else {}
    function = law.func if isinstance(law, functools.partial) else law
    if function is neo_hookean:
        return NEO_HOOKEAN, np.zeros(3)
    if function is mooney_rivlin:
        return MOONEY_RIVLIN, np.array([constants["share"], 0, 0])
    if function is yeoh:
        return YEOH, np.array([constants["c2"], constants["c3"], 0])
    if function is ogden and len(constants["alphas"]) == 2:
        return OGDEN, np.array([*constants["alphas"], constants["shares"][1]])
    return None


class Strain(NamedTuple):
    """A displacement gradient (3, 3, ...), J - 1 (...) and cof F - J 1 (3, 3, ...), the last two to full relative
    precision.
    """

    G: Array
    Jm1: Array
    cofactor_excess: Array


def strain(G: Array) -> Strain:
    """Return the strain of a displacement gradient, shape (3, 3, ...).

    cof (1 + G) = 1 + tr G - G^T + cof G, and J = 1 + tr G + tr cof G + det G.
    """
    up, down = G.take(_UP, axis=0), G.take(_DOWN, axis=0)
    cofactor_excess = up.take(_UP, axis=1) * down.take(_DOWN, axis=1)
    cofactor_excess -= up.take(_DOWN, axis=1) * down.take(_UP, axis=1)
    higher = _trace(cofactor_excess) + np.einsum("j...,j...->...", G[0], cofactor_excess[0])
    cofactor_excess -= np.swapaxes(G, 0, 1)
    diagonal = _diagonal(cofactor_excess)
    diagonal -= higher
    return Strain(G, _trace(G) + higher, cofactor_excess)


def kinematics(strain: Strain, components: Components | None = None, *, tangent: bool = True) -> Kinematics:
    """Return the kinematics of a strain whose J is not zero."""
    Hm1 = strain.cofactor_excess / (1 + strain.Jm1)
    return Kinematics(strain.G, strain.Jm1, Hm1, Hm1 + _unit(Hm1), components, tangent)


def _diagonal(T: Array) -> Array:
    """Return a view of the diagonal of tensors (k, k, ...), shape (k, ...)."""
    return np.asarray(np.einsum("ii...->i...", T))


def _trace(T: Array) -> Array:
    return np.asarray(T[0, 0] + T[1, 1] + T[2, 2])


def _unit(T: Array) -> Array:
    """Return the unit tensor in a shape that can be added to tensors (3, 3, ...)."""
    return np.eye(3).reshape(3, 3, *(1,) * (T.ndim - 2))


def lame(E: float, nu: float) -> tuple[float, float]:
    """Return the shear modulus and the inverse of the bulk modulus (0 for nu = 0.5).

    >>> lame(3.0, 0.5)
    (1.0, 0.0)
    """
    return E / (2 * (1 + nu)), 3 * (1 - 2 * nu) / E


def _multiply(X: Array, Y: Array) -> Array:
    """Return X Y of tensors (3, 3, ...)."""
    return np.asarray(np.einsum("ij...,jk...->ik...", X, Y))


@functools.lru_cache
def _places(components: Components | None) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the positions (c,) of components iJ, and (c, c) of iL and kJ for the pairs (iJ), (kL)."""
    own = np.arange(9) if components is None else np.array(components)
    i, J = np.divmod(own, 3)
    return own, 3 * i[:, None] + J, 3 * i + J[:, None]


def _select(T: Array, components: Components | None) -> Array:
    """Return the selected components of tensors (3, 3, ...), shape (c, ...)."""
    T = T.reshape(9, *T.shape[2:])
    return T if components is None else T[_places(components)[0]]


def _select_pairs(A: Array, components: Components | None) -> Array:
    """Return the selected components of tangents (9, 9, ...), shape (c, c, ...)."""
    own = _places(components)[0]
    return A if components is None else A[own[:, None], own]


def _pairs(X: Array, Y: Array, components: Components | None = None) -> Array:
    """Return X_iL Y_kJ as a matrix over the pairs (iJ), (kL), shape (c, c, ...)."""
    if components is None:
        return np.asarray(X[:, None, None] * np.swapaxes(Y, 0, 1)[None, :, :, None]).reshape(9, 9, *X.shape[2:])
    _, first, second = _places(components)
    return np.asarray(X.reshape(9, *X.shape[2:])[first] * Y.reshape(9, *Y.shape[2:])[second])


def _tangent(k: Kinematics, x: Array, cross: Array) -> Array:
    """Return x H + H x for x (c, ...), plus `cross` (...) times H_iL H_kJ, shape (c, c, ...)."""
    H = _select(k.H, k.components)
    A = x[:, None] * H
    A += H[:, None] * x
    A += _pairs(cross * k.H, k.H, k.components)
    return A


def neo_hookean(k: Kinematics, mu: Array | float, p: Array | float = 0.0) -> tuple[Array, Array, Array]:
    """Isochoric neo-Hookean law, W = mu/2 (J^-2/3 tr(F^T F) - 3), and p (J - 1).

    P = mu J^-2/3 (F - I1/3 F^-T) + p J F^-T. The first term is evaluated as mu J^-2/3 [(F - F^-T) - (I1 - 3)/3 F^-T],
    which keeps its digits at small strain.

    Parameters
    ----------
    k : kinematics of G, shape (3, 3, ...).
    mu : shear modulus, a number or shape (...), MPa.
    p : pressure (the mean Cauchy stress), a number or shape (...), MPa; its energy, stress and tangent are added to
        those of the law.

    Returns
    -------
    W (...), first Piola-Kirchhoff stress P (3, 3, ...), and tangent dP/dF (9, 9, ...) or (c, c, ...), MPa.
    """
    G, H = k.G, k.H
    I1m3 = 2 * _trace(G) + np.einsum("ij...,ij...->...", G, G)
    less = np.expm1(-2 / 3 * np.log1p(k.Jm1))
    s = mu * (1 + less)
    excess, pJ = s * I1m3 / 3, p * (1 + k.Jm1)
    W = 1.5 * (excess + mu * less) + p * k.Jm1
    P = s * (G - k.Hm1)
    P += (pJ - excess) * H
    if not k.tangent:
        return W, P, _NONE
    F, H = _select(G + _unit(G), k.components), _select(H, k.components)
    A = _tangent(k, (-2 / 3 * s) * F + ((s + excess) / 3 + pJ / 2) * H, s + excess - pJ)
    diagonal = _diagonal(A)
    diagonal += s
    return W, P, A


def mooney_rivlin(
    k: Kinematics, mu: Array | float, p: Array | float = 0.0, *, share: float
) -> tuple[Array, Array, Array]:
    """Isochoric Mooney-Rivlin law, W = mu/2 [(1 - share) (I1' - 3) + share (I2' - 3)], I' of J^-1/3 F.

    I2'(F) = I1'(F^-T), so the second term is the neo-Hookean law of H = F^-T, with Q its stress:
    P = -H Q^T H, and dH = -H dF^T H gives the tangent.

    Parameters
    ----------
    share : C01 / (C10 + C01), with C10 + C01 = mu / 2.

    Returns
    -------
    As `neo_hookean`.
    """
    W1, P1, A1 = neo_hookean(k._replace(components=None), (1 - share) * mu, p)
    H = k.H
    inverse = Kinematics(k.Hm1, -k.Jm1 / (1 + k.Jm1), k.G, k.G + _unit(k.G), tangent=k.tangent)
    W2, Q, B = neo_hookean(inverse, share * mu)
    P2 = -_multiply(_multiply(H, np.swapaxes(Q, 0, 1)), H)
    W, P = W1 + W2, P1 + P2
    if not k.tangent:
        return W, P, _NONE
    cross, B = (np.moveaxis(T, (0, 1), (-2, -1)) for T in (_pairs(H, H), B))
    mixed = _pairs(H, P2)
    A2 = np.moveaxis(cross @ B @ cross, (-2, -1), (0, 1)) - mixed - np.swapaxes(mixed, 0, 1)
    return W, P, _select_pairs(A1 + A2, k.components)


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
    W, P = mu / 2 * x * (1 + c2 * x + c3 * x**2), first * slope
    if not k.tangent:
        return _add_pressure(W, P, _NONE, k, p)
    own = _select(slope, k.components)
    return _add_pressure(W, P, first * A + 2 * second * own[:, None] * own, k, p)


def ogden(
    k: Kinematics, mu: Array | float, p: Array | float = 0.0, *, alphas: tuple[float, ...], shares: tuple[float, ...]
) -> tuple[Array, Array, Array]:
    """Isochoric Ogden law, W = sum_i 2 mu_i / alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3), l of J^-1/3 F.

    With h the logarithms of the stretches less their mean, the principal Kirchhoff stresses are tau_a = t_a -
    mean(t), t_a = sum_i 2 mu_i / alpha_i (exp(alpha_i h_a) - 1). The tangent in the principal frame contains divided
    differences of S_a = tau_a / l_a^2, which is a sum of exponentials. They are evaluated as quotients of hyperbolic
    sines, exact for distinct, nearly equal and equal stretches.

    Parameters
    ----------
    alphas, shares : exponents, not 0, and mu_i / mu, which add up to 1.

    Returns
    -------
    As `neo_hookean`.
    """
    G = np.moveaxis(k.G, (0, 1), (-2, -1))
    twice = G + np.swapaxes(G, -1, -2) + np.swapaxes(G, -1, -2) @ G
    e, N = np.linalg.eigh(twice)
    h = np.log1p(np.maximum(e, _LEAST)) / 2
    middle = h.mean(axis=-1, keepdims=True)
    isochoric = h - middle
    scale = np.asarray(mu, dtype=np.float64)[..., None]
    W, t, s = np.zeros_like(h), np.zeros_like(h), np.zeros_like(h)
    theta = np.zeros((*h.shape, 3))
    d, around = h[..., :, None] - h[..., None, :], h[..., :, None] + h[..., None, :]
    for alpha, share in zip(alphas, shares, strict=True):
        power = np.expm1(alpha * isochoric)
        W += 2 * share / alpha**2 * power
        t += 2 * share / alpha * power
        s += 2 * share * (1 + power)
        weight = 2 * share / alpha * np.exp(-alpha * middle)[..., None]
        theta += weight * _quotient(alpha - 2, d, around)
    mean = t.mean(axis=-1, keepdims=True)
    inverse, n = np.exp(-2 * h), N + G @ N
    S = (t - mean) * inverse
    W = (scale * W).sum(axis=-1)
    P = np.moveaxis(scale[..., None] * ((n * S[..., None, :]) @ np.swapaxes(N, -1, -2)), (-2, -1), (0, 1))
    if not k.tangent:
        return _add_pressure(W, P, _NONE, k, p)
    constant = mean + sum(2 * share / alpha for alpha, share in zip(alphas, shares, strict=True))
    theta -= constant[..., None] * _quotient(-2.0, d, around)
    centred = np.eye(3) - 1 / 3
    D = centred @ (s[..., :, None] * centred)
    frame = (n[..., :, None, :, None] * N[..., None, :, None, :]).reshape(*G.shape[:-2], 9, 9)
    A = scale[..., None] * (frame @ _principal_tangent(S, D, theta, inverse) @ np.swapaxes(frame, -1, -2))
    return _add_pressure(W, P, _select_pairs(np.moveaxis(A, (-2, -1), (0, 1)), k.components), k, p)


def _principal_tangent(S: Array, D: Array, theta: Array, inverse: Array) -> Array:
    """Return dP/dF over pairs of principal directions (spatial, material), shape (..., 9, 9).

    Parameters
    ----------
    S : principal second Piola-Kirchhoff stresses, shape (..., 3).
    D : derivatives of the Kirchhoff stresses by the logarithmic strains, shape (..., 3, 3).
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
    """Return 2 (exp(beta x) - exp(beta y)) / (exp(2 x) - exp(2 y)), d = x - y, around = x + y; at d = 0 its limit."""
    safe = np.where(d == 0, 1.0, d)
    ratio = np.where(d == 0, beta / 2, np.sinh(beta * safe / 2) / np.sinh(safe))
    return 2 * np.exp((beta / 2 - 1) * around) * ratio


def cofactor(k: Kinematics) -> Array:
    """Return J F^-T, the derivative of J by F, shape (3, 3, ...)."""
    return np.asarray((1 + k.Jm1) * k.H)


def _add_pressure(W: Array, P: Array, A: Array, k: Kinematics, p: Array | float) -> tuple[Array, Array, Array]:
    """Return energy, stress and tangent with those of p (J - 1) added."""
    Pp, Ap = pressure_terms(k, p)
    return W + p * k.Jm1, P + Pp, A + Ap


def pressure_terms(k: Kinematics, p: Array | float) -> tuple[Array, Array]:
    """Return the stress P = p J F^-T (3, 3, ...) of p (J - 1), and its tangent (9, 9, ...) or (c, c, ...)."""
    pJ = p * (1 + k.Jm1)
    A = _tangent(k, pJ / 2 * _select(k.H, k.components), -pJ) if k.tangent else _NONE
    return np.asarray(pJ * k.H), A
