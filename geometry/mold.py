"""The two-part casting mould: the choices of its maker, its lengths, and the volumes of both pours.

In the mould's frame the base plane is z = 0 and the tip points down, to z = -L; all lengths are in mm. Part B (the
paper's part B) is a cup on a square foot; its flat rim lies in the base plane. Part A is a lid with vents, a skirt
that fits around B, and a pin. The pin reaches from the base plane to the far side of the magnet and so leaves a
pocket for it.

The first pour fills the cavity of the closed mould. Then A is lifted off, the magnet is put into the pocket, and the
second pour covers it up to B's rim. A mould of several cavities has columns x rows of them in one B under one A, or
one for each beam of an array at its place, seen from below the base: x as in the array, y reversed.
Screws through lugs of A and B hold A down. Screws through ears across the split clamp the halves of a split B.

Shrinkage of the silicone enlarges cavity and pin by 1/(1 - shrink), but not the fit of A on B.
"""

import itertools
import math
from dataclasses import dataclass, field

from geometry.array_design import ArrayDesign
from geometry.arrays import Point
from geometry.bad_input import check_ranges, nearest, quantity
from geometry.cad import Corner, beam_volume, magnet_volume, turned_volume
from geometry.design import LEAST_WALL, BadInput, Design
from geometry.fabrication.printability import PROCESSES, Process

VISCOSITY, PRESS, CLOSING = 20.0, 20.0, 10.0
"""Viscosity of a mixed silicone, Pa s (that of stiff casting silicones is 20 to 25), force of a hand that closes the
mould, N, and the time in which the pins' surplus leaves by the vents, s."""

MOST = 100
"""Largest number of cavities for an array: as many as columns and rows allow."""

LARGEST_VENT = 0.8
"""Largest diameter of a vent, as a fraction of the annulus between pin and cavity wall."""

BOLT, BOLT_HOLE, WASHER = 3.0, 3.4, 7.0
"""Screws that clamp the mould, mm: thread M3, its clearance hole (ISO 273, medium), and diameter of a washer."""

HEAD, HEAD_HOLE = 5.5, 6.0
"""Diameter of the head of a countersunk screw M3 (ISO 2009), whose seat, a cone, prints without support, and of the
hole in which it goes up into a lug, mm."""

NUT = 3.5
"""Height of a nut M3, a washer and a turn of thread, mm."""

SCREWS = (4, 5, 6, 8, 10, 12, 16, 20, 25, 30, 35, 40, 45, 50, 60, 70, 80)
"""Usual lengths of screws, mm (ISO 888)."""

EAR_DEPTH, EAR_WALL = 5.0, 2.0
"""Thickness of an ear of one half along y, and least wall around its holes, mm."""

SPACING = 40.0
"""Largest distance of neighbouring screws along the split and along a side of the mould, mm, where cavities are not
wider than that."""

STATION = WASHER + 1.0
"""Width of a gap in the row of cavities of a split B, where screws clamp the halves, mm."""

SEAT, LUG_WALL, LUG_GAP = 3.0, 1.5, 0.5
"""Height of a lug over its screw's head, wall around its holes, and gap between the lug of B and A's skirt, mm."""

