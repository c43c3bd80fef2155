"""Maps of the formulas' errors over L/D and load, for each level and each height of the magnet."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analytic import beam
from geometry.arrays import Array
from studies.output.table_plots import COLOURS, sheet
from studies.simulation.beam_cells import QUANTITIES, Body, Cells, Columns, Kind, all_errors
from studies.validation.pages import Row
from studies.validation.reading_split import PARTS

BOUNDS = (-100, -50, -20, -10, -5, 5, 10, 20, 50, 100)
"""Bounds of the colours, %."""
SMALL = {"font.size": 9, "axes.labelsize": 9, "xtick.labelsize": 7.5, "ytick.labelsize": 7.5, "legend.fontsize": 9}
NAMES: dict[Kind, str] = {"press": "d/D", "shear": "d/D, shear/D"}


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
        for quantity in quantities:
            text = f"Error of the {quantity} in a {kind}, by level and height of the magnet, nu = {nu:g}."
            draw = partial(error_map, table=table, grids=own, quantity=quantity)
            found[f"{quantity.replace(' ', '_')}.png"] = Picture(draw, text)
    best = "The level of least error in each cell; dots: even that error exceeds 10 %."
    found["best_level.png"] = Picture(partial(best_map, table=table, grids=main), best)
    if means:
        parts = (
            "Root mean squares of the parts of the readings' error, % of full scale, by height of the magnet and "
            "L/D; parts below 0.1 % have no bar."
        )
        found["readings.png"] = Picture(partial(split_bars, means=means), parts)
    return found


def error_map(path: Path, table: Columns, grids: Sequence[Cells], quantity: str) -> None:
    """Draw the errors of one quantity: a row of panels for each level, a column for each height of the magnet."""
    import matplotlib as mpl
    from matplotlib.colors import BoundaryNorm

    norm, colours = BoundaryNorm(BOUNDS, 256, extend="both"), mpl.colormaps["PuOr_r"]
    with _panels(path, len(beam.LEVELS), grids) as (figure, panels):
        for column, grid in enumerate(grids):
            for row, (level, error) in enumerate(all_errors(table, grid, quantity).items()):
                axis = panels[row][column]
                drawn = axis.pcolormesh(
                    np.ma.masked_invalid(error), cmap=colours, norm=norm, edgecolors="white", lw=0.3
                )
                _mark(axis, grid)
                if column == 0:
                    axis.set_ylabel(f"level {level}\n{NAMES[grid.kind]}")
        bar = figure.colorbar(drawn, ax=[axis for line in panels for axis in line], ticks=BOUNDS, aspect=50, pad=0.01)
        bar.set_label(f"error of the {quantity} (%)")
        figure.legend(handles=_hatches(grids), loc="outside lower center", ncols=2, frameon=False)


def best_levels(errors: Mapping[str, Array]) -> tuple[NDArray[np.int64], Array]:
    """Return the index of the level of least error in each cell, -1 without any, and the size of that error, %."""
    sizes = np.abs(np.array(list(errors.values())))
    known = np.isfinite(sizes).any(axis=0)
    filled = np.where(np.isfinite(sizes), sizes, np.inf)
    return np.where(known, filled.argmin(axis=0), -1), np.where(known, filled.min(axis=0), np.nan)


def best_map(path: Path, table: Columns, grids: Sequence[Cells]) -> None:
    """Draw the level of least error in each cell, for the press force and the shear force."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    chosen = [
        (quantity, [g for g in grids if g.kind == kind])
        for kind, quantity in (("press", "press force"), ("shear", "shear force"))
    ]
    chosen = [(quantity, own) for quantity, own in chosen if own]
    colours = COLOURS[: len(beam.LEVELS)]
    with _panels(path, len(chosen), chosen[0][1]) as (figure, panels):
        for row, (quantity, own) in enumerate(chosen):
            for column, grid in enumerate(own):
                axis = panels[row][column]
                index, size = best_levels(all_errors(table, grid, quantity))
                shown = np.ma.masked_less(index, 0)
                axis.pcolormesh(
                    shown,
                    cmap=ListedColormap(colours),
                    vmin=-0.5,
                    vmax=len(colours) - 0.5,
                    edgecolors="white",
                    lw=0.3,
                )
                _mark(axis, grid, leans=False)
                at = np.argwhere(size > 10)
                axis.plot(at[:, 1] + 0.5, at[:, 0] + 0.5, "o", color="black", markersize=2)
                if column == 0:
                    axis.set_ylabel(f"{quantity}\n{NAMES[grid.kind]}")
        handles = [Patch(color=colour, label=level) for colour, level in zip(colours, beam.LEVELS, strict=True)]
        figure.legend(handles=[*handles, *_hatches(grids)[1:]], loc="outside lower center", ncols=3, frameon=False)


