"""The deformed sensor in 3D for the page: skin of each half, cut face y = 0 and the magnet's pocket.

The outline of a section is swept around the axis with the Fourier series of the solution, which takes milliseconds.
`studies.report.deformed_surface`, which reads VTK grids, gives the same form.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fem.solution import Field, Solution
from geometry.arrays import Array, Ints
from studies.explorer.section_data import FLAT, fourier_fields, plane_of

SECTORS = 24
"""Sectors of half a turn."""
DIGITS = 3
"""Decimals of coordinates, mm."""

Part = tuple[Array, Array, Ints]
"""Undeformed points (n, 3), displacements (n, 3), mm, and triangles (m, 3)."""


def surface(solution: Solution) -> dict[str, Any]:
    """Return the part `sensor3d`: parts with deformed points, displacements and triangles, and the largest one."""
    parts = _parts(solution)
    return {"parts": {name: _data(*part) for name, part in parts.items()}, "largest": _largest(parts)}


def _data(rest: Array, u: Array, triangles: Ints) -> dict[str, Any]:
    return {
        "points": np.round(rest + u, DIGITS).ravel(),
        "value": np.round(np.linalg.norm(u, axis=1), DIGITS),
        "triangles": triangles.ravel(),
    }


def _largest(parts: dict[str, Part]) -> float:
    return round(max(float(np.linalg.norm(u, axis=1).max()) for _, u, _ in parts.values()), DIGITS)


def _parts(solution: Solution) -> dict[str, Part]:
    """Return the parts of a section, turned into the direction of its shear."""
    field = solution.field
    nodes = np.asarray(field.mesh.dofs.element_dofs).T
    skin, pocket = _outline(field, nodes)
    turn = np.linspace(0, math.pi, SECTORS + 1)
    c, s = plane_of(solution)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def turned(part: Part) -> Part:
        rest, u, triangles = part
        return rest @ rotation.T, u @ rotation.T, triangles

    def halves(edges: Ints) -> tuple[Part, Part]:
        """Return the halves y >= 0 and y <= 0, which are mirror images without sine orders."""
        back = _swept(field, edges, turn)
        return back, _swept(field, edges, turn + math.pi) if field.angles.sines else _mirrored(back)

    back, front = halves(skin)
    parts = {"back": turned(back), "front": turned(front), "cut": turned(_cut_face(field, nodes))}
    if len(pocket):
        parts["magnet"] = turned(_joined(*halves(pocket)))
    return parts


def _outline(field: Field, nodes: Ints) -> tuple[Ints, Ints]:
    """Return the straight halves (m, 2) of the outline's edges: those of the skin and those of a pocket."""
    r = field.mesh.doflocs[0]
    edges = np.concatenate([nodes[:, [0, 3, 1]], nodes[:, [1, 4, 2]], nodes[:, [2, 5, 0]]])
    _, first, number = np.unique(edges[:, 1], return_index=True, return_counts=True)
    outline = edges[first[number == 1]]
    outline = outline[r[outline].max(axis=1) > 1e-9 * r.max()]
    halves = np.concatenate([outline[:, :2], outline[:, 1:]])
    label = _connected(halves, len(r))
    # the skin is the piece that reaches farthest from the axis
    outer = label[halves[np.argmax(r[halves[:, 0]]), 0]]
    of_skin = label[halves[:, 0]] == outer
    return halves[of_skin], halves[~of_skin]


def _connected(edges: Ints, count: int) -> Ints:
    """Return the number of the connected piece of each node, shape (count,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _swept(field: Field, edges: Ints, turn: Array) -> Part:
    """Return the surface of edges (m, 2) of the section swept through the angles (t,)."""
    used, numbers = np.unique(edges, return_inverse=True)
    pairs, n = numbers.reshape(edges.shape), len(used)
    x, z = field.mesh.doflocs[:, used]
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    rest = np.stack([c * x, s * x, np.broadcast_to(z, (len(turn), n))], axis=2).reshape(-1, 3)
    triangles = []
    for k in range(len(turn) - 1):
        a, b = pairs[:, 0] + k * n, pairs[:, 1] + k * n
        triangles += [np.stack([a, b, b + n], axis=1), np.stack([a, b + n, a + n], axis=1)]
    faces = np.concatenate(triangles)
    # at the axis one of both triangles has no area
    corners = rest[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return rest, _displacement(field, used, turn), faces[area > 1e-12 * area.max()]


def _displacement(field: Field, nodes: Ints, turn: Array) -> Array:
    """Return the displacements of nodes (n,) at angles (t,), shape (t n, 3), mm, in Cartesian components."""
    angles = fourier_fields(field, turn)
    u = angles.E @ field.u[nodes].T
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    return np.stack([c * u[:, 0] - s * u[:, 1], s * u[:, 0] + c * u[:, 1], u[:, 2]], axis=2).reshape(-1, 3)


def _mirrored(part: Part) -> Part:
    """Return the other half of a body that is symmetric about y = 0."""
    rest, u, triangles = part
    mirror = np.array([1.0, -1.0, 1.0])
    return rest * mirror, u * mirror, triangles[:, ::-1]


def _joined(one: Part, other: Part) -> Part:
    return (
        np.concatenate([one[0], other[0]]),
        np.concatenate([one[1], other[1]]),
        np.concatenate([one[2], other[2] + len(one[0])]),
    )


def _cut_face(field: Field, nodes: Ints) -> Part:
    """Return the section on both sides of the axis, in the plane y = 0."""
    flat = np.concatenate([nodes[:, list(corners)] for corners in FLAT])
    every, (x, z) = np.arange(field.mesh.doflocs.shape[1]), field.mesh.doflocs
    sides = [np.stack([s * x, 0 * x, z], axis=1) for s in (1.0, -1.0)]
    u = _displacement(field, every, np.array([0.0, math.pi]))
    return np.concatenate(sides), u, np.concatenate([flat, flat[:, ::-1] + len(x)])
