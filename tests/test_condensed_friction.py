"""Coulomb friction settled within each step of Newton's method: the equilibria are those of plain steps."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.model import plate_contact
from fem.model.symmetry_models import MeshSpecification
from fem.solve import load_increments
from fem.solve.condensed_friction import CondensedFriction, contact_zone
from fem.solve.direct_solver import STABLE, UNKNOWN, Solver, have_pardiso
from fem.solve.newton import Equilibrium, iterate, newton
from fem.solve.path_state import at_rest
from geometry.design import paper
from geometry.loads import Load

ROUGH = replace(QUICK, name="rough", section_size=0.2, harmonics=1)
WAY = [Load(depth=1.0, friction=0.4), *(Load(depth=1.0, shear_x=x, friction=0.4) for x in (0.4, 2.0, -1.0))]


def never(contact, q, **options):
    """No condensed problem is solved."""
    state = contact.system.state(q)
    return Equilibrium(state, contact.system.assemble(state, None), 0, "no_convergence")


def settled_steps(system, solver, q, plate, pressed, keeps_long=False):
    return iterate(CondensedFriction(system, solver, plate, pressed, keeps_long=keeps_long), q)


def forces(loads):
    states = trace(paper(), loads, ROUGH, magnet="ignored", estimate=False)
    assert [state.status for state in states] == ["ok"] * len(loads)
    return states


def test_a_path_to_and_fro_ends_in_the_states_of_plain_steps_after_fewer_iterations(monkeypatch):
    settled = forces(WAY)
    monkeypatch.setattr(load_increments, "iterate", never)
    plain = forces(WAY)
    for a, b in zip(settled, plain, strict=True):
        np.testing.assert_allclose(a.response.force, b.response.force, rtol=1e-8, atol=1e-9)
        assert a.dissipated == pytest.approx(b.dissipated, rel=1e-7, abs=1e-12)
        assert a.slip_share == pytest.approx(b.slip_share, abs=1e-9)
    assert sum(a.newton_iterations for a in settled) < 0.7 * sum(b.newton_iterations for b in plain)


def rest(mu):
    """A coarse section at rest under a plate with friction, and the plate after a press and a shear of 0.02 D."""
    d = MeshSpecification(paper().shape.scaled(0.1), 0.4998, "ignored", 0.25, 0.1, harmonics=1).build()
    state = at_rest(d, mu=mu)
    return state, state.plate_at(np.array([0.02, 0.02, 0.0]))


def pressed_first(state, plate):
    return plate_contact.overlap(state.skin, 0 * state.u, plate) > 0


@pytest.mark.parametrize("pardiso", sorted({False, have_pardiso()}))
@pytest.mark.parametrize("mu", [0.05, 50.0])
def test_both_libraries_find_the_equilibrium_of_plain_steps_and_its_stability(pardiso, mu):
    state, plate = rest(mu)
    own, plain = Solver(pardiso=pardiso), Solver(pardiso=pardiso)
    answer = settled_steps(state.d.system, own, state.q, plate, pressed_first(state, plate))
    other = newton(state.d.system, plain, state.q, plate, pressed_first(state, plate))
    assert answer.converged
    assert other.converged
    np.testing.assert_allclose(answer.state.q, other.state.q, atol=1e-8 * np.abs(other.state.q).max())
    # where all points stick the stiffness is symmetric, and its unstable directions are counted
    assert answer.stability == other.stability == (STABLE if mu == 50.0 else UNKNOWN)


def test_the_zone_goes_beyond_the_contact_on_both_sides():
    state, plate = rest(0.5)
    touching = pressed_first(state, plate).any(axis=1)
    facets = [int(contact_zone(state.d.system, touching, rings=n).facets.sum()) for n in (0, 1, 2)]
    # the contact ends at the axis on its inner side
    assert facets == [touching.sum(), touching.sum() + 1, touching.sum() + 2]


def test_the_condensed_residual_has_the_derivative_that_its_iteration_uses():
    state, plate = rest(0.3)
    rng = np.random.default_rng(2)
    zone = contact_zone(state.d.system, pressed_first(state, plate).any(axis=1))
    here, u = zone.restrict(plate), 1e-3 * rng.normal(size=(len(zone.nodes), state.u.shape[1]))
    y, way = np.zeros(len(zone.unknowns)), rng.normal(size=len(zone.unknowns))
    K = zone.stiffness(zone.springs(u, y, here), here)
    h = 1e-9
    ahead, behind = (zone.forces(zone.springs(u, y + s * h * way, here)) for s in (1, -1))
    np.testing.assert_allclose((ahead - behind) / (2 * h), K @ way, atol=1e-5 * np.abs(K @ way).max())


def touching(state, q, held):
    return plate_contact.overlap(state.skin, state.d.system.state(q).u, held) > 0


def test_friction_keeps_the_stiffness_of_an_earlier_state():
    d = MeshSpecification(paper().shape.scaled(0.1), 0.4998, "ignored", 0.25, 0.1, harmonics=1).build()
    state, solver = at_rest(d, mu=0.3), Solver()
    system, q = d.system, state.q
    condensed = []
    for shear in (0.02, 0.021):
        held = state.plate_at(np.array([0.02, shear, 0.0]))
        near = settled_steps(system, solver, q, held, touching(state, q, held), keeps_long=True)
        exact = settled_steps(system, Solver(), q, held, touching(state, q, held))
        np.testing.assert_allclose(near.state.q, exact.state.q, atol=1e-8 * np.abs(exact.state.q).max())
        condensed.append(solver.schur)
        q = exact.state.q
    assert condensed[0] is condensed[1]
