"""Parts A and B of the mould as solids, and their checks, in the mould's frame of `geometry.mold`. Lengths in mm.

The checks take any parts A and B, so that tests can also pass them a wrong mould. Parting is a translation: A with
its pins moves straight up, off B and off the cast. Then the cast moves straight up out of B, or the halves of a split
B move sideways off the cast.

Solid M moves along the direction w and solid S stands still. Only a face of M with a normal along w can collide, and
only with a face of S with a normal along -w that lies ahead of it and not beside it. In most cases the bounding boxes
of the faces show that no such pair exists, and so that M moves freely. Otherwise, or if the solids overlap at the
start, M is moved in steps and intersected with S. The steps include positions just behind those where two faces may
begin to touch.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from geometry.arrays import Vector
from geometry.cad import common, cut, distance, intersection, magnet, moved, overlap, turned
from geometry.design import LEAST_WALL, Design
from geometry.fabrication import engraved_marks
from geometry.fabrication.printability import Check, Process, at_least, at_most, overhangs
from geometry.mold import (
    BOLT,
    BOLT_HOLE,
    EAR_DEPTH,
    HEAD_HOLE,
    LARGEST_VENT,
    LUG,
    SEAT,
    STATION,
    Lug,
    Mold,
    Sizes,
    pours,
    sizes,
)

if TYPE_CHECKING:
    from build123d import Face, Solid

ROUNDING = 1e-9
"""Share of the cavity's volume below which an overlap or a difference counts as none."""

TURNED = ("CYLINDER", "CONE", "SPHERE", "TORUS")
"""Kinds of faces of revolution, as build123d names them."""

STEPS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Positions at which the solids are intersected, as fractions of the travel; dense at the start."""

CLOSE = 1e-6
"""Accuracy of bounding boxes and distances, mm; also the fraction of a face's extent that is skipped at both ends."""

Box = tuple[tuple[float, ...], tuple[float, ...]]


def closed_mold(design: Design, mold: Mold, beam: Solid | None = None) -> tuple[Solid, Solid]:
    """Return parts A (lid, skirt, pins, vents) and B (cup and foot) of the closed mould, mm; B is not split.

    beam : the solid of the design's beam, if it exists already. Without shrinkage the cavity is made from it, so that
        beam and cavity share faces and their triangles.
    """
    import build123d as bd

    s = sizes(design, mold)
    on_lid, on_foot, _ = engraved_marks.mold_marks(design, mold, s) if mold.marks else ([], [], "")
    lid = cover(s, s.lid)
    if s.pin_radius > 0:
        pin = turned(s.pin)
        lid = lid.fuse(*(moved(pin, (*centre, 0.0)) for centre in s.centres)).solids()[0]
    A = cut(lid, *vents(s, mold), *on_lid)

    half_x, half_y = (max(centre[k] for centre in s.centres) + s.rim for k in (0, 1))
    foot = bd.Solid.make_box(2 * half_x, 2 * half_y, s.floor, bd.Plane((-half_x, -half_y, s.bottom)))
    ears, holes = _ears(s)
    block = slab(s, s.outer, s.bottom, 0.0).fuse(foot, *ears, *(_lug(s, mold, lug) for lug in s.lugs)).solids()[0]
    holes += [_screw_hole(s, lug) for lug in s.lugs]
    cavity = beam.rotate(bd.Axis.X, 180) if beam and not mold.shrink else turned(s.cavity)
    through = tip_vents(s, mold)
    hollows = [moved(cavity, (*centre, 0.0)) for centre in s.centres]
    return A, cut(block, *hollows, *through, *on_foot, *holes, *niches(s))


def cover(s: Sizes, height: float) -> Solid:
    """Return a lid of this thickness with its skirt and its lugs, as A and the jig have them, mm."""
    block = with_lugs(s, slab(s, s.rim, -s.skirt, height), 0.0, height)
    return cut(block, slab(s, s.inner, -s.skirt, 0.0), *niches(s))


def with_lugs(s: Sizes, body: Solid, low: float, high: float) -> Solid:
    """Return a body over the whole mould with lugs between two heights, and the holes for their screws, mm."""
    import build123d as bd

    hole = s.reach[1]
    tab = bd.Solid.make_box(hole + LUG, 2 * LUG, high - low, bd.Plane((0, -LUG, low)))
    lugs = [_along(lug, tab) for lug in s.lugs]
    holes = [bd.Solid.make_cylinder(BOLT_HOLE / 2, high - low, bd.Plane((*lug.at(hole), low))) for lug in s.lugs]
    return cut(body.fuse(*lugs).solids()[0], *holes)


