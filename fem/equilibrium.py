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
from dataclasses import replace
from typing import Literal

import numpy as np
import skfem
from numpy.typing import NDArray

from fem.accuracy import QUICK, STANDARD, Accuracy, coarser
from fem.contact import plate_contact
from fem.discretisation import symmetry_models
from fem.error_estimates import estimate_response
from fem.material import law
from fem.results.lateral_stiffness import SidewaysModel
from fem.results.postprocess import read
from fem.solution import Solution
from fem.solvers.depth_ranges import graded_depth, parts
from fem.solvers.load_stepping import Path
from fem.solvers.path_state import FIRST_TOUCH, PathState
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load

Array = NDArray[np.float64]
Model = Literal["auto", "axisymmetric", "harmonic", "half", "full"]
Progress = Callable[[float, str], None]


MOST_HARMONICS = 12
TIP = 1.0
"""Edge length at the tip over that of the section, in radii at which the plate would cut the tip, over D."""
PRESS_FILLET = 0.5
"""Edge length at the magnet's fillet, over its radius, for a press: it goes deeper than what is sheared, and larger
elements turn inside out there. A shear gains nothing by it."""
SHARE, NEAR, MOST_PRESSES = 0.05, 0.05, 3
"""Looking for the end of a contact: the edge length there over its radius, the relative change of the radius after
which it is found, and the most presses."""

LEAST_SPOT = 0.01
"""Least radius over D of a gripped spot of skin: springs as soft as those of a grip let a smaller one slip by more
than a percent."""


