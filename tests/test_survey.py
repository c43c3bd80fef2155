"""A survey of the workspace: slopes against differences, multiplicity against an exhaustive search, shares."""

import numpy as np
import pytest
from decode_oracle import exhaustive
from numpy.testing import assert_allclose

from analytic import clearance, decode, parts, survey
from analytic.inverse import forward_model
from geometry.design import BadInput, Design, paper
from studies.sensing import decode_readings

FOLDED = Design(magnet_height=4.0, l0=6.0, c=2.5, hall_low=0, hall_null=50, hall_high=100)


def prepared(design, level="paper", **options):
    elements, _ = parts.with_noise(parts.of_design(design))
    return decode.decoder(design, decode_readings.of_level(design, level), elements=elements, **options)


@pytest.mark.parametrize("level", ["paper", "finite"])
@pytest.mark.parametrize("layout", ["three", "tmag5273a1"])
def test_condition_sign_and_noise_are_those_of_differences(level, layout):
    coder = prepared(Design(hall_layout=layout), level)
    seen = survey.survey(coder, (3, 3, 4), multiplicity=False)
    step = 1e-5
    numeric = np.array(
        [
            (
                forward_model.readings_at(coder.forward, seen.shift + e)
                - forward_model.readings_at(coder.forward, seen.shift - e)
            )
            / (2 * step)
            for e in step * np.eye(3)[:, :, None]
        ]
    )
    jacobians = np.moveaxis(numeric, 2, 0).swapaxes(1, 2)
    assert (np.sign(np.linalg.det(jacobians)) == seen.sign).all()
    assert_allclose(seen.condition, np.linalg.cond(jacobians), rtol=1e-5)
    covariance = np.linalg.inv(jacobians) @ np.diag(coder.sigma**2) @ np.linalg.inv(jacobians).swapaxes(1, 2)
    assert_allclose(seen.noise_mm, np.sqrt(np.linalg.eigvalsh(covariance)[:, -1]), rtol=1e-5)


def test_multiplicity_is_that_of_an_exhaustive_search():
    coder = prepared(FOLDED)
    seen = survey.survey(coder, (5, 5, 4))
    assert {-1, 1} <= set(seen.sign)
    several = np.flatnonzero(seen.multiplicity > 1)
    single = np.flatnonzero(seen.multiplicity == 1)
    assert min(len(several), len(single)) > 10
    for k in (*several[::2], *single[::8]):
        every = exhaustive(coder, seen.readings[:, k])
        assert len(every) == seen.multiplicity[k]
        assert np.linalg.norm(every - seen.shift[:, k], axis=1).max() == pytest.approx(seen.alike_mm[k], abs=1e-5)


def test_noise_goes_with_the_readings_noise_and_the_stiffness():
    once, twice = (
        survey.survey(prepared(Design(hall_noise=v, E=e)), (3, 3, 3), multiplicity=False)
        for v, e in ((1e-3, 1), (2e-3, 3))
    )
    assert_allclose(twice.noise_mm, 2 * once.noise_mm, rtol=1e-9)
    assert_allclose(twice.noise_N, 6 * once.noise_N, rtol=1e-9)


def test_shares_are_of_the_workspace():
    """By the trapezoidal rule: of three layers the outer ones weigh a quarter each."""
    seen = survey.survey(prepared(paper()), (3, 3, 3), multiplicity=False)
    assert seen.weight.sum() == pytest.approx(1)
    assert seen.share(seen.shift[0] > 0) == pytest.approx(0.25)
    assert seen.share(seen.shift[0] >= 0) == pytest.approx(0.75)
    assert not seen.folded


def test_what_is_in_the_way():
    coder = prepared(Design(l0=5.2, c=2.0, f=4.5))
    seen = survey.survey(coder, (9, 9, 4), multiplicity=False)
    for k in (0, 100, 200, 300):
        shift, tilt = seen.shift[:, k][None], seen.tilt[:, k][None]
        for i, element in enumerate(coder.forward.elements):
            gap = clearance.magnet_gaps(coder.forward.design, element.position, shift, tilt)[0]
            assert seen.magnet_hits[i, k] == (gap == 0)
            wall = clearance.wall_gaps(coder.forward.design, element.position, shift)[0] < 0
            assert seen.wall_hits[i, k] == (wall and element.position[2] >= 0)
    assert seen.wall_hits.any()
    assert not seen.grounded.any()
    assert not seen.usable[seen.blocked].any()


def test_only_what_the_mechanics_know_counts():
    coder = prepared(paper(), "finite")
    seen = survey.survey(coder, (9, 9, 6), multiplicity=False)
    x, y, z = seen.shift[:, seen.weight > 0]
    assert np.hypot(x, y).max() <= coder.mechanics.reach * (1 + 1e-9)
    assert z.max() < 0
    flat = prepared(paper(), "finite", ignore_tilt=True)
    assert survey.known(flat, seen.shift).all()
    with pytest.raises(BadInput, match="the tilt is not known at any pose"):
        survey.at_poses(coder, np.array([[0.0], [0.0], [0.1]]), np.ones(1), (1, 1, 1))
