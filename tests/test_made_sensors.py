"""Made sensors: drawn within the tolerances, reproducible, and counted where they are impossible."""

import dataclasses

import numpy as np
import pytest

from geometry.design import BadInput, Design, paper
from studies.sensitivity.made_sensors import made_sensors, nominal_sensor, share_with_error
from studies.sensitivity.tolerances import Tolerances

NONE = {spec.name: 0.0 for spec in dataclasses.fields(Tolerances)}


def test_a_seed_gives_the_same_sensors_again_and_another_seed_others():
    one, same, other = (made_sensors(paper(), count=20, seed=seed).E for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_deviations_have_the_stated_distributions():
    sensors = made_sensors(paper(), Tolerances(E=20.0, remanence=10.0), 20_000, 3)
    normal, uniform = sensors.E - 1, sensors.remanence / 1.2 - 1
    assert np.abs(normal).max() <= 0.2
    assert np.abs(uniform).max() <= 0.1
    # standard deviation of a normal distribution that is cut off at 2 standard deviations: 0.8796
    assert normal.std() == pytest.approx(0.1 * 0.8796, rel=0.02)
    assert uniform.std() == pytest.approx(0.1 / 3**0.5, rel=0.02)
    assert abs(normal.mean()) < 4 * 0.088 / 20_000**0.5
    assert abs(np.corrcoef(normal, uniform)[0, 1]) < 0.03


def test_a_tolerance_leaves_the_deviations_of_the_others():
    both, alone = (made_sensors(paper(), Tolerances(magnet_x=size), 50, 4) for size in (0.15, 0.0))
    assert not alone.magnet_offset[:, 0].any()
    assert np.array_equal(both.magnet_offset[:, 1:], alone.magnet_offset[:, 1:])
    assert np.array_equal(both.E, alone.E)


def test_poissons_ratio_stays_below_a_half():
    sensors = made_sensors(paper(), Tolerances(nu=0.01), 500, 5)
    assert sensors.nu.max() == 0.5
    assert set(sensors.refusals) == {""}


def test_elements_deviate_independently_and_the_axes_of_a_chip_together():
    three, chip = (made_sensors(Design(hall_layout=name), count=10) for name in ("three", "tmag5273a1"))
    assert len(np.unique(three.element_offset[:, :, 0])) == 30
    assert len(np.unique(chip.element_offset[:, :, 0])) == 10
    assert np.abs(chip.null_shift).max() <= 3e-4
    assert len(np.unique(chip.gain_factor)) == 30


def test_impossible_sensors_are_kept_with_their_reason():
    sensors = made_sensors(Design(magnet_diameter=7.58), Tolerances(**NONE | {"magnet_diameter": 0.2}), 200, 6)
    impossible = [k for k, design in enumerate(sensors.designs) if design is None]
    assert 20 < len(impossible) < 180
    assert all("leaves" in sensors.refusals[k] for k in impossible)
    assert (sensors.magnet_diameter[impossible] > 7.58).all()
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
