"""Where does the beam assumption hold? A sweep over designs and loads, regions within 5 and 10 %, and findings.

The sweep is a study file; the shipped one is `studies/examples/beam_assumption.toml`. Its models must be one
finite-element model and all levels of the formulas, and its axes L, the size of the magnet, nu, depth and shear. The
findings are in templates/assumption_findings.j2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from analytic import beam
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import Cases, Plan
from studies.output.result import Result, Table
from studies.simulation import beam_cells
from studies.simulation.beam_cells import QUANTITIES, Body, Bools, Cells, Columns, all_errors, errors
from studies.sweeps import sweep_request
from studies.validation import assumption_maps, pages, reading_split
from studies.validation.pages import Row
from studies.validation.reading_split import PARTS

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
"""Errors that bound a region, %."""
FORMULAS = {"press force": "formula (5)", "shear force": "formula (6)"}
SHALLOW = 0.06
"""Depth over D up to which a press is called light."""
SLENDER: dict[str, Callable[[float], bool]] = {
    "L/D below 1.1": lambda ratio: ratio < 1.1,
    "L/D 1.1 to 2": lambda ratio: 1.1 <= ratio <= 2,
    "L/D above 2": lambda ratio: ratio > 2,
}
DEPTHS: dict[str, Callable[[float], bool]] = {
    "d/D to 0.06": lambda depth: depth <= 0.06,
    "d/D 0.06 to 0.2": lambda depth: 0.06 < depth <= 0.2,
    "d/D above 0.2": lambda depth: depth > 0.2,
}
BODIES: dict[str, Callable[[Body], bool]] = {
    "no magnet": lambda body: not body.height,
    "magnet to 0.25 D": lambda body: 0 < body.height <= 0.25,
    "taller magnet": lambda body: body.height > 0.25,
}


def plan_of(study: Path) -> Plan:
    """Return the plan of a study file.

    Raises
    ------
    BadInput
        The file is no study, or lacks a model or an axis.
    """
    plan = sweep_request.plan_of(str(study), sweep_request.Options())

    def refuse(why: str) -> None:
        raise BadInput(f"the study {str(study)!r} {why}")

    if len(plan.fem) != 1 or not set(beam.LEVELS) <= set(plan.formulas):
        refuse(
            "must have one finite-element model and all levels of the formulas "
            f"({', '.join(beam.LEVELS)}): change its models"
        )
    allowed = (*CELL, *WITH_HEIGHT)
    if other := ", ".join(name for name in plan.axes if name not in allowed):
        refuse(
            f"has the axis {other}; its axes may be {', '.join(allowed)}: give {other} one value in [design] or "
            "[load]"
        )
    if lacking := ", ".join(name for name in CELL if name not in plan.axes):
        refuse(f"lacks the axis {lacking}: add it, with one value if fixed")
    if not {"force", "shift", "tilt"} <= set(plan.quantities):
        refuse("needs the quantities force, shift and tilt: add them")
    axes = Cases(plan).batch(np.arange(plan.count)).axes
    places = np.unique(np.column_stack([np.asarray(axes[name], dtype=float) for name in CELL]), axis=0)
    if len(places) < plan.count:
        refuse(
            f"has {plan.count} cases of {len(places)} different {', '.join(CELL)}; each may have one case: zip "
            f"{' and '.join(WITH_HEIGHT)} with magnet_height"
        )
    return plan


def run(progress: Progress, plan: Plan, processes: Processes = Processes(), store: Path | None = None) -> Result:
    """Run the sweep of a plan and return what follows from it.

    Parameters
    ----------
    store : file of solved states; default: the user's.
    """
    with sweep_request.sweep(plan, None, progress, processes, store) as batches:
        tables = list(batches)
    return result({name: np.concatenate([each[name] for each in tables]) for name in tables[0]}, plan.design)


def result(table: Columns, design: Design) -> Result:
    """Return what follows from the table of a sweep over a design."""
    from studies.sweeps.study_rows import flat_rows

    pairs = product(beam_cells.bodies(table), QUANTITIES)
    grids = [grid for body, kind in pairs if (grid := beam_cells.cells(table, body, kind)).row.size]
    nu = max(grid.body.nu for grid in grids)
    main = [grid for grid in grids if grid.body.nu == nu]
    shares, best = share_rows(table, grids), best_rows(table, main)
    parts = reading_split.split_cells(table, main, design)
    means = reading_split.split_means(parts, SLENDER)
    sentences = findings(table, grids, shares, means)
    pictures = assumption_maps.pictures(table, grids, means)
    chosen = [row for row in shares if row["nu"] == nu and row["level"] in ("paper", "finite")]
    page = {
        "design": design,
        "sentences": sentences,
        "pictures": pictures,
        "nu": nu,
        "shares": [{name: value for name, value in row.items() if name != "nu"} for row in chosen],
        "best": best,
        "means": means,
    }
    shown = Table(
        title="Share of the cells within 5 and 10 %",
        rows=shares,
        first=("quantity", "level", "magnet_height_over_D", "within_10_percent"),
    )
    return Result(
        title=shown.title,
        records=shares,
        shown=[shown, *sentences],
        tables={"shares": shares, "best": best, "readings": parts, "sweep": list(flat_rows(table))},
        files={name: picture.draw for name, picture in pictures.items()},
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
        """Number of cells."""
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
            for begin, end in _runs(whole):
                block = Block(first, last, begin, end)
                if best is None or (block.size, end - begin) > (best.size, best.last_length - best.first_length):
                    best = block
    return best


def _runs(flags: Bools) -> Iterable[tuple[int, int]]:
    """Yield first and last index of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(begin), int(end) - 1) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def block_text(grid: Cells, block: Block | None) -> str:
    """Return a block in words, such as "L/D 2 to 6, d/D 0.08 to 0.2"; "nowhere" for none."""
    if block is None:
        return "nowhere"
    slender = _span(grid.slenderness[block.first_length], grid.slenderness[block.last_length])
    first, last = grid.loads[block.first_load], grid.loads[block.last_load]
    if grid.kind == "press":
        return f"L/D {slender}, d/D {_span(first[0], last[0])}"
    if first[0] == last[0]:
        return f"L/D {slender}, d/D {first[0]:.3g}, shear/D {_span(first[1], last[1])}"
    states = f"from d/D {first[0]:.3g}, shear/D {first[1]:.3g} to d/D {last[0]:.3g}, shear/D {last[1]:.3g}"
    return f"L/D {slender}, {states}"


