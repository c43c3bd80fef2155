"""Range of the surrogate, and the loads at which it was trained. All lengths are over D.

A beam is its length L, diameter d and height h of its magnet, Poisson's ratio nu, and the radius of the magnet's
edges. The law is neo-Hookean, the only one whose shape does not depend on further numbers; forces are proportional
to E.

Presses go to `deepest`, at most `DEPTH_SHARE` of the silicone on the axis, and less above a wide magnet: there the
free skin of a thin base creases, and the force beyond depends on the mesh. Glued shears go to `farthest`. The
response to a press is smooth in the root of the depth, because the contact radius grows like it, so the depths of
training are Chebyshev's points of this root.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

from geometry.arrays import Array

LENGTH = (0.75, 4.0)
DIAMETER = (0.2, 0.8)
HEIGHT = (0.1, 0.8)
POISSON = (0.45, 0.5)
EDGE = (0.0, 0.15)
"""Radius of the magnet's edges over the smaller side of its section."""
USUAL_EDGE = 0.05
"""The edge radius, over the smaller side, where none is given: that of the paper's sensor."""
DENSITY_RATIO = (4.0, 8.5)
"""Density of the magnet over that of the silicone: ferrite 4.7, NdFeB 7, SmCo 7.8 times a silicone of 1.07."""
LEAST_WALL = 0.04
"""Least thickness of silicone around the magnet."""
LEAST_BELOW = 0.15
"""Least thickness of silicone between magnet and base. Above a thinner one the magnet hardly moves, and the response
varies so steeply with the thickness that the surrogate would be several times less accurate."""
SHALLOWEST, DEEPEST, DEPTH_SHARE = 0.01, 0.375, 0.4
WIDEST_SHARE = 0.28
"""Largest depth over the silicone on the axis at the widest magnet; from a diameter of 0.5 on it falls evenly. The
free skin creases where its stretch normal to itself is 2.4 times the least one along it (Hong, Zhao and Suo 2009). At
level quick, for L from 0.75 to 1.2, incompressible silicone reaches 2.2 at shares from 0.28 on above magnets of 0.8,
and from 0.3 and 0.32 on above those of 0.75 and 0.7."""
SHALLOWEST_SHEAR = 0.03
FARTHEST, SHEAR_SHARE = 0.375, 0.35
"""Largest shear, also over L: a shorter beam would be stretched to several times its length."""
PRESS_NODES = 8
SHEAR_NODES = (0.2, 0.5, 0.8, 1.0)
"""Shears of training over the largest one."""


def deepest(L: Array, diameter: Array, height: Array) -> Array:
    """Return the largest depth of beams, shape (n,).

    >>> deepest(np.array([1.125, 0.75, 0.9]), np.array([0.5, 0.2, 0.8]), np.array([0.25, 0.25, 0.1])).round(9)
    array([0.35 , 0.2  , 0.224])
    """
    over = np.clip((diameter - 0.5) / (DIAMETER[1] - 0.5), 0.0, 1.0)
    return np.asarray(np.minimum(DEEPEST, (DEPTH_SHARE + (WIDEST_SHARE - DEPTH_SHARE) * over) * (L - height)))


def farthest(L: Array) -> Array:
    """Return the largest shear of beams, shape (n,)."""
    return np.asarray(np.minimum(FARTHEST, SHEAR_SHARE * L))


def wall(L: Array, diameter: Array, height: Array, edge: Array) -> Array:
    """Return the least thickness of silicone around magnets, shape (n,), as `geometry.design.Shape.wall` does.

    `edge`: radius of the magnet's edges, over the smaller side of its section.
    """
    a, b = diameter / 2, height / 2
    rho = edge * np.minimum(diameter, height)
    dome = 0.5 - np.hypot(a - rho, b - rho) - rho
    return np.asarray(np.minimum(np.minimum(dome, 0.5 - a), L - 0.5 - b))


def below(L: Array, height: Array) -> Array:
    """Return the thickness of silicone between magnet and base, shape (n,)."""
    return np.asarray(L - 0.5 - height / 2)


def press_depths(L: Array, diameter: Array, height: Array) -> Array:
    """Return the depths of training, rising, shape (n, PRESS_NODES)."""
    low, high = np.sqrt(SHALLOWEST), np.sqrt(deepest(L, diameter, height))[:, None]
    share = (chebyshev.chebpts2(PRESS_NODES) + 1) / 2
    return np.asarray((low + (high - low) * share) ** 2)


def shears(L: Array) -> Array:
    """Return the shears of training, rising, shape (n, len(SHEAR_NODES))."""
    return np.asarray(farthest(L)[:, None] * np.array(SHEAR_NODES))
