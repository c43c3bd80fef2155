"""Beams of training and of the test."""

import dataclasses

import numpy as np
import pytest

from geometry.design import Design
from studies.surrogate import surrogate_range
from studies.training.training_beams import DIMENSIONS, of_cube, random_beams, training_beams

NAMES = ("L", "diameter", "height", "nu", "edge", "share")


def test_more_training_beams_keep_the_first_ones():
    few, many = training_beams(20, 1), training_beams(60, 1)
    assert all(np.array_equal(getattr(few, name), getattr(many, name)[:20]) for name in NAMES)


def test_beams_lie_in_the_range_and_have_walls():
    beams = random_beams(500, 7)
    for name, (low, high) in (
        ("L", surrogate_range.LENGTH),
        ("diameter", surrogate_range.DIAMETER),
        ("height", surrogate_range.HEIGHT),
        ("nu", surrogate_range.POISSON),
    ):
        assert low <= getattr(beams, name).min() <= getattr(beams, name).max() <= high
    wall = surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge)
    assert wall.min() >= surrogate_range.LEAST_WALL


def test_the_wall_is_that_of_the_design():
    beams = random_beams(20, 8)
    wall = surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge)
    for k in range(20):
        assert beams.design(k).shape.wall / 10 == pytest.approx(wall[k], abs=2e-5)


def test_corners_of_the_cube_are_corners_of_the_range():
    beams = of_cube(np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.5, 0.0, 1.0, 1.0, 1.0]]))
    assert (beams.L.tolist(), beams.nu.tolist()) == ([0.75, 4.0], [0.5, 0.45])
    assert beams.diameter.tolist() == [0.2, 0.5]
    assert beams.density_ratio.tolist() == list(surrogate_range.DENSITY_RATIO)
    assert len(dataclasses.fields(beams)) == DIMENSIONS


def test_a_design_has_the_lengths_of_its_beam():
    beams = training_beams(3, 1)
    design = beams.design(2)
    assert isinstance(design, Design)
    assert (design.L, design.magnet_height) == pytest.approx((10 * beams.L[2], 10 * beams.height[2]))
