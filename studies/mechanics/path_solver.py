"""Paths of the store: where the answer to a case is, what it says of similar cases, and the solves of missing states.

The finite elements use lengths over D and stresses over E, so geometrically similar designs of one material law share
a path (see `fem.scene.Scene.dimensionless`). The states of a path differ in their position only, the depth and the
shear of the plate over D:

- a press: all depths; a frictionless press does not depend on the other depths (`fem.solve.load_case_models`), and
  with friction or an imperfection the path leads straight from rest to the depth;
- a shear under a plate, glued or with Coulomb friction: all shears in one direction at one depth, because the path is
  a press to this depth and then a shear that only grows;
- a grip: all shears in one direction.

The body is one of revolution. So without a tilted plate and without an imperfection the direction of a shear does not
matter: all shears are solved along x, and `Place.direction` turns the answer. Tetrahedra of the whole body (model
full) are no exact body of revolution, and keep the direction.

More quantities are stored, each as a path with a single state: the critical depth of a design with a free or a
guided tip, a small shear and the natural frequencies about a press, and its vibration and cycles
(`timed_quantities`). So is a state with wanted forces, in the units of its design: the depth and the shear that have
them are found by a search on a path of its own.

An answer holds the D and E of the design that was solved, and `Answer.of` scales it to a similar one. A `Task` is all
that is missing of one path; a worker process solves it, and returns its states for the store.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

from fem.physics_version import ESTIMATES, PHYSICS
from fem.scene import Scene
from fem.solution import ForceOutOfReach, Solution
from geometry.bad_input import SolveFailed
from geometry.design import Design
from geometry.loads import ANSWERED, Load, Response
from geometry.messages import Progress
from studies.mechanics import store, timed_quantities
from studies.mechanics.store import Outcome, Position, State, position
from studies.mechanics.stored_solutions import of_similar, recorded, restored, turned
from studies.mechanics.timed_quantities import STILL, PlateMotion
from studies.output.provenance import versions
from studies.quantities import QUANTITIES, Path, stored_values

if TYPE_CHECKING:
    from fem.analyses.force_targets import ForceTarget

Kind = Literal["states", "force", "small shear", "slow loading"] | Path
"""What a path holds."""
KINDS: dict[str, Kind] = {name: each.path for name, each in QUANTITIES.items() if each.path}
"""Quantities that are paths of their own in the store."""
MODES = 6
"""Number of natural frequencies that sweeps solve for."""
PRESSED: tuple[Kind, ...] = ("critical depth", "small shear", "modes")
"""Kinds that are about a frictionless press."""


@dataclass(frozen=True)
class Place:
    """Where the answer of a case is stored.

    scene : the case as it is solved, with a single load.
    direction : direction of the case's shear, to which the answer is turned.
    motion : of the plate, of cycles only; other answers do not depend on it.
    options : what else is asked: "guided" (True) of a critical depth, "count" of modes; of cycles, in place of a
        motion, "frequency", "waveform", "cycles", "hold" and "tolerance", for all states and not only the last loop;
        of a response "lowest" and "highest", Hz, for the sensor at all frequencies between them; of forces "targets",
        each with its normal force, N, and its force (x, y) along the plate or None.
    """

    scene: Scene
    kind: Kind
    at: Position
    direction: tuple[float, float] = (1.0, 0.0)
    motion: PlateMotion = STILL
    options: Mapping[str, Any] = field(default_factory=dict)

    @functools.cached_property
    def key(self) -> str:
        """Key of the path in the store."""
        return store.key(self.content)

    @property
    def content(self) -> dict[str, Any]:
        """Everything on which the states of the path depend except their position, with the versions of the physics
        and of the estimates."""
        scene, kind = self.scene, self.kind
        if kind == "response":
            return timed_quantities.response_content(scene, self.options)
        if kind == "cycle":
            return timed_quantities.cycle_content(scene, self.motion, self.options)
        values = scene.dimensionless() | {"estimates": ESTIMATES}
        loads, load = values.pop("loads"), scene.loads[0]
        first = loads[0]
        if kind == "critical depth":
            return values | {"quantity": kind, "physics": PHYSICS[kind], **self.options}
        if kind == "slow loading":
            return timed_quantities.slow_content(scene)
        if kind == "small shear":
            return values | {"quantity": kind, "load": {"depth": first["depth"]}, "physics": PHYSICS[scene.model]}
        if kind == "modes":
            ratio = scene.design.magnet_density / scene.design.density if scene.magnet == "rigid" else 0.0
            pressed = {
                "depth": first["depth"],
                "density_ratio": float(f"{ratio:.12g}"),
                "count": MODES,
                **self.options,
            }
            return values | {"quantity": kind, "load": pressed, "physics": PHYSICS[kind]}
        kept = {name: value for name, value in first.items() if name not in ("depth", "shear")}
        if kind == "force":
            ((force, shear_force),) = self.options["targets"]
            held = {"force_N": force, "shear_force_N": shear_force, **timed_quantities.units(scene.design)}
            return values | {"quantity": kind, "load": kept | held, "physics": PHYSICS[scene.model]}
        way = {
            "sheared_at_depth": first["depth"] if load.shears_tip else None,
            "direction": [round(part, 12) + 0.0 for part in unit_vector(load)] if load.shears_tip else None,
        }
        return values | {"quantity": kind, "load": kept | way, "physics": PHYSICS[scene.model]}


def place(
    scene: Scene, kind: Kind = "states", motion: PlateMotion = STILL, options: Mapping[str, Any] | None = None
) -> Place:
    """Return where the answer of a scene with a single load is stored; `options` as in `Place`."""
    (load,) = scene.loads
    D = scene.design.D
    if kind in PRESSED:
        # the load of a critical depth does not matter; any depth that fits every beam stands for it
        pressed = Load(depth=0.01 * D if kind == "critical depth" else load.depth)
        pressing = replace(scene, loads=(pressed,), model="axisymmetric")
        return Place(pressing, kind, (0.0, 0.0), options=options or {})
    if kind == "states":
        alone, direction = _canonical(scene, load)
        return Place(replace(scene, loads=(alone,)), kind, position_of(alone, D), direction)
    if kind == "response" and options:
        return Place(timed_quantities.sensor_scene(scene), kind, (0.0, 0.0), options=options)
    if kind == "force":
        return Place(scene, kind, (0.0, 0.0), options=options or {})
    sections = replace(scene, model="auto")
    if kind == "slow loading" or (kind == "cycle" and options):
        # with the direction of their shear along x, and in the units of the design
        return Place(sections, kind, (0.0, 0.0), options=options or {})
    along_x = replace(sections, loads=(_canonical(sections, load)[0],))
    if kind == "cycle":
        timed_quantities.cycle_of(along_x, motion)
        return Place(along_x, kind, (0.0, 0.0), motion=motion)
    return Place(timed_quantities.rest_scene(along_x, motion.frequency), kind, (0.0, 0.0))


def _canonical(scene: Scene, load: Load) -> tuple[Load, tuple[float, float]]:
    if not load.shears_tip:
        friction = "none" if load.coulomb is None else load.friction
        return replace(load, shear_x=0.0, shear_y=0.0, friction=friction), (1.0, 0.0)
    if load.plate_tilt or load.imperfection or scene.model == "full":
        return load, (1.0, 0.0)
    return replace(load, shear_x=load.shear, shear_y=0.0), unit_vector(load)


def position_of(load: Load, D: float) -> Position:
    """Return the position of a load on its path."""
    return position(load.depth / D, math.hypot(*load.imposed_shear) / D)


def unit_vector(load: Load) -> tuple[float, float]:
    """Return the unit vector of a load's shear."""
    return load.shear_x / load.shear, load.shear_y / load.shear


