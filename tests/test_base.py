"""The base holds the elements at the positions of the design; if they do not fit, the message says why."""

import math
import re

import build123d as bd
import numpy as np
import pytest

from analytic.parts import of_design
from geometry import cad
from geometry.array_design import ArrayDesign, grid_array
from geometry.base import EDGE, Base, array_base, array_plan, base, checks, outer_size, plan, warnings
from geometry.cad import overlap
from geometry.design import BadInput, Design
from geometry.fabrication import breakout_boards, solid_files
from geometry.fabrication.engraved_marks import DEPTH
from geometry.fabrication.hall_elements import Block, bodies, places
from geometry.fabrication.mold_solids import printable
from geometry.fabrication.printability import PROCESSES, standing

CHIP = Design(hall_layout="tle493d-w2b6", l0=8.0)


def test_one_base_holds_the_chips_of_an_array_at_their_places():
    array = ArrayDesign(CHIP, np.array([[0.0, 0.0], [12.0, 0.0], [6.0, 11.0]]), np.ones(3))
    solid, parts = array_base(array_plan(array, Base(screw=2.2, recess=0.0))), bodies(CHIP)
    single = plan(CHIP, Base(screw=2.2))
    assert solid.is_valid
    box = solid.bounding_box(optimal=False)
    long, wide = box.max.X - box.min.X, box.max.Y - box.min.Y
    assert [long, wide] == pytest.approx([12 + 2 * single.half, 11 + 2 * single.half])
    disc = cad.turned([(0, -0.05, 0), (CHIP.R, -0.05, 0), (CHIP.R, 0, 0), (0, 0, 0)])
    for x, y in array.places.tolist():
        assert max(overlap(solid, cad.moved(body, (x, y, 0.0))) for body in parts.values()) < 1e-9
        assert overlap(solid, cad.moved(disc, (x, y, 0.0))) == pytest.approx(disc.volume, rel=1e-9)
    assert array_plan(array, Base()).one.recess == 0.4
    # three pockets of equal volume, four screws
    pocket, hole = sum(math.prod(seat.sides) for seat in single.seats.bodies.values()), math.pi * 1.1**2
    left = (long * wide - 4 * hole) * single.thickness - 3 * pocket
    assert solid.volume == pytest.approx(left, rel=2e-3)
    printed = printable("base", solid_files.triangulated(standing(solid)), PROCESSES["fdm"])
    assert [check.name for check in printed if not check.passed] == []


def test_a_base_of_an_array_needs_chips_and_room_between_them():
    with pytest.raises(BadInput, match="a base for an array is made for chips"):
        array_plan(grid_array(Design(), 1, 2, 20.0), Base())
    with pytest.raises(BadInput, match="take a pitch of"):
        array_plan(grid_array(CHIP, 1, 2, 8.5), Base(shape="round"))


BARE = {"magnet_diameter": 0, "magnet_height": 0, "magnet_edge_radius": 0}
DESIGNS = [
    Design(),
    Design(c=4.0, f=7.0),
    Design(c=6.0, l0=6.9, f=8.0),
    Design(f=3.7, c=-4.0, l0=12.0),
    Design(hall_layout="tmag5273a1"),
    Design(hall_layout="tle493d-p2b6", l0=9.0),
    Design(hall_layout="tmag5273a1", chip_x=-11.0),
    Design(hall_layout="tmag5273a1", chip_x=3.0, chip_count=3, l0=7.5),
    Design(hall_layout="tmag5273a1", chip_x=4.5, chip_count=4, l0=7.5),
    Design(D=1, L=0.8, magnet_diameter=0.2, magnet_height=0.2, magnet_edge_radius=0.02, l0=3),
    Design(D=50, L=25.05, f=40, **BARE),
    # slots of S2 and S3 that open into each other, beside the beam and under it
    Design(D=4, L=5, f=2.8, c=1.5, l0=4.5, magnet_diameter=2, magnet_height=1),
    Design(D=4, L=5, f=3.2, c=4, l0=4.5, magnet_diameter=2, magnet_height=2),
    Design(f=3.0, c=-6.0, l0=12.0),
    Design(D=4, L=4.5, l0=4.1, hall_layout="tmag5273a1", magnet_diameter=1, magnet_height=1),
]
SQUARE, ROUND = Base(), Base(shape="round")


