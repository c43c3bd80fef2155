"""The circuit board under the base: parts, tracks and ground of a design's Hall parts at their exact places.

All lengths are mm in the sensor's frame, seen from above: x to the right, y upwards, the origin on the beam's axis.
The upper face of the board is glued to the base, so that only the Hall parts stand on it; capacitors and resistors
are on its lower face, and the header on a tab beside the base.

Chips share one I2C bus. Two short tracks lead SDA and SCL of each under its body, and one its supply outwards, to
vias; from there each net runs along x on the lower face to a column on the upper face, which leads along y to the
header. Three one-axis elements have one column each, and their supply is on the lower face. What remains of both
faces is ground.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry import base
from geometry.arrays import Point
from geometry.base import BOARDS, Base, Plan
from geometry.design import BadInput, Design
from geometry.fabrication import board_drawing, hall_elements
from geometry.fabrication.hall_elements import SS495A
from studies.fabrication import board_layers
from studies.fabrication.board_layers import CLEARANCE, EDGE, TRACK, VIA, Board, Edge, NoRoom, Pad, Part, Track, Via
from studies.parts import catalogues

if TYPE_CHECKING:
    from shapely import Polygon

    from geometry.hall_chips import Pads

BUS, RISE = 0.3, 0.45
"""Distance of SDA and SCL from the middle of a chip, and of its supply's via from the pads."""
COLUMN = 0.5
"""Distance between neighbouring columns of the bus."""
LEVEL = 0.4
"""Distance between neighbouring tracks on the tab."""


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
    """Return the circuit of a design's Hall parts; BadInput where there is none."""
    known, layout = circuits(), design.hall_layout
    if layout not in known or (layout != "three" and design.chip.pads is None):
        known_pads = layout != "three" and design.chip.pads is not None
        lacking = "circuit" if known_pads else "footprint"
        raise BadInput(
            f"no {lacking} of {layout} is known: set hall_layout to one of {', '.join(known)}, or draw the board by "
            "the base's board.dxf (magtip cad)"
        )
    return known[layout]


# The board


FARTHER, WIDER = 40, 12
"""Numbers of steps of 0.1 mm by which chips are moved outwards, and of 0.5 mm by which a base is made larger, to find
the least place with room."""


def plan_and_board(design: Design, choices: Base, process: str, thickness: float = BOARDS[0]) -> tuple[Plan, Board]:
    """Return the plan of a design's base and its board; BadInput as `board`, with a remedy where there is no room."""
    if choices.breakout:
        raise BadInput(f"breakout {choices.breakout} is the board: leave it out, or make the base by magtip cad")
    plan = base.plan(design, choices, process)
    try:
        return plan, board(design, plan, thickness)
    except NoRoom as error:
        remedies = list(_remedies(design, choices, process)) or ["a larger base (--base outer=...)"]
        raise BadInput(f"{error}: set {', or '.join(remedies)}") from None


def _remedies(design: Design, choices: Base, process: str) -> Iterator[str]:
    """Yield the least chip_x and the least side or diameter of a base with room for the tracks, where one is near."""
    if design.hall_layout == "three":
        yield "a larger f"
    elif design.chip_count > 1:
        for k in range(1, FARTHER):
            x = math.copysign(round(abs(design.chip_x) + k / 10, 1), design.chip_x)
            if _has_room(dataclasses.replace(design, chip_x=x), choices, process):
                yield f"chip_x to {x:g} mm or more"
                break
    least = 2 * base.plan(design, choices, process).half
    for k in range(1, WIDER):
        outer = math.ceil(2 * least + k) / 2
        if _has_room(design, dataclasses.replace(choices, outer=outer), process):
            yield f"a larger base (--base outer={outer:g})"
            break


def _has_room(design: Design, choices: Base, process: str) -> bool:
    with contextlib.suppress(BadInput):
        wired(design, base.plan(design, choices, process))
        return True
    return False


def board(design: Design, plan: Plan, thickness: float = BOARDS[0]) -> Board:
    """Return the board of a design, for the plan of its base.

    thickness : 0.8 or 1.6 mm.

    Raises
    ------
    BadInput
        The thickness, a missing footprint or address, or too little room for parts or tracks.
    """
    check_thickness(thickness)
    return finished(wired(design, plan, thickness))


