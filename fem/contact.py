"""Contact with a flat rigid plate, gluing and gripping, at the quadrature points of the skin.

The plate's lower face is the plane z = z_p. A skin point at z = Z + u_z overlaps it by g = z - z_p, and the plate
pushes back with a pressure en <g> per reference area (energy en <g>^2 / 2: the force is the derivative of an
energy). A glued point keeps its normal spring for both signs of g and gains a tangential spring towards a target
that moves with the plate; a gripped point has the tangential spring alone. Glued is every point within the contact
radius, rather than every point with g > 0: on a coarse mesh some points inside the patch hang a little.

With en = KAPPA E / a, where a = sqrt(R d) is the radius at which the undeformed tip would cut the plate, the
overlap is about 0.57 d / KAPPA on a Hertz contact: the force comes out 0.85 / KAPPA too small, whatever the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.elements import Surface

Array = NDArray[np.float64]

KAPPA = 3000.0


@dataclass(frozen=True, slots=True)
class Plate:
    """Where the plate is and which skin points are tied to it.

    Attributes
    ----------
    height : z of the plate, or None where there is no plate (grip).
    stiffness : penalty, force per area and length.
    shear : (dim - 1,) sideways motion of plate or grip since the points were tied.
    tied : (k, q) mask of the tied quadrature points, or None.
    targets : (k, q, dim - 1) tangential positions of the tied points at shear 0.
    gap : (k, q) distance to the plate at which each tied point was glued (0 where it was pressed).
    pressed : (k, q) mask of the points that count as pressed whatever their overlap, or None to go by the overlap.
    """

    height: float | None
    stiffness: float
    shear: Array
    tied: NDArray[np.bool_] | None = None
    targets: Array | None = None
    gap: Array | None = None
    pressed: NDArray[np.bool_] | None = None


def positions(surface: Surface, u: Array) -> Array:
    """Deformed positions of the skin's quadrature points, shape (k, q, dim), for nodal displacements (n, dim)."""
    return np.asarray(surface.points + surface.shape @ u[surface.nodes])


def overlap(surface: Surface, u: Array, plate: Plate) -> Array:
    """Signed overlap with the plate, shape (k, q); the small difference is formed before u is added."""
    if plate.height is None:
        return np.full(surface.weights.shape, -np.inf)
    rest = surface.points[..., -1] - plate.height
    return np.asarray(rest + u[surface.nodes, -1] @ surface.shape.T)


def traction(surface: Surface, u: Array, plate: Plate) -> tuple[Array, Array, float]:
    """Force of the plate's springs on the skin per reference area.

    Returns
    -------
    residual : (k, q, dim) minus that traction, that is the derivative of the springs' energy by u.
    stiffness : (k, q, dim) its diagonal derivative.
    energy : integral over the skin.
    """
    residual = np.zeros(surface.points.shape)
    stiffness = np.zeros_like(residual)
    en, last = plate.stiffness, surface.points.shape[-1] - 1
    if plate.height is not None:
        g = overlap(surface, u, plate)
        active = g > 0 if plate.pressed is None else plate.pressed
        if plate.tied is not None and plate.gap is not None:
            active = active | plate.tied
            g = np.where(plate.tied, g + plate.gap, g)
        residual[..., last] = np.where(active, en * g, 0.0)
        stiffness[..., last] = np.where(active, en, 0.0)
    if plate.tied is not None and plate.targets is not None:
        x = positions(surface, u)[..., :last]
        pull = en * (x - plate.targets - plate.shear)
        residual[..., :last] = np.where(plate.tied[..., None], pull, 0.0)
        stiffness[..., :last] = np.where(plate.tied[..., None], en, 0.0)
    energy = float(np.sum(surface.weights[..., None] * residual**2) / (2 * en))
    return residual, stiffness, energy


def from_pressure_centre(surface: Surface, u: Array, plate: Plate) -> Array:
    """Distance of the skin's points from the centre of pressure, along the plate, shape (k, q)."""
    x = positions(surface, u)
    if x.shape[-1] == 2:
        return np.abs(x[..., 0])
    load = surface.weights * np.maximum(overlap(surface, u, plate), 0.0)
    return np.hypot(x[..., 0] - np.sum(load * x[..., 0]) / np.sum(load), x[..., 1])


def contact_radius(surface: Surface, u: Array, plate: Plate) -> float:
    """Radius of the patch in contact, from the opening of the gap around it.

    Beside a smooth contact the gap opens as (r - a)^(3/2), so gap^(2/3) is smooth there: a quadratic in r through
    the points of the dome between a + 0.05 w and a + 0.35 w, w = min(a, 0.6 R), is followed to its zero. That is
    far less sensitive to the mesh than the last point under pressure. r is the distance from the centre of
    pressure, over all directions: the patch of a sheared tip is answered by its mean radius.
    """
    g = overlap(surface, u, plate)
    pressed = g > 0
    if not pressed.any():
        return 0.0
    r = from_pressure_centre(surface, u, plate)
    outermost = radius = float(r[pressed].max())
    reach = float(surface.points[..., 0].max())
    ahead = np.hypot(surface.points[..., 0], surface.points[..., -1] - surface.points[..., -1].max()) < 1.4 * reach
    for _ in range(4):
        width = min(radius, 0.6 * reach)
        around = ~pressed & (r > radius + 0.05 * width) & (r < radius + 0.35 * width) & ahead
        if np.count_nonzero(around) < 4:
            return outermost
        opening = (-g[around]) ** (2 / 3)
        a2, a1, a0 = np.polyfit(r[around] / radius - 1, opening / opening.max(), 2)
        root = -2 * a0 / (a1 + np.sqrt(max(a1 * a1 - 4 * a2 * a0, 0.0)))
        if not abs(root) < 0.5:
            return outermost
        radius *= 1 + float(root)
    return radius
