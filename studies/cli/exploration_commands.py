"""The verb for many designs: sweep."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from geometry.loads import ANSWERED, Magnet
from studies.cli.command_output import print_remarks, say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Wide
from studies.cli.printed_command import command
from studies.inputs.input_warnings import say_no_effect, warn_of_values
from studies.inputs.option_groups import TOLERANCE, Whole
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console, run_record
from studies.output.records import FlatRow
from studies.output.result import FAILED, GOOD

if TYPE_CHECKING:
    from studies.exploration.study_cases import Plan

Study = Annotated[str | None, Parameter(name="STUDY", help="TOML file of a study; with --axis, a design.")]

MOST_SHOWN = 1000
"""Largest number of rows of a table on the screen."""


def sweep(
    source: Study = None,
    /,
    *,
    axis: list[str] | None = None,
    load: list[str] | None = None,
    design: str | None = None,
    depth: float | None = None,
    magnet: Magnet | None = None,
    accuracy: AccuracyName | None = None,
    models: str | None = None,
    quantities: str | None = None,
    tolerance: Annotated[str | None, TOLERANCE] = None,
    out: Path | None = None,
    store: Path | None = None,
    workers: Whole | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Run finite elements and formulas over many designs and loads, one row per case.

    Run a study by magtip sweep STUDY.toml, or without a file by magtip sweep --axis D=6,8,10 --depth 1. Options
    override the values of a study. Solved states are kept: no sweep solves a state again. The exit status is 3 if a
    case failed; the others have their rows all the same.

    Parameters
    ----------
    axis
        Values NAME=a,b,c or NAME=lin:START:STOP:COUNT or NAME=log:START:STOP:COUNT of a field of the design (D, L, E,
        nu, law, ...), of the load (depth, shear, shear_y, friction, grip, plate_tilt, imperfection, frequency,
        speed) or of magnet; repeatable.
    load
        Field of the load that does not vary, NAME=VALUE, such as shear=1 or friction=0.5; repeatable.
    design
        Design to vary, a preset or a TOML file; default: paper.
    depth
        Depth of the press if depth is not an axis, mm.
    magnet
        Rigid body, or ignored (the whole beam is silicone); default: rigid.
    accuracy
        Accuracy of the finite elements; default: standard.
    models
        Models side by side, such as quick,standard,paper,finite: accuracies of the finite elements (half-quick for
        another model than auto), surrogate, and levels of the formulas; default: standard,paper.
    quantities
        Any of force, shift, tilt, contact_radius, strain, readings, decoded_force_error, critical_depth, modes,
        response, cycle; default: force, shift, contact_radius, readings, and tilt if a load acts sideways.
    out
        Folder for the table (sweep.csv, or sweep.parquet beyond 20 000 rows) and the pictures.
    store
        File that keeps all solved states; default: one of the user, which the environment variable MAGTIP_STORE can
        name.
    workers
        Number of processes that solve; default: one for each core, or none if all solves take only seconds.
    scheduler
        Address of a Dask scheduler, such as tcp://127.0.0.1:8786, whose workers solve.
    retry_failed
        Solve again the cases whose process died.
    """
    command_line = command(sweep, locals())
    from studies.exploration import sweep_request
    from studies.exploration.executors import SchedulerLost
    from studies.exploration.needed_paths import Processes
    from studies.exploration.study_rows import flat_rows

    processes = Processes(workers, scheduler, retry_failed)
    plan = sweep_request.plan_of(
        source,
        sweep_request.Options(
            axis or [], design, depth, load or [], magnet, accuracy, models, quantities, tolerance, sets or []
        ),
    )
    warn_of_values(plan.design)
    atomic_files.check_apart(
        [*atomic_files.inside(out, (*sweep_request.FILES, run_record.NAME)), store], [source, design]
    )
    if plan.magnet == "rigid" and plan.fem:
        say_if_without_magnet(plan.design)
    case = sweep_request.case_columns(plan)
    printed = _Printed()
    choices = sweep_request.Choices(plan)
    try:
        with (
            console.progress(as_json=as_json) as progress,
            sweep_request.sweep(plan, out, progress, processes, store) as batches,
        ):
            for table in batches:
                choices.add(table)
                for row in flat_rows(table):
                    printed.add(row, as_json=as_json)
            if out is not None:
                run_record.write(out, command_line, dataclasses.asdict(plan.design))
    except SchedulerLost as error:
        console.say(f"magtip: {error}")
        return FAILED
    finally:
        if not as_json:
            _show(printed, case, plan, wide=wide)
    if printed.count <= MOST_SHOWN:
        whole = as_json or wide or out is not None
        for name, reason in sweep_request.idle_axes(printed.rows, plan, whole=whole, case=case):
            say_no_effect(f"axis {name}", reason)
    for sentence in choices.sentences():
        console.say(f"magtip: {sentence}")
    for reason in console.remarks(printed.failures, case, printed.rows):
        console.say(f"magtip: {reason}")
    if printed.unstable:
        console.say(
            f"magtip: {printed.unstable} of {printed.count} cases are unstable: their numbers are those of an "
            "equilibrium that a real sensor leaves"
        )
    if printed.failed:
        console.say(f"magtip: {printed.failed} of {printed.count} cases failed")
    return FAILED if printed.failed or not printed.count else GOOD


@dataclass(slots=True)
class _Printed:
    """Counts of the rows of a sweep, of unstable and failed ones, and the first ones, which the screen shows."""

    count: int = 0
    unstable: int = 0
    failed: int = 0
    rows: list[FlatRow] = field(default_factory=list)
    failures: list[FlatRow] = field(default_factory=list)

    def add(self, row: FlatRow, *, as_json: bool) -> None:
        """Count a row, and print it as JSON."""
        self.count += 1
        self.unstable += row["status"] == "unstable"
        if as_json:
            console.report([row], as_json=True)
        if row["status"] not in ANSWERED:
            self.failed += 1
            if len(self.failures) < MOST_SHOWN:
                self.failures.append(row)
        if len(self.rows) < MOST_SHOWN:
            self.rows.append(row)


def _show(printed: _Printed, case: tuple[str, ...], plan: Plan, *, wide: bool) -> None:
    """Print the rows as a table with their remarks, or their number if there are many."""
    from studies.exploration import sweep_request

    rows = printed.rows
    if printed.count > MOST_SHOWN:
        console.note(
            f"{printed.count} of {plan.count} rows; --out FOLDER or --json has them, a table on the screen does not."
        )
        return
    sweep_request.show(rows, "Sweep", wide=wide, case=case)
    print_remarks([row for row in rows if row["status"] in ANSWERED], case, rows)
