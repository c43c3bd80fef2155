"""What holds mould and sensor on the bench: a stand for the curing mould, and a fixture of the base on a load cell.

The stand is a tray with three pads, on which B stands without rocking, and three screws that level it: in the second
pour gravity alone levels the silicone over the magnet. The tray takes what runs out of the vents and over the rim in
vacuum, as much as fills all cavities. In the mould's frame of `geometry.mold`, B stands on the pads.

The fixture is a plate on the loaded end of a load cell. It carries the base by its screws, on posts that leave room
for the board with its parts and leads, or a base without screws by its rim. The beam's axis is over the middle of the
cell, where bending bars are made to be loaded, unless the base is so large that it would cover the cell's screws. In
the sensor's frame, the cell lies along x. All lengths are in mm.
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.arrays import Point
from geometry.bad_input import nearest
from geometry.base import BOARDS, Plan, base_screw, screw_thread
from geometry.cad import cut, moved, overlap, turned
from geometry.design import BadInput
from geometry.fabrication.hall_elements import Block
from geometry.fabrication.printability import Check, Process, at_least, at_most
from geometry.mold import LUG, Mold, Sizes, screw_length

if TYPE_CHECKING:
    from build123d import Solid

FLOOR, RIM, PAD, AROUND = 2.0, 1.6, 3.0, 5.0
"""Of the stand: thickness of floor and rim, height of the pads, and room around B for nuts and fingers, mm."""
LEAST_RIM = 3.0
"""Least height of the rim over the floor, mm."""
BOSS, TAPPED, PITCH = 8.0, 2.5, 0.5
"""Height of a boss, its hole in which a screw M3 cuts its thread, and what a turn lifts, mm."""
PLATE, ROOM, WASHERS = 6.0, 3.5, 1.0
"""Of the fixture: its thickness, room under the board for parts and cut leads, and height of the washers that keep
the bending cell clear of it, mm."""
LEDGE, LIP = 1.0, 2.0
"""Width of the ledge that carries its edge, and height of the lip around it, mm."""
HEAD = 1.9
"""Diameter of a countersunk head over its thread (ISO 2009)."""
PLA = 3000.0
"""Young's modulus of PLA, MPa, the common figure of data sheets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadCell:
    """A load cell: a table of `load_cells.toml`, which says what its fields are."""

    name: str
    thread: float
    holes: list[list[float]]
    width: float
    height: float
    source: str


LOAD_CELLS = {
    name: LoadCell(**table)
    for name, table in tomllib.loads(Path(__file__).with_name("load_cells.toml").read_text("utf-8")).items()
}
"""The load cells by their names."""


def load_cell(name: str) -> LoadCell:
    """Return a load cell; BadInput where there is none of this name."""
    if name not in LOAD_CELLS:
        raise BadInput(f"there is no load cell {name!r}: {nearest(str(name), LOAD_CELLS)}")
    return LOAD_CELLS[name]


# The stand


@dataclass(frozen=True, slots=True)
class Stand:
    """The lengths of the stand, mm.

    Attributes
    ----------
    half : half the length and half the width of the tray inside its rim.
    rim : height of the rim over the floor.
    pads : middle of each pad.
    screws : place of each levelling screw.
    length : of the levelling screws M3.
    """

    half: Point
    rim: float
    pads: tuple[Point, ...]
    screws: tuple[Point, ...]
    length: float

    @property
    def tilt(self) -> float:
        """Tilt by one turn of a screw across the shorter side, degrees."""
        (x1, y1), (x2, _), (_, y3) = self.screws
        return math.degrees(PITCH / min(abs(x1 - x2), abs(y3 - y1)))


def stand(s: Sizes) -> Stand:
    """Return the lengths of the stand under a mould."""
    foot = [max(centre[k] for centre in s.centres) + s.rim for k in (0, 1)]
    lugs = [abs(at[k]) + LUG for lug in s.lugs for at in (lug.at(s.reach[1]),) for k in (0, 1)]
    x = max(foot[0], *lugs[::2], s.ears.end if s.ears else 0.0) + AROUND
    y = max(foot[1], *lugs[1::2]) + AROUND
    free = 4 * (x * y - foot[0] * foot[1])
    a, b = 0.6 * foot[0], 0.6 * foot[1]
    out = RIM + 3.0
    return Stand(
        half=(x, y),
        rim=max(LEAST_RIM, math.ceil(10 * len(s.centres) * s.R**2 * math.pi * s.L / free) / 10),
        pads=((-a, -b), (a, -b), (0.0, b)),
        screws=((-x - out, 4 - y), (x + out, 4 - y), (0.0, y + out)),
        length=screw_length(BOSS + 8.0),
    )


