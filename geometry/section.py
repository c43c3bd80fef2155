"""The graded second-order mesh of the (r, z) section for axisymmetric finite elements.

A point (r, z) is the complex number r + 1j z here. The section is meshed in units of D, from input rounded to twelve
digits, so that similar shapes get identical triangles. Then the nodes are moved to the exact outline.

The outline is divided into steps of the local edge length. The inside is filled with points at about this distance
from each other (Poisson-disc sampling of a quadtree). The points are smoothed as joints of a network of springs
(Persson and Strang, SIAM Review 46, 2004). Delaunay's criterion is applied in the image of the plane under the
logarithm of the position relative to the tip. This map is conformal, and allows edges at the tip that are seven
orders of magnitude shorter than elsewhere.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree
from scipy.spatial.distance import cdist
from skfem.quadrature import get_quadrature

from geometry.arrays import Array, Ints
from geometry.bad_input import MeshError
from geometry.design import BadInput, Shape
from geometry.meshing.edge_singularity import SingularEdges
from geometry.meshing.section_grading import FILLET, TIP, Grading, grading, pairs
from geometry.meshing.section_outline import Curve, modulus, outline, room

Points = NDArray[np.complex128]

SPACING, STEPS = 0.85, 10
"""Least distance of points inside as a fraction of the edge length, and number of smoothing steps."""
NEAR_END = np.geomspace(1e-10, 0.5, 200)
FRACTIONS = np.unique(np.concatenate([NEAR_END, 1 - NEAR_END, np.linspace(0, 1, 201)]))
"""Fractions of a curve's length at which the edge length is evaluated; dense at the ends, where it may be tiny."""
BATCH = 64
"""Number of points that `_thinned` compares at once."""
SLOPES = np.array([skfem.ElementTriP2().lbasis(get_quadrature(skfem.ElementTriP2, 6)[0], i)[1] for i in range(6)])
"""Derivatives of a triangle's quadratic shape functions at quadrature points, shape (6, 2, q)."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What to mesh and how finely, in units of D: see `section`. `ring` is its `rim`."""

    size: float
    tip_size: float
    ring: tuple[float, float] | None
    fillet: float
    magnet: Literal["hole", "meshed", "none"]
    glued: bool


@dataclass(frozen=True, slots=True)
class _Border:
    """The outline as segments.

    Attributes
    ----------
    node : end points of all segments, shape (n,).
    segment : indices in `node` of both ends of each segment, shape (m, 2).
    name, middle : name of each segment's curve, and its middle point on the curve, shape (m,).
    """

    node: Points
    segment: Ints
    name: NDArray[np.str_]
    middle: Points


def section(
    shape: Shape,
    size: float,
    *,
    tip_size: float | None = None,
    rim: tuple[float, float] | None = None,
    fillet: float = FILLET,
    magnet: Literal["hole", "meshed", "none"] = "hole",
    glued: bool = False,
) -> Any:
    """Mesh the section of the beam, finer at the tip, the clamped corner, the magnet's edges and in thin layers.

    Parameters
    ----------
    shape : lengths in any unit; the mesh has the same unit.
    size : edge length far from all features. Half the size gives half of every edge length, except where a fillet or
        a thin layer needs shorter edges anyway.
    tip_size : edge length at the tip (0, L), at most `size`; default: half of `size`.
    rim : radius of a ring on the dome that gets a node, and edge length there: the edge of a contact area.
    fillet : largest edge length at a fillet of the magnet, as a fraction of its radius.
    magnet : "hole" leaves the magnet out, "meshed" meshes it too, "none" fills its place with silicone.
    glued : whether the area inside the ring will be glued; triangles at the ring are then graded towards it, see
        `meshing.edge_singularity`.

    Returns
    -------
    skfem.MeshTri2 with counter-clockwise triangles and middle nodes on the arcs of dome and fillets. Its `boundaries`
    are "base", "axis", "skin" (wall and dome) and, with a magnet, "magnet"; its `subdomains` are "silicone" and, if
    meshed, "magnet".

    Raises
    ------
    BadInput : a size is not positive, or `tip_size` exceeds `size`.
    MeshError : the mesh does not fill the outline, or has a folded triangle.
    """
    if not 0 < size < math.inf:
        raise BadInput(f"size must be a positive length; got {size:g}")
    tip_size = TIP * size if tip_size is None else tip_size
    if not 0 < tip_size <= size:
        raise BadInput(f"tip_size must be positive and at most size = {size:g}; got {tip_size:g}")
    if magnet == "none" or not shape.has_magnet:
        shape, magnet = shape.without_magnet(), "none"
    *lengths, size_D, tip_D = (float(f"{v / shape.D:.11e}") for v in (*dataclasses.astuple(shape), size, tip_size))
    unit = Shape(*lengths)
    ring = None if rim is None else (float(f"{rim[0] / shape.D:.6e}"), float(f"{rim[1] / shape.D:.6e}"))
    settings = Settings(size_D, tip_D, ring, fillet, magnet, glued)
    cuts, inner, silicone, core = _triangulated(unit, settings)
    curves = outline(shape, magnet, ring and ring[0] * shape.D)
    mesh = _second_order(_border(curves, cuts), inner * shape.D, silicone, core)
    if ring is not None and glued:
        _grade_ring(mesh, shape, ring[0] * shape.D)
    return mesh


