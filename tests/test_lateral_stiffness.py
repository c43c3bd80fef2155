"""Lateral stiffness of a pressed beam: a cantilever's at rest, a column's under load."""

import math

import numpy as np
import pytest

from analytic import buckling
from fem.accuracy import QUICK
from fem.analyses import stability
from fem.model.symmetry_models import MeshSpecification
from fem.results.lateral_stiffness import SidewaysModel
from fem.solve.direct_solver import Stability
from fem.solve.press import solve_press
from geometry.design import Design

BEAM = Design(L=40.0)


SECTION = MeshSpecification(BEAM.shape.scaled(1 / BEAM.D), BEAM.nu, "ignored", 0.16, 0.08, rim=(0.14, 0.003))


@pytest.fixture
def sideways():
    return SidewaysModel(SECTION.build())


def press(depth):
    state, stop = solve_press(SECTION, depth)
    assert not stop
    return state


def test_at_rest_it_is_that_of_a_cantilever(sideways):
    """The force acts at the centre of the dome's surface, D/4 below the top; the clamp keeps its section's shape."""
    arm = BEAM.L / BEAM.D - 0.25
    inertia, area = math.pi / 64, math.pi / 4
    shear = 0.9 * area / (2 * (1 + BEAM.nu))
    beam = 1 / (arm**3 / (3 * inertia) + arm / shear)
    assert sideways.stiffness_at_rest == pytest.approx(beam, rel=0.05)


def test_it_falls_like_that_of_a_column(sideways):
    """k = k_0 (1 - F / F_c), F from the path's energy: the critical load is Haringx', but for the dome."""
    rest, forces, ratios = sideways.stiffness_at_rest, [], []
    for depth in (0.04, 0.05):
        before, state = press(depth - 1e-4), press(depth + 1e-4)
        forces.append((state.energy - before.energy) / 2e-4)
        ratios.append(sideways.measure(state)[0] / rest)
    critical = forces[0] + ratios[0] * (forces[1] - forces[0]) / (ratios[0] - ratios[1])
    assert critical == pytest.approx(buckling.haringx(BEAM) / (BEAM.E * BEAM.D**2), rel=0.5 / (BEAM.L / BEAM.D))
    np.testing.assert_allclose(ratios, 1 - np.array(forces) / critical, atol=0.03)


def test_it_changes_sign_where_an_unstable_direction_appears(sideways):
    found = [sideways.measure(press(depth)) for depth in (0.05, 0.08)]
    assert [stability for _, stability in found] == [Stability(0), Stability(1)]
    assert found[0][0] > 0 > found[1][0]


@pytest.mark.parametrize("share", [0.75, 1.05])
def test_one_state_tells_the_critical_depth(sideways, share):
    critical = stability.critical(BEAM, "ignored", accuracy=QUICK, estimate=False).depth
    near = sideways.margin(press(share * critical / BEAM.D))
    assert near.critical_depth * BEAM.D == pytest.approx(critical, rel=0.05)
    assert (near.ratio < 0) is (share > 1) is near.stability.is_unstable


def test_far_from_giving_way_nothing_is_said_of_a_critical_depth(sideways):
    near = sideways.margin(press(0.01))
    assert near.critical_depth is None
    assert 0.5 < near.ratio < 1
