"""Sobol indices against closed forms: Ishigami's function and Sobol's G; failures and errors widen the intervals."""

import math

import numpy as np
import pytest

from geometry.design import BadInput
from studies.sensitivity.sobol_indices import indices, saltelli_points, sobol_of

ANGLES = dict.fromkeys(("x1", "x2", "x3"), (-math.pi, math.pi))
FIRST, TOTAL = [0.3139, 0.4424, 0.0], [0.5576, 0.4424, 0.2437]
"""Indices of Ishigami's function with a = 7 and b = 0.1, in closed form."""


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def contains(result, first, total):
    return [
        *(result.first_low[k] <= first[k] <= result.first_high[k] for k in range(len(first))),
        *(result.total_low[k] <= total[k] <= result.total_high[k] for k in range(len(total))),
    ]


def test_ishigami():
    result = sobol_of(ishigami, ANGLES, 4096, seed=1)
    assert result.first == pytest.approx(FIRST, abs=0.015)
    assert result.total == pytest.approx(TOTAL, abs=0.015)
    assert all(contains(result, FIRST, TOTAL))
    assert (result.points, result.failed) == (5 * 4096, 0)
    assert result.mean == pytest.approx(3.5, abs=0.05)
    assert result.deviation**2 == pytest.approx(
        49 / 8 + 0.1 * math.pi**4 / 5 + 0.01 * math.pi**8 / 18 + 0.5, rel=0.02
    )


def test_sobols_g():
    """Sobol's G, the product of (|4 x - 2| + a)/(1 + a): partial variances 1/(3 (1 + a)^2), and their products."""
    a = np.array([0.0, 1.0, 4.5, 9.0])
    partial = 1 / (3 * (1 + a) ** 2)
    variance = np.prod(1 + partial) - 1
    first = partial / variance
    total = partial * np.prod(1 + partial) / (1 + partial) / variance
    ranges = {f"x{k}": (0.0, 1.0) for k in range(4)}
    result = sobol_of(lambda x: np.prod((np.abs(4 * x - 2) + a) / (1 + a), axis=1), ranges, 4096, seed=2)
    assert result.first == pytest.approx(first, abs=0.015)
    assert result.total == pytest.approx(total, abs=0.015)


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
    assert result.failed == pytest.approx(share * result.points, abs=1)
    assert all(contains(result, FIRST, TOTAL))
    whole = sobol_of(ishigami, ANGLES, 1024, seed=4)
    assert (result.total_high - result.total_low).sum() > (whole.total_high - whole.total_low).sum()


def test_the_stated_error_of_the_model_widens_the_intervals():
    values = ishigami(saltelli_points(ANGLES, 256, 5))
    exact = indices(ANGLES, values, seed=5)
    rough = indices(ANGLES, values, np.full_like(values, 2.0), seed=5)
    assert np.array_equal(exact.first, rough.first)
    assert (rough.first_low <= exact.first_low).all()
    assert (rough.total_high >= exact.total_high).all()
    width = [(one.first_high - one.first_low).sum() for one in (exact, rough)]
    assert width[1] > 1.2 * width[0]


def test_an_error_beyond_the_variation_leaves_every_share_open():
    values = ishigami(saltelli_points(ANGLES, 256, seed=5))
    rough = indices(ANGLES, values, np.full_like(values, 2 * values.std()), seed=5)
    assert (rough.first_low <= 0).all()
    assert (rough.total_high >= 1).all()


def test_the_interval_contains_the_truth_of_a_function_that_the_model_approximates():
    """A model with a wrong curvature of x2, and an error that says so."""
    values = ishigami(saltelli_points(ANGLES, 2048, 6))
    points = saltelli_points(ANGLES, 2048, 6)
    error = 0.8 * np.cos(points[:, 1])
    assert all(contains(indices(ANGLES, values + error, np.full_like(values, 0.8), seed=6), FIRST, TOTAL))


def test_a_seed_of_0_gives_the_same_interval_again():
    one, again = (sobol_of(ishigami, ANGLES, 64, seed=0) for _ in range(2))
    assert np.array_equal(one.first_low, again.first_low)


def test_an_output_that_does_not_vary_or_always_fails_has_no_indices():
    constant, never = (sobol_of(lambda x, y=y: np.full(len(x), y), ANGLES, 8) for y in (2.0, np.nan))
    assert np.isnan([constant.first, constant.total, never.first, never.total]).all()
    assert (constant.failed, never.failed, constant.mean) == (0, 40, 2.0)


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
