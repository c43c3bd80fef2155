"""Verb size: a small sizing with finite elements, its files, what an earlier one leaves, and refusals."""

import contextlib
import csv
import io
import json
import math
import re
from dataclasses import replace

import pytest
from conftest import make_fast, take_surrogate

from fem.accuracy import LEVELS, QUICK
from studies.cli import commands
from studies.output import atomic_files
from studies.sizing import advice, front_yield
from studies.sizing.variant_search import Effort

NEEDED = """
force_z = "5 N"
force_x = "1 N"
resolution_z = "100 mN"
resolution_x = "100 mN"
bandwidth = "100 Hz"
samples = 16
largest_strain = "100 %"
outer_size = "30 mm"
outer_shape = "round"
process = "sla"
magnets = ["5x3 N45", "4x3 N45"]
silicones = ["Smooth-Sil 940"]
hall_parts = ["DRV5055A2"]
D = ["9 mm", "11 mm"]
"""
SMALL = ["--population", "32", "--generations", "4", "--points", "1", "--sensors", "20", "--accuracy", "quick"]


def size(folder, needed, store, *options):
    (folder / "needed.toml").write_text(needed, encoding="utf-8")
    words = ["size", str(folder / "needed.toml"), "--out", str(folder / "out"), "--store", str(store)]
    return [*words, *SMALL, "--workers", "0", *options]


