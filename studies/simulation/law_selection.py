"""Choose a law for a uniaxial test, give the reasons against the others, and warn of the limits of each.

A law that misses the test gives wrong forces without a warning, while a law that becomes unstable ends a solve with a
message. The choice is therefore among the laws that are stable within the range of the test
(`law_regression.ranges`). Laws that fit the test come first, then those that are stable at the stretches
that solves reach, then the rank of `studies.simulation.law_regression`. The user may choose another law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from geometry.design import SILICONE_E, BadInput, Design
from studies.simulation.law_regression import (
    MISFIT,
    MODES,
    RANGE,
    SMALL_STRAIN,
    SOLVE,
    Fit,
    Ranges,
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
    fit, remarks = judged.fit, []
    if not judged.possible or not SILICONE_E[0] <= fit.E <= SILICONE_E[1]:
        remarks.append(_impossible(judged, data))
    if fit.share > MISFIT or abs(fit.small) > SMALL_MISFIT:
        remarks.append(
            f"{fit.law} fits the test poorly: its rms error is {100 * fit.share:.2g} % of the largest stress, "
            f"and up to {100 * max(SMALL_STRAIN, data.least_strain):.3g} % strain its stress is "
            f"{100 * abs(fit.small):.2g} % too {'large' if fit.small > 0 else 'small'}; forces may be off by as "
            "much"
        )
    if fit.exact:
        constants = f"{fit.constants} constant{'s' if fit.constants > 1 else ''}"
        remarks.append(
            f"{fit.law} has {constants} and the test as many points, so its error is zero by construction: measure "
            "more points"
        )
    if data.least_strain > SMALL_STRAIN:
        remarks.append(
            f"the smallest strain of the test is {100 * data.least_strain:.3g} %, so E (the stiffness at small "
            "strain) is extrapolated"
        )
    if data.stretch.min() > PRESSED and judged.spread > SPREAD:
        remarks.append(
            f"the test contains no compression: at a stretch of {PRESSED:g} other laws that fit the test differ from "
            f"{fit.law} by {100 * judged.spread:.3g} %, and press forces may be off by as much; test in "
            "compression too"
        )
    ends_early = not judged.in_test or not within({"planar": RANGE}, fit.stable)
    if not judged.in_test:
        low, high = fit.stable["uniaxial"]
        remarks.append(f"the test exceeds the stable range of {fit.law}, stretches from {low:.3g} to {high:.3g}")
    elif ends_early:
        remarks.append(
            f"{fit.law} is stable {_ends(fit.stable)}: at the magnet's edge a press to D/4 reaches a planar "
            "stretch of 2.7, a press to 3/8 D one of 4.3; a solve that stops there reports it"
        )
    if ends_early and judged.farther is not None:
        remarks.append(_what_is_farther(fit, judged.farther))
    if fit.bounded:
        where = " and ".join(f"{name} = {fit.numbers[name]:.4g}" for name in fit.bounded)
        remarks.append(f"{where} lies at a bound of the search, so it is not an optimum: the law is ranked last")
    return remarks


def _what_is_farther(fit: Fit, other: Fit) -> str:
    """Return a sentence on the law that is stable in a wider range, and on its misfit."""
    whole = within(dict.fromkeys(MODES, RANGE), other.stable)
    where = f"in all stretches from {RANGE[0]:g} to {RANGE[1]:g}" if whole else _ends(other.stable)
    return (
        f"{other.law} has an rms error of {100 * other.share:.2g} % ({fit.law}: {100 * fit.share:.2g} %) and is "
        f"stable {where}: --law {other.law} may allow deeper presses"
    )


def _impossible(judged: Judged, data: Specimen) -> str:
    """Return a sentence on an impossible E, and on the unit that would explain it."""
    fit, unit = judged.fit, data.column.rpartition("_")[2]
    if judged.possible:
        text = (
            f"is outside the range of silicones, {SILICONE_E[0]:g} MPa (gels) to {SILICONE_E[1]:g} MPa (Shore A 90)"
        )
    else:
        low, high = (Design.__dataclass_fields__["E"].metadata[end] for end in ("low", "high"))
        text = f"is outside the range of a design, {low:g} to {high:g} MPa"
    others = [
        f"; in {name.rpartition('_')[2]} E would be {value:.4g} MPa"
        for name, factor in STRESS.items()
        if SILICONE_E[0] <= (value := fit.E * factor / STRESS[data.column]) <= SILICONE_E[1]
    ]
    check = f"check that the column {data.column} is in {unit}{''.join(others)}"
    return f"{fit.law}: E = {fit.E:.4g} MPa {text}: {check}"


def _ends(stable: Ranges) -> str:
    """Format the stable range of each mode."""
    return ", ".join(f"{mode} {low:.3g} to {high:.3g}" for mode, (low, high) in stable.items())


def reasons(judged: Judged) -> str:
    """Return the reasons against a law; empty for the chosen one."""
    fit = judged.fit
    texts: dict[Reason, str] = {
        "E_not_possible": "its E is outside the range of a design",
        "unstable_in_test": "it is unstable at some of the test's stretches",
        "misses_test": (f"its rms error is {100 * fit.share:.3g} % ({abs(100 * fit.small):.3g} % at small strain)"),
        "unstable_in_solve": (f"it is stable {_ends(fit.stable)}, but a press to 3/8 D reaches {_ends(SOLVE)}"),
        "number_at_bound": f"{', '.join(fit.bounded)} lies at a bound of the search",
        "ranks_lower": "it ranks lower",
        "another_asked_for": "--law chooses another law",
    }
    against = [texts[reason] for reason in judged.against]
    return f"{fit.law} is not chosen: {'; '.join(against)}" if against else ""
