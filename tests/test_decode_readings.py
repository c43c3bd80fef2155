"""The verb decode: a round trip through readings, tables as streams, mechanics from states, and bad input."""

import csv
import json

import pytest
from numpy.testing import assert_allclose

from geometry import design_digest
from geometry.design import Design, paper

READINGS = ("readings", "paper", "--shift", "0.5,0.2,-1", "--json")


def volts(run, strict, *tokens):
    (record,) = strict(run(*(tokens or READINGS))[1])
    return ",".join(map(repr, record["readings_V"]))


def test_readings_come_back_as_their_pose(run, strict):
    text = volts(run, strict)
    status, out, err = run("decode", "paper", "--readings", text, "--json")
    assert status == 0
    assert "level finite" in err
    (record,) = strict(out)
    assert_allclose(record["shift_mm"], [0.5, 0.2, -1.0], atol=1e-9)
    assert record["status"] == "ok"
    assert record["multiplicity"] == 1
    assert record["noise_um"] == [None] * 3
    field = ",".join(map(repr, record["readings_T"]))
    (again,) = strict(run("decode", "paper", "--readings", field, "--units", "T", "--json")[1])
    assert_allclose(again["shift_mm"], record["shift_mm"], atol=1e-9)


def test_the_load_is_that_of_the_formulas(run, strict):
    (load,) = strict(run("analytic", "paper", "--depth", 1, "--shear", 0.5, "--json")[1])
    text = ",".join(map(repr, load["readings_V"]))
    (record,) = strict(run("decode", "paper", "--readings", text, "--json")[1])
    assert_allclose(record["force_N"], load["force_N"], atol=1e-8)
    assert_allclose([record["depth_mm"], record["shear_mm"], record["shear_y_mm"]], [1, 0.5, 0], atol=1e-8)


@pytest.mark.parametrize(("text", "word"), [("2.5,2.5,2.5", "out_of_workspace"), ("3,4.8,3", "saturated")])
def test_readings_without_a_pose_end_with_3(run, strict, text, word):
    status, out, err = run("decode", "paper", "--readings", text, "--json")
    (record,) = strict(out)
    assert (status, record["status"], record["shift_mm"]) == (3, word, [None] * 3)
    assert err.count("\n") == 1


def test_ambiguous_readings_warn(run, strict):
    fields = (
        "--set",
        "l0=6",
        "--set",
        "c=2.5",
        "--set",
        "hall_null=50",
        "--set",
        "hall_high=100",
        "--set",
        "hall_low=0",
    )
    found = []
    for shift in ("2.8,2.8,-2", "2.6,2.6,-2.1", "2.9,2.2,-2.2", "2.2,2.9,-2"):
        text = volts(run, strict, "readings", "paper", "--shift", shift, "--json", *fields)
        status, out, err = run("decode", "paper", "--readings", text, "--json", *fields)
        (record,) = strict(out)
        assert status == 0
        assert ("several poses" in err) == (record["multiplicity"] > 1) == (record["status"] == "ambiguous")
        assert record["multiplicity"] == len(record["poses_mm"])
        expected = [float(v) for v in shift.split(",")]
        assert min(max(abs(a - b) for a, b in zip(p, expected, strict=True)) for p in record["poses_mm"]) < 1e-5
        found.append(record["multiplicity"])
    assert max(found) > 1


STATE = {"status": "ok", "shear_y_mm": 0.0, "tilt_y_rad": 0.0, "contact_radius_mm": 1.0}


def state(depth, shear):
    """What a solve would print: the magnet follows and tilts by 0.1 rad/mm."""
    x = 0.5 * shear
    return {
        **STATE,
        "depth_mm": depth,
        "shear_mm": shear,
        "force_N": [0.8 * shear, 0.0, 3.0 * depth],
        "shift_mm": [x, 0.0, -0.6 * depth],
        "tilt_rad": 0.1 * x,
    }


def test_states_of_a_solve_give_tilt_and_load(run, strict, tmp_path):
    states = [state(d, s) for d in (0.0, 1.0, 2.0, 3.0) for s in (0.0, 2.0, 4.0)] + [{"status": "not_converged"}]
    (tmp_path / "states.jsonl").write_text("\n".join(map(json.dumps, states)) + "\n\n")
    text = volts(run, strict, "readings", "paper", "--shift", "0.5,-0.5,-1", "--tilt", "0.05,0.05", "--json")
    decode = ("decode", "paper", "--readings", text, "--responses", "states.jsonl", "--json")
    status, out, _ = run(*decode)
    (record,) = strict(out)
    assert status == 0
    assert_allclose(record["shift_mm"], [0.5, -0.5, -1.0], atol=1e-8)
    assert_allclose([record["tilt_rad"], record["tilt_y_rad"]], [0.05, -0.05], atol=1e-8)
    assert_allclose(record["force_N"], [0.8, -0.8, 5.0], atol=1e-8)
    (flat,) = strict(run(*decode, "--ignore-tilt")[1])
    assert flat["tilt_rad"] == 0
    assert abs(flat["shift_mm"][0] - 0.5) > 0.02


