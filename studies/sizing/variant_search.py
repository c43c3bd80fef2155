"""The search for variants: every combination of parts is tried, and the best are varied.

The first candidates spread evenly over the lengths (a Sobol sequence) and over all combinations of magnet, silicone
and Hall part. Each generation varies its pool: candidates that meet all requirements and that no other dominates, and
the nearest of the others, a few of each combination. At the end the neighbours of the front on the grid of the
lengths, and with other parts one by one, are tried until none is better. Objectives are compared with a resolution:
one is better if its logarithm is less by `RESOLUTION` at least. The seed fixes the result.

Laumanns, Thiele, Deb, Zitzler, Evolutionary Computation 10 (2002) 263, for the boxes of a front; Storn and Price,
J. Global Optim. 11 (1997) 341, for the differences between candidates as steps.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.design import BadInput
from geometry.messages import Progress
from studies.beam import surrogate_range
from studies.mechanics.tasks import finished
from studies.parts.catalogues import Catalogues
from studies.parts.requirements import AT_LEAST, Requirements
from studies.sizing.candidate_performance import LEAST, Performance, missed, performance
from studies.sizing.candidate_variables import ROUNDING, Candidates, Space, joined
from studies.sizing.sensor_arrays import sensors_of

if TYPE_CHECKING:
    from studies.mechanics.tasks import Executor

SECONDS = 5e-4
"""Time of a search for each candidate of a generation, s."""

RESOLUTION = 0.005
"""Relative difference of two values of an objective from which on they differ."""
MOST_FRONT = 1000
"""Largest number of candidates of a front: of a longer one, the resolution of the boxes is doubled."""
ALIKE = 3
"""Largest number of candidates of one combination of parts among those that do not meet all requirements."""
BATCH = 2048
"""Candidates that are rated at a time."""
ENDS = 6
"""Candidates at each end of the front from which nearly a third of the children come."""
POLISHED, ROUNDS = 60, 6
"""Candidates of the front whose neighbours are tried at the end, and how often at most."""
IMPOSSIBLE, FAR = 100.0, 0.25
"""Violation of an impossible candidate, and relative miss of a length from which on nothing else is computed."""
FORCES = ("force_z", "force_x")
"""Required forces, in the order of the shares of a candidate."""
LEAST_SHARE = 1e-3
"""Least share of a required force that is tried where this force gives."""
UNMET = 0.6
"""Share of the generations after which a search without a candidate that meets all requirements ends."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to search: candidates of a generation, number of generations, and seed."""

    population: int = 768
    generations: int = 50
    seed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """The pool of a search at its end: candidates, objectives and violations; and how many candidates were rated."""

    candidates: Candidates
    F: Array
    violation: Array
    rated: int

    @property
    def front(self) -> Ints:
        """Indices of the candidates that meet all requirements, and that no other dominates."""
        met = np.flatnonzero(self.violation == 0)
        return met[front_of(self.F[met])] if len(met) else met

    def take(self, rows: Any) -> Found:
        """Return some of the candidates."""
        return Found(self.candidates.take(rows), self.F[rows], self.violation[rows], self.rated)

    def with_rated(self, others: Candidates, rating: Rating, count: int) -> Found:
        """Return the best `count` of these candidates and others, once these are rated."""
        # one with a larger violation does not come into a full pool
        full = len(self.violation) >= count
        F, violation = rating(others, float(self.violation.max()) if full else np.inf)
        F, violation = np.concatenate([self.F, F]), np.concatenate([self.violation, violation])
        return _survivors(Found(joined([self.candidates, others]), F, violation, self.rated), count)


def objectives(values: dict[str, Array], needed: Requirements) -> Array:
    """Return what the search makes small, shape (n, 3), as logarithms: one over the range, resolution and size."""
    resolution = np.maximum(values["resolution_z"], values["resolution_x"])
    with np.errstate(divide="ignore", invalid="ignore"):
        columns = [-np.log(values["range_z"] / needed.force_z), np.log(resolution), np.log(values["outer_size"])]
    return np.asarray(np.nan_to_num(np.column_stack(columns), nan=1e6, posinf=1e6, neginf=-1e6))


