"""Quality of a mesh of the beam: counts, errors of volumes, shapes and Jacobians of cells."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from skfem import MeshTet2

from geometry import cad
from geometry.design import Shape
from geometry.meshing import exact_surfaces
from geometry.meshing.curved_mesh import determinants, facet_nodes, patches, radius_ratios, volumes


@dataclass(frozen=True, slots=True)
class Quality:
    """Counts and measures of the quality of a mesh.

    Attributes
    ----------
    cells, nodes : counts; the nodes include the middle nodes of edges.
    volumes : volume of each region, in the cube of the mesh's unit.
    volume_errors : relative error of each volume against the exact body.
    base_error : relative error of the area of the base.
    gap : greatest distance of side, dome and interface from the exact surfaces, in the mesh's unit.
    least_shape, mean_shape : three times the inscribed over the circumscribed radius of straight cells; 1 is best.
    least_jacobian : ratio of the least to the greatest Jacobian determinant of a cell, at the quadrature points of
        order 4; the least ratio of all cells. 1 is a straight cell, 0 a folded one.
    """

    cells: int
    nodes: int
    volumes: dict[str, float]
    volume_errors: dict[str, float]
    base_error: float
    gap: float
    least_shape: float
    mean_shape: float
    least_jacobian: float


def quality(mesh: MeshTet2, shape: Shape) -> Quality:
    """Return the quality of a mesh that `geometry.mesh.tetrahedra` made for `shape`."""
    part = 0.5 if "symmetry" in mesh.boundaries else 1.0
    nodes = mesh.dofs.element_dofs
    det = determinants(mesh.doflocs, nodes)
    measured = volumes(mesh)
    exact = {"silicone": part * cad.beam_volume(shape)}
    if "magnet" in mesh.boundaries:
        exact["magnet"] = part * cad.magnet_volume(shape)
        exact["silicone"] -= exact["magnet"]
    base = np.linalg.norm(patches(mesh.doflocs, facet_nodes(mesh, mesh.boundaries["base"]))[1], axis=0).sum()
    shapes = radius_ratios(mesh.doflocs[:, mesh.t])
    return Quality(
        cells=mesh.nelements,
        nodes=mesh.doflocs.shape[1],
        volumes=measured,
        volume_errors={name: value / exact[name] - 1 for name, value in measured.items()},
        base_error=float(base / (part * math.pi * shape.R**2) - 1),
        gap=_gap(mesh, shape),
        least_shape=float(shapes.min()),
        mean_shape=float(shapes.mean()),
        least_jacobian=float((det[4:].min(axis=0) / det[4:].max(axis=0)).min()),
    )


def _gap(mesh: MeshTet2, shape: Shape) -> float:
    """Return the greatest distance of quadrature points on the curved facets from the exact surfaces."""
    greatest = 0.0
    for name, about in (("skin", exact_surfaces.skin), ("magnet", exact_surfaces.magnet)):
        if name in mesh.boundaries:
            points = patches(mesh.doflocs, facet_nodes(mesh, mesh.boundaries[name]))[0]
            greatest = max(greatest, float(np.abs(about(points, shape).distance).max()))
    return greatest
