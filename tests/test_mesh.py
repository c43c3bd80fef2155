"""The tetrahedral mesh lies on the exact surfaces and conforms at the magnet; fTetWild gets no bad input."""

import dataclasses
import math

import numpy as np
import pytest
from skfem import MeshTet1, MeshTet2

from geometry import cad
from geometry import mesh as meshing
from geometry.bad_input import MeshError
from geometry.design import BadInput, Shape
from geometry.mesh import tetrahedra
from geometry.meshing import curved_mesh, edge_lengths, mesh_cache, surface_triangulation
from geometry.meshing.curved_mesh import radius_ratios
from geometry.meshing.edge_lengths import Sizes
from geometry.meshing.mesh_quality import quality

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


def check_quality(mesh, shape, least_jacobian=0.05):
    found = quality(mesh, shape)
    assert max(map(abs, found.volume_errors.values())) < 1e-5
    assert abs(found.base_error) < 1e-4
    assert found.least_jacobian > least_jacobian
    assert found.least_shape > 0.02
    return found


def test_volumes_and_counts(half):
    found = check_quality(half, PAPER)
    assert found.cells == half.nelements == sum(len(part) for part in half.subdomains.values())
    assert 1000 < found.cells < 10000
    assert set(found.volumes) == {"silicone", "magnet"}
    assert sum(found.volumes.values()) == pytest.approx(math.pi * 16 * (5 + 8 / 3) / 2, rel=1e-5)


@pytest.mark.parametrize("edge_radius", [0.0, 0.02, 0.1, 0.9])
def test_volumes_of_the_coarsest_mesh(edge_radius):
    shape = Shape(8, 9, 4, 2, edge_radius)
    check_quality(tetrahedra(shape, 2.0), shape)


def test_vertices_lie_on_the_exact_surfaces_and_facets_close_to_them(half):
    assert np.array_equal(np.unique(nodes_on(half, "base")[2]), [0])
    assert np.array_equal(np.unique(nodes_on(half, "symmetry")[1]), [0])
    for name, distance in (("skin", skin_distance), ("magnet", magnet_distance)):
        corners = half.doflocs[:, np.unique(half.facets[:, half.boundaries[name]])]
        assert np.abs(distance(corners, PAPER)).max() < TOUCH
    # a quadratic arc over the angle t misses its circle by some t^4 / 400 of the radius
    assert np.abs(skin_distance(nodes_on(half, "skin"), PAPER)).max() < 1e-4 * PAPER.R
    assert quality(half, PAPER).gap < 0.2 * PAPER.magnet_edge_radius
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
    assert found.volumes["silicone"] * 512 == pytest.approx(quality(half, PAPER).volumes["silicone"], rel=1e-5)
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
    assert found.volumes["silicone"] == pytest.approx(math.pi * 16 * (5 + 8 / 3), rel=1e-5)


def test_sharp_magnet_and_low_beam():
    shape = Shape(8, 6, 4, 2, 0)
    mesh = tetrahedra(shape, 1.5, magnet="hole", tip_size=0.6)
    check_quality(mesh, shape)
    nodes = nodes_on(mesh, "magnet")
    rim = (np.hypot(nodes[0], nodes[1]) > 2 - 1e-3) & (np.abs(np.abs(nodes[2] - 2) - 1) < 1e-4)
    assert rim.sum() > 20
    assert np.abs(magnet_distance(nodes, shape)).max() < 1e-3


@pytest.mark.parametrize("half", [True, False])
@pytest.mark.parametrize(
    "shape", [PAPER, Shape(8, 4.2, 0, 0, 0), Shape(8, 160, 4, 2, 0), Shape(8, 9, 2, 2, 1), Shape(8, 9, 4, 2, 1)]
)
def test_surfaces_are_closed_and_outward(shape, half):
    sizes = Sizes.of(shape, 1.0, None)
    parts = [surface_triangulation.body(sizes, half)] + (
        [surface_triangulation.magnet(sizes, half)] if shape.has_magnet else []
    )
    right = [cad.beam_volume(shape), cad.magnet_volume(shape)]
    for (points, faces), volume in zip(parts, right, strict=False):
        surface_triangulation.check_surface(points, faces, surface_triangulation.envelope(sizes), shape.wall)
        corners = points[faces]
        six = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        assert 0.85 < six / 6 / volume * (2 if half else 1) < 1
        inside = surface_triangulation.winding(np.array([[0.1, 0.3, shape.H + 0.1], [0.0, 0.5, -0.1]]), points, faces)
        assert inside == pytest.approx([1, 0], abs=1e-9)


def test_background_grid_is_filled_by_positive_tetrahedra():
    sizes = Sizes.of(PAPER, 1.0, None)
    points, tets, values = edge_lengths.background(sizes, True)
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    volumes = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(np.prod(np.ptp(points, axis=0)))
    assert 0 < values.min() <= values.max() <= sizes.bulk


