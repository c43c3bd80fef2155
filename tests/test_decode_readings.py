"""The verb decode: a round trip through readings, tables as streams, levels, mechanics from states, and bad input."""

import csv
import json
import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam, hall
from analytic.decode import decode, decoder
from analytic.stream import Stream
from fem.accuracy import QUICK
from fem.equilibrium import solve, trace
from geometry import design_digest
from geometry.bad_input import SolveFailed
from geometry.design import Design, paper
from geometry.loads import Load
from studies.inputs.table_input import split_head
from studies.sensing import decode_readings
from studies.simulation import mechanics_sources

UPRIGHT = ("--level", "paper")
"""Formulas by which the magnet does not tilt, as in the poses of the tests."""
READINGS = ("readings", "paper", "--shift", "0.5,0.2,-1", "--json")


def volts(run, strict, *tokens):
    (record,) = strict(run(*(tokens or READINGS))[1])
    return ",".join(map(repr, record["readings_V"]))


def test_readings_come_back_as_their_pose(run, strict):
    text = volts(run, strict)
    status, out, err = run("decode", "paper", "--readings", text, "--json", *UPRIGHT)
    assert status == 0
    assert "level finite" in err
    (record,) = strict(out)
    assert_allclose(record["shift_mm"], [0.5, 0.2, -1.0], atol=1e-9)
    assert record["status"] == "ok"
    assert record["multiplicity"] == 1
    assert record["noise_um"] == [None] * 3
    field = ",".join(map(repr, record["readings_T"]))
    (again,) = strict(run("decode", "paper", "--readings", field, "--units", "T", "--json", *UPRIGHT)[1])
    assert_allclose(again["shift_mm"], record["shift_mm"], atol=1e-9)


@pytest.mark.parametrize(("text", "word"), [("2.5,2.5,2.5", "out_of_workspace"), ("3,4.8,3", "saturated")])
def test_readings_without_a_pose_end_with_3(run, strict, text, word):
    status, out, err = run("decode", "paper", "--readings", text, "--json")
    (record,) = strict(out)
    assert (status, record["status"], record["shift_mm"]) == (3, word, [None] * 3)
    assert err.count("\n") == 1


FOLDED = "--set l0=6 --set c=2.5 --set hall_null=50 --set hall_high=100 --set hall_low=0"


def test_ambiguous_readings_warn(run, strict):
    fields = FOLDED.split()
    found = []
    for shift in ("2.8,2.8,-2", "2.9,2.2,-2.2", "2.2,2.9,-2"):
        text = volts(run, strict, "readings", "paper", "--shift", shift, "--json", *fields)
        status, out, err = run("decode", "paper", "--readings", text, "--json", *fields, *UPRIGHT)
        (record,) = strict(out)
        assert status == 0
        assert ("several poses" in err) == (record["multiplicity"] > 1) == (record["status"] == "ambiguous")
        assert record["multiplicity"] == len(record["poses_mm"])
        expected = [float(v) for v in shift.split(",")]
        assert min(max(abs(a - b) for a, b in zip(p, expected, strict=True)) for p in record["poses_mm"]) < 1e-5
        found.append(record["multiplicity"])
    assert max(found) > 1


STATE = {"status": "ok", "shear_y_mm": 0.0, "tilt_y_rad": 0.0, "contact_radius_mm": 1.0}
LABEL = design_digest.label(design_digest.of_mechanics(paper(), "rigid"))


def state(depth, shear):
    """What a solve would print: the magnet follows and tilts by 0.1 rad/mm."""
    pose = {"shift_mm": [0.5 * shear, 0.0, -0.6 * depth], "tilt_rad": 0.05 * shear}
    return {**STATE, **pose, "depth_mm": depth, "shear_mm": shear, "force_N": [0.8 * shear, 0.0, 3.0 * depth]}


