"""The circuit board under the base: places, rules, ground, files, refusals; what KiCad says of it."""

import dataclasses
import io
import itertools
import math
import re
import zipfile

import numpy as np
import pytest
import shapely

from geometry import base
from geometry.array_design import ArrayDesign, grid_array
from geometry.bad_input import BadInput
from geometry.cad import element_positions
from geometry.design import Design, paper, preset
from geometry.fabrication.hall_elements import SS495A
from geometry.mold import Mold
from studies.fabrication import (
    array_board,
    board_files,
    board_layers,
    circuit_board,
    kicad_schematic,
    parts_list,
    track_router,
)
from studies.fabrication.board_layers import Board, NoRoom, Pad, Part, Terminal, Track, Via, check_rules
from studies.fabrication.sensor_solids import FabricationChoices
from studies.parts import catalogues
from studies.validation.devices import board_check

FOUR = Design(hall_layout="tmag5273a1", chip_count=4, chip_x=4.5, l0=7.5)
TIP = preset("fingertip", hall_layout="tle493d-p2b6")
ROUND = base.Base(shape="round")


@pytest.fixture(scope="module")
def boards():
    """A square base with three leaded elements, one with four chips, and a round one with one chip."""
    return {
        "paper": circuit_board.board(paper(), base.plan(paper(), base.Base())),
        "four": circuit_board.board(FOUR, base.plan(FOUR, base.Base())),
        "tip": circuit_board.board(TIP, base.plan(TIP, ROUND, "sla"), 0.8),
    }


@pytest.fixture(scope="module")
def archive(boards):
    """Text of the Gerber and drill files of the board of four chips by their names."""
    data = board_files.gerber_zip(board_files.layer_stack(boards["four"]))
    with zipfile.ZipFile(io.BytesIO(data)) as packed:
        return {name: packed.read(name).decode() for name in packed.namelist()}


def by_name(made):
    return {part.reference: part for part in made.parts}


# Places


@pytest.mark.parametrize("name", ["four", "tip"])
def test_the_sensitive_volumes_of_chips_are_at_the_places_of_the_design(boards, name):
    design, parts = {"four": FOUR, "tip": TIP}[name], by_name(boards[name])
    for k, (x, y, _) in enumerate(element_positions(design)[::3], 1):
        u, v = design.chip.plate_at
        assert math.dist((parts[f"U{k}"].at[0] + u, parts[f"U{k}"].at[1] + v), (x, y)) < 1e-9


def test_pockets_pads_and_bodies_follow_a_sensitive_volume_beside_the_middle(monkeypatch):
    from geometry import design as of_design

    chip = dataclasses.replace(of_design.CHIPS["tle493d-p2b6"], plate_at=(0.3, -0.2))
    monkeypatch.setitem(of_design.CHIPS, "tle493d-p2b6", chip)
    plan = base.plan(TIP, ROUND, "sla")
    (pocket,) = plan.seats.bodies.values()
    part = by_name(circuit_board.wired(TIP, plan))["U1"]
    assert part.at == pytest.approx((-0.3, 0.2))
    assert [pocket.corner[k] + pocket.sides[k] / 2 for k in (0, 1)] == pytest.approx([-0.3, 0.2])
    (left, low), (right, high) = part.pads[0].at, part.pads[3].at
    assert ((left + right) / 2, (low + high) / 2) == pytest.approx((-0.3, 0.2))


def test_leads_of_one_axis_elements_are_behind_their_plates(boards):
    parts, design = by_name(boards["paper"]), paper()
    behind = SS495A.thickness / 2 - SS495A.depth
    assert {pad.at[0] for pad in parts["S2"].pads} == {design.f + behind}
    assert {pad.at[1] for pad in parts["S3"].pads} == {design.f + behind}
    # seen on the marked face with the leads down, the supply is on the left: S2 faces -x, S3 -y
    assert [pad.net for pad in parts["S2"].pads] == ["VDD", "GND", "S2"]
    assert [pad.at[1] for pad in parts["S2"].pads] == [SS495A.pitch, 0, -SS495A.pitch]
    assert [pad.at[0] for pad in parts["S3"].pads] == [-SS495A.pitch, 0, SS495A.pitch]


