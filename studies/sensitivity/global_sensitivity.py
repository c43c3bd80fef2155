"""Which input matters most: Sobol indices and Morris' elementary effects, with intervals for what is not known.

*Sobol indices.* The first-order index of an input is the share of the output's variance that its variation alone
explains. The total index also has all its interactions. Points come from Saltelli's design, (d + 2) N points for d
inputs, and the estimators are those of SALib (Saltelli et al., Comput. Phys. Commun. 181 (2010) 259). Inputs are
independent and uniform in their ranges. An interval covers three causes:

- sampling: percentiles of bootstrap resamples of the N base points, 95 %;
- error of the model: the output is changed by random smooth functions whose size is the stated error at each point
  (`error_variants`); the interval is widened to the percentiles of their pooled resamples, 95 %; where the stated
  error exceeds the deviation of the output, nothing is known of its shares, and the interval is widened to 0 to 1;
- failed points: the interval is widened by the bounds of the indices over all values that the failed points may have
  between the least and the largest of the others.

*Morris' effects.* A trajectory has d + 1 points; each differs from the one before in one input, by 2/3 of its range.
The difference of the output over this share of the range is an elementary effect, in units of the output per full
range of the input. For each input, mu* is the mean magnitude of its effects, mu their mean, and sigma their standard
deviation: 0 for an input that acts linearly and by itself. Trajectories and statistics are those of SALib (Morris,
Technometrics 33 (1991) 161; Campolongo et al., Environ. Model. Softw. 22 (2007) 1509).

*Failed points.* Both estimators compare the values of two points that differ in one input. With a NaN among the
values the whole estimate is lost. So a failed value is replaced by that of another model, or by the median of the
others, for the estimate; and by their least and by their largest, for its interval. All three fillings let the output
jump at a failed point, which looks like an interaction. Bounds that hold for every filling between the least and the
largest value come from each pair by itself: `squared_differences` and `variances`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput
from studies.sensing.decode_readings import QUANTILE

if TYPE_CHECKING:
    import pandas as pd

Ranges = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each input by its name."""
LEVEL = 0.95
"""Confidence of the intervals."""
ENDS = ((1 - LEVEL) / 2, (1 + LEVEL) / 2)
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
MOST_POINTS = 2_000_000
"""Largest number of points; more are taken for a mistake."""
LEVELS = 4
"""Number of values of each input; SALib's step is then 2/3 of the range."""
MORRIS_RESAMPLES = 1000
"""Number of bootstrap resamples of mu*."""
FEWEST, MOST = 2, 1000
"""Fewest and most trajectories: one alone has no standard deviation."""


def sobol_of(function: Callable[[Array], Array], ranges: Ranges, count: int = 1024, seed: int = 0) -> pd.DataFrame:
    """Return the indices of any function of points (n, d), which returns values (n,), NaN where it fails.

    >>> sobol_of(lambda x: x[:, 0] + 2 * x[:, 1], {"a": (0, 1), "b": (0, 1)}, 256)["first_order"].round(1).tolist()
    [0.2, 0.8]
    """
    return indices(ranges, function(saltelli_points(ranges, count, seed)), seed=seed)


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
) -> pd.DataFrame:
    """Return the indices of an output at the points of `saltelli_points`, a row for each input.

    They are NaN if every point has failed, or if the output does not vary.

    Parameters
    ----------
    values : output at the points, shape ((d + 2) count,), not finite where it has failed.
    half_width : half width of the model's 90 % interval at each point; default: no error.
    error_lengths : distance in each input over which the model's error varies, in the unit of the input; the error
        does not depend on other inputs. Default: `SMOOTHNESS` of each range.
    """
    values, d = np.where(np.isfinite(values), values, np.nan), len(ranges)
    known = values[~np.isnan(values)]
    filled = [filling for filling in fillings(values) if _varies(filling)]
    if not filled or not _varies(known):
        return _orders(ranges, *np.full((3, 2, d), np.nan))
    estimate, sampling = _resampled(ranges, filled[0], RESAMPLES, seed)
    low, high = np.quantile(sampling, ENDS, axis=1)
    with_errors = [
        _resampled(ranges, filling, RESAMPLES_WITH_ERROR, seed)[1]
        for filling in error_variants(ranges, filled[0], half_width, seed, error_lengths)
    ]
    if with_errors:
        pooled = np.quantile(np.concatenate(with_errors, axis=1), ENDS, axis=1)
        low, high = np.minimum(low, pooled[0]), np.maximum(high, pooled[1])
    low, high = np.minimum(low, estimate), np.maximum(high, estimate)
    # the median half width over the standard deviation of the known outputs
    if half_width is not None and np.nanmedian(half_width) > known.std():
        low, high = np.minimum(low, 0.0), np.maximum(high, 1.0)
    if len(known) < len(values):
        # the sampling error comes on top of the bounds of what the failed points may be
        of_fillings = [_resampled(ranges, filling, 2, seed)[0] for filling in filled[1:]]
        least, most = _pairwise_bounds(values, d)
        low = low - estimate + np.min([estimate, least, *of_fillings], axis=0)
        high = high - estimate + np.max([estimate, most, *of_fillings], axis=0)
    return _orders(ranges, estimate, low, high)


