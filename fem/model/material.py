"""Isochoric laws of the silicone: energy, stress and tangent of each, once, in loops that numba compiles.

The potential of an element couples the displacement with a pressure field p,

    Psi(F, p) = W(F) + p (J - 1) - p^2 / (2 K),        J = det F.

It is stationary in p at p = K (J - 1), which gives the volumetric energy K/2 (J - 1)^2. 1/K = 0 (nu = 0.5) is
allowed. W is isochoric, so p is the mean Cauchy stress, positive in tension.

Every law has the shear modulus mu at small strain as its scale. Its other constants are pure numbers, so stresses are
proportional to mu at any strain. Formulas keep their digits at small strains, and results include the energy, stress
and tangent of p (J - 1).

A law is a function of displacement gradients G = F - 1, J - 1, F^-T - 1, mu and p that writes W, P = dW/dF and
A = dP/dF to given arrays (see `Law`); `evaluate` returns them instead. Mooney-Rivlin's law,

    W = mu/2 [(1 - share) (I1' - 3) + share (I2' - 3)],        share = C01 / (C10 + C01),    C10 + C01 = mu / 2,

with the invariants I' of J^-1/3 F, is Ogden's with exponents 2 and -2: I1' and I2' are the sums of l^2 and l^-2.

All arrays end with one axis over n points, which the innermost loops run along: the processor then works on four to
eight points at once. Tensors have nine components in row-major order, (9, n), and tangents the shape (9, 9, n).
"""

from __future__ import annotations

import functools
import math
from typing import Protocol

import numpy as np

from geometry.arrays import Array
from geometry.compiled import compiled

Arrays = tuple[Array, Array, Array]


class Law(Protocol):
    """A law with its constants, which writes energies (n,), stresses (9, n) and tangents (9, 9, n).

    strain : displacement gradients (9, n), J - 1 (n,), and F^-T - 1 (9, n).
    mu, p : (n,) shear moduli and pressures; both times weights give results times these weights.
    out : W, P and A; A of no points, (9, 9, 0), where tangents are not wanted.
    """

    def __call__(self, strain: Arrays, mu: Array, p: Array, out: Arrays, /) -> None: ...


@functools.lru_cache
def law(name: str, numbers: tuple[float, ...] = ()) -> Law:
    """Return the law of a name in `geometry.design.LAWS`, with its constants in the order given there."""
    match name, numbers:
        case "neo-hookean", ():
            return neo_hookean
        case "mooney-rivlin", (share,):
            return functools.partial(ogden, alphas=(2.0, -2.0), shares=(1 - share, share))
        case "yeoh", (c2, c3):
            return functools.partial(yeoh, c2=c2, c3=c3)
        case "ogden", (alpha1, alpha2, share):
            return functools.partial(ogden, alphas=(alpha1, alpha2), shares=(1 - share, share))
    raise ValueError(f"there is no law {name} with {len(numbers)} numbers")


def evaluate(
    law: Law, G: Array, mu: Array | float = 1.0, p: Array | float = 0.0, *, tangent: bool = True
) -> tuple[Array, Array, Array]:
    """Return W (...), P (3, 3, ...) and, with `tangent`, A (9, 9, ...) of displacement gradients G (3, 3, ...), MPa.

    mu, p : shear modulus and pressure, numbers or of a shape that fits (...), MPa.
    """
    shape, flat = G.shape[2:], np.array(G, dtype=np.float64).reshape(9, -1)
    n = flat.shape[1]
    Jm1, Hm1 = strains(flat)
    mu, p = (np.broadcast_to(np.asarray(v, dtype=np.float64), shape).reshape(n).copy() for v in (mu, p))
    W, P, A = np.empty(n), np.empty((9, n)), np.zeros((9, 9, n if tangent else 0))
    law((flat, Jm1, Hm1), mu, p, (W, P, A))
    return W.reshape(shape), P.reshape(3, 3, *shape), A.reshape(9, 9, *shape) if tangent else A


def strains(G: Array) -> tuple[Array, Array]:
    """Return J - 1 (n,) and F^-T - 1 (9, n) of displacement gradients (9, n), both to full relative precision."""
    Jm1, Hm1 = np.empty(G.shape[1]), np.empty(G.shape)
    kinematics(G, Jm1, Hm1)
    return Jm1, Hm1


