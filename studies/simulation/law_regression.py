"""Fit every law to a uniaxial test by least squares, and rank the fits.

The specimen is incompressible with free sides, which gives the nominal stress in closed form. All points have the
same weight in nominal stress. Each law has several forms (`FORMS`: Yeoh with two terms or three, Ogden with one or
two). A form is fitted if it has no more constants, E included, than the test has points at different stretches. The
largest form represents its law, unless a share of 0 reduces it to the smaller one. Laws are ranked by Akaike's
corrected criterion for n points and k parameters, one of which is the standard deviation of the noise,

    AICc = n ln(SSE / n) + 2 k + 2 k (k + 1) / (n - k - 1),

which assumes independent errors: a slow drift of the machine makes the larger laws look better than they are.

- Residuals, and differences of residuals, below 1e-9 of the largest stress are rounding and count as 0.
- Points at stretch 1, where every law has the stress 0, do not count.
- Laws within 2 of the least AICc are equally good; those with fewer constants come first.
- Of tied fits, the one that is stable in wider ranges comes first, then the one that `geometry.design.LAWS` lists
  first.
- If the criterion is undefined for a form (n <= k + 1), as for the two or three values of a data sheet, it ranks no
  law. Forms with a residual of at most 2 % of the largest stress then come first, the fewest constants first; the
  others follow by their residual. The best form represents its law.
- A law with a number at a bound of the search is not at an optimum and ranks last.

Ranges of homogeneous stretches (`ranges`) tell where a law is stable. The body is incompressible and free of stress
in its last direction. A law is called stable at such a stretch if it is so in Drucker's sense
(`fem.results.silicone_limits`), and dP : dF > 0 along the mode itself, so that the nominal stress still rises.

`choose` takes a law that is stable within the range of the test: in each mode, at all stretches whose principal
stretches the specimen had (`ranges_of_test`). A law that misses the test gives wrong forces without a warning, while
one that becomes unstable ends a solve with a message: those that fit the test come first, then those that are stable
at the stretches that solves reach (`SOLVE`), then the rank.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem.model.material import law
from fem.results import silicone_limits
from geometry.arrays import Array
from geometry.design import LAWS, LEAST_ALPHA, SILICONE_E, BadInput, Design
from studies.output import page_templates
from studies.output.records import FlatRow
from studies.simulation.material_tests import STRESS, TRUE_STRESS, Specimen

Criterion = Literal["AICc", "fewest constants"]

sentences = partial(page_templates.sentences, Path(__file__).with_name("templates") / "fit.j2")
STANDARD = Design()

EXACT = 1e-9
"""Residual over the largest stress that counts as rounding."""

MISFIT = 0.02
"""Root mean square of the residual over the largest stress that is worth a warning: tests of one silicone differ by
more, and the mesh errs by less."""

ALIKE = 2.0
"""Difference in AICc below which two laws count as equally good (Burnham and Anderson 2002, section 2.6)."""

SMALL_STRAIN = 0.25
"""Strain up to which a test shows the stiffness at small strain: 99 % of the silicone in the paper's sensor stays
within it in a press to D/8 (1 mm)."""

AT_BOUND = 1e-6
"""Distance of a number from its bound, over its range, that counts as none if it makes no difference."""


class Form(NamedTuple):
    """A law with the names of the numbers that are fitted besides E, and values at which their search starts."""

    law: str
    free: tuple[str, ...]
    starts: tuple[tuple[float, ...], ...]


FORMS = (
    Form("neo-hookean", (), ((),)),
    Form("mooney-rivlin", ("mooney_share",), ((0.5,), (0.1,), (0.9,))),
    Form("yeoh", ("yeoh_2",), ((0.0,), (0.1,), (-0.05,))),
    Form("yeoh", ("yeoh_2", "yeoh_3"), ((0.0, 0.0), (0.1, 0.01), (-0.1, 0.01))),
    Form("ogden", ("ogden_alpha1",), ((2.5,), (1.0,), (8.0,), (-3.0,))),
    Form(
        "ogden",
        ("ogden_alpha1", "ogden_alpha2", "ogden_share"),
        (
            (2.5, -2.5, 0.5),
            (1.5, 5.0, 0.1),
            (8.0, -2.0, 0.5),
            (3.0, 1.0, 0.5),
            (12.0, 2.0, 0.9),
            (4.0, -8.0, 0.3),
        ),
    ),
)


@dataclass(frozen=True, slots=True)
class Fit:
    """One law fitted to a test.

    Attributes
    ----------
    constants : number of fitted constants, E included.
    exact : True if the test has no more points than that, so that the residual has no meaning.
    rms, share : root mean square of the residual, MPa, and that over the largest stress.
    small : what the law's stress up to `SMALL_STRAIN` has over the test's, relative (`excess`).
    stable : least and largest stretch of each mode between which the law is stable, 1 among them.
    bounded : names of the numbers that ended at a bound of the search.
    """

    law: str
    E: float
    numbers: dict[str, float]
    constants: int
    exact: bool
    rms: float
    share: float
    small: float
    aicc: float | None
    criterion: Criterion
    stable: Ranges
    bounded: tuple[str, ...]


def nominal_stress(name: str, numbers: tuple[float, ...], stretch: Array) -> Array:
    """Nominal stress over mu of an incompressible bar, shape of `stretch`.

    >>> float(nominal_stress("neo-hookean", (), np.array(2.0)))
    1.75
    """
    if name == "ogden":
        a1, a2, share = numbers
        return (1 - share) * _ogden_term(a1, stretch) + share * _ogden_term(a2, stretch)
    x = stretch**2 + 2 / stretch - 3
    slope = np.ones_like(stretch)
    if name == "mooney-rivlin":
        slope = 1 - numbers[0] + numbers[0] / stretch
    elif name == "yeoh":
        slope = 1 + 2 * numbers[0] * x + 3 * numbers[1] * x**2
    return np.asarray(slope * (stretch - stretch**-2))


def _ogden_term(alpha: float, stretch: Array) -> Array:
    """2 / alpha (l^(alpha - 1) - l^(-alpha / 2 - 1)), also near alpha = 0."""
    h = np.log(stretch)
    if abs(alpha) < 1e-8:
        return np.asarray(3 * h / stretch)
    return np.asarray(4 / alpha * np.exp(alpha * h / 4) * np.sinh(0.75 * alpha * h) / stretch)


def fit(data: Specimen, nu: float = 0.4998) -> list[Fit]:
    """Every law that has no more constants than the test has points, in its better form, the best first."""
    if not 0.49 <= nu <= 0.5:
        raise BadInput(
            f"--nu must lie between 0.49 and 0.5, because the fit assumes an incompressible specimen; got {nu:g}"
        )
    unit = nominal_stress("neo-hookean", (), data.stretch)
    mu = float(unit @ data.stress) / float(unit @ unit)
    if not mu > 0:
        raise BadInput("the stress decreases while the stretch increases: tension must be positive in both columns")
    telling = data.stretch[data.telling]
    most = len(set(telling.tolist()))
    forms = [form for form in FORMS if len(form.free) < most]
    defined = all(len(telling) > len(form.free) + 3 for form in forms)
    criterion: Criterion = "AICc" if defined else "fewest constants"
    best: dict[str, Fit] = {}
    for form in reversed(forms):
        found = _fitted(form, data, mu, nu, most, criterion)
        other = best.get(found.law)
        # a form with a number at a bound, such as a share of 0, equals one with fewer constants
        same = other is not None and bool(other.bounded) and found.rms <= other.rms * (1 + 1e-6)
        if other is None or (same if defined else _order(found, None) < _order(other, None)):
            best[found.law] = found
    least = min((found.aicc for found in best.values() if found.aicc is not None and not found.bounded), default=None)
    return sorted(best.values(), key=lambda found: _order(found, least if defined else None))


def _order(found: Fit, least: float | None) -> tuple[float, ...]:
    """Sorts fits, the best first; `least` is the least AICc, None where they are not sorted by it."""
    width = round(sum(math.log(high / low) for low, high in found.stable.values()), 9)
    last, ties = float(bool(found.bounded)), (-width, list(LAWS).index(found.law))
    if least is not None and found.aicc is not None:
        alike = found.aicc <= least + ALIKE
        return (last, 0, found.constants, found.aicc, *ties) if alike else (last, 1, found.aicc, *ties)
    share = round(found.share / EXACT)
    if found.share <= MISFIT:
        return (last, 0, found.constants, share, *ties)
    return (last, 1, share, found.constants, *ties)


def _fitted(form: Form, data: Specimen, mu: float, nu: float, most: int, criterion: Criterion) -> Fit:
    from scipy.optimize import least_squares

    largest = float(np.abs(data.stress).max())
    specs = [Design.__dataclass_fields__[name].metadata for name in form.free]
    low, high = np.array([(1e-3, 1e3), *((spec["low"], spec["high"]) for spec in specs)]).T

    def residual(x: Array) -> Array:
        model = x[0] * mu * nominal_stress(form.law, _whole(form, x[1:].tolist()), data.stretch)
        return np.asarray((model - data.stress) / largest)

    tight: dict[str, Any] = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15, "max_nfev": 300}
    tries = [
        least_squares(
            residual, (1.0, *start), bounds=(low, high), jac="3-point", method="dogbox", x_scale="jac", **tight
        )
        for start in form.starts
    ]
    x = np.array(min(tries, key=lambda found: found.cost).x)
    x[1:] = _tidy(form, x[1:].tolist())
    at_end = np.minimum(x - low, high - x) <= AT_BOUND * (high - low)
    at_end[0] = False
    moved = np.where(at_end, np.clip(np.round(x), low, high), x)
    # a share of 1e-7 is no bound where the term's exponent makes it large
    bounded = at_end & (np.linalg.norm(residual(moved)) <= np.linalg.norm(residual(x)) * (1 + 1e-6))
    x = np.where(bounded, moved, x)
    values, left = _whole(form, x[1:].tolist()), residual(x)
    rms = _without_rounding(float(np.sqrt(np.mean(left**2))))
    telling = float(np.sqrt(np.mean(left[data.telling] ** 2)))
    near, constants = data.near(SMALL_STRAIN), len(form.free) + 1
    return Fit(
        law=form.law,
        E=2 * (1 + nu) * float(x[0]) * mu,
        numbers=dict(zip(LAWS[form.law], values, strict=True)),
        constants=constants,
        exact=constants >= most,
        rms=largest * rms,
        share=rms,
        small=_without_rounding(excess(largest * left[near], data.stress[near])),
        aicc=aicc(int(data.telling.sum()), constants + 1, max(telling, EXACT)),
        criterion=criterion,
        stable=ranges(form.law, values, ranges_of_test(data.stretch)),
        bounded=tuple(name for name, is_bounded in zip(form.free, bounded[1:], strict=True) if is_bounded),
    )


def _without_rounding(value: float) -> float:
    return value if abs(value) > EXACT else 0.0


def excess(left: Array, stress: Array) -> float:
    """Return the relative excess of a law's stress over the test's (n,): what is left, projected on the latter.

    >>> excess(np.array([0.1, 0.2]), np.array([1.0, 2.0]))
    0.1
    """
    size = float(stress @ stress)
    return float(left @ stress) / size if size else 0.0


def _whole(form: Form, free: list[float]) -> tuple[float, ...]:
    given = dict(zip(form.free, free, strict=True))
    return tuple(given.get(name, getattr(STANDARD, name)) for name in LAWS[form.law])


def _tidy(form: Form, numbers: list[float]) -> list[float]:
    """Order Ogden's terms by exponent, the larger first, and keep exponents off 0, which `Design` refuses."""
    if form.law != "ogden":
        return numbers
    alphas = [math.copysign(max(abs(alpha), LEAST_ALPHA), alpha) for alpha in numbers[:2]]
    if len(alphas) == 1 or alphas[0] >= alphas[1]:
        return [*alphas, *numbers[2:]]
    return [alphas[1], alphas[0], 1 - numbers[2]]


