"""Requirements, catalogues and published sensors: what is read, and one sentence for everything else."""

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from analytic.parts import of_design
from geometry.base import Base, plan
from geometry.design import Design
from geometry.hall_chips import CHIPS
from studies.firmware import decoder_export
from studies.inputs.user_input import read_design
from studies.output.goals import Goal, failures
from studies.parts.catalogues import catalogues_of, read_catalogue
from studies.parts.requirements import LIMITS, Requirements, read_requirements
from studies.sizing import advice, sizing_export
from studies.sizing.advice import choices, could_give, demand
from studies.sizing.candidate_variables import Space, Variant, part_fields
from studies.sizing.conflicts import impossible
from studies.sizing.published_sensors import published_sensors, reached_in
from studies.sizing.variant_search import Effort, Rating, searched, sorted_parts

FULL = """
version = 1
force_z = "5 N"
force_x = "2000 mN"
resolution_z = "5 mN"
resolution_x = 0.005
bandwidth = "0.1 kHz"
samples = 4
converter_noise = "0.2 mV"
converter_step = "0.3 mV"
converter_rate = "10 kHz"
largest_strain = "60 %"
no_saturation = true
unique_decoding = false
stability_margin = 1.2
first_mode = 100
drift_per_K = "0.2 %"
ambient_error = "20 mN"
ambient_field = "60 uT"
ambient_turn = "90 deg"
reject_ambient = true
chips = 3
temperature_error = 0.5
temperature_change = "15 K"
hysteresis = "8 %"
speed = "0.5 mm/s"
least_yield = "90 %"
outer_size = "1 cm"
outer_shape = "square"
height = 20
process = "sla"
wall = "500 um"
D = ["6 mm", 10]
catalogues = ["mine.toml"]
shipped = ["magnets"]
magnets = ["4x2 N35"]
hall_parts = ["SS495A"]
silicones = ["Dragon Skin 30"]
seed = 7
[weights]
range = 2
size = 0
"""


def test_every_key(toml, tmp_path):
    assert read_requirements(toml(FULL)) == Requirements(
        force_z=5.0,
        force_x=2.0,
        resolution_z=0.005,
        resolution_x=0.005,
        bandwidth=100.0,
        samples=4,
        converter_noise=0.2e-3,
        converter_step=0.3e-3,
        converter_rate=10e3,
        largest_strain=0.6,
        unique_decoding=False,
        stability_margin=1.2,
        first_mode=100.0,
        drift_per_K=0.002,
        ambient_error=0.02,
        ambient_field=60e-6,
        ambient_turn=90.0,
        reject_ambient=True,
        chips=3,
        temperature_error=0.5,
        temperature_change=15.0,
        hysteresis=0.08,
        least_yield=0.9,
        speed=0.5,
        outer_size=10.0,
        outer_shape="square",
        height=20.0,
        process="sla",
        wall=0.5,
        D_low=6.0,
        D_high=10.0,
        catalogues=(str(tmp_path / "mine.toml"),),
        shipped=("magnets",),
        magnets=("4x2 N35",),
        hall_parts=("SS495A",),
        silicones=("Dragon Skin 30",),
        seed=7,
        weight_range=2.0,
        weight_size=0.0,
    )


def test_size_says_which_of_its_arguments_is_missing(toml, run):
    assert "needs --out FOLDER: add it" in run("size", toml(FULL))[2]
    assert "needs a file of requirements" in run("size", "--out", "folder")[2]


