"""Whole solves: similarity, limits, agreement of the models, statuses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROUGH
from scipy.integrate import simpson

from fem.accuracy import QUICK, STANDARD
from fem.equilibrium import solve, trace
from geometry.design import Design, paper
from geometry.loads import Load


def normal(solution):
    return solution.response.force[2]


@pytest.mark.parametrize("factor", [1 / 8, 50 / 8])
def test_similar_designs_under_similar_loads_also_of_another_modulus(factor):
    small = paper()
    names = ("D", "L", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    large = replace(small, **{name: factor * getattr(small, name) for name in names}, l0=factor * small.l0)
    one, other = solve(small, Load(depth=1.0), QUICK), solve(replace(large, E=1e3), Load(depth=factor), QUICK)
    assert normal(other) == pytest.approx(1e3 * factor**2 * normal(one), rel=1e-9)
    for name in ("shift", "contact_radius"):
        expected = factor * np.array(getattr(one.response, name))
        assert getattr(other.response, name) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("magnet", "size"), [("rigid", 0.135), ("ignored", 0.17)])
def test_half_model_agrees_with_axisymmetric(magnet, size):
    load = Load(depth=1.0)
    solid = trace(paper(), [load], replace(QUICK, solid_size=size), magnet=magnet, model="half", estimate=False)[0]
    section = solve(paper(), load, STANDARD, magnet=magnet)
    assert normal(solid) == pytest.approx(normal(section), rel=0.01)
    assert solid.response.shift[2] == pytest.approx(section.response.shift[2], rel=0.01)
    assert abs(solid.response.tilt) < math.radians(0.05)


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
    assert np.isfinite(last.body.u).all()


def test_without_contact_or_friction_there_is_no_force_and_the_message_says_so():
    assert solve(paper(), Load(), QUICK).response.force == (0.0, 0.0, 0.0)
    slides = solve(paper(), Load(depth=0.5, shear_x=1.0), QUICK)
    assert (slides.response.force[0], "slides" in slides.message) == (0, True)
    assert "frictionless" in solve(paper(), Load(depth=0.5, friction="stick"), QUICK).message
    missed = solve(paper(), Load(depth=1e-9), replace(QUICK, solid_size=0.17), magnet="ignored", model="half")
    assert (missed.status, "axisymmetric" in missed.message) == ("no_contact", True)


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


def test_a_small_grip_is_held_like_a_disc_on_a_half_space():
    """Its compliance (2 - nu) / (8 G a) lies beside one of the beam, which grips of two sizes share."""
    design, grips, shear = paper(), (1e-3, 4e-3), 0.01
    forces = [
        solve(design, Load(grip=grip, shear_x=shear), QUICK, magnet="ignored").response.force[0] for grip in grips
    ]
    G = design.E / (2 * (1 + design.nu))
    discs = [(2 - design.nu) / (8 * G * math.sqrt(grip * design.D)) for grip in grips]
    assert shear / forces[0] - shear / forces[1] == pytest.approx(discs[0] - discs[1], rel=0.03)


SLENDER = Design(L=24.0)
CRITICAL_N = 1.311
LEVEL = replace(QUICK, section_size=0.16)


# A press beyond its critical depth, to the side that a dead force picks.


@pytest.fixture(scope="module")
def leaning():
    loads = [Load(depth=d, imperfection=2e-3) for d in (0.3, 1.0, 1.6)]
    return trace(SLENDER, loads, LEVEL, magnet="ignored", estimate=False)


def test_the_buckled_branch_is_followed_to_the_side_of_the_push_and_its_force_hardly_grows(leaning):
    assert [(state.status, state.model) for state in leaning] == [("ok", "harmonic")] * 3
    assert [state.facts.remark for state in leaning] == [None, "leaning", "leaning"]
    assert "imperfection of 0.002 N" in leaning[-1].message
    shifts = [state.response.shift[0] for state in leaning]
    assert 0 < shifts[0] < 0.06
    assert shifts[2] > 3.0
    assert leaning[2].response.tilt > 0.3
    assert leaning[2].response.force[2] == pytest.approx(CRITICAL_N, rel=0.07)
    straight = trace(SLENDER, [Load(depth=0.3)], LEVEL, magnet="ignored", estimate=False)[0]
    assert leaning[0].response.force[2] == pytest.approx(straight.response.force[2], rel=5e-3)


def test_the_other_side_is_the_mirror_image(leaning):
    loads = [Load(depth=d, imperfection=-2e-3) for d in (0.3, 1.0, 1.6)]
    other = trace(SLENDER, loads, LEVEL, magnet="ignored", estimate=False)[-1].response
    one = leaning[-1].response
    assert other.shift == pytest.approx((-one.shift[0], 0.0, one.shift[2]), rel=1e-6)
    assert other.force[2] == pytest.approx(one.force[2], rel=1e-6)


def test_a_long_increment_past_buckling_does_not_land_on_the_mirrored_branch():
    loads = [Load(depth=d, imperfection=2e-3) for d in (0.4, 0.8, 1.2)]
    states = trace(replace(paper(), L=24), loads, QUICK, magnet="ignored", estimate=False)
    assert all(state.response.shift[0] > 0 for state in states)
    assert states[-1].status == "ok"