@contextlib.contextmanager
def _panels(path: Path, rows: int, grids: Sequence[Cells]) -> Iterator[tuple[Any, list[list[Any]]]]:
    """Yield a figure with a column of panels for each height of the magnet, and write it at the end."""
    columns = len({grid.body for grid in grids})
    style = {**SMALL, "axes.grid": False, "hatch.linewidth": 0.5}
    with sheet(path, 1.1 + 1.35 * columns, 0.9 + 1.45 * rows, dpi=200, style=style) as figure:
        panels = figure.subplots(rows, columns, squeeze=False)
        yield figure, panels.tolist()
        for row, line in enumerate(panels):
            for column, axis in enumerate(line):
                if row == 0:
                    axis.set_title(_title(grids[column].body), fontsize=9)
                if row == rows - 1:
                    axis.set_xlabel("L/D")
                else:
                    axis.set_xticklabels([])
                if column:
                    axis.set_yticklabels([])


def _title(body: Body) -> str:
    return f"magnet {body.height:.3g} D" if body.height else "no magnet"


def _mark(axis: Any, grid: Cells, *, leans: bool = True) -> None:
    """Hatch the cells without an answer, and label lengths and loads."""
    from matplotlib.patches import Rectangle

    axis.set_facecolor("#cccccc")
    marks = (
        (grid.possible & ~grid.answered, "xxxx"),
        (grid.gave_way, "////"),
        (grid.leans & grid.judged & leans, "...."),
    )
    for flags, hatch in marks:
        for line, column in np.argwhere(flags).tolist():
            axis.add_patch(Rectangle((column, line), 1, 1, fill=False, hatch=hatch, lw=0, edgecolor="#444444"))
    lengths, loads = grid.slenderness, grid.loads
    axis.set_xticks(np.arange(len(lengths)) + 0.5, [f"{ratio:.3g}" for ratio in lengths], rotation=90)
    names = [f"{d:.2g}" if grid.kind == "press" else f"{d:.2g}, {s:.2g}" for d, s in loads]
    axis.set_yticks(np.arange(len(loads)) + 0.5, names)


def _hatches(grids: Sequence[Cells]) -> list[Any]:
    """Return legend entries for the hatches that occur."""
    from matplotlib.patches import Patch

    kinds = {grid.kind for grid in grids}
    marks = [
        ("....", "a tip free to slide has buckled", "press" in kinds),
        ("////", "the beam gives way", "shear" in kinds),
    ]
    handles = [
        Patch(facecolor="white", edgecolor="#444444", hatch=hatch, label=text)
        for hatch, text, known in marks
        if known
    ]
    failed = any((grid.possible & ~grid.answered).any() for grid in grids)
    if failed:
        handles.append(Patch(facecolor="#cccccc", edgecolor="#444444", hatch="xxxx", label="not reached by FEM"))
    return [*handles, Patch(facecolor="#cccccc", label="impossible, or no formula")]


def split_bars(path: Path, means: Sequence[Row]) -> None:
    """Draw the parts of the readings' errors: a panel for each kind of load, a group of bars for each sensor."""
    kinds = list(dict.fromkeys(row["load"] for row in means))
    with sheet(path, 7.5, 0.8 + 2.3 * len(kinds), dpi=200, style=SMALL) as figure:
        for axis, load in zip(figure.subplots(len(kinds), 1, squeeze=False).ravel(), kinds, strict=True):
            own = [row for row in means if row["load"] == load]
            for k, (part, colour) in enumerate(zip(PARTS, COLOURS, strict=False)):
                heights = [row[f"{part}_percent_FS"] for row in own]
                axis.bar(np.arange(len(own)) + 0.17 * (k - 2), heights, 0.17, color=colour, label=part)
            names = [f"{row['magnet_height_over_D']:.3g} D\n{row['slenderness'].removeprefix('L/D ')}" for row in own]
            axis.set_xticks(np.arange(len(own)), names)
            axis.set(yscale="log", ylim=(0.1, 3000), ylabel="error (% of full scale)", title=load)
        axis.set_xlabel("height of the magnet, and L/D")
        figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False)
