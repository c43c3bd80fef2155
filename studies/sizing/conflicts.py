"""Contradictory requirements: a smallest set that no variant meets, and by how much each member would have to give.

Each row of the array of margins, shape (n, m), is a variant that is rated for one force range; each column is a
requirement. A margin is the distance to the bound in the requirement's unit, 0 or more where it is met and NaN
where it is unknown, which counts as not met. The range is a requirement like any other: one variant gives rows for
several ranges, and a row for 0.8 of a range of 20 N has the margin -4 N there and its other margins at 16 N. So
"range 20 N and strain 40 %" is a set of two, and each of them can give.

A set conflicts if no row meets all of it. A set with the least number of members is found by enumeration; all its
proper subsets are met by some row, so it is also minimal (an irreducible inconsistent subset: Chinneck, Feasibility
and Infeasibility in Optimization, Springer 2008). Member i gives the least -margin_i of the rows that meet the
others. Rows are samples, so a give is an upper bound, and a conflict may vanish between them: a callback searches
for better rows.

In a sizing (`conflict_of`), each row is a candidate that is rated for shares of the required ranges in z and in x.
Between the samples, `front_search` looks for the best margin of one requirement among the candidates that meet
others.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput
from geometry.messages import Progress
from studies.sizing.candidate_performance import Performance, performance
from studies.sizing.front_search import Effort, Generation, Variable, search
from studies.sizing.requirements import LIMITS, Requirements
from studies.sizing.variant_search import Candidates, beams_of

Sense = Literal["at least", "at most", "switch"]
SENSES: dict[str, Sense] = {
    "force_z": "at least",
    "force_x": "at least",
    "resolution_z": "at most",
    "resolution_x": "at most",
    "largest_strain": "at most",
    "stability_margin": "at least",
    "first_mode": "at least",
    "outer_size": "at most",
    "height": "at most",
    "wall": "at least",
    "no_saturation": "switch",
    "unique_decoding": "switch",
}
"""Requirements in the order of the columns of margins, and in which direction they bound a variant."""
MOST = 16
"""Largest number of requirements, so that all their subsets can be enumerated."""

Best = Callable[[int, tuple[int, ...]], Array | None]
"""Returns the margins, shape (m,), of the variant and range with the largest margin of one requirement among those
that meet some others; takes the column of the one and those of the others. None if none is found."""


@dataclass(frozen=True, slots=True)
class Bound:
    """A requirement that is set: its name, value, unit (N, mm, Hz or 1) and direction."""

    name: str
    value: float
    unit: str
    sense: Sense

    def amount(self, value: float) -> str:
        """Return a value of this requirement as a text with its unit.

        >>> Bound("largest_strain", 0.4, "1", "at most").amount(0.49)
        '49 %'
        """
        if self.name == "largest_strain":
            return f"{100 * value:.4g} %"
        if self.unit == "N" and abs(value) < 0.1:
            return f"{1000 * value:.4g} mN"
        return f"{value:.4g}" + ("" if self.unit == "1" else f" {self.unit}")

    def wanted(self) -> str:
        """Return the requirement as a text, such as "force_z of at least 5 N"."""
        return self.name if self.sense == "switch" else f"{self.name} of {self.sense} {self.amount(self.value)}"

    def relaxed(self, give: float) -> str:
        """Return what the requirement becomes if it gives; a give is rounded up, so that the text is enough."""
        if not math.isfinite(give):
            return f"{self.name} gives more than the search covers"
        if self.sense == "switch":
            return f"{self.name} is left out"
        step = rounded_up(give)
        rises = self.sense == "at most"
        value = self.value + step if rises else self.value - step
        points = f"{100 * step:.4g} percentage points" if self.name == "largest_strain" else self.amount(step)
        return f"{self.name} {'rises' if rises else 'falls'} by {points} to {self.amount(value)}"


@dataclass(frozen=True, slots=True)
class Conflict:
    """A smallest set of requirements that no variant meets.

    Attributes
    ----------
    members : the requirements of the set.
    gives : by how much each alone would have to give so that the set can be met, in its unit; inf if unknown.
    gives_of_all : the same so that all requirements can be met; inf where another conflict remains.
    others : names of the other conflicting sets of the same size.
    """

    members: tuple[Bound, ...]
    gives: tuple[float, ...]
    gives_of_all: tuple[float, ...]
    others: tuple[tuple[str, ...], ...]

    def sentence(self) -> str:
        """State the conflict, and what each member would have to give."""
        wanted = " together with ".join(member.wanted() for member in self.members)
        ways = [member.relaxed(give) for member, give in zip(self.members, self.gives, strict=True)]
        choices = f": either {', or '.join(ways)}" if len(ways) > 1 else f", unless {ways[0]}"
        text = f"no variant meets {wanted}{choices}"
        return text if any(map(math.isfinite, self.gives_of_all)) else f"{text}; further requirements conflict too"

    def rows(self) -> list[dict[str, object]]:
        """Return a row for each member."""
        return [
            {
                "requirement": member.name,
                "value": member.value,
                "unit": member.unit,
                "gives": give if math.isfinite(give) else None,
                "gives_of_all": of_all if math.isfinite(of_all) else None,
            }
            for member, give, of_all in zip(self.members, self.gives, self.gives_of_all, strict=True)
        ]


def bounds_of(requirements: Requirements) -> tuple[Bound, ...]:
    """Return the requirements that are set, in the order of the columns of margins.

    The process sets a wall where the requirements do not.

    >>> [bound.name for bound in bounds_of(Requirements(force_z=5.0, largest_strain=0.4, unique_decoding=False))]
    ['force_z', 'largest_strain', 'stability_margin', 'wall', 'no_saturation']
    """
    bounds = []
    for name, sense in SENSES.items():
        value = requirements.printed_wall if name == "wall" else getattr(requirements, name)
        if value is not None and value is not False:
            unit = LIMITS[name].metadata["unit"] if name in LIMITS else "1"
            bounds.append(Bound(name, float(value), unit, sense))
    return tuple(bounds)


def smallest_conflicts(margins: Array) -> list[tuple[int, ...]]:
    """Return all sets of columns with the least number of members that no row meets; none if a row meets all.

    Parameters
    ----------
    margins : shape (n, m), met where 0 or more; a NaN is not met.

    >>> smallest_conflicts(np.array([[1.0, -1.0, 2.0], [-1.0, 1.0, 2.0]]))
    [(0, 1)]
    """
    count = margins.shape[1]
    if count > MOST:
        raise BadInput(f"a conflict is sought among at most {MOST} requirements; got {count}")
    # rows that meet the same requirements are one: at most 2^m masks remain, whatever the number of rows
    masks = np.unique((margins >= 0) @ (1 << np.arange(count)))
    for size in range(1, count + 1):
        sets = [(columns, sum(1 << k for k in columns)) for columns in itertools.combinations(range(count), size)]
        conflicting = [columns for columns, mask in sets if not ((masks & mask) == mask).any()]
        if conflicting:
            return conflicting
    return []


def least_give(margins: Array, column: int, others: Sequence[int]) -> float:
    """Return by how much a requirement must give so that a row meets it and the others; inf if none meets the others.

    Parameters
    ----------
    margins : shape (n, m).
    column, others : columns of the requirement and of the others.
    """
    rows = (margins[:, list(others)] >= 0).all(axis=1) & ~np.isnan(margins[:, column])
    return max(0.0, -float(margins[rows, column].max())) if rows.any() else math.inf


def find_conflict(bounds: Sequence[Bound], margins: Array, best: Best | None = None) -> Conflict | None:
    """Return a smallest set of requirements that no variant meets; None if a variant meets all.

    Parameters
    ----------
    bounds : the m requirements.
    margins : of sampled variants and ranges, shape (n, m).
    best : searches between the samples; default: the samples alone count.
    """
    rows, searched = np.asarray(margins, dtype=np.float64), set()
    every = tuple(range(len(bounds)))
    while sets := smallest_conflicts(rows):
        columns = sets[0]
        # one search in the set, one with all requirements met: each may also show that the set can be met
        tasks = [(k, tuple(other for other in group if other != k)) for k in columns for group in (columns, every)]
        new = [task for task in dict.fromkeys(tasks) if task not in searched]
        if best is None or not new:
            return _conflict(bounds, rows, sets)
        searched |= set(new)
        better = [row for task in new if (row := best(*task)) is not None]
        rows = np.vstack([rows, *better])
    return None


def _conflict(bounds: Sequence[Bound], rows: Array, sets: Sequence[tuple[int, ...]]) -> Conflict:
    """Return the first of the conflicting sets, with its gives."""
    columns, every = sets[0], range(len(bounds))
    return Conflict(
        tuple(bounds[k] for k in columns),
        tuple(least_give(rows, k, [other for other in columns if other != k]) for k in columns),
        tuple(least_give(rows, k, [other for other in every if other != k]) for k in columns),
        tuple(tuple(bounds[k].name for k in others) for others in sets[1:]),
    )


def rounded_up(value: float, digits: int = 2) -> float:
    """Return the least number with few digits that is not below a value of 0 or more.

    >>> rounded_up(3.02), rounded_up(0.09), rounded_up(3.1), rounded_up(0.0)
    (3.1, 0.09, 3.1, 0.0)
    """
    if value == 0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    # a value that is such a number but for rounding must not grow by a unit
    return float(f"{math.ceil(value / unit - 1e-9) * unit:.{digits}g}")


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