def test_only_hall_parts_are_between_board_and_base(boards):
    for made in boards.values():
        upper = {part.reference[0] for part in made.parts if not part.below}
        assert upper <= {"U", "S", "J"}
        header = by_name(made)["J1"].body
        assert header[3] < min(b for _, b, _, _ in made.pockets)


# Rules, checked anew: every pair of nets, every hole, the edge


@pytest.mark.parametrize("name", ["paper", "four", "tip"])
def test_no_net_touches_another_and_each_is_one_piece(boards, name):
    made = boards[name]
    faces = []
    for below in (False, True):
        nets = {}
        for piece in board_layers.copper(made):
            if piece.faces[below]:
                nets.setdefault(piece.net, []).append(piece.shape)
        nets.setdefault("GND", []).extend(made.pours[below])
        joined = {net: shapely.union_all(shapes) for net, shapes in nets.items()}
        gaps = [a.distance(b) for a, b in itertools.combinations(joined.values(), 2)]
        assert min(gaps) >= board_layers.CLEARANCE - 1e-4
        assert all(made.area.buffer(-board_layers.EDGE + 1e-6).covers(shape) for shape in joined.values())
        faces.append(joined)
    holes = [shapely.Point(x, y).buffer(d / 2) for x, y, d in made.holes]
    assert all(
        shape.distance(hole) >= board_layers.HOLE_GAP - 1e-3
        for hole in holes
        for joined in faces
        for shape in joined.values()
    )


def broken(made, **change):
    with pytest.raises(board_layers.NoRoom) as caught:
        board_layers.check_rules(dataclasses.replace(made, **change))
    return str(caught.value)


def test_each_rule_is_checked(boards):
    made = boards["four"]
    assert "apart, less than 0.15 mm" in broken(made, tracks=(*made.tracks, Track("SDA", True, ((-3, 0), (3, 0)))))
    assert "0.3 mm to the edge" in broken(made, vias=(*made.vias, Via("GND", (0, made.area.bounds[3] - 0.3))))
    x, y, d = made.holes[0]
    assert "0.25 mm to the screw hole" in broken(made, vias=(*made.vias, Via("GND", (x + d / 2 + 0.3, y))))
    first = made.parts[0]
    beside = dataclasses.replace(first, reference="U9", pads=())
    assert "U1 and U9 would overlap" in broken(made, parts=(*made.parts, beside))


def test_a_net_in_two_pieces_is_refused(boards):
    made = boards["four"]
    tracks = tuple(track for track in made.tracks if track.net != "SDA" or track.below)
    with pytest.raises(board_layers.NoRoom, match="not be joined to the net SDA"):
        board_layers.check_joined(dataclasses.replace(made, tracks=tracks))


# Files


def test_gerbonara_reads_back_pads_vias_and_holes(boards, archive):
    from gerbonara import ExcellonFile, GerberFile
    from gerbonara.utils import MM

    made = boards["four"]
    upper = GerberFile.from_string(archive["sensor-F.Cu.gbr"])
    flashes = {(round(each.x, 4), round(each.y, 4)) for each in upper.objects if type(each).__name__ == "Flash"}
    pads = {pad.at for part in made.parts for pad in part.pads if pad.drill or not part.below}
    assert flashes == {(round(x, 4), round(y, 4)) for x, y in pads | {via.at for via in made.vias}}
    drills = ExcellonFile.from_string(archive["sensor-PTH.drl"]).objects
    leads = sum(pad.drill > 0 for part in made.parts for pad in part.pads)
    assert len(drills) == len(made.vias) + leads
    screws = {
        (each.x, each.y, each.aperture.diameter)
        for each in ExcellonFile.from_string(archive["sensor-NPTH.drl"]).objects
    }
    assert {tuple(round(value, 3) for value in each) for each in screws} == {
        tuple(round(value, 3) for value in hole) for hole in made.holes
    }
    (left, low), (right, high) = GerberFile.from_string(archive["sensor-Edge.Cuts.gbr"]).bounding_box(MM)
    assert (left + 0.05, low + 0.05, right - 0.05, high - 0.05) == pytest.approx(made.area.bounds, abs=1e-4)


