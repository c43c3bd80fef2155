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

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from analytic import beam
from analytic.inverse.response_surface import loads_between
from fem.accuracy import STANDARD
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load
from studies.beam import surrogate_range, surrogate_response
from studies.beam.beam_model import Motions, mechanics, motions
from studies.cases import FiniteElements
from studies.inputs.option_groups import SourceOfLoad
from studies.sensing.decode_readings import RESPONSES, Source, of_file, of_level
from studies.simulation.solved_beams import SolvedBeams

SURROGATE, FEM, FINITE, PAPER = "surrogate", "fem", "finite", "paper"
NAMES = (SURROGATE, FEM, *reversed(beam.LEVELS))
"""Sources by their names, the best one first."""
ACCURACY = STANDARD
"""Of the solved states."""
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


def source_of(design: Design, asked: SourceOfLoad = SourceOfLoad()) -> Source:
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
    level, responses = asked.level, asked.responses
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

    depth, shear = (each[None] for each in loads_between(deepest, farthest))
    moved = _held(motions(surrogate_response.beams_of([design]), [design], depth, shear))
    return Source(SURROGATE, mechanics(moved, depth, shear), WITHIN, half_width)


def _reach(design: Design) -> tuple[float, float]:
    """Return the largest depth and shear, mm, of the surrogate for a design."""
    beams = surrogate_response.beams_of([design])
    deepest = 0.999 * design.D * float(np.minimum(beams.deepest[0], beams.stable_to()[0]))
    if not deepest > 0:
        raise BadInput(f"{beams.outside[0] or 'the surrogate knows no stable press of this beam'}")
    return deepest, 0.999 * design.D * float(beams.farthest[0])


def _held(moved: Motions) -> Motions:
    """Return motions that refuse what a plate holds by no friction.

    There the press force falls along lines between states, which polynomials of a force that rises do not follow:
    they would miss all others, too, by as much as a third of the force.
    """
    slips = np.abs(moved.values["force_x"]) > LARGEST_FRICTION * moved.values["force_z"]
    return replace(moved, refusals=np.where(slips, "the plate would slip", moved.refusals))


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
    depth, shear = (each[None] for each in _loads(design))
    beams = SolvedBeams([design], FiniteElements(ACCURACY, {"progress": True} | dict(solves)))
    moved = motions(beams, [design], depth, shear)
    lost = next((text for text in moved.refusals[0] if text), "")
    stable = depth[(moved.refusals == "") & (shear == 0)]
    doubtful = np.where(np.isin(depth, stable), moved.refusals, "its press is not known to be stable")
    moved = _held(replace(moved, refusals=doubtful))
    known = moved.refusals == ""
    sheared = np.unique(depth[known & (shear > 0)])
    if len(sheared) < ENOUGH:
        raise SolveFailed(f"of {len(stable)} stable presses {len(sheared)} have shears, fewer than {ENOUGH}: {lost}")
    return Source(FEM, mechanics(moved, depth, shear), f"{known.sum()} of {known.size} states by finite elements")


def _loads(design: Design) -> tuple[Array, Array]:
    """Return depths and shears of the solved states, (n,), mm."""
    L, d, h = (np.array([getattr(design, name) / design.D]) for name in ("L", "magnet_diameter", "magnet_height"))
    deepest = design.D * float(surrogate_range.deepest(L, d, h)[0])
    farthest = design.D * float(surrogate_range.farthest(L)[0])
    grid = np.meshgrid(DEPTHS, SHEARS, indexing="ij")
    return deepest * grid[0].ravel(), farthest * (grid[1] * np.sqrt(grid[0])).ravel()
