"""All poses that have one row of readings: starts from a table of cells, a damped Newton iteration from each.

The table. A grid over the workspace divides it into cells. In each cell a linear map from shift to readings is fitted
to the corners, so the image of the cell in the space of readings is a parallelepiped. Several poses can have the same
readings; then several parallelepipeds contain the point of these readings, and each gives one start. Adjacent
parallelepipeds leave gaps and overlap, so each is enlarged by a margin. More than three readings are projected onto
the three directions in which they vary most over the workspace. Where an ambient field is rejected
(`analytic.inverse.ambient_field`), readings and slopes count less what a uniform field explains.

On a fold det J = 0, with J = dB/ds, and two poses merge; close to it a linear map finds neither of them. A cell whose
corners differ in the sign of det J is therefore replaced by its parts, which are cells of their own. A part whose
corners still differ gives one start on each side of the fold: its corner whose readings are nearest. The image of
such a part is flat, so that its box lies along the principal axes of the linear map.

The iteration. With the residual f = w (B(s) - B_read) and A = w dB/ds, a step is p = -(A'A + mu tr(A'A) I)^-1 A'f
(Gauss-Newton for more than three readings). The damping mu follows Levenberg and Marquardt: it is 0 until a step
fails to reduce |f|, grows by a factor of 10 from 1e-3 while steps fail, and falls by a factor of 10 when they
succeed. Newton's method converges quadratically, so the error after a step of length p that follows one of length p'
is about p (p/p')^2. The iteration ends where this estimate is below 1e-10 D.

Two rules end iterations that would lead nowhere. A start stands for the poses near it, since every other pose has a
start of its own: an iteration that moves farther than 2.5 cell diagonals from its start ends. So does one whose
misfit does not fall to 0.8 of its size in six evaluations, as next to a minimum of the misfit that is no pose.
"""

import math
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import Forward, read, readings_with_slopes
from geometry.arrays import Array, Ints
from geometry.compiled import compiled

MARGIN = 0.2
"""Margin by which a cell is enlarged on every side, in units of its edges: it closes the gaps between linear maps."""
FOLD_MARGIN = 1.0
"""The same for the readings of a folded part, over the range of its corners: the fold bulges beyond them."""
PARTS = 3
"""Number of parts of a folded cell along each edge."""
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
"""Corners of a unit cell, shape (8, 3)."""
SAME = 1e-6
"""Distance below which two poses count as one, over D: far above the error of a converged pose."""
SHORT = 1e-7
"""Length of a step, over D, so short that rounding decides whether the misfit falls. A damped step that is as short
has met a minimum of the misfit above 0."""
LOST, MISFIT, POSE = range(3)
"""Ends of an iteration: no convergence, a pose that does not fit the readings, a pose that does."""
Status = Literal["ok", "ambiguous", "out_of_workspace", "saturated", "not_finite", "inconsistent"]
STATUSES: tuple[Status, ...] = get_args(Status)


class StartTable(NamedTuple):
    """n cells that give starts: those of the grid without a fold, then the parts of the folded ones.

    Attributes
    ----------
    basis : projection of k readings onto three numbers, shape (3, k).
    low, high : bounding boxes of the projected readings, enlarged by the margin, shape (n, 3), T.
    maps : inverse linear maps of the cells, shape (n, 3, 4). The readings r lie at
        maps[:, :, :3] @ r + maps[:, :, 3], measured from the cell's centre in units of its edges; for a folded part,
        in units of the box of its readings along their principal axes.
    sign : sign of det J at all corners of a cell, shape (n,); 0 for a folded part.
    centre, edge : centres and edges of the cells, shape (n, 3), mm.
    corners, corner_sign : where the readings at the corners of the m folded parts, the last cells, lie in their
        boxes, shape (m, 8, 3), and sign of det J there, shape (m, 8).
    """

    basis: Array
    low: Array
    high: Array
    maps: Array
    sign: Ints
    centre: Array
    edge: Array
    corners: Array
    corner_sign: Ints


class Goal(NamedTuple):
    """What a pose must fit, and where: k readings.

    Attributes
    ----------
    low, high : corners of the box in which it must lie, shape (3,), mm.
    floor, roof : corners of the box in which the iteration moves, shape (3,), mm: the way to a pose inside may lead
        through shifts a little outside.
    weights : of the readings in the misfit, shape (k,).
    tolerance : largest misfit of each reading if there are more than three, shape (k,), T.
    reach : farthest that the iteration moves from a start of the table, mm.
    D : diameter of the beam, the unit of lengths, mm.
    rails : fields at which each element's output lies at its lower and at its upper rail, shape (k, 2), T.
    free : M of `analytic.inverse.ambient_field`, shape (k, k); empty where no ambient field is rejected.
    """

    low: Array
    high: Array
    floor: Array
    roof: Array
    weights: Array
    tolerance: Array
    reach: float
    D: float
    rails: Array
    free: Array


