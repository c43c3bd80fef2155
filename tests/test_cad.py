"""Solids of the sensor against closed forms, and the files against the solids."""

import math
import subprocess
import sys
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from geometry import cad
from geometry.design import BadInput, Design, Shape

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


def read_3mf(path):
    """Vertices (mm) and faces by the specification's own names, without the library that wrote them."""
    root = ElementTree.fromstring(zipfile.ZipFile(path).read("3D/3dmodel.model"))
    assert root.attrib.get("unit", "millimeter") == "millimeter"
    vertices = [[float(v.attrib[k]) for k in "xyz"] for v in root.iter() if v.tag.endswith("}vertex")]
    faces = [[int(t.attrib[k]) for k in ("v1", "v2", "v3")] for t in root.iter() if t.tag.endswith("}triangle")]
    return trimesh.Trimesh(vertices, faces, process=False)


def test_import_is_instant():
    code = "import sys, geometry.cad, geometry.mold; sys.exit('build123d' in sys.modules or 'trimesh' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("design", DESIGNS, ids=str)
def test_volumes_are_exact(design):
    shape = design.shape
    assert cad.beam(design).volume == pytest.approx(cad.beam_volume(shape), rel=1e-9)
    if shape.has_magnet:
        assert cad.magnet(design).volume == pytest.approx(cad.magnet_volume(shape), rel=1e-9)
    exact = cad.beam_volume(shape) - cad.magnet_volume(shape)
    silicone = cad.silicone(design)
    assert silicone.volume == pytest.approx(exact, rel=1e-9)
    assert silicone.is_valid


def test_closed_forms_know_the_sphere_and_the_plain_cylinder():
    ball = Shape(8, 4, 4, 4, 2)
    assert cad.magnet_volume(ball) == pytest.approx(4 / 3 * math.pi * 8, rel=1e-14)
    assert cad.beam_volume(ball) == pytest.approx(2 / 3 * math.pi * 64, rel=1e-14)
    assert cad.magnet_volume(Shape(8, 9, 4, 2, 0)) == pytest.approx(8 * math.pi, rel=1e-14)
    assert cad.magnet_volume(ball.scaled(3)) == pytest.approx(27 * cad.magnet_volume(ball), rel=1e-14)
    assert cad.magnet_volume(ball.without_magnet()) == 0


def test_parts_lie_in_the_sensors_frame():
    design = Design(D=10, L=14)
    box = cad.beam(design).bounding_box(optimal=True)
    assert tuple(box.min) == pytest.approx((-5, -5, 0), abs=1e-6)
    assert tuple(box.max) == pytest.approx((5, 5, 14), abs=1e-6)
    assert tuple(cad.magnet(design).center()) == pytest.approx((0, 0, design.H), abs=1e-9)


def test_no_magnet():
    design = Design(**BARE)
    with pytest.raises(BadInput, match="magnet_diameter must be positive"):
        cad.magnet(design)
    assert cad.silicone(design).volume == pytest.approx(cad.beam_volume(design.shape), rel=1e-9)


def test_overlap_and_cut():
    beam, magnet = cad.beam(Design()), cad.magnet(Design())
    assert cad.overlap(beam, magnet) == pytest.approx(magnet.volume, rel=1e-9)
    assert cad.overlap(cad.silicone(Design()), magnet) == 0
    with pytest.raises(RuntimeError, match="one solid"):
        cad.cut(magnet, beam)


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

    solids = {"silicone": cad.silicone(design), "magnet": cad.magnet(design)}
    records = cad.export(solids, tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(f"{n}.{s}" for n in solids for s in cad.FORMATS)
    for record in records:
        stl = trimesh.load_mesh(tmp_path / record.file)
        assert stl.is_volume
        assert record.watertight
        assert len(stl.faces) == record.triangles
        assert stl.volume == pytest.approx(record.stl_volume_mm3)
        assert stl.volume == pytest.approx(solids[record.name].volume, rel=1e-3)
        assert record.relative_error == pytest.approx(stl.volume / record.volume_mm3 - 1, abs=1e-12)
        step = bd.import_step(tmp_path / f"{record.name}.step")
        assert step.volume == pytest.approx(record.volume_mm3, rel=1e-9)
        printed = read_3mf(tmp_path / f"{record.name}.3mf")
        assert printed.is_volume
        assert printed.volume == pytest.approx(stl.volume, rel=1e-6)
        assert np.allclose(printed.bounds, stl.bounds, rtol=1e-6)


def test_coarse_facets_are_refined_or_refused(tmp_path):
    beam = {"beam": cad.beam(Design())}
    (record,) = cad.export(beam, tmp_path, tolerance=0.1, angular=0.3)
    assert abs(record.relative_error) <= 1e-3
    before = (tmp_path / "beam.stl").read_bytes()
    fresh = {"beam": cad.beam(Design())}
    with pytest.raises(RuntimeError, match="make angular finer"):
        cad.export(fresh, tmp_path, tolerance=1.0, angular=3.0)
    assert (tmp_path / "beam.stl").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 3


def test_failures_leave_nothing_behind(tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError):
        cad.export({"magnet": cad.magnet(Design())}, tmp_path / "absent")

    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(cad, "_write_3mf", full)
    with pytest.raises(OSError, match="no space"):
        cad.export({"magnet": cad.magnet(Design())}, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_open_surface_is_refused(tmp_path, monkeypatch):
    closed = cad.triangulated

    def holed(*arguments):
        mesh = closed(*arguments)
        mesh.update_faces(np.arange(len(mesh.faces)) > 0)
        return mesh

    monkeypatch.setattr(cad, "triangulated", holed)
    with pytest.raises(RuntimeError, match="not watertight"):
        cad.export({"magnet": cad.magnet(Design())}, tmp_path)
    assert list(tmp_path.iterdir()) == []
