"""Where does the beam assumption hold? A sweep over designs and loads, regions within 5 and 10 %, and findings.

The sweep is a study file; the shipped one is `studies/examples/beam_assumption.toml`. Its models must be one
finite-element model and all levels of the formulas, and its axes L, the size of the magnet, nu, depth and shear. The
findings are in templates/assumption_findings.j2.

The errors of the paper's readings are split. The paper's reading is that of an upright magnet at the position by its
formulas, in the field by equation (3). The true one is that of the finite elements' pose in the exact field. The
difference is the sum of three parts:

    field       the paper's field less the exact one, at the paper's pose
    mechanics   the exact reading at the paper's position less that at the finite elements' position, both upright
    tilt        the exact reading of the upright magnet less that of the tilted one, at the finite elements' position

All are in % of full scale: the largest change from rest that the finite elements give a sensor in the table, for S2
and S3 together. `dipole` is what a dipole in place of (3) would add to the field part. The elements stay where they
are in the base of the sensor; L changes the distance to the magnet. A state whose pose is unknown has no parts.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analytic import beam, hall
from analytic.parts import of_design
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.inputs.user_input import Value
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import Cases, Plan, varied
from studies.output.figures import COLOURS, Figure, Look, heat, plot, save, table_of
from studies.output.result import Result, Table
from studies.simulation import beam_cells
from studies.simulation.beam_cells import QUANTITIES, Body, Bools, Cells, Columns, all_errors, errors
from studies.sweeps import sweep_request
from studies.sweeps.study_rows import flat_rows
from studies.validation import pages
from studies.validation.pages import Row
from studies.web.paper_figures import MARKED, error_map, map_cells

STUDY = Path(__file__).resolve().parents[1] / "examples" / "beam_assumption.toml"
"""The shipped study."""
CELL, WITH_HEIGHT = ("L", "magnet_height", "nu", "depth", "shear"), ("magnet_diameter", "magnet_edge_radius")
"""Axes that make a cell, and those that may follow the magnet's height."""
FILES = (
    *("ASSUMPTION.md", "sweep.csv", "shares.csv", "best.csv", "readings.csv"),
    *("press_force.png", "sinking.png", "shear_force.png", "sideways_shift.png", "tilt.png"),
    *("best_level.png", "readings.png"),
)
BOUNDS = (5.0, 10.0)
"""Errors that bound a region, %; the map of the best level shows none beyond the second."""
FORMULAS = {"press force": "formula (5)", "shear force": "formula (6)"}
DEPTHS, BODIES = (0.06, 0.2), (0.0, 0.25)
"""Depths and heights of the magnet, over D, that part regions; a press up to the first is called light."""


def plan_of(study: Path) -> Plan:
    """Return the plan of a study file; BadInput if it lacks a model or an axis."""
    plan = sweep_request.plan_of(str(study), sweep_request.Options())
    why, allowed = "", (*CELL, *WITH_HEIGHT)
    if len(plan.fem) != 1 or not set(beam.LEVELS) <= set(plan.formulas):
        why = f"must have one finite-element model and all levels of the formulas ({', '.join(beam.LEVELS)}): "
        why += "change its models"
    elif other := ", ".join(name for name in plan.axes if name not in allowed):
        why = f"has the axis {other}; its axes may be {', '.join(allowed)}: "
        why += f"give {other} one value in [design] or [load]"
    elif lacking := ", ".join(name for name in CELL if name not in plan.axes):
        why = f"lacks the axis {lacking}: add it, with one value if fixed"
    elif not {"force", "shift", "tilt"} <= set(plan.quantities):
        why = "needs the quantities force, shift and tilt: add them"
    else:
        axes = Cases(plan).batch(np.arange(plan.count)).axes
        places = np.unique(np.column_stack([np.asarray(axes[name], dtype=float) for name in CELL]), axis=0)
        if len(places) < plan.count:
            why = f"has {plan.count} cases of {len(places)} different {', '.join(CELL)}; each may have one case: zip "
            why += f"{' and '.join(WITH_HEIGHT)} with magnet_height"
    if why:
        raise BadInput(f"the study {str(study)!r} {why}")
    return plan


