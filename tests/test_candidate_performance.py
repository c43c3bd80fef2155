"""What variants reach: known dependences on E, remanence, noise and forces, and the margins of the requirements."""

import dataclasses

import numpy as np
import pytest

from studies.sizing.candidate_performance import LEAST, performance
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
    D=10.0, slenderness=1.1, magnet="4x4 N45", silicone="Mold Star 30", part="DRV5055A2", places=(0.1, 0.1, 0.3)
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
            assert value == pytest.approx(alone.one(0)[name], rel=1e-9, nan_ok=True), name


def test_margins_are_relative_to_the_bounds():
    result = reached(made())
    assert result.margins["resolution_z"][0] == pytest.approx(1 - result.resolution_z[0] / 0.05)
    assert result.margins["outer_size"][0] == pytest.approx(1 - result.outer_size[0] / 25)
    assert result.margins["largest_strain"][0] == pytest.approx(1 - result.strain[0])


def test_half_widths_worsen_every_bound_that_mechanics_decide():
    nominal, worse = (reached(made(), caution=caution) for caution in (0.0, 1.0))
    for name in ("resolution_z", "resolution_x", "strain", "depth"):
        assert getattr(worse, name)[0] > getattr(nominal, name)[0], name
    for name in ("range_z", "saturation", "first_mode"):
        assert getattr(worse, name)[0] < getattr(nominal, name)[0], name


FINGERTIP = dataclasses.replace(NEEDED, force_x=2.0)


def fingertip():
    """A wide magnet in a short soft beam: its sideways force under a light press ends where the surrogate ends."""
    part, magnet, silicone = (
        index("hall_parts", "TLE493D-P2B6"),
        index("magnets", "6x3 N52"),
        index("silicones", "Mold Star 30"),
    )
    return variant((8.4, 8.8 / 8.4, magnet, silicone, part, 0.1, 0.1, 0.3), FINGERTIP, PARTS)


def test_sideways_range_is_the_least_under_all_required_presses():
    one = fingertip()
    result = reached(one, FINGERTIP, caution=0.0)
    beams, unit = beams_of([one]), one.silicone.E_low * one.design.D**2
    grid = np.linspace(0.01, beams.deepest[0], 4000)[None]
    light = grid[0, np.searchsorted(beams.press(grid)["force"].value[0] * unit, 0.25 * 5.0)]
    ends = beams.shear(np.array([[light]]), beams.farthest[:, None])["force_x"].value[0, 0] * unit
    assert result.range_x[0] == pytest.approx(ends, rel=0.01)
    assert result.range_x[0] < 1.9
    assert result.margins["force_x"][0] == pytest.approx(result.range_x[0] / 2 - 1)
    # a lighter requirement is reached in all poses, and not followed further
    assert reached(one, dataclasses.replace(FINGERTIP, force_x=1.0)).range_x[0] == 1.0


class Changed:
    """Beams whose answers are changed."""

    def __init__(self, beams, **changes):
        self.beams, self.changes = beams, changes

    def __getattr__(self, name):
        return self.changes.get(name, getattr(self.beams, name))


def test_an_unknown_sideways_force_is_not_reached():
    def shear(depth, amount):
        answer = beams.shear(depth, amount)
        answer["force_x"].value[depth <= depth.min()] = np.nan
        return answer

    beams = beams_of([made()])
    known = performance([made()], beams, NEEDED)
    unknown = performance([made()], Changed(beams, shear=shear), NEEDED, estimate=known)
    assert known.margins["force_x"][0] == 0.0
    assert np.isnan(unknown.range_x[0])
    assert unknown.margins["force_x"][0] == LEAST


def test_unknown_stability_is_not_met():
    beams = beams_of([made()])
    for unknown in (lambda caution: np.array([np.nan]), lambda caution: np.array([0.05])):
        result = performance([made()], Changed(beams, stable_to=unknown), NEEDED)
        assert np.isinf(result.critical[0])
        assert result.margins["stability_margin"][0] < 0
        assert result.range_z[0] < performance([made()], beams, NEEDED).range_z[0]


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
    values = (10.0, 1.1, index("magnets", "4x4 N45"), index("silicones", "Mold Star 30"))
    possible = (*values, index("hall_parts", "DRV5055A2"), 0.1, 0.1, 0.3)
    # a magnet of 10 mm in a beam of 5 mm
    impossible = (5.0, 1.1, index("magnets", "10x5 N42"), *possible[3:])
    F, G = group.evaluate(np.array([possible, impossible]))
    margins = np.array([value[0] for value in reached(made()).margins.values()])
    assert G[0, 0] == pytest.approx(np.log1p(np.maximum(-margins, 0)).sum())
    assert G[1, 0] > 100 > G[0, 0]
    assert F[0, 0] == pytest.approx(-np.log(reached(made()).range_z[0]))
