"""Where the contact of a press ends, and the mesh that is fine there."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from fem.accuracy import QUICK, STANDARD
from fem.analyses import small_shear
from fem.analyses.modes import find_contact, modes, pressed_sensor
from fem.equilibrium import trace
from fem.model.plate_contact import KAPPA, SECTION_KAPPA
from fem.model.symmetry_models import MeshSpecification, specification
from fem.scene import Scene
from fem.solution import Estimates
from fem.solve import path_state, press
from fem.solve.newton import NoStateError
from fem.solve.path_state import PathState, at_rest
from fem.solve.press import find_press, measure_contact_edge, solve_press
from geometry.design import BadInput, paper
from geometry.loads import Load

SECTION = specification(Scene(paper(), (Load(depth=1.0),), QUICK), 0.16, 0.08)


def test_a_press_that_never_starts_still_leaves_a_mesh_to_solve_on(monkeypatch):
    monkeypatch.setattr(press, "measure_contact_edge", lambda state: 0.0)
    assert find_press(SECTION, 0.01, 0.125) == pytest.approx(0.25)


def test_the_end_of_a_contact_stays_where_it_was_found():
    """Beside one more press on a mesh that is fine where the end was found."""
    radius = find_press(SECTION, 0.02, 0.125)
    again = measure_contact_edge(solve_press(replace(SECTION, rim=(radius, 0.012)), 0.125)[0])
    assert radius == pytest.approx(again, rel=0.01)


def test_a_press_that_crushes_silicone_is_no_state_to_analyse():
    """At 6.5 mm a press of the paper's sensor folds elements at tip and magnet; `solve` stops at 5.68 mm."""
    with pytest.raises(NoStateError, match=r"crushes silicone to [0-9.]+ % of its volume"):
        modes(paper(), depth=6.5, accuracy=QUICK, estimate=False)


def test_a_press_whose_levels_agree_is_a_state_to_analyse():
    """At 5 mm the frequencies of the three levels agree to 0.5 %, though J falls below 0.1 at the magnet's edge."""
    scene = Scene(paper(), (Load(depth=5.0),), STANDARD, "rigid")
    reached = pressed_sensor(scene, find_contact(scene))
    assert 0.04 < reached.state.least_J < 0.1
    assert reached.state.stability.is_stable


# Small shear of a glued plate about a press.


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_small_shear_is_the_start_of_a_finite_one(magnet):
    level = replace(QUICK, section_size=0.1, section_patch=0.01)
    small = small_shear.small_shear(paper(), 1.0, magnet, accuracy=level)
    way = 0.01
    state = trace(paper(), [Load(depth=1.0, shear_x=way, friction="stick")], level, magnet=magnet, estimate=False)[0]
    force, shift, tilt = state.response.force[0], state.response.shift[0], state.response.tilt
    np.testing.assert_allclose((shift / way, tilt / way), (small.shift, small.tilt), rtol=0.01)
    assert force / way == pytest.approx(small.stiffness, rel=0.01)


def test_small_shear_scales_with_size_and_modulus():
    one = small_shear.small_shear(paper(), 1.0, accuracy=QUICK)
    other = small_shear.small_shear(replace(paper(), E=2 * paper().E), 1.0, accuracy=QUICK)
    assert other.stiffness == pytest.approx(2 * one.stiffness, rel=1e-9)
    assert other.tilt == pytest.approx(one.tilt, rel=1e-9)


@pytest.mark.parametrize("depth", [0.0, -1.0, 50.0])
def test_depths_that_mean_nothing(depth):
    with pytest.raises(BadInput, match="depth"):
        small_shear.small_shear(paper(), depth)


def test_estimates_of_a_small_shear_hold_against_a_finer_mesh():
    finer = replace(STANDARD, section_size=0.035, section_patch=0.001)
    small, true = (small_shear.small_shear(paper(), 1.0, accuracy=level) for level in (QUICK, finer))
    for name in ("stiffness", "shift", "tilt"):
        error = abs(getattr(small, name) / getattr(true, name) - 1)
        assert error <= getattr(small.estimates, name) < 0.03


def test_estimates_can_be_left_out():
    small = small_shear.small_shear(paper(), 1.0, accuracy=QUICK, estimate=False)
    assert small.estimates == Estimates()


# States of a path: frozen, with plate and skin at hand, and what hands them to another model.


SHAPE = paper().shape.without_magnet().scaled(1 / 8)
RNG = np.random.default_rng(5)


def section(harmonics=0):
    return MeshSpecification(SHAPE, 0.4998, "ignored", 0.25, 0.125, harmonics=harmonics).build()


@pytest.fixture
def pressed():
    """A state at depth 0.1, of small random displacements."""
    rest = at_rest(section())
    return replace(rest, position=np.array([0.1, 0, 0]), q=1e-3 * RNG.normal(size=rest.q.shape), past=("before",))


@pytest.mark.parametrize("name", [field.name for field in fields(PathState)])
def test_nothing_of_a_state_can_be_set(pressed, name):
    with pytest.raises(FrozenInstanceError):
        setattr(pressed, name, None)


def test_only_a_section_without_friction_has_stiffer_springs():
    d = section()
    assert at_rest(d).kappa == SECTION_KAPPA
    assert at_rest(d, kappa=5.0).kappa == 5.0
    assert at_rest(d, mu=0.3, kappa=5.0).kappa == KAPPA


def test_a_grip_holds_the_cap_above_its_height():
    state = at_rest(section(), grip=0.3)
    assert state.plate.height is None
    facets = state.skin.points[..., 2].mean(axis=1)
    np.testing.assert_array_equal(
        state.bond.tied, np.broadcast_to((facets >= SHAPE.L - 0.3)[:, None], (len(facets), 3))
    )


def test_what_is_glued_counts_its_motion_from_where_it_was_glued(pressed):
    aside = path_state.with_harmonics(replace(pressed, position=np.array([0.1, 0.2, 0.0])), section(1))
    state = path_state.glue(aside, 0.3)
    radii = np.hypot(*np.moveaxis(state.skin.points[..., :2], -1, 0)).mean(axis=1)
    dome = state.skin.points[..., 2].min(axis=1) > SHAPE.H
    np.testing.assert_array_equal(state.bond.tied.all(axis=1)[dome], radii[dome] < 0.3)
    assert (state.bond.gap >= 0).all()
    # at once, no spring is strained
    at = (state.skin.points + state.skin.displacement(state.u))[..., :2]
    np.testing.assert_allclose(state.bond.targets + state.plate.shear, at, atol=1e-15)
