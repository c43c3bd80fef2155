"""From a design and a path of loads to solutions: steps, statuses, scaling.

Every scene is solved with lengths divided by D and stresses by E, so designs of one law that differ only in E, f or
scale are the same problem: pose and depth over D are shared, forces are proportional to E D^2.

Signs: the plate's lower face starts at z = L and comes down by `depth`; the reported force is the load on the tip,
positive in compression and along the shear.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import skfem
from numpy.typing import NDArray

from fem import contact, elements, models
from fem.contact import KAPPA, Plate
from fem.linear import Solver
from fem.material import law
from fem.models import Discretisation
from fem.newton import Equilibrium, newton
from geometry.design import BadInput, Design
from geometry.scene import Load, Magnet, Response, check_load

Array = NDArray[np.float64]
Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]
Status = Literal["ok", "not_converged", "unstable", "no_contact"]
Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class Accuracy:
    """The finite elements' only knob.

    Attributes
    ----------
    name : quick, standard or fine.
    section_size, solid_size : edge lengths of the section and the tetrahedral mesh, in units of D.
    patch_size : edge length of the tetrahedra at the tip where it is glued or gripped; a coarse one holds more of
        the skin than it should, and the tip shears too stiffly.
    """

    name: str
    section_size: float
    solid_size: float
    patch_size: float


QUICK = Accuracy("quick", 0.12, 0.16, 0.055)
STANDARD = Accuracy("standard", 0.06, 0.14, 0.04)
FINE = Accuracy("fine", 0.035, 0.10, 0.03)
LEVELS = {level.name: level for level in (QUICK, STANDARD, FINE)}

FLOOR = 0.065
"""Least error estimate per edge length of the section; set on twelve designs against a mesh of 0.018 D, so that
nearly all true errors lie below the estimate."""
LONGEST_STEP = 0.125
SHORTEST_STEP = 1e-3
BUCKLED = 0.01
"""Sideways shift of the magnet over D, or its tilt, beyond which a frictionless press is no longer the symmetric one;
mesh noise alone stays below a third of it."""
DEEP = 0.3
"""Depth over D from which on an axisymmetric press is marked: the paper's sensor gives way between 0.31 and 0.34."""
FIRST_TOUCH = 1e-14


@dataclass(frozen=True, slots=True)
class Field:
    """The deformed body: mesh in mm, nodal displacements (n, dim) in mm, pressures at its vertices in MPa."""

    mesh: skfem.Mesh
    u: Array
    p: Array
    vertices: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Solution:
    """One state of a load path.

    Attributes
    ----------
    load : the load that this state carries; less than the one asked for when the solve stopped on the way.
    response, field : the answer, and what it was read from.
    energy : stored in the deformed silicone, N mm; its derivative by the depth is the normal force.
    status, message : "ok", or why not and what to try.
    error_estimate : relative error of the force from the mesh, None where it was not estimated.
    dofs, newton_iterations, seconds : what it cost since the state before.
    """

    load: Load
    response: Response
    energy: float
    status: Status
    message: str
    model: str
    error_estimate: float | None
    dofs: int
    newton_iterations: int
    seconds: float
    field: Field


def choose_model(loads: Sequence[Load], model: Model) -> models.Model:
    """The smallest model that can answer the loads, or BadInput if the one asked for cannot.

    >>> choose_model([Load(depth=1.0)], "auto")
    'axisymmetric'
    """
    sideways = any(_slides(load) for load in loads)
    if model in ("harmonic", "full"):
        raise BadInput(f"model {model} is not available yet: choose auto, axisymmetric or half")
    if any(load.friction not in ("none", "stick", 0) for load in loads):
        raise BadInput("Coulomb friction is not available yet: choose friction none or stick")
    if model == "axisymmetric" and sideways:
        raise BadInput("model axisymmetric cannot carry a shear: choose auto or half")
    if model == "auto":
        return "half" if sideways else "axisymmetric"
    if model not in ("axisymmetric", "half"):
        raise BadInput(f"model must be auto, axisymmetric or half; got {model!r}")
    return model


