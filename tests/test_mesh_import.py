"""Imported meshes keep their cells and regions, or are refused with the reason."""

import os
from dataclasses import replace

import meshio
import numpy as np
import pytest

from geometry import design_digest
from geometry.design import BadInput, Shape
from geometry.mesh import tetrahedra
from geometry.meshing import mesh_import
from geometry.meshing.mesh_quality import quality, with_exact_volumes
from studies.output import vtk_files

SHAPE = Shape(8, 6, 3, 2, 0.4)


@pytest.fixture(scope="module")
def own():
    return tetrahedra(SHAPE, 2.0)


@pytest.fixture(scope="module")
def arrays(own):
    """Nodes, and of each cell its nodes, its corners, and whether it is the magnet's."""
    number = np.zeros(own.nelements, dtype=np.int64)
    number[own.subdomains["magnet"]] = 1
    return own.doflocs.T, np.asarray(own.dofs.element_dofs).T, own.t.T, number


@pytest.fixture
def read(tmp_path):
    """Write cells to a file of the given ending and read it."""

    def through(ending, points, cells, shape=SHAPE, magnet="regions", **more):
        kind = {4: "tetra", 10: "tetra10"}[cells.shape[1]]
        file = tmp_path / f"mesh{ending}"
        extra = more.pop("blocks", [])
        meshio.Mesh(points, [(kind, cells), *extra], **more).write(file, "gmsh22" if ending == ".msh" else None)
        return mesh_import.read(file, shape, magnet)

    return through


def same_parts(one, other):
    assert one.subdomains.keys() == other.subdomains.keys()
    for name, cells in other.subdomains.items():
        np.testing.assert_array_equal(np.sort(one.subdomains[name]), np.sort(cells))
    assert {name: len(facets) for name, facets in one.boundaries.items()} == {
        name: len(facets) for name, facets in other.boundaries.items()
    }


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".inp", ".msh"])
def test_quadratic_cells_stay_as_they_are(own, arrays, read, ending):
    points, quadratic, *_ = arrays
    mesh = read(ending, points, quadratic)
    same_parts(mesh, own)
    one, other = quality(mesh, SHAPE), quality(own, SHAPE)
    assert one["volumes"] == pytest.approx(other["volumes"], rel=1e-9)
    assert one["least_jacobian"] == pytest.approx(other["least_jacobian"], rel=1e-6)


def test_linear_cells_are_curved(own, arrays, read):
    points, _, linear, *_ = arrays
    mesh = read(".msh", points[: own.nvertices], linear)
    same_parts(mesh, own)
    found = quality(mesh, SHAPE)
    assert max(map(abs, found["volume_errors"].values())) < 1e-6
    assert found["gap"] < 0.2 * SHAPE.magnet_edge_radius


def test_cells_of_either_sense(own, arrays, read):
    points, quadratic, *_ = arrays
    turned = quadratic.copy()
    turned[::2] = turned[::2][:, [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]]
    assert quality(read(".vtu", points, turned), SHAPE)["least_jacobian"] > 0.05


def test_names_of_regions(own, arrays, read):
    points, _, linear, number = arrays
    p = points[: own.nvertices]
    sets = {"Silicone": [np.flatnonzero(number == 0)], "MAGNET": [np.flatnonzero(number == 1)], "all": [number >= 0]}
    same_parts(read(".inp", p, linear, cell_sets={k: sets[k] for k in ("Silicone", "MAGNET")}), own)
    same_parts(read(".vtu", p, linear, cell_data={"region": [number]}), own)
    groups = {
        "cell_data": {"gmsh:physical": [number + 7], "gmsh:geometrical": [number + 1]},
        "field_data": {"silicone": np.array([7, 3]), "magnet": np.array([8, 3])},
    }
    same_parts(read(".msh", p, linear, **groups), own)
    with pytest.raises(BadInput, match="are assigned to the wrong region"):
        read(".vtu", p, linear, cell_data={"region": [1 - number]})
    with pytest.raises(BadInput, match="belong to neither of the regions silicone and magnet"):
        read(".inp", p, linear, cell_sets={"silicone": sets["Silicone"]})


def test_names_of_sides(own, arrays, read):
    points, _, linear, *_ = arrays
    facets = own.facets[:, own.boundaries["base"]].T
    given = {
        "blocks": [("triangle", facets)],
        "cell_sets": {"base": [np.array([], dtype=int), np.arange(len(facets))]},
    }
    same_parts(read(".inp", points[: own.nvertices], linear, **given), own)
    given["cell_sets"]["base"][1] = np.arange(len(facets) - 1)
    with pytest.raises(BadInput, match=f"lists {len(facets) - 1} facets as base, but {len(facets)} facets lie on"):
        read(".inp", points[: own.nvertices], linear, **given)


