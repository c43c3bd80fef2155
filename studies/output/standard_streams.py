"""Standard streams that are closed, and a standard output that cannot be written."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO


class OutputLost(OSError):
    """Standard output cannot be written: its disk is full, or the process that reads it has ended (EPIPE)."""


class Output:
    """A stream that raises `OutputLost` for its errors, which are thus distinct from errors of files."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with _as_output_lost():
            return self._stream.write(text)

    def flush(self) -> None:
        with _as_output_lost():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def _as_output_lost() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputLost(error.errno, error.strerror or str(error)) from None


def complete() -> None:
    """Connect closed standard streams to the null device.

    Otherwise the next files that are opened would get their numbers, and messages would be written into these files.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(handle, "r" if name == "stdin" else "w", encoding="utf-8"))


def drop(stream: TextIO) -> None:
    """Connect a standard stream to the null device, so that Python's flush at the exit does not fail again."""
    handle = os.open(os.devnull, os.O_WRONLY)
    os.dup2(handle, stream.fileno())
    os.close(handle)
