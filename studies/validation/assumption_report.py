"""ASSUMPTION.md, the tables and the maps of `magtip validate assumption`."""

from __future__ import annotations

from pathlib import Path

from studies.output import records
from studies.output.atomic_files import write_text
from studies.output.csv_tables import write_table
from studies.output.markdown_tables import markdown
from studies.output.provenance import made
from studies.validation import beam_maps
from studies.validation.beam_assumption import Assumption

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


def write(folder: Path, assumption: Assumption, origin: str, command: str) -> None:
    """Write ASSUMPTION.md, the tables and the maps into an existing folder."""
    from studies.exploration.study_rows import flat_rows

    shares, best, means = (
        [records.flat(row) for row in rows] for rows in (assumption.shares, assumption.best, assumption.means)
    )
    write_table(folder / "sweep.csv", list(flat_rows(assumption.table)))
    write_table(folder / "shares.csv", shares)
    write_table(folder / "best.csv", best)
    write_table(folder / "readings.csv", [records.flat(row) for row in assumption.parts])
    pictures = beam_maps.draw(folder, assumption.table, assumption.grids, assumption.means)
    design, nu = assumption.design, max(grid.body.nu for grid in assumption.grids)
    chosen = [row for row in shares if row["nu"] == nu and row["level"] in ("paper", "finite")]
    shown = [{name: value for name, value in row.items() if name != "nu"} for row in chosen]
    blocks = [
        "# Where the beam assumption holds",
        INTRODUCTION.format(D=design.D, E=design.E),
        "\n".join(f"- {line}" for line in assumption.sentences),
        "## Maps",
        *(f"![{name.removesuffix('.png')}]({name})\n\n{text}" for name, text in pictures.items()),
        "## Within 5 and 10 %",
        SHARES.format(nu=nu),
        markdown(shown),
        "## Best level by region",
        "The level of least root mean square error; best.csv.",
        markdown(best),
        "## Readings by the paper's formulas",
        "Root mean squares in % of full scale; readings.csv has all states.",
        markdown(means),
        "## Notes",
        NOTES.format(below=design.l0 - design.H),
        made(command, origin),
    ]
    write_text(folder / "ASSUMPTION.md", "\n\n".join(blocks) + "\n")
