"""Poses from readings by damped Newton steps (Gauss-Newton for more than three readings), many at a time.

With the residual f = w (B(s) - B_read) and A = w dB/ds, a step is p = -(A'A + mu tr(A'A) I)^-1 A'f. The damping mu
follows Levenberg and Marquardt: it is 0 until a step fails to reduce |f|, grows by a factor of 10 from 1e-3 while
steps fail, and falls by a factor of 10 when they succeed. Newton's method converges quadratically, so the error after
a step of length p that follows one of length p' is about p (p/p')^2. The iteration ends where this estimate is below
`GOAL`. After the first step, of length p, the estimate is c p^2, where c bounds the curvature at the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import Forward, readings_with_slopes
from analytic.inverse.start_table import STEEP
from geometry.arrays import Array

GOAL = 1e-9
"""Estimated error of a pose at which the iteration ends, mm: far below the decoder's `SAME`, far above rounding."""
STEPS = 40
"""Largest number of steps from a start; a start that has not converged by then gives no pose."""
STUCK = 1e-6
"""Length of a damped step at which the iteration stops without a pose, mm: it has met a minimum of |f| above 0."""
LONGEST = 0.5
"""Largest length of a step, mm: close to a fold, undamped steps are far too long."""


def refine(
    forward: Forward,
    starts: Array,
    target: Array,
    weights: Array,
    low: Array,
    high: Array,
    curvature: Array | float = STEEP,
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Iterate from the starts to poses that have the target readings, within a box.

    Parameters
    ----------
    starts : first shifts, shape (3, n), mm.
    target : readings, shape (k, n), T.
    weights : weights of the readings, shape (k,).
    low, high : corners of the box, shape (3,), mm.
    curvature : upper bound of |J^-1 d2B/ds2| / 2 at the starts, as `analytic.inverse.start_table.starts` returns it,
        shape (n,), 1/mm.

    Returns
    -------
    shift : shape (3, n), mm.
    residual : B - B_read, shape (k, n), T.
    slopes : dB/ds as in `readings_with_slopes`, shape (3, k, n), T/mm, at the shift before the last step.
    done : whether the iteration converged, shape (n,).
    """
    n = starts.shape[1]
    shift, residual, slopes = starts.copy(), np.empty_like(target), np.empty((3, *target.shape))
    done = np.zeros(n, dtype=np.bool_)
    # poses that converge or get stuck leave the working arrays; `active` maps those that remain to the results
    active = np.arange(n)
    floor, roof, w = low[:, None], high[:, None], weights[:, None]
    s, goal = np.clip(starts, floor, roof), target
    mu, last, bend = np.zeros(n), np.full(n, np.inf), np.broadcast_to(np.asarray(curvature, dtype=np.float64), (n,))
    values, A = readings_with_slopes(forward, s)
    f = values - goal
    size = ((w * f) ** 2).sum(axis=0)
    for _ in range(STEPS):
        p = _step(w * A, w * f, mu)
        length = np.sqrt((p**2).sum(axis=0))
        bend = np.where(np.isfinite(last), length / np.minimum(last, 1e-2) ** 2, bend)
        # a damped step is short because of its damping, which says nothing of the error
        end = (mu == 0) & ((length < 1e-3 * GOAL) | (bend * length**2 < GOAL))
        end |= size == 0
        leave = end | ((mu > 0) & (length < STUCK))
        if leave.any():
            which = active[end]
            # the last step is not followed by an evaluation: its residual is extrapolated along the slopes
            shift[:, which] = s[:, end] + p[:, end]
            residual[:, which] = f[:, end] + (A[:, :, end] * p[:, None, end]).sum(axis=0)
            slopes[:, :, which], done[which] = A[:, :, end], True
            lost = leave & ~end
            stuck = active[lost]
            shift[:, stuck], residual[:, stuck], slopes[:, :, stuck] = s[:, lost], f[:, lost], A[:, :, lost]
            go = ~leave
            if not go.any():
                return shift, residual, slopes, done
            active, mu, last, bend, size, length = active[go], mu[go], last[go], bend[go], size[go], length[go]
            s, goal, f, p, A = s[:, go], goal[:, go], f[:, go], p[:, go], A[:, :, go]
        trial = np.clip(s + p * np.minimum(1.0, LONGEST / np.maximum(length, 1e-300)), floor, roof)
        values, A_new = readings_with_slopes(forward, trial)
        f_new = values - goal
        size_new = ((w * f_new) ** 2).sum(axis=0)
        good = size_new < size
        # next to the solution rounding decides whether |f| shrinks, so short steps are accepted
        good |= (length < 1e-6) & (size_new <= 4 * size + 1e-30)
        last = np.where(good, length, last)
        s, f, A = np.where(good, trial, s), np.where(good, f_new, f), np.where(good, A_new, A)
        size = np.where(good, size_new, size)
        mu = np.where(good, np.where(mu > 1e-4, mu / 10, 0.0), np.maximum(10 * mu, 1e-3))
    shift[:, active], residual[:, active], slopes[:, :, active] = s, f, A
    return shift, residual, slopes, done


def inverse_normal(A: Array, mu: Array | float = 0.0) -> Array:
    """Return (A'A + mu tr(A'A) I)^-1, shape (3, 3, n), for A of shape (3, k, n); infinite or NaN where singular."""
    # cofactors of the symmetric matrix [[a, d, e], [d, b, f], [e, f, c]]; vectorised over the poses
    h = {(i, j): (A[i] * A[j]).sum(axis=0) for i in range(3) for j in range(i, 3)}
    extra = mu * (h[0, 0] + h[1, 1] + h[2, 2])
    a, b, c = h[0, 0] + extra, h[1, 1] + extra, h[2, 2] + extra
    d, e, f = h[0, 1], h[0, 2], h[1, 2]
    bc, ef, df = b * c - f * f, e * f - c * d, d * f - b * e
    det = a * bc + d * ef + e * df
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = (
            np.array([[bc, ef, df], [ef, a * c - e * e, d * e - a * f], [df, d * e - a * f, a * b - d * d]]) / det
        )
    return np.asarray(inverse)


def _step(A: Array, f: Array, mu: Array) -> Array:
    """Return the steps p, shape (3, n), mm; 0 where A'A is singular."""
    slope = (A * f).sum(axis=1)
    inverse = inverse_normal(A, mu)
    with np.errstate(invalid="ignore"):
        p = -(inverse[0] * slope[0] + inverse[1] * slope[1] + inverse[2] * slope[2])
    return np.where(np.isfinite(p), p, 0.0)
