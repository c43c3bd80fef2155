"""States with a wanted force: against single solves, under similarity, with friction, and where no state has it.

Searches on a curve are also those of a spring with a law of its own instead of a sensor.
"""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROUGH

from fem.accuracy import QUICK, STANDARD
from fem.analyses.force_targets import ForceTarget, solve_force, walk_forces
from fem.equilibrium import solve, trace
from fem.solution import ForceOutOfReach
from fem.solve.load_case_models import SHALLOW
from fem.solve.loading_curve import FORCE_TOLERANCE, SHARED_TOLERANCE, CurvePoint, LoadingCurve, NotReached
from geometry.design import BadInput, Design, paper
from geometry.loads import Load

STICK = Load(friction="stick")


def normal(state):
    return state.response.force[2]


def alone(load, accuracy=ROUGH, **options):
    (state,) = trace(paper(), [load], accuracy, estimate=False, **options)
    return state


@pytest.mark.parametrize("depth", [1e-5, 0.15, 2.5])
def test_the_force_of_a_depth_leads_back_to_it(depth):
    state = solve_force(paper(), normal(alone(Load(depth=depth))), ROUGH)
    assert state.load.depth == pytest.approx(depth, rel=FORCE_TOLERANCE)


def test_the_state_is_that_of_a_single_solve_at_its_depth():
    state = solve_force(paper(), 2.0, ROUGH)
    single = solve(paper(), state.load, ROUGH)
    assert solve_force(Design(E=30.0), 60.0, ROUGH).load.depth == pytest.approx(state.load.depth, rel=1e-9)
    assert state.response.shift == pytest.approx(single.response.shift, rel=1e-7)
    assert state.estimates.force == pytest.approx(single.estimates.force, rel=1e-6)
    assert (state.status, state.message, state.facts.remark) == (single.status, single.message, single.facts.remark)


def test_the_depth_of_a_force_has_an_error_of_its_own():
    """Near 5 N the force grows like the depth to the power 1.6: the depth is off by 1 / 1.6 of its error."""
    state = solve_force(paper(), 5.0, QUICK)
    assert state.estimates.depth == pytest.approx(state.estimates.force / 1.6, rel=0.03)
    assert state.estimates.shear is None


def test_the_motions_of_two_forces_have_errors_that_cover_those_to_a_finer_mesh():
    rough, finer = (solve_force(paper(), 2.0, level, shear_force=(0.3, 0.0)) for level in (QUICK, STANDARD))
    for motion in ("depth", "shear"):
        found, true = (getattr(each.load, motion) for each in (rough, finer))
        errors = [getattr(each.estimates, motion) for each in (rough, finer)]
        assert abs(found / true - 1) < sum(errors) < 0.06


def test_a_force_between_those_of_two_meshes_has_a_state():
    """The meshes of light and of deep presses meet at a depth where their forces differ a little."""
    bound = SHALLOW * paper().D
    forces = [normal(alone(Load(depth=bound * factor))) for factor in (1 - 1e-9, 1 + 1e-9)]
    for force in (*forces, sum(forces) / 2):
        state = solve_force(paper(), force, ROUGH)
        assert normal(state) == pytest.approx(force, rel=FORCE_TOLERANCE)
        assert state.load.depth == pytest.approx(bound, rel=abs(forces[0] / forces[1] - 1) + FORCE_TOLERANCE)


def test_a_glued_shear_has_both_forces_whatever_the_forces_on_the_way():
    """It sticks where a press to the normal force touches: a shear at the final depth, which glues more, differs."""
    targets = [ForceTarget(3.0, (part * -0.6, part * 0.8), STICK) for part in (0.6, 1.0)]
    solves = []
    *_, state = walk_forces(paper(), targets, ROUGH, progress=lambda _, message: solves.append("shear" in message))
    force, load = state.response.force, state.load
    assert force == pytest.approx((-0.6, 0.8, 3.0), rel=2 * FORCE_TOLERANCE)
    assert load.shear_x / load.shear_y == pytest.approx(-0.75)
    assert sum(solves) < 20
    (once,) = walk_forces(paper(), targets[1:], ROUGH, estimate=False)
    assert (once.load.depth, once.load.shear) == pytest.approx((load.depth, load.shear), rel=1e-3)
    assert alone(load).response.force[1] / force[1] == pytest.approx(1.02, abs=0.015)


