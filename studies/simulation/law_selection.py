"""Which law of a uniaxial test is chosen, and what speaks against the others.

A law that misses the test gives wrong forces in silence; one that loses its stability ends a solve, which says so. So
the law is chosen among those that are stable where the test has been (`studies.simulation.law_stability`): first come
those that do not miss what another of them hits, then those that are stable where solves go, then the rank of
`studies.simulation.law_regression`. The user may choose another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.design import BadInput, Design
from studies.simulation.law_regression import MISFIT, Fit, nominal_stress
from studies.simulation.law_stability import SOLVE, ranges_of_test, within
from studies.simulation.tensile_test import Specimen

Reason = Literal[
    "E_not_possible",
    "unstable_in_test",
    "misses_test",
    "unstable_in_solve",
    "number_at_bound",
    "ranks_lower",
    "another_asked_for",
]

SMALL_MISFIT = 0.05
"""Relative error of the stress at small strain that is worth a warning: forces are in proportion to it, and solves
with a right law err by less than a tenth of that."""

PRESSED = 0.7
"""Stretch of a uniaxial compression that a press to D/8 (1 mm) comes to: 99 % of the silicone stays above 0.74."""

SPREAD = 0.05
"""Relative difference of laws that hit the test, at `PRESSED`, that is worth a warning, as `SMALL_MISFIT`."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A law of a test, and what speaks for and against it.

    Attributes
    ----------
    misses : whether it leaves more of the test than another law that may be chosen, by `MISFIT` or `SMALL_MISFIT`.
    spread : how far, relative to this law's stress at `PRESSED`, those of other laws that hit the test are off it.
    against : why it is not chosen; empty for the one that is.
    farther : the best other law that hits the test and is stable wherever this one is and farther; None without.
    """

    fit: Fit
    rank: int
    possible: bool
    in_test: bool
    in_solve: bool
    misses: bool
    spread: float
    chosen: bool
    against: tuple[Reason, ...]
    farther: Fit | None


def choose(fits: Sequence[Fit], data: Specimen, asked: str | None = None) -> list[Judged]:
    """The laws of a test in their order, with at most one chosen.

    Parameters
    ----------
    asked : the law that the user chooses.

    Raises
    ------
    BadInput
        The test has too few points for the law asked for.
    """
    if asked is not None and asked not in {found.law for found in fits}:
        points = len(set(data.stretch[data.telling].tolist()))
        raise BadInput(
            f"the law {asked} has more constants than the test has distinct stretches ({points}): give more points, "
            f"or choose one of {', '.join(found.law for found in fits)}"
        )
    low, high = (Design.__dataclass_fields__["E"].metadata[end] for end in ("low", "high"))
    possible = [low <= found.E <= high for found in fits]
    in_test = [within(ranges_of_test(data.stretch), found.stable) for found in fits]
    able = [found for found, *good in zip(fits, possible, in_test, strict=True) if all(good)]
    share = min((found.share for found in able), default=0.0) + MISFIT
    small = min((abs(found.small) for found in able), default=0.0) + SMALL_MISFIT
    misses = [found.share > share or abs(found.small) > small for found in fits]
    in_solve = [within(SOLVE, found.stable) for found in fits]
    keys = [
        (missed, not stable, k)
        for k, (found, missed, stable, fits_in) in enumerate(zip(fits, misses, in_solve, possible, strict=True))
        if fits_in and (found in able if asked is None else found.law == asked)
    ]
    first = min(keys)[-1] if keys else None
    judged = []
    for k, found in enumerate(fits):
        facts: list[tuple[Reason, bool]] = [
            ("E_not_possible", not possible[k]),
            ("unstable_in_test", not in_test[k]),
            ("misses_test", misses[k]),
            ("unstable_in_solve", not in_solve[k]),
            ("number_at_bound", bool(found.bounded)),
            ("ranks_lower", first is not None and k > first),
            ("another_asked_for", asked is not None and found.law != asked),
        ]
        against = () if k == first else tuple(reason for reason, holds in facts if holds)
        hit = [other for other, missed in zip(fits, misses, strict=True) if other in able and not missed]
        spread = max((abs(_pressed(other) / _pressed(found) - 1) for other in hit), default=0.0)
        farther = next((other for other in hit if not other.bounded and _farther(other, found)), None)
        judged.append(
            Judged(
                found, k + 1, possible[k], in_test[k], in_solve[k], misses[k], spread, k == first, against, farther
            )
        )
    return judged


def _farther(other: Fit, found: Fit) -> bool:
    """Whether one law is stable wherever another one is, and beyond."""
    return within(found.stable, other.stable) and not within(other.stable, found.stable)


def _pressed(found: Fit) -> float:
    """A law's stress at `PRESSED`, to a factor that all laws have in common."""
    return found.E * float(nominal_stress(found.law, tuple(found.numbers.values()), np.array(PRESSED)))