def aicc(n: int, k: int, rms: float) -> float | None:
    """Return Akaike's corrected criterion of n points and k parameters; None for n <= k + 1.

    >>> aicc(10, 2, 1.0)
    5.714285714285714
    """
    return None if n <= k + 1 else 2 * n * math.log(rms) + 2 * k + 2 * k * (k + 1) / (n - k - 1)


# Stable stretches

Ranges = dict[str, tuple[float, float]]

MODES = {"uniaxial": (1.0, -0.5, -0.5), "equibiaxial": (1.0, 1.0, -2.0), "planar": (1.0, 0.0, -1.0)}
"""Logarithmic strains of each mode over that of its first direction; the last direction is free of stress."""

RANGE = (0.3, 4.0)
"""Stretches between which stability is looked for. Single points at the magnet's rounded edge come close to that: in
a press of the paper's sensor to D/4 they reach 2.7 by 0.33, and to 3/8 D 4.3 by 0.18, nearly planar."""

SOLVE: Ranges = {"uniaxial": (0.39, 1.26), "equibiaxial": (0.89, 1.6), "planar": (0.41, 2.3)}
"""Stretches of all but a thousandth of the silicone, next to each mode, in a press of the paper's sensor to 3/8 D (3
mm, neo-Hookean, accuracy standard); in a press to D/4 (2 mm) 0.52 to 1.18, 0.92 to 1.38 and 0.59 to 1.64.
`tests/test_diagnostics.py` measures them at the points of integration."""