def test_every_command_of_a_gerber_file_is_complete(archive):
    for name, text in archive.items():
        if name.endswith(".gbr"):
            assert all(line.endswith(("*", "%")) for line in text.splitlines()), name
            assert "%TF.FileFunction," in text


@pytest.mark.parametrize("name", ["paper", "four", "tip"])
def test_each_pin_of_the_header_and_each_hall_part_is_named(boards, name):
    made = boards[name]
    drawn = shapely.MultiLineString(made.ink)
    for pad in by_name(made)["J1"].pads:
        above = shapely.box(pad.at[0] - 0.3, pad.at[1] + pad.size[1] / 2, pad.at[0] + 0.3, pad.at[1] + 3)
        assert drawn.intersects(above)
    named = sum(len(board_layers.letters(part.reference, (0, 0))) for part in made.parts[:-1] if not part.below)
    labels = sum(len(board_layers.letters(label, (0, 0))) for label in made.labels)
    axes, triangles = len(board_layers._axes((0, 0))), sum(not part.below for part in made.parts[:-1])
    assert len(made.ink) == named + labels + axes + triangles


def test_an_outline_with_holes_becomes_one_ring_of_the_same_area(boards):
    for made in boards.values():
        for shape in itertools.chain(*made.pours):
            ring = board_files.one_ring(shape)
            assert abs(shapely.Polygon(ring).area) == pytest.approx(shape.area, rel=1e-9)


def test_the_kicad_file_has_each_pad_at_its_place_and_net(boards):
    from gerbonara.cad.kicad.sexp import parse_sexp

    made = boards["tip"]
    read = parse_sexp(board_files.kicad_board(made, "a title"))
    assert ["general", ["thickness", 0.8]] in read
    footprints = [item for item in read if isinstance(item, list) and item[0] == "footprint"]
    for part, footprint in zip(made.parts, footprints, strict=True):
        (x0, y0, *angle) = next(item for item in footprint if isinstance(item, list) and item[0] == "at")[1:]
        assert sum(angle) == part.angle
        turn = math.radians(part.angle)
        pads = [item for item in footprint if isinstance(item, list) and item[0] == "pad"]
        for pad, item in zip(part.pads, pads, strict=True):
            values = {str(entry[0]): entry[1:] for entry in item if isinstance(entry, list)}
            # the place in the footprint's frame; KiCad's y axes point downwards
            u, v = values["at"][0], -values["at"][1]
            x, y = u * math.cos(turn) - v * math.sin(turn), u * math.sin(turn) + v * math.cos(turn)
            assert math.dist((x0 - board_files.SHEET + x, board_files.SHEET - y0 + y), pad.at) < 1e-5
            assert values.get("net", ["", ""])[1] == pad.net


@pytest.mark.parametrize("name", ["paper", "four"])
def test_the_schematic_has_the_nets_of_the_board(boards, name):
    made = boards[name]
    text, drawn = kicad_schematic.schematic(made, "a title"), board_files.kicad_board(made, "a title")
    assert board_check.nets_in(text) == board_check.nets_of(made)
    for wrong in ('(global_label "VDD"', '(text "GND"'):
        other = board_check.nets_in(text.replace('(global_label "GND"', wrong, 1))
        assert len(other.items() ^ board_check.nets_of(made).items()) in (1, 2)
    # footprints name the symbols
    paths = re.findall(r'\(path "/([0-9a-f-]+)"\)', drawn)
    assert len(paths) == len(made.parts)
    assert re.findall(r"\(on_board yes\)\s+\(uuid ([0-9a-f-]+)\)", text) == paths


