"""The functions of `analytic.inverse.pose_search`, compiled by numba."""

from __future__ import annotations

from types import FunctionType

from numba import njit

from analytic.field import cylinder_compiled
from analytic.inverse import pose_search

# a second set of function objects with a scope of their own: the plain functions stay callable beside the compiled
_scope = dict(vars(pose_search)) | {"meridian": cylinder_compiled.meridian}
for _name, _plain in vars(pose_search).items():
    # numba looks up the names in a function when it is first called, so the order does not matter
    if isinstance(_plain, FunctionType) and _plain.__module__ == pose_search.__name__:
        _function = FunctionType(_plain.__code__, _scope, _name)
        _scope[_name] = njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)(_function)

poses_of = _scope["poses_of"]
