"""Estimates of the errors and their rules: known cases, versions, and bounds."""

import functools
import math
from dataclasses import astuple, replace
from typing import get_args

import numpy as np
import pytest

from fem.accuracy import FINE, LEVELS, QUICK, STANDARD
from fem.equilibrium import solve
from fem.model import single_order, symmetry_models
from fem.model.gradient_recovery import build_recovery
from fem.model.symmetry_models import MeshSpecification
from fem.physics_version import PHYSICS
from fem.results.error_estimates import (
    VibrationQuantity,
    error_rule,
    error_rules,
    estimate_response,
    load_case,
    relative_error,
    table_rows,
)
from fem.scene import Scene
from fem.solve import load_increments
from fem.solve.direct_solver import Solver
from fem.solve.path_state import PastState, about, at_rest, glue, with_harmonics
from fem.solve.press import solve_press
from geometry.design import Design, paper
from geometry.loads import Load, Magnet, Response
from studies.validation import error_study_cases


def test_the_error_estimate_never_vanishes():
    """Not even where an answer and its companion happen to agree."""
    r = Response((0.0, 0.0, 3.0), (0.0, 0.0, -0.5), 0.01, 1.5)
    load = Load(depth=1.0)
    for magnet in ("rigid", "ignored"):
        found = estimate_response(
            r, r, load, Scene(paper(), (load,), STANDARD, magnet, "axisymmetric"), "axisymmetric"
        )
        assert min(found.force, found.shift, found.tilt) > 1e-4


def test_the_force_along_the_shear_has_an_estimate_of_its_own():
    """Whichever way the shear points, all of the force of a grip, and None where nothing moves sideways."""

    def estimated(force, other, load):
        one, two = (Response(f, (0.1, 0.0, -0.5), 0.01, 1.5) for f in (force, other))
        return estimate_response(one, two, load, Scene(paper(), (load,), STANDARD, "rigid", "harmonic"), "harmonic")

    along = Load(depth=1.0, shear_x=1.0, friction="stick")
    across = Load(depth=1.0, shear_y=-1.0, friction="stick")
    found = estimated((0.5, 0.0, 3.0), (0.52, 0.0, 3.001), along)
    assert found.sideways > 2 * found.force
    turned = estimated((0.0, -0.5, 3.0), (0.0, -0.52, 3.001), across)
    assert turned.sideways == pytest.approx(found.sideways, rel=1e-12)
    assert estimated((0.5, 0.0, 3.0), (0.54, 0.0, 3.001), along).sideways > found.sideways
    grip = estimated((0.5, 0.0, 0.0), (0.52, 0.0, 0.0), Load(grip=2.0, shear_x=1.0))
    assert grip.sideways == grip.force
    assert estimated((0.0, 0.0, 3.0), (0.0, 0.0, 3.001), Load(depth=1.0)).sideways is None
    assert estimated((0.0, 0.0, 3.0), (0.0, 0.0, 3.001), Load(depth=1.0, shear_x=1.0)).sideways is None


def test_with_friction_a_small_force_along_the_shear_is_less_sure():
    load = Load(depth=1.0, shear_x=0.1, friction=0.4)
    small, large = (
        estimate_response(r, r, load, Scene(paper(), (load,), STANDARD, "rigid", "harmonic"), "harmonic").sideways
        for r in (Response((x, 0.0, 3.0), (0.1, 0.0, -0.5), 0.01, 1.5) for x in (0.01, 1.0))
    )
    assert small > 5 * large


def test_a_tilt_that_is_noise_has_no_estimate():
    """Of tetrahedra, under a press that is upright; that of a tilted plate has one."""
    one = Response((0.0, 0.0, 3.0), (0.0, 0.0, -0.5), 1e-4, 1.5)
    other = replace(one, tilt=-2e-3)
    for load, known in ((Load(depth=1.0), False), (Load(depth=1.0, plate_tilt=0.01), True)):
        tilt = estimate_response(one, other, load, Scene(paper(), (load,), STANDARD, "rigid", "half"), "half").tilt
        assert (tilt is not None) is known


def test_a_single_harmonic_is_held_against_two():
    load = Load(depth=1.5, shear_x=2.0, friction="stick")
    rough = solve(paper(), load, replace(QUICK, harmonics=1))
    better = solve(paper(), load, replace(QUICK, harmonics=3))
    off = math.dist(rough.response.force, better.response.force) / math.hypot(*better.response.force)
    assert off > 0.01
    assert rough.estimates.force > 0.8 * off


