"""The closed-form field: symmetries and known values, then the error against 60 digits in every region, bad input."""

import math

import field_oracle
import magpylib
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from analytic import cylinder
from analytic.magnet import (
    MU_0,
    cylinder_field,
    dipole_field,
    paper_field,
    repulsion,
    resting_distance,
    weight,
)
from geometry.design import BadInput, Design

RNG = np.random.default_rng(20160403)
SHAPES = [(2.0, 2.0), (2.0, 4.0), (2.0, 0.1), (0.5, 20.0)]


def on_axis(z, a, h):
    """B_z/J on the axis, outside and inside; in 30 digits, because the two terms cancel far away."""

    def face(z):
        return mpmath.mpf(z) / mpmath.hypot(z, a)

    with mpmath.workdps(30):
        return np.array(
            [float((face(float(v) + mpmath.mpf(h) / 2) - face(float(v) - mpmath.mpf(h) / 2)) / 2) for v in z]
        )


def relative(b, expected):
    return np.linalg.norm(np.subtract(b, expected), axis=-1) / np.linalg.norm(expected, axis=-1)


# --- invariants


@pytest.mark.parametrize(("a", "h"), SHAPES)
def test_symmetries(a, h):
    p = RNG.normal(size=(200, 3)) * 4
    b = cylinder_field(p, a, h, 1.2)
    mirrored = cylinder_field(p * [1, 1, -1], a, h, 1.2)
    assert_allclose(mirrored, b * [-1, -1, 1], rtol=1e-13, atol=1e-16)
    assert_allclose(cylinder_field(p, a, h, -1.2), -b, rtol=0)
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    assert relative(cylinder_field(p @ turn.T, a, h, 1.2), b @ turn.T).max() < 1e-12


def test_the_repulsion_is_the_loss_of_energy_of_a_magnet_in_the_field_of_the_other():
    """U = -(J / mu0) int B_z dV over the body, by 10 x 10 x 16 points."""
    a, h, J, s, step = 3.0, 3.0, 1.2, 9.0, 1e-3
    (r, w), (z, v) = (np.polynomial.legendre.leggauss(10) for _ in range(2))
    turn = 2 * math.pi * np.arange(16) / 16
    R, Z, T = (grid.ravel() for grid in np.meshgrid(a * (r + 1) / 2, h * z / 2, turn, indexing="ij"))
    volume = np.einsum("i,j,k->ijk", w * a / 2 * a * (r + 1) / 2, v * h / 2, np.full(16, 2 * math.pi / 16)).ravel()

    def energy(distance):
        points = np.column_stack([distance + R * np.cos(T), R * np.sin(T), Z])
        return -1e-9 * J / MU_0 * volume @ cylinder_field(points, a, h, J)[:, 2]

    slope = (energy(s + step) - energy(s - step)) / (2e-3 * step)
    assert repulsion(a, h, J, s) == pytest.approx(-slope, rel=1e-5)


def test_magnets_stay_from_where_the_push_is_that_of_friction():
    design = Design(D=12.0, L=14.0, l0=10.5, magnet_diameter=6.0, magnet_height=3.0)
    apart = resting_distance(design)
    assert repulsion(3.0, 3.0, design.remanence, apart) == pytest.approx(0.3 * weight(design), rel=1e-5)
    bare = Design(magnet_diameter=0, magnet_height=0, magnet_edge_radius=0)
    assert resting_distance(bare) is None
    with pytest.raises(BadInput, match="distance must exceed the magnets' diameter = 6 mm"):
        repulsion(3.0, 3.0, 1.2, 6.0)


