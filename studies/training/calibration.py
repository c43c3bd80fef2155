"""Quantiles of errors from which the surrogate's intervals follow (conformal prediction).

An interval is the prediction plus or minus q g y, with the spread g of the Gaussian process, the yardstick y of the
quantity, and the quantile q of the scores |error| / (g y) of beams that were left out. With the ceil(0.9 (n + 1))-th
smallest of n scores the interval holds the truth of an exchangeable new beam with a probability of at least 0.9 (Vovk
et al. 2005; Lei et al. 2018). Here the scores are those of the training points, each predicted from all others, and
not of a separate set (the jackknife; Barber et al. 2021): the guarantee is weaker, and a test on beams that training
has not seen takes its place. Quantiles by region and node make the intervals right within these too, not on average.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array

COVERAGE = 0.9
WINDOW = 0.2
"""Distance of a state from a node, in shares of the range of the roots of the depths, up to which it counts there."""
FEWEST = 30
"""Least number of scores of a region with a quantile of its own; the others share that of all beams."""


def conformal_quantile(scores: Array) -> Array:
    """Return the conformal quantile of scores (n, ...), shape (...).

    >>> float(conformal_quantile(np.arange(1.0, 100.0)))
    90.0
    """
    n = len(scores)
    rank = min(math.ceil(COVERAGE * (n + 1)), n)
    return np.asarray(np.sort(scores, axis=0)[rank - 1])


def quantiles_around(nodes: Array, shares: Array, scores: Array, region: NDArray[np.int64], regions: int) -> Array:
    """Return the quantiles of scores in each region around each node, shape (regions, nodes).

    Parameters
    ----------
    nodes, shares : where nodes (m,) and states (n, k) lie in the range of the depths, 0 to 1 in their roots.
    scores : of these states, shape (n, k).
    region : of each beam, shape (n,).
    """
    regions_of = np.broadcast_to(region[:, None], shares.shape)
    result = np.empty((regions, len(nodes)))
    for j, node in enumerate(nodes):
        near = np.abs(shares - node) <= WINDOW
        result[:, j] = quantiles_by_region(scores[near][:, None], regions_of[near], regions)[:, 0]
    return result


def quantiles_by_region(scores: Array, region: NDArray[np.int64], regions: int) -> Array:
    """Return the quantiles of scores (n, nodes) in each region, shape (regions, nodes)."""
    result = np.empty((regions, scores.shape[1]))
    for k in range(regions):
        own = scores[region == k]
        result[k] = conformal_quantile(own if len(own) >= FEWEST else scores)
    return result
