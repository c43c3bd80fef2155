"""Readings of made sensors: those of `analytic.hall.readings` with magnet and elements displaced one by one."""

import dataclasses

import numpy as np
import pytest

from analytic import hall, parts
from geometry.design import Design, paper
from studies.sensitivity.made_readings import made_readings
from studies.sensitivity.made_sensors import made_sensors, nominal_sensor
from studies.sensitivity.tolerances import Tolerances

NONE = {spec.name: 0.0 for spec in dataclasses.fields(Tolerances)}
SHIFT, TILT = np.array([0.4, -0.1, -0.8]), np.array([0.02, 0.06])


def states(count, shift=SHIFT, tilt=TILT):
    """The same pose for each of some sensors, in one state."""
    return np.tile(shift, (count, 1, 1)), np.tile(tilt, (count, 1, 1))


@pytest.mark.parametrize("layout", ["three", "tmag5273a1"])
def test_without_deviations_the_readings_are_those_of_the_design(layout):
    design = Design(hall_layout=layout, chip_x=1.0)
    made = made_readings(nominal_sensor(design), *states(1))
    truth = hall.readings(design, shift=tuple(SHIFT), tilt=tuple(TILT))
    exact = [dataclasses.replace(element, step=0.0) for element in parts.of_design(design)]
    output = hall.readings(design, shift=tuple(SHIFT), tilt=tuple(TILT), elements=exact).output
    assert made.output[0, 0] == pytest.approx(output, rel=1e-12)
    assert made.field_T[0, 0] == pytest.approx(truth.B_T, rel=1e-12)
    assert made.saturated[0, 0].tolist() == list(truth.saturated)


def test_each_element_reads_at_its_own_place_with_its_own_gain_and_null():
    sensors = made_sensors(paper(), Tolerances(hall_x=0.5, hall_z=0.5), 4, 1)
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
    sensors = made_sensors(paper(), Tolerances(**NONE | {"magnet_tilt": 3.0}), 50, 2)
    axis = np.array([0.0, 0.0, 1.0])
    for tilt in sensors.magnet_tilt:
        one_by_one = hall.rotated(hall.rotated(axis, tilt), TILT)
        assert hall.rotated(axis, tilt + TILT) == pytest.approx(one_by_one, abs=1e-4)


def test_impossible_sensors_and_states_without_a_pose_have_no_readings():
    sensors = made_sensors(Design(magnet_diameter=7.58), Tolerances(**NONE | {"magnet_diameter": 0.2}), 20, 6)
    shift, tilt = states(20)
    shift[3] = np.nan
    readings = made_readings(sensors, shift, tilt)
    without = np.array([design is None for design in sensors.designs])
    without[3] = True
    assert np.array_equal(np.isnan(readings.output).all(axis=(1, 2)), without)
    assert not readings.saturated[without].any()
