"""The verbs readings, field and table: values of the field's functions, files, interruptions and bad input."""

import csv
import json
import os
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import hall, lookup
from geometry import design_digest
from geometry.design import BadInput, Design, paper
from geometry.loads import Load, Response
from studies.inputs import table_input
from studies.output import atomic_files, own_files
from studies.sensing import field_readings, lookup_table
from studies.simulation import state_rows


def test_readings_as_json(run, strict):
    status, out, err = run("readings", "paper", "--shift", "0.5,0,-1", "--tilt", "0,0.05", "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    expected = hall.readings(paper(), shift=(0.5, 0, -1), tilt=(0, 0.05))
    assert record["readings_T"] == list(expected.B_T)
    assert record["readings_V"] == list(expected.V)
    assert record["elements"] == ["S1", "S2", "S3"]
    assert record["saturated"] == [False] * 3


def test_readings_of_a_chip_and_of_noise(run, strict):
    layout = ("readings", "paper", "--set", "hall_layout=tle493d-p2b6", "--json")
    (chip,) = strict(run(*layout)[1])
    assert chip["readings_V"] is None
    assert len(chip["output_T"]) == 3
    assert_allclose(chip["noise_of_readings_T"], (1e-4**2 + 1.3e-4**2 / 12) ** 0.5)
    (mean,) = strict(run(*layout, "--set", "hall_average=100")[1])
    # the chip's noise of 0.1 mT dithers its steps of 0.13 mT
    assert_allclose(mean["noise_of_readings_T"], chip["noise_of_readings_T"][0] / 10, rtol=1e-6)
    one, same, other = (
        run("readings", "paper", "--set", "hall_noise=0.01", "--seed", seed, "--json")[1] for seed in (1, 1, 2)
    )
    assert one == same != other


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


LABEL = design_digest.label(design_digest.of_mechanics(paper()))
POSE = {"shift_mm": [0.4, -0.2, -0.8], "tilt_rad": 0.12, "tilt_y_rad": -0.07}
STATE = {"status": "ok", "depth_mm": 1.0, "shear_mm": 0.5, "shear_y_mm": -0.3, "force_N": [0.4, -0.2, 3.0], **POSE}
BROKEN = {"status": "not_converged", "message": "stopped", "depth_mm": 2.0, "shear_mm": 0.0, "shift_mm": None}


READ = ("readings", "paper", "--responses", "states.jsonl")


def write(folder, *states, name="states"):
    (folder / f"{name}.jsonl").write_text("".join(json.dumps(state | LABEL) + "\n" for state in states))


def test_each_state_is_read_at_its_own_pose(run, strict, tmp_path):
    write(tmp_path, STATE, STATE | {"shift_mm": [0.1, 0.0, -0.5]})
    status, out, err = run(*READ, "--json")
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
        (row,) = strict(run(*READ, "--json")[1])
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
    write(tmp_path, STATE, BROKEN)
    status, out, err = run(*READ, "--json")
    rows = strict(out)
    assert (status, [row["status"] for row in rows]) == (0, ["ok", "not_converged"])
    assert (rows[1]["readings_T"], rows[1]["message"]) == (None, "stopped")
    assert err == "magtip: 1 of 2 states failed; the last status is not_converged\n"
    assert "not_converged" in run(*READ)[1]
    write(tmp_path, BROKEN)
    assert run(*READ, "--json")[0] == 3


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
    row = state_rows.state_row(paper(), "rigid", load, Response((0.0,) * 3, (0.0,) * 3, 0.0, 0.0, 0.0), "paper")
    file = tmp_path / "states.jsonl"
    file.write_text(json.dumps(row | LABEL))
    (state,) = table_input.read_states(file, paper())
    assert state.load == load


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


# The verb field


POINTS = "x_mm,y_mm,z_mm\n0,0,-2.2\n5, 0,-0.2\n\n0.1,0.2,5\n"


def table(text):
    return list(csv.DictReader(text.splitlines()))


def test_field_is_added_at_full_precision(run, tmp_path):
    (tmp_path / "p.csv").write_text(POINTS)
    status, out, err = run("field", "paper", "--points", "p.csv", "--shift", "0.5,0,-1", "--tilt", "0,0.1")
    assert (status, err) == (0, "")
    found = [[float(row[k]) for k in ("Bx_T", "By_T", "Bz_T")] for row in table(out)]
    expected = hall.field_at([[0, 0, -2.2], [5, 0, -0.2], [0.1, 0.2, 5]], paper(), (0.5, 0, -1), (0, 0.1))
    assert found == (expected + 0.0).tolist()
    written = run("field", "paper", "--points", "p.csv", "--shift=.5,0,-1", "--tilt=0,.1", "--out", "b.csv")
    assert written[:2] == (0, "")
    assert (tmp_path / "b.csv").read_text() == out


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x_mm,z_mm\n1,2\n", "column y_mm is missing"),
        ("x_mm,z_mm,y_mm\n1,2,3\n", "in the order"),
        ("x_mm,y_mm,z_mm,Bx_T\n1,2,3,4\n", "Bx_T exists already"),
        ("x_mm,y_mm,z_mm\n1,2,3\n1,two,3\n", "line 3, column y_mm: must be a finite number"),
        ("x_mm,y_mm,z_mm\n1,2\n", "line 2: 2 values for 3 columns"),
        ("x_mm,y_mm,z_mm\n2,0,6\n", "infinite on the magnet's rim"),
        ('x_mm,y_mm,z_mm\n"1,2,3\n', "line 2 is not CSV"),
        ("x_mm;y_mm;z_mm\n1,5;2;3\n", "line 1: semicolons separate its columns: save it with commas"),
        ('x_mm,y_mm,z_mm\n"1,5",2,3\n', "got '1,5': write a point, no comma"),
        ("x_mm,y_mm,z_mm\n1,5,2,0,3,0\n", "6 values for 3 columns: write a point"),
    ],
)
def test_bad_tables_are_a_sentence(refusal, tmp_path, text, words):
    (tmp_path / "p.csv").write_text(text)
    assert words in refusal("field", "paper", "--points", "p.csv")


