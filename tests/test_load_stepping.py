"""Paths do not depend on the steps that they take; their predictor saves increments and changes no answer."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import trace
from fem.model.symmetry_models import MeshSpecification
from fem.solve import load_increments, load_stepping
from fem.solve.direct_solver import Solver
from fem.solve.load_increments import follow_segment
from fem.solve.load_stepping import correct_press, predict
from fem.solve.path_state import at_rest, with_predictor
from fem.solve.press import solve_press
from geometry.design import Design, paper
from geometry.loads import Load


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


SHAPE = paper().shape.without_magnet().scaled(1 / 8)
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


def test_a_press_on_another_mesh_leads_to_the_state_that_increments_lead_to(solvers):
    rough, fine = (MeshSpecification(SHAPE, 0.4998, "ignored", size, size / 2).build() for size in (0.3, 0.2))
    pressed = np.array([0.1, 0.0, 0.0])
    other = follow_segment(solvers[1], at_rest(rough), pressed).state
    state, iterations = correct_press(solvers[0], at_rest(fine), other, pressed)
    in_steps = follow_segment(solvers[0], at_rest(fine), pressed)
    np.testing.assert_array_equal(state.position, pressed)
    np.testing.assert_allclose(state.u, in_steps.state.u, atol=1e-8)
    assert state.stability == in_steps.state.stability
    assert iterations > 0
    rest = at_rest(fine)
    assert correct_press(solvers[0], rest, other, pressed / 2) == (rest, 0)
