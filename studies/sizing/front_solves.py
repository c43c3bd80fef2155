"""The points of a front, solved by finite elements: what they say, beside the surrogate, and which points fail.

A point that misses a requirement by the numbers of the finite elements stays in the table, with its reason, but is
not ranked. The others are ranked by the weighted mean of three scores, 0 to 1 over the points that pass: range and
resolution on logarithmic scales, and outer size.

The responses of the beams (`FemBeams`) have the form of the surrogate's. The paths of all beams are solved side by
side by worker processes; their states land in the store, so that a command that was interrupted solves none of them
again. NaN stands for a state that a solve did not reach.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fem.scene import Scene
from geometry.arrays import Array, Ints
from geometry.design import Design
from geometry.loads import Load
from studies.mechanics.path_solver import Answer
from studies.mechanics.solve_plan import Solver
from studies.output.records import FlatRow
from studies.sizing.candidate_performance import CHECKED, LEAST, Performance, performance
from studies.sizing.variant_search import beams_of, objectives

if TYPE_CHECKING:
    from studies.sizing.candidate_variables import Variant
    from studies.sizing.requirements import Requirements

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


MOST_POINTS = 16
"""Points of a front that are solved: their finite elements take two to three minutes on two cores."""
BLOCK = 32
"""Variants that are checked at a time: distances between all their poses are held in memory."""
COMPARED = {
    "range_z": ("range_z_N", 1.0),
    "range_x": ("range_x_N", 1.0),
    "depth": ("depth_over_D", 1.0),
    "resolution_z": ("resolution_z_mN", 1e3),
    "resolution_x": ("resolution_x_mN", 1e3),
    "strain": ("strain_percent", 100.0),
    "critical": ("critical_depth_over_D", 1.0),
    "first_mode": ("first_mode_Hz", 1.0),
    "saturation": ("rail_distance_percent", 100.0),
}
"""Quantities that both sources give: column in tables, and its unit in that of `Performance`."""
ALIKE = {"outer_size": "outer_size_mm", "height": "height_mm", "wall": "wall_mm"}
"""Lengths, which do not depend on the source."""


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """A point of the front.

    Attributes
    ----------
    number : from 1, in the order of the range.
    predicted, solved : values by name of the surrogate, with their half widths, and of finite elements, see
        `Performance`.
    predicted_margins, margins : margins of the requirements by both, of the surrogate with its half widths.
    status : "ok", or "failed" if finite elements show that a requirement is missed.
    reason : which requirements are missed, and by how much.
    rank : 1 for the best; 0 for a point that failed.
    score : 0 to 1; NaN for a point that failed.
    """

    number: int
    variant: Variant
    predicted: dict[str, float]
    solved: dict[str, float]
    predicted_margins: dict[str, float]
    margins: dict[str, float]
    status: str
    reason: str
    rank: int = 0
    score: float = np.nan

    def row(self) -> FlatRow:
        """Return the row of front.csv: each quantity by the surrogate and by FEM, and their difference."""
        row: FlatRow = {"rank": self.rank or None, "point": self.number, "status": self.status}
        row |= self.variant.row() | {column: self.solved[name] for name, column in ALIKE.items()}
        for name, (column, unit) in COMPARED.items():
            predicted, solved = unit * self.predicted[name], unit * self.solved[name]
            row |= {f"surrogate_{column}": predicted, f"fem_{column}": solved, **self._difference(name, column)}
            width = self.predicted.get(f"{name}_half_width")
            if width is not None:
                stem, end = _stem(column)
                row[f"surrogate_{stem}_half_width_{end}"] = unit * width
        row |= {f"margin_{name}_percent": 100 * value for name, value in self.margins.items()}
        return row | {"score": self.score, "reason": self.reason}

    def _difference(self, name: str, column: str) -> FlatRow:
        solved = self.solved[name]
        known = np.isfinite(solved) and np.isfinite(self.predicted[name]) and solved != 0
        return {
            f"{_stem(column)[0]}_difference_percent": 100 * (self.predicted[name] / solved - 1) if known else None
        }


def _stem(column: str) -> tuple[str, str]:
    """Return the name in a column, and its unit.

    >>> _stem("range_z_N"), _stem("critical_depth_over_D")
    (('range_z', 'N'), ('critical_depth', 'over_D'))
    """
    for unit in ("over_D", column.rpartition("_")[2]):
        if column.endswith(f"_{unit}"):
            return column.removesuffix(f"_{unit}"), unit
    return column, ""


def spread(F: Array, count: int) -> Ints:
    """Return the indices of `count` points of a front, shape (n, k), that lie far apart, in rising order.

    The ends of each objective come first; then, one by one, the point that is farthest from all chosen ones, in
    widths of the front.
    """
    if len(F) <= count:
        return np.arange(len(F))
    width = np.ptp(F, axis=0)
    place = F / np.where(width > 0, width, 1.0)
    chosen = list(dict.fromkeys(place.argmin(axis=0).tolist()))[:count]
    apart = np.linalg.norm(place[:, None] - place[chosen], axis=2).min(axis=1)
    while len(chosen) < count:
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.linalg.norm(place - place[chosen[-1]], axis=1))
    return np.sort(np.array(chosen))


def solved_front(
    variants: Sequence[Variant], requirements: Requirements, solver: Solver, *, most: int = MOST_POINTS
) -> list[FrontPoint]:
    """Solve a front by finite elements, and return its points, those that pass first, in the order of their ranks.

    Parameters
    ----------
    most : number of points that are solved; of a longer front, `spread` chooses them.
    """
    if not variants:
        return []
    variants, F = checked(variants, requirements)
    variants = [variants[k] for k in spread(F, most)]
    beams = beams_of(variants)
    predicted, cautious = (
        performance(variants, beams, requirements, caution=caution, grid=CHECKED) for caution in (0.0, 1.0)
    )
    fem = FemBeams([each.design for each in variants], solver)
    solved = performance(variants, fem, requirements, caution=0.0, estimate=cautious, grid=CHECKED)
    points = [_point(k, variants[k], predicted, cautious, solved) for k in range(len(variants))]
    return ranked(points, solved, requirements)


def checked(variants: Sequence[Variant], requirements: Requirements) -> tuple[list[Variant], Array]:
    """Return the variants that the surrogate still confirms at all poses of `CHECKED`, and their objectives.

    If it confirms none, all are returned: finite elements then say why.
    """
    tables, passed = [], []
    for start in range(0, len(variants), BLOCK):
        part = variants[start : start + BLOCK]
        result = performance(part, beams_of(part), requirements, grid=CHECKED)
        tables.append(objectives(result))
        passed.append(np.all([margin >= 0 for margin in result.margins.values()], axis=0))
    kept = np.flatnonzero(np.concatenate(passed))
    kept = kept if len(kept) else np.arange(len(variants))
    return [variants[k] for k in kept.tolist()], np.concatenate(tables)[kept]


def _point(
    k: int, variant: Variant, predicted: Performance, cautious: Performance, solved: Performance
) -> FrontPoint:
    """Return a point without a rank."""
    margins = {name: float(value[k]) for name, value in solved.margins.items()}
    missed = {name: value for name, value in margins.items() if not value >= 0}
    values, said, worse = solved.one(k), predicted.one(k), cautious.one(k)
    widths = {f"{name}_half_width": abs(worse[name] - said[name]) for name in COMPARED}
    # how far a press is stable is in the margin, also where the search for the critical depth has stopped
    unsolved = [
        name for name in COMPARED if np.isnan(values[name]) and name != "critical" and not np.isnan(said[name])
    ]
    reasons = [
        f"{name} is not known" if value == LEAST else f"{name} is missed by {-100 * value:.2g} %"
        for name, value in missed.items()
    ]
    if unsolved:
        reasons.insert(0, f"finite elements did not reach {', '.join(unsolved)}")
    return FrontPoint(
        number=k + 1,
        variant=variant,
        predicted=said | widths,
        solved=values,
        predicted_margins={name: float(value[k]) for name, value in cautious.margins.items()},
        margins=margins,
        status="failed" if reasons else "ok",
        reason="; ".join(reasons),
    )


def ranked(points: Sequence[FrontPoint], solved: Performance, requirements: Requirements) -> list[FrontPoint]:
    """Return points with their ranks and scores, the best first, and then those that failed."""
    passed = [k for k, point in enumerate(points) if point.status == "ok"]
    failed = [point for point in points if point.status != "ok"]
    if not passed:
        return failed
    F = objectives(solved)[passed]
    width = np.ptp(F, axis=0)
    share = np.where(width > 0, (F.max(axis=0) - F) / np.where(width > 0, width, 1.0), 1.0)
    weights = np.array([requirements.weight_range, requirements.weight_resolution, requirements.weight_size])
    scores = share @ weights / weights.sum()
    order = np.argsort(-scores, kind="stable")
    best = [
        dataclasses.replace(points[passed[k]], rank=rank, score=float(scores[k])) for rank, k in enumerate(order, 1)
    ]
    return [*best, *failed]


def largest_differences(points: Sequence[FrontPoint]) -> dict[str, dict[str, Any]]:
    """Return for each quantity the median and the largest difference between surrogate and FEM, in percent of FEM.

    `of_one_source` counts the points to which only one of the two gives a number: where only finite elements find a
    critical depth, for instance, the surrogate says that the beam never gives way.
    """
    table: dict[str, dict[str, Any]] = {}
    for name, (column, _) in COMPARED.items():
        pairs = np.array([(point.predicted[name], point.solved[name]) for point in points])
        pairs = pairs.reshape(-1, 2)
        known = np.isfinite(pairs)
        alone = int((known[:, 0] != known[:, 1]).sum())
        pairs = pairs[known.all(axis=1) & (pairs[:, 1] != 0)]
        errors = 100 * np.abs(pairs[:, 0] / pairs[:, 1] - 1)
        table[name] = {
            "quantity": column,
            "points": len(errors),
            "of_one_source": alone,
            "median_percent": float(np.median(errors)) if len(errors) else None,
            "largest_percent": float(errors.max()) if len(errors) else None,
        }
    return table
