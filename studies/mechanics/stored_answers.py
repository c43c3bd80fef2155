"""What a verb asks of the finite elements: the store first, and what it lacks is solved here and kept.

The store holds all numbers of an answer by their names. The deformed body of a state is not among them: pictures and
files of it need a solve. Nor are motions whose states depend on more than a position of a path (`is_kept`). Studies
of many cases, which other processes solve, ask by `solve_plan`, for the same paths.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fem.accuracy import Accuracy
from fem.scene import Model, Scene
from fem.solution import ForceOutOfReach, Solution
from geometry.bad_input import SolveFailed
from geometry.design import Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress
from studies.mechanics import path_solver
from studies.mechanics.path_solver import Answer, Place
from studies.mechanics.store import Position, Store, as_stored
from studies.mechanics.stored_solutions import restored_sensor

if TYPE_CHECKING:
    from fem.analyses.force_targets import ForceTarget
    from fem.analyses.vibration import VibratingSensor


def asked(place: Place, store: Store, values: Iterable[str] = (), progress: Progress | None = None) -> Answer:
    """Return the only answer of a path, for the design of its place.

    What failed because a process died is solved again.

    values : names that it must have; one that was stored without them is solved again.
    """
    state = store.states(place.content, [place.at]).get(place.at)
    if state is None or state.outcome == "transient" or path_solver.lacks(state, values):
        ((solved, _),) = path_solver.solved(path_solver.task(1, place, [place.at]), progress)
        store.add(place.content, [solved])
        # read as it is stored, so that it has the same digits the next time
        state = store.states(place.content, [place.at])[place.at]
    design = place.scene.design
    answer = path_solver.answer(state, place.scene.accuracy.section_size)
    return answer.of(design.D, design.E_now, place.direction)


def vibrating(
    design: Design,
    load: Load,
    band: tuple[float, float],
    accuracy: Accuracy,
    magnet: Magnet,
    store: Store,
    progress: Progress | None = None,
) -> VibratingSensor:
    """Return the sensor of `fem.analyses.vibration.vibrating_sensor` with that on a coarser mesh, for a load that
    `check_vibration` takes.

    SolveFailed where the load is not reached, or the state there is unstable.
    """
    from fem.analyses.vibration import vibrating_scene

    scene = vibrating_scene(design, load, accuracy, magnet)
    place = path_solver.place(scene, "response", options={"lowest": band[0], "highest": band[1]})
    found = asked(place, store, ["sensor"], progress)
    if not found.values:
        raise SolveFailed(found.message)
    sensor = restored_sensor(found.values["sensor"], scene, load, band)
    return replace(sensor, state=replace(sensor.state, message=found.message))


def held(
    design: Design,
    targets: Sequence[ForceTarget],
    accuracy: Accuracy,
    magnet: Magnet,
    model: Model,
    store: Store,
    progress: Progress | None = None,
) -> Iterator[Solution]:
    """Yield the solution with the forces of each target, with error estimates; each is kept as soon as it is found.

    Those that the store lacks are searched for on one path. A solution that was found in the store has no field.
    ForceOutOfReach where no state has the forces, and SolveFailed where there is none (no mesh).
    """
    from fem.analyses.force_targets import target_scene

    places = []
    for target in targets:
        scene = target_scene(design, target, accuracy, magnet=magnet, model=model)
        force = [target.force, None if target.shear_force is None else list(target.shear_force)]
        places.append(path_solver.place(scene, "force", options={"targets": [force]}))
    kept = [store.states(place.content, [place.at]).get(place.at) for place in places]
    found = [None if state is None or state.outcome == "transient" else state for state in kept]
    lacking = [place for place, state in zip(places, found, strict=True) if state is None]
    search: Iterator[path_solver.Reached] = iter(())
    if lacking:
        wanted = [target for place in lacking for target in place.options["targets"]]
        search = path_solver.solved(
            replace(path_solver.task(1, lacking[0], []), options={"targets": wanted}), progress
        )
    for target, place, state in zip(targets, places, found, strict=True):
        body: Solution | None = None
        if state is None:
            fresh, body = next(search)
            store.add(place.content, [fresh])
            state = as_stored(fresh)
        load, values = target.load_at(0.0, 1.0), state.answer.get("values")
        if values:
            d, x, y = (values[f"{name}_mm"] for name in ("depth", "shear_x", "shear_y"))
            load = replace(load, depth=d, shear_x=x, shear_y=y)
        solution = path_solver.solution(state, place, load, design)
        if solution is None:
            raise SolveFailed(state.answer["message"])
        solution = solution if body is None else replace(solution, field=body.field)
        if state.outcome != "ok":
            raise ForceOutOfReach(state.answer["message"], solution)
        yield solution


def is_kept(scene: Scene) -> bool:
    """Return whether the states of a scene can be kept: not on a mesh of one's own, and not those that depend on the
    loads before them, as under Coulomb friction a depth does to which the plate comes back."""
    depths = [load.depth for load in scene.loads]
    back = any(second < first for first, second in itertools.pairwise(depths))
    return scene.mesh is None and not (scene.coulomb is not None and back)


def walked(
    scene: Scene, store: Store, progress: Progress | None = None, walk: path_solver.Walk | None = None
) -> Iterator[Solution]:
    """Yield the solution of each load of a scene of kept states, until the path stops, with error estimates.

    It ends with the last state that was reached, or with SolveFailed where there is none (no mesh). Each state is
    kept as soon as it is reached, so that an interrupted path continues there. A solution that was found in the store
    has no field.

    walk : follows what the store lacks; default: `fem.equilibrium.walk`.
    """
    places = [path_solver.place(replace(scene, loads=(load,))) for load in scene.loads]
    content, wanted = places[0].content, ("sideways_stiffness_ratio",)
    states = store.states(content, {one.at for one in places})
    lacking = {
        one.at
        for one in places
        if (state := states.get(one.at)) is None
        or state.outcome == "transient"
        or path_solver.lacks(state, wanted, whole=True)
    }
    fresh: dict[Position, Solution | None] = {}
    solving: Iterator[path_solver.Reached] = iter(())
    if lacking:
        reached = sorted({*store.reached(content)} - lacking)
        task = path_solver.task(1, places[0], sorted(lacking), reached, ratios=True)
        solving = path_solver.solved(task, progress, walk)
    for load, at_place in zip(scene.loads, places, strict=True):
        while at_place.at in lacking:
            state, solved = next(solving)
            store.add(content, [state])
            states[state.position], fresh[state.position] = as_stored(state), solved
            lacking.discard(state.position)
        state = states[at_place.at]
        found = path_solver.solution(state, at_place, load, scene.design)
        if found is None:
            raise SolveFailed(state.answer["message"])
        body = fresh.get(at_place.at)
        yield found if body is None else replace(found, field=body.field)
        if state.outcome != "ok":
            return


def with_bodies(scene: Scene, store: Store) -> list[Solution]:
    """Return what `walked` yields, with the deformed bodies, which are solved for without error estimates where the
    states came from the store."""
    from fem import equilibrium

    states = list(walked(scene, store))
    lacking = [state.load for state in states if state.field is None]
    if not lacking:
        return states
    bodies = {one.load: one.field for one in equilibrium.walk(replace(scene, loads=tuple(lacking)), estimate=False)}
    return [replace(state, field=state.field or bodies.get(state.load)) for state in states]
