"""States of the explorer: what they mean, and the commands that reproduce them."""

import contextlib
import io
import json
import shlex

import pytest

from fem.accuracy import LEVELS
from fem.equilibrium import solve
from geometry.design import BadInput
from studies.cli import commands
from studies.explorer.explorer_state import components, request_of, state_of, wrong_field
from studies.explorer.state_exports import address_fields, changed_fields, python, shell

STATES = [
    {"load": {"depth": 1}, "level": "quick"},
    {"design": {"D": 10, "law": "yeoh", "yeoh_2": 0.1}, "load": {"depth": 0.8, "friction": "none"}, "level": "quick"},
    {"load": {"depth": 0.7, "shear": -0.3, "direction": 30}, "level": "quick"},
    {"design": {"magnet_diameter": 0, "magnet_height": 0}, "magnet": "ignored", "load": {"depth": 0.9}},
]


@pytest.mark.parametrize("content", STATES, ids=["press", "law", "shear", "silicone"])
def test_commands_reproduce_the_state(content, capsys):
    state = state_of(content)
    force = solve(state.design, state.load, LEVELS[state.level], magnet=state.magnet).response.force
    program, *words = shlex.split(shell(state))
    assert program == "magtip"
    assert commands.run([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["force_N"] == pytest.approx(force, rel=1e-9, abs=1e-12)
    names = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(python(state), names)
    assert names["state"].response.force == pytest.approx(force, rel=1e-9, abs=1e-12)


def test_shear_along_an_axis_has_no_component_across():
    for direction, expected in ((0, (2, 0)), (90, (0, 2)), (-90, (0, -2)), (180, (-2, 0)), (450, (0, 2))):
        assert components(2.0, direction) == expected
    x, y = components(2.0, 30)
    assert (x, y) == pytest.approx((3**0.5, 1))


def test_defaults_are_those_of_the_command_line():
    assert state_of({"load": {"depth": 1}}).load.friction == "none"
    assert state_of({"load": {"depth": 1, "shear": 1}}).load.friction == "stick"
    assert state_of({"load": {"depth": 1, "shear": 1, "friction": 0.4}}).load.friction == 0.4


def test_address_and_overrides_name_changed_fields_only():
    state = state_of({"design": {"D": 8, "E": 2, "magnet_north": "up"}})
    assert changed_fields(state) == {"E": 2.0, "magnet_north": "up"}
    assert address_fields(state.design) == {"preset": "paper", "E": "2", "magnet_north": "up"}


def test_wrong_field_is_the_one_without_which_the_state_is_accepted():
    assert wrong_field({"state": {"design": {"D": 9, "L": 3}, "load": {"depth": 1}}}) == "L"
    assert wrong_field({"state": {"design": {"D": 9}, "load": {"depth": 1, "shear": 99}}}) == "shear"
    assert wrong_field({"state": {"preset": "none"}}) is None


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ({"number": True}, "number must be a whole number"),
        ({"side": "c"}, "side must be one of a, b"),
        ({"parts": ["figure"]}, "parts must be a list of"),
        ({"state": []}, "state must be a table"),
        ({"state": {"design": {"d": 8}}}, "did you mean D?"),
        ({"state": {"load": {"grip": 1}}}, "there is no key 'grip'"),
        ({"state": {"load": {"depth": True}}}, "depth must be a finite number"),
        ({"state": {"load": {"depth": 1, "shear": 1, "direction": float("nan")}}}, "finite number of degrees"),
        ({"state": {"load": {"depth": 1, "frequency": -1}}}, "frequency must be 0 Hz or more"),
        ({"state": {"level": "fine"}}, "level must be one of quick, standard"),
        ({"formula_level": "best"}, "level must be one of paper"),
    ],
)
def test_impossible_requests_are_refused(message, words):
    with pytest.raises(BadInput, match=words.replace("?", r"\?")):
        request_of(message)
