"""All poses whose readings may be those asked for: the workspace as a table of cells in the space of readings.

A grid over the workspace makes cells. On each, the readings are taken as linear (fitted to its corners), so that it
is a parallelepiped in the space of readings; the cells that contain a point of it are the sheets of the map there,
one for each pose that reads alike, up to the error of the grid. The table has bins of the space of readings, each
with the cells whose bounding boxes meet it. More than three readings are projected onto the three directions in which
they vary most over the workspace.

The linear maps leave gaps and overlap, so cells are taken with a margin; starts on the same side of the folds (the
sign of det of the slopes) and near each other lead to the same pose, and the innermost is kept. It is then bent: with
u the place by the linear map and v the true one, both in edges of the cell, u = v + q(v), q the cubic polynomial that
fits readings and slopes at the corners best, and v = u - q(v) is iterated from v = u. That leaves some 1e-5 mm, so
one step of Newton's mostly suffices.

Close to a fold two poses merge, and a linear map misses both: a cell whose corners do not agree in that sign is taken
as a box along the principal axes of its linear map, half as large again, and searched from both sides of its fold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints

MARGIN = 0.2
"""How far outside a cell, in its edges, a point is still taken as in it."""
BINS = 32
"""Along each direction of the space of readings, as many readings of the grid in each."""
APART = 1.2
"""Starts on the same side of the folds and closer than this many cells lead to the same pose."""
CORRECTIONS = 3
"""Iterations for the true place in a cell."""
STEEP = 1e9
"""Curvature where it is not known, 1/mm."""


@dataclass(frozen=True, slots=True, eq=False)
class StartTable:
    """The table.

    Attributes
    ----------
    basis : projection of k readings on three numbers, shape (3, k).
    edges : of the bins, shape (3, BINS - 1).
    first, members : the cells of bin b are members[first[b]:first[b + 1]].
    low, high : bounding boxes of the cells, widened by the margin, shape (3, n), T.
    maps : a point r is at maps[i, :, :3] @ r + maps[i, :, 3] along i in the cells, in edges of the cell (of the box)
        from its centre, shape (3, n, 4).
    bends : coefficients of q by `monomials`, shape (3, 20, n); 0 where iterating would not converge.
    curvature : upper bound of |J^-1 d2B/ds2| / 2 in a cell, 1/mm: a Newton step of length p leaves an error of at
        most curvature p^2; `STEEP` where it is not known.
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
    bin_edges: Array
    first: Ints
    members: NDArray[np.int32]
    low: Array
    high: Array
    maps: Array
    correction: Array
    curvature: Array
    centre: Array
    cell_sign: NDArray[np.int8]
    corners: Ints
    grid: Array
    grid_sign: Array
    readings: Array
    cell_size: Array
    span: Array


def starts(table: StartTable, readings: Array) -> tuple[Ints, Array, Array]:
    """Where to begin.

    Parameters
    ----------
    readings : shape (k, n), T.

    Returns
    -------
    owner : number of the reading of each start, in order.
    shift : shape (3, m), mm.
    curvature : as `StartTable.curvature`, of each start.
    """
    r = table.basis @ readings
    owner, cell, u = cells_containing(table, r, *_candidates(table, r))
    outside = np.abs(u).max(axis=0)
    turn = table.cell_sign[cell]
    folded = turn == 0
    hit = np.flatnonzero(~folded)
    at = table.centre[cell[hit]] + u[:, hit].T * table.cell_size
    kept = _distinct(
        owner[hit], turn[hit].astype(np.int64), outside[hit], at, APART * float(np.linalg.norm(table.cell_size))
    )
    hit = hit[kept]
    owners, curvature = owner[hit], table.curvature[cell[hit]]
    ats = corrected_shifts(table, cell[hit], u[:, hit])
    if folded.any():
        more, beside = _both_sides(table, owner[folded], cell[folded], r.T[owner[folded]])
        owners, ats = np.concatenate([owners, more]), np.concatenate([ats, beside.T], axis=1)
        curvature = np.concatenate([curvature, np.full(len(more), STEEP)])
        order = np.argsort(owners, kind="stable")
        owners, ats, curvature = owners[order], ats[:, order], curvature[order]
    return owners, np.ascontiguousarray(ats), curvature


