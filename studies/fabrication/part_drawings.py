"""The dimensioned drawings of a sensor: the assembly, its base, and its mould, each a sheet in SVG."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from analytic.parts import of_design
from geometry import design_digest
from geometry.arrays import Point
from geometry.base import ArrayPlan, Plan
from geometry.cad import moved
from geometry.design import Design
from geometry.fabrication import bench_parts, magnet_jig
from geometry.fabrication.board_drawing import pads
from geometry.fabrication.hall_elements import chip_centres, places
from geometry.fabrication.printability import Process
from geometry.fabrication.technical_drawing import Dimension, Piece, View, number, sheet
from geometry.mold import BOLT, BOLT_HOLE, Mold, Sizes
from studies.output import provenance

if TYPE_CHECKING:
    from build123d import Solid

    from geometry.fabrication.bench_parts import Fixture
    from geometry.fabrication.magnet_jig import Jig
    from studies.fabrication.sensor_solids import FabricatedSolids

LABELLED = 36
"""Largest number of beams that a drawing numbers."""
AXIS = 9.0
"""Length on paper of the arrow along which an element measures, mm."""


def stamp(design: Design, process: Process) -> str:
    """Return what the title block says of every sheet: the digest of the design, the date, and the tolerance.

    Parts of the largest and the least size within half the fit of the process still slide into each other.
    """
    fields = design_digest.of_mechanics(design) | design_digest.of_readings(design)
    tolerance = f"general tolerance ±{process.fit / 2:g}"
    return f"design {design_digest.digest(fields)}, {provenance.today()}, {tolerance}"


def sheets(
    design: Design,
    plan: Plan,
    process: Process,
    parts: Mapping[str, Solid],
    bodies: Mapping[str, Solid],
    whole: tuple[ArrayPlan, Solid] | None = None,
) -> dict[str, str]:
    """Return the sheets of the assembled sensor and of its base, by name.

    Parameters
    ----------
    process : by which the base is printed.
    parts : base, silicone and, if there is one, magnet, in the sensor's frame.
    bodies : the Hall elements by name.
    whole : plan and solid of the base of an array, whose beams the others are.
    """
    side, above = View("Section y = 0"), View("From above")
    side.cut(parts["base"], "rigid")
    above.projection(parts["base"])
    # projections are slow: both sheets start from copies of the same lines
    sheets = View(side.title, list(side.paths)), View(above.title, list(above.paths))
    return {
        "sensor": _sensor_sheet(design, plan, process, parts, bodies, side, above),
        "base": _array_sheet(*whole, process)
        if whole
        else _base_sheet(design, plan, process, parts["base"], *sheets),
    }


def _sensor_sheet(
    design: Design,
    plan: Plan,
    process: Process,
    parts: Mapping[str, Solid],
    bodies: Mapping[str, Solid],
    side: View,
    above: View,
) -> str:
    """Return the sheet of the assembled sensor; `side` and `above` already show its base."""
    side.cut(parts["silicone"], "soft")
    if "magnet" in parts:
        side.cut(parts["magnet"], "magnet")
    for body in bodies.values():
        side.cut(body, "part")
    add_lengths(design, parts, bodies, side, above)
    side.dims.append(((-plan.half, 0), (-plan.half, -plan.thickness), "left", 2, number(plan.thickness)))
    above.dims += _outline(plan, 1)
    for view in (side, above):
        add_axis(view)
    elements = ", ".join(places(design)) if design.chip_count == 1 else f"{design.chip_count:g} {design.chip.name}"
    magnet = (
        f"magnet {number(design.magnet_diameter)} x {number(design.magnet_height)} mm, J = {design.remanence:g} T"
    )
    notes = [
        f"{magnet}, north pole {design.magnet_north}" if "magnet" in parts else "no magnet",
        f"silicone: E = {design.E:g} MPa, nu = {design.nu:g}; glued to the base on z = 0",
        f"Hall elements: {elements}; l0, c and f go to their plates, which lie inside the bodies",
        "section: base hatched, silicone yellow, magnet grey, Hall elements dark",
    ]
    return sheet("Sensor", [[side], [above]], notes, stamp(design, process))


def add_lengths(
    design: Design, parts: Mapping[str, Solid], bodies: Mapping[str, Solid], side: View, above: View
) -> None:
    """Add the lengths of a design by their symbols, and the axes along which the elements measure."""
    R, L, H = design.R, design.L, design.H
    where = places(design)
    x1, _, z1 = next(iter(where.values()))
    side.dims += [((-R, 0), (R, 0), "above", 0, f"D = {number(design.D)}")]
    side.dims += [((-R, 0), (0, L), "left", 1, f"L = {number(L)}"), ((-R, 0), (0, H), "left", 0, f"H = {number(H)}")]
    if "magnet" in parts:
        a, b = design.magnet_diameter / 2, design.magnet_height / 2
        side.dims.append(((a, H - b), (a, H + b), "right", 1, f"h = {number(2 * b)}"))
        side.dims.append(((-a, H), (a, H), "above", 1, f"d = {number(2 * a)}"))
    side.dims.append(((0, H), (x1, z1), "right", 0, f"l0 = {number(design.l0)}"))
    if design.hall_layout != "three" and design.chip_x:
        x_text = f"chip_x = {number(design.chip_x)}"
        side.dims.append(((0, z1), (x1, z1), "below", 0, x_text))
        above.dims.append(((0, 0), (x1, 0), "below", 0, x_text))
    above.circle((0, 0), R, "soft")
    if "magnet" in parts:
        above.circle((0, 0), design.magnet_diameter / 2, "thin")
    for name, body in bodies.items():
        x, y, _ = where[name]
        if x or y:
            above.projection(body)
            if "S2" not in where:
                # beside the arrows of the first chip, upwards along x and y
                aside = 4.0 if x > -1e-9 else -4.0
                down = 10.0 if name.endswith(" 1") or y < -1e-9 else -10.0
                above.labels.append(((x, y), f"chip {name.split()[-1]}", (aside, down)))
    for view, up in ((side, 2), (above, 1)):
        for element in of_design(design)[:3]:
            along = AXIS * element.direction[0], AXIS * element.direction[up]
            if any(along):
                at = element.position[0], element.position[up]
                view.arrows.append((at, along, element.name.split()[-1], "end"))
    if "S2" in where:
        f = design.f
        z23 = where["S2"][2]
        side.dims.append(((0, z1), (f, z23), "below", 0, f"f = {number(f)}"))
        if abs(design.c) > 1e-9:
            side.dims.append(((0, z1), (f, z23), "right", 2, f"c = {number(design.c)}"))
        above.dims += [
            ((0, 0), (f, 0), "below", 0, f"f = {number(f)}"),
            ((0, 0), (0, f), "left", 0, f"f = {number(f)}"),
        ]


def _base_sheet(design: Design, plan: Plan, process: Process, base: Solid, side: View, above: View) -> str:
    """Return the sheet of the base; `side` and `above` already show it, the view from below is added."""
    below = View("From below")
    below.projection(base, below=True)
    p = plan
    side.dims.append(((-p.half, -p.thickness), (-p.half, 0), "left", 0, number(p.thickness)))
    posts = max((post.corner[2] + post.sides[2] for post in p.seats.posts.values()), default=0.0)
    top = max(posts, p.recess)
    if posts > p.recess:
        side.dims.append(((p.half, 0), (p.half, posts), "right", 0, number(posts)))
    if p.recess:
        # the floor of the recess is the base plane; the dimensions of the seats count from there
        side.dims.append(((-p.half, 0), (-p.half, p.recess), "left", 1, f"recess {number(p.recess)}"))
        r = p.recess_radius
        side.dims.append(((-r, 0), (r, 0), "below", 1, f"recess Ø{number(2 * r)}"))
    for name, block in p.seats.bodies.items():
        (x, y, z), (a, b, c) = block.corner, block.sides
        if name == "S3" or name.endswith((" 2", " 3", " 4")):
            continue  # as the one before
        if z <= -p.thickness + 1e-9:
            side.dims.append(((x, -p.thickness), (x + a, -p.thickness), "below", 0, number(a)))
            side.dims.append(((p.half, -p.thickness), (x + a, z + c), "right", 1, number(c)))
            # seen from below, x runs to the left; there the leads of S1 leave to the right
            edge = -x if name == "S1" else -x - a
            below.dims.append(((edge, y), (edge, y + b), "right" if name == "S1" else "left", 0, number(b)))
        else:
            side.dims.append(((x, max(0.0, top)), (x + a, max(0.0, top)), "above", 0, number(a)))
            side.dims.append(((p.half, 0), (x + a, z), "right", 2, number(abs(z))))
            above.dims.append(((0, 0), (x, y), "below", 0, number(x)))
            above.dims.append(((x, y), (x, y + b), "right", 0, number(b)))
    if design.hall_layout != "three":
        _add_chips(design, below)
    above.dims += _outline(plan, 1)
    notes = ["printed as it stands, underside down, without supports"]
    if design.element_count > 3:
        many, radius = len(p.seats.bodies), number(abs(design.chip_x))
        notes.append(f"{many} equal pockets, evenly on a circle of radius {radius}, the first on x")
    if p.marks:
        notes.append("grooves in the edge of the upper face: one at +x, two at +y")
    if p.screw > 0:
        (left, _), (right, _) = min(p.screws), max(p.screws)
        at = max(y for _, y in p.screws)
        above.dims.append(((left, at), (right, at), "above", 0, number(right - left)))
        notes.insert(0, f"4 holes Ø{number(p.screw)} for screws")
    for view in (side, above, below):
        add_axis(view)
    return sheet("Base", [[side, above], [below]], notes, stamp(design, process))


def _array_sheet(whole: ArrayPlan, solid: Solid, process: Process) -> str:
    """Return the sheet of the base of an array: a section through its first row, from above and from below."""
    array, p, (west, south, east, north) = whole.array, whole.one, whole.box
    places, poles = array.places.tolist(), array.poles.tolist()
    x, y = places[0]
    side, above, below = View(f"Section y = {number(y)}"), View("From above"), View("From below")
    side.cut(solid, "rigid", y=y)
    above.projection(solid)
    below.projection(solid, below=True)
    side.dims.append(((west, -p.thickness), (west, 0), "left", 0, number(p.thickness)))
    if p.recess:
        r = p.recess_radius
        side.dims.append(((west, 0), (west, p.recess), "left", 1, f"recess {number(p.recess)}"))
        side.dims.append(((x - r, 0), (x + r, 0), "above", 0, f"recess Ø{number(2 * r)}"))
    above.dims += [((west, south), (east, south), "below", 2, number(east - west))]
    above.dims += [((west, south), (west, north), "left", 2, number(north - south))]
    for k in (0, 1):
        near = sorted({place[k] for place in places})[:2]
        if len(near) == 2:
            ends: tuple[Point, Point] = ((near[0], y), (near[1], y)) if k == 0 else ((x, near[0]), (x, near[1]))
            above.dims.append((*ends, "left" if k else "below", 1, number(near[1] - near[0])))
        at = [screw[k] for screw in whole.screws]
        if at:
            low, high = min(whole.screws), max(whole.screws)
            ends = ((low[0], high[1]), high) if k == 0 else ((high[0], low[1]), high)
            above.dims.append((*ends, "right" if k else "above", 0, number(max(at) - min(at))))
    (u, v, _), (a, b, _) = next((seat.corner, seat.sides) for seat in p.seats.bodies.values())
    below.dims.append(((-x - u - a, y + v), (-x - u, y + v), "below", 0, number(a)))
    below.dims.append(((-x - u, y + v), (-x - u, y + v + b), "right", 0, number(b)))
    north_up = array.design.magnet_north == "up"
    for number_of, ((px, py), pole) in enumerate(zip(places, poles, strict=True), 1):
        if len(places) <= LABELLED:
            above.labels.append(((px, py), f"{number_of} {'N' if (pole > 0) == north_up else 'S'}", (2.0, -2.0)))
    for u, v in (centre for centre in chip_centres(array.design).values()):
        for px, py in places:
            below.cross((-px - u, py + v), 0.6 * max(array.design.chip.body[:2]))
    notes = [f"{len(places)} equal pockets, printed as it stands, underside down, without supports"]
    if len(places) <= LABELLED:
        notes.append("numbers of the beams, and the pole that points to the tip")
    if whole.screws:
        notes.insert(0, f"4 holes Ø{number(p.screw)} for screws")
    return sheet("Base", [[side, above], [below]], notes, stamp(array.design, process))


def _add_chips(design: Design, below: View) -> None:
    """Add the centres of the chips' bodies, from which soldering starts, and pin 1; x runs to the left."""
    centres = list(chip_centres(design).values())
    (x, y), (_, aside) = centres[0], centres[min(1, len(centres) - 1)]
    for u, v in centres:
        below.cross((-u, v), 0.6 * max(design.chip.body[:2]))
    if x:
        below.dims.append(((0, 0), (-x, y), "below", 0, number(abs(x))))
    if aside:
        below.dims.append(((0, 0), (0, aside), "right", 0, number(abs(aside))))
    for u, v in pads(design)[:: max(1, len(pads(design)) // len(centres))]:
        below.labels.append(((-u, v), "pin 1", (4.0, 3.5)))


def mold_sheet(design: Design, mold: Mold, s: Sizes, A: Solid, pieces: Sequence[Solid]) -> str:
    """Return the sheet of the mould: a section through a row of cavities, closed, and B from above."""
    y = s.centres[0][1]
    side, above = View(f"Section y = {number(y)}, closed"), View("B from above")
    for piece in pieces:
        # the section of a split B lies just beside its joint, where the halves would share their faces
        side.cut(piece, "rigid", y=y + (1e-3 * s.R if mold.split else 0.0))
    side.cut(A, "lid", y=y)
    for piece in pieces:
        above.projection(piece)
    x, row = max(centre[0] for centre in s.centres), sorted(u for u, v in s.centres if v == y)
    left, beside = row[0], row[min(1, len(row) - 1)]
    side.dims += [
        ((left - s.R, -0.2 * s.L), (left + s.R, -0.2 * s.L), "below", 0, f"Ø{number(2 * s.R)}"),
        ((left - s.outer, s.bottom), (left + s.outer, s.bottom), "below", 1, f"Ø{number(2 * s.outer)}")
        if beside == left
        else ((left, 0), (beside, 0), "below", 1, number(beside - left)),
        ((-x - s.rim, s.bottom), (x + s.rim, s.bottom), "below", 2, number(2 * (x + s.rim))),
        ((left, -s.L), (left - s.R, 0), "left", 0, number(s.L)),
        ((-x - s.rim, s.lid), (-x - s.rim, s.bottom), "left", 1, number(s.lid - s.bottom)),
        ((x + s.rim, 0), (x + s.rim, s.lid), "right", 0, number(s.lid)),
        ((x + s.rim, 0), (x + s.rim, -s.skirt), "right", 1, number(s.skirt)),
        ((-x - s.rim, s.bottom), (-x - s.rim, s.bottom + s.floor), "left", 0, number(s.floor)),
    ]
    if s.pin_radius > 0:
        r = s.pin_radius
        side.dims.append(((left - r, -s.pin_depth), (left + r, -s.pin_depth), "above", 1, f"pin Ø{number(2 * r)}"))
        side.dims.append(((x, -s.pin_depth), (x + r, 0), "right", 2, number(s.pin_depth)))
    vent, radius = x + s.vent_ring, s.vent_diameter / 2
    side.dims += [((vent - radius, s.lid), (vent + radius, s.lid), "above", 0, f"vent Ø{number(s.vent_diameter)}")]
    side.labels += [((-x - s.rim, s.lid / 2), "A", (-5.0, -9.0))]
    side.labels += [((-x - s.rim, s.bottom + 0.5 * s.floor), "B", (-5.0, 9.0))]
    add_axis(side)
    # screws lie opposite each other along x, along y, or both
    at = [lug.at(s.reach[1]) for lug in s.lugs]
    if aside := [point for point, lug in zip(at, s.lugs, strict=True) if lug.outwards[0]]:
        (far, v), near = max(aside), min(aside)[0]
        above.dims.append(((near, v), (far, v), "above", 0, number(far - near)))
    if ahead := [point for point, lug in zip(at, s.lugs, strict=True) if lug.outwards[1]]:
        u, high, low = min(ahead)[0], *(end(point[1] for point in ahead) for end in (max, min))
        above.dims.append(((u, low), (u, high), "left", 0, number(high - low)))
    if s.ears:
        e, low = s.ears, s.bottom
        above.dims.append(((-e.end, 0), (e.end, 0), "above", 0, number(2 * e.end)))
        side.dims += [
            *(((e.bolt_x, z), (e.end, low), "right", 3 + k, number(z - low)) for k, z in enumerate(e.bolt_z)),
            ((e.pin_x, low / 2), (e.end, low), "right", 3 + len(e.bolt_z), f"pin {number(-low / 2)}"),
            ((x, low), (e.bolt_x, low), "below", 1, number(e.bolt_x - x)),
            ((x, low), (e.pin_x, low / 2), "below", 3, f"pin {number(e.pin_x - x)}"),
        ]
    foot_y = max(centre[1] for centre in s.centres) + s.rim
    above.dims += [((-x - s.rim, -foot_y), (x + s.rim, -foot_y), "below", 0, number(2 * (x + s.rim)))]
    above.dims += [((x + s.rim, -foot_y), (x + s.rim, foot_y), "right", 0, number(2 * foot_y))]
    count = len(s.centres)
    cavities = f"{count} {'cavity' if count == 1 else 'cavities'} for D = {design.D:g}, L = {design.L:g}"
    shrink = f"shrinkage of {100 * mold.shrink:g} % is in cavity and pin"
    notes = [
        f"{cavities}; {shrink}; fit between A and B {number(s.fit)}",
        f"printed by {mold.printing.name}: A with its lid down, B as it stands, without supports",
        f"{mold.vents} vents on Ø{number(2 * s.vent_ring)}; pin: draft {mold.draft:g}°, fillet {number(s.pin_edge)}",
    ]
    screws = f"{len(s.lugs)} countersunk screws M{number(BOLT)} x {number(s.screw(s.lid))}"
    if mold.split:
        screws += (
            f"; across the split: pins Ø{number(s.dowel)} in holes Ø{number(s.dowel_hole)}, screws M{number(BOLT)}"
        )
    notes.append(f"A on B: {screws}; holes for M{number(BOLT)}: Ø{number(BOLT_HOLE)}")
    return sheet("Mould", [[side], [above]], notes, stamp(design, mold.printing))


def jig_sheet(design: Design, mold: Mold, s: Sizes, jig: Jig, parts: Mapping[str, Solid], B: Solid) -> str:
    """Return the sheet of the jig: a section through B, jig, plunger, bar and magnet, and the gauge from above."""
    x, y = s.centres[0]
    side, above, letters = View(f"Section y = {number(y)}"), View("Gauge from above"), View("C from above")
    # a split B is cut just beside its joint
    for solid, style, aside in (
        (B, "rigid", 1e-3 * s.R if s.ears else 0.0),
        (parts["jig"], "lid", 0.0),
        (parts["jig_bar"], "rigid", 0.0),
    ):
        side.cut(solid, style, y=y + aside)
    for centre in (centre for centre in s.centres if centre[1] == y):
        side.cut(moved(parts["jig_plunger"], (*centre, 0.0)), "part", y=y)
        side.cut(moved(magnet_jig.magnet_in_pocket(design, s), (*centre, 0.0)), "magnet", y=y)
    far = max(centre[0] for centre in s.centres)
    side.dims += [
        ((x - jig.bore, jig.lid), (x + jig.bore, jig.lid), "above", 1, f"bore Ø{number(2 * jig.bore)}"),
        ((x - jig.collar, jig.top), (x + jig.collar, jig.top), "above", 0, f"Ø{number(2 * jig.collar)}"),
        ((x - jig.tip, -jig.depth), (x + jig.tip, -jig.depth), "below", 0, f"end Ø{number(2 * jig.tip)}"),
        ((x, -jig.depth), (-far - s.rim, 0), "left", 0, number(jig.depth)),
        ((-far - s.rim, 0), (-far - s.rim, jig.lid), "left", 1, number(jig.lid)),
        ((far + s.rim, jig.lid), (far + s.rim, jig.top), "right", 0, number(jig.top - jig.lid)),
        ((far + s.rim, jig.top), (far + s.rim, jig.top + jig.bar), "right", 1, number(jig.bar)),
    ]
    above.projection(parts["jig_gauge"])
    left, _, low, top = above.box
    wide = top - low - 2 * jig.depth
    short, long = jig.depth - magnet_jig.LIMIT, jig.depth + magnet_jig.LIMIT
    above.dims += [
        ((0, -short), (left, 0), "left", 0, number(short)),
        ((0, wide + long), (left, wide), "left", 0, number(long)),
    ]
    add_axis(side)
    mixed = len(set(mold.poles)) > 1
    if mixed:
        letters.projection(parts["jig"])
    count = len(s.centres)
    plungers, screws = "plungers" if count > 1 else "plunger", s.screw(jig.top + jig.bar)
    magnet = f"magnet {number(design.magnet_diameter)} x {number(design.magnet_height)}"
    poles = "poles up as the letters say" if mixed else f"pole {jig.pole} up"
    notes = [
        f"{count} {plungers}: Ø{number(2 * jig.shank)} in the bore, vent Ø{number(2 * jig.vent)}",
        f"{magnet}, {poles}; its top {number(jig.depth)} below B's rim",
        "gauge: flat on the rim by the short tongue, one groove; rocking by the long one, two grooves",
        f"{len(s.lugs)} countersunk screws M{number(BOLT)} x {number(screws)} through B, jig and bar",
    ]
    return sheet("Jig", [[side, letters] if mixed else [side], [above]], notes, stamp(design, mold.printing))


def bench_sheet(design: Design, mold: Mold, s: Sizes, plan: Plan | None, cell: str, solids: FabricatedSolids) -> str:
    """Return the sheet of the stand, and of the fixture if there is a base."""
    stand, lengths = solids.bench["stand"], bench_parts.stand(s)
    front = lengths.pads[0][1]
    side, above = View(f"Section y = {number(front)}: B on the stand"), View("Stand from above")
    side.cut(solids.B, "rigid", y=front)
    side.cut(stand, "lid", y=front)
    above.projection(stand)
    (x, y), low = lengths.half, s.bottom - bench_parts.PAD
    (left, near), (right, _), (_, back) = lengths.screws
    above.dims += [
        ((-x, 0), (x, 0), "below", 0, number(2 * x)),
        ((left, near), (right, near), "below", 1, number(right - left)),
        ((0, -y), (0, y), "left", 0, number(2 * y)),
        ((right, near), (0, back), "right", 0, number(back - near)),
    ]
    side.dims += [
        ((-x, low), (-x, low + lengths.rim), "left", 0, number(lengths.rim)),
        ((x, low), (0, s.bottom), "right", 0, number(bench_parts.PAD)),
    ]
    notes = [f"stand: 3 holes Ø{number(bench_parts.TAPPED)}, in which nylon screws M3 x {lengths.length} cut threads"]
    columns = [[side, above]]
    if plan:
        fixture = bench_parts.fixture(plan, mold.printing, cell)
        columns.append(_fixture_views(fixture, min((y for _, y in plan.screws), default=0.0), solids))
        notes.append(f"fixture: holes M{number(fixture.cell.thread)} of the load cell {fixture.cell.name}")
        axis = f"axis {number(fixture.off)} off" if fixture.off else "axis over"
        notes.append(f"two washers under each of them keep the cell clear; {axis} its middle")
    return sheet("Bench", columns, notes, stamp(design, mold.printing))


def _fixture_views(fixture: Fixture, front: float, solids: FabricatedSolids) -> list[View]:
    """Return the section of base and fixture at y = `front`, and the fixture from above."""
    side, above = View(f"Section y = {number(front)}: base on the fixture"), View("Fixture from above")
    side.cut(solids.sensor["base"], "rigid", y=front)
    side.cut(solids.bench["fixture"], "lid", y=front)
    above.projection(solids.bench["fixture"])
    low, (x, y) = fixture.top - bench_parts.PLATE, fixture.holes[0]
    side.dims += [
        ((fixture.right, low), (fixture.right, fixture.top), "right", 0, number(bench_parts.PLATE)),
        ((0, low), (fixture.right, low), "below", 0, number(fixture.right)),
    ]
    above.dims += [((0, 0), (x, y), "below", 0, number(x))]
    above.dims += [((fixture.left, -fixture.half), (fixture.left, fixture.half), "left", 0, number(2 * fixture.half))]
    if (second := fixture.holes[1]) and second[1] != y:
        above.dims.append(((x, second[1]), (x, y), "right", 0, number(abs(y - second[1]))))
    else:
        above.dims.append(((second[0], y), (x, y), "above", 0, number(abs(x - second[0]))))
    for view in (side, above):
        add_axis(view)
    return [side, above]


def _outline(plan: Plan, level: int) -> list[Dimension]:
    h = plan.half
    across: Dimension = ((-h, -h), (h, -h), "below", level, number(2 * h))
    if plan.is_round:
        return [((-h, 0), (h, 0), "below", level, f"Ø{number(2 * h)}")]
    return [across, ((-h, -h), (-h, h), "left", level, number(2 * h))]


def add_axis(view: View) -> None:
    left, right, low, top = view.box
    over = 0.04 * math.hypot(right - left, top - low)
    view.paths.append(([[Piece((0.0, low - over), (0.0, top + over))]], "axis"))
