"""Gaps between the moved magnet or beam and the elements."""

import math

import numpy as np
import pytest

from analytic.clearance import magnet_gaps, wall_gaps, warnings
from geometry.design import Design, paper
from geometry.fabrication import solid_files
from geometry.fabrication.printability import overhangs, standing

REST = (0.0, 0.0, 0.0)


def magnet_gap(design, point, shift, tilt):
    return magnet_gaps(design, point, np.array([shift]), np.array([tilt]))[0]


def wall_gap(design, point, shift):
    return wall_gaps(design, point, np.array([shift]))[0]


def test_gaps_at_rest():
    s1, s2 = (0, 0, -2.2), (5, 0, -0.2)
    assert magnet_gap(paper(), s1, REST, (0, 0)) == pytest.approx(7.2 - 1)
    assert magnet_gap(paper(), s2, REST, (0, 0)) == pytest.approx(math.hypot(3, 4.2))
    assert wall_gap(paper(), s2, REST) == pytest.approx(1)
    assert wall_gap(paper(), s1, REST) == math.inf
    assert warnings(paper(), REST, (0, 0)) == []


def test_a_tilted_magnet_is_nearer_on_one_side():
    point = (4.0, 0.0, 3.0)
    assert magnet_gap(paper(), point, REST, (0, 0.3)) < magnet_gap(paper(), point, REST, (0, -0.3))
    assert magnet_gap(paper(), point, REST, (0, math.pi)) == pytest.approx(magnet_gap(paper(), point, REST, (0, 0)))


def test_the_column_keeps_its_volume():
    """The mean of 6 t (1 - t) is 1, and its greatest 1.5."""
    widest = 50 - wall_gap(Design(L=24.0), (50.0, 0.0, -1.0), (0, 0, -1))
    assert widest**2 == pytest.approx(16 * (1 + 1.5 * (20 / 19 - 1)), rel=1e-3), "half way up"


def test_a_sheared_beam_leans_over_s2_alone():
    (text,) = warnings(paper(), (2.0, 0.0, -0.5), (0, 0.1))
    assert text.startswith("the beam's wall extends over S2 by about")
    assert wall_gap(paper(), (0, 5, -0.2), (2.0, 0.0, -0.5)) > 0


def test_the_magnet_in_an_element_or_under_the_base():
    found = warnings(paper(), (0.0, 0.0, -6.5), (0, 0))
    assert any("S1 touches or overlaps the magnet" in text for text in found)
    assert any("below the base plane" in text for text in found)


def test_a_magnet_that_would_lie_in_the_base_leaves_no_wall():
    """At H + z = h/2 the magnet stands on the base: the last pose that has a wall."""
    s2 = (5.0, 0.0, -0.2)
    assert math.isfinite(wall_gap(paper(), s2, (0.0, 0.0, -4.0)))
    assert math.isnan(wall_gap(paper(), s2, (0.0, 0.0, -4.001)))
    (text,) = warnings(paper(), (0.0, 0.0, -60.0), (0, 0))
    assert text == "the magnet's lowest point is 56 mm below the base plane: no press reaches this pose"


def test_an_element_in_the_beam_is_said():
    found = warnings(Design(l0=4.0, f=3.0), REST, (0, 0))
    assert [text.split(" by")[0] for text in found if "S2" in text] == ["the beam's wall overlaps S2"]
    assert any("S1" in text for text in found)


@pytest.mark.filterwarnings("error")
def test_a_beam_stretched_beyond_its_estimate_has_a_wall():
    design = paper()
    assert wall_gap(design, (design.f, 0.0, 1.0), (0.0, 0.0, 1e9)) > 0


# Overhangs and bridges of shapes whose answer is known.


def box(x, y, z, at=(0, 0, 0)):
    import build123d as bd

    return bd.Solid.make_box(x, y, z, bd.Plane(at))


def cut(body, tool):
    return body.cut(tool).solids()[0]


def found(solid):
    return overhangs(solid_files.triangulated(solid, 0.01))


def test_a_sphere_overhangs_below_45_degrees():
    import build123d as bd

    area, bridge = found(bd.Solid.make_sphere(5))
    assert area == pytest.approx(2 * math.pi * 25 * (1 - math.sqrt(0.5)), rel=5e-3)
    assert bridge == 0


def test_a_hole_through_a_wall_overhangs_over_a_quarter_of_its_turn():
    import build123d as bd

    hole = bd.Solid.make_cylinder(2, 30, bd.Plane((10, -5, 5), z_dir=(0, 1, 0)))
    area, _ = found(cut(box(20, 20, 10), hole))
    assert area == pytest.approx(2 * math.pi / 2 * 20, rel=0.1)


def test_bridges_are_measured_from_wall_to_wall():
    body = box(20, 20, 10)
    assert found(body) == (0, 0)
    assert found(cut(body, box(4, 8, 3, (8, 6, 0)))) == (0, pytest.approx(4))
    # a channel is open at both ends, and still carried on both sides
    assert found(cut(body, box(3, 30, 3, (8, -5, 0)))) == (0, pytest.approx(3))


def test_a_roof_with_a_free_edge_hangs_in_the_air():
    body = box(20, 20, 10)
    assert found(cut(body, box(4, 28, 3, (-1, -4, 0)))) == (0, math.inf)
    table = box(2, 2, 8).fuse(box(20, 20, 2, (-9, -9, 8))).solids()[0]
    assert found(table) == (0, math.inf)
    assert found(standing(table, upside_down=True)) == (0, 0)


def test_parts_stand_on_the_bed():
    moved = box(1, 2, 3, (5, 5, -7))
    for over in (False, True):
        low = standing(moved, upside_down=over).bounding_box()
        assert pytest.approx((0, 3), abs=1e-6) == (low.min.Z, low.max.Z)
