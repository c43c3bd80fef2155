"""Lateral stiffness of a pressed beam: a cantilever's at rest, a column's under load."""

import math

import numpy as np
import pytest

from analytic import buckling
from fem.accuracy import QUICK
from fem.analyses import stability
from fem.model.symmetry_models import MeshSpecification
from fem.results.lateral_stiffness import SidewaysModel, estimate_margin, measure_lateral_stiffness
from fem.solve.direct_solver import Stability
from fem.solve.load_stepping import Path
from fem.solve.path_state import at_rest
from geometry.design import Design

BEAM = Design(L=40.0)


@pytest.fixture
def path():
    shape = BEAM.shape.scaled(1 / BEAM.D)
    return Path(at_rest(MeshSpecification(shape, BEAM.nu, "ignored", 0.16, 0.08, rim=(0.14, 0.003)).build()))


@pytest.fixture
def sideways(path):
    return SidewaysModel(path.state.d)


def test_at_rest_it_is_that_of_a_cantilever(sideways):
    """The force acts at the centre of the dome's surface, D/4 below the top; the clamp keeps its section's shape."""
    arm = BEAM.L / BEAM.D - 0.25
    inertia, area = math.pi / 64, math.pi / 4
    shear = 0.9 * area / (2 * (1 + BEAM.nu))
    beam = 1 / (arm**3 / (3 * inertia) + arm / shear)
    assert sideways.stiffness_at_rest == pytest.approx(beam, rel=0.05)


def test_it_falls_like_that_of_a_column(path, sideways):
    """k = k_0 (1 - F / F_c), F from the path's energy: the critical load is Haringx', but for the dome."""
    rest, forces, ratios = sideways.stiffness_at_rest, [], []
    for depth in (0.04, 0.05):
        path.go(depth - 1e-4, np.zeros(2))
        before = path.state.energy
        path.go(depth + 1e-4, np.zeros(2))
        forces.append((path.state.energy - before) / 2e-4)
        ratios.append(measure_lateral_stiffness(sideways, path.state).stiffness / rest)
    critical = forces[0] + ratios[0] * (forces[1] - forces[0]) / (ratios[0] - ratios[1])
    assert critical == pytest.approx(buckling.haringx(BEAM) / (BEAM.E * BEAM.D**2), rel=0.5 / (BEAM.L / BEAM.D))
    np.testing.assert_allclose(ratios, 1 - np.array(forces) / critical, atol=0.03)


def test_it_changes_sign_where_an_unstable_direction_appears(path, sideways):
    found = []
    for depth in (0.05, 0.08):
        assert not path.go(depth, np.zeros(2))
        found.append(measure_lateral_stiffness(sideways, path.state))
    assert [state.stability for state in found] == [Stability(0), Stability(1)]
    assert found[0].stiffness > 0 > found[1].stiffness


def test_a_guided_tip_is_stiffer(path, sideways):
    path.go(0.05, np.zeros(2))
    assert (
        measure_lateral_stiffness(sideways, path.state, guided=True).stiffness
        > 10 * measure_lateral_stiffness(sideways, path.state).stiffness
    )


@pytest.mark.parametrize("share", [0.75, 0.95, 1.05])
def test_one_state_tells_the_critical_depth(path, sideways, share):
    critical = stability.critical(BEAM, "ignored", accuracy=QUICK, estimate=False).depth
    path.go(share * critical / BEAM.D, np.zeros(2))
    near = estimate_margin(sideways, path.state)
    assert near.critical_depth * BEAM.D == pytest.approx(critical, rel=0.05)
    assert (near.ratio < 0) is (share > 1) is near.stability.is_unstable


def test_far_from_giving_way_nothing_is_said_of_a_critical_depth(path, sideways):
    path.go(0.01, np.zeros(2))
    near = estimate_margin(sideways, path.state)
    assert near.critical_depth is None
    assert 0.5 < near.ratio < 1
