"""Verdicts on figures that stand on either side of a claim."""

import dataclasses
import math

import numpy as np
import pytest

from fem.accuracy import QUICK
from studies.validation import claim_states, other_answers, press_answers
from studies.validation.claim_errors import HeightRow, SplitRow, TipRow, formula, height_row
from studies.validation.claim_states import Press, States
from studies.validation.press_answers import verdict
from studies.validation.sensor_figures import (
    CostRow,
    FactorFigures,
    LayoutRow,
    LoopFigures,
    ModeRow,
    ResponseFigures,
    response_figures,
)

DEPTH = np.linspace(0.25, 3.0, 12)
NAN = math.nan


def press(force, height=2.0):
    return Press(height, claim_states.with_magnet(height), DEPTH, force, DEPTH * 5 / 9, 0.0, "")


def states(force):
    return States((press(force),), press(force), ())


def test_verdicts():
    assert verdict(holds=True, holds_for_other_values=True, figures=[1.0]) == "reproduced"
    assert verdict(holds=False, holds_for_other_values=True, figures=[1.0]) == "not decidable"
    assert verdict(holds=False, holds_for_other_values=False, figures=[1.0]) == "refuted"


@pytest.mark.parametrize("figures", [[], [NAN], [1.0, NAN]])
@pytest.mark.parametrize("holds", [True, False])
def test_nothing_is_decided_without_data(holds, figures):
    assert verdict(holds=holds, figures=figures) == "not decidable"


def test_claims_without_data_are_not_decidable():
    lost = press(np.full(12, NAN))
    rows = [height_row(lost)]
    none = States((lost,), lost, ())
    answers = [
        *(press_answers.at_each_depth(rows), press_answers.of_largest(rows, none), press_answers.voltage(rows, 2.0)),
        *(press_answers.largest_forces(none), other_answers.shear_force([], 0.6), other_answers.tilt_as_cause([])),
    ]
    assert {answer.verdict for answer in answers} == {"not decidable"}


@pytest.mark.parametrize(
    ("force", "each", "largest", "voltage"),
    [
        (formula(DEPTH), "reproduced", "reproduced", "reproduced"),
        (2 * formula(DEPTH), "not decidable", "not decidable", "not decidable"),
        (5 * DEPTH**1.2, "refuted", "refuted", "refuted"),
    ],
    ids=["formula", "other modulus", "other law"],
)
def test_presses(force, each, largest, voltage):
    rows = [height_row(press(force))]
    assert press_answers.at_each_depth(rows).verdict == each
    assert press_answers.of_largest(rows, states(force)).verdict == largest
    assert press_answers.voltage(rows, 2.0).verdict == voltage


def test_the_band_of_moduli_is_in_the_sentence():
    row = HeightRow(2.0, 7.2, 3.0, 0.58, 0.61, 0.6, 3.0, 42.0, -70.0, 0.25, 1.0, 60.0, 25.0, 7.0, 9.0, 6.0)
    text = press_answers.of_largest([row], states(formula(DEPTH))).text
    assert "E from 0.58 to 0.61 MPa with a magnet 2 mm high" in text
    taller = dataclasses.replace(row, magnet_height_mm=2.5, E_from_MPa=NAN, E_to_MPa=NAN)
    text = press_answers.of_largest([row, taller], states(formula(DEPTH))).text
    assert "no modulus makes it true with a magnet of 2.5 mm or more" in text
    none = dataclasses.replace(row, E_from_MPa=NAN, E_to_MPa=NAN)
    assert "for no modulus" in press_answers.of_largest([none], states(formula(DEPTH))).text


def test_forces_at_the_same_depth_are_proportional_to_E():
    answer = press_answers.largest_forces(states(formula(DEPTH)))
    assert answer.verdict == "refuted"
    assert answer.figures["depth_mm_at_9_N"] == answer.figures["depth_mm_at_18_N"]
    assert answer.figures["error_percent_at_3_N"] == pytest.approx(0)


def test_forces_in_proportion_to_E_would_reproduce_the_largest_ones(monkeypatch):
    monkeypatch.setattr(press_answers, "CLAIMED", ((1.0, 3.0), (5.0, 15.0)))
    reach = DEPTH[np.searchsorted(formula(DEPTH), 3.0)]
    force = np.where(reach >= DEPTH, formula(DEPTH), 2 * formula(DEPTH))
    scale = 3.0 / float(np.interp(reach, DEPTH, force))
    assert press_answers.largest_forces(states(force)).verdict == "refuted"
    monkeypatch.setattr(press_answers, "CLAIMED", ((1.0, 3.0 / scale), (5.0, 15.0 / scale)))
    assert press_answers.largest_forces(states(force)).verdict == "reproduced"


