"""Solids of the sensor against closed forms, and the files against the solids."""

import itertools
import math

import numpy as np
import pytest
import trimesh

from geometry import cad
from geometry.bad_input import MeshError
from geometry.design import BadInput, Design
from geometry.fabrication import solid_files

BARE = {"magnet_diameter": 0, "magnet_height": 0, "magnet_edge_radius": 0}
DESIGNS = [
    Design(),
    Design(magnet_edge_radius=0.0),
    Design(magnet_height=4, magnet_edge_radius=2),
    Design(magnet_diameter=2, magnet_edge_radius=1, magnet_height=3),
    Design(D=1, L=0.8, magnet_diameter=0.5, magnet_height=0.25, magnet_edge_radius=0.02),
    Design(D=50, L=25.001, **BARE),
    Design(D=50, L=1000, magnet_diameter=20, magnet_height=10, l0=50),
    Design(D=8, L=4 + 1e-6, **BARE),
]


def export(solids, folder, tolerance=solid_files.TOLERANCE):
    shapes = {name: (solid, solid_files.facets(name, solid, tolerance)) for name, solid in solids.items()}
    return solid_files.export(shapes, folder)


@pytest.mark.parametrize(
    "design", DESIGNS, ids=lambda design: f"D={design.D:g}, L={design.L:g}, edge {design.magnet_edge_radius:g}"
)
def test_volumes_are_exact(design):
    shape = design.shape
    assert cad.beam(design).volume == pytest.approx(cad.beam_volume(shape), rel=1e-12)
    if shape.has_magnet:
        assert cad.magnet(design).volume == pytest.approx(cad.magnet_volume(shape), rel=1e-12)
    exact = cad.beam_volume(shape) - cad.magnet_volume(shape)
    silicone = cad.silicone(design)
    assert silicone.volume == pytest.approx(exact, rel=1e-12)
    assert silicone.is_valid


def test_a_fillet_is_tangent_to_sides_that_lean():
    lean = [(0, 0, 0), (2, 0, 0.5), (3, 4, 0), (0, 4, 0)]
    (_, start, _), (_, end, centre) = cad.rounded(lean)[:2]
    assert math.dist(start, centre) == pytest.approx(0.5, rel=1e-14)
    assert math.dist(end, centre) == pytest.approx(0.5, rel=1e-14)
    assert start[1] == 0.0
    # the radius at the end of the fillet is normal to the side (1, 4)
    assert (end[0] - centre[0]) + 4 * (end[1] - centre[1]) == pytest.approx(0, abs=1e-14)
    assert cad.turned(lean).volume == pytest.approx(cad.turned_volume(lean), rel=1e-12)
    frustum = [(0, 0, 0), (2, 0, 0), (3, 4, 0), (0, 4, 0)]
    assert cad.turned_volume(frustum) == pytest.approx(math.pi * 4 / 3 * (4 + 6 + 9), rel=1e-15)


def test_overlap_and_cut():
    beam, magnet = cad.beam(Design()), cad.magnet(Design())
    assert cad.overlap(beam, magnet) == pytest.approx(magnet.volume, rel=1e-9)
    assert cad.overlap(cad.silicone(Design()), magnet) == 0
    with pytest.raises(MeshError, match="one solid"):
        cad.cut(magnet, beam)
    with pytest.raises(BadInput, match="magnet_diameter must be positive"):
        cad.magnet(Design(**BARE))


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 2.0, math.nan])
def test_impossible_tolerances_are_refused(tolerance, tmp_path):
    with pytest.raises(BadInput, match="tolerance must lie between 1e-05 and 1 mm"):
        export({"magnet": cad.magnet(Design())}, tmp_path, tolerance)


@pytest.mark.parametrize(
    "design",
    [
        Design(),
        Design(D=1, L=0.8, magnet_diameter=0.5, magnet_height=0.25, magnet_edge_radius=0.02),
        Design(D=50, L=30, magnet_diameter=42, magnet_height=9, magnet_edge_radius=3, l0=50),
    ],
    ids=["paper", "small", "thin walls"],
)
def test_export_reads_back(design, tmp_path):
    import build123d as bd

    solids = {"silicone": cad.silicone(design), "magnet <1> & more": cad.magnet(design)}
    records = export(solids, tmp_path, design.D / 2000)
    assert sorted(p.name for p in tmp_path.glob("[!.]*")) == sorted(
        f"{n}.{s}" for n in solids for s in ("step", "stl", "3mf")
    )
    for record in records:
        stl = trimesh.load_mesh(tmp_path / record["file"])
        assert stl.is_volume
        assert record["watertight"]
        assert len(stl.faces) == record["triangles"]
        assert stl.volume == pytest.approx(record["stl_volume_mm3"])
        assert stl.volume == pytest.approx(solids[record["name"]].volume, rel=1e-3)
        assert record["relative_error"] == pytest.approx(stl.volume / record["volume_mm3"] - 1, abs=1e-12)
        step = bd.import_step(tmp_path / f"{record['name']}.step")
        assert step.volume == pytest.approx(record["volume_mm3"], rel=1e-12)
        check_3mf(tmp_path / f"{record['name']}.3mf", record)


