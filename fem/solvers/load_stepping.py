"""Following a path of loads, in units of D and E: the load is applied in increments.

The plate's position is v = (depth, shear along x, shear along y). Each load is a straight segment to its depth and
one to its shear. What the path has come to is one frozen state (`fem.solvers.path_state`). Increments of the load
lead from one to the next (`fem.solvers.load_increments`), or at once a predictor does (`fem.solvers.predictor`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fem.discretisation.symmetry_models import Discretisation
from fem.solvers.direct_solver import Solver
from fem.solvers.load_increments import Segment, follow_segment
from fem.solvers.newton import Stop
from fem.solvers.path_state import PathState, at_rest, glue, with_harmonics, with_predictor
from fem.solvers.predictor import predict
from geometry.arrays import Array


class Path:
    """A path of loads and the state that it has come to.

    Parameters
    ----------
    d : the model to start with.
    grip : height below the tip within which the skin is held, or None for a plate.
    tilt : of the plate, rad.
    raised : builds the model with harmonics, on the same mesh, that takes over from an axisymmetric one when the
        shear begins.
    rim : undeformed radius of the patch that is glued then; default: the contact radius.
    mu : coefficient of Coulomb friction, which takes the place of gluing, or None.
    friction_step_factor : increments with Coulomb friction are at most so many times their usual length.
    predictor : builds the model with one harmonic, and the same points on the skin, that goes ahead of one with more;
        without Coulomb friction only.
    kappa : number of the plate's stiffness on a section without Coulomb friction, see `fem.contact.plate_contact`;
        default: SECTION_KAPPA.

    Attributes
    ----------
    state : the present one. Only `go` replaces it.
    iterations : of Newton's method since the last load.
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
    ) -> None:
        self.raised, self._predictor, self._rim, self._friction_factor = raised, predictor, rim, friction_step_factor
        # factorisations of the model and of its predictor: their patterns are kept, and nothing else
        self._solver, self._reduced_solver = Solver(), Solver()
        state = at_rest(d, grip, tilt, mu, kappa)
        if predictor is not None and raised is None:
            state = with_predictor(state, predictor())
        self.state, self.iterations = state, 0

    def go(self, depth: float, shear: Array) -> Stop:
        """Move to a depth, then to a shear (2,); returns why it stopped on the way, empty if it did not."""
        reached = self._follow_load(depth, shear)
        self.state, self.iterations = reached.state, reached.iterations
        return reached.stop

    def close(self) -> None:
        """Give the factorisations' memory back."""
        self._solver.close()
        self._reduced_solver.close()

    def _follow_load(self, depth: float, shear: Array) -> Segment:
        """Where a load leads."""
        pressed = self._follow_straight(self.state, np.array([depth, *self.state.position[1:]]))
        if pressed.stop or np.array_equal(shear, pressed.state.position[1:]):
            return pressed
        moved = self._follow_straight(self._prepare_shear(pressed.state), np.array([depth, *shear]))
        return replace(moved, iterations=pressed.iterations + moved.iterations)

    def _follow_straight(self, state: PathState, goal: Array) -> Segment:
        """Where a straight segment to a position (3,) leads."""
        if not np.linalg.norm(goal - state.position):
            return Segment(state, "", 0)
        state, before = predict(self._solver, self._reduced_solver, state, goal)
        # there is nothing left to do if the prediction holds
        reached = follow_segment(self._solver, state, goal, friction_step_factor=self._friction_factor)
        return replace(reached, iterations=before + reached.iterations)

    def _prepare_shear(self, state: PathState) -> PathState:
        """The state with harmonics, and glued to the plate, where a shear needs that."""
        low, state = state, replace(state, sheared=True)
        if self.raised is not None and state.d.model == "axisymmetric":
            state = with_harmonics(state, self.raised())
            # its matrices have another pattern
            self._solver.close()
            self._solver = Solver()
            if self._predictor is not None:
                state = with_predictor(state, self._predictor(), low)
        if state.bond is None and state.friction is None:
            state = glue(state, self._rim)
        return state
