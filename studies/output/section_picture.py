"""The section of a solution along its shear, as curved triangles and as the flat triangles that VTK draws; mm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.output.vtk_files import spatial

if TYPE_CHECKING:
    from fem.results.revolved_body import Body
    from fem.solution import Solution

PIECES = 6
"""Pieces into which each edge of a curved triangle is divided for drawing."""


class Cut(NamedTuple):
    """The curved triangles in the plane y = 0.

    Attributes
    ----------
    rest, moved : undeformed and deformed nodes, shape (m, 6, 3), mm.
    value : displacement at the nodes, shape (m, 6), mm.
    edges : outline, undeformed and deformed, three nodes to an edge, shape (k, 2, 3, 3), mm.
    """

    rest: Array
    moved: Array
    value: Array
    edges: Array


def cut_of(solution: Solution) -> Cut:
    """Return the section of the deformed body in the plane of its shear (without a shear y = 0), rotated to y = 0.

    The section of an axisymmetric body is mirrored; the tetrahedra of a body without a plane of symmetry are cut.
    """
    from fem.results import revolved_body

    solid = revolved_body.revolve(solution.field)
    if not revolved_body.mirrored(solution):
        x, y = solution.load.direction
        return _sliced(revolved_body.turn(solid, (x, -y)))
    u = spatial(solid.u)
    x = spatial(solid.mesh.doflocs.T)
    nodes = _triangles(solid.mesh)
    ends = _outline(nodes)
    edges = np.stack([x[ends], (x + u)[ends]], axis=1)
    rest, moved, values = x[nodes], (x + u)[nodes], np.linalg.norm(u, axis=1)[nodes]
    # an axisymmetric mesh ends at the axis, and its edges there are no outline
    if solid.mesh.dim() == 2:
        mirror = np.array([-1.0, 1.0, 1.0])
        on_axis = np.abs(edges[:, 0, :, 0]).max(axis=1) < 1e-9 * np.abs(x).max()
        edges = np.concatenate([edges[~on_axis], edges[~on_axis] * mirror])
        rest, moved = np.concatenate([rest, rest * mirror]), np.concatenate([moved, moved * mirror])
        values = np.concatenate([values, values])
    return Cut(rest, moved, values, edges)


def _sliced(solid: Body) -> Cut:
    """Return the section of the undeformed tetrahedra with the plane y = 0: one or two triangles in each of them.

    The crossings are computed as if the cells were straight. Neighbours share the barycentric coordinates of a
    crossing, so the section has no gaps.
    """
    nodes = np.asarray(solid.mesh.dofs.element_dofs, dtype=np.int64).T
    x = solid.mesh.doflocs.T
    cell, corners = _crossings(x[nodes[:, :4], 1])
    ends = np.array([(0, 1), (1, 2), (2, 0)])
    middles = corners[:, ends].mean(axis=2)
    points = np.concatenate([corners, middles[:, [0, 1, 2]]], axis=1)
    pairs = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
    # second-order shape functions at the triangles' nodes, with which place and displacement are interpolated
    edge_shapes = 4 * points[..., pairs[:, 0]] * points[..., pairs[:, 1]]
    shapes = np.concatenate([points * (2 * points - 1), edge_shapes], axis=-1)
    rest, u = (np.einsum("kpa,kai->kpi", shapes, nodal[nodes[cell]]) for nodal in (x, solid.u))
    # an edge of the section lies in a face of its cell: both ends have no share of the corner opposite to that face
    opposite = (corners[:, ends] == 0).all(axis=2)
    outer = np.zeros(solid.mesh.facets.shape[1], dtype=bool)
    outer[solid.mesh.boundary_facets()] = True
    on_face = outer[solid.mesh.t2f[[3, 2, 1, 0]].T][cell][:, None, :]
    triangle, side = np.nonzero((opposite & on_face).any(axis=2))
    curve = np.stack([ends[side, 0], side + 3, ends[side, 1]], axis=1)
    moved = rest + u
    edges = np.stack([rest[triangle[:, None], curve], moved[triangle[:, None], curve]], axis=1)
    return Cut(rest, moved, np.linalg.norm(u, axis=2), edges)


def _crossings(y: Array) -> tuple[NDArray[np.int64], Array]:
    """Find the triangles in which linear functions y in tetrahedra are zero.

    Parameters
    ----------
    y : values at the corners of m cells, shape (m, 4).

    Returns
    -------
    Cells, shape (k,), and barycentric coordinates of the triangles' corners, shape (k, 3, 4).
    """
    above = y >= 0
    order = np.argsort(above, axis=1, kind="stable")
    count = above.sum(axis=1)
    cells, coordinates = [], []
    # the cut is a triangle round a single corner, or a quadrilateral of two triangles between two corners and two;
    # numbers are places in `order`, which lists the corners below the plane first
    for number, triangles in (
        (1, [((3, 0), (3, 1), (3, 2))]),
        (3, [((0, 1), (0, 2), (0, 3))]),
        (2, [((0, 2), (0, 3), (1, 3)), ((0, 2), (1, 3), (1, 2))]),
    ):
        cell = np.flatnonzero(count == number)
        for triangle in triangles:
            corners = np.zeros((len(cell), 3, 4))
            for i, (a, b) in enumerate(triangle):
                one, other = order[cell, a], order[cell, b]
                share = y[cell, one] / (y[cell, one] - y[cell, other])
                corners[np.arange(len(cell)), i, one] = 1 - share
                corners[np.arange(len(cell)), i, other] = share
            cells.append(cell)
            coordinates.append(corners)
    return np.concatenate(cells), np.concatenate(coordinates)


def _triangles(mesh: Any) -> NDArray[np.int64]:
    """Return the nodes of the curved triangles in the plane y = 0, shape (m, 6): corners, then edges 01, 12, 02."""
    nodes = np.asarray(mesh.dofs.element_dofs, dtype=np.int64)
    if mesh.dim() == 2:
        return nodes.T
    faces = [[0, 1, 2, 4, 5, 6], [0, 1, 3, 4, 8, 7], [0, 2, 3, 6, 9, 7], [1, 2, 3, 5, 9, 8]]
    sides = np.concatenate([nodes[face] for face in faces], axis=1)
    flat = np.abs(mesh.doflocs[1, sides]).max(axis=0) < 1e-9 * np.abs(mesh.doflocs).max()
    return sides[:, flat].T


def _outline(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the nodes (end, middle, end) of the edges that belong to one triangle only, shape (k, 3)."""
    edges = np.concatenate([triangles[:, [0, 3, 1]], triangles[:, [1, 4, 2]], triangles[:, [0, 5, 2]]])
    _, first, count = np.unique(edges[:, 1], return_index=True, return_counts=True)
    return np.asarray(edges[first[count == 1]])