# Answers

NAN = math.nan
SMALLER_STEPS = 4
"""Number of increments, from the nearest solved state, in which a load is tried again on which a solve has failed."""


@dataclass(frozen=True, slots=True)
class Answer:
    """A state that was solved, or the reason why it could not be, for the design that was solved.

    D, E : of the design that was solved, mm and MPa.
    response : None if the solve did not reach the state; `status` and `message` give the reason.
    error_estimate : estimated relative error of the force; NaN if there is no estimate.
    seconds : time of the solve from the previous state, s.
    estimates : estimated relative errors by the names of `fem.solution.Estimates`, those of ESTIMATED.
    values : of a state its largest strain and its sideways stiffness ratio with its half width
        (`fem.solution.Facts`); of other kinds their results: lengths over D, forces over E D^2, frequencies over
        `frequency_unit`.
    path : key of the path in the store; empty where nothing was solved.
    columns : values of the further columns of its model.
    """

    D: float
    E: float
    response: Response | None
    status: str
    message: str
    error_estimate: float
    seconds: float
    estimates: Mapping[str, float | None] = dataclasses.field(default_factory=dict)
    values: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    path: str = ""
    columns: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def of(self, D: float, E: float, direction: tuple[float, float] = (1.0, 0.0)) -> Answer:
        """Return the answer for a geometrically similar design: lengths scale with D, forces with E D^2.

        `direction`: unit vector of the shear; the answer is turned from x to it.
        """
        message = of_similar(self.message, D, self.D)
        if self.response is None:
            return replace(self, D=D, E=E, message=message)
        length = D / self.D
        response = turned(self.response.scaled(length, E / self.E * length**2), direction)
        return replace(self, D=D, E=E, response=response, message=message)


