"""Gaussian processes: interpolation, spread, errors of left-out points, likelihood."""

import numpy as np
import pytest
from scipy import optimize

from studies.mechanics.gaussian_process import GaussianProcess, correlation, with_constant
from studies.validation import surrogate_fit

RNG = np.random.default_rng(0)
X = RNG.random((40, 2))
Y = np.column_stack([np.sin(3 * X[:, 0]) + X[:, 1] ** 2, X[:, 0] * X[:, 1]])
PROCESS = GaussianProcess(X, Y, np.array([0.6, 0.8]), 1e-8)


def test_the_prediction_passes_through_the_training_points():
    mean, spread = PROCESS.predict(X)
    assert mean == pytest.approx(Y, abs=1e-6)
    assert spread.max() < 1e-3


def test_a_linear_function_is_exact_everywhere():
    linear = GaussianProcess(X, X @ np.array([[2.0], [-1.0]]) + 3.0, np.array([0.6, 0.8]), 1e-8)
    far = np.array([[5.0, -4.0]])
    assert linear.predict(far)[0] == pytest.approx(np.array([[17.0]]), rel=1e-6)


def test_the_spread_grows_away_from_the_training_points():
    assert PROCESS.predict(np.array([[3.0, 3.0]]))[1] > 10 * PROCESS.predict(np.array([[0.5, 0.5]]))[1]


def test_prediction_and_spread_are_those_of_the_block_matrix_of_kriging():
    """[K H; H' 0] [w; m] = [k; h]: the prediction is w Y, its variance c(0) - w k - m h."""
    x = RNG.random((5, 2))
    K = correlation(X / PROCESS.lengths, X / PROCESS.lengths) + 1e-8 * np.eye(len(X))
    H = with_constant(X)
    block = np.block([[K, H], [H.T, np.zeros((3, 3))]])
    k = correlation(x / PROCESS.lengths, X / PROCESS.lengths)
    right = np.hstack([k, with_constant(x)]).T
    w = np.linalg.solve(block, right)
    mean, spread = PROCESS.predict(x)
    assert mean == pytest.approx(w[:40].T @ Y, rel=1e-6)
    assert spread**2 == pytest.approx(1 + 1e-8 - (w * right).sum(axis=0), rel=1e-3, abs=1e-7)


def test_left_out_predictions_are_those_of_training_without_the_point():
    mean, spread = PROCESS.left_out()
    for k in (0, 7, 39):
        others = np.arange(40) != k
        without = GaussianProcess(X[others], Y[others], PROCESS.lengths, PROCESS.nugget)
        own, width = without.predict(X[[k]])
        assert mean[k] == pytest.approx(own[0], rel=1e-5)
        assert spread[k] == pytest.approx(width[0], rel=1e-4)


def test_the_slopes_of_the_likelihood_are_those_of_differences():
    logs = np.log([0.5, 0.9, 1e-4])
    slope = surrogate_fit._misfit(logs, X, Y)[1]
    assert slope == pytest.approx(optimize.approx_fprime(logs, lambda z: surrogate_fit._misfit(z, X, Y)[0]), rel=1e-3)


def test_an_input_without_effect_gets_a_long_length_scale():
    y = np.sin(4 * X[:, :1])
    process = surrogate_fit.fitted(X, y)
    assert process.lengths[1] > 5 * process.lengths[0]
    x = RNG.random((200, 2))
    assert np.abs(process.predict(x)[0] - np.sin(4 * x[:, :1])).max() < 0.02


def test_correlations_are_one_at_the_point_itself_and_fall_with_the_distance():
    c = correlation(np.zeros((1, 1)), np.array([[0.0], [1.0], [2.0]]))[0]
    a = np.sqrt(5.0)
    assert c[0] == 1
    assert c[1] == pytest.approx((1 + a + a**2 / 3) * np.exp(-a))
    assert c[2] < c[1]
