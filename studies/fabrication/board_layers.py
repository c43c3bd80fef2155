"""A circuit board as a thing: its parts, tracks and holes, the rules that it keeps, its ground and its silkscreen.

All lengths are mm in the sensor's frame, seen from above: x to the right, y upwards, the origin on the beam's axis.
The rules are those of low-cost makers; a board that breaks one is refused.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.arrays import Point
from geometry.design import BadInput

if TYPE_CHECKING:
    from shapely import Polygon

TRACK, CLEARANCE, VIA, DRILL = 0.2, 0.15, 0.5, 0.3
"""Width of a track, gap between nets, and diameters of a via and of its hole: what low-cost makers offer."""
EDGE, HOLE_GAP, HOLES_APART = 0.3, 0.25, 0.25
"""Gaps between copper and the board's edge, between copper and a hole for a screw, and between two holes."""
POUR_GAP, SPOKE, SLIVER = 0.2, 0.3, 0.2
"""Of the ground: gap to other nets and round pads, width of the spokes that hold a pad, and its least width."""
ROUND = 3e-3
"""Largest distance of the ground's edge, which has corners, from the rounded one that keeps its gap."""
COURT = 0.25
"""Room round a part that no other part on this side may take."""
MASK = 0.05
"""Gap of the solder mask round a pad."""
PEN, LETTER = 0.15, 1.0
"""Width of lines of the silkscreen and height of its letters, the least that low-cost makers print well."""
SCREEN_GAP = 0.15
"""Least gap between silkscreen and a pad or an edge."""


