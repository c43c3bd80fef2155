"""Sideways stability and small shear of a pressed body of revolution, from one harmonic about the axisymmetric state.

A press is followed with the axisymmetric model. About one of its states the tangent K of the model with one harmonic
falls apart into an axisymmetric block and the block of all motions that go like cos theta or sin theta: bending,
sideways shear, rocking on the plate. By Sylvester's law the number of negative eigenvalues of K, less that of the
pressures and of the axisymmetric model, is the number of sideways directions in which the press is unstable.

Two plates are told apart: a frictionless one, on which the tip is free to slide, and one to which the patch in
contact is glued (a guided tip). With it moved sideways by s, K dq = -dR/ds s gives the small-shear answer:
stiffness, motion and tilt of the magnet.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem import contact, models
from fem.contact import Plate
from fem.equilibrium import SHARE, contact_edge, contact_end
from fem.levels import QUICK, STANDARD, Accuracy
from fem.linear import Solver
from fem.material import law
from fem.models import Discretisation
from fem.newton import STOPPED
from fem.path import Path
from fem.solution import pose
from fem.system import Assembly
from geometry.design import BadInput, Design
from geometry.scene import Load, Magnet, check_load

Array = NDArray[np.float64]

DEEPEST = 0.5
"""Depth over the silicone's height up to which an instability is looked for."""
STEP = 0.05
"""Depth over D between two states that are checked."""
TOLERANCE = 2e-3
"""Relative width of the interval in which a critical depth lies."""
ROUGH = 0.3
"""Edge length over D of the section on which the place where the contact ends is found; it is fine there."""
RIM = 0.25
"""Edge length where the contact ends, over the section's, at most SHARE of its radius."""


@dataclass(frozen=True, slots=True)
class Critical:
    """Where a press turns unstable.

    Attributes
    ----------
    depth, force : mm and N, None where no sideways instability was found.
    stable_to : depth up to which there is none, mm.
    message : what to know; empty if nothing.
    """

    depth: float | None
    force: float | None
    stable_to: float
    message: str


@dataclass(frozen=True, slots=True)
class SmallShear:
    """The answer to a small sideways motion of a glued plate about a pressed state.

    Attributes
    ----------
    stiffness : tangential force over the plate's motion, N/mm.
    shift, tilt : motion of the magnet's centre over the plate's, and its rotation, rad/mm.
    force, contact_radius : of the press, N and mm.
    """

    stiffness: float
    shift: float
    tilt: float
    force: float
    contact_radius: float


def critical(
    design: Design,
    magnet: Magnet = "rigid",
    *,
    guided: bool = False,
    accuracy: Accuracy = STANDARD,
    deepest: float | None = None,
) -> Critical:
    """The depth at which a press turns unstable sideways.

    A coarse search first, then a mesh that is fine where the contact ends at that depth, and bisection on it.

    Parameters
    ----------
    guided : the patch in contact is glued to the plate, which itself cannot move sideways.
    deepest : where to stop looking, mm; half of the silicone's height if not told.

    Raises
    ------
    BadInput
        The depth does not fit the design, or the design has no magnet to be rigid.
    """
    room = design.L - (design.magnet_height if magnet == "rigid" else 0.0)
    deepest = DEEPEST * room if deepest is None else deepest
    check_load(design, Load(depth=deepest), magnet)
    end, D = deepest / design.D, design.D
    low, high, reached = _bracket(_build(design, magnet, QUICK), guided, min(STEP, end / 8), 0.0, end)
    if high is None:
        return _none(reached, end, D)
    edge = contact_edge(_build(design, magnet, QUICK)(), (low + high) / 2)
    build = _build(design, magnet, accuracy, _rim(edge, accuracy))
    low, high, reached = _bracket(build, guided, STEP / 2, max(low - STEP, 0.0), min(high + 4 * STEP, end))
    if high is None:
        return _none(reached, end, D)
    # the mesh is finest where the contact ends at the depth that was found
    edge = contact_edge(build(), (low + high) / 2)
    build = _build(design, magnet, accuracy, _rim(edge, accuracy))
    width = max(high - low, 0.02 * high)
    low, high, reached = _bracket(build, guided, width, max(low - width, 0.0), min(high + 2 * width, end))
    if high is None:
        return _none(reached, end, D)
    low, high, force = _bisect(build, guided, low, high)
    return Critical((low + high) / 2 * D, force * design.E * D**2, low * D, "")