@pytest.fixture(scope="module", autouse=True)
def rough_quick():
    """The meshes of level quick are rough: that its own solves confirm a variant is shown on any mesh."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(LEVELS, "quick", replace(QUICK, section_size=0.3, section_patch=0.06, harmonics=1))
        yield


@pytest.fixture(scope="module")
def contradiction(tmp_path_factory):
    """The folder of a sizing without a variant, which held the parts of an earlier one; its status and its output."""
    folder = tmp_path_factory.mktemp("contradiction")
    parts = folder / "out" / "fabrication"
    parts.mkdir(parents=True)
    for file in (folder / "out" / "winner.toml", parts / "base.stl"):
        atomic_files.write_text(file, "of an earlier sizing")
    (parts / "mine.txt").write_text("mine", encoding="utf-8")
    atomic_files.write_text(parts / "README.md", "Made with `magtip cad`")
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        # one choice, the shape of the base, and the bound that is missed; the resolution is not
        choices = advice.choices
        patch.setattr(advice, "FAR", Effort(32, 4))
        patch.setattr(advice, "NEAR", Effort(32, 4))
        patch.setattr(advice, "choices", lambda needed: choices(needed)[:1])
        patch.setattr(advice, "BOUNDS", 1)
        patch.setattr(advice, "readings", lambda *_: [])
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = commands.run(size(folder, NEEDED.replace("100 %", "3 %"), folder / "store.db", "--json"))
    return folder / "out", status, out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def sizing(contradiction, tmp_path_factory):
    """The folder of a sizing that follows the advice, with the parts of its best variant; its standard error."""
    folder, err = tmp_path_factory.mktemp("size"), io.StringIO()
    (advice,) = [row for row in json.loads(contradiction[2])["conflict"] if row["gives"]]
    loose = NEEDED.replace("100 %", f"{100 * advice['to']:.6g} %")
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stderr(err):
        patch.setattr(front_yield, "CHECKED", 1)
        make_fast(patch)
        take_surrogate(patch)
        assert commands.run(size(folder, loose, contradiction[0].parent / "store.db", "--export")) == 0
    return folder / "out", err.getvalue()


def rows_of(file):
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def test_files(sizing):
    folder, _ = sizing
    names = {file.name for file in folder.iterdir() if not file.name.startswith(".")}
    written = {"sizing.json", "front.csv", "yield.csv", "SIZING.md", "front.png", "run.json"}
    written |= {"winner.toml", "fabrication"}
    assert names == written
    page = (folder / "SIZING.md").read_text("utf-8")
    assert page.startswith("# Sizing")
    # a part of 20 kHz has 40 000 independent values a second, 2500 readings of 16
    assert "a reading is the average of 16 values, and reaches 1250 Hz." in page
    assert re.search(r"\| bandwidth +\| +100 +\| Hz +\| set +\| +100 +\|", page)


def test_best_point_meets_all_requirements_by_finite_elements(sizing):
    record = json.loads((sizing[0] / "sizing.json").read_text("utf-8"))
    assert record["status"] == "ok"
    assert all(value >= 0 for value in record["winner"]["margins"].values())
    (row,) = rows_of(sizing[0] / "front.csv")
    assert (row["rank"], row["status"]) == ("1", "ok")
    assert float(row["outer_size_mm"]) <= 30


def test_surrogate_and_finite_elements_stand_side_by_side(sizing):
    (row,) = rows_of(sizing[0] / "front.csv")
    for name in ("depth_over_D", "resolution_z_mN", "resolution_x_mN", "first_mode_Hz"):
        # within the half widths; a resolution follows from slopes of the readings, to which errors of both add
        assert float(row[f"surrogate_{name}"]) == pytest.approx(float(row[f"fem_{name}"]), rel=0.08)


def test_yield_has_all_requirements(sizing):
    rows = rows_of(sizing[0] / "yield.csv")
    assert rows[0]["requirement"] == "all"
    assert {"force_z", "largest_strain", "no_saturation", "unique_decoding"} <= {row["requirement"] for row in rows}


def test_a_contradiction_shows_the_nearest_candidate_and_an_advice(contradiction):
    """That the advice holds is shown by the sizing that follows it."""
    folder, status, out, err = contradiction
    assert status == 3
    record = json.loads(out)
    assert record["status"] == "failed"
    assert f"none of {record['search']['candidates']} candidates meets all requirements" in err
    reason = record["nearest"]["reason"]
    assert "largest_strain is missed by" in reason
    assert "the range is 0 N, because largest_strain is missed under the required loads" in reason
    assert reason in (folder / "SIZING.md").read_text("utf-8")
    (row,) = [row for row in record["conflict"] if row["gives"]]
    assert (row["requirement"], row["unit"]) == ("largest_strain", "1")
    assert f"largest_strain rises to {100 * row['to']:.4g} %" in err
    assert not (folder / "front.csv").exists()
    # parts of earlier requirements are removed
    assert not (folder / "winner.toml").exists()
    assert [file.name for file in (folder / "fabrication").glob("[!.]*")] == ["mine.txt"]


def test_what_is_impossible_is_said_before_the_search(tmp_path, capsys, monkeypatch):
    from studies.sizing import sizing_study

    # nor is there another choice to be tried
    monkeypatch.setattr(advice, "choices", lambda _: [])
    monkeypatch.setattr(sizing_study, "searched", lambda *_, **__: pytest.fail("searched"))
    assert commands.run(size(tmp_path, NEEDED.replace("30 mm", "12 mm"), tmp_path / "store.db", "--json")) == 3
    said = capsys.readouterr()
    assert "outer_size of 12 mm is impossible: the least is" in said.err
    assert json.loads(said.out)["status"] == "failed"


def test_an_example_has_all_keys_and_is_a_file_of_requirements(tmp_path, capsys):
    from studies.parts.requirements import KINDS, read_requirements

    assert commands.run(["size", "--example"]) == 0
    text = capsys.readouterr().out
    file = tmp_path / "example.toml"
    file.write_text(text, encoding="utf-8")
    assert read_requirements(str(file)).force_x == 2.0
    assert all(f"{key} = " in text or f"[{key}]" in text for key in KINDS)
    assert commands.run(["size"]) == 2
    assert "size --example" in capsys.readouterr().err


def test_a_worst_load_is_what_solve_prints(sizing, capsys, monkeypatch):
    """The line beside the strain of the best variant prints this strain, and the forces of the load; so does that of
    the whole required load."""
    folder, _ = sizing
    rows = json.loads((folder / "sizing.json").read_text("utf-8"))["winner"]["worst_loads"]
    (worst,) = [row for row in rows if row["figure"] == "strain"]
    page = (folder / "SIZING.md").read_text("utf-8")
    assert f"largest strain {worst['value']:.3g} % at E = {worst['E_MPa']:.4g} MPa" in page
    lines = [text.strip() for text in page.splitlines() if "magtip solve winner.toml" in text]
    *worst_lines, required = dict.fromkeys(lines)
    assert worst_lines
    monkeypatch.chdir(folder)
    assert commands.run([*required.split()[1:], "--json"]) == 0
    state = json.loads(capsys.readouterr().out)
    assert state["force_N"] == pytest.approx([1.0, 0.0, 5.0], rel=1e-3)
    # along one axis, and along both
    for line in worst_lines[:2]:
        assert commands.run([*line.split()[1:], "--json"]) == 0
        state = json.loads(capsys.readouterr().out.splitlines()[-1])
        one = next(
            row
            for row in rows
            if f"--set E={row['E_MPa']:.6g} " in line and f"--depth {row['depth_mm']:.6g} " in line
        )
        assert state["largest_strain_percent"] == pytest.approx(one["strain_percent"], rel=2e-4)
        assert state["force_N"][2] == pytest.approx(one["force_z_N"], rel=5e-3)
        assert math.hypot(*state["force_N"][:2]) == pytest.approx(one["force_x_N"], rel=5e-3)


@pytest.mark.usefixtures("fast_cad")
def test_the_design_file_of_the_best_variant_has_the_same_recipe(sizing, tmp_path, run, strict):
    """`cad winner.toml` alone names the silicone, its mix and its mass; one that no catalogue ships has no mix."""
    folder, _ = sizing
    winner = folder / "winner.toml"
    status, out, _ = run("cad", winner, "--out", tmp_path / "cad", "--json")
    assert status == 0
    # base and process are those of the requirements: the sizes are those of the sizing
    (made,), (shown,) = strict(out), strict(run("design", winner, "--json")[1])
    (first, *_) = json.loads((folder / "sizing.json").read_text("utf-8"))["front"]
    for size in (made["assembled_size_mm"], shown["derived"]["assembled_size_mm"]):
        assert size[0] == pytest.approx(first["outer_size_mm"])
    recipe = (tmp_path / "cad" / "README.md").read_text("utf-8")
    assert "Mix Smooth-Sil 940 100A:10B by weight" in recipe
    assert "masses those of Smooth-Sil 940 with 1180 kg/m³" in recipe
    mine = ("--base", "square", "--set", "silicone=Mine", "--out", tmp_path / "mine")
    (square,) = strict(run("cad", winner, *mine, "--json")[1])
    assert square["assembled_size_mm"][0] > made["assembled_size_mm"][0] + 0.1
    assert "Mix the parts of Mine as its data sheet says" in (tmp_path / "mine" / "README.md").read_text("utf-8")


def test_a_users_parts_are_refused_before_the_search(tmp_path, capsys):
    parts = tmp_path / "out" / "fabrication"
    parts.mkdir(parents=True)
    (parts / "base.stl").write_text("mine", encoding="utf-8")
    assert commands.run(size(tmp_path, NEEDED, tmp_path / "store.db")) == 2
    assert "was not written by magtip" in capsys.readouterr().err
    assert (parts / "base.stl").read_text("utf-8") == "mine"


def test_a_store_that_cannot_be_used_is_refused_before_the_search(tmp_path, capsys, monkeypatch):
    from studies.sizing import variant_search

    monkeypatch.setattr(variant_search, "search", lambda *_, **__: pytest.fail("searched first"))
    (tmp_path / "store.db").write_text("no store", encoding="utf-8")
    assert commands.run(size(tmp_path, NEEDED, tmp_path / "store.db")) == 2
    assert "store.db" in capsys.readouterr().err


def test_a_limit_that_rejects_every_candidate_is_named(tmp_path, capsys):
    soft = '[[silicone]]\nname = "soft"\nE = ["0.5 MPa", "0.6 MPa", "0.7 MPa"]\nnu = [0.3, 0.3, 0.3]\n'
    (tmp_path / "mine.toml").write_text(soft, encoding="utf-8")
    needed = NEEDED.replace("Smooth-Sil 940", "soft") + 'catalogues = ["mine.toml"]\n'
    assert commands.run(size(tmp_path, needed, tmp_path / "store.db")) == 2
    assert "nu within 0.45 and 0.5; got 0.3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "text"),
    [("--population", "4", "--population must lie between 8"), ("--points", "0", "--points must lie between 1")],
)
def test_refusals(option, value, text, tmp_path, capsys):
    words = size(tmp_path, NEEDED, tmp_path / "store.db")
    words[words.index(option) + 1] = value
    assert commands.run(words) == 2
    assert text in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