def name_of(value):
    return value.shape if isinstance(value, Base) else f"{value.hall_layout} D{value.D:g} f{value.f:g} c{value.c:g}"


@pytest.mark.parametrize("choices", [SQUARE, ROUND], ids=name_of)
@pytest.mark.parametrize("design", DESIGNS, ids=name_of)
def test_elements_sit_in_their_seats_and_the_base_prints(design, choices):
    solid, parts = base(plan(design, choices)), bodies(design)
    assert solid.is_valid
    assert [check.name for check in checks(design, solid, parts) if not check.passed] == []
    assert [
        check.name
        for check in printable("base", solid_files.triangulated(standing(solid)), PROCESSES["fdm"])
        if not check.passed
    ] == []
    # the top of the plate is the base plane, and the beam stands on it
    disc = cad.turned([(0, -0.05, 0), (design.R, -0.05, 0), (design.R, 0, 0), (0, 0, 0)])
    assert cad.overlap(solid, disc) == pytest.approx(disc.volume, rel=1e-9)


@pytest.mark.parametrize(("layout", "count"), [("three", 1), ("tmag5273a1", 1), ("tle493d-p2b6", 2)])
def test_bodies_and_readings_use_the_same_positions(layout, count):
    design = Design(hall_layout=layout, f=6.0, c=1.0, l0=8.0, chip_x=2.5, chip_count=count)
    elements = [element.position for element in of_design(design)]
    assert sorted(set(elements)) == sorted(places(design).values())


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"c": 9.0},
        {"L": 24.0, "l0": 22.0},
        {"hall_layout": "tmag5273a1"},
        {"hall_layout": "tle493d-p2b6", "chip_x": 9},
    ],
)
def test_the_outer_size_equals_that_of_the_solids(fields):
    design = Design(**fields)
    p = plan(design, Base())
    size, leads = outer_size(design, p)
    boxes = {name: body.bounding_box() for name, body in bodies(design).items()}
    plate, form = base(plan(design, Base())).bounding_box(), cad.beam(design).bounding_box()
    low = plate.min.Z
    assert size[:2] == pytest.approx((plate.size.X, plate.size.Y), abs=1e-6)
    assert size[2] == pytest.approx(max(box.max.Z for box in (plate, form, *boxes.values())) - low, abs=1e-6)
    assert leads == pytest.approx(low - min(low, *(box.min.Z for box in boxes.values())), abs=1e-6)
    # no element stands out beside the base but S1's leads, which lie along -x
    for box in boxes.values():
        assert max(box.max.X, box.max.Y, -box.min.Y) <= p.half


@pytest.mark.parametrize(
    ("fields", "choices", "text"),
    [
        ({"l0": 5.5}, {}, "l0 must be at least 6.2 mm to leave 0.6 mm of base between S1 and the beam; got 5.5 mm"),
        ({"D": 10, "L": 10}, {}, "f must be at least 5.6 mm to place the seats of S2 and S3 beside the beam"),
        (
            {"f": 2.7, "c": -6, "l0": 12.0},
            {},
            "f must be at least 2.8 mm to leave 0.6 mm between the seats of S1 and S2; got 2.7 mm",
        ),
        (
            {"D": 4, "L": 5, "f": 2.7, "c": 6, "l0": 6, "magnet_diameter": 2},
            {},
            "f must be at least 2.73 mm, or S2 and S3 meet; got 2.7 mm",
        ),
        ({"hall_layout": "tmag5273a1", "l0": 5.5}, {}, "l0 must be at least 6.55 mm"),
        (
            {"hall_layout": "tmag5273a1", "l0": 4, "chip_x": 9},
            {},
            "l0 must be at least 6.55 mm to leave 0.6 mm of base",
        ),
        ({}, {"thickness": 2.0}, "thickness must be at least 3.27 mm for the elements' seats; got 2 mm"),
        (
            {"hall_layout": "tmag5273a1"},
            {"thickness": 5.0},
            "l0 sets the thickness of a chip's base, here 2.8 mm; got 5 mm",
        ),
        ({}, {"screw": -1.0}, "screw must lie between 0 and 10 mm; got -1 mm"),
        ({}, {"seat_wall": math.nan}, "seat_wall must lie between 0.4 and 10 mm; got nan mm"),
        ({}, {"seat_fit": "1"}, "seat_fit must be a number from 0 to 1 mm; got '1'"),
    ],
)
def test_bad_input(fields, choices, text):
    with pytest.raises(BadInput) as caught:
        plan(Design(**fields), Base(**choices))
    assert str(caught.value).startswith(text)


