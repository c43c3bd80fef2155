"""Field of a cylinder magnet at many points: the formulas of `analytic.field.cylinder_numpy`, batch by batch.

`analytic.field.cylinder_compiled` compiles these functions. Their loops over a batch have no branches and a fixed
number of steps, and all numbers of a batch are in one array at constant offsets: the compiler can then compute
several points in one instruction. `fill` sorts the points and end faces of a batch by method:

- far points and far faces: the multipoles by Clenshaw's recurrence, which needs no division;
- near faces and the rings of thin points with k >= `REGULAR`, thus off the rim: the arithmetic-geometric mean in
  `STEPS` steps, exact to rounding;
- all others, which are few: `analytic.field.cylinder_pointwise`, one by one.
"""

from __future__ import annotations

import math

import numpy as np

from analytic.field.cylinder_numpy import FAR, GAUSS, NEAR_HULL, ORDER, THIN
from analytic.field.cylinder_pointwise import NODES, WEIGHTS, _face, _gap, _ring_of, _ring_slope, _sign, at

POINTS = 256
"""Number of points in a batch: its numbers stay in the processor's second cache."""
FACES = 2 * POINTS
STEPS = 5
"""Number of steps of the mean for a regular face."""
REGULAR = 0.085
"""Smallest k = sqrt(Q/S) of a regular face. After STEPS - 1 steps the two means differ by a fraction of 1e-8 at most
(1e-8 is `cylinder_numpy.SETTLED`), so that the last step is exact to rounding."""
LARGE = 1e100
"""Distance from the centre, in radii, beyond which points are computed one by one, before squares overflow."""

# offsets of the numbers of the points: distance from the axis, 1 - r, heights above the centre, the top and the
# bottom; the field and its slope; the jumps of far faces
R, GAP, Z, UP, DOWN, LEAN, ALONG, LEAN_Z, ALONG_Z, JUMP = (POINTS * row for row in range(10))
# offsets of the numbers of the faces, or far points, of one method, and of what the kernels compute for them
_R, _GAP, _Z, _LEAN, _ALONG, _MEAN, _K, _D, _C = (10 * POINTS + FACES * row for row in range(9))
# the same, where they hold 1/d, cos/d, 1/d^2, and what Clenshaw's recurrence had one order before
_INVERSE, _COS, _SQUARE, _LAST_LEAN, _LAST_ALONG = _K, _D, _C, _MEAN, _GAP
SIZE = 10 * POINTS + 9 * FACES

# factors of Clenshaw's recurrence for P_n and P'_(n+1): b_n = a_n + FIRST[n] cos/d b_(n+1) - SECOND[n] b_(n+2)/d^2
TERMS = ORDER + 3
_n = np.arange(TERMS)
FIRST, SECOND = (2 * _n + 1) / (_n + 1), (_n + 1) / (_n + 2)
FIRST_TANGENT, SECOND_TANGENT = (2 * _n + 3) / (_n + 1), (_n + 3) / (_n + 2)


def fill(x, radius, half, J, moments, faces, B, jacobian):
    """Fill B and, if it is not empty, the Jacobian; return the index of the first point without a field, or -1.

    Parameters
    ----------
    x : shape (n, 3), mm.
    radius, half, J : the magnet's radius and half height, mm, and its polarisation, T.
    moments, faces : `cylinder_moments(half / radius)` and `face_moments()` of `analytic.field.cylinder_numpy`.
    B, jacobian : arrays to fill, shape (n, 3), T, and shape (n, 3, 3), T/mm, or (0, 3, 3) for no Jacobian.
    """
    slope, z0, span = len(jacobian) > 0, half / radius, math.hypot(1.0, half / radius)
    own, of_face = _series(moments), _series(faces)
    w, who, counts = np.empty(SIZE), np.empty((4, FACES), np.int64), np.empty(4, np.int64)
    for start in range(0, len(x), POINTS):
        part = x[start : start + POINTS]
        _set_lengths(part, radius, half, w)
        bad = _sort(part, radius, half, moments, faces, w, who, counts)
        if bad >= 0:
            return start + bad
        _far_points(who[0], counts[0], span, own, slope, w)
        _thin_points(who[1], counts[1], z0, slope, w)
        _far_faces(who[2], counts[2], of_face, slope, w)
        _regular_faces(who[3], counts[3], slope, w)
        _write_field(part, radius, J, w, B[start : start + POINTS])
        if slope:
            _write_jacobian(part, radius, J, w, jacobian[start : start + POINTS])
    return -1