def run(progress: Progress, plan: Plan, processes: Processes = Processes(), store: Path | None = None) -> Result:
    """Run the sweep of a plan and return what follows from it."""
    with sweep_request.sweep(plan, None, progress, processes, store) as batches:
        tables = list(batches)
    return result({name: np.concatenate([each[name] for each in tables]) for name in tables[0]}, plan.design)


def result(table: Columns, design: Design) -> Result:
    pairs = product(beam_cells.bodies(table), QUANTITIES)
    grids = [grid for body, kind in pairs if (grid := beam_cells.cells(table, body, kind)).row.size]
    nu = max(grid.body.nu for grid in grids)
    main = [grid for grid in grids if grid.body.nu == nu]
    shares, best = share_rows(table, grids), best_rows(table, main)
    parts = split_cells(table, main, design)
    means = split_means(parts, ["load", "magnet_height_over_D", "slenderness"])
    sentences = findings(table, grids, shares, split_means(parts, ["load", "slenderness"]))
    pictures = maps(table, main, means)
    chosen = [row for row in shares if row["nu"] == nu and row["level"] in ("paper", "finite")]
    page = {"design": design, "sentences": sentences, "nu": nu, "best": best, "means": means}
    page["pictures"] = {name: text for name, (_, text) in pictures.items()}
    page["shares"] = [{name: value for name, value in row.items() if name != "nu"} for row in chosen]
    first = ("quantity", "level", "magnet_height_over_D", "within_10_percent")
    shown = Table(title="Share of the cells within 5 and 10 %", rows=shares, first=first)
    return Result(
        title=shown.title,
        records=shares,
        shown=[shown, *sentences],
        tables={
            "shares": shares,
            "best": best,
            "readings": pages.records(parts),
            "sweep": list(flat_rows(table)),
        },
        files={name: partial(save, figures=figures) for name, (figures, _) in pictures.items()},
        pages={"ASSUMPTION.md": pages.rendered("assumption.md.j2", **page)},
    )


# Regions


class Block(NamedTuple):
    """Neighbouring lengths and loads: first and last index of each."""

    first_load: int
    last_load: int
    first_length: int
    last_length: int

    @property
    def size(self) -> int:
        return (self.last_load - self.first_load + 1) * (self.last_length - self.first_length + 1)


def share(error: Array, bound: float) -> float:
    """Return the share of the known errors that are within a bound, %; NaN without any.

    >>> share(np.array([-3.0, 7.0, np.nan, 20.0, 1.0]), 5.0)
    50.0
    """
    known = np.isfinite(error)
    return 100 * float((np.abs(error[known]) <= bound).mean()) if known.any() else math.nan


def largest_block(inside: Bools) -> Block | None:
    """Return the largest block of neighbouring cells that are all inside; None if no cell is.

    Among equally large blocks the one with more lengths is taken.
    """
    best: Block | None = None
    loads, lengths = inside.shape
    for first in range(loads):
        # columns that are inside in all rows from the first to the last one
        whole = np.ones(lengths, dtype=np.bool_)
        for last in range(first, loads):
            whole &= inside[last]
            edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(np.int8)))
            for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
                block = Block(first, last, begin, end - 1)
                if best is None or (block.size, end - 1 - begin) > (best.size, best.last_length - best.first_length):
                    best = block
    return best


def block_text(grid: Cells, inside: Bools) -> str:
    """Return the largest block inside in words, such as "L/D 2 to 6, d/D 0.08 to 0.2"; "nowhere" for none."""
    block = largest_block(inside)
    if block is None:
        return "nowhere"

    def span(low: float, high: float) -> str:
        return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"

    slender = span(grid.slenderness[block.first_length], grid.slenderness[block.last_length])
    first, last = grid.loads[block.first_load], grid.loads[block.last_load]
    if grid.kind == "press":
        return f"L/D {slender}, d/D {span(first[0], last[0])}"
    if first[0] == last[0]:
        return f"L/D {slender}, d/D {first[0]:.3g}, shear/D {span(first[1], last[1])}"
    states = f"from d/D {first[0]:.3g}, shear/D {first[1]:.3g} to d/D {last[0]:.3g}, shear/D {last[1]:.3g}"
    return f"L/D {slender}, {states}"


