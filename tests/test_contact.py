"""Contact: Coulomb friction against limits, Mindlin and energy; steps with their contact settled."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fem import equilibrium
from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.model import coulomb_friction
from fem.model.plate_contact import KAPPA, Plate
from fem.model.symmetry_models import MeshSpecification
from fem.solve.condensed_friction import CondensedFriction
from fem.solve.load_case_models import path_models
from geometry.design import Design, paper
from geometry.loads import Load

ROUGH = replace(QUICK, name="rough", section_size=0.2, harmonics=1)


def history(rng, points, mu):
    """Points of all kinds: in and out of contact, at rest or pulled along the plate."""
    pressure = np.maximum(rng.normal(size=points), 0.0)
    way = rng.normal(size=(*points, 2))
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    traction = (mu * pressure * rng.uniform(size=points))[..., None] * way
    return coulomb_friction.Friction(mu, rng.normal(size=(*points, 2)), traction, pressure, pressure < 0)


def bare(depths_or_shears, mu, *, depth=None, level=ROUGH, magnet="ignored", model="auto"):
    """A path of presses, or of shears at one depth after a press."""
    if depth is None:
        loads = [Load(depth=d, friction=mu) for d in depths_or_shears]
    else:
        loads = [Load(depth=depth, shear_x=x, friction=mu) for x in depths_or_shears]
    return trace(paper(), loads, level, magnet=magnet, model=model, estimate=False)


def pulls(states):
    return np.array([state.response.force[0] for state in states])


def test_tractions_stay_in_the_cone_and_slip_only_dissipates():
    rng = np.random.default_rng(1)
    before = history(rng, (40, 6), 0.4)
    displacement, pressure = before.displacement + 0.1 * rng.normal(size=(40, 6, 2)), rng.normal(size=(40, 6))
    after, lost = coulomb_friction.advance(before, displacement, pressure, 5.0)
    size = np.linalg.norm(after.traction, axis=-1)
    assert (size <= 0.4 * np.maximum(pressure, 0) * (1 + 1e-12)).all()
    assert 0 < after.slipping.sum() < (pressure > 0).sum()
    assert (lost >= 0).all()
    assert lost.max() > 0
    still, nothing = coulomb_friction.advance(after, displacement, pressure, 5.0)
    np.testing.assert_allclose(still.traction, after.traction, rtol=1e-12)
    assert nothing.max() < 1e-12 * lost.max()


@pytest.mark.parametrize("harmonics", [0, 2])
def test_tangent_with_slip_is_the_derivative_of_the_residual(harmonics):
    rng = np.random.default_rng(3)
    shape = Design().shape.scaled(1 / 8)
    system = MeshSpecification(shape, 0.4998, "rigid", 0.16, 0.08, harmonics=harmonics).build().system
    points = system.surface.weights.shape
    before = history(rng, points, 0.5)
    flat = Plate(
        shape.L - 0.1, 50.0, np.array([0.02, 0.0]), friction=replace(before, displacement=0.01 * before.displacement)
    )
    x = system.elements.nodes
    wave = 0.003 * np.sin(x @ rng.normal(size=(2, system.fixed.shape[1]))) * x[:, :1] * x[:, 1:]
    q = 0.1 * rng.normal(size=system.size)
    q[: system.n_free] = wave[system.free]
    q[system.n_free : system.n_free + system.n_rigid] = 0.001
    direction, step = rng.normal(size=system.size), 1e-8
    direction[: system.n_free] *= np.broadcast_to(x[:, :1], system.fixed.shape)[system.free]
    here, ahead, behind = (system.assemble(system.state(q + s * direction), flat) for s in (0, step, -step))
    assert not here.symmetric
    slope = (ahead.residual - behind.residual) / (2 * step)
    np.testing.assert_allclose(here.tangent @ direction, slope, atol=2e-5 * np.abs(slope).max())


def test_little_friction_is_nearly_none_and_much_of_it_prevents_slip(monkeypatch):
    """On springs that are equally stiff in all of them."""
    monkeypatch.setattr(equilibrium, "path_models", lambda *of: replace(path_models(*of), kappa=KAPPA))
    none, little, some, much, more = (bare([1.0], mu, magnet="rigid")[0] for mu in ("none", 1e-6, 0.1, 1e2, 1e4))
    force = [s.response.force[2] for s in (none, little, some, much, more)]
    assert force[1] == pytest.approx(force[0], rel=1e-5)
    assert little.slip_share == 1
    assert force[0] < force[2]
    assert force[4] == pytest.approx(force[3], rel=1e-4)
    assert more.slip_share == 0
    assert more.dissipated < 0.01 * some.energy


def test_a_press_is_the_same_in_the_axisymmetric_and_the_harmonic_model():
    one, other = (bare([0.5], 0.1, model=model)[0] for model in ("axisymmetric", "harmonic"))
    assert other.response.force[2] == pytest.approx(one.response.force[2], rel=1e-6)
    assert other.dissipated == pytest.approx(one.dissipated, rel=1e-4)
    assert other.slip_share == pytest.approx(one.slip_share, abs=1e-6)
    assert abs(other.response.force[0]) < 1e-12


def test_a_cycle_closes_its_loop_whose_area_is_dissipated():
    turn = 0.3
    way = np.concatenate([turn * np.linspace(0, 1, 4)[1:], *[s * turn * np.linspace(1, -1, 9)[1:] for s in (1, -1)]])
    states = bare(way, 0.1, depth=0.5)
    force = pulls(states)
    reached, left, back = 2, 10, 18
    assert force[back] == pytest.approx(force[reached], rel=0.005)
    assert force[left] == pytest.approx(-force[reached], rel=0.005)
    loop = slice(reached, back + 1)
    area = np.trapezoid(force[loop], way[loop])
    assert states[back].dissipated - states[reached].dissipated == pytest.approx(area, rel=0.02)
    assert states[back].energy == pytest.approx(states[reached].energy, rel=0.005)


def test_press_and_release_lose_energy_but_nothing_else():
    """Nothing is left behind by a release: a second press is like the first, and costs as much again."""
    once, away, again = bare([1.0, 0.0, 1.0], 0.1, magnet="rigid")
    assert away.response.force == (0, 0, 0)
    assert away.energy < 1e-12 * once.energy
    assert again.response.force[2] == pytest.approx(once.response.force[2], rel=1e-3)
    assert 0 < once.dissipated < away.dissipated < 0.01 * once.energy
    assert again.dissipated - away.dissipated == pytest.approx(once.dissipated, rel=0.1)


def test_cattaneo_and_mindlin():
    """Tangential force and slip annulus of a sphere under a small load; the beam's own compliance is 1 % there."""
    design, mu, depth = paper(), 0.3, 1e-5
    G, nu = design.E / 2 / (1 + design.nu), design.nu
    radius = math.sqrt(design.R * depth)
    normal = 4 / 3 * design.E / (1 - nu**2) * radius * depth
    full = 3 * mu * normal * (2 - nu) / (16 * G * radius)
    states = bare(
        np.array([0.0, 0.25, 0.5, 0.75, 1.5]) * full,
        mu,
        depth=depth,
        level=replace(QUICK, section_size=0.1, harmonics=1),
    )
    for share, state in zip((0.25, 0.5, 0.75), states[1:4], strict=True):
        force = state.response.force[0] / (mu * state.response.force[2])
        assert force == pytest.approx(1 - (1 - share) ** 1.5, rel=0.03)
        # the stick circle's area; a coarse patch counts it in rings
        assert 1 - state.slip_share == pytest.approx(1 - share, abs=0.3 * (1 - share) + 0.05)
    assert states[4].slip_share == 1
    assert states[4].response.force[0] == pytest.approx(mu * states[4].response.force[2], rel=0.01)


# Coulomb friction settled within each step of Newton's method: the equilibria are those of plain steps.


WAY = [Load(depth=1.0, friction=0.4), *(Load(depth=1.0, shear_x=x, friction=0.4) for x in (0.4, 2.0, -1.0))]


def forces(loads):
    states = trace(paper(), loads, ROUGH, magnet="ignored", estimate=False)
    assert [state.status for state in states] == ["ok"] * len(loads)
    return states


def test_a_path_to_and_fro_ends_in_the_states_of_plain_steps_after_fewer_iterations(monkeypatch):
    settled = forces(WAY)
    monkeypatch.setattr(CondensedFriction, "step", lambda self, state, assembly: None)
    plain = forces(WAY)
    for a, b in zip(settled, plain, strict=True):
        np.testing.assert_allclose(a.response.force, b.response.force, rtol=1e-8, atol=1e-9)
        assert a.dissipated == pytest.approx(b.dissipated, rel=1e-7, abs=1e-12)
        assert a.slip_share == pytest.approx(b.slip_share, abs=1e-9)
    assert sum(a.newton_iterations for a in settled) < 0.7 * sum(b.newton_iterations for b in plain)
