"""The rigid base: a square or round plate with seats for the Hall elements, holes for screws, and a recess.

The base plane z = 0 is the glued underside of the beam: the top of the plate, or the floor of its recess, so that l0
and c do not depend on the recess. The base is printed with its underside down. All lengths are in mm, in the sensor's
frame.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from geometry.array_design import ArrayDesign
from geometry.arrays import Array, Point, Vector
from geometry.bad_input import check_ranges, nearest, quantity
from geometry.cad import beam, cut, moved, overlap, turned
from geometry.design import BadInput, Design
from geometry.fabrication import breakout_boards, engraved_marks, hall_elements
from geometry.fabrication.hall_elements import CLOSE, SS495A, WEB, Block, Seats, heights, places
from geometry.fabrication.printability import PROCESSES, Check, at_least, at_most
from geometry.mold import screw_length

if TYPE_CHECKING:
    from build123d import Solid

SHAPES = ("square", "round")
"""Outlines of the base."""

LEAST_GAP = 0.1
"""Least gap between an element and the beam at rest, mm."""

THREADS = (1.0, 1.2, 1.6, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Coarse metric threads, mm (ISO 262)."""

EDGE = 1.5
"""Least distance of the edge of the base from a screw hole and from the beam, mm."""


RECESS = 0.4
"""Depth of a recess where none is chosen, mm: two common layers of filament printing are enough to feel its rim."""

MOUTH = (0.2, 0.3)
"""Width and height of the chamfer at the mouth of a pocket in the underside, mm: it is printed on the bed, where
hollows close by some 0.1 mm a side."""

