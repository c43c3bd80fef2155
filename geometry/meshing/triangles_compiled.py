"""The triangles of silicone and magnet, and the second-order mesh of them, compiled by numba.

The same results as those of `geometry.section` and scikit-fem, with the same numbers of facets.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.meshing.points_compiled import ordered
from geometry.meshing.sizing_compiled import BASE, MAGNET, SKIN


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _within(node: Array, segment: Ints, name: Ints, magnet: bool, r: float, z: float) -> bool:
    """Return whether a point lies inside the outline of base and skin, or inside that of the magnet."""
    inside = False
    for k in range(len(segment)):
        if name[k] == MAGNET if magnet else (name[k] == BASE or name[k] == SKIN):
            p, q = segment[k, 0], segment[k, 1]
            if (node[p, 1] > z) != (node[q, 1] > z):
                slope = (node[q, 0] - node[p, 0]) / (node[q, 1] - node[p, 1])
                inside ^= node[p, 0] + (z - node[p, 1]) * slope > r
    return inside


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def parts(x: Array, t: Ints, fixed: int, segment: Ints, name: Ints, meshed: bool) -> tuple[Ints, Ints]:
    """Return the triangles of the silicone and, if the magnet is meshed, of the magnet, both of shape (n, 3).

    Each begins with its lowest node, and they are in ascending order.

    fixed : number of points of the border, which come first in x. name : of each segment, as in `sizing_compiled`.
    """
    silicone, core, counts = np.empty((len(t), 3), np.int64), np.empty((len(t), 3), np.int64), np.zeros(2, np.int64)
    for k in range(len(t)):
        a, b, c = t[k, 0], t[k, 1], t[k, 2]
        r, z = (x[a, 0] + x[b, 0] + x[c, 0]) / 3, (x[a, 1] + x[b, 1] + x[c, 1]) / 3
        # all points inside lie in the beam, and in the silicone if the magnet is not meshed
        filling = max(a, b, c) >= fixed
        if not filling and not _within(x, segment, name, False, r, z):
            continue
        inside = (meshed or not filling) and _within(x, segment, name, True, r, z)
        if inside and not meshed:
            continue
        part, which = (core, 1) if inside else (silicone, 0)
        first = 0 if a < b and a < c else (1 if b < c else 2)
        for s in range(3):
            part[counts[which], s] = t[k, (first + s) % 3]
        counts[which] += 1
    return ordered(silicone, counts[0], len(x)), ordered(core, counts[1], len(x))


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def second_order(
    x: Array, t: Ints, segment: Ints, middle: Array
) -> tuple[Array, Ints, Ints, NDArray[np.int32], Ints]:
    """Return the second-order mesh of triangles, with middle nodes on the curves of the border.

    Parameters
    ----------
    segment, middle : numbers of the nodes at both ends of each segment of the border, and its middle node, both of
        shape (k, 2).

    Returns
    -------
    nodes, shape (2, n); facets, shape (2, f), in ascending order; facets of each triangle, shape (3, m); triangles of
    each facet, shape (2, f), the second one -1 at the boundary; facet of each segment, shape (k,), -1 if there is
    none.
    """
    n, m = len(x), len(t)
    sides = np.empty((3 * m, 3), np.int64)
    for s in range(3):
        for k in range(m):
            i, j = t[k, 1 if s == 1 else 0], t[k, 1 if s == 0 else 2]
            row = s * m + k
            sides[row, 0], sides[row, 1], sides[row, 2] = min(i, j), max(i, j), row
    sides = ordered(sides, 3 * m, n)
    count = 0
    for row in range(3 * m):
        count += row == 0 or sides[row, 0] != sides[row - 1, 0] or sides[row, 1] != sides[row - 1, 1]
    facets, t2f, f2t = np.empty((2, count), np.int64), np.empty((3, m), np.int64), np.empty((2, count), np.int32)
    count = 0
    for row in range(3 * m):
        s, k = sides[row, 2] // m, sides[row, 2] % m
        if row == 0 or sides[row, 0] != sides[row - 1, 0] or sides[row, 1] != sides[row - 1, 1]:
            facets[0, count], facets[1, count] = sides[row, 0], sides[row, 1]
            f2t[0, count], f2t[1, count] = k, -1
            count += 1
        else:
            f2t[1, count - 1] = k
        t2f[s, k] = count - 1
    doflocs = np.empty((2, n + count))
    for axis in range(2):
        for i in range(n):
            doflocs[axis, i] = x[i, axis]
        for f in range(count):
            doflocs[axis, n + f] = (x[facets[0, f], axis] + x[facets[1, f], axis]) / 2
    facet = np.empty(len(segment), np.int64)
    for k in range(len(segment)):
        facet[k] = _search(facets, min(segment[k, 0], segment[k, 1]), max(segment[k, 0], segment[k, 1]))
        if facet[k] >= 0:
            doflocs[0, n + facet[k]], doflocs[1, n + facet[k]] = middle[k, 0], middle[k, 1]
    return doflocs, facets, t2f, f2t, facet


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _search(facets: Ints, i: int, j: int) -> int:
    """Return the facet with nodes i and j, of facets in ascending order, or -1."""
    low, high = 0, facets.shape[1] - 1
    while low <= high:
        f = (low + high) // 2
        if facets[0, f] == i and facets[1, f] == j:
            return f
        if facets[0, f] < i or (facets[0, f] == i and facets[1, f] < j):
            low = f + 1
        else:
            high = f - 1
    return -1


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def boundaries(f2t: NDArray[np.int32], facet: Ints, name: Ints, meshed: bool) -> tuple[Ints, Ints]:
    """Return the facets of the segments of each name, in ascending order, and the first one of each name.

    Both are empty if a facet is missing, or if other facets than those of the outline have only one triangle.

    facet, name : of each segment, shape (k,). meshed : whether the outline of the magnet has triangles on both sides.
    """
    label, first, none = np.full(f2t.shape[1], -1), np.zeros(5, np.int64), np.empty(0, np.int64)
    for k in range(len(facet)):
        if facet[k] < 0 or label[facet[k]] >= 0:
            return none, none
        label[facet[k]] = name[k]
        first[name[k] + 1] += 1
    order = np.empty(len(facet), np.int64)
    for k in range(4):
        first[k + 1] += first[k]
    last = first.copy()
    for f in range(len(label)):
        if (f2t[1, f] < 0) != (label[f] >= 0 and not (meshed and label[f] == MAGNET)):
            return none, none
        if label[f] >= 0:
            order[last[label[f]]] = f
            last[label[f]] += 1
    return order, first


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def unfolded(doflocs: Array, n: int, t: Ints, t2f: Ints, slopes: Array) -> bool:
    """Return whether all triangles are counter-clockwise at all quadrature points.

    n : number of corners, which come first in doflocs. slopes : derivatives of a triangle's shape functions, shape
        (6, 2, q).
    """
    for k in range(len(t)):
        for q in range(slopes.shape[2]):
            r0, r1, z0, z1 = 0.0, 0.0, 0.0, 0.0
            for a in range(6):
                i = t[k, a] if a < 3 else n + t2f[a - 3, k]
                r0 += doflocs[0, i] * slopes[a, 0, q]
                r1 += doflocs[0, i] * slopes[a, 1, q]
                z0 += doflocs[1, i] * slopes[a, 0, q]
                z1 += doflocs[1, i] * slopes[a, 1, q]
            if not r0 * z1 > r1 * z0:
                return False
    return True
