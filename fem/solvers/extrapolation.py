"""Where the next increment is expected to lead: unknowns and contact, from a curve through the last states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem.contact import plate_contact
from fem.solvers.path_state import PathState
from geometry.arrays import Array

ON_LINE = 1e-9
"""Distance over D from a line up to which a position counts as on it: rounding is far below, increments far above."""


def drop_past_at_corner(state: PathState, position: Array) -> PathState:
    """The state without its past where that does not lie on the line from a position (3,) backwards.

    A curve through states around a corner says nothing of what follows.
    """
    ahead = position - state.position
    length = float(np.linalg.norm(ahead))
    for before in state.past:
        back = _coordinate(state, before.position, position)
        off_line = back * ahead / length - (before.position - state.position)
        if not (back < 0 and np.abs(off_line).max() < ON_LINE):
            return replace(state, past=())
    return state


def extrapolate_unknowns(state: PathState, position: Array) -> Array:
    """Unknowns at a position (3,): of the polynomial through the past states and the present one."""
    ahead = float(np.linalg.norm(position - state.position))
    at = np.array([*(_coordinate(state, before.position, position) for before in state.past), 0.0])
    # Lagrange's polynomials
    *shares, present = (np.prod([(ahead - u) / (t - u) for u in at if u != t]) for t in at)
    guess = present * state.q
    for share, before in zip(shares, state.past, strict=True):
        guess += share * before.q
    return np.asarray(guess)


def extrapolate_contact(state: PathState, position: Array) -> NDArray[np.bool_] | None:
    """Points of the skin (k, q) in contact at a position (3,): where the gap, followed further, is closed.

    At first touch Hertz's patch, the points that a plate at half the depth would cut. None for a grip.
    """
    if state.grip:
        return None
    if state.position[0] == 0:
        rest = np.zeros(state.d.system.fixed.shape)
        return plate_contact.overlap(state.skin, rest, state.plate_at(np.array([position[0] / 2, 0, 0]))) >= 0
    overlap = state.overlap
    if state.past:
        last = state.past[-1]
        rate = np.linalg.norm(position - state.position) / np.linalg.norm(state.position - last.position)
        overlap = overlap + rate * (overlap - last.overlap)
    return overlap > 0


def _coordinate(state: PathState, past: Array, position: Array) -> float:
    """Coordinate of a past position (3,) along the line to the next one; the present one is at 0."""
    ahead = position - state.position
    return float((past - state.position) @ ahead) / float(np.linalg.norm(ahead))
