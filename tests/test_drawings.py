"""Drawings: sections match the solids, sheets are SVG inside their frame, and the board is DXF with its layers."""

import io
import itertools
import math
import re
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import pytest
from ezdxf import bbox

from geometry import cad
from geometry.bad_input import BadInput
from geometry.base import Base, base, plan
from geometry.design import Design
from geometry.fabrication import magnet_jig
from geometry.fabrication.board_drawing import LAYERS, board, chip_pads, pads
from geometry.fabrication.hall_elements import bodies, places
from geometry.fabrication.mold_solids import closed_mold, halves
from geometry.fabrication.printability import PROCESSES
from geometry.fabrication.technical_drawing import HEIGHT, WIDTH, Piece, View, number, sheet
from geometry.hall_chips import CHIPS
from geometry.mold import Mold, sizes
from studies.fabrication import part_drawings, symbol_drawings
from studies.mechanics import store
from studies.web.explorer_state import request_of
from studies.web.panels import Memory
from studies.web.state_pictures import drawing_panel

NUMBER = r"-?\d+\.?\d*(?:e-?\d+)?"


def test_a_section_shows_the_profile_and_its_holes():
    outlines = []
    for solid in (cad.beam(Design()), cad.silicone(Design())):
        view = View("")
        view.cut(solid, "soft")
        assert view.box == pytest.approx((-4, 4, 0, 9), abs=1e-9)
        outlines.append([len(loops) for loops, _ in view.paths])
    assert outlines == [[1], [2]]


def test_a_view_from_above_shows_x_to_the_right_and_y_upwards():
    import build123d as bd

    view = View("")
    view.projection(bd.Solid.make_box(1, 2, 3, bd.Plane((4, 5, 0))))
    assert view.box == pytest.approx((4, 5, 5, 7), abs=1e-9)


@pytest.mark.parametrize(
    ("design", "mold", "pole"),
    [
        (Design(), Mold(), "north pole down"),
        (Design(c=4, f=7, magnet_north="up"), Mold(columns=4, rows=3, shrink=0.01), "north pole up"),
        (Design(D=1, L=0.8, magnet_diameter=0.2, magnet_height=0.2, magnet_edge_radius=0.02, l0=3), Mold(), ""),
        (Design(D=50, L=400, l0=380, f=40, hall_layout="tmag5273a1"), Mold(), ""),
    ],
    ids=["paper", "plate", "small", "large"],
)
def test_sheets_are_svg_with_their_dimensions_inside_their_frame(design, mold, pole):
    parts = {"base": base(plan(design, Base())), "silicone": cad.silicone(design), "magnet": cad.magnet(design)}
    A, B = closed_mold(design, mold)
    texts = part_drawings.sheets(design, plan(design, Base()), mold.printing, parts, bodies(design))
    texts["mould"] = part_drawings.mold_sheet(design, mold, sizes(design, mold), A, [B])
    assert pole in texts["sensor"]
    for label in (f"D = {design.D:g}", f"L = {design.L:g}", f"l0 = {design.l0:g}"):
        assert f">{label}<" in texts["sensor"]
    for title, text in texts.items():
        root = ElementTree.fromstring(text)
        assert (root.attrib["width"], root.attrib["height"]) == ("297mm", "210mm")
        shown = [node for node in root.iter() if node.tag.endswith("}text")]
        words, halos = ({n.text for n in shown if ("halo" in n.attrib["class"]) is halo} for halo in (False, True))
        # programs that do not know paint-order would draw a stroke over its own text
        assert words == halos
        assert title.capitalize() in words
        assert re.search(r"scale [\d.]+:\d+ on A4; all lengths in mm", " ".join(words))
        assert re.search(r"design [0-9a-f]{12}, \d{4}-\d\d-\d\d, general tolerance ±0.1", " ".join(words))
        assert overprints(shown) == []
        assert "nan" not in text
        for node in root.iter():
            if node.tag.endswith("}path") and "pattern" not in node.attrib.get("d", "") and "class" in node.attrib:
                steps = re.findall(rf"[ML]({NUMBER}) ({NUMBER})", node.attrib["d"])
                assert all(0 < float(x) < WIDTH and 0 < float(y) < HEIGHT for x, y in steps), title


