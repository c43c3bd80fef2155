"""A random search against which the search of `magtip size` is held, over the same parts and by the same surrogate.

Each set of requirements is searched as it stands, with the other shape of the base, and with a bandwidth that is
`FASTER` times as high. Random candidates have parts and lengths evenly over the whole space.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from pathlib import Path

import numpy as np

from geometry.arrays import Array
from geometry.messages import Progress
from studies.mechanics.tasks import finished
from studies.output.result import Result
from studies.parts.catalogues import catalogues_of
from studies.parts.requirements import Requirements, read_requirements
from studies.sizing.front_solves import scores
from studies.sizing.variant_search import RESOLUTION, Effort, Rating, searched, spaces, whole_front
from studies.validation import pages
from studies.validation.pages import Row

FILES = ("SEARCH.md", "search.csv")
FOLDER = Path(__file__).parents[2] / "examples" / "sizing"
SETS = ("fingertip", "gripper_pad", "finger", "foot", "square_tip", "fast_tip", "thin_pad", "heel")
"""Files of requirements."""
FASTER = 5.0
"""Bandwidth that is tried, over the required one."""
ALLOWED = 2.0
"""How far a random candidate may be beyond the front, %."""
BATCH = 8192
"""Candidates that are drawn at a time."""


def run(progress: Progress, *, quick: bool = False, draws: int = 100_000, workers: int = 2, sets: str = "") -> Result:
    """Hold the search of `magtip size` against random candidates; exit status 3 if one is better, or meets all alone.

    Parameters
    ----------
    quick
        Hold the first set against 5000 candidates, as it stands: a minute or two instead of an hour.
    draws
        Random candidates of each kind of Hall parts.
    workers
        Number of processes.
    sets
        Files of studies/examples/sizing, separated by commas; default: eight.
    """
    names = sets.split(",") if sets else SETS
    tasks = [(name, *each) for name in names for each in variations(read_requirements(str(FOLDER / f"{name}.toml")))]
    if quick:
        tasks, draws, workers = tasks[:1], 5000, 1
    found = {
        each.task[:2]: each.answer
        for each in finished(tasks, partial(held, draws=draws), workers=workers, progress=progress, words="searches")
    }
    rows = [
        {"set": name, "changed": changed, **(found[name, changed] or {"passed": False})} for name, changed, _ in tasks
    ]
    # where no variant is found, what random candidates find has no distance from it
    misses = {
        f"{row['set']} {row['changed']}".strip(): max(
            row.get("beyond_best_percent", math.nan), row.get("beyond_end_percent", math.nan)
        )
        for row in rows
        if row["passed"] is False
    }
    look = {"first": ("set", "changed", "variant", "drawn_that_meet", "passed")}
    page, run = {"rows": rows, "draws": draws}, "quick" if quick else "full"
    return pages.study("search", "Search", rows, page, look=look, misses=misses, run=run)


def variations(needed: Requirements) -> list[tuple[str, Requirements]]:
    """Return requirements as they are, with the other shape of the base, and with a higher bandwidth."""
    round_base = needed.outer_shape == "round"
    other = dataclasses.replace(needed, outer_shape="square" if round_base else "round")
    found = [("", needed), (f"{other.outer_shape} base", other)]
    if needed.bandwidth is not None:
        fast = FASTER * needed.bandwidth
        found.append((f"{fast:g} Hz", dataclasses.replace(needed, bandwidth=fast)))
    return found


def held(task: tuple[str, str, Requirements], draws: int, effort: Effort = Effort()) -> Row:
    """Return whether the search for these requirements holds against random candidates.

    `passed` is None where neither finds anything to compare with: no random candidate meets all requirements.
    """
    needed = task[2]
    pools = searched(needed, catalogues_of(needed), effort)
    F = random_objectives(needed, draws)
    variant = any((pool.violation == 0).any() for pool in pools)
    row: Row = {"candidates": sum(pool.rated for pool in pools), "variant": variant, "drawn_that_meet": len(F)}
    if not variant:
        return row | {"passed": not len(F)}
    if not len(F):
        return row | {"passed": None}
    beyond, longer = (100 * gain for gain in gains(whole_front(pools)[1], F, needed))
    row |= {"beyond_best_percent": beyond, "beyond_end_percent": longer}
    return row | {"passed": max(beyond, longer) < ALLOWED}


def random_objectives(needed: Requirements, count: int, seed: int = 5) -> Array:
    """Return the objectives, shape (n, 3), of those of `count` random candidates of each kind that meet all."""
    random, rating, rows = np.random.default_rng(seed), Rating(needed), [np.zeros((0, 3))]
    for space in spaces(needed, catalogues_of(needed)):
        first, end = np.array(space.choices).T
        for start in range(0, count, BATCH):
            n = min(BATCH, count - start)
            choices = random.integers(first, end, size=(n, 3))
            F, violation = rating(space.candidates(choices, random.random((n, 5))), 0.0)
            rows.append(F[violation == 0])
    return np.concatenate(rows)


def gains(front: Array, F: Array, needed: Requirements) -> tuple[float, float]:
    """Return how far points F, shape (n, 3), are beyond the best one of a front without a loss in another objective,
    and beyond its ends, as differences of logarithms; negative where a front is longer."""
    best = front[scores(front, RESOLUTION, needed)[0].argmax()]
    no_worse = (best + RESOLUTION >= F).all(axis=1)
    return float((best - F[no_worse]).max(initial=0.0)), float((front.min(axis=0) - F.min(axis=0)).max())
