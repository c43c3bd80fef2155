"""A section with harmonics as a solid body of second-order tetrahedra, for files and pictures.

The body is the half y >= 0, or the whole one if the fields have sine orders. All other fields except those of the
full model belong to a load along the model's own x axis; see `Load.direction`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.model import angular_fields
from fem.solution import Field, Solution
from geometry.arrays import Array

SECTORS = 12
"""Wedges of 15 degrees in half a turn."""


@dataclass(frozen=True, slots=True)
class Body:
    """A solid mesh (mm), with displacements (n, 3) in mm and pressures (k,) in MPa at the nodes `vertices` (k,)."""

    mesh: skfem.Mesh
    u: Array
    p: Array
    vertices: NDArray[np.int64]


def place(solution: Solution) -> Body:
    """Return the body of a solution in the user's frame."""
    solid = revolve(solution.field)
    return turn(solid, solution.load.direction) if mirrored(solution) else solid


def mirrored(solution: Solution) -> bool:
    """Return whether the fields of a solution are symmetric about the plane y = 0 of its model."""
    return solution.model != "full" and not solution.field.angles.sines


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

    Every triangle is swept through SECTORS wedges, each cut into three tetrahedra. The nodes lie on the swept curved
    edges and have the exact values of the Fourier series.
    """
    if field.angles.harmonics == 0:
        return Body(field.mesh, field.u, field.p[:, 0], field.vertices)
    section, half, full_turn = field.mesh, 2 * SECTORS, field.angles.sines
    rays = _rays(full_turn)
    corners = len(section.p[0])
    on_axis = section.doflocs[0] < 1e-9 * section.doflocs.max()
    # a corner of the solid is a corner of the section on a ray: the half plane at the angle pi ray / half
    straight = _wedges(section, on_axis[:corners], full_turn)
    used, t = np.unique(straight, return_inverse=True)
    node, ray = used // rays, used % rays
    x = section.doflocs
    angle = np.pi * ray / half
    flat = np.stack([x[0, node] * np.cos(angle), x[0, node] * np.sin(angle), x[1, node]])
    mesh = skfem.MeshTet2.from_mesh(skfem.MeshTet(flat, np.ascontiguousarray(t.reshape(straight.shape).T)))
    node, ray = _edges(field, mesh, node, ray, on_axis)
    ray %= rays
    angle = np.pi * ray / half
    # the series at the angles of the rays
    series = angular_fields.fields_at(np.pi * np.arange(rays) / half, field.angles.harmonics, sines=full_turn)
    E = np.einsum("ijt,tjf->tif", angular_fields.rotations(series.theta), series.E)
    u = np.einsum("nif,nf->ni", E[ray], field.u[node])
    where = np.full(len(x[0]), -1)
    where[field.vertices] = np.arange(len(field.vertices))
    vertices = np.arange(len(used))
    p = np.sum(field.p[where[node[vertices]]] * series.C[ray[vertices]], axis=1)
    places = np.stack([x[0, node] * np.cos(angle), x[0, node] * np.sin(angle), x[1, node]])
    return Body(skfem.MeshTet2(places, mesh.t), u, p, vertices)


def _rays(full_turn: bool) -> int:
    """Return the number of rays, two to a wedge; on the whole body the last one is followed by the first."""
    return 4 * SECTORS if full_turn else 2 * SECTORS + 1


def _wedges(section: skfem.Mesh, on_axis: NDArray[np.bool_], full_turn: bool) -> NDArray[np.int64]:
    """Return the corners (m, 4) of the tetrahedra, section node times the number of rays plus ray; no flat ones."""
    a, b, c = np.sort(section.t, axis=0)[:, :, None]
    wedges, rays = 2 * SECTORS if full_turn else SECTORS, _rays(full_turn)
    lower, upper = 2 * np.arange(wedges), 2 * np.arange(1, wedges + 1) % rays

    def at(node: NDArray[np.int64], ray: NDArray[np.int64]) -> NDArray[np.int64]:
        return node * rays + np.where(on_axis[node], 0, ray)

    cells = np.concatenate(
        [
            np.stack([at(a, lower), at(b, lower), at(c, lower), at(c, upper)], axis=-1).reshape(-1, 4),
            np.stack([at(a, lower), at(b, lower), at(b, upper), at(c, upper)], axis=-1).reshape(-1, 4),
            np.stack([at(a, lower), at(a, upper), at(b, upper), at(c, upper)], axis=-1).reshape(-1, 4),
        ]
    )
    ordered = np.sort(cells, axis=1)
    return cells[(np.diff(ordered, axis=1) > 0).all(axis=1)]


def _edges(
    field: Field,
    mesh: skfem.Mesh,
    node: NDArray[np.int64],
    ray: NDArray[np.int64],
    on_axis: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the section node and the ray of all nodes of the solid, from those of its corners."""
    section = field.mesh
    triangle = np.asarray(section.dofs.element_dofs)
    middle = {}
    for i, j, m in ((0, 1, 3), (1, 2, 4), (0, 2, 5)):
        for first, second, between in triangle[[i, j, m]].T:
            middle[min(first, second), max(first, second)] = between
    start, end = mesh.edges
    first, second = node[start], node[end]
    between = np.array(
        [i if i == j else middle[min(i, j), max(i, j)] for i, j in zip(first, second, strict=True)], dtype=np.int64
    )
    # a node on the axis is on every ray: an edge from it lies on the ray of its other end
    a = np.where(on_axis[first], ray[end], ray[start])
    b = np.where(on_axis[second], ray[start], ray[end])
    # between the last ray and the first one of a whole body
    around = np.where(np.abs(a - b) > 2, 4 * SECTORS, 0)
    return np.concatenate([node, between]), np.concatenate([ray, (a + b + around) // 2])
