"""The verbs that test the paper: claims."""

from __future__ import annotations

from pathlib import Path

from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.exit_status import GOOD
from studies.output import atomic_files, console


def claims(
    *,
    quick: bool = False,
    out: Path | None = None,
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
    """
    command_line = command(claims, locals())
    from studies.claims import claim_states, claims_report, paper_claims
    from studies.output.provenance import versions

    origin = versions(("matplotlib",))
    extent = claim_states.QUICK_EXTENT if quick else claim_states.Extent()
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        results = paper_claims.run(extent, progress)
        if folder is not None:
            claims_report.write(folder, results, origin, command_line)
    rows = [answer.row() if as_json else answer.printed() for answer in results.answers]
    console.report(rows, as_json=as_json, title="The paper's claims", first=("claim", "verdict"), wide=wide)
    return GOOD
