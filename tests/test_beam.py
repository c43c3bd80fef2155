"""The paper's mechanics: its numbers, scaling, the closure of the magnet's displacement, friction, bad input."""

import math

import pytest

from analytic.beam import cantilever_stiffness, solve
from geometry.design import BadInput, paper
from geometry.loads import Load

approx = pytest.approx


def test_numbers_of_the_paper():
    assert solve(paper(), Load(depth=3)).force == (0, 0, approx(15.708, abs=5e-4))
    assert solve(paper(), Load(depth=1)).force[2] == approx(7 * math.pi / 9, rel=1e-14)
    assert cantilever_stiffness(paper()) == approx(0.827, abs=5e-4)
    sheared = solve(paper(), Load(shear_x=3.1, grip=2))
    assert sheared.force[0] == approx(3.1 * 0.82740, rel=1e-4)


def test_displacement_with_the_assumed_closure():
    """The paper's two relations with l_t = e (1 - d/L)."""
    d, x, e, L = 2.0, 1.3, 4.0, 9.0
    l_t = e * (1 - d / L)
    response = solve(paper(), Load(d, x, -x, "stick"))
    along = x * ((L - d) - l_t) / (L - d)
    assert response.shift == approx((along, -along, -(l_t + d - e)), rel=1e-14)
    assert response.tilt == 0


def test_contact_radius_and_the_end_of_equation_7():
    for d in (0.0, 1.0, 4.0):
        assert solve(paper(), Load(depth=d)).contact_radius == approx(math.sqrt(8 * d - d * d), rel=1e-14)
    with pytest.raises(BadInput, match=r"must not exceed the tip radius D/2 = 4 mm.*got 4.01 mm"):
        solve(paper(), Load(depth=4.01))


def test_friction():
    def under(friction, depth=2.0):
        return solve(paper(), Load(depth, 1.2, -0.9, friction))

    stuck, slid = under("stick"), under("none")
    assert slid.force[:2] == (0, 0)
    assert slid.shift[:2] == (0, 0)
    assert slid.force[2] == stuck.force[2] > 0
    assert math.hypot(*stuck.force[:2]) == approx(1.5 * cantilever_stiffness(paper()))
    assert under(10.0) == stuck
    assert under(0.0) == slid
    slips = under(0.05)
    share = 0.05 * slips.force[2] / math.hypot(*stuck.force[:2])
    assert 0 < share < 1
    assert slips.force[:2] == approx([share * value for value in stuck.force[:2]], rel=1e-13)
    assert slips.shift[:2] == approx([share * value for value in stuck.shift[:2]], rel=1e-13)
    assert under(0.3, depth=0.0).force == (0, 0, 0)


def test_grip_is_shear_without_a_plate():
    gripped = solve(paper(), Load(shear_x=1.2, shear_y=-0.9, grip=3))
    assert gripped == solve(paper(), Load(shear_x=1.2, shear_y=-0.9, friction="stick"))
    assert gripped.contact_radius == gripped.force[2] == 0


def test_bad_input():
    with pytest.raises(BadInput, match=r"level must be one of paper, column, .*; got 'fem'"):
        solve(paper(), Load(depth=1), level="fem")
    with pytest.raises(BadInput, match=r"cannot model a tilted plate: plate tilt must be 0; got 5\.73 degrees"):
        solve(paper(), Load(depth=1, plate_tilt=0.1))
    with pytest.raises(BadInput, match="cannot model an imperfection"):
        solve(paper(), Load(depth=1, imperfection=0.01))
    with pytest.raises(BadInput, match="depth must be less than 9 mm"):
        solve(paper(), Load(depth=9))
    with pytest.raises(BadInput, match="grip must be less than L"):
        solve(paper(), Load(shear_x=1, grip=9))
