"""Sobol indices of first and total order, with intervals for sampling, failures, and the error of the model.

The first-order index of an input is the share of the output's variance that its variation alone explains. The total
index also has all its interactions. Points come from Saltelli's design, (d + 2) N points for d inputs, and the
estimators are those of SALib (Saltelli et al., Comput. Phys. Commun. 181 (2010) 259). Inputs are independent and
uniform in their ranges.

An interval covers three causes:

- sampling: percentiles of bootstrap resamples of the N base points, 95 %;
- error of the model: the output is changed by random smooth functions whose size is the stated error at each point
  (`error_variants`); the interval is widened to the percentiles of their pooled resamples, 95 %; where the stated
  error exceeds the deviation of the output, nothing is known of its shares, and the interval is widened to 0 to 1;
- failed points: the interval is widened by the bounds of the indices over all values that the failed points may have
  between the least and the largest of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput
from studies.sensitivity.failed_points import evaluated, fillings, squared_differences, variances

Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each input by its name."""
LEVEL = 0.95
"""Confidence of the intervals."""
RESAMPLES = 200
"""Number of bootstrap resamples of an output."""
RESAMPLES_WITH_ERROR = 50
"""Number of bootstrap resamples with each of the error functions."""
ERROR_FIELDS = 10
"""Number of random error functions by which an output with a stated error is changed."""
SMOOTHNESS = 0.5
"""Correlation length of the error functions, over the range of an input: the error of a fitted model is smooth."""
FEATURES = 64
"""Number of cosines of an error function."""
NORMAL_90 = 1.6449
"""Half width of a 90 % interval over the standard deviation of a normal distribution."""
MOST_POINTS = 2_000_000
"""Largest number of points; more are taken for a mistake."""


@dataclass(frozen=True, slots=True, eq=False)
class SobolIndices:
    """Indices of one output for d inputs.

    Attributes
    ----------
    names : the inputs.
    first, first_low, first_high : index of first order and its interval, shape (d,).
    total, total_low, total_high : index of total order and its interval, shape (d,).
    points, failed : numbers of evaluated and of failed points.
    mean, deviation : mean and standard deviation of the output where it did not fail.
    """

    names: tuple[str, ...]
    first: Array
    first_low: Array
    first_high: Array
    total: Array
    total_low: Array
    total_high: Array
    points: int
    failed: int
    mean: float
    deviation: float


def sobol_of(function: Callable[[Array], Array], ranges: Ranges, count: int = 1024, seed: int = 0) -> SobolIndices:
    """Return the indices of any function of points (n, d), which returns values (n,), NaN where it fails.

    Parameters
    ----------
    count : number N of base points, a power of 2.

    >>> indices = sobol_of(lambda x: x[:, 0] + 2 * x[:, 1], {"a": (0, 1), "b": (0, 1)}, 256)
    >>> [round(float(value), 1) for value in indices.first]
    [0.2, 0.8]
    """
    points = saltelli_points(ranges, count, seed)
    return indices(ranges, evaluated(function, points), seed=seed)


def saltelli_points(ranges: Ranges, count: int, seed: int) -> Array:
    """Return the points of Saltelli's design, shape ((d + 2) count, d); see `check_count` for the count."""
    check_count(ranges, count)
    return scaled(_unit_points(ranges, count, seed), ranges)


def check_count(ranges: Ranges, count: int) -> None:
    """Raise BadInput unless there is an input, the count is a power of 2 of at least 8, and not too large."""
    if count < 8 or count & (count - 1):
        below = max(1 << (max(count, 8).bit_length() - 1), 8)
        raise BadInput(f"Sobol indices need a power of 2, 8 or more, as count; got {count}: take {below}")
    if not (ranges and (len(ranges) + 2) * count <= MOST_POINTS):
        raise BadInput(
            f"Sobol indices need an input and at most {MOST_POINTS} points; {len(ranges)} inputs and count {count} "
            f"give {(len(ranges) + 2) * count}: take a smaller count"
        )


