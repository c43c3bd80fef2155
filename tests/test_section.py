"""The section mesh: exact where it must be, well shaped everywhere, the same at every scale."""

import math

import numpy as np
import pytest
import skfem

from geometry.cad import beam_volume, magnet_volume
from geometry.design import BadInput, Shape, paper
from geometry.section import _triangulated, section

PAPER = paper().shape.scaled(1 / 8)
THIN = 0.0125  # the least wall in units of D, with a little room for rounding
EXTREMES = {
    "widest magnet": Shape(1, 1.125, 2 * (0.5 - THIN), 0.025, 0.0125),
    "thin floor": Shape(1, 0.6375, 0.5, 0.25 - 0.025, 0.01),
    "sharp edge near the dome": Shape(1, 1.5, 0.6, 2 * (math.sqrt((0.5 - THIN) ** 2 - 0.09)), 0.0),
    "ball": Shape(1, 2, 0.6, 0.6, 0.3),
    "needle": Shape(1, 2, 0.05, 0.9, 0.01),
    "tall": Shape(1, 10, 0.5, 0.25, 0.0125),
}


def magnet_area(s: Shape) -> float:
    a, h, rho = s.magnet_diameter / 2, s.magnet_height, s.magnet_edge_radius
    return a * h - 2 * rho**2 * (1 - math.pi / 4)


def integrals(mesh, elements=None):
    """Area and volume of revolution."""
    basis = skfem.Basis(mesh, skfem.ElementTriP2(), intorder=6, elements=elements)
    return basis.dx.sum(), 2 * math.pi * (basis.global_coordinates()[0] * basis.dx).sum()


def angles(mesh):
    x = mesh.doflocs[0] + 1j * mesh.doflocs[1]
    p = x[mesh.t[:3]]
    return np.degrees(np.angle((np.roll(p, 1, axis=0) - p) / (np.roll(p, -1, axis=0) - p)))


def nodes_on(mesh, name):
    """Corner and middle nodes of a boundary, shape (2, n)."""
    facets = mesh.boundaries[name]
    return mesh.doflocs[:, np.append(np.unique(mesh.facets[:, facets]), mesh.nvertices + facets)]


def random_shapes(count, seed):
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        height, radius = 2 * 10 ** rng.uniform(-1.9, -0.4), rng.uniform(0.03, 0.4875)
        rho = rng.choice([0.0, 0.05, rng.random(), 1.0]) * min(radius, height / 2)
        shape = Shape(1.0, 0.5 + 10 ** rng.uniform(-1.6, 0.5), 2 * radius, height, rho)
        if shape.wall >= THIN:
            found.append(shape)
    return found


@pytest.mark.parametrize("magnet", ["hole", "meshed", "none"])
def test_area_and_volume_are_exact(magnet):
    mesh = section(PAPER, 0.075, magnet=magnet)
    area, volume = integrals(mesh, mesh.subdomains["silicone"])
    beam = PAPER.R * PAPER.H + math.pi * PAPER.R**2 / 4
    gone = 0 if magnet == "none" else 1
    assert volume == pytest.approx(beam_volume(PAPER) - gone * magnet_volume(PAPER), rel=2e-6)
    assert area == pytest.approx(beam - gone * magnet_area(PAPER), rel=2e-6)
    assert ("magnet" in mesh.boundaries) == (magnet != "none")
    assert ("magnet" in mesh.subdomains) == (magnet == "meshed")
    if magnet == "meshed":
        core = integrals(mesh, mesh.subdomains["magnet"])
        assert core == pytest.approx((magnet_area(PAPER), magnet_volume(PAPER)), rel=1e-5)


@pytest.mark.parametrize("magnet", ["hole", "meshed", "none"])
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(name, magnet):
    shape = EXTREMES[name]
    mesh = section(shape, 0.1, magnet=magnet)
    expected = beam_volume(shape) - (magnet_volume(shape) if magnet == "hole" else 0)
    assert integrals(mesh)[1] == pytest.approx(expected, rel=1e-5)
    assert angles(mesh).min() > 14


def test_every_boundary_lies_on_its_exact_curve():
    mesh = section(PAPER, 0.075)
    assert np.all(nodes_on(mesh, "base")[1] == 0)
    assert np.all(nodes_on(mesh, "axis")[0] == 0)
    r, z = nodes_on(mesh, "skin")
    dome = z > PAPER.H
    np.testing.assert_allclose(np.hypot(r[dome], z[dome] - PAPER.H), PAPER.R, rtol=1e-14)
    assert np.all(r[~dome] == PAPER.R)
    r, z = nodes_on(mesh, "magnet")
    a, b, rho = PAPER.magnet_diameter / 2, PAPER.magnet_height / 2, PAPER.magnet_edge_radius
    round_r, round_z = r - (a - rho), np.abs(z - PAPER.H) - (b - rho)
    fillet = (round_r > 0) & (round_z > 0)
    assert np.count_nonzero(fillet) >= 6
    np.testing.assert_allclose(np.hypot(round_r, round_z)[fillet], rho, rtol=1e-12)
    assert np.all((r[~fillet] == a) | (np.abs(z[~fillet] - PAPER.H) == b))


