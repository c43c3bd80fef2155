"""Controls of the explorer's page: they cover the design and the load, within the ranges of both."""

import dataclasses
import math

import pytest

from geometry.design import Design, paper
from geometry.loads import Load
from studies.explorer.explorer_state import RATES, explorer_fields

FIELDS = explorer_fields(paper())
NUMBERS = [field for field in FIELDS if field["kind"] in ("number", "logarithmic")]


def test_every_field_of_a_design_has_one_control():
    names = [field["name"] for field in FIELDS if field["scope"] == "design"]
    assert sorted(names) == sorted(spec.name for spec in dataclasses.fields(Design))


@pytest.mark.parametrize("field", NUMBERS, ids=lambda field: field["name"])
def test_slider_lies_in_the_range_and_holds_the_value_of_the_paper(field):
    low, high = field["slider"]
    assert field["low"] <= low <= field["value"] <= high <= field["high"]
    assert 0 < field["step"] < (high - low) / 5


def test_values_are_those_of_the_design():
    design = Design(D=10, L=14, law="yeoh", yeoh_2=0.1)
    values = {field["name"]: field["value"] for field in explorer_fields(design) if field["scope"] == "design"}
    assert Design(**values) == design


def test_fields_without_effect_name_the_choice_that_they_need():
    needs = {field["name"]: field["needs"] for field in FIELDS}
    assert set(needs) - {"depth", "shear", "direction", "friction", "plate_tilt", *RATES, "magnet"} >= set(
        paper().unused_fields()
    )
    assert needs["yeoh_2"] == {"law": ["yeoh"]}
    assert needs["chip_x"] == {"hall_layout": ["tmag5273a1", "tle493d-p2b6"]}
    assert all(needs[name] for name in paper().unused_fields() if name != "hall_bandwidth")


def test_largest_plate_tilt_is_a_possible_load():
    tilt = next(field for field in FIELDS if field["name"] == "plate_tilt")
    assert Load(plate_tilt=math.radians(tilt["high"])).plate_tilt > 0


def test_grades_of_the_remanence_are_those_of_the_catalogue():
    remanence = next(field for field in FIELDS if field["name"] == "remanence")
    grades = {grade["name"]: grade["value"] for grade in remanence["presets"]}
    assert grades["N35"] < grades["N42"] < grades["N52"] <= remanence["slider"][1]
