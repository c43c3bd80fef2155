"""Designs and loads: ranges, contradictions, warnings, similarity, labels of files, and the verbs design and mesh."""

import dataclasses
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from analytic.parts import of_design
from geometry import design_digest
from geometry.design import HALL_LAYOUTS, LEAST_WALL, PRESETS, BadInput, Design, Shape, paper, preset, preset_table
from geometry.loads import Load, Response, tilts_of

FIELDS = [spec for spec in dataclasses.fields(Design) if "low" in spec.metadata]
NAMES = [spec.name for spec in FIELDS]


CHIP = {"hall_layout": "tmag5273a1"}
BARE = {"magnet_diameter": 0.0, "magnet_height": 0.0}


def changed(**values):
    return dataclasses.replace(paper(), **values)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_a_design_that_verbs_take_by_name(name, run, strict):
    """Its fields, whatever of them is set, and its tables beside them as those of a design file."""
    (said,) = strict(run("design", name, "--json")[1])
    assert {field: said[field] for field in dataclasses.asdict(paper())} == dataclasses.asdict(preset(name))
    assert preset(name, remanence=1.0) == dataclasses.replace(preset(name), remanence=1.0)
    assert ("fabrication" in preset_table(name)) == ("requirements" in preset_table(name)) == (name != "paper")


@pytest.mark.parametrize("name", [name for name in PRESETS if name != "paper"])
def test_a_preset_is_the_winner_of_its_sizing(name):
    """Presets are copies of results, so that the command in their first line makes them again."""
    text = PRESETS[name].read_text("utf-8")
    assert text == (Path(__file__).parents[1] / "results" / "sizing" / name / "winner.toml").read_text("utf-8")
    assert text.startswith(f"# Made with `magtip size studies/examples/sizing/{name}.toml")


@pytest.mark.parametrize("spec", FIELDS, ids=NAMES)
def test_a_field_is_a_number_in_its_range(spec, refused):
    assert isinstance(getattr(paper(), spec.name), float)
    assert spec.metadata["low"] <= spec.default <= spec.metadata["high"]
    high = re.escape(f"{spec.metadata['high']:g}")
    ends = spec.metadata["low"] - 1e-3, spec.metadata["high"] * (1 + 1e-9) + 1e-9
    for value in (*ends, math.nan, math.inf, -math.inf):
        with refused(rf"{spec.name} must lie between .* and {high}.*; got "):
            changed(**{spec.name: value})
    for value in (True, "8", None, [8.0], 8j):
        with pytest.raises(BadInput, match=f"^{spec.name} must be a number"):
            changed(**{spec.name: value})


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"L": 4.0}, "L must exceed the tip radius D/2 = 4 mm; got 4 mm"),
        ({"L": 161.0}, "L must not exceed 20 D = 160 mm; got 161 mm"),
        ({"magnet_height": 0.0}, "both"),
        ({"magnet_diameter": 0.0}, "both"),
        ({"magnet_diameter": 7.9}, "silicone around it"),
        ({"magnet_height": 9.0}, "silicone around it"),
        (
            {"L": 5.0, "magnet_height": 2 * (1 - 0.999 * LEAST_WALL)},
            "leaves 0.0999 mm of silicone around it and needs",
        ),
        ({"magnet_edge_radius": 1.1}, "magnet_edge_radius must not exceed half the magnet's smaller side = 1 mm"),
        ({"l0": 1.0}, "l0 must exceed half the magnet's height = 1 mm; got 1 mm"),
        ({"hall_low": 3.0}, "hall_low, hall_null and hall_high must rise; got 3, 2.5 and 4.8 V"),
        ({"hall_high": 2.5}, "hall_low, hall_null and hall_high must rise; got 0.2, 2.5 and 2.5 V"),
        ({"hall_layout": "tmag5273a1", "chip_count": 3.0, "chip_x": 1.6}, "or 3 chips of 2.9 x 2.8 mm overlap"),
        ({"chip_count": 1.5}, "chip_count must be a whole number of chips; got 1.5"),
        ({"law": "yeo"}, "there is no law 'yeo': did you mean yeoh?"),
        ({"law": "Yeoh"}, "there is no law 'Yeoh': did you mean yeoh?"),
        ({"law": 3.0}, "law must be one of the names neo-hookean, mooney-rivlin, yeoh, ogden; got 3.0"),
        ({"loss_low": 2000.0}, "loss_low must be less than loss_high = 1000 Hz; got 2000 Hz"),
        ({"prony": 0.1}, "prony must be a text (measured branches g:tau g:tau ..., tau in s (empty: loss"),
        ({"ogden_alpha1": 0.0}, "ogden_alpha1 must be at least 0.01 or at most -0.01; got 0"),
    ],
)
def test_fields_that_contradict_each_other_are_refused(values, text, refused):
    with refused(re.escape(text)):
        changed(**values)