def niches(s: Sizes, depth: float = EAR_DEPTH) -> list[Solid]:
    """Return the hollows below z = 0 at the stations of a split B, `depth` away from the split.

    There B is as thick as in its ears, and A's skirt leaves room for the screws.
    """
    import build123d as bd

    sides = (depth, -depth - 2 * s.rim)
    corners = [(x - STATION / 2, y, s.bottom) for x in (s.ears.stations if s.ears else ()) for y in sides]
    return [bd.Solid.make_box(STATION, 2 * s.rim, -s.bottom, bd.Plane(corner)) for corner in corners]


def _lug(s: Sizes, mold: Mold, lug: Lug) -> Solid:
    """Return a lug of B without its hole: a bracket below A's skirt, or in a low mould a post on the foot."""
    import build123d as bd

    inner, hole = s.reach
    end = hole + LUG
    start = math.sqrt(max(s.outer**2 - LUG**2, 0.0)) - 0.2
    web = -s.skirt - mold.pry_gap
    # the underside of a bracket leans by 45°; at A's skirt the bracket is LUG thick
    low = min(-SEAT - HEAD_HOLE / 2, web - LUG + (end - inner))
    if low - (end - start) > s.bottom + s.floor:
        under = [(end, low), (start, low - (end - start))]
    else:
        under, web = [(end, s.bottom), (start, s.bottom)], s.bottom + s.floor
    corners = [(inner, 0.0), (end, 0.0), *under, (start, web), (inner, web)]
    face = bd.Face(bd.Wire.make_polygon([(u, LUG, z) for u, z in corners]))
    return _along(lug, bd.Solid.extrude(face, bd.Vector(0, -2 * LUG, 0)))


def _screw_hole(s: Sizes, lug: Lug) -> Solid:
    """Return the hole of a screw in a lug of B: wide enough for its head from below, then a cone as its seat.

    The cone is a little steeper than that of the head, 45°, so that its triangles too print without support.
    """
    low, wide, narrow = s.bottom, HEAD_HOLE / 2, BOLT_HOLE / 2
    top = -SEAT - 1.08 * (wide - narrow)
    corners = [(0, low, 0), (wide, low, 0), (wide, top, 0), (narrow, -SEAT, 0), (narrow, 0, 0), (0, 0, 0)]
    return moved(turned(corners), (*lug.at(s.reach[1]), 0.0))


def _along(lug: Lug, solid: Solid) -> Solid:
    """Return a solid whose x leads outwards from the rectangle of the axes, placed at a lug."""
    import build123d as bd

    return moved(solid.rotate(bd.Axis.Z, math.degrees(math.atan2(*lug.outwards[::-1]))), (*lug.root, 0.0))


def halves(design: Design, mold: Mold, B: Solid) -> dict[str, Solid]:
    """Return the halves of B by name: first the half at y > 0, then the half at y < 0."""
    import build123d as bd

    ears = sizes(design, mold).ears
    assert ears is not None
    far = 4 * ears.end
    sides = {"mold_b1": 0.0, "mold_b2": -far}
    return {
        name: cut(B, bd.Solid.make_box(2 * far, far, 2 * far, bd.Plane((-far, -far - y, -far))))
        for name, y in sides.items()
    }


def _ears(s: Sizes) -> tuple[list[Solid], list[Solid]]:
    """Return the ears of a split B, and the holes along y for its screws and pins; none of an undivided B."""
    import build123d as bd

    if s.ears is None:
        return [], []
    e, depth = s.ears, EAR_DEPTH
    ears, holes = [], []
    for side in (1, -1):
        corners = [(e.start, s.bottom), (e.end, s.bottom), (e.end, 0.0), (e.inner, 0.0), (e.inner, e.web)]
        points = [(side * x, depth, z) for x, z in (*corners, (e.start, e.web))]
        face = bd.Face(bd.Wire.make_polygon(points))
        ears.append(bd.Solid.extrude(face, bd.Vector(0, -2 * depth, 0)))
        holes += [_teardrop(side * e.bolt_x, z, BOLT_HOLE / 2) for z in e.bolt_z]
        holes.append(_teardrop(side * e.pin_x, s.bottom / 2, s.dowel_hole / 2))
    holes += [_teardrop(x, z, BOLT_HOLE / 2) for x in e.stations for z in e.bolt_z]
    return ears, holes


