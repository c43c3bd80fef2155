"""States of frictionless presses: read from the store of solved states, or solved and added to it.

The finite elements use lengths over D and stresses over E, so geometrically similar designs of one material law share
a path (see `fem.scene.Scene.dimensionless`). An answer holds the D and E of the design that was solved, and
`Answer.of` scales it to another one. Only depths that the store lacks are solved, from the undeformed state: a press
does not depend on the other depths of its path (see `fem.solvers.depth_ranges`).

Other paths are refused, because their states depend on more than a position: those of a shear on its direction, and
on the mesh that is fine where its contact ends; those with Coulomb friction on all loads before.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import Design
from geometry.loads import Load, Response
from geometry.messages import Progress
from studies.exploration.store import Outcome, Position, State, Store, position
from studies.output.provenance import versions
from studies.simulation.compare import follow

NAN = math.nan


@dataclass(frozen=True, slots=True)
class Answer:
    """A state that was solved, or the reason why it could not be, for the design that was solved.

    Attributes
    ----------
    D, E : of the design that was solved, mm and MPa.
    response : None if the solve did not reach the state; `status` and `message` give the reason.
    error_estimate : estimated relative error of the force; NaN if there is no estimate.
    seconds : time of the solve from the previous state, s.
    """

    D: float
    E: float
    response: Response | None
    status: str
    message: str
    error_estimate: float
    seconds: float

    def of(self, D: float, E: float) -> Answer:
        """Return the answer for a geometrically similar design: lengths scale with D, forces with E D^2."""
        message = self.message
        if message and D != self.D:
            message = f"solved at D = {self.D:g} mm: {message}"
        if self.response is None:
            return dataclasses.replace(self, D=D, E=E, message=message)
        length = D / self.D
        response = self.response.scaled(length, E / self.E * length**2)
        return dataclasses.replace(self, D=D, E=E, response=response, message=message)


def content(scene: Scene) -> dict[str, Any]:
    """Return everything on which presses depend except their depth, with the model's physics version.

    Raises
    ------
    ValueError
        A load is no press by an upright, frictionless plate, or the model is not axisymmetric.
    """
    if scene.model != "axisymmetric" or scene.coulomb is not None:
        raise ValueError(f"only frictionless presses of the axisymmetric model are stored; got model {scene.model}")
    values = scene.dimensionless()
    del values["loads"]
    return values | {"load": "press", "physics": PHYSICS[scene.model]}


def place(design: Design, load: Load) -> Position:
    """Return the position of a press over D."""
    return position(load.depth / design.D, 0.0)


def answers(
    scene: Scene, store: Store | None, progress: Progress | None = None
) -> tuple[dict[Position, Answer], str]:
    """Return the answers at all loads of a scene by position, and a warning if the store could not take new ones.

    Parameters
    ----------
    store : source and destination of solved states; None solves all of them and stores nothing.
    """
    known = store.states(content(scene)) if store is not None else {}
    wanted = {place(scene.design, load): load for load in scene.loads}
    missing = [load for at, load in wanted.items() if at not in known]
    trouble = ""
    if missing:
        solved = _solve(scene, missing, progress)
        if store is not None:
            trouble = store.add(content(scene), solved)
        known |= {state.position: state for state in solved}
    return {at: _answer(known[at]) for at in wanted}, trouble


@functools.cache
def _origin() -> str:
    """Return versions and commit, which take longer to find than some presses to solve, once per process."""
    return versions()


def _solve(scene: Scene, loads: Sequence[Load], progress: Progress | None) -> list[State]:
    """Solve a path to these loads and return its states for the store."""
    design, origin = scene.design, _origin()
    outcomes = follow(design, loads, scene.accuracy, scene.magnet, progress)
    states = []
    for load, outcome in zip(loads, outcomes, strict=True):
        response, error = outcome.response, outcome.error_estimate
        answer = {
            "D_mm": design.D,
            "E_MPa": design.E,
            "response": None if response is None else dataclasses.asdict(response),
            "error_estimate": None if math.isnan(error) else error,
            "message": outcome.message,
        }
        reached: Outcome = "ok" if response is not None else "failed"
        seconds = outcome.solution.seconds if outcome.solution else 0.0
        states.append(State(*place(design, load), reached, outcome.status, answer, seconds, origin))
    return states


def _answer(state: State) -> Answer:
    """Return the answer of a stored state."""
    values = state.answer
    estimate = values["error_estimate"]
    return Answer(
        D=values["D_mm"],
        E=values["E_MPa"],
        response=None if values["response"] is None else Response.restored(values["response"]),
        status=state.status,
        message=values["message"],
        error_estimate=NAN if estimate is None else estimate,
        seconds=state.seconds,
    )
