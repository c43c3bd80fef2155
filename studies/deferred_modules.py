"""Modules that libraries import without need: the command line runs them when they are first used, not before.

SciPy asks for every public module of NumPy, its Fortran compiler and its tests among them, scipy.spatial loads
rotations, and numba a reader of settings: together a quarter of the imports of a solve, which uses none of them.
`importlib.util.LazyLoader`, of the standard library, runs a module at the first use of one of its names, so that
whatever does use them finds them.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader
from types import ModuleType

DEFERRED = ("numpy.f2py", "numpy.testing", "scipy.spatial.transform", "yaml")


class _Finder:
    """Finds the deferred modules where they are, and has them run later."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name not in DEFERRED:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def defer() -> None:
    """Defer them for the rest of this process, those that are not imported yet."""
    if _Finder not in sys.meta_path:
        sys.meta_path.insert(0, _Finder)
