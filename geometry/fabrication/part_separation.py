"""Separation of solids: collisions when one leaves another along an axis, and distances of faces. Lengths in mm.

Solid M moves along the direction w and solid S stands still. Only a face of M with a normal along w can collide, and
only with a face of S with a normal along -w that lies ahead of it and not beside it. In most cases the bounding boxes
of the faces show that no such pair exists, and so that M moves freely. Otherwise, or if the solids overlap at the
start, M is moved in steps and intersected with S. The steps include positions just behind those where two faces may
begin to touch.

The distance of two faces of revolution about one axis is the distance of their meridians in the half-plane (r, z).
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
"""Kinds of faces of revolution, as build123d names them."""

STEPS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Positions at which the solids are intersected, as fractions of the travel; dense at the start."""

CLOSE = 1e-6
"""Accuracy of bounding boxes and distances, mm; also the fraction of a face's extent that is skipped at both ends."""

NEAR = 1e-9
"""Axes that are no further apart than this count as one, mm."""

UPRIGHT = 1e-9
"""A face is parallel to an axis if the component of its unit normal along the axis is at most this."""

Box = tuple[tuple[float, ...], tuple[float, ...]]
Direction = tuple[float, float, float]


def largest_overlap(moving: Solid, still: Solid, travel: float, direction: Direction, start: float = 0.0) -> float:
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


def _contacts(moving: Solid, still: Solid, direction: Direction) -> set[float]:
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
    kind, surface = face.geom_type.name, face.geom_adaptor()
    if kind == "PLANE":
        places = [0.5]
    elif kind in TURNED and abs(surface.Axis().Direction().Coord()[axis]) > 1 - 1e-12:
        # the normal's component along the axis of revolution is constant around it, and its extremes are at the ends
        # of the meridian or, on a torus, at its top and bottom
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
    """Return the least distance from a body to faces, mm; infinity without faces.

    Parameters
    ----------
    axis : (x, y) of the vertical axis of faces of revolution, whose distances are found fast; other faces are
        allowed.
    touching : False to ignore the faces that touch the body.
    """
    import build123d as bd

    own = [meridian(face, axis) for face in body.faces()]
    outline = bd.Compound([line for line, exact in own if exact and line]) if all(exact for _, exact in own) else None
    box = body.bounding_box(optimal=False)
    bounds = []
    for face in faces:
        line, exact = meridian(face, axis) if outline else (None, False)
        # the distances of boxes and of meridians are lower bounds: most faces need no exact distance, which is slow
        bound = float(outline.distance_to(line)) if outline and line else 0.0
        bounds.append((max(bound, distance(box, face.bounding_box(optimal=False))), exact, face))
    least = math.inf
    for bound, exact, face in sorted(bounds, key=lambda entry: entry[0]):
        if bound >= least:
            break
        gap = bound if exact else float(body.distance_to(face))
        if touching or gap > CLOSE:
            least = min(least, gap)
    return least


def meridian(face: Face, axis: tuple[float, float]) -> tuple[Edge | None, bool]:
    """Return a face's meridian about a vertical axis, and whether it describes the face exactly.

    The meridian lies in the half-plane of the distance r from the axis (as x) and the height z.

    - A full turn about the axis: the meridian and True. Holes in a level face count as filled.
    - Any other level face: a line that covers at least the face's range of r, and False.
    - Any other face: None and False.
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
    place, direction = face.geom_adaptor().Axis().Location(), face.geom_adaptor().Axis().Direction()
    if math.hypot(place.X() - x, place.Y() - y) > NEAR or abs(direction.Z()) < 1 - 1e-12:
        return None, False
    # the only edge that is no circle about the axis is the seam, which is a meridian: turn it into the half-plane
    middle = seams[0] @ 0.5
    turn = math.degrees(math.atan2(middle.Y - y, middle.X - x))
    return seams[0].moved(bd.Location((-x, -y, 0.0))).rotate(bd.Axis.Z, -turn), True


def _ring(edge: Edge, x: float, y: float) -> float | None:
    """Return the radius of a full level circle about the vertical axis; None for any other edge."""
    if edge.geom_type.name != "CIRCLE" or not edge.is_closed:
        return None
    centre = edge.arc_center
    away = math.hypot(centre.X - x, centre.Y - y)
    return float(edge.radius) if away <= NEAR and abs(edge.normal().Z) > 1 - 1e-12 else None