THINNEST = 3.0
"""Least thickness of a plate with three one-axis elements where none is chosen, mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Base:
    """The choices of a maker for the base, mm. None stands for a default that follows from design and process.

    Attributes
    ----------
    shape : outline of the plate, square or round.
    outer : side of a square plate or diameter of a round one; default: the least that holds everything.
    thickness : thickness of the plate below the base plane; default: as much as the elements need, at least 3 mm.
    seat_fit : gap around an element in its seat; default: half the fit of the process.
    seat_wall : thickness of the posts' walls, and least distance of the edge of the base from a seat. The edge of a
        round base is as far from the recess too.
    recess : depth of the pocket that centres the beam, 0 for none; default: 0.4 on a round base and on that of an
        array, 0 on a square one.
    recess_gap : radial gap between beam and pocket; default: the fit of the process.
    screw : diameter of the four holes on the diagonals (2.2 for M2 screws), 0 for none; default: 2.2 on a square
        base, 0 on a round one.
    marks : 1 for grooves in the edge of the upper face, one at +x and two at +y.
    breakout : name of a breakout board (`geometry.fabrication.breakout_boards`) that is screwed under a square base
        in place of a board of its own; "" for none.
    cell : name of the load cell (`geometry.fabrication.bench_parts`) that the fixture fits; "" for the first one.

    Raises
    ------
    BadInput
        A value lies outside its range, or the shape is unknown.
    """

    shape: str = "square"
    outer: float | None = quantity(None, "mm", 0.1, 4000.0)
    thickness: float | None = quantity(None, "mm", 1.0, 1200.0)
    seat_fit: float | None = quantity(None, "mm", 0.0, 1.0)
    seat_wall: float = quantity(1.2, "mm", 0.4, 10.0)
    recess: float | None = quantity(None, "mm", 0.0, 10.0)
    recess_gap: float | None = quantity(None, "mm", 0.0, 1.0)
    screw: float | None = quantity(None, "mm", 0.0, 10.0)
    marks: int = quantity(0, "1", 0, 1, count=True)
    breakout: str = ""
    cell: str = ""

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise BadInput(f"there is no shape {self.shape!r} of the base: {nearest(str(self.shape), SHAPES)}")
        check_ranges(self)
        if self.breakout and (self.is_round or self.screw is not None):
            raise BadInput(
                f"breakout {self.breakout} sets the screws of a square base: set shape=square, and leave screw out"
            )

    @property
    def hole(self) -> float:
        """Diameter of the screw holes, mm; 0 for none."""
        return (0.0 if self.is_round else 2.2) if self.screw is None else self.screw

    @property
    def is_round(self) -> bool:
        return self.shape == "round"


@dataclass(frozen=True, slots=True)
class Plan:
    """The base's lengths, mm.

    Attributes
    ----------
    is_round : whether the plate is round; else it is square.
    half : half the diameter of the plate, or half its side.
    thickness : thickness of the plate below the base plane z = 0.
    recess, recess_radius : depth and radius of the pocket for the beam; the plate's top is at z = recess.
    screw : diameter of the screw holes (0: none).
    screws : x and y of the centres of the screw holes.
    seats : hollows for the elements and their leads, and posts, by element.
    openings : hollows that remove walls too thin to print: those between two seats, or between a seat and the recess;
        and those above the parts of a breakout board.
    marks : grooves in the edge of the upper face: at +x, and two at +y; empty if not wanted, or without room.
    """

    is_round: bool
    half: float
    thickness: float
    recess: float
    recess_radius: float
    screw: float
    screws: tuple[Point, ...]
    seats: Seats
    openings: tuple[Block, ...]
    marks: tuple[Block, ...] = ()

    @property
    def widest_tab(self) -> float:
        """Width of the widest tab of a board beside the base, mm."""
        return 2 * self.half * (0.9 if self.is_round else 1.0)


def plan(design: Design, base: Base, process: str = "fdm") -> Plan:
    """Return the positions and sizes of all features of the base, mm.

    Raises
    ------
    BadInput
        An element would lie in the beam or too close to it, two seats would meet, or `outer` is too small.
    """
    fit = PROCESSES[process].fit / 2 if base.seat_fit is None else base.seat_fit
    where = places(design)
    if design.hall_layout == "three":
        least = float(least_thickness(*(np.array(where[name][2]) for name in ("S1", "S2"))))
        thickness = max(THINNEST, least) if base.thickness is None else base.thickness
        if not thickness >= least - CLOSE:
            raise BadInput(f"thickness must be at least {least:.3g} mm for the elements' seats; got {thickness:g} mm")
        seats = hall_elements.three_elements(design, where, fit, base.seat_wall, thickness)
    else:
        # the chip stands on the board under the base, so the height of its Hall plates fixes the thickness
        thickness = design.chip.plate - (design.H - design.l0)
        if base.thickness is not None and not abs(base.thickness - thickness) <= 1e-6:
            raise BadInput(
                f"l0 sets the thickness of a chip's base, here {thickness:.4g} mm; got {base.thickness:g} mm: "
                "leave thickness out"
            )
        seats = hall_elements.chip_seats(design, fit, thickness)
    recess = (RECESS if base.is_round else 0.0) if base.recess is None else base.recess
    recess_radius = design.R + (PROCESSES[process].fit if base.recess_gap is None else base.recess_gap)
    screw = base.hole
    foot = recess_radius if recess else design.R
    half, screw_at = _outline(design, base, seats, foot, screw)
    screws: tuple[Point, ...] = tuple((i * screw_at, j * screw_at) for i in (-1, 1) for j in (-1, 1)) if screw else ()
    reliefs: tuple[Block, ...] = ()
    if base.breakout:
        board, centre = breakout_boards.breakout(base.breakout, design)
        screw, screws = board.hole, tuple(board.placed(hole, centre) for hole in board.holes)
        reliefs = breakout_boards.hollows(board, centre, thickness, recess, foot)
        half = _half_for(base, half, max(max(map(abs, at)) for at in screws) + screw / 2 + EDGE)
    if "S1" in seats.passages:
        # only now is the edge known to which the channel for the leads of S1 runs
        channel = seats.passages["S1"]
        seats.passages["S1"] = dataclasses.replace(
            channel,
            corner=(-half, *channel.corner[1:]),
            sides=(half + seats.bodies["S1"].corner[0], *channel.sides[1:]),
        )
    marks: tuple[Block, ...] = ()
    if base.marks:
        holes = [Block((x - screw / 2, y - screw / 2, 0.0), (screw, screw, 0.0)) for x, y in screws]
        hollows = [block for group in (seats.bodies, seats.passages, seats.posts) for block in group.values()]
        hollows += [block for block in reliefs if block.sides[2] > thickness]
        marks = engraved_marks.base_marks(
            half, base.is_round, recess, foot, [*hollows, *holes], PROCESSES[process].stroke
        )
    return Plan(
        is_round=base.is_round,
        half=half,
        thickness=thickness,
        recess=recess,
        recess_radius=recess_radius,
        screw=screw,
        screws=screws,
        seats=seats,
        openings=(*_openings(seats, recess, recess_radius), *reliefs),
        marks=marks,
    )


def _half_for(base: Base, least: float, needed: float) -> float:
    """Return half the side of a plate that holds the screws of a breakout board too."""
    if base.outer is None:
        return max(least, needed)
    if not base.outer >= 2 * needed - 1e-9:
        board = f"breakout {base.breakout}"
        raise BadInput(f"outer must be at least {2 * needed:.4g} mm for the screws of {board}; got {base.outer:g} mm")
    return least


def _outline(design: Design, base: Base, seats: Seats, foot: float, screw: float) -> tuple[float, float]:
    """Return half the side or half the diameter of the plate, and |x| and |y| of the screw holes, mm.

    foot : radius of the recess, or of the beam without one, mm.
    """
    # the farthest point of each seat along x and along y, on either side
    blocks = (*seats.bodies.values(), *seats.posts.values())
    x, y = (np.array([[max(-b.corner[k], b.corner[k] + b.sides[k])] for b in blocks]) for k in (0, 1))
    ends = least_outline(x, y, np.array([foot]), screw, base.seat_wall, base.is_round)
    (least,), (at,) = (end.tolist() for end in ends)
    hole = screw / 2
    if base.outer is None:
        return least, at
    if not base.outer >= 2 * least - 1e-9:
        raise BadInput(
            f"outer must be at least {math.ceil(2e3 * least) / 1e3:g} mm for a {base.shape} base of this design; got "
            f"{base.outer:g} mm: set a larger outer, or a smaller seat_wall or screw, or move the elements inwards"
        )
    far = base.outer / 2 - hole - EDGE
    return base.outer / 2, (far / math.sqrt(2) if base.is_round else far) if hole else at


def least_outline(x: Array, y: Array, foot: Array, screw: float, wall: float, is_round: bool) -> tuple[Array, Array]:
    """Return half the least side or diameter of n plates, and |x| and |y| of their screw holes, each (n,), mm.

    Parameters
    ----------
    x, y : farthest points of the seats along x and along y, (k, n), mm.
    foot : radii of the recesses, or of the beams without one, (n,), mm.
    screw, wall : diameter of the holes, 0 for none, and wall between seats and edge, mm.
    """
    hole = screw / 2
    at_beam, none = (foot + hole + EDGE) / math.sqrt(2), np.zeros_like(foot)
    if is_round:
        # a hole on the diagonal lies beside the seats; its wall to a seat is at least as thick as that of a post
        at = np.maximum(at_beam, np.minimum(x, y).max(axis=0) + wall + hole) if hole else none
        beam, reach, aside = foot + wall, np.hypot(x, y).max(axis=0), math.sqrt(2) * at
    else:
        # the holes lie on the diagonals, EDGE away from the beam, and reach as far out as the seats and their walls
        beam, reach = foot + EDGE, np.maximum(x, y).max(axis=0)
        at = aside = np.maximum(at_beam, reach + wall - hole if hole else none)
    return np.maximum.reduce([aside + hole + EDGE if hole else none, beam, reach + wall]), at


def least_thickness(z1: Array, z23: Array) -> Array:
    """Return the least thickness of plates for S1 and for S2 and S3 at these heights, mm."""
    part = SS495A
    return np.maximum(part.thickness - part.depth - z1, part.height / 2 - z23 + WEB)


def _openings(seats: Seats, recess: float, recess_radius: float) -> tuple[Block, ...]:
    seat = seats.bodies.get("S2")
    if seat is None:
        return ()
    gap, openings = hall_elements.neck(seat), []
    if gap < WEB - CLOSE:
        # a thinner wall could not be printed; the hollow overlaps both seats, so that no edge touches an edge
        start, side = seat.corner[0] - gap - WEB / 4, gap + WEB / 2
        openings.append(Block((start, start, seat.corner[2]), (side, side, seat.sides[2])))
    near, top = seat.corner[0], seat.corner[2] + seat.sides[2]
    if recess and recess_radius > near - WEB and near > 0 and top > 0:
        # in front of S2 and S3 the recess opens into their slots, as wide as the wall between would be too thin
        aside = min(-seat.corner[1], math.sqrt(recess_radius**2 - max(near - WEB, 0.0) ** 2))
        gate = Block((0.0, -aside, 0.0), (near + seat.sides[0] / 2, 2 * aside, recess))
        openings += [gate, hall_elements.swapped(gate)]
    return tuple(openings)


BOARDS = (1.6, 0.8)
"""Thicknesses of a board under the base, the usual one first, mm."""


def base_screw(plan: Plan, board: float = BOARDS[0], below: float = 0.0) -> float:
    """Return the length of the screws through base, board and what lies below, mm; 0 without screws.

    Nut and washer are together as high as the thread is wide (ISO 4032, ISO 7089).
    """
    if not plan.screw:
        return 0
    return screw_length(below + board + plan.thickness + plan.recess + screw_thread(plan.screw))


def screw_thread(hole: float) -> float:
    """Return the metric thread, mm, of a screw through a hole: the largest that leaves it a clearance.

    >>> screw_thread(1.7), screw_thread(2.2), screw_thread(2.7), screw_thread(3.4)
    (1.6, 2.0, 2.5, 3.0)
    """
    return max((thread for thread in THREADS if thread < hole), default=hole)


def outer_size(design: Design, plan: Plan, whole: ArrayPlan | None = None) -> tuple[Vector, float]:
    """Return the outer size of the sensor along x, y, z, and the length of the leads below the base, both in mm.

    whole : of an array, whose size it is.

    The outer size covers base, beam and bodies of the Hall elements, without board and screws.
    """
    top, low = heights(design)
    high = max(design.L, top, plan.recess)
    sides = whole.sides if whole else (2 * plan.half, 2 * plan.half)
    return (*sides, high + plan.thickness), max(0.0, -plan.thickness - low)


def base(p: Plan) -> Solid:
    """Return the solid of a base in the sensor's frame, mm."""
    import build123d as bd

    height = p.thickness + p.recess
    if p.is_round:
        plate = turned([(0, -p.thickness, 0), (p.half, -p.thickness, 0), (p.half, p.recess, 0), (0, p.recess, 0)])
    else:
        plate = Block((-p.half, -p.half, -p.thickness), (2 * p.half, 2 * p.half, height)).solid()
    if p.seats.posts:
        plate = plate.fuse(*(post.solid() for post in p.seats.posts.values())).solids()[0]
    hollows = (*p.seats.bodies.values(), *p.seats.passages.values(), *p.openings, *p.marks)
    tools = [block.solid() for block in hollows]
    tools += [_mouth(seat) for seat in p.seats.bodies.values() if seat.corner[2] <= -p.thickness + CLOSE]
    if p.recess > 0:
        tools.append(turned([(0, 0, 0), (p.recess_radius, 0, 0), (p.recess_radius, p.recess, 0), (0, p.recess, 0)]))
    if p.screw > 0:
        tools += [bd.Solid.make_cylinder(p.screw / 2, height, bd.Plane((x, y, -p.thickness))) for x, y in p.screws]
    return cut(plate, *tools)


