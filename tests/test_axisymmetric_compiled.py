"""Compiled strains of axisymmetric elements, and springs of the plate against those of NumPy."""

import numpy as np
import pytest

from fem.model import axisymmetric_compiled, element_integrals, plate_contact, symmetry_models
from fem.model.plate_contact import Plate
from geometry.design import paper


def test_strains_of_a_homogeneous_deformation():
    """One element with shape functions that are linear: F = diag(1.1, 1.2, 0.9) with a shear of 0.05."""
    r, z = np.array([1.0, 2, 1, 1.5, 1.5, 1]), np.array([0.0, 0, 1, 0, 0.5, 0.5])
    D = np.zeros((1, 1, 3, 6))
    # at r = 1: u_r / r is u_r there; corners 0, 1, 2 carry the linear functions
    D[0, 0, 0, :3], D[0, 0, 1, :3], D[0, 0, 2, :3] = [-1, 1, 0], [1, 0, 0], [-1, 0, 1]
    u = np.stack([0.2 + 0.1 * (r - 1) + 0.05 * z, -0.1 * z], axis=1)
    G, Jm1, Hm1, pressure, weighted = np.zeros((9, 1)), np.zeros(1), np.zeros((9, 1)), np.zeros(1), np.zeros(1)
    least = axisymmetric_compiled.strain_points(
        np.arange(6)[None], np.arange(3)[None], D, np.full((1, 3), 1 / 3), np.full((1, 1), 2.0), u,
        np.array([1.0, 2.0, 3.0]), G, Jm1, Hm1, pressure, weighted,
    )  # fmt: skip
    F = np.array([[1.1, 0, 0.05], [0, 1.2, 0], [0, 0, 0.9]])
    np.testing.assert_allclose(G.reshape(3, 3), F - np.eye(3), atol=1e-15)
    np.testing.assert_allclose(Hm1.reshape(3, 3), np.linalg.inv(F).T - np.eye(3), atol=1e-15)
    assert [least, Jm1[0]] == pytest.approx([np.linalg.det(F) - 1] * 2)
    assert [pressure[0], weighted[0]] == pytest.approx([2.0, 4.0])


@pytest.mark.parametrize("tangent", [True, False])
@pytest.mark.parametrize("chosen", [True, False])
def test_forces_stiffness_and_energy_of_the_springs(chosen, tangent):
    shape, rng = paper().shape.without_magnet().scaled(1 / 8), np.random.default_rng(3)
    system = symmetry_models.section(shape, 0.4998, "ignored", 0.25, 0.125).system
    surface = system.surface
    # the plate cuts the tip, and some skin near the clamp lies below the base
    u = 0.02 * rng.normal(size=system.fixed.shape)
    pressed = rng.random(surface.weights.shape) < 0.3
    plate = Plate(shape.L - 0.05, 3e4, np.zeros(2), pressed=pressed if chosen else None)
    assert plate_contact.base_traction(surface, u, plate.stiffness) is not None
    expected, matrices, energy, _ = plate_contact.assemble_springs(surface, u, plate, tangent=tangent)
    k = len(surface.nodes)
    forces, data, entries = np.zeros(u.shape), np.zeros(9 * k + 1), np.arange(9 * k).reshape(k, 3, 3)
    own = axisymmetric_compiled.add_springs(
        surface.nodes, surface.shape, surface.weights, np.ascontiguousarray(surface.points[..., 2]), u, plate.height,
        plate.stiffness, chosen, pressed, forces, entries, data, tangent,
    )  # fmt: skip
    nodal = np.zeros(u.shape)
    np.add.at(nodal, surface.nodes, expected)
    np.testing.assert_allclose(forces, nodal, rtol=1e-11, atol=1e-13 * np.abs(nodal).max())
    upward = matrices[:, 3:, 3:] if tangent else np.zeros((k, 3, 3))
    np.testing.assert_allclose(data[entries], upward, rtol=1e-11, atol=1e-13 * np.abs(upward).max())
    assert own == pytest.approx(energy, rel=1e-12)


def test_largest_strains_are_those_of_the_principal_stretches():
    e = symmetry_models.section(paper().shape.scaled(1 / 8), 0.4998, "rigid", 0.2, 0.08).system.elements
    u = np.random.default_rng(4).normal(size=(len(e.nodes), 2)) * 0.02
    G = np.moveaxis(element_integrals.gradient(e, slice(None), u).reshape(3, 3, -1), -1, 0)
    stretches = np.linalg.svd(G + np.eye(3), compute_uv=False)[:, 0]
    strain = np.empty(e.weights.size)
    axisymmetric_compiled.largest_strains(e.cells, e.D, u, strain)
    np.testing.assert_allclose(strain, stretches - 1, rtol=1e-12, atol=1e-12)