def solve(
    design: Design,
    load: Load,
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
) -> Solution:
    """The state under one load. See `trace`."""
    return trace(design, [load], accuracy, magnet=magnet, model=model)[-1]


def trace(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    estimate: bool = True,
    progress: Progress | None = None,
) -> list[Solution]:
    """Follow a path of loads: for each one first the depth, then the shear.

    Parameters
    ----------
    loads : all of one kind (plate or grip, friction, direction of shear); under a glued plate the depth must not
        change once it has sheared.
    estimate : estimate the error of the force. Axisymmetric model and grip: the difference to a mesh coarser by
        half, but at least FLOOR times the section's edge length over D, because a difference may vanish by chance.
        Half model under a plate: the difference of its normal force, before any shear, to the axisymmetric model at
        the same depth, plus that one's own estimate; the shear itself is not estimated.
    progress : called with a fraction of the path and a text.

    Returns
    -------
    One solution per load that was reached; where the solve stopped short, the last one holds the last good state
    with its status and message.

    Raises
    ------
    BadInput
        The loads do not fit the design, the model or each other.
    """
    if not loads:
        raise BadInput("a path needs at least one load")
    for load in loads:
        check_load(design, load, magnet)
    name = choose_model(loads, model)
    _check_path(loads)
    if not estimate:
        return _follow(design, loads, accuracy, magnet, name, 1.0, progress)
    if name == "axisymmetric" or loads[0].grip is not None:
        solutions = _follow(design, loads, accuracy, magnet, name, 1.0, progress)
        coarse = _follow(design, loads, accuracy, magnet, name, 1.5, None)
        pairs = zip(solutions, coarse, strict=False)
        least = FLOOR * accuracy.section_size
        return [_with_estimate(s, max(_difference(s, c), least), c) for s, c in pairs] + solutions[len(coarse) :]
    return _estimated_half(design, loads, accuracy, magnet, progress)


def _estimated_half(
    design: Design, loads: Sequence[Load], accuracy: Accuracy, magnet: Magnet, progress: Progress | None
) -> list[Solution]:
    """Solutions of the half model with the error of their normal force before the shear."""
    pressed = replace(loads[0], shear_x=0.0, shear_y=0.0)
    first = [] if loads[0] == pressed else [pressed]
    solid = _follow(design, [*first, *loads], accuracy, magnet, "half", 1.0, progress)
    depths = sorted({load.depth for load in loads})
    section = trace(design, [Load(depth=d) for d in depths], accuracy, magnet=magnet, model="axisymmetric")
    error: dict[float, float] = {}
    for s in solid:
        match = next((c for c in section if c.load.depth == s.load.depth and c.status == "ok"), None)
        if match is not None and not _slides(s.load):
            error[s.load.depth] = _difference(s, match) + (match.error_estimate or 0.0)
    solid = [_with_estimate(s, error.get(s.load.depth)) for s in solid]
    if len(solid) > len(first):
        kept = solid[len(first) :]
        return [replace(kept[0], seconds=sum(s.seconds for s in solid[: len(first) + 1])), *kept[1:]]
    return solid


def _difference(one: Solution, other: Solution) -> float:
    """Relative difference of the forces, 0 where there are none; infinite where the loads differ."""
    if (one.load.depth, one.load.shear_x, one.load.shear_y) != (
        other.load.depth,
        other.load.shear_x,
        other.load.shear_y,
    ):
        return math.inf
    size = math.hypot(*one.response.force)
    return math.dist(one.response.force, other.response.force) / size if size else 0.0


def _with_estimate(solution: Solution, error: float | None, companion: Solution | None = None) -> Solution:
    if error is None or not math.isfinite(error):
        return solution
    extra = companion.seconds if companion else 0.0
    return replace(solution, error_estimate=error, seconds=solution.seconds + extra)


def _slides(load: Load) -> bool:
    """Whether a load moves the tip sideways (a frictionless plate does not)."""
    return bool(load.shear_x or load.shear_y) and (load.grip is not None or load.friction == "stick")


