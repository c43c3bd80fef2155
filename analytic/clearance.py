"""Whether the magnet or the beam runs into the Hall elements, at rest or moved. Lengths in mm, angles in rad.

The magnet is a rigid cylinder, so its gap is exact. The beam's wall is an estimate (the finite elements know it): the
axis runs straight from the base's centre to the moved magnet's centre, and the radius keeps the column's volume, with
D/2 at both ends and a parabola between, r^2 = (D/2)^2 [1 + 6 t (1 - t) (H/(H + shift_z) - 1)], t from 0 to 1. Over an
element that sits in the base, z < 0, the beam can lean but not touch it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from analytic.hall import in_magnet_frame
from analytic.parts import Element, of_design
from geometry.arrays import Array
from geometry.design import Design

Vector = tuple[float, float, float]


def magnet_gap(design: Design, point: Vector, shift: Vector, tilt: tuple[float, float]) -> float:
    """Distance of a point from the moved magnet, mm; 0 inside."""
    return float(magnet_gaps(design, point, np.array([shift]), np.array([tilt]))[0])


def magnet_gaps(design: Design, point: Vector, shifts: Array, tilts: Array) -> Array:
    """`magnet_gap` for shifts (n, 3), mm, and tilts (n, 2), rad; shape (n,)."""
    local = in_magnet_frame(np.tile(point, (len(shifts), 1)), design, shifts, tilts)
    beside = np.maximum(np.hypot(local[:, 0], local[:, 1]) - design.magnet_diameter / 2, 0.0)
    return np.asarray(np.hypot(beside, np.maximum(np.abs(local[:, 2]) - design.magnet_height / 2, 0.0)))


def wall_gap(design: Design, point: Vector, shift: Vector) -> float:
    """Distance of a point from the beam's wall, mm, negative inside.

    For a point in the base it is measured sideways; it is infinite where the beam stands over it anyway.
    """
    return float(wall_gaps(design, point, np.array([shift]))[0])


def wall_gaps(design: Design, point: Vector, shifts: Array) -> Array:
    """`wall_gap` for shifts (n, 3), mm; shape (n,)."""
    if point[2] < 0 and math.hypot(point[0], point[1]) <= design.R:
        return np.full(len(shifts), math.inf)
    x, y, z = shifts[:, :, None].transpose(1, 0, 2)
    height = np.maximum(design.H + z, 1e-3 * design.H)
    t = np.linspace(0, 1, 101)
    aside = np.hypot(point[0] - t * x, point[1] - t * y)
    above = t * height - point[2] if point[2] > 0 else 0.0
    radius = design.R * np.sqrt(1 + 6 * t * (1 - t) * (design.H / height - 1))
    return np.asarray((np.hypot(aside, above) - radius).min(axis=1))


def warnings(
    design: Design, shift: Vector, tilt: tuple[float, float], elements: Sequence[Element] | None = None
) -> list[str]:
    """What runs into what, in sentences."""
    found = []
    low = float(lowest(design, tilt)) + design.H + shift[2]
    if low < 0:
        found.append(f"the magnet's lowest point is {-low:.3g} mm below the base plane: no press reaches this pose")
    chosen = of_design(design) if elements is None else elements
    # the axes of a chip are at one place
    for element in {element.position: element for element in reversed(chosen)}.values():
        gap = magnet_gap(design, element.position, shift, tilt)
        if gap < element.plate / 2 or gap == 0:
            found.append(f"{element.name} touches or overlaps the magnet (gap {gap:.3g} mm)")
        gap = wall_gap(design, element.position, shift)
        if gap < 0:
            beside = "raise f" if design.hall_layout == "three" else "raise l0 or chip_x"
            remedy = beside if math.hypot(*element.position[:2]) > 0 else "raise l0"
            verb = "extends over" if element.position[2] < 0 else "overlaps"
            found.append(f"the beam's wall {verb} {element.name} by about {-gap:.3g} mm: {remedy}")
    return found


def lowest(design: Design, tilt: ArrayLike) -> Array:
    """Height of the magnet's lowest point over its centre, mm, negative, for tilts of shape (..., 2), rad."""
    rotation = np.asarray(tilt, dtype=np.float64)
    angle = np.hypot(rotation[..., 0], rotation[..., 1])
    a, b = design.magnet_diameter / 2, design.magnet_height / 2
    return np.asarray(-(a * np.abs(np.sin(angle)) + b * np.abs(np.cos(angle))))
