"""The formulas: the paper's numbers, and at all levels limit cases, scaling, critical loads, and bad input."""

import math
from dataclasses import replace

import pytest

from analytic import beam, buckling, press_terms, shear_terms
from analytic.beam import cantilever_stiffness, solve
from geometry.design import BadInput, Design, paper
from geometry.loads import Load


def test_numbers_of_the_paper():
    assert solve(paper(), Load(depth=3)).force == (0, 0, pytest.approx(15.708, abs=5e-4))
    assert solve(paper(), Load(depth=1)).force[2] == pytest.approx(7 * math.pi / 9, rel=1e-14)
    assert cantilever_stiffness(paper()) == pytest.approx(0.827, abs=5e-4)
    sheared = solve(paper(), Load(shear_x=3.1, grip=2))
    assert sheared.force[0] == pytest.approx(3.1 * 0.82740, rel=1e-4)


def test_displacement_with_the_assumed_closure():
    """The paper's two relations with l_t = e (1 - d/L)."""
    d, x, e, L = 2.0, 1.3, 4.0, 9.0
    l_t = e * (1 - d / L)
    response = solve(paper(), Load(d, x, -x, "stick"))
    along = x * ((L - d) - l_t) / (L - d)
    assert response.shift == pytest.approx((along, -along, -(l_t + d - e)), rel=1e-14)
    assert response.tilt == 0


def test_contact_radius_and_the_end_of_equation_7():
    for d in (0.0, 1.0, 4.0):
        assert solve(paper(), Load(depth=d)).contact_radius == pytest.approx(math.sqrt(8 * d - d * d), rel=1e-14)


def test_friction():
    def under(friction, depth=2.0):
        return solve(paper(), Load(depth, 1.2, -0.9, friction))

    stuck, slid = under("stick"), under("none")
    assert slid.force[:2] == (0, 0)
    assert slid.shift[:2] == (0, 0)
    assert slid.force[2] == stuck.force[2] > 0
    assert math.hypot(*stuck.force[:2]) == pytest.approx(1.5 * cantilever_stiffness(paper()))
    assert under(10.0) == stuck
    assert under(0.0) == slid
    slips = under(0.05)
    share = 0.05 * slips.force[2] / math.hypot(*stuck.force[:2])
    assert 0 < share < 1
    assert slips.force[:2] == pytest.approx([share * value for value in stuck.force[:2]], rel=1e-13)
    assert slips.shift[:2] == pytest.approx([share * value for value in stuck.shift[:2]], rel=1e-13)
    assert under(0.3, depth=0.0).force == (0, 0, 0)


# Critical loads of a column, and the table of them beside finite elements.


@pytest.mark.parametrize("end", [buckling.FREE, buckling.GUIDED])
def test_haringx_solves_its_equation(end):
    beam = paper()
    P = buckling.haringx(beam, end)
    assert P * (1 + P / buckling.shear_stiffness(beam)) == pytest.approx(buckling.euler(beam, end), rel=1e-12)


def test_shear_softens_and_engesser_softens_more():
    beam = paper()
    assert buckling.engesser(beam) < buckling.haringx(beam) < buckling.euler(beam)


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
    assert off[0] / off[1] == pytest.approx(10, rel=0.01)


def test_first_term_of_the_dome_is_tatara():
    """It takes 0.75 F/(pi E R) from Hertz's depth, and Dimitriadis' coefficient of x is 1.335 times that."""
    design, force = SILICONE, 1e-7
    E_star = press_terms.effective_modulus(design)
    hertz = (3 * force / (4 * E_star * 2)) ** (2 / 3)
    shape = press_terms.SPHERE / press_terms.THIN * math.sqrt(4 * hertz) / 4
    taken = 2 / 3 * 1.133 * shape * hertz
    assert taken == pytest.approx(0.75 * force / (math.pi * design.E * 4), rel=2e-3)


@pytest.mark.parametrize("depth", [1e-3, 0.3, 2.0])
def test_column_is_hertz_in_series_with_a_bar(depth):
    response = beam.solve(paper(), Load(depth), "column")
    assert buckling.depth(paper(), response.force[2]) == pytest.approx(depth, rel=1e-12)
    assert response.shift[2] == pytest.approx(-response.force[2] * 5 / (math.pi * 16), rel=1e-12)


@pytest.mark.parametrize("level", ["tip", "magnet", "finite"])
def test_small_grip_of_a_slender_beam_is_euler_bernoulli(level):
    design = slender(20)
    gripped = beam.solve(design, Load(shear_x=1.0, grip=0.1), level)
    assert gripped.force[0] == pytest.approx(beam.cantilever_stiffness(design), rel=0.02)
    L, H = design.L, design.H
    assert gripped.shift[0] == pytest.approx(H**2 * (3 * L - H) / (2 * L**3), rel=0.01)
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
    assert 1 / bent.force == pytest.approx(12**3 / 600 + 12 / 15 + give(free), rel=1e-12)
    guided = column(shearing=1e12, glued=True)
    bent = shear_terms.bend(SILICONE, guided, 0.0)
    assert 1 / bent.force == pytest.approx(12**3 / 2400 + give(guided), rel=1e-6)
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
    assert b.force == pytest.approx([3 * k**2 * value for value in a.force], rel=1e-9)
    assert b.shift == pytest.approx([k * value for value in a.shift], rel=1e-9)
    assert (b.tilt, b.tilt_y) == pytest.approx((a.tilt, a.tilt_y), rel=1e-9)
    assert b.contact_radius == pytest.approx(k * a.contact_radius, rel=1e-9)


@pytest.mark.parametrize("level", HIGHER)
def test_shear_turns_with_its_direction(level):
    along, turned, back = (beam.solve(paper(), stick(1.0, *way), level) for way in ((1, 0), (0.6, 0.8), (-1, 0)))
    for a, b, c in ((along.force, turned.force, back.force), (along.shift, turned.shift, back.shift)):
        assert b == pytest.approx((0.6 * a[0], 0.8 * a[0], a[2]), rel=1e-12)
        assert c == pytest.approx((-a[0], 0, a[2]), rel=1e-12)
    assert (turned.tilt, turned.tilt_y, back.tilt) == pytest.approx((0.6 * along.tilt, 0.8 * along.tilt, -along.tilt))


@pytest.mark.parametrize(
    ("design", "load", "level", "text"),
    [
        (paper(), Load(0.4), "magnet", ""),
        (paper(), Load(0.4), "tip", "treats the magnet as silicone"),
        (SILICONE, stick(0.4, 0.3), "column", ""),
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


@pytest.mark.parametrize(
    ("load", "level", "text"),
    [
        (Load(depth=1), "fem", r"level must be one of paper, column, .*; got 'fem'"),
        (Load(depth=1, plate_tilt=0.1), "paper", r"cannot model plate tilt = 5\.73 deg: leave it out"),
        (Load(depth=1, imperfection=0.01), "paper", "cannot model imperfection = 0.01 N"),
        (Load(depth=4.01), "paper", r"must not exceed the tip radius D/2 = 4 mm.*got 4.01 mm"),
        (Load(depth=9), "paper", "depth must be less than 9 mm"),
        (Load(shear_x=1, grip=9), "paper", "grip must be less than L"),
        (Load(1.0, 1.0, friction=0.5), "finite", "only level paper models Coulomb friction"),
        (stick(0.0, 1.0), "finite", "nothing is in contact"),
        (Load(7.5), "magnet", "less than 7 mm, the silicone"),
    ],
)
def test_loads_that_a_level_cannot_answer_are_refused(load, level, text):
    with pytest.raises(BadInput, match=text):
        beam.solve(paper(), load, level)
