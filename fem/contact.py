"""Contact with a flat rigid plate, gluing and gripping, at the quadrature points of the skin.

The plate's lower face is the plane z = z_p. A skin point at z = Z + u_z overlaps it by g = z - z_p, and the plate
pushes back with a pressure en <g> per reference area (energy en <g>^2 / 2: the force is the derivative of an
energy). A glued point keeps its normal spring for both signs of g and gains a tangential spring towards a target
that moves with the plate; a gripped point has the tangential spring alone.

With en = KAPPA E / a, where a = sqrt(R d) is the radius at which the undeformed tip would cut the plate, the
overlap is about 0.57 d / KAPPA on a Hertz contact: the force comes out 0.85 / KAPPA too small, whatever the depth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem.elements import Elements, Surface

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
    pressed : (k, q) mask of the points that count as pressed whatever their overlap, or None to go by the overlap.
    """

    height: float | None
    stiffness: float
    shear: Array
    tied: NDArray[np.bool_] | None = None
    targets: Array | None = None
    pressed: NDArray[np.bool_] | None = None


def positions(surface: Surface, elements: Elements, u: Array) -> Array:
    """Deformed positions of the skin's quadrature points, shape (k, q, dim), for nodal displacements (n, dim)."""
    return np.asarray(surface.points + surface.shape @ u[elements.cells[surface.cell]])


def overlap(surface: Surface, elements: Elements, u: Array, plate: Plate) -> Array:
    """Signed overlap with the plate, shape (k, q); the small difference is formed before u is added."""
    if plate.height is None:
        return np.full(surface.weights.shape, -np.inf)
    rest = surface.points[..., -1] - plate.height
    return np.asarray(rest + (surface.shape @ u[elements.cells[surface.cell], -1][..., None])[..., 0])


def traction(surface: Surface, elements: Elements, u: Array, plate: Plate) -> tuple[Array, Array, float]:
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
        g = overlap(surface, elements, u, plate)
        active = g > 0 if plate.pressed is None else plate.pressed
        if plate.tied is not None:
            active = active | plate.tied
        residual[..., last] = np.where(active, en * g, 0.0)
        stiffness[..., last] = np.where(active, en, 0.0)
    if plate.tied is not None and plate.targets is not None:
        x = positions(surface, elements, u)[..., :last]
        pull = en * (x - plate.targets - plate.shear)
        residual[..., :last] = np.where(plate.tied[..., None], pull, 0.0)
        stiffness[..., :last] = np.where(plate.tied[..., None], en, 0.0)
    energy = float(np.sum(surface.weights[..., None] * residual**2) / (2 * en))
    return residual, stiffness, energy


def contact_radius(surface: Surface, elements: Elements, u: Array, plate: Plate) -> float:
    """Radius of the patch in contact, from the zero of the pressure.

    Axisymmetric: the overlap is interpolated along the deformed skin between the last point inside and the first
    one outside. Solid: radius of the disc (or half disc) of the same deformed area, each facet counted by the
    fraction of its quadrature weight that overlaps.
    """
    g = overlap(surface, elements, u, plate)
    if not (g > 0).any():
        return 0.0
    x = positions(surface, elements, u)
    if x.shape[-1] == 2:
        r, gap = x[..., 0].ravel(), g.ravel()
        last = int(np.argmax(np.where(gap > 0, r, -np.inf)))
        beyond = np.where((gap <= 0) & (r > r[last]), r, np.inf)
        first = int(np.argmin(beyond))
        if not np.isfinite(beyond[first]):
            return float(r[last])
        return float(r[last] + (r[first] - r[last]) * gap[last] / (gap[last] - gap[first]))
    area = float(np.sum(surface.weights[g > 0]))
    return float(np.sqrt(2 * area / np.pi))
