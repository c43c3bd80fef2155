"""The search for variants: objectives and constraints of the candidates, and the front as variants."""

from __future__ import annotations

import dataclasses
import functools
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array, Ints
from geometry.design import BadInput
from geometry.messages import Progress
from studies.mechanics import prediction
from studies.sizing.candidate_performance import Performance, performance
from studies.sizing.candidate_variables import Variant, shortage, variables, variant
from studies.sizing.front_search import Effort, Generation, search

if TYPE_CHECKING:
    from studies.sizing.catalogues import Catalogues
    from studies.sizing.requirements import Requirements

IMPOSSIBLE = 100.0
"""Violation of an impossible candidate: above that of any possible one, to which each requirement adds at most 7."""


def objectives(result: Performance) -> Array:
    """Return what the search makes small, shape (n, 3): range (negative) and resolution as logarithms, and size, mm.

    Logarithms let a step from 5 to 6 N count as one from 50 to 60 N in the distances of the front.
    """
    resolution = np.maximum(result.resolution_z, result.resolution_x)
    columns = [-np.log(np.maximum(result.range_z, 1e-9)), np.log(np.clip(resolution, 1e-12, 1e12)), result.outer_size]
    return np.asarray(np.nan_to_num(np.column_stack(columns), nan=1e6, posinf=1e6))


class Candidates:
    """Evaluates candidates for the search, and counts those that were rated, and the reasons why others were not."""

    def __init__(self, requirements: Requirements, catalogues: Catalogues) -> None:
        self.requirements, self.catalogues = requirements, catalogues
        self.variables = variables(requirements, catalogues)
        self.rated = 0
        self.refusals: Counter[str] = Counter()

    def possible(self, X: Array) -> tuple[Ints, list[Variant]]:
        """Return the indices of the candidates (n, m) whose designs are possible and in range, and their variants."""
        kept, variants = [], []
        for k in np.flatnonzero(shortage(X, self.catalogues) == 0).tolist():
            answer = variant(X[k].tolist(), self.requirements, self.catalogues)
            if isinstance(answer, str):
                self.refusals[answer] += 1
            else:
                kept.append(k)
                variants.append(answer)
        if not variants:
            return np.zeros(0, dtype=np.int64), []
        outside = beams_of(variants).outside
        self.refusals.update(reason for reason in outside.tolist() if reason)
        inside = np.flatnonzero(outside == "")
        self.rated += len(inside)
        return np.array(kept)[inside], [variants[k] for k in inside.tolist()]

    def evaluate(self, X: Array) -> tuple[Array, Array]:
        """Return objectives (n, 3) and the sums of all violations (n, 1), 0 where all requirements are met."""
        F, violation = np.full((len(X), 3), 1e6), IMPOSSIBLE + shortage(X, self.catalogues)
        kept, variants = self.possible(X)
        if len(kept):
            result = performance(variants, beams_of(variants), self.requirements)
            signed = np.column_stack(list(result.margins.values()))
            F[kept] = objectives(result)
            # logarithms: a requirement that is missed by far must not hide the others
            violation[kept] = np.log1p(np.maximum(-signed, 0.0)).sum(axis=1)
        return F, violation[:, None]


def check_rated(groups: Sequence[Candidates]) -> None:
    """Raise BadInput with the most frequent reason if a limit of the program has rejected every candidate."""
    if any(group.rated for group in groups):
        return
    reasons = sum((group.refusals for group in groups), Counter[str]())
    reason = reasons.most_common(1)[0][0] if reasons else "no magnet in use fits into a beam that the surrogate knows"
    raise BadInput(f"no candidate could be rated, so that nothing is known of the requirements: {reason}")


def beams_of(variants: Sequence[Variant]) -> prediction.Beams:
    """Return the surrogate's answers for the beams of variants."""
    designs = [each.design for each in variants]
    rows = [
        (d.L / d.D, d.magnet_diameter / d.D, d.magnet_height / d.D, d.nu, d.magnet_edge_radius / d.D) for d in designs
    ]
    return prediction.beams(*np.array(rows).reshape(-1, 5).T)


def islands(requirements: Requirements, catalogues: Catalogues) -> list[Candidates]:
    """Return the candidates with one-axis parts and those with 3-axis chips, which are searched apart.

    A good beam for one is none for the other: in a common population whichever becomes feasible first would displace
    the other one before it is good. Parts are sorted, so that neighbours in the search are alike.
    """
    sorted_parts = dataclasses.replace(
        catalogues,
        magnets=tuple(sorted(catalogues.magnets, key=lambda one: one.diameter**2 * one.height * one.remanence)),
        silicones=tuple(sorted(catalogues.silicones, key=lambda one: one.E)),
    )
    parts = sorted(catalogues.hall_parts, key=lambda one: one.gain)
    kinds = [tuple(part for part in parts if (part.layout == "three") == three) for three in (True, False)]
    return [Candidates(requirements, dataclasses.replace(sorted_parts, hall_parts=kind)) for kind in kinds if kind]


def searched(
    groups: Sequence[Candidates], effort: Effort, progress: Progress | None = None
) -> tuple[list[Generation], list[Variant]]:
    """Return the last generation of each group, and the distinct variants that none of any group dominates."""
    lasts, variants, rows = [], [], []
    for number, group in enumerate(groups):
        kind = "one-axis parts" if group.catalogues.hall_parts[0].layout == "three" else "3-axis chips"
        part = None if progress is None else functools.partial(_part, progress, number, len(groups), kind)
        last = search(group.variables, group.evaluate, effort, progress=part)
        lasts.append(last)
        _, feasible = group.possible(last.X[last.front])
        variants += feasible
        rows.append(last.F[last.front])
    F = np.concatenate(rows)
    # one is dominated if another one is nowhere worse and somewhere better
    no_worse = (F[:, None] <= F).all(axis=2)
    dominated = (no_worse & (F[:, None] < F).any(axis=2)).any(axis=0)
    front: dict[tuple[object, ...], Variant] = {}
    for k in np.flatnonzero(~dominated).tolist():
        front.setdefault(tuple(variants[k].row().values()), variants[k])
    return lasts, list(front.values())


def _part(progress: Progress, done: int, count: int, kind: str, share: float, text: str) -> None:
    """Report the progress of one of several searches."""
    progress((done + share) / count, f"{kind}: {text}")