def stand_solid(s: Sizes, lengths: Stand) -> Solid:
    """Return the stand under B in the mould's frame, its pads at B's underside."""
    import build123d as bd

    (x, y), low = lengths.half, s.bottom - PAD - FLOOR
    outer = Block((-x - RIM, -y - RIM, low), (2 * (x + RIM), 2 * (y + RIM), FLOOR + lengths.rim)).solid()
    inner = Block((-x, -y, low + FLOOR), (2 * x, 2 * y, lengths.rim)).solid()
    pads = [bd.Solid.make_cylinder(4.0, PAD + FLOOR, bd.Plane((*at, low))) for at in lengths.pads]
    places = [bd.Plane((*at, low)) for at in lengths.screws]
    bosses = [bd.Solid.make_cylinder(4.5, BOSS, place) for place in places]
    # a boss stands outside of the rim
    tray = cut(outer.fuse(*bosses).solids()[0], inner)
    holes = [bd.Solid.make_cylinder(TAPPED / 2, BOSS, place) for place in places]
    return cut(tray.fuse(*pads).solids()[0], *holes)


def stand_checks(s: Sizes, lengths: Stand, solid: Solid, B: Solid) -> list[Check]:
    """Measure the stand under B, in the mould's frame."""
    (x, y), cavities = lengths.half, len(s.centres) * math.pi * s.R**2 * s.L
    room = Block((-x, -y, s.bottom - PAD), (2 * x, 2 * y, lengths.rim)).solid()
    free = sum(float(piece.volume) for piece in room.cut(solid, B).solids())
    gap = float(solid.distance_to(B))
    return [
        at_most("overlap of B and the stand", overlap(solid, B), 1e-9, "mm3"),
        Check("gap between B and the stand's pads", gap, "|.| <= 1e-06", "mm", gap <= 1e-6),
        Check("room of the stand's tray over the cavities", free / cavities, ">= 1", "1", free >= cavities),
    ]


# The fixture


@dataclass(frozen=True, slots=True)
class Fixture:
    """The lengths of the fixture, mm.

    Attributes
    ----------
    cell : the load cell.
    off : distance of the beam's axis from the middle of the cell, towards its fixed end.
    left, right, half : least and greatest x of the plate, and half its width.
    top : z of the plate's upper face; that of the posts is `seat`, the underside of the board.
    screw, cell_screw : lengths of the screws of base and cell; 0 for a base without screws.
    """

    cell: LoadCell
    off: float
    left: float
    right: float
    half: float
    top: float
    seat: float
    screw: float
    cell_screw: float

    @property
    def holes(self) -> list[Point]:
        """Places of the cell's screws in the sensor's frame."""
        return [(x + self.off, y) for x, y in self.cell.holes]

    @property
    def compliance(self) -> float:
        """Deflection of the plate under the axis for 1 N on it, mm: a cantilever of PLA from the nearest screw."""
        arm = min(x for x, _ in self.holes)
        return arm**3 / (3 * PLA * 2 * self.half * PLATE**3 / 12)


def fixture(plan: Plan, process: Process, name: str) -> Fixture:
    """Return the lengths of the fixture of a base on a load cell.

    Raises
    ------
    BadInput
        There is no load cell of this name.
    """
    cell = load_cell(name or next(iter(LOAD_CELLS)))
    head = HEAD * cell.thread / 2
    reach = plan.half + (0.0 if plan.screw else process.fit + RIM)
    nearest_hole = min(x for x, _ in cell.holes)
    off = max(0.0, reach + head + 1.0 - nearest_hole)
    seat = -plan.thickness - BOARDS[0]
    return Fixture(
        cell=cell,
        off=off,
        left=-reach,
        right=max(x for x, _ in cell.holes) + off + head + 1.5,
        half=max(reach, cell.width / 2),
        top=seat - ROOM,
        seat=seat,
        screw=base_screw(plan, below=PLATE + ROOM),
        cell_screw=screw_length(PLATE + WASHERS + min(cell.height, 1.5 * cell.thread)),
    )


