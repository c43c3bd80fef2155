"""The process's standard streams: one that is closed, and a standard output that cannot be written."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from typing import Any, TextIO


class OutputLost(OSError):
    """Standard output cannot be written: its disk is full, or whoever read it went away (EPIPE)."""


class Output:
    """A stream whose errors are `OutputLost`, so that they are not taken for those of a file; else as it is."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with _told():
            return self._stream.write(text)

    def flush(self) -> None:
        with _told():
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextlib.contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputLost(error.errno, error.strerror or str(error)) from None


def complete() -> None:
    """Let standard streams that were closed lead nowhere; else their numbers would go to files opened later."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            handle = os.open(os.devnull, os.O_RDWR)
            setattr(sys, name, os.fdopen(handle, "r" if name == "stdin" else "w", encoding="utf-8"))


def drop_output() -> None:
    """Let what is still written to standard output, as at the exit, lead nowhere."""
    handle = os.open(os.devnull, os.O_WRONLY)
    os.dup2(handle, sys.stdout.fileno())
    os.close(handle)
