"""Contact with a flat rigid plate, gluing and gripping, at the integration points of the skin.

The plate's lower face passes through (0, 0, height). Its normal n points into the plate: z, unless the plate is
tilted. A skin point at x overlaps the plate by g = n . x - n . (0, 0, height), and the plate pushes back with a
pressure en <g> per reference area. This is a penalty method: the force is the derivative of the energy en <g>^2 / 2.
A glued point keeps its normal spring for both signs of g and gains a tangential spring towards a target that moves
with the plate. A gripped point has the tangential spring alone. All points within the contact radius are glued, not
only those with g > 0, because on a coarse mesh some points inside the contact area are slightly off the plate.
Coulomb friction is in `fem.model.coulomb_friction`. It has no energy, so the force is the derivative of an energy
only while every point sticks.

The stiffness is en = kappa E / a, where a = sqrt(R d) is the radius at which the undeformed tip would cut the plate
at depth d. In a Hertz contact the overlap is then about 0.57 d / kappa, and at any depth the force is too small by
the share 0.85 / kappa.

The springs must also be stiff compared with the elements of the skin. An element of edge length h resists with a
stiffness of about E / h per area. Where en h / E is not large beside p / E (p the pressure), the pressure acts on the
skin like a load of fixed direction, under which the skin wrinkles: single elements become unstable although the body
is stable. On sections graded to smaller depths this began at en h / E = 0.3 (p = 0.3 E), 3 (0.5 E), 17 (0.9 E) and 60
(1.3 E). SECTION_KAPPA keeps en h / E above 100 on the sections of all accuracy levels, up to a depth of 0.55 D.
Tetrahedra are larger, so KAPPA is enough for them; with Coulomb friction stiffer springs would need more load steps.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import coulomb_friction
from fem.model.coulomb_friction import Friction, FrictionTraction
from fem.model.elements import SAME_PLACE, Surface
from geometry.arrays import Array, Mask, read_only

KAPPA = 3e3
SECTION_KAPPA = 10 * KAPPA
"""Stiffness numbers kappa, see the module docstring: KAPPA for tetrahedra and for Coulomb friction, SECTION_KAPPA for
all other sections."""
LARGEST_GLUED_GAP = 0.0025
"""Largest distance from a tilted plate at which a section is glued, over the depth. With 0 and with 0.005 the forces
of glued shears at level quick differ from finer sections and from tetrahedra by up to 1.7 %, in opposite
directions."""


@dataclass(frozen=True, slots=True)
class Bond:
    """Points of the skin that a grip holds or that are glued to the plate.

    tied : (k, q) mask of these points.
    targets : (k, q, 2) their positions along the plate at shear 0.
    gap : (k, q) distance to the plate at which each was glued, 0 where it was pressed; None for a grip.
    """

    tied: Mask
    targets: Array
    gap: Array | None = None


@dataclass(frozen=True, slots=True)
class Plate:
    """Position of the plate, and the skin points tied to it.

    height : z at which the plate meets the axis, over D; None where there is no plate (grip).
    stiffness : penalty stiffness en, force per area and length, in units of E / D.
    shear : (2,) sideways displacement of the plate or grip since the points were tied, in the plate's plane, over D.
    tilt : rotation of the plate about y that carries its normal from z towards x, rad.
    bond : the tied points, or None.
    pressed : (k, q) mask of the points that count as pressed, whatever their overlap; with friction these points also
        keep slipping or sticking as they did last. Default: the points with g > 0.
    friction : Coulomb friction and its history, or None.
    """

    height: float | None
    stiffness: float
    shear: Array
    tilt: float = 0.0
    bond: Bond | None = None
    pressed: Mask | None = None
    friction: Friction | None = None

    @property
    def frame(self) -> Array:
        """(3, 3) directions as rows: the two along the plate, and its normal."""
        return _frame(self.tilt)


@functools.lru_cache
def _frame(tilt: float) -> Array:
    s, c = np.sin(tilt), np.cos(tilt)
    return read_only(np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]))


def positions_along_plate(surface: Surface, u: Array, plate: Plate) -> Array:
    """Return the deformed positions of the skin's points along the plate, shape (k, q, 2), for nodal fields u."""
    x = surface.points + surface.displacement(u)
    return np.asarray(x @ plate.frame[:2].T) if plate.tilt else x[..., :2]


def displacements_along_plate(surface: Surface, u: Array, plate: Plate) -> Array:
    """Return the displacements of the skin's points along the plate relative to it, shape (k, q, 2)."""
    return np.asarray(surface.displacement(u) @ plate.frame[:2].T - plate.shear)


