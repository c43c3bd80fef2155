"""Readings of the Hall elements for many rows at once: designs and poses of the magnet in arrays.

The values are those of `analytic.hall.readings`, row by row, up to the rounding of a product with the remanence. Each
pose of each magnet beside each set of elements is evaluated once, so that rows which differ in E, in the remanence or
in gains cost no field.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from analytic.hall import FLIP, converted, half_sides, rotated
from analytic.magnet import field_or_nan
from analytic.parts import AXES, common_values
from geometry.arrays import Array
from geometry.cad import element_positions
from geometry.design import Design

ELEMENTS = len(AXES)
"""Number of elements of every layout."""
BLOCK = 8192
"""Number of rows whose field is computed at a time, at up to 12 points each: it bounds the memory to some 50 MB."""
SITE = attrgetter("magnet_diameter", "magnet_height", "D", "L", "l0", "f", "c", "hall_plate", "hall_layout", "chip_x")
"""Returns the fields of a design that fix the field of its magnet at its elements, but for the remanence."""


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
    values = np.array([common_values(design) for design in designs])
    numbers: dict[tuple[float | str, ...], int] = {}
    # by a dictionary of fields, because the positions would cost a sweep over E more than all else
    of_design = np.array([numbers.setdefault(SITE(design), len(numbers)) for design in designs])
    sites = np.array([_site(designs[k], values[k, -1]) for k in np.unique(of_design, return_index=True)[1]])
    site = of_design[owner]
    with_magnet = sites[site, 1] > 0
    rows = np.flatnonzero(with_magnet & np.isfinite(shift).all(axis=1) & np.isfinite(tilt).all(axis=1))
    chosen, number = _distinct(site[rows], *shift[rows].T, *tilt[rows].T)
    distinct = rows[chosen]
    scale = np.array([design.polarisation for design in designs])[owner[rows]]
    measured = np.full((len(owner), ELEMENTS), np.nan)
    measured[rows] = scale[:, None] * _unit_fields(sites[site[distinct]], shift[distinct], tilt[distinct])[number]
    gain, null, low, high, _, step, _ = values[owner].T[:, :, None]
    output, saturated = converted(null + gain * measured, low, high, step)
    return BatchReadings(measured, output, saturated)


def _site(design: Design, plate: float) -> list[float]:
    """Return plate, diameter and height of the magnet, height of its centre at rest, positions of elements, mm."""
    centres = [value for position in element_positions(design) for value in position]
    return [plate, design.magnet_diameter, design.magnet_height, design.H, *centres]


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


def _unit_fields(sites: Array, shift: Array, tilt: Array) -> Array:
    """Return B.n of the elements at a remanence of 1 T, shape (n, 3), of rows with a magnet and a pose.

    `sites` has the `_site` of each row, shape (n, 13).
    """
    fields = np.empty((len(sites), ELEMENTS))
    # one call of the field serves all rows whose magnets and numbers of points are equal
    kind = _distinct(sites[:, 1], sites[:, 2], sites[:, 0] > 0)[1]
    order = np.argsort(kind, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(kind[order])) + 1):
        for at in np.split(rows, range(BLOCK, len(rows), BLOCK)):
            if len(at):
                fields[at] = _block(sites[at], shift[at], tilt[at])
    return fields


def _block(sites: Array, shift: Array, tilt: Array) -> Array:
    """Return `_unit_fields` of rows whose magnets and numbers of points are equal."""
    plate, (diameter, height) = sites[:, 0], sites[0, 1:3].tolist()
    # relative to the magnet's centre at rest, shape (n, 3, points of an element, 3)
    centres = sites[:, 4:].reshape(-1, ELEMENTS, 3) - sites[:, 3, None, None] * [0.0, 0.0, 1.0]
    points = centres[:, :, None]
    if plate.any():
        sides = [half_sides(np.array(axis), plate[:, None]) for axis in AXES]
        aside, across = (np.stack(side, axis=1) for side in zip(*sides, strict=True))
        points = np.stack([centres + i * aside + j * across for i in (-1, 1) for j in (-1, 1)], axis=2)
    turn = tilt[:, None, None, :]
    local = np.ascontiguousarray(FLIP * rotated(points - shift[:, None, None, :], -turn)).reshape(-1, 3)
    field = field_or_nan(local, diameter / 2, height, 1.0)
    normals = np.array(AXES)[:, None, :]
    measured = (rotated(FLIP * field.reshape(points.shape), turn) * normals).sum(axis=-1).mean(axis=-1)
    measured[np.isnan(measured).any(axis=1)] = np.nan
    return np.asarray(measured)
