"""Pictures and files of solutions show what they must."""

import dataclasses
import math

import numpy as np
import pytest
import skfem
from PIL import Image

from analytic.magnet import cylinder_field
from fem.accuracy import QUICK
from fem.equilibrium import trace
from fem.model import angular_fields
from fem.results import revolved_body
from fem.solution import Field
from geometry.design import Design, paper
from geometry.loads import Load
from studies.output import deformed_body, picture_labels, vtk_files
from studies.output.solution_pictures import SIZE, cut_of, plane_name, plate_span, section_picture
from studies.web import state_pictures


def quadratic(kind, refine):
    """A straight second-order mesh of the unit square or cube."""
    straight = (skfem.MeshTri if kind is skfem.MeshTri2 else skfem.MeshTet)().refined(refine)
    return kind.from_mesh(straight)


def test_picture(tmp_path, pressed):
    section_picture(tmp_path / "a.png", paper(), pressed, magnet="ignored")
    image = np.asarray(Image.open(tmp_path / "a.png").convert("RGB")) / 255
    assert image.shape[:2] == (SIZE[1], SIZE[0])
    assert (image[[0, -1]] == 1).all()
    assert (image[:, [0, -1]] == 1).all()
    saturation = image.max(axis=2) - image.min(axis=2)
    coloured = (saturation > 0.1).mean()
    assert 0.15 < coloured < 0.7
    # the section is mirrored: its left and right half are alike
    columns = np.flatnonzero((saturation[300:900, :1150] > 0.1).any(axis=0))
    half = image[300:900, columns[0] : columns[-1] + 1]
    assert np.abs(half - half[:, ::-1]).mean() < 0.02
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["a.png"]


@pytest.mark.parametrize(
    ("x", "y", "name"), [(0, 0, "x"), (-2, 0, "x"), (0, 1, "y"), (0, -1, "y"), (-3, 4, "0.6 x - 0.8 y")]
)
def test_a_picture_names_its_section(pressed, x, y, name):
    load = Load(depth=1.0, shear_x=x, shear_y=y, friction="stick")
    assert plane_name(dataclasses.replace(pressed, load=load)) == f"section along {name}"


def test_the_plate_is_drawn_above_all_silicone_that_is_close_to_it(pressed):
    sheared = dataclasses.replace(pressed, load=Load(depth=1.0, shear_x=10.0, friction="stick"))
    moved = np.array([[-4.0, 0.0, 0.0], [2.5, 0.0, 7.5], [10.0, 0.0, 8.0], [16.0, 0.0, 7.9]])
    assert plate_span(paper(), sheared, moved, 0.0) == (1.5, 17.0)
    assert plate_span(paper(), sheared, moved[:1], 0.0) == (5.0, 15.0)


