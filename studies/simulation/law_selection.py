"""Choose a law for a uniaxial test, give the reasons against the others, and warn of the limits of each.

A law that misses the test gives wrong forces without a warning, while a law that becomes unstable ends a solve with a
message. The choice is therefore among the laws that are stable within the range of the test
(`law_regression.ranges`). Laws that fit the test come first, then those that are stable at the stretches
that solves reach, then the rank of `studies.simulation.law_regression`. The user may choose another law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from geometry.design import SILICONE_E, BadInput, Design
from studies.output import page_templates
from studies.simulation.law_regression import (
    MISFIT,
    MODES,
    RANGE,
    SMALL_STRAIN,
    SOLVE,
    Fit,
    nominal_stress,
    ranges_of_test,
    within,
)
from studies.simulation.tensile_test import STRESS, Specimen

Reason = Literal[
    "E_not_possible",
    "unstable_in_test",
    "misses_test",
    "unstable_in_solve",
    "number_at_bound",
    "ranks_lower",
    "another_asked_for",
]
sentences = partial(page_templates.sentences, Path(__file__).with_name("templates") / "fit.j2")

WRONG = 0.2
"""Rms error over the largest stress from which on a law does not describe the test at all, and is no design."""
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
    against : reasons against the choice; empty for the chosen law.
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
    """Return the laws of a test in their order, with at most one chosen.

    Parameters
    ----------
    asked : the law that the user chooses.

    Raises
    ------
    BadInput
        The test has too few points for the law asked for.
    """
    if asked is not None and asked not in {fit.law for fit in fits}:
        points = len(set(data.stretch[data.telling].tolist()))
        raise BadInput(
            f"the law {asked} has more constants than the test has distinct stretches ({points}): give more points, "
            f"or choose one of {', '.join(fit.law for fit in fits)}"
        )
    low, high = (Design.__dataclass_fields__["E"].metadata[end] for end in ("low", "high"))
    possible = [low <= fit.E <= high for fit in fits]
    in_test = [within(ranges_of_test(data.stretch), fit.stable) for fit in fits]
    able = [fit for fit, *good in zip(fits, possible, in_test, strict=True) if all(good) and fit.share <= WRONG]
    share = min((fit.share for fit in able), default=0.0) + MISFIT
    small = min((abs(fit.small) for fit in able), default=0.0) + SMALL_MISFIT
    misses = [fit.share > share or abs(fit.small) > small for fit in fits]
    in_solve = [within(SOLVE, fit.stable) for fit in fits]
    keys = [
        (missed, not stable, k)
        for k, (fit, missed, stable, fits_in) in enumerate(zip(fits, misses, in_solve, possible, strict=True))
        if fits_in and fit.share <= WRONG and (fit in able if asked is None else fit.law == asked)
    ]
    first = min(keys)[-1] if keys else None
    judged = []
    for k, fit in enumerate(fits):
        facts: list[tuple[Reason, bool]] = [
            ("E_not_possible", not possible[k]),
            ("unstable_in_test", not in_test[k]),
            ("misses_test", misses[k]),
            ("unstable_in_solve", not in_solve[k]),
            ("number_at_bound", bool(fit.bounded)),
            ("ranks_lower", first is not None and k > first),
            ("another_asked_for", asked is not None and fit.law != asked),
        ]
        against = () if k == first else tuple(reason for reason, holds in facts if holds)
        hit = [other for other, missed in zip(fits, misses, strict=True) if other in able and not missed]
        spread = max((abs(_pressed(other) / _pressed(fit) - 1) for other in hit), default=0.0)
        farther = next((other for other in hit if not other.bounded and _farther(other, fit)), None)
        judged.append(
            Judged(fit, k + 1, possible[k], in_test[k], in_solve[k], misses[k], spread, k == first, against, farther)
        )
    return judged


def _farther(other: Fit, fit: Fit) -> bool:
    """Return whether one law is stable wherever another one is, and beyond."""
    return within(fit.stable, other.stable) and not within(other.stable, fit.stable)


def _pressed(fit: Fit) -> float:
    """Return a law's stress at `PRESSED`, up to a factor common to all laws."""
    return fit.E * float(nominal_stress(fit.law, tuple(fit.numbers.values()), np.array(PRESSED)))


def warnings(judged: Judged, data: Specimen) -> list[str]:
    """Return warnings about the use of a law."""
    fit, spec = judged.fit, Design.__dataclass_fields__["E"].metadata
    units = {name.rpartition("_")[2]: fit.E * factor / STRESS[data.column] for name, factor in STRESS.items()}
    no_compression = data.stretch.min() > PRESSED and judged.spread > SPREAD
    return sentences(
        "law",
        fit=fit,
        possible=judged.possible,
        silicone=SILICONE_E,
        design=(spec["low"], spec["high"]),
        column=data.column,
        others=[(unit, E) for unit, E in units.items() if SILICONE_E[0] <= E <= SILICONE_E[1]],
        misfit=MISFIT,
        small_misfit=SMALL_MISFIT,
        small_strain=max(SMALL_STRAIN, data.least_strain),
        extrapolated=data.least_strain > SMALL_STRAIN,
        compression=PRESSED if no_compression else None,
        spread=judged.spread,
        in_test=judged.in_test,
        ends_early=not judged.in_test or not within({"planar": RANGE}, fit.stable),
        farther=judged.farther,
        whole=judged.farther is not None and within(dict.fromkeys(MODES, RANGE), judged.farther.stable),
        range=RANGE,
    )


def reasons(judged: Judged) -> str:
    """Return the reasons against a law; empty for the chosen one."""
    against = sentences("reasons", fit=judged.fit, against=judged.against, solve=SOLVE)
    return f"{judged.fit.law} is not chosen: {'; '.join(against)}" if against else ""
