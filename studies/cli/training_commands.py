"""The verb that builds the surrogate."""

from __future__ import annotations

from pathlib import Path

from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.exit_status import FAILED, GOOD
from studies.inputs.option_groups import Whole
from studies.output import atomic_files, console, records


def surrogate(
    *,
    quick: bool = False,
    out: Path | None = None,
    store: Path | None = None,
    workers: Whole | None = None,
    scheduler: str | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Build the surrogate from finite elements, and test it on beams that it has not seen.

    From an empty store it took some 70 minutes on two busy cores; what is solved is kept, so that an interrupted
    study goes on. To ship the new surrogate, copy surrogate.npz from the folder to studies/surrogate,
    and summary.csv as surrogate_errors.csv.

    Parameters
    ----------
    quick
        Use few beams and coarser meshes: some minutes, and errors of 10 %.
    out
        Folder for surrogate.npz, SURROGATE.md, tables and the picture.
    store
        File of solved states; default: that of the user, which the environment variable MAGTIP_STORE can name.
    workers
        Number of processes that solve; default: one for each core.
    scheduler
        Address of a Dask scheduler whose workers solve.
    """
    command_line = command(surrogate, locals())
    from studies.exploration import store as stores
    from studies.exploration.needed_paths import Processes
    from studies.output.goals import missed
    from studies.output.provenance import versions
    from studies.training import surrogate_report, surrogate_study, surrogate_test

    extent = surrogate_study.FEW if quick else surrogate_study.Extent()
    atomic_files.check_apart(atomic_files.inside(out, surrogate_report.FILES), [store])
    with (
        stores.opened(store or stores.default()) as states,
        atomic_files.results(out) as folder,
        console.progress(as_json=as_json) as progress,
    ):
        result = surrogate_study.run(extent, states, Processes(workers, scheduler), progress)
        rows = surrogate_test.summaries(result.errors)
        if folder is not None:
            surrogate_report.write(folder, result, extent.first, versions(("matplotlib",)), command_line)
    console.report(
        [records.flat(row) for row in rows],
        as_json=as_json,
        title="Errors on unseen beams",
        first=("kind", "quantity", "region", "p95_percent", "covered_beams_percent", "least_covered_percent"),
        wide=wide,
    )
    lost = missed(surrogate_test.goals(rows))
    for goal in lost:
        console.warn(str(goal))
    return FAILED if lost or not rows else GOOD
