"""The second-order tetrahedral mesh of the beam with its magnet: the section, turned about the axis.

Half-planes through the axis divide the body into sectors. A triangle of the section (`geometry.section`) sweeps a
prism in each sector. The prism becomes three tetrahedra, fewer at the axis, where edges of it vanish. Each
quadrilateral of a prism is divided from its corner with the lower number, so that neighbours agree; every second
sector is the mirror image of the one before. The mesh is therefore symmetric about x = 0, and about y = 0 if it is
whole. The same request gives the same mesh on every machine that gives the same section.

A middle node lies where the middle node of the section's edge has turned to: on the exact surface, or nearer to a
ring for elements that are graded towards it. Those on the surfaces are then moved out so far that the volumes are
exact.
"""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from skfem import MeshTet1, MeshTet2, MeshTri2

from geometry.arrays import Array, Ints
from geometry.design import BadInput, Shape
from geometry.meshing.mesh_quality import with_exact_volumes
from geometry.section import TIP, edges_of, pair_keys, section

MagnetCells = Literal["regions", "hole", "none"]

AROUND = 5 / 3
"""Edge length around the axis on the skin, over that along it. Displacements vary like a few harmonics of the angle:
at level quick the force of the paper's sensor in press and shear is 0.06 % off with six sectors, 0.03 % with ten,
0.44 % with four."""
SOLID_GROWTH = 0.6
"""Growth of the edge length per unit of distance from edges of the magnet and the clamp, where most cells are. Forces
of half at level quick are then up to 0.3 % off on ten designs, whose estimated errors are 0.6 to 3.3 %. A growth of
0.4, that of sections, takes twice the unknowns for 0.06 % in place of 0.21 % on the paper's sensor."""


def tetrahedra(
    shape: Shape,
    size: float,
    *,
    half: bool = True,
    magnet: MagnetCells = "regions",
    tip_size: float | None = None,
    rim: tuple[float, float] | None = None,
) -> MeshTet2:
    """Mesh the beam in the unit of `shape`, with the base at z = 0 and cells curved to the exact surfaces.

    Parameters
    ----------
    size : edge length in the bulk and along the skin, at most half the radius; edges are shorter near the magnet's
        edges, at the clamped rim and in thin layers, and longer around the axis (AROUND).
    half : True to mesh the part y >= 0 only.
    magnet : "regions" meshes the magnet too, with a conforming interface; "hole" leaves it out; "none" fills its
        place with silicone.
    tip_size : edge length at the tip, where a plate touches first; default: half of `size`.
    rim : radius of a ring on the dome, and edge length at it: its edges part the facets inside from those outside.

    Returns
    -------
    Mesh with boundaries "base", "skin" (side and dome), "symmetry" (half only) and "magnet" (its surface), and
    subdomains "silicone" and "magnet".

    Raises
    ------
    BadInput
        A size is not a positive number, the ring is not on the dome, or the magnet is missing or not inside the beam.
    MeshError
        The section could not be meshed.
    """
    for name, value in (("size", size), ("tip_size", tip_size), ("the edge length at the rim", rim and rim[1])):
        if value is not None and not 0 < value < math.inf:
            raise BadInput(f"{name} must be a positive finite length; got {value:g}")
    if rim is not None and not rim[1] <= rim[0] <= 0.99 * shape.R:
        raise BadInput(
            f"the rim's radius must lie between its edge length {rim[1]:g} and 0.99 R = {0.99 * shape.R:g}; "
            f"got {rim[0]:g}"
        )
    if magnet != "none" and not shape.has_magnet:
        raise BadInput('this shape has no magnet (its diameter is 0): choose magnet="none"')
    if magnet != "none" and not shape.wall > 0:
        raise BadInput(f"the magnet must lie inside the beam; got a wall of {shape.wall:.3g}: take a smaller magnet")
    size = min(size, shape.R / 2)
    plane = section(
        shape,
        size,
        tip_size=TIP * size if tip_size is None else min(tip_size, size),
        rim=rim,
        magnet="meshed" if magnet == "regions" else magnet,
        glued=rim is not None,
        growth=SOLID_GROWTH,
    )
    # with three pairs of sectors to the half turn the area of the base is exact to 1e-4
    sectors = 2 * max(math.ceil(math.pi * shape.R / (2 * AROUND * size)), 3)
    return with_exact_volumes(
        turned(plane, sectors, half=half), shape if magnet != "none" else shape.without_magnet()
    )


