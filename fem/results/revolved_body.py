"""A section with harmonics as a solid body of second-order tetrahedra, for files and pictures.

The body is the half y >= 0, or the whole one if the fields have sine orders. All other fields except those of the
full model belong to a load along the model's own x axis; see `Load.direction`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from scipy.spatial import cKDTree

from fem.model import angular_fields
from fem.solution import Field, Solution
from geometry.arrays import Array, Ints
from geometry.mesh import turned

SECTORS = 12
"""Wedges of 15 degrees in half a turn."""


@dataclass(frozen=True, slots=True)
class Body:
    """A solid mesh (mm), with displacements (n, 3) in mm and pressures (k,) in MPa at the nodes `vertices` (k,)."""

    mesh: skfem.Mesh
    u: Array
    p: Array
    vertices: Ints


def place(solution: Solution) -> Body:
    """Return the body of a solution in the user's frame."""
    solid = revolve(solution.body)
    return turn(solid, solution.load.direction) if mirrored(solution) else solid


def mirrored(solution: Solution) -> bool:
    """Return whether the fields of a solution are symmetric about the plane y = 0 of its model."""
    return solution.model != "full" and not solution.body.angles.sines


def turn(solid: Body, direction: tuple[float, float]) -> Body:
    """Return a solid body rotated about z, its x axis turned to a direction (unit vector); sections are unchanged."""
    if direction == (1.0, 0.0) or solid.mesh.dim() == 2:
        return solid
    c, s = direction
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    mesh = skfem.MeshTet2(rotation @ solid.mesh.doflocs, solid.mesh.t)
    return Body(mesh, solid.u @ rotation.T, solid.p, solid.vertices)


def revolve(field: Field) -> Body:
    """Return the body of a field with Cartesian displacements: its own mesh, or the revolved one if it has harmonics.

    Every node of the body is a node of the section at some angle, and has the exact values of the Fourier series.
    """
    if field.angles.harmonics == 0:
        return Body(field.mesh, field.u, field.p[:, 0], field.vertices)
    section, sines = field.mesh, field.angles.sines
    mesh = turned(section, SECTORS, half=not sines)
    x, y, z = mesh.doflocs
    node = cKDTree(section.doflocs.T).query(np.stack([np.hypot(x, y), z], axis=1))[1]
    series = angular_fields.fields_at(np.arctan2(y, x), field.angles.harmonics, sines=sines)
    E = np.einsum("ijt,tjf->tif", angular_fields.rotations(series.theta), series.E)
    u = np.einsum("nif,nf->ni", E, field.u[node])
    place_of = np.full(section.doflocs.shape[1], -1)
    place_of[field.vertices] = np.arange(len(field.vertices))
    vertices = np.arange(mesh.nvertices)
    p = np.sum(field.p[place_of[node[vertices]]] * series.C[vertices], axis=1)
    return Body(skfem.MeshTet2(mesh.doflocs, mesh.t), u, p, vertices)