def impossible(message: str) -> Answer:
    """Return the answer to a problem that is impossible, or that a model refuses, for a reason."""
    return Answer(1.0, 1.0, None, "bad_input", message, NAN, 0.0)


@dataclass(frozen=True, slots=True)
class Task:
    """A solve for a worker: the missing states of a path.

    number : number of the path in its study, from 1.
    scene : the missing states as loads, in rising order; their design is that of the path's first case.
    solved : positions of the path that are stored already, from which smaller steps can start.
    options : as in `Place`.
    ratios : whether each press gets its sideways stiffness (`fem.equilibrium.trace`), a third of its time.
    """

    number: int
    scene: Scene
    kind: Kind
    solved: tuple[Position, ...] = ()
    motion: PlateMotion = STILL
    ratios: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)


def task(
    number: int, path: Place, positions: Sequence[Position], reached: Sequence[Position] = (), *, ratios: bool = False
) -> Task:
    """Return the solve of some positions of a path, of which others have been `reached` before."""
    if path.kind != "states":
        return Task(number, path.scene, path.kind, motion=path.motion, options=path.options)
    D, load = path.scene.design.D, path.scene.loads[0]
    scene = replace(path.scene, loads=tuple(_at(load, at, D) for at in positions))
    return Task(number, scene, path.kind, tuple(reached), ratios=ratios)


def _at(load: Load, at: Position, D: float) -> Load:
    depth, shear = at[0] * D, at[1] * D
    # the same load to the last bit if it is the path's own
    if position(load.depth / D, 0.0)[0] == at[0]:
        depth = load.depth
    if not load.shears_tip or position_of(load, D)[1] == at[1]:
        return replace(load, depth=depth)
    x, y = unit_vector(load)
    return replace(load, depth=depth, shear_x=shear * x, shear_y=shear * y)


def solve_task(task: Task) -> list[State]:
    """Solve a task and return its states for the store."""
    return [state for state, _ in solved(task)]


Reached = tuple[State, Solution | None]
"""A state for the store, and the solution with its deformed body, or None where there is none."""


Walk = Callable[..., Iterator[Solution]]
"""Follows the loads of a scene: `fem.equilibrium.walk`, or one that keeps what it needs for another path."""


def solved(task: Task, progress: Progress | None = None, walk: Walk | None = None) -> Iterator[Reached]:
    """Solve a task, and yield each state as soon as it is reached; then those that are not reached.

    A load on which the path stops is tried again in smaller steps, and those behind it with it.

    walk : follows paths of states; default: `fem.equilibrium.walk`.
    """
    if task.kind == "force":
        yield from _held(task, progress)
        return
    if task.kind != "states":
        yield _single(task, progress), None
        return
    scene, left, reached = task.scene, list(task.scene.loads), list(task.solved)
    steps = list[Load]()
    end: tuple[str, str, Solution | None] = ("", "", None)
    for retried in (False, True):
        ends = list[tuple[str, str, Solution | None]]()
        for load, one in zip(
            [*steps, *left], _followed(scene, [*steps, *left], task, ends, progress, walk), strict=False
        ):
            if load not in steps:
                state = _state(scene, load, one, ratios=task.ratios)
                if retried:
                    message = one.message or "reached by smaller steps"
                    state = replace(state, answer=state.answer | {"message": message})
                left.remove(load)
                reached.append(state.position)
                yield state, one
        # an axisymmetric press without friction starts from rest, whatever the steps before it
        alone = scene.model == "axisymmetric" and scene.coulomb is None
        if not retried:
            end = ends[0] if ends else end
            steps = _smaller_steps(left[0], reached, scene.design.D) if left else []
        if not left or alone or not steps or end[0] != "not_converged":
            break
    status, message, last = end
    lost = _lost(message, last)
    yield from ((_stored(scene, load, "failed", status, lost, last.seconds if last else 0.0), last) for load in left)


