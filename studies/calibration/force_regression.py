"""Forces by ridge regression on bench rows, a decoder that knows readings and forces only: no magnet, no mechanics.

With the standard scores x_i = (r_i - c_i) / s_i of the readings r (k,), and all products of them up to a degree,
less their means, as terms t (m,), the force is

    F(r) = F_0 + W' t(x),    W = A X' (Y - F_0),    A = (X' X + p I)^-1,

for the rows X (n, m) and Y (n, 3) of a bench. The penalty p has the least leave-one-out error of these rows; the
degree, 1 (linear) or 2 (quadratic), the least error on rows that are held out, of runs in turn.

A force that is measured at r differs from F(r) by the error of a row, with covariance S, and by that of W: together,
in component a, by the variance

    S_aa (1 + h(r)),    h(r) = 1 / n + t' A t,

with the leverage h, in which a penalty counts as a prior of W. S is the mean of e e' / (1 + h) over the errors e of
rows that were held out. Half of a 90 % interval is Student's t_0.95 times the root, with the degrees of freedom
n - 1 - tr(X A X'). It contains the error of the bench's force sensor.

Beyond the bench a polynomial may be anything. A row is `out_of_range` where its readings lie farther from those of
the bench than any of these, by Mahalanobis' distance (hidden extrapolation: Montgomery, Peck and Vining, Introduction
to Linear Regression Analysis, 3.8), where its force lies beyond the forces of the bench, measured or by the
regression, or its temperature beyond those of the bench by more than `WARMTH`: then its interval is not known. So a
press that is lighter than all of the bench is out of range, and rest, unless the bench has rows at rest.

Limits: forces are those of loading as slow as on the bench, whatever the silicone relaxes; no pose; a drift of the
elements or an ambient field is removed by a zero only, which needs rows at rest in the bench. Readings are in the
elements' own unit, forces in N, temperatures in C.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic import parts
from analytic.decode import Status
from analytic.time_series import LEAST_JUMP, RowChecks
from geometry.arrays import Array, Ints
from geometry.design import BadInput, Design
from studies.calibration.bench_file import FEWEST, Bench
from studies.inputs.table_input import numbers_of

KINDS = {1: "linear", 2: "quadratic"}
"""Degrees that are tried, and their words."""
PENALTIES = np.geomspace(1e-8, 1e2, 41)
"""Penalties that are tried, over the number of rows: from none to one that leaves nothing."""
FOLDS = 5
"""Parts in which a single run is held out, each of consecutive rows."""
BEYOND = 3
"""Rows beyond the number of readings that a linear regression needs: one for the mean, two that tell its error."""
LEAST_SPREAD = 1e-6
"""Least variance of a combination of readings over the largest one: a smaller one is rounding of float."""
WARMTH = 2.0
"""Distance from the temperatures of the bench, K, which changes a magnet's field by 0.2 %: less than a regression
misses."""
ROUNDED = 1e-4
"""Relative rounding of a distance or a force: the farthest rows of the bench lie within its range, also in float."""
COVERAGE = 0.95
"""Share of errors below the upper end of a 90 % interval."""
AXES = "xyz"


@dataclass(frozen=True, slots=True, eq=False)
class Polynomial:
    """The polynomial F(r), and the leverage of readings.

    Attributes
    ----------
    degree, penalty, rows : 1 or 2, p and n.
    centre, scale : (k,) of the readings.
    term_means : (m,) of the products.
    constant, weights : F_0 (3,) and W (m, 3); NaN and 0 for a component that was not measured.
    root : (m, m), lower triangle, with A = root' root.
    """

    degree: int
    penalty: float
    rows: int
    centre: Array
    scale: Array
    term_means: Array
    constant: Array
    weights: Array
    root: Array

    def terms(self, readings: Array) -> Array:
        """Return the terms (n, m) of readings (n, k)."""
        return products((readings - self.centre) / self.scale, self.degree) - self.term_means

    def force(self, readings: Array) -> Array:
        """Return the forces (n, 3) of readings (n, k)."""
        return np.asarray(self.constant + self.terms(readings) @ self.weights)

    def leverage(self, readings: Array) -> Array:
        """Return h (n,) of readings (n, k)."""
        return np.asarray(1 / self.rows + np.square(self.terms(readings) @ self.root.T).sum(axis=1))

    @property
    def freedom(self) -> float:
        """Degrees of freedom that the rows leave: n - 1 - tr(X A X')."""
        return self.rows - 1 - len(self.root) + self.penalty * float(np.square(self.root).sum())


def products(x: Array, degree: int) -> Array:
    """Return the numbers x (n, k) and all their products up to a degree (n, m).

    >>> products(np.array([[2.0, 3.0]]), 2).tolist()
    [[2.0, 3.0, 4.0, 6.0, 9.0]]
    """
    columns = [x[:, list(factors)].prod(axis=1) for factors in _factors(x.shape[1], degree)]
    return np.stack(columns, axis=1)


@functools.cache
def _factors(count: int, degree: int) -> list[tuple[int, ...]]:
    choose = itertools.combinations_with_replacement
    return [factors for d in range(1, degree + 1) for factors in choose(range(count), d)]


def fit(readings: Array, force: Array, degree: int) -> Polynomial:
    """Return the regression of forces (n, 3) on readings (n, k); rows without one of the measured components are left
    out."""
    from sklearn.linear_model import RidgeCV

    measured = np.isfinite(force).any(axis=0)
    rows = complete_rows(readings, force)
    if rows.sum() < 2 or not measured.any():  # they tell nothing
        k, m = readings.shape[1], len(_factors(readings.shape[1], degree))
        unknown, none = np.full(3, np.nan), np.zeros(m)
        return Polynomial(degree, 0.0, 1, np.zeros(k), np.ones(k), none, unknown, np.zeros((m, 3)), np.zeros((m, m)))
    r, F = readings[rows], force[rows][:, measured]
    scale = r.std(axis=0)
    centre, scale = r.mean(axis=0), np.where(scale > 0, scale, 1.0)
    terms = products((r - centre) / scale, degree)
    means = terms.mean(axis=0)
    X, size = terms - means, F.std(axis=0)
    size[size == 0] = 1.0
    constant, weights = np.full(3, np.nan), np.zeros((terms.shape[1], 3))
    constant[measured] = F.mean(axis=0)
    # each component counts alike in the choice of the penalty
    found = RidgeCV(alphas=PENALTIES * len(r)).fit(X, F / size)
    weights[:, measured] = found.coef_.reshape(-1, len(means)).T * size
    root = np.linalg.inv(np.linalg.cholesky(X.T @ X + found.alpha_ * np.eye(len(means))))
    return Polynomial(degree, float(found.alpha_), len(r), centre, scale, means, constant, weights, root)


def complete_rows(readings: Array, force: Array) -> NDArray[np.bool_]:
    """Return which rows (n,) have all readings (n, k), and all components of the force (n, 3) that were measured."""
    measured = np.isfinite(force).any(axis=0)
    return np.asarray(np.isfinite(readings).all(axis=1) & np.isfinite(force[:, measured]).all(axis=1))


def quantile(freedom: float) -> float:
    """Return Student's t of `COVERAGE`; infinite where the rows leave no freedom."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, COVERAGE)) if freedom > 0 else math.inf


# Held-out rows


def folds(bench: Bench, rows: Ints) -> Iterator[tuple[str, Ints, Ints]]:
    """Yield name, training rows and held-out rows: whole runs in turn, or parts of the only run."""
    run = bench.table["run"].to_numpy()[rows]
    if len(set(run)) > 1:
        for name in bench.runs:
            if (run == name).any():
                yield name, rows[run != name], rows[run == name]
    else:
        count = min(FOLDS, len(rows))
        for k, part in enumerate(np.array_split(rows, count), 1):
            yield f"part {k} of {count}", np.setdiff1d(rows, part), part


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """What regressions of one degree give for rows that they have not seen.

    Attributes
    ----------
    degree : of the regressions.
    force, leverage : (n, 3) and (n,), NaN for rows that are in no part.
    part : (n,) number of the row's part, -1 for none.
    factor : (n,) Student's t of the regression that the row was held out of.
    """

    degree: int
    force: Array
    leverage: Array
    part: Ints
    factor: Array

    def errors(self, truth: Array) -> Array:
        """Return errors (n, 3) over the root of 1 + h."""
        return np.asarray((self.force - truth) / np.sqrt(1 + self.leverage)[:, None])

    def inside(self, truth: Array) -> Array:
        """Return whether (n, 3) forces lie in intervals that the other parts give, 1 or 0; NaN if not measured."""
        off = self.errors(truth)
        inside = np.full(truth.shape, np.nan)
        for part in range(self.part.max() + 1):
            own = self.part == part
            half = self.factor[own, None] * np.sqrt(_mean(np.square(off[(self.part >= 0) & ~own])))
            inside[own] = np.where(np.isfinite(off[own]), np.abs(off[own]) <= half, np.nan)
        return inside


def _mean(values: Array) -> Array:
    """Return the means of columns over the rows that have a number; NaN for a column without one."""
    known = np.isfinite(values)
    count = known.sum(axis=0)
    return np.asarray(np.where(count > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan))


def held_out(readings: Array, force: Array, parts: Sequence[tuple[str, Ints, Ints]], degree: int) -> HeldOut:
    """Return what regressions without each part of the rows give for it.

    parts : name, rows that are trained on, and rows that are held out.
    """
    found = np.full_like(force, np.nan)
    leverage, factor = np.full(len(force), np.nan), np.full(len(force), np.nan)
    part = np.full(len(force), -1)
    for k, (_, train, test) in enumerate(parts):
        law = fit(readings[train], force[train], degree)
        found[test], leverage[test], part[test] = law.force(readings[test]), law.leverage(readings[test]), k
        factor[test] = quantile(law.freedom)
    return HeldOut(degree, found, leverage, part, factor)


def check_rows(readings: Array, force: Array, parts: Sequence[tuple[str, Ints, Ints]]) -> None:
    """Refuse rows that are too few for a linear regression, also without one of the parts."""
    count, rows = readings.shape[1], complete_rows(readings, force)
    total, needed = int(rows.sum()), readings.shape[1] + BEYOND
    if total < needed:
        raise BadInput(
            f"{total} rows with all readings and measured forces are too few for a linear regression of {count} "
            f"readings, which needs {needed}: press more often, or take --decoder model"
        )
    name, left = min(((name, int(rows[train].sum())) for name, train, _ in parts), key=lambda one: one[1])
    if left < FEWEST:
        raise BadInput(
            f"without {name}, of {total} rows {left} are left for a regression, which is tried on runs that it has "
            f"not seen and needs {FEWEST}: press more often in the other runs, or take --decoder model"
        )


# The decoder


@dataclass(frozen=True, slots=True, eq=False)
class Regression:
    """A decoder of readings by a regression.

    Attributes
    ----------
    design : whose elements have the readings.
    law : the polynomial.
    covariance : S (3, 3), N^2; NaN for a component that was not measured.
    held_out : (3,) root mean square error on rows that were held out, N.
    span : (2, k) least and greatest reading of the bench.
    whitening : (k, k), whose product with the standard scores has the length of Mahalanobis' distance.
    farthest : the greatest distance of a row of the bench.
    forces : (2, 3) least and greatest force of the bench, measured or by the regression, N.
    rest : (k,) mean of its readings at rest; NaN where it has none.
    temperature_C : (2,) least and greatest one of the bench; NaN where it had none.
    """

    design: Design
    law: Polynomial
    covariance: Array
    held_out: Array
    span: Array
    whitening: Array
    farthest: float
    forces: Array
    rest: Array
    temperature_C: Array

    @property
    def is_thermal(self) -> bool:
        """Whether the bench had temperatures."""
        return bool(np.isfinite(self.temperature_C).all())

    @property
    def factor(self) -> float:
        """Half of an interval over its standard deviation."""
        return quantile(self.law.freedom)

    @property
    def words(self) -> str:
        """What kind of regression it is."""
        return f"{KINDS[self.law.degree]} ridge regression"

    @property
    def least_jumps(self) -> Array:
        """Changes (k,) of readings from which one is a jump, as `analytic.time_series.least_jumps` has them."""
        elements, _ = parts.with_noise(parts.of_design(self.design))
        noise = np.array([element.noise_T * element.gain for element in elements])
        return np.asarray(np.maximum(10 * np.abs(noise), LEAST_JUMP * np.ptp(self.span, axis=0)))

    def distance(self, readings: Array) -> Array:
        """Return Mahalanobis' distance (n,) of readings (n, k) from those of the bench."""
        scores = (readings - self.law.centre) / self.law.scale
        return np.asarray(np.linalg.norm(scores @ self.whitening.T, axis=1))

    def half_widths(self, readings: Array) -> Array:
        """Return half of the 90 % intervals (n, 3) of forces at readings (n, k), N, in range or not."""
        variance = np.outer(1 + self.law.leverage(readings), np.diag(self.covariance))
        return np.asarray(self.factor * np.sqrt(variance))

    def decode(
        self, readings: Array, temperature: Array, offset: Array | None = None
    ) -> tuple[list[Status], Array, Array]:
        """Return status, force and half of its interval (n, 3) of readings (n, k) at temperatures (n,), C.

        temperature : NaN where it is not known.
        offset : (k,) of a zero: it moves readings, but not the rails of the elements.
        """
        elements = parts.of_design(self.design)
        low, high = (np.array([getattr(element, name) for element in elements]) for name in ("low", "high"))
        lost = ~np.isfinite(readings).all(axis=1)
        full = ~lost & ((readings <= low) | (readings >= high)).any(axis=1)
        silent = np.asarray(lost | full)
        moved = np.where(silent[:, None], self.law.centre, readings + (0.0 if offset is None else offset))
        force, half = self.law.force(moved), self.half_widths(moved)
        least, most = self.forces
        away = (force < least) | (force > most)
        beyond = np.asarray(away.any(axis=1) | (self.distance(moved) > self.farthest))
        with np.errstate(invalid="ignore"):
            cold, warm = self.temperature_C + np.array([-WARMTH, WARMTH])
            beyond |= (temperature < cold) | (temperature > warm)
        force[silent] = half[silent | beyond] = np.nan
        words: Any = np.select([lost, full, beyond], ["not_finite", "saturated", "out_of_range"], "ok")
        return words.tolist(), force, half

    def check_zero(self) -> None:
        """Refuse a zero if no row of the bench was at rest."""
        if np.isnan(self.rest).any():
            raise BadInput(
                "a zero has no meaning for this calibration, a regression whose bench has no row at rest: leave "
                "--zero out, or calibrate with rows without a force"
            )

    def zero_offset(self, readings: Array) -> Array:
        """Return what to add to readings (k,), from rows of them at rest (n, k); NaN in a row counts in no mean."""
        return np.asarray(self.rest - np.nanmean(readings, axis=0))

    def zero_doubts(self, offset: Array) -> list[str]:
        """Return a sentence if a zero removes a force that the interval would not hold."""
        _, force, half = self.decode((self.rest - offset)[None], np.full(1, np.nan))
        far = np.asarray(np.abs(force[0]) > np.nan_to_num(half[0]))
        said = [
            f"{value:.2g} N along {axis}" for axis, value, is_far in zip(AXES, force[0], far, strict=True) if is_far
        ]
        removed = f"the zero removes {', '.join(said)}, more than the interval of the regression at rest"
        return [f"{removed}: was the sensor pressed then, or has it changed?"] * bool(said)

    def series(self, jitter: float = 0.0) -> Series:
        """Return what says of rows over time that they repeat, are missing or jump."""
        elements = parts.of_design(self.design)
        return Series(RowChecks(elements, self.least_jumps, jitter))


class Series:
    """Statuses of decoded rows by the rows before them, as in `analytic.time_series.TimeSeries`."""

    def __init__(self, checks: RowChecks) -> None:
        self._checks, self._lost = checks, False

    def step(self, time: float, row: Array, status: Status) -> Status:
        """Return the status of a row (k,) at a time, s, from that of its readings alone; `frozen` has no force."""
        (word,), lost = self._checks.words(time, row[None]), self._lost
        self._lost = word == "frozen" or status in ("saturated", "not_finite")
        if lost and word == "ok":
            word = "after_gap"
        return word if word == "frozen" or (word != "ok" and status == "ok") else status


def regression(
    design: Design, readings: Array, force: Array, chosen: HeldOut, rest: NDArray[np.bool_], temperature: Array
) -> Regression:
    """Return the decoder of all rows by the chosen degree.

    Parameters
    ----------
    readings, force : (n, k) and (n, 3) of the bench.
    rest : (n,) whether a row is at rest.
    temperature : (n,), C, NaN where it was not measured.
    """
    law, off = fit(readings, force, chosen.degree), chosen.errors(force)
    rows = complete_rows(readings, force) & (chosen.part >= 0)
    covariance = off[rows].T @ off[rows] / rows.sum()
    scores = (readings[rows] - law.centre) / law.scale
    variance, turned = np.linalg.eigh(scores.T @ scores / len(scores))
    whitening = turned.T / np.sqrt(np.maximum(variance, LEAST_SPREAD * variance.max()))[:, None]
    at_rest = readings[rows & rest]
    both = np.stack([force[rows], law.force(readings[rows])])
    edge = ROUNDED * np.ptp(both, axis=(0, 1))
    known = temperature[np.isfinite(temperature)]
    ends = np.array([known.min(), known.max()]) if len(known) else np.full(2, np.nan)
    found = Regression(
        design=design, law=law, covariance=covariance,
        held_out=np.sqrt(_mean(np.square(chosen.force - force))),
        span=np.stack([readings[rows].min(axis=0), readings[rows].max(axis=0)]),
        whitening=whitening, farthest=math.inf,
        forces=np.stack([both.min(axis=(0, 1)) - edge, both.max(axis=(0, 1)) + edge]),
        rest=at_rest.mean(axis=0) if len(at_rest) else np.full(readings.shape[1], np.nan),
        temperature_C=ends,
    )  # fmt: skip
    farthest = (1 + ROUNDED) * float(found.distance(readings[rows]).max())
    return dataclasses.replace(found, farthest=farthest)


# The record of calibration.json

SHAPES: dict[str, tuple[int | str, ...]] = {
    "centre": ("k",), "scale": ("k",), "term_means": ("m",), "constant": (3,), "weights": ("m", 3),
    "root": ("m", "m"), "covariance": (3, 3), "held_out": (3,), "span": (2, "k"),
    "whitening": ("k", "k"), "forces": (2, 3), "rest": ("k",), "temperature_C": (2,),
}  # fmt: skip
"""Arrays of a regression, and their shapes."""
OPTIONAL = ("constant", "covariance", "held_out", "forces", "rest", "temperature_C")
"""Those that may be unknown: null in the file."""


def record_of(found: Regression) -> dict[str, Any]:
    """Return a regression as JSON has it, null for what is not known."""
    values = {f.name: getattr(part, f.name) for part in (found.law, found) for f in dataclasses.fields(part)}
    arrays = {name: _without_nan(values[name].tolist()) for name in SHAPES}
    numbers = {name: values[name] for name in ("degree", "penalty", "rows", "farthest")}
    return {"design": dataclasses.asdict(found.design), **numbers, **arrays}


def _without_nan(values: Any) -> Any:
    if isinstance(values, list):
        return [_without_nan(value) for value in values]
    return None if math.isnan(values) else values


def of_record(record: dict[str, Any]) -> Regression:
    """Return the regression of a record; raise ValueError, KeyError or TypeError for what magtip does not write."""
    design, degree, rows = Design(**record["design"]), record["degree"], record["rows"]
    if degree not in KINDS or not isinstance(rows, int) or rows < 1:
        raise ValueError("degree must be 1 or 2, and rows a whole number above 0")
    count = len(parts.of_design(design))
    sizes = {"k": count, "m": len(_factors(count, degree))}
    arrays = {
        name: numbers_of(
            name, record[name], *(sizes[n] if isinstance(n, str) else n for n in shape), holes=name in OPTIONAL
        )
        for name, shape in SHAPES.items()
    }
    penalty, farthest = (float(numbers_of(name, record[name])) for name in ("penalty", "farthest"))
    measured = np.isfinite(arrays["constant"])
    whole = [np.diag(arrays["covariance"]), arrays["held_out"], *arrays["forces"]]
    if not all((np.isfinite(each) == measured).all() for each in whole) or not measured.any():
        raise ValueError("constant, covariance, held_out and forces must be of the same components")
    if not ((arrays["scale"] > 0).all() and (np.diag(arrays["covariance"])[measured] > 0).all() and farthest > 0):
        raise ValueError("scales, variances and the farthest distance must be above 0")
    law = {f.name: arrays[f.name] for f in dataclasses.fields(Polynomial) if f.name in arrays}
    rest = {f.name: arrays[f.name] for f in dataclasses.fields(Regression) if f.name in arrays}
    return Regression(design=design, law=Polynomial(degree, penalty, rows, **law), farthest=farthest, **rest)
