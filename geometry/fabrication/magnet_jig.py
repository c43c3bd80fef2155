"""The jig, part C, that puts magnets into their pockets and holds them down while their glue cures. Lengths in mm.

In the mould's frame of `geometry.mold`, C lies on B in A's place: a cover with lugs and skirt, whose thick lid has a
bore over each pocket. A magnet whose diagonal exceeds the bore cannot turn over on its way down. A letter says which
pole faces up, to the right of each bore where they differ, as in an array of poles that alternate. A plunger follows
it: its collar lies on C when its end is at the height of the magnet's top, so that the magnet rests on the pocket's
bottom. One bar over all plungers is clamped by the screws of the lugs. The end of a plunger has a recess and grooves
for surplus glue, which then sticks to a narrow rim only, and a vent along its axis lets air in when it is pulled.

A gauge checks the depth of the glued magnet's top: its tongue with one groove beside it is 0.1 mm shorter, so that
the gauge lies flat on B's rim, and that with two grooves is 0.1 mm longer, so that it rocks. Its socket takes a
reference magnet that shows the pole; in C it would push the magnets that lie in their glue.

The pin is longer by the shrinkage of the silicone and the magnet is not: all depths follow the pocket in the mould.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.arrays import Point
from geometry.cad import cut, intersection, magnet, moved, overlap, turned
from geometry.design import BadInput, Design
from geometry.fabrication.engraved_marks import DEPTH, MARGIN, strokes
from geometry.fabrication.hall_elements import Block
from geometry.fabrication.mold_solids import ROUNDING, cover, largest_overlap, screw_overlap, slab, with_lugs
from geometry.fabrication.printability import Check, at_least, at_most
from geometry.mold import BOLT, BOLT_HOLE, HEAD, SEAT, Mold, Sizes, sizes

if TYPE_CHECKING:
    from build123d import Solid

PLAY = 0.1
"""Gap on each side between magnet and bore, plunger and bore, and plunger and pocket, mm."""

CHIMNEY = 5.0
"""Length of a bore beyond the height of the magnet, mm."""

COLLAR, LIP, LEAST_LIP = 3.0, 2.0, 0.8
"""Height of a plunger's collar, by how much it is wider than the bore on each side, and by how much at least, mm."""

RECESS, RELIEF = 0.3, 0.5
"""Depth of the recess and the grooves at a plunger's end, and room over the cast under C, for glue and flash, mm."""

LEAST_TIP = 1.5
"""Least diameter of a plunger's end, mm: thinner ones have no room for recess and vent."""

LEAST_DEPTH = 0.5
"""Least depth of a magnet's top below the base plane that plunger and gauge can reach, mm."""

LIMIT = 0.1
"""Largest error of the depth of a magnet's top that the gauge lets pass, mm."""

MOUTH = (0.4, 0.5)
"""Width and height of the chamfer at the mouth of a bore, mm: it is printed on the bed, where holes close."""

LETTER = 5.0
"""Height of the letters for the pole, mm."""


@dataclass(frozen=True, slots=True)
class Jig:
    """The lengths of the jig, mm.

    Attributes
    ----------
    lid : thickness of C's lid, and so length of its bores.
    bore, shank, tip : radii of a bore, of a plunger in the bore, and of its end in the pocket.
    depth : depth of the magnet's top, and of the plunger's end, below the base plane.
    recess, vent : radii of the hollow in the plunger's end, and of the hole along its axis.
    collar : radius of the plunger's collar.
    bar : thickness of the bar.
    diagonal : largest width of the magnet in its plane of symmetry.
    pole : letter of the pole of the magnet that faces up, the other one where the array reverses it.
    """

    lid: float
    bore: float
    shank: float
    tip: float
    depth: float
    recess: float
    vent: float
    collar: float
    bar: float
    diagonal: float
    pole: str

    @property
    def top(self) -> float:
        """Height of the collars' upper faces above the base plane, mm."""
        return self.lid + COLLAR