def test_rows_state_what_is_unset():
    states = {row["requirement"]: row["state"] for row in Requirements(force_z=5.0, largest_strain=0.4).rows()}
    assert set(states) == {*LIMITS, "no_saturation", "unique_decoding", "screws", "reject_ambient"}
    assert states["force_z"] == states["largest_strain"] == "set"
    assert states["stability_margin"] == states["no_saturation"] == "default"
    assert states["force_x"] == states["first_mode"] == "unset"


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["sensor.toml: requirements need force_z, the normal force of the press"]),
        ("force_z = 5\nforce_y = 2", ["there is no key 'force_y'", "did you mean force_z"]),
        ('force_z = "5 kg"', ["force_z: 'kg' is no unit for it: choose one of N, mN, kN"]),
        ("force_z = nan", ["force_z must be a finite number; got nan"]),
        ("force_z = 0", ["force_z must lie between 0.001 and 10000 N; got 0 N"]),
        ("force_z = 5\nleast_yield = 1.2", ["least_yield must lie between 0.01 and 0.99; got 1.2"]),
        ("force_z = 5\nlargest_strain = 40", ["must lie between 0.01 and 5; got 40: write 40 % as 0.4"]),
        ("force_z = 5\nresolution_z = 5", ["resolution_z must be below the range force_z = 5 N; got 5 N"]),
        ("force_z = 5\nD = [8, 6]", ["the range must be", "low <= high; got 8 and 6 mm"]),
        ("force_z = 5\nD = [1, 2, 3]", ["D must be one diameter, or a range"]),
        ("force_z = 5\nD = 12\nouter_size = 10", ["outer_size must be at least the diameter D = 12 mm; got 10 mm"]),
        ("force_z = 5\nD = 8\nheight = 6", ["height must exceed 0.75 D = 6 mm", "got 6 mm"]),
        ("force_z = 5\nsamples = 1.5", ["samples must be a whole number; got 1.5"]),
        ("force_z = 5\nno_saturation = 1", ["no_saturation must be true or false; got 1"]),
        ("force_z = 5\nseed = -1", ["seed must be 0 or more"]),
        ("force_z = 5\nreject_ambient = true", ["needs 3 chips of three axes, and chips = 1 allows fewer"]),
        ('force_z = 5\nprocess = "cnc"', ["process must be 'fdm' or 'sla'", "cnc"]),
        ('force_z = 5\nshipped = ["magnet"]', ["shipped: there is no key 'magnet'", "did you mean magnets"]),
        ("force_z = 5\nmagnets = []", ["magnets is empty: name one or more"]),
        ('force_z = 5\nsilicones = ["A", "A"]', ["silicones lists 'A' twice"]),
        ("force_z = 5\n[weights]\nrnge = 1", ["weights: there is no key 'rnge'", "did you mean range"]),
        ("force_z = 5\n[weights]\nrange = 0\nresolution = 0\nsize = 0", ["weights: all are 0"]),
        ("force_z = 5\nversion = 2", ["the requirements have version 2, and this version of magtip reads version 1"]),
    ],
)
def test_refusal(text, parts, toml, refused):
    with refused(*parts):
        read_requirements(toml(text))


# Requirements without a variant: what a bound proves at once, and advice that holds.


NEEDED = Requirements(
    force_z=5.0,
    force_x=1.5,
    largest_strain=0.3,
    D_low=8.0,
    D_high=12.0,
    magnets=("5x3 N45", "4x4 N45"),
    silicones=("Smooth-Sil 940", "Dragon Skin 30"),
    hall_parts=("DRV5055A2",),
)
PARTS = catalogues_of(NEEDED)
BRIEF = Effort(64, 6)


@pytest.mark.parametrize(("key", "bound"), [("outer_size", 9.0), ("height", 9.0), ("wall", 4.0)])
def test_what_is_impossible_by_a_bound_is_said_at_once(key, bound):
    needed = dataclasses.replace(NEEDED, **{key: bound})
    (text,) = impossible(needed, PARTS)
    assert "impossible" in text
    assert f"{bound:g} mm" in text


def test_no_candidate_is_beyond_a_bound():
    """A bound is a proof: no random candidate has a smaller base or a lower sensor."""
    needed = dataclasses.replace(NEEDED, D_low=None, D_high=None)
    space, random = Space(needed, sorted_parts(PARTS)), np.random.default_rng(2)
    drawn = space.candidates(random.integers([2, 2, 1], size=(4000, 3)), random.random((4000, 5)))
    size, height, _ = (each[drawn.outside() == ""] for each in drawn.sizes())
    for key, least in (("outer_size", size.min()), ("height", height.min())):
        assert not impossible(dataclasses.replace(needed, **{key: float(least)}), PARTS)


@pytest.mark.parametrize("strict", [1.0, 1e-3])
def test_a_demand_does_not_depend_on_how_much_too_strict_the_requirement_is(strict, monkeypatch):
    monkeypatch.setattr(advice, "FAR", BRIEF)
    needed = dataclasses.replace(NEEDED, resolution_z=1e-3 * strict)
    assert 0.02 < demand(("resolution_z",), needed)[1]["resolution_z"] < 0.2
    forces = dataclasses.replace(NEEDED, force_z=min(50.0 / strict, 1e4), force_x=None)
    assert 5 < demand(("force_z",), forces)[1]["force_z"] < 50