def share_rows(table: Columns, grids: Sequence[Cells]) -> list[Row]:
    """Return a row for each quantity, level and body: shares of the judged cells within the bounds, errors, blocks.

    `leaning_of_these_percent` is the share of the cells within 10 % that are deeper than the critical depth of a free
    tip; a block is the largest one of neighbouring cells within the bound, in words.
    """
    rows = []
    for grid in grids:
        for quantity, level in product(QUANTITIES[grid.kind], beam.LEVELS):
            error = errors(table, grid, level, quantity)
            known = error[np.isfinite(error)]
            if not len(known):
                continue
            near = [np.abs(error) <= bound for bound in BOUNDS]
            leaning = 100 * float(grid.leans[near[1]].mean()) if near[1].any() else math.nan
            row = {"quantity": quantity, "level": level, "magnet_height_over_D": grid.body.height, "nu": grid.body.nu}
            row |= {"cells": len(known), "within_5_percent": share(error, BOUNDS[0])}
            row |= {"within_10_percent": share(error, BOUNDS[1]), "leaning_of_these_percent": leaning}
            row["median_error_percent"] = float(np.median(np.abs(known)))
            row["largest_error_percent"] = float(known[np.abs(known).argmax()])
            row |= {
                f"within_{bound:g}_block": block_text(grid, each) for bound, each in zip(BOUNDS, near, strict=True)
            }
            rows.append(row)
    return rows


def regions(grid: Cells) -> pd.DataFrame:
    """Return body, slenderness and depth of each cell in words, in the order of its rows."""

    def classes(values: Array, edges: tuple[float, float], names: Sequence[str]) -> pd.Categorical:
        return pd.Categorical.from_codes((values > edges[0]).astype(int) + (values > edges[1]), names)

    height, (depth, ratio) = grid.body.height, np.meshgrid(grid.loads[:, 0], grid.slenderness, indexing="ij")
    bodies = ("no magnet", f"magnet to {BODIES[1]:g} D", "taller magnet")
    names = (f"d/D to {DEPTHS[0]:g}", f"d/D {DEPTHS[0]:g} to {DEPTHS[1]:g}", f"d/D above {DEPTHS[1]:g}")
    return pd.DataFrame(
        {
            "body": classes(np.full(depth.size, height), BODIES, bodies),
            "slenderness": slender(ratio.ravel()),
            "depth": classes(depth.ravel(), DEPTHS, names),
        }
    )


def best_rows(table: Columns, grids: Sequence[Cells]) -> list[Row]:
    """Return the best level in each region: body, slenderness and depth; regions without a cell are left out.

    The best level has the least root mean square error in the cells that every level answers; `best_in_percent` is
    the share of these in which it has the least error of all levels.
    """
    rows: list[Row] = []
    for quantity in (name for names in QUANTITIES.values() for name in names):
        own = [grid for grid in grids if quantity in QUANTITIES[grid.kind]]
        found = [{level: each.ravel() for level, each in all_errors(table, grid, quantity).items()} for grid in own]
        parts = [regions(grid).assign(**levels) for grid, levels in zip(own, found, strict=True)]
        cells = pd.concat(parts).dropna() if parts else pd.DataFrame(columns=["body", "slenderness", "depth"])
        for region, group in cells.groupby(["body", "slenderness", "depth"], observed=True):
            levels = group[list(beam.LEVELS)]
            rms = (levels**2).mean() ** 0.5
            best = str(rms.idxmin())
            row: Row = {"quantity": quantity, "region": ", ".join(region), "cells": len(levels)}
            row |= {"best_level": best, "rms_error_percent": float(rms[best])}
            row["within_10_percent"] = share(levels[best].to_numpy(), 10.0)
            row["best_in_percent"] = 100 * float((levels.abs().idxmin(axis=1) == best).mean())
            row["paper_rms_error_percent"] = float(rms["paper"])
            rows.append(row | {"paper_within_10_percent": share(levels["paper"].to_numpy(), 10.0)})
    return rows


