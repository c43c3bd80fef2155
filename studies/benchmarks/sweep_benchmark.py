"""Sweeps: time, memory and solves of large studies, the gain of workers, and what a killed sweep leaves behind.

`python -m studies.benchmarks.sweep_benchmark results/scale [KILLS]` writes scale.csv, kills.csv and SCALE.md. ABOUT
of `sweep_report` describes the measurements.
"""

from __future__ import annotations

import csv
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from studies.benchmarks import benchmark_tables, cluster_estimate, sweep_command, sweep_kills
from studies.benchmarks.sweep_command import SweepRun, time_left_ratio
from studies.benchmarks.sweep_kills import Kill
from studies.benchmarks.sweep_report import Figure, report
from studies.output import atomic_files, console, records

COMMAND = "python -m studies.benchmarks.sweep_benchmark results/scale"
DESIGNS = ("D=lin:6:11:6", "L=lin:12:17:6", "f=lin:0.5:3:6", "E=0.1,0.2,0.3,0.5,0.7,1")
PRESSES = (*DESIGNS, "depth=lin:0.2:1:5")
SHEARS = """\
version = 2
design = "paper"

[axes]
D = { linspace = [6, 11, 6] }
L = { linspace = [12, 17, 6] }
f = { linspace = [0.5, 3, 6] }
E = [0.1, 0.2, 0.3, 0.5, 0.7, 1]

[[zipped]]
depth = [0.2, 0.4, 0.6, 0.8, 1, 1, 1, 1, 1]
shear = [0, 0, 0, 0, 0, 0.2, 0.4, 0.6, 0.8]
"""
"""Study of presses and of shears under the last depth."""
HALL = ("f=lin:0.5:5:20", "hall_gain=lin:10:50:20", "c=lin:1:4:25", "depth=lin:0.2:1:5")
COUNTS = (5, 20, 40)
"""Numbers of values of E in studies with a quarter of a million, a million and two million rows."""
GAIN = ("L=lin:10:16:24", "depth=0.4,0.8")
TURNS = 3
KILLS = 50
PAIRS = 36
"""Different presses of the designs, and different shears."""
LEFT = 1.5
"""Largest factor between the time left that is announced and the time that it takes."""


def axis_words(axes: Sequence[str]) -> list[str]:
    """Return the words of a sweep of the paper's sensor over axes."""
    return ["paper", *(word for axis in axes for word in ("--axis", axis))]


def grid(folder: Path, case: str, words: Sequence[object], goal_s: float) -> tuple[list[Figure], list[SweepRun]]:
    """Return the figures of a study over the designs: solved, and again from the store; and these runs."""
    options = [*words, "--store", folder / f"{case}.sqlite"]
    runs = [sweep_command.run(options, folder / f"{case} {k}") for k in ("one", "one", "two")]
    rows, presses, shears = _solves(folder / f"{case} one" / "sweep.csv")
    runs.append(sweep_command.run(options, None))
    first, same, other, bare = runs
    console.say(f"{case}: {first.wall_s:.1f} s, again {same.wall_s:.1f}, {other.wall_s:.1f} and {bare.wall_s:.1f} s")
    figures = [
        Figure(case, "rows", rows, ""),
        Figure(case, "rows that failed", first.failed, "", 0),
        Figure(case, "solves of presses", presses, "", PAIRS),
        *([Figure(case, "solves of shears", shears, "", PAIRS)] if shears else []),
        Figure(case, "time", first.wall_s, "s", goal_s),
        Figure(case, "CPU time", first.cpu_s, "s"),
        Figure(case, "again from the store, same folder", same.wall_s, "s", 2.0),
        Figure(case, "CPU time again, same folder", same.cpu_s, "s"),
        Figure(case, "again from the store, another folder", other.wall_s, "s", 2.0),
        Figure(case, "CPU time again, another folder", other.cpu_s, "s"),
        Figure(case, "again from the store, no files", bare.wall_s, "s", 2.0),
        Figure(case, "CPU time again, no files", bare.cpu_s, "s"),
        Figure(case, "CPU time of a solve", (first.cpu_s - same.cpu_s) / (presses + shears), "s"),
    ]
    ratio = time_left_ratio(first.lines)
    return [*figures, Figure(case, "time left: wrong by a factor of", max(ratio, 1 / ratio), "", LEFT)], runs


def _solves(file: Path) -> tuple[int, int, int]:
    """Return the number of rows of a table, and of different solves of presses and of shears."""
    with file.open(encoding="utf-8", newline="") as lines:
        kinds = [(row["solve"], float(row.get("shear_mm") or 0) != 0) for row in csv.DictReader(lines)]
    different = set(kinds)
    return len(kinds), sum(not sheared for _, sheared in different), sum(sheared for _, sheared in different)