def write_states(folder, depths=(0.0, 1.0, 2.0, 3.0), shears=(0.0, 2.0, 4.0), label=LABEL, change=lambda one: one):
    states = [*(change(state(d, s)) for d in depths for s in shears), {"status": "not_converged"}]
    (folder / "states.jsonl").write_text("\n".join(json.dumps(one | label) for one in states) + "\n\n")


def test_states_of_a_solve_give_tilt_and_load(run, strict, tmp_path):
    write_states(tmp_path)
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


@pytest.mark.parametrize(
    "tokens", [("decode", "--readings", "3.05,2.97,2.92"), ("layout",), ("table", "--step", 1, "--out", "t.npy")]
)
def test_states_of_another_sensor_are_refused_with_what_differs(refusal, tmp_path, tokens):
    verb, *rest = tokens
    other = design_digest.of_mechanics(Design(D=10.0, L=12.0, E=0.5, l0=9.2), "rigid")
    write_states(tmp_path, label=design_digest.label(other))
    err = refusal(verb, "paper", *rest, "--responses", "states.jsonl", "--json")
    assert "states.jsonl, line 1 was made for another sensor, with D 10 mm, L 12 mm, E 0.5 MPa" in err
    assert "where this design has D 8 mm, L 9 mm, E 1 MPa" in err
    assert not (tmp_path / "t.npy").exists()


@pytest.mark.parametrize(
    ("shift", "end", "sentence"),
    [
        (
            "2.1,0,-1",
            "shear",
            "the magnet is more than 2 mm sideways, the limit of the states: solve farther sideways",
        ),
        ("0,0,-3.2", "workspace", "the magnet is outside the workspace, 2 mm sideways, 1.2 mm down and 0.1 mm up: "),
    ],
)
def test_readings_beyond_the_states_say_what_to_solve(run, strict, tmp_path, shift, end, sentence):
    write_states(tmp_path, (0.0, 1.0, 2.0))
    tilt = f"0,{0.1 * float(shift.split(',')[0]):g}"
    text = volts(run, strict, "readings", "paper", "--shift", shift, "--tilt", tilt, "--json")
    decode = ("decode", "paper", "--responses", "states.jsonl")
    status, out, err = run(*decode, "--readings", text, "--json")
    (record,) = strict(out)
    assert (status, record["status"], record["beyond"]) == (3, "out_of_workspace", end)
    assert record["message"].startswith(sentence)
    assert err == f"magtip: {record['message']}\n"
    assert_allclose(record["outside_mm"], [float(v) for v in shift.split(",")], atol=1e-6)
    (tmp_path / "r.csv").write_text(f"S1_V,S2_V,S3_V\n{text}\n{text}\n2.5,2.5,2.5\n")
    status, _, err = run(*decode, "--file", "r.csv", "--json")
    assert status == 3
    nowhere = "no pose of the magnet in the workspace gives these readings: check their order and units"
    assert err == f"magtip: 3 of 3 rows out_of_workspace: {record['message']} (2 of 3); {nowhere} (1 of 3)\n"


