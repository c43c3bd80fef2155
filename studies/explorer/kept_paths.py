"""Paths of loads that a worker of the explorer keeps, so that a small change of a state costs little.

A path belongs to a mesh and a kind of load (`_key`). A press starts at rest, and a shear at the kept press below it,
as in `fem.equilibrium.solve`: the answers are the same. Changes that no finite element sees, such as E, the magnet's
remanence or the Hall elements, find the state that is there already.

While a hand moves, the picture may start at the last state instead, which takes half the time. Without Coulomb
friction equilibrium depends on the load alone, so both ways differ by the tolerance of Newton's method only. The
answer with error estimates, which follows when the hand rests, always takes the first way.
"""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, replace

import numpy as np

from fem.equilibrium import sideways_model, start_path
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.scene import Scene
from fem.solution import Solution
from fem.solve.load_case_models import graded_depth
from fem.solve.load_stepping import Path
from fem.solve.newton import Stop
from fem.solve.path_state import FIRST_TOUCH, PathState

MOST = 4
"""Most paths that are kept: two designs side by side, each with its coarser mesh for the error estimates."""


@dataclass(slots=True)
class _Kept:
    """A path with its states at rest, at the beginning of a shear, and the last one, of the scene named `name`.

    `continued` says that the last state was reached from the one before it. `sideways` is the model in which the
    stability of its presses is checked.
    """

    path: Path
    rest: PathState
    sideways: SidewaysModel | None
    begun: PathState | None = None
    name: str = ""
    last: PathState | None = None
    continued: bool = False
    stop: Stop = ""
    iterations: int = 0
    seconds: float = 0.0


class KeptPaths:
    """The last paths, at most `MOST`."""

    def __init__(self) -> None:
        self._kept: dict[str, _Kept] = {}

    def solve(self, scene: Scene, *, sideways: bool = False, moving: bool = False) -> Solution:
        """Return the solution of a scene with one load, without error estimates.

        Parameters
        ----------
        sideways : check whether an axisymmetric press would be stable sideways, which takes longer than the press.
        moving : start at the last state if it is nearer than the first one.
        """
        kept = self._followed(scene, moving)
        assert kept.last is not None
        return read(
            kept.last,
            scene,
            scene.loads[0],
            kept.stop,
            iterations=kept.iterations,
            seconds=kept.seconds,
            sideways=kept.sideways if sideways else None,
        )

    def _followed(self, scene: Scene, moving: bool) -> _Kept:
        """Return the path of a scene at its load."""
        key, name = _key(scene), json.dumps(scene.dimensionless())
        begin = time.perf_counter()
        kept = self._kept.pop(key, None)
        if kept is None:
            path = start_path(scene)
            kept = _Kept(path, path.state, sideways_model(scene, path))
        # the newest path stands last
        self._kept[key] = kept
        while len(self._kept) > MOST:
            self._kept.pop(next(iter(self._kept)))
        if kept.name != name or (kept.continued and not moving):
            near = moving and bool(kept.name)
            kept.name = ""
            kept.continued = near and _continue(kept, scene)
            if not kept.continued:
                _follow(kept, scene)
            kept.name, kept.seconds = name, time.perf_counter() - begin
        return kept


def _continue(kept: _Kept, scene: Scene) -> bool:
    """Follow a path from its last state to the load of its scene; return whether this is a valid and shorter way."""
    last, goal = kept.last, scene.position(scene.loads[0])
    if last is None or kept.stop or last.friction is not None:
        return False
    if last.onset is not None or not last.stability.is_stable:
        return False
    start = kept.begun or kept.rest
    if np.linalg.norm(goal - last.position) >= np.linalg.norm(goal - start.position):
        return False
    # from one move of a hand to the next, extrapolation of the last states is a better first guess than the predictor
    kept.path.restart(replace(last, reduced=None))
    stop, state = kept.path.go(goal[0], goal[1:]), kept.path.state
    # the limit of a path, and where it loses stability, are found from its beginning
    if stop or not state.stability.is_stable or state.onset is not None:
        return False
    kept.last, kept.iterations = state, kept.path.iterations
    return True


def _follow(kept: _Kept, scene: Scene) -> None:
    """Follow a path to the load of its scene: from rest, or from the press at which the shear begins."""
    (load,), path, before = scene.loads, kept.path, 0
    depth, *shear = scene.position(load)
    if load.shears_tip:
        if kept.begun is None:
            path.restart(kept.rest)
            kept.stop = path.go(depth, np.zeros(2))
            before = path.iterations
            if kept.stop:
                kept.last, kept.iterations = path.state, before
                return
            path.begin_shear()
            kept.begun = path.state
        path.restart(kept.begun)
    else:
        path.restart(kept.rest)
    kept.stop = path.go(depth, np.array(shear))
    kept.last, kept.iterations = path.state, before + path.iterations


def _key(scene: Scene) -> str:
    """Return what scenes on one path have in common."""
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
