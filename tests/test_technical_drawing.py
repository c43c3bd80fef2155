"""Drawings: sections match the solids; sheets are valid SVG with all dimensions inside the frame."""

import math
import re
from xml.etree import ElementTree

import pytest

from geometry import cad
from geometry.base import Base, base, plan
from geometry.design import Design
from geometry.fabrication.hall_elements import bodies
from geometry.fabrication.mold_solids import closed_mold
from geometry.fabrication.technical_drawing import HEIGHT, WIDTH, Piece, View, sheet
from geometry.mold import Mold, sizes
from studies.fabrication import part_drawings

NUMBER = r"-?\d+\.?\d*(?:e-?\d+)?"


def area(view):
    """Return the area of all loops of a view by Green's theorem, arcs included: the outer loop less the holes."""
    total = 0.0
    for loops, _ in view.paths:
        areas = []
        for loop in loops:
            points = [point for piece in loop for point in _points(piece)]
            ends = [(piece.start, piece.end) for piece in loop]
            assert all(
                math.dist(end, start) < 1e-6 for (_, end), (start, _) in zip(ends, ends[1:] + ends[:1], strict=True)
            )
            x, y = zip(*points, strict=True)
            areas.append(abs(sum(x[k - 1] * y[k] - x[k] * y[k - 1] for k in range(len(x)))) / 2)
        total += areas[0] - sum(areas[1:])
    return total


def _points(piece):
    ends = piece.start, piece.end
    if piece.middle is None:
        return list(ends)
    (x, y), (u, v), (p, q) = *ends, piece.middle
    # centre of the circle through three points
    d = 2 * (x * (q - v) + p * (v - y) + u * (y - q))
    cx = ((x * x + y * y) * (q - v) + (p * p + q * q) * (v - y) + (u * u + v * v) * (y - q)) / d
    cy = ((x * x + y * y) * (u - p) + (p * p + q * q) * (x - u) + (u * u + v * v) * (p - x)) / d
    t0, tm, t1 = (math.atan2(b - cy, a - cx) for a, b in ((x, y), (p, q), (u, v)))
    turn = (t1 - t0) % (2 * math.pi)
    if (tm - t0) % (2 * math.pi) > turn:
        turn -= 2 * math.pi
    return [(cx + piece.radius * math.cos(t0 + turn * k / 200), cy + piece.radius * math.sin(t0 + turn * k / 200))
            for k in range(201)]  # fmt: skip


def test_a_section_has_the_area_of_the_profile():
    design = Design()
    view = View("")
    view.cut(cad.beam(design), "soft")
    assert area(view) == pytest.approx(design.D * design.H + math.pi * design.R**2 / 2, rel=1e-4)
    assert view.box == pytest.approx((-4, 4, 0, 9), abs=1e-9)
    hollow = View("")
    hollow.cut(cad.silicone(design), "soft")
    edge = (4 - math.pi) * design.magnet_edge_radius**2
    assert area(view) - area(hollow) == pytest.approx(4 * 2 - edge, rel=1e-3)


def test_a_section_shows_a_small_body_far_from_the_axis_whole():
    design = Design(hall_layout="tmag5273a1", chip_x=30.0)
    view = View("chip")
    view.cut(bodies(design)["tmag5273a1"], "part")
    assert view.box[:2] == pytest.approx((30 - 2.9 / 2, 30 + 2.9 / 2))


def test_a_view_from_above_shows_x_to_the_right_and_y_upwards():
    import build123d as bd

    view = View("")
    view.projection(bd.Solid.make_box(1, 2, 3, bd.Plane((4, 5, 0))))
    assert view.box == pytest.approx((4, 5, 5, 7), abs=1e-9)


def sheets(design, mold):
    p, solid, shown = plan(design, Base()), base(design, Base()), bodies(design)
    sensor = {"base": solid, "silicone": cad.silicone(design)}
    if design.shape.has_magnet:
        sensor["magnet"] = cad.magnet(design)
    A, B = closed_mold(design, mold)
    return {
        **{name.capitalize(): text for name, text in part_drawings.sheets(design, p, sensor, shown).items()},
        "Mould": part_drawings.mold_sheet(design, mold, sizes(design, mold), A, [B]),
    }