LUG = HEAD_HOLE / 2 + LUG_WALL
"""Half the width of a lug, mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mold:
    """The choices of a maker for the mould, mm. None stands for a default from process and design (see `sizes`).

    Attributes
    ----------
    process : fdm (filament) or sla (resin); it sets the defaults of fit, wall, floor and lid.
    shrink : linear shrinkage of the silicone, a fraction; cavity and pin grow by 1/(1 - shrink), the fit does not.
    pocket_gap : radial gap between magnet and pocket; negative for a pocket that grips the magnet.
    pin_edge : fillet radius at the end of the pin. It must not exceed the magnet's edge radius, or the magnet would
        not reach the bottom of the pocket.
    draft : taper of the pin, wider at the base plane, degrees. The cavity has none: a tapered beam would be another
        sensor. The skirt has none either, because its fit relies on parallel walls.
    wall : thickness of B's wall, of A's skirt, and between neighbouring cavities.
    floor : thickness of B's foot, and least thickness between the silicone and the underside.
    lid : thickness of A's lid.
    skirt : length of A's skirt below the base plane.
    fit : radial gap between skirt and B.
    pry_gap : least height of the slot between A's skirt and B's foot, where a blade lifts A.
    vents, vent_diameter : number and diameter of the holes through the lid, midway between pin and cavity wall;
        default: 1 mm, or as much as lets the pin's surplus leave in time (`CLOSING`), half the annulus at most.
    tip_vent : diameter of a hole through the floor at the tip, 0 for none; it leaves a nub to cut off.
    columns, rows : number of cavities along x and along y.
    split : 1 for a B in two halves along a row (only with rows = 1).
    jig : 1 for a jig that puts the magnets in (`geometry.fabrication.magnet_jig`), 0 for none; default: a jig where
        the magnet allows it.
    marks : 1 to engrave A on the lid, B on the foot, and the pole of the magnet that faces up in the mould (N or S).
    dowel : diameter of the two pins that align the halves of B, across the split; default: 2.
    array : whose beams have a cavity each, in place of columns and rows; None: a mould of equal sensors.

    Raises
    ------
    BadInput
        A value lies outside its range, or the process is unknown.
    """

    process: str = "fdm"
    array: ArrayDesign | None = field(default=None, metadata={"stated": "in a table of its own"})
    shrink: float = quantity(0.0, "1", 0.0, 0.2)
    pocket_gap: float = quantity(0.0, "mm", -20.0, 20.0)
    pin_edge: float | None = quantity(None, "mm", 0.0, 100.0)
    draft: float = quantity(0.0, "degrees", 0.0, 5.0)
    wall: float | None = quantity(None, "mm", 0.4, 100.0)
    floor: float | None = quantity(None, "mm", 0.4, 100.0)
    lid: float | None = quantity(None, "mm", 0.4, 100.0)
    skirt: float | None = quantity(None, "mm", 0.1, 4000.0)
    fit: float | None = quantity(None, "mm", 0.0, 2.0)
    pry_gap: float = quantity(1.0, "mm", 0.0, 100.0)
    vents: int = quantity(4, "1", 1, 24, count=True)
    vent_diameter: float | None = quantity(None, "mm", 0.01, 100.0)
    tip_vent: float = quantity(0.0, "mm", 0.0, 10.0)
    columns: int = quantity(1, "1", 1, 10, count=True)
    rows: int = quantity(1, "1", 1, 10, count=True)
    split: int = quantity(0, "1", 0, 1, count=True)
    jig: int | None = quantity(None, "1", 0, 1, count=True)
    marks: int = quantity(0, "1", 0, 1, count=True)
    dowel: float | None = quantity(None, "mm", 0.1, 100.0)

    def __post_init__(self) -> None:
        if self.process not in PROCESSES:
            raise BadInput(f"there is no process {self.process!r}: {nearest(str(self.process), PROCESSES)}")
        check_ranges(self)
        if self.split and self.rows > 1:
            raise BadInput(
                f"rows must be 1 when split is 1, as B is split along a row; got {self.rows}: set rows=1 or split=0"
            )

        if self.array is not None and not len(self.array) <= MOST:
            raise BadInput(
                f"a mould has {MOST} cavities at most; got an array of {len(self.array)} beams: cast it in "
                "several times, in a mould of columns=10"
            )

    @property
    def printing(self) -> Process:
        return PROCESSES[self.process]

    @property
    def cavities(self) -> int:
        return self.columns * self.rows if self.array is None else len(self.array)

    @property
    def poles(self) -> list[float]:
        """1 for each cavity, or -1 where the magnet lies the other way up than the design's."""
        return [1.0] * self.cavities if self.array is None else self.array.poles.tolist()


