"""Force resolution: closed forms, samples of the noise, invariants, and the decoder's own noise."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from analytic import beam, decode
from analytic.force_resolution import at_shifts, force_resolution
from analytic.inverse import forward_model, response_surface
from geometry.design import BadInput, Design, paper

NOISE = np.array([0.01, 0.02, 0.03])


def slopes(n, m, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, m, 3)), rng.normal(size=(n, 3, 3))


@pytest.mark.parametrize("m", [3, 5])
def test_is_the_spread_of_weighted_least_squares(m):
    """Samples of the noise, decoded one by one: 1e5 samples give the spread to 0.7 % (three standard errors)."""
    (J,), (K,) = slopes(1, m)
    noise = np.linspace(0.01, 0.05, m)
    errors = noise * np.random.default_rng(1).standard_normal((100_000, m))
    q = np.linalg.lstsq(J / noise[:, None], (errors / noise).T, rcond=None)[0]
    assert_allclose(force_resolution(J[None], K[None], noise)[0], (K @ q).std(axis=1), rtol=7e-3)


def test_coordinates_of_the_pose_do_not_matter():
    J, K = slopes(20, 4)
    change = np.random.default_rng(2).normal(size=(3, 3)) @ np.diag([1.0, 1e-3, 1e4])
    noise = np.full(4, 0.1)
    assert_allclose(force_resolution(J @ change, K @ change, noise), force_resolution(J, K, noise), rtol=1e-9)


def test_noise_scales_and_a_second_set_of_elements_averages():
    J, K = slopes(5, 3)
    one = force_resolution(J, K, NOISE)
    assert_allclose(force_resolution(J, K, 2 * NOISE), 2 * one)
    twice = force_resolution(np.concatenate([J, J], axis=1), K, np.tile(NOISE, 2))
    assert_allclose(twice, one / math.sqrt(2))


def test_noise_may_differ_from_pose_to_pose():
    J, K = slopes(2, 3)
    both = force_resolution(J, K, np.stack([NOISE, 3 * NOISE]))
    assert_allclose(both, np.stack([force_resolution(J, K, NOISE)[0], force_resolution(J, K, 3 * NOISE)[1]]))


def test_what_the_readings_do_not_determine_is_infinite_and_nothing_else():
    """No reading changes along y: a reading more for x and z, and F_y alone changes along y."""
    J = np.array([[1.0, 0, 0], [0, 0, 1.0], [1.0, 0, 1.0]])
    rest = force_resolution(J[None], np.diag([1.0, 1.0, 2.0])[None], NOISE)[0]
    assert np.isinf(rest[1])
    assert np.isfinite(rest[[0, 2]]).all()
    mixed = force_resolution(J[None], np.array([[[1.0, 0.5, 0], [0, 0, 0], [0, 0, 1.0]]]), NOISE)[0]
    assert np.isinf(mixed[0])
    assert mixed[1] == 0


def test_nearly_singular_slopes_give_what_orthogonal_coordinates_give():
    """Two nearly parallel columns, beyond the normal equations: the same slopes written in q1 + q2 and q2."""
    rng = np.random.default_rng(6)
    J, K = rng.normal(size=(200, 3, 3)), rng.normal(size=(200, 3, 3))
    mixed = np.array([[1.0, 1.0, 0], [0, 1e-5, 0], [0, 0, 1.0]])
    assert_allclose(force_resolution(J @ mixed, K @ mixed, NOISE), force_resolution(J, K, NOISE), rtol=1e-6)


def test_no_slope_at_all_and_no_pose():
    J, K = slopes(2, 3)
    J[0], J[1, 0, 0] = 0, np.nan
    answer = force_resolution(J, K, NOISE)
    assert_array_equal(np.isinf(answer), [[True] * 3, [False] * 3])
    assert_array_equal(np.isnan(answer), [[False] * 3, [True] * 3])


@pytest.mark.parametrize(
    ("J", "K", "noise", "words"),
    [
        (np.ones((1, 2, 3)), np.ones((1, 3, 3)), np.ones(2), "m of at least 3"),
        (np.ones((1, 3, 3)), np.ones((1, 3, 3)), np.array([1, 0, 1]), "must be above 0; got 0"),
    ],
)
def test_bad_input_is_a_sentence(J, K, noise, words):
    with pytest.raises(BadInput, match=words):
        force_resolution(J, K, noise)


def test_resolution_at_shifts_is_the_noise_that_the_decoder_states():
    design = Design(hall_noise=1e-3)
    law = response_surface.of_formula(lambda load: beam.solve(design, load, "finite"), 2.0, 2.0)
    coder = decode.decoder(design, law)
    shift = np.array([[0.5, -0.3, -0.6], [0.0, 0.0, -0.2]])
    fields = forward_model.readings_with_slopes(coder.forward, shift.T)[0].T
    sigma = at_shifts(coder.forward, law, shift)
    assert_allclose(sigma, decode.decode(coder, fields).noise_N, rtol=1e-4)
    quiet = forward_model.model(paper(), law.tilt)
    assert np.isnan(at_shifts(quiet, law, shift)).all()
    limited = forward_model.model(Design(hall_noise=1e-3, hall_high=2.6), law.tilt)
    assert np.isinf(at_shifts(limited, law, shift)).any()
