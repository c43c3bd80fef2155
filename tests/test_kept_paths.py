"""Kept paths: their answers are those of a solve from rest, and they cost no solve where none is needed."""

import random
import weakref

import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.scene import Scene
from fem.solve.load_increments import watched
from geometry.design import Design
from geometry.loads import Load
from studies.explorer import explorer_answers
from studies.explorer.explorer_answers import KeptPaths


@pytest.fixture
def paths():
    return KeptPaths()


def assert_equal(one, other):
    """Check that two responses agree to rounding: compiled and NumPy's loops may have computed them."""
    for a, b in ((one.force, other.force), (one.shift, other.shift)):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-10)
    assert (one.tilt, one.tilt_y) == pytest.approx((other.tilt, other.tilt_y), rel=1e-9, abs=1e-10)


def test_answers_are_those_of_a_solve_from_rest(paths):
    draw = random.Random(1)
    for k in range(8):
        design = Design(E=draw.uniform(0.5, 2), D=draw.choice([8.0, 9.0]))
        shear = draw.uniform(-0.5, 0.5) if k % 2 else 0.0
        load = Load(depth=0.5 if shear else draw.uniform(0.1, 2), shear_y=shear, friction="stick")
        kept = paths.solve(Scene(design, (load,), QUICK), sideways=True)
        fresh = solve(design, load, QUICK)
        assert_equal(kept.response, fresh.response)
        assert (kept.status, kept.message) == (fresh.status, fresh.message)


def test_friction_and_its_history_start_at_the_kept_press(paths):
    for shear in (0.1, 0.3):
        load = Load(depth=0.3, shear_x=shear, friction=0.4)
        kept = paths.solve(Scene(Design(), (load,), QUICK))
        fresh = solve(Design(), load, QUICK)
        assert kept.response.force == pytest.approx(fresh.response.force, rel=1e-9)
        assert kept.slip_share == pytest.approx(fresh.slip_share)


def increments(paths, design, load):
    """Number of load increments that a state takes."""
    shares = []
    with watched(shares.append):
        paths.solve(Scene(design, (load,), QUICK))
    return len(shares)


def test_changes_that_no_finite_element_sees_cost_no_increment(paths):
    load = Load(depth=1.0)
    assert increments(paths, Design(), load) > 0
    assert increments(paths, Design(E=2.0, f=7.0, remanence=1.0, hall_gain=20.0), load) == 0
    assert increments(paths, Design(nu=0.49), load) > 0


def test_a_shear_reuses_its_press(paths):
    loads = [Load(depth=0.5, shear_x=s, friction="stick") for s in (0.1, 0.11)]
    first, second = (increments(paths, Design(), load) for load in loads)
    assert second < first


def test_few_paths_are_kept(paths, monkeypatch):
    monkeypatch.setattr(explorer_answers, "MOST_PATHS", 2)
    followed = []
    for D in (7.0, 8.0, 9.0):
        paths.solve(Scene(Design(D=D), (Load(depth=0.5),), QUICK))
        followed.append(weakref.ref(list(paths._kept.values())[-1].path))
    assert [path() is None for path in followed] == [True, False, False]


class Abandon(Exception):
    """Ends a path."""


def test_a_path_that_is_ended_is_followed_again(paths):
    load = Load(depth=2.5)

    def end(share):
        if share > 0:
            raise Abandon

    with watched(end), pytest.raises(Abandon):
        paths.solve(Scene(Design(), (load,), QUICK))
    assert_equal(paths.solve(Scene(Design(), (load,), QUICK)).response, solve(Design(), load, QUICK).response)


@pytest.mark.parametrize(("shear", "way"), [(0.0, (1.0, 1.1, 0.8)), (1.0, (1.0, 1.1, 0.9))], ids=["press", "shear"])
def test_a_moving_load_is_followed_from_the_last_state(paths, shear, way):
    for value in way:
        load = Load(
            depth=0.5 if shear else value, shear_y=value if shear else 0.0, friction="stick" if shear else "none"
        )
        moving = paths.solve(Scene(Design(), (load,), QUICK), moving=True)
        solved = solve(Design(), load, QUICK)
        moved, fresh = moving.response, solved.response
        # both are within the tolerance of Newton's method
        assert moved.force == pytest.approx(fresh.force, rel=1e-7, abs=1e-8)
        assert moved.shift == pytest.approx(fresh.shift, rel=1e-7, abs=1e-8)
    assert moving.newton_iterations < solved.newton_iterations
    # a hand that rests gets the path of a solve
    resting = paths.solve(Scene(Design(), (load,), QUICK))
    assert_equal(resting.response, fresh)
