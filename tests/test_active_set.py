"""A step of Newton's method with its contact settled solves the linear complementarity problem."""

from dataclasses import replace

import numpy as np
import pytest

from fem.model import plate_contact
from fem.model.plate_contact import Plate
from fem.model.symmetry_models import MeshSpecification
from fem.solve import active_set
from fem.solve.active_set import KeptTangent
from fem.solve.direct_solver import UNKNOWN, Solver
from fem.solve.newton import newton
from geometry.design import Design

DEPTH = 0.06


def sensor(harmonics=0):
    shape = Design().shape.scaled(1 / 8)
    return MeshSpecification(shape, 0.4998, "ignored", 0.2, 0.08, harmonics=harmonics).build().system


def plate(stiffness=1e4):
    return Plate(1.125 - DEPTH, stiffness, np.zeros(2))


def plain_step(system, held, pressed):
    """State at rest, solver and plain step with the springs of the points `pressed`."""
    rest = system.state(np.zeros(system.size))
    assembly = system.assemble(rest, replace(held, pressed=pressed))
    solver = Solver()
    solver.factorise(assembly.tangent)
    return rest, solver, solver.solve(assembly.residual)


def within(system, radius):
    points = system.surface.points
    return (np.hypot(points[..., 0], points[..., 1]) < radius) & (points[..., 2] > 1)


@pytest.mark.parametrize("harmonics", [0, 2])
@pytest.mark.parametrize("radius", [0.0, 0.1, 0.3])
def test_springs_act_where_the_settled_step_presses(harmonics, radius):
    system, held = sensor(harmonics), plate()
    rest, solver, step = plain_step(system, held, within(system, radius))
    q = rest.q - active_set.settle_contact(
        system, active_set.KeptTangent(solver, within(system, radius)), rest, step, held
    )
    bare = system.assemble(rest, None)
    upper = bare.tangent.toarray()
    K = upper + np.triu(upper, 1).T
    g = plate_contact.overlap(system.surface, system.state(q).u, held).ravel()
    spring = held.stiffness * system.surface.weights.ravel() * np.maximum(g, 0)
    unknowns, pushes = active_set.normal_displacements(system, np.arange(len(g)), held)
    pushed = np.zeros(system.size)
    pushed[unknowns] = pushes.T @ spring
    assert np.linalg.norm(K @ q + bare.residual + pushed) < 1e-9 * np.linalg.norm(pushed)


def test_the_settled_step_does_not_depend_on_the_springs_before():
    system, held = sensor(), plate()
    found = []
    for radius in (0.0, 0.15, 0.3):
        rest, solver, step = plain_step(system, held, within(system, radius))
        found.append(
            active_set.settle_contact(
                system, active_set.KeptTangent(solver, within(system, radius)), rest, step, held
            )
        )
    assert np.allclose(found[1:], found[0], rtol=0, atol=1e-10)


@pytest.mark.parametrize("harmonics", [0, 2])
def test_exchanging_one_point_at_a_time_settles_the_same_step(harmonics, monkeypatch):
    system, held = sensor(harmonics), plate()
    rest, solver, step = plain_step(system, held, within(system, 0.1))
    steps = []
    for exchanges in (active_set.BLOCK_EXCHANGES, 0):
        monkeypatch.setattr(active_set, "BLOCK_EXCHANGES", exchanges)
        steps.append(
            active_set.settle_contact(system, active_set.KeptTangent(solver, within(system, 0.1)), rest, step, held)
        )
    assert steps[1] is not step
    np.testing.assert_allclose(steps[1], steps[0], rtol=0, atol=1e-10)


def test_a_body_that_gives_way_without_its_springs_has_no_settled_step():
    """A unit compliance against a spring of stiffness 1 that goes: what is left has no stiffness."""
    one = np.ones((1, 1))
    one, touching = np.ones((1, 1)), np.ones(1, dtype=bool)
    found = active_set._exchange(one, one, -np.ones(1), touching, np.ones(1), ~touching)
    assert found is None


DEPTHS = (0.05, 0.053, 0.056)


def plate_at(depth):
    return Plate(1.125 - depth, 1e4, np.zeros(2))


def touching(system, q, held):
    return plate_contact.overlap(system.surface, system.state(q).u, held) > 0


@pytest.mark.parametrize("harmonics", [0, 1])
def test_small_steps_end_in_the_equilibria_of_new_tangents(harmonics):
    system, kept = sensor(harmonics), KeptTangent(Solver())
    first = plate_at(DEPTHS[0])
    q = newton(system, Solver(), np.zeros(system.size), first, touching(system, np.zeros(system.size), first)).state.q
    kept_masks = []
    for depth in DEPTHS:
        held = plate_at(depth)
        near = newton(system, kept.solver, q, held, touching(system, q, held), tangent=kept)
        exact = newton(system, Solver(), q, held, touching(system, q, held))
        assert near.converged
        np.testing.assert_allclose(near.state.q, exact.state.q, atol=1e-8 * np.abs(exact.state.q).max())
        assert near.stability == exact.stability
        kept_masks.append(kept.pressed)
        q = exact.state.q
    # the contact grew, the tangent of the first step did not change
    assert kept_masks[0] is kept_masks[-1]
    assert touching(system, q, plate_at(DEPTHS[-1])).sum() > kept_masks[0].sum()


def test_an_unstable_tangent_is_not_kept():
    """A tangent is kept for long only where it is known to have no unstable direction."""
    system, kept = sensor(), KeptTangent(Solver())
    q, held = np.zeros(system.size), plate_at(0.05)
    answer = newton(system, kept.solver, q, held, touching(system, q, held), tangent=kept)
    contact = active_set.ActiveSet(system, kept, held, None, keeps_long=True)
    assert contact.knows(answer.state)
    kept.stability = UNKNOWN
    assert not contact.knows(answer.state)
