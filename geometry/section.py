"""The graded second-order mesh of the (r, z) section for axisymmetric finite elements.

A point (r, z) is the complex number r + 1j z here. The section is meshed in units of D, from input rounded to twelve
digits, so that similar shapes get identical triangles. Then the nodes are moved to the exact outline.

The outline is divided into steps of the local edge length. The inside is filled with points at about this distance
from each other (Poisson-disc sampling of a quadtree). The points are smoothed as joints of a network of springs
(Persson and Strang, SIAM Review 46, 2004). Delaunay's criterion is applied in the image of the plane under the
logarithm of the position relative to the tip. This map is conformal, and allows edges at the tip that are seven
orders of magnitude shorter than elsewhere.

Where a plate is glued to a part of the skin and the rest is free, the displacement of an incompressible solid grows
as sqrt(s) with the distance s from the edge, and the stress as 1 / sqrt(s). Polynomials approximate this badly: with
ordinary elements the shear force converges with the first power of their size. An isoparametric quadratic element
contains sqrt(s) exactly if the middle nodes of those edges that end at the singular node lie at a quarter of their
length (Henshell and Shaw, Int. J. Numer. Methods Eng. 9, 1975; Barsoum, ibid. 10, 1976). Here they lie at the share
PLACE, a little farther away: s = (4 PLACE - 1) t + (2 - 4 PLACE) t^2 along an edge of unit length with the element's
coordinate t. At a quarter, the map is singular at the node. And under a large shear only a part of the edge stays
where it was glued: elsewhere the plate touches more skin, and the strain is finite.

A frictionless press is different: there the gap opens as s^(3/2). These elements then show small waves where the
contact ends, see `fem.model.symmetry_models`. Presses that nothing is glued to keep the middle nodes in the middle,
and so do plates that are glued under a tilt, where the edge lies at several radii, and natural frequencies and
vibrations about a press.
"""

import dataclasses
import functools
import itertools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.spatial import Delaunay, cKDTree
from scipy.spatial.distance import cdist
from skfem.quadrature import get_quadrature

from geometry.arrays import Array, Ints, read_only
from geometry.bad_input import MeshError
from geometry.compiled import compiled
from geometry.design import BadInput, Shape

Points = NDArray[np.complex128]

# The outline

SMALLEST = 1e-9
"""Length, in units of D, below which a length counts as zero."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A straight line, or an arc about `centre` from `bearing[0]` to `bearing[1]`, angles from +z towards +r."""

    name: str
    start: complex
    end: complex
    centre: complex | None = None
    bearing: tuple[float, float] = (0.0, 0.0)

    @property
    def length(self) -> float:
        if self.centre is None:
            return abs(self.end - self.start)
        return abs(self.start - self.centre) * abs(self.bearing[1] - self.bearing[0])

    def at(self, t: Array) -> Points:
        """Return the points at fractions t of the length, shape (n,); both ends are exact."""
        if self.centre is None:
            points = np.asarray(self.start + (self.end - self.start) * t, dtype=np.complex128)
        else:
            angle = self.bearing[0] + (self.bearing[1] - self.bearing[0]) * t
            points = self.centre + abs(self.start - self.centre) * (np.sin(angle) + 1j * np.cos(angle))
        points[t == 0], points[t == 1] = self.start, self.end
        return points