def test_the_field_needs_no_place_of_the_elements(run, tmp_path):
    (tmp_path / "p.csv").write_text("x_mm,y_mm,z_mm\n0,0,-5\n")
    expected = run("field", "paper", "--points", "p.csv")[1]
    assert run("field", "paper", "--points", "p.csv", "--set", "l0=0.1") == (0, expected, "")


# The verb table


def test_entries_are_the_readings(run, strict, tmp_path):
    status, out, _ = run("table", "paper", "--step", 0.5, "--out", "t.npy", "--json")
    assert status == 0
    assert strict(out)[0]["poses"] == 13 * 13 * 7
    table, about = np.load(tmp_path / "t.npy", mmap_mode="r"), json.loads((tmp_path / "t.json").read_text())
    assert list(table.shape) == about["shape"] == [13, 13, 7, 3]
    axes = [[axis["first"] + k * axis["step"] for k in range(axis["count"])] for axis in about["axes"][:3]]
    for i, j, k in ((0, 0, 0), (6, 6, 0), (2, 11, 5), (12, 12, 6)):
        shift = (axes[0][i], axes[1][j], axes[2][k])
        assert_allclose(table[i, j, k], hall.readings(paper(), shift=shift).B_T, rtol=1e-12)
    assert [file.name for file in tmp_path.glob(".*")] == [own_files.LIST]


def test_the_plane_holds_every_reading(run, tmp_path):
    assert run("table", "paper", "--step", 0.1, "--plane", "--out", "p.npy")[0] == 0
    table, about = np.load(tmp_path / "p.npy"), json.loads((tmp_path / "p.json").read_text())
    rho, height = about["axes"][:2]
    # the magnet at (-1, 0, -2): S2, at (5, 0) and 5.2 mm below its rest, is 6 mm aside and 3.2 mm below it
    i, j = round(6 / rho["step"]), round((-3.2 - height["first"]) / height["step"])
    expected = hall.field_at([[5, 0, -0.2]], paper(), (-1, 0, -2))[0]
    assert_allclose(table[i, j], expected[[0, 2]], rtol=1e-10)
    corner = np.hypot(8, 3)
    assert rho["step"] * (rho["count"] - 1) >= corner


def test_an_interrupted_table_goes_on(run, strict, tmp_path, monkeypatch):
    command = ("table", "paper", "--step", 0.25, "--json", "--out")
    assert run(*command, "whole.npy")[0] == 0
    slab = lookup.slab

    def stop(model, grid, i):
        if i == 19:
            raise KeyboardInterrupt
        return slab(model, grid, i)

    monkeypatch.setattr(lookup, "slab", stop)
    status, out, err = run(*command, "t.npy")
    assert (status, out) == (130, "")
    assert "interrupted; 16 of 25 slabs are kept in '.t.npy.part' (" in err
    assert not (tmp_path / "t.npy").exists()
    monkeypatch.setattr(lookup, "slab", slab)
    status, out, _ = run(*command, "t.npy")
    assert (status, strict(out)[0]["resumed"]) == (0, 16)
    assert (tmp_path / "t.npy").read_bytes() == (tmp_path / "whole.npy").read_bytes()
    assert [file.name for file in tmp_path.glob(".*")] == [own_files.LIST]
    # a part that lacks a byte of what its note counts is written anew
    monkeypatch.setattr(lookup, "slab", stop)
    run(*command, "t.npy")
    part, note = (tmp_path / f".t.npy.part{end}" for end in ("", ".json"))
    counted = json.loads(note.read_text())
    os.truncate(part, counted["offset"] + counted["done"] * 8 * 25 * 13 * 3 - 1)
    monkeypatch.setattr(lookup, "slab", slab)
    assert strict(run(*command, "t.npy")[1])[0]["resumed"] == 0
    assert (tmp_path / "t.npy").read_bytes() == (tmp_path / "whole.npy").read_bytes()


