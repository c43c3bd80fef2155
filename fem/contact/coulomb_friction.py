"""Coulomb friction between the skin and the plate, at the integration points of the skin.

A point under pressure p carries a traction t along the plate (here as the derivative of the springs' energy by the
displacement: minus the force on the skin) with |t| <= mu p. It moves by s along the plate, in the plate's own frame.
Over a step of the load, from the last converged state n on,

    trial = t_n + et (s - s_n),      t = trial where |trial| <= mu p (stick), else mu p trial / |trial| (slip),

an implicit return map: what exceeds the cone is slip, of length (|trial| - mu p) / et. The spring et = STICK en is
the compliance of sticking. A point that touches within a step is taken to do so half way along its expected motion,
where its spring is at rest; tractions of points that lift off are gone. The tangent, with n = trial / |trial|:

    stick:  dt = et ds,        slip:  dt = mu p et / |trial| (1 - n n^T) ds + mu n dp,

where the coupling to the pressure makes the slipping point's matrix unsymmetric: dry friction has no energy.

Energy dissipated over a step per area: the slip times the mean of its traction before and after.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array

Mask = NDArray[np.bool_]

STICK = 0.2
"""Stiffness of the sticking springs over that of the plate's normal ones."""
MIDWAY = 0.5


@dataclass(frozen=True, slots=True)
class Friction:
    """Coefficient and history of the points (k, q) of a skin, as of the last converged state.

    Attributes
    ----------
    mu : coefficient of friction.
    place : (k, q, 2) displacement along the plate less the plate's own.
    traction : (k, q, 2) along the plate, minus the force on the skin per reference area.
    pressure : (k, q) of the plate, 0 where it does not touch.
    slipping : (k, q) which points slipped last.
    anchor : (k, q, 2) place that a step's motion along the plate counts from, `place` if None.
    heading : (k, q, 2) tractions' directions where points slip at Newton's last iterate, else 0; None if not known.
    """

    mu: float
    place: Array
    traction: Array
    pressure: Array
    slipping: Mask
    anchor: Array | None = None
    heading: Array | None = None

    @property
    def touching(self) -> Mask:
        """Points that were in contact."""
        return self.pressure > 0


@dataclass(frozen=True, slots=True)
class Drag:
    """What friction does at the points of a trial state.

    Attributes
    ----------
    traction : (k, q, 2) along the plate.
    by_place : (k, q, 2, 2) its derivative by the displacement along the plate.
    by_pressure : (k, q, 2) its derivative by the pressure.
    slipping : (k, q) mask.
    slip : (k, q) length slipped since the last converged state.
    """

    traction: Array
    by_place: Array
    by_pressure: Array
    slipping: Mask
    slip: Array


def at_rest(mu: float, points: tuple[int, int]) -> Friction:
    """Before first touch."""
    pair = np.zeros((*points, 2))
    return Friction(mu, pair, pair, np.zeros(points), np.zeros(points, dtype=bool))


def drag(f: Friction, place: Array, pressure: Array, active: Mask, et: float, *, frozen: bool = False) -> Drag:
    """The return map at displacements `place` along the plate; `active` points touch it.

    frozen : points slip or stick as they did last, whatever their traction.
    """
    trial = f.traction + et * (place - (f.place if f.anchor is None else f.anchor))
    size = np.linalg.norm(trial, axis=-1)
    limit = f.mu * np.maximum(pressure, 0.0)
    slipping = active & (size > 0) & (f.slipping if frozen else size > limit)
    if f.heading is not None:
        slipping &= np.sum(trial * f.heading, axis=-1) >= 0
    stretch = np.where(slipping, limit / np.where(size > 0, size, 1.0), active)
    n = trial / np.where(size > 0, size, 1.0)[..., None]
    across = np.eye(2) - np.where(slipping[..., None, None], n[..., :, None] * n[..., None, :], 0.0)
    return Drag(
        traction=stretch[..., None] * trial,
        by_place=(et * stretch)[..., None, None] * across,
        by_pressure=np.where((slipping & (pressure > 0))[..., None], f.mu * n, 0.0),
        slipping=slipping,
        slip=np.where(slipping, np.maximum(size - limit, 0.0), 0.0) / et,
    )


def advanced(f: Friction, place: Array, pressure: Array, et: float) -> tuple[Friction, Array]:
    """The history after a step that has converged, and the energy (k, q) dissipated per area.

    A point that has lifted off is taken to have done so half way.
    """
    active = pressure > 0
    now = drag(f, place, pressure, active, et)
    released = f.touching & ~active
    slip = np.where(released, MIDWAY * np.linalg.norm(place - f.place, axis=-1), now.slip)
    limit, size = f.mu * np.maximum(pressure, 0.0), np.linalg.norm(f.traction, axis=-1)
    # a point that stuck far inside the cone slips only once its pressure has nearly gone
    first = np.minimum(f.mu * f.pressure, np.maximum(size, limit))
    lost = (first + limit) / 2 * slip
    after = Friction(f.mu, place, now.traction, np.where(active, pressure, 0.0), now.slipping)
    return after, lost


def expecting(f: Friction, place: Array) -> Friction:
    """The history for a step that is expected to end at `place`.

    Points that do not touch yet are expected to do so half way: their springs are strained from there on. So the
    error of a step is of second order in its length, and either way of ignoring the motion before makes it of first.
    """
    return replace(f, anchor=np.where(f.touching[..., None], f.place, f.place + MIDWAY * (place - f.place)))


def heading(f: Friction, place: Array, pressure: Array, et: float) -> tuple[Friction, bool]:
    """The same for Newton's next iterate, and whether a point was held at this one.

    A point that slips one way at an iterate and the other way at the next is held at first: the traction of a
    slipping point has no stiffness along the slip, so that Newton's method would throw it to and fro across the
    narrow range in which it sticks.
    """
    active = pressure > 0
    now, free = (drag(g, place, pressure, active, et) for g in (f, replace(f, heading=None)))
    size = np.linalg.norm(now.traction, axis=-1)
    way = np.where(
        (now.slipping & (size > 0))[..., None], now.traction / np.where(size > 0, size, 1.0)[..., None], 0.0
    )
    return replace(f, heading=way), not np.array_equal(now.slipping, free.slipping)


def turned_back(f: Friction) -> Friction:
    """The same, with every point expected to stick at first: the plate is about to move another way."""
    return replace(f, slipping=np.zeros_like(f.slipping))


def revolved(f: Friction, points: Array) -> Friction:
    """The history of a body of revolution, one point per angle of the same body's skin at `points` (k, q t, 3)."""
    turns = points.shape[1] // f.pressure.shape[1]
    along = points[..., :2] / np.linalg.norm(points[..., :2], axis=-1, keepdims=True)

    def around(values: Array) -> Array:
        return np.repeat(values, turns, axis=1)

    return Friction(
        f.mu,
        around(f.place[..., :1]) * along,
        around(f.traction[..., :1]) * along,
        around(f.pressure),
        np.repeat(f.slipping, turns, axis=1),
    )


def slip_share(f: Friction, weights: Array) -> float | None:
    """Share of the area in contact that slips; None where nothing touches."""
    area = float(np.sum(weights * f.touching))
    return float(np.sum(weights * (f.slipping & f.touching))) / area if area > 0 else None
