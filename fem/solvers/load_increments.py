"""From one state of a path to the next: an increment of the load, and the increments of a straight segment.

An increment starts from where the last states lead (`fem.solvers.extrapolation`) and is solved by Newton's method. It
gives the next state or says why there is none; the state that it started from stays as it is. The increments of a
segment shrink where one fails and grow again where they are easy; states on the way are solved roughly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem.contact import coulomb_friction, plate_contact
from fem.contact.plate_contact import Plate
from fem.solvers import extrapolation
from fem.solvers.direct_solver import Solver
from fem.solvers.newton import TOLERANCE, Equilibrium, Stop, newton
from fem.solvers.path_state import PastState, PathState
from geometry.arrays import Array

LONGEST, SOLID_LONGEST = 0.25, 0.125
"""Longest increments over D without friction, on sections and in tetrahedra: these distort more where a patch ends,
and longer ones fail there."""
FRICTION_PRESS, FRICTION_SHEAR, FRICTION_PRESS_SHARE = 0.02, 0.08, 0.2
"""Longest increments over D with Coulomb friction, whose answer depends on the way: its error is of second order in
their length. Those of a press are also at most a share of its depth."""
SHORTEST = 1e-3
"""Increment over D, or over a segment shorter than D, below which the path stops: a state that cannot be reached from
so near is taken for a limit of the path, not of the increments."""
PASSED_TOLERANCE, SOLID_PASSED_TOLERANCE = 1e-4, 3e-3
"""Newton's tolerances for states that are only passed, without friction, on sections and in tetrahedra, whose
iterations cost more: the next increment corrects what is left."""
EASY = 7
"""Iterations up to which an increment counts as easy, and the next one may be longer."""
GROWTH = 1.5
"""Ratio of an increment to the easy one before. Failure halves increments, so that twice as long would be the failed
length again."""
SURE = 0.01
"""Increments over D that first meet an unstable direction, or crush silicone, are halved to this before it is
believed: a long one may land on an unstable branch beside the stable one."""
CRUSHED = 0.25
"""Volume ratio J below which silicone counts as crushed. A coarse mesh has equilibria, of higher energy, with an
element folded flat (J of 0.1 to 0.2 at its points), which a long increment may land on; at the edges of a glued patch
or a magnet J stays above 0.35."""
ONSET_HALVINGS = 3
"""Halvings of the increment in which the first unstable direction appeared: an eighth of SURE is 1 % of a depth of
D/8, and `fem.stability` finds a critical depth better."""


@dataclass(frozen=True, slots=True)
class Increment:
    """What became of an increment.

    Attributes
    ----------
    state : the next one; None if the increment failed, or is too long for what it met to be believed.
    stop : why it failed; empty if it did not.
    iterations : of Newton's method.
    easy : whether they were few.
    """

    state: PathState | None
    stop: Stop
    iterations: int
    easy: bool


@dataclass(frozen=True, slots=True)
class Segment:
    """How far the increments of a segment, or of several in a row, have led.

    Attributes
    ----------
    state : the last one that was reached.
    stop : why it is short of the goal; empty if it is not.
    iterations : of Newton's method.
    """

    state: PathState
    stop: Stop
    iterations: int


def follow_segment(
    solver: Solver, state: PathState, goal: Array, *, passing: bool = False, friction_step_factor: float = 1.0
) -> Segment:
    """Go straight to a position (3,) in increments.

    Parameters
    ----------
    passing : the goal itself need only be solved roughly.
    friction_step_factor : increments with Coulomb friction are at most so many times their usual length.
    """
    start, iterations = state.position, 0
    length = float(np.linalg.norm(goal - start))
    if length == 0:
        return Segment(state, "", 0)
    state = _set_direction(state, (goal - start) / length)
    longest = _longest_increment(state, max(start[0], goal[0]), friction_step_factor) / length
    # places and steps count in shares of the segment
    place, step = 0.0, min(longest, 1.0)
    while place < 1:
        # no sliver is left for a last increment
        target = 1.0 if 1 - place <= 1.001 * step else place + step
        position = goal if target == 1 else start + target * (goal - start)
        tolerance = _tolerance(state, passed=passing or target < 1)
        tried = apply_increment(solver, state, position, tolerance, sure=step * length <= SURE)
        iterations += tried.iterations
        if tried.state is not None:
            state, place = tried.state, target
            step = min(GROWTH * step if tried.easy else step, longest)
            continue
        # where the way curves so much, the last states lead astray
        state, step = replace(state, past=()), (target - place) / 2
        if tried.stop and step * length < SHORTEST * min(length, 1.0):
            if state.friction is not None or passing:
                return Segment(state, tried.stop, iterations)
            state, more = _solve_fully(solver, state)
            return Segment(state, tried.stop, iterations + more)
    return Segment(state, "", iterations)


def apply_increment(solver: Solver, state: PathState, position: Array, tolerance: float, *, sure: bool) -> Increment:
    """Go to a position (3,) at once.

    Parameters
    ----------
    sure : believe it if the increment is the first to meet an unstable direction or to crush silicone.
    """
    state = extrapolation.drop_past_at_corner(state, position)
    guess, plate = extrapolation.extrapolate_unknowns(state, position), state.plate_at(position)
    if state.friction is not None:
        moved = plate_contact.displacements_along_plate(
            state.skin, state.d.system.state(guess).u, plate if state.past else state.plate
        )
        plate = replace(plate, friction=coulomb_friction.expect_motion(state.friction, moved))
    expected = extrapolation.extrapolate_contact(state, position)
    answer = newton(state.d.system, solver, guess, plate, expected, tolerance=tolerance)
    crushed = least_J(answer) < CRUSHED <= state.least_J
    doubtful = (bool(answer.unstable and not state.unstable) or crushed) and not sure
    if not answer.converged or doubtful:
        return Increment(None, answer.reason, answer.iterations, easy=False)
    onset, more = state.onset, 0
    if answer.unstable and not state.unstable and onset is None:
        onset, more = _bracket_onset(solver, replace(state, friction=plate.friction), answer, position)
    after = replace(_accept(state, answer, position, plate), onset=onset)
    return Increment(after, "", answer.iterations + more, easy=answer.iterations <= EASY)


def _accept(state: PathState, answer: Equilibrium, position: Array, plate: Plate) -> PathState:
    """The state after an increment to a position (3,), where Newton's method has answered for the plate."""
    friction, dissipated = state.friction, state.dissipated
    if friction is not None:
        friction, lost = plate_contact.advance_friction(state.skin, answer.state.u, plate)
        dissipated += lost
    return replace(
        state,
        position=position,
        q=answer.state.q,
        energy=answer.assembly.energy,
        least_J=least_J(answer),
        unstable=answer.unstable,
        friction=friction,
        dissipated=dissipated,
        past=(*state.past[-1:], PastState(state.position, state.q, state.overlap)),
    )


