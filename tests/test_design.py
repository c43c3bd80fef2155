"""Designs: ranges of fields, contradicting fields, derived values, warnings, similarity."""

import dataclasses
import math
from dataclasses import replace

import pytest

from analytic.parts import of_design
from geometry.design import HALL_LAYOUTS, LEAST_WALL, PRESETS, BadInput, Design, Shape, paper

FIELDS = [spec for spec in dataclasses.fields(Design) if "low" in spec.metadata]
NAMES = [spec.name for spec in FIELDS]


def changed(**values):
    return dataclasses.replace(paper(), **values)


def sentence(raised):
    text = str(raised.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize("spec", FIELDS, ids=NAMES)
def test_a_field_is_a_number_in_its_range(spec):
    ends = spec.metadata["low"] - 1e-3, spec.metadata["high"] * (1 + 1e-9) + 1e-9
    for value in (*ends, math.nan, math.inf, -math.inf):
        with pytest.raises(BadInput, match=rf"^{spec.name} must lie between .* and .*; got ") as raised:
            changed(**{spec.name: value})
        assert f"{spec.metadata['high']:g}" in sentence(raised)
    for value in (True, "8", None, [8.0], 8j):
        with pytest.raises(BadInput, match=f"^{spec.name} must be a number"):
            changed(**{spec.name: value})


@pytest.mark.parametrize("name", NAMES)
def test_metadata_is_complete_and_default_in_range(name):
    spec = FIELDS[NAMES.index(name)]
    assert set(spec.metadata) == {"unit", "low", "high", "text", "assumed"}
    assert spec.metadata["low"] <= spec.default <= spec.metadata["high"]
    assert isinstance(getattr(paper(), name), float)
    assert isinstance(changed(D=10).D, float)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"L": 4.0}, "L must exceed the tip radius D/2 = 4 mm; got 4 mm"),
        ({"L": 161.0}, "L must not exceed 20 D = 160 mm; got 161 mm"),
        ({"magnet_height": 0.0}, "both"),
        ({"magnet_diameter": 0.0}, "both"),
        ({"magnet_diameter": 7.9}, "silicone around it"),
        ({"magnet_height": 9.0}, "silicone around it"),
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
def test_fields_that_contradict_each_other_are_refused(values, text):
    with pytest.raises(BadInput) as raised:
        changed(**values)
    assert text in sentence(raised)


def test_wall_of_the_paper():
    # with the edge rounded by rho the nearest point of the magnet lies on the fillet, on the ray to its centre
    shape = paper().shape
    rho = shape.magnet_edge_radius
    assert math.isclose(shape.wall, 4 - (math.hypot(2 - rho, 1 - rho) + rho), rel_tol=1e-14)
    assert Shape(8, 9, 4, 2, 0).wall == pytest.approx(4 - math.sqrt(5), rel=1e-14)
    # above, below (H - h/2 = 1 - 0.8), and without a magnet
    walls = [Shape(8, 20, 7, 0.2, 0.0).wall, Shape(8, 5, 4, 1.6, 0.0).wall, Shape(8, 9, 0, 0, 0).wall]
    assert walls == pytest.approx([4 - math.hypot(3.5, 0.1), 0.2, math.inf], rel=1e-12)


@pytest.mark.parametrize(("wall", "fits"), [(LEAST_WALL, True), (0.999 * LEAST_WALL, False)])
def test_least_wall(wall, fits):
    # a magnet whose lower face lies `wall` above the base
    values = {"L": 5.0, "magnet_height": 2 * (1 - wall), "magnet_edge_radius": 0.0}
    if fits:
        assert changed(**values).shape.wall == pytest.approx(wall, rel=1e-9)
    else:
        with pytest.raises(BadInput, match=r"leaves 0\.0999 mm of silicone around it and needs at least 0\.1 mm"):
            changed(**values)


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
    ],
)
def test_warnings(values, found):
    warnings = changed(**values).warnings()
    assert len(warnings) == len(found)
    assert all(part in text for part, text in zip(found, warnings, strict=True))


def test_frozen_and_presets():
    with pytest.raises(dataclasses.FrozenInstanceError):
        paper().D = 3.0
    assert PRESETS["paper"]() == Design() == paper()


def test_parameters_of_a_law_and_parameters_without_effect():
    assert changed(law="yeoh", yeoh_3=2).law_numbers == (0.0, 2.0)
    assert changed(law="ogden").law_numbers == (2.0, -2.0, 0.0)
    assert paper().law_numbers == ()
    assert not paper().warnings()
    assert "yeoh_2 has no effect: the law is neo-hookean" in changed(yeoh_2=1.0).warnings()
    assert changed(chip_x=1.0).warnings() == ["chip_x has no effect: hall_layout is three"]
    (inside,) = changed(hall_layout="tmag5273a1", chip_x=3.0, l0=4.0).warnings()
    assert inside.startswith("the chip would lie inside the beam, 1 mm above the base")
    assert changed(hall_layout="tmag5273a1", chip_x=5.0, l0=4.0).warnings() == []
    assert not changed(law="yeoh", yeoh_2=1.0).warnings()


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


def test_a_bandwidth_needs_a_density():
    assert Design(hall_bandwidth=50.0).warnings() == ["hall_bandwidth has no effect: hall_noise_density is 0"]
    assert Design(hall_bandwidth=50.0, hall_noise_density=1e-6).warnings() == []


def test_remanence_has_no_effect_without_a_magnet():
    bare = {"magnet_diameter": 0.0, "magnet_height": 0.0}
    assert Design(**bare).unused_field_warnings() == []
    assert Design(**bare, remanence=1.0).unused_field_warnings() == ["remanence has no effect: magnet_diameter is 0"]


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"prony": "0.1:1", "loss_factor": 0.2}, "loss_factor has no effect: prony is given"),
        ({"loss_factor": 0.0, "loss_low": 1.0}, "loss_low has no effect: loss_factor is 0"),
        ({"loss_factor": 0.0, "modulus": "instantaneous"}, "modulus has no effect: loss_factor is 0"),
        (
            {"prony": "0.25:1", "modulus": "instantaneous"},
            "modulus is instantaneous: static solves take E as it stands; at rest a force is 0.75 times as large",
        ),
    ],
)
def test_fields_of_the_relaxation_without_effect_are_named(values, sentence):
    assert changed(**values).value_warnings() == [sentence]


def test_prony_is_kept_with_single_blanks():
    assert changed(prony="  0.1:1   0.2:10 ").prony == "0.1:1 0.2:10"