def start_table(
    forward: Forward, low: Array, high: Array, counts: tuple[int, int, int], free: Array
) -> tuple[StartTable, Array]:
    """Return the table over a box of shifts, and the range of each element's readings over its grid, shape (k,), T.

    Parameters
    ----------
    low, high : of the box, shape (3,), mm.
    counts : number of cells along x, y and z.
    free : as in `Goal`; the range is then that of what it leaves of the readings.

    Raises
    ------
    BadInput
        The field is not defined at a point of the grid.
    """
    edge = (high - low) / counts
    readings, slopes = readings_with_slopes(forward, (low + edge * _nodes(counts)).T.copy())
    basis, told = np.eye(3), free @ readings if len(free) else readings
    if len(readings) > 3:
        spread = told - told.mean(axis=1, keepdims=True)
        basis = np.linalg.svd(spread @ spread.T)[0].T[:3].copy()
    if len(free):
        basis = basis @ free
    corners, sign, centre = _cells(basis, readings, slopes, low[None], edge, counts)
    folded = (sign != sign[:, :1]).any(axis=1)
    first, fine = centre[folded] - edge / 2, edge / PARTS
    shifts = (first[:, None] + fine * _nodes((PARTS,) * 3)).reshape(-1, 3)
    parts = _cells(basis, *readings_with_slopes(forward, shifts.T.copy()), first, fine, (PARTS,) * 3)
    edges = np.repeat([edge, fine], [(~folded).sum(), len(parts[0])], axis=0)
    # the parts that are still folded come last
    alike = np.concatenate([np.full((~folded).sum(), True), (parts[1] == parts[1][:, :1]).all(axis=1)])
    order = np.argsort(~alike, kind="stable")
    corners, sign, centre = (
        np.concatenate([values[~folded], part])[order]
        for values, part in zip((corners, sign, centre), parts, strict=True)
    )
    alike, edges = alike[order], edges[order]
    maps = _maps(corners, alike)
    least, most = corners.min(axis=1), corners.max(axis=1)
    reach = np.where(alike, MARGIN, FOLD_MARGIN)[:, None] * (most - least)
    table = StartTable(
        basis=basis,
        low=least - reach,
        high=most + reach,
        maps=maps,
        sign=sign[:, 0] * alike,
        centre=centre,
        edge=edges,
        corners=np.einsum("mij,mcj->mci", maps[~alike, :, :3], corners[~alike]) + maps[~alike, None, :, 3],
        corner_sign=sign[~alike],
    )
    return table, np.ptp(told, axis=1)


def _nodes(counts: tuple[int, ...]) -> Array:
    """Return the nodes of a grid of unit cells, shape (m, 3)."""
    return np.indices([n + 1 for n in counts]).reshape(3, -1).T.astype(np.float64)


def _cells(
    basis: Array, readings: Array, slopes: Array, low: Array, edge: Array, counts: tuple[int, ...]
) -> tuple[Array, Ints, Array]:
    """Return projected readings (n, 8, 3) and signs of det J (n, 8) at corners of cells, and centres (n, 3).

    low, edge : corners of least x, y, z of equal grids, shape (g, 3), and edges of their cells, shape (3,), mm;
        readings and slopes at all nodes of all grids follow each other.
    """
    cells, nodes = np.indices(counts).reshape(3, -1).T, [n + 1 for n in counts]
    corner = np.ravel_multi_index(tuple((cells[:, None] + CORNERS).T), nodes).T
    signs = np.sign(np.linalg.det(np.einsum("ik,jkn->nij", basis, slopes))).astype(np.int64)
    at = (basis @ readings).T.reshape(len(low), math.prod(nodes), 3)[:, corner]
    centre = low[:, None] + edge * (cells + 0.5)
    return (
        at.reshape(-1, 8, 3),
        signs.reshape(len(low), math.prod(nodes))[:, corner].reshape(-1, 8),
        centre.reshape(-1, 3),
    )


def _maps(corners: Array, alike: NDArray[np.bool_]) -> Array:
    """Return `StartTable.maps` from the readings at the corners, (n, 8, 3); `alike` are the signs of det J, (n,)."""
    middle = corners.mean(axis=1)
    # the linear map that fits the corners best: its slope along an edge is the mean difference
    linear = np.einsum("ncr,cj->nrj", corners, (2 * CORNERS - 1) / 4)
    inverse = np.empty_like(linear)
    inverse[alike] = np.linalg.inv(linear[alike])
    # beside a fold the image is flat: its box lies along the principal axes of the linear map
    axes = np.linalg.svd(linear[~alike])[0]
    along = (corners[~alike] - middle[~alike, None]) @ axes
    least, most = along.min(axis=1), along.max(axis=1)
    middle[~alike] += np.einsum("nij,nj->ni", axes, (least + most) / 2)
    inverse[~alike] = np.swapaxes(axes, 1, 2) / (most - least)[:, :, None]
    return np.concatenate([inverse, -inverse @ middle[..., None]], axis=2)


