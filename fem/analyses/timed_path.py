"""A path of loads in time: finite viscoelasticity with adaptive time steps of second order, without inertia.

The plate moves linearly in time from load to load. The silicone has the branches of its design
(`geometry.relaxation`), by one of the two laws of `fem.model.viscoelasticity`; a step is described in
`fem.analyses.time_steps`. The steps are chosen so that the estimated error of the force stays below `tolerance` of
the largest force so far; the first two steps of a motion are equal and accepted together, as their error is known
after the second one. Beside the steps, the errors of the mesh remain, and with Coulomb friction those of slip within
an increment, which is bounded as in a static path. Pressed and sheared by 1 mm and back on a coarse mesh, in twelve
steps or more each way, the paper's sensor with friction 0.3 and one of loss factor 0.25 with friction 0.6 have forces
along the shear within 2e-3 of the largest one on a path of steps a quarter as long (`tests/test_timed_path.py`).

Energies are in mJ, since the beginning: the work of the plate is the stored energy, plus what the silicone
dissipated, plus what friction dissipated. Work and dissipation are integrated from quantities of their own, the
plate's force and motion or stress and strain at all points (`fem.analyses.time_quadrature`), so their difference is
an error of the time steps: some 1e-4 of the largest work at the default steps. Most of it arises where points of the
skin touch within a step of the press, whether they slip later or not: 1e-6 needs 400 steps of a press, but 72 of a
glued stroke after it and 144 of a sliding one. In a jump nothing is dissipated but by slip.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from fem.accuracy import STANDARD, Accuracy
from fem.analyses.time_integration import Segment, TimedPath, march, step_limits
from fem.model import coulomb_friction
from fem.results import diagnostics
from fem.results.postprocess import read_response
from fem.scene import Model, Scene
from fem.solution import Facts, Status
from fem.solve.newton import Stop
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress

__all__ = ["TimedLoad", "TimedState", "follow"]

ViscousLaw = Literal["prony", "finite"]

LEAST_TOLERANCE = 1e-7
"""Least permitted error of the force from the time steps: Newton's tolerance leaves errors near it, and the number of
steps grows like the inverse of its cube root."""
SMOOTH = 0.3
"""Change of the plate's velocity over its largest velocity up to which a motion is smooth: that of a sine wave of 24
loads."""


@dataclass(frozen=True, slots=True)
class TimedLoad:
    """A load that is reached at a time, s, on a straight line from the load before."""

    time: float
    load: Load


@dataclass(frozen=True, slots=True)
class TimedState:
    """State of the sensor at a time.

    Attributes
    ----------
    time : s.
    load : load that the state carries.
    response : force, shift and tilt, as of a `Solution`.
    facts, status, message : as of a `Solution`. Whether a press is stable sideways is that of slow loading to its
        depth, which has nearly the same pose; with Coulomb friction it is not known.
    model, slip_share : as of a `Solution`.
    time_error : estimated error of the force along the last motion from the time steps, over the largest such force.
    work, stored, dissipated, friction_dissipated : work of the plate since the beginning, energy stored in silicone
        and springs, energy dissipated in the silicone, and by slip, mJ.
    step : number of time steps so far.
    iterations : Newton iterations so far.
    dofs : number of unknowns.
    """

    time: float
    load: Load
    response: Response
    model: str
    slip_share: float | None
    time_error: float
    work: float
    stored: float
    dissipated: float
    friction_dissipated: float
    step: int
    iterations: int
    dofs: int
    facts: Facts = field(default_factory=Facts)
    status: Status = "ok"
    message: str = ""

    @property
    def balance(self) -> float:
        """Work that is neither stored nor dissipated, mJ: an error of the time steps."""
        return self.work - self.stored - self.dissipated - self.friction_dissipated


def follow(
    design: Design,
    loads: Sequence[TimedLoad],
    accuracy: Accuracy = STANDARD,
    *,
    law: ViscousLaw = "prony",
    tolerance: float = 1e-3,
    largest_step: float | None = None,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    every_step: bool = False,
    kappa: float | None = None,
    progress: Progress | None = None,
) -> Iterator[TimedState]:
    """Follow a path of loads in time from rest at time 0.

    Parameters
    ----------
    loads : in the order of their times, from 0 on; two loads at one time are a jump, which is elastic.
    law : "prony" or "finite", see `fem.model.viscoelasticity`.
    tolerance : error of the force from the time steps over the largest force.
    largest_step : longest time step, s; default: none.
    every_step : yield the state after each time step, not only at each load.
    kappa : stiffness number of the plate without Coulomb friction (`fem.model.plate_contact`), at the deepest load;
        default: that of a static solve.
    progress : called with the completed share of the time and a text.

    Yields
    ------
    The states. Where a step has no solution, the last state that has one, with its status and message.

    Raises
    ------
    BadInput
        Before the first state, if loads or tolerances are not allowed.
    """
    scene = _check(design, loads, accuracy, magnet, model, tolerance, largest_step)
    return _follow(
        TimedPath(scene, law, kappa), _segments(scene, loads), tolerance, largest_step, every_step, progress
    )


def _check(
    design: Design,
    loads: Sequence[TimedLoad],
    accuracy: Accuracy,
    magnet: Magnet,
    model: Model,
    tolerance: float,
    largest_step: float | None,
) -> Scene:
    """Return the scene of the loads; raises BadInput where they are no path in time."""
    if not loads:
        raise BadInput("a path in time needs at least one load")
    times = [0.0, *(one.time for one in loads)]
    for before, after in itertools.pairwise(times):
        if not before <= after < math.inf:
            raise BadInput(
                f"times must be finite and must not decrease from 0 s on; got {after:g} s after {before:g} s"
            )
    if not LEAST_TOLERANCE <= tolerance < 1:
        raise BadInput(
            f"tolerance of the time steps must be at least {LEAST_TOLERANCE:g} and below 1; got {tolerance:g}"
        )
    if largest_step is not None and not largest_step > 0:
        raise BadInput(f"largest time step must be positive; got {largest_step:g} s")
    scene = Scene(design, tuple(one.load for one in loads), accuracy, magnet, model)
    if scene.solid:
        raise BadInput(f"model {scene.model} has no time steps: choose auto, axisymmetric or harmonic")
    glued: Load | None = None
    for one in loads:
        if one.load.bonds_contact and (glued is None or glued.depth != one.load.depth):
            raise BadInput("a plate that sticks needs one load for the press and a later one for the shear")
        glued = one.load
    return scene


def _segments(scene: Scene, loads: Sequence[TimedLoad]) -> list[Segment]:
    """Return the straight motions of a path, in units of D, each with the number of its smooth part."""
    D, (x, y) = scene.design.D, scene.direction
    turn = np.array([[x, y], [-y, x]])
    segments: list[Segment] = []
    begin, start = 0.0, np.zeros(3)
    for one in loads:
        goal = np.array([one.load.depth, *(turn @ one.load.imposed_shear)]) / D
        segments.append(Segment(begin, one.time, start, goal, 0, one.load))
        begin, start = one.time, goal
    fastest = max(float(np.linalg.norm(one.velocity)) for one in segments)
    run = 0
    for i, (before, after) in enumerate(itertools.pairwise(segments), 1):
        jump = before.end == before.begin or after.end == after.begin
        sheared = bool(after.goal[1:].any()) and not before.goal[1:].any()
        if jump or sheared or np.linalg.norm(after.velocity - before.velocity) > SMOOTH * fastest:
            run += 1
        segments[i] = replace(after, run=run)
    return segments


def _follow(
    path: TimedPath,
    segments: Sequence[Segment],
    tolerance: float,
    largest_step: float | None,
    every_step: bool,
    progress: Progress | None,
) -> Iterator[TimedState]:
    """Follow the segments; see `follow`."""
    run, whole = -1, segments[-1].end
    try:
        for segment in segments:
            duration = sum(one.end - one.begin for one in segments if one.run == segment.run)
            if segment.run != run:
                run = segment.run
                path.begin_motion(segment, duration)
            if segment.goal[1:].any() and not path.state.path.sheared:
                path.begin_shear()
            for stop in march(path, segment, step_limits(tolerance, duration, largest_step)):
                if progress is not None:
                    text = f"{path.state.path.d.model}: until {segment.end:.4g} s"
                    progress(path.state.time / whole if whole else 1.0, text)
                if stop:
                    yield _read(path, path.reached_load(segment.load), stop)
                    return
                if every_step and path.state.time < segment.end:
                    yield _read(path, path.reached_load(segment.load))
            yield _read(path, segment.load)
    finally:
        path.close()


def _read(path: TimedPath, load: Load, stop: Stop = "") -> TimedState:
    """Return the present state in the user's units."""
    state, scene = path.state, path.scene
    unit, kept, friction = scene.design.E * scene.design.D**3, state.history.stored(state.points), state.path.friction
    found = TimedState(
        time=state.time,
        load=load,
        response=read_response(state.path, scene),
        model=state.path.d.model,
        slip_share=None if friction is None else coulomb_friction.slip_share(friction, state.path.skin.weights),
        time_error=state.error / max(state.largest, path.least_force) if state.error else 0.0,
        work=state.work.total * unit,
        stored=(kept + state.other) * unit,
        # without branches the silicone is elastic: what is left is an error of the integrals
        dissipated=(state.absorbed.total - kept) * unit if len(state.history.branches.times) else 0.0,
        friction_dissipated=state.path.dissipated * unit,
        step=path.steps,
        iterations=path.iterations,
        dofs=state.path.d.system.size,
    )
    return diagnostics.diagnose(found, state.path, scene, stop, path.margin, touched=state.largest > 0)