def test_no_random_candidate_needs_less_of_a_bound_that_gives(monkeypatch):
    """The base of the demand is at most 1 % larger than that of any random candidate that meets all else."""
    monkeypatch.setattr(advice, "FAR", Effort(64, 12))
    needed = dataclasses.replace(NEEDED, outer_size=15.0, largest_strain=0.8)
    _, reached, _ = demand(("outer_size",), needed)
    loose, random = dataclasses.replace(needed, outer_size=40.0), np.random.default_rng(4)
    space = Space(loose, sorted_parts(PARTS))
    drawn = space.candidates(random.integers([2, 2, 1], size=(4000, 3)), random.random((4000, 5)))
    _, violation = Rating(loose)(drawn)
    met = drawn.take(violation == 0)
    assert len(met) > 20
    assert needed.outer_size < reached["outer_size"] < 1.01 * met.sizes()[0].min()


def test_two_bounds_give_together_where_none_does_alone(monkeypatch):
    monkeypatch.setattr(advice, "FAR", Effort(64, 12))
    needed = dataclasses.replace(NEEDED, outer_size=15.0, resolution_z=1e-3, largest_strain=0.5)
    _, pairs = could_give(needed, searched(needed, PARTS, BRIEF))
    assert pairs[0] == ("outer_size", "resolution_z")
    assert not any(demand((name,), needed)[1] for name in pairs[0])
    reached = demand(pairs[0], needed)[1]
    assert 15 < reached["outer_size"] < 22
    assert 1e-3 < reached["resolution_z"] < 0.2


def test_choices_of_the_file_are_tried_the_other_way():
    """Not one that is as open as it can be, and none that another requirement contradicts."""
    strict = dataclasses.replace(NEEDED, outer_shape="square", process="sla", chips=3)
    tried = {trial.changed[0]: (trial.before, trial.needed) for trial in choices(strict)}
    assert set(tried) == {"outer_shape", "process", "screws", "magnets", "silicones", "hall_parts", "D"}
    assert tried["outer_shape"][1].outer_shape == "round"
    assert tried["hall_parts"][1].hall_parts == ()
    assert tried["D"][1].D_low is None
    assert "screws" not in {trial.changed[0] for trial in choices(NEEDED)}


# Failures that follow from goals.


MET = Goal("error", 0.5, 1.0, 3, "%")


@pytest.mark.parametrize(
    ("posed", "said"),
    [
        ([MET], ""),
        ([], "Nothing was measured"),
        ([MET, Goal("error", 1.5, 1.0, 3, "%")], "error: 1.5 %, goal at most 1 %"),
        ([Goal("error", math.nan, 1.0, 3)], "error: no data"),
        ([Goal("error", None, 1.0, 3)], "error: no data"),
        ([Goal("error", 0.0, 1.0, 0)], "error: no data"),
        ([Goal("share", 0.9, 0.95, 3, at_least=True)], "share: 0.9, goal at least 0.95"),
    ],
)
def test_a_goal_without_data_is_missed(posed, said):
    assert (" ".join(failures(posed)) == "") == (said == "")
    assert said in " ".join(failures(posed))


# Catalogues


OWN = """
[[grade]]
name = "N38"
remanence = [1.22, 1.26]
[[magnet]]
diameter = 4
height = 2
grades = ["N38", "N35"]
tolerance = 0.05
[[silicone]]
name = "Dragon Skin 30"
E = [0.7, 0.72, 0.74]
"""


def parts_of(**choices):
    return catalogues_of(Requirements(force_z=1.0, **choices))


def named(parts, name):
    (part,) = [part for part in parts if part.name == name]
    return part


@pytest.mark.parametrize(
    ("name", "psi"),
    [
        *(("Ecoflex 00-30", 10), ("Ecoflex 00-50", 12), ("Dragon Skin 10", 22)),
        *(("Dragon Skin 20", 49), ("Dragon Skin 30", 86), ("Smooth-Sil 950", 272)),
    ],
)
def test_moduli_follow_from_the_stress_at_100_percent(name, psi):
    """The E of a neo-Hookean solid with nominal stress s at a stretch of 2: s = E/3 (2 - 1/4)."""
    silicone = named(parts_of().silicones, name)
    s = psi * 6.894757e-3
    assert silicone.E_low <= 1.01 * s
    assert silicone.E_high == pytest.approx(3 * s / 1.75, rel=0.01)