STEPS = 400
"""Number of stretches between 1 and each end of the range at which stability is checked."""


def ranges_of_test(stretch: Array) -> Ranges:
    """Return the stretches of each mode whose principal stretches the specimen of a uniaxial test (n,) had.

    >>> {mode: tuple(round(end, 3) for end in ends) for mode, ends in ranges_of_test(np.array([1.0, 2.0])).items()}
    {'uniaxial': (0.707, 2.0), 'equibiaxial': (0.707, 1.189), 'planar': (0.707, 1.414)}
    """
    h = np.log(stretch)[:, None] * np.array(MODES["uniaxial"])
    low, high = min(float(h.min()), 0.0), max(float(h.max()), 0.0)
    found = {}
    for mode, strains in MODES.items():
        up = min(high / s if s > 0 else low / s for s in strains if s)
        down = max(low / s if s > 0 else high / s for s in strains if s)
        found[mode] = (math.exp(down), math.exp(up))
    return found


def ranges(name: str, numbers: tuple[float, ...], also: Ranges | None = None) -> Ranges:
    """Return the stretches around 1 between which the law is stable in each of `MODES`, within `RANGE` and `also`.

    >>> ranges("neo-hookean", ())["planar"]
    (0.3, 4.0)
    """
    found = {}
    for mode, strains in MODES.items():
        low, high = (also or {}).get(mode, RANGE)
        reached = []
        for end in (min(RANGE[0], low), max(RANGE[1], high)):
            stretch = np.exp(np.linspace(0, math.log(end), STEPS))
            stretch[-1] = end
            good = stable(name, numbers, stretch, np.array(strains))
            last = len(good) - 1 if good.all() else max(int(np.argmin(good)) - 1, 0)
            reached.append(float(stretch[last]))
        found[mode] = (reached[0], reached[1])
    return found


