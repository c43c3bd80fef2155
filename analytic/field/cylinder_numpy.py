"""Field of a cylinder of radius 1 with J = 1, and its slope along z, in NumPy.

This module is the reference for `cylinder_pointwise`, which has the same formulas for one point, and for
`cylinder_compiled`, which compiles them. The method depends on the point:

- far, beyond `FAR` circumscribed radii from the centre: multipoles to order `ORDER`;
- thin, beyond `THIN` half heights from the rim: current rings at `GAUSS` Gauss points over the height;
- near, everywhere else: two charged end faces, with J added inside; each face by Bulirsch's cel (Derby & Olbert 2010)
  or, beyond `FAR` radii from the face, by its own multipoles.

With zeta the height above a face, S = zeta^2 + (1 + r)^2, Q = zeta^2 + (1 - r)^2, m = 4 r / S and
Delta^2 = 1 - m sin^2, rings and faces need K = int 1/Delta, C = int sin^2 cos^2 / Delta^3 and D = int sin^2 / Delta
over 0..pi/2. The arithmetic-geometric mean of 1 and sqrt(Q/S) gives, with its half differences c_n,

    K = pi / (2 a_inf),    C = (K/m^2) sum_{n>=1} 2^n c_n^2,    D = (K + m C) / 2,

a sum of positive terms, accurate on the axis too. A face has B_r/r = 4 C / (pi S^1.5), and a ring of unit current

    B_r/r = 4 zeta (D - C) / (pi S^1.5 Q),    B_z = 2 [(1 - r^2 + zeta^2) D - 2 r (1 - r) C] / (pi S^1.5 Q).

The slope of the cylinder's field along z is the difference of the rings at its ends. For a thin cylinder the two
rings cancel; there it is the sum of the slopes of the rings at the Gauss points. With G = int sin^2 / Delta^3 =
(K - D) S/Q these need

    dD/dzeta = -zeta m (G - C)/S,    dC/dzeta = -zeta (G - 4 C)/S,    d log(S^1.5 Q)/dzeta = zeta (3/S + 2/Q).

The other entries of the Jacobian follow from div B = 0 and curl B = 0.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from geometry.arrays import Array

Pair = tuple[Array, Array]

FAR = 5.0
"""Distance, in circumscribed radii, beyond which the multipole series is used; its truncation error is 5^-28."""
THIN = 12.0
"""Distance from the rim, in half heights, beyond which Gauss points over the height suffice (error about 24^-12)."""
GAUSS = 6
"""Number of these Gauss points."""
ORDER = 27
"""Order of the highest multipole of the field; its slope has one order more."""
BLOCK = 2048
"""Number of points that are computed at a time, so that their arrays stay in the processor's cache."""
NEAR_HULL = 0.01
"""Distance from the hull, in radii, within which that distance is computed in doubled precision."""
SPLIT = 134217729.0
"""2^27 + 1, which splits a float into two halves of its digits for Dekker's product."""
SETTLED = 1e-8
"""Relative difference of the two means after which one more step, which squares it, is exact to rounding."""


def unit_field(r: Array, gap: Array, z: Array, up: Array, down: Array, z0: float, *, slope: bool) -> Array:
    """Return B_r/r and B_z and, with `slope`, d(B_r/r)/dz and dB_z/dz.

    Parameters
    ----------
    r, z : distance from the axis and height above the centre, shape (n,), in radii.
    gap, up, down : 1 - r, z - z0 and z + z0, shape (n,); computed by the caller without the rounding errors that
        these differences would have near the surface.
    z0 : half the height, in radii.

    Returns
    -------
    shape (2, n) or (4, n). It is infinite or NaN on the rim, which the caller must exclude.
    """
    field = np.empty((4 if slope else 2, len(r)))
    for start in range(0, len(r), BLOCK):
        part = slice(start, start + BLOCK)
        field[:, part] = _block(r[part], gap[part], z[part], up[part], down[part], z0, slope)
    return field


def distance_to_hull(x: Array, rho: Array, radius: float) -> Array:
    """Return 1 - rho/radius, shape (n,); near the hull as (a^2 - x^2 - y^2) / (a (a + rho)) in doubled precision.

    x has shape (n, 2 or more) and rho shape (n,), both in the unit of the radius.
    """
    gap = 1 - rho / radius
    near = np.abs(gap) < NEAR_HULL
    if near.any():
        (a2, a2_low), (x2, x2_low), (y2, y2_low) = map(_square, (np.float64(radius), x[near, 0], x[near, 1]))
        first, first_low = _sum(a2, -x2)
        second, second_low = _sum(first, -y2)
        rest = first_low + second_low + (a2_low - x2_low - y2_low)
        gap[near] = (second + rest) / (radius * (radius + rho[near]))
    return np.asarray(gap)


def _square(a: Array) -> tuple[Array, Array]:
    """Return a^2 and its rounding error (Dekker)."""
    wide = SPLIT * a
    high = wide - (wide - a)
    low = a - high
    square = a * a
    return square, ((high * high - square) + 2 * high * low) + low * low