@pytest.mark.parametrize(
    ("name", "tests"),
    [
        ("Ecoflex 00-30", (0.042, 0.048)),
        ("Ecoflex 00-50", (0.058, 0.067)),
        ("Dragon Skin 10", (0.123, 0.139)),
        ("Dragon Skin 20", (0.33, 0.34)),
        ("Dragon Skin 30", (0.528, 0.75)),
        ("RTV615", (0.96, 1.0)),
    ],
)
def test_ranges_hold_the_tensile_tests_that_are_published(name, tests):
    """Moduli by neo-Hooke's law below a strain of 25 % (of Dragon Skin 30 up to 100 % too), from the database."""
    silicone = named(parts_of().silicones, name)
    assert silicone.E_low <= min(tests) < max(tests) <= silicone.E_high
    assert pytest.approx((silicone.E_low * silicone.E_high) ** 0.5, rel=0.03) == silicone.E
    assert "database" in silicone.source


def law(tau, n):
    """Return tan(delta) of G0 (1 + (i w tau)^n) at 0.1, 1 and 20 Hz."""
    share = (2j * np.pi * np.array([0.1, 1.0, 20.0]) * tau) ** n
    return np.imag(share) / (1 + np.real(share))


def test_the_loss_factor_of_ecoflex_holds_the_laws_and_the_loops_that_are_published():
    """Delory et al. and Chantelot et al.; by 0.854 tan(delta) the hysteresis of Romano et al., 12.66 %."""
    silicone = named(parts_of().silicones, "Ecoflex 00-30")
    published = np.array([law(260e-6, 0.27), law(330e-6, 0.32)])
    assert silicone.loss_factor == pytest.approx(published[:, 1].mean(), rel=0.01)
    assert silicone.loss_factor_low == pytest.approx(published.min(), rel=0.01)
    assert published.max() < silicone.loss_factor_high == pytest.approx(0.1266 / 0.854, rel=0.01)
    assert silicone.hysteresis == pytest.approx(0.1266, rel=0.01)


def test_a_hysteresis_is_met_by_measured_loss_factors_only(toml):
    """A silicone of unknown loss factor is named and not tried; where none is left it is said without a search."""
    needed = Requirements(force_z=1.0, hysteresis=0.1, speed=1.0)
    parts = catalogues_of(needed)
    assert [part.name for part in parts.silicones] == ["Dragon Skin 30"]
    left = {part.name: part.refusal(needed) for part in parts.silicones_left_out}
    assert len(left) == 9
    assert "its loss factor is unknown" in left["Sylgard 184"]
    assert "its hysteresis is up to 12.6 % (tan(delta) = 0.148)" in left["Ecoflex 00-30"]
    strict = dataclasses.replace(needed, hysteresis=0.05)
    (said,) = impossible(strict, catalogues_of(strict))
    assert "the least known is 9.99 %, of Dragon Skin 30 (tan(delta) up to 0.117); unknown is the loss" in said
    only = dataclasses.replace(strict, silicones=("RTV615",))
    assert "hysteresis of 5 %: unknown is the loss factor of RTV615" in impossible(only, catalogues_of(only))[0]
    own = dataclasses.replace(only, silicones=("S",), catalogues=(toml(SILICONE + "loss_factor = 0.05"),))
    (silicone,) = catalogues_of(own).silicones
    assert (silicone.loss_factor_low, silicone.loss_factor_high, silicone.loss_source) == (
        0.05,
        0.05,
        "the user's file",
    )
    assert not impossible(own, catalogues_of(own))


def test_own_parts_are_added_and_replace(toml):
    parts = parts_of(catalogues=(toml(OWN),))
    assert named(parts.silicones, "Dragon Skin 30").E == 0.72
    assert named(parts.magnets, "4x2 N35").tolerance == 0.05
    assert named(parts.magnets, "4x2 N45").tolerance == 0.1
    assert named(parts.magnets, "4x2 N38").remanence == pytest.approx(1.24)


def test_an_unknown_part_is_refused(refused):
    with refused("silicones: the catalogues have no 'Dragon Skin 40'", "did you mean Dragon Skin"):
        parts_of(silicones=("Dragon Skin 40",))
    with refused("magnets: the catalogues have no 'huge'", "`magtip catalogue` lists all parts"):
        parts_of(magnets=("huge",))


