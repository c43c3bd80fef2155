"""Contact with a flat rigid plate, gluing and gripping, at the integration points of the skin.

The plate's lower face passes through (0, 0, height) and its normal n points into the plate, z unless it is tilted. A
skin point at x overlaps it by g = n . x - n . (0, 0, height), and the plate pushes back with a pressure en <g> per
reference area (energy en <g>^2 / 2: the force is the derivative of an energy). A glued point keeps its normal spring
for both signs of g and gains a tangential spring towards a target that moves with the plate; a gripped point has the
tangential spring alone. Glued is every point within the contact radius, rather than every point with g > 0: on a
coarse mesh some points inside the patch hang a little. Coulomb friction is in `fem.contact.coulomb_friction`; it has
no energy, so that the force is the derivative of one only where every point sticks.

With en = kappa E / a, where a = sqrt(R d) is the radius at which the undeformed tip would cut the plate, the
overlap is about 0.57 d / kappa on a Hertz contact: the force comes out 0.85 / kappa too small, whatever the depth.

The springs must also be stiff beside the elements of the skin. An element of edge h resists with a stiffness of about
E / h per area; where en h is not large beside the pressure p over E, the pressure acts on the skin like a load of
fixed direction, under which it wrinkles: elements lose stability, and the body does not. On sections that were graded
to smaller depths this was found from en h = 0.3 (p = 0.3 E), 3 (0.5 E), 17 (0.9 E) and 60 (1.3 E) on. SECTION_KAPPA
keeps en h above 100 on the sections of all accuracy levels, down to 0.55 D. Tetrahedra are larger; and with Coulomb
friction stiffer springs would cost steps.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.contact import coulomb_friction
from fem.contact.coulomb_friction import Friction
from fem.discretisation.elements import Surface
from geometry.arrays import Array

KAPPA, SECTION_KAPPA = 3e3, 3e4
"""Numbers kappa of tetrahedra and of Coulomb friction, and of all else on sections."""
SETTLED = 1e-9
"""Relative change of a radius that ends its search."""


@dataclass(frozen=True, slots=True)
class Plate:
    """Where the plate is and which skin points are tied to it.

    Attributes
    ----------
    height : z at which the plate meets the axis, or None where there is no plate (grip).
    stiffness : penalty, force per area and length.
    shear : (2,) sideways motion of plate or grip since the points were tied, in the plate's own plane.
    tilt : rotation of the plate about y that carries its normal from z towards x, rad.
    tied : (k, q) mask of the tied points, or None.
    targets : (k, q, 2) positions of the tied points along the plate at shear 0.
    gap : (k, q) distance to the plate at which each tied point was glued (0 where it was pressed).
    pressed : (k, q) mask of the points that count as pressed whatever their overlap, or None to go by the overlap;
        with friction they also slip or stick as they did last.
    friction : Coulomb friction and its history, or None.
    """

    height: float | None
    stiffness: float
    shear: Array
    tilt: float = 0.0
    tied: NDArray[np.bool_] | None = None
    targets: Array | None = None
    gap: Array | None = None
    pressed: NDArray[np.bool_] | None = None
    friction: Friction | None = None

    @property
    def frame(self) -> Array:
        """Rows: the two directions along the plate, and its normal."""
        return _frame(self.tilt)


@functools.lru_cache
def _frame(tilt: float) -> Array:
    s, c = np.sin(tilt), np.cos(tilt)
    frame = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    frame.flags.writeable = False
    return frame


def along(surface: Surface, u: Array, plate: Plate) -> Array:
    """Deformed positions of the skin's points along the plate, shape (k, q, 2), for nodal fields u."""
    return np.asarray((surface.points + surface.displacement(u)) @ plate.frame[:2].T)


def slid(surface: Surface, u: Array, plate: Plate) -> Array:
    """Displacements of the skin's points along the plate less the plate's own, shape (k, q, 2)."""
    return np.asarray(surface.displacement(u) @ plate.frame[:2].T - plate.shear)


def overlap(surface: Surface, u: Array, plate: Plate) -> Array:
    """Signed overlap with the plate, shape (k, q); the small difference is formed before u is added."""
    if plate.height is None:
        return np.full(surface.weights.shape, -np.inf)
    n = plate.frame[2]
    rest = n[2] * (surface.points[..., 2] - plate.height)
    if n[0]:
        rest = rest + n[0] * surface.points[..., 0]
    return np.asarray(rest + surface.displacement(u) @ n)


Stiffness = dict[tuple[int, int], NDArray[np.floating]]
"""Entries (k, q) of the matrices (3, 3) of points of the skin that can differ from zero."""