def check_thickness(thickness: float) -> None:
    if thickness not in BOARDS:
        allowed = " or ".join(f"{each:g}" for each in sorted(BOARDS))
        raise BadInput(f"thickness of the board must be {allowed} mm; got {thickness:g} mm")


def finished(made: Board) -> Board:
    """Return a wired board with its ground, all of whose nets are joined, and its silkscreen."""
    ground = board_layers.pour(made, below=False), board_layers.pour(made, below=True)
    made = board_layers.stitched(dataclasses.replace(made, pours=ground))
    board_layers.check_joined(made)
    return dataclasses.replace(made, ink=tuple(board_layers.ink(made)))


def wired(design: Design, plan: Plan, thickness: float = BOARDS[0]) -> Board:
    """Return the board without ground and silkscreen; BadInput as `board`."""
    circuit = circuit_of(design)
    made = _analogue(design, plan, circuit) if design.hall_layout == "three" else _digital(design, plan, circuit)
    return dataclasses.replace(made, thickness=thickness, warnings=tuple(assumptions(design, circuit)))


def assumptions(design: Design, circuit: Circuit) -> Iterator[str]:
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
    """Return the board of one beam, without ground and silkscreen; rules are checked."""
    made = unchecked(0.0, _outline(plan, header), plan, [(0.0, 0.0)], plan.screws, header, parts, **more)
    board_layers.check_rules(made)
    return made


def unchecked(
    thickness: float,
    outline: tuple[tuple[Edge, ...], Polygon],
    plan: Plan,
    beams: Sequence[Point],
    screws: Sequence[Point],
    header: Header,
    parts: Sequence[Part],
    **more: Any,
) -> Board:
    """Return a board under beams whose base has the pockets of a plan, with holes and header, not yet checked."""
    edges, area = outline
    pockets = tuple(
        (x + b.corner[0], y + b.corner[1], x + b.corner[0] + b.sides[0], y + b.corner[1] + b.sides[1])
        for x, y in beams
        for group in (plan.seats.bodies, plan.seats.passages)
        for b in group.values()
    )
    return Board(
        thickness=thickness,
        outline=edges,
        area=area,
        holes=tuple((x, y, plan.screw) for x, y in screws),
        pockets=pockets,
        parts=(*parts, header.part()),
        labels=header.nets,
        **more,
    )


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
    room = plan.widest_tab - 2 * EDGE
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
    return rectangle((-h, -h, h, h), (left, low, right))


def rectangle(
    box: tuple[float, float, float, float], tab: tuple[float, float, float]
) -> tuple[tuple[Edge, ...], Polygon]:
    """Return the outline of a rectangle, its least x and y and greatest x and y, with a tab: left, low and right."""
    import shapely

    (west, south, east, north), (left, low, right) = box, tab
    upper = [(east, south), (east, north), (west, north), (west, south)]
    corners = list(dict.fromkeys([(left, south), (left, low), (right, low), (right, south), *upper]))
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


def passive(reference: str, value: str, nets: tuple[str, str], at: Point, upright: bool = False) -> Part:
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
        passive("C1", CAPACITOR, ("VDD", "GND"), (bend + 1.3, y - 0.775), upright=True),
        passive("C2", CAPACITOR, ("VDD", "GND"), (middle - 1.6, y - 0.775), upright=True),
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
        third = passive("C3", CAPACITOR, ("GND", "VDD"), (column + 0.775, place))
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
    if count > (most := len(circuit.addresses)):
        raise BadInput(
            f"{count} chips {design.hall_layout} cannot share a bus, as they have {most} addresses, "
            f"{', '.join(circuit.addresses)}: {circuit.remedy or 'set a smaller chip_count'}"
        )
    half = chip.pads.size[0] / 2 + (CLEARANCE + VIA + 0.05 if chip.pads.centre else 0.0)
    across = sorted({x for x, _ in hall_elements.chip_centres(design).values()})
    # of two supplies, that of the chip on the left is the left column
    first, *others = reversed(dict.fromkeys(names := supplies(circuit, count)))
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


