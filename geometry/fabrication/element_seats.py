"""Hollows and posts of the base that hold the Hall elements: their positions and sizes, mm, in the sensor's frame.

S1 lies in a pocket under the beam. The pocket is open below, and a channel towards -x holds the leads.

S2 and S3 beside the beam stand in slots that are open at the top, with their marked faces towards the beam. A ledge
in each slot sets the height of the element, and the leads pass down through the plate. An element that rises above
the top of the base gets a post, open towards the beam and as high as the element's Hall plate. Under the beam, S2 and
S3 lie in pockets that are open below, as S1 does.

A 3-axis chip is soldered to a board that is glued to the underside of the base; a pocket holds its body and the
solder on its pads. The capacitor of its supply goes on the underside of the board.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from geometry.fabrication.hall_bodies import CHIPS, LAND_PATTERNS, SS495A, Vector

if TYPE_CHECKING:
    from build123d import Solid

WEB = 0.6
"""Least thickness of base between an element and the beam, and of the ledge under an element, mm."""

CLOSE = 1e-9
"""Rounding of sums of lengths, mm."""


class ShortOfBase(BadInput):
    """An l0 that leaves too little of the base between an element and the beam."""


@dataclass(frozen=True, slots=True)
class Block:
    """A box with sides along x, y and z: its corner of least x, y and z, and the lengths of its sides, mm."""

    corner: Vector
    sides: Vector

    def solid(self) -> Solid:
        import build123d as bd

        return bd.Solid.make_box(*self.sides, bd.Plane(self.corner))

    def meets(self, other: Block, gap: float) -> bool:
        """Return True if two boxes are closer than `gap` along all three axes."""
        return all(
            start < other_start + other_side + gap and other_start < start + side + gap
            for start, side, other_start, other_side in zip(
                self.corner, self.sides, other.corner, other.sides, strict=True
            )
        )


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


def least_thickness(where: dict[str, Vector]) -> float:
    """Return the least thickness of the plate that holds three one-axis elements, mm."""
    p = SS495A
    return max(p.thickness - p.depth - where["S1"][2], p.height / 2 - where["S2"][2] + WEB)


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
    aside = p.leads / 2 + fit
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
    """Raise BadInput if the seat of S2 meets that of S1, or that of S3, its mirror image about x = y."""
    one, other = bodies["S1"], bodies["S2"]
    hollows = [hollow for hollow in (other, passage) if hollow.sides[2] > 0]
    short = [
        WEB - hollow.corner[0] + one.corner[0] + one.sides[0] for hollow in hollows if one.meets(hollow, WEB - CLOSE)
    ]
    if short:
        raise BadInput(
            f"f must be at least {design.f + max(short):.4g} mm to leave {WEB:g} mm between the seats of S1 and S2; "
            f"got {design.f:g} mm"
        )
    # the hollows may open into each other at their corners, but the bodies need the whole of their hollows
    if not neck(other) >= -CLOSE:
        raise BadInput(f"f must be at least {design.f - neck(other):.4g} mm, or S2 and S3 meet; got {design.f:g} mm")


def neck(seat: Block) -> float:
    """Return the distance along x, which is also that along y, between the hollow of S2 and that of S3, mm."""
    return seat.corner[0] - (seat.corner[1] + seat.sides[1])


def opening(seat: Block) -> Block | None:
    """Return the hollow that joins the seats of S2 and S3 at their corners; None if a wall of `WEB` parts them.

    A thinner wall could not be printed. The hollow overlaps both seats, so that no edge touches an edge.

    seat : hollow for the body of S2.
    """
    gap = neck(seat)
    if gap >= WEB - CLOSE:
        return None
    start = seat.corner[0] - gap - WEB / 4
    return Block((start, start, seat.corner[2]), (gap + WEB / 2, gap + WEB / 2, seat.sides[2]))


def swapped(block: Block) -> Block:
    """Return the block with x and y exchanged."""
    (x, y, z), (length, width, height) = block.corner, block.sides
    return Block((y, x, z), (width, length, height))


def chip_seat(design: Design, where: dict[str, Vector], fit: float, thickness: float) -> Block:
    """Return the pocket of a 3-axis chip, open below.

    Raises
    ------
    BadInput
        Too little of the base would be left over the chip.
    """
    chip, (middle, _, z) = CHIPS[design.hall_layout], where[design.hall_layout]
    roof = z - chip.plate + chip.height + fit
    if not roof <= -WEB:
        raise ShortOfBase(
            f"l0 must be at least {design.l0 + roof + WEB:.4g} mm to leave {WEB:g} mm of base over the chip; "
            f"got {design.l0:g} mm"
        )
    pattern = LAND_PATTERNS[design.hall_layout]
    # the solder on the pads is wider than the chip
    x = max(chip.length / 2, pattern.pitch + pattern.width / 2) + fit
    y = max(chip.width / 2, (pattern.rows + pattern.length) / 2) + fit
    return Block((middle - x, -y, -thickness), (2 * x, 2 * y, roof + thickness))
