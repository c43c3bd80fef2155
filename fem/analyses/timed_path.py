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
plate's force and motion or stress and strain at all points (`fem.analyses.time_steps`), so their difference is
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
from fem.analyses import time_steps
from fem.analyses.time_steps import ViscousState
from fem.model import coulomb_friction, viscoelasticity
from fem.model.viscoelasticity import Branches
from fem.results import diagnostics
from fem.results.lateral_stiffness import SidewaysModel, StabilityMargin, estimate_margin
from fem.results.postprocess import reached_load, read_response
from fem.scene import Model, Scene
from fem.solution import Facts, Status
from fem.solve import load_increments
from fem.solve.active_set import KeptTangent
from fem.solve.direct_solver import STABLE, UNKNOWN, Solver
from fem.solve.load_case_models import path_models
from fem.solve.load_increments import find_equilibrium, path_at
from fem.solve.load_stepping import Path
from fem.solve.newton import Stop
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, Response
from geometry.messages import Progress
from geometry.relaxation import relaxation_of

__all__ = ["TimeControl", "TimedLoad", "TimedState", "follow"]

ViscousLaw = Literal["prony", "finite"]

LEAST_TOLERANCE = 1e-7
"""Least permitted error of the force from the time steps: Newton's tolerance leaves errors near it, and the number of
steps grows like the inverse of its cube root."""
SMOOTH = 0.3
"""Change of the plate's velocity over its largest velocity up to which a motion is smooth: that of a sine wave of 24
loads."""
LONGEST_SHARE = 1 / 12
"""Longest step over the duration of its part, so that the energies are integrated well; the first step is half as
long."""
BUDGET = 0.5
"""Share that a single step may add of what the errors carried so far leave of the permitted error; at least a tenth
of that of the whole."""
SHORTEST_SHARE = 1e-4
"""Step over the duration of its part below which the path stops: it has then reached a limit."""
SAFETY, GROWTH = 0.8, 2.0
"""Share of the permitted error that a step aims at, and the largest ratio of a step to the last one; the least one is
1 / GROWTH^2."""
HERTZ_SHARE = 0.3
"""Share of the force of a Hertz contact at the deepest load that errors refer to at least: at first touch the force
itself is nearly zero."""


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


@dataclass(frozen=True, slots=True)
class TimeControl:
    """Choice of the time steps.

    Attributes
    ----------
    tolerance : error of the force from the time steps over the largest force.
    largest_step : longest time step, s; None: no bound.
    kappa : stiffness number of the plate without Coulomb friction (`fem.model.plate_contact`), at the deepest load;
        None: that of a static solve.

    Raises
    ------
    BadInput
        A value is out of range.
    """

    tolerance: float = 1e-3
    largest_step: float | None = None
    kappa: float | None = None

    def __post_init__(self) -> None:
        if not LEAST_TOLERANCE <= self.tolerance < 1:
            raise BadInput(
                f"tolerance of the time steps must be at least {LEAST_TOLERANCE:g} and below 1; "
                f"got {self.tolerance:g}"
            )
        if self.largest_step is not None and not self.largest_step > 0:
            raise BadInput(f"largest time step must be positive; got {self.largest_step:g} s")


def follow(
    design: Design,
    loads: Sequence[TimedLoad],
    accuracy: Accuracy = STANDARD,
    *,
    law: ViscousLaw = "prony",
    steps: TimeControl | None = None,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    every_step: bool = False,
    progress: Progress | None = None,
) -> Iterator[TimedState]:
    """Follow a path of loads in time from rest at time 0.

    Parameters
    ----------
    loads : in the order of their times, from 0 on; two loads at one time are a jump, which is elastic.
    law : "prony" or "finite", see `fem.model.viscoelasticity`.
    steps : default: a tolerance of 1e-3.
    every_step : yield the state after each time step, not only at each load.
    progress : called with the completed share of the time and a text.

    Yields
    ------
    The states. Where a step has no solution, the last state that has one, with its status and message.

    Raises
    ------
    BadInput
        Before the first state, if loads or tolerances are not allowed.
    """
    scene, control = _check(design, loads, accuracy, magnet, model), steps or TimeControl()
    path = TimedPath(scene, law, control)
    return _follow(path, _segments(scene, loads), every_step, progress)


