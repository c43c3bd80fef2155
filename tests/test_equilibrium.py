"""Whole solves: similarity, limits, agreement of the models, statuses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson

from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import solve, trace
from fem.model.symmetry_models import MeshSpecification
from fem.solve.path_state import with_harmonics
from fem.solve.press import solve_press
from geometry.design import BadInput, Design, paper
from geometry.loads import Load

ROUGH = replace(QUICK, solid_size=0.17)


def normal(solution):
    return solution.response.force[2]


def test_force_is_proportional_to_E_and_the_pose_independent_of_it():
    soft, stiff = (solve(Design(E=E), Load(depth=1.0), QUICK) for E in (1e-3, 1e3))
    assert normal(stiff) == pytest.approx(1e6 * normal(soft), rel=1e-9)
    assert stiff.response.shift == pytest.approx(soft.response.shift, rel=1e-9)
    assert stiff.response.contact_radius == pytest.approx(soft.response.contact_radius, rel=1e-9)


@pytest.mark.parametrize("factor", [1 / 8, 50 / 8])
def test_similar_designs_under_similar_loads(factor):
    small = paper()
    names = ("D", "L", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    large = replace(small, **{name: factor * getattr(small, name) for name in names}, l0=factor * small.l0)
    one, other = solve(small, Load(depth=1.0), QUICK), solve(large, Load(depth=factor), QUICK)
    assert normal(other) == pytest.approx(factor**2 * normal(one), rel=1e-9)
    assert other.response.shift[2] == pytest.approx(factor * one.response.shift[2], rel=1e-9)


@pytest.mark.parametrize("depth", [1e-9, 1e-6, 1e-3])
def test_hertz_at_small_depth(depth):
    """F = 4/3 E / (1 - nu^2) sqrt(R) d^1.5; the body's own compliance takes 1 % at a micrometre."""
    design = paper()
    solution = solve(design, Load(depth=depth), STANDARD, magnet="ignored")
    hertz = 4 / 3 * design.E / (1 - design.nu**2) * math.sqrt(design.R) * depth**1.5
    assert solution.status == "ok"
    assert normal(solution) == pytest.approx(hertz, rel=0.012)
    assert solution.response.contact_radius == pytest.approx(math.sqrt(design.R * depth), rel=0.08)


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_force_is_the_derivative_of_the_stored_energy(magnet):
    step = 0.01
    low, middle, high = trace(
        paper(), [Load(depth=d) for d in (1 - step, 1.0, 1 + step)], QUICK, magnet=magnet, estimate=False
    )
    assert (high.energy - low.energy) / (2 * step) == pytest.approx(normal(middle), rel=2e-3)


def test_refinement_moves_the_force_by_less_than_the_estimate():
    for magnet in ("rigid", "ignored"):
        coarse = solve(paper(), Load(depth=1.5), QUICK, magnet=magnet)
        fine = solve(paper(), Load(depth=1.5), STANDARD, magnet=magnet)
        assert abs(normal(coarse) / normal(fine) - 1) < 0.02
        assert coarse.estimates.force is not None
        assert 0 < coarse.estimates.force < 0.05


@pytest.mark.parametrize(("magnet", "size"), [("rigid", 0.135), ("ignored", 0.17)])
def test_half_model_agrees_with_axisymmetric(magnet, size):
    load = Load(depth=1.0)
    solid = trace(paper(), [load], replace(QUICK, solid_size=size), magnet=magnet, model="half", estimate=False)[0]
    section = solve(paper(), load, STANDARD, magnet=magnet)
    assert normal(solid) == pytest.approx(normal(section), rel=0.01)
    assert solid.response.shift[2] == pytest.approx(section.response.shift[2], rel=0.01)
    assert abs(solid.response.tilt) < math.radians(0.05)


def test_sticking_shear_pushes_and_tilts_towards_the_motion():
    design = paper()
    loads = [Load(depth=1.0, shear_x=s, friction="stick") for s in (0.0, 0.2)]
    still, sheared = trace(design, loads, ROUGH, magnet="ignored", model="half", estimate=False)
    fx, _, fz = sheared.response.force
    assert 0.4 * 0.2 < fx < 1.0 * 0.2
    assert fz == pytest.approx(normal(still), rel=0.02)
    assert 0.05 < sheared.response.shift[0] < 0.2
    assert 0.005 < sheared.response.tilt < 0.05


