"""Sideways stability of a press."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROUGH

from analytic import buckling
from fem.accuracy import QUICK, STANDARD
from fem.analyses import stability
from fem.equilibrium import solve, trace
from fem.model import element_assembly
from fem.model.symmetry_models import MeshSpecification
from fem.results.lateral_stiffness import SidewaysModel
from fem.scene import Scene
from fem.solution import UNKNOWN, Estimates, Stability
from fem.solve.active_set import ActiveSet, KeptTangent
from fem.solve.direct_solver import Solver
from fem.solve.load_stepping import Path, PathModels
from fem.solve.path_state import about
from fem.solve.press import solve_press
from geometry.design import Design, paper
from geometry.loads import Load


@pytest.mark.parametrize("L", [40.0, 80.0])
def test_a_slender_beam_gives_way_near_haringx_load(L):
    """Shortening and the dome shift it by a few per cent, less so for the longer beam."""
    beam = Design(L=L)
    found = stability.critical(beam, "ignored", accuracy=QUICK, deepest=0.1 * L, estimate=False)
    assert found.force == pytest.approx(buckling.haringx(beam), rel=0.5 / (L / beam.D))
    assert (1 - 1e-2) * found.depth < found.stable_to <= found.depth
    assert found.estimates == Estimates()


def test_an_unknown_stability_is_no_stable_one(monkeypatch):
    """Beyond the onset the lateral stiffness is negative, which tells without a count; before it nothing does."""
    monkeypatch.setattr(Solver, "stability", lambda self, pressures: UNKNOWN)
    found = stability.critical(Design(L=32.0), "ignored", accuracy=QUICK)
    assert (found.depth, found.stable_to) == (None, 0.0)
    assert found.message.startswith("the press is stable up to 0 mm; beyond, its stability is unknown")


def test_a_stubby_beam_is_stable():
    found = stability.critical(
        Design(L=5.0, magnet_diameter=0, magnet_height=0, magnet_edge_radius=0),
        "ignored",
        accuracy=QUICK,
        deepest=0.8,
        estimate=False,
    )
    assert found.depth is None
    assert found.stable_to == pytest.approx(0.8)


def scaled(design, length, modulus):
    """The design with all lengths and the modulus multiplied."""
    names = ("D", "L", "l0", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    return replace(design, E=modulus * design.E, **{name: length * getattr(design, name) for name in names})


def test_a_critical_state_and_its_errors_scale_with_size_and_modulus():
    beam = Design(L=24.0)
    one, other = (stability.critical(b, "ignored", accuracy=ROUGH) for b in (beam, scaled(beam, 0.5, 3.0)))
    assert other.depth == pytest.approx(0.5 * one.depth, rel=1e-6)
    assert other.force == pytest.approx(0.75 * one.force, rel=1e-6)
    assert other.estimates.depth == pytest.approx(one.estimates.depth, rel=1e-3)
    assert other.estimates.force == pytest.approx(one.estimates.force, rel=1e-3)


def test_critical_depths_do_not_depend_on_the_mesh_and_estimates_hold():
    beam, finer = Design(L=16.0), replace(STANDARD, section_size=0.06, section_patch=0.004)
    one = stability.critical(beam, "ignored", accuracy=QUICK)
    usual, truth = (stability.critical(beam, "ignored", accuracy=a, estimate=False) for a in (STANDARD, finer))
    assert abs(one.depth / truth.depth - 1) <= one.estimates.depth < 0.03
    assert abs(one.force / truth.force - 1) <= one.estimates.force < 0.03
    assert usual.depth == pytest.approx(truth.depth, rel=0.004)
    assert usual.force == pytest.approx(truth.force, rel=0.006)


def test_a_companion_without_an_instability_estimates_nothing():
    one, other = stability.Critical(1.0, 2.0, 1.0, ""), stability.Critical(None, None, 3.0, "")
    scene = Scene(paper(), (Load(depth=1.0),))
    assert stability.estimate_critical(one, other, scene) == Estimates()
    assert stability.estimate_critical(one, replace(one, depth=1.01), scene).depth > 0


# Lateral stiffness of a pressed beam: that of a cantilever at rest, that of a column under load.


BEAM = Design(L=40.0)


SECTION = MeshSpecification(BEAM.shape.scaled(1 / BEAM.D), BEAM.nu, "ignored", 0.16, 0.08, rim=(0.14, 0.003))


@pytest.fixture(scope="module")
def critical():
    return stability.critical(BEAM, "ignored", accuracy=QUICK, estimate=False).depth


@pytest.fixture(scope="module")
def sideways():
    return SidewaysModel(SECTION.build(), SECTION.size)


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


@pytest.mark.parametrize("share", [0.75, 1.15])
def test_one_state_tells_the_critical_depth(sideways, critical, share):
    near = sideways.margin(press(share * critical / BEAM.D))
    assert near.critical_depth * BEAM.D == pytest.approx(critical, rel=0.05)
    assert (near.ratio < 0) is (share > 1) is near.stability.is_unstable


SHORT = replace(paper(), L=16.0, l0=13.2)
CRITICAL = 1.5033
"""Critical depth of the paper's sensor with L = 16 mm, by `stability.critical` at level standard, mm."""


