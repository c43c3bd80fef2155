"""Section, 3D surface and field lines of a solution: invariants of geometry and of the field."""

import math

import numpy as np
import pytest

from analytic.magnet import cylinder_field
from fem.accuracy import QUICK
from fem.equilibrium import trace
from geometry.design import Design
from geometry.loads import Load
from studies.output.vtk_files import field_grid
from studies.web import deformed_surface, state_pictures

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