def choose_model(loads: Sequence[Load], model: Model) -> symmetry_models.Model:
    """The smallest model that can answer the loads, or BadInput if the one asked for cannot.

    >>> choose_model([Load(depth=1.0)], "auto")
    'axisymmetric'
    """
    sideways = any(load.slides or load.imperfection for load in loads)
    tilted = any(load.plate_tilt for load in loads)
    fixed = {0.0} if tilted or any(load.imperfection for load in loads) else set()
    turns = len({load.axis for load in loads if load.slides} | fixed) > 1
    if model not in ("auto", "axisymmetric", "harmonic", "half", "full"):
        raise BadInput(f"model must be auto, axisymmetric, harmonic, half or full; got {model!r}")
    if model == "axisymmetric" and sideways:
        raise BadInput("model axisymmetric cannot carry a shear or an imperfection: choose auto or harmonic")
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
    mesh: skfem.MeshTet2 | None = None,
) -> Iterator[Solution]:
    """Follow a path of loads: for each one first the depth, then the shear.

    Parameters
    ----------
    loads : all of one kind (plate or grip, friction, tilt of the plate); under a glued plate the depth must not
        change once it has sheared. With Coulomb friction the answer depends on the way: the plate may come and go.
    estimate : estimate the errors of force, shift and tilt, by a companion that walks along: on a mesh coarser by
        COARSER and with one harmonic less, or two beside one. `fem.error_estimates` says how they follow from
        the difference.
        Also look whether an axisymmetric press would be stable sideways, and say so in the message if not.
    progress : called with a fraction of the path and a text.
    mesh : tetrahedra in units of D to solve on, as `fem.discretisation.symmetry_models.solid` takes them; then
        nothing is estimated.

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
        _check_spot(design, load)
        check_load(design, load, magnet)
    name = choose_model(loads, model)
    _check_path(loads)
    return _walk(design, loads, accuracy, magnet, name, estimate and mesh is None, progress, mesh)


def _walk(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: symmetry_models.Model,
    estimate: bool,
    progress: Progress | None,
    mesh: skfem.MeshTet2 | None,
) -> Iterator[Solution]:
    done = 0
    for part in parts(loads, design.D, name):
        report = None if progress is None else functools.partial(_of_all, progress, done, len(part), len(loads))
        states = _walk_part(design, part, accuracy, magnet, name, estimate, report, mesh)
        with contextlib.closing(states):
            for state in states:
                yield state
        if state.status not in ("ok", "unstable"):
            return
        done += len(part)


def _walk_part(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: symmetry_models.Model,
    estimate: bool,
    progress: Progress | None,
    mesh: skfem.MeshTet2 | None,
) -> Generator[Solution]:
    states = _follow(design, loads, accuracy, magnet, name, progress, watch=estimate, mesh=mesh)
    if not estimate:
        yield from states
        return
    companions = _follow(design, loads, coarser(accuracy), magnet, name, None)
    with contextlib.closing(states), contextlib.closing(companions):
        for state in states:
            companion = next(companions, None)
            yield state if companion is None else _with_estimates(state, companion, loads, accuracy, magnet, design)


def _of_all(progress: Progress, done: int, count: int, whole: int, share: float, text: str) -> None:
    """Report the share of a part, of `count` loads after `done`, as one of the `whole` path."""
    progress((done + share * count) / whole, text)


def _with_estimates(
    state: Solution, companion: Solution, loads: Sequence[Load], accuracy: Accuracy, magnet: Magnet, design: Design
) -> Solution:
    """The state with the differences to its companion, if that one has reached the same load."""
    seconds = state.seconds + companion.seconds
    one, other = state.load, companion.load
    same = (one.depth, one.imposed_shear) == (other.depth, other.imposed_shear)
    if not same:
        return replace(state, seconds=seconds)
    estimates = estimate_response(
        state.response, companion.response, one, loads, accuracy, state.model, magnet, design
    )
    return replace(state, seconds=seconds, estimates=estimates)


def _check_path(loads: Sequence[Load]) -> None:
    first = loads[0]
    if any(
        (load.grip, load.friction, load.plate_tilt, load.imperfection)
        != (first.grip, first.friction, first.plate_tilt, first.imperfection)
        for load in loads
    ):
        raise BadInput("all loads of a path must have the same grip, friction, plate tilt and imperfection")
    glued: float | None = None
    for load in loads:
        if glued is not None and load.depth != glued:
            raise BadInput(
                f"the plate sticks to the tip since depth {glued:g} mm and cannot move to {load.depth:g} mm: "
                "press to the full depth before the shear"
            )
        if load.glues:
            if load.depth == 0:
                raise BadInput(
                    "a shear with friction stick needs a depth above 0 mm: at depth 0 nothing is in contact"
                )
            glued = load.depth


def _follow(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: symmetry_models.Model,
    progress: Progress | None,
    *,
    watch: bool = False,
    mesh: skfem.MeshTet2 | None = None,
) -> Generator[Solution]:
    begin = time.perf_counter()
    D, grip = design.D, loads[0].grip
    if grip is not None and name in ("half", "full"):
        _check_grip(design, grip, accuracy.solid_patch)
    path = _start(design, loads, accuracy, magnet, name, mesh)
    sheared = next((load for load in loads if load.slides), None)
    direction = np.array([1.0, 0.0] if sheared is None or name == "full" else sheared.direction)
    turn = np.array([direction, [-direction[1], direction[0]]])
    sideways = SidewaysModel(path.raised) if watch and path.raised is not None else None
    try:
        for i, load in enumerate(loads):
            if progress is not None:
                progress(
                    i / len(loads), f"{name}: depth {load.depth:g} mm, shear {math.hypot(*load.imposed_shear):g} mm"
                )
            reason = path.go(load.depth / D, turn @ load.imposed_shear / D)
            end = time.perf_counter()
            state = read(
                path.state,
                design,
                load,
                direction,
                reason,
                iterations=path.iterations,
                seconds=end - begin,
                sideways=sideways,
            )
            begin = end
            yield state
            if state.status not in ("ok", "unstable"):
                return
    finally:
        path.close()


def _start(
    design: Design,
    loads: Sequence[Load],
    accuracy: Accuracy,
    magnet: Magnet,
    name: symmetry_models.Model,
    mesh: skfem.MeshTet2 | None,
) -> Path:
    """The path with its model, at rest."""
    shape = design.shape.scaled(1 / design.D)
    depths = [graded_depth(load.depth / design.D) for load in loads if load.depth > FIRST_TOUCH * design.D]
    silicone = law(design.law, design.law_numbers)
    sideways = any(load.slides for load in loads)
    grip, tilt = loads[0].grip, loads[0].plate_tilt
    held = None if grip is None else grip / design.D
    mu, push = loads[0].coulomb, loads[0].imperfection / (design.E * design.D**2)
    size = accuracy.section_size
    tip = TIP * math.sqrt(shape.R * min(depths, default=1.0))
    build = functools.partial(symmetry_models.section, shape, design.nu, magnet, size, min(tip, 1.0) * size, silicone)
    if not sideways:
        build = functools.partial(build, fillet=PRESS_FILLET)
    edge = None
    if sideways and held is not None:
        edge = math.sqrt(held * (2 * shape.R - held)) if held < shape.R else shape.R
    elif sideways and not tilt and mu is None and mesh is None:
        glued = next(load.depth for load in loads if load.slides) / design.D
        rough = max(size, QUICK.section_size)
        first = functools.partial(
            symmetry_models.section, shape, design.nu, magnet, rough, min(tip, 1.0) * rough, silicone
        )
        edge = contact_end(first, accuracy.section_patch, glued)
    if name in ("half", "full"):
        coarse = accuracy.solid_size
        half = name == "half"
        solid = functools.partial(
            symmetry_models.solid, shape, design.nu, magnet, coarse, law=silicone, half=half, push=push
        )
        solid = functools.partial(solid, given=mesh)
        if edge is None or edge == shape.R or mesh is not None:
            fine = accuracy.solid_patch if sideways or tilt else coarse / 2
            return Path(solid(fine), held, tilt, mu=mu, friction_factor=accuracy.rub)
        return Path(
            solid(coarse / 2, rim=(edge, min(accuracy.solid_patch, edge / 3))), held, rim=None if push else edge
        )
    if name == "axisymmetric":
        return Path(build(), raised=functools.partial(build, harmonics=1), mu=mu, friction_factor=accuracy.rub)
    if mu is not None and sideways:
        raised = functools.partial(build, harmonics=accuracy.harmonics)
        return Path(build(), raised=raised, mu=mu, friction_factor=accuracy.rub)
    if edge is not None:
        build = functools.partial(build, rim=(edge, min(accuracy.section_patch, edge / 4)))
    build_high = functools.partial(build, harmonics=accuracy.harmonics, push=push)
    alone = accuracy.harmonics < 2 or mu is not None
    predictor = None if alone else functools.partial(build, harmonics=1, push=push, around=accuracy.harmonics)
    if push or held is not None or edge is None:
        return Path(build_high(), held, mu=mu, friction_factor=accuracy.rub, predictor=predictor)
    return Path(build(), raised=build_high, rim=edge, predictor=predictor)


def contact_end(build: Callable[..., symmetry_models.Discretisation], fine: float, depth: float) -> float:
    """As `contact_edge`, by meshes that are fine where the contact ended before; at first where the dome is cut.

    Parameters
    ----------
    build : makes the section from the keyword `rim` of `fem.discretisation.symmetry_models.section`; it need not be
        fine elsewhere.
    fine : edge length there, at most SHARE of the radius.
    """
    edge = min(math.sqrt(depth / 2), 0.475)
    for _ in range(MOST_PRESSES):
        found = contact_edge(build(rim=(edge, min(fine, SHARE * edge))), depth)
        if not found:  # not even first touch was reached: the press on the final mesh says why
            break
        change, edge = found / edge - 1, found
        if abs(change) < NEAR:
            break
    return edge


def contact_edge(d: symmetry_models.Discretisation, depth: float) -> float:
    """Undeformed radius at which the contact of a press ends, in units of D."""
    path = Path(d)
    try:
        path.go(depth, np.zeros(2))
        return end_of_contact(path.state)
    finally:
        path.close()


def end_of_contact(state: PathState) -> float:
    """Undeformed radius at which the contact of a press ends, in units of D."""
    radius = plate_contact.contact_radius(state.skin, state.u, state.plate)
    return plate_contact.material_radius(state.skin, state.u, state.plate, radius)


def _check_spot(design: Design, load: Load) -> None:
    """Refuse a grip of so small a spot of skin that it would not be held firmly."""
    least = LEAST_SPOT**2 * design.D
    if load.grip is not None and load.grip < least:
        raise BadInput(f"grip must be at least D/{LEAST_SPOT**-2:.0f} = {least:.3g} mm; got {load.grip:g} mm")


def _check_grip(design: Design, grip: float, patch_size: float) -> None:
    """Refuse a grip whose cap of skin is narrower than two elements."""
    least = 2 * (2 * patch_size) ** 2 * design.D**2 / design.R / 4
    if grip < least:
        raise BadInput(
            f"grip must be at least {least:.3g} mm for the mesh of this accuracy to resolve it; got {grip:g} mm"
        )