def _series(moments):
    """Return the coefficients of P_n and P'_(n+1) in the field and in its slope, shape (4, TERMS)."""
    series = np.zeros((4, TERMS))
    for n in range(ORDER + 2):
        for k in range(2):
            series[2 * k, n] = moments[k, n] * (n + 1)
            if n > 0:
                series[2 * k + 1, n - 1] = moments[k, n]
    return series


def _set_lengths(x, radius, half, w):
    """Write the lengths of the points, in radii, and fields of 0."""
    for j in range(len(x)):
        u, v = x[j, 0] / radius, x[j, 1] / radius
        w[R + j] = math.sqrt(u * u + v * v)
        w[GAP + j] = 1 - w[R + j]
        w[Z + j] = x[j, 2] / radius
        w[UP + j] = (x[j, 2] - half) / radius
        w[DOWN + j] = (x[j, 2] + half) / radius
        w[LEAN + j] = w[ALONG + j] = w[LEAN_Z + j] = w[ALONG_Z + j] = w[JUMP + j] = 0.0


def _sort(x, radius, half, moments, faces, w, who, counts):
    """List far points, thin points, far faces and regular faces in `who`, and compute all others for J = 1.

    Return the index of the first point without a field, or -1. A face of the point j has the number 2 j at the top
    and 2 j + 1 at the bottom.
    """
    z0 = half / radius
    far2, thin2 = FAR * FAR * (1 + z0 * z0), THIN * THIN * z0 * z0
    counts[:] = 0
    for j in range(len(x)):
        r, z = w[R + j], w[Z + j]
        d2 = r * r + z * z
        remote = not d2 < LARGE * LARGE  # a NaN too
        if d2 > far2 and not remote:
            _append(j, who[0], counts[0:])
            continue
        if abs(w[GAP + j]) < NEAR_HULL:
            w[GAP + j] = _gap(x[j, 0], x[j, 1], math.hypot(x[j, 0], x[j, 1]), radius)
        gap = w[GAP + j]
        thin = gap * gap + z * z > thin2
        if thin and not remote and _is_regular(r, gap, max(abs(z) - z0, 0.0)):
            _append(j, who[1], counts[1:])
            continue
        if thin or remote:
            good, w[LEAN + j], w[ALONG + j], w[LEAN_Z + j], w[ALONG_Z + j] = at(
                x[j, 0], x[j, 1], x[j, 2], radius, half, moments, faces
            )
            if not good:
                return j
            continue
        if gap == 0 and (w[UP + j] == 0 or w[DOWN + j] == 0):
            return j
        for face in range(2):
            zeta = w[UP + POINTS * face + j]
            if r * r + zeta * zeta > FAR * FAR:
                _append(2 * j + face, who[2], counts[2:])
            elif _is_regular(r, gap, zeta):
                _append(2 * j + face, who[3], counts[3:])
            else:
                lean, along, lean_z, along_z, _ = _face(r, gap, zeta, faces)
                sign = 1.0 - 2.0 * face
                w[LEAN + j] += sign * lean
                w[ALONG + j] += sign * along
                w[LEAN_Z + j] += sign * lean_z
                w[ALONG_Z + j] += sign * along_z
    return -1


def _append(number, who, counts):
    who[counts[0]] = number
    counts[0] += 1


def _is_regular(r, gap, zeta):
    """Return whether k = sqrt(Q/S) exceeds REGULAR."""
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
            w[LEAN_Z + who[k]], w[ALONG_Z + who[k]] = w[_LEAN + k] / span**2, w[_ALONG + k] / span


