"""The tetrahedral mesh lies on the exact surfaces, conforms at the magnet and is symmetric."""

import math

import numpy as np
import pytest
from skfem import MeshTet1, MeshTet2

from geometry.design import BadInput, Shape
from geometry.mesh import SOLID_GROWTH, tetrahedra
from geometry.meshing.mesh_quality import determinants, quality
from geometry.section import section

PAPER = Shape(8, 9, 4, 2, 0.1)
TOUCH = 1e-9


@pytest.fixture(scope="module")
def half():
    return tetrahedra(PAPER, 1.2)


@pytest.fixture(scope="module")
def hole():
    return tetrahedra(PAPER.scaled(1 / 8), 1.2 / 8, magnet="hole")


def nodes_on(mesh, name):
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


def test_volumes_and_counts(half):
    found = check_quality(half, PAPER)
    assert found["cells"] == half.nelements == sum(len(part) for part in half.subdomains.values())
    assert 1000 < found["cells"] < 20000
    assert set(found["volumes"]) == {"silicone", "magnet"}
    assert sum(found["volumes"].values()) == pytest.approx(math.pi * 16 * (5 + 8 / 3) / 2, rel=1e-5)


# cells at the smallest fillet of the magnet are 50 times as long around the axis as across it
@pytest.mark.parametrize(("edge_radius", "least_shape"), [(0.0, 0.07), (0.02, 0.018), (0.1, 0.07), (0.9, 0.07)])
def test_volumes_of_the_coarsest_mesh(edge_radius, least_shape):
    shape = Shape(8, 9, 4, 2, edge_radius)
    check_quality(tetrahedra(shape, 2.0), shape, least_shape=least_shape)


def test_vertices_lie_on_the_exact_surfaces_and_facets_close_to_them(half):
    assert np.array_equal(np.unique(nodes_on(half, "base")[2]), [0])
    assert np.array_equal(np.unique(nodes_on(half, "symmetry")[1]), [0])
    for name, distance in (("skin", skin_distance), ("magnet", magnet_distance)):
        corners = half.doflocs[:, np.unique(half.facets[:, half.boundaries[name]])]
        assert np.abs(distance(corners, PAPER)).max() < TOUCH
    # a quadratic arc over the angle t misses its circle by some t^4 / 400 of the radius
    assert np.abs(skin_distance(nodes_on(half, "skin"), PAPER)).max() < 1e-4 * PAPER.R
    assert quality(half, PAPER)["gap"] < 0.2 * PAPER.magnet_edge_radius
    assert half.doflocs[2].min() == 0
    assert half.doflocs[1].min() >= -TOUCH
    assert half.doflocs[:, half.doflocs[2].argmax()] == pytest.approx([0, 0, PAPER.L], abs=1e-12)


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


def test_scaled_hole(half, hole):
    shape = PAPER.scaled(1 / 8)
    found = check_quality(hole, shape)
    assert set(hole.subdomains) == {"silicone"}
    assert found["volumes"]["silicone"] * 512 == pytest.approx(quality(half, PAPER)["volumes"]["silicone"], rel=1e-5)
    assert (
        np.abs(magnet_distance(hole.p[:, np.unique(hole.facets[:, hole.boundaries["magnet"]])], shape)).max() < 1e-9
    )
    covered = np.concatenate(list(hole.boundaries.values()))
    assert np.array_equal(np.sort(covered), np.sort(hole.boundary_facets()))
    assert np.array_equal(np.unique(hole.t), np.arange(hole.nvertices))


def test_whole_body_is_closed():
    mesh = tetrahedra(PAPER, 2.0, half=False, magnet="none")
    assert set(mesh.boundaries) == {"base", "skin"}
    found = check_quality(mesh, PAPER.without_magnet())
    assert found["volumes"]["silicone"] == pytest.approx(math.pi * 16 * (5 + 8 / 3), rel=1e-5)


def test_sharp_magnet_and_low_beam():
    shape = Shape(8, 6, 4, 2, 0)
    mesh = tetrahedra(shape, 1.5, magnet="hole", tip_size=0.6)
    check_quality(mesh, shape)
    nodes = nodes_on(mesh, "magnet")
    rim = (np.hypot(nodes[0], nodes[1]) > 2 - 1e-3) & (np.abs(np.abs(nodes[2] - 2) - 1) < 1e-4)
    assert rim.sum() > 20
    assert np.abs(magnet_distance(nodes, shape)).max() < 1e-3


@pytest.mark.parametrize("half", [True, False])
def test_the_mesh_is_its_own_mirror_image(half):
    x = tetrahedra(PAPER, 1.2, half=half).doflocs
    for side in (0,) if half else (0, 1):
        mirrored = x.copy()
        mirrored[side] *= -1
        assert len(np.unique(np.round(np.hstack([x, mirrored]), 9) + 0.0, axis=1).T) == x.shape[1]