def test_an_element_that_overlaps_the_base_fails_the_check():

    design = Design()
    solid, parts = base(plan(design, Base())), bodies(design)
    lifted = parts | {"S2": parts["S2"].moved(bd.Location((-0.7, 0, 0)))}
    assert [check.passed for check in checks(design, solid, lifted)] == [False, False]


def test_a_plate_that_touches_the_elements_causes_a_warning():
    assert warnings(Design()) == []
    assert warnings(Design(c=8.0, f=7.0)) == [
        "a wide flat plate touches S2 and S3 at a depth of 1.7 mm: lower c or use a smaller plate"
    ]
    assert warnings(Design(c=8.0, hall_layout="tmag5273a1")) == []


@pytest.mark.parametrize("process", ["fdm", "sla"])
@pytest.mark.parametrize("shape", ["square", "round"])
@pytest.mark.parametrize("design", DESIGNS, ids=name_of)
def test_the_least_outer_size_is_that_of_the_default_base(design, shape, process):
    least = 2 * plan(design, Base(shape=shape), process).half
    assert plan(design, Base(shape=shape, outer=least), process).half == pytest.approx(least / 2, rel=1e-12)
    with pytest.raises(BadInput, match=rf"outer must be at least [\d.]+ mm for a {shape} base"):
        plan(design, Base(shape=shape, outer=0.999 * least), process)


@pytest.mark.parametrize("shape", ["square", "round"])
def test_the_floor_of_the_recess_is_the_base_plane(shape):
    """The beam stands on z = 0 with and without a recess, so that l0 and c stay those of the design."""
    design = Design(hall_layout="tmag5273a1")
    deep, flat = (Base(shape=shape, outer=16, screw=0, recess=recess, recess_gap=0.1) for recess in (0.5, 0))
    assert plan(design, deep).thickness == plan(design, flat).thickness
    assert plan(design, deep).seats.bodies == plan(design, flat).seats.bodies
    solid, body = base(plan(design, deep)), cad.beam(design)
    assert cad.overlap(solid, body) == 0
    assert solid.distance_to(body) == pytest.approx(0, abs=1e-9)
    top = {"square": 16**2, "round": math.pi * 8**2}[shape]
    rim = (top - math.pi * 4.1**2) * 0.5
    assert solid.volume - base(plan(design, flat)).volume == pytest.approx(rim, rel=1e-9)


CHIP_4 = Design(D=4, L=4.5, l0=4.1, hall_layout="tmag5273a1", magnet_diameter=1, magnet_height=1)


@pytest.mark.parametrize(("shape", "process"), [("square", "fdm"), ("round", "sla")])
@pytest.mark.parametrize("design", [Design(), Design(c=4.0, f=7.0), CHIP_4, DESIGNS[6]], ids=name_of)
def test_grooves_mark_x_and_y_and_the_base_passes_its_checks(design, shape, process):
    plain, marked = (base(plan(design, Base(shape=shape, marks=marks), process)) for marks in (0, 1))
    removed, width = plain.cut(marked).solids(), PROCESSES[process].stroke
    centres = [solid.bounding_box().center() for solid in removed]
    places = sorted(((centre.X, centre.Y) for centre in centres), key=lambda place: abs(place[1]))
    # one groove beyond the beam along x, two beside each other along y
    assert [x > design.R for x, _ in places] == [True, False, False]
    assert places[0][1] == pytest.approx(0, abs=1e-6)
    assert sorted(x for x, _ in places[1:]) == pytest.approx([-width, width], abs=1e-6)
    assert all(0.4 <= solid.volume / (width * DEPTH) <= 2.0 + 1e-9 for solid in removed)
    mesh = solid_files.triangulated(standing(marked))
    assert marked.is_valid
    assert mesh.is_watertight
    assert [check.name for check in checks(design, marked, bodies(design)) if not check.passed] == []
    assert [check.name for check in printable("base", mesh, PROCESSES[process]) if not check.passed] == []


