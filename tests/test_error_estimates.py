"""Estimates of the errors and their rules: known cases, versions, and bounds."""

import functools
import math
from dataclasses import asdict, astuple, replace
from typing import get_args

import numpy as np
import pytest

from fem.accuracy import QUICK, STANDARD, coarser
from fem.equilibrium import solve, trace
from fem.model import single_order
from fem.model.symmetry_models import MeshSpecification
from fem.physics_version import PHYSICS
from fem.results.error_estimates import (
    ErrorRule,
    VibrationQuantity,
    error_rule,
    error_rules,
    estimate_response,
    estimate_state,
    load_case,
    relative_error,
    table_rows,
)
from fem.scene import Scene
from fem.solve.path_state import about, glue, with_harmonics
from fem.solve.press import solve_press
from geometry.design import Design, paper
from geometry.loads import Load, Magnet, Response

STICK, TILTED = Load(depth=1.0, shear_x=1.0, friction="stick"), Load(depth=1.0, plate_tilt=0.1)
PRESS, RUBBED = Load(depth=1.0), Load(depth=1.0, friction=0.3)


def response(along=0.0, normal=3.0, *, across=0.0, shift=0.5, tilt=0.1):
    return Response((along, across, normal), (shift, 0.0, -0.5), tilt, 1.5)


def estimated(one, other=None, load=STICK, model="harmonic", magnet="rigid"):
    """The estimates of a response whose companion has another one, or the same."""
    return estimate_response(one, other or one, load, Scene(paper(), (load,), STANDARD, magnet, model), model)


@pytest.mark.parametrize("load", [Load(depth=3.0), STICK])
def test_the_second_mesh_has_less_than_half_of_the_elements(load):
    """Also where fillets, corners and thin layers make the edges short, as in most of the mesh of level quick."""
    for level in (QUICK, STANDARD):
        fine, coarse = (
            trace(paper(), [load], accuracy, estimate=False)[0].body.mesh.nelements
            for accuracy in (level, coarser(level))
        )
        assert 0.3 * fine < coarse < 0.5 * fine


@pytest.mark.parametrize("load", [replace(PRESS, depth=2.0), STICK])
def test_the_tolerance_of_the_second_solve_decides_no_estimate(load):
    (found,), rough, scene = (
        trace(paper(), [load], QUICK, estimate=False),
        coarser(QUICK),
        Scene(paper(), (load,), QUICK),
    )
    loose, exact = (
        estimate_state(found, trace(paper(), [load], accuracy, estimate=False)[0], scene)
        for accuracy in (rough, replace(rough, tolerance_factor=1.0))
    )
    assert loose != exact
    for name, estimate in asdict(exact).items():
        assert getattr(loose, name) == (None if estimate is None else pytest.approx(estimate, rel=1e-3))


def test_estimates_grow_with_the_difference_to_the_companion_and_never_vanish():
    def found(difference):
        one, other = response(1.0, shift=0.5, tilt=0.2), response(1.0 + difference, shift=0.5 + difference)
        return astuple(estimated(one, replace(other, tilt=0.2 + difference)))[:4]

    large, middle, small = map(found, (0.1, 0.01, 1e-3))
    assert all(more > less for more, less in zip(large, middle, strict=True))
    assert max(small) < 0.01
    assert min(found(0.0)) > 1e-4
    for magnet in ("rigid", "ignored"):
        press = estimated(response(tilt=0.01), load=PRESS, model="axisymmetric", magnet=magnet)
        assert min(press.force, press.shift, press.tilt) > 1e-4


def test_the_force_along_the_shear_has_an_estimate_of_its_own():
    """Whichever way the shear points, all of the force of a grip, and None where nothing moves sideways."""
    found = estimated(response(0.5), response(0.52, 3.001))
    assert found.sideways > 2 * found.force
    across = Load(depth=1.0, shear_y=-1.0, friction="stick")
    turned = estimated(response(across=-0.5), response(across=-0.52, normal=3.001), across)
    assert turned.sideways == pytest.approx(found.sideways, rel=1e-12)
    grip = estimated(response(0.5, 0.0), response(0.52, 0.0), Load(grip=2.0, shear_x=1.0))
    assert grip.sideways == grip.force
    for load in (PRESS, Load(depth=1.0, shear_x=1.0)):
        assert estimated(response(), response(normal=3.001), load).sideways is None
    # with friction a small force is less sure
    small, large = (estimated(response(x), load=replace(STICK, friction=0.4)).sideways for x in (0.01, 1.0))
    assert small > 5 * large


