"""The claims on few loads: the verb, its verdicts, and the files; and on figures whose answer is known."""

import contextlib
import io
import json
import math

import numpy as np
import pandas as pd
import pytest

from analytic import beam, hall
from geometry.design import paper
from geometry.loads import Response
from studies.cli import entry_point
from studies.validation.formulas import claim_errors, claims
from studies.validation.formulas.claim_errors import TIP_FIGURES, Press, States, formula, height_row

VERDICTS = {
    "the same, relative to the largest force": "not decidable",
    "voltage of S1 against F_N": "refuted",
    "F_mu by (6) against measurement, delta to 3.1 mm": "reproduced",
    "the ignored tilt of the magnet causes most of it": "refuted",
    "look-up table unique to each location": "not decidable",
    "natural frequency": "refuted",
    "hysteresis along z": "not decidable",
    "offset of S1": "reproduced",
    "simple and faster than a finite element model": "reproduced",
}
NAN, approx = math.nan, pytest.approx


def test_the_quick_study(tmp_path):
    """With the preset's magnet about 0.6 MPa make the claim true; the decoded force is the sum of its parts."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert entry_point.main(["validate", "formulas", "claims", "--quick", "--out", str(tmp_path), "--json"]) == 0
    answers = {row["claim"]: row for row in map(json.loads, said.getvalue().splitlines())}
    assert {claim: answers[claim]["verdict"] for claim in VERDICTS} == VERDICTS
    assert {path.name for path in tmp_path.glob("[!.]*")} == set(claims.FILES)
    text = (tmp_path / "CLAIMS.md").read_text("utf-8")
    assert "Made with `magtip validate formulas claims --quick" in text
    assert all(f"]({name})" in text for name in claims.FILES if name.endswith(".png"))
    heights, parts = (pd.read_csv(tmp_path / f"{name}.csv") for name in ("heights", "parts"))
    own = heights[heights.magnet_height_mm == 2].iloc[0]
    assert 0.57 < own.E_from_MPa < own.E_to_MPa < 0.62
    whole = parts.fem_force_x_N + parts.tilt_N + parts.geometry_N + parts.force_law_N
    assert whole.to_numpy() == approx(parts.decoded_force_x_N.to_numpy(), abs=2e-5)
    figures = {claim: answer["figures"] for claim, answer in answers.items()}
    loop = figures["hysteresis along z"]
    assert loop["gap_percent"] == approx(8.0, abs=0.1)
    # for a sine the gap of a spring is the sine of the loss angle
    assert loop["allowed_loss_factor_sine"] == approx(0.1, rel=0.01)
    assert figures["Hall factor"]["polarisation_T"] == approx(0.026, abs=1e-3)
    band = figures["usable to 600 Hz and above"]
    # half-power width of a spring with this loss factor, which the contact and the mass of the silicone hardly change
    assert band["resonance_Q"] == approx(1 / band["loss_factor"], rel=0.25)
    assert band["relative_reading_z_at_600"] < 1 < band["relative_reading_x_at_600"]
    assert 500 < band["resonance_Hz"] < 600


# For which moduli is a formula within a bound? On forces whose answer is known

DEPTH = np.linspace(0.25, 3.0, 12)


def press(force, height=2.0):
    """Presses of the preset's magnet with a given force at 1 MPa."""
    lost = () if np.isfinite(force).all() else (0.0, "not_converged", "elements fold")
    return Press(claim_errors.with_magnet(height), DEPTH, force, DEPTH * 5 / 9, *lost)


def test_an_interval_ends_where_the_error_is_the_bound():
    """At both ends some depth has exactly the error that is allowed, and no depth a larger one."""
    predicted, force = formula(DEPTH), 0.9 * DEPTH**1.8
    for E in claim_errors.modulus_interval(predicted, force, np.full_like(force, 0.3 * force.max())):
        assert claim_errors.error_of_largest(predicted, force, E) == approx(30)


def test_a_sensor_that_is_the_formula_has_no_error_and_presses_that_stop_have_no_answer():
    force = formula(DEPTH)
    row = height_row(press(force))
    assert (row["best_E_MPa"], row["best_error_percent_of_largest"]) == (approx(1.0), approx(0, abs=1e-5))
    assert row["error_percent_of_largest"] == row["worst_error_percent"] == 0
    assert row["each_depth_from_mm"] == DEPTH[0]
    # the paper's quadrature of the field, and the depths between those of the presses
    assert row["S1_error_percent"] < 0.1
    force[-2:] = NAN
    row = height_row(press(force))
    assert (row["reached_mm"], row["status"], row["message"]) == (DEPTH[-3], "not_converged", "elements fold")
    assert np.isnan(row["best_E_MPa"])


