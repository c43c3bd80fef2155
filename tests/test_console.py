"""Tables on standard output: nothing is cut, nothing is longer than a line, and what is left out is named."""

import csv
import time
from functools import cache
from pathlib import Path

import pytest

from studies.output import console, text_tables
from studies.output.result import Destination, Result, show
from studies.simulation import load_cases
from studies.sweeps import sweep

RESULTS = Path(__file__).parents[1] / "results"
TABLES = sorted(str(path.relative_to(RESULTS)) for path in RESULTS.rglob("*.csv"))
"""Rows that verbs have printed, of all kinds."""

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


@cache
def rows_of(name, most=40):
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


@pytest.mark.parametrize("room", [40, 80, None])
def test_no_value_is_cut(room):
    for name in TABLES:
        nothing_is_cut(rows_of(name), room)


def nothing_is_cut(rows, room):
    columns = [text_tables.column(key, [row[key] for row in rows]) for key in rows[0]]
    places = text_tables.fitting([column.least for column in columns], 0, range(len(columns)), room)
    chosen = [columns[k] for k in places]
    widths = text_tables.spread(chosen, room)
    assert room is None or sum(widths) + 2 * (len(widths) - 1) <= room
    for k, row in enumerate(zip(*(column.cells for column in chosen), strict=True)):
        lines = text_tables.row(row, widths)
        start = 0
        for column, width in zip(chosen, widths, strict=True):
            pieces = " ".join(line[start : start + width].strip() for line in lines).split()
            assert pieces == column.cells[k].split(), column.head
            start += width + 2
    upright = text_tables.upright(rows[0], room, 4)
    shown = [f"{text_tables.shown(key, value, 4)} {text_tables.heading(key)[1]}" for key, value in rows[0].items()]
    names = [text_tables.heading(key)[0] for key in rows[0]]
    whole = "".join("".join(pair) for pair in zip(names, shown, strict=True))
    assert "".join("".join(upright).split()) == "".join(whole.split())


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


def test_needed_columns_are_never_left_out(capsys, monkeypatch):
    rows = [{"name": "a", "other": 12345, "force_N": 0.25, "shift_mm": [1.0, 2.0, 3.0]} for _ in range(2)]
    monkeypatch.setenv("COLUMNS", "18")
    console.report(rows, as_json=False, first=("force_N", "shift_mm"))
    out = capsys.readouterr().out
    assert out.splitlines().count("0.25   1, 2, 3") == 2
    assert "Left out: name, other;" in " ".join(out.split())
    monkeypatch.setenv("COLUMNS", "13")
    console.report(rows, as_json=False, first=("force_N", "shift_mm"))
    assert capsys.readouterr().out.split("\n\n")[0].splitlines() == [
        *("name   a", "other  12345"),
        *("force  0.25 N", "shift  1, 2,", "       3 mm"),
    ]


def test_a_pipe_takes_all_columns(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    rows = [{f"a_rather_long_name_{k}": "x" * 30 for k in range(20)}] * 2
    console.report(rows, as_json=False)
    lines = capsys.readouterr().out.splitlines()
    assert (len(lines[-2]), len(lines)) == (20 * 32 - 2, 5)


@pytest.mark.parametrize("columns", [20, 40, 80])
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


def test_a_sweep_shows_what_varies(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    rows = [{"D_mm": 8.0, "L_mm": 9.0, "f_mm": 5.0, "E_MPa": e, "depth_mm": 1.0} for e in (0.5, 1.0)]
    answers = {"fem_force_N": 1.0, "analytic_force_N": 2.0, "fem_shift_z_mm": 3.0, "force_error_percent": 4.0}
    for row in rows:
        row |= answers | {"fem_contact_radius_mm": 5.0, "status": "ok", "message": ""}
    found = Result(title="Sweep", records=[], shown=[sweep.table(rows, "Sweep")])
    show(found, Destination())
    head = capsys.readouterr().out.split("─")[0]
    assert "(MPa)" in head
    assert "contact" not in head
    show(found, Destination(wide=True))
    assert "contact" in capsys.readouterr().out.split("─")[0]


def test_remarks_name_what_varies_in_the_whole_table():
    rows = [{"D_mm": d, "E_MPa": e, "depth_mm": 1.0} for d in (8.0, 100.0) for e in (0.5, 1.0)]
    for row in rows[2:]:
        row["message"] = "too wide"
    keys = ("D_mm", "E_MPa", "depth_mm")
    assert console.remarks(rows[2:], keys, rows) == ["D 100 mm, E 0.5 MPa; D 100 mm, E 1 MPa: too wide"]


def test_a_long_table_is_quick(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    rows = [{f"value_{k}_mm": 0.1 * k * n for k in range(12)} for n in range(4000)]
    begin = time.process_time()
    console.report(rows, as_json=False)
    # a fifth of this; a library that measures every cell again and again takes ten times as long
    assert time.process_time() - begin < 4
    assert len(capsys.readouterr().out.splitlines()) > 4000


def test_control_characters_do_not_break_a_table(capsys):
    console.report([{"file": "a\nb\x1b[2J", "n": 1}] * 2, as_json=False)
    assert "a?b?[2J" in capsys.readouterr().out


def test_texts_in_a_table_of_texts(capsys, monkeypatch):
    words = "as many words as there are in a sentence that is longer than a line"
    for columns in (16, 40, 80):
        monkeypatch.setenv("COLUMNS", str(columns))
        console.table("T", ["name", "meaning"], [["D", words], ["L", "short"]])
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= columns
        assert " ".join(words.split()) in " ".join(out.replace("D", "").split())


@pytest.mark.parametrize(
    ("tokens", "said"),
    [
        (("fit", "t.csv"), "fits of all laws"),
        (("modes", "paper", "--accuracy", "quick"), "modes of the free sensor"),
        (("decode", "paper", "--file", "r.csv", "--out", "d.csv"), "poses of 600 rows"),
    ],
)
def test_what_takes_seconds_is_said_before(run, tmp_path, tokens, said):
    rows = [f"{1 + 0.1 * k},{0.1 * k}" for k in range(8)]
    (tmp_path / "t.csv").write_text("\n".join(["stretch,nominal_stress_MPa", *rows]))
    (tmp_path / "r.csv").write_text("S1_V,S2_V,S3_V\n" + "3.05,2.97,2.92\n" * 600)
    status, _, err = run(*tokens)
    assert status == 0
    assert said in err


def test_the_shown_progress_never_falls(capsys):
    """A solve that is done again in smaller steps begins its own progress again."""
    with console.progress(as_json=False) as report:
        for fraction, text in ((0.35, "first"), (0.87, "second"), (0.35, "again"), (1.0, "end")):
            report(fraction, text)
    assert capsys.readouterr().err.split("\n")[:4] == ["35 % first", "87 % second", "87 % again", "100 % end"]
