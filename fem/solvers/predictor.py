"""Prediction by a reduced model: one harmonic on the same mesh, for a model with more harmonics.

Most of the solution is in the first harmonic. The predictor follows a segment in increments, which are cheap for it.
At its end the contribution of the other harmonics at the start is added to the prediction, and the full model is
corrected once, without increments of its own. Where that does not converge, or leads to another branch, the full
model takes its own increments.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem.contact import plate_contact
from fem.discretisation.symmetry_models import raise_harmonics
from fem.solvers.direct_solver import Solver
from fem.solvers.load_increments import CRUSHED, follow_segment, least_J
from fem.solvers.newton import newton
from fem.solvers.path_state import PathState
from geometry.arrays import Array

MOST_ITERATIONS = 12
"""Most iterations for the correction; more would cost as much as the increments that are to be saved."""


def predict(solver: Solver, reduced_solver: Solver, state: PathState, goal: Array) -> tuple[PathState, int]:
    """Move to a position (3,) by correcting a prediction.

    Returns
    -------
    The state there, or the present state (with the predictor moved) where that fails, and Newton's iterations of both
    models.
    """
    before = state.reduced
    # the predictor may have stopped earlier than the full model, and is then of no use
    if before is None or not np.array_equal(before.position, state.position):
        return state, 0
    added = state.q - raise_harmonics(before.d.system, state.d.system, before.q)
    if before.bond is None:
        before = replace(before, bond=state.bond)
    ahead = follow_segment(reduced_solver, before, goal, passing=True)
    state = replace(state, reduced=ahead.state)
    # another number of unstable directions means another branch
    if ahead.stop or (ahead.state.unstable or 0) != (state.unstable or 0):
        return state, ahead.iterations
    guess = added + raise_harmonics(ahead.state.d.system, state.d.system, ahead.state.q)
    after, iterations = _correct(solver, state, guess, goal)
    return after, ahead.iterations + iterations


def _correct(solver: Solver, state: PathState, guess: Array, goal: Array) -> tuple[PathState, int]:
    """Return the state at a position (3,) from a first guess; the present one if it fails or is on another branch."""
    plate, system = state.plate_at(goal), state.d.system
    pressed = None if state.grip else plate_contact.overlap(state.skin, system.state(guess).u, plate) > 0
    answer = newton(system, solver, guess, plate, pressed, most=MOST_ITERATIONS)
    least = least_J(answer)
    sound = (answer.unstable or 0) == (state.unstable or 0) and (least < CRUSHED) == (state.least_J < CRUSHED)
    if not answer.converged or not sound:
        return state, answer.iterations
    q, energy = answer.state.q, answer.assembly.energy
    # intermediate states are unknown, so the next guess cannot be extrapolated
    return replace(state, position=goal, q=q, energy=energy, least_J=least, past=()), answer.iterations
