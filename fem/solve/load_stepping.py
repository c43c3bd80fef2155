"""A path of loads in units of D and E, with the load applied in increments.

The plate's position is v = (depth, shear along x, shear along y). Each load is a straight segment to its depth and
another to its shear. The present state of the path is one frozen value (`fem.solve.path_state`). Load increments
lead from one state to the next (`fem.solve.load_increments`), unless a predictor reaches the end of the segment at
once (`fem.solve.predictor`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fem.model.symmetry_models import MeshSpecification
from fem.solve.direct_solver import Solver
from fem.solve.load_increments import Segment, follow_segment
from fem.solve.newton import Stop
from fem.solve.path_state import PathState, glue, with_harmonics, with_predictor
from fem.solve.predictor import correct_press, predict
from geometry.arrays import Array


@dataclass(frozen=True, slots=True)
class PathModels:
    """The models of one path of loads.

    Attributes
    ----------
    first : model at the start of the path.
    raised : model with harmonics on the same mesh that replaces `first` when the shear begins; the sideways stability
        of an axisymmetric press is also computed in it.
    predictor : model that predicts the states of the model with harmonics, or of tetrahedra: one harmonic on the same
        mesh, or a section with harmonics; only without Coulomb friction.
    glued_radius : undeformed radius over D of the area that is glued when the shear begins; default: the contact
        radius.
    rough : press on another mesh, from which that on this one starts.
    """

    first: MeshSpecification
    raised: MeshSpecification | None = None
    predictor: MeshSpecification | None = None
    glued_radius: float | None = None
    rough: PathState | None = None


class Path:
    """A path of loads and its present state.

    Parameters
    ----------
    state : state at rest (`fem.solve.path_state.at_rest`).
    models : models of the path; default: that of the state alone.
    friction_step_factor : factor on the longest increments with Coulomb friction.

    Attributes
    ----------
    state : the present state; only the methods replace it.
    iterations : Newton iterations of the last load.
    """

    def __init__(self, state: PathState, models: PathModels | None = None, friction_step_factor: float = 1.0) -> None:
        self._models, self._friction_factor = models, friction_step_factor
        # one solver each for the model and its predictor: both keep the symbolic factorisation of their pattern
        self._solver, self._reduced_solver = Solver(), Solver()
        if models is not None and models.predictor is not None and models.raised is None:
            state = with_predictor(state, models.predictor.build())
        self.state, self.iterations, self._rough = state, 0, None if models is None else models.rough

    def go(self, depth: float, shear: Array) -> Stop:
        """Move to a depth, then to a shear (2,); return why the path stopped on the way, empty if it did not."""
        reached = self._follow_straight(np.array([depth, *self.state.position[1:]]))
        self.state, self.iterations = reached.state, reached.iterations
        if not reached.stop and not np.array_equal(shear, self.state.position[1:]):
            self.begin_shear()
            reached = self._follow_straight(np.array([depth, *shear]))
            self.state, self.iterations = reached.state, self.iterations + reached.iterations
        return reached.stop

    def begin_shear(self) -> None:
        """Change to the model of a shear and glue the contact where required, before the plate moves sideways."""
        low, models = self.state, self._models
        state = replace(low, sheared=True)
        if models is not None and models.raised is not None and state.d.model == "axisymmetric":
            state = with_harmonics(state, models.raised.build())
            self._solver = Solver()  # the matrices of another model have another pattern
            if models.predictor is not None:
                state = with_predictor(state, models.predictor.build(), low)
        if state.bond is None and state.friction is None:
            state = glue(state, None if models is None else models.glued_radius)
        self.state = state

    def restart(self, state: PathState) -> None:
        """Return to an earlier state of this path."""
        if state.d is not self.state.d:
            self._solver = Solver()  # the matrices of another model have another pattern
        self.state = state

    def _follow_straight(self, goal: Array) -> Segment:
        """Follow a straight segment to a position (3,), by the predictor where possible."""
        state = self.state
        if not np.linalg.norm(goal - state.position):
            return Segment(state, "", 0)
        if self._rough is None:
            state, before = predict(self._solver, self._reduced_solver, state, goal)
        else:
            state, before = correct_press(self._solver, state, self._rough, goal)
            self._rough = None
        # returns at once if the prediction has reached the goal
        reached = follow_segment(self._solver, state, goal, friction_step_factor=self._friction_factor)
        return replace(reached, iterations=before + reached.iterations)