def test_coulomb_friction_carries_a_force_below_slip():
    friction = Load(friction=0.5)
    (state,) = walk_forces(paper(), [ForceTarget(1.0, (0.2, 0.0), friction)], ROUGH)
    assert state.response.force == pytest.approx((0.2, 0.0, 1.0), rel=SHARED_TOLERANCE)
    assert 0 < state.slip_share < 1
    assert 0 < state.estimates.depth < state.estimates.shear < 0.2
    (pressed,) = walk_forces(paper(), [ForceTarget(1.0, None, friction)], ROUGH, estimate=False)
    assert normal(alone(pressed.load)) == pytest.approx(1.0, rel=SHARED_TOLERANCE)


def test_a_shear_force_that_slips_before_the_bound_names_what_is_reached():
    """With the plate's springs, the whole area slips a little below the coefficient times the normal force."""
    with pytest.raises(ForceOutOfReach, match="whole contact area slips") as raised:
        list(walk_forces(paper(), [ForceTarget(1.0, (0.0999, 0.0), Load(friction=0.1))], ROUGH))
    largest = float(re.search(r"largest force is (\S+) N", str(raised.value))[1])
    assert 0.095 < largest < 0.0999
    assert raised.value.state.response.force == pytest.approx((largest, 0.0, 1.0), rel=1e-3)


def test_a_beam_that_gives_way_under_the_normal_force_carries_no_shear_force():
    """Far beyond the force at which a slender beam gives way sideways, it is pushed along by what sticks to it."""
    slender = replace(paper(), L=32.0, l0=32.0)
    with pytest.raises(ForceOutOfReach, match="the beam gives way, its force falls from 0 N at shear 0 mm"):
        solve_force(slender, 2.0, ROUGH, shear_force=(0.1, 0.0), magnet="ignored")


def test_a_tilted_plate_holds_the_normal_force_in_the_plane_of_its_tilt():
    state = solve_force(paper(), 2.0, ROUGH, shear_force=(0.1, 0.0), load=replace(STICK, plate_tilt=0.05))
    assert state.response.force == pytest.approx((0.1, 0.0, 2.0), rel=SHARED_TOLERANCE, abs=1e-9)


def test_a_force_that_no_press_reaches_names_the_largest_one():
    """States before it are kept."""
    states = walk_forces(paper(), [ForceTarget(1.0), ForceTarget(1e6)], ROUGH, magnet="ignored", estimate=False)
    assert normal(next(states)) == pytest.approx(1.0, rel=FORCE_TOLERANCE)
    with pytest.raises(BadInput, match=r"does not reach 1e\+06 N.*where the solve stops") as raised:
        next(states)
    force, depth = map(float, re.search(r"largest force is (\S+) N at depth (\S+) mm", str(raised.value)).groups())
    before = alone(Load(depth=0.8 * depth), magnet="ignored")
    assert normal(before) < force < 1e6


@pytest.mark.parametrize("load", [Load(plate_tilt=0.1), Load()])
def test_tetrahedra_have_the_force(load):
    (state,) = walk_forces(
        paper(), [ForceTarget(0.5, None, load)], ROUGH, magnet="ignored", model="half", estimate=False
    )
    assert normal(state) == pytest.approx(0.5, rel=FORCE_TOLERANCE)
    assert state.estimates.force is None


@pytest.mark.parametrize(
    ("call", "parts"),
    [
        (lambda: ForceTarget(0.0), ["force must be", "got 0"]),
        (lambda: ForceTarget(-5.0), ["force must be", "got -5"]),
        (lambda: ForceTarget(math.nan), ["force must be", "got nan"]),
        (lambda: ForceTarget(1.0, (0.0, 0.0)), ["shear force must be", "other than 0"]),
        (lambda: ForceTarget(1.0, (1.0, 0.0)), ["frictionless plate carries no shear force"]),
        (lambda: ForceTarget(1.0, None, Load(grip=1.0, shear_x=1.0)), ["a grip has no plate"]),
        (lambda: ForceTarget(1.0, None, Load(depth=1.0)), ["depth 0 and shear 0"]),
        (lambda: ForceTarget(5.0, (3.0, 0.0), Load(friction=0.5)), ["0.5 x 5 N = 2.5 N", "slips", "got 3 N"]),
        (
            # a tilted plate pushes towards -x: its friction cone is the narrower towards x
            lambda: ForceTarget(5.0, (1.5, 0.0), Load(friction=0.4, plate_tilt=0.1)),
            ["between -2.606 and 1.441 N", "slips", "got 1.5 N"],
        ),
        (lambda: ForceTarget(5.0, (1.0, 0.5), replace(STICK, plate_tilt=0.1)), ["in the plane of its tilt", "0.5 N"]),
        (
            lambda: walk_forces(paper(), [ForceTarget(1.0, (0.5, 0.0), STICK)], ROUGH, model="axisymmetric"),
            ["model axisymmetric cannot carry a shear"],
        ),
        (
            # a tilted plate pushes the tip aside: no shear in that direction has a smaller force
            lambda: solve_force(paper(), 0.5, ROUGH, shear_force=(-0.01, 0.0), load=replace(STICK, plate_tilt=0.2)),
            ["without a shear the tilted plate has 0.", "wanted 0.01 N already", "or one the other way"],
        ),
    ],
)
def test_impossible_targets_are_refused(call, parts, refused):
    with refused(*parts):
        call()


