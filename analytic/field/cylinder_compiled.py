"""The functions of `analytic.field.cylinder_pointwise`, compiled by numba.

`analytic.magnet` imports this module, which takes about a second, at the first call that it speeds up.

Other functions that numba compiles can call `fill`, `meridian` and `at`.
"""

from __future__ import annotations

from types import FunctionType

from numba import njit

from analytic.field import cylinder_batches, cylinder_pointwise

# a second set of function objects with a scope of their own: the plain functions stay callable beside the compiled
_scope = dict(vars(cylinder_pointwise)) | dict(vars(cylinder_batches))
for _module in (cylinder_pointwise, cylinder_batches):
    for _name, _plain in vars(_module).items():
        # numba looks up the names in a function when it is first called, so the order does not matter
        if isinstance(_plain, FunctionType) and _plain.__module__ == _module.__name__:
            # error_model: a check of every divisor would keep the loops from computing several points at a time
            _function = FunctionType(_plain.__code__, _scope, _name)
            _scope[_name] = njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)(_function)

POINTS = cylinder_batches.POINTS
fill, meridian, at = _scope["fill"], _scope["meridian"], _scope["at"]
