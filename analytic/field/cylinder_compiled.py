"""The functions of `cylinder_pointwise`, compiled by numba; `analytic.magnet` imports this module when it pays.

`fill`, `meridian` and `at` can be called from other functions that numba compiles.
"""

from __future__ import annotations

from types import FunctionType

import numpy as np
from numba import njit

from analytic.field import cylinder_pointwise

_scope = dict(vars(cylinder_pointwise)) | {"_root": np.sqrt}
for _name, _plain in vars(cylinder_pointwise).items():
    # the names in a compiled function are looked up when it is first called, so the order does not matter
    if isinstance(_plain, FunctionType) and _name != "_root":
        _scope[_name] = njit(cache=True)(FunctionType(_plain.__code__, _scope, _name))

fill, meridian, at = _scope["fill"], _scope["meridian"], _scope["at"]