def test_no_flux_leaves_a_closed_surface():
    """A closed cylinder of radius 1 from z = 0 to 3, through the face of the magnet at z = 1."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    r, w = (nodes + 1) / 2, weights / 2
    top = cylinder_field(np.column_stack([r, 0 * r, 0 * r + 3]), 2, 2, 1.2)[:, 2]
    bottom = cylinder_field(np.column_stack([r, 0 * r, 0 * r]), 2, 2, 1.2)[:, 2]
    side = 0.0
    for low, high in ((0.0, 1.0), (1.0, 3.0)):
        z = low + (high - low) * r
        side += (cylinder_field(np.column_stack([0 * z + 1, 0 * z, z]), 2, 2, 1.2)[:, 0] * w).sum() * (high - low)
    ends = ((top - bottom) * r * w).sum()
    assert ends < -0.1
    assert abs(side + ends) < 1e-13


def test_ampere_round_the_hull():
    """Along a loop through magnet and air, B dl is mu0 times the sheet current: J times the enclosed height."""
    nodes, weights = np.polynomial.legendre.leggauss(30)
    z = 0.5 * nodes
    inner, outer = (cylinder_field(np.column_stack([0 * z + r, 0 * z, z]), 2, 2, 1.2)[:, 2] for r in (1.5, 2.5))
    r = 2 + 0.5 * nodes
    top, bottom = (cylinder_field(np.column_stack([r, 0 * r, 0 * r + z]), 2, 2, 1.2)[:, 0] for z in (0.5, -0.5))
    assert_allclose(0.5 * (weights * (inner + top - outer - bottom)).sum(), 1.2, rtol=1e-9)


@pytest.mark.parametrize("z0", [1e-6, 0.02, 0.15, 0.5, 3.0, 200.0])
def test_regimes_meet(z0):
    """Two neighbours, one on each side of a change of formula, differ by no more than their distance allows."""
    angle = np.linspace(0.01, np.pi - 0.01, 40)
    for centre, radius in ((0.0, cylinder.FAR * math.hypot(1, z0)), (1.0, cylinder.THIN * z0)):
        pair = []
        for scale in (1 - 1e-13, 1 + 1e-13):
            d = radius * scale
            pair.append(np.column_stack([centre + d * np.sin(angle), 0 * angle, d * np.cos(angle)]))
        below, above = (cylinder_field(p, 1, 2 * z0, 1.0) for p in pair)
        assert relative(below, above).max() < 1e-11


# --- known values


def test_published_values_on_the_axis():
    b = cylinder_field([[0, 0, z] for z in (5, 6, 7, 8)], 2, 4, 1.2)
    assert np.round(1e3 * b[:, 2], 3).tolist() == [77.684, 45.429, 28.626, 19.138]
    assert (b[:, :2] == 0).all()


def test_hull_is_the_mean_and_jumps_by_j_and_a_face_does_not():
    b = cylinder_field([[2 - 1e-12, 0, 0.3], [2, 0, 0.3], [2 + 1e-12, 0, 0.3]], 2, 2, 1.2)
    assert_allclose(b[0] - b[2], [0, 0, 1.2], atol=1e-11)
    assert_allclose(b[1], (b[0] + b[2]) / 2, atol=1e-11)
    face = cylinder_field([[1.3, 0, 1 - 1e-12], [1.3, 0, 1], [1.3, 0, 1 + 1e-12]], 2, 2, 1.2)
    assert_allclose(face[[0, 2]], face[[1, 1]], atol=1e-11)


@pytest.mark.parametrize(("a", "h"), SHAPES)
def test_against_magpylib(a, h):
    """An independent code, where it has its digits: up to ten sizes away, not on the surface."""
    p = RNG.normal(size=(500, 3)) * 3 * math.hypot(a, h)
    other = magpylib.magnet.Cylinder(polarization=(0, 0, 1.2), dimension=(2e-3 * a, 1e-3 * h)).getB(1e-3 * p)
    assert relative(cylinder_field(p, a, h, 1.2), other).max() < 1e-9


# --- the dipole


def test_dipole_is_the_limit_and_errs_by_the_square_of_the_size():
    direction = RNG.normal(size=(20, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    errors = [
        relative(dipole_field(d * direction, 2, 2, 1.2), cylinder_field(d * direction, 2, 2, 1.2)).max()
        for d in (100.0, 200.0)
    ]
    assert 3.9 < errors[0] / errors[1] < 4.1
    flat = dipole_field(100 * direction, 2, 2 * math.sqrt(3), 1.2)
    assert relative(flat, cylinder_field(100 * direction, 2, 2 * math.sqrt(3), 1.2)).max() < 1e-2 * errors[0]


def test_dipole_on_the_axis():
    b = dipole_field([[0, 0, z] for z in (5, 6, 7, 8)], 2, 4, 1.2)
    assert np.round(1e3 * b[:, 2], 2).tolist() == [76.8, 44.44, 27.99, 18.75]
    with pytest.raises(BadInput, match="off the dipole"):
        dipole_field([[0, 0, 0]], 2, 4, 1.2)


# --- the paper's quadrature


def test_paper_equation_on_the_axis():
    z = np.array([2.0, 5.2, 7.2, -4.0])
    b_z, b_rho = paper_field(np.zeros(4), z, 2, 2, 1.2)
    assert (b_z > 0).all()
    assert_allclose(b_z, 1.2 * on_axis(z, 2, 2), rtol=1e-11)
    assert_allclose(b_rho, 0, atol=1e-16)


@pytest.mark.parametrize(("rho", "z"), [(5.0, -5.2), (2.0, -5.2), (5.0, -2.2), (8.0, 3.0), (3.0, 0.5)])
def test_paper_equation_at_the_elements(rho, z):
    b_z, b_rho = paper_field(rho, z, 2, 2, 1.2)
    assert relative([b_rho, b_z], cylinder_field([[rho, 0, z]], 2, 2, 1.2)[0, [0, 2]]) < 1e-11


@pytest.mark.parametrize(("distance", "stated"), [(1.0, 1e-14), (0.5, 1e-11), (0.25, 1e-6), (0.05, 0.1)])
def test_errors_of_the_paper_equation_near_the_surface_are_those_that_are_stated(distance, stated):
    turn, along = np.linspace(0, np.pi / 2, 40), np.linspace(0, 1, 20)
    beside = np.column_stack([np.full(20, 1 + distance), 0.6 * along])
    above = np.column_stack([along, np.full(20, 0.6 + distance)])
    at_rim = [1, 0.6] + distance * np.column_stack([np.cos(turn), np.sin(turn)])
    rho, z = np.concatenate([beside, above, at_rim]).T
    expected = cylinder_field(np.column_stack([rho, 0 * rho, z]), 1, 1.2, 1.2)[:, [0, 2]]
    worst = relative(np.column_stack(paper_field(rho, z, 1, 1.2, 1.2)[::-1]), expected).max()
    assert 0.01 * stated < worst < stated


def test_what_the_misprint_costs():
    """At the paper's elements, which the north pole faces: nothing on the axis, and in B_rho alone."""
    rho, z = np.array([0.0, 5.0, 2.0, 5.0]), np.array([7.2, 5.2, 7.2, 3.2])
    good, printed = (np.array(paper_field(rho, z, 2, 2, 1.2, printed=p)) for p in (False, True))
    error = np.linalg.norm(printed - good, axis=0) / np.linalg.norm(good, axis=0)
    assert_array_equal(printed[0], good[0])
    assert error[0] < 1e-15
    assert ((error[1:] > 0.1) & (error[1:] < 0.6)).all()


