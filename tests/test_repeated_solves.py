"""Stored states that are solved again: the same state comes out, whatever kind of path it is on."""

import contextlib
import json
import sqlite3
from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import path_keys, path_solver, repeated_solves, store, store_check, store_fields, store_file
from studies.mechanics.plate_motion import STILL, PlateMotion
from studies.mechanics.store import State

ROUGH = replace(QUICK, name="rough", section_size=0.25, section_patch=0.03, harmonics=1)
SHORT = replace(paper(), D=6.0, l0=paper().l0 + 1.0)
CASES = {
    "press": (SHORT, Load(depth=0.5), "rigid", "states"),
    "silicone": (replace(paper(), law="yeoh", yeoh_2=0.1, E=2.0), Load(depth=0.4), "ignored", "states"),
    "stick": (paper(), Load(depth=0.5, shear_x=0.3, shear_y=0.1, friction="stick"), "rigid", "states"),
    "grip": (paper(), Load(shear_x=0.3, grip=2.0), "rigid", "states"),
    "friction": (paper(), Load(depth=0.3, shear_x=0.2, friction=0.3), "rigid", "states"),
    "imperfection": (replace(paper(), E=3.0), Load(depth=0.3, imperfection=0.001), "rigid", "states"),
    "ogden": (replace(paper(), law="ogden"), Load(depth=0.5), "rigid", "states"),
    "modes": (replace(paper(), magnet_density=7000.0), Load(depth=0.5), "rigid", "modes"),
    "response": (replace(paper(), density=1200.0, E=2.0), Load(0.5, 0.2, friction="stick"), "rigid", "response"),
    "response at rest": (
        replace(paper(), prony="0.2:0.01 0.1:0.001", modulus="instantaneous"),
        Load(0.5),
        "rigid",
        "response",
    ),
    "elastic response": (replace(paper(), loss_factor=0.0), Load(depth=0.5), "ignored", "response"),
    "cycle": (replace(paper(), loss_factor=0.2), Load(0.5, 0.2, friction=0.3), "rigid", "cycle"),
    "elastic cycle": (replace(paper(), loss_factor=0.0), Load(depth=0.5), "ignored", "cycle"),
    "critical depth": (replace(paper(), L=20.0), Load(depth=0.5), "ignored", "critical depth"),
}


def place_of(name):
    design, load, magnet, kind = CASES[name]
    return path_keys.place(
        Scene(design, (load,), ROUGH, magnet), kind, PlateMotion(speed=0.7) if "cycle" in name else STILL
    )


@pytest.mark.parametrize("name", CASES)
def test_a_problem_is_rebuilt_from_what_is_stored(name):
    """The rebuilt problem has the same key, so it is the same problem."""
    place = place_of(name)
    content = json.loads(json.dumps(place.content))
    state = State(*place.at, "ok", "ok", path_solver.units_of(place.scene, place.kind), 0.0, "")
    again = path_keys.place(
        repeated_solves._scene(content, state), content["quantity"], repeated_solves._motion(content, state)
    )
    assert store.key(again.content) == store.key(place.content)
    assert again.at == place.at


@pytest.fixture(scope="module")
def solved():
    """A press and a grip as they are solved."""
    tasks = {name: path_solver.task(1, place_of(name), [place_of(name).at]) for name in ("press", "grip")}
    return {name: path_solver.solve_task(task) for name, task in tasks.items()}


@pytest.fixture
def file(tmp_path, solved):
    file = tmp_path / "solved.sqlite"
    with store.opened(file) as kept:
        for name, states in solved.items():
            kept.add(place_of(name).content, states)
    return file


def test_states_come_out_as_they_are_stored(file):
    result = list(store_check.checks(file, repeated=5))[-2]
    assert (result.check, result.status, result.checked, result.message) == (
        "states that are solved again",
        "ok",
        2,
        "",
    )


@pytest.mark.parametrize(("error_estimate", "count"), [(0.01, 1), (0.1, 0)])
def test_a_state_that_differs_by_more_than_its_estimate_is_found(file, solved, error_estimate, count):
    (state,) = solved["press"]
    force = [1.05 * part for part in state.answer["response"]["force"]]
    response = state.answer["response"] | {"force": force}
    other = replace(state, answer=state.answer | {"response": response, "error_estimate": error_estimate})
    with store.opened(file) as kept:
        kept.add(place_of("press").content, [other])
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        rows = [row for row in repeated_solves.chosen(connection, 5, 0) if row[2] == 0.0]
        found = list(repeated_solves.differences(connection, rows, None))
    assert len(found) == count
    assert all(
        "path 1 at depth 0.0833333 D and shear 0 D differs by 4.8 % (estimated error" in text for text in found
    )


def test_the_seed_chooses_the_states(file):
    with store.opened(file) as kept:
        kept.add_many(
            (place_of("press").content | {"k": k}, [State(0.1, 0.0, "ok", "ok", {}, 0.0, "")]) for k in range(50)
        )
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        first, again, other = (repeated_solves.chosen(connection, 5, seed) for seed in (1, 1, 2))
    assert (first, len(first)) == (again, 5)
    assert first != other


def test_states_of_other_physics_and_failed_ones_are_not_solved_again(file, solved):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE listed SET physics = 0 WHERE id = 1")
    with store.opened(file) as kept:
        kept.add(place_of("grip").content, [replace(state, outcome="failed") for state in solved["grip"]])
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        assert repeated_solves.chosen(connection, 5, 0) == []


def test_a_content_of_another_program_is_named(file, solved):
    with store.opened(file) as kept:
        kept.add(place_of("press").content | {"new": 1}, solved["press"])
    with store_file.readable(file) as connection:
        store_fields.register(connection)
        rows = [row for row in repeated_solves.chosen(connection, 5, 0) if row[0] == 3]
        (found,) = repeated_solves.differences(connection, rows, None)
    assert found.endswith("has a content that this version does not know")