@dataclass(frozen=True, slots=True)
class Pad:
    """A pad: centre, size along x and y, diameter of its plated hole (0: none), round or not; net "" is open."""

    number: str
    net: str
    at: Point
    size: Point
    drill: float = 0.0
    is_round: bool = False

    def shape(self, more: float = 0.0) -> Polygon:
        import shapely

        (x, y), (a, b) = self.at, (self.size[0] / 2 + more, self.size[1] / 2 + more)
        return shapely.Point(x, y).buffer(a, 32) if self.is_round else shapely.box(x - a, y - b, x + a, y + b)


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the board.

    Attributes
    ----------
    reference, value, package : name on the board, what it is, and its outline in KiCad's libraries.
    at, angle : origin and turn of that outline, degrees counter-clockwise.
    below : whether it stands on the lower face.
    pads : at their places on the board.
    body : corners of least and largest x and y, and height over the board.
    order : what to order.
    """

    reference: str
    value: str
    package: str
    at: Point
    angle: float
    below: bool
    pads: tuple[Pad, ...]
    body: tuple[float, float, float, float, float]
    order: str = ""

    @property
    def courtyard(self) -> Polygon:
        import shapely

        return shapely.union_all([shapely.box(*self.body[:4]), *(pad.shape() for pad in self.pads)]).envelope.buffer(
            COURT, join_style="mitre"
        )

    @property
    def through(self) -> bool:
        """Whether it has leads in holes."""
        return any(pad.drill for pad in self.pads)


@dataclass(frozen=True, slots=True)
class Track:
    """A track on the upper or lower face along points."""

    net: str
    below: bool
    points: tuple[Point, ...]
    width: float = TRACK


@dataclass(frozen=True, slots=True)
class Via:
    """A plated hole that joins the faces."""

    net: str
    at: Point


@dataclass(frozen=True, slots=True)
class Terminal:
    """What a net must reach: a place on the upper face, the lower one, or both as a plated hole."""

    net: str
    at: Point
    faces: tuple[bool, bool] = (True, True)


@dataclass(frozen=True, slots=True)
class Edge:
    """A part of the outline: a line from start to end, or an arc through `middle`."""

    start: Point
    end: Point
    middle: Point | None = None


@dataclass(frozen=True, slots=True)
class Board:
    """A circuit board, see the module.

    Attributes
    ----------
    outline, area : edge of the board, and the same as a polygon.
    holes : for screws, x, y and diameter.
    pockets : x and y of the corners of the hollows in the base above the Hall parts.
    ink : lines of the silkscreen on the upper face.
    pours : the ground of the upper and of the lower face.
    labels : of the header's pins, in order.
    addresses : of the chips on their buses, in order.
    channels : of the switch between the buses, for each chip; none of chips on one bus.
    warnings : what is assumed.
    """

    thickness: float
    outline: tuple[Edge, ...]
    area: Polygon
    holes: tuple[tuple[float, float, float], ...]
    pockets: tuple[tuple[float, float, float, float], ...]
    parts: tuple[Part, ...]
    tracks: tuple[Track, ...]
    vias: tuple[Via, ...]
    labels: tuple[str, ...]
    addresses: tuple[str, ...] = ()
    channels: tuple[int, ...] = ()
    supply: tuple[float, float] = (0.0, 0.0)
    ink: tuple[tuple[Point, ...], ...] = ()
    pours: tuple[tuple[Polygon, ...], tuple[Polygon, ...]] = ((), ())
    warnings: tuple[str, ...] = ()

    @property
    def nets(self) -> list[str]:
        """Names of the nets, ground first."""
        named = {pad.net for part in self.parts for pad in part.pads} - {"", "GND"}
        return ["GND", *sorted(named)]


class NoRoom(BadInput):
    """A board whose tracks or parts break a rule."""


# Rules


@dataclass(frozen=True, slots=True)
class Copper:
    """A piece of copper: its net, what it is, on which faces (above, below), and its shape."""

    net: str
    name: str
    faces: tuple[bool, bool]
    shape: Polygon


def copper(made: Board) -> list[Copper]:
    """Return all copper but the ground."""
    import shapely

    pieces = []
    for part in made.parts:
        for pad in part.pads:
            faces = (True, True) if pad.drill else (not part.below, part.below)
            name = f"{part.reference} pin {pad.number}"
            pieces.append(Copper(pad.net or name, name, faces, pad.shape()))
    for track in made.tracks:
        shape = shapely.LineString(track.points).buffer(track.width / 2, 16)
        pieces.append(Copper(track.net, f"track {track.net}", (not track.below, track.below), shape))
    for via in made.vias:
        pieces.append(Copper(via.net, f"via {via.net}", (True, True), shapely.Point(via.at).buffer(VIA / 2, 32)))
    return pieces


def check_rules(made: Board) -> None:
    """Raise NoRoom with the first rule that is broken: gaps of copper, edge and holes, courtyards."""
    import shapely

    inside = made.area.buffer(-EDGE, join_style="mitre")
    pieces = copper(made)
    holes = [(f"screw hole at {x:.3g}, {y:.3g}", shapely.Point(x, y).buffer(d / 2, 32)) for x, y, d in made.holes]
    for piece in pieces:
        if not inside.buffer(1e-6).covers(piece.shape):
            raise NoRoom(f"{piece.name} would be nearer than {EDGE:g} mm to the edge of the board")
        for name, hole in holes:
            if piece.shape.distance(hole) < HOLE_GAP - 1e-6:
                raise NoRoom(f"{piece.name} would be nearer than {HOLE_GAP:g} mm to the {name}")
    tree = shapely.STRtree([piece.shape for piece in pieces])
    near = tree.query([piece.shape for piece in pieces], "dwithin", CLEARANCE)
    for one, other in ((pieces[i], pieces[j]) for i, j in near.T.tolist() if i < j):
        if one.net != other.net and any(a and b for a, b in zip(one.faces, other.faces, strict=True)):
            gap = one.shape.distance(other.shape)
            if gap < CLEARANCE - 1e-4:
                raise NoRoom(f"{one.name} and {other.name} would be {gap:.2g} mm apart, less than {CLEARANCE:g} mm")
    for part, beside in itertools.combinations(made.parts, 2):
        if part.below == beside.below and part.courtyard.intersection(beside.courtyard).area > 1e-6:
            raise NoRoom(f"{part.reference} and {beside.reference} would overlap")


# Ground


def pour(made: Board, *, below: bool) -> tuple[Polygon, ...]:
    """Return the ground of a face: what other nets leave, joined to its pads by spokes, without loose islands."""
    import shapely

    mine = [piece for piece in copper(made) if piece.faces[below]]
    free = made.area.buffer(-EDGE - 1e-3, join_style="mitre")
    free -= shapely.union_all([shapely.Point(x, y).buffer(d / 2 + HOLE_GAP + 0.05, 32) for x, y, d in made.holes])
    free -= shapely.union_all([piece.shape.buffer(POUR_GAP + ROUND, 16) for piece in mine if piece.net != "GND"])
    pads = [
        pad for part in made.parts for pad in part.pads if pad.net == "GND" and (pad.drill or part.below == below)
    ]
    relief = shapely.union_all([pad.shape(POUR_GAP) for pad in pads])
    spokes = shapely.union_all([spoke for pad in pads for spoke in _spokes(pad)])
    # an opening removes what is thinner than a maker can etch
    poured = (free - relief).buffer(-SLIVER / 2).buffer(SLIVER / 2 - 1e-4, 8)
    poured = (poured | (spokes & free.buffer(-SLIVER / 2).buffer(SLIVER / 2))).simplify(1e-3)
    ground = shapely.union_all([piece.shape for piece in mine if piece.net == "GND"])
    pieces = list(poured.geoms) if poured.geom_type == "MultiPolygon" else [poured]
    return tuple(piece for piece in pieces if piece.intersects(ground))


def _spokes(pad: Pad) -> list[Polygon]:
    import shapely

    (x, y), (a, b), wide = pad.at, (pad.size[0] / 2 + 2 * POUR_GAP, pad.size[1] / 2 + 2 * POUR_GAP), SPOKE / 2
    return [
        shapely.box(x - a, y - wide, x + a, y + wide),
        shapely.box(x - wide, y - b, x + wide, y + b),
    ]


def check_joined(made: Board) -> None:
    """Raise NoRoom if a net is not one piece of copper."""
    for net in made.nets:
        if len(pieces := _joined(made, net)) > 1:
            raise NoRoom(f"{pieces[1][0].name} would not be joined to the net {net}")


def _joined(made: Board, net: str) -> list[list[Copper]]:
    """Return the copper of a net as lists of what is joined."""
    pours = [
        Copper("GND", "ground", (not below, below), shape) for below in (False, True) for shape in made.pours[below]
    ]
    left, found = [piece for piece in (*copper(made), *pours) if piece.net == net], list[list[Copper]]()
    while left:
        reached, left = [left[0]], left[1:]
        for one in reached:
            near = [piece for piece in left if _touch(one, piece)]
            reached += near
            left = [piece for piece in left if piece not in near]
        found.append(reached)
    return found


def stitched(made: Board) -> Board:
    """Return a board whose pieces of ground are joined by vias, where ground of the other face has room for one."""
    import shapely

    while len(pieces := _joined(made, "GND")) > 1:
        room = _room_for_via(made, [piece.shape for piece in pieces[1] if piece.name == "ground"])
        if room.is_empty:
            break
        x, y = shapely.get_coordinates(shapely.shortest_line(room, pieces[1][0].shape))[0].tolist()
        made = dataclasses.replace(made, vias=(*made.vias, Via("GND", (x, y))))
    return made


def pin_names(made: Board) -> list[Polygon]:
    """Return where the names of the header's pins are printed, which no via may take."""
    import shapely

    return [shapely.box(x - 1.0, y, x + 1.0, y + 4.5) for x, y in (pad.at for pad in made.parts[-1].pads)]


