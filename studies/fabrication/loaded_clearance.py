"""Gaps between the beam under load and what stands beside it on the base: Hall elements, their posts and screw heads.

The finite elements take the beam as free around its skin. A press makes it bulge, and a shear bends it: where the
skin then lies in an element or a screw, sensor and model part. The state is that of a plate which sticks to the tip;
its shear points at each obstacle in turn, for the beam is round. What is measured is the least distance of the
deformed skin from the box around an obstacle, negative inside. Its error is that of the motion, at accuracy quick
`MOTION_ERROR` of the largest one, and of the chords between the points of the skin.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from geometry.arrays import Array
from geometry.bad_input import BadInput, SolveFailed
from geometry.base import Plan, screw_thread
from geometry.design import Design
from geometry.fabrication.hall_elements import Block
from studies.output.deformed_body import SECTORS, of_field

if TYPE_CHECKING:
    from build123d import Solid

HEAD_WIDTH, HEAD_HEIGHT = 2.0, 0.8
"""Diameter and height of a screw's head over its thread, those of pan heads at most (ISO 7045)."""
MOTION_ERROR = 0.03
"""Largest true error of a shift at accuracy quick, over the shift (`magtip validate errors accuracy`)."""
USUAL_DEPTH, USUAL_SHEAR = 3 / 8, 1 / 8
"""Press and shear over D where no forces are required: the largest press in use, and an eighth of D."""


class Gap(NamedTuple):
    """The least gap of a loaded beam and its error, mm, to which obstacle, and under which load; NaN and why if it is
    unknown."""

    value: float
    error: float
    obstacle: str
    load: str


def obstacles(design: Design, plan: Plan, bodies: dict[str, Solid]) -> dict[str, Block]:
    """Return the boxes around all that stands beside the beam above the base plane, mm, by name."""
    found = {f"the post of {name}": block for name, block in plan.seats.posts.items()}
    for name, solid in bodies.items():
        box = solid.bounding_box()
        low, size = (tuple(getattr(point, axis) for axis in "XYZ") for point in (box.min, box.size))
        found[name] = Block(low, size)
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
    design: Design, plan: Plan, bodies: dict[str, Solid], forces: tuple[float, float] | None = None
) -> Gap | None:
    """Return the least gap of the loaded beam; None where nothing stands beside it.

    forces : required force along z and along the plate, N; default: `USUAL_DEPTH` and `USUAL_SHEAR`.
    """
    beside = obstacles(design, plan, bodies)
    if not beside:
        return None
    depth, shear = USUAL_DEPTH * design.D, USUAL_SHEAR * design.D
    words = f"a press of {depth:.3g} mm with a shear of {shear:.3g} mm"
    if forces:
        words = f"{forces[0]:.3g} N" + (f" with {forces[1]:.3g} N along the plate" if forces[1] else "")
    try:
        skin, motion = _skin(design, (depth, shear), forces)
    except (BadInput, SolveFailed) as error:
        return Gap(math.nan, math.nan, str(error), words)
    gaps = {name: _distance(_turned(skin, _centre(block)), block) for name, block in beside.items()}
    name = min(gaps, key=lambda each: gaps[each])
    chords = design.R * (1 - math.cos(math.pi / (2 * SECTORS)))
    return Gap(gaps[name], MOTION_ERROR * motion + chords, name, words)


def warning(gap: Gap | None) -> list[str]:
    """Return a sentence where a loaded beam touches what stands beside it, may touch it, or where that is unknown."""
    if gap is None or gap.value > gap.error:
        return []
    if math.isnan(gap.value):
        return [f"whether the beam touches what stands beside it under {gap.load} is not known: {gap.obstacle}"]
    screw = "screw" in gap.obstacle
    remedy = "countersink the screws or set them from below" if screw else "lower c or raise f"
    reached = f"the beam reaches {-gap.value:.2g} +-{gap.error:.1g} mm into {gap.obstacle} (finite elements)"
    if gap.value >= -gap.error:
        reached = (
            f"the beam may touch {gap.obstacle}: its gap is {gap.value:.2g} +-{gap.error:.1g} mm (finite elements)"
        )
    return [f"under {gap.load} towards it {reached}: press and shear less, {remedy}, or take a larger base"]


def _skin(design: Design, motion: tuple[float, float], forces: tuple[float, float] | None) -> tuple[Array, float]:
    """Return the points (n, 3) of the deformed skin, sheared along x, and its largest motion, mm."""
    from fem import equilibrium
    from fem.accuracy import QUICK
    from fem.analyses.force_targets import solve_force
    from geometry.loads import Load

    if forces:
        aside = (forces[1], 0.0) if forces[1] else None
        found = solve_force(design, forces[0], QUICK, shear_force=aside)
    else:
        load = Load(motion[0], motion[1], friction="stick")
        found = equilibrium.trace(design, [load], QUICK, estimate=False)[-1]
    if found.status != "ok":
        raise SolveFailed(found.message or found.status)
    parts = of_field(found.body)
    rest, u = (np.concatenate([parts[side][k] for side in ("front", "back")]) for k in (0, 1))
    return rest + u, float(np.linalg.norm(u, axis=1).max())


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
