"""Peaks, half-power widths and bandwidths of a gain that is known at any frequency of a band."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array

Gain = Callable[[Array], Array]
"""Gain at frequencies (f,), Hz; one positive number for each."""
GRID = 600
"""Frequencies of the grid on which peaks are looked for. On three decades they are 1.2 % apart; a peak narrower than
that still rises towards its place from both sides."""
NEAR = np.concatenate([-np.geomspace(1e-4, 0.01, 8)[::-1], [0.0], np.geomspace(1e-4, 0.01, 8)])
"""Logarithms of frequencies over that of a resonance at which its peak is drawn."""
PROMINENCE = 1e-3
"""Height of a peak over the valleys beside it, relative: rounding errors and the mesh make smaller ones."""
BAND = 600.0
"""Highest frequency at which the paper used its sensor, Hz (section IV.C)."""
ACCURATE = 0.05
"""Relative change of a reading that counts as accurate: the paper's limit for its force."""
TO_HALF_POWER = math.sqrt(0.5)
"""Gain at half the power of a peak, and at the end of a bandwidth (-3 dB)."""


@dataclass(frozen=True, slots=True)
class Peak:
    """A resonance: a largest gain inside the band.

    frequency, gain : place, Hz, and height.
    width : distance of the two frequencies with half the power, Hz; None if one of them is outside the band, or
        beyond another rise of the gain.
    """

    frequency: float
    gain: float
    width: float | None

    @property
    def Q(self) -> float | None:
        """Quality factor: frequency over width. A spring with loss factor eta has 1 / eta."""
        return None if self.width is None else self.frequency / self.width


def grid(low: float, high: float) -> Array:
    """Return the frequencies between low and high, Hz, on which gains are compared."""
    return np.geomspace(low, high, GRID)


def around(tops: Sequence[float], frequencies: Array) -> Array:
    """Return frequencies (f,), Hz, that draw resonances at `tops` in full height: those given, a grid, and some near.

    >>> around([10.0], np.array([1.0, 100.0])).shape
    (617,)
    """
    low, high = float(frequencies[0]), float(frequencies[-1])
    near = np.outer(np.asarray(tops, dtype=np.float64), np.exp(NEAR)).ravel()
    every = np.concatenate([frequencies, grid(low, high)[1:-1], near[(near > low) & (near < high)]])
    return np.unique(every)


def peaks(gain: Gain, low: float, high: float) -> list[Peak]:
    """Return the resonances between low and high, Hz, in rising order."""
    from scipy.optimize import minimize_scalar
    from scipy.signal import find_peaks

    f = grid(low, high)
    values = gain(f)
    inside, _ = find_peaks(np.log(values), prominence=PROMINENCE)
    resonances = []
    for i in inside.tolist():
        ends = (math.log(f[i - 1]), math.log(f[i + 1]))
        top = minimize_scalar(
            lambda x: -_single(gain, math.exp(x)), bounds=ends, method="bounded", options={"xatol": 1e-9}
        )
        frequency, height = math.exp(top.x), -float(top.fun)
        left = _crossing(gain, height * TO_HALF_POWER, np.append(f[:i], frequency)[::-1])
        right = _crossing(gain, height * TO_HALF_POWER, np.append(frequency, f[i + 1 :]))
        width = None if left is None or right is None else right - left
        resonances.append(Peak(frequency, height, width))
    return resonances


def bandwidth(gain: Gain, low: float, high: float) -> float | None:
    """Return the frequency at which the gain is first 3 dB below that at the lowest one; None beyond the band."""
    f, level = grid(low, high), TO_HALF_POWER * _single(gain, low)
    below = np.flatnonzero(gain(f) < level)
    return None if not len(below) else _root(gain, level, f, int(below[0]))


def flat_to(gain: Gain, error: float, low: float, high: float) -> float | None:
    """Return the frequency up to which the gain stays within a relative error of that at the lowest frequency.

    None if it does so in the whole band.
    """
    f, first = grid(low, high), _single(gain, low)
    outside = np.flatnonzero(np.abs(gain(f) / first - 1) > error)
    if not len(outside):
        return None
    i = int(outside[0])
    level = first * (1 + math.copysign(error, float(gain(f[i : i + 1])[0]) / first - 1))
    return _root(gain, level, f, i)


def _crossing(gain: Gain, level: float, f: Array) -> float | None:
    """Return where the gain falls to a level along frequencies (n,) that begin at a peak; None if it rises first."""
    values = gain(f)
    for i, (one, other) in enumerate(itertools.pairwise(values.tolist())):
        if other > one:
            return None
        if other <= level:
            return _root(gain, level, f, i + 1)
    return None


def _root(gain: Gain, level: float, f: Array, i: int) -> float:
    from scipy.optimize import brentq

    if i == 0:
        return float(f[0])
    return float(brentq(lambda x: _single(gain, x) - level, f[i - 1], f[i], xtol=1e-12, rtol=1e-12))


def _single(gain: Gain, frequency: float) -> float:
    return float(gain(np.array([frequency]))[0])