def _room_for_via(made: Board, ground: list[Polygon]) -> Polygon:
    """Return where a via joins this ground to other ground of the opposite face."""
    import shapely

    within = -VIA / 2 - SLIVER / 4
    (mine, rest), (mine_below, rest_below) = (
        [
            shapely.union_all([each.buffer(within) for each in pour if (each in ground) == own])
            for own in (True, False)
        ]
        for pour in made.pours
    )
    drills = [(pad.at, pad.drill) for part in made.parts for pad in part.pads if pad.drill]
    drills += [(via.at, DRILL) for via in made.vias]
    # solder would run into a via in a pad
    shut = [pad.shape(VIA / 2) for part in made.parts for pad in part.pads] + pin_names(made)
    shut += [shapely.Point(at).buffer((d + DRILL) / 2 + HOLES_APART + 1e-3) for at, d in drills]
    return ((mine & rest_below) | (rest & mine_below)) - shapely.union_all(shut)


def _touch(one: Copper, other: Copper) -> bool:
    return any(a and b for a, b in zip(one.faces, other.faces, strict=True)) and one.shape.intersects(other.shape)


# Silkscreen


def ink(made: Board) -> Iterator[tuple[Point, ...]]:
    """Yield the lines of the silkscreen: axes, names of the parts, pin 1 and the header's pins, clear of all pads."""
    import shapely

    upper = [part for part in made.parts if not part.below]
    taken = shapely.union_all(
        [
            *(
                pad.shape(MASK + SCREEN_GAP)
                for part in made.parts
                for pad in part.pads
                if pad.drill or not part.below
            ),
            *(shapely.Point(x, y).buffer(d / 2 + SCREEN_GAP) for x, y, d in made.holes),
            *(shapely.Point(via.at).buffer(DRILL / 2) for via in made.vias),
        ]
    )
    inside = made.area.buffer(-SCREEN_GAP)
    header, groups = made.parts[-1], []
    size = min(LETTER, 0.65 * (header.pads[1].at[0] - header.pads[0].at[0]))
    for pad, label in zip(header.pads, made.labels, strict=True):
        start = pad.at[0], pad.at[1] + pad.size[1] / 2 + 2 * SCREEN_GAP
        groups.append([letters(label, start, size, upright=True)])
    for part in upper[:-1]:
        groups.append([_triangle(at) for at in _around(part.pads[0].shape().bounds, 0.55)])
    for part in upper[:-1]:
        groups.append(
            [
                letters(part.reference, at)
                for at in _around(shapely.union_all([pad.shape() for pad in part.pads]).bounds, LETTER)
            ]
        )
    left, low, right, high = made.area.bounds
    steps = np.linspace(0.04, 0.96, 24)
    grid = [(left + float(u) * (right - left), low + float(v) * (high - low)) for v in steps[::-1] for u in steps]
    groups.append([_axes(at) for at in grid])
    for choices in groups:
        for lines in choices:
            shape = shapely.MultiLineString(lines).buffer(PEN / 2)
            if inside.covers(shape) and not shape.intersects(taken):
                yield from lines
                taken |= shape.buffer(PEN)
                break


