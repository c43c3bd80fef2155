"""Shift of the magnet under a given force: the inverse of the mechanics' polynomials.

With u the lateral and w the vertical shift, a force has the components F_t = u k(u^2, w) along the shift and
F_n = n(u^2, w) (see `analytic.inverse.response_surface`). Newton steps solve for (u, w), from the nearest point of a
grid over the workspace. Only stable loads count, where a larger force in each direction shifts the magnet farther.
Forces in N, lengths in mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.response_surface import Mechanics, forces
from geometry.arrays import Array

GRID = 41
"""Number of start points along u and along w: neighbours are so close that Newton's steps converge from them."""
STEPS = 30
"""Largest number of Newton steps; from a start of the grid about five suffice."""
EXACT = 1e-9
"""Largest difference of the forces over the largest given force: far above rounding, far below any noise."""
BLOCK = 256
"""Number of forces that are compared with all starts at a time, which bounds the memory."""


def shifts_of_forces(
    mechanics: Mechanics, low: Array, high: Array, tangential: Array, normal: Array
) -> tuple[Array, Array]:
    """Return the lateral shift u >= 0 and the vertical shift w, each of shape (n,), mm; NaN where none is found.

    Parameters
    ----------
    low, high : workspace, shape (3,), mm; shifts outside it do not count.
    tangential, normal : forces F_t >= 0 and F_n >= 0, shape (n,), N.
    """
    scale = float(np.hypot(tangential, normal).max(initial=0.0)) or 1.0
    u, w = _starts(mechanics, low, high, tangential, normal)
    # no step may be longer than some cells of the grid: a polynomial bends too much for more
    reach = np.array([high[0], -low[2]])[:, None] / (GRID - 1) * 4
    for _ in range(STEPS):
        residual, slopes = _residual(mechanics, u, w, tangential, normal)
        (a, b), (c, d) = slopes
        det = a * d - b * c
        safe = np.where(det != 0, det, 1.0)
        step = np.stack([d * residual[0] - b * residual[1], a * residual[1] - c * residual[0]]) / safe
        longest = np.maximum((np.abs(step) / reach).max(axis=0), 1.0)
        u, w = u - step[0] / longest, w - step[1] / longest
    residual, slopes = _residual(mechanics, u, w, tangential, normal)
    good: NDArray[np.bool_] = np.asarray((np.abs(residual) <= EXACT * scale).all(axis=0)) & _stable(slopes)
    edge = 1e-6 * reach[0]
    good &= (np.abs(u) <= high[0] + edge) & (w >= low[2] - edge) & (w <= high[2] + edge) & (u >= -edge)
    return np.where(good, np.maximum(u, 0.0), np.nan), np.where(good, w, np.nan)


def _starts(mechanics: Mechanics, low: Array, high: Array, tangential: Array, normal: Array) -> tuple[Array, Array]:
    """Return the stable point of the grid whose force is nearest to each given one: u and w, shape (n,)."""
    u, w = (values.ravel() for values in np.meshgrid(np.linspace(0, high[0], GRID), np.linspace(low[2], 0, GRID)))
    force, slopes = _residual(mechanics, u, w, np.zeros_like(u), np.zeros_like(u))
    stable = _stable(slopes)
    u, w, force = u[stable], w[stable], force[:, stable]
    if not len(u):
        return np.zeros_like(tangential), np.zeros_like(normal)
    nearest = [
        np.argmin(
            (force[0] - tangential[k : k + BLOCK, None]) ** 2 + (force[1] - normal[k : k + BLOCK, None]) ** 2, 1
        )
        for k in range(0, len(normal), BLOCK)
    ]
    index = np.concatenate(nearest)
    return u[index], w[index]


def _residual(mechanics: Mechanics, u: Array, w: Array, tangential: Array, normal: Array) -> tuple[Array, Array]:
    """Return (F_t, F_n) less the given forces, shape (2, n), and its slopes d(F_t, F_n)/d(u, w), shape (2, 2, n)."""
    force, slopes = forces(mechanics, np.stack([u, np.zeros_like(u), w]))
    at = np.ix_([0, 2], [0, 2])
    # `forces` has the component in its second axis
    return force[[0, 2]] - [tangential, normal], slopes[at].transpose(1, 0, 2)


def _stable(slopes: Array) -> NDArray[np.bool_]:
    """Return whether loads are stable: F_t grows with u at a fixed w, and F_n grows with -w at a fixed F_t."""
    (a, b), (c, d) = slopes
    return np.asarray((a > 0) & (a * d - b * c < 0))
