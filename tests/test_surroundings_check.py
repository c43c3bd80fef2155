"""A turn after taring, a chip of reference, and an iron block, by other codes: a reduced run of the study."""

from dataclasses import replace

import pytest

from geometry.design import paper
from studies.simulation import mechanics_sources
from studies.validation.devices import surroundings_check
from studies.validation.devices.surroundings_check import LAYOUTS, REFERENCES, iron_row, result, turned


@pytest.fixture(scope="module")
def row():
    """Three chips below the paper's sensor."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surroundings_check, "ATTITUDES", 40)
        return turned(replace(paper(), **LAYOUTS[8]), mechanics_sources.source_of(paper()).law)


@pytest.fixture(scope="module")
def iron():
    """An axial magnet of 1 T, 4 mm across and high; the block's face 5 mm below its centre."""
    return iron_row(5.0, 1000.0)


def test_a_turn_after_taring_by_magpylib_errs_as_the_worst_direction_says(row):
    assert 0.8 < row["by_magpylib_N"] / row["turned_N"] < 1.0


def test_a_field_that_is_fitted_along_leaves_nothing_and_costs_noise(row):
    assert row["turned_rejected_N"] < 1e-9
    assert 1 < row["noise_rejected"] < 1.5


def test_a_chip_of_reference_sees_less_of_the_magnet_and_more_of_a_gradient_the_farther_it_is(row):
    near, far = (f"reference_{times:g}_D" for times in REFERENCES)
    # the change of the field of a dipole falls by the fourth power, the gradient's grows in proportion
    assert 8 < row[f"{near}_own_field_N"] / row[f"{far}_own_field_N"] < 20
    assert row[f"{far}_gradient_N"] == pytest.approx(2 * row[f"{near}_gradient_N"], rel=0.1)
    assert row[f"{near}_gradient_N"] > row["gradient_rejected_N"]
    # of one chip with the noise of the reference it would be the root of two
    assert 1 < row[f"{near}_noise"] < 2**0.5


def test_finite_elements_of_an_iron_block_add_what_the_image_does(iron):
    assert iron["added_mT"] == pytest.approx(iron["image_mT"], rel=2e-3)
    assert iron["perfect_image_percent"] == pytest.approx(iron["image_percent"] + 0.2, abs=1e-3)


def test_goals_are_missed_where_another_code_does_not_agree(row, iron):
    assert not result([row], [iron], quick=True).failures
    assert result([row | {"by_magpylib_N": 1.1 * row["turned_N"]}], [iron], quick=True).failures
    assert result([row], [iron | {"image_percent": -1.2}], quick=True).failures
    assert result([row | {"turned_rejected_N": None}], [iron], quick=True).failures
