"""The files of a circuit board: KiCad project, Gerber and Excellon, parts and their places, picture and page.

KiCad's board is an S-expression in the format of KiCad 6 (20211014), which later versions read. Gerber and Excellon
files are written by gerbonara. Their origin is the beam's axis, as is the drill and place origin of the board in
KiCad, whose y axis points downwards.
"""

from __future__ import annotations

import io
import itertools
import json
import math
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.arrays import Point
from geometry.base import ArrayPlan, Plan
from geometry.design import Design
from geometry.messages import Progress
from studies.fabrication import parts_list
from studies.fabrication.array_board import SWITCH
from studies.fabrication.board_layers import (
    CLEARANCE,
    DRILL,
    EDGE,
    HOLE_GAP,
    HOLES_APART,
    LETTER,
    MASK,
    PEN,
    POUR_GAP,
    SLIVER,
    SPOKE,
    TRACK,
    VIA,
    Board,
    Pad,
    Part,
    copper,
)
from studies.fabrication.circuit_board import PULL_UP
from studies.fabrication.kicad_schematic import (
    Expression,
    footprint_of,
    identity,
    path_of,
    quoted,
    schematic,
    text_of,
)
from studies.fabrication.sensor_solids import FabricationChoices
from studies.output import atomic_files, page_templates
from studies.output.records import FlatRow
from studies.output.result import Result, Table, Writer

if TYPE_CHECKING:
    from gerbonara import LayerStack
    from shapely import Polygon

NAME = "sensor"
"""Name of the project and first part of the names of the Gerber files."""
SHEET = 100.0
"""Place of the beam's axis on KiCad's sheet along x and y, mm."""
LAYERS = {
    0: ("F.Cu", "signal"),
    31: ("B.Cu", "signal"),
    34: ("B.Paste", "user"),
    35: ("F.Paste", "user"),
    36: ("B.SilkS", "user"),
    37: ("F.SilkS", "user"),
    38: ("B.Mask", "user"),
    39: ("F.Mask", "user"),
    40: ("Dwgs.User", "user"),
    44: ("Edge.Cuts", "user"),
    46: ("B.CrtYd", "user"),
    47: ("F.CrtYd", "user"),
    48: ("B.Fab", "user"),
    49: ("F.Fab", "user"),
}
"""Layers of the file that are used, by KiCad's numbers."""
FONT = ["effects", ["font", ["size", LETTER, LETTER], ["thickness", PEN]]]


# KiCad


def kicad_board(made: Board, title: str) -> str:
    """Return the text of the board's file (.kicad_pcb)."""
    nets = {net: number for number, net in enumerate(["", *made.nets])}
    body: list[Expression] = [
        ["version", 20211014],
        ["generator", "magtip"],
        ["general", ["thickness", made.thickness]],
        ["paper", '"A4"'],
        ["title_block", ["title", quoted(title)]],
        ["layers", *([number, quoted(name), kind] for number, (name, kind) in LAYERS.items())],
        ["setup", ["pad_to_mask_clearance", MASK], ["aux_axis_origin", SHEET, SHEET]],
        *(["net", number, quoted(net)] for net, number in nets.items()),
        *(_footprint(part, nets) for part in made.parts),
        *(_screw_hole(number, hole) for number, hole in enumerate(made.holes, 1)),
        *_drawings(made),
    ]
    for track in made.tracks:
        face = "B.Cu" if track.below else "F.Cu"
        for start, end in _pairs(track.points):
            ends = ["start", *_there(start)], ["end", *_there(end)]
            what = ["width", track.width], ["layer", quoted(face)], ["net", nets[track.net]]
            body.append(["segment", *ends, *what, _stamp(track, start)])
    for via in made.vias:
        size = ["size", VIA], ["drill", DRILL], ["layers", '"F.Cu"', '"B.Cu"']
        body.append(["via", ["at", *_there(via.at)], *size, ["net", nets[via.net]], _stamp(via)])
    body += [_zone(made, below, nets["GND"]) for below in (False, True)]
    return text_of(["kicad_pcb", *body]) + "\n"


