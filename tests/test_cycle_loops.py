"""States of a loading cycle: when a force is decoded."""

import dataclasses

import numpy as np
import pytest

from fem.analyses.timed_path import TimedState
from fem.solution import Solution
from geometry.design import paper
from geometry.loads import Response
from studies.mechanics.cycle_motion import Motion, stops
from studies.mechanics.loading_cycles import CycleState, Static, StaticCurve, loops_of, outputs_of, with_readings

SHIFTS = np.array([[-0.2, 0.0, -0.3], [0.2, 0.0, -0.3]])
TILTS = np.array([-0.02, 0.02])


def state_at(stop) -> TimedState:
    load = stop.timed.load
    response = Response(
        force=(load.shear_x, 0.0, 1.0), shift=(load.shear_x, 0.0, -0.3), tilt=0.1 * load.shear_x, contact_radius=1.0
    )
    return TimedState(
        stop.timed.time, Solution(load, response, 0.0, "axisymmetric", 1, 1, 0.0, None), 0.0, 0.0, 0.0, 1
    )


def test_a_force_is_decoded_in_strokes_but_not_in_the_press_before_them():
    path = stops(Motion(0.5, 0.2, "stick", 1.0, cycles=1))
    curve = StaticCurve(np.array([[-0.2, 1.0, -0.2], [0.2, 1.0, 0.2]]), outputs_of(paper(), SHIFTS, TILTS), 0)
    states = with_readings(paper(), [(stop, state_at(stop), True) for stop in path], Static(curve, None))
    shears = np.array([stop.timed.load.shear_x for stop in path])
    decoded = np.array([one.decoded for one in states])
    assert np.isnan(decoded[shears == 0][:1]).all()
    assert np.allclose(decoded[np.abs(shears) == 0.2], shears[np.abs(shears) == 0.2])


@pytest.mark.parametrize("shear", [0.2, -0.2])
def test_a_force_that_lags_has_a_gap_above_zero_whatever_the_direction(shear):
    motion = Motion(0.5, shear, "stick", 1.0, cycles=1)
    states = []
    for stop in stops(motion):
        state = state_at(stop)
        lag = 0.01 * np.sign(shear) * {"in": 1, "out": -1}.get(stop.phase, 0)
        force = (stop.timed.load.shear_x + lag, 0.0, 1.0)
        response = dataclasses.replace(state.solution.response, force=force)
        state = dataclasses.replace(state, solution=dataclasses.replace(state.solution, response=response))
        states.append(CycleState(stop, state, True, np.zeros(3), np.nan, np.nan))
    (row,) = loops_of(motion, states)
    assert row["gap_N"] == pytest.approx(0.02)
    assert row["gap_percent"] > 0
