"""Verdicts on figures that stand on either side of a claim."""

import math

import numpy as np
import pytest

from fem.accuracy import QUICK
from studies.validation import claim_states, claims
from studies.validation.claim_errors import HEIGHT_FIGURES, TIP_FIGURES, formula, height_row
from studies.validation.claim_states import Press, States
from studies.validation.claims import verdict
from studies.validation.sensor_figures import response_figures

DEPTH = np.linspace(0.25, 3.0, 12)
NAN = math.nan
LOOPS = ("fem_percent", "spring_percent", "sine_percent")
FACTOR = {"rest_mT": 12.0, "polarisation_T": 0.026, "rest_V": 0.1, "face_V": 0.2, "pairs": []}
RESPONSE = ("along_z", "along_x", "resonance_Hz", "Q", "accurate_Hz")


def response(*figures):
    return {"loss_factor": 0.1} | dict(zip(RESPONSE, figures, strict=True))


def tip(name, *figures):
    return {"tip": name} | dict(zip(TIP_FIGURES, figures, strict=True))


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
        *(claims.at_each_depth(rows), claims.of_largest(rows, none), claims.voltage(rows, 2.0)),
        *(claims.largest_forces(none), claims.shear_force([], 0.6), claims.tilt_as_cause([])),
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
    assert claims.at_each_depth(rows).verdict == each
    assert claims.of_largest(rows, states(force)).verdict == largest
    assert claims.voltage(rows, 2.0).verdict == voltage


def test_the_band_of_moduli_is_in_the_sentence():
    figures = (0.58, 0.61, 0.6, 3.0, 42.0, -70.0, 0.25, 1.0, 60.0, 25.0, 7.0, 9.0, 6.0)
    row = {"magnet_height_mm": 2.0, "l0_mm": 7.2, "reached_mm": 3.0} | dict(zip(HEIGHT_FIGURES, figures, strict=True))
    text = claims.of_largest([row], states(formula(DEPTH))).text
    assert "E from 0.58 to 0.61 MPa with a magnet 2 mm high" in text
    taller = row | {"magnet_height_mm": 2.5, "E_from_MPa": NAN, "E_to_MPa": NAN}
    text = claims.of_largest([row, taller], states(formula(DEPTH))).text
    assert "no modulus makes it true with a magnet of 2.5 mm or more" in text
    none = row | {"E_from_MPa": NAN, "E_to_MPa": NAN}
    assert "for no modulus" in claims.of_largest([none], states(formula(DEPTH))).text


def test_forces_at_the_same_depth_are_proportional_to_E():
    answer = claims.largest_forces(states(formula(DEPTH)))
    assert answer.verdict == "refuted"
    assert answer.figures["depth_mm_at_9_N"] == answer.figures["depth_mm_at_18_N"]
    assert answer.figures["error_percent_at_3_N"] == pytest.approx(0)


def test_forces_in_proportion_to_E_would_reproduce_the_largest_ones(monkeypatch):
    monkeypatch.setattr(claims, "CLAIMED", ((1.0, 3.0), (5.0, 15.0)))
    reach = DEPTH[np.searchsorted(formula(DEPTH), 3.0)]
    force = np.where(reach >= DEPTH, formula(DEPTH), 2 * formula(DEPTH))
    scale = 3.0 / float(np.interp(reach, DEPTH, force))
    assert claims.largest_forces(states(force)).verdict == "refuted"
    monkeypatch.setattr(claims, "CLAIMED", ((1.0, 3.0 / scale), (5.0, 15.0 / scale)))
    assert claims.largest_forces(states(force)).verdict == "reproduced"


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
    vibration = response(*readings, None, None, accurate)
    assert claims.band(modes(bending), vibration).verdict == expected


@pytest.mark.parametrize(
    ("percent", "expected"), [(0.5, "reproduced"), (8.0, "not decidable"), (150.0, "refuted"), (NAN, "not decidable")]
)
def test_hysteresis(percent, expected):
    assert claims.hysteresis({"loss_factor": 0.1} | dict.fromkeys(LOOPS, percent)).verdict == expected


