"""Quadratic elements around the edge of a glued area, where the strain is infinite.

Where a plate is glued to a part of the skin and the rest is free, the displacement of an incompressible solid grows
as sqrt(s) with the distance s from the edge, and the stress as 1 / sqrt(s). Polynomials approximate this badly: with
ordinary elements the shear force converges with the first power of their size. An isoparametric quadratic element
contains sqrt(s) exactly if the middle nodes of those edges that end at the singular node lie at a quarter of their
length (Henshell and Shaw, Int. J. Numer. Methods Eng. 9, 1975; Barsoum, ibid. 10, 1976).

Here they lie at the share PLACE, a little farther away: s = (4 PLACE - 1) t + (2 - 4 PLACE) t^2 along an edge of unit
length with the element's coordinate t. At a quarter, the map is singular at the node. And under a large shear only a
part of the edge stays where it was glued: elsewhere the plate touches more skin, and the strain is finite.

A frictionless press is different: there the gap opens as s^(3/2). These elements then show small waves where the
contact ends, see `fem.model.symmetry_models`. Presses that nothing is glued to keep the middle nodes in the
middle, and so do plates that are glued under a tilt, where the edge lies at several radii, and natural frequencies
and vibrations about a press.
"""

from __future__ import annotations

from dataclasses import dataclass

from geometry.arrays import Array, Ints

PLACE = 0.3
"""Place of the middle nodes as a share of the edge's length from the singular node. For the paper's sensor, a press
of 1 mm and a shear of 3 mm, section size 0.16 D, 0.012 D at the edge and four harmonics, the force is 0.09 % off at
0.3, 0.11 % at 0.25, 0.25 % at 0.35, and 0.91 % at 0.5, which is the middle."""


@dataclass(frozen=True, slots=True)
class SingularEdges:
    """Edges of quadratic elements that have one end at the singularity.

    Attributes
    ----------
    near, far, middle : (m,) nodes at the singularity, at the other ends, and between them.
    """

    near: Ints
    far: Ints
    middle: Ints

    def move(self, x: Array) -> None:
        """Move the middle nodes of x, shape (dimensions, n), along their parabolas to the share PLACE, in place."""
        t, near, far = PLACE, x[:, self.near], x[:, self.far]
        x[:, self.middle] = (1 - t) * (1 - 2 * t) * near + 4 * t * (1 - t) * x[:, self.middle] + t * (2 * t - 1) * far
