"""The rigid base: a plate with its top in the plane z = 0, seats for the Hall elements, and holes for screws.

S1 lies in a pocket under the beam, open below, its leads in a channel towards -x. S2 and S3 stand in slots from
above, marked face to the beam, on a ledge that sets their height; their leads go down through the plate. What of them
would stand above the base gets a post as high as the element's plate, open towards the beam. Under the beam's
footprint they go into pockets from below too. A 3-axis chip sits on a board glued to the underside, its body in a
pocket. The base is printed as it stands, underside down. Lengths mm; the sensor's frame.
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

LEAST = 3.0
"""Thickness of the plate where the elements need no more, mm."""

LEAST_GAP = 0.1
"""Least gap between an element and the beam at rest, mm."""

PRESS = 3 / 8
"""Depth of the deepest press that is looked at, in units of D."""

EDGE = 1.5
"""From a screw hole or the beam to the edge of the base, mm."""

RANGES = {
    "thickness": Range(1.0, 1200.0),
    "seat_fit": Range(0.0, 1.0),
    "seat_wall": Range(0.4, 10.0),
    "screw": Range(0.0, 10.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """What a maker chooses about the base, mm; None means: taken from design and process.

    Attributes
    ----------
    thickness : of the plate; as much as the elements need, and at least 3 mm, by default.
    seat_fit : gap round an element in its seat; half the process's fit by default.
    seat_wall : of the posts, and least between seats and edge.
    screw : diameter of four holes in the corners (2.2 for M2 screws); 0 for none.

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
    """A box: its lowest corner and its sides, mm."""

    corner: Vector
    sides: Vector

    def solid(self) -> Solid:
        import build123d as bd

        return bd.Solid.make_box(*self.sides, bd.Plane(self.corner))

    def meets(self, other: Block, gap: float) -> bool:
        """Whether two boxes are nearer than a gap along every axis."""
        return all(
            a < b + t + gap and b < a + s + gap
            for a, s, b, t in zip(self.corner, self.sides, other.corner, other.sides, strict=True)
        )


@dataclass(frozen=True, slots=True)
class Plan:
    """The base's lengths, mm.

    Attributes
    ----------
    half : half the side of the square plate; thickness : of the plate.
    screw, screw_at : diameter of the holes (0: none), and their distance from both axes.
    seats : hollows for bodies; passages : for leads and what lies below; posts : what stands above z = 0.
    """

    half: float
    thickness: float
    screw: float
    screw_at: float
    seats: dict[str, Block]
    passages: dict[str, Block]
    posts: dict[str, Block]


def plan(design: Design, base: Base, process: str = "fdm") -> Plan:
    """Where everything on the base is, mm.

    Raises
    ------
    BadInput
        An element would lie in the beam or too near to it, or two seats would meet.
    """
    fit = PROCESSES[process].fit / 2 if base.seat_fit is None else base.seat_fit
    where = places(design)
    if design.hall_layout == "three":
        thickness = _thickness(base, max(LEAST, needs := _needs(where)), needs)
        seats, passages, posts = _three(design, where, fit, base.seat_wall, thickness)
    else:
        # the board under the base carries the chip: the base is as thick as its plates lie deep
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
    at = max((design.R + hole + EDGE) / math.sqrt(2), reach + base.seat_wall - hole if hole else 0.0)
    half = max(at + hole + EDGE if hole else 0.0, design.R + EDGE, reach + base.seat_wall)
    if "S1" in passages:
        passages["S1"] = dataclasses.replace(
            passages["S1"],
            corner=(-half, *passages["S1"].corner[1:]),
            sides=(half + seats["S1"].corner[0], *passages["S1"].sides[1:]),
        )
    return Plan(half, thickness, base.screw, at, seats, passages, posts)


