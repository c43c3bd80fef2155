"""Noise of a reading: limits, both series of the rounding bias, and samples through a converter."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic.reading_noise import of_average, rounding_bias


def test_white_noise_falls_with_the_root_of_the_count():
    assert_allclose([of_average(1e-3, count=n) for n in (1, 4, 100)], [1e-3, 5e-4, 1e-4])


def test_a_single_sample_has_noise_step_and_floor():
    for noise, step in ((0.0, 1e-3), (1e-5, 1e-3), (3e-4, 1e-3), (1e-2, 1e-3)):
        assert_allclose(of_average(noise, step, 2e-4), math.sqrt(noise**2 + step**2 / 12 + 4e-8))


def test_the_floor_and_the_steps_without_noise_do_not_average_away():
    assert_allclose(of_average(1e-3, floor=1e-5, count=10**9), 1e-5, rtol=1e-3)
    assert_allclose(of_average(0.0, 1e-3, count=10**9), 1e-3 / math.sqrt(12))


def test_both_series_agree_where_they_meet():
    below, above = rounding_bias(0.1 * (1 - 1e-12), 1.0), rounding_bias(0.1, 1.0)
    assert_allclose(below, above, rtol=1e-9)


@pytest.mark.parametrize("noise", [0.02, 0.15, 0.3, 0.6])
@pytest.mark.parametrize("count", [1, 8])
def test_is_the_error_of_rounded_samples(noise, count):
    """Outputs anywhere within a step, with their noise, rounded and averaged; 2e5 averages give 0.5 %."""
    rng = np.random.default_rng(7)
    true = rng.uniform(0, 1, 200_000)
    samples = np.round(true + noise * rng.standard_normal((count, len(true))))
    error = math.sqrt(((samples.mean(axis=0) - true) ** 2).mean())
    assert_allclose(of_average(noise, 1.0, count=count), error, rtol=5e-3)