def test_the_magnet_as_a_hole_or_as_silicone(own, arrays, read):
    points, quadratic, _, number = arrays
    hole = read(".vtu", points, quadratic, magnet="hole")
    assert set(hole.subdomains) == {"silicone"}
    assert len(hole.boundaries["magnet"]) == len(own.boundaries["magnet"])
    outside = read(".vtu", points, quadratic[number == 0])
    assert quality(outside, SHAPE)["volumes"] == pytest.approx(quality(hole, SHAPE)["volumes"], rel=1e-12)
    filled = read(".vtu", points, quadratic, magnet="none")
    assert set(filled.boundaries) == {"base", "skin", "symmetry"}
    assert quality(filled, SHAPE.without_magnet())["volume_errors"]["silicone"] == pytest.approx(0, abs=1e-6)
    with pytest.raises(BadInput, match="lies on no outer surface"):
        read(".vtu", points, quadratic[number == 0], magnet="none")


def test_meshes_that_do_not_fit_are_refused(own, arrays, read):
    points, quadratic, linear, number = arrays
    p = points[: own.nvertices]
    apart = np.where((number == 1)[:, None], linear + len(p), linear)
    middle = np.flatnonzero(own.doflocs[0, own.t].mean(axis=0) > 1)[:1]
    folded = points.copy()
    folded[quadratic[5, 4:]] += [3, 0, 0]
    bent = points.copy()
    bent[0] = np.nan
    cases = [
        ("reaches up to z", (1e-3 * p, linear), {}),
        ("lies on no outer surface", (np.vstack([p, p]), apart), {}),
        ("lies on no outer surface", (p, np.delete(linear, middle, axis=0)), {}),
        ("overlap", (p, np.vstack([linear, linear[:1]])), {}),
        ("are flat", (p * [1, 1, 1], np.vstack([linear, [[0, 1, 2, 2]]])), {}),
        ("finite", (bent, quadratic), {}),
        ("inverted or folded", (folded, quadratic), {}),
        ("lies on no outer surface", (p, linear), {"shape": Shape(9, 6, 3, 2, 0.4)}),
    ]
    for text, given, more in cases:
        with pytest.raises(BadInput, match=text):
            read(".vtu", *given, **more)


def test_other_files_are_refused(arrays, tmp_path):
    points, *_ = arrays
    with pytest.raises(BadInput, match="there is no file"):
        mesh_import.read(tmp_path / "nothing.vtu", SHAPE)
    for path, kind in ((tmp_path, "a folder"), (os.devnull, "a device or a pipe")):
        with pytest.raises(BadInput, match=f"' is {kind}: give the file of a mesh"):
            mesh_import.read(path, SHAPE)
    for name, text in (("a.vtu", "not a mesh"), ("a.msh", ""), ("a.xyz", "1 2 3"), ("a.inp", "*NODE\n1, a\n")):
        (tmp_path / name).write_text(text)
        with pytest.raises(BadInput, match=r"cannot read(?!.*SystemExit)|must consist of tetrahedra"):
            mesh_import.read(tmp_path / name, SHAPE)
    meshio.Mesh(points, [("hexahedron", np.arange(8)[None])]).write(tmp_path / "b.vtu")
    with pytest.raises(BadInput, match="must consist of tetrahedra, all linear or all quadratic; got hexahedron"):
        mesh_import.read(tmp_path / "b.vtu", SHAPE)


def test_a_solve_on_an_imported_mesh(tmp_path, run, refusal, strict):
    sets = ("--set", "L=6", "--set", "magnet_diameter=3", "--set", "magnet_edge_radius=0.4", "--set", "l0=5")
    assert run("mesh", "paper", *sets, "--size", 2, "--half", "--out", "half.vtu")[0] == 0
    press = ("paper", *sets, "--depth", 0.3, "--json")
    status, out, _ = run("solve", *press, "--mesh", "half.vtu")
    (record,) = strict(out)
    assert (status, record["status"], record["model"]) == (0, "ok", "half")
    assert record["error_estimate"] is None
    section = strict(run("solve", *press, "--accuracy", "quick")[1])[0]
    assert record["force_N"][2] == pytest.approx(section["force_N"][2], rel=0.03)
    assert record["shift_mm"][2] == pytest.approx(section["shift_mm"][2], rel=0.05)
    press = ("solve", *press, "--mesh", "half.vtu")
    assert "is for model half" in refusal(*press, "--model", "full")
    assert "with D 8 mm where this design has D 8.01 mm" in refusal(*press, "--set", "D=8.01")
    long = ("mesh", "paper", "--mesher", "pytetwild", "--size", 3, "--out", "m.vtu")
    assert "at most R/2 = 2 for pytetwild; got 3" in run(*long)[2]


