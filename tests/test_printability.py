"""Overhangs and bridges of shapes whose answer is known."""

import math

import pytest

from geometry.fabrication import solid_files
from geometry.fabrication.printability import overhangs, standing


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
