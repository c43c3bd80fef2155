"""States of a loading cycle: when a force is decoded."""

import numpy as np

from fem.timed_path import TimedState
from geometry.design import paper
from geometry.loads import Response
from studies.simulation.cycle_loops import StaticCurve, outputs_of, with_readings
from studies.simulation.cycle_motion import Motion, stops

SHIFTS = np.array([[-0.2, 0.0, -0.3], [0.2, 0.0, -0.3]])
TILTS = np.array([-0.02, 0.02])


def state_at(stop) -> TimedState:
    load = stop.timed.load
    response = Response(
        force=(load.shear_x, 0.0, 1.0), shift=(load.shear_x, 0.0, -0.3), tilt=0.1 * load.shear_x, contact_radius=1.0
    )
    return TimedState(stop.timed.time, load, response, "ok", "", 0.0, 0.0, 0.0, 0.0, 0.0, 1, 1, 1)


def test_a_force_is_decoded_in_strokes_but_not_in_the_press_before_them():
    path = stops(Motion(0.5, 0.2, "stick", 1.0, cycles=1))
    curve = StaticCurve(np.array([-0.2, 0.2]), outputs_of(paper(), SHIFTS, TILTS))
    states = with_readings(paper(), [(stop, state_at(stop), True) for stop in path], curve)
    shears = np.array([stop.timed.load.shear_x for stop in path])
    decoded = np.array([one.decoded for one in states])
    assert np.isnan(decoded[shears == 0][:1]).all()
    assert np.allclose(decoded[np.abs(shears) == 0.2], shears[np.abs(shears) == 0.2])