@dataclass(frozen=True, slots=True, eq=False)
class ArrayPlan:
    """The lengths of one plate for all beams of an array, mm, in the frame of their places.

    Attributes
    ----------
    one : the plan of one beam's base, whose pockets and recess each beam has.
    box : least x and y, and greatest x and y of the plate.
    screws : x and y of the centres of the screw holes, at the corners.
    """

    array: ArrayDesign
    one: Plan
    box: tuple[float, float, float, float]
    screws: tuple[Point, ...]

    @property
    def sides(self) -> Point:
        west, south, east, north = self.box
        return east - west, north - south


def array_plan(array: ArrayDesign, choices: Base, process: str = "fdm") -> ArrayPlan:
    """Return the plan of one plate for the beams of an array: pockets at their places, screws at its corners.

    Raises
    ------
    BadInput
        The base of one beam cannot be, or needs its own edge, or too little is left between those of neighbours.
    """
    if choices.recess is None:
        # beams far from the edge have nothing else to lie at
        choices = dataclasses.replace(choices, recess=RECESS)
    design, p = array.design, plan(array.design, choices, process)
    if design.hall_layout == "three" or choices.breakout:
        raise BadInput(
            "a base for an array is made for chips: leads of one-axis elements run to the edge of a base of their "
            "own, and breakout boards are wider than a pitch; set hall_layout to a chip, or make a base for each beam"
        )
    gap = min(_gaps(array, p))
    if not gap >= WEB - CLOSE:
        raise BadInput(
            f"pockets and recesses of neighbours leave {gap:.3g} mm of the base between them, and {WEB:g} mm are "
            f"needed: take a pitch of {math.ceil(100 * (array.pitch + WEB - gap)) / 100:g} mm or more"
            + (", or a base without recesses (recess=0)" if p.recess else "")
        )
    return plan_under(array, p)