@pytest.mark.parametrize("magnet", ["hole", "meshed", "none"])
def test_boundaries_are_complete_and_lengths_right(magnet):
    mesh = section(PAPER, 0.075, magnet=magnet)
    outer = [mesh.boundaries[name] for name in ("base", "axis", "skin")]
    if magnet == "hole":
        outer.append(mesh.boundaries["magnet"])
    np.testing.assert_array_equal(np.sort(np.concatenate(outer)), mesh.boundary_facets())
    if magnet == "meshed":
        sides = mesh.f2t[:, mesh.boundaries["magnet"]]
        assert np.all(np.isin(sides, mesh.subdomains["magnet"]).sum(axis=0) == 1)

    def length(name):
        return skfem.FacetBasis(mesh, skfem.ElementTriP2(), facets=mesh.boundaries[name], intorder=8).dx.sum()

    axis = PAPER.L - (PAPER.magnet_height if magnet == "hole" else 0)
    lengths = {"base": PAPER.R, "axis": axis, "skin": PAPER.H + math.pi / 2 * PAPER.R}
    if magnet != "none":
        a, h, rho = PAPER.magnet_diameter / 2, PAPER.magnet_height, PAPER.magnet_edge_radius
        lengths["magnet"] = 2 * a + h - 4 * rho + math.pi * rho
    assert {name: length(name) for name in mesh.boundaries} == pytest.approx(lengths, rel=1e-4)


def test_random_designs_are_well_shaped():
    rng = np.random.default_rng(3)
    smallest = []
    for shape in random_shapes(40, seed=2):
        size = rng.uniform(0.1, 0.2)
        mesh = section(shape, size, tip_size=size * 10 ** rng.uniform(-3, 0))
        smallest.append(angles(mesh).min(axis=0))
        assert smallest[-1].min() > 12
        assert mesh.nelements < 2500
        expected = beam_volume(shape) - magnet_volume(shape)
        assert integrals(mesh)[1] == pytest.approx(expected, rel=3e-5)
    assert np.quantile(np.concatenate(smallest), 0.01) > 25


@pytest.mark.parametrize("tip", [1e-2, 1e-4, 1e-7])
def test_tip_size_sets_the_edges_at_the_tip(tip):
    mesh = section(PAPER, 0.075, tip_size=tip)
    x = mesh.doflocs[0] + 1j * mesh.doflocs[1]
    away = np.abs(x[: mesh.nvertices] - 1j * PAPER.L)
    assert away.min() == 0
    assert 0.5 * tip < np.sort(away)[1] < 1.3 * tip
    ends = mesh.facets
    length = np.abs(x[ends[0]] - x[ends[1]])
    assert np.all(length < 2 * (tip + 0.3 * away[ends].min(axis=0)))
    assert mesh.nelements < 1500
    assert angles(mesh).min() > 15


def test_thin_layers_have_two_elements_across():
    for shape in EXTREMES.values():
        mesh = section(shape, 0.1)
        outer, core = (
            np.unique(mesh.facets[:, np.concatenate([mesh.boundaries[name] for name in names])])
            for names in (["base", "skin"], ["magnet"])
        )
        across = np.isin(mesh.facets, outer).any(axis=0) & np.isin(mesh.facets, core).any(axis=0)
        assert not across.any()


def test_a_wall_of_almost_no_height():
    mesh = section(Shape(1, 0.50625, 0, 0, 0), 0.1, magnet="hole")
    assert integrals(mesh)[1] == pytest.approx(beam_volume(Shape(1, 0.50625, 0, 0, 0)), rel=1e-5)
    assert "magnet" not in mesh.boundaries
    assert angles(mesh).min() > 15


@pytest.mark.parametrize("factor", [8.0, 1e-3, math.pi])
def test_similar_shapes_get_the_same_mesh(factor):
    one = section(PAPER, 0.075, tip_size=1e-3)
    other = section(PAPER.scaled(factor), factor * 0.075, tip_size=factor * 1e-3)
    np.testing.assert_array_equal(one.t, other.t)
    np.testing.assert_allclose(other.doflocs, factor * one.doflocs, rtol=0, atol=1e-11 * factor)


def test_a_request_gives_the_same_mesh_again_whatever_becomes_of_the_first():
    one = section(PAPER, 0.1)
    expected, triangles = one.doflocs.copy(), one.t.copy()
    one.doflocs[:], one.t[:] = 0, 0
    for _ in range(2):
        again = section(PAPER, 0.1)
        np.testing.assert_array_equal(again.doflocs, expected)
        np.testing.assert_array_equal(again.t, triangles)
        _triangulated.cache_clear()


def test_halving_the_size_makes_a_regular_family():
    sharp = Shape(1, 1.125, 0.5, 0.25, 0.0)
    counts = [section(sharp, size).nelements for size in (0.075, 0.0375)]
    assert counts[1] / counts[0] == pytest.approx(4, rel=0.2)


@pytest.mark.filterwarnings("error")
def test_coarsest_mesh_has_no_point_inside():
    mesh = section(Shape(1, 3, 0, 0, 0), 50)
    rim = np.unique(mesh.facets[:, mesh.boundary_facets()])
    np.testing.assert_array_equal(rim, np.arange(mesh.nvertices))


@pytest.mark.parametrize(
    ("size", "tip"), [(0.0, None), (-1.0, None), (math.nan, None), (0.1, 0.2), (0.1, 0.0), (0.1, math.nan)]
)
def test_bad_sizes_are_refused(size, tip):
    with pytest.raises(BadInput):
        section(PAPER, size, tip_size=tip)
