"""One increment of the load, and the increments of a straight segment of the path.

An increment starts from the extrapolated last states, unknowns and contact, and is solved by Newton's method.
It returns the next state, or the reason why there is none; the state before is not changed. The increments of a
segment are halved where one fails and grow again where they converge easily. Intermediate states are solved to a
looser tolerance. A function may see every increment (`watched`), for progress and to end a path.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem.model import coulomb_friction, plate_contact
from fem.model.elements import SAME_PLACE
from fem.model.plate_contact import Plate
from fem.solve.active_set import KeptTangent
from fem.solve.condensed_friction import CondensedFriction
from fem.solve.direct_solver import Solver
from fem.solve.newton import TOLERANCE, Equilibrium, Stop, iterate, newton
from fem.solve.path_state import PastState, PathState
from geometry.arrays import Array

LONGEST = 0.25
"""Longest increment over D without friction, on sections. Tetrahedra distort more at the edge of the contact: theirs
are half as long."""
FRICTION_PRESS, FRICTION_SHEAR, FRICTION_PRESS_SHARE = 0.02, 0.08, 0.2
"""Longest increments over D with Coulomb friction, whose result depends on the path: the error is of second order in
the increment. Those of a press are also at most the share FRICTION_PRESS_SHARE of its depth."""
SHORTEST = 1e-3
"""Increment over D, or over the length of a segment shorter than D, below which the path stops: if even such a small
increment fails, the path has reached a limit."""
PREDICTED, PREDICTED_TOLERANCE = 0.4, 0.01
"""Longest shear over D that a predictor follows in one increment, and its Newton tolerance: the prediction is off by
some percent anyway, from the harmonics that it leaves out. At 0.1 long shears need more corrections. A press is
predicted to PASSED_TOLERANCE: where it buckles, a rough state may lie on the side of another branch."""
PASSED_TOLERANCE, SOLID_PASSED_TOLERANCE = 1e-4, 3e-3
"""Newton tolerances of intermediate states without friction, on sections and in tetrahedra, whose iterations cost
more. The next increment corrects the remaining residual."""
EASY = 7
"""Newton iterations up to which an increment is easy, and the next one may be longer."""
GROWTH = 1.5
"""Ratio of an increment to the easy one before. A failed increment is halved, so a factor of 2 would repeat the
length that failed."""
LONGEST_DOUBTFUL = 0.01
"""Longest increment over D whose result is accepted if it is the first with an unstable direction or crushed
silicone. Longer ones are halved: they may land on an unstable branch beside the stable one."""
CRUSHED = 0.25
"""Volume ratio J below which silicone is crushed. A coarse mesh has spurious equilibria, of higher energy, with one
element folded flat (J of 0.1 to 0.2 at its points), on which a long increment may land. At the edges of a glued area
or of the magnet J stays above 0.35."""
ONSET_HALVINGS = 3
"""Halvings of the increment in which the first unstable direction appeared: LONGEST_DOUBTFUL / 8 is 1 % of a depth of
D / 8; `fem.analyses.stability` computes a critical depth more accurately."""

_watch: ContextVar[Callable[[float], None] | None] = ContextVar("watch", default=None)


@contextlib.contextmanager
def watched(watch: Callable[[float], None]) -> Iterator[None]:
    """Call a function before each load increment of this context, with the completed share of its segment.

    An exception that the function raises ends the path. Paths are made of frozen states, so the states before it
    stay.
    """
    token = _watch.set(watch)
    try:
        yield
    finally:
        _watch.reset(token)


def report(share: float) -> None:
    """Call the function of `watched`, if there is one."""
    watch = _watch.get()
    if watch is not None:
        watch(share)


@dataclass(frozen=True, slots=True)
class Increment:
    """Result of one increment.

    Attributes
    ----------
    state : the next state; None if the increment failed, or was too long for its result to be accepted.
    stop : why it failed; empty if it did not.
    iterations : Newton iterations.
    easy : whether these were few.
    """

    state: PathState | None
    stop: Stop
    iterations: int
    easy: bool


@dataclass(frozen=True, slots=True)
class Reached:
    """Result of the increments of one or several segments.

    Attributes
    ----------
    state : the last state reached.
    stop : why the goal was not reached; empty if it was.
    iterations : Newton iterations.
    """

    state: PathState
    stop: Stop
    iterations: int


def follow_segment(
    solver: Solver, state: PathState, goal: Array, *, predicts: bool = False, friction_step_factor: float = 1.0
) -> Reached:
    """Move in a straight line to a position (3,) in increments.

    Parameters
    ----------
    predicts : whether the states are only a prediction, those of a shear to PREDICTED_TOLERANCE.
    friction_step_factor : factor on the longest increments with Coulomb friction.
    """
    start, iterations = state.position, 0
    length = float(np.linalg.norm(goal - start))
    if length == 0:
        return Reached(state, "", 0)
    state = _set_direction(state, (goal - start) / length)
    longest = longest_increment(state, max(start[0], goal[0]), friction_step_factor) / length
    rough = predicts and start[0] == goal[0]
    if rough and length <= PREDICTED:
        longest = 1.0
    # `place` and `step` are shares of the segment's length
    place, step = 0.0, min(longest, 1.0)
    while place < 1:
        report(place)
        # the tolerance of 1e-3 avoids a tiny last increment
        target = 1.0 if 1 - place <= 1.001 * step else place + step
        position = goal if target == 1 else start + target * (goal - start)
        tolerance = PREDICTED_TOLERANCE if rough else _tolerance(state, passed=predicts or target < 1)
        tried = apply_increment(solver, state, position, tolerance, accept=step * length <= LONGEST_DOUBTFUL)
        iterations += tried.iterations
        if tried.state is not None:
            state, place = tried.state, target
            step = min(GROWTH * step if tried.easy else step, longest)
            continue
        # the path is too curved here for extrapolation: the retry starts from the last state
        state, step = replace(state, past=()), (target - place) / 2
        if tried.stop and step * length < SHORTEST * min(length, 1.0):
            if state.friction is not None or predicts:
                return Reached(state, tried.stop, iterations)
            state, more = _solve_fully(solver, state)
            return Reached(state, tried.stop, iterations + more)
    return Reached(state, "", iterations)


def apply_increment(
    solver: Solver, state: PathState, position: Array, tolerance: float, *, accept: bool
) -> Increment:
    """Move to a position (3,) in one increment.

    Parameters
    ----------
    accept : accept the result although it is the first with an unstable direction or with crushed silicone.
    """
    state = drop_past_at_corner(state, position)
    guess, plate = extrapolate_unknowns(state, position), state.plate_at(position)
    if state.friction is not None:
        moved = plate_contact.displacements_along_plate(
            state.skin, state.d.system.state(guess).u, plate if state.past else state.plate
        )
        plate = replace(plate, friction=coulomb_friction.expect_motion(state.friction, moved))
    expected = extrapolate_contact(state, position)
    answer = find_equilibrium(solver, state, guess, plate, expected, tolerance)
    # an increment that is the first to be unstable or crushed may have jumped to another branch
    crushed = answer.state.least_J < CRUSHED <= state.least_J
    first = answer.stability.is_unstable and not state.stability.is_unstable
    doubtful = (first or crushed) and not accept
    turned = answer.converged and turns_over(state, position, answer.state.u)
    if not answer.converged or doubtful or turned:
        # an increment that is too short to jump has no such state
        stop = "no_convergence" if turned and accept else answer.reason
        return Increment(None, stop, answer.iterations, easy=False)
    onset, more = state.onset, 0
    if first and onset is None:
        onset, more = _bracket_onset(solver, replace(state, friction=plate.friction), answer, position)
    after = replace(_accept(state, answer, position, plate), onset=onset)
    return Increment(after, "", answer.iterations + more, easy=answer.iterations <= EASY)


def drop_past_at_corner(state: PathState, position: Array) -> PathState:
    """Return the state without its past states where these are not on the straight line to a position (3,).

    Extrapolation around a corner of the path is meaningless.
    """
    ahead = position - state.position
    length = float(np.linalg.norm(ahead))
    for before in state.past:
        back = _coordinate(state, before.position, position)
        off_line = back * ahead / length - (before.position - state.position)
        if not (back < 0 and np.abs(off_line).max() < SAME_PLACE):
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


def turns_over(state: PathState, position: Array, u: Array) -> bool:
    """Return whether a press moves against its dead force, to displacements u (nodes, fields).

    The branch that grows from rest follows the force. A long increment past the depth at which the straight press
    buckles may land on the mirror image of that branch, which is in equilibrium as well.
    """
    dead = state.d.system.dead
    if not dead.any() or state.sheared or position[1:].any():
        return False
    return float(np.vdot(dead, u)) < 0 <= float(np.vdot(dead, state.u))


def find_equilibrium(
    solver: Solver,
    state: PathState,
    guess: Array,
    plate: Plate,
    pressed: NDArray[np.bool_] | None = None,
    tolerance: float = TOLERANCE,
    *,
    tangent: KeptTangent | None = None,
) -> Equilibrium:
    """Solve for the equilibrium from a first guess; on sections Coulomb friction is settled within each step.

    tangent : that of an earlier step near this one, see `fem.solve.newton.newton`; friction keeps the stiffness that
        the solver condensed.
    """
    system = state.d.system
    if plate.friction is not None and state.d.revolved:
        contact = CondensedFriction(system, solver, plate, pressed, keeps_long=tangent is not None)
        answer = iterate(contact, guess, tolerance=tolerance)
        # plain steps are damped, and reach some states that settled steps do not
        if answer.converged:
            return answer
        tangent = None
    # a dead load selects the side to which a press buckles, which an error of the last step must not do
    confirm = bool(system.dead.any())
    answer = newton(system, solver, guess, plate, pressed, tolerance=tolerance, confirm=confirm, tangent=tangent)
    if tangent is None or answer.converged:
        return answer
    tangent.drop()
    return newton(system, solver, guess, plate, pressed, tolerance=tolerance, confirm=confirm)


def path_at(state: PathState, answer: Equilibrium, position: Array, plate: Plate) -> PathState:
    """Return the path's state at a position (3,), from the converged equilibrium with the plate there."""
    friction, dissipated = state.friction, state.dissipated
    if friction is not None:
        friction, lost = plate_contact.advance_friction(state.skin, answer.state.u, plate)
        dissipated += lost
    return replace(
        state,
        position=position,
        q=answer.state.q,
        energy=answer.assembly.energy,
        least_J=answer.state.least_J,
        stability=answer.stability,
        friction=friction,
        dissipated=dissipated,
    )


