"""From a design and a path of loads to solutions: which model, which meshes, error estimates.

Every scene is solved with lengths divided by D and stresses by E, so designs of one law that differ only in E, f or
scale are the same problem: pose and depth over D are shared, forces are proportional to E D^2.

Signs: the plate's lower face starts at z = L and comes down by `depth`; the reported force is the load on the tip,
positive in compression and along the shear.
"""

from __future__ import annotations

import contextlib
import functools
import math
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem import contact, models
from fem.material import law
from fem.path import FIRST_TOUCH, Path
from fem.solution import Solution, read, slides
from geometry.design import BadInput, Design
from geometry.scene import Load, Magnet, Response, check_load

Array = NDArray[np.float64]
Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]
Progress = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class Accuracy:
    """The finite elements' only knob.

    Attributes
    ----------
    name : quick, standard or fine.
    section_size, solid_size : edge lengths of the section and the tetrahedral mesh, in units of D.
    section_patch, solid_patch : edge lengths where the glued or gripped patch of skin ends (under a tilted plate at
        the tip); with coarse ones the tip shears too stiffly.
    harmonics : number of harmonics of the harmonic model.
    rub : length of the steps with Coulomb friction over their usual one.
    """

    name: str
    section_size: float
    solid_size: float
    section_patch: float
    solid_patch: float
    harmonics: int
    rub: float = 1.0


QUICK = Accuracy("quick", 0.12, 0.16, 0.01, 0.03, 2)
STANDARD = Accuracy("standard", 0.06, 0.14, 0.004, 0.015, 3)
FINE = Accuracy("fine", 0.04, 0.10, 0.00125, 0.01, 4)
LEVELS = {level.name: level for level in (QUICK, STANDARD, FINE)}

RULES = {
    "press": ((0.7, 0.27, 1.5), (0.5, 0.28, 1.5), (0.5, 0.28, 1.5)),
    "pressed": ((1.0, 0.675, 2.5), (0.5, 1.21, 2.5), (0.5, 1.21, 2.5)),
    "stick": ((0.7, 0.055, 1.5), (0.4, 0.21, 2.0), (0.5, 0.0095, 0.75)),
    "grip": ((1.3, 0.065, 1.5), (1.2, 0.023, 1.5), (0.5, 0.028, 1.0)),
    "friction": ((0.7, 0.27, 1.5), (0.5, 0.28, 1.5), (0.5, 0.28, 1.5)),
    "solid": ((1.0, 0.45, 1.5), (1.0, 0.45, 1.5), (1.0, 0.25, 1.5)),
}
"""How the errors of force, shift and tilt are estimated on a section, by the load ("pressed" is the press before a
stick shear, whose mesh is fine where the contact ends), and on tetrahedra: the difference
to the companion times the first number, but at least the second times (edge length / D) to the power of the third.
Set with `magtip accuracy`, which holds the estimates against true errors. Those with Coulomb friction, whose
companion takes longer steps too, are the press's: twice the true errors of quick and standard or more at mu = 1,
0.5 mm deep, sheared by 0.5 and 1.5 mm."""
COARSER = 1.5
"""Edge lengths of the companion that the error is estimated with, over those of the solution."""
MOST_HARMONICS = 12
NOTHING = 1e-12
"""Tilts (rad) below this are rounding, which no error is relative to; forces and shifts are small at small loads."""


def choose_model(loads: Sequence[Load], model: Model) -> models.Model:
    """The smallest model that can answer the loads, or BadInput if the one asked for cannot.

    >>> choose_model([Load(depth=1.0)], "auto")
    'axisymmetric'
    """
    sideways = any(slides(load) for load in loads)
    tilted = any(load.plate_tilt for load in loads)
    turns = len({_axis(load) for load in loads if slides(load)} | ({0.0} if tilted else set())) > 1
    if model not in ("auto", "axisymmetric", "harmonic", "half", "full"):
        raise BadInput(f"model must be auto, axisymmetric, harmonic, half or full; got {model!r}")
    if model == "axisymmetric" and sideways:
        raise BadInput("model axisymmetric cannot carry a shear: choose auto or harmonic")
    if model in ("axisymmetric", "harmonic") and tilted:
        raise BadInput(f"model {model} cannot carry a tilted plate: choose auto, half or full")
    if model in ("harmonic", "half") and turns:
        raise BadInput(f"model {model} carries shear and tilt in one plane only: choose auto or full")
    if model == "auto":
        return "full" if turns else "half" if tilted else "harmonic" if sideways else "axisymmetric"
    return model


def solve(
    design: Design,
    load: Load,
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
) -> Solution:
    """The state under one load. See `walk`."""
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
    """All states of `walk`."""
    return list(walk(design, loads, accuracy, magnet=magnet, model=model, estimate=estimate, progress=progress))


