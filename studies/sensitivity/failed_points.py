"""Failed points of a designed experiment: filled for the estimate, and bounded, because none can be left out.

The estimators of Sobol and of Morris compare the values of two points that differ in one input. With a NaN among the
values the whole estimate is lost. So a failed value is replaced by that of another model, or by the median of the
others, for the estimate; and by their least and by their largest, for its interval. All three fillings let the output
jump at a failed point, which looks like an interaction. Bounds that hold for every filling between the least and the
largest value come from each pair by itself: `squared_differences` and `variances`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from geometry.arrays import Array


def fillings(values: Array, substitute: Array | None = None) -> list[Array]:
    """Return the values, shape (n,), without NaN: filled for the estimate, by the least, and by the largest of them.

    One filling, the values themselves, if none has failed; none if all have.

    Parameters
    ----------
    substitute : values of another model, shape (n,), which replace failed ones in the estimate; the median of the
        values where this is NaN, and by default.

    >>> fillings(np.array([1.0, np.nan, 3.0]))
    [array([1., 2., 3.]), array([1., 1., 3.]), array([1., 3., 3.])]
    """
    failed = ~np.isfinite(values)
    if not failed.any():
        return [values]
    if failed.all():
        return []
    known = values[~failed]
    estimate = np.full_like(values, np.median(known))
    if substitute is not None:
        estimate = np.where(np.isfinite(substitute), substitute, estimate)
    return [np.where(failed, one, values) for one in (estimate, known.min(), known.max())]


def squared_differences(one: Array, other: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return the least and the largest square of one - other, with every NaN any number from low to high.

    >>> squared_differences(np.array([1.0, 1.0]), np.array([3.0, np.nan]), 0.0, 5.0)
    (array([4., 0.]), array([ 4., 16.]))
    """
    from_one, to_one = np.where(np.isfinite(one), one, low), np.where(np.isfinite(one), one, high)
    from_other, to_other = np.where(np.isfinite(other), other, low), np.where(np.isfinite(other), other, high)
    apart = np.maximum(np.maximum(from_one - to_other, from_other - to_one), 0.0)
    farthest = np.maximum(to_one - from_other, to_other - from_one)
    return apart**2, farthest**2


def variances(values: Array, low: float, high: float) -> tuple[float, float]:
    """Return bounds of the variance of values, with every NaN any number from low to high.

    >>> variances(np.array([0.0, 2.0, np.nan, np.nan]), 0.0, 2.0)
    (0.5, 1.0)
    """
    failed = ~np.isfinite(values)
    known = values[~failed]
    count, missing = len(values), int(failed.sum())
    # least: all at the mean of the known; the largest is a convex function's, which lies at the ends of the range
    least = float(known.var()) * len(known) / count
    at_high = np.arange(missing + 1)
    total = known.sum() + (missing - at_high) * low + at_high * high
    squares = (known**2).sum() + (missing - at_high) * low**2 + at_high * high**2
    return least, float((squares / count - (total / count) ** 2).max())


def evaluated(function: Callable[[Array], Array], points: Array) -> Array:
    """Return the values of a function at points (n, d), shape (n,); NaN where they are not finite."""
    values = np.asarray(function(points), dtype=np.float64)
    return np.where(np.isfinite(values), values, np.nan)
