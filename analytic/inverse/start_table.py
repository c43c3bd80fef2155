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
in the sign of det J therefore gets a box along the principal axes of its linear map, larger by half, and is divided
into parts with boxes of their own, whose corners are placed by the cubic polynomial. Each part that contains the
readings gives one start on each side of the fold: its corner whose readings are nearest.
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
PARTS = 3
"""Number of parts of a folded cell along each edge."""
STEEP = 1e9
"""Curvature of a cell without a bound, 1/mm: only a first Newton step below 1e-9 mm then ends the iteration."""


@dataclass(frozen=True, slots=True, eq=False)
class StartTable:
    """Cells of the workspace and bins of readings; n cells, k elements.

    Attributes
    ----------
    basis : projection of k readings onto three numbers, shape (3, k).
    bin_edges : inner edges of the bins along each projected reading, shape (3, BINS - 1), T.
    first, members : the cells of bin b are members[first[b]:first[b + 1]].
    low, high : bounding boxes of the cells' projected readings, enlarged by the margin, shape (n, 3), T.
    maps : inverse linear maps of the cells, shape (3, n, 4). The readings r lie at maps[i, :, :3] @ r + maps[i, :, 3]
        along axis i, measured from the cell's centre in units of its edges (for a folded cell: of its box).
    correction : coefficients of q in the order of `monomials`, shape (n, 3, 20); 0 where the iteration need not
        converge.
    curvature : upper bound of |J^-1 d2B/ds2| / 2 in a cell, 1/mm: a Newton step of length p leaves an error of at
        most curvature p^2; `STEEP` where it is not known.
    centre : centres of the cells, shape (n, 3), mm.
    cell_sign : sign of det J at the corners of each cell, shape (n,); 0 (folded) where the corners differ.
    fold : number of each folded cell among the folded ones, -1 for the others, shape (n,).
    nodes, node_sign : readings at the corners of the parts of the m folded cells, in units of the cell's box, shape
        (m, (PARTS + 1)^3, 3), and sign of det J there.
    parts : lower and upper ends of the parts' boxes, in the same units, shape (m, PARTS^3, 6).
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
    fold: Ints
    nodes: Array
    node_sign: NDArray[np.int8]
    parts: Array
    cell_size: Array
    span: Array


def monomials(x: Any, y: Any, z: Any) -> list[Any]:
    """Return the 20 monomials of degree 0 to 3 of numbers or arrays.

    `analytic.inverse.start_table_construction.TENSOR_NORMS` has the same order.
    """
    xx, yy, zz = x * x, y * y, z * z
    squares = [xx, x * y, x * z, yy, y * z, zz]
    cubes = [xx * x, xx * y, xx * z, x * yy, squares[1] * z, x * zz, yy * y, yy * z, y * zz, zz * z]
    return [1.0 + 0.0 * x, x, y, z, *squares, *cubes]