def _orders(ranges: Ranges, estimate: Array, low: Array, high: Array) -> pd.DataFrame:
    import pandas as pd

    columns = {
        f"{order}_order{end}": values[k]
        for k, order in enumerate(("first", "total"))
        for end, values in (("", estimate), ("_low", low), ("_high", high))
    }
    return pd.DataFrame(columns, index=list(ranges))


def _varies(values: Array) -> bool:
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
    deviation = np.where(np.isfinite(half_width), half_width, 0.0) / QUANTILE
    count = len(values) // (len(ranges) + 2)
    # an input that the error does not depend on has an infinite length
    scales = np.array([
        1 / SMOOTHNESS if error_lengths is None else (high - low) / error_lengths.get(name, np.inf)
        for name, (low, high) in ranges.items()
    ])  # fmt: skip
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


def trajectories(ranges: Ranges, count: int, seed: int) -> Array:
    """Return the points of Morris' trajectories one after the other, shape ((d + 1) count, d)."""
    check_trajectories(ranges, count)
    from SALib.sample import morris

    return scaled(morris.sample(_problem(ranges), count, num_levels=LEVELS, seed=np.random.default_rng(seed)), ranges)


def check_trajectories(ranges: Ranges, count: int) -> None:
    """Raise BadInput unless there is an input and the number of trajectories is in its range."""
    if not (ranges and FEWEST <= count <= MOST):
        raise BadInput(f"Morris needs an input and from {FEWEST} to {MOST} trajectories; got {count}")


def effects(
    ranges: Ranges, points: Array, values: Array, substitute: Array | None = None, seed: int = 0
) -> pd.DataFrame:
    """Return the effects on an output at the points of `trajectories`, in units of the output per full range.

    A row for each input; NaN if every point has failed. The ends of mu_star are 95 % by bootstrap, widened to the
    bounds over all values that the failed points may have between the least and the largest of the others; those of
    sigma are its range over the fillings.

    Parameters
    ----------
    values : output at the points, shape (n,), not finite where it has failed.
    substitute : output of another model there, which replaces failed values in the estimate.
    """
    import pandas as pd
    from SALib.analyze import morris

    values = np.where(np.isfinite(values), values, np.nan)
    low, high = np.array(list(ranges.values()), dtype=np.float64).T
    # an input of a step has exactly the same value as before
    unit = np.round((points - low) / (high - low), 9)
    options = {"num_resamples": MORRIS_RESAMPLES, "conf_level": LEVEL, "num_levels": LEVELS}
    results: list[Mapping[str, Array]] = [
        morris.analyze(_problem(ranges), unit, filled, **options, seed=np.random.default_rng(seed))
        for filled in fillings(values, substitute)
    ]
    nothing = dict.fromkeys(("mu_star", "mu_star_conf", "mu", "sigma"), np.full(len(ranges), np.nan))
    estimate, *others = results or [nothing]
    mu_star, half_width = (np.asarray(estimate[name], dtype=np.float64) for name in ("mu_star", "mu_star_conf"))
    least, most = _mu_star_bounds(unit, values) if others else (mu_star, mu_star)
    sigmas = [each["sigma"] for each in (estimate, *others)]
    columns = {
        "mu_star": mu_star,
        "mu_star_low": np.maximum(np.minimum(mu_star, least) - half_width, 0.0),
        "mu_star_high": np.maximum(mu_star, most) + half_width,
        "mu": estimate["mu"],
        "sigma": estimate["sigma"],
        "sigma_low": np.min(sigmas, axis=0),
        "sigma_high": np.max(sigmas, axis=0),
    }
    return pd.DataFrame(columns, index=list(ranges))


