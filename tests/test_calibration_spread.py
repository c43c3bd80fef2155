"""Calibrations of made sensors: curves over the shared range of forces, errors and corrections, percentiles."""

import dataclasses

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from stores import temporary

from analytic import beam, hall
from fem.accuracy import QUICK
from fem.scene import Scene
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.mechanics.solve_plan import Processes, Solver
from studies.sensitivity.beam_motions import Press
from studies.sensitivity.calibration import (
    curves,
    percentile,
    refusals_of,
    sensitivity_errors,
    spread_of,
)
from studies.sensitivity.made_sensors import SPECS, made_readings, made_sensors, tolerances
from studies.sensitivity.sensitivity_study import failure_reasons

NONE = dict.fromkeys(SPECS, 0.0)


def test_the_ends_of_the_nominal_curves_are_the_readings_under_the_load():
    made = made_sensors(paper(), tolerances(**NONE), 1)
    axes = curves("finite", made, Press(1.0, 0.3))
    pressed, sheared = (beam.solve(paper(), Load(1.0, s, friction="stick"), "finite") for s in (0.0, 0.3))
    nominal, _ = axes["z"]
    assert nominal.force[-1] == pytest.approx(pressed.force[2])
    assert nominal.rest[0] == pytest.approx(hall.readings(paper()).V[0])
    assert nominal.reading[0, -1] == pytest.approx(hall.readings(paper(), pressed).V[0], rel=1e-6)
    along_x, _ = axes["x"]
    assert along_x.force[[0, -1]] == pytest.approx([-sheared.force[0], sheared.force[0]])
    assert along_x.reading[0, -1] == pytest.approx(hall.readings(paper(), sheared).V[1], rel=1e-6)
    assert axes["y"][0].reading == pytest.approx(along_x.reading, rel=1e-12)


def test_a_sensor_of_twice_the_modulus_is_pressed_less_for_the_same_force():
    made = made_sensors(paper(), tolerances(**NONE), 1)
    stiff = dataclasses.replace(made, designs=(Design(E=2.0),))
    nominal, curve = curves("finite", stiff, Press(1.0))["z"]
    soft_at_half = np.interp(nominal.force[-1] / 2, nominal.force, nominal.reading[0])
    assert curve.reading[0, -1] == pytest.approx(soft_at_half, rel=1e-4)


def test_a_sensor_that_does_not_reach_the_force_says_so():
    made = made_sensors(paper(), tolerances(**NONE), 1)
    soft = dataclasses.replace(made, designs=(Design(E=0.3),))
    _, curve = curves("finite", soft, Press(1.0, 0.2))["z"]
    assert np.isnan(curve.reading[0, -1])
    assert "its force does not rise to 4.08 N" in curve.refusals[0]


def test_the_surrogate_has_curves_from_rest_on_although_it_has_no_shallow_presses():
    nominal, made = curves("surrogate", made_sensors(paper(), count=5), Press(1.0, 0.3))["z"]
    assert np.isfinite(nominal.reading).all()
    assert np.isfinite(made.reading).all()
    assert set(made.refusals) == {""}


def test_a_load_that_the_model_refuses_for_the_design_itself_is_bad_input():
    made = made_sensors(paper(), count=2)
    with pytest.raises(BadInput, match="the sensor itself cannot be calibrated: depth must be less than 7 mm"):
        curves("finite", made, Press(8.0))
    with pytest.raises(BadInput, match="the sensor itself cannot be calibrated in shear: the surrogate"):
        curves("surrogate", made, Press(1.0, 8.0))


def test_the_stated_error_of_the_sensitivity_covers_what_it_differs_from_finite_elements():
    """Finite elements at level standard give 4.187 N at a depth of 1 mm."""
    assert sensitivity_errors("finite", paper(), Press(1.0, 0.5)) == {"z": 0.0, "x": 0.0, "y": 0.0}
    errors = sensitivity_errors("surrogate", paper(), Press(1.0, 0.5))
    nominal, _ = curves("surrogate", made_sensors(paper(), count=1), Press(1.0, 0.5))["z"]
    assert set(errors) == {"z", "x", "y"}
    assert 0 < errors["z"] < 0.1
    assert abs(nominal.force[-1] / 4.187 - 1) < errors["z"]
    assert set(sensitivity_errors("surrogate", paper(), Press(1.0))) == {"z"}


def spread(design=paper(), load=Press(1.0, 0.3), count=4, seed=1, **sizes):
    """Made sensors, and the spread of their calibrations by the axis."""
    sensors = made_sensors(design, tolerances(**NONE | sizes), count, seed)
    return sensors, spread_of(sensors, load, "finite")


def test_without_tolerances_all_sensors_are_the_nominal_one():
    for axis in spread(count=2)[1].values():
        assert axis.made["force_error"] == pytest.approx([0, 0], abs=1e-12)
        assert axis.made["recalibrated_force_error"] == pytest.approx([0, 0], abs=1e-12)
        assert axis.made["sensitivity"] == pytest.approx([axis.nominal["sensitivity"]] * 2)
        assert axis.refusals == ("", "")


def test_a_wrong_null_is_corrected_by_zeroing():
    sensors, axes = spread(hall_null=0.02, count=20)
    axis, null = axes["z"], sensors.null_shift[:, 0]
    assert axis.made["offset"] == pytest.approx(axis.nominal["offset"] + null)
    assert axis.made["zeroed_force_error"] == pytest.approx(np.zeros(20), abs=1e-9)
    # beyond the curve's upper end it goes on with its mean slope
    up = null > 0
    assert (axis.made["force_error"][up] >= null[up] / axis.nominal["sensitivity"] - 1e-9).all()
    assert axis.made["force_error"][up] == pytest.approx(null[up] / axis.nominal["sensitivity"], rel=0.5)


