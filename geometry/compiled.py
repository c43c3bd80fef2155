"""Whether a function runs compiled by numba: the one rule for `geometry`, `fem` and `analytic`.

numba is optional (the extra `fast`). Importing it takes 0.35 to 0.6 s, longer than many solves, so a process imports
it only when that time pays off. Without numba, NumPy computes the same results to rounding.

A compiled function lies in a module of its own, `<name>_compiled`, whose functions have `@njit(cache=True,
no_cfunc_wrapper=True)`: numba compiles them once after an installation, and reads them from a file later; without the
wrapper for callers in C, which nobody needs, this takes a tenth less time. The caller writes

    kernels = compiled.load("fem.discretisation.volume_compiled") if compiled.worthwhile(0.02) else None

and takes the NumPy path if that is None; 0.02 is the CPU time in s that the compiled function saves in this call. Do
not import such a module in another way. Add it to the list of modules under "numba" in pyproject.toml, to the map in
its package's README.md, and write `tests/test_<name>_compiled.py`, which compares both paths.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import importlib
import importlib.util
import os
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from types import ModuleType

IMPORT_S = 0.4
"""CPU time for importing numba and for reading compiled functions, s."""
COMPILE_S = 60.0
"""Bound of the CPU time for compiling all functions once after an installation, s: measured 30 to 51."""

_uncompiled: ContextVar[bool] = ContextVar("uncompiled", default=False)
"""Whether `uncompiled` is in effect."""
_saving_s = [0.0]
"""CPU time that compiled functions would have saved so far in this process, s."""


def available() -> bool:
    """Return whether numba is installed, and not switched off by `uncompiled`. This does not import numba."""
    return not _uncompiled.get() and _installed()


@functools.cache
def _installed() -> bool:
    return importlib.util.find_spec("numba") is not None


def worthwhile(saving_s: float) -> bool:
    """Return whether to run a compiled function that saves `saving_s`, s, in this call.

    That is the case if numba is imported already (`prepare` imports it), or if compiled functions would have saved
    the time of importing numba in the calls so far and this one. So a process never takes more than twice its least
    time, a single short solve never imports numba, and the decision depends on the sequence of calls, not on a clock.
    """
    if not available():
        return False
    if "numba" in sys.modules:
        return True
    _saving_s[0] += saving_s
    return _saving_s[0] >= IMPORT_S


def prepare() -> bool:
    """Import numba now, so that all later calls run compiled; return whether they will.

    For processes that solve many times, and before times are measured. Each compiled function is compiled at its
    first call after an installation.
    """
    if not available():
        return False
    try:
        importlib.import_module("numba")
    except ImportError:  # numba is installed, but does not support this version of NumPy
        return False
    return True


def cores() -> int:
    """Return the number of cores that this process may use."""
    # not the number of the machine: a batch system or taskset may grant fewer
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads() -> int:
    """Return the number of threads for compiled loops: the cores, or fewer if the user's environment says so."""
    limits = [os.environ.get(name, "") for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS")]
    return min([cores(), *(int(limit) for limit in limits if limit.isdecimal() and int(limit) > 0)])


@functools.cache
def load(module: str) -> ModuleType | None:
    """Import a module of compiled functions, once in a process; return None if numba is not usable."""
    try:
        functions = importlib.import_module(module)
    except (ImportError, RuntimeError):
        # numba is not installed, does not support this version of NumPy, or finds no writable folder for its files
        return None
    _announce_compilation()
    return functions


@functools.cache
def _announce_compilation() -> None:
    """Let a terminal show one line when numba begins to compile; it does so for functions that no file holds yet.

    Also let Python not collect garbage while numba compiles.
    """
    from numba.core import event

    class Announcement(event.Listener):  # type: ignore[misc]
        shown = False
        # depth of nested compilations, and whether garbage was collected before the outermost
        depth, collects = 0, False

        def on_start(self, event: object) -> None:
            if not self.shown and sys.stderr.isatty():
                print(f"Compiling, once after an installation: this takes up to {COMPILE_S:g} s", file=sys.stderr)
            self.shown = True
            # numba keeps its many objects until it has finished: looking for garbage takes a sixth of the time
            if not self.depth:
                self.collects = gc.isenabled()
                gc.disable()
            self.depth += 1

        def on_end(self, event: object) -> None:
            self.depth -= 1
            if not self.depth and self.collects:
                gc.enable()

    event.register("numba:compile", Announcement())


@contextlib.contextmanager
def uncompiled() -> Iterator[None]:
    """Within this context, `available` and `worthwhile` are False: everything is computed as without numba."""
    token = _uncompiled.set(True)
    try:
        yield
    finally:
        _uncompiled.reset(token)