def outline(shape: Shape, magnet: str, rim: float | None = None) -> list[Curve]:
    """Return the curves of the outline: base, skin and axis, then the magnet's outline from its top to its bottom.

    magnet : "hole", "meshed" or "none". rim : radius of a ring that divides the dome into two curves.
    """
    R, H, a, b, rho = shape.R, shape.H, shape.magnet_diameter / 2, shape.magnet_height / 2, shape.magnet_edge_radius
    tip, equator, top, bottom = complex(0, shape.L), complex(R, H), complex(0, H + b), complex(0, H - b)
    curves = [
        Curve("base", 0j, complex(R)),
        Curve("skin", complex(R), equator),
        *_dome(shape, rim),
    ]
    if magnet == "none":
        return [*curves, Curve("axis", tip, 0j)]
    curves += [Curve("axis", tip, top), Curve("axis", bottom, 0j)]
    if magnet == "meshed":
        curves.append(Curve("axis", top, bottom))
    tiny = SMALLEST * shape.D
    # an edge radius that equals a, b or 0 up to rounding is set to it: otherwise a curve of almost no length remains
    rho = next((limit for limit in (a, b, 0.0) if abs(rho - limit) < tiny), rho)
    up, down, upper, lower = complex(a - rho, H + b), complex(a - rho, H - b), H + (b - rho), H - (b - rho)
    around = [
        Curve("magnet", top, up),
        Curve("magnet", up, complex(a, upper), complex(a - rho, upper), (0.0, math.pi / 2)),
        Curve("magnet", complex(a, upper), complex(a, lower)),
        Curve("magnet", complex(a, lower), down, complex(a - rho, lower), (math.pi / 2, math.pi)),
        Curve("magnet", down, bottom),
    ]
    return curves + [curve for curve in around if curve.length >= tiny]


def _dome(shape: Shape, rim: float | None) -> list[Curve]:
    """Return the dome from the equator to the tip, in two arcs if a ring divides it."""
    R, centre = shape.R, complex(0, shape.H)
    stops = [(math.pi / 2, complex(R, shape.H)), (0.0, complex(0, shape.L))]
    if rim is not None and SMALLEST < rim / R < 1 - SMALLEST:
        angle = math.asin(rim / R)
        stops.insert(1, (angle, centre + R * complex(math.sin(angle), math.cos(angle))))
    return [Curve("skin", x, y, centre, (a, b)) for (a, x), (b, y) in itertools.pairwise(stops)]


def modulus(x: Points) -> Array:
    """Return the absolute values of complex numbers, with the same digits on every processor."""
    absolute: Array = np.sqrt(x.real * x.real + x.imag * x.imag)
    return absolute


def room(shape: Shape, x: Points) -> Array:
    """Return the least distance of points, shape (n,), from base, skin and magnet; negative outside the silicone."""
    dome = shape.R - modulus(x - 1j * shape.H)
    room: Array = np.minimum(x.imag, np.where(x.imag > shape.H, dome, shape.R - x.real))
    if not shape.has_magnet:
        return room
    a, b, rho = shape.magnet_diameter / 2, shape.magnet_height / 2, shape.magnet_edge_radius
    dr, dz = x.real - (a - rho), np.abs(x.imag - shape.H) - (b - rho)
    outside = modulus(np.maximum(dr, 0) + 1j * np.maximum(dz, 0))
    return np.minimum(room, outside + np.minimum(np.maximum(dr, dz), 0) - rho)


# The target edge length; all lengths are in units of D

TIP = 1 / 2
"""Edge length at the tip and at a rounded edge of the magnet as a fraction of the size."""
CORNER = 0.012
"""Least edge length at the clamped corner and at a sharp edge of the magnet, in units of D.

Both are singularities: smaller elements there gain no accuracy and become inverted (J <= 0) under load. At the clamp
this bound changes the force of a press to 3/8 D by less than 0.1 %.
"""
FILLET = 0.75
"""Default of the largest edge length at a fillet, as a fraction of its radius."""
TIP_GROWTH, GROWTH = 0.3, 0.4
"""Growth of the edge length per unit of distance, from the tip and from other features."""
_BEARINGS = np.linspace(0, 1.2, 61)[1:]
DOME_POINTS = np.sin(_BEARINGS) + 1j * np.cos(_BEARINGS)
"""Sources along the dome of unit radius about 0, up to 1.2 rad from the tip."""


@dataclass(frozen=True, slots=True)
class Settings:
    """What to mesh and how finely, in units of D: see `section`. `ring` is its `rim`."""

    size: float
    tip_size: float
    ring: tuple[float, float] | None
    fillet: float
    magnet: Literal["hole", "meshed", "none"]
    glued: bool
    growth: float
    coarseness: float


