"""The circuit board under the base: parts, tracks and ground of a design's Hall parts at their exact places.

All lengths are mm in the sensor's frame, seen from above: x to the right, y upwards, the origin on the beam's axis.
The upper face of the board is glued to the base, so that only the Hall parts stand on it; capacitors and resistors
are on its lower face, and the header on a tab beside the base.

Chips share one I2C bus. Two short tracks lead SDA and SCL of each under its body, and one its supply outwards, to
vias; from there each net runs along x on the lower face to a column on the upper face, which leads along y to the
header. Three one-axis elements have one column each, and their supply is on the lower face. What remains of both
faces is ground. Every board is measured by the rules below, and one that breaks them is refused.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry import base
from geometry.base import Base, Plan
from geometry.design import BadInput, Design
from geometry.fabrication import board_drawing, hall_elements
from geometry.fabrication.hall_elements import SS495A
from studies.parts import catalogues

if TYPE_CHECKING:
    from shapely import Polygon

Point = tuple[float, float]

THICKNESSES = (0.8, 1.6)
"""Thicknesses of the board to choose from."""
TRACK, CLEARANCE, VIA, DRILL = 0.2, 0.15, 0.5, 0.3
"""Width of a track, gap between nets, and diameters of a via and of its hole: what low-cost makers offer."""
EDGE, HOLE_GAP = 0.3, 0.25
"""Gaps between copper and the board's edge, and between copper and a hole for a screw."""
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
BUS, RISE = 0.3, 0.45
"""Distance of SDA and SCL from the middle of a chip, and of its supply's via from the pads."""
COLUMN = 0.5
"""Distance between neighbouring columns of the bus."""
LEVEL = 0.4
"""Distance between neighbouring tracks on the tab."""
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
    addresses : of the chips on the bus, in order.
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


# Circuits of Hall parts


@dataclass(frozen=True, slots=True, kw_only=True)
class Circuit:
    """How a Hall part is wired: a table of `studies/parts/circuits.toml`, which says what its fields are."""

    package: str
    pins: tuple[str, ...]
    orders: tuple[str, ...]
    supply: tuple[float, float]
    source: str
    assumed: tuple[str, ...]
    turn: float = 0.0
    addresses: tuple[str, ...] = ()
    addressed_by: str = "order"
    remedy: str = ""


def circuits() -> dict[str, Circuit]:
    """Return the circuits by the name of their layout."""
    file = Path(__file__).parents[1] / "parts" / "circuits.toml"
    tables: dict[str, dict[str, Any]] = tomllib.loads(file.read_text("utf-8"))
    return {layout: _circuit(table) for layout, table in tables.items()}


def _circuit(table: dict[str, Any]) -> Circuit:
    values: dict[str, Any] = {key: tuple(one) if isinstance(one, list) else one for key, one in table.items()}
    return Circuit(**values)


def circuit_of(design: Design) -> Circuit:
    """Return the circuit of a design's Hall parts; BadInput where there is none, or chips cannot share a bus."""
    known, layout, count = circuits(), design.hall_layout, int(design.chip_count)
    if layout not in known or (layout != "three" and design.chip.pads is None):
        raise BadInput(
            f"no footprint of {layout} is known: set hall_layout to one of {', '.join(known)}, or draw the board by "
            "the base's board.dxf (magtip cad)"
        )
    circuit = known[layout]
    if layout != "three" and count > len(circuit.addresses):
        raise BadInput(
            f"{count} chips {layout} cannot share a bus, as they have {len(circuit.addresses)} addresses, "
            f"{', '.join(circuit.addresses)}: {circuit.remedy or 'set a smaller chip_count'}"
        )
    return circuit


# The board


FARTHER = 40
"""Number of steps of 0.1 mm by which chips are moved outwards to find the least place with room."""