def _lost(message: str, last: Solution | None) -> dict[str, Any]:
    """Return the answer of a state that is not reached; `last` is the one where the path stops."""
    record = None if last is None else {"load": dataclasses.asdict(last.load), **recorded(last)}
    return {"response": None, "error_estimate": None, "message": message, "reached": record}


def _held(task: Task, progress: Progress | None) -> Iterator[Reached]:
    """Search for the states with the forces of the targets, up to the first that has none."""
    from fem.analyses.force_targets import walk_forces

    scene, given = task.scene, task.options["targets"]
    targets = [target_of(scene, *forces) for forces in given]
    search = walk_forces(
        scene.design, targets, scene.accuracy, magnet=scene.magnet, model=scene.model, progress=progress
    )
    for forces in given:
        stored = functools.partial(_stored, scene, None, options={"targets": [forces]})
        try:
            found = next(search)
        except ForceOutOfReach as error:
            yield stored("failed", "out_of_reach", _lost(str(error), error.state)), error.state
            return
        except SolveFailed as error:
            yield stored("failed", "not_converged", _lost(str(error), None)), None
            return
        load = found.load
        values = {"depth_mm": load.depth, "shear_x_mm": load.shear_x, "shear_y_mm": load.shear_y}
        values["shear_mm"] = load.shear
        yield stored("ok", found.status, recorded(found) | {"values": values}, found.seconds), found


def target_of(scene: Scene, force: float, shear_force: Sequence[float] | None) -> ForceTarget:
    """Return the target of a force, N, and one along the plate, with contact, tilt and imperfection of a scene."""
    from fem.analyses.force_targets import ForceTarget

    aside = None if shear_force is None else (shear_force[0], shear_force[1])
    return ForceTarget(force, aside, scene.loads[0].unmoved)


def _followed(
    scene: Scene,
    loads: Sequence[Load],
    task: Task,
    ends: list[tuple[str, str, Solution | None]],
    progress: Progress | None,
    walk: Walk | None,
) -> Iterator[Solution]:
    """Follow a path; the status, message and last solution of its end, if it stops, are added to `ends`."""
    from fem import equilibrium

    path = replace(scene, loads=tuple(loads))
    try:
        for one in (walk or equilibrium.walk)(path, ratios=task.ratios, progress=progress):
            if one.status not in ANSWERED:
                ends.append((one.status, one.message, one))
                return
            yield one
    except SolveFailed as error:
        ends.append(("not_converged", str(error), None))


def _smaller_steps(load: Load, solved: Sequence[Position], D: float) -> list[Load]:
    end = position_of(load, D)
    along = 1 if load.shears_tip else 0
    start = max((at[along] for at in solved if at[along] < end[along]), default=0.0)
    steps = [start + (end[along] - start) * k / SMALLER_STEPS for k in range(SMALLER_STEPS)]
    positions = [(end[0], step) if along else (step, 0.0) for step in steps if step > 0]
    return [_at(load, at, D) for at in positions]


@functools.cache
def origin() -> str:
    """Return versions and commit, which take longer to find than some presses to solve, once per process."""
    return versions()


def lacks(state: State, values: Iterable[str], *, whole: bool = False) -> bool:
    """Return whether a state was solved without some of the values, which it may have.

    `whole`: or is not known as `solution` returns it.
    """
    if whole and not {"solution", "reached"} & state.answer.keys():
        return True
    return state.outcome == "ok" and not state.answer["values"].keys() >= set(values)


