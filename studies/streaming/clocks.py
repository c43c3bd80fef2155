"""Times of rows that arrive: by the stamps of a device, or by the moments of their arrival.

A time that is not known is NaN: the row's force is then that of slow loading (`analytic.time_series`).
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from collections.abc import Iterator, Sequence
from statistics import median
from typing import Literal

Numbers = tuple[float, ...]
Row = tuple[float, Numbers]
"""Time of a row, s since the first one that has a time, and its numbers."""

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
TURN = 2.0**32
"""Counts of ms and us after which the clock of a microcontroller begins again."""
FAR = 4.0
"""Time between two stamps, over the median of those before, from which a stamp needs another one that confirms it."""
RECENT = 8
BEGINNING, MOST_WAITING = 3, 4
"""Number of stamps in even steps with which a clock begins, and most rows that wait for a stamp that counts."""
STALE = 0.5
"""Time since a source was empty, s, from which moments of arrival say nothing of when its rows were measured."""
FASTEST = 2e-4
"""Time between two rows, s, below which they were not measured as they arrive: a recording is poured in."""


class Arrival:
    """Times of rows by their arrival. Those that arrive together are spread over the time since the last ones.

    A row arrived after the moment at which its source was last empty. Where this is long ago, as in a file, or rows
    come faster than any sensor sends them, as from a recording, their times are not known until it is empty again.
    """

    remarks: Sequence[str] = ()

    def __init__(self) -> None:
        self._empty = self._begun = self._last = math.nan

    def waits(self, now: float) -> None:
        """Note that the source is empty at a moment, s."""
        self._empty = now

    def rows(self, found: Sequence[Numbers], now: float) -> list[Row]:
        """Return the rows of frames that were read together at a moment, s."""
        if not found:
            return []
        begins, fresh = math.isnan(self._begun), now - self._empty <= STALE
        step = 0.0 if begins else (now - self._last) / len(found)
        if not fresh or not (step >= FASTEST or (begins and len(found) == 1)):
            self._empty = math.nan
            return [(math.nan, numbers) for numbers in found]
        if begins:
            self._begun = now
        self._last = now
        return [(now - self._begun - step * (len(found) - k - 1), numbers) for k, numbers in enumerate(found)]

    def rest(self) -> list[Row]:
        """Return the rows that have waited for others, at the end."""
        return []


class DeviceClock:
    """Times of rows whose first number is the device's time.

    A stamp that follows the one before within `FAR` median steps counts at once, also where the counts of ms and us
    begin again at `TURN`. Any other one waits for the next. If that one follows it, rows are missing before it, or
    the device was started again, after which times go on by arrival. Otherwise the stamp was damaged, and its row has
    no time.
    """

    def __init__(self, unit: Literal["s", "ms", "us"]) -> None:
        self._unit, self._turn = UNITS[unit], 0.0 if unit == "s" else TURN
        self._resolution = 0.0 if unit == "s" else 1.0
        self._turns, self._origin, self._last = 0.0, math.nan, math.nan
        self._time = self._heard = 0.0
        self._steps: deque[float] = deque(maxlen=RECENT)
        self._waiting: deque[tuple[float, float, Numbers]] = deque()
        self._starts = 0

    @property
    def remarks(self) -> list[str]:
        if not self._starts:
            return []
        often = "once" if self._starts == 1 else f"{self._starts} times"
        return [f"the device's clock began again {often}: times after it go on by the rows' arrival"]

    def waits(self, now: float) -> None:
        """Do nothing: stamps do not depend on when rows arrive."""

    def rows(self, found: Sequence[Numbers], now: float) -> list[Row]:
        """Return the rows of frames that were read together at a moment, s, and of those that waited for them."""
        return [row for stamp, *numbers in found for row in self._next(stamp, now, tuple(numbers))]

    def rest(self) -> list[Row]:
        """Return the rows that have waited for others, at the end."""
        if self._waiting and math.isnan(self._last):
            stamps = [stamp for stamp, _, _ in self._waiting]
            if all(map(math.isfinite, stamps)) and stamps == sorted(stamps):
                return list(self._begun(range(len(stamps))))
        return self._lost(len(self._waiting))

    def _next(self, stamp: float, now: float, numbers: Numbers) -> Iterator[Row]:
        if math.isnan(self._last):
            self._waiting.append((stamp, now, numbers))
            chosen = itertools.combinations(range(len(self._waiting)), BEGINNING)
            good = next(filter(self._even, chosen), None)
            yield from self._lost(len(self._waiting) - MOST_WAITING) if good is None else self._begun(good)
            return
        # damaged stamps may lie between
        steps = len(self._waiting) + 1
        turned = next(
            (at for at in (self._turns, self._turns + self._turn) if self._follows(stamp + at, steps)), None
        )
        if turned is not None:
            self._turns = turned
            yield from self._lost(steps - 1)
            yield self._taken(stamp + turned, now, numbers)
            return
        if self._waiting and 0 <= stamp - self._waiting[-1][0] <= self._far(1):
            yield from self._lost(steps - 2)
            yield from self._again(*self._waiting.popleft())
            yield self._taken(stamp + self._turns, now, numbers)
            return
        self._waiting.append((stamp, now, numbers))
        yield from self._lost(len(self._waiting) - MOST_WAITING)

    def _far(self, steps: int) -> float:
        return FAR * max(median(self._steps), self._resolution) * steps

    def _follows(self, stamp: float, steps: int) -> bool:
        return 0 <= stamp - self._last <= self._far(steps)

    def _even(self, chosen: Sequence[int]) -> bool:
        """Return whether these of the stamps that wait go on in steps of about one length."""
        first, second, third = (self._waiting[k][0] for k in chosen)
        short, long = sorted((second - first, third - second))
        return 0 <= short <= long <= FAR * max(short, self._resolution) or short == long == 0

    def _begun(self, good: Sequence[int]) -> Iterator[Row]:
        """Yield the rows that wait, of which those with good stamps have a time."""
        self._origin = self._last = self._waiting[good[0]][0]
        for k in range(len(self._waiting)):
            stamp, now, numbers = self._waiting.popleft()
            yield self._taken(stamp, now, numbers) if k in good else (math.nan, numbers)

    def _again(self, stamp: float, now: float, numbers: Numbers) -> Iterator[Row]:
        """Yield the row of a stamp that another one confirms: after missing rows, or of a device that began again."""
        ahead = stamp + self._turns
        if ahead < self._last - self._far(1):
            self._starts += 1
            pause = max(now - self._heard, 2 * median(self._steps) * self._unit)
            self._turns, self._last = 0.0, stamp
            self._origin, ahead = stamp - (self._time + pause) / self._unit, stamp
        yield self._taken(ahead, now, numbers)

    def _taken(self, stamp: float, now: float, numbers: Numbers) -> Row:
        """Return the row of a stamp that counts; of one a little below the last, which was damaged, no time falls."""
        self._steps.append(max(stamp - self._last, 0.0))
        self._last, self._heard = stamp, now
        self._time = max(self._time, self._unit * (stamp - self._origin))
        return self._time, numbers

    def _lost(self, count: int) -> list[Row]:
        """Return the first of the rows that wait, whose stamps are damaged."""
        return [(math.nan, self._waiting.popleft()[2]) for _ in range(count)]
