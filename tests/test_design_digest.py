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
    design = paper()
    labels = (
        design_digest.of_mechanics(design) | design_digest.of_readings(design) | design_digest.of_solid(design.shape)
    )
    assert set(design_digest.LATER) <= set(labels)
