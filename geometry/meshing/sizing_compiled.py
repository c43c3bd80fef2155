"""The sources of the section's target edge length, and distances from its outline, compiled by numba.

The same formulas as in `section_grading`, in the same order of operations. All lengths are
in units of D; points are (r, z), shape (n, 2).

The outline is a table of curves, shape (n, 11): start, end, centre (r, z each), radius (0 for a straight line),
length, first and last angle, name (AXIS, BASE, MAGNET or SKIN).
The beam is the array of its lengths R, H, a, b, rho, 1 if the body has a hole for the magnet.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from geometry.arrays import Array
from geometry.meshing import section_grading as rules
from geometry.meshing.section_outline import SMALLEST

AXIS, BASE, MAGNET, SKIN = range(4)
SAMPLES, FEW_SAMPLES = 41, 5
"""Number of points on each curve of the magnet, and on each other curve, that may be sources."""


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def room(beam: Array, r: float, z: float) -> float:
    """Return the least distance of a point from base, skin and magnet; negative outside the silicone."""
    R, H, a, b, rho, hollow = beam[0], beam[1], beam[2], beam[3], beam[4], beam[5]
    space: float = min(z, R - math.sqrt(r * r + (z - H) * (z - H)) if z > H else R - r)
    if hollow == 0:
        return space
    dr, dz = r - (a - rho), abs(z - H) - (b - rho)
    out_r, out_z = max(dr, 0.0), max(dz, 0.0)
    return min(space, math.sqrt(out_r * out_r + out_z * out_z) + min(max(dr, dz), 0.0) - rho)


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def point(curve: Array, t: float, sine: float, cosine: float) -> tuple[float, float]:
    """Return the point of a curve at a fraction t of its length; sine and cosine are those of its angle on an arc."""
    if t == 0:
        return curve[0], curve[1]
    if t == 1:
        return curve[2], curve[3]
    if curve[6] == 0:
        return curve[0] + (curve[2] - curve[0]) * t, curve[1] + (curve[3] - curve[1]) * t
    return curve[4] + curve[6] * sine, curve[5] + curve[6] * cosine


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def sources(
    curves: Array, fractions: Array, turns: Array, beam: Array, size: float, fillet: float, meshed: bool, dome: Array
) -> Array:
    """Return the sources (r, z, edge length, growth, 1 / growth), shape (m, 5), as `section_grading.grading` does.

    fractions : of the length of the curves: 41 for those of the magnet, then 5 for the others.
    turns : sine and cosine of the angle of each arc at the fractions first, shape (arcs, m, 2).
    dome : sources at the tip, the clamped corner and along the dome, shape (n, 4).
    """
    found = np.empty((len(dome) + len(curves) * SAMPLES, 5))
    count, arc, solid = 0, -1, np.zeros(6)
    for i in range(5):
        solid[i] = beam[i]
    for i in range(2):
        count = _append(found, count, dome[i, 0], dome[i, 1], dome[i, 2], dome[i, 3])
    for c in range(len(curves)):
        curve = curves[c]
        arc += curve[6] > 0
        magnet = curve[10] == MAGNET
        for k in range(0 if magnet else SAMPLES, SAMPLES if magnet else SAMPLES + FEW_SAMPLES):
            r, z = point(curve, fractions[k], turns[arc, k, 0], turns[arc, k, 1])
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


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _append(found: Array, count: int, r: float, z: float, least: float, growth: float) -> int:
    """Write one source; return the number of sources."""
    found[count, 0], found[count, 1], found[count, 2], found[count, 3] = r, z, least, growth
    found[count, 4] = 1 / growth
    return count + 1


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _magnet_length(curve: Array, beam: Array, size: float, fillet: float, r: float, z: float) -> float:
    """Return the edge length that a fillet or a sharp edge of the magnet requires at a point of its outline."""
    if curve[6] > 0:
        radius = curve[6]
        return min(rules.ROUND_EDGE * size, fillet * radius, rules.ARC * math.sqrt(radius))
    end = (r == curve[0] and z == curve[1]) or (r == curve[2] and z == curve[3])
    if beam[4] < SMALLEST and end and r > 0:
        return max(rules.CORNER, rules.SHARP_EDGE * size)
    return np.inf


@njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
def _reduced(found: Array) -> Array:
    """Return the sources, shape (m, 5), that determine the edge length somewhere, and the first one."""
    used, count = np.empty((len(found), 5)), 0
    for j in range(len(found)):
        r, z, least, growth = found[j, 0], found[j, 1], found[j, 2], found[j, 3]
        needed = True
        for i in range(len(found) if j else 0):
            # a source that is not finer itself cannot require less at j: no root is needed
            if found[i, 2] < least - SMALLEST and found[i, 3] <= growth:
                dr, dz = found[i, 0] - r, found[i, 1] - z
                needed = least - SMALLEST <= math.sqrt(dr * dr + dz * dz) * found[i, 3] + found[i, 2]
                if not needed:
                    break
        if needed:
            count = _append(used, count, r, z, least, growth)
    return used[:count]
