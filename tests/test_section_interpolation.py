"""Tetrahedra from a section: exact for states that both models contain."""

import numpy as np
import pytest

from fem.model import symmetry_models
from fem.model.section_interpolation import interpolate_section
from fem.model.symmetry_models import MeshSpecification
from geometry.design import paper

SHAPE = paper().shape.scaled(1 / 8)


@pytest.fixture(scope="module")
def systems():
    """A section with two harmonics and half a solid, with the magnet."""
    section = MeshSpecification(SHAPE, 0.4998, "rigid", 0.25, 0.125, harmonics=2).build()
    solid = MeshSpecification(SHAPE, 0.4998, "rigid", 0.6, 0.4, body="half").build()
    return section.system, solid.system


def test_a_rigid_motion_and_a_uniform_pressure_are_exact(systems):
    section, solid = systems
    names = symmetry_models.field_names(section.elements.angles)
    r, z = section.elements.nodes.T
    u, p = np.zeros(section.fixed.shape), np.zeros((len(section.corner_nodes), 3))
    # the magnet's motion (0.01, 0.02, angle) of all nodes that are not clamped, see `rigid_inclusion.section`
    angle, above = 0.1, z - SHAPE.H
    s, c = np.sin(angle), np.cos(angle) - 1
    u[:, names.index(("a", -1))] = 0.01 + s * above
    u[:, names.index(("a", 0))] = u[:, names.index(("a", -2))] = c * r / 2
    u[:, names.index(("z", 0))], u[:, names.index(("z", 1))], p[:, 0] = 0.02 + c * above, -s * r, 0.7
    state = solid.state(interpolate_section(section, solid, section.unknowns(u, p, np.array([0.01, 0.02, angle]))))
    x, y, z = solid.elements.nodes.T
    expected = np.stack([0.01 + s * (z - SHAPE.H) + c * x, 0 * y, 0.02 + c * (z - SHAPE.H) - s * x], axis=1)
    # triangles at the clamp hold nodes that do not move
    inside = (z > 0.3) & ~solid.fixed.any(axis=1)
    np.testing.assert_allclose(state.u[inside], expected[inside], atol=1e-9)
    np.testing.assert_allclose(state.p, 0.7, rtol=1e-9)


def test_a_press_is_the_same_in_every_plane_through_the_axis(systems):
    section, solid = systems
    names = symmetry_models.field_names(section.elements.angles)
    r, z = section.elements.nodes.T
    u = np.zeros(section.fixed.shape)
    u[:, names.index(("a", 0))], u[:, names.index(("z", 0))] = r * z, z**2
    q = section.unknowns(u, np.zeros((len(section.corner_nodes), 3)), np.zeros(3))
    state = solid.state(interpolate_section(section, solid, q))
    x, y, z = solid.elements.nodes.T
    # away from the magnet, whose surface does not move here
    inside = (z > 0.3) & (z < 0.6) & solid.free.all(axis=1) & (np.hypot(x, y) > 0.42)
    assert inside.sum() > 10
    np.testing.assert_allclose(
        state.u[inside], np.stack([x * z, y * z, z**2], axis=1)[inside], atol=1e-9, err_msg="quadratic fields"
    )
