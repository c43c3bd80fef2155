"""The mould's checks: what is measured on the solids and on the triangles, and what each figure must keep to.

They take any two parts, so that a wrong mould can be put to them. Parting is a translation: A with its pins off B and
off the cast, straight up; then the cast out of B, straight up, or the halves of a split B off it, sideways.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from geometry.cad import common, cut, magnet, moved, overlap, turned
from geometry.design import LEAST_WALL, Design
from geometry.fabrication.mold_solids import slab, tip_vents, vents
from geometry.fabrication.part_separation import largest_overlap, least_gap
from geometry.fabrication.printability import Check, Process, at_least, at_most, overhangs
from geometry.mold import LARGEST_VENT, Mold, Sizes, pours, sizes

if TYPE_CHECKING:
    from build123d import Solid

NOTHING = 1e-9
"""Share of the cavity's volume below which an overlap or a difference counts as none."""

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
    travel, closed = s.free + s.skirt + s.lid, overlap(A, B)
    found = [
        _none("overlap of A and B in the closed mould", closed / nominal),
        Check("cavity volume against beam minus pin", error, f"|.| <= {NOTHING:g}", "1", abs(error) <= NOTHING),
        _none("overlap while A leaves B", largest_overlap(A, B, travel, UP, closed) / nominal),
        _none("overlap while A leaves the cast", largest_overlap(A, cast, travel, UP) / nominal),
    ]
    for half, side in zip(halves, (1.0, -1.0), strict=False):
        share = largest_overlap(half, cast, 2 * s.rim, (0.0, side, 0.0)) / nominal
        found.append(_none(f"overlap while B{2 - (side > 0)} leaves the cast", share))
    if not halves:
        found.append(_none("overlap while the cast leaves B", largest_overlap(cast, B, travel, UP) / nominal))
    found += _walls(s, A, B, cast)
    return found + _clearances(design, s, mold, A, B, outline)


def printable(name: str, mesh: Any, process: Process) -> list[Check]:
    """What overhangs on a part, a trimesh that stands as it is printed; a roof is named only where there is one."""
    area, bridge = overhangs(mesh)
    found = [at_most(f"overhang of {name}, as printed", area, 0.0, "mm2")]
    return found + ([at_most(f"widest bridge of {name}", bridge, process.bridge, "mm")] if bridge > 0 else [])


def _none(name: str, share: float) -> Check:
    return at_most(name, share, NOTHING, "1")


def _walls(s: Sizes, A: Solid, B: Solid, cast: Solid) -> list[Check]:
    """Least distance from the cast to the faces of a part that do not touch it, mm.

    Of A only its lid lies over the cavity: faces that reach below the base plane are left out.
    """
    box = cast.bounding_box(optimal=False)
    middle = (box.min.X + box.max.X) / 2, (box.min.Y + box.max.Y) / 2
    axis = min(s.centres, key=lambda centre: math.dist(centre, middle))
    lid = [face for face in A.faces() if face.bounding_box(optimal=False).min.Z > -1e-6]
    found = []
    for name, faces, bound in (("A", lid, s.lid), ("B", B.faces(), min(s.wall, s.floor))):
        least = least_gap(cast, faces, axis, touching=False)
        found.append(at_least(f"least wall of {name} around the cavity", least if least < math.inf else 0.0, bound))
    return found


def _clearances(design: Design, s: Sizes, mold: Mold, A: Solid, B: Solid, outline: Solid) -> list[Check]:
    """Silicone round the pin, the magnet in its pocket, and the vents' distance to pin and cavity wall, mm."""
    import build123d as bd

    x, y = s.centres[0]
    holes = vents(s, mold)
    mouths = [hole.edges().sort_by(bd.Axis.Z)[0] for hole in holes[: mold.vents]]
    found, near = [], [mouth.distance_to(B) for mouth in mouths]
    if s.pin_radius > 0:
        column = moved(turned([(0, s.bottom, 0), (s.R, s.bottom, 0), (s.R, 0, 0), (0, 0, 0)]), (x, y, 0.0))
        pins = common(A, column)
        pin = max(pins, key=lambda piece: float(piece.volume), default=None)
        wall = 0.0 if pin is None else least_gap(pin, B.faces(), s.centres[0])
        found.append(at_least("silicone between pin and cavity", wall, LEAST_WALL))
        found.append(at_least("the same, with A shifted by the fit", wall - s.fit, 0.0))
        if pin is not None:
            near += [mouth.distance_to(pin) for mouth in mouths]
            found += _pocket(design, mold, moved(pin, (-x, -y, 0.0)))
    # one cut with all of them is faster than one overlap for each
    closed = float(A.volume) - sum(float(piece.volume) for piece in A.cut(*holes).solids())
    clearance = 0.0 if closed > NOTHING else min(near)
    found.append(
        at_least("distance from vents to pin and cavity wall", clearance, (1 - LARGEST_VENT) / 2 * (s.R - s.pin_top))
    )
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
        Check("distance of the magnet's end from the pocket's", deep, "|.| <= 1e-06", "mm", abs(deep) <= 1e-6),
        Check("gap around the magnet in its pocket", gap, f"{low:.3g} to {high:.3g}", "mm", low <= gap <= high),
    ]
    if mold.pocket_gap >= 0:
        outside = sum(float(piece.volume) for piece in body.cut(pocket).solids()) / float(body.volume)
        found.append(_none("share of the magnet outside its pocket", outside))
    return found


def _plugs(s: Sizes, mold: Mold) -> list[Solid]:
    """What fills the holes at the tips up to the cavities."""
    cavity = turned(s.cavity)
    forms = [moved(cavity, (*centre, 0.0)) for centre in s.centres]
    return [cut(hole, form) for hole, form in zip(tip_vents(s, mold), forms, strict=False)]
