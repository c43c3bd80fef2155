"""States of a path: frozen, with plate and skin at hand, and what hands them to another model."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from fem.model.plate_contact import KAPPA, SECTION_KAPPA
from fem.model.symmetry_models import MeshSpecification
from fem.solve import path_state
from fem.solve.path_state import PathState, at_rest
from geometry.design import paper

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
