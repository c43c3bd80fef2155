"""Coulomb friction between the skin and the plate, at the integration points of the skin.

A point under pressure p carries a traction t along the plate with |t| <= mu p. Here t is the derivative of the
springs' energy by the displacement, that is, minus the force on the skin. The point moves by s along the plate,
relative to the plate. Over a load step from the last converged state n,

    trial = t_n + et (s - s_n),      t = trial where |trial| <= mu p (stick), else mu p trial / |trial| (slip).

This is an implicit return map: the part of the trial traction outside the cone becomes slip, and the slip has the
length (|trial| - mu p) / et. The stiffness et = STICK en is a penalty that allows a small elastic motion while a
point sticks. A point that first touches within a step is assumed to touch half way along its expected motion, so its
spring is relaxed there. A point that lifts off loses its traction. The tangent, with n = trial / |trial|, is

    stick:  dt = et ds,        slip:  dt = mu p et / |trial| (1 - n n^T) ds + mu n dp.

The coupling to the pressure makes the stiffness of a slipping point unsymmetric: dry friction has no energy.

The energy dissipated over a step, per area, is the slip times the mean of the traction before and after.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array, Mask

STICK = 0.2
"""Stiffness of the tangential springs over that of the plate's normal springs. Softer springs would let a sticking
point slide; stiffer ones narrow the range in which a point sticks and cost Newton iterations."""


@dataclass(frozen=True, slots=True)
class Friction:
    """Coefficient of friction, and history of the skin's points (k, q) at the last converged state.

    mu : coefficient of friction.
    displacement : (k, q, 2) displacement along the plate relative to the plate, over D.
    traction : (k, q, 2) traction along the plate, minus the force on the skin per reference area, over E.
    pressure : (k, q) pressure of the plate over E, 0 where it does not touch.
    slipping : (k, q) mask of the points that slipped.
    anchor : (k, q, 2) displacement at which a point's spring carries the traction of the last state; default:
        `displacement`.
    slip_direction : (k, q, 2) unit vector of the traction where a point slips at Newton's last iterate, else 0; None
        where there is no iterate yet.
    """

    mu: float
    displacement: Array
    traction: Array
    pressure: Array
    slipping: Mask
    anchor: Array | None = None
    slip_direction: Array | None = None

    @property
    def touching(self) -> Mask:
        """Mask of the points that were in contact."""
        return self.pressure > 0


@dataclass(frozen=True, slots=True)
class FrictionTraction:
    """Tractions of a trial state, and their derivatives.

    traction : (k, q, 2) traction along the plate.
    by_displacement : (k, q, 2, 2) its derivative by the displacement along the plate.
    by_pressure : (k, q, 2) its derivative by the pressure.
    slipping : (k, q) mask of the points that slip.
    slip : (k, q) length of the slip since the last converged state.
    direction : (k, q, 2) unit vector of the traction where a point slips, else 0.
    held : whether any point sticks here only because it slipped in the opposite direction at the last iterate.
    """

    traction: Array
    by_displacement: Array
    by_pressure: Array
    slipping: Mask
    slip: Array
    direction: Array
    held: bool


def at_rest(mu: float, points: tuple[int, int]) -> Friction:
    """Return the history before first touch, for `points` = (k, q) points."""
    pair = np.zeros((*points, 2))
    return Friction(mu, pair, pair, np.zeros(points), np.zeros(points, dtype=bool))


def apply_return_map(
    f: Friction, displacement: Array, pressure: Array, active: Mask, et: float, *, frozen: bool = False
) -> FrictionTraction:
    """Return the tractions of a trial state, by the return map of the module docstring.

    displacement, pressure : trial displacement along the plate relative to it (k, q, 2), and pressure (k, q).
    active : (k, q) mask of the points that touch the plate.
    frozen : keep each point slipping or sticking as in `f`, whatever its traction.
    """
    # elastic predictor: the trial traction of a point that sticks over the whole step
    trial = f.traction + et * (displacement - (f.displacement if f.anchor is None else f.anchor))
    size = np.hypot(trial[..., 0], trial[..., 1])
    limit = f.mu * np.maximum(pressure, 0.0)
    beyond = active & (size > 0) & (f.slipping if frozen else size > limit)
    slipping = beyond
    if f.slip_direction is not None:
        slipping = beyond & ((trial * f.slip_direction).sum(axis=-1) >= 0)
    length = np.where(size > 0, size, 1.0)
    stretch = np.where(slipping, limit / length, active)
    n = np.where(slipping[..., None], trial / length[..., None], 0.0)
    # a slipping point resists only across its slip, see the tangent in the module docstring
    across = np.eye(2) - n[..., :, None] * n[..., None, :]
    loaded = (limit > 0)[..., None]
    return FrictionTraction(
        traction=stretch[..., None] * trial,
        by_displacement=(et * stretch)[..., None, None] * across,
        by_pressure=np.where((pressure > 0)[..., None], f.mu * n, 0.0),
        slipping=slipping,
        slip=np.where(slipping, np.maximum(size - limit, 0.0), 0.0) / et,
        direction=np.where(loaded, n, 0.0),
        held=not np.array_equal(slipping, beyond),
    )


def advance(f: Friction, displacement: Array, pressure: Array, et: float) -> tuple[Friction, Array]:
    """Return the history after a converged step, and the energy (k, q) dissipated in it per area.

    A point that has lifted off is assumed to have done so half way through the step.
    """
    active = pressure > 0
    now = apply_return_map(f, displacement, pressure, active, et)
    released = f.touching & ~active
    slip = np.where(released, np.linalg.norm(displacement - f.displacement, axis=-1) / 2, now.slip)
    limit, size = f.mu * np.maximum(pressure, 0.0), np.linalg.norm(f.traction, axis=-1)
    # a point that stuck far inside the cone slips only after its pressure has nearly vanished: its traction when it
    # begins to slip is then below mu times the pressure before
    first = np.minimum(f.mu * f.pressure, np.maximum(size, limit))
    lost = (first + limit) / 2 * slip
    after = Friction(f.mu, displacement, now.traction, np.where(active, pressure, 0.0), now.slipping)
    return after, lost


def expect_motion(f: Friction, displacement: Array) -> Friction:
    """Return the history for a step that is expected to end at `displacement`, (k, q, 2).

    A point that does not touch yet is expected to touch half way, so its spring is strained from there on. The error
    of a step is then of second order in its length; anchoring at the start or at the end makes it first order.
    """
    half_way = f.displacement + (displacement - f.displacement) / 2
    return replace(f, anchor=np.where(f.touching[..., None], f.displacement, half_way))


def expect_sticking(f: Friction) -> Friction:
    """Return the history with all points expected to stick at first, for a plate that changes its direction."""
    return replace(f, slipping=np.zeros_like(f.slipping))


def revolve(f: Friction, points: Array) -> Friction:
    """Return the history of a solid of revolution at points (k, q t, 3), from that of its section's points (k, q)."""
    turns = points.shape[1] // f.pressure.shape[1]
    along = points[..., :2] / np.linalg.norm(points[..., :2], axis=-1, keepdims=True)
    displacement, traction = (
        np.repeat(values[..., :1], turns, axis=1) * along for values in (f.displacement, f.traction)
    )
    pressure, slipping = np.repeat(f.pressure, turns, axis=1), np.repeat(f.slipping, turns, axis=1)
    return Friction(f.mu, displacement, traction, pressure, slipping)


def slip_share(f: Friction, weights: Array) -> float | None:
    """Return the share of the contact area that slips; None where nothing touches."""
    area = float(np.sum(weights * f.touching))
    return float(np.sum(weights * (f.slipping & f.touching))) / area if area > 0 else None
