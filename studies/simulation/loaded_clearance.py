"""Gaps between the beam under load and what stands beside it on the base: Hall elements, their posts and screw heads.

The finite elements take the beam as free around its skin. A press makes it bulge, and a shear bends it: where the
skin then lies in an element or a screw, sensor and model part. The state is that of a plate which sticks to the tip;
its shear points at each obstacle in turn, for the beam is round. What is measured is the least distance of the
deformed skin from the box around an obstacle, negative inside. Its error is that of the motion, at accuracy quick
`MOTION_ERROR` of the largest one, and of the chords between the points of the skin.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fem.physics_version import ESTIMATES, PHYSICS
from geometry.arrays import Array
from geometry.bad_input import BadInput, SolveFailed
from geometry.base import Plan, screw_thread
from geometry.design import Design
from geometry.fabrication.hall_elements import Block, boxes
from geometry.loads import Load
from studies.mechanics.store import Outcome, State, Store, as_stored
from studies.mechanics.stored_solutions import of_similar
from studies.output.deformed_body import SECTORS

if TYPE_CHECKING:
    from fem.scene import Scene

HEAD_WIDTH, HEAD_HEIGHT = 2.0, 0.8
"""Diameter and height of a screw's head over its thread, those of pan heads at most (ISO 7045)."""
MOTION_ERROR = 0.03
"""Largest true error of a shift at accuracy quick, over the shift (`magtip validate errors accuracy`)."""
USUAL_DEPTH, USUAL_SHEAR = 3 / 8, 1 / 8
"""Press and shear over D where no forces are required: the largest press in use, and an eighth of D."""
SKIN, SKIN_DIGITS = "skin", 7
"""Name of the deformed skin among the quantities of the store, and decimal places of its points over D."""
UNSOLVED = "it is not solved yet"
"""Reason of an unknown gap that a solve would make known."""


class Gap(NamedTuple):
    """The least gap of a loaded beam and its error, mm, under which load, and to which obstacle; NaN and why if it is
    unknown."""

    value: float
    error: float
    load: str
    obstacle: str = ""
    why: str = ""


def obstacles(design: Design, plan: Plan) -> dict[str, Block]:
    """Return the boxes around all that stands beside the beam above the base plane, mm, by name."""
    found = {f"the post of {name}": block for name, block in plan.seats.posts.items()} | boxes(design)
    if plan.screw:
        thread = screw_thread(plan.screw)
        half = HEAD_WIDTH * thread / 2
        for k, (x, y) in enumerate(plan.screws, 1):
            corner = x - half, y - half, plan.recess
            found[f"the head of screw {k}"] = Block(corner, (2 * half, 2 * half, HEAD_HEIGHT * thread))
    return {
        name: block
        for name, block in found.items()
        if block.corner[2] + block.sides[2] > 0 and math.hypot(*_centre(block)) > design.R
    }


def least_gap(
    design: Design, plan: Plan, store: Store, forces: tuple[float, float] | None = None, *, solve: bool = True
) -> Gap | None:
    """Return the least gap of the loaded beam; None where nothing stands beside it.

    store : keeps the deformed skin, over D, which serves all places of elements and screws.
    forces : required force along z and along the plate, N; default: `USUAL_DEPTH` and `USUAL_SHEAR`.
    solve : False to answer by the store alone.
    """
    beside = obstacles(design, plan)
    if not beside:
        return None
    depth, shear = USUAL_DEPTH * design.D, USUAL_SHEAR * design.D
    words = f"a press of {depth:.3g} mm with a shear of {shear:.3g} mm"
    if forces:
        words = f"{forces[0]:.3g} N" + (f" with {forces[1]:.3g} N along the plate" if forces[1] else "")
    try:
        skin, motion = _skin(design, Load(depth, shear, friction="stick"), forces, store, solve)
    except (BadInput, SolveFailed) as error:
        return Gap(math.nan, math.nan, words, why=str(error))
    gaps = {name: _distance(_turned(skin, _centre(block)), block) for name, block in beside.items()}
    name = min(gaps, key=lambda each: gaps[each])
    chords = design.R * (1 - math.cos(math.pi / (2 * SECTORS)))
    return Gap(gaps[name], MOTION_ERROR * motion + chords, words, name)


def room(gap: Gap | None) -> list[str]:
    """Return a sentence where a loaded beam keeps clear of all that stands beside it."""
    if gap is None or not gap.value > gap.error:
        return []
    kept = f"Under {gap.load} the beam keeps {gap.value:.2g} +-{gap.error:.1g} mm of room to {gap.obstacle}"
    return [f"{kept}, by finite elements at accuracy quick: a larger load may touch."]


