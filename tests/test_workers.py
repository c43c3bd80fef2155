"""Worker processes: order, exceptions, deaths, interrupts, and the time left; a sweep that is killed twice."""

import contextlib
import heapq
import io
import itertools
import json
import math
import os
import random
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import pytest
import worker_tasks
from worker_tasks import SOLVES, children, gone, until

from studies.cli import commands
from studies.inputs.option_groups import Selection
from studies.mechanics import executor, store_actions, store_check
from studies.mechanics.executor import Workers
from studies.mechanics.tasks import Unfinished, finished
from studies.output.provenance import ROOT

TESTS = Path(__file__).parent


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    """Worker processes import the functions of `worker_tasks`."""
    monkeypatch.setenv("PYTHONPATH", str(TESTS))


def noted(folder):
    return [int(path.name) for path in folder.iterdir()]


@pytest.mark.parametrize("workers", [0, 1])
def test_one_worker_finishes_the_tasks_in_their_order(workers):
    results = list(finished(range(20), worker_tasks.echo, workers=workers))
    assert [(each.task, each.answer, each.reason) for each in results] == [(k, k, "") for k in range(20)]


def test_no_more_tasks_are_begun_than_there_are_workers():
    taken = []

    class Watched(list):
        def __iter__(self):
            taken.clear()
            return (taken.append(k) or k for k in super().__iter__())

    results = finished(Watched(range(100)), worker_tasks.echo, workers=2)
    next(results)
    assert len(taken) == 2
    next(results)
    results.close()
    assert len(taken) == 3


@pytest.mark.parametrize("workers", [0, 1])
def test_an_exception_in_a_task_ends_the_run_with_its_traceback(workers):
    """Whatever a function raises is a bug, which no row of a table may hide."""
    with pytest.raises(ValueError, match="a bug") as caught:
        list(finished(["bug"], worker_tasks.raises, workers=workers))
    assert "in raises\n" in "".join(traceback.format_exception(caught.value))


@pytest.mark.parametrize("workers", [0, 1])
@pytest.mark.parametrize(("kind", "error"), [("exit", SystemExit), ("interrupt", KeyboardInterrupt)])
def test_an_exit_or_interrupt_in_a_task_ends_the_run(workers, kind, error):
    with pytest.raises(error):
        list(finished([kind], worker_tasks.raises, workers=workers))


def test_a_task_that_kills_its_worker_costs_no_other_task_a_try(tmp_path):
    tasks = [(str(tmp_path / str(k)), "kill" if k in (2, 5) else "ok") for k in range(8)]
    results = {each.task: each for each in finished(tasks, worker_tasks.counted, workers=2)}
    tries = [(tmp_path / str(k)).read_text() for k in range(8)]
    assert tries == ["x", "x", "xx", "x", "x", "xx", "x", "x"]
    assert [results[task].answer for task in tasks] == [None if kind == "kill" else "ok" for _, kind in tasks]
    dead = results[tasks[2]]
    assert (dead.answer, dead.reason) == (None, "its worker process ended with signal 9 twice (out of memory?)")


def test_closing_the_generator_ends_the_workers_and_what_they_started(tmp_path):
    results = finished(["", str(tmp_path), str(tmp_path)], worker_tasks.with_child, workers=3)
    assert next(results).task == ""
    assert until(lambda: len(noted(tmp_path)) == 2)
    begin = time.monotonic()
    results.close()
    assert until(lambda: all(gone(process) for process in noted(tmp_path)), 2)
    assert time.monotonic() - begin < 2


RUN = """
import worker_tasks
from studies.mechanics.tasks import finished

list(finished([{folder!r}] * 8, worker_tasks.noted, workers=2))
"""


@pytest.mark.parametrize(("number", "status"), [(signal.SIGKILL, -9), (signal.SIGINT, -2)])
def test_workers_end_when_the_process_that_started_them_is_killed_or_interrupted(tmp_path, number, status):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    command = [sys.executable, "-c", RUN.format(folder=str(tmp_path))]
    with subprocess.Popen(command, env=env, start_new_session=True, stderr=subprocess.PIPE, text=True) as run:
        assert until(lambda: len(noted(tmp_path)) == 2)
        os.killpg(run.pid, number)
        assert until(lambda: all(gone(process) for process in noted(tmp_path)), 2)
        assert run.wait() == status
        # no worker writes a traceback of its own
        assert run.stderr.read().count("Traceback") == (number == signal.SIGINT)
    assert len(noted(tmp_path)) == 2


