"""Fields of stored states: names of accuracy levels, filters that are refused, contents that all have fields."""

import re
from dataclasses import asdict

import pytest
from stores import temporary

from fem.accuracy import LEVELS, QUICK
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.inputs.option_groups import Selection
from studies.mechanics import path_keys, store_fields
from studies.mechanics.plate_motion import PlateMotion
from studies.mechanics.store import State
from studies.mechanics.store_file import LISTED

PRESSED = State(0.125, 0.0, "ok", "ok", {}, 0.5, "")


@pytest.mark.parametrize(
    ("where", "parts"),
    [
        ("nu", ["must be NAME=VALUE", "got 'nu'"]),
        ("=3", ["must be NAME=VALUE"]),
        ("nuu=3", ["there is no field 'nuu': did you mean nu?"]),
        ("nu=abc", ["nu must be a number", "got 'abc'"]),
        ("nu=1:nan", ["nu must be a number", "got 'nan'"]),
        ("nu=0.5:0.4", ["the range of nu is empty", "0.5:0.4"]),
    ],
)
def test_a_wrong_filter_is_refused(where, parts, refused):
    with refused(*parts):
        store_fields.condition(Selection(where=[where]))


def test_a_wrong_date_is_refused(refused):
    with refused("--since must be a date or time", "got 'yesterday'"):
        store_fields.condition(Selection(since="yesterday"))


def test_values_of_the_accuracy_levels_have_their_names():
    for name, level in LEVELS.items():
        with temporary() as kept:
            kept.add({"accuracy": {key: value for key, value in asdict(level).items() if key != "name"}}, [PRESSED])
            (values,) = kept._connection.execute("SELECT json_extract(content, '$.accuracy') FROM path").fetchone()
        assert store_fields.accuracy_name(values) == name


def places(content, at=""):
    """The places of all values of a content, as SQLite names them; an accuracy is one."""
    for name, value in content.items():
        if isinstance(value, dict) and name != "accuracy":
            yield from places(value, f"{at}{name}.")
        elif isinstance(value, list):
            yield from (f"{at}{name}[{k}]" for k in range(len(value)))
        elif value is not None:
            yield f"{at}{name}"


@pytest.mark.parametrize(
    ("load", "kind"),
    [
        (Load(depth=0.5), "states"),
        (Load(depth=0.5, shear_x=0.1, friction="stick"), "states"),
        (Load(depth=0.5), "modes"),
        (Load(depth=0.5), "critical depth"),
        (Load(depth=0.5), "response"),
        (Load(depth=0.5), "cycle"),
    ],
)
def test_every_value_of_a_content_is_a_field(load, kind):
    content = path_keys.place(Scene(paper(), (load,), QUICK), kind, PlateMotion(frequency=1.0)).content
    of_fields = {place for field in store_fields.FIELDS.values() for place in re.findall(r"\$\.([^']+)", field.sql)}
    listed = {place.removeprefix("$.") for place in LISTED.values()}
    # D is 1 over D, and the number of modes is the same in all contents
    assert set(places(content)) - {"shape.D", "load.count"} <= of_fields | listed


def test_physics_versions_are_those_of_the_program():
    condition = store_fields.current_physics("=")
    assert all(f"= '{name}' THEN {version}" in condition for name, version in PHYSICS.items())