def _check_path(loads: Sequence[Load]) -> None:
    first = loads[0]
    if any(load.grip != first.grip or load.friction != first.friction for load in loads):
        raise BadInput("all loads of a path must share the grip and the friction")
    directions = {round(math.atan2(v.shear_y, v.shear_x), 12) for v in loads if _slides(v)}
    if len(directions) > 1 and any(v.shear_y for v in loads):
        raise BadInput("all loads of a path must shear in one direction")
    glued: float | None = None
    for load in loads:
        if glued is not None and load.depth != glued:
            raise BadInput(f"the plate is glued since depth {glued:g} mm and cannot come to {load.depth:g} mm")
        if _slides(load) and load.grip is None:
            if load.depth == 0:
                raise BadInput("a glued plate needs a depth above 0: nothing is in contact yet")
            glued = load.depth


def _follow(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: models.Model,
    coarsening: float,
    progress: Progress | None,
) -> list[Solution]:
    begin = time.perf_counter()
    shape = design.shape.scaled(1 / design.D)
    depths = [load.depth / design.D for load in loads if load.depth > FIRST_TOUCH * design.D]
    silicone = law(design.law, design.law_numbers)
    if name == "axisymmetric":
        size = accuracy.section_size * coarsening
        tip = math.sqrt(shape.R * min(depths, default=1.0)) * accuracy.section_size / QUICK.section_size / 6
        d = models.axisymmetric(shape, design.nu, magnet, size, min(size, tip * coarsening), silicone)
    else:
        size = accuracy.solid_size * coarsening
        tip = accuracy.patch_size * coarsening if any(map(_slides, loads)) else size / 2
        d = models.half(shape, design.nu, magnet, size, tip, silicone)
    if loads[0].grip is not None:
        _check_grip(design, loads[0].grip, accuracy.patch_size)
    path = _Path(d, design, loads[0])
    solutions: list[Solution] = []
    for i, load in enumerate(loads):
        if progress is not None:
            progress(i / len(loads), f"{name}: depth {load.depth:g} mm, shear {math.hypot(*_shear(load)):g} mm")
        reason = path.go(load)
        end = time.perf_counter()
        solutions.append(path.solution(load, reason, end - begin))
        begin = end
        if solutions[-1].status not in ("ok", "unstable"):
            break
    path.solver.close()
    return solutions


def _check_grip(design: Design, grip: float, patch_size: float) -> None:
    """Refuse a grip whose cap of skin is narrower than two elements."""
    least = 2 * (2 * patch_size) ** 2 * design.D**2 / design.R / 4
    if grip < least:
        raise BadInput(
            f"grip must be at least {least:.3g} mm at this accuracy, or the mesh misses it; got {grip:g} mm"
        )


def _shear(load: Load) -> tuple[float, float]:
    return (load.shear_x, load.shear_y) if _slides(load) else (0.0, 0.0)


