"""Start poses for the decoder's iteration: a table of the workspace's cells, ordered by their readings.

A grid over the workspace divides it into cells. In each cell a linear map from shift to readings is fitted to the
corners, so the image of the cell in the space of readings is a parallelepiped. Several poses can have the same
readings; then several parallelepipeds contain the point of these readings, and each gives one start. To find them
quickly, the space of readings is divided into bins, and each bin lists the cells whose images may intersect it. More
than three readings are projected onto the three directions in which they vary most over the workspace.

Adjacent parallelepipeds leave gaps and overlap, so each cell is enlarged by a margin. Starts that lie near each
other, and have the same sign of det J with J = dB/ds, lead to the same pose; only the one nearest to the centre of
its cell is kept. This start is then corrected: with u the position in the cell by the linear map and v the true one,
both in units of the cell's edges, u = v + q(v), where q is the cubic polynomial that fits readings and slopes at the
corners best. The fixed-point iteration v = u - q(v) begins at v = u. It leaves an error of about 1e-5 mm, so that one
Newton step mostly suffices.

On a fold det J = 0 and two poses merge; close to it a linear map finds neither of them. A cell whose corners differ
in the sign of det J therefore gets a box along the principal axes of its linear map, larger by half, and one start
on each side of the fold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints

MARGIN = 0.2
"""Margin by which a cell is enlarged on every side, in units of its edges: it closes the gaps between linear maps."""
BINS = 32
"""Number of bins along each direction of the space of readings; each holds the same share of the grid's readings."""
APART = 1.2
"""Starts with the same sign of det J and closer than this many cell diagonals lead to the same pose."""
CORRECTIONS = 3
"""Number of iterations of v = u - q(v), which corrects the position in a cell."""
STEEP = 1e9
"""Curvature of a cell without a bound, 1/mm: only a first Newton step below 1e-9 mm then ends the iteration."""


