"""A two-part casting mould for the sensor, after part A (plug) and part B (cavity) of the paper.

Mould frame, mm: the base plane is z = 0 and the tip points down, to z = -L. B is a cup whose flat rim lies in the
base plane, on a square foot. A is a lid with a skirt outside B, vents, and a pin from the base plane to the far
side of the magnet, which leaves the pocket for it. First pour: the cavity of the closed mould. Then A comes off
upwards, the magnet goes into the pocket, and the second pour fills the pocket up to the base plane.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from geometry.cad import beam_volume, common, cut, magnet_volume, overlap, rounded_cylinder_volume, turned
from geometry.design import LEAST_WALL, BadInput, Design

if TYPE_CHECKING:
    from build123d import Solid

LARGEST_VENT = 0.8
"""Largest diameter of a vent, as a fraction of the annulus between pin and cavity wall."""

NOTHING = 1e-9
"""Share of the cavity's volume below which an overlap or a difference counts as none."""

STEPS = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
"""Where demoulding is looked at, as fractions of the travel."""

RANGES = {
    "shrink": (0.0, 0.2, ""),
    "pocket_gap": (-20.0, 20.0, " mm"),
    "pin_edge": (0.0, 100.0, " mm"),
    "wall": (0.4, 100.0, " mm"),
    "floor": (0.4, 100.0, " mm"),
    "lid": (0.4, 100.0, " mm"),
    "skirt": (0.1, 4000.0, " mm"),
    "fit": (0.0, 2.0, " mm"),
    "vents": (1, 24, ""),
    "vent_diameter": (0.01, 100.0, " mm"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mold:
    """What a maker chooses about the mould, mm; None means: taken from the design (see `sizes`).

    Attributes
    ----------
    shrink : linear shrinkage of the silicone, a fraction; cavity and pin grow by 1/(1 - shrink), the fit does not.
    pocket_gap : radial gap between magnet and pocket; negative for a pocket that grips the magnet.
    pin_edge : fillet at the end of the pin; at most the magnet's own, so that the magnet goes down to the bottom.
    wall : thickness of B's wall and of A's skirt.
    floor : silicone tip to the bench, and height of B's foot.
    lid : thickness of A's lid.
    skirt : how far A reaches down outside B.
    fit : radial gap between skirt and B (0.2 for filament printing, 0.1 for resin).
    vents, vent_diameter : holes through the lid, in the middle of the annulus between pin and cavity wall.

    Raises
    ------
    BadInput
        A value lies outside its range.
    """

    shrink: float = 0.0
    pocket_gap: float = 0.0
    pin_edge: float | None = None
    wall: float = 3.0
    floor: float = 3.0
    lid: float = 3.0
    skirt: float | None = None
    fit: float = 0.2
    vents: int = 4
    vent_diameter: float | None = None

    def __post_init__(self) -> None:
        for spec in dataclasses.fields(self):
            value: object = getattr(self, spec.name)
            low, high, unit = RANGES[spec.name]
            if value is None and spec.default is None:
                continue
            if isinstance(value, bool) or not isinstance(value, int if spec.name == "vents" else (int, float)):
                kind = "a whole number" if spec.name == "vents" else "a number"
                raise BadInput(f"{spec.name} must be {kind}; got {value!r}")
            if not low <= value <= high:
                raise BadInput(f"{spec.name} must lie between {low:g} and {high:g}{unit}; got {value:g}{unit}")


@dataclass(frozen=True, slots=True)
class Sizes:
    """The mould's lengths, mm, shrinkage included and nothing left open.

    Attributes
    ----------
    R, L : radius and length of the cavity.
    pin_radius, pin_depth, pin_edge : the pin; zeros without a magnet.
    outer, free : radius of B, and its height above the foot.
    skirt : how far A reaches down outside B, `inner` its inner radius.
    vent_diameter, vent_ring : the vents, and the radius of the circle of their centres.
    """

    R: float
    L: float
    pin_radius: float
    pin_depth: float
    pin_edge: float
    outer: float
    free: float
    skirt: float
    inner: float
    vent_diameter: float
    vent_ring: float


@dataclass(frozen=True, slots=True)
class Check:
    """A figure measured on the solids, and what it must keep to."""

    name: str
    value: float
    bound: str
    unit: str
    passed: bool


def sizes(design: Design, mold: Mold) -> Sizes:
    """The lengths of the mould for this design, mm.

    Raises
    ------
    BadInput
        A parameter does not go with the design: pin, vents or skirt do not fit.
    """
    scale = 1 / (1 - mold.shrink)
    R, L = scale * design.R, scale * design.L
    pin_radius, pin_depth, pin_edge = (scale * length for length in _pin(design, mold))
    annulus = R - pin_radius
    skirt = min(5.0, 0.6 * L) if mold.skirt is None else mold.skirt
    if not skirt < L:
        raise BadInput(
            f"skirt must be shorter than B's free height = {L:g} mm, or it stands on the foot; got {skirt:g}"
        )
    vent = min(1.0, 0.5 * annulus) if mold.vent_diameter is None else mold.vent_diameter
    if not vent <= LARGEST_VENT * annulus:
        raise BadInput(
            f"vent_diameter must not exceed {LARGEST_VENT:g} of the annulus of {annulus:.3g} mm between pin and "
            f"cavity wall = {LARGEST_VENT * annulus:.3g} mm; got {vent:g} mm"
        )
    ring = pin_radius + annulus / 2
    most = mold.vents if mold.vents < 2 else int(math.pi / math.asin(min(1.0, 0.6 * vent / ring)))
    if not mold.vents <= most:
        raise BadInput(f"vents must not exceed {most} for vent_diameter = {vent:.3g} mm; got {mold.vents}")
    outer = R + mold.wall
    return Sizes(R, L, pin_radius, pin_depth, pin_edge, outer, L, skirt, outer + mold.fit, vent, ring)


def _pin(design: Design, mold: Mold) -> tuple[float, float, float]:
    """Radius, depth and fillet of the pin at the design's own scale, mm; zeros without a magnet."""
    if not design.magnet_diameter > 0:
        return 0.0, 0.0, 0.0
    half = design.magnet_height / 2
    radius = design.magnet_diameter / 2 + mold.pocket_gap
    if not radius >= design.magnet_diameter / 4:
        raise BadInput(
            f"pocket_gap must not be less than -{design.magnet_diameter / 4:g} mm, a quarter of the magnet's "
            f"diameter; got {mold.pocket_gap:g} mm"
        )
    edge = min(design.magnet_edge_radius, radius) if mold.pin_edge is None else mold.pin_edge
    if not edge <= min(design.magnet_edge_radius, radius):
        raise BadInput(
            f"pin_edge must not exceed the magnet's edge radius = {design.magnet_edge_radius:g} mm, "
            f"nor the pin's radius = {radius:g} mm, or the magnet stands on the fillet; got {edge:g} mm"
        )
    wall = min(design.R - radius, design.R - math.hypot(radius - edge, half - edge) - edge)
    if not wall >= LEAST_WALL - 1e-9:
        raise BadInput(
            f"pocket_gap = {mold.pocket_gap:g} mm and pin_edge = {edge:g} mm make a pin that leaves {wall:.3g} mm of "
            f"silicone and must leave {LEAST_WALL:g} mm: lower pocket_gap or leave pin_edge out"
        )
    return radius, design.H + half, edge


def parts(design: Design, mold: Mold) -> tuple[Solid, Solid]:
    """Parts A (lid, skirt, pin, vents) and B (cup, foot), closed, in the mould frame, mm.

    Raises
    ------
    BadInput
        See `sizes`.
    """
    import build123d as bd

    s = sizes(design, mold)
    rim = s.inner + mold.wall
    profile = [(0.0, mold.lid, 0.0), (rim, mold.lid, 0.0), (rim, -s.skirt, 0.0), (s.inner, -s.skirt, 0.0)]
    profile.append((s.inner, 0.0, 0.0))
    if s.pin_radius > 0:
        profile += [(s.pin_radius, 0.0, 0.0), (s.pin_radius, -s.pin_depth, s.pin_edge)]
    profile.append((0.0, -s.pin_depth, 0.0))
    lid = cut(turned(profile), *_vents(s, mold))

    bottom = -s.L - mold.floor
    cup = turned([(0, bottom, 0), (s.outer, bottom, 0), (s.outer, 0, 0), (0, 0, 0)])
    foot = bd.Solid.make_box(2 * rim, 2 * rim, mold.floor, bd.Plane((-rim, -rim, bottom)))
    return lid, cut(cup.fuse(foot).solids()[0], _cavity(s))


def _cavity(s: Sizes) -> Solid:
    return turned([(0, 0, 0), (s.R, 0, 0), (s.R, -s.L, s.R), (0, -s.L, 0)])


def _vents(s: Sizes, mold: Mold) -> list[Solid]:
    import build123d as bd

    turns = [2 * math.pi * k / mold.vents for k in range(mold.vents)]
    centres = [(s.vent_ring * math.cos(turn), s.vent_ring * math.sin(turn), 0.0) for turn in turns]
    return [bd.Solid.make_cylinder(s.vent_diameter / 2, mold.lid, bd.Plane(centre)) for centre in centres]


def pours(design: Design, mold: Mold) -> tuple[float, float]:
    """Liquid silicone that stays in the part at the first and at the second pour, mm³; vents and waste not included.

    First the closed mould's cavity; then, with the magnet in its pocket, the rest up to the base plane. After
    shrinkage both together are the design's silicone.
    """
    scale = (1 - mold.shrink) ** -3
    radius, depth, edge = _pin(design, mold)
    pin = rounded_cylinder_volume(radius, depth, edge, edges=1)
    return scale * (beam_volume(design.shape) - pin), scale * max(0.0, pin - magnet_volume(design.shape))


def checks(design: Design, mold: Mold, A: Solid, B: Solid) -> list[Check]:
    """Measure two parts, which need not come from `parts`, against what the design needs.

    Demoulding is straight up, +z: A with its pin from B and from the cast, then the cast from B.
    """
    s = sizes(design, mold)
    # the outline runs inside the walls, so that only a hole through a wall could add to the cavity
    outline_radius, outline_low = s.R + mold.wall / 2, -s.L - mold.floor / 2
    outline = turned([(0, outline_low, 0), (outline_radius, outline_low, 0), (outline_radius, 0, 0), (0, 0, 0)])
    pieces = outline.cut(B, A).solids()
    cast = max(pieces, key=lambda piece: float(piece.volume))
    nominal = pours(design, mold)[0]
    error = sum(float(piece.volume) for piece in pieces) / nominal - 1
    travel = s.L + s.skirt + mold.lid
    return [
        _none("overlap of A and B, closed", overlap(A, B) / nominal),
        Check("cavity against beam - pin", error, f"|.| <= {NOTHING:g}", "1", abs(error) <= NOTHING),
        _none("overlap while A leaves B", _worst(A, B, travel) / nominal),
        _none("overlap while A leaves the cast", _worst(A, cast, travel) / nominal),
        _none("overlap while the cast leaves B", _worst(cast, B, travel) / nominal),
        *_walls(mold, A, B, cast),
        *_clearances(s, mold, A, B, outline),
    ]


def _none(name: str, share: float) -> Check:
    return Check(name, share, f"<= {NOTHING:g}", "1", share <= NOTHING)


def _worst(moving: Solid, still: Solid, travel: float) -> float:
    """Largest overlap on the way up, mm³."""
    import build123d as bd

    return max(overlap(moving.moved(bd.Location((0, 0, travel * step))), still) for step in STEPS)


def _least(name: str, value: float, bound: float) -> Check:
    return Check(name, value, f">= {bound:g}", "mm", value >= bound * (1 - 1e-6))


def _walls(mold: Mold, A: Solid, B: Solid, cast: Solid) -> list[Check]:
    """Distance from the cast to the faces of a part that do not touch it, mm."""
    found = []
    for name, part, bound in (("A", A, mold.lid), ("B", B, min(mold.wall, mold.floor))):
        far = [distance for face in part.faces() if (distance := cast.distance_to(face)) > 1e-6]
        found.append(_least(f"least wall of {name} over the cavity", min(far, default=0.0), bound))
    return found


def _clearances(s: Sizes, mold: Mold, A: Solid, B: Solid, outline: Solid) -> list[Check]:
    """Silicone round the pin, and the vents' distance to pin and cavity wall, mm."""
    vents = _vents(s, mold)
    closed = sum(overlap(vent, A) for vent in vents)
    near = [vent.distance_to(B) for vent in vents]
    found = []
    if s.pin_radius > 0:
        pin = common(A, outline)
        near += [vent.distance_to(piece) for vent in vents for piece in pin]
        wall = min((piece.distance_to(B) for piece in pin), default=0.0)
        found.append(_least("silicone between pin and cavity", wall, LEAST_WALL))
        found.append(_least("the same, A pushed aside by the fit", wall - mold.fit, 0.0))
    clearance = 0.0 if closed > NOTHING else min(near)
    found.append(_least("vents to pin and cavity wall", clearance, (1 - LARGEST_VENT) / 2 * (s.R - s.pin_radius)))
    return found
