"""Bodies of the Hall parts, and the hollows and posts of the base that hold them. All lengths are in mm.

| part | body | source | unchecked |
|---|---|---|---|
| SS495A | flat, three leads in line | Honeywell SS400 and SS490 charts: thickness 0.062 in, height 0.118 in, leads 0.050 in apart, 0.015 in thick | width 0.160 in; Hall plate 0.5 mm under the centre of the marked face |
| 3-axis chips | as in `geometry/hall_chips.toml` | named there | named there as `assumed` |

Unchecked dimensions were not compared with the data sheet: compare them before you build a series.

S1 lies in a pocket under the beam. The pocket is open below, and a channel towards -x holds the leads.

S2 and S3 beside the beam stand in slots that are open at the top, with their marked faces towards the beam. A ledge
in each slot sets the height of the element, and the leads pass down through the plate. An element that rises above
the top of the base gets a post, open towards the beam and as high as the element's Hall plate. Under the beam, S2 and
S3 lie in pockets that are open below, as S1 does.

3-axis chips are soldered to a board that is glued to the underside of the base, all turned alike; a pocket holds the
body of each and the solder on its pads. The capacitor of a supply goes on the underside of the board.
"""  # noqa: E501

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.arrays import Vector
from geometry.cad import element_positions, moved
from geometry.design import BadInput, Design
from geometry.hall_chips import least_radius

if TYPE_CHECKING:
    from build123d import Solid


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


SS495A = Leaded(width=4.06, height=3.0, thickness=1.57, depth=0.5, pitch=1.27, lead=0.41)

LEAD = 6.0
"""Length of the leads in drawings and solids, mm; a maker cuts them to the length needed."""

WEB = 0.6
"""Least thickness of base between an element and the beam, and of the ledge under an element, mm."""

CLOSE = 1e-9
"""Rounding of sums of lengths, mm."""


@dataclass(frozen=True, slots=True)
class Block:
    """A box with sides along x, y and z: its corner of least x, y and z, and the lengths of its sides, mm."""

    corner: Vector
    sides: Vector

    def solid(self) -> Solid:
        import build123d as bd

        return bd.Solid.make_box(*self.sides, bd.Plane(self.corner))

    def meets(self, second: Block, gap: float) -> bool:
        """Return True if two boxes are closer than `gap` along all three axes."""
        return all(
            start < low + length + gap and low < start + side + gap
            for start, side, low, length in zip(self.corner, self.sides, second.corner, second.sides, strict=True)
        )


def places(design: Design) -> dict[str, Vector]:
    """Return the centre of each part's Hall plate in the sensor's frame, mm."""
    at, layout, count = element_positions(design), design.hall_layout, int(design.chip_count)
    if layout == "three":
        return dict(zip(("S1", "S2", "S3"), at, strict=True))
    return {f"{layout} {k}" if count > 1 else layout: place for k, place in enumerate(at[::3], 1)}


def chip_centres(design: Design) -> dict[str, tuple[float, float]]:
    """Return x and y of the middle of each chip's body, from which its sensitive volume may lie apart, mm."""
    u, v = design.chip.plate_at
    return {name: (x - u, y - v) for name, (x, y, _) in places(design).items()}


def heights(design: Design) -> tuple[float, float]:
    """Return the highest z of all bodies, and the lowest z of all bodies and leads, in the sensor's frame, mm."""
    where = places(design)
    if design.hall_layout != "three":
        chip, z = design.chip, design.H - design.l0
        return z - chip.plate + chip.body[2], z - chip.plate
    p, z1, z23 = SS495A, where["S1"][2], where["S2"][2]
    top = max(z1 + p.depth, z23 + p.height / 2)
    return top, min(z1 + p.depth - p.thickness, z23 - p.height / 2 - LEAD)


