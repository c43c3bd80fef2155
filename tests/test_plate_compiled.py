"""Compiled springs of the plate against those of NumPy."""

import numpy as np
import pytest

from fem.contact import plate_contact
from fem.contact.plate_contact import Plate
from fem.discretisation import symmetry_models
from geometry import compiled
from geometry.design import paper

pytest.importorskip("numba", reason="the loop needs the extra `fast`")
SHAPE = paper().shape.without_magnet().scaled(1 / 8)


@pytest.mark.parametrize("tangent", [True, False])
@pytest.mark.parametrize("chosen", [True, False])
def test_forces_stiffness_and_energy(chosen, tangent):
    system = symmetry_models.section(SHAPE, 0.4998, "ignored", 0.25, 0.125).system
    surface, rng = system.surface, np.random.default_rng(3)
    # the plate cuts the tip, and some skin near the clamp lies below the base
    u = 0.02 * rng.normal(size=system.fixed.shape)
    pressed = rng.random(surface.weights.shape) < 0.3 if chosen else None
    plate = Plate(SHAPE.L - 0.05, 3e4, np.zeros(2), pressed=pressed)
    assert compiled.prepare()
    forces, matrices, energy, symmetric = plate_contact.assemble_springs(surface, u, plate, tangent=tangent)
    with compiled.uncompiled():
        expected = plate_contact.assemble_springs(surface, u, plate, tangent=tangent)
    assert plate_contact.base_traction(surface, u, plate.stiffness) is not None
    np.testing.assert_allclose(forces, expected[0], rtol=1e-11, atol=1e-13 * np.abs(expected[0]).max())
    np.testing.assert_allclose(matrices, expected[1], rtol=1e-11, atol=1e-13 * np.abs(expected[1]).max(initial=1))
    assert energy == pytest.approx(expected[2], rel=1e-12)
    assert symmetric is expected[3] is True
