"""Figures of the studies of the paper: assumption of a beam (verb assumption) and its claims (verb claims)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from studies.output.figures import ERROR_EDGES, Figure, Guide, Look, heat, long, numbers, plot, texts
from studies.simulation import beam_cells
from studies.simulation.beam_cells import Cells, Columns, Kind

if TYPE_CHECKING:
    import pandas as pd

SHOWN_LEVELS = ("paper", "finite")
"""Levels of the formulas whose errors are mapped: the paper's and the best one; the table has all."""


def assumption(table: pd.DataFrame, levels: tuple[str, ...] = SHOWN_LEVELS) -> list[Figure]:
    """Return maps of the errors of the formulas over L/D and load, a panel for each height of the magnet."""
    words = ("status", "message", "friction")
    columns: Columns = {
        name: (texts if name in words else numbers)(table, name).to_numpy() for name in map(str, table.columns)
    }
    known = [name for name in levels if name in beam.LEVELS and f"analytic_{name}_force_N" in columns]
    return list(_assumption_maps(columns, known))


def _assumption_maps(columns: Columns, levels: list[str]) -> Iterator[Figure]:
    """Yield the maps, quantity by quantity."""
    bodies = beam_cells.bodies(columns)
    nu = max(body.nu for body in bodies)
    kinds: tuple[Kind, ...] = ("press", "shear")
    for kind in kinds:
        grids = [beam_cells.cells(columns, body, kind) for body in bodies if body.nu == nu]
        grids = [grid for grid in grids if grid.row.size]
        for quantity in beam_cells.QUANTITIES[kind] if grids else ():
            for level in levels:
                yield error_map(columns, grids, quantity, level)


def error_map(columns: Columns, grids: Sequence[Cells], quantity: str, level: str) -> Figure:
    """Return the map of the errors of one quantity by one level, a panel for each of the grids."""
    error = "error (%)"
    data, axes = map_cells(grids, lambda grid: beam_cells.errors(columns, grid, level, quantity), error)
    judged = data[error].dropna().abs()
    shares = [100 * float((judged <= bound).mean()) if len(judged) else 0.0 for bound in (5, 10)]
    caption = (
        f"Of {len(judged)} cells {shares[0]:.0f} % are within 5 % and {shares[1]:.0f} % within 10 % of finite "
        "elements. Empty cells: the magnet does not fit, or the level has no answer."
    )
    nu = grids[0].body.nu
    others = ", ".join(f"{other:g}" for other in sorted({body.nu for body in beam_cells.bodies(columns)} - {nu}))
    if others:
        caption += f" Poisson's ratio {nu:g}; the table also has {others}."
    return heat(
        f"Error of the {quantity}, level {level}", caption, data, axes, error, edges=ERROR_EDGES, marked=MARKED
    )


MARKED = {
    "failed": "Crosses: the solve stopped, or the beam gave way.",
    "doubted": "Dots: a tip that is free to slide has buckled sideways before; these presses hold it on the axis.",
}
"""What the marks of cells mean."""


def map_cells(
    grids: Sequence[Cells], values: Callable[[Cells], NDArray[Any]], name: str
) -> tuple[pd.DataFrame, tuple[str, str]]:
    """Return the cells of grids as the table of a map, a panel for each, and its axes.

    Parameters
    ----------
    values : of the cells of a grid, shape (loads, lengths).
    name : column of the values.
    """
    import pandas as pd

    press = grids[0].kind == "press"
    load = "depth/D" if press else "depth/D / shear/D"
    parts = []
    for grid in grids:
        cells = values(grid)
        line, place = (k.ravel() for k in np.indices(cells.shape))
        part = {"depth": grid.loads[line, 0], "shear": grid.loads[line, 1], "L/D": grid.slenderness[place].round(3)}
        part |= {name: cells.ravel(), "failed": ((grid.possible & ~grid.answered) | grid.gave_way).ravel()}
        part |= {"doubted": (grid.leans & grid.judged).ravel()} if press else {}
        parts.append(pd.DataFrame(part).assign(panel=grid.body.name))
    data = pd.concat(parts, ignore_index=True).sort_values(["depth", "shear"], kind="stable", ignore_index=True)
    pairs = zip(data["depth"], data["shear"], strict=True)
    data[load] = [float(f"{d:.3g}") if press else f"{d:.3g} / {s:.3g}" for d, s in pairs]
    order = [grid.body.name for grid in grids]
    data = data.sort_values("panel", kind="stable", key=lambda names: names.map(order.index))
    flags = ["failed", *(["doubted"] if press else [])]
    return data[["panel", "L/D", load, name, *flags]], ("L/D", load)


