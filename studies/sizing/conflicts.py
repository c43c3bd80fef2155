"""Requirements that no variant was found to meet: what is impossible by a bound, and what would have to give.

A bound is a proof: the least base, height or wall of all parts in use. It is said at once, unless another choice of
the file takes it away. Everything else is what a search found: none of so many candidates meets all requirements, the
nearest one is solved by finite elements, and so is a variant of each change that helps, see `advice`: single ones, or
pairs of bounds where none helps alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.bad_input import BadInput
from geometry.messages import Progress
from studies.beam import surrogate_range
from studies.mechanics.tasks import finished
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.parts.catalogues import Catalogues, catalogues_of
from studies.parts.requirements import AT_LEAST, AT_MOST, LIMITS, SHOWN, Requirements
from studies.quantities import shown
from studies.sizing import advice
from studies.sizing.advice import Proof, Trial
from studies.sizing.candidate_variables import Candidates, Space
from studies.sizing.front_solves import FrontPoint
from studies.sizing.variant_search import Found, part_of, sorted_parts

if TYPE_CHECKING:
    from studies.mechanics.tasks import Executor

WITHOUT_PAIRS = 0.75
"""Share of the progress at which the trials of single changes end, and those of pairs begin if none helps."""


@dataclass(frozen=True, slots=True)
class Conflict:
    """Why there is no variant.

    Attributes
    ----------
    bounds : sentences of what is impossible whatever the variant.
    candidates : number of candidates that were tried.
    nearest : the nearest one by finite elements; None if none was solved.
    missed : a row for each requirement that it misses: requirement, value, unit.
    advices : a row for each requirement that could give, with the bound or choice `to` with which a variant was
        found; rows with the same number `advice` belong together.
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
        nothing = {"gives": None, "gives_of_all": None, "to": None, "advice": None}
        others = ({**row, **nothing} for row in self.missed)
        return [*self.advices, *(row for row in others if row["requirement"] not in given)]


def amount(name: str, value: float) -> str:
    """Return the bound of a requirement as a text with its unit.

    >>> amount("largest_strain", 0.49), amount("resolution_z", 0.02), amount("force_z", 5.0), amount("samples", 16)
    ('49 %', '20 mN', '5 N', '16')
    """
    unit = "percent" if SHOWN[name] == "percent" else LIMITS[name].metadata["unit"] if name in LIMITS else "1"
    return shown(float(value), "mN" if unit == "N" and abs(value) < 0.1 else unit, 4)


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
    room = least.room() if len(D) else np.zeros(0)
    lengths_of = {"outer_size": size, "height": height, "pitch": room}
    for name, values in lengths_of.items():
        bound = getattr(needed, name)
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
    found: Sequence[Found],
    proof: Proof,
    workers: Executor | None,
    progress: Progress,
) -> Conflict:
    """Return the nearest candidate, and what would have to give.

    found : pools of a search in which no candidate meets all requirements.
    """
    singles, pairs = advice.could_give(needed, found)
    names = [*advice.readings(needed, catalogues), *singles]
    trials = [*advice.choices(needed), *(Trial(needed, (name,), start=tuple(found)) for name in names)]
    pool = min(found, key=lambda one: float(one.violation.min()))
    near = pool.candidates.take([int(pool.violation.argmin())])
    nearest, advices = _tried(near, trials, needed, proof, workers, part_of(progress, 0.0, WITHOUT_PAIRS))
    if all(row["gives"] is None for row in advices):
        trials = [Trial(needed, pair, start=tuple(found)) for pair in pairs]
        _, more = _tried(None, trials, needed, proof, workers, part_of(progress, WITHOUT_PAIRS, 1.0))
        advices += [{**row, "advice": row["advice"] + len(advices)} for row in more]
    missed = nearest.margins if nearest else {}
    rows = [
        {"requirement": name, "value": needed.bound(name), "unit": LIMITS[name].metadata["unit"]}
        for name, value in missed.items()
        if not value >= 0 and name in (*AT_LEAST, *AT_MOST)
    ]
    return Conflict((), sum(one.rated for one in found), nearest, tuple(rows), tuple(advices))


def excluded(
    needed: Requirements, bounds: tuple[str, ...], proof: Proof, workers: Executor | None, progress: Progress
) -> Conflict:
    """Return the conflict of bounds that no variant keeps, with the choices with which there is one."""

    def possible(trial: Trial) -> bool:
        try:
            return not impossible(trial.needed, catalogues_of(trial.needed))
        except BadInput:
            return False  # no part fits

    trials = [trial for trial in advice.choices(needed) if possible(trial)]
    _, advices = _tried(None, trials, needed, proof, workers, progress)
    return Conflict(bounds, advices=tuple(advices))


def _tried(
    near: Candidates | None,
    trials: Sequence[Trial],
    needed: Requirements,
    proof: Proof,
    workers: Executor | None,
    progress: Progress,
) -> tuple[FrontPoint | None, list[FlatRow]]:
    """Return a candidate by finite elements, and what the trials advise: choices first, then what gives least."""
    tasks = [(trial, proof) for trial in trials]
    if near is not None and not isinstance(near.variant(0), str):
        tasks.append((Trial(needed, (), near=near), proof))
    if not tasks:
        return None, []
    done = dict[tuple[str, ...], Any]()

    def report(share: float, text: str) -> None:
        # a change that helps takes several times one that does not, so that no time left is known
        progress(share, text.partition(",")[0])

    for each in finished(tasks, advice.tried, workers=workers, cost=advice.cost, progress=report, words="changes"):
        # a process that died says nothing of its change
        done[each.task[0].changed] = each.answer or []
    rows: list[FlatRow] = []
    nearest = next(iter(done.pop((), [])), None)
    found = [done[trial.changed] for trial in trials if done[trial.changed]]
    found.sort(key=lambda one: max(0.0 if row["gives"] is None else row["gives"] / row["value"] for row in one))
    for number, one in enumerate(found, 1):
        rows += [{**row, "advice": number} for row in one]
    return nearest, rows
