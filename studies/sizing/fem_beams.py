"""Responses of beams by finite elements, from the store or solved, in the form of the surrogate's.

The paths of all beams are solved side by side by worker processes; their states land in the store, so that a command
that was interrupted solves none of them again. NaN stands for a state that a solve did not reach.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fem.scene import Scene
from geometry.arrays import Array
from geometry.design import Design
from geometry.loads import Load
from studies.exploration.needed_paths import Solver
from studies.exploration.solved_paths import Answer

RATIO_DIGITS = 6
"""Digits of the ratio of densities: equal ratios share a stored solve."""


@dataclass(frozen=True, slots=True)
class Solved:
    """Values of solved states, and half widths of 0: what finite elements say is taken as right."""

    value: Array

    @property
    def half_width(self) -> Array:
        return np.zeros_like(self.value)


class FemBeams:
    """Beams of n designs, whose responses finite elements give; lengths over D, forces over E D^2."""

    def __init__(self, designs: Sequence[Design], solver: Solver) -> None:
        self.designs, self.solver = designs, solver

    def press(self, depth: Array) -> dict[str, Solved]:
        """Return the response to frictionless presses to depths (n, k), see `prediction.Beams.press`."""
        scenes = [
            Scene(design, tuple(Load(depth=float(d) * design.D) for d in row), self.solver.accuracy)
            for design, row in zip(self.designs, depth, strict=True)
        ]
        answers = self.solver.answers(scenes)
        ratio = _table(answers, lambda a, r: a.values["sideways_stiffness_ratio"])
        return {
            "force": _table(answers, lambda a, r: r.force[2] / (a.E * a.D**2)),
            "shift": _table(answers, lambda a, r: -r.shift[2] / a.D),
            "contact_radius": _table(answers, lambda a, r: r.contact_radius / a.D),
            "strain": _table(answers, lambda a, r: a.values["largest_strain"]),
            "sideways_ratio": ratio,
        }

    def shear(self, depth: Array, shear: Array) -> dict[str, Solved]:
        """Return the response to glued shears at depths and shears (n, k), see `prediction.Beams.shear`.

        All shears of a beam at one depth are one path. A load of which depth or shear is NaN, because a press has
        failed, has NaN as its response.
        """
        scenes: list[Scene] = []
        places: list[tuple[int, list[int]]] = []
        for k, design in enumerate(self.designs):
            known = ~np.isnan(depth[k] + shear[k])
            for at in np.unique(depth[k, known]):
                same = np.flatnonzero(known & (depth[k] == at))
                # a path is followed outwards
                columns = same[np.argsort(shear[k, same])].tolist()
                loads = tuple(
                    Load(depth=float(at) * design.D, shear_x=float(s) * design.D, friction="stick")
                    for s in shear[k, columns]
                )
                scenes.append(Scene(design, loads, self.solver.accuracy, model="harmonic"))
                places.append((k, columns))
        rows: list[list[Answer | None]] = [[None] * depth.shape[1] for _ in self.designs]
        for (k, columns), answers in zip(places, self.solver.answers(scenes), strict=True):
            for column, answer in zip(columns, answers, strict=True):
                rows[k][column] = answer
        return {
            "force_x": _table(rows, lambda a, r: r.force[0] / (a.E * a.D**2)),
            "force_z": _table(rows, lambda a, r: r.force[2] / (a.E * a.D**2)),
            "shift_x": _table(rows, lambda a, r: r.shift[0] / a.D),
            "shift_z": _table(rows, lambda a, r: -r.shift[2] / a.D),
            "tilt": _table(rows, lambda a, r: r.tilt),
            "contact_radius": _table(rows, lambda a, r: r.contact_radius / a.D),
            "strain": _table(rows, lambda a, r: a.values["largest_strain"]),
        }

    @functools.cached_property
    def _stability(self) -> list[Answer]:
        scenes = [Scene(design, (Load(depth=0.01 * design.D),), self.solver.accuracy) for design in self.designs]
        return [answer for (answer,) in self.solver.answers(scenes, "critical depth")]

    def critical_depth(self) -> Solved:
        """Return the depths at which frictionless presses buckle sideways, over D, shape (n,).

        inf where the search found none up to its end; NaN where it stopped before, or failed.
        """
        return Solved(np.array([_critical(answer) for answer in self._stability]))

    def stable_to(self, caution: float) -> Array:
        """Return the depths over D up to which presses are known to be stable, shape (n,); NaN where nothing is."""
        found = [(_critical(answer), answer.values.get("stable_to_over_D", np.nan)) for answer in self._stability]
        return np.array([critical if np.isfinite(critical) else stable for critical, stable in found])

    def first_mode(self, density_ratio: Array) -> Solved:
        """Return the lowest natural frequency of the unloaded beams over `frequency_unit`, shape (n,)."""
        scenes = []
        for design, ratio in zip(self.designs, density_ratio, strict=True):
            heavy = replace(design, magnet_density=round(float(ratio), RATIO_DIGITS) * design.density)
            scenes.append(Scene(heavy, (Load(depth=0.0),), self.solver.accuracy, model="axisymmetric"))
        lowest = [
            (answer.values.get("frequency") or [np.nan])[0] for (answer,) in self.solver.answers(scenes, "modes")
        ]
        return Solved(np.array(lowest, dtype=float))


def _critical(answer: Answer) -> float:
    """Return the critical depth over D of an answer; inf if a whole search found none, NaN if it is not known."""
    depth = answer.values.get("critical_depth_over_D")
    if depth is not None:
        return float(depth)
    # a search that stopped early says so
    return np.inf if answer.status == "ok" and not answer.message else np.nan


def _table(answers: Sequence[Sequence[Answer | None]], read: Callable[[Answer, Any], Any]) -> Solved:
    """Return what `read` reads from answers and their responses, shape (n, k); NaN where there is none."""
    rows = [
        [np.nan if one is None or one.response is None else read(one, one.response) for one in row] for row in answers
    ]
    return Solved(np.array(rows, dtype=float))