class _Path:
    """The state while a path is followed, in units of D and E."""

    def __init__(self, d: Discretisation, design: Design, first: Load) -> None:
        self.d, self.design = d, design
        self.solver = Solver()
        self.depth, self.shear = 0.0, 0.0
        self.q = np.zeros(d.system.size)
        self.iterations = 0
        self.energy = 0.0
        self.tied: NDArray[np.bool_] | None = None
        self.targets: Array | None = None
        self.gap: Array | None = None
        self.grip = first.grip is not None
        skin = self._skin
        if first.grip is not None:
            self.tied = skin.points[..., -1] >= d.shape.L - first.grip / design.D
            self.targets = skin.points[..., :-1]
        self._before: tuple[float, Array] | None = None

    @property
    def _skin(self) -> elements.Surface:
        assert self.d.system.surface is not None
        return self.d.system.surface

    def plate(self, depth: float, shear: float) -> Plate:
        """The plate (or grip) at a depth and a shear in units of D."""
        vector = np.zeros(self.d.elements.dim - 1)
        vector[0] = shear
        radius = self.d.shape.R if self.grip else math.sqrt(self.d.shape.R * max(depth, FIRST_TOUCH))
        height = None if self.grip else self.d.shape.L - depth
        return Plate(height, KAPPA / radius, vector, self.tied, self.targets, self.gap)

    def go(self, load: Load) -> str:
        """Move to a load; returns an empty text or why it stopped on the way."""
        self.iterations = 0
        D = self.design.D
        self._before = None
        reason = self._leg("depth", load.depth / D)
        shear = _shear(load)
        along = math.copysign(math.hypot(*shear), shear[0] if shear[1] == 0 else 1.0) / D
        if reason or (along == 0 and self.shear == 0):
            return reason
        if self.tied is None:
            u, plate = self.d.system.state(self.q).u, self.plate(self.depth, 0.0)
            radius = contact.contact_radius(self._skin, u, plate)
            near = self._skin.points[..., -1] > self.d.shape.H
            self.tied = near & (contact.from_pressure_centre(self._skin, u, plate) < radius)
            self.targets = contact.positions(self._skin, u)[..., :-1]
            self.gap = np.maximum(-contact.overlap(self._skin, u, plate), 0.0)
        self._before = None
        return self._leg("shear", along)

    def _leg(self, what: Literal["depth", "shear"], goal: float) -> str:
        """Change one of depth and shear to a goal, in steps that shrink on failure and grow on success."""
        start = self.depth if what == "depth" else self.shear
        if goal == start:
            return ""
        now, step = start, math.copysign(min(LONGEST_STEP, abs(goal - start)), goal - start)
        while now != goal:
            target = goal if abs(goal - now) <= 1.001 * abs(step) else now + step
            answer = self._try(what, now, target)
            if answer.converged:
                self._before = (now, self.q)
                self.q, self.energy = answer.state.q, answer.assembly.energy
                now = target
                if what == "depth":
                    self.depth = now
                else:
                    self.shear = now
                if answer.iterations <= 7:
                    step *= 1.5
                continue
            self._before = None
            step = (target - now) / 2
            if abs(step) < SHORTEST_STEP * min(abs(goal - start), 1.0):
                return answer.reason
        return ""

    def _try(self, what: str, now: float, target: float) -> Equilibrium:
        depth, shear = (target, self.shear) if what == "depth" else (self.depth, target)
        guess = self.q
        if self._before is not None and self._before[0] != now:
            guess = self.q + (self.q - self._before[1]) * ((target - now) / (now - self._before[0]))
        answer = newton(self.d.system, self.solver, guess, self.plate(depth, shear), self._pressed(depth))
        self.iterations += answer.iterations
        return answer

    def _pressed(self, depth: float) -> NDArray[np.bool_] | None:
        """Where to expect contact: as before, or within Hertz's radius at first touch."""
        if self.grip:
            return None
        if self.depth == 0:
            return np.asarray(self._skin.points[..., -1] >= self.d.shape.L - depth / 2)
        u = self.d.system.state(self.q).u
        return contact.overlap(self._skin, u, self.plate(self.depth, self.shear)) > 0

    def solution(self, load: Load, reason: str, seconds: float) -> Solution:
        """The current state in the user's units."""
        D, d = self.design.D, self.d
        state = d.system.state(self.q)
        plate = self.plate(self.depth, self.shear)
        direction = np.array(_shear(load)) / (math.hypot(*_shear(load)) or 1.0)
        if direction[0] < 0 and direction[1] == 0:
            direction = -direction
        if reason:
            load = replace(load, depth=self.depth * D, **_components(load, self.shear * D, direction))
        force, radius = self._forces(state.u, plate)
        shift, tilt = self._pose(state.u)
        scale = self.design.E * D**2
        x, y = (direction if direction.any() else np.array([1.0, 0.0])).tolist()
        response = Response(
            force=(force[0] * scale * x, force[0] * scale * y, force[1] * scale),
            shift=(shift[0] * D * x, shift[0] * D * y, shift[1] * D),
            tilt=tilt * x,
            contact_radius=radius * D,
        )
        status, message = self._judge(load, reason, response)
        return Solution(
            load=load,
            response=response,
            energy=self.energy * d.symmetry * self.design.E * D**3,
            status=status,
            message=message,
            model=d.model,
            error_estimate=None,
            dofs=d.system.size,
            newton_iterations=self.iterations,
            seconds=seconds,
            field=Field(
                mesh=type(d.mesh)(d.mesh.doflocs * D, d.mesh.t),
                u=state.u * D,
                p=state.p * self.design.E,
                vertices=d.system.corner_nodes,
            ),
        )

    def _judge(self, load: Load, reason: str, response: Response) -> tuple[Status, str]:
        normal, sheared = response.force[2], _slides(load)
        if reason:
            at = f"depth {load.depth:.4g} mm" + (f", shear {self.shear * self.design.D:.4g} mm" if self.shear else "")
            return "not_converged", f"stopped at {at}: {reason}; try a smaller load or a finer accuracy"
        if load.depth > 0 and not normal > 0 and not sheared:
            remedy = (
                "the plate has not reached it to within rounding: take a larger depth"
                if self.d.model == "axisymmetric"
                else "choose model axisymmetric, whose mesh follows the contact"
            )
            return "no_contact", f"depth {load.depth:g} mm touches no integration point of this mesh: {remedy}"
        if load.depth > 0 and normal < 0:
            return "ok", "the glued plate pulls at the tip by now: a real one would peel off or slip before"
        slipped = max(math.hypot(*response.shift[:2]) / self.design.D, abs(response.tilt))
        if load.depth > 0 and not sheared and slipped > BUCKLED:
            return "unstable", (
                f"the tip has given way sideways under the frictionless plate (shift {response.shift[0]:.2g} mm, "
                f"tilt {response.tilt:.2g} rad; the mesh decides to which side): the symmetric press is unstable"
            )
        return "ok", self._remark(load, sheared)

    def _remark(self, load: Load, sheared: bool) -> str:
        """What a user should know of an answer that is good."""
        if (load.shear_x or load.shear_y) and not sheared:
            return "the frictionless plate slides over the tip: the shear has no effect"
        slender, deep = self.design.L > 3 * self.design.D, load.depth > DEEP * self.design.D
        if self.d.model == "axisymmetric" and load.depth > 0 and (slender or deep):
            return (
                "so slender a beam, or so deep a press, may give way sideways under a frictionless plate, which the "
                "axisymmetric model cannot see: check with model half"
            )
        if load.friction == "stick" and not sheared:
            return "stick acts once the plate shears: the press itself is frictionless"
        return ""

    def _forces(self, u: Array, plate: Plate) -> tuple[tuple[float, float], float]:
        """Force along the shear and normal force on the tip, and the contact radius."""
        residual, _, _ = contact.traction(self._skin, u, plate)
        total = self.d.symmetry * np.einsum("kq,kqi->i", self._skin.weights, residual)
        radius = 0.0 if self.grip else contact.contact_radius(self._skin, u, plate)
        return (0.0 if len(total) == 2 else -float(total[0]), float(total[-1])), radius

    def _pose(self, u: Array) -> tuple[tuple[float, float], float]:
        """Displacement of the magnet's centre (along the shear, z) and its rotation.

        Without a rigid magnet: the material point at the centre, and the rotation of the polar decomposition there.
        """
        system, dim = self.d.system, self.d.elements.dim
        if system.rigid:
            motion = system.motion(self.q)
            if dim == 2:
                return (0.0, float(motion[0])), 0.0
            return (float(motion[0]), float(motion[1])), float(motion[2])
        centre = np.zeros(dim)
        centre[-1] = self.d.shape.H
        nodes, values, grads = elements.interpolation(self.d.elements, centre)
        at = values @ u[nodes]
        if dim == 2:
            return (0.0, float(at[1])), 0.0
        G = u[nodes].T @ grads
        return (float(at[0]), float(at[2])), float(np.arctan2(G[0, 2] - G[2, 0], 2 + G[0, 0] + G[2, 2]))


def _components(load: Load, shear: float, direction: Array) -> dict[str, float]:
    if not _slides(load):
        return {}
    return {"shear_x": float(shear * direction[0]), "shear_y": float(shear * direction[1])}
