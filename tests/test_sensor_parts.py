"""What the verb cad makes, says and leaves alone, alone and in batches."""

import dataclasses
import itertools
import math
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
import worker_tasks
from PIL import Image

from analytic.magnet import repulsion, resting_distance
from geometry import base
from geometry.array_design import grid_array
from geometry.cad import beam_volume
from geometry.design import BadInput, Design, paper, preset
from geometry.fabrication import hall_elements
from geometry.fabrication.printability import Check
from geometry.mold import Mold
from studies.fabrication import assembly_picture, casting_recipe, design_variants, sensor_parts, sensor_solids
from studies.inputs.option_groups import Fabrication
from studies.output import own_files
from studies.simulation import design_summary

JIG = ["jig", "jig_plunger", "jig_bar", "jig_gauge"]
PARTS = ["beam", "silicone", "magnet", "base", "mold_a", "mold_b", *JIG, "stand", "fixture"]
SHEETS = {
    "sensor.svg",
    "base.svg",
    "mold.svg",
    "jig.svg",
    "bench.svg",
    "plate.3mf",
    "jig.png",
    "assembly.step",
    "mold.step",
    "assembly.png",
    "board.dxf",
    "README.md",
    "parts.csv",
}


def files_of(folder):
    return {path.name for path in folder.glob("[!.]*")}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The paper's sensor in a folder whose name has spaces and letters beyond ASCII, and which holds a file."""
    from studies.cli import entry_point

    folder = tmp_path_factory.mktemp("cad") / "Ördner mit Leerzeichen 磁石"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    assert entry_point.main(["cad", "paper", "--out", str(folder), "--json"]) == 0
    return folder


def test_every_file_is_there_and_others_stay(made):
    written = {f"{name}.{ending}" for name in PARTS for ending in ("step", "stl", "3mf")}
    assert files_of(made) == written | SHEETS | {"notes.txt"}
    assert (made / "notes.txt").read_text() == "mine"
    assert all((made / name).stat().st_size > 1000 for name in written | SHEETS)


def test_the_recipe_names_files_volumes_and_checks(made):
    text = (made / "README.md").read_text(encoding="utf-8")
    assert text.startswith(casting_recipe.MARK)
    assert text.splitlines()[2].startswith("Written by `magtip cad paper --out ")
    for name in (
        *PARTS,
        "assembly.png",
        "assembly.step",
        "mold.step",
        "sensor.svg",
        "base.svg",
        "mold.svg",
        "board.dxf",
    ):
        assert name in text
    # 385.37 mm³ of beam less 75.39 of pin, then the pin less 25.08 of magnet; B is filled with the whole beam
    assert "| first: the beam round the pin | 1 | 0.310 | 0.385 | 2.48 | 2.68 | - | - |" in text
    assert "| second: over the magnet | 1 | 0.050 | 0.050 | 2.06 | 2.23 | - | - |" in text
    assert "north pole up" in text
    # the magnet's top of the paper's beam, L - D/2 - h/2 below the base plane
    assert "must lie 4.00 mm below B's rim" in text
    assert "nan" not in text


def test_the_check_of_a_made_sensor_moves_the_magnet_as_far_as_all_readings_change():
    """At 0.5 mm the chip of the fingertip reads the end of its range."""
    asked = {name: casting_recipe.expected_readings(preset(name)) for name in ("paper", "fingertip")}
    assert {name: (each["moved"], each["saturated"]) for name, each in asked.items()} == {
        "paper": (0.5, []),
        "fingertip": (0.3, []),
    }
    (_, rest, lower, *_), *_ = asked["fingertip"]["rows"]
    assert rest < lower < 80