def _span(low: float, high: float) -> str:
    return f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"


def share_rows(table: Columns, grids: Sequence[Cells]) -> list[Row]:
    """Return a row for each quantity, level and body: shares of the judged cells within the bounds, errors, blocks.

    `leaning_of_these_percent` is the share of the cells within 10 % that are deeper than the critical depth of a free
    tip; a block is the largest one of neighbouring cells within the bound, in words.
    """
    rows = []
    for grid in grids:
        for quantity in QUANTITIES[grid.kind]:
            for level, error in all_errors(table, grid, quantity).items():
                known = error[np.isfinite(error)]
                if not len(known):
                    continue
                near = np.abs(error) <= BOUNDS[-1]
                five, ten = (block_text(grid, largest_block(np.abs(error) <= bound)) for bound in BOUNDS)
                place = {"quantity": quantity, "level": level, "magnet_height_over_D": grid.body.height}
                row = place | {"nu": grid.body.nu, "cells": len(known)}
                row |= {"within_5_percent": share(error, BOUNDS[0]), "within_10_percent": share(error, BOUNDS[1])}
                row["leaning_of_these_percent"] = 100 * float(grid.leans[near].mean()) if near.any() else math.nan
                row["median_error_percent"] = float(np.median(np.abs(known)))
                row["largest_error_percent"] = float(known[np.abs(known).argmax()])
                rows.append(row | {"within_5_block": five, "within_10_block": ten})
    return rows


def best_rows(table: Columns, grids: Sequence[Cells]) -> list[Row]:
    """Return the best level in each region: body, slenderness and depth; regions without a cell are left out."""
    rows = []
    for kind, quantities in QUANTITIES.items():
        for quantity, (body_name, of_body) in product(quantities, BODIES.items()):
            own = [grid for grid in grids if grid.kind == kind and of_body(grid.body)]
            found = [(grid, all_errors(table, grid, quantity)) for grid in own]
            for (slender_name, slender), (depth_name, deep) in product(SLENDER.items(), DEPTHS.items()):
                region = f"{body_name}, {slender_name}, {depth_name}"
                picked = [_picked(grid, errors, slender, deep) for grid, errors in found]
                rows += best_row(quantity, region, picked)
    return rows


def _picked(
    grid: Cells, errors: Mapping[str, Array], slender: Callable[[float], bool], deep: Callable[[float], bool]
) -> dict[str, Array]:
    """Return the errors of all levels in the cells of a region that every level answers, shape (cells,)."""
    chosen = np.outer([deep(depth) for depth in grid.loads[:, 0]], [slender(ratio) for ratio in grid.slenderness])
    return {level: error[chosen] for level, error in errors.items()}