# --- extremes and bad input


def test_empty_and_enormous():
    assert cylinder_field(np.empty((0, 3)), 2, 2, 1.2).shape == (0, 3)
    assert np.isfinite(cylinder_field([[1e60, 0, 1e60], [1e-300, 0, 0]], 2, 2, 1.2)).all()


@pytest.mark.parametrize(
    ("points", "radius", "height", "text"),
    [
        ([[2, 0, 1]], 2, 2, "infinite on the magnet's rim"),
        ([[0, -2, -1]], 2, 2, "infinite on the magnet's rim"),
        ([[math.nan, 0, 1]], 2, 2, "points must be finite"),
        ([1, 0, 1], 2, 2, "shape"),
        ([[1, 0, 1]], 0, 2, "radius must be a positive"),
        ([[1, 0, 1]], 2, math.nan, "height must be a positive"),
    ],
)
def test_bad_input(points, radius, height, text):
    with pytest.raises(BadInput, match=text):
        cylinder_field(points, radius, height, 1.2)


@pytest.mark.parametrize(("rho", "z"), [(0.0, 0.0), (2.0, 0.5), (1.0, 1.0), (math.nan, 0.5)])
def test_paper_equation_refuses_the_magnet(rho, z):
    with pytest.raises(BadInput, match="outside the magnet only"):
        paper_field(rho, z, 2, 2, 1.2)


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
    for name, points in regions(flatness, 2).items():
        many = cylinder_field(np.tile(points, (1000, 1)), a, h, 1.0)
        for k, point in enumerate(points):
            true = field_oracle.field(point, a, h)
            alone = cylinder_field(point[None], a, h, 1.0)[0]
            assert max(field_oracle.relative(found, true) for found in (alone, many[k])) < 1e-12, name
        if "axis" not in name:
            # the slopes along z, of which div B = 0 and curl B = 0 give all others
            place, series = cylinder.lengths(*points[0].tolist(), a, h / 2), cylinder.cylinder_series(flatness / 2)
            _, _, lean_z, along_z = cylinder.unit_field(place, flatness / 2, series, cylinder.disc_series(), True)
            found = np.array([*(lean_z * points[0, :2] / a), along_z]) / a
            assert field_oracle.relative(found, field_oracle.slope(points[0], a, h)) < 1e-11, name


def test_the_oracle_is_the_closed_form_on_the_axis():
    assert field_oracle.field((0, 0, 5.0), 2, 4)[2] == pytest.approx(77.684e-3 / 1.2, rel=1e-5)
    # the slope of [(z + h/2) / (a^2 + (z + h/2)^2)^(1/2) - (z - h/2) / ...] / 2 is a^2 / 2 [(...)^(-3/2) - ...]
    expected = 2 * (math.hypot(7, 2) ** -3 - math.hypot(3, 2) ** -3)
    assert field_oracle.slope((0, 0, 5.0), 2, 4)[2] == pytest.approx(expected, rel=1e-12)
