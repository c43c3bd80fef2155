"""Fit Prony branches to a relaxation test or a dynamic test, and choose their number by AICc.

The model is linear in the moduli E_0 (long-term) and E_i >= 0 of the branches for given times tau_i:

    step at t = 0:  E(t) = E_0 + sum E_i exp(-t / tau_i)
    ramp over T:    E(t) = E_0 + sum E_i (tau_i / T) (1 - exp(-T / tau_i)) exp(-(t - T) / tau_i)    for t >= T,
                    E(t) = E_0 t / T + sum E_i (tau_i / T) (1 - exp(-t / tau_i))                    for t < T,
    dynamic:        E*(w) = E_0 + sum E_i i w tau_i / (1 + i w tau_i),

where E(t) is the stress over that of the elastic silicone with E = 1 at the held stretch, and the elastic stress
rises linearly during the ramp. Residuals have one weight in E(t), and one weight relative to |E*| in storage and
loss.

Non-negative least squares over ten times per decade of the test leave a few groups of neighbours, each of which
becomes a branch. Least squares over log(tau_i), with the moduli from non-negative least squares inside, move the
times within the test, and up to `REACH` beyond the ends at which a branch outside the test still shows. Then the two
neighbours whose merger costs least are merged, until no branch is left. Of all numbers N of branches the least AICc
is chosen (2 N + 2 parameters: moduli, times and the noise); of those within 2 of the least, the fewest branches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput
from geometry.relaxation import Relaxation, branch_moduli
from studies.simulation.law_regression import ALIKE, EXACT, aicc
from studies.simulation.material_tests import Test

PER_DECADE = 10
"""Times per decade of the first search: branches closer than a fifth of a decade cannot be told apart by tests."""
NEGLIGIBLE = 1e-6
"""Share of the modulus below which a branch is rounding."""
MOST_BRANCHES = 12
"""Most branches that are polished: one per decade holds every smooth relaxation within 6 %."""
MOST_POINTS = 400
"""Most points that are fitted one by one: a recording of more is averaged, see `thinned`."""
BINS, GROUPS = 40, 200
"""Intervals per decade of an average: within one, a branch falls by at most 2 % of its share. A recording is also cut
into so many groups of readings: a short span has few of these intervals, but may show all of a decay."""
REACH = {"relaxation": (1.0, 3.0), "dynamic": (3.0, 3.0)}
"""Factors by which times may be shorter than the shortest time of a test, and longer than its longest. A branch that
has relaxed before a relaxation test begins leaves nothing to see."""
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class BranchFit:
    """Branches fitted to a test, whose covered range is that of the test.

    Young's moduli are in MPa, and `..._half_width` is half the width of the 95 % interval; `rms` is the root mean
    square of the residual over the largest E(t), or relative to |E*|.
    """

    relaxation: Relaxation
    instantaneous: float
    long_term: float
    instantaneous_half_width: float
    long_term_half_width: float
    aicc: float
    rms: float

    @property
    def count(self) -> int:
        """Number of branches."""
        return len(self.relaxation.times)


@dataclass(frozen=True, slots=True)
class _Problem:
    """A test as a problem of least squares.

    `b` holds the weighed values over `scale`, MPa, shape (m,), and `weight` the weights of the rows, shape (m,).
    """

    test: Test
    weight: Array
    b: Array
    scale: float

    @property
    def ends(self) -> tuple[float, float]:
        """Shortest and longest time that a branch may have, s."""
        (low, high), (short, long) = self.test.covered, REACH[self.test.kind]
        # points within a ramp show branches that are shorter than the ramp, for which the test does not speak
        low = min(low, float(self.test.at[0])) if self.test.kind == "relaxation" else low
        return low / short, high * long

    def matrix(self, times: Array) -> Array:
        """Return the weighed columns of the long-term modulus and of branches with these times, shape (m, N + 1)."""
        return self.weight[:, None] * kernel(self.test, times)

    def moduli(self, times: Array) -> tuple[Array, float]:
        """Return the moduli for these times over `scale`, shape (N + 1,), and the norm of the residual."""
        from scipy.optimize import nnls

        x, norm = nnls(self.matrix(times), self.b)
        return x, float(norm)


def kernel(test: Test, times: Array) -> Array:
    """Return what the model has for moduli of 1: columns of the long-term modulus and of each time, shape (m, N + 1).

    A dynamic test has all storage moduli first, then all loss moduli: m = 2 n.
    """
    at, tau = test.at[:, None], times[None, :]
    if test.kind == "dynamic":
        storage, loss = branch_moduli(2 * np.pi * test.at, times)
        return np.vstack([np.hstack([np.ones_like(at), storage]), np.hstack([np.zeros_like(at), loss])])
    T = test.ramp or 0.0
    if not T:
        return np.hstack([np.ones_like(at), np.exp(-at / tau)])
    # within the ramp only its elapsed part counts
    elapsed = np.minimum(at, T)
    return np.hstack([elapsed / T, -tau / T * np.expm1(-elapsed / tau) * np.exp(-(at - elapsed) / tau)])


def thinned(test: Test) -> Test:
    """Return a test of at most `MOST_POINTS` points as it is, of a longer one its means over short intervals.

    A machine records at a constant rate: a fit of all points would take long, and gain nothing, because within an
    interval the model is constant. Intervals are log-spaced, and hold at most 1 / `GROUPS` of the readings. Each mean
    has the weight of its readings.
    """
    n = len(test.at)
    if n <= MOST_POINTS:
        return test
    places = np.column_stack([BINS * np.log10(test.at / test.at[0]), np.arange(n) * GROUPS / n]).astype(int)
    _, index, sizes = np.unique(places, axis=0, return_inverse=True, return_counts=True)
    at = np.exp(np.bincount(index, np.log(test.at)) / sizes)
    values = np.bincount(index, test.values.real) / sizes
    if test.kind == "dynamic":
        values = values + 1j * np.bincount(index, test.values.imag) / sizes
    return replace(test, at=at, values=values, counts=sizes.astype(float))


def fit(test: Test) -> tuple[list[BranchFit], int]:
    """Return a fit for each number of branches, the most first, and the index of the chosen one."""
    problem = _problem(test)
    m = len(problem.b)
    times = _first_times(problem, min((m - 4) // 2, MOST_BRANCHES))
    fits: list[BranchFit] = []
    while True:
        times = _polished(problem, times)
        if not fits or len(times) < fits[-1].count:
            fits.append(_assessed(problem, times))
        if not len(times):
            break
        times = _merged(problem, times)
    least = min(each.aicc for each in fits)
    chosen = max(k for k, each in enumerate(fits) if each.aicc <= least + ALIKE)
    if not fits[chosen].long_term > NEGLIGIBLE * fits[chosen].instantaneous:
        raise BadInput(
            "the shares g of the fitted branches add up to 1, so that no stress remains in the long term: test for "
            "longer times or lower frequencies"
        )
    return fits, chosen


def _problem(test: Test) -> _Problem:
    counts = np.ones(len(test.at)) if test.counts is None else test.counts
    each = np.sqrt(counts / counts.mean())
    if test.kind == "dynamic":
        size = np.abs(test.values)
        scale = float(size.max())
        weight = np.tile(each * scale / size, 2)
        return _Problem(test, weight, weight * np.concatenate([test.values.real, test.values.imag]) / scale, scale)
    scale = float(test.values.max())
    return _Problem(test, each, each * test.values / scale, scale)


def _first_times(problem: _Problem, most: int) -> Array:
    """Return the times of groups of neighbours that a search over evenly spaced times leaves; at most `most`."""
    low, high = problem.ends
    grid = np.geomspace(low, high, int(np.ceil(PER_DECADE * np.log10(high / low))) + 2)
    x = problem.moduli(grid)[0][1:]
    found = np.flatnonzero(x > NEGLIGIBLE * x.sum())
    groups = np.split(found, np.flatnonzero(np.diff(found) > 1) + 1) if len(found) else []
    times = np.array([np.exp(np.average(np.log(grid[group]), weights=x[group])) for group in groups])
    while len(times) > most:
        times = _merged(problem, times)
    return times


def _merged(problem: _Problem, times: Array) -> Array:
    x = problem.moduli(times)[0][1:] + 1e-300
    candidates = [np.delete(times, k) for k in range(len(times))]
    for k in range(len(times) - 1):
        middle = np.exp(np.average(np.log(times[k : k + 2]), weights=x[k : k + 2]))
        candidates.append(np.concatenate([times[:k], [middle], times[k + 2 :]]))
    return min(candidates, key=lambda one: problem.moduli(one)[1])


def _polished(problem: _Problem, times: Array) -> Array:
    """Return the times of the least residual near these, within the test; branches without a share are left out."""
    from scipy.optimize import least_squares

    if not len(times):
        return times
    low, high = np.log(problem.ends)

    def residual(logs: Array) -> Array:
        tau = np.exp(logs)
        return np.asarray(problem.matrix(tau) @ problem.moduli(tau)[0] - problem.b)

    start = np.clip(np.log(times), low + 1e-6 * (high - low), high - 1e-6 * (high - low))
    best = least_squares(residual, start, bounds=(low, high), xtol=1e-10, ftol=1e-12, gtol=1e-14, max_nfev=60)
    times = np.sort(np.exp(best.x))
    x = problem.moduli(times)[0]
    return np.asarray(times[x[1:] > NEGLIGIBLE * x.sum()])


def _assessed(problem: _Problem, times: Array) -> BranchFit:
    from scipy.special import stdtrit

    x, norm = problem.moduli(times)
    m, N = len(problem.b), len(times)
    A, step = problem.matrix(times), 1e-6
    ahead, behind = (problem.matrix(times * np.exp(way * step)) for way in (1, -1))
    # derivatives by the moduli and by log(tau): the times are fitted too, which widens the intervals
    jacobian = np.hstack([A, x[1:] * (ahead - behind)[:, 1:] / (2 * step)])
    free = max(m - (2 * N + 1), 1)
    covariance = norm**2 / free * np.linalg.pinv(jacobian.T @ jacobian)
    total = np.concatenate([np.ones(N + 1), np.zeros(N)])
    wide = float(stdtrit(free, (1 + CONFIDENCE) / 2)) * problem.scale
    rms = norm / np.sqrt(m)
    criterion = aicc(m, 2 * N + 2, max(rms, EXACT))
    assert criterion is not None, "the reader refuses tests of too few points"
    # without a long-term modulus the shares add up to 1, which no relaxation may have: `fit` refuses it
    shares = x[1:] / max(x.sum(), 1e-300) * (1 if x[0] > 0 else 1 - 1e-12)
    return BranchFit(
        Relaxation(tuple(shares.tolist()), tuple(times.tolist()), problem.test.covered),
        instantaneous=problem.scale * float(x.sum()),
        long_term=problem.scale * float(x[0]),
        instantaneous_half_width=wide * float(np.sqrt(max(total @ covariance @ total, 0.0))),
        long_term_half_width=wide * float(np.sqrt(max(covariance[0, 0], 0.0))),
        aicc=criterion,
        rms=rms if rms > EXACT else 0.0,
    )


def model(test: Test, fit: BranchFit) -> Array:
    """Return the fitted E(t), or E* as complex numbers, at the points of a test, MPa, shape (n,)."""
    moduli = fit.instantaneous * np.array([fit.relaxation.rest, *fit.relaxation.shares])
    values = kernel(test, np.array(fit.relaxation.times)) @ moduli
    half = len(test.at)
    return np.asarray(values[:half] + 1j * values[half:]) if test.kind == "dynamic" else values