@pytest.mark.parametrize(("second", "expected"), [(0.02, 0.02), (NAN, NAN)])
def test_an_unknown_error_estimate_is_not_left_out(second, expected):
    """Of a load that the sensor refuses, there is no force whose error could be known."""
    columns = ["depth_mm", "fem_force_N", "fem_shift_z_mm", "error_estimate", "message", "status"]
    rows = [(1.0, 1.0, -0.5, 0.01, "", "ok"), (2.0, 1.0, -0.5, second, "", "ok")]
    rows.append((9.0, NAN, NAN, NAN, "too deep", "bad_input"))
    found = claim_errors.press_of(paper(), pd.DataFrame(rows, columns=columns))
    assert found.error_estimate == approx(expected, nan_ok=True)
    assert (found.status, found.message, found.complete) == ("bad_input", "too deep", False)


# Errors of (6) and their parts, on shears whose parts are known

STIFFNESS, LEVER = beam.cantilever_stiffness(paper()), paper().H / paper().L


def sheared(stiffness=STIFFNESS, lever=LEVER, tilt=0.0):
    """Shears with a force, a shift and a tilt in proportion, as rows of the engine."""
    rows = []
    for shear in (0.0, 1.0, 2.0, 3.0):
        response = Response((stiffness * shear, 0.0, 4.0), (lever * shear, 0.0, -0.5), tilt * shear, 2.0)
        row = {"tip": "held", "shear_mm": shear, "fem_force_x_N": response.force[0], "fem_force_N": 4.0}
        row |= {"fem_shift_x_mm": response.shift[0], "fem_tilt_rad": response.tilt}
        readings = np.array(hall.readings(paper(), response).B_T)
        rows.append(row | {f"fem_S{k + 1}_mT": 1e3 * readings[k] for k in range(3)})
    return pd.DataFrame(rows)


def test_a_stiffer_beam_needs_a_larger_modulus():
    row = claim_errors.tip_row(sheared(stiffness=STIFFNESS / 2))
    assert row["worst_error_percent"] == approx(100)
    assert (row["best_E_MPa"], row["best_error_percent"]) == (approx(2), approx(0, abs=1e-9))
    assert (row["within_5_percent_from_E_MPa"], row["within_5_percent_to_E_MPa"]) == approx((2 / 1.05, 2 / 0.95))


@pytest.mark.parametrize(
    ("changed", "part"),
    [
        ({"stiffness": STIFFNESS / 2}, "force_law_N"),
        ({"lever": 0.8 * LEVER}, "geometry_N"),
        ({"tilt": 0.05}, "tilt_N"),
    ],
)
def test_each_cause_is_its_own_part(changed, part):
    rows = claim_errors.split(sheared(**changed))
    assert len(rows) == 3
    assert claim_errors.share(rows, part) == approx(100, abs=0.1)
    parts = rows["tilt_N"] + rows["geometry_N"] + rows["force_law_N"]
    assert parts.to_numpy() == approx(rows["error_N"].to_numpy())


# Verdicts on figures that stand on either side of a claim

NOTHING = np.full(12, NAN)
FACTOR = {"rest_mT": 12.0, "polarisation_T": 0.026, "rest_V": 0.1, "face_V": 0.2, "pairs": []}


def states(force):
    return States([press(force)], press(force), pd.DataFrame(), pd.DataFrame())


def tip(name, *figures):
    return {"tip": name} | dict(zip(TIP_FIGURES, figures, strict=True))


@pytest.mark.parametrize(
    ("force", "each", "largest", "voltage"),
    [
        (formula(DEPTH), "reproduced", "reproduced", "reproduced"),
        (2 * formula(DEPTH), "not decidable", "not decidable", "not decidable"),
        (5 * DEPTH**1.2, "refuted", "refuted", "refuted"),
        (NOTHING, "not decidable", "not decidable", "not decidable"),
    ],
    ids=["formula", "other modulus", "other law", "nothing"],
)
def test_presses(force, each, largest, voltage):
    rows = pd.DataFrame([height_row(press(force))])
    assert claims.at_each_depth(rows)["verdict"] == each
    assert claims.of_largest(rows, states(force))["verdict"] == largest
    assert claims.voltage(rows, 2.0)["verdict"] == voltage


def modes(bending):
    rows = [(magnet, depth, bending, 1000.0) for magnet in ("rigid", "ignored") for depth in (0.0, 1.0)]
    return [dict(zip(("magnet", "depth_mm", "bending_Hz", "axial_Hz"), row, strict=True)) for row in rows]


