"""The part `field_lines`: field lines of the magnet at its pose, in the plane of the section.

In a plane through the axis the lines of B are contours of the flux psi = r A_phi through a disc of radius r; levels
of equal distance enclose equal flux. A cylinder magnet has the B of a coil of its size. With radii over the coil's,
heights zeta above one of its ends, h^2 = 4 r / (1 + r)^2 and k^2 = 4 r / ((1 + r)^2 + zeta^2), the coil's flux is a
factor times the difference over both ends of

    r^(1/2) zeta k [(k^2 + h^2 - h^2 k^2) / (h^2 k^2) K(k) - E(k) / k^2 + (h^2 - 1) / h^2 Pi(h^2, k)]

(Callaghan & Maslen, NASA TN D-465, 1960). The lines belong to the magnet, and move with it.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from scipy import special

from fem.solution import Solution
from geometry.arrays import Array
from geometry.design import Design
from studies.explorer.section_data import plane_of

LINES = 16
"""Field lines on each side."""
INSIDE, GROWTH = 24, 1.08
"""Cells of the grid from the axis to the magnet's edge, and ratio of neighbouring cells beyond it."""
REACH = 4.0
"""Size of the grid over the sum of the magnet's radius and half its height."""
DIGITS = 3
"""Decimals of coordinates, mm."""
LEAST = 1e-3
"""Least distance of points that are kept, over the size of the grid."""


def field_lines(design: Design, solution: Solution) -> dict[str, list[list[list[float]]]]:
    """Return lines of points (x, z) in the plane of the shear, mm; none without a magnet."""
    if not design.shape.has_magnet:
        return {"lines": []}
    radius, half = design.magnet_diameter / 2, design.magnet_height / 2
    response, (c, s) = solution.response, plane_of(solution)
    along = c * response.shift[0] + s * response.shift[1]
    tilt = c * response.tilt + s * response.tilt_y
    turn = np.array([[math.cos(tilt), math.sin(tilt)], [-math.sin(tilt), math.cos(tilt)]])
    centre = np.array([along, response.shift[2] + design.H])
    lines = []
    for line in _unit_lines(half / radius):
        for side in (1.0, -1.0):
            local = radius * line * [side, 1.0]
            lines.append(np.round(local @ turn.T + centre, DIGITS).tolist())
    return {"lines": lines}


@functools.lru_cache(maxsize=16)
def _unit_lines(slenderness: float) -> tuple[Array, ...]:
    """Return the lines (n, 2) on the side r > 0 of a magnet of radius 1 and half height `slenderness`."""
    from contourpy import contour_generator

    size = REACH * (1 + slenderness)
    # radii lie beside that of the wall, where terms of the flux cancel
    inner = (np.arange(INSIDE) + 0.5) / INSIDE
    r = np.concatenate([inner, 1 + _growing(0.5 / INSIDE, size - 1)])
    upper = np.concatenate([inner * slenderness, slenderness + _growing(slenderness / INSIDE, size - slenderness)])
    z = np.concatenate([-upper[::-1], upper])
    flux = _flux(r[:, None], z[None, :] + slenderness) - _flux(r[:, None], z[None, :] - slenderness)
    r, flux = np.insert(r, 0, 0.0), np.insert(flux, 0, 0.0, axis=0)
    most = flux.max()
    contours = contour_generator(x=r, y=z, z=flux.T)
    lines = []
    for k in range(LINES):
        for line in contours.lines((k + 0.5) / LINES * most):
            lines.append(_thinned(np.asarray(line), LEAST * size))
    return tuple(lines)


def _flux(r: Array, zeta: Array) -> Array:
    """Return the term of one end of the coil in the flux, at radii and heights above that end, over its factor."""
    k2, h2 = 4 * r / ((1 + r) ** 2 + zeta**2), 4 * r / (1 + r) ** 2
    K, E = special.ellipk(k2), special.ellipe(k2)
    third = K + h2 / 3 * special.elliprj(0.0, 1 - k2, 1.0, 1 - h2)
    bracket = (k2 + h2 - h2 * k2) / (h2 * k2) * K - E / k2 + (h2 - 1) / h2 * third
    return np.asarray(np.sqrt(r * k2) * zeta * bracket)


def _growing(first: float, size: float) -> Array:
    """Return the ends of cells that grow from `first` until they cover `size`."""
    count = math.ceil(math.log1p(size * (GROWTH - 1) / first) / math.log(GROWTH))
    ends = first * (GROWTH ** np.arange(1, count + 1) - 1) / (GROWTH - 1)
    return np.asarray(ends * size / ends[-1])


def _thinned(line: Array, least: float) -> Array:
    """Return a line without points that lie closer than `least` to the one before; its ends stay."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    kept = np.diff(np.floor(length / least), prepend=-1) > 0
    kept[-1] = True
    return np.asarray(line[kept])
