"""The surface of a deformed body, cut along the plane y = 0 so that the magnet shows, of a section or a .vtu grid.

A grid holds the section of an axisymmetric solution, half the body or the whole; all three give the same parts: the
skin of each half, the cut face, and the magnet, whose surface is the wall of its pocket in the silicone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Array, Ints
from geometry.design import Design

if TYPE_CHECKING:
    from fem.model import angular_fields
    from fem.solution import Field

FLAT = 1e-7
"""Share of the body's size up to which a point lies in the plane y = 0."""
QUARTERS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
"""The four flat triangles of a curved one."""
ARC = 7
"""Points on a quarter of the magnet's rounded edge."""
SECTORS = 24
"""Sectors of half a turn."""

Part = tuple[Array, Array, Ints]
"""Undeformed points (n, 3), displacements (n, 3), mm, and triangles (m, 3)."""


def parts_of(grid: Any) -> dict[str, Part]:
    """Return the parts of a PyVista grid with point data `displacement_mm`, whose points are the deformed ones."""
    import pyvista as pv

    moved, u = np.asarray(grid.points, dtype=float), np.asarray(grid.point_data["displacement_mm"], dtype=float)
    rest = moved - u
    size = float(np.ptp(rest, axis=0).max())
    # a node beside the plane by an error of rounding would leave slivers of cells, which no neighbour shares
    rest[np.abs(rest[:, 1]) < FLAT * size, 1] = 0.0
    if not rest[:, 1].any():

        def displacement(few: Ints, turn: Array) -> Array:
            c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
            return np.stack([c * u[few, 0], s * u[few, 0], 0 * c + u[few, 2]], axis=2).reshape(-1, 3)

        nodes = np.asarray(grid.cells_dict[pv.CellType.QUADRATIC_TRIANGLE])
        return revolved(rest[:, [0, 2]].T, nodes, displacement, symmetric=True)
    cells, is_back, is_front = _flat_cells(grid, rest, u), rest[:, 1].min() >= 0, rest[:, 1].max() <= 0
    if is_back or is_front:
        half = _half(cells, size)
        other = {name: mirrored(part) for name, part in half.items()}
        back, front = (half, other) if is_back else (other, half)
    else:
        back, front = (_half(cells.clip((0.0, way, 0.0), origin=(0.0, 0.0, 0.0)), size) for way in (-1.0, 1.0))
    parts = {"back": back["skin"], "front": front["skin"], "cut": back["cut"]}
    return parts | ({"magnet": joined(back["magnet"], front["magnet"])} if "magnet" in back else {})


def _flat_cells(grid: Any, rest: Array, u: Array) -> Any:
    """Return each curved tetrahedron as eight flat ones, undeformed, with their displacements.

    A plane cuts only some cells, and makes flat ones of them, whose faces a curved neighbour would not share.
    """
    import pyvista as pv

    # nodes 4 to 9 are the middles of the edges 01, 12, 02, 03, 13, 23; the inner octahedron is cut along 6 to 8
    few = [
        (0, 4, 6, 7),
        (4, 1, 5, 8),
        (6, 5, 2, 9),
        (7, 8, 9, 3),
        (6, 8, 4, 5),
        (6, 8, 5, 9),
        (6, 8, 9, 7),
        (6, 8, 7, 4),
    ]
    nodes = np.asarray(grid.cells_dict[pv.CellType.QUADRATIC_TETRA])
    cells = np.concatenate([nodes[:, list(four)] for four in few])
    flat = pv.UnstructuredGrid({pv.CellType.TETRA: cells}, rest)
    flat.point_data["displacement_mm"] = u
    return flat


def _half(cells: Any, size: float) -> dict[str, Part]:
    """Return skin, cut face and pocket of half a body: the skin is the piece that reaches farthest from the axis."""
    import pyvista as pv
    from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

    surfaces = vtkDataSetSurfaceFilter()
    surfaces.SetInputData(cells)
    surfaces.Update()
    surface = pv.wrap(surfaces.GetOutput()).triangulate()
    u, rest = np.asarray(surface.point_data["displacement_mm"]), np.asarray(surface.points)
    triangles = np.asarray(surface.faces).reshape(-1, 4)[:, 1:]
    flat = (np.abs(rest[triangles, 1]) < 1e-5 * size).all(axis=1)
    walls = triangles[~flat]
    label = connected(np.concatenate([walls[:, :2], walls[:, 1:]]), len(rest))[walls[:, 0]]
    outer = label == label[np.hypot(rest[walls[:, 0], 0], rest[walls[:, 0], 1]).argmax()]
    parts = {"skin": walls[outer], "cut": triangles[flat], "magnet": walls[~outer]}
    return {name: _compact(rest, u, few) for name, few in parts.items() if len(few)}


def _compact(rest: Array, u: Array, triangles: Ints) -> Part:
    """Return triangles with only the points that they use."""
    used, numbers = np.unique(triangles, return_inverse=True)
    return rest[used], u[used], np.asarray(numbers.reshape(triangles.shape), dtype=np.int64)


