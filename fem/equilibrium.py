"""Solutions of a scene: loads are applied one after the other, and the errors of each state are estimated.

Every scene is solved with lengths over D and stresses over E. Designs of one law that differ only in E, f or scale
are therefore one problem: pose and depth over D are equal, and forces are proportional to E D^2.

Signs: the plate's lower face starts at z = L and moves down by `depth`. The reported force is the load on the tip,
positive in compression and along the shear.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace
from typing import Any

from fem.accuracy import STANDARD, Accuracy, level
from fem.results.diagnostics import Margin
from fem.results.error_estimates import estimate_state
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.scene import Model, Scene
from fem.solution import Solution
from fem.solve.load_case_models import path_models, split_by_mesh
from fem.solve.load_stepping import Path
from geometry.design import Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.messages import Progress

__all__ = ["solve", "trace", "walk"]


def solve(
    design: Design,
    load: Load | None = None,
    accuracy: Accuracy | str = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    **motion: Any,
) -> Solution:
    """Solve for the state of the sensor under one load.

    Parameters
    ----------
    design : the sensor; lengths in mm, E in MPa.
    load : motion of the plate or grip: depth and shears in mm, tilt in rad.
    accuracy : QUICK, STANDARD or FINE of `fem.accuracy`, or its name.
    magnet : "rigid", or "ignored" for a beam that is all silicone.
    model : "axisymmetric", "harmonic", "half" or "full"; "auto" takes the smallest one that can carry the load.
    motion : fields of the load, in place of one.

    Returns
    -------
    Solution
        Force in N, shift of the magnet in mm and tilt in rad (`response`), their estimated relative errors
        (`estimates`), and `status`, `message` and `facts`. Where the solve stops early it is the last state that was
        reached.

    Raises
    ------
    BadInput
        A value is out of range, or values exclude each other; the text says which, and the remedy.
    TypeError
        An argument is of another kind.

    Examples
    --------
    >>> from fem.accuracy import QUICK
    >>> from geometry.design import paper
    >>> state = solve(paper(), Load(depth=0.1), QUICK)
    >>> state.status, round(state.response.force[2], 2)
    ('ok', 0.12)
    >>> solve(paper(), depth=0.1, accuracy="quick").response == state.response
    True
    """
    if (load is None) == (not motion):
        raise TypeError("solve takes a load or the fields of one: write solve(design, Load(depth=1.0)) or depth=1.0")
    return trace(design, [Load(**motion) if load is None else load], accuracy, magnet=magnet, model=model)[-1]


def trace(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy | str = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    estimate: bool = True,
    ratios: bool = False,
    progress: Progress | None = None,
) -> list[Solution]:
    """Solve for the states under loads that follow one another, such as presses to rising depths in mm.

    Parameters
    ----------
    design, accuracy, magnet, model : as in `solve`.
    loads : a path of loads of one kind (see `fem.scene.Scene`).
    estimate : estimate errors from a second solve on a coarser mesh.
    ratios : give each press that is checked its sideways stiffness (`Facts.sideways_stiffness_ratio`). Otherwise the
        deepest one is checked first, and a press less deep than one that is stable with room to spare has none.
    progress : called with the completed share of the path, 0 to 1, and a text.

    Returns
    -------
    list of Solution
        One for each load, as `solve` returns it; fewer where a solve stops early.

    Raises
    ------
    BadInput, TypeError
        As in `solve`.
    """
    scene = Scene(design, tuple(loads), level(accuracy), magnet, model)
    return list(walk(scene, estimate=estimate, ratios=ratios, progress=progress))


def walk(
    scene: Scene, *, estimate: bool = True, ratios: bool = True, progress: Progress | None = None
) -> Iterator[Solution]:
    """Solve for the states under the loads of a scene; each load applies first its depth, then its shear.

    Parameters
    ----------
    estimate : estimate the errors of force, shift and tilt from a second solve of the same scene, on a mesh coarser
        by COARSER and with one harmonic less (two in place of one), see `fem.results.error_estimates`; they stay
        unknown where there is no such mesh (`Scene.coarser`). Also check whether an axisymmetric press would be
        stable sideways; if not, the message says so.
    ratios : as in `trace`; without them the states of one mesh are read when all are solved.
    progress : called with the completed share of the path and a text.

    Yields
    ------
    One solution per load, as soon as it is solved. Where a solve stops early, the last solution is the last converged
    state, with its status and message.
    """
    coarse, done = scene.coarser() if estimate else None, 0
    for loads in split_by_mesh(scene):
        report = None if progress is None else functools.partial(_report, progress, scene, done)
        states = _follow(replace(scene, loads=loads), report, watch=coarse is not None, ratios=ratios)
        coarse_states = None if coarse is None else _follow(replace(coarse, loads=loads), None)
        for state in states:
            coarse_state = None if coarse_states is None else next(coarse_states, None)
            yield state if coarse_state is None else with_estimates(state, coarse_state, scene)
        if state.status not in ANSWERED:
            return
        done += len(loads)


def _report(progress: Progress, scene: Scene, done: int, count: int, load: Load) -> None:
    shear = math.hypot(*load.imposed_shear)
    progress((done + count) / len(scene.loads), f"{scene.model}: depth {load.depth:g} mm, shear {shear:g} mm")


def with_estimates(state: Solution, coarse_state: Solution, scene: Scene) -> Solution:
    """Return the state with error estimates, if the coarser solve has reached the same load."""
    seconds = state.seconds + coarse_state.seconds
    load, coarse_load = state.load, coarse_state.load
    same = (load.depth, load.imposed_shear) == (coarse_load.depth, coarse_load.imposed_shear)
    if not same:
        return replace(state, seconds=seconds)
    estimates = estimate_state(state, coarse_state, scene)
    return replace(state, seconds=seconds, estimates=estimates)


def _follow(
    scene: Scene, report: Callable[[int, Load], None] | None, *, watch: bool = False, ratios: bool = True
) -> Generator[Solution]:
    """Solve for the states of loads that share a mesh; report the number of those that are solved."""
    path = Path(path_models(scene))
    sideways, reached = sideways_model(scene, path) if watch else None, _reach(scene, path, report)
    if sideways is None or ratios:
        margin = None if sideways is None else sideways.margin
        solutions = (solution(margin=margin) for solution in reached)
    else:
        solutions = _deepest_first(scene.loads, list(reached), sideways.verdict)
    for solution in solutions:
        yield solution
        if solution.status not in ANSWERED:
            return


def _reach(
    scene: Scene, path: Path, report: Callable[[int, Load], None] | None
) -> Generator[functools.partial[Solution]]:
    """Follow a path up to where it stops; yield the reading of each state, which lacks its margin only."""
    begin, state = time.perf_counter(), path.rest
    for i, load in enumerate(scene.loads):
        if report is not None:
            report(i, load)
        reached = path.apply(state, scene.position(load))
        state, seconds, begin = reached.state, time.perf_counter() - begin, time.perf_counter()
        yield functools.partial(
            read, state, scene, load, reached.stop, iterations=reached.iterations, seconds=seconds
        )
        if reached.stop:
            return


def _deepest_first(
    loads: Sequence[Load], readings: Sequence[functools.partial[Solution]], margin: Margin
) -> Generator[Solution]:
    """Read states from the deepest on; yield them in their order."""
    order = sorted(range(len(readings)), key=lambda i: -loads[i].depth)
    found = {i: readings[i](margin=margin) for i in order}
    yield from (found[i] for i in range(len(readings)))


def sideways_model(scene: Scene, path: Path) -> SidewaysModel:
    """Return the model in which the axisymmetric states of a path are checked for sideways stability."""
    accuracy = scene.accuracy
    return SidewaysModel(path.rest.d, accuracy.section_size, accuracy.harmonics if scene.sideways else 1)
