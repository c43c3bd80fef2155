"""The paper's look-up table: the readings of every pose of a grid. Lengths in mm, B in T.

The grid covers x and y from -side to side and the magnet's sinking from 0 to sink, in equal steps. The paper's 3 mm
and 0.01 mm give 601 x 601 x 301 poses of three readings each. Without tilt, two numbers determine every reading:
B_rho and B_z at a distance rho from the magnet's axis and a height Z above its centre. They fit in a two-dimensional
table.
"""

from dataclasses import dataclass

import numpy as np

from analytic.hall import plates_of
from analytic.inverse.forward_model import Forward, readings_at
from analytic.magnet import cylinder_field
from geometry.arrays import Array
from geometry.design import BadInput


@dataclass(frozen=True, slots=True)
class Grid:
    """Grid of poses x = -side + i step, y = -side + j step, z = -k step.

    Attributes
    ----------
    side, sink, step : largest lateral shift along x and y, largest sinking, and distance of neighbours, mm; side and
        sink must be multiples of step.
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
        """Return the number of poses along x, y and z.

        >>> Grid(3.0, 3.0, 0.01).shape
        (601, 601, 301)
        """
        wide = 2 * round(self.side / self.step) + 1
        return wide, wide, round(self.sink / self.step) + 1

    def axes(self) -> tuple[Array, Array, Array]:
        """Return the coordinates along x, y and z, mm; z decreases from 0."""
        n, _, deep = self.shape
        wide = np.linspace(-self.side, self.side, n)
        return wide, wide, -np.linspace(0.0, self.sink, deep)


def slab(forward: Forward, grid: Grid, i: int, block: int = 8192) -> Array:
    """Return the readings of all poses with the i-th x, shape (n_y, n_z, k), T, computed `block` poses at a time."""
    x, y, z = grid.axes()
    shift = np.stack([np.full(len(y) * len(z), x[i]), np.repeat(y, len(z)), np.tile(z, len(y))])
    readings = np.empty((shift.shape[1], len(forward.elements)))
    for start in range(0, len(readings), block):
        part = slice(start, start + block)
        readings[part] = readings_at(forward, np.ascontiguousarray(shift[:, part])).T
    return readings.reshape(len(y), len(z), -1)


def meridian_table(forward: Forward, grid: Grid) -> tuple[Array, float]:
    """Return the table of B_rho and B_z that determines all readings of the grid without tilt.

    Returns
    -------
    table : (B_rho, B_Z) at rho = i step, Z = first + j step, shape (n_rho, n_Z, 2), T. Z points up in the sensor.
    first : smallest Z, mm.
    """
    design, points = forward.design, plates_of(forward.elements)[0]
    far = max(float(np.hypot(np.abs(x) + grid.side, np.abs(y) + grid.side)) for x, y, _ in points)
    low = float(points[:, 2].min()) - design.H
    high = float(points[:, 2].max()) - design.H + grid.sink
    rho = grid.step * np.arange(int(np.ceil(far / grid.step - 1e-9)) + 1)
    Z = low + grid.step * np.arange(int(np.ceil((high - low) / grid.step - 1e-9)) + 1)
    table = np.empty((len(rho), len(Z), 2))
    for row, r in zip(table, rho, strict=True):
        where = np.column_stack([np.full_like(Z, r), np.zeros_like(Z), Z])
        row[:] = cylinder_field(where, design.magnet_diameter / 2, design.magnet_height, -design.polarisation)[:, ::2]
    return table, low