@dataclass(frozen=True, slots=True)
class Grading:
    """The target edge length as a function of the point, in units of D.

    Attributes
    ----------
    size : greatest edge length.
    source : points with a smaller edge length, shape (m,); the first one is the tip.
    least : edge length at each source, shape (m,).
    growth : growth of the edge length per distance from each source, shape (m,).
    coarseness : factor on all of these edge lengths.
    """

    size: float
    source: Points
    least: Array
    growth: Array
    coarseness: float

    def __call__(self, x: Points) -> Array:
        """Return the target edge length at points, shape (n,)."""
        wanted = np.full(len(x), self.size)
        _shorten(wanted, x.real.copy(), x.imag.copy(), self.source, self.least, self.growth)
        return self.coarseness * wanted


@compiled
def _shorten(wanted: Array, r: Array, z: Array, source: Points, least: Array, growth: Array) -> None:
    """Reduce wanted edge lengths (n,) at points (r, z) to the least of least + growth * distance of all sources."""
    for k in range(len(source)):
        r0, z0, start, rate = source[k].real, source[k].imag, least[k], growth[k]
        for i in range(len(wanted)):
            dr, dz = r[i] - r0, z[i] - z0
            length = start + rate * math.sqrt(dr * dr + dz * dz)
            wanted[i] = length if length < wanted[i] else wanted[i]


def pairs(x: Points) -> Array:
    """Return complex numbers, shape (n,), as real and imaginary parts, shape (n, 2)."""
    return np.ascontiguousarray(x).view(np.float64).reshape(-1, 2)


def grading(shape: Shape, curves: list[Curve], s: Settings) -> Grading:
    """Return the grading of a section: its sources are the features that require edges shorter than the size."""
    # in proportion to small sizes: half the size then gives half of every edge length
    from_tip, from_others = TIP_GROWTH * min(1, s.size / 0.12), s.growth * min(1, s.size / 0.075)
    corner = min(s.size, max(CORNER, 1 / 15 * s.size))
    # the edge of the contact area always lies in small elements: in larger ones forces would scatter with its place
    along_dome = np.minimum(s.tip_size + TIP_GROWTH * shape.R * DOME_POINTS.real, 0.35 * s.size)
    # points, edge lengths there, and growth away from them
    sources: list[tuple[Points, Array | float, float]] = [
        (np.array([1j * shape.L]), s.tip_size, from_tip),
        (np.array([complex(shape.R)]), corner, from_others),
        (1j * shape.H + shape.R * DOME_POINTS, along_dome, 0.8),
    ]
    if s.ring is not None:
        r = min(s.ring[0], shape.R)
        point = np.array([complex(r, shape.H + math.sqrt(shape.R**2 - r**2))])
        # elements at the edge of a glued area are graded themselves
        sources.append((point, min(s.ring[1], s.size), 0.5 if s.glued else TIP_GROWTH))
    for curve in curves:
        x = curve.at(np.linspace(0, 1, 41 if curve.name == "magnet" else 5))
        want = _magnet_lengths(shape, curve, x, s) if curve.name == "magnet" else np.full(len(x), curve.length)
        sources.append((x[want < s.size], want[want < s.size], from_others))
    least = np.concatenate([np.broadcast_to(length, len(x)) for x, length, _ in sources])
    growth = np.repeat([rate for _, _, rate in sources], [len(x) for x, _, _ in sources])
    return Grading(s.size, np.concatenate([x for x, _, _ in sources]), least, growth, s.coarseness)


