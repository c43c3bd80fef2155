"""Stored states as tables: all columns, in units of D and E, whole or not at all."""

import contextlib
import csv
import json
import math
import sqlite3

import pytest

from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_export
from studies.mechanics.store import State
from studies.mechanics.store_fields import FIELDS
from studies.output import atomic_files

CONTENT = {
    "shape": {"D": 1.0, "L": 1.125},
    "nu": 0.4998,
    "law": ["yeoh", 0.1, 0.0],
    "model": "harmonic",
    "physics": 1,
}
RESPONSE = {"force": [8.0, 0.0, 64.0], "shift": [0.4, 0.0, -2.0], "tilt": 0.1, "contact_radius": 1.0, "tilt_y": 0.0}
ANSWER = {"D_mm": 8.0, "E_MPa": 2.0, "response": RESPONSE, "error_estimate": 0.01, "message": ""}
PRESSED = State(0.125, 1 / 3, "ok", "ok", ANSWER, 0.5, "on Python 3")
FAILED = State(0.25, 0.0, "failed", "not_converged", ANSWER | {"response": None, "message": "stops, early"}, 0.1, "")


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "solved.sqlite"
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED, FAILED])
        kept.add(CONTENT | {"nu": 0.45, "load": {"friction": 0.3}}, [PRESSED])
    return file


def exported(file, out, *where):
    count = store_export.export(Selection(store=file, where=list(where)), out, lambda fraction, text: None)
    if out.suffix == ".jsonl":
        rows = [json.loads(line) for line in out.read_text("utf-8").splitlines()]
    elif out.suffix == ".csv":
        with out.open(newline="", encoding="utf-8") as stream:
            rows = [{name: value or None for name, value in row.items()} for row in csv.DictReader(stream)]
    else:
        from pyarrow import parquet

        rows = parquet.read_table(out).to_pylist()
    assert count == len(rows)
    return rows


def test_states_that_were_changed_in_the_file_are_not_exported(file, tmp_path, refused):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET answer = replace(answer, '64.0', '99.0') WHERE path = 2")
    with refused("1 of 3 states", "are not as they were written"):
        exported(file, tmp_path / "states.csv")
    assert not (tmp_path / "states.csv").exists()
    assert len(exported(file, tmp_path / "states.csv", "nu=0.4998")) == 2


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
def test_an_export_has_all_columns_over_D_and_E(file, tmp_path, suffix):
    rows = exported(file, tmp_path / "out" / f"states.{suffix}")
    assert [list(row) for row in rows] == [list(FIELDS)] * 3
    pressed, failed, rubbed = rows
    values = {name: float(pressed[name]) for name in ("force_x_over_E_D2", "force_z_over_E_D2", "shift_z_over_D")}
    assert values == pytest.approx({"force_x_over_E_D2": 1 / 16, "force_z_over_E_D2": 0.5, "shift_z_over_D": -0.25})
    assert float(pressed["shear_over_D"]) == pytest.approx(1 / 3, rel=1e-11)
    assert (pressed["law"], float(pressed["law_number_1"]), pressed["friction"]) == ("yeoh", 0.1, None)
    assert (failed["force_z_over_E_D2"], failed["message"], failed["outcome"]) == (None, "stops, early", "failed")
    assert (str(rubbed["friction"]), float(rubbed["nu"])) == ("0.3", 0.45)


def test_a_filter_limits_an_export(file, tmp_path):
    assert [row["nu"] for row in exported(file, tmp_path / "states.csv", "nu=0.45")] == ["0.45"]


def test_batches_are_put_together(file, tmp_path, monkeypatch):
    monkeypatch.setattr(store_export, "BATCH", 2)
    assert len(exported(file, tmp_path / "states.parquet")) == 3


def test_missing_numbers_of_a_parquet_file_are_null(file, tmp_path):
    values = [row["grip_over_D"] for row in exported(file, tmp_path / "states.parquet")]
    assert values == [None, None, None]
    assert not any(isinstance(value, float) and math.isnan(value) for value in values)


def test_an_export_without_states_writes_nothing(file, tmp_path, refused):
    out = tmp_path / "states.csv"
    atomic_files.write_text(out, "old")
    with refused("no state of the store", "meets the filters, so states.csv is not written"):
        exported(file, out, "nu=0.1")
    assert out.read_text() == "old"


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
def test_an_export_replaces_its_own_file_and_none_of_the_user(file, tmp_path, suffix, refused):
    out = tmp_path / f"states.{suffix}"
    for _ in range(2):
        exported(file, out)
    out.write_text("mine")
    with refused("was changed after magtip had written it and would be overwritten: choose another name"):
        exported(file, out)
    assert out.read_text() == "mine"


def test_an_export_has_a_suffix(file, tmp_path, refused):
    with refused("must end in .csv or .parquet or .jsonl"):
        exported(file, tmp_path / "states.xlsx")


def test_an_export_that_breaks_off_leaves_the_old_file(file, tmp_path):
    out = tmp_path / "states.csv"
    atomic_files.write_text(out, "old")

    def stop(fraction, text):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store_export.export(Selection(store=file), out, stop)
    assert out.read_text() == "old"
    assert sorted(path.name for path in tmp_path.iterdir() if "writing" in path.name) == []