def test_bill_and_places_name_each_part_once(boards):
    made = boards["four"]
    named = [name for row in board_files.bill(made) for name in row["Designator"].split(",")]
    assert sorted(named) == sorted(part.reference for part in made.parts)
    assert [row["Comment"] for row in board_files.bill(made)[:1]] == ["TMAG5273A1"]
    second = board_files.positions(made)[2]
    assert (second["Designator"], second["Mid X"], second["Mid Y"]) == ("U2", "0.0000mm", "4.5000mm")
    assert (second["Rotation"], second["Layer"]) == ("90", "top")


def test_the_verb_writes_all_files_and_says_what_is_assumed(run, tmp_path):
    folder = tmp_path / "out"
    status, out, err = run("board", "paper", "--out", folder, "--thickness", 0.8)
    assert status == 0
    assert {path.name for path in folder.glob("[!.]*")} == set(board_files.FILES)
    assert "S1,S2,S3" in out
    assert "are assumed" in err
    page = (folder / board_files.PAGE).read_text("utf-8")
    assert "17.74 x 23.74 mm, 0.8 mm thick" in page
    assert "| pin of the header | VDD | GND | S1 | S3 | S2 |" in page
    assert (folder / board_files.PICTURE).read_bytes()[:4] == b"\x89PNG"
    assert "(thickness 0.8)" in (folder / board_files.BOARD).read_text("utf-8")


# Chips that share a bus


def test_each_of_two_chips_whose_supply_sets_the_address_has_its_own():
    design = Design(hall_layout="tlv493d-a1b6", chip_count=2, chip_x=3.0, l0=7.5)
    made = circuit_board.wired(design, base.plan(design, base.Base()))
    supplies = [pad.net for part in made.parts for pad in part.pads if part.reference[0] == "U" and pad.number == "4"]
    assert supplies == ["VDD1", "VDD2"]
    assert made.labels == ("GND", "VDD2", "SDA", "SCL", "VDD1")
    assert {pad.net for part in made.parts for pad in part.pads if part.reference[0] == "R"} == {"VDD2", "SDA", "SCL"}


def test_a_chip_that_is_addressed_by_pins_has_them_on_ground_or_supply():
    """A0 (pin 12) and A1 (pin 11) of the MLX90393 are the last two bits of 0x0C to 0x0F."""
    design = Design(hall_layout="mlx90393", chip_count=4, chip_x=7.0, l0=8.0)
    made = circuit_board.board(design, base.plan(design, base.Base()))
    chips = [{pad.number: pad.net for pad in part.pads} for part in made.parts if part.reference[0] == "U"]
    bits = [(nets["11"], nets["12"]) for nets in chips]
    assert bits == [("GND", "GND"), ("GND", "VDD"), ("VDD", "GND"), ("VDD", "VDD")]
    assert made.addresses == ("0x0C", "0x0D", "0x0E", "0x0F")
    assert [nets["2"] for nets in chips] == 4 * ["VDD"]
    u, v = by_name(made)["U1"].at
    # seen from above, pins run counter-clockwise from the one at the least x and y
    at = {pad.number: (pad.at[0] - u, pad.at[1] - v) for pad in by_name(made)["U1"].pads}
    assert at["1"] == pytest.approx((-0.75, -1.435))
    assert at["5"] == pytest.approx((1.435, -0.75))
    assert at["9"] == pytest.approx((0.75, 1.435))
    assert at["13"] == pytest.approx((-1.435, 0.75))
    assert at["17"] == (0.0, 0.0)


