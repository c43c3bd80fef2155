"""Bodies of the Hall parts in the base, and their positions in a design. All lengths are in mm.

| part | body | source | unchecked |
|---|---|---|---|
| SS495A | flat, three leads in line | Honeywell SS400 and SS490 charts: thickness 0.062 in, height 0.118 in, leads 0.050 in apart, 0.015 in thick | width 0.160 in; Hall plate 0.5 mm under the centre of the marked face |
| TMAG5273 | SOT-23-6 | Texas Instruments DBV outline | all dimensions; Hall plates 0.6 mm above the board |
| TLE493D-P2B6 | PG-TSOP6 | Infineon outline | all dimensions; Hall plates 0.6 mm above the board |

Unchecked dimensions were not compared with the data sheet: compare them before you build a series.
"""  # noqa: E501

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.cad import element_positions, moved
from geometry.design import Design

if TYPE_CHECKING:
    from build123d import Solid

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Leaded:
    """A flat part with three leads in line, mm.

    Attributes
    ----------
    width, height, thickness : size of the body across the leads, along the leads, and normal to the marked face.
    depth : depth of the Hall plate under the centre of the marked face.
    pitch, lead : distance between neighbouring leads, and side of their square section.
    """

    width: float
    height: float
    thickness: float
    depth: float
    pitch: float
    lead: float

    @property
    def leads(self) -> float:
        """Overall width of the three leads."""
        return 2 * self.pitch + self.lead


@dataclass(frozen=True, slots=True)
class Chip:
    """A chip on a board, mm.

    Attributes
    ----------
    length, width : footprint, leads included.
    height, plate : height of the chip and of its Hall plates above the board.
    """

    length: float
    width: float
    height: float
    plate: float


SS495A = Leaded(width=4.06, height=3.0, thickness=1.57, depth=0.5, pitch=1.27, lead=0.41)

CHIPS = {
    "tmag5273a1": Chip(length=2.9, width=2.8, height=1.45, plate=0.6),
    "tle493d-p2b6": Chip(length=2.9, width=2.5, height=1.1, plate=0.6),
}


@dataclass(frozen=True, slots=True)
class LandPattern:
    """Pads of a chip with two rows of three pins, mm.

    Attributes
    ----------
    pitch : distance of neighbouring pads of a row, along x.
    rows : distance of the centres of both rows, along y.
    length, width : size of a pad along y and along x.
    """

    pitch: float
    rows: float
    length: float
    width: float


LAND_PATTERNS = {
    "tmag5273a1": LandPattern(pitch=0.95, rows=2.6, length=1.1, width=0.6),
    "tle493d-p2b6": LandPattern(pitch=0.95, rows=2.4, length=1.0, width=0.5),
}

LEAD = 6.0
"""Length of the leads in drawings and solids, mm; a maker cuts them to the length needed."""


def places(design: Design) -> dict[str, Vector]:
    """Return the centre of each part's Hall plate in the sensor's frame, mm."""
    names = ("S1", "S2", "S3") if design.hall_layout == "three" else (design.hall_layout,) * 3
    return dict(zip(names, element_positions(design), strict=True))


def heights(design: Design) -> tuple[float, float]:
    """Return the highest z of all bodies, and the lowest z of all bodies and leads, in the sensor's frame, mm."""
    where = places(design)
    if design.hall_layout != "three":
        chip, (_, _, z) = CHIPS[design.hall_layout], where[design.hall_layout]
        return z - chip.plate + chip.height, z - chip.plate
    p, z1, z23 = SS495A, where["S1"][2], where["S2"][2]
    top = max(z1 + p.depth, z23 + p.height / 2)
    return top, min(z1 + p.depth - p.thickness, z23 - p.height / 2 - LEAD)


def bodies(design: Design) -> dict[str, Solid]:
    """Return the solids of the parts in the sensor's frame, with leads of length `LEAD`.

    The marked face of S1 points up; those of S2 and S3 point towards the beam.
    """
    if design.hall_layout != "three":
        chip, (x, _, z) = CHIPS[design.hall_layout], places(design)[design.hall_layout]
        corner = (x - chip.length / 2, -chip.width / 2, z - chip.plate)
        return {design.hall_layout: _box(corner, chip.length, chip.width, chip.height)}
    import build123d as bd

    part = _leaded()
    # S2 and S3 stand with their leads down, the marked face of S2 towards -x and that of S3 towards -y
    upright = part.rotate(bd.Axis.Y, -90)
    rotated = {"S1": part, "S2": upright, "S3": upright.rotate(bd.Axis.Z, 90)}
    # deep copies: solids that share faces would share one name in a STEP file
    return {name: moved(copy.deepcopy(rotated[name]), place) for name, place in places(design).items()}


def _leaded() -> Solid:
    """Return a part in the pose of S1: Hall plate at the origin, marked face up, leads along -x."""
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