def plan_and_board(design: Design, choices: Base, process: str, thickness: float = 1.6) -> tuple[Plan, Board]:
    """Return the plan of a design's base and its board; BadInput as `board`, with a remedy where there is no room."""
    if choices.breakout:
        raise BadInput(f"breakout {choices.breakout} is the board: leave it out, or make the base by magtip cad")
    plan = base.plan(design, choices, process)
    try:
        return plan, board(design, plan, thickness)
    except NoRoom as error:
        several = design.hall_layout != "three" and design.chip_count > 1
        remedy = "a larger f, or " if design.hall_layout == "three" else ""
        remedy = _farther(design, choices, process) if several else remedy
        raise BadInput(f"{error}: set {remedy}a larger base (--base outer=...)") from None


def _farther(design: Design, choices: Base, process: str) -> str:
    """Return the least chip_x with room for the tracks, as words of a remedy; "" if none is near."""
    for k in range(1, FARTHER):
        x = math.copysign(round(abs(design.chip_x) + k / 10, 1), design.chip_x)
        wider = dataclasses.replace(design, chip_x=x)
        with contextlib.suppress(BadInput):
            wired(wider, base.plan(wider, choices, process))
            return f"chip_x to {x:g} mm or more, or "
    return ""


def board(design: Design, plan: Plan, thickness: float = 1.6) -> Board:
    """Return the board of a design, for the plan of its base.

    thickness : 0.8 or 1.6 mm.

    Raises
    ------
    BadInput
        The thickness, a missing footprint or address, or too little room for parts or tracks.
    """
    if thickness not in THICKNESSES:
        allowed = " or ".join(f"{each:g}" for each in THICKNESSES)
        raise BadInput(f"thickness of the board must be {allowed} mm; got {thickness:g} mm")
    made = wired(design, plan, thickness)
    made = dataclasses.replace(made, pours=(_pour(made, below=False), _pour(made, below=True)))
    _check_joined(made)
    return dataclasses.replace(made, ink=tuple(_ink(made)))


def wired(design: Design, plan: Plan, thickness: float = 1.6) -> Board:
    """Return the board without ground and silkscreen; BadInput as `board`."""
    circuit = circuit_of(design)
    made = _analogue(design, plan, circuit) if design.hall_layout == "three" else _digital(design, plan, circuit)
    return dataclasses.replace(made, thickness=thickness, warnings=tuple(_warnings(design, circuit)))


def _warnings(design: Design, circuit: Circuit) -> Iterator[str]:
    name = "the one-axis elements" if design.hall_layout == "three" else design.chip.name
    if circuit.assumed:
        yield f"{', '.join(circuit.assumed)} of {name} are assumed: compare them with the data sheet before you order"
    if design.hall_layout == "three":
        yield "width of the elements and depth of their Hall plates are assumed: measure your parts"
        return
    named = {"plate_at": "place of the sensitive volume", "plate": "its height", "pads": "pads"}
    if assumed := [words for key, words in named.items() if key in design.chip.assumed]:
        yield (
            f"{', '.join(assumed)} of {name} are assumed: compare them with the data sheet; a reading is that of "
            "another place by as much, until the made sensor is calibrated"
        )


def _drawn(plan: Plan, header: Header, parts: Sequence[Part], **more: Any) -> Board:
    """Return the board with its outline, holes and header, without ground and silkscreen; rules are checked."""
    edges, area = _outline(plan, header)
    holes = tuple((x, y, plan.screw) for x, y in plan.screws)
    pockets = tuple(
        (b.corner[0], b.corner[1], b.corner[0] + b.sides[0], b.corner[1] + b.sides[1])
        for group in (plan.seats.bodies, plan.seats.passages)
        for b in group.values()
    )
    made = Board(
        thickness=0.0,
        outline=edges,
        area=area,
        holes=holes,
        pockets=pockets,
        parts=(*parts, header.part()),
        labels=header.nets,
        **more,
    )
    check_rules(made)
    return made


# Header and outline


