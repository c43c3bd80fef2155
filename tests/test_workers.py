"""Worker processes: order, exceptions, deaths, interrupts, and the time left."""

import heapq
import itertools
import math
import os
import pickle
import random
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

import pytest
import worker_tasks
from worker_tasks import gone, until

from studies.mechanics import worker_process
from studies.mechanics.worker_process import processes
from studies.mechanics.workers import Unfinished, clock_text, finished

TESTS = Path(__file__).parent


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    """Worker processes import the functions of `worker_tasks`."""
    monkeypatch.setenv("PYTHONPATH", str(TESTS))


def noted(folder):
    return [int(path.name) for path in folder.iterdir()]


@pytest.mark.parametrize("workers", [0, 1])
def test_one_worker_finishes_the_tasks_in_their_order(workers):
    results = list(finished(iter(range(20)), worker_tasks.echo, workers=workers))
    assert [(each.task, each.answer, each.reason) for each in results] == [(k, k, "") for k in range(20)]


def test_a_task_is_yielded_as_soon_as_it_is_finished():
    assert [each.task for each in finished([0.6, 0.0, 0.1], time.sleep, workers=2)] == [0.0, 0.1, 0.6]


def test_no_tasks_give_no_results():
    assert list(finished([], worker_tasks.echo, workers=2)) == []


def test_without_workers_the_tasks_are_done_in_this_process():
    assert [each.answer for each in finished([1], worker_tasks.own_process, workers=0)] == [os.getpid()]


def test_no_more_tasks_are_begun_than_there_are_workers():
    taken = []
    results = finished((taken.append(k) or k for k in range(10**6)), worker_tasks.echo, workers=2)
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


def test_a_task_without_memory_has_no_answer():
    (result,) = finished(["memory"], worker_tasks.raises, workers=1)
    assert (result.answer, result.reason) == (None, "its process ran out of memory")


def test_an_exception_that_cannot_be_unpickled_keeps_its_text():
    with pytest.raises(RuntimeError, match="OddError: 1 and 2") as caught:
        list(finished(["odd"], worker_tasks.raises, workers=1))
    assert "in raises\n" in "".join(caught.value.__notes__)


@pytest.mark.parametrize("workers", [0, 1])
@pytest.mark.parametrize(("kind", "error"), [("exit", SystemExit), ("interrupt", KeyboardInterrupt)])
def test_an_exit_or_interrupt_in_a_task_ends_the_run(workers, kind, error):
    with pytest.raises(error):
        list(finished([kind], worker_tasks.raises, workers=workers))


def test_an_error_of_the_sequence_of_tasks_ends_the_run():
    with pytest.raises(ZeroDivisionError):
        list(finished((1 / k for k in (1, 0)), worker_tasks.echo, workers=1))


def test_a_task_that_kills_its_worker_costs_no_other_task_a_try(tmp_path):
    tasks = [(str(tmp_path / str(k)), "kill" if k in (2, 5) else "ok") for k in range(8)]
    results = {each.task: each for each in finished(tasks, worker_tasks.counted, workers=2)}
    tries = [(tmp_path / str(k)).read_text() for k in range(8)]
    assert tries == ["x", "x", "xx", "x", "x", "xx", "x", "x"]
    assert [results[task].answer for task in tasks] == [None if kind == "kill" else "ok" for _, kind in tasks]
    dead = results[tasks[2]]
    assert (dead.answer, dead.reason) == (None, "its worker process ended with signal 9 twice (out of memory?)")


def test_what_a_task_prints_is_no_answer(capfd):
    (result,) = finished(["text"], worker_tasks.prints, workers=1)
    assert result.answer == ""  # its standard input is empty
    assert capfd.readouterr() == ("", "text\n")


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
from studies.mechanics.workers import finished

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
    monkeypatch.setattr(worker_process, "COMMAND", (sys.executable, "-c", "raise SystemExit(5)"))
    with pytest.raises(worker_process.NotStarted, match="exit code 5"):
        list(finished([1], worker_tasks.echo, workers=1))


def test_processes_that_the_system_kills_while_they_load_are_started_again(monkeypatch, tmp_path):
    code = (
        "import os, pathlib; from studies.mechanics import worker_process\n"
        f"folder = pathlib.Path({str(tmp_path)!r}); (folder / str(os.getpid())).touch()\n"
        "if len(list(folder.iterdir())) < 5: os.kill(os.getpid(), 9)\n"
        "worker_process.main()\n"
    )
    monkeypatch.setattr(worker_process, "COMMAND", (sys.executable, "-c", code))
    assert [each.answer for each in finished([1], worker_tasks.echo, workers=1)] == [1]
    assert len(noted(tmp_path)) == 5


def test_linear_algebra_in_workers_shares_the_cores(monkeypatch):
    monkeypatch.setattr("studies.mechanics.worker_process.cores", lambda: 8)
    for name, value in {"OMP_NUM_THREADS": "3", "MKL_NUM_THREADS": "16", "OPENBLAS_NUM_THREADS": "x"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    results = finished(worker_process.THREADS, worker_tasks.environment, workers=2)
    threads = {each.task: each.answer for each in results}
    assert [threads[name] for name in worker_process.THREADS] == ["3", "4", "4", "4"]
    (alone,) = finished(["NUMBA_NUM_THREADS"], worker_tasks.environment, workers=2)
    assert alone.answer == "8"


def test_a_death_keeps_its_codes_when_it_is_sent():
    death = pickle.loads(pickle.dumps(worker_process.WorkerDied(-9, 1)))
    assert (death.codes, str(death)) == ((-9, 1), "signal 9, then exit code 1")


def test_an_executor_can_give_up_a_task_at_the_first_death():
    with processes(1, tries=1) as executor, pytest.raises(worker_process.WorkerDied) as death:
        executor.submit(os._exit, 7).result()
    assert death.value.codes == (7,)


def test_progress_counts_tasks_and_weighs_them_by_cost():
    reports = []
    costs = {0.0: 0.0, 0.6: 3.0, 0.7: 1.0}
    list(finished(list(costs), time.sleep, workers=1, cost=costs.get, progress=lambda *each: reports.append(each)))
    shares = [share for share, _ in reports]
    assert shares[0] == 0.0
    assert shares[-2:] == [0.75, 1.0]
    assert [text.split(" solves")[0] for _, text in reports[-2:]] == ["2 of 3", "3 of 3"]
    assert reports[-2][1].endswith("0:00 left")


# The time that is left, against tasks of known times on simulated workers


def estimates(costs, seconds, workers):
    """Do tasks of known times with a simulated clock.

    Returns the share of the work that is done, the estimate and the true time left after each task.
    """
    now = 0.0
    unfinished = Unfinished(list(costs), float)
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


def test_a_long_last_task_is_waited_for():
    unfinished = Unfinished([1.0, 1.0, 1.0, 30.0], float)
    unfinished.finish(0, 2.0)
    assert unfinished.seconds_left(2) == 60.0


def test_before_the_first_answer_there_is_no_estimate():
    unfinished = Unfinished([1.0, 1.0])
    unfinished.finish(0, math.nan)
    assert math.isnan(unfinished.seconds_left(1))
    assert unfinished.share == 0.5


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "0:00"), (59.7, "1:00"), (3599.8, "1:00:00"), (90061, "25:01:01")]
)
def test_a_time_is_written_as_by_a_clock(seconds, text):
    assert clock_text(seconds) == text