@pytest.mark.parametrize(
    ("polarisation", "expected"), [(0.026, "refuted"), (1.2, "reproduced"), (NAN, "not decidable")]
)
def test_hall_factor(polarisation, expected):
    assert claims.hall_factor(FACTOR | {"polarisation_T": polarisation}).verdict == expected


@pytest.mark.parametrize(("l0", "expected"), [(7.2, "reproduced"), (2.0, "refuted"), (NAN, "not decidable")])
def test_offset(l0, expected):
    assert claims.offset(FACTOR | {"pairs": [(2.0, l0)]}).verdict == expected


@pytest.mark.parametrize(("error", "expected"), [(50.0, "reproduced"), (4.0, "refuted")])
def test_shear_force(error, expected):
    tips = [
        tip("stuck to a plate", 0.5, error, error, error, 1.5, 10.0, NAN, NAN),
        tip("gripped", 0.8, 1.0, 1.0, 1.0, 1.0, 1.0, 0.96, 1.04),
    ]
    assert claims.shear_force(tips, 0.6).verdict == expected


@pytest.mark.parametrize(("tilt", "expected"), [(0.9, "reproduced"), (0.1, "refuted")])
def test_tilt_as_cause(tilt, expected):
    row = {"shear_mm": 1.0, "fem_force_x_N": 1.0, "error_N": 1.0, "tilt_N": tilt}
    rows = [row | dict.fromkeys(("geometry_N", "force_law_N"), (1 - tilt) / 2)]
    assert claims.tilt_as_cause([("stuck", rows)]).verdict == expected


@pytest.mark.parametrize(
    ("shares", "expected"), [((0.0, 0.0), "reproduced"), ((0.0, 5.0), "not decidable"), ((1.0, 5.0), "refuted")]
)
def test_uniqueness(shares, expected):
    place = {"magnet_height_mm": 2.0, "l0_mm": 7.2, "readings": "B.n", "apart_mm": 0.5}
    rows = [place | {"c_mm": c, "ambiguous_percent": share} for c, share in zip((2.0, 5.0), shares, strict=True)]
    assert claims.uniqueness(rows).verdict == expected


def modes(bending):
    frequencies = {"bending_Hz": bending, "axial_Hz": 1000.0}
    return [
        {"magnet": magnet, "depth_mm": depth} | frequencies for magnet in ("rigid", "ignored") for depth in (0.0, 1.0)
    ]


@pytest.mark.parametrize(("bending", "expected"), [(980.0, "reproduced"), (340.0, "refuted")])
def test_frequency(bending, expected):
    formulas = {"third_of_silicone": 1010.0, "with_magnet": 667.0}
    assert claims.frequency(modes(bending), formulas).verdict == expected


def test_band_says_where_the_bending_mode_lies():
    vibration = response(0.8, 3.5, 560.0, 8.0, 2.0)
    assert "lies inside the band" in claims.band(modes(340.0), vibration).text
    assert "lies above the band" in claims.band(modes(980.0), vibration).text
    elastic = response(0.8, 3.5, None, None, 2.0)
    assert "resonates" not in claims.band(modes(980.0), elastic).text


def test_response_figures_are_those_of_the_damping_that_they_name():
    vibration = response_figures(QUICK)
    # half-power width of a spring with this loss factor, which the contact and the mass of the silicone hardly change
    assert vibration["Q"] == pytest.approx(1 / vibration["loss_factor"], rel=0.25)
    assert vibration["along_z"] < 1 < vibration["along_x"]
    assert 500 < vibration["resonance_Hz"] < 600


@pytest.mark.parametrize(("seconds", "expected"), [(1e-6, "reproduced"), (1.0, "refuted")])
def test_cost(seconds, expected):
    rows = [
        {"model": "formulas, level paper", "seconds": seconds, "worst_error_percent": -50.0},
        {"model": "formulas, level finite", "seconds": 1e-4, "worst_error_percent": 5.0},
        {"model": "finite elements, level quick", "seconds": 0.04, "worst_error_percent": 0.3},
    ]
    assert claims.cost(rows).verdict == expected