def overlap(surface: Surface, u: Array, plate: Plate) -> Array:
    """Return the signed overlap g of the skin's points with the plate, shape (k, q).

    The height above the plate is subtracted before u is added: both are near L, and u may be a nanometre.
    """
    if plate.height is None:
        return np.full(surface.weights.shape, -np.inf)
    if not plate.tilt:
        return np.asarray(surface.points[..., 2] - plate.height + surface.displacement(u)[..., 2])
    n = plate.frame[2]
    rest = n[2] * (surface.points[..., 2] - plate.height) + n[0] * surface.points[..., 0]
    return np.asarray(rest + surface.displacement(u) @ n)


Stiffness = dict[tuple[int, int], NDArray[np.floating]]
"""Entries (i, j) of the (3, 3) stiffness matrices of the skin's points, shape (k, q) each; absent entries are
zero."""


@dataclass(frozen=True, slots=True)
class Springs:
    """Tractions of the plate's springs at a trial state.

    traction : (k, q, 3) derivative of the springs' energy by the displacement, that is, minus the force on the skin
        per reference area.
    stiffness : its derivative in the plate's frame; unsymmetric where points slip.
    energy : stored in the springs, integrated over the skin.
    pressed : (k, q) mask of the points with a spring along the normal, apart from tied ones.
    friction : tractions of Coulomb friction, or None.
    """

    traction: Array
    stiffness: Stiffness
    energy: float
    pressed: Mask
    friction: FrictionTraction | None = None


def springs(surface: Surface, u: Array, plate: Plate) -> Springs:
    """Return the tractions of the plate's springs for nodal fields u."""
    residual, stiffness = np.zeros(surface.points.shape), Stiffness()
    en, bond, energy = plate.stiffness, plate.bond, 0.0
    pressed = active = np.zeros(surface.weights.shape, dtype=bool)
    if plate.height is not None:
        g = overlap(surface, u, plate)
        pressed = active = g > 0 if plate.pressed is None else plate.pressed
        # a glued point keeps the distance that it had when it was glued, and can be pulled
        if bond is not None and bond.gap is not None:
            active = active | bond.tied
            g = np.where(bond.tied, g + bond.gap, g)
        pressure = residual[..., 2] = en * g * active
        stiffness[2, 2] = en * active
        energy = float(np.vdot(surface.weights * pressure, pressure)) / (2 * en)
    if bond is not None:
        pull = en * (positions_along_plate(surface, u, plate) - bond.targets - plate.shear)
        residual[..., :2] = np.where(bond.tied[..., None], pull, 0.0)
        stiffness[0, 0] = stiffness[1, 1] = en * bond.tied
        energy += float(np.sum(surface.weights[..., None] * residual[..., :2] ** 2) / (2 * en))
    friction = None
    if plate.friction is not None:
        et, frozen = coulomb_friction.STICK * en, plate.pressed is not None
        friction = coulomb_friction.apply_return_map(
            plate.friction, displacements_along_plate(surface, u, plate), residual[..., 2], active, et, frozen=frozen
        )
        residual[..., :2] = friction.traction
        for i, j in np.ndindex(2, 2):
            stiffness[i, j] = friction.by_displacement[..., i, j]
        for i in range(2):
            stiffness[i, 2] = en * friction.by_pressure[..., i]
        energy += float(np.sum(surface.weights[..., None] * friction.traction**2) / (2 * et))
    return Springs(residual @ plate.frame if plate.tilt else residual, stiffness, energy, pressed, friction)


def resultant(surface: Surface, u: Array, plate: Plate) -> Array:
    """Return the integral (3,) of the traction of the plate's springs."""
    return np.asarray(np.einsum("kq,kqi->i", surface.weights, springs(surface, u, plate).traction))


def advance_friction(surface: Surface, u: Array, plate: Plate) -> tuple[Friction, float]:
    """Return the history of friction after a step that converged with this plate, and the energy dissipated in it."""
    assert plate.friction is not None
    en = plate.stiffness
    pressure = en * overlap(surface, u, plate)
    after, lost = coulomb_friction.advance(
        plate.friction, displacements_along_plate(surface, u, plate), pressure, coulomb_friction.STICK * en
    )
    return after, float(np.sum(surface.weights * lost))