def test_no_cure_is_hotter_than_mould_and_magnet_stand():
    recipe = casting_recipe.recipe_of(paper(), sensor_solids.FabricationChoices(Mold(process="sla")))
    assert recipe["magnet_limit_C"] == 80
    for cure in recipe["cures"]:
        assert 20 < cure["first_cure_C"] < cure["mold_limit_C"]
        assert 20 < cure["second_cure_C"] < min(cure["mold_limit_C"], recipe["magnet_limit_C"])
    bare = dataclasses.replace(paper(), magnet_diameter=0.0, magnet_height=0.0, magnet_edge_radius=0.0)
    recipe = casting_recipe.recipe_of(bare, sensor_solids.FabricationChoices(Mold(process="sla")))
    assert recipe["magnet_limit_C"] is None
    assert all(cure["second_cure_C"] is None for cure in recipe["cures"])


MIX = {"name": "Sylgard 184", "mixed": "10A:1B by weight", "hours": 48, "temperature": 23, "density": 1200.0}
MIX |= {"moduli": (1.3, 3.0), "source": "a paper", "mixed_source": "a label", "pot_life": 90}
MIX |= {"assumed": ("mixed", "hours")}


def recipe_text(design, choices, plan=None):
    size, recipe = design_summary.outer_size(design, plan), casting_recipe.recipe_of(design, choices, plan)
    row = sensor_parts.fabricated("ok", "", Path("out"), size | {"recipe": recipe})
    return casting_recipe.text(design, choices, row, plan, [], "magtip cad")


def test_a_recipe_warns_of_large_magnets_and_says_what_holds_the_board():
    choices, chip = (
        sensor_solids.FabricationChoices(),
        dataclasses.replace(paper(), hall_layout="tle493d-p2b6", l0=8.0),
    )
    text = recipe_text(chip, choices, base.plan(chip, base.Base(shape="round")))
    # 0.1 mm of play on each side of pads 2.4 x 3.4 mm, in a body of 2.9 x 2.5 mm
    assert f"lets it turn by up to {math.degrees(0.2 / 3.4):.2g}°" in text
    assert "room for the chip and its pads" in text
    square = recipe_text(chip, choices, base.plan(chip, base.Base()))
    assert "lets it turn" not in square
    assert "Four screws M2 x 8 mm" in square
    unknown = dataclasses.replace(chip, hall_layout="als31300-500")
    assert "room for the chip alone" in recipe_text(unknown, choices, base.plan(unknown, base.Base()))
    large = dataclasses.replace(paper(), D=60.0, L=70.0, l0=50.0, magnet_diameter=40.0, magnet_height=20.0)
    assert "hold with some 360 N" in recipe_text(large, choices)
    assert "crush fingers" not in square


def test_the_recipe_mixes_and_weighs_the_silicone_that_was_chosen():
    """The design's own density of 1080 kg/m³ is that of another silicone."""
    text = recipe_text(paper(), sensor_solids.FabricationChoices(silicone=MIX))
    assert "Mix Sylgard 184 10A:1B by weight, a ratio to check on its data sheet" in text
    assert "First cure: 48 h at 23 °C, times to check on its data sheet" in text
    rows = [row.split("|") for row in text.splitlines() if row.startswith(("| first:", "| second:"))]
    for *_, volume, mass, A, B, _ in rows:
        assert float(mass) == pytest.approx(1.2 * float(volume), abs=0.013)
        assert float(A) == pytest.approx(10 * float(B))
        assert 0 <= float(A) + float(B) - float(mass) < 0.12
    assert "masses those of Sylgard 184 with 1200 kg/m³." in text
    read = MIX | {"assumed": ()}
    assert "10A:1B by weight (a label)" in recipe_text(paper(), sensor_solids.FabricationChoices(silicone=read))


def test_what_is_mixed_fills_every_cavity_to_its_rim():
    """A slender beam's pin takes a third of it: what stays in the parts would not fill B."""
    design = dataclasses.replace(paper(), L=20.0, l0=20.0)
    for mold in (Mold(columns=3, rows=2), Mold(shrink=0.1)):
        layer, glue, cover = casting_recipe.mixes_of(design, sensor_solids.FabricationChoices(mold, silicone=MIX))
        rim = mold.columns * mold.rows * beam_volume(design.shape) / (1 - mold.shrink) ** 3 / 1e3
        assert layer["poured_mL"] == pytest.approx(rim)
        assert layer["mix_mL"] - casting_recipe.CUP / 1e3 > rim > layer["stays_mL"] + cover["stays_mL"]
        assert glue["mix_mL"] > casting_recipe.CUP / 1e3


