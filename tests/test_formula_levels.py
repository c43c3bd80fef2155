"""The levels above the paper's: limit cases, scaling, critical load, and the finite elements beside them."""

import math
from dataclasses import replace

import pandas as pd
import pytest

from analytic import beam, buckling, press_terms, shear_terms
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.validation import error_study_cases, ladder

approx = pytest.approx
HIGHER = beam.LEVELS[1:]
SILICONE = replace(paper(), magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)


def stick(depth, x, y=0.0):
    return Load(depth, x, y, "stick")


def slender(ratio):
    return replace(SILICONE, L=ratio * 8, l0=ratio * 8)


@pytest.mark.parametrize("level", HIGHER)
def test_small_presses_are_hertz(level):
    """The next term is relative to it as sqrt(d)."""
    off = []
    for depth in (1e-8, 1e-10):
        hertz = 4 / 3 * press_terms.effective_modulus(paper()) * 2 * depth**1.5
        off.append(beam.solve(paper(), Load(depth), level).force[2] / hertz - 1)
    assert abs(off[1]) < 1e-5
    assert off[0] / off[1] == approx(10, rel=0.01)


def test_first_term_of_the_dome_is_tatara():
    """It takes 0.75 F/(pi E R) from Hertz's depth, and Dimitriadis' coefficient of x is 1.335 times that."""
    design, force = SILICONE, 1e-7
    E_star = press_terms.effective_modulus(design)
    hertz = (3 * force / (4 * E_star * 2)) ** (2 / 3)
    shape = press_terms.SPHERE / press_terms.THIN * math.sqrt(4 * hertz) / 4
    taken = 2 / 3 * 1.133 * shape * hertz
    assert taken == approx(0.75 * force / (math.pi * design.E * 4), rel=2e-3)


@pytest.mark.parametrize("depth", [1e-3, 0.3, 2.0])
def test_column_is_hertz_in_series_with_a_bar(depth):
    response = beam.solve(paper(), Load(depth), "column")
    assert buckling.depth(paper(), response.force[2]) == approx(depth, rel=1e-12)
    assert response.shift[2] == approx(-response.force[2] * 5 / (math.pi * 16), rel=1e-12)


def test_slender_cantilever_is_euler_bernoulli():
    for ratio in (10, 20):
        design = slender(ratio)
        force = beam.solve(design, stick(1.0, 1.0), "column").force[0]
        share = beam.cantilever_stiffness(design) * design.L / buckling.shear_stiffness(design)
        assert force == approx(beam.cantilever_stiffness(design) / (1 + share), rel=1e-12)
        assert share < 0.75 / ratio**2


@pytest.mark.parametrize("level", ["tip", "magnet", "finite"])
def test_small_grip_of_a_slender_beam_is_euler_bernoulli(level):
    design = slender(20)
    gripped = beam.solve(design, Load(shear_x=1.0, grip=0.1), level)
    assert gripped.force[0] == approx(beam.cantilever_stiffness(design), rel=0.02)
    L, H = design.L, design.H
    assert gripped.shift[0] == approx(H**2 * (3 * L - H) / (2 * L**3), rel=0.01)
    assert gripped.force[2] == gripped.shift[2] == 0


def column(**given):
    values = {"length": 12.0, "offset": 0.0, "bending": 200.0, "shearing": 15.0, "arm": 0.0, "reach": 0.0}
    return shear_terms.Column(**values | {"patch": 1e6, "glued": False} | given)


def give(of):
    """What patch and dome give way by, mm/N."""
    G = 1 / (2 * 1.4998)
    return (2 - 0.4998) / (8 * G * of.patch) + shear_terms.DOME / (4 * G)


def test_column_without_press_is_timoshenko():
    free = column()
    bent = shear_terms.bend(SILICONE, free, 0.0)
    assert 1 / bent.force == approx(12**3 / 600 + 12 / 15 + give(free), rel=1e-12)
    guided = column(shearing=1e12, glued=True)
    bent = shear_terms.bend(SILICONE, guided, 0.0)
    assert 1 / bent.force == approx(12**3 / 2400 + give(guided), rel=1e-6)
    assert abs(bent.omega) < 1e-12


