"""The parts in use: shipped, the user's, and those that the requirements name."""

import pytest

from studies.sizing.catalogues import catalogues_of, rows
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


def test_sources_disagree_on_dragon_skin_30():
    silicone = named(parts_of().silicones, "Dragon Skin 30")
    assert (silicone.E_low, silicone.E_high) == (0.55, 1.02)


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


def test_parts_are_those_that_are_named():
    parts = parts_of(magnets=("4x2 N45", "3x3 N35"), hall_parts=("SS495A",))
    assert [magnet.name for magnet in parts.magnets] == ["4x2 N45", "3x3 N35"]
    assert [part.name for part in parts.hall_parts] == ["SS495A"]


def test_rows_name_units():
    row = rows(parts_of(magnets=("4x2 N35",)).magnets)[0]
    assert (row["diameter_mm"], row["remanence_low_T"], row["largest_temperature_C"]) == (4.0, 1.17, 80.0)
    assert row["assumed"] == "edge_radius, grades"


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
