"""Yield: shares of made sensors, with known ends."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from geometry.design import BadInput
from studies.calibration.calibrated_forces import planned
from studies.sensitivity.beam_motions import motions
from studies.sensitivity.made_sensors import nominal_sensor, share_with_error
from studies.sizing import front_yield
from studies.sizing.candidate_performance import performance
from studies.sizing.candidate_variables import Space
from studies.sizing.catalogues import catalogues_of
from studies.sizing.front_yield import (
    after_presses,
    check_of,
    drawn,
    ranges_of,
    required_load,
    stand,
    yield_of,
)
from studies.sizing.requirements import Requirements
from studies.sizing.sensor_arrays import made_sensors_of, sensors_of, sensors_of_variant

NEEDED = Requirements(force_z=5.0, force_x=1.5, magnets=("4x4 N45",), silicones=("Mold Star 30",))
PARTS = catalogues_of(dataclasses.replace(NEEDED, hall_parts=("DRV5055A2",)))
CANDIDATE = Space(NEEDED, PARTS).rounded(np.zeros((1, 3), dtype=np.int64), np.array([[10.0, 11.0, 1.0, 1.0, 1.8]]))
MADE = CANDIDATE.variant(0)


def reached(variant, **options):
    """What a variant reaches as designed."""
    sensors = sensors_of_variant(variant, NEEDED)
    return performance(sensors, sensors.beams(), NEEDED, **options)


def row_of(result, name):
    return next(row for row in result.rows() if row["requirement"] == name)


def test_sensor_without_deviations_reads_as_designed():
    silicone = dataclasses.replace(MADE.silicone, E_low=MADE.silicone.E, E_high=MADE.silicone.E)
    magnet = dataclasses.replace(
        MADE.magnet, remanence_low=MADE.magnet.remanence, remanence_high=MADE.magnet.remanence
    )
    one = dataclasses.replace(MADE, silicone=silicone, magnet=magnet)
    sensors = sensors_of_variant(one, NEEDED)
    designed = performance(sensors, sensors.beams(), NEEDED)
    made = made_sensors_of(one, nominal_sensor(MADE.design), sensors)
    found = performance(made, made.beams(), NEEDED)
    for name, value in found.one(0).items():
        assert value == pytest.approx(designed.one(0)[name], rel=1e-6, nan_ok=True), name


def test_a_variant_is_the_sensor_of_its_candidate():
    whole, one = sensors_of(CANDIDATE), sensors_of_variant(MADE, NEEDED)
    for spec in dataclasses.fields(one):
        if getattr(one, spec.name) is not None:
            assert getattr(one, spec.name) == pytest.approx(getattr(whole, spec.name), nan_ok=True), spec.name


@pytest.mark.parametrize("name", ["E", "nu", "remanence"])
def test_draws_fill_the_range_of_the_catalogue_and_no_more(name):
    """Half of the sensors lie on each side of the typical value, which is in the middle of no range."""
    low, high = ranges_of(MADE)[name]
    values = drawn(MADE, 2000, 0)[0].fields[name][:2000]
    assert low <= values.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < values.max() <= high
    assert np.mean(values < getattr(MADE.design, name)) == pytest.approx(0.5, abs=0.04)


def test_sensors_of_a_batch_are_alike_and_batches_differ():
    """Of the variance of E, that within batches is small; parts differ in their gains whatever their batch."""
    sensors, batches, batch = drawn(MADE, 500, 0)
    table = pd.DataFrame({"E": sensors.fields["E"], "gain": sensors.gain_factor[:, 0]})[:500].groupby(batch[:500])
    within = table.var().mean() / table.obj.var()
    assert within["E"] < 0.1
    assert within["gain"] > 0.8
    assert batches["at_the_ends"].sum() == 4
    low, high = ranges_of(MADE)["E"]
    ends = batches[batches["at_the_ends"]]["E_MPa"]
    assert low < ends.min() < low + 0.15 * (high - low)
    assert high - 0.15 * (high - low) < ends.max() < high
    assert list(np.bincount(batch)) == [20] * 29


def test_easy_requirements_are_met_by_all():
    result = yield_of(MADE, NEEDED, 20)
    assert result.share == 1
    assert result.rows()[0]["within"] == 20
    assert (result.batches["within_percent"] == 100).all()


def test_calibration_raises_the_yield():
    """The moduli of the catalogue differ by half: without a calibration no force is right to 5 % in every sensor."""
    calibrations = yield_of(MADE, NEEDED, 60).calibrations.set_index("calibration")
    shares = calibrations["within_percent"]
    assert list(shares.index) == ["none", "offset", "offset and gain", "twelve presses", "full"]
    assert shares.is_monotonic_increasing
    assert shares["none"] < 30 < shares["offset and gain"] < shares["full"] == 100
    errors = calibrations["force_error_95_percent"]
    # a posterior is no exact knowledge, but a better one than two corrections
    assert 0.5 < errors["twelve presses"] < 0.5 * errors["offset and gain"]


def test_presses_that_no_stand_can_make_leave_unknown_errors(monkeypatch):
    def refuse(*arguments):
        raise BadInput("outside the surrogate")

    monkeypatch.setattr(front_yield, "stand", refuse)
    row = yield_of(MADE, NEEDED, 60).calibrations.set_index("calibration").loc["twelve presses"]
    assert (row["within_percent"], row["unknown"]) == (0.0, 60)


def test_the_posterior_of_a_calibration_takes_the_place_of_planned_presses():
    load, sensor = required_load(MADE.design, NEEDED), stand(MADE, NEEDED)
    w, turn = -sensor.mechanics.sink * np.linspace(0.05, 0.5, 1000), 2.4 * np.arange(1000)
    found = planned(sensor, np.stack([0.5 * w * np.cos(turn), 0.5 * w * np.sin(turn), w], axis=1))
    few, many = (np.quantile(after_presses(MADE, load, NEEDED, each, 500, 0), 0.95) for each in (None, found))
    assert many < 0.7 * few


def test_drawn_sensors_are_held_against_finite_elements(tmp_path):
    """The surrogate is within its own half width of finite elements for sensors of other E, nu and magnets, too."""
    sensors = drawn(MADE, 30, 0)[0]
    load = required_load(MADE.design, NEEDED)
    check = check_of(sensors, load, 3, model="fem:quick", store=tmp_path / "store.db", workers=1)
    assert list(check["sensor"]) == [0, 1, 2]
    for name in ("force", "force_x"):
        assert (check[f"{name}_difference_percent"].abs() < check[f"{name}_half_width_percent"] + 1).all()
    # the design itself carries the required forces there
    design = dataclasses.replace(MADE.design)
    moved = motions("surrogate", [design], np.array([[load.depth]]), np.array([[load.shear]])).values
    assert moved["force_x"][0, 0] == pytest.approx(NEEDED.force_x, rel=0.01)


def test_forces_out_of_reach_have_no_load():
    assert required_load(MADE.design, dataclasses.replace(NEEDED, force_z=1e4)) is None


def test_a_requirement_at_its_limit_is_met_by_some_and_named():
    typical = reached(MADE, dense=True)
    tight = dataclasses.replace(NEEDED, first_mode=1.05 * float(typical.values["first_mode"][0]))
    result = yield_of(MADE, tight, 60)
    assert 0 < row_of(result, "all")["within"] < 60
    assert result.rows()[1]["requirement"] == "first_mode"
    row = result.rows()[0]
    assert row["worst_batch_percent"] <= row["within_percent"]
    # sensors of one batch are alike: they say less than as many independent ones
    independent = [100 * end for end in share_with_error(result.rows()[0]["within"], 60)[1:]]
    assert row["low_percent"] <= independent[0] < independent[1] <= row["high_percent"]


def test_the_surrogates_intervals_are_the_other_part_of_the_uncertainty():
    silicone = dataclasses.replace(MADE.silicone, E_low=MADE.silicone.E, E_high=MADE.silicone.E)
    typical = reached(dataclasses.replace(MADE, silicone=silicone), caution=0.0)
    result = yield_of(MADE, dataclasses.replace(NEEDED, largest_strain=float(typical.values["strain"][0])), 100)
    row, every = row_of(result, "largest_strain"), row_of(result, "all")
    assert row["within_percent"] == pytest.approx(50, abs=15)
    for each in (row, every):
        assert each["surrogate_worse_percent"] <= each["within_percent"] <= each["surrogate_better_percent"]
    assert row["surrogate_worse_percent"] < row["surrogate_better_percent"]
    assert "at the ends of the surrogate's 90 % intervals; sampling error" in result.sentence
    assert "largest_strain fails most often" in result.text()


def test_impossible_sensors_count_as_failed():
    thin = dataclasses.replace(MADE, magnet=dataclasses.replace(MADE.magnet, tolerance=3.0))
    result = yield_of(thin, NEEDED, 30)
    possible = row_of(result, "possible")["within"]
    assert 0 < possible < 30
    assert all(row["within"] <= possible for row in result.rows())