# Refusals


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ("paper --thickness 1", "thickness of the board must be 0.8 or 1.6 mm; got 1 mm"),
        (
            "paper --set hall_layout=als31300-500 --set l0=8 --set chip_noise=1e-5",
            "no footprint of als31300-500 is known: set hall_layout",
        ),
        (
            "paper --set hall_layout=tmag5170a1 --set l0=8",
            "no circuit of tmag5170a1 is known: set hall_layout to one of",
        ),
        (
            "paper --set hall_layout=mlx90393 --set l0=7.5 --set chip_noise=1e-6",
            "to the screw hole at 4.67, -4.67: set a larger base (--base outer=16.5)",
        ),
        (
            "paper --set hall_layout=tlv493d-a1b6 --set chip_count=3 --set chip_x=5 --set l0=7.5",
            "3 chips tlv493d-a1b6 cannot share a bus, as they have 2 addresses, 0x5E, 0x1F: take tle493d-w2b6",
        ),
        (
            "paper --set hall_layout=tmag5273a1 --set chip_count=4 --set chip_x=3.8 --set l0=7.5",
            "less than 0.15 mm: set chip_x to 4.3 mm or more",
        ),
        ("paper --base outer=5", "outer must be at least"),
        ("fingertip --axis D=6,7", "board takes no --axis"),
    ],
)
def test_what_cannot_be_made_is_refused(refusal, tmp_path, words, reason):
    folder = tmp_path / "out"
    assert reason in refusal("board", *words.split(), "--out", folder)
    assert not folder.exists()


def test_elements_under_the_beam_have_a_board():
    design = paper(f=3.2, c=-2.0, l0=8.0)
    made = circuit_board.board(design, base.plan(design, base.Base()))
    assert {pad.at[0] for pad in by_name(made)["S2"].pads} == {3.2 + SS495A.thickness / 2 - SS495A.depth}


def test_a_base_narrower_than_its_header_is_refused():
    plan = dataclasses.replace(base.plan(TIP, ROUND, "sla"), half=2.5)
    with pytest.raises(BadInput, match=r"a base of 5 mm is too narrow for a header of 4 pins, which needs 6.71 mm"):
        circuit_board.wired(TIP, plan)


# Arrays


PAIR = Design(hall_layout="tlv493d-a1b6", l0=8.0)


def test_an_array_has_all_chips_on_one_board_with_a_bus_for_each_set_of_addresses():
    """Two addresses for four chips: two channels of a switch, each with both supplies; every net is joined."""
    array = ArrayDesign(PAIR, np.array([[0.0, 0.0], [14.0, 2.0], [3.0, 15.0], [17.0, 14.0]]), np.ones(4))
    made = array_board.board(base.array_plan(array, base.Base()))
    parts = by_name(made)
    for k, (x, y) in enumerate(array.places.tolist()):
        chip = parts[f"U{k + 1}"]
        assert chip.at == (x, y)
        nets = {pad.net for pad in chip.pads}
        assert nets == {f"SD{k // 2}", f"SC{k // 2}", f"VDD{k % 2 + 1}", "GND"}
    assert made.addresses == ("0x5E", "0x1F") * 2
    assert made.channels == (0, 0, 1, 1)
    switch = {pad.number: pad.net for pad in parts["U5"].pads}
    assert [switch[str(k)] for k in (1, 2, 3, 4, 5, 6, 7, 8, 12, 21, 22, 23, 24)] == (
        ["GND", "GND", "RESET", "SD0", "SC0", "SD1", "SC1", "", "GND", "GND", "SCL", "SDA", "VDD2"]
    )
    pulled = {part.pads[1].net for part in made.parts if part.reference[0] == "R"}
    assert pulled == {"RESET", "SDA", "SCL", "SD0", "SC0", "SD1", "SC1"}
    assert board_check.nets_in(kicad_schematic.schematic(made, "array")) == board_check.nets_of(made)
    for via in made.vias:
        at = shapely.Point(via.at)
        ends = {t.below for t in made.tracks if t.net == via.net and shapely.LineString(t.points).distance(at) < 1e-3}
        assert via.net == "GND" or ends == {False, True}
    # all that the list of parts counts is on the board before its tracks are found
    whole = base.array_plan(array, base.Base())
    assert board_files.bill(parts_list.board_of(PAIR, whole.one, whole)) == board_files.bill(made)


