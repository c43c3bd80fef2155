"""First guesses of increments: exact for curves of the second degree, and none around a corner."""

from dataclasses import replace

import numpy as np
import pytest

from fem.model.symmetry_models import MeshSpecification
from fem.solve import load_increments
from fem.solve.path_state import PastState, at_rest
from geometry.design import paper

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


@pytest.mark.parametrize(("position", "kept"), [(at(0.25), 2), (at(0.15), 0), (at(0.2, 0.1), 0), (at(0.25, 0.01), 0)])
def test_a_past_that_does_not_lead_ahead_is_forgotten(position, kept):
    state = after(0.1, 0.15, 0.2)
    assert len(load_increments.drop_past_at_corner(state, position).past) == kept
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
