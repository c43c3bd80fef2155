"""Catalogues: their files, the shipped parts with their sources, and the parts in use."""

import math

import pytest

from analytic.parts import of_design
from geometry.base import Base, plan
from geometry.design import Design
from studies.sizing.catalogues import catalogues_of, read_catalogue
from studies.sizing.requirements import CATALOGUES, Requirements

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


def test_shipped_names_are_unique():
    for kind in CATALOGUES:
        names = [part.name for part in getattr(parts_of(), kind)]
        assert len(names) == len(set(names)) > 9


def test_shipped_ranges_are_plausible():
    parts = parts_of()
    assert all(1.0 < magnet.remanence_low < magnet.remanence_high < 1.5 for magnet in parts.magnets)
    assert all(part.low < part.null < part.high for part in parts.hall_parts)
    assert all(0.04 < silicone.E_low < silicone.E < silicone.E_high < 4 for silicone in parts.silicones)
    assert all(silicone.nu_low < silicone.nu < silicone.nu_high <= 0.5 for silicone in parts.silicones)


@pytest.mark.parametrize(
    ("name", "psi"), [("Ecoflex 00-50", 12), ("Dragon Skin 10", 22), ("Dragon Skin 20", 49), ("Smooth-Sil 950", 272)]
)
def test_moduli_follow_from_the_stress_at_100_percent(name, psi):
    """The E of a neo-Hookean solid with nominal stress s at a stretch of 2: s = E/3 (2 - 1/4)."""
    silicone = named(parts_of().silicones, name)
    s = psi * 6.894757e-3
    assert silicone.E_low == pytest.approx(s, rel=0.01)
    assert silicone.E_high == pytest.approx(3 * s / 1.75, rel=0.01)


def test_each_part_has_a_source():
    assert all(part.source for kind in CATALOGUES for part in getattr(parts_of(), kind))


def test_own_parts_are_added_and_replace(toml):
    parts = parts_of(catalogues=(toml(OWN),))
    assert named(parts.silicones, "Dragon Skin 30").E == 0.72
    assert named(parts.magnets, "4x2 N35").tolerance == 0.05
    assert named(parts.magnets, "4x2 N45").tolerance == 0.1
    assert named(parts.magnets, "4x2 N38").remanence == pytest.approx(1.24)


def test_shipped_parts_can_be_left_out(toml):
    parts = parts_of(catalogues=(toml(OWN),), shipped=("hall_parts",))
    assert [magnet.name for magnet in parts.magnets] == ["4x2 N38", "4x2 N35"]
    assert [silicone.name for silicone in parts.silicones] == ["Dragon Skin 30"]


def test_an_unknown_part_is_refused(refused):
    with refused("silicones: the catalogues have no 'Dragon Skin 40'", "did you mean Dragon Skin"):
        parts_of(silicones=("Dragon Skin 40",))
    with refused("magnets: the catalogues have no 'huge'", "`magtip catalogue` lists all parts"):
        parts_of(magnets=("huge",))


def test_an_empty_kind_is_refused(refused, toml):
    with refused("the catalogue of hall_parts is empty: add hall_parts to `shipped`"):
        parts_of(shipped=("magnets", "silicones"))


def test_an_unknown_grade_is_refused(refused, toml):
    with refused("sensor.toml: 4x2: there is no grade 'N99'", "choose one of N35"):
        parts_of(catalogues=(toml('[[magnet]]\ndiameter = 4\nheight = 2\ngrades = ["N99"]'),))


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


def test_the_papers_hall_part_has_the_values_of_the_preset(parts):
    assert Design(**named(parts.hall_parts, "SS495A").fields()) == Design()


def reading_noise(part, **choices):
    """Standard deviation of a reading of a design with this part, T."""
    return of_design(Design(**part.fields(), **part.noise_fields(**choices)))[0].noise_T


def test_noise_grows_with_the_root_of_the_bandwidth(parts):
    part = named(parts.hall_parts, "DRV5055A2")
    assert reading_noise(part, bandwidth=400) == pytest.approx(2 * reading_noise(part, bandwidth=100))
    assert reading_noise(part, bandwidth=100) == pytest.approx(130e-9 * math.sqrt(100 * math.pi / 2))
    assert reading_noise(part, bandwidth=1e6) == reading_noise(part)


def test_noise_of_a_chip_is_that_of_its_layout(parts):
    part = named(parts.hall_parts, "TMAG5273A1")
    assert part.noise_fields(100) == {}
    assert reading_noise(part) == pytest.approx(math.hypot(part.noise, part.step / math.sqrt(12)))


GRADE = '[[grade]]\nname = "N38"\nremanence = ["1220 mT", 1.26]\n'
MAGNET = '[[magnet]]\ndiameter = 7\nheight = "2 mm"\ngrades = ["N38"]\n'
HALL = '[[hall_part]]\nname = "H"\ngain = "10 mV/mT"\n'
SILICONE = '[[silicone]]\nname = "S"\nE = ["700 kPa", 0.8, 1]\n'


def test_a_file_with_all_kinds(toml):
    file = read_catalogue(toml(GRADE + MAGNET + HALL + SILICONE))
    assert file.grades["N38"]["remanence"] == (1.22, 1.26)
    assert (file.magnets["7x2"]["diameter"], file.magnets["7x2"]["height"]) == (7.0, 2.0)
    assert file.hall_parts["H"].gain == 10.0
    assert (file.silicones["S"].E_low, file.silicones["S"].E, file.silicones["S"].E_high) == (0.7, 0.8, 1.0)


