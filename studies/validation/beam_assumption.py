"""Where does the beam assumption hold? A sweep over designs and loads, and what follows from its table.

The sweep is a study file; the shipped one is `studies/examples/beam_assumption.toml`. Its models must be one
finite-element model and all levels of the formulas, and its axes L, the size of the magnet, nu, depth and shear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic import beam
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.exploration import sweep_request
from studies.exploration.needed_paths import Processes
from studies.exploration.study_cases import Cases, Plan
from studies.simulation import beam_cells
from studies.simulation.beam_cells import Cells, Columns
from studies.validation import beam_regions, beam_sentences, reading_split
from studies.validation.beam_regions import BestRow, ShareRow
from studies.validation.reading_split import SplitCell, SplitMean

STUDY = Path(__file__).resolve().parents[1] / "examples" / "beam_assumption.toml"
"""The shipped study."""
CELL, WITH_HEIGHT = ("L", "magnet_height", "nu", "depth", "shear"), ("magnet_diameter", "magnet_edge_radius")
"""Axes that make a cell, and those that may follow the magnet's height."""


@dataclass(frozen=True, slots=True, eq=False)
class Assumption:
    """The design and the table of the sweep, and what follows from it.

    Attributes
    ----------
    grids : cells of each body, presses and shears.
    parts : parts of the readings' errors in each state of the largest nu.
    """

    design: Design
    table: Columns
    grids: list[Cells]
    shares: list[ShareRow]
    best: list[BestRow]
    parts: list[SplitCell]
    means: list[SplitMean]
    sentences: list[str]


def plan_of(study: Path) -> Plan:
    """Return the plan of a study file.

    Raises
    ------
    BadInput
        The file is no study, or lacks a model or an axis.
    """
    plan = sweep_request.plan_of(str(study), sweep_request.Options())
    missing = [level for level in beam.LEVELS if level not in plan.formulas]
    if missing or len(plan.fem) != 1:
        raise BadInput(
            f"the study {str(study)!r} must have one finite-element model and all levels of the formulas "
            f"({', '.join(beam.LEVELS)}): change its models"
        )
    if other := [name for name in plan.axes if name not in (*CELL, *WITH_HEIGHT)]:
        raise BadInput(
            f"the study {str(study)!r} has the axis {', '.join(other)}; its axes may be "
            f"{', '.join((*CELL, *WITH_HEIGHT))}: give {', '.join(other)} one value in [design] or [load]"
        )
    lacking = [name for name in CELL if name not in plan.axes]
    if lacking:
        raise BadInput(
            f"the study {str(study)!r} lacks the axis {', '.join(lacking)}: add it, with one value if fixed"
        )
    needed = {"force", "shift", "tilt"}
    if not needed <= set(plan.quantities):
        raise BadInput(f"the study {str(study)!r} needs the quantities force, shift and tilt: add them")
    axes = Cases(plan).batch(np.arange(plan.count)).axes
    places = np.unique(np.column_stack([np.asarray(axes[name], dtype=float) for name in CELL]), axis=0)
    if len(places) < plan.count:
        raise BadInput(
            f"the study {str(study)!r} has {plan.count} cases of {len(places)} different {', '.join(CELL)}; each may "
            f"have one case: zip {' and '.join(WITH_HEIGHT)} with magnet_height"
        )
    return plan


def run(plan: Plan, progress: Progress, processes: Processes = Processes(), store: Path | None = None) -> Assumption:
    """Run the sweep of a plan and return what follows from it.

    Parameters
    ----------
    store : file of solved states; default: the user's.
    """
    with sweep_request.sweep(plan, None, progress, processes, store) as batches:
        tables = list(batches)
    table = {name: np.concatenate([each[name] for each in tables]) for name in tables[0]}
    return judged(table, plan.design)


def judged(table: Columns, design: Design) -> Assumption:
    """Return what follows from the table of a sweep over a design."""
    grids = [
        grid
        for body in beam_cells.bodies(table)
        for grid in (beam_cells.cells(table, body, "press"), beam_cells.cells(table, body, "shear"))
        if grid.row.size
    ]
    shares = beam_regions.share_rows(table, grids)
    nu = max(grid.body.nu for grid in grids)
    main = [grid for grid in grids if grid.body.nu == nu]
    best = beam_regions.best_rows(table, main)
    parts = reading_split.split_cells(table, main, design)
    means = reading_split.split_means(parts, beam_regions.SLENDER)
    lines: Sequence[str] = beam_sentences.sentences(table, grids, shares, best, means)
    return Assumption(design, table, grids, shares, best, parts, means, list(lines))
