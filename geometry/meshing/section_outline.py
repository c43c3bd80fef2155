"""The outline of the (r, z) section as curves, and distances from it.

A point (r, z) is the complex number r + 1j z.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import Shape

Points = NDArray[np.complex128]

SMALLEST = 1e-9
"""Length, in units of D, below which a length counts as zero."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A straight line, or an arc about `centre` from `bearing[0]` to `bearing[1]`, angles from +z towards +r."""

    name: str
    start: complex
    end: complex
    centre: complex | None = None
    bearing: tuple[float, float] = (0.0, 0.0)

    @property
    def length(self) -> float:
        if self.centre is None:
            return abs(self.end - self.start)
        return abs(self.start - self.centre) * abs(self.bearing[1] - self.bearing[0])

    def at(self, t: Array) -> Points:
        """Return the points at fractions t of the length, shape (n,); both ends are exact."""
        if self.centre is None:
            points = np.asarray(self.start + (self.end - self.start) * t, dtype=np.complex128)
        else:
            angle = self.bearing[0] + (self.bearing[1] - self.bearing[0]) * t
            points = self.centre + abs(self.start - self.centre) * (np.sin(angle) + 1j * np.cos(angle))
        points[t == 0], points[t == 1] = self.start, self.end
        return points


def outline(shape: Shape, magnet: str, rim: float | None = None) -> list[Curve]:
    """Return the curves of the outline: base, skin and axis, then the magnet's outline from its top to its bottom.

    magnet : "hole", "meshed" or "none". rim : radius of a ring that divides the dome into two curves.
    """
    R, H, a, b, rho = shape.R, shape.H, shape.magnet_diameter / 2, shape.magnet_height / 2, shape.magnet_edge_radius
    tip, equator, top, bottom = complex(0, shape.L), complex(R, H), complex(0, H + b), complex(0, H - b)
    curves = [
        Curve("base", 0j, complex(R)),
        Curve("skin", complex(R), equator),
        *_dome(shape, rim),
    ]
    if magnet == "none":
        return [*curves, Curve("axis", tip, 0j)]
    curves += [Curve("axis", tip, top), Curve("axis", bottom, 0j)]
    if magnet == "meshed":
        curves.append(Curve("axis", top, bottom))
    tiny = SMALLEST * shape.D
    # an edge radius that equals a, b or 0 up to rounding is set to it: otherwise a curve of almost no length remains
    rho = next((whole for whole in (a, b, 0.0) if abs(rho - whole) < tiny), rho)
    up, down, upper, lower = complex(a - rho, H + b), complex(a - rho, H - b), H + (b - rho), H - (b - rho)
    parts = [
        Curve("magnet", top, up),
        Curve("magnet", up, complex(a, upper), complex(a - rho, upper), (0.0, math.pi / 2)),
        Curve("magnet", complex(a, upper), complex(a, lower)),
        Curve("magnet", complex(a, lower), down, complex(a - rho, lower), (math.pi / 2, math.pi)),
        Curve("magnet", down, bottom),
    ]
    return curves + [part for part in parts if part.length >= tiny]


def _dome(shape: Shape, rim: float | None) -> list[Curve]:
    """Return the dome from the equator to the tip, in two arcs if a ring divides it."""
    R, centre = shape.R, complex(0, shape.H)
    stops = [(math.pi / 2, complex(R, shape.H)), (0.0, complex(0, shape.L))]
    if rim is not None and SMALLEST < rim / R < 1 - SMALLEST:
        angle = math.asin(rim / R)
        stops.insert(1, (angle, centre + R * complex(math.sin(angle), math.cos(angle))))
    return [Curve("skin", x, y, centre, (a, b)) for (a, x), (b, y) in itertools.pairwise(stops)]


def modulus(x: Points) -> Array:
    """Return the absolute values of complex numbers, with the same digits on every processor."""
    absolute: Array = np.sqrt(x.real * x.real + x.imag * x.imag)
    return absolute


def room(shape: Shape, x: Points) -> Array:
    """Return the least distance of points, shape (n,), from base, skin and magnet; negative outside the silicone."""
    dome = shape.R - modulus(x - 1j * shape.H)
    room: Array = np.minimum(x.imag, np.where(x.imag > shape.H, dome, shape.R - x.real))
    if not shape.has_magnet:
        return room
    a, b, rho = shape.magnet_diameter / 2, shape.magnet_height / 2, shape.magnet_edge_radius
    dr, dz = x.real - (a - rho), np.abs(x.imag - shape.H) - (b - rho)
    outside = modulus(np.maximum(dr, 0) + 1j * np.maximum(dz, 0))
    return np.minimum(room, outside + np.minimum(np.maximum(dr, dz), 0) - rho)
