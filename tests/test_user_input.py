"""Designs and numbers that users give: what is accepted, and one sentence for everything else."""

import dataclasses

import pytest

from geometry.design import BadInput, paper
from studies.inputs.user_input import fabrication_of, nearest, parse_numbers, read_design


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
def test_bad_overrides(sets, parts, refused):
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
def test_bad_files(toml, text, parts, refused):
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
def test_no_file(source, parts, refused):
    with refused(*parts):
        read_design(source)


def test_folder_instead_of_file(tmp_path, refused):
    with refused("is a folder"):
        read_design(str(tmp_path))


def test_ignored_magnet_need_not_fit(refused):
    small = read_design("paper", ["D=3"], magnet="ignored")
    assert (small.D, small.magnet_diameter, small.magnet_height) == (3.0, 0.0, 0.0)
    assert read_design("paper", magnet="ignored") == paper()
    with refused("silicone around it"):
        read_design("paper", ["D=3"])


@pytest.mark.parametrize("sets", [["magnet_height=-1"], ["D=3", "L=1"], ["magnet_diameter=300"]])
def test_ignored_magnet_hides_no_other_fault(sets, refused):
    with refused("must"):
        read_design("paper", sets, magnet="ignored")


def test_numbers():
    assert parse_numbers("x", " -1, 2e3 ") == [-1.0, 2000.0]


def test_nearest():
    assert nearest("papre", ["paper"]) == "did you mean paper?"
    assert nearest("zzz", ["D", "L"]) == "choose one of D, L"


def test_law_by_option_and_by_file(tmp_path):
    assert read_design("paper", ["law=yeoh", "yeoh_2=0.5"]).law_numbers == (0.5, 0.0)
    file = tmp_path / "design.toml"
    file.write_text('law = "ogden"\nogden_share = 0.25\n')
    assert read_design(str(file)).law_numbers == (2.0, -2.0, 0.25)
    with pytest.raises(BadInput, match=r"there is no law 'ogdn': did you mean ogden\?"):
        read_design("paper", ["law=ogdn"])
    file.write_text("law = 3\n")
    with pytest.raises(BadInput, match="law must be a string; got 3"):
        read_design(str(file))


def test_a_design_file_says_how_the_sensor_is_made(toml, refused):
    path = toml(
        'L = 10.0\n[fabrication]\nprocess = "sla"\nbase = { shape = "round" }\n[requirements]\nforce_z = 5.0\n'
    )
    assert read_design(path).L == 10.0
    assert fabrication_of(path) == {"process": "sla", "base": {"shape": "round"}}
    assert fabrication_of("paper") == {}
    with refused("fabrication: there is no key 'proces'", "did you mean process"):
        fabrication_of(toml('[fabrication]\nproces = "sla"\n', "other.toml"))
