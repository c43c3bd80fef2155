"""Axes and study files: what is accepted, and one sentence for everything else."""

import pytest

from geometry.design import Design, paper
from studies.inputs.study_input import is_study, parse_axes, read_study, study_design


def test_axes():
    assert parse_axes(["D=6,8, 10", "depth=0.5,1"]) == {"D": [6.0, 8.0, 10.0], "depth": [0.5, 1.0]}


@pytest.mark.parametrize(
    ("axes", "parts"),
    [
        ([], ["needs an axis"]),
        (["D"], ["NAME=a,b,c"]),
        (["D="], ["axis D is empty"]),
        (["D=1,,2"], ["axis D must be a finite number"]),
        (["D=6,x"], ["axis D", "'x'"]),
        (["D=6,nan"], ["axis D", "'nan'"]),
        (["D=6,6.0"], ["axis D lists a value twice"]),
        (["D=6", "D=7"], ["axis D is given twice"]),
        (["dephts=1"], ["'dephts'", "did you mean depth"]),
        (["zzz=1"], ["choose one of D, L, f, E, depth"]),
        (["law=yeoh,ogden"], ["law cannot be an axis", "is a list of numbers for D, L, f", "--set"]),
        (["nu=0.4,0.49"], ["nu cannot be an axis", "is a list of numbers"]),
        (["D=6,-1"], ["axis D must lie between 0.1 and 200", "-1"]),
        (["depth=0"], ["axis depth must be more than 0 mm"]),
    ],
)
def test_bad_axes(axes, parts, refused):
    with refused(*parts):
        parse_axes(axes)


STUDY = 'design = "paper"\nmagnet = "rigid"\n[axes]\nD = [6, 8, 10]\nE = [0.5, 1, 2]\ndepth = [0.5, 1, 2]\n'


def test_study(toml):
    path = toml(STUDY, "study.toml")
    study = read_study(path)
    assert study.axes == {"D": [6.0, 8.0, 10.0], "E": [0.5, 1.0, 2.0], "depth": [0.5, 1.0, 2.0]}
    assert (study.design, study.magnet, study.depth, study.accuracy) == ("paper", "rigid", None, None)
    assert all(isinstance(value, float) for values in study.axes.values() for value in values)
    assert study_design(study) == paper()
    assert is_study(path)
    assert not is_study("paper")


def test_study_finds_its_design_beside_it(toml):
    toml("D = 10\nL = 12", "sensor.toml")
    study = read_study(toml('design = "sensor.toml"\ndepth = 1\n[axes]\nf = [5, 6]', "study.toml"))
    assert study_design(study, ["E=2"]) == Design(D=10.0, L=12.0, E=2.0)
    assert study.depth == 1.0


def test_study_with_a_table_as_design(toml):
    study = read_study(toml("[design]\nD = 10\nL = 12\n[axes]\nf = [5, 6]", "study.toml"))
    assert study_design(study) == Design(D=10.0, L=12.0)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("depth = 1", ["needs a table"]),
        ("[axes]", ["needs an axis"]),
        ("axes = 3", ["axes must be a table"]),
        ("[axes]\nD = 3", ["axis D must be a list of numbers"]),
        ("[axes]\nD = [3, true]", ["axis D must be a number"]),
        ("[axes]\nD = [3, nan]", ["axis D must be a finite number"]),
        ("[axes]\nD = []", ["axis D is empty"]),
        ("[axes]\nd = [1]", ["'d'", "did you mean"]),
        ('[axes]\nlaw = ["yeoh"]', ["law cannot be an axis", "is a list of numbers for D, L, f"]),
        ("axis = 3\n[axes]\nD = [3]", ["'axis'", "did you mean axes"]),
        ('magnet = "soft"\n[axes]\nD = [3]', ["magnet must be 'rigid' or 'ignored'", "soft"]),
        ('accuracy = "best"\n[axes]\nD = [3]', ["accuracy must be 'quick', 'standard' or 'fine'"]),
        ("depth = -1\n[axes]\nD = [3]", ["depth must be more than 0 mm; got -1"]),
        ("depth = true\n[axes]\nD = [3]", ["depth must be a number"]),
        ("design = 3\n[axes]\nD = [3]", ["design must be"]),
        ("[design]\nDD = 3\n[axes]\nD = [3]", ["'DD'", "did you mean D"]),
    ],
)
def test_bad_studies(toml, text, parts, refused):
    with refused(*parts):
        study = read_study(toml(text, "study.toml"))
        study_design(study)


def test_law_of_a_study(toml):
    study = toml('[design]\nlaw = "mooney-rivlin"\nmooney_share = 0.125\n[axes]\nE = [1, 2]\n', "study.toml")
    assert study_design(read_study(study)).law_numbers == (0.125,)