class Spring:
    """A curve of states that are their motion, with all motions to which it went; it stops beyond `last`."""

    def __init__(self, law, last=math.inf, *, power=1.5, most=10.0, **options):
        self.law, self.last, self.moves = law, last, []
        self.curve = LoadingCurve([CurvePoint(0.0, law(0.0), 0.0)], self.go, power=power, most=most, **options)

    def go(self, state, motion):
        self.moves.append((state, motion))
        end = min(motion, self.last)
        return CurvePoint(end, self.law(end), end, "no_convergence" if motion > self.last else "")

    def find(self, force, guess):
        return self.curve.find(force, guess)


@pytest.mark.parametrize("guess", [0.01, 0.7, 5.0])
@pytest.mark.parametrize("power", [1.0, 1.5, 3.0])
def test_the_force_of_a_power_law_is_found_from_any_guess(power, guess):
    point = Spring(lambda motion: motion**power).find(2.0, guess)
    assert point.motion == pytest.approx(2 ** (1 / power), rel=2 * FORCE_TOLERANCE)


def test_a_law_with_the_power_of_the_curve_needs_three_states():
    spring = Spring(lambda motion: 7 * motion**1.5)
    spring.find(2.0, 0.5)
    assert len(spring.moves) <= 3


def test_states_are_reached_from_those_before_them_and_never_twice():
    spring = Spring(np.sinh)
    for force in (5.0, 1.0, 3.0, 5.001):
        spring.find(force, 1.0)
    assert all(start < end for start, end in spring.moves)
    moves, last = len(spring.moves), spring.curve.points[-1]
    assert spring.find(5.0, 1.0) is spring.find(5.0, 1.0)
    assert spring.curve.reach(last.motion) is last
    assert len(spring.moves) == moves


@pytest.mark.parametrize(
    ("law", "last", "force", "motion"),
    [
        (lambda motion: math.sin(motion) + 0.1, math.inf, 0.9, math.asin(0.8)),
        (lambda motion: motion - 0.5, math.inf, 1.0, 1.5),
        (lambda motion: motion, 2.0, 1.9, 1.9),
    ],
    ids=["the first of several", "after a fall", "before a stop"],
)
def test_a_force_is_found_where_the_curve_has_it(law, last, force, motion):
    assert Spring(law, last, power=1.0).find(force, 0.5).motion == pytest.approx(motion, rel=1e-3)


def test_a_search_ends_at_a_stop_at_the_largest_motion_and_where_the_force_cannot_grow():
    stopped = Spring(lambda motion: motion, last=2.0, power=1.0).find(3.0, 1.0)
    assert isinstance(stopped, NotReached)
    assert (stopped.point.motion, stopped.point.stop) == (2.0, "no_convergence")
    assert Spring(lambda motion: motion, power=1.0, most=4.0).find(5.0, 1.0).last.motion == 4.0
    flat = Spring(lambda motion: min(motion, 1.0), power=1.0, ended=lambda motion: motion > 1).find(1.5, 0.9)
    assert flat.point.force == 1.0
    assert flat.last.motion < 2


def test_a_jump_names_both_ends():
    spring = Spring(lambda motion: motion if motion < 1 else motion + 2, power=1.0)
    found = spring.find(2.0, 0.5)
    assert isinstance(found.beyond, CurvePoint)
    assert (found.point.force, found.beyond.force) == pytest.approx((1.0, 3.0), rel=1e-6)