def _accept(state: PathState, answer: Equilibrium, position: Array, plate: Plate) -> PathState:
    """Return the path's state at a position (3,), with the state before for extrapolation."""
    past = (*state.past[-1:], PastState(state.position, state.q, state.overlap))
    return replace(path_at(state, answer, position, plate), past=past)


def _set_direction(state: PathState, direction: Array) -> PathState:
    """Return the state with a new direction of motion (3,).

    In a new direction all points in contact are expected to stick at first.
    """
    if state.friction is None:
        return state
    if direction @ state.direction < 1 - 1e-9:
        state = replace(state, friction=coulomb_friction.expect_sticking(state.friction))
    return replace(state, direction=direction)


def longest_increment(state: PathState, depth: float, friction_step_factor: float) -> float:
    """Return the longest increment over D of a segment that goes down to a depth."""
    if state.friction is None:
        return LONGEST if state.d.revolved else LONGEST / 2
    press = min(FRICTION_PRESS, FRICTION_PRESS_SHARE * depth)
    return friction_step_factor * (press if state.direction[0] else FRICTION_SHEAR)


def _tolerance(state: PathState, *, passed: bool) -> float:
    """Return Newton's tolerance; with friction every state is solved fully, as the history keeps its error."""
    if not passed or state.friction is not None:
        return TOLERANCE
    return PASSED_TOLERANCE if state.d.revolved else SOLID_PASSED_TOLERANCE


def _solve_fully(solver: Solver, state: PathState) -> tuple[PathState, int]:
    answer = find_equilibrium(solver, state, state.q, state.plate)
    if answer.converged:
        state = replace(state, q=answer.state.q, energy=answer.assembly.energy, least_J=answer.state.least_J)
    return state, answer.iterations


def _bracket_onset(
    solver: Solver, state: PathState, answer: Equilibrium, position: Array
) -> tuple[tuple[Array, Array], int]:
    """Return the positions between which the first unstable direction appeared, and Newton's iterations."""
    stable, unstable, q, iterations = state.position, position, state.q, 0
    for _ in range(ONSET_HALVINGS):
        middle = (stable + unstable) / 2
        between = find_equilibrium(solver, state, (q + answer.state.q) / 2, state.plate_at(middle))
        iterations += between.iterations
        if not between.converged or between.stability.is_unknown:
            break
        if between.stability.is_unstable:
            unstable, answer = middle, between
        else:
            stable, q = middle, between.state.q
    return (stable, unstable), iterations
