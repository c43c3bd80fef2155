"""Ranges of homogeneous stretches in which a silicone's law is stable, and in which it must be stable.

The body is incompressible and free of stress in its last direction. A law is called stable at such a stretch if it is
so in Drucker's sense (`fem.results.silicone_limits`), and dP : dF > 0 along the mode itself, so that the nominal
stress still rises.

A law must be stable within the range of the test: in each mode, at all stretches whose principal stretches the
specimen had (`ranges_of_test`). It should also be stable at the stretches that solves reach (`SOLVE`). Uniaxial
compression is equibiaxial tension, and vice versa.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fem.model.material import law
from fem.results import silicone_limits
from geometry.arrays import Array

Ranges = dict[str, tuple[float, float]]

MODES = {"uniaxial": (1.0, -0.5, -0.5), "equibiaxial": (1.0, 1.0, -2.0), "planar": (1.0, 0.0, -1.0)}
"""Logarithmic strains of each mode over that of its first direction; the last direction is free of stress."""

RANGE = (0.3, 4.0)
"""Stretches between which stability is looked for. Single points at the magnet's rounded edge come close to that: in
a press of the paper's sensor to D/4 they reach 2.7 by 0.33, and to 3/8 D 4.3 by 0.18, nearly planar."""

SOLVE: Ranges = {"uniaxial": (0.39, 1.26), "equibiaxial": (0.89, 1.6), "planar": (0.41, 2.3)}
"""Stretches of all but a thousandth of the silicone, next to each mode, in a press of the paper's sensor to 3/8 D (3
mm, neo-Hookean, accuracy standard); in a press to D/4 (2 mm) 0.52 to 1.18, 0.92 to 1.38 and 0.59 to 1.64.
`tests/test_law_stability.py` measures them at the points of integration."""

STEPS = 400
"""Number of stretches between 1 and each end of the range at which stability is checked."""


def ranges_of_test(stretch: Array) -> Ranges:
    """Return the stretches of each mode whose principal stretches the specimen of a test had.

    Parameters
    ----------
    stretch : of a uniaxial test, shape (n,).

    >>> {mode: tuple(round(end, 3) for end in ends) for mode, ends in ranges_of_test(np.array([1.0, 2.0])).items()}
    {'uniaxial': (0.707, 2.0), 'equibiaxial': (0.707, 1.189), 'planar': (0.707, 1.414)}
    """
    h = np.log(stretch)[:, None] * np.array(MODES["uniaxial"])
    low, high = min(float(h.min()), 0.0), max(float(h.max()), 0.0)
    found = {}
    for mode, strains in MODES.items():
        up = min(high / s if s > 0 else low / s for s in strains if s)
        down = max(low / s if s > 0 else high / s for s in strains if s)
        found[mode] = (math.exp(down), math.exp(up))
    return found


def ranges(name: str, numbers: tuple[float, ...], also: Ranges | None = None) -> Ranges:
    """Return the stretches around 1 between which the law is stable in each of `MODES`, within `RANGE` and `also`.

    >>> ranges("neo-hookean", ())["planar"]
    (0.3, 4.0)
    """
    found = {}
    for mode, strains in MODES.items():
        low, high = (also or {}).get(mode, RANGE)
        reached = []
        for end in (min(RANGE[0], low), max(RANGE[1], high)):
            stretch = np.exp(np.linspace(0, math.log(end), STEPS))
            stretch[-1] = end
            good = stable(name, numbers, stretch, np.array(strains))
            last = len(good) - 1 if good.all() else max(int(np.argmin(good)) - 1, 0)
            reached.append(float(stretch[last]))
        found[mode] = (reached[0], reached[1])
    return found


def within(wanted: Ranges, stable: Ranges) -> bool:
    """Return whether the wanted stretches lie within the stable ones, up to rounding.

    >>> within({"planar": (0.5, 2.0)}, {"planar": (0.3, 1.9)})
    False
    """
    return all(
        stable[mode][0] <= low * (1 + 1e-12) and high <= stable[mode][1] * (1 + 1e-12)
        for mode, (low, high) in wanted.items()
    )


def stable(name: str, numbers: tuple[float, ...], stretch: Array, strains: Array) -> NDArray[np.bool_]:
    """Return whether the law is stable at stretches, shape (n,), of a mode; strains (3,) are over log(stretch)."""
    tau, D = silicone_limits.stress_and_stiffness(law(name, numbers), np.log(stretch)[:, None] * strains)
    # the pressure that makes the stress in the last direction zero
    tau = tau - tau[:, 2:]
    along = (D @ strains) @ strains - tau @ strains**2
    return np.asarray((silicone_limits.least_stiffness(D) > 0) & (along > 0))
