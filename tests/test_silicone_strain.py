"""The strain that nearly all of the silicone stays below."""

from dataclasses import replace

import numpy as np
import pytest
import skfem

from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import solve, trace
from fem.model import elements
from fem.results.silicone_strain import SHARE, largest_eigenvalue, largest_strain
from geometry.design import paper
from geometry.loads import Load


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
    assert largest_strain(e, u) == pytest.approx(SHARE, abs=0.02)


def test_the_strain_of_a_press_hardly_depends_on_the_mesh_or_on_the_model():
    load = Load(depth=1.0)
    quick, standard = (solve(paper(), load, accuracy) for accuracy in (QUICK, STANDARD))
    harmonic = solve(paper(), load, QUICK, model="harmonic")
    strains = [state.facts.largest_strain for state in (quick, harmonic)]
    assert strains == pytest.approx([standard.facts.largest_strain] * 2, rel=0.02)


def test_the_strain_depends_on_shape_and_depth_over_diameter_only():
    one = solve(paper(), Load(depth=0.5), QUICK)
    stiff = solve(replace(paper(), E=3.0), Load(depth=0.5), QUICK)
    assert stiff.facts.largest_strain == pytest.approx(one.facts.largest_strain, rel=1e-9)


def test_a_shear_adds_strain():
    sheared, more = (Load(depth=0.5, shear_x=shear, friction="stick") for shear in (1.0, 2.0))
    pressed = solve(paper(), Load(depth=0.5), QUICK)
    states = [pressed, *trace(paper(), [sheared, more], QUICK)]
    strains = [state.facts.largest_strain for state in states]
    assert 0 < strains[0] < strains[1] < strains[2]