@pytest.mark.parametrize(
    ("design", "mold"),
    [
        (Design(), Mold()),
        (Design(c=4, f=7), Mold(columns=4, rows=3, shrink=0.01)),
        (Design(D=1, L=0.8, magnet_diameter=0.2, magnet_height=0.2, magnet_edge_radius=0.02, l0=3), Mold()),
        (Design(D=50, L=400, l0=380, f=40, hall_layout="tmag5273a1"), Mold()),
        (Design(chip_x=6.0, hall_layout="tmag5273a1"), Mold()),
    ],
    ids=["paper", "plate", "small", "large", "chip aside"],
)
def test_sheets_are_svg_inside_their_frame(design, mold):
    for title, text in sheets(design, mold).items():
        root = ElementTree.fromstring(text)
        assert (root.attrib["width"], root.attrib["height"]) == ("297mm", "210mm")
        words = [node.text for node in root.iter() if node.tag.endswith("}text")]
        assert title in words
        assert re.search(r"scale \d+:\d+ on A4; all lengths in mm", " ".join(words))
        assert "nan" not in text
        for node in root.iter():
            if node.tag.endswith("}path") and "pattern" not in node.attrib.get("d", "") and "class" in node.attrib:
                steps = re.findall(rf"[ML]({NUMBER}) ({NUMBER})", node.attrib["d"])
                assert all(0 < float(x) < WIDTH and 0 < float(y) < HEIGHT for x, y in steps), title


def test_the_main_dimensions_are_on_the_sheets():
    text = sheets(Design(), Mold())
    for label in ("Ø8", "L = 9", "magnet Ø4", "l0 = 7.2", "f = 5", "c = 2", "S2", "S3"):
        assert f">{label}<" in text["Sensor"]
    assert "north pole down" in text["Sensor"]
    assert "north pole up" in sheets(Design(magnet_north="up"), Mold())["Sensor"]
    for label in ("3.27", "4 holes Ø2.2 for screws", "4.26"):
        assert f">{label}<" in text["Base"]
    for label in ("Ø8", "pin Ø4", "vent Ø1", "6", "A", "B"):
        assert f">{label}<" in text["Mould"]


def test_arrows_of_a_short_dimension_point_inwards_from_outside():
    view = View("v", [([[Piece((0, 0), (100, 0)), Piece((100, 0), (100, 50)), Piece((100, 50), (0, 0))]], "outline")])
    view.dims = [((0, 0), (100, 0), "below", 0, "100"), ((0, 0), (1, 0), "above", 0, "1.000")]
    text = sheet("t", [[view]], [])
    assert 'text-anchor="middle">100<' in text
    assert text.count('class="arrow"') == 4


def test_every_text_has_a_halo_and_is_drawn_again_over_it():
    """Programs that do not know paint-order would draw a stroke over its own text."""
    for text in sheets(Design(), Mold()).values():
        shown = [node for node in ElementTree.fromstring(text).iter() if node.tag.endswith("}text")]
        halo = ["halo" in node.attrib["class"] for node in shown]
        assert sum(halo) == len(halo) - sum(halo) > 5
        assert {n.text for n, h in zip(shown, halo, strict=True) if h} == {
            n.text for n, h in zip(shown, halo, strict=True) if not h
        }
        assert "paint-order" not in text


@pytest.mark.parametrize("turn", [60.0, 120.0, 170.0])
def test_the_box_of_an_arc_holds_its_outermost_points(turn):
    """Arcs of a unit circle on both sides of the x axis, up to an angle on either side."""
    x, y = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    view = View("arc")
    view.paths.append(([[Piece((x, -y), (x, y), (1.0, 0.0), 1.0)]], "outline"))
    top = 1.0 if turn > 90 else y
    assert view.box == pytest.approx((x, 1.0, -top, top), abs=1e-12)
