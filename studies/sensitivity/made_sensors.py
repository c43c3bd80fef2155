"""Made sensors: designs whose values deviate from a nominal design within tolerances, drawn with a seed.

Each sensor is an independent draw, so that a share of them has a binomial sampling error. The casting moves the
magnet in the silicone and the assembly moves the elements. These deviations change the readings. Their effect on the
mechanics is neglected: the silicone still deforms as if the magnet were centred and upright.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.sensitivity.tolerances import CUT, Tolerances

ELEMENTS = 3
"""Number of elements, or of axes of a chip."""
MOST_SENSORS = 1_000_000
"""Largest number of made sensors; more are taken for a mistake."""
COLUMNS = {"magnet_tilt": 2, **dict.fromkeys(("hall_x", "hall_y", "hall_z", "hall_gain", "chip_gain"), ELEMENTS)} | {
    "hall_null": ELEMENTS,
    "chip_null": ELEMENTS,
}
"""Number of independent deviations of a tolerance that has several: about two axes, or of each element."""


@dataclass(frozen=True, slots=True, eq=False)
class MadeSensors:
    """n made sensors.

    Attributes
    ----------
    nominal : the design that was to be made.
    designs : design of each sensor, with its own E, nu, remanence and magnet; None where it is impossible.
    refusals : why each sensor is impossible, "" where it is possible.
    E, nu, remanence, magnet_diameter, magnet_height : values of each sensor, shape (n,), MPa, 1, T, mm, mm.
    magnet_offset : displacement of the magnet in the silicone, shape (n, 3), mm.
    magnet_tilt : rotation vector (rx, ry) of the magnetisation in the silicone, shape (n, 2), rad.
    element_offset : displacement of each element, shape (n, 3, 3): sensor, element, axis, mm.
    gain_factor : gain of each element over its nominal gain, shape (n, 3).
    null_shift : null of each element less its nominal null, shape (n, 3), V, or T for a chip.
    """

    nominal: Design
    designs: tuple[Design | None, ...]
    refusals: tuple[str, ...]
    E: Array
    nu: Array
    remanence: Array
    magnet_diameter: Array
    magnet_height: Array
    magnet_offset: Array
    magnet_tilt: Array
    element_offset: Array
    gain_factor: Array
    null_shift: Array

    def __len__(self) -> int:
        return len(self.designs)


def made_sensors(
    design: Design,
    tolerances: Tolerances = Tolerances(),
    count: int = 1000,
    seed: int = 0,
    *,
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> MadeSensors:
    """Draw made sensors of a design.

    A tolerance does not change the deviations of the others: with the same seed each sensor keeps them.

    Parameters
    ----------
    ranges : of E, nu or remanence, in place of their tolerances: half of the sensors lie between each end and the
        design's value.

    Raises
    ------
    BadInput
        The count or the seed is out of range, or the design has no magnet.
    """
    check_draw(design, count, seed)
    unit = _unit_deviations(tolerances, count, seed)
    deviation = {name: getattr(tolerances, name) * values for name, values in unit.items()}
    fields = {
        # the rounding error of 0.4998 + 0.0002 must not make a Poisson's ratio above 0.5, nor may the tolerance
        "nu": np.clip(design.nu + deviation["nu"], 0.0, 0.5),
        **{name: getattr(design, name) * (1 + deviation[name] / 100) for name in ("E", "remanence")},
        **{name: getattr(design, name) + deviation[name] for name in ("magnet_diameter", "magnet_height")},
    }
    for name, (low, high) in (ranges or {}).items():
        middle, u = getattr(design, name), unit[name]
        fields[name] = middle + np.where(u < 0, u * (middle - low), u * (high - middle))
    designs, refusals = zip(*(_possible(design, fields, k) for k in range(count)), strict=True)
    places = np.stack([deviation[name] for name in ("hall_x", "hall_y", "hall_z")], axis=-1)
    chip = design.hall_layout != "three"
    return MadeSensors(
        nominal=design,
        designs=designs,
        refusals=refusals,
        **fields,
        magnet_offset=np.stack([deviation[name] for name in ("magnet_x", "magnet_y", "magnet_z")], axis=-1),
        magnet_tilt=np.radians(deviation["magnet_tilt"]),
        # the three axes of a chip are in one case
        element_offset=np.repeat(places[:, :1], ELEMENTS, axis=1) if chip else places,
        gain_factor=1 + deviation["chip_gain" if chip else "hall_gain"] / 100,
        null_shift=deviation["chip_null" if chip else "hall_null"],
    )


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
    none = Tolerances(**{spec.name: 0.0 for spec in dataclasses.fields(Tolerances)})
    return made_sensors(design, none, 1)


def _unit_deviations(tolerances: Tolerances, count: int, seed: int) -> dict[str, Array]:
    """Return deviations over their tolerance, -1 to 1, by its name, of shape (n,), or (n, k) if it has several."""
    specs = dataclasses.fields(tolerances)
    widths = [COLUMNS.get(spec.name, 1) for spec in specs]
    # one table of random numbers for all: a tolerance of 0 must not shift the numbers of the others
    unit = np.random.default_rng(seed).random((count, sum(widths)))
    deviations = {}
    for spec, columns in zip(specs, np.split(unit, np.cumsum(widths)[:-1], axis=1), strict=True):
        if spec.metadata["shape"] == "uniform":
            values = 2 * columns - 1
        else:
            inside = ndtr(-CUT) + columns * (ndtr(CUT) - ndtr(-CUT))
            values = ndtri(inside) / CUT
        deviations[spec.name] = values if spec.name in COLUMNS else values[:, 0]
    return deviations


def _possible(design: Design, fields: Mapping[str, Array], k: int) -> tuple[Design | None, str]:
    """Return the design of a made sensor, or None and the reason why it is impossible."""
    values: dict[str, Any] = {name: float(column[k]) for name, column in fields.items()}
    try:
        return dataclasses.replace(design, **values), ""
    except BadInput as error:
        return None, str(error)


def share_with_error(count: int, total: int, level: float = 0.95) -> tuple[float, float, float]:
    """Return a share and its confidence interval by Clopper and Pearson, such as that of sensors in specification.

    >>> [round(value, 3) for value in share_with_error(950, 1000)]
    [0.95, 0.935, 0.963]
    """
    from scipy.stats import beta

    tail = (1 - level) / 2
    low = 0.0 if count == 0 else float(beta.ppf(tail, count, total - count + 1))
    high = 1.0 if count == total else float(beta.ppf(1 - tail, count + 1, total - count))
    return (count / total if total else math.nan), low, high
