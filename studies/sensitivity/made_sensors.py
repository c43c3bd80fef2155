"""Made sensors: designs that deviate from a nominal one within tolerances, drawn with a seed, and their readings.

Their deviations are those of `studies.parts.part_tolerances`. Of parts that are sold, E, nu and remanence are those
of a batch, which lies anywhere in the ranges of the catalogue. A seed gives each sensor numbers of its own: the k-th
is the same whatever the number of sensors, and a tolerance or a batch does not change its other deviations.

Each sensor is an independent draw, so that a share of them has a binomial sampling error. The casting moves the
magnet in the silicone and the assembly moves the elements. These deviations change the readings. Their effect on the
mechanics is neglected: the silicone still deforms as if the magnet were centred and upright.

The magnet's offset turns with the silicone around it, and its tilt adds to that of the state. Outputs are those
before the converter rounds them: a step of a chip is no deviation of a sensor, and would hide in which sense its
reading changes.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from analytic.hall import BatchReadings, batch_readings, converted, rotated
from analytic.parts import common_values
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.parts.part_tolerances import (
    CUT,
    SPECS,
    Parts,
    Tolerances,
    tolerances,
    tolerances_of,
    values_at,
)

OF_CHIPS = ("chip_gain", "chip_null")
"""Tolerances of each axis of each chip."""
PLACES = ("hall_x", "hall_y", "hall_z")
"""Tolerances of the place of each one-axis element or chip."""
OF_PARTS = 0.25
"""Share of a catalogue's range that is the scatter of parts within a batch; assumed: no source parts the two."""
MAGNET_DIGITS = 2
"""Decimals of the size of a magnet that is sold, mm: magnets of equal size share the computation of their fields."""
MOST_SENSORS = 1_000_000
"""Largest number of made sensors; more are taken for a mistake."""


@dataclass(frozen=True, slots=True, eq=False)
class MadeSensors:
    """n made sensors.

    Attributes
    ----------
    nominal : the design that was to be made.
    designs : design of each sensor, with its own `fields`; None where it is impossible.
    refusals : why each sensor is impossible, "" where it is possible.
    fields : E, nu, remanence, magnet_diameter and magnet_height of each sensor, shape (n,), MPa, 1, T, mm, mm.
    magnet_offset : displacement of the magnet in the silicone, shape (n, 3), mm.
    magnet_tilt : rotation vector (rx, ry) of the magnetisation in the silicone, shape (n, 2), rad.
    element_offset : displacement of each element, shape (n, k, 3): sensor, element, axis, mm.
    gain_factor : gain of each element over its nominal gain, shape (n, k).
    null_shift : null of each element less its nominal null, shape (n, k), V, or T for a chip.
    """

    nominal: Design
    designs: tuple[Design | None, ...]
    refusals: tuple[str, ...]
    fields: Mapping[str, Array]
    magnet_offset: Array
    magnet_tilt: Array
    element_offset: Array
    gain_factor: Array
    null_shift: Array

    def __len__(self) -> int:
        return len(self.designs)

    def one(self, k: int) -> MadeSensors:
        """Return one of the sensors."""
        rows = slice(k, k + 1)
        parts = {name: getattr(self, name)[rows] for name in self.__slots__ if name not in ("nominal", "fields")}
        return MadeSensors(self.nominal, fields={name: v[rows] for name, v in self.fields.items()}, **parts)


def made_sensors(
    design: Design,
    sizes: Tolerances = tolerances(),
    count: int = 1000,
    seed: int = 0,
    *,
    parts: Parts | None = None,
    middle: Array | None = None,
) -> MadeSensors:
    """Draw made sensors of a design.

    Parameters
    ----------
    parts : what the sensors are made of. E, nu and remanence of a silicone and a magnet that are known lie in batches
        within what is sold, unless their tolerances are others than those of the parts; default: none is known.
    middle : where the batch of each sensor lies, see `batch_middles`; default: each is of a batch of its own.
    """
    check_draw(design, count, seed)
    unit = _unit_deviations(count, seed, design.element_count)
    deviation = {name: sizes[name] * values for name, values in unit.items()}
    fields = {
        **{name: getattr(design, name) * (1 + deviation[name] / 100) for name in ("E", "remanence")},
        # no silicone has more than 0.5: a deviation beyond it counts to the other side
        "nu": np.clip(0.5 - np.abs(design.nu + deviation["nu"] - 0.5), 0.0, 0.5),
        **{name: getattr(design, name) + deviation[name] for name in ("magnet_diameter", "magnet_height")},
    }
    if parts is not None:
        middle = batch_middles(count, seed) if middle is None else middle
        share = middle + OF_PARTS / 2 * np.column_stack([unit[name] for name in ("E", "nu", "remanence")])
        usual, sold = tolerances_of(design, parts), values_at(design, parts, share)
        known = {"E": parts.silicone, "nu": parts.silicone, "remanence": parts.magnet}
        fields |= {name: sold[name] for name in sold if known[name] is not None and sizes[name] == usual[name]}
    if parts is not None and parts.magnet is not None:
        fields |= {name: fields[name].round(MAGNET_DIGITS) for name in ("magnet_diameter", "magnet_height")}
    rows = [dict(zip(fields, row, strict=True)) for row in np.column_stack(list(fields.values())).tolist()]
    designs, refusals = zip(*(possible(dataclasses.replace, design, **row) for row in rows), strict=True)
    places = np.stack([deviation[name] for name in PLACES], axis=-1)
    chip = design.hall_layout != "three"
    return MadeSensors(
        nominal=design,
        designs=designs,
        refusals=refusals,
        fields=fields,
        magnet_offset=np.stack([deviation[name] for name in ("magnet_x", "magnet_y", "magnet_z")], axis=-1),
        magnet_tilt=np.radians(deviation["magnet_tilt"]),
        # the three axes of a chip are in one case
        element_offset=np.repeat(places[:, : int(design.chip_count)], 3, axis=1) if chip else places,
        gain_factor=1 + deviation["chip_gain" if chip else "hall_gain"] / 100,
        null_shift=deviation["chip_null" if chip else "hall_null"],
    )


