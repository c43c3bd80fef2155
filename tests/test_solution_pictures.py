"""Pictures of solutions show what they must."""

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
from fem.solution import Field
from geometry.design import Design, paper
from geometry.loads import Load
from studies.output import picture_labels
from studies.output.solution_pictures import SIZE, cut_of, plane_name, plate_span, section_picture
from studies.output.vtk_files import field_grid
from studies.web import deformed_surface, state_pictures


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


def test_picture_of_a_shear_leans_to_its_side(tmp_path, gripped):
    section_picture(tmp_path / "a.png", paper(), gripped, magnet="ignored")
    image = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"))[:, :1150] / 255
    coloured = image.max(axis=2) - image.min(axis=2) > 0.1
    tip, base = (np.flatnonzero(coloured[rows].any(axis=0)).mean() for rows in (slice(200, 300), slice(900, 960)))
    assert tip > base + 50


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
        a, b, c = np.moveaxis(cut.rest[:, :3], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        outline = np.linalg.norm(cut.edges[:, 0, 2] - cut.edges[:, 0, 0], axis=1).sum()
        assert np.abs(cut.rest[..., 1]).max() < 1e-12
        assert area == pytest.approx(length, rel=1e-9)
        assert outline == pytest.approx(2 + 2 * length, rel=1e-9)
        assert cut.value == pytest.approx(np.linalg.norm(cut.moved - cut.rest, axis=2), rel=1e-9, abs=1e-12)


# Names and axes in the white around a picture's subject.


def subject():
    """A grey block in the middle of a white picture."""
    image = Image.new("RGB", (400, 300), "white")
    image.paste((120, 120, 120), (100, 80, 300, 240))
    return image


def test_names_stand_in_the_white_and_apart():
    image = subject()
    before = np.asarray(image.convert("L")) == 120
    picture_labels.annotate(image, {"S1": (120.0, 100.0), "S2": (125.0, 102.0)}, {})
    pixels = np.asarray(image.convert("L"))
    # in the block there are only the dots and the lines, each in its white
    assert 0 < (pixels[before] != 120).mean() < 0.03
    # letters, above or left of the block
    assert (pixels[:80] < 100).any() or (pixels[:, :100] < 100).any()


def test_no_room_is_no_place():
    assert picture_labels.free_place(np.ones((50, 50), dtype=bool), (25.0, 25.0), (10, 10)) is None


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


def test_both_sides_meet_on_the_axis_and_keep_the_volume(solution):
    data = state_pictures.section(Design(), solution, "rigid")
    points, rest = np.array(data["points"]), np.array(data["rest"])
    count = len(points) // 2
    axis = np.flatnonzero(np.abs(rest[:count, 0]) < 1e-9)
    assert len(axis) > 4
    np.testing.assert_allclose(points[axis], points[axis + count], atol=1.1e-4)
    # nearly incompressible silicone is stretched somewhere at every point
    stretch = np.array(data["fields"]["stretch"])
    assert stretch.min() > 0.995
    assert stretch.max() < 3


def test_stretch_of_a_uniform_deformation_is_that_of_its_gradient(solution):
    field = solution.field
    nodes = np.asarray(field.mesh.dofs.element_dofs).T
    r, z = field.mesh.doflocs
    # u_r = 0.1 r, u_z = -0.2 z + 0.3 r: F = [[1.1, 0], [0.3, 0.8]] in the plane, 1.1 across it
    largest = np.linalg.svd([[1.1, 0.0], [0.3, 0.8]])[1].max()
    u, slope = np.stack([0.1 * r, 0 * r, 0.3 * r - 0.2 * z]), np.stack([0 * r, 0.1 * r, 0 * r])
    stretch = state_pictures._largest_stretch(field, nodes, u, slope)
    np.testing.assert_allclose(stretch, largest, rtol=1e-9)


def test_magnet_outline_has_its_size_and_pose():
    design = Design()
    outline = state_pictures.magnet_outline(design, 0.5, -0.3, 0.2)
    x, z = outline.T
    centre = np.array([0.5, design.H - 0.3])
    assert np.hypot(*(outline - centre).T).max() == pytest.approx(math.hypot(1.9, 0.9) + 0.1, rel=1e-3)
    assert (x.max() + x.min()) / 2 == pytest.approx(0.5)
    assert (z.max() + z.min()) / 2 == pytest.approx(design.H - 0.3)


def test_surface_agrees_with_that_of_the_report(solution):
    own = state_pictures.surface(solution)
    report = deformed_surface.parts_of(field_grid(solution))
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
    skin, turned = (
        np.array(state_pictures.surface(each)["parts"]["back"]["points"]).reshape(-1, 3) for each in (one, other)
    )
    rotation = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(skin @ rotation.T, turned, atol=3e-3)


def test_field_lines_follow_the_field(solution):
    design = Design()
    lines = state_pictures.field_lines(design, solution)["lines"]
    assert len(lines) >= 2 * state_pictures.LINES
    (c, s), response = solution.load.direction, solution.response
    tilt = c * response.tilt + s * response.tilt_y
    turn = np.array([[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]])
    centre = np.array([c * response.shift[0] + s * response.shift[1], response.shift[2] + design.H])
    along = []
    for line in lines:
        local = (np.array(line) - centre) @ turn.T
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


def test_no_magnet_has_no_lines():
    design = Design(magnet_diameter=0.0, magnet_height=0.0)
    solution = trace(design, [Load(depth=0.5)], QUICK, magnet="ignored", estimate=False)[-1]
    assert state_pictures.field_lines(design, solution) == {"lines": []}
    assert state_pictures.section(design, solution, "ignored")["magnet"] == []