def test_shear_direction_only_turns_the_answer():
    design = paper()
    along, across, between = (
        solve(design, load, ROUGH).response
        for load in (
            Load(shear_x=0.5, grip=2.0),
            Load(shear_y=0.5, grip=2.0),
            Load(shear_x=-0.3, shear_y=0.4, grip=2.0),
        )
    )
    force, tilt = along.force[0], along.tilt
    assert (across.force[0], across.shift[0], across.tilt) == (0, 0, 0)
    np.testing.assert_allclose(across.force[:2], (0, force), atol=1e-9)
    np.testing.assert_allclose(between.force[:2], (-0.6 * force, 0.8 * force), atol=1e-9)
    np.testing.assert_allclose((across.tilt, across.tilt_y), (0, tilt), atol=1e-9)
    np.testing.assert_allclose((between.tilt, between.tilt_y), (-0.6 * tilt, 0.8 * tilt), atol=1e-9)


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_a_press_is_an_equilibrium_of_any_number_of_harmonics(magnet):
    shape = paper().shape.scaled(1 / 8)
    section = MeshSpecification(shape, 0.4998, magnet, 0.12, 0.06)
    (state, stop), high = solve_press(section, 0.1), replace(section, harmonics=3).build()
    assert not stop
    raised = with_harmonics(state, high)
    here = high.system.assemble(high.system.state(raised.q), raised.plate)
    there = state.d.system.assemble(state.d.system.state(state.q), state.plate)
    assert here.energy == pytest.approx(there.energy, rel=1e-12)
    assert np.abs(here.residual).max() < 2 * np.abs(there.residual).max() + 1e-12 * np.abs(there.forces).max()


def test_harmonics_converge():
    two, three, four = (
        solve(paper(), Load(shear_x=2.0, grip=2.0), replace(QUICK, harmonics=n)).response.force[0] for n in (2, 3, 4)
    )
    assert abs(three - four) < 0.3 * abs(two - three) < 0.003 * three


@pytest.mark.parametrize(
    ("load", "size", "patch"),
    [(Load(shear_x=1.0, grip=2.0), 0.3, 0.07), (Load(depth=1.0, shear_x=0.5, friction="stick"), 0.2, 0.035)],
)
def test_the_half_model_shears_like_the_harmonic_one(load, size, patch):
    """Nearly independent models: both hold the same patch of skin, whose edge both meshes follow."""
    rough = replace(QUICK, solid_size=size, solid_patch=patch)
    half = trace(paper(), [load], rough, model="half", estimate=False)[0].response
    section = trace(paper(), [load], rough, model="harmonic", estimate=False)[0].response
    assert half.force[0] == pytest.approx(section.force[0], rel=0.02)
    assert half.shift[0] == pytest.approx(section.shift[0], rel=0.02)
    assert half.tilt == pytest.approx(section.tilt, rel=0.02)


def test_work_of_a_sticking_shear_is_stored():
    """The glued plate moves sideways only: its force times its way is the energy, by Simpson's rule."""
    way = np.linspace(0, 1, 9)
    loads = [Load(depth=1.0, shear_x=s, friction="stick") for s in way]
    states = trace(paper(), loads, QUICK, estimate=False)
    force = [state.response.force[0] for state in states]
    assert simpson(force, x=way) == pytest.approx(states[-1].energy - states[0].energy, rel=1e-4)


def test_a_tilted_plate_is_a_turned_flat_one_for_a_ball_of_silicone():
    """All models of a tilted plate; the force leans with the plate."""
    load = Load(depth=0.5, plate_tilt=0.2)
    coarse = replace(QUICK, solid_size=0.25, solid_patch=0.1)
    half, full, harmonic = (
        trace(paper(), [load], coarse, magnet="ignored", model=model, estimate=False)[0].response
        for model in ("half", "full", "harmonic")
    )
    np.testing.assert_allclose(half.force, full.force, atol=0.05 * half.force[2])
    np.testing.assert_allclose(half.force, harmonic.force, atol=0.02 * half.force[2])
    assert half.force[0] < 0
    assert half.force[0] / half.force[2] == pytest.approx(-math.tan(0.2), rel=1e-6)


def test_a_solve_that_cannot_go_on_keeps_what_it_reached():
    solutions = trace(paper(), [Load(depth=d) for d in (1.0, 6.9)], QUICK, estimate=False)
    assert [s.status for s in solutions] == ["ok", "not_converged"]
    last = solutions[-1]
    assert 1.0 < last.load.depth < 6.9
    assert f"{last.load.depth:.4g} mm" in last.message
    assert normal(last) > normal(solutions[0])
    assert np.isfinite(last.field.u).all()


def test_a_patch_too_small_for_the_solid_mesh_is_never_a_silent_zero():
    solution = solve(paper(), Load(depth=1e-9), ROUGH, magnet="ignored", model="half")
    assert solution.status == "no_contact"
    assert "axisymmetric" in solution.message


def test_zero_depth_is_zero_force():
    solution = solve(paper(), Load(), QUICK)
    assert solution.status == "ok"
    assert solution.response.force == (0.0, 0.0, 0.0)


def test_frictionless_plate_slides():
    solution = solve(paper(), Load(depth=0.5, shear_x=1.0), QUICK)
    assert solution.response.force[0] == 0
    assert "slides" in solution.message


