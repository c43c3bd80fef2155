"""Yield: shares of made sensors, with known ends."""

import dataclasses

import numpy as np
import pytest

from studies.sensitivity.made_sensors import nominal_sensor
from studies.sizing.candidate_performance import performance
from studies.sizing.candidate_variables import variant
from studies.sizing.catalogues import catalogues_of
from studies.sizing.front_yield import tolerances_of, yield_of
from studies.sizing.pose_readings import MadeReader
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import beams_of

NEEDED = Requirements(force_z=5.0, force_x=1.5, magnets=("4x4 N45",), silicones=("Smooth-Sil 940",))
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
        assert value == pytest.approx(designed.one(0)[name], rel=1e-6), name


def test_ranges_of_the_catalogue_are_the_tolerances():
    tolerances = tolerances_of(MADE)
    assert pytest.approx(100 * (MADE.silicone.E_high / MADE.silicone.E - 1)) == tolerances.E
    assert tolerances.hall_gain == pytest.approx(5.0)
    assert tolerances.magnet_diameter == MADE.magnet.tolerance


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
    assert result.low < result.share < result.high


def test_seed_fixes_the_yield():
    typical = performance([MADE], beams_of([MADE]), NEEDED)
    tight = dataclasses.replace(NEEDED, first_mode=1.05 * float(typical.first_mode[0]))
    assert yield_of(MADE, tight, 30, seed=3) == yield_of(MADE, tight, 30, seed=3)


def test_impossible_sensors_count_as_failed():
    thin = dataclasses.replace(MADE, magnet=dataclasses.replace(MADE.magnet, tolerance=3.0))
    result = yield_of(thin, NEEDED, 30)
    assert result.missed["possible"] > 0
    assert np.isfinite(result.share)
