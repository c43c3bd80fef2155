"""Meshes and fields come back from .vtu as they were."""

import dataclasses
import math
import resource
import signal

import numpy as np
import pytest
import skfem

from fem.model import angular_fields
from fem.solution import Field
from studies.output import vtk_files


def quadratic(kind, refine):
    """A straight second-order mesh of the unit square or cube."""
    straight = (skfem.MeshTri if kind is skfem.MeshTri2 else skfem.MeshTet)().refined(refine)
    return kind.from_mesh(straight)


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


def test_solution_in_a_file(tmp_path, pressed):
    import pyvista as pv

    vtk_files.write_field(tmp_path / "field.vtu", pressed)
    grid = pv.read(tmp_path / "field.vtu")
    assert grid.n_cells == pressed.field.mesh.nelements
    assert grid.compute_cell_sizes()["Area"].min() > 0
    assert np.linalg.norm(grid["displacement_mm"], axis=1).max() == pytest.approx(1.0, abs=0.05)
    # nearly incompressible: by Pappus the deformed section encloses the beam's volume
    sizes, centres = grid.compute_cell_sizes()["Area"], grid.cell_centers().points
    volume = 2 * math.pi * (sizes * centres[:, 0]).sum()
    assert volume == pytest.approx(math.pi * 16 * (5 + 8 / 3), rel=0.01)
    assert grid["pressure_MPa"][np.argmax(grid.points[:, 2])] > 0


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


def test_a_mesh_on_a_full_disk_is_an_error_that_names_its_file(tmp_path):
    """The system refuses files longer than a limit, as a full disk would."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500, before[1]))
    try:
        with pytest.raises(OSError) as caught:
            vtk_files.write_mesh(tmp_path / "mesh.vtu", skfem.MeshTet2())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert caught.value.filename == str(tmp_path / "mesh.vtu")
    assert not list(tmp_path.iterdir())