@pytest.mark.parametrize(
    ("pot_life", "said"), [(90, "the pot life is 90 min.\n"), (15, "degas once"), (5, "fewer cavities")]
)
def test_two_degassings_are_held_against_the_pot_life(pot_life, said):
    assert said in recipe_text(paper(), sensor_solids.FabricationChoices(silicone=MIX | {"pot_life": pot_life}))


def test_each_magnet_that_repels_has_a_batch_of_glue_and_a_cure_of_its_own_without_a_jig():
    design = dataclasses.replace(paper(), D=12.0, L=14.0, l0=10.5, magnet_diameter=6.0, magnet_height=3.0)
    for columns, jig, batches in ((1, 0, 1), (2, 0, 2), (2, 1, 1)):
        recipe = casting_recipe.recipe_of(
            design, sensor_solids.FabricationChoices(Mold(columns=columns, jig=jig), silicone=MIX)
        )
        assert recipe["mixes"][1]["batches"] == batches
        assert recipe["total_h"] == casting_recipe.HANDLING + 48 * (2 + batches)


def test_neighbouring_magnets_are_glued_one_after_another():
    design = dataclasses.replace(paper(), D=12.0, L=14.0, l0=10.5, magnet_diameter=6.0, magnet_height=3.0)
    text = recipe_text(design, sensor_solids.FabricationChoices(Mold(columns=2, jig=0)))
    assert "repel with 0.043 N, 6.9 times their weight" in text
    assert "stay by themselves from 32.2 mm" in text
    assert text.index("one after another") < text.index("Let the glue cure") < text.index("Second pour")
    assert "one after another" not in recipe_text(design, sensor_solids.FabricationChoices(Mold(jig=0)))


def test_magnets_that_would_move_each_other_are_glued_in_groups_that_lie_apart():
    design = dataclasses.replace(paper(), D=10.0, L=12.0, l0=10.5, magnet_diameter=4.0, magnet_height=3.0)
    array = grid_array(design, 3, 3, 16.0, "checkerboard")
    groups, apart = casting_recipe.gluing_order(design, Mold(array=array, jig=0)), resting_distance(design)
    assert sorted(k for group in groups for k in group) == list(range(1, 10))
    assert max(map(len, groups)) == 4
    for group in groups:
        for i, j in itertools.combinations(group, 2):
            assert math.dist(array.places[i - 1], array.places[j - 1]) >= apart
    assert casting_recipe.gluing_order(design, Mold(array=array)) == [list(range(1, 10))]


def test_the_recipe_of_an_array_says_the_forces_between_its_magnets():
    """Two magnets pull with the force of two that repel; one that comes down beside another of its pole pushes it
    down, beside the other pole it lifts it."""
    for words, lifts in ((("up", "up"), False), (("up", "down"), True)):
        mold = Mold(array=grid_array(paper(), 1, 2, 12.0, words))
        found = casting_recipe.neighbours_push(paper(), mold)
        radius, height = paper().magnet_diameter / 2, paper().magnet_height
        assert found["pair_N"] == pytest.approx(repulsion(radius, height, paper().remanence, 12.0), rel=1e-4)
        assert found["net_N"] == pytest.approx(found["pair_N"], rel=1e-9)
        assert (found["alike"], found["opposite"]) == (not lifts, lifts)
        assert (found["lift_N"] > 0.3 * found["pair_N"]) == lifts