@pytest.mark.parametrize(("half", "radius"), [(True, 1.4), (True, 3.4), (False, 1.4)])
def test_background_around_a_rim(half, radius):
    sizes = Sizes.of(PAPER, 1.0, None, (radius, 0.1))
    points, tets, values = edge_lengths.background(sizes, half)
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    volumes = np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)) / 6
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(np.prod(np.ptp(points, axis=0)))
    assert values.min() == pytest.approx(0.1, rel=0.01)


def test_bad_surfaces_are_refused():
    points, faces = surface_triangulation.body(Sizes.of(PAPER, 2.0, None), True)
    surface_triangulation.check_surface(points, faces, 0.01, 1.0)
    broken = points.copy()
    broken[3, 1] = np.nan
    for bad_points, bad_faces, epsilon, text in (
        (points, faces[1:], 0.01, "not closed"),
        (points, faces[:, ::-1], 0.01, "outward"),
        (points, np.where(faces == 0, -1, faces), 0.01, "must number points"),
        (points, faces[:0], 0.01, "shape"),
        (broken, faces, 0.01, "finite"),
        (points, faces, 0.0, "epsilon must be positive"),
        (points, faces, math.nan, "epsilon must be positive"),
        (points, faces, 0.6, "less than half the wall"),
    ):
        with pytest.raises(ValueError, match=text):
            surface_triangulation.check_surface(bad_points, bad_faces, epsilon, 1.0)


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf])
def test_bad_sizes_are_refused(size):
    with pytest.raises(BadInput, match="size must be"):
        tetrahedra(PAPER, size)
    with pytest.raises(BadInput, match="tip_size must be"):
        tetrahedra(PAPER, 1.0, tip_size=size)


def test_no_magnet_to_mesh():
    with pytest.raises(BadInput, match="no magnet"):
        tetrahedra(PAPER.without_magnet(), 1.0)
    with pytest.raises(BadInput, match="must lie inside the beam"):
        tetrahedra(Shape(8, 9, 4, 9.8, 0), 1.0)


def test_a_folded_mesh_is_made_again_with_smaller_sizes(monkeypatch):
    tried = []
    straight = meshing.MeshTet1()
    monkeypatch.setattr(meshing, "_raw", lambda sizes, half, timeout: tried.append(sizes.bulk) or straight)
    monkeypatch.setattr(curved_mesh, "curved", lambda mesh, sizes, true: None)
    with pytest.raises(MeshError, match="has folded or flat cells"):
        tetrahedra(PAPER, 1.0)
    assert tried == pytest.approx([1.0, 0.97, 0.94, 0.9, 0.8, 0.7])


@pytest.mark.parametrize("push", [0.98, 1.02, 1.3])
def test_flat_and_inverted_cells_are_mended_by_their_free_vertices(push):
    """The middle vertex of a cube is pushed to a side and through it: its cells are flat, then inverted (J <= 0)."""
    mesh = MeshTet1.init_tensor(*3 * [np.linspace(1, 3, 3)])
    apart = {name: np.zeros(27, dtype=bool) for name in ("base", "skin")}
    whole = curved_mesh.shapes(mesh.p[:, mesh.t])
    flip = mesh.t.copy()
    flip[:, whole < 0] = flip[:, whole < 0][[0, 2, 1, 3]]
    (middle,) = np.flatnonzero((mesh.p == 2).all(axis=0))
    p = mesh.p.copy()
    p[0, middle] += push
    assert curved_mesh.shapes(p[:, flip]).min() < curved_mesh.LEAST_SHAPE
    mended = curved_mesh.repair_flat_cells(p, flip, apart)
    assert curved_mesh.shapes(mended[:, flip]).min() > 3 * curved_mesh.LEAST_SHAPE
    # whatever is well shaped stays to the last bit
    assert curved_mesh.repair_flat_cells(mended, flip, apart) is mended


def test_mending_moves_nothing_on_the_surfaces(half):
    """Two vertices, inside and on the plane of symmetry, each put on a neighbour, move back; no other node moves."""
    mesh = MeshTet1(half.doflocs[:, : half.nvertices], half.t, _boundaries=half.boundaries)
    on = {name: np.isin(np.arange(mesh.nvertices), mesh.facets[:, part]) for name, part in mesh.boundaries.items()}
    held = on["base"] | on["skin"] | on["magnet"]
    p = mesh.p.copy()
    for free in (~held & ~on["symmetry"], ~held & on["symmetry"]):
        vertex = np.flatnonzero(free)[0]
        near = np.setdiff1d(mesh.t[:, (mesh.t == vertex).any(axis=0)], vertex)
        p[:, vertex] = p[:, near[np.linalg.norm(mesh.p[:, near] - mesh.p[:, [vertex]], axis=0).argmin()]]
    assert curved_mesh.shapes(p[:, mesh.t]).min() < curved_mesh.LEAST_SHAPE
    mended = curved_mesh.repair_flat_cells(p, mesh.t, on)
    assert curved_mesh.shapes(mended[:, mesh.t]).min() > curved_mesh.LEAST_SHAPE
    assert (mended[:, held] == mesh.p[:, held]).all()
    assert np.abs(mended[1, on["symmetry"]]).max() == 0


