"""The paper's look-up table: the readings of every pose of a grid. Lengths in mm, B in T.

The grid has x and y from -side to side and the sinking from 0 to sink, in whole steps; with the paper's 3 mm and
0.01 mm these are 601 x 601 x 301 poses of three readings. Without tilt every reading follows from B_rho and B_z at a
distance rho from the axis and a height Z over the magnet's centre alone, a table of two dimensions.

A table too large for a search tree in memory is read from its file: of blocks of 16 x 16 x 16 poses the least and the
greatest readings are kept, and only blocks that may hold a nearer entry than the best so far are looked into.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.inverse.forward_model import Forward, readings_at
from analytic.magnet import cylinder_field
from geometry.arrays import Array
from geometry.design import BadInput

SIDE = 16
"""Of a block, in poses."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Poses x = -side + i step, y = -side + j step, z = -k step.

    Attributes
    ----------
    side, sink, step : mm; side and sink are whole numbers of steps.
    """

    side: float
    sink: float
    step: float

    def __post_init__(self) -> None:
        if not 0 < self.step <= min(self.side, self.sink):
            raise BadInput(
                f"step must be more than 0 and at most {min(self.side, self.sink):g} mm; got {self.step:g} mm"
            )
        for name, length in (("sideways", self.side), ("down", self.sink)):
            if not abs(length / self.step - round(length / self.step)) < 1e-6:
                raise BadInput(
                    f"the {length:g} mm {name} must be a whole number of steps; got a step of {self.step:g}"
                )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of poses along x, y and z.

        >>> Grid(3.0, 3.0, 0.01).shape
        (601, 601, 301)
        """
        wide = 2 * round(self.side / self.step) + 1
        return wide, wide, round(self.sink / self.step) + 1

    def axes(self) -> tuple[Array, Array, Array]:
        """Coordinates along x, y and z, mm; z downwards from 0."""
        n, _, deep = self.shape
        wide = np.linspace(-self.side, self.side, n)
        return wide, wide, -np.linspace(0.0, self.sink, deep)


def slab(forward: Forward, grid: Grid, i: int, block: int = 8192) -> Array:
    """Readings of all poses with the i-th x, shape (n_y, n_z, k), T."""
    x, y, z = grid.axes()
    shift = np.stack([np.full(len(y) * len(z), x[i]), np.repeat(y, len(z)), np.tile(z, len(y))])
    found = np.empty((shift.shape[1], len(forward.elements)))
    for start in range(0, len(found), block):
        part = slice(start, start + block)
        found[part] = readings_at(forward, np.ascontiguousarray(shift[:, part])).T
    return found.reshape(len(y), len(z), -1)


@dataclass(frozen=True, slots=True, eq=False)
class BlockIndex:
    """Bounds of the readings in the blocks of a table.

    Attributes
    ----------
    table : shape (n_x, n_y, n_z, 3), T; a memory map will do.
    low, high : of each block, shape (n, 3), T.
    corner : index of its first entry, shape (n, 3).
    """

    table: Array
    low: Array
    high: Array
    corner: NDArray[np.int64]


def block_index(table: Array) -> BlockIndex:
    """The index of a table; reads all of it once, a row of blocks at a time."""
    starts = [np.arange(0, n, SIDE) for n in table.shape[:3]]
    low: list[Array] = []
    high: list[Array] = []
    for i in starts[0]:
        part = np.asarray(table[i : i + SIDE])
        for found, reduce in ((low, np.minimum), (high, np.maximum)):
            row = reduce.reduceat(reduce.reduceat(reduce.reduce(part, axis=0), starts[1], axis=0), starts[2], axis=1)
            found.append(row.reshape(-1, table.shape[3]))
    corner = np.stack(np.meshgrid(*starts, indexing="ij"), axis=-1).reshape(-1, 3)
    return BlockIndex(table, np.concatenate(low), np.concatenate(high), corner)


def nearest(index: BlockIndex, field: Array) -> tuple[tuple[int, int, int], int]:
    """Where in the table the entry nearest to the readings (3,), T, is, and how many blocks were looked into."""
    apart = np.maximum(np.maximum(index.low - field, field - index.high), 0.0)
    bound = (apart * apart).sum(axis=1)
    best, place, count = np.inf, (0, 0, 0), 0
    k = int(bound.argmin())
    while bound[k] < best:
        i, j, l = index.corner[k].tolist()
        part = np.asarray(index.table[i : i + SIDE, j : j + SIDE, l : l + SIDE])
        distance = ((part - field) ** 2).sum(axis=3)
        at = int(distance.argmin())
        if distance.flat[at] < best:
            best = float(distance.flat[at])
            a, b, c = np.unravel_index(at, distance.shape)
            place = (i + int(a), j + int(b), l + int(c))
        count += 1
        bound[k] = np.inf
        k = int(bound.argmin())
    return place, count


def meridian_table(forward: Forward, grid: Grid) -> tuple[Array, float]:
    """B_rho and B_z in the magnet's frame for all readings of the grid without tilt, and the first Z.

    Returns
    -------
    table : shape (n_rho, n_Z, 2), T, at rho = i step, Z = first + j step, Z against the magnet's polarisation (up in
        the sensor), B along rho and Z.
    first : mm.
    """
    design, points = forward.design, forward.points
    far = max(float(np.hypot(np.abs(x) + grid.side, np.abs(y) + grid.side)) for x, y, _ in points)
    low = float(points[:, 2].min()) - design.H
    high = float(points[:, 2].max()) - design.H + grid.sink
    rho = grid.step * np.arange(int(np.ceil(far / grid.step - 1e-9)) + 1)
    Z = low + grid.step * np.arange(int(np.ceil((high - low) / grid.step - 1e-9)) + 1)
    table = np.empty((len(rho), len(Z), 2))
    for row, r in zip(table, rho, strict=True):
        where = np.column_stack([np.full_like(Z, r), np.zeros_like(Z), Z])
        row[:] = cylinder_field(where, design.magnet_diameter / 2, design.magnet_height, -design.remanence)[:, ::2]
    return table, low