def lengths(design: Design, mold: Mold) -> Jig:
    """Return the lengths of the jig for this design and mould.

    Raises
    ------
    BadInput
        The design has no magnet, or one that could turn over in its bore, is too thin for a plunger, or lies too
        close to the base or to its neighbours.
    """
    if not design.shape.has_magnet:
        raise BadInput("magnet_diameter must be positive for a jig; got 0 mm: leave jig out")
    s, a, h = sizes(design, mold), design.magnet_diameter / 2, design.magnet_height
    bore, rho = a + PLAY, design.magnet_edge_radius
    diagonal = 2 * (math.hypot(a - rho, h / 2 - rho) + rho)
    if not diagonal > 2 * bore:
        # with sharp edges, the height at which the diagonal is that of the bore
        least = math.ceil(10 * (2 * math.sqrt((bore - rho) ** 2 - (a - rho) ** 2) + 2 * rho) + 1e-9) / 10
        raise BadInput(
            f"the magnet's diagonal of {diagonal:.3g} mm must exceed the jig's bore of {2 * bore:.3g} mm, or it "
            f"turns over in it: take a magnet more than {least:g} mm high, or glue it in by hand with its pole marked"
        )
    tip, depth = min(s.pin_radius, a) - PLAY, s.pin_depth - h
    if not 2 * tip >= LEAST_TIP:
        raise BadInput(
            f"a jig's plunger must be {LEAST_TIP:g} mm thick at least and is {2 * tip:.3g} mm: take a magnet and a "
            "pocket that are wider, or glue it in by hand"
        )
    if not depth >= LEAST_DEPTH:
        raise BadInput(
            f"the magnet's top must lie {LEAST_DEPTH:g} mm below the base plane at least for a jig and is "
            f"{depth:.3g} mm below: glue it in by hand"
        )
    lip = min(LIP, s.pitch / 2 - PLAY - bore)
    if len(set(mold.poles)) > 1:
        # the least letter stands between two collars
        between = 0.66 * _least_letter(mold) + 2 * MARGIN
        lip = min(lip, max(LEAST_LIP, (s.pitch - between) / 2 - bore))
    if not lip >= LEAST_LIP:
        raise BadInput(
            f"wall leaves the collars of neighbouring plungers {lip:.2g} mm, and they need {LEAST_LIP:g} mm: set "
            f"wall to {s.wall + 2 * (LEAST_LIP - lip):.3g} mm"
        )
    span = 2 * max(math.hypot(*lug.at(s.reach[1])) for lug in s.lugs)
    return Jig(
        lid=max(s.lid, h + CHIMNEY),
        bore=bore,
        shank=a,
        tip=tip,
        depth=depth,
        recess=0.7 * min(tip, a - rho),
        vent=min(0.5, tip / 3),
        collar=bore + lip,
        bar=max(5.0, span / 20),
        diagonal=diagonal,
        # in the mould the base is up: a north pole that points to the base faces up
        pole="N" if design.magnet_north == "down" else "S",
    )


def planned(design: Design, mold: Mold) -> tuple[Jig | None, str]:
    """Return the lengths of the jig, or None and the reason, which is empty where none is wanted.

    Raises
    ------
    BadInput
        The mould asks for a jig (`jig` = 1) that is impossible.
    """
    if mold.jig == 0 or (mold.jig is None and not design.shape.has_magnet):
        return None, ""
    sizes(design, mold)
    try:
        return lengths(design, mold), ""
    except BadInput as error:
        if mold.jig:
            raise
        return None, f"no jig for the magnet: {error}"


def solids(design: Design, mold: Mold, jig: Jig) -> dict[str, Solid]:
    """Return C, a plunger and the bar in the mould's frame, the plunger over the axis x = y = 0, and the gauge.

    The gauge lies as it is printed, its tongues along y.
    """
    s = sizes(design, mold)
    return {
        "jig": _cover(mold, s, jig),
        "jig_plunger": _plunger(jig),
        "jig_bar": _bar(s, jig),
        "jig_gauge": _gauge(design, mold, s, jig),
    }


def _cover(mold: Mold, s: Sizes, jig: Jig) -> Solid:
    """Return part C: bores with chamfered mouths, room over the casts, and the letter of the pole if it has room."""
    wide, high = MOUTH
    bore = turned(
        [
            (0, 0, 0),
            (s.R, 0, 0),
            (s.R, RELIEF, 0),
            (jig.bore, RELIEF, 0),
            (jig.bore, jig.lid - high, 0),
            (jig.bore + wide, jig.lid, 0),
            (0, jig.lid, 0),
        ]
    )
    letters = [each for mark in marks(mold, s, jig) for each in strokes(*mark, mold.printing.stroke, jig.lid)]
    return cut(cover(s, jig.lid), *(moved(bore, (*centre, 0.0)) for centre in s.centres), *letters)


def _least_letter(mold: Mold) -> float:
    return 5 * mold.printing.stroke