def traction(surface: Surface, u: Array, plate: Plate) -> tuple[Array, Stiffness, float]:
    """Force of the plate's springs on the skin per reference area.

    Returns
    -------
    residual : (k, q, 3) minus that traction, that is the derivative of the springs' energy by the displacement.
    stiffness : its derivative in the plate's frame, unsymmetric where points slip.
    energy : integral over the skin of what the springs store.
    """
    residual, stiffness = np.zeros(surface.points.shape), Stiffness()
    en, energy = plate.stiffness, 0.0
    if plate.height is not None:
        g = overlap(surface, u, plate)
        active = g > 0 if plate.pressed is None else plate.pressed
        if plate.tied is not None and plate.gap is not None:
            active = active | plate.tied
            g = np.where(plate.tied, g + plate.gap, g)
        pressure = residual[..., 2] = en * g * active
        stiffness[2, 2] = en * active
        energy = float(np.vdot(surface.weights * pressure, pressure)) / (2 * en)
    if plate.tied is not None and plate.targets is not None:
        pull = en * (along(surface, u, plate) - plate.targets - plate.shear)
        residual[..., :2] = np.where(plate.tied[..., None], pull, 0.0)
        stiffness[0, 0] = stiffness[1, 1] = en * plate.tied
        energy += float(np.sum(surface.weights[..., None] * residual[..., :2] ** 2) / (2 * en))
    if plate.friction is not None:
        et, frozen = coulomb_friction.STICK * en, plate.pressed is not None
        rub = coulomb_friction.drag(
            plate.friction, slid(surface, u, plate), residual[..., 2], active, et, frozen=frozen
        )
        residual[..., :2] = rub.traction
        for i, j in np.ndindex(2, 2):
            stiffness[i, j] = rub.by_place[..., i, j]
        for i in range(2):
            stiffness[i, 2] = en * rub.by_pressure[..., i]
        energy += float(np.sum(surface.weights[..., None] * rub.traction**2) / (2 * et))
    return residual @ plate.frame, stiffness, energy


def base_traction(surface: Surface, u: Array, stiffness: float) -> tuple[Array, Array] | None:
    """Force per reference area of the base z = 0 on skin that bulges below it, and its derivative, (k, q), by u_z.

    None where nothing does. The base is wider than the beam and frictionless there; without it a deep press would
    fold the skin at the clamp.
    """
    depth = surface.points[..., 2] + surface.displacement(u)[..., 2]
    below = depth < 0
    return (np.where(below, stiffness * depth, 0.0), np.where(below, stiffness, 0.0)) if below.any() else None


def rubbed(surface: Surface, u: Array, plate: Plate) -> tuple[Friction, float]:
    """History of friction after a converged step to this plate, and the energy dissipated in it."""
    assert plate.friction is not None
    en = plate.stiffness
    pressure = en * overlap(surface, u, plate)
    after, lost = coulomb_friction.advanced(
        plate.friction, slid(surface, u, plate), pressure, coulomb_friction.STICK * en
    )
    return after, float(np.sum(surface.weights * lost))


def watched(surface: Surface | None, u: Array, plate: Plate | None) -> tuple[Plate | None, bool]:
    """The plate for Newton's next iterate, and whether friction held points at this one: see `friction.heading`."""
    if surface is None or plate is None or plate.friction is None:
        return plate, False
    pressure = plate.stiffness * overlap(surface, u, plate)
    place = slid(surface, u, plate)
    after, held = coulomb_friction.heading(plate.friction, place, pressure, coulomb_friction.STICK * plate.stiffness)
    return replace(plate, friction=after), held


def springs(surface: Surface, u: Array, plate: Plate, *, tangent: bool = True) -> tuple[Array, Array, float, bool]:
    """Of plate and base: forces (k, f, fields), stiffness if wanted, energy, and whether the stiffness is symmetric.

    Stiffness: shape (k, f fields, f fields), fields first.
    """
    residual, stiffness, energy = traction(surface, u, plate)
    base = base_traction(surface, u, plate.stiffness)
    if base is not None:
        residual[..., 2] += base[0]
        energy += float(np.sum(surface.weights * base[0] ** 2) / (2 * plate.stiffness))
    forces = surface.forces(residual)
    if not tangent:
        return forces, np.zeros((len(forces), 0, 0)), energy, True
    blocks = surface.stiffness(stiffness, plate.frame)
    if base is not None:
        blocks += surface.stiffness({(2, 2): base[1]}, np.eye(3))
    slips = plate.friction is not None and not all(
        np.array_equal(C, stiffness.get((j, i), 0 * C)) for (i, j), C in stiffness.items()
    )
    return forces, blocks, energy, not slips


def whole_facets(values: Array) -> Array:
    """The mean of a facet's values (k, q) at all its points: a patch is made of whole facets.

    A facet that is tied in part follows the plate as a whole, so that the patch would be too large.
    """
    return np.broadcast_to(values.mean(axis=1, keepdims=True), values.shape)


