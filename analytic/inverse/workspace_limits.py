"""Readings that no pose in the workspace has: the nearest pose outside it, and the limit which that pose exceeds.

The search covers a box of `WIDER` times the workspace of the design without mechanics. Damped Newton steps start at
those poses of a grid over the box whose readings differ least. The mechanics' polynomials give the tilt there beyond
their samples, so such a pose is a hint to the user and no result. Lengths in mm, B in T.
"""

from __future__ import annotations

import contextlib
from typing import Literal

import numpy as np

from analytic import decode
from analytic.decode import Decoder
from analytic.inverse import damped_newton, forward_model, response_surface
from geometry.arrays import Array
from geometry.design import BadInput

Limit = Literal["depth", "shear", "workspace"]
"""Limit that a pose exceeds: the depth or the shear of the mechanics' samples, or the workspace of the design."""

WIDER = 1.25
"""Size of the box of the search over the workspace of the design: poses farther outside are not looked for."""
GRID = (15, 15, 10)
"""Number of grid points along x, y and z."""
STARTS = 4
"""Number of poses of the grid from which Newton steps start, for each row of readings."""
BLOCK = 512
"""Number of rows that are decoded at a time, which bounds the memory for their distances to the grid."""


def poses_outside(coder: Decoder, readings: Array) -> Array:
    """Return, for each row of readings (n, k), T, the pose with these readings that lies least outside the workspace.

    Returns
    -------
    shift : shape (n, 3), mm; NaN where no pose is found.
    """
    shifts = np.full((len(readings), 3), np.nan)
    low, high = (WIDER * end for end in response_surface.workspace(coder.forward.design))
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, GRID, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    # beyond the workspace the magnet may overlap an element, where its field can be undefined
    with contextlib.suppress(BadInput):
        grid_readings = forward_model.readings_at(coder.forward, grid)
        for start in range(0, len(readings), BLOCK):
            part = slice(start, start + BLOCK)
            shifts[part] = _nearest(coder, readings[part], grid, grid_readings, low, high)
    return shifts


def _nearest(coder: Decoder, readings: Array, grid: Array, grid_readings: Array, low: Array, high: Array) -> Array:
    """Return `poses_outside` for one block of rows, from the grid (3, m), mm, and its readings (k, m), T."""
    scale = coder.table.span
    difference = (((readings[:, :, None] - grid_readings) / scale[:, None]) ** 2).sum(axis=1)
    starts = np.argpartition(difference, STARTS, axis=1)[:, :STARTS]
    owner = np.repeat(np.arange(len(readings)), STARTS)
    target = np.ascontiguousarray(readings[owner].T)
    s, f, A, done = damped_newton.refine(
        coder.forward, grid[:, starts.ravel()].copy(), target, np.ones(len(target)), low, high
    )
    far = np.maximum(np.maximum(coder.low[:, None] - s, s - coder.high[:, None]), 0.0).max(axis=0)
    far[~(done & decode.fits(coder, f, A) & (far > decode.EDGE))] = np.inf
    best = far.reshape(-1, STARTS).argmin(axis=1) + STARTS * np.arange(len(readings))
    return np.where(np.isfinite(far[best]), s[:, best], np.nan).T


def exceeded_limit(coder: Decoder, pose: Array) -> Limit | None:
    """Return the limit of the workspace that a pose (3,), mm, exceeds; None for NaN, which stands for no pose."""
    if not np.isfinite(pose).all():
        return None
    low, high = response_surface.workspace(coder.forward.design)
    # report a limit of the mechanics only if the pose lies within the workspace of the design without mechanics
    if pose[2] < coder.low[2] and coder.low[2] > low[2] and not pose[2] < low[2]:
        return "depth"
    aside = np.abs(pose[:2]).max()
    if aside > coder.high[0] and coder.high[0] < high[0] and not aside > high[0]:
        return "shear"
    return "workspace"