def check_3mf(path, record):
    """Read it by its reference library, without a warning."""
    from lib3mf import Lib3MF

    model = Lib3MF.Wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == Lib3MF.ModelUnit.MilliMeter
    found = model.GetMeshObjects()
    assert found.MoveNext()
    body = found.GetCurrentMeshObject()
    assert (body.GetName(), body.GetTriangleCount()) == (record["name"], record["triangles"])
    assert body.IsManifoldAndOriented()


def test_parts_of_a_plate_lie_apart(tmp_path):
    from lib3mf import Lib3MF

    meshes = {"magnet": solid_files.facets("magnet", cad.magnet(Design()))}
    meshes["beam"] = solid_files.facets("beam", cad.beam(Design()))
    (tmp_path / "plate.3mf").write_bytes(
        solid_files.plate({"magnet": (meshes["magnet"], 7), "beam": (meshes["beam"], 1)})
    )
    model = Lib3MF.Wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(tmp_path / "plate.3mf"))
    assert reader.GetWarningCount() == 0
    items, boxes, names = model.GetBuildItems(), [], []
    while items.MoveNext():
        item = items.GetCurrent()
        names.append(item.GetObjectResource().GetName())
        boxes.append(meshes[names[-1]].bounds[:, :2] + list(item.GetObjectTransform().Fields[3])[:2])
    assert sorted(names) == ["beam", *["magnet"] * 7]
    for one, other in itertools.combinations(boxes, 2):
        assert max(*(one[0] - other[1]), *(other[0] - one[1])) >= solid_files.PLATE_GAP - 1e-4


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
def test_facets_keep_the_tolerance(tolerance):
    design = Design()
    # angles do not bind: the tolerance alone decides
    corners = solid_files.triangulated(cad.beam(design), tolerance, 3.0).triangles
    share = np.array([(1, 1, 1), (3, 3, 0), (3, 0, 3), (0, 3, 3), (4, 1, 1), (1, 4, 1), (1, 1, 4)], dtype=float)
    points = np.einsum("pk,tkx->tpx", share / share.sum(axis=1, keepdims=True), corners).reshape(-1, 3)
    above = points[points[:, 2] > 1e-6]
    dome = np.hypot(np.hypot(above[:, 0], above[:, 1]), np.maximum(above[:, 2] - design.H, 0))
    deviation = np.abs(dome - design.R).max()
    assert tolerance / 20 < deviation <= 1.01 * tolerance


def test_coarse_facets_are_refined_or_refused(tmp_path, monkeypatch):
    (record,) = export({"beam": cad.beam(Design())}, tmp_path, 1.0)
    assert abs(record["relative_error"]) <= 1e-3
    before = (tmp_path / "beam.stl").read_bytes()
    coarse = solid_files.triangulated
    monkeypatch.setattr(solid_files, "triangulated", lambda solid, *_: coarse(solid, 1.0, 3.0))
    with pytest.raises(MeshError, match="make tolerance finer"):
        export({"beam": cad.beam(Design())}, tmp_path, 1.0)
    assert (tmp_path / "beam.stl").read_bytes() == before
    assert len(list(tmp_path.glob("[!.]*"))) == 3


def test_an_open_surface_is_refused(tmp_path, monkeypatch):
    closed = solid_files.triangulated

    def holed(*arguments):
        mesh = closed(*arguments)
        mesh.update_faces(np.arange(len(mesh.faces)) > 0)
        return mesh

    monkeypatch.setattr(solid_files, "triangulated", holed)
    with pytest.raises(MeshError, match="not watertight"):
        export({"magnet": cad.magnet(Design())}, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_assembly_keeps_names_colours_and_volumes(tmp_path):
    import build123d as bd

    design = Design()
    parts = {"silicone": (cad.silicone(design), "wheat"), "magnet": (cad.magnet(design), "silver")}
    (tmp_path / "a.step").write_bytes(solid_files.step(solid_files.assembly("sensor", parts)))
    read = bd.import_step(tmp_path / "a.step")
    assert read.label == "sensor"
    assert [child.label for child in read.children] == list(parts)
    for child, (solid, colour) in zip(read.children, parts.values(), strict=True):
        assert child.volume == pytest.approx(solid.volume, rel=1e-12)
        assert tuple(child.color) == pytest.approx(tuple(bd.Color(colour)), abs=1e-3)