def supplies(circuit: Circuit, count: int) -> list[str]:
    """Return the supply of each chip: one for all, unless the address is what SDA shows when the supply rises."""
    if circuit.addressed_by == "supply" and count > 1:
        return [f"VDD{k}" for k in range(1, count + 1)]
    return ["VDD"] * count


def _bus(
    design: Design, plan: Plan, circuit: Circuit, names: Sequence[str], nets: Sequence[str], lane: float
) -> Board:
    pads = design.chip.pads
    assert pads is not None
    columns = {net: lane + (k - (len(nets) - 1) / 2) * COLUMN for k, net in enumerate(nets)}
    header = _header(plan, ("GND", *nets), lane - 1.27)
    parts: list[Part] = []
    tracks: list[Track] = []
    vias: list[Via] = []
    top = dict.fromkeys(nets, -math.inf)
    for k, (x, y) in enumerate(hall_elements.chip_centres(design).values()):
        part = chip_part(design, circuit, names[k], k, f"U{k + 1}", (x, y))
        wired = wired_chip(part, names[k], pads, lane)
        parts += [part, wired.capacitor]
        tracks += wired.tracks
        for net, end in wired.ends.items():
            column = columns[net], end[1]
            tracks.append(Track(net, True, (end, column)))
            vias += [Via(net, end), Via(net, column)]
            top[net] = max(top[net], end[1])
        vias += wired.vias
    ends = {net: (columns[net], header.high) for net in nets}
    tracks += [Track(net, False, ((columns[net], top[net]), ends[net])) for net in nets]
    tracks += _to_header(header, ends)
    pull = pull_ups(header, nets[0])
    return _drawn(
        plan,
        header,
        [*parts, *pull[0]],
        tracks=(*tracks, *pull[1]),
        vias=tuple(dict.fromkeys(vias)),
        addresses=circuit.addresses[: len(names)],
        supply=circuit.supply,
    )


@dataclass(frozen=True, slots=True)
class Wired:
    """What joins a chip to the bus: capacitor, tracks and vias, and by net the via where its run along x starts."""

    capacitor: Part
    tracks: list[Track]
    vias: list[Via]
    ends: dict[str, Point]


def wired_chip(part: Part, supply: str, pads: Pads, lane: float) -> Wired:
    """Return what joins a chip to a bus on the side of x = `lane`."""
    return (_four_rows if pads.centre else _two_rows)(part, supply, pads, lane)


def chip_part(design: Design, circuit: Circuit, supply: str, k: int, name: str, at: Point) -> Part:
    """Return a chip with the k-th address; pins A0 and A1 of one that is addressed by pins are the bits of k."""
    straps = {"VDD": supply}
    if circuit.addressed_by == "pins":
        straps |= {f"A{bit}": supply if k >> bit & 1 else "GND" for bit in (0, 1)}
    boxes = design.chip.pads.boxes() if design.chip.pads else []
    pads = tuple(
        Pad(str(number), straps.get(net, net), (at[0] + u, at[1] + v), (wide, deep))
        for number, (net, (u, v, wide, deep)) in enumerate(zip(circuit.pins, boxes, strict=True), 1)
    )
    (x, y), (a, b, tall), order = at, design.chip.body, circuit.orders[k]
    body = (x - a / 2, y - b / 2, x + a / 2, y + b / 2, tall)
    return Part(name, order, circuit.package, at, circuit.turn, False, pads, body, order)


def _two_rows(part: Part, supply: str, p: Pads, lane: float) -> Wired:
    """Lead SDA and SCL under the chip's body, and the supply outwards to its capacitor."""
    (x, y), outer = part.at, p.rows / 2 + p.length / 2
    where = {pad.net: pad.at for pad in part.pads}
    ends = {
        "SDA": (where["SDA"][0], y + BUS),
        "SCL": (where["SCL"][0] + p.pitch / 2, y - BUS),
        supply: (where[supply][0], y + outer + RISE),
    }
    tracks = []
    for net, end in ends.items():
        knee = (where[net][0], end[1] - abs(end[0] - where[net][0]))
        tracks.append(Track(net, False, (where[net], knee, end)))
    # the capacitor lies below the via of the supply
    via = ends[supply]
    cap = (via[0] - 0.775, via[1] - VIA / 2 - 0.1 - 0.475)
    tracks.append(Track(supply, True, (via, (via[0], cap[1]))))
    beyond = (where["SDA"][0] - p.width / 2 - CLEARANCE - VIA / 2 - 0.05, cap[1])
    # a bus on the left takes that place, and leaves the one under the body
    ground = (x + p.pitch / 2, y) if lane < x else beyond
    tracks.append(Track("GND", True, ((cap[0] - 0.775, cap[1]), ground)))
    capacitor = passive(f"C{part.reference[1:]}", CAPACITOR, (supply, "GND"), cap)
    return Wired(capacitor, tracks, [Via("GND", ground)], ends)