def test_a_pose_whose_plate_would_pull_has_no_load(run, strict, tmp_path):
    """At the depths that were solved the force falls with the shear; far aside at no depth it would be a tension."""

    def pulled(one):
        x, y, z = one["force_N"]
        return one | {"force_N": [x, y, z - 0.5 * one["shear_mm"] ** 2]}

    write_states(tmp_path, (1.0, 2.0, 3.0), (0.0, 1.0, 2.0), change=pulled)
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
    status, out, err = run("decode", "paper", "--file", "r.csv", *UPRIGHT)
    rows = list(csv.DictReader(out.splitlines()))
    assert status == 3
    assert err.splitlines()[-1] == "magtip: 3 of 5 rows have no answer"
    assert [row["status"] for row in rows] == ["ok", "not_finite", "not_finite", "after_gap", "saturated"]
    assert [row["time_s"] for row in rows] == ["0.1", "0.2", "0.3", "0.4", "0.5"]
    assert_allclose(float(rows[0]["shift_x_mm"]), 0.5, atol=1e-9)
    assert rows[1]["shift_x_mm"] == ""
    assert "2 of 5 rows not_finite" in err
    records = strict(run("decode", "paper", "--file", "r.csv", "--json", *UPRIGHT)[1])
    assert [record["status"] for record in records] == [row["status"] for row in rows]
    assert [record["row"] for record in records] == [1, 2, 3, 4, 5]
    assert records[0]["shift_x_mm"] == float(rows[0]["shift_x_mm"])
    assert records[1]["readings_T"][0] is records[1]["shift_x_mm"] is None
    assert run("decode", "paper", "--file", "r.csv", "--out", "d.csv", *UPRIGHT)[0] == 3
    assert (tmp_path / "d.csv").read_text() == out
    (tmp_path / "bad.csv").write_text("S1_T,S2_T,S3_T\n0,0,0\n")
    assert run("decode", "paper", "--file", "bad.csv", "--units", "T")[0] == 3


def test_a_chips_own_axes_are_decoded_as_those_of_its_elements(run, strict, tmp_path):
    chip = ("--set", "hall_layout=tmag5273a1")
    (record,) = strict(run(*READINGS, *chip)[1])
    down, x, y = record["readings_T"]
    (tmp_path / "own.csv").write_text(f"chip_x_T,chip_y_T,chip_z_T\n{x},{y},{-down}\n")
    status, out, err = run("decode", "paper", "--file", "own.csv", *chip, *UPRIGHT)
    assert status == 0, err
    (row,) = csv.DictReader(out.splitlines())
    assert_allclose([float(row[f"shift_{axis}_mm"]) for axis in "xyz"], [0.5, 0.2, -1], atol=1e-9)


@pytest.mark.parametrize(
    "head", ["(" + 60_000 * " ", 60_000 * " " + "x [", "a" + 60_000 * " " + "b"], ids=["open", "begun", "none"]
)
def test_a_head_of_blanks_is_read_at_once(head):
    """A pattern with three runs of blanks took 90 s."""
    began = time.process_time()
    assert split_head(" F_x [N] ") == ("F_x", "N")
    split_head(head)
    assert time.process_time() - began < 1


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("", "either as --readings"),
        ("--readings 1,2", "takes 3 numbers"),
        ("--readings 1,2,nan", "finite"),
        ("--readings 1,2,3 --out d.csv", "--out works with --file only"),
        ("--readings 1,2,3 --level paper --responses s", "give only one"),
        ("--readings 1,2,3 --responses none.jsonl", "no file"),
        ("--readings 1,2,3 --responses r.csv", "r.csv, line 1 is not JSON"),
        ("--readings 1,2,3 --responses nan.jsonl", "nan.jsonl, line 2 has a number that is not finite, NaN"),
        ("--readings 1,2,3 --responses other.jsonl", "other.jsonl, line 1 is not a state"),
        ("--readings 1,2,3 --responses empty.csv", "both presses and shears"),
        ("--readings 1,2,3 --set l0=3 --set c=0", "inside the beam"),
        ("--readings 1,2,3 --units V --set hall_layout=tmag5273a1", "is a flux density"),
        (
            "--readings 0,0,0 --set hall_layout=tmag5273a1 --set chip_x=3 --set l0=4",
            "chip -z lies inside the beam, at",
        ),
        ("--file r.csv", "in the order S1_V,S2_V,S3_V"),
        ("--file tesla.csv", "S1_T,S2_T,S3_T, not S1_V,S2_V,S3_V: add --units T"),
        ("--file text.csv", "line 2, column S2_V: must be a finite number or empty; got 'two'"),
        ("--file head.csv", "has a header but no rows: add a row of numbers below it"),
    ],
)
def test_bad_input_is_a_sentence(refusal, tmp_path, options, sentence):
    heads = {
        "r": "S2_V,S1_V,S3_V\n1,2,3\n",
        "text": "S1_V,S2_V,S3_V\n1,two,3\n",
        "empty": "",
        "head": "S1_V,S2_V,S3_V\n",
    }
    for name, text in (heads | {"tesla": "S1_T,S2_T,S3_T\n0.01,0.01,0.01\n"}).items():
        (tmp_path / f"{name}.csv").write_text(text)
    (tmp_path / "nan.jsonl").write_text('{"status": "failed"}\n{"status": "ok", "tilt_rad": NaN}\n')
    (tmp_path / "other.jsonl").write_text('{"depth_mm": 1}\n')
    assert sentence in refusal("decode", "paper", *options.split())


