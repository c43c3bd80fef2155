"""A DXF drawing of the base and of the elements' pads, for a board that is glued under the base.

The drawing is in DXF R2010, in mm, seen from above (x to the right, y upwards), with the origin on the beam's axis.
Its layers are OUTLINE (edge of the base, screw holes), BEAM (edge of the beam), HALL (bodies of elements, a circle
round each Hall plate), PADS (pads and drilled holes), AXES and TEXT.

An SS495A has three holes 1.27 mm apart (Honeywell SS490 chart: leads 0.050 in apart, 0.015 in thick). Drill, pad and
the place of S1's bend are common values: compare them with the data sheet before you order. The pads of 3-axis
chips, and what of them is unchecked, are in `geometry/hall_chips.toml`.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from geometry.fabrication.hall_elements import SS495A, chip_centres, places

if TYPE_CHECKING:
    from geometry.arrays import Point
    from geometry.base import ArrayPlan, Plan
    from geometry.design import Design

LAYERS = {"OUTLINE": 7, "BEAM": 30, "PADS": 1, "HALL": 5, "AXES": 8, "TEXT": 7}
"""Layers of the drawing, each with its AutoCAD colour index."""

LETTER = 0.8
"""Height of text, mm."""

BELOW = "Capacitor of the supply: on the underside of the board, under the chip. The base has no room for it."

NOTE = "Seen from above, mm. Pads are common values: check against your data sheet."


def board(design: Design, plan: Plan, whole: ArrayPlan | None = None) -> str:
    """Return the text of the DXF file, for the plan of the base of this design, or of the base of an array of it."""
    import ezdxf
    from ezdxf import units

    drawing = ezdxf.new("R2010", units=units.MM)
    for name, colour in LAYERS.items():
        drawing.layers.add(name, color=colour)
    space = drawing.modelspace()
    if plan.is_round:
        _circle(space, "OUTLINE", 0, 0, plan.half)
    else:
        west, south, east, north = whole.box if whole else (-plan.half, -plan.half, plan.half, plan.half)
        _rectangle(space, "OUTLINE", (west + east) / 2, (south + north) / 2, east - west, north - south)
    if plan.screw > 0:
        for x, y in whole.screws if whole else plan.screws:
            _circle(space, "OUTLINE", x, y, plan.screw / 2)
    beams = whole.array.places.tolist() if whole else [(0.0, 0.0)]
    for x, y in beams:
        _circle(space, "BEAM", x, y, design.R)
    left, low = whole.box[:2] if whole else (-plan.half, -plan.half)
    if design.hall_layout == "three":
        _leaded(space, design)
    else:
        for beam in beams:
            _chip(space, design, beam)
        _text(space, BELOW, left, low - 4.5 * LETTER)
        known = "pin 1 at the least x and y." if design.chip.pads else "whose pads are unknown."
        many = f"{design.chip_count:g} chips" if design.chip_count > 1 else "Chip"
        _text(space, f"{many}: {design.hall_layout}, {known}", left, low - 6 * LETTER)
    _axes(space, max(whole.box[2:]) if whole else plan.half)
    _text(space, NOTE, left, low - 3 * LETTER)
    text = io.StringIO()
    drawing.write(text)
    return text.getvalue()


def pads(design: Design) -> list[tuple[float, float]]:
    """Return the centres (x, y) of all pads, mm, by element, S1 or the first chip first; those of a chip by pins."""
    if design.hall_layout != "three":
        return [(x, y) for x, y, *_ in chip_pads(design)]
    p = SS495A
    # the leads of S2 and S3 go straight down; those of S1 leave towards -x and are bent down in their channel, 2 mm
    # from the body: a bend closer to it may crack it
    bend, down = -p.height / 2 - 2.0, design.f - p.depth + p.thickness / 2
    across = [k * p.pitch for k in (-1, 0, 1)]
    return [(bend, y) for y in across] + [(down, y) for y in across] + [(x, down) for x in across]


def chip_pads(design: Design) -> list[tuple[float, float, float, float]]:
    """Return the centre of each pad of the chips, and its size along x and y, mm, pin 1 of the first chip first."""
    boxes = design.chip.pads.boxes() if design.chip.pads else []
    return [(u + x, v + y, a, b) for u, v in chip_centres(design).values() for x, y, a, b in boxes]


def _leaded(space: Any, design: Design) -> None:
    p = SS495A
    middle = design.f - p.depth + p.thickness / 2
    _rectangle(space, "HALL", 0, 0, p.height, p.width)
    _rectangle(space, "HALL", middle, 0, p.thickness, p.width)
    _rectangle(space, "HALL", 0, middle, p.width, p.thickness)
    for name, (x, y, _) in places(design).items():
        _circle(space, "HALL", x, y, 0.2)
        # beside the body, where no pad lies; that of S1 has none
        beside = (x - p.depth + p.thickness + 0.15, y + 0.3) if name == "S2" else (x + 0.3, y + p.thickness)
        _text(space, name, *((x - p.height / 2 + 0.3, y - p.width / 2 + 0.3) if name == "S1" else beside))
    for x, y in pads(design):
        # a pad of 1 mm and a hole of 0.7 mm for a lead of 0.41 mm square; 0.27 mm remain between pads
        _circle(space, "PADS", x, y, 0.5)
        _circle(space, "PADS", x, y, 0.35)


def _chip(space: Any, design: Design, beam: Point) -> None:
    chip, (p, q) = design.chip, beam
    for u, v, _ in places(design).values():
        _circle(space, "HALL", p + u, q + v, 0.2)
    for x, y in chip_centres(design).values():
        _rectangle(space, "HALL", p + x, q + y, chip.body[0], chip.body[1])
        if chip.pads:
            _text(space, "1", p + x - chip.body[0] / 2 - LETTER, q + y - chip.pads.rows / 2 - LETTER / 2)
    for x, y, a, b in chip_pads(design):
        _rectangle(space, "PADS", p + x, q + y, a, b)


def _axes(space: Any, half: float) -> None:
    end, wing = half + 3.0, 0.5
    for name, (x, y) in {"x": (1.0, 0.0), "y": (0.0, 1.0)}.items():
        tip = (end * x, end * y)
        space.add_line((0, 0), tip, dxfattribs={"layer": "AXES"})
        for side in (-1, 1):
            back = (tip[0] - 2 * wing * x + side * wing * y, tip[1] - 2 * wing * y + side * wing * x)
            space.add_line(tip, back, dxfattribs={"layer": "AXES"})
        _text(space, name, tip[0] + 0.3, tip[1] + 0.3)


def _circle(space: Any, layer: str, x: float, y: float, radius: float) -> None:
    space.add_circle((x, y), radius, dxfattribs={"layer": layer})


def _rectangle(space: Any, layer: str, x: float, y: float, wide: float, tall: float) -> None:
    corners = [(x + i * wide / 2, y + j * tall / 2) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    space.add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})


def _text(space: Any, text: str, x: float, y: float) -> None:
    space.add_text(text, height=LETTER, dxfattribs={"layer": "TEXT", "insert": (x, y)})