def kicad_project() -> str:
    """Return the text of the project's file (.kicad_pro), with the rules by which the board was made."""
    rules = {
        "min_clearance": CLEARANCE,
        "min_track_width": TRACK,
        "min_via_diameter": VIA,
        "min_through_hole_diameter": DRILL,
        "min_via_annular_width": (VIA - DRILL) / 2,
        "min_copper_edge_clearance": EDGE,
        "min_hole_clearance": HOLE_GAP,
        "min_hole_to_hole": HOLES_APART,
        "min_silk_clearance": 0.0,
    }
    own = {"name": "Default", "clearance": CLEARANCE, "track_width": TRACK, "via_diameter": VIA, "via_drill": DRILL}
    # the footprints are in the board only, not in a library
    severities = {"lib_footprint_issues": "ignore", "lib_footprint_mismatch": "ignore"}
    settings = {"defaults": {}, "rules": rules, "rule_severities": severities, "track_widths": [TRACK]}
    project = {
        "board": {"design_settings": settings},
        # the symbols too are in the schematic only
        "erc": {"rule_severities": {"lib_symbol_issues": "ignore", "footprint_link_issues": "ignore"}},
        "meta": {"filename": f"{NAME}.kicad_pro", "version": 1},
        "net_settings": {"classes": [own], "meta": {"version": 2}},
        "sheets": [],
        "text_variables": {},
    }
    return json.dumps(project, indent=2) + "\n"


def _footprint(part: Part, nets: Mapping[str, int]) -> Expression:
    side = "B" if part.below else "F"
    text = [*FONT, *([["justify", "mirror"]] if part.below else [])]
    at = ["at", *_local(part, ((part.body[0] + part.body[2]) / 2, (part.body[1] + part.body[3]) / 2))]
    left, low, right, high = part.courtyard.bounds
    court = _box(part, (left, low, right, high), f"{side}.CrtYd", 0.05)
    return [
        "footprint",
        quoted(footprint_of(part)),
        ["layer", quoted(f"{side}.Cu")],
        _stamp(part),
        ["at", *_there(part.at), part.angle],
        ["descr", quoted(f"{part.value}, {part.body[4]:.3g} mm high")],
        ["path", quoted(path_of(part))],
        ["attr", "through_hole" if part.through else "smd"],
        ["fp_text", "reference", quoted(part.reference), at, ["layer", quoted(f"{side}.Fab")], text],
        ["fp_text", "value", quoted(part.value), at, ["layer", quoted(f"{side}.Fab")], "hide", text],
        court,
        _box(part, part.body[:4], f"{side}.Fab", 0.1),
        *(_pad(part, pad, nets) for pad in part.pads),
    ]


def _pad(part: Part, pad: Pad, nets: Mapping[str, int]) -> Expression:
    side, turned = "B" if part.below else "F", part.angle % 180 != 0
    size = pad.size[::-1] if turned else pad.size
    layers = ['"*.Cu"', '"*.Mask"'] if pad.drill else [quoted(f"{side}.{name}") for name in ("Cu", "Paste", "Mask")]
    return [
        "pad",
        quoted(pad.number),
        "thru_hole" if pad.drill else "smd",
        "circle" if pad.is_round else "rect",
        ["at", *_local(part, pad.at), part.angle],
        ["size", *size],
        *([["drill", pad.drill]] if pad.drill else []),
        ["layers", *layers],
        *([["net", nets[pad.net], quoted(pad.net)]] if pad.net else []),
        _stamp(part, pad),
    ]


def _screw_hole(number: int, hole: tuple[float, float, float]) -> Expression:
    x, y, d = hole
    pad = ["pad", '""', "np_thru_hole", "circle", ["at", 0, 0], ["size", d, d], ["drill", d]]
    return [
        "footprint",
        quoted(f"magtip:MountingHole_{d:g}mm"),
        ["layer", '"F.Cu"'],
        _stamp("hole", hole),
        ["at", *_there((x, y))],
        ["attr", "board_only", "exclude_from_pos_files", "exclude_from_bom"],
        ["fp_text", "reference", quoted(f"H{number}"), ["at", 0, 0], ["layer", '"F.Fab"'], "hide", FONT],
        ["fp_text", "value", quoted(f"screw {d:g}"), ["at", 0, 0], ["layer", '"F.Fab"'], "hide", FONT],
        [*pad, ["layers", '"*.Cu"', '"*.Mask"'], _stamp("pad", hole)],
    ]


