"""Errors of the paper's readings, split into mechanics, tilt and field.

The paper's reading is that of an upright magnet at the position by its formulas, in the field by equation (3). The
true one is that of the finite elements' pose in the exact field. The difference is the sum of three parts:

    field       the paper's field less the exact one, at the paper's pose
    mechanics   the exact reading at the paper's position less that at the finite elements' position, both upright
    tilt        the exact reading of the upright magnet less that of the tilted one, at the finite elements' position

All are in % of full scale: the largest change from rest that the finite elements give a sensor in the table, for S2
and S3 together. `dipole` is what a dipole in place of (3) would add to the field part. The elements stay where they
are in the base of the sensor; L changes the distance to the magnet. A state whose pose is unknown has no parts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from analytic import hall
from analytic.parts import of_design
from geometry.arrays import Array
from geometry.design import Design
from studies.inputs.user_input import Value
from studies.mechanics.study_cases import varied
from studies.simulation.beam_cells import Cells, Columns
from studies.validation import pages
from studies.validation.pages import Row

if TYPE_CHECKING:
    import pandas as pd

PARTS = ("total", "mechanics", "tilt", "field", "dipole")
COLUMNS, LOADS = [f"{part}_percent_FS" for part in PARTS], ("depth", "shear")


SLENDER = ("L/D below 1.1", "L/D 1.1 to 2", "L/D above 2")


def slender(ratio: Array) -> pd.Categorical:
    """Return the range of L/D of beams, one of SLENDER."""
    import pandas as pd

    return pd.Categorical.from_codes((ratio >= 1.1).astype(int) + (ratio > 2), SLENDER)


def split_cells(table: Columns, grids: Sequence[Cells], design: Design) -> pd.DataFrame:
    """Return the parts in every judged state of the bodies with a magnet; `design` is that of the sweep."""
    import pandas as pd

    found = [pd.DataFrame(columns=["L_over_D", "shear_over_D", *COLUMNS])]
    for body in dict.fromkeys(grid.body for grid in grids if grid.body.height):
        own = [grid for grid in grids if grid.body == body]
        for column, slenderness in enumerate(own[0].slenderness.tolist()):
            states = np.concatenate([grid.row[grid.judged[:, column], column] for grid in own])
            if len(states):
                one = sensor(table, int(states[0]), design)
                place = {"magnet_height_over_D": body.height, "L_over_D": slenderness}
                found.append(_sensor(table, one, states, place))
    return pd.concat(found[1:] or found, ignore_index=True)


def _sensor(table: Columns, design: Design, states: Array, place: Mapping[str, float]) -> pd.DataFrame:
    """Return the parts in the states of one sensor; NaN where a pose is unknown.

    Parameters
    ----------
    states : rows of the table, shape (n,).
    place : first columns.
    """
    import pandas as pd

    (fem, tilt), (formula, _) = (_poses(table, model, states) for model in ("fem", "analytic_paper"))
    known = np.isfinite(np.column_stack([fem, tilt, formula])).all(axis=1)
    names = [element.name for element in of_design(design)]
    percent = np.full((len(PARTS), len(states), len(names)), np.nan)
    if known.any():
        percent[:, known] = _parts(design, fem[known], tilt[known], formula[known])
    over_D = {f"{name}_over_D": (table[f"{name}_mm"][states] / design.D).repeat(len(names)) for name in LOADS}
    parts = dict(zip(COLUMNS, percent.reshape(len(PARTS), -1), strict=True))
    return pd.DataFrame({**place, **over_D, "element": names * len(states), **parts})


def _parts(design: Design, fem: Array, tilt: Array, formula: Array) -> Array:
    """Return the parts of each state and element in % of full scale, shape (PARTS, n, elements)."""
    upright = np.zeros_like(tilt)
    true = readings(design, fem, tilt)
    rest = readings(design, np.zeros((1, 3)), np.zeros((1, 2)))
    straight, at_formula = readings(design, fem, upright), readings(design, formula, upright)
    by_paper, by_dipole = (readings(design, formula, upright, field) for field in ("paper", "dipole"))
    change = np.abs(true - rest).max(axis=0)
    # elements that look sideways share their full scale
    sideways = np.abs(hall.elements(design)[1][:, 2]) < 0.5
    scale = np.where(sideways, change[sideways].max(initial=0.0), change)
    parts = (by_paper - true, at_formula - straight, straight - true, by_paper - at_formula, by_dipole - by_paper)
    return np.array([100 * part / scale for part in parts])


def sensor(table: Columns, row: int, design: Design) -> Design:
    """Return the sensor of a row of a table that was swept over a design."""
    names = ("L", "magnet_diameter", "magnet_height", "magnet_edge_radius")
    sizes: dict[str, Value] = {name: float(table[f"{name}_mm"][row]) for name in names if f"{name}_mm" in table}
    return varied(design, sizes | {"nu": float(table["nu"][row])})


def _poses(table: Columns, prefix: str, states: Array) -> tuple[Array, Array]:
    """Return shifts (n, 3), mm, and rotation vectors (n, 2), rad, of a model; NaN where it has none.

    A press moves the magnet along the axis only, and its columns across may be empty.
    """
    shift = np.column_stack([table[f"{prefix}_shift_{axis}_mm"][states] for axis in "xyz"]).astype(float)
    lean = np.column_stack([-table[f"{prefix}_tilt_y_rad"][states], table[f"{prefix}_tilt_rad"][states]]).astype(
        float
    )
    press = (table["shear_mm"][states] == 0) & np.isfinite(shift[:, 2])
    shift[press, :2], lean[press] = np.nan_to_num(shift[press, :2]), np.nan_to_num(lean[press])
    return shift, lean


def readings(design: Design, shift: Array, tilt: Array, field: hall.Field = "exact") -> Array:
    """Return B.n of the elements for poses, shape (n, elements), T."""
    points, directions = hall.elements(design)
    values = [
        hall.field_at(np.tile(point, (len(shift), 1)), design, shift, tilt, field=field) @ direction
        for point, direction in zip(points, directions, strict=True)
    ]
    return np.column_stack(values)


def split_means(parts: pd.DataFrame, by: list[str]) -> list[Row]:
    """Return root mean squares in % of full scale by some of load, magnet_height_over_D and slenderness."""
    known = parts[parts["total_percent_FS"].notna()]
    known = known.assign(
        load=np.where(known["shear_over_D"] != 0, "shear", "press"),
        slenderness=slender(known["L_over_D"].to_numpy()),
        **known[COLUMNS] ** 2,
    )
    groups = known.groupby(by, observed=True)
    states = groups[["L_over_D", "depth_over_D", "shear_over_D"]].apply(lambda own: len(own.drop_duplicates()))
    rms = groups[COLUMNS].mean() ** 0.5
    rms.insert(0, "states", states)
    return pages.records(rms.reset_index())