def fixture_solid(plan: Plan, process: Process, lengths: Fixture) -> Solid:
    """Return the fixture under the base, in the sensor's frame."""
    import build123d as bd

    f, low = lengths, lengths.top - PLATE
    plate = Block((f.left, -f.half, low), (f.right - f.left, 2 * f.half, PLATE)).solid()
    holes = [_countersunk(f.cell.thread * 1.1, f.cell.thread, low, f.top, at, above=True) for at in f.holes]
    if not plan.screw:
        return cut(plate.fuse(*_seat(plan, process, f)).solids()[0], *holes)
    thread = screw_thread(plan.screw)
    wide = plan.screw / 2 + 1.2
    posts = [bd.Solid.make_cylinder(wide, f.seat - low, bd.Plane((x, y, low))) for x, y in plan.screws]
    holes += [_countersunk(plan.screw, thread, low, f.seat, at, above=False) for at in plan.screws]
    return cut(plate.fuse(*posts).solids()[0], *holes)


def _countersunk(hole: float, thread: float, low: float, high: float, at: Point, *, above: bool) -> Solid:
    """Return a hole between two heights with the cone of a screw's head at one end."""
    r, head = hole / 2, HEAD * thread / 2 + 0.1
    # a little steeper than the head, so that its triangles too print without support
    cone = [(0, low, 0), (head, low, 0), (r, low + 1.08 * (head - r), 0), (r, high, 0), (0, high, 0)]
    if above:
        cone = [(0, low, 0), (r, low, 0), (r, high - head + r, 0), (head, high, 0), (0, high, 0)]
    return moved(turned(cone), (*at, 0.0))


def _seat(plan: Plan, process: Process, f: Fixture) -> list[Solid]:
    """Return the rim on which a base without screws lies with the edge of its board, open towards the tab at -y."""
    inner, edge = plan.half - LEDGE, plan.half + process.fit

    def outline(half: float, low: float, high: float) -> Solid:
        if plan.is_round:
            return turned([(0, low, 0), (half, low, 0), (half, high, 0), (0, high, 0)])
        return Block((-half, -half, low), (2 * half, 2 * half, high - low)).solid()

    ring = cut(outline(edge + RIM, f.top, f.seat + LIP), outline(edge, f.seat, f.seat + LIP))
    # as wide as the widest tab
    wide = plan.widest_tab / 2
    gate = Block((-wide, -2 * plan.half, f.top), (2 * wide, 2 * plan.half, ROOM + LIP)).solid()
    return list(ring.cut(outline(inner, f.top, f.seat), gate).solids())


def fixture_checks(plan: Plan, lengths: Fixture, solid: Solid, base: Solid) -> list[Check]:
    """Measure the fixture under the base, in the sensor's frame."""
    from build123d import Vertex

    f, hole = lengths, 0.0
    gap = float(solid.distance_to(base))
    results = [
        at_most("overlap of base and fixture", overlap(solid, base), 1e-9, "mm3"),
        # the lip of a base without screws lies beside it
        at_least("gap between base and fixture", gap, BOARDS[0] if plan.screw else 0.05),
    ]
    for x, y in plan.screws:
        hole = max(hole, abs(float(Vertex(x, y, (f.top + f.seat) / 2).distance_to(solid)) - plan.screw / 2))
    for x, y in f.holes:
        hole = max(hole, abs(float(Vertex(x, y, f.top - PLATE + 0.5).distance_to(solid)) - 0.55 * f.cell.thread))
    return [*results, at_most("error of the fixture's holes on the screws of base and cell", hole, 1e-6, "mm")]


def solids(s: Sizes, plan: Plan | None, mold: Mold, cell: str) -> dict[str, Solid]:
    """Return stand and fixture, the first in the mould's frame, the second, if there is a base, in the sensor's."""
    found = {"stand": stand_solid(s, stand(s))}
    if plan:
        found["fixture"] = fixture_solid(plan, mold.printing, fixture(plan, mold.printing, cell))
    return found
