"""What a command waits for before it does anything: the imports of some verbs, and the time of whole commands.

`python -m studies.benchmarks.startup_benchmark results/startup` writes startup.csv, imports.csv and STARTUP.md.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.benchmarks import benchmark_tables
from studies.output import atomic_files, console, records
from studies.output.provenance import ROOT

ABOUT = """\
Every run is a new process on one thread, with files in the system's cache and with compiled modules kept, as in an
installed package. Figures are medians of {runs} runs of the commands by turns, or of {few} runs for cad, which makes
all its parts. Imports are the times of all modules by `python -X importtime`, including modules that are imported
while the command runs; this option itself costs some time. CPU and wall time are those of the whole process without
this option, from start to end. The time of solving is part of them: `seconds` of the solved state.
"""

IMPORTS_GOAL_S, HELP_GOAL_S = 0.4, 0.25
"""Imports of a solve; CPU seconds of the list of verbs."""
RUNS, FEW = 9, 3
DEAREST = 10

COMMANDS = {
    "magtip --help": ("--help",),
    "magtip design paper": ("design", "paper"),
    "magtip solve paper --depth 1": ("solve", "paper", "--depth", "1", "--json"),
    "magtip cad paper": ("cad", "paper", "--out", "{folder}"),
}
HELP, _, SOLVE, CAD = COMMANDS
TIMED = (HELP, SOLVE)
"""Whose whole time is measured too."""


@dataclass(frozen=True, slots=True)
class Start:
    """A command: what it imports, and what all of it takes."""

    command: str
    runs: int
    imports_s: float
    modules: int
    cpu_s: float | None
    clock_s: float | None
    solving_s: float | None


@dataclass(frozen=True, slots=True)
class ModuleImport:
    """A module that a solve imports: its own time, without that of the modules that it imports itself."""

    module: str
    own_ms: float


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a whole command."""

    cpu_s: float
    clock_s: float
    solving_s: float | None


def own_times(log: str) -> dict[str, float]:
    """Seconds of each module itself, from what `-X importtime` writes.

    >>> own_times("import time: self [us] | cumulative | imported package\\nimport time:  120 |  300 |   json")
    {'json': 0.00012}
    """
    rows = [
        line.removeprefix("import time:").split("|") for line in log.splitlines() if line.startswith("import time:")
    ]
    return {name.strip(): int(own) / 1e6 for own, _, name in rows if own.strip().isdigit()}


