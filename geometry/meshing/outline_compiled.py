"""Nodes on the outline of the section, in steps of the target edge length, compiled by numba.

The same formulas as in `geometry.section`, in the same order of operations. All lengths are in units of D; points are
(r, z), shape (n, 2); the table of curves is that of `sizing_compiled`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.arrays import Array, Ints
from geometry.meshing.quadtree_compiled import Tree, edge_lengths, grown
from geometry.meshing.sizing_compiled import point

BLOCK = 16
"""Number of successive fractions of a curve that have one list of sources."""


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def cuts(curves: Array, fractions: Array, turns: Array, tree: Tree, size: float) -> tuple[Array, Ints]:
    """Return the fractions that divide all curves into steps of the target edge length, and the first one of each.

    The first of each has one entry more, the number of all fractions.

    turns : sine and cosine of the angles of all arcs at other fractions and at these, shape (arcs, m, 2).
    """
    n, skip, arc = len(fractions), turns.shape[1] - len(fractions), -1
    count, first, fine = np.zeros(n), np.zeros(len(curves) + 1, np.int64), np.empty((1024, 1))
    x, wanted, near = np.empty((n, 2)), np.empty(n), np.empty((int(tree[0][0, 4]), 4))
    for c in range(len(curves)):
        arc += curves[c, 6] > 0
        for k in range(n):
            x[k, 0], x[k, 1] = point(curves[c], fractions[k], turns[arc, skip + k, 0], turns[arc, skip + k, 1])
        for k in range(0, n, BLOCK):
            edge_lengths(tree, size, x, k, min(k + BLOCK, n) - 1, near, wanted)
        # the integral of 1 / edge length counts the edges: nodes lie where it takes evenly spaced values
        for k in range(1, n):
            density = curves[c, 7] / wanted[k] + curves[c, 7] / wanted[k - 1]
            count[k] = count[k - 1] + (fractions[k] - fractions[k - 1]) * density / 2
        steps = max(1 if curves[c, 6] == 0 else 2, math.ceil(count[n - 1] - 0.3))
        first[c + 1] = first[c] + steps + 1
        fine = grown(fine, first[c + 1])
        step, k = count[n - 1] / steps, 0
        for m in range(steps):
            place = m * step
            while k < n - 2 and count[k + 1] <= place:
                k += 1
            slope = (fractions[k + 1] - fractions[k]) / (count[k + 1] - count[k])
            fine[first[c] + m, 0] = slope * (place - count[k]) + fractions[k]
        fine[first[c + 1] - 1, 0] = fractions[n - 1]
    return fine[: first[len(curves)], 0].copy(), first


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def numbered(curves: Array, t: Array, first: Ints) -> tuple[Array, Ints, Array]:
    """Number the nodes at fractions t of the curves; curves that meet share the node of their common end.

    first : first fraction of each curve, shape (curves + 1,).

    Return the curve and the fraction of each node, shape (n, 2); of each segment the nodes at its ends, shape (m, 2),
    and the curve and the fraction of its middle, shape (m, 2).
    """
    node, place, count = np.empty(len(t), np.int64), np.empty((len(t), 2)), 0
    segment, middle = np.empty((len(t), 2), np.int64), np.empty((len(t), 2))
    segments = 0
    for c in range(len(curves)):
        for k in range(first[c], first[c + 1]):
            node[k] = -1
            end = 0 if k == first[c] else 2
            if k == first[c] or k == first[c + 1] - 1:
                for d in range(c):
                    if curves[d, 0] == curves[c, end] and curves[d, 1] == curves[c, end + 1]:
                        node[k] = node[first[d]]
                    elif curves[d, 2] == curves[c, end] and curves[d, 3] == curves[c, end + 1]:
                        node[k] = node[first[d + 1] - 1]
            if node[k] < 0:
                node[k], place[count, 0], place[count, 1] = count, c, t[k]
                count += 1
            if k > first[c]:
                segment[segments, 0], segment[segments, 1] = node[k - 1], node[k]
                middle[segments, 0], middle[segments, 1] = c, (t[k - 1] + t[k]) / 2
                segments += 1
    return place[:count], segment[:segments], middle[:segments]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def place_points(x: Array, curves: Array, place: Array) -> None:
    """Write the points, shape (n, 2), at places (curve, fraction of its length), shape (n, 2)."""
    for k in range(len(place)):
        curve, t = curves[int(place[k, 0])], place[k, 1]
        angle = curve[8] + (curve[9] - curve[8]) * t
        x[k, 0], x[k, 1] = point(curve, t, math.sin(angle), math.cos(angle))
