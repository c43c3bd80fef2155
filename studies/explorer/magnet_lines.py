"""The part `field_lines`: field lines of the magnet at its pose, in the plane of the section.

In a plane through the axis the lines are contours of the flux psi(r, z) = int_0^r B_z r' dr' through a disc of radius
r. Levels of equal distance enclose equal flux. They belong to the magnet, and move with it.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from analytic.magnet import cylinder_field
from fem.solution import Solution
from geometry.arrays import Array
from geometry.design import Design

LINES = 12
"""Field lines on each side."""
INSIDE, GROWTH = 12, 1.1
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
    response, (c, s) = solution.response, solution.load.direction
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
    r = np.concatenate([np.linspace(0, 1, INSIDE + 1), 1 + _growing(1 / INSIDE, size - 1)])
    # heights lie between those of the magnet's rims, where the field is infinite
    inner = (np.arange(INSIDE) + 0.5) * slenderness / INSIDE
    upper = np.concatenate([inner, slenderness + _growing(slenderness / INSIDE, size - slenderness)])
    z = np.concatenate([-upper[::-1], upper])
    grid = np.stack(np.meshgrid(r, [0.0], z, indexing="ij"), axis=-1).reshape(-1, 3)
    axial = cylinder_field(grid, 1.0, 2 * slenderness, 1.0)[:, 2].reshape(len(r), len(z)) * r[:, None]
    # by the trapezoidal rule; on the hull, where B_z jumps, the field is the mean of both sides
    steps = np.diff(r)[:, None] * (axial[1:] + axial[:-1]) / 2
    flux = np.concatenate([np.zeros((1, len(z))), np.cumsum(steps, axis=0)])
    most = flux[INSIDE].max()
    contours = contour_generator(x=r, y=z, z=flux.T)
    lines = []
    for k in range(LINES):
        for line in contours.lines((k + 0.5) / LINES * most):
            lines.append(_thinned(np.asarray(line), LEAST * size))
    return tuple(lines)


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
