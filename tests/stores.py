"""A store of solved states for one test."""

import contextlib
import tempfile
from pathlib import Path

from studies.mechanics import store


@contextlib.contextmanager
def temporary():
    """An open store that ends with the context."""
    with tempfile.TemporaryDirectory() as folder, store.opened(Path(folder, "solved.sqlite")) as kept:
        yield kept
