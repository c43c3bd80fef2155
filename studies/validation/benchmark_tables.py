"""The files of the bench: bench.csv, BENCH.md, size.png, and what is said of the machine."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from studies.output import provenance, records
from studies.output.atomic_files import write_text
from studies.output.goals import Goal, page_lines
from studies.output.records import FlatRow


@dataclass(frozen=True, slots=True)
class BenchRow:
    """One measured program in one case; None where a number is not known.

    Attributes
    ----------
    setting : mesh, or what was measured.
    force_N : of the last load.
    error_percent : of the worst load.
    exponent : of a fit over the unknowns.
    faster : how many times magtip is faster.
    earlier_s, earlier_error_percent : CPU seconds and error of the earlier commit, run by turns.
    times_as_fast : median over the turns of its CPU seconds over magtip's.
    floor_s, times_floor : time that the operations of the linear algebra need at least, and CPU seconds over it.
    goal, met : what was promised, and whether it holds.
    """

    case: str
    program: str
    setting: str
    dofs: int | None = None
    iterations: int | None = None
    runs: int | None = None
    import_s: float | None = None
    cpu_s: float | None = None
    mesh_s: float | None = None
    wall_s: float | None = None
    peak_MB: float | None = None
    force_N: Sequence[float] | None = None
    error_percent: float | None = None
    exponent: float | None = None
    faster: float | None = None
    goal: str = ""
    met: bool | None = None
    status: str = "ok"
    message: str = ""
    earlier_s: float | None = None
    earlier_error_percent: float | None = None
    times_as_fast: float | None = None
    floor_s: float | None = None
    times_floor: float | None = None

    def row(self) -> FlatRow:
        """Return the columns of bench.csv and JSON."""
        return records.flat(self)


HEADS = {
    "setting": "setting",
    "dofs": "unknowns",
    "iterations": "iterations",
    "error_percent": "error %",
    "runs": "runs",
    "import_s": "imports s",
    "cpu_s": "CPU s",
    "mesh_s": "mesher CPU s",
    "wall_s": "wall s",
    "peak_MB": "peak MB",
    "faster": "magtip faster by a factor of",
    "earlier_s": "CPU s of commit f83a532",
    "earlier_error_percent": "its error %",
    "times_as_fast": "times as fast as commit f83a532",
    "goal": "goal",
    "met": "met",
    "status": "status",
}

FLOOR = """\
The floor is the time that this machine needs at least for the linear algebra of a case on one thread: the operations
of all its factorisations (by minimum degree) and assemblies at its size, over the rate of products of large
matrices, or their bytes over the rate of sums of long arrays, whichever is longer. Nothing runs at the floor: small
systems do not reach these rates, and the material, contact, mesh and Python come on top. A method with fewer
factorisations has a lower floor. The floor of the field is that of reading the points and writing the field."""

BRIEF = (
    *("iterations", "runs", "import_s", "mesh_s", "wall_s", "force_N", "message", "exponent"),
    *("earlier_s", "earlier_error_percent", "floor_s", "times_floor"),
)
"""Left out of the printed table."""


def machine() -> dict[str, str]:
    """Return the machine of the measurements: processor, system, load, versions."""
    found = {"machine": f"{_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.release()}"}
    if hasattr(os, "getloadavg"):
        found["load before"] = f"{os.getloadavg()[0]:.2f} processes in the last minute"
    found["magtip"] = f"{provenance.installed('magtip')}, commit {provenance.commit() or 'unknown'}"
    found["Python"] = platform.python_version()
    for name in ("numpy", "scipy", "scikit-fem", "pytetwild", "mkl"):
        found[name] = provenance.installed(name) or "not installed"
    return found


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def write(folder: Path, rows: Sequence[BenchRow], about: Mapping[str, str], command: str, text: str) -> None:
    """bench.csv, BENCH.md and size.png."""
    from studies.output.csv_tables import write_table

    write_table(folder / "bench.csv", [row.row() for row in rows], digits=6)
    sizes = [row.row() for row in rows if row.case.startswith("cost against size") and row.dofs]
    fits = {row.setting: row.exponent for row in rows if row.exponent is not None}
    if len(sizes) > 1:
        draw_size(folder / "size.png", sizes)
    write_text(folder / "BENCH.md", report(rows, about, fits, command, text))


def draw_size(path: Path, rows: Sequence[FlatRow]) -> None:
    """Draw CPU time and peak memory of the half model over its number of unknowns, on logarithmic axes."""
    from studies.output.table_plots import ANALYTIC, FEM, HOMOGENEOUS, canvas, label, log_numbers

    n = [row["dofs"] for row in rows]
    solve = [row["cpu_s"] - row["mesh_s"] for row in rows]
    curves = (("solve", solve, FEM, "o", "-"), ("mesh", [row["mesh_s"] for row in rows], ANALYTIC, "s", "--"))
    with canvas(path, 2, 1) as (_, axes):
        for name, y, colour, marker, dashes in curves:
            axes[0].plot(n, y, label=name, color=colour, marker=marker, linestyle=dashes)
        axes[1].plot(n, [row["peak_MB"] for row in rows], label="peak", color=HOMOGENEOUS, marker="^")
        proportional = [solve[-1] * (value / n[-1]) for value in n]
        axes[0].plot(n, proportional, color="#777777", linestyle=":", label="in proportion to the unknowns")
        label(axes[0], "a", "CPU time (s)")
        label(axes[1], "b", "peak memory (MB)")
        axes[1].set_xlabel("unknowns")
        for axis in axes:
            axis.set_xscale("log")
            axis.set_yscale("log")
            log_numbers(axis, "y")
            axis.legend(frameon=False, loc="upper left")
        log_numbers(axes[1], "x")


def goals(rows: Sequence[BenchRow]) -> list[Goal]:
    """Return the goals of the bench: answers of all programs, and each promise."""
    lost = sum(row.status not in ("ok", "left out") for row in rows)
    return [Goal("rows without an answer", lost, 0, len(rows))] + [
        Goal(f"{row.case} ({row.goal}), promises missed", None if row.met is None else not row.met, 0, 1)
        for row in rows
        if row.goal
    ]


def report(
    rows: Sequence[BenchRow], about: Mapping[str, str], fits: Mapping[str, float], command: str, text: str
) -> str:
    """Return the text of BENCH.md: goals met, a table for each case, how and where it was measured."""
    lines = ["# Speed", "", *page_lines(goals(rows)), ""]
    for case in dict.fromkeys(row.case for row in rows):
        own = [row.row() for row in rows if row.case == case and row.setting not in fits]
        keys = [key for key in HEADS if any(row[key] not in (None, "") for row in own)]
        lines += [f"## {case.capitalize()}", "", _line(["program", *(HEADS[key] for key in keys)])]
        lines.append("|---" * (len(keys) + 1) + "|")
        lines += [_line([row["program"], *(_text(key, row[key]) for key in keys)]) for row in own]
        lines += ["", *(f"- {row['program']}: {row['message']}" for row in own if row["message"])]
        if any(row.case == case and row.setting in fits for row in rows):
            lines += [*(f"- {name}, n unknowns" for name in fits), "", "![Cost against size](size.png)"]
        lines.append("")
    lines += _floors(rows)
    lines += ["## How it was measured", "", *text.splitlines(), ""]
    lines += [f"- command: `{command}`"] if command else []
    lines += [f"- {name}: {value}" for name, value in about.items() if value]
    return "\n".join(lines) + "\n"


def _floors(rows: Sequence[BenchRow]) -> list[str]:
    """Return the section with the floors; nothing if none was measured."""
    own = [row for row in rows if row.floor_s is not None]
    if not own:
        return []
    heads = ["case", "setting", "floor s", "CPU s", "times the floor"]
    lines = ["## Floor", "", *FLOOR.splitlines(), "", _line(heads), "|---" * len(heads) + "|"]
    for row in own:
        numbers = (_text("floor_s", row.floor_s), _text("cpu_s", row.cpu_s), _text("times_floor", row.times_floor))
        lines.append(_line([row.case, row.setting, *numbers]))
    return [*lines, ""]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _text(key: str, value: Any) -> str:
    if value is None or value == "":
        return ""
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    if isinstance(value, float):
        # tens of milliseconds have two digits too
        digits = 0 if key == "peak_MB" else 4 if key in ("cpu_s", "floor_s", "earlier_s") and value < 0.1 else 2
        return f"{value:.{digits}f}"
    return str(value)