def test_a_rigid_magnet_needs_a_magnet():
    bare = Design(magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)
    with pytest.raises(BadInput, match="no magnet"):
        solve(bare, Load(depth=1.0), QUICK)
    assert solve(bare, Load(depth=1.0), QUICK, magnet="ignored").status == "ok"


LAWS = [
    {"law": "mooney-rivlin", "mooney_share": 0.4},
    {"law": "yeoh", "yeoh_2": 0.3, "yeoh_3": 0.1},
    {"law": "ogden", "ogden_alpha1": 6.0, "ogden_alpha2": -3.0, "ogden_share": 0.4},
]


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law["law"])
def test_a_press_with_each_law(law):
    """It converges, is proportional to E, conserves energy, and is neo-Hookean at first touch but not deep down."""
    path = [Load(depth=depth) for depth in (1.495, 1.5, 1.505)]
    soft, stiff = (trace(Design(E=E, **law), path, QUICK, magnet="ignored", estimate=False) for E in (1.0, 1e3))
    low, one, high = soft
    assert one.status == "ok"
    assert (high.energy - low.energy) / 0.01 == pytest.approx(normal(one), rel=2e-3)
    assert normal(stiff[1]) == pytest.approx(1e3 * normal(one), rel=1e-9)
    # the strain at first touch is about sqrt(depth / R) = 2e-5
    for depth, bound in ((1e-9, (0, 1e-5)), (1.5, (1e-3, 1))):
        forces = [
            normal(trace(design, [Load(depth=depth)], QUICK, magnet="ignored", estimate=False)[0])
            for design in (Design(**law), paper())
        ]
        assert bound[0] <= abs(forces[0] / forces[1] - 1) < bound[1]


@pytest.mark.parametrize("law", ["mooney-rivlin", "yeoh", "ogden"])
def test_each_law_is_neo_hookean_by_default(law):
    one, other = (solve(Design(law=name), Load(depth=1.0), QUICK) for name in (law, "neo-hookean"))
    assert normal(one) == pytest.approx(normal(other), rel=1e-9)


def test_shear_of_the_half_model_with_ogdens_law():
    load = Load(depth=1.0, shear_x=0.3, friction="stick")
    design = Design(law="ogden", ogden_alpha1=3.0, ogden_share=0.3)
    found = trace(design, [load], ROUGH, estimate=False)[0]
    assert found.status == "ok"
    assert 0 < found.response.force[0] < found.response.force[2]


def test_a_press_that_gives_way_sideways_is_called_unstable():
    """L/D = 4 buckles at once; the half model follows the tip, the axisymmetric one holds it on the axis."""
    slender, load = Design(L=32.0), Load(depth=2.5)
    solid = trace(slender, [load], replace(QUICK, solid_size=0.45), magnet="ignored", model="half", estimate=False)[0]
    assert solid.status == "unstable"
    assert "depth" in solid.message or abs(solid.response.tilt) > 0.01
    section = solve(slender, load, QUICK, magnet="ignored")
    assert section.status == "unstable"
    assert "sideways" in section.message
    assert not solve(paper(), Load(depth=2.0), QUICK).message


def test_a_small_grip_is_held_like_a_disc_on_a_half_space():
    """Its compliance (2 - nu) / (8 G a) lies beside one of the beam, which grips of two sizes share."""
    design, grips, shear = paper(), (1e-3, 4e-3), 0.01
    forces = [
        solve(design, Load(grip=grip, shear_x=shear), QUICK, magnet="ignored").response.force[0] for grip in grips
    ]
    G = design.E / (2 * (1 + design.nu))
    discs = [(2 - design.nu) / (8 * G * math.sqrt(grip * design.D)) for grip in grips]
    assert shear / forces[0] - shear / forces[1] == pytest.approx(discs[0] - discs[1], rel=0.03)


def test_stick_without_shear_says_that_the_press_is_frictionless():
    assert "frictionless" in solve(paper(), Load(depth=0.5, friction="stick"), QUICK).message


def test_a_press_of_a_nanometre_has_estimates_and_no_tilt():
    state = solve(paper(), Load(depth=1e-9), QUICK)
    assert 0 < state.estimates.force < 0.1
    assert 0 < state.estimates.shift < 0.1
    assert state.estimates.tilt is None
    assert state.estimates.sideways is None


def test_the_radius_of_a_sheared_patch_starts_from_that_of_the_press():
    loads = [Load(depth=1.5, shear_x=x, friction="stick") for x in (0.0, 0.01, 1.0)]
    pressed, sheared, far = (s.response.contact_radius for s in trace(paper(), loads, QUICK, estimate=False))
    assert sheared == pytest.approx(pressed, rel=0.02)
    assert far == pytest.approx(pressed, rel=0.1)