def readings(table: pd.DataFrame) -> list[Figure]:
    """Return how much of a reading's error is mechanics, tilt and field, over L/D."""
    names = {"mechanics_percent_FS": "mechanics", "tilt_percent_FS": "tilt", "dipole_percent_FS": "dipole as field"}
    y = "error (% of full scale)"
    data = long(table, ("L_over_D", "L/D"), y, names)
    data["panel"] = [*texts(table, "element")] * (len(data) // max(len(table), 1))
    data[y] = data[y].abs().where(data[y] != 0)
    caption = (
        "Each point is one state; the magnet's place (mechanics) dominates except where the field is a dipole's."
    )
    return [plot("Where errors of readings come from", caption, data, "L/D", y, Look(line=False, log="y"))]


def heights(table: pd.DataFrame) -> list[Figure]:
    """Return the errors of the paper's force and voltage over the height of the magnet."""
    columns = {
        "error_percent_of_largest": "force, E = 1 MPa",
        "best_error_percent_of_largest": "force, best E for each height",
        "S1_error_percent": "voltage of S1, E = 1 MPa",
        "best_E_S1_error_percent": "voltage of S1, best E for each height",
    }
    x, y = "height of the magnet (mm)", "largest error (% of full scale)"
    within = numbers(table, "magnet_height_mm")[numbers(table, "error_percent_of_largest") <= 5]
    caption = (
        "At E = 1 MPa the paper's force is within 5 % of the largest force for heights of "
        f"{', '.join(map('{:g}'.format, within))} mm."
        if len(within)
        else "At E = 1 MPa no height of the magnet brings the paper's force within 5 % of the largest force."
    )
    look = Look(guides=(Guide("y", 5.0, "5 %"),))
    data = long(table, ("magnet_height_mm", x), y, columns)
    return [plot("Errors of force and voltage over the height of the magnet", caption, data, x, y, look)]


def presses(table: pd.DataFrame) -> list[Figure]:
    """Return the press force over depth for heights of the magnet."""
    import pandas as pd

    every = np.unique(numbers(table, "magnet_height_mm"))
    few = every[np.unique(np.linspace(0, len(every) - 1, 6).round().astype(int))]
    rows = table[numbers(table, "magnet_height_mm").isin(few)].sort_values("magnet_height_mm", kind="stable")
    names = [f"magnet {one:g} mm high" if one else "no magnet" for one in numbers(rows, "magnet_height_mm")]
    x, y = "depth (mm)", "press force (N)"
    data = pd.DataFrame({x: numbers(rows, "depth_mm"), y: numbers(rows, "fem_force_N"), "series": names})
    last = data.groupby("series", sort=False)[y].last()
    caption = (
        f"A taller magnet stiffens the press: {last.iloc[0]:.3g} N with {last.index[0]}, {last.iloc[-1]:.3g} N with "
        f"the {last.index[-1]}, each at its deepest state."
    )
    return [plot("Press force for heights of the magnet, finite elements", caption, data, x, y)]


def shears(table: pd.DataFrame) -> list[Figure]:
    """Return the force along the shear for conditions of the tip."""
    import pandas as pd

    x, y = "shear (mm)", "force along the shear (N)"
    data = pd.DataFrame(
        {x: numbers(table, "shear_mm"), y: numbers(table, "fem_force_x_N"), "series": texts(table, "tip")}
    )
    title = "Force along the shear for conditions of the tip, finite elements"
    return [plot(title, "How the tip is held decides the shear force.", data, x, y)]
