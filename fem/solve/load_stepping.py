"""A path of loads in units of D and E, with the load applied in increments.

The plate's position is v = (depth, shear along x, shear along y). Each load is a straight segment to its depth and
another to its shear. A state of the path is one frozen value (`fem.solve.path_state`), and `Path.advance` leads from
it to that under another load; so do searches for a force and steps in time. Load increments lead from one state to
the next (`fem.solve.load_increments`), unless a prediction reaches the end of the segment at once. It is that of a
reduced model: one harmonic on the same mesh, in which most of the solution is.

The predictor follows a segment in increments, which are cheap for it. At its end the difference of the two models at
the start is added to the prediction, and the full model is corrected once, without increments of its own. Where that
does not converge, or leads to another branch, the full model takes its own increments.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np

from fem.model import plate_contact
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.symmetry_models import Discretisation, MeshSpecification, raise_harmonics
from fem.solve.active_set import KeptTangent
from fem.solve.load_increments import (
    CRUSHED,
    LONGEST,
    PASSED_TOLERANCE,
    Reached,
    apply_increment,
    find_equilibrium,
    follow_segment,
    path_at,
    turn,
    turns_over,
)
from fem.solve.newton import TOLERANCE
from fem.solve.path_state import PathState, at_rest, glue, with_harmonics, with_predictor
from geometry.arrays import Array

CLOSE = 0.004
"""Gap up to which a point of the skin is expected to be in contact, over the depth or the shear, whichever is less.
The prediction leaves small gaps where the tip rolls onto the plate, and each point that is wrong has to switch. With
larger gaps more points switch."""


@dataclass(frozen=True, slots=True)
class PathModels:
    """The models of one path of loads.

    Attributes
    ----------
    first : model at the start of the path.
    raised : model with harmonics on the same mesh that replaces `first` when the shear begins.
    predictor : model that predicts the states of the model with harmonics: one harmonic on the same mesh; only
        without Coulomb friction.
    glued_radius : undeformed radius over D of the area that is glued when the shear begins; default: the contact
        radius.
    grip : height over D within which the skin is gripped; None under a plate.
    tilt : tilt of the plate, rad.
    mu : coefficient of Coulomb friction, or None.
    kappa : stiffness number of the plate under an upright press of a section without friction.
    friction_step_factor : factor on the longest increments with Coulomb friction.
    tolerance : Newton's tolerance of the states without friction.
    """

    first: MeshSpecification
    raised: MeshSpecification | None = None
    predictor: MeshSpecification | None = None
    glued_radius: float | None = None
    grip: float | None = None
    tilt: float = 0.0
    mu: float | None = None
    kappa: float = SECTION_KAPPA
    friction_step_factor: float = 1.0
    tolerance: float = TOLERANCE


class Path:
    """The models and solvers of a path of loads; its states are frozen values, so a path may go on from any of them.

    Attributes
    ----------
    rest : the state at rest, with its predictor.
    """

    def __init__(self, models: PathModels) -> None:
        self._models = models
        self.rest = at_rest(models.first.build(), models.grip, models.tilt, models.mu, models.kappa)
        # one solver for each model and one for the predictor: each keeps the symbolic factorisation of its pattern
        self._tangents, self._predicting = {self.rest.d.model: KeptTangent()}, KeptTangent()
        if models.predictor is not None and models.raised is None:
            self.rest = with_predictor(self.rest, models.predictor.build())
        self._passed = [self.rest]

    def advance(self, state: PathState, position: Array) -> Reached[PathState]:
        """Move from a state to a position (3,): first to its depth, then to its shear."""
        pressed = self.follow_straight(state, np.array([position[0], *state.position[1:]]))
        if pressed.stop or np.array_equal(position[1:], state.position[1:]):
            return pressed
        sheared = self.follow_straight(self.begin_shear(pressed.state), position)
        return replace(sheared, iterations=pressed.iterations + sheared.iterations)

    def apply(self, state: PathState, position: Array) -> Reached[PathState]:
        """Do as `advance`, but a press without history does not depend on the states before it, see `_press`."""
        depth = float(position[0])
        if state.has_history or depth == state.position[0]:
            return self.advance(state, position)
        pressed = self._press(state, depth)
        if pressed.stop:
            return pressed
        reached = self.advance(pressed.state, position)
        return replace(reached, iterations=pressed.iterations + reached.iterations)

    def _press(self, state: PathState, depth: float) -> Reached[PathState]:
        """Move an elastic press to a depth over D: in one increment where that is short and both states are sound.

        Otherwise it starts from rest: beyond an instability or a crease a press has several equilibria, and from rest
        it reaches one that no other depth of its list decides. So it does where it stops.
        """
        tangent, goal, ahead = self._tangents[state.d.model], np.array([depth, 0.0, 0.0]), depth - state.position[0]
        iterations = 0
        if abs(ahead) < min(depth, LONGEST) and state.is_sound_press:
            # the contact changes point by point: a parabola through three presses takes 4 to 12 % more iterations
            # than the line through two
            line = replace(state, past=state.past[-1:])
            here = turn(line, np.array([math.copysign(1.0, ahead), 0.0, 0.0]))
            followed = apply_increment(tangent, here, goal, self._models.tolerance, accept=False)
            if not followed.stop and followed.state.is_sound_press:
                return followed
            iterations = followed.iterations
        passed = self._pass_to(depth)
        iterations += passed.iterations
        if passed.stop:
            return replace(passed, iterations=iterations)
        reached = follow_segment(tangent, passed.state, goal, self._models.tolerance)
        after = replace(reached.state, smooth=reached.state.smooth and passed.state.is_sound_press)
        return replace(reached, state=after, iterations=iterations + reached.iterations)

    def _pass_to(self, depth: float) -> Reached[PathState]:
        """Return the last state that a press from rest passes, in the longest increments, before a depth over D.

        These states do not depend on the depth, so all presses of the path share them.
        """
        iterations, count = 0, max(math.ceil(depth / LONGEST - 1.001), 0)
        while len(self._passed) <= count:
            goal = np.array([len(self._passed) * LONGEST, 0.0, 0.0])
            reached = follow_segment(self._tangents[self.rest.d.model], self._passed[-1], goal, PASSED_TOLERANCE)
            iterations += reached.iterations
            if reached.stop:
                return replace(reached, iterations=iterations)
            self._passed.append(reached.state)
        return Reached(self._passed[count], "", iterations)

    def begin_shear(self, low: PathState) -> PathState:
        """Return a state in the model of a shear, with glued contact where required, before the plate moves."""
        state, (raised, predictor) = replace(low, sheared=True), self._shear_models
        if raised is not None and state.d.model == "axisymmetric":
            state = with_harmonics(state, raised)
            if predictor is not None:
                state = with_predictor(state, predictor, low)
        if state.bond is None and state.friction is None:
            state = glue(state, self._models.glued_radius)
        return state

    @functools.cached_property
    def _shear_models(self) -> tuple[Discretisation | None, Discretisation | None]:
        """The model with harmonics and its predictor, which all shears of the path share; None without."""
        raised, predictor = self._models.raised, self._models.predictor
        if raised is None:
            return None, None
        return raised.build(), None if predictor is None else predictor.build()

    def follow_straight(self, state: PathState, goal: Array) -> Reached[PathState]:
        """Move in a straight line to a position (3,), whose depth and shear may both differ; by a prediction where
        possible."""
        if np.array_equal(goal, state.position):
            return Reached(state, "", 0)
        tangent = self._tangents.setdefault(state.d.model, KeptTangent())
        state, before = predict(tangent, self._predicting, state, goal)
        # returns at once if the prediction has reached the goal
        tolerance, factor = self._models.tolerance, self._models.friction_step_factor
        reached = follow_segment(tangent, state, goal, tolerance, friction_step_factor=factor)
        return replace(reached, iterations=before + reached.iterations)


def predict(tangent: KeptTangent, predicting: KeptTangent, state: PathState, goal: Array) -> tuple[PathState, int]:
    """Move to a position (3,) by correcting a prediction; return the state and Newton's iterations of both models.

    It is the present state, with the predictor moved, where that fails.
    """
    before = state.reduced
    # the predictor may have stopped earlier than the full model, and is then of no use
    if before is None or not np.array_equal(before.position, state.position):
        return state, 0
    low, high = before.d.system, state.d.system
    added = state.q - raise_harmonics(low, high, before.q)
    if before.bond is None:
        before = replace(before, bond=state.bond)
    ahead = follow_segment(predicting, before, goal, PASSED_TOLERANCE)
    state = replace(state, reduced=ahead.state)
    if ahead.stop:
        return state, ahead.iterations
    position, q = goal, ahead.state.q
    # another number of unstable directions means another branch: the prediction serves up to the onset only
    if ahead.state.stability != state.stability:
        last = ahead.state.before_onset
        if last is None or before.onset is not None:
            return state, ahead.iterations
        position, q = last.position, last.q
    after, iterations = _correct(tangent, state, added + raise_harmonics(low, high, q), position)
    return after, ahead.iterations + iterations


def _correct(tangent: KeptTangent, state: PathState, guess: Array, goal: Array) -> tuple[PathState, int]:
    """Return the state at a position (3,) from a first guess, or the present one where that fails or is on another
    branch; and Newton's iterations.
    """
    plate, system = state.plate_at(goal), state.d.system
    close = CLOSE * min(float(np.linalg.norm(goal[1:] - state.position[1:])), float(goal[0]))
    pressed = None if state.grip else plate_contact.overlap(state.skin, system.state(guess).u, plate) > -close
    answer = find_equilibrium(tangent, state, guess, plate, pressed)
    crushed = answer.state.least_J < CRUSHED
    sound = answer.stability == state.stability and crushed == (state.least_J < CRUSHED)
    if not answer.converged or not sound or turns_over(state, goal, answer.state.u):
        return state, answer.iterations
    # intermediate states are unknown, so the next guess cannot be extrapolated
    return replace(path_at(state, answer, goal, plate), past=()), answer.iterations
