"""Axes and study files: what is accepted, and one sentence for everything else."""

import dataclasses
import math

import pytest

from geometry.design import BadInput, Design, paper
from studies.inputs.study_input import parse_axes, read_study, study_design
from studies.inputs.units import quantity
from studies.inputs.user_input import fabrication_of, read_design


@pytest.mark.parametrize(
    ("axes", "parts"),
    [
        ([], ["needs an axis"]),
        (["D"], ["NAME=a,b,c"]),
        (["D=1,,2"], ["axis D must be a finite number"]),
        (["D=6,nan"], ["axis D", "got nan"]),
        (["D=6,6.0"], ["axis D lists a value twice"]),
        (["dephts=1"], ["'dephts'", "did you mean depth"]),
        (["prony=1"], ["prony is a text and no axis: state it in the design, or vary loss_factor"]),
        (["force=2,4"], ["there is no axis 'force'", "for given forces take magtip solve --forces"]),
        (["zzz=1"], ["there is no axis 'zzz'", "such as D, L, f, E, depth, shear"]),
        (
            ["law=yeoh,steel"],
            ["every value of axis law must be neo-hookean, mooney-rivlin, yeoh or ogden", "'steel'"],
        ),
        (["friction=glue"], ["every value of axis friction must be none, stick or a number", "'glue'"]),
        (["plate_tilt=50"], ["axis plate_tilt must lie between -40 and 40 deg; got 50"]),
        (["D=lin:6:10"], ["axis D must read a,b,c or lin:START:STOP:COUNT", "'lin:6:10'"]),
        (["D=lin:6:10:2.5"], ["the count of linspace must be a whole number from 2"]),
        (["D=log:0:10:3"], ["start and stop of logspace must be more than 0"]),
        (["D=6,-1"], ["axis D must lie between 0.1 and 200", "-1"]),
    ],
)
def test_bad_axes(axes, parts, refused):
    with refused(*parts):
        parse_axes(axes)


def test_study_finds_its_design_beside_it(toml):
    toml("D = 10\nL = 12", "sensor.toml")
    study = read_study(toml('design = "sensor.toml"\ndepth = 1\n[axes]\nf = [5, 6]', "study.toml"))
    assert study_design(study, ["E=2"]) == Design(D=10.0, L=12.0, E=2.0)
    assert study.load == {"depth": 1.0}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("depth = 1", ["needs a table"]),
        ("[axes]", ["needs an axis"]),
        ("axes = 3", ["axes must be a table"]),
        ("[axes]\nD = 3", ["axis D must be a list of values"]),
        ("[axes]\nD = [3, true]", ["axis D must be a list of numbers"]),
        ("[axes]\nD = {steps = [1, 2, 3]}", ["axis D: a table has one key, linspace or logspace"]),
        ("[axes]\nD = {linspace = [1, 2]}", ["linspace takes three numbers, start, stop and count"]),
        ("version = true\n[axes]\nD = [3]", ["version must be a whole number from 1 to 2; got True"]),
        (
            "version = 3\n[axes]\nD = [3]",
            ["the study has version 3", "reads versions 1 to 2", "install a newer magtip"],
        ),
        ("[load]\ndepht = 1\n[axes]\nD = [3]", ["'depht'", "did you mean depth"]),
        ("[load]\ndepth = [1, 2]\n[axes]\nD = [3]", [r"depth in \[load\] must be one value", "several make an axis"]),
        ("depth = 1\n[load]\ndepth = 1\n[axes]\nD = [3]", [r"depth is given twice, alone and in \[load\]"]),
        ('quantities = ["forces"]\n[axes]\nD = [3]', ["there is no quantity 'forces'", "force, shift"]),
        ("[[zipped]]\nL = [9, 12]\nl0 = [7]", ["the same number of values", "L has 2, l0 has 1"]),
        ("quantities = []\n[axes]\nD = [3]", ["quantities is empty"]),
        ("[[zipped]]\nL = [9, 9]\nD = [7, 7]", ["the zipped axes L, D list a point twice"]),
        ("[axes]\nL = [9]\n[[zipped]]\nL = [9, 12]", ["L varies twice"]),
        ("[sample]\ncount = 4", ["there are no ranges", r"\[sample.ranges\]"]),
        ("[sample]\ncount = 6\n[sample.ranges]\nD = [6, 8]", ["a power of 2 as count; got 6: take 4 or 8"]),
        ('[sample]\nmethod = "grid"\ncount = 4\n[sample.ranges]\nD = [6, 8]', ["latin-hypercube or sobol", "'grid'"]),
        ("[sample]\ncount = 4\n[sample.ranges]\nlaw = [1, 2]", ["law has names, not numbers"]),
        ("axis = 3\n[axes]\nD = [3]", ["'axis'", "did you mean axes"]),
        ('magnet = "soft"\n[axes]\nD = [3]', ["magnet must be 'rigid' or 'ignored'", "soft"]),
        ('accuracy = "best"\n[axes]\nD = [3]', ["accuracy must be 'quick', 'standard' or 'fine'"]),
        ("design = 3\n[axes]\nD = [3]", ["design must be"]),
    ],
)
def test_bad_studies(toml, text, parts, refused):
    with refused(*parts):
        study = read_study(toml(text, "study.toml"))
        study_design(study)


