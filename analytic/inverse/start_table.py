"""Start poses for the decoder's iteration: the workspace's cells, each with the readings that its poses have.

A grid over the workspace divides it into cells. In each cell a linear map from shift to readings is fitted to the
corners, so the image of the cell in the space of readings is a parallelepiped. Several poses can have the same
readings; then several parallelepipeds contain the point of these readings, and each gives one start. Adjacent
parallelepipeds leave gaps and overlap, so each is enlarged by a margin. More than three readings are projected onto
the three directions in which they vary most over the workspace.

Each cell has the bounding box of its readings, and each block of cells one around theirs, so that the cells with
given readings are found without a look at all of them.

On a fold det J = 0, with J = dB/ds, and two poses merge; close to it a linear map finds neither of them. A cell whose
corners differ in the sign of det J is therefore divided into parts, which are cells of their own. A part whose
corners still differ gives one start on each side of the fold: its corner whose readings are nearest. The image of
such a part is flat, so that its box lies along the principal axes of the linear map.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import Forward, readings_with_slopes
from geometry.arrays import Array, Ints

# the compiled search uses both margins
MARGIN = 0.2
"""Margin by which a cell is enlarged on every side, in units of its edges: it closes the gaps between linear maps."""
FOLD_MARGIN = 1.0
"""The same for the readings of a folded part, over the range of its corners: the fold bulges beyond them."""
PARTS = 3
"""Number of parts of a folded cell along each edge."""
BLOCK = 4
"""Number of cells of a block along each edge."""
CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
"""Corners of a unit cell, shape (8, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class StartTable:
    """n boxes: of a block of cells, which follow it; of a cell; of a folded cell, whose parts follow it.

    Attributes
    ----------
    basis : projection of k readings onto three numbers, shape (3, k).
    low, high : bounding boxes of the projected readings, enlarged by the margin, shape (n, 3), T.
    after : the next box to look at if the readings lie outside of one, shape (n,): past all that it holds.
    maps : inverse linear maps of the cells, shape (n, 3, 4). The readings r lie at
        maps[:, :, :3] @ r + maps[:, :, 3], measured from the cell's centre in units of its edges; for a folded part,
        in units of the box of its readings along their principal axes.
    sign : sign of det J at all corners of a cell, shape (n,); 0 for a box that holds others, or a folded part.
    centre, edge : centres and edges of the cells, shape (n, 3), mm.
    fold : number of a folded part among these, -1 for the other boxes, shape (n,).
    corners, corner_sign : where the readings at the corners of the m folded parts lie in their boxes, shape
        (m, 8, 3), and sign of det J there, shape (m, 8).
    span : range of each element's readings over the grid, shape (k,), T.
    """

    basis: Array
    low: Array
    high: Array
    after: Ints
    maps: Array
    sign: Ints
    centre: Array
    edge: Array
    fold: Ints
    corners: Array
    corner_sign: Ints
    span: Array


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
    edge = (high - low) / counts
    nodes, corner_nodes = _nodes(counts)
    readings, slopes = readings_with_slopes(forward, low[:, None] + (edge * nodes).T)
    basis = np.eye(3)
    if len(readings) > 3:
        spread = readings - readings.mean(axis=1, keepdims=True)
        basis = np.linalg.svd(spread @ spread.T)[0].T[:3].copy()
    corners, sign = _projected(basis, readings, slopes)
    corners, sign = corners[corner_nodes], sign[corner_nodes]
    centre = low + edge * (nodes[corner_nodes[:, 0]] + 0.5)
    folded = np.flatnonzero((sign != sign[:, :1]).any(axis=1))

    part_nodes, part_corners = _nodes((PARTS,) * 3)
    shifts = centre[folded, None] + edge * (part_nodes / PARTS - 0.5)
    r, s = _projected(basis, *readings_with_slopes(forward, shifts.reshape(-1, 3).T))
    middle = centre[folded, None] + edge * ((part_nodes[part_corners[:, 0]] + 0.5) / PARTS - 0.5)
    # all cells of the grid, and then the parts of the folded ones
    corners = np.concatenate([corners, r.reshape(-1, len(part_nodes), 3)[:, part_corners].reshape(-1, 8, 3)])
    sign = np.concatenate([sign, s.reshape(-1, len(part_nodes))[:, part_corners].reshape(-1, 8)])
    centre = np.concatenate([centre, middle.reshape(-1, 3)])
    order, after = _order(counts, folded.tolist())
    holds, alike = order < 0, (sign == sign[:, :1]).all(axis=1)
    fold = ~holds & ~alike[order]
    least, most = corners.min(axis=1), corners.max(axis=1)
    reach = np.where(alike, MARGIN, FOLD_MARGIN)[:, None] * (most - least)
    least, most = (least - reach)[order], (most + reach)[order]
    for box in np.flatnonzero(holds)[::-1]:
        held = slice(box + 1, after[box])
        least[box], most[box] = least[held].min(axis=0), most[held].max(axis=0)
    maps = _maps(corners, alike)[order]
    return StartTable(
        basis=basis,
        low=least,
        high=most,
        after=after,
        maps=maps,
        sign=np.where(holds, 0, (sign[:, 0] * alike)[order]),
        centre=centre[order],
        edge=np.where(order[:, None] < len(corner_nodes), edge, edge / PARTS),
        fold=np.where(fold, np.cumsum(fold) - 1, -1),
        corners=np.einsum("mij,mcj->mci", maps[fold, :, :3], corners[order[fold]]) + maps[fold, None, :, 3],
        corner_sign=sign[order[fold]],
        span=np.ptp(readings, axis=1),
    )


def _order(counts: tuple[int, int, int], folded: list[int]) -> tuple[Ints, Ints]:
    """Return the cells of the table in their order, -1 for a box that holds others, and `StartTable.after`."""
    cells = np.arange(np.prod(counts)).reshape(counts)
    split = {cell: k for k, cell in enumerate(folded)}
    order: list[int] = []
    after: list[int] = []
    for i, j, k in itertools.product(*(range(0, n, BLOCK) for n in counts)):
        block = len(order)
        order.append(-1)
        after.append(0)
        for cell in cells[i : i + BLOCK, j : j + BLOCK, k : k + BLOCK].ravel().tolist():
            first = cells.size + PARTS**3 * split[cell] if cell in split else cell
            boxes = [-1, *range(first, first + PARTS**3)] if cell in split else [cell]
            after += range(len(order) + 1, len(order) + 1 + len(boxes))
            after[len(order)] = len(order) + len(boxes)
            order += boxes
        after[block] = len(order)
    return np.array(order), np.array(after)


def _nodes(counts: tuple[int, ...]) -> tuple[Array, Ints]:
    """Return the nodes of a grid of unit cells, shape (m, 3), and those at the corners of each cell, shape (n, 8)."""
    shape = [n + 1 for n in counts]
    nodes = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    first = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    step = np.array([shape[1] * shape[2], shape[2], 1])
    return nodes.astype(np.float64), (first @ step)[:, None] + CORNERS @ step


def _projected(basis: Array, readings: Array, slopes: Array) -> tuple[Array, Ints]:
    """Return the projected readings, shape (n, 3), T, and the sign of det J, shape (n,)."""
    sign = np.sign(np.linalg.det(np.einsum("ik,jkn->nij", basis, slopes)))
    return (basis @ readings).T.copy(), sign.astype(np.int64)


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
