"""VTK files (.vtu) of meshes, and of displacement and pressure on them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.output.atomic_files import atomic

if TYPE_CHECKING:
    import skfem

    from fem.results.revolved_body import Body
    from fem.solution import Solution


def write_mesh(path: str | Path, mesh: skfem.Mesh, about: Mapping[str, float] | None = None) -> None:
    """Write a second-order mesh as .vtu, with the number of each cell's region (0 silicone, 1 magnet).

    `about`: numbers by name that the file stores as field data.
    """
    grid = grid_of(mesh)
    regions = mesh.subdomains or {}
    region = np.zeros(mesh.nelements, dtype=np.int64)
    region[regions.get("magnet", slice(0))] = 1
    grid.cell_data["region"] = region
    for name, number in (about or {}).items():
        grid.field_data[name] = np.array([number])
    _save(path, grid)


def write_field(path: str | Path, solution: Solution) -> None:
    """Write the deformed body as .vtu, with displacement_mm, pressure_MPa and region.

    The file holds the section of an axisymmetric solution, half the body (on one side of the plane of the shear) of a
    harmonic or half solution, and the whole body where the load has no plane of symmetry. The points are the deformed
    ones: subtract displacement_mm for the undeformed place. Pressure is positive in compression; at the middle of an
    edge it is the mean of the pressures at both ends, because the pressure is linear in each element.
    """
    from fem.results.revolved_body import place

    _save(path, body_grid(place(solution)))


def body_grid(solid: Body) -> Any:
    """Return the PyVista grid of a deformed body, as `write_field` writes it."""
    grid = grid_of(solid.mesh)
    moved = spatial(solid.u)
    grid.points = grid.points + moved
    grid.point_data["displacement_mm"] = moved
    # the elements' unknown p is the mean stress, positive in tension
    grid.point_data["pressure_MPa"] = at_all_nodes(solid.mesh, solid.vertices, -solid.p)
    grid.cell_data["region"] = np.zeros(solid.mesh.nelements, dtype=np.int64)
    return grid


def grid_of(mesh: skfem.Mesh) -> Any:
    """Return the PyVista grid of a second-order mesh; its points are numbered like the mesh's `doflocs`.

    The (r, z) section lies in the plane y = 0 with x = r. scikit-fem and VTK number the nodes of a cell in the same
    order (corners, then the edges 01, 12, 02 and, in a tetrahedron, 03, 13, 23), but VTK requires positive volumes.
    """
    import pyvista as pv

    nodes = np.asarray(mesh.dofs.element_dofs)
    corners = mesh.doflocs[:, nodes[: mesh.dim() + 1]]
    slopes = corners[:, 1:] - corners[:, :1]
    reversed_ = np.linalg.det(np.moveaxis(slopes, 2, 0)) < 0
    # a cell of negative volume gets corners 1 and 2 exchanged, and with them the edges at these corners
    other = [0, 2, 1, 5, 4, 3] if mesh.dim() == 2 else [0, 2, 1, 3, 6, 5, 4, 7, 9, 8]
    nodes = np.where(reversed_, nodes[other], nodes)
    kind = pv.CellType.QUADRATIC_TRIANGLE if mesh.dim() == 2 else pv.CellType.QUADRATIC_TETRA
    return pv.UnstructuredGrid({kind: np.ascontiguousarray(nodes.T)}, spatial(mesh.doflocs.T))


def spatial(vectors: Any) -> Any:
    """Return vectors (n, 2) of the section as (n, 3), with 0 along y; vectors (n, 3) are copied."""
    return np.insert(vectors, 1, 0.0, axis=1) if vectors.shape[1] == 2 else np.array(vectors, dtype=float)


def at_all_nodes(mesh: skfem.Mesh, vertices: Any, values: Any) -> Any:
    """Return values at the vertices (k,) at all nodes of a second-order mesh, shape (n,), linear along the edges."""
    found = np.zeros(mesh.doflocs.shape[1])
    found[vertices] = values
    nodes, corners = np.asarray(mesh.dofs.element_dofs), mesh.dim() + 1
    ends = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
    for row, (a, b) in zip(nodes[corners:], ends, strict=False):
        found[row] = (found[nodes[a]] + found[nodes[b]]) / 2
    return found


def _save(path: str | Path, grid: Any) -> None:
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    # VTK writes into memory, because on a full disk it would end the whole process
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    with atomic(path) as temporary:
        temporary.write_text(writer.GetOutputString(), encoding="ascii")