def glued(surface: Surface, u: Array, plate: Plate, radius: float | None, above: float) -> Plate:
    """The plate with the facets glued to it whose middle lies within an undeformed radius, and above a height.

    Without a radius: within the contact radius about the centre of pressure.
    """
    out = np.hypot(surface.points[..., 0], surface.points[..., 1])
    if radius is None:
        out, radius = from_pressure_centre(surface, u, plate), contact_radius(surface, u, plate)
    tied = (whole_facets(out) < radius) & (surface.points[..., 2] > above)
    gap = np.maximum(-overlap(surface, u, plate), 0.0)
    return replace(plate, tied=tied, targets=along(surface, u, plate), gap=gap)


def from_pressure_centre(surface: Surface, u: Array, plate: Plate) -> Array:
    """Distance of the skin's points from the centre of pressure, along the plate, shape (k, q).

    Where the surface is half a skin or one angle of it, the centre lies in its mirror plane or on its axis.
    """
    x = along(surface, u, plate)
    load = surface.weights * np.maximum(overlap(surface, u, plate), 0.0)
    whole = (surface.points[..., 0].min() < 0, surface.points[..., 1].min() < -1e-9)
    centre = [float(np.sum(load * x[..., i]) / np.sum(load)) if whole[i] else 0.0 for i in range(2)]
    return np.hypot(x[..., 0] - centre[0], x[..., 1] - centre[1])


def material_radius(surface: Surface, u: Array, plate: Plate, radius: float) -> float:
    """Undeformed radius of the skin's points that have come to a distance `radius` from the axis of a press."""
    out = np.hypot(surface.points[..., 0], surface.points[..., 1]).ravel()
    now = np.linalg.norm(along(surface, u, plate), axis=-1).ravel()
    dome = np.flatnonzero(surface.points[..., 2].ravel() > surface.points[..., 2].max() - out.max())
    order = dome[np.argsort(out[dome])]
    ahead = np.maximum.accumulate(now[order])
    return float(np.interp(radius, ahead, out[order]))


def contact_radius(surface: Surface, u: Array, plate: Plate) -> float:
    """Radius of the patch in contact, from the opening of the gap around it.

    Beside a smooth contact the gap opens as (r - a)^(3/2), so gap^(2/3) is smooth there: a quadratic in r through
    the points of the dome between a + 0.05 w and a + 0.35 w, w = min(a, 0.6 R), is followed to its zero. That is
    far less sensitive to the mesh than the last point under pressure. r is the distance from the centre of
    pressure, over all directions. For the patch of a sheared tip see `patch_radius`.

    Where too few points lie there, the radius is that of a Hertz contact with the second moment of the pressure,
    a^2 = 5/2 int p r^2 dA / int p dA: within 1 % up to a = D/4, 2 % too small at 0.43 D.
    """
    g = overlap(surface, u, plate)
    pressed = g > 0
    if not pressed.any():
        return 0.0
    r = from_pressure_centre(surface, u, plate)
    radius, load = float(r[pressed].max()), surface.weights * np.maximum(g, 0.0)
    by_moment = math.sqrt(2.5 * np.vdot(load, r**2) / load.sum())
    out = np.hypot(surface.points[..., 0], surface.points[..., 1])
    reach = float(out.max())
    ahead = np.hypot(out, surface.points[..., 2] - surface.points[..., 2].max()) < 1.4 * reach
    for _ in range(4):
        width = min(radius, 0.6 * reach)
        around = ~pressed & (r > radius + 0.05 * width) & (r < radius + 0.35 * width) & ahead
        near = r[around]
        if len(set(near.round(9).tolist())) < 4:
            return by_moment
        opening = (-g[around]) ** (2 / 3)
        a2, a1, a0 = np.linalg.lstsq(np.vander(near / radius - 1, 3), opening / opening.max(), rcond=None)[0]
        root = -2 * a0 / (a1 + np.sqrt(max(a1 * a1 - 4 * a2 * a0, 0.0)))
        if not abs(root) < 0.5:
            return by_moment
        radius *= 1 + float(root)
        if abs(root) < SETTLED:
            break
    return radius


def patch_radius(surface: Surface, u: Array, plate: Plate) -> float:
    """Radius of the circle with the area of the patch under pressure, which is not round once the tip is sheared.

    The area is that of the convex hull of the points' places on the plate; half a skin has its mirror image beside.
    """
    from scipy.spatial import ConvexHull, QhullError

    x = along(surface, u, plate)[overlap(surface, u, plate) > 0]
    if surface.points[..., 1].min() > -1e-9:
        x = np.concatenate([x, x * [1, -1]])
    try:
        return float(np.sqrt(ConvexHull(x).volume / np.pi)) if len(x) > 2 else 0.0
    except QhullError:  # all on one line
        return 0.0
