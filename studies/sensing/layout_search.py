"""Search for better layouts: f, l0 and c of three elements, or l0 and chip_x of a 3-axis chip."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from analytic import survey
from analytic.inverse.response_surface import Mechanics
from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.inputs import user_input
from studies.inputs.option_groups import Basis
from studies.output.records import FlatRow
from studies.sensing import layout_metrics

MOST_FOUND, USUAL = 16, 10
"""Largest and default number of layouts that a search returns."""
Place = tuple[float, ...]
Score = tuple[float, float]
POSES = (9, 9, 6)
"""Numbers of poses along x, y and z by which the search rates a layout; the final rows use the full map."""
GRID = {1: 21, 2: 21, 3: 10}
"""Values of each parameter in the first grid, by number of parameters: at most 1000 layouts in all."""
STARTS, HALVINGS, FINALISTS = 12, 4, MOST_FOUND
APART_STARTS, APART_FOUND = 1.5, 0.75
"""Least difference between two starts, and between two layouts of the table, in steps of the first grid."""
FIGURES = (
    *("unique_percent", "ambiguous_percent", "saturated_percent", "blocked_percent"),
    *("condition_worst", "noise_worst_um", "noise_median_um", "noise_worst_N"),
)
"""Figures of `layout_metrics.figures` that the table has."""
HOPELESS: Score = (2.0, math.inf)
"""Score of a layout that cannot be evaluated; every other layout has a better one."""


def parse_ranges(design: Design, texts: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Return the ranges of the search, mm; NAME=LOW,HIGH changes a range, and NAME=VALUE fixes a parameter.

    >>> parse_ranges(Design(), ["f=5", "c=0,2"])
    {'f': (5.0, 5.0), 'l0': (5.5, 13.0), 'c': (0.0, 2.0)}
    """
    D, H = design.D, design.H
    bounds = {"f": (D / 2, 2 * D), "l0": (H + D / 16, H + D), "c": (-D / 4, H + D)}
    if design.hall_layout != "three":
        bounds = {"l0": bounds["l0"], "chip_x": (0.0, D)}
    for name, values in user_input.pairs("--range", texts, "f=5,8").items():
        if name not in bounds:
            raise BadInput(
                f"--range takes NAME=LOW,HIGH in mm with NAME one of {', '.join(bounds)}"
                f" (the layout is {design.hall_layout}); got {name}={values}"
            )
        numbers = user_input.parse_numbers(f"--range {name}", values)
        if len(numbers) > 2 or not numbers[0] <= numbers[-1]:
            raise BadInput(f"--range {name} takes LOW,HIGH in ascending order, or one value; got {values!r}")
        for value in numbers:
            changed: dict[str, Any] = {name: value}
            dataclasses.replace(design, **changed)
        bounds[name] = (numbers[0], numbers[-1])
    return bounds


def run(
    design: Design,
    law: Mechanics,
    basis: Basis,
    bounds: Mapping[str, tuple[float, float]],
    count: int,
    progress: Progress,
) -> list[FlatRow]:
    """Return the design's own layout (rank 0) and up to `count` distinct layouts, the best first."""
    names = list(bounds)

    def design_at(place: Place) -> Design:
        changes: dict[str, Any] = dict(zip(names, place, strict=True))
        return dataclasses.replace(design, **changes)

    def score(place: Place) -> Score:
        try:
            return _score(design_at(place), law, basis)
        except BadInput:
            return HOPELESS

    given = tuple(getattr(design, name) for name in names)
    scores = _search(score, given, list(bounds.values()), progress)
    best = sorted((place for place in scores if place != given), key=lambda place: scores[place])
    widths = [high - low for low, high in bounds.values()]
    steps = [width / (GRID[len(names)] - 1) for width in widths]
    finalists = _distinct(
        [p for p in best if scores[p] < HOPELESS], [APART_FOUND * step for step in steps], FINALISTS
    )
    if min(scores.values(), default=HOPELESS) >= HOPELESS:
        raise BadInput(
            "no layout in these ranges has a usable pose: every pose is blocked or saturated; keep elements out of "
            "the beam (larger l0 or f, smaller c), or lower --clearance"
        )
    rows = []
    for k, place in enumerate(finalists):
        progress(0.6 + 0.4 * k / len(finalists), "survey of the best")
        rows.append(_row(design_at(place), names, law, basis))
    by = "noise_worst_N" if basis.reject_ambient else "noise_worst_um"
    rows.sort(key=lambda row: (round(1 - row["unique_percent"] / 100, 3), row[by] or math.inf))
    progress(1.0, "survey of the best")
    ranked = [row | {"rank": rank} for rank, row in enumerate(rows[:count], 1)]
    return [_row(design, names, law, basis), *ranked]


