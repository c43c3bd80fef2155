"""3-axis Hall chips: the figures of `hall_chips.toml`, and those of a chip of one's own, which a design states."""

import itertools
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

OWN = "chip"
"""Layout of a chip whose range, step, noise and body are fields of the design."""
AMBIENT = "ambient"
"""Layout of a chip that measures the ambient field beside a sensor, and saturates at its magnet; no design has it."""
CIRCLES: dict[int, tuple[tuple[float, float], ...]] = {
    1: ((1.0, 0.0),),
    2: ((1.0, 0.0), (-1.0, 0.0)),
    3: ((1.0, 0.0), (-0.5, math.sqrt(0.75)), (-0.5, -math.sqrt(0.75))),
    4: ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)),
}
"""Places of one to four chips on a circle of radius 1 about the beam's axis."""


def least_radius(count: int, length: float, width: float) -> float:
    """Return the least radius on which that many boxes, `length` along x and `width` along y, do not overlap, mm.

    >>> least_radius(1, 3.0, 2.0), least_radius(2, 3.0, 2.0), round(least_radius(3, 3.0, 2.0), 3)
    (0.0, 1.5, 2.0)
    """
    return max(
        (
            min(side / abs(a - b) for a, b, side in zip(one, other, (length, width), strict=True) if a != b)
            for one, other in itertools.combinations(CIRCLES[count], 2)
        ),
        default=0.0,
    )


@dataclass(frozen=True, slots=True)
class Pads:
    """Two rows of `pins` pads each, mm: `pitch` along x, `rows` apart along y, `length` of a pad along y.

    With `centre`, two more rows stand `rows` apart along x, and a square pad of this side is in the middle.
    """

    pins: int
    pitch: float
    rows: float
    length: float
    width: float
    centre: float = 0.0

    def boxes(self) -> list[tuple[float, float, float, float]]:
        """Return the middle (x, y) of each pad and its size along x and y, pin 1 first, then counter-clockwise."""
        along = [(k - (self.pins - 1) / 2) * self.pitch for k in range(self.pins)]
        end, long, wide = self.rows / 2, self.length, self.width
        low, high = [(at, -end, wide, long) for at in along], [(at, end, wide, long) for at in reversed(along)]
        if not self.centre:
            return [*low, *high]
        right, left = [(end, at, long, wide) for at in along], [(-end, at, long, wide) for at in reversed(along)]
        return [*low, *right, *high, *left, (0.0, 0.0, self.centre, self.centre)]

    @property
    def size(self) -> tuple[float, float]:
        """Size of all pads along x and y, mm."""
        across = self.rows + self.length
        return (across if self.centre else (self.pins - 1) * self.pitch + self.width), across


@dataclass(frozen=True, slots=True)
class HallChip:
    """A part that measures B along three axes and sends counts.

    Attributes
    ----------
    range, step : full scale and one count, T.
    body : size along x and y with leads, and height over the board, mm.
    plate : height of the sensitive volume over the board, mm; it is taken as a point.
    plate_at : its place along x and y from the middle of the body, mm.
    noise : rms of one value, T, at `rate` values of three axes a second; None if unknown.
    offset : largest output in zero field, T. gain_tolerance : largest relative error of the gain. None if unknown.
    gain_drift : change of the gain per K, of a figure of both signs the fall, which adds to the magnet's; None if
        unknown.
    pads : None if unknown.
    source, assumed : data sheet, and fields that were not read in it.
    """

    name: str
    range: float
    step: float
    body: tuple[float, float, float]
    plate: float
    noise: float | None = None
    rate: float | None = None
    offset: float | None = None
    gain_tolerance: float | None = None
    gain_drift: float | None = None
    pads: Pads | None = None
    plate_at: tuple[float, float] = (0.0, 0.0)
    source: str = ""
    assumed: tuple[str, ...] = ()


def _chip(table: dict[str, Any]) -> HallChip:
    pads = {"pads": Pads(**table["pads"])} if "pads" in table else {}
    return HallChip(
        **{
            **table,
            **pads,
            "body": tuple(table["body"]),
            "plate_at": tuple(table["plate_at"]),
            "assumed": tuple(table["assumed"]),
        }
    )


CHIPS = {
    layout: _chip(table)
    for layout, table in tomllib.loads(Path(__file__).with_name("hall_chips.toml").read_text("utf-8")).items()
}
"""The chips by the name in `Design.hall_layout`."""
