"""Gaps between the Hall elements and the magnet or the beam, at rest or displaced. Lengths in mm, angles in rad.

The magnet is a rigid cylinder, so its gap is exact. The position of the beam's wall is an estimate; only finite
elements compute it. The estimate takes a straight axis from the base's centre to the displaced magnet's centre. The
radius is D/2 at both ends, with a parabola for r^2 between them that keeps the column's volume,
r^2 = (D/2)^2 [1 + 6 t (1 - t) (H/(H + shift_z) - 1)], t from 0 to 1. The beam can extend over an element inside the
base, z < 0, but cannot touch it.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from analytic.hall import in_magnet_frame
from analytic.parts import Element, of_design
from geometry.arrays import Array, Vector
from geometry.design import Design


def magnet_gaps(design: Design, point: Vector, shifts: Array, tilts: Array) -> Array:
    """Return the distances of a point, mm, from the displaced magnet, shape (n,), mm; 0 inside.

    shifts, tilts : poses, shape (n, 3), mm, and (n, 2), rad.
    """
    local = in_magnet_frame(np.tile(point, (len(shifts), 1)), design, shifts, tilts)
    beside = np.maximum(np.hypot(local[:, 0], local[:, 1]) - design.magnet_diameter / 2, 0.0)
    return np.asarray(np.hypot(beside, np.maximum(np.abs(local[:, 2]) - design.magnet_height / 2, 0.0)))


def wall_gaps(design: Design, point: Vector, shifts: Array) -> Array:
    """Return the distances of a point, mm, from the beam's estimated wall, shape (n,), mm; negative inside.

    The distance from a point in the base, z < 0, is measured horizontally. It is infinite for a point directly below
    the beam at rest, which the beam covers in any pose. It is NaN where an upright magnet would reach below the base
    plane: no beam has this pose.

    shifts : shape (n, 3), mm.
    """
    if point[2] < 0 and math.hypot(point[0], point[1]) <= design.R:
        return np.full(len(shifts), math.inf)
    x, y, z = shifts.T
    # at the lowest pose of the workspace the magnet stands on the base: rounding must not hide its wall
    height = np.where(design.H + z < design.magnet_height / 2 - 1e-9 * design.H, np.nan, design.H + z)
    return wall_distance(design.R, design.H, np.array(point), np.stack([x, y, height], axis=1))


def wall_distance(R: ArrayLike, H: ArrayLike, point: Array, centre: Array) -> Array:
    """Return the distances of points from the estimated walls of beams, mm; all arrays broadcast.

    Parameters
    ----------
    R, H : radius of the beam, and height of the magnet's centre at rest, shape (...), mm.
    point, centre : the point, and where the magnet's centre is, from the centre of the base, shape (..., 3), mm.
    """
    # the wall is sampled along the axis
    t = np.linspace(0, 1, 101)
    x, y, height = (centre[..., k, None] for k in range(3))
    a, b, up = (point[..., k, None] for k in range(3))
    aside = np.hypot(a - t * x, b - t * y)
    above = np.where(up > 0, t * height - up, 0.0)
    # beyond three times the height the estimate has no radius at mid-height
    share = np.asarray(H)[..., None] / height - 1
    radius = np.asarray(R)[..., None] * np.sqrt(np.maximum(1 + 6 * t * (1 - t) * share, 0.0))
    return np.asarray((np.hypot(aside, above) - radius).min(axis=-1))


def warnings(
    design: Design, shift: Vector, tilt: tuple[float, float], elements: Sequence[Element] | None = None
) -> list[str]:
    """Return one sentence for each collision of the magnet or the beam with an element or the base.

    Where the wall is unknown (NaN) a sentence says so, but for poses that no press reaches.
    """
    sentences = []
    low = float(lowest_point(design, tilt)) + design.H + shift[2]
    if low < 0:
        sentences.append(
            f"the magnet's lowest point is {-low:.3g} mm below the base plane: no press reaches this pose"
        )
    chosen = of_design(design) if elements is None else elements
    # the three axes of a chip have one position, which needs one sentence: the first axis names it
    shifts, tilts = np.array([shift]), np.array([tilt])
    for element in {element.position: element for element in reversed(chosen)}.values():
        (gap,) = magnet_gaps(design, element.position, shifts, tilts)
        if gap < element.plate / 2 or gap == 0:
            sentences.append(f"{element.name} touches or overlaps the magnet (gap {gap:.3g} mm)")
        (gap,) = wall_gaps(design, element.position, shifts)
        if gap < 0:
            beside = "raise f" if design.hall_layout == "three" else "raise l0 or chip_x"
            remedy = beside if math.hypot(*element.position[:2]) > 0 else "raise l0"
            verb = "extends over" if element.position[2] < 0 else "overlaps"
            sentences.append(f"the beam's wall {verb} {element.name} by about {-gap:.3g} mm: {remedy}")
        elif math.isnan(gap) and not low < 0:
            sentences.append(
                f"whether the beam's wall touches {element.name} is not known: an upright magnet would reach below "
                "the base plane here"
            )
    return sentences


def lowest_point(design: Design, tilt: ArrayLike) -> Array:
    """Return the height of the magnet's lowest point above its centre, mm, negative, for tilts (..., 2), rad."""
    rotation = np.asarray(tilt, dtype=np.float64)
    angle = np.hypot(rotation[..., 0], rotation[..., 1])
    a, b = design.magnet_diameter / 2, design.magnet_height / 2
    return np.asarray(-(a * np.abs(np.sin(angle)) + b * np.abs(np.cos(angle))))
