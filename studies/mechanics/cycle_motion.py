"""The motion of a loading cycle: the plate's path over time, and the numbers that define it, checked.

A press goes from first touch to the depth and back. A shear follows a press: the plate goes to +shear, then to and
fro between +shear and -shear. The stroke is the depth, or twice the shear. A triangle has one speed; a sine has the
same frequency, and its mean speed is given. At each end of the stroke the plate may rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from geometry.design import BadInput
from geometry.loads import Load, Waveform

Phase = Literal["press", "in", "out", "hold"]
HALF = 24
"""Straight pieces of half a period of a sine; an even number, so that one ends at mid-stroke."""
MOST_CYCLES = 1000
"""Largest number of cycles: more are a mistake rather than a wish."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A periodic motion of the plate.

    depth : of the press, mm.
    shear : largest shear along x, mm; 0 for a press.
    frequency : strokes to and fro per second without the holds, Hz.
    hold : rest at each end of the stroke, s.
    """

    depth: float
    shear: float
    friction: float | Literal["none", "stick"]
    frequency: float
    waveform: Waveform = "triangle"
    cycles: int = 3
    hold: float = 0.0

    def __post_init__(self) -> None:
        # a shear decides the stroke, and that the frequency
        if not math.isfinite(self.shear):
            raise BadInput(f"--shear must be a finite number of mm; got {self.shear:g}")
        for name, value in (("--depth", self.depth), ("--frequency", self.frequency)):
            if not 0 < value < math.inf:
                unit = "mm" if name == "--depth" else "Hz"
                raise BadInput(f"{name} of a cycle must be above 0 {unit} and finite; got {value:g}")
        if not 1 <= self.cycles <= MOST_CYCLES:
            raise BadInput(f"--cycles must be between 1 and {MOST_CYCLES}; got {self.cycles}")
        if not 0 <= self.hold < math.inf:
            raise BadInput(f"--hold must be a finite time of 0 s or more; got {self.hold:g}")
        if self.shear and self.friction in ("none", 0):
            raise BadInput(f"a shear needs friction: give stick or a coefficient above 0; got {self.friction or 0}")

    @property
    def stroke(self) -> float:
        """Way of the plate from one end to the other, mm."""
        return abs(2 * self.shear) if self.shear else self.depth

    @property
    def largest(self) -> Load:
        """The load at the end of a stroke."""
        return Load(depth=self.depth, shear_x=self.shear, friction=self.friction)

    @property
    def half(self) -> float:
        """Duration of a stroke, s."""
        return 1 / (2 * self.frequency)


def frequency_of(speed: float | None, frequency: float | None, stroke: float) -> float:
    """Return the frequency of a motion of which speed, mm/s, or frequency, Hz, is given.

    >>> frequency_of(0.5, None, 1.0)
    0.25
    """
    if (speed is None) == (frequency is None):
        given = "neither" if speed is None else "both"
        raise BadInput(f"a cycle needs --speed, mm/s, or --frequency, Hz; got {given}: give one of them")
    if speed is None:
        assert frequency is not None
        return frequency
    if not 0 < speed < math.inf:
        raise BadInput(f"--speed must be above 0 mm/s and finite; got {speed:g}")
    return speed / (2 * stroke) if stroke else math.nan


@dataclass(frozen=True, slots=True)
class Stop:
    """A load of the motion at a time, s, with its place in the cycle: number of the cycle from 1 (0 for the press
    before a shear), phase, and whether it lies at mid-stroke or at an end of the stroke."""

    time: float
    load: Load
    cycle: int
    phase: Phase
    place: Literal["", "middle", "end"] = ""


def stops(motion: Motion) -> list[Stop]:
    """Return the loads of a motion in their order.

    A cycle of a press begins at depth 0, "in" is the way down; one of a shear begins at +shear, "in" is the way to
    +shear, which is the second one.

    >>> from geometry.loads import Load
    >>> [round(stop.load.depth, 3) for stop in stops(Motion(1.0, 0.0, "none", 0.5, cycles=1))]
    [0.5, 1.0, 0.5, 0.0]
    """
    path: list[Stop] = []
    time, half, shear, sine = 0.0, motion.half, motion.shear, motion.waveform == "sine"

    def load(share: float) -> Load:
        """Return the load at a share of the stroke, counted from its outer end."""
        depth, along = (motion.depth, shear * (2 * share - 1)) if shear else (motion.depth * share, 0.0)
        return Load(depth=depth, shear_x=along, friction=motion.friction)

    def rest(cycle: int) -> float:
        if not motion.hold:
            return time
        path.append(Stop(time + motion.hold, path[-1].load, cycle, "hold"))
        return time + motion.hold

    if shear:
        time = motion.depth / motion.stroke * half
        pressed = Load(depth=motion.depth, shear_x=0.0, friction=motion.friction)
        path.append(Stop(time, pressed, 0, "press", "end"))
        pieces = HALF // 2 if sine else 1
        for k in range(1, pieces + 1):
            time += half * (1 / pieces) / 2
            way = math.sin(math.pi / 2 * k / pieces) if sine else 1.0
            path.append(Stop(time, replace(pressed, shear_x=shear * way), 0, "press"))
        time = rest(0)
    # times over that of a stroke, and shares of its way, exact at mid-stroke and at the ends
    at = np.arange(1, HALF + 1) / HALF if sine else np.array([0.5, 1.0])
    way_of_sine = np.where(at == 0.5, 0.5, (1 - np.cos(math.pi * at)) / 2)
    pairs = list(zip(at.tolist(), (way_of_sine if sine else at).tolist(), strict=True))
    ways: tuple[Phase, Phase] = ("out", "in") if shear else ("in", "out")
    for cycle in range(1, motion.cycles + 1):
        for phase in ways:
            begin = time
            for part, share in pairs:
                time = begin + half * part
                place: Literal["", "middle", "end"] = "middle" if part == 0.5 else "end" if part == 1 else ""
                path.append(Stop(time, load(share if phase == "in" else 1 - share), cycle, phase, place))
            time = rest(cycle)
    return path
