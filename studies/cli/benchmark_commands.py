"""The verb that measures computing time and memory: bench."""

from __future__ import annotations

from pathlib import Path

from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.exit_status import GOOD
from studies.output import atomic_files, console


def bench(
    *,
    quick: bool = False,
    peers: Path = Path("out/peers"),
    ccx: str = "ccx",
    out: Path | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Measure time and memory at a given error beside FElupe and CalculiX, and how cost grows with size.

    A program that is not installed gets a row with its install command. Missed goals are listed; the exit status is
    0.

    Parameters
    ----------
    quick
        Use medians of 3 runs instead of 5, and at most 50 000 unknowns.
    peers
        Folder of a Python environment with FElupe: python3 -m venv DIR && DIR/bin/pip install felupe.
    ccx
        Command that runs CalculiX.
    out
        Folder for bench.csv, BENCH.md and size.png.
    """
    command_line = command(bench, locals())
    from studies.benchmarks import benchmark_tables
    from studies.benchmarks import solver_benchmark as study

    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        rows = study.run(
            quick=quick, folder=folder, command=command_line, peers_folder=peers, ccx=ccx, progress=progress
        )
    console.report(
        [row.row() for row in rows], as_json=as_json, title="Speed", brief=benchmark_tables.BRIEF, wide=wide
    )
    for row in rows:
        if row.message:
            console.say(f"magtip: {row.case}: {row.message}")
    missed = [f"{row.case} ({row.goal})" for row in rows if row.met is False]
    if missed:
        console.say(f"magtip: {len(missed)} goals are missed: {'; '.join(missed)}")
    return GOOD
