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

The other slopes follow from div B = 0 and curl B = 0.

Plain Python runs these functions for few points, and numba compiles them for many (`compiled_functions`). They use
+, -, *, / and square roots only, so that both have the same digits.
"""

import math
from functools import cache, lru_cache
from types import FunctionType, SimpleNamespace

import numpy as np

from geometry import compiled as compilation
from geometry.arrays import Array, read_only

FAR = 8.0
"""Distance, in circumscribed radii, beyond which the multipole series is used; its truncation error is 8^-18."""
THIN = 24.0
"""Distance from the rim, in half heights, beyond which Gauss points over the height suffice (error about 48^-10).
Below it the two end faces, whose difference the field is, lose at most 24 times their rounding."""
NODES, WEIGHTS = (tuple(row.tolist()) for row in np.polynomial.legendre.leggauss(5))
"""These Gauss points: five of them have this error."""
ORDER = 17
"""Order of the highest multipole of the field; its slope has one order more."""
BLOCK = 256
"""Number of points in a batch: its numbers stay in the processor's second cache."""
STEPS, REGULAR = 5, 0.085
"""Steps in which the mean settles for k = sqrt(Q/S) above REGULAR: the two means then differ by a fraction of 1e-8 at
most before the last step, which squares it and is thus exact to rounding."""
MIN_COMPILED_POINTS = 2000
"""Number of points in a call from which the compiled functions are loaded: that takes some tenths of a second, once
in a process, and plain Python less than 0.1 s for fewer points."""
THREAD_POINTS = 20_000
"""Number of points for each thread: they take 1 ms, ten times the time to start a thread."""

_N = range(ORDER + 3)
FIRST, SECOND, FIRST_TANGENT, SECOND_TANGENT = (
    tuple((a * n + b) / (n + c) for n in _N) for a, b, c in ((2, 1, 1), (1, 1, 2), (2, 3, 1), (1, 3, 2))
)
"""Factors of Clenshaw's recurrence, b_n = a_n + FIRST[n] cos/d b_(n+1) - SECOND[n] b_(n+2)/d^2, for P_n and
P'_(n+1)."""


def fill(x, radius, half, J, series, disc, B):
    """Fill B, shape (n, 3), T; return the index of the first point without a field, or -1.

    Such a point, on the rim or not finite, gets NaN.

    Parameters
    ----------
    x : shape (n, 3), mm.
    radius, half, J : the magnet's radius and half height, mm, and its polarisation, T.
    series, disc : `cylinder_series(half / radius)` and `disc_series()`.
    """
    first, z0 = -1, half / radius
    near, places, fields = np.empty(BLOCK, np.int64), np.empty((5, BLOCK)), np.empty((2, BLOCK))
    for start in range(0, len(x), BLOCK):
        count = 0
        for j in range(start, min(start + BLOCK, len(x))):
            place = lengths(x[j, 0], x[j, 1], x[j, 2], radius, half)
            if _is_near(place, z0):
                near[count] = j
                for k in range(5):
                    places[k, count] = place[k]
                count += 1
            else:
                lean, along, _, _ = unit_field(place, z0, series, disc, False)
                write(j, x[j], radius, J, lean, along, B)
                first = j if first < 0 and math.isnan(lean) else first
        # near points, as in `unit_field`, by a loop without a branch: an instruction computes several of them
        r, gap, _, up, down = places
        for k in range(count):
            upper_lean, upper_along, _ = _face(r[k], gap[k], up[k], STEPS)
            lower_lean, lower_along, _ = _face(r[k], gap[k], down[k], STEPS)
            fields[0, k], fields[1, k] = upper_lean - lower_lean, upper_along - lower_along
        for k in range(count):
            write(near[k], x[near[k]], radius, J, fields[0, k], fields[1, k], B)
    return first


def _is_near(place, z0):
    """Return whether a point needs both faces, and their means settle in `STEPS` steps."""
    r, gap, z, up, down = place
    far = r * r + z * z > FAR * FAR * (1 + z0 * z0) or r * r + max(up * up, down * down) > FAR * FAR
    thin = gap * gap + z * z > THIN * THIN * z0 * z0
    regular = _steps(r, gap, up) == _steps(r, gap, down) == STEPS
    return regular and not (far or thin or math.isnan(r))


def write(j, point, radius, J, lean, along, B):
    B[j, 0], B[j, 1], B[j, 2] = J * lean * (point[0] / radius), J * lean * (point[1] / radius), J * along


def lengths(x, y, z, radius, half):
    """Return the lengths of a point, mm, in radii: r, 1 - r, and heights above the centre, the top and the bottom.

    r is NaN if the point is not finite.
    """
    u, v = x / radius, y / radius
    r = math.sqrt(u * u + v * v) + 0 * (x + y + z)
    gap = 1 - r
    if abs(gap) < 0.01:
        # near the hull by (a^2 - x^2 - y^2) / (a (a + rho)), in doubled precision
        a2, a2_low = _square(radius)
        x2, x2_low = _square(x)
        y2, y2_low = _square(y)
        first, first_low = _sum(a2, -x2)
        second, second_low = _sum(first, -y2)
        rest = first_low + second_low + (a2_low - x2_low - y2_low)
        gap = (second + rest) / (radius * (radius + math.sqrt(x * x + y * y)))
    # from mm, because rounding of z / radius would spoil the heights above the faces
    return r, gap, z / radius, (z - half) / radius, (z + half) / radius