def hold_reversing_points(surface: Surface | None, u: Array, plate: Plate | None) -> tuple[Plate | None, bool]:
    """Return the plate for Newton's next iterate, and whether friction held any point at this one.

    A point that slips in one direction at an iterate and in the opposite direction at the next is held sticking for
    one iterate (`FrictionTraction.held`). The traction of a slipping point has no stiffness along the slip, so
    Newton's method would otherwise jump back and forth across the narrow range in which the point sticks.
    """
    if surface is None or plate is None or plate.friction is None:
        return plate, False
    now = springs(surface, u, replace(plate, pressed=None)).friction
    assert now is not None
    return replace(plate, friction=replace(plate.friction, slip_direction=now.direction)), now.held


def assemble_springs(
    surface: Surface, u: Array, plate: Plate, *, tangent: bool = True
) -> tuple[Array, Array, float, bool, Mask]:
    """Return the nodal forces, stiffness and energy of the springs of plate and base.

    The base z = 0 is wider than the beam, and frictionless where skin bulges below it. Without this contact the skin
    would fold at the clamp in a deep press.

    Returns
    -------
    forces : (k, f, fields) forces on the nodes of each facet.
    stiffness : (k, f, fields, f, fields) matrices; empty without `tangent`.
    energy : stored in the springs.
    symmetric : whether the stiffness is symmetric.
    pressed : see `Springs`.
    """
    plate_springs = springs(surface, u, plate)
    residual, stiffness, energy = plate_springs.traction, plate_springs.stiffness, plate_springs.energy
    depth = surface.points[..., 2] + surface.displacement(u)[..., 2]
    below = depth < 0
    if below.any():
        base = np.where(below, plate.stiffness * depth, 0.0)
        residual[..., 2] += base
        energy += float(np.sum(surface.weights * base**2) / (2 * plate.stiffness))
    forces = surface.forces(residual)
    if not tangent:
        return forces, np.empty(0), energy, True, plate_springs.pressed
    blocks = surface.stiffness(stiffness, plate.frame)
    if below.any():
        blocks += surface.stiffness({(2, 2): np.where(below, plate.stiffness, 0.0)}, np.eye(3))
    slips = plate.friction is not None and not all(
        np.array_equal(C, stiffness.get((j, i), 0 * C)) for (i, j), C in stiffness.items()
    )
    return forces, blocks, energy, not slips, plate_springs.pressed


def average_over_facets(surface: Surface, values: Array) -> Array:
    """Return values (k, q) with each point's value replaced by the mean over its facet, at each angle of a section.

    Facets must be tied as a whole. A facet tied at some points only would follow the plate almost as a whole, so the
    tied area would be too large.
    """
    lines = values.reshape(len(values), -1, surface.angles)
    return np.broadcast_to(lines.mean(axis=1, keepdims=True), lines.shape).reshape(values.shape)


def choose_glued(surface: Surface, u: Array, plate: Plate, radius: float | None, above: float) -> Mask:
    """Return the points (k, q) to glue to the plate: facets whose mean distance from the axis is below `radius`.

    Under a tilted plate a section's facets are glued, at each angle, where their mean distance from the plate is
    below LARGEST_GLUED_GAP times the depth. A few orders cannot follow the plate exactly: gluing the whole contact
    area makes the tip too stiff, and gluing only what is pressed too soft.

    radius : undeformed radius over D; None: the contact radius, measured from the centre of pressure.
    above : only points above this undeformed height, over D, are glued.
    """
    out = surface.radii
    if plate.tilt and surface.angles > 1:
        depth = float(overlap(surface, np.zeros_like(u), plate).max())
        out, radius = -overlap(surface, u, plate), LARGEST_GLUED_GAP * depth
    elif radius is None:
        out, radius = distance_from_pressure_centre(surface, u, plate), contact_radius(surface, u, plate)
    return (average_over_facets(surface, out) < radius) & (surface.points[..., 2] > above)


def bond_here(surface: Surface, u: Array, plate: Plate, tied: Mask) -> Bond:
    """Return the bond of points (k, q) that are tied to the plate where they are now."""
    targets = positions_along_plate(surface, u, plate) - plate.shear
    return Bond(tied, targets, np.maximum(-overlap(surface, u, plate), 0.0))


def distance_from_pressure_centre(surface: Surface, u: Array, plate: Plate) -> Array:
    """Return the distance of the skin's points from the centre of pressure, along the plate, shape (k, q).

    On half a skin the centre lies in the mirror plane, on a section it lies on the axis.
    """
    x, two_sided = positions_along_plate(surface, u, plate), surface.two_sided
    if not any(two_sided):
        return np.hypot(x[..., 0], x[..., 1])
    load = surface.weights * np.maximum(overlap(surface, u, plate), 0.0)
    centre = [float(np.sum(load * x[..., i]) / np.sum(load)) if two_sided[i] else 0.0 for i in range(2)]
    return np.hypot(x[..., 0] - centre[0], x[..., 1] - centre[1])


