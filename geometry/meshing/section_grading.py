"""The target edge length in the (r, z) section: small at the features of the shape, growing with distance from them.

A point (r, z) is the complex number r + 1j z. All lengths are in units of D.
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
"""Edge length at a feature as a fraction of the size: at the tip (by default), at the clamped corner (R, 0), at a
sharp edge and at a rounded edge of the magnet."""
LEAST_CLAMP, CORNER = 0.012, 0.012
"""Least edge lengths at the clamped corner and at a sharp edge of the magnet, in units of D.

Both are singularities: smaller elements there gain no accuracy and become inverted (J <= 0) under load. At the clamp
this bound changes the force of a press to 3/8 D by less than 0.1 %.
"""
FILLET, ARC, GAP = 0.75, 0.1, 0.42
"""Largest edge lengths at a fillet and in a thin layer.

FILLET is a fraction of the fillet's radius (by default). ARC is a fraction of the root of D times the radius; with
it, parabolas in place of arcs change the volume by less than 1e-5. GAP is a fraction of the layer's thickness.
"""
TIP_GROWTH, FULL_TIP_GROWTH, GROWTH, FULL_GROWTH = 0.3, 0.12, 0.4, 0.075
"""Growth of the edge length per unit of distance: from the tip (TIP_GROWTH) and from other features (GROWTH).

For sizes below FULL_TIP_GROWTH and FULL_GROWTH, in units of D, the growth is reduced in proportion to the size, so
that half the size gives half of every edge length.
"""
GLUED_GROWTH = 0.5
"""Growth from the edge of a glued area: more than from the tip, for the elements there are graded themselves, see
`edge_singularity`."""
DOME, DOME_REACH, DOME_GROWTH = 0.35, 1.2, 0.8
"""Largest edge length along the dome as a fraction of the size, the angle from the tip up to which it applies, rad,
and its growth inwards.

The edge of the contact area then always lies in small elements. In larger elements, forces would scatter with the
position of this edge.
"""
_BEARINGS = np.linspace(0, DOME_REACH, 61)[1:]
DOME_POINTS = np.sin(_BEARINGS) + 1j * np.cos(_BEARINGS)
"""Sources along the dome of unit radius about 0."""
BLOCK = 32
"""Number of successive points that `Grading.along` looks up together."""


@dataclass(frozen=True, slots=True)
class Grading:
    """The target edge length as a function of the point, in units of D.

    Attributes
    ----------
    size : greatest edge length.
    source : points with a smaller edge length, shape (m,); the first one is the tip.
    least : edge length at each source, shape (m,).
    growth : growth of the edge length per distance from each source, shape (m,).
    """

    size: float
    source: Points
    least: Array
    growth: Array

    def __call__(self, x: Points) -> Array:
        """Return the target edge length at points, shape (n,)."""
        wanted: Array = np.minimum(self.size, self._lengths(x).min(axis=1))
        return wanted

    def along(self, x: Points) -> Array:
        """Return the target edge length at successive points, shape (n,): the same bits as `__call__`, but faster.

        The points are divided into blocks. For each block, only those sources are evaluated that can determine the
        edge length somewhere in it.
        """
        blocks = x[np.minimum(np.arange(len(x) + -len(x) % BLOCK), len(x) - 1)].reshape(-1, BLOCK)
        middle = (blocks[:, 0] + blocks[:, -1]) / 2
        # within a block, the edge length of a source differs by at most `change` from that at the block's middle
        length, change = self._lengths(middle), np.abs(blocks - middle[:, None]).max(axis=1)[:, None] * self.growth
        most = np.minimum(self.size, (length + change).min(axis=1)) + SMALLEST
        block, i = np.nonzero(length - change <= most[:, None])
        r, z = blocks.real[block] - self.source.real[i, None], blocks.imag[block] - self.source.imag[i, None]
        near = np.sqrt(r * r + z * z)
        near *= self.growth[i, None]
        near += self.least[i, None]
        first = np.flatnonzero(np.diff(block, prepend=-1))
        wanted = np.full(blocks.shape, self.size)
        wanted[block[first]] = np.minimum(self.size, np.minimum.reduceat(near, first))
        return wanted.ravel()[: len(x)]

    def _lengths(self, x: Points) -> Array:
        """Return the edge length that each source requires at each point, shape (n, m)."""
        length: Array = cdist(pairs(x), pairs(self.source))
        length *= self.growth
        length += self.least
        return length

    def reduced(self) -> Grading:
        """Return the grading without sources that have no effect: another source requires less everywhere.

        The tip always stays.
        """
        more = (self.least - SMALLEST > self._lengths(self.source).T) & (self.growth >= self.growth[:, None])
        used = np.append(0, 1 + np.flatnonzero(~np.any(more, axis=0)[1:]))
        return Grading(self.size, self.source[used], self.least[used], self.growth[used])


def pairs(x: Points) -> Array:
    """Return complex numbers, shape (n,), as real and imaginary parts, shape (n, 2)."""
    return np.ascontiguousarray(x).view(np.float64).reshape(-1, 2)


def grading(
    shape: Shape,
    curves: list[Curve],
    size: float,
    tip_size: float,
    rim: tuple[float, float] | None,
    fillet: float,
    meshed: bool,
    glued: bool,
) -> Grading:
    """Return the grading of a section: its sources are the features that require edges shorter than `size`.

    All lengths are in units of D. The parameters are those of `geometry.section.section`; `meshed` is True if the
    magnet is meshed too.
    """
    fixed, fixed_least, fixed_growth = fixed_sources(shape, size, tip_size, rim, glued)
    source, least = [fixed[:2]], [fixed_least[:2]]
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
    features = np.full(sum(map(len, source)) - 2, fixed_growth[1])
    growth = np.concatenate([fixed_growth[:2], features, fixed_growth[2:]])
    source, least = [*source, fixed[2:]], [*least, fixed_least[2:]]
    return Grading(size, np.concatenate(source), np.concatenate(least), growth).reduced()


def fixed_sources(
    shape: Shape, size: float, tip_size: float, rim: tuple[float, float] | None, glued: bool
) -> tuple[Points, Array, Array]:
    """Return the sources that every section has, their edge lengths and their growths, each of shape (n,).

    The first one is the tip, the second one the clamped corner; then come the dome and the ring. The parameters are
    those of `grading`.
    """
    from_tip, from_others = TIP_GROWTH * min(1, size / FULL_TIP_GROWTH), GROWTH * min(1, size / FULL_GROWTH)
    dome = 1j * shape.H + shape.R * DOME_POINTS
    source = np.concatenate([[1j * shape.L, shape.R], dome])
    corner = min(size, max(LEAST_CLAMP, CLAMP * size))
    along_dome = np.minimum(tip_size + TIP_GROWTH * shape.R * DOME_POINTS.real, DOME * size)
    least = np.concatenate([[tip_size, corner], along_dome])
    growth = np.concatenate([[from_tip, from_others], np.full(len(dome), DOME_GROWTH)])
    if rim is not None:
        r = min(rim[0], shape.R)
        source = np.append(source, r + 1j * (shape.H + math.sqrt(shape.R**2 - r**2)))
        least, growth = np.append(least, min(rim[1], size)), np.append(growth, GLUED_GROWTH if glued else TIP_GROWTH)
    return source, least, growth
