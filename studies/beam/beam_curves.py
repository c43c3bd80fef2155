"""Responses of n beams as smooth functions of depth and shear, and the states under required loads.

The same functions serve the surrogate, for thousands of beams at once, and finite elements, for the beams of a front.
A `studies.beam.beam_model.BeamModel` is evaluated at few depths and shears. Between them:

- under a press, a response is a polynomial in the root of the depth, because the contact radius grows like it;
- under a shear s, what reverses with the shear (sideways shift, tilt, sideways force) is s times a polynomial in s^2,
  what does not (sinking, press force) is the press's value plus s^2 times such a polynomial, and so is the logarithm
  of the strain, without a press's value. Their coefficients are polynomials in that root.

A beam is dimensionless: lengths over D, forces over E D^2. Nothing is extrapolated: a load beyond the evaluated
depths and shears has NaN. `softer` curves are those at one end of the source's intervals, at which deformations are
the largest.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from geometry.arrays import Array
from studies.beam import surrogate_range
from studies.beam.beam_model import BeamModel

PRESS_DEPTHS = 8
"""Number of depths under a press."""
SHEARED_DEPTHS, SOLVED_DEPTHS = 5, 4
"""Number of depths at which the surrogate, and finite elements on their shorter interval, evaluate the shear."""
STEPS = 8
"""Newton steps to the depth and the shear of a load."""
CLOSE = 1e-5
"""Relative difference of the forces from the load up to which a state counts as reached."""
PRESSED = ("force_z", "shift_z", "strain")
SHEARED = ("shift_x", "shift_z", "tilt", "force_x", "force_z", "strain")
"""Quantities in the order of the curves."""
EVEN = {"shift_z": 1, "force_z": 0}
"""What does not reverse with the shear, and its place in `PRESSED`."""


@dataclass(frozen=True, slots=True, eq=False)
class States:
    """States under k loads of n beams, each array of shape (n, k); NaN where a load is not reached.

    Attributes
    ----------
    depth, shear, strain : over D, and largest principal nominal strain.
    plane, by_depth, by_shear : shift along the shear and down, tilt, force along the shear and normal force, and
        their slopes, shape (n, k, 5).
    """

    depth: Array
    shear: Array
    strain: Array
    plane: Array
    by_depth: Array
    by_shear: Array


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """Responses of n beams.

    Attributes
    ----------
    deepest : largest depth of the presses, shape (n, 1).
    press, press_widths : `PRESSED` at `PRESS_DEPTHS` depths, and half widths, shape (n, PRESS_DEPTHS, 3).
    low, high : least and largest depth of the shears, shape (n, 1).
    farthest : largest shears at the depths of `depths_between`, shape (n, count).
    shear : coefficients of `SHEARED`, shape (n, count, 6, m).
    shear_widths : half widths of `SHEARED` over their values, shape (n, count, 6).
    """

    deepest: Array
    press: Array
    press_widths: Array
    low: Array
    high: Array
    farthest: Array
    shear: Array
    shear_widths: Array

    def softer(self, caution: float, *, sheared: bool = True) -> Curves:
        """Return the curves with less force, more motion and more strain by `caution` half widths.

        sheared : whether the widths of the shears count; those of a small shear are those of the press, and say
            nothing of its slopes.
        """
        if not caution:
            return self
        press = self.press + caution * np.array([-1.0, 1.0, 1.0]) * self.press_widths
        shear = self.shear
        if sheared:
            # what does not reverse is added to the press, whose curves say how uncertain it is
            share = caution * self.shear_widths
            factor = 1 + share * np.array([1.0, 0.0, 1.0, -1.0, 0.0, 0.0])
            shear = shear * np.maximum(factor, 0.0)[..., None]
            shear[:, :, 5, 0] += np.log(np.maximum(1 + share[:, :, 5], 1e-3))
        return replace(self, press=press, shear=shear)

    def take(self, rows: Any) -> Curves:
        """Return the curves of some beams."""
        return Curves(*(getattr(self, name)[rows] for name in self.__slots__))

    def depth_of_force(self, force: Array) -> Array:
        """Return the depths of presses under forces (n, k); NaN for a force that no evaluated depth has."""
        grid = np.linspace(-1, 1, 129)
        curve = np.maximum.accumulate(self.press[:, :, 0] @ _basis(grid, PRESS_DEPTHS).T, axis=1)
        right = np.clip((curve[:, :, None] < force[:, None]).sum(axis=1), 1, len(grid) - 1)
        left_force, right_force = (np.take_along_axis(curve, right - k, axis=1) for k in (1, 0))
        rise = right_force - left_force
        share = np.where(rise > 0, (force - left_force) / np.where(rise > 0, rise, 1.0), 0.0)
        place = grid[right - 1] + share * (grid[1] - grid[0])
        low, high = np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(self.deepest)
        reached = (force >= curve[:, :1] * (1 - 1e-9)) & (force <= curve[:, -1:] * (1 + 1e-9))
        return np.where(reached, (low + (high - low) * (place + 1) / 2) ** 2, np.nan)

    def pressed(self, depth: Array) -> tuple[Array, Array]:
        """Return `PRESSED` and their slopes at depths (n, k), shape (n, k, 3)."""
        return _through(self.press, depth, np.sqrt(surrogate_range.SHALLOWEST), np.sqrt(self.deepest))

    def sheared(self, depth: Array, shear: Array) -> tuple[Array, Array, Array]:
        """Return `SHEARED` at depths and shears (n, k), and their slopes along both, shape (n, k, 6)."""
        n, nodes, width, m = self.shear.shape
        low, high = np.sqrt(self.low), np.sqrt(self.high)
        found = _through(self.shear.reshape(n, nodes, width * m), depth, low, high)
        square = shear**2
        sums = [_powers(part.reshape(*depth.shape, width, m), square[..., None]) for part in found]
        (value, grow), (by_depth, _) = sums
        press, press_slopes = self.pressed(depth)
        s = shear[..., None]
        values, slopes, along = s * value, s * by_depth, value + 2 * s**2 * grow
        for name, at in EVEN.items():
            k = SHEARED.index(name)
            values[..., k] = press[..., at] + square * value[..., k]
            slopes[..., k] = press_slopes[..., at] + square * by_depth[..., k]
            along[..., k] = 2 * shear * (value[..., k] + square * grow[..., k])
        values[..., 5] = np.exp(value[..., 5])
        return values, slopes, along

    def reach(self, depth: Array) -> tuple[Array, Array]:
        """Return the largest shears at depths (n, k), and the sideways forces there; NaN where no shear is known."""
        known = (depth >= self.low * (1 - 1e-9)) & (depth <= self.high * (1 + 1e-9))
        inside = np.where(known, depth, np.nan)
        far, _ = _through(self.farthest[:, :, None], inside, np.sqrt(self.low), np.sqrt(self.high))
        farthest = np.minimum(far[..., 0], self.farthest.max(axis=1, keepdims=True))
        return farthest, self.sheared(inside, farthest)[0][..., 3]

    def states(self, force_z: Array, force_x: Array) -> States:
        """Return the states under normal forces and forces along the plate, shape (n, k), over E D^2."""
        depth = self.depth_of_force(force_z)
        press, _ = self.pressed(depth)
        shear, aside = np.zeros_like(depth), np.flatnonzero((force_x != 0).any(axis=0))
        if len(aside):
            ends = self._shears_of(*(each[:, aside] for each in (depth, force_z, force_x)))
            depth[:, aside], shear[:, aside] = ends
        values, slopes, along = self.sheared(depth, shear)
        # above the least depth of the shears the slope of a small shear stays what it is there
        strain = np.where(force_x == 0, press[..., 2], values[..., 5])
        return States(depth, shear, strain, values[..., :5], slopes[..., :5], along[..., :5])

    def shears_of(self, depth: Array, force_x: Array) -> Array:
        """Return the shears under forces along the plate at depths (n, k), at most the largest ones."""
        shear = np.full_like(depth, 0.05)
        for _ in range(STEPS):
            values, _, along = self.sheared(depth, shear)
            shear = np.clip(
                shear + (force_x - values[..., 3]) / along[..., 3], 0.0, self.farthest.max(axis=1)[:, None]
            )
        return shear

    def _shears_of(self, depth: Array, force_z: Array, force_x: Array) -> tuple[Array, Array]:
        """Return the depths and shears at which both forces are the wanted ones, NaN where a load is not reached.

        Newton's method, from the depth of the press and one step beyond `CLOSE`.
        """
        n, nodes, _, m = self.shear.shape
        # of all quantities only the forces, and the largest shears
        table = np.concatenate([self.shear[:, :, 3:5].reshape(n, nodes, 2 * m), self.farthest[:, :, None]], axis=2)
        low, high = self.low, self.high
        depth, shear = np.clip(depth, low, high), np.full_like(depth, 0.1)
        met = done = np.zeros(depth.shape, dtype=np.bool_)
        for step in range(STEPS):
            value, slope = _through(table, depth, np.sqrt(low), np.sqrt(high))
            base, base_slope = (part[..., 0] for part in self.pressed(depth))
            square, far = shear**2, value[..., -1]
            (x, x_grow), (z, z_grow) = (_powers(value[..., k : k + m], square) for k in (0, m))
            (x_deep, _), (z_deep, _) = (_powers(slope[..., k : k + m], square) for k in (0, m))
            off_x, off_z = force_x - shear * x, force_z - base - square * z
            before, met = met, (np.abs(off_x) <= CLOSE * force_x) & (np.abs(off_z) <= CLOSE * force_z)
            met &= (shear <= far * (1 + 1e-9)) & (low * (1 - 1e-9) <= depth) & (depth <= high * (1 + 1e-9))
            done = done | (before & met)
            if step == STEPS - 1 or done.all():
                break
            a, b = x + 2 * square * x_grow, shear * x_deep
            c, d = 2 * shear * (z + square * z_grow), base_slope + square * z_deep
            with np.errstate(divide="ignore", invalid="ignore"):
                along, down = ((d * off_x - b * off_z) / (a * d - b * c), (a * off_z - c * off_x) / (a * d - b * c))
            shear = np.where(done, shear, np.clip(shear + along, 0.0, far * 1.0001))
            depth = np.where(done, depth, np.clip(depth + down, 0.999 * low, 1.001 * high))
        return np.where(met, depth, np.nan), np.where(met, shear, np.nan)


def depths_between(low: Array, high: Array, count: int) -> Array:
    """Return the depths at which presses or shears are evaluated, rising, shape (n, count)."""
    first, last = np.sqrt(low)[:, None], np.sqrt(high)[:, None]
    return np.asarray((first + (last - first) * (_nodes(count) + 1) / 2) ** 2)


def pressed_curves(beams: BeamModel, deepest: Array) -> Curves:
    """Return the responses of beams to presses down to depths (n,); their shears are not known."""
    depth = depths_between(np.full_like(deepest, surrogate_range.SHALLOWEST), deepest, PRESS_DEPTHS)
    found = beams.states(depth, np.zeros_like(depth)).quantities
    press, widths = (np.stack([getattr(found[name], part) for name in PRESSED], axis=2) for part in _PARTS)
    none, end = np.full((len(deepest), SHEARED_DEPTHS), np.nan), deepest[:, None]
    unknown = np.full((*none.shape, len(SHEARED)), np.nan)
    return Curves(end, press, widths, end, end, none, unknown[..., None], unknown)


def with_shears(
    pressed: Curves, beams: BeamModel, low: Array, high: Array, farthest: Array, shares: Sequence[float]
) -> Curves:
    """Return curves with the responses to shears at these shares, rising to 1, of the largest ones (n, count).

    low, high : least and largest depth of shears, shape (n,).
    """
    # equal ends would leave no interval to interpolate over
    high = np.maximum(high, 1.02 * low)
    depth, m = depths_between(low, high, farthest.shape[1]), len(shares)
    shear = farthest[:, :, None] * np.array(shares)
    found = beams.states(np.repeat(depth, m, axis=1), shear.reshape(len(depth), -1)).quantities
    values, widths = (
        np.stack([getattr(found[name], part).reshape(shear.shape) for name in SHEARED], axis=2) for part in _PARTS
    )
    base, _ = pressed.pressed(depth)
    forms = values / shear[:, :, None]
    for name, at in EVEN.items():
        k = SHEARED.index(name)
        forms[:, :, k] = (values[:, :, k] - base[:, :, [at]]) / shear**2
    forms[:, :, 5] = np.log(values[:, :, 5])
    # the polynomials through the shares; their squares are scaled so that one matrix serves all beams
    scale = farthest[:, :, None, None] ** (2 * np.arange(m))
    matrix = np.linalg.inv(np.vander(np.array(shares) ** 2, increasing=True))
    coefficients = (forms @ matrix.T) / scale
    return replace(
        pressed,
        low=low[:, None],
        high=high[:, None],
        farthest=farthest,
        shear=coefficients,
        shear_widths=widths[..., -1] / np.abs(values[..., -1]),
    )


_PARTS = ("value", "half_width")


@functools.cache
def _nodes(count: int) -> Array:
    return np.asarray(chebyshev.chebpts2(count))


@functools.cache
def _matrices(count: int) -> tuple[Array, Array]:
    """Return the matrices from values at the nodes to the coefficients of their powers, and of their slope's."""
    powers: Array = np.linalg.inv(np.vander(_nodes(count), increasing=True)).astype(np.float64)
    return powers, np.arange(1, count)[:, None] * powers[1:]


