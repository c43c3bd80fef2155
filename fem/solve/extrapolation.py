"""First guess for the next load increment: unknowns and contact, extrapolated through the last states."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem.model import plate_contact
from fem.solve.path_state import PathState
from geometry.arrays import Array

ON_LINE = 1e-9
"""Distance from a line, over D, up to which a position is on it: far above rounding, far below increments."""


def drop_past_at_corner(state: PathState, position: Array) -> PathState:
    """Return the state without its past states where these are not on the straight line to a position (3,).

    Extrapolation around a corner of the path is meaningless.
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
    """Return the unknowns at a position (3,), from the polynomial through the past and present states."""
    ahead = float(np.linalg.norm(position - state.position))
    at = [*(_coordinate(state, before.position, position) for before in state.past), 0.0]
    # Lagrange polynomials: they need no equal spacing, and increments differ in length
    *shares, present = (math.prod((ahead - u) / (t - u) for u in at if u != t) for t in at)
    guess = present * state.q
    for share, before in zip(shares, state.past, strict=True):
        guess += share * before.q
    return np.asarray(guess)


def extrapolate_contact(state: PathState, position: Array) -> NDArray[np.bool_] | None:
    """Return the skin points (k, q) in contact at a position (3,): those where the extrapolated gap is closed.

    At first touch these are the points of the Hertz contact, which a plate at half the depth would cut. None for a
    grip.
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
    """Return the coordinate of a past position (3,) on the line to the next one; the present position is at 0."""
    ahead = position - state.position
    return float((past - state.position) @ ahead) / float(np.linalg.norm(ahead))
