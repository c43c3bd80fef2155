"""Sobol indices against closed forms, Morris' effects against known ones; errors and failures widen the intervals."""

import itertools
import math

import numpy as np
import pytest

from geometry.design import BadInput
from studies.sensitivity.global_sensitivity import (
    effects,
    fillings,
    indices,
    saltelli_points,
    sobol_of,
    squared_differences,
    trajectories,
    variances,
)

ANGLES = dict.fromkeys(("x1", "x2", "x3"), (-math.pi, math.pi))
FIRST, TOTAL = [0.3139, 0.4424, 0.0], [0.5576, 0.4424, 0.2437]
"""Indices of Ishigami's function with a = 7 and b = 0.1, in closed form."""


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def contains(result, first, total):
    truth = {"first_order": np.array(first), "total_order": np.array(total)}
    return [
        inside
        for order, values in truth.items()
        for inside in (result[f"{order}_low"] <= values) & (values <= result[f"{order}_high"])
    ]


def test_ishigami():
    result = sobol_of(ishigami, ANGLES, 4096, seed=1)
    assert result["first_order"].to_numpy() == pytest.approx(FIRST, abs=0.015)
    assert result["total_order"].to_numpy() == pytest.approx(TOTAL, abs=0.015)
    assert all(contains(result, FIRST, TOTAL))
    values = ishigami(saltelli_points(ANGLES, 4096, 1))
    assert values.mean() == pytest.approx(3.5, abs=0.05)
    assert values.var() == pytest.approx(49 / 8 + 0.1 * math.pi**4 / 5 + 0.01 * math.pi**8 / 18 + 0.5, rel=0.02)


def test_sobols_g():
    """Sobol's G, the product of (|4 x - 2| + a)/(1 + a): partial variances 1/(3 (1 + a)^2), and their products."""
    a = np.array([0.0, 1.0, 4.5, 9.0])
    partial = 1 / (3 * (1 + a) ** 2)
    variance = np.prod(1 + partial) - 1
    first = partial / variance
    total = partial * np.prod(1 + partial) / (1 + partial) / variance
    ranges = {f"x{k}": (0.0, 1.0) for k in range(4)}
    result = sobol_of(lambda x: np.prod((np.abs(4 * x - 2) + a) / (1 + a), axis=1), ranges, 4096, seed=2)
    assert result["first_order"].to_numpy() == pytest.approx(first, abs=0.015)
    assert result["total_order"].to_numpy() == pytest.approx(total, abs=0.015)


def test_the_intervals_cover_the_truth_at_their_level():
    """Of 30 samples, 95 % of the intervals of six indices: not fewer than 0.88, where all six are equally covered."""
    covered = [contains(sobol_of(ishigami, ANGLES, 256, seed=seed), FIRST, TOTAL) for seed in range(30)]
    assert 0.88 < np.mean(covered) < 0.99


@pytest.mark.parametrize("share", [0.01, 0.1])
@pytest.mark.parametrize("where", ["at random", "in a corner", "where large"])
def test_with_failed_points_the_intervals_contain_the_truth(share, where):
    def failing(x):
        y = ishigami(x)
        rank = {
            "at random": np.random.default_rng(3).random(len(x)),
            "in a corner": x[:, 0] + x[:, 1],
            "where large": y,
        }
        return np.where(rank[where] > np.quantile(rank[where], 1 - share), np.nan, y)

    result = sobol_of(failing, ANGLES, 1024, seed=4)
    assert all(contains(result, FIRST, TOTAL))
    whole = sobol_of(ishigami, ANGLES, 1024, seed=4)
    assert (result["total_order_high"] - result["total_order_low"]).sum() > (
        whole["total_order_high"] - whole["total_order_low"]
    ).sum()


def test_the_stated_error_of_the_model_widens_the_intervals():
    values = ishigami(saltelli_points(ANGLES, 256, 5))
    exact = indices(ANGLES, values, seed=5)
    rough = indices(ANGLES, values, np.full_like(values, 2.0), seed=5)
    assert np.array_equal(exact["first_order"], rough["first_order"])
    assert (rough["first_order_low"] <= exact["first_order_low"]).all()
    assert (rough["total_order_high"] >= exact["total_order_high"]).all()
    width = [(one["first_order_high"] - one["first_order_low"]).sum() for one in (exact, rough)]
    assert width[1] > 1.2 * width[0]


def test_an_error_beyond_the_variation_leaves_every_share_open():
    values = ishigami(saltelli_points(ANGLES, 256, seed=5))
    rough = indices(ANGLES, values, np.full_like(values, 2 * values.std()), seed=5)
    assert (rough["first_order_low"] <= 0).all()
    assert (rough["total_order_high"] >= 1).all()


def test_the_interval_contains_the_truth_of_a_function_that_the_model_approximates():
    """A model with a wrong curvature of x2, and an error that says so."""
    values = ishigami(saltelli_points(ANGLES, 2048, 6))
    points = saltelli_points(ANGLES, 2048, 6)
    error = 0.8 * np.cos(points[:, 1])
    assert all(contains(indices(ANGLES, values + error, np.full_like(values, 0.8), seed=6), FIRST, TOTAL))


