"""The DXF of the board, read again: layers, units, entities and extents."""

import io

import ezdxf
import pytest
from ezdxf import bbox

from geometry.base import Base, plan
from geometry.design import Design
from geometry.fabrication.board_drawing import LAYERS, board, pads
from geometry.fabrication.hall_elements import places
from geometry.hall_chips import CHIPS

DESIGNS = [Design(), Design(hall_layout="tmag5273a1"), Design(hall_layout="tle493d-p2b6", l0=9.0, chip_x=2.0)]


def read(design, choices=None):
    choices = choices or Base(shape="round")
    return ezdxf.read(io.StringIO(board(design, plan(design, choices))))


def extents(drawing, layer):
    box = bbox.extents(drawing.modelspace().query(f'*[layer=="{layer}"]'), fast=True)
    return [box.extmin.x, box.extmin.y, box.extmax.x, box.extmax.y]


@pytest.mark.parametrize("design", DESIGNS, ids=lambda d: d.hall_layout)
def test_the_file_has_no_errors_and_all_layers_are_used(design):
    drawing = read(design)
    assert (drawing.dxfversion, drawing.units) == ("AC1024", ezdxf.units.MM)
    assert [error.message for error in drawing.audit().errors] == []
    assert {entity.dxf.layer for entity in drawing.modelspace()} == set(LAYERS)
    assert set(LAYERS) <= {layer.dxf.name for layer in drawing.layers}


@pytest.mark.parametrize("shape", ["square", "round"])
def test_outline_and_beam_have_the_lengths_of_the_plan(shape):
    design, choices = Design(), Base(shape=shape)
    p, drawing = plan(design, choices), read(design, choices)
    assert extents(drawing, "OUTLINE") == pytest.approx([-p.half, -p.half, p.half, p.half])
    assert extents(drawing, "BEAM") == pytest.approx([-4, -4, 4, 4])
    holes = [c for c in drawing.modelspace().query('CIRCLE[layer=="OUTLINE"]') if c.dxf.radius < p.half]
    assert sorted(c.dxf.radius for c in holes) == ([1.1] * 4 if shape == "square" else [])


def test_leads_of_s2_and_s3_meet_their_pads_below_the_passages():
    design = Design()
    p, centres = plan(design, Base()), pads(design)
    for name, three in (("S1", centres[:3]), ("S2", centres[3:6]), ("S3", centres[6:])):
        (x, y, _), (wide, tall, _) = p.seats.passages[name].corner, p.seats.passages[name].sides
        assert all(x < u < x + wide and y < v < y + tall for u, v in three)
    drawing = read(design)
    circles = drawing.modelspace().query('CIRCLE[layer=="PADS"]')
    assert {tuple(c.dxf.center)[:2] for c in circles} == set(centres)
    assert len(circles) == 18


WITH_PADS = [layout for layout, chip in CHIPS.items() if chip.pads]


@pytest.mark.parametrize("process", ["fdm", "sla"])
@pytest.mark.parametrize("layout", CHIPS)
def test_pads_and_capacitor_of_a_chip_lie_in_its_pocket(layout, process):
    design = Design(hall_layout=layout, l0=9.0, chip_x=1.5)
    (pocket,) = plan(design, Base(), process).seats.bodies.values()
    (left, near, _), (wide, deep, high) = pocket.corner, pocket.sides
    chip = CHIPS[layout]
    for x, y in pads(design):
        assert left < x - chip.pads.width / 2
        assert x + chip.pads.width / 2 < left + wide
        assert near < y - chip.pads.length / 2
        assert y + chip.pads.length / 2 < near + deep
    assert (wide, deep, high) > chip.body
    assert "on the underside of the board" in board(design, plan(design, Base()))


@pytest.mark.parametrize("layout", WITH_PADS)
def test_a_chip_has_two_rows_of_separate_pads_around_its_plates(layout):
    design = Design(hall_layout=layout, l0=9.0, chip_x=1.5)
    row, (x, y, _) = CHIPS[layout].pads, places(design)[layout]
    drawing = read(design)
    assert len(drawing.modelspace().query('LWPOLYLINE[layer=="PADS"]')) == 2 * row.pins
    wide, tall = ((row.pins - 1) * row.pitch + row.width) / 2, (row.rows + row.length) / 2
    assert extents(drawing, "PADS") == pytest.approx([x - wide, y - tall, x + wide, y + tall])
    assert row.width < row.pitch


def test_a_chip_of_unknown_pads_has_none_and_the_board_says_so():
    drawing = read(Design(hall_layout="mlx90393", l0=9.0))
    assert not drawing.modelspace().query('LWPOLYLINE[layer=="PADS"]')
    assert any("whose pads are unknown" in entity.dxf.text for entity in drawing.modelspace().query("TEXT"))


def test_the_text_names_the_elements_and_asks_to_check_the_pads():
    texts = {entity.dxf.text for entity in read(Design()).modelspace().query("TEXT")}
    assert {"S1", "S2", "S3", "x", "y"} <= texts
    assert any("check against your data sheet" in text for text in texts)
