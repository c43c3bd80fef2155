"""Where does the beam assumption hold? A sweep over designs and loads, and what follows from its table.

The sweep is a study file; the shipped one is `studies/examples/beam_assumption.toml`. Its models must be one
finite-element model and all levels of the formulas, and its axes L, the size of the magnet, nu, depth and shear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analytic import beam
from geometry.design import BadInput
from geometry.messages import Progress
from studies.claims import beam_cells, beam_regions, beam_sentences, reading_split
from studies.claims.beam_cells import Cells, Columns
from studies.claims.beam_regions import BestRow, ShareRow
from studies.claims.reading_split import SplitCell, SplitMean
from studies.exploration import sweep_request
from studies.exploration.needed_paths import Processes

if TYPE_CHECKING:
    from studies.exploration.study_cases import Plan

STUDY = Path(__file__).resolve().parents[1] / "examples" / "beam_assumption.toml"
"""The shipped study."""


@dataclass(frozen=True, slots=True, eq=False)
class Assumption:
    """The table of the sweep, and what follows from it.

    Attributes
    ----------
    grids : cells of each body, presses and shears.
    parts : parts of the readings' errors in each state of the largest nu.
    """

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
    lacking = [name for name in ("L", "magnet_height", "nu", "depth", "shear") if name not in plan.axes]
    if lacking:
        raise BadInput(
            f"the study {str(study)!r} lacks the axis {', '.join(lacking)}: add it, with one value if fixed"
        )
    needed = {"force", "shift", "tilt"}
    if not needed <= set(plan.quantities):
        raise BadInput(f"the study {str(study)!r} needs the quantities force, shift and tilt: add them")
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
    return judged(table)


def judged(table: Columns) -> Assumption:
    """Return what follows from the table of a sweep."""
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
    parts = reading_split.split_cells(table, main)
    means = reading_split.split_means(parts, beam_regions.SLENDER)
    lines: Sequence[str] = beam_sentences.sentences(table, grids, shares, best, means)
    return Assumption(table, grids, shares, best, parts, means, list(lines))