def revolved(
    points: Array,
    nodes: Ints,
    displacement: Callable[[Ints, Array], Array],
    *,
    symmetric: bool,
    sectors: int = SECTORS,
) -> dict[str, Part]:
    """Return the parts of the body whose section is given: "front" (y <= 0), "back" (y >= 0), "cut" and "magnet".

    Parameters
    ----------
    points : of the section, r and z, shape (2, n), mm.
    nodes : of its triangles, corners and then the middles of the edges 01, 12 and 02, shape (m, 6).
    displacement : returns those of nodes (k,) at angles (t,), shape (t k, 3), mm.
    symmetric : whether the halves are mirror images.
    """
    skin, pocket = _outline(points[0], nodes)
    turn = np.linspace(0, math.pi, sectors + 1)

    def halves(edges: Ints) -> tuple[Part, Part]:
        back = _swept(points, edges, turn, displacement)
        return back, mirrored(back) if symmetric else _swept(points, edges, turn + math.pi, displacement)

    back, front = halves(skin)
    flat = np.concatenate([nodes[:, list(corners)] for corners in QUARTERS])
    x, z = points
    sides = np.concatenate([np.stack([s * x, 0 * x, z], axis=1) for s in (1.0, -1.0)])
    u = displacement(np.arange(len(x)), np.array([0.0, math.pi]))
    parts = {"back": back, "front": front, "cut": (sides, u, np.concatenate([flat, flat[:, ::-1] + len(x)]))}
    return parts | ({"magnet": joined(*halves(pocket))} if len(pocket) else {})


def _outline(r: Array, nodes: Ints) -> tuple[Ints, Ints]:
    """Return the straight halves (m, 2) of the outline's edges: those of the skin and those of a pocket."""
    edges = np.concatenate([nodes[:, [0, 3, 1]], nodes[:, [1, 4, 2]], nodes[:, [2, 5, 0]]])
    _, first, number = np.unique(edges[:, 1], return_index=True, return_counts=True)
    outline = edges[first[number == 1]]
    outline = outline[r[outline].max(axis=1) > 1e-9 * r.max()]
    halves = np.concatenate([outline[:, :2], outline[:, 1:]])
    label = connected(halves, len(r))
    # the skin is the piece that reaches farthest from the axis
    outer = label[halves[np.argmax(r[halves[:, 0]]), 0]]
    of_skin = label[halves[:, 0]] == outer
    return halves[of_skin], halves[~of_skin]


def connected(edges: Ints, count: int) -> Ints:
    """Return the number of the connected piece of each node, shape (count,)."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])


def _swept(points: Array, edges: Ints, turn: Array, displacement: Callable[[Ints, Array], Array]) -> Part:
    """Return the surface of edges (m, 2) of the section swept through the angles (t,)."""
    used, numbers = np.unique(edges, return_inverse=True)
    pairs, n = numbers.reshape(edges.shape), len(used)
    x, z = points[:, used]
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
    return rest, displacement(used, turn), faces[area > 1e-12 * area.max()]


def mirrored(part: Part) -> Part:
    """Return the other half of a body that is symmetric about y = 0."""
    rest, u, triangles = part
    mirror = np.array([1.0, -1.0, 1.0])
    return rest * mirror, u * mirror, triangles[:, ::-1]


def joined(one: Part, other: Part) -> Part:
    """Return two parts as one."""
    first, second = (np.concatenate(pair) for pair in zip(one[:2], other[:2], strict=True))
    return first, second, np.concatenate([one[2], other[2] + len(one[0])])


def fourier_fields(field: Field, theta: Array) -> angular_fields.Angles:
    """Return the fields of a section at angles (t,)."""
    # deferred: pictures of a file need no finite elements
    from fem.model import angular_fields

    return angular_fields.fields_at(theta, field.angles.harmonics, sines=field.angles.sines)


def of_field(field: Field, sectors: int = SECTORS) -> dict[str, Part]:
    """Return the parts of the body whose section is solved, sheared along x; see `revolved`."""

    def displacement(nodes: Ints, turn: Array) -> Array:
        u = fourier_fields(field, turn).E @ field.u[nodes].T
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        return np.stack([c * u[:, 0] - s * u[:, 1], s * u[:, 0] + c * u[:, 1], u[:, 2]], axis=2).reshape(-1, 3)

    nodes = np.asarray(field.mesh.dofs.element_dofs).T
    return revolved(field.mesh.doflocs, nodes, displacement, symmetric=not field.angles.sines, sectors=sectors)


def outer_edges(triangles: Ints, rest: Array) -> Ints:
    """Return the edges (n, 2) of one triangle only, without those on the axis, where both sides meet."""
    edges = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, first, number = np.unique(edges @ [len(rest), 1], return_index=True, return_counts=True)
    outer = edges[first[number == 1]]
    return np.asarray(outer[np.abs(rest[outer, 0]).max(axis=1) > 1e-6])


def magnet_outline(design: Design, shift_x: float, shift_z: float, tilt: float) -> Array:
    """Return the outline of the displaced magnet in the plane of the section, shape (n, 2), mm."""
    a, b, rho = design.magnet_diameter / 2, design.magnet_height / 2, design.magnet_edge_radius
    turn = np.linspace(0, math.pi / 2, ARC if rho else 1)
    corners = ((1, 1, 0.0), (-1, 1, math.pi / 2), (-1, -1, math.pi), (1, -1, 3 * math.pi / 2))
    arcs = [
        np.stack([i * (a - rho) + rho * np.cos(turn + t), j * (b - rho) + rho * np.sin(turn + t)], axis=1)
        for i, j, t in corners
    ]
    x, z = np.concatenate(arcs).T
    c, s = math.cos(tilt), math.sin(tilt)
    return np.stack([c * x + s * z + shift_x, c * z - s * x + shift_z + design.H], axis=1)
