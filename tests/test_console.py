"""Tables on standard output: nothing is cut, nothing is longer than a line, and what is left out is named."""

import csv
import io
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from studies.output import console, text_tables
from studies.simulation import load_cases

RESULTS = Path(__file__).parents[1] / "results"
TABLES = sorted(str(path.relative_to(RESULTS)) for path in RESULTS.rglob("*.csv"))
"""Rows that verbs have printed, of all kinds."""


@cache
def rows_of(name, most=12):
    def value(text):
        try:
            return float(text)
        except ValueError:
            return text

    with Path(RESULTS, name).open(encoding="utf-8", newline="") as file:
        return [{key: value(text) for key, text in row.items()} for row in csv.DictReader(file)][:most]


@pytest.mark.parametrize("columns", [20, 40, 80, 160])
def test_no_line_is_longer_than_the_terminal(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    for name in TABLES:
        console.report(rows_of(name), as_json=False, title="A title of some words")
        assert max(map(len, capsys.readouterr().out.splitlines())) <= columns, name


@pytest.mark.parametrize("columns", ["40", "80", ""])
def test_no_value_is_cut(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    for name in TABLES:
        nothing_is_cut(rows_of(name), capsys)


def words_of(key, value, digits=4):
    return text_tables.in_unit(key, value, digits).split()


def nothing_is_cut(rows, capsys):
    table = console._Table("", rows[0], (), console.room())
    table.add(rows)
    whole, rest = capsys.readouterr().out.splitlines(), rows
    if table.widths is not None:
        starts = np.cumsum([0, *(width + console.GAP for width in table.widths.values())])
        assert starts[-1] - console.GAP <= console.room()
        head = next(k for k, line in enumerate(whole) if line.startswith("─"))
        columns = [" ".join(line[a:b] for line in whole[head + 1 :]).split() for a, b in pairwise(starts)]
        for key, words in zip(table.widths, columns, strict=True):
            assert words == [word for row in rows for word in words_of(key, row[key])], key
        rest = rows[:1]
        console.report(rest, as_json=False)
        whole = capsys.readouterr().out.splitlines()
    digits = 5 if rest is not rows else 4
    upright = [(text_tables.heading(key)[0], key, row[key]) for row in rest for key in row]
    said = "".join(f"{name}{text_tables.with_its_unit(key, value, digits)}" for name, key, value in upright)
    assert "".join("".join(whole).split()) == "".join(said.split())


def test_wide_has_all_columns(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for name in TABLES:
        rows = rows_of(name)
        console.report(rows, as_json=False, brief=list(rows[0])[3:], wide=True)
        out = capsys.readouterr().out
        assert "Left out" not in out, name
        head = out.split("─")[0].split()
        filled = [key for key in rows[0] if any(row[key] != "" for row in rows)]
        assert sorted(head) == sorted(word for key in filled for word in text_tables.titled(key).split()), name


def test_what_is_left_out_is_named(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    rows = [{"depth_mm": k, "force_N": 0.5, "a_long_name_of_17": 2.0, "detail": 1.0} for k in (1, 2)]
    console.report(rows, as_json=False, brief=("detail",))
    out = capsys.readouterr().out
    assert "Left out: detail; --wide and" in out
    monkeypatch.setenv("COLUMNS", "16")
    console.report(rows, as_json=False, brief=("detail",), first=("force_N",))
    said = " ".join(capsys.readouterr().out.split())
    assert "Left out: a long name of 17, detail; --wide and --json show all columns." in said


STATE = {
    "status": "ok",
    "message": "",
    "model": "half",
    "depth_mm": 1.0,
    "shear_mm": 0.5,
    "force_N": [0.2731, 0, -4.149],
}
STATE |= {"shift_mm": [0.2055, 0.0, -0.3057], "tilt_rad": 0.04169, "contact_radius_mm": 2.062, "error_estimate": 2e-3}
STATE |= {"shift_error_estimate": 2e-3, "tilt_error_estimate": 2e-3, "dofs": 1234, "seconds": 0.5}


@pytest.mark.parametrize("columns", [20, 80])
def test_rows_one_by_one_keep_to_the_terminal(columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    longer = STATE | {"force_N": [-0.00012345678, -1.5e-9, 12345.678], "status": "not_converged", "stop": "x"}
    keys = [key for key in STATE if key not in ("message", "model", "dofs")]
    records = console.stream(
        iter([STATE, STATE, longer]), as_json=False, title="States", keys=keys, count=3, first=load_cases.FIRST
    )
    out = capsys.readouterr().out
    assert records == [STATE, STATE, longer]
    assert max(map(len, out.splitlines())) <= columns
    whole = " ".join(out.split())
    assert whole.count("-0.0001235, -1.5e-09, 1.235e+04") == 1
    assert whole.count("0.2731, 0, -4.149") == 2
    assert "Left out: model, dofs, stop; --wide" in whole


def test_control_characters_do_not_break_a_table(capsys):
    console.report([{"file": "a\nb\x1b[2J", "n": 1}] * 2, as_json=False)
    assert "a?b?[2J" in capsys.readouterr().out


def test_a_notebook_has_one_line_with_a_bar(monkeypatch):
    stream = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})()
    monkeypatch.setattr(sys, "stderr", stream)
    with console.chosen_progress(True) as report:
        report(0.5, "3 of 6 solves")
    assert stream.getvalue().count("\n") == 1
    _, half, whole = (line.rstrip() for line in stream.getvalue().split("\r"))
    assert half == f"{'█' * 12}{'░' * 12}  50 %  3 of 6 solves"
    assert whole == f"{'█' * 24} 100 %  done"


def test_the_shown_progress_never_falls(capsys):
    """A solve that is done again in smaller steps begins its own progress again."""
    with console.progress(as_json=False) as report:
        for fraction, text in ((0.35, "first"), (0.87, "second"), (0.35, "again"), (1.0, "end")):
            report(fraction, text)
    assert capsys.readouterr().err.split("\n")[:4] == ["35 % first", "87 % second", "87 % again", "100 % end"]


def test_a_command_says_each_warning_once(capsys):
    for _ in range(2):
        with console.warnings_once():
            for text in ("one run only", "no rest", "one run only"):
                console.warn(text)
    assert capsys.readouterr().err.split("\n") == [
        "magtip: warning: one run only",
        "magtip: warning: no rest",
    ] * 2 + [""]
