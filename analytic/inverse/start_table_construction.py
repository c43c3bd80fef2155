"""Construction of the table of `start_table`: cells of a grid over the workspace, put into bins of readings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import Forward, readings_with_slopes
from analytic.inverse.start_table import BINS, MARGIN, STEEP, StartTable, monomials
from geometry.arrays import Array, Ints

BOX = 1.5
"""Size of the box of a cell with a fold, over that of its corners."""
MILD = 0.7
"""Greatest slope of q at which these converge."""
CHUNK = 256
"""Cells worked on at a time, so that they stay in the processor's cache."""
NORMS = np.array([1, 1, 1, 1, 1, 1 / 2, 1 / 2, 1, 1 / 2, 1, 1, 1 / 3, 1 / 3, 1 / 3, 1 / 6, 1 / 3, 1, 1 / 3, 1 / 3, 1])
"""Squared norm of the symmetric tensor of 1, x, y, z, xx, xy, xz, yy, yz, zz, xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz,
yzz and zzz."""
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def build(forward: Forward, low: Array, high: Array, counts: tuple[int, int, int]) -> StartTable:
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
        readings[:, part], slopes[:, :, part] = readings_with_slopes(forward, np.ascontiguousarray(grid[:, part]))
    basis = np.eye(3)
    if len(readings) > 3:
        spread = readings - readings.mean(axis=1, keepdims=True)
        basis = np.linalg.svd(spread @ spread.T)[0].T[:3]
    r = (basis @ readings).T
    slopes = np.einsum("ik,jkn->nij", basis, slopes)
    grid_sign = np.sign(np.linalg.det(slopes))
    corners = _corners(counts)
    ends, sides = r[corners], grid_sign[corners]
    # the linear map that fits the corners best: its slope along an edge is the mean difference
    linear = np.einsum("ncr,cj->nrj", ends, (2 * CORNERS - 1) / 4)
    cell_sign = np.where((sides == sides[:, :1]).all(axis=1), sides[:, 0], 0).astype(np.int8)
    middle, inverse = _maps(linear, ends, cell_sign == 0)
    cell_size = (high - low) / counts
    correction, curvature = _corrections(inverse, middle, ends, slopes[corners], cell_sign == 0, cell_size)
    least, most = ends.min(axis=1), ends.max(axis=1)
    reach = MARGIN * (most - least)
    least, most = least - reach, most + reach
    edges = np.quantile(r, np.arange(1, BINS) / BINS, axis=0).T
    maps = _rows(inverse, middle)
    first, members = _binned(edges, least, most, maps)
    return StartTable(
        basis=basis,
        bin_edges=np.ascontiguousarray(edges),
        first=first,
        members=members,
        low=np.ascontiguousarray(least.T),
        high=np.ascontiguousarray(most.T),
        maps=maps,
        correction=correction,
        curvature=curvature,
        centre=grid.T[corners].mean(axis=1),
        cell_sign=cell_sign,
        corners=corners,
        grid=np.ascontiguousarray(grid.T),
        grid_sign=grid_sign,
        readings=r,
        cell_size=cell_size,
        span=np.ptp(readings, axis=1),
    )


def _corners(counts: tuple[int, int, int]) -> Ints:
    """Numbers of the grid's points at the corners of each cell, shape (n, 8)."""
    shape = [n + 1 for n in counts]
    number = np.arange(np.prod(shape)).reshape(shape)
    step = CORNERS @ [shape[1] * shape[2], shape[2], 1]
    return np.asarray(number[:-1, :-1, :-1].reshape(-1, 1) + step, dtype=np.int64)


def _maps(linear: Array, ends: Array, folded: NDArray[np.bool_]) -> tuple[Array, Array]:
    """`StartTable.middle` and `StartTable.inverse` of the cells."""
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


