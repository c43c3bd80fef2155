"""Inputs of a sensitivity study: which fields vary in which ranges, and the sensors and loads at sampled points."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.exploration.study_cases import varied
from studies.inputs import study_axes, user_input
from studies.sensitivity.sobol_indices import Ranges
from studies.sensitivity.tolerances import Tolerances

OF_A_TOLERANCE = ("E", "nu", "remanence", "magnet_diameter", "magnet_height")
"""Fields of a design that `Tolerances` has under the same name: the inputs that vary by default."""


@dataclass(frozen=True, slots=True)
class Press:
    """The load of a study: depth of the plate, mm, and shear along x with the tip stuck to the plate, mm."""

    depth: float
    shear: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.depth < math.inf:
            raise BadInput(f"--depth must be a finite number of mm above 0; got {self.depth:g}")
        if not 0 <= self.shear < math.inf:
            raise BadInput(f"--shear must be a finite number of mm, 0 or more; got {self.shear:g}")


@dataclass(frozen=True, slots=True, eq=False)
class SampledCases:
    """Sensors and loads at n points.

    Attributes
    ----------
    designs, refusals : the sensor at each point, or None and the reason why it is impossible ("" where it is not).
    depth, shear : load at each point, shape (n,), mm.
    """

    designs: tuple[Design | None, ...]
    refusals: tuple[str, ...]
    depth: Array
    shear: Array


def parse_ranges(texts: Sequence[str]) -> Ranges:
    """Return the ranges in texts NAME=low:high.

    >>> parse_ranges(["E=0.6:1", "depth=0.5:1.5"])
    {'E': (0.6, 1.0), 'depth': (0.5, 1.5)}
    """
    ranges = {}
    for name, text in user_input.pairs("--vary", texts, "E=0.6:1").items():
        study_axes.check_name(name)
        if not study_axes.AXES[name].is_number:
            raise BadInput(f"--vary {name}: its values are names, not numbers, so it has no range: leave it out")
        if name == "hall_average":
            raise BadInput("--vary hall_average: it is a whole number of samples, so it has no range: leave it out")
        parts = text.split(":")
        if len(parts) != 2:
            raise BadInput(f"--vary {name} takes low:high, such as {name}=1:2; got {text!r}")
        low, high = (study_axes.parse(name, part.strip())[0] for part in parts)
        if isinstance(low, str) or isinstance(high, str) or not low < high:
            raise BadInput(f"--vary {name} takes low:high with low < high; got {text!r}")
        ranges[name] = (low, high)
    return ranges


def ranges_of_tolerances(design: Design, tolerances: Tolerances) -> Ranges:
    """Return the ranges in which the tolerances let the fields of a design vary; none for a tolerance of 0."""
    ranges = {}
    for name in OF_A_TOLERANCE:
        value, size = getattr(design, name), getattr(tolerances, name)
        spread = size * value / 100 if name in ("E", "remanence") else size
        if spread:
            ranges[name] = (value - spread, min(value + spread, study_axes.DESIGN[name].high))
    return ranges


def check_ranges(ranges: Ranges, load: Press) -> None:
    """Raise BadInput for an input that is neither a field of the design, nor depth or shear, or is also fixed."""
    for name in ranges:
        if name not in study_axes.DESIGN and name not in ("depth", "shear"):
            raise BadInput(f"--vary {name}: only fields of the design, depth and shear can vary: leave it out")
    if "shear" in ranges and load.shear:
        raise BadInput("shear is given twice, by --shear and by --vary: leave one of them out")


def sampled_cases(design: Design, ranges: Ranges, points: Array, load: Press) -> SampledCases:
    """Return the sensors and loads at points (n, d); Hall elements keep their places, as in `study_cases.varied`."""
    columns = dict(zip(ranges, points.T, strict=True))
    fields = {name: values for name, values in columns.items() if name in study_axes.DESIGN}
    designs, refusals = zip(*(_varied(design, fields, k) for k in range(len(points))), strict=True)
    depth, shear = (columns.get(name, np.full(len(points), getattr(load, name))) for name in ("depth", "shear"))
    return SampledCases(designs, refusals, depth, shear)


def _varied(design: Design, fields: Mapping[str, Array], k: int) -> tuple[Design | None, str]:
    """Return the sensor at a point, or None and the reason why it is impossible."""
    try:
        return varied(design, {name: float(values[k]) for name, values in fields.items()}), ""
    except BadInput as error:
        return None, str(error)
