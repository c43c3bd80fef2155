"""The entry point of the command `magtip`; it imports little, so that Ctrl-C works from the start."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType


def main(tokens: list[str] | None = None) -> int:
    """Run one command line (default: that of the process) and return its exit status."""
    with _interrupt_at_once():
        from studies import deferred_modules
        from studies.cli import commands

        deferred_modules.defer()
    return commands.run(tokens)


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


def _end(number: int, frame: FrameType | None) -> None:
    """End the process, which has not written anything yet, with a sentence."""
    with contextlib.suppress(OSError):
        os.write(2, b"magtip: interrupted before anything was begun\n")
    os._exit(128 + number)