def test_a_tilt_that_is_noise_has_no_estimate_and_a_companion_that_leans_the_other_way_is_mirrored():
    """Of tetrahedra, under a press that is upright; that of a tilted plate has one."""
    for load, known in ((PRESS, False), (TILTED, True)):
        tilt = estimated(response(tilt=1e-4), response(tilt=-2e-3), load, "half").tilt
        assert (tilt is not None) is known
    pushed, one = Load(depth=1.0, imperfection=1e-3), response(shift=0.4)
    assert estimated(one, response(shift=-0.4, tilt=-0.1), pushed) == estimated(one, load=pushed)


def test_a_single_harmonic_is_held_against_two():
    load = Load(depth=1.5, shear_x=2.0, friction="stick")
    rough = solve(paper(), load, replace(QUICK, harmonics=1))
    better = solve(paper(), load, replace(QUICK, harmonics=3))
    off = math.dist(rough.response.force, better.response.force) / math.hypot(*better.response.force)
    assert off > 0.01
    assert rough.estimates.force > 0.8 * off


def test_an_estimate_is_a_quarter_of_the_difference_at_least():
    """A mesh that converges with order 4 has this error, whatever is usual."""
    rule = ErrorRule(m=0.01, p=0.0, q=0.0, c=1.0, s=0.0)
    assert [relative_error(rule, (1.0,), (1.0 + d,), 0.1, 1.0) for d in (0.02, 0.06)] == pytest.approx([0.01, 0.015])


def test_estimates_grow_beyond_the_loads_of_the_study():
    def found(depth, shear=0.0):
        return estimated(response(1.0, 4.0), load=Load(depth, shear, friction="stick" if shear else "none"))

    assert found(0.8) == found(0.5)
    assert found(2.9) == found(1.0)
    assert found(3.6).force == pytest.approx((3.6 / 2.97) ** 1.5 * found(2.9).force)
    assert found(0.5, 9.6).tilt == pytest.approx(2 * found(0.5, 4.8).tilt)


@pytest.mark.parametrize(
    ("loads", "model", "case"),
    [
        ((Load(depth=0.9),), "harmonic", "press"),
        ((Load(depth=0.92),), "harmonic", "deep"),
        ((Load(0.5, 0.72, 0.96, "stick"),), "harmonic", "stick"),
        ((Load(0.5, 0.78, 1.04, "stick"),), "harmonic", "far"),
        ((Load(grip=1.0, shear_x=3.0),), "harmonic", "grip"),
        ((Load(grip=4.0, shear_x=3.0),), "harmonic", "wall grip"),
        # the mesh of a press is fine where the contact ends if the path shears, and with tetrahedra only then
        ((Load(depth=1.0, friction="stick"), STICK), "harmonic", "pressed"),
        ((RUBBED,), "axisymmetric", "friction"),
        ((PRESS,), "half", "solid press"),
        ((Load(depth=1.0, friction="stick"), STICK), "half", "solid"),
        ((TILTED,), "half", "solid"),
    ],
)
def test_each_load_has_the_rule_of_its_kind(loads, model, case):
    assert load_case(loads[0], Scene(paper(), loads, model=model)) == case


SHEARS = ("stick", "far", "grip", "wall grip", "friction", "solid", "tilted stick", "tilted friction")
PRESSES = ("press", "deep", "pressed", "solid press", "tilted press")
RULED = dict.fromkeys(SHEARS, "force shift tilt sideways") | dict.fromkeys(PRESSES, "force shift tilt")
RULED |= {"critical": "depth force", "small shear": "stiffness shift tilt"}
OF_SECTIONS = {*SHEARS, *PRESSES} - {"solid", "solid press"}


def test_every_kind_of_load_and_every_number_has_a_rule_with_and_without_magnet():
    keys = {(case, name) for case, names in RULED.items() for name in names.split()}
    keys |= {("modes", name) for name in ("frequency", "pressed frequency")}
    keys |= {(case, name) for case in OF_SECTIONS for name in ("energy", "strain")}
    keys |= {(case, "contact_radius") for case in OF_SECTIONS - {"grip", "wall grip"}}
    keys |= {("friction", name) for name in ("dissipated", "slip_share")}
    assert [(key, m) for key in keys for m in get_args(Magnet) if error_rule(key[0], m, key[1]) is None] == []
    moving = {("vibrating shear", way, name) for way in "xz" for name in ("force", "shift", "reading")}
    moving |= {("vibrating press", way, name) for way in "xz" for name in get_args(VibrationQuantity)}
    assert all(error_rule(*key) for key in moving)
    assert error_rule("small shear", "rigid", "contact_radius") is None
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