def _grade_ring(mesh: Any, shape: Shape, radius: float) -> None:
    """Move the middle nodes of the sides that end at the ring of a radius, in place."""
    at = np.array([[radius], [shape.H + math.sqrt(max(shape.R**2 - radius**2, 0.0))]])
    node = int(np.argmin(np.square(mesh.p - at).sum(axis=0)))
    start, end = mesh.facets.astype(np.int64)
    middle = np.flatnonzero((start == node) | (end == node))
    far = start[middle] + end[middle] - node
    SingularEdges(np.full(len(middle), node), far, mesh.nvertices + middle).move(mesh.doflocs)
    around = mesh.doflocs[:, mesh.dofs.element_dofs[:, (mesh.t == node).any(axis=0)]]
    (a, b), (c, d) = np.einsum("ikt,kjq->ijtq", around, SLOPES)
    if (a * d - b * c).min() <= 0:
        raise MeshError("a triangle at the ring of the section is folded: take a smaller size")


@functools.lru_cache(maxsize=128)
def _triangulated(unit: Shape, s: Settings) -> tuple[list[Array], Points, Ints, Ints]:
    """Return the cuts of the curves, the points inside and the triangles of silicone and magnet.

    Designs that differ in E, the magnet's strength or their scale share them, as do loads of one mesh: they are kept
    for the last shapes, and must not be changed.

    Parameters
    ----------
    unit : the shape in units of D, rounded.
    """
    domain = unit.without_magnet() if s.magnet == "meshed" else unit
    curves = outline(unit, s.magnet, s.ring and s.ring[0])
    sizing = grading(unit, curves, s.size, s.tip_size, s.ring, s.fillet, s.magnet == "meshed", s.glued)
    cuts = _cuts(curves, sizing)
    border = _border(curves, cuts)
    inner = _smoothed(domain, border, _fill(domain, border, sizing), sizing)
    silicone, core = _triangles(domain, border, inner, sizing)
    for array in (*cuts, inner, silicone, core):
        array.flags.writeable = False
    return cuts, inner, silicone, core


def _cuts(curves: list[Curve], sizing: Grading) -> list[Array]:
    """Return, for each curve, the fractions of its length from 0 to 1 that divide it into steps of the local size."""
    wanted = sizing.along(np.concatenate([curve.at(FRACTIONS) for curve in curves]))
    cuts = []
    for curve, here in zip(curves, wanted.reshape(len(curves), -1), strict=True):
        # the integral of 1 / edge length counts the edges: nodes lie where it takes evenly spaced values
        density = curve.length / here
        count = np.append(0.0, np.cumsum(np.diff(FRACTIONS) * (density[1:] + density[:-1]) / 2))
        steps = max(1 if curve.centre is None else 2, math.ceil(count[-1] - 0.3))
        cuts.append(np.interp(np.linspace(0, count[-1], steps + 1), count, FRACTIONS))
    return cuts


def _border(curves: list[Curve], cuts: list[Array]) -> _Border:
    """Number the nodes on the curves; curves that meet share the node of their common end."""
    corner: dict[complex, int] = {}
    nodes, segments, middles, total = [], [], [], 0
    for curve, t in zip(curves, cuts, strict=True):
        fresh = np.ones(len(t), dtype=bool)
        fresh[[0, -1]] = curve.start not in corner, curve.end not in corner
        index = total - 1 + np.cumsum(fresh)
        index[0] = corner.setdefault(curve.start, int(index[0]))
        index[-1] = corner.setdefault(curve.end, int(index[-1]))
        nodes.append(curve.at(t)[fresh])
        segments.append(np.column_stack([index[:-1], index[1:]]))
        middles.append(curve.at((t[:-1] + t[1:]) / 2))
        total += len(nodes[-1])
    names = np.repeat([curve.name for curve in curves], [len(part) for part in segments])
    return _Border(np.concatenate(nodes), np.concatenate(segments), names, np.concatenate(middles))


