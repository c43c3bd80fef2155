"""Many tasks done side by side by the workers of this machine or of a Dask cluster, and the time that is left.

Each answer is handed on as soon as it is there, so that the caller, which alone writes files, can keep it.
"""

from __future__ import annotations

import contextlib
import math
import queue
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from geometry.compiled import cores
from geometry.messages import Progress
from studies.mechanics.executor import INLINE, Answer, SchedulerLost, WorkerDied, Workers, WorkersLost

if TYPE_CHECKING:
    from studies.mechanics.cluster import Cluster

    Executor = Workers | Cluster

T = TypeVar("T")
R = TypeVar("R")
PATIENCE = 2.0
"""Time without an answer after which the workers are checked, s."""
REPORTS = 0.5
"""Least time between two reports of progress, s."""


@contextlib.contextmanager
def opened(workers: int | Executor | None = None, scheduler: str | None = None) -> Iterator[Executor]:
    """Yield workers that are ended with the context, also during tasks; an executor that is given is not.

    workers : number of processes of this machine, see `Workers`, or an executor.
    scheduler : address of a Dask scheduler, such as tcp://10.0.0.1:8786, whose workers do the tasks.
    """
    if workers is not None and not isinstance(workers, int):
        yield workers
        return
    if scheduler is None:
        executor: Executor = Workers(workers)
    else:
        from studies.mechanics.cluster import connected

        executor = connected(scheduler)
    try:
        yield executor
    finally:
        executor.end()


@dataclass(frozen=True, slots=True)
class Finished(Generic[T, R]):
    """A task with its answer, or with the reason why there is none.

    answer : what the function returned; None if its worker died at both tries, or ran out of memory.
    reason : which of both, in one sentence; empty if there is an answer.
    """

    task: T
    answer: R | None
    reason: str


def finished(
    tasks: Sequence[T],
    function: Callable[[T], R],
    workers: int | Executor | None = None,
    scheduler: str | None = None,
    *,
    cost: Callable[[T], float] | None = None,
    progress: Progress | None = None,
    words: str = "solves",
) -> Generator[Finished[T, R], None, None]:
    """Call a function of each task and yield each task as soon as it is finished, in any order.

    The tasks are started in the order given. As many as there are workers are begun and not yet yielded, so that no
    more are lost if this process is killed. Closing the generator ends the workers of tasks that are not yielded.

    Parameters
    ----------
    function : of a module that workers can import; it and the tasks can be pickled.
    workers, scheduler : see `opened`; an executor stays for other tasks if all of these are yielded.
    cost : expected time of a task, s; default: all tasks take equally long, and longer than the start of a worker.
    progress : receives the finished share of the costs and the time left, and `words` for the tasks.

    `SchedulerLost` says that the scheduler, or all of its workers, were lost during the run. Whatever the function
    raises ends the run, with the traceback of the worker as a note.
    """
    costs = [cost(task) if cost else 1.0 for task in tasks]
    report = Unfinished(costs, progress, words)
    if isinstance(workers, int):
        workers = min(workers, len(tasks))  # each has more threads for linear algebra
    elif workers is None and scheduler is None:
        workers = min(cores(), len(tasks)) if cost is None or math.fsum(costs) > INLINE else 0
    elif isinstance(workers, Workers) and cost is not None and not workers.pays(math.fsum(costs)):
        workers = 0
    with opened(workers, scheduler) as executor:
        try:
            yield from _finished(tasks, function, executor, report)
        except SchedulerLost as error:
            count = len(report.waiting)
            raise SchedulerLost(f"{error}: {count} tasks are unfinished; the same command continues") from None


def _finished(
    tasks: Sequence[T], function: Callable[[T], R], executor: Executor, report: Unfinished
) -> Generator[Finished[T, R], None, None]:
    waiting = iter(enumerate(tasks))
    started: dict[Future[Answer], tuple[int, T]] = {}
    done: queue.SimpleQueue[Future[Answer]] = queue.SimpleQueue()
    try:
        while True:
            size = executor.size
            report.show(size)
            # no tasks in advance: the caller may need seconds with an answer, in which workers would begin them all
            while len(started) < max(size, 1) and (next_task := next(waiting, None)) is not None:
                future = executor.submit(function, next_task[1])
                started[future] = next_task
                future.add_done_callback(done.put)
            if not started:
                return
            try:
                future = done.get(timeout=PATIENCE)
            except queue.Empty:
                if not isinstance(executor, Workers):
                    executor.check()
                continue
            number, task = started.pop(future)
            result, seconds = _result(task, future)
            report.finish(number, seconds)
            yield result
    finally:
        if started:
            executor.end()


def _result(task: T, future: Future[Answer]) -> tuple[Finished[T, Any], float]:
    try:
        value, error, seconds = future.result()
    except WorkerDied as death:
        cause = " (out of memory?)" if -9 in death.codes else ""
        return Finished(task, None, f"its worker process ended with {death}{cause}"), math.nan
    except WorkersLost as lost:
        return Finished(task, None, str(lost)), math.nan
    if isinstance(error, MemoryError):
        return Finished(task, None, "its process ran out of memory"), math.nan
    if error is not None:
        raise error
    return Finished(task, value, ""), seconds


class Unfinished:
    """Tasks that wait or run, by their costs, the time that they are likely to take, and reports of the progress.

    The time is that of their costs times the mean time per cost.
    """

    def __init__(self, costs: Sequence[float], progress: Progress | None = None, words: str = "solves") -> None:
        self.progress, self.words, self.next, self.shown = progress, words, 0.0, -1
        self.waiting = dict(enumerate(costs))
        self.count, self.total = len(costs), math.fsum(costs)
        self._seconds = self._measured = 0.0

    @property
    def share(self) -> float:
        """Share of the costs that is done, 0 to 1."""
        return 1 - math.fsum(self.waiting.values()) / self.total if self.total > 0 else 0.0

    def finish(self, number: int, seconds: float) -> None:
        """Note that a task is finished, and how long it took; NaN if it has no answer."""
        cost = self.waiting.pop(number)
        if not math.isnan(seconds):
            self._seconds += seconds
            self._measured += cost

    def seconds_left(self, workers: int) -> float:
        """Return the time until all tasks are finished, s, at least that of the longest; NaN before an answer."""
        if not self._measured > 0:
            return math.nan
        costs = self.waiting.values()
        return self._seconds / self._measured * max(math.fsum(costs) / workers, max(costs, default=0.0))

    def show(self, workers: int) -> None:
        """Report the progress if a task was finished since the last report, and that is not very recent."""
        now, left = time.perf_counter(), len(self.waiting)
        finished = self.count - left
        if self.progress is None or finished == self.shown or (now < self.next and left):
            return
        self.next, self.shown = now + REPORTS, finished
        seconds = self.seconds_left(max(workers, 1))
        text = "" if math.isnan(seconds) or not left else f", {clock_text(seconds)} left"
        self.progress(self.share, f"{finished} of {self.count} {self.words}{text}")


def clock_text(seconds: float) -> str:
    """Return a time as hours, minutes and seconds.

    >>> clock_text(41.2), clock_text(3723)
    ('0:41', '1:02:03')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
