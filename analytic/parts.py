"""Hall parts with the values of their data sheets, and the elements of a design's layout.

Values in the column "unchecked" were not read in the data sheet itself. They come from drivers or from memory of the
data sheet: check them before you rely on them.

| part | source | read in the source | unchecked |
|---|---|---|---|
| SS495A | Honeywell SS490 series, 055843 | ratiometric, rail to rail, quad Hall | 3.125 mV/G (3.00 to 3.25), null 2.5 V, +-670 G (quoted by others from it); rails 0.2 V from the supply of 5 V; no noise stated |
| NI 9205 | the converter that the paper names | 16 bits; +-10 V make a step of 0.305 mV | random noise 0.244 mV |
| 3-axis chips | in `geometry/hall_chips.toml`, each with its source | there | there, as `assumed` |
"""  # noqa: E501

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from analytic import reading_noise
from geometry.array_design import ArrayDesign
from geometry.arrays import Vector
from geometry.cad import element_positions
from geometry.design import BadInput, Design
from geometry.hall_chips import CHIPS

__all__ = ["CHIPS", "Element", "of_design"]


@dataclass(frozen=True, slots=True)
class Element:
    """Hall element with one axis, its amplifier and its converter, fixed in the sensor's frame.

    The output is null + gain B.n plus noise, rounded to whole steps and limited to the range from low to high. A
    reading is the average of several samples of it (see `analytic.reading_noise`).

    Attributes
    ----------
    name : name in tables and messages.
    position : centre of the plate, mm.
    direction : unit vector n along which the element measures B.
    gain : output per T, in `unit`/T.
    null : output in zero field, including the element's offset, in `unit`.
    low, high : rails of the output, in `unit`.
    noise : root mean square of the noise of one sample, in `unit`.
    step : step of the converter, in `unit`; 0 for none.
    plate : side of the square plate over which B.n is averaged, mm; 0 for a point.
    unit : unit of the output: "V", or "T" for a part that sends the flux density itself.
    floor : root mean square of the noise that no average reduces, in `unit`.
    average : number of samples of which a reading is the average.

    Raises
    ------
    BadInput
        The direction is not a unit vector, or a number is not finite or out of order.
    """

    name: str
    position: Vector
    direction: Vector
    gain: float
    null: float
    low: float
    high: float
    noise: float = 0.0
    step: float = 0.0
    plate: float = 0.0
    unit: Literal["V", "T"] = "V"
    floor: float = 0.0
    average: int = 1

    def __post_init__(self) -> None:
        numbers = (*self.position, *self.direction, self.gain, self.null, self.low, self.high)
        if not all(map(math.isfinite, (*numbers, self.noise, self.step, self.plate, self.floor))):
            raise BadInput(f"element {self.name}: every number must be finite")
        if not abs(math.hypot(*self.direction) - 1) < 1e-9:
            raise BadInput(
                f"element {self.name}: direction must be a unit vector; its length is {math.hypot(*self.direction):g}"
            )
        if not self.low < self.null < self.high:
            raise BadInput(f"element {self.name}: null must lie between low and high; got {self.null:g} {self.unit}")
        if not min(self.noise, self.step, self.plate, self.floor) >= 0:
            raise BadInput(f"element {self.name}: noise, step, plate and floor must be 0 or more")
        if not self.average >= 1:
            raise BadInput(f"element {self.name}: average must be at least 1 sample; got {self.average}")

    @property
    def noise_T(self) -> float:
        """Standard deviation of a reading, T, from noise, converter and average."""
        return reading_noise.of_average(self.noise, self.step, self.floor, self.average) / self.gain


CONVERTER, CONVERTER_NOISE, CONVERTER_STEP = "NI 9205, +-10 V", 2.44e-4, 20 / 2**16
"""Converter that the paper names: name, noise and step, V. The noise does not include that of the elements."""

