"""A section from another one: exact for states that both contain."""

import numpy as np
import pytest

from fem.model.section_interpolation import interpolate_section
from fem.model.symmetry_models import MeshSpecification
from geometry.design import paper

SHAPE = paper().shape.scaled(1 / 8)


@pytest.fixture(scope="module")
def systems():
    """Two sections with the magnet."""
    return [MeshSpecification(SHAPE, 0.4998, "rigid", size, size / 2).build().system for size in (0.25, 0.2)]


def test_quadratic_displacements_and_a_linear_pressure_are_exact(systems):
    first, second = systems
    r, z = first.elements.nodes.T
    u, p = np.stack([r * z, z**2], axis=1), (1 - z[first.corner_nodes, None])
    state = second.state(interpolate_section(first, second, first.unknowns(u, p, np.array([SHAPE.H**2]))))
    r, z = second.elements.nodes.T
    # triangles at the clamp and at the magnet hold nodes that do not move so
    inside = (z > 0.3) & (z < 0.6) & (r > 0.42)
    assert inside.sum() > 10
    np.testing.assert_allclose(state.u[inside], np.stack([r * z, z**2], axis=1)[inside], atol=1e-9)
    np.testing.assert_allclose(state.p[:, 0], 1 - z[second.corner_nodes], atol=1e-2)
    assert second.motion(interpolate_section(first, second, first.unknowns(u, p, np.array([0.02])))) == [0.02]
