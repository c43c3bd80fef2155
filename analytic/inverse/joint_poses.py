"""All poses of an array from one frame of readings: what the elements read of all magnets, and a step to the poses.

With the misfits r of all readings, and the slopes A_ij of those of beam i along the shift of the magnet of beam j,
Gauss and Newton's step p solves

    A'K A p = A'K r,    K = W^2 - W^2 N S N' W^2,

with the decoders' weights W. Without an ambient field K is W^2; a uniform one that is the same for all beams is
eliminated by the directions N of all elements that read, with S = (N' W^2 N)^-1 (`analytic.inverse.ambient_field`):
the field is S N' W^2 r. Conjugate gradients solve it, scaled by the inverses of the beams' own blocks
A_ii'W^2 A_ii: beams that disturb each other little need some steps, and each step two products for each pair that
acts. So the work grows as the number of pairs.

An array is a tuple: beams whose elements read and whose magnets act, (2, m), each pair once, the first ascending;
where the first beam of each lies from the second, (m, 3), mm; the magnets' poles (n,); and what the kernels of the
beams' `analytic.inverse.forward_model.Forward` hold, a row for each beam, or one for all of them (`stacked`).
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from analytic.inverse.forward_model import CENTRED, NO_TILT, Forward, place_magnets, read_poses, slopes_by_place
from analytic.inverse.pose_search import cofactors
from geometry.compiled import compiled

STEPS = 20
"""Largest number of joint steps: from poses decoded one by one four to six suffice."""
CONVERGED = 1e-13
"""Length of the next step, over D, at which the iteration ends: as Newton's steps go, it is that of the last one
times the square of its ratio to the one before, and no less than the share of it that its equations lack."""
SOLVED = 1e-6
"""That share, at which conjugate gradients end: of a step that is as short, nothing is left but rounding."""


def stacked(forwards: Sequence[Forward]) -> tuple[Any, ...]:
    """Return points and normals (n, p, 3), owners and shares, motions, magnets and series of forward models that have
    as many elements."""
    points, normals, owners, share, motion, _, *magnet, _, disc = zip(
        *(each.kernel for each in forwards), strict=True
    )
    tau, offset, tilt = zip(*motion, strict=True)
    coefficients, least, most = map(np.array, zip(*tau, strict=True))
    motions = coefficients, least, most, np.array(offset), np.array(tilt)
    series = np.array([each.kernel[-2] for each in forwards])
    return np.array(points), np.array(normals), owners[0], share[0], motions, np.column_stack(magnet), series, disc[0]


@compiled
def read_shifted(shift, array, values, slopes):
    """Fill what each pair's magnet adds at shifts (n, 3), and, if they are not empty, its slopes (m, k, 3)."""
    n, k, pairs = len(shift), values.shape[1], array[0]
    tau, least, most, offset, tilt = array[3][4]
    moved, axis, by_place, by_axis = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 3))
    alike = n // len(tau)
    for j in range(len(tau)):
        some, motion = slice(alike * j, alike * j + alike), ((tau[j], least[j], most[j]), offset[j], tilt[j])
        place_magnets(motion, shift[some], moved[some], axis[some], by_place[some], by_axis[some])
    by_shift, by_turn = np.empty((len(slopes), k, 3)), np.empty((len(slopes), k, 3))
    read_placed(moved, axis, array, values, by_shift, by_turn)
    for q in range(len(slopes)):
        j = pairs[1, q]
        slopes_by_place(by_shift[q], by_turn[q], axis[j], by_place[j], by_axis[j], slopes[q])


@compiled
def read_placed(moved, axis, array, values, by_shift, by_turn):
    """Fill what each pair's magnet adds to readings (m, k), by displacements and axes (n, 3) of the magnets."""
    pairs, offsets, poles, (points, normals, owners, share, _, magnets, series, disc) = array
    m, motion, slope = len(offsets), (NO_TILT, *CENTRED), len(by_shift) > 0
    # the elements see the magnet of another beam where it lies from their own
    at, along = np.empty((m, 3)), np.empty((m, 3))
    for q in range(m):
        j = pairs[1, q]
        for i in range(3):
            at[q, i], along[q, i] = moved[j, i] - offsets[q, i], axis[j, i]
    # beams that are alike have one row, and all pairs are read at once
    alike = m if len(points) == 1 else 1
    for q in range(0, m, alike):
        i, j = (0, 0) if alike == m else (pairs[0, q], pairs[1, q])
        magnet = magnets[j, 0], magnets[j, 1], magnets[j, 2], series[j], disc
        kernel = (points[i], normals[i], owners, share, motion, False, *magnet)
        some, few = slice(q, q + alike), slice(q, q + alike if slope else q)
        read_poses(at[some], along[some], kernel, values[some], by_shift[few], by_turn[few])
    for q in range(m):
        if poles[pairs[1, q]] < 0:
            values[q] = -values[q]
            if len(by_shift):
                by_shift[q], by_turn[q] = -by_shift[q], -by_turn[q]