def marks(mold: Mold, s: Sizes, jig: Jig) -> list[tuple[str, Point, float]]:
    """Return the letters of the poles that face up: letter, middle and height, each to the right of its bore.

    One letter stands for all where they are alike. There are none where one has no room.
    """
    placed = list(zip(s.centres, mold.poles, strict=True))
    if len(set(mold.poles)) == 1:
        placed = [max(placed)]
    size, letters = LETTER, (jig.pole, "S" if jig.pole == "N" else "N")
    while size >= _least_letter(mold) - 1e-9:
        away = jig.collar + MARGIN + 0.33 * size
        if all(_has_room((x + away, y), size, s, jig) for (x, y), _ in placed):
            return [(letters[pole < 0], (x + away, y), size) for (x, y), pole in placed]
        size -= 0.1
    return []


def _has_room(at: Point, size: float, s: Sizes, jig: Jig) -> bool:
    """Return whether a letter keeps its distance from the collars of all bores and from the edge of C."""
    (x, y), half = at, (0.33 * size, size / 2)
    far = [max(centre[k] for centre in s.centres) for k in (0, 1)]
    edge = math.hypot(max(x + half[0] - far[0], 0.0), max(abs(y) + half[1] - far[1], 0.0))
    gaps = [math.hypot(max(abs(u - x) - half[0], 0.0), max(abs(v - y) - half[1], 0.0)) for u, v in s.centres]
    return edge <= s.rim - MARGIN and min(gaps) >= jig.collar + MARGIN - 1e-9


def _plunger(jig: Jig) -> Solid:
    """Return a plunger on the axis, its end at the depth of the magnet's top and its collar on C."""
    import build123d as bd

    low, slope = -jig.depth, jig.shank - jig.tip
    outline = [(0, low, 0), (jig.tip, low, 0), (jig.tip, RELIEF, 0), (jig.shank, RELIEF + slope, 0)]
    collar = [(jig.shank, jig.lid, 0), (jig.collar, jig.lid, 0), (jig.collar, jig.top, 0), (0, jig.top, 0)]
    hollow = [(0, low, 0), (jig.recess, low, 0), (jig.recess, low + RECESS, 0), (jig.vent, low + RECESS, 0)]
    deep, broad = min(RECESS, jig.tip / 6), min(0.8, jig.tip / 2)
    groove = Block((jig.tip - deep, -broad / 2, low), (2 * deep, broad, jig.depth + RELIEF)).solid()
    grooves = [groove.rotate(bd.Axis.Z, turn) for turn in (30, 150, 270)]
    vent = turned([*hollow, (jig.vent, jig.top, 0), (0, jig.top, 0)])
    return cut(turned([*outline, *collar]), vent, *grooves)


def _bar(s: Sizes, jig: Jig) -> Solid:
    """Return the bar over all plungers, with a hole over each vent."""
    import build123d as bd

    low, high = jig.top, jig.top + jig.bar
    plate = with_lugs(s, slab(s, s.rim, low, high), low, high)
    holes = [bd.Solid.make_cylinder(2 * jig.vent, jig.bar, bd.Plane((*centre, low))) for centre in s.centres]
    return cut(plate, *holes)


def _gauge(design: Design, mold: Mold, s: Sizes, jig: Jig) -> Solid:
    """Return the gauge: a body that rests on B's rim, a tongue on either side, and a socket beside its letter."""
    import build123d as bd

    deep, stroke = min(design.magnet_height, 5.0), mold.printing.stroke
    broad = 1.2 * jig.tip
    width = max(2 * jig.bore, LETTER) + 3.0
    content = 2 * jig.bore + 1.5 + 0.66 * LETTER
    length = max(2 * (s.R + 0.7 * s.wall), content + 3.0)
    thick = deep + 1.2
    body = Block((-length / 2, 0, 0), (length, width, thick)).solid()
    tongues = [
        Block((-broad / 2, y, 0), (broad, size, min(broad, thick))).solid()
        for y, size in ((-jig.depth + LIMIT, jig.depth - LIMIT + 1), (width - 1, jig.depth + LIMIT + 1))
    ]
    socket = bd.Solid.make_cylinder(jig.bore, deep, bd.Plane(((2 * jig.bore - content) / 2, width / 2, 1.2)))
    at = ((content - 0.66 * LETTER) / 2, width / 2)
    # grooves in the upper edges: one on the side of the shorter tongue, two on that of the longer one
    grooves = [
        Block((x - stroke / 2, y, thick - DEPTH), (stroke, 1, DEPTH)).solid()
        for x, y in ((0, 0), (-stroke, width - 1), (stroke, width - 1))
    ]
    whole = body.fuse(*tongues).solids()[0]
    return cut(whole, socket, *strokes(jig.pole, at, LETTER, stroke, thick), *grooves)