def test_design_tells_the_places_forces_and_base_of_an_array():
    """The pull of two magnets is that of the closed form; beams that are too soft for their magnets are told."""
    design = Design(hall_layout="tle493d-w2b6", l0=8.0)
    array = grid_array(design, 1, 2, 14.0, ("up", "down"))
    (record,) = design_summary.study(design, array=array).records
    found, beams = record["array"], record["array"]["beams"]
    assert [(row["x_mm"], row["north"]) for row in beams] == [(-7.0, "down"), (7.0, "up")]
    pull = repulsion(design.magnet_diameter / 2, design.magnet_height, design.remanence, 14.0)
    assert found["magnets_N"] == pytest.approx(pull, rel=1e-4)
    assert found["base_size_mm"] == pytest.approx(record["derived"]["assembled_size_mm"][:2])
    assert found["base_size_mm"][0] - found["base_size_mm"][1] == pytest.approx(14.0)
    soft = dataclasses.replace(design, E=1e-3)
    (record,) = design_summary.study(soft, array=dataclasses.replace(array, design=soft)).records
    assert record["array"]["margin"] < 0
    assert 14.0 < record["array"]["critical_pitch_mm"] < 100.0
    assert any("snap together at a pitch of 14 mm" in warning for warning in record["warnings"])


def test_an_array_is_exported_as_one_sensor(tmp_path):
    design = Design(hall_layout="tle493d-w2b6", l0=8.0)
    array = grid_array(design, 1, 2, 14.0, ("up", "down"))
    choices = sensor_solids.FabricationChoices(Mold(array=array, jig=0), array=array)
    row = sensor_parts.build(design, tmp_path / "parts", lambda *_: None, choices, picture=False)
    assert row["status"] == "ok"
    names = {part["name"] for part in row["parts"]}
    assert names >= {"array_base", "mold_a", "stand"}
    assert not names & {"base", "fixture"}
    assert row["assembled_size_mm"][0] - row["assembled_size_mm"][1] == pytest.approx(14.0)
    page, listed = ((tmp_path / "parts" / name).read_text("utf-8") for name in ("README.md", "parts.csv"))
    assert "1 N   2 S" in page
    assert "array of 2 beams" in page
    assert "of 1 the other way" in listed
    assert "base on the fixture" not in listed
    single = sensor_solids.parse_fabrication_choices(Fabrication(mold=["columns=1"]), array=array)
    assert (single.mold.cavities, len(single.array)) == (1, 2)


def test_the_jig_holds_all_magnets_for_one_cure():
    design = dataclasses.replace(paper(), D=12.0, L=14.0, l0=10.5, magnet_diameter=6.0, magnet_height=3.0)
    text = recipe_text(design, sensor_solids.FabricationChoices(Mold(columns=2, shrink=0.01)))
    order = [
        "Tell the pole",
        "jig onto B",
        "repel with",
        "passes over one that lies",
        "Lay the bar",
        "top must lie",
        "Second pour",
    ]
    places = [text.index(words) for words in order]
    assert places == sorted(places)
    # the pocket of (L - D/2 + h/2) is longer by the shrinkage, the magnet is not
    assert f"{9.5 / 0.99 - 3:.2f} mm below B's rim" in text
    steps = re.findall(r"^(\d+)\. ", text, re.MULTILINE)
    assert steps[:15] == [str(k) for k in range(1, 16)]
    assert "jig" not in recipe_text(design, sensor_solids.FabricationChoices(Mold(jig=0)))


def test_assembly_and_mould_are_named_and_coloured(made):
    import build123d as bd

    sensor, mold = (bd.import_step(made / f"{name}.step") for name in ("assembly", "mold"))
    assert [child.label for child in sensor.children] == ["silicone", "magnet", "base", "S1", "S2", "S3"]
    assert [child.label for child in mold.children] == ["mold_a", "mold_b"]
    for child in (*sensor.children, *mold.children):
        assert child.color is not None
    # printed parts stand on the bed, A turned over
    stood = bd.import_step(made / "mold_a.step")
    assert min(vertex.Z for vertex in stood.vertices()) == pytest.approx(0, abs=1e-9)
    assert stood.volume == pytest.approx(mold.children[0].volume, rel=1e-12)
    assert stood.label == "mold_a"
    red = next(iter(bd.Color("goldenrod")))
    assert f"COLOUR_RGB('',{red:.5f}"[:-1] in (made / "mold_a.step").read_text()


