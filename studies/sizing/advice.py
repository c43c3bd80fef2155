"""What would have to give so that there is a variant: other choices, one bound, or two.

A trial changes one thing: a choice of the file (the other shape of the base, no screws, the other process, more
chips, parts or diameters that the file leaves out), the time of a reading (`bandwidth`, `samples`), or bounds that
give. How far bounds must give is searched for: candidates meet all other requirements, and miss these least. Then
searches that begin with what was found tighten the bounds by `STEP` until they find nothing. What is advised must be
found by the search of `magtip size`, too, and a variant of it is solved by finite elements with the requirements that
it states; where either fails, the bounds give more. Trials run
side by side in worker processes, each with its finite elements.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fem.accuracy import Accuracy
from geometry.bad_input import BadInput
from studies.cases import FiniteElements
from studies.mechanics import store as stores
from studies.output.records import FlatRow
from studies.parts.catalogues import Catalogues, catalogues_of
from studies.parts.requirements import AT_LEAST, AT_MOST, CATALOGUES, CRITERIA, LIMITS, MOST_SAMPLES, Requirements
from studies.sizing import front_yield
from studies.sizing.candidate_performance import performance
from studies.sizing.candidate_variables import Candidates, Variant
from studies.sizing.front_solves import FrontPoint, solved_points, with_yield
from studies.sizing.sensor_arrays import sensors_of
from studies.sizing.variant_search import Effort, Found, Rating, searched, sorted_parts

STEP = 0.01
"""Relative steps of a bound that is tightened or gives: how far from the least one it may be."""
FAR, NEAR = Effort(256, 24), Effort(128, 16)
"""Efforts of a search of its own, and of one that begins with what another one found."""
NEVER = 20.0
"""Logarithm of a miss from which on nothing that gives helps."""
BOUNDS, PAIRS = 3, 3
"""Numbers of single bounds, and of pairs, that are tried: those first that the nearest candidates miss least."""
SOLVED = 2
"""Variants that finite elements solve for each bound, and bounds that are tried if they fail."""
READING = ("bandwidth", "samples")
"""Requirements that decide how many values a reading averages."""
SLOWEST = 1000.0
"""How many times less than required a bandwidth is tried."""


@dataclass(frozen=True, slots=True)
class Proof:
    """How advice is proved: by the search of `magtip size`, and by finite elements.

    Attributes
    ----------
    store : file of solved states.
    """

    effort: Effort
    accuracy: Accuracy
    store: Path


@dataclass(frozen=True, slots=True)
class Trial:
    """Something that is tried, in a process of its own.

    Attributes
    ----------
    needed : requirements with the choice that is tried; bounds as they are.
    changed : requirements that change.
    before : of a choice, its value in the file.
    start : pools of a search for these requirements.
    near : in place of all that, a candidate that finite elements solve.
    """

    needed: Requirements
    changed: tuple[str, ...]
    before: str = ""
    start: tuple[Found, ...] = ()
    near: Candidates | None = None


def choices(needed: Requirements) -> list[Trial]:
    """Return trials of choices that the requirements leave out."""
    other = {"round": "square", "square": "round", "fdm": "sla", "sla": "fdm"}
    fields: dict[str, dict[str, Any]] = {
        name: {name: other[getattr(needed, name)]} for name in ("outer_shape", "process")
    }
    if needed.outer_shape == "square" and needed.screws:
        fields["screws"] = {"screws": False}
    if needed.chips < 3:
        fields["chips"] = {"chips": 3}
    if needed.cross_talk is not None and needed.decoder != "jointly":
        fields["decoder"] = {"decoder": "jointly"}
    if needed.polarity != "any":
        fields["polarity"] = {"polarity": "any"}
    fields |= {name: {name: ()} for name in CATALOGUES if getattr(needed, name)}
    if needed.D_low is not None or needed.D_high is not None:
        fields["D"] = {"D_low": None, "D_high": None}
    trials = []
    for name, values in fields.items():
        before = {"D": "as required"} if name == "D" else dataclasses.asdict(needed)
        text = ", ".join(before[name]) if name in CATALOGUES else str(before[name])
        try:
            trials.append(Trial(dataclasses.replace(needed, **values), (name,), text))
        except BadInput:
            continue  # it contradicts another requirement
    return trials


def could_give(needed: Requirements, found: Sequence[Found]) -> tuple[list[str], list[tuple[str, ...]]]:
    """Return bounds that alone, and pairs that together, could give: those first that the nearest candidates of a
    search miss least by nothing else, and then least by these."""
    alone: dict[str, float] = {}
    pairs: dict[tuple[str, ...], float] = {}
    for pool in found:
        order = np.argsort(pool.violation, kind="stable")[:200]
        order = order[pool.violation[order] < 50]
        if not len(order):
            continue
        margins = Rating(needed).performance(pool.candidates.take(order)).margins
        misses = {name: np.log1p(np.maximum(-margin, 0.0)) for name, margin in margins.items()}
        total = np.sum(list(misses.values()), axis=0)
        names = sorted(name for name, miss in misses.items() if name in (*AT_LEAST, *AT_MOST) and miss.any())

        def left(of: Iterable[str], total: Any = total, misses: Mapping[str, Any] = misses) -> float:
            given = np.sum([misses[name] for name in of], axis=0)
            return float((total - given + 1e-3 * given).min())

        for name in names:
            alone[name] = min(alone.get(name, math.inf), left([name]))
        for pair in itertools.combinations(names, 2):
            pairs[pair] = min(pairs.get(pair, math.inf), left(pair))
    # a resolution or a strain that is missed may also be bought by force, which no candidate misses
    singles = list(dict.fromkeys([*sorted(alone, key=lambda name: alone[name]), "force_z"]))
    return singles[:BOUNDS], sorted(pairs, key=lambda pair: pairs[pair])[:PAIRS]


def readings(needed: Requirements, catalogues: Catalogues) -> list[str]:
    """Return which of `READING` could give: where a resolution asks for an average, or a rate leaves parts out."""
    noise = needed.resolution_z is not None or needed.resolution_x is not None
    slow = any(part.unusable == "" for part in catalogues.left_out)
    names = ["bandwidth"] if needed.bandwidth is not None and (noise or slow) else []
    return [*names, *(["samples"] if noise and needed.samples < MOST_SAMPLES else [])]


def cost(task: tuple[Trial, Proof]) -> float:
    """Return the expected time of a trial on one core, s, as measured on the examples."""
    trial = task[0]
    if trial.near is not None:
        return 7.0
    return 10.0 if trial.before else 15.0


def tried(task: tuple[Trial, Proof]) -> list[Any]:
    """Return the rows of an advice, one for each requirement that changes; none if no variant was found.

    Of a candidate that finite elements solve, it is the point.
    """
    trial, proof = task
    with stores.opened(proof.store) as store:
        fem = FiniteElements(proof.accuracy, {"store": store, "workers": 0})
        if trial.near is not None:
            return solved_points(trial.near, trial.needed, fem)
        if trial.before:
            return _choice(trial, proof, fem)
        name = trial.changed[0]
        return _reading(name, trial, proof, fem) if name in READING else _bounds(trial, proof, fem)


def confirmed(
    pools: Sequence[Found], needed: Requirements, fem: FiniteElements, giving: Iterable[str] = ()
) -> FrontPoint | None:
    """Return a variant that meets all requirements by finite elements, among those with the most room in all but the
    requirements that give; None if none of `SOLVED` does."""
    met = [pool.take(pool.violation == 0).candidates for pool in pools]
    for candidates in (each for each in met if len(each)):
        sensors = sensors_of(candidates)
        margins = performance(sensors, sensors.beams(), needed, dense=True).margins
        room = np.min([margin for name, margin in margins.items() if name not in giving], axis=0)
        order = [k for k in np.argsort(-room).tolist() if not isinstance(candidates.variant(k), str)]
        for k in order[:SOLVED]:
            (point,) = solved_points(candidates.take([k]), needed, fem)
            if needed.least_yield is not None:
                point = with_yield(point, needed, front_yield.SENSORS)
            if point.status == "ok":
                return point
    return None


def _choice(trial: Trial, proof: Proof, fem: FiniteElements) -> list[FlatRow]:
    needed = trial.needed
    try:
        parts = catalogues_of(needed)
        for effort in (dataclasses.replace(FAR, seed=proof.effort.seed), proof.effort):
            pools = searched(needed, parts, effort, first_met=True)
            point = confirmed(pools, needed, fem)
            if point is not None or not _met(pools):
                break
    except BadInput:
        return []  # no part fits
    if point is None:
        return []
    (name,) = trial.changed
    to = _chosen(name, needed, point.variant)
    before = not to if isinstance(to, bool) else trial.before
    return [_row(name, before, to, unit="mm" if name == "D" else "1")]


def _chosen(name: str, needed: Requirements, variant: Variant) -> Any:
    """Return what a choice is for a variant that was found."""
    of_part = {
        "magnets": variant.magnet.name,
        "hall_parts": variant.hall_part.name,
        "silicones": variant.silicone.name,
        "chips": variant.hall_part.count,
        "D": variant.design.D,
    }
    return of_part[name] if name in of_part else getattr(needed, name)


def _row(name: str, value: Any, to: Any, *, unit: str | None = None) -> FlatRow:
    gives = abs(to - value) if isinstance(value, float) else None
    unit = LIMITS[name].metadata["unit"] if unit is None else unit
    return {"requirement": name, "value": value, "unit": unit, "gives": gives, "gives_of_all": gives, "to": to}


def _with(needed: Requirements, bounds: Mapping[str, Any]) -> Requirements:
    return dataclasses.replace(needed, **bounds)


def _met(pools: Sequence[Found]) -> bool:
    return any((pool.violation == 0).any() for pool in pools)


class _Near:
    """Searches for nearly the same requirements, each of which begins with what the ones before it have found."""

    def __init__(self, parts: Catalogues, seed: int, pools: Sequence[Found]) -> None:
        self.parts, self.effort, self.start = parts, dataclasses.replace(NEAR, seed=seed), list(pools)

    def __call__(self, needed: Requirements) -> list[Found]:
        """Return the pools of a search that ends with the first candidate that meets all; empty if none does."""
        pools = searched(needed, self.parts, self.effort, first_met=True, start=self.start)
        if not _met(pools):
            return []
        self.start[: len(pools)] = pools
        return pools


def _bounds(trial: Trial, proof: Proof, fem: FiniteElements) -> list[FlatRow]:
    """Return the least that bounds give: the sum of the logarithms of how much they give is least."""
    needed = trial.needed
    parts, reached, pools = demand(trial.changed, needed, trial.start)
    if not reached:
        return []
    near = _Near(parts, needed.seed, pools)
    widths = {name: math.log(value / needed.bound(name)) for name, value in reached.items()}
    step = STEP / max(max(map(abs, widths.values())), 1e-3)

    def at(share: float) -> Requirements:
        to = {
            name: rounded(needed.bound(name) * math.exp(share * width), up=name in AT_MOST)
            for name, width in widths.items()
        }
        return _with(needed, to)

    share, found = _tightened(at, near, step)
    proved = _proved(at, share, step, found, (trial, proof), fem)
    if proved is None:
        return []
    loose, point = proved
    return [_row(name, needed.bound(name), _kept(name, loose, point)) for name in widths]


def _proved(
    at: Callable[[float], Requirements],
    share: float,
    step: float,
    found: Sequence[Found],
    task: tuple[Trial, Proof],
    fem: FiniteElements,
) -> tuple[Requirements, FrontPoint] | None:
    """Return the least requirements, from a share on, for which `magtip size` finds a variant, and such a one by
    finite elements.

    found : candidates that meet these of the first share.
    """
    trial, proof = task
    for number in range(SOLVED + 1):
        try:
            loose = at(share)
            pools = searched(loose, catalogues_of(loose), proof.effort, first_met=True)
        except BadInput:
            return None  # there is no such bound
        if _met(pools) and (point := confirmed([*found, *pools], loose, fem, trial.changed)):
            return loose, point
        share += 3**number * step
    return None


def _kept(name: str, needed: Requirements, point: FrontPoint) -> float:
    """Return a bound: of a length, which all models share, that of the variant."""
    exact = name in AT_MOST and not CRITERIA[name].varies
    return rounded(point.solved[name], up=True) if exact else needed.bound(name)


def _tightened(at: Callable[[float], Requirements], near: _Near, step: float) -> tuple[float, list[Found]]:
    """Return the least share, in steps, at which candidates are found from 1 on, and what is found there."""
    share, found = 1.0, near(at(1.0))
    # a free search rates all requirements at the bound as it was
    while not found and share < 1 + 8 * step:
        share += step
        found = near(at(share))
    while found and share > step and (tighter := near(at(share - step))):
        share, found = share - step, tighter
    return share, found


def demand(
    names: tuple[str, ...], needed: Requirements, start: Sequence[Found] = ()
) -> tuple[Catalogues, dict[str, float], list[Found]]:
    """Search for candidates that meet all requirements but some, and miss these least.

    Returns
    -------
    The parts, the bounds that the best candidate keeps of those that it misses (nothing if none meets the others),
    and the pools.
    """
    to, asked = {}, {name: needed.bound(name) for name in names}
    for name in names:
        if name in AT_MOST:
            # so that nothing, such as the range of D, rests on the bound that gives
            most = 0.99 * getattr(needed, name.replace("resolution", "force")) if "resolution" in name else math.inf
            to[name] = min(LIMITS[name].metadata["high"], most)
    loosest = _with(needed, to)
    parts = catalogues_of(loosest)
    kept = start if start and start[0].candidates.space.parts == sorted_parts(parts, loosest.chips) else ()
    pools = searched(loosest, parts, dataclasses.replace(FAR, seed=needed.seed), free=asked, start=kept)
    best = min(pools, key=lambda pool: float(pool.F[pool.violation == 0, 0].min(initial=math.inf)))
    met = np.flatnonzero(best.violation == 0)
    if not len(met):
        return parts, {}, pools
    one = best.candidates.take([met[best.F[met, 0].argmin()]])
    rating, reached = Rating(loosest, asked), dict[str, float]()
    for name, (value,) in rating.reached(rating.performance(one), one).items():
        if not abs(math.log(value / asked[name])) < NEVER:
            return parts, {}, pools
        if value > asked[name] if name in AT_MOST else value < asked[name]:
            reached[name] = float(value)
    return parts, reached, pools


def _reading(name: str, trial: Trial, proof: Proof, fem: FiniteElements) -> list[FlatRow]:
    """Return the largest bandwidth, or the least number of samples, with which there is a variant, by bisection."""
    needed = trial.needed
    asked = getattr(needed, name)
    width = math.log(1 / SLOWEST if name == "bandwidth" else MOST_SAMPLES / asked)

    def at(share: float) -> Requirements:
        value = asked * math.exp(share * width)
        value = rounded(value, up=False) if name == "bandwidth" else min(math.ceil(value - 1e-9), MOST_SAMPLES)
        return _with(needed, {name: value})

    # the slowest reading has all parts
    parts = catalogues_of(at(1.0))
    pools = searched(at(1.0), parts, dataclasses.replace(FAR, seed=needed.seed), first_met=True)
    if not _met(pools):
        return []
    near = _Near(parts, needed.seed, pools)
    low, high, found = 0.0, 1.0, pools
    while high - low > STEP / abs(width) and getattr(at(low), name) != getattr(at(high), name):
        middle = (low + high) / 2
        if nearer := near(at(middle)):
            high, found = middle, nearer
        else:
            low = middle
    proved = _proved(at, high, STEP / abs(width), found, (trial, proof), fem)
    if proved is None:
        return []
    return [_row(name, float(asked), float(getattr(proved[0], name)), unit="Hz" if name == "bandwidth" else "1")]


def rounded(value: float, *, up: bool) -> float:
    """Return a value with four digits, rounded to the looser side.

    >>> rounded(13.1412, up=True), rounded(13.1499, up=False)
    (13.15, 13.14)
    """
    if not value > 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 3)
    turn = math.ceil if up else math.floor
    return float(f"{turn(value / unit + (-1e-9 if up else 1e-9)) * unit:.4g}")
