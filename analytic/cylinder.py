"""Field of a cylinder of radius 1 with J = 1, and its slope along z: the one implementation of the exact field.

The method depends on the point:

- far, beyond `FAR` circumscribed radii from the centre: multipoles to order `ORDER`, by Clenshaw's recurrence;
- thin, beyond `THIN` half heights from the rim: current rings at `GAUSS` Gauss points over the height;
- near, everywhere else: two charged end faces, with J added inside; each face by Bulirsch's cel (Derby & Olbert 2010)
  or, beyond `FAR` radii from the face, by its own multipoles.

With zeta the height above a face, S = zeta^2 + (1 + r)^2, Q = zeta^2 + (1 - r)^2, m = 4 r / S and
Delta^2 = 1 - m sin^2, rings and faces need K = int 1/Delta, C = int sin^2 cos^2 / Delta^3 and D = int sin^2 / Delta
over 0..pi/2. The arithmetic-geometric mean of 1 and sqrt(Q/S) gives, with its half differences c_n,

    K = pi / (2 a_inf),    C = (K/m^2) sum_{n>=1} 2^n c_n^2,    D = (K + m C) / 2,

a sum of positive terms, accurate on the axis too. A face has B_r/r = 4 C / (pi S^1.5) and
B_z = -zeta cel(k, g^2, 1, g) / (pi (1 + r) sqrt(S)), k^2 = Q/S, g = (1 - r)/(1 + r), less a step of 1/2 inside r = 1;
at r = 1 this cel jumps, and the mean of both sides is K. A ring of unit current has

    B_r/r = 4 zeta (D - C) / (pi S^1.5 Q),    B_z = 2 [(1 - r^2 + zeta^2) D - 2 r (1 - r) C] / (pi S^1.5 Q).

The slope of the cylinder's field along z is the difference of the rings at its ends. For a thin cylinder the two
rings cancel; there it is the sum of the slopes of the rings at the Gauss points. With G = int sin^2 / Delta^3 =
(K - D) S/Q these need

    dD/dzeta = -zeta m (G - C)/S,    dC/dzeta = -zeta (G - 4 C)/S,    d log(S^1.5 Q)/dzeta = zeta (3/S + 2/Q).

The other entries of the Jacobian follow from div B = 0 and curl B = 0.

Plain Python runs these functions for few points, and numba compiles them for many (`compiled_functions`).
They use +, -, *, / and square roots only, so that both have the same digits. Points are computed in batches, sorted
by method: a loop over a batch has no branches and a fixed number of steps, and all its numbers are in one array at
constant offsets, so that the compiled loops compute several points in one instruction.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache
from types import FunctionType, SimpleNamespace

import numpy as np

from geometry import compiled as compilation
from geometry.arrays import Array, Ints

FAR = 5.0
"""Distance, in circumscribed radii, beyond which the multipole series is used; its truncation error is 5^-28."""
THIN = 12.0
"""Distance from the rim, in half heights, beyond which Gauss points over the height suffice (error about 24^-12)."""
GAUSS = 6
"""Number of these Gauss points."""
ORDER = 27
"""Order of the highest multipole of the field; its slope has one order more."""
LARGE = 1e100
"""Distance from the centre, in radii, beyond which the field, below 1e-300 of J, counts as 0: squares overflow."""
REGULAR = 0.085
"""Smallest k = sqrt(Q/S) for which the mean settles in 5 steps: the two means then differ by a fraction of 1e-8 at
most before the last step, which squares it and is thus exact to rounding."""
STEPS, RIM_STEPS = (0,) * 5, (0,) * 12
"""Steps of the mean, and of that beside the rim, down to k = 1e-100. The number of steps is the length of a tuple,
since this is part of its type: numba compiles the loops anew for each length, without a branch."""

MIN_COMPILED_POINTS = 2000
"""Number of points in a call from which the compiled functions are loaded: that takes some tenths of a second, once
in a process, and plain Python less than 0.1 s for fewer points."""
THREAD_POINTS = 20_000
"""Number of points for each thread: they take 1 ms, ten times the time to start a thread."""

POINTS = 256
"""Number of points in a batch: its numbers stay in the processor's second cache."""
FACES = 2 * POINTS
METHODS = 6
FAR_POINT, THIN_POINT, THIN_RIM, FAR_FACE, FACE, FACE_RIM = range(METHODS)
"""Methods by which points and faces are sorted; those with RIM take `RIM_STEPS`."""

