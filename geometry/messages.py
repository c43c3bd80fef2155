"""What long work tells while it runs: how far it is, and what its user should know."""

from __future__ import annotations

import functools
from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Takes the part of the work that is done, 0 to 1, and a text on what is done now."""

WARNING = "magtip: warning: "
"""How the line of a warning begins."""


@functools.cache
def warn_once(text: str) -> None:
    """A warning, once in a process; with no handler of logging's it goes to standard error as it is."""
    import logging

    logging.getLogger("magtip").warning("%s%s", WARNING, text)
