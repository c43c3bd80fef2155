"""The functions of `analytic.cylinder`, compiled by numba; importing this module imports numba.

Other functions that numba compiles can call `set_point`, `correct_gap` and `compute`.
"""

from __future__ import annotations

from types import FunctionType

import numpy as np

from analytic import cylinder
from geometry.arrays import Array, Ints
from geometry.compiled import compiled

# a second set of function objects with a scope of their own: the plain functions stay callable beside the compiled
_scope = dict(vars(cylinder))
for _name, _plain in vars(cylinder).items():
    # numba looks up the names in a function when it is first called, so the order does not matter
    if isinstance(_plain, FunctionType) and _plain.__module__ == cylinder.__name__ and not _plain.__annotations__:
        _scope[_name] = compiled(FunctionType(_plain.__code__, _scope, _name), nogil=True)

fill, compute = _scope["fill"], _scope["compute"]
set_point, correct_gap = _scope["set_point"], _scope["correct_gap"]


def workspace() -> tuple[Array, Ints, Ints]:
    """Return the scratch that `fill` and `compute` need: numbers, points and faces by method, and their counts."""
    return (
        np.empty(cylinder.SIZE),
        np.empty((cylinder.METHODS, cylinder.FACES), np.int64),
        np.empty(cylinder.METHODS, np.int64),
    )


def fill_compiled(x: Array, radius: float, half: float, J: float, B: Array, jacobian: Array) -> int:
    """Do what `cylinder.fill_plain` does."""
    series = cylinder.cylinder_series(half / radius), cylinder.disc_series()
    return int(fill(x, radius, half, J, *series, workspace(), B, jacobian))