def _state(scene: Scene, load: Load, solution: Solution, *, ratios: bool) -> State:
    facts = solution.facts
    values = {name: getattr(facts, name) for name in stored_values(QUANTITIES)}
    # a press that was not asked for its ratio may have one all the same
    if not ratios and facts.sideways_stiffness_ratio is None and solution.model == "axisymmetric":
        del values["sideways_stiffness_ratio"]
    answer = recorded(solution) | {"values": values}
    return _stored(scene, load, "ok", solution.status, answer, solution.seconds)


def solution(state: State, place: Place, load: Load, design: Design) -> Solution | None:
    """Return the solution of a stored state for a similar design and its load, without its field.

    It is the last state that was reached where the path stops; None where none was.
    """
    values = state.answer if state.outcome == "ok" else state.answer["reached"]
    if values is None:
        return None
    answer, reached = state.answer, load
    length, E = design.D / answer["D_mm"], design.E_now / answer["E_MPa"]
    if state.outcome != "ok":
        at = values["load"]
        (c, s), x, y = place.direction, length * at["shear_x"], length * at["shear_y"]
        reached = replace(load, depth=length * at["depth"], shear_x=c * x - s * y, shear_y=s * x + c * y)
    found = restored(values, reached, length, E, place.direction)
    message = of_similar(answer["message"], design.D, answer["D_mm"])
    if found.facts.remark is None and load.shear + (load.friction == "stick") and not load.shears_tip:
        # the stored press is frictionless
        from fem.results.diagnostics import REMARKS

        remark = "slides_over" if load.shear else "idle_stick"
        found = replace(found, facts=replace(found.facts, remark=remark))
        message = "; ".join(filter(None, (message, REMARKS[remark])))
    return replace(found, message=message, seconds=state.seconds)


def _stored(
    scene: Scene,
    load: Load | None,
    outcome: Outcome,
    status: str,
    answer: dict[str, Any],
    seconds: float = 0.0,
    motion: PlateMotion = STILL,
    options: Mapping[str, Any] | None = None,
) -> State:
    """Return a state with its answer and what was solved; the only one of a path has no load of its own."""
    at = (0.0, 0.0) if load is None else position_of(load, scene.design.D)
    solved = problem_of(scene.design, load or scene.loads[0], motion, options)
    return State(*at, outcome, status, solved | answer, seconds, origin())


