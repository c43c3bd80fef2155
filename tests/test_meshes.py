"""Meshes of the section and of tetrahedra: exact surfaces, good shapes, symmetry, the same at every scale."""

import math

import numpy as np
import pytest
import skfem

from geometry.cad import beam_volume, magnet_volume
from geometry.design import BadInput, Shape, paper
from geometry.mesh import SOLID_GROWTH, tetrahedra
from geometry.meshing.mesh_quality import determinants, quality
from geometry.section import PLACE, section

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


def volume_of(mesh, elements=None):
    """Volume of revolution."""
    basis = skfem.Basis(mesh, skfem.ElementTriP2(), intorder=6, elements=elements)
    return 2 * math.pi * (basis.global_coordinates()[0] * basis.dx).sum()


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
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(name, magnet):
    shape = EXTREMES[name]
    mesh = section(shape, 0.1, magnet=magnet)
    expected = beam_volume(shape) - (magnet_volume(shape) if magnet == "hole" else 0)
    assert volume_of(mesh) == pytest.approx(expected, rel=1e-5)
    assert angles(mesh).min() > 14


def test_every_boundary_lies_on_its_exact_curve():
    mesh = section(PAPER, 0.075)
    assert np.all(nodes_on(mesh, "base")[1] == 0)
    assert np.all(nodes_on(mesh, "axis")[0] == 0)
    for name, distance in (("skin", skin_distance), ("magnet", magnet_distance)):
        r, z = nodes_on(mesh, name)
        np.testing.assert_allclose(distance((r, 0, z), PAPER), 0, atol=1e-14)


@pytest.mark.parametrize("magnet", ["hole", "meshed", "none"])
def test_boundaries_are_complete(magnet):
    mesh = section(PAPER, 0.075, magnet=magnet)
    outer = [mesh.boundaries[name] for name in ("base", "axis", "skin")]
    if magnet == "hole":
        outer.append(mesh.boundaries["magnet"])
    np.testing.assert_array_equal(np.sort(np.concatenate(outer)), mesh.boundary_facets())
    if magnet == "meshed":
        sides = mesh.f2t[:, mesh.boundaries["magnet"]]
        assert np.all(np.isin(sides, mesh.subdomains["magnet"]).sum(axis=0) == 1)
        assert volume_of(mesh, mesh.subdomains["magnet"]) == pytest.approx(magnet_volume(PAPER), rel=1e-5)


def test_the_coarsest_mesh_has_no_point_inside():
    mesh = section(Shape(1, 3, 0, 0, 0), 50)
    rim = np.unique(mesh.facets[:, mesh.boundary_facets()])
    np.testing.assert_array_equal(rim, np.arange(mesh.nvertices))


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
        assert volume_of(mesh) == pytest.approx(expected, rel=3e-5)
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


@pytest.mark.parametrize("factor", [8.0, 1e-3, math.pi])
def test_similar_shapes_get_the_same_mesh(factor):
    one = section(PAPER, 0.075, tip_size=1e-3)
    other = section(PAPER.scaled(factor), factor * 0.075, tip_size=factor * 1e-3)
    np.testing.assert_array_equal(one.t, other.t)
    np.testing.assert_allclose(other.doflocs, factor * one.doflocs, rtol=0, atol=1e-11 * factor)


def test_only_sides_at_the_rim_are_graded():
    rim = (0.3, 0.012)
    plain, glued = (section(PAPER, 0.16, tip_size=0.08, rim=rim, glued=way) for way in (False, True))
    assert plain.nelements > glued.nelements
    start, end = glued.facets
    middle = glued.doflocs[:, glued.nvertices :]
    length = np.linalg.norm(glued.p[:, end] - glued.p[:, start], axis=0)
    share = np.linalg.norm(middle - glued.p[:, start], axis=0) / length
    at = np.hypot(glued.p[0] - rim[0], glued.p[1] - PAPER.H - math.sqrt(0.25 - rim[0] ** 2)) < 1e-9
    assert np.count_nonzero(at) == 1
    assert share[at[start]] == pytest.approx(PLACE, abs=0.002)
    assert share[at[end]] == pytest.approx(1 - PLACE, abs=0.002)
    assert share[~at[start] & ~at[end]] == pytest.approx(0.5, abs=0.01)


SENSOR = Shape(8, 9, 4, 2, 0.1)
TOUCH = 1e-9


