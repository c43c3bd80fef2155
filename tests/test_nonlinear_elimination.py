"""A few cells brought to balance by themselves fit the body that was in balance around them."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem.model import elements, plate_contact, rigid_inclusion, symmetry_models
from fem.model.coulomb_friction import at_rest
from fem.model.material import lame
from fem.model.nonlinear_system import System
from fem.model.plate_contact import Plate
from fem.solve import newton, nonlinear_elimination
from fem.solve.direct_solver import Solver
from geometry.design import Design

CORE, TOP = 0.5, 1.0


@pytest.fixture(autouse=True)
def any_size(monkeypatch):
    monkeypatch.setattr(nonlinear_elimination, "LEAST_SIZE", 1000)


@pytest.fixture(scope="module")
def pressed():
    """Silicone y >= 0 around a rigid core, sheared by a plate that its top is glued to in part, and its solution."""
    grid = np.linspace(-1, 1, 7)
    mesh = skfem.MeshTet.init_tensor(grid, np.linspace(0, 1, 4), grid)
    mesh = mesh.remove_elements(np.flatnonzero(np.abs(mesh.p[:, mesh.t].mean(axis=1)).max(axis=0) < CORE / 1.5))
    mesh = skfem.MeshTet2.from_mesh(mesh).with_boundaries({"skin": lambda x: x[2] > TOP - 1e-9})
    e = elements.build(mesh, axisymmetric=False)
    fixed = np.zeros(e.nodes.shape, dtype=bool)
    fixed[e.nodes[:, 2] < -TOP + 1e-9] = True
    fixed[e.nodes[:, 1] < 1e-9, 1] = True
    core = np.flatnonzero(np.abs(e.nodes).max(axis=1) < CORE)
    skin = elements.surface(mesh, "skin", e, axisymmetric=False, order=4)
    system = System(e, skin, *lame(1.0, 0.49), fixed, core, rigid_inclusion.solid(e.nodes[core], 3))
    plate = Plate(0.95, 1e3, np.zeros(2))
    plate = replace(plate_contact.glue(skin, np.zeros(fixed.shape), plate, 0.5, 0.0), shear=np.array([0.1, 0.0]))
    answer = newton.newton(system, Solver(), np.zeros(system.size), plate)
    assert answer.converged
    return system, plate, answer


def disturbed(system, state, place):
    """State with the node nearest to a place moved, and its pressure changed if it has one."""
    node = np.argmin(np.linalg.norm(system.elements.nodes - place, axis=1))
    u, p = state.u.copy(), state.p.copy()
    u[node] += np.where(system.free[node], 0.02, 0.0)
    p[system.corner_nodes == node] += 0.01
    return system.admissible(system.unknowns(u, p, system.motion(state.q)))


PLACES = ((-1.0, 0.5, 0.5), (0.33, 0.33, TOP), (-1.0, 1.0, TOP), (0.0, 0.33, 0.5), (0.5, 0.0, 0.67))


@pytest.mark.parametrize("place", PLACES, ids=["side", "glued", "corner", "core", "mirror"])
def test_a_patch_goes_back_to_the_balance_of_the_whole(pressed, place):
    system, plate, answer = pressed
    state = disturbed(system, answer.state, place)
    part = nonlinear_elimination.find_patch(system, state, system.assemble(state, plate, tangent=False), plate)
    assert part.system.size < system.size / 4
    local = newton.newton(part.system, Solver(), part.q, part.plate)
    assert local.converged
    assert np.allclose(part.merge_into(system, state, local.state), answer.state.q, rtol=0, atol=1e-7)


def test_a_patch_at_rest_is_the_state_it_was_cut_from(pressed):
    system, plate, answer = pressed
    state = disturbed(system, answer.state, PLACES[0])
    part = nonlinear_elimination.find_patch(system, state, system.assemble(state, plate, tangent=False), plate)
    assert np.array_equal(part.merge_into(system, state, part.system.state(part.q)), state.q)


def test_relaxing_does_not_change_where_newtons_method_ends(pressed, monkeypatch):
    system, plate, answer = pressed
    patches, real = [], newton.find_patch

    def counted(*given):
        patches.append(real(*given))
        return patches[-1]

    monkeypatch.setattr(newton, "find_patch", counted)
    # after any step, and any residual counts as that of a few nodes
    monkeypatch.setattr(newton, "keeps_factorisation", lambda *given: False)
    monkeypatch.setattr(nonlinear_elimination, "SHARE", 0.05)
    farther = replace(plate, shear=2.5 * plate.shear)
    again = newton.newton(system, Solver(), answer.state.q, farther)
    assert any(part is not None for part in patches)
    monkeypatch.setattr(newton, "find_patch", lambda *given: None)
    plain = newton.newton(system, Solver(), answer.state.q, farther)
    assert again.converged
    assert plain.converged
    assert np.allclose(again.state.q, plain.state.q, rtol=0, atol=1e-7)


def test_a_residual_on_many_nodes_has_no_patch(pressed):
    system, plate, answer = pressed
    state = system.admissible(0.9 * answer.state.q)
    assert nonlinear_elimination.find_patch(system, state, system.assemble(state, None, tangent=False), plate) is None


def test_friction_small_bodies_and_sections_have_no_patch(pressed, monkeypatch):
    system, plate, answer = pressed
    state = disturbed(system, answer.state, PLACES[0])
    assembly = system.assemble(state, plate, tangent=False)
    rubbing = replace(plate, friction=at_rest(0.5, system.surface.weights.shape))
    assert nonlinear_elimination.find_patch(system, state, assembly, rubbing) is None
    monkeypatch.setattr(nonlinear_elimination, "LEAST_SIZE", system.size + 1)
    assert nonlinear_elimination.find_patch(system, state, assembly, plate) is None
    monkeypatch.setattr(nonlinear_elimination, "LEAST_SIZE", 0)
    flat = symmetry_models.section(Design().shape.scaled(1 / 8), 0.4998, "ignored", 0.3, 0.3).system
    rest = flat.state(np.zeros(flat.size))
    assert nonlinear_elimination.find_patch(flat, rest, flat.assemble(rest, None), plate) is None
