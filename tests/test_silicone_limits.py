"""Limits of the silicone: stability of the laws against differences of their energies, and the largest strain."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem import equilibrium
from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import solve
from fem.model import elements
from fem.model.material import evaluate, law
from fem.results import silicone_limits
from fem.results.postprocess import read
from fem.results.silicone_limits import VOLUME_SHARE, largest_eigenvalue, largest_strain
from fem.scene import Scene
from fem.solve.load_case_models import path_models
from fem.solve.load_stepping import Path
from geometry.design import paper
from geometry.loads import Load
from studies.simulation import law_regression as work
from studies.simulation.law_regression import nominal_stress

SOFT = replace(paper(), law="yeoh", yeoh_2=-5.0)


@pytest.mark.parametrize(
    ("name", "numbers"), [("mooney-rivlin", (0.4,)), ("yeoh", (-0.3, 0.1)), ("ogden", (5.0, -3.0, 0.3))]
)
def test_stiffness_is_the_second_derivative_of_the_energy(name, numbers):
    silicone, h, step = law(name, numbers), np.array([0.3, 0.05, -0.35]), 1e-3
    ways = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0], [0.2, 0.5, -0.7]])

    def energy(at):
        return evaluate(silicone, np.diag(np.expm1(at)))[0]

    _, D = silicone_limits.stress_and_stiffness(silicone, h[None])
    for way in ways:
        bent = (energy(h + step * way) - 2 * energy(h) + energy(h - step * way)) / step**2
        assert way @ D[0] @ way == pytest.approx(bent, rel=1e-5)
        assert silicone_limits.least_stiffness(D)[0] <= bent / (way @ way) * (1 + 1e-5)


def test_a_yeoh_law_is_lost_where_its_energy_in_uniaxial_stretch_bends_down():
    """W = mu/2 (x + c x^2) has W'' = 0 by h somewhere before x = -1 / (2 c), where the stress vanishes."""
    silicone = law("yeoh", (-0.2, 0.0))
    h = np.linspace(0, 0.7, 2001)
    x = np.exp(2 * h) + 2 * np.exp(-h) - 3
    bent = np.gradient(np.gradient((x - 0.2 * x**2) / 2, h), h)
    way = h[:, None] * np.array([1.0, -0.5, -0.5])
    least = silicone_limits.least_stiffness(silicone_limits.stress_and_stiffness(silicone, way)[1])
    end = h[np.argmax(least <= 0)]
    assert end <= h[np.argmax(bent < 0)] + 1e-3
    assert 0 < np.exp(2 * end) + 2 * np.exp(-end) - 3 < 2.5


@pytest.mark.parametrize(("depth", "lost"), [(0.05, False), (0.16, True)])
def test_a_solve_that_stops_short_blames_its_law_only_where_it_is_lost(depth, lost):
    load = Load(depth=depth)
    scene = Scene(SOFT, (load,), QUICK)
    path = Path(path_models(scene))
    reached = path.advance(path.rest, scene.position(load))
    assert not reached.stop
    state = read(reached.state, scene, load, "no_convergence")
    assert state.status == "not_converged"
    assert ("the law yeoh with yeoh_2 = -5, yeoh_3 = 0 loses stability" in state.message) is lost
    assert ("another accuracy" in state.message) is not lost


@pytest.mark.parametrize(("depth", "lost"), [(0.13, False), (0.16, True)])
def test_a_good_state_says_where_it_is_beyond_its_law(depth, lost):
    """At 0.13 mm the law would be lost a tenth further on, which is no matter of a good state."""
    state = equilibrium.solve(SOFT, Load(depth=depth), accuracy=QUICK)
    assert state.status == "ok"
    assert (state.facts.weak_at is not None) is lost
    assert ("loses stability (Drucker) at principal stretches of 1.05, 1.05, 0.899" in state.message) is lost


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("neo-hookean", ()),
        ("mooney-rivlin", (0.3,)),
        ("mooney-rivlin", (1.0,)),
        ("yeoh", (0.0, 0.0)),
        ("yeoh", (0.2, 0.1)),
        ("yeoh", (-0.02, 0.0)),
        ("yeoh", (0.2, -0.01)),
        ("ogden", (0.5, -0.1, 0.5)),
        ("ogden", (12.0, -8.0, 0.3)),
    ],
)
def test_laws_that_are_called_always_stable_are_so_at_large_strains(name, numbers):
    silicone = law(name, numbers)
    h = np.random.default_rng(0).uniform(-2, 2, (2000, 3))
    _, D = silicone_limits.stress_and_stiffness(silicone, h - h.mean(axis=1, keepdims=True))
    stable = (silicone_limits.least_stiffness(D) > 0).all()
    assert silicone_limits.always_stable(silicone) == stable


def cube(n=2):
    mesh = skfem.MeshTet.init_tensor(*(np.linspace(0, 1, n + 1),) * 3)
    return elements.build(skfem.MeshTet2.from_mesh(mesh), axisymmetric=False)


def test_eigenvalues_are_those_of_a_decomposition():
    F = np.eye(3)[:, :, None] + np.random.default_rng(5).normal(size=(3, 3, 1000)) * np.logspace(-6, 0, 1000)
    exact = np.linalg.svd(np.moveaxis(F, -1, 0), compute_uv=False)[:, 0] ** 2
    assert largest_eigenvalue(F) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("F", [np.diag([1.3, 0.9, 0.8]), np.diag([1.3, 1.3, 0.6]), np.diag([0.7, 0.7, 0.7])])
def test_a_uniform_stretch_has_its_own_strain(F):
    e = cube()
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    u = e.nodes @ (turn @ F - np.eye(3)).T
    assert largest_strain(e, u) == pytest.approx(F.max() - 1, abs=1e-8)


def test_a_tenth_of_a_percent_of_the_volume_may_be_beyond():
    """Under u_x = x^2 / 2 the strain of the cube is x, and the share s of the volume stays below s."""
    e = cube(8)
    u = np.zeros_like(e.nodes)
    u[:, 0] = e.nodes[:, 0] ** 2 / 2
    assert largest_strain(e, u) == pytest.approx(VOLUME_SHARE, abs=0.02)


def test_the_strain_of_a_press_hardly_depends_on_the_mesh_or_on_the_model():
    load = Load(depth=1.0)
    quick, standard = (solve(paper(), load, accuracy) for accuracy in (QUICK, STANDARD))
    harmonic = solve(paper(), load, QUICK, model="harmonic")
    strains = [state.facts.largest_strain for state in (quick, harmonic)]
    assert strains == pytest.approx([standard.facts.largest_strain] * 2, rel=0.02)


# Where laws are stable in homogeneous stretches, and the stretches that solves come to.


def test_stability_ends_where_the_nominal_stress_of_a_softening_law_is_largest():
    numbers = (-0.08, 0.0)
    stretch = np.linspace(1, 4, 30001)
    peak = stretch[np.argmax(nominal_stress("yeoh", numbers, stretch))]
    low, high = work.ranges("yeoh", numbers)["uniaxial"]
    assert 0.98 * peak < high <= peak
    assert 0.3 < low < 1


@pytest.mark.parametrize("stretch", [[1.0, 2.0], [0.6, 1.0], [0.8, 1.5], [1.5, 5.0]])
def test_in_every_mode_principal_stretches_stay_within_those_of_the_test(stretch):
    test = np.array(stretch)
    had = np.concatenate([test, test**-0.5, [1.0]])
    found = work.ranges_of_test(test)
    for mode, strains in work.MODES.items():
        for end in found[mode]:
            principal = end ** np.array(strains)
            assert had.min() * (1 - 1e-12) <= principal.min()
            assert principal.max() <= had.max() * (1 + 1e-12)
            # and one of them is at its end
            assert min(abs(principal.min() / had.min() - 1), abs(principal.max() / had.max() - 1)) < 1e-12
    low, high = found["uniaxial"]
    assert low <= min(stretch) * (1 + 1e-12)
    assert high >= max(stretch) * (1 - 1e-12)
