"""All poses whose readings may be those asked for: the workspace as a table of cells in the space of readings.

A grid over the workspace makes cells. On each, the readings are taken as linear (fitted to its corners), so that it
is a parallelepiped in the space of readings; the cells that contain a point of it are the sheets of the map there,
one for each pose that reads alike, up to the error of the grid. The table has bins of the space of readings, each
with the cells whose bounding boxes meet it. More than three readings are projected onto the three directions in which
they vary most over the workspace.

The linear maps leave gaps and overlap, so cells are taken with a margin; starts on the same side of the folds (the
sign of det of the slopes) and near each other lead to the same pose, and the innermost is kept. Close to a fold two
poses merge, and a linear map misses both: a cell whose corners do not agree in that sign is taken as a box along the
principal axes of its linear map, half as large again, and searched from both sides of its fold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.forward import Forward, seen

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MARGIN = 0.2
"""How far outside a cell, in its edges, a point is still taken as in it."""
BINS = 32
"""Along each direction of the space of readings, as many readings of the grid in each."""
APART = 1.2
"""Starts on the same side of the folds and closer than this many cells lead to the same pose."""
BOX = 1.5
"""Size of the box of a cell with a fold, over that of its corners."""
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


@dataclass(frozen=True, slots=True, eq=False)
class Sheets:
    """The table.

    Attributes
    ----------
    basis : projection of k readings on three numbers, shape (3, k).
    edges : of the bins, shape (3, BINS - 1).
    first, members : the cells of bin b are members[first[b]:first[b + 1]].
    low, high : bounding boxes of the cells, widened by the margin, shape (n, 3), T.
    middle, inverse : a point r is at inverse @ (r - middle) in a cell, in edges of the cell (of the box) from its
        centre.
    centre : of the cells, shape (n, 3), mm.
    turn : sign of the determinant, 0 where the corners do not agree.
    corners : of the cells with turn 0, numbers of the grid's points, by number of the cell, shape (n, 8).
    grid : the grid's shifts, shape (n, 3), mm.
    side : sign of the determinant at the grid's points.
    readings : at the grid's points, projected, shape (n, 3), T.
    edge : of a cell, shape (3,), mm.
    span : of each element's readings over the grid, shape (k,), T.
    """

    basis: Array
    edges: Array
    first: Ints
    members: NDArray[np.int32]
    low: Array
    high: Array
    middle: Array
    inverse: Array
    centre: Array
    turn: NDArray[np.int8]
    corners: Ints
    grid: Array
    side: Array
    readings: Array
    edge: Array
    span: Array


def build(forward: Forward, low: Array, high: Array, counts: tuple[int, int, int]) -> Sheets:
    """The table over a box of shifts, with so many cells along each axis.

    Raises
    ------
    BadInput
        The field is not defined at a point of the grid.
    """
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    readings = np.empty((len(forward.elements), grid.shape[1]))
    slopes = np.empty((3, *readings.shape))
    for start in range(0, grid.shape[1], 4096):
        part = slice(start, start + 4096)
        readings[:, part], slopes[:, :, part] = seen(forward, np.ascontiguousarray(grid[:, part]))
    basis = np.eye(3)
    if len(readings) > 3:
        spread = readings - readings.mean(axis=1, keepdims=True)
        basis = np.linalg.svd(spread @ spread.T)[0].T[:3]
    r = (basis @ readings).T
    side = np.sign(np.linalg.det(np.einsum("ik,jkn->nij", basis, slopes)))
    corners = _corners(counts)
    ends, sides = r[corners], side[corners]
    # the linear map that fits the corners best: its slope along an edge is the mean difference
    linear = np.einsum("ncr,cj->nrj", ends, (2 * CORNERS - 1) / 4)
    turn = np.where((sides == sides[:, :1]).all(axis=1), sides[:, 0], 0).astype(np.int8)
    middle, inverse = _maps(linear, ends, turn == 0)
    least, most = ends.min(axis=1), ends.max(axis=1)
    reach = MARGIN * (most - least)
    least, most = least - reach, most + reach
    edges = np.quantile(r, np.arange(1, BINS) / BINS, axis=0).T
    first, members = _binned(edges, least, most)
    return Sheets(
        basis=basis,
        edges=np.ascontiguousarray(edges),
        first=first,
        members=members,
        low=least,
        high=most,
        middle=middle,
        inverse=inverse,
        centre=grid.T[corners].mean(axis=1),
        turn=turn,
        corners=corners,
        grid=np.ascontiguousarray(grid.T),
        side=side,
        readings=r,
        edge=(high - low) / counts,
        span=np.ptp(readings, axis=1),
    )


def starts(table: Sheets, readings: Array) -> tuple[Ints, Array]:
    """Where to begin: the number of the reading of each start, in order, and the start's shift, shape (3, n), mm.

    Parameters
    ----------
    readings : shape (k, n), T.
    """
    r = (table.basis @ readings).T
    owner, cell = _candidates(table, r)
    point = r[owner]
    within = ((point >= table.low[cell]) & (point <= table.high[cell])).all(axis=1)
    owner, cell, point = owner[within], cell[within], point[within]
    place = np.matmul(table.inverse[cell], (point - table.middle[cell])[:, :, None])[:, :, 0]
    outside = np.abs(place).max(axis=1)
    turn = table.turn[cell]
    folded = turn == 0
    inside = outside <= 0.5 + MARGIN
    hit, folded = inside & ~folded, inside & folded
    at = table.centre[cell[hit]] + place[hit] * table.edge
    kept = _distinct(
        owner[hit], turn[hit].astype(np.int64), outside[hit], at, APART * float(np.linalg.norm(table.edge))
    )
    owners, ats = owner[hit][kept], at[kept]
    if folded.any():
        more, beside = _both_sides(table, owner[folded], cell[folded], point[folded])
        owners, ats = np.concatenate([owners, more]), np.concatenate([ats, beside])
        order = np.argsort(owners, kind="stable")
        owners, ats = owners[order], ats[order]
    return owners, np.ascontiguousarray(ats.T)


def _both_sides(table: Sheets, owner: Ints, cell: Ints, point: Array) -> tuple[Ints, Array]:
    """The corners of folded cells on either side of the fold that read most like the point."""
    corners = table.corners[cell]
    far = (np.abs(table.readings[corners] - point[:, None]) / (table.high - table.low)[cell][:, None]).max(axis=2)
    owners, ats = [], []
    for sign in (-1, 1):
        there = np.where(table.side[corners] == sign, far, np.inf)
        best = there.argmin(axis=1)
        some = np.isfinite(there[np.arange(len(best)), best])
        owners.append(owner[some])
        ats.append(table.grid[corners[some, best[some]]])
    return np.concatenate(owners), np.concatenate(ats)


def _candidates(table: Sheets, r: Array) -> tuple[Ints, Ints]:
    """Number of the reading and cell, for each cell in the bins of the readings."""
    index = np.zeros(len(r), dtype=np.int64)
    for k in range(3):
        index = index * BINS + np.searchsorted(table.edges[k], r[:, k])
    begin = table.first[index]
    many = table.first[index + 1] - begin
    owner = np.repeat(np.arange(len(r)), many)
    place = np.arange(len(owner)) + np.repeat(begin - (np.cumsum(many) - many), many)
    return owner, table.members[place].astype(np.int64)


def _distinct(owner: Ints, turn: Ints, outside: Array, at: Array, apart: float) -> Ints:
    """Indices of the starts to keep: for each reading and side of the folds the innermost, and those far from it."""
    group = 3 * owner + turn
    order = np.lexsort((outside, group))
    head = np.diff(group[order], prepend=-2) != 0
    best = at[order][np.flatnonzero(head)[np.cumsum(head) - 1]]
    far = ((at[order] - best) ** 2).sum(axis=1) > apart**2
    return np.asarray(order[head | far], dtype=np.int64)


def _corners(counts: tuple[int, int, int]) -> Ints:
    """Numbers of the grid's points at the corners of each cell, shape (n, 8)."""
    shape = [n + 1 for n in counts]
    number = np.arange(np.prod(shape)).reshape(shape)
    step = CORNERS @ [shape[1] * shape[2], shape[2], 1]
    return np.asarray(number[:-1, :-1, :-1].reshape(-1, 1) + step, dtype=np.int64)


