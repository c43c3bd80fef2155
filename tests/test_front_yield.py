"""Yield: shares of made sensors, with known ends."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from studies.sensitivity.made_sensors import made_sensors, nominal_sensor
from studies.sizing.candidate_performance import MadeReader, performance
from studies.sizing.candidate_variables import variant
from studies.sizing.catalogues import catalogues_of
from studies.sizing.front_yield import ranges_of, tolerances_of, yield_of
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import beams_of

NEEDED = Requirements(force_z=5.0, force_x=1.5, magnets=("4x4 N45",), silicones=("Mold Star 30",))
PARTS = catalogues_of(dataclasses.replace(NEEDED, hall_parts=("DRV5055A2",)))
MADE = variant((10.0, 1.1, 0, 0, 0, 0.1, 0.1, 0.3), NEEDED, PARTS)


def test_sensor_without_deviations_reads_as_designed():
    silicone = dataclasses.replace(MADE.silicone, E_low=MADE.silicone.E, E_high=MADE.silicone.E)
    magnet = dataclasses.replace(
        MADE.magnet, remanence_low=MADE.magnet.remanence, remanence_high=MADE.magnet.remanence
    )
    one = dataclasses.replace(MADE, silicone=silicone, magnet=magnet)
    designed = performance([one], beams_of([one]), NEEDED)
    made = performance([one], beams_of([one]), NEEDED, reader=MadeReader(nominal_sensor(MADE.design)))
    for name, value in made.one(0).items():
        assert value == pytest.approx(designed.one(0)[name], rel=1e-6, nan_ok=True), name


def test_ranges_of_the_catalogue_are_the_tolerances():
    tolerances = tolerances_of(MADE)
    assert tolerances.hall_gain == pytest.approx(5.0)
    assert tolerances.magnet_diameter == MADE.magnet.tolerance


@pytest.mark.parametrize("name", ["E", "nu", "remanence"])
def test_draws_fill_the_range_of_the_catalogue_and_no_more(name):
    """Half of the sensors lie on each side of the typical value, which is in the middle of no range."""
    low, high = ranges_of(MADE)[name]
    drawn = getattr(made_sensors(MADE.design, tolerances_of(MADE), 2000, ranges=ranges_of(MADE)), name)
    assert low <= drawn.min() < low + 0.02 * (high - low)
    assert high - 0.02 * (high - low) < drawn.max() <= high
    assert np.mean(drawn < getattr(MADE.design, name)) == pytest.approx(0.5, abs=0.04)


def test_easy_requirements_are_met_by_all():
    result = yield_of(MADE, NEEDED, 20)
    assert result.share == 1
    assert result.rows()[0]["within"] == 20


def test_a_requirement_at_its_limit_is_met_by_some_and_named():
    typical = performance([MADE], beams_of([MADE]), NEEDED)
    tight = dataclasses.replace(NEEDED, first_mode=1.05 * float(typical.first_mode[0]))
    result = yield_of(MADE, tight, 60)
    assert 0 < result.passed < 60
    assert next(iter(result.missed)) == "first_mode"
    # no share outside the interval would give such a number of sensors with a probability above 2.5 %
    assert stats.binom.sf(result.passed - 1, 60, result.low) == pytest.approx(0.025)
    assert stats.binom.cdf(result.passed, 60, result.high) == pytest.approx(0.025)


def test_the_surrogates_intervals_are_the_other_part_of_the_uncertainty():
    silicone = dataclasses.replace(MADE.silicone, E_low=MADE.silicone.E, E_high=MADE.silicone.E)
    typical = performance([dataclasses.replace(MADE, silicone=silicone)], beams_of([MADE]), NEEDED, caution=0.0)
    result = yield_of(MADE, dataclasses.replace(NEEDED, largest_strain=float(typical.strain[0])), 100)
    within = 1 - result.missed["largest_strain"] / 100
    assert within == pytest.approx(0.5, abs=0.15)
    assert result.worse["largest_strain"] < within < result.better["largest_strain"]
    assert result.worse["all"] <= result.share <= result.better["all"]
    row = next(row for row in result.rows() if row["requirement"] == "largest_strain")
    assert row["surrogate_worse_percent"] < row["within_percent"] < row["surrogate_better_percent"]
    assert "at the ends of the surrogate's 90 % intervals" in result.uncertainty


def test_seed_fixes_the_yield():
    typical = performance([MADE], beams_of([MADE]), NEEDED)
    tight = dataclasses.replace(NEEDED, first_mode=1.05 * float(typical.first_mode[0]))
    assert yield_of(MADE, tight, 30, seed=3) == yield_of(MADE, tight, 30, seed=3)


def test_impossible_sensors_count_as_failed():
    thin = dataclasses.replace(MADE, magnet=dataclasses.replace(MADE.magnet, tolerance=3.0))
    result = yield_of(thin, NEEDED, 30)
    assert 0 < result.missed["possible"] < 30
    assert result.passed <= 30 - result.missed["possible"]
    assert all(missed >= result.missed["possible"] for missed in result.missed.values())
