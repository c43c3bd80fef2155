"""Readings of n sensors at their poses: how finely they resolve the force, whether they saturate and decode uniquely.

The poses are one table of rows, sensor after sensor, with equally many rows each.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analytic import force_resolution
from analytic.batch_readings import batch_readings
from analytic.force_resolution import STEP, Loaded
from analytic.parts import common_values, of_design
from geometry.arrays import Array, Ints
from studies.sensitivity.made_sensors import MadeSensors, made_readings
from studies.sizing.candidate_variables import Variant


class Reader(Protocol):
    """What sensors read at poses; k rows for each sensor."""

    def fields(self, shift: Array, tilt: Array) -> Array:
        """Return the flux densities that the elements measure, shape (n k, 3), T."""

    def slopes(self, loaded: Loaded) -> Array:
        """Return their slopes along depth and shears, shape (n k, 3, 3), T/mm."""

    def rail_margin(self, shift: Array, tilt: Array) -> Array:
        """Return the least distance of a reading from its rail, over that in zero field, shape (n k,)."""

    def noise(self) -> Array:
        """Return the standard deviation of a reading of each sensor, shape (n,), T."""


@dataclass(frozen=True, slots=True)
class NominalReader:
    """Sensors as designed: slopes with the least remanence of the magnet's grade, rails with the largest."""

    variants: Sequence[Variant]

    def fields(self, shift: Array, tilt: Array) -> Array:
        """Return the flux densities with the middle of the remanence's range, shape (n k, 3), T."""
        designs = [each.design for each in self.variants]
        return batch_readings(designs, self._owner(len(shift)), shift, tilt).field_T

    def slopes(self, loaded: Loaded) -> Array:
        """Return the slopes, shape (n k, 3, 3), T/mm."""
        weak = [dataclasses.replace(each.design, remanence=each.magnet.remanence_low) for each in self.variants]
        return force_resolution.reading_slopes(weak, self._owner(len(loaded.shift)), loaded)

    def rail_margin(self, shift: Array, tilt: Array) -> Array:
        """Return the margins, shape (n k,)."""
        strong = [dataclasses.replace(each.design, remanence=each.magnet.remanence_high) for each in self.variants]
        owner = self._owner(len(shift))
        field = batch_readings(strong, owner, shift, tilt).field_T
        gain, null, low, high, *_ = np.array([common_values(design) for design in strong])[owner].T[:, :, None]
        return _margin(null + gain * field, null, low, high)

    def noise(self) -> Array:
        """Return the noise, shape (n,), T."""
        return np.array([of_design(each.design)[0].noise_T for each in self.variants])

    def _owner(self, rows: int) -> Ints:
        return np.repeat(np.arange(len(self.variants)), rows // len(self.variants))


@dataclass(frozen=True, slots=True)
class MadeReader:
    """Sensors as they are made, with their own magnets, gains and displaced parts."""

    sensors: MadeSensors

    def fields(self, shift: Array, tilt: Array) -> Array:
        """Return the flux densities, shape (n k, 3), T."""
        n = len(self.sensors)
        return made_readings(self.sensors, shift.reshape(n, -1, 3), tilt.reshape(n, -1, 2)).field_T.reshape(-1, 3)

    def slopes(self, loaded: Loaded) -> Array:
        """Return the slopes by central differences, as `analytic.force_resolution.reading_slopes` does."""
        half = STEP * self.sensors.nominal.D
        columns = []
        for k in range(3):
            step = half * loaded.shift_slopes[:, :, k], half * loaded.tilt_slopes[:, :, k]
            ahead, behind = (self.fields(loaded.shift + w * step[0], loaded.tilt + w * step[1]) for w in (1, -1))
            columns.append((ahead - behind) / (2 * half))
        return np.stack(columns, axis=2)

    def rail_margin(self, shift: Array, tilt: Array) -> Array:
        """Return the margins, shape (n k,)."""
        sensors, rows = self.sensors, len(shift) // len(self.sensors)
        gain, null, low, high, *_ = common_values(sensors.nominal)
        zero = np.repeat(null + sensors.null_shift, rows, axis=0)
        raw = zero + gain * np.repeat(sensors.gain_factor, rows, axis=0) * self.fields(shift, tilt)
        return _margin(raw, zero, np.full_like(raw, low), np.full_like(raw, high))

    def noise(self) -> Array:
        """Return the noise, shape (n,), T: of the element with the least gain."""
        return np.asarray(of_design(self.sensors.nominal)[0].noise_T / self.sensors.gain_factor.min(axis=1))


def _margin(raw: Array, null: Array, low: Array, high: Array) -> Array:
    """Return the least distance of outputs (n, 3) from their rails, over that of the null, shape (n,)."""
    return np.asarray(np.minimum((high - raw) / (high - null), (raw - low) / (null - low)).min(axis=1))


def decoding(reader: Reader, loaded: Loaded, n: int) -> tuple[Array, Array, Array]:
    """Return the worst standard deviations of the force components, shape (n, 3), N, and how far decoding is unique.

    The latter are the least scaled det J, negative if its sign changes, and the least distance between the readings
    of two poses, in standard deviations of the noise, each of shape (n,). det J is scaled by the lengths of its
    columns.
    """
    noise = np.repeat(reader.noise(), len(loaded.shift) // n)[:, None] * np.ones(3)
    slopes = reader.slopes(loaded)
    sigma = force_resolution.force_resolution(slopes, loaded.force_slopes, noise)
    length = np.linalg.norm(slopes, axis=1)
    columns = slopes / np.where(length == 0, 1.0, length)[:, None, :]
    # where a slope is not known, nor is the determinant
    with np.errstate(invalid="ignore"):
        scaled = np.linalg.det(columns).reshape(n, -1)
    turned = scaled * np.sign(np.median(scaled, axis=1))[:, None]
    values = (reader.fields(loaded.shift, loaded.tilt) / noise).reshape(n, -1, 3)
    apart = np.linalg.norm(values[:, :, None] - values[:, None], axis=3)
    same = np.arange(values.shape[1])
    apart[:, same, same] = np.inf
    return sigma.reshape(n, -1, 3).max(axis=1), turned.min(axis=1), apart.min(axis=(1, 2))