@compiled
def solve_frame(row, lost, array, scale, shift, values):
    """Move shifts (n, 3), mm, to those with the readings (n, k), T, and fill what each pair's magnet adds there.

    scale : squared weights W^2 (n, k), directions N (n, k, 3), 0 for beams that are lost, and S (3, 3); D, mm.
        Without an ambient field N is empty.

    Return whether they were found.
    """
    (metric, D), pairs, (m, k) = scale, array[0], values.shape
    slopes, last = np.empty((m, k, 3)), 1e-3 * D
    for _ in range(STEPS):
        read_shifted(shift, array, values, slopes)
        misfit = row.copy()
        for q in range(m):
            i, j = pairs[0, q], pairs[1, q]
            for a in range(k):
                misfit[i, a] -= values[q, a]
            if lost[i] or lost[j]:
                slopes[q] = 0.0
        for i in range(len(lost)):
            if lost[i]:
                misfit[i] = 0.0
        step, lacking = _least_squares(pairs, slopes, misfit, metric)
        length = 0.0
        for p in step:
            length = max(length, math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]))
        if math.isnan(length):
            return False
        _combine(min(1.0, D / 16 / max(length, 1e-300)), step, 1.0, shift)
        ratio = length / min(last, 1e-3 * D)
        last = length
        if length * max(ratio * ratio, lacking) < CONVERGED * D:
            for q in range(m):
                p = step[pairs[1, q]]
                for a in range(k):
                    values[q, a] += slopes[q, a, 0] * p[0] + slopes[q, a, 1] * p[1] + slopes[q, a, 2] * p[2]
            return True
    return False


@compiled
def _least_squares(pairs, A, misfit, metric):
    """Return the step (n, 3), mm, that takes misfits (n, k) off by slopes A (m, k, 3), and the share that it lacks.

    Conjugate gradients for the normal equations.
    """
    n = len(misfit)
    p, x, z, weighed, rest = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3)), misfit.copy(), np.zeros((n, 3))
    _weigh(metric, misfit, weighed)
    _gather(pairs, A, weighed, 1.0, rest)
    scales, moved, own = _own_inverses(pairs, A, metric), np.empty(misfit.shape), np.empty((2, n), pairs.dtype)
    own[:] = np.arange(n)
    first, last, size = 0.0, 1.0, 0.0
    for turn in range(3 * n + STEPS):
        _apply(own, scales, rest, z)
        size = _product(z, rest)
        first = size if turn == 0 else first
        if not size > SOLVED * SOLVED * first:
            break
        _combine(1.0, z, size / last if turn else 0.0, p)
        _apply(pairs, A, p, moved)
        _weigh(metric, moved, weighed)
        share = size / _product(moved, weighed)
        _combine(share, p, 1.0, x)
        _gather(pairs, A, weighed, -share, rest)
        last = size
    return x, math.sqrt(size / first) if first > 0 else 0.0


@compiled
def _apply(pairs, A, p, found):
    """Fill A p (n, k), by pairs, for p (n, 3)."""
    found[:] = 0.0
    for q in range(len(A)):
        i, j = pairs[0, q], pairs[1, q]
        x, y, z = p[j, 0], p[j, 1], p[j, 2]
        for a in range(A.shape[1]):
            found[i, a] += A[q, a, 0] * x + A[q, a, 1] * y + A[q, a, 2] * z


@compiled
def _gather(pairs, A, b, share, found):
    """Add share A'b, by pairs, for b (n, k), to (n, 3)."""
    for q in range(len(A)):
        i, j = pairs[0, q], pairs[1, q]
        for a in range(A.shape[1]):
            weight = share * b[i, a]
            found[j, 0] += A[q, a, 0] * weight
            found[j, 1] += A[q, a, 1] * weight
            found[j, 2] += A[q, a, 2] * weight


@compiled
def _weigh(metric, rows, found):
    """Fill K times rows (n, k)."""
    squares, N, S = metric
    n, k = rows.shape
    for i in range(n):
        for a in range(k):
            found[i, a] = squares[i, a] * rows[i, a]
    if not len(N):
        return
    along, field = np.zeros(3), np.zeros(3)
    for i in range(n):
        for a in range(k):
            for c in range(3):
                along[c] += N[i, a, c] * found[i, a]
    for c in range(3):
        for d in range(3):
            field[c] += S[c, d] * along[d]
    for i in range(n):
        for a in range(k):
            for c in range(3):
                found[i, a] -= squares[i, a] * N[i, a, c] * field[c]


@compiled
def _product(x, y):
    """Return the scalar product of two arrays of rows."""
    total = 0.0
    for i in range(len(x)):
        for a in range(x.shape[1]):
            total += x[i, a] * y[i, a]
    return total


@compiled
def _combine(share, x, kept, y):
    """Turn y (n, 3) into share x + kept y."""
    for i in range(len(x)):
        for c in range(3):
            y[i, c] = share * x[i, c] + kept * y[i, c]


@compiled
def _own_inverses(pairs, A, metric):
    """Return the inverses (n, 3, 3) of the beams' own blocks of A'W^2 A, near a fold those of some larger ones; 0 for
    beams that are held."""
    squares = metric[0]
    found, block, k = np.zeros((*squares.shape[:1], 3, 3)), np.empty((3, 3)), squares.shape[1]
    for q in range(len(A)):
        if pairs[0, q] != pairs[1, q]:
            continue
        block[:] = 0.0
        for a in range(k):
            for c in range(3):
                for d in range(3):
                    block[c, d] += squares[pairs[0, q], a] * A[q, a, c] * A[q, a, d]
        more = 1e-12 * (block[0, 0] + block[1, 1] + block[2, 2])
        bc, eh, dh, ac, de, ab, det = cofactors(
            *(block[0, 0] + more, block[1, 1] + more, block[2, 2] + more),
            *(block[0, 1], block[0, 2], block[1, 2]),
        )
        if det > 0:
            inverse = found[pairs[0, q]]
            inverse[0, 0], inverse[1, 1], inverse[2, 2] = bc / det, ac / det, ab / det
            inverse[0, 1], inverse[0, 2], inverse[1, 2] = eh / det, dh / det, de / det
            inverse[1, 0], inverse[2, 0], inverse[2, 1] = eh / det, dh / det, de / det
    return found
