"""Percentiles: their intervals cover the truth at their level, and failed members widen them to the worse side."""

import numpy as np
import pytest

from studies.sensitivity.percentiles import percentile


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_intervals_cover_the_truth_at_their_level(share):
    samples = np.random.default_rng(1).random((1000, 200))
    covered = np.mean([low <= share <= high for _, low, high in (percentile(one, share) for one in samples)])
    assert 0.935 < covered < 0.98


def test_failed_members_count_as_lowest_and_as_highest():
    values = np.random.default_rng(2).random(1000)
    whole = percentile(values, 0.95)
    lost = values.copy()
    lost[:20] = np.nan
    _, low, high = percentile(lost, 0.95)
    assert low < whole[1]
    assert high > whole[2]
    lost[:60] = np.nan
    assert percentile(lost, 0.95)[2] == np.inf


def test_without_values_nothing_is_known():
    estimate, low, high = percentile(np.full(5, np.nan), 0.5)
    assert np.isnan(estimate)
    assert (low, high) == (-np.inf, np.inf)