def test_a_part_in_two_files_is_refused(refused, toml):
    with refused("b.toml: .*a.toml has a part 'Dragon Skin 30' too"):
        parts_of(catalogues=(toml(OWN, "a.toml"), toml(OWN.replace("= 4", "= 5"), "b.toml")))


@pytest.mark.parametrize("bound", ["D_high", "outer_size"])
def test_a_beam_in_which_no_magnet_fits_is_refused(refused, bound):
    with refused("no magnet in use fits into a beam of 4.1 mm: the smallest one, 4x2 N35, needs 4.2 mm"):
        parts_of(magnets=("5x2 N35", "4x2 N35"), **{bound: 4.1})
    assert parts_of(magnets=("4x2 N35",), **{bound: 4.2}).magnets


@pytest.fixture(scope="module")
def parts():
    return catalogues_of(Requirements(force_z=1.0))


def test_shipped_parts_make_designs(parts):
    for magnet in parts.magnets:
        D = 3 * max(magnet.diameter, magnet.height)
        assert Design(D=D, L=D, l0=D, **magnet.fields()).remanence == magnet.remanence
    for part in parts.hall_parts:
        assert Design(**part.fields()).hall_layout == part.layout
    for silicone in parts.silicones:
        assert Design(**silicone.fields()).E == silicone.E


def test_the_design_file_of_a_variant_holds_whatever_its_parts_are_called(parts, tmp_path):
    """A name ends no comment and no string."""
    evil = 'x"\nevil = 1 # `*| \\\\'
    magnet, part, silicone = (
        dataclasses.replace(kind[0], name=evil) for kind in (parts.magnets, parts.hall_parts, parts.silicones)
    )
    design = Design(D=9.0, L=11.0, l0=9.0, **magnet.fields(), **part.fields(), **silicone.fields())
    sizing_export.write_design(Variant(design, magnet, part, silicone), Requirements(force_z=1.0), tmp_path)
    read = read_design(str(tmp_path / sizing_export.DESIGN))
    assert (read.silicone, read.D) == (design.silicone, 9.0)


GRADE = '[[grade]]\nname = "N38"\nremanence = ["1220 mT", 1.26]\n'
MAGNET = '[[magnet]]\ndiameter = 7\nheight = "2 mm"\ngrades = ["N38"]\n'
HALL = '[[hall_part]]\nname = "H"\ngain = "10 mV/mT"\n'
SILICONE = '[[silicone]]\nname = "S"\nE = ["700 kPa", 0.8, 1]\n'


def test_a_file_with_all_kinds(toml):
    file = read_catalogue(toml(GRADE + MAGNET + HALL + SILICONE))
    assert file["grades"]["N38"].remanence == (1.22, 1.26)
    assert (file["magnets"]["7x2"].diameter, file["magnets"]["7x2"].height) == (7.0, 2.0)
    assert file["hall_parts"]["H"].gain == 10.0
    silicone = file["silicones"]["S"]
    assert (silicone.E_low, silicone.E, silicone.E_high) == (0.7, 0.8, 1.0)


CHIP = """[[hall_part]]
name = "C"
layout = "chip"
range = "50 mT"
step = "2 uT"
noise = "5 uT"
rate = "1 kHz"
offset = "0.2 mT"
body = [2.0, 2.5, 0.8]
plate_height = 0.3
"""


def test_a_chip_of_any_kind_makes_a_design(toml):
    part = read_catalogue(toml(CHIP))["hall_parts"]["C"]
    assert (part.rate, part.null_tolerance) == (1000.0, 2e-4)
    design = Design(l0=9.0, **part.fields())
    element = of_design(design)[0]
    assert (element.high, element.step, element.noise, element.unit) == (0.05, 2e-6, 5e-6, "T")
    (pocket,) = plan(design, Base()).seats.bodies.values()
    assert pocket.sides[:2] > (2.0, 2.5)


def test_the_range_of_a_chip_is_that_of_its_sketch():
    """The library takes 0x4000 off counts of 1.202 uT (x, y) as the sketch sets it, and counts are not negative."""
    sketch = (Path(decoder_export.__file__).parent / "sketch.ino.j2").read_text("utf-8")
    assert "MLX90393_GAIN_1X" in sketch
    assert sketch.count("MLX90393_RES_19") == 3
    assert CHIPS["mlx90393"].range == pytest.approx(0x4000 * 1.202e-6, abs=5e-5)


