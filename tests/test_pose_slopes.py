"""Slopes of the readings by the magnet's pose, against central differences of the readings themselves."""

from dataclasses import replace

import numpy as np
import pytest

from analytic import hall
from analytic.inverse.forward_model import slopes_at
from geometry.design import BadInput, paper

POSES = [((0.0, 0.0, 0.0), (0.0, 0.0)), ((0.7, 0.0, -0.5), (0.0, 0.2)), ((-0.3, 0.4, -0.2), (0.0, -0.1))]


@pytest.mark.parametrize(("shift", "tilt"), POSES)
def test_slopes_by_shift_are_those_of_the_readings(shift, tilt):
    design, step = paper(), 1e-4
    by_shift, _ = slopes_at(design, shift, tilt)
    for j in range(3):
        ends = [
            hall.readings(design, shift=tuple(np.add(shift, way * step * np.eye(3)[j])), tilt=tilt).B_T
            for way in (1, -1)
        ]
        assert by_shift[:, j] == pytest.approx(np.subtract(*ends) / (2 * step), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("shift", "tilt"), POSES)
def test_the_slope_by_a_rotation_about_y_is_that_of_the_readings(shift, tilt):
    # rotations about one axis add up, so this one can be differenced at any tilt about y
    design, step = paper(), 1e-4
    _, by_rotation = slopes_at(design, shift, tilt)
    ends = [hall.readings(design, shift=shift, tilt=(tilt[0], tilt[1] + way * step)).B_T for way in (1, -1)]
    assert by_rotation[:, 1] == pytest.approx(np.subtract(*ends) / (2 * step), rel=1e-6, abs=1e-9)


def test_elements_with_a_plate_average_their_slopes():
    design, step = replace(paper(), hall_plate=0.5), 1e-4
    by_shift, _ = slopes_at(design, (0.2, 0.0, -0.3), (0.0, 0.1))
    ends = [hall.readings(design, shift=(0.2, 0.0, -0.3 + way * step), tilt=(0.0, 0.1)).B_T for way in (1, -1)]
    assert by_shift[:, 2] == pytest.approx(np.subtract(*ends) / (2 * step), rel=1e-6)


def test_a_rotation_about_its_own_axis_changes_no_reading():
    _, by_rotation = slopes_at(paper(), (0.4, 0.1, -0.3), (0.0, 0.0))
    assert np.abs(by_rotation[:, 2]).max() < 1e-12 * np.abs(by_rotation).max()


def test_a_design_without_magnet_is_refused():
    with pytest.raises(BadInput, match="no magnet"):
        slopes_at(replace(paper(), magnet_diameter=0.0, magnet_height=0.0), (0.0, 0.0, 0.0), (0.0, 0.0))