def test_ground_that_tracks_part_is_joined_by_vias():
    """Four fingertips 14 mm apart: the tracks of the upper face enclose a pad of ground."""
    whole = base.array_plan(grid_array(preset("fingertip"), 2, 2, 14.0), base.Base(), "sla")
    made = array_board.wired(whole)
    poured = dataclasses.replace(
        made, pours=(board_layers.pour(made, below=False), board_layers.pour(made, below=True))
    )
    with pytest.raises(board_layers.NoRoom, match="would not be joined to the net GND"):
        board_layers.check_joined(poured)
    joined = board_layers.stitched(poured)
    board_layers.check_joined(joined)
    board_layers.check_rules(joined)
    assert len(joined.vias) > len(poured.vias)


def test_an_array_that_no_board_holds_is_refused():
    many = dataclasses.replace(PAIR, hall_layout="tle493d-w2b6")
    with pytest.raises(BadInput, match="36 chips tle493d-w2b6 are more than 8 buses of 4 addresses hold, 32"):
        array_board.board(base.array_plan(grid_array(many, 6, 6, 12.0), base.Base()))
    with pytest.raises(BadInput, match=r"thickness of the board must be 0.8 or 1.6 mm; got 1 mm"):
        array_board.board(base.array_plan(grid_array(PAIR, 1, 2, 12.0), base.Base()), 1.0)
    three = dataclasses.replace(PAIR, chip_count=3, chip_x=4.4)
    with pytest.raises(BadInput, match=r"27 chips .* hold, 16: take fewer beams or chips, or take tle493d-w2b6"):
        array_board.board(base.array_plan(grid_array(three, 3, 3, 14.0), base.Base()))


def test_chips_of_one_beam_are_on_two_buses_where_they_have_two_addresses():
    """A board of three TLV493D below each of two beams; below a single one they are refused (as a verb, above)."""
    three = dataclasses.replace(PAIR, chip_count=3, chip_x=4.4)
    made = array_board.board(base.array_plan(grid_array(three, 1, 2, 14.0), base.Base()))
    assert made.addresses == ("0x5E", "0x1F") * 3
    assert made.channels == (0, 0, 1, 1, 2, 2)
    board_layers.check_rules(made)


def test_a_refusal_says_a_larger_pitch_only_where_a_board_of_it_has_room():
    near = Design(D=4.2, L=4.8, magnet_height=1.0, magnet_diameter=2.0, l0=5.5, hall_layout="tmag5273a1")
    with pytest.raises(BadInput, match=r"take a larger pitch \(7 mm has room\), or fewer beams$"):
        array_board.board(base.array_plan(grid_array(near, 2, 1, 4.4), base.Base(recess=0), "sla"))
    array_board.board(base.array_plan(grid_array(near, 2, 1, 7.0), base.Base(recess=0), "sla"))
    # the chips of each beam are too near to its screws
    three = dataclasses.replace(FOUR, chip_count=3, chip_x=2.9, D=6.2, L=6.8, magnet_height=3.0)
    with pytest.raises(
        BadInput, match=r"to the screw hole .*: a pitch of 24 mm has none either, so take another chip_x"
    ):
        array_board.board(base.array_plan(grid_array(three, 1, 2, 16.0), base.Base(), "sla"))


