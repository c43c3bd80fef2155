"""The steps along a straight segment of a path (`march`), and one increment of the load.

An increment starts from the extrapolated last states, unknowns and contact, and is solved by Newton's method.
It returns the next state, or the present one with the reason why there is no next one. The increments of a
segment are halved where one fails and grow again where they converge easily. Intermediate states are solved to a
looser tolerance. Steps in time (`fem.analyses.timed_path`) have lengths that follow from their errors. A function may
see every step (`watched`), for progress and to end a path.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from fem.model import coulomb_friction, plate_contact
from fem.model.plate_contact import Plate
from fem.solution import Stop
from fem.solve.active_set import ActiveSet, KeptTangent
from fem.solve.condensed_friction import CondensedFriction
from fem.solve.newton import TOLERANCE, Equilibrium, iterate
from fem.solve.path_state import PastState, PathState
from geometry.arrays import Array, Mask

LONGEST = 0.25
"""Longest increment over D without friction, on sections. Tetrahedra distort more at the edge of the contact: theirs
are half as long."""
FRICTION_PRESS, FRICTION_SHEAR, FRICTION_PRESS_SHARE = 0.02, 0.08, 0.2
"""Longest increments over D with Coulomb friction, whose result depends on the path: the error is of second order in
the increment. Those of a press are also at most the share FRICTION_PRESS_SHARE of its depth."""
SHORTEST = 1e-3
"""Increment over D, or over the length of a segment shorter than D, below which the path stops: if even such a small
increment fails, the path has reached a limit."""
PASSED_TOLERANCE = 1e-4
"""Newton tolerance of intermediate states without friction, and of predictions: the next increment, or the
correction, removes the remaining residual. A rough state may lie on the side of another branch."""
EASY = 7
"""Newton iterations up to which an increment is easy, and the next one may be longer."""
SMOOTH = 12
"""Newton iterations up to which an increment is known to stay on its branch. Beside a crease increments that land on
another one take 29 or more."""
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
    """Call a function before each step of a path of this context, with the completed share of its segment.

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
    if (watch := _watch.get()) is not None:
        watch(share)


State = TypeVar("State")


@dataclass(frozen=True, slots=True)
class Reached(Generic[State]):
    """Where a path is: after one increment, within a segment, or after one or several.

    state : the last state reached; after a failure without its past, for the path is too curved there.
    stop : why the next one, or the goal, was not reached; empty if it was.
    iterations : Newton iterations.
    place, step : place on the segment, and length of the next step.
    """

    state: State
    stop: Stop
    iterations: int
    place: float = 0.0
    step: float = 0.0


def march(
    start: Reached[State], end: float, shortest: float, attempt: Callable[[Reached[State]], Sequence[Reached[State]]]
) -> Iterator[Reached[State]]:
    """Follow a segment to the place `end` in steps; yield each state, and the last one again where the path stops.

    shortest : step below which a failure ends the path.
    attempt : returns one or more next states; or the present one with a reason and a shorter step.
    """
    now, begin = start, start.place
    while now.place < end and not (now.stop and now.step < shortest):
        report((now.place - begin) / (end - begin))
        iterations = now.iterations
        for after in attempt(now):
            now = replace(after, iterations=iterations + after.iterations)
            if not now.stop:
                yield now
    if now.stop:
        yield now


def march_in_increments(
    state: State, longest: float, shortest: float, increment: Callable[[State, float, float], Reached[State]]
) -> Iterator[Reached[State]]:
    """Follow a segment in increments that are halved where one fails; lengths are shares of the segment's.

    longest, shortest : longest increment, and length below which a failure ends the path.
    increment : leads from a state to a place, by an increment of a length.
    """
    longest = min(longest, 1.0)

    def attempt(now: Reached[State]) -> list[Reached[State]]:
        # the tolerance of 1e-3 avoids a tiny last increment
        target = 1.0 if 1 - now.place <= 1.001 * now.step else now.place + now.step
        tried = increment(now.state, target, now.step)
        if tried.stop:
            return [replace(tried, place=now.place, step=(target - now.place) / 2)]
        step = GROWTH * now.step if tried.iterations <= EASY else now.step
        return [replace(tried, place=target, step=min(step, longest))]

    return march(Reached(state, "", 0, step=longest), 1.0, shortest, attempt)