def _thin_points(who, count, z0, slope, w):
    """Add field and slope of the rings at the Gauss points to the thin points."""
    for node in range(GAUSS):
        for k in range(count):
            w[_R + k], w[_GAP + k] = w[R + who[k]], w[GAP + who[k]]
            w[_Z + k] = w[Z + who[k]] - z0 * NODES[node]
        _means(count, w)
        _rings(count, w)
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


def _regular_faces(who, count, slope, w):
    """Add field and slope of the regular faces."""
    _collect(who, count, w)
    _means(count, w)
    _add_faces(who, count, 1.0, LEAN, ALONG, w)
    if slope:
        # a charged face is the end of a solenoid, whose slope along z is a ring of the opposite sign
        _rings(count, w)
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


def _means(count, w):
    """Compute the field of regular faces as `cylinder_numpy._near` does, with one division a step."""
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
        for _ in range(STEPS - 1):
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


def _rings(count, w):
    """Compute the fields of rings, and the integrals K, D and C, from the fields of faces at the same places."""
    for k in range(count):
        r, gap, zeta = w[_R + k], w[_GAP + k], w[_Z + k]
        S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
        S3 = math.pi * S * math.sqrt(S)
        C, K = w[_LEAN + k] * S3 / 4, math.pi / 2 * 2.0**STEPS / w[_MEAN + k]
        D = (K + 4 * r / S * C) / 2
        w[_K + k], w[_D + k], w[_C + k] = K, D, C
        w[_LEAN + k], w[_ALONG + k] = _ring_of(r, gap, zeta, Q * S3, D, C)


def _ring_slopes(count, w):
    """Compute the slopes of rings from their integrals K, D and C."""
    for k in range(count):
        r, gap, zeta = w[_R + k], w[_GAP + k], w[_Z + k]
        S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
        scale = math.pi * S * math.sqrt(S) * Q
        w[_LEAN + k], w[_ALONG + k] = _ring_slope(r, gap, zeta, scale, w[_K + k], w[_D + k], w[_C + k])


def _directions(count, w):
    """Compute 1/d, cos/d and 1/d^2 of far points or faces."""
    for k in range(count):
        d2 = w[_R + k] * w[_R + k] + w[_Z + k] * w[_Z + k]
        inverse = 1 / math.sqrt(d2)
        w[_INVERSE + k] = inverse
        w[_COS + k], w[_SQUARE + k] = w[_Z + k] * inverse * inverse, inverse * inverse


def _multipole_sums(count, along, across, w):
    """Sum both series of a potential by Clenshaw's recurrence, two orders at a time."""
    for k in range(count):
        w[_LEAN + k] = w[_ALONG + k] = w[_LAST_LEAN + k] = w[_LAST_ALONG + k] = 0.0
    for n in range(TERMS - 1, 0, -2):
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
    """Write B, T, with the jumps: they are summed first, because their sum has no rounding error."""
    for j in range(len(x)):
        within = 0.5 * (_sign(w[GAP + j]) + 1)
        B[j, 0], B[j, 1] = J * w[LEAN + j] * (x[j, 0] / radius), J * w[LEAN + j] * (x[j, 1] / radius)
        w[ALONG + j] += within * w[JUMP + j]
        B[j, 2] = J * w[ALONG + j]


def _write_jacobian(x, radius, J, w, jacobian):
    """Write the Jacobian, T/mm, by div B = 0 and curl B = 0."""
    scale = J / radius
    for j in range(len(x)):
        u, v = x[j, 0] / radius, x[j, 1] / radius
        r2, lean, lean_z, along_z = u * u + v * v, w[LEAN + j], w[LEAN_Z + j], w[ALONG_Z + j]
        bend = -(along_z + 2 * lean) / r2 if r2 > 1e-300 else 0.0
        jacobian[j, 0, 0] = scale * (lean + bend * u * u)
        jacobian[j, 1, 1] = scale * (lean + bend * v * v)
        jacobian[j, 0, 1] = jacobian[j, 1, 0] = scale * (bend * u * v)
        jacobian[j, 0, 2] = jacobian[j, 2, 0] = scale * (lean_z * u)
        jacobian[j, 1, 2] = jacobian[j, 2, 1] = scale * (lean_z * v)
        jacobian[j, 2, 2] = scale * along_z