def _drawings(made: Board) -> Iterator[Expression]:
    for edge in made.outline:
        ends = ["start", *_there(edge.start)], ["end", *_there(edge.end)]
        pen = ["layer", '"Edge.Cuts"'], ["width", 0.1], _stamp(edge)
        if edge.middle is None:
            yield ["gr_line", *ends, *pen]
        else:
            yield ["gr_arc", ends[0], ["mid", *_there(edge.middle)], ends[1], *pen]
    for start, end in (pair for line in made.ink for pair in _pairs(line)):
        ends = ["start", *_there(start)], ["end", *_there(end)]
        yield ["gr_line", *ends, ["layer", '"F.SilkS"'], ["width", PEN], _stamp("ink", start, end)]
    for box in made.pockets:
        ends = ["start", *_there(box[:2])], ["end", *_there(box[2:])]
        yield ["gr_rect", *ends, ["layer", '"Dwgs.User"'], ["width", 0.1], ["fill", "none"], _stamp("pocket", box)]


def _zone(made: Board, below: bool, net: int) -> Expression:
    face = quoted("B.Cu" if below else "F.Cu")
    ring = list(made.area.exterior.coords)[:-1]
    return [
        "zone",
        ["net", net],
        ["net_name", '"GND"'],
        ["layer", face],
        _stamp("zone", below),
        ["hatch", "edge", 0.5],
        ["connect_pads", ["clearance", POUR_GAP]],
        ["min_thickness", SLIVER],
        ["filled_areas_thickness", "no"],
        ["fill", "yes", ["thermal_gap", POUR_GAP], ["thermal_bridge_width", SPOKE]],
        ["polygon", ["pts", *(["xy", *_there(point)] for point in ring)]],
        *(
            # KiCad joins pads to an outline that is clockwise, seen from above
            ["filled_polygon", ["layer", face], ["pts", *(["xy", *_there(at)] for at in one_ring(piece)[:0:-1])]]
            for piece in made.pours[below]
        ),
    ]


def one_ring(shape: Polygon) -> list[Point]:
    """Return the closed outline of a polygon, joined to each of its holes by a cut of no width along x.

    >>> import shapely
    >>> ring = one_ring(shapely.box(0, 0, 4, 4) - shapely.box(1, 1, 2, 2))
    >>> len(ring), round(abs(shapely.Polygon(ring).area), 9)
    (13, 15.0)
    """
    import shapely

    shape = shapely.geometry.polygon.orient(shape)
    ring = [(float(x), float(y)) for x, y in shape.exterior.coords[:-1]]
    for count, hole in enumerate(sorted(shape.interiors, key=lambda hole: min(x for x, _ in hole.coords))):
        points = [(float(x), float(y)) for x, y in hole.coords[:-1]]
        first = min(range(len(points)), key=lambda k: points[k])
        (x, y), (u, v) = points[first], max(points[first - 1], points[(first + 1) % len(points)], key=lambda p: -p[0])
        if u == x:
            # within an upright side, at another height for each hole: cuts in one line, or that end in a corner,
            # confuse programs that read the outline
            y += (v - y) * (0.2 + 0.6 * (0.618 * count % 1))
            first = first if points[first - 1] == (u, v) else first + 1
            points.insert(first, (x, y))
        cuts = []
        for k, ((a, b), (c, d)) in enumerate(zip(ring, [*ring[1:], ring[0]], strict=True)):
            # half-open, so that a corner counts once
            if (b <= y < d) or (d <= y < b):
                where = a + (c - a) * (y - b) / (d - b)
                if where <= x:
                    cuts.append((where, k))
        where, k = max(cuts)
        around = [*points[first:], *points[:first], points[first]]
        ring[k + 1 : k + 1] = [(where, y), *around, (where, y)]
    return [*ring, ring[0]]


def _box(part: Part, corners: Sequence[float], layer: str, pen: float) -> Expression:
    a, b = _local(part, (corners[0], corners[1])), _local(part, (corners[2], corners[3]))
    pencil = ["layer", quoted(layer)], ["width", pen], ["fill", "none"]
    return ["fp_rect", ["start", *a], ["end", *b], *pencil, _stamp(part, layer)]


def _there(at: Sequence[float]) -> Point:
    """Return a place on KiCad's sheet."""
    return SHEET + at[0], SHEET - at[1]


def _local(part: Part, at: Point) -> Point:
    """Return a place in the frame of a footprint, whose turn is a multiple of 90 degrees."""
    x, y = at[0] - part.at[0], at[1] - part.at[1]
    for _ in range(round(part.angle / 90) % 4):
        x, y = y, -x
    return x, -y