def cast(s: Sizes) -> Solid:
    """Return what the first pour leaves in one cavity, with the magnet's pocket, on the axis, mm."""
    return cut(turned(s.cavity), turned(s.pin))


def magnet_in_pocket(design: Design, s: Sizes) -> Solid:
    """Return the magnet on the bottom of the pocket in the mould, on the axis, mm."""
    lowest = design.H - design.magnet_height / 2
    return moved(magnet(design), (0.0, 0.0, -s.pin_depth - lowest))


def screw(s: Sizes, jig: Jig) -> Solid:
    """Return a screw that clamps bar and jig onto B, with its nut, on the axis, mm."""
    thread, head, low, top = BOLT / 2, HEAD / 2, -SEAT - (HEAD - BOLT_HOLE) / 2, jig.top + jig.bar
    cone = [(0, low, 0), (head, low, 0), (thread, low + head - thread, 0), (thread, top, 0)]
    nut = [(head, top, 0), (head, top + 2.4, 0), (thread, top + 2.4, 0)]
    end = low + s.screw(top)
    return turned([*cone, *nut, (thread, end, 0), (0, end, 0)])


def checks(design: Design, mold: Mold, jig: Jig, parts: Mapping[str, Solid], B: Solid) -> list[Check]:
    """Measure C, plunger and bar on B, in the mould's frame."""
    import build123d as bd

    s = sizes(design, mold)
    C, bar = parts["jig"], parts["jig_bar"]
    x, y = s.centres[0]
    plungers = [moved(parts["jig_plunger"], (*centre, 0.0)) for centre in s.centres[:2]]
    part, volume = moved(magnet_in_pocket(design, s), (x, y, 0.0)), float(magnet(design).volume)
    pairs = [(C, B), (C, plungers[0]), (bar, C), (bar, plungers[0]), (plungers[0], part), (plungers[0], plungers[-1])]
    shared = sum(overlap(*pair) for pair in pairs if pair[0] is not pair[1])
    top = part.bounding_box().max.Z
    low = min(vertex.Z for vertex in plungers[0].vertices())
    # the bore's radius is the distance of a point on its axis; a plunger's radii are where rays from its axis end
    bore = float(bd.Vertex(x, y, jig.lid / 2).distance_to(C))
    shank, tip = (_radius(parts["jig_plunger"], z) for z in (jig.lid / 2 + RELIEF, -jig.depth / 2))
    play = (bore - design.magnet_diameter / 2, bore - shank)
    travel = s.skirt + jig.lid - s.bottom
    leaves = largest_overlap(C, B, travel, (0.0, 0.0, 1.0), overlap(C, B))
    screws = screw_overlap(s, jig.top + jig.bar, B, C, bar)
    turns = jig.diagonal - 2 * bore
    return [
        at_most("overlap of B, jig, plungers, bar and magnet", shared / volume, ROUNDING, "1"),
        at_most("overlap of the screws with B, jig and bar", screws / volume, ROUNDING, "1"),
        at_most("overlap while the jig leaves B", leaves / volume, ROUNDING, "1"),
        Check("plunger's end above the magnet's top", low - top, "|.| <= 1e-06", "mm", abs(low - top) <= 1e-6),
        *(
            Check(f"gap on each side between {name} and bore", gap, "0.05 to 0.15", "mm", 0.05 <= gap <= 0.15)
            for name, gap in zip(("magnet", "plunger"), play, strict=True)
        ),
        at_least("gap on each side between plunger and pocket", s.pin_radius - tip, 0.05),
        Check("magnet's diagonal less the bore, or it turns over", turns, "> 0", "mm", turns > 0),
    ]


def _radius(body: Solid, z: float) -> float:
    """Return how far a ray from the axis runs at this height until it leaves a body on the axis for good, mm."""
    import build123d as bd

    size = body.bounding_box(optimal=False).max.X
    ray = bd.Edge.make_line((0, 0, z), (2 * size, 0, z))
    return max(float(vertex.X) for piece in intersection(body, ray) for vertex in piece.vertices())
