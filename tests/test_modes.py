"""Natural frequencies against beam theory, and by invariants."""

import math
from dataclasses import replace

import numpy as np
import pytest
import skfem
from conftest import ROUGH
from scipy.optimize import brentq

from analytic.oscillator import receptance, spring_mass
from fem.accuracy import QUICK, STANDARD
from fem.analyses import modes
from fem.model import angular_fields, elements
from fem.model.nonlinear_system import System
from fem.model.symmetry_models import on_axis
from fem.results.error_estimates import error_rule, relative_error
from fem.scene import Scene
from fem.solve.newton import NoStateError
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from geometry.relaxation import lame
from geometry.section import section

NU = 0.4998


def cylinder(length, angles):
    """A clamped cylinder of diameter 1 with a flat end."""
    mesh = skfem.MeshTri.init_tensor(np.linspace(0, 0.5, 4), np.linspace(0, length, 6 * length + 1))
    e = elements.build(skfem.MeshTri2.from_mesh(mesh), axisymmetric=True, angles=angles)
    fixed = np.repeat(e.nodes[:, 1:] < 1e-9, angles.fields, axis=1)
    still = np.array([True, True, False]) if angles.fields == 3 else ~on_axis(angles.harmonics)
    fixed[np.ix_(e.nodes[:, 0] < 1e-9, still)] = True
    return System(e, None, lame(1.0, NU), fixed)


def frequencies(system, count):
    """Angular frequencies for E = density = 1."""
    zero = system.state(np.zeros(system.size))
    values, _ = modes.eigen(system.assemble(zero, None).tangent, system.mass(1.0), count)
    return np.sqrt(values)


def test_axial_and_torsional_modes_of_a_slender_cylinder_are_those_of_a_rod():
    axial = frequencies(cylinder(20, angular_fields.fourier_fields(0)), 2)
    both = frequencies(cylinder(20, angular_fields.torsion_fields()), 5)
    for k in (1, 2):
        quarter = (2 * k - 1) * math.pi / 40
        assert axial[k - 1] == pytest.approx(quarter, rel=0.01)
        assert np.abs(both / (quarter / math.sqrt(2 * (1 + NU))) - 1).min() < 1e-3
        assert np.abs(both / axial[k - 1] - 1).min() < 1e-9


@pytest.mark.parametrize("depth", [0.0, 1.0])
def test_frequencies_grow_as_the_root_of_the_modulus(depth):
    one, four = (modes.modes(Design(E=E), count=6, depth=depth, accuracy=ROUGH, estimate=False) for E in (1.0, 4.0))
    np.testing.assert_allclose(four.frequency, 2 * np.array(one.frequency), rtol=1e-6)
    assert one.shape[:3] == ("bending", "torsion", "axial")


@pytest.mark.parametrize("count", [0, 1000])
def test_counts_that_mean_nothing(count):
    with pytest.raises(BadInput, match="count"):
        modes.modes(paper(), count=count)


@pytest.mark.parametrize("count", [1, 2])
def test_an_unstable_press_has_no_modes_however_few_are_asked_for(count):
    """The inertia tells it: the negative eigenvalue is not among the few that are nearest to zero."""
    with pytest.raises(NoStateError, match=r"the state at depth 7\.921 mm is unstable: take a smaller depth"):
        modes.modes(replace(paper(), L=32.0), count=count, depth=7.921, accuracy=QUICK, estimate=False)


def test_every_frequency_has_an_error_that_holds_against_a_finer_mesh():
    finer = replace(STANDARD, section_size=0.05, section_patch=0.003)
    one = modes.modes(paper(), count=6, depth=0.5, accuracy=QUICK)
    truth = modes.modes(paper(), count=6, depth=0.5, accuracy=finer, estimate=False)
    assert one.shape == truth.shape
    for value, true, error in zip(one.frequency, truth.frequency, one.estimates, strict=True):
        assert abs(value / true - 1) <= error < 0.02


