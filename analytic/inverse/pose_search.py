"""All poses that have one row of readings: starts from the table, a damped Newton iteration from each.

The starts are those that `analytic.inverse.start_table` explains. With the residual f = w (B(s) - B_read) and
A = w dB/ds, a step is p = -(A'A + mu tr(A'A) I)^-1 A'f (Gauss-Newton for more than three readings). The damping mu
follows Levenberg and Marquardt: it is 0 until a step fails to reduce |f|, grows by a factor of 10 from 1e-3 while
steps fail, and falls by a factor of 10 when they succeed. Newton's method converges quadratically, so the error after
a step of length p that follows one of length p' is about p (p/p')^2. The iteration ends where this estimate is below
`GOAL`.

Two rules end iterations that would lead nowhere. A start stands for the poses near it, since every other pose has a
start of its own: an iteration that moves farther than `REACH` cell diagonals from its start ends. So does one whose
misfit does not fall to `FALL` of its size in `STALL` evaluations, as next to a minimum of the misfit that is no pose.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analytic.inverse.forward_model import Forward, read
from analytic.inverse.start_table import FOLD_MARGIN, MARGIN, StartTable
from geometry.arrays import Array
from geometry.compiled import compiled

SAME = 1e-5
"""Distance below which two poses count as one, mm: far above the error of a converged pose."""
EXACT = 1e-7
"""Largest misfit of three readings over the norm of their slopes, mm: three readings determine a pose exactly."""
APART = 0.8
"""Starts with the same sign of det J and closer than this many diagonals of their cell lead to the same pose."""
GOAL = 1e-9
"""Estimated error of a pose at which the iteration ends, mm: far below `SAME`, far above rounding."""
STEPS = 40
"""Largest number of steps from a start; a start that has not converged by then gives no pose."""
STUCK = 1e-6
"""Length of a damped step at which the iteration stops without a pose, mm: it has met a minimum of |f| above 0."""
LONGEST = 0.5
"""Largest length of a step, mm: close to a fold, undamped steps are far too long."""
REACH = 2.5
"""Farthest that an iteration moves from its start, in cell diagonals; nearly all poses lie within 1 of a start."""
STALL, FALL = 6, 0.8
"""Number of evaluations in which the misfit must fall, and to which part of its size. Near a double root, the slowest
case, each full step brings it to a quarter."""
LOST, MISFIT, POSE = 0, 1, 2
"""Ends of an iteration: no convergence, a pose that does not fit the readings, a pose that does."""


class Search:
    """The arguments of `poses_of` for one decoder.

    Parameters
    ----------
    forward, table : forward model, and table of starts.
    low, high : corners of the workspace, rounding on its faces included, shape (3,), mm.
    weights : of the readings in the misfit, shape (k,).
    tolerance : largest misfit of each reading if there are more than three, shape (k,), T.
    """

    def __init__(
        self, forward: Forward, table: StartTable, low: Array, high: Array, weights: Array, tolerance: Array
    ) -> None:
        k = len(forward.elements)
        self._kernel = forward.kernel
        self._table: tuple[Any, ...] = (
            *(table.basis, table.low, table.high, table.after, table.maps, table.sign, table.centre, table.edge),
            *(table.fold, table.corners, table.corner_sign),
        )
        # the way to a pose inside may lead through shifts a little outside
        pad = 3 * table.edge[0]
        self._box = low, high, low - pad, high + pad, REACH * float(np.linalg.norm(table.edge[0]))
        self._weights, self._tolerance = weights, tolerance
        self._scratch = tuple(np.empty((1, *shape)) for shape in ((3,), (k,), (k, 3)) * 2)

    def __call__(self, field: Array) -> tuple[Array, Array, bool]:
        """Return shifts (n, 3), mm, and slopes (n, k, 3), T/mm, of all poses, and whether one was a misfit.

        Parameters
        ----------
        field : B.n of each element, shape (k,), T.
        """
        shifts, slopes, count, misfit = poses_of(
            field, self._kernel, self._table, self._box, self._weights, self._tolerance, self._scratch
        )
        return shifts[:count], slopes[:count], misfit

    def pose_from(self, start: Array, field: Array, low: Array, high: Array) -> Array:
        """Return the pose that an iteration from a start finds in a box, shape (3,), mm; NaN if it finds none."""
        box, arrays = (low, high), (self._weights, self._tolerance, self._scratch)
        end = newton(np.ascontiguousarray(start), math.inf, np.ascontiguousarray(field), self._kernel, *box, *arrays)
        return self._scratch[0][0].copy() if end == POSE else np.full(3, np.nan)


@compiled
def poses_of(field, kernel, table, box, weights, tolerance, scratch):
    """Return the poses of one row of readings.

    Parameters
    ----------
    field : B.n or |B| of k elements, T.
    kernel : `Forward.kernel`.
    table, box, weights, tolerance, scratch : as in `Search`.

    Returns
    -------
    shifts, slopes : shape (n, 3), mm, and dB/ds, shape (n, k, 3), T/mm.
    count : number n of poses; the arrays are longer.
    misfit : whether a converged pose in the workspace does not fit the readings.
    """
    low, high, floor, roof, reach = box
    s, A = scratch[0], scratch[2]
    starts = starts_of(field, table)
    shifts, slopes = np.empty((len(starts), 3)), np.empty((len(starts), len(field), 3))
    count, misfit, start = 0, False, np.empty(3)
    for _, _, x, y, z in starts:
        start[0], start[1], start[2] = x, y, z
        end = newton(start, reach, field, kernel, floor, roof, weights, tolerance, scratch)
        inside, known = end != LOST, False
        for j in range(3):
            inside = inside and low[j] <= s[0, j] <= high[j]
        misfit = misfit or (inside and end == MISFIT)
        for i in range(count):
            apart = 0.0
            for j in range(3):
                apart = max(apart, abs(shifts[i, j] - s[0, j]))
            known = known or apart < SAME
        if inside and end == POSE and not known:
            for j in range(3):
                shifts[count, j] = s[0, j]
                for i in range(len(field)):
                    slopes[count, i, j] = A[0, i, j]
            count += 1
    return shifts, slopes, count, misfit


@compiled
def starts_of(field, table):
    """Return the starts for one row of readings: of each how far off the centre, sign of det J and shift, mm."""
    basis, low, high, after, maps, sign, centre, edge, fold, corners, corner_sign = table
    r, u = np.zeros(3), np.zeros(3)
    for i in range(3):
        for j in range(len(field)):
            r[i] += basis[i, j] * field[j]
    starts = [(0.0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    cell = 0
    while cell < len(low):
        a, b = low[cell], high[cell]
        if not (a[0] <= r[0] <= b[0] and a[1] <= r[1] <= b[1] and a[2] <= r[2] <= b[2]):
            cell = after[cell]
            continue
        c, e = centre[cell], edge[cell]
        apart = APART * math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        for i in range(3):
            row = maps[cell, i]
            u[i] = row[0] * r[0] + row[1] * r[1] + row[2] * r[2] + row[3]
        far = max(abs(u[0]), abs(u[1]), abs(u[2]))
        if sign[cell] != 0 and far <= 0.5 + MARGIN:
            add_start(starts, far, sign[cell], c[0] + u[0] * e[0], c[1] + u[1] * e[1], c[2] + u[2] * e[2], apart)
        elif fold[cell] >= 0 and far <= 0.5 + FOLD_MARGIN:
            for side in (-1, 1):
                near, best = math.inf, -1
                for corner in range(8):
                    p = corners[fold[cell], corner]
                    d = max(abs(p[0] - u[0]), abs(p[1] - u[1]), abs(p[2] - u[2]))
                    if corner_sign[fold[cell], corner] == side and d < near:
                        near, best = d, corner
                if best >= 0:
                    x, y, z = best // 4 - 0.5, best // 2 % 2 - 0.5, best % 2 - 0.5
                    # farther than any place in a cell
                    add_start(starts, 1 + near, side, c[0] + x * e[0], c[1] + y * e[1], c[2] + z * e[2], apart)
        cell += 1
    return starts


@compiled
def add_start(starts, far, side, x, y, z, apart):
    """Add a start, or put it in place of one that is less than `apart` away and farther off its cell's centre.

    Neighbouring cells overlap by their margins, so one pose often lies in several of them.
    """
    for i in range(len(starts)):
        there, its_side, a, b, c = starts[i]
        if its_side == side and (a - x) ** 2 + (b - y) ** 2 + (c - z) ** 2 <= apart * apart:
            if far < there:
                starts[i] = (far, side, x, y, z)
            return
    starts.append((far, side, x, y, z))


@compiled
def newton(start, reach, field, kernel, floor, roof, weights, tolerance, scratch):
    """Iterate from a start (3,), within a box, and return how this ends: LOST, MISFIT or POSE.

    `scratch` then begins with the pose, shape (1, 3), mm, the misfit, T, and the slopes there, T/mm.
    """
    s, f, A, trial, g, B = scratch
    for j in range(3):
        s[0, j] = min(max(start[j], floor[j]), roof[j])
    mu, last = 0.0, math.inf
    size = misfit_of(s, field, kernel, weights, f, A)
    sizes = np.full(STALL, size)
    for turn in range(STEPS):
        p = step(f[0], A[0], weights, mu)
        length = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        error = length * (length / min(last, 1e-2)) ** 2
        # a damped step is short because of its damping, which says nothing of the error
        if size == 0 or (mu == 0 and (length < 1e-3 * GOAL or (last < math.inf and error < GOAL))):
            for j in range(3):
                s[0, j] += p[j]
            misfit_of(s, field, kernel, weights, f, A)
            return POSE if fits(f[0], A[0], tolerance) else MISFIT
        if not size < math.inf or (mu > 0 and length < STUCK):
            return LOST
        if turn >= STALL and size > FALL * FALL * sizes[turn % STALL] and length >= 1e-6:
            return LOST
        sizes[turn % STALL] = size
        if (s[0, 0] - start[0]) ** 2 + (s[0, 1] - start[1]) ** 2 + (s[0, 2] - start[2]) ** 2 > reach * reach:
            return LOST
        short = min(1.0, LONGEST / length) if length > 0 else 1.0
        for j in range(3):
            trial[0, j] = min(max(s[0, j] + short * p[j], floor[j]), roof[j])
        size_there = misfit_of(trial, field, kernel, weights, g, B)
        # next to the solution rounding decides whether the misfit shrinks, so short steps are accepted
        if size_there < size or (length < 1e-6 and size_there <= 4 * size + 1e-30):
            for j in range(3):
                s[0, j] = trial[0, j]
            for i in range(len(field)):
                f[0, i] = g[0, i]
                for j in range(3):
                    A[0, i, j] = B[0, i, j]
            size, last = size_there, length
            mu = mu / 10 if mu > 1e-4 else 0.0
        else:
            mu = max(10 * mu, 1e-3)
    return LOST


@compiled
def misfit_of(shift, field, kernel, weights, f, A):
    """Fill f and A with the misfit, T, and slopes, T/mm, at a shift (1, 3); return the sum of weighted squares.

    It is infinite where the field is not defined.
    """
    read(shift, kernel, f, A)
    total = 0.0
    for i in range(len(field)):
        f[0, i] -= field[i]
        total += (weights[i] * f[0, i]) ** 2
    return math.inf if math.isnan(total) else total


@compiled
def fits(f, A, tolerance):
    """Return whether the misfit f, T, at a pose with the slopes A, T/mm, is within its bounds."""
    size, norm, good = 0.0, 0.0, True
    for i in range(len(f)):
        size += f[i] * f[i]
        norm += A[i, 0] * A[i, 0] + A[i, 1] * A[i, 1] + A[i, 2] * A[i, 2]
        good = good and abs(f[i]) <= tolerance[i]
    return math.sqrt(size) <= EXACT * math.sqrt(norm) if len(f) == 3 else good


@compiled
def step(f, A, weights, mu):
    """Return the step -(A'WA + mu tr(A'WA) I)^-1 A'W f, mm; 0 where the matrix is singular."""
    a, b, c, d, e, h, p, q, r = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(f)):
        w = weights[i] * weights[i]
        x, y, z = A[i, 0], A[i, 1], A[i, 2]
        a, b, c = a + w * x * x, b + w * y * y, c + w * z * z
        d, e, h = d + w * x * y, e + w * x * z, h + w * y * z
        p, q, r = p + w * x * f[i], q + w * y * f[i], r + w * z * f[i]
    extra = mu * (a + b + c)
    a, b, c = a + extra, b + extra, c + extra
    # cofactors of the symmetric matrix [[a, d, e], [d, b, h], [e, h, c]]
    bc, eh, dh = b * c - h * h, e * h - c * d, d * h - b * e
    det = a * bc + d * eh + e * dh
    if not det > 0:
        return 0.0, 0.0, 0.0
    ac, de, ab = a * c - e * e, d * e - a * h, a * b - d * d
    return (
        -(bc * p + eh * q + dh * r) / det,
        -(eh * p + ac * q + de * r) / det,
        -(dh * p + de * q + ab * r) / det,
    )
