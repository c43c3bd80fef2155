"""The search for all poses: every pose of its own readings, beside folds too, none twice."""

import dataclasses
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from analytic import beam, decode
from analytic.inverse import forward_model, pose_search, response_surface
from geometry.design import Design, paper
from studies.sensing import decode_readings

CHIP = Design(
    D=4, L=4.8, E=0.442, magnet_diameter=3, remanence=1.395, l0=4, hall_average=256, hall_layout="tle493d-p2b6"
)
"""A small sensor whose chip lies close to the magnet: a tilt that is not held folds a sixth of the workspace."""
FOLDED = Design(D=21.1, L=29.5, f=21.8, c=16.4, l0=22, magnet_diameter=8, magnet_height=5)
"""A sensor with two or three poses for most readings."""


def coder_of(design, **options):
    law = response_surface.of_formula(lambda load: beam.solve(design, load), 0.4 * design.D, 0.5 * design.D)
    return decode.decoder(design, law, **options)


def readings_of(coder, count, seed=0):
    shift = np.random.default_rng(seed).uniform(coder.low, coder.high, (count, 3)).T.copy()
    return shift.T, forward_model.readings_at(coder.forward, shift).T


@pytest.mark.parametrize(
    ("design", "options"),
    [
        (paper(), {}),
        (CHIP, {}),
        (Design(hall_plate=0.5), {}),
        (paper(), {"mode": "magnitude", "workspace": ([0, 0, -2], [2, 2, 0])}),
    ],
    ids=["paper", "chip", "plates", "magnitudes"],
)
def test_slopes_are_those_of_the_forward_model(design, options):
    coder = coder_of(design, **options)
    for row in readings_of(coder, 20)[1]:
        status, shifts, slopes = pose_search.poses_of(row, coder.forward, coder.table, coder.goal)
        values, expected = forward_model.readings_with_slopes(coder.forward, shifts.T.copy())
        assert_allclose(values.T, np.broadcast_to(row, values.T.shape), rtol=1e-9, atol=1e-12)
        assert_allclose(slopes, expected.transpose(2, 1, 0), atol=1e-12 * np.abs(expected).max(initial=0))
        assert status != "inconsistent"


@pytest.mark.parametrize(
    ("design", "level", "several"),
    [(paper(), "finite", 0), (CHIP, "finite", 5), (FOLDED, "paper", 250)],
    ids=["paper", "chip", "folded"],
)
def test_every_pose_is_found_from_its_readings(design, level, several, monkeypatch):
    # also with tilts far beyond those of the samples
    monkeypatch.setattr(decode_readings, "MISFIT", math.inf)
    law = decode_readings.of_level(design, level)
    coder = decode.decoder(design, dataclasses.replace(law, lean=(-math.inf, math.inf)))
    shifts, readings = readings_of(coder, 400)
    found = decode.decode(coder, readings)
    seen = np.array([status != "saturated" for status in found.status])
    errors = [np.abs(found.poses[found.owner == k] - shift).max(axis=1) for k, shift in enumerate(shifts)]
    own = np.array([error.min(initial=np.inf) for error in errors])
    slopes = forward_model.readings_with_slopes(coder.forward, shifts.T.copy())[1]
    # right on a fold, rounding decides whether two poses or none have the readings
    apart = seen & (decode.condition(slopes) < 1e4)
    assert apart.sum() > 350
    assert own[apart].max() < 1e-6
    assert (found.multiplicity[seen] > 1).sum() >= several


def test_no_pose_is_found_twice():
    coder = coder_of(FOLDED)
    found = decode.decode(coder, readings_of(coder, 100)[1])
    for row in range(100):
        poses = found.poses[found.owner == row]
        distance = np.abs(poses[:, None] - poses).max(axis=2) + np.eye(len(poses))
        assert distance.min(initial=1) > pose_search.SAME * FOLDED.D
