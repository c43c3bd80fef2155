"""Tolerances: each default is within its bounds and says its source; impossible values are refused."""

import dataclasses

import pytest

from geometry.design import BadInput
from studies.sensitivity.tolerances import Tolerances, parse


def test_every_tolerance_names_unit_distribution_and_source():
    for spec in dataclasses.fields(Tolerances):
        assert spec.metadata["shape"] in ("normal", "uniform")
        assert spec.metadata["unit"] in ("percent", "mm", "deg", "V", "T", "1")
        assert spec.metadata["text"]
        assert spec.metadata["source"]


def test_gain_and_null_of_the_hall_element_are_those_of_its_data_sheet():
    assert parse([]).hall_gain == pytest.approx(100 * 0.125 / 3.125)
    assert parse([]).hall_null == 0.075


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E=-1", "tolerance E must be a number of percent from 0 to 90; got -1"),
        ("nu=nan", "tolerance nu must be a finite number; got nan"),
        ("nu=2", "tolerance nu must be a number from 0 to 1; got 2"),
        ("E=ten", "tolerance E must be a finite number; got 'ten'"),
        ("magnet_w=1", "did you mean magnet_"),
        ("E", "--tolerance takes KEY=VALUE"),
    ],
)
def test_impossible_tolerances_are_refused(text, message):
    with pytest.raises(BadInput, match=message.replace("(", r"\(")):
        parse([text])
