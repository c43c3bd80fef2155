"""Shift under a given force: round trips, forces that no stable pose has, and rest."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam
from analytic.inverse import response_surface
from analytic.inverse.force_inversion import shifts_of_forces
from geometry.design import paper


@pytest.fixture(scope="module", params=["paper", "finite"])
def law(request):
    return response_surface.of_formula(lambda load: beam.solve(paper(), load, request.param), 2.0, 2.0)


def test_forces_come_back(law):
    low, high = response_surface.workspace(paper(), law)
    normal, tangential = (v.ravel() for v in np.meshgrid(np.linspace(0.5, 3, 6), np.linspace(0, 0.6, 5)))
    u, w = shifts_of_forces(law, low, high, tangential, normal)
    force, _ = response_surface.forces(law, np.stack([u, np.zeros_like(u), w]))
    assert_allclose(force[0], tangential, atol=1e-7)
    assert_allclose(force[2], normal, atol=1e-7)
    assert (w < 0).all()


def test_no_force_is_rest(law):
    low, high = response_surface.workspace(paper(), law)
    shifts = shifts_of_forces(law, low, high, np.array([0.0, 0.0]), np.array([0.0, 1.0]))
    assert_allclose(np.array(shifts)[:, 0], 0, atol=1e-9)


def test_forces_beyond_the_mechanics_have_no_shift(law):
    low, high = response_surface.workspace(paper(), law)
    u, w = shifts_of_forces(law, low, high, np.array([0.0, 50.0, 0.0]), np.array([1.0, 1.0, 500.0]))
    assert np.isfinite([u[0], w[0]]).all()
    assert np.isnan([u[1:], w[1:]]).all()