def test_stiffness_vanishes_at_haringx_load():
    """Free tip: P (1 + P/S) = (pi/2l)^2 B."""
    euler, S = (math.pi / 24) ** 2 * 200, 15.0
    critical = S / 2 * (math.sqrt(1 + 4 * euler / S) - 1)
    below, at, above = (shear_terms.bend(SILICONE, column(), share * critical).force for share in (0.99, 1.0, 1.01))
    assert below > 0 > above
    assert abs(at) < 1e-12


def test_column_with_its_tip_glued_is_held_up_to_eulers_load():
    """Clamped at both ends, without shear: (2 pi/l)^2 B; and (4.4934/l)^2 B if its tip may turn."""
    hard = replace(SILICONE, E=1e4)
    for glued, root in ((True, 2 * math.pi), (False, buckling.GUIDED)):
        euler, stiff = (root / 12) ** 2 * 200, column(shearing=1e9, glued=glued)
        assert shear_terms.bend(hard, stiff, 0.99 * euler).stable
        assert not shear_terms.bend(hard, stiff, 1.01 * euler).stable


@pytest.mark.parametrize("load", [Load(1.5), stick(0.7, 0.8, -0.3)])
def test_without_a_magnet_level_magnet_is_level_tip(load):
    assert beam.solve(SILICONE, load, "magnet") == beam.solve(SILICONE, load, "tip")


@pytest.mark.parametrize("level", beam.LEVELS)
@pytest.mark.parametrize("k", [0.1, 7.0])
def test_scaling(level, k):
    large = Design(
        D=8 * k, L=9 * k, E=3.0, magnet_diameter=4 * k, magnet_height=2 * k, magnet_edge_radius=0.1 * k, l0=8 * k
    )
    a = beam.solve(paper(), stick(1.2, 0.7, -0.2), level)
    b = beam.solve(large, stick(1.2 * k, 0.7 * k, -0.2 * k), level)
    assert b.force == approx([3 * k**2 * value for value in a.force], rel=1e-9)
    assert b.shift == approx([k * value for value in a.shift], rel=1e-9)
    assert (b.tilt, b.tilt_y) == approx((a.tilt, a.tilt_y), rel=1e-9)
    assert b.contact_radius == approx(k * a.contact_radius, rel=1e-9)


@pytest.mark.parametrize("level", HIGHER)
@pytest.mark.parametrize("design", [paper(), slender(2.5)], ids=["paper", "slender"])
def test_deeper_is_harder_and_lower(level, design):
    found = [beam.solve(design, Load(depth), level) for depth in (0.0, 0.01, 0.1, 0.5, 1.0, 1.5, 2.0)]
    assert found[0].force == (0, 0, 0)
    assert [r.force[2] for r in found] == sorted({r.force[2] for r in found})
    assert [-r.shift[2] for r in found] == sorted({-r.shift[2] for r in found})


@pytest.mark.parametrize("level", HIGHER)
def test_shear_turns_with_its_direction(level):
    along, turned, back = (beam.solve(paper(), stick(1.0, *way), level) for way in ((1, 0), (0.6, 0.8), (-1, 0)))
    for a, b, c in ((along.force, turned.force, back.force), (along.shift, turned.shift, back.shift)):
        assert b == approx((0.6 * a[0], 0.8 * a[0], a[2]), rel=1e-12)
        assert c == approx((-a[0], 0, a[2]), rel=1e-12)
    assert (turned.tilt, turned.tilt_y, back.tilt) == approx((0.6 * along.tilt, 0.8 * along.tilt, -along.tilt))


def test_a_magnet_stiffens_and_a_flat_one_turns_less_than_a_tall_one():
    """Jeffery: in the same shear a disc follows the planes across the beam, a needle those along it."""
    flat = beam.solve(paper(), stick(1.0, 0.5), "magnet")
    tall = beam.solve(replace(paper(), magnet_diameter=2.0, magnet_height=4.0), stick(1.0, 0.5), "magnet")
    bare = beam.solve(SILICONE, stick(1.0, 0.5), "magnet")
    assert flat.force[2] > bare.force[2]
    assert flat.tilt < bare.tilt < tall.tilt


def test_small_shears_do_not_lean():
    response = beam.solve(paper(), stick(1.0, 1e-6), "finite")
    pressed = beam.solve(paper(), Load(1.0), "finite")
    assert response.force[2] == approx(pressed.force[2], rel=1e-9)
    leaning = [beam.solve(paper(), stick(1.0, x), "finite").force[2] / pressed.force[2] - 1 for x in (0.1, 0.2)]
    assert leaning[1] / leaning[0] == approx(4, rel=0.1)


