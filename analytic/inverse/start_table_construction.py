"""Construction of the decoder's table of start poses, whose idea and use `analytic.inverse.start_table` explains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import Forward, readings_with_slopes
from analytic.inverse.start_table import BINS, MARGIN, PARTS, STEEP, StartTable, monomials
from geometry.arrays import Array, Ints

BOX = 1.5
"""Size of a folded cell's box over the range of its corners' readings: the fold bulges beyond the corners."""
PART_MARGIN = 0.6
"""Margin of the box of a folded cell's part on every side, over the range of its corners."""
MAX_RATE = 0.7
"""Largest slope of q, 1, at which v = u - q(v) is iterated; it converges below 1, and slowly close to 1."""
CHUNK = 2048
"""Number of cells that are binned at a time, so that their arrays stay in the processor's cache."""
TENSOR_NORMS = np.array(
    [1, 1, 1, 1, 1, 1 / 2, 1 / 2, 1, 1 / 2, 1, 1, 1 / 3, 1 / 3, 1 / 3, 1 / 6, 1 / 3, 1, 1 / 3, 1 / 3, 1]
)
"""Squared norms of the symmetric tensors of 1, x, y, z, xx, xy, xz, yy, yz, zz, xxx, xxy, xxz, xyy, xyz, xzz, yyy,
yyz, yzz and zzz: with them the norm of a polynomial's coefficients bounds its value in every direction."""
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
"""Corners of a unit cell, shape (8, 3)."""
NODES = np.stack(np.meshgrid(*[np.arange(PARTS + 1) / PARTS - 0.5] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
"""Corners of the parts of a folded cell, in units of its edges from its centre, shape ((PARTS + 1)^3, 3)."""
PART_NODES = np.array(
    [
        [((i + a) * (PARTS + 1) + j + b) * (PARTS + 1) + k + c for a, b, c in CORNERS]
        for i in range(PARTS)
        for j in range(PARTS)
        for k in range(PARTS)
    ]
)
"""Indices of the corners of each part, shape (PARTS^3, 8)."""


def build(forward: Forward, low: Array, high: Array, counts: tuple[int, int, int]) -> StartTable:
    """Build the table over a box of shifts.

    Parameters
    ----------
    low, high : of the box, shape (3,), mm.
    counts : number of cells along x, y and z.

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
    corner_readings, signs = r[corners], grid_sign[corners]
    # the linear map that fits the corners best: its slope along an edge is the mean difference
    linear = np.einsum("ncr,cj->nrj", corner_readings, (2 * CORNERS - 1) / 4)
    cell_sign = np.where((signs == signs[:, :1]).all(axis=1), signs[:, 0], 0).astype(np.int8)
    folded = np.asarray(cell_sign == 0)
    middle, inverse = _maps(linear, corner_readings, folded)
    cell_size = (high - low) / counts
    fit = _cubics(inverse, middle, corner_readings, slopes[corners], cell_size)
    nodes, node_sign, parts = _parts(fit[:, :, folded], np.sign(np.linalg.det(inverse[folded])))
    correction, curvature = _corrections(fit, folded, cell_size)
    least, most = corner_readings.min(axis=1), corner_readings.max(axis=1)
    reach = MARGIN * (most - least)
    least, most = least - reach, most + reach
    # quantiles, so that the bins hold equally many grid points and no bin lists too many cells
    edges = np.quantile(r, np.arange(1, BINS) / BINS, axis=0).T
    maps = _affine(inverse, middle)
    first, members = _binned(edges, least, most, maps)
    return StartTable(
        basis=basis,
        bin_edges=np.ascontiguousarray(edges),
        first=first,
        members=members,
        low=least,
        high=most,
        maps=maps,
        correction=np.ascontiguousarray(np.moveaxis(correction, 2, 0)),
        curvature=curvature,
        centre=grid.T[corners].mean(axis=1),
        cell_sign=cell_sign,
        fold=np.where(folded, np.cumsum(folded) - 1, -1),
        nodes=nodes,
        node_sign=node_sign,
        parts=parts,
        cell_size=cell_size,
        span=np.ptp(readings, axis=1),
    )


def _corners(counts: tuple[int, int, int]) -> Ints:
    """Return indices of the grid points at the corners of each cell, shape (n, 8)."""
    shape = [n + 1 for n in counts]
    number = np.arange(np.prod(shape)).reshape(shape)
    step = CORNERS @ [shape[1] * shape[2], shape[2], 1]
    return np.asarray(number[:-1, :-1, :-1].reshape(-1, 1) + step, dtype=np.int64)


def _maps(linear: Array, corner_readings: Array, folded: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the cells' mean readings, shape (n, 3), T, and inverse linear maps, shape (n, 3, 3), 1/T.

    For a folded cell both are those of its box: the middle, and the principal axes over the box's size.
    """
    middle = corner_readings.mean(axis=1)
    matrices = linear.copy()
    # a folded cell's map may be singular; the identity stands in for it until its box replaces it below
    matrices[folded] = np.eye(3)
    inverse = np.linalg.inv(matrices)
    axes = np.linalg.svd(linear[folded])[0]
    along = np.matmul(corner_readings[folded], axes)
    least, most = along.min(axis=1), along.max(axis=1)
    size = BOX * (most - least)
    middle[folded] = np.matmul(axes, ((least + most) / 2)[:, :, None])[:, :, 0]
    # a box can be flat: a small thickness avoids division by 0
    inverse[folded] = np.swapaxes(axes, 1, 2) / np.maximum(size, 1e-12 * size.max(axis=1, keepdims=True))[:, :, None]
    return np.asarray(middle, dtype=np.float64), np.asarray(inverse, dtype=np.float64)


def _affine(inverse: Array, middle: Array) -> Array:
    """Return `StartTable.maps` from inverse linear maps (n, 3, 3) and mean readings (n, 3)."""
    return np.moveaxis(np.concatenate([inverse, -np.matmul(inverse, middle[:, :, None])], axis=2), 1, 0).copy()


def _cubics(inverse: Array, middle: Array, corner_readings: Array, slopes: Array, cell_size: Array) -> Array:
    """Return the cubic polynomials u(v) that fit readings and slopes at the cells' corners best, shape (3, 20, n).

    Parameters
    ----------
    inverse, middle : as returned by `_maps`.
    corner_readings, slopes : readings (n, 8, 3), T, and slopes (n, 8, i, j), T/mm, at the cells' corners.
    cell_size : shape (3,), mm.
    """
    columns = [np.array(monomials(*(CORNERS - 0.5).T)), *_monomial_slopes((CORNERS - 0.5).T)]
    # all cells have the same corners in units of their edges, so one pseudo-inverse fits q in all of them
    fit = np.linalg.pinv(np.concatenate(columns, axis=1).T)
    data = np.concatenate([corner_readings - middle[:, None], *np.moveaxis(slopes * cell_size, 3, 0)], axis=1)
    return np.asarray(np.einsum("pd,ndk,nik->ipn", fit, data, inverse, optimize=True))


def _monomial_slopes(v: Array) -> list[Array]:
    """Return the slopes of the monomials along x, y and z at positions (3, m), each of shape (20, m)."""
    # by a complex step, exact to rounding
    return [np.array(monomials(*(v + 1e-30j * e[:, None]))).imag / 1e-30 for e in np.eye(3)]


def _parts(fit: Array, turn: Array) -> tuple[Array, NDArray[np.int8], Array]:
    """Return `StartTable.nodes`, `StartTable.node_sign` and `StartTable.parts`.

    Parameters
    ----------
    fit : cubic polynomials u(v) of the folded cells, shape (3, 20, m).
    turn : sign of the determinant of their inverse maps, shape (m,).
    """
    v = NODES.T
    nodes = np.einsum("pk,ipm->mki", np.array(monomials(*v)), fit)
    slopes = np.einsum("jpk,ipm->mkij", np.array(_monomial_slopes(v)), fit)
    sign = (np.sign(np.linalg.det(slopes)) * turn[:, None]).astype(np.int8)
    corners = nodes[:, PART_NODES]
    least, most = corners.min(axis=2), corners.max(axis=2)
    wider = PART_MARGIN * (most - least)
    return nodes, sign, np.concatenate([least - wider, most + wider], axis=2)


def _corrections(fit: Array, folded: NDArray[np.bool_], cell_size: Array) -> tuple[Array, Array]:
    """Return `StartTable.correction` and `StartTable.curvature`.

    Parameters
    ----------
    fit : as returned by `_cubics`.
    folded : shape (n,).
    cell_size : shape (3,), mm.
    """
    q = fit.copy()
    # the fit is u(v) = v + q(v): subtract v
    for i in range(3):
        q[i, 1 + i] -= 1
    reach = 0.5 + MARGIN
    size = np.sqrt(np.einsum("ipn,p->pn", q * q, TENSOR_NORMS))
    degrees = (slice(1, 4), slice(4, 10), slice(10, 20))
    first, second, third = (np.sqrt((size[part] ** 2).sum(axis=0)) for part in degrees)
    far = np.sqrt(3) * reach
    # upper bound of |dq/dv| over the enlarged cell: v = u - q(v) is a contraction where it is below 1
    rate = first + 2 * far * second + 3 * far**2 * third
    contracting = ~folded & (rate < MAX_RATE)
    q[:, :, ~contracting] = 0.0
    bound = cell_size.max() / cell_size.min() ** 2 * (second + 3 * far * third)
    return q, np.where(contracting, bound / np.where(contracting, 1 - rate, 1.0), STEEP)


def _binned(edges: Array, low: Array, high: Array, maps: Array) -> tuple[Ints, NDArray[np.int32]]:
    """Return `StartTable.first` and `StartTable.members`: for each bin the cells that may intersect it.

    A cell is listed where its bounding box intersects the bin, and so does each of the three slabs between opposite
    faces of its enlarged parallelepiped.

    Parameters
    ----------
    edges : `StartTable.bin_edges`.
    low, high : bounding boxes, shape (n, 3), T.
    maps : `StartTable.maps`.
    """
    # no cell reaches beyond these outermost edges, so the first and last bins are finite
    all_edges = np.column_stack([low.min(axis=0), edges, high.max(axis=0)])
    parts = [
        _intersections(edges, all_edges, np.arange(a, min(a + CHUNK, len(low))), low, high, maps)
        for a in range(0, len(low), CHUNK)
    ]
    index, cell = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.argsort(index, kind="stable")
    first = np.searchsorted(index[order], np.arange(BINS**3 + 1))
    return first.astype(np.int64), cell[order]


def _intersections(
    edges: Array, all_edges: Array, cells: Ints, low: Array, high: Array, maps: Array
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return pairs of bin and cell that may intersect, for the cells with the indices `cells`.

    Parameters as in `_binned`; `all_edges` has the outermost edges of the bins too, shape (3, BINS + 1), T.
    """
    begin = np.stack([np.searchsorted(edges[k], low[cells, k]) for k in range(3)])
    stop = np.stack([np.searchsorted(edges[k], high[cells, k]) for k in range(3)])
    span = stop - begin + 1
    # one entry for each column of bins along the third reading; `rest` counts a box's columns in order
    count = span[0] * span[1]
    cell = np.repeat(np.arange(len(cells)), count)
    rest = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
    i, j = begin[0, cell] + rest // span[1, cell], begin[1, cell] + rest % span[1, cell]
    first, last = begin[2, cell], stop[2, cell]
    centre, half = (all_edges[:, 1:] + all_edges[:, :-1]) / 2, np.diff(all_edges) / 2
    lower, upper = all_edges[2, :-1], all_edges[2, 1:]
    for a, b, c, constant in np.moveaxis(maps[:, cells][:, cell], 2, 1):
        # u at the column's centre where the third reading is 0, and the largest |u| at which it can reach the slab
        u = constant + a * centre[0, i] + b * centre[1, j]
        reach = 0.5 + MARGIN + np.abs(a) * half[0, i] + np.abs(b) * half[1, j]
        # u is linear along the column, which lies in the slab between two values of the third reading; these are
        # infinite for a column parallel to the slab
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort((np.stack([-reach, reach]) - u) / c, axis=0)
        first = np.maximum(first, np.searchsorted(upper, ends[0]))
        last = np.minimum(last, np.searchsorted(lower, ends[1], side="right") - 1)
    number = np.maximum(last - first + 1, 0)
    column = np.repeat(np.arange(len(cell)), number)
    k = np.arange(len(column)) - np.repeat(np.cumsum(number) - number - first, number)
    index = (i[column] * BINS + j[column]) * BINS + k
    return index.astype(np.int32), cells[cell[column]].astype(np.int32)
