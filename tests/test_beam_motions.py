"""Motions and outputs of many sensors: those of each model for each sensor and load, named as in a sweep."""

import numpy as np
import pytest

from analytic import beam, hall
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.mechanics import surrogate_response
from studies.sensitivity.beam_motions import (
    QUANTITIES,
    Press,
    motions,
    names,
    poses,
    readings,
    relative_half_width,
    sampled_outputs,
)

DEPTH, SHEAR = np.array([[0.5, 1.0], [0.4, 0.8]]), np.array([[0.0, 0.3], [0.0, -0.3]])
LONGER = Design(L=12.0, l0=10.2, E=0.5)


def test_formulas_answer_each_sensor_and_load():
    moved = motions("finite", [paper(), LONGER], DEPTH, SHEAR)
    truth = beam.solve(LONGER, Load(0.8, -0.3, friction="stick"), "finite")
    assert moved.values["force_x"][1, 1] == truth.force[0] < 0
    assert moved.values["force_z"][1, 1] == truth.force[2]
    assert moved.values["tilt"][1, 1] == truth.tilt
    assert moved.values["shift_z"][0, 0] == beam.solve(paper(), Load(0.5), "finite").shift[2]
    assert not moved.half_widths["force_z"].any()


def test_impossible_sensors_and_loads_have_no_results():
    moved = motions("finite", [None, paper()], np.array([[0.5], [8.0]]), np.zeros((2, 1)))
    assert np.isnan(moved.values["force_z"]).all()
    assert "depth must be less than 7 mm" in moved.refusals[1, 0]
    assert np.isnan(readings([None, paper()], moved)[0]).all()


def test_the_surrogate_refuses_beyond_buckling_as_everywhere():
    """A sheared slender beam gave a force against the shear, without a word."""
    slender, load = Design(L=24.0, l0=22.0), Load(depth=2.0, shear_x=0.5, friction="stick")
    moved = motions("surrogate", [slender, paper()], np.full((2, 2), 2.0), np.array([[0.5, 0.0], [0.5, -0.5]]))
    for name in QUANTITIES:
        assert np.isnan(moved.values[name][0]).all()
        assert np.isnan(moved.half_widths[name][0]).all()
    assert moved.refusals[0, 0] == surrogate_response.refusal(slender, load, "rigid")
    assert "knows a press to stay stable to" in moved.refusals[0, 1]
    assert moved.refusals[1].tolist() == ["", ""]
    assert moved.values["force_x"][1, 0] == -moved.values["force_x"][1, 1] > 0


def test_readings_are_those_of_each_pose():
    moved = motions("finite", [paper(), LONGER], DEPTH, SHEAR)
    outputs, _ = readings([paper(), LONGER], moved)
    for k, design in enumerate([paper(), LONGER]):
        response = beam.solve(design, Load(DEPTH[k, 1], SHEAR[k, 1], friction="stick"), "finite")
        assert outputs[k, 1] == pytest.approx(hall.readings(design, response).output, rel=1e-12)


def test_a_shear_along_y_turns_the_pose_of_one_along_x():
    moved = motions("finite", [paper()], DEPTH[:1], SHEAR[:1])
    (x, along_x), (y, along_y) = poses(moved.values), poses(moved.values, towards_y=True)
    assert np.array_equal(y[..., 1], x[..., 0])
    assert np.array_equal(
        hall.rotated(np.array([0, 0, 1.0]), along_y)[..., 1], hall.rotated(np.array([0, 0, 1.0]), along_x)[..., 0]
    )


def test_an_unknown_model_is_refused():
    with pytest.raises(
        BadInput, match="the model must be one of surrogate, paper, column, tip, magnet, finite; got 'x'"
    ):
        motions("x", [paper()], DEPTH[:1], SHEAR[:1])


RANGES = {"E": (0.5, 2.0), "depth": (0.5, 1.0)}
POINTS = np.array([[0.5, 1.0], [2.0, 0.5], [1.0, 0.001]])


def test_outputs_are_those_of_each_case():
    outputs, refusals = sampled_outputs("finite", paper(), RANGES, POINTS, Press(1.0, 0.2), sheared=True)
    assert tuple(outputs) == names(paper(), sheared=True)
    response = beam.solve(Design(E=2.0), Load(0.5, 0.2, friction="stick"), "finite")
    assert outputs["force_x_N"][0][1] == response.force[0]
    assert outputs["tilt_rad"][0][1] == response.tilt
    assert outputs["S2_V"][0][1] == pytest.approx(hall.readings(paper(), response).V[1])
    assert refusals == ("", "", "")


def test_a_chip_has_outputs_in_mT():
    chip = Design(hall_layout="tmag5273a1")
    outputs, _ = sampled_outputs("finite", chip, RANGES, POINTS[:1], Press(1.0), sheared=False)
    truth = hall.readings(chip, beam.solve(chip, Load(1.0), "finite")).B_T[0]
    assert outputs["chip_-z_output_mT"][0][0] == pytest.approx(1e3 * truth)


def test_cases_that_the_surrogate_refuses_have_no_value_and_a_reason():
    outputs, refusals = sampled_outputs("surrogate", paper(), RANGES, POINTS, Press(1.0), sheared=False)
    assert np.isfinite(outputs["force_N"][0][:2]).all()
    assert np.isnan(outputs["S1_V"][0][2])
    assert "the surrogate knows depths of 0.08 to" in refusals[2]
    assert (outputs["S1_V"][1][:2] > 0).all()


def test_a_design_without_a_magnet_has_no_readings():
    assert names(Design(magnet_diameter=0, magnet_height=0), sheared=False)[-1] == "contact_radius_mm"


def test_the_error_is_relative_to_the_variation():
    assert relative_half_width(np.array([1.0, 3.0, np.nan]), np.array([0.2, 0.2, np.nan])) == pytest.approx(0.2)
    assert relative_half_width(np.full(3, np.nan), np.zeros(3)) == 0.0


def test_elements_keep_their_places_and_impossible_points_their_reason():
    points = np.array([[8.0, 9.0, 0.5], [8.0, 11.0, 1.5], [20.0, 9.0, 1.0]])
    ranges = {"D": (4, 20), "L": (8, 12), "depth": (0.5, 1.5)}
    outputs, refusals = sampled_outputs("finite", paper(), ranges, points, Press(1.0, 0.2), sheared=True)
    longer = Design(L=11.0, l0=9.2)
    response = beam.solve(longer, Load(1.5, 0.2, friction="stick"), "finite")
    assert outputs["S1_V"][0][1] == pytest.approx(hall.readings(longer, response).V[0])
    assert np.isnan(outputs["force_N"][0]).tolist() == [False, False, True]
    assert "L must exceed the tip radius" in refusals[2]


@pytest.mark.parametrize("load", [(0.0, 0.0), (float("nan"), 0.0), (1.0, -0.1), (1.0, float("inf"))])
def test_impossible_loads_are_refused(load):
    with pytest.raises(BadInput, match="must be a finite number of mm"):
        Press(*load)
