"""Quantiles of errors from which the surrogate's intervals follow (conformal prediction).

An interval is the prediction plus or minus q g y, with the spread g of the Gaussian process, the yardstick y of the
quantity, and the quantile q of scores. A score is (|error| + own error of the finite elements) / (g y), so that the
interval is one for the converged answer and not for a mesh. With the ceil(0.9 (n + 1))-th smallest of n scores it
holds the truth of a beam that is drawn like those of the scores with a probability of at least 0.9 (Vovk et al. 2005;
Lei et al. 2018). That needs independent scores. The errors in the states of one beam are correlated, so a beam has a
single score: the largest one of its states. An interval then holds in all of them.

The quantiles are found in two steps. The errors of the training beams, each predicted from all others, tell by region
and node how large errors are there (the jackknife; Barber et al. 2021). Training beams are not drawn like a user's,
and know the errors at the nodes only. So random beams at random depths and shears, on which nothing else depends,
scale the intervals: the quantile of their scores over their half widths, by quantity and region, multiplies the first
ones. It is that of the region's beams alone.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array

COVERAGE = 0.9
FEWEST = 20
"""Least number of scores of a region with a quantile of its own; the others share that of all beams. Of 20 scores it
is the second largest."""


def conformal_quantile(scores: Array) -> Array:
    """Return the conformal quantile of scores (n, ...), shape (...); an unknown score (NaN) counts as infinite.

    >>> float(conformal_quantile(np.arange(1.0, 100.0)))
    90.0
    """
    n = len(scores)
    rank = min(math.ceil(COVERAGE * (n + 1)), n)
    return np.asarray(np.sort(np.nan_to_num(scores, nan=np.inf), axis=0)[rank - 1])


def quantiles_by_region(scores: Array, region: NDArray[np.int64], regions: int) -> Array:
    """Return the quantiles of scores (n, nodes) in each region, shape (regions, nodes)."""
    result = np.empty((regions, scores.shape[1]))
    for k in range(regions):
        own = scores[region == k]
        result[k] = conformal_quantile(own if len(own) >= FEWEST else scores)
    return result
