"""The verb readings at a pose and in the states of a file, and the export to magpylib."""

import json

import pytest
from numpy.testing import assert_allclose

from analytic import hall
from geometry import design_digest
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Response
from studies.inputs import table_input
from studies.sensing import field_readings
from studies.simulation import state_rows


@pytest.mark.parametrize(
    "tokens",
    [
        ("readings", "paper", "--shift", "1,2,x"),
        ("readings", "paper", "--ambient", "1,2"),
        ("readings", "paper", "--seed", "-1"),
        ("readings", "paper", "--set", "hall_layout=four"),
    ],
)
def test_bad_options_are_a_sentence(refusal, tokens):
    refusal(*tokens)


def test_readings_as_json(run, strict):
    status, out, err = run("readings", "paper", "--shift", "0.5,0,-1", "--tilt", "0,0.05", "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    expected = hall.readings(paper(), shift=(0.5, 0, -1), tilt=(0, 0.05))
    assert record["readings_T"] == list(expected.B_T)
    assert record["readings_V"] == list(expected.V)
    assert record["elements"] == ["S1", "S2", "S3"]
    assert record["saturated"] == [False] * 3


def test_readings_say_what_is_wrong(run, strict):
    status, out, err = run("readings", "paper", "--shift", "3,0,-2", "--set", "hall_high=3", "--json")
    (record,) = strict(out)
    assert status == 0
    assert any("S2 is saturated" in text for text in record["warnings"])
    assert any("extends over S2" in text for text in record["warnings"])
    assert err.count("warning") == len(record["warnings"])


def test_readings_of_a_chip_and_of_noise(run, strict):
    (chip,) = strict(run("readings", "paper", "--set", "hall_layout=tle493d-p2b6", "--json")[1])
    assert chip["readings_V"] is None
    assert len(chip["output_T"]) == 3
    assert_allclose(chip["noise_of_readings_T"], (1e-4**2 + 1.3e-4**2 / 12) ** 0.5)
    (mean,) = strict(
        run("readings", "paper", "--set", "hall_layout=tle493d-p2b6", "--set", "hall_average=100", "--json")[1]
    )
    # the chip's noise of 0.1 mT dithers its steps of 0.13 mT
    assert_allclose(mean["noise_of_readings_T"], chip["noise_of_readings_T"][0] / 10, rtol=1e-6)
    noisy = [
        strict(run("readings", "paper", "--set", "hall_noise=0.01", "--seed", s, "--json")[1])[0]["readings_V"]
        for s in (1, 1, 2)
    ]
    assert noisy[0] == noisy[1] != noisy[2]


@pytest.mark.parametrize(("layout", "north"), [("three", "down"), ("tmag5273a1", "down"), ("three", "up")])
def test_magpylib_agrees_on_readings(layout, north):
    design, shift, tilt = Design(hall_layout=layout, magnet_north=north), (0.6, -0.3, -1.1), (0.08, 0.15)
    exported = field_readings.to_magpylib(design, shift, tilt)
    (magnet,) = exported.sources
    seen = [sensor.getB(magnet)[2] for sensor in exported.sensors]
    assert_allclose(seen, hall.readings(design, shift=shift, tilt=tilt).B_T, rtol=1e-10, atol=1e-14)
    with pytest.raises(BadInput, match="no magnet"):
        field_readings.to_magpylib(Design(magnet_diameter=0, magnet_height=0))
    assert_allclose(exported.sensors[0].position, [0, 0, -2.2e-3], atol=1e-15)


def test_what_runs_into_a_chip_is_said_once(run, strict):
    tokens = ("--set", "hall_layout=tmag5273a1", "--set", "chip_x=3", "--set", "l0=4", "--json")
    (record,) = strict(run("readings", "paper", *tokens)[1])
    (warning,) = record["warnings"]
    assert warning == "the beam's wall overlaps chip -z by about 1 mm: raise l0 or chip_x"


LABEL = design_digest.label(design_digest.of_mechanics(paper()))
POSE = {"shift_mm": [0.4, -0.2, -0.8], "tilt_rad": 0.12, "tilt_y_rad": -0.07}
STATE = {"status": "ok", "depth_mm": 1.0, "shear_mm": 0.5, "shear_y_mm": -0.3, "force_N": [0.4, -0.2, 3.0], **POSE}
BROKEN = {"status": "not_converged", "message": "stopped", "depth_mm": 2.0, "shear_mm": 0.0, "shift_mm": None}


def write(folder, *states, label=LABEL):
    (folder / "states.jsonl").write_text("".join(json.dumps(state | label) + "\n" for state in states))
    return ("readings", "paper", "--responses", "states.jsonl")


def test_each_state_is_read_at_its_own_pose(run, strict, tmp_path):
    status, out, err = run(*write(tmp_path, STATE, STATE | {"shift_mm": [0.1, 0.0, -0.5]}), "--json")
    assert (status, err) == (0, "")
    rows = strict(out)
    for row, shift in zip(rows, ((0.4, -0.2, -0.8), (0.1, 0.0, -0.5)), strict=True):
        expected = hall.readings(paper(), Response((0.0,) * 3, shift, 0.12, 0.0, -0.07))
        assert row["readings_T"] == list(expected.B_T)
        assert row["readings_V"] == list(expected.V)
        assert (row["tilt_rad"], row["tilt_y_rad"], row["rotation_rad"]) == (0.12, -0.07, [0.07, 0.12])
        assert (row["status"], row["depth_mm"], row["shear_mm"], row["shear_y_mm"]) == ("ok", 1.0, 0.5, -0.3)
    pose = ("--shift", "0.4,-0.2,-0.8", "--tilt", ",".join(map(repr, rows[0]["rotation_rad"])))
    (record,) = strict(run("readings", "paper", *pose, "--json")[1])
    assert record["readings_T"] == rows[0]["readings_T"]


def test_a_solve_leans_the_magnet_to_where_it_is_moved(run, strict, tmp_path):
    """Moved along y instead of x, S3 reads what S2 did: the sensor is the same in a mirror that swaps x and y."""
    found = []
    for shear in ("--shear", "--shear-y"):
        out = run("solve", "paper", "--grip", 2, shear, 0.5, "--accuracy", "quick", "--json")[1]
        (tmp_path / "states.jsonl").write_text(out)
        (state,) = strict(out)
        (row,) = strict(run("readings", "paper", "--responses", "states.jsonl", "--json")[1])
        assert row["rotation_rad"] == state["rotation_rad"] == [-state["tilt_y_rad"], state["tilt_rad"]]
        found.append((state, row))
    (x, along_x), (y, along_y) = found
    assert x["tilt_rad"] > 0.01
    assert x["shift_mm"][0] > 0
    assert y["tilt_y_rad"] == pytest.approx(x["tilt_rad"], rel=1e-9)
    s1, s2, s3 = along_x["readings_T"]
    assert_allclose(along_y["readings_T"], [s1, s3, s2], rtol=1e-9)
    assert abs(s2 - s3) > 1e-4


def test_a_state_without_a_pose_keeps_its_row(run, strict, tmp_path):
    status, out, err = run(*write(tmp_path, STATE, BROKEN), "--json")
    rows = strict(out)
    assert (status, [row["status"] for row in rows]) == (0, ["ok", "not_converged"])
    assert (rows[1]["readings_T"], rows[1]["message"]) == (None, "stopped")
    assert err == "magtip: 1 of 2 states failed; the last status is not_converged\n"
    assert run(*write(tmp_path, BROKEN), "--json")[0] == 3
    out = run(*write(tmp_path, STATE, BROKEN))[1]
    assert "rotation" in out
    assert "not_converged" in out


def test_warnings_name_their_states(run, tmp_path):
    _, _, err = run(*write(tmp_path, STATE, STATE | {"depth_mm": 2.0}), "--set", "hall_high=2.6")
    assert "magtip: warning: depth 1, 2 mm: S1 is saturated" in err


@pytest.mark.parametrize(
    ("tokens", "words"),
    [
        (("--tilt", "0,0.1"), "leave --shift and --tilt out"),
        (("--shift", "0,0,-1"), "leave --shift and --tilt out"),
        (("--set", "E=2"), "line 1 was made for another sensor, with E 1 MPa where this design has E 2 MPa"),
        (("--level", "best"), "level"),
    ],
)
def test_bad_input_is_a_sentence(refusal, tmp_path, tokens, words):
    assert words in refusal(*write(tmp_path, STATE), *tokens)


def test_a_file_without_states_and_a_pose_without_a_field_are_sentences(run, tmp_path):
    status, out, err = run(*write(tmp_path))
    assert (status, out, "contains no states" in err) == (2, "", True)
    # the magnet's rim at S1, where the field is infinite
    rim = STATE | {"shift_mm": [2.0, 0.0, -6.2], "tilt_rad": 0.0, "tilt_y_rad": 0.0}
    status, out, err = run(*write(tmp_path, rim))
    assert (status, out, "states.jsonl, line 1: " in err) == (2, "", True)


def test_a_seed_for_elements_without_noise_is_in_vain(run):
    assert run("readings", "paper", "--seed", 1, "--json")[2] == (
        "magtip: warning: --seed has no effect: hall_noise is 0\n"
    )
    assert run("readings", "paper", "--seed", 1, "--set", "hall_noise=0.01", "--json")[2] == ""
    assert Design(hall_layout="tmag5273a1").unused_field_warnings() == []


def solved_by_formulas(run, folder):
    lines = [
        run("analytic", "paper", "--level", "finite", "--depth", depth, "--shear", shear, "--json")[1]
        for depth in (0.3, 0.6, 0.9, 1.2)
        for shear in (0.0, 0.5, 1.0)
    ]
    (folder / "states.jsonl").write_text("".join(lines))


def test_states_have_the_resolution_that_the_decoder_states(run, strict, tmp_path):
    solved_by_formulas(run, tmp_path)
    design = ("paper", "--responses", "states.jsonl", "--set", "hall_noise=0.001", "--set", "hall_average=4")
    rows = strict(run("readings", *design, "--json")[1])
    for row in (rows[3], rows[7]):
        volts = ",".join(map(str, row["readings_V"]))
        (decoded,) = strict(run("decode", *design, "--readings", volts, "--json")[1])
        assert_allclose(row["resolution_N"], decoded["noise_N"], rtol=1e-4)
        # the decoder's force is that of the fitted polynomials
        assert_allclose(row["resolution_N_per_N"], decoded["noise_N_per_N"], rtol=2e-3)
    assert "resolution" in run("readings", *design)[1]


def test_states_that_do_not_determine_the_mechanics_have_no_resolution(run, strict, tmp_path):
    (row,) = strict(run(*write(tmp_path, STATE), "--set", "hall_noise=0.001", "--json")[1])
    assert row["resolution_N"] is None
    solved_by_formulas(run, tmp_path)
    rows = strict(run("readings", "paper", "--responses", "states.jsonl", "--json")[1])
    assert {row["resolution_N"] for row in rows} == {None}


@pytest.mark.parametrize(
    "load",
    [
        Load(depth=1.0),
        Load(1.0, 0.5, friction="stick"),
        Load(1.0, 0.5, 0.2, friction=0.3),
        Load(shear_x=0.5, grip=2.0),
        Load(1.0, imperfection=0.01),
    ],
)
def test_a_load_comes_back_from_a_file_as_it_was(tmp_path, load):
    row = state_rows.state_row(load, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0, 0.0), "paper", LABEL)
    file = tmp_path / "states.jsonl"
    file.write_text(json.dumps(row | LABEL))
    (state,) = table_input.read_states(file, paper())
    assert state.load == load
