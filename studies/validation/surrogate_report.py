"""SURROGATE.md, its tables and its picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from studies.output import records
from studies.output.atomic_files import atomic, write_text
from studies.output.csv_tables import write_table
from studies.output.goals import Goal, missed, verdict
from studies.output.markdown_tables import markdown
from studies.output.provenance import made
from studies.output.table_plots import log_numbers, sheet
from studies.surrogate import surrogate_file
from studies.validation import surrogate_test
from studies.validation.state_errors import StateError
from studies.validation.surrogate_study import Result

FILES = ("SURROGATE.md", "surrogate.npz", "summary.csv", "errors.csv", "errors.png")

INTRODUCTION = """\
The surrogate predicts force, shift, tilt, contact radius and largest strain of a press and of a glued shear, the
critical depth and the first mode, from finite elements at level {accuracy} of {beams} beams. The docstrings of
`studies/surrogate/prediction.py` and `gaussian_process.py` say what it interpolates, and how; that of
`studies/validation/calibration.py` says how the intervals are calibrated.

Range: L/D 0.75 to 4, magnet diameter 0.2 to 0.8 D and height 0.1 to 0.8 D with at least 0.04 D of silicone around it,
nu 0.45 to 0.5, law neo-Hookean; depths from 0.01 D (shears: 0.03 D) to 0.375 D or 0.4 of the silicone on the axis
(less above wide magnets, 0.28 at 0.8 D, where the free skin of a deeper press creases), glued shears to 0.375 D or
0.35 L. The first {first} training beams are the corners of the range and fill it evenly (Sobol points, of which two
in three lie on a face); the others were added where intervals were widest. A press or shear beyond the depth to which
the press is known to stay stable is refused by all verbs.

The test: {test} random beams that training has not seen, at random depths and shears, which serve for nothing else.
Errors are in percent of the value; those of force and shift in a shear in percent of the vector's length, that of the
sideways stiffness in percent of its loss. {failed}

An interval refers to the answer of infinitely fine meshes. The estimated error of level {accuracy} itself
(`fem_error_percent`; for contact radius, strain, sideways stiffness, modes and critical depths the difference from a
mesh coarser by half) is added to the error before the two are compared with the half width, in the calibration on
{calibration} random beams and in the test. The interval of a quantity should hold in all states of nine beams out of
ten. The goal of a region is the share of covered beams below which chance leads in 1 % of all tests, if nine of ten
beams are covered. Beams of calibration and test are drawn evenly from six regions: three kinds of magnets, thick,
wide and thin, narrow and thin, in short and slender beams.

Left out of the range are bases with less than 0.15 D of silicone below the magnet: it hardly moves there, and errors
are several times as large."""

TRENDS = """\
Would a formula below the surrogate help? 95th percentiles of the errors of the press force, %: of left-out training
beams where a formula is the trend, of unseen beams where it stands alone. A formula that is evaluated for each state
also takes 0.03 (level paper) to 3 ms (level finite), beyond the 0.1 ms that 10 000 designs a second leave."""


def write(folder: Path, result: Result, first: int, origin: str, command: str) -> list[Goal]:
    """Write the report into an existing folder; return the goals."""
    rows = result.errors
    table = surrogate_test.summaries(rows)
    goals = surrogate_test.goals(table)
    speed = surrogate_test.designs_per_second(result)
    with atomic(folder / "surrogate.npz") as temporary:
        surrogate_file.write(temporary, result.surrogate)
    write_table(folder / "summary.csv", [records.flat(row) for row in table])
    write_table(folder / "errors.csv", [records.flat(row) for row in rows])
    draw(folder / "errors.png", rows)
    about = result.surrogate.about
    lost_training, lost_test = result.failed
    failed = (
        f"{lost_training} training beams and {lost_test} test beams are left out because a state failed."
        if lost_training or lost_test
        else "No state failed."
    )
    introduction = INTRODUCTION.format(
        accuracy=about["accuracy"],
        beams=about["beams"],
        first=first,
        test=about["test_beams"],
        failed=failed,
        calibration=about["calibration_beams"],
    )
    size = (folder / "surrogate.npz").stat().st_size / 1e6
    lines = [verdict(goals), *(f"- {goal}" for goal in missed(goals))]
    blocks = [
        "# Surrogate of the finite elements",
        introduction,
        "## Errors on unseen beams",
        markdown([records.flat(row) for row in table]),
        "\n".join(lines),
        "![Errors and intervals](errors.png)",
        "## Cost",
        f"The file has {size:.2g} MB. On one core, with intervals: "
        + "; ".join(f"{name} {value:,.0f} designs/s" for name, value in speed.items())
        + " (CPU time, after the first call, which takes some 0.1 s).",
        "## Formulas as trend",
        TRENDS,
        markdown([records.flat(row) for row in surrogate_test.trends(result)]),
        made(command, origin),
    ]
    write_text(folder / "SURROGATE.md", "\n\n".join(blocks) + "\n")
    return goals


def draw(file: Path, rows: Sequence[StateError]) -> None:
    """Draw the error of force and tilt over the half width of its interval, for presses and shears."""
    kinds = (("press", ("force",)), ("shear", ("force_x", "force_z")), ("shear", ("tilt",)))
    with sheet(file, 10.0, 3.6) as figure:
        axes = figure.subplots(1, len(kinds), sharey=True)
        for axis, (kind, names) in zip(axes, kinds, strict=True):
            for name, colour, marker in zip(names, ("#0072B2", "#D55E00"), ("o", "^"), strict=False):
                own = [row for row in rows if (row.kind, row.quantity) == (kind, name)]
                axis.loglog(
                    [row.interval_percent for row in own],
                    [max(abs(row.error_percent), 1e-3) for row in own],
                    marker,
                    color=colour,
                    markersize=3,
                    alpha=0.5,
                    label=name.replace("_", " along "),
                )
            ends = np.array([0.05, 50.0])
            axis.plot(ends, ends, "k-", linewidth=0.8, label="error = half width")
            axis.set_xlabel("half width of the 90 % interval (%)")
            log_numbers(axis, "x")
            axis.set_title(f"{kind}: {' and '.join(names).replace('_', ' along ')}", fontsize=10)
            axis.grid(alpha=0.3)
            axis.legend(fontsize=8, loc="upper left")
        axes[0].set_ylabel("error on unseen beams (%)")
        log_numbers(axes[0], "y")
