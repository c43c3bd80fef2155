"""Entries of catalogues: fields of designs, and the noise of a Hall part."""

import math

import pytest

from analytic.parts import of_design
from geometry.design import Design
from studies.sizing.catalogues import catalogues_of
from studies.sizing.requirements import Requirements


@pytest.fixture(scope="module")
def parts():
    return catalogues_of(Requirements(force_z=1.0))


def named(parts, name):
    (part,) = [part for part in parts if part.name == name]
    return part


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
