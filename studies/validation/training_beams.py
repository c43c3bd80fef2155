"""Beams for training, for the calibration of intervals, and for testing.

A Gaussian process extrapolates badly. So training begins with the corners of the range, and the scrambled Sobol
points that follow are stretched beyond it and cut at its faces: two of three lie on a face. Later points fill the
gaps between the first ones. Beams of calibration and test are independent random points, the same number in each
region of the beams, so that no region's intervals rest on a handful of beams: within a region they are drawn as a
user's would be, and training has not seen them.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from geometry.arrays import Array
from geometry.design import Design
from studies.surrogate import prediction, surrogate_range
from studies.surrogate.surrogate_range import DENSITY_RATIO, DIAMETER, EDGE, HEIGHT, LEAST_WALL, LENGTH, POISSON

DIAMETER_MM = 10.0
"""D of the designs that are solved; the answers hold for every D."""
DIGITS = 5
"""Digits of the lengths over D: a design file can repeat a beam exactly."""
DIMENSIONS = 6
STRETCH = 1.2
"""Factor by which the Sobol points of training are stretched from the centre of the cube, before they are cut at its
faces."""


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
    """Return the first `count` beams of training; more beams keep the first ones."""
    points = qmc.Sobol(DIMENSIONS, rng=seed)
    found = corners()
    while len(found) < count:
        beams = of_cube(np.clip(0.5 + STRETCH * (points.random(1024) - 0.5), 0.0, 1.0))
        found = joined(found, beams[beams.in_range])
    return found[:count]


def corners() -> Beams:
    """Return the corners of the range of L, diameter, height and nu, each with two edges and depths of its shear.

    A magnet that is too high for its beam is as high as the walls allow.
    """
    unit = np.array(list(itertools.product((0.0, 1.0), repeat=5)))
    # the share changes with the parity of the others: half of the corners of the six dimensions; mixed, so that the
    # first few differ in all of them
    unit = np.random.default_rng(0).permutation(np.column_stack([unit, unit.sum(axis=1) % 2]))
    low, high = np.zeros(len(unit)), unit[:, 2].copy()
    for _ in range(40):
        middle = (low + high) / 2
        fits = _possible(_scaled(np.column_stack([unit[:, :2], middle, unit[:, 3:]])))
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    whole = _possible(_scaled(unit))
    return of_cube(np.column_stack([unit[:, :2], np.where(whole, unit[:, 2], low - 1e-4), unit[:, 3:]]))


def random_beams(count: int, seed: int) -> Beams:
    """Return independent random beams of the range."""
    rng = np.random.default_rng(seed)
    found = joined()
    while len(found) < count:
        beams = of_cube(rng.random((1024, DIMENSIONS)))
        found = joined(found, beams[beams.in_range])
    return found[:count]


def regional_beams(count: int, seed: int) -> Beams:
    """Return `count` independent random beams of each region, region after region in turn; more keep the first."""
    many = random_beams(100 * count * prediction.REGIONS, seed)
    region = prediction.beam_region(many.L, many.diameter, many.height)
    rows = [np.flatnonzero(region == k)[:count] for k in range(prediction.REGIONS)]
    return many[np.stack(rows, axis=1).ravel()]


def of_cube(unit: Array) -> Beams:
    """Return the beams of points of the unit cube, shape (n, 6), without those whose magnet leaves too thin a wall.

    The length is spread on a log scale. Poisson's ratio is spread in (1 - 2 nu)^(1/2): most silicones are close to
    0.5, and the response changes with 1 - 2 nu.
    """
    beams = _scaled(unit)
    return beams[_walled(beams)]


def _scaled(unit: Array) -> Beams:
    """Return the beams of all points of the unit cube."""
    low, high = LENGTH
    soft = 1 - 2 * POISSON[0]
    L = low * (high / low) ** unit[:, 0]
    d, h, edge = (a + (b - a) * unit[:, k] for k, (a, b) in ((1, DIAMETER), (2, HEIGHT), (4, EDGE)))
    nu = (1 - soft * unit[:, 3] ** 2) / 2
    L, d, h, nu, edge = (np.round(x, DIGITS) for x in (L, d, h, nu, edge))
    return Beams(L, d, h, nu, edge, unit[:, 5])


def _walled(beams: Beams) -> NDArray[np.bool_]:
    """Return which beams have enough silicone around their magnets."""
    return np.asarray(surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge) >= LEAST_WALL)


def _possible(beams: Beams) -> NDArray[np.bool_]:
    return np.asarray(_walled(beams) & beams.in_range)


def joined(*parts: Beams) -> Beams:
    """Return the beams of all parts."""
    empty = np.empty(0)
    return Beams(*(np.concatenate([empty, *(getattr(one, name) for one in parts)]) for name in Beams.__slots__))
