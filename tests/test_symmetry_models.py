"""Sections with cosine and sine orders: embedding, rotations of the load, and the tilted plate."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.model import angular_fields, rigid_inclusion
from fem.model.plate_contact import KAPPA
from fem.model.symmetry_models import raise_harmonics
from fem.results.postprocess import read_pose, tip_force
from fem.scene import Scene
from fem.solve.load_case_models import PRESS_FILLET, path_models
from fem.solve.load_stepping import Path
from geometry.design import paper
from geometry.loads import Load

ROUGH = replace(QUICK, name="rough", section_size=0.4, section_patch=0.1, harmonics=1)
GLUED = Load(depth=0.6, plate_tilt=0.15, shear_x=0.5, friction="stick")
RUBBED = replace(GLUED, friction=0.4)
UPRIGHT = replace(GLUED, plate_tilt=0.0)


@functools.cache
def answer(load, *, sines):
    """Force and pose in the user's axes (8,), in units of D and E, with or without sine orders."""
    scene = Scene(paper(), (load,), ROUGH)
    models = path_models(scene)
    # one order is enough to see a symmetry
    first, raised = (
        model
        and replace(
            model, harmonics=min(model.harmonics, 1), sines=sines and model.harmonics > 0, fillet=PRESS_FILLET
        )
        for model in (models.first, models.raised)
    )
    models = replace(models, first=first, raised=raised, predictor=None, kappa=KAPPA)
    path = Path(models)
    reached = path.advance(path.rest, np.array([load.depth, *load.imposed_shear]) / 8)
    state = reached.state
    assert not reached.stop
    return np.concatenate([tip_force(state), *read_pose(state.d, state.u, state.q)])


def turned(values, angle):
    """Force and pose of a state that is rotated about z."""
    c, s = math.cos(angle), math.sin(angle)
    once = np.array([[c, -s], [s, c]])
    values = values.copy()
    for at in (0, 3, 6):
        values[at : at + 2] = once @ values[at : at + 2]
    return values


@pytest.mark.parametrize("load", [GLUED, RUBBED])
def test_sine_orders_leave_a_symmetric_load_as_it_is(load):
    np.testing.assert_allclose(answer(load, sines=True), answer(load, sines=False), atol=1e-10)


def test_a_quarter_turn_of_the_shear_turns_the_answer():
    other = answer(replace(UPRIGHT, shear_x=0.0, shear_y=0.5), sines=True)
    np.testing.assert_allclose(other, turned(answer(UPRIGHT, sines=True), math.pi / 2), atol=1e-10)


def test_half_a_turn_of_tilt_and_shear_turns_the_answer():
    load = replace(GLUED, shear_x=0.3, shear_y=0.4)
    other = answer(replace(load, plate_tilt=-0.15, shear_x=-0.3, shear_y=-0.4), sines=True)
    np.testing.assert_allclose(other, turned(answer(load, sines=True), math.pi), atol=1e-10)


def build(harmonics, sines):
    scene = Scene(paper(), (GLUED,), ROUGH)
    return replace(path_models(scene).first, harmonics=harmonics, sines=sines).build()


@pytest.mark.parametrize(("low", "high"), [((0, False), (1, False)), ((1, False), (2, True)), ((1, True), (2, True))])
def test_a_state_keeps_its_energy_with_more_orders(low, high):
    one, other = build(*low).system, build(*high).system
    # small, so that both numbers of angles integrate its energy
    q = 1e-7 * np.random.default_rng(1).normal(size=one.size)
    raised = raise_harmonics(one, other, q)
    energy = one.assemble(one.state(q), None, tangent=False).energy
    assert other.assemble(other.state(raised), None, tangent=False).energy == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize("harmonics", [1, 2])
def test_the_magnet_moves_as_a_solid_does(harmonics):
    """Sine orders contain finite rotations about any axis."""
    angles = angular_fields.fourier_fields(harmonics, sines=True)
    arms, motion = np.array([[0.1, 0.2], [0.3, -0.1]]), 0.3 * np.arange(1, 7)
    fields = rigid_inclusion.of_section(arms, angles).displacement(motion)
    cartesian = np.einsum("ijt,tjf->tif", angular_fields.rotations(angles.theta), angles.E)
    moved = np.einsum("tif,nf->tni", cartesian, fields).reshape(-1, 3)
    c, s = np.cos(angles.theta)[:, None], np.sin(angles.theta)[:, None]
    places = np.stack([arms[:, 0] * c, arms[:, 0] * s, arms[:, 1] + 0 * c], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(moved, rigid_inclusion.of_solid(places, 6).displacement(motion), atol=1e-12)