def walk(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy = STANDARD,
    *,
    magnet: Magnet = "rigid",
    model: Model = "auto",
    estimate: bool = True,
    progress: Progress | None = None,
) -> Iterator[Solution]:
    """Follow a path of loads: for each one first the depth, then the shear.

    Parameters
    ----------
    loads : all of one kind (plate or grip, friction, tilt of the plate); under a glued plate the depth must not
        change once it has sheared. With Coulomb friction the answer depends on the way: the plate may come and go.
    estimate : estimate the errors of force, shift and tilt, by a companion that walks along: on a mesh coarser by
        COARSER and with one harmonic less. RULES say how they follow from the difference, which may vanish by chance.
        Also look whether an axisymmetric press would be stable sideways, and say so in the message if not.
    progress : called with a fraction of the path and a text.

    Yields
    ------
    One solution per load that was reached, as soon as it is; where the solve stopped short, the last one holds the
    last good state with its status and message.

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
    return _walk(design, loads, accuracy, magnet, name, estimate, progress)


def _walk(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: models.Model,
    estimate: bool,
    progress: Progress | None,
) -> Iterator[Solution]:
    states = _follow(design, loads, accuracy, magnet, name, progress, watch=estimate)
    if not estimate:
        yield from states
        return
    companions = _follow(design, loads, coarser(accuracy), magnet, name, None)
    with contextlib.closing(states), contextlib.closing(companions):
        for state in states:
            companion = next(companions, None)
            yield state if companion is None else _with_estimates(state, companion, loads, accuracy)


def coarser(accuracy: Accuracy) -> Accuracy:
    """That of the companion."""
    sizes = ("section_size", "solid_size", "section_patch", "solid_patch", "rub")
    changed = {size: COARSER * getattr(accuracy, size) for size in sizes}
    return replace(accuracy, harmonics=max(accuracy.harmonics - 1, 1), **changed)


def estimates(
    one: Response, other: Response, load: Load, loads: Sequence[Load], accuracy: Accuracy, model: str
) -> tuple[float | None, float | None, float | None]:
    """Relative errors of force, shift and tilt from the mesh, by RULES, from a response and its companion's.

    The load is one of the path's `loads`.
    """
    scene, edge = "press", accuracy.section_size
    if coulomb(loads) is not None:
        scene = "friction"
    elif any(map(slides, loads)):
        scene = "pressed" if not slides(load) else "stick" if load.grip is None else "grip"
    if model in ("half", "full"):
        scene, edge = "solid", accuracy.solid_size
    pairs = (one.force, other.force), (one.shift, other.shift), ((one.tilt, one.tilt_y), (other.tilt, other.tilt_y))
    force, shift, tilt = (
        _estimate(*pair, factor, floor * edge**power, nothing)
        for pair, (factor, floor, power), nothing in zip(pairs, RULES[scene], (0.0, 0.0, NOTHING), strict=True)
    )
    return force, shift, tilt


def _with_estimates(state: Solution, companion: Solution, loads: Sequence[Load], accuracy: Accuracy) -> Solution:
    """The state with the differences to its companion, if that one has reached the same load."""
    seconds = state.seconds + companion.seconds
    same = (state.load.depth, *_shear(state.load)) == (companion.load.depth, *_shear(companion.load))
    if not same:
        return replace(state, seconds=seconds)
    force, shift, tilt = estimates(state.response, companion.response, state.load, loads, accuracy, state.model)
    return replace(
        state,
        seconds=seconds,
        error_estimate=force,
        shift_error_estimate=shift,
        tilt_error_estimate=tilt,
    )


def _estimate(
    one: Sequence[float], other: Sequence[float], factor: float, least: float, nothing: float
) -> float | None:
    """Relative difference of two vectors times a factor, at least `least`; None where there is nothing."""
    size = math.hypot(*one)
    return max(factor * math.dist(one, other) / size, least) if size > nothing else None


def _axis(load: Load) -> float:
    """Angle of the line along which a load shears, in (-90, 90] degrees, rad."""
    angle = math.atan2(load.shear_y, load.shear_x)
    return round(angle - math.pi * math.ceil(angle / math.pi - 0.5 - 1e-12), 12) + 0.0


def _check_path(loads: Sequence[Load]) -> None:
    first = loads[0]
    if any(
        (load.grip, load.friction, load.plate_tilt) != (first.grip, first.friction, first.plate_tilt)
        for load in loads
    ):
        raise BadInput("all loads of a path must share the grip, the friction and the tilt of the plate")
    glued: float | None = None
    for load in loads:
        if glued is not None and load.depth != glued:
            raise BadInput(f"the plate is glued since depth {glued:g} mm and cannot come to {load.depth:g} mm")
        if slides(load) and load.friction == "stick" and load.grip is None:
            if load.depth == 0:
                raise BadInput("a glued plate needs a depth above 0: nothing is in contact yet")
            glued = load.depth


def _follow(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: models.Model,
    progress: Progress | None,
    *,
    watch: bool = False,
) -> Generator[Solution]:
    begin = time.perf_counter()
    D, grip = design.D, loads[0].grip
    if grip is not None and name in ("half", "full"):
        _check_grip(design, grip, accuracy.solid_patch)
    path = _start(design, loads, accuracy, magnet, name)
    angle = next((_axis(load) for load in loads if slides(load)), 0.0) if name != "full" else 0.0
    direction = np.array([math.cos(angle), math.sin(angle)])
    turn = np.array([direction, [-direction[1], direction[0]]])
    try:
        for i, load in enumerate(loads):
            if progress is not None:
                progress(i / len(loads), f"{name}: depth {load.depth:g} mm, shear {math.hypot(*_shear(load)):g} mm")
            reason = path.go(load.depth / D, turn @ _shear(load) / D)
            end = time.perf_counter()
            state = read(path, design, load, direction, reason, end - begin, watch=watch)
            begin = end
            yield state
            if state.status not in ("ok", "unstable"):
                return
    finally:
        path.close()


def _start(design: Design, loads: Sequence[Load], accuracy: Accuracy, magnet: Magnet, name: models.Model) -> Path:
    """The path with its model, at rest."""
    shape = design.shape.scaled(1 / design.D)
    depths = [load.depth / design.D for load in loads if load.depth > FIRST_TOUCH * design.D]
    silicone = law(design.law, design.law_numbers)
    sideways = any(map(slides, loads))
    grip, tilt = loads[0].grip, loads[0].plate_tilt
    held = None if grip is None else grip / design.D
    mu = coulomb(loads)
    size = accuracy.section_size
    tip = min(size, math.sqrt(shape.R * min(depths, default=1.0)) * size / QUICK.section_size / 6)
    build = functools.partial(models.section, shape, design.nu, magnet, size, tip, silicone)
    edge = None
    if sideways and held is not None:
        edge = math.sqrt(held * (2 * shape.R - held)) if held < shape.R else shape.R
    elif sideways and not tilt and mu is None:
        glued = next(load.depth for load in loads if slides(load)) / design.D
        # the first press has no fine mesh where its contact ends, the second one has
        edge = contact_edge(build(), glued)
        edge = contact_edge(build(rim=(edge, min(accuracy.section_patch, edge / 4))), glued)
    if name in ("half", "full"):
        coarse = accuracy.solid_size
        solid = functools.partial(models.solid, shape, design.nu, magnet, coarse, law=silicone, half=name == "half")
        if edge is None or edge == shape.R:
            fine = accuracy.solid_patch if sideways or tilt else coarse / 2
            return Path(solid(fine), held, tilt, mu=mu, rub=accuracy.rub)
        return Path(solid(coarse / 2, rim=(edge, min(accuracy.solid_patch, edge / 3))), held, rim=edge)
    if name == "axisymmetric":
        return Path(build(), raised=functools.partial(build, harmonics=1), mu=mu, rub=accuracy.rub)
    if mu is not None and sideways:
        raised = functools.partial(build, harmonics=accuracy.harmonics)
        return Path(build(), raised=raised, mu=mu, rub=accuracy.rub)
    if edge is None:
        return Path(build(harmonics=accuracy.harmonics), held, mu=mu, rub=accuracy.rub)
    build = functools.partial(build, rim=(edge, min(accuracy.section_patch, edge / 4)))
    if held is not None:
        return Path(build(harmonics=accuracy.harmonics), held)
    return Path(build(), raised=functools.partial(build, harmonics=accuracy.harmonics), rim=edge)


def coulomb(loads: Sequence[Load]) -> float | None:
    """Coefficient of friction of a path's loads, None for a frictionless or glued plate."""
    mu = loads[0].friction
    return None if isinstance(mu, str) or mu == 0 else float(mu)


def contact_edge(d: models.Discretisation, depth: float) -> float:
    """Undeformed radius at which the contact of a press ends, in units of D."""
    path = Path(d)
    try:
        path.go(depth, np.zeros(2))
        radius = contact.contact_radius(path.skin, path.u, path.plate())
        return contact.material_radius(path.skin, path.u, path.plate(), radius)
    finally:
        path.close()


def _check_grip(design: Design, grip: float, patch_size: float) -> None:
    """Refuse a grip whose cap of skin is narrower than two elements."""
    least = 2 * (2 * patch_size) ** 2 * design.D**2 / design.R / 4
    if grip < least:
        raise BadInput(
            f"grip must be at least {least:.3g} mm at this accuracy, or the mesh misses it; got {grip:g} mm"
        )


def _shear(load: Load) -> tuple[float, float]:
    return (load.shear_x, load.shear_y) if slides(load) else (0.0, 0.0)
