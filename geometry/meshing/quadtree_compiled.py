"""The section's target edge length by a quadtree that lists the sources that matter in each cell, compiled by numba.

All lengths are in units of D; points are (r, z). The sources are those of `sizing_compiled.sources`.

A tree is (cells, child, entries). Its roots are squares of side 1/2 above each other.
cells : centre (r, z), half the side, first entry and end of the list, edge length at the centre, 1 if it is a leaf
    inside the silicone, shape (n, 7), in order of size. A cell without children has the list of its parent.
child : first one of the four children of each cell, -1 if it has none, shape (n,).
entries : the sources (r, z, edge length, growth) in the lists, shape (k, 4).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.arrays import Array, Ints
from geometry.meshing.section_outline import SMALLEST
from geometry.meshing.sizing_compiled import room

ROUNDING = 1 + 1e-9
"""Factor by which a bound is raised, so that rounding cannot exclude a source."""
Tree = tuple[Array, Ints, Array]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def grown(array: Array, count: int) -> Array:
    """Return an array with at least `count` rows that begins with the given rows."""
    if count <= len(array):
        return array
    longer = np.empty((2 * count, array.shape[1]), array.dtype)
    for i in range(len(array)):
        for j in range(array.shape[1]):
            longer[i, j] = array[i, j]
    return longer


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def quadtree(beam: Array, source: Array, size: float) -> Tree:
    """Divide the plane into cells that are small against the edge length.

    Cells outside the silicone are not divided.
    """
    # one root above the tip, so that each point of the section lies in one
    used, roots = len(source), int(source[0, 1] / 0.5) + 1
    cells, child, entries = np.empty((8192, 7)), np.empty((8192, 1), np.int64), np.empty((16384, 4))
    # loops: numba takes seconds to compile the assignment of an array to a slice
    for i in range(used):
        for j in range(4):
            entries[i, j] = source[i, j]
    for i in range(roots):
        cells[i, 0], cells[i, 1], cells[i, 2] = 0.25, 0.5 * (0.5 + i), 0.25
        cells[i, 3], cells[i, 4] = 0, used
    side, first, last, count = 0.5, 0, roots, roots
    while first < last:
        for c in range(first, last):
            r, z, begin, end = cells[c, 0], cells[c, 1], int(cells[c, 3]), int(cells[c, 4])
            cells[c, 6], child[c, 0] = 0.0, -1
            space = room(beam, r, z)
            if space <= -0.71 * side:
                continue  # the cell lies outside: half a diagonal is 0.71 sides
            listed = entries[begin:end]
            wanted, best = finest(listed, r, z)
            cells[c, 5] = min(wanted, size)
            if cells[c, 5] >= side / 0.3:
                cells[c, 6] = 1.0 if space > 0 else 0.0
                continue
            entries = grown(entries, used + end - begin)
            cells[c, 3] = used
            used += relevant(listed, best, wanted, size, (r, z, side / 2), entries[used:])
            cells[c, 4] = used
            cells, child = grown(cells, count + 4), grown(child, count + 4)
            child[c, 0] = count
            for k in range(4):
                cells[count, 0] = r + (side / 4 if k % 2 else -side / 4)
                cells[count, 1] = z + (side / 4 if k > 1 else -side / 4)
                cells[count, 2], cells[count, 3], cells[count, 4] = side / 4, cells[c, 3], used
                count += 1
        first, last, side = last, count, side / 2
    return cells[:last], child[:last, 0].copy(), entries[:used]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def finest(entries: Array, r: float, z: float) -> tuple[float, int]:
    """Return the least edge length that sources require at a point, and that source."""
    wanted, best = np.inf, 0
    for e in range(len(entries)):
        dr, dz = r - entries[e, 0], z - entries[e, 1]
        length = math.sqrt(dr * dr + dz * dz) * entries[e, 3] + entries[e, 2]
        if length < wanted:
            wanted, best = length, e
    return wanted, best


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def relevant(
    entries: Array, best: int, wanted: float, size: float, square: tuple[float, float, float], into: Array
) -> int:
    """Write the sources that can require the least edge length in a square; return their number.

    best, wanted : the source that requires the least at the square's centre, and the edge length.
    square : centre (r, z) and half the side. into : where to write.
    """
    r, z, half = square
    reach, growth = math.sqrt(2.0) * half, entries[best, 3]
    best_r, best_z = entries[best, 0], entries[best, 1]
    far = (r - best_r) * (r - best_r) + (z - best_z) * (z - best_z)
    used, across = 0, math.sqrt(far) + 2 * reach
    # nowhere in the square is the edge length larger than this
    most = min(wanted + reach * growth + SMALLEST, size)
    for e in range(len(entries)):
        dr, dz = r - entries[e, 0], z - entries[e, 1]
        distance = dr * dr + dz * dz
        # only up to this distance can the source require less than `most` somewhere in the square
        near = (most - entries[e, 2]) / entries[e, 3] + reach
        if near <= 0 or distance > near * near * ROUNDING:
            continue
        if e != best and entries[e, 3] >= growth:
            # the excess of the squared distance over that from the best source is linear: least in a corner
            excess = distance - far - 2 * half * (abs(entries[e, 0] - best_r) + abs(entries[e, 1] - best_z))
            if excess >= 0 and excess * growth >= (entries[best, 2] - entries[e, 2]) * (near + across) * ROUNDING:
                continue
        for i in range(4):
            into[used, i] = entries[e, i]
        used += 1
    return used


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def cell_of(tree: Tree, r: float, z: float) -> int:
    """Return the cell without children that holds a point, which lies inside the roots of a tree."""
    child = tree[1]
    c, quarter, middle_r = int(z / 0.5), 0.125, 0.25
    middle_z = 0.5 * (0.5 + c)
    while child[c] >= 0:
        right, up = r > middle_r, z > middle_z
        c = child[c] + (1 if right else 0) + (2 if up else 0)
        middle_r += quarter if right else -quarter
        middle_z += quarter if up else -quarter
        quarter /= 2
    return c


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def length_in(tree: Tree, c: int, size: float, r: float, z: float) -> float:
    """Return the target edge length at a point of a cell."""
    cells, entries = tree[0], tree[2]
    wanted = size
    for e in range(int(cells[c, 3]), int(cells[c, 4])):
        dr, dz = r - entries[e, 0], z - entries[e, 1]
        wanted = min(wanted, math.sqrt(dr * dr + dz * dz) * entries[e, 3] + entries[e, 2])
    return wanted


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def edge_lengths(tree: Tree, size: float, x: Array, first: int, last: int, near: Array, wanted: Array) -> None:
    """Write the target edge length at points from `first` to `last`, which lie in the rectangle between these two.

    near : space for the sources that matter there, shape (n, 4).
    """
    cells, child, entries = tree[0], tree[1], tree[2]
    r, z, other_r, other_z = x[first, 0], x[first, 1], x[last, 0], x[last, 1]
    c, quarter, middle_r = int(z / 0.5), 0.125, 0.25
    middle_z = 0.5 * (0.5 + c)
    # the smallest cell that holds both points
    while int(other_z / 0.5) == int(z / 0.5) and child[c] >= 0:
        right, up = r > middle_r, z > middle_z
        if (other_r > middle_r) != right or (other_z > middle_z) != up:
            break
        c = child[c] + (1 if right else 0) + (2 if up else 0)
        middle_r += quarter if right else -quarter
        middle_z += quarter if up else -quarter
        quarter /= 2
    # the list of the cell, or those of all sources, which come first
    begin, end = (int(cells[c, 3]), int(cells[c, 4])) if int(other_z / 0.5) == int(z / 0.5) else (0, len(near))
    square = (r + other_r) / 2, (z + other_z) / 2, max(abs(r - other_r), abs(z - other_z)) / 2
    listed, count = entries[begin:end], 0
    if len(listed):
        least, best = finest(listed, square[0], square[1])
        count = relevant(listed, best, least, size, square, near)
    for i in range(first, last + 1):
        wanted[i] = min(size, finest(near[:count], x[i, 0], x[i, 1])[0])
