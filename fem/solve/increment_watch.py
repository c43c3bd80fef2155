"""A function that sees every load increment: it shows how far a path has come, and ends it by raising an exception.

Paths are made of frozen states, so one that is ended leaves the states before it unchanged.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar

_watch: ContextVar[Callable[[float], None] | None] = ContextVar("watch", default=None)


@contextlib.contextmanager
def watched(watch: Callable[[float], None]) -> Iterator[None]:
    """Call a function before each load increment of this context, with the completed share of its segment.

    An exception that the function raises ends the path.
    """
    token = _watch.set(watch)
    try:
        yield
    finally:
        _watch.reset(token)


def report(share: float) -> None:
    """Call the function of `watched`, if there is one."""
    watch = _watch.get()
    if watch is not None:
        watch(share)
