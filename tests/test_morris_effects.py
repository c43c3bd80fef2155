"""Morris' effects against functions whose effects are known; failures widen the intervals."""

import numpy as np
import pytest

from geometry.design import BadInput
from studies.sensitivity.morris_effects import effects, morris_of, trajectories

RANGES = {"a": (0.0, 2.0), "b": (-1.0, 1.0), "c": (10.0, 20.0)}


def linear(x):
    return 3 * x[:, 0] - 4 * x[:, 1] + 0.1 * x[:, 2]


def test_a_linear_function_has_its_slopes_over_the_ranges_as_effects():
    result = morris_of(linear, RANGES, 5)
    assert result.mu_star == pytest.approx([6.0, 8.0, 1.0], rel=1e-9)
    assert result.mu == pytest.approx([6.0, -8.0, 1.0], rel=1e-9)
    assert result.sigma == pytest.approx([0.0] * 3, abs=1e-9)
    assert (result.points, result.failed) == (20, 0)


def test_an_interaction_has_a_standard_deviation():
    """x y over the unit square: an effect of x is y, one of 0, 1/3, 2/3, 1, with standard deviation sqrt(5)/6."""
    result = morris_of(lambda x: x[:, 0] * x[:, 1], {"x": (0, 1), "y": (0, 1)}, 1000, seed=1)
    assert result.mu_star == pytest.approx([0.5, 0.5], abs=0.03)
    assert result.sigma == pytest.approx([5**0.5 / 6] * 2, abs=0.02)
    assert (result.mu_star_low <= 0.5).all()
    assert (result.mu_star_high >= 0.5).all()


def test_each_point_differs_from_the_one_before_in_one_input():
    points = trajectories(RANGES, 20, 2).reshape(20, 4, 3)
    assert ((np.diff(points, axis=1) != 0).sum(axis=2) == 1).all()
    assert np.array_equal(points.reshape(-1, 3), trajectories(RANGES, 20, 2))


def test_with_failed_points_the_intervals_contain_the_truth():
    points = trajectories(RANGES, 30, 3)
    values = linear(points)
    failed = np.random.default_rng(4).random(len(values)) < 0.1
    result = effects(RANGES, points, np.where(failed, np.nan, values))
    assert result.failed == failed.sum() > 5
    assert (result.mu_star_low <= [6.0, 8.0, 1.0]).all()
    assert (result.mu_star_high >= [6.0, 8.0, 1.0]).all()
    assert (result.mu_star_high - result.mu_star_low > 0.1).all()


def test_another_model_replaces_failed_values_in_the_estimate():
    points = trajectories(RANGES, 10, 5)
    values = linear(points)
    lost = np.where(np.arange(len(values)) % 7 == 0, np.nan, values)
    assert effects(RANGES, points, lost, values).mu_star == pytest.approx([6.0, 8.0, 1.0], rel=1e-9)
    assert effects(RANGES, points, lost, values).mu_star_high[0] > 6.1


def test_a_function_that_always_fails_has_no_effects():
    assert np.isnan(morris_of(lambda x: np.full(len(x), np.nan), RANGES).mu_star).all()


@pytest.mark.parametrize("count", [1, 1001])
def test_impossible_counts_are_refused(count):
    with pytest.raises(BadInput, match=f"from 2 to 1000 trajectories; got {count}"):
        trajectories(RANGES, count, 0)
