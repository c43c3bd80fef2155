"""The motion of the plate over time that a study's case has: its frequency or its speed."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from geometry.design import BadInput

TIMED = ("response", "cycle")
"""Quantities that depend on time."""


@dataclass(frozen=True, slots=True)
class PlateMotion:
    """How fast the plate moves: at a frequency, Hz, or with a speed, mm/s; None where the case has no such value."""

    frequency: float | None = None
    speed: float | None = None


STILL = PlateMotion()
"""No motion: what static quantities have."""


def motion_of(values: Mapping[str, Any]) -> PlateMotion:
    """Return the motion in the fields of a load.

    >>> motion_of({"depth": 1.0, "frequency": 2.0})
    PlateMotion(frequency=2.0, speed=None)
    """
    return PlateMotion(values.get("frequency"), values.get("speed"))


def check_motion(names: Collection[str], quantities: Collection[str]) -> None:
    """Refuse fields of the motion that contradict each other or the quantities of a study."""
    if "frequency" in names and "speed" in names:
        raise BadInput("frequency and speed both say how fast the plate moves: leave one of them out")
    if "frequency" in names and not set(TIMED) & set(quantities):
        raise BadInput(f"frequency has no effect on these quantities: add the quantity {' or '.join(TIMED)}")
    if "speed" in names and "cycle" not in quantities:
        raise BadInput("speed has no effect on these quantities: add the quantity cycle")
    if "cycle" in quantities and not {"frequency", "speed"} & set(names):
        raise BadInput(
            "quantity cycle needs the rate of the motion: add --load speed=1 in mm/s or --load frequency=2 in Hz"
        )
