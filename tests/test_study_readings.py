"""Readings in a sweep: columns of the elements of each layout, and decoded forces."""

import math

import pytest

from fem.accuracy import QUICK
from geometry.design import paper
from studies.inputs.study_input import grid
from studies.mechanics import store
from studies.mechanics.solve_plan import Processes
from studies.mechanics.study_cases import FemModel, Plan
from studies.sweeps import sweep
from studies.sweeps.study_rows import flat_rows


def rows_of(axes, **changes):
    """The rows of a press by 0.5 mm, with force and readings."""
    quantities = ("force", "readings")
    values = {"fem": (FemModel("quick", QUICK),), "formulas": ("paper",), "quantities": quantities} | changes
    plan = Plan(paper(), grid(axes), {"depth": 0.5}, "rigid", **values)
    with store.in_memory() as kept:
        return [row for table in sweep.run(plan, None, kept, processes=Processes(0)) for row in flat_rows(table)]


def test_layouts_have_columns_of_their_own():
    three, chip, finer = rows_of({"hall_layout": ["three", "tmag5273a1", "tle493d-p2b6"]})
    assert math.isfinite(three["fem_S1_V"])
    assert math.isnan(three["fem_chip_-z_output_mT"])
    for row in (chip, finer):
        assert math.isnan(row["fem_S1_V"])
        # a chip sends whole steps
        assert row["fem_chip_-z_output_mT"] == pytest.approx(row["fem_chip_-z_mT"], abs=0.1)
    # both lie on the axis, below the magnet
    assert chip["fem_chip_-z_mT"] == three["fem_S1_mT"]


def test_an_impossible_sensor_has_no_readings():
    """Its mechanics are those of the others, but a null beyond the rail is refused."""
    possible, impossible = rows_of({"hall_null": [2.5, 9.0]})
    assert math.isfinite(possible["fem_S1_V"])
    assert (impossible["status"], math.isnan(impossible["fem_S1_V"])) == ("bad_input", True)
    assert math.isnan(impossible["fem_force_N"])
    assert "hall_low, hall_null and hall_high must rise" in impossible["message"]


def test_gains_change_the_output_and_not_the_field():
    low, high = rows_of({"hall_gain": [20.0, 40.0]})
    assert low["fem_S1_mT"] == high["fem_S1_mT"]
    assert high["fem_S1_V"] - 2.5 == pytest.approx(2 * (low["fem_S1_V"] - 2.5), rel=1e-9)


def test_decoded_forces_without_a_pose_are_empty():
    """The sensor saturates: no pose, so no force."""
    (row,) = rows_of({"hall_gain": [1000.0]}, quantities=("force", "decoded_force_error"), formulas=("finite",))
    assert math.isfinite(row["fem_force_N"])
    assert math.isnan(row["decoded_force_N"])
