"""Progress and warnings of long computations."""

from __future__ import annotations

import functools
from collections.abc import Callable

Progress = Callable[[float, str], None]
"""A function that receives the completed fraction of the computation, 0 to 1, and the name of the current step."""

WARNING = "magtip: warning: "
"""Start of every line that holds a warning."""


@functools.cache
def warn_once(text: str) -> None:
    """Log a warning, but only the first time that this process asks for the same text.

    Without a handler for the logger "magtip", `logging` writes the plain text to standard error.
    """
    import logging

    logging.getLogger("magtip").warning("%s%s", WARNING, text)
