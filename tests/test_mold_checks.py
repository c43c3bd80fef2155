"""Collisions of parting solids and distances of faces, in cases with known answers."""

import math

import pytest

from geometry import cad
from geometry.fabrication import mold_solids
from geometry.fabrication.mold_solids import largest_overlap, least_gap

UP, SIDEWAYS = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)


def cup():
    return cad.turned([(0, -5, 0), (3, -5, 0), (3, 0, 0), (2, 0, 0), (2, -4, 0), (0, -4, 0)])


def ball(height):
    import build123d as bd

    return bd.Solid.make_sphere(1.0, bd.Plane((0, 0, height)))


@pytest.fixture
def steps(monkeypatch):
    """Count the intersections that are computed."""
    asked = []
    monkeypatch.setattr(mold_solids, "overlap", lambda one, other: asked.append(1) or cad.overlap(one, other))
    return asked


def test_no_intersection_is_computed_if_the_faces_exclude_a_collision(steps):
    plug = cad.turned([(0, -4, 0), (2, -4, 0.5), (2, 1, 0), (0, 1, 0)])
    assert largest_overlap(plug, cup(), 10.0, UP) == 0
    dome = cad.turned([(0, -2, 0), (1.5, -2, 1.5), (1.9, 1, 0), (0, 1, 0)])
    assert largest_overlap(dome, cup(), 10.0, UP) == 0
    assert steps == []


def test_a_ball_collides_with_a_ball_above(steps):
    assert largest_overlap(ball(0), ball(5), 5.0, UP) == pytest.approx(4 / 3 * math.pi, rel=1e-9)
    assert largest_overlap(ball(5), ball(0), 5.0, UP) == 0
    assert len(steps) == len(mold_solids.STEPS) + 3


def test_a_plug_does_not_leave_a_cup_sideways_or_downwards():
    plug = cad.turned([(0, -3, 0), (1, -3, 0), (1, 1, 0), (0, 1, 0)])
    assert largest_overlap(plug, cup(), 4.0, SIDEWAYS) > 1
    assert largest_overlap(plug, cup(), 4.0, (0.0, 0.0, -1.0)) > 1


def test_a_thin_lip_far_ahead_is_detected():
    lip = [(3, 0, 0), (1.5, 0, 0), (1.5, -0.1, 0), (2, -0.1, 0), (2, -4, 0), (0, -4, 0)]
    held = cad.turned([(0, -4, 0), (2, -4, 0), (2, -3, 0), (0, -3, 0)])
    ring = math.pi * (2**2 - 1.5**2)
    # 0.1 mm thick, and met after 2.9 mm of 10
    assert largest_overlap(held, cad.turned([(0, -5, 0), (3, -5, 0), *lip]), 10.0, UP) == pytest.approx(ring * 0.1)


def test_solids_that_overlap_before_are_intersected(steps):
    import build123d as bd

    post = bd.Solid.make_cylinder(2.5, 5, bd.Plane((0, 0, -4)))
    assert largest_overlap(post, cup(), 1.0, UP, cad.overlap(post, cup())) > 1
    assert steps


def test_gaps_equal_the_distances_of_the_solids():
    body = cad.turned([(0, -3, 0), (1, -3, 1), (1, 0, 0), (0, 0, 0)])
    faces = cup().faces()
    assert least_gap(body, faces) == pytest.approx(1, abs=1e-12)
    low = [face for face in faces if face.geom_type.name == "PLANE" and face.center().Z < -4.5]
    assert least_gap(body, low) == pytest.approx(body.distance_to(low[0]), abs=1e-12) == pytest.approx(2)


def test_the_gap_to_a_square_foot_is_exact():
    import build123d as bd

    body = cad.turned([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    frame = bd.Solid.make_box(8, 8, 1, bd.Plane((-4, -4, -2))).cut(bd.Solid.make_cylinder(2, 3, bd.Plane((0, 0, -3))))
    foot = frame.solids()[0]
    assert least_gap(body, foot.faces()) == pytest.approx(math.sqrt(2), abs=1e-9)
    assert least_gap(body, foot.faces()) == pytest.approx(body.distance_to(foot), abs=1e-9)


def test_faces_that_touch_may_be_left_out():
    body = cad.turned([(0, -4, 0), (1, -4, 0), (1, 0, 0), (0, 0, 0)])
    assert least_gap(body, cup().faces()) == 0
    assert least_gap(body, cup().faces(), touching=False) == pytest.approx(1, abs=1e-9)
    assert least_gap(body, []) == math.inf