@dataclass(frozen=True, slots=True)
class Lug:
    """A place on the outline where A and B are screwed together.

    Attributes
    ----------
    root : (x, y) of the next point of the rectangle of the axes, mm.
    outwards : unit vector normal to the outline.
    """

    root: Point
    outwards: Point

    def at(self, distance: float) -> Point:
        """Return the point (x, y) at a distance from the rectangle of the axes, mm."""
        (x, y), (u, v) = self.root, self.outwards
        return x + distance * u, y + distance * v


@dataclass(frozen=True, slots=True)
class Ears:
    """The ears of a split B at x > 0, mm; those at x < 0 mirror them. Each lies on both sides of the split, y = 0.

    The screws clamp the halves over their whole height, and the pins lie across the split, where they cannot part it.

    Attributes
    ----------
    start, inner, end : x of its end inside B's wall, of its face beside A's skirt, and of its outer end.
    web : z of the ear's top between `start` and `inner`.
    bolt_x, bolt_z, pin_x : places of the holes; that of the pin is at half the height.
    stations : x of the middle of each gap in the row, where the halves are as thick as in the ears and have the same
        screws.
    """

    start: float
    inner: float
    end: float
    web: float
    bolt_x: float
    bolt_z: tuple[float, ...]
    pin_x: float
    stations: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Sizes:
    """All lengths of the mould, mm, shrinkage included and defaults filled in.

    Attributes
    ----------
    R, L : radius and length of the cavity.
    pin_radius, pin_edge : radius and fillet radius of the pin at its end; 0 without a magnet.
    pin_depth, pin_top : length of the pin below z = 0, and its radius at z = 0; 0 without a magnet.
    outer : outer radius of B around a cavity.
    floor, bottom : thickness of B's foot, and z of its underside (negative).
    skirt, inner, rim : length of A's skirt below z = 0, its inner radius and its outer radius.
    lid, wall, fit : thickness of A's lid, thickness of walls, and gap between skirt and B.
    vent_diameter, vent_ring : diameter of the vents, and radius of the circle of their centres.
    dowel, dowel_hole : diameter of the pins of a split B, and of their holes.
    ears : ears of a split B, one at each end of the split; None of an undivided one.
    lugs : places where A and B are screwed together.
    centres : (x, y) of each cavity's axis.
    """

    R: float
    L: float
    pin_radius: float
    pin_depth: float
    pin_edge: float
    pin_top: float
    outer: float
    floor: float
    bottom: float
    skirt: float
    inner: float
    rim: float
    lid: float
    wall: float
    fit: float
    vent_diameter: float
    vent_ring: float
    dowel: float
    dowel_hole: float
    ears: Ears | None
    lugs: tuple[Lug, ...]
    centres: tuple[tuple[float, float], ...]

    @property
    def pitch(self) -> float:
        """The least distance of two axes, mm; infinity for one cavity."""
        return min(itertools.starmap(math.dist, itertools.combinations(self.centres, 2)), default=math.inf)

    @property
    def reach(self) -> Point:
        """Distances of a lug's face beside A's skirt and of its screw from the rectangle of the axes, mm."""
        inner = self.rim + LUG_GAP
        return inner, inner + LUG

    def screw(self, height: float) -> float:
        """Return the length of the screws that clamp A or another part of this height onto B, mm."""
        # the head lies where the cone of its seat is as wide as itself
        return screw_length(SEAT + (HEAD - BOLT_HOLE) / 2 + height + NUT)

    @property
    def pin(self) -> list[Corner]:
        """Profile of the pin, from its lower end up to the base plane."""
        end = [(0.0, -self.pin_depth, 0.0), (self.pin_radius, -self.pin_depth, self.pin_edge)]
        return [*end, (self.pin_top, 0.0, 0.0), (0.0, 0.0, 0.0)]

    @property
    def cavity(self) -> list[Corner]:
        """Profile of the cavity, from the base plane down to the tip."""
        return [(0, 0, 0), (self.R, 0, 0), (self.R, -self.L, self.R), (0, -self.L, 0)]


def screw_length(least: float) -> float:
    """Return the shortest length of `SCREWS` that is at least `least`, mm, or that beyond the longest one.

    >>> screw_length(10.4), screw_length(123.4)
    (12, 124)
    """
    return next((length for length in SCREWS if length >= least), math.ceil(least))


