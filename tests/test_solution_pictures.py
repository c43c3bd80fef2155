"""Pictures of solutions show what they must."""

import dataclasses
import math

import numpy as np
import pytest
import skfem
from PIL import Image

from fem.model import angular_fields
from fem.solution import Field
from geometry.design import paper
from geometry.loads import Load
from studies.output.section_picture import cut_of
from studies.output.solution_pictures import SIZE, plane_name, plate_span, section_picture


def quadratic(kind, refine):
    """A straight second-order mesh of the unit square or cube."""
    straight = (skfem.MeshTri if kind is skfem.MeshTri2 else skfem.MeshTet)().refined(refine)
    return kind.from_mesh(straight)


@pytest.mark.parametrize("quantity", ["displacement", "pressure"])
def test_picture(tmp_path, pressed, quantity):
    section_picture(tmp_path / "a.png", paper(), pressed, magnet="ignored", quantity=quantity)
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
        cut = cut_of(dataclasses.replace(pressed, field=field, load=load, model="full"), "displacement")
        a, b, c = np.moveaxis(cut.rest[:, :3], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        outline = np.linalg.norm(cut.edges[:, 0, 2] - cut.edges[:, 0, 0], axis=1).sum()
        assert np.abs(cut.rest[..., 1]).max() < 1e-12
        assert area == pytest.approx(length, rel=1e-9)
        assert outline == pytest.approx(2 + 2 * length, rel=1e-9)
        assert cut.value == pytest.approx(np.linalg.norm(cut.moved - cut.rest, axis=2), rel=1e-9, abs=1e-12)
