"""Readings that no pose in the workspace gives: whether one outside it does, and what ends the workspace there.

Where the readings are those of the grid over `WIDER` times the workspace of the design alone, damped Newton steps
start at the grid's poses that read most alike. The tilt there is that of the mechanics' polynomials beyond their
samples, so a pose found so is a hint, not a result. Lengths in mm, B in T.
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
"""What ends the workspace on the way to a pose: the depth or the shear of the mechanics' samples, or its own size."""

WIDER = 1.25
GRID = (15, 15, 10)
STARTS = 4
"""Poses of the grid that Newton's steps start at for each row of readings."""
BLOCK = 512
"""Rows worked on at a time."""


def poses_outside(coder: Decoder, readings: Array) -> Array:
    """The pose outside the workspace, nearest to it, that gives each row of readings (n, k), T; NaN for none.

    Returns
    -------
    shift : shape (n, 3), mm.
    """
    found = np.full((len(readings), 3), np.nan)
    low, high = (WIDER * end for end in response_surface.workspace(coder.forward.design))
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, GRID, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    # the magnet may run into an element out there, where its field is not defined
    with contextlib.suppress(BadInput):
        seen = forward_model.readings_at(coder.forward, grid)
        for start in range(0, len(readings), BLOCK):
            part = slice(start, start + BLOCK)
            found[part] = _nearest(coder, readings[part], grid, seen, low, high)
    return found


def _nearest(coder: Decoder, readings: Array, grid: Array, seen: Array, low: Array, high: Array) -> Array:
    """`poses` of some rows."""
    scale = coder.table.span
    apart = (((readings[:, :, None] - seen) / scale[:, None]) ** 2).sum(axis=1)
    starts = np.argpartition(apart, STARTS, axis=1)[:, :STARTS]
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
    """What keeps a pose (3,), mm, out of the workspace; None for a pose that is not known (NaN)."""
    if not np.isfinite(pose).all():
        return None
    low, high = response_surface.workspace(coder.forward.design)
    if pose[2] < coder.low[2] and coder.low[2] > low[2] and not pose[2] < low[2]:
        return "depth"
    aside = np.abs(pose[:2]).max()
    if aside > coder.high[0] and coder.high[0] < high[0] and not aside > high[0]:
        return "shear"
    return "workspace"
