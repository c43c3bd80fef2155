"""The closed-form field: symmetries and known values, then the error against 60 digits in every region, bad input."""

import math
import subprocess
import sys

import magpylib
import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import cylinder
from analytic.magnet import MU_0, cylinder_field, dipole_field, paper_field, repulsion, resting_distance, weight
from geometry import compiled
from geometry.design import BadInput, Design

RNG = np.random.default_rng(20160403)
SHAPES = [(2.0, 2.0), (2.0, 4.0), (2.0, 0.1), (0.5, 20.0)]


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


# --- known values


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


# --- the paper's quadrature


@pytest.mark.parametrize(("rho", "z"), [(0.0, 7.2), (0.0, -4.0), (5.0, -5.2), (2.0, -5.2), (5.0, -2.2), (3.0, 0.5)])
def test_paper_equation_at_the_elements(rho, z):
    b_z, b_rho = paper_field(rho, z, 2, 2, 1.2)
    assert relative([b_rho, b_z], cylinder_field([[rho, 0, z]], 2, 2, 1.2)[0, [0, 2]]) < 1e-11


# --- extremes and bad input


def test_empty_and_enormous():
    assert cylinder_field(np.empty((0, 3)), 2, 2, 1.2).shape == (0, 3)
    assert np.isfinite(cylinder_field([[1e60, 0, 1e60], [1e-300, 0, 0]], 2, 2, 1.2)).all()


MANY = [(1, 1, 1)] * cylinder.MIN_COMPILED_POINTS


@pytest.mark.parametrize(
    ("field", "values", "text"),
    [
        (cylinder_field, ([[2, 0, 1]], 2, 2), "infinite on the magnet's rim"),
        (cylinder_field, ([[0, -2, -1]], 2, 2), "infinite on the magnet's rim"),
        (cylinder_field, ([*MANY, (2, 0, 1), (-2, 0, 1)], 2, 2), r"where \(2, 0, 1\) mm lies"),
        (cylinder_field, ([*MANY, (0, math.nan, 1), (-2, 0, 1)], 2, 2), "points must be finite"),
        (cylinder_field, ([1, 0, 1], 2, 2), "shape"),
        (cylinder_field, ([[1, 0, 1]], 0, 2), "radius must be a positive"),
        (cylinder_field, ([[1, 0, 1]], 2, math.nan), "height must be a positive"),
        (dipole_field, ([[0, 0, 0]], 2, 4), "off the dipole"),
        (paper_field, (0.0, 0.0, 2, 2), "outside the magnet only"),
        (paper_field, (2.0, 0.5, 2, 2), "outside the magnet only"),
        (paper_field, (math.nan, 0.5, 2, 2), "outside the magnet only"),
    ],
)
def test_points_without_a_field_are_refused(field, values, text):
    with pytest.raises(BadInput, match=text):
        field(*values, 1.2)


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


def end_faces(point, radius, height):
    """B for J = 1, T, in mpmath's digits: the end faces by complete elliptic integrals. Not at r = radius."""
    x, y, z, a, h = (v if isinstance(v, mpmath.mpf) else mpmath.mpf(float(v)) for v in (*point, radius, height))
    rho = mpmath.hypot(x, y)
    r = rho / a
    g = (1 - r) / (1 + r)

    def face(zeta):
        s = mpmath.hypot(zeta, 1 + r)
        m = 4 * r / s**2
        if r == 0:
            return mpmath.mpf(0), mpmath.sign(zeta) / 2 - zeta / (2 * s)
        K, E = mpmath.ellipk(m), mpmath.ellipe(m)
        jump = mpmath.sign(zeta) / 2 if r < 1 else 0
        along = jump - zeta * (K + g * mpmath.ellippi(1 - g**2, m)) / (2 * mpmath.pi * s)
        return ((2 - m) * K - 2 * E) / (m * mpmath.pi * s), along

    (top_r, top_z), (bottom_r, bottom_z) = face((z - h / 2) / a), face((z + h / 2) / a)
    inside = 1 if r < 1 and abs(z) < h / 2 else 0
    lean = (top_r - bottom_r) / rho if r else mpmath.mpf(0)
    return [lean * x, lean * y, top_z - bottom_z + inside]