def unit_field(place, z0, series, disc, slope):
    """Return B_r/r, B_z and, with `slope`, their slopes along z at a place of `lengths`; NaN where there is no field.

    z0 : half the height, in radii.
    """
    r, gap, z, up, down = place
    d2 = r * r + z * z
    if math.isnan(r) or (gap == 0 and (up == 0 or down == 0)):
        return math.nan, math.nan, math.nan, math.nan
    if d2 > 1e200:
        # below 1e-300 of J; squares overflow
        return 0.0, 0.0, 0.0, 0.0
    if d2 > FAR * FAR * (1 + z0 * z0):
        span = math.sqrt(1 + z0 * z0)
        lean, along, lean_z, along_z = _multipoles(r / span, z / span, series, slope)
        return lean / span, along, lean_z / (span * span), along_z / span
    lean, along, lean_z, along_z, jump = 0.0, 0.0, 0.0, 0.0, 0.0
    if gap * gap + z * z > THIN * THIN * z0 * z0:
        steps = _steps(r, gap, max(abs(z) - z0, 0.0))
        for node in range(len(NODES)):
            zeta, weight = z - z0 * NODES[node], z0 * WEIGHTS[node]
            a, _, mean = _face(r, gap, zeta, steps)
            ring_lean, ring_along, K, D, C = _ring(r, gap, zeta, steps, a, mean)
            lean, along = lean + weight * ring_lean, along + weight * ring_along
            if slope:
                bent_lean, bent_along = _ring_slope(r, gap, zeta, K, D, C, ring_lean, ring_along)
                lean_z, along_z = lean_z + weight * bent_lean, along_z + weight * bent_along
        return lean, along, lean_z, along_z
    for sign, zeta in ((1.0, up), (-1.0, down)):
        if r * r + zeta * zeta > FAR * FAR:
            a, b, c, d = _multipoles(r, zeta, disc, slope)
            # the jump of B_z that the near form has inside r = 1
            jump -= 0.5 * sign * (1.0 if zeta > 0 else -1.0 if zeta < 0 else 0.0)
        else:
            steps = _steps(r, gap, zeta)
            a, b, mean = _face(r, gap, zeta, steps)
            # a charged face is the end of a solenoid, whose slope along z is a ring of the opposite sign
            c, d = 0.0, 0.0
            if slope:
                c, d, _, _, _ = _ring(r, gap, zeta, steps, a, mean)
                c, d = -c, -d
        lean, along, lean_z, along_z = lean + sign * a, along + sign * b, lean_z + sign * c, along_z + sign * d
    # the jumps are summed first, because their sum has no rounding error
    return lean, along + jump * (1.0 if gap > 0 else 0.5 if gap == 0 else 0.0), lean_z, along_z


def _steps(r, gap, zeta):
    """Return the number of steps of the mean; beside the rim it settles in twelve, down to k = 1e-100."""
    return STEPS if zeta * zeta + gap * gap > REGULAR * REGULAR * (zeta * zeta + (1 + r) * (1 + r)) else 12


def _face(r, gap, zeta, steps):
    """Return B_r/r and B_z of a near face, and the arithmetic-geometric mean, with one division a step."""
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
    for _ in range(steps - 1):
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
    return (2 / share * total) * (mean + p) * outer * inverse, -0.5 * zeta * (q + c * mean) * S * inverse, mean


def _ring(r, gap, zeta, steps, lean, mean):
    """Return B_r/r and B_z of a ring, and the integrals K, D and C, from the face at the same place."""
    S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
    S3 = math.pi * S * math.sqrt(S)
    C, K = lean * S3 / 4, math.pi / 2 * (1 << steps) / mean
    D = (K + 4 * r / S * C) / 2
    ring_lean, ring_along = _ring_of(r, gap, zeta, Q * S3, D, C)
    return ring_lean, ring_along, K, D, C


def _ring_slope(r, gap, zeta, K, D, C, lean, along):
    """Return the slopes of a ring from its integrals and its field."""
    S, Q = zeta * zeta + (1 + r) * (1 + r), zeta * zeta + gap * gap
    scale = math.pi * S * math.sqrt(S) * Q
    G = (K - D) * (S / Q)
    D_z, C_z = -4 * r * zeta * (G - C) / (S * S), -zeta * (G - 4 * C) / S
    lean_z, along_z = _ring_of(r, gap, zeta, scale, D_z, C_z)
    shrink = zeta * (3 / S + 2 / Q)
    return lean_z + 4 * (D - C) / scale - shrink * lean, along_z + 4 * zeta * D / scale - shrink * along


