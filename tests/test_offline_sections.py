"""Sections for the page without a server: states on one template, and their form in the page."""

import base64

import numpy as np
import pytest

from fem import equilibrium
from fem.accuracy import QUICK
from geometry.design import paper
from geometry.loads import Load
from studies.explorer import offline_sections, section_data

DEPTHS, SHEARS = (0.01, 0.03, 0.125), (0.0, 0.1)


@pytest.fixture(scope="module")
def sections():
    return offline_sections.solve(paper(), DEPTHS, SHEARS)


def test_states_are_known_but_for_a_shear_of_the_lightest_press(sections):
    known = np.isfinite(sections.values).all(axis=(2, 3))
    assert known.tolist() == [[True, False], [True, True], [True, True]]


def test_the_plate_holds_the_tip_and_the_base_stays(sections):
    top = np.argmax(sections.rest[:, 1])
    base = sections.rest[:, 1] < 1e-9
    for depth, states in zip(DEPTHS, sections.values, strict=True):
        assert states[0, 1, top] == pytest.approx(-depth, rel=0.02)
        assert np.abs(states[0, :2][:, base]).max() < 1e-9
    assert sections.values[2, 1, 0, top] == pytest.approx(0.1, rel=0.01)


def test_a_state_on_the_template_is_the_state_that_was_solved(sections):
    design = paper()
    load = Load(0.125 * design.D, 0.1 * design.D, friction="stick")
    (solution,) = equilibrium.trace(design, [load], QUICK, estimate=False)
    part = section_data.section(design, solution, "rigid")
    rest, moved = np.array(part["rest"]) / design.D, np.array(part["points"]) / design.D
    # the magnet's rim is on both meshes
    height = design.H / design.D
    for side in (-1, 1):
        corner = np.array([side * 0.25, height + 0.125])
        ours, theirs = (np.argmin(np.linalg.norm(points - corner, axis=1)) for points in (sections.rest, rest))
        displacement = sections.values[2, 1, :2, ours]
        assert displacement == pytest.approx((moved - rest)[theirs], abs=2e-3)


def test_steps_of_16_bits_keep_the_picture(sections):
    data = offline_sections.data(paper(), sections)
    steps = np.frombuffer(base64.b64decode(data["values"]["int16"]), dtype="<i2").reshape(sections.values.shape)
    values = steps * np.array(data["scale"])[:, None]
    known = np.isfinite(sections.values)
    assert np.abs((values - sections.values)[known]).max() <= 0.51 * max(data["scale"])
    assert np.array(data["scale"])[:2].max() < 1e-4


def test_a_press_through_all_silicone_is_left_out():
    short = offline_sections.solve(paper(), depths=(0.01, 0.9), shears=(0.0,))
    assert short.depths == (0.01,)