@pytest.mark.parametrize("design", [Design(), Design(hall_layout="tmag5273a1")], ids=name_of)
def test_the_mouth_of_a_pocket_in_the_underside_is_wider(design):
    p = plan(design, SQUARE)
    solid = base(p)
    seat = next(iter(p.seats.bodies.values()))
    (x, y, z), length = seat.corner, seat.sides[0]
    for height, share in ((0.0, 0.0), (0.3, 1.0)):
        probe = bd.Solid.make_box(0.1, 0.5, 0.05, bd.Plane((x + length, y + 0.5, z + height)))
        assert cad.overlap(solid, probe) == pytest.approx(share * probe.volume, rel=1e-6)


# Breakout boards

BREAKOUT_DESIGNS = {
    "adafruit-4366": Design(hall_layout="tlv493d-a1b6", l0=7.5),
    "adafruit-4022": Design(hall_layout="mlx90393", l0=7.6),
    "sparkfun-tmag5273": Design(hall_layout="tmag5273a1", l0=8.0),
}


@pytest.mark.parametrize("name", BREAKOUT_DESIGNS)
def test_a_breakout_board_fits_under_its_base_with_its_chip_in_place(name):
    design, choice = BREAKOUT_DESIGNS[name], Base(breakout=name)
    board, centre = breakout_boards.breakout(name, design)
    p = plan(design, choice)
    assert board.placed(board.chip, centre) == pytest.approx((0.0, 0.0))
    solid = base(plan(design, choice))
    for part in board.parts:
        (left, low), (right, high) = (board.placed(at, centre) for at in (part["box"][:2], part["box"][2:]))
        corner = min(left, right), min(low, high), -p.thickness
        body = Block(corner, (abs(right - left), abs(high - low), part["height"])).solid()
        assert overlap(solid, body) < 1e-9
    # a screw of the board's holes passes the base, which has room around it
    for x, y in p.screws:
        screw = bd.Solid.make_cylinder(board.hole / 2 - 1e-3, p.thickness, bd.Plane((x, y, -p.thickness)))
        assert overlap(solid, screw) < 1e-9
        assert p.half - max(abs(x), abs(y)) >= board.hole / 2 + EDGE - 1e-9
    # distances between the holes are those of the board
    assert math.dist(p.screws[0], p.screws[3]) == pytest.approx(math.dist(board.holes[0], board.holes[3]))


def test_pin_1_of_the_chip_on_a_turned_board_has_the_least_x_and_y():
    board, centre = breakout_boards.breakout("sparkfun-tmag5273", BREAKOUT_DESIGNS["sparkfun-tmag5273"])
    # in the board's file its pad lies 1.365 mm to the left of the middle and 0.95 mm above
    pin = board.placed([board.chip[0] - 1.365, board.chip[1] + 0.95], centre)
    assert pin == pytest.approx((-0.95, -1.365))


@pytest.mark.parametrize(
    ("design", "choices", "reason"),
    [
        (Design(), {"breakout": "adafruit-4366"}, "holds one tlv493d-a1b6; the design has 1 x three"),
        (Design(), {"breakout": "adafruit"}, "there is no breakout 'adafruit'"),
        (Design(), {"breakout": "adafruit-4366", "shape": "round"}, "set shape=square, and leave screw out"),
        (
            BREAKOUT_DESIGNS["adafruit-4022"],
            {"breakout": "adafruit-4022", "outer": 20},
            "outer must be at least 26.07",
        ),
        (
            Design(hall_layout="tlv493d-a1b6", l0=4.4, D=14.0, L=9.0),
            {"breakout": "adafruit-4366"},
            "l0 must be larger, or the base opens under the beam above",
        ),
    ],
)
def test_a_breakout_board_that_does_not_fit_is_refused(design, choices, reason):
    with pytest.raises(BadInput, match=re.escape(reason)):
        plan(design, Base(**choices))
