"""Equilibria: linear systems, the Newton loop, load increments and paths."""

import sys
import types


class _SubPackage(types.ModuleType):
    """This package, which is no function: `from fem import solve` gives it."""

    def __call__(self, *_: object, **__: object) -> None:
        raise TypeError("fem.solve is a sub-package: write `from fem.equilibrium import solve`")


sys.modules[__name__].__class__ = _SubPackage
