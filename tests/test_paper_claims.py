"""The claims on few loads: the verb, its verdicts, and the files."""

import csv
import json

import pytest

from studies.cli import entry_point
from studies.validation import claims
from studies.validation.claims import hall_factor, hysteresis
from studies.validation.sensor_figures import factor_figures, loop_figures

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


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("claims")
    assert entry_point.main(["validate", "claims", "--quick", "--out", str(out), "--json"]) == 0
    return out


def test_all_files_are_written(folder):
    assert {path.name for path in folder.glob("[!.]*")} == set(claims.FILES)


def test_verdicts(folder):
    with (folder / "claims.csv").open(encoding="utf-8") as file:
        found = {row["claim"]: row["verdict"] for row in csv.DictReader(file)}
    assert {claim: found[claim] for claim in VERDICTS} == VERDICTS


def test_the_modulus_that_makes_the_claim_true(folder):
    """With the preset's magnet: about 0.6 MPa."""
    with (folder / "heights.csv").open(encoding="utf-8") as file:
        rows = {float(row["magnet_height_mm"]): row for row in csv.DictReader(file)}
    low, high = float(rows[2.0]["E_from_MPa"]), float(rows[2.0]["E_to_MPa"])
    assert 0.57 < low < high < 0.62


def test_report_names_its_command_and_every_picture(folder):
    text = (folder / "CLAIMS.md").read_text("utf-8")
    assert "Made with `magtip validate claims --quick" in text
    assert all(f"]({name})" in text for name in claims.FILES if name.endswith(".png"))


def test_decoded_force_is_the_sum_of_its_parts(folder):
    with (folder / "parts.csv").open(encoding="utf-8") as file:
        rows = [{k: v if k == "tip" else float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    assert rows
    for row in rows:  # of six digits
        parts = row["tilt_N"] + row["geometry_N"] + row["force_law_N"]
        assert row["fem_force_x_N"] + parts == pytest.approx(row["decoded_force_x_N"], abs=2e-5)


def test_the_gap_of_a_loading_cycle_allows_a_loss_factor():
    figures = hysteresis(loop_figures()).figures
    assert figures["gap_percent"] == pytest.approx(8.0, abs=0.1)
    # for a sine the gap of a spring is the sine of the loss angle
    assert figures["allowed_loss_factor_sine"] == pytest.approx(0.1, rel=0.01)


def test_rows_of_json_have_figures():
    row = json.loads(json.dumps(hall_factor(factor_figures()).row()))
    assert row["figures"]["polarisation_T"] == pytest.approx(0.026, abs=1e-3)