def plan_under(array: ArrayDesign, p: Plan) -> ArrayPlan:
    """Return the plan of one plate for the beams of an array from that of one beam, of which nothing is checked."""
    (west, south), (east, north) = array.places.min(axis=0).tolist(), array.places.max(axis=0).tolist()
    screws = tuple(((east if x > 0 else west) + x, (north if y > 0 else south) + y) for x, y in p.screws)
    return ArrayPlan(array, p, (west - p.half, south - p.half, east + p.half, north + p.half), screws)


def array_base(whole: ArrayPlan) -> Solid:
    """Return one plate for the beams of an array, in the frame of their places, mm."""
    import build123d as bd

    p, (west, south, _, _) = whole.one, whole.box
    height, low = p.thickness + p.recess, -p.thickness
    plate = Block((west, south, low), (*whole.sides, height)).solid()
    pockets = [seat.solid() for seat in p.seats.bodies.values()] + [_mouth(seat) for seat in p.seats.bodies.values()]
    if p.recess > 0:
        pockets.append(turned([(0, 0, 0), (p.recess_radius, 0, 0), (p.recess_radius, p.recess, 0), (0, p.recess, 0)]))
    tools = [moved(pocket, (x, y, 0.0)) for x, y in whole.array.places.tolist() for pocket in pockets]
    tools += [bd.Solid.make_cylinder(p.screw / 2, height, bd.Plane((x, y, low))) for x, y in whole.screws]
    return cut(plate, *tools)