@dataclass(frozen=True, slots=True)
class Header:
    """A row of pins along x on the tab, whose outer edge is at y = low; the base ends at y = high."""

    nets: tuple[str, ...]
    pitch: float
    middle: float
    high: float
    low: float

    @property
    def pad(self) -> tuple[float, float]:
        """Diameters of pad and hole, common values for pins of 0.64 and 0.4 mm."""
        return (1.7, 1.0) if self.pitch > 2 else (0.95, 0.65)

    @property
    def width(self) -> float:
        return tab_width(len(self.nets), self.pitch)

    @property
    def y(self) -> float:
        """Of the pins."""
        return self.low + self.pad[0] / 2 + 2 * EDGE

    def x(self, net: str) -> float:
        """Return the place of a net's pin."""
        return self.middle + (self.nets.index(net) - (len(self.nets) - 1) / 2) * self.pitch

    def part(self) -> Part:
        size, drill = self.pad
        pads = tuple(
            Pad(str(k), net, (self.x(net), self.y), (size, size), drill, is_round=k > 1)
            for k, net in enumerate(self.nets, 1)
        )
        (first, y), half = pads[0].at, self.pitch / 2
        body = (first - half, y - half, pads[-1].at[0] + half, y + half, 8.5)
        name = f"PinHeader_1x{len(pads):02d}_P{self.pitch:.2f}mm_Vertical"
        value = f"pin header 1x{len(pads)}, {self.pitch:g} mm"
        return Part("J1", value, name, pads[0].at, 90.0, False, pads, body, value)


def tab_width(pins: int, pitch: float) -> float:
    """Return the width of a tab for so many pins, mm."""
    return (pins - 1) * pitch + 1.7 + 2 * EDGE


TAB = 6.0
"""Length of the tab: pins, resistors and tracks."""


def _header(plan: Plan, nets: Sequence[str], aim: float) -> Header:
    """Return the header nearest to x = aim, of the coarsest pitch that fits."""
    room = 2 * plan.half * (0.9 if plan.is_round else 1.0) - 2 * EDGE
    for pitch in (2.54, 1.27):
        if (wide := tab_width(len(nets), pitch)) <= room:
            most = (room - wide) / 2
            # a straight edge is at y = -half; the tab of a round board begins where the circle has its width
            return Header(tuple(nets), pitch, min(max(aim, -most), most), -plan.half, -plan.half - TAB)
    raise NoRoom(
        f"a base of {2 * plan.half:.3g} mm is too narrow for a header of {len(nets)} pins, which needs "
        f"{tab_width(len(nets), 1.27) + 2 * EDGE:.3g} mm"
    )


def _outline(plan: Plan, header: Header) -> tuple[tuple[Edge, ...], Polygon]:
    import shapely

    h, low = plan.half, header.low
    left, right = header.middle - header.width / 2, header.middle + header.width / 2
    if plan.is_round:
        ends = [(x, -math.sqrt(h * h - x * x)) for x in (right, left)]
        first, last = (math.atan2(y, x) for x, y in ends)
        turn = (last - first) % (2 * math.pi)
        arc = [(h * math.cos(first + turn * k / 512), h * math.sin(first + turn * k / 512)) for k in range(513)]
        corners = [ends[1], (left, low), (right, low), ends[0]]
        lines = [Edge(a, b) for a, b in itertools.pairwise(corners)]
        return (*lines, Edge(ends[0], ends[1], arc[256])), shapely.Polygon([*corners[:-1], *arc[:-1]])
    corners = [(left, -h), (left, low), (right, low), (right, -h), (h, -h), (h, h), (-h, h), (-h, -h)]
    return tuple(Edge(a, b) for a, b in itertools.pairwise([*corners, corners[0]])), shapely.Polygon(corners)


def _to_header(header: Header, columns: dict[str, Point]) -> list[Track]:
    """Return tracks on the upper face from the lower ends of columns, in the order of the pins, to the pins.

    Those that go left turn one below the other from the left, those that go right from the right, so that none cross.
    """
    order = sorted(columns, key=lambda net: columns[net][0])
    left = [net for net in order if header.x(net) < columns[net][0]]
    right = [net for net in reversed(order) if header.x(net) > columns[net][0]]
    level = {net: k for group in (left, right) for k, net in enumerate(group)}
    tracks = []
    for net, (x, y) in columns.items():
        turn, pin = header.high - EDGE - LEVEL * level.get(net, 0), header.x(net)
        tracks.append(Track(net, False, ((x, y), (x, turn), (pin, turn), (pin, header.y))))
    return tracks


