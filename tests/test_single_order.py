"""The blocks of single orders against the whole tangent of a section with harmonics, and the pose they give."""

import functools
from dataclasses import replace

import numpy as np
import pytest

from fem.model import single_order, symmetry_models
from fem.model.gradient_recovery import build_recovery
from fem.model.symmetry_models import MeshSpecification
from fem.solve.direct_solver import Solver
from fem.solve.path_state import about, glue, with_harmonics
from fem.solve.press import solve_press
from geometry.design import Design

HARMONICS, EDGE = 2, 0.14
SHAPE = Design().shape.scaled(1 / 8)


def eigenvalues(state):
    """Eigenvalues of the tangent of a state whose contact area is glued."""
    glued = glue(state, EDGE)
    upper = glued.d.system.assemble(glued.d.system.state(glued.q), glued.plate).tangent.toarray()
    return np.linalg.eigvalsh(upper, UPLO="U")


@functools.cache
def press(magnet):
    """State of a press, and a model with harmonics on its mesh."""
    section = MeshSpecification(SHAPE, 0.4998, magnet, 0.25, 0.1, rim=(EDGE, 0.03))
    return solve_press(section, 0.1)[0], replace(section, harmonics=HARMONICS).build()


def test_eigenvalues_of_all_orders_are_those_of_the_whole_tangent():
    low, high = press("ignored")
    blocks = [eigenvalues(low)]
    blocks += [eigenvalues(about(low, single_order.build(low.d, order))) for order in range(1, HARMONICS + 1)]
    whole = eigenvalues(with_harmonics(low, high))
    np.testing.assert_allclose(np.sort(np.concatenate(blocks)), whole, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_a_sideways_push_moves_the_dome_as_in_the_whole_model(magnet):
    low, high = press(magnet)
    moved, negative = [], []
    for state in (about(low, single_order.build(low.d, 1)), with_harmonics(low, high)):
        system, push = state.d.system, np.zeros(state.d.system.size)
        nodal = symmetry_models.distribute_push(state.skin, system.fixed.shape, SHAPE.H, 1.0)
        push[: system.n_free] = nodal[system.free]
        solver = Solver()
        solver.factorise(system.assemble(system.state(state.q), state.plate).tangent)
        moved.append(push @ solver.solve(push))
        negative.append(solver.stability(system.n_pressure).directions)
    assert moved[0] == pytest.approx(moved[1], rel=1e-9)
    assert negative == [0, 0]


def test_the_state_is_that_of_the_press():
    low, _ = press("rigid")
    state = about(low, single_order.build(low.d, 1))
    np.testing.assert_allclose(state.u[:, [0, 3]], low.u, rtol=0, atol=1e-15)
    assert not state.u[:, [1, 2, 4]].any()
    assert state.skin.weights.sum() == pytest.approx(low.skin.weights.sum(), rel=1e-12)
    assert np.array_equal(state.overlap > 0, np.repeat(low.overlap > 0, 2, axis=1))


def test_raised_fields_are_those_of_one_harmonic():
    low, _ = press("ignored")
    state = about(low, single_order.build(low.d, 1))
    shift = np.zeros(state.u.shape)
    shift[:, 2] = 0.5  # w_-1 alone is a displacement along x
    harmonic = MeshSpecification(SHAPE, 0.4998, "ignored", 0.25, 0.1, rim=(EDGE, 0.03), harmonics=1).build()
    displacement, gradient = build_recovery(harmonic.elements, SHAPE.H, mirrored=True)(
        single_order.raise_fields(shift)
    )
    np.testing.assert_allclose(displacement, [0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(gradient, np.zeros((3, 3)), atol=1e-10)