def least_J(answer: Equilibrium) -> float:
    """Least volume ratio J at the points of integration."""
    return 1 + min((float(strain.Jm1.min()) for strain in answer.state.strains), default=0.0)


def _set_direction(state: PathState, direction: Array) -> PathState:
    """The state about to move in a direction (3,): in a new one, all that touches is expected to stick at first."""
    if state.friction is None:
        return state
    if direction @ state.direction < 1 - 1e-9:
        state = replace(state, friction=coulomb_friction.expect_sticking(state.friction))
    return replace(state, direction=direction)


def _longest_increment(state: PathState, depth: float, friction_step_factor: float) -> float:
    """Longest increment over D, down to a depth."""
    if state.friction is None:
        return LONGEST if state.d.revolved else SOLID_LONGEST
    press = min(FRICTION_PRESS, FRICTION_PRESS_SHARE * depth)
    return friction_step_factor * (press if state.direction[0] else FRICTION_SHEAR)


def _tolerance(state: PathState, *, passed: bool) -> float:
    """Newton's tolerance; with friction the history keeps the error of every state."""
    if not passed or state.friction is not None:
        return TOLERANCE
    return PASSED_TOLERANCE if state.d.revolved else SOLID_PASSED_TOLERANCE


def _solve_fully(solver: Solver, state: PathState) -> tuple[PathState, int]:
    """A state that was only to be passed, solved to the end, and Newton's iterations."""
    answer = newton(state.d.system, solver, state.q, state.plate)
    if answer.converged:
        state = replace(state, q=answer.state.q, energy=answer.assembly.energy, least_J=least_J(answer))
    return state, answer.iterations


def _bracket_onset(
    solver: Solver, state: PathState, answer: Equilibrium, position: Array
) -> tuple[tuple[Array, Array], int]:
    """Positions between which an increment's first unstable direction appeared, and Newton's iterations."""
    stable, unstable, q, iterations = state.position, position, state.q, 0
    for _ in range(ONSET_HALVINGS):
        middle = (stable + unstable) / 2
        between = newton(state.d.system, solver, (q + answer.state.q) / 2, state.plate_at(middle))
        iterations += between.iterations
        if not between.converged or between.unstable is None:
            break
        if between.unstable:
            unstable, answer = middle, between
        else:
            stable, q = middle, between.state.q
    return (stable, unstable), iterations