def _teardrop(x: float, z: float, radius: float) -> Solid:
    """Return a hole along y through both ears, with a roof of 45°, which prints without support."""
    import build123d as bd

    depth, place = EAR_DEPTH, bd.Plane((x, EAR_DEPTH, z), x_dir=(1, 0, 1), z_dir=(0, -1, 0))
    round_hole = bd.Solid.make_cylinder(radius, 2 * depth, place)
    return round_hole.fuse(bd.Solid.make_box(radius, radius, 2 * depth, place)).solids()[0]


def vents(s: Sizes, mold: Mold) -> list[Solid]:
    """Return the holes through the lid, those of all cavities, as cylinders."""
    import build123d as bd

    turns = [2 * math.pi * k / mold.vents for k in range(mold.vents)]
    places = [
        (x + s.vent_ring * math.cos(turn), y + s.vent_ring * math.sin(turn), 0.0)
        for x, y in s.centres
        for turn in turns
    ]
    return [bd.Solid.make_cylinder(s.vent_diameter / 2, s.lid, bd.Plane(place)) for place in places]


def tip_vents(s: Sizes, mold: Mold) -> list[Solid]:
    """Return the holes through the floor at the tips as cylinders, each from the foot's underside into the cavity."""
    import build123d as bd

    if not mold.tip_vent > 0:
        return []
    # up to the centre of the hemisphere, so that the whole curved opening is cut
    length = -s.L + s.R - s.bottom
    return [bd.Solid.make_cylinder(mold.tip_vent / 2, length, bd.Plane((x, y, s.bottom))) for x, y in s.centres]


def slab(s: Sizes, radius: float, low: float, high: float) -> Solid:
    """Return the solid of all points between two heights whose distance from the rectangle of the axes is <=
    `radius`.

    The corners of the rectangle are the axes of the outermost cavities.
    """
    import build123d as bd

    x, y = (max(centre[k] for centre in s.centres) for k in (0, 1))
    if x == y == 0:
        # one cavity: faces of revolution about one axis
        return turned([(0, low, 0), (radius, low, 0), (radius, high, 0), (0, high, 0)])
    if x and y:
        plane: Any = bd.RectangleRounded(2 * (x + radius), 2 * (y + radius), radius)
    else:
        plane = bd.SlotCenterToCenter(2 * max(x, y), 2 * radius, rotation=90 if y else 0)
    return moved(bd.Solid.extrude(plane.face(), bd.Vector(0, 0, high - low)), (0.0, 0.0, low))


# Checks


def checks(design: Design, mold: Mold, A: Solid, B: Solid, halves: Sequence[Solid] = ()) -> list[Check]:
    """Measure parts A and B of the closed mould, in the mould's frame, and the halves of a split B."""
    s = sizes(design, mold)
    # a block that ends inside the walls and the floor: without A and B the cast remains, plus the volume of any hole
    # in a wall; it leaves out the stations with the holes of their screws
    outline = slab(s, s.R + s.wall / 2, -s.L - s.floor / 2, 0.0)
    cavity = turned(s.cavity)
    forms = [moved(cavity, (*centre, 0.0)) for centre in s.centres]
    # plugs fill the vents at the tips up to the surfaces of the cavities
    plugs = [cut(hole, form) for hole, form in zip(tip_vents(s, mold), forms, strict=False)]
    casts = outline.cut(B, A, *plugs, *niches(s, 0.0)).solids()
    cast = max(casts, key=lambda piece: float(piece.volume))
    nominal = pours(design, mold)[0]
    error = sum(float(piece.volume) for piece in casts) / nominal / len(s.centres) - 1
    travel, closed = s.skirt + s.lid - s.bottom - s.floor, overlap(A, B)
    results = [
        _none("overlap of A and B in the closed mould", closed / nominal),
        _none("overlap of the screws with A and B", screw_overlap(s, s.lid, A, B) / nominal),
        Check("cavity volume against beam minus pin", error, f"|.| <= {ROUNDING:g}", "1", abs(error) <= ROUNDING),
        _none("overlap while A leaves B", largest_overlap(A, B, travel, (0.0, 0.0, 1.0), closed) / nominal),
        _none("overlap while A leaves the cast", largest_overlap(A, cast, travel, (0.0, 0.0, 1.0)) / nominal),
    ]
    for half, side in zip(halves, (1.0, -1.0), strict=False):
        share = largest_overlap(half, cast, 2 * s.rim, (0.0, side, 0.0)) / nominal
        results.append(_none(f"overlap while B{2 - (side > 0)} leaves the cast", share))
    if not halves:
        results.append(
            _none("overlap while the cast leaves B", largest_overlap(cast, B, travel, (0.0, 0.0, 1.0)) / nominal)
        )
    results += _walls(s, A, B, cast)
    return results + _clearances(design, s, mold, A, B)


