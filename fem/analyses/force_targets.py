"""States with wanted forces: a press to a normal force, and then a shear to a force along the plate.

    from fem.analyses.force_targets import solve_force
    from geometry.design import paper

    state = solve_force(paper(), 5.0)
    sheared = solve_force(paper(), 5.0, shear_force=(2.0, 0.0))

The depth d of a press is the first one, from rest on, with F_z(d) = F_N. A shear force F_t is applied as a load in
newtons is: first the press, then the shear s with the normal force held, for which the plate follows in depth,

    F_z(d, s) = F_N and F_t(d, s) = F_t, along the path F_z = F_N from (d_press, 0) on.

What sticks is what touches at the end of the press. Both forces are met within FORCE_TOLERANCE. The order matters
where the tip sticks: a press to the final depth, and a shear with that depth held, glues a larger area.

The shear is a search in one variable: each trial shear is reached in a straight line from the last solved state
before it, never backwards, and its depth is found by secants (`HeldForce`). So the force over the motion, depth or
shear, is that of a monotone loading; with Coulomb friction that matters. Lengths are over D, forces over E D^2.

Light touches and glued plates have a mesh that depends on the depth (`fem.solve.load_case_models`). There the search
is repeated on the mesh of the depth that it has led to.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import skfem

from fem.accuracy import STANDARD, Accuracy
from fem.equilibrium import sideways_model, with_estimates
from fem.model import coulomb_friction
from fem.results.error_estimates import estimate_response
from fem.results.postprocess import contact_size, read, read_response, tip_force
from fem.scene import Model, Scene, silicone_on_axis
from fem.solution import ForceOutOfReach, Solution, Stop
from fem.solve.load_case_models import mesh_range, path_models
from fem.solve.load_increments import extrapolate
from fem.solve.load_stepping import Path
from fem.solve.loading_curve import FORCE_TOLERANCE, LEAST_APART, CurvePoint, LoadingCurve, NotReached, Watch
from fem.solve.newton import STOPPED
from fem.solve.path_state import PathState
from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, tip_compliance
from geometry.messages import Progress

__all__ = ["solve_force", "walk_forces"]

MOST_CORRECTIONS = 8
"""Depths tried at a shear for a held normal force: secants need one to four."""
OTHER_DEPTH = 1.01
"""Second depth over the first one at a shear where the first one held the force: both give the changes of the forces
with the depth, of which error estimates need no more than two digits."""
LARGEST_CORRECTION = 0.25
"""Largest change of the depth by a secant, over the depth: a slope near zero leads anywhere."""
PARTS = 4
"""Halvings of a shear whose normal force cannot be held: what is reached is then known to 1/16 of it."""

FIRST_PART = 0.25
"""First shear over the expected one: it shows whether the beam resists a shear at all under the normal force, and how
the depth grows. That growth is quadratic, so that a first depth is hardly off there."""


@dataclass(frozen=True, slots=True)
class ForceTarget:
    """Forces of a plate on the tip.

    Attributes
    ----------
    force : normal force at the end of the press, which the shear holds, N.
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
        if self.load.plate_tilt:
            self._check_tilted(x, y)
        elif mu is not None and not size < mu * self.force:
            raise BadInput(
                f"shear force must be below the friction coefficient times the force, {mu:g} x {self.force:g} N = "
                f"{mu * self.force:g} N, at which the plate slips; got {size:g} N"
            )

    def _check_tilted(self, x: float, y: float) -> None:
        """A tilted plate presses the tip towards -x; it slips where the force leaves the friction cone about its
        normal."""
        if y:
            raise BadInput(
                f"a tilted plate takes a shear force in the plane of its tilt only, along x; got {y:g} N along y"
            )
        if self.load.coulomb is not None:
            half = math.atan(self.load.coulomb)
            low, high = (self.force * math.tan(way * half - self.load.plate_tilt) for way in (-1, 1))
            if not low < x < high:
                raise BadInput(
                    f"shear force along x must lie between {low:.4g} and {high:.4g} N, where the tilted plate slips; "
                    f"got {x:g} N"
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
    estimate, progress : as in `fem.equilibrium.walk`.
    mesh : as of a `Scene`.

    Yields
    ------
    One solution per target, as soon as it is solved.

    Raises
    ------
    BadInput
        Before the first state: a target does not suit the design or the model. Later: a force is not reached; the
        sentence names the largest one.
    """
    scenes = [target_scene(design, target, accuracy, magnet=magnet, model=model, mesh=mesh) for target in targets]
    search, total = _Search(estimate), len(targets)
    return (
        search.solve(
            target, scene, functools.partial(_report, progress, done, total, target, scene, itertools.count(1))
        )
        for done, (target, scene) in enumerate(zip(targets, scenes, strict=True))
    )


def target_scene(
    design: Design,
    target: ForceTarget,
    accuracy: Accuracy,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    mesh: skfem.MeshTet2 | None = None,
) -> Scene:
    """Return a scene at the expected depth of a target, with a shear: only its direction decides the mesh."""
    depth = expected_depth(design, magnet, target.force / (design.E_now * design.D**2)) * design.D
    return Scene(design, (target.load_at(depth, depth),), accuracy, magnet, model, mesh)


def _report(
    progress: Progress | None,
    done: int,
    total: int,
    target: ForceTarget,
    scene: Scene,
    solves: Iterator[int],
    *at: float,
) -> None:
    """Report a solve at a depth and perhaps a shear, over D, for a target, after the first `done` of all."""
    if progress is None:
        return
    depth, shear = (scene.design.D * part for part in (*at, 0.0)[:2])
    wanted, sheared = (target.shear_size, f", shear {shear:.4g} mm") if shear else (target.force, "")
    # the number of solves is unknown: each one takes a part of what is left
    share = (done + 1 - 1 / next(solves)) / total
    progress(share, f"{scene.model}: depth {depth:.4g} mm{sheared}, in search of {wanted:g} N")


class _Search:
    """Searches on the path of the present mesh, with error estimates if wanted."""

    def __init__(self, estimate: bool) -> None:
        self._estimate = estimate
        # depths, mm, of the forces so far: several shear forces share one press
        self._depths: dict[float, float] = {}
        self._path: ForcePath | None = None

    def solve(self, target: ForceTarget, scene: Scene, watch: Callable[..., None]) -> Solution:
        """Return the state with the forces of a target; `watch` is called before each solve with depth and shear."""
        begin, D = time.perf_counter(), scene.design.D
        path, press = self._press(target, scene, watch)
        point = press if target.shear_force is None else path.shear(press, target, watch)
        depth, shear = _motions(point.state)
        load = target.load_at(depth * D, shear * D)
        state = path.read(point, load, time.perf_counter() - begin)
        begin, coarse = time.perf_counter(), path.coarser if self._estimate else None
        if coarse is None:
            return state
        coarse_press = coarse_point = coarse.press.reach(press.motion)
        if target.shear_force is not None and not coarse_press.stop:
            coarse_point = coarse.follow(coarse_press, point)
        found = with_estimates(state, coarse.read(coarse_point, load, time.perf_counter() - begin), path.scene)
        if coarse_point.stop:
            return found
        fine, rough = (
            read_response(one.state, path.scene, contact_size(one.state)[0]) for one in (press, coarse_press)
        )
        pressed = estimate_response(
            fine, rough, target.load_at(press.motion * D, 0.0), path.scene, press.state.d.model
        )
        motions = {"depth": motion_error(path.press, press, pressed.force)}
        if target.shear_force is not None:
            held, curve = path.start_shear(press)
            motions = held.motion_errors(curve, point, found)
        return replace(found, estimates=replace(found.estimates, **motions))

    def _press(self, target: ForceTarget, scene: Scene, watch: Watch) -> tuple[ForcePath, CurvePoint]:
        """Return the state of a press with the normal force of a target, and the path on the mesh of its depth."""
        (load,), D, E = scene.loads, scene.design.D, scene.design.E_now
        depth = self._depths.get(target.force, load.depth)
        # two meshes are usual; at the bound of two ranges each may lead to the other
        for meshes_left in reversed(range(5)):
            load = replace(load, depth=depth)
            if self._path is None or not self._path.suits(load):
                self._path = ForcePath(replace(scene, loads=(load,)), check_stability=self._estimate)
            path = self._path
            found = path.press.find(target.force / (E * D**2), depth / D, watch)
            point = found.point if isinstance(found, NotReached) else found
            depth = point.motion * D
            # a force that is not reached on the mesh of another depth may be reached on that of this one
            if not depth or not meshes_left or path.suits(replace(load, depth=depth)):
                break
        if isinstance(found, NotReached):
            raise path.out_of_reach(found, target.load_at(depth, 0.0), target.force, "press", "depth")
        self._depths[target.force] = depth
        return path, point


def motion_error(curve: LoadingCurve, point: CurvePoint, error: float | None) -> float | None:
    """Return the relative error of the motion that a wanted force has led to, from that of the force at that motion.

    Near a point the force grows like the motion to a power n: the motion is off by 1 / n of the error of the force.
    """
    power = curve.power_at(point)
    return None if error is None or not power > 0 else error / power


class ForcePath:
    """Path of a scene with one load, whose press and shear are searched for forces.

    Parameters
    ----------
    scene : its load gives the kind of the loads and the direction of the shear, and the depth for which the mesh is
        made.
    check_stability : whether the solutions say that a symmetric press would buckle sideways.

    Attributes
    ----------
    press : force along z over the depth.
    """

    def __init__(self, scene: Scene, *, check_stability: bool = False) -> None:
        self.scene, self._path = scene, Path(path_models(scene))
        self._margin = sideways_model(scene, self._path).margin if check_stability else None
        most = (1 - FORCE_TOLERANCE) * silicone_on_axis(scene.design, scene.magnet) / scene.design.D
        # the force grows at first like that of Hertz's contact
        self.press = self._curve(self._path.rest, np.array([1.0, 0.0, 0.0]), power=3 / 2, most=most)
        self._begun: tuple[CurvePoint, HeldForce, LoadingCurve] | None = None

    @functools.cached_property
    def coarser(self) -> ForcePath | None:
        """The path on the mesh for error estimates."""
        scene = self.scene.coarser()
        return None if scene is None else ForcePath(scene)

    def _curve(self, state: PathState, axis: Array, **options: Any) -> LoadingCurve:
        """Return the curve of a motion along an axis (3,), depth and shear along x and y, from a state on."""
        return LoadingCurve([_point(state, axis)], functools.partial(_move, self._path, axis), **options)

    def shear(self, pressed: CurvePoint, target: ForceTarget, watch: Callable[..., None]) -> CurvePoint:
        """Return the state with the shear force of a target, after a press to a state whose normal force it holds."""
        design = self.scene.design
        force = target.shear_size / (design.E_now * design.D**2)
        # that of a straight beam; a path to half of D always converges
        guess = min(force * tip_compliance(design) * design.E_now * design.D, 0.5)
        held, curve = self.start_shear(pressed)
        held.watch, held.force = watch, target.force / (design.E_now * design.D**2)
        if len(curve.points) == 1:
            curve.reach(FIRST_PART * guess)
        found = curve.find(force, guess)
        if isinstance(found, NotReached):
            depth, shear = (part * design.D for part in _motions(found.point.state))
            raise self.out_of_reach(found, target.load_at(depth, shear), target.shear_size, "shear", "shear")
        return found

    def start_shear(self, pressed: CurvePoint) -> tuple[HeldForce, LoadingCurve]:
        """Return what holds the normal force of a press, and the force along the shear over the shear."""
        if self._begun is None or pressed is not self._begun[0]:
            along = np.append(0.0, self.scene.turn @ self.scene.loads[0].imposed_shear)
            axis, state = along / np.linalg.norm(along), self._path.begin_shear(pressed.state)
            stiffness = self.press.power_at(pressed) * pressed.force / pressed.motion
            held = HeldForce(self._path, axis, pressed, stiffness)
            curve = LoadingCurve(
                [_point(state, axis)],
                held.move,
                power=1,
                most=2 * self.scene.shape.L,
                ended=slips_wholly,
                growth=1 / FIRST_PART,
                falls=False,
            )
            self._begun = pressed, held, curve
        return self._begun[1:]

    def follow(self, pressed: CurvePoint, point: CurvePoint) -> CurvePoint:
        """Return the state at the position of a point of the shear on another mesh, after a press to a state here.

        With Coulomb friction it is reached by way of the points that led to that one.
        """
        way = [point]
        while pressed.state.friction is not None and way[-1].before is not None:
            way.append(way[-1].before)
        state, stop = self._path.begin_shear(pressed.state), pressed.stop
        for each in reversed(way):
            if not stop:
                reached = self._path.follow_straight(state, each.state.position)
                state, stop = reached.state, reached.stop
        return CurvePoint(point.motion, point.force, state, stop)

    def out_of_reach(self, found: NotReached, load: Load, force: float, loading: str, motion: str) -> ForceOutOfReach:
        """Return the error that no state has a force, N, of a press or a shear; with the state under the load that
        has the largest one."""
        state = self.read(replace(found.point, stop=""), load, 0.0)
        return ForceOutOfReach(_refusal(found, force, loading, motion, self.scene.design), state)

    def read(self, point: CurvePoint, load: Load, seconds: float) -> Solution:
        """Return the solution at a state whose search took some seconds."""
        iterations = 0
        for curve in (self.press, *(self._begun or ())[2:]):
            iterations, curve.iterations = iterations + curve.iterations, 0
        margin = self._margin
        return read(point.state, self.scene, load, point.stop, iterations=iterations, seconds=seconds, margin=margin)

    def suits(self, load: Load) -> bool:
        """Return whether the mesh is that of a path to another load."""
        D, present = self.scene.design.D, self.scene.loads[0]
        if load.unmoved != present.unmoved:
            return False
        if (load.shears_tip, load.direction) != (present.shears_tip, present.direction):
            return False
        if present.bonds_contact:
            # the mesh is refined at the edge of the contact, whose radius then differs by half as much: less than the
            # size of an element there
            return math.isclose(load.depth, present.depth, rel_tol=0.01)
        return self.scene.solid or mesh_range(self.scene, load.depth / D) == mesh_range(self.scene, present.depth / D)


class HeldForce:
    """A shear during which the depth of the plate holds the normal force of the press before.

    Parameters
    ----------
    axis : (3,) unit vector of the shear.
    pressed : end of the press.
    stiffness : change of the normal force with the depth there, over E D.

    Attributes
    ----------
    force : that is held, over E D^2; at first that of the press.
    watch : is called before each solve with depth and shear.
    """

    def __init__(self, path: Path, axis: Array, pressed: CurvePoint, stiffness: float) -> None:
        self._path, self._axis, self.force = path, axis, pressed.force
        self.watch: Callable[..., None] = lambda *_: None
        # changes of the normal force and of that along the shear with the depth, at the last shear where two depths
        # were tried
        self._stiffness, self._coupling = stiffness, math.nan
        self._depths = {0.0: pressed.motion}

    def move(self, state: PathState, shear: float) -> CurvePoint:
        """Move from a state to a shear over D, or to the last part of it at which the force can be held."""
        point = self._hold(state, shear)
        if not point.stop:
            return point
        low, high = _point(state, self._axis), shear
        for _ in range(PARTS):
            between = self._hold(low.state, (low.motion + high) / 2)
            low, high = (low, (low.motion + high) / 2) if between.stop else (between, high)
        return replace(low, stop=point.stop)

    def _hold(self, state: PathState, shear: float, guess: float | None = None) -> CurvePoint:
        """Return the point at a shear where the normal force is the held one, found by secants over the depth.

        guess : first depth over D; default: that expected from other shears.
        """
        depth, iterations = self._expected(shear) if guess is None else guess, 0
        tried: tuple[float, float, float] | None = None
        stop: Stop = "force_lost"
        for _ in range(MOST_CORRECTIONS):
            self.watch(depth, shear)
            reached = self._path.follow_straight(state, np.append(depth, 0.0 * self._axis[1:]) + shear * self._axis)
            point, normal = _point(reached.state, self._axis), float(tip_force(reached.state)[2])
            iterations += reached.iterations
            if reached.stop:
                stop = reached.stop
                break
            if tried is not None and abs(depth - tried[0]) > LEAST_APART * depth:
                self._stiffness, self._coupling = (
                    (now - before) / (depth - tried[0])
                    for now, before in zip((normal, point.force), tried[1:], strict=True)
                )
            if abs(normal - self.force) <= FORCE_TOLERANCE * self.force:
                self._depths[shear] = depth
                return replace(point, iterations=iterations)
            if not self._stiffness > 0:  # a plate that is pressed by a force gives way here
                break
            tried = depth, normal, point.force
            most = LARGEST_CORRECTION * depth
            depth += min(max((self.force - normal) / self._stiffness, -most), most)
        return replace(point, iterations=iterations, stop=stop)

    def _expected(self, shear: float) -> float:
        """Return the depth expected at a shear, from those at rest and at the two nearest shears.

        It is even in the shear of an upright plate.
        """
        others = sorted((abs(one - shear), one) for one in self._depths if one)[:2]
        at = [one for _, one in others]
        if len(at) == 1:
            first = self._depths[0.0]
            return first + (self._depths[at[0]] - first) * (shear / at[0]) ** 2
        values = [np.array(self._depths[one]) for one in (0.0, *at)]
        return float(extrapolate([0.0, *at], values, shear))

    def motion_errors(self, curve: LoadingCurve, point: CurvePoint, found: Solution) -> dict[str, float | None]:
        """Return the relative errors of depth and shear at a point, from those of the forces at these motions.

        With the changes k and g of F_z and F_t with the depth, and c = dd/ds and h = dF_t/ds along the path of the
        held force, the Jacobian is [[k, -k c], [g, h - g c]], of determinant k h, so that

            |dd| <= (|h - g c| |dF_z| + k |c| |dF_t|) / (k h),  |ds| <= (|g| |dF_z| + k |dF_t|) / (k h).
        """
        normal, along = found.estimates.force, found.estimates.sideways
        s, d = point.motion, float(point.state.position[0])
        if math.isnan(self._coupling) and point.before is not None:
            self._hold(point.before.state, s, OTHER_DEPTH * d)
        k, g, h = self._stiffness, self._coupling, curve.power_at(point) * point.force / s
        if normal is None or along is None or not (k > 0 and h > 0 and math.isfinite(g)):
            return {"depth": None, "shear": None}
        c = (self._expected(s * (1 + LEAST_APART)) - self._expected(s * (1 - LEAST_APART))) / (2 * LEAST_APART * s)
        off, aside = normal * math.hypot(self.force, point.force), along * point.force
        return {
            "depth": (abs(h - g * c) * off + k * abs(c) * aside) / (k * h * d),
            "shear": (abs(g) * off + k * aside) / (k * h * s),
        }


def _motions(state: PathState) -> tuple[float, float]:
    """Return depth and shear of a state over D."""
    return float(state.position[0]), float(np.linalg.norm(state.position[1:]))


def _point(state: PathState, axis: Array) -> CurvePoint:
    x, y, z = tip_force(state)
    return CurvePoint(float(axis @ state.position), float(axis @ [z, x, y]), state)


def _move(path: Path, axis: Array, state: PathState, motion: float) -> CurvePoint:
    """Move from a state along an axis (3,) to a motion over D."""
    reached = path.apply(state, state.position - (axis @ state.position - motion) * axis)
    return replace(_point(reached.state, axis), stop=reached.stop, iterations=reached.iterations)


def _refusal(error: NotReached, force: float, loading: str, motion: str, design: Design) -> str:
    """Return why no state has a force, N: with the largest force, or the jump of the force."""
    unit, point = design.E_now * design.D**2, error.point
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
    if error.fell:
        fallen = f"{error.last.force * unit:.4g} N at {error.last.motion * design.D:.4g} mm"
        return (
            f"the {loading} does not reach {force:g} N: the beam gives way, its force falls from "
            f"{point.force * unit:.4g} N {at} to {fallen}: take a smaller normal force or shear force"
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


def expected_depth(design: Design, magnet: Magnet, force: float) -> float:
    """Return a rough depth over D of a press by a force over E D^2: Hertz's contact on a column.

    The column is what remains of the silicone on the axis below a ball of diameter D.
    """
    R, thickness = design.R / design.D, silicone_on_axis(design, magnet) / design.D
    hertz = (0.75 * force * (1 - design.nu**2) / math.sqrt(R)) ** (2 / 3)
    column = max(thickness - 1.0, 0.0) * force / (math.pi * R**2)
    # Hertz's law knows no base below the tip
    return float(min(hertz + column, 0.3 * thickness))


def slips_wholly(state: PathState) -> bool:
    """Return whether the whole contact area slips; no larger shear then increases the force."""
    friction = state.friction
    return friction is not None and coulomb_friction.slip_share(friction, state.skin.weights) == 1.0
