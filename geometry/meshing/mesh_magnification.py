"""A small magnet is meshed enlarged, and the mesh is then drawn together around a pole on the axis.

fTetWild's time grows with the area of all surfaces over the square of the smallest detail, and a disc of 0.2 mm in a
beam of 50 mm would take it hours. Around the pole (the magnet's centre, or that of the base for a magnet close to it)
distances s of the enlarged body become rho, bearings stay:

    rho = s / factor            s <= core        the magnet, similar to itself
    rho = room (s / room)^q     core < s < room  with q = 1 + log(factor) / log(room / core)
    rho = s                     s >= room        base, side and dome stay as they are

so that cells between core and room become longer by q along the radius. The core is a fifth of the room, or for
magnets that are not small enough to be enlarged much by that, as much more as makes q = 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from geometry.design import Shape

CORE, MARGIN, ROOM = 0.2, 1.5, 0.9
"""Least radius of the enlarged core over the room, and core over the magnet's reach, and room over what there is."""
LEAST = 1.5
"""Magnets that would be enlarged by less stay as they are."""


@dataclass(frozen=True, slots=True)
class Zoom:
    """How a magnet is enlarged.

    Attributes
    ----------
    shape : the body with the enlarged magnet.
    centre : height of that magnet's centre.
    pole, factor, core, room : height of the pole on the axis, and s, factor and room as above.
    """

    shape: Shape
    centre: float
    pole: float
    factor: float
    core: float
    room: float

    @classmethod
    def of(cls, shape: Shape) -> Zoom:
        """That by which a magnet is enlarged most; one of factor 1 if it is large enough."""
        a, b = shape.magnet_diameter / 2, shape.magnet_height / 2
        near = (shape.H, ROOM * min(shape.R, shape.H), math.hypot(a, b))
        low = (0.0, ROOM * shape.R, math.hypot(a, shape.H + b))
        pole, room, reach = max(near, low, key=lambda one: one[1] / one[2] if one[2] else 0.0)
        core = room * max(CORE, math.sqrt(MARGIN * reach / room))
        factor = core / (MARGIN * reach) if shape.has_magnet else 0.0
        if not factor >= LEAST:
            return cls(shape, shape.H, shape.H, 1.0, 0.0, 0.0)
        enlarged = replace(
            shape,
            magnet_diameter=factor * shape.magnet_diameter,
            magnet_height=factor * shape.magnet_height,
            magnet_edge_radius=factor * shape.magnet_edge_radius,
        )
        return cls(enlarged, pole + factor * (shape.H - pole), pole, factor, core, room)

    def back(self, points: Array) -> Array:
        """Points of the enlarged body, shape (3, n), at their places in the true one."""
        if self.factor == 1:
            return points
        arm = points - np.array([[0.0], [0.0], [self.pole]])
        s = np.linalg.norm(arm, axis=0)
        q = 1 + math.log(self.factor) / math.log(self.room / self.core)
        between = (np.clip(s, self.core, self.room) / self.room) ** (q - 1)
        shrink = np.where(s <= self.core, 1 / self.factor, between)
        return np.asarray(points + (shrink - 1) * arm)
