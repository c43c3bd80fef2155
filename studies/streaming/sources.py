"""Where readings come from: a serial port, a pipe, or a file that is replayed at its own pace."""

from __future__ import annotations

import math
import os
import select
import stat
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from analytic import parts
from geometry.design import BadInput, Design
from studies.streaming.frames import IDLE, Frames

WAIT = 0.1
"""Longest time without a byte, s, after which a source says so: the screen is drawn, and Ctrl-C heard."""
CHUNK = 65536

Row = tuple[float, tuple[float, ...]]
"""Time of a row, s since the first one, and its numbers."""
Decoded = dict[str, Any]
"""Columns of a decoded row."""


class Sink(Protocol):
    """Takes the decoded rows that came together, at least every `WAIT`, also none."""

    def __call__(self, rows: Sequence[Decoded]) -> None: ...


class Source(Protocol):
    """Yields the rows that have arrived, at least every `WAIT`; `lost` is the number of frames that were dropped."""

    lost: int

    def rows(self) -> Iterator[list[Row]]: ...


@dataclass(slots=True)
class Port:
    """A serial port, pipe or terminal.

    clock : seconds in a unit of the first number of each frame, which is then its time; 0 for the time of arrival.
        Frames that arrive together are spread over the time since the last ones.
    """

    name: str
    frames: Frames
    clock: float = 0.0
    baud: int = 115200
    lost: int = 0
    _device: Any = None
    _file: int = -1
    _begun: float = math.nan
    _last: float = 0.0

    def open(self) -> None:
        """Open the port.

        Raises
        ------
        BadInput
            It cannot be opened, or needs a package that is not installed.
        """
        if self.name == "-":
            self._file = 0
            return
        if not os.path.exists(self.name):
            raise BadInput(f"there is no port {self.name!r}: check its name and its cable, or give - for a pipe")
        import serial

        if os.path.isdir(self.name):
            raise BadInput(f"{self.name!r} is a folder: give a serial port, a pipe or a CSV file")
        try:
            if stat.S_ISCHR(os.stat(self.name).st_mode):
                self._device = serial.Serial(self.name, self.baud, timeout=0)
                self._file = self._device.fileno()
            else:
                self._file = os.open(self.name, os.O_RDONLY)
        except (OSError, ValueError) as error:
            cause = getattr(error, "strerror", None) or str(error)
            raise BadInput(
                f"the port {self.name!r} cannot be opened at {self.baud} baud ({cause}): close the program that uses "
                "it, or ask for the right to read it (on Debian, the group dialout)"
            ) from None

    def rows(self) -> Iterator[list[Row]]:
        while True:
            # a frame that has no end mark counts when nothing follows it
            ready, _, _ = select.select([self._file], [], [], IDLE if self.frames.is_begun else WAIT)
            data = b""
            if ready:
                try:
                    data = os.read(self._file, CHUNK)
                except BlockingIOError:
                    continue
                except OSError:  # the cable was drawn, or the other end of a terminal closed
                    return
            # the last frame has no next one that shows its end
            found = self.frames.feed(data, idle=not data)
            self.lost = self.frames.lost
            yield self._timed(found)
            if ready and not data:
                return

    def _timed(self, found: Sequence[tuple[float, ...]]) -> list[Row]:
        if not found:
            return []
        now = self.clock * found[0][0] if self.clock else time.monotonic()
        if math.isnan(self._begun):
            self._begun = now
        if self.clock:
            return [(self.clock * numbers[0] - self._begun, numbers[1:]) for numbers in found]
        last, self._last = self._last, now - self._begun
        step = (self._last - last) / len(found)
        return [(last + step * (k + 1), numbers) for k, numbers in enumerate(found)]


@dataclass(slots=True)
class Replay:
    """Rows of a table with times, each when its time has come; speed : 2 for twice as fast, 0 for no waiting."""

    table: Sequence[Row]
    speed: float = 1.0
    lost: int = field(default=0, init=False)

    def rows(self) -> Iterator[list[Row]]:
        begun, first = time.monotonic(), self.table[0][0] if self.table else 0.0
        due: list[Row] = []
        for moment, numbers in self.table:
            if self.speed:
                wait = begun + (moment - first) / self.speed - time.monotonic()
                while wait > 0:
                    yield due
                    due = []
                    time.sleep(min(wait, WAIT))
                    wait = begun + (moment - first) / self.speed - time.monotonic()
            due.append((moment - first, numbers))
        yield due


def replayed(path: Path, design: Design, speed: float) -> Replay:
    """Return the rows of a CSV file with the columns of the design's elements and time_s, as `decode --file` reads.

    Raises
    ------
    BadInput
        The file is no such table, or has no times.
    """
    from studies.calibration.bench_file import read_readings

    _, readings, times, _ = read_readings(path, design)
    if times is None:
        raise BadInput(f"{path} has no column time_s: a replay needs the time of each row")
    return Replay(list(zip(times.tolist(), map(tuple, readings.tolist()), strict=True)), speed)


def columns(design: Design) -> list[str]:
    """Return the columns of readings, such as S1_V or chip_x_T."""
    elements = parts.of_design(design)
    return [f"{name}_{e.unit}" for name, e in zip(parts.columns(elements), elements, strict=True)]