def test_wall_of_the_paper():
    # with the edge rounded by rho the nearest point of the magnet lies on the fillet, on the ray to its centre
    shape = paper().shape
    rho = shape.magnet_edge_radius
    assert math.isclose(shape.wall, 4 - (math.hypot(2 - rho, 1 - rho) + rho), rel_tol=1e-14)
    assert Shape(8, 9, 4, 2, 0).wall == pytest.approx(4 - math.sqrt(5), rel=1e-14)
    # above, below (H - h/2 = 1 - 0.8), and without a magnet
    walls = [Shape(8, 20, 7, 0.2, 0.0).wall, Shape(8, 5, 4, 1.6, 0.0).wall, Shape(8, 9, 0, 0, 0).wall]
    assert walls == pytest.approx([4 - math.hypot(3.5, 0.1), 0.2, math.inf], rel=1e-12)


@pytest.mark.parametrize("factor", [1 / 8, 1.0, 37.0])
def test_similarity(factor):
    shape = paper().shape
    scaled = shape.scaled(factor)
    assert scaled.wall == pytest.approx(factor * shape.wall, rel=1e-12)
    assert math.isclose(scaled.H, factor * shape.H, rel_tol=1e-14)
    assert dataclasses.astuple(scaled.scaled(1 / factor)) == pytest.approx(dataclasses.astuple(shape), rel=1e-14)


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ({}, []),
        ({"l0": 4.0, "f": 9.0}, ["S1 would lie inside"]),
        ({"l0": 6.0, "f": 3.0}, ["S2 and S3 would lie inside"]),
        ({"f": 4.5}, ["only 0.5 mm separate S2 and S3"]),
        ({"L": 25.0, "l0": 24.0}, ["buckle"]),
        (
            {"E": 1000.0},
            ["E = 1000 MPa is outside the range of silicones, 0.01 MPa (gels) to 20 MPa (Shore A 90): check that E"],
        ),
        ({"E": 0.0005}, ["E = 0.0005 MPa is outside the range of silicones"]),
        ({"E": 20.0}, []),
        ({"E": 0.01}, []),
        ({"yeoh_2": 1.0}, ["yeoh_2 has no effect: the law is neo-hookean"]),
        ({"law": "yeoh", "yeoh_2": 1.0}, []),
        ({"chip_x": 1.0}, ["chip_x has no effect: hall_layout is three"]),
        (CHIP | {"chip_x": 3.0, "l0": 4.0}, ["the chip would lie inside the beam, 1 mm above the base"]),
        (CHIP | {"chip_x": 5.0, "l0": 4.0}, []),
        ({"hall_bandwidth": 50.0}, ["hall_bandwidth has no effect: hall_noise_density is 0"]),
        ({"hall_bandwidth": 50.0, "hall_noise_density": 1e-6}, []),
        (BARE, []),
        (BARE | {"remanence": 1.0}, ["remanence has no effect: magnet_diameter is 0"]),
        ({"prony": "0.1:1", "loss_factor": 0.2}, ["loss_factor has no effect: prony is given"]),
        ({"loss_factor": 0.0, "loss_low": 1.0}, ["loss_low has no effect: loss_factor is 0"]),
        ({"loss_factor": 0.0, "modulus": "instantaneous"}, ["modulus has no effect: loss_factor is 0"]),
        ({"prony": "0.25:1", "modulus": "instantaneous"}, ["at rest a force is 0.75 times as large"]),
    ],
)
def test_warnings(values, found):
    warnings = changed(**values).warnings()
    assert len(warnings) == len(found)
    assert all(part in text for part, text in zip(found, warnings, strict=True))


def test_texts_and_numbers_of_a_law():
    assert changed(prony="  0.1:1   0.2:10 ").prony == "0.1:1 0.2:10"
    assert changed(law="yeoh", yeoh_3=2).law_numbers == (0.0, 2.0)
    assert changed(law="ogden").law_numbers == (2.0, -2.0, 0.0)
    assert paper().law_numbers == ()