def best_row(quantity: str, region: str, picked: Sequence[Mapping[str, Array]]) -> list[Row]:
    """Return the row of a region from the errors of its bodies, or nothing without a cell.

    The best level has the least root mean square error; `best_in_percent` is the share of the region's cells in which
    it has the least error of all levels.
    """
    if not picked:
        return []
    names = list(picked[0])
    stacked = np.array([np.concatenate([each[level] for each in picked]) for level in names])
    known = np.isfinite(stacked).all(axis=0)
    if not known.any():
        return []
    stacked = stacked[:, known]
    rms = np.sqrt((stacked**2).mean(axis=1))
    best, paper = int(rms.argmin()), names.index("paper")
    winner = np.abs(stacked).argmin(axis=0)
    figures = {"quantity": quantity, "region": region, "cells": int(known.sum()), "best_level": names[best]}
    row = figures | {"rms_error_percent": float(rms[best]), "within_10_percent": share(stacked[best], 10.0)}
    row |= {"best_in_percent": 100 * float((winner == best).mean()), "paper_rms_error_percent": float(rms[paper])}
    return [row | {"paper_within_10_percent": share(stacked[paper], 10.0)}]


# Findings


def findings(table: Columns, grids: Sequence[Cells], shares: Sequence[Row], means: Sequence[Row]) -> list[str]:
    """Return what the tables do not show, in sentences: where the paper's formulas hold, readings, failures."""
    nu = max(grid.body.nu for grid in grids)
    main = [row for row in shares if row["nu"] == nu]
    presses, shears = ([grid for grid in grids if grid.kind == kind] for kind in ("press", "shear"))
    light = [(grid, grid.loads[:, 0] <= SHALLOW) for grid in presses if grid.body.nu == nu]
    text = pages.filled(
        (pages.TEMPLATES / "assumption_findings.j2").read_text("utf-8"),
        overall=[_within(main, quantity) for quantity in FORMULAS],
        bodies=[
            row | {"body": Body(row["magnet_height_over_D"], nu).name, "formula": FORMULAS[quantity]}
            for quantity in FORMULAS
            for row in main
            if (row["quantity"], row["level"]) == (quantity, "paper")
        ],
        shallow=SHALLOW,
        light=_known([errors(table, grid, "paper", "press force")[own] for grid, own in light]),
        sheared=_known([errors(table, grid, "paper", "shear force") for grid in shears if grid.body.nu == nu]),
        readings=_reading_means(means),
        shortest=next(iter(SLENDER)),
        leaning=sum(int((grid.leans & grid.judged).sum()) for grid in presses),
        judged=sum(int(grid.judged.sum()) for grid in presses),
        given=sum(int(grid.gave_way.sum()) for grid in shears),
        answered=sum(int(grid.answered.sum()) for grid in shears),
        failed=sum(int((grid.possible & ~grid.answered).sum()) for grid in grids),
        impossible=sum(int((~grid.possible).sum()) for grid in grids),
        cells=sum(grid.row.size for grid in grids),
    )
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n") if paragraph.strip()]


def _within(rows: Sequence[Row], quantity: str) -> tuple[str, dict[str, float]]:
    """Return a quantity and the share of all cells within 10 %, by the name of the formula."""
    shares = {}
    for level, name in (("paper", FORMULAS[quantity]), ("finite", "level finite")):
        own = [row for row in rows if (row["quantity"], row["level"]) == (quantity, level)]
        if cells := sum(row["cells"] for row in own):
            shares[name] = sum(row["cells"] * row["within_10_percent"] for row in own) / cells
    return quantity, shares


def _known(values: Sequence[Array]) -> Array:
    """Return all finite values of several arrays, shape (n,)."""
    known = np.concatenate([np.empty(0), *(array.ravel() for array in values)])
    return np.asarray(known[np.isfinite(known)])


def _reading_means(means: Sequence[Row]) -> list[Row]:
    """Return the root mean squares of the parts over all heights of the magnet, by kind of load and range of L/D."""
    found = []
    for load, slenderness in dict.fromkeys((row["load"], name) for row in means for name in SLENDER):
        own = [row for row in means if (row["load"], row["slenderness"]) == (load, slenderness)]
        weights = [row["states"] for row in own]
        if own:
            squares = {part: [row[f"{part}_percent_FS"] ** 2 for row in own] for part in PARTS}
            rms = {part: float(np.sqrt(np.average(each, weights=weights))) for part, each in squares.items()}
            found.append({"load": load, "slenderness": slenderness, **rms})
    return found
