"""The one reader of designs, axes and studies: what it accepts, and one sentence for everything else."""

import dataclasses

import pytest

from geometry.design import BadInput, Design, paper
from studies.inputs.user_input import (
    is_study,
    nearest,
    parse_axes,
    parse_numbers,
    read_design,
    read_study,
    study_design,
)


@pytest.fixture
def toml(tmp_path):
    def write(text, name="sensor.toml"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return str(path)

    return write


def refused(*parts):
    """Expect a BadInput of one line that holds all parts."""
    pattern = "".join(f"(?=.*{part})" for part in parts)
    return pytest.raises(BadInput, match=rf"(?s)^{pattern}[^\n]*$")


def test_preset_and_overrides():
    assert read_design("paper") == paper()
    assert read_design("paper", ["D = 9", "L=12"]) == dataclasses.replace(paper(), D=9.0, L=12.0)


def test_file_fills_from_the_preset(toml):
    assert read_design(toml("D = 10\nL = 12.5\n")) == dataclasses.replace(paper(), D=10.0, L=12.5)
    assert read_design(toml('base = "paper"\nE = 2e-1'), ["E=3"]).E == 3.0
    assert read_design(toml("")) == paper()
    assert read_design(toml(b"\xef\xbb\xbfD = 10\r\n")).D == 10.0


@pytest.mark.parametrize(
    ("sets", "parts"),
    [
        (["magnet_hieght=3"], ["did you mean magnet_height"]),
        (["d=3"], ["did you mean D"]),
        (["qqqqqq=3"], ["choose one of D, L, f, E"]),
        (["D"], ["KEY=VALUE", "'D'"]),
        (["=3"], ["KEY=VALUE"]),
        (["D="], ["D must be a finite number"]),
        (["D=8mm"], ["D must be a finite number", "8mm"]),
        (["D=nan"], ["D must be a finite number", "nan"]),
        (["D=-inf"], ["D must be a finite number"]),
        (["D=1e999"], ["D must be a finite number"]),
        (["D=True"], ["D must be a finite number"]),
        (["D=-8"], ["D must lie between 0.1 and 200 mm; got -8 mm"]),
        (["magnet_diameter=7.9"], ["mm of silicone around it"]),
    ],
)
def test_bad_overrides(sets, parts):
    with refused(*parts):
        read_design("paper", sets)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("D = 8\nLL = 9", ["'LL'", "did you mean"]),
        ("D = true", ["D must be a number", "True"]),
        ('D = "8"', ["D must be a number", "'8'"]),
        ("D = nan", ["D must be a finite number"]),
        ("D = inf", ["D must be a finite number"]),
        ("D = [8]", ["D must be a number"]),
        ("[D]\nx = 1", ["D must be a number"]),
        ("D = 1979-05-27", ["D must be a number"]),
        ("D = 1" + "0" * 400, ["D must"]),
        ("D = -8", ["D must lie between"]),
        ("D = 8\nL = = 9", ["not valid TOML", "line 2"]),
        ("D = 8\nD = 9", ["not valid TOML", "line 2"]),
        ("D = " + "[" * 5000, ["not valid TOML"]),
        ('base = "papre"', ["'papre'", "did you mean paper"]),
        ("base = 3", ["base must be a string"]),
        (b"D = 8 # \xff", ["not UTF-8"]),
        (b"\x00\x01", ["not valid TOML"]),
    ],
)
def test_bad_files(toml, text, parts):
    with refused(*parts):
        read_design(toml(text))


@pytest.mark.parametrize(
    ("source", "parts"),
    [
        ("papre", ["'papre'", "did you mean paper"]),
        ("missing.toml", ["missing.toml", "presets: paper"]),
        ("x" * 5000, ["cannot be read"]),
        ("a\0b", ["cannot be read"]),
        ("", [""]),
    ],
)
def test_no_file(source, parts):
    with refused(*parts):
        read_design(source)


def test_folder_instead_of_file(tmp_path):
    with refused("is a folder"):
        read_design(str(tmp_path))


def test_ignored_magnet_need_not_fit():
    small = read_design("paper", ["D=3"], magnet="ignored")
    assert (small.D, small.magnet_diameter, small.magnet_height) == (3.0, 0.0, 0.0)
    assert read_design("paper", magnet="ignored") == paper()
    with refused("silicone around it"):
        read_design("paper", ["D=3"])


@pytest.mark.parametrize("sets", [["magnet_height=-1"], ["D=3", "L=1"], ["magnet_diameter=300"]])
def test_ignored_magnet_hides_no_other_fault(sets):
    with refused("must"):
        read_design("paper", sets, magnet="ignored")


def test_axes():
    assert parse_axes(["D=6,8, 10", "depth=0.5,1"]) == {"D": [6.0, 8.0, 10.0], "depth": [0.5, 1.0]}
    assert parse_numbers("x", " -1, 2e3 ") == [-1.0, 2000.0]


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
def test_bad_axes(axes, parts):
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
def test_bad_studies(toml, text, parts):
    with refused(*parts):
        study = read_study(toml(text, "study.toml"))
        study_design(study)


def test_nearest():
    assert nearest("papre", ["paper"]) == "did you mean paper?"
    assert nearest("zzz", ["D", "L"]) == "choose one of D, L"


def test_law_by_option_by_file_and_by_study(tmp_path):
    assert read_design("paper", ["law=yeoh", "yeoh_2=0.5"]).law_numbers == (0.5, 0.0)
    file = tmp_path / "design.toml"
    file.write_text('law = "ogden"\nogden_share = 0.25\n')
    assert read_design(str(file)).law_numbers == (2.0, -2.0, 0.25)
    study = tmp_path / "study.toml"
    study.write_text('[design]\nlaw = "mooney-rivlin"\nmooney_share = 0.125\n[axes]\nE = [1, 2]\n')
    assert study_design(read_study(str(study))).law_numbers == (0.125,)
    with pytest.raises(BadInput, match=r"there is no law 'ogdn': did you mean ogden\?"):
        read_design("paper", ["law=ogdn"])
    file.write_text("law = 3\n")
    with pytest.raises(BadInput, match="law must be a string; got 3"):
        read_design(str(file))
