"""Readings of the Hall elements for many rows at once: designs and poses of the magnet in arrays.

The values are those of `analytic.hall.readings`, row by row, to a relative error of 1e-13: that of the field, whose
implementation depends on the number of points (see `analytic.magnet`), and the rounding of a product with the
remanence. Each pose of each magnet beside each set of elements is evaluated once, so that rows which differ in E, in
the remanence or in gains cost no field.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from analytic.hall import FLIP, converted, plates, rotated
from analytic.magnet import cylinder_field, on_rim
from analytic.parts import conversion, of_design
from geometry.arrays import Array
from geometry.design import Design

ELEMENTS = 3
"""Number of elements of every layout."""
BLOCK = 8192
"""Number of rows whose field is computed at a time, at up to 12 points each: it bounds the memory to some 50 MB."""
PLACES = attrgetter(
    "magnet_diameter", "magnet_height", "D", "L", "l0", "hall_layout", "f", "c", "hall_plate", "chip_x"
)
"""Fields of a design that fix the field of its magnet at its elements, in units of the remanence."""


@dataclass(frozen=True, slots=True, eq=False)
class BatchReadings:
    """Readings of the three elements of n rows; NaN, and not saturated, where there is no reading.

    Attributes
    ----------
    field_T : flux density B.n that each element measures, shape (n, 3), T.
    output : output of each element, in whole steps and within the rails, shape (n, 3), V, or T for a chip.
    saturated : whether the output lies at a rail, shape (n, 3).
    """

    field_T: Array
    output: Array
    saturated: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A magnet and the points at which its elements sample the field.

    Attributes
    ----------
    radius, height : of the magnet, mm; 0 for none.
    points, normals : relative to the magnet's centre at rest, mm, and directions n, shape (m, 3).
    """

    radius: float
    height: float
    points: Array
    normals: Array


def batch_readings(designs: Sequence[Design], owner: NDArray[np.int64], shift: Array, tilt: Array) -> BatchReadings:
    """Return the readings of n rows; row i belongs to the design `designs[owner[i]]`.

    Parameters
    ----------
    owner : index of each row's design, shape (n,).
    shift : displacement of the magnet's centre, shape (n, 3), mm; NaN for no pose.
    tilt : rotation vectors (rx, ry) as in `analytic.hall.field_at`, shape (n, 2), rad; NaN for no pose.

    Returns
    -------
    BatchReadings
        NaN for all three elements of a row without a pose or a magnet, or with a point on the magnet's rim, where the
        field is infinite.
    """
    if not len(owner):
        return BatchReadings(
            np.zeros((0, ELEMENTS)), np.zeros((0, ELEMENTS)), np.zeros((0, ELEMENTS), dtype=np.bool_)
        )
    numbers: dict[tuple[float | str, ...], int] = {}
    place_of_design = np.array([numbers.setdefault(PLACES(design), len(numbers)) for design in designs])
    first = np.unique(place_of_design, return_index=True)[1]
    places = [_place(designs[k]) for k in first]
    place = place_of_design[owner]
    with_magnet = np.array([p.radius > 0 for p in places])
    rows = np.flatnonzero(with_magnet[place] & np.isfinite(shift).all(axis=1) & np.isfinite(tilt).all(axis=1))
    chosen, number = _distinct(place[rows], *shift[rows].T, *tilt[rows].T)
    distinct = rows[chosen]
    scale = np.array([design.remanence for design in designs])[owner[rows]]
    measured = np.full((len(owner), ELEMENTS), np.nan)
    measured[rows] = scale[:, None] * _unit_fields(places, place[distinct], shift[distinct], tilt[distinct])[number]
    gain, null, low, high, _, step = np.array([conversion(design) for design in designs])[owner].T[:, :, None]
    output, saturated = converted(null + gain * measured, low, high, step)
    return BatchReadings(measured, output, saturated)


def _place(design: Design) -> _Place:
    elements = of_design(design)
    points, owners = plates(elements)
    normals = np.array([element.direction for element in elements])[owners]
    return _Place(design.magnet_diameter / 2, design.magnet_height, points - [0.0, 0.0, design.H], normals)


def _distinct(*columns: NDArray[np.generic]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the index of one row of each distinct combination, and the number of each row's combination.

    >>> _distinct(np.array([0, 1, 0]), np.array([0.5, 0.5, 0.5]))
    (array([0, 1]), array([0, 1, 0]))
    """
    # a sort by columns takes a tenth of the time of np.unique, which compares whole rows
    order = np.lexsort(columns)
    new = np.ones(len(order), dtype=np.bool_)
    if len(order):
        new[1:] = np.any([column[order[1:]] != column[order[:-1]] for column in columns], axis=0)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return order[new], number


def _unit_fields(places: Sequence[_Place], place: NDArray[np.int64], shift: Array, tilt: Array) -> Array:
    """Return B.n of the elements at a remanence of 1 T, shape (n, 3), of rows with a magnet and a pose."""
    fields = np.empty((len(place), ELEMENTS))
    # one call of the field serves all rows whose magnets and numbers of points are equal
    kinds: dict[tuple[float, ...], int] = {}
    kind_of_place = np.array([kinds.setdefault((p.radius, p.height, len(p.points)), len(kinds)) for p in places])
    kind = kind_of_place[place]
    for (radius, height, _), k in kinds.items():
        rows, members = np.flatnonzero(kind == k), np.flatnonzero(kind_of_place == k).tolist()
        points = np.stack([places[number].points for number in members])
        normals = np.stack([places[number].normals for number in members])
        for start in range(0, len(rows), BLOCK):
            part = rows[start : start + BLOCK]
            member = np.searchsorted(members, place[part])
            fields[part] = _block(radius, height, points[member], normals[member], shift[part], tilt[part])
    return fields


def _block(radius: float, height: float, points: Array, normals: Array, shift: Array, tilt: Array) -> Array:
    """Return B.n of the elements at a remanence of 1 T, shape (n, 3), at points and directions (n, m, 3)."""
    turn = tilt[:, None, :]
    local = np.ascontiguousarray(FLIP * rotated(points - shift[:, None, :], -turn)).reshape(-1, 3)
    rim = on_rim(local, radius, height)
    # any place off the rim: the row becomes NaN
    local[rim] = 0.0
    field = cylinder_field(local, radius, height, 1.0)
    field[rim] = np.nan
    values = (rotated(FLIP * field.reshape(points.shape), turn) * normals).sum(axis=-1)
    measured = values.reshape(len(points), ELEMENTS, -1).mean(axis=-1)
    measured[np.isnan(measured).any(axis=1)] = np.nan
    return np.asarray(measured)
