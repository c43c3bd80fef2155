"""The verb field: columns, precision, and bad tables."""

import csv

import pytest

from analytic import hall
from geometry.design import paper

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
    assert run("field", "paper", "--points", "p.csv", "--shift=.5,0,-1", "--tilt=0,.1", "--out", "b.csv")[:2] == (
        0,
        "",
    )
    assert (tmp_path / "b.csv").read_text() == out


def test_other_columns_stay(run, tmp_path):
    (tmp_path / "p.csv").write_text('﻿label,x_mm,y_mm,z_mm\n"a, b",1,2,-3\n', encoding="utf-8")
    (row,) = table(run("field", "paper", "--points", "p.csv", "--level", "dipole")[1])
    assert row["label"] == "a, b"
    assert float(row["Bz_T"]) == hall.field_at([[1, 2, -3]], paper(), field="dipole")[0, 2]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("x_mm,y_mm,z_mm\n", "has a header but no rows: add a row of numbers below it"),
        ("x_mm,z_mm\n1,2\n", "column y_mm is missing"),
        ("1,2,3\n", "column x_mm is missing"),
        ("x_mm,z_mm,y_mm\n1,2,3\n", "in the order"),
        ("x_mm,x_mm,y_mm,z_mm\n1,1,2,3\n", "once each"),
        ("x_mm,y_mm,z_mm,Bx_T\n1,2,3,4\n", "Bx_T exists already"),
        ("x_mm,y_mm,z_mm\n1,2,3\n1,two,3\n", "line 3: y_mm must be a finite number"),
        ("x_mm,y_mm,z_mm\n1,2,nan\n", "line 2: z_mm must be a finite number"),
        ("x_mm,y_mm,z_mm\n1,2\n", "line 2: 2 values for 3 columns"),
        ("x_mm,y_mm,z_mm\n2,0,6\n", "infinite on the magnet's rim"),
        ('x_mm,y_mm,z_mm\n"1,2,3\n', "line 2 is not CSV"),
        ("x_mm;y_mm;z_mm\n1,5;2;3\n", "line 1: semicolons separate its columns: save it with commas"),
        ("x_mm\ty_mm\tz_mm\n1\t2\t3\n", "line 1: tabs separate its columns"),
        ('x_mm,y_mm,z_mm\n"1,5",2,3\n', "got '1,5': write a point, no comma"),
        ("x_mm,y_mm,z_mm\n1,5,2,0,3,0\n", "6 values for 3 columns: write a point"),
    ],
)
def test_bad_tables_are_a_sentence(refusal, tmp_path, text, words):
    (tmp_path / "p.csv").write_text(text)
    assert words in refusal("field", "paper", "--points", "p.csv")


@pytest.mark.parametrize(
    "tokens",
    [
        ("field", "paper", "--points", "none.csv"),
        ("field", "paper", "--points", "p.csv", "--out", "b.txt"),
        ("field", "paper", "--points", "p.csv", "--shift", "1,2"),
        ("field", "paper", "--points", "p.csv", "--tilt", "1,2,nan"),
        ("field", "paper", "--points", "p.csv", "--level", "best"),
        ("field", "paper", "--points", "p.csv", "--set", "magnet_diameter=0", "--set", "magnet_height=0"),
        ("field", "paper", "--points", "p.csv", "--level", "paper", "--shift", "0,0,-7.2"),
    ],
)
def test_bad_options_are_a_sentence(refusal, tmp_path, tokens):
    (tmp_path / "p.csv").write_text(POINTS)
    refusal(*tokens)
