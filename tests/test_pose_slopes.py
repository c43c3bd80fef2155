"""Slopes of the readings by the magnet's pose, against central differences of the readings themselves."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import hall
from analytic.inverse.forward_model import slopes_at
from geometry.design import BadInput, Design, paper

POSES = [((0.0, 0.0, 0.0), (0.0, 0.0)), ((0.7, 0.0, -0.5), (0.0, 0.2)), ((-0.3, 0.4, -0.2), (0.0, -0.1))]


@pytest.mark.parametrize("design", [paper(), Design(hall_plate=0.5)], ids=["points", "plates"])
@pytest.mark.parametrize(("shift", "tilt"), POSES)
def test_slopes_are_those_of_the_readings(design, shift, tilt):
    by_shift, by_rotation = slopes_at(design, shift, tilt)
    step = 1e-4
    # rotations about one axis add up, so that about y can be differenced at any tilt about y
    for slopes, change in (*zip(by_shift.T, np.eye(5)[:3], strict=True), (by_rotation[:, 1], np.eye(5)[4])):
        ends = []
        for way in (1, -1):
            pose = np.array([*shift, *tilt]) + way * step * change
            ends.append(hall.readings(design, shift=tuple(pose[:3]), tilt=tuple(pose[3:])).B_T)
        assert slopes == pytest.approx(np.subtract(*ends) / (2 * step), rel=1e-6, abs=1e-9)


def test_a_rotation_about_its_own_axis_changes_no_reading():
    _, by_rotation = slopes_at(paper(), (0.4, 0.1, -0.3), (0.0, 0.0))
    assert np.abs(by_rotation[:, 2]).max() < 1e-12 * np.abs(by_rotation).max()


def test_a_design_without_magnet_is_refused():
    with pytest.raises(BadInput, match="no magnet"):
        slopes_at(replace(paper(), magnet_diameter=0.0, magnet_height=0.0), (0.0, 0.0, 0.0), (0.0, 0.0))
