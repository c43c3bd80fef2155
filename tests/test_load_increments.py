"""Increments of the load: a state leads to the next or to a failure, and stays as it was."""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest

from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import trace
from fem.model.symmetry_models import MeshSpecification
from fem.solve import load_increments, load_stepping
from fem.solve.direct_solver import Solver
from fem.solve.load_increments import apply_increment, follow_segment
from fem.solve.load_stepping import predict
from fem.solve.newton import TOLERANCE, newton, reference_size
from fem.solve.path_state import at_rest, glue, with_harmonics, with_predictor
from fem.solve.press import solve_press
from geometry.design import Design, paper
from geometry.loads import Load

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


# Paths do not depend on the steps that they take; their predictor saves increments and changes no answer.


def test_a_press_does_not_depend_on_the_length_of_its_steps(monkeypatch):
    """On this mesh a folded element balances too, at a force lower by 2 %: a plain Newton method may end there."""
    sensor = Design(
        D=5.12, L=6.93, nu=0.49893, magnet_diameter=2.38, magnet_height=1.05, magnet_edge_radius=0.153, l0=6.93
    )
    loads = [Load(depth=depth) for depth in (0.07326, 0.2442, 0.6105)]
    forces = []
    for longest in (load_increments.LONGEST, 0.03):
        monkeypatch.setattr(load_increments, "LONGEST", longest)
        forces.append(trace(sensor, loads, QUICK, estimate=False)[-1].response.force[2])
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)


def test_silicone_that_is_crushed_in_short_steps_too_is_believed(monkeypatch):
    """With a bound that every deformation breaks."""
    plain = trace(paper(), [Load(depth=1.0)], QUICK, estimate=False)[-1]
    monkeypatch.setattr(load_increments, "CRUSHED", 1.0)
    halved = trace(paper(), [Load(depth=1.0)], QUICK, estimate=False)[-1]
    assert halved.newton_iterations > plain.newton_iterations
    assert halved.response.force[2] == pytest.approx(plain.response.force[2], rel=1e-8)


def test_a_path_that_stops_short_ends_in_a_state_that_is_solved_to_the_end(monkeypatch):
    shape, real = paper().shape.without_magnet().scaled(1 / 8), load_increments.newton

    def stubborn(system, solver, q, plate, *more, **options):
        answer = real(system, solver, q, plate, *more, **options)
        return replace(answer, reason="step_inverted") if plate.height < shape.L - 0.3 else answer

    monkeypatch.setattr(load_increments, "newton", stubborn)
    state, stop = solve_press(MeshSpecification(shape, 0.4998, "ignored", 0.25, 0.125), 0.4)
    assert stop == "step_inverted"
    assert 0.25 <= state.position[0] < 0.3
    system = state.d.system
    here = system.assemble(system.state(state.q), state.plate, tangent=False)
    assert np.abs(here.residual).max() < 1e-9 * np.abs(here.forces[system.eliminated]).max()


@pytest.mark.parametrize("least", [1e-6, 1e-4, 0.1, 0.5])
def test_a_press_does_not_depend_on_the_other_depths_of_its_path(least):
    alone, company = (trace(paper(), [Load(depth=d) for d in way], QUICK)[-1] for way in ([2.0], [least, 2.0]))
    assert (alone.status, company.status) == ("ok", "ok")
    assert company.response.force[2] == pytest.approx(alone.response.force[2], rel=1e-9)
    assert company.estimates.force == pytest.approx(alone.estimates.force, rel=1e-6)


def test_a_glued_shear_does_not_depend_on_a_light_touch_before():
    sheared = Load(depth=1.0, shear_x=1.0, friction="stick")
    alone, company = (
        trace(paper(), way, QUICK, estimate=False)[-1]
        for way in ([sheared], [replace(sheared, depth=1e-4, shear_x=0.0), sheared])
    )
    assert company.response == alone.response


def test_a_press_with_friction_does_not_depend_on_a_light_touch_before():
    pressed = Load(depth=0.5, friction=0.3)
    alone, company = (
        trace(paper(), way, QUICK, estimate=False)[-1] for way in ([pressed], [replace(pressed, depth=1e-4), pressed])
    )
    assert company.response == alone.response


def test_a_plate_with_friction_that_lifts_off_stays_on_its_mesh():
    """Its history lives there."""
    way = [Load(depth=d, friction=0.3) for d in (0.5, 0.1, 0.05)]
    first, *others = (state.dofs for state in trace(paper(), way, QUICK, estimate=False))
    assert others == [first, first]


def test_small_elements_under_a_deep_press_keep_their_stability():
    """The plate's springs are stiff beside them: softer ones let the skin wrinkle from 4.31 mm on."""
    facts = trace(paper(), [Load(depth=4.4)], STANDARD, estimate=False)[-1].facts
    # the free skin is compressed beyond the limit of creases there, which the mesh does not open
    assert facts.stability.is_stable
    assert (facts.onset, facts.creased) == (None, True)


ASIDE = np.array([0.0, 0.1, 0.0])


@pytest.fixture
def solvers():
    return Solver(), Solver()


@pytest.fixture(scope="module")
def gripped():
    """A gripped tip at rest, in a model with two harmonics and a predictor with one."""
    one, two = (
        MeshSpecification(SHAPE, 0.4998, "ignored", 0.25, 0.125, harmonics=n, skin_harmonics=2).build()
        for n in (1, 2)
    )
    return with_predictor(at_rest(two, grip=0.3), one)


def test_it_leads_to_the_state_that_increments_lead_to(gripped, solvers):
    at_once, _ = predict(*solvers, gripped, ASIDE)
    in_steps = follow_segment(solvers[0], gripped, ASIDE).state
    np.testing.assert_array_equal(at_once.position, ASIDE)
    assert at_once.energy == pytest.approx(in_steps.energy, rel=1e-8)
    np.testing.assert_allclose(at_once.u, in_steps.u, atol=1e-8)


def test_it_goes_along_and_leaves_the_state_before_as_it_was(gripped, solvers):
    reduced, q = gripped.reduced, gripped.reduced.q.copy()
    once, again = (predict(*solvers, gripped, ASIDE) for _ in range(2))
    assert gripped.reduced is reduced
    np.testing.assert_array_equal(reduced.q, q)
    np.testing.assert_array_equal(once[0].q, again[0].q)
    np.testing.assert_array_equal(once[0].reduced.q, again[0].reduced.q)
    np.testing.assert_array_equal(once[0].reduced.position, ASIDE)
    assert once[1] == again[1]


def test_where_its_correction_fails_only_the_predictor_has_moved(gripped, solvers, monkeypatch):
    real = load_stepping.newton

    def stubborn(*given, **options):
        return replace(real(*given, **options), reason="no_convergence")

    monkeypatch.setattr(load_stepping, "newton", stubborn)
    state, iterations = predict(*solvers, gripped, ASIDE)
    assert state.q is gripped.q
    assert state.position is gripped.position
    np.testing.assert_array_equal(state.reduced.position, ASIDE)
    assert iterations > 0


def test_one_that_was_left_behind_says_nothing(gripped, solvers):
    elsewhere = replace(gripped, position=np.array([0.0, 0.05, 0.0]))
    assert predict(*solvers, elsewhere, ASIDE) == (elsewhere, 0)
    alone = replace(gripped, reduced=None)
    assert predict(*solvers, alone, ASIDE) == (alone, 0)