def test_what_is_left_out_counts_as_assumed(toml):
    text = SILICONE + "nu = [0.48, 0.49, 0.499]\ndensity = 1100\nassumed = ['density']\n"
    assert read_catalogue(toml(text)).silicones["S"].assumed == (
        *("density", "loss_factor", "cure_temperature", "cure_hours", "mixed"),
    )


def test_a_chip_has_the_values_of_its_data_sheet(toml):
    part = read_catalogue(toml('[[hall_part]]\nname = "C"\nlayout = "tmag5273a1"')).hall_parts["C"]
    assert (part.low, part.high, part.noise, part.noise_density) == (-0.08, 0.08, 1e-4, None)


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
    part = read_catalogue(toml(CHIP)).hall_parts["C"]
    assert (part.rate, part.null_tolerance) == (1000.0, 2e-4)
    design = Design(l0=9.0, **part.fields())
    element = of_design(design)[0]
    assert (element.high, element.step, element.noise, element.unit) == (0.05, 2e-6, 5e-6, "T")
    (pocket,) = plan(design, Base()).seats.bodies.values()
    assert pocket.sides[:2] > (2.0, 2.5)


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


def test_eight_chips_and_eight_one_axis_parts_are_shipped():
    parts = (*parts_of().hall_parts, *parts_of().left_out)
    assert sum(part.layout == "three" for part in parts) >= 8
    assert sum(part.layout != "three" for part in parts) >= 8
    assert all(part.thickness > 0 for part in parts)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["sensor.toml: the catalogue is empty: add a table"]),
        ("magnet = []", ["the catalogue is empty"]),
        ("[magnet]\ndiameter = 4", [r"magnet must be an array of tables: write \[\[magnet\]\]"]),
        ("[[magnets]]\ndiameter = 4", ["there is no key 'magnets'", "did you mean magnet"]),
        (
            '[[magnet]]\ndiamter = 4\nname = "M"',
            ["sensor.toml: M: there is no key 'diamter'", "did you mean diameter"],
        ),
        ("[[magnet]]\ndiameter = 4", [r"\[\[magnet\]\] number 1: height is missing"]),
        (MAGNET.replace("7", '"7 N"'), ["diameter: 'N' is no unit for it"]),
        (MAGNET.replace("7", "0"), ["diameter must lie between 0.1 and 200 mm; got 0 mm"]),
        (MAGNET + "edge_radius = 1.5", ["edge_radius must not exceed half the magnet's smaller side = 1 mm"]),
        (MAGNET.replace('["N38"]', "[]"), ["grades is empty"]),
        (MAGNET.replace('["N38"]', '"N38"'), ["grades must be a list of names; got 'N38'"]),
        (MAGNET + MAGNET, [r"two tables \[\[magnet\]\] have the name '7x2'"]),
        (SILICONE + SILICONE, [r"two tables \[\[silicone\]\] have the name 'S'"]),
        (GRADE.replace("1.26", "1.2"), ["N38: remanence must be", "none above the next; got 1.22, 1.2"]),
        (SILICONE.replace("0.8", "0.6"), ["S: E must be", "none above the next; got 0.7, 0.6, 1"]),
        (SILICONE.replace('["700 kPa", 0.8, 1]', "0.8"), [r"E must be \[low, typical, high\]; got 0.8"]),
        (SILICONE + "nu = [0.4, 0.5, 0.6]", ["nu must lie between 0.3 and 0.5; got 0.6"]),
        (SILICONE + "source = 3", ["source must be a text; got 3"]),
        (SILICONE + 'assumed = ["nue"]', ["assumed: there is no key 'nue'", "did you mean nu"]),
        ('[[hall_part]]\nname = "H"', ["H: gain is missing"]),
        (HALL + "low = 3", ["null must lie between low = 3 V and high = 4.8 V; got 2.5 V"]),
        (HALL + 'layout = "tmag5273"', ["there is no layout 'tmag5273'", "did you mean tmag5273a"]),
        (CHIP.replace("range", "# range"), ["C: range is missing"]),
        (CHIP.replace("0.3", "1"), ["plate_height must not exceed the body's height = 0.8 mm; got 1 mm"]),
        (HALL + "body = [1, 2]", [r"body must be \[width, height, thickness\]"]),
    ],
)
def test_refusal(text, parts, toml, refused):
    with refused(*parts):
        read_catalogue(toml(text))


# The verb catalogue: tables, JSON, parts of the user.


def test_one_kind(run, strict):
    status, out, _ = run("catalogue", "silicones", "--json")
    rows = strict(out)
    assert status == 0
    assert {row["kind"] for row in rows} == {"silicones"}
    assert ("Dragon Skin 30", 0.55, 1.02) in [(row["name"], row["E_low_MPa"], row["E_high_MPa"]) for row in rows]
    assert all(row["source"] for row in rows)


def test_all_kinds_are_tables(run):
    status, out, _ = run("catalogue")
    assert status == 0
    assert [out.index(title) for title in ("Magnets: ", "Hall parts: ", "Silicones: ")] == sorted(
        out.index(title) for title in ("Magnets: ", "Hall parts: ", "Silicones: ")
    )
    assert "4x2 N35" in out


def test_a_bad_file_is_refused(run, toml):
    status, out, err = run("catalogue", "--file", toml("[[silicone]]"))
    assert (status, out) == (2, "")
    assert err.endswith("[[silicone]] number 1: name is missing\n")


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


def test_results_go_with_published_sensors_only(run):
    status, _, err = run("catalogue", "magnets", "--sized", "out")
    assert (status, err.count("\n")) == (2, 1)
    assert "--sized goes with published sensors" in err