def _magnet_lengths(shape: Shape, curve: Curve, x: Points, s: Settings) -> Array:
    """Return the edge lengths that points on the magnet's outline require, shape (n,)."""
    # a thin layer has two elements or more across
    want: Array = np.minimum(min(s.size, curve.length), 0.42 * room(shape.without_magnet(), x))
    if curve.centre is not None:
        radius = abs(curve.start - curve.centre)
        # by the root of the radius parabolas in place of arcs change the volume by less than 1e-5
        want = np.minimum(want, min(TIP * s.size, s.fillet * radius, 0.1 * math.sqrt(radius)))
    elif shape.magnet_edge_radius < SMALLEST:
        corner = ((x == curve.start) | (x == curve.end)) & (x.real > 0)
        want = np.where(corner, np.minimum(want, max(CORNER, 1 / 5 * s.size)), want)
    if s.magnet == "meshed":
        want = np.minimum(want, min(shape.magnet_height, shape.magnet_diameter / 2) / 2)
    return want


# The mesh

SPACING = 0.85
"""Least distance of points inside as a fraction of the edge length."""
NEAR_END = np.geomspace(1e-10, 0.5, 200)
FRACTIONS = np.unique(np.concatenate([NEAR_END, 1 - NEAR_END, np.linspace(0, 1, 201)]))
"""Fractions of a curve's length at which the edge length is evaluated; dense at the ends, where it may be tiny."""
SLOPES = np.array([skfem.ElementTriP2().lbasis(get_quadrature(skfem.ElementTriP2, 6)[0], i)[1] for i in range(6)])
"""Derivatives of a triangle's quadratic shape functions at quadrature points, shape (6, 2, q)."""
PLACE = 0.3
"""Place of the middle nodes as a share of the edge's length from the singular node. For the paper's sensor, a press
of 1 mm and a shear of 3 mm, section size 0.16 D, 0.012 D at the edge and four harmonics, the force is 0.09 % off at
0.3, 0.11 % at 0.25, 0.25 % at 0.35, and 0.91 % at 0.5, which is the middle."""


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
    growth: float = GROWTH,
    coarseness: float = 1.0,
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
    glued : whether the area inside the ring will be glued; triangles at the ring are then graded towards it.
    growth : growth of the edge length per unit of distance from edges of the magnet, the clamp and thin layers.
    coarseness : factor on every edge length that follows from the above, those at fillets, corners and in thin layers
        too.

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
    settings = Settings(size_D, tip_D, ring, fillet, magnet, glued, growth, coarseness)
    cuts, inner, silicone, core = _triangulated(unit, settings)
    curves = outline(shape, magnet, ring and ring[0] * shape.D)
    mesh = _second_order(_border(curves, cuts), inner * shape.D, silicone, core)
    if ring is not None and glued:
        _grade_ring(mesh, shape, ring[0] * shape.D)
    return mesh


def _grade_ring(mesh: Any, shape: Shape, radius: float) -> None:
    """Move the middle nodes of the sides that end at a ring along their parabolas to the share PLACE, in place."""
    at = np.array([[radius], [shape.H + math.sqrt(max(shape.R**2 - radius**2, 0.0))]])
    node = int(np.argmin(np.square(mesh.p - at).sum(axis=0)))
    start, end = mesh.facets.astype(np.int64)
    middle = np.flatnonzero((start == node) | (end == node))
    far = start[middle] + end[middle] - node
    x, middle, t = mesh.doflocs, mesh.nvertices + middle, PLACE
    x[:, middle] = (1 - t) * (1 - 2 * t) * x[:, [node]] + 4 * t * (1 - t) * x[:, middle] + t * (2 * t - 1) * x[:, far]
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
    sizing = grading(unit, curves, s)
    cuts = _cuts(curves, sizing)
    border = _border(curves, cuts)
    inner = _smoothed(domain, border, _fill(domain, border, sizing), sizing)
    silicone, core = _triangles(domain, border, inner, sizing)
    return read_only((cuts, inner, silicone, core))


