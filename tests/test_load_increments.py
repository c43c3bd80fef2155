"""Increments of the load: a state leads to the next or to a failure, and stays as it was."""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest

from fem.model.symmetry_models import MeshSpecification
from fem.solve import load_increments
from fem.solve.direct_solver import Solver
from fem.solve.load_increments import apply_increment, follow_segment
from fem.solve.newton import TOLERANCE, newton, reference_size
from fem.solve.path_state import at_rest, glue, with_harmonics
from geometry.design import paper

SHAPE = paper().shape.without_magnet().scaled(1 / 8)
DEEP, FAR = np.array([0.1, 0.0, 0.0]), np.array([0.1, 0.02, 0.0])


@pytest.fixture
def solver():
    return Solver()


def section(harmonics=0):
    return MeshSpecification(SHAPE, 0.4998, "ignored", 0.25, 0.125, harmonics=harmonics).build()


def pressed(solver, mu=None):
    """A press in several increments, with past and, if wanted, friction."""
    return follow_segment(solver, at_rest(section(), mu=mu), np.array([0.06, 0.0, 0.0])).state


def sheared(solver):
    """A press that is glued and has moved aside in two increments."""
    state = glue(with_harmonics(pressed(solver), section(1)), None)
    for way in (0.01, 0.02):
        state = apply_increment(Solver(), state, np.array([0.06, way, 0.0]), TOLERANCE, accept=True).state
    return state


def contents(state):
    """All numbers of a state, copied."""
    parts = [state, state.friction, state.bond, *state.past]
    values = [getattr(part, field.name) for part in parts if part is not None for field in fields(part)]
    return copy.deepcopy([value for value in values if isinstance(value, float | int | np.ndarray)])


def same(one, other):
    return len(one) == len(other) and all(map(np.array_equal, one, other))


@pytest.mark.parametrize("mu", [None, 0.3])
def test_the_same_increment_from_the_same_state_leads_to_the_same_next_one(solver, mu):
    state = pressed(solver, mu)
    before, position = contents(state), np.array([0.07, 0.0, 0.0])
    once, again = (apply_increment(solver, state, position, TOLERANCE, accept=True) for _ in range(2))
    assert same(contents(state), before)
    assert not same(contents(once.state), before)
    assert same(contents(once.state), contents(again.state))
    assert (once.stop, once.iterations) == (again.stop, again.iterations) == ("", once.iterations)


def test_a_glued_patch_moves_on_twice_alike(solver):
    state, position = sheared(solver), np.array([0.06, 0.03, 0.0])
    before = contents(state)
    once, again = (apply_increment(Solver(), state, position, TOLERANCE, accept=True) for _ in range(2))
    assert same(contents(state), before)
    assert same(contents(once.state), contents(again.state))


@pytest.mark.parametrize("mu", [None, 0.3])
def test_a_failed_increment_returns_the_state_before_without_its_past(solver, monkeypatch, mu):
    state = pressed(solver, mu)
    before, real = contents(state), load_increments.newton

    def stubborn(*given, **options):
        return replace(real(*given, **options), reason="step_inverted")

    monkeypatch.setattr(load_increments, "newton", stubborn)
    # with friction the plain method follows where the other one has failed
    settled = load_increments.iterate
    monkeypatch.setattr(
        load_increments, "iterate", lambda *given, **options: replace(settled(*given), reason="no_convergence")
    )
    tried = apply_increment(solver, state, DEEP, TOLERANCE, accept=True)
    assert (tried.state.past, tried.stop) == ((), "step_inverted")
    assert same(contents(tried.state), contents(replace(state, past=())))
    assert same(contents(state), before)


def test_an_increment_through_the_clamp_fails(solver):
    state = pressed(solver)
    tried = apply_increment(solver, state, np.array([2 * SHAPE.L, 0.0, 0.0]), TOLERANCE, accept=True)
    assert tried.stop
    assert tried.state.position is state.position


@pytest.mark.parametrize("longest", [1.0, 0.02])
def test_a_segment_ends_at_its_goal_with_the_present_state_behind_it(solver, monkeypatch, longest):
    monkeypatch.setattr(load_increments, "LONGEST", longest)
    reached = follow_segment(solver, at_rest(section()), DEEP)
    np.testing.assert_array_equal(reached.state.position, DEEP)
    assert [len(reached.state.past), reached.stop] == [1 if longest == 1 else 2, ""]
    assert reached.state.past[-1].position[0] == pytest.approx(max(0.1 - longest, 0.0), abs=1e-12)


def test_a_segment_that_stops_short_keeps_the_last_good_state(solver, monkeypatch):
    real, start = load_increments.newton, at_rest(section())

    def stubborn(system, solver, q, plate, *more, **options):
        answer = real(system, solver, q, plate, *more, **options)
        return replace(answer, reason="no_convergence") if plate.height < SHAPE.L - 0.05 else answer

    monkeypatch.setattr(load_increments, "newton", stubborn)
    monkeypatch.setattr(load_increments, "LONGEST", 0.02)
    reached = follow_segment(solver, start, DEEP)
    assert reached.stop == "no_convergence"
    assert 0.04 <= reached.state.position[0] <= 0.05
    assert not start.position.any()
    assert not start.q.any()


def test_a_last_step_without_a_check_reaches_the_tolerance(solver):
    state, position = pressed(solver), np.array([0.07, 0.0, 0.0])
    system, plate = state.d.system, state.plate_at(position)
    guess = load_increments.extrapolate_unknowns(state, position)
    pressed_points = load_increments.extrapolate_contact(state, position)
    sure, quick = (newton(system, solver, guess, plate, pressed_points, confirm=confirm) for confirm in (True, False))
    after = system.assemble(quick.state, plate, tangent=False)
    assert reference_size(system, quick.state, after).share(after) < 2 * TOLERANCE
    # one residual less: the assembly is that before the last step
    assert reference_size(system, sure.state, quick.assembly).share(quick.assembly) > TOLERANCE
    assert quick.iterations == sure.iterations
    assert quick.assembly.energy == pytest.approx(sure.assembly.energy, rel=1e-10)
