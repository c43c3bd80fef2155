"""How solids part: what one meets when it leaves another along an axis, and how far faces are apart. Lengths mm.

A solid leaves another freely along w if every face of it that looks along w lies beyond all faces of the other that
look back, or beside them: on a line along w, the end of one solid cannot meet the start of another that it has
passed. Only where they overlap before, or the boxes of two such faces leave it open, are they moved in steps and
intersected, just after two faces may begin to meet and in between.

Faces of revolution about one axis are as far apart as their meridians in the half plane (r, z).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from geometry.cad import distance, moved, overlap

if TYPE_CHECKING:
    from build123d import Edge, Face, Solid

TURNED = ("CYLINDER", "CONE", "SPHERE", "TORUS")
"""Kinds of faces that turn about an axis."""

STEPS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Where parting is looked at, as fractions of the travel."""

CLOSE = 1e-6
"""Boxes and distances are trusted to this, mm; and so much of a face's extent is not looked at, at either end."""

NEAR = 1e-9
"""Axes that are no further apart than this are one, mm."""

UPRIGHT = 1e-9
"""A face whose normal has less than this along an axis is parallel to it."""

Box = tuple[tuple[float, ...], tuple[float, ...]]
Way = tuple[float, float, float]


def largest_overlap(moving: Solid, still: Solid, travel: float, way: Way, start: float = 0.0) -> float:
    """Largest volume that two solids share while one moves, mm³.

    Parameters
    ----------
    travel : how far it moves, mm.
    way : a unit vector along x, y or z, to either side.
    start : volume that they share before, mm³.
    """
    contacts = _contacts(moving, still, way)
    if not start > 0 and not contacts:
        return 0.0
    x, y, z = way
    shifts = {travel * step for step in STEPS} | {at + travel * step for at in contacts for step in STEPS[:3]}
    return max(overlap(moved(moving, (t * x, t * y, t * z)), still) for t in sorted(shifts) if t <= travel)


def _contacts(moving: Solid, still: Solid, way: Way) -> set[float]:
    """Where on the way two faces may begin to meet, mm; none if the faces alone tell that nothing is met."""
    axis = max(range(3), key=lambda k: abs(way[k]))
    ahead = [_box(face) for face in moving.faces() if _looks(face, axis, way[axis])]
    back = [_box(face) for face in still.faces() if _looks(face, axis, -way[axis])]
    found = set()
    for (low, high), (start, end) in itertools.product(ahead, back):
        past, before = (low[axis] - end[axis], start[axis] - high[axis])
        if way[axis] < 0:
            past, before = start[axis] - high[axis], low[axis] - end[axis]
        if past <= CLOSE and all(low[k] < end[k] and start[k] < high[k] for k in range(3) if k != axis):
            found.add(round(max(before, 0.0), 6))
    return found


def _looks(face: Face, axis: int, sense: float) -> bool:
    """Whether a face may look to this side of an axis somewhere."""
    kind, surface = face.geom_type.name, face.geom_adaptor()
    if kind == "PLANE":
        places = [0.5]
    elif kind in TURNED and abs(surface.Axis().Direction().Coord()[axis]) > 1 - 1e-12:
        # the normal's part along the axis of revolution is the same all round, and no other than at the ends of the
        # meridian or, on a ring, at its top and bottom
        _, _, low, high = face._uv_bounds()
        turns = [k * math.pi / 2 for k in range(-8, 9)] if kind == "TORUS" else []
        places = [CLOSE, 1 - CLOSE, *((v - low) / (high - low) for v in turns if low < v < high)]
    else:
        return True
    return any(sense * tuple(face.normal_at(0.5, v))[axis] > UPRIGHT for v in places)


def _box(face: Face) -> Box:
    box = face.bounding_box(optimal=False)
    return tuple(box.min), tuple(box.max)


def least_gap(body: Solid, faces: Iterable[Face], axis: tuple[float, float], *, touching: bool = True) -> float:
    """Least distance from a body to faces, mm; infinite without any.

    Parameters
    ----------
    axis : x and y of the upright axis about which faces of revolution are told; others may be anywhere.
    touching : False to leave out the faces that touch the body.
    """
    import build123d as bd

    own = [meridian(face, axis) for face in body.faces()]
    outline = bd.Compound([line for line, exact in own if exact and line]) if all(exact for _, exact in own) else None
    box = body.bounding_box(optimal=False)
    bounds = []
    for face in faces:
        line, exact = meridian(face, axis) if outline else (None, False)
        # neither the boxes' distance nor the meridians' is more than the faces': most need no closer look
        bound = float(outline.distance_to(line)) if outline and line else 0.0
        bounds.append((max(bound, distance(box, face.bounding_box(optimal=False))), exact, face))
    least = math.inf
    for bound, exact, face in sorted(bounds, key=lambda known: known[0]):
        if bound >= least:
            break
        gap = bound if exact else float(body.distance_to(face))
        if touching or gap > CLOSE:
            least = min(least, gap)
    return least


def meridian(face: Face, axis: tuple[float, float]) -> tuple[Edge | None, bool]:
    """Where a face lies in the half plane of the distance from an upright axis, x, and height, z; and if that is all.

    A line and True for a full turn about the axis (holes in a level face are taken as filled); a line that reaches
    too far and False for any other level face; None and False for all other faces.
    """
    import build123d as bd

    x, y = axis
    kind, edges = face.geom_type.name, face.edges()
    if kind == "PLANE":
        if abs(face.normal_at().Z) < 1 - 1e-12:
            return None, False
        rings = [[_ring(edge, x, y) for edge in wire.edges()] for wire in (face.outer_wire(), *face.inner_wires())]
        inner = max((ring for wire in rings[1:] for ring in wire if ring is not None), default=0.0)
        box = face.bounding_box(optimal=False)
        far = math.hypot(max(x - box.min.X, box.max.X - x), max(y - box.min.Y, box.max.Y - y))
        whole = len(rings[0]) == 1 and rings[0][0] is not None
        z = face.vertices()[0].Z
        return bd.Edge.make_line((inner, 0.0, z), (rings[0][0] if whole else far, 0.0, z)), whole
    seams = [edge for edge in edges if _ring(edge, x, y) is None]
    if kind not in TURNED or len(seams) != 1:
        return None, False
    place, way = face.geom_adaptor().Axis().Location(), face.geom_adaptor().Axis().Direction()
    if math.hypot(place.X() - x, place.Y() - y) > NEAR or abs(way.Z()) < 1 - 1e-12:
        return None, False
    middle = seams[0] @ 0.5
    turn = math.degrees(math.atan2(middle.Y - y, middle.X - x))
    return seams[0].moved(bd.Location((-x, -y, 0.0))).rotate(bd.Axis.Z, -turn), True


def _ring(edge: Edge, x: float, y: float) -> float | None:
    """The radius of a full level circle about the upright axis; None for any other edge."""
    if edge.geom_type.name != "CIRCLE" or not edge.is_closed:
        return None
    centre = edge.arc_center
    away = math.hypot(centre.X - x, centre.Y - y)
    return float(edge.radius) if away <= NEAR and abs(edge.normal().Z) > 1 - 1e-12 else None