def sizes(design: Design, mold: Mold) -> Sizes:
    """Return the lengths of the mould for this design, mm.

    Raises
    ------
    BadInput
        Pin, vents, skirt or dowels do not fit the design.
    """
    process, scale = mold.printing, 1 / (1 - mold.shrink)
    R, L = scale * design.R, scale * design.L
    pin_radius, pin_depth, pin_edge, pin_top, left = (scale * length for length in _pin(design, mold))
    wall = process.wall if mold.wall is None else mold.wall
    floor, lid = (wall if value is None else value for value in (mold.floor, mold.lid))
    fit = process.fit if mold.fit is None else mold.fit
    if pin_radius > 0 and not fit <= left:
        raise BadInput(
            f"fit must not exceed the {left:.3g} mm of silicone between pin and cavity, or they touch when A shifts "
            f"sideways; got {fit:g} mm: set a smaller fit, if the printer can hold it, or take a "
            "smaller magnet"
        )
    # the skirt needs 5 mm, also in the mould of a small sensor
    free = max(L, 5.0)
    skirt = _skirt(mold, free)
    vent, ring = _vents(mold, R - pin_top, pin_top, _flowing(mold, lid, R, math.pi * pin_top**2 * pin_depth))
    if not mold.tip_vent <= R:
        raise BadInput(f"tip_vent must not exceed the tip's radius = {R:g} mm; got {mold.tip_vent:g} mm")
    outer = R + wall
    inner, pitch = outer + fit, 2 * R + wall
    dowel = _dowel(mold, free + floor)
    # half the fit of the process around a pin, as around an element in its seat
    hole = dowel + process.fit
    centres = _centres(mold, pitch)
    far_x, far_y = (max(centre[k] for centre in centres) for k in (0, 1))
    ears, lugs = None, _lugs(far_x, far_y, inner + wall)
    if mold.split:
        x, stations, lugs = _row(mold.columns, pitch, wall, inner + wall)
        centres = [(each, 0.0) for each in x]
        ears = _ears(x[-1], stations, outer, inner + wall, -free - floor, -skirt - mold.pry_gap, hole)
    return Sizes(
        R=R,
        L=L,
        pin_radius=pin_radius,
        pin_depth=pin_depth,
        pin_edge=pin_edge,
        pin_top=pin_top,
        outer=outer,
        floor=floor,
        bottom=-free - floor,
        skirt=skirt,
        inner=inner,
        rim=inner + wall,
        lid=lid,
        wall=wall,
        fit=fit,
        vent_diameter=vent,
        vent_ring=ring,
        dowel=dowel,
        dowel_hole=hole,
        ears=ears,
        lugs=lugs,
        centres=tuple(centres),
    )


def _centres(mold: Mold, least: float) -> list[Point]:
    """Return the axes of the cavities, mm, about the middle, `least` or more apart.

    Those of an array stand as its beams do, or farther apart where their walls would be too thin.
    """
    if mold.array is None:
        x, y = ([least * (k - (count - 1) / 2) for k in range(count)] for count in (mold.columns, mold.rows))
        return list(itertools.product(x, y))
    places = mold.array.places * max(1.0, least / mold.array.pitch) * [1.0, -1.0]
    return [(x, y) for x, y in (places - (places.min(axis=0) + places.max(axis=0)) / 2 + 0.0).tolist()]


def _skirt(mold: Mold, free: float) -> float:
    """Return the length of A's skirt below the base plane, mm; `free` is B's height above its foot."""
    skirt = min(5.0, 0.6 * free, free - mold.pry_gap) if mold.skirt is None else mold.skirt
    if not 0 < skirt <= free - mold.pry_gap:
        name, value = ("pry_gap", mold.pry_gap) if mold.skirt is None else ("skirt", skirt)
        raise BadInput(
            f"{name} must leave skirt + pry_gap within B's free height = {free:g} mm, or A stands on the foot and "
            f"cannot be lifted; got {name} = {value:g} mm"
        )
    return skirt