def test_equal_requests_get_equal_meshes_and_similar_shapes_similar_ones():
    """One section serves all sizes of a shape, so that the meshes differ by rounding only."""
    one, again, small = tetrahedra(PAPER, 1.2), tetrahedra(PAPER, 1.2), tetrahedra(PAPER.scaled(0.3), 0.36)
    np.testing.assert_array_equal(one.doflocs, again.doflocs)
    np.testing.assert_array_equal(one.t, small.t)
    np.testing.assert_allclose(small.doflocs, 0.3 * one.doflocs, rtol=0, atol=1e-13)


def test_all_cells_are_positive_and_their_section_is_that_of_the_section_mesher(half):
    assert determinants(half).min() > 0
    plane = section(PAPER, 1.2, tip_size=0.6, magnet="meshed", growth=SOLID_GROWTH)
    on = half.doflocs[1, : half.nvertices] == 0
    front = half.doflocs[:, : half.nvertices][:, on & (half.doflocs[0, : half.nvertices] > -TOUCH)]
    assert sorted(map(tuple, np.round(front[[0, 2]].T, 9))) == sorted(
        map(tuple, np.round(plane.doflocs[:, : plane.nvertices].T, 9))
    )


BAD = (0.0, -1.0, math.nan, math.inf)


@pytest.mark.parametrize(
    ("shape", "size", "options", "text"),
    [
        *((PAPER, size, {}, "size must be") for size in BAD),
        *((PAPER, 1.0, {"tip_size": size}, "tip_size must be") for size in BAD),
        *((PAPER, 1.0, {"rim": rim}, "rim") for rim in ((0.1, 0.2), (4.0, 0.2), (math.nan, 0.2), (1.0, -1.0))),
        (PAPER.without_magnet(), 1.0, {}, "no magnet"),
        (Shape(8, 9, 4, 9.8, 0), 1.0, {}, "must lie inside the beam"),
    ],
)
def test_bad_input_is_a_sentence(shape, size, options, text):
    with pytest.raises(BadInput, match=text):
        tetrahedra(shape, size, **options)


@pytest.mark.parametrize("half", [True, False])
def test_edges_follow_the_rim(half):
    """Edges form a closed chain (open in half a beam) with all nodes on the ring; no facet crosses the ring."""
    radius, size = 1.4, 0.4
    mesh = tetrahedra(PAPER, 2.0, half=half, magnet="hole", rim=(radius, size))
    # cells at the rim are graded: with straight edges they have 0.05
    check_quality(mesh, PAPER, least_jacobian=0.025)
    facets = mesh.facets[:, mesh.boundaries["skin"]]
    facets = facets[:, mesh.p[2, facets].min(axis=0) > PAPER.H]
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
    assert np.hypot(middle[0], middle[1]) == pytest.approx(radius, abs=1e-4 * PAPER.R)
    # as many edges as there are sectors
    assert len(chain) == (1 if half else 2) * 6


def test_the_base_of_cells_much_smaller_than_the_beam():
    """Finding a facet's points in such cells, as scikit-fem does, fails to end within its tolerance."""
    small = MeshTet1().scaled(1e-5).translated((0.4, 0.0, 0.0))
    mesh = MeshTet2.from_mesh(small).with_boundaries({"base": lambda x: x[2] < 1e-9})
    mesh = mesh.with_subdomains({"silicone": np.arange(mesh.nelements)})
    found = quality(mesh, Shape(1, 10, 0, 0, 0))
    assert found["base_error"] == pytest.approx(1e-10 / (math.pi * 0.25) - 1, rel=1e-12)
    assert found["volumes"]["silicone"] == pytest.approx(1e-15, rel=1e-9)


def test_the_verb_cache_reports_and_clears_the_meshes_of_earlier_versions(monkeypatch, tmp_path, run, strict):
    monkeypatch.setenv("MAGTIP_CACHE", str(tmp_path / "meshes"))
    assert strict(run("cache", "--json")[1])[0]["files"] == 0
    (tmp_path / "meshes").mkdir()
    for name in ("a.mesh", "b.mesh", "notes.txt"):
        (tmp_path / "meshes" / name).write_bytes(bytes(1000))
    (record,) = strict(run("cache", "--json")[1])
    assert record == {"folder": str(tmp_path / "meshes"), "files": 2, "size_MB": 0.002, "limit_MB": 0}
    status, out, _ = run("cache", "--clear", "--json")
    assert (status, strict(out)[0]["files"]) == (0, 0)
    assert [file.name for file in (tmp_path / "meshes").iterdir()] == ["notes.txt"]
    monkeypatch.setenv("MAGTIP_CACHE", "off")
    assert strict(run("cache", "--json")[1])[0]["folder"] == "off"
