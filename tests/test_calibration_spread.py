"""Spread of calibrations: errors of the nominal calibration, before and after corrections."""

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from fem.accuracy import QUICK
from fem.scene import Scene
from geometry.design import Design, paper
from geometry.loads import Load
from studies.exploration import store
from studies.exploration.solved_paths import solved
from studies.sensitivity.calibration_spread import calibration_spread, failure_reasons
from studies.sensitivity.made_readings import made_readings
from studies.sensitivity.tolerances import Tolerances
from studies.sensitivity.varied_inputs import Press

NONE = {spec.name: 0.0 for spec in dataclasses.fields(Tolerances)}


def spread(design=paper(), load=Press(1.0, 0.3), count=4, seed=1, **tolerances):
    return calibration_spread(design, load, Tolerances(**NONE | tolerances), count, seed, "finite")


def test_without_tolerances_all_sensors_are_the_nominal_one():
    for axis in spread(count=2).axes.values():
        assert axis.error == pytest.approx([0, 0], abs=1e-12)
        assert axis.recalibrated_error == pytest.approx([0, 0], abs=1e-12)
        assert axis.sensitivity == pytest.approx([axis.nominal_sensitivity] * 2)
        assert axis.refusals == ("", "")


def test_a_wrong_null_is_corrected_by_zeroing():
    result = spread(hall_null=0.02, count=20)
    axis, null = result.axes["z"], result.sensors.null_shift[:, 0]
    assert axis.offset == pytest.approx(axis.nominal_offset + null)
    assert axis.zeroed_error == pytest.approx(np.zeros(20), abs=1e-9)
    # beyond the curve's upper end it goes on with its mean slope
    up = null > 0
    assert (axis.error[up] >= null[up] / axis.nominal_sensitivity - 1e-9).all()
    assert axis.error[up] == pytest.approx(null[up] / axis.nominal_sensitivity, rel=0.5)


def test_a_wrong_gain_needs_the_recalibration_too():
    axis = spread(hall_gain=4.0).axes["x"]
    assert (axis.zeroed_error > 1e-6).all()
    assert axis.recalibrated_error == pytest.approx(np.zeros(4), abs=1e-9)


def test_the_sensitivity_to_force_falls_with_the_modulus():
    result = spread(E=10.0, load=Press(1.0, 0.3))
    axis = result.axes["x"]
    order = np.argsort(result.sensors.E)
    assert (np.diff(axis.sensitivity[order]) < 0).all()
    assert axis.offset == pytest.approx([axis.nominal_offset] * 4, abs=0.01)


def test_deviations_of_the_elements_make_the_axes_differ():
    axes = spread(hall_x=0.3, hall_y=0.3).axes
    assert not np.allclose(axes["x"].sensitivity, axes["y"].sensitivity)


def test_impossible_sensors_are_failures_with_their_reason():
    result = spread(Design(magnet_diameter=7.58), magnet_diameter=0.2, count=30, load=Press(0.3))
    impossible = [design is None for design in result.sensors.designs]
    assert 3 < sum(impossible) < 27
    axis = result.axes["z"]
    assert np.array_equal(np.isnan(axis.error), impossible)
    assert [bool(reason) for reason in result.refusals] == impossible
    assert sum(failure_reasons(result.refusals).values()) == sum(impossible)


def test_a_reading_at_a_rail_fails_the_sensor_and_an_axis_whose_reading_folds_fails_all():
    railed = spread(Design(hall_high=2.91)).axes["z"]
    assert (
        railed.message == "the reading of axis z of the design itself lies at a rail" or "one sense" in railed.message
    )
    assert np.isnan(railed.error).all()
    folded = spread(Design(f=3.0, c=0.0), Press(1.0, 2.5)).axes["x"]
    assert "one sense" in folded.message
    assert all(folded.refusals)


def test_only_sensors_that_reach_a_rail_fail():
    axis = spread(Design(hall_high=2.93), hall_null=0.05, count=40, load=Press(0.8)).axes["z"]
    failed = np.array([reason == "its reading lies at a rail" for reason in axis.refusals])
    assert 0 < failed.sum() < 40
    assert np.array_equal(np.isnan(axis.sensitivity), failed)


def test_the_surrogate_predicts_the_spread_of_finite_elements():
    """Three sensors solved one by one: the surrogate's sensitivities differ by its stated error, equally for all."""
    spread_of_three = calibration_spread(paper(), Press(1.0), count=3, seed=3)
    axis, sensors = spread_of_three.axes["z"], spread_of_three.sensors
    loads, force = tuple(map(Load, (0.8, 0.95, 1.1, 1.25))), axis.force_range[1]
    ratios = []
    for k, design in enumerate(sensors.designs):
        with store.in_memory() as kept:
            answers, _ = solved(Scene(design, loads, QUICK), kept)
        forces, shifts = np.array([(one.response.force[2], one.response.shift[2]) for one in answers]).T
        sunk = np.zeros((len(sensors), 2, 3))
        sunk[k, 1, 2] = PchipInterpolator(forces, shifts)(force)
        rest, loaded = made_readings(sensors, sunk, np.zeros((len(sensors), 2, 2))).output[k, :, 0]
        ratios.append(axis.sensitivity[k] / ((loaded - rest) / force))
    assert ratios == pytest.approx([1.0] * 3, abs=axis.model_error)
    assert np.ptp(ratios) < 0.005
    assert np.ptp(axis.sensitivity) > 0.03 * axis.nominal_sensitivity


@pytest.mark.parametrize("layout", ["tle493d-p2b6", "tmag5273a1"])
def test_the_steps_of_a_chip_fail_no_sensor(layout):
    """Within the range of a shear the reading of a chip stays on some of its steps for several forces."""
    result = spread(Design(hall_layout=layout), Press(1.0, 0.5), chip_gain=5.0)
    assert [axis.message for axis in result.axes.values()] == ["", "", ""]
    assert result.refusals == ("",) * 4
    for axis in result.axes.values():
        assert axis.recalibrated_error == pytest.approx(np.zeros(4), abs=1e-9)
