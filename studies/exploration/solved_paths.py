"""States of a path of loads, each solved once for all studies: taken from the store, or solved and put into it.

The finite elements work with lengths over D and stresses over E, so similar designs of one law are one path, see
`fem.scene.Scene.dimensionless`. An answer holds the D and E of the design that was solved; `Answer.of` scales it.
Only positions that the store lacks are solved, in the order of the path, from rest.

With Coulomb friction a state depends on the whole way to it: there the way is a part of the path's content. A path
that is sheared has another mesh than a press, even for the press before the shear, so it is a path of its own.
"""

from __future__ import annotations

import dataclasses
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
    """What is known of a state, in the units of the design that was solved.

    Attributes
    ----------
    D, E : of that design, mm and MPa.
    response : None where the solve did not get there; `status` and `message` say why.
    error_estimate : relative error of the force, NaN where it is not known.
    seconds : that the solve took from the state before.
    """

    D: float
    E: float
    response: Response | None
    status: str
    message: str
    error_estimate: float
    seconds: float

    def of(self, D: float, E: float) -> Answer:
        """The same state of a similar design."""
        message = self.message
        if message and D != self.D:
            message = f"solved at D = {self.D:g} mm: {message}"
        if self.response is None:
            return dataclasses.replace(self, D=D, E=E, message=message)
        length = D / self.D
        response = self.response.scaled(length, E / self.E * length**2)
        return dataclasses.replace(self, D=D, E=E, response=response, message=message)


def content(scene: Scene) -> dict[str, Any]:
    """What a path's states depend on beside their positions, with the version of the model's physics."""
    values = scene.dimensionless()
    way = values.pop("loads")
    first = {name: value for name, value in way[0].items() if name not in ("depth", "shear")}
    if scene.coulomb is not None:
        first["way"] = [[load["depth"], load["shear"]] for load in way]
    return values | {"load": first, "sheared": scene.sideways, "physics": PHYSICS[scene.model]}


def place(design: Design, load: Load) -> Position:
    """Where a load takes plate or grip, over D."""
    return position(load.depth / design.D, load.shear / design.D)


def answers(
    scene: Scene, store: Store | None, progress: Progress | None = None
) -> tuple[dict[Position, Answer], str]:
    """The states at all loads of a scene by their positions; and why the store could not take new ones, or "".

    Parameters
    ----------
    store : None solves all of them, and keeps nothing.
    """
    kept = store.states(content(scene)) if store is not None else {}
    wanted = {place(scene.design, load): load for load in scene.loads}
    missing = [load for at, load in wanted.items() if at not in kept]
    if missing and scene.coulomb is not None:
        missing = list(scene.loads)
    trouble = ""
    if missing:
        solved = _solve(scene, missing, progress)
        if store is not None:
            trouble = store.add(content(scene), solved)
        kept |= {state.position: state for state in solved}
    return {at: _answer(kept[at]) for at in wanted}, trouble


def _solve(scene: Scene, loads: Sequence[Load], progress: Progress | None) -> list[State]:
    design, made = scene.design, versions()
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
        states.append(State(*place(design, load), reached, outcome.status, answer, seconds, made))
    return states


def _answer(state: State) -> Answer:
    kept = state.answer
    estimate = kept["error_estimate"]
    return Answer(
        D=kept["D_mm"],
        E=kept["E_MPa"],
        response=None if kept["response"] is None else Response(**_tuples(kept["response"])),
        status=state.status,
        message=kept["message"],
        error_estimate=NAN if estimate is None else estimate,
        seconds=state.seconds,
    )


def _tuples(values: dict[str, Any]) -> dict[str, Any]:
    """JSON knows lists only."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
