"""Bodies of the Hall parts that a base must hold, and where a design puts them. Lengths mm.

| part | body | source | unchecked |
|---|---|---|---|
| SS495A | flat, three leads in line | Honeywell SS400 and SS490 charts: thickness 0.062 in, height 0.118 in, leads 0.050 in apart, 0.015 in thick | width 0.160 in; the plate lies 0.5 mm under the marked face, in its middle |
| TMAG5273 | SOT-23-6 | Texas Instruments DBV outline | all of it; the plates lie 0.6 mm above the board |
| TLE493D-P2B6 | PG-TSOP6 | Infineon outline | all of it; the plates lie 0.6 mm above the board |

Unchecked figures are quoted from memory and want checking against the data sheet before a series is built.
"""  # noqa: E501

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.cad import moved
from geometry.design import Design

if TYPE_CHECKING:
    from build123d import Solid

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Leaded:
    """A flat part with leads in line, seen on its marked face: width across the leads, height along them.

    Attributes
    ----------
    width, height, thickness : of the body.
    depth : of the plate under the marked face; it lies in the middle of width and height.
    pitch, lead : distance between the three leads, and side of their square section.
    """

    width: float
    height: float
    thickness: float
    depth: float
    pitch: float
    lead: float

    @property
    def leads(self) -> float:
        """Width of the three leads together."""
        return 2 * self.pitch + self.lead


@dataclass(frozen=True, slots=True)
class Chip:
    """A chip on a board: its footprint with leads, height over the board, and that of its plates."""

    length: float
    width: float
    height: float
    plate: float


SS495A = Leaded(width=4.06, height=3.0, thickness=1.57, depth=0.5, pitch=1.27, lead=0.41)

CHIPS = {
    "tmag5273a1": Chip(length=2.9, width=2.8, height=1.45, plate=0.6),
    "tle493d-p2b6": Chip(length=2.9, width=2.5, height=1.1, plate=0.6),
}

LEAD = 6.0
"""Length of the leads as drawn, mm."""


def places(design: Design) -> dict[str, Vector]:
    """Centre of the plate of each part in the sensor's frame, mm."""
    s1, s23 = design.H - design.l0, design.H - design.l0 + design.c
    if design.hall_layout != "three":
        return {design.hall_layout: (design.chip_x, 0.0, s1)}
    return {"S1": (0.0, 0.0, s1), "S2": (design.f, 0.0, s23), "S3": (0.0, design.f, s23)}


def heights(design: Design) -> tuple[float, float]:
    """Top of the highest part's body, and the lowest end of leads or bodies, in the sensor's frame, mm."""
    where = places(design)
    if design.hall_layout != "three":
        chip, (_, _, z) = CHIPS[design.hall_layout], where[design.hall_layout]
        return z - chip.plate + chip.height, z - chip.plate
    p, z1, z23 = SS495A, where["S1"][2], where["S2"][2]
    top = max(z1 + p.depth, z23 + p.height / 2)
    return top, min(z1 + p.depth - p.thickness, z23 - p.height / 2 - LEAD)


def bodies(design: Design) -> dict[str, Solid]:
    """The parts in the sensor's frame: S1's marked face up, those of S2 and S3 towards the beam; leads cut short."""
    if design.hall_layout != "three":
        chip, (x, _, z) = CHIPS[design.hall_layout], places(design)[design.hall_layout]
        corner = (x - chip.length / 2, -chip.width / 2, z - chip.plate)
        return {design.hall_layout: _box(corner, chip.length, chip.width, chip.height)}
    import build123d as bd

    part = _leaded()
    # upright: leads down, marked face towards -x, then towards -y
    upright = part.rotate(bd.Axis.Y, -90)
    turned = {"S1": part, "S2": upright, "S3": upright.rotate(bd.Axis.Z, 90)}
    # copies: a name in a STEP file belongs to all that shares the same faces
    return {name: moved(copy.deepcopy(turned[name]), place) for name, place in places(design).items()}


def _leaded() -> Solid:
    """A part as S1 lies, its plate in the origin: marked face up, leads along -x."""
    p = SS495A
    top = p.depth
    body = _box((-p.height / 2, -p.width / 2, top - p.thickness), p.height, p.width, p.thickness)
    low = top - (p.thickness + p.lead) / 2
    start = -p.height / 2 - LEAD
    leads = [_box((start, k * p.pitch - p.lead / 2, low), LEAD, p.lead, p.lead) for k in (-1, 0, 1)]
    return body.fuse(*leads).solids()[0]


def _box(corner: Vector, x: float, y: float, z: float) -> Solid:
    import build123d as bd

    return bd.Solid.make_box(x, y, z, bd.Plane(corner))
