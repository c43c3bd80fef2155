"""Parts A and B of the mould as solids, in the mould's frame of `geometry.mold`. All lengths are in mm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from geometry.cad import cut, moved, turned
from geometry.design import Design
from geometry.fabrication import engraved_marks
from geometry.mold import BOLT_HOLE, EAR_DEPTH, Mold, Sizes, sizes

if TYPE_CHECKING:
    from build123d import Solid


def parts(design: Design, mold: Mold, beam: Solid | None = None) -> tuple[Solid, Solid]:
    """Return parts A (lid, skirt, pins, vents) and B (cup and foot) of the closed mould, mm; B is not split.

    Parameters
    ----------
    beam : the solid of the design's beam, if it exists already. Without shrinkage the cavity is made from it, so that
        beam and cavity share faces and their triangles.

    Raises
    ------
    BadInput
        See `sizes`.
    """
    import build123d as bd

    s = sizes(design, mold)
    on_lid, on_foot, _ = engraved_marks.mold_marks(design, mold, s) if mold.marks else ([], [], "")
    lid = cut(slab(s, s.rim, -s.skirt, s.lid), slab(s, s.inner, -s.skirt, 0.0))
    if s.pin_radius > 0:
        pin = turned(s.pin)
        lid = lid.fuse(*(moved(pin, (*centre, 0.0)) for centre in s.centres)).solids()[0]
    A = cut(lid, *vents(s, mold), *on_lid)

    half_x, half_y = (max(centre[k] for centre in s.centres) + s.rim for k in (0, 1))
    foot = bd.Solid.make_box(2 * half_x, 2 * half_y, s.floor, bd.Plane((-half_x, -half_y, s.bottom)))
    ears, holes = _ears(s)
    block = slab(s, s.outer, s.bottom, 0.0).fuse(foot, *ears).solids()[0]
    cavity = beam.rotate(bd.Axis.X, 180) if beam and not mold.shrink else turned(s.cavity)
    through = tip_vents(s, mold)
    return A, cut(block, *(moved(cavity, (*centre, 0.0)) for centre in s.centres), *through, *on_foot, *holes)


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
    """Return the ears of a split B, and the holes in them for screws and pins, along y; none of an undivided B."""
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
        holes.append(_teardrop(side * e.pin_x, e.pin_z, s.dowel_hole / 2))
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
    points: list[tuple[float, float, float]] = []
    edges: list[Any] = []
    for k, (cx, cy) in enumerate(((x, y), (-x, y), (-x, -y), (x, -y))):
        first, middle, last = (
            (cx + radius * math.cos(turn), cy + radius * math.sin(turn), low)
            for turn in (math.pi / 2 * (k + part) for part in (0.0, 0.5, 1.0))
        )
        if points and math.dist(points[-1], first) > 1e-9:
            edges.append(bd.Edge.make_line(points[-1], first))
        edges.append(bd.Edge.make_three_point_arc(first, middle, last))
        points += [first, last]
    if math.dist(points[-1], points[0]) > 1e-9:
        edges.append(bd.Edge.make_line(points[-1], points[0]))
    return bd.Solid.extrude(bd.Face(bd.Wire(edges)), bd.Vector(0, 0, high - low))
