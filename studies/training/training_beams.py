"""Beams for training and for testing, spread evenly over the range of the surrogate.

Training beams are scrambled Sobol points, so that later ones fill the gaps between the first ones. Beams of the test
are independent random points: they are drawn as a user's would be, and training has not seen them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from geometry.arrays import Array
from geometry.design import Design
from studies.surrogate import surrogate_range
from studies.surrogate.surrogate_range import DENSITY_RATIO, DIAMETER, EDGE, HEIGHT, LEAST_WALL, LENGTH, POISSON

DIAMETER_MM = 10.0
"""D of the designs that are solved; the answers hold for every D."""
DIGITS = 5
"""Digits of the lengths over D: a design file can repeat a beam exactly."""
DIMENSIONS = 6


@dataclass(frozen=True, slots=True)
class Beams:
    """Beams of the surrogate, arrays of shape (n,).

    Attributes
    ----------
    L, diameter, height : length of the beam, and size of its magnet, over D.
    nu : Poisson's ratio.
    edge : radius of the magnet's edges over the smaller side of its section.
    share : where the depth of its shear lies between the least and the largest one, 0 to 1 in the root of the depth.
    """

    L: Array
    diameter: Array
    height: Array
    nu: Array
    edge: Array
    share: Array

    def __len__(self) -> int:
        return len(self.L)

    def __getitem__(self, rows: slice | NDArray[Any]) -> Beams:
        return Beams(*(getattr(self, name)[rows] for name in self.__slots__))

    @property
    def in_range(self) -> NDArray[np.bool_]:
        """Which beams have enough silicone below the magnet for the surrogate, shape (n,)."""
        return surrogate_range.below(self.L, self.height) >= surrogate_range.LEAST_BELOW

    @property
    def density_ratio(self) -> Array:
        """Density of the magnet over that of the silicone, for the natural frequencies, shape (n,).

        It follows the last coordinate, which matters to shears only otherwise.
        """
        low, high = DENSITY_RATIO
        return np.asarray(np.round(low + (high - low) * self.share, DIGITS))

    def design(self, k: int) -> Design:
        """Return beam `k` as a design of D = 10 mm and E = 1 MPa."""
        D, smaller = DIAMETER_MM, min(float(self.diameter[k]), float(self.height[k]))
        return Design(
            D=D,
            L=_round(self.L[k]) * D,
            nu=_round(self.nu[k]),
            magnet_diameter=_round(self.diameter[k]) * D,
            magnet_height=_round(self.height[k]) * D,
            magnet_edge_radius=_round(self.edge[k] * smaller) * D,
            l0=10 * D,
        )


def _round(value: float) -> float:
    return round(float(value), DIGITS)


def training_beams(count: int, seed: int) -> Beams:
    """Return the first `count` beams of a Sobol sequence; more beams keep the first ones."""
    points = qmc.Sobol(DIMENSIONS, rng=seed)
    inside = Beams(*(np.empty(0),) * DIMENSIONS)
    while len(inside) < count:
        inside = joined(inside, of_cube(points.random(1024)))
    return inside[:count]


def random_beams(count: int, seed: int) -> Beams:
    """Return independent random beams."""
    rng = np.random.default_rng(seed)
    inside = Beams(*(np.empty(0),) * DIMENSIONS)
    while len(inside) < count:
        inside = joined(inside, of_cube(rng.random((1024, DIMENSIONS))))
    return inside[:count]


def of_cube(unit: Array) -> Beams:
    """Return the beams of points of the unit cube, shape (n, 6), without those whose magnet leaves too thin a wall.

    The length is spread on a log scale. Poisson's ratio is spread in (1 - 2 nu)^(1/2): most silicones are close to
    0.5, and the response changes with 1 - 2 nu.
    """
    low, high = LENGTH
    soft = 1 - 2 * POISSON[0]
    L = low * (high / low) ** unit[:, 0]
    d, h, edge = (a + (b - a) * unit[:, k] for k, (a, b) in ((1, DIAMETER), (2, HEIGHT), (4, EDGE)))
    nu = (1 - soft * unit[:, 3] ** 2) / 2
    L, d, h, nu, edge = (np.round(x, DIGITS) for x in (L, d, h, nu, edge))
    beams = Beams(L, d, h, nu, edge, unit[:, 5])
    possible = surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge) >= LEAST_WALL
    return beams[possible]


def joined(one: Beams, other: Beams) -> Beams:
    """Return the beams of both."""
    return Beams(*(np.concatenate([getattr(one, name), getattr(other, name)]) for name in Beams.__slots__))