def front_of(F: Array, resolution: float = RESOLUTION) -> Ints:
    """Return the indices of one point (n, m) of each box of a resolution that no other box dominates.

    A point that is left out is better than one that stays by less than a resolution in each objective. The points
    with the least value of each objective belong to it.

    >>> front_of(np.array([[0.0, 1.0], [1.0, 0.0], [0.001, 1.001], [1.0, 1.0]])).tolist()
    [0, 1]
    """
    if not len(F):
        return np.zeros(0, dtype=np.int64)
    ends = [int(np.lexsort((F.sum(axis=1), F[:, k]))[0]) for k in range(F.shape[1])]
    while True:
        box = np.floor(F / resolution + 1e-9)
        order = np.argsort(F.sum(axis=1), kind="stable")
        _, first = np.unique(box[order], axis=0, return_index=True)
        kept = order[first]
        kept = kept[~dominated(box[kept])]
        if len(kept) <= MOST_FRONT:
            return np.unique([*kept.tolist(), *ends])
        resolution *= 2


def dominated(F: Array, resolution: Array | float = 0.0) -> NDArray[np.bool_]:
    """Return which points (n, m) another one dominates: nowhere worse, somewhere better by more than a resolution.

    >>> dominated(np.array([[0.0, 1.0], [0.0, 1.004], [0.0, 1.006]]), 0.005).tolist()
    [False, False, True]
    """
    result = np.zeros(len(F), dtype=np.bool_)
    limit = F - resolution
    for start in range(0, len(F), 256):
        rows = slice(start, start + 256)
        no_worse = np.ones((len(F[rows]), len(F)), dtype=np.bool_)
        better = np.zeros_like(no_worse)
        for k in range(F.shape[1]):
            no_worse &= F[:, k] <= F[rows, [k]]
            better |= F[:, k] < limit[rows, [k]]
        result[rows] = (no_worse & better).any(axis=1)
    return result


class Rating:
    """Rates candidates by the surrogate, and counts them and the reasons why others are impossible.

    free : bounds that are not held, by their requirements; the search then makes small how far they are missed, as a
        sum of logarithms, not the objectives.
    """

    def __init__(self, needed: Requirements, free: Mapping[str, float] | None = None) -> None:
        self.needed, self.free = needed, free or {}
        self.rated = 0
        self.refusals: Counter[str] = Counter()

    def performance(self, candidates: Candidates, limit: float = np.inf) -> Performance:
        """Return what possible candidates reach; `limit` as in `performance`."""
        sensors = sensors_of(candidates)
        return performance(sensors, sensors.beams(), self.needed, share=candidates.share, limit=limit)

    def __call__(self, candidates: Candidates, limit: float = np.inf) -> tuple[Array, Array]:
        """Return objectives and violations; one above `limit` may be any larger number."""
        n = len(candidates)
        F, violation = np.full((n, 1 if self.free else 3), 1e6), np.full(n, IMPOSSIBLE)
        outside = candidates.outside()
        self.refusals.update(reason for reason in outside.tolist() if reason)
        rows = np.flatnonzero(outside == "")
        self.rated += len(rows)
        short = self._short(candidates.take(rows))
        violation[rows] = IMPOSSIBLE / 2 + short
        rows = rows[short <= FAR]
        for start in range(0, len(rows), BATCH):
            at = rows[start : start + BATCH]
            part = candidates.take(at)
            result = self.performance(part, np.inf if self.free else limit)
            F[at] = self.goals(result, part)
            # a share of a force must be reached like the whole
            violation[at] = missed({n: v for n, v in result.margins.items() if n not in self.free or n in FORCES})
        return F, violation

    def goals(self, result: Performance, candidates: Candidates) -> Array:
        """Return the objectives, shape (n, m)."""
        if not self.free:
            return objectives(dict(result.values), self.needed)
        missed_by = [
            value / bound if name not in AT_LEAST else bound / np.maximum(value, 1e-12)
            for (name, bound), value in zip(self.free.items(), self.reached(result, candidates).values(), strict=True)
        ]
        logs = np.sum([np.maximum(np.log(each), 0.0) for each in missed_by], axis=0)
        return np.asarray(np.nan_to_num(logs, nan=1e6, posinf=1e6)[:, None])

    def reached(self, result: Performance, candidates: Candidates) -> dict[str, Array]:
        """Return which bounds the candidates keep of those that are free, shape (n,); NaN where nothing is known."""
        found = {}
        for name in self.free:
            bound = self.needed.bound(name)
            if name in FORCES:
                found[name] = bound * candidates.share[:, FORCES.index(name)]
                continue
            margin = result.margins[name]
            found[name] = bound * np.where(margin > LEAST, 1 + (1 if name in AT_LEAST else -1) * margin, np.nan)
        return found

    def _short(self, candidates: Candidates) -> Array:
        """Return by how much lengths miss their bounds, relative to these, but for free ones."""
        size, height, wall = candidates.sizes()
        needed, nothing = self.needed, np.zeros(len(candidates))
        shares = {"wall": needed.printed_wall / wall}
        shares |= {} if needed.outer_size is None else {"outer_size": size / needed.outer_size}
        shares |= {} if needed.height is None else {"height": height / needed.height}
        shares |= {} if needed.pitch is None else {"pitch": candidates.room() / needed.pitch}
        excess = [share - 1 for name, share in shares.items() if name not in self.free]
        return np.asarray(np.max([nothing, *excess], axis=0))