# offsets of the numbers of the points: distance from the axis, 1 - r, heights above the centre, the top and the
# bottom; the field B_r/r and B_z and its slopes along z; the jumps of far faces
R, GAP, Z, UP, DOWN, LEAN, ALONG, LEAN_Z, ALONG_Z, JUMP = (POINTS * row for row in range(10))
# offsets of the numbers of the faces, or far points, of one method, and of what the kernels compute for them
_R, _GAP, _Z, _LEAN, _ALONG, _MEAN, _K, _D, _C = (10 * POINTS + FACES * row for row in range(9))
# the same, where they hold 1/d, cos/d, 1/d^2, and what Clenshaw's recurrence had one order before
_INVERSE, _COS, _SQUARE, _LAST_LEAN, _LAST_ALONG = _K, _D, _C, _MEAN, _GAP
SIZE = 10 * POINTS + 9 * FACES

NODES, WEIGHTS = (tuple(row.tolist()) for row in np.polynomial.legendre.leggauss(GAUSS))
# factors of Clenshaw's recurrence for P_n and P'_(n+1): b_n = a_n + FIRST[n] cos/d b_(n+1) - SECOND[n] b_(n+2)/d^2
TERMS = ORDER + 3
FIRST, SECOND = (tuple((a * n + 1) / (n + b) for n in range(TERMS)) for a, b in ((2, 1), (1, 2)))
FIRST_TANGENT, SECOND_TANGENT = (tuple((a * n + 3) / (n + b) for n in range(TERMS)) for a, b in ((2, 1), (1, 2)))


def fill(x, radius, half, J, series, face_series, work, B, jacobian):
    """Fill B and, if it is not empty, the Jacobian; return the index of the first point without a field, or -1.

    Such a point, on the rim or not finite, gets NaN.

    Parameters
    ----------
    x : shape (n, 3), mm.
    radius, half, J : the magnet's radius and half height, mm, and its polarisation, T.
    series, face_series : `cylinder_series(half / radius)` and `disc_series()`.
    work : scratch: numbers, numbers of points and faces by method, and their counts.
    B, jacobian : arrays to fill, shape (n, 3), T, and shape (n, 3, 3), T/mm, or (0, 3, 3) for no Jacobian.
    """
    slope, w, first = len(jacobian) > 0, work[0], -1
    for start in range(0, len(x), POINTS):
        part = x[start : start + POINTS]
        for j in range(len(part)):
            set_point(j, float(part[j, 0]), float(part[j, 1]), float(part[j, 2]), radius, half, w)
        for j in range(len(part)):
            correct_gap(j, float(part[j, 0]), float(part[j, 1]), radius, w)
        bad = compute(len(part), half / radius, series, face_series, slope, work)
        if bad >= 0 and first < 0:
            first = start + bad
        _write_field(part, radius, J, w, B[start : start + POINTS])
        if slope:
            _write_jacobian(part, radius, J, w, jacobian[start : start + POINTS])
    return first


def set_point(j, x, y, z, radius, half, w):
    """Write the lengths of point j of a batch, in radii; R is NaN if the point, mm, is not finite."""
    u, v = x / radius, y / radius
    w[R + j] = math.sqrt(u * u + v * v) + 0 * (x + y + z)
    w[GAP + j] = 1 - w[R + j]
    # from mm, because rounding of z / radius would spoil the gaps to the faces
    w[Z + j], w[UP + j], w[DOWN + j] = z / radius, (z - half) / radius, (z + half) / radius


def correct_gap(j, x, y, radius, w):
    """Correct 1 - r of point j near the hull, (a^2 - x^2 - y^2) / (a (a + rho)), in doubled precision."""
    if abs(w[GAP + j]) < 0.01:
        a2, a2_low = _square(radius)
        x2, x2_low = _square(x)
        y2, y2_low = _square(y)
        first, first_low = _sum(a2, -x2)
        second, second_low = _sum(first, -y2)
        rest = first_low + second_low + (a2_low - x2_low - y2_low)
        w[GAP + j] = (second + rest) / (radius * (radius + math.sqrt(x * x + y * y)))