def million(folder: Path, counts: Sequence[int] = COUNTS) -> list[Figure]:
    """Return the figures of a study of a million rows, of one of a quarter of them, and of one of twice as many."""
    runs, sizes = [], []
    for count in counts:
        out = folder / f"rows {count}"
        words = [*axis_words((f"E=lin:0.1:1:{count}", *HALL)), "--store", folder / "million.sqlite"]
        runs.append(sweep_command.run(words, out))
        sizes.append(_parquet_rows(out))
        console.say(f"{sizes[-1]} rows: {runs[-1].wall_s:.1f} s")
    quarter, whole, twice = runs
    file = folder / f"rows {counts[1]}" / "sweep.parquet"
    case = "a million rows"
    return [
        Figure(case, "rows", sizes[1], "", 1e6, more=True),
        Figure(case, "time", whole.wall_s, "s", 60.0),
        Figure(case, "CPU time", whole.cpu_s, "s"),
        Figure(case, "CPU time of a row", 1e6 * (twice.cpu_s - quarter.cpu_s) / (sizes[2] - sizes[0]), "us"),
        Figure(case, "peak memory", whole.peak_MB, "MB", 1000.0),
        Figure(case, f"peak memory of {sizes[0]} rows", quarter.peak_MB, "MB"),
        Figure(case, f"peak memory of {sizes[2]} rows", twice.peak_MB, "MB"),
        Figure(case, f"peak memory over that of {sizes[0]} rows", whole.peak_MB / quarter.peak_MB, "", 1.1),
        Figure(
            case, f"peak memory of {sizes[2]} rows over that of a million", twice.peak_MB / whole.peak_MB, "", 1.1
        ),
        Figure(case, "size of the file", file.stat().st_size / 1e6, "MB"),
        Figure(
            case, "share of the file that is written at half of the time", whole.written(0.5), "", 0.25, more=True
        ),
    ]


def _parquet_rows(folder: Path) -> int:
    """Return the number of rows of a sweep's table."""
    from pyarrow import parquet

    return int(parquet.read_metadata(folder / "sweep.parquet").num_rows)


def gain(folder: Path, axes: Sequence[str] = GAIN, turns: int = TURNS) -> list[Figure]:
    """Return how much faster two workers are than one, by turns."""
    times: dict[int, list[float]] = {1: [], 2: []}
    for turn in range(turns):
        for workers, walls in times.items():
            options = [*axis_words(axes), "--accuracy", "quick", "--store", folder / f"{workers}-{turn}.sqlite"]
            walls.append(sweep_command.run(options, folder / f"{workers}-{turn}", workers=workers).wall_s)
    one, two = (statistics.median(walls) for walls in times.values())
    return [
        Figure("workers", "time by one worker", one, "s"),
        Figure("workers", "time by two workers", two, "s"),
        Figure("workers", "gain of two workers over one", one / two, ""),
    ]


def kill_figures(kills: Sequence[Kill]) -> list[Figure]:
    """Return what kills of a sweep have left behind."""
    case = f"a sweep killed {len(kills)} times"
    return [
        Figure(case, "rows that were printed", sum(kill.rows for kill in kills), ""),
        Figure(case, "rows that were printed and are lost", sum(kill.lost for kill in kills), "", 0),
        Figure(case, "solves begun", sum(kill.begun for kill in kills), ""),
        Figure(case, "solves to repeat after a kill, largest", max(kill.unfinished for kill in kills), "", 2),
        Figure(case, "solves repeated in all", sum(kill.repeated for kill in kills), "", 2 * len(kills)),
        Figure(case, "worker processes left after 2 s", sum(kill.survivors for kill in kills), "", 0),
        Figure(case, "time until all worker processes have ended, largest", max(k.ended_s for k in kills), "s"),
        Figure(case, "stores that fail a check", sum(not kill.intact for kill in kills), "", 0),
        Figure(case, "completed sweeps, all with the rows of an undisturbed one", max(k.round for k in kills), ""),
    ]


def main(out: str, kills: str = str(KILLS)) -> None:
    """Measure, and write scale.csv, kills.csv and SCALE.md into a folder."""
    from studies.output.csv_tables import write_table

    about = benchmark_tables.machine()
    with atomic_files.filled(out) as folder, tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        study = scratch / "shears.toml"
        study.write_text(SHEARS, encoding="utf-8")
        presses, press_runs = grid(scratch, "presses", axis_words(PRESSES), 10.0)
        shears, shear_runs = grid(scratch, "presses and shears", [study], 60.0)
        solve = (press_runs[0].cpu_s - press_runs[1].cpu_s) / PAIRS
        shear = (shear_runs[0].cpu_s - shear_runs[1].cpu_s) / PAIRS - solve
        figures = [*presses, *shears, *million(scratch), *gain(scratch)]
        figures += cluster_estimate.figures(scratch, {"press": solve, "shear": shear})
        console.say("estimate for a cluster done")
        each = list(sweep_kills.kills(scratch, int(kills)))
        figures += kill_figures(each)
        write_table(folder / "kills.csv", [records.flat(kill) for kill in each], digits=4)
        write_table(folder / "scale.csv", [figure.row() for figure in figures], digits=8)
        atomic_files.write_text(folder / "SCALE.md", report(figures, about, COMMAND))


if __name__ == "__main__":
    main(*(sys.argv[1:3] or [str(Path("out", "scale"))]))