@pytest.mark.parametrize("layout", HALL_LAYOUTS)
def test_fields_that_a_layout_does_not_use_are_named(layout):
    """A field of the Hall elements is named as unused if, and only if, it does not change the elements."""
    design = Design(hall_layout=layout)
    changes = {"f": 6.0, "c": 1.0, "chip_x": 1.0, "hall_gain": 30.0, "hall_null": 2.4, "hall_low": 0.3}
    changes |= {"hall_high": 4.7, "hall_noise": 0.01, "hall_step": 0.01, "hall_plate": 0.5, "l0": 8.0}
    changes |= {"hall_noise_density": 1e-6, "hall_noise_floor": 1e-4, "hall_average": 4.0}
    changes |= {"chip_noise": 2e-6, "chip_range": 0.07, "chip_step": 3e-6}
    read = {name: of_design(replace(design, **{name: value})) for name, value in changes.items()}
    unread = {name for name, elements in read.items() if elements == of_design(design)}
    assert unread == {name for name in changes if name in design.unused_fields()}
    assert ("c" in unread) is (layout != "three")
    other = replace(design, **changes)
    (sentence,) = other.unused_field_warnings()
    assert set(sentence.partition(" no effect")[0].rpartition(" ")[0].split(", ")) == unread
    assert sentence.endswith(f" no effect: hall_layout is {layout}")
    assert sentence in other.warnings()


@pytest.mark.parametrize(("tilt", "tilt_y"), [(0.3, 0.0), (0.0, 0.3), (0.2, -0.1)])
def test_the_rotation_vector_leans_the_axis_by_the_tilts(tilt, tilt_y):
    response = Response((0.0,) * 3, (0.0,) * 3, tilt, 0.0, tilt_y)
    axis = Rotation.from_rotvec([*response.rotation, 0.0]).apply([0.0, 0.0, 1.0])
    # the angle from z, along the direction of (tilt, tilt_y)
    angle = (tilt**2 + tilt_y**2) ** 0.5
    length = (axis[0] ** 2 + axis[1] ** 2) ** 0.5
    assert_allclose(axis[:2] / length, [tilt / angle, tilt_y / angle], atol=1e-14)
    assert axis[2] > 0
    assert tilts_of(*response.rotation) == (tilt, tilt_y)


@pytest.mark.parametrize(
    ("x", "y", "degrees"), [(1, 0, 0), (-1, 0, 0), (0, 1, 90), (0, -1, 90), (-1, 1, -45), (1, 1, 45), (0, 0, 0)]
)
def test_opposite_shears_have_one_axis(x, y, degrees):
    load = Load(depth=1.0, shear_x=x, shear_y=y, friction="stick")
    angle = math.radians(degrees)
    assert load.direction == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-15)
    assert load.axis == pytest.approx(angle, abs=1e-12)


def test_scaling_and_its_inverse_change_nothing():
    response = Response((0.3, -0.1, 2.0), (0.4, -0.2, -1.0), 0.15, 1.0, -0.08)
    assert response.scaled(4.0, 32.0).scaled(0.25, 1 / 32) == response


OTHER = Design(D=10.0, L=12.0, E=0.5, l0=9.2)


MECHANICS, READINGS = design_digest.of_mechanics, design_digest.of_readings


@pytest.mark.parametrize(
    ("fields", "change", "differs"),
    [
        (MECHANICS, {"E": 2.0}, True),
        (MECHANICS, {"nu": 0.49}, True),
        (MECHANICS, {"law": "yeoh"}, True),
        (MECHANICS, {"magnet_edge_radius": 0.2}, True),
        (MECHANICS, {"f": 6.0, "l0": 8.0, "hall_gain": 20.0, "remanence": 1.0, "density": 1000.0}, False),
        (MECHANICS, {"yeoh_2": 0.5, "magnet_north": "up"}, False),
        (MECHANICS, {"loss_factor": 0.3, "loss_low": 1.0, "prony": "0.1:1", "modulus": "instantaneous"}, False),
        (READINGS, {"remanence": 1.0}, True),
        (READINGS, {"magnet_north": "up"}, True),
        (READINGS, {"f": 6.0}, True),
        (READINGS, {"hall_plate": 0.5}, True),
        (READINGS, {"hall_layout": "tmag5273a1"}, True),
        (READINGS, {"chip_x": 1.0, "hall_noise": 0.1, "E": 2.0, "magnet_edge_radius": 0.2}, False),
    ],
)
def test_states_depend_on_the_mechanical_fields_and_readings_on_magnet_and_elements(fields, change, differs):
    one, other = (fields(design) for design in (paper(), Design(**change)))
    assert (one != other) is (design_digest.digest(one) != design_digest.digest(other)) is differs