def test_the_error_estimate_grows_with_the_difference_to_the_companion():
    load = Load(depth=1.0, shear_x=1.0, friction="stick")
    r = Response((1.0, 0.0, 3.0), (0.5, 0.0, -0.5), 0.2, 1.5)

    def found(difference):
        other = replace(
            r, force=(1.0 + difference, 0.0, 3.0), shift=(0.5 + difference, 0.0, -0.5), tilt=0.2 + difference
        )
        return estimate_response(r, other, load, Scene(paper(), (load,), STANDARD, "rigid", "harmonic"), "harmonic")

    large, middle, small = (astuple(found(difference))[:4] for difference in (0.1, 0.01, 1e-3))
    assert all(more > less for more, less in zip(large, middle, strict=True))
    assert max(small) < 0.01


def test_estimates_grow_beyond_the_loads_of_the_study():
    def found(depth, shear=0.0):
        load = Load(depth=depth, shear_x=shear, friction="stick" if shear else "none")
        r = Response(force=(1.0, 0.0, 4.0), shift=(0.4, 0.0, -0.3), tilt=0.1, contact_radius=2.0)
        return estimate_response(r, r, load, Scene(paper(), (load,), STANDARD, "rigid", "harmonic"), "harmonic")

    assert found(0.8) == found(0.5)
    assert found(2.9) == found(1.0)
    assert found(3.6).force == pytest.approx((3.6 / 2.97) ** 1.5 * found(2.9).force)
    assert found(0.5, 9.6).tilt == pytest.approx(2 * found(0.5, 4.8).tilt)


def test_deep_presses_and_far_shears_have_rules_of_their_own():
    def cases(loads):
        return [load_case(load, Scene(paper(), (load,), model="harmonic")) for load in loads]

    assert cases(Load(depth=depth) for depth in (0.9, 0.92)) == ["press", "deep"]
    sheared = (Load(depth=0.5, shear_x=0.6 * far, shear_y=0.8 * far, friction="stick") for far in (1.2, 1.3))
    assert cases(sheared) == ["stick", "far"]
    assert cases([Load(grip=1.0, shear_x=3.0)]) == ["grip"]


def test_a_press_has_another_rule_on_the_path_of_a_shear_with_friction_and_on_tetrahedra():
    """Its mesh is fine where the contact ends if the path shears, and with tetrahedra only then."""
    press, shear = Load(depth=1.0, friction="stick"), Load(depth=1.0, shear_x=1.0, friction="stick")
    assert load_case(press, Scene(paper(), (press, shear), model="harmonic")) == "pressed"
    rubbed = Load(depth=1.0, friction=0.3)
    assert load_case(rubbed, Scene(paper(), (rubbed,), model="axisymmetric")) == "friction"
    assert load_case(press, Scene(paper(), (press,), model="half")) == "solid press"
    assert load_case(press, Scene(paper(), (press, shear), model="half")) == "solid"
    tilted = Load(depth=1.0, plate_tilt=0.1)
    assert load_case(tilted, Scene(paper(), (tilted,), model="half")) == "solid"


def test_a_companion_that_leans_to_the_other_side_is_mirrored():
    load = Load(depth=1.0, imperfection=1e-3)
    one = Response(force=(0.0, 0.0, 4.0), shift=(0.4, 0.0, -0.3), tilt=0.1, contact_radius=2.0)
    other = Response(force=(0.0, 0.0, 4.0), shift=(-0.4, 0.0, -0.3), tilt=-0.1, contact_radius=2.0)
    same, mirrored = (
        estimate_response(one, r, load, Scene(paper(), (load,), STANDARD, "rigid", "harmonic"), "harmonic")
        for r in (one, other)
    )
    assert mirrored == same


@pytest.mark.parametrize(
    ("number", "magnet", "depth", "found", "coarse", "true"),
    [
        (0, "ignored", 2.0, (8.42575, -0.85236, 2.628), (8.41940, -0.85238, 2.676), (8.38048, -0.85524)),
        (3, "ignored", 1.167, (3.25127, -0.45332, 1.587), (3.24124, -0.45325, 1.588), (3.21502, -0.45551)),
        (7, "rigid", 0.2466, (0.390869, -0.0671266, 0.858), (0.381743, -0.0654515, 0.917), (0.384845, -0.0663385)),
        (7, "rigid", 0.6165, (1.47379, -0.248258, 1.343), (1.47422, -0.247875, 1.245), (1.45908, -0.246871)),
        (3, "rigid", 0.1914, (0.304747, -0.0201656, 0.706), (0.313971, -0.0206897, 0.700), (0.306050, -0.0206130)),
    ],
)
def test_estimates_of_a_press_on_tetrahedra_hold_where_its_companion_agrees(
    number, magnet, depth, found, coarse, true
):
    """Force, shift and contact radius of meshes at level quick, and what a fine section gives."""
    design, load = error_study_cases.designs()[number], Load(depth=depth)
    one, other = (Response((0.0, 0.0, f), (0.0, 0.0, w), 0.0, a) for f, w, a in (found, coarse))
    estimates = estimate_response(one, other, load, Scene(design, (load,), QUICK, magnet, "half"), "half")
    assert estimates.force > abs(found[0] / true[0] - 1)
    assert estimates.shift > abs(found[1] / true[1] - 1)