def environment(compiled: Path) -> dict[str, str]:
    """That of a child: this code, one thread, compiled modules kept in a folder."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, **threads, "PYTHONPATH": str(ROOT), "PYTHONPYCACHEPREFIX": str(compiled)}


def imports(words: Sequence[str], child: Mapping[str, str]) -> dict[str, float]:
    """Seconds of each module that a command imports."""
    command = [sys.executable, "-X", "importtime", "-m", "studies.cli", *words]
    return own_times(subprocess.run(command, env=child, capture_output=True, text=True, check=True).stderr)


def whole(words: Sequence[str], child: Mapping[str, str]) -> Run:
    """What a command takes from its start to its end."""
    command = [sys.executable, "-m", "studies.cli", *words]
    before, begin = os.times(), time.perf_counter()
    shown = subprocess.run(command, env=child, capture_output=True, text=True, check=True).stdout
    clock, after = time.perf_counter() - begin, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return Run(cpu, clock, json.loads(shown)["seconds"] if "--json" in words else None)


def measured(commands: Mapping[str, Sequence[str]], runs: int) -> tuple[list[Start], list[ModuleImport]]:
    """Every command, and every module of a solve by its own time, the slowest first: medians of runs by turns."""
    logs: dict[str, list[dict[str, float]]] = defaultdict(list)
    times: dict[str, list[Run]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        child = environment(Path(folder) / "compiled")
        for run in range(-1, runs):  # the first of all compiles modules and reads files: it does not count
            for name, words in commands.items():
                if name == CAD and run >= min(FEW, runs):
                    continue
                filled = [word.format(folder=Path(folder) / "parts") for word in words]
                log, ended = imports(filled, child), whole(filled, child) if name in TIMED else None
                if run >= 0:
                    logs[name].append(log)
                    times[name] += [ended] if ended else []
            console.say(f"run {run + 1} of {runs}")
    starts = [_start(name, logs[name], times[name]) for name in commands]
    return starts, _medians(logs[SOLVE])


def _start(name: str, logs: Sequence[Mapping[str, float]], times: Sequence[Run]) -> Start:
    solving = [run.solving_s for run in times if run.solving_s is not None]
    return Start(
        name,
        len(logs),
        statistics.median(sum(log.values()) for log in logs),
        len(logs[0]),
        statistics.median(run.cpu_s for run in times) if times else None,
        statistics.median(run.clock_s for run in times) if times else None,
        statistics.median(solving) if solving else None,
    )


def _medians(logs: Sequence[Mapping[str, float]]) -> list[ModuleImport]:
    names = dict.fromkeys(name for log in logs for name in log)
    medians = [ModuleImport(name, 1e3 * statistics.median(log.get(name, 0.0) for log in logs)) for name in names]
    return sorted(medians, key=lambda module: -module.own_ms)


def libraries(modules: Sequence[ModuleImport]) -> dict[str, float]:
    """Return the milliseconds of each top-level package, the slowest first.

    >>> libraries([ModuleImport("json", 1.0), ModuleImport("numpy.linalg", 2.0), ModuleImport("numpy", 1.5)])
    {'numpy': 3.5, 'json': 1.0}
    """
    sums: dict[str, float] = defaultdict(float)
    for module in modules:
        sums[module.module.partition(".")[0]] += module.own_ms
    return dict(sorted(sums.items(), key=lambda item: -item[1]))


def report(starts: Sequence[Start], modules: Sequence[ModuleImport], about: Mapping[str, str]) -> str:
    """Return the text of STARTUP.md: goals, commands, slowest modules of a solve, and how it was measured."""
    by_name = {start.command: start for start in starts}
    goals = (
        (f"imports of a solve at most {IMPORTS_GOAL_S:g} s", by_name[SOLVE].imports_s, IMPORTS_GOAL_S),
        (f"list of verbs at most {HELP_GOAL_S:g} s of CPU", by_name[HELP].cpu_s or 0.0, HELP_GOAL_S),
    )
    lines = ["# Start-up", "", "`python -m studies.benchmarks.startup_benchmark results/startup`", ""]
    lines += _table(("goal", "measured", "met"), [(n, f"{v:.2f} s", _met(v <= most)) for n, v, most in goals])
    lines += ["## Commands", ""]
    heads = ("command", "modules", "imports, s", "whole command: CPU, s", "wall, s", "solving, s")
    rows = [
        (s.command, str(s.modules), *map(_seconds, (s.imports_s, s.cpu_s, s.clock_s, s.solving_s))) for s in starts
    ]
    lines += _table(heads, rows)
    lines += [
        f"## The {DEAREST} slowest imports of a solve",
        "",
        "Each without the modules that it imports itself.",
        "",
    ]
    lines += _table(("module", "ms"), [(f"`{m.module}`", f"{m.own_ms:.1f}") for m in modules[:DEAREST]])
    sums = list(libraries(modules).items())
    lines += ["By package:", ""]
    lines += _table(("package", "ms"), [(f"`{name}`", f"{own:.1f}") for name, own in sums[:DEAREST]])
    lines += ["Every module is in imports.csv.", "", "## How it was measured", ""]
    lines += ABOUT.format(runs=by_name[SOLVE].runs, few=by_name[CAD].runs).splitlines()
    lines += ["", *(f"- {name}: {value}" for name, value in about.items())]
    return "\n".join(lines) + "\n"


def _seconds(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"


def _met(met: bool) -> str:
    return "yes" if met else "**no**"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(cells)} |" for cells in (heads, ["---"] * len(heads), *rows)] + [""]


def main(out: str) -> None:
    """Measure, and write startup.csv, imports.csv and STARTUP.md into a folder."""
    from studies.output.csv_tables import write_table

    with atomic_files.filled(out) as folder:
        about = benchmark_tables.machine()
        starts, modules = measured(COMMANDS, RUNS)
        write_table(folder / "startup.csv", [records.flat(start) for start in starts], digits=3)
        write_table(folder / "imports.csv", [records.flat(module) for module in modules], digits=3)
        atomic_files.write_text(folder / "STARTUP.md", report(starts, modules, about))


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "out/startup")
