"""The answers to a request of the page, part by part, in the order in which they are ready, and what they keep.

The picture comes first, and everything else when no newer request has come for a moment: the sensor in 3D, error
estimates, the decoded load, the curve and the panels of numbers (`panels`). What depends on the design alone is kept
while only the load changes, and paths of loads are, so that a small change of a state costs little.

A path belongs to a mesh and a kind of load (`_key`). A press starts at rest, and a shear at the kept press below it,
as in `fem.equilibrium.solve`: the answers are the same. Changes that no finite element sees, such as E, the magnet's
remanence or the Hall elements, find the state that is there already.

While a hand moves, the picture may start at the last state instead, which takes half the time. Without Coulomb
friction equilibrium depends on the load alone, so both ways differ by the tolerance of Newton's method only. The
answer with error estimates, which follows when the hand rests, always takes the first way.

Numbers with error estimates, curve, stability, vibration and loop come from the store of solved states and are kept
there, by a thread that the answers do not wait for. The pictures show the deformed body, which the store does not
hold: it is solved for each time, and so is a state where the path stops.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.accuracy import LEVELS, coarser
from fem.equilibrium import sideways_model, with_estimates
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.scene import FIRST_TOUCH, Scene
from fem.solution import Solution
from fem.solve.load_case_models import graded_depth, path_models
from fem.solve.load_increments import Reached
from fem.solve.load_stepping import Path
from fem.solve.path_state import PathState
from geometry.loads import ANSWERED
from studies.mechanics import path_solver, stored_answers
from studies.mechanics.store import Store
from studies.web import state_answers, state_exports, state_pictures
from studies.web.explorer_state import ExplorerState, Request
from studies.web.panels import ANSWERED_PANELS, Memory, When

Data = dict[str, Any]
Answer = tuple[str, str, Data]
"""A part, its level and its data."""
MOST_PATHS = 4
"""Most paths that are kept: two designs side by side, each with its coarser mesh for the error estimates."""


class Answers:
    """Computes parts in one process, and keeps paths and what depends on the design alone."""

    def __init__(self, store: Store) -> None:
        self.paths, self.memory = KeptPaths(), Memory(store)
        self._design: dict[str, Any] = {}

    def all_of(self, request: Request, level: str) -> Iterator[Answer | None]:
        """Yield the parts of a request at a level; None stands before what can wait for a hand that rests."""
        state, parts = request.state, request.parts
        rests = level == state.level
        if rests and level == "standard":
            yield from self._panels(request, level, "first")
        if not {"state", "sensor3d", "field_lines"}.isdisjoint(parts):
            yield from self._solved(request, level)
        yield None
        if rests and level == "quick":
            yield from self._panels(request, level, "first")
        # what depends on the design alone is not sent in a coarse form again while only the load changes
        shown = state_answers.mechanics(state.design), state.magnet, request.sensor is None
        if rests or self._design.get(request.side) != shown:
            if "curve" in parts:
                yield "curve", level, self._curve(request, level)
            yield from self._panels(request, level, "design")
            self._design[request.side] = shown
        if rests:
            yield from self._panels(request, level, "rest")
        yield from self._panels(request, level, "load")

    def export(self, name: str, request: Request) -> bytes:
        """Return a file of a state at its own level."""
        state = request.state
        if name == "curve.csv":
            return state_exports.of_curve(self._curve(request, state.level))
        scene = _scene_of(state, state.level)
        # the deformed body is not in the store
        solution = self.paths.solve(scene) if name == "fields.vtu" else self._estimated(scene)
        return state_exports.of_solution(name, state, solution, request.sensor)

    def forget(self) -> None:
        """Free everything that is kept."""
        self.paths = KeptPaths()
        self.memory.clear()
        self._design.clear()

    def _panels(self, request: Request, level: str, when: When) -> Iterator[Answer]:
        """Yield the answers of the panels of numbers that are due."""
        for panel in ANSWERED_PANELS:
            if panel.when == when and panel.name in request.parts:
                for reached, data in panel.answers(request, level, self.memory):
                    yield panel.name, reached, data

    def _solved(self, request: Request, level: str) -> Iterator[Answer | None]:
        """Yield the parts that belong to one solution: the state, again with its error estimates, and the figures."""
        state, parts, made = request.state, request.parts, request.sensor
        calibration = state_answers.NOT_CALIBRATED if request.made is not None and made is None else ""
        decoder = self.memory.results.values.get(("decoder", state.design))
        scene = _scene_of(state, level)
        solution = self.paths.solve(scene, moving=level == "quick")
        section = (
            {"section": state_pictures.section(state.design, solution, state.magnet)} if "state" in parts else {}
        )

        def answer() -> Answer:
            return "state", level, section | state_answers.numbers(state, solution, decoder, made, calibration)

        if "state" in parts:
            yield answer()
        yield None
        if "field_lines" in parts:
            yield "field_lines", level, state_pictures.field_lines(state.design, solution)
        if "sensor3d" in parts:
            yield "sensor3d", level, state_pictures.surface(solution)
        if "state" in parts:
            stops = solution.status not in ANSWERED
            solution = self.paths.solve(scene, sideways=True) if stops else self._estimated(scene)
            if solution.field is not None:
                section = {"section": state_pictures.section(state.design, solution, state.magnet)}
            yield answer()
            if decoder is None and made is None and state.design.shape.has_magnet:
                yield None
                decoder = self.memory.results.get(
                    ("decoder", state.design), lambda: state_answers.build_decoder(state.design)
                )
                yield answer()

    def _estimated(self, scene: Scene) -> Solution:
        """Return the solution of a scene with one load, with error estimates; without its field from the store."""
        (found,) = stored_answers.walked(scene, self.memory.store, walk=self.paths.walk)
        return found

    def _curve(self, request: Request, level: str) -> Data:
        """Return the curve; at level quick its error estimates follow only if it is not refined."""
        state, made = request.state, request.sensor
        estimate = level == state.level
        key = ("curve", state_answers.mechanics(state.design), state.magnet, level, estimate, made is None)

        def curve() -> Data:
            return state_answers.curve(
                state.design, state.magnet, level, self.memory.store if estimate else None, made
            )

        data: Data = self.memory.results.get(key, curve)
        return data


@dataclass(slots=True)
class _Kept:
    """A path with its state at the beginning of a shear, and what it has reached for the scene named `name`.

    `continued` says that this was reached from the state before it, in `seconds`. `sideways` is the model in which
    the stability of its presses is checked.
    """

    path: Path
    sideways: SidewaysModel
    begun: PathState | None = None
    name: str = ""
    reached: Reached[PathState] | None = None
    continued: bool = False
    seconds: float = 0.0


class KeptPaths:
    """The last paths, at most `MOST_PATHS`."""

    def __init__(self) -> None:
        self._kept: dict[str, _Kept] = {}

    def walk(self, scene: Scene, **_: Any) -> Iterator[Solution]:
        """Yield the solution of each load with error estimates and a check of its stability, as
        `fem.equilibrium.walk` does; each begins where that of a single load does."""
        for load in scene.loads:
            alone = replace(scene, loads=(load,))
            solution = self.solve(alone, sideways=True)
            if solution.status in ANSWERED:
                coarse = replace(alone, accuracy=coarser(scene.accuracy))
                solution = with_estimates(solution, self.solve(coarse), alone)
            yield solution

    def solve(self, scene: Scene, *, sideways: bool = False, moving: bool = False) -> Solution:
        """Return the solution of a scene with one load, without error estimates.

        Parameters
        ----------
        sideways : check whether an axisymmetric press would be stable sideways, which takes longer than the press.
        moving : start at the last state if it is nearer than the first one.
        """
        # the path of a shear is the same in all directions
        begin, alike = time.perf_counter(), path_solver.place(scene).scene
        key, name = _key(alike), json.dumps(alike.dimensionless())
        kept = self._kept.pop(key, None)
        if kept is None:
            path = Path(path_models(scene))
            kept = _Kept(path, sideways_model(scene, path))
        # the newest path stands last
        self._kept[key] = kept
        while len(self._kept) > MOST_PATHS:
            self._kept.pop(next(iter(self._kept)))
        if kept.name != name or (kept.continued and not moving):
            # a path that is given up on the way has no name
            near, kept.name = moving and bool(kept.name), ""
            further = _continued(kept, scene) if near else None
            kept.continued, kept.reached = further is not None, further or _followed(kept, scene)
            kept.name, kept.seconds = name, time.perf_counter() - begin
        reached = kept.reached
        assert reached is not None
        margin = kept.sideways.margin if sideways else None
        state, stop, iterations = reached.state, reached.stop, reached.iterations
        return read(state, scene, scene.loads[0], stop, iterations=iterations, seconds=kept.seconds, margin=margin)


def _scene_of(state: ExplorerState, level: str) -> Scene:
    return Scene(state.design, (state.load,), LEVELS[level], state.magnet)


def _continued(kept: _Kept, scene: Scene) -> Reached[PathState] | None:
    """Follow a path from its last state to the load of its scene; None if this is no valid or no shorter way."""
    goal, start = scene.position(scene.loads[0]), kept.begun or kept.path.rest
    if kept.reached is None or kept.reached.stop or kept.reached.state.friction is not None:
        return None
    last = kept.reached.state
    if not last.is_sound or np.linalg.norm(goal - last.position) >= np.linalg.norm(goal - start.position):
        return None
    # from one move of a hand to the next, extrapolation of the last states is a better first guess than the predictor
    reached = kept.path.advance(replace(last, reduced=None), goal)
    # the limit of a path, and where it loses stability, are found from its beginning
    return None if reached.stop or not reached.state.is_sound else reached


def _followed(kept: _Kept, scene: Scene) -> Reached[PathState]:
    """Follow a path to the load of its scene: from rest, or from the press at which the shear begins."""
    (load,), path, before = scene.loads, kept.path, 0
    position = scene.position(load)
    if not load.shears_tip:
        return path.advance(path.rest, position)
    if kept.begun is None:
        pressed = path.advance(path.rest, position * [1, 0, 0])
        if pressed.stop:
            return pressed
        before, kept.begun = pressed.iterations, path.begin_shear(pressed.state)
    sheared = path.advance(kept.begun, position)
    return replace(sheared, iterations=before + sheared.iterations)


def _key(scene: Scene) -> str:
    content, (load,), D = scene.dimensionless(), scene.loads, scene.design.D
    values = content["loads"][0]
    if load.shears_tip:
        # under a tilted plate the symmetry of the model depends on the direction of the shear
        values["shear"] = list(load.direction) if load.plate_tilt else "any"
    elif scene.model == "axisymmetric" and load.depth > FIRST_TOUCH * D:
        # one mesh serves a range of depths; friction before first slip does not change that
        values["depth"], values["shear"] = graded_depth(load.depth / D), "none"
        values["friction"] = load.coulomb
    return json.dumps(content)
