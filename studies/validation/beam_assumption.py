"""Where does the beam assumption hold? A sweep over designs and loads, and what follows from its table.

The sweep is a study file; the shipped one is `studies/examples/beam_assumption.toml`. Its models must be one
finite-element model and all levels of the formulas, and its axes L, the size of the magnet, nu, depth and shear.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analytic import beam
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.exploration import sweep_request
from studies.exploration.needed_paths import Processes
from studies.exploration.study_cases import Cases, Plan
from studies.output.csv_tables import write_table
from studies.simulation import beam_cells
from studies.simulation.beam_cells import Cells, Columns
from studies.validation import beam_maps, beam_regions, pages, reading_split
from studies.validation.pages import Row

STUDY = Path(__file__).resolve().parents[1] / "examples" / "beam_assumption.toml"
"""The shipped study."""
CELL, WITH_HEIGHT = ("L", "magnet_height", "nu", "depth", "shear"), ("magnet_diameter", "magnet_edge_radius")
"""Axes that make a cell, and those that may follow the magnet's height."""


FILES = (
    *("ASSUMPTION.md", "sweep.csv", "shares.csv", "best.csv", "readings.csv"),
    *("press_force.png", "sinking.png", "shear_force.png", "sideways_shift.png", "tilt.png"),
    *("best_level.png", "readings.png"),
)
"""Files that `write` writes into a folder."""

INTRODUCTION = """\
The paper treats its sensor as a uniform cantilever: press force (5) with area (7), shear force (6), a magnet that
neither stiffens the beam nor tilts. Here these formulas, and every level above them, stand against finite elements of
the same sensor over L/D, height of the magnet, depth, shear and Poisson's ratio. D is {D:g} mm and E is {E:g} MPa:
lengths scale with D, forces with E D^2, and no error depends on either. The shear is that of a plate stuck to the
tip.

Errors are formula against finite elements, in %. Those of readings are in % of full scale, the largest change from
rest of the same sensor. A cell is one design under one load."""

NOTES = """\
- The plate is frictionless in presses; a tip that is free to slide buckles sideways at the critical depth, and the
  axisymmetric press beyond it holds the tip on the axis.
- The Hall elements stay where they are in the base of the sensor (S1 {below:.3g} mm below its surface). They do not
  enter the mechanics, and a short beam with a tall magnet need not be buildable with them.
- Levels tip, magnet and finite were calibrated for L/D 1.1 to 4, depths to D/4 and shears to 0.3 D; outside of that
  their errors here are those of an extrapolation."""


SHARES = """\
Levels paper and finite at nu = {nu:g}; shares.csv has all levels and all nu. A block is the largest one of
neighbouring cells that are all within the bound."""


@dataclass(frozen=True, slots=True, eq=False)
class Assumption:
    """The design and the table of the sweep, the cells of each body, presses and shears, and what follows."""

    design: Design
    table: Columns
    grids: list[Cells]
    shares: list[Row]
    best: list[Row]
    parts: list[Row]
    means: list[Row]
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
    lines = beam_regions.sentences(table, grids, shares, means)
    return Assumption(design, table, grids, shares, best, parts, means, lines)


def write(folder: Path, assumption: Assumption, origin: str, command: str) -> None:
    """Write ASSUMPTION.md, the tables and the maps into an existing folder."""
    from studies.exploration.study_rows import flat_rows

    tables = {"shares": assumption.shares, "best": assumption.best, "readings": assumption.parts}
    for name, rows in (tables | {"sweep": list(flat_rows(assumption.table))}).items():
        write_table(folder / f"{name}.csv", rows)
    pictures = beam_maps.draw(folder, assumption.table, assumption.grids, assumption.means)
    design, nu = assumption.design, max(grid.body.nu for grid in assumption.grids)
    chosen = [row for row in assumption.shares if row["nu"] == nu and row["level"] in ("paper", "finite")]
    shown = [{name: value for name, value in row.items() if name != "nu"} for row in chosen]
    blocks = [
        "# Where the beam assumption holds",
        INTRODUCTION.format(D=design.D, E=design.E),
        pages.listed(assumption.sentences),
        "## Maps",
        *(f"![{name.removesuffix('.png')}]({name})\n\n{text}" for name, text in pictures.items()),
        "## Within 5 and 10 %",
        SHARES.format(nu=nu),
        pages.markdown(shown),
        "## Best level by region",
        "The level of least root mean square error; best.csv.",
        pages.markdown(assumption.best),
        "## Readings by the paper's formulas",
        "Root mean squares in % of full scale; readings.csv has all states.",
        pages.markdown(assumption.means),
        "## Notes",
        NOTES.format(below=design.l0 - design.H),
    ]
    pages.write(folder / "ASSUMPTION.md", blocks, command, origin)
