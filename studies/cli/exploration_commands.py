"""The verb for many designs: sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from geometry.loads import Magnet
from studies.cli.command_output import print_remarks, say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Wide
from studies.inputs.exit_status import FAILED, GOOD
from studies.inputs.input_warnings import say_no_effect, warn_of_values
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console

if TYPE_CHECKING:
    from studies.exploration.sweep_rows import SweepRow

Study = Annotated[str | None, Parameter(name="STUDY", help="TOML file of a study; with --axis, a design.")]


def sweep(
    source: Study = None,
    /,
    *,
    axis: list[str] | None = None,
    design: str | None = None,
    depth: float | None = None,
    magnet: Magnet | None = None,
    accuracy: AccuracyName | None = None,
    out: Path | None = None,
    store: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Run finite elements and formulas over a grid of D, L, f, E and depth, one row per case.

    Run a study by magtip sweep STUDY.toml, or without a file by magtip sweep --axis D=6,8,10 --depth 1. Options
    override the values of a study.

    Parameters
    ----------
    axis
        Values NAME=a,b,c of D, L, f, depth (mm) or E (MPa); repeatable.
    design
        Design to vary, a preset or a TOML file; default: paper.
    depth
        Depth of the press if depth is not an axis, mm.
    magnet
        Rigid body, or ignored (the whole beam is silicone); default: rigid.
    accuracy
        Accuracy of the finite elements; default: standard.
    out
        Folder for the table and the plot.
    store
        File that keeps all solved states; a sweep continues from there, and never solves one twice; default: one of
        the user, which the environment variable MAGTIP_STORE can name.
    """
    from studies.exploration import sweep_request

    case = sweep_request.grid_of(source, axis or [], design, depth, magnet, accuracy, sets or [])
    warn_of_values(case.design)
    atomic_files.check_apart([*atomic_files.inside(out, sweep_request.FILES), store], [source, design])
    if case.magnet == "rigid":
        say_if_without_magnet(case.design)
    rows: list[SweepRow] = []
    try:
        with console.progress(as_json=as_json) as progress:
            for row in sweep_request.sweep(case, out, progress, store):
                rows.append(row)
                if as_json:
                    console.report([row.row()], as_json=True)
    finally:
        table = [row.row() for row in rows]
        if not as_json:
            sweep_request.show(table, "Sweep", wide=wide)
            print_remarks([row.row() for row in rows if row.status == "ok"], sweep_request.CASE, table)
    for name, reason in sweep_request.idle_axes(table, case.axes, whole=as_json or wide or out is not None):
        say_no_effect(f"axis {name}", reason)
    failed = [row.row() for row in rows if row.status != "ok"]
    for reason in console.remarks(failed, sweep_request.CASE, table):
        console.say(f"magtip: {reason}")
    if failed:
        console.say(f"magtip: {len(failed)} of {len(rows)} cases failed")
    return GOOD if len(failed) < len(rows) else FAILED
