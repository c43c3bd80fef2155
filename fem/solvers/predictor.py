"""A reduced model, with one harmonic on the same mesh, that goes ahead of a model with more.

The answer is mostly in the first harmonic. So the predictor follows a segment in increments, which are cheap for it;
what the other harmonics had to add before is added again where it arrives, and the model itself needs no increments
between. Where that does not converge, or meets another branch, the model takes its own increments.
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
"""For correcting the prediction: more cost as much as the increments that it is to save."""


def predict(solver: Solver, reduced_solver: Solver, state: PathState, goal: Array) -> tuple[PathState, int]:
    """Go to a position (3,) by correcting what the predictor says of it.

    Returns
    -------
    The state there, or where that fails the state as it was but for its predictor, and Newton's iterations of both.
    """
    before = state.reduced
    # after a press in increments the predictor may have been left behind
    if before is None or not np.array_equal(before.position, state.position):
        return state, 0
    added = state.q - raise_harmonics(before.d.system, state.d.system, before.q)
    ahead = follow_segment(reduced_solver, replace(before, bond=state.bond), goal, passing=True)
    state = replace(state, reduced=ahead.state)
    # another number of unstable directions is another branch
    if ahead.stop or (ahead.state.unstable or 0) != (state.unstable or 0):
        return state, ahead.iterations
    guess = added + raise_harmonics(ahead.state.d.system, state.d.system, ahead.state.q)
    after, iterations = _correct(solver, state, guess, goal)
    return after, ahead.iterations + iterations


def _correct(solver: Solver, state: PathState, guess: Array, goal: Array) -> tuple[PathState, int]:
    """The state at a position (3,) from a first guess; unchanged if it is not found or not to be trusted."""
    plate, system = state.plate_at(goal), state.d.system
    pressed = None if state.grip else plate_contact.overlap(state.skin, system.state(guess).u, plate) > 0
    answer = newton(system, solver, guess, plate, pressed, most=MOST_ITERATIONS)
    least = least_J(answer)
    sound = (answer.unstable or 0) == (state.unstable or 0) and (least < CRUSHED) == (state.least_J < CRUSHED)
    if not answer.converged or not sound:
        return state, answer.iterations
    q, energy = answer.state.q, answer.assembly.energy
    # no state between is known: the next guess is not extrapolated
    return replace(state, position=goal, q=q, energy=energy, least_J=least, past=()), answer.iterations
