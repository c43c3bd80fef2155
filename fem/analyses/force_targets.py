"""States with a wanted force: a press to a normal force, and a shear after it to a force along the plate.

    from fem.analyses.force_targets import solve_force
    from geometry.design import paper

    state = solve_force(paper(), 5.0)

The depth is the first one at which a press from rest on has the force along z. A shear force then needs a shear at
this depth, during which the normal force changes. Each state is that of `fem.equilibrium.walk` under the load that
results; its force is the wanted one within `fem.solve.loading_curve.FORCE_TOLERANCE`.

Light touches and glued plates have a mesh that depends on the depth (`fem.solve.depth_ranges`). There the search is
repeated on the mesh of the depth that it has led to.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import skfem

from fem.accuracy import STANDARD, Accuracy, coarser
from fem.analyses.force_path import ForcePath, Watch, expected_depth, expected_shear, force_unit, slips_wholly
from fem.equilibrium import with_estimates
from fem.scene import Model, Scene
from fem.solution import Solution
from fem.solve.loading_curve import CurvePoint, ForceNotReached
from fem.solve.newton import STOPPED
from geometry.bad_input import OutOfReach
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet
from geometry.messages import Progress

__all__ = ["solve_force", "walk_forces"]

MOST_MESHES = 5
"""Largest number of meshes for one force. Two are usual; at the bound of two ranges each may lead to the other."""
LEFT = 0.7
"""Part of the remaining progress that is left after a solve; four to eight solves are usual."""
PROBE = 0.01
"""Shear over D in the load for which a mesh is made; the mesh depends only on its direction."""


@dataclass(frozen=True, slots=True)
class ForceTarget:
    """Forces of a plate on the tip.

    Attributes
    ----------
    force : normal force at the end of the press, N.
    shear_force : force (x, y) along the plate at the end of the shear, N; None without a shear.
    load : friction, tilt of the plate and imperfection. Its depth and shear are 0.

    Raises
    ------
    BadInput
        A force is not possible, or the load has a grip, a depth or a shear.
    """

    force: float
    shear_force: tuple[float, float] | None = None
    load: Load = field(default_factory=Load)

    def __post_init__(self) -> None:
        if not 0 < self.force < math.inf:
            raise BadInput(f"force must be a finite number of N above 0; got {self.force:g}")
        if self.load.grip is not None:
            raise BadInput("a grip has no plate that presses with a force: leave the grip or the force out")
        if self.load.depth or self.load.shear:
            raise BadInput("the load of a force target must have depth 0 and shear 0, because the forces decide both")
        if self.shear_force is not None:
            self._check_shear_force(*self.shear_force)

    def _check_shear_force(self, x: float, y: float) -> None:
        size, mu = math.hypot(x, y), self.load.coulomb
        if not 0 < size < math.inf:
            raise BadInput(f"shear force must be a finite number of N other than 0; got {x:g}, {y:g}")
        if not self.load.tip_is_held and mu is None:
            raise BadInput("a frictionless plate carries no shear force: choose friction stick or a coefficient")
        if mu is not None and not size < mu * self.force:
            raise BadInput(
                f"shear force must be below the friction coefficient times the force, {mu:g} x {self.force:g} N = "
                f"{mu * self.force:g} N, at which the plate slips; got {size:g} N"
            )

    @property
    def shear_size(self) -> float:
        """Size of the shear force, N; 0 without a shear."""
        return 0.0 if self.shear_force is None else math.hypot(*self.shear_force)

    def load_at(self, depth: float, shear: float) -> Load:
        """Return the load at a depth and at a shear along the shear force, mm."""
        if self.shear_force is None:
            return replace(self.load, depth=depth)
        x, y = (part / self.shear_size for part in self.shear_force)
        return replace(self.load, depth=depth, shear_x=shear * x, shear_y=shear * y)


def solve_force(
    design: Design,
    force: float,
    accuracy: Accuracy = STANDARD,
    *,
    shear_force: tuple[float, float] | None = None,
    load: Load | None = None,
    magnet: Magnet = "rigid",
    model: Model = "auto",
) -> Solution:
    """Solve for the state with a normal force, N, and then a shear force (x, y), N; see `walk_forces`.

    Parameters
    ----------
    load : friction, tilt of the plate and imperfection; default: an upright plate without friction, to which the tip
        sticks during a shear.
    """
    load = Load(friction="none" if shear_force is None else "stick") if load is None else load
    target = ForceTarget(force, shear_force, load)
    return next(iter(walk_forces(design, [target], accuracy, magnet=magnet, model=model)))


def walk_forces(
    design: Design,
    targets: Sequence[ForceTarget],
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    estimate: bool = True,
    progress: Progress | None = None,
    mesh: skfem.MeshTet2 | None = None,
) -> Iterator[Solution]:
    """Solve for the states with the forces of the targets, each loaded from rest on.

    Parameters
    ----------
    estimate, progress, mesh : as in `fem.equilibrium.walk`.

    Yields
    ------
    One solution per target, as soon as it is solved.

    Raises
    ------
    BadInput
        Before the first state: a target does not suit the design or the model. Later: a force is not reached; the
        sentence names the largest one.
    """
    scenes = [_first_scene(design, target, accuracy, magnet, model) for target in targets]
    return _walk(targets, scenes, _Paths(mesh, estimate=estimate and mesh is None), progress)


def _first_scene(design: Design, target: ForceTarget, accuracy: Accuracy, magnet: Magnet, model: Model) -> Scene:
    """Return the scene of a target at its expected depth, with a small shear in the direction of its shear force."""
    depth = expected_depth(design, magnet, target.force / force_unit(design))
    return Scene(design, (target.load_at(depth * design.D, PROBE * design.D),), accuracy, magnet, model)


def _walk(
    targets: Sequence[ForceTarget], scenes: Sequence[Scene], paths: _Paths, progress: Progress | None
) -> Generator[Solution]:
    """Solve for the states one after the other, and close the paths."""
    with contextlib.closing(paths):
        for done, (target, scene) in enumerate(zip(targets, scenes, strict=True)):
            if progress is not None:
                paths.watch = _watch(progress, done, len(targets), target, scene.model)
            yield _solve(paths, target, scene)


def _watch(progress: Progress, done: int, count: int, target: ForceTarget, model: str) -> Watch:
    """Return a function that reports each solve for a target, after the first `done` of `count` targets."""
    left = 1.0

    def watch(depth: float, shear: float) -> None:
        nonlocal left
        wanted = target.shear_size if shear else target.force
        moved = f"depth {depth:.4g} mm" + (f", shear {shear:.4g} mm" if shear else "")
        progress((done + 1 - left) / count, f"{model}: {moved}, in search of {wanted:g} N")
        # the number of solves is unknown: each one takes a part of what is left
        left *= LEFT

    return watch


class _Paths:
    """The path on the present mesh, and that on the coarser mesh for error estimates.

    Attributes
    ----------
    estimate : whether errors are estimated, and the sideways stability of an axisymmetric press is checked.
    depths : depths, mm, of the forces so far: several shear forces share one press.
    watch : is called before each solve.
    """

    def __init__(self, mesh: skfem.MeshTet2 | None, *, estimate: bool) -> None:
        self._mesh, self.estimate, self.depths = mesh, estimate, dict[float, float]()
        self.watch: Watch | None = None
        self._fine: ForcePath | None = None
        self._coarse: ForcePath | None = None

    def fine(self, scene: Scene) -> ForcePath:
        """Return the path of a scene: the present one, if its mesh is that of the scene."""
        if self._fine is None or not self._fine.suits(scene.loads[0]):
            self.close()
            self._fine = ForcePath(scene, self._mesh, check_stability=self.estimate, watch=self._report)
        return self._fine

    def coarse(self, scene: Scene) -> ForcePath:
        """Return the path on the mesh that is coarser than the present one."""
        if self._coarse is None:
            self._coarse = ForcePath(replace(scene, accuracy=coarser(scene.accuracy)), check_stability=False)
        return self._coarse

    def close(self) -> None:
        """Free the memory of the factorisations."""
        for path in (self._fine, self._coarse):
            if path is not None:
                path.close()
        self._fine = self._coarse = None

    def _report(self, depth: float, shear: float) -> None:
        if self.watch is not None:
            self.watch(depth, shear)


def _solve(paths: _Paths, target: ForceTarget, scene: Scene) -> Solution:
    """Return the state with the forces of a target, with error estimates."""
    begin, D = time.perf_counter(), scene.design.D
    path, pressed = _press(paths, target, scene)
    sheared = None if target.shear_force is None else _shear(path, pressed, target)
    load = target.load_at(pressed.motion * D, 0.0 if sheared is None else sheared.motion * D)
    state = path.solution(sheared or pressed, load, seconds=time.perf_counter() - begin)
    if not paths.estimate:
        return state
    begin, coarse = time.perf_counter(), paths.coarse(path.scene)
    coarse_point = coarse.press.reach(pressed.motion)
    if sheared is not None and not coarse_point.stop:
        coarse_point = coarse.shear(coarse_point).reach(sheared.motion)
    coarse_state = coarse.solution(coarse_point, load, seconds=time.perf_counter() - begin)
    return with_estimates(state, coarse_state, path.scene)


def _press(paths: _Paths, target: ForceTarget, scene: Scene) -> tuple[ForcePath, CurvePoint]:
    """Return the state of a press with the normal force of a target, and the path on the mesh of its depth."""
    (load,), D = scene.loads, scene.design.D
    depth = paths.depths.get(target.force, load.depth)
    failure: ForceNotReached | None = None
    for meshes_left in reversed(range(MOST_MESHES)):
        path = paths.fine(replace(scene, loads=(replace(load, depth=depth),)))
        try:
            point, failure = path.press.find(target.force / force_unit(scene.design), depth / D), None
        except ForceNotReached as error:
            point, failure = error.point, error
        depth = point.motion * D
        # a force that is not reached on the mesh of another depth may be reached on that of this one
        if not depth or not meshes_left or path.suits(replace(load, depth=depth)):
            break
    if failure is not None:
        raise OutOfReach(_refusal(failure, target.force, "press", "depth", scene.design))
    paths.depths[target.force] = depth
    return path, point


def _shear(path: ForcePath, pressed: CurvePoint, target: ForceTarget) -> CurvePoint:
    """Return the state with the shear force of a target."""
    design = path.scene.design
    force = target.shear_size / force_unit(design)
    try:
        return path.shear(pressed).find(force, expected_shear(design, force))
    except ForceNotReached as error:
        raise OutOfReach(_refusal(error, target.shear_size, "shear", "shear", design)) from None


def _refusal(error: ForceNotReached, force: float, loading: str, motion: str, design: Design) -> str:
    """Return why no state has a force, N: with the largest force, or the jump of the force."""
    unit, point = force_unit(design), error.point
    at = f"at {motion} {point.motion * design.D:.4g} mm"
    if not point.motion and point.force * unit > force:
        return (
            f"without a {loading} the tilted plate has {point.force * unit:.4g} N in the direction of the wanted "
            f"{force:g} N already, and a {loading} that way adds to it: take a larger force, or one the other way"
        )
    if error.beyond is not None:
        return (
            f"no state of the {loading} has a force of {force:g} N: it jumps from {point.force * unit:.4g} to "
            f"{error.beyond.force * unit:.4g} N {at}: take a force outside this range"
        )
    reasons = {
        "stopped": f"where the solve stops ({STOPPED[error.last.stop]})",
        "slips": "where the whole contact area slips",
        "ends": f"and the largest {motion} is {error.last.motion * design.D:.4g} mm",
    }
    ended = "stopped" if error.last.stop else "slips" if slips_wholly(error.last.state) else "ends"
    return (
        f"the {loading} does not reach {force:g} N: its largest force is {point.force * unit:.4g} N {at}, "
        f"{reasons[ended]}: take a smaller force"
    )