AXES: tuple[Vector, Vector, Vector] = ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Directions n of S1, S2 and S3, or of the three axes of a chip; `analytic.hall.elements` explains their signs."""


def of_design(design: Design | ArrayDesign) -> tuple[Element, ...]:
    """Return the elements of the design's layout; of an array those of each beam, named b1_S1 and so on.

    Layout "three" has the one-axis elements S1 on the axis, S2 at x = f and S3 at y = f, with the values of the
    design's fields hall_gain to hall_plate (default: an SS495A at 5 V). A chip has all three axes at x = chip_x and
    at S1's height, with the chip's own values; several chips stand on a circle, all turned alike. All of them average
    hall_average samples.
    """
    if isinstance(design, ArrayDesign):
        return tuple(
            dataclasses.replace(element, name=f"b{k}_{element.name}", position=_moved(element.position, place))
            for k, place in enumerate(design.places.tolist(), 1)
            for element in of_design(design.design)
        )
    three = design.hall_layout == "three"
    names, unit = element_names(design.hall_layout, int(design.chip_count))
    average = design.hall_noise_floor if three else 0.0, int(design.hall_average)
    return tuple(
        Element(name, place, axis, *common_values(design), unit, *average)
        for name, place, axis in zip(names, element_positions(design), AXES * (len(names) // 3), strict=True)
    )


def _moved(position: Vector, place: Sequence[float]) -> Vector:
    return position[0] + place[0], position[1] + place[1], position[2]


def element_names(layout: str, chips: int = 1) -> tuple[tuple[str, ...], Literal["V", "T"]]:
    """Return the names of a layout's elements, and the unit of their outputs.

    >>> element_names("tmag5273a1"), len(element_names("tmag5273a1", 3)[0])
    ((('chip -z', 'chip x', 'chip y'), 'T'), 9)
    """
    if layout == "three":
        return ("S1", "S2", "S3"), "V"
    chips_named = [f"chip{k}" for k in range(1, chips + 1)] if chips > 1 else ["chip"]
    return tuple(f"{chip} {axis}" for chip in chips_named for axis in ("-z", "x", "y")), "T"


def common_values(design: Design) -> tuple[float, float, float, float, float, float, float]:
    """Return gain, null, low, high, noise of one sample, step and plate, which all elements have in common."""
    if design.hall_layout != "three":
        chip = design.chip
        return design.hall_gain_now, 0.0, -chip.range, chip.range, chip.noise or 0.0, chip.step, 0.0
    rails = design.hall_gain_now, design.hall_null, design.hall_low, design.hall_high
    noise = reading_noise.of_sample(design.hall_noise, design.hall_noise_density, design.hall_bandwidth)
    return *rails, noise, design.hall_step, design.hall_plate


def with_noise(elements: Sequence[Element]) -> tuple[tuple[Element, ...], str]:
    """Return the elements, with the noise and step of `CONVERTER` if they have none and send V, and their source.

    The source is a phrase for messages, such as "the design's".
    """
    if any(element.noise or element.step or element.floor for element in elements):
        return tuple(elements), "the design's" if elements[0].unit == "V" else "the chip's"
    converted = [
        dataclasses.replace(e, noise=CONVERTER_NOISE, step=CONVERTER_STEP) if e.unit == "V" else e for e in elements
    ]
    return tuple(converted), f"{CONVERTER}, assumed: the design gives none"


def average_warnings(design: Design) -> list[str]:
    """Return a sentence where averaging leaves steps of the converter, because the noise is too small to dither them.

    >>> average_warnings(Design(hall_layout="tmag5273a1", hall_average=100))
    []
    >>> average_warnings(Design(hall_layout="chip", chip_step=2e-5, chip_noise=2e-6, hall_average=100))
    ['averaging 100 values leaves an error of 0.19 steps of 2e-05 T: a noise of 0.1 steps does not dither them']
    """
    element = of_design(design)[0]
    if element.average == 1 or not element.step:
        return []
    left = reading_noise.rounding_bias(element.noise, element.step)
    # steps of half the noise of an averaged reading make 13 % of it
    if left < 0.5 * element.noise_T * element.gain:
        return []
    error = f"{left / element.step:.2g} steps of {element.step:g} {element.unit}"
    reason = f"a noise of {element.noise / element.step:.2g} steps does not dither them"
    return [f"averaging {element.average} values leaves an error of {error}: {reason}"]


def columns(elements: Sequence[Element]) -> list[str]:
    """Return the names of the elements' columns in tables: their names without spaces.

    >>> columns(of_design(Design(hall_layout="tmag5273a1")))
    ['chip_-z', 'chip_x', 'chip_y']
    """
    return [element.name.replace(" ", "_") for element in elements]