@compiled
def kinematics(G, Jm1, Hm1):
    """Write J - 1 (n,) and F^-T - 1 (9, n) of displacement gradients."""
    n = len(Jm1)
    for i in range(3):
        for j in range(3):
            i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            a, b, c, d = G[3 * i1 + j1], G[3 * i2 + j2], G[3 * i1 + j2], G[3 * i2 + j1]
            row = Hm1[3 * i + j]
            for x in range(n):
                row[x] = a[x] * b[x] - c[x] * d[x]
    higher = np.empty(n)
    a, b, c = Hm1[0], Hm1[4], Hm1[8]
    for x in range(n):
        higher[x] = a[x] + b[x] + c[x]
    for j in range(3):
        a, b = G[j], Hm1[j]
        for x in range(n):
            higher[x] += a[x] * b[x]
    a, b, c = G[0], G[4], G[8]
    for x in range(n):
        Jm1[x] = a[x] + b[x] + c[x] + higher[x]
    for i in range(3):
        for j in range(3):
            row, a = Hm1[3 * i + j], G[3 * j + i]
            for x in range(n):
                row[x] = (row[x] - a[x] - (higher[x] if i == j else 0.0)) / (1 + Jm1[x])


@compiled
def _neo_hookean(G, Jm1, Hm1, mu, p, W, P, A):
    n = len(mu)
    s, excess, rest, by_F, by_H = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    a, b, c = G[0], G[4], G[8]
    for x in range(n):
        excess[x] = 2 * (a[x] + b[x] + c[x])
    for e in range(9):
        a = G[e]
        for x in range(n):
            excess[x] += a[x] * a[x]
    for x in range(n):
        less = math.expm1(-2 / 3 * math.log1p(Jm1[x]))
        s[x] = mu[x] * (1 + less)
        excess[x] *= s[x] / 3
        W[x] = 1.5 * (excess[x] + mu[x] * less) + p[x] * Jm1[x]
        rest[x] = p[x] * (1 + Jm1[x])
        by_F[x], by_H[x] = -2 / 3 * s[x], (s[x] + excess[x]) / 3 + rest[x] / 2
        rest[x] -= excess[x]
    F, H = _add_unit(G), _add_unit(Hm1)
    for e in range(9):
        row, a, b, c = P[e], G[e], Hm1[e], H[e]
        for x in range(n):
            row[x] = s[x] * (a[x] - b[x]) + rest[x] * c[x]
    if A.shape[2]:
        for e in range(9):
            row, c = F[e], H[e]
            for x in range(n):
                row[x] = by_F[x] * row[x] + by_H[x] * c[x]
        for x in range(n):
            rest[x] = s[x] - rest[x]
        _write_tangent(F, H, rest, A)
        for e in range(9):
            row = A[e, e]
            for x in range(n):
                row[x] += s[x]


@compiled
def _add_unit(T):
    out = np.empty_like(T)
    for e in range(9):
        unit, row, a = 1.0 if e % 4 == 0 else 0.0, out[e], T[e]
        for x in range(len(row)):
            row[x] = a[x] + unit
    return out