def search(
    space: Space,
    rating: Rating,
    effort: Effort,
    progress: Progress | None = None,
    *,
    first_met: bool = False,
    start: Candidates | None = None,
) -> Found:
    """Return the pool at the end of a search, or where the first candidate meets all requirements.

    start : candidates with which it begins, in place of all combinations of parts.
    """
    random = np.random.default_rng(effort.seed)
    seen: set[bytes] = set()
    count = max(4 * effort.population, 0 if start else math.prod(b - a for a, b in space.choices))
    drawn = first_candidates(space, count, effort.seed)
    first = _new(joined([start.of(space), drawn]) if start else drawn, seen)
    pool = _survivors(Found(first, *rating(first), len(first)), effort.population)
    for number in range(effort.generations):
        met = int((pool.violation == 0).sum())
        if (first_met and met) or (not met and number >= UNMET * effort.generations):
            return dataclasses.replace(pool, rated=len(seen))
        if progress is not None:
            said = f"{len(seen)} candidates, {met} of the best meet all requirements"
            progress(number / effort.generations, said)
        children = _new(_varied(pool, effort.population, random), seen)
        pool = pool.with_rated(children, rating, effort.population)
    for _ in range(ROUNDS):
        near = _new(_neighbours(pool), seen)
        if not len(near):
            break
        pool = pool.with_rated(near, rating, effort.population)
    return dataclasses.replace(pool, rated=len(seen))


def first_candidates(space: Space, count: int, seed: int) -> Candidates:
    """Return candidates whose lengths spread evenly, and that have all combinations of parts in turn."""
    from scipy.stats import qmc

    shares = qmc.Sobol(5, seed=seed).random_base2(max(math.ceil(math.log2(count)), 1))[:count]
    low, high = space.diameters()
    fits = np.flatnonzero(low <= high + 1e-9)
    if not len(fits):
        raise BadInput(
            "no candidate could be rated, so that nothing is known of the requirements: no magnet in use fits into a "
            f"beam of {space.low:g} to {space.high:g} mm that the surrogate knows"
        )
    counts = [len(fits), *(last - start for start, last in space.choices[1:])]
    combination = np.random.default_rng(seed).permutation(math.prod(counts))
    choices = np.column_stack(np.unravel_index(combination[np.arange(count) % len(combination)], counts))
    choices[:, 0] = fits[choices[:, 0]]
    choices[:, 2] += space.choices[2][0]
    # shares of the forces are spread where one of them is free
    share = np.ones((count, 2))
    for k, least in space.free.items():
        share[:, k] = least ** np.random.default_rng(seed + 1).random(count)
    return space.candidates(choices, shares, share)


def _new(candidates: Candidates, seen: set[bytes]) -> Candidates:
    kept = {key: k for k, key in reversed(list(enumerate(candidates.keys()))) if key not in seen}
    seen.update(kept)
    return candidates.take(np.array(sorted(kept.values()), dtype=np.int64))