def test_a_chip_of_unknown_noise_is_listed_and_sizes_no_sensor(toml, refused):
    assert {"MLX90393", "MMC5983MA"} <= {part.name for part in parts_of().left_out}
    with refused("no sensor can be sized with MLX90393: its noise is unknown: state it"):
        parts_of(hall_parts=("MLX90393",))
    with refused("no sensor can be sized with MMC5983MA: it measures the ambient field"):
        parts_of(hall_parts=("MMC5983MA",))
    assert Design(hall_layout="mlx90393").value_warnings()[0].startswith("the noise of MLX90393 is unknown")
    own = toml('[[hall_part]]\nname = "MLX90393"\nlayout = "mlx90393"\nnoise = "3 uT"')
    (part,) = parts_of(hall_parts=("MLX90393",), catalogues=(own,)).hall_parts
    assert of_design(Design(**part.fields()))[0].noise == 3e-6


def test_a_bandwidth_leaves_fewer_values_and_no_slow_part(refused):
    """400 values a second are 200 readings of two at 100 Hz, and none at 201 Hz."""

    def noise(bandwidth, samples=8, part="TMAG5170A1"):
        needed = Requirements(force_z=5.0, bandwidth=bandwidth, samples=samples, hall_parts=(part,))
        (found,) = catalogues_of(needed).hall_parts
        fields = part_fields(found, needed)
        element = of_design(Design(l0=9.0, **fields))[0]
        assert found.largest_bandwidth(needed, element.average) >= bandwidth
        return element.noise_T, element.average

    whole, count = noise(25.0)
    assert count == 8
    assert noise(100.0)[1] == 2
    assert noise(100.0)[0] == pytest.approx(2 * whole, rel=0.01)
    assert noise(200.0)[1] == 1
    with refused("no sensor can be sized with TMAG5170A1: it has 400 values a second, and", "201 Hz needs 402"):
        noise(201.0)
    # of an analogue part the white noise of a reading is that of its bandwidth, however many values make it
    one, many = noise(100.0, 1, "DRV5055A2")[0], noise(100.0, 64, "DRV5055A2")[0]
    white = 130e-9 * (np.pi / 2 * 100.0) ** 0.5
    assert white < many < one
    # 20 kHz of the part are 40 of the values of 500 Hz
    assert noise(500.0, 64, "DRV5055A2")[1] == 40


def test_parts_of_unknown_rate_and_slow_ones_are_named(toml, refused):
    needed = Requirements(force_z=5.0, bandwidth=200.0)
    left = {part.name: part.refusal(needed) for part in catalogues_of(needed).left_out}
    assert "ALS31300-500" in left
    assert "TMAG5170A1" not in left
    own = toml(CHIP.replace('rate = "1 kHz"\n', ""))
    assert parts_of(hall_parts=("C",), catalogues=(own,)).hall_parts[0].rate is None
    with refused("no sensor can be sized with C: its rate is unknown, so that nothing says that it reads 200 Hz"):
        catalogues_of(Requirements(force_z=5.0, bandwidth=200.0, hall_parts=("C",), catalogues=(own,)))
    with refused("no sensor can be sized with any Hall part of the catalogues, such as", "values a second, and"):
        catalogues_of(Requirements(force_z=5.0, bandwidth=1e5))


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["sensor.toml: the catalogue is empty: add a table"]),
        ("[magnet]\ndiameter = 4", [r"magnet must be an array of tables: write \[\[magnet\]\]"]),
        ("[[magnets]]\ndiameter = 4", ["there is no key 'magnets'", "did you mean magnet"]),
        (
            '[[magnet]]\ndiamter = 4\nname = "M"',
            ["sensor.toml: M: there is no key 'diamter'", "did you mean diameter"],
        ),
        ("[[magnet]]\ndiameter = 4", [r"\[\[magnet\]\] number 1: height is missing"]),
        (MAGNET.replace("7", '"7 N"'), ["diameter: 'N' is no unit for it"]),
        (MAGNET + "edge_radius = 1.5", ["edge_radius must not exceed half the magnet's smaller side = 1 mm"]),
        (MAGNET.replace('["N38"]', '"N38"'), ["grades must be a list of names; got 'N38'"]),
        (MAGNET + MAGNET, [r"two tables \[\[magnet\]\] have the name '7x2'"]),
        (SILICONE.replace("0.8", "0.6"), ["S: E must be", "none above the next; got 0.7, 0.6, 1"]),
        (SILICONE.replace('["700 kPa", 0.8, 1]', "0.8"), [r"E must be \[low, typical, high\]; got 0.8"]),
        (SILICONE + "loss_factor = [0.1, 0.2]", [r"loss_factor must be \[low, typical, high\]"]),
        (SILICONE + "nu = [0.4, 0.5, 0.6]", ["nu must lie between 0.3 and 0.5; got 0.6"]),
        ('[[hall_part]]\nname = "H"', ["H: gain is missing"]),
        (HALL + "low = 3", ["null must lie between low = 3 V and high = 4.8 V; got 2.5 V"]),
        (HALL + 'layout = "tmag5273"', ["there is no layout 'tmag5273'", "did you mean tmag5273a"]),
        (SILICONE + 'assumed = ["nue"]', ["sensor.toml: S: assumed: there is no key 'nue': did you mean nu"]),
        (SILICONE + 'source = "a\\u0007b"', ["S: source must be text that can be printed"]),
        (HALL + "gain_tolerance = 5", ["H: gain_tolerance must lie between 0 and 1; got 5: write 40 % as 0.4"]),
        (CHIP.replace("0.3", "1"), ["plate_height must not exceed the body's height = 0.8 mm; got 1 mm"]),
    ],
)
def test_refusal_of_catalogues(text, parts, toml, refused):
    with refused(*parts):
        read_catalogue(toml(text))


