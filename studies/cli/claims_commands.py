"""The verbs that test the paper: claims, assumption."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.exit_status import GOOD
from studies.inputs.option_groups import Whole
from studies.output import atomic_files, console, records


def claims(
    *,
    quick: bool = False,
    out: Path | None = None,
    store: Path | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Test each claim of the paper: reproduced, refuted or not decidable, with figures and the paper's plots redrawn.

    Parameters
    ----------
    quick
        Use few loads and coarser meshes: some seconds instead of some minutes.
    out
        Folder for CLAIMS.md, tables and plots.
    store
        File of solved states; default: that of the user, which the environment variable MAGTIP_STORE can name.
    """
    command_line = command(claims, locals())
    from studies.claims import claim_states, claims_report, paper_claims
    from studies.exploration import store as stores
    from studies.output.provenance import versions

    origin = versions(("matplotlib",))
    extent = claim_states.QUICK_EXTENT if quick else claim_states.Extent()
    atomic_files.check_apart(atomic_files.inside(out, claims_report.FILES), [store])
    with (
        stores.opened(store or stores.default()) as states,
        atomic_files.results(out) as folder,
        console.progress(as_json=as_json) as progress,
    ):
        results = paper_claims.run(extent, states, progress)
        if folder is not None:
            claims_report.write(folder, results, origin, command_line)
    rows = [answer.row() if as_json else answer.printed() for answer in results.answers]
    console.report(rows, as_json=as_json, title="The paper's claims", first=("claim", "verdict"), wide=wide)
    return GOOD


def assumption(
    study: Annotated[
        Path | None, Parameter(name="STUDY", help="TOML file of a study; default: the shipped one.")
    ] = None,
    /,
    *,
    out: Path | None = None,
    store: Path | None = None,
    workers: Whole | None = None,
    scheduler: str | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Map where the paper's formulas, and every level above them, are within 5 and 10 % of finite elements.

    Parameters
    ----------
    out
        Folder for ASSUMPTION.md, tables and maps.
    store
        File of solved states; default: that of the user, which the environment variable MAGTIP_STORE can name.
    workers
        Number of processes that solve; default: one for each core.
    scheduler
        Address of a Dask scheduler whose workers solve.
    """
    command_line = command(assumption, locals())
    from studies.claims import assumption_report, beam_assumption
    from studies.exploration.needed_paths import Processes
    from studies.output.provenance import versions

    origin = versions(("matplotlib",))
    source = study or beam_assumption.STUDY
    plan = beam_assumption.plan_of(source)
    atomic_files.check_apart([*atomic_files.inside(out, assumption_report.FILES), store], [source])
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        result = beam_assumption.run(plan, progress, Processes(workers, scheduler), store)
        if folder is not None:
            assumption_report.write(folder, result, origin, command_line)
    rows = [records.flat(row) for row in result.shares]
    console.report(
        rows,
        as_json=as_json,
        title="Share of the cells within 5 and 10 %",
        first=("quantity", "level", "magnet_height_over_D", "within_10_percent"),
        wide=wide,
    )
    if not as_json:
        for line in result.sentences:
            print(line)
    return GOOD