def test_finite_answers_where_the_lean_takes_all_the_press():
    response = beam.solve(slender(3), stick(0.002, 0.5), "finite")
    assert 0 <= response.force[2] < 1e-3 * beam.solve(slender(3), Load(0.3), "finite").force[2]


@pytest.mark.parametrize(
    ("design", "load", "level", "text"),
    [
        (paper(), Load(0.4), "magnet", ""),
        (paper(), Load(0.4), "tip", "treats the magnet as silicone"),
        (paper(), Load(1.0), "magnet", "depth is above 0.06 D = 0.48 mm"),
        (paper(), stick(1.0, 2.0), "finite", ""),
        (paper(), stick(1.0, 2.5), "finite", "shear is above 0.3 D = 2.4 mm"),
        (slender(5), Load(0.1), "finite", "L/D = 5 is above 4"),
        (slender(1), Load(0.1), "finite", "L/D = 1 is below 1.1"),
        (slender(3), Load(1.0), "finite", "buckles sideways at about 1.15 N"),
        (replace(paper(), magnet_diameter=5.7), Load(1.0), "finite", "wider than 0.7 D"),
        (replace(paper(), magnet_height=4.5), Load(1.0), "finite", "0.35 D of silicone"),
        (replace(SILICONE, nu=0.4), Load(1.0), "finite", "nu = 0.4 is below 0.49"),
        (replace(SILICONE, law="yeoh"), Load(1.0), "finite", "not the law yeoh"),
        (SILICONE, Load(shear_x=1.0, grip=1.0), "finite", "grip is above D/16 = 0.5 mm"),
        (slender(3), stick(0.05, 2.0), "finite", "the press force vanishes"),
        (paper(), Load(3.0), "paper", ""),
    ],
)
def test_range(design, load, level, text):
    said = beam.outside(design, load, level)
    assert text in said
    assert bool(said) == bool(text)


def test_bad_input():
    with pytest.raises(BadInput, match="only level paper models Coulomb friction"):
        beam.solve(paper(), Load(1.0, 1.0, friction=0.5), "finite")
    with pytest.raises(BadInput, match="nothing is in contact"):
        beam.solve(paper(), stick(0.0, 1.0), "finite")
    with pytest.raises(BadInput, match="less than 7 mm, the silicone"):
        beam.solve(paper(), Load(7.5), "magnet")


def test_analytic_says_where_a_level_ends(run, strict):
    status, out, _ = run("analytic", "paper", "--depth", 3, "--level", "finite", "--json")
    (record,) = strict(out)
    assert (status, record["level"]) == (0, "finite")
    assert "depth is above 0.25 D" in record["message"]


@pytest.fixture(scope="module")
def rows():
    """The study on its first design with a press and a shear, by finite elements."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ladder, "PRESSES", (0.06, 0.18))
        patch.setattr(ladder, "UNDER", (0.12,))
        patch.setattr(ladder, "SHEARS", (0.05,))
        return ladder.run(lambda *_: None, "quick", 1).records


def test_levels_close_in_on_the_finite_elements(rows):
    answered = pd.DataFrame(rows).query("status == 'ok'")
    assert answered["level"].value_counts().to_dict() == dict.fromkeys(beam.LEVELS, 3)
    means = ladder.means(answered, ["level"]).set_index("level").T
    force = [means[level]["press_force_error_percent"] for level in beam.LEVELS]
    assert force == sorted(force, reverse=True)
    best = means["finite"]
    assert best["press_force_error_percent"] < 3
    assert best["sinking_error_percent"] < 6
    assert best["shear_force_error_percent"] < 8
    assert best["shift_error_percent"] < 4
    assert best["tilt_error_percent"] < 3


@pytest.mark.parametrize("number", range(10))
def test_designs_carry_their_loads(number):
    design = error_study_cases.designs("ladder")[number]
    deepest = Load(max(ladder.PRESSES) * design.D, max(ladder.SHEARS) * design.D, friction="stick")
    for level in beam.LEVELS:
        assert math.isfinite(beam.solve(design, deepest, level).force[0])


@pytest.mark.parametrize("count", [0, 11])
def test_a_count_out_of_range_is_a_sentence(refusal, count):
    assert "between 1 and 10" in refusal("validate", "ladder", "--count", count)