def states_of(design, magnet="rigid"):
    """A file of states that were solved for a design."""
    label = design_digest.label(design_digest.of_mechanics(design, magnet))
    return "".join(json.dumps(state(d, s) | label) + "\n" for d in (0.0, 1.0, 2.0, 3.0) for s in (0.0, 2.0, 4.0))


@pytest.mark.parametrize(
    "tokens", [("decode", "--readings", "3.05,2.97,2.92"), ("layout",), ("table", "--step", 1, "--out", "t.npy")]
)
def test_states_of_another_sensor_are_refused_with_what_differs(refusal, tmp_path, tokens):
    verb, *rest = tokens
    (tmp_path / "states.jsonl").write_text(states_of(Design(D=10.0, L=12.0, E=0.5, l0=9.2)))
    err = refusal(verb, "paper", *rest, "--responses", "states.jsonl", "--json")
    assert "states.jsonl, line 1 was made for another sensor, with D 10 mm, L 12 mm, E 0.5 MPa" in err
    assert "where this design has D 8 mm, L 9 mm, E 1 MPa" in err
    assert not (tmp_path / "t.npy").exists()


def test_states_of_this_sensor_are_taken_whatever_its_elements_are(run, refusal, tmp_path):
    (tmp_path / "states.jsonl").write_text(states_of(paper()))
    command = ("decode", "paper", "--readings", "3.05,2.97,2.92", "--responses", "states.jsonl", "--json")
    assert run(*command, "--set", "f=5.2")[2] == ""
    (tmp_path / "states.jsonl").write_text(states_of(paper(), "ignored"))
    assert "with magnet ignored" in refusal(*command)


def test_states_that_do_not_say_their_sensor_warn(run, strict, tmp_path):
    lines = [json.dumps(state(d, s)) for d in (0.0, 1.0, 2.0, 3.0) for s in (0.0, 2.0, 4.0)]
    (tmp_path / "states.jsonl").write_text("\n".join(lines))
    status, out, err = run("decode", "paper", "--readings", "3.05,2.97,2.92", "--responses", "states.jsonl", "--json")
    assert (status, len(strict(out)), err.count("\n")) == (0, 1, 1)
    assert "states.jsonl does not say for which sensor its states were solved" in err


LABEL = design_digest.label(design_digest.of_mechanics(paper(), "rigid"))


def responses(tmp_path, depth):
    states = [state(depth * share, s) | LABEL for share in (0.0, 0.5, 1.0) for s in (0.0, 2.0, 4.0)]
    (tmp_path / "states.jsonl").write_text("\n".join(map(json.dumps, states)))


OUT = {
    "0,0,-1.25": ("depth", "the magnet is deeper than 1.2 mm, the limit of the states: solve deeper"),
    "2.1,0,-1": (
        "shear",
        "the magnet is more than 2 mm sideways, the limit of the states: solve farther sideways",
    ),
    "0,0,-3.2": (
        "workspace",
        (
            "the magnet is outside the workspace, 2 mm sideways, 1.2 mm down and 0.1 mm up:"
            " press or shear less, or check order and units"
        ),
    ),
}


@pytest.mark.parametrize("shift", OUT)
def test_readings_beyond_the_states_say_what_to_solve(run, strict, tmp_path, shift):
    responses(tmp_path, 2.0)
    end, sentence = OUT[shift]
    tilt = f"0,{0.1 * float(shift.split(',')[0]):g}"
    text = volts(run, strict, "readings", "paper", "--shift", shift, "--tilt", tilt, "--json")
    decode = ("decode", "paper", "--responses", "states.jsonl")
    status, out, err = run(*decode, "--readings", text, "--json")
    (record,) = strict(out)
    assert (status, record["status"], record["beyond"], record["message"]) == (3, "out_of_workspace", end, sentence)
    assert err == f"magtip: {sentence}\n"
    assert_allclose(record["outside_mm"], [float(v) for v in shift.split(",")], atol=1e-6)
    (tmp_path / "r.csv").write_text(f"S1_V,S2_V,S3_V\n{text}\n{text}\n2.5,2.5,2.5\n")
    status, _, err = run(*decode, "--file", "r.csv", "--json")
    assert status == 3
    nowhere = "no pose of the magnet in the workspace gives these readings: check their order and units"
    assert err == f"magtip: 3 of 3 rows out_of_workspace: {sentence} (2 of 3); {nowhere} (1 of 3)\n"