@pytest.fixture(scope="module")
def half():
    return tetrahedra(SENSOR, 1.2)


def solid_nodes(mesh, name):
    """Coordinates (3, n) of the vertices and mid-edge nodes of a boundary, found through the cells' edges."""
    corners = np.unique(mesh.facets[:, mesh.boundaries[name]])
    facets = {tuple(sorted(f)) for f in mesh.facets[:, mesh.boundaries[name]].T}
    pairs = {pair for a, b, c in facets for pair in ((a, b), (a, c), (b, c))}
    edges = [k for k, edge in enumerate(mesh.edges.T) if tuple(sorted(edge)) in pairs]
    return mesh.doflocs[:, np.concatenate([corners, mesh.nvertices + np.array(edges)])]


def magnet_distance(x, shape):
    """Signed distance from the rounded cylinder, by the formula of a rounded box in (r, z)."""
    rho = shape.magnet_edge_radius
    dr = np.hypot(x[0], x[1]) - shape.magnet_diameter / 2 + rho
    dz = np.abs(x[2] - shape.H) - shape.magnet_height / 2 + rho
    return np.hypot(np.maximum(dr, 0), np.maximum(dz, 0)) + np.minimum(np.maximum(dr, dz), 0) - rho


def skin_distance(x, shape):
    return np.hypot(np.hypot(x[0], x[1]), np.maximum(x[2] - shape.H, 0)) - shape.R


def check_quality(mesh, shape, least_jacobian=0.05, least_shape=0.07):
    found = quality(mesh, shape)
    assert max(map(abs, found["volume_errors"].values())) < 1e-5
    assert abs(found["base_error"]) < 1e-4
    assert found["least_jacobian"] > least_jacobian
    assert found["least_shape"] > least_shape
    return found


# cells at the smallest fillet of the magnet are 50 times as long around the axis as across it
@pytest.mark.parametrize(("edge_radius", "least_shape"), [(0.0, 0.07), (0.02, 0.018), (0.1, 0.07), (0.9, 0.07)])
def test_volumes_of_the_coarsest_mesh(edge_radius, least_shape):
    shape = Shape(8, 9, 4, 2, edge_radius)
    check_quality(tetrahedra(shape, 2.0), shape, least_shape=least_shape)


def test_vertices_lie_on_the_exact_surfaces_and_facets_close_to_them(half):
    assert np.array_equal(np.unique(solid_nodes(half, "base")[2]), [0])
    assert np.array_equal(np.unique(solid_nodes(half, "symmetry")[1]), [0])
    for name, distance in (("skin", skin_distance), ("magnet", magnet_distance)):
        corners = half.doflocs[:, np.unique(half.facets[:, half.boundaries[name]])]
        assert np.abs(distance(corners, SENSOR)).max() < TOUCH
    # a quadratic arc over the angle t misses its circle by some t^4 / 400 of the radius
    assert np.abs(skin_distance(solid_nodes(half, "skin"), SENSOR)).max() < 1e-4 * SENSOR.R
    assert quality(half, SENSOR)["gap"] < 0.2 * SENSOR.magnet_edge_radius
    assert half.doflocs[2].min() == 0
    assert half.doflocs[1].min() >= -TOUCH
    assert half.doflocs[:, half.doflocs[2].argmax()] == pytest.approx([0, 0, SENSOR.L], abs=1e-12)


def test_interface_conforms_and_boundaries_cover(half):
    cells = np.zeros(half.nelements, dtype=int)
    cells[half.subdomains["magnet"]] = 1
    pairs = cells[half.f2t[:, half.boundaries["magnet"]]]
    assert np.array_equal(np.sort(pairs, axis=0), np.tile([[0], [1]], pairs.shape[1]))
    inner = np.flatnonzero(half.f2t[1] >= 0)
    change = inner[cells[half.f2t[0, inner]] != cells[half.f2t[1, inner]]]
    assert np.array_equal(change, np.sort(half.boundaries["magnet"]))
    outer = np.concatenate([half.boundaries[name] for name in ("base", "skin", "symmetry")])
    assert np.array_equal(np.sort(outer), np.sort(half.boundary_facets()))


@pytest.mark.parametrize("half", [True, False])
def test_the_mesh_is_its_own_mirror_image(half):
    x = tetrahedra(SENSOR, 1.2, half=half).doflocs
    for side in (0,) if half else (0, 1):
        mirrored = x.copy()
        mirrored[side] *= -1
        assert len(np.unique(np.round(np.hstack([x, mirrored]), 9) + 0.0, axis=1).T) == x.shape[1]