def test_the_picture_shows_the_sensor_in_colour(made):
    image = np.asarray(Image.open(made / "assembly.png").convert("RGB")) / 255
    tall, wide, _ = image.shape
    assert assembly_picture.SIZE[0] / 2 < wide <= assembly_picture.SIZE[0]
    assert assembly_picture.SIZE[1] / 2 < tall <= assembly_picture.SIZE[1]
    # a white rim all round, and no more than that
    rim = assembly_picture.RIM
    frame = image[rim:-rim, rim:-rim].min(axis=2) < 1
    assert (image[[0, -1]] == 1).all()
    assert all(side.any() for side in (frame[0], frame[-1], frame[:, 0], frame[:, -1]))
    assert 0.1 < (image.min(axis=2) < 0.95).mean() < 0.8


def test_again_into_the_same_folder_but_not_over_a_foreign_readme(refusal, made, tmp_path):
    (tmp_path / "README.md").write_text("# My project\n")
    assert "was not written by magtip and would be overwritten" in refusal("cad", "paper", "--out", tmp_path)
    assert files_of(tmp_path) == {"README.md"}
    shutil.copy(made / "README.md", tmp_path)
    own_files.check(tmp_path, sensor_parts.names())


def test_json_and_a_base_that_has_no_place(run, refusal, tmp_path, strict):
    options = ("--mold", "split=1", "--process", "sla", "--set", "L=12")
    status, out, err = run("cad", "paper", "--out", "parts", "--json", *options)
    assert status == 0
    assert "warning: no base and no assembly: l0 must be at least 9.1" in err
    (record,) = strict(out)
    assert {"status", "message", "folder", "parts", "checks", "warnings"} <= set(record)
    assert (record["assembled_size_mm"], record["beam_size_mm"]) == (None, [8, 8, 12])
    assert record["recipe"]["dowels"] == {"count": 2, "diameter_mm": 2.0, "length_mm": 10.0, "hole_mm": 2.1}
    text = (tmp_path / "parts" / "README.md").read_text(encoding="utf-8")
    assert "There is no base and so no assembled size; the beam is 8 x 8 x 12 mm" in text
    assert "Two pins of Ø2 x 10 mm lie across the split, in holes of Ø2.1 mm" in text
    names = ["beam", "silicone", "magnet", "mold_a", "mold_b1", "mold_b2", *JIG, "stand"]
    assert [part["name"] for part in record["parts"]] == names
    assert set(record["checks"][0]) == {field.name for field in dataclasses.fields(Check)}
    assert all(check["passed"] for check in record["checks"])
    written = {f"{name}.{ending}" for name in names for ending in ("step", "stl", "3mf")}
    assert files_of(tmp_path / "parts") == written | {
        "README.md",
        "mold.step",
        "mold.svg",
        "plate.3mf",
        "jig.svg",
        "bench.svg",
        "jig.png",
        "parts.csv",
    }
    # who asks for a certain base gets it or a reason
    assert "l0 must be at least 9.1" in refusal("cad", "paper", "--out", "other", "--base", "screw=3", *options)


def test_a_batch_fills_a_folder_for_each_combination(run, tmp_path, strict):
    status, out, err = run("cad", "paper", "--out", "parts", "--axis", "D=3,8", "--axis", "L=10", "--json")
    records = strict(out)
    assert status == 3
    assert [(record["D"], record["L"], record["status"]) for record in records] == [
        (3, 10, "bad_input"),
        (8, 10, "ok"),
    ]
    assert "mm of silicone around it" in records[0]["message"]
    assert f"magtip: variant D3_L10: {records[0]['message']}\nmagtip: 1 of 2 variants failed\n" in err
    assert files_of(tmp_path / "parts") == {"D8_L10"}
    written = {f"{name}.{ending}" for name in PARTS for ending in ("step", "stl", "3mf")}
    assert files_of(tmp_path / "parts" / "D8_L10") == (written | SHEETS) - {"assembly.png", "jig.png"}
    text = (tmp_path / "parts" / "D8_L10" / "README.md").read_text(encoding="utf-8")
    assert "assembly.png" not in text
    assert "Written by `magtip cad paper --out parts --axis D=3,8 --axis L=10`." in text