def test_estimates_of_a_shear_on_tetrahedra_hold_where_its_companion_agrees():
    """The paper's sensor at level quick by the worst of eight meshes sideways, as if another gave the very same."""
    load = Load(depth=0.8, shear_x=1.2, friction="stick")
    one = Response((0.69691, 0.0, 2.74601), (0.48058, 0.0, -0.21109), 0.097607, 1.90)
    true = Response((0.69338, 0.0, 2.72850), (0.48171, 0.0, -0.21189), 0.097661, 1.94)
    estimates = estimate_response(one, one, load, Scene(paper(), (load,), QUICK, "rigid", "half"), "half")
    assert estimates.sideways > one.force[0] / true.force[0] - 1


PRESSES = ("press", "deep", "pressed", "solid press", "tilted press")
NUMBERS = {
    "critical": ("depth", "force"),
    "small shear": ("stiffness", "shift", "tilt"),
    "modes": ("frequency", "pressed frequency"),
}


WORDS = "press deep pressed stick far grip friction solid"
CASES = (*WORDS.split(), "tilted press", "tilted stick", "tilted friction", "solid press")


def test_every_kind_of_load_and_every_number_has_a_rule_with_and_without_magnet():
    """Loads that shear have a rule for the force along the shear too, and presses have none."""
    quantities = {case: ("force", "shift", "tilt", *(["sideways"] * (case not in PRESSES))) for case in CASES}
    static = {
        (scene, m, name)
        for scene, names in (quantities | NUMBERS).items()
        for m in get_args(Magnet)
        for name in names
    }
    shears = {("vibrating shear", way, name) for way in "xz" for name in ("force", "shift", "reading")}
    presses = {("vibrating press", way, name) for way in "xz" for name in get_args(VibrationQuantity)}
    assert set(error_rules()) == static | shears | presses
    assert len(table_rows()) == len(error_rules())


def test_rules_rest_on_the_answers_of_today():
    assert {row["model"] for row in table_rows()} == set(PHYSICS) - {"full", "cycle"}
    assert all(error_rules().values())


@pytest.fixture
def changed_modes(monkeypatch):
    """A version of the natural frequencies on which no rule rests."""
    error_rules.cache_clear()
    monkeypatch.setitem(PHYSICS, "modes", PHYSICS["modes"] + 1)
    yield
    error_rules.cache_clear()


def test_rules_of_another_version_of_the_answers_are_none(changed_modes):
    unknown = {key for key, rule in error_rules().items() if rule is None}
    assert unknown == {key for key in error_rules() if key[0] == "modes"}


def test_errors_fall_with_the_edge_length():
    """A rule whose error grew on a finer mesh would be a slip of the pen."""
    for rule in error_rules().values():
        assert rule.usual(0.045, 0.2) < rule.usual(0.09, 0.2)
        assert min(rule.m, rule.p, rule.c) > 0
        assert 0 <= rule.s <= 1


def test_a_vector_that_is_known_in_part_has_no_estimate():
    rule = error_rule("press", "rigid", "force")
    assert relative_error(rule, (1.0, 2.0), (1.0, 2.1), 0.05, 1.0) > 0
    for value, coarse in (
        ((1.0, None), (None, 2.1)),
        ((1.0, None), (1.0, None)),
        ((None,), (2.0,)),
        ((1.0,), (None,)),
    ):
        assert relative_error(rule, value, coarse, 0.05, 1.0) is None


# First guesses of increments: exact for curves of the second degree, and none around a corner.


REST = at_rest(
    MeshSpecification(paper().shape.without_magnet().scaled(1 / 8), 0.4998, "ignored", 0.25, 0.125).build()
)
RNG = np.random.default_rng(6)
CURVE = RNG.normal(size=(3, len(REST.q)))


def curve(depth):
    """Unknowns that are quadratic in the depth."""
    return CURVE[0] + CURVE[1] * depth + CURVE[2] * depth**2


def at(depth, shear=0.0):
    return np.array([depth, shear, 0.0])


def after(*depths):
    """A state that has passed some depths; its skin's overlap grows with the depth alone."""
    *past, present = depths
    before = tuple(PastState(at(d), curve(d), d - 0.15 + np.zeros(REST.skin.weights.shape)) for d in past)
    return replace(REST, position=at(present), q=curve(present), past=before)


