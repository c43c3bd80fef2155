"""Catalogues as files: what is read, and one sentence for everything else."""

import pytest

from studies.sizing.catalogue_files import read_catalogue

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
    assert read_catalogue(toml(text)).silicones["S"].assumed == ("density", "cure_temperature", "cure_hours", "mixed")


def test_a_chip_has_the_values_of_its_data_sheet(toml):
    part = read_catalogue(toml('[[hall_part]]\nname = "C"\nlayout = "tmag5273a1"')).hall_parts["C"]
    assert (part.low, part.high, part.noise, part.noise_density) == (-0.08, 0.08, 1e-4, None)


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
        (HALL + 'layout = "tmag5273"', ["there is no layout 'tmag5273'", "did you mean tmag5273a1"]),
        (HALL + "body = [1, 2]", [r"body must be \[width, height, thickness\]"]),
    ],
)
def test_refusal(text, parts, toml, refused):
    with refused(*parts):
        read_catalogue(toml(text))
