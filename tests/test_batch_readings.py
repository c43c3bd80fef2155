"""Readings of many rows at once: those of single calls, without a reading where these refuse, and their speed."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from analytic import hall
from analytic.hall import batch_readings
from geometry.design import HALL_LAYOUTS, BadInput, Design, paper

RNG = np.random.default_rng(18)
REST = np.zeros(3), np.zeros(2)


def random_design():
    diameter, height = RNG.uniform(1, 4), RNG.uniform(1, 3)
    return Design(
        D=RNG.uniform(8, 10),
        L=RNG.uniform(9, 12),
        f=RNG.uniform(2, 8),
        E=RNG.uniform(0.5, 2),
        c=RNG.uniform(-1, 3),
        l0=RNG.uniform(2, 8),
        magnet_diameter=diameter,
        magnet_height=height,
        remanence=RNG.uniform(0.5, 1.5),
        magnet_north=str(RNG.choice(["down", "up"])),
        hall_gain=RNG.uniform(10, 90),
        hall_low=RNG.uniform(0, 1),
        hall_high=RNG.uniform(3, 5),
        hall_step=RNG.choice([0.0, 0.0049]),
        hall_plate=RNG.choice([0.0, 0.3]),
        hall_layout=str(RNG.choice(HALL_LAYOUTS)),
        chip_x=RNG.uniform(-3, 3),
    )


def single(design, shift, tilt):
    """Field, output and saturation of one row."""
    try:
        reading = hall.readings(design, shift=tuple(shift), tilt=tuple(tilt))
    except BadInput:
        return [math.nan] * 3, [math.nan] * 3, [False] * 3
    return reading.B_T, reading.output, reading.saturated


def assert_singles(designs, owner, shift, tilt):
    batch = batch_readings(designs, owner, shift, tilt)
    field, output, saturated = map(
        np.array, zip(*(single(designs[k], s, t) for k, s, t in zip(owner, shift, tilt, strict=True)), strict=True)
    )
    # a component that is small beside |B| has fewer correct digits
    assert_allclose(batch.field_T, field, rtol=1e-13, atol=2e-15)
    assert_allclose(batch.output, output, rtol=1e-13, atol=1e-13)
    assert_array_equal(batch.saturated, saturated)
    return batch


def poses(count):
    return RNG.uniform([-1, -1, -2], [1, 1, 0.2], (count, 3)), RNG.uniform(-0.3, 0.3, (count, 2))


def test_rows_are_single_readings():
    designs = [random_design() for _ in range(40)]
    batch = assert_singles(designs, RNG.integers(0, 40, 300), *poses(300))
    assert batch.saturated.any()
    assert not batch.saturated.all()


def test_designs_that_differ_in_remanence_and_gains_share_a_forward_model(monkeypatch):
    counts, cylinder_field = [], hall.cylinder_field

    def counted(points, *magnet, refuse):
        counts.append(len(points))
        return cylinder_field(points, *magnet, refuse=refuse)

    changes = [{}, {"E": 3.0}, {"hall_gain": 20.0, "hall_null": 2.0}, {"remanence": 1.0}, {"magnet_north": "up"}]
    designs = [dataclasses.replace(paper(), **change) for change in changes]
    shift, tilt = poses(4)
    owner, shift, tilt = np.repeat(np.arange(5), 4), np.tile(shift, (5, 1)), np.tile(tilt, (5, 1))
    with monkeypatch.context() as patched:
        patched.setattr(hall, "cylinder_field", counted)
        batch_readings(designs, owner, shift, tilt)
    assert counts == [5 * 4 * 3]
    assert_singles(designs, owner, shift, tilt)


def test_no_pose_and_no_magnet():
    bare = dataclasses.replace(paper(), magnet_diameter=0.0, magnet_height=0.0)
    shift, tilt = np.zeros((5, 3)), np.zeros((5, 2))
    shift[1, 0], tilt[2, 1], shift[3, 2] = math.nan, math.nan, math.inf
    batch = assert_singles([paper(), bare], np.array([0, 0, 0, 0, 1]), shift, tilt)
    assert_array_equal(np.isnan(batch.output).all(axis=1), [False, True, True, True, True])


@pytest.mark.parametrize("plate", [0.0, 0.4])
def test_an_element_on_the_rim_has_no_reading(plate):
    # at rest S2 lies 0.5 mm above the magnet's lower rim; without a plate the shift moves it onto the rim
    design = Design(l0=2.0, c=1.5, f=2.5, magnet_diameter=4.0, magnet_height=2.0, hall_plate=plate)
    shift = np.array([[0.0, 0, 0], [0.5, 0, 0.5], [0.5, 0, 0.6]])
    batch = assert_singles([design], np.zeros(3, dtype=np.int64), shift, np.zeros((3, 2)))
    assert_array_equal(np.isnan(batch.field_T).all(axis=1), [False, plate == 0, False])


def test_no_rows():
    batch = batch_readings([], np.zeros(0, dtype=np.int64), np.zeros((0, 3)), np.zeros((0, 2)))
    assert batch.field_T.shape == batch.output.shape == batch.saturated.shape == (0, 3)