def _survivors(pool: Found, count: int) -> Found:
    """Return the front, and the nearest of the others until the pool has `count` candidates."""
    front = pool.front
    rest = np.setdiff1d(np.arange(len(pool.violation)), front)
    rest = rest[np.lexsort((pool.F[rest].sum(axis=1), pool.violation[rest]))]
    combination = np.unique(pool.candidates.choices, axis=0, return_inverse=True)[1].ravel()
    # few combinations fill the pool with more of each
    most = max(ALIKE, count // (combination.max() + 1))
    alike: Counter[int] = Counter()
    filled: list[int] = []
    for k in rest.tolist():
        if len(front) + len(filled) >= count:
            break
        alike[combination[k]] += 1
        if alike[combination[k]] <= most:
            filled.append(k)
    return pool.take(np.array([*front.tolist(), *filled], dtype=np.int64))


def _varied(found: Found, count: int, random: np.random.Generator) -> Candidates:
    """Return children: lengths with steps of all sizes and differences of others, parts of others or near ones."""
    pool = found.candidates
    space, n = pool.space, len(pool)
    first, second, third = random.integers(n, size=(3, count))
    # the ends of a front have neighbours on one side only
    ends = np.argsort(found.F + found.violation[:, None], axis=0, kind="stable")[:ENDS].ravel()
    first = np.where(random.random(count) < 0.3, random.choice(ends, count), first)
    lengths, choices = pool.lengths[first].copy(), pool.choices[first].copy()
    mixed = (random.random(count) < 0.4)[:, None] & (random.random((count, 5)) < 0.7)
    lengths += np.where(mixed, random.random((count, 1)) * (pool.lengths[second] - pool.lengths[third]), 0.0)
    size = 10 ** random.uniform(-2.5, -0.5, (count, 1)) * random.standard_normal((count, 5))
    moved = random.random((count, 5)) < 0.5
    scale = lengths[:, [0, 1, 0, 0, 0]]
    lengths += np.where(moved & (random.random(count) < 0.8)[:, None], size * scale, 0.0)
    for k, (start, last) in enumerate(space.choices):
        taken, near, other = random.random((3, count))
        choices[:, k] = np.where(taken < 0.15, pool.choices[second, k], choices[:, k])
        beside = np.clip(choices[:, k] + random.integers(-3, 4, count), start, last - 1)
        choices[:, k] = np.where(near < 0.15, beside, choices[:, k])
        choices[:, k] = np.where(other < 0.07, random.integers(start, last, count), choices[:, k])
    share = pool.share[first].copy()
    for k, low in space.free.items():
        growth = np.exp(10 ** random.uniform(-3, -0.5, count) * random.standard_normal(count))
        share[:, k] = np.clip(share[:, k] * growth, low, 1.0)
    return space.rounded(choices, _within(space, choices, lengths), share)


def _within(space: Space, choices: Ints, lengths: Array) -> Array:
    """Return lengths in the ranges of the surrogate and of the requirements."""
    low, high = (ends[choices[:, 0]] for ends in space.diameters())
    lengths[:, 0] = np.clip(lengths[:, 0], np.minimum(low, high), high)
    least = np.maximum(surrogate_range.LENGTH[0], 0.5 + surrogate_range.LEAST_BELOW)
    lengths[:, 1] = np.clip(lengths[:, 1], least * lengths[:, 0], surrogate_range.LENGTH[1] * lengths[:, 0])
    return lengths


def _neighbours(pool: Found) -> Candidates:
    chosen = pool.front
    # a front of one objective is a single candidate
    if not len(chosen) or pool.F.shape[1] == 1:
        chosen = np.lexsort((pool.F.sum(axis=1), pool.violation))[: POLISHED // 4]
    if len(chosen) > POLISHED:
        chosen = chosen[spread(pool.F[chosen], POLISHED)]
    at, space = pool.candidates.take(chosen), pool.candidates.space
    groups = []
    for k in range(5):
        for step in (-ROUNDING, ROUNDING):
            moved = at.lengths.copy()
            moved[:, k] += step
            groups.append(space.rounded(at.choices, moved, at.share))
    for k, (start, last) in enumerate(space.choices):
        for step in (*range(-min(4, last - start - 1), 0), *range(1, min(5, last - start))):
            choices = at.choices.copy()
            choices[:, k] = start + (choices[:, k] - start + step) % (last - start)
            groups.append(space.rounded(choices, at.lengths.copy(), at.share))
    return joined(groups)


def spread(F: Array, count: int) -> Ints:
    """Return the indices of `count` points of a front, shape (n, m), that lie far apart, in rising order.

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


def sorted_parts(catalogues: Catalogues, chips: int = 1) -> Catalogues:
    """Return the parts so that neighbours in the search are alike: one-axis parts before 3-axis chips, and one chip
    before two and three, up to `chips`."""
    hall_parts = [
        dataclasses.replace(part, count=count)
        for part in catalogues.hall_parts
        for count in range(1, 1 + (1 if part.layout == "three" else chips))
    ]
    return dataclasses.replace(
        catalogues,
        magnets=tuple(sorted(catalogues.magnets, key=lambda one: one.diameter**2 * one.height * one.remanence)),
        hall_parts=tuple(sorted(hall_parts, key=lambda one: (one.layout != "three", one.count, one.gain))),
        silicones=tuple(sorted(catalogues.silicones, key=lambda one: one.E)),
    )


def spaces(needed: Requirements, catalogues: Catalogues, free: dict[int, float] | None = None) -> list[Space]:
    """Return the candidates with one-axis parts and those with one, two and three 3-axis chips, which are searched
    apart.

    A good beam for one is none for the other: in a common pool whichever meets the requirements first would displace
    the other one before it is good.
    """
    parts = sorted_parts(catalogues, needed.chips)
    kinds = [(part.layout != "three", part.count) for part in parts.hall_parts]
    ends = [(kinds.index(kind), len(kinds) - kinds[::-1].index(kind)) for kind in sorted(set(kinds))]
    return [Space(needed, parts, each, free) for each in ends]


def searched(
    needed: Requirements,
    catalogues: Catalogues,
    effort: Effort,
    progress: Progress | None = None,
    *,
    free: Mapping[str, float] | None = None,
    first_met: bool = False,
    start: Sequence[Found] = (),
    workers: Executor | None = None,
) -> list[Found]:
    """Return the pools of both kinds of Hall parts; of a free force (see `Rating`), candidates take a share.

    first_met : end with the first candidate that meets all requirements.
    start : pools of an earlier search among the same parts, with whose candidates this one begins.
    workers : search several kinds of Hall parts side by side, in place of `first_met` and `start`.
    """
    least = {"force_z": max(needed.least_press / needed.force_z, LEAST_SHARE), "force_x": LEAST_SHARE}
    kinds = spaces(needed, catalogues, {FORCES.index(name): least[name] for name in free or () if name in FORCES})
    found: list[Found] = []
    ratings = [Rating(needed, free) for _ in kinds]
    if workers is not None and len(kinds) > 1:
        found, ratings = _side_by_side(list(zip(kinds, ratings, strict=True)), effort, workers, progress)
        kinds = []
    for number, space in enumerate(kinds):
        first = space.choices[2][0]
        part_used = space.parts.hall_parts[first]
        several = f"{part_used.count} 3-axis chips" if part_used.count > 1 else "3-axis chips"
        kind = "one-axis parts" if part_used.layout == "three" else several
        part = progress and part_of(progress, number / len(kinds), (number + 1) / len(kinds), f"{kind}: ")
        begin = start[number].candidates if number < len(start) else None
        found.append(search(space, ratings[number], effort, part, first_met=first_met, start=begin))
        if first_met and found[-1].violation.min() == 0:
            return found
    if not any(rating.rated for rating in ratings):
        reasons = sum((rating.refusals for rating in ratings), Counter[str]()).most_common(1)
        reason = reasons[0][0] if reasons else "no magnet in use fits into a beam that the surrogate knows"
        raise BadInput(f"no candidate could be rated, so that nothing is known of the requirements: {reason}")
    return found


def _side_by_side(
    kinds: list[tuple[Space, Rating]], effort: Effort, workers: Executor, progress: Progress | None
) -> tuple[list[Found], list[Rating]]:
    """Return the pools of spaces, and the ratings, which count in the processes that search."""
    numbered = list(enumerate(kinds))
    one = partial(_searched_by_worker, effort=effort)
    seconds = SECONDS * effort.population * effort.generations
    each = finished(numbered, one, workers, cost=lambda task: seconds, progress=progress, words="searches")
    # what a process that died has not found is searched here
    done = {search.task[0]: search.answer or one(search.task) for search in each}
    pools, ratings = zip(*(done[number] for number, _ in numbered), strict=True)
    return list(pools), list(ratings)


def _searched_by_worker(task: tuple[int, tuple[Space, Rating]], effort: Effort) -> tuple[Found, Rating]:
    space, rating = task[1]
    return search(space, rating, effort), rating


def part_of(progress: Progress, low: float, high: float, prefix: str = "") -> Progress:
    """Return the progress of a part of a study."""
    return lambda share, text: progress(low + (high - low) * share, prefix + text)


def whole_front(found: Sequence[Found]) -> tuple[Candidates, Array]:
    """Return the common front of all pools, and its objectives."""
    fronts = [pool.take(pool.front) for pool in found]
    chosen, F = joined([each.candidates for each in fronts]), np.concatenate([each.F for each in fronts])
    kept = front_of(F)
    return chosen.take(kept), F[kept]