def within(wanted: Ranges, stable: Ranges) -> bool:
    """Return whether the wanted stretches lie within the stable ones, up to rounding.

    >>> within({"planar": (0.5, 2.0)}, {"planar": (0.3, 1.9)})
    False
    """
    return all(
        stable[mode][0] <= low * (1 + 1e-12) and high <= stable[mode][1] * (1 + 1e-12)
        for mode, (low, high) in wanted.items()
    )


def stable(name: str, numbers: tuple[float, ...], stretch: Array, strains: Array) -> NDArray[np.bool_]:
    """Return whether the law is stable at stretches, shape (n,), of a mode; strains (3,) are over log(stretch)."""
    tau, D = silicone_limits.stress_and_stiffness(law(name, numbers), np.log(stretch)[:, None] * strains)
    # the pressure that makes the stress in the last direction zero
    tau = tau - tau[:, 2:]
    along = (D @ strains) @ strains - tau @ strains**2
    return np.asarray((silicone_limits.least_stiffness(D) > 0) & (along > 0))


# Choice of a law

WRONG = 0.2
"""Rms error over the largest stress from which on a law does not describe the test at all, and is no design."""
SMALL_MISFIT = 0.05
"""Relative error of the stress at small strain that is worth a warning: forces are in proportion to it, and solves
with a right law err by less than a tenth of that."""

PRESSED = 0.7
"""Stretch of a uniaxial compression that a press to D/8 (1 mm) comes to: 99 % of the silicone stays above 0.74."""

SPREAD = 0.05
"""Relative difference of laws that hit the test, at `PRESSED`, that is worth a warning, as `SMALL_MISFIT`."""


