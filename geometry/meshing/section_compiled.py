"""The mesh of the section by functions that numba compiles: the same mesh as that of `geometry.section`.

Sines and cosines come from NumPy, because those of compiled functions may differ in the last digit.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
import skfem

from geometry.arrays import Array, Ints
from geometry.bad_input import MeshError
from geometry.design import Shape
from geometry.meshing import (
    filling_compiled,
    outline_compiled,
    points_compiled,
    quadtree_compiled,
    sizing_compiled,
    triangles_compiled,
)
from geometry.meshing.section_grading import fixed_sources, pairs
from geometry.meshing.section_outline import Curve, outline
from geometry.section import FRACTIONS, SLOPES, Settings

NAMES = "axis", "base", "magnet", "skin"
"""Names of boundaries; their numbers are those of `sizing_compiled`."""
SAMPLED = np.concatenate([np.linspace(0, 1, n) for n in (sizing_compiled.SAMPLES, sizing_compiled.FEW_SAMPLES)])
BOTH = np.concatenate([SAMPLED, FRACTIONS])


def mesh(shape: Shape, unit: Shape, s: Settings) -> Any:
    """Return the mesh, see `geometry.section.section`.

    unit : the shape in units of D, rounded.
    """
    beam, outlined = _beam(unit, s.magnet != "meshed"), outline(unit, s.magnet, s.ring and s.ring[0])
    curves, turns = _table(outlined), _turns(tuple(curve.bearing for curve in outlined if curve.centre is not None))
    at, least, growth = fixed_sources(unit, s.size, s.tip_size, s.ring, s.glued)
    fixed = np.column_stack([pairs(at), least, growth])
    source = sizing_compiled.sources(curves, SAMPLED, turns, beam, s.size, s.fillet, s.magnet == "meshed", fixed)
    tree = quadtree_compiled.quadtree(beam, source, s.size)
    t, first = outline_compiled.cuts(curves, FRACTIONS, turns, tree, s.size)
    place, segment, middle = outline_compiled.numbered(curves, t, first)
    name = curves[:, 10].astype(np.int64)[middle[:, 0].astype(np.int64)]
    border = np.empty((len(place), 2))
    outline_compiled.place_points(border, curves, place)
    x, cells = _delaunay(beam, border, segment, name, tree, source[0], s.size)
    silicone, core = triangles_compiled.parts(x, cells, len(border), segment, name, s.magnet == "meshed")
    real, middles = _table(outline(shape, s.magnet, s.ring and s.ring[0] * shape.D)), np.empty((len(middle), 2))
    x *= shape.D
    outline_compiled.place_points(x, real, place)
    outline_compiled.place_points(middles, real, middle)
    return _second_order(x, silicone, core, segment, name, middles)


def _beam(unit: Shape, hollow: bool) -> Array:
    lengths = unit.R, unit.H, unit.magnet_diameter / 2, unit.magnet_height / 2, unit.magnet_edge_radius
    return np.array([*lengths, float(hollow and unit.has_magnet)])


def _table(curves: list[Curve]) -> Array:
    """Return the table of curves, shape (n, 11), see `sizing_compiled`."""
    rows = []
    for curve in curves:
        a, b, c = curve.start, curve.end, curve.centre
        centre = (0.0, 0.0, 0.0) if c is None else (c.real, c.imag, abs(a - c))
        name = float(NAMES.index(curve.name))
        rows.append((a.real, a.imag, b.real, b.imag, *centre, curve.length, *curve.bearing, name))
    return np.array(rows)


@functools.lru_cache(maxsize=8)
def _turns(bearings: tuple[tuple[float, float], ...]) -> Array:
    """Return sine and cosine of the angles of arcs at the fractions `BOTH`, shape (arcs, n, 2).

    Without a ring on the dome, the arcs of all designs have the same angles.
    """
    first, last = np.array(bearings).T[:, :, None]
    angle = first + (last - first) * BOTH
    return np.stack([np.sin(angle), np.cos(angle)], axis=2)


def _delaunay(
    beam: Array,
    border: Array,
    segment: Ints,
    name: Ints,
    tree: quadtree_compiled.Tree,
    tip: Array,
    size: float,
) -> tuple[Array, Ints]:
    """Return all points, those of the border first, and the Delaunay triangles of their image."""
    offset = tip[2] / tip[3] / math.sqrt(2)
    pole = np.array([tip[0] - offset, tip[1] + offset])
    x = np.concatenate([border, filling_compiled.fill(tree, border, tip[1])])
    for _ in range(3):
        bars, corner, twin = points_compiled.sprung(beam, len(border), x, tree, size, pole)
        across = points_compiled.bridges(bars, x, len(border), segment, name, tree, size)
        if not len(across):
            break
        x, corner = np.concatenate([x, across]), corner[:0]
    clear = points_compiled.clear_of(segment, len(border), x)
    if not clear.all():
        x, corner = x[clear], corner[:0]
    return x, points_compiled.triangles(x, len(border), corner, twin, pole)


def _second_order(x: Array, silicone: Ints, core: Ints, segment: Ints, name: Ints, middle: Array) -> Any:
    """Return the second-order mesh with middle nodes on the curves and named parts; check that it is valid."""
    t = np.concatenate([silicone, core])
    doflocs, facets, t2f, f2t, facet = triangles_compiled.second_order(x, t, segment, middle)
    order, first = triangles_compiled.boundaries(f2t, facet, name, len(core) > 0)
    if not len(order):
        if facet.min() < 0:
            raise MeshError("the section's outline could not be meshed: take a smaller size")
        raise MeshError("the section's triangles do not fill its outline: take a smaller size")
    if not triangles_compiled.unfolded(doflocs, len(x), t, t2f, SLOPES):
        raise MeshError("a curved triangle of the section is folded: take a smaller size")
    boundaries = {NAMES[k]: order[first[k] : first[k + 1]] for k in range(4) if first[k] < first[k + 1]}
    parts = {"silicone": np.arange(len(silicone)), "magnet": len(silicone) + np.arange(len(core))}
    parts = {part: cells for part, cells in parts.items() if len(cells)}
    mesh = skfem.MeshTri2(doflocs, np.ascontiguousarray(t.T), boundaries, parts, validate=False)
    # scikit-fem would find the same again
    mesh._facets, mesh._t2f, mesh._f2t = facets, t2f, f2t
    return mesh