def small_shear(
    design: Design, depth: float, magnet: Magnet = "rigid", *, accuracy: Accuracy = STANDARD
) -> SmallShear:
    """Stiffness, shift and tilt per mm of shear at a depth in mm, with the patch in contact glued.

    Raises
    ------
    BadInput
        The depth is not positive or does not fit, the design has no magnet to be rigid, or the press does not
        reach the depth.
    """
    check_depth(design, depth, magnet)
    d, D = depth / design.D, design.D
    rough = replace(QUICK, section_size=max(ROUGH, accuracy.section_size))
    edge = contact_end(_build(design, magnet, rough), RIM * accuracy.section_size, d)
    build = _build(design, magnet, accuracy, _rim(edge, accuracy))
    path = Path(build(), rim=edge)
    try:
        reason = path.go(d, np.zeros(2))
        if reason:
            raise BadInput(
                f"the press stops at depth {path.position[0] * D:.4g} mm ({STOPPED[reason]}): take a smaller depth"
            )
        high = build(harmonics=1)
        q = models.raise_harmonics(path.d.system, high.system, path.q)
        skin = high.system.surface
        assert skin is not None
        plate = contact.glued(skin, high.system.state(q).u, path.plate(), edge, high.shape.H)
        there = high.system.assemble(high.system.state(q), plate)
        shear = replace(plate, shear=np.array([1.0, 0.0]))
        moved = high.system.assemble(high.system.state(q), shear, tangent=False)
        step = _solved(there, there.residual - moved.residual)
        return _small(design, path, high, plate, q, step)
    finally:
        path.close()


def check_depth(design: Design, depth: float, magnet: Magnet) -> None:
    """Refuse a depth, mm, at which there is no patch to shear."""
    check_load(design, Load(depth=depth), magnet)
    if not depth > 0:
        raise BadInput(f"depth must be above 0 for a shear of the patch in contact; got {depth:g} mm")


def _build(
    design: Design, magnet: Magnet, accuracy: Accuracy, rim: tuple[float, float] | None = None
) -> functools.partial[Discretisation]:
    """Builds the section with any number of harmonics."""
    size, shape = accuracy.section_size, design.shape.scaled(1 / design.D)
    silicone = law(design.law, design.law_numbers)
    return functools.partial(models.section, shape, design.nu, magnet, size, size / 2, silicone, rim=rim)


def _rim(edge: float, accuracy: Accuracy) -> tuple[float, float]:
    return edge, min(RIM * accuracy.section_size, SHARE * edge)


def _path(build: functools.partial[Discretisation]) -> Path:
    return Path(build(), raised=functools.partial(build, harmonics=1))


def _bracket(
    build: functools.partial[Discretisation], guided: bool, step: float, start: float, end: float
) -> tuple[float, float | None, float]:
    """Depths over D between which the first instability appears (None if there is none), and the depth reached."""
    path = _path(build)
    try:
        stable, depth = 0.0, start or step
        while True:
            if path.go(depth, np.zeros(2)):
                return stable, None, stable
            if path.sideways(guided=guided):
                return stable, depth, depth
            if depth >= end:
                return depth, None, depth
            stable, depth = depth, min(depth + step, end)
    finally:
        path.close()


def _bisect(
    build: functools.partial[Discretisation], guided: bool, low: float, high: float
) -> tuple[float, float, float]:
    """A narrow interval of depths around the instability, and the force over E D^2 in its middle."""
    path = _path(build)
    try:
        while high - low > TOLERANCE * high:
            middle = (low + high) / 2
            if path.go(middle, np.zeros(2)):
                break
            if path.sideways(guided=guided):
                high = middle
            else:
                low = middle
        path.go((low + high) / 2, np.zeros(2))
        return low, high, _normal(path)
    finally:
        path.close()


def _normal(path: Path) -> float:
    """Normal force over E D^2."""
    residual, _, _ = contact.traction(path.skin, path.u, path.plate())
    return float(np.sum(path.skin.weights * residual[..., 2]))


def _none(reached: float, end: float, D: float) -> Critical:
    message = "" if reached >= end else f"the press itself stops at {reached * D:.4g} mm; stable up to there"
    return Critical(None, None, reached * D, message)


def _solved(assembly: Assembly, right: Array) -> Array:
    solver = Solver()
    try:
        solver.factorise(assembly.tangent)
        return solver.solve(right)
    finally:
        solver.close()


def _small(design: Design, path: Path, high: Discretisation, plate: Plate, q: Array, step: Array) -> SmallShear:
    """Read the linear answer `step` per unit of shear about q."""
    system, D = high.system, design.D
    skin = system.surface
    assert skin is not None
    assert plate.tied is not None
    way = 1e-6
    ahead, behind = system.state(q + way * step), system.state(q - way * step)
    du = skin.displacement((ahead.u - behind.u) / (2 * way))[..., 0]
    stiffness = float(np.sum((skin.weights * plate.stiffness * (1 - du))[plate.tied]))
    (shift2, tilt2), (shift1, tilt1) = (pose(high, s.u, s.q) for s in (ahead, behind))
    return SmallShear(
        stiffness=stiffness * design.E * D,
        shift=float(shift2[0] - shift1[0]) / (2 * way),
        tilt=float(tilt2[0] - tilt1[0]) / (2 * way) / D,
        force=_normal(path) * design.E * D**2,
        contact_radius=contact.contact_radius(path.skin, path.u, path.plate()) * D,
    )
