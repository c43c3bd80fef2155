"""Field of a cylinder magnet at single points: the formulas of `analytic.field.cylinder_numpy` in plain Python.

For a few points this is faster than NumPy. `analytic.field.cylinder_compiled` compiles these functions by numba for
many points.
"""

from __future__ import annotations

import math

import numpy as np

from analytic.field.cylinder_numpy import FAR, GAUSS, NEAR_HULL, ORDER, SETTLED, SPLIT, THIN

NODES, WEIGHTS = (tuple(row.tolist()) for row in np.polynomial.legendre.leggauss(GAUSS))


def meridian(rho, z, radius, half, J, moments, faces):
    """Return the field at a distance rho from the axis and a height z above the centre, mm.

    The result has seven values: whether the field is defined; B_r and B_z, T; dB_r/dr, B_r/r, dB_r/dz and dB_z/dz,
    T/mm. Other parameters as in `cylinder_batches.fill`; `moments` and `faces` may also be lists of lists.
    """
    good, lean, along, lean_z, along_z = at(rho, 0.0, z, radius, half, moments, faces)
    r, scale = rho / radius, J / radius
    # div B = 0: dB_r/dr = -(dB_z/dz + B_r/r)
    across = -scale * (along_z + lean)
    return good, J * lean * r, J * along, across, scale * lean, scale * lean_z * r, scale * along_z


def at(x, y, z, radius, half, moments, faces):
    """Return whether the field is defined at a point, and B_r/r, B_z and their slopes along z.

    The point, radius and half height are in mm; the field is for J = 1 and lengths in radii.
    """
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        return False, 0.0, 0.0, 0.0, 0.0
    rho = math.hypot(x, y)
    r, gap = rho / radius, 1 - rho / radius
    if abs(gap) < NEAR_HULL:
        gap = _gap(x, y, rho, radius)
    up, down, high, z0 = (z - half) / radius, (z + half) / radius, z / radius, half / radius
    if gap == 0 and (up == 0 or down == 0):
        return False, 0.0, 0.0, 0.0, 0.0
    span = math.hypot(1.0, z0)
    if math.hypot(r, high) > FAR * span:
        lean, along, lean_z, along_z = _multipoles(r / span, high / span, moments)
        return True, lean / span, along, lean_z / span**2, along_z / span
    if math.hypot(gap, high) > THIN * z0:
        lean, along, lean_z, along_z = 0.0, 0.0, 0.0, 0.0
        for k in range(GAUSS):
            weight, zeta = z0 * WEIGHTS[k], high - z0 * NODES[k]
            b_r, b_z, b_r_z, b_z_z = _ring(r, gap, zeta)
            lean, along = lean + weight * b_r, along + weight * b_z
            lean_z, along_z = lean_z + weight * b_r_z, along_z + weight * b_z_z
        return True, lean, along, lean_z, along_z
    top = _face(r, gap, up, faces)
    bottom = _face(r, gap, down, faces)
    within = 0.5 * (_sign(gap) + 1)
    step = (_sign(down) - _sign(up)) / 2 + (top[4] - bottom[4])
    return True, top[0] - bottom[0], within * step + (top[1] - bottom[1]), top[2] - bottom[2], top[3] - bottom[3]


def _face(r, gap, zeta, faces):
    """Return B_r/r, B_z and their slopes of one face, and the step that B_z lacks inside r = 1."""
    if math.hypot(r, zeta) > FAR:
        lean, along, lean_z, along_z = _multipoles(r, zeta, faces)
        return lean, along, lean_z, along_z, 0.0
    outer = 1 + r
    S, Q = zeta * zeta + outer * outer, zeta * zeta + gap * gap
    s, m = math.sqrt(S), 4 * r / S
    k = math.sqrt(Q) / s
    p, q = (1.0, 1.0) if gap == 0 else (abs(gap) / outer, _sign(gap))
    last, mean, product, c = 1.0, 1 + k, k, 1.0
    inverse = 1 / p
    c, q = c + q * inverse, 2 * (q + c * k * inverse)
    p = p + k * inverse
    term = 1 / (mean * mean)
    total, share, size = term / 2, 0.5, 2.0
    while abs(last - k) > SETTLED * last:
        last = mean
        k = 2 * math.sqrt(product)
        product = k * mean
        inverse = 1 / p
        ratio = product * inverse
        c, q = c + q * inverse, 2 * (q + c * ratio)
        p = p + ratio
        mean = mean + k
        term = term * m / mean
        term = term * term
        share, size = 0.5 * share, 2 * size
        total = total + term * share
    K = math.pi / 2 * size / mean
    C, S3 = K * total, math.pi * S * s
    lean, along = 4 * C / S3, -0.5 * zeta * (q + c * mean) / (mean * (mean + p) * outer * s)
    lean_z, along_z = _ring_of(r, gap, zeta, -Q * S3, (K + m * C) / 2, C)
    return lean, along, lean_z, along_z, 0.5 * _sign(zeta)


