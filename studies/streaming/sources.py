"""Where readings come from: a serial port, a pipe, or a file that is replayed at its own pace."""

from __future__ import annotations

import itertools
import math
import os
import select
import stat
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from analytic import parts
from geometry.array_design import ArrayDesign
from geometry.design import BadInput, Design
from studies.inputs.table_input import number
from studies.streaming.clocks import Arrival, DeviceClock, Row
from studies.streaming.frames import IDLE, LONGEST, NUMBERS, Frames

WAIT = 0.1
"""Longest time without a byte, s, after which a source says so: the screen is drawn, and Ctrl-C heard."""
CHUNK = 65536

Decoded = dict[str, Any]
"""Columns of a decoded row."""


class Sink(Protocol):
    """Takes the decoded rows that came together, at least every `WAIT`, also none."""

    def __call__(self, rows: Sequence[Decoded]) -> None: ...


class Source(Protocol):
    """Yields the rows that have arrived, at least every `WAIT`.

    lost : number of frames that were dropped. misfit : why there was no frame. remarks : what is said at the end.
    """

    lost: int

    @property
    def misfit(self) -> str: ...
    @property
    def remarks(self) -> Sequence[str]: ...
    def rows(self) -> Iterator[list[Row]]: ...


@dataclass(slots=True)
class Port:
    """A serial port, pipe or terminal.

    clock : gives the times.
    """

    name: str
    frames: Frames
    clock: Arrival | DeviceClock
    baud: int = 115200
    lost: int = 0
    _device: Any = None
    _file: int = -1

    @property
    def misfit(self) -> str:
        return self.frames.misfit

    @property
    def remarks(self) -> Sequence[str]:
        return self.clock.remarks

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
            ready, _, _ = select.select([self._file], [], [], 0)
            if not ready:
                self.clock.waits(time.monotonic())
                # a frame that has no end mark counts when nothing follows it
                ready, _, _ = select.select([self._file], [], [], IDLE if self.frames.is_begun else WAIT)
            data = b""
            if ready:
                try:
                    data = os.read(self._file, CHUNK)
                except BlockingIOError:
                    continue
                except OSError:  # the cable was drawn, or the other end of a terminal closed
                    break
            # the last frame has no next one that shows its end
            found = self.frames.feed(data, idle=not data)
            self.lost = self.frames.lost
            yield self.clock.rows(found, time.monotonic())
            if ready and not data:
                break
        yield self.clock.rest()


@dataclass(slots=True)
class Replay:
    """Rows of a file with their times, each when its time has come; speed : 2 for twice as fast, 0 for no waiting."""

    table: Sequence[Row]
    speed: float = 1.0
    lost: int = 0
    misfit: str = ""
    remarks: Sequence[str] = ()

    def rows(self) -> Iterator[list[Row]]:
        begun, first = time.monotonic(), next((at for at, _ in self.table if math.isfinite(at)), 0.0)
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


def replayed(path: Path, design: Design | ArrayDesign, speed: float) -> Replay:
    """Return the rows of a CSV file with the columns of the design's elements and time_s, as `decode --file` reads.

    Behind the readings stands the temperature, C, NaN where there is none.

    Raises
    ------
    BadInput
        The file is no such table, or has no times.
    """
    from studies.calibration.bench_file import read_readings

    with path.open("rb") as file:
        words = NUMBERS.split(file.readline(LONGEST).strip())
    if all(number(word.decode("ascii", "replace")) is not None for word in words):
        raise BadInput(
            f"{path} begins with numbers in place of heads: a file of frames needs their --rate, or --clock"
        )
    _, readings, times, temperature = read_readings(path, design)
    if times is None:
        raise BadInput(f"{path} has no column time_s: a replay needs the time of each row")
    rows = np.column_stack([readings, temperature])
    return Replay(list(zip(times.tolist(), map(tuple, rows.tolist()), strict=True)), speed)


def captured(path: Path, frames: Frames, clock: DeviceClock | None, rate: float | None, speed: float) -> Replay:
    """Return the rows of a file of frames, as a device has sent them.

    clock : of the device, whose times begin the frames; without one the frames follow each other at a rate, Hz, also
        those that were dropped.
    """
    table: list[Row] = []
    with path.open("rb") as file:
        for data in itertools.chain(iter(partial(file.read, CHUNK), b""), [b""]):
            found = frames.feed(data, idle=not data)
            if clock is not None:
                table += clock.rows(found, 0.0)
            else:
                table += [(place / (rate or math.nan), row) for place, row in zip(frames.places, found, strict=True)]
    table += [] if clock is None else clock.rest()
    return Replay(table, speed, frames.lost, frames.misfit, [] if clock is None else clock.remarks)


def columns(design: Design | ArrayDesign) -> list[str]:
    """Return the columns of readings, such as S1_V or chip_x_T."""
    elements = parts.of_design(design)
    return [f"{name}_{e.unit}" for name, e in zip(parts.columns(elements), elements, strict=True)]
