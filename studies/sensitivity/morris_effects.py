"""Morris' elementary effects: which inputs matter, from few solves, and which interact or act nonlinearly.

A trajectory has d + 1 points; each differs from the one before in one input, by 2/3 of its range. The difference of
the output over this share of the range is an elementary effect, in units of the output per full range of the input.
For each input, mu* is the mean magnitude of its effects, mu their mean, and sigma their standard deviation: 0 for an
input that acts linearly and by itself. Trajectories and statistics are those of SALib (Morris, Technometrics 33
(1991) 161; Campolongo et al., Environ. Model. Softw. 22 (2007) 1509).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput
from studies.sensitivity.failed_points import evaluated, fillings, squared_differences
from studies.sensitivity.sobol_indices import LEVEL, Ranges, scaled

LEVELS = 4
"""Number of values of each input; SALib's step is then 2/3 of the range."""
RESAMPLES = 1000
"""Number of bootstrap resamples of mu*."""
FEWEST, MOST = 2, 1000
"""Fewest and most trajectories: one alone has no standard deviation."""


@dataclass(frozen=True, slots=True, eq=False)
class MorrisEffects:
    """Effects of d inputs on one output, in units of the output per full range of the input.

    Attributes
    ----------
    names : the inputs.
    mu_star, mu_star_low, mu_star_high : mean magnitude and its interval, shape (d,): 95 % by bootstrap, widened to
        the bounds over all values that the failed points may have between the least and the largest of the others.
    mu : mean, shape (d,).
    sigma, sigma_low, sigma_high : standard deviation, and its range over the fillings of failed points, shape (d,).
    points, failed : numbers of evaluated and of failed points.
    mean, deviation : mean and standard deviation of the output where it did not fail.
    """

    names: tuple[str, ...]
    mu_star: Array
    mu_star_low: Array
    mu_star_high: Array
    mu: Array
    sigma: Array
    sigma_low: Array
    sigma_high: Array
    points: int
    failed: int
    mean: float
    deviation: float


def morris_of(function: Callable[[Array], Array], ranges: Ranges, count: int = 10, seed: int = 0) -> MorrisEffects:
    """Return the effects on any function of points (n, d), which returns values (n,), NaN where it fails.

    >>> effects = morris_of(lambda x: 3 * x[:, 0] + x[:, 1], {"a": (0, 2), "b": (0, 1)})
    >>> [round(float(value), 9) for value in effects.mu_star], bool(effects.sigma.max() < 1e-9)
    ([6.0, 1.0], True)
    """
    points = trajectories(ranges, count, seed)
    return effects(ranges, points, evaluated(function, points), seed=seed)


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
) -> MorrisEffects:
    """Return the effects on an output at the points of `trajectories`.

    Parameters
    ----------
    values : output at the points, shape (n,), NaN where it has failed.
    substitute : output of another model there, which replaces failed values in the estimate.

    Returns
    -------
    MorrisEffects
        NaN for all effects if every point has failed.
    """
    known = values[np.isfinite(values)]
    failed = len(values) - len(known)
    moments = (float(known.mean()), float(known.std())) if len(known) else (np.nan, np.nan)
    results = [_analysed(ranges, points, filled, seed) for filled in fillings(values, substitute)]
    if not results:
        none = np.full(len(ranges), np.nan)
        return MorrisEffects(tuple(ranges), none, none, none, none, none, none, none, len(values), failed, *moments)
    mu_star, half_width = results[0]["mu_star"], results[0]["mu_star_conf"]
    least, most = (mu_star, mu_star) if not failed else _bounds(ranges, points, values)
    sigmas = [result["sigma"] for result in results]
    return MorrisEffects(
        names=tuple(ranges),
        mu_star=mu_star,
        mu_star_low=np.maximum(np.minimum(mu_star, least) - half_width, 0.0),
        mu_star_high=np.maximum(mu_star, most) + half_width,
        mu=results[0]["mu"],
        sigma=sigmas[0],
        sigma_low=np.min(sigmas, axis=0),
        sigma_high=np.max(sigmas, axis=0),
        points=len(values),
        failed=failed,
        mean=moments[0],
        deviation=moments[1],
    )


def _problem(ranges: Ranges) -> dict[str, Any]:
    """Return the problem as SALib describes it, in the unit cube."""
    return {"num_vars": len(ranges), "names": list(ranges), "bounds": [[0.0, 1.0]] * len(ranges)}


def _unit(ranges: Ranges, points: Array) -> Array:
    """Return points in the unit cube, shape (n, d); an input of a step has exactly the same value as before."""
    low, high = np.array(list(ranges.values()), dtype=np.float64).T
    return np.asarray(np.round((points - low) / (high - low), 9))


def _analysed(ranges: Ranges, points: Array, values: Array, seed: int) -> dict[str, Array]:
    """Return SALib's statistics by their names, each of shape (d,)."""
    from SALib.analyze import morris

    result = morris.analyze(
        _problem(ranges),
        _unit(ranges, points),
        values,
        num_resamples=RESAMPLES,
        conf_level=LEVEL,
        num_levels=LEVELS,
        seed=np.random.default_rng(seed),
    )
    return {name: np.asarray(result[name], dtype=np.float64) for name in ("mu_star", "mu_star_conf", "mu", "sigma")}


def _bounds(ranges: Ranges, points: Array, values: Array) -> tuple[Array, Array]:
    """Return the least and the largest mu* over all fillings of failed points, each of shape (d,)."""
    d = len(ranges)
    steps = np.diff(_unit(ranges, points).reshape(-1, d + 1, d), axis=1)
    rows = values.reshape(-1, d + 1)
    squares = squared_differences(rows[:, 1:], rows[:, :-1], np.nanmin(values), np.nanmax(values))
    # each step of a trajectory changes one input, so a sum over the steps picks the effect of each
    changed = steps != 0
    size = np.abs(steps).sum(axis=2)
    least, most = ((np.sqrt(square) / size)[:, :, None] * changed for square in squares)
    return least.sum(axis=1).mean(axis=0), most.sum(axis=1).mean(axis=0)
