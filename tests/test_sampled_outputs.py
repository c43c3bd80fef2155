"""Outputs at sampled cases: named as in a sweep, and with the half widths of the model."""

import numpy as np
import pytest

from analytic import beam, hall
from geometry.design import Design, paper
from geometry.loads import Load
from studies.sensitivity.sampled_outputs import Output, names, relative_half_width, sampled_outputs
from studies.sensitivity.varied_inputs import Press, sampled_cases

RANGES = {"E": (0.5, 2.0), "depth": (0.5, 1.0)}
POINTS = np.array([[0.5, 1.0], [2.0, 0.5], [1.0, 0.001]])


def test_outputs_are_those_of_each_case():
    cases = sampled_cases(paper(), RANGES, POINTS, Press(1.0, 0.2))
    outputs, refusals = sampled_outputs("finite", paper(), cases, sheared=True)
    assert tuple(outputs) == names(paper(), sheared=True)
    response = beam.solve(Design(E=2.0), Load(0.5, 0.2, friction="stick"), "finite")
    assert outputs["force_x_N"].value[1] == response.force[0]
    assert outputs["tilt_rad"].value[1] == response.tilt
    assert outputs["S2_V"].value[1] == pytest.approx(hall.readings(paper(), response).V[1])
    assert refusals == ("", "", "")


def test_a_chip_has_outputs_in_mT():
    chip = Design(hall_layout="tmag5273a1")
    cases = sampled_cases(chip, RANGES, POINTS[:1], Press(1.0))
    outputs, _ = sampled_outputs("finite", chip, cases, sheared=False)
    truth = hall.readings(chip, beam.solve(chip, Load(1.0), "finite")).B_T[0]
    assert outputs["chip_-z_output_mT"].value[0] == pytest.approx(1e3 * truth)


def test_cases_that_the_surrogate_refuses_have_no_value_and_a_reason():
    cases = sampled_cases(paper(), RANGES, POINTS, Press(1.0))
    outputs, refusals = sampled_outputs("surrogate", paper(), cases, sheared=False)
    assert np.isfinite(outputs["force_N"].value[:2]).all()
    assert np.isnan(outputs["S1_V"].value[2])
    assert "the surrogate knows depths of 0.08 to" in refusals[2]
    assert (outputs["S1_V"].half_width[:2] > 0).all()


def test_a_design_without_a_magnet_has_no_readings():
    assert names(Design(magnet_diameter=0, magnet_height=0), sheared=False)[-1] == "contact_radius_mm"


def test_the_error_is_relative_to_the_variation():
    output = Output(np.array([1.0, 3.0, np.nan]), np.array([0.2, 0.2, np.nan]))
    assert relative_half_width(output) == pytest.approx(0.2)
    assert relative_half_width(Output(np.full(3, np.nan), np.zeros(3))) == 0.0
