"""The points of a front, solved by finite elements: what they say, beside the surrogate, and which points fail.

A point that misses a requirement by the numbers of the finite elements stays in the table, with its reason, but is
not ranked. The others are ranked by the weighted mean of three scores, 0 to 1 over the points that pass: range and
resolution on logarithmic scales, and outer size.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Array, Ints
from studies.output.records import FlatRow
from studies.sizing.candidate_performance import CHECKED, performance
from studies.sizing.fem_beams import FemBeams
from studies.sizing.requirement_margins import LEAST, Performance
from studies.sizing.variant_search import beams_of, objectives

if TYPE_CHECKING:
    from studies.exploration.needed_paths import Solver
    from studies.sizing.candidate_variables import Variant
    from studies.sizing.requirements import Requirements

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
