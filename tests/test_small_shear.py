"""Small shear of a glued plate about a press."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK, STANDARD
from fem.analyses import small_shear
from fem.equilibrium import trace
from fem.solution import Estimates
from geometry.design import BadInput, paper
from geometry.loads import Load


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_small_shear_is_the_start_of_a_finite_one(magnet):
    level = replace(QUICK, section_size=0.1, section_patch=0.01)
    small = small_shear.small_shear(paper(), 1.0, magnet, accuracy=level)
    way = 0.01
    state = trace(paper(), [Load(depth=1.0, shear_x=way, friction="stick")], level, magnet=magnet, estimate=False)[0]
    force, shift, tilt = state.response.force[0], state.response.shift[0], state.response.tilt
    np.testing.assert_allclose((shift / way, tilt / way), (small.shift, small.tilt), rtol=0.01)
    assert force / way == pytest.approx(small.stiffness, rel=0.01)


def test_small_shear_scales_with_size_and_modulus():
    one = small_shear.small_shear(paper(), 1.0, accuracy=QUICK)
    other = small_shear.small_shear(replace(paper(), E=2 * paper().E), 1.0, accuracy=QUICK)
    assert other.stiffness == pytest.approx(2 * one.stiffness, rel=1e-9)
    assert other.tilt == pytest.approx(one.tilt, rel=1e-9)


@pytest.mark.parametrize("depth", [0.0, -1.0, 50.0])
def test_depths_that_mean_nothing(depth):
    with pytest.raises(BadInput, match="depth"):
        small_shear.small_shear(paper(), depth)


def test_estimates_of_a_small_shear_hold_against_a_finer_mesh():
    finer = replace(STANDARD, section_size=0.035, section_patch=0.001)
    small, true = (small_shear.small_shear(paper(), 1.0, accuracy=level) for level in (QUICK, finer))
    for name in ("stiffness", "shift", "tilt"):
        error = abs(getattr(small, name) / getattr(true, name) - 1)
        assert error <= getattr(small.estimates, name) < 0.03


def test_estimates_can_be_left_out():
    small = small_shear.small_shear(paper(), 1.0, accuracy=QUICK, estimate=False)
    assert small.estimates == Estimates()
