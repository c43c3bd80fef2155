"""Motions of many magnets: those of each model for each sensor and load by itself."""

import numpy as np
import pytest

from analytic import beam, hall
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.sensitivity.beam_motions import QUANTITIES, motions, poses, readings
from studies.surrogate import surrogate_response

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