def _ring(r, gap, zeta):
    """Return B_r/r, B_z and their slopes of a ring of unit current at height 0."""
    S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
    m, s = 4 * r / S, math.sqrt(S)
    k = math.sqrt(Q) / s
    mean, product, last = 1 + k, k, 1.0
    term = 1 / (mean * mean)
    total, share, size = term / 2, 0.5, 2.0
    while abs(last - k) > SETTLED * last:
        last = mean
        k = 2 * math.sqrt(product)
        product = k * mean
        mean = mean + k
        term = term * m / mean
        term = term * term
        share, size = 0.5 * share, 2 * size
        total = total + term * share
    K = math.pi / 2 * size / mean
    C = K * total
    D, scale = (K + m * C) / 2, math.pi * S * s * Q
    lean, along = _ring_of(r, gap, zeta, scale, D, C)
    lean_z, along_z = _ring_slope(r, gap, zeta, scale, K, D, C)
    return lean, along, lean_z, along_z


def _ring_of(r, gap, zeta, scale, D, C):
    return 4 * zeta * (D - C) / scale, 2 * ((gap * (1 + r) + zeta * zeta) * D - 2 * r * gap * C) / scale


def _ring_slope(r, gap, zeta, scale, K, D, C):
    S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
    G = (K - D) * (S / Q)
    D_z, C_z = -4 * r * zeta * (G - C) / (S * S), -zeta * (G - 4 * C) / S
    lean, along = _ring_of(r, gap, zeta, scale, D, C)
    lean_z, along_z = _ring_of(r, gap, zeta, scale, D_z, C_z)
    shrink = zeta * (3 / S + 2 / Q)
    return lean_z + 4 * (D - C) / scale - shrink * lean, along_z + 4 * zeta * D / scale - shrink * along


def _multipoles(r, z, moments):
    own, slopes = moments[0], moments[1]
    d = math.hypot(r, z)
    cos, sin2, inverse = z / d, (r / d) ** 2, 1 / d
    along, across, along_z, across_z = 0.0, 0.0, 0.0, 0.0
    p_last, p, tangent_last, tangent = 0.0, 1.0, 0.0, 0.0
    power = inverse * inverse
    for n in range(ORDER + 2):
        along += own[n] * (n + 1) * p * power
        across += own[n] * tangent * power
        along_z += slopes[n] * (n + 1) * p * power
        across_z += slopes[n] * tangent * power
        power *= inverse
        p_last, p = p, ((2 * n + 1) * cos * p - n * p_last) / (n + 1)
        tangent_last, tangent = tangent, tangent_last + (2 * n + 1) * p_last
    return (
        (along + cos * across) * inverse,
        along * cos - sin2 * across,
        (along_z + cos * across_z) * inverse,
        along_z * cos - sin2 * across_z,
    )


def _gap(x, y, rho, radius):
    """Return 1 - rho/radius near the hull, as `analytic.field.cylinder_numpy.distance_to_hull` does."""
    a2, a2_low = _square(radius)
    x2, x2_low = _square(x)
    y2, y2_low = _square(y)
    first, first_low = _sum(a2, -x2)
    second, second_low = _sum(first, -y2)
    return (second + (first_low + second_low + (a2_low - x2_low - y2_low))) / (radius * (radius + rho))


def _square(a):
    wide = SPLIT * a
    high = wide - (wide - a)
    low = a - high
    square = a * a
    return square, ((high * high - square) + 2 * high * low) + low * low


def _sum(a, b):
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def _sign(v):
    return 1.0 if v > 0 else -1.0 if v < 0 else 0.0
