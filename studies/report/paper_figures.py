"""Figures of the studies of the paper: assumption of a beam (verb assumption) and its claims (verb claims)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from analytic import beam
from studies.report.folder_contents import Table
from studies.report.report_figures import (
    ERROR_EDGES,
    Axis,
    Figure,
    Panel,
    error_guides,
    grouped,
    numbers,
    series,
)
from studies.simulation import beam_cells
from studies.simulation.beam_cells import Body, Cells, Columns, Kind

SHOWN_LEVELS = ("paper", "finite")
"""Levels of the formulas whose errors are mapped: the paper's and the best one; the table has all."""


def assumption(table: Table) -> list[Figure]:
    """Return maps of the errors of the formulas over L/D and load, a panel for each height of the magnet."""
    columns: Columns = {
        name: np.array(table.texts(name)) if name in ("status", "message", "friction") else table.floats(name)
        for name in table.columns
    }
    return list(_assumption_maps(table.name, columns))


def _assumption_maps(source: str, columns: Columns) -> Iterator[Figure]:
    """Yield the maps, quantity by quantity."""
    bodies = beam_cells.bodies(columns)
    nu = max(body.nu for body in bodies)
    levels = [name for name in SHOWN_LEVELS if name in beam.LEVELS and f"analytic_{name}_force_N" in columns]
    kinds: tuple[Kind, ...] = ("press", "shear")
    for kind in kinds:
        grids = [(body, beam_cells.cells(columns, body, kind)) for body in bodies if body.nu == nu]
        grids = [(body, grid) for body, grid in grids if grid.row.size]
        for quantity in beam_cells.QUANTITIES[kind] if grids else ():
            for level in levels:
                yield _assumption_map(source, columns, grids, kind, quantity, level)


def _assumption_map(
    source: str, columns: Columns, grids: list[tuple[Body, Cells]], kind: Kind, quantity: str, level: str
) -> Figure:
    """Return the map of one quantity and level."""
    across = sorted({round(float(value), 9) for _, grid in grids for value in grid.slenderness})
    loads = sorted({tuple(round(float(v), 9) for v in load) for _, grid in grids for load in grid.loads})
    panels, judged = [], []
    for body, grid in grids:
        values = beam_cells.errors(columns, grid, level, quantity)
        cells = np.full((len(loads), len(across)), np.nan)
        up = [loads.index(tuple(round(float(v), 9) for v in load)) for load in grid.loads]
        wide = [across.index(round(float(value), 9)) for value in grid.slenderness]
        cells[np.ix_(up, wide)] = values
        judged.append(values[np.isfinite(values)])
        panels.append(Panel(body.name, cells=tuple(numbers(row) for row in cells)))
    every = np.concatenate(judged)
    shares = [100 * float(np.mean(np.abs(every) <= bound)) if len(every) else 0.0 for bound in (5, 10)]
    caption = (
        f"Of {len(every)} cells {shares[0]:.0f} % are within 5 % and {shares[1]:.0f} % within 10 % of finite "
        "elements. Empty cells: the magnet does not fit, the solve stopped, or the beam gave way."
    )
    names = tuple(f"{d:.3g}" if kind == "press" else f"{d:.3g} / {s:.3g}" for d, s in loads)
    others = sorted({body.nu for body in beam_cells.bodies(columns)} - {grids[0][0].nu})
    more = ", ".join(f"{nu:g}" for nu in others)
    return Figure(
        f"Error of the {quantity}, level {level}",
        caption,
        Axis("L/D", categories=tuple(f"{value:.3g}" for value in across)),
        Axis("depth/D" if kind == "press" else "depth/D / shear/D", categories=names),
        tuple(panels),
        kind="map",
        value="error (%)",
        edges=ERROR_EDGES,
        source=source,
        replaces=(f"{quantity.replace(' ', '_')}.png",),
        notes=(f"Poisson's ratio {grids[0][0].nu:g}; the table also has {more}.",) if others else (),
    )


