"""A press beyond its critical depth, to the side that a dead force picks."""

from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, check_load

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


def test_a_long_increment_past_buckling_does_not_land_on_the_mirrored_branch():
    loads = [Load(depth=d, imperfection=2e-3) for d in (0.4, 0.8, 1.2)]
    states = trace(replace(paper(), L=24), loads, QUICK, magnet="ignored", estimate=False)
    assert all(state.response.shift[0] > 0 for state in states)
    assert states[-1].status == "ok"


def test_a_deep_press_at_once_leans_the_same_way():
    state = trace(SLENDER, [Load(depth=2.0, imperfection=1e-3)], replace(QUICK, harmonics=2), estimate=False)[-1]
    assert state.status == "ok"
    assert 6.0 < state.response.shift[0] < 6.2


@pytest.mark.parametrize(
    "given",
    [{"imperfection": float("nan")}, {"imperfection": 1.0, "friction": 0.3}, {"imperfection": 1.0, "grip": 1.0}],
)
def test_bad_imperfections(given):
    with pytest.raises(BadInput, match="imperfection"):
        Load(**given)


def test_a_force_that_bends_the_beam_by_its_radius_is_no_imperfection():
    """Its bound scales with E and, for similar beams, with their area; a beam that is slender bends more easily."""
    for design, bound in ((paper(), 2.2), (replace(paper(), E=2.0), 4.4), (replace(paper(), L=32.0), 0.071)):
        check_load(design, Load(depth=1.0, imperfection=0.95 * bound))
        with pytest.raises(
            BadInput, match=r"^imperfection must lie within .* is enough to select the direction of buckling$"
        ):
            check_load(design, Load(depth=1.0, imperfection=-1.05 * bound))


def test_a_shear_that_only_pulls_out_what_a_grip_holds_is_refused():
    check_load(paper(), Load(grip=1e-3, shear_x=0.5))
    check_load(replace(paper(), L=40.0), Load(grip=1.0, shear_x=80.0))
    with pytest.raises(BadInput, match=r"shear must not exceed 0\.5.* mm under a grip of 0\.001 mm"):
        check_load(paper(), Load(grip=1e-3, shear_x=1.0))
