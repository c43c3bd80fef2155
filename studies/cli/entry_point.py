"""The entry point of the command `magtip`; it imports little, so that Ctrl-C works from the start."""

from __future__ import annotations

import atexit
import contextlib
import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType


def main(tokens: list[str] | None = None) -> int:
    """Run one command line (default: that of the process) and return its exit status."""
    status = 1
    if tokens is None:
        # what is registered first runs last, after all that libraries have to do at the exit
        atexit.register(lambda: _end_at_once(status))
        # imports make a million objects that stay: looking through them every 700 takes a twelfth of a short solve
        gc.set_threshold(10_000)
        # dense matrices of a solve are small: more threads of OpenBLAS cost 0.2 s of CPU and save no time. It reads
        # this when NumPy is imported; PARDISO and compiled loops keep their threads
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        # worker processes import no modules of the user's current folder either
        os.environ.setdefault("PYTHONSAFEPATH", "1")
    with _interrupt_at_once():
        from studies import deferred_modules
        from studies.cli import commands

        deferred_modules.defer()
    status = commands.run(tokens)
    return status


@contextlib.contextmanager
def _interrupt_at_once() -> Iterator[None]:
    """Let Ctrl-C end the process at once, because imports may lose or change a KeyboardInterrupt."""
    in_main_thread = threading.current_thread() is threading.main_thread()
    if not in_main_thread or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end_at_once(status: int) -> None:
    """End the process without taking apart what numba has made, for which Python needs a quarter of a second."""
    with contextlib.suppress(OSError, ValueError):  # Python reports a stream that cannot be written
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os._exit(status)


def _end(number: int, frame: FrameType | None) -> None:
    with contextlib.suppress(OSError):
        os.write(2, b"magtip: interrupted before anything was begun\n")
    os._exit(128 + number)