# Maps

Pictures = dict[str, tuple[Sequence[Figure], str]]
"""Figures and the text below them, by the name of their file."""


def maps(table: Columns, grids: Sequence[Cells], means: Sequence[Row]) -> Pictures:
    """Return the maps of the errors, of the best level, and the parts of the readings' errors."""
    found: Pictures = {}
    nu = grids[0].body.nu
    for kind, quantities in QUANTITIES.items():
        own = [grid for grid in grids if grid.kind == kind]
        for quantity in quantities if own else ():
            text = f"Error of the {quantity} in a {kind}, by level and height of the magnet, nu = {nu:g}."
            figures = [error_map(table, own, quantity, level) for level in beam.LEVELS]
            found[f"{quantity.replace(' ', '_')}.png"] = figures, text
    best = f"The level of least error in each cell; grey: even that error exceeds {BOUNDS[1]:g} %."
    found["best_level.png"] = best_maps(table, grids), best
    if means:
        parts = "Root mean squares of the parts of the readings' error, by height of the magnet and L/D."
        found["readings.png"] = [split_figure(means)], parts
    return found


def best_levels(grid: Cells, table: Columns, quantity: str) -> NDArray[Any]:
    """Return the level of least error in each cell, "none" where even that exceeds the bound, None without any."""
    errors = all_errors(table, grid, quantity)
    sizes = np.abs(np.array(list(errors.values())))
    least = np.where(np.isfinite(sizes), sizes, np.inf)
    names = np.array([*errors, "none", None], dtype=object)
    index = np.where(least.min(axis=0) > BOUNDS[1], -2, least.argmin(axis=0))
    return np.asarray(names[np.where(np.isfinite(sizes).any(axis=0), index, -1)])


def best_maps(table: Columns, grids: Sequence[Cells]) -> list[Figure]:
    """Return maps of the level of least error in each cell, for the press force and the shear force."""
    value, figures = "level of least error", []
    colours = dict(zip([*beam.LEVELS, "none"], [*COLOURS[: len(beam.LEVELS)], "#bbbbbb"], strict=True))
    for kind, quantity in (("press", "press force"), ("shear", "shear force")):
        if own := [grid for grid in grids if grid.kind == kind]:
            data, axes = map_cells(own, partial(best_levels, table=table, quantity=quantity), value)
            title = f"Level of least error, {quantity}"
            figures.append(heat(title, "", data, axes, value, colours=colours, marked=MARKED))
    return figures


def split_figure(means: Sequence[Row]) -> Figure:
    """Return the parts of the readings' errors: a panel for each kind of load, the sensors side by side."""
    x, y = "height of the magnet, and L/D", "error (% of full scale)"
    data = table_of(
        {x: f"{row['magnet_height_over_D']:.3g} D, {row['slenderness']}", y: row[f"{part}_percent_FS"] or np.nan}
        | {"panel": row["load"], "series": part}
        for row, part in product(means, PARTS)
    )
    return plot("Parts of the errors of readings", "", data, x, y, Look(line=False, log="y", columns=1))


# Findings


