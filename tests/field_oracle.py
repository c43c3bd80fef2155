"""The field of a cylinder magnet in 60 digits by mpmath, against which that of `analytic` is held.

The end faces by complete elliptic integrals of the three kinds, in the text-book form; its slope by differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mpmath
import numpy as np
from numpy.typing import ArrayLike

from geometry.arrays import Array


def field(point: Sequence[float], radius: float, height: float, digits: int = 60) -> Array:
    """B at a point for J = 1, T, shape (3,); the numbers given are taken as exact. Not at r = radius."""
    with mpmath.workdps(digits):
        return np.array([float(v) for v in _field(point, radius, height)])


def slope(point: Sequence[float], radius: float, height: float) -> Array:
    """dB/dz for J = 1, T/mm, shape (3,), by a central difference in 100 digits over 1e-22 radii."""
    with mpmath.workdps(100):
        x, y, z, step = *(mpmath.mpf(float(v)) for v in point), mpmath.mpf(10) ** -22 * radius
        ends = (_field((x, y, end), radius, height) for end in (z + step, z - step))
        return np.array([float((a - b) / (2 * step)) for a, b in zip(*ends, strict=True)])


def relative(found: ArrayLike, expected: ArrayLike) -> float:
    """Norm of the difference over that of what is expected."""
    return float(np.linalg.norm(np.subtract(found, expected)) / np.linalg.norm(expected))


def _field(point: Sequence[Any], radius: float, height: float) -> list[Any]:
    x, y, z, a, h = (v if isinstance(v, mpmath.mpf) else mpmath.mpf(float(v)) for v in (*point, radius, height))
    rho = mpmath.hypot(x, y)
    r = rho / a
    g = (1 - r) / (1 + r)

    def face(zeta: Any) -> tuple[Any, Any]:
        s = mpmath.hypot(zeta, 1 + r)
        m = 4 * r / s**2
        if r == 0:
            return mpmath.mpf(0), mpmath.sign(zeta) / 2 - zeta / (2 * s)
        K, E = mpmath.ellipk(m), mpmath.ellipe(m)
        jump = mpmath.sign(zeta) / 2 if r < 1 else 0
        along = jump - zeta * (K + g * mpmath.ellippi(1 - g**2, m)) / (2 * mpmath.pi * s)
        return ((2 - m) * K - 2 * E) / (m * mpmath.pi * s), along

    (top_r, top_z), (bottom_r, bottom_z) = face((z - h / 2) / a), face((z + h / 2) / a)
    inside = 1 if r < 1 and abs(z) < h / 2 else 0
    lean = (top_r - bottom_r) / rho if r else mpmath.mpf(0)
    return [lean * x, lean * y, top_z - bottom_z + inside]