def batch_middles(count: int, seed: int) -> Array:
    """Return the middles of independent batches, shape (n, 3): shares of the ranges of E, nu and remanence."""
    # a stream of its own, or batches would have the numbers of deviations
    (random,) = np.random.default_rng(seed).spawn(1)
    return batches_at(random.random((count, 3)))


def batches_at(share: Array) -> Array:
    """Return the middles of batches at shares of where they may lie: a batch is `OF_PARTS` of its range wide, and
    lies within it."""
    return OF_PARTS / 2 + (1 - OF_PARTS) * share


def check_draw(design: Design, count: int, seed: int) -> None:
    """Raise BadInput unless made sensors of a design can be drawn, and so many of them."""
    if not 1 <= count <= MOST_SENSORS:
        raise BadInput(f"the number of made sensors must be from 1 to {MOST_SENSORS}; got {count}")
    if not seed >= 0:
        raise BadInput(f"the seed must be 0 or more; got {seed}")
    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0), so no sensor of it has readings")


def nominal_sensor(design: Design) -> MadeSensors:
    """Return the one sensor that has no deviations, in the same form."""
    return made_sensors(design, dict.fromkeys(SPECS, 0.0), 1)


def _unit_deviations(count: int, seed: int, elements: int = 3) -> dict[str, Array]:
    """Return deviations over their tolerance, -1 to 1, by its name, of shape (n,), or (n, k) if it has several."""
    widths = [int(spec["columns"]) for spec in SPECS.values()]
    # one table of random numbers for all: a tolerance of 0 must not shift the numbers of the others
    uniform = np.random.default_rng(seed).random((count, sum(widths)))
    if elements > 3:  # nor must further chips
        # the axes of a chip have gains and nulls of their own, and one place
        more = dict.fromkeys(OF_CHIPS, elements - 3) | dict.fromkeys(PLACES, max(elements // 3 - 3, 0))
        further = np.random.default_rng([seed, elements]).random((count, sum(more.values())))
        for name, width in more.items():
            after = sum(widths[: list(SPECS).index(name) + 1])
            added, further = further[:, :width], further[:, width:]
            uniform = np.hstack([uniform[:, :after], added, uniform[:, after:]])
            widths[list(SPECS).index(name)] += width
    deviations = {}
    for name, columns in zip(SPECS, np.split(uniform, np.cumsum(widths)[:-1], axis=1), strict=True):
        inside = ndtr(-CUT) + columns * (ndtr(CUT) - ndtr(-CUT))
        values = 2 * columns - 1 if SPECS[name]["shape"] == "uniform" else ndtri(inside) / CUT
        deviations[name] = values if columns.shape[1] > 1 else values[:, 0]
    return deviations


def possible(make: Callable[..., Design], *given: Any, **fields: float) -> tuple[Design | None, str]:
    """Return what is made of these, or None and why it is impossible."""
    try:
        return make(*given, **fields), ""
    except BadInput as error:
        return None, str(error)


def share_with_error(count: float, total: float, level: float = 0.95) -> tuple[float, float, float]:
    """Return a share and its confidence interval by Clopper and Pearson, such as that of sensors in specification.

    >>> [round(value, 3) for value in share_with_error(950, 1000)]
    [0.95, 0.935, 0.963]
    """
    from scipy.stats import beta

    tail = (1 - level) / 2
    low = 0.0 if count == 0 else float(beta.ppf(tail, count, total - count + 1))
    high = 1.0 if count == total else float(beta.ppf(1 - tail, count + 1, total - count))
    return (count / total if total else math.nan), low, high


def made_readings(sensors: MadeSensors, shift: Array, tilt: Array) -> BatchReadings:
    """Return the readings of n sensors in k states, shape (n, k, m), with outputs that are not rounded.

    They are NaN, and not saturated, where there is no pose or no sensor. Shift (n, k, 3), mm, and rotation vector
    (rx, ry) (n, k, 2), rad, are those of the magnet by the load.
    """
    count, states = shift.shape[:2]
    # None stands for an impossible sensor: any design may take its place, since its rows have no pose
    designs = [design or sensors.nominal for design in sensors.designs]
    possible = np.array([design is not None for design in sensors.designs])
    shift = np.where(possible[:, None, None], shift, np.nan)
    # rotation vectors add up to a turn about z, which moves the axis of the magnet by a third-order angle only
    turn = tilt + sensors.magnet_tilt[:, None]
    moved = shift + rotated(sensors.magnet_offset[:, None], tilt)
    owner, offset = np.repeat(np.arange(count), states), np.repeat(sensors.element_offset, states, axis=0)
    rows = batch_readings(designs, owner, moved.reshape(-1, 3), turn.reshape(-1, 2), offset)
    field = rows.field_T.reshape(count, states, offset.shape[1])
    gain, null, low, high, *_ = common_values(sensors.nominal)
    raw = null + sensors.null_shift[:, None] + gain * sensors.gain_factor[:, None] * field
    output, saturated = converted(raw, np.array(low), np.array(high), np.array(0.0))
    return BatchReadings(field, output, saturated)