def surface(corners: Array, value: Array) -> Any:
    """Divide curved triangles, shape (m, 6, 3), into a PyVista surface of flat ones.

    Parameters
    ----------
    value : values at the nodes, shape (m, 6); the points of the surface get their interpolation.
    """
    import pyvista as pv

    grid = [(i, j) for i in range(PIECES + 1) for j in range(PIECES + 1 - i)]
    number = {pair: k for k, pair in enumerate(grid)}
    a, b = np.array(grid, dtype=float).T / PIECES
    c = 1 - a - b
    shape = np.stack([c * (2 * c - 1), a * (2 * a - 1), b * (2 * b - 1), 4 * c * a, 4 * a * b, 4 * b * c])
    small = [(number[i, j], number[i + 1, j], number[i, j + 1]) for i, j in grid if i + j < PIECES]
    small += [(number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]) for i, j in grid if i + j < PIECES - 1]
    points = np.einsum("kp,mki->mpi", shape, corners).reshape(-1, 3)
    faces = np.array(small) + len(grid) * np.arange(len(corners))[:, None, None]
    surface = pv.PolyData.from_regular_faces(points, faces.reshape(-1, 3))
    surface.point_data["value"] = np.einsum("kp,mk->mp", shape, value).ravel()
    return surface


def lines(edges: Array, towards: float) -> Any:
    """Return the curves through three nodes of each edge, shape (k, 3, 3), moved by `towards` mm to the viewer."""
    import pyvista as pv

    t = np.linspace(0, 1, PIECES + 1)
    shape = np.stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
    points = np.einsum("kp,eki->epi", shape, edges) - [0.0, towards, 0.0]
    pairs = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
    ends = np.stack([pairs[:, :-1], pairs[:, 1:]], axis=2).reshape(-1, 2)
    return pv.PolyData(points.reshape(-1, 3), lines=np.insert(ends, 0, 2, axis=1).ravel())
