"""Maps of the formulas' errors over L/D and load, for each level and each height of the magnet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from geometry.arrays import Array
from studies.output.figures import COLOURS, Figure, Look, heat, plot, save, table_of
from studies.simulation.beam_cells import QUANTITIES, Cells, Columns, all_errors
from studies.validation.pages import Row
from studies.validation.reading_split import PARTS
from studies.web.paper_figures import MARKED, error_map, map_cells

LARGE = 10.0
"""Error, %, beyond which the map of the best level shows none."""


class Picture(NamedTuple):
    """What draws a picture, and the text below it in the report."""

    draw: Callable[[Path], None]
    text: str


def pictures(table: Columns, grids: Sequence[Cells], means: Sequence[Row]) -> dict[str, Picture]:
    """Return all maps by the names of their files."""
    nu = max(grid.body.nu for grid in grids)
    main = [grid for grid in grids if grid.body.nu == nu]
    found = {}
    for kind, quantities in QUANTITIES.items():
        own = [grid for grid in main if grid.kind == kind]
        for quantity in quantities if own else ():
            text = f"Error of the {quantity} in a {kind}, by level and height of the magnet, nu = {nu:g}."
            draw = partial(_save_errors, table=table, grids=own, quantity=quantity)
            found[f"{quantity.replace(' ', '_')}.png"] = Picture(draw, text)
    best = f"The level of least error in each cell; grey: even that error exceeds {LARGE:g} %."
    found["best_level.png"] = Picture(lambda path: save(path, best_maps(table, main)), best)
    if means:
        parts = "Root mean squares of the parts of the readings' error, by height of the magnet and L/D."
        found["readings.png"] = Picture(lambda path: save(path, [split(means)]), parts)
    return found


def _save_errors(path: Path, table: Columns, grids: Sequence[Cells], quantity: str) -> None:
    save(path, [error_map(table, grids, quantity, level) for level in beam.LEVELS])


def best_levels(errors: Mapping[str, Array]) -> tuple[NDArray[np.int64], Array]:
    """Return the index of the level of least error in each cell, -1 without any, and the size of that error, %."""
    sizes = np.abs(np.array(list(errors.values())))
    known = np.isfinite(sizes).any(axis=0)
    filled = np.where(np.isfinite(sizes), sizes, np.inf)
    return np.where(known, filled.argmin(axis=0), -1), np.where(known, filled.min(axis=0), np.nan)


def best_maps(table: Columns, grids: Sequence[Cells]) -> list[Figure]:
    """Return maps of the level of least error in each cell, for the press force and the shear force."""
    value = "level of least error"
    names = np.array([*beam.LEVELS, "none", None], dtype=object)
    colours = dict(zip(names[:-1].tolist(), [*COLOURS[: len(beam.LEVELS)], "#bbbbbb"], strict=True))

    def best(grid: Cells, quantity: str) -> NDArray[Any]:
        index, size = best_levels(all_errors(table, grid, quantity))
        return np.asarray(names[np.where((index >= 0) & (size > LARGE), -2, index)])

    figures = []
    for kind, quantity in (("press", "press force"), ("shear", "shear force")):
        own = [grid for grid in grids if grid.kind == kind]
        if own:
            data, axes = map_cells(own, partial(best, quantity=quantity), value)
            figures.append(
                heat(f"Level of least error, {quantity}", "", data, axes, value, colours=colours, marked=MARKED)
            )
    return figures


def split(means: Sequence[Row]) -> Figure:
    """Return the parts of the readings' errors: a panel for each kind of load, the sensors side by side."""
    x, y = "height of the magnet, and L/D", "error (% of full scale)"
    rows = [
        {
            x: f"{row['magnet_height_over_D']:.3g} D, {row['slenderness']}",
            y: row[f"{part}_percent_FS"] or np.nan,
            "panel": row["load"],
            "series": part,
        }
        for row in means
        for part in PARTS
    ]
    return plot("Parts of the errors of readings", "", table_of(rows), x, y, Look(line=False, log="y", columns=1))