# The force of a level beside that of level finite, and poses without contact


PRESSED = "2.973987,2.903726,2.853713"
"""Readings of finite elements at a press force of 8.8 N."""
AT_REST = "2.87,2.79,2.79"
"""Readings at rest, rounded to 0.01 V: the magnet seems to stand above its rest."""


def decoded(run, strict, readings, *options):
    status, out, err = run("decode", "paper", "--readings", readings, "--json", *options)
    (record,) = strict(out)
    return status, record, err


def test_the_force_of_level_paper_is_said_to_be_far_from_that_of_level_finite(run, strict):
    status, record, err = decoded(run, strict, PRESSED, *UPRIGHT)
    assert (status, record["status"], record["level"]) == (0, "ok", "paper")
    assert record["force_N"][2] == pytest.approx(2.98, abs=0.01)
    assert record["finite_force_N"][2] == pytest.approx(9.2, abs=0.3)
    assert err.count("\n") == len(record["warnings"]) == 1
    assert "level paper gives a force of 3.04 N at this pose, level finite 9.29 N (they differ by 67.9 %)" in err
    assert "leave --level out for the best source" in err
    assert "--responses" in err


def test_levels_that_nearly_agree_say_nothing_of_each_other(run, strict):
    """At a small press of 0.3 mm level magnet is within a few percent of finite."""
    (load,) = strict(run("analytic", "paper", "--depth", 0.3, "--level", "magnet", "--json")[1])
    _, record, err = decoded(run, strict, ",".join(map(repr, load["readings_V"])), "--level", "magnet")
    assert_allclose(record["force_N"], record["finite_force_N"], rtol=0.1, atol=0.08)
    sigma = ", ".join(f"{value:.2g}" for value in record["tolerance_N"])
    rest = (
        "these readings may be those of a sensor at rest whose parts lie within tolerances, which change the force "
        f"of 0.601 N by {sigma} N along x, y and z (standard deviations; 124 of 400 such sensors have no force there)"
    )
    assert (record["level"], err) == ("magnet", f"magtip: warning: {rest}: calibrate the sensor\n")


def test_a_pose_beyond_level_finite_is_said_to_be_unchecked(run, strict):
    (seen,) = strict(run("readings", "paper", "--shift", "0,0,-2", "--json")[1])
    _, record, err = decoded(run, strict, ",".join(map(repr, seen["readings_V"])), *UPRIGHT)
    assert record["finite_force_N"] == [None] * 3
    assert "outside the range of level finite, so the error of the force of level paper is unknown" in err


def test_the_force_beside_is_that_of_the_formulas_where_these_hold():
    """Up to the polynomials' misfit; beyond a depth of D/4 there is none."""
    design = paper()
    law = decode_readings.of_level(design, "finite")
    loads = [Load(depth=d, shear_x=s, friction="stick") for d, s in ((1.0, 0.0), (1.0, 1.0), (1.9, 0.5), (2.4, 0.0))]
    found = [beam.solve(design, load, "finite") for load in loads]
    beside = decode_readings.finite_force(design, law, np.array([one.shift for one in found]))
    assert_allclose(beside[:3], [one.force for one in found[:3]], atol=2 * max(law.errors[1:3]))
    assert np.isnan(beside[3]).all()