def compute(count, z0, series, face_series, slope, work):
    """Compute field and, with `slope`, slopes of the points of a batch, at LEAN to ALONG_Z of its numbers.

    Return the index of the first point without a field, or -1. `z0` is half the height, in radii.
    """
    w, who, counts = work
    bad = _sort(count, z0, w, who, counts)
    _far_points(who[FAR_POINT], counts[FAR_POINT], math.sqrt(1 + z0 * z0), series, slope, w)
    _thin_points(who[THIN_POINT], counts[THIN_POINT], z0, slope, w, STEPS)
    _thin_points(who[THIN_RIM], counts[THIN_RIM], z0, slope, w, RIM_STEPS)
    _far_faces(who[FAR_FACE], counts[FAR_FACE], face_series, slope, w)
    _faces(who[FACE], counts[FACE], slope, w, STEPS)
    _faces(who[FACE_RIM], counts[FACE_RIM], slope, w, RIM_STEPS)
    for j in range(count):
        # the jumps are summed first, because their sum has no rounding error
        w[ALONG + j] += 0.5 * (_sign(w[GAP + j]) + 1) * w[JUMP + j]
    return bad


def _sort(count, z0, w, who, counts):
    """List points and faces by their method; return the index of the first point without a field, or -1.

    A face of the point j has the number 2 j at the top and 2 j + 1 at the bottom.
    """
    far2, thin2, bad = FAR * FAR * (1 + z0 * z0), THIN * THIN * z0 * z0, -1
    for method in range(METHODS):
        counts[method] = 0
    for j in range(count):
        w[LEAN + j] = w[ALONG + j] = w[LEAN_Z + j] = w[ALONG_Z + j] = w[JUMP + j] = 0.0
        r, gap, z, up, down = w[R + j], w[GAP + j], w[Z + j], w[UP + j], w[DOWN + j]
        d2 = r * r + z * z
        if math.isnan(r) or (gap == 0 and (up == 0 or down == 0)):
            w[LEAN + j] = w[ALONG + j] = w[LEAN_Z + j] = w[ALONG_Z + j] = math.nan
            bad = j if bad < 0 else bad
        elif d2 > LARGE * LARGE:
            continue
        elif d2 > far2:
            _append(j, FAR_POINT, who, counts)
        elif gap * gap + z * z > thin2:
            regular = _is_regular(r, gap, max(abs(z) - z0, 0.0))
            _append(j, THIN_POINT if regular else THIN_RIM, who, counts)
        else:
            for face in range(2):
                zeta = up if face == 0 else down
                far = r * r + zeta * zeta > FAR * FAR
                method = FAR_FACE if far else FACE if _is_regular(r, gap, zeta) else FACE_RIM
                _append(2 * j + face, method, who, counts)
    return bad


def _append(number, method, who, counts):
    who[method][counts[method]] = number
    counts[method] += 1


def _is_regular(r, gap, zeta):
    return zeta * zeta + gap * gap > REGULAR * REGULAR * (zeta * zeta + (1 + r) * (1 + r))


def _far_points(who, count, span, series, slope, w):
    """Write field and slope of the far points."""
    for k in range(count):
        w[_R + k], w[_Z + k] = w[R + who[k]] / span, w[Z + who[k]] / span
    _directions(count, w)
    _multipole_sums(count, series[0], series[1], w)
    for k in range(count):
        w[LEAN + who[k]], w[ALONG + who[k]] = w[_LEAN + k] / span, w[_ALONG + k]
    if slope:
        _multipole_sums(count, series[2], series[3], w)
        for k in range(count):
            w[LEAN_Z + who[k]], w[ALONG_Z + who[k]] = w[_LEAN + k] / (span * span), w[_ALONG + k] / span


def _thin_points(who, count, z0, slope, w, steps):
    """Add field and slope of the rings at the Gauss points to the thin points."""
    for node in range(GAUSS if count > 0 else 0):
        for k in range(count):
            w[_R + k], w[_GAP + k] = w[R + who[k]], w[GAP + who[k]]
            w[_Z + k] = w[Z + who[k]] - z0 * NODES[node]
        _means(count, w, steps)
        _rings(count, w, steps)
        _add_points(who, count, z0 * WEIGHTS[node], LEAN, ALONG, w)
        if slope:
            _ring_slopes(count, w)
            _add_points(who, count, z0 * WEIGHTS[node], LEAN_Z, ALONG_Z, w)