def boxes(design: Design) -> dict[str, Block]:
    """Return the least boxes round the parts, leads of length `LEAD` included, in the sensor's frame."""
    if design.hall_layout != "three":
        chip = design.chip
        (length, width, _), low = chip.body, design.H - design.l0 - chip.plate
        centres = chip_centres(design)
        return {name: Block((x - length / 2, y - width / 2, low), chip.body) for name, (x, y) in centres.items()}
    p, where = SS495A, places(design)
    (_, _, z1), (_, _, z23) = where["S1"], where["S2"]
    lying = Block(
        (-p.height / 2 - LEAD, -p.width / 2, z1 + p.depth - p.thickness), (p.height + LEAD, p.width, p.thickness)
    )
    low = z23 - p.height / 2 - LEAD
    upright = Block((design.f - p.depth, -p.width / 2, low), (p.thickness, p.width, p.height + LEAD))
    return {"S1": lying, "S2": upright, "S3": swapped(upright)}


def bodies(design: Design) -> dict[str, Solid]:
    """Return the solids of the parts in the sensor's frame, with leads of length `LEAD`.

    The marked face of S1 points up; those of S2 and S3 point towards the beam.
    """
    if design.hall_layout != "three":
        return {name: box.solid() for name, box in boxes(design).items()}
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
    body = Block((-p.height / 2, -p.width / 2, top - p.thickness), (p.height, p.width, p.thickness)).solid()
    low = top - (p.thickness + p.lead) / 2
    start = -p.height / 2 - LEAD
    leads = [Block((start, k * p.pitch - p.lead / 2, low), (LEAD, p.lead, p.lead)).solid() for k in (-1, 0, 1)]
    return body.fuse(*leads).solids()[0]


# Seats


class ShortOfBase(BadInput):
    """An l0 that leaves too little of the base between an element and the beam."""


@dataclass(frozen=True, slots=True)
class Seats:
    """Hollows and posts by element, mm.

    Attributes
    ----------
    bodies : hollows for the bodies of the elements.
    passages : hollows for their leads; the channel of S1 is to be extended to the edge of the base.
    posts : parts of the base above z = 0.
    """

    bodies: dict[str, Block]
    passages: dict[str, Block]
    posts: dict[str, Block]


def three_elements(design: Design, where: dict[str, Vector], fit: float, wall: float, thickness: float) -> Seats:
    """Return the seats of three one-axis elements.

    Parameters
    ----------
    where : positions of the Hall plates.
    fit, wall : gap around an element, and thickness of the posts' walls, mm.
    thickness : thickness of the plate, mm.

    Raises
    ------
    BadInput
        An element would lie in the beam or too close to it, or two seats would meet.
    """
    p, (_, _, z1), (_, _, z23) = SS495A, where["S1"], where["S2"]
    roof = z1 + p.depth + fit
    if not roof <= -WEB:
        raise ShortOfBase(
            f"l0 must be at least {design.l0 + roof + WEB:.4g} mm to leave {WEB:g} mm of base between S1 and the "
            f"beam; got {design.l0:g} mm"
        )
    half = p.width / 2 + fit
    # S1 lies flat with its marked face up, so its height runs along x and its leads point to -x
    bodies = {"S1": Block((-p.height / 2 - fit, -half, -thickness), (p.height + 2 * fit, 2 * half, roof + thickness))}
    lead_roof = z1 + p.depth - (p.thickness - p.lead) / 2 + fit
    aside = p.pitch + p.lead / 2 + fit
    passages = {"S1": Block((0.0, -aside, -thickness), (0.0, 2 * aside, lead_roof + thickness))}
    # S2 stands upright, its marked face `depth` in front of its Hall plate, which is at x = f
    near, far = design.f - p.depth - fit, design.f - p.depth + p.thickness + fit
    low, high = z23 - p.height / 2, z23 + p.height / 2 + fit
    posts: dict[str, Block] = {}
    if near >= design.R:
        top = max(z23, 0.0)
        if z23 > 0:
            posts["S2"] = Block((near + fit, -half - wall, 0.0), (far + wall - near - fit, 2 * (half + wall), z23))
        bodies["S2"] = Block((near, -half, low), (far - near, 2 * half, top + p.height - low))
    elif high <= -WEB:
        bodies["S2"] = Block((near, -half, -thickness), (far - near, 2 * half, high + thickness))
    else:
        raise BadInput(
            f"f must be at least {design.R + p.depth + fit:.4g} mm to place the seats of S2 and S3 beside the beam; "
            f"got {design.f:g} mm: raise f, or lower c to place the seats under the beam"
        )
    middle = design.f - p.depth + p.thickness / 2
    thin = p.lead / 2 + fit
    passages["S2"] = Block(
        (middle - thin, -aside, -thickness), (2 * thin, 2 * aside, max(low, -thickness) + thickness)
    )
    _refuse_meeting(design, bodies, passages["S2"])
    # S3 mirrors S2 about the plane x = y
    for group in (bodies, passages, posts):
        if "S2" in group:
            group["S3"] = swapped(group["S2"])
    return Seats(bodies, passages, posts)


