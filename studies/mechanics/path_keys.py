"""Keys of the store: on which path, and where on it, is the answer to a case?

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

Four more quantities are stored, each as a path with a single state: the critical depth of a design, its natural
frequencies about a press, its steady vibration about a press or a shear (`response_paths`), and cycles of a press or
a shear at one rate (`cycle_paths`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.loads import Load
from studies.mechanics import cycle_paths, response_paths
from studies.mechanics.plate_motion import STILL, PlateMotion
from studies.mechanics.store import Position, position

Kind = Literal["states", "critical depth", "modes", "response", "cycle"]
"""What a path holds."""
KINDS: dict[str, Kind] = {
    "critical_depth": "critical depth",
    "modes": "modes",
    "response": "response",
    "cycle": "cycle",
}
"""Quantities that are paths of their own in the store."""
MODES = 6
"""Number of natural frequencies that are solved and stored."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the answer of a case is stored.

    Attributes
    ----------
    scene : the case as it is solved, with a single load.
    at : position on the path.
    direction : direction of the case's shear, to which the answer is turned.
    motion : of the plate, of cycles only; other answers do not depend on it.
    """

    scene: Scene
    kind: Kind
    at: Position
    direction: tuple[float, float] = (1.0, 0.0)
    motion: PlateMotion = STILL

    @property
    def content(self) -> dict[str, Any]:
        """Everything on which the states of the path depend except their position."""
        return content(self.scene, self.kind, self.motion)


def place(scene: Scene, kind: Kind = "states", motion: PlateMotion = STILL) -> Place:
    """Return where the answer of a scene with a single load is stored.

    Raises
    ------
    ValueError
        The scene has several loads.
    BadInput
        The quantity does not exist for this load or motion.
    """
    (load,) = scene.loads
    D = scene.design.D
    if kind == "critical depth":
        # the load does not matter; any depth that fits every beam stands for it
        return Place(replace(scene, loads=(Load(depth=0.01 * D),), model="axisymmetric"), kind, (0.0, 0.0))
    if kind == "modes":
        return Place(replace(scene, loads=(Load(depth=load.depth),), model="axisymmetric"), kind, (0.0, 0.0))
    sections = replace(scene, model="auto")
    along_x = replace(sections, loads=(_canonical(sections, load)[0],))
    if kind == "cycle":
        cycle_paths.cycle_of(along_x, motion)
        return Place(along_x, kind, (0.0, 0.0), motion=motion)
    if kind == "response":
        at_rest = response_paths.rest_scene(along_x)
        response_paths.check_frequency(at_rest, motion.frequency)
        return Place(at_rest, kind, (0.0, 0.0))
    alone, direction = _canonical(scene, load)
    return Place(replace(scene, loads=(alone,)), kind, position_of(alone, D), direction)


def _canonical(scene: Scene, load: Load) -> tuple[Load, tuple[float, float]]:
    """Return the load that is solved in place of this one, and the direction to which its answer is turned."""
    if not load.shears_tip:
        friction = "none" if load.coulomb is None else load.friction
        return replace(load, shear_x=0.0, shear_y=0.0, friction=friction), (1.0, 0.0)
    if load.plate_tilt or load.imperfection or scene.model == "full":
        return load, (1.0, 0.0)
    direction = (load.shear_x / load.shear, load.shear_y / load.shear)
    return replace(load, shear_x=load.shear, shear_y=0.0), direction


def position_of(load: Load, D: float) -> Position:
    """Return the position of a load on its path."""
    return position(load.depth / D, math.hypot(*load.imposed_shear) / D)


def content(scene: Scene, kind: Kind = "states", motion: PlateMotion = STILL) -> dict[str, Any]:
    """Return everything on which the states of a path depend except their position, with the physics version."""
    if kind == "response":
        return response_paths.content(scene)
    if kind == "cycle":
        return cycle_paths.content(scene, motion)
    values = scene.dimensionless()
    loads, load = values.pop("loads"), scene.loads[0]
    first = loads[0]
    if kind == "critical depth":
        return values | {"quantity": kind, "physics": PHYSICS[kind]}
    if kind == "modes":
        ratio = scene.design.magnet_density / scene.design.density if scene.magnet == "rigid" else 0.0
        pressed = {"depth": first["depth"], "density_ratio": float(f"{ratio:.12g}"), "count": MODES}
        return values | {"quantity": kind, "load": pressed, "physics": PHYSICS[kind]}
    kept = {name: first[name] for name in ("friction", "grip", "plate_tilt", "imperfection")}
    sheared = load.shears_tip
    way = {
        "sheared_at_depth": first["depth"] if sheared else None,
        "direction": [round(part, 12) + 0.0 for part in unit_vector(load)] if sheared else None,
    }
    return values | {"quantity": kind, "load": kept | way, "physics": PHYSICS[scene.model]}


def unit_vector(load: Load) -> tuple[float, float]:
    """Return the unit vector of a load's shear."""
    return load.shear_x / load.shear, load.shear_y / load.shear
