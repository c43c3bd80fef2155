"""What the live page says of vibrations about, and of loading cycles up to, its state."""

from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.analyses.vibration import vibrating_sensor
from geometry.design import BadInput, paper
from geometry.loads import Load
from studies.explorer import time_answers
from studies.explorer.explorer_answers import Answers
from studies.explorer.explorer_state import request_of


def request(parts=("vibration", "loop"), design=None, **load):
    state = {"level": "quick", "design": design or {}, "load": {"depth": 1, **load}}
    return request_of({"parts": list(parts), "state": state})


@pytest.fixture(scope="module")
def answers():
    return Answers()


def answered(answers, *arguments, **load):
    """Rows and message of each answer, the parts in their order."""
    return [
        (part, level, {row["name"]: (row["value"], row["half_width"]) for row in data["rows"]}, data["message"])
        for part, level, data in filter(None, answers.all_of(request(*arguments, **load), "quick"))
    ]


@pytest.mark.parametrize("friction", ["none", "stick"])
def test_vibration_of_the_page_is_that_of_the_sensor(answers, friction):
    ((_, _, rows, _),) = answered(answers, ["vibration"], frequency=300, friction=friction)
    sensor = vibrating_sensor(paper(), Load(depth=1, friction=friction), (1.0, 1000.0), QUICK)
    force = sensor.at([300.0]).force[0, 0, 1]
    value, half_width = rows["force along z"]
    assert value == pytest.approx(abs(force), rel=1e-6)
    assert 1e-3 * value < half_width < 0.02 * value
    over_static = value / sensor.static_stiffness()["z"]
    assert rows["force along z, over static"][0] == pytest.approx(over_static, rel=1e-6)
    assert rows["phase of force along z"][0] == pytest.approx(np.degrees(np.angle(force)), abs=1e-4)


def test_another_frequency_solves_for_no_other_state(answers):
    answered(answers, ["vibration"], frequency=300)
    before = answers._vibrating
    ((_, _, rows, _),) = answered(answers, ["vibration"], frequency=1)
    assert answers._vibrating is before
    assert rows["S1 per N, over static"][0] < 1


def test_loop_is_that_of_a_linear_spring_first(answers):
    (_, first, linear, _), (_, second, rows, _) = answered(answers, ["loop"], speed=2)
    assert (first, second) == ("linear", "quick")
    # a contact that grows with the depth makes more of the loss: a few tenths
    assert 1 < rows["gap at mid-stroke"][0] / linear["gap at mid-stroke"][0] < 1.3
    assert 0 < rows["gap at mid-stroke"][1] < 0.5
    # one that is kept is not preceded by the estimate
    assert [level for _, level, *_ in answered(answers, ["loop"], speed=2)] == ["quick"]


def test_static_state_says_how_it_comes_to_move(answers):
    (_, _, rows, vibration), (_, _, _, loop) = answered(answers)
    assert not rows
    assert "A frequency above 0 Hz" in vibration
    assert "A speed above 0 mm/s" in loop


@pytest.mark.parametrize(
    ("load", "words"),
    [
        ({"frequency": 1e5}, "the vibration is known from 0.01 to 1000 Hz"),
        ({"frequency": 5, "plate_tilt": 3, "shear": 1, "direction": 90}, "plane of symmetry"),
        ({"speed": 1e5}, "the branches speak for"),
        ({"speed": 1, "depth": 0}, "a depth above 0 mm"),
        ({"speed": 1, "plate_tilt": 3}, "upright plate"),
    ],
)
def test_loads_without_an_answer_get_a_sentence(answers, load, words):
    part = "vibration" if "frequency" in load else "loop"
    ((_, _, rows, message),) = answered(answers, [part], **load)
    assert not rows
    assert words in message[:1].lower() + message[1:]


def test_a_single_branch_has_no_band():
    with pytest.raises(BadInput, match="which is no band"):
        time_answers.prepare(replace(paper(), prony="0.2:1"), Load(depth=1), "rigid", "quick")


def test_free_sensor_is_shaken(answers):
    ((_, _, rows, message),) = answered(answers, ["vibration"], depth=0, frequency=400)
    assert rows["first resonance"][0] == pytest.approx(494, rel=0.3)
    assert "base of the free sensor" in message
