"""Columns of a sweep as arrays with a dimension for each axis, and which axes have an effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.loads import ANSWERED
from studies.exploration.sweep_axes import Axis, axis_of, index_of

DIGITS = 1e-6
"""Relative difference up to which two values are the same, because scaled results have rounding errors."""


@dataclass(frozen=True, slots=True)
class Cube:
    """A sweep over a grid.

    Attributes
    ----------
    columns : columns of all rows, shape (n,) each.
    axes : by the names of their columns, in the study's order.
    place : index of each row in the flat array over all axes, shape (n,).
    """

    columns: Mapping[str, NDArray[Any]]
    axes: dict[str, Axis]
    place: Ints

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each axis."""
        return tuple(len(axis) for axis in self.axes.values())

    def values(self, column: str) -> Array:
        """Return a column, NaN where a case failed or has no row; shape as `shape`."""
        cube = np.full(self.shape, np.nan)
        given = np.asarray(self.columns[column], dtype=float)
        cube.ravel()[self.place] = np.where(failed(self.columns), np.nan, given)
        return cube

    def failures(self) -> Array:
        """Return the number of failed cases at each place; shape as `shape`."""
        counts = np.bincount(self.place, weights=failed(self.columns), minlength=int(np.prod(self.shape)))
        return counts.reshape(self.shape).astype(np.float64)

    def effective(self, columns: Sequence[str]) -> list[str]:
        """Return the axes along which any of the columns changes, or of which some values have failed cases only.

        If every case failed, all axes of several values count.
        """
        if failed(self.columns).all():
            return [name for name, axis in self.axes.items() if len(axis) > 1]
        changed = np.zeros(len(self.axes), dtype=bool)
        for column in columns:
            changed |= _changes(self.values(column))
        return [name for name, yes in zip(self.axes, changed, strict=True) if yes]


def cube_of(columns: Mapping[str, NDArray[Any]], axes: Mapping[str, Sequence[float | str]]) -> Cube:
    """Return the cube of a sweep's columns."""
    named = {name: axis_of(name, values) for name, values in axes.items()}
    shape = [len(axis) for axis in named.values()]
    count = len(columns["status"])
    if any(len(set(values)) < len(values) for values in axes.values()) and count == np.prod(shape):
        # a value that is repeated does not tell the rows apart, their order does
        return Cube(columns, named, np.arange(count))
    place = np.zeros(count, dtype=np.int64)
    for axis in named.values():
        place = place * len(axis) + index_of(axis, columns[axis.column])
    return Cube(columns, named, place)


def failed(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.bool_]:
    """Return whether each case failed, shape (n,)."""
    return ~np.isin(np.asarray(columns["status"], dtype=str), ANSWERED)


def _changes(cube: Array) -> NDArray[np.bool_]:
    """Return for each axis whether the values change along it."""
    changes = []
    for k in range(cube.ndim):
        others = tuple(axis for axis in range(cube.ndim) if axis != k)
        some = np.isfinite(cube).any(axis=others)
        changes.append(not same(cube, k) or (bool(some.any()) and not some.all()))
    return np.array(changes, dtype=bool)


def same(cube: Array, axis: int) -> bool:
    """Return whether the numbers do not change along an axis; NaN is ignored."""
    most, least = np.fmax.reduce(cube, axis=axis), np.fmin.reduce(cube, axis=axis)
    with np.errstate(invalid="ignore"):
        return not bool((most - least > DIGITS * np.fmax(abs(most), abs(least))).any())


def first(cube: Array, axes: Sequence[int]) -> Array:
    """Return the first number along these axes, which stay with length 1."""
    for k in axes:
        at = np.expand_dims(np.isfinite(cube).argmax(axis=k), k)
        cube = np.take_along_axis(cube, at, axis=k)
    return cube


def extreme(cube: Array, axes: Sequence[int]) -> Array:
    """Return the value of greatest magnitude along these axes, which stay with length 1."""
    for k in axes:
        at = np.expand_dims(np.where(np.isfinite(cube), abs(cube), -1.0).argmax(axis=k), k)
        cube = np.take_along_axis(cube, at, axis=k)
    return cube


def effect(cube: Array, k: int) -> float:
    """Return the mean range of the values along an axis; 0 where nothing can be compared."""
    ranges = np.fmax.reduce(cube, axis=k) - np.fmin.reduce(cube, axis=k)
    ranges = ranges[np.isfinite(ranges)]
    return float(ranges.mean()) if len(ranges) else 0.0
