"""For which moduli is a formula within a bound? On forces whose answer is known."""

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest

from geometry.design import paper
from studies.validation import claim_errors, claim_states
from studies.validation.claim_errors import Voltages
from studies.validation.claim_states import Press

approx = pytest.approx
DEPTH = np.linspace(0.25, 3.0, 12)


def press(force, sinking=None, height=2.0):
    """Presses of the preset's magnet with a given force at 1 MPa."""
    sinking = DEPTH * 5 / 9 if sinking is None else sinking
    return Press(height, claim_states.with_magnet(height), DEPTH, force, sinking, 0.0, "")


def test_the_true_modulus_is_in_the_middle_of_the_interval():
    force = claim_errors.formula(DEPTH) / 0.6
    low, high = claim_errors.modulus_interval(claim_errors.formula(DEPTH), force, 0.05 * force)
    assert (low, high) == approx((0.6 / 1.05, 0.6 / 0.95))


def test_an_interval_ends_where_the_error_is_the_bound():
    """At both ends some depth has exactly the error that is allowed, and no depth a larger one."""
    predicted, force = claim_errors.formula(DEPTH), 0.9 * DEPTH**1.8
    slack = np.full_like(force, 0.3 * force.max())
    for E in claim_errors.modulus_interval(predicted, force, slack):
        assert claim_errors.error_of_largest(predicted, force, E) == approx(30)


def test_no_modulus_mends_another_law():
    predicted, force = DEPTH**2, DEPTH**1.5
    assert claim_errors.modulus_interval(predicted, force, 0.05 * force) is None
    assert claim_errors.modulus_interval(predicted, force, np.full_like(force, 0.5 * force.max())) is not None


def test_each_depth_from_the_first_that_fits():
    """d^2 over d^1.5 grows by 10.5 % from 1.5 / 1.105^2 to 1.5."""
    depth = np.array([0.5, 1.0, 1.3, 1.4, 1.5])
    assert claim_errors.each_depth_from(depth, depth**2, depth**1.5) == 1.3


def test_a_sensor_that_is_the_formula_has_no_error():
    row = claim_errors.height_row(press(claim_errors.formula(DEPTH)))
    assert row["best_E_MPa"] == approx(1.0)
    assert row["best_error_percent_of_largest"] == approx(0, abs=1e-5)
    assert row["error_percent_of_largest"] == row["worst_error_percent"] == 0
    assert row["each_depth_from_mm"] == DEPTH[0]
    # the paper's quadrature of the field, and the depths between those of the presses
    assert row["S1_error_percent"] < 0.1


def test_twice_the_force_is_half_the_modulus():
    row = claim_errors.height_row(press(2 * claim_errors.formula(DEPTH)))
    assert row["best_E_MPa"] == approx(0.5)
    assert row["worst_error_percent"] == approx(-50)
    assert row["best_E_S1_error_percent"] < 2


def test_presses_that_stop_have_a_row_without_answers():
    force = claim_errors.formula(DEPTH)
    force[-2:] = np.nan
    row = claim_errors.height_row(press(force))
    assert row["reached_mm"] == DEPTH[-3]
    assert np.isnan(row["best_E_MPa"])


def test_a_gain_mends_a_wrong_gain_only():
    force = np.linspace(0.0, 10.0, 21)
    same = Voltages(force, force, force[1:], 2 * force[1:], 10.0)
    assert same.error(1.0) == approx(50)
    assert same.error(1.0, any_gain=True) == approx(0, abs=0.1)
    bent = dataclasses.replace(same, measured=force[1:] ** 2)
    assert bent.error(1.0, any_gain=True) > 5


def test_voltages_beyond_the_formulas_largest_force_are_not_compared():
    force = np.linspace(0.0, 10.0, 21)
    hard = Voltages(force, force, 4 * force[1:], force[1:], 10.0)
    assert hard.reaches(0.25)
    assert not hard.reaches(1.0)
    assert hard.error(0.25) == approx(0)
    assert np.isnan(hard.error(100.0))


@pytest.mark.parametrize("height", [1.0, 2.0, 4.0])
def test_s1_reads_at_rest_what_the_paper_states(height):
    design = claim_states.with_magnet(height)
    assert claim_states.s1_output(design, np.zeros(1))[0] == approx(2.87, abs=1e-3)


@pytest.mark.parametrize(("second", "expected"), [(0.02, 0.02), (math.nan, math.nan)])
def test_an_unknown_error_estimate_is_not_left_out(second, expected):
    """Of a load that the sensor refuses, there is no force whose error could be known."""
    rows = {
        "depth_mm": [1.0, 2.0, 9.0],
        "fem_force_N": [1.0, 1.0, math.nan],
        "fem_shift_z_mm": [-0.5, -0.5, math.nan],
    }
    rows |= {"error_estimate": [0.01, second, math.nan], "message": ["", "", "too deep"]}
    found = claim_states.press_of(paper(), pd.DataFrame(rows))
    assert found.error_estimate == approx(expected, nan_ok=True)
    assert (found.message, found.complete) == ("too deep", False)