def cells_containing(table: StartTable, r: Array, owner: Ints, cell: Ints) -> tuple[Ints, Ints, Array]:
    """Those of the candidates in which the points r (3, n) lie, and the places by the linear maps, shape (3, m)."""
    places: list[Array] = []
    point = r[:, owner]
    # most candidates fail at the first axis
    for rows in table.maps:
        row = rows[cell]
        u = row[:, 0] * point[0] + row[:, 1] * point[1] + row[:, 2] * point[2] + row[:, 3]
        within = np.flatnonzero(np.abs(u) <= 0.5 + MARGIN)
        owner, cell, point = owner[within], cell[within], point[:, within]
        places = [*(v[within] for v in places), u[within]]
    inside = ((point >= table.low[:, cell]) & (point <= table.high[:, cell])).all(axis=0)
    return owner[inside], cell[inside], np.stack(places)[:, inside]


def corrected_shifts(table: StartTable, cell: Ints, u: Array) -> Array:
    """Shifts (3, n), mm, from places u (3, n) in cells by their linear maps."""
    q, v = table.correction[:, :, cell], u
    for _ in range(CORRECTIONS):
        v = u - np.einsum("ipn,pn->in", q, np.array(monomials(*v)))
    return np.asarray(table.centre[cell].T + v * table.cell_size[:, None])


def monomials(x: Any, y: Any, z: Any) -> list[Any]:
    """Of degree 0 to 3, of numbers or arrays, in the order of `analytic.inverse.start_table_construction.NORMS`."""
    xx, yy, zz = x * x, y * y, z * z
    squares = [xx, x * y, x * z, yy, y * z, zz]
    cubes = [xx * x, xx * y, xx * z, x * yy, squares[1] * z, x * zz, yy * y, yy * z, y * zz, zz * z]
    return [1.0 + 0.0 * x, x, y, z, *squares, *cubes]


def _both_sides(table: StartTable, owner: Ints, cell: Ints, point: Array) -> tuple[Ints, Array]:
    """The corners of folded cells on either side of the fold that read most like the point."""
    corners = table.corners[cell]
    size = (table.high - table.low)[:, cell].T
    far = (np.abs(table.readings[corners] - point[:, None]) / size[:, None]).max(axis=2)
    owners, ats = [], []
    for sign in (-1, 1):
        there = np.where(table.grid_sign[corners] == sign, far, np.inf)
        best = there.argmin(axis=1)
        some = np.isfinite(there[np.arange(len(best)), best])
        owners.append(owner[some])
        ats.append(table.grid[corners[some, best[some]]])
    return np.concatenate(owners), np.concatenate(ats)


def _candidates(table: StartTable, r: Array) -> tuple[Ints, Ints]:
    """Number of the reading and cell, for each cell in the bins of the readings (3, n)."""
    index = np.zeros(r.shape[1], dtype=np.int64)
    for edges, values in zip(table.bin_edges, r, strict=True):
        index = index * BINS + np.searchsorted(edges, values)
    begin = table.first[index]
    many = table.first[index + 1] - begin
    owner = np.repeat(np.arange(len(many)), many)
    place = np.arange(len(owner)) + np.repeat(begin - (np.cumsum(many) - many), many)
    return owner, table.members[place].astype(np.int64)


def _distinct(owner: Ints, turn: Ints, outside: Array, at: Array, apart: float) -> Ints:
    """Indices of the starts to keep: for each reading and side of the folds the innermost, and those far from it."""
    group = 3 * owner + turn
    # outside is below 1
    order = np.argsort(group + outside, kind="stable")
    head = np.diff(group[order], prepend=-2) != 0
    best = at[order][np.flatnonzero(head)[np.cumsum(head) - 1]]
    far = ((at[order] - best) ** 2).sum(axis=1) > apart**2
    return np.asarray(order[head | far], dtype=np.int64)
