"""The target edge length of the section, its sources and the steps along its outline, compiled by numba.

The same formulas as in `section_grading` and in `geometry.section`, in the same order of operations. All lengths are
in units of D; points are (r, z), shape (n, 2).

The outline is a table of curves, shape (n, 11): start, end, centre (r, z each), radius (0 for a straight line),
length, first and last angle, name (AXIS, BASE, MAGNET or SKIN).
The beam is the array of its lengths R, H, a, b, rho, 1 if the body has a hole for the magnet.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.arrays import Array, Ints
from geometry.meshing import section_grading as rules
from geometry.meshing.section_outline import SMALLEST

AXIS, BASE, MAGNET, SKIN = range(4)
ROUNDING = 1 + 1e-9
"""Factor by which a bound of a square is raised, so that rounding cannot exclude a source."""
SAMPLES, FEW_SAMPLES = 41, 5
"""Number of points on each curve of the magnet, and on each other curve, that may be sources."""


@njit(cache=True)
def room(beam: Array, r: float, z: float) -> float:
    """Return the least distance of a point from base, skin and magnet; negative outside the silicone."""
    R, H, a, b, rho, hollow = beam[0], beam[1], beam[2], beam[3], beam[4], beam[5]
    space: float = min(z, R - math.sqrt(r * r + (z - H) * (z - H)) if z > H else R - r)
    if hollow == 0:
        return space
    dr, dz = r - (a - rho), abs(z - H) - (b - rho)
    out_r, out_z = max(dr, 0.0), max(dz, 0.0)
    return min(space, math.sqrt(out_r * out_r + out_z * out_z) + min(max(dr, dz), 0.0) - rho)


@njit(cache=True)
def point(curve: Array, t: float, sine: float, cosine: float) -> tuple[float, float]:
    """Return the point of a curve at a fraction t of its length; sine and cosine are those of its angle on an arc."""
    if t == 0:
        return curve[0], curve[1]
    if t == 1:
        return curve[2], curve[3]
    if curve[6] == 0:
        return curve[0] + (curve[2] - curve[0]) * t, curve[1] + (curve[3] - curve[1]) * t
    return curve[4] + curve[6] * sine, curve[5] + curve[6] * cosine


@njit(cache=True)
def sources(
    curves: Array, fractions: Array, turns: Array, beam: Array, size: float, fillet: float, meshed: bool, dome: Array
) -> Array:
    """Return the sources (r, z, edge length, growth, 1 / growth), shape (m, 5), as `section_grading.grading` does.

    fractions : of the length of the curves: 41 for those of the magnet, then 5 for the others.
    turns : sine and cosine of the angle of each curve at the fractions, shape (2, curves, fractions).
    dome : sources at the tip, the clamped corner and along the dome, shape (n, 4).
    """
    found = np.empty((len(dome) + len(curves) * SAMPLES, 5))
    count, solid = 0, np.zeros(6)
    for i in range(5):
        solid[i] = beam[i]
    for i in range(2):
        count = _append(found, count, dome[i, 0], dome[i, 1], dome[i, 2], dome[i, 3])
    for c in range(len(curves)):
        curve = curves[c]
        magnet = curve[10] == MAGNET
        for k in range(0 if magnet else SAMPLES, SAMPLES if magnet else SAMPLES + FEW_SAMPLES):
            r, z = point(curve, fractions[k], turns[0, c, k], turns[1, c, k])
            want = min(size, curve[7])
            if magnet:
                want = min(want, rules.GAP * room(solid, r, z), _magnet_length(curve, beam, size, fillet, r, z))
                if meshed:
                    want = min(want, min(2 * beam[3], beam[2]) / 2)
            if want < size:
                count = _append(found, count, r, z, want, dome[1, 3])
    for i in range(2, len(dome)):
        count = _append(found, count, dome[i, 0], dome[i, 1], dome[i, 2], dome[i, 3])
    return _reduced(found[:count])


@njit(cache=True)
def _append(found: Array, count: int, r: float, z: float, least: float, growth: float) -> int:
    """Write one source; return the number of sources."""
    found[count, 0], found[count, 1], found[count, 2], found[count, 3] = r, z, least, growth
    found[count, 4] = 1 / growth
    return count + 1


@njit(cache=True)
def _magnet_length(curve: Array, beam: Array, size: float, fillet: float, r: float, z: float) -> float:
    """Return the edge length that a fillet or a sharp edge of the magnet requires at a point of its outline."""
    if curve[6] > 0:
        radius = curve[6]
        return min(rules.ROUND_EDGE * size, fillet * radius, rules.ARC * math.sqrt(radius))
    end = (r == curve[0] and z == curve[1]) or (r == curve[2] and z == curve[3])
    if beam[4] < SMALLEST and end and r > 0:
        return max(rules.CORNER, rules.SHARP_EDGE * size)
    return np.inf


@njit(cache=True)
def _reduced(found: Array) -> Array:
    """Return the sources, shape (m, 5), that determine the edge length somewhere, and the first one."""
    used, count = np.empty((len(found), 5)), 0
    for j in range(len(found)):
        r, z, least, growth = found[j, 0], found[j, 1], found[j, 2], found[j, 3]
        needed = True
        for i in range(len(found)):
            # a source that is not finer itself cannot require less at j: no root is needed
            if j and needed and found[i, 2] < least - SMALLEST and found[i, 3] <= growth:
                dr, dz = found[i, 0] - r, found[i, 1] - z
                needed = least - SMALLEST <= math.sqrt(dr * dr + dz * dz) * found[i, 3] + found[i, 2]
        if needed:
            count = _append(used, count, r, z, least, growth)
    return used[:count]


@njit(cache=True)
def grown(array: Array, count: int) -> Array:
    """Return an array with at least `count` rows that begins with the given rows."""
    if count <= len(array):
        return array
    longer = np.empty((2 * count, array.shape[1]), array.dtype)
    for i in range(len(array)):
        for j in range(array.shape[1]):
            longer[i, j] = array[i, j]
    return longer


@njit(cache=True)
def quadtree(beam: Array, source: Array, size: float) -> tuple[Array, Ints, Ints, Array]:
    """Divide the plane into cells that are small against the edge length, and list the sources that matter in each.

    The roots are squares of side 1/2 above each other. Cells outside the silicone are not divided. A cell that is not
    divided has the list of its parent.

    Return the cells (r, z, edge length at the centre, 1 if it is a leaf inside), shape (n, 4), in order of their
    size; their first child or -1, first entry and number of entries, shape (n, 3); the entries, indices of sources
    that can determine the edge length somewhere in the cell, shape (k, 1); and the sources.
    """
    used, count = len(source), math.ceil(source[0, 1] / 0.5)
    cells, links, entries = np.empty((2048, 4)), np.empty((2048, 3), np.int64), np.empty((8192, 1), np.int64)
    for s in range(used):
        entries[s, 0] = s
    for i in range(count):
        cells[i, 0], cells[i, 1] = 0.25, 0.5 * (0.5 + i)
        links[i, 1], links[i, 2] = 0, used
    side, first, last = 0.5, 0, count
    while first < last:
        for c in range(first, last):
            r, z = cells[c, 0], cells[c, 1]
            cells[c, 3], links[c, 0] = 0.0, -1
            space = room(beam, r, z)
            if space <= -0.71 * side:
                continue  # the cell lies outside: half a diagonal is 0.71 sides
            cells[c, 2], best = _least((cells, links, entries, source), c, size, r, z)
            if cells[c, 2] >= side / 0.3:
                cells[c, 3] = 1.0 if space > 0 else 0.0
                continue
            entries = grown(entries, used + links[c, 2])
            used = _list(entries, links, source, c, used, cells[c, 2], best, (r, z, math.sqrt(0.5) * side))
            cells, links = grown(cells, count + 4), grown(links, count + 4)
            links[c, 0] = count
            for k in range(4):
                cells[count, 0] = r + (side / 4 if k % 2 else -side / 4)
                cells[count, 1] = z + (side / 4 if k > 1 else -side / 4)
                links[count, 1], links[count, 2] = links[c, 1], links[c, 2]
                count += 1
        first, last, side = last, count, side / 2
    return cells[:last], links[:last], entries[:used], source


@njit(cache=True)
def _list(
    entries: Ints,
    links: Ints,
    source: Array,
    c: int,
    used: int,
    wanted: float,
    best: int,
    circle: tuple[float, float, float],
) -> int:
    """Replace the list of a cell by those sources of it that can require the least in a circle; return the end.

    wanted, best : edge length at the circle's centre, and the source that determines it, -1 if none does.
    """
    r, z, reach = circle
    # nowhere in the circle is the edge length larger than this
    most = wanted + SMALLEST + (reach * source[best, 3] if best >= 0 else 0.0)
    begin, end = links[c, 1], used
    for e in range(begin, begin + links[c, 2]):
        s = entries[e, 0]
        dr, dz = r - source[s, 0], z - source[s, 1]
        near = (most + reach * source[s, 3] - source[s, 2]) * source[s, 4]
        if near > 0 and dr * dr + dz * dz < near * near * ROUNDING:
            entries[end, 0] = s
            end += 1
    links[c, 1], links[c, 2] = used, end - used
    return end


@njit(cache=True)
def edge_length(tree: tuple[Array, Ints, Ints, Array], size: float, r: float, z: float) -> float:
    """Return the target edge length at a point inside the roots of a tree."""
    cells, links, tip = tree[0], tree[1], tree[3][0, 1]
    c = min(int(z / 0.5), math.ceil(tip / 0.5) - 1)
    while links[c, 0] >= 0:
        c = links[c, 0] + (1 if r > cells[c, 0] else 0) + (2 if z > cells[c, 1] else 0)
    return _least(tree, c, size, r, z)[0]


@njit(cache=True)
def _least(tree: tuple[Array, Ints, Ints, Array], c: int, size: float, r: float, z: float) -> tuple[float, int]:
    """Return the edge length at a point of a cell, and the source that determines it, -1 if none does."""
    links, entries, source = tree[1], tree[2], tree[3]
    wanted, best = size, -1
    for e in range(links[c, 1], links[c, 1] + links[c, 2]):
        s = entries[e, 0]
        dr, dz = r - source[s, 0], z - source[s, 1]
        square = dr * dr + dz * dz
        # only a source nearer than this can require less: most of the roots need not be computed
        near = (wanted - source[s, 2]) * source[s, 4]
        if near > 0 and square < near * near * ROUNDING:
            length = math.sqrt(square) * source[s, 3] + source[s, 2]
            if length < wanted:
                wanted, best = length, s
    return wanted, best


@njit(cache=True)
def cuts(
    curves: Array, fractions: Array, turns: Array, tree: tuple[Array, Ints, Ints, Array], size: float
) -> tuple[Array, Ints]:
    """Return the fractions that divide all curves into steps of the target edge length, and the first one of each.

    The first of each has one entry more, the number of all fractions.
    """
    n = len(fractions)
    count, first, found = np.zeros(n), np.zeros(len(curves) + 1, np.int64), np.empty((1024, 1))
    for c in range(len(curves)):
        before = 0.0
        for k in range(n):
            r, z = point(curves[c], fractions[k], turns[0, c, k], turns[1, c, k])
            density = curves[c, 7] / edge_length(tree, size, r, z)
            if k:
                count[k] = count[k - 1] + (fractions[k] - fractions[k - 1]) * (density + before) / 2
            before = density
        steps = max(1 if curves[c, 6] == 0 else 2, math.ceil(count[n - 1] - 0.3))
        first[c + 1] = first[c] + steps + 1
        found = grown(found, first[c + 1])
        step, k = count[n - 1] / steps, 0
        for m in range(steps):
            wanted = m * step
            while k < n - 2 and count[k + 1] <= wanted:
                k += 1
            slope = (fractions[k + 1] - fractions[k]) / (count[k + 1] - count[k])
            found[first[c] + m, 0] = slope * (wanted - count[k]) + fractions[k]
        found[first[c + 1] - 1, 0] = fractions[n - 1]
    return found[: first[len(curves)], 0], first


@njit(cache=True)
def numbered(curves: Array, t: Array, first: Ints) -> tuple[Ints, Ints, Ints, Array]:
    """Number the nodes at fractions t of the curves; curves that meet share the node of their common end.

    first : first fraction of each curve, shape (curves + 1,).

    Return the place in t of each node, and of each segment the nodes at its ends, its curve and its middle fraction.
    """
    node, place, count = np.empty(len(t), np.int64), np.empty(len(t), np.int64), 0
    segment, curve, middle = np.empty((len(t), 2), np.int64), np.empty(len(t), np.int64), np.empty(len(t))
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
                node[k], place[count] = count, k
                count += 1
            if k > first[c]:
                segment[segments, 0], segment[segments, 1] = node[k - 1], node[k]
                curve[segments], middle[segments] = c, (t[k - 1] + t[k]) / 2
                segments += 1
    return place[:count], segment[:segments], curve[:segments], middle[:segments]


@njit(cache=True)
def points(curves: Array, curve: Ints, t: Array, turns: Array) -> Array:
    """Return the points at fractions t of curves, shape (n, 2); turns are sine and cosine of their angles, (2, n)."""
    x = np.empty((len(t), 2))
    for k in range(len(t)):
        x[k, 0], x[k, 1] = point(curves[curve[k]], t[k], turns[0, k], turns[1, k])
    return x
