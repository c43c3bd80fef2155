"""Stability of the laws: against differences of their own energies, and told where a solve ends by it."""

from dataclasses import replace

import numpy as np
import pytest

from fem import equilibrium
from fem.accuracy import QUICK
from fem.model.material import evaluate, law
from fem.results import material_stability
from fem.results.postprocess import read
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load

SOFT = replace(paper(), law="yeoh", yeoh_2=-5.0)


@pytest.mark.parametrize(
    ("name", "numbers"), [("mooney-rivlin", (0.4,)), ("yeoh", (-0.3, 0.1)), ("ogden", (5.0, -3.0, 0.3))]
)
def test_stiffness_is_the_second_derivative_of_the_energy(name, numbers):
    silicone, h, step = law(name, numbers), np.array([0.3, 0.05, -0.35]), 1e-3
    ways = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0], [0.2, 0.5, -0.7]])

    def energy(at):
        return evaluate(silicone, np.diag(np.expm1(at)))[0]

    _, D = material_stability.stress_and_stiffness(silicone, h[None])
    for way in ways:
        bent = (energy(h + step * way) - 2 * energy(h) + energy(h - step * way)) / step**2
        assert way @ D[0] @ way == pytest.approx(bent, rel=1e-5)
        assert material_stability.least_stiffness(D)[0] <= bent / (way @ way) * (1 + 1e-5)


def test_a_yeoh_law_is_lost_where_its_energy_in_uniaxial_stretch_bends_down():
    """W = mu/2 (x + c x^2) has W'' = 0 by h somewhere before x = -1 / (2 c), where the stress vanishes."""
    silicone = law("yeoh", (-0.2, 0.0))
    h = np.linspace(0, 0.7, 2001)
    x = np.exp(2 * h) + 2 * np.exp(-h) - 3
    bent = np.gradient(np.gradient((x - 0.2 * x**2) / 2, h), h)
    way = h[:, None] * np.array([1.0, -0.5, -0.5])
    least = material_stability.least_stiffness(material_stability.stress_and_stiffness(silicone, way)[1])
    end = h[np.argmax(least <= 0)]
    assert end <= h[np.argmax(bent < 0)] + 1e-3
    assert 0 < np.exp(2 * end) + 2 * np.exp(-end) - 3 < 2.5


@pytest.mark.parametrize(("depth", "lost"), [(0.05, False), (0.16, True)])
def test_a_solve_that_stops_short_blames_its_law_only_where_it_is_lost(depth, lost):
    load = Load(depth=depth)
    scene = Scene(SOFT, (load,), QUICK)
    path = equilibrium.start_path(scene)
    try:
        assert not path.go(depth / SOFT.D, np.zeros(2))
        state = read(path.state, scene, load, "no_convergence")
    finally:
        path.close()
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
    _, D = material_stability.stress_and_stiffness(silicone, h - h.mean(axis=1, keepdims=True))
    stable = (material_stability.least_stiffness(D) > 0).all()
    assert material_stability.always_stable(silicone) == stable


def test_what_is_always_stable_is_never_lost():
    path = equilibrium.start_path(Scene(paper(), (Load(depth=2.0),), QUICK))
    try:
        assert not path.go(2.0 / paper().D, np.zeros(2))
        assert material_stability.find_loss(path.state.d.system, path.state.u) is None
    finally:
        path.close()