def test_a_tangent_of_one_order_takes_the_law_at_one_angle_about_an_axisymmetric_state_only(sideways, monkeypatch):
    d = about(press(0.1), sideways.orders[0]).d
    tilted = 1e-6 * np.random.default_rng(1).standard_normal(d.system.size)
    for q in (np.zeros(d.system.size), tilted):
        state, assembled = d.system.state(q), []
        for agrees in (element_assembly._Batch.agrees, lambda *_: False):
            monkeypatch.setattr(element_assembly._Batch, "agrees", agrees)
            assembled.append(d.system.assemble(state, None))
            monkeypatch.undo()
        once, twice = assembled
        assert once.energy == pytest.approx(twice.energy, rel=1e-13)
        for found, wanted in ((once.matrix.data, twice.matrix.data), (once.residual, twice.residual)):
            np.testing.assert_allclose(found, wanted, rtol=1e-10, atol=1e-13 * np.abs(wanted).max())


def test_no_verdict_contradicts_the_critical_depth():
    """The ratio scatters: of these depths, on both sides of the critical one, the mesh does not tell all."""
    depths = [share * CRITICAL for share in (0.8, 0.95, 0.98, 1.005, 1.02, 1.04, 1.06, 1.2)]
    states = [solve(SHORT, Load(depth=depth), QUICK) for depth in depths]
    verdicts = [state.facts.verdict for state in states]
    assert (verdicts[0], verdicts[-1]) == ("stable", "unstable")
    assert "unstable" not in verdicts[:3]
    assert "stable" not in verdicts[3:]
    for state in (state for state in states if state.facts.verdict == "unknown"):
        assert state.status == "unknown"
        assert abs(state.facts.sideways_stiffness_ratio) <= state.facts.sideways_half_width
        assert "it gives way at a depth of about 1." in state.message


def test_presses_less_deep_than_one_with_room_have_a_verdict_without_a_ratio():
    """The deepest two are too near the critical depth to tell of others, 2 mm is not."""
    loads = [Load(depth) for depth in (2.6, 0.5, 2.0, 1.0, 2.5)]
    every, needed = (trace(paper(), loads, QUICK, ratios=ratios) for ratios in (True, False))
    ratios = [state.facts.sideways_stiffness_ratio for state in every]
    assert [state.facts.sideways_stiffness_ratio for state in needed] == [ratios[0], None, ratios[2], None, ratios[4]]
    for one, other in zip(every, needed, strict=True):
        assert (one.status, one.message, one.response) == (other.status, other.message, other.response)


def test_a_ratio_near_zero_tells_nothing_but_several_unstable_directions_do(sideways, critical):
    """A press at 1.01 of the critical depth is within the half width, whatever its one pivot says."""
    near = sideways.margin(press(1.01 * critical / BEAM.D))
    assert near.is_doubtful
    assert near.half_width == pytest.approx(1.4 * 0.16**0.9 * (1 - near.ratio) ** 0.75 * 0.135**0.5, rel=0.1)
    assert not replace(near, ratio=2 * near.half_width).is_doubtful
    assert not replace(near, stability=Stability(2)).is_doubtful


def test_the_returned_state_of_a_model_with_harmonics_has_its_own_verdict(critical):
    """Newton's last tangent may be that of a state on the other side of the critical depth."""
    path = Path(PathModels(replace(SECTION, harmonics=1)))
    below = path.advance(path.rest, np.array([0.9 * critical / BEAM.D, 0.0, 0.0])).state
    beyond = path.advance(below, np.array([1.15 * critical / BEAM.D, 0.0, 0.0])).state
    assert [state.stability.directions for state in (below, beyond)] == [0, 1]
    system = path.rest.d.system
    for first, last in ((below, beyond), (beyond, below)):
        contact = ActiveSet(system, KeptTangent(Solver()), last.plate, None, keeps_long=False)
        contact.factorise(system.state(first.q), system.assemble(system.state(first.q), first.plate))
        assert contact.stability == first.stability
        assert contact.final_stability(system.state(last.q)) == last.stability
