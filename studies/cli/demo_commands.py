"""The verb demo: the paper's sensor from start to end."""

from __future__ import annotations

from pathlib import Path

from studies.cli.printed_command import command
from studies.output import atomic_files, console, own_files
from studies.output.result import Destination, Result, show


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
    lost = outcome["status"] != "ok"
    result = Result(
        title="Demo",
        records=[],
        shown=[
            *(f"- {sentence}" for sentence in outcome["summary"]["sentences"]),
            f"All results are in {out}; start with REPORT.md.",
        ],
        failures=[f"part of the demo failed: {outcome['message']}"] if lost else [],
    )
    return show(result, Destination())
