"""A path of loads in units of D and E, with the load applied in increments.

The plate's position is v = (depth, shear along x, shear along y). Each load is a straight segment to its depth and
another to its shear. The present state of the path is one frozen value (`fem.solve.path_state`). Load increments
lead from one state to the next (`fem.solve.load_increments`), unless a predictor reaches the end of the segment at
once (`fem.solve.predictor`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fem.model.symmetry_models import Discretisation
from fem.solve.direct_solver import Solver
from fem.solve.load_increments import Segment, follow_segment
from fem.solve.newton import Stop
from fem.solve.path_state import PathState, at_rest, glue, with_harmonics, with_predictor
from fem.solve.predictor import correct_press, predict
from geometry.arrays import Array


class Path:
    """A path of loads and its present state.

    Parameters
    ----------
    d : model at the start.
    grip : height below the top within which the skin is held, over D; None for a plate.
    tilt : tilt of the plate, rad.
    raised : builds the model with harmonics, on the same mesh, that replaces an axisymmetric one when the shear
        begins.
    rim : undeformed radius over D of the area that is glued then; default: the contact radius.
    mu : coefficient of Coulomb friction, which replaces gluing; or None.
    friction_step_factor : factor on the longest increments with Coulomb friction.
    predictor : builds the predictor, with one harmonic and the same skin points, of a model with more harmonics; only
        without Coulomb friction.
    kappa : stiffness number of the plate on a section without Coulomb friction, see `fem.model.plate_contact`;
        default: SECTION_KAPPA.
    rough : state of a press on another mesh, from which a press to the same depth starts.

    Attributes
    ----------
    state : the present state; only the methods replace it.
    iterations : Newton iterations of the last load.
    raised : as above.
    """

    def __init__(
        self,
        d: Discretisation,
        grip: float | None = None,
        tilt: float = 0.0,
        raised: Callable[[], Discretisation] | None = None,
        rim: float | None = None,
        mu: float | None = None,
        friction_step_factor: float = 1.0,
        predictor: Callable[[], Discretisation] | None = None,
        kappa: float | None = None,
        rough: PathState | None = None,
    ) -> None:
        self.raised, self._predictor, self._rim, self._friction_factor = raised, predictor, rim, friction_step_factor
        # one solver each for the model and its predictor: both keep the symbolic factorisation of their pattern
        self._solver, self._reduced_solver = Solver(), Solver()
        state = at_rest(d, grip, tilt, mu, kappa)
        if predictor is not None and raised is None:
            state = with_predictor(state, predictor())
        self.state, self.iterations, self._rough = state, 0, rough

    def go(self, depth: float, shear: Array) -> Stop:
        """Move to a depth, then to a shear (2,); return why the path stopped on the way, empty if it did not."""
        reached = self._follow_load(depth, shear)
        self.state, self.iterations = reached.state, reached.iterations
        return reached.stop

    def begin_shear(self) -> None:
        """Change to the model of a shear and glue the contact where required, before the plate moves sideways."""
        self.state = self._prepare_shear(self.state)

    def restart(self, state: PathState) -> None:
        """Return to an earlier state of this path."""
        if state.d is not self.state.d:
            self._renew_solver()
        self.state = state

    def close(self) -> None:
        """Free the memory of the factorisations."""
        self._solver.close()
        self._reduced_solver.close()

    def _renew_solver(self) -> None:
        """Replace the solver, because the matrices of another model have another pattern."""
        self._solver.close()
        self._solver = Solver()

    def _follow_load(self, depth: float, shear: Array) -> Segment:
        """Follow one load: press to its depth, then shear."""
        pressed = self._follow_straight(self.state, np.array([depth, *self.state.position[1:]]))
        if pressed.stop or np.array_equal(shear, pressed.state.position[1:]):
            return pressed
        moved = self._follow_straight(self._prepare_shear(pressed.state), np.array([depth, *shear]))
        return replace(moved, iterations=pressed.iterations + moved.iterations)

    def _follow_straight(self, state: PathState, goal: Array) -> Segment:
        """Follow a straight segment to a position (3,), by the predictor where possible."""
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

    def _prepare_shear(self, state: PathState) -> PathState:
        """Return the state with harmonics, and glued to the plate, where a shear requires that."""
        low, state = state, replace(state, sheared=True)
        if self.raised is not None and state.d.model == "axisymmetric":
            state = with_harmonics(state, self.raised())
            self._renew_solver()
            if self._predictor is not None:
                state = with_predictor(state, self._predictor(), low)
        if state.bond is None and state.friction is None:
            state = glue(state, self._rim)
        return state
