"""Readings of a vibrating sensor."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import hall
from fem.accuracy import QUICK
from fem.analyses.vibration import vibrating_sensor
from fem.equilibrium import trace
from geometry.design import paper
from geometry.loads import Load
from geometry.relaxation import Relaxation
from studies.simulation import response_curves, vibration_report

BAND = (0.1, 100.0)


def curves(design, load, frequencies):
    return response_curves.evaluator(design, vibrating_sensor(design, load, BAND, QUICK))(np.array(frequencies))


def test_a_slow_motion_of_the_plate_changes_the_readings_as_two_presses_do():
    design, step = replace(paper(), loss_factor=0.0), 0.02
    slow = curves(design, Load(depth=1.0), [0.1])["z"]
    volts = [
        np.array(hall.readings(design, state.response).V)
        for state in trace(design, [Load(depth=1 - step), Load(depth=1 + step)], QUICK, estimate=False)
    ]
    expected = (volts[1] - volts[0]) / (2 * step)
    assert slow.per_mm[0].real == pytest.approx(expected, rel=0.03)  # the meshes differ, and the contact is frozen
    assert slow.per_N[0] == pytest.approx(slow.per_mm[0] / slow.force[0], rel=1e-12)


def test_a_saturated_element_reads_nothing():
    blind = replace(paper(), hall_high=2.6)
    assert np.abs(curves(blind, Load(depth=1.0), [1.0])["z"].per_mm).max() == 0


def test_rows_hold_gains_and_phases():
    one = curves(paper(), Load(depth=1.0, friction="stick"), [1.0, 10.0])["x"]
    rows = response_curves.rows(one, None, None)
    assert rows[1]["S2_V_per_N"] == pytest.approx(abs(one.per_N[1, 1]))
    assert rows[1]["force_phase_deg"] == pytest.approx(np.degrees(np.angle(one.force[1])))
    assert rows[1]["S1_V_per_N"] is None  # forbidden by symmetry
    assert rows[1]["shift_z_mm_per_mm"] is None


def test_a_prony_oscillator_without_branches_is_the_undamped_one():
    sensor = vibrating_sensor(replace(paper(), loss_factor=0.0), Load(depth=1.0), BAND, QUICK)
    models = vibration_report.oscillators(paper(), "x", 1.0, sensor.relaxation)
    (natural, one), (_, other) = models.values()
    f = np.array([0.1, 0.5 * natural])
    assert one(f) == pytest.approx(other(f), rel=1e-12)
    rungs = vibration_report.rungs("x", models, one, BAND)
    assert [rung["natural_Hz"] for rung in rungs] == [natural, natural, None]
    assert all(rung["peak_Hz"] is None for rung in rungs)  # an undamped resonance has no height


def test_an_oscillator_takes_its_loss_factor_where_the_branches_speak():
    measured = Relaxation((0.2, 0.1), (0.1, 1.0), (0.01, 10.0))
    end = 1 / (2 * np.pi * 0.01)
    models = vibration_report.oscillators(paper(), "x", 1.0, measured)
    name = next(iter(models))
    natural, response = models[name]
    assert natural > end
    assert name.endswith("as at 15.9 Hz")
    loss = float(measured.loss_factor(2 * np.pi * end))
    assert np.abs(response(np.array([natural]))) == pytest.approx([1 / loss], rel=1e-12)