def _maps(linear: Array, ends: Array, folded: NDArray[np.bool_]) -> tuple[Array, Array]:
    """`Sheets.middle` and `Sheets.inverse` of the cells."""
    middle = ends.mean(axis=1)
    matrices = linear.copy()
    matrices[folded] = np.eye(3)
    inverse = np.linalg.inv(matrices)
    axes = np.linalg.svd(linear[folded])[0]
    along = np.matmul(ends[folded], axes)
    least, most = along.min(axis=1), along.max(axis=1)
    size = BOX * (most - least)
    middle[folded] = np.matmul(axes, ((least + most) / 2)[:, :, None])[:, :, 0]
    inverse[folded] = np.swapaxes(axes, 1, 2) / np.maximum(size, 1e-12 * size.max(axis=1, keepdims=True))[:, :, None]
    return np.asarray(middle, dtype=np.float64), np.asarray(inverse, dtype=np.float64)


def _binned(edges: Array, low: Array, high: Array) -> tuple[Ints, NDArray[np.int32]]:
    """For each bin the boxes that meet it, as `Sheets.first` and `members`."""
    begin = np.stack([np.searchsorted(edges[k], low[:, k]) for k in range(3)])
    end = np.stack([np.searchsorted(edges[k], high[:, k]) for k in range(3)])
    span = end - begin + 1
    many = span.prod(axis=0)
    box = np.repeat(np.arange(len(low)), many)
    rest = np.arange(len(box)) - np.repeat(np.cumsum(many) - many, many)
    k = begin[2, box] + rest % span[2, box]
    rest //= span[2, box]
    j = begin[1, box] + rest % span[1, box]
    i = begin[0, box] + rest // span[1, box]
    index = (i * BINS + j) * BINS + k
    order = np.argsort(index, kind="stable")
    first = np.searchsorted(index[order], np.arange(BINS**3 + 1))
    return first.astype(np.int64), box[order].astype(np.int32)
