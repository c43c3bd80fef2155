"""A sweep that is killed twice: nothing that it reported is lost, little is solved again, no process is left."""

import contextlib
import io
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import pytest
from worker_tasks import SOLVES, children, gone, until

from studies.cli import commands
from studies.inputs.option_groups import Selection
from studies.mechanics import store_actions, store_check
from studies.output.provenance import ROOT

SWEEP = """\
import sys
import worker_tasks
from studies.cli.entry_point import main
from studies.mechanics import solve_plan
solve_plan.solve_task = worker_tasks.noted_solve
sys.exit(main())
"""
"""Program that runs a command line of magtip whose solves note that they begin."""
WORKERS = 2
DEPTHS = 0.2, 0.4
AFTERLIFE = 2.0
"""Time within which worker processes end after their parent was killed, s."""


class Kill(NamedTuple):
    """What a killed process had reported and begun, what is stored, and the processes of its workers."""

    rows: list[dict]
    begun: set[float]
    stored: set[tuple[float, float]]
    workers: list[int]
    survive: bool
    intact: bool

    @property
    def complete(self):
        """The lengths over D of which all states are stored."""
        return {L for L, _ in self.stored if all((L, round(d / 8, 9)) in self.stored for d in DEPTHS)}


class Sweep:
    """A sweep with a store, a log of the solves that begin, and the rows of its last process."""

    def __init__(self, folder):
        self.store, self.log, self.rows = (folder / name for name in ("s.sqlite", "solves", "rows.jsonl"))
        self.log.touch()

    def words(self, workers):
        words = ["sweep", "paper", "--axis", "L=lin:10:16:6", "--axis", f"depth={','.join(map(str, DEPTHS))}"]
        words += ["--magnet", "ignored", "--accuracy", "quick", "--json", "--store", str(self.store)]
        return [*words, "--workers", str(workers)]

    def start(self):
        paths = os.pathsep.join([str(ROOT), str(Path(__file__).parent)])
        with self.rows.open("wb") as rows:
            return subprocess.Popen(
                [sys.executable, "-c", SWEEP, *self.words(WORKERS)],
                env={**os.environ, SOLVES: str(self.log), "PYTHONPATH": paths},
                stdout=rows,
                stderr=subprocess.DEVNULL,
            )

    def printed(self):
        return [json.loads(line) for line in self.rows.read_bytes().split(b"\n")[:-1]]

    def killed(self, *, rows=0, solves=0):
        """Kill the sweep when it has printed so many rows and begun so many solves."""
        before = len(self.log.read_text())
        process = self.start()
        while len(self.printed()) < rows or self.log.read_text()[before:].count("\n") < solves:
            assert process.poll() is None
            time.sleep(0.01)
        workers = children(process.pid)
        process.kill()
        process.wait()
        ended = until(lambda: all(map(gone, workers)), AFTERLIFE)
        states = store_actions.listing(Selection(store=self.store), 0, of_paths=False)[1]
        stored = {(round(one["L_over_D"], 9), round(one["depth_over_D"], 9)) for one in states}
        intact = all(check["status"] == "ok" for check in store_check.checks(self.store))
        begun = {round(float(line), 9) for line in self.log.read_text()[before:].splitlines()}
        return Kill(self.printed(), begun, stored, workers, not ended, intact)

    def completed(self):
        assert self.start().wait() == 0
        return self.printed()

    def undisturbed(self):
        """The rows of a sweep in this process."""
        with contextlib.redirect_stdout(io.StringIO()) as said:
            assert commands.run(self.words(0)) == 0
        return [json.loads(line) for line in said.getvalue().splitlines()]


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Two kills, then the rows of the sweep that goes on, and those of one that nothing disturbs."""
    sweep = Sweep(tmp_path_factory.mktemp("killed"))
    kills = [sweep.killed(solves=3), sweep.killed(rows=1)]
    return kills, sweep.completed(), Sweep(tmp_path_factory.mktemp("whole")).undisturbed()


def test_the_state_of_each_printed_row_is_in_the_store(swept):
    kills, *_ = swept
    assert kills[1].rows
    for kill in kills:
        assert {(round(row["L_mm"] / 8, 9), round(row["depth_mm"] / 8, 9)) for row in kill.rows} <= kill.stored


def test_what_is_stored_is_not_solved_again_and_no_more_is_unfinished_than_there_were_workers(swept):
    (first, second), *_ = swept
    assert all(len(kill.begun - kill.complete) <= WORKERS for kill in (first, second))
    assert not second.begun & first.complete


def test_no_worker_process_survives_and_the_store_stays_intact(swept):
    # rows that are stored are printed before a worker has begun
    assert max(len(kill.workers) for kill in swept[0]) == WORKERS
    assert not any(kill.survive for kill in swept[0])
    assert all(kill.intact for kill in swept[0])


def test_a_sweep_that_goes_on_has_the_rows_of_one_that_nothing_disturbs(swept):
    (_, second), *finished = swept
    printed, again, whole = (pd.DataFrame(rows).drop(columns="seconds") for rows in (second.rows, *finished))
    # a sweep that goes on hands other solves to its workers, so that the last digits depend on the kills
    pd.testing.assert_frame_equal(again, whole, rtol=1e-9)
    pd.testing.assert_frame_equal(printed, whole[: len(printed)], rtol=1e-9)