def test_a_process_that_dies_while_it_loads_is_no_death_of_a_task(monkeypatch):
    monkeypatch.setattr(executor, "begin", worker_tasks.ends)
    with pytest.raises(executor.NotStarted, match="exit code 5"):
        list(finished([1], worker_tasks.echo, workers=1))


def test_processes_that_the_system_kills_while_they_load_are_started_again(monkeypatch, tmp_path):
    monkeypatch.setattr(executor, "begin", worker_tasks.killed_four_times)
    monkeypatch.setenv(worker_tasks.LOADS, str(tmp_path))
    assert [each.answer for each in finished([1], worker_tasks.echo, workers=1)] == [1]
    assert len(noted(tmp_path)) == 5


def test_a_script_needs_no_guard_of_its_main_module(tmp_path):
    """Processes that `multiprocessing` spawns import the script again, which would start processes without end."""
    script = tmp_path / "script.py"
    script.write_text(
        "import worker_tasks\nfrom studies.mechanics.tasks import finished\n"
        "print([each.answer for each in finished([1, 2], worker_tasks.echo, workers=1)])\n"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    done = subprocess.run([sys.executable, str(script)], env=env, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("[1, 2]\n", "")


def test_workers_stay_for_the_next_tasks_until_they_are_ended():
    workers, before = Workers(1), set(children(os.getpid()))
    pids = [each.answer for _ in range(3) for each in finished([""], worker_tasks.process, workers)]
    assert len(set(pids)) == 1
    # one that dies without a task is replaced, and no task is the cause
    os.kill(pids[0], signal.SIGKILL)
    assert [each.answer != pids[0] for each in finished([""], worker_tasks.process, workers)] == [True]
    workers.end()
    assert until(lambda: not set(children(os.getpid())) - before, 2)


def test_linear_algebra_in_workers_shares_the_cores(monkeypatch):
    monkeypatch.setattr(executor, "cores", lambda: 8)
    for name, value in {"OMP_NUM_THREADS": "3", "MKL_NUM_THREADS": "16", "OPENBLAS_NUM_THREADS": "x"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    results = finished(executor.THREADS, worker_tasks.environment, workers=2)
    threads = {each.task: each.answer for each in results}
    assert [threads[name] for name in executor.THREADS] == ["3", "4", "4", "4"]
    (alone,) = finished(["NUMBA_NUM_THREADS"], worker_tasks.environment, workers=2)
    assert alone.answer == "8"


# The time that is left, against tasks of known times on simulated workers


def estimates(costs, seconds, workers):
    """Do tasks of known times with a simulated clock.

    Returns the share of the work that is done, the estimate and the true time left after each task.
    """
    now = 0.0
    unfinished = Unfinished(costs)
    running, waiting, states = [], list(enumerate(seconds)), []
    while running or waiting:
        while waiting and len(running) < workers:
            number, duration = waiting.pop(0)
            heapq.heappush(running, (now + duration, number, duration))
        now, number, duration = heapq.heappop(running)
        unfinished.finish(number, duration)
        states.append((unfinished.share, unfinished.seconds_left(workers), now))
    return [(share, left, now - then) for share, left, then in states]


@pytest.mark.parametrize("kind", ["equal", "growing", "shrinking", "mixed"])
def test_after_a_fifth_of_the_work_the_estimate_is_right_within_a_factor_of_1_5(kind):
    """Costs are in a unit of their own, and times scatter about them with a standard deviation of 25 %."""
    for workers, seed in itertools.product((1, 2, 8), range(5)):
        shares = shares_left(kind, workers, seed)
        assert len(shares) > 2 * workers, (workers, seed)
        assert 1 / 1.5 < min(shares) <= max(shares) < 1.5, (workers, seed)


def shares_left(kind, workers, seed):
    """The estimated time left over the true one, between a fifth and three fifths of the work."""
    draw, count = random.Random(seed), 36 * workers
    costs = {
        "equal": [1.0] * count,
        "growing": [1.0 + 10 * k / count for k in range(count)],
        "shrinking": [11.0 - 10 * k / count for k in range(count)],
        "mixed": [draw.choice([1.0, 2.0, 10.0]) for _ in range(count)],
    }[kind]
    seconds = [7.3 * cost * math.exp(draw.gauss(0, 0.25)) for cost in costs]
    return [left / truth for share, left, truth in estimates(costs, seconds, workers) if 0.2 <= share <= 0.6]


# A sweep that is killed twice: nothing that it reported is lost, and little is solved again.


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
