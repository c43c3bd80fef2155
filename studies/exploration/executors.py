"""Where tasks are done: in this process, or by worker processes on this machine. `cluster` has a third executor."""

from __future__ import annotations

import contextlib
import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from geometry.compiled import cores
from studies.exploration.worker_process import Answer, WorkerProcesses, answer


class SchedulerLost(RuntimeError):
    """The scheduler of a cluster, or all of its workers, are gone. The text is one sentence."""


class WorkersLost(RuntimeError):
    """A task was handed to several workers of a cluster, which were all lost. The text is one sentence."""


@dataclass(frozen=True, slots=True)
class Executor:
    """How tasks are handed to workers.

    Attributes
    ----------
    submit : hands over a function and a task, to be done in the order of the calls.
    size : returns the number of tasks that are done at the same time.
    check : raises `SchedulerLost` if no answer can come any more.
    """

    submit: Callable[[Callable[[Any], Any], Any], Future[Answer]]
    size: Callable[[], int]
    check: Callable[[], None]


def inline() -> Executor:
    """Return an executor that does each task in this process, when it is submitted."""

    def submit(function: Callable[[Any], Any], task: Any) -> Future[Answer]:
        future: Future[Answer] = Future()
        future.set_result(answer(function, task))
        return future

    return Executor(submit, lambda: 0, _no_check)


@contextlib.contextmanager
def processes(count: int, tries: int = 2) -> Iterator[Executor]:
    """Yield an executor with worker processes on this machine, which are ended with the context, also during tasks.

    Parameters
    ----------
    count : number of processes; linear algebra in them shares the cores that this process may use.
    tries : number of processes that may die of a task, before its future raises `WorkerDied`.
    """
    threads = ThreadPoolExecutor(count)
    pool = WorkerProcesses(max(cores() // count, 1))

    def do(job: bytes) -> Answer:
        result: Answer = pickle.loads(pool.call(job, tries=tries))
        return result

    def submit(function: Callable[[Any], Any], task: Any) -> Future[Answer]:
        return threads.submit(do, pickle.dumps((function, task)))

    try:
        yield Executor(submit, lambda: count, _no_check)
    finally:
        # end the processes before joining the threads: these wait for answers of the processes
        threads.shutdown(wait=False, cancel_futures=True)
        pool.end()
        threads.shutdown()


def _no_check() -> None:
    """Accept that an answer takes long: processes of this machine cannot be lost unnoticed."""