def test_formulas_that_end_ask_for_states(run, strict):
    text = volts(run, strict, "readings", "paper", "--shift", "0,0,-2.5", "--json")
    status, out, _ = run("decode", "paper", "--readings", text, "--json")
    (record,) = strict(out)
    assert (status, record["beyond"]) == (3, "depth")
    assert record["message"].endswith("mm, the limit of the formulas: give states by --responses that go deeper")


def test_a_pose_whose_plate_would_pull_has_no_load(run, strict, tmp_path):
    """At the depths that were solved the force falls with the shear; far aside at no depth it would be a tension."""
    states = [state(d, s) | LABEL for d in (1.0, 2.0, 3.0) for s in (0.0, 1.0, 2.0)]
    for one in states:
        one["force_N"][2] -= 0.5 * one["shear_mm"] ** 2
    (tmp_path / "states.jsonl").write_text("\n".join(map(json.dumps, states)))
    text = volts(run, strict, "readings", "paper", "--shift", "0.9,0,-0.05", "--tilt", "0,0.09", "--json")
    status, out, err = run("decode", "paper", "--readings", text, "--responses", "states.jsonl", "--json")
    (record,) = strict(out)
    assert (status, record["status"], record["force_N"], record["depth_mm"]) == (3, "tension", [None] * 3, None)
    assert_allclose(record["shift_mm"], [0.9, 0, -0.05], atol=1e-8)
    assert "the plate would have to pull on the tip there" in err


def test_a_table_is_decoded_as_a_stream(run, strict, tmp_path):
    one = volts(run, strict)
    rest = volts(run, strict, "readings", "paper", "--json")
    lines = ["time_s,S1_V,S2_V,S3_V", f"0.1,{one}", "0.2,,3,3", "0.3,nan,3,3", f"0.4,{rest}", "0.5,4.9,3,3"]
    (tmp_path / "r.csv").write_text("\n".join(lines) + "\n")
    status, out, err = run("decode", "paper", "--file", "r.csv")
    rows = list(csv.DictReader(out.splitlines()))
    assert status == 3
    assert err.splitlines()[-1] == "magtip: 3 of 5 rows have no answer"
    assert [row["status"] for row in rows] == ["ok", "not_finite", "not_finite", "after_gap", "saturated"]
    assert [row["time_s"] for row in rows] == ["0.1", "0.2", "0.3", "0.4", "0.5"]
    assert_allclose(float(rows[0]["shift_x_mm"]), 0.5, atol=1e-9)
    assert rows[1]["shift_x_mm"] == ""
    assert "2 of 5 rows not_finite" in err
    records = strict(run("decode", "paper", "--file", "r.csv", "--json")[1])
    assert [record["status"] for record in records] == [row["status"] for row in rows]
    assert [record["row"] for record in records] == [1, 2, 3, 4, 5]
    assert records[0]["shift_x_mm"] == float(rows[0]["shift_x_mm"])
    assert records[1]["readings_T"][0] is records[1]["shift_x_mm"] is None
    assert run("decode", "paper", "--file", "r.csv", "--out", "d.csv")[0] == 3
    assert (tmp_path / "d.csv").read_text() == out
    (tmp_path / "bad.csv").write_text("S1_T,S2_T,S3_T\n0,0,0\n")
    assert run("decode", "paper", "--file", "bad.csv", "--units", "T")[0] == 3


