"""Checks of a store: each finds its own damage, and only that; a state solved again comes out as it is stored."""

import contextlib
import json
import sqlite3
from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import path_solver, store, store_actions, store_check
from studies.mechanics.store import State
from studies.mechanics.timed_quantities import STILL, PlateMotion

CONTENT = {"model": "harmonic", "physics": 1, "nu": 0.45}
PRESSED = State(0.125, 0.0, "ok", "ok", {"response": {"force": [0.0, 0.0, 1.0]}}, 0.02, "on Python 3")
NAMES = [
    "pages of the file",
    "links of states to paths",
    "contents of paths belong to their keys",
    "answers and positions of states",
    "physics versions",
]


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "solved.sqlite"
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED, State(0.25, 0.0, "failed", "not_converged", {"response": None}, 0.1, "")])
        kept.add(CONTENT | {"nu": 0.4}, [PRESSED])
        modes = State(0.0, 0.0, "ok", "ok", {"response": None, "values": {"frequency": [1.0]}}, 0.1, "")
        kept.add(CONTENT | {"nu": 0.3}, [modes])
    return file


def changed(file, statement):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute(statement)


def failures(file):
    return {check["check"]: check["message"] for check in store_check.checks(file) if check["status"] != "ok"}


def test_a_store_in_order_passes_all_checks(file):
    results = list(store_check.checks(file))
    assert [(result["check"], result["status"]) for result in results] == [(name, "ok") for name in NAMES]
    assert [result["checked"] for result in results][1:] == [4, 3, 4, 1]


@pytest.mark.parametrize(
    ("statement", "name", "message"),
    [
        (
            "UPDATE path SET content = replace(content, '0.45', '0.46')",
            NAMES[2],
            "path 1 is damaged: magtip store prune",
        ),
        ("UPDATE state SET answer = replace(answer, '1.0', '99.0') WHERE path = 2", NAMES[3], "a state of path 2"),
        ("UPDATE state SET versions = CAST(x'ff' AS TEXT) WHERE path = 2", NAMES[3], "a state of path 2 is damaged"),
        ("UPDATE state SET answer = '1' WHERE path = 2", NAMES[3], "a state of path 2 is damaged"),
        ("UPDATE path SET content = '{' WHERE id = 2", NAMES[2], "path 2 is damaged"),
        ("UPDATE path SET content = '{\"nu\": NaN}' WHERE id = 2", NAMES[2], "path 2 is damaged"),
        ("UPDATE state SET answer = '{\"res'", NAMES[3], "and 1 more: magtip store prune --damaged --yes"),
        ("UPDATE state SET answer = '{\"response\": null}' WHERE path = 2", NAMES[3], "a state of path 2 is damaged"),
        ("UPDATE state SET depth = 0.1250000000000007 WHERE path = 2", NAMES[3], "a state of path 2 is damaged"),
        ("DELETE FROM path WHERE id = 2", NAMES[1], "a state has no path"),
    ],
)
def test_damage_is_found(file, statement, name, message):
    changed(file, statement)
    found = failures(file)
    assert message in found.pop(name)
    assert not found


def test_a_physics_version_of_a_later_program_is_found(file):
    with store.opened(file) as kept:
        kept.add(CONTENT | {"physics": 99}, [PRESSED])
    assert failures(file)[NAMES[4]].startswith("1 of harmonic with physics version 99: ")


def test_an_index_that_lacks_a_row_is_found(file):
    with store.opened(file) as kept:
        kept.add_many((CONTENT | {"nu": k / 1000}, [PRESSED]) for k in range(400))
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        (page,) = other.execute("SELECT rootpage FROM sqlite_master WHERE name = 'state_listing'").fetchone()
        (size,) = other.execute("PRAGMA page_size").fetchone()
        (empty,) = other.execute("SELECT rootpage FROM sqlite_master WHERE name = 'about'").fetchone()
    other.close()
    content = bytearray(file.read_bytes())
    # an index without any rows: a valid page, of the kind of a leaf of an index
    leaf = bytes([10, 0, 0, 0, 0]) + size.to_bytes(2, "big") + bytes(1)
    content[(page - 1) * size : page * size] = leaf + bytes(size - len(leaf))
    file.write_bytes(content)
    assert empty != page
    assert "state_listing" in failures(file)[NAMES[0]]


