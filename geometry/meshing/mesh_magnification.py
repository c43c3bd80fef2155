"""Enlargement of a small magnet for meshing, and the map of the mesh back to the true body.

fTetWild's time grows with the area of all surfaces over the square of the smallest detail: a disc of 0.2 mm in a beam
of 50 mm would take it hours. So the magnet is enlarged, the enlarged body is meshed, and the mesh is contracted
around a pole on the axis. The pole is the magnet's centre or, for a magnet close to the base, the base's centre. A
point at distance s from the pole moves along its ray to the distance rho:

    rho = s / factor            s <= core        the magnet, similar to the enlarged one
    rho = room (s / room)^q     core < s < room  with q = 1 + log(factor) / log(room / core)
    rho = s                     s >= room        base, side and dome do not move

Cells between core and room become longer along the radius by the ratio q. The core is a fifth of the room. A magnet
that is too large for a core of this size gets a larger one, with which q is 2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from geometry.design import Shape

CORE, MARGIN, ROOM = 0.2, 1.5, 0.9
"""Ratios of radii about the pole.

CORE is the least ratio of the core to the room. MARGIN is the ratio of the core to the farthest point of the enlarged
magnet. ROOM is the ratio of the room to the distance of the closest outer surface.
"""
LEAST = 1.5
"""Least useful factor: a magnet that would be enlarged by less is meshed at its true size."""


@dataclass(frozen=True, slots=True)
class Zoom:
    """The enlargement of a magnet for meshing.

    Attributes
    ----------
    shape : the body with the enlarged magnet.
    centre : height of the enlarged magnet's centre.
    pole : height of the pole on the axis.
    factor, core, room : as in the equations of this module.
    """

    shape: Shape
    centre: float
    pole: float
    factor: float
    core: float
    room: float

    @classmethod
    def of(cls, shape: Shape) -> Zoom:
        """Return the enlargement with the better of two poles; the factor is 1 for a magnet that is large enough."""
        a, b = shape.magnet_diameter / 2, shape.magnet_height / 2
        near = (shape.H, ROOM * min(shape.R, shape.H), math.hypot(a, b))
        low = (0.0, ROOM * shape.R, math.hypot(a, shape.H + b))
        # the factor grows with the room over the magnet's reach
        pole, room, reach = max(near, low, key=lambda choice: choice[1] / choice[2] if choice[2] else 0.0)
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
        """Return the points of the true body, shape (3, n), that belong to points of the enlarged body."""
        if self.factor == 1:
            return points
        arm = points - np.array([[0.0], [0.0], [self.pole]])
        s = np.linalg.norm(arm, axis=0)
        q = 1 + math.log(self.factor) / math.log(self.room / self.core)
        between = (np.clip(s, self.core, self.room) / self.room) ** (q - 1)
        shrink = np.where(s <= self.core, 1 / self.factor, between)
        return np.asarray(points + (shrink - 1) * arm)