@pytest.mark.parametrize(
    ("tokens", "words"),
    [
        ((), "either as --readings"),
        (("--readings", "1,2,3", "--file", "r.csv"), "either as --readings"),
        (("--readings", "1,2"), "takes 3 numbers"),
        (("--readings", "1,2,nan"), "finite"),
        (("--readings", "1,2,3", "--units", "G"), "G"),
        (("--readings", "1,2,3", "--level", "best"), "level must be"),
        (("--readings", "1,2,3", "--out", "d.csv"), "--out works with --file only"),
        (("--readings", "1,2,3", "--level", "paper", "--responses", "s"), "give only one"),
        (("--readings", "1,2,3", "--responses", "none.jsonl"), "no file"),
        (("--readings", "1,2,3", "--responses", "r.csv"), "r.csv, line 1 is not JSON"),
        (("--readings", "1,2,3", "--responses", "nan.jsonl"), "nan.jsonl, line 2: numbers must be finite; got NaN"),
        (("--readings", "1,2,3", "--responses", "inf.jsonl"), "inf.jsonl, line 1: numbers must be finite; got 1e999"),
        (("--readings", "1,2,3", "--responses", "list.jsonl"), "list.jsonl, line 1 must hold a JSON object"),
        (("--readings", "1,2,3", "--responses", "other.jsonl"), "other.jsonl, line 1 is not a state"),
        (("--readings", "1,2,3", "--responses", "empty.csv"), "both presses and shears"),
        (("--readings", "1,2,3", "--set", "magnet_diameter=0", "--set", "magnet_height=0"), "magnet"),
        (("--readings", "1,2,3", "--set", "l0=3", "--set", "c=0"), "inside the beam"),
        (("--readings", "1,2,3", "--units", "V", "--set", "hall_layout=tmag5273a1"), "is a flux density"),
        (
            ("--readings", "0,0,0", "--set", "hall_layout=tmag5273a1", "--set", "chip_x=3", "--set", "l0=4"),
            "chip -z lies inside the beam, at (3, 0, 1) mm",
        ),
        (("--file", "none.csv"), "no file"),
        (("--file", "r.csv"), "in the order S1_V,S2_V,S3_V"),
        (("--file", "text_T.csv", "--units", "T"), "S2_T is missing"),
        (("--file", "tesla.csv"), "S1_T,S2_T,S3_T, not S1_V,S2_V,S3_V: add --units T"),
        (("--file", "good.csv", "--units", "T"), "S1_V,S2_V,S3_V, not S1_T,S2_T,S3_T: add --units V"),
        (("--file", "semicolons.csv"), "semicolons separate its columns"),
        (("--file", "text.csv"), "must be a finite number of V"),
        (("--file", "empty.csv"), "is empty"),
        (("--file", "head.csv"), "has a header but no rows: add a row of numbers below it"),
    ],
)
def test_bad_input_is_a_sentence(refusal, tmp_path, tokens, words):
    (tmp_path / "r.csv").write_text("S2_V,S1_V,S3_V\n1,2,3\n")
    (tmp_path / "text.csv").write_text("S1_V,S2_V,S3_V\n1,two,3\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "head.csv").write_text("S1_V,S2_V,S3_V\n")
    (tmp_path / "text_T.csv").write_text("S1_T,S3_T\n1,3\n")
    (tmp_path / "tesla.csv").write_text("S1_T,S2_T,S3_T\n0.01,0.01,0.01\n")
    (tmp_path / "good.csv").write_text("S1_V,S2_V,S3_V\n3,3,3\n")
    (tmp_path / "semicolons.csv").write_text("S1_V;S2_V;S3_V\n3,1;3;3\n")
    (tmp_path / "nan.jsonl").write_text('{"status": "failed"}\n{"status": "ok", "tilt_rad": NaN}\n')
    (tmp_path / "inf.jsonl").write_text('{"status": "ok", "tilt_rad": 1e999}\n')
    (tmp_path / "list.jsonl").write_text("[1, 2]\n")
    (tmp_path / "other.jsonl").write_text('{"depth_mm": 1}\n')
    assert words in refusal("decode", "paper", *tokens)


def test_a_level_with_tilt_decodes_its_own_readings(run, strict):
    options = ("--level", "finite", "--json")
    (load,) = strict(run("analytic", "paper", "--depth", 1, "--shear", 0.8, *options)[1])
    text = ",".join(map(repr, load["readings_V"]))
    (record,) = strict(run("decode", "paper", "--readings", text, *options)[1])
    (flat,) = strict(run("decode", "paper", "--readings", text, *options, "--ignore-tilt")[1])
    # as well as the polynomials of `analytic.inverse.response_surface` follow the level
    assert_allclose(record["shift_mm"], load["shift_mm"], atol=2e-3)
    assert_allclose(record["force_N"], load["force_N"], atol=0.05)
    assert record["tilt_rad"] == pytest.approx(load["tilt_rad"], abs=2e-3)
    assert abs(flat["shift_mm"][0] - load["shift_mm"][0]) > 0.01


def test_a_pose_beyond_level_finite_says_that_its_error_is_unknown(run, strict):
    """Readings of a press to 2.9 mm, where level finite was compared with finite elements up to 2 mm."""
    for readings, count in (("3.1615,2.9386,2.9386", 1), ("2.967,2.876,2.851", 0)):
        (row,) = strict(run("decode", "paper", f"--readings={readings}", "--level", "finite", "--json")[1])
        said = [text for text in row["warnings"] if "outside the range of level finite" in text]
        assert len(said) == count


def test_a_file_of_a_chip_has_the_columns_that_the_help_names(run, tmp_path, strict):
    names = "chip_-z_T,chip_x_T,chip_y_T"
    assert names in "".join(run("decode", "--help")[1].replace("│", " ").split())
    (tmp_path / "chip.csv").write_text(f"{names}\n0.0100,0.001,0\n", encoding="utf-8")
    words = ("--set", "hall_layout=mlx90393", "--set", "l0=8", "--level", "finite", "--json")
    status, out, _ = run("decode", "paper", "--file", tmp_path / "chip.csv", *words)
    assert status == 0
    assert strict(out)[0]["force_z_N"] > 0