def test_a_wrong_gain_needs_the_recalibration_too():
    axis = spread(hall_gain=4.0)[1]["x"]
    assert (axis.made["zeroed_force_error"] > 1e-6).all()
    assert axis.made["recalibrated_force_error"] == pytest.approx(np.zeros(4), abs=1e-9)


def test_the_sensitivity_to_force_falls_with_the_modulus():
    sensors, axes = spread(E=10.0, load=Press(1.0, 0.3))
    axis = axes["x"]
    order = np.argsort(sensors.fields["E"])
    assert (np.diff(axis.made["sensitivity"][order]) < 0).all()
    assert axis.made["offset"] == pytest.approx([axis.nominal["offset"]] * 4, abs=0.01)


def test_deviations_of_the_elements_make_the_axes_differ():
    axes = spread(hall_x=0.3, hall_y=0.3)[1]
    assert not np.allclose(axes["x"].made["sensitivity"], axes["y"].made["sensitivity"])


def test_impossible_sensors_are_failures_with_their_reason():
    sensors, axes = spread(Design(magnet_diameter=7.58), magnet_diameter=0.2, count=30, load=Press(0.3))
    impossible = [design is None for design in sensors.designs]
    assert 3 < sum(impossible) < 27
    refusals = refusals_of(axes)
    assert np.array_equal(np.isnan(axes["z"].made["force_error"]), impossible)
    assert [bool(reason) for reason in refusals] == impossible
    assert sum(failure_reasons(refusals).values()) == sum(impossible)


def test_a_reading_at_a_rail_fails_the_sensor_and_an_axis_whose_reading_folds_fails_all():
    railed = spread(Design(hall_high=2.91))[1]["z"]
    assert (
        railed.message == "the reading of axis z of the design itself lies at a rail" or "one sense" in railed.message
    )
    assert np.isnan(railed.made["force_error"]).all()
    folded = spread(Design(f=3.0, c=0.0), Press(1.0, 2.5))[1]["x"]
    assert "one sense" in folded.message
    assert all(folded.refusals)


def test_only_sensors_that_reach_a_rail_fail():
    axis = spread(Design(hall_high=2.93), hall_null=0.05, count=40, load=Press(0.8))[1]["z"]
    failed = np.array([reason == "its reading lies at a rail" for reason in axis.refusals])
    assert 0 < failed.sum() < 40
    assert np.array_equal(np.isnan(axis.made["sensitivity"]), failed)


def test_the_surrogate_predicts_the_spread_of_finite_elements():
    """Three sensors solved one by one: the surrogate's sensitivities differ by its stated error, equally for all."""
    sensors = made_sensors(paper(), count=3, seed=3)
    axis = spread_of(sensors, Press(1.0))["z"]
    loads, force = tuple(map(Load, (0.8, 0.95, 1.1, 1.25))), axis.force_range[1]
    ratios = []
    for k, design in enumerate(sensors.designs):
        with temporary() as kept:
            (answers,) = Solver(kept, Processes(0), None, QUICK).answers([Scene(design, loads, QUICK)])
        forces, shifts = np.array([(one.response.force[2], one.response.shift[2]) for one in answers]).T
        sunk = np.zeros((len(sensors), 2, 3))
        sunk[k, 1, 2] = PchipInterpolator(forces, shifts)(force)
        rest, loaded = made_readings(sensors, sunk, np.zeros((len(sensors), 2, 2))).output[k, :, 0]
        ratios.append(axis.made["sensitivity"][k] / ((loaded - rest) / force))
    assert ratios == pytest.approx([1.0] * 3, abs=axis.model_error)
    assert np.ptp(ratios) < 0.005
    assert np.ptp(axis.made["sensitivity"]) > 0.03 * axis.nominal["sensitivity"]


@pytest.mark.parametrize("layout", ["tle493d-p2b6", "tmag5273a1"])
def test_the_steps_of_a_chip_fail_no_sensor(layout):
    """Within the range of a shear the reading of a chip stays on some of its steps for several forces."""
    _, axes = spread(Design(hall_layout=layout), Press(1.0, 0.5), chip_gain=5.0)
    assert [axis.message for axis in axes.values()] == ["", "", ""]
    assert refusals_of(axes) == ("",) * 4
    for axis in axes.values():
        assert axis.made["recalibrated_force_error"] == pytest.approx(np.zeros(4), abs=1e-9)


@pytest.mark.parametrize("share", [0.05, 0.5, 0.95])
def test_intervals_cover_the_truth_at_their_level(share):
    samples = np.random.default_rng(1).random((1000, 200))
    covered = np.mean([low <= share <= high for _, low, high in (percentile(one, share) for one in samples)])
    assert 0.935 < covered < 0.98


def test_failed_members_count_as_lowest_and_as_highest():
    values = np.random.default_rng(2).random(1000)
    whole = percentile(values, 0.95)
    lost = values.copy()
    lost[:20] = np.nan
    _, low, high = percentile(lost, 0.95)
    assert low < whole[1]
    assert high > whole[2]
    lost[:60] = np.nan
    assert percentile(lost, 0.95)[2] == np.inf


def test_without_values_nothing_is_known():
    estimate, low, high = percentile(np.full(5, np.nan), 0.5)
    assert np.isnan(estimate)
    assert (low, high) == (-np.inf, np.inf)