def printable(name: str, mesh: Any, process: Process) -> list[Check]:
    """Check the overhangs of a part and, if it has a level roof, its widest bridge.

    mesh : a trimesh of the part in the pose in which it is printed, mm.
    """
    area, bridge = overhangs(mesh)
    results = [at_most(f"overhang of {name}, as printed", area, 0.0, "mm2")]
    return results + ([at_most(f"widest bridge of {name}", bridge, process.bridge, "mm")] if bridge > 0 else [])


def _none(name: str, share: float) -> Check:
    return at_most(name, share, ROUNDING, "1")


def screw_overlap(s: Sizes, top: float, *parts: Solid) -> float:
    """Return the volume that the screws of all lugs, up to a height, share with parts, mm³."""
    import build123d as bd

    places = [bd.Plane((*lug.at(s.reach[1]), s.bottom)) for lug in s.lugs]
    screws = [bd.Solid.make_cylinder(BOLT / 2, top - s.bottom, place) for place in places]
    return sum(itertools.starmap(overlap, itertools.product(screws, parts)))


def _walls(s: Sizes, A: Solid, B: Solid, cast: Solid) -> list[Check]:
    """Check the least wall of A and of B around the cavity, mm.

    The wall is the least distance from the cast to the faces of a part that do not touch the cast. Of A only the lid
    lies over the cavity, so faces of A that reach down to the base plane (skirt, pins, lugs) do not count.
    """
    lid = [face for face in A.faces() if face.bounding_box(optimal=False).min.Z > 1e-6]
    results = []
    for name, faces, bound in (("A", lid, s.lid), ("B", B.faces(), min(s.wall, s.floor))):
        least = least_gap(cast, faces, touching=False)
        results.append(at_least(f"least wall of {name} around the cavity", least if least < math.inf else 0.0, bound))
    return results


def _clearances(design: Design, s: Sizes, mold: Mold, A: Solid, B: Solid) -> list[Check]:
    """Check the silicone around the pin, the magnet in its pocket, and the vents' distance to pin and cavity, mm."""
    import build123d as bd

    x, y = s.centres[0]
    holes = vents(s, mold)
    mouths = [hole.edges().sort_by(bd.Axis.Z)[0] for hole in holes[: mold.vents]]
    results, distances = [], [mouth.distance_to(B) for mouth in mouths]
    if s.pin_radius > 0:
        column = moved(turned([(0, s.bottom, 0), (s.R, s.bottom, 0), (s.R, 0, 0), (0, 0, 0)]), (x, y, 0.0))
        pins = common(A, column)
        pin = max(pins, key=lambda piece: float(piece.volume), default=None)
        wall = 0.0 if pin is None else least_gap(pin, B.faces())
        results.append(at_least("silicone between pin and cavity", wall, LEAST_WALL))
        results.append(at_least("the same, with A shifted by the fit", wall - s.fit, 0.0))
        if pin is not None:
            distances += [mouth.distance_to(pin) for mouth in mouths]
            results += _pocket(design, mold, moved(pin, (-x, -y, 0.0)))
    # a vent is closed if A has material in it; one cut with all vents is faster than one overlap for each vent
    closed = float(A.volume) - sum(float(piece.volume) for piece in A.cut(*holes).solids())
    clearance = 0.0 if closed > ROUNDING else min(distances)
    results.append(
        at_least("distance from vents to pin and cavity wall", clearance, (1 - LARGEST_VENT) / 2 * (s.R - s.pin_top))
    )
    return results