def _passive(reference: str, value: str, nets: tuple[str, str], at: Point, upright: bool = False) -> Part:
    """Return a capacitor or resistor of size 0603 on the lower face: first pad at the greater x, or the greater y."""
    x, y = at
    size = (0.95, 0.8) if upright else (0.8, 0.95)
    ends = [(x, y + s * 0.775) if upright else (x + s * 0.775, y) for s in (1, -1)]
    pads = tuple(Pad(str(k), net, end, size) for k, (net, end) in enumerate(zip(nets, ends, strict=True), 1))
    a, b = (0.4, 0.8) if upright else (0.8, 0.4)
    package = f"{reference[0]}_0603_1608Metric"
    body = (x - a, y - b, x + a, y + b, 0.9)
    return Part(reference, value, package, at, 90.0 if upright else 0.0, True, pads, body, f"{value}, 0603")


CAPACITOR, PULL_UP = "100 nF 16 V X7R", "4.7 kOhm"


# Three one-axis elements


def _analogue(design: Design, plan: Plan, circuit: Circuit) -> Board:
    fitting = [part.name for part in catalogues.shipped_parts()[1] if part.is_of(design)]
    order = " or ".join(fitting) or circuit.orders[0]
    at = board_drawing.pads(design)
    # pins from the left on the marked face, leads down: of S1 and S2 from +y to -y, of S3 from -x to +x
    places = {"S1": at[2::-1], "S2": at[5:2:-1], "S3": at[6:9]}
    p, bodies = SS495A, {}
    bend, middle = at[0][0], at[3][0]
    half = p.thickness / 2
    bodies["S1"] = (-p.height / 2, -p.width / 2, p.height / 2, p.width / 2)
    bodies["S2"] = (middle - half, -p.width / 2, middle + half, p.width / 2)
    bodies["S3"] = (-p.width / 2, middle - half, p.width / 2, middle + half)
    elements = []
    for name, row in places.items():
        nets = [name if net == "OUT" else net for net in circuit.pins]
        pads = tuple(
            Pad(str(k), net, xy, (1.0, 1.0), 0.7, is_round=k > 1)
            for k, (net, xy) in enumerate(zip(nets, row, strict=True), 1)
        )
        turn = 0.0 if name == "S3" else 270.0
        elements.append(
            Part(name, order, circuit.package, row[0], turn, False, pads, (*bodies[name], plan.thickness), order)
        )
    header = _header(plan, ("VDD", "GND", "S1", "S3", "S2"), 0.0)
    (left, _), y = places["S1"][0], p.pitch
    column = -p.pitch
    supply = [
        Track("VDD", True, ((left, y), (middle, y))),
        Track("VDD", True, (places["S3"][0], (column, header.high - EDGE))),
        Track("VDD", True, ((column, header.high - EDGE), (header.x("VDD"), header.high - EDGE))),
        Track("VDD", True, ((header.x("VDD"), header.high - EDGE), (header.x("VDD"), header.y))),
    ]
    caps = [
        _passive("C1", CAPACITOR, ("VDD", "GND"), (bend + 1.3, y - 0.775), upright=True),
        _passive("C2", CAPACITOR, ("VDD", "GND"), (middle - 1.6, y - 0.775), upright=True),
    ]
    # the columns keep clear of the screws at the corners
    lanes = {"S1": -2 * p.pitch, "S3": p.pitch, "S2": 2 * p.pitch}
    ends = {name: (lanes[name], header.high) for name in lanes}
    (x1, y1), (x2, y2) = places["S1"][2], places["S2"][2]
    down = y1 - 1.0
    outputs = [
        Track("S1", False, ((x1, y1), (x1, down), (lanes["S1"], down), ends["S1"])),
        Track("S2", False, ((x2, y2), (x2, down), (lanes["S2"], down), ends["S2"])),
        Track("S3", False, (places["S3"][2], ends["S3"])),
    ]
    tracks = (*supply, *outputs, *_to_header(header, ends))
    # that of S3 is on the supply's column, below S3 or, where S1's capacitor is too near, below that
    for place in (middle - 1.6, -1.8):
        third = _passive("C3", CAPACITOR, ("GND", "VDD"), (column + 0.775, place))
        try:
            return _drawn(plan, header, [*elements, *caps, third], tracks=tracks, vias=(), supply=circuit.supply)
        except NoRoom as error:
            broken = error
    raise broken


