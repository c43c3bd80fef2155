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

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fem.accuracy import LEAST_TOLERANCE, STANDARD, Accuracy
from fem.analyses import time_steps
from fem.analyses.time_steps import ViscousState
from fem.model import viscoelasticity
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.viscoelasticity import ViscousLaw
from fem.results.lateral_stiffness import SidewaysModel, StabilityMargin
from fem.results.postprocess import reached_load, read
from fem.scene import Model, Scene
from fem.solution import STABLE, UNKNOWN, Solution, Stop
from fem.solve import load_increments
from fem.solve.active_set import KeptTangent
from fem.solve.load_case_models import path_models
from fem.solve.load_increments import Reached, find_equilibrium, path_at
from fem.solve.load_stepping import Path
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from geometry.relaxation import relaxation_of

__all__ = ["TimeControl", "TimedLoad", "TimedState", "ViscousLaw", "follow"]

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
    solution : as of a static solve; its energy is that stored in silicone and springs. Whether a press is stable
        sideways is that of slow loading to its depth, which has nearly the same pose; with Coulomb friction it is not
        known.
    time_error : estimated error of the force along the last motion from the time steps, over the largest such force.
    work, dissipated : work of the plate since the beginning, and energy dissipated in the silicone, mJ.
    step : number of time steps so far.
    """

    time: float
    solution: Solution
    time_error: float
    work: float
    dissipated: float
    step: int

    @property
    def balance(self) -> float:
        """Work that is neither stored nor dissipated, mJ: an error of the time steps."""
        return self.work - self.solution.energy - self.dissipated - self.solution.dissipated


@dataclass(frozen=True, slots=True)
class TimeControl:
    """Choice of the time steps.

    Attributes
    ----------
    tolerance : error of the force from the time steps over the largest force.
    largest_step : longest time step, s; None: no bound.
    kappa : stiffness number of the plate without Coulomb friction (`fem.model.plate_contact`), at the deepest load.

    Raises
    ------
    BadInput
        A value is out of range.
    """

    tolerance: float = 1e-3
    largest_step: float | None = None
    kappa: float = SECTION_KAPPA

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
) -> Iterator[TimedState]:
    """Follow a path of loads in time from rest at time 0.

    Parameters
    ----------
    loads : in the order of their times, from 0 on; two loads at one time are a jump, which is elastic.
    law : "prony" or "finite", see `fem.model.viscoelasticity`.
    steps : default: a tolerance of 1e-3.
    every_step : yield the state after each time step, not only at each load.

    Yields
    ------
    The states. Where a step has no solution, the last state that has one, with its status and message.

    Raises
    ------
    BadInput
        Before the first state, if loads or tolerances are not allowed.
    """
    if not loads:
        raise BadInput("a path in time needs at least one load")
    for before, after in itertools.pairwise([0.0, *(timed.time for timed in loads)]):
        if not before <= after < math.inf:
            raise BadInput(
                f"times must be finite and must not decrease from 0 s on; got {after:g} s after {before:g} s"
            )
    scene = Scene(design, tuple(timed.load for timed in loads), accuracy, magnet, model)
    if scene.solid:
        raise BadInput(f"model {scene.model} has no time steps: choose auto, axisymmetric or harmonic")
    glued: Load | None = None
    for load in scene.loads:
        if load.bonds_contact and (glued is None or glued.depth != load.depth):
            raise BadInput("a plate that sticks needs one load for the press and a later one for the shear")
        glued = load
    path = TimedPath(scene, law, steps or TimeControl())
    return _follow(path, _segments(scene, loads), every_step)


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
        # the velocity of a sine wave of 24 loads changes by less than 0.3 of its largest value
        if jump or sheared or np.linalg.norm(after.velocity - before.velocity) > 0.3 * fastest:
            run += 1
        segments[i] = replace(after, run=run)
    return segments


def _follow(path: TimedPath, segments: Sequence[Segment], every_step: bool) -> Iterator[TimedState]:
    state, run, step = path.rest, -1, 0.0
    for segment in segments:
        duration = sum(part.end - part.begin for part in segments if part.run == segment.run)
        if segment.run != run:
            run, step = segment.run, LONGEST_SHARE / 2 * duration
            state = time_steps.begin_motion(state, segment.goal - segment.start)
        if segment.goal[1:].any() and not state.path.sheared:
            state = path.begin_shear(state)
        iterations = told = 0
        for reached in path.march(state, segment, step, duration):
            state, stop, step, iterations = reached.state, reached.stop, reached.step, reached.iterations
            if stop or (every_step and state.time < segment.end):
                load = reached_load(state.path, segment.load, path.scene)
                yield _read(path, state, load, iterations - told, stop)
                told = iterations
            if stop:
                return
        yield _read(path, state, segment.load, iterations - told)


def _read(path: TimedPath, state: ViscousState, load: Load, iterations: int, stop: Stop = "") -> TimedState:
    unit = path.scene.design.E_now * path.scene.design.D**3
    (work, absorbed), stored = state.works.tolist(), state.history.stored(state.points)
    touched = state.largest > 0
    solution = read(state.path, path.scene, load, stop, iterations=iterations, margin=path.margin, touched=touched)
    return TimedState(
        time=state.time,
        solution=replace(solution, energy=(stored + state.elastic) * unit),
        time_error=state.error / max(state.largest, path.least_force) if state.error else 0.0,
        work=work * unit,
        # without branches the silicone is elastic: what is left is an error of the integrals
        dissipated=(absorbed - stored) * unit if len(state.errors) else 0.0,
        step=state.step,
    )


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight motion.

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

    def at(self, place: float) -> Array:
        """Return the position (3,) at a share of the motion."""
        return self.goal if place == 1 else self.start + place * (self.goal - self.start)


class TimedPath:
    """Models and solver of a path in time; its states are frozen values.

    rest : the state at rest.
    least_force : force over E D^2 that errors refer to at least.
    """

    def __init__(self, scene: Scene, law: ViscousLaw, control: TimeControl) -> None:
        deepest = max(load.depth for load in scene.loads)
        # the mesh is that of the deepest load and of a glued area; states that carry less are read on the same mesh
        pressed = tuple(load for load in scene.loads if load.depth == deepest)
        sheared = (load if load.bonds_contact else replace(load, depth=deepest) for load in scene.loads)
        models = path_models(replace(scene, loads=(*pressed, *(load for load in sheared if load.shears_tip))))
        self.scene, self._control, self._tangent = scene, control, KeptTangent()
        # it supplies the models and takes no increments
        self._path = Path(replace(models, predictor=None, kappa=control.kappa))
        rest, depth = self._path.rest, deepest / scene.design.D
        relaxation, e = relaxation_of(scene.design), rest.d.elements
        instantaneous = 1.0 if scene.design.modulus == "instantaneous" else 1 / relaxation.rest
        points = len(e.angles.theta), *e.weights.shape
        history = viscoelasticity.at_rest(law, relaxation, points, instantaneous)
        stiffness = rest.plate_at(np.array([depth, 0.0, 0.0])).stiffness
        rest = replace(rest, stiffness=stiffness)
        self.rest = ViscousState(rest, history, time_steps.measure(rest, rest.u), np.zeros(len(history.times)))
        # errors refer to a share of Hertz's force at the deepest load at least: at first touch the force is nearly 0
        self.least_force = 0.3 * instantaneous * 4 / 3 * math.sqrt(scene.shape.R) * depth**1.5
        self._sideways = SidewaysModel(rest.d, scene.accuracy.section_size)
        self._stable_to = 0.0

    def begin_shear(self, state: ViscousState) -> ViscousState:
        """Return a state in the model of a shear, with glued contact where required."""
        after = self._path.begin_shear(state.path)
        self._tangent.drop()
        if after.d is not state.path.d:
            self._tangent = KeptTangent()
        return time_steps.raised(state, after)

    def margin(self, state: PathState) -> StabilityMargin:
        """Return the distance of a press from sideways buckling: that of slow loading to its depth.

        The pose of a press hardly depends on the modulus, and the tangent of a time step has no sideways model. The
        margin shrinks with the depth, so a press less deep than a stable one is stable, with a margin not known.
        """
        unknown, depth = StabilityMargin(None, None, UNKNOWN), float(state.position[0])
        if state.friction is not None:
            return unknown
        if depth <= self._stable_to:
            return replace(unknown, stability=STABLE)
        slow = find_equilibrium(KeptTangent(), state, state.q, state.plate)
        if not slow.converged:
            return unknown
        margin = self._sideways.margin(path_at(state, slow, state.position, state.plate))
        if margin.stability.is_stable:
            self._stable_to = depth
        return margin

    def march(
        self, state: ViscousState, segment: Segment, step: float, duration: float
    ) -> Iterator[Reached[ViscousState]]:
        """Follow a segment in a smooth part of the path of a duration, s; the first step is about `step` long."""
        factor, length = self.scene.accuracy.friction_step_factor, float(np.linalg.norm(segment.goal - segment.start))
        longest = load_increments.longest_increment(state.path, segment.start, segment.goal, factor)
        longest = longest / length if length else math.inf  # as a share of the segment
        if segment.end == segment.begin:
            # the silicone answers to a jump with its instantaneous modulus
            return load_increments.march_in_increments(
                state,
                longest,
                SHORTEST_SHARE,
                lambda state, place, _: time_steps.advance(self._tangent, state, segment.at(place), 0.0),
            )
        longest *= segment.end - segment.begin
        longest = min(longest, LONGEST_SHARE * duration, self._control.largest_step or math.inf)
        shortest, start = SHORTEST_SHARE * duration, Reached(state, "", 0, segment.begin, step)
        attempt = functools.partial(self._attempt, segment, longest, shortest)
        return load_increments.march(start, segment.end, shortest, attempt)

    def _attempt(
        self, segment: Segment, longest: float, shortest: float, now: Reached[ViscousState]
    ) -> list[Reached[ViscousState]]:
        """Take one time step, or the first two of a smooth motion, shorter ones until they are accurate enough."""
        # the error of a first step is known after the second one, so both are tried before the first one is accepted
        left, count = segment.end - now.place, 1 if now.state.past or not len(now.state.errors) else 2
        step, iterations = now.step, 0
        while True:
            # equal last steps are better than one long and one tiny step
            dt = left / max(math.ceil(left / min(step, longest) * (1 - 1e-9)), count)
            states = [now.state]
            for k in range(count):
                ahead = left - (k + 1) * dt
                share = 1.0 if ahead <= dt * 1e-9 else 1 - ahead / (segment.end - segment.begin)
                tried = time_steps.advance(self._tangent, states[-1], segment.at(share), dt)
                iterations += tried.iterations
                if tried.stop:
                    before = replace(now.state, past=())
                    return [Reached(before, tried.stop, iterations, now.place, dt / 2)]
                states.append(tried.state if share < 1 else replace(tried.state, time=segment.end))
            if count == 2:
                states[1] = time_steps.with_error_of_first(*states)
            accurate, step = self._next_step(states[-2], states[-1], dt, shortest)
            if accurate:
                return [Reached(state, "", iterations, state.time, step) for state in states[1:]]

    def _next_step(self, before: ViscousState, tried: ViscousState, dt: float, shortest: float) -> tuple[bool, float]:
        """Return whether a step of length dt is accurate enough, and the length of the next one."""
        decayed = np.exp(-dt / before.history.times) * before.errors
        gained = float(np.abs(tried.errors - decayed).sum())
        permitted = self._control.tolerance / time_steps.CERTAINTY * max(tried.largest, self.least_force)
        allowed = max(BUDGET / 10 * permitted, BUDGET * (permitted - float(np.abs(decayed).sum())))
        ratio = GROWTH if gained == 0 else (SAFETY * allowed / gained) ** (1 / 3)
        if gained > allowed and dt / 2 > shortest:
            return False, max(GROWTH**-2, min(ratio, 0.9)) * dt
        # a third step is as long as the first two of a motion, so that the energies are integrated well
        growth = GROWTH if len(before.past) > 1 else 1.0
        return True, min(growth, max(GROWTH**-2, ratio)) * dt
