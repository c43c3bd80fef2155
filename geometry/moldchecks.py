"""The mould's checks: what is measured on the solids and on the triangles, and what each figure must keep to.

They take any two parts, so that a wrong mould can be put to them. Parting is a translation in steps: A with its pins
off B and off the cast, straight up; then the cast out of B, straight up, or the halves of a split B off it, sideways.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from geometry import cadfiles
from geometry.cad import common, cut, distance, magnet, overlap, turned
from geometry.design import LEAST_WALL, Design
from geometry.mold import LARGEST_VENT, Mold, Sizes, pours, sizes
from geometry.moldparts import slab, tip_vents, vents
from geometry.printing import Check, Process, at_least, at_most, overhangs

if TYPE_CHECKING:
    from build123d import Face, Solid

NOTHING = 1e-9
"""Share of the cavity's volume below which an overlap or a difference counts as none."""

STEPS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Where parting is looked at, as fractions of the travel."""

LARGEST_GRIP = 0.15
"""Largest stretch of a pocket that grips its magnet."""

LARGEST_PLAY = 0.05
"""Largest gap between magnet and pocket, as a fraction of D: so far off the axis the magnet may end up."""

UP = (0.0, 0.0, 1.0)


def checks(design: Design, mold: Mold, A: Solid, B: Solid, halves: Sequence[Solid] = ()) -> list[Check]:
    """Measure parts A and B, closed and in the mould frame, and the halves of a split B."""
    s = sizes(design, mold)
    # the outline runs inside the walls, so that only a hole through a wall could add to the cavity
    outline = slab(s, s.R + s.wall / 2, -s.L - s.floor / 2, 0.0)
    casts = outline.cut(B, A, *_plugs(s, mold)).solids()
    cast = max(casts, key=lambda piece: float(piece.volume))
    nominal = pours(design, mold)[0]
    error = sum(float(piece.volume) for piece in casts) / nominal / len(s.centres) - 1
    travel = s.free + s.skirt + s.lid
    found = [
        _none("overlap of A and B, closed", overlap(A, B) / nominal),
        Check("cavity against beam - pin", error, f"|.| <= {NOTHING:g}", "1", abs(error) <= NOTHING),
        _none("overlap while A leaves B", _worst(A, B, travel) / nominal),
        _none("overlap while A leaves the cast", _worst(A, cast, travel) / nominal),
    ]
    for half, side in zip(halves, (1.0, -1.0), strict=False):
        share = _worst(half, cast, 2 * s.rim, (0.0, side, 0.0)) / nominal
        found.append(_none(f"overlap while B{2 - (side > 0)} leaves the cast", share))
    if not halves:
        found.append(_none("overlap while the cast leaves B", _worst(cast, B, travel) / nominal))
    found += _walls(s, A, B, cast)
    return found + _clearances(design, s, mold, A, B, outline)


def printable(name: str, part: Solid, process: Process, tolerance: float = cadfiles.TOLERANCE) -> list[Check]:
    """What overhangs on a part that stands as it is printed; a roof is named only where there is one."""
    area, bridge = overhangs(cadfiles.triangulated(part, tolerance))
    found = [at_most(f"overhang of {name}, as printed", area, 0.0, "mm2")]
    return found + ([at_most(f"widest bridge of {name}", bridge, process.bridge, "mm")] if bridge > 0 else [])


def _none(name: str, share: float) -> Check:
    return at_most(name, share, NOTHING, "1")


def _worst(moving: Solid, still: Solid, travel: float, way: tuple[float, float, float] = UP) -> float:
    """Largest overlap on the way, mm³."""
    import build123d as bd

    places = [tuple(travel * step * part for part in way) for step in STEPS]
    return max(overlap(moving.moved(bd.Location(place)), still) for place in places)


def _walls(s: Sizes, A: Solid, B: Solid, cast: Solid) -> list[Check]:
    """Least distance from the cast to the faces of a part that do not touch it, mm.

    Of A only its lid lies over the cavity: faces that reach below the base plane are left out.
    """

    def apart(face: Face) -> float:
        return distance(box, face.bounding_box(optimal=False))

    box = cast.bounding_box(optimal=False)
    lid = [face for face in A.faces() if face.bounding_box(optimal=False).min.Z > -1e-6]
    found = []
    for name, faces, bound in (("A", lid, s.lid), ("B", B.faces(), min(s.wall, s.floor))):
        least = math.inf
        # the boxes' distance is never more than the faces': most faces need no closer look
        for face in sorted(faces, key=apart):
            if apart(face) < least and (wall := cast.distance_to(face)) > 1e-6:
                least = min(least, wall)
        found.append(at_least(f"least wall of {name} over the cavity", least if least < math.inf else 0.0, bound))
    return found


def _clearances(design: Design, s: Sizes, mold: Mold, A: Solid, B: Solid, outline: Solid) -> list[Check]:
    """Silicone round the pin, the magnet in its pocket, and the vents' distance to pin and cavity wall, mm."""
    import build123d as bd

    x, y = s.centres[0]
    holes = vents(s, mold)
    mouths = [hole.edges().sort_by(bd.Axis.Z)[0] for hole in holes[: mold.vents]]
    found, near = [], [mouth.distance_to(B) for mouth in mouths]
    if s.pin_radius > 0:
        column = turned([(0, s.bottom, 0), (s.R, s.bottom, 0), (s.R, 0, 0), (0, 0, 0)]).moved(bd.Location((x, y, 0)))
        pins = common(A, column)
        pin = max(pins, key=lambda piece: float(piece.volume), default=None)
        wall = 0.0 if pin is None else pin.distance_to(B)
        found.append(at_least("silicone between pin and cavity", wall, LEAST_WALL))
        found.append(at_least("the same, A pushed aside by the fit", wall - s.fit, 0.0))
        if pin is not None:
            near += [mouth.distance_to(pin) for mouth in mouths]
            found += _pocket(design, mold, pin.moved(bd.Location((-x, -y, 0))))
    # one cut with all of them is faster than one overlap for each
    closed = float(A.volume) - sum(float(piece.volume) for piece in A.cut(*holes).solids())
    clearance = 0.0 if closed > NOTHING else min(near)
    found.append(at_least("vents to pin and cavity wall", clearance, (1 - LARGEST_VENT) / 2 * (s.R - s.pin_top)))
    return found


