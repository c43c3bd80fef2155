"""The verbs about meshes in general: cache, range."""

from __future__ import annotations

from pathlib import Path

from geometry.design import BadInput
from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.exit_status import FAILED, GOOD
from studies.inputs.option_groups import Whole
from studies.output import atomic_files, console


def cache(*, clear: bool = False, as_json: AsJson = False) -> int:
    """Where meshes are kept, how many, their size and its limit (environment: MAGTIP_CACHE, MAGTIP_CACHE_MB).

    Parameters
    ----------
    clear
        Remove them.
    """
    from geometry.meshing import mesh_cache as kept

    found = kept.clear() if clear else kept.contents()
    record = {
        "folder": kept.OFF if found.folder is None else found.folder,
        "files": found.files,
        "size_MB": found.size / 1e6,
        "limit_MB": found.limit / 1e6,
    }
    console.report([record], as_json=as_json, title="Cache of meshes")
    return GOOD


def range_(*, count: Whole = 64, out: Path | None = None, wide: Wide = False, as_json: AsJson = False) -> int:
    """Solids, mould and meshes of designs sampled over the whole range; status 3 if one fails without a reason.

    Parameters
    ----------
    count
        How many of the sampled designs, 1 to 1024; 64 take some minutes, 4 a quarter of one.
    out
        Folder of range.csv, RANGE.md and rows.jsonl, from which a stopped run goes on.
    """
    asked = command(range_, locals())
    from studies.output.provenance import versions
    from studies.validation import design_range as work

    if not 1 <= count <= 1024:
        raise BadInput(f"count must lie between 1 and 1024; got {count}")
    origin = versions()
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        rows = []
        for row in work.run(count, folder, progress):
            rows.append(row)
            if as_json:
                print(atomic_files.json_line(row), flush=True)
        if folder is not None:
            work.write(folder, rows, origin, asked)
    if not as_json:
        console.report(work.summary(rows), as_json=False, title="Range of designs", wide=wide)
    failed = [f"design {row['design']}" for row in rows if row["status"] == "failed"]
    if failed:
        console.say(f"magtip: {len(failed)} of {len(rows)} designs fail: {', '.join(failed)}")
    return FAILED if failed else GOOD
