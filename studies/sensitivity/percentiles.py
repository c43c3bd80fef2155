"""Percentiles of a sample with their sampling error, and with failed members on whichever side is worse."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Array

LEVEL = 0.95
"""Confidence of the intervals."""


def percentile(values: Array, share: float) -> tuple[float, float, float]:
    """Return the quantile of the values, shape (n,), and its confidence interval; NaN marks a failed member.

    The interval lies between two order statistics, whose ranks are binomial; it needs no distribution. Its lower end
    counts failed members as lowest, its upper end as highest. An end beyond the sample is infinite; without any value
    the quantile is NaN.

    >>> percentile(np.arange(101.0), 0.5)
    (50.0, 40.0, 60.0)
    """
    from scipy.stats import binom

    known = np.sort(values[np.isfinite(values)])
    count, failed = len(values), len(values) - len(known)
    if not len(known):
        return np.nan, -np.inf, np.inf
    tail = (1 - LEVEL) / 2
    low_rank, high_rank = (int(binom.ppf(one, count, share)) for one in (tail, 1 - tail))
    # with the failed ones lowest, the known values have the ranks from `failed` on
    low = known[low_rank - 1 - failed] if low_rank > failed else -np.inf
    high = known[high_rank] if high_rank < len(known) else np.inf
    return float(np.quantile(known, share)), float(low), float(high)