def test_cut_through_a_full_body(pressed):
    mesh = quadratic(skfem.MeshTet2, 2).translated((-0.5, -0.53, 0.0))
    slope = np.array([[0.1, 0.2, 0.0], [0.0, 0.3, 0.0], [0.4, 0.0, -0.2]])
    u, vertices = mesh.doflocs.T @ slope.T, np.unique(mesh.dofs.element_dofs[:4])
    field = Field(
        mesh=mesh, u=u, p=np.zeros((len(vertices), 1)), vertices=vertices, angles=angular_fields.cartesian_fields(3)
    )
    # both planes leave the cube through x = -0.5 and x = 0.5
    for shear, length in ((0.0, 1.0), (0.5, math.hypot(1.0, 0.5))):
        load = Load(depth=1.0, shear_x=1.0, shear_y=shear, friction="stick")
        cut = cut_of(dataclasses.replace(pressed, field=field, load=load, model="full"))
        a, b, c = np.moveaxis(cut.rest[cut.triangles], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        outline = np.linalg.norm(np.diff(cut.rest[cut.edges], axis=1)[:, 0], axis=1).sum()
        assert np.abs(cut.rest[..., 1]).max() < 1e-12
        assert area == pytest.approx(length, rel=1e-9)
        assert outline == pytest.approx(2 + 2 * length, rel=1e-9)
        c, s = load.direction
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        np.testing.assert_allclose(cut.moved - cut.rest, cut.rest @ turn @ slope.T @ turn.T, atol=1e-9)


# Names and axes in the white around a picture's subject.


@pytest.mark.parametrize("axes", [{"x": (1.0, 0.0)}, {"z": (0.0, -1.0)}, {"y": (0.0, 0.0)}])
def test_axes_stand_in_a_picture_without_covering_its_subject(axes):
    image = Image.new("RGB", (800, 600), "white")
    image.paste((120, 120, 120), (200, 300, 600, 420))
    image.paste((120, 120, 120), (380, 100, 420, 420))
    before = np.asarray(image.convert("L")) == 120
    picture_labels.annotate(image, {}, axes)
    pixels = np.asarray(image.convert("L"))
    assert (pixels[before] == 120).all()
    assert (pixels < 100).any()


# Section, 3D surface and field lines of a solution: invariants of geometry and of the field.


LOADS = {
    "press": Load(depth=1.0),
    "tilt": Load(depth=0.5, plate_tilt=0.1),
    "shear": Load(depth=1.0, shear_x=0.5, friction="stick"),
}


@pytest.fixture(scope="module", params=LOADS.values(), ids=LOADS)
def solution(request):
    return trace(Design(), [request.param], QUICK, estimate=False)[-1]


def areas(points, triangles):
    a, b, c = np.asarray(points)[np.asarray(triangles)].transpose(1, 0, 2)
    (x, z), (u, w) = (b - a).T, (c - a).T
    return (x * w - z * u) / 2


def test_section_covers_both_sides_without_gaps(solution):
    design, data = Design(), state_pictures.section(Design(), solution, "rigid")
    half = areas(data["rest"], data["triangles"])
    assert (half > 0).all() or (half < 0).all()
    magnet = 4 * 2 - (4 - math.pi) * 0.1**2
    whole = design.D * design.H + math.pi * design.R**2 / 2 - magnet
    # straight edges leave a little out at the dome
    assert abs(half.sum()) == pytest.approx(whole, rel=5e-3)
    # the foot is clamped at height 0, and nothing is below it
    assert np.array(data["points"])[:, 1].min() == pytest.approx(0, abs=1e-9)
    # nothing is above the plate, whose normal turns from z towards x
    x, z = np.array(data["points"]).T
    slope = math.tan(math.radians(data["plate"]["tilt"]))
    assert (z + x * slope).max() == pytest.approx(data["plate"]["z"], abs=0.01)
    assert data["plate"]["x"] == pytest.approx(0.5 if solution.load.shears_tip else 0.0)


def test_surface_agrees_with_that_of_the_report(solution):
    own = state_pictures.surface(solution)
    report = deformed_body.parts_of(vtk_files.body_grid(revolved_body.place(solution)))
    assert own["parts"].keys() == report.keys()
    for name, (rest, u, _) in report.items():
        points = np.array(own["parts"][name]["points"]).reshape(-1, 3)
        for bound in (np.min, np.max):
            # the report has other angles around the axis
            np.testing.assert_allclose(bound(points, axis=0), bound(rest + u, axis=0), atol=0.05)
        assert max(own["parts"][name]["value"]) == pytest.approx(np.linalg.norm(u, axis=1).max(), rel=0.02)
        triangles = np.array(own["parts"][name]["triangles"])
        assert triangles.max() < len(points)


def test_an_oblique_shear_turns_the_figure_and_keeps_the_section():
    one, other = (
        trace(Design(), [Load(depth=0.5, shear_x=x, shear_y=y, friction="stick")], QUICK, estimate=False)[-1]
        for x, y in ((0.5, 0.0), (0.3, 0.4))
    )
    sections = [state_pictures.section(Design(), each, "rigid") for each in (one, other)]
    np.testing.assert_allclose(*(each["points"] for each in sections), atol=2e-4)
    assert sections[1]["direction"] == pytest.approx([0.6, 0.8])
    skins = [state_pictures.surface(each) for each in (one, other)]
    assert [skin["turn"] for skin in skins] == pytest.approx([0.0, math.atan2(0.4, 0.3)])
    np.testing.assert_allclose(*(skin["parts"]["back"]["points"] for skin in skins), atol=3e-3)


def test_field_lines_follow_the_field(solution):
    found = state_pictures.field_lines(Design(), solution)
    assert len(found["lines"]) >= 2 * state_pictures.LINES
    (c, s), response = solution.load.direction, solution.response
    assert found["tilt"] == pytest.approx(c * response.tilt + s * response.tilt_y)
    assert found["centre"] == pytest.approx(
        [c * response.shift[0] + s * response.shift[1], response.shift[2] + Design().H]
    )
    along = []
    for line in found["lines"]:
        local = np.array(line)
        step, middle = np.diff(local, axis=0), (local[1:] + local[:-1]) / 2
        # lines have kinks on the magnet's wall, where B_z jumps; coordinates are rounded to 0.001 mm
        free = np.hypot(*(np.abs(middle) - [2.0, 1.0]).T) > 0.5
        free &= (np.linalg.norm(step, axis=1) > 0.02) & (
            (np.abs(np.abs(middle[:, 0]) - 2) > 0.2) | (np.abs(middle[:, 1]) > 1)
        )
        points = np.stack([middle[:, 0], 0 * middle[:, 0], middle[:, 1]], axis=1)[free]
        if len(points):
            field = cylinder_field(points, 2.0, 2.0, 1.0)[:, [0, 2]]
            size = np.linalg.norm(step[free], axis=1) * np.linalg.norm(field, axis=1)
            along.append(np.abs((step[free] * field).sum(axis=1)) / size)
    # cosine of the angle between line and field
    assert np.quantile(np.concatenate(along), 0.01) > 0.99


# Meshes and fields come back from .vtu as they were


@pytest.mark.parametrize(
    ("kind", "measure"), [(skfem.MeshTri2, "Area"), (skfem.MeshTet2, "Volume")], ids=["triangles", "tetrahedra"]
)
def test_cells_are_positive_and_nodes_in_vtk_order(tmp_path, kind, measure):
    import pyvista as pv

    mesh = quadratic(kind, 2)
    mesh = type(mesh)(mesh.doflocs, mesh.t, _subdomains={"magnet": np.array([0, 1])})
    vtk_files.write_mesh(tmp_path / "mesh.vtu", mesh)
    grid = pv.read(tmp_path / "mesh.vtu")
    sizes = grid.compute_cell_sizes()[measure]
    assert sizes.min() > 0
    assert sizes.sum() == pytest.approx(1.0, rel=1e-12)
    assert grid["region"].sum() == 2
    corners, ends = mesh.dim() + 1, [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    cells = grid.cells.reshape(mesh.nelements, -1)[:, 1:]
    for column, (a, b) in zip(range(corners, cells.shape[1]), ends, strict=False):
        middle = (grid.points[cells[:, a]] + grid.points[cells[:, b]]) / 2
        assert np.abs(grid.points[cells[:, column]] - middle).max() < 1e-12


ANGLES = {2: angular_fields.fourier_fields(0), 3: angular_fields.cartesian_fields(3)}


@pytest.mark.parametrize("kind", [skfem.MeshTri2, skfem.MeshTet2])
def test_linear_fields_come_back(tmp_path, pressed, kind):
    import pyvista as pv

    mesh = quadratic(kind, 1)
    dim = mesh.dim()
    x = mesh.doflocs.T
    u = 0.1 * x @ np.arange(1, dim * dim + 1).reshape(dim, dim)
    vertices = np.unique(mesh.dofs.element_dofs[: dim + 1])
    field = Field(mesh=mesh, u=u, p=1 + x[vertices].sum(axis=1)[:, None], vertices=vertices, angles=ANGLES[dim])
    vtk_files.write_field(tmp_path / "field.vtu", dataclasses.replace(pressed, field=field))
    grid = pv.read(tmp_path / "field.vtu")
    rest = grid.points - grid["displacement_mm"]
    # the pressure in the file is positive in compression, that of the elements in tension
    assert np.abs(grid["pressure_MPa"] + 1 + rest.sum(axis=1)).max() < 1e-12
    assert np.abs(np.delete(rest, 1, axis=1) - x if dim == 2 else rest - x).max() < 1e-12


def test_half_a_body_of_a_harmonic_solution_in_a_file(tmp_path, gripped):
    import pyvista as pv

    vtk_files.write_field(tmp_path / "field.vtu", gripped)
    grid = pv.read(tmp_path / "field.vtu")
    volumes = grid.compute_cell_sizes()["Volume"]
    assert volumes.min() > 0
    # nearly incompressible: the deformed body has the beam's volume
    assert 2 * volumes.sum() == pytest.approx(math.pi * 16 * (5 + 8 / 3), rel=0.01)
    tip = np.argmax((grid.points - grid["displacement_mm"])[:, 2])
    assert grid["displacement_mm"][tip, :2] == pytest.approx([1.2, 1.6], abs=0.02)