def _around(bounds: tuple[float, float, float, float], gap: float) -> list[Point]:
    """Return places around a box: beside it, above and below it, and at its corners."""
    (a, b, c, d), u, v = bounds, (bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2
    beside = [(a - gap, v), (c + gap, v), (u, d + gap), (u, b - gap)]
    return beside + [(x, y) for x in (a - gap, c + gap) for y in (b - gap, d + gap)]


def _triangle(at: Point) -> list[tuple[Point, ...]]:
    x, y = at
    corners = [(x + 0.2 * math.cos(turn), y + 0.2 * math.sin(turn)) for turn in (0, 2.1, 4.2)]
    return [(*corners, corners[0])]


def _axes(at: Point) -> list[tuple[Point, ...]]:
    """Return arrows along x and y from a point, with their names."""
    x, y = at
    long, wing = 1.8, 0.3
    return [
        ((x, y + long), (x, y), (x + long, y)),
        ((x + long - wing, y + wing), (x + long, y), (x + long - wing, y - wing)),
        ((x - wing, y + long - wing), (x, y + long), (x + wing, y + long - wing)),
        *letters("x", (x + long - 0.2, y + 0.9)),
        *letters("y", (x + 0.9, y + long - 0.2)),
    ]


def letters(text: str, at: Point, size: float = LETTER, *, upright: bool = False) -> list[tuple[Point, ...]]:
    """Return the strokes of a text about a point, or of one that is read from below, with its start there."""
    strokes = [[(size * x, -size * y) for x, y in stroke] for stroke in _font().render(text)]
    xs, ys = zip(*(point for stroke in strokes for point in stroke), strict=True)
    u, v = min(xs) if upright else (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    moved = [[(x - u, y - v) for x, y in stroke] for stroke in strokes]
    if upright:
        moved = [[(-y, x) for x, y in stroke] for stroke in moved]
    return [tuple((at[0] + x, at[1] + y) for x, y in stroke) for stroke in moved]


@functools.cache
def _font() -> Any:
    from gerbonara.newstroke import Newstroke

    class Latin(Newstroke):  # type: ignore[misc]
        """The letters of ASCII; to read all 65 000 takes a second."""

        def load_font(self, text: bytes) -> Iterator[Any]:
            return itertools.islice(super().load_font(text), 96)

    return Latin()