def follow_segment(
    tangent: KeptTangent,
    state: PathState,
    goal: Array,
    tolerance: float = TOLERANCE,
    *,
    friction_step_factor: float = 1.0,
) -> Reached[PathState]:
    """Move in a straight line to a position (3,) in increments.

    tolerance : of the goal without friction; PASSED_TOLERANCE where it too is only passed, for a prediction or as an
        increment of a longer segment.
    """
    start, reached = state.position, Reached(state, "", 0)
    length = float(np.linalg.norm(goal - start))
    if length == 0:
        return reached
    longest = longest_increment(state, start, goal, friction_step_factor) / length

    def increment(state: PathState, target: float, step: float) -> Reached[PathState]:
        position = goal if target == 1 else start + target * (goal - start)
        # with friction every state is solved fully, as the history keeps its error
        allowed = TOLERANCE if state.friction is not None else tolerance if target == 1 else PASSED_TOLERANCE
        return apply_increment(tangent, state, position, allowed, accept=step * length <= LONGEST_DOUBTFUL)

    state = turn(state, (goal - start) / length)
    for after in march_in_increments(state, longest, SHORTEST * min(1.0, 1 / length), increment):
        reached = after
    if not reached.stop or state.friction is not None:
        return reached
    # the last state was only passed
    state, answer = reached.state, find_equilibrium(tangent, reached.state, reached.state.q, reached.state.plate)
    if answer.converged:
        state = replace(state, q=answer.state.q, energy=answer.assembly.energy, least_J=answer.state.least_J)
    return Reached(state, reached.stop, reached.iterations + answer.iterations)


def apply_increment(
    tangent: KeptTangent, state: PathState, position: Array, tolerance: float, *, accept: bool
) -> Reached[PathState]:
    """Move to a position (3,) in one increment.

    accept : accept the result although it is the first with an unstable direction or with crushed silicone.
    """
    guess, plate = extrapolate_unknowns(state, position), state.plate_at(position)
    if state.friction is not None:
        moved = plate_contact.displacements_along_plate(
            state.skin, state.d.system.state(guess).u, plate if state.past else state.plate
        )
        plate = replace(plate, friction=coulomb_friction.expect_motion(state.friction, moved))
    expected = extrapolate_contact(state, position)
    answer = find_equilibrium(tangent, state, guess, plate, expected, tolerance)
    # an increment that is the first to be unstable or crushed may have jumped to another branch
    crushed = answer.state.least_J < CRUSHED <= state.least_J
    first = answer.stability.is_unstable and not state.stability.is_unstable
    doubtful = (first or crushed) and not accept
    turned = answer.converged and turns_over(state, position, answer.state.u)
    if not answer.converged or doubtful or turned:
        return Reached(replace(state, past=(), smooth=False), answer.reason or "no_convergence", answer.iterations)
    after, more = _accept(state, answer, position, plate), 0
    if first and state.onset is None:
        onset, more = _bracket_onset(tangent, replace(state, friction=plate.friction), answer, position)
        after = replace(after, onset=onset, before_onset=after.past[-1])
    return Reached(after, "", answer.iterations + more)


def extrapolate_unknowns(state: PathState, position: Array) -> Array:
    """Return the unknowns at a position (3,), from the polynomial through the past and present states."""
    ahead = position - state.position
    length = float(np.linalg.norm(ahead))
    at = [*(float((before.position - state.position) @ ahead) / length for before in state.past), 0.0]
    return extrapolate(at, [*(before.q for before in state.past), state.q], length)