def _refuse_meeting(design: Design, bodies: dict[str, Block], passage: Block) -> None:
    centre, beside = bodies["S1"], bodies["S2"]
    hollows = [hollow for hollow in (beside, passage) if hollow.sides[2] > 0]
    edge = centre.corner[0] + centre.sides[0]
    short = [WEB - hollow.corner[0] + edge for hollow in hollows if centre.meets(hollow, WEB - CLOSE)]
    if short:
        raise BadInput(
            f"f must be at least {design.f + max(short):.4g} mm to leave {WEB:g} mm between the seats of S1 and S2; "
            f"got {design.f:g} mm"
        )
    # the hollows may open into each other at their corners, but the bodies need the whole of their hollows
    gap = neck(beside)
    if not gap >= -CLOSE:
        raise BadInput(f"f must be at least {design.f - gap:.4g} mm, or S2 and S3 meet; got {design.f:g} mm")


def neck(seat: Block) -> float:
    """Return the distance along x, which is also that along y, between the hollow of S2 and that of S3, mm."""
    return seat.corner[0] - (seat.corner[1] + seat.sides[1])


def swapped(block: Block) -> Block:
    """Return the block with x and y exchanged."""
    (x, y, z), (length, width, height) = block.corner, block.sides
    return Block((y, x, z), (width, length, height))


def chip_seats(design: Design, fit: float, thickness: float) -> Seats:
    """Return the pockets of 3-axis chips, open below.

    Raises
    ------
    BadInput
        Too little of the base would be left over a chip, or between two pockets.
    """
    chip, count = design.chip, int(design.chip_count)
    (length, width, height), pads = chip.body, chip.pads
    roof = design.H - design.l0 - chip.plate + height + fit
    if not roof <= -WEB:
        raise ShortOfBase(
            f"l0 must be at least {design.l0 + roof + WEB:.4g} mm to leave {WEB:g} mm of base over the chip; "
            f"got {design.l0:g} mm"
        )
    # the solder on the pads is wider than the chip
    wide, deep = pads.size if pads else (0.0, 0.0)
    a, b = max(length, wide) / 2 + fit, max(width, deep) / 2 + fit
    least = least_radius(count, 2 * a + WEB, 2 * b + WEB)
    if not abs(design.chip_x) >= least - CLOSE:
        raise BadInput(
            f"chip_x must be at least {math.ceil(1e3 * least) / 1e3:g} mm to leave {WEB:g} mm of base between the "
            f"pockets of {count} chips; got {design.chip_x:g} mm"
        )
    pockets = {
        name: Block((x - a, y - b, -thickness), (2 * a, 2 * b, roof + thickness))
        for name, (x, y) in chip_centres(design).items()
    }
    return Seats(pockets, {}, {})
