"""From a scene to solutions: its loads are applied one after the other, and the errors of each state are estimated.

Every scene is solved with lengths divided by D and stresses by E, so designs of one law that differ only in E, f or
scale are the same problem: pose and depth over D are shared, forces are proportional to E D^2.

Signs: the plate's lower face starts at z = L and comes down by `depth`; the reported force is the load on the tip,
positive in compression and along the shear.
"""

from __future__ import annotations

import contextlib
import functools
import math
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace

import numpy as np
import skfem

from fem.accuracy import STANDARD, Accuracy, coarser
from fem.error_estimates import estimate_response
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.scene import Model, Scene
from fem.solution import Solution
from fem.solvers.depth_ranges import split_by_mesh
from fem.solvers.load_case_models import path_models
from fem.solvers.load_stepping import Path
from geometry.design import Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress


def solve(
    design: Design,
    load: Load,
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
) -> Solution:
    """The state under one load. See `walk`."""
    return trace(design, [load], accuracy, magnet=magnet, model=model)[-1]


def trace(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    estimate: bool = True,
    progress: Progress | None = None,
) -> list[Solution]:
    """All states of `walk` for a scene of these values."""
    scene = Scene(design, tuple(loads), accuracy, magnet, model)
    return list(walk(scene, estimate=estimate, progress=progress))


def walk(
    scene: Scene,
    *,
    estimate: bool = True,
    progress: Progress | None = None,
    mesh: skfem.MeshTet2 | None = None,
) -> Iterator[Solution]:
    """The states under the loads of a scene: for each one first the depth, then the shear.

    Parameters
    ----------
    estimate : estimate the errors of force, shift and tilt from a companion, the same scene on a mesh coarser by
        COARSER and with one harmonic less (two harmonics for one). `fem.error_estimates` says how they follow from
        the difference.
        Also look whether an axisymmetric press would be stable sideways, and say so in the message if not.
    progress : called with a fraction of the path and a text.
    mesh : tetrahedra in units of D to solve on, as `fem.discretisation.symmetry_models.solid` takes them; then
        nothing is estimated.

    Yields
    ------
    One solution per load that was reached, as soon as it is; where the solve stopped short, the last one holds the
    last good state with its status and message.

    Raises
    ------
    BadInput
        At once, if the coarser mesh of the companion misses the gripped skin.
    """
    coarse = replace(scene, accuracy=coarser(scene.accuracy)) if estimate and mesh is None else None
    return _walk(scene, coarse, progress, mesh)


def _walk(
    scene: Scene, coarse: Scene | None, progress: Progress | None, mesh: skfem.MeshTet2 | None
) -> Iterator[Solution]:
    """All parts of the path, one after the other; `coarse` is the companion's scene."""
    done = 0
    for loads in split_by_mesh(scene):
        report = (
            None
            if progress is None
            else functools.partial(_report_share, progress, done, len(loads), len(scene.loads))
        )
        companion = None if coarse is None else replace(coarse, loads=loads)
        states = _walk_part(replace(scene, loads=loads), companion, report, mesh)
        with contextlib.closing(states):
            for state in states:
                yield state
        if state.status not in ("ok", "unstable"):
            return
        done += len(loads)


def _walk_part(
    scene: Scene, coarse: Scene | None, progress: Progress | None, mesh: skfem.MeshTet2 | None
) -> Generator[Solution]:
    """The states of loads that share a mesh, each with the errors that its companion tells."""
    states = _follow(scene, progress, watch=coarse is not None, mesh=mesh)
    if coarse is None:
        yield from states
        return
    companions = _follow(coarse, None)
    with contextlib.closing(states), contextlib.closing(companions):
        for state in states:
            companion = next(companions, None)
            yield state if companion is None else _with_estimates(state, companion, scene)


def _report_share(progress: Progress, done: int, count: int, whole: int, share: float, text: str) -> None:
    """Report the share of a part, of `count` loads after `done`, as one of the `whole` path."""
    progress((done + share * count) / whole, text)


def _with_estimates(state: Solution, companion: Solution, scene: Scene) -> Solution:
    """The state with the differences to its companion, if that one has reached the same load."""
    seconds = state.seconds + companion.seconds
    one, other = state.load, companion.load
    same = (one.depth, one.imposed_shear) == (other.depth, other.imposed_shear)
    if not same:
        return replace(state, seconds=seconds)
    estimates = estimate_response(state.response, companion.response, one, scene, state.model)
    return replace(state, seconds=seconds, estimates=estimates)


def _follow(
    scene: Scene, progress: Progress | None, *, watch: bool = False, mesh: skfem.MeshTet2 | None = None
) -> Generator[Solution]:
    """The states of loads that share a mesh."""
    begin, D = time.perf_counter(), scene.design.D
    path = start_path(scene, mesh)
    sideways = SidewaysModel(path.raised) if watch and path.raised is not None else None
    x, y = scene.direction
    turn = np.array([[x, y], [-y, x]])
    try:
        for i, load in enumerate(scene.loads):
            if progress is not None:
                shear = math.hypot(*load.imposed_shear)
                progress(i / len(scene.loads), f"{scene.model}: depth {load.depth:g} mm, shear {shear:g} mm")
            reason = path.go(load.depth / D, turn @ load.imposed_shear / D)
            end = time.perf_counter()
            state = read(
                path.state,
                scene,
                load,
                reason,
                iterations=path.iterations,
                seconds=end - begin,
                sideways=sideways,
            )
            begin = end
            yield state
            if state.status not in ("ok", "unstable"):
                return
    finally:
        path.close()


def start_path(scene: Scene, mesh: skfem.MeshTet2 | None = None) -> Path:
    """The path of a scene at rest, on its own mesh or on tetrahedra in units of D."""
    models = path_models(scene, mesh)
    return Path(
        models.first.build(),
        scene.grip,
        scene.plate_tilt,
        raised=None if models.raised is None else models.raised.build,
        rim=models.glued_radius,
        mu=scene.coulomb,
        friction_step_factor=scene.accuracy.friction_step_factor,
        predictor=None if models.predictor is None else models.predictor.build,
    )