@compiled
def _write_tangent(X, H, cross, A):
    """Write A = X H + H X + cross H_iL H_kJ."""
    n, crossed = len(cross), np.empty_like(H)
    for e in range(9):
        row, a = crossed[e], H[e]
        for x in range(n):
            row[x] = cross[x] * a[x]
    for e in range(9):
        a, b = X[e], H[e]
        for d in range(e, 9):
            row, c, f, g, h = A[e, d], X[d], H[d], crossed[e // 3 * 3 + d % 3], H[d // 3 * 3 + e % 3]
            for x in range(n):
                row[x] = a[x] * f[x] + b[x] * c[x] + g[x] * h[x]
            if d > e:
                mirrored = A[d, e]
                for x in range(n):
                    mirrored[x] = row[x]


@compiled
def add_pressure(Jm1, Hm1, p, W, P, A):
    """Add energy p (J - 1), stress p J H and tangent p J (H_iJ H_kL - H_iL H_kJ), H = F^-T."""
    n, H, pJ = len(p), _add_unit(Hm1), np.empty(len(p))
    for x in range(n):
        pJ[x] = p[x] * (1 + Jm1[x])
        W[x] += p[x] * Jm1[x]
    for e in range(9):
        row, a = P[e], H[e]
        for x in range(n):
            row[x] += pJ[x] * a[x]
    if A.shape[2]:
        for e in range(9):
            for d in range(9):
                row, a, b, c, f = A[e, d], H[e], H[d], H[e // 3 * 3 + d % 3], H[d // 3 * 3 + e % 3]
                for x in range(n):
                    row[x] += pJ[x] * (a[x] * b[x] - c[x] * f[x])


@compiled
def _transform(first, second, A):
    """Replace A by B_iJkL = first_ia second_Jb first_kc second_Ld A_abcd for matrices (9, n)."""
    n = A.shape[2]
    half, partial = np.empty_like(A), np.empty((3, n))
    # the row pair is transformed and exchanged with the column pair, twice
    for side in range(2):
        source, target = (A, half) if side == 0 else (half, A)
        for d in range(9):
            for J in range(3):
                for a in range(3):
                    row, c0, c1, c2 = partial[a], second[3 * J], second[3 * J + 1], second[3 * J + 2]
                    s0, s1, s2 = source[3 * a, d], source[3 * a + 1, d], source[3 * a + 2, d]
                    for x in range(n):
                        row[x] = c0[x] * s0[x] + c1[x] * s1[x] + c2[x] * s2[x]
                s0, s1, s2 = partial[0], partial[1], partial[2]
                for i in range(3):
                    row, c0, c1, c2 = target[d, 3 * i + J], first[3 * i], first[3 * i + 1], first[3 * i + 2]
                    for x in range(n):
                        row[x] = c0[x] * s0[x] + c1[x] * s1[x] + c2[x] * s2[x]


@compiled
def _yeoh(mu, c2, c3, W, P, A):
    """Turn the neo-Hookean law with modulus 1 into `yeoh`, a polynomial of its energy."""
    n = len(mu)
    first, second = np.empty(n), np.empty(n)
    for x in range(n):
        y = 2 * W[x]
        first[x] = mu[x] * (1 + 2 * c2 * y + 3 * c3 * y * y)
        second[x] = 2 * mu[x] * (2 * c2 + 6 * c3 * y)
        W[x] = mu[x] / 2 * y * (1 + c2 * y + c3 * y * y)
    if A.shape[2]:
        for e in range(9):
            for d in range(9):
                row, a, b = A[e, d], P[e], P[d]
                for x in range(n):
                    row[x] = first[x] * row[x] + second[x] * a[x] * b[x]
    for e in range(9):
        row = P[e]
        for x in range(n):
            row[x] *= first[x]


@compiled
def eigenvectors(S, values, N):
    """Write eigenvalues (3,) and eigenvectors (3, 3), in columns, of a symmetric matrix by Jacobi's method.

    S is overwritten. LAPACK would take ten times as long on so small a matrix.
    """
    for i in range(3):
        for j in range(3):
            N[i, j] = 1.0 if i == j else 0.0
    # four to six sweeps are enough for all digits
    for _ in range(12):
        if S[0, 1] == 0.0 and S[0, 2] == 0.0 and S[1, 2] == 0.0:
            break
        for i in range(2):
            for j in range(i + 1, 3):
                if S[i, j] == 0.0:
                    continue
                half = (S[j, j] - S[i, i]) / (2 * S[i, j])
                t = math.copysign(1.0, half) / (abs(half) + math.hypot(half, 1.0))
                c = 1 / math.sqrt(t * t + 1)
                s, k = t * c, 3 - i - j
                S[i, i], S[j, j] = S[i, i] - t * S[i, j], S[j, j] + t * S[i, j]
                S[i, j] = S[j, i] = 0.0
                S[k, i], S[k, j] = c * S[k, i] - s * S[k, j], s * S[k, i] + c * S[k, j]
                S[i, k], S[j, k] = S[k, i], S[k, j]
                for r in range(3):
                    N[r, i], N[r, j] = c * N[r, i] - s * N[r, j], s * N[r, i] + c * N[r, j]
    for i in range(3):
        values[i] = S[i, i]


@compiled
def _quotient(beta, d, around):
    """Return 2 (exp(beta x) - exp(beta y)) / (exp(2 x) - exp(2 y)), d = x - y, around = x + y; at d = 0 its limit."""
    ratio = beta / 2 if d == 0 else math.sinh(beta * d / 2) / math.sinh(d)
    return 2 * math.exp((beta / 2 - 1) * around) * ratio


@compiled
def _ogden(G, mu, alphas, shares, W, P, A, spatial, material):
    """Write energy and stress of `ogden` without pressure, point by point.

    A receives the tangents in the principal frame, and spatial and material the matrices (9, n) that
    turn these to the frame of F.
    """
    n = len(mu)
    F, S, N, e = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    h, t, s, stress, theta = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    for x in range(n):
        for i in range(9):
            F[i // 3, i % 3] = G[i, x]
        for i in range(3):
            for j in range(3):
                S[i, j] = F[i, j] + F[j, i] + F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]
        eigenvectors(S, e, N)
        for a in range(3):
            h[a] = math.log1p(max(e[a], 1e-15 - 1)) / 2
        middle, energy, constant = (h[0] + h[1] + h[2]) / 3, 0.0, 0.0
        t[:], s[:], theta[:] = 0.0, 0.0, 0.0
        for term in range(len(alphas)):
            alpha, share = alphas[term], shares[term]
            constant += 2 * share / alpha
            weight = 2 * share / alpha * math.exp(-alpha * middle)
            for a in range(3):
                power = math.expm1(alpha * (h[a] - middle))
                energy += 2 * share / alpha**2 * power
                t[a] += 2 * share / alpha * power
                s[a] += 2 * share * (1 + power)
                for b in range(3):
                    if A.shape[2] and a != b:
                        theta[a, b] += weight * _quotient(alpha - 2, h[a] - h[b], h[a] + h[b])
        W[x] = mu[x] * energy
        mean = (t[0] + t[1] + t[2]) / 3
        for a in range(3):
            stress[a] = mu[x] * (t[a] - mean) * math.exp(-2 * h[a])
            for i in range(3):
                material[3 * i + a, x] = N[i, a]
                spatial[3 * i + a, x] = N[i, a] + F[i, 0] * N[0, a] + F[i, 1] * N[1, a] + F[i, 2] * N[2, a]
        for i in range(9):
            P[i, x] = 0.0
            for a in range(3):
                P[i, x] += spatial[i // 3 * 3 + a, x] * stress[a] * material[i % 3 * 3 + a, x]
        if A.shape[2]:
            _write_principal_tangent(x, mu[x], stress, s, theta, constant + mean, h, A)


@compiled
def _write_principal_tangent(x, mu, stress, s, theta, constant, h, A):
    """Write dP/dF of point x over pairs of principal directions (spatial, material) to A.

    stress : principal second Piola-Kirchhoff stresses, with mu.
    s : sum over the terms of 2 share l^alpha, whose deviator in both indices is the derivative of the Kirchhoff
        stresses by the logarithmic strains h.
    theta, constant : divided differences of the stresses by the Green strains, without those of their mean.
    """
    for e in range(9):
        for d in range(9):
            A[e, d, x] = 0.0
    total = (s[0] + s[1] + s[2]) / 9
    for a in range(3):
        inverse_square = math.exp(-2 * h[a])
        for b in range(3):
            D = total - (s[a] + s[b]) / 3 + (s[a] if a == b else 0.0)
            A[4 * a, 4 * b, x] += mu * D * inverse_square * math.exp(-2 * h[b])
            A[3 * a + b, 3 * a + b, x] += stress[b] * inverse_square
            if a == b:
                A[4 * a, 4 * a, x] -= 2 * stress[a] * inverse_square
            else:
                half = mu / 2 * (theta[a, b] - constant * _quotient(-2.0, h[a] - h[b], h[a] + h[b]))
                A[3 * a + b, 3 * a + b, x] += half
                A[3 * a + b, 3 * b + a, x] += half


def neo_hookean(strain: Arrays, mu: Array, p: Array, out: Arrays, /) -> None:
    """Isochoric neo-Hookean law, W = mu/2 (J^-2/3 tr(F^T F) - 3); parameters as of `Law`.

    P = mu J^-2/3 (F - I1/3 F^-T) is evaluated as mu J^-2/3 [(F - F^-T) - (I1 - 3)/3 F^-T], which keeps its digits at
    small strain. With s = mu J^-2/3, its tangent is s 1 - 2/3 s (F H + H F) + s I1/3 (H_iL H_kJ + 2/3 H H), H = F^-T.
    """
    _neo_hookean(*strain, mu, p, *out)


def yeoh(strain: Arrays, mu: Array, p: Array, out: Arrays, /, *, c2: float, c3: float) -> None:
    """Isochoric Yeoh law, W = mu/2 (x + c2 x^2 + c3 x^3) with x = I1' - 3, I1' of J^-1/3 F.

    c2, c3 : C20 / C10 and C30 / C10, with C10 = mu / 2. The others are those of `Law`.
    """
    neo_hookean(strain, np.ones_like(mu), np.zeros_like(p), out)
    _yeoh(mu, c2, c3, *out)
    add_pressure(*strain[1:], p, *out)


def ogden(
    strain: Arrays,
    mu: Array,
    p: Array,
    out: Arrays,
    /,
    *,
    alphas: tuple[float, ...],
    shares: tuple[float, ...],
) -> None:
    """Isochoric Ogden law, W = sum_i 2 mu_i / alpha_i^2 (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3), l of J^-1/3 F.

    With h the logarithms of the stretches less their mean, the principal Kirchhoff stresses are tau_a = t_a -
    mean(t), t_a = sum_i 2 mu_i / alpha_i (exp(alpha_i h_a) - 1). The tangent in the principal frame contains divided
    differences of S_a = tau_a / l_a^2, which is a sum of exponentials. They are evaluated as quotients of hyperbolic
    sines, exact for distinct, nearly equal and equal stretches.

    alphas, shares : exponents, not 0, and mu_i / mu, which add up to 1. The others are those of `Law`.
    """
    (G, Jm1, Hm1), (_, P, A) = strain, out
    spatial, material = np.empty_like(P), np.empty_like(P)
    _ogden(G, mu, np.array(alphas, dtype=np.float64), np.array(shares), *out, spatial, material)
    if A.shape[2]:
        _transform(spatial, material, A)
    add_pressure(Jm1, Hm1, p, *out)
