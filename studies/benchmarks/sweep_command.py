"""One sweep as a command: its time, its memory, its progress, and how its table grows on the disk."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.output.provenance import ROOT

PROGRESS = re.compile(r" *(\d+) % (\d+) of (\d+) solves(?:, ([\d:]+) left)?")
"""Line of progress: share of the work, number of finished and of all solves, time left."""
SAMPLING = 0.1
"""Time between two looks at the table on the disk, s."""


@dataclass(frozen=True, slots=True)
class SweepRun:
    """A command that has ended.

    Attributes
    ----------
    wall_s, cpu_s, peak_MB : of the process and its worker processes, from start to end.
    lines : time from the start, s, and text of each line on standard error.
    sizes : time from the start, s, and size of the largest file of the output folder, bytes.
    """

    wall_s: float
    cpu_s: float
    peak_MB: float
    lines: Sequence[tuple[float, str]]
    sizes: Sequence[tuple[float, int]]

    @property
    def failed(self) -> int:
        """Number of failed cases."""
        counts = [re.match(r"magtip: (\d+) of \d+ cases failed", text) for _, text in self.lines]
        return sum(int(count[1]) for count in counts if count)

    def written(self, share: float) -> float:
        """Return the largest size of a file after a share of the time over its size at the end."""
        until = [size for at, size in self.sizes if at <= share * self.wall_s]
        return max(until, default=0) / max((size for _, size in self.sizes), default=1)


def run(words: Iterable[object], folder: Path | None, *, workers: int | None = None) -> SweepRun:
    """Run a sweep and return what it took.

    Parameters
    ----------
    words : study or design, and options of the sweep.
    folder : of its output; None writes no files.
    """
    command = [sys.executable, "-m", "studies.cli", "sweep", *map(str, words)]
    command += [] if folder is None else ["--out", str(folder)]
    command += [] if workers is None else ["--workers", str(workers)]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    env = {**os.environ, **threads, "PYTHONPATH": str(ROOT)}
    lines: list[tuple[float, str]] = []
    sizes: list[tuple[float, int]] = []
    begin = time.perf_counter()
    process = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    ended = threading.Event()
    watch = threading.Thread(target=_watch, args=(folder, begin, sizes, ended))
    watch.start()
    for line in process.stderr:
        lines.append((time.perf_counter() - begin, line.rstrip("\n")))
    # the times of the process include those of its own children that it has waited for
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - begin
    process.returncode = os.waitstatus_to_exitcode(status)
    process.stderr.close()
    ended.set()
    watch.join()
    if process.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with status {process.returncode}: {lines[-1:]}")
    return SweepRun(wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, lines, sizes)


def _watch(folder: Path | None, begin: float, sizes: list[tuple[float, int]], ended: threading.Event) -> None:
    """Note the size of the largest file of a folder again and again, until the process has ended."""
    while not ended.wait(SAMPLING):
        sizes.append((time.perf_counter() - begin, _largest(folder)))
    sizes.append((time.perf_counter() - begin, _largest(folder)))


def _largest(folder: Path | None) -> int:
    sizes = [0]
    for path in folder.rglob("*") if folder and folder.exists() else ():
        try:
            sizes.append(path.stat().st_size)
        except FileNotFoundError:
            continue
    return max(sizes)


def time_left_ratio(lines: Sequence[tuple[float, str]], share: float = 0.2) -> float:
    """Return the time that was left after a share of the work over the time that progress then announced.

    >>> lines = [(2.0, "10 % 1 of 10 solves, 0:18 left"), (4.0, "20 % 2 of 10 solves, 0:10 left")]
    >>> time_left_ratio([*lines, (19.0, "100 % sweep.csv and sweep.png")])
    1.5
    """
    matches = [(at, match) for at, text in lines if (match := PROGRESS.match(text))]
    end = next(at for at, text in lines if text.startswith("100 %"))
    at, first = next((at, match) for at, match in matches if int(match[1]) >= 100 * share and match[4])
    announced: int = sum(60**k * int(part) for k, part in enumerate(reversed(first[4].split(":"))))
    return (end - at) / max(announced, 1)