def _basis(place: Array, count: int) -> Array:
    """Return the polynomials that are 1 at one node each, at places (...), shape (..., count)."""
    return np.asarray(place[..., None] ** np.arange(count) @ _matrices(count)[0])


def _through(values: Array, depth: Array, low: Any, high: Any) -> tuple[Array, Array]:
    """Return the polynomials in the root of the depth through values (n, nodes, q), and their slopes, (n, k, q).

    Above the least depth a polynomial stays what it is there.
    """
    count = values.shape[1]
    root = np.sqrt(depth)
    place = np.maximum(2 * (root - low) / (high - low) - 1, -1.0)
    powers = np.empty((*place.shape, count))
    powers[..., 0] = 1.0
    for k in range(1, count):
        powers[..., k] = powers[..., k - 1] * place
    matrix, slope = _matrices(count)
    inner = 1 / (root * (high - low))
    return powers @ (matrix @ values), (powers[..., :-1] @ (slope @ values)) * inner[..., None]


def _powers(coefficients: Array, square: Array) -> tuple[Array, Array]:
    """Return polynomials in `square` with coefficients (..., m), and their slopes along it."""
    value, slope = coefficients[..., -1], np.zeros_like(coefficients[..., -1])
    for k in range(coefficients.shape[-1] - 2, -1, -1):
        slope = slope * square + value
        value = value * square + coefficients[..., k]
    return value, slope