def test_digests_of_kept_files_stay():
    """Digests in states files and tables that exist: a new field of `Design` must not change them at its default."""
    mechanics, readings = design_digest.of_mechanics(paper()), design_digest.of_readings(paper())
    assert [design_digest.digest(fields) for fields in (mechanics, readings)] == ["dc6c50a4a84d", "579249936f98"]
    assert "magnet_north" not in design_digest.label(readings)["made_for"]


def test_another_sensor_is_refused_with_the_differing_fields():
    needed = design_digest.of_mechanics(paper())
    assert design_digest.check(design_digest.label(needed), needed, "states.jsonl") is True
    assert design_digest.check({}, needed, "states.jsonl") is False
    with pytest.raises(BadInput) as caught:
        design_digest.check(design_digest.label(design_digest.of_mechanics(OTHER)), needed, "states.jsonl")
    assert str(caught.value) == (
        "states.jsonl was made for another sensor, with D 10 mm, L 12 mm, E 0.5 MPa where this design has D 8 mm, "
        "L 9 mm, E 1 MPa: use that design, or make the file again for this one"
    )
    with pytest.raises(BadInput, match="with magnet ignored where this design has magnet rigid:"):
        design_digest.check(
            design_digest.label(design_digest.of_mechanics(paper(), "ignored")), needed, "states.jsonl"
        )


@pytest.mark.parametrize("made", [{"D_mm": 8.5}, None, [], {"D_mm": [8.0]}])
def test_fields_edited_afterwards_are_refused(made):
    label = design_digest.label(design_digest.of_mechanics(OTHER))
    changed = {**label["made_for"], **made} if isinstance(made, dict) else made
    with pytest.raises(BadInput, match="edited afterwards"):
        design_digest.check({**label, "made_for": changed}, design_digest.of_mechanics(paper()), "states.jsonl")


# What `magtip design` and `mesh` say of a design, and the file that is written.


def test_design_shows_the_chip_in_use_and_where_averaging_leaves_its_steps(run, strict):
    words = ("--set", "hall_layout=tlv493d-a1b6", "--set", "hall_average=16", "--set", "l0=9")
    (record,) = strict(run("design", "paper", *words, "--json")[1])
    derived = record["derived"]
    assert derived["hall_part"] == "TLV493D-A1B6, a 3-axis chip"
    assert (derived["hall_range_T"], derived["hall_step_T"]) == ([-0.13, 0.13], 98e-6)
    assert derived["hall_reading_noise_T"] == pytest.approx(1e-4 / 4, rel=0.1)
    assert not any("does not dither" in text for text in record["warnings"])
    (record,) = strict(run("design", "paper", *words, "--set", "chip_noise=1e-6", "--json")[1])
    assert any("16 values leaves an error of 0.28 steps" in text for text in record["warnings"])
    table = run("design", "paper", *words)[1]
    assert "unused" in next(line for line in table.splitlines() if "hall_gain" in line)


def test_design_gives_the_outer_size_or_says_why_not(run, strict):
    derived = strict(run("design", "paper", "--json")[1])[0]["derived"]
    assert derived["beam_size_mm"] == [8.0, 8.0, 9.0]
    # L, and a base of the 1.57 mm thick S1 whose plate lies 2.2 mm below z = 0 and 0.5 mm below its marked face
    assert derived["assembled_size_mm"][2] == pytest.approx(9 + 2.2 - 0.5 + 1.57, abs=1e-12)
    assert "assembled size" in run("design", "paper")[1]
    # a process that the file states
    stated = strict(run("design", "fingertip", "--json")[1])[0]["derived"]
    assert (stated["process_of_base"], "process_of_base" in derived) == ("sla", False)
    record = strict(run("design", "paper", "--set", "L=12", "--json")[1])[0]
    assert record["derived"]["assembled_size_mm"] is None
    assert any(
        text.startswith("the size of the assembled sensor is unknown: l0 must be at least 9.2")
        for text in record["warnings"]
    )