def test_spaced_axes_have_exact_ends():
    axes = parse_axes(["depth=log:0.1:3:4", "D=lin:0.1:0.7:7"])
    assert axes["depth"] == pytest.approx([0.1, 0.310723250595, 0.965489384606, 3.0])
    assert (axes["depth"][0], axes["depth"][-1]) == (0.1, 3.0)
    assert axes["D"] == [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]


FULL = """
version = 2
models = ["quick", "finite"]
quantities = ["tilt", "force"]
[load]
friction = "stick"
depth = 1
[axes]
law = ["neo-hookean", "yeoh"]
E = { linspace = [0.5, 1.5, 3] }
[[zipped]]
L = [9, 12, 12]
l0 = [7.2, 7.2, 10.2]
[sample]
method = "latin-hypercube"
count = 5
seed = 3
log = ["shear"]
[sample.ranges]
shear = [0.1, 1]
nu = [0.45, 0.4998]
"""


def test_a_study_of_everything(toml):
    study = read_study(toml(FULL, "study.toml"))
    assert (study.models, study.quantities) == (("quick", "finite"), ("force", "tilt"))
    assert study.load == {"friction": "stick", "depth": 1.0}
    assert [factor.names for factor in study.factors] == [("law",), ("E",), ("L", "l0"), ("shear", "nu")]
    assert [factor.count for factor in study.factors] == [2, 3, 3, 5]
    assert study.axes["E"] == [0.5, 1.0, 1.5]
    assert study.axes["l0"] == [7.2, 7.2, 10.2]
    # one point of a Latin hypercube lies in each fifth of each range, on a log scale for the shear
    fifths = [int(5 * (math.log10(shear) + 1)) for shear in study.axes["shear"]]
    assert sorted(fifths) == [0, 1, 2, 3, 4]
    assert sorted(int((nu - 0.45) / 0.0498 * 5) for nu in study.axes["nu"]) == [0, 1, 2, 3, 4]
    assert read_study(toml(FULL, "study.toml")).axes == study.axes


# Numbers with units: what is converted, and one sentence for everything else.


@pytest.mark.parametrize(
    ("value", "unit", "result"),
    [
        (5, "N", 5.0),
        ("5 mN", "N", 0.005),
        ("1e3mN", "N", 1.0),
        (" .5  kN ", "N", 500.0),
        ("2 cm", "mm", 20.0),
        ("50 µm", "mm", 0.05),
        ("750 kPa", "MPa", 0.75),
        ("3.125 mV/G", "V/T", 31.25),
        ("130 nT/sqrt(Hz)", "T/sqrt(Hz)", 130e-9),
        ("1.03 g/cm3", "kg/m3", 1030.0),
    ],
)
def test_value(value, unit, result):
    assert quantity("x", value, unit) == pytest.approx(result, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "unit", "parts"),
    [
        ("5 n", "N", ["x: 'n' is no unit for it", "did you mean N"]),
        ("5 kg", "N", ["'kg' is no unit", "choose one of N, mN, kN"]),
        ("five", "N", ["x must be a number in N, such as 5 or \"5 N\"; got 'five'"]),
        ("nan", "N", ["must be a number in N"]),
        (float("nan"), "N", ["must be a number in N"]),
        (True, "N", ["must be a number in N", "True"]),
        (40, "1", ["x must lie between 0 and 5; got 40: write 40 % as 0.4"]),
        (-1, "N", ["x must lie between 0 and 5 N; got -1 N"]),
        ("6 kN", "N", ["x must lie between 0 and 5 N; got 6000 N"]),
    ],
)
def test_refusal(value, unit, parts, refused):
    with refused(*parts):
        quantity("x", value, unit, 0.0, 5.0)


# Designs and numbers that users give: what is accepted, and one sentence for everything else.


def test_file_fills_from_the_preset(toml):
    assert read_design(toml("D = 10\nL = 12.5\n")) == dataclasses.replace(paper(), D=10.0, L=12.5)
    assert read_design(toml('base = "paper"\nE = 2e-1'), ["E=3"]).E == 3.0
    assert read_design(toml("")) == paper()
    assert read_design(toml(b"\xef\xbb\xbfD = 10\r\n")).D == 10.0


@pytest.mark.parametrize(
    ("sets", "parts"),
    [
        (["magnet_hieght=3"], ["did you mean magnet_height"]),
        (["qqqqqq=3"], ["there is no key 'qqqqqq': `magtip design paper` lists all"]),
        (["D"], ["KEY=VALUE", "'D'"]),
        (["D=nan"], ["D must be a finite number", "nan"]),
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
        ("D = 1" + "0" * 400, ["whole number of more than 19 digits"]),
        ("D = 8\nD = 9", ["not valid TOML", "line 2"]),
        ("D = " + "[" * 5000, ["nested more than 50 deep"]),
        ("a" + ".a" * 300 + " = 1", ["more than 200 points"]),
        ("D = " + "9" * 5000, ["whole number of more than 19 digits"]),
        ('base = "papre"', ["'papre'", "did you mean paper"]),
        ("base = 3", ["base must be a string"]),
        (b"D = 8 # \xff", ["not UTF-8"]),
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


def test_ignored_magnet_need_not_fit(refused):
    small = read_design("paper", ["D=3"], magnet="ignored")
    assert (small.D, small.magnet_diameter, small.magnet_height) == (3.0, 0.0, 0.0)
    assert read_design("paper", magnet="ignored") == paper()
    with refused("silicone around it"):
        read_design("paper", ["D=3"])


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
