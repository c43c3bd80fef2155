"""The picture of loading cycles: ways and decoded force have names, and texts are apart."""

import math
from dataclasses import replace

import pytest

from fem.analyses.timed_path import TimedState
from geometry.design import paper
from geometry.loads import Response
from studies.simulation import cycle_plot
from studies.simulation.cycle_motion import Motion, stops
from studies.simulation.cycle_report import with_readings
from tests.picture_texts import check_texts, saved_figures


def states_of(motion):
    """States of a spring with some friction."""
    states = []
    for stop in stops(motion):
        load = stop.timed.load
        way = load.shear_x if motion.shear else load.depth
        force = way + (0.1 if stop.phase == "in" else -0.1)
        response = Response(force=(force, 0.0, force), shift=(0.0, 0.0, -0.3), tilt=0.0, contact_radius=1.0)
        states.append((stop, TimedState(stop.timed.time, load, response, "ok", "", *[0.0] * 5, 1, 1, 1), True))
    return [replace(one, decoded=0.8) for one in with_readings(paper(), states, None)]


@pytest.mark.parametrize(
    ("motion", "ways"),
    [
        (Motion(1.0, 0.0, "stick", 1.0, cycles=3), ["loading", "unloading"]),
        (Motion(0.5, 0.5, "stick", 1.0, cycles=2), ["to +x", "to \N{MINUS SIGN}x"]),
    ],
)
def test_both_ways_are_marked_and_the_decoded_force_is_explained(motion, ways, monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    cycle_plot.draw(tmp_path / "cycle.png", motion, states_of(motion))
    (figure,) = figures
    loops, times = figure.axes
    assert [text.get_text() for text in loops.texts if text.get_text()] == ways
    names = [text.get_text() for text in times.get_legend().get_texts()]
    assert names == ["of the plate", "decoded from the readings, as if loaded slowly"]
    check_texts(figure)


def test_without_a_decoded_force_there_is_no_line_for_it(monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    motion = Motion(1.0, 0.0, "stick", 1.0, cycles=1)
    blind = [replace(one, decoded=math.nan) for one in states_of(motion)]
    cycle_plot.draw(tmp_path / "cycle.png", motion, blind)
    assert len(figures[0].axes[1].get_lines()) == 1