def outer_size(design: Design, plan: Plan) -> tuple[Vector, float]:
    """Size of base, beam and bodies of the Hall elements together along x, y, z, and how far leads stand out below.

    Both mm, without board and screws. The leads are drawn
    `geometry.fabrication.hall_bodies.LEAD` long, for they are cut to need.
    """
    top, low = heights(design)
    return (2 * plan.half, 2 * plan.half, max(design.L, top) + plan.thickness), max(0.0, -plan.thickness - low)


def base(design: Design, choices: Base, process: str = "fdm") -> Solid:
    """The base in the sensor's frame, mm.

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


def _thickness(base: Base, default: float, needs: float) -> float:
    thickness = default if base.thickness is None else base.thickness
    if not thickness >= needs - 1e-9:
        raise BadInput(f"thickness must be at least {needs:.3g} mm for the elements' seats; got {thickness:g} mm")
    return thickness


def _needs(where: dict[str, Vector]) -> float:
    """Least thickness of the plate under three one-axis elements."""
    p = SS495A
    return max(p.thickness - p.depth - where["S1"][2], p.height / 2 - where["S2"][2] + WEB)


def _three(
    design: Design, where: dict[str, Vector], fit: float, wall: float, thickness: float
) -> tuple[dict[str, Block], dict[str, Block], dict[str, Block]]:
    p, (_, _, z1), (_, _, z23) = SS495A, where["S1"], where["S2"]
    roof = z1 + p.depth + fit
    if not roof <= -WEB:
        raise BadInput(
            f"l0 must be at least {design.l0 + roof + WEB:.4g} mm to leave {WEB:g} mm of base between S1 and the "
            f"beam; got {design.l0:g} mm"
        )
    half = p.width / 2 + fit
    seats = {"S1": Block((-p.height / 2 - fit, -half, -thickness), (p.height + 2 * fit, 2 * half, roof + thickness))}
    lead_roof = z1 + p.depth - (p.thickness - p.lead) / 2 + fit
    aside = p.leads / 2 + fit
    passages = {"S1": Block((0.0, -aside, -thickness), (0.0, 2 * aside, lead_roof + thickness))}
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
    for group in (seats, passages, posts):
        if "S2" in group:
            group["S3"] = _swapped(group["S2"])
    found = {name: [block for group in (seats, passages) if (block := group[name]).sides[2] > 0] for name in seats}
    for one, other in (("S1", "S2"), ("S2", "S3")):
        if any(a.meets(b, WEB) for a in found[one] for b in found[other] if a.sides[0] > 0):
            raise BadInput(
                f"f = {design.f:g} mm leaves less than {WEB:g} mm between the seats of {one} and {other}: raise f"
            )
    return seats, passages, posts


def _swapped(block: Block) -> Block:
    """The same with x and y exchanged."""
    (x, y, z), (a, b, c) = block.corner, block.sides
    return Block((y, x, z), (b, a, c))


def _chip(design: Design, where: dict[str, Vector], fit: float, thickness: float) -> Block:
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
    """What a wide flat plate would touch before the beam is pressed as deep as it is used, 3/8 D."""
    if design.hall_layout != "three":
        return []
    room = round(max(design.L - places(design)["S2"][2] - SS495A.height / 2, 0.0), 9)
    if room >= PRESS * design.D:
        return []
    return [f"a wide flat plate touches S2 and S3 at a depth of {room:.3g} mm: lower c or use a smaller plate"]


def checks(design: Design, solid: Solid, bodies: dict[str, Solid]) -> list[Check]:
    """The seats, measured: elements and beam touch nothing but what they stand on."""
    form, all_bodies = beam(design), list(bodies.values())
    pairs = [(one, solid) for one in all_bodies] + [(form, solid)] + [(one, form) for one in all_bodies]
    pairs += list(itertools.combinations(all_bodies, 2))
    shared = max(overlap(one, other) for one, other in pairs)
    gap = min(body.distance_to(form) for body in all_bodies)
    return [
        at_most("overlap of base, beam and Hall elements", shared, 1e-9, "mm3"),
        at_least("gap between Hall elements and beam", gap, LEAST_GAP),
    ]