def _four_rows(part: Part, supply: str, p: Pads, lane: float) -> Wired:
    """Lead SDA, SCL and the supply outwards to vias, and all ground inwards to the pad in the middle.

    Pins that are strapped to the supply at the left half of a side are joined by a track round the chip's left side,
    and both supplies on the lower face.
    """
    (x, y), edge = part.at, p.rows / 2 + p.length / 2
    out, around = edge + CLEARANCE + VIA / 2 + 0.05, edge + CLEARANCE + TRACK / 2 + 0.05
    left, right = x - out, x + out
    tracks, straps = [], []
    ends: dict[str, Point] = {}
    feeds = {}
    for pad in part.pads[:-1]:
        (u, v), side = pad.at, int(pad.number) - 1
        beside = side // p.pins % 2 == 1
        if pad.net == "GND":
            inwards = (x + math.copysign(p.centre / 2 - TRACK, u - x), v)
            over = (u, y + math.copysign(p.centre / 2 - TRACK, v - y))
            tracks.append(Track("GND", False, (pad.at, inwards if beside else over)))
        elif pad.net in ("SDA", "SCL"):
            ends[pad.net] = (math.copysign(out, u - x) + x, v) if beside else (u, math.copysign(out, v - y) + y)
            tracks.append(Track(pad.net, False, (pad.at, ends[pad.net])))
        elif pad.net == supply and beside:
            feeds[u > x] = (right if u > x else left, v)
            tracks.append(Track(supply, False, (pad.at, feeds[u > x])))
        elif pad.net == supply:
            straps.append((u, v, math.copysign(around, v - y) + y))
    low, high = feeds[False], feeds[True]
    for u, v, level in straps:
        tracks.append(Track(supply, False, ((u, v), (u, level), (left, level), low)))
    # a diagonal on the lower face leads from the left supply to the right one
    knee = (right - abs(high[1] - low[1]), low[1])
    tracks.append(Track(supply, True, (low, knee, high)))
    cap = (x + 0.3, y + 1.6)
    ground = (cap[0] - 0.775, y + 0.4)
    tracks.append(Track(supply, True, (high, (right, cap[1]), (cap[0] + 0.775, cap[1]))))
    tracks.append(Track("GND", True, ((cap[0] - 0.775, cap[1]), ground)))
    capacitor = passive(f"C{part.reference[1:]}", CAPACITOR, (supply, "GND"), cap)
    start, other = (low, high) if lane < x else (high, low)
    return Wired(capacitor, tracks, [Via("GND", ground), Via(supply, other)], ends | {supply: start})


def pull_ups(header: Header, supply: str) -> tuple[list[Part], list[Track]]:
    """Return the two resistors of the bus on the lower face of the tab, and their tracks."""
    y = header.y + header.pad[0] / 2 + CLEARANCE + 1.4
    aside = max(0.0, (1.6 - header.pitch) / 2)
    parts, tracks = [], []
    for k, (net, side) in enumerate((("SDA", -1), ("SCL", 1)), 1):
        x, pin = header.x(net) + side * aside, (header.x(net), header.y)
        parts.append(passive(f"R{k}", PULL_UP, (supply, net), (x, y), upright=True))
        tracks.append(Track(net, True, (pin, (pin[0], y - 0.775 - aside), (x, y - 0.775))))
        tracks.append(Track(supply, True, ((header.x(supply), y + 0.775), (x, y + 0.775))))
    start = header.x(supply)
    return parts, [*tracks, Track(supply, True, ((start, header.y), (start, y + 0.775)))]
