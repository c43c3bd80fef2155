"""Functions that numba compiles, and the number of threads for their loops.

numba compiles a function when it is first called, and keeps it in a file: once after an installation. Where no file
can be written, each process compiles what it needs.

numba itself compiles a function again when the function's own file has changed, but not when a function that it calls
has changed in another file: it would then run machine code of two versions. So the name of each kept file holds a
digest of all sources that are compiled.
"""

import functools
import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function by numba; a decorator, with numba's options.

    A division by zero gives inf or nan, as in NumPy. Without a wrapper for callers in C, which nobody needs,
    compiling takes a tenth less time.
    """
    from numba import njit

    _announce_compilation()
    options = {"error_model": "numpy", "no_cfunc_wrapper": True} | options
    # numba names its files after the qualified name
    function.__qualname__ = f"{function.__qualname__}_{_digest()}"
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # numba finds no folder for its files that can be written to
        return njit(**options)(function)


def sources() -> list[Path]:
    """Return the files of the packages of physics that mention compiled code.

    They hold compiled functions, or functions that these call and constants that these use.
    """
    root = Path(__file__).parent.parent
    files = (file for package in ("analytic", "fem", "geometry") for file in sorted((root / package).rglob("*.py")))
    return [file for file in files if b"compiled" in file.read_bytes()]


@functools.cache
def _digest() -> str:
    return hashlib.sha256(b"".join(file.read_bytes() for file in sources())).hexdigest()[:12]


@functools.cache
def _announce_compilation() -> None:
    """Let a terminal show one line when numba begins to compile."""
    from numba.core import event

    class Announcement(event.Listener):  # type: ignore[misc]
        shown = False

        def on_start(self, event: object) -> None:
            if not self.shown and sys.stderr.isatty():
                print("Compiling, once after an installation: this takes up to a minute", file=sys.stderr)
            self.shown = True

        def on_end(self, event: object) -> None:
            pass

    event.register("numba:compile", Announcement())


def cores() -> int:
    """Return the number of cores that this process may use."""
    # not the number of the machine: a batch system or taskset may grant fewer
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads() -> int:
    """Return the number of threads for compiled loops: the cores, or fewer if the user's environment says so."""
    limits = [os.environ.get(name, "") for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS")]
    return min([cores(), *(int(limit) for limit in limits if limit.isdecimal() and int(limit) > 0)])
