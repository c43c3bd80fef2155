"""The exact surfaces of the beam and of its magnet: distances, normals and closest points.

All lengths are in the unit of the `Shape` that is passed in. Points have shape (3, n).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from geometry.design import Shape

Masks = dict[str, NDArray[np.bool_]]


@dataclass(frozen=True, slots=True)
class Near:
    """The position of points, shape (3, ...), relative to a surface.

    Attributes
    ----------
    distance : signed distance from the surface, positive outside, shape (...).
    normal : outward unit normals at the closest points of the surface, shape (3, ...).
    curvature : sum of the two principal curvatures of the parallel surface through the point, shape (...).
    """

    distance: Array
    normal: Array
    curvature: Array


def skin(x: Array, shape: Shape) -> Near:
    """Return the position of points, shape (3, ...), relative to the skin: side and dome of the beam."""
    rise = np.maximum(x[2] - shape.H, 0)
    arm = np.stack([x[0], x[1], rise])
    length = np.linalg.norm(arm, axis=0)
    divisor = np.where(length > 0, length, 1.0)  # points on the axis have no normal: avoid a division by 0
    return Near(length - shape.R, arm / divisor, np.where(rise > 0, 2, 1) / divisor)


def magnet(x: Array, shape: Shape) -> Near:
    """Return the position of points, shape (3, ...), relative to the magnet with its rounded edges."""
    # a point is closer by rho to the rounded cylinder than to a sharp cylinder that is smaller by rho on all sides
    rho = shape.magnet_edge_radius
    r, up = np.hypot(x[0], x[1]), x[2] - shape.H
    dr, dz = r - (shape.magnet_diameter / 2 - rho), np.abs(up) - (shape.magnet_height / 2 - rho)
    out = np.hypot(np.maximum(dr, 0), np.maximum(dz, 0))
    whole = np.where(out > 0, out, 1.0)
    normal_r = np.where(out > 0, np.maximum(dr, 0) / whole, dr > dz)
    normal_z = np.where(out > 0, np.maximum(dz, 0) / whole, dr <= dz) * np.where(up < 0, -1, 1)
    across = normal_r / np.where(r > 0, r, 1.0)
    distance = out + np.minimum(np.maximum(dr, dz), 0) - rho
    curvature = across + np.where((dr > 0) & (dz > 0), 1 / whole, 0.0)
    return Near(distance, np.stack([x[0] * across, x[1] * across, normal_z]), curvature)


def side(x: Array, shape: Shape) -> Near:
    """Return the position of points, shape (3, ...), relative to the magnet's cylindrical side."""
    r = np.hypot(x[0], x[1])
    return Near(r - shape.magnet_diameter / 2, np.stack([x[0] / r, x[1] / r, np.zeros_like(r)]), 1 / r)


def project(x: Array, on: Masks, shape: Shape, ring: tuple[float, float] = (0.0, 0.0)) -> Array:
    """Return the points moved to the closest points of the surfaces to which they belong.

    Parameters
    ----------
    x : points, shape (3, n).
    on : masks (n,) of the points on "base", "skin", "symmetry", "magnet", on its sharp "edge", and on the "ring".
    ring : radius and height of the ring.
    """
    x = x.copy()
    # surfaces first, lines last: points of the ring and of a sharp edge then lie on them exactly
    if "symmetry" in on:
        x[1, on["symmetry"]] = 0
    x[2, on["base"]] = 0
    for name, surface in (("skin", skin), ("magnet", magnet)):
        if name in on:
            near = surface(x[:, on[name]], shape)
            x[:, on[name]] -= near.distance * near.normal
    if "ring" in on:
        x[:2, on["ring"]] *= ring[0] / np.hypot(*x[:2, on["ring"]])
        x[2, on["ring"]] = ring[1]
    if "edge" in on:
        edge = on["edge"]
        x[:2, edge] *= shape.magnet_diameter / 2 / np.hypot(*x[:2, edge])
        x[2, edge] = shape.H + np.sign(x[2, edge] - shape.H) * shape.magnet_height / 2
    return x