@pytest.mark.parametrize(("option", "choices"), [("--mold", Mold), ("--base", base.Base)])
@pytest.mark.parametrize("value", ["1e9", "nan", ""])
def test_a_choice_out_of_its_range_names_the_range(option, choices, value):
    for name, bounds in (
        (spec.name, spec.metadata) for spec in dataclasses.fields(choices) if "low" in spec.metadata
    ):
        given = Fabrication(**{option.strip("-"): [f"{name}={value}"]})
        with pytest.raises(BadInput) as caught:
            sensor_solids.parse_fabrication_choices(given)
        assert str(caught.value).startswith(f"{name} must ")
        assert all(f"{bound:g}" in str(caught.value) for bound in (bounds["low"], bounds["high"]))


@pytest.mark.parametrize(
    ("tokens", "text"),
    [
        (("--mold", "vent_diameter=2"), "vent_diameter must not exceed 0.8 of the annulus"),
        (("--mold", "skirt=9"), "skirt must leave skirt + pry_gap within B's free height = 9 mm"),
        (("--mold", "wal=3"), "did you mean wall?"),
        (("--mold", "wall"), "--mold takes KEY=VALUE"),
        (("--mold", "wall=1", "--mold", "wall = 2"), "--mold wall is given twice, as 1 and 2: give it once"),
        (("--mold", "vents=2.5"), "vents must be a whole number"),
        (("--mold", "process=sla"), "give --process"),
        (("--base", "outer=3"), "outer must be at least 17.7"),
        (("--process", "cnc"), '"fdm"'),
        (("--tolerance", "0"), "tolerance must lie between"),
        (("--axis", "depth=1"), "cad takes axes of shape only, not depth: choose from D, L, f, E"),
    ],
)
def test_impossible_requests_name_parameter_and_bound(refusal, tmp_path, tokens, text):
    assert text in refusal("cad", "paper", "--out", "parts", "--json", *tokens)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_a_sentence_and_leaves_nothing(run, tmp_path):
    """The system refuses files longer than a limit, as a full disk would: in STEP, 3MF, STL or drawings."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    (tmp_path / "mine.txt").write_text("mine")
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, before[1]))
    try:
        status, out, err = run("cad", "paper", "--out", ".", "--json")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "choose another folder" in err
    assert os.listdir(tmp_path) == ["mine.txt"]


@pytest.mark.usefixtures("fast_cad")
def test_a_round_base_with_its_recess_in_files_drawings_and_recipe(run, tmp_path, strict):
    fields = ("--set", "D=4", "--set", "L=4.5", "--set", "l0=4.1", "--set", "hall_layout=tmag5273a1")
    magnet = ("--set", "magnet_diameter=2", "--set", "magnet_height=2")
    status, out, _ = run("cad", "paper", "--base", "round", "--out", "parts", "--json", *fields, *magnet)
    assert status == 0
    (record,) = strict(out)
    assert record["assembled_size_mm"][:2] == pytest.approx([2 * (math.hypot(1.55, 1.95) + 1.2)] * 2)
    assert "The recess is 0.4 mm deep and leaves a gap of 0.2 mm" in (tmp_path / "parts/README.md").read_text("utf-8")
    sheet = (tmp_path / "parts" / "base.svg").read_text("utf-8")
    assert "recess Ø4.4" in sheet
    assert "Ø7.38" in sheet


# The picture of the assembly


def test_an_element_behind_the_section_is_named_beside_the_beam_and_drawn_without_leads():
    design = paper()
    parts = sensor_solids.coloured_parts(sensor_solids.make_solids(design, sensor_solids.FabricationChoices()))
    drawn = dict(zip(parts, assembly_picture.faceted(parts, hall_elements.places(design)), strict=True))
    assert [name for name, part in drawn.items() if part.label] == ["S1", "S2", "S3"]
    bounds = {name: assembly_picture.shown(part).bounds for name, part in drawn.items()}
    assert bounds["S3"][4] == pytest.approx(bounds["base"][4], abs=1e-6)
    assert bounds["S2"][4] < bounds["base"][4] - 1
    x, y, z = drawn["S3"].label[1]
    assert bounds["S3"][0] < x < bounds["S3"][1]
    assert z == pytest.approx(bounds["S3"][5])
    # across the view, from the beam's axis
    across = np.array([-assembly_picture.VIEW[1], assembly_picture.VIEW[0]]) / np.hypot(*assembly_picture.VIEW[:2])
    assert across @ [x, y] < -design.R


# Batches


def test_an_interrupted_batch_leaves_only_whole_folders(tmp_path):
    """Its processes, which here build no solids, have begun to write all variants but the first one."""
    code = "import sys, worker_tasks; from studies.cli import main; from studies.fabrication import design_variants\n"
    code += "design_variants.fabricate = worker_tasks.fabricated_or_waits; sys.exit(main(sys.argv[1:]))"
    tokens = ["cad", "paper", "--out", "parts", "--axis", "L=9,10,11"]
    paths = os.pathsep.join([str(Path(__file__).parent), str(Path(__file__).parent.parent)])
    options = {
        "cwd": tmp_path,
        "env": {**os.environ, "PYTHONPATH": paths},
        "start_new_session": True,
        "stderr": subprocess.PIPE,
    }
    with subprocess.Popen([sys.executable, "-c", code, *tokens], **options) as process:
        while process.poll() is None and len(list(tmp_path.rglob("README.md"))) < 2:
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        said = process.stderr.read().decode()
        assert process.wait() == 130
    assert said.splitlines()[-1] == "magtip: interrupted; any complete files are kept"
    assert "Traceback" not in said
    assert [path.name for path in (tmp_path / "parts").glob("[!.]*")] == ["L9"]
    assert (tmp_path / "parts" / "L9" / "README.md").exists()
    assert not list(tmp_path.rglob(".writing-*"))


def test_after_sigkill_no_process_that_draws_is_left():
    """Its input ends with the process that was killed."""
    code = (
        "import subprocess, time\nfrom studies.fabrication import assembly_picture\n"
        "start = subprocess.Popen\ndef told(*words, **more):\n    process = start(*words, **more)\n"
        "    print(process.pid, flush=True)\n    return process\n"
        "subprocess.Popen = told\nwith assembly_picture.painter(): time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        drawer = psutil.Process(int(process.stdout.readline()))
        assert drawer.is_running()
        process.kill()
    drawer.wait(timeout=60)


def test_a_process_of_a_batch_that_dies_fails_its_variant_only(tmp_path, monkeypatch):
    monkeypatch.setattr(design_variants, "fabricate", worker_tasks.fabricated_or_dies)
    axes = {"L": [9.0, 10.0, 11.0, 12.0]}
    records = list(design_variants.batch(paper(), axes, tmp_path / "parts", lambda *_: None, workers=2))
    assert [row["status"] for row in records] == ["failed", "ok", "ok", "ok"]
    assert "exit code 7" in records[0]["message"]


def test_axes_that_change_no_solid_are_named():
    axes = {"D": [8.0, 9.0], "E": [1.0, 2.0], "f": [5.0, 6.0]}
    assert [name for name, _ in design_variants.idle(paper(), axes)] == ["E"]
    chip = dataclasses.replace(paper(), hall_layout="tmag5273a1")
    assert design_variants.idle(chip, axes)[1] == ("f", "hall_layout is tmag5273a1")
    assert design_variants.idle(chip, {"E": [1.0]}) == []


def test_variants_that_would_share_a_folder_are_refused(tmp_path):
    with pytest.raises(BadInput, match=r"^two variants would have the folder 'D8': give values that differ in six"):
        next(design_variants.batch(paper(), {"D": [8.0, 8.0000001]}, tmp_path / "out", lambda *_: None))
    assert not list(tmp_path.iterdir())
