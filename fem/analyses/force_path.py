"""Loading curves of one scene on its mesh: the press, the shear after it, and the solutions on them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import skfem

from fem.equilibrium import sideways_model, start_path
from fem.model import coulomb_friction
from fem.results.postprocess import read, tip_force
from fem.scene import Scene
from fem.solution import Solution
from fem.solve.depth_ranges import mesh_range
from fem.solve.loading_curve import CurvePoint, LoadingCurve
from fem.solve.newton import Stop
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Load, Magnet, tip_compliance

MOST_DEPTH = 0.999
"""Largest depth of a search, over the silicone on the axis."""
FIRST_DEPTH, FIRST_SHEAR = 0.3, 0.5
"""Largest first depth of a search over the silicone on the axis, because Hertz's law knows no base below the tip; and
largest first shear over D, within which a path always converges."""
PRESS_POWER, SHEAR_POWER = 1.5, 1.0
"""Powers of the motion with which a force grows at first: of Hertz's contact, and of a linear spring."""
SAME_MESH = 0.01
"""Relative difference of depths up to which a glued plate has the same mesh. That is refined at the edge of the
contact, whose radius then differs by half as much: less than the size of an element there."""

Watch = Callable[[float, float], None]
"""Is called before each solve with its depth and shear, mm."""


class ForcePath:
    """Path of a scene with one load, whose press and shear are searched for forces.

    Parameters
    ----------
    scene : its load gives the kind of the loads and the direction of the shear, and the depth for which the mesh is
        made.
    mesh : tetrahedra in units of D to solve on; default: those of the scene.
    check_stability : whether the solutions say that a symmetric press would buckle sideways.
    watch : default: no calls.

    Attributes
    ----------
    press : force along z over the depth.
    """

    def __init__(
        self,
        scene: Scene,
        mesh: skfem.MeshTet2 | None = None,
        *,
        check_stability: bool = True,
        watch: Watch | None = None,
    ) -> None:
        (self._load,), self.scene, self._watch = scene.loads, scene, watch
        self._path = start_path(scene, mesh)
        self._rest = self._path.state
        self._sideways = sideways_model(scene, self._path) if check_stability else None
        self._iterations = 0
        self._pressed: CurvePoint | None = None
        self._sheared: LoadingCurve | None = None
        self.press = LoadingCurve(
            self._path,
            lambda depth: self._go(depth, 0.0),
            lambda state: (float(state.position[0]), float(tip_force(state)[2])),
            power=PRESS_POWER,
            most=MOST_DEPTH * silicone_on_axis(scene.design, scene.magnet),
        )

    def shear(self, pressed: CurvePoint) -> LoadingCurve:
        """Return the force along the shear over the shear, after a press to a state."""
        if self._sheared is None or pressed is not self._pressed:
            self._path.restart(pressed.state)
            self._path.begin_shear()
            along = self._direction()
            self._pressed, self._sheared = (
                pressed,
                LoadingCurve(
                    self._path,
                    lambda shear: self._go(pressed.motion, shear),
                    lambda state: (float(state.position[1:] @ along), float(tip_force(state)[:2] @ along)),
                    power=SHEAR_POWER,
                    most=2 * self.scene.shape.L,
                    ended=slips_wholly,
                ),
            )
        return self._sheared

    def solution(self, point: CurvePoint, load: Load, *, seconds: float) -> Solution:
        """Return the solution at a state, which carries `load` if it has not stopped before."""
        iterations, self._iterations = self._iterations, 0
        return read(
            point.state,
            self.scene,
            load,
            point.stop,
            iterations=iterations,
            seconds=seconds,
            sideways=self._sideways,
        )

    def suits(self, load: Load) -> bool:
        """Return whether the mesh is that of a path to another load."""
        D, own = self.scene.design.D, self._load
        alike = (load.friction, load.plate_tilt, load.imperfection, load.shears_tip, load.direction) == (
            own.friction, own.plate_tilt, own.imperfection, own.shears_tip, own.direction
        )  # fmt: skip
        if own.bonds_contact:
            return alike and math.isclose(load.depth, own.depth, rel_tol=SAME_MESH)
        if self.scene.solid:
            return alike
        return alike and mesh_range(self.scene, load.depth / D) == mesh_range(self.scene, own.depth / D)

    def close(self) -> None:
        """Free the memory of the factorisations."""
        self._path.close()

    def _go(self, depth: float, shear: float) -> Stop:
        """Move the plate to a depth and to a shear along the load's, over D."""
        if self._watch is not None:
            D = self.scene.design.D
            self._watch(depth * D, shear * D)
        if self._path.state.starts_from_rest(depth):
            self._path.restart(self._rest)
        stop = self._path.go(depth, shear * self._direction())
        self._iterations += self._path.iterations
        return stop

    def _direction(self) -> Array:
        """Return the unit vector (2,) of the load's shear in the model's frame."""
        (x, y), shear = self.scene.direction, np.array(self._load.imposed_shear)
        size = float(np.linalg.norm(shear))
        return np.array([[x, y], [-y, x]]) @ shear / size if size else np.zeros(2)


def force_unit(design: Design) -> float:
    """Return the unit of dimensionless forces, E D^2, N."""
    return design.E * design.D**2


def silicone_on_axis(design: Design, magnet: Magnet) -> float:
    """Return the thickness of the silicone on the axis over D, above and below the magnet."""
    return (design.L - (design.magnet_height if magnet == "rigid" else 0.0)) / design.D


def expected_depth(design: Design, magnet: Magnet, force: float) -> float:
    """Return a rough depth over D of a press by a force over E D^2: Hertz's contact on a column.

    The column is what remains of the silicone on the axis below a ball of diameter D.
    """
    R, thickness = design.R / design.D, silicone_on_axis(design, magnet)
    hertz = (0.75 * force * (1 - design.nu**2) / math.sqrt(R)) ** (2 / 3)
    column = max(thickness - 1.0, 0.0) * force / (math.pi * R**2)
    return float(min(hertz + column, FIRST_DEPTH * thickness))


def expected_shear(design: Design, force: float) -> float:
    """Return a rough shear over D under a force along the plate over E D^2: that of a straight beam."""
    return min(force * tip_compliance(design) * design.E * design.D, FIRST_SHEAR)


def slips_wholly(state: PathState) -> bool:
    """Return whether the whole contact area slips; no larger shear then increases the force."""
    friction = state.friction
    return friction is not None and coulomb_friction.slip_share(friction, state.skin.weights) == 1.0