def true_field(point, radius, height):
    """B in 60 digits; the numbers given are taken as exact."""
    with mpmath.workdps(60):
        return np.array([float(v) for v in end_faces(point, radius, height)])


def true_slope(point, radius, height):
    """dB/dz, T/mm, by a central difference in 100 digits over 1e-22 radii."""
    with mpmath.workdps(100):
        x, y, z, step = *(mpmath.mpf(float(v)) for v in point), mpmath.mpf(10) ** -22 * radius
        ends = (end_faces((x, y, end), radius, height) for end in (z + step, z - step))
        return np.array([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])


@pytest.mark.parametrize("flatness", FLATNESS)
def test_errors_are_below_1e_12_in_every_region(flatness):
    """One by one, and with so many others that they are computed in a batch."""
    a, h = RADIUS, RADIUS * flatness
    for name, points in regions(flatness, 2).items():
        many = cylinder_field(np.tile(points, (1000, 1)), a, h, 1.0)
        for k, point in enumerate(points):
            true = true_field(point, a, h)
            alone = cylinder_field(point[None], a, h, 1.0)[0]
            assert max(relative(found, true) for found in (alone, many[k])) < 1e-12, name
        if "axis" not in name:
            # the slopes along z, of which div B = 0 and curl B = 0 give all others
            place, series = cylinder.lengths(*points[0].tolist(), a, h / 2), cylinder.cylinder_series(flatness / 2)
            _, _, lean_z, along_z = cylinder.unit_field(place, flatness / 2, series, cylinder.disc_series(), True)
            found = np.array([*(lean_z * points[0, :2] / a), along_z]) / a
            assert relative(found, true_slope(points[0], a, h)) < 1e-11, name


SPECIAL = [[1.7, 0, 0], [0, -1.7, 0], [np.nan, 0, 0], [0, np.inf, 0], [1e200, 0, 1e200], [1e-300, 0, 0]]


def computed(monkeypatch, threads, x, a, h):
    """B in plain Python (no threads), or compiled in a number of threads."""
    if not threads:
        cylinder.compiled_functions.cache_clear()
    monkeypatch.setattr(cylinder, "MIN_COMPILED_POINTS", 0 if threads else 10**9)
    monkeypatch.setattr(cylinder, "THREAD_POINTS", 500)
    monkeypatch.setattr(compiled, "threads", lambda: threads)
    return cylinder.computed(x, a, h / 2, 1.2)


@pytest.mark.parametrize("flatness", [1e-6, 1e-2, 0.3, 1.0, 2.0, 30.0, 1e3])
def test_plain_and_compiled_functions_and_threads_have_the_same_digits(flatness, monkeypatch):
    a, h = 1.7, 1.7 * flatness
    x = np.vstack([*regions(flatness, 150).values(), SPECIAL])
    x[-6, 2], x[-5, 2] = h / 2, -h / 2
    plain, one, two = (computed(monkeypatch, threads, x, a, h) for threads in (0, 1, 2))
    for found in (one, two):
        np.testing.assert_array_equal(found[0], plain[0])
        assert found[1] == plain[1] == len(x) - 6
    assert np.isnan(plain[0][-6:-2]).all()
    assert np.isfinite(plain[0][:-6]).all()
    assert (plain[0][-2] == 0).all()


def test_few_points_do_without_numba():
    """A process that needs a reading does not wait for numba, and gets the digits of one that has it."""
    code = """
import sys
import numpy as np
from analytic import magnet
x = np.random.default_rng(1).normal(size=(300, 3)) * 5
first = magnet.cylinder_field(x, 2, 2, 1.2).tobytes()
print("numba" in sys.modules)
magnet.cylinder_field(np.ones((3000, 3)), 2, 2, 1.2)
print("numba" in sys.modules, magnet.cylinder_field(x, 2, 2, 1.2).tobytes() == first)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["False", "True", "True"]
