"""Searches for a force on a curve, whose states are those of a spring with a law of its own instead of a sensor."""

import math

import numpy as np
import pytest

from fem.analyses.force_targets import FORCE_TOLERANCE, CurvePoint, ForceNotReached, LoadingCurve


class Spring:
    """A path whose state is its motion, with all motions to which it went; it stops beyond `last`."""

    def __init__(self, law, last=math.inf):
        self.state, self.law, self.last, self.moves = 0.0, law, last, []

    def restart(self, state):
        self.state = state

    def go(self, motion):
        self.moves.append((self.state, motion))
        self.state = min(motion, self.last)
        return "no_convergence" if motion > self.last else ""

    def curve(self, power=1.5, most=10.0, **options):
        return LoadingCurve(
            self, self.go, lambda motion: (motion, self.law(motion)), power=power, most=most, **options
        )


@pytest.mark.parametrize("guess", [0.01, 0.7, 5.0])
@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
def test_the_force_of_a_power_law_is_found_from_any_guess(power, guess):
    point = Spring(lambda motion: motion**power).curve().find(2.0, guess)
    assert point.motion == pytest.approx(2 ** (1 / power), rel=2 * FORCE_TOLERANCE)


def test_a_law_with_the_power_of_the_curve_needs_three_states():
    spring = Spring(lambda motion: 7 * motion**1.5)
    spring.curve().find(2.0, 0.5)
    assert len(spring.moves) <= 3


def test_every_state_is_reached_from_the_one_before_it():
    spring = Spring(np.sinh)
    curve = spring.curve()
    for force in (5.0, 1.0, 3.0, 5.001):
        curve.find(force, 1.0)
    assert all(start < end for start, end in spring.moves)


def test_a_state_that_is_there_is_not_solved_again():
    spring = Spring(np.sinh)
    curve = spring.curve()
    assert curve.find(5.0, 1.0) is curve.find(5.0, 1.0)
    moves = len(spring.moves)
    assert curve.reach(curve.points[-1].motion) is curve.points[-1]
    assert len(spring.moves) == moves


def test_the_first_state_counts_where_several_have_the_force():
    point = Spring(lambda motion: math.sin(motion) + 0.1).curve(power=1.0).find(0.9, 0.5)
    assert point.motion == pytest.approx(math.asin(0.8), rel=1e-3)


def test_a_force_that_falls_at_first_is_found():
    point = Spring(lambda motion: motion - 0.5).curve(power=1.0).find(1.0, 0.2)
    assert point.motion == pytest.approx(1.5, rel=1e-4)


def test_a_path_that_stops_names_its_largest_force():
    with pytest.raises(ForceNotReached) as raised:
        Spring(lambda motion: motion, last=2.0).curve(power=1.0).find(3.0, 1.0)
    assert (raised.value.point.motion, raised.value.point.stop) == (2.0, "no_convergence")


def test_a_path_that_stops_beyond_the_force_has_it():
    point = Spring(lambda motion: motion, last=2.0).curve(power=1.0).find(1.9, 1.5)
    assert point.motion == pytest.approx(1.9, rel=1e-4)


def test_the_search_ends_at_the_largest_motion():
    with pytest.raises(ForceNotReached) as raised:
        Spring(lambda motion: motion).curve(power=1.0, most=4.0).find(5.0, 1.0)
    assert raised.value.last.motion == 4.0


def test_the_search_ends_where_the_force_cannot_grow():
    spring = Spring(lambda motion: min(motion, 1.0))
    with pytest.raises(ForceNotReached) as raised:
        spring.curve(power=1.0, ended=lambda motion: motion > 1).find(1.5, 0.9)
    assert raised.value.point.force == 1.0
    assert raised.value.last.motion < 2


def test_a_jump_names_both_ends():
    law = Spring(lambda motion: motion if motion < 1 else motion + 2)
    with pytest.raises(ForceNotReached) as raised:
        law.curve(power=1.0).find(2.0, 0.5)
    assert isinstance(raised.value.beyond, CurvePoint)
    assert (raised.value.point.force, raised.value.beyond.force) == pytest.approx((1.0, 3.0), rel=1e-6)