def _pairs(points: Sequence[Point]) -> list[tuple[Point, Point]]:
    return [(a, b) for a, b in itertools.pairwise(points) if math.dist(a, b) > 1e-6]


def _stamp(*what: object) -> Expression:
    return ["tstamp", identity(*what)]


# Gerber and Excellon


FUNCTIONS = {
    ("top", "copper"): "Copper,L1,Top",
    ("bottom", "copper"): "Copper,L2,Bot",
    ("top", "mask"): "Soldermask,Top",
    ("bottom", "mask"): "Soldermask,Bot",
    ("top", "paste"): "Paste,Top",
    ("bottom", "paste"): "Paste,Bot",
    ("top", "silk"): "Legend,Top",
    ("bottom", "silk"): "Legend,Bot",
    ("mechanical", "outline"): "Profile,NP",
}
"""What the files of layers are for, in the words of the Gerber format."""


def layer_stack(made: Board) -> LayerStack:
    """Return the board's layers for Gerber and Excellon files."""
    from gerbonara import LayerStack
    from gerbonara.apertures import CircleAperture, ExcellonTool, RectangleAperture
    from gerbonara.graphic_objects import Arc, Flash, Line, Region
    from gerbonara.utils import MM

    stack = LayerStack(board_name=NAME)
    for key, function in FUNCTIONS.items():
        stack[key].file_attrs[".FileFunction"] = [function]
    pen = {size: CircleAperture(size, unit=MM) for size in {TRACK, VIA, PEN, 0.1, *(t.width for t in made.tracks)}}

    def lines(points: Sequence[Point], size: float) -> list[Any]:
        return [Line(*a, *b, aperture=pen[size], unit=MM) for a, b in _pairs(points)]

    def flash(pad: Pad, more: float = 0.0) -> Any:
        a, b = (side + 2 * more for side in pad.size)
        aperture = CircleAperture(a, unit=MM) if pad.is_round else RectangleAperture(a, b, unit=MM)
        return Flash(*pad.at, aperture=aperture, unit=MM)

    for below, side in enumerate(("top", "bottom")):
        wire = stack[side, "copper"].objects
        wire += [Region(one_ring(piece), unit=MM) for piece in made.pours[below]]
        for track in made.tracks:
            wire += lines(track.points, track.width) if track.below == bool(below) else []
        wire += [Flash(*via.at, aperture=pen[VIA], unit=MM) for via in made.vias]
        for part in made.parts:
            for pad in part.pads:
                if pad.drill or part.below == bool(below):
                    wire.append(flash(pad))
                    stack[side, "mask"].objects.append(flash(pad, MASK))
                if not pad.drill and part.below == bool(below):
                    stack[side, "paste"].objects.append(flash(pad))
    for x, y, d in made.holes:
        for side in ("top", "bottom"):
            stack[side, "mask"].objects.append(Flash(x, y, aperture=CircleAperture(d + 2 * MASK, unit=MM), unit=MM))
        stack.drill_npth.objects.append(Flash(x, y, aperture=ExcellonTool(d, plated=False, unit=MM), unit=MM))
    for line in made.ink:
        stack["top", "silk"].objects.extend(lines(line, PEN))
    for edge in made.outline:
        if edge.middle is None:
            drawn = lines((edge.start, edge.end), 0.1)
        else:
            (x, y) = edge.start
            # the only arc is about the beam's axis, counter-clockwise
            drawn = [Arc(x, y, *edge.end, -x, -y, clockwise=False, aperture=pen[0.1], unit=MM)]
        stack["mechanical", "outline"].objects.extend(drawn)
    drills = [(via.at, DRILL) for via in made.vias]
    drills += [(pad.at, pad.drill) for part in made.parts for pad in part.pads if pad.drill]
    for at, d in drills:
        stack.drill_pth.objects.append(Flash(*at, aperture=ExcellonTool(d, plated=True, unit=MM), unit=MM))
    return stack