def extrapolate(at: Sequence[float], values: Sequence[Array], ahead: float) -> Array:
    """Return the value at a place `ahead` of the polynomial through values (n,) at places, by Lagrange's polynomials.

    They need no equal spacing, and steps differ in length.
    """
    shares = [math.prod((ahead - u) / (t - u) for u in at if u != t) for t in at]
    return np.asarray(sum(share * value for share, value in zip(shares, values, strict=True)))


def extrapolate_contact(state: PathState, position: Array) -> Mask | None:
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
    tangent: KeptTangent,
    state: PathState,
    guess: Array,
    plate: Plate,
    pressed: Mask | None = None,
    tolerance: float = TOLERANCE,
    *,
    keeps_long: bool = False,
) -> Equilibrium:
    """Solve for the equilibrium from a first guess; on sections Coulomb friction is settled within each step.

    tangent : of the model; that of an earlier state serves for the first step where it is near the guess.
    keeps_long : keep the tangent of an earlier step for long; friction keeps the stiffness that the solver condensed.
    """
    system = state.d.system
    if plate.friction is not None and state.d.revolved:
        settled = CondensedFriction(system, tangent.solver, plate, pressed, keeps_long=keeps_long)
        answer = iterate(settled, guess, tolerance=tolerance)
        # plain steps are damped, and reach some states that settled steps do not
        if answer.converged:
            return answer
        keeps_long = False
    if not keeps_long and not tangent.is_near(system.state(guess), plate):
        tangent.drop()
    # a dead load selects the side to which a press buckles, which an error of the last step must not do
    confirm, starts_anew = bool(system.dead.any()), not tangent.stability.is_stable
    contact = ActiveSet(system, tangent, plate, pressed, keeps_long=keeps_long)
    answer = iterate(contact, guess, tolerance=tolerance, confirm=confirm)
    if starts_anew or answer.converged:
        return answer
    tangent.drop()
    contact = ActiveSet(system, tangent, plate, pressed, keeps_long=False)
    return iterate(contact, guess, tolerance=tolerance, confirm=confirm)


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
    smooth = state.smooth and answer.iterations <= SMOOTH
    return replace(path_at(state, answer, position, plate), past=past, smooth=smooth)


def turn(state: PathState, direction: Array) -> PathState:
    """Return the state with a direction (3,) of motion.

    Around a corner extrapolation is meaningless, and all points in contact are expected to stick at first.
    """
    if direction @ state.direction > 1 - 1e-9:
        return state
    friction = None if state.friction is None else coulomb_friction.expect_sticking(state.friction)
    return replace(state, direction=direction, past=(), friction=friction)


def longest_increment(state: PathState, start: Array, goal: Array, friction_step_factor: float) -> float:
    """Return the longest increment over D of a segment between two positions (3,)."""
    if state.friction is None:
        return LONGEST if state.d.revolved else LONGEST / 2
    press = min(FRICTION_PRESS, FRICTION_PRESS_SHARE * float(max(start[0], goal[0])))
    # a segment that is both is bounded by the part that bounds it more
    depth, shear = abs(goal[0] - start[0]), float(np.linalg.norm(goal[1:] - start[1:]))
    length = float(np.linalg.norm(goal - start))
    bounds = [most * (length / part) for most, part in ((press, depth), (FRICTION_SHEAR, shear)) if part]
    return friction_step_factor * min(bounds)


def _bracket_onset(
    tangent: KeptTangent, state: PathState, answer: Equilibrium, position: Array
) -> tuple[tuple[Array, Array], int]:
    """Return the positions between which the first unstable direction appeared, and Newton's iterations."""
    stable, unstable, q, iterations = state.position, position, state.q, 0
    for _ in range(ONSET_HALVINGS):
        middle = (stable + unstable) / 2
        between = find_equilibrium(tangent, state, (q + answer.state.q) / 2, state.plate_at(middle))
        iterations += between.iterations
        if not between.converged or between.stability.is_unknown:
            break
        if between.stability.is_unstable:
            unstable, answer = middle, between
        else:
            stable, q = middle, between.state.q
    return (stable, unstable), iterations