def findings(table: Columns, grids: Sequence[Cells], shares: Sequence[Row], readings: Sequence[Row]) -> list[str]:
    """Return what the tables do not show, in sentences: where the paper's formulas hold, readings, failures."""
    nu = max(grid.body.nu for grid in grids)
    main = [row for row in shares if row["nu"] == nu]
    presses, shears = ([grid for grid in grids if grid.kind == kind] for kind in ("press", "shear"))

    def within(quantity: str) -> dict[str, float]:
        """Return the share of all cells within 10 %, by the name of the formula."""
        found = {}
        for level, name in (("paper", FORMULAS[quantity]), ("finite", "level finite")):
            own = [row for row in main if (row["quantity"], row["level"]) == (quantity, level)]
            if cells := sum(row["cells"] for row in own):
                found[name] = sum(row["cells"] * row["within_10_percent"] for row in own) / cells
        return found

    def known(own: Sequence[Cells], quantity: str, deepest: float) -> Array:
        """Return the errors of the paper's formula in cells up to a depth over D."""
        parts = [
            errors(table, grid, "paper", quantity)[grid.loads[:, 0] <= deepest].ravel()
            for grid in own
            if grid.body.nu == nu
        ]
        found = np.concatenate([np.empty(0), *parts])
        return np.asarray(found[np.isfinite(found)])

    def count(own: Sequence[Cells], flags: Callable[[Cells], Bools]) -> int:
        return sum(int(flags(grid).sum()) for grid in own)

    text = pages.filled(
        (pages.TEMPLATES / "assumption_findings.j2").read_text("utf-8"),
        overall=[(quantity, within(quantity)) for quantity in FORMULAS],
        bodies=[
            row | {"body": Body(row["magnet_height_over_D"], nu).name, "formula": FORMULAS[quantity]}
            for quantity, row in product(FORMULAS, main)
            if (row["quantity"], row["level"]) == (quantity, "paper")
        ],
        shallow=DEPTHS[0],
        light=known(presses, "press force", DEPTHS[0]),
        sheared=known(shears, "shear force", math.inf),
        readings=readings,
        shortest=SLENDER[0],
        leaning=count(presses, lambda grid: np.asarray(grid.leans & grid.judged)),
        judged=count(presses, lambda grid: grid.judged),
        given=count(shears, lambda grid: grid.gave_way),
        answered=count(shears, lambda grid: grid.answered),
        failed=count(grids, lambda grid: np.asarray(grid.possible & ~grid.answered)),
        impossible=count(grids, lambda grid: np.asarray(~grid.possible)),
        cells=sum(grid.row.size for grid in grids),
    )
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


# Parts of the errors of readings

PARTS = ("total", "mechanics", "tilt", "field", "dipole")
COLUMNS, LOADS = [f"{part}_percent_FS" for part in PARTS], ("depth", "shear")


SLENDER = ("L/D below 1.1", "L/D 1.1 to 2", "L/D above 2")


def slender(ratio: Array) -> pd.Categorical:
    return pd.Categorical.from_codes((ratio >= 1.1).astype(int) + (ratio > 2), SLENDER)


def split_cells(table: Columns, grids: Sequence[Cells], design: Design) -> pd.DataFrame:
    """Return the parts in every judged state of the bodies with a magnet; `design` is that of the sweep.

    They are NaN where a pose is unknown.
    """
    found = [pd.DataFrame(columns=["L_over_D", "shear_over_D", *COLUMNS])]
    for body in dict.fromkeys(grid.body for grid in grids if grid.body.height):
        own = [grid for grid in grids if grid.body == body]
        for column, slenderness in enumerate(own[0].slenderness.tolist()):
            states = np.concatenate([grid.row[grid.judged[:, column], column] for grid in own])
            if not len(states):
                continue
            one = sensor(table, int(states[0]), design)
            (fem, tilt), (formula, _) = (_poses(table, model, states) for model in ("fem", "analytic_paper"))
            known = np.isfinite(np.column_stack([fem, tilt, formula])).all(axis=1)
            names = [element.name for element in of_design(one)]
            percent = np.full((len(PARTS), len(states), len(names)), np.nan)
            if known.any():
                percent[:, known] = _parts(one, fem[known], tilt[known], formula[known])
            place: Row = {"magnet_height_over_D": body.height, "L_over_D": slenderness}
            place |= {f"{name}_over_D": (table[f"{name}_mm"][states] / one.D).repeat(len(names)) for name in LOADS}
            parts = dict(zip(COLUMNS, percent.reshape(len(PARTS), -1), strict=True))
            found.append(pd.DataFrame({**place, "element": names * len(states), **parts}))
    return pd.concat(found[1:] or found, ignore_index=True)


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