def poses_of(field: Array, forward: Forward, table: StartTable, goal: Goal) -> tuple[Status, Array, Array]:
    """Return the status of one row of readings, and shifts (n, 3), mm, and slopes (n, k, 3), T/mm, of all its poses.

    field : B.n of each element, or |B|, shape (k,), T.
    """
    status, shifts, slopes = search(field, forward.kernel, table, goal)
    return STATUSES[status], shifts, slopes


@compiled
def search(field, kernel, table, goal):
    """Return what `poses_of` does; the status is its place in `STATUSES`."""
    shifts, slopes, count = np.empty((0, 3)), np.empty((0, len(field), 3)), 0
    saturated = False
    for k in range(len(field)):
        if not math.isfinite(field[k]):
            return 4, shifts, slopes
        saturated = saturated or not goal.rails[k, 0] < field[k] < goal.rails[k, 1]
    if saturated:
        return 3, shifts, slopes
    starts = starts_of(field, table)
    shifts, slopes = np.empty((len(starts), 3)), np.empty((len(starts), len(field), 3))
    misfit, start = False, np.empty(3)
    for _, _, x, y, z in starts:
        start[0], start[1], start[2] = x, y, z
        end, s, A = newton(start, goal.reach, field, kernel, goal)
        inside, known = end != LOST, False
        for j in range(3):
            inside = inside and goal.low[j] <= s[0, j] <= goal.high[j]
        misfit = misfit or (inside and end == MISFIT)
        for i in range(count):
            apart = 0.0
            for j in range(3):
                apart = max(apart, abs(shifts[i, j] - s[0, j]))
            known = known or apart < SAME * goal.D
        if inside and end == POSE and not known:
            shifts[count], slopes[count] = s[0], A[0]
            count += 1
    status = 0 if count == 1 else 1 if count else 5 if misfit else 2
    return status, shifts[:count], slopes[:count]


@compiled
def starts_of(field, table):
    """Return the starts for one row of readings: of each how far off the centre, sign of det J and shift, mm."""
    basis, low, high, maps, sign, centre, edge, corners, corner_sign = table
    r, u, folded = np.zeros(3), np.zeros(3), len(low) - len(corners)
    for i in range(3):
        for j in range(len(field)):
            r[i] += basis[i, j] * field[j]
    starts = [(0.0, 0, 0.0, 0.0, 0.0) for _ in range(0)]
    for cell in range(len(low)):
        # without a branch (`and`), which would take ten times as long: whether a box holds r is hard to predict
        beside = (r[0] < low[cell, 0]) | (high[cell, 0] < r[0]) | (r[1] < low[cell, 1]) | (high[cell, 1] < r[1])
        if beside | (r[2] < low[cell, 2]) | (high[cell, 2] < r[2]):
            continue
        c, e, side = centre[cell], edge[cell], sign[cell]
        # starts with the same sign of det J that are closer than this lead to the same pose
        apart = 0.8 * math.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        for i in range(3):
            row = maps[cell, i]
            u[i] = row[0] * r[0] + row[1] * r[1] + row[2] * r[2] + row[3]
        far = max(abs(u[0]), abs(u[1]), abs(u[2]))
        if cell < folded and far <= 0.5 + MARGIN:
            add_start(starts, far, side, c[0] + u[0] * e[0], c[1] + u[1] * e[1], c[2] + u[2] * e[2], apart)
        elif cell >= folded and far <= 0.5 + FOLD_MARGIN:
            for side in (-1, 1):
                near, best = math.inf, -1
                for corner in range(8):
                    p = corners[cell - folded, corner]
                    d = max(abs(p[0] - u[0]), abs(p[1] - u[1]), abs(p[2] - u[2]))
                    if corner_sign[cell - folded, corner] == side and d < near:
                        near, best = d, corner
                if best >= 0:
                    x, y, z = best // 4 - 0.5, best // 2 % 2 - 0.5, best % 2 - 0.5
                    # farther than any place in a cell
                    add_start(starts, 1 + near, side, c[0] + x * e[0], c[1] + y * e[1], c[2] + z * e[2], apart)
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
def newton(start, reach, field, kernel, goal):
    """Iterate from a start (3,), no farther than `reach`, mm.

    Return how this ends (LOST, MISFIT or POSE), the shift there, shape (1, 3), mm, and its slopes (1, k, 3), T/mm.
    """
    k = len(field)
    s, trial, f, g, A, B = (
        *(np.empty((1, 3)), np.empty((1, 3)), np.empty((1, k)), np.empty((1, k))),
        *(np.empty((1, k, 3)), np.empty((1, k, 3))),
    )
    for j in range(3):
        s[0, j] = min(max(start[j], goal.floor[j]), goal.roof[j])
    mu, last = 0.0, math.inf
    size = misfit_of(s, field, kernel, goal, f, A)
    # those of the last six evaluations; near a double root, the slowest case, each full step brings it to a quarter
    sizes = np.full(6, size)
    # the estimated error at which the iteration ends: far below `SAME`, far above rounding
    short, exact = SHORT * goal.D, 1e-10 * goal.D
    for turn in range(40):
        p = step(f[0], A[0], goal.weights, mu)
        length = math.sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        error = length * (length / min(last, 1e-3 * goal.D)) ** 2
        # a damped step is short because of its damping, which says nothing of the error
        if size == 0 or (mu == 0 and (length < 1e-3 * exact or (last < math.inf and error < exact))):
            for j in range(3):
                s[0, j] += p[j]
            misfit_of(s, field, kernel, goal, f, A)
            return POSE if fits(f[0], A[0], goal) else MISFIT, s, A
        if not size < math.inf or (mu > 0 and length < short):
            break
        if turn >= len(sizes) and size > 0.8**2 * sizes[turn % len(sizes)] and length >= short:
            break
        sizes[turn % len(sizes)] = size
        if (s[0, 0] - start[0]) ** 2 + (s[0, 1] - start[1]) ** 2 + (s[0, 2] - start[2]) ** 2 > reach * reach:
            break
        # close to a fold, undamped steps are far too long
        share = min(1.0, goal.D / 16 / length) if length > 0 else 1.0
        for j in range(3):
            trial[0, j] = min(max(s[0, j] + share * p[j], goal.floor[j]), goal.roof[j])
        size_there = misfit_of(trial, field, kernel, goal, g, B)
        if size_there < size or (length < short and size_there <= 4 * size + 1e-30):
            s, trial, f, g, A, B = trial, s, g, f, B, A
            size, last = size_there, length
            mu = mu / 10 if mu > 1e-4 else 0.0
        else:
            mu = max(10 * mu, 1e-3)
    return LOST, s, A


