"""Beams of training and of the test."""

import dataclasses

import numpy as np
import pytest

from geometry.design import Design
from studies.surrogate import prediction, surrogate_range
from studies.validation.surrogate_training import (
    DIMENSIONS,
    corners,
    of_cube,
    random_beams,
    regional_beams,
    training_beams,
)

NAMES = ("L", "diameter", "height", "nu", "edge", "share")


def test_more_training_beams_keep_the_first_ones():
    few, many = training_beams(20, 1), training_beams(60, 1)
    assert all(np.array_equal(getattr(few, name), getattr(many, name)[:20]) for name in NAMES)


def test_training_begins_with_the_corners_of_the_range():
    """Slender beams with thin magnets, and wide thin magnets above short bases, are interpolated."""
    first = corners()
    for L in surrogate_range.LENGTH:
        for diameter in surrogate_range.DIAMETER:
            for nu in surrogate_range.POISSON:
                own = first[(first.L == L) & (first.diameter == diameter) & (first.nu == nu)]
                assert own.height.min() == surrogate_range.HEIGHT[0]
                # the highest magnet that the walls allow
                higher = own[own.height > 0.15]
                top = surrogate_range.wall(higher.L, higher.diameter, higher.height + 2e-3, higher.edge)
                below = surrogate_range.below(higher.L, higher.height + 2e-3)
                limits = (top < surrogate_range.LEAST_WALL) | (below < surrogate_range.LEAST_BELOW)
                assert (limits | (higher.height == surrogate_range.HEIGHT[1])).all()
    beams = training_beams(len(first) + 200, 1)
    assert np.array_equal(beams.L[: len(first)], first.L)
    assert (beams.L[len(first) :] == 0.75).sum() >= 4


def test_every_region_has_its_random_beams():
    beams = regional_beams(4, 3)
    region = prediction.beam_region(beams.L, beams.diameter, beams.height)
    assert region.tolist() == 4 * list(range(prediction.REGIONS))
    assert np.array_equal(regional_beams(6, 3).L[:24], beams.L)


@pytest.mark.parametrize("beams", [random_beams(500, 7), training_beams(500, 7)], ids=["random", "training"])
def test_beams_lie_in_the_range_and_have_walls(beams):
    for name, (low, high) in (
        ("L", surrogate_range.LENGTH),
        ("diameter", surrogate_range.DIAMETER),
        ("height", surrogate_range.HEIGHT),
        ("nu", surrogate_range.POISSON),
    ):
        assert low <= getattr(beams, name).min() <= getattr(beams, name).max() <= high
    wall = surrogate_range.wall(beams.L, beams.diameter, beams.height, beams.edge)
    assert wall.min() >= surrogate_range.LEAST_WALL
    assert beams.in_range.all()


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
