"""The points inside the section and its triangles, compiled by numba.

The same steps as in `geometry.section`, in the same order of operations, so that both make the same mesh. The
triangulation is not made anew for each step of the smoothing: its sides are flipped until they are Delaunay again.
All lengths are in units of D; points are (r, z), shape (n, 2).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.meshing.delaunay_compiled import repair, triangulate
from geometry.meshing.filling_compiled import thinned
from geometry.meshing.quadtree_compiled import Tree, cell_of, length_in
from geometry.meshing.sizing_compiled import BASE, MAGNET, SKIN, room

STEPS = 10
"""As in `geometry.section`."""


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _project(image: Array, x: Array, pole: Array) -> None:
    """Write the logarithm of positions relative to a pole, a conformal image of the plane."""
    for i in range(len(x)):
        r, z = x[i, 0] - pole[0], x[i, 1] - pole[1]
        image[i, 0], image[i, 1] = math.log(r * r + z * z) / 2, math.atan2(z, r)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def upright(x: Array, a: int, b: int, c: int) -> bool:
    """Return whether a triangle is counter-clockwise and not flat in the plane of the section."""
    br, bz, cr, cz = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], x[c, 0] - x[b, 0], x[c, 1] - x[b, 1]
    dr, dz = x[a, 0] - x[c, 0], x[a, 1] - x[c, 1]
    longest = max(br * br + bz * bz, cr * cr + cz * cz, dr * dr + dz * dz)
    return br * cz - bz * cr > 1e-6 * longest


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _bars(x: Array, corner: Ints, twin: Ints) -> Ints:
    """Return the sides of upright triangles, each once, in ascending order of both ends.

    The columns are the ends, the lower one first, and the number of the side, shape (m, 3).
    """
    good, first = np.empty(len(corner) // 3, np.bool_), np.zeros(len(x) + 1, np.int64)
    for k in range(len(good)):
        good[k] = upright(x, corner[3 * k], corner[3 * k + 1], corner[3 * k + 2])
    for e in range(len(corner)):
        if twin[e] < e and (good[e // 3] or (twin[e] >= 0 and good[twin[e] // 3])):
            first[min(corner[e], corner[e - e % 3 + (e + 1) % 3]) + 1] += 1
    for i in range(len(x)):
        first[i + 1] += first[i]
    bars = np.empty((first[len(x)], 3), np.int64)
    last = first.copy()
    for e in range(len(corner)):
        if twin[e] < e and (good[e // 3] or (twin[e] >= 0 and good[twin[e] // 3])):
            i, j = corner[e], corner[e - e % 3 + (e + 1) % 3]
            i, j = min(i, j), max(i, j)
            k = last[i]
            last[i] += 1
            while k > first[i] and bars[k - 1, 1] > j:
                bars[k, 0], bars[k, 1], bars[k, 2] = i, bars[k - 1, 1], bars[k - 1, 2]
                k -= 1
            bars[k, 0], bars[k, 1], bars[k, 2] = i, j, e
    return bars


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def ordered(rows: Ints, count: int, most: int) -> Ints:
    """Return the first rows in ascending order of their first two numbers, which are below `most`."""
    for column in (1, 0):
        place, sorted_rows = np.zeros(most + 1, np.int64), np.empty((count, rows.shape[1]), np.int64)
        for i in range(count):
            place[rows[i, column] + 1] += 1
        for k in range(most):
            place[k + 1] += place[k]
        for i in range(count):
            k = rows[i, column]
            for j in range(rows.shape[1]):
                sorted_rows[place[k], j] = rows[i, j]
            place[k] += 1
        rows = sorted_rows
    return rows


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _select(values: Array, rank: int) -> float:
    """Return the number of a rank (Hoare's selection); reorder the numbers."""
    low, high = 0, len(values) - 1
    while low < high:
        pivot, i, j = values[rank], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i, j = i + 1, j - 1
        if j < rank:
            low = i
        if rank < i:
            high = j
    return values[rank]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _push(x: Array, fixed: int, bars: Ints, tree: Tree, size: float, cell: Ints) -> tuple[Array, int]:
    """Return the sum of the forces of the springs on each point, shape (n, 2), and the number of springs.

    Springs between two points of the border have none.

    cell : a cell where the middle of each side may lie; the cell where it lies is written to it.
    """
    cells = tree[0]
    n, push = 0, np.zeros((len(x), 2))
    length, want, ratio = np.empty(len(bars)), np.empty(len(bars)), np.empty(len(bars))
    for k in range(len(bars)):
        i, j = bars[k, 0], bars[k, 1]
        if j >= fixed:
            dr, dz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1]
            length[k] = math.sqrt(dr * dr + dz * dz)
            r, z, c = (x[i, 0] + x[j, 0]) / 2, (x[i, 1] + x[j, 1]) / 2, cell[bars[k, 2]]
            if not (abs(r - cells[c, 0]) <= cells[c, 2] and abs(z - cells[c, 1]) <= cells[c, 2]):
                c = cell[bars[k, 2]] = cell_of(tree, r, z)
            want[k] = length_in(tree, c, size, r, z)
            ratio[n] = length[k] / want[k]
            n += 1
    if n == 0:
        return push, 0
    ratio = ratio[:n]
    median = (_select(ratio, n // 2) + _select(ratio, (n - 1) // 2)) / 2
    # ends with the lower number first: the sums have the same order as in `geometry.section`
    for end in range(2):
        for k in range(len(bars)):
            i, j = bars[k, 0], bars[k, 1]
            if j >= fixed:
                scale, force = 1 / length[k], max(1.2 * median * want[k] - length[k], 0.0)
                sign, to = (1.0, j) if end else (-1.0, i)
                push[to, 0] += sign * ((x[j, 0] - x[i, 0]) * scale * force)
                push[to, 1] += sign * ((x[j, 1] - x[i, 1]) * scale * force)
    return push, n


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def triangulation(image: Array, fixed: int, corner: Ints, twin: Ints) -> tuple[Ints, Ints]:
    """Return the Delaunay triangulation of points, from that of the same points in other places if possible.

    It is possible if only fixed points are on the hull, which then stays the same.
    """
    known = len(corner) > 0
    for e in range(len(corner)):
        known = known and (twin[e] >= 0 or corner[e] < fixed)
    return (corner, twin) if known and repair(image, corner, twin) else triangulate(image)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def sprung(beam: Array, fixed: int, x: Array, tree: Tree, size: float, pole: Array) -> tuple[Ints, Ints, Ints]:
    """Move the points inside as if edges were springs; return the last edges and triangulation before the last step.

    fixed : number of points of the border, which come first in x.
    """
    corner = twin = np.empty(0, np.int64)
    bars, image = np.empty((0, 3), np.int64), np.empty((len(x), 2))
    cell = np.full(6 * len(x), len(tree[0]) - 1)
    for step in range(STEPS):
        moved = fixed if step else 0
        _project(image[moved:], x[moved:], pole)
        corner, twin = triangulation(image, fixed, corner, twin)
        bars = _bars(x, corner, twin)
        push, count = _push(x, fixed, bars, tree, size, cell)
        if count == 0:
            break
        for i in range(fixed, len(x)):
            r, z = x[i, 0] + 0.2 * push[i, 0], x[i, 1] + 0.2 * push[i, 1]
            # a point that would come too close to the border or the axis keeps its place
            clear = min(room(beam, r, z), r)
            if clear > 0.3 * size or clear > 0.3 * length_in(
                tree, cell_of(tree, x[i, 0], x[i, 1]), size, x[i, 0], x[i, 1]
            ):
                x[i, 0], x[i, 1] = r, z
    return bars, corner, twin


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def bridges(bars: Ints, x: Array, fixed: int, segment: Ints, name: Ints, tree: Tree, size: float) -> Array:
    """Return the middles (r, z) of edges from the magnet to the skin or the base, thinned out, shape (n, 2)."""
    outer, core = np.zeros(fixed, np.bool_), np.zeros(fixed, np.bool_)
    for k in range(len(segment)):
        for end in range(2):
            outer[segment[k, end]] |= name[k] == BASE or name[k] == SKIN
            core[segment[k, end]] |= name[k] == MAGNET
    found, count = np.empty((len(bars), 3)), 0
    for k in range(len(bars)):
        i, j = bars[k, 0], bars[k, 1]
        if j < fixed and (outer[i] or outer[j]) and (core[i] or core[j]):
            r, z = (x[i, 0] + x[j, 0]) / 2, (x[i, 1] + x[j, 1]) / 2
            found[count, 0], found[count, 1], found[count, 2] = r, z, length_in(tree, cell_of(tree, r, z), size, r, z)
            count += 1
    return thinned(found[:count])


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def clear_of(segment: Ints, fixed: int, x: Array) -> NDArray[np.bool_]:
    """Return which points are nodes of the border, or outside all circles that have a segment as diameter."""
    n = len(x) - fixed
    # one array for each coordinate: the processor then works on four to eight points at once
    r, z, excess, clear = np.empty(n), np.empty(n), np.empty(n), np.empty(len(x), np.bool_)
    for i in range(n):
        r[i], z[i], excess[i] = x[fixed + i, 0], x[fixed + i, 1], np.inf
    for k in range(len(segment)):
        a, b = segment[k, 0], segment[k, 1]
        middle_r, middle_z = (x[a, 0] + x[b, 0]) / 2, (x[a, 1] + x[b, 1]) / 2
        square = ((x[b, 0] - x[a, 0]) ** 2 + (x[b, 1] - x[a, 1]) ** 2) / 4
        for i in range(n):
            beyond = (r[i] - middle_r) * (r[i] - middle_r) + (z[i] - middle_z) * (z[i] - middle_z) - square
            excess[i] = beyond if beyond < excess[i] else excess[i]
    for i in range(len(x)):
        clear[i] = i < fixed or excess[i - fixed] > 0
    return clear


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def triangles(x: Array, fixed: int, corner: Ints, twin: Ints, pole: Array) -> Ints:
    """Return the upright triangles of the Delaunay triangulation of the points' image, shape (n, 3)."""
    image = np.empty((len(x), 2))
    _project(image, x, pole)
    corner, twin = triangulation(image, fixed, corner, twin)
    t, count = np.empty((len(corner) // 3, 3), np.int64), 0
    for k in range(len(t)):
        if upright(x, corner[3 * k], corner[3 * k + 1], corner[3 * k + 2]):
            for s in range(3):
                t[count, s] = corner[3 * k + s]
            count += 1
    return t[:count]
