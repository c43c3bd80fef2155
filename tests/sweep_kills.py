"""What a sweep leaves behind when it is killed: its rows, its solves, its worker processes and its store.

A sweep is killed with SIGKILL, at random moments and each second time after its first row, and started again with the
same store, until it completes; then a new round begins with an empty store. Each solve notes in a log that it begins.
After each kill, `Kill` has what is in the store of the rows that were printed, which solves are begun but not stored,
and which processes are left.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studies.mechanics import path_keys, solve_plan, store, store_check
from studies.mechanics.path_solver import Task, solve_task
from studies.mechanics.solve_plan import Paths, Target
from studies.mechanics.store import State
from studies.mechanics.study_cases import Cases
from studies.output import console
from studies.output.provenance import ROOT
from studies.sweeps import sweep_request

LOG = "MAGTIP_SWEEP_KILLS_LOG"
"""Environment variable with the file in which solves note that they begin."""
SWEEP = """\
import sys
import sweep_kills
sweep_kills.note_solves()
from studies.cli.entry_point import main
sys.exit(main())
"""
"""Program that runs a command line of magtip whose solves note that they begin."""
AXES = ("L=lin:10:16:24", "depth=0.2,0.4")
WORKERS = 2
AFTERLIFE = 2.0
"""Time within which worker processes end after their parent was killed, s."""
MOST_BEGUN = 4
"""A kill comes when fewer solves have begun; the number is drawn first, so that a busy machine gets as far."""
SPAN = 0.5
"""Time over which kills are spread after that, s; it is longer than a solve."""
ROUNDING = 1e-9
"""Relative difference of values that compiled loops and NumPy give to the same state, at most."""


@dataclass(frozen=True, slots=True)
class Kill:
    """A kill of a sweep, and what is found afterwards.

    Attributes
    ----------
    rows : number of rows that the killed process had printed.
    lost : number of these rows whose state is not in the store, or that differ from those of an undisturbed sweep.
    begun : number of solves that the killed process had begun.
    unfinished : number of these whose states are not in the store; they are solved again.
    repeated : number of these that an earlier process of the round had begun too.
    workers : number of worker processes at the moment of the kill.
    survivors : number of these that still ran after `AFTERLIFE`.
    intact : whether the store passes all its checks.
    """

    rows: int
    lost: int
    begun: int
    unfinished: int
    repeated: int
    workers: int
    survivors: int
    intact: bool


def note_solves() -> None:
    """Let this process hand solves to its workers that note in the log that they begin."""
    setattr(solve_plan, "solve_task", noted_solve)  # noqa: B010


def noted_solve(task: Task) -> list[State]:
    """Note a solve in the log, and solve it."""
    positions = [path_keys.position_of(load, task.scene.design.D) for load in task.scene.loads]
    line = json.dumps([store.key(path_keys.content(task.scene, task.kind)), positions]) + "\n"
    # a single write to a file that is open to append is never mixed with that of another process
    with contextlib.closing(
        os.fdopen(os.open(os.environ[LOG], os.O_WRONLY | os.O_APPEND | os.O_CREAT), "ab", 0)
    ) as log:
        log.write(line.encode())
    return solve_task(task)


class KilledStudy:
    """A study that is killed again and again, and its rows when it is not disturbed."""

    def __init__(self, folder: Path, axes: Sequence[str], seed: int) -> None:
        self.folder, self.axes, self.moments = folder, axes, random.Random(seed)
        plan = sweep_request.plan_of("paper", sweep_request.Options(axes, magnet="ignored", accuracy="quick"))
        cases = Cases(plan)
        self.paths = Paths(plan, cases)
        batch = cases.batch(np.arange(plan.count))
        assert plan.reference is not None
        places = [
            self.paths.targets(*each)[plan.reference.name] for each in zip(batch.codes, batch.problems, strict=True)
        ]
        self.targets: list[Target] = [places[k] for k in batch.problem.tolist()]
        self.undisturbed = self.completed(folder / "undisturbed")

    def completed(self, base: Path) -> list[dict[str, Any]]:
        """Run the sweep to its end with the store of a round, and return its rows."""
        process = self._start(base)
        if process.wait() != 0:
            raise RuntimeError(f"the sweep ended with status {process.returncode}")
        return _rows(base)

    def kill(self, base: Path, *, after_row: bool = False) -> Kill | None:
        """Start the sweep with the store of a round and kill it at a random moment; None if it ends before.

        Parameters
        ----------
        base : path of the store and of the files beside it, without a suffix.
        after_row : kill it when it has printed a row.
        """
        before = _begun(base)
        solves, delay = self.moments.randrange(MOST_BEGUN), self.moments.uniform(0.0, SPAN)
        process = self._start(base)
        while process.poll() is None and not (
            _rows(base) if after_row else len(_begun(base)) >= len(before) + solves
        ):
            time.sleep(0.01)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.0 if after_row else delay)
        if process.poll() is not None:
            return None
        workers = _children(process.pid)
        process.kill()
        process.wait()
        killed = time.perf_counter()
        while (left := [pid for pid in workers if _runs(pid)]) and time.perf_counter() - killed < AFTERLIFE:
            time.sleep(0.01)
        rows, begun = _rows(base), _begun(base)[len(before) :]
        stored = self._stored(base)
        wrong = [
            not _agree(row, whole) or target.at not in stored[target.key]
            for row, whole, target in zip(rows, self.undisturbed, self.targets, strict=False)
        ]
        return Kill(
            rows=len(rows),
            lost=sum(wrong),
            begun=len(begun),
            unfinished=sum(not set(positions) <= stored[key] for key, positions in begun),
            repeated=sum(solve in before for solve in begun),
            workers=len(workers),
            survivors=len(left),
            intact=all(check["status"] == "ok" for check in store_check.checks(base.with_suffix(".sqlite"))),
        )

    def same(self, rows: Sequence[dict[str, Any]]) -> bool:
        """Return whether rows are those of the undisturbed sweep, but for the times of the solves and rounding."""
        return len(rows) == len(self.undisturbed) and all(map(_agree, rows, self.undisturbed))

    def _start(self, base: Path) -> subprocess.Popen[bytes]:
        """Start the sweep with the store of a round; its rows go to a file."""
        axes = [word for axis in self.axes for word in ("--axis", axis)]
        options = ["--magnet", "ignored", "--accuracy", "quick", "--workers", str(WORKERS), "--json"]
        words = ["sweep", "paper", *axes, *options, "--store", str(base.with_suffix(".sqlite"))]
        env = {**os.environ, LOG: str(base.with_suffix(".log")), "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
        with base.with_suffix(".jsonl").open("wb") as rows, base.with_suffix(".err").open("ab") as errors:
            return subprocess.Popen([sys.executable, "-c", SWEEP, *words], env=env, stdout=rows, stderr=errors)

    def _stored(self, base: Path) -> dict[str, set[store.Position]]:
        """Return the positions of all paths of the study in the store of a round."""
        with store.opened(base.with_suffix(".sqlite")) as kept:
            return {key: set(kept.states(path.place.content)) for key, path in self.paths.paths.items()}


def kills(folder: Path, count: int, seed: int = 1, axes: Sequence[str] = AXES) -> Iterator[Kill]:
    """Kill a sweep a number of times and yield each kill; complete each round and compare its rows.

    Raises
    ------
    RuntimeError
        The rows of a completed sweep differ from those of an undisturbed one.
    """
    study, done, number = KilledStudy(folder, axes, seed), 0, 1
    while done < count:
        base = folder / f"round{number}"
        # random moments are often too early for a row
        while done < count and (kill := study.kill(base, after_row=done % 2 == 1)) is not None:
            done += 1
            console.say(f"kill {done} of {count}: {kill}")
            yield kill
        # the sweep has completed, or is completed now
        rows = study.completed(base)
        if not study.same(rows):
            raise RuntimeError(f"the rows of round {number} differ from those of an undisturbed sweep")
        number += 1


def _agree(one: dict[str, Any], other: dict[str, Any]) -> bool:
    """Return whether two rows agree but for the time of their solves, to rounding.

    A process takes compiled loops once it has solved enough, and a sweep that goes on hands other solves to its
    workers, so that the last digits of a state depend on the kills.
    """
    return one.keys() == other.keys() and all(
        math.isclose(value, other[name], rel_tol=ROUNDING)
        if isinstance(value, float) and isinstance(other[name], float)
        else value == other[name]
        for name, value in one.items()
        if name != "seconds"
    )


def _rows(base: Path) -> list[dict[str, Any]]:
    """Return the rows that were printed completely."""
    lines = base.with_suffix(".jsonl").read_bytes().split(b"\n")
    return [json.loads(line) for line in lines[:-1]]


def _begun(base: Path) -> list[tuple[str, tuple[store.Position, ...]]]:
    """Return the solves that were begun in a round: key of the path and positions."""
    try:
        lines = base.with_suffix(".log").read_text("utf-8").splitlines()
    except FileNotFoundError:
        return []
    return [(key, tuple((depth, shear) for depth, shear in at)) for key, at in map(json.loads, lines)]


def _children(parent: int) -> list[int]:
    """Return the processes that a process has started and that still run."""
    return [pid for pid in map(int, filter(str.isdecimal, os.listdir("/proc"))) if _status(pid)[1:] == [str(parent)]]


def _runs(pid: int) -> bool:
    """Return whether a process runs; one that has ended may stay listed as a zombie until it is waited for."""
    return _status(pid)[:1] not in ([], ["Z"])


def _status(pid: int) -> list[str]:
    """Return state and parent of a process; nothing if there is no such process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[:2]
    except (FileNotFoundError, ProcessLookupError):
        return []
