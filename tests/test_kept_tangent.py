"""Steps with a kept tangent end in the equilibria of Newton's method, with few factorisations."""

from dataclasses import replace

import numpy as np
import pytest

from fem.model import symmetry_models
from fem.model.plate_contact import Plate, overlap
from fem.solve.direct_solver import Solver
from fem.solve.friction_newton import newton_with_friction
from fem.solve.kept_tangent import KeptTangent, newton_near
from fem.solve.newton import newton
from fem.solve.path_state import at_rest
from geometry.design import Design, paper

DEPTHS = (0.05, 0.053, 0.056)


def sensor(harmonics):
    shape = Design().shape.scaled(1 / 8)
    return symmetry_models.section(shape, 0.4998, "ignored", 0.2, 0.08, harmonics=harmonics).system


def plate(depth):
    return Plate(1.125 - depth, 1e4, np.zeros(2))


def touching(system, q, held):
    return overlap(system.surface, system.state(q).u, held) > 0


@pytest.mark.parametrize("harmonics", [0, 1])
def test_small_steps_end_in_the_equilibria_of_new_tangents(harmonics):
    system, kept = sensor(harmonics), KeptTangent(Solver())
    first = plate(DEPTHS[0])
    q = newton(system, Solver(), np.zeros(system.size), first, touching(system, np.zeros(system.size), first)).state.q
    kept_masks = []
    for depth in DEPTHS:
        held = plate(depth)
        near = newton_near(kept, system, q, held, touching(system, q, held))
        exact = newton(system, Solver(), q, held, touching(system, q, held))
        assert near is not None
        np.testing.assert_allclose(near.state.q, exact.state.q, atol=1e-8 * np.abs(exact.state.q).max())
        assert near.stability == exact.stability
        kept_masks.append(kept.pressed)
        q = exact.state.q
    # the contact grew, the tangent of the first step did not change
    assert kept_masks[0] is kept_masks[-1]
    assert touching(system, q, plate(DEPTHS[-1])).sum() > kept_masks[0].sum()


def test_a_step_that_is_too_long_keeps_nothing():
    system, kept = sensor(0), KeptTangent(Solver())
    held = plate(0.05)
    assert newton_near(kept, system, np.zeros(system.size), held, touching(system, np.zeros(system.size), held))
    far = replace(held, height=held.height - 0.4)
    guess = np.zeros(system.size)
    assert newton_near(kept, system, guess, far, touching(system, guess, far)) is None
    assert kept.pressed is None


def test_friction_keeps_the_stiffness_of_an_earlier_state():
    d = symmetry_models.section(paper().shape.scaled(0.1), 0.4998, "ignored", 0.25, 0.1, harmonics=1)
    state, solver = at_rest(d, mu=0.3), Solver()
    system, q = d.system, state.q
    condensed = []
    for shear in (0.02, 0.021):
        held = state.plate_at(np.array([0.02, shear, 0.0]))
        near = newton_with_friction(system, solver, q, held, touching(system, q, held), near=True)
        exact = newton_with_friction(system, Solver(), q, held, touching(system, q, held))
        np.testing.assert_allclose(near.state.q, exact.state.q, atol=1e-8 * np.abs(exact.state.q).max())
        condensed.append(solver.schur)
        q = exact.state.q
    assert condensed[0] is condensed[1]
