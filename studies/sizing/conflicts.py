"""Requirements that no variant was found to meet: what is impossible by a bound, and which one would have to give.

A bound is a proof: the least base, height or wall of all parts in use. Everything else is what a search found: none
of so many candidates meets all requirements, the nearest one is solved by finite elements, and a requirement that
alone could give is loosened as far as a search for it says. The loosened requirements are then searched again, by the
same search that `magtip size` runs, and the variant found is solved by finite elements: only what holds is said.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from geometry.bad_input import BadInput
from geometry.messages import Progress
from studies.cases import FiniteElements
from studies.mechanics import surrogate_range
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.parts.catalogues import Catalogues
from studies.parts.requirements import AT_LEAST, AT_MOST, LIMITS, Requirements
from studies.sizing.candidate_variables import Space
from studies.sizing.front_solves import FrontPoint, solved_points
from studies.sizing.variant_search import Effort, Found, Rating, searched, sorted_parts

LEAST_EFFORT = Effort(256, 24)
"""Effort of the search for how far one requirement would have to give."""
NEVER = 20.0
"""Logarithm of a miss from which on a requirement is not met by anything that gives."""
AGAIN = 3
"""How often a requirement is loosened further if a search with it finds nothing."""
ADVICES = 3
"""Requirements that are tried, those first of which the nearest candidates miss least."""
SLACK, FURTHER = 0.02, 1.3
"""How much more than found a requirement gives, relative to what was found, so that a search can come into it; and
how much more it gives each time that this is not enough."""


@dataclass(frozen=True, slots=True)
class Conflict:
    """Why there is no variant.

    Attributes
    ----------
    bounds : sentences of what is impossible whatever the variant.
    candidates : number of candidates that were tried.
    nearest : the nearest one by finite elements; None if none was solved.
    missed : a row for each requirement that it misses: requirement, value, unit.
    advices : a row for each requirement that alone could give, with the bound `to` with which a variant was found.
    """

    bounds: tuple[str, ...]
    candidates: int = 0
    nearest: FrontPoint | None = None
    missed: tuple[FlatRow, ...] = ()
    advices: tuple[FlatRow, ...] = ()

    def sentence(self) -> str:
        """State the conflict, and what would have to give."""
        template = Path(__file__).with_name("conflict.j2")
        (text,) = page_templates.sentences(template, "sentence", conflict=self, amount=amount)
        return text

    def rows(self) -> list[FlatRow]:
        """Return a row for each requirement that could give, or that the nearest candidate misses."""
        given = {row["requirement"] for row in self.advices}
        others = ({**row, "gives": None, "gives_of_all": None, "to": None} for row in self.missed)
        return [*self.advices, *(row for row in others if row["requirement"] not in given)]


def amount(name: str, value: float) -> str:
    """Return the bound of a requirement as a text with its unit.

    >>> amount("largest_strain", 0.49), amount("resolution_z", 0.02), amount("force_z", 5.0)
    ('49 %', '20 mN', '5 N')
    """
    unit = LIMITS[name].metadata["unit"]
    if name in ("largest_strain", "drift_per_K", "hysteresis", "least_yield"):
        return f"{100 * value:.4g} %"
    if unit == "N" and abs(value) < 0.1:
        return f"{1000 * value:.4g} mN"
    return f"{value:.4g}" + ("" if unit == "1" else f" {unit}")


def impossible(needed: Requirements, catalogues: Catalogues) -> tuple[str, ...]:
    """Return a sentence for each length that no variant of these parts has, whatever its other lengths.

    Outer size and height rise with D and L, so the least D of each magnet and the least L decide.
    """
    space = Space(needed, sorted_parts(catalogues))
    low, high = space.diameters()
    fits = np.flatnonzero(low <= high + 1e-9)
    magnets, parts, levels = np.meshgrid(fits, np.arange(len(catalogues.hall_parts)), [-0.5, 0.0, 0.5], indexing="ij")
    D = low[magnets.ravel()]
    h = space.magnets["height"][magnets.ravel()]
    L = np.maximum(surrogate_range.LENGTH[0] * D, (0.5 + surrogate_range.LEAST_BELOW) * D + h / 2)
    choices = np.column_stack([magnets.ravel(), np.zeros(len(D), dtype=np.int64), parts.ravel()])
    lengths = np.column_stack([D, np.floor(L / 0.1) * 0.1, 0 * D, 0 * D, levels.ravel() * (L - D / 2)])
    least = space.rounded(choices, lengths)
    texts = []
    size, height, wall = least.sizes() if len(D) else (np.zeros(0),) * 3
    for name, values, bound in (("outer_size", size, needed.outer_size), ("height", height, needed.height)):
        if bound is None or not len(values) or values.min() <= bound:
            continue
        k = int(values.argmin())
        magnet, part = space.parts.magnets[choices[k, 0]].name, space.parts.hall_parts[choices[k, 2]].name
        texts.append(
            f"{name} of {bound:g} mm is impossible: the least is {values[k]:.2f} mm, with {part} under a beam of D = "
            f"{D[k]:.3g} mm around {magnet}"
        )
    if len(wall) and wall.max() < needed.printed_wall:
        texts.append(
            f"a wall of {needed.printed_wall:g} mm is impossible: the thickest pin or wall of these parts is "
            f"{wall.max():.3g} mm"
        )
    return (*texts, *_hysteresis(needed, catalogues))


def _hysteresis(needed: Requirements, catalogues: Catalogues) -> list[str]:
    """Return the sentence of a hysteresis that no silicone in use is known to keep; nothing where one does."""
    parts = catalogues.silicones
    if needed.hysteresis is None or not all(part.refusal(needed) for part in parts):
        return []
    known = [part for part in parts if part.loss_factor_high is not None]
    text = f"no silicone in use is known to keep a hysteresis of {amount('hysteresis', needed.hysteresis)}"
    if known:
        best = min(known, key=lambda part: part.hysteresis)
        reached = amount("hysteresis", best.hysteresis)
        text += f": the least known is {reached}, of {best.name} (tan(delta) up to {best.loss_factor_high:g})"
    if unknown := [part.name for part in parts if part.loss_factor_high is None]:
        text += f"{'; unknown is' if known else ': unknown is'} the loss factor of {', '.join(unknown)}"
    return [f"{text}: state a loss_factor that you have measured in a [[silicone]] of your own, or allow more"]


def conflict_of(
    needed: Requirements,
    catalogues: Catalogues,
    effort: Effort,
    found: list[Found],
    fem: FiniteElements,
    progress: Progress,
) -> Conflict:
    """Return the nearest candidate, and what would have to give.

    found : pools of a search in which no candidate meets all requirements.
    """
    pool = min(found, key=lambda one: float(one.violation.min()))
    near = pool.candidates.take([int(pool.violation.argmin())])
    progress(0.0, "the nearest candidate by finite elements")
    (nearest,) = [None] if isinstance(near.variant(0), str) else solved_points(near, needed, fem)
    advices: list[FlatRow] = []
    for number, name in enumerate(_could_give(needed, found)[:ADVICES]):
        progress(0.1 + 0.9 * number / ADVICES, f"how far would {name} have to give?")
        advices += _advice(name, needed, catalogues, effort, fem)
    missed = nearest.margins if nearest else {}
    rows = [
        _bound(needed, name) for name, value in missed.items() if not value >= 0 and name in (*AT_LEAST, *AT_MOST)
    ]
    return Conflict((), sum(one.rated for one in found), nearest, tuple(rows), tuple(advices))


def _bound(needed: Requirements, name: str) -> FlatRow:
    value = needed.printed_wall if name == "wall" else getattr(needed, name)
    return {"requirement": name, "value": float(value), "unit": LIMITS[name].metadata["unit"]}


def _could_give(needed: Requirements, found: list[Found]) -> list[str]:
    """Return the requirements that the nearest candidates miss, those first that they miss least by themselves."""
    missed: dict[str, float] = {}
    for pool in found:
        order = np.argsort(pool.violation)[:200]
        order = order[pool.violation[order] < 50]
        if not len(order):
            continue
        margins = Rating(needed).performance(pool.candidates.take(order)).margins
        for name, values in margins.items():
            others = np.sum([np.maximum(-other, 0.0) for key, other in margins.items() if key != name], axis=0)
            if name in (*AT_LEAST, *AT_MOST) and (values < 0).any():
                missed[name] = min(missed.get(name, math.inf), float((others + np.maximum(-values, 0.0)).min()))
                missed[name] += 1e-3 * float(others.min())
    # a resolution or a strain that is missed may also be bought by force, which no candidate misses
    return list(dict.fromkeys([*sorted(missed, key=lambda name: missed[name]), "force_z"]))


def _advice(
    name: str, needed: Requirements, catalogues: Catalogues, effort: Effort, fem: FiniteElements
) -> list[FlatRow]:
    """Return how far a requirement would have to give, after a search with it; nothing if nothing is found."""
    row = _bound(needed, name)
    value = row["value"]
    reached = demand(name, needed, catalogues, dataclasses.replace(LEAST_EFFORT, seed=effort.seed))
    if not math.isfinite(reached):
        return []
    # how many times too strict the requirement is
    gives = max(reached / value if name in AT_MOST else value / reached, 1.0) * (1 + SLACK)
    for _ in range(AGAIN):
        to = _rounded(value * gives if name in AT_MOST else value / gives, up=name in AT_MOST)
        try:
            loose = _with_bound(needed, name, to)
        except BadInput:
            return []
        again = searched(loose, catalogues, effort, first_met=True)
        met = [pool for pool in again if (pool.violation == 0).any()]
        if met:
            (point,) = solved_points(met[0].candidates.take(met[0].front[:1]), loose, fem)
            if point.status == "ok":
                return [row | {"gives": abs(to - value), "gives_of_all": abs(to - value), "to": to}]
        gives = (1 + FURTHER * (gives - 1)) * (1 + SLACK)
    return []


def demand(name: str, needed: Requirements, catalogues: Catalogues, effort: Effort) -> float:
    """Return the strictest bound of a requirement with which candidates meet all others; NaN if none meets them."""
    loosest = needed
    if name in AT_MOST:
        # so that nothing, such as the range of D, rests on the bound that gives
        most = 0.99 * getattr(needed, name.replace("resolution", "force")) if "resolution" in name else math.inf
        loosest = _with_bound(needed, name, min(LIMITS[name].metadata["high"], most))
    pools = searched(loosest, catalogues, effort, free=name)
    missed = min(float(pool.F[pool.violation == 0, 0].min(initial=math.inf)) for pool in pools)
    bound = _bound(loosest, name)["value"]
    return bound * math.exp(missed if name in AT_MOST else -missed) if missed < NEVER else math.nan


def _with_bound(needed: Requirements, name: str, bound: float) -> Requirements:
    changed: dict[str, Any] = {name: bound}
    return dataclasses.replace(needed, **changed)


def _rounded(value: float, *, up: bool) -> float:
    """Return a value with three digits, rounded to the looser side.

    >>> _rounded(13.141, up=True), _rounded(13.149, up=False)
    (13.2, 13.1)
    """
    if not value > 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 2)
    turn = math.ceil if up else math.floor
    return float(f"{turn(value / unit + (-1e-9 if up else 1e-9)) * unit:.3g}")
