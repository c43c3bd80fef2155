"""A press beyond its critical depth, to the side that a dead force picks."""

from dataclasses import replace

import pytest

from fem.equilibrium import choose_model, trace
from fem.levels import QUICK
from geometry.design import BadInput, Design
from geometry.scene import Load

SLENDER = Design(L=24.0)
CRITICAL_N, CRITICAL_MM = 1.311, 0.960
LEVEL = replace(QUICK, section_size=0.16)


@pytest.fixture(scope="module")
def leaning():
    loads = [Load(depth=d, imperfection=2e-3) for d in (0.3, 1.0, 1.6)]
    return trace(SLENDER, loads, LEVEL, magnet="ignored", estimate=False)


def test_the_branch_is_followed_and_stable(leaning):
    assert [state.status for state in leaning] == ["ok"] * 3
    assert [state.model for state in leaning] == ["harmonic"] * 3
    assert "imperfection of 0.002 N" in leaning[-1].message


def test_the_tip_leans_the_way_it_is_pushed_and_far_beyond_the_critical_depth(leaning):
    shifts = [state.response.shift[0] for state in leaning]
    assert 0 < shifts[0] < 0.06
    assert shifts[2] > 3.0
    assert leaning[2].response.tilt > 0.3


def test_beyond_the_critical_depth_the_force_hardly_grows(leaning):
    assert leaning[2].response.force[2] == pytest.approx(CRITICAL_N, rel=0.07)


def test_before_it_the_press_is_the_straight_one(leaning):
    straight = trace(SLENDER, [Load(depth=0.3)], LEVEL, magnet="ignored", estimate=False)[0]
    assert leaning[0].response.force[2] == pytest.approx(straight.response.force[2], rel=5e-3)


def test_the_other_side_is_the_mirror_image(leaning):
    loads = [Load(depth=d, imperfection=-2e-3) for d in (0.3, 1.0, 1.6)]
    other = trace(SLENDER, loads, LEVEL, magnet="ignored", estimate=False)[-1].response
    one = leaning[-1].response
    assert other.shift == pytest.approx((-one.shift[0], 0.0, one.shift[2]), rel=1e-6)
    assert other.force[2] == pytest.approx(one.force[2], rel=1e-6)


def test_models_that_can_carry_one():
    assert choose_model([Load(depth=1.0, imperfection=1e-3)], "auto") == "harmonic"
    with pytest.raises(BadInput, match="imperfection"):
        choose_model([Load(depth=1.0, imperfection=1e-3)], "axisymmetric")


@pytest.mark.parametrize(
    "given",
    [{"imperfection": float("nan")}, {"imperfection": 1.0, "friction": 0.3}, {"imperfection": 1.0, "grip": 1.0}],
)
def test_bad_imperfections(given):
    with pytest.raises(BadInput, match="imperfection"):
        Load(**given)