def test_an_output_that_does_not_vary_or_always_fails_has_no_indices():
    constant, never = (sobol_of(lambda x, y=y: np.full(len(x), y), ANGLES, 8) for y in (2.0, np.nan))
    assert constant.isna().all(axis=None)
    assert never.isna().all(axis=None)


@pytest.mark.parametrize(
    ("ranges", "count", "message"),
    [
        (ANGLES, 1000, "need a power of 2, 8 or more, as count; got 1000: take 512"),
        (ANGLES, 4, "got 4: take 8"),
        (ANGLES, 2**19, "at most 2000000 points"),
    ],
)
def test_impossible_counts_are_refused(ranges, count, message):
    with pytest.raises(BadInput, match=message):
        saltelli_points(ranges, count, 0)


RANGES = {"a": (0.0, 2.0), "b": (-1.0, 1.0), "c": (10.0, 20.0)}


def morris_of(function, ranges, count=10, seed=0):
    points = trajectories(ranges, count, seed)
    return effects(ranges, points, function(points), seed=seed)


def linear(x):
    return 3 * x[:, 0] - 4 * x[:, 1] + 0.1 * x[:, 2]


def test_a_linear_function_has_its_slopes_over_the_ranges_as_effects():
    result = morris_of(linear, RANGES, 5)
    assert result["mu_star"].to_numpy() == pytest.approx([6.0, 8.0, 1.0], rel=1e-9)
    assert result["mu"].to_numpy() == pytest.approx([6.0, -8.0, 1.0], rel=1e-9)
    assert result["sigma"].to_numpy() == pytest.approx([0.0] * 3, abs=1e-9)


def test_an_interaction_has_a_standard_deviation():
    """x y over the unit square: an effect of x is y, one of 0, 1/3, 2/3, 1, with standard deviation sqrt(5)/6."""
    result = morris_of(lambda x: x[:, 0] * x[:, 1], {"x": (0, 1), "y": (0, 1)}, 1000, seed=1)
    assert result["mu_star"].to_numpy() == pytest.approx([0.5, 0.5], abs=0.03)
    assert result["sigma"].to_numpy() == pytest.approx([5**0.5 / 6] * 2, abs=0.02)
    assert (result["mu_star_low"] <= 0.5).all()
    assert (result["mu_star_high"] >= 0.5).all()


def test_each_point_differs_from_the_one_before_in_one_input():
    points = trajectories(RANGES, 20, 2).reshape(20, 4, 3)
    assert ((np.diff(points, axis=1) != 0).sum(axis=2) == 1).all()
    assert np.array_equal(points.reshape(-1, 3), trajectories(RANGES, 20, 2))


def test_with_failed_points_the_intervals_of_effects_contain_the_truth():
    points = trajectories(RANGES, 30, 3)
    values = linear(points)
    failed = np.random.default_rng(4).random(len(values)) < 0.1
    result = effects(RANGES, points, np.where(failed, np.nan, values))
    assert failed.sum() > 5
    assert (result["mu_star_low"] <= [6.0, 8.0, 1.0]).all()
    assert (result["mu_star_high"] >= [6.0, 8.0, 1.0]).all()
    assert (result["mu_star_high"] - result["mu_star_low"] > 0.1).all()


def test_another_model_replaces_failed_values_in_the_estimate():
    points = trajectories(RANGES, 10, 5)
    values = linear(points)
    lost = np.where(np.arange(len(values)) % 7 == 0, np.nan, values)
    assert effects(RANGES, points, lost, values)["mu_star"].to_numpy() == pytest.approx([6.0, 8.0, 1.0], rel=1e-9)
    assert effects(RANGES, points, lost, values)["mu_star_high"]["a"] > 6.1


@pytest.mark.parametrize("count", [1, 1001])
def test_impossible_numbers_of_trajectories_are_refused(count):
    with pytest.raises(BadInput, match=f"from 2 to 1000 trajectories; got {count}"):
        trajectories(RANGES, count, 0)


def test_another_model_replaces_a_failed_value_where_it_has_one():
    values, substitute = np.array([1.0, np.nan, np.nan, 5.0]), np.array([9.0, 2.0, np.nan, 9.0])
    estimate, least, largest = fillings(values, substitute)
    assert estimate.tolist() == [1.0, 2.0, 3.0, 5.0]
    assert least.tolist() == [1.0, 1.0, 1.0, 5.0]
    assert largest.tolist() == [1.0, 5.0, 5.0, 5.0]


def test_bounds_hold_for_every_filling_and_are_reached():
    one, other = np.array([0.3, np.nan, 0.9, np.nan]), np.array([0.7, 0.4, np.nan, np.nan])
    grid = np.linspace(0, 1, 11)
    differences, spread = [], []
    for a, b, c, d in itertools.product(grid, repeat=4):
        x, y = np.array([0.3, a, 0.9, b]), np.array([0.7, 0.4, c, d])
        differences.append((x - y) ** 2)
        spread.append(np.r_[x, y].var())
    least, most = squared_differences(one, other, 0.0, 1.0)
    assert least == pytest.approx(np.min(differences, axis=0), abs=1e-12)
    assert most == pytest.approx(np.max(differences, axis=0), abs=1e-12)
    low, high = variances(np.r_[one, other], 0.0, 1.0)
    assert low <= min(spread) < low + 1e-3
    assert high == pytest.approx(max(spread))