def _check(
    design: Design,
    loads: Sequence[TimedLoad],
    accuracy: Accuracy,
    magnet: Magnet,
    model: Model,
) -> Scene:
    """Return the scene of the loads; raises BadInput where they are no path in time."""
    if not loads:
        raise BadInput("a path in time needs at least one load")
    times = [0.0, *(timed.time for timed in loads)]
    for before, after in itertools.pairwise(times):
        if not before <= after < math.inf:
            raise BadInput(
                f"times must be finite and must not decrease from 0 s on; got {after:g} s after {before:g} s"
            )
    scene = Scene(design, tuple(timed.load for timed in loads), accuracy, magnet, model)
    if scene.solid:
        raise BadInput(f"model {scene.model} has no time steps: choose auto, axisymmetric or harmonic")
    glued: Load | None = None
    for timed in loads:
        if timed.load.bonds_contact and (glued is None or glued.depth != timed.load.depth):
            raise BadInput("a plate that sticks needs one load for the press and a later one for the shear")
        glued = timed.load
    return scene


def _segments(scene: Scene, loads: Sequence[TimedLoad]) -> list[Segment]:
    """Return the straight motions of a path, in units of D, each with the number of its smooth part."""
    segments: list[Segment] = []
    begin, start = 0.0, np.zeros(3)
    for timed in loads:
        goal = scene.position(timed.load)
        segments.append(Segment(begin, timed.time, start, goal, 0, timed.load))
        begin, start = timed.time, goal
    fastest = max(float(np.linalg.norm(segment.velocity)) for segment in segments)
    run = 0
    for i, (before, after) in enumerate(itertools.pairwise(segments), 1):
        jump = before.end == before.begin or after.end == after.begin
        sheared = bool(after.goal[1:].any()) and not before.goal[1:].any()
        if jump or sheared or np.linalg.norm(after.velocity - before.velocity) > SMOOTH * fastest:
            run += 1
        segments[i] = replace(after, run=run)
    return segments


def _follow(
    path: TimedPath, segments: Sequence[Segment], every_step: bool, progress: Progress | None
) -> Iterator[TimedState]:
    run, end = -1, segments[-1].end
    for segment in segments:
        duration = sum(part.end - part.begin for part in segments if part.run == segment.run)
        if segment.run != run:
            run = segment.run
            path.begin_motion(segment, duration)
        if segment.goal[1:].any() and not path.state.path.sheared:
            path.begin_shear()
        for stop in march(path, segment, duration):
            if progress is not None:
                text = f"{path.state.path.d.model}: until {segment.end:.4g} s"
                progress(path.state.time / end if end else 1.0, text)
            if stop:
                yield _read(path, reached_load(path.state.path, segment.load, path.scene), stop)
                return
            if every_step and path.state.time < segment.end:
                yield _read(path, reached_load(path.state.path, segment.load, path.scene))
        yield _read(path, segment.load)


