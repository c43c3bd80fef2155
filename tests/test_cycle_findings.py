"""Sentences about the loops of a cycle: when they should not be trusted."""

import dataclasses

from fem.analyses.timed_path import TimedState
from geometry.loads import Response
from studies.mechanics.cycle_motion import Motion, stops
from studies.mechanics.loading_cycles import Cycles, CycleState, Loop, Static
from studies.simulation.cycle_findings import doubts

LOOP = Loop(1, 4.0, 4.0, 0.4, 10.0, 0.3, 0.3, 0.0, None, None)
SOLVED = Static(None, 0.001)


def cycles(force_out=1.0, loop=LOOP):
    states = []
    for stop in stops(Motion(1.0, 0.0, "none", 1.0, cycles=1)):
        z = force_out if stop.phase == "out" else 1.0
        response = Response(force=(0.0, 0.0, z), shift=(0.0, 0.0, 0.0), tilt=0.0, contact_radius=1.0)
        state = TimedState(stop.timed.time, stop.timed.load, response, "ok", "", 0.0, 0.0, 0.0, 0.0, 0.0, 1, 1, 1)
        states.append(CycleState(stop, state, True, (0.0, 0.0, 0.0), 0.0))
    return Cycles("prony", "ok", "", states, [loop], "V", 1.0)


def test_sound_loops_raise_no_doubts():
    assert doubts(SOLVED, cycles()) == []


def test_a_stroke_beyond_what_solves_slowly_is_told():
    (text,) = doubts(Static(None, None, "stopped at depth 5.7 mm: no convergence"), cycles())
    assert "does not reach the end of the stroke (stopped at depth 5.7 mm: no convergence)" in text


def test_silicone_that_gains_energy_is_told():
    (text,) = doubts(SOLVED, cycles(loop=dataclasses.replace(LOOP, material_mJ=-0.1)))
    assert text.startswith("the silicone gains 0.1 mJ in cycle 1, which no silicone can")


def test_skin_that_is_away_from_the_plate_at_mid_stroke_is_told():
    (text,) = doubts(SOLVED, cycles(force_out=0.0))
    assert "does not touch the plate at mid-stroke on the way out" in text
