"""Loads and responses: rotation vector of the magnet against SciPy, shear, scaling."""

import math

import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from analytic import hall
from geometry.design import paper
from geometry.loads import Load, Response, rotation_of, tilts_of


@pytest.mark.parametrize(("tilt", "tilt_y"), [(0.3, 0.0), (0.0, 0.3), (0.2, -0.1)])
def test_the_rotation_vector_leans_the_axis_by_the_tilts(tilt, tilt_y):
    response = Response((0.0,) * 3, (0.0,) * 3, tilt, 0.0, tilt_y)
    axis = Rotation.from_rotvec([*response.rotation, 0.0]).apply([0.0, 0.0, 1.0])
    # the angle from z, along the direction of (tilt, tilt_y)
    angle = (tilt**2 + tilt_y**2) ** 0.5
    length = (axis[0] ** 2 + axis[1] ** 2) ** 0.5
    assert_allclose(axis[:2] / length, [tilt / angle, tilt_y / angle], atol=1e-14)
    assert axis[2] > 0
    assert tilts_of(*response.rotation) == (tilt, tilt_y)


def test_the_rotation_of_a_response_is_that_of_its_tilts():
    response = Response((0.0,) * 3, (0.4, -0.2, -1.0), 0.15, 1.0, -0.08)
    by_pose = hall.readings(paper(), shift=response.shift, tilt=rotation_of(0.15, -0.08))
    assert hall.readings(paper(), response) == by_pose


@pytest.mark.parametrize(
    ("x", "y", "degrees"), [(1, 0, 0), (-1, 0, 0), (0, 1, 90), (0, -1, 90), (-1, 1, -45), (1, 1, 45), (0, 0, 0)]
)
def test_opposite_shears_have_one_axis(x, y, degrees):
    load = Load(depth=1.0, shear_x=x, shear_y=y, friction="stick")
    angle = math.radians(degrees)
    assert load.direction == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-15)
    assert load.axis == pytest.approx(angle, abs=1e-12)


def test_scaling_and_its_inverse_change_nothing():
    response = Response((0.3, -0.1, 2.0), (0.4, -0.2, -1.0), 0.15, 1.0, -0.08)
    assert response.scaled(4.0, 32.0).scaled(0.25, 1 / 32) == response
