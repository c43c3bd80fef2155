"""How long will the tasks take that are left?"""

from __future__ import annotations

import heapq
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

NAN = math.nan


@dataclass(slots=True)
class Unfinished:
    """Tasks that are started in order, those unfinished with the time that they are likely to take.

    A task takes its cost times the mean time per cost of the tasks that have an answer.

    Attributes
    ----------
    costs : of all tasks, in any unit.
    clock : present time, s.
    """

    costs: list[float]
    clock: Callable[[], float] = time.perf_counter
    _workers: int = field(init=False, default=1)
    _waiting: dict[int, None] = field(init=False)
    _begins: list[float] = field(init=False, default_factory=list)
    _seconds: float = field(init=False, default=0.0)
    _measured: float = field(init=False, default=0.0)
    _done: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        self._waiting = dict.fromkeys(range(len(self.costs)))

    def occupy(self, workers: int) -> None:
        """Note the number of workers, and the present time as the begin of the tasks that idle ones take."""
        self._workers = workers
        begun = min(self.finished + workers, len(self.costs))
        self._begins += [self.clock()] * (begun - len(self._begins))

    @property
    def finished(self) -> int:
        """Number of finished tasks."""
        return len(self.costs) - len(self._waiting)

    @property
    def share(self) -> float:
        """Share of the costs that is done, 0 to 1."""
        total = math.fsum(self.costs)
        return min(self._done / total, 1.0) if total > 0 else 0.0

    def finish(self, number: int, seconds: float) -> None:
        """Note that a task is finished, and how long it took; NaN if it has no answer."""
        del self._waiting[number]
        self._done += self.costs[number]
        if not math.isnan(seconds):
            self._seconds += seconds
            self._measured += self.costs[number]

    def seconds_left(self) -> float:
        """Return the time until all tasks are finished, s; NaN before a task has an answer."""
        if not self._measured > 0:
            return NAN
        rate, now = self._seconds / self._measured, self.clock()
        ends = [0.0] * self._workers
        # each task goes to the worker that is free first, as they really do; those begun have done a part
        for number in self._waiting:
            spent = now - self._begins[number] if number < len(self._begins) else 0.0
            heapq.heapreplace(ends, ends[0] + max(rate * self.costs[number] - spent, 0.0))
        return max(ends)


def clock_text(seconds: float) -> str:
    """Return a time as hours, minutes and seconds.

    >>> clock_text(41.2), clock_text(3723)
    ('0:41', '1:02:03')
    """
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
