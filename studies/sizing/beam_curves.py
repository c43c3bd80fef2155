"""Responses of n beams over their force ranges, as smooth functions of depth and shear.

The same functions serve the surrogate, for thousands of beams at once, and finite elements, for the beams of a front.
A source of responses (`Beams`) is evaluated at few depths and shears. Between them:

- under a press, a response is a polynomial in the root of the depth, because the contact radius grows like it;
- under a shear s, what reverses with the shear (sideways shift, tilt, sideways force) is s (a + b s^2), and what does
  not (sinking, press force) is the press's value + s^2 (a + b s^2), where a and b are polynomials in that root.

A beam is dimensionless: lengths over D, forces over E D^2. Its loads are F / (E D^2) for the modulus E at hand, so
one beam answers for the whole range of E of its silicone. `softer` curves are those at one end of the source's
intervals, at which deformations are the largest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.polynomial import chebyshev

from geometry.arrays import Array
from studies.mechanics import surrogate_range

PRESS_DEPTHS = 8
"""Number of depths under a press."""
SHEARED_DEPTHS = 3
"""Number of depths at which the shear is evaluated."""
SHEAR_SHARES = np.array([0.5, 1.0])
"""Shears at each of them, over the shear at the end of the range."""
TRIAL_SHEAR = 0.08
"""Shear over D at which the sideways stiffness is evaluated, to find the shears of the range."""
RESERVE = 1.05
"""Shear to which a beam is evaluated over that which the sideways force needs: other depths may need more."""
LEAST_SHEAR = 0.01
"""Least shear at the end of the range, over D: below it, differences between responses would be rounding errors."""
STEPS = 6
"""Newton steps of the inversion of the shear, in which the force is nearly linear."""
ODD, EVEN = ("shift_x", "tilt", "force_x"), ("shift_z", "force_z")
"""What reverses with the shear, and what does not; shift_z is down, positive."""


class Quantity(Protocol):
    """Values and the half widths of their intervals, of equal shape."""

    @property
    def value(self) -> Array: ...
    @property
    def half_width(self) -> Array: ...


class Beams(Protocol):
    """Responses of n dimensionless beams, see `studies.mechanics.prediction`."""

    def press(self, depth: Array) -> Mapping[str, Quantity]: ...
    def shear(self, depth: Array, shear: Array) -> Mapping[str, Quantity]: ...
    def critical_depth(self) -> Quantity: ...
    def stable_to(self, caution: float) -> Array: ...
    def first_mode(self, density_ratio: Array) -> Quantity: ...


@dataclass(frozen=True, slots=True, eq=False)
class PressCurves:
    """Responses to presses: quantities at the depths of n beams, shape (n, PRESS_DEPTHS).

    Attributes
    ----------
    deepest : largest depth of each beam, shape (n,).
    values, half_widths : force, shift (down, positive), strain and contact radius, by name.
    """

    deepest: Array
    values: Mapping[str, Array]
    half_widths: Mapping[str, Array]

    def place(self, depth: Array) -> Array:
        """Return the root of depths (n, k) on the interval from the least to the largest one, -1 to 1."""
        low, high = _roots(self.deepest)
        return np.asarray(2 * (np.sqrt(depth) - low) / (high - low) - 1)

    def at(self, name: str, depth: Array) -> Array:
        """Return a quantity at depths (n, k)."""
        return _polynomial(self.values[name], self.place(depth))

    def slope(self, name: str, depth: Array) -> Array:
        """Return the slope of a quantity along the depth at depths (n, k)."""
        low, high = _roots(self.deepest)
        inner = 1 / (np.sqrt(depth) * (high - low))
        return _polynomial(self.values[name], self.place(depth), slope=True) * inner

    def softer(self, caution: float) -> PressCurves:
        """Return the curves with less force, more shift and more strain by `caution` half widths."""
        signs = {"force": -caution, "shift": caution, "strain": caution}
        changed = {name: self.values[name] + sign * self.half_widths[name] for name, sign in signs.items()}
        return replace(self, values={**self.values, **changed})

    def depth_of_force(self, force: Array) -> Array:
        """Return the depths under forces (n, k), within the range of depths."""
        grid = np.linspace(-1, 1, 129)
        low, high = _roots(self.deepest)
        curve = _polynomial(self.values["force"], np.broadcast_to(grid, (len(force), len(grid))))
        # a rising curve even where rounding or noise of the source makes it level
        curve = np.maximum.accumulate(curve, axis=1)
        root = np.array([np.interp(f, y, grid) for f, y in zip(force, curve, strict=True)]).reshape(force.shape)
        return np.asarray((low + (high - low) * (root + 1) / 2) ** 2)


@dataclass(frozen=True, slots=True, eq=False)
class ShearCurves:
    """Responses to shears: what they add to the press, at the depths and shears of n beams.

    Attributes
    ----------
    low, high : roots of the least and the largest depth, shape (n, 1).
    depth : depths, shape (n, SHEARED_DEPTHS).
    shear : shears, shape (n, SHEARED_DEPTHS, len(SHEAR_SHARES)).
    values, half_widths : responses at these shears, by name, each of that shape.
    first, third : the coefficients a and b of each quantity at these depths, shape (n, SHEARED_DEPTHS).
    """

    low: Array
    high: Array
    depth: Array
    shear: Array
    values: Mapping[str, Array]
    half_widths: Mapping[str, Array]
    first: Mapping[str, Array]
    third: Mapping[str, Array]

    def _coefficients(self, name: str, depth: Array, *, slope: bool = False) -> tuple[Array, Array]:
        # above the least depth of the shears their coefficients stay what they are there
        place = np.maximum(2 * (np.sqrt(depth) - self.low) / (self.high - self.low) - 1, -1.0)
        parts = [_polynomial(values[name], place, slope=slope) for values in (self.first, self.third)]
        if slope:
            parts = [part / (np.sqrt(depth) * (self.high - self.low)) for part in parts]
        return parts[0], parts[1]

    def at(self, press: PressCurves, name: str, depth: Array, shear: Array) -> tuple[Array, Array, Array]:
        """Return a quantity at depths and shears (n, k), its slope along the depth and its slope along the shear."""
        a, b = self._coefficients(name, depth)
        a_slope, b_slope = self._coefficients(name, depth, slope=True)
        if name in ODD:
            return (
                shear * (a + b * shear**2),
                shear * (a_slope + b_slope * shear**2),
                a + 3 * b * shear**2,
            )
        base = {"shift_z": "shift", "force_z": "force"}[name]
        return (
            press.at(base, depth) + shear**2 * (a + b * shear**2),
            press.slope(base, depth) + shear**2 * (a_slope + b_slope * shear**2),
            2 * shear * (a + 2 * b * shear**2),
        )

    def softer(self, caution: float) -> ShearCurves:
        """Return the curves with less sideways force, more of other motions and more strain by `caution` half widths.

        What does not reverse with the shear is added to the press, whose curves say how uncertain it is.
        """
        first, third = dict(self.first), dict(self.third)
        for name in ODD:
            share = (self.half_widths[name] / np.abs(self.values[name]))[..., -1]
            factor = np.maximum(1 - caution * share, 0.0) if name == "force_x" else 1 + caution * share
            first[name], third[name] = factor * first[name], factor * third[name]
        strain = self.values["strain"] + caution * self.half_widths["strain"]
        return replace(self, values={**self.values, "strain": strain}, first=first, third=third)

    def farthest(self, depth: Array) -> Array:
        """Return the largest shears at depths (n, k) to which the beams were evaluated."""
        ends = self.shear[:, :, -1]
        place = np.maximum(2 * (np.sqrt(depth) - self.low) / (self.high - self.low) - 1, -1.0)
        return np.asarray(np.minimum(_polynomial(ends, place), ends.max(axis=1, keepdims=True)))

    def reached(self, depth: Array) -> Array:
        """Return the sideways forces that are reached at depths (n, k); NaN at depths where shears are not known."""
        a, b = self._coefficients("force_x", depth)
        shear = self.farthest(depth)
        known = depth >= (1 - 1e-9) * surrogate_range.SHALLOWEST_SHEAR
        return np.asarray(np.where(known, shear * (a + b * shear**2), np.nan))

    def strain(self, force: Array) -> Array:
        """Return the strains at these depths under sideways forces, shape (n,), at most at the last shears."""
        shear = self.shear_of_force(np.broadcast_to(force[:, None], self.depth.shape), self.depth)
        near, far = (self.shear[:, :, k] for k in (0, 1))
        share = np.clip((shear - near) / (far - near), 0.0, 1.0)
        return np.asarray((1 - share) * self.values["strain"][..., 0] + share * self.values["strain"][..., 1])

    def shear_of_force(self, force: Array, depth: Array) -> Array:
        """Return the shears under sideways forces (n, k) at depths (n, k)."""
        a, b = self._coefficients("force_x", depth)
        # a curve that does not rise has no shear for a force
        with np.errstate(divide="ignore", invalid="ignore"):
            shear = force / a
            for _ in range(STEPS):
                shear = shear - (shear * (a + b * shear**2) - force) / (a + 3 * b * shear**2)
        return np.asarray(shear)


def press_depths(deepest: Array) -> Array:
    """Return the depths at which presses are evaluated, rising, shape (n, PRESS_DEPTHS)."""
    low, high = _roots(deepest)
    return np.asarray((low + (high - low) * (_nodes(PRESS_DEPTHS) + 1) / 2) ** 2)


def press_curves(beams: Beams, deepest: Array) -> PressCurves:
    """Return the responses to presses down to the depths `deepest`, shape (n,)."""
    answer = beams.press(press_depths(deepest))
    return PressCurves(
        deepest,
        {name: each.value for name, each in answer.items()},
        {name: each.half_width for name, each in answer.items()},
    )


def shear_curves(
    beams: Beams,
    press: PressCurves,
    low: Array,
    high: Array,
    force: Array,
    farthest: Array,
    guess: Array | None = None,
    caution: float = 0.0,
) -> ShearCurves:
    """Return the responses to shears up to a sideways force, with `RESERVE`, or up to the farthest shear.

    Parameters
    ----------
    low, high : least and largest depth, shape (n,).
    force : sideways force at the end of the range, shape (n,).
    farthest : largest shear of each beam, shape (n,).
    guess : shears at the end of the range at each depth, (n, SHEARED_DEPTHS), where they are known already.
    caution : the force is reached even where the beams are softer by so many half widths.
    """
    # equal ends would leave no interval to interpolate over
    low = np.maximum(low, surrogate_range.SHALLOWEST_SHEAR)
    high = np.maximum(high, 1.02 * low)
    roots = np.sqrt(low)[:, None], np.sqrt(high)[:, None]
    depth = (roots[0] + (roots[1] - roots[0]) * (_nodes(SHEARED_DEPTHS) + 1) / 2) ** 2
    if guess is None:
        trial = np.full(depth.shape, TRIAL_SHEAR)
        stiffness = beams.shear(depth, trial)["force_x"].value / TRIAL_SHEAR
        first = _sheared(beams, press, roots, depth, force[:, None] / np.maximum(stiffness, 1e-6), farthest)
        needed = first.softer(caution).shear_of_force(np.broadcast_to(force[:, None], depth.shape), depth)
        # a force that the curve never reaches has no shear
        guess = RESERVE * np.where(needed > 0, needed, np.inf)
    return _sheared(beams, press, roots, depth, guess, farthest)


def _sheared(
    beams: Beams, press: PressCurves, roots: tuple[Array, Array], depth: Array, end: Array, farthest: Array
) -> ShearCurves:
    """Return the responses to shears up to `end`, shape (n, SHEARED_DEPTHS), between LEAST_SHEAR and `farthest`."""
    end = np.clip(end, LEAST_SHEAR, farthest[:, None])
    shear = end[:, :, None] * SHEAR_SHARES
    flat = shear.reshape(len(depth), -1)
    answer = beams.shear(np.repeat(depth, len(SHEAR_SHARES), axis=1), flat)
    values = {name: each.value.reshape(shear.shape) for name, each in answer.items()}
    widths = {name: each.half_width.reshape(shear.shape) for name, each in answer.items()}
    base = {"shift_z": press.at("shift", depth), "force_z": press.at("force", depth)}
    first, third = {}, {}
    for name in (*ODD, *EVEN):
        over = shear if name in ODD else shear**2
        ratio = (values[name] - (0.0 if name in ODD else base[name][:, :, None])) / over
        third[name] = (ratio[..., 1] - ratio[..., 0]) / (shear[..., 1] ** 2 - shear[..., 0] ** 2)
        first[name] = ratio[..., 0] - third[name] * shear[..., 0] ** 2
    return ShearCurves(*roots, depth, shear, values, widths, first, third)


def _roots(deepest: Array) -> tuple[float, Array]:
    """Return the roots of the least and of the largest depths, the latter of shape (n, 1)."""
    return float(np.sqrt(surrogate_range.SHALLOWEST)), np.sqrt(deepest)[:, None]


def _nodes(count: int) -> Array:
    """Return Chebyshev's points with both ends, rising, -1 to 1."""
    return np.asarray(chebyshev.chebpts2(count))


def _polynomial(values: Array, place: Array, *, slope: bool = False) -> Array:
    """Return the polynomials through `values` (n, m) at Chebyshev's points, or their slopes, at places (n, k)."""
    count = values.shape[1]
    inverse = np.linalg.inv(chebyshev.chebvander(_nodes(count), count - 1))
    coefficients = inverse @ values.T
    if slope:
        coefficients = np.asarray(chebyshev.chebder(coefficients), dtype=np.float64)
    terms = chebyshev.chebvander(place, coefficients.shape[0] - 1)
    return np.asarray(np.einsum("nkm,mn->nk", terms, coefficients))