def test_companions_are_paired_by_shape():
    unpressed = Scene(paper(), (Load(),))
    one = modes.Modes((1.0, 2.0, 3.0, 4.0), ("bending", "torsion", "bending", "axial"), (None,) * 4)
    other = modes.Modes((1.1, 2.2, 3.3, 5.0), ("bending", "bending", "torsion", "ovalling"), (None,) * 4)
    found = modes.estimate_frequencies(one, other, unpressed)
    rule = error_rule("modes", "rigid", "frequency")
    pairs = [(1.0, 1.1), (2.0, 3.3), (3.0, 2.2)]
    assert found[:3] == tuple(relative_error(rule, (a,), (b,), STANDARD.section_size, 1.0) for a, b in pairs)
    assert found[3] is None


ROUNDED = Design(D=10.0, L=13.0, l0=13.0, f=10.0, magnet_diameter=5.0, magnet_height=3.0, magnet_edge_radius=0.6)
"""A sensor whose magnet loses 4 % of its cylinder to its rounded edges."""


def meshed_magnet():
    """Volume of the meshed magnet over D^3, and its moments across and along the axis over D^5, revolved."""
    shape = ROUNDED.shape.scaled(1 / ROUNDED.D)
    mesh = section(shape, 0.03, magnet="meshed")
    basis = skfem.Basis(mesh, skfem.ElementTriP2(), elements=mesh.subdomains["magnet"], intorder=8)
    r, z = np.asarray(basis.global_coordinates())
    weights = 2 * math.pi * r * basis.dx
    return weights.sum(), (weights * (r**2 / 2 + (z - shape.H) ** 2)).sum(), (weights * r**2).sum()


def test_the_rounded_magnet_has_the_mass_and_the_inertia_of_its_mesh():
    m, across, along = modes.inertia_of_magnet(Scene(ROUNDED, (Load(),)))[[2, 3, 5]]
    ratio = ROUNDED.magnet_density / ROUNDED.density
    np.testing.assert_allclose((m, across, along), ratio * np.array(meshed_magnet()), rtol=1e-5)
    light = replace(ROUNDED, magnet_density=ROUNDED.density)
    silicone = math.pi * light.R**2 * (light.H + 2 / 3 * light.R)
    k = 1e3 * light.E * math.pi * light.R**2 / light.L
    alone, with_magnet = spring_mass(light)
    # the silicone in the edge of the magnet counts a third, as all silicone does
    heavier = (k / (2 * math.pi * with_magnet) ** 2 - k / (2 * math.pi * alone) ** 2) / (light.density * 1e-9)
    assert heavier == pytest.approx(2 / 3 * meshed_magnet()[0] * light.D**3, rel=1e-5)
    assert k / (2 * math.pi * alone) ** 2 == pytest.approx(light.density * 1e-9 * silicone / 3, rel=1e-12)


# One mass on one spring in closed form.


def test_a_slow_load_moves_the_mass_by_force_over_stiffness_and_damping_makes_it_lag():
    assert receptance(1e-6, 970.0)[()] == pytest.approx(1.0, rel=1e-15)
    phases = np.angle(receptance(np.array([10.0, 99.0, 101.0, 500.0]), 100.0, 1.2 + 0.1j))
    assert np.all((phases < 0) & (phases > -math.pi))


@pytest.mark.parametrize("loss", [0.001, 0.01])
def test_the_half_power_width_over_the_frequency_is_the_loss_factor(loss):
    def excess(f):
        return abs(receptance(f, 100.0, 1 + 1j * loss)) ** 2 - 0.5 / loss**2

    width = brentq(excess, 100.0, 110.0) - brentq(excess, 90.0, 100.0)
    assert width / 100.0 == pytest.approx(loss, rel=loss**2)


def test_a_press_below_rounding_has_no_mesh_and_says_so(run):
    status, _, err = run("modes", "paper", "--depth", "1e-300", "--accuracy", "quick")
    assert status == 2
    assert "the depth must be more than 1e-14 D, the rounding of lengths; got 1.25e-301 D" in err