@pytest.mark.parametrize("plane", [(), ("--plane",)])
def test_a_table_that_is_replaced_never_has_the_description_of_another(run, tmp_path, monkeypatch, plane):
    command = ("table", "paper", "--step", 1, "--out", "t.npy", *plane)
    assert run(*command)[0] == 0
    old = (tmp_path / "t.npy").read_bytes()
    # another sensor, whose table has the same shape; the process ends before and after the table gets its name
    for name in ("note", "write_json"):
        with monkeypatch.context() as patch:
            patch.setattr(own_files if name == "note" else atomic_files, name, killed)
            with pytest.raises(SystemExit):
                run(*command, "--set", "remanence=1.1")
        assert ((tmp_path / "t.npy").read_bytes() == old) == (name == "note")
        with pytest.raises(BadInput, match="is not a table of magtip"):
            lookup_table.read(tmp_path / "t.npy", replace(paper(), remanence=1.1))
    assert run(*command, "--set", "remanence=1.1")[0] == 0
    lookup_table.read(tmp_path / "t.npy", replace(paper(), remanence=1.1))


def killed(*_given, **_named):
    raise SystemExit


def test_a_table_is_read_back_for_its_own_sensor_only(run, tmp_path, capsys):
    assert run("table", "paper", "--step", 1, "--out", "t.npy")[0] == 0
    table, about = lookup_table.read(tmp_path / "t.npy", replace(paper(), E=2.0, hall_noise=0.1))
    assert table.shape == tuple(about["shape"])
    assert capsys.readouterr().err == ""
    # tables of versions without this field are those of a magnet whose north pole points down
    assert "magnet_north" not in about["made_for"]
    with pytest.raises(BadInput, match="with magnet_north down where this design has magnet_north up"):
        lookup_table.read(tmp_path / "t.npy", replace(paper(), magnet_north="up"))
    with pytest.raises(
        BadInput, match=r"with remanence 1\.2 T, f 5 mm where this design has remanence 1\.1 T, f 6 mm"
    ):
        lookup_table.read(tmp_path / "t.npy", replace(paper(), remanence=1.1, f=6.0))
    kept = {key: value for key, value in about.items() if key not in ("digest", "made_for")}
    (tmp_path / "t.json").write_text(json.dumps(kept))
    lookup_table.read(tmp_path / "t.npy", paper())
    assert "does not say for which sensor" in capsys.readouterr().err
    (tmp_path / "t.json").write_text("{}")
    with pytest.raises(BadInput, match="is not a table"):
        lookup_table.read(tmp_path / "t.npy", paper())


# Bad input


RIM = STATE | {"shift_mm": [2.0, 0.0, -6.2], "tilt_rad": 0.0, "tilt_y_rad": 0.0}
"""A pose with the magnet's rim at S1, where the field is infinite."""


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("readings paper --shift 1,2,x", "each value of --shift must be a finite number; got 'x'"),
        ("readings paper --ambient 1,2", "--ambient takes 3 numbers"),
        ("readings paper --seed -1", "--seed must be"),
        ("readings paper --set hall_layout=four", "there is no hall_layout 'four'"),
        ("readings paper --responses states.jsonl --tilt 0,0.1", "leave --shift and --tilt out"),
        ("readings paper --responses states.jsonl --set E=2", "with E 1 MPa where this design has E 2 MPa"),
        ("readings paper --responses none.jsonl", "contains no states"),
        ("readings paper --responses rim.jsonl", "rim.jsonl, line 1: "),
        ("field paper --points p.csv --out b.txt", "must end in .csv"),
        ("field paper --points p.csv --shift 1,2", "--shift takes 3 numbers"),
        ("field paper --points p.csv --tilt 1,nan", "each value of --tilt must be a finite number; got 'nan'"),
        ("field paper --points p.csv --set magnet_diameter=0 --set magnet_height=0", "no magnet"),
        ("table paper --out t.csv", "must end in .npy"),
        ("table paper --out t.npy --step 0", "more than 0"),
        ("table paper --out t.npy --step 4", "at most"),
        ("table paper --out t.npy --step 1e-4", "disk"),
        ("table paper --out t.npy --set l0=3", "S1 lies inside the beam"),
        ("table paper --out mine.npy --step 1", "'mine.npy' was not written by magtip and would be overwritten"),
        ("table paper --out states.npy --step 1 --plane", "'states.json' was not written by magtip"),
    ],
)
def test_bad_input_is_a_sentence(refusal, tmp_path, line, sentence):
    (tmp_path / "p.csv").write_text(POINTS)
    for name, states in {"states": [STATE], "rim": [RIM], "none": []}.items():
        write(tmp_path, *states, name=name)
    np.save(tmp_path / "mine.npy", np.arange(3.0))
    (tmp_path / "states.json").write_text("{}")
    assert sentence in refusal(*line.split())