def _search(
    score: Callable[[Place], Score],
    given: Place,
    bounds: Sequence[tuple[float, float]],
    progress: Progress,
) -> dict[Place, Score]:
    many = GRID[len(bounds)]
    axes = [
        [low] if high == low else [_rounded(low + (high - low) * k / (many - 1)) for k in range(many)]
        for low, high in bounds
    ]
    places = list(itertools.product(*axes))
    scores: dict[Place, Score] = {}
    for k, place in enumerate(places):
        if k % 50 == 0:
            progress(0.4 * k / len(places), "grid of layouts")
        scores[place] = score(place)
    steps = [(high - low) / (many - 1) for low, high in bounds]
    best = [p for p in sorted(scores, key=lambda p: scores[p]) if scores[p] < HOPELESS]
    starts = _distinct(best, [APART_STARTS * step for step in steps], STARTS)
    if all(low <= value <= high for value, (low, high) in zip(given, bounds, strict=True)):
        scores[given] = score(given)
        starts.append(given)
    for k, start in enumerate(starts):
        progress(0.4 + 0.2 * k / len(starts), "compass searches")
        _compass(score, start, steps, bounds, scores)
    return scores


def _compass(
    score: Callable[[Place], Score],
    place: Place,
    steps: Sequence[float],
    bounds: Sequence[tuple[float, float]],
    scores: dict[Place, Score],
) -> None:
    """Move to a better neighbour while there is one, then halve the steps (compass search)."""
    for halving in range(1, HALVINGS + 1):
        while True:
            near = []
            for k, (step, (low, high)) in enumerate(zip(steps, bounds, strict=True)):
                for way in (-step, step):
                    value = _rounded(min(max(place[k] + way / 2**halving, low), high))
                    near.append((*place[:k], value, *place[k + 1 :]))
            for neighbour in near:
                if neighbour not in scores:
                    scores[neighbour] = score(neighbour)
            best = min(near, key=lambda p: scores[p])
            if not scores[best] < scores[place]:
                break
            place = best


def _rounded(value: float) -> float:
    """Round to three digits, so that the printed values are the evaluated ones."""
    return float(f"{value:.3g}")


def _distinct(places: Sequence[Place], apart: Sequence[float], most: int) -> list[Place]:
    distinct: list[Place] = []
    for place in places:
        if len(distinct) == most:
            break
        if all(any(abs(a - b) > d for a, b, d in zip(place, earlier, apart, strict=True)) for earlier in distinct):
            distinct.append(place)
    return distinct


def _score(design: Design, law: Mechanics, basis: Basis) -> Score:
    coder, _ = layout_metrics.prepare(design, law, basis, cells=(1, 1, 1))
    poses = survey.survey(coder, POSES, multiplicity=False, clearance=basis.clearance)
    usable = poses.usable
    if not usable.any():
        return HOPELESS
    rarer = min(poses.share(usable & (poses.sign > 0)), poses.share(usable & (poses.sign < 0)))
    noise = poses.noise_N if basis.reject_ambient else poses.noise_mm
    worst = math.inf if poses.folded else float(noise[usable].max())
    return round(1 - poses.share(usable) + rarer, 3), worst


def _row(design: Design, names: Sequence[str], law: Mechanics, basis: Basis) -> FlatRow:
    coder, _ = layout_metrics.prepare(design, law, basis)
    poses = survey.survey(coder, layout_metrics.COUNTS, clearance=basis.clearance)
    figures, price = layout_metrics.figures(poses), layout_metrics.price(design, law, basis, poses)
    return {
        "rank": 0,
        **{f"{name}_mm": getattr(design, name) for name in names},
        **{name: figures[name] for name in FIGURES},
        **({"noise_factor": price} if basis.reject_ambient else {}),
        "settings": " ".join(f"--set {name}={getattr(design, name):g}" for name in names),
    }