def problem_of(
    design: Design, load: Load, motion: PlateMotion, options: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return what was solved, as JSON: D and E, which scale answers to similar designs, and all fields that differ
    from the defaults, by which `store check` solves it again."""
    fields: dict[str, Any] = {
        name: {f.name: v for f in dataclasses.fields(of) if (v := getattr(of, f.name)) != f.default}
        for name, of in (("design", design), ("load", load), ("motion", motion))
    }
    return {
        "D_mm": design.D,
        "E_MPa": design.E_now,
        "solved": fields | ({"options": dict(options)} if options else {}),
    }


def unsolved(task: Task, reason: str) -> list[State]:
    """Return the states of a task that has no answer because its process died."""
    loads = task.scene.loads if task.kind == "states" else (None,)
    answer = {"response": None, "error_estimate": None, "message": reason}
    more: dict[str, Any] = {"motion": task.motion, "options": task.options}
    return [_stored(task.scene, load, "transient", "worker_died", answer, **more) for load in loads]


def _single(task: Task, progress: Progress | None = None) -> State:
    begin = time.perf_counter()
    result: Outcome = "ok"
    try:
        values = SINGLE[task.kind](task, progress or _silent)
        status, message = values.pop("status"), values.pop("message")
    except SolveFailed as error:
        values, result, message = {}, "failed", str(error)
        status = "not_converged" if task.kind in ("critical depth", "small shear") else "failed"
    answer = {"response": None, "error_estimate": values.pop("error_estimate", None), "message": message}
    answer |= {"values": values}
    return _stored(task.scene, None, result, status, answer, time.perf_counter() - begin, task.motion, task.options)


def _silent(fraction: float, text: str) -> None:
    """Report nothing."""


def _critical(task: Task, _: Progress) -> dict[str, Any]:
    from fem.analyses import stability

    design = task.scene.design
    D, unit = design.D, design.E_now * design.D**2
    guided = bool(task.options.get("guided", False))
    state = stability.critical(design, task.scene.magnet, guided=guided, accuracy=task.scene.accuracy)
    return {
        "critical_depth_over_D": None if state.depth is None else state.depth / D,
        "critical_force_over_ED2": None if state.force is None else state.force / unit,
        "stable_to_over_D": state.stable_to / D,
        "force_error_estimate": state.estimates.force,
        "error_estimate": state.estimates.depth,
        "status": "ok",
        "message": state.message,
    }


def _small_shear(task: Task, _: Progress) -> dict[str, Any]:
    """Return the response to a small shear about a press, per length of it: stiffness over E D, tilt times D."""
    from fem.analyses import small_shear

    scene, design = task.scene, task.scene.design
    D, E = design.D, design.E_now
    found = small_shear.small_shear(design, scene.loads[0].depth, scene.magnet, accuracy=scene.accuracy)
    names = ("force", "contact_radius", "stiffness", "shift", "tilt")
    return {
        "force_over_ED2": found.force / (E * D**2),
        "contact_radius_over_D": found.contact_radius / D,
        "stiffness_over_ED": found.stiffness / (E * D),
        "shift": found.shift,
        "tilt_times_D": found.tilt * D,
        **{f"{name}_error_estimate": getattr(found.estimates, name) for name in names},
        "status": found.status,
        "message": "",
    }


def _modes(task: Task, _: Progress) -> dict[str, Any]:
    """Return the lowest natural frequencies about a press: f D (rho / E)^(1/2), with rho in kg/m^3."""
    from fem.analyses.modes import modes

    scene, design = task.scene, task.scene.design
    count = int(task.options.get("count", MODES))
    lowest = modes(design, scene.magnet, count, depth=scene.loads[0].depth, accuracy=scene.accuracy)
    unit = frequency_unit(design.D, design.E_now, design.density)
    values = {"frequency": [f / unit for f in lowest.frequency], "shape": list(lowest.shape)}
    return values | {"estimates": list(lowest.estimates), "status": lowest.status, "message": lowest.message}


def frequency_unit(D: float, E: float, density: float) -> float:
    """Return (E / rho)^(1/2) / D, to which frequencies are proportional; mm, MPa, kg/m^3."""
    return math.sqrt(E / density) / D


def answer(state: State, edge: float) -> Answer:
    """Return the answer of a stored state; its sideways stability is judged here, by the half width of its ratio.

    edge : edge length over D of the sections with which it was solved.
    """
    values = state.answer
    response, error = values["response"], values["error_estimate"]
    response = None if response is None else Response.restored(response)
    of_state, status, message = dict(values.get("values", {})), state.status, values["message"]
    ratio = of_state.get("sideways_stiffness_ratio")
    if ratio is not None and response is not None:
        from fem.results.lateral_stiffness import ratio_half_width, within

        half_width = ratio_half_width(ratio, edge, response.contact_radius / values["D_mm"])
        of_state["sideways_half_width"] = half_width
        # a press that is unstable although its ratio is positive is so for another reason
        if within(ratio, half_width) and (status == "ok" or (status == "unstable" and ratio < 0)):
            said = f"its sideways stiffness is {ratio:.2g} +- {half_width:.2g} of that at rest"
            doubt = f"whether the press has buckled sideways is not known: {said}"
            status, message = "unknown", "; ".join(filter(None, (doubt, message)))
    return Answer(
        D=values["D_mm"],
        E=values["E_MPa"],
        response=response,
        status=status,
        message=message,
        error_estimate=NAN if error is None else error,
        seconds=state.seconds,
        estimates=values.get("estimates", {}),
        values=of_state,
    )


def _slow_loading(task: Task, _: Progress) -> dict[str, Any]:
    from studies.mechanics import loading_cycles

    return loading_cycles.slow_loading(task.scene)


SINGLE: dict[Kind, Callable[[Task, Progress], dict[str, Any]]] = {
    "critical depth": _critical,
    "small shear": _small_shear,
    "modes": _modes,
    "response": lambda task, _: timed_quantities.solve_response(task.scene, task.options),
    "cycle": lambda task, progress: timed_quantities.solve_cycle(task.scene, task.motion, task.options, progress),
    "slow loading": _slow_loading,
}
"""Solves of the quantities that are paths of their own; each returns its values, status, message and, where there
is one, estimated relative error."""
