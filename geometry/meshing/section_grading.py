"""The wanted edge length in the (r, z) section: small at the features of the shape, larger with distance from them.

A point (r, z) is the complex number r + 1j z; all is in units of D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from geometry.arrays import Array
from geometry.design import Shape
from geometry.meshing.section_outline import SMALLEST, Curve, room

Points = NDArray[np.complex128]

TIP, CLAMP, SHARP_EDGE, ROUND_EDGE = 1 / 2, 1 / 15, 1 / 5, 1 / 2
"""Edge length at a feature as a fraction of the size: the tip (by default), (R, 0), the magnet's edges."""
LEAST_CLAMP, CORNER = 0.012, 0.012
"""Least edge lengths at the clamp and at the magnet's sharp edge, in D: finer elements there only follow the
singularity and turn inside out. At the clamp it costs the force of a press to 3/8 D less than 0.1 %."""
FILLET, ARC, GAP = 0.75, 0.1, 0.42
"""Largest edge length at a fillet, as a fraction of its radius (by default) and of the root of D times its radius, so
that parabolas for arcs err by less than 1e-5 of the volume; and in a thin layer, as a fraction of its thickness."""
TIP_GROWTH, FULL_TIP_GROWTH, GROWTH, FULL_GROWTH = 0.3, 0.12, 0.4, 0.075
"""Growth of the edge length with distance from the tip and from other features, and sizes (in D) below which they
shrink with the size, so that halving the size halves every edge length."""
DOME, DOME_REACH, DOME_GROWTH = 0.35, 1.2, 0.8
"""Largest edge length along the dome, as a fraction of the size, up to a bearing (rad) from the tip, and how fast it
grows inwards: wherever the contact ends, it ends in small elements. Without them forces scatter with its place."""
BLOCK = 32
"""Points along a curve that are looked up together."""


@dataclass(frozen=True, slots=True)
class Grading:
    """The wanted edge length: `size`, or less near the points `source` (first the tip), where it is `least`."""

    size: float
    source: Points
    least: Array
    growth: Array

    def __call__(self, x: Points) -> Array:
        wanted: Array = np.minimum(self.size, self._asked(x).min(axis=1))
        return wanted

    def along(self, x: Points) -> Array:
        """The very same at points that follow each other: blocks of them ask only sources that can matter."""
        blocks = x[np.minimum(np.arange(len(x) + -len(x) % BLOCK), len(x) - 1)].reshape(-1, BLOCK)
        middle = (blocks[:, 0] + blocks[:, -1]) / 2
        asked, change = self._asked(middle), np.abs(blocks - middle[:, None]).max(axis=1)[:, None] * self.growth
        most = np.minimum(self.size, (asked + change).min(axis=1)) + SMALLEST
        block, i = np.nonzero(asked - change <= most[:, None])
        r, z = blocks.real[block] - self.source.real[i, None], blocks.imag[block] - self.source.imag[i, None]
        near = np.sqrt(r * r + z * z)
        near *= self.growth[i, None]
        near += self.least[i, None]
        first = np.flatnonzero(np.diff(block, prepend=-1))
        wanted = np.full(blocks.shape, self.size)
        wanted[block[first]] = np.minimum(self.size, np.minimum.reduceat(near, first))
        return wanted.ravel()[: len(x)]

    def _asked(self, x: Points) -> Array:
        """The edge length that each source asks for, shape (n, sources)."""
        asked: Array = cdist(pairs(x), pairs(self.source))
        asked *= self.growth
        asked += self.least
        return asked

    def reduced(self) -> Grading:
        """The same without the sources that ask for more than another one everywhere (the tip stays)."""
        more = (self.least - SMALLEST > self._asked(self.source).T) & (self.growth >= self.growth[:, None])
        used = np.append(0, 1 + np.flatnonzero(~np.any(more, axis=0)[1:]))
        return Grading(self.size, self.source[used], self.least[used], self.growth[used])


def pairs(x: Points) -> Array:
    """The same numbers as real and imaginary parts, shape (n, 2)."""
    return np.ascontiguousarray(x).view(np.float64).reshape(-1, 2)


def grading(
    shape: Shape,
    curves: list[Curve],
    size: float,
    tip_size: float,
    rim: tuple[float, float] | None,
    fillet: float,
    meshed: bool,
) -> Grading:
    """Collect the features that ask for less than `size`, for D = 1."""
    source, least = (
        [np.array([1j * shape.L, shape.R])],
        [np.array([tip_size, min(size, max(LEAST_CLAMP, CLAMP * size))])],
    )
    for curve in curves:
        x = curve.at(np.linspace(0, 1, 41 if curve.name == "magnet" else 5))
        want = np.full(len(x), min(size, curve.length))
        if curve.name == "magnet":
            want = np.minimum(want, GAP * room(shape.without_magnet(), x))
            if curve.centre is not None:
                radius = abs(curve.start - curve.centre)
                want = np.minimum(want, min(ROUND_EDGE * size, fillet * radius, ARC * math.sqrt(radius)))
            elif shape.magnet_edge_radius < SMALLEST:
                corner = ((x == curve.start) | (x == curve.end)) & (x.real > 0)
                want = np.where(corner, np.minimum(want, max(CORNER, SHARP_EDGE * size)), want)
            if meshed:
                want = np.minimum(want, min(shape.magnet_height, shape.magnet_diameter / 2) / 2)
        source.append(x[want < size])
        least.append(want[want < size])
    from_tip, from_others = TIP_GROWTH * min(1, size / FULL_TIP_GROWTH), GROWTH * min(1, size / FULL_GROWTH)
    growth = np.append(from_tip, np.full(sum(map(len, source)) - 1, from_others))
    bearing = np.linspace(0, DOME_REACH, 61)[1:]
    source.append(1j * shape.H + shape.R * (np.sin(bearing) + 1j * np.cos(bearing)))
    least.append(np.minimum(tip_size + TIP_GROWTH * shape.R * np.sin(bearing), DOME * size))
    growth = np.append(growth, np.full(len(bearing), DOME_GROWTH))
    if rim is not None:
        r = min(rim[0], shape.R)
        source.append(np.array([r + 1j * (shape.H + math.sqrt(shape.R**2 - r**2))]))
        least.append(np.array([min(rim[1], size)]))
        growth = np.append(growth, TIP_GROWTH)
    return Grading(size, np.concatenate(source), np.concatenate(least), growth).reduced()