def warning(gap: Gap | None) -> list[str]:
    """Return a sentence where a loaded beam touches what stands beside it, may touch it, or where that is unknown."""
    if gap is None or gap.value > gap.error:
        return []
    if math.isnan(gap.value):
        return [f"whether the beam touches what stands beside it under {gap.load} is not known: {gap.why}"]
    screw = "screw" in gap.obstacle
    remedy = "countersink the screws or set them from below" if screw else "lower c or raise f"
    reached = f"the beam reaches {-gap.value:.2g} +-{gap.error:.1g} mm into {gap.obstacle} (finite elements)"
    if gap.value >= -gap.error:
        reached = (
            f"the beam may touch {gap.obstacle}: its gap is {gap.value:.2g} +-{gap.error:.1g} mm (finite elements)"
        )
    return [f"under {gap.load} towards it {reached}: press and shear less, {remedy}, or take a larger base"]


def _skin(
    design: Design, load: Load, forces: tuple[float, float] | None, store: Store, solve: bool
) -> tuple[Array, float]:
    """Return the points (n, 3) of the deformed skin, sheared along x, and its largest motion, mm."""
    from fem.accuracy import QUICK
    from fem.scene import Scene

    if forces and not forces[1]:
        load = replace(load, shear_x=0.0)
    scene = Scene(design, (load,), QUICK)
    content = scene.dimensionless() | {"quantity": SKIN, "physics": PHYSICS[scene.model], "estimates": ESTIMATES}
    (content["load"],) = content.pop("loads")
    if forces:
        unit = design.E_now * design.D**2
        content["load"] = {"forces_over_ED2": [float(f"{force / unit:.12g}") for force in forces]}
    state = store.states(content, [(0.0, 0.0)]).get((0.0, 0.0))
    if state is None:
        if not solve:
            raise SolveFailed(UNSOLVED)
        state = as_stored(_solved(scene, forces))
        store.add(content, [state])
    if state.outcome != "ok":
        raise SolveFailed(of_similar(state.answer["message"], design.D, state.answer["D_mm"]))
    skin = state.answer["values"]
    return design.D * np.reshape(skin["points_over_D"], (-1, 3)), design.D * skin["motion_over_D"]


def _solved(scene: Scene, forces: tuple[float, float] | None) -> State:
    """Return the skin under the load of a scene, or under forces, as the store keeps it."""
    from fem import equilibrium
    from fem.analyses.force_targets import solve_force
    from studies.mechanics.path_solver import origin, problem_of
    from studies.mechanics.timed_quantities import STILL
    from studies.output.deformed_body import of_field

    design, begin = scene.design, time.perf_counter()
    status: str = "failed"
    try:
        if forces:
            aside = (forces[1], 0.0) if forces[1] else None
            found = solve_force(design, forces[0], scene.accuracy, shear_force=aside)
        else:
            found = list(equilibrium.walk(scene, estimate=False))[-1]
        status, message = found.status, found.message
    except SolveFailed as error:
        message = str(error)
    values: dict[str, Any] = {}
    outcome: Outcome = "ok" if status == "ok" else "failed"
    if status == "ok":
        parts = of_field(found.body)
        rest, u = (np.concatenate([parts[side][k] for side in ("front", "back")]) / design.D for k in (0, 1))
        values = {
            "points_over_D": np.round((rest + u).ravel(), SKIN_DIGITS).tolist(),
            "motion_over_D": float(np.linalg.norm(u, axis=1).max()),
        }
    answer = {"message": message or status, "error_estimate": None, "response": None, "values": values}
    seconds = time.perf_counter() - begin
    return State(0.0, 0.0, outcome, status, problem_of(design, scene.loads[0], STILL) | answer, seconds, origin())


def _centre(block: Block) -> tuple[float, float]:
    return block.corner[0] + block.sides[0] / 2, block.corner[1] + block.sides[1] / 2


def _turned(points: Array, towards: tuple[float, float]) -> Array:
    """Return points turned about z so that x points towards (x, y)."""
    c, s = np.array(towards) / math.hypot(*towards)
    return np.asarray(points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def _distance(points: Any, block: Block) -> float:
    """Return the least distance of points (n, 3) from a box, mm; negative inside: the least way out.

    >>> _distance(np.array([[3.0, 0.0, 0.5], [5.0, 0.0, 0.5]]), Block((1.0, -1.0, 0.0), (1.0, 2.0, 1.0)))
    1.0
    >>> _distance(np.array([[1.25, 0.0, 0.5]]), Block((1.0, -1.0, 0.0), (1.0, 2.0, 1.0)))
    -0.25
    """
    low = np.array(block.corner)
    beyond = np.maximum(low - points, points - low - np.array(block.sides))
    inside = np.minimum(beyond.max(axis=1), 0.0)
    return float((np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + inside).min())