def test_cells_with_a_wrong_volume_are_refused(half):
    """Cells with a wrong volume are refused, even if their facets enclose the exact volume."""
    cells = curved_mesh.volumes(half)
    assert cells["magnet"] == pytest.approx(cad.magnet_volume(PAPER) / 2, rel=1e-5)
    straight = MeshTet1(
        half.doflocs[:, : half.nvertices], half.t, _boundaries=half.boundaries, _subdomains=half.subdomains
    )
    # a cell of the magnet is called silicone: the facets of the interface stay
    magnet = straight.subdomains["magnet"]
    parts = {"magnet": magnet[1:], "silicone": np.append(straight.subdomains["silicone"], magnet[0])}
    sizes = Sizes.of(PAPER, 1.2, None)
    assert curved_mesh.curved(straight, sizes, PAPER) is not None
    assert curved_mesh.curved(dataclasses.replace(straight, _subdomains=parts), sizes, PAPER) is None


def test_straightening_mends_a_distorted_curved_cell(half, monkeypatch):
    monkeypatch.setattr(curved_mesh, "LEAST_JACOBIAN", 0.4)
    straight = meshing.MeshTet1(
        half.doflocs[:, : half.nvertices], half.t, _boundaries=half.boundaries, _subdomains=half.subdomains
    )
    relaxed = curved_mesh.curved(straight, Sizes.of(PAPER, 1.2, None), PAPER)
    assert quality(half, PAPER).least_jacobian < 0.4 <= quality(relaxed, PAPER).least_jacobian


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
    assert np.hypot(middle[0], middle[1]) == pytest.approx(radius, abs=TOUCH)
    assert len(chain) == pytest.approx((1 if half else 2) * math.pi * radius / size, rel=0.25)


@pytest.mark.parametrize("rim", [(0.1, 0.2), (4.0, 0.2), (math.nan, 0.2), (1.0, -1.0), (1.0, math.nan)])
def test_bad_rims(rim):
    with pytest.raises(BadInput, match="rim"):
        tetrahedra(PAPER, 1.0, rim=rim)


def test_a_mesh_that_misses_its_rim_is_never_returned(half):
    straight = meshing.MeshTet1(half.doflocs[:, : half.nvertices], half.t, _boundaries=half.boundaries)
    assert curved_mesh.curved(straight, Sizes.of(PAPER, 1.2, None, (1.5, 0.2)), PAPER) is None


def test_a_child_that_dies_or_hangs(monkeypatch, tmp_path):
    child = tmp_path / "child.py"
    monkeypatch.setattr(meshing, "CHILD", child)
    child.write_text("import ctypes; ctypes.string_at(0)")
    with mesh_cache.bypassed(), pytest.raises(MeshError, match="failed with exit code"):
        tetrahedra(PAPER, 2.0)
    child.write_text("raise ValueError('of the child')")
    with mesh_cache.bypassed(), pytest.raises(MeshError, match="of the child"):
        tetrahedra(PAPER, 2.0)
    child.write_text("import time; time.sleep(60)")
    with mesh_cache.bypassed(), pytest.raises(MeshError, match=r"within 0\.5 s"):
        tetrahedra(PAPER, 2.0, timeout=0.5)


def test_a_collapsed_cell_has_no_shape():
    corners = np.array([[0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 0.0]])[:, :, None]
    assert radius_ratios(corners) == 0


def test_the_base_of_cells_much_smaller_than_the_beam():
    """Finding a facet's points in such cells, as scikit-fem does, fails to end within its tolerance."""
    small = MeshTet1().scaled(1e-5).translated((0.4, 0.0, 0.0))
    mesh = MeshTet2.from_mesh(small).with_boundaries({"base": lambda x: x[2] < 1e-9})
    mesh = mesh.with_subdomains({"silicone": np.arange(mesh.nelements)})
    found = quality(mesh, Shape(1, 10, 0, 0, 0))
    assert found.base_error == pytest.approx(1e-10 / (math.pi * 0.25) - 1, rel=1e-12)
    assert found.volumes["silicone"] == pytest.approx(1e-15, rel=1e-9)
