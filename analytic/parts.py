"""Hall parts, with what their data sheets say, and the elements that a design reads with.

Figures marked unchecked were not seen in the data sheet itself: they are quoted from drivers, or from memory of the
data sheet, and want checking before anything is built on them.

| part | source | seen | unchecked |
|---|---|---|---|
| SS495A | Honeywell SS490 series, 055843 | ratiometric, rail to rail, quad Hall | 3.125 mV/G (3.00 to 3.25), null 2.5 V, +-670 G (quoted by others from it); rails 0.2 V from the supply of 5 V; noise: none stated |
| TMAG5273A1 | Texas Instruments SLYS045A, 2021 | 12-bit converter, ranges +-40 and +-80 mT | noise 0.1 mT without averaging; 410 LSB/mT of the 16-bit word at +-80 mT is a driver's |
| NI 9205 | the converter that the paper names | 16 bits; +-10 V make a step of 0.305 mV | random noise 0.244 mV |
| TLE493D-P2B6 | Infineon, version 1.0, 2021-01-12 | +-160 mT, resolution down to 65 uT | step 0.13 mT at full range is a driver's; noise 0.1 mT |
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from geometry.design import BadInput, Design

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Element:
    """One one-axis Hall element with its amplifier and converter, fixed in the sensor's frame.

    Its output is null + gain B.n, plus noise, kept between low and high, rounded to whole steps.

    Attributes
    ----------
    name : what tables call it.
    position : of the plate's centre, mm.
    direction : unit vector n along which it reads.
    gain : output per T.
    null : output in zero field; an offset of the element belongs here.
    low, high : the rails of the output.
    noise : root mean square of the output's noise.
    step : of the converter; 0 for none.
    plate : side of the square plate over which B.n is averaged, mm; 0 for a point.
    unit : of the output: "V", or "T" where the part sends the flux density itself.

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

    def __post_init__(self) -> None:
        numbers = (*self.position, *self.direction, self.gain, self.null, self.low, self.high)
        if not all(map(math.isfinite, (*numbers, self.noise, self.step, self.plate))):
            raise BadInput(f"element {self.name}: every number must be finite")
        if not abs(math.hypot(*self.direction) - 1) < 1e-9:
            raise BadInput(
                f"element {self.name}: direction must be a unit vector; its length is {math.hypot(*self.direction):g}"
            )
        if not self.low < self.null < self.high:
            raise BadInput(f"element {self.name}: null must lie between low and high; got {self.null:g} {self.unit}")
        if not min(self.noise, self.step, self.plate) >= 0:
            raise BadInput(f"element {self.name}: noise, step and plate must be 0 or more")


@dataclass(frozen=True, slots=True)
class Chip:
    """A 3-axis part that sends flux densities: range, step of one count and noise, T; plates are points."""

    range: float
    step: float
    noise: float


CHIPS = {
    "tmag5273a1": Chip(range=0.08, step=0.08 / 2048, noise=1e-4),
    "tle493d-p2b6": Chip(range=0.16, step=1.3e-4, noise=1e-4),
}
"""3-axis parts by `Design.hall_layout`, at their wide range and without averaging; sources above."""

CONVERTER, CONVERTER_NOISE, CONVERTER_STEP = "NI 9205, +-10 V", 2.44e-4, 20 / 2**16
"""What reads the elements in the paper: name, noise and step, V. The elements' own noise comes on top of it."""

AXES: tuple[Vector, Vector, Vector] = ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""Along which S1, S2 and S3 read, or the three axes of a chip."""


def of_design(design: Design) -> tuple[Element, ...]:
    """The three elements of the design's layout.

    "three": one-axis elements S1 on the axis, S2 at x = f, S3 at y = f, with the design's hall_ figures (those of an
    SS495A at 5 V by default). A chip: all three at x = chip_x and S1's height, with the chip's own figures.
    """
    s1, s23 = design.H - design.l0, design.H - design.l0 + design.c
    if design.hall_layout != "three":
        chip = CHIPS[design.hall_layout]
        names = ("chip -z", "chip x", "chip y")
        return tuple(
            Element(
                name,
                (design.chip_x, 0.0, s1),
                axis,
                1.0,
                0.0,
                -chip.range,
                chip.range,
                chip.noise,
                chip.step,
                0.0,
                "T",
            )
            for name, axis in zip(names, AXES, strict=True)
        )
    rails = (design.hall_gain, design.hall_null, design.hall_low, design.hall_high)
    errors = (design.hall_noise, design.hall_step, design.hall_plate)
    places = ((0.0, 0.0, s1), (design.f, 0.0, s23), (0.0, design.f, s23))
    return tuple(
        Element(name, place, axis, *rails, *errors)
        for name, place, axis in zip(("S1", "S2", "S3"), places, AXES, strict=True)
    )


def with_noise(elements: Sequence[Element]) -> tuple[tuple[Element, ...], str]:
    """The elements, those in V with the noise and step of `CONVERTER` if none of them states any; and whose it is."""
    if any(element.noise or element.step for element in elements):
        return tuple(elements), "the design's" if elements[0].unit == "V" else "the chip's"
    read = [
        dataclasses.replace(e, noise=CONVERTER_NOISE, step=CONVERTER_STEP) if e.unit == "V" else e for e in elements
    ]
    return tuple(read), f"{CONVERTER}, assumed: the design gives none"


def columns(elements: Sequence[Element]) -> list[str]:
    """What tables call the elements: their names without spaces.

    >>> columns(of_design(Design(hall_layout="tmag5273a1")))
    ['chip_-z', 'chip_x', 'chip_y']
    """
    return [element.name.replace(" ", "_") for element in elements]