def test_equal_requests_get_equal_meshes_and_similar_shapes_similar_ones():
    """One section serves all sizes of a shape, so that the meshes differ by rounding only."""
    one, again, small = tetrahedra(SENSOR, 1.2), tetrahedra(SENSOR, 1.2), tetrahedra(SENSOR.scaled(0.3), 0.36)
    np.testing.assert_array_equal(one.doflocs, again.doflocs)
    np.testing.assert_array_equal(one.t, small.t)
    np.testing.assert_allclose(small.doflocs, 0.3 * one.doflocs, rtol=0, atol=1e-13)


def test_all_cells_are_positive_and_their_section_is_that_of_the_section_mesher(half):
    assert determinants(half).min() > 0
    plane = section(SENSOR, 1.2, tip_size=0.6, magnet="meshed", growth=SOLID_GROWTH)
    on = half.doflocs[1, : half.nvertices] == 0
    front = half.doflocs[:, : half.nvertices][:, on & (half.doflocs[0, : half.nvertices] > -TOUCH)]
    assert sorted(map(tuple, np.round(front[[0, 2]].T, 9))) == sorted(
        map(tuple, np.round(plane.doflocs[:, : plane.nvertices].T, 9))
    )


BAD = (0.0, -1.0, math.nan)


@pytest.mark.parametrize(
    ("mesher", "shape", "size", "options", "text"),
    [
        *((tetrahedra, SENSOR, size, {}, "size must be") for size in (*BAD, math.inf)),
        *((tetrahedra, SENSOR, 1.0, {"tip_size": size}, "tip_size must be") for size in (*BAD, math.inf)),
        *((tetrahedra, SENSOR, 1.0, {"rim": rim}, "rim") for rim in ((0.1, 0.2), (4.0, 0.2), (math.nan, 1), (1, -1))),
        (tetrahedra, SENSOR.without_magnet(), 1.0, {}, "no magnet"),
        (tetrahedra, Shape(8, 9, 4, 9.8, 0), 1.0, {}, "must lie inside the beam"),
        *((section, SENSOR, size, {}, "size must be") for size in BAD),
        *((section, SENSOR, 1.0, {"tip_size": size}, "tip_size must be") for size in (0.0, 2.0, math.nan)),
    ],
)
def test_sizes_and_shapes_without_a_mesh_are_refused(mesher, shape, size, options, text):
    with pytest.raises(BadInput, match=text):
        mesher(shape, size, **options)


@pytest.mark.parametrize("half", [True, False])
def test_edges_follow_the_rim(half):
    """Edges form a closed chain (open in half a beam) with all nodes on the ring; no facet crosses the ring."""
    radius, size = 1.4, 0.4
    mesh = tetrahedra(SENSOR, 2.0, half=half, magnet="hole", rim=(radius, size))
    # cells at the rim are graded: with straight edges they have 0.05
    check_quality(mesh, SENSOR, least_jacobian=0.025)
    facets = mesh.facets[:, mesh.boundaries["skin"]]
    facets = facets[:, mesh.p[2, facets].min(axis=0) > SENSOR.H]
    out = np.hypot(mesh.p[0], mesh.p[1])
    on = np.abs(out - radius) < TOUCH
    beyond = np.where(on, 0, np.sign(out - radius))[facets]
    assert (beyond.min(axis=0) * beyond.max(axis=0) >= 0).all()
    assert (np.abs(beyond).max(axis=0) > 0).all()
    pairs = {tuple(sorted(f[[i, k]])) for f in facets.T for i, k in ((0, 1), (0, 2), (1, 2))}
    chain = [k for k, edge in enumerate(mesh.edges.T) if on[edge].all() and tuple(sorted(edge)) in pairs]
    degree = np.bincount(mesh.edges[:, chain].ravel())
    assert np.array_equal(np.unique(degree[degree > 0]), [1, 2] if half else [2])
    assert np.count_nonzero(degree == 1) == (2 if half else 0)
    middle = mesh.doflocs[:, mesh.nvertices + np.array(chain)]
    assert np.hypot(middle[0], middle[1]) == pytest.approx(radius, abs=1e-4 * SENSOR.R)
    # as many edges as there are sectors
    assert len(chain) == (1 if half else 2) * 6