def scaled(unit: Array, ranges: Ranges) -> Array:
    """Return points of the unit cube (n, d) as values of the inputs."""
    low, high = np.array(list(ranges.values()), dtype=np.float64).T
    # 12 digits: an input that a design leaves as it is must not differ by rounding
    return np.asarray(np.clip(low + np.round(unit, 12) * (high - low), low, high))


def indices(
    ranges: Ranges,
    values: Array,
    half_width: Array | None = None,
    seed: int = 0,
    error_lengths: Mapping[str, float] | None = None,
) -> SobolIndices:
    """Return the indices of an output at the points of `saltelli_points`.

    Parameters
    ----------
    values : output at the points, shape ((d + 2) count,), NaN where it has failed.
    half_width : half width of the model's 90 % interval at each point; default: no error.
    error_lengths : distance in each input over which the model's error varies, in the unit of the input; the error
        does not depend on other inputs. Default: `SMOOTHNESS` of each range.

    Returns
    -------
    SobolIndices
        NaN for all indices if every point has failed, or if the output does not vary.
    """
    known = values[np.isfinite(values)]
    failed, d = len(values) - len(known), len(ranges)
    moments = (float(known.mean()), float(known.std())) if len(known) else (np.nan, np.nan)
    filled = [one for one in fillings(values) if varies(one)]
    if not filled or not varies(known):
        none = np.full(d, np.nan)
        return SobolIndices(tuple(ranges), none, none, none, none, none, none, len(values), failed, *moments)
    estimate, sampling = _resampled(ranges, filled[0], RESAMPLES, seed)
    low, high = _interval(sampling)
    with_errors = [
        _resampled(ranges, one, RESAMPLES_WITH_ERROR, seed)[1]
        for one in error_variants(ranges, filled[0], half_width, seed, error_lengths)
    ]
    if with_errors:
        pooled = _interval(np.concatenate(with_errors, axis=1))
        low, high = np.minimum(low, pooled[0]), np.maximum(high, pooled[1])
    low, high = np.minimum(low, estimate), np.maximum(high, estimate)
    if half_width is not None and error_over_deviation(half_width, known) > 1:
        low, high = np.minimum(low, 0.0), np.maximum(high, 1.0)
    if failed:
        # the sampling error comes on top of the bounds of what the failed points may be
        others = [_resampled(ranges, one, 2, seed)[0] for one in filled[1:]]
        least, most = _pairwise_bounds(values, d)
        low = low - estimate + np.min([estimate, least, *others], axis=0)
        high = high - estimate + np.max([estimate, most, *others], axis=0)
    (first, total), (first_low, total_low), (first_high, total_high) = estimate, low, high
    return SobolIndices(
        names=tuple(ranges),
        first=first,
        first_low=first_low,
        first_high=first_high,
        total=total,
        total_low=total_low,
        total_high=total_high,
        points=len(values),
        failed=failed,
        mean=moments[0],
        deviation=moments[1],
    )


def error_over_deviation(half_width: Array, known: Array) -> float:
    """Return the median half width of a model's 90 % interval over the standard deviation of the known outputs."""
    return float(np.nanmedian(half_width) / known.std())


def varies(values: Array) -> bool:
    """Return whether values differ by more than rounding."""
    return bool(np.ptp(values) > 1e-12 * np.abs(values).max())


