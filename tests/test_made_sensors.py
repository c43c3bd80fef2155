"""Made sensors: tolerances with their sources, draws that are reproducible, and readings of displaced parts."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import hall, parts
from analytic.reading_noise import of_average, rounding_bias
from geometry.design import BadInput, Design, paper
from studies.sensitivity.made_sensors import (
    SPECS,
    made_readings,
    made_sensors,
    nominal_sensor,
    parse_tolerances,
    share_with_error,
    tolerances,
)


def test_every_tolerance_names_unit_distribution_and_source():
    for name, spec in SPECS.items():
        assert spec["shape"] in ("normal", "uniform")
        assert spec["unit"] in ("percent", "mm", "deg", "V", "T", "1")
        assert spec["meaning"]
        assert spec["source"]
        assert tolerances()[name] == float(spec["default"])


def test_gain_and_null_of_the_hall_element_are_those_of_its_data_sheet():
    assert parse_tolerances([])["hall_gain"] == pytest.approx(100 * 0.125 / 3.125)
    assert parse_tolerances([])["hall_null"] == 0.075


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E=-1", "tolerance E must be a number of percent from 0 to 90; got -1"),
        ("nu=nan", "tolerance nu must be a finite number; got nan"),
        ("nu=2", "tolerance nu must be a number from 0 to 1; got 2"),
        ("E=ten", "tolerance E must be a finite number; got 'ten'"),
        ("magnet_w=1", "did you mean magnet_"),
        ("E", "--tolerance takes KEY=VALUE"),
    ],
)
def test_impossible_tolerances_are_refused(text, message):
    with pytest.raises(BadInput, match=message.replace("(", r"\(")):
        parse_tolerances([text])


NONE = dict.fromkeys(SPECS, 0.0)


def test_a_seed_gives_the_same_sensors_again_and_another_seed_others():
    one, same, other = (made_sensors(paper(), count=20, seed=seed).fields["E"] for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_deviations_have_the_stated_distributions():
    sensors = made_sensors(paper(), tolerances(E=20.0, remanence=10.0), 20_000, 3)
    normal, uniform = sensors.fields["E"] - 1, sensors.fields["remanence"] / 1.2 - 1
    assert np.abs(normal).max() <= 0.2
    assert np.abs(uniform).max() <= 0.1
    # standard deviation of a normal distribution that is cut off at 2 standard deviations: 0.8796
    assert normal.std() == pytest.approx(0.1 * 0.8796, rel=0.02)
    assert uniform.std() == pytest.approx(0.1 / 3**0.5, rel=0.02)
    assert abs(normal.mean()) < 4 * 0.088 / 20_000**0.5
    assert abs(np.corrcoef(normal, uniform)[0, 1]) < 0.03


def test_a_tolerance_leaves_the_deviations_of_the_others():
    both, alone = (made_sensors(paper(), tolerances(magnet_x=size), 50, 4) for size in (0.15, 0.0))
    assert not alone.magnet_offset[:, 0].any()
    assert np.array_equal(both.magnet_offset[:, 1:], alone.magnet_offset[:, 1:])
    assert np.array_equal(both.fields["E"], alone.fields["E"])


def test_poissons_ratio_stays_below_a_half():
    sensors = made_sensors(paper(), tolerances(nu=0.01), 500, 5)
    assert sensors.fields["nu"].max() == 0.5
    assert set(sensors.refusals) == {""}


def test_elements_deviate_independently_and_the_axes_of_a_chip_together():
    three, chip = (made_sensors(Design(hall_layout=name), count=10) for name in ("three", "tmag5273a1"))
    assert len(np.unique(three.element_offset[:, :, 0])) == 30
    assert len(np.unique(chip.element_offset[:, :, 0])) == 10
    assert np.abs(chip.null_shift).max() <= 3e-4
    assert len(np.unique(chip.gain_factor)) == 30


def test_a_chip_deviates_as_its_data_sheet_says():
    design = Design(hall_layout="tmag5170a1")
    assert parse_tolerances([], design)["chip_gain"] == 2.6
    assert parse_tolerances(["chip_gain=1"], design)["chip_gain"] == 1
    assert parse_tolerances([], design)["chip_null"] == tolerances()["chip_null"]


def test_impossible_sensors_are_kept_with_their_reason():
    sensors = made_sensors(Design(magnet_diameter=7.58), tolerances(**NONE | {"magnet_diameter": 0.2}), 200, 6)
    impossible = [k for k, design in enumerate(sensors.designs) if design is None]
    assert 20 < len(impossible) < 180
    assert all("leaves" in sensors.refusals[k] for k in impossible)
    assert (sensors.fields["magnet_diameter"][impossible] > 7.58).all()
    assert [k for k, reason in enumerate(sensors.refusals) if reason] == impossible


def test_the_nominal_sensor_has_no_deviations():
    sensor = nominal_sensor(paper())
    assert sensor.designs == (paper(),)
    assert not sensor.element_offset.any()
    assert (sensor.gain_factor == 1).all()


@pytest.mark.parametrize(
    ("design", "count", "seed", "message"),
    [
        (paper(), 0, 0, "the number of made sensors must be from 1 to 1000000; got 0"),
        (paper(), 5, -1, "the seed must be 0 or more; got -1"),
        (Design(magnet_diameter=0, magnet_height=0), 5, 0, "no magnet"),
    ],
)
def test_impossible_draws_are_refused(design, count, seed, message):
    with pytest.raises(BadInput, match=message):
        made_sensors(design, count=count, seed=seed)


def test_the_interval_of_a_share_covers_its_truth_at_the_stated_level():
    draws = np.random.default_rng(7).binomial(200, 0.9, 2000)
    covered = np.mean([low <= 0.9 <= high for _, low, high in (share_with_error(int(k), 200) for k in draws)])
    assert 0.94 < covered < 0.99
    assert share_with_error(10, 10)[2] == 1.0
    assert share_with_error(0, 10)[1] == 0.0


SHIFT, TILT = np.array([0.4, -0.1, -0.8]), np.array([0.02, 0.06])


def states(count, shift=SHIFT, tilt=TILT):
    """The same pose for each of some sensors, in one state."""
    return np.tile(shift, (count, 1, 1)), np.tile(tilt, (count, 1, 1))


@pytest.mark.parametrize(("layout", "count"), [("three", 1), ("tmag5273a1", 1), ("tmag5273a1", 3)])
def test_without_deviations_the_readings_are_those_of_the_design(layout, count):
    design = Design(hall_layout=layout, chip_x=3.0, chip_count=count)
    made = made_readings(nominal_sensor(design), *states(1))
    truth = hall.readings(design, shift=tuple(SHIFT), tilt=tuple(TILT))
    exact = [dataclasses.replace(element, step=0.0) for element in parts.of_design(design)]
    output = hall.readings(design, shift=tuple(SHIFT), tilt=tuple(TILT), elements=exact).output
    assert made.output[0, 0] == pytest.approx(output, rel=1e-12)
    assert made.field_T[0, 0] == pytest.approx(truth.B_T, rel=1e-12)
    assert made.saturated[0, 0].tolist() == list(truth.saturated)


def test_each_element_reads_at_its_own_place_with_its_own_gain_and_null():
    sensors = made_sensors(paper(), tolerances(hall_x=0.5, hall_z=0.5), 4, 1)
    moved = made_readings(sensors, *states(4)).output
    for k, design in enumerate(sensors.designs):
        elements = [
            dataclasses.replace(
                element,
                position=tuple(np.add(element.position, sensors.element_offset[k, j])),
                gain=element.gain * sensors.gain_factor[k, j],
                null=element.null + sensors.null_shift[k, j],
            )
            for j, element in enumerate(parts.of_design(design))
        ]
        pose = SHIFT + hall.rotated(sensors.magnet_offset[k], TILT)
        truth = hall.readings(design, shift=tuple(pose), tilt=tuple(TILT + sensors.magnet_tilt[k]), elements=elements)
        assert moved[k, 0] == pytest.approx(truth.output, rel=1e-11)


def test_the_tilt_of_the_magnet_follows_that_of_the_load():
    """Two turns one after the other: the sum of their vectors is right to third order."""
    sensors = made_sensors(paper(), tolerances(**NONE | {"magnet_tilt": 3.0}), 50, 2)
    axis = np.array([0.0, 0.0, 1.0])
    for tilt in sensors.magnet_tilt:
        one_by_one = hall.rotated(hall.rotated(axis, tilt), TILT)
        assert hall.rotated(axis, tilt + TILT) == pytest.approx(one_by_one, abs=1e-4)


def test_impossible_sensors_and_states_without_a_pose_have_no_readings():
    sensors = made_sensors(Design(magnet_diameter=7.58), tolerances(**NONE | {"magnet_diameter": 0.2}), 20, 6)
    shift, tilt = states(20)
    shift[3] = np.nan
    readings = made_readings(sensors, shift, tilt)
    without = np.array([design is None for design in sensors.designs])
    without[3] = True
    assert np.array_equal(np.isnan(readings.output).all(axis=(1, 2)), without)
    assert not readings.saturated[without].any()


# Noise of a reading: limits, both series of the rounding bias, and samples through a converter.


def test_white_noise_falls_with_the_root_of_the_count():
    assert_allclose([of_average(1e-3, count=n) for n in (1, 4, 100)], [1e-3, 5e-4, 1e-4])


def test_a_single_sample_has_noise_step_and_floor():
    for noise, step in ((0.0, 1e-3), (1e-5, 1e-3), (3e-4, 1e-3), (1e-2, 1e-3)):
        assert_allclose(of_average(noise, step, 2e-4), math.sqrt(noise**2 + step**2 / 12 + 4e-8))


def test_the_floor_and_the_steps_without_noise_do_not_average_away():
    assert_allclose(of_average(1e-3, floor=1e-5, count=10**9), 1e-5, rtol=1e-3)
    assert_allclose(of_average(0.0, 1e-3, count=10**9), 1e-3 / math.sqrt(12))


def test_both_series_agree_where_they_meet():
    below, above = rounding_bias(0.1 * (1 - 1e-12), 1.0), rounding_bias(0.1, 1.0)
    assert_allclose(below, above, rtol=1e-9)


@pytest.mark.parametrize("noise", [0.02, 0.15, 0.3, 0.6])
@pytest.mark.parametrize("count", [1, 8])
def test_is_the_error_of_rounded_samples(noise, count):
    """Outputs anywhere within a step, with their noise, rounded and averaged; 2e5 averages give 0.5 %."""
    rng = np.random.default_rng(7)
    true = rng.uniform(0, 1, 200_000)
    samples = np.round(true + noise * rng.standard_normal((count, len(true))))
    error = math.sqrt(((samples.mean(axis=0) - true) ** 2).mean())
    assert_allclose(of_average(noise, 1.0, count=count), error, rtol=5e-3)