@compiled
def misfit_of(shift, field, kernel, goal, f, A):
    """Fill f and A with the misfit, T, and slopes, T/mm, at a shift (1, 3); return the sum of weighted squares.

    It is infinite where the field is not defined.
    """
    read(shift, kernel, f, A)
    total = 0.0
    for i in range(len(field)):
        f[0, i] -= field[i]
    if len(goal.free):
        take_field_off(goal.free, f[0], A[0])
    for i in range(len(field)):
        total += (goal.weights[i] * f[0, i]) ** 2
    return math.inf if math.isnan(total) else total


@compiled
def take_field_off(free, f, A):
    """Take off a misfit (k,) and its slopes (k, 3) what a uniform field explains."""
    whole, slopes = f.copy(), A.copy()
    f[:], A[:] = 0.0, 0.0
    for i in range(len(f)):
        for k in range(len(f)):
            f[i] += free[i, k] * whole[k]
            for j in range(3):
                A[i, j] += free[i, k] * slopes[k, j]


@compiled
def fits(f, A, goal):
    """Return whether the misfit f, T, at a pose with the slopes A, T/mm, is within its bounds.

    Three readings determine a pose exactly, up to the distance `SHORT`.
    """
    size, norm, good = 0.0, 0.0, True
    for i in range(len(f)):
        size += f[i] * f[i]
        norm += A[i, 0] * A[i, 0] + A[i, 1] * A[i, 1] + A[i, 2] * A[i, 2]
        good = good and abs(f[i]) <= goal.tolerance[i]
    return math.sqrt(size) <= SHORT * goal.D * math.sqrt(norm) if len(f) == 3 else good


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
    bc, eh, dh, ac, de, ab, det = cofactors(a, b, c, d, e, h)
    if not det > 0:
        return 0.0, 0.0, 0.0
    return (
        -(bc * p + eh * q + dh * r) / det,
        -(eh * p + ac * q + de * r) / det,
        -(dh * p + de * q + ab * r) / det,
    )


@compiled
def cofactors(a, b, c, d, e, h):
    """Return the cofactors of the symmetric matrix [[a, d, e], [d, b, h], [e, h, c]], those from the diagonal on row
    by row, and its determinant."""
    bc, eh, dh = b * c - h * h, e * h - c * d, d * h - b * e
    return bc, eh, dh, a * c - e * e, d * e - a * h, a * b - d * d, a * bc + d * eh + e * dh
