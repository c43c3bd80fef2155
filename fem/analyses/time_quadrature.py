"""Integrals of force over motion, or stress over strain, from their values at the ends of time steps.

Work of the plate, int F dx, and of the stresses, int S : dC/2 dV, are integrated by the same rule, of third order in
the steps: X and Y of int X dY follow the polynomial in time of degree 3 through the last four states of a smooth
motion, of a lower degree at its beginning. In a body of small strain both sides have the same errors, since each
state is in equilibrium; so what remains of their difference comes from large strain, and from points of the skin
that touch within a step.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array

SAMPLES = 4
"""Values that the polynomial runs through."""


@dataclass(frozen=True, slots=True)
class TimeIntegral:
    """An integral int X dY over time.

    Attributes
    ----------
    times : (k,) times of the last samples of a smooth motion, oldest first, s.
    X, Y : values at these times, of one shape each.
    products : (k, k) sums of X_a Y_b.
    base : the integral up to the first sample while all samples of the motion are kept; None later.
    total : the integral up to the last sample.
    """

    times: tuple[float, ...]
    X: tuple[Array, ...]
    Y: tuple[Array, ...]
    products: Array
    base: float | None
    total: float

    def add(self, time: float, x: Array, y: Array) -> TimeIntegral:
        """Return the integral with one sample more, at a later time."""
        kept = slice(-(SAMPLES - 1), None)
        times, X, Y = (*self.times[kept], time), (*self.X[kept], x), (*self.Y[kept], y)
        products = np.empty((len(X), len(X)))
        products[:-1, :-1] = self.products[kept, kept]
        products[-1] = [np.vdot(x, one) for one in Y]
        products[:-1, -1] = [np.vdot(one, y) for one in X[:-1]]
        whole = self.base is not None and len(self.times) < SAMPLES
        weights = product_weights(times, 0 if whole else len(times) - 2)
        before = self.base if whole and self.base is not None else self.total
        return TimeIntegral(
            times, X, Y, products, self.base if whole else None, before + float(np.vdot(weights, products))
        )


def begin(time: float, x: Array, y: Array, total: float = 0.0) -> TimeIntegral:
    """Return an integral at the beginning of a smooth motion, with what it was before."""
    return TimeIntegral((time,), (x,), (y,), np.array([[np.vdot(x, y)]]), total, total)


@functools.lru_cache(maxsize=4)
def product_weights(times: tuple[float, ...], first: int) -> Array:
    """Return w_ab = int L_a dL_b/dt dt from sample `first` to the last one, with Lagrange's polynomials of the times.

    Parameters
    ----------
    times : k times, increasing.

    Returns
    -------
    Array
        (k, k); exact for polynomials of degree k - 1.

    >>> product_weights((0.0, 2.0), 0).tolist()
    [[-0.5, 0.5], [-0.5, 0.5]]
    """
    at = (np.array(times) - times[0]) / (times[-1] - times[0])
    # coefficients (power, a) of the polynomials
    lagrange = np.linalg.inv(np.vander(at, increasing=True))
    points, weights = _gauss(len(at))
    start, half = at[first], (1 - at[first]) / 2
    x = start + half * (1 + points)
    powers = np.vander(x, len(at), increasing=True)
    slopes = np.zeros_like(powers)
    slopes[:, 1:] = powers[:, :-1] * np.arange(1, len(at))
    return np.asarray((powers @ lagrange).T @ (half * weights[:, None] * (slopes @ lagrange)))


@functools.cache
def _gauss(count: int) -> tuple[Array, Array]:
    """Return points and weights of Gauss's rule on (-1, 1)."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return points, weights
