"""Tolerances of made sensors: how far each value may lie from the design's, with source and distribution.

A tolerance T is the largest deviation. A "uniform" deviation has equal density from -T to T. A "normal" deviation has
the standard deviation T/2 before it is cut off at -T and T, as if parts outside were sorted out.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from geometry.design import BadInput
from studies.inputs.user_input import parse_choices

Shape = Literal["normal", "uniform"]
CUT = 2.0
"""Number of standard deviations at which a normal deviation is cut off: 4.6 % of parts are sorted out."""


def _tolerance(default: float, unit: str, shape: Shape, text: str, source: str, *, assumed: bool = True) -> Any:
    metadata = {"unit": unit, "shape": shape, "text": text, "source": source, "assumed": assumed}
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Largest deviations of a made sensor from its design; 0 for a value that does not vary.

    The metadata of a field give unit, distribution, a description, and the source of the default; `assumed` is True
    where no data sheet or measurement gives it. A tolerance in percent is relative to the design's value.

    Raises
    ------
    BadInput
        A tolerance is negative, not finite or too large.

    >>> Tolerances(E=-1)
    Traceback (most recent call last):
        ...
    geometry.bad_input.BadInput: tolerance E must be a number of percent from 0 to 90; got -1
    """

    E: float = _tolerance(
        10.0, "percent", "normal", "Young's modulus", "2 points of Shore A are 9 % at Shore 30 A by Gent's formula"
    )
    nu: float = _tolerance(2e-4, "1", "uniform", "Poisson's ratio, at most 0.5", "bulk modulus from 0.4 GPa upwards")
    remanence: float = _tolerance(
        2.5, "percent", "uniform", "remanence of the magnet", "range of remanences within one grade of NdFeB"
    )
    magnet_diameter: float = _tolerance(
        0.05, "mm", "uniform", "diameter of the magnet", "usual tolerance of ground sintered NdFeB up to 10 mm"
    )
    magnet_height: float = _tolerance(
        0.05, "mm", "uniform", "height of the magnet", "usual tolerance of ground sintered NdFeB up to 10 mm"
    )
    magnet_x: float = _tolerance(0.15, "mm", "normal", "place of the magnet along x", "play in the cast pocket")
    magnet_y: float = _tolerance(0.15, "mm", "normal", "place of the magnet along y", "play in the cast pocket")
    magnet_z: float = _tolerance(0.15, "mm", "normal", "place of the magnet along z", "glue below the magnet")
    magnet_tilt: float = _tolerance(
        3.0,
        "deg",
        "normal",
        "tilt of the magnetisation about x and about y",
        "magnetisation within a few degrees of the axis (K&J Magnetics); seat in the pocket assumed",
    )
    hall_x: float = _tolerance(0.1, "mm", "normal", "place of a Hall element along x", "play in a printed seat")
    hall_y: float = _tolerance(0.1, "mm", "normal", "place of a Hall element along y", "play in a printed seat")
    hall_z: float = _tolerance(0.1, "mm", "normal", "place of a Hall element along z", "play in a printed seat")
    hall_gain: float = _tolerance(
        4.0, "percent", "uniform", "gain of a Hall element", "SS495A: 3.00 to 3.25 mV/G", assumed=False
    )
    hall_null: float = _tolerance(0.075, "V", "uniform", "null of a Hall element", "SS495A: 2.50 +- 0.075 V")
    chip_gain: float = _tolerance(5.0, "percent", "uniform", "gain of a chip's axis", "TMAG5273: 5 %")
    chip_null: float = _tolerance(3e-4, "T", "uniform", "offset of a chip's axis", "TMAG5273: 0.3 mT")

    def __post_init__(self) -> None:
        for spec in dataclasses.fields(self):
            value, unit = getattr(self, spec.name), spec.metadata["unit"]
            # a deviation of 100 % would allow a value of 0, of which there is no sensor
            most = {"percent": 90.0, "mm": 100.0, "deg": 45.0}.get(unit, 1.0)
            if not 0 <= value <= most:
                name = {"percent": "a number of percent", "1": "a number"}.get(unit, f"a number of {unit}")
                raise BadInput(f"tolerance {spec.name} must be {name} from 0 to {most:g}; got {value:g}")


def parse(texts: Sequence[str]) -> Tolerances:
    """Return the tolerances of texts NAME=VALUE; the others have their defaults.

    >>> parse(["E=5"]).E, parse([]).hall_null
    (5, 0.075)
    """
    values = parse_choices("--tolerance", texts, Tolerances)
    for name, value in values.items():
        if not (isinstance(value, (int, float)) and math.isfinite(value)):
            raise BadInput(f"tolerance {name} must be a finite number; got {value!r}")
    return Tolerances(**values)
