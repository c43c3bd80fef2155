"""Errors of the formulas over a grid of designs and loads: one cell for each L/D and each load of one body.

A body is a height of the magnet and a Poisson's ratio. The cells of a body are presses (over the depth) or shears
(over depth and shear). They come from the columns of a sweep over L, the magnet's size, nu, depth and shear. Errors
are those of a formula against the finite elements, in %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from geometry.arrays import Array

Columns = Mapping[str, NDArray[Any]]
"""A table: columns of equal length by their names."""
Kind = Literal["press", "shear"]
Bools = NDArray[np.bool_]

QUANTITIES: dict[Kind, dict[str, str]] = {
    "press": {"press force": "force_N", "sinking": "shift_z_mm"},
    "shear": {"shear force": "force_x_N", "sideways shift": "shift_x_mm", "tilt": "tilt_rad"},
}
"""Quantities of each kind of load that are judged, and their columns behind the model's prefix."""


@dataclass(frozen=True, slots=True)
class Body:
    """A height of the magnet over D (0: no magnet), and a Poisson's ratio."""

    height: float
    nu: float

    @property
    def name(self) -> str:
        """Name in sentences."""
        return f"magnet {self.height:.3g} D high" if self.height else "no magnet"


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Cells of one body and one kind of load; arrays have shape (loads, lengths).

    Attributes
    ----------
    slenderness : L/D, rising, shape (lengths,).
    loads : depth and shear over D of each row, rising, shape (loads, 2).
    row : row of the table of each cell; -1 where the table has none.
    possible : whether the design exists: the magnet fits the beam.
    answered : whether the finite elements reached the state.
    gave_way : whether the beam no longer resists the shear: its force along the shear is not positive.
    leans : whether the press is deeper than the depth at which a tip that slides freely buckles sideways.
    """

    body: Body
    kind: Kind
    slenderness: Array
    loads: Array
    row: NDArray[np.int64]
    possible: Bools
    answered: Bools
    gave_way: Bools
    leans: Bools

    @property
    def judged(self) -> Bools:
        """Whether a cell has errors."""
        return np.asarray(self.answered & ~self.gave_way)


def bodies(table: Columns) -> list[Body]:
    """Return the bodies of a table: those of the largest nu first, then by height."""
    heights, nus = table["magnet_height_mm"] / table["D_mm"], table["nu"]
    pairs = set(zip(np.round(heights, 9).tolist(), nus.tolist(), strict=True))
    return [Body(height, nu) for height, nu in sorted(pairs, key=lambda pair: (-pair[1], pair[0]))]


def cells(table: Columns, body: Body, kind: Kind) -> Cells:
    """Return the cells of one body and one kind of load.

    Raises
    ------
    ValueError
        Two rows of the table belong to one cell; `studies.validation.assumption.plan_of` refuses such studies.
    """
    D = table["D_mm"]
    own = np.isclose(table["magnet_height_mm"] / D, body.height, atol=1e-6) & np.isclose(table["nu"], body.nu)
    own &= (table["shear_mm"] != 0) if kind == "shear" else (table["shear_mm"] == 0)
    rows = np.flatnonzero(own)
    slenderness, column = np.unique(np.round(table["L_mm"] / D, 9)[rows], return_inverse=True)
    pairs = np.round(np.column_stack([table["depth_mm"], table["shear_mm"]])[rows] / D[rows, None], 9)
    loads, line = np.unique(pairs, axis=0, return_inverse=True)
    if len(np.unique(np.column_stack([line.ravel(), column]), axis=0)) < len(rows):
        raise ValueError(f"two rows of the table are one cell of {body.name}, nu {body.nu:g}")
    row = np.full((len(loads), len(slenderness)), -1)
    row[line.ravel(), column] = rows
    force = _at(table["fem_force_x_N" if kind == "shear" else "fem_force_N"], row)
    answered = np.isfinite(force)
    critical = _at(table.get("critical_depth_mm", np.full(len(D), np.nan)), row)
    depth = _at(table["depth_mm"], row)
    status = np.where(row >= 0, table["status"][row], "bad_input")
    return Cells(
        body,
        kind,
        slenderness,
        loads,
        row,
        possible=np.asarray(status != "bad_input"),
        answered=answered,
        gave_way=np.asarray(answered & (force <= 0)),
        # a NaN, which stands for no critical depth, is exceeded by nothing
        leans=np.asarray((kind == "press") & (depth > critical)),
    )


def _at(column: NDArray[Any], row: NDArray[np.int64]) -> Array:
    """Return the values of a column in the cells; NaN where there is no row."""
    return np.where(row >= 0, column.astype(np.float64)[row], np.nan)


def errors(table: Columns, grid: Cells, level: str, quantity: str) -> Array:
    """Return the errors of a level of the formulas, shape (loads, lengths), %; NaN where a cell is not judged."""
    column = QUANTITIES[grid.kind][quantity]
    fem, formula = (_at(table[f"{prefix}_{column}"], grid.row) for prefix in ("fem", f"analytic_{level}"))
    known = grid.judged & np.isfinite(formula) & (fem != 0)
    return np.where(known, 100 * (formula / np.where(known, fem, 1.0) - 1), np.nan)


def all_errors(table: Columns, grid: Cells, quantity: str) -> dict[str, Array]:
    """Return the errors of every level of the formulas by its name."""
    return {level: errors(table, grid, level, quantity) for level in beam.LEVELS}