def _pocket(design: Design, mold: Mold, pin: Solid) -> list[Check]:
    """How the magnet fits the pocket that a pin leaves once the silicone has shrunk."""
    import build123d as bd

    pocket = pin.scale(1 - mold.shrink, about=(0, 0, 0))
    radius = design.magnet_diameter / 2
    body = magnet(design).mirror(bd.Plane.XY)
    deep = design.H + design.magnet_height / 2 + min(vertex.Z for vertex in pocket.vertices())
    ray = bd.Edge.make_line((0, 0, -design.H), (design.D, 0, -design.H))
    seen = pocket.intersect(ray)
    width = sum(float(edge.length) for edge in (seen if isinstance(seen, list) else [seen] if seen else []))
    gap = width - radius
    low, high = -LARGEST_GRIP * radius, LARGEST_PLAY * design.D
    found = [
        Check("magnet's end over the pocket's", deep, "|.| <= 1e-06", "mm", abs(deep) <= 1e-6),
        Check("gap round the magnet in its pocket", gap, f"{low:.3g} to {high:.3g}", "mm", low <= gap <= high),
    ]
    if mold.pocket_gap >= 0:
        outside = sum(float(piece.volume) for piece in body.cut(pocket).solids()) / float(body.volume)
        found.append(_none("magnet beside its pocket", outside))
    return found


def _plugs(s: Sizes, mold: Mold) -> list[Solid]:
    """What fills the holes at the tips up to the cavities."""
    import build123d as bd

    cavity = turned(s.cavity)
    moved = [cavity.moved(bd.Location((*centre, 0.0))) for centre in s.centres]
    return [cut(hole, form) for hole, form in zip(tip_vents(s, mold), moved, strict=False)]