def test_a_table_that_cannot_be_read_fails_its_checks_only(file):
    with contextlib.closing(sqlite3.connect(file)) as other:
        other.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        (page,) = other.execute("SELECT rootpage FROM sqlite_master WHERE name = 'state'").fetchone()
        (size,) = other.execute("PRAGMA page_size").fetchone()
    content = bytearray(file.read_bytes())
    content[(page - 1) * size : page * size] = bytes(size)
    file.write_bytes(content)
    messages = failures(file)
    assert set(messages) == {NAMES[0], NAMES[1], NAMES[3]}
    assert "the file cannot be read there (database disk image is malformed)" in messages[NAMES[3]]


def test_a_check_changes_nothing(file):
    before = file.read_bytes()
    list(store_check.checks(file))
    assert file.read_bytes() == before


# States solved again, whatever kind of path they are on

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
    return path_solver.place(
        Scene(design, (load,), ROUGH, magnet), kind, PlateMotion(speed=0.7) if "cycle" in name else STILL
    )


@pytest.mark.parametrize("name", CASES)
def test_a_problem_is_rebuilt_from_what_is_stored(name):
    """The rebuilt problem has the same key, so it is the same problem."""
    place = place_of(name)
    content = json.loads(json.dumps(place.content))
    state = State(*place.at, "ok", "ok", path_solver.units_of(place.scene, place.kind), 0.0, "")
    again = path_solver.place(
        store_check._scene(content, state), content["quantity"], store_check._motion(content, state)
    )
    assert store.key(again.content) == store.key(place.content)
    assert again.at == place.at


@pytest.fixture(scope="module")
def solved():
    """A press and a grip as they are solved."""
    tasks = {name: path_solver.task(1, place_of(name), [place_of(name).at]) for name in ("press", "grip")}
    return {name: path_solver.solve_task(task) for name, task in tasks.items()}


@pytest.fixture
def pressed(tmp_path, solved):
    pressed = tmp_path / "solved.sqlite"
    with store.opened(pressed) as kept:
        for name, states in solved.items():
            kept.add(place_of(name).content, states)
    return pressed


def test_states_come_out_as_they_are_stored(pressed):
    row = list(store_check.checks(pressed, repeated=5))[-1]
    assert list(row.values()) == ["states that are solved again", "ok", 2, ""]


@pytest.mark.parametrize(("error_estimate", "count"), [(0.01, 1), (0.1, 0)])
def test_a_state_that_differs_by_more_than_its_estimate_is_found(pressed, solved, error_estimate, count):
    (state,) = solved["press"]
    force = [1.05 * part for part in state.answer["response"]["force"]]
    response = state.answer["response"] | {"force": force}
    other = replace(state, answer=state.answer | {"response": response, "error_estimate": error_estimate})
    with store.opened(pressed) as kept:
        kept.add(place_of("press").content, [other])
    with store.readable(pressed) as connection:
        store_actions.register(connection)
        rows = [row for row in store_check.chosen(connection, 5, 0) if row[2] == 0.0]
        found = list(store_check.differences(connection, rows, None))
    assert len(found) == count
    assert all(
        "path 1 at depth 0.0833333 D and shear 0 D differs by 4.8 % (estimated error" in text for text in found
    )


def test_the_seed_chooses_the_states(pressed):
    with store.opened(pressed) as kept:
        kept.add_many(
            (place_of("press").content | {"k": k}, [State(0.1, 0.0, "ok", "ok", {}, 0.0, "")]) for k in range(50)
        )
    with store.readable(pressed) as connection:
        store_actions.register(connection)
        first, again, other = (store_check.chosen(connection, 5, seed) for seed in (1, 1, 2))
    assert (first, len(first)) == (again, 5)
    assert first != other


def test_states_of_other_physics_and_failed_ones_are_not_solved_again(pressed, solved):
    with store.opened(pressed) as kept:
        kept.add(place_of("press").content | {"physics": 0}, solved["press"])
        kept.add(place_of("grip").content, [replace(state, outcome="failed") for state in solved["grip"]])
    with store.readable(pressed) as connection:
        store_actions.register(connection)
        assert [path for path, _, _ in store_check.chosen(connection, 5, 0)] == [1]


def test_a_content_of_another_program_is_named(pressed, solved):
    with store.opened(pressed) as kept:
        kept.add(place_of("press").content | {"new": 1}, solved["press"])
    with store.readable(pressed) as connection:
        store_actions.register(connection)
        rows = [row for row in store_check.chosen(connection, 5, 0) if row[0] == 3]
        (found,) = store_check.differences(connection, rows, None)
    assert found.endswith("has a content that this version does not know")