@pytest.mark.parametrize(("depths", "exact"), [((0.1, 0.13, 0.2), True), ((0.13, 0.2), False), ((0.2,), False)])
def test_two_past_states_extrapolate_what_is_quadratic(depths, exact):
    error = np.abs(load_increments.extrapolate_unknowns(after(*depths), at(0.27)) - curve(0.27)).max()
    assert bool(error < 1e-12) is exact


@pytest.mark.parametrize(("direction", "kept"), [(at(1), 2), (at(-1), 0), (at(0, 1), 0), (at(0.98, 0.2), 0)])
def test_a_past_that_does_not_lead_ahead_is_forgotten(direction, kept):
    state = replace(after(0.1, 0.15, 0.2), direction=at(1))
    assert len(load_increments.turn(state, direction).past) == kept
    assert len(state.past) == 2


def test_contact_is_expected_where_the_gap_closes():
    """A plate that has come nearer by 0.1 in the last increment comes nearer by 0.05 in one half as long."""
    state = replace(after(0.2), q=np.zeros_like(REST.q))
    present = state.overlap
    state = replace(state, past=(PastState(at(0.1), state.q, present - 0.1),))
    np.testing.assert_array_equal(load_increments.extrapolate_contact(state, at(0.25)), present > -0.05)


def test_at_first_touch_contact_is_where_half_the_depth_cuts_the_dome():
    height = REST.skin.points[..., 2].max()
    expected = load_increments.extrapolate_contact(REST, at(0.2))
    np.testing.assert_array_equal(expected, REST.skin.points[..., 2] >= REST.d.shape.L - 0.1)
    assert expected.any()
    assert height <= REST.d.shape.L


# The blocks of single orders against the whole tangent of a section with harmonics, and the pose they give.


HARMONICS, EDGE = 2, 0.14
SHAPE = Design().shape.scaled(1 / 8)


def eigenvalues(state):
    """Eigenvalues of the tangent of a state whose contact area is glued."""
    glued = glue(state, EDGE)
    upper = glued.d.system.assemble(glued.d.system.state(glued.q), glued.plate).tangent.toarray()
    return np.linalg.eigvalsh(upper, UPLO="U")


@functools.cache
def press(magnet):
    """State of a press, and a model with harmonics on its mesh."""
    section = MeshSpecification(SHAPE, 0.4998, magnet, 0.25, 0.1, rim=(EDGE, 0.03))
    return solve_press(section, 0.1)[0], replace(section, harmonics=HARMONICS).build()


def test_eigenvalues_of_all_orders_are_those_of_the_whole_tangent():
    low, high = press("ignored")
    blocks = [eigenvalues(low)]
    blocks += [eigenvalues(about(low, single_order.build(low.d, order))) for order in range(1, HARMONICS + 1)]
    whole = eigenvalues(with_harmonics(low, high))
    np.testing.assert_allclose(np.sort(np.concatenate(blocks)), whole, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_a_sideways_push_moves_the_dome_as_in_the_whole_model(magnet):
    low, high = press(magnet)
    moved, negative = [], []
    for state in (about(low, single_order.build(low.d, 1)), with_harmonics(low, high)):
        system, push = state.d.system, np.zeros(state.d.system.size)
        nodal = symmetry_models.distribute_push(state.skin, system.fixed.shape, SHAPE.H, 1.0)
        push[: system.n_free] = nodal[system.free]
        solver = Solver()
        solver.factorise(system.assemble(system.state(state.q), state.plate).tangent)
        moved.append(push @ solver.solve(push))
        negative.append(solver.stability(system.n_pressure).directions)
    assert moved[0] == pytest.approx(moved[1], rel=1e-9)
    assert negative == [0, 0]


def test_raised_fields_are_those_of_one_harmonic():
    low, _ = press("ignored")
    state = about(low, single_order.build(low.d, 1))
    shift = np.zeros(state.u.shape)
    shift[:, 2] = 0.5  # w_-1 alone is a displacement along x
    harmonic = MeshSpecification(SHAPE, 0.4998, "ignored", 0.25, 0.1, rim=(EDGE, 0.03), harmonics=1).build()
    displacement, gradient = build_recovery(harmonic.elements, SHAPE.H, mirrored=True)(
        single_order.raise_fields(shift)
    )
    np.testing.assert_allclose(displacement, [0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(gradient, np.zeros((3, 3)), atol=1e-10)


# Accuracy levels and that of the companion.


SIZES = ("section_size", "solid_size", "section_patch", "solid_patch")


def test_each_level_is_finer_than_the_one_before():
    assert list(LEVELS.values()) == [QUICK, STANDARD, FINE]
    for rough, fine in ((QUICK, STANDARD), (STANDARD, FINE)):
        assert all(getattr(fine, size) < getattr(rough, size) for size in SIZES)
        assert fine.harmonics > rough.harmonics