def overprints(shown):
    """Pairs of texts that cover each other, by the width of Arial's digits."""
    boxes = []
    for node in shown:
        x, y, height = float(node.attrib["x"]), float(node.attrib["y"]), 2.2
        wide = 1.7 * len(node.text)
        left = x - {"start": 0.0, "middle": 0.5, "end": 1.0}[node.attrib["text-anchor"]] * wide
        box = (left, y - height, left + wide, y)
        if "transform" in node.attrib:
            box = (x - height, y - wide / 2, x, y + wide / 2)
        if "halo" not in node.attrib["class"] and not {"title", "small"} & set(node.attrib["class"].split()):
            boxes.append((node.text, box))
    return [
        (a, b)
        for (a, p), (b, q) in itertools.combinations(boxes, 2)
        if p[0] < q[2] and q[0] < p[2] and p[1] < q[3] and q[1] < p[3]
    ]


def test_long_views_stand_one_above_the_other_and_high_ones_side_by_side():
    for corners, scale in (((0, 0), (100, 20)), "2.5:1"), (((0, 0), (20, 60)), "2.5:1"):
        views = View("one"), View("two")
        for view in views:
            view.paths.append(([[Piece(*corners)]], "outline"))
        assert f"scale {scale} on A4" in sheet("Views", [[views[0]], [views[1]]], [], "")


def test_sheets_of_a_split_mould_and_of_four_chips_print_no_text_over_another():
    """Pins and all screws of the split are shown, and the place of each chip."""
    design, mold = Design(), Mold(columns=2, split=1)
    s, (A, B) = sizes(design, mold), closed_mold(design, mold)
    texts = [part_drawings.mold_sheet(design, mold, s, A, [*halves(design, mold, B).values()])]
    lengths = magnet_jig.lengths(design, mold)
    texts.append(part_drawings.jig_sheet(design, mold, s, lengths, magnet_jig.solids(design, mold, lengths), B))
    four = Design(hall_layout="tlv493d-a1b6", chip_count=4, chip_x=6.0, l0=8.0, c=0.0)
    parts = {"base": base(plan(four, Base())), "silicone": cad.silicone(four), "magnet": cad.magnet(four)}
    drawn = part_drawings.sheets(four, plan(four, Base()), mold.printing, parts, bodies(four))
    found = [
        [node for node in ElementTree.fromstring(text).iter() if node.tag.endswith("}text")]
        for text in (*texts, *drawn.values())
    ]
    assert [overprints(shown) for shown in found] == 4 * [[]]
    words = [{node.text for node in shown} for shown in found]
    assert {number(z - s.bottom) for z in s.ears.bolt_z} | {f"pin {number(-s.bottom / 2)}"} <= words[0]
    assert {"chip 1", "chip 2", "chip 3", "chip 4"} <= words[2]
    assert "6" in words[3]


@pytest.fixture(scope="module")
def shown_by_page(tmp_path_factory):
    """The answers of the live page to a design: its lengths, and then its loads too."""
    with store.opened(tmp_path_factory.mktemp("drawings") / "solved.sqlite") as kept:
        memory = Memory(kept)
        yield lambda **design: [
            data for _, data in drawing_panel(request_of({"state": {"design": design}}), "quick", memory)
        ]


@pytest.mark.parametrize(("name", "key"), [("sensor", "lengths"), ("loads", "loads")])
def test_drawings_of_documents_and_live_page_are_those_of_the_design(shown_by_page, name, key):
    """Meshes and linear algebra of other machines move points by less than what can be seen."""
    shown = (Path(__file__).parent.parent / "docs" / f"{name}.svg").read_text("utf-8")
    first, both = shown_by_page()
    assert (list(first["picture"]), both["message"]) == (["lengths"], "")
    drawn = both["picture"][key]
    assert re.sub(NUMBER, "#", drawn) == re.sub(NUMBER, "#", shown), (
        f"write docs/{name}.svg again, by symbol_drawings"
    )
    numbers = [[float(number) for number in re.findall(NUMBER, text)] for text in (drawn, shown)]
    assert numbers[0] == pytest.approx(numbers[1], abs=0.02)


def test_a_drawing_of_lengths_has_the_symbols_of_any_layout():
    text = symbol_drawings.lengths(Design(hall_layout="tle493d-p2b6", l0=9.0, chip_x=2.0, magnet_north="up"))
    shown = re.findall(r'<text class="(?!halo)[^>]*>([^<]*)<', text)
    assert {"D = 8", "L = 9", "H = 5", "d = 4", "h = 2", "l0 = 9", "chip_x = 2", "N", "-z"} <= set(shown)


def test_what_cannot_be_drawn_is_said(shown_by_page):
    # the seats of S2 and S3 have no room, and a press of this slender beam buckles
    _, answer = shown_by_page(L=30, l0=28.2, f=4.5)
    assert answer["picture"] == {}
    assert re.search(
        "no drawing of the lengths: f must be at least .* the loads: the drawing of a press has no stable",
        answer["message"],
    )


