"""The points that fill the section, spaced by the target edge length, compiled by numba.

The same points as in `geometry.section`: leaves of the quadtree, thinned out in order of distance from the border.
All lengths are in units of D; points are (r, z), shape (n, 2).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.arrays import Array, Ints
from geometry.meshing.quadtree_compiled import Tree, grown

SPACING = 0.85
"""As in `geometry.section`."""


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def fill(tree: Tree, node: Array, tip: float) -> Array:
    """Return the points inside, shape (n, 2).

    node : nodes of the border. tip : height of the tip.
    """
    cells, child = tree[0], tree[1]
    far = _distances(cells, child, node)
    reach = np.zeros(len(cells))
    for c in range(len(cells) - 1, -1, -1):
        if far[c] > SPACING:
            reach[c] = SPACING * cells[c, 5]
        elif child[c] >= 0:
            for k in range(4):
                reach[c] = max(reach[c], reach[child[c] + k])
    order, first = _binned(far)
    kept, count, batch = np.empty((len(order), 2)), 0, np.empty(len(order), np.int64)
    stack = np.empty(len(cells), np.int64)
    for b in range(len(first) - 1):
        # only the few leaves are sorted that no point before this bin excludes
        size = 0
        for i in range(first[b], first[b + 1]):
            c, j = order[i], size
            if reach[c] > 0:
                while j > 0 and far[batch[j - 1]] > far[c]:
                    batch[j] = batch[j - 1]
                    j -= 1
                batch[j] = c
                size += 1
        for i in range(size):
            c = batch[i]
            if reach[c] > 0:
                kept[count, 0], kept[count, 1] = cells[c, 0], cells[c, 1]
                _exclude(cells, child, reach, stack, cells[c, 0], cells[c, 1], int(tip / 0.5) + 1)
                count += 1
    return kept[:count]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _distances(cells: Array, child: Ints, node: Array) -> Array:
    """Return the distance of all leaves from the next node of the border over the edge length; 0 for other cells.

    Each cell has a list of the nodes that can be nearest somewhere in it.
    """
    used, n = len(node), len(cells)
    begin, end, far, listed = np.zeros(n, np.int64), np.full(n, used), np.zeros(n), np.empty((4 * n, 2))
    listed = grown(listed, used)
    for i in range(used):
        listed[i, 0], listed[i, 1] = node[i, 0], node[i, 1]
    for c in range(n):
        if child[c] < 0 and cells[c, 6] == 0:
            continue
        r, z, least, near_r, near_z = cells[c, 0], cells[c, 1], np.inf, 0.0, 0.0
        for i in range(begin[c], end[c]):
            dr, dz = r - listed[i, 0], z - listed[i, 1]
            if dr * dr + dz * dz < least:
                least, near_r, near_z = dr * dr + dz * dz, listed[i, 0], listed[i, 1]
        if child[c] < 0:
            far[c] = math.sqrt(least) / cells[c, 5]
            continue
        listed, first, side = grown(listed, used + end[c] - begin[c]), used, 2 * cells[c, 2]
        for i in range(begin[c], end[c]):
            dr, dz = r - listed[i, 0], z - listed[i, 1]
            # the excess of the squared distance over that from the nearest node is linear: least in a corner
            if dr * dr + dz * dz - side * (abs(listed[i, 0] - near_r) + abs(listed[i, 1] - near_z)) <= least:
                listed[used, 0], listed[used, 1] = listed[i, 0], listed[i, 1]
                used += 1
        for k in range(child[c], child[c] + 4):
            begin[k], end[k] = first, used
    return far


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _binned(far: Array) -> tuple[Ints, Ints]:
    """Return the leaves farther than SPACING in bins of ascending distance, and the first one of each bin."""
    most, bins = SPACING, len(far) // 16 + 1
    for c in range(len(far)):
        most = max(most, far[c])
    scale = 0.999999 * bins / (most - SPACING) if most > SPACING else 0.0
    first = np.zeros(bins + 2, np.int64)
    for c in range(len(far)):
        if far[c] > SPACING:
            first[int((far[c] - SPACING) * scale) + 2] += 1
    for b in range(bins):
        first[b + 2] += first[b + 1]
    order = np.empty(first[bins + 1], np.int64)
    for c in range(len(far)):
        if far[c] > SPACING:
            b = int((far[c] - SPACING) * scale) + 1
            order[first[b]] = c
            first[b] += 1
    return order, first[: bins + 1]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _exclude(cells: Array, child: Ints, reach: Array, stack: Ints, r: float, z: float, roots: int) -> None:
    """Set the reach of all leaves to 0 that are nearer to a point than their reach.

    reach : the least distance that each leaf keeps from other points, and the largest one of all leaves in a cell.
    """
    count = 0
    for c in range(roots):
        stack[count] = c
        count += 1
    while count:
        count -= 1
        c = stack[count]
        if child[c] < 0:
            if (cells[c, 0] - r) ** 2 + (cells[c, 1] - z) ** 2 <= reach[c] * reach[c]:
                reach[c] = 0.0
            continue
        for k in range(child[c], child[c] + 4):
            if reach[k] > 0:
                # a leaf counts with its centre, another cell with its point that is nearest
                leaf, dr, dz = child[k] < 0, abs(cells[k, 0] - r), abs(cells[k, 1] - z)
                if not leaf:
                    dr, dz = max(dr - cells[k, 2], 0.0), max(dz - cells[k, 2], 0.0)
                if dr * dr + dz * dz <= reach[k] * reach[k]:
                    if leaf:
                        reach[k] = 0.0
                    else:
                        stack[count] = k
                        count += 1


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def thinned(x: Array) -> Array:
    """Return those points (r, z), in order, that keep the least distance from all points returned before them.

    x : points and the edge length there, shape (n, 3).
    """
    kept, count = np.empty((len(x), 2)), 0
    for j in range(len(x)):
        square, clear = SPACING * x[j, 2], True
        square *= square
        for i in range(count):
            dr, dz = x[j, 0] - kept[i, 0], x[j, 1] - kept[i, 1]
            if dr * dr + dz * dz <= square:
                clear = False
                break
        if clear:
            kept[count, 0], kept[count, 1] = x[j, 0], x[j, 1]
            count += 1
    return kept[:count]