@pytest.mark.parametrize("level", ["paper", "finite"])
def test_a_plate_that_does_not_touch_carries_nothing(run, strict, level):
    status, record, _ = decoded(run, strict, AT_REST, "--level", level)
    assert (status, record["status"], record["contact"]) == (0, "ok", False)
    assert record["force_N"] == [0.0] * 3
    assert (record["depth_mm"], record["shear_mm"], record["shear_y_mm"]) == (0.0, 0.0, 0.0)
    assert record["message"].startswith("the plate does not touch the tip at this pose (depth 0), so the load is 0")


@pytest.mark.parametrize("level", ["paper", "finite"])
def test_a_stream_carries_what_the_decoder_does(level):
    coder = decoder(paper(), decode_readings.of_level(paper(), level))
    readings = decode_readings.in_tesla(coder.forward.elements, [[float(v) for v in AT_REST.split(",")]], "V")
    assert Stream(coder).step(tuple(readings[0])).force == tuple(decode(coder, readings).force[0]) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("rails", [["hall_gain=1e6"], ["hall_low=2.8", "hall_null=2.85", "hall_high=2.9"]])
def test_a_sensor_that_reads_its_rails_at_rest_is_refused(run, rails):
    sets = [token for each in rails for token in ("--set", each)]
    status, out, err = run("decode", "paper", "--readings", "2.86,2.82,2.84", *sets)
    assert (status, out) == (2, "")
    assert "S1 reads the same in all made sensors at rest, as it does at a rail" in err


# The best source of the mechanics, by default


@pytest.mark.parametrize("load", [Load(1.2), Load(1.0, 0.8, friction="stick")], ids=["press", "shear"])
def test_readings_of_a_solved_state_decode_to_its_force_within_the_interval_of_the_surrogate(run, strict, load):
    solved = solve(paper(), load, QUICK)
    text = ",".join(map(repr, hall.readings(paper(), solved.response).V))
    status, record, _ = decoded(run, strict, text)
    assert (status, record["level"], record["level_reason"]) == (0, "surrogate", "the design lies within its range")
    off = np.linalg.norm(np.subtract(record["force_N"], solved.response.force))
    room = record["level_half_width_N"] + 2 * record["fit_error_N"]
    assert off < room + solved.estimates.force * np.linalg.norm(solved.response.force) < 0.12 * record["force_N"][2]
    assert record["depth_mm"] == pytest.approx(load.depth, rel=0.02)
    assert record["finite_force_N"] is None


def test_a_pose_beyond_the_surrogate_is_said_to_be_out_of_its_range(run, strict):
    (deep,) = trace(paper(), [Load(2.9)], QUICK, estimate=False)
    text = ",".join(map(repr, hall.readings(paper(), deep.response).V))
    status, record, err = decoded(run, strict, text)
    assert (status, record["status"], record["beyond"]) == (3, "out_of_workspace", "depth")
    assert record["force_N"] == [None] * 3
    assert "the limit of the surrogate: give states by --responses that go deeper" in err


def test_the_best_source_is_the_first_that_covers_a_design(monkeypatch):
    """A stiffening silicone is none of the surrogate's; without solved states formulas would take it for another."""
    stiffening, asked = replace(paper(), law="yeoh", yeoh_2=0.02), []

    def solved(design):
        asked.append(design)
        raise SolveFailed("no state was found")

    monkeypatch.setattr(mechanics_sources, "of_finite_elements", solved)
    assert mechanics_sources.best(paper()).name == "surrogate"
    assert not asked
    rounded = replace(paper(), magnet_edge_radius=0.4)
    for design, name, said in (
        (rounded, "finite", "within its range"),
        (stiffening, "paper", "not the law yeoh"),
    ):
        source = mechanics_sources.best(design)
        assert (source.name, asked.pop()) == (name, design)
        assert "fem: no state was found" in source.reason
        assert said in source.reason
        assert bool(source.warning) == (name == "paper")
