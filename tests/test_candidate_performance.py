"""What variants reach: known dependences on E, remanence, noise and forces, and the margins of the requirements."""

import dataclasses

import numpy as np
import pytest

from studies.sizing.candidate_performance import performance
from studies.sizing.candidate_variables import variables, variant
from studies.sizing.catalogues import catalogues_of
from studies.sizing.requirements import Requirements
from studies.sizing.variant_search import Candidates, beams_of

NEEDED = Requirements(
    force_z=5.0,
    force_x=1.5,
    resolution_z=0.05,
    resolution_x=0.05,
    largest_strain=1.0,
    first_mode=50.0,
    outer_size=25.0,
)
PARTS = catalogues_of(NEEDED)


def index(kind, name):
    return [part.name for part in getattr(PARTS, kind)].index(name)


def made(
    D=10.0, slenderness=1.1, magnet="4x4 N45", silicone="Smooth-Sil 940", part="DRV5055A2", places=(0.1, 0.1, 0.3)
):
    values = (D, slenderness, index("magnets", magnet), index("silicones", silicone), index("hall_parts", part))
    return variant((*values, *places), NEEDED, PARTS)


def reached(one, needed=NEEDED, **options):
    return performance([one], beams_of([one]), needed, **options)


def test_lengths_are_rounded_for_printing():
    design = made(D=10.04, slenderness=1.111).design
    lengths = np.array([design.D, design.L, design.f, design.l0, design.c])
    assert lengths * 10 == pytest.approx(np.round(lengths * 10), abs=1e-9)


def test_each_variable_has_its_place():
    names = [each.name for each in variables(NEEDED, PARTS)]
    assert names == ["D", "slenderness", "magnet", "silicone", "hall_part", "below", "aside", "level"]


def test_impossible_design_has_a_reason():
    assert "silicone around" in made(D=4.0, magnet="4x4 N45")


def test_similar_forces_give_similar_poses():
    """Twice the modulus under twice the force is the same deformation."""
    one = made()
    stiff = dataclasses.replace(
        one,
        silicone=dataclasses.replace(one.silicone, E_low=2 * one.silicone.E_low, E_high=2 * one.silicone.E_high),
        design=dataclasses.replace(one.design, E=2 * one.design.E),
    )
    double = dataclasses.replace(NEEDED, force_z=10.0, force_x=3.0)
    a, b = reached(one), reached(stiff, double)
    assert b.depth == pytest.approx(a.depth)
    assert b.strain == pytest.approx(a.strain)
    assert b.saturation == pytest.approx(a.saturation)
    assert b.resolution_z == pytest.approx(2 * a.resolution_z)
    assert b.first_mode == pytest.approx(np.sqrt(2) * a.first_mode)


def test_bounds_are_held_at_the_worse_end_of_the_modulus():
    one, silicone = made(), made().silicone
    narrow = dataclasses.replace(one, silicone=dataclasses.replace(silicone, E_low=silicone.E, E_high=silicone.E))
    wide, middle = reached(one), reached(narrow)
    assert wide.strain[0] > middle.strain[0]
    assert wide.first_mode[0] < middle.first_mode[0]
    assert wide.resolution_z[0] > middle.resolution_z[0]
    assert wide.saturation[0] < middle.saturation[0]


def test_resolution_is_proportional_to_the_noise():
    one = made()
    quiet = dataclasses.replace(one, design=dataclasses.replace(one.design, hall_step=0.0))
    loud = dataclasses.replace(
        quiet,
        design=dataclasses.replace(
            quiet.design,
            hall_noise=3 * quiet.design.hall_noise,
            hall_noise_density=3 * quiet.design.hall_noise_density,
        ),
    )
    assert reached(loud).resolution_z == pytest.approx(3 * reached(quiet).resolution_z)
    assert reached(loud).distinct == pytest.approx(reached(quiet).distinct / 3)


def test_scales_are_shares_of_the_ranges():
    one = made()
    half = dataclasses.replace(NEEDED, force_z=2.5, force_x=0.75)
    scaled = reached(one, scales=np.array([[0.5, 0.5]]))
    assert scaled.depth == pytest.approx(reached(one, half).depth)
    assert scaled.resolution_x == pytest.approx(reached(one, half).resolution_x)


def test_variants_do_not_depend_on_their_neighbours():
    chosen = [made(), made(D=12.0), made(part="TMAG5273A1"), made(magnet="5x2 N45")]
    together = performance(chosen, beams_of(chosen), NEEDED)
    for k, one in enumerate(chosen):
        alone = reached(one)
        for name, value in together.one(k).items():
            assert value == pytest.approx(alone.one(0)[name], rel=1e-9), name


def test_margins_are_relative_to_the_bounds():
    result = reached(made())
    assert result.margins["resolution_z"][0] == pytest.approx(1 - result.resolution_z[0] / 0.05)
    assert result.margins["outer_size"][0] == pytest.approx(1 - result.outer_size[0] / 25)
    worse = result.strain[0] + result.strain_half_width[0]
    assert result.margins["largest_strain"][0] == pytest.approx(1 - worse)


def test_unset_requirements_have_no_margin():
    free = Requirements(force_z=5.0, no_saturation=False, unique_decoding=False)
    assert set(reached(made(), free).margins) == {"force_z", "stability_margin", "wall", "clearance"}


def test_strong_field_saturates():
    near = made(magnet="6x6 N52", D=10.0, slenderness=1.2, part="DRV5055A1", places=(0.0, 0.0, 0.3))
    result = reached(near)
    assert result.margins["no_saturation"][0] < 0
    assert result.range_z[0] == 0


def test_range_ends_where_the_strain_reaches_its_bound():
    one = made()
    free = Requirements(force_z=5.0, largest_strain=0.3, no_saturation=False)
    end = reached(one, free, caution=0.0)
    # the press force at the end of the range as the required range: its strain is the bound
    there = reached(one, dataclasses.replace(free, force_z=float(end.range_z[0])), caution=0.0)
    assert 0 < end.range_z[0] < 14.9
    assert there.strain == pytest.approx(0.3, rel=2e-3)


def test_element_at_the_magnets_height_folds():
    """Where the magnet gets level with S2 and S3 their readings have a maximum, and det J changes its sign."""
    high, low = (made(silicone="Dragon Skin 30", places=(0.1, 0.1, level)) for level in (0.8, -0.3))
    assert reached(high).decoding[0] < 0 < reached(low).decoding[0]


def test_evaluation_of_the_search():
    group = Candidates(NEEDED, PARTS)
    values = (10.0, 1.1, index("magnets", "4x4 N45"), index("silicones", "Smooth-Sil 940"))
    possible = (*values, index("hall_parts", "DRV5055A2"), 0.1, 0.1, 0.3)
    # a magnet of 10 mm in a beam of 5 mm
    impossible = (5.0, 1.1, index("magnets", "10x5 N42"), *possible[3:])
    F, G = group.evaluate(np.array([possible, impossible]))
    margins = np.array([value[0] for value in reached(made()).margins.values()])
    assert G[0, 0] == pytest.approx(np.log1p(np.maximum(-margins, 0)).sum())
    assert G[1, 0] > 100 > G[0, 0]
    assert F[0, 0] == pytest.approx(-np.log(reached(made()).range_z[0]))