def _rows(inverse: Array, middle: Array) -> Array:
    """`StartTable.maps`."""
    return np.moveaxis(np.concatenate([inverse, -np.matmul(inverse, middle[:, :, None])], axis=2), 1, 0).copy()


def _corrections(
    inverse: Array, middle: Array, ends: Array, slopes: Array, folded: NDArray[np.bool_], cell_size: Array
) -> tuple[Array, Array]:
    """Return `StartTable.correction` and `StartTable.curvature` from readings (n, 8, 3) and slopes (n, 8, i, j)."""
    v = (CORNERS - 0.5).T
    # slopes of polynomials by a complex step, exact to rounding
    columns = [np.array(monomials(*v))]
    columns += [np.array(monomials(*(v + 1e-30j * e[:, None]))).imag / 1e-30 for e in np.eye(3)]
    fit = np.linalg.pinv(np.concatenate(columns, axis=1).T)
    data = np.concatenate([ends - middle[:, None], *np.moveaxis(slopes * cell_size, 3, 0)], axis=1)
    q = np.einsum("pd,ndk,nik->ipn", fit, data, inverse, optimize=True)
    for i in range(3):
        q[i, 1 + i] -= 1
    reach = 0.5 + MARGIN
    size = np.sqrt(np.einsum("ipn,p->pn", q * q, NORMS))
    parts = (slice(1, 4), slice(4, 10), slice(10, 20))
    first, second, third = (np.sqrt((size[part] ** 2).sum(axis=0)) for part in parts)
    far = np.sqrt(3) * reach
    rate = first + 2 * far * second + 3 * far**2 * third
    mild = ~folded & (rate < MILD)
    q[:, :, ~mild] = 0.0
    bound = cell_size.max() / cell_size.min() ** 2 * (second + 3 * far * third)
    return q, np.where(mild, bound / np.where(mild, 1 - rate, 1.0), STEEP)


def _binned(edges: Array, low: Array, high: Array, maps: Array) -> tuple[Ints, NDArray[np.int32]]:
    """Return `StartTable.first` and `members`: for each bin the cells that may intersect it."""
    # no cell is beyond the outermost ends
    ends = np.column_stack([low.min(axis=0), edges, high.max(axis=0)])
    found = [
        _meetings(edges, ends, np.arange(a, min(a + CHUNK, len(low))), low, high, maps)
        for a in range(0, len(low), CHUNK)
    ]
    index, box = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(index, kind="stable")
    first = np.searchsorted(index[order], np.arange(BINS**3 + 1))
    return first.astype(np.int64), box[order]


def _meetings(
    edges: Array, ends: Array, cells: Ints, low: Array, high: Array, maps: Array
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The bins that some cells may meet, and the cell of each."""
    begin = np.stack([np.searchsorted(edges[k], low[cells, k]) for k in range(3)])
    stop = np.stack([np.searchsorted(edges[k], high[cells, k]) for k in range(3)])
    span = stop - begin + 1
    many = span.prod(axis=0)
    box = np.repeat(np.arange(len(cells)), many)
    rest = np.arange(len(box)) - np.repeat(np.cumsum(many) - many, many)
    k = begin[2, box] + rest % span[2, box]
    rest //= span[2, box]
    bins = np.stack([begin[0, box] + rest // span[1, box], begin[1, box] + rest % span[1, box], k])
    centre, half = (ends[:, 1:] + ends[:, :-1]) / 2, np.diff(ends) / 2
    for rows in maps[:, cells]:
        row = rows[box]
        u, reach = row[:, 3].copy(), 0.5 + MARGIN
        for axis, number in enumerate(bins):
            u += row[:, axis] * centre[axis, number]
            reach = reach + np.abs(row[:, axis]) * half[axis, number]
        near = np.flatnonzero(np.abs(u) <= reach)
        box, bins = box[near], bins[:, near]
    index = (bins[0] * BINS + bins[1]) * BINS + bins[2]
    return index.astype(np.int32), cells[box].astype(np.int32)