# Chips on one bus


def _digital(design: Design, plan: Plan, circuit: Circuit) -> Board:
    """Return the board of chips; the bus takes the first gap between or beside them in which no rule is broken."""
    chip, count = design.chip, int(design.chip_count)
    assert chip.pads is not None
    half = (chip.pads.pins - 1) / 2 * chip.pads.pitch + chip.pads.width / 2
    across = sorted({x for x, _ in hall_elements.chip_centres(design).values()})
    # of two supplies, that of the chip on the left is the left column
    first, *others = reversed(dict.fromkeys(names := _supplies(circuit, count)))
    nets = [first, "SDA", "SCL", *others]
    room = half + CLEARANCE + VIA / 2 + (len(nets) - 1) * COLUMN / 2
    lanes = [(a + b) / 2 for a, b in itertools.pairwise(across)] + [across[-1] + room, across[0] - room]
    broken: list[NoRoom] = []
    for lane in sorted(lanes, key=lambda x: (x in lanes[-2:], abs(x))):
        try:
            return _bus(design, plan, circuit, names, nets, lane)
        except NoRoom as error:
            broken.append(error)
    raise broken[0]


def _supplies(circuit: Circuit, count: int) -> list[str]:
    """Return the supply of each chip: one for all, unless the address is what SDA shows when the supply rises."""
    if circuit.addressed_by == "supply" and count > 1:
        return [f"VDD{k}" for k in range(1, count + 1)]
    return ["VDD"] * count


def _bus(
    design: Design, plan: Plan, circuit: Circuit, names: Sequence[str], nets: Sequence[str], lane: float
) -> Board:
    chip = design.chip
    assert chip.pads is not None
    p, outer = chip.pads, chip.pads.rows / 2 + chip.pads.length / 2
    columns = {net: lane + (k - (len(nets) - 1) / 2) * COLUMN for k, net in enumerate(nets)}
    header = _header(plan, ("GND", *nets), lane - 1.27)
    parts: list[Part] = []
    tracks: list[Track] = []
    vias: list[Via] = []
    top = dict.fromkeys(nets, -math.inf)
    pads = board_drawing.pads(design)
    for k, (name, (x, y)) in enumerate(hall_elements.chip_centres(design).items()):
        low, high = (
            pads[2 * p.pins * k : 2 * p.pins * k + p.pins],
            pads[2 * p.pins * k + p.pins : 2 * p.pins * (k + 1)],
        )
        pins = [names[k] if net == "VDD" else net for net in circuit.pins]
        own = tuple(
            Pad(str(number), net, at, (p.width, p.length))
            for number, (net, at) in enumerate(zip(pins, [*low, *reversed(high)], strict=True), 1)
        )
        a, b, tall = chip.body
        body = (x - a / 2, y - b / 2, x + a / 2, y + b / 2, tall)
        parts.append(
            Part(f"U{k + 1}", name, circuit.package, (x, y), circuit.turn, False, own, body, circuit.orders[k])
        )
        where = {pad.net: pad.at for pad in own}
        ends = {
            "SDA": (where["SDA"][0], y + BUS),
            "SCL": (where["SCL"][0] + p.pitch / 2, y - BUS),
            names[k]: (where[names[k]][0], y + outer + RISE),
        }
        for net, end in ends.items():
            start, column = where[net], (columns[net], end[1])
            knee = (start[0], end[1] - abs(end[0] - start[0]))
            tracks.append(Track(net, False, (start, knee, end)))
            tracks.append(Track(net, True, (end, column)))
            vias += [Via(net, end), Via(net, column)]
            top[net] = max(top[net], end[1])
        # the capacitor lies below the via of the supply
        supply = ends[names[k]]
        cap = (supply[0] - 0.775, supply[1] - VIA / 2 - 0.1 - 0.475)
        parts.append(_passive(f"C{k + 1}", CAPACITOR, (names[k], "GND"), cap))
        tracks.append(Track(names[k], True, (supply, (supply[0], cap[1]))))
        beyond = (where["SDA"][0] - p.width / 2 - CLEARANCE - VIA / 2 - 0.05, cap[1])
        # a bus on the left takes that place, and leaves the one under the body
        ground = (x + p.pitch / 2, y) if lane < x else beyond
        tracks.append(Track("GND", True, ((cap[0] - 0.775, cap[1]), ground)))
        vias.append(Via("GND", ground))
    ends = {net: (columns[net], header.high) for net in nets}
    tracks += [Track(net, False, ((columns[net], top[net]), ends[net])) for net in nets]
    tracks += _to_header(header, ends)
    pull = _pull_ups(header, nets[0])
    return _drawn(
        plan,
        header,
        [*parts, *pull[0]],
        tracks=(*tracks, *pull[1]),
        vias=tuple(dict.fromkeys(vias)),
        addresses=circuit.addresses[: len(names)],
        supply=circuit.supply,
    )


