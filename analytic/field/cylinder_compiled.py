"""The functions of `analytic.field.cylinder_pointwise`, compiled by numba.

`analytic.magnet` imports this module, which takes about a second, at the first call that it speeds up.

Other functions that numba compiles can call `fill`, `meridian` and `at`.
"""

from __future__ import annotations

from types import FunctionType

import numpy as np
from numba import njit

from analytic.field import cylinder_pointwise

# a second set of function objects with a scope of their own: the plain functions stay callable beside the compiled
_scope = dict(vars(cylinder_pointwise)) | {"_root": np.sqrt}
for _name, _plain in vars(cylinder_pointwise).items():
    # numba looks up the names in a function when it is first called, so the order does not matter
    if isinstance(_plain, FunctionType) and _name != "_root":
        _scope[_name] = njit(cache=True)(FunctionType(_plain.__code__, _scope, _name))

fill, meridian, at = _scope["fill"], _scope["meridian"], _scope["at"]