def error_variants(
    ranges: Ranges,
    values: Array,
    half_width: Array | None,
    seed: int,
    error_lengths: Mapping[str, float] | None = None,
) -> list[Array]:
    """Return the output at the points of `saltelli_points`, changed by random smooth errors of the stated size.

    An error is a Gaussian random field over the inputs (a sum of cosines with random frequencies) whose standard
    deviation is that of the model at each point. Independent errors at each point would be no error of a smooth
    model: they would be taken for interactions.
    """
    if half_width is None or not np.nanmax(half_width, initial=0.0) > 0:
        return []
    deviation = np.where(np.isfinite(half_width), half_width, 0.0) / NORMAL_90
    count = len(values) // (len(ranges) + 2)
    lengths = {name: SMOOTHNESS * (high - low) for name, (low, high) in ranges.items()}
    lengths = lengths if error_lengths is None else dict(error_lengths)
    # an input that the error does not depend on has an infinite length
    scales = np.array([(high - low) / lengths.get(name, np.inf) for name, (low, high) in ranges.items()])
    unit = _unit_points(ranges, count, seed) * scales
    random = np.random.default_rng(seed)
    variants = []
    for _ in range(ERROR_FIELDS):
        frequency = random.standard_normal((len(ranges), FEATURES))
        phase = random.uniform(0, 2 * np.pi, FEATURES)
        field = np.sqrt(2 / FEATURES) * np.cos(unit @ frequency + phase).sum(axis=1)
        variants.append(values + deviation * field)
    return variants


def _unit_points(ranges: Ranges, count: int, seed: int) -> Array:
    """Return the points of Saltelli's design in the unit cube, shape ((d + 2) count, d)."""
    from SALib.sample import sobol

    return np.asarray(sobol.sample(_problem(ranges), count, calc_second_order=False, seed=seed))


def _problem(ranges: Ranges) -> dict[str, Any]:
    """Return the problem as SALib describes it, in the unit cube."""
    return {"num_vars": len(ranges), "names": list(ranges), "bounds": [[0.0, 1.0]] * len(ranges)}


def _resampled(ranges: Ranges, values: Array, resamples: int, seed: int) -> tuple[Array, Array]:
    """Return the indices of first and total order, (2, d), and those of bootstrap resamples, (2, resamples, d)."""
    from SALib.analyze import sobol

    # SALib ignores a seed of 0 and takes NumPy's global state, so it gets a generator
    result = sobol.analyze(
        _problem(ranges),
        values,
        calc_second_order=False,
        num_resamples=resamples,
        conf_level=LEVEL,
        keep_resamples=True,
        seed=np.random.default_rng(seed),
    )
    estimate = np.array([result["S1"], result["ST"]], dtype=np.float64)
    return estimate, np.array([result["S1_conf_all"], result["ST_conf_all"]], dtype=np.float64)


def _interval(resamples: Array) -> tuple[Array, Array]:
    """Return the ends of the intervals of resamples (2, resamples, d), each of shape (2, d)."""
    tail = (1 - LEVEL) / 2
    low, high = np.quantile(resamples, [tail, 1 - tail], axis=1)
    return low, high


def _pairwise_bounds(values: Array, d: int) -> tuple[Array, Array]:
    """Return the least and the largest indices, each of shape (2, d), over all fillings of failed points.

    By Jansen's estimators, with A and B the values of the two independent points of a row, C that of the point of A
    with one input of B, and V their variance:

        S1 = 1 - mean (B - C)^2 / 2 V,    ST = mean (A - C)^2 / 2 V.
    """
    low, high = np.nanmin(values), np.nanmax(values)
    rows = values.reshape(-1, d + 2)
    first, crossed, last = rows[:, :1], rows[:, 1:-1], rows[:, -1:]
    least_variance, most_variance = variances(np.concatenate([first, last]).ravel(), low, high)
    # an output that may not vary at all bounds nothing
    least_variance = max(least_variance, 1e-12 * most_variance)
    near, far = squared_differences(last, crossed, low, high)
    unchanged = 1 - far.mean(axis=0) / (2 * least_variance), 1 - near.mean(axis=0) / (2 * most_variance)
    near, far = squared_differences(first, crossed, low, high)
    changed = near.mean(axis=0) / (2 * most_variance), far.mean(axis=0) / (2 * least_variance)
    # indices are shares
    least, most = np.clip(np.stack([unchanged, changed], axis=1), 0.0, 1.0)
    return least, most
