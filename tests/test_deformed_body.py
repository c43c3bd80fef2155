import dataclasses

import numpy as np
import pytest

from fem import equilibrium
from fem.accuracy import QUICK
from fem.results import revolved_body
from geometry.design import paper
from geometry.loads import Load
from studies.output import deformed_body, vtk_files
from studies.web import report_sections

ROTATION = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
MIRROR = np.array([1.0, -1.0, 1.0])
COARSE = dataclasses.replace(QUICK, section_size=0.25)


@pytest.fixture(scope="module")
def solutions():
    press = equilibrium.solve(paper(), Load(depth=1.0), COARSE)
    shear = equilibrium.solve(paper(), Load(depth=1.0, shear_x=0.5, friction="stick"), COARSE)
    return {"axisymmetric": press, "harmonic": shear}


def grid_of(solution):
    """The grid of the file of a solution."""
    return vtk_files.body_grid(revolved_body.place(solution))


def area(part):
    """Area of a surface, of the undeformed points."""
    rest, _, triangles = part
    a, b, c = rest[triangles].transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize("model", ["axisymmetric", "harmonic"])
def test_parts_have_the_size_of_the_sensor(solutions, model):
    d = paper()
    parts = deformed_body.parts_of(grid_of(solutions[model]))
    assert set(parts) == {"back", "front", "cut", "magnet"}
    skin = np.concatenate([parts["back"][0], parts["front"][0]])
    assert np.ptp(skin, axis=0) == pytest.approx([d.D, d.D, d.L], rel=0.01)
    magnet = parts["magnet"][0]
    assert np.ptp(magnet, axis=0) == pytest.approx([d.magnet_diameter, d.magnet_diameter, d.magnet_height], rel=0.01)
    assert np.abs(parts["cut"][0][:, 1]).max() < 1e-12
    assert parts["back"][0][:, 1].min() > -1e-6
    assert parts["front"][0][:, 1].max() < 1e-6


def test_magnet_moves_as_a_rigid_body(solutions):
    solution = solutions["harmonic"]
    rest, u, _ = deformed_body.parts_of(grid_of(solution))["magnet"]
    centre = u.mean(axis=0)
    assert centre[0] == pytest.approx(solution.response.shift[0], abs=0.02)
    assert centre[2] == pytest.approx(solution.response.shift[2], abs=0.02)
    # distances between points stay
    a, b = rest[:100], rest[-100:]
    np.testing.assert_allclose(
        np.linalg.norm(a + u[:100] - b - u[-100:], axis=1), np.linalg.norm(a - b, axis=1), rtol=0.01
    )


def test_file_gives_the_same_as_the_solution(solutions, tmp_path):
    vtk_files.write_field(tmp_path / "press.vtu", solutions["axisymmetric"])
    surface = report_sections.surface_of_file(tmp_path / "press.vtu")
    assert surface["largest"] == pytest.approx(1.0, rel=0.05)
    assert set(surface["parts"]["cut"]) == {"points", "value", "triangles"}
    assert max(surface["parts"]["cut"]["triangles"]) < len(surface["parts"]["cut"]["value"])


def test_mesh_without_displacements_has_no_surface(solutions, tmp_path):
    vtk_files.write_mesh(tmp_path / "mesh.vtu", solutions["axisymmetric"].field.mesh)
    assert report_sections.surface_of_file(tmp_path / "mesh.vtu") is None


def test_other_file_is_refused_without_a_word_of_vtk(tmp_path, refused, capfd):
    (tmp_path / "bad.vtu").write_text("no")
    with refused("no .vtu file"):
        report_sections.surface_of_file(tmp_path / "bad.vtu")
    assert capfd.readouterr() == ("", "")


def test_whole_body_is_cut_open(solutions):
    """The file of a full solution holds both halves; cut open, it gives the parts of the half body."""
    import pyvista as pv

    grid = grid_of(solutions["harmonic"])
    half = deformed_body.parts_of(grid)
    other = grid.copy()
    other.points = grid.points * MIRROR
    other.point_data["displacement_mm"] = grid.point_data["displacement_mm"] * MIRROR
    whole = pv.merge([grid, other], merge_points=True)
    parts = deformed_body.parts_of(pv.UnstructuredGrid(whole))
    assert set(parts) == set(half)
    for name in ("back", "front", "cut", "magnet"):
        assert area(parts[name]) == pytest.approx(area(half[name]), rel=0.02)
    # nodes may lie beside the plane by an error of rounding
    beside = whole.copy()
    for turn in (ROTATION, ROTATION.T):
        beside.points = beside.points @ turn.T
        beside.point_data["displacement_mm"] = beside.point_data["displacement_mm"] @ turn.T
    sections = [deformed_body.parts_of(pv.UnstructuredGrid(each))["cut"] for each in (whole, beside)]
    lengths = []
    for rest, _, triangles in (half["cut"], *sections):
        ends = rest[deformed_body.outer_edges(triangles, rest[:, [0, 2]])]
        lengths.append(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())
    assert lengths == pytest.approx([lengths[0]] * 3, rel=1e-3)
