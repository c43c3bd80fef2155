"""Readings of the Hall elements for many rows at once: designs and poses of the magnet in arrays.

The values are those of `analytic.hall.readings`, row by row, up to rounding. Designs whose magnets and elements have
the same sizes and places share one forward model, so that those which differ in E, in the remanence or in gains cost
little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from analytic import hall
from analytic.parts import AXES, common_values, of_design
from geometry.arrays import Array
from geometry.design import Design

ELEMENTS = len(AXES)
"""Number of elements of every layout."""
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
    common = np.array([common_values(design) for design in designs])
    numbers: dict[tuple[float | str, ...], int] = {}
    # by a dictionary of fields, because the positions would cost a sweep over E more than all else
    site_of = np.array([numbers.setdefault(SITE(design), len(numbers)) for design in designs])
    site, first = site_of[owner], np.unique(site_of, return_index=True)[1]
    order = np.argsort(site, kind="stable")
    posed: NDArray[np.bool_] = np.asarray(np.isfinite(np.hstack([shift, tilt])).all(axis=1))
    measured = np.full((len(owner), ELEMENTS), np.nan)
    for all_rows in np.split(order, np.flatnonzero(np.diff(site[order])) + 1):
        design, rows = designs[first[site[all_rows[0]]]], all_rows[posed[all_rows]]
        if design.shape.has_magnet and len(rows):
            elements = of_design(design)
            points, owners = hall.plates_of(elements)
            poses = (np.repeat(values[rows], len(points), axis=0) for values in (shift, tilt))
            b = hall.field_at(np.tile(points, (len(rows), 1)), design, *poses, refuse=False)
            measured[rows] = hall.means_over_plates(b, elements, owners) / design.polarisation
    measured *= np.array([design.polarisation for design in designs])[owner, None]
    measured[np.isnan(measured).any(axis=1)] = np.nan
    gain, null, low, high, _, step, _ = common[owner].T[:, :, None]
    output, saturated = hall.converted(null + gain * measured, low, high, step)
    return BatchReadings(measured, output, saturated)
