"""Errors of the paper's readings, split into mechanics, tilt and field.

The paper's reading is that of an upright magnet at the position by its formulas, in the field by equation (3). The
true one is that of the finite elements' pose in the exact field. The difference is the sum of three parts:

    field       the paper's field less the exact one, at the paper's pose
    mechanics   the exact reading at the paper's position less that at the finite elements' position, both upright
    tilt        the exact reading of the upright magnet less that of the tilted one, at the finite elements' position

All are in % of full scale: the largest change from rest that the finite elements give a sensor in the table, for S2
and S3 together. `dipole` is what a dipole in place of (3) would add to the field part. The elements stay where they
are in the base of the paper's sensor; L changes the distance to the magnet.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from analytic import hall
from geometry.arrays import Array
from geometry.design import Design, paper
from studies.claims.beam_cells import Body, Cells, Columns

PARTS = ("total", "mechanics", "tilt", "field", "dipole")
ELEMENTS = ("S1", "S2", "S3")


@dataclass(frozen=True, slots=True)
class SplitCell:
    """Parts of the error of one element in one state, % of full scale."""

    magnet_height_over_D: float
    L_over_D: float
    depth_over_D: float
    shear_over_D: float
    element: str
    total_percent_FS: float
    mechanics_percent_FS: float
    tilt_percent_FS: float
    field_percent_FS: float
    dipole_percent_FS: float


@dataclass(frozen=True, slots=True)
class SplitMean:
    """Root mean squares of the parts over the states of one kind and one range of L/D, % of full scale."""

    load: str
    magnet_height_over_D: float
    slenderness: str
    states: int
    total_percent_FS: float
    mechanics_percent_FS: float
    tilt_percent_FS: float
    field_percent_FS: float
    dipole_percent_FS: float


def split_cells(table: Columns, grids: Sequence[Cells]) -> list[SplitCell]:
    """Return the parts in every judged state of the bodies with a magnet."""
    rows: list[SplitCell] = []
    for body in dict.fromkeys(grid.body for grid in grids if grid.body.height):
        own = [grid for grid in grids if grid.body == body]
        for column, slenderness in enumerate(own[0].slenderness.tolist()):
            states = np.concatenate([grid.row[grid.judged[:, column], column] for grid in own])
            if len(states):
                rows += _sensor(table, body, slenderness, states)
    return rows


def _sensor(table: Columns, body: Body, slenderness: float, states: Array) -> list[SplitCell]:
    """Return the parts in the states of one sensor.

    Parameters
    ----------
    states : rows of the table, shape (n,).
    """
    design = sensor(table, int(states[0]))
    fem, tilt = _poses(table, "fem", states)
    formula, upright = _poses(table, "analytic_paper", states)[0], np.zeros_like(tilt)
    true = readings(design, fem, tilt)
    rest = readings(design, np.zeros((1, 3)), np.zeros((1, 2)))
    straight, at_formula = readings(design, fem, upright), readings(design, formula, upright)
    by_paper, by_dipole = (readings(design, formula, upright, field) for field in ("paper", "dipole"))
    change = np.abs(true - rest).max(axis=0)
    scale = np.array([change[0], change[1:].max(), change[1:].max()])
    parts = (by_paper - true, at_formula - straight, straight - true, by_paper - at_formula, by_dipole - by_paper)
    percent = [100 * part / scale for part in parts]
    D = design.D
    return [
        SplitCell(
            body.height,
            slenderness,
            float(table["depth_mm"][row] / D),
            float(table["shear_mm"][row] / D),
            name,
            *(float(part[k, element]) for part in percent),
        )
        for k, row in enumerate(states.tolist())
        for element, name in enumerate(ELEMENTS)
    ]


def sensor(table: Columns, row: int) -> Design:
    """Return the sensor of a row of the table."""
    names = ("D", "L", "f", "magnet_diameter", "magnet_height", "magnet_edge_radius", "l0")
    sizes = {name: float(table[f"{name}_mm"][row]) for name in names}
    return dataclasses.replace(paper(), **sizes, nu=float(table["nu"][row]))  # type: ignore[arg-type]


def _poses(table: Columns, prefix: str, states: Array) -> tuple[Array, Array]:
    """Return shifts (n, 3), mm, and rotation vectors (n, 2), rad, of a model; a press has no shift along x."""
    shift = np.column_stack([table[f"{prefix}_shift_{axis}_mm"][states] for axis in "xyz"])
    lean = np.column_stack([-table[f"{prefix}_tilt_y_rad"][states], table[f"{prefix}_tilt_rad"][states]])
    return np.nan_to_num(shift), np.nan_to_num(lean)


def readings(design: Design, shift: Array, tilt: Array, field: hall.Field = "exact") -> Array:
    """Return B.n of S1, S2 and S3 for poses, shape (n, 3), T."""
    points, directions = hall.elements(design)
    values = [
        hall.field_at(np.tile(point, (len(shift), 1)), design, shift, tilt, field=field) @ direction
        for point, direction in zip(points, directions, strict=True)
    ]
    return np.column_stack(values)


def split_means(rows: Sequence[SplitCell], slender: dict[str, Callable[[float], bool]]) -> list[SplitMean]:
    """Return root mean squares by kind of load, height of the magnet and range of L/D."""
    means = []
    kinds: dict[str, Callable[[SplitCell], bool]] = {
        "press": lambda row: not row.shear_over_D,
        "shear": lambda row: bool(row.shear_over_D),
    }
    for load, of_kind in kinds.items():
        for height in sorted({row.magnet_height_over_D for row in rows}):
            for name, inside in slender.items():
                own = [
                    row
                    for row in rows
                    if of_kind(row) and row.magnet_height_over_D == height and inside(row.L_over_D)
                ]
                if own:
                    means.append(SplitMean(load, height, name, len(own) // 3, *(_rms(own, part) for part in PARTS)))
    return means


def _rms(rows: Sequence[SplitCell], part: str) -> float:
    return float(np.sqrt(np.mean([getattr(row, f"{part}_percent_FS") ** 2 for row in rows])))