def band(accurate, readings, bending):
    names = ("accurate_with_loss_to_Hz", "relative_reading_z_at_600", "relative_reading_x_at_600")
    vibration = dict(zip(names, (accurate, *readings), strict=True)) | {"loss_factor": 0.1}
    return claims.band(modes(bending), vibration | {"resonance_Hz": None, "resonance_Q": None})


def shear_force(error):
    stuck = tip("stuck to a plate", 0.5, error, error, error, 1.5, 10.0, NAN, NAN)
    return claims.shear_force(pd.DataFrame([stuck, tip("gripped", 0.8, 1.0, 1.0, 1.0, 1.0, 1.0, 0.96, 1.04)]), 0.6)


def tilt_as_cause(tilt, *others):
    row = {"shear_mm": 1.0, "fem_force_x_N": 1.0, "error_N": 1.0, "tilt_N": tilt}
    rows = pd.DataFrame([row | dict.fromkeys(("tip", "geometry_N", "force_law_N"), (1 - tilt) / 2)])
    return claims.tilt_as_cause([rows, *(rows[:count] for count in others)])


def uniqueness(*shares):
    place = {"magnet_height_mm": 2.0, "l0_mm": 7.2, "readings": "B.n", "apart_mm": 0.5}
    rows = [place | {"c_mm": c, "ambiguous_percent": share} for c, share in zip((2.0, 5.0), shares, strict=True)]
    return claims.uniqueness(pd.DataFrame(rows))


def cost(seconds):
    rows = [("formulas, level paper", seconds, -50.0), ("formulas, level finite", 1e-4, 5.0)]
    rows.append(("finite elements, level quick", 0.04, 0.3))
    return claims.cost([dict(zip(("model", "seconds", "worst_error_percent"), row, strict=True)) for row in rows])


@pytest.mark.parametrize(
    ("answered", "expected"),
    [
        (lambda: band(900.0, (1.0, 1.0), 3000.0), "reproduced"),
        (lambda: band(2.0, (0.8, 3.5), 340.0), "not decidable"),
        (lambda: band(2.0, (0.8, 0.5), 340.0), "refuted"),
        (lambda: band(2.0, (NAN, 3.5), 340.0), "not decidable"),
        (lambda: claims.hysteresis(0.1, 0.5, 0.5, 0.5), "reproduced"),
        (lambda: claims.hysteresis(0.1, 8.0, 8.0, 8.0), "not decidable"),
        (lambda: claims.hysteresis(0.1, 150.0, 150.0, 150.0), "refuted"),
        (lambda: claims.hysteresis(0.1, NAN, NAN, NAN), "not decidable"),
        (lambda: claims.hall_factor(FACTOR), "refuted"),
        (lambda: claims.hall_factor(FACTOR | {"polarisation_T": 1.2}), "reproduced"),
        (lambda: claims.hall_factor(FACTOR | {"polarisation_T": NAN}), "not decidable"),
        (lambda: claims.offset(FACTOR | {"pairs": [(2.0, 7.2)]}), "reproduced"),
        (lambda: claims.offset(FACTOR | {"pairs": [(2.0, 2.0)]}), "refuted"),
        (lambda: claims.offset(FACTOR | {"pairs": [(2.0, NAN)]}), "not decidable"),
        (lambda: shear_force(50.0), "reproduced"),
        (lambda: shear_force(4.0), "refuted"),
        (lambda: shear_force(NAN), "not decidable"),
        (lambda: tilt_as_cause(0.9), "reproduced"),
        (lambda: tilt_as_cause(0.1), "refuted"),
        (lambda: tilt_as_cause(0.9, 0), "not decidable"),
        (lambda: claims.tilt_as_cause([]), "not decidable"),
        (lambda: claims.largest_forces(states(NOTHING)), "not decidable"),
        (lambda: uniqueness(0.0, 0.0), "reproduced"),
        (lambda: uniqueness(0.0, 5.0), "not decidable"),
        (lambda: uniqueness(1.0, 5.0), "refuted"),
        (lambda: claims.frequency(modes(980.0)), "reproduced"),
        (lambda: claims.frequency(modes(340.0)), "refuted"),
        (lambda: cost(1e-6), "reproduced"),
        (lambda: cost(1.0), "refuted"),
    ],
)
def test_figures_on_either_side_of_a_claim_and_unknown_ones_decide_it(answered, expected):
    assert answered()["verdict"] == expected
