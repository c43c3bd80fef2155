"""Files are whole or absent; meshes and fields come back from .vtu as they were; pictures show what they must."""

import dataclasses
import math
import resource
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import skfem

from fem.accuracy import QUICK
from fem.discretisation import elements
from fem.equilibrium import trace
from fem.solution import Field
from geometry.design import BadInput, paper
from geometry.loads import Load
from studies.output import atomic_files


@pytest.fixture(scope="module")
def pressed():
    return trace(paper(), [Load(depth=1.0)], QUICK, magnet="ignored", estimate=False)[0]


def quadratic(kind, refine):
    """A straight second-order mesh of the unit square or cube."""
    straight = (skfem.MeshTri if kind is skfem.MeshTri2 else skfem.MeshTet)().refined(refine)
    return kind.from_mesh(straight)


def half_written(path):
    with atomic_files.atomic(path) as temporary:
        assert (temporary.suffix, temporary.parent.parent) == (path.suffix, path.parent)
        temporary.write_text("half")
        raise ZeroDivisionError


def test_atomic_leaves_nothing_behind(tmp_path):
    with pytest.raises(ZeroDivisionError):
        half_written(tmp_path / "a.vtu")
    assert not list(tmp_path.iterdir())


def test_atomic_keeps_the_old_file_until_the_new_is_whole(tmp_path):
    path = tmp_path / "a.json"
    atomic_files.write_json(path, {"x": 1.0})
    with pytest.raises(ZeroDivisionError):
        half_written(path)
    assert path.read_text() == '{\n  "x": 1.0\n}\n'
    assert [found.name for found in tmp_path.iterdir()] == ["a.json"]


def test_output_folder(tmp_path):
    made = atomic_files.output_folder(tmp_path / "a" / "b")
    assert made.is_dir()
    assert not list(made.iterdir())
    with pytest.raises(BadInput, match=r"^cannot write to the folder '/proc/x' .*: choose another folder$"):
        atomic_files.output_folder("/proc/x")


def test_an_output_is_not_an_input_under_another_name(tmp_path):
    file, link, hard = tmp_path / "a.csv", tmp_path / "b.csv", tmp_path / "c.csv"
    file.write_text("mine")
    link.symlink_to(file)
    hard.hardlink_to(file)
    for out in (file, link, hard, tmp_path / "sub" / ".." / "a.csv"):
        (tmp_path / "sub").mkdir(exist_ok=True)
        with pytest.raises(BadInput, match=r"^the output '.*' is also the input '.*a.csv': choose another name$"):
            atomic_files.check_apart([None, out], ["paper", None, file])
    atomic_files.check_apart([tmp_path / "new.csv", None, tmp_path / "sub"], [file, tmp_path / "sub", "paper"])


def test_output_file(tmp_path):
    assert atomic_files.check_output_file(tmp_path / "a.VTU", ".vtu").name == "a.VTU"
    (tmp_path / "b.vtu").mkdir()
    with pytest.raises(BadInput, match="is a folder"):
        atomic_files.check_output_file(tmp_path / "b.vtu", ".vtu")
    new = atomic_files.check_output_file(tmp_path / "new" / "folder" / "a.csv", ".csv")
    assert [found.name for found in tmp_path.iterdir()] == ["b.vtu"]
    atomic_files.write_text(new, "x")
    with pytest.raises(BadInput, match="it or one of its parents is a file"):
        atomic_files.check_output_file(new / "b.csv", ".csv")


@pytest.mark.parametrize(
    ("kind", "measure"), [(skfem.MeshTri2, "Area"), (skfem.MeshTet2, "Volume")], ids=["triangles", "tetrahedra"]
)
def test_cells_are_positive_and_nodes_in_vtk_order(tmp_path, kind, measure):
    import pyvista as pv

    mesh = quadratic(kind, 2)
    mesh = type(mesh)(mesh.doflocs, mesh.t, _subdomains={"magnet": np.array([0, 1])})
    atomic_files.write_mesh(tmp_path / "mesh.vtu", mesh)
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


ANGLES = {2: elements.around(0), 3: elements.cartesian(3)}


@pytest.mark.parametrize("kind", [skfem.MeshTri2, skfem.MeshTet2])
def test_linear_fields_come_back(tmp_path, pressed, kind):
    import pyvista as pv

    mesh = quadratic(kind, 1)
    dim = mesh.dim()
    x = mesh.doflocs.T
    u = 0.1 * x @ np.arange(1, dim * dim + 1).reshape(dim, dim)
    vertices = np.unique(mesh.dofs.element_dofs[: dim + 1])
    field = Field(mesh=mesh, u=u, p=1 + x[vertices].sum(axis=1)[:, None], vertices=vertices, angles=ANGLES[dim])
    atomic_files.write_field(tmp_path / "field.vtu", dataclasses.replace(pressed, field=field))
    grid = pv.read(tmp_path / "field.vtu")
    rest = grid.points - grid["displacement_mm"]
    # the pressure in the file is positive in compression, that of the elements in tension
    assert np.abs(grid["pressure_MPa"] + 1 + rest.sum(axis=1)).max() < 1e-12
    assert np.abs(np.delete(rest, 1, axis=1) - x if dim == 2 else rest - x).max() < 1e-12


