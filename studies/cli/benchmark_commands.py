"""The verbs that measure computing time and memory: bench, trade."""

from __future__ import annotations

from pathlib import Path

from geometry.design import BadInput
from studies.cli.command_output import report_goals
from studies.cli.parameters import AsJson, Wide
from studies.cli.printed_command import command
from studies.inputs.exit_status import GOOD
from studies.inputs.option_groups import Whole
from studies.output import atomic_files, console, own_files


def bench(
    *,
    quick: bool = False,
    cases: str | None = None,
    peers: Path = Path("out/peers"),
    ccx: str = "ccx",
    out: Path | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Measure time and memory at a given error beside FElupe, CalculiX and an earlier commit, and how cost grows.

    A program that is not installed gets a row with its install command. Missed goals are listed; the exit status is
    then 3, also where a program is not installed.

    Parameters
    ----------
    quick
        Use medians of 3 runs instead of 5, and at most 50 000 unknowns.
    cases
        Run only some cases, with commas between their names: compiled, press-curve, section, half-press,
        half-press-magnet, half-shear, shear, friction, tilted-plate, small-shear, modes, field, first-call, growth;
        default: all.
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

    own_files.check(out, ("BENCH.md", "bench.csv", "size.png"))
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        rows = study.run(
            quick=quick,
            cases=[] if cases is None else [name.strip() for name in cases.split(",")],
            folder=folder,
            command=command_line,
            peers_folder=peers,
            ccx=ccx,
            progress=progress,
        )
    console.report(
        [row.row() for row in rows], as_json=as_json, title="Speed", brief=benchmark_tables.BRIEF, wide=wide
    )
    for row in rows:
        if row.message:
            console.say(f"magtip: {row.case}: {row.message}")
    return report_goals(benchmark_tables.goals(rows))


def trade(
    *,
    designs: Whole = 24,
    confirm: bool = False,
    quick: bool = False,
    out: Path | None = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Measure cost and true error of every model over the range of designs; the rule of --tolerance follows.

    Parameters
    ----------
    designs
        Number of designs, 2 to 24.
    confirm
        Check the rule on 78 random designs; exit status 3 if a goal is missed.
    quick
        Use the section models at accuracy quick in presses and glued shears only: seconds instead of an hour.
    out
        Folder for trade.csv, TRADE.md, trade.png, model_choice.json and all solves; a run that was stopped continues
        from there.
    """
    command_line = command(trade, locals())
    from studies.benchmarks import trade_cases, trade_report, trade_rule
    from studies.benchmarks import trade_study as study
    from studies.output.provenance import versions

    if not 2 <= designs <= trade_cases.STUDIED:
        raise BadInput(f"--designs must lie between 2 and {trade_cases.STUDIED}; got {designs}")
    origin = versions()
    own_files.check(out, trade_report.FILES)
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        states = study.run(study.plan(designs, quick=quick), folder, progress)
        rule = trade_rule.statements(states)
        results = []
        if confirm:
            states += study.run(study.confirming_plan(quick=quick), folder, progress)
            results = list(trade_rule.confirm(states, rule))
        if folder is not None:
            trade_report.write(folder, states, rule, results, origin, command_line)
    first = ("kind", "model", "level", "force_p95_percent", "shift_p95_percent", "cpu_s", "cost")
    table = [cell.row() for cell in trade_report.cells(states)]
    console.report(table, as_json=as_json, title="Cost and error", first=first, wide=wide)
    if not confirm:
        return GOOD
    confirmed = trade_rule.summary(results)
    console.report([row.row() for row in confirmed], as_json=as_json, title="Confirmation", wide=wide)
    return report_goals(trade_rule.goals(results, study.QUICK_KINDS if quick else trade_cases.KINDS))
