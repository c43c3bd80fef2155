"""The verb demo: the paper's sensor from start to end."""

from __future__ import annotations

from pathlib import Path

from studies.cli.printed_command import command
from studies.output import atomic_files, console, own_files
from studies.output.result import FAILED, GOOD


def demo(*, out: Path = Path("out/demo")) -> int:
    """Study the paper's sensor from start to end: CAD, mould, mesh, finite elements, formulas, comparison, report.

    Parameters
    ----------
    out
        Output folder.
    """
    command_line = command(demo, locals())
    from studies import demo as study

    own_files.check(out, study.WRITTEN)
    with atomic_files.filled(out) as folder, console.progress(as_json=False) as progress:
        outcome = study.run(folder, command=command_line, progress=progress)
    for sentence in outcome["summary"]["sentences"]:
        console.note(f"- {sentence}")
    console.note(f"All results are in {out}; start with REPORT.md.")
    if outcome["status"] != "ok":
        console.say(f"magtip: part of the demo failed: {outcome['message']}")
        return FAILED
    return GOOD
