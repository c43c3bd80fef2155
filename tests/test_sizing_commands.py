"""Verb size: a small sizing with finite elements, its files, its continuation after a kill, and refusals."""

import csv
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from studies.cli import commands
from studies.inputs.user_input import read_design

NEEDED = """
force_z = "5 N"
force_x = "1 N"
resolution_z = "100 mN"
resolution_x = "100 mN"
bandwidth = "100 Hz"
samples = 16
largest_strain = "100 %"
outer_size = "30 mm"
magnets = ["5x3 N45", "4x3 N45"]
silicones = ["Smooth-Sil 940"]
hall_parts = ["DRV5055A2"]
D = ["9 mm", "11 mm"]
"""
SMALL = ["--population", "12", "--generations", "2", "--points", "1", "--sensors", "20", "--accuracy", "quick"]


def size(folder, needed, store, *options):
    (folder / "needed.toml").write_text(needed, encoding="utf-8")
    words = ["size", str(folder / "needed.toml"), "--out", str(folder / "out"), "--store", str(store)]
    return [*words, *SMALL, "--workers", "0", *options]


@pytest.fixture(scope="module")
def sizing(tmp_path_factory):
    """The folder of a small sizing, and the store of its solves."""
    folder = tmp_path_factory.mktemp("size")
    assert commands.run(size(folder, NEEDED, folder / "store.db")) == 0
    return folder / "out", folder / "store.db"


def rows_of(file):
    with file.open(encoding="utf-8", newline="") as text:
        return list(csv.DictReader(text))


def test_files(sizing):
    folder, _ = sizing
    names = {file.name for file in folder.iterdir() if not file.name.startswith(".")}
    written = {"sizing.json", "front.csv", "yield.csv", "SIZING.md", "front.png", "run.json"}
    assert names == written | {"search_1.npz"}
    assert (folder / "SIZING.md").read_text("utf-8").startswith("# Sizing")


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
        # quick finite elements and the surrogate agree within 5 %
        assert float(row[f"surrogate_{name}"]) == pytest.approx(float(row[f"fem_{name}"]), rel=0.05)


def test_yield_has_all_requirements(sizing):
    rows = rows_of(sizing[0] / "yield.csv")
    assert rows[0]["requirement"] == "all"
    assert {"force_z", "largest_strain", "no_saturation", "unique_decoding"} <= {row["requirement"] for row in rows}


def test_killed_command_continues_to_the_same_result(sizing, tmp_path):
    folder, store = sizing
    words = size(tmp_path, NEEDED, store)
    process = subprocess.Popen(
        [sys.executable, "-m", "studies.cli", *words], stderr=subprocess.DEVNULL, env=os.environ | {"COLUMNS": "80"}
    )
    state, end = tmp_path / "out" / "search_1.npz", time.monotonic() + 60
    while not state.exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert state.exists()
    assert not (tmp_path / "out" / "SIZING.md").exists()
    assert commands.run(words) == 0
    assert (tmp_path / "out" / "front.csv").read_bytes() == (folder / "front.csv").read_bytes()
    assert (tmp_path / "out" / "yield.csv").read_bytes() == (folder / "yield.csv").read_bytes()


def test_contradiction_names_a_smallest_set(tmp_path, capsys):
    needed = NEEDED.replace("100 %", "3 %")
    assert commands.run(size(tmp_path, needed, tmp_path / "store.db", "--json")) == 3
    printed = capsys.readouterr()
    assert "no variant meets" in printed.err
    assert "largest_strain" in printed.err
    record = json.loads(printed.out)
    assert record["status"] == "failed"
    assert any(row["requirement"] == "largest_strain" and row["gives"] > 0 for row in record["conflict"])
    assert not (tmp_path / "out" / "front.csv").exists()


def test_design_file_of_the_best_variant_is_a_design(sizing, tmp_path):
    from studies.sizing.candidate_variables import Variant
    from studies.sizing.catalogues import catalogues_of
    from studies.sizing.requirements import Requirements
    from studies.sizing.sizing_export import design_text, parts_text

    record = json.loads((sizing[0] / "sizing.json").read_text("utf-8"))
    parts = catalogues_of(Requirements(force_z=1.0))
    design = record["winner"]["design"]
    from geometry.design import Design

    magnet = next(one for one in parts.magnets if one.name == record["winner"]["magnet"]["name"])
    variant = Variant(Design(**design), magnet, parts.hall_parts[0], parts.silicones[0])
    file = tmp_path / "winner.toml"
    file.write_text(design_text(variant), encoding="utf-8")
    assert read_design(str(file)) == variant.design
    assert magnet.name in parts_text(variant)


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