def _dowel(mold: Mold, height: float) -> float:
    """Return the diameter of the pins of a split B, mm; `height` is that of its ears."""
    dowel = 2.0 if mold.dowel is None else mold.dowel  # a common parallel pin (ISO 8734)
    # the roof of 45° of a hole ends 2^(1/2) radii above its centre, here 1.5 with a margin
    most = 2 * (height - 2) / (1 + 1.5) - mold.printing.fit
    if mold.split and not dowel <= most:
        raise BadInput(
            f"dowel must not exceed {most:.3g} mm, so that its hole keeps a wall in the ears of "
            f"{height:.3g} mm; got {dowel:g} mm: set a smaller dowel or a larger floor"
        )
    return dowel


def _lugs(x: float, y: float, rim: float) -> tuple[Lug, ...]:
    """Return the lugs of an undivided mould whose outermost axes lie at +-x and +-y, mm.

    One or more are on the sides +-x, and on the sides +-y where the mould is long.
    """
    lugs = []
    for half, (u, v), least in ((y, (1.0, 0.0), 1), (x, (0.0, 1.0), 2 * (x + rim) > SPACING)):
        count = max(math.ceil(2 * half / SPACING), int(least))
        for k, side in itertools.product(range(count), (1, -1)):
            along = half * ((2 * k + 1) / count - 1)
            root = (side * (x * u + 0.0) + along * v, side * (y * v + 0.0) + along * u)
            lugs.append(Lug(root, (side * u, side * v)))
    return tuple(lugs)