def choose(fits: Sequence[Fit], data: Specimen, asked: str | None = None) -> list[FlatRow]:
    """Return the record of each law of a test in their order, with at most one chosen.

    A law misses the test if it leaves more of it than another law that may be chosen, by `MISFIT` or `SMALL_MISFIT`.

    compression_spread_percent : how far, relative to this law's stress at `PRESSED`, other laws that hit the test are
        off it.
    stable_farther : the best other law that hits the test and is stable wherever this one is and farther.

    Parameters
    ----------
    asked : the law that the user chooses.
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
    in_solve = [within(SOLVE, fit.stable) for fit in fits]
    able = [fit for fit, *good in zip(fits, possible, in_test, strict=True) if all(good) and fit.share <= WRONG]
    share = min((fit.share for fit in able), default=0.0) + MISFIT
    small = min((abs(fit.small) for fit in able), default=0.0) + SMALL_MISFIT
    misses = [fit.share > share or abs(fit.small) > small for fit in fits]
    hit = [fit for fit, missed in zip(fits, misses, strict=True) if fit in able and not missed]
    keys = [
        (misses[k], not in_solve[k], k)
        for k, fit in enumerate(fits)
        if possible[k] and fit.share <= WRONG and (fit in able if asked is None else fit.law == asked)
    ]
    first = min(keys)[-1] if keys else None
    records = []
    for k, fit in enumerate(fits):
        facts = {
            "E_not_possible": not possible[k],
            "unstable_in_test": not in_test[k],
            "misses_test": misses[k],
            "unstable_in_solve": not in_solve[k],
            "number_at_bound": bool(fit.bounded),
            "ranks_lower": first is not None and k > first,
            "another_asked_for": asked is not None and fit.law != asked,
        }
        against = [reason for reason, holds in facts.items() if holds and k != first]
        spread = max((abs(_pressed(other) / _pressed(fit) - 1) for other in hit), default=0.0)
        farther = next((o for o in hit if not o.bounded and _farther(o, fit)), None)
        warned = _warnings(fit, data, spread, farther, possible=possible[k], in_test=in_test[k])
        records.append({
            "rank": k + 1,
            "law": fit.law,
            "chosen": k == first,
            "AICc": fit.aicc,
            "rms_MPa": fit.rms,
            "rms_percent": 100 * fit.share,
            "E_MPa": fit.E,
            "numbers": fit.numbers,
            **{f"stable_{mode}": list(ends) for mode, ends in fit.stable.items()},
            "small_strain_excess_percent": 100 * fit.small,
            "compression_spread_percent": 100 * spread,
            "constants": fit.constants,
            "points": int(data.telling.sum()),
            "exactly_determined": fit.exact,
            "least_strain_percent": 100 * data.least_strain,
            "ranked_by": fit.criterion,
            "at_bound": list(fit.bounded),
            "stable_in_test": in_test[k],
            "stable_in_solve": in_solve[k],
            "E_of_a_silicone": SILICONE_E[0] <= fit.E <= SILICONE_E[1],
            "not_chosen_because": against,
            "stable_farther": farther.law if farther else None,
            "warnings": warned,
            "warning": "; ".join(warned),
        })  # fmt: skip
    return records


def _farther(other: Fit, fit: Fit) -> bool:
    return within(fit.stable, other.stable) and not within(other.stable, fit.stable)


def _pressed(fit: Fit) -> float:
    return fit.E * float(nominal_stress(fit.law, tuple(fit.numbers.values()), np.array(PRESSED)))


def _warnings(
    fit: Fit, data: Specimen, spread: float, farther: Fit | None, *, possible: bool, in_test: bool
) -> list[str]:
    spec = Design.__dataclass_fields__["E"].metadata
    stated = (STRESS | TRUE_STRESS)[data.column]
    units = {name.rpartition("_")[2]: fit.E * factor / stated for name, factor in STRESS.items()}
    no_compression = data.stretch.min() > PRESSED and spread > SPREAD
    return sentences(
        "law",
        fit=fit,
        possible=possible,
        silicone=SILICONE_E,
        design=(spec["low"], spec["high"]),
        column=data.column,
        others=[(unit, E) for unit, E in units.items() if SILICONE_E[0] <= E <= SILICONE_E[1]],
        misfit=MISFIT,
        small_misfit=SMALL_MISFIT,
        small_strain=max(SMALL_STRAIN, data.least_strain),
        extrapolated=data.least_strain > SMALL_STRAIN,
        compression=PRESSED if no_compression else None,
        compressed=data.stretch.min(),
        spread=spread,
        in_test=in_test,
        ends_early=not in_test or not within({"planar": RANGE}, fit.stable),
        farther=farther,
        whole=farther is not None and within(dict.fromkeys(MODES, RANGE), farther.stable),
        range=RANGE,
    )


def reasons(record: FlatRow) -> str:
    """Return the reasons against a law; empty for the chosen one."""
    stable = {mode: record[f"stable_{mode}"] for mode in MODES}
    against = sentences("reasons", law=record, stable=stable, solve=SOLVE)
    return f"{record['law']} is not chosen: {'; '.join(against)}" if against else ""
