"""Marks engraved into level faces: solids to cut from a part, made of straight strokes, without fonts. All in mm.

The mould gets A on the lid, B on the foot, and on the foot's opposite corner N or S: the pole of the magnet that
faces up, out of the mould, when the magnet is put into its pocket, unless the poles of an array differ. No mark
touches the cavity, a fit or the rim. The base gets grooves in the edge of its upper face: one at +x, two at +y.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from geometry.arrays import Point
from geometry.fabrication.hall_elements import WEB, Block, swapped

if TYPE_CHECKING:
    from build123d import Solid

    from geometry.design import Design
    from geometry.mold import Mold, Sizes

LETTERS = {
    "A": "0,0 0.33,1 0.66,0; 0.13,0.35 0.53,0.35",
    "B": "0,0 0,1 0.4,1 0.6,0.76 0.4,0.52 0,0.52; 0.4,0.52 0.66,0.26 0.4,0 0,0",
    "N": "0,0 0,1 0.66,0 0.66,1",
    "S": "0.66,0.85 0.5,1 0.16,1 0,0.76 0.16,0.52 0.5,0.48 0.66,0.24 0.5,0 0.16,0 0,0.15",
}
"""Strokes of each letter as lines through points x,y, parted by semicolons; the height is 1 and the width 0.66."""

DEPTH = 0.4
"""Depth of the letters, mm: two common layers of filament printing."""

MARGIN = 0.4
"""Least distance of a letter from the edges of its face, mm."""


def strokes(letter: str, centre: Point, height: float, width: float, top: float) -> list[Solid]:
    """Return the strokes of a letter that is to be cut into a level face at z = `top`, seen from above.

    Parameters
    ----------
    centre : (x, y) of the middle of the letter, mm.
    height, width : height of the letter with its strokes, and width of the strokes, mm.
    """
    import build123d as bd

    size = height - width
    corner = centre[0] - 0.66 * size / 2, centre[1] - size / 2
    solids = []
    for line in LETTERS[letter].split(";"):
        on_unit = (map(float, point.split(",")) for point in line.split())
        points = [(corner[0] + size * x, corner[1] + size * y) for x, y in on_unit]
        for (x, y), (u, v) in itertools.pairwise(points):
            along = math.hypot(u - x, v - y)
            middle = bd.Plane(((x + u) / 2, (y + v) / 2, top - DEPTH / 2), x_dir=(u - x, v - y, 0))
            solids.append(bd.Box(along + width, width, DEPTH).solid().moved(middle.location))
    return solids


def mold_marks(design: Design, mold: Mold, s: Sizes) -> tuple[list[Solid], list[Solid], str]:
    """Return the strokes to cut from A, those to cut from B, and a warning if a letter has no room (else "")."""
    width = mold.printing.stroke
    far_x, far_y = (max(centre[k] for centre in s.centres) for k in (0, 1))
    # the letter keeps the lid's thickness as its distance from the cavity: the checks ask for no less
    start = s.R + math.sqrt(max(s.lid**2 - (s.lid - DEPTH) ** 2, 0.0)) + MARGIN
    on_lid = s.rim - MARGIN - start
    # on the foot, in the corner between the cup with the gap around it and the edges
    on_foot = s.rim - MARGIN - (s.outer + MARGIN) / math.sqrt(2)
    least = 5 * width
    if not min(on_lid, on_foot) >= least:
        return [], [], f"the mould has no room for legible letters, which are at least {least:g} mm high"
    lid, foot = (min(size, 5.0) for size in (on_lid, on_foot))
    a = strokes("A", (far_x + start + on_lid / 2, 0.0), lid, width, s.lid)
    corner = far_x + s.rim - MARGIN - foot / 2, far_y + s.rim - MARGIN - foot / 2
    b = strokes("B", corner, foot, width, s.bottom + s.floor)
    if design.shape.has_magnet and len(set(mold.poles)) == 1:
        # in the mould the base is up: a north pole that points to the base faces up
        pole = "N" if design.magnet_north == "down" else "S"
        b += strokes(pole, (-corner[0], -corner[1]), foot, width, s.bottom + s.floor)
    return a, b, ""


def base_marks(
    half: float, is_round: bool, top: float, foot: float, hollows: Sequence[Block], width: float
) -> tuple[Block, ...]:
    """Return the grooves to cut from the base, one at +x and two at +y; none if one of them has no room.

    Parameters
    ----------
    half, is_round : half the side or half the diameter of the plate, mm, and whether it is round.
    top : height of the upper face of the plate, mm.
    foot : radius of the recess, or of the beam without one, mm.
    hollows : all that a groove must not meet: seats, passages, posts, and boxes around the screw holes.
    width : of a groove, mm.
    """
    along_x = _groove(0.0, half, is_round, top, foot, hollows, width)
    # along y the base is its image about the plane x = y
    mirrored = [swapped(hollow) for hollow in hollows]
    along_y = [_groove(side * width, half, is_round, top, foot, mirrored, width) for side in (-1, 1)]
    grooves = [along_x, *(groove and swapped(groove) for groove in along_y)]
    return tuple(groove for groove in grooves if groove) if all(grooves) else ()


def _groove(
    middle: float, half: float, is_round: bool, top: float, foot: float, hollows: Sequence[Block], width: float
) -> Block | None:
    """Return a groove along x, centred at y = `middle`, that opens at the edge of the base; None without room."""
    side = abs(middle) + width / 2
    edge = math.sqrt(half**2 - side**2) if is_round else half
    reaches = [
        hollow.corner[0] + hollow.sides[0]
        for hollow in hollows
        if hollow.corner[1] < middle + width / 2 + WEB
        and hollow.corner[1] + hollow.sides[1] > middle - width / 2 - WEB
    ]
    # 2 mm long where the rim has room; 0.4 mm are still found by eye and nail
    start = max(half - 2.0, max([foot, *reaches]) + WEB)
    if not edge - start >= 0.4:
        return None
    # the groove ends beyond the edge, so that the cut leaves no film there
    return Block((start, middle - width / 2, top - DEPTH), (half - start + width, width, DEPTH))