def _sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return a + b and its rounding error (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _block(r: Array, gap: Array, z: Array, up: Array, down: Array, z0: float, slope: bool) -> Array:
    """Return `unit_field` for one block of points, each by its method."""
    span = math.hypot(1, z0)
    far = np.hypot(r, z) > FAR * span
    thin = ~far & (np.hypot(gap, z) > THIN * z0)
    near = ~(far | thin)
    if near.all():
        return _two_faces(r, gap, up, down, slope)
    field = np.empty((4 if slope else 2, len(r)))
    if far.any():
        values = _multipoles(r[far] / span, z[far] / span, cylinder_moments(z0), slope)
        # from circumscribed radii to radii: B_r/r and dB_z/dz are per length, d(B_r/r)/dz is per length squared
        field[:, far] = (values.T / np.array([span, 1.0, span**2, span])[: len(values)]).T
    if thin.any():
        field[:, thin] = _thin(r[thin], gap[thin], z[thin], z0, slope)
    if near.any():
        field[:, near] = _two_faces(r[near], gap[near], up[near], down[near], slope)
    return field


def _two_faces(r: Array, gap: Array, up: Array, down: Array, slope: bool) -> Array:
    """Return the field of the end faces, charged +1 at the top and -1 at the bottom, with J added inside the magnet.

    The charges give mu0 H. The near form of a face omits a step of sign(zeta)/2 inside r = 1. The steps of both faces
    and J are summed first: their sum has no rounding error.
    """
    n = len(r)
    field, step = _faces(np.tile(r, 2), np.tile(gap, 2), np.concatenate([up, down]), slope)
    difference = field[:, :n] - field[:, n:]
    within = 0.5 * (np.sign(gap) + 1)
    difference[1] += within * ((np.sign(down) - np.sign(up)) / 2 + (step[:n] - step[n:]))
    return difference


def _faces(r: Array, gap: Array, zeta: Array, slope: bool) -> tuple[Array, Array]:
    """Return field and slope of discs with unit charge density, and the step that h_z lacks inside r = 1."""
    far = np.hypot(r, zeta) > FAR
    if not far.any():
        return _near(r, gap, zeta, slope), np.sign(zeta) / 2
    near = ~far
    field = np.empty((4 if slope else 2, len(r)))
    field[:, far] = _multipoles(r[far], zeta[far], face_moments(), slope)
    if near.any():
        field[:, near] = _near(r[near], gap[near], zeta[near], slope)
    return field, np.where(far, 0.0, np.sign(zeta) / 2)


def _near(r: Array, gap: Array, zeta: Array, slope: bool) -> Array:
    """Return field and slope of one face by the arithmetic-geometric mean, without the step of h_z.

    B_z is -zeta cel(k, g^2, 1, g) / (pi (1 + r) sqrt(S)), k^2 = Q/S, g = (1 - r)/(1 + r). At r = 1 this cel jumps;
    the mean of both sides is K(k).
    """
    outer = 1 + r
    S, Q = zeta * zeta + outer * outer, zeta * zeta + gap * gap
    s, m = np.sqrt(S), 4 * r / S
    k = np.sqrt(Q) / s
    hull = gap == 0
    p = np.where(hull, 1.0, np.abs(gap) / outer)
    c, q = np.ones_like(r), np.where(hull, 1.0, np.sign(gap))
    steps = _steps(k)
    mean, product = 1 + k, k
    c, q = c + q / p, 2 * (q + c * k / p)
    p = p + k / p
    term = 1 / (mean * mean)
    total = term / 2
    for n in range(2, steps + 1):
        k = 2 * np.sqrt(product)
        product = k * mean
        ratio = product / p
        c, q = c + q / p, 2 * (q + c * ratio)
        p = p + ratio
        mean = mean + k
        term = term * m / mean
        term = term * term
        total = total + term * 0.5**n
    K = np.pi / 2 * 2.0**steps / mean
    C = K * total
    b_z = -0.5 * zeta * (q + c * mean) / (mean * (mean + p) * outer * s)
    S3 = np.pi * S * s
    if not slope:
        return np.stack([4 * C / S3, b_z])
    # a charged face is the end of a solenoid, whose slope along z is a ring of the opposite sign
    return np.stack([4 * C / S3, b_z, *_ring_of(r, gap, zeta, -Q * S3, (K + m * C) / 2, C)])


def _ring_of(r: Array, gap: Array, zeta: Array, scale: Array, D: Array, C: Array) -> Pair:
    """Return B_r/r and B_z of a ring of unit current from the integrals D and C; `scale` is pi S^1.5 Q."""
    return 4 * zeta * (D - C) / scale, 2 * ((gap * (1 + r) + zeta * zeta) * D - 2 * r * gap * C) / scale


def _steps(k: Array) -> int:
    """Return the number of steps that the mean of 1 and the smallest k, the slowest of all, takes."""
    a, b, count = 1.0, float(k.min()), 1
    while abs(a - b) > SETTLED * a and b > 0:
        a, b, count = (a + b) / 2, math.sqrt(a * b), count + 1
    return count


def _thin(r: Array, gap: Array, z: Array, z0: float, slope: bool) -> Array:
    """Return field and slope of the magnet as a stack of rings at Gauss points over its height."""
    nodes, weights = np.polynomial.legendre.leggauss(GAUSS)
    field = np.zeros((4 if slope else 2, len(r)))
    for node, weight in zip(nodes, weights, strict=True):
        field += z0 * weight * _ring(r, gap, z - z0 * node, slope)
    return field


def _ring(r: Array, gap: Array, zeta: Array, slope: bool) -> Array:
    """Return field and slope of a ring of unit current at height 0."""
    S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
    m, s = 4 * r / S, np.sqrt(S)
    k = np.sqrt(Q) / s
    steps = _steps(k)
    mean, product = 1 + k, k
    term = 1 / (mean * mean)
    total = term / 2
    for n in range(2, steps + 1):
        k = 2 * np.sqrt(product)
        product = k * mean
        mean = mean + k
        term = term * m / mean
        term = term * term
        total = total + term * 0.5**n
    K = np.pi / 2 * 2.0**steps / mean
    C = K * total
    D, scale = (K + m * C) / 2, np.pi * S * s * Q
    field = _ring_of(r, gap, zeta, scale, D, C)
    if not slope:
        return np.stack(field)
    return np.stack([*field, *_ring_slope(r, gap, zeta, scale, K, D, C)])


def _ring_slope(r: Array, gap: Array, zeta: Array, scale: Array, K: Array, D: Array, C: Array) -> Pair:
    """Return the slopes along z of B_r/r and B_z of a ring; parameters as in `_ring_of`."""
    S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
    G = (K - D) * (S / Q)
    D_z, C_z = -4 * r * zeta * (G - C) / (S * S), -zeta * (G - 4 * C) / S
    lean, along = _ring_of(r, gap, zeta, scale, D, C)
    lean_z, along_z = _ring_of(r, gap, zeta, scale, D_z, C_z)
    shrink = zeta * (3 / S + 2 / Q)
    return lean_z + 4 * (D - C) / scale - shrink * lean, along_z + 4 * zeta * D / scale - shrink * along


def _multipoles(r: Array, z: Array, moments: Array, slope: bool) -> Array:
    """Return the fields of the potentials sum moments[n] P_n(cos theta) / d^(n+1), one per row of moments; d > 0."""
    d = np.hypot(r, z)
    cos, sin2 = z / d, (r / d) ** 2
    sums = np.zeros((4 if slope else 2, len(r)))
    p_last, p = np.zeros_like(d), np.ones_like(d)
    tangent_last, tangent = np.zeros_like(d), np.zeros_like(d)
    inverse = 1 / d
    power = inverse * inverse
    for n, pair in enumerate(moments.T[: ORDER + 1 + slope].tolist()):
        for k, moment in enumerate(pair[: 1 + slope]):
            if moment:
                sums[2 * k] += (moment * (n + 1)) * p * power
                sums[2 * k + 1] += moment * tangent * power
        power = power * inverse
        p_last, p = p, ((2 * n + 1) / (n + 1)) * cos * p - (n / (n + 1)) * p_last
        tangent_last, tangent = tangent, tangent_last + (2 * n + 1) * p_last
    along, across = sums[::2], sums[1::2]
    field = np.empty_like(sums)
    field[::2], field[1::2] = (along + cos * across) * inverse, along * cos - sin2 * across
    return field


def _with_slope(moments: list[float]) -> Array:
    """Return the moments of a potential and, in a second row, of its slope along z, shape (2, ORDER + 2)."""
    both = np.zeros((2, ORDER + 2))
    both[0, :-1] = moments
    both[1, 1:] = -np.arange(1, ORDER + 2) * both[0, :-1]
    return both


@lru_cache(maxsize=256)
def face_moments() -> Array:
    """Return the moments of a charged disc and of its slope, from its potential (sqrt(z^2 + 1) - z)/2 on the axis."""
    moments = [0.0] * (ORDER + 1)
    binomial = 1.0
    for k in range(1, ORDER // 2 + 2):
        binomial *= (1.5 - k) / k
        moments[2 * k - 2] = binomial / 2
    return _with_slope(moments)


@lru_cache(maxsize=256)
def cylinder_moments(z0: float) -> Array:
    """Return the moments of a cylinder of radius 1 and half height z0, and of its slope, in circumscribed radii.

    The moment of order n, odd, is 1/2 sum_k (-1)^k C(n, k) C(2n - 2k, n) 2^-n z0^(n - 2k) [(1 + z0^2)^(k+1) -
    z0^(2k+2)] / (k + 1). The bracket is expanded, because its two terms cancel for needles.
    """
    span2 = 1 + z0 * z0
    x, a2 = z0 * z0 / span2, 1 / span2
    moments = [0.0] * (ORDER + 1)
    for n in range(1, ORDER + 1, 2):
        total = 0.0
        for k in range(n // 2 + 1):
            bracket = a2 * sum(x ** (k - j) for j in range(k + 1)) / (k + 1)
            total += (-1) ** k * math.comb(n, k) * math.comb(2 * n - 2 * k, n) * x ** (n / 2 - k) * bracket
        moments[n] = total / 2 ** (n + 1)
    return _with_slope(moments)
