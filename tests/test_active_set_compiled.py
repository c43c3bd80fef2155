"""The compiled loop that settles the contact of a press against NumPy."""

from dataclasses import replace

import numpy as np
import pytest
from test_active_set import within

from fem.contact.plate_contact import Plate
from fem.discretisation import symmetry_models
from fem.solvers import active_set
from fem.solvers.direct_solver import Solver
from geometry import compiled
from geometry.design import paper

SHAPE = paper().shape.scaled(1 / 8)
FLAT = Plate(SHAPE.L - 0.06, 1e4, np.zeros(2))


def settled_step(magnet, radius):
    """The plain step from rest with the springs within a radius, and the settled one."""
    system = symmetry_models.section(SHAPE, 0.4998, magnet, 0.2, 0.08).system
    rest, pressed = system.admissible(np.zeros(system.size)), within(system, radius)
    solver = Solver()
    solver.factorise(system.assemble(rest, replace(FLAT, pressed=pressed)).tangent)
    assert (solver.band is not None) == compiled.available()
    step = solver.solve(system.assemble(rest, replace(FLAT, pressed=pressed)).residual)
    settled = active_set.settle_contact(system, solver, rest, step, FLAT, pressed)
    solver.close()
    return step, settled


@pytest.mark.parametrize("patience", [active_set.PATIENCE, 0])
@pytest.mark.parametrize("radius", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_the_settled_step_is_that_of_numpy(magnet, radius, patience, monkeypatch):
    monkeypatch.setattr(active_set, "PATIENCE", patience)
    step, settled = settled_step(magnet, radius)
    with compiled.uncompiled():
        plain, expected = settled_step(magnet, radius)
    assert np.abs(settled - step).max() > 1e-3 * np.abs(step).max()
    np.testing.assert_allclose(step, plain, rtol=0, atol=1e-9 * np.abs(plain).max())
    np.testing.assert_allclose(settled, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_too_many_points_leave_the_plain_step(monkeypatch):
    monkeypatch.setattr(active_set, "MOST_POINTS", 2)
    step, settled = settled_step("ignored", 0.3)
    np.testing.assert_array_equal(settled, step)
