"""Integration of a viscoelastic path in time: its models and present state, and the choice of the time steps."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fem.analyses import time_steps
from fem.analyses.time_steps import ViscousState
from fem.model import viscoelasticity
from fem.model.plate_contact import SECTION_KAPPA
from fem.model.viscoelasticity import Branches
from fem.results.lateral_stiffness import SidewaysModel, StabilityMargin, estimate_margin
from fem.scene import Scene
from fem.solve import increment_watch, load_increments
from fem.solve.direct_solver import Solver
from fem.solve.inertia import STABLE, UNKNOWN
from fem.solve.kept_tangent import KeptTangent
from fem.solve.load_case_models import PathModels, path_models
from fem.solve.load_increments import find_equilibrium, path_at
from fem.solve.load_stepping import Path
from fem.solve.newton import Stop
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Load
from geometry.relaxation import relaxation_of

FIRST_SHARE = 1 / 24
"""First step of a smooth part of the path, over its duration."""
LONGEST_SHARE = 1 / 12
"""Longest step over the duration of its part, so that the energies are integrated well."""
BUDGET, LEAST_BUDGET = 0.5, 0.05
"""Shares of the permitted error that a single step may add: of what the errors carried so far leave, and at least."""
SHORTEST_SHARE = 1e-4
"""Step over the duration of its part below which the path stops: it has then reached a limit."""
SAFETY, GROWTH, LEAST = 0.8, 2.0, 0.25
"""Share of the permitted error that a step aims at, and the largest and least ratio of a step to the last one."""
HERTZ_SHARE = 0.3
"""Share of the force of a Hertz contact at the deepest load that errors refer to at least: at first touch the force
itself is nearly zero."""


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
    shares = np.array(relaxation.shares)
    return Branches(
        shares, np.array(relaxation.times), 1.0 if design.modulus == "instantaneous" else 1 / relaxation.rest
    )


class TimedPath:
    """Models, solver and present state of a path in time."""

    def __init__(self, scene: Scene, law: str, kappa: float | None) -> None:
        deepest = max(load.depth for load in scene.loads)
        # the mesh is that of the deepest load and of a glued area; states that carry less are read on the same mesh
        pressed = tuple(load for load in scene.loads if load.depth == deepest)
        sheared = (load if load.bonds_contact else replace(load, depth=deepest) for load in scene.loads)
        models = path_models(replace(scene, loads=(*pressed, *(load for load in sheared if load.shears_tip))))
        self.scene, self.models, self.kept = scene, models, KeptTangent(Solver())
        self._path = _static_path(scene, models, kappa)
        state = self._path.state
        R, depth = scene.shape.R, deepest / scene.design.D
        self.stiffness = state.kappa / (R if state.grip else math.sqrt(R * depth) if depth else R)
        branches, e = branches_of(scene.design), state.d.elements
        history = viscoelasticity.at_rest(law, branches, (len(e.angles.theta), *e.weights.shape))
        self.state = time_steps.at_rest(time_steps.with_stiffness(state, self.stiffness), history)
        self.least_force = HERTZ_SHARE * branches.instantaneous * 4 / 3 * math.sqrt(R) * depth**1.5
        self.steps, self.iterations, self.next_step = 0, 0, 0.0
        self._sideways = SidewaysModel(state.d) if state.d.model == "axisymmetric" else None
        self._stable_to = 0.0

    def begin_motion(self, segment: Segment, duration: float) -> None:
        """Prepare a smooth part of the path of a duration, s, which begins with a segment."""
        self.state = time_steps.begin_motion(self.state, segment.goal - segment.start)
        self.next_step = FIRST_SHARE * duration

    def begin_shear(self) -> None:
        """Change to the model of a shear and glue the contact where required."""
        self._path.restart(self.state.path)
        self._path.begin_shear()
        after = self._path.state
        self.kept.drop()
        if after.d is not self.state.path.d:
            self.kept.solver.close()
            self.kept = KeptTangent(Solver())
        self.state = time_steps.raised(self.state, replace(after, reduced=None))

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
        solver = Solver()
        try:
            slow = find_equilibrium(solver, state, state.q, state.plate)
        finally:
            solver.close()
        if not slow.converged:
            return unknown
        margin = estimate_margin(self._sideways, path_at(state, slow, state.position, state.plate))
        if margin.stability.is_stable:
            self._stable_to = depth
        return margin

    def close(self) -> None:
        """Free the memory of the factorisations."""
        self.kept.solver.close()
        self._path.close()

    def reached_load(self, load: Load) -> Load:
        """Return the load at the present position, of the kind of `load`."""
        (x, y), D = self.scene.direction, self.scene.design.D
        depth, *along = self.state.path.position * D
        shear = np.array([[x, -y], [y, x]]) @ along
        return replace(load, depth=max(float(depth), 0.0), shear_x=float(shear[0]), shear_y=float(shear[1]))


def _static_path(scene: Scene, models: PathModels, kappa: float | None) -> Path:
    """Return the path at rest that supplies the models; it takes no increments."""
    return Path(
        models.first.build(),
        scene.grip,
        scene.plate_tilt,
        raised=None if models.raised is None or not scene.sideways else models.raised.build,
        rim=models.glued_radius,
        mu=scene.coulomb,
        kappa=kappa or SECTION_KAPPA,
    )


@dataclass(frozen=True, slots=True)
class Limits:
    """Permitted error of the force over the largest force, and shortest and longest step, s."""

    error: float
    shortest: float
    longest: float


def step_limits(error: float, duration: float, largest_step: float | None) -> Limits:
    """Return the limits of the steps in a smooth part of the path of a duration, s."""
    longest = LONGEST_SHARE * duration
    return Limits(error, SHORTEST_SHARE * duration, longest if largest_step is None else min(longest, largest_step))


def march(path: TimedPath, segment: Segment, limits: Limits) -> Iterator[Stop]:
    """Take the time steps of a segment; yield after each why the path stopped, or ""."""
    if segment.end == segment.begin:
        yield from _jump(path, segment)
        return
    speed = float(np.linalg.norm(segment.velocity))
    longest = min(_longest_motion(path, segment) / speed if speed else math.inf, limits.longest)
    while path.state.time < segment.end:
        increment_watch.report(0.0)
        left = segment.end - path.state.time
        # equal last steps are better than one long and one tiny step
        count = math.ceil(left / min(path.next_step, longest) * (1 - 1e-9))
        # the error of a first step is known after the second one, so both are tried before the first one is accepted
        pair = not path.state.past and len(path.state.errors) > 0
        dt = left / max(count, 2 if pair else 1)
        tried = _tried(path, segment, dt, 2 if pair else 1)
        if isinstance(tried, str):
            path.state, path.next_step = replace(path.state, past=()), dt / 2
            if path.next_step < limits.shortest:
                yield tried
                return
            continue
        if pair:
            tried[0] = time_steps.with_error_of_first(path.state, *tried)
        if not _choose_next_step(path, tried[0] if pair else path.state, tried[-1], dt, limits):
            continue
        for state in tried:
            last = segment.end - state.time <= dt * 1e-9
            path.state = replace(state, time=segment.end) if last else state
            path.steps += 1
            yield ""


def _tried(path: TimedPath, segment: Segment, dt: float, count: int) -> list[ViscousState] | Stop:
    """Return the states after each of some equal steps, or why there are none."""
    states: list[ViscousState] = []
    for _ in range(count):
        state = states[-1] if states else path.state
        left = segment.end - state.time - dt
        target = segment.goal - left * segment.velocity if left > dt * 1e-9 else segment.goal
        tried = time_steps.advance(path.kept, state, target, dt, path.stiffness)
        if isinstance(tried, str):
            return tried
        path.iterations += tried.iterations
        states.append(tried)
    return states


def _choose_next_step(path: TimedPath, before: ViscousState, tried: ViscousState, dt: float, limits: Limits) -> bool:
    """Set the length of the next step after one of length dt, and return whether that one is accurate enough."""
    decayed = np.exp(-dt / before.history.branches.times) * before.errors
    gained = float(np.abs(tried.errors - decayed).sum())
    whole = limits.error / time_steps.CERTAINTY * max(tried.largest, path.least_force)
    allowed = max(LEAST_BUDGET * whole, BUDGET * (whole - float(np.abs(decayed).sum())))
    ratio = GROWTH if gained == 0 else (SAFETY * allowed / gained) ** (1 / 3)
    if gained > allowed and dt / 2 > limits.shortest:
        path.next_step = max(LEAST, min(ratio, 0.9)) * dt
        return False
    # after the first two steps of a motion a third one of their length, from which the energies are integrated well
    growth = GROWTH if len(before.past) > 1 else 1.0
    path.next_step = min(growth, max(LEAST, ratio)) * dt
    return True


def _jump(path: TimedPath, segment: Segment) -> Iterator[Stop]:
    """Move the plate at once, in increments; the silicone answers with its instantaneous modulus."""
    length = float(np.linalg.norm(segment.goal - segment.start))
    place, step = 0.0, min(_longest_motion(path, segment) / length, 1.0) if length else 1.0
    while place < 1:
        increment_watch.report(0.0)
        ahead = 1.0 if 1 - place <= 1.001 * step else place + step
        target = segment.start + ahead * (segment.goal - segment.start) if ahead < 1 else segment.goal
        tried = time_steps.advance(path.kept, path.state, target, 0.0, path.stiffness)
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
