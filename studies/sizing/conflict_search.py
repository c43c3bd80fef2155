"""Why no candidate meets all requirements: margins of candidates at several force ranges, and the conflict in them.

Each row is a candidate that is rated for shares of the required ranges in z and in x, so that a range can give as any
other requirement can (see `conflicts`). Between the samples, `front_search` looks for the best margin of one
requirement among the candidates that meet others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.messages import Progress
from studies.sizing.candidate_performance import performance
from studies.sizing.conflicts import Bound, Conflict, bounds_of, find_conflict
from studies.sizing.front_search import Effort, Generation, Variable, search
from studies.sizing.requirement_margins import Performance
from studies.sizing.variant_search import Candidates, beams_of

SHARES = (Variable("share_z", 0.02, 1.3), Variable("share_x", 0.02, 1.3))
"""Shares of the required ranges, as variables of a search beside those of a candidate. Shares above 1 count as 1: the
whole range must not be the very end of a variable, which a search only comes close to."""
SAMPLED = (1.0, 0.8, 0.6, 0.4, 0.2, 0.1)
"""Shares at which the candidates of the last generation are rated."""
EFFORT = Effort(48, 24)
"""Effort of one search between the samples: about three seconds."""
MOST_MARGIN = 1e6
"""Bound of the margins in size: a resolution can be infinite."""


@dataclass(frozen=True, slots=True)
class _Ratings:
    """Rates candidates with shares of the ranges."""

    candidates: Candidates
    bounds: tuple[Bound, ...]

    def margins(self, X: Array) -> Array:
        """Return the margins, in the units of the bounds, shape (n, m); NaN for an impossible candidate.

        Parameters
        ----------
        X : variables of candidates, then the shares of the ranges in z and x, shape (n, k + 2).
        """
        rows = np.full((len(X), len(self.bounds)), np.nan)
        kept, variants = self.candidates.possible(X[:, :-2])
        if not variants:
            return rows
        needed = self.candidates.requirements
        shares = np.minimum(X[kept, -2:], 1.0)
        result = performance(variants, beams_of(variants), needed, scales=shares)
        columns = [self._margin(bound, result, shares) for bound in self.bounds]
        signed = np.clip(np.column_stack(columns), -MOST_MARGIN, MOST_MARGIN)
        # a variant that cannot be built meets nothing
        signed[~(result.clearance >= 0)] = np.nan
        rows[kept] = signed
        return rows

    def _margin(self, bound: Bound, result: Performance, shares: Array) -> Array:
        """Return the margins of one requirement, shape (n,)."""
        name = bound.name
        if name in ("force_z", "force_x"):
            axis = 0 if name == "force_z" else 1
            force = shares[:, axis] * bound.value
            covered = (result.reach if axis == 0 else result.range_x) >= 0.999 * force
            return np.where(covered, force - bound.value, np.nan)
        if name in ("no_saturation", "unique_decoding"):
            return result.margins[name]
        values = {
            "largest_strain": result.strain,
            "stability_margin": result.stable_to / result.depth,
        }
        value = values[name] if name in values else getattr(result, name)
        return np.asarray((value - bound.value) * (1 if bound.sense == "at least" else -1))


def conflict_of(
    groups: Sequence[Candidates], lasts: Sequence[Generation], progress: Progress | None = None
) -> Conflict | None:
    """Return a smallest set of requirements that conflicts; None if a candidate meets all.

    Parameters
    ----------
    groups, lasts : candidates, and the last generations of the searches that found none that meets all.
    """
    needed = groups[0].requirements
    bounds = bounds_of(needed)
    ratings = [_Ratings(group, bounds) for group in groups]
    random = np.random.default_rng(needed.seed)
    tables = []
    for rating, last in zip(ratings, lasts, strict=True):
        sampled = [np.column_stack([last.X, np.full((len(last.X), 2), share)]) for share in SAMPLED]
        sampled.append(_random((*rating.candidates.variables, *SHARES), 4 * len(last.X), random))
        tables.append(rating.margins(np.concatenate(sampled)))
    scale = np.array([max(abs(bound.value), 1e-9) for bound in bounds])
    count = 0

    def best(column: int, others: tuple[int, ...]) -> Array | None:
        nonlocal count
        count += 1
        if progress is not None:
            progress(min(0.1 * count, 0.95), f"which requirements conflict? search {count}")

        rows = [row for rating in ratings if (row := _best(rating, scale, column, others)) is not None]
        return max(rows, key=lambda row: float(row[column]), default=None)

    return find_conflict(bounds, np.concatenate(tables), best)


def _best(rating: _Ratings, scale: Array, column: int, others: tuple[int, ...]) -> Array | None:
    """Return the margins of the candidate with the largest margin of one requirement among those that meet others."""

    def evaluate(X: Array) -> tuple[Array, Array]:
        signed = np.nan_to_num(rating.margins(X) / scale, nan=-10.0)
        violation = np.log1p(np.maximum(-signed[:, list(others)], 0.0)).sum(axis=1)
        return -signed[:, [column]], violation[:, None]

    end = search((*rating.candidates.variables, *SHARES), evaluate, EFFORT)
    chosen = end.X[end.front[:1]]
    return rating.margins(chosen)[0] if len(chosen) else None


def _random(variables: tuple[Variable, ...], count: int, random: np.random.Generator) -> Array:
    """Return random values of variables, shape (count, m)."""
    columns = [
        random.integers(each.choices, size=count).astype(np.float64)
        if each.choices
        else random.uniform(each.low, each.high, count)
        for each in variables
    ]
    return np.column_stack(columns)