def _pocket(design: Design, mold: Mold, pin: Solid) -> list[Check]:
    """Check how the magnet fits the pocket that the pin leaves after the silicone has shrunk.

    pin : one pin, on the axis of the mould's frame.
    """
    import build123d as bd

    pocket = pin.scale(1 - mold.shrink, about=(0, 0, 0))
    radius = design.magnet_diameter / 2
    body = magnet(design).mirror(bd.Plane.XY)
    deep = design.H + design.magnet_height / 2 + min(vertex.Z for vertex in pocket.vertices())
    # the part of a ray from the axis that lies within the pocket is the pocket's radius at the magnet's centre
    ray = bd.Edge.make_line((0, 0, -design.H), (design.D, 0, -design.H))
    gap = sum(float(edge.length) for edge in intersection(pocket, ray)) - radius
    # a pocket may grip its magnet by 0.15 of its radius, and a magnet may end up off the axis by 0.05 D
    low, high = -0.15 * radius, 0.05 * design.D
    results = [
        Check("distance of the magnet's end from the pocket's", deep, "|.| <= 1e-06", "mm", abs(deep) <= 1e-6),
        Check("gap around the magnet in its pocket", gap, f"{low:.3g} to {high:.3g}", "mm", low <= gap <= high),
    ]
    if mold.pocket_gap >= 0:
        outside = sum(float(piece.volume) for piece in body.cut(pocket).solids()) / float(body.volume)
        results.append(_none("share of the magnet outside its pocket", outside))
    return results


# Parting


def largest_overlap(moving: Solid, still: Solid, travel: float, direction: Vector, start: float = 0.0) -> float:
    """Return the largest volume that two solids share while one of them moves, mm³.

    Parameters
    ----------
    travel : distance by which it moves, mm.
    direction : unit vector of the motion: plus or minus x, y or z.
    start : volume that the solids share before the motion, mm³.
    """
    contacts = _contacts(moving, still, direction)
    if not start > 0 and not contacts:
        return 0.0
    x, y, z = direction
    shifts = {travel * step for step in STEPS} | {at + travel * step for at in contacts for step in STEPS[:3]}
    return max(overlap(moved(moving, (t * x, t * y, t * z)), still) for t in sorted(shifts) if t <= travel)


def _contacts(moving: Solid, still: Solid, direction: Vector) -> set[float]:
    """Return the travels, mm, at which two faces may begin to meet; none if the boxes exclude every collision."""
    axis = max(range(3), key=lambda k: abs(direction[k]))
    ahead = [_box(face) for face in moving.faces() if _may_face(face, axis, direction[axis])]
    opposed = [_box(face) for face in still.faces() if _may_face(face, axis, -direction[axis])]
    travels = set()
    for (low, high), (start, end) in itertools.product(ahead, opposed):
        past, before = (low[axis] - end[axis], start[axis] - high[axis])
        if direction[axis] < 0:
            past, before = start[axis] - high[axis], low[axis] - end[axis]
        # faces that are past each other, or side by side, never meet
        if past <= CLOSE and all(low[k] < end[k] and start[k] < high[k] for k in range(3) if k != axis):
            travels.add(round(max(before, 0.0), 6))
    return travels


def _may_face(face: Face, axis: int, sense: float) -> bool:
    """Return True if the face's normal may point along `sense` times the axis at some point of the face."""
    from OCP.BRepTools import BRepTools

    kind, surface = face.geom_type.name, face.geom_adaptor()
    if kind == "PLANE":
        places = [0.5]
    elif kind in TURNED and abs(surface.Axis().Direction().Coord()[axis]) > 1 - 1e-12:
        # the normal's component along the axis of revolution is constant around it, and its extremes are at the ends
        # of the meridian or, on a torus, at its top and bottom
        _, _, low, high = BRepTools.UVBounds_s(face.wrapped)
        turns = [k * math.pi / 2 for k in range(-8, 9)] if kind == "TORUS" else []
        places = [CLOSE, 1 - CLOSE, *((v - low) / (high - low) for v in turns if low < v < high)]
    else:
        return True
    return any(sense * tuple(face.normal_at(0.5, v))[axis] > 1e-9 for v in places)


def _box(face: Face) -> Box:
    box = face.bounding_box(optimal=False)
    return tuple(box.min), tuple(box.max)


def least_gap(body: Solid, faces: Iterable[Face], *, touching: bool = True) -> float:
    """Return the least distance from a body to faces, mm; infinity without faces.

    touching : False to ignore the faces that touch the body.
    """
    box, least = body.bounding_box(optimal=False), math.inf
    # the distances of boxes are lower bounds: most faces need no exact distance, which is slow
    bounds = [(distance(box, face.bounding_box(optimal=False)), face) for face in faces]
    for bound, face in sorted(bounds, key=lambda entry: entry[0]):
        if bound >= least:
            break
        gap = float(body.distance_to(face))
        if touching or gap > CLOSE:
            least = min(least, gap)
    return least