def gerber_zip(stack: LayerStack) -> bytes:
    """Return the archive that board makers take: a Gerber file for each layer, and two Excellon files."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, layer in stack._save_files_iter(board_name=NAME):
            entry = zipfile.ZipInfo(str(name))
            entry.compress_type = zipfile.ZIP_DEFLATED
            # gerbonara 1.5.0 leaves the end of the one command without data open
            archive.writestr(entry, layer.instance.write_to_bytes().replace(b"\nG75\n", b"\nG75*\n"))
    return data.getvalue()


COLOURS = {
    "board": "#123f2a",
    "copper": "#2f8f5b",
    "pad": "#d9b44a",
    "hole": "#ffffff",
    "ink": "#ffffff",
    "body": "#000000",
}
PIXELS = 40.0
"""Of the picture in a millimetre."""


def picture(made: Board, title: str) -> bytes:
    """Return a picture (PNG) of both faces, each seen from outside, with the names of the parts and a scale."""
    import vl_convert

    left, low, right, high = made.area.bounds
    wide, tall, rim, head = right - left, high - low, 1.0, 2.2
    views = []
    for below in (False, True):
        turn = f"scale(-1,-1) translate({-right},{-high})" if below else f"translate({-left},{high}) scale(1,-1)"
        shift = rim + below * (wide + 2 * rim)
        views.append(
            f'<g transform="translate({shift},{head})"><g transform="{turn}">{_face(made, below)}</g>'
            f"{_names(made) if below else ''}</g>"
            f'<text x="{shift}" y="{head - 0.7}">{"lower" if below else "upper"} face</text>'
        )
    x, y = rim, tall + head + 1.0
    scale = f'<path d="M{x},{y} h5 M{x},{y - 0.3} v0.6 M{x + 5},{y - 0.3} v0.6" stroke="#000" stroke-width="0.12"/>'
    width, height = 2 * wide + 4 * rim, y + 1.2
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width * PIXELS}" '
        f'height="{height * PIXELS}" font-family="sans-serif" font-size="1.1">'
        f'<rect width="100%" height="100%" fill="#fff"/>{"".join(views)}{scale}'
        f'<text x="{x + 5.5}" y="{y + 0.4}">5 mm</text><text x="{width - rim}" y="{y + 0.4}" text-anchor="end">'
        f"{escape(title)}</text></svg>"
    )
    return bytes(vl_convert.svg_to_png(svg))


def _face(made: Board, below: bool) -> str:
    """Return the shapes of a face as SVG, mm in the sensor's frame."""
    wire = [piece.shape for piece in copper(made) if piece.faces[below]]
    pads = [pad.shape() for part in made.parts for pad in part.pads if pad.drill or part.below == below]
    drills = [(*via.at, DRILL) for via in made.vias] + list(made.holes)
    drills += [(*pad.at, pad.drill) for part in made.parts for pad in part.pads if pad.drill]
    shapes = [_path([made.area], "board"), _path([*made.pours[below], *wire], "copper"), _path(pads, "pad")]
    shapes += [f'<circle cx="{x}" cy="{y}" r="{d / 2}" fill="{COLOURS["hole"]}"/>' for x, y, d in drills]
    shapes += [
        f'<rect x="{a}" y="{b}" width="{c - a}" height="{d - b}" fill="none" stroke="{COLOURS["body"]}" '
        'stroke-width="0.08" stroke-dasharray="0.3 0.15"/>'
        for a, b, c, d, _ in (part.body for part in made.parts if part.below == below)
    ]
    lines = " ".join("M" + " L".join(f"{x:.3f},{y:.3f}" for x, y in line) for line in made.ink if not below)
    pen = f'stroke="{COLOURS["ink"]}" stroke-width="{PEN}" stroke-linecap="round" stroke-linejoin="round"'
    return "".join(shapes) + f'<path d="{lines}" fill="none" {pen}/>'


def _names(made: Board) -> str:
    """Return the names of the parts on the lower face; those of the upper one are on its silkscreen."""
    _, _, right, high = made.area.bounds
    return "".join(
        f'<text x="{right - at.x}" y="{high - at.y + 0.3}" font-size="0.8" fill="{COLOURS["ink"]}" '
        f'text-anchor="middle">{part.reference}</text>'
        for part in made.parts
        if part.below and (at := part.courtyard.centroid)
    )


def _path(shapes: Sequence[Polygon], colour: str) -> str:
    drawn = []
    for shape in shapes:
        rings = [ring.coords for ring in (shape.exterior, *shape.interiors)]
        lines = " ".join("M" + " L".join(f"{x:.3f},{y:.3f}" for x, y in ring) + " Z" for ring in rings)
        drawn.append(f'<path fill-rule="evenodd" fill="{COLOURS[colour]}" d="{lines}"/>')
    return "".join(drawn)


