"""The field near and far of magnets from flat to long, against 60 digits; and the oracle of these digits itself."""

import math

import field_oracle
import numpy as np
import pytest

from analytic.magnet import cylinder_field, cylinder_field_jacobian

RADIUS = 1.7
FLATNESS = (1e-6, 1e-3, 0.1, 1.0, 2.0, 30.0, 1e3)
"""Height over radius of the magnets."""


def regions(flatness, count):
    """Points of each region of a magnet of RADIUS, shape (count, 3), mm."""
    rng = np.random.default_rng(20160403)
    a, h = RADIUS, RADIUS * flatness
    size = math.hypot(a, h / 2)
    c, s = (f(rng.uniform(0, 2 * np.pi, count)) for f in (np.cos, np.sin))
    scale = np.hypot(c, s)
    c, s = c / scale, s / scale
    u, v = rng.uniform(-1, 1, (2, count))
    way = np.column_stack([np.sqrt(1 - u * u) * c, np.sqrt(1 - u * u) * s, u])
    step, angle = 10.0 ** rng.uniform(-12, -2, count), rng.uniform(0, 2 * np.pi, count)
    inner = a * np.sqrt(rng.uniform(0, 0.98, count))

    def ring(rho, z):
        return np.column_stack([rho * c, rho * s, z])

    side = np.where(u < 0, -1.0, 1.0)
    return {
        "inside": ring(inner, 0.49 * h * v),
        "on the axis": np.column_stack([0 * u, 0 * u, 3 * h * v]),
        "1e-9 radii from the axis": ring(1e-9 * a + 0 * u, 3 * h * v),
        "1e-12 radii from the hull": ring(a * (1 + 1e-12 * side), 0.4 * h * v),
        "1e-12 radii from a face": ring(inner, h / 2 + 1e-12 * a * side),
        "1e-12 to 1e-2 radii from the rim": ring(a * (1 + step * np.cos(angle)), h / 2 + a * step * np.sin(angle)),
        "above the rim (r = radius)": ring(a * (1 + 1e-15 + 0 * u), h * (1 + 2 * np.abs(v))),
        "around it, to 5 sizes": way * (size * (1 + 4 * np.abs(v)))[:, None],
        "10 to 1e3 radii away": way * (a * 10.0 ** (2 + v))[:, None] + [0, 0, h],
        "1e3 to 1e6 radii away": way * (a * 10.0 ** (4.5 + 1.5 * v))[:, None] + [0, 0, h],
    }


@pytest.mark.parametrize("flatness", FLATNESS)
def test_errors_are_below_1e_12_in_every_region(flatness):
    """One by one, and with so many others that they are computed in a batch."""
    a, h = RADIUS, RADIUS * flatness
    for name, points in regions(flatness, 3).items():
        many = cylinder_field(np.tile(points, (400, 1)), a, h, 1.0)
        for k, point in enumerate(points):
            true = field_oracle.field(point, a, h)
            alone = cylinder_field(point[None], a, h, 1.0)[0]
            assert max(field_oracle.relative(found, true) for found in (alone, many[k])) < 1e-12, name
        if "axis" not in name:
            slope = cylinder_field_jacobian(points[:1], a, h, 1.0)[1][0]
            assert field_oracle.relative(slope, field_oracle.jacobian(points[0], a, h)) < 1e-11, name


def test_the_oracle_is_the_closed_form_on_the_axis_and_a_gradient():
    assert field_oracle.field((0, 0, 5.0), 2, 4)[2] == pytest.approx(77.684e-3 / 1.2, rel=1e-5)
    slope = field_oracle.jacobian((1.0, 0.5, 3.0), 2, 2)
    assert field_oracle.relative(slope, slope.T) < 1e-12
    assert abs(np.trace(slope)) < 1e-12 * np.linalg.norm(slope)
