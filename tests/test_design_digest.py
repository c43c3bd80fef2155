"""Labels of files: the fields that they hold, the digest, and the message about another sensor."""

import pytest

from geometry import design_digest
from geometry.design import BadInput, Design, paper

OTHER = Design(D=10.0, L=12.0, E=0.5, l0=9.2)


@pytest.mark.parametrize(
    ("change", "differs"),
    [
        ({"E": 2.0}, True),
        ({"nu": 0.49}, True),
        ({"law": "yeoh"}, True),
        ({"magnet_edge_radius": 0.2}, True),
        ({"f": 6.0, "l0": 8.0, "hall_gain": 20.0, "remanence": 1.0, "density": 1000.0}, False),
        ({"yeoh_2": 0.5, "magnet_north": "up"}, False),
        ({"loss_factor": 0.3, "loss_low": 1.0, "prony": "0.1:1", "modulus": "instantaneous"}, False),
    ],
)
def test_states_depend_on_the_mechanical_fields(change, differs):
    one, other = (design_digest.of_mechanics(design) for design in (paper(), Design(**change)))
    assert (one != other) is (design_digest.digest(one) != design_digest.digest(other)) is differs


@pytest.mark.parametrize(
    ("change", "differs"),
    [
        ({"remanence": 1.0}, True),
        ({"magnet_north": "up"}, True),
        ({"f": 6.0}, True),
        ({"hall_plate": 0.5}, True),
        ({"hall_layout": "tmag5273a1"}, True),
        ({"chip_x": 1.0, "hall_noise": 0.1, "E": 2.0, "magnet_edge_radius": 0.2}, False),
    ],
)
def test_readings_depend_on_magnet_and_elements(change, differs):
    assert (design_digest.of_readings(paper()) != design_digest.of_readings(Design(**change))) is differs


def test_the_size_of_an_ignored_magnet_is_not_in_the_label():
    one, other = (design_digest.of_mechanics(Design(magnet_height=h), "ignored") for h in (2.0, 3.0))
    assert one == other != design_digest.of_mechanics(paper())


def test_digests_of_kept_files_stay():
    """Digests in states files and tables that exist: a new field of `Design` must not change them at its default."""
    mechanics, readings = design_digest.of_mechanics(paper()), design_digest.of_readings(paper())
    assert [design_digest.digest(fields) for fields in (mechanics, readings)] == ["dc6c50a4a84d", "579249936f98"]
    assert "magnet_north" not in design_digest.label(readings)["made_for"]


def test_equal_values_have_one_digest():
    fields = design_digest.of_mechanics(paper())
    again = {key: int(value) if value == 8.0 else value for key, value in reversed(fields.items())}
    assert design_digest.digest(again) == design_digest.digest(fields)


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


def test_the_label_of_a_mesh_may_hold_more_fields_and_another_silicone():
    shape = paper().shape
    whole, outside = design_digest.of_solid(shape), design_digest.of_solid(shape, magnet=False)
    about = design_digest.from_numbers(design_digest.as_numbers(whole))
    assert design_digest.check(about, whole, "a mesh")
    assert design_digest.check(about, outside, "a mesh")
    bare = design_digest.label(design_digest.of_solid(shape.without_magnet()))
    with pytest.raises(BadInput, match=r"with magnet_diameter 0 mm, .* where this design has magnet_diameter 4 mm"):
        design_digest.check(bare, whole, "a mesh")


def test_every_later_key_is_one_of_a_label():
    """A key without its unit would match none."""
    design, chip = paper(), Design(hall_layout="tmag5273a1")
    labels = design_digest.of_mechanics(design) | design_digest.of_solid(design.shape)
    labels |= design_digest.of_readings(design) | design_digest.of_readings(chip)
    assert set(design_digest.LATER) <= set(labels)


# What `magtip design` and `mesh` say of a design, and the file that is written.


def test_design_json(run, strict):
    status, out, err = run("design", "paper", "--set", "E=2", "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    fields = {key: record.pop(key) for key in Design.__slots__}
    assert Design(**fields).E == 2.0
    assert set(record) == {"derived", "assumed", "warnings"}
    assert "magnet_height" in record["assumed"]
    assert not {"D", "E"} & set(record["assumed"])
    assert record["derived"]["H_mm"] == 5.0
    assert record["derived"]["rest_readings_V"][0] == pytest.approx(2.87, abs=0.01)


def test_design_table_tells_the_source(run):
    out = run("design", "paper", "--set", "E=2", "--set", "l0=4")[1]
    lines = {line.split()[0]: line for line in out.splitlines() if line.split()}
    assert "changed" in lines["E"]
    assert "paper" in lines["D"]
    assert "assumed" in lines["nu"]
    # one limit of l0, that of the base
    assert "l0 must be at least" in " ".join(out.split())
    assert "would lie inside the beam" not in out


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


def test_design_without_magnet_has_nulls(run, strict):
    status, out, _ = run("design", "paper", "--set", "magnet_diameter=0", "--set", "magnet_height=0", "--json")
    (record,) = strict(out)
    assert status == 0
    assert record["derived"]["wall_mm"] is None
    assert record["derived"]["magnet_volume_mm3"] == 0.0
    assert record["derived"]["rest_readings_T"] is None


def test_design_gives_the_outer_size_or_says_why_not(run, strict):
    derived = strict(run("design", "paper", "--json")[1])[0]["derived"]
    assert derived["beam_size_mm"] == [8.0, 8.0, 9.0]
    # L, and a base of the 1.57 mm thick S1 whose plate lies 2.2 mm below z = 0 and 0.5 mm below its marked face
    assert derived["assembled_size_mm"][2] == pytest.approx(9 + 2.2 - 0.5 + 1.57, abs=1e-12)
    assert "assembled size" in run("design", "paper")[1]
    record = strict(run("design", "paper", "--set", "L=12", "--json")[1])[0]
    assert record["derived"]["assembled_size_mm"] is None
    assert any(
        text.startswith("the size of the assembled sensor is unknown: l0 must be at least 9.2")
        for text in record["warnings"]
    )


def test_mesh(run, tmp_path, strict):
    status, out, err = run("mesh", "paper", "--out", "mesh.vtu", "--size", 2, "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    assert (record["status"], record["size_mm"]) == ("ok", 2.0)
    assert max(abs(record[f"{name}_volume_error"]) for name in ("silicone", "magnet")) < 1e-5
    assert abs(record["base_error"]) < 1e-4
    assert record["least_jacobian"] > 0
    assert 0 < record["gap_mm"] < 0.1
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["mesh.vtu"]