@dataclass(frozen=True, slots=True, eq=False)
class StartTable:
    """Cells of the workspace and bins of readings; n cells, p grid points, k elements.

    Attributes
    ----------
    basis : projection of k readings onto three numbers, shape (3, k).
    bin_edges : inner edges of the bins along each projected reading, shape (3, BINS - 1), T.
    first, members : the cells of bin b are members[first[b]:first[b + 1]].
    low, high : bounding boxes of the cells' projected readings, enlarged by the margin, shape (3, n), T.
    maps : inverse linear maps of the cells, shape (3, n, 4). The readings r lie at maps[i, :, :3] @ r + maps[i, :, 3]
        along axis i, measured from the cell's centre in units of its edges (for a folded cell: of its box).
    correction : coefficients of q in the order of `monomials`, shape (3, 20, n); 0 where the iteration need not
        converge.
    curvature : upper bound of |J^-1 d2B/ds2| / 2 in a cell, 1/mm: a Newton step of length p leaves an error of at
        most curvature p^2; `STEEP` where it is not known.
    centre : centres of the cells, shape (n, 3), mm.
    cell_sign : sign of det J at the corners of each cell, shape (n,); 0 (folded) where the corners differ.
    corners : indices of the grid points at the corners of each cell, shape (n, 8).
    grid : shifts of the grid points, shape (p, 3), mm.
    grid_sign : sign of det J at the grid points, shape (p,).
    readings : projected readings at the grid points, shape (p, 3), T.
    cell_size : edges of a cell, shape (3,), mm.
    span : range of each element's readings over the grid, shape (k,), T.
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
    """Return the starts of the iteration for rows of readings.

    Parameters
    ----------
    readings : B.n of k elements, shape (k, n), T.

    Returns
    -------
    owner : index of the readings that each start belongs to, ascending, shape (m,).
    shift : shape (3, m), mm.
    curvature : `StartTable.curvature` of each start's cell, shape (m,), 1/mm.
    """
    r = table.basis @ readings
    owner, cell, u = cells_containing(table, r, *_candidates(table, r))
    distance = np.abs(u).max(axis=0)
    sign = table.cell_sign[cell]
    folded = sign == 0
    regular = np.flatnonzero(~folded)
    # neighbouring cells overlap by their margins, so one pose often lies in several of them
    linear_shift = table.centre[cell[regular]] + u[:, regular].T * table.cell_size
    apart = APART * float(np.linalg.norm(table.cell_size))
    regular = regular[
        _distinct(owner[regular], sign[regular].astype(np.int64), distance[regular], linear_shift, apart)
    ]
    owners, curvature = owner[regular], table.curvature[cell[regular]]
    shifts = corrected_shifts(table, cell[regular], u[:, regular])
    if folded.any():
        # the linear map cannot place a pose near a fold: start at a corner on either side of it
        fold_owners, fold_shifts = _fold_starts(table, owner[folded], cell[folded], r.T[owner[folded]])
        owners, shifts = np.concatenate([owners, fold_owners]), np.concatenate([shifts, fold_shifts.T], axis=1)
        curvature = np.concatenate([curvature, np.full(len(fold_owners), STEEP)])
        order = np.argsort(owners, kind="stable")
        owners, shifts, curvature = owners[order], shifts[:, order], curvature[order]
    return owners, np.ascontiguousarray(shifts), curvature


def cells_containing(table: StartTable, r: Array, owner: Ints, cell: Ints) -> tuple[Ints, Ints, Array]:
    """Select the candidate cells that contain their readings.

    Parameters
    ----------
    r : projected readings, shape (3, n), T.
    owner, cell : candidates: index of the readings, index of the cell.

    Returns
    -------
    owner, cell : the candidates that remain, shape (m,).
    u : position in the cell by its linear map, in units of the cell's edges, shape (3, m).
    """
    positions: list[Array] = []
    point = r[:, owner]
    # most candidates fail at the first axis, so the other axes are computed for the remaining ones only
    for rows in table.maps:
        row = rows[cell]
        u = row[:, 0] * point[0] + row[:, 1] * point[1] + row[:, 2] * point[2] + row[:, 3]
        within = np.flatnonzero(np.abs(u) <= 0.5 + MARGIN)
        owner, cell, point = owner[within], cell[within], point[:, within]
        positions = [*(v[within] for v in positions), u[within]]
    # a nearly singular linear map reaches far beyond the cell's readings; the bounding box removes those candidates
    inside = ((point >= table.low[:, cell]) & (point <= table.high[:, cell])).all(axis=0)
    return owner[inside], cell[inside], np.stack(positions)[:, inside]


def corrected_shifts(table: StartTable, cell: Ints, u: Array) -> Array:
    """Return shifts, shape (3, n), mm, from positions u (3, n) in cells (n,), corrected by the cubic polynomial q."""
    q, v = table.correction[:, :, cell], u
    for _ in range(CORRECTIONS):
        v = u - np.einsum("ipn,pn->in", q, np.array(monomials(*v)))
    return np.asarray(table.centre[cell].T + v * table.cell_size[:, None])


def monomials(x: Any, y: Any, z: Any) -> list[Any]:
    """Return the 20 monomials of degree 0 to 3 of numbers or arrays.

    `analytic.inverse.start_table_construction.TENSOR_NORMS` has the same order.
    """
    xx, yy, zz = x * x, y * y, z * z
    squares = [xx, x * y, x * z, yy, y * z, zz]
    cubes = [xx * x, xx * y, xx * z, x * yy, squares[1] * z, x * zz, yy * y, yy * z, y * zz, zz * z]
    return [1.0 + 0.0 * x, x, y, z, *squares, *cubes]


def _fold_starts(table: StartTable, owner: Ints, cell: Ints, point: Array) -> tuple[Ints, Array]:
    """Return, for folded cells, the corner on each side of the fold whose readings are nearest to the point.

    Parameters
    ----------
    owner, cell : index of the readings and of the cell, shape (n,).
    point : projected readings, shape (n, 3), T.

    Returns
    -------
    owner : index of the readings of each start, shape (m,).
    shift : shape (m, 3), mm.
    """
    corners = table.corners[cell]
    size = (table.high - table.low)[:, cell].T
    distance = (np.abs(table.readings[corners] - point[:, None]) / size[:, None]).max(axis=2)
    owners, shifts = [], []
    for sign in (-1, 1):
        one_side = np.where(table.grid_sign[corners] == sign, distance, np.inf)
        best = one_side.argmin(axis=1)
        # a cell with a corner exactly on the fold (det J = 0) may have no corner of this sign
        exists = np.isfinite(one_side[np.arange(len(best)), best])
        owners.append(owner[exists])
        shifts.append(table.grid[corners[exists, best[exists]]])
    return np.concatenate(owners), np.concatenate(shifts)


def _candidates(table: StartTable, r: Array) -> tuple[Ints, Ints]:
    """Return index of the readings and index of the cell, for every cell in the bins of the readings r (3, n)."""
    index = np.zeros(r.shape[1], dtype=np.int64)
    for edges, values in zip(table.bin_edges, r, strict=True):
        index = index * BINS + np.searchsorted(edges, values)
    begin = table.first[index]
    count = table.first[index + 1] - begin
    owner = np.repeat(np.arange(len(count)), count)
    # the bins' lists one after another: position in the concatenated lists, moved to the list's place in `members`
    place = np.arange(len(owner)) + np.repeat(begin - (np.cumsum(count) - count), count)
    return owner, table.members[place].astype(np.int64)


def _distinct(owner: Ints, sign: Ints, distance: Array, shift: Array, apart: float) -> Ints:
    """Return indices of the starts to keep.

    For each owner and sign of det J these are the start nearest to the centre of its cell, and every start farther
    than `apart`, mm, from it.

    Parameters
    ----------
    distance : of each start from the centre of its cell, in units of the cell's edges, shape (n,).
    shift : shape (n, 3), mm.
    """
    group = 3 * owner + sign
    # one sort orders by group, then by distance, because distance is at most 0.5 + MARGIN and hence below 1
    order = np.argsort(group + distance, kind="stable")
    head = np.diff(group[order], prepend=-2) != 0
    best = shift[order][np.flatnonzero(head)[np.cumsum(head) - 1]]
    far = ((shift[order] - best) ** 2).sum(axis=1) > apart**2
    return np.asarray(order[head | far], dtype=np.int64)