def _ring_of(r, gap, zeta, scale, D, C):
    """Return B_r/r and B_z of a ring of unit current from the integrals D and C; `scale` is pi S^1.5 Q."""
    return 4 * zeta * (D - C) / scale, 2 * ((gap * (1 + r) + zeta * zeta) * D - 2 * r * gap * C) / scale


def _multipoles(r, z, series, slope):
    """Return B_r/r, B_z and, with `slope`, their slopes along z, from the series of a potential."""
    lean, along = _clenshaw(r, z, series[0], series[1])
    lean_z, along_z = _clenshaw(r, z, series[2], series[3]) if slope else (0.0, 0.0)
    return lean, along, lean_z, along_z


def _clenshaw(r, z, along, across):
    """Return B_r/r and B_z from the coefficients of P_n and P'_(n+1), by Clenshaw's recurrence."""
    inverse = 1 / math.sqrt(r * r + z * z)
    t, w2 = z * inverse * inverse, inverse * inverse
    p, p_before, q, q_before = 0.0, 0.0, 0.0, 0.0
    for n in range(ORDER + 2, -1, -1):
        p, p_before = along[n] - SECOND[n] * w2 * p_before + FIRST[n] * t * p, p
        q, q_before = across[n] - SECOND_TANGENT[n] * w2 * q_before + FIRST_TANGENT[n] * t * q, q
    cos, sin = z * inverse, r * inverse
    first, second = p * w2, q * w2 * inverse
    return (first + cos * second) * inverse, first * cos - sin * sin * second


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


def _series(moments: list[float]) -> Array:
    """Return the coefficients of P_n and P'_(n+1) in a field and in its slope, from the moments of a potential.

    The potential is sum moments[n] P_n(cos theta) / d^(n+1); the result has shape (4, len(_N)).
    """
    both = np.zeros((2, len(_N)))
    both[0, : ORDER + 1] = moments
    both[1, 1 : ORDER + 2] = -np.arange(1, ORDER + 2) * moments
    series = np.zeros((4, len(_N)))
    series[::2], series[1::2, :-1] = both * np.arange(1, len(_N) + 1), both[:, 1:]
    return read_only(series)


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
    brackets = [a2 * sum(x ** (k - j) for j in range(k + 1)) / (k + 1) for k in range(ORDER // 2 + 1)]
    moments = [0.0] * (ORDER + 1)
    for n in range(1, ORDER + 1, 2):
        total = 0.0
        for k in range(n // 2 + 1):
            total += (-1) ** k * math.comb(n, k) * math.comb(2 * n - 2 * k, n) * x ** (n / 2 - k) * brackets[k]
        moments[n] = total / 2 ** (n + 1)
    return _series(moments)


def computed(x: Array, radius: float, half: float, J: float) -> tuple[Array, int]:
    """Return B and the first point without a field, or -1; such a point gets NaN.

    Threads share many points. Parameters as in `fill`.
    """
    B, series = np.empty_like(x), (cylinder_series(half / radius), disc_series())
    if len(x) < MIN_COMPILED_POINTS and not compiled_functions.cache_info().currsize:
        # plain Python indexes lists faster than arrays
        moments, disc = series[0].tolist(), series[1].tolist()
        for j, (u, v, w) in enumerate(x.tolist()):
            place = lengths(u, v, w, radius, half)
            lean, along, _, _ = unit_field(place, half / radius, moments, disc, False)
            write(j, (u, v, w), radius, J, lean, along, B)
        return B, next(iter(np.flatnonzero(np.isnan(B[:, 2])).tolist()), -1)
    count = max(min(compilation.threads(), len(x) // THREAD_POINTS), 1)
    share = max(math.ceil(len(x) / count), 1)
    fill_compiled = compiled_functions().fill

    def fill_part(start: int) -> int:
        part = slice(start, start + share)
        bad = int(fill_compiled(x[part], radius, half, J, *series, B[part]))
        return start + bad if bad >= 0 else len(x)

    if count == 1:
        bad = fill_part(0)
    else:
        from concurrent.futures import ThreadPoolExecutor

        with ThreadPoolExecutor(count) as pool:
            bad = min(pool.map(fill_part, range(0, len(x), share)))
    return B, bad if bad < len(x) else -1


@cache
def compiled_functions() -> SimpleNamespace:
    """Return the functions without annotations, compiled by numba, which this imports.

    They are a second set of function objects with a scope of their own: the plain functions stay beside them. Other
    functions that numba compiles can call `lengths` and `unit_field`.
    """
    scope = dict(globals())
    for name, plain in globals().items():
        # numba looks up the names in a function when it is first called, so the order does not matter
        if isinstance(plain, FunctionType) and plain.__module__ == __name__ and not plain.__annotations__:
            # the faces become a part of the loop over near points in `fill`
            inline = "always" if name == "_face" else "never"
            scope[name] = compilation.compiled(FunctionType(plain.__code__, scope, name), nogil=True, inline=inline)
    return SimpleNamespace(**scope)