def test_tracks_are_found_round_others_and_through_the_board_or_not_at_all():
    """A ring on both faces shuts a place in; on one face a via leads out of it."""
    edges, area = circuit_board.rectangle((-6.0, -6.0, 6.0, 6.0), (-2.0, -8.0, 2.0))
    corners = ((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0), (-2.0, -2.0))
    header = Part(
        "J1", "", "", (0.0, -7.0), 0.0, False, (Pad("1", "", (0.0, -7.0), (1.0, 1.0), 0.6),), (0, -7, 0, -7, 1)
    )
    ends = [Terminal("A", at, (True, False)) for at in ((0.0, 0.0), (4.0, 0.0))]
    for faces, vias in (((False,), 2), ((False, True), None)):
        ring = tuple(Track("GND", below, corners) for below in faces)
        made = Board(1.6, edges, area, (), (), (header,), ring, (), ())
        if vias is None:
            with pytest.raises(NoRoom, match="no way is left for the net A"):
                track_router.routed(made, ends)
            continue
        found, through = track_router.routed(made, ends)
        assert len(through) == vias
        check_rules(dataclasses.replace(made, tracks=(*ring, *found), vias=tuple(through)))
        assert {found[0].points[0], found[-1].points[-1]} == {end.at for end in ends}


# The list of parts


def listed(design, mold=Mold(), silicone="Sylgard 184"):
    choices = FabricationChoices(mold=mold, silicone=catalogues.mix_named(silicone))
    plan = base.plan(design, base.Base(), mold.process)
    volumes = {"base": 900.0, "mold_a": 1866.0, "mold_b": 2249.0}
    return parts_list.rows(design, choices, plan, volumes, parts_list.board_of(design, plan))


def test_the_list_counts_for_all_sensors_of_the_mould():
    alone, six = listed(paper()), listed(paper(), Mold(columns=3, rows=2))
    groups = ("magnet", "electronics", "screws")
    counts = [{row["item"]: row["quantity"] for row in rows if row["group"] in groups} for rows in (alone, six)]
    assert counts[1] == {item: 6 * count for item, count in counts[0].items()}
    assert counts[0]["SS495A"] == 3
    assert "M2 x 8 mm" in counts[0]
    assert {row["for_sensors"] for row in six} == {6}


def test_masses_are_those_of_the_recipe_and_filament_that_of_the_volumes():
    from studies.fabrication import casting_recipe

    rows = {row["item"]: row for row in listed(paper())}
    choices = FabricationChoices(silicone=catalogues.mix_named("Sylgard 184"))
    mixes = casting_recipe.mixes_of(paper(), choices)
    assert rows["Sylgard 184, part A"]["quantity"] == pytest.approx(sum(m["batches"] * m["A_g"] for m in mixes))
    assert rows["base of filament"]["quantity"] == pytest.approx(900 * 1.24e-3, abs=0.05)
    assert "about 10 to 30 min" in rows["mold_a of filament"]["note"]


def test_no_price_is_invented():
    assert all(row["price_low"] is None and row["price_date"] is None for row in listed(paper()))


def test_a_design_without_a_board_lists_its_chips():
    rows = [row for row in listed(Design(hall_layout="mlx90393", l0=7.5)) if row["group"] == "electronics"]
    assert [(row["item"], row["quantity"]) for row in rows] == [("Hall part mlx90393", 1)]


# KiCad


def test_kicad_finds_no_broken_rule_and_plots_the_same_shapes():
    try:
        python = board_check.kicad_python()
    except BadInput as error:
        pytest.skip(f"not installed: KiCad ({error})")
    row = board_check.checked(board_check.CASES[1], python)
    assert (row["findings"], row["refilled_findings"], row["said"]) == (0, 0, "")
    assert (row["other_shapes"], row["other_holes"]) == (0, 0)
    assert row["off_um"] < 1
    assert row["area_off_percent"] < board_check.LARGEST_AREA


def test_another_place_is_another_shape():
    here = [("Flash", (1.0, 1.0), (0.0, 0.0)), ("Line", (0.2,), (0.0, 0.0, 1.0, 0.0))]
    assert board_check.unlike(here, here) == 0
    assert board_check.unlike(here, [("Flash", (1.0, 1.0), (0.002, 0.0)), here[1]]) == 2


def test_each_address_has_an_order_and_each_circuit_a_source():
    for layout, each in circuit_board.circuits().items():
        assert layout == "three" or len(each.orders) == len(each.addresses)
        assert all(re.fullmatch(r"0x[0-9A-F]{2}", address) for address in each.addresses)
        assert each.source