@pytest.mark.parametrize("turn", [60.0, 120.0, 170.0])
def test_the_box_of_an_arc_holds_its_outermost_points(turn):
    """Arcs of a unit circle on both sides of the x axis, up to an angle on either side."""
    x, y = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    view = View("arc")
    view.paths.append(([[Piece((x, -y), (x, y), (1.0, 0.0), 1.0)]], "outline"))
    top = 1.0 if turn > 90 else y
    assert view.box == pytest.approx((x, 1.0, -top, top), abs=1e-12)


SENSORS = [Design(), Design(hall_layout="tmag5273a1"), Design(hall_layout="tle493d-p2b6", l0=9.0, chip_x=2.0)]


def board_of(design, choices=None):
    choices = choices or Base(shape="round")
    return ezdxf.read(io.StringIO(board(design, plan(design, choices))))


def extents(drawing, layer):
    box = bbox.extents(drawing.modelspace().query(f'*[layer=="{layer}"]'), fast=True)
    return [box.extmin.x, box.extmin.y, box.extmax.x, box.extmax.y]


@pytest.mark.parametrize("design", SENSORS, ids=lambda d: d.hall_layout)
def test_the_file_has_no_errors_and_all_layers_are_used(design):
    drawing = board_of(design)
    assert (drawing.dxfversion, drawing.units) == ("AC1024", ezdxf.units.MM)
    assert [error.message for error in drawing.audit().errors] == []
    assert {entity.dxf.layer for entity in drawing.modelspace()} == set(LAYERS)
    assert set(LAYERS) <= {layer.dxf.name for layer in drawing.layers}
    texts = {entity.dxf.text for entity in drawing.modelspace().query("TEXT")}
    assert {"x", "y"} <= texts
    assert any("check against your data sheet" in text for text in texts)


@pytest.mark.parametrize("shape", ["square", "round"])
def test_outline_and_beam_have_the_lengths_of_the_plan(shape):
    design, choices = Design(), Base(shape=shape)
    p, drawing = plan(design, choices), board_of(design, choices)
    assert extents(drawing, "OUTLINE") == pytest.approx([-p.half, -p.half, p.half, p.half])
    assert extents(drawing, "BEAM") == pytest.approx([-4, -4, 4, 4])
    holes = [c for c in drawing.modelspace().query('CIRCLE[layer=="OUTLINE"]') if c.dxf.radius < p.half]
    assert sorted(c.dxf.radius for c in holes) == ([1.1] * 4 if shape == "square" else [])


@pytest.mark.parametrize("process", ["fdm", "sla"])
@pytest.mark.parametrize("layout", CHIPS)
def test_pads_and_capacitor_of_a_chip_lie_in_its_pocket(layout, process):
    design = Design(hall_layout=layout, l0=9.0, chip_x=1.5)
    (pocket,) = plan(design, Base(), process).seats.bodies.values()
    (left, near, _), (wide, deep, high) = pocket.corner, pocket.sides
    chip = CHIPS[layout]
    assert pads(design) == [(x, y) for x, y, *_ in chip_pads(design)]
    for x, y, a, b in chip_pads(design):
        assert left < x - a / 2
        assert x + a / 2 < left + wide
        assert near < y - b / 2
        assert y + b / 2 < near + deep
    assert (wide, deep, high) > chip.body
    assert "on the underside of the board" in board(design, plan(design, Base()))


@pytest.mark.parametrize("layout", [layout for layout, chip in CHIPS.items() if chip.pads])
def test_a_chip_has_rows_of_separate_pads_around_its_plates(layout):
    design = Design(hall_layout=layout, l0=9.0, chip_x=1.5)
    row, (x, y, _) = CHIPS[layout].pads, places(design)[layout]
    drawing = board_of(design)
    count = 4 * row.pins + 1 if row.centre else 2 * row.pins
    assert len(drawing.modelspace().query('LWPOLYLINE[layer=="PADS"]')) == count
    wide, tall = ((row.pins - 1) * row.pitch + row.width) / 2, (row.rows + row.length) / 2
    wide = tall if row.centre else wide
    assert extents(drawing, "PADS") == pytest.approx([x - wide, y - tall, x + wide, y + tall])
    assert row.width < row.pitch


def test_the_date_of_a_sheet_is_that_of_a_repeated_build(monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert "1970-01-02, general tolerance ±0.05" in part_drawings.stamp(Design(), PROCESSES["sla"])
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "today")
    with pytest.raises(BadInput, match="SOURCE_DATE_EPOCH must be a whole number of seconds; got 'today'"):
        part_drawings.stamp(Design(), PROCESSES["sla"])
