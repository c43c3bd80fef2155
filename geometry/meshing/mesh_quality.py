"""What a mesh of the beam is worth: counts, volumes against the exact ones, shapes and Jacobians of its cells."""

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
    """What a mesh is worth.

    Attributes
    ----------
    cells, nodes : counts; the nodes include those in the middle of edges.
    volumes : volume of each region, in the cube of the mesh's unit.
    volume_errors : their relative errors against the exact bodies.
    base_error : relative error of the area of the base.
    gap : greatest distance of side, dome and interface from the exact surfaces, in the mesh's unit.
    least_shape, mean_shape : three times the inscribed over the circumscribed radius of straight cells; 1 is best.
    least_jacobian : least ratio in a cell of the least to the greatest Jacobian at the quadrature points of order 4;
        1 is straight, 0 is folded.
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
    """The quality of a mesh that `tetrahedra` made for `shape`."""
    part = 0.5 if "symmetry" in mesh.boundaries else 1.0
    nodes = mesh.dofs.element_dofs
    det = determinants(mesh.doflocs, nodes)
    found = volumes(mesh)
    right = {"silicone": part * cad.beam_volume(shape)}
    if "magnet" in mesh.boundaries:
        right["magnet"] = part * cad.magnet_volume(shape)
        right["silicone"] -= right["magnet"]
    base = np.linalg.norm(patches(mesh.doflocs, facet_nodes(mesh, mesh.boundaries["base"]))[1], axis=0).sum()
    shapes = radius_ratios(mesh.doflocs[:, mesh.t])
    return Quality(
        cells=mesh.nelements,
        nodes=mesh.doflocs.shape[1],
        volumes=found,
        volume_errors={name: value / right[name] - 1 for name, value in found.items()},
        base_error=float(base / (part * math.pi * shape.R**2) - 1),
        gap=_gap(mesh, shape),
        least_shape=float(shapes.min()),
        mean_shape=float(shapes.mean()),
        least_jacobian=float((det[4:].min(axis=0) / det[4:].max(axis=0)).min()),
    )


def _gap(mesh: MeshTet2, shape: Shape) -> float:
    """Greatest distance of the points of integration on the curved facets from the exact surfaces."""
    found = 0.0
    for name, about in (("skin", exact_surfaces.skin), ("magnet", exact_surfaces.magnet)):
        if name in mesh.boundaries:
            points = patches(mesh.doflocs, facet_nodes(mesh, mesh.boundaries[name]))[0]
            found = max(found, float(np.abs(about(points, shape).distance).max()))
    return found