@pytest.mark.parametrize(
    ("accurate", "readings", "bending", "expected"),
    [
        (900.0, (1.0, 1.0), 3000.0, "reproduced"),
        (2.0, (0.8, 3.5), 340.0, "not decidable"),
        (2.0, (0.8, 0.5), 340.0, "refuted"),
        (2.0, (NAN, 3.5), 340.0, "not decidable"),
    ],
)
def test_band(accurate, readings, bending, expected):
    vibration = ResponseFigures(0.1, *readings, None, None, accurate)
    assert other_answers.band(modes(bending), vibration).verdict == expected


@pytest.mark.parametrize(
    ("percent", "expected"), [(0.5, "reproduced"), (8.0, "not decidable"), (150.0, "refuted"), (NAN, "not decidable")]
)
def test_hysteresis(percent, expected):
    assert other_answers.hysteresis(LoopFigures(0.1, percent, percent, percent)).verdict == expected


@pytest.mark.parametrize(
    ("polarisation", "expected"), [(0.026, "refuted"), (1.2, "reproduced"), (NAN, "not decidable")]
)
def test_hall_factor(polarisation, expected):
    assert other_answers.hall_factor(FactorFigures(12.0, polarisation, 0.1, 0.2, ())).verdict == expected


@pytest.mark.parametrize(("l0", "expected"), [(7.2, "reproduced"), (2.0, "refuted"), (NAN, "not decidable")])
def test_offset(l0, expected):
    assert other_answers.offset(FactorFigures(12.0, 0.026, 0.1, 0.2, ((2.0, l0),))).verdict == expected


@pytest.mark.parametrize(("error", "expected"), [(50.0, "reproduced"), (4.0, "refuted")])
def test_shear_force(error, expected):
    tips = [
        TipRow("stuck to a plate", 0.5, error, error, error, 1.5, 10.0, NAN, NAN),
        TipRow("gripped", 0.8, 1.0, 1.0, 1.0, 1.0, 1.0, 0.96, 1.04),
    ]
    assert other_answers.shear_force(tips, 0.6).verdict == expected


@pytest.mark.parametrize(("tilt", "expected"), [(0.9, "reproduced"), (0.1, "refuted")])
def test_tilt_as_cause(tilt, expected):
    rows = [SplitRow(1.0, 1.0, 2.0, 1.0, tilt, (1 - tilt) / 2, (1 - tilt) / 2, 0.1)]
    assert other_answers.tilt_as_cause([("stuck", rows)]).verdict == expected


@pytest.mark.parametrize(
    ("shares", "expected"), [((0.0, 0.0), "reproduced"), ((0.0, 5.0), "not decidable"), ((1.0, 5.0), "refuted")]
)
def test_uniqueness(shares, expected):
    rows = [LayoutRow(2.0, 7.2, c, "B.n", share, 0.5) for c, share in zip((2.0, 5.0), shares, strict=True)]
    assert other_answers.uniqueness(rows).verdict == expected


def modes(bending):
    return [ModeRow(magnet, depth, bending, 1000.0, 0.0) for magnet in ("rigid", "ignored") for depth in (0.0, 1.0)]


@pytest.mark.parametrize(("bending", "expected"), [(980.0, "reproduced"), (340.0, "refuted")])
def test_frequency(bending, expected):
    formulas = {"third_of_silicone": 1010.0, "with_magnet": 667.0}
    assert other_answers.frequency(modes(bending), formulas).verdict == expected


def test_band_says_where_the_bending_mode_lies():
    vibration = ResponseFigures(0.1, 0.8, 3.5, 560.0, 8.0, 2.0)
    assert "lies inside the band" in other_answers.band(modes(340.0), vibration).text
    assert "lies above the band" in other_answers.band(modes(980.0), vibration).text
    elastic = ResponseFigures(0.0, 0.8, 3.5, None, None, 2.0)
    assert "resonates" not in other_answers.band(modes(980.0), elastic).text


def test_response_figures_are_those_of_the_damping_that_they_name():
    vibration = response_figures(QUICK)
    # half-power width of a spring with this loss factor, which the contact and the mass of the silicone hardly change
    assert pytest.approx(1 / vibration.loss_factor, rel=0.25) == vibration.Q
    assert vibration.along_z < 1 < vibration.along_x
    assert 500 < vibration.resonance_Hz < 600


@pytest.mark.parametrize(("seconds", "expected"), [(1e-6, "reproduced"), (1.0, "refuted")])
def test_cost(seconds, expected):
    rows = [
        CostRow("formulas, level paper", seconds, -50.0),
        CostRow("formulas, level finite", 1e-4, 5.0),
        CostRow("finite elements, level quick", 0.04, 0.3),
    ]
    assert other_answers.cost(rows).verdict == expected