def test_solution_in_a_file(tmp_path, pressed):
    import pyvista as pv

    atomic_files.write_field(tmp_path / "field.vtu", pressed)
    grid = pv.read(tmp_path / "field.vtu")
    assert grid.n_cells == pressed.field.mesh.nelements
    assert grid.compute_cell_sizes()["Area"].min() > 0
    assert np.linalg.norm(grid["displacement_mm"], axis=1).max() == pytest.approx(1.0, abs=0.05)
    # nearly incompressible: by Pappus the deformed section encloses the beam's volume
    sizes, centres = grid.compute_cell_sizes()["Area"], grid.cell_centers().points
    volume = 2 * math.pi * (sizes * centres[:, 0]).sum()
    assert volume == pytest.approx(math.pi * 16 * (5 + 8 / 3), rel=0.01)
    assert grid["pressure_MPa"][np.argmax(grid.points[:, 2])] > 0


@pytest.mark.parametrize("quantity", ["displacement", "pressure"])
def test_picture(tmp_path, pressed, quantity):
    from matplotlib.image import imread

    from studies.output.solution_pictures import SIZE, section_picture

    section_picture(tmp_path / "a.png", paper(), pressed, magnet="ignored", quantity=quantity)
    image = imread(tmp_path / "a.png")[..., :3]
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
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


@pytest.fixture(scope="module")
def gripped():
    load = Load(grip=2.0, shear_x=1.2, shear_y=1.6)
    return trace(paper(), [load], QUICK, magnet="ignored", estimate=False)[0]


def test_half_a_body_of_a_harmonic_solution_in_a_file(tmp_path, gripped):
    import pyvista as pv

    atomic_files.write_field(tmp_path / "field.vtu", gripped)
    grid = pv.read(tmp_path / "field.vtu")
    volumes = grid.compute_cell_sizes()["Volume"]
    assert volumes.min() > 0
    # nearly incompressible: the deformed body has the beam's volume
    assert 2 * volumes.sum() == pytest.approx(math.pi * 16 * (5 + 8 / 3), rel=0.01)
    tip = np.argmax((grid.points - grid["displacement_mm"])[:, 2])
    assert grid["displacement_mm"][tip, :2] == pytest.approx([1.2, 1.6], abs=0.02)


def test_picture_of_a_shear_leans_to_its_side(tmp_path, gripped):
    from matplotlib.image import imread

    from studies.output.solution_pictures import section_picture

    section_picture(tmp_path / "a.png", paper(), gripped, magnet="ignored")
    image = imread(tmp_path / "a.png")[:, :1150, :3]
    coloured = image.max(axis=2) - image.min(axis=2) > 0.1
    tip, base = (np.flatnonzero(coloured[rows].any(axis=0)).mean() for rows in (slice(200, 300), slice(900, 960)))
    assert tip > base + 50


@pytest.mark.parametrize(
    ("x", "y", "name"), [(0, 0, "x"), (-2, 0, "x"), (0, 1, "y"), (0, -1, "y"), (-3, 4, "0.6 x - 0.8 y")]
)
def test_a_picture_names_its_section(pressed, x, y, name):
    from studies.output.solution_pictures import plane_name

    load = Load(depth=1.0, shear_x=x, shear_y=y, friction="stick")
    assert plane_name(dataclasses.replace(pressed, load=load)) == f"section along {name}"


def test_the_plate_is_drawn_above_all_silicone_that_is_close_to_it(pressed):
    from studies.output.solution_pictures import plate_span

    sheared = dataclasses.replace(pressed, load=Load(depth=1.0, shear_x=10.0, friction="stick"))
    moved = np.array([[-4.0, 0.0, 0.0], [2.5, 0.0, 7.5], [10.0, 0.0, 8.0], [16.0, 0.0, 7.9]])
    assert plate_span(paper(), sheared, moved, 0.0) == (1.5, 17.0)
    assert plate_span(paper(), sheared, moved[:1], 0.0) == (5.0, 15.0)


def test_cut_through_a_full_body(pressed):
    from studies.output.section_picture import cut_of

    mesh = quadratic(skfem.MeshTet2, 2).translated((-0.5, -0.53, 0.0))
    slope = np.array([[0.1, 0.2, 0.0], [0.0, 0.3, 0.0], [0.4, 0.0, -0.2]])
    u, vertices = mesh.doflocs.T @ slope.T, np.unique(mesh.dofs.element_dofs[:4])
    field = Field(mesh=mesh, u=u, p=np.zeros((len(vertices), 1)), vertices=vertices, angles=ANGLES[3])
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


def test_a_mesh_on_a_full_disk_is_an_error_that_names_its_file(tmp_path):
    """The system refuses files longer than a limit, as a full disk would."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        with pytest.raises(OSError) as caught:
            atomic_files.write_mesh(tmp_path / "mesh.vtu", skfem.MeshTet2())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert caught.value.filename == str(tmp_path / "mesh.vtu")
    assert not list(tmp_path.iterdir())


def test_what_a_killed_process_left_goes_with_the_next_write(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path; from studies.output import atomic_files as files\n"
        "with files.staged(Path(sys.argv[1])) as stage:\n"
        "    (stage / 'part').write_text('half'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    root = Path(__file__).parent.parent
    killed = subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=root, check=False)
    assert killed.returncode == -signal.SIGKILL
    (left,) = tmp_path.iterdir()
    elsewhere = tmp_path / ".writing-another-machine-1-abc"
    elsewhere.mkdir()
    with atomic_files.staged(tmp_path) as mine:
        assert not left.exists()
        # who is at work here or elsewhere is not disturbed
        atomic_files._tidied.cache_clear()
        atomic_files.write_text(tmp_path / "text.txt", "whole")
        assert mine.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == [elsewhere.name, "text.txt"]
