"""Delaunay triangulation of points of the plane, compiled by numba, and its repair after the points moved.

A triangulation is two arrays. `corner[3 k], corner[3 k + 1], corner[3 k + 2]` are the counter-clockwise corners of
triangle k. Side e leads from corner[e] to the next corner of its triangle; `twin[e]` is the same side in the other
triangle, or -1 on the hull.

`triangulate` adds the points in order of distance from a first triangle and keeps the hull as a linked list
(Sinclair, S-hull, arXiv:1604.01428, in the form of the library Delaunator by Agafonkin). `repair` flips sides until
all are Delaunay (Lawson); in general position both give the same triangles.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.arrays import Array, Ints

ROUNDING = 1e-13
"""Relative size of the in-circle determinant below which a side counts as Delaunay: `repair` then always ends."""


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def turn(x: Array, i: int, j: int, k: int) -> float:
    """Return twice the area of the triangle i, j, k, positive if it is counter-clockwise."""
    area: float = (x[j, 0] - x[i, 0]) * (x[k, 1] - x[i, 1]) - (x[j, 1] - x[i, 1]) * (x[k, 0] - x[i, 0])
    return area


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def encloses(x: Array, i: int, j: int, k: int, other: int) -> bool:
    """Return whether a point lies inside the circle through the counter-clockwise triangle i, j, k."""
    ar, az = x[i, 0] - x[other, 0], x[i, 1] - x[other, 1]
    br, bz = x[j, 0] - x[other, 0], x[j, 1] - x[other, 1]
    cr, cz = x[k, 0] - x[other, 0], x[k, 1] - x[other, 1]
    a, b, c = ar * ar + az * az, br * br + bz * bz, cr * cr + cz * cz
    one, two, three = a * (br * cz - bz * cr), b * (cr * az - cz * ar), c * (ar * bz - az * br)
    inside: bool = one + two + three > ROUNDING * (abs(one) + abs(two) + abs(three))
    return inside


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def link(twin: Ints, e: int, other: int) -> None:
    twin[e] = other
    if other >= 0:
        twin[other] = e


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def flip(corner: Ints, twin: Ints, e: int) -> None:
    """Replace side e, whose triangles form a convex quadrangle, by the other diagonal.

    Afterwards e and its former twin are outer sides of the two triangles.
    """
    b = twin[e]
    before, past = e - e % 3 + (e + 2) % 3, b - b % 3 + (b + 2) % 3
    corner[e], corner[b] = corner[past], corner[before]
    link(twin, e, twin[past])
    link(twin, b, twin[before])
    link(twin, before, past)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def illegal(x: Array, corner: Ints, twin: Ints, e: int) -> bool:
    """Return whether the point beyond side e, which is not on the hull, lies in the circle of e's triangle."""
    b, k = twin[e], e - e % 3
    return encloses(x, corner[k], corner[k + 1], corner[k + 2], corner[b - b % 3 + (b + 2) % 3])


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def repair(x: Array, corner: Ints, twin: Ints) -> bool:
    """Flip sides until all are Delaunay; return False if points moved so far that a triangle is inverted."""
    for e in range(0, len(corner), 3):
        if turn(x, corner[e], corner[e + 1], corner[e + 2]) <= 0:
            return False
    # the last sweep that changed each triangle: later sweeps test only sides of changed triangles
    changed = np.empty(len(corner) // 3, np.int64)
    for k in range(len(changed)):
        changed[k] = 0
    for sweep in range(1, len(corner) + 1):
        flips = 0
        for e in range(len(corner)):
            b = twin[e]
            if (
                b > e
                and (changed[e // 3] >= sweep - 1 or changed[b // 3] >= sweep - 1)
                and illegal(x, corner, twin, e)
            ):
                flip(corner, twin, e)
                changed[e // 3] = changed[b // 3] = sweep
                flips += 1
        if flips == 0:
            return True
    return False


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _legalise(x: Array, corner: Ints, twin: Ints, stack: Ints, hull: Ints, e: int) -> None:
    """Flip sides until they are Delaunay, from side e of a new triangle, opposite to the new point.

    hull : shape (4, n); row 2 is the side of the hull that starts at each point.
    """
    stack[0], count = e, 1
    while count:
        e = stack[count - 1]
        b = twin[e]
        if b < 0 or not illegal(x, corner, twin, e):
            count -= 1
            continue
        before, past = e - e % 3 + (e + 2) % 3, b - b % 3 + (b + 2) % 3
        # sides of the hull that the flip moves
        if twin[past] < 0:
            hull[2, corner[past]] = e
        if twin[before] < 0:
            hull[2, corner[before]] = b
        flip(corner, twin, e)
        # the other side opposite to the new point; e itself is looked at again
        stack[count] = b - b % 3 + (b + 1) % 3
        count += 1


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _first_triangle(x: Array) -> tuple[int, int, int]:
    """Return three points near the middle, counter-clockwise, that have a small circle through them."""
    r, z = 0.0, 0.0
    for n in range(len(x)):
        r, z = r + x[n, 0] / len(x), z + x[n, 1] / len(x)
    i = _nearest_other(x, len(x), r, z)
    j = _nearest_other(x, i, x[i, 0], x[i, 1])
    k, least = -1, np.inf
    for n in range(len(x)):
        if n != i and n != j:
            r, z = circumcentre(x, i, j, n)
            if r * r + z * z < least:
                k, least = n, r * r + z * z
    return (i, j, k) if turn(x, i, j, k) > 0 else (i, k, j)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _nearest_other(x: Array, but: int, r: float, z: float) -> int:
    """Return the point that is nearest to a place, except one point."""
    i, least = -1, np.inf
    for n in range(len(x)):
        square = (x[n, 0] - r) * (x[n, 0] - r) + (x[n, 1] - z) * (x[n, 1] - z)
        if n != but and square < least:
            i, least = n, square
    return i


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _by_distance(x: Array, r: float, z: float) -> Ints:
    """Return the numbers of the points in order of their distance from a place (Shell's sort)."""
    n = len(x)
    square, order = np.empty(n), np.empty(n, np.int64)
    for i in range(n):
        order[i] = i
        square[i] = (x[i, 0] - r) * (x[i, 0] - r) + (x[i, 1] - z) * (x[i, 1] - z)
    gap = n // 2
    while gap:
        for i in range(gap, n):
            item, j = order[i], i
            while j >= gap and square[order[j - gap]] > square[item]:
                order[j] = order[j - gap]
                j -= gap
            order[j] = item
        gap = 1 if gap == 2 else int(gap / 2.2)
    return order


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def circumcentre(x: Array, i: int, j: int, k: int) -> tuple[float, float]:
    """Return the centre of the circle through three points, relative to the first; infinite if they are in line."""
    br, bz, cr, cz = x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[k, 0] - x[i, 0], x[k, 1] - x[i, 1]
    b, c, area = br * br + bz * bz, cr * cr + cz * cz, 2 * (br * cz - bz * cr)
    if area == 0:
        return np.inf, np.inf
    return (cz * b - bz * c) / area, (br * c - cr * b) / area


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _bin(r: float, z: float, bins: int) -> int:
    """Return the index of a direction, which grows with the angle from -pi to pi."""
    p = r / (abs(r) + abs(z))
    return int(bins * (3 - p if z > 0 else 1 + p) / 4) % bins


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def triangulate(x: Array) -> tuple[Ints, Ints]:
    """Return the Delaunay triangulation of points, shape (n, 2), as `corner` and `twin`.

    Some points are missing if they coincide with others to rounding.
    """
    n, bins = len(x), math.ceil(math.sqrt(len(x)))
    corner, twin, stack = np.empty(6 * n, np.int64), np.empty(6 * n, np.int64), np.empty(6 * n, np.int64)
    # of each point on the hull: the next and previous one, the side that starts there, whether it is on the hull
    hull, nearby = np.zeros((4, n), np.int64), np.zeros(bins, np.int64) - 1
    first = _first_triangle(x)
    r, z = circumcentre(x, first[0], first[1], first[2])
    r, z = x[first[0], 0] + r, x[first[0], 1] + z
    for s in range(3):
        i, twin[s] = first[s], -1
        corner[s] = hull[1, first[(s + 1) % 3]] = i
        hull[0, i], hull[2, i], hull[3, i] = first[(s + 1) % 3], s, 1
        nearby[_bin(x[i, 0] - r, x[i, 1] - z, bins)] = i
    sides, latest = len(first), first[0]
    for i in _by_distance(x, r, z):
        if i == first[0] or i == first[1] or i == first[2]:
            continue
        key = _bin(x[i, 0] - r, x[i, 1] - z, bins)
        start = latest
        for step in range(bins):
            near = nearby[(key + step) % bins]
            if near >= 0 and hull[3, near] == 1:
                start = near
                break
        start = hull[1, start]
        e = start
        while turn(x, e, hull[0, e], i) >= 0:
            e = hull[0, e]
            if e == start:
                break
        if turn(x, e, hull[0, e], i) >= 0:
            continue  # the point coincides with another one
        sides, e = _add(x, corner, twin, stack, hull, sides, i, e, e == start)
        nearby[key] = latest = i
        nearby[_bin(x[e, 0] - r, x[e, 1] - z, bins)] = e
    return corner[:sides], twin[:sides]


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _add(
    x: Array, corner: Ints, twin: Ints, stack: Ints, hull: Ints, sides: int, i: int, e: int, backwards: bool
) -> tuple[int, int]:
    """Connect point i, outside the hull, with all sides of the hull that it sees, from the side at point e on.

    Return the number of sides of triangles, and the point before i on the new hull.
    """
    after = hull[0, e]
    corner[sides], corner[sides + 1], corner[sides + 2] = e, i, after
    twin[sides] = twin[sides + 1] = -1
    link(twin, sides + 2, hull[2, e])
    hull[2, e] = sides
    hull[2, i] = sides + 1
    _legalise(x, corner, twin, stack, hull, sides + 2)
    sides += 3
    while turn(x, after, hull[0, after], i) < 0:
        q = hull[0, after]
        corner[sides], corner[sides + 1], corner[sides + 2] = after, i, q
        link(twin, sides, hull[2, i])
        twin[sides + 1] = -1
        link(twin, sides + 2, hull[2, after])
        hull[2, i] = sides + 1
        _legalise(x, corner, twin, stack, hull, sides + 2)
        hull[3, after] = 0
        after = q
        sides += 3
    while backwards and turn(x, hull[1, e], e, i) < 0:
        q = hull[1, e]
        corner[sides], corner[sides + 1], corner[sides + 2] = q, i, e
        twin[sides] = -1
        link(twin, sides + 1, hull[2, e])
        link(twin, sides + 2, hull[2, q])
        hull[2, q] = sides
        _legalise(x, corner, twin, stack, hull, sides + 2)
        hull[3, e] = 0
        e = q
        sides += 3
    hull[0, e], hull[1, i], hull[0, i], hull[1, after], hull[3, i] = i, e, after, i, 1
    return sides, e