def _pull_ups(header: Header, supply: str) -> tuple[list[Part], list[Track]]:
    """Return the two resistors of the bus on the lower face of the tab, and their tracks."""
    y = header.y + header.pad[0] / 2 + CLEARANCE + 1.4
    aside = max(0.0, (1.6 - header.pitch) / 2)
    parts, tracks = [], []
    for k, (net, side) in enumerate((("SDA", -1), ("SCL", 1)), 1):
        x, pin = header.x(net) + side * aside, (header.x(net), header.y)
        parts.append(_passive(f"R{k}", PULL_UP, (supply, net), (x, y), upright=True))
        tracks.append(Track(net, True, (pin, (pin[0], y - 0.775 - aside), (x, y - 0.775))))
        tracks.append(Track(supply, True, ((header.x(supply), y + 0.775), (x, y + 0.775))))
    start = header.x(supply)
    return parts, [*tracks, Track(supply, True, ((start, header.y), (start, y + 0.775)))]


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
    for one, other in itertools.combinations(pieces, 2):
        if one.net != other.net and any(a and b for a, b in zip(one.faces, other.faces, strict=True)):
            gap = one.shape.distance(other.shape)
            if gap < CLEARANCE - 1e-4:
                raise NoRoom(f"{one.name} and {other.name} would be {gap:.2g} mm apart, less than {CLEARANCE:g} mm")
    for part, beside in itertools.combinations(made.parts, 2):
        if part.below == beside.below and part.courtyard.intersection(beside.courtyard).area > 1e-6:
            raise NoRoom(f"{part.reference} and {beside.reference} would overlap")


# Ground


def _pour(made: Board, *, below: bool) -> tuple[Polygon, ...]:
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


def _check_joined(made: Board) -> None:
    """Raise NoRoom if a net is not one piece of copper."""
    pours = [
        Copper("GND", "ground", (not below, below), shape) for below in (False, True) for shape in made.pours[below]
    ]
    for net in made.nets:
        pieces = [piece for piece in (*copper(made), *pours) if piece.net == net]
        reached, left = [pieces[0]], pieces[1:]
        for one in reached:
            near = [piece for piece in left if _touch(one, piece)]
            reached += near
            left = [piece for piece in left if piece not in near]
        if left:
            raise NoRoom(f"{left[0].name} would not be joined to the net {net}")


def _touch(one: Copper, other: Copper) -> bool:
    return any(a and b for a, b in zip(one.faces, other.faces, strict=True)) and one.shape.intersects(other.shape)


# Silkscreen


def _ink(made: Board) -> Iterator[tuple[Point, ...]]:
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