def _mu_star_bounds(unit: Array, values: Array) -> tuple[Array, Array]:
    """Return the least and the largest mu* over all fillings of failed points, each of shape (d,)."""
    d = unit.shape[1]
    steps = np.diff(unit.reshape(-1, d + 1, d), axis=1)
    rows = values.reshape(-1, d + 1)
    squares = squared_differences(rows[:, 1:], rows[:, :-1], np.nanmin(values), np.nanmax(values))
    # each step of a trajectory changes one input, so a sum over the steps picks the effect of each
    changed = steps != 0
    size = np.abs(steps).sum(axis=2)
    least, most = ((np.sqrt(square) / size)[:, :, None] * changed for square in squares)
    return least.sum(axis=1).mean(axis=0), most.sum(axis=1).mean(axis=0)


def fillings(values: Array, substitute: Array | None = None) -> list[Array]:
    """Return the values (n,) without NaN: filled for the estimate, by the least, and by the largest of them.

    The estimate is that of another model, `substitute` (n,), or the median where this is NaN. There is one filling,
    the values themselves, if none has failed, and none if all have.

    >>> fillings(np.array([1.0, np.nan, 3.0]))
    [array([1., 2., 3.]), array([1., 1., 3.]), array([1., 3., 3.])]
    """
    failed = ~np.isfinite(values)
    if not failed.any():
        return [values]
    if failed.all():
        return []
    known = values[~failed]
    estimate = np.full_like(values, np.median(known))
    if substitute is not None:
        estimate = np.where(np.isfinite(substitute), substitute, estimate)
    return [np.where(failed, stand_in, values) for stand_in in (estimate, known.min(), known.max())]


def squared_differences(first: Array, second: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return the least and the largest square of first - second, with every NaN any number from low to high.

    >>> squared_differences(np.array([1.0, 1.0]), np.array([3.0, np.nan]), 0.0, 5.0)
    (array([4., 0.]), array([ 4., 16.]))
    """
    (first_low, first_high), (second_low, second_high) = (
        [np.where(np.isfinite(values), values, end) for end in (low, high)] for values in (first, second)
    )
    apart = np.maximum(np.maximum(first_low - second_high, second_low - first_high), 0.0)
    farthest = np.maximum(first_high - second_low, second_high - first_low)
    return apart**2, farthest**2


def variances(values: Array, low: float, high: float) -> tuple[float, float]:
    """Return bounds of the variance of values, with every NaN any number from low to high.

    >>> variances(np.array([0.0, 2.0, np.nan, np.nan]), 0.0, 2.0)
    (0.5, 1.0)
    """
    failed = ~np.isfinite(values)
    known = values[~failed]
    count, missing = len(values), int(failed.sum())
    # least: all at the mean of the known; the largest is a convex function's, which lies at the ends of the range
    least = float(known.var()) * len(known) / count
    at_high = np.arange(missing + 1)
    total = known.sum() + (missing - at_high) * low + at_high * high
    squares = (known**2).sum() + (missing - at_high) * low**2 + at_high * high**2
    return least, float((squares / count - (total / count) ** 2).max())
