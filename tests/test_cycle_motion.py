"""Motion of a loading cycle: its loads, phases and refusals."""

import math

import pytest

from geometry.design import BadInput
from studies.mechanics.cycle_motion import Motion, frequency_of, stops


def test_triangle_passes_mid_stroke_and_holds_at_both_ends() -> None:
    path = stops(Motion(1.0, 0.0, "none", 0.5, cycles=1, hold=2.0))
    assert [stop.timed.time for stop in path] == [0.5, 1.0, 3.0, 3.5, 4.0, 6.0]
    assert [stop.timed.load.depth for stop in path] == [0.5, 1.0, 1.0, 0.5, 0.0, 0.0]
    assert [stop.phase for stop in path] == ["in", "in", "hold", "out", "out", "hold"]


def test_sine_is_exact_at_mid_stroke_and_at_its_ends() -> None:
    path = stops(Motion(2.0, 0.0, "none", 1.0, "sine", cycles=2))
    named = [value for stop in path if stop.place for value in (stop.timed.time, stop.timed.load.depth)]
    assert named == pytest.approx(
        [0.25, 1.0, 0.5, 2.0, 0.75, 1.0, 1.0, 0.0, 1.25, 1.0, 1.5, 2.0, 1.75, 1.0, 2.0, 0.0]
    )


def test_shear_follows_the_press_and_begins_each_cycle_at_its_end() -> None:
    path = stops(Motion(1.0, 0.5, "stick", 0.5, cycles=1))
    assert [(stop.timed.load.depth, stop.timed.load.shear_x) for stop in path] == [
        (1.0, 0.0), (1.0, 0.5), (1.0, 0.0), (1.0, -0.5), (1.0, 0.0), (1.0, 0.5)
    ]  # fmt: skip
    assert [stop.cycle for stop in path] == [0, 0, 1, 1, 1, 1]


def test_speed_is_that_of_the_stroke() -> None:
    assert frequency_of(0.5, None, 1.0) == 0.25


@pytest.mark.parametrize(("speed", "frequency"), [(None, None), (1.0, 1.0), (0.0, None)])
def test_speed_and_frequency_that_define_no_motion_are_refused(speed: float | None, frequency: float | None) -> None:
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
def test_impossible_motions_are_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        Motion(**({"depth": 1.0, "shear": 0.0, "friction": "none", "frequency": 1.0} | values))