def undeformed_radius(surface: Surface, u: Array, plate: Plate, radius: float) -> float:
    """Return the undeformed radius of the skin's points that are now at a distance `radius` from a press's axis."""
    out = surface.radii.ravel()
    now = np.linalg.norm(positions_along_plate(surface, u, plate), axis=-1).ravel()
    dome = np.flatnonzero(surface.points[..., 2].ravel() > surface.points[..., 2].max() - out.max())
    order = dome[np.argsort(out[dome])]
    # interpolation needs radii that increase outwards: skin that has folded back is left out
    ahead = np.maximum.accumulate(now[order])
    return float(np.interp(radius, ahead, out[order]))


def contact_radius(surface: Surface, u: Array, plate: Plate) -> float:
    """Return the radius of the contact area, extrapolated from the gap around it.

    Outside a smooth contact of radius a the gap opens as (r - a)^(3/2), so gap^(2/3) is smooth in r. A quadratic in r
    is fitted to the points of the dome between a + 0.05 w and a + 0.35 w, w = min(a, 0.6 R), and its zero is the new
    a. That is far less sensitive to the mesh than the outermost point under pressure. r is the distance from the
    centre of pressure; points in all directions count. For the contact area of a sheared tip see `equal_area_radius`.

    Where fewer than four radii lie in that range, `gap_radius` is None, and the result is the radius of a Hertz
    contact with the same second moment of the pressure, a^2 = 5/2 int p r^2 dA / int p dA: within 1 % up to a = D/4,
    and 2 % too small at 0.43 D.
    """
    radius = gap_radius(surface, u, plate)
    return hertz_radius(surface, u, plate) if radius is None else radius


def gap_radius(surface: Surface, u: Array, plate: Plate) -> float | None:
    """Return the radius at which the gap begins, see `contact_radius`; None where too few points show it."""
    g = overlap(surface, u, plate)
    pressed = g > 0
    if not pressed.any():
        return 0.0
    r = distance_from_pressure_centre(surface, u, plate)
    radius, reach, free = float(r[pressed].max()), surface.reach, surface.dome & ~pressed
    outside = r[free]
    order = np.argsort(outside)
    outside, opening, range_before = outside[order], np.cbrt(g[free][order] ** 2), (-1, -1)
    for _ in range(4):
        width = min(radius, 0.6 * reach)
        first, last = np.searchsorted(outside, (radius + 0.05 * width, radius + 0.35 * width)).tolist()
        if (first, last) == range_before:
            break  # the same points have the same fit
        near, opened, range_before = outside[first:last], opening[first:last], (first, last)
        if np.count_nonzero(np.diff(near) > SAME_PLACE) < 3:
            return None
        x = near / radius - 1
        powers = np.array([x * x, x, np.ones_like(x)])
        # the normal equations of so few terms lose five digits at most
        a2, a1, a0 = np.linalg.solve(powers @ powers.T, powers @ (opened / opened.max()))
        # this form of the smaller root does not cancel when the quadratic is nearly a line
        root = -2 * a0 / (a1 + np.sqrt(max(a1 * a1 - 4 * a2 * a0, 0.0)))
        if not abs(root) < 0.5:
            return None
        radius *= 1 + float(root)
    return radius


def hertz_radius(surface: Surface, u: Array, plate: Plate) -> float:
    """Return the radius of a Hertz contact with the second moment of the pressure, see `contact_radius`.

    It serves under a tilted plate, where the contact area lies off the axis and is not quite round: there the points
    around it are too few in any one direction to extrapolate the gap.
    """
    load = surface.weights * np.maximum(overlap(surface, u, plate), 0.0)
    if not load.any():
        return 0.0
    r = distance_from_pressure_centre(surface, u, plate)
    return math.sqrt(2.5 * float(np.vdot(load, r**2)) / float(load.sum()))


def equal_area_radius(surface: Surface, u: Array, plate: Plate) -> float:
    """Return the radius of the circle that has the area of the contact; the contact of a sheared tip is not round.

    The area is that of the convex hull of the positions on the plate of all points under pressure. The points of half
    a skin are mirrored first.
    """
    from scipy.spatial import ConvexHull, QhullError

    x = positions_along_plate(surface, u, plate)[overlap(surface, u, plate) > 0]
    if surface.points[..., 1].min() > -SAME_PLACE:
        x = np.concatenate([x, x * [1, -1]])
    try:
        return float(np.sqrt(ConvexHull(x).volume / np.pi)) if len(x) > 2 else 0.0
    except QhullError:  # all on one line
        return 0.0