def _cuts(curves: list[Curve], sizing: Grading) -> list[Array]:
    """Return, for each curve, the fractions of its length from 0 to 1 that divide it into steps of the local size."""
    wanted = sizing(np.concatenate([curve.at(FRACTIONS) for curve in curves]))
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
    found, nearest, batch = [], (SPACING * length) ** 2, 64
    while len(x):
        first, rest = pairs(x[:batch]), pairs(x[batch:])
        clash = cdist(first, first, "sqeuclidean") <= nearest[:batch]
        stays = np.ones(len(first), dtype=np.bool_)
        for i in range(len(first)):
            if stays[i]:
                stays[i + 1 :] &= ~clash[i, i + 1 :]
        found.append(x[:batch][stays])
        far = (cdist(first[stays], rest, "sqeuclidean") > nearest[batch:]).all(axis=0)
        x, nearest = x[batch:][far], nearest[batch:][far]
    return np.concatenate(found) if found else x


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


def pair_keys(i: Ints, j: Ints) -> Ints:
    """Return one number for each unordered pair of node indices, which are below 2**31."""
    return np.minimum(i, j) * 2**31 + np.maximum(i, j)


def edges_of(mesh: Any, keys: Ints) -> Ints:
    """Return the facets of a triangular mesh with these `pair_keys`, shape (n,)."""
    present = pair_keys(*mesh.facets.astype(np.int64))
    order = np.argsort(present)
    return np.asarray(order[np.searchsorted(present, keys, sorter=order)])


def _sides(t: Ints) -> Ints:
    """Return the keys of all sides of triangles, shape (n, 3), in ascending order and without repetition."""
    keys = np.sort(pair_keys(t, t[:, [1, 2, 0]]), axis=None)
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
    for _ in range(10):
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
    x, ends = np.concatenate([border.node, inner]), border.node[border.segment]
    t = _delaunay(x, sizing)
    t = t[_within(x[t].mean(axis=1), ends[np.isin(border.name, ["base", "skin"])])]
    core = _within(x[t].mean(axis=1), ends[border.name == "magnet"])
    # in a fixed order, which does not depend on the way to the triangles
    t = np.take_along_axis(t, (np.argmin(t, axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    order = np.lexsort((t[:, 1], t[:, 0]))
    t, core = t[order], core[order]
    silicone, magnet = t[~core], t[core & (not domain.has_magnet)]
    if not np.isin(pair_keys(*border.segment.T), _sides(np.concatenate([silicone, magnet]))).all():
        raise MeshError("the section's outline could not be meshed: take a smaller size")
    return silicone, magnet


def _second_order(border: _Border, inner: Points, silicone: Ints, core: Ints) -> Any:
    corners, t = pairs(np.concatenate([border.node, inner])).T, np.concatenate([silicone, core]).T
    straight = skfem.MeshTri(np.ascontiguousarray(corners), np.ascontiguousarray(t), sort_t=False, validate=False)
    facet = edges_of(straight, pair_keys(*border.segment.T))
    mesh = skfem.MeshTri2.from_mesh(straight)
    doflocs = mesh.doflocs.copy()
    doflocs[:, mesh.nvertices + facet] = pairs(border.middle).T
    boundaries = {str(name): np.sort(facet[border.name == name]) for name in np.unique(border.name)}
    regions = {"silicone": np.arange(len(silicone)), "magnet": len(silicone) + np.arange(len(core))}
    regions = {name: cells for name, cells in regions.items() if len(cells)}
    mesh = dataclasses.replace(mesh, doflocs=doflocs).with_boundaries(boundaries).with_subdomains(regions)
    outer = facet[border.name != "magnet"] if len(core) else facet
    if not np.array_equal(np.sort(outer), mesh.boundary_facets()):
        raise MeshError("the section's triangles do not fill its outline: take a smaller size")
    r, z = np.tensordot(mesh.doflocs[:, mesh.dofs.element_dofs], SLOPES, axes=(1, 0))
    if not np.all(r[:, 0] * z[:, 1] > r[:, 1] * z[:, 0]):
        raise MeshError("a curved triangle of the section is folded: take a smaller size")
    return mesh
