"""Loading cycles: the loads and phases of a motion, its refusals, and when a force is decoded."""

import dataclasses
import math

import numpy as np
import pytest

from fem.analyses.timed_path import TimedState
from fem.solution import Solution
from geometry.design import BadInput, paper
from geometry.loads import Response
from studies.mechanics.cycle_motion import Motion, frequency_of, stops
from studies.mechanics.loading_cycles import CycleState, Static, StaticCurve, loops_of, outputs_of, with_readings


def test_triangle_passes_mid_stroke_and_holds_at_both_ends():
    path = stops(Motion(1.0, 0.0, "none", 0.5, cycles=1, hold=2.0))
    assert [stop.timed.time for stop in path] == [0.5, 1.0, 3.0, 3.5, 4.0, 6.0]
    assert [stop.timed.load.depth for stop in path] == [0.5, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert [stop.phase for stop in path] == ["in", "in", "hold", "out", "out", "hold"]


def test_sine_is_exact_at_mid_stroke_and_at_its_ends():
    path = stops(Motion(2.0, 0.0, "none", 1.0, "sine", cycles=2))
    named = [value for stop in path if stop.place for value in (stop.timed.time, stop.timed.load.depth)]
    assert named == pytest.approx(
        [0.25, 1.0, 0.5, 2.0, 0.75, 1.0, 1.0, 0.0, 1.25, 1.0, 1.5, 2.0, 1.75, 1.0, 2.0, 0.0]
    )


def test_shear_follows_the_press_and_begins_each_cycle_at_its_end():
    path = stops(Motion(1.0, 0.5, "stick", 0.5, cycles=1))
    assert [(stop.timed.load.depth, stop.timed.load.shear_x) for stop in path] == [
        (1.0, 0.0), (1.0, 0.5), (1.0, 0.0), (1.0, -0.5), (1.0, 0.0), (1.0, 0.5)
    ]  # fmt: skip
    assert [stop.cycle for stop in path] == [0, 0, 1, 1, 1, 1]


@pytest.mark.parametrize(("speed", "frequency"), [(None, None), (1.0, 1.0), (0.0, None)])
def test_speed_and_frequency_that_define_no_motion_are_refused(speed, frequency):
    with pytest.raises(BadInput, match="--speed"):
        frequency_of(speed, frequency, 1.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"depth": 0.0}, "--depth of a cycle must be above 0 mm"),
        ({"depth": math.inf}, "--depth of a cycle must be above 0 mm and finite; got inf"),
        ({"frequency": -1.0}, "--frequency of a cycle must be above 0 Hz"),
        ({"cycles": 0}, "--cycles must be between 1 and 1000"),
        ({"hold": -1.0}, "--hold must be a finite time of 0 s or more"),
        ({"shear": 1.0}, "a shear needs friction"),
    ],
)
def test_impossible_motions_are_refused(values, message):
    with pytest.raises(BadInput, match=message):
        Motion(**({"depth": 1.0, "shear": 0.0, "friction": "none", "frequency": 1.0} | values))


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