def readings(table: Table) -> list[Figure]:
    """Return how much of a reading's error is mechanics, tilt and field, over L/D."""
    names = {"mechanics_percent_FS": "mechanics", "tilt_percent_FS": "tilt", "dipole_percent_FS": "dipole as field"}
    panels = []
    element = table.texts("element")
    for which, rows in grouped(element).items():
        x = table.floats("L_over_D")[rows]
        parts = []
        for style, (column, name) in enumerate(names.items()):
            values = np.abs(table.floats(column)[rows])
            parts.append(series(name, x, np.where(values > 0, values, np.nan), style, line=False))
        panels.append(Panel(which, tuple(parts)))
    return [
        Figure(
            "Where errors of readings come from",
            "Each point is one state; the magnet's place (mechanics) dominates except where the field is a dipole's.",
            Axis("L/D"),
            Axis("error (% of full scale)", log=True),
            tuple(panels),
            source=table.name,
            replaces=("readings.png",),
        )
    ]


def heights(table: Table) -> list[Figure]:
    """Return the errors of the paper's force and voltage over the height of the magnet."""
    x = table.floats("magnet_height_mm")
    columns = {
        "error_percent_of_largest": "force, E = 1 MPa",
        "best_error_percent_of_largest": "force, best E for each height",
        "S1_error_percent": "voltage of S1, E = 1 MPa",
        "best_E_S1_error_percent": "voltage of S1, best E for each height",
    }
    parts = [series(name, x, table.floats(column), style) for style, (column, name) in enumerate(columns.items())]
    best = table.floats("error_percent_of_largest")
    within = [f"{h:g}" for h, value in zip(x, best, strict=True) if value <= 5]
    caption = (
        f"At E = 1 MPa the paper's force is within 5 % of the largest force for heights of {', '.join(within)} mm."
        if within
        else "At E = 1 MPa no height of the magnet brings the paper's force within 5 % of the largest force."
    )
    return [
        Figure(
            "Errors of force and voltage over the height of the magnet",
            caption,
            Axis("height of the magnet (mm)"),
            Axis("largest error (% of full scale)"),
            (Panel("", tuple(part for part in parts if part.y)),),
            guides=error_guides(5)[1:2],
            source=table.name,
        )
    ]


def presses(table: Table) -> list[Figure]:
    """Return the press force over depth for heights of the magnet."""
    height = table.floats("magnet_height_mm")
    few = np.unique(height)
    few = few[np.unique(np.linspace(0, len(few) - 1, 6).round().astype(int))]
    parts = [
        series(
            f"magnet {one:g} mm high" if one else "no magnet",
            table.floats("depth_mm")[height == one],
            table.floats("fem_force_N")[height == one],
            k,
        )
        for k, one in enumerate(few)
    ]
    last = [(one.name, one.y[-1]) for one in parts]
    caption = (
        f"A taller magnet stiffens the press: {last[0][1]:.3g} N with {last[0][0]}, {last[-1][1]:.3g} N with the "
    )
    caption += f"{last[-1][0]}, each at its deepest state."
    return [
        Figure(
            "Press force for heights of the magnet, finite elements",
            caption,
            Axis("depth (mm)"),
            Axis("press force (N)"),
            (Panel("", tuple(parts)),),
            source=table.name,
        )
    ]


def shears(table: Table) -> list[Figure]:
    """Return the force along the shear for conditions of the tip."""
    parts = []
    for style, (tip, rows) in enumerate(grouped(table.texts("tip")).items()):
        parts.append(series(tip, table.floats("shear_mm")[rows], table.floats("fem_force_x_N")[rows], style))
    return [
        Figure(
            "Force along the shear for conditions of the tip, finite elements",
            "How the tip is held decides the shear force.",
            Axis("shear (mm)"),
            Axis("force along the shear (N)"),
            (Panel("", tuple(parts)),),
            source=table.name,
        )
    ]