def _row(
    columns: int, pitch: float, wall: float, rim: float
) -> tuple[list[float], tuple[float, ...], tuple[Lug, ...]]:
    """Return the axes of a split row of cavities along x, its stations and its lugs, two for each group of cavities.

    The row has as few stations as leave no two neighbouring screws across the split more than `SPACING` apart; at
    most one between all cavities.
    """
    wide, bolt = pitch + wall + STATION, rim + LUG_GAP + WASHER / 2
    for count in range(1, columns + 1):
        # groups of cavities that differ by one at most
        groups = [columns // count + (k < columns % count) for k in range(count)]
        spans = [pitch * (group - 1) for group in groups]
        ends = [bolt, *[wide / 2] * (count - 1)]
        apart = [start + span + end for start, span, end in zip(ends, spans, reversed(ends), strict=True)]
        if max(apart) <= SPACING:
            break
    firsts = [sum(spans[:k]) + wide * k - (sum(spans) + wide * (count - 1)) / 2 for k in range(count)]
    axes = [first + pitch * k for first, group in zip(firsts, groups, strict=True) for k in range(group)]
    middles = [first + span / 2 for first, span in zip(firsts, spans, strict=True)]
    lugs = tuple(Lug((middle, 0.0), (0.0, side)) for middle in middles for side in (1.0, -1.0))
    return axes, tuple(first - wide / 2 for first in firsts[1:]), lugs


def _ears(
    far: float, stations: tuple[float, ...], outer: float, rim: float, bottom: float, web: float, hole: float
) -> Ears:
    """Return the ears of a split B whose last cavity has its axis at x = `far`; lengths as in `Sizes`."""
    inner = far + rim + LUG_GAP
    bolt = inner + WASHER / 2
    pin = bolt + max(BOLT_HOLE, WASHER - hole) / 2 + EAR_WALL + hole / 2
    height = -bottom
    count = 1 if height < 12 else max(2, math.ceil(height / 20))
    return Ears(
        start=far + math.sqrt(max(outer**2 - EAR_DEPTH**2, 0.0)) - 0.2,
        inner=inner,
        end=pin + hole / 2 + EAR_WALL,
        web=web,
        bolt_x=bolt,
        bolt_z=tuple(bottom + height * (k + 0.5) / count for k in range(count)),
        pin_x=pin,
        stations=stations,
    )


def _flowing(mold: Mold, lid: float, R: float, surplus: float) -> float:
    """Return the diameter of vents through which the surplus of a cavity, mm³, leaves in time, by Hagen-Poiseuille.

    A pipe of diameter d and length l lets pi d^4 p / (128 mu l) pass; a hand presses with p on all cavities.
    """
    pressure = PRESS / (mold.cavities * math.pi * R**2)
    # Pa s = 1e-6 N s/mm²
    return float((128e-6 * VISCOSITY * lid * surplus / (math.pi * mold.vents * pressure * CLOSING)) ** 0.25)


def _vents(mold: Mold, annulus: float, pin: float, flowing: float) -> tuple[float, float]:
    """Return the diameter of the vents and the radius of the circle of their centres, mm.

    flowing : diameter by which the surplus leaves in time.
    """
    # half the annulus at most, but wide enough to print where the annulus has room for that
    usual = max(min(max(1.0, flowing), 0.5 * annulus), min(mold.printing.detail, LARGEST_VENT * annulus))
    vent = usual if mold.vent_diameter is None else mold.vent_diameter
    if not vent <= LARGEST_VENT * annulus:
        raise BadInput(
            f"vent_diameter must not exceed {LARGEST_VENT:g} of the annulus of {annulus:.3g} mm between pin and "
            f"cavity wall = {LARGEST_VENT * annulus:.3g} mm; got {vent:g} mm"
        )
    ring = pin + annulus / 2
    # neighbouring vents keep a fifth of their diameter between them: their centres are 1.2 diameters apart
    most = mold.vents if mold.vents < 2 else int(math.pi / math.asin(min(1.0, 0.6 * vent / ring)))
    if not mold.vents <= most:
        raise BadInput(f"vents must not exceed {most} for vent_diameter = {vent:.3g} mm; got {mold.vents}")
    return vent, ring


def _pin(design: Design, mold: Mold) -> tuple[float, float, float, float, float]:
    """Return the lengths of the pin before shrinkage, mm.

    These are the radius at its end, its depth, its fillet radius, its radius at the base plane, and the least
    thickness of silicone around it.
    """
    if not design.magnet_diameter > 0:
        return 0.0, 0.0, 0.0, 0.0, design.R
    half = design.magnet_height / 2
    radius, depth = design.magnet_diameter / 2 + mold.pocket_gap, design.H + half
    top = radius + depth * math.tan(math.radians(mold.draft))
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
    # distance of the fillet's centre from the corner along the flat end: the draft opens the corner beyond 90 degrees
    inset = edge / math.tan(math.radians(45 + mold.draft / 2))
    at_end = design.R - math.hypot(radius - inset, half - edge) - edge
    if not min(design.R - radius, at_end) >= LEAST_WALL - 1e-9:
        raise BadInput(
            f"pocket_gap = {mold.pocket_gap:g} mm and pin_edge = {edge:g} mm leave "
            f"{min(design.R - radius, at_end):.3g} mm of silicone around the pin, which needs at least "
            f"{LEAST_WALL:g} mm: lower pocket_gap or leave pin_edge out"
        )
    if not design.R - top >= LEAST_WALL - 1e-9:
        most = math.degrees(math.atan((design.R - LEAST_WALL - radius) / depth))
        raise BadInput(
            f"draft must not exceed {most:.3g} degrees, or the pin leaves less than {LEAST_WALL:g} mm of silicone at "
            f"the base plane; got {mold.draft:g} degrees"
        )
    return radius, depth, edge, top, min(design.R - top, at_end)


def pours(design: Design, mold: Mold) -> tuple[float, float]:
    """Return the volumes of liquid silicone that stay in one cast at the first and at the second pour, mm³.

    The first pour fills the cavity of the closed mould. The second fills the pocket above and around the magnet up to
    the base plane. After shrinkage both together have the volume of the design's silicone. Vents and waste are not
    included.
    """
    s, scale = sizes(design, mold), (1 - mold.shrink) ** -3
    pin = turned_volume(s.pin) if s.pin_radius > 0 else 0.0
    return scale * beam_volume(design.shape) - pin, max(0.0, pin - scale * magnet_volume(design.shape))