def least_pitch(x: Array, y: Array, foot: Array | float, *, is_round: bool) -> Array:
    """Return the pitch of arrays from which on pockets and recesses of any two beams keep `WEB` apart, (n,), mm.

    x, y : ends of the pockets of one beam along x and y, shape (2, m, n). foot : as in `least_outline`.
    """
    pockets = np.maximum(*((ends[1].max(axis=0) - ends[0].min(axis=0)) for ends in (x, y)))
    return np.asarray(WEB + np.maximum(pockets, 2 * foot if is_round else 0.0))


def _gaps(array: ArrayDesign, p: Plan) -> list[float]:
    """Return what is left between recesses, and between pockets, of any two beams, mm."""
    found = [array.pitch - 2 * p.recess_radius if p.recess else math.inf]
    low, sides = (
        np.array([getattr(seat, name)[:2] for seat in p.seats.bodies.values()]) for name in ("corner", "sides")
    )
    for first, second in itertools.combinations(array.places, 2):
        # from the far side of one pocket to the near side of the other, along x and y
        ahead = (second + low)[None] - (first + low + sides)[:, None]
        behind = (first + low)[:, None] - (second + low + sides)[None]
        found.append(float(np.maximum(ahead, behind).max(axis=2).min()))
    return found


def _mouth(seat: Block) -> Solid:
    """Return the hollow that widens a pocket at its lower end, a frustum."""
    import build123d as bd

    (out, high), (x, y, z), (length, width, _) = MOUTH, seat.corner, seat.sides
    # a wedge becomes narrower along its own y, here z
    plane = bd.Plane((x - out, y + width + out, z), x_dir=(1, 0, 0), z_dir=(0, -1, 0))
    sides = length + 2 * out, high, width + 2 * out
    return bd.Solid.make_wedge(*sides, out, out, out + length, out + width, plane)


def array_checks(whole: ArrayPlan, solid: Solid, bodies: dict[str, Solid]) -> list[Check]:
    """Measure the overlaps of the base of an array with beams and elements at their places."""
    parts = [beam(whole.array.design), *bodies.values()]
    at = [(x, y, 0.0) for x, y in whole.array.places.tolist()]
    shared = max(overlap(solid, moved(part, place)) for place in at for part in parts)
    return [at_most("overlap of the array's base with beams and Hall elements", shared, 1e-9, "mm3")]


def warnings(design: Design) -> list[str]:
    """Return a warning if a wide flat plate would touch S2 and S3 at a depth below 3/8 D, the largest in use."""
    if design.hall_layout != "three":
        return []
    depth = round(max(design.L - places(design)["S2"][2] - SS495A.height / 2, 0.0), 9)
    if depth >= 3 / 8 * design.D:
        return []
    return [f"a wide flat plate touches S2 and S3 at a depth of {depth:.3g} mm: lower c or use a smaller plate"]


def checks(design: Design, solid: Solid, bodies: dict[str, Solid]) -> list[Check]:
    """Measure the overlaps and gaps of base, beam and Hall elements, and compare them with their bounds."""
    form, elements = beam(design), list(bodies.values())
    pairs = itertools.combinations([solid, form, *elements], 2)
    shared = max(itertools.starmap(overlap, pairs))
    gap = min(body.distance_to(form) for body in elements)
    return [
        at_most("overlap of base, beam and Hall elements", shared, 1e-9, "mm3"),
        at_least("gap between Hall elements and beam", gap, LEAST_GAP),
    ]