# Tables for assembly


def bill(made: Board) -> list[FlatRow]:
    """Return the parts to order, in the columns that assembly services read."""
    groups: dict[tuple[str, str], list[str]] = {}
    for part in made.parts:
        groups.setdefault((part.order, part.package), []).append(part.reference)
    return [
        {"Comment": order, "Designator": ",".join(names), "Footprint": package, "Quantity": len(names)}
        for (order, package), names in groups.items()
    ]


def positions(made: Board) -> list[FlatRow]:
    """Return places and turns of the parts, in the columns that assembly services read."""
    rows = []
    for part in made.parts:
        x, y = (f"{length + 0.0:.4f}mm" for length in part.at)
        face = "bottom" if part.below else "top"
        row = {"Designator": part.reference, "Val": part.value, "Package": part.package, "Mid X": x, "Mid Y": y}
        rows.append(row | {"Rotation": f"{part.angle:g}", "Layer": face})
    return rows


# The verb

PROJECT, SCHEMATIC, BOARD, GERBERS, PICTURE, PAGE = (
    f"{NAME}.kicad_pro",
    f"{NAME}.kicad_sch",
    f"{NAME}.kicad_pcb",
    "gerbers.zip",
    "board.png",
    "BOARD.md",
)
FILES = (PROJECT, SCHEMATIC, BOARD, GERBERS, PICTURE, PAGE, "bom.csv", "positions.csv", parts_list.FILE)
"""Names of all files."""


def study(
    design: Design,
    choices: FabricationChoices,
    plan: Plan,
    made: Board,
    title: str,
    progress: Progress,
    whole: ArrayPlan | None = None,
) -> Result:
    """Return the board of a design with its files, and the list of all parts of the sensor.

    plan, made : of the base, and the board of this plan, or of `whole`, the base of an array.
    """
    progress(0.0, "Gerber and Excellon")
    archive = gerber_zip(layer_stack(made))
    progress(0.2, "volumes of the printed parts")
    volumes = parts_list.printed_volumes(design, choices)
    parts = parts_list.rows(design, choices, plan, volumes, made, whole)
    progress(0.8, "picture")
    image = picture(made, title)
    left, low, right, high = made.area.bounds
    row: FlatRow = {
        "status": "ok",
        "size_mm": (right - left, high - low, made.thickness),
        "parts": bill(made),
        "positions": positions(made),
        "header": made.labels,
        "supply_V": made.supply,
        "addresses": made.addresses,
        "channels": made.channels,
        "warnings": list(made.warnings),
    }
    chips = [part for part in made.parts if part.reference[0] in "US" and part.order != SWITCH["order"]]
    page = page_templates.rendered(
        Path(__file__).with_name("BOARD.md.j2"),
        made=made,
        row=row,
        chips=chips,
        whole=whole,
        each=int(design.chip_count),
        switch=SWITCH if made.channels else None,
        title=title,
        picture=PICTURE,
        least={"track": TRACK, "gap": CLEARANCE, "hole": DRILL},
        pull_up=PULL_UP,
    )
    return Result(
        title="Board",
        records=[row],
        shown=[Table(title="Parts of the board", rows=row["parts"]), _wiring(made), f"Start with {PAGE}."],
        tables={"bom": row["parts"], "positions": row["positions"], "parts": parts},
        files={
            PROJECT: _writer(kicad_project().encode()),
            SCHEMATIC: _writer(schematic(made, title).encode()),
            BOARD: _writer(kicad_board(made, title).encode()),
            GERBERS: _writer(archive),
            PICTURE: _writer(image),
        },
        pages={PAGE: page},
        packages=("gerbonara", "shapely"),
        warnings=row["warnings"],
    )


def _wiring(made: Board) -> str:
    low, high = made.supply
    bus = f" I2C addresses: {', '.join(dict.fromkeys(made.addresses))}" if made.addresses else ""
    if made.channels:
        bus += f", on {max(made.channels) + 1} channels of the switch at {SWITCH['address']}"
    bus += "." if bus else ""
    return f"Header, pin 1 first: {', '.join(made.labels)}; supply {low:g} to {high:g} V.{bus}"


def _writer(data: bytes) -> Writer:
    def write(path: Path) -> None:
        with atomic_files.atomic(path) as temporary:
            temporary.write_bytes(data)

    return write
