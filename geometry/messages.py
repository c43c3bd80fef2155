"""Progress of long computations, and the start of a warning."""

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""A function that receives the completed fraction of the computation, 0 to 1, and the name of the current step."""

WARNING = "magtip: warning: "
"""Start of every line that holds a warning."""