def _read(path: TimedPath, load: Load, stop: Stop = "") -> TimedState:
    state, scene = path.state, path.scene
    unit, friction = scene.design.E * scene.design.D**3, state.path.friction
    stored_by_branches = state.history.stored(state.points)
    found = TimedState(
        time=state.time,
        load=load,
        response=read_response(state.path, scene),
        model=state.path.d.model,
        slip_share=None if friction is None else coulomb_friction.slip_share(friction, state.path.skin.weights),
        time_error=state.error / max(state.largest, path.least_force) if state.error else 0.0,
        work=state.work.total * unit,
        stored=(stored_by_branches + state.elastic) * unit,
        # without branches the silicone is elastic: what is left is an error of the integrals
        dissipated=(state.absorbed.total - stored_by_branches) * unit if len(state.history.branches.times) else 0.0,
        friction_dissipated=state.path.dissipated * unit,
        step=path.steps,
        iterations=path.iterations,
        dofs=state.path.d.system.size,
    )
    return diagnostics.diagnose(found, state.path, scene, stop, path.margin, touched=state.largest > 0)


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight motion.

    Attributes
    ----------
    begin, end : times, s.
    start, goal : (3,) positions over D.
    run : number of the smooth part of the path that it belongs to.
    load : the load at its end.
    """

    begin: float
    end: float
    start: Array
    goal: Array
    run: int
    load: Load

    @property
    def velocity(self) -> Array:
        """(3,) velocity over D, 1/s; zeros for a jump."""
        return (self.goal - self.start) / (self.end - self.begin) if self.end > self.begin else np.zeros(3)


def branches_of(design: Design) -> Branches:
    """Return the branches of a design with the ratio of the instantaneous modulus to its E."""
    relaxation = relaxation_of(design)
    instantaneous = 1.0 if design.modulus == "instantaneous" else 1 / relaxation.rest
    return Branches(np.array(relaxation.shares), np.array(relaxation.times), instantaneous)


class TimedPath:
    """Models, solver and present state of a path in time."""

    def __init__(self, scene: Scene, law: str, control: TimeControl) -> None:
        deepest = max(load.depth for load in scene.loads)
        # the mesh is that of the deepest load and of a glued area; states that carry less are read on the same mesh
        pressed = tuple(load for load in scene.loads if load.depth == deepest)
        sheared = (load if load.bonds_contact else replace(load, depth=deepest) for load in scene.loads)
        models = path_models(replace(scene, loads=(*pressed, *(load for load in sheared if load.shears_tip))))
        self.scene, self.control, self.tangent = scene, control, KeptTangent(Solver())
        # it supplies the models and takes no increments
        self._path = Path(
            replace(models, predictor=None, rough=None),
            grip=scene.grip,
            tilt=scene.plate_tilt,
            mu=scene.coulomb,
            kappa=control.kappa,
        )
        rest = self._path.rest
        R, depth = scene.shape.R, deepest / scene.design.D
        self.stiffness = rest.kappa / (R if rest.grip else math.sqrt(R * depth) if depth else R)
        branches, e = branches_of(scene.design), rest.d.elements
        history = viscoelasticity.at_rest(law, branches, (len(e.angles.theta), *e.weights.shape))
        self.state = time_steps.at_rest(time_steps.with_stiffness(rest, self.stiffness), history)
        self.least_force = HERTZ_SHARE * branches.instantaneous * 4 / 3 * math.sqrt(R) * depth**1.5
        self.steps, self.iterations, self.next_step = 0, 0, 0.0
        self._sideways = SidewaysModel(rest.d) if rest.d.model == "axisymmetric" else None
        self._stable_to = 0.0

    def begin_motion(self, segment: Segment, duration: float) -> None:
        """Prepare a smooth part of the path of a duration, s, which begins with a segment."""
        self.state = time_steps.begin_motion(self.state, segment.goal - segment.start)
        self.next_step = LONGEST_SHARE / 2 * duration

    def begin_shear(self) -> None:
        """Change to the model of a shear and glue the contact where required."""
        after = self._path.begin_shear(self.state.path)
        self.tangent.drop()
        if after.d is not self.state.path.d:
            self.tangent = KeptTangent(Solver())
        self.state = time_steps.raised(self.state, after)

    def margin(self, state: PathState) -> StabilityMargin:
        """Return the distance of a press from sideways buckling: that of slow loading to its depth.

        The pose of a press hardly depends on the modulus, and the tangent of a time step has no sideways model. The
        margin shrinks with the depth, so a press less deep than a stable one is stable, with a margin not known.
        """
        unknown, depth = StabilityMargin(None, None, UNKNOWN), float(state.position[0])
        if self._sideways is None or state.friction is not None:
            return unknown
        if depth <= self._stable_to:
            return replace(unknown, stability=STABLE)
        slow = find_equilibrium(Solver(), state, state.q, state.plate)
        if not slow.converged:
            return unknown
        margin = estimate_margin(self._sideways, path_at(state, slow, state.position, state.plate))
        if margin.stability.is_stable:
            self._stable_to = depth
        return margin


def march(path: TimedPath, segment: Segment, duration: float) -> Iterator[Stop]:
    """Take the time steps of a segment, in a smooth part of a duration, s; yield after each why the path stopped.

    It yields "" where the path goes on.
    """
    if segment.end == segment.begin:
        yield from _jump(path, segment)
        return
    speed = float(np.linalg.norm(segment.velocity))
    longest, shortest = LONGEST_SHARE * duration, SHORTEST_SHARE * duration
    longest = min(longest, path.control.largest_step or math.inf)
    longest = min(longest, _longest_motion(path, segment) / speed if speed else math.inf)
    while path.state.time < segment.end:
        load_increments.report(0.0)
        left = segment.end - path.state.time
        # equal last steps are better than one long and one tiny step
        count = math.ceil(left / min(path.next_step, longest) * (1 - 1e-9))
        # the error of a first step is known after the second one, so both are tried before the first one is accepted
        pair = not path.state.past and len(path.state.errors) > 0
        dt = left / max(count, 2 if pair else 1)
        tried = _tried(path, segment, dt, 2 if pair else 1)
        if isinstance(tried, str):
            path.state, path.next_step = replace(path.state, past=()), dt / 2
            if path.next_step < shortest:
                yield tried
                return
            continue
        if pair:
            tried[0] = time_steps.with_error_of_first(path.state, *tried)
        if not _choose_next_step(path, tried[0] if pair else path.state, tried[-1], dt, shortest):
            continue
        for state in tried:
            last = segment.end - state.time <= dt * 1e-9
            path.state = replace(state, time=segment.end) if last else state
            path.steps += 1
            yield ""


def _tried(path: TimedPath, segment: Segment, dt: float, count: int) -> list[ViscousState] | Stop:
    states: list[ViscousState] = []
    for _ in range(count):
        state = states[-1] if states else path.state
        left = segment.end - state.time - dt
        target = segment.goal - left * segment.velocity if left > dt * 1e-9 else segment.goal
        tried = time_steps.advance(path.tangent, state, target, dt, path.stiffness)
        if isinstance(tried, str):
            return tried
        path.iterations += tried.iterations
        states.append(tried)
    return states


def _choose_next_step(path: TimedPath, before: ViscousState, tried: ViscousState, dt: float, shortest: float) -> bool:
    """Set the length of the next step after one of length dt, and return whether that one is accurate enough."""
    decayed = np.exp(-dt / before.history.branches.times) * before.errors
    gained = float(np.abs(tried.errors - decayed).sum())
    permitted = path.control.tolerance / time_steps.CERTAINTY * max(tried.largest, path.least_force)
    allowed = max(BUDGET / 10 * permitted, BUDGET * (permitted - float(np.abs(decayed).sum())))
    ratio = GROWTH if gained == 0 else (SAFETY * allowed / gained) ** (1 / 3)
    if gained > allowed and dt / 2 > shortest:
        path.next_step = max(GROWTH**-2, min(ratio, 0.9)) * dt
        return False
    # after the first two steps of a motion a third one of their length, from which the energies are integrated well
    growth = GROWTH if len(before.past) > 1 else 1.0
    path.next_step = min(growth, max(GROWTH**-2, ratio)) * dt
    return True


def _jump(path: TimedPath, segment: Segment) -> Iterator[Stop]:
    """Move the plate at once, in increments; the silicone answers with its instantaneous modulus."""
    length = float(np.linalg.norm(segment.goal - segment.start))
    place, step = 0.0, min(_longest_motion(path, segment) / length, 1.0) if length else 1.0
    while place < 1:
        load_increments.report(0.0)
        ahead = 1.0 if 1 - place <= 1.001 * step else place + step
        target = segment.start + ahead * (segment.goal - segment.start) if ahead < 1 else segment.goal
        tried = time_steps.advance(path.tangent, path.state, target, 0.0, path.stiffness)
        if isinstance(tried, str):
            step = (ahead - place) / 2
            if step < SHORTEST_SHARE:
                yield tried
                return
            continue
        path.state, path.steps, path.iterations = tried, path.steps + 1, path.iterations + tried.iterations
        place = ahead
        yield ""


def _longest_motion(path: TimedPath, segment: Segment) -> float:
    """Return the longest motion of the plate in one step, over D, as in a static path."""
    direction = segment.goal - segment.start
    size = float(np.linalg.norm(direction))
    state = replace(path.state.path, direction=direction / size) if size else path.state.path
    return load_increments.longest_increment(
        state, float(max(segment.start[0], segment.goal[0])), path.scene.accuracy.friction_step_factor
    )
