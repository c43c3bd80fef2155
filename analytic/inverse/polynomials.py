"""Polynomials p = sum c[i, j] u^i w^j of two variables: values with slopes, and least-squares fits."""

from __future__ import annotations

import math

import numpy as np

from geometry.arrays import Array

Powers = list[tuple[int, int]]

EXACT = 1e-20
"""Sum of squares of a fit's errors over that of the values, below which all fits count as exact (rounding)."""


def polynomial(c: Array, u: Array, w: Array) -> tuple[Array, Array, Array]:
    """Return p = sum c[i, j] u^i w^j and its slopes along u and w, each of the shape of u, by Horner's rule."""
    p, p_u, p_w = (np.zeros_like(u) for _ in range(3))
    for row in c[::-1]:
        q, q_w = np.full_like(u, row[-1]), np.zeros_like(u)
        for value in row[-2::-1]:
            q_w = q_w * w + q
            q = q * w + value
        p_u = p_u * u + p
        p_w = p_w * u + q_w
        p = p * u + q
    return p, p_u, p_w


def least_squares(u: Array, w: Array, values: Array, orders: tuple[int, int]) -> Array:
    """Return the least-squares coefficients c[i, j]; with fewer samples than powers, the orders are reduced."""
    wide, high = orders
    while (wide + 1) * (high + 1) > len(values) and (wide or high):
        wide, high = (wide - 1, high) if wide else (wide, high - 1)
    return _coefficients(u, w, values, [(i, j) for i in range(wide + 1) for j in range(high + 1)])


def monotonic_fit(
    places: tuple[Array, Array], values: Array, orders: tuple[int, int], between: tuple[Array, Array], sign: int
) -> Array:
    """Return the closest fit without a constant that is positive and monotonic between the samples.

    The fits tried include all lower orders, and those whose mixed terms u^i w^j end at a lower j, because samples at
    a single w do not determine them at others. If no fit qualifies, as for samples that decrease, the result
    has the linear term alone.

    Parameters
    ----------
    places, values : u and w of the samples, and the values to fit, each of shape (n,).
    orders : highest powers of u and w.
    between : u and w at which the fit and its slope are checked, each of shape (m,).
    sign : required sign of the slope along w, 1 or -1.
    """
    best, least = _coefficients(*places, values, [(0, 1)]), math.inf
    # of fits that differ by rounding only, the first and largest set of powers wins: the choice is reproducible
    exact = float((EXACT * values**2).sum())
    for powers in _choices(*orders):
        if len(powers) <= len(values):
            c = _coefficients(*places, values, powers)
            misfit = max(float(((polynomial(c, *places)[0] - values) ** 2).sum()), exact)
            p, _, slope = polynomial(c, *between)
            if misfit < least and (p > 0).all() and (sign * slope > 0).all():
                best, least = c, misfit
    return best


def _choices(wide: int, high: int) -> list[Powers]:
    """Return sets of powers (i, j) of u and w up to the orders `wide` and `high`, the largest set first."""
    sets = {
        tuple((i, j) for i in range(a + 1) for j in range(b + 1) if (i, j) != (0, 0) and (i == 0 or j <= mixed))
        for a in range(wide + 1)
        for b in range(1, high + 1)
        for mixed in range(b + 1)
    }
    return sorted((list(powers) for powers in sets), key=lambda powers: (len(powers), powers), reverse=True)


def _coefficients(u: Array, w: Array, values: Array, powers: Powers) -> Array:
    """Return the least-squares coefficients c[i, j] of the given powers (i, j); all others are 0."""
    # columns scaled to 1 keep the condition number low
    scale_u, scale_w = (float(np.abs(v).max(initial=0.0)) or 1.0 for v in (u, w))
    columns = np.column_stack([(u / scale_u) ** i * (w / scale_w) ** j for i, j in powers])
    coefficients = np.linalg.lstsq(columns, values, rcond=1e-12)[0]
    c = np.zeros(np.max(powers, axis=0) + 1)
    for (i, j), value in zip(powers, coefficients, strict=True):
        c[i, j] = value / (scale_u**i * scale_w**j)
    return c
