"""The mechanics of a decoder and where they come from: the best source that covers a design, or one by its name.

From the best one down: `surrogate`, the Gaussian process of finite-element states, with intervals; `fem`, presses and
glued shears that are solved at accuracy standard, or taken from the store; and the levels of the formulas. By default
a design has the first of these that knows it:

1. the surrogate, if beam, magnet, law and Poisson's ratio lie within its range;
2. finite elements: some 40 states, 5 to 15 s on two cores the first time, then those of the store;
3. level finite of the formulas, within its range and for the law neo-Hookean, which is all that formulas know;
4. level paper, whose press force is a third of the true one: with a warning.

All give polynomials of the magnet's shift (`analytic.inverse.response_surface.Mechanics`).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import beam
from analytic.inverse.response_surface import of_formula, of_samples
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load, Response
from studies.beam import surrogate_range, surrogate_response
from studies.sensing.decode_readings import RESPONSES, Source, of_file, of_level

if TYPE_CHECKING:
    import pandas as pd

SURROGATE, FEM, FINITE, PAPER = "surrogate", "fem", "finite", "paper"
NAMES = (SURROGATE, FEM, *reversed(beam.LEVELS))
"""Sources by their names, the best one first."""
DEPTHS, SHEARS = np.linspace(0.06, 1.0, 8), (0.0, 1 / 4, 1 / 2, 3 / 4, 1.0)
"""Depths of the solved states over the largest one, and their shears over the largest one, which grows with the
depth: a plate that presses lightly slips before it shears far."""
WITHIN, ASKED = "the design lies within its range", "it is asked for"
"""Reasons."""
LARGEST_FRICTION = 1.0
"""Force along the plate over the press force of the states from which mechanics are fitted, at most: dry silicone
slips before (requirements take 0.8)."""
ENOUGH = 3
"""Least number of depths with solved presses and shears: of fewer, polynomials would be guesses."""


def source_of(design: Design, level: str | None, responses: Path | None) -> Source:
    """Return the mechanics of a design by a source: states in a file, one of `NAMES`, or by default the best one.

    Raises
    ------
    BadInput
        The name is unknown, or the source does not know the design.
    """
    if not design.shape.has_magnet:
        raise BadInput(
            "this design has no magnet (magnet_diameter is 0), so there is nothing to read: give it a magnet"
        )
    if responses is not None and level is not None:
        raise BadInput("--level and --responses exclude each other: give only one")
    if responses is not None:
        return Source(RESPONSES, of_file(responses, design), f"the states of {responses.name} are given")
    if level is None:
        return best(design)
    if level in (SURROGATE, FEM):
        return replace((of_surrogate if level == SURROGATE else of_finite_elements)(design), reason=ASKED)
    if level not in beam.LEVELS:
        raise BadInput(f"level must be one of {', '.join(NAMES)}; got {level!r}")
    return Source(level, of_level(design, level), ASKED)


def best(design: Design) -> Source:
    """Return the mechanics of the best source that covers a design, with the reason why it is this one."""
    refusals: list[str] = []
    for name, make in ((SURROGATE, of_surrogate), (FEM, of_finite_elements), (FINITE, _within_finite)):
        try:
            found = make(design)
        except (BadInput, SolveFailed) as error:
            refusals.append(f"{name}: {str(error).removesuffix(surrogate_response.REMEDY)}")
        else:
            return replace(found, reason="; ".join([*refusals, found.reason]), chosen=True)
    said = "; ".join(refusals)
    warning = f"no better mechanics than level {PAPER} ({said}): a press force may be a third of the true one"
    return Source(PAPER, of_level(design, PAPER), said, warning=warning, chosen=True)


def _within_finite(design: Design) -> Source:
    """Return the mechanics of level finite; refuse a design outside its range."""
    if reason := beam.outside(design, Load(), FINITE):
        raise BadInput(reason)
    return Source(FINITE, of_level(design, FINITE), WITHIN)


def of_surrogate(design: Design) -> Source:
    """Return the mechanics of the surrogate over its range of a design, as deep as a press stays stable.

    Raises
    ------
    BadInput
        The surrogate does not know the design.
    """
    if reason := surrogate_response.refusal_of_kind(design, Load(), "rigid"):
        raise BadInput(f"{reason}{surrogate_response.REMEDY}")
    deepest, farthest = _reach(design)

    def half_width(load: Load) -> float:
        try:
            share = surrogate_response.respond(design, load).errors["force"]
        except BadInput:
            return math.nan
        return math.nan if share is None else share

    law = of_formula(lambda load: held(surrogate_response.respond(design, load).response), deepest, farthest)
    return Source(SURROGATE, law, WITHIN, half_width)


def _reach(design: Design) -> tuple[float, float]:
    """Return the largest depth and shear, mm, of the surrogate for a design."""
    beams = surrogate_response.beams_of([design])
    deepest = 0.999 * design.D * float(np.minimum(beams.deepest[0], beams.stable_to()[0]))
    if not deepest > 0:
        raise BadInput(f"{beams.outside[0] or 'the surrogate knows no stable press of this beam'}")
    return deepest, 0.999 * design.D * float(beams.farthest[0])


def held(response: Response) -> Response:
    """Return a response, but refuse one that a plate holds by no friction.

    There the press force falls along lines between states, which polynomials of a force that rises do not follow:
    they would miss all others, too, by as much as a third of the force.
    """
    x, y, z = response.force
    if not math.hypot(x, y) <= LARGEST_FRICTION * z:
        raise BadInput("the plate would slip")
    return response


def in_words(source: Source) -> str:
    """Return what the mechanics of a source are, for reports."""
    names = {SURROGATE: "surrogate of the finite elements", FEM: "finite elements", RESPONSES: "solved states"}
    return names.get(source.name, f"formulas of level {source.name}")


def of_finite_elements(design: Design, solves: Mapping[str, Any] = {}) -> Source:
    """Return the mechanics of presses and glued shears by finite elements at accuracy standard, kept in the store.

    Depths whose press is not known to be stable are left out.

    solves : store, workers and progress of `cases.answer`; without a progress a bar of its own.

    Raises
    ------
    BadInput, SolveFailed
        The design has no magnet, or too few states were found.
    """
    # deferred: formulas and surrogate need no tables
    import pandas as pd

    from studies import cases

    loads = _loads(design)
    asked = pd.DataFrame({"depth_mm": [load.depth for load in loads], "shear_mm": [load.shear_x for load in loads]})
    asked["friction"] = "stick"
    solves = {"progress": True} | dict(solves)
    found = cases.answer(asked, [FEM], base=design, quantities=["force", "shift", "tilt"], **solves)
    stable = {
        load.depth for load, status in zip(loads, found["status"], strict=True) if status == "ok" and not load.shear
    }
    samples = _samples(loads, found, stable)
    sheared = {load.depth for load, _ in samples if load.shear}
    if len(sheared) < ENOUGH:
        lost = next((text for text in found["message"] if text), "")
        raise SolveFailed(f"of {len(stable)} stable presses {len(sheared)} have shears, fewer than {ENOUGH}: {lost}")
    new = int((found["seconds"] > 0).sum())
    return Source(
        FEM, of_samples(samples), f"{len(samples)} of {len(loads)} states by finite elements ({new} solved now)"
    )


def _loads(design: Design) -> list[Load]:
    L, d, h = (np.array([getattr(design, name) / design.D]) for name in ("L", "magnet_diameter", "magnet_height"))
    deepest = design.D * float(surrogate_range.deepest(L, d, h)[0])
    farthest = design.D * float(surrogate_range.farthest(L)[0])
    return [
        Load(depth=deepest * depth, shear_x=farthest * share * math.sqrt(depth), friction="stick")
        for depth in DEPTHS.tolist()
        for share in SHEARS
    ]


def _samples(loads: Sequence[Load], found: pd.DataFrame, stable: set[float]) -> list[tuple[Load, Response]]:
    names = ["fem_force_x_N", "fem_force_N", "fem_shift_x_mm", "fem_shift_z_mm", "fem_tilt_rad"]
    rows = zip(loads, found["status"], found[names].to_numpy().tolist(), strict=True)
    samples = []
    for load, status, (x, z, u, w, tilt) in rows:
        if status == "ok" and load.depth in stable:
            with contextlib.suppress(BadInput):
                samples.append((load, held(Response((x, 0.0, z), (u, 0.0, w), tilt, 0.0))))
    return samples