def test_the_label_of_a_mesh_names_its_sensor(own, tmp_path):
    """The label detects another sensor even where surfaces and volumes differ by less than their tolerances."""
    said = []
    vtk_files.write_mesh(tmp_path / "own.vtu", own, design_digest.as_numbers(design_digest.of_solid(SHAPE)))
    same_parts(mesh_import.read(tmp_path / "own.vtu", SHAPE, warn=said.append), own)
    assert said == []
    with pytest.raises(BadInput, match=r"with magnet_height 2 mm where this design has magnet_height 2\.0005 mm"):
        mesh_import.read(tmp_path / "own.vtu", replace(SHAPE, magnet_height=2.0005))
    vtk_files.write_mesh(tmp_path / "mute.vtu", own)
    mesh_import.read(tmp_path / "mute.vtu", replace(SHAPE, magnet_height=2.0005), warn=said.append)
    assert len(said) == 1
    assert "does not say for which sensor it was made" in said[0]
    # all nodes lie on the surfaces of this magnet, within their tolerance
    with pytest.raises(BadInput, match=r"the volume of the magnet .* is wrong by -0\.313 % \(at most 0\.2 %"):
        mesh_import.read(tmp_path / "mute.vtu", replace(SHAPE, magnet_height=2.006))


def test_cells_of_another_mesher_give_the_same_force(run, strict, tmp_path):
    """pytetwild shares only the surfaces with the harmonic model: a check of the mesh as well as of elements.

    A fillet of 1 mm has few facets: nearly all time goes into the other mesher.
    """
    file, design = tmp_path / "half.vtu", ("paper", "--set", "magnet_edge_radius=1")
    made = ("mesh", *design, "--half", "--mesher", "pytetwild", "--size", 2, "--out", file)
    (report,) = strict(run(*made, "--json")[1])
    assert report["status"] == "ok"
    assert abs(report["silicone_volume_error"]) < 1e-6
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["half.vtu"]
    load = ("solve", *design, "--depth", 0.6, "--shear", 0.5, "--accuracy", "quick", "--json")
    (harmonic,) = strict(run(*load)[1])
    (half,) = strict(run(*load, "--model", "half", "--mesh", file)[1])
    assert half["force_N"][2] == pytest.approx(harmonic["force_N"][2], rel=0.01)
    assert half["force_N"][0] == pytest.approx(harmonic["force_N"][0], rel=0.05)
    assert half["shift_mm"] == pytest.approx(harmonic["shift_mm"], rel=0.02, abs=1e-9)


def test_a_facet_of_the_magnet_that_faces_its_centre_counts_with_its_sense():
    """A cell that passes from the magnet to the silicone leaves a notch, with a facet that faces the pole."""
    own = tetrahedra(SHAPE, 1.2)  # the notch is a small share of the magnet
    magnet, on = own.subdomains["magnet"], own.boundaries["magnet"]
    counts = np.isin(own.t2f, on).sum(axis=0)
    cell = next(k for k in magnet if counts[k] == 1 and _faces_the_pole(own, k, on))
    notched = replace(
        own,
        _boundaries={**own.boundaries, "magnet": np.setxor1d(on, own.t2f[:, cell])},
        _subdomains={"silicone": np.append(own.subdomains["silicone"], cell), "magnet": np.setdiff1d(magnet, [cell])},
    )
    errors = quality(with_exact_volumes(notched, SHAPE), SHAPE)["volume_errors"]
    assert max(map(abs, errors.values())) < 1e-6


def _faces_the_pole(mesh, cell, on):
    """Whether an inner facet of a cell, seen from the rest of the magnet, has its outer side towards the pole."""
    centre = mesh.p[:, mesh.t[:, cell]].mean(axis=1)
    for facet in np.setdiff1d(mesh.t2f[:, cell], on):
        a, b, c = mesh.p[:, mesh.facets[:, facet]].T
        normal = np.cross(b - a, c - a)
        normal = normal if normal @ (centre - a) > 0 else -normal
        if normal @ (a - (0, 0, SHAPE.H)) < -1e-6:
            return True
    return False