def _far_faces(who, count, series, slope, w):
    """Add field and slope of the far faces, and the jumps of their B_z that the near form would have inside r = 1."""
    _collect(who, count, w)
    _directions(count, w)
    _multipole_sums(count, series[0], series[1], w)
    _add_faces(who, count, 1.0, LEAN, ALONG, w)
    for k in range(count):
        w[JUMP + who[k] // 2] -= (0.5 - who[k] % 2) * _sign(w[_Z + k])
    if slope:
        _multipole_sums(count, series[2], series[3], w)
        _add_faces(who, count, 1.0, LEAN_Z, ALONG_Z, w)


def _faces(who, count, slope, w, steps):
    """Add field and slope of near faces, and the step of their B_z inside r = 1."""
    _collect(who, count, w)
    _means(count, w, steps)
    _add_faces(who, count, 1.0, LEAN, ALONG, w)
    if slope:
        # a charged face is the end of a solenoid, whose slope along z is a ring of the opposite sign
        _rings(count, w, steps)
        _add_faces(who, count, -1.0, LEAN_Z, ALONG_Z, w)


def _collect(who, count, w):
    """Copy r, 1 - r and the height of some faces to where the kernels find them."""
    for k in range(count):
        j, face = who[k] // 2, who[k] % 2
        w[_R + k], w[_GAP + k], w[_Z + k] = w[R + j], w[GAP + j], w[UP + POINTS * face + j]


def _add_points(who, count, weight, lean, along, w):
    """Add a multiple of what the kernels computed to some points."""
    for k in range(count):
        w[lean + who[k]] += weight * w[_LEAN + k]
        w[along + who[k]] += weight * w[_ALONG + k]


def _add_faces(who, count, sign, lean, along, w):
    """Add what the kernels computed for some faces to their points, that of the bottom with the opposite sign."""
    for k in range(count):
        j, weight = who[k] // 2, sign - 2.0 * sign * (who[k] % 2)
        w[lean + j] += weight * w[_LEAN + k]
        w[along + j] += weight * w[_ALONG + k]


def _means(count, w, steps):
    """Compute the field of near faces by the arithmetic-geometric mean, with one division a step."""
    for k in range(count):
        r, gap, zeta = w[_R + k], w[_GAP + k], w[_Z + k]
        outer = 1 + r
        S, Q = zeta * zeta + outer * outer, zeta * zeta + gap * gap
        inverse = 1 / (S * outer)
        m, b = 4 * r * (inverse * outer), math.sqrt(Q * (inverse * outer))
        p = 1.0 if gap == 0 else abs(gap) * (inverse * S)
        q = -1.0 if gap < 0 else 1.0
        mean, product = 1 + b, b
        inverse = 1 / (p * mean)
        c, q = 1 + q * (inverse * mean), 2 * (q + b * (inverse * mean))
        p, term = p + b * (inverse * mean), (inverse * p) * (inverse * p)
        total, share = term / 2, 0.5
        for _ in range(len(steps) - 1):
            b = 2 * math.sqrt(product)
            product = b * mean
            mean = mean + b
            inverse = 1 / (p * mean)
            ratio = product * (inverse * mean)
            c, q = c + q * (inverse * mean), 2 * (q + c * ratio)
            term = term * m * (inverse * p)
            term = term * term
            p = p + ratio
            share = 0.5 * share
            total = total + term * share
        s = math.sqrt(S)
        inverse = 1 / (mean * S * s * (mean + p) * outer)
        w[_LEAN + k] = (2 / share * total) * (mean + p) * outer * inverse
        w[_ALONG + k] = -0.5 * zeta * (q + c * mean) * S * inverse
        w[_MEAN + k] = mean


def _rings(count, w, steps):
    """Compute the fields of rings, and the integrals K, D and C, from the fields of faces at the same places."""
    for k in range(count):
        r, gap, zeta = w[_R + k], w[_GAP + k], w[_Z + k]
        S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
        S3 = math.pi * S * math.sqrt(S)
        C, K = w[_LEAN + k] * S3 / 4, math.pi / 2 * 2.0 ** len(steps) / w[_MEAN + k]
        D = (K + 4 * r / S * C) / 2
        w[_K + k], w[_D + k], w[_C + k] = K, D, C
        w[_LEAN + k], w[_ALONG + k] = _ring_of(r, gap, zeta, Q * S3, D, C)


def _ring_slopes(count, w):
    """Compute the slopes of rings from their integrals K, D and C."""
    for k in range(count):
        r, gap, zeta, K, D, C = w[_R + k], w[_GAP + k], w[_Z + k], w[_K + k], w[_D + k], w[_C + k]
        S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
        scale = math.pi * S * math.sqrt(S) * Q
        G = (K - D) * (S / Q)
        D_z, C_z = -4 * r * zeta * (G - C) / (S * S), -zeta * (G - 4 * C) / S
        lean, along = _ring_of(r, gap, zeta, scale, D, C)
        lean_z, along_z = _ring_of(r, gap, zeta, scale, D_z, C_z)
        shrink = zeta * (3 / S + 2 / Q)
        w[_LEAN + k] = lean_z + 4 * (D - C) / scale - shrink * lean
        w[_ALONG + k] = along_z + 4 * zeta * D / scale - shrink * along


def _ring_of(r, gap, zeta, scale, D, C):
    """Return B_r/r and B_z of a ring of unit current from the integrals D and C; `scale` is pi S^1.5 Q."""
    return 4 * zeta * (D - C) / scale, 2 * ((gap * (1 + r) + zeta * zeta) * D - 2 * r * gap * C) / scale


def _directions(count, w):
    """Compute 1/d, cos/d and 1/d^2 of far points or faces."""
    for k in range(count):
        inverse = 1 / math.sqrt(w[_R + k] * w[_R + k] + w[_Z + k] * w[_Z + k])
        w[_INVERSE + k] = inverse
        w[_COS + k], w[_SQUARE + k] = w[_Z + k] * inverse * inverse, inverse * inverse


def _multipole_sums(count, along, across, w):
    """Sum both series of a potential by Clenshaw's recurrence, two orders at a time."""
    for k in range(count):
        w[_LEAN + k] = w[_ALONG + k] = w[_LAST_LEAN + k] = w[_LAST_ALONG + k] = 0.0
    for n in range(TERMS - 1 if count > 0 else 0, 0, -2):
        a1, f1, g1 = along[n], FIRST[n], SECOND[n]
        a0, f0, g0 = along[n - 1], FIRST[n - 1], SECOND[n - 1]
        c1, h1, i1 = across[n], FIRST_TANGENT[n], SECOND_TANGENT[n]
        c0, h0, i0 = across[n - 1], FIRST_TANGENT[n - 1], SECOND_TANGENT[n - 1]
        for k in range(count):
            t, w2 = w[_COS + k], w[_SQUARE + k]
            last, old = w[_LEAN + k], w[_LAST_LEAN + k]
            new = a1 + f1 * t * last - g1 * w2 * old
            w[_LEAN + k], w[_LAST_LEAN + k] = a0 + f0 * t * new - g0 * w2 * last, new
            last, old = w[_ALONG + k], w[_LAST_ALONG + k]
            new = c1 + h1 * t * last - i1 * w2 * old
            w[_ALONG + k], w[_LAST_ALONG + k] = c0 + h0 * t * new - i0 * w2 * last, new
    for k in range(count):
        inverse, w2 = w[_INVERSE + k], w[_SQUARE + k]
        cos, sin = w[_Z + k] * inverse, w[_R + k] * inverse
        first, second = w[_LEAN + k] * w2, w[_ALONG + k] * w2 * inverse
        w[_LEAN + k] = (first + cos * second) * inverse
        w[_ALONG + k] = first * cos - sin * sin * second


def _write_field(x, radius, J, w, B):
    for j in range(len(x)):
        lean = J * w[LEAN + j]
        B[j, 0], B[j, 1] = lean * (float(x[j, 0]) / radius), lean * (float(x[j, 1]) / radius)
        B[j, 2] = J * w[ALONG + j]


def _write_jacobian(x, radius, J, w, jacobian):
    """Write the Jacobian, T/mm, by div B = 0 and curl B = 0."""
    scale = J / radius
    for j in range(len(x)):
        u, v = float(x[j, 0]) / radius, float(x[j, 1]) / radius
        r2, lean, lean_z, along_z = u * u + v * v, w[LEAN + j], w[LEAN_Z + j], w[ALONG_Z + j]
        # d(B_r/r)/dr = -(dB_z/dz + 2 B_r/r)/r goes to 0 on the axis
        bend = -(along_z + 2 * lean) / r2 if r2 > 1e-300 else 0.0
        jacobian[j, 0, 0] = scale * (lean + bend * u * u)
        jacobian[j, 1, 1] = scale * (lean + bend * v * v)
        jacobian[j, 0, 1] = jacobian[j, 1, 0] = scale * (bend * u * v)
        jacobian[j, 0, 2] = jacobian[j, 2, 0] = scale * (lean_z * u)
        jacobian[j, 1, 2] = jacobian[j, 2, 1] = scale * (lean_z * v)
        jacobian[j, 2, 2] = scale * along_z


def _square(a):
    """Return a^2 and its rounding error (Dekker)."""
    # 2^27 + 1 splits a float into two halves of its digits
    wide = 134217729.0 * a
    high = wide - (wide - a)
    low = a - high
    square = a * a
    return square, ((high * high - square) + 2 * high * low) + low * low


def _sum(a, b):
    """Return a + b and its rounding error (Knuth)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _sign(v):
    return 1.0 if v > 0 else -1.0 if v < 0 else 0.0


def _series(moments: list[float]) -> Array:
    """Return the coefficients of P_n and P'_(n+1) in a field and in its slope, from the moments of a potential.

    The potential is sum moments[n] P_n(cos theta) / d^(n+1); the result has shape (4, TERMS).
    """
    both = np.zeros((2, TERMS))
    both[0, : ORDER + 1] = moments
    both[1, 1 : ORDER + 2] = -np.arange(1, ORDER + 2) * moments
    series = np.zeros((4, TERMS))
    series[::2], series[1::2, :-1] = both * np.arange(1, TERMS + 1), both[:, 1:]
    return series


@lru_cache(maxsize=256)
def disc_series() -> Array:
    """Return the series of a charged disc, from its potential (sqrt(z^2 + 1) - z)/2 on the axis."""
    moments = [0.0] * (ORDER + 1)
    binomial = 1.0
    for k in range(1, ORDER // 2 + 2):
        binomial *= (1.5 - k) / k
        moments[2 * k - 2] = binomial / 2
    return _series(moments)


@lru_cache(maxsize=256)
def cylinder_series(z0: float) -> Array:
    """Return the series of a cylinder of radius 1 and half height z0, in circumscribed radii.

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
    return _series(moments)


def computed(x: Array, radius: float, half: float, J: float, *, slope: bool) -> tuple[Array, Array, int]:
    """Return B, its Jacobian (shape (0, 3, 3) without `slope`), and the first point without a field, or -1.

    Such a point gets NaN. Threads share many points. The digits do not depend on their number: each computes whole
    batches. Parameters as in `fill`.
    """
    B, jacobian = np.empty_like(x), np.empty((len(x) if slope else 0, 3, 3))
    series = cylinder_series(half / radius), disc_series()
    if len(x) < MIN_COMPILED_POINTS and not compiled_functions.cache_info().currsize:
        # plain Python indexes lists faster than arrays
        work = [0.0] * SIZE, [[0] * FACES for _ in range(METHODS)], [0] * METHODS
        lists = series[0].tolist(), series[1].tolist()
        return B, jacobian, int(fill(x, radius, half, J, *lists, work, B, jacobian))
    count = max(min(compilation.threads(), len(x) // THREAD_POINTS), 1)
    share = math.ceil(len(x) / count / POINTS) * POINTS
    fill_compiled = compiled_functions().fill

    def fill_part(start: int) -> int:
        part = slice(start, start + share)
        bad = int(fill_compiled(x[part], radius, half, J, *series, workspace(), B[part], jacobian[part]))
        return start + bad if bad >= 0 else len(x)

    if count == 1:
        bad = fill_part(0)
    else:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(count) as pool:
            bad = min(pool.map(fill_part, range(0, len(x), share)))
    return B, jacobian, bad if bad < len(x) else -1


def workspace() -> tuple[Array, Ints, Ints]:
    """Return the scratch that `fill` and `compute` need: numbers, points and faces by method, and their counts."""
    return np.empty(SIZE), np.empty((METHODS, FACES), np.int64), np.empty(METHODS, np.int64)


@cache
def compiled_functions() -> SimpleNamespace:
    """Return the functions without annotations, compiled by numba, which this imports.

    They are a second set of function objects with a scope of their own: the plain functions stay beside them. Other
    functions that numba compiles can call `set_point`, `correct_gap` and `compute`.
    """
    scope = dict(globals())
    for name, plain in globals().items():
        # numba looks up the names in a function when it is first called, so the order does not matter
        if isinstance(plain, FunctionType) and plain.__module__ == __name__ and not plain.__annotations__:
            scope[name] = compilation.compiled(FunctionType(plain.__code__, scope, name), nogil=True)
    return SimpleNamespace(**scope)
