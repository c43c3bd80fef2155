"""Conformal quantiles: coverage, regions."""

import numpy as np
import pytest

from studies.validation.surrogate_fit import FEWEST, conformal_quantile, quantiles_by_region


def test_intervals_hold_nine_of_ten_new_points():
    """Over many draws the mean coverage is ceil(0.9 (n + 1)) / (n + 1) for any distribution."""
    rng = np.random.default_rng(3)
    scores = rng.exponential(size=(4000, 50))
    covered = [conformal_quantile(row[:-1]) >= row[-1] for row in scores]
    assert np.mean(covered) == pytest.approx(45 / 50, abs=0.015)


def test_too_few_scores_give_the_largest():
    assert conformal_quantile(np.array([1.0, 5.0, 2.0])) == 5


def test_regions_have_their_own_quantiles_unless_they_have_few_points():
    scores = np.concatenate([np.full(FEWEST, 1.0), np.full(FEWEST, 3.0), np.full(2, 9.0)])[:, None]
    region = np.repeat([0, 1, 2], [FEWEST, FEWEST, 2])
    assert quantiles_by_region(scores, region, 3)[:, 0].tolist() == [1, 3, 3]
