"""The rigid base: a plate with its top in the plane z = 0, seats for the Hall elements, and holes for screws.

S1 lies in a pocket under the beam. The pocket is open below, and a channel towards -x holds the leads.

S2 and S3 beside the beam stand in slots that are open at the top, with their marked faces towards the beam. A ledge
in each slot sets the height of the element, and the leads pass down through the plate. An element that rises above
the top of the base gets a post, open towards the beam and as high as the element's Hall plate. Under the beam, S2 and
S3 lie in pockets that are open below, as S1 does.

A 3-axis chip is soldered to a board that is glued to the underside of the base; a pocket holds its body.

The base is printed with its underside down. All lengths are in mm, in the sensor's frame.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.cad import beam, cut, overlap
from geometry.design import BadInput, Design
from geometry.fabrication.hall_bodies import CHIPS, SS495A, Vector, heights, places
from geometry.fabrication.printability import PROCESSES, Check, Range, at_least, at_most

if TYPE_CHECKING:
    from build123d import Solid

WEB = 0.6
"""Least thickness of base between an element and the beam, and of the ledge under an element, mm."""

DEFAULT_THICKNESS = 3.0
"""Thickness of the plate, mm, unless the elements need a thicker one."""

LEAST_GAP = 0.1
"""Least gap between an element and the beam at rest, mm."""

PRESS = 3 / 8
"""Depth down to which a wide flat plate must not touch S2 and S3, in units of D."""

EDGE = 1.5
"""Least distance of the edge of the base from a screw hole and from the beam, mm."""

RANGES = {
    "thickness": Range(1.0, 1200.0),
    "seat_fit": Range(0.0, 1.0),
    "seat_wall": Range(0.4, 10.0),
    "screw": Range(0.0, 10.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """The choices of a maker for the base, mm. None stands for a default that follows from design and process.

    Attributes
    ----------
    thickness : thickness of the plate; default: as much as the elements need, and at least 3 mm.
    seat_fit : gap around an element in its seat; default: half the fit of the process.
    seat_wall : thickness of the posts' walls, and least distance between a seat and the edge of the base.
    screw : diameter of the four holes in the corners (2.2 for M2 screws); 0 for none.

    Raises
    ------
    BadInput
        A value lies outside its range.
    """

    thickness: float | None = None
    seat_fit: float | None = None
    seat_wall: float = 1.2
    screw: float = 2.2

    def __post_init__(self) -> None:
        for spec in dataclasses.fields(self):
            value: object = getattr(self, spec.name)
            if value is not None or spec.default is not None:
                RANGES[spec.name].check(spec.name, value)


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
class Plan:
    """The base's lengths, mm.

    Attributes
    ----------
    half : half the side of the square plate.
    thickness : thickness of the plate.
    screw : diameter of the screw holes (0: none).
    screw_at : |x| and |y| of the centres of the screw holes.
    seats : hollows for the bodies of the elements, by element.
    passages : hollows for their leads.
    posts : parts of the base above z = 0.
    """

    half: float
    thickness: float
    screw: float
    screw_at: float
    seats: dict[str, Block]
    passages: dict[str, Block]
    posts: dict[str, Block]


def plan(design: Design, base: Base, process: str = "fdm") -> Plan:
    """Return the positions and sizes of all features of the base, mm.

    Raises
    ------
    BadInput
        An element would lie in the beam or too close to it, or two seats would meet.
    """
    fit = PROCESSES[process].fit / 2 if base.seat_fit is None else base.seat_fit
    where = places(design)
    if design.hall_layout == "three":
        thickness = _thickness(base, _least_thickness(where))
        seats, passages, posts = _three(design, where, fit, base.seat_wall, thickness)
    else:
        # the chip stands on the board under the base, so the height of its Hall plates fixes the thickness
        thickness = CHIPS[design.hall_layout].plate - where[design.hall_layout][2]
        if base.thickness is not None and not abs(base.thickness - thickness) <= 1e-6:
            raise BadInput(
                f"l0 sets the thickness of a chip's base, here {thickness:.4g} mm; got {base.thickness:g} mm: "
                "leave thickness out"
            )
        seats, passages, posts = {design.hall_layout: _chip(design, where, fit, thickness)}, {}, {}
    blocks = [*seats.values(), *posts.values()]
    reach = max(max(abs(b.corner[k]), b.corner[k] + b.sides[k]) for b in blocks for k in (0, 1))
    hole = base.screw / 2
    # the holes lie on the diagonals, EDGE away from the beam, and reach as far out as the seats and their walls
    at = max((design.R + hole + EDGE) / math.sqrt(2), reach + base.seat_wall - hole if hole else 0.0)
    half = max(at + hole + EDGE if hole else 0.0, design.R + EDGE, reach + base.seat_wall)
    if "S1" in passages:
        # only now is the edge known to which the channel for the leads of S1 runs
        passages["S1"] = dataclasses.replace(
            passages["S1"],
            corner=(-half, *passages["S1"].corner[1:]),
            sides=(half + seats["S1"].corner[0], *passages["S1"].sides[1:]),
        )
    return Plan(half, thickness, base.screw, at, seats, passages, posts)


def outer_size(design: Design, plan: Plan) -> tuple[Vector, float]:
    """Return the outer size of the sensor along x, y, z, and the length of the leads below the base, both in mm.

    The outer size covers base, beam and bodies of the Hall elements, without board and screws. Leads count as
    `geometry.fabrication.hall_bodies.LEAD` long; a maker cuts them to the length needed.
    """
    top, low = heights(design)
    return (2 * plan.half, 2 * plan.half, max(design.L, top) + plan.thickness), max(0.0, -plan.thickness - low)


def base(design: Design, choices: Base, process: str = "fdm") -> Solid:
    """Return the solid of the base in the sensor's frame, mm.

    Raises
    ------
    BadInput
        See `plan`.
    """
    import build123d as bd

    p = plan(design, choices, process)
    plate = Block((-p.half, -p.half, -p.thickness), (2 * p.half, 2 * p.half, p.thickness)).solid()
    if p.posts:
        plate = plate.fuse(*(post.solid() for post in p.posts.values())).solids()[0]
    tools = [block.solid() for block in (*p.seats.values(), *p.passages.values())]
    if p.screw > 0:
        corners = [(x, y, -p.thickness) for x in (-p.screw_at, p.screw_at) for y in (-p.screw_at, p.screw_at)]
        tools += [bd.Solid.make_cylinder(p.screw / 2, p.thickness, bd.Plane(corner)) for corner in corners]
    return cut(plate, *tools)


def _thickness(base: Base, least: float) -> float:
    """Return the chosen or the default thickness of the plate; `least` is what the elements need."""
    thickness = max(DEFAULT_THICKNESS, least) if base.thickness is None else base.thickness
    if not thickness >= least - 1e-9:
        raise BadInput(f"thickness must be at least {least:.3g} mm for the elements' seats; got {thickness:g} mm")
    return thickness


def _least_thickness(where: dict[str, Vector]) -> float:
    """Return the least thickness of the plate that holds three one-axis elements, mm."""
    p = SS495A
    return max(p.thickness - p.depth - where["S1"][2], p.height / 2 - where["S2"][2] + WEB)


def _three(
    design: Design, where: dict[str, Vector], fit: float, wall: float, thickness: float
) -> tuple[dict[str, Block], dict[str, Block], dict[str, Block]]:
    """Return seats, passages and posts of three one-axis elements, by element."""
    p, (_, _, z1), (_, _, z23) = SS495A, where["S1"], where["S2"]
    roof = z1 + p.depth + fit
    if not roof <= -WEB:
        raise BadInput(
            f"l0 must be at least {design.l0 + roof + WEB:.4g} mm to leave {WEB:g} mm of base between S1 and the "
            f"beam; got {design.l0:g} mm"
        )
    half = p.width / 2 + fit
    # S1 lies flat with its marked face up, so its height runs along x and its leads point to -x
    seats = {"S1": Block((-p.height / 2 - fit, -half, -thickness), (p.height + 2 * fit, 2 * half, roof + thickness))}
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
        seats["S2"] = Block((near, -half, low), (far - near, 2 * half, top + p.height - low))
    elif high <= -WEB:
        seats["S2"] = Block((near, -half, -thickness), (far - near, 2 * half, high + thickness))
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
    # S3 mirrors S2 about the plane x = y, so the pair S1, S3 need not be compared
    for group in (seats, passages, posts):
        if "S2" in group:
            group["S3"] = _swapped(group["S2"])
    hollows = {name: [block for group in (seats, passages) if (block := group[name]).sides[2] > 0] for name in seats}
    for one, other in (("S1", "S2"), ("S2", "S3")):
        if any(a.meets(b, WEB) for a in hollows[one] for b in hollows[other] if a.sides[0] > 0):
            raise BadInput(
                f"f = {design.f:g} mm leaves less than {WEB:g} mm between the seats of {one} and {other}: raise f"
            )
    return seats, passages, posts


def _swapped(block: Block) -> Block:
    """Return the block with x and y exchanged."""
    (x, y, z), (length, width, height) = block.corner, block.sides
    return Block((y, x, z), (width, length, height))


def _chip(design: Design, where: dict[str, Vector], fit: float, thickness: float) -> Block:
    """Return the pocket of a 3-axis chip, open below."""
    chip, (middle, _, z) = CHIPS[design.hall_layout], where[design.hall_layout]
    roof = z - chip.plate + chip.height + fit
    if not roof <= -WEB:
        raise BadInput(
            f"l0 must be at least {design.l0 + roof + WEB:.4g} mm to leave {WEB:g} mm of base over the chip; "
            f"got {design.l0:g} mm"
        )
    x, y = chip.length / 2 + fit, chip.width / 2 + fit
    return Block((middle - x, -y, -thickness), (2 * x, 2 * y, roof + thickness))


def warnings(design: Design) -> list[str]:
    """Return a warning if a wide flat plate would touch S2 and S3 at a depth below 3/8 D, the largest in use."""
    if design.hall_layout != "three":
        return []
    depth = round(max(design.L - places(design)["S2"][2] - SS495A.height / 2, 0.0), 9)
    if depth >= PRESS * design.D:
        return []
    return [f"a wide flat plate touches S2 and S3 at a depth of {depth:.3g} mm: lower c or use a smaller plate"]


def checks(design: Design, solid: Solid, bodies: dict[str, Solid]) -> list[Check]:
    """Measure the overlaps and gaps of base, beam and Hall elements, and compare them with their bounds."""
    form, all_bodies = beam(design), list(bodies.values())
    pairs = [(one, solid) for one in all_bodies] + [(form, solid)] + [(one, form) for one in all_bodies]
    pairs += list(itertools.combinations(all_bodies, 2))
    shared = max(overlap(one, other) for one, other in pairs)
    gap = min(body.distance_to(form) for body in all_bodies)
    return [
        at_most("overlap of base, beam and Hall elements", shared, 1e-9, "mm3"),
        at_least("gap between Hall elements and beam", gap, LEAST_GAP),
    ]