# The verb catalogue: tables, JSON, parts of the user.


def test_one_kind(run, strict):
    status, out, _ = run("catalogue", "silicones", "--json")
    rows = strict(out)
    assert status == 0
    assert {row["kind"] for row in rows} == {"silicones"}
    assert ("Dragon Skin 30", 0.528, 1.02) in [(row["name"], row["E_low_MPa"], row["E_high_MPa"]) for row in rows]
    assert all(row["source"] for row in rows)


def test_published_sensors(run, strict):
    status, out, _ = run("catalogue", "published", "--json")
    assert status == 0
    assert {row["sensor"] for row in strict(out)} == {
        "Chathuranga 2016",
        "MagOne",
        "Dwivedi 2018",
        "Tomo 2016",
        "eFlesh 2025",
    }


# Published sensors


SENSORS = {sensor["name"]: sensor for sensor in published_sensors()}


@pytest.mark.parametrize("name", SENSORS)
def test_requirements_have_the_same_box(name):
    sensor = SENSORS[name]
    requirements = read_requirements(str(sensor["requirements"]))
    for each in sensor["figures"]:
        if each["quantity"].startswith("resolution") and name != "Chathuranga 2016":
            continue  # a result of the sizing, not a bound
        assert getattr(requirements, each["quantity"].replace("range", "force")) == pytest.approx(each["value"])
    assert catalogues_of(requirements).magnets


def test_every_file_of_requirements_is_valid():
    folder = SENSORS["MagOne"]["requirements"].parent
    files = sorted(file for file in folder.glob("*.toml") if "force_z" in file.read_text("utf-8"))
    assert len(files) == 18
    for file in files:
        requirements = read_requirements(str(file))
        # two of them leave the bandwidth to the Hall parts
        assert not requirements.warnings() or file.stem in ("finger", "foot")
        assert catalogues_of(requirements).hall_parts


def written(folder, front):
    (folder / "magone").mkdir(parents=True)
    (folder / "magone" / "sizing.json").write_text(json.dumps({"front": front}), "utf-8")
    return folder


ROW = {
    "status": "ok",
    "fem_range_z_N": 12.0,
    "fem_range_x_N": 2.0,
    "fem_resolution_z_mN": 3.0,
    "fem_resolution_x_mN": None,
    "outer_size_mm": 14.9,
    "height_mm": 13.0,
}


def test_results_are_read(tmp_path):
    reached = reached_in(written(tmp_path, [{"status": "failed"}, ROW]))["MagOne"]
    assert reached == {"range_z": 12.0, "range_x": 2.0, "resolution_z": 0.003, "outer_size": 14.9, "height": 13.0}


@pytest.mark.parametrize("front", [[], [{"status": "failed"}]])
def test_a_box_without_a_variant_is_left_out(tmp_path, refused, front):
    with refused("holds no result of magtip size in a folder named paper_sensor, magone"):
        reached_in(written(tmp_path, front))