def turned(plane: MeshTri2, sectors: int, *, half: bool) -> MeshTet2:
    """Return the body of revolution of a section (r, z) about z, with the boundaries and subdomains of the section.

    sectors : even number of sectors from y = 0 to y = 0; a whole body has twice as many. half : True for y >= 0 only.
    """
    turn, count = math.pi / sectors, sectors if half else 2 * sectors
    number, vertex, angle = _numbered(plane, turn, count, closed=not half)
    cells, triangle = _divided(plane, number)
    r, z = plane.doflocs[:, vertex]
    p = _placed(r, z, np.nan_to_num(angle))
    sides = p[:, cells[1:]] - p[:, cells[:1]]
    inverted = np.einsum("it,it->t", sides[:, 0], np.cross(sides[:, 1], sides[:, 2], axis=0)) < 0
    cells[2:, inverted] = cells[:1:-1, inverted]
    straight = MeshTet1(p, np.ascontiguousarray(cells), sort_t=False)
    mesh = MeshTet2.from_mesh(straight)
    x = mesh.doflocs.copy()
    x[:, mesh.nvertices :] = _middles(plane, straight.edges.astype(np.int64), vertex, angle)
    boundaries = _boundaries(plane, straight, vertex)
    if half:
        named = np.concatenate(list(boundaries.values()))
        boundaries["symmetry"] = np.setdiff1d(straight.boundary_facets(), named)
    regions = {name: np.flatnonzero(np.isin(triangle, index)) for name, index in plane.subdomains.items()}
    return replace(mesh, doflocs=x).with_boundaries(boundaries).with_subdomains(regions)


def _placed(r: Array, z: Array, angle: Array) -> Array:
    """Return the points (r, z) in half-planes at angles from y = 0, shape (3, n)."""
    # in floating point sin(pi) is not 0, but the plane of symmetry is exact
    return np.array([r * np.cos(angle), np.where(np.abs(angle - math.pi) < 1e-9, 0.0, r * np.sin(angle)), z])


def _numbered(plane: MeshTri2, turn: float, count: int, *, closed: bool) -> tuple[Ints, Ints, Array]:
    """Number the vertices of the body; those on the axis belong to all half-planes.

    Returns
    -------
    The number of each vertex of the section in each half-plane, shape (count + 1, vertices), and of each vertex of
    the body its vertex in the section and its angle, rad, NaN on the axis; both of shape (n,).
    """
    r = plane.doflocs[0, : plane.nvertices]
    on_axis = r < 1e-9 * r.max()
    axis, off, planes = np.flatnonzero(on_axis), np.flatnonzero(~on_axis), count if closed else count + 1
    number = np.empty((count + 1, len(r)), dtype=np.int64)
    number[:, axis] = np.arange(len(axis))
    number[:, off] = len(axis) + (np.arange(count + 1) % planes)[:, None] * len(off) + np.arange(len(off))
    vertex = np.concatenate([axis, np.tile(off, planes)])
    return number, vertex, np.concatenate([np.full(len(axis), np.nan), np.repeat(turn * np.arange(planes), len(off))])


def _divided(plane: MeshTri2, number: Ints) -> tuple[Ints, Ints]:
    """Return the tetrahedra, shape (4, n), and the triangle of the section that swept each of them, shape (n,)."""
    corner = np.sort(plane.t.astype(np.int64), axis=0)
    first, last = number[:-1][:, corner].swapaxes(0, 1), number[1:][:, corner].swapaxes(0, 1)
    first[:, 1::2], last[:, 1::2] = last[:, 1::2].copy(), first[:, 1::2].copy()
    (a, b, c), (d, e, f) = first.reshape(3, -1), last.reshape(3, -1)
    cells = np.concatenate([np.array([a, b, c, f]), np.array([a, b, e, f]), np.array([a, d, e, f])], axis=1)
    triangle = np.tile(np.arange(corner.shape[1]), 3 * (len(number) - 1))
    # a corner on the axis is the same in both half-planes: tetrahedra with two equal corners have no volume
    proper = (np.diff(np.sort(cells, axis=0), axis=0) > 0).all(axis=0)
    return cells[:, proper], triangle[proper]


def _middles(plane: MeshTri2, edges: Ints, vertex: Ints, angle: Array) -> Array:
    """Return the middle nodes of the body's edges, shape (3, edges).

    vertex, angle : the section's vertex of each vertex of the body, and its half-plane, as `_numbered` returns them.
    """
    (i, j), (start, end) = vertex[edges], angle[edges]
    # an edge around the axis joins two positions of one vertex; every other one is an edge of the section, turned
    node, between = i.copy(), i != j
    node[between] = plane.nvertices + edges_of(plane, pair_keys(i[between], j[between]))
    r, z = plane.doflocs[:, node]
    # the ends lie in one half-plane or in neighbouring ones; an end on the axis lies in that of the other
    start, end = np.where(np.isnan(start), end, start), np.where(np.isnan(end), start, end)
    step = (end - start + math.pi) % (2 * math.pi) - math.pi
    return _placed(r, z, np.where(np.isnan(start), 0.0, start + step / 2))


def _boundaries(plane: MeshTri2, mesh: MeshTet1, vertex: Ints) -> dict[str, Ints]:
    """Return the facets that named edges of the section sweep; the axis sweeps none."""
    low, middle, high = np.sort(vertex[mesh.facets], axis=0)
    swept = (low < high) & ((middle == low) | (middle == high))
    keys = np.where(swept, pair_keys(low, high), -1)
    return {
        name: np.flatnonzero(np.isin(keys, pair_keys(*plane.facets[:, edges].astype(np.int64))))
        for name, edges in plane.boundaries.items()
        if name != "axis"
    }