def _fill(domain: Shape, border: _Border, sizing: Grading) -> Points:
    """Return points inside, shape (n,), spaced by the local size.

    They are the centres of the leaves of a quadtree, thinned out in order of distance from the border.
    """
    side, leaves, lengths = 0.5, [], []
    cells = (side * (0.5 + 1j * (0.5 + np.arange(math.ceil(domain.L / side))))).astype(np.complex128)
    while len(cells):
        space = room(domain, cells)
        near = space > -0.71 * side  # other cells lie outside: half a diagonal is 0.71 sides
        cells, space = cells[near], space[near]
        wanted = sizing(cells)
        coarse = wanted < side / 0.3
        leaf = ~coarse & (space > 0)
        leaves.append(cells[leaf])
        lengths.append(wanted[leaf])
        side /= 2
        cells = (cells[coarse, None] + side / 2 * np.array([-1 - 1j, 1 - 1j, -1 + 1j, 1 + 1j])).ravel()
    x, length = np.concatenate(leaves), np.concatenate(lengths)
    far = cKDTree(pairs(border.node)).query(pairs(x))[0] / length
    order = np.argsort(far, kind="stable")[np.count_nonzero(far <= SPACING) :]
    return _thinned(x[order], length[order])


def _thinned(x: Points, length: Array) -> Points:
    """Return those points, in order, that keep the least distance from all points returned before them."""
    kept, nearest = [], (SPACING * length) ** 2
    while len(x):
        first, rest = pairs(x[:BATCH]), pairs(x[BATCH:])
        clash = cdist(first, first, "sqeuclidean") <= nearest[:BATCH]
        stays = np.ones(len(first), dtype=np.bool_)
        for i in range(len(first)):
            if stays[i]:
                stays[i + 1 :] &= ~clash[i, i + 1 :]
        kept.append(x[:BATCH][stays])
        far = (cdist(first[stays], rest, "sqeuclidean") > nearest[BATCH:]).all(axis=0)
        x, nearest = x[BATCH:][far], nearest[BATCH:][far]
    return np.concatenate(kept) if kept else x


def _delaunay(x: Points, sizing: Grading) -> Ints:
    """Return counter-clockwise triangles, shape (n, 3), that are Delaunay in a conformal image of the plane.

    The logarithm has its pole just outside the section, next to the tip, so that it is finite at the tip.
    """
    image = np.log(x - sizing.source[0] + sizing.least[0] / sizing.growth[0] * (1 - 1j) / math.sqrt(2))
    t: Ints = Delaunay(pairs(image)).simplices.astype(np.int64)
    a, b, c = x[t.T]
    longest = np.maximum(np.maximum(np.abs(b - a), np.abs(c - b)), np.abs(a - c))
    upright: Ints = t[((b - a).conj() * (c - b)).imag > 1e-6 * longest**2]
    return upright


def _keys(i: Ints, j: Ints) -> Ints:
    """Return one number for each unordered pair of node indices, which are below 2**31."""
    return np.minimum(i, j) * 2**31 + np.maximum(i, j)


def _sides(t: Ints) -> Ints:
    """Return the keys of all sides of triangles, shape (n, 3), in ascending order and without repetition."""
    keys = np.sort(_keys(t, t[:, [1, 2, 0]]), axis=None)
    return keys[np.diff(keys, prepend=-1) > 0]


def _clear(border: _Border, x: Points) -> NDArray[np.bool_]:
    """Return a mask (n,) of the points outside all circles that have a segment of the border as diameter.

    A point inside such a circle could keep Delaunay's triangles from having the segment as a side.
    """
    ends = border.node[border.segment]
    clear: NDArray[np.bool_] = (cdist(pairs(x), pairs(ends.mean(axis=1))) > np.abs(np.diff(ends).T) / 2).all(axis=1)
    return clear


def _smoothed(domain: Shape, border: _Border, inner: Points, sizing: Grading) -> Points:
    """Smooth the points inside; add points where a single edge connects the magnet with the skin or the base.

    A thin layer of silicone then has at least two elements across.
    """
    outer = border.segment[np.isin(border.name, ["base", "skin"])]
    core = border.segment[border.name == "magnet"]
    for _ in range(3):
        inner, bars = _sprung(domain, border, inner, sizing)
        across = bars[np.isin(bars, outer).any(axis=1) & np.isin(bars, core).any(axis=1)]
        if not len(across):
            break
        middle = border.node[across].mean(axis=1)
        inner = np.concatenate([inner, _thinned(middle, sizing(middle))])
    return inner[_clear(border, inner)]


def _sprung(domain: Shape, border: _Border, inner: Points, sizing: Grading) -> tuple[Points, Ints]:
    """Move the points inside as if edges were springs that push towards the local size; return points and edges.

    The points of the border are fixed.
    """
    fixed = len(border.node)
    for _ in range(STEPS):
        x = np.concatenate([border.node, inner])
        keys = _sides(_delaunay(x, sizing))
        bars = np.array([keys >> 31, keys & (2**31 - 1)])
        free = bars[:, bars[1] >= fixed]
        if not free.size:
            break
        start, end = x[free]
        along = end - start
        length, want = modulus(along), sizing((start + end) / 2)
        ratio = np.sort(length / want)
        median = (ratio[len(ratio) // 2] + ratio[(len(ratio) - 1) // 2]) / 2
        push = along / length * np.maximum(1.2 * median * want - length, 0)
        push = np.concatenate([-push, push])
        r, z = (np.bincount(free.ravel(), part, len(x)) for part in (push.real, push.imag))
        moved = inner + 0.2 * (r + 1j * z)[fixed:]
        # a point that would come too close to the border or the axis keeps its place
        clear = np.minimum(room(domain, moved), moved.real)
        free_to_move = clear > 0.3 * sizing.size
        tight = np.flatnonzero(~free_to_move)
        free_to_move[tight] = clear[tight] > 0.3 * sizing(inner[tight])
        inner = np.where(free_to_move, moved, inner)
    return inner, bars.T


def _within(x: Points, ends: Points) -> NDArray[np.bool_]:
    """Return a mask (n,) of the points inside a closed polygon: a ray to the right crosses an odd number of segments.

    ends : end points of the segments, shape (m, 2).
    """
    p, q, z = ends[:, 0], ends[:, 1], x.imag[:, None]
    slope = (q.real - p.real) / np.where(p.imag == q.imag, 1.0, q.imag - p.imag)
    cut = ((p.imag > z) != (q.imag > z)) & (p.real + (z - p.imag) * slope > x.real[:, None])
    return np.asarray(np.count_nonzero(cut, axis=1) % 2 == 1)


def _triangles(domain: Shape, border: _Border, inner: Points, sizing: Grading) -> tuple[Ints, Ints]:
    """Return the triangles of the silicone and of the magnet, both of shape (n, 3)."""
    x, ends = np.concatenate([border.node, inner]), border.node[border.segment]
    t = _delaunay(x, sizing)
    t = t[_within(x[t].mean(axis=1), ends[np.isin(border.name, ["base", "skin"])])]
    core = _within(x[t].mean(axis=1), ends[border.name == "magnet"])
    # in a fixed order, which does not depend on the way to the triangles
    t = np.take_along_axis(t, (np.argmin(t, axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    order = np.lexsort((t[:, 1], t[:, 0]))
    t, core = t[order], core[order]
    silicone, magnet = t[~core], t[core & (not domain.has_magnet)]
    if not np.isin(_keys(*border.segment.T), _sides(np.concatenate([silicone, magnet]))).all():
        raise MeshError("the section's outline could not be meshed: take a smaller size")
    return silicone, magnet


def _second_order(border: _Border, inner: Points, silicone: Ints, core: Ints) -> Any:
    """Return the second-order mesh with middle nodes on the curves and named parts; check that it is valid."""
    corners, t = pairs(np.concatenate([border.node, inner])).T, np.concatenate([silicone, core]).T
    straight = skfem.MeshTri(np.ascontiguousarray(corners), np.ascontiguousarray(t), sort_t=False, validate=False)
    key = _keys(*straight.facets.astype(np.int64))
    order = np.argsort(key)
    facet = order[np.searchsorted(key, _keys(*border.segment.T), sorter=order)]
    mesh = skfem.MeshTri2.from_mesh(straight)
    doflocs = mesh.doflocs.copy()
    doflocs[:, mesh.nvertices + facet] = pairs(border.middle).T
    boundaries = {str(name): np.sort(facet[border.name == name]) for name in np.unique(border.name)}
    parts = {"silicone": np.arange(len(silicone)), "magnet": len(silicone) + np.arange(len(core))}
    parts = {name: part for name, part in parts.items() if len(part)}
    mesh = dataclasses.replace(mesh, doflocs=doflocs, _boundaries=boundaries, _subdomains=parts)
    outer = facet[border.name != "magnet"] if len(core) else facet
    if not np.array_equal(np.sort(outer), mesh.boundary_facets()):
        raise MeshError("the section's triangles do not fill its outline: take a smaller size")
    r, z = np.tensordot(mesh.doflocs[:, mesh.dofs.element_dofs], SLOPES, axes=(1, 0))
    if not np.all(r[:, 0] * z[:, 1] > r[:, 1] * z[:, 0]):
        raise MeshError("a curved triangle of the section is folded: take a smaller size")
    return mesh
