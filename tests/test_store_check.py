"""Checks of a store: each finds its own damage, and only that."""

import contextlib
import sqlite3

import pytest

from studies.mechanics import store, store_check
from studies.mechanics.store import State

CONTENT = {"model": "harmonic", "physics": 1, "nu": 0.45}
PRESSED = State(0.125, 0.0, "ok", "ok", {"response": {"force": [0.0, 0.0, 1.0]}}, 0.02, "on Python 3")
NAMES = [
    "pages of the file",
    "links of states to paths",
    "contents of paths belong to their keys",
    "answers and positions of states",
    "physics versions",
    "journals beside the store",
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
    return {check.check: check.message for check in store_check.checks(file) if check.status != "ok"}


def test_a_store_in_order_passes_all_checks(file):
    results = list(store_check.checks(file))
    assert [(result.check, result.status) for result in results] == [(name, "ok") for name in NAMES]
    assert [result.checked for result in results][1:] == [4, 3, 4, 1, 0]


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
        ("UPDATE listed SET nu = 0.1 WHERE id = 2", NAMES[1], "path 2 is listed with other values"),
        ("UPDATE path SET content = '{' WHERE id = 2", NAMES[2], "path 2 is damaged"),
        ("UPDATE path SET content = '{\"nu\": NaN}' WHERE id = 2", NAMES[2], "path 2 is damaged"),
        ("UPDATE state SET answer = '{\"res'", NAMES[3], "and 1 more: magtip store prune --damaged --yes"),
        ("UPDATE state SET answer = '{\"response\": null}' WHERE path = 2", NAMES[3], "a state of path 2 is damaged"),
        ("UPDATE state SET depth = 0.1250000000000007 WHERE path = 2", NAMES[3], "a state of path 2 is damaged"),
        ("DELETE FROM path WHERE id = 2", NAMES[1], "a state has no path"),
        ("DELETE FROM listed WHERE id = 2", NAMES[1], "path 2 is not listed"),
        ("UPDATE listed SET physics = 99 WHERE id = 2", NAMES[4], "1 of harmonic with physics version 99"),
    ],
)
def test_damage_is_found(file, statement, name, message):
    changed(file, statement)
    found = failures(file)
    assert message in found.pop(name)
    assert set(found) <= {NAMES[1]}


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
        (page,) = other.execute("SELECT rootpage FROM sqlite_master WHERE name = 'path'").fetchone()
        (size,) = other.execute("PRAGMA page_size").fetchone()
    content = bytearray(file.read_bytes())
    content[(page - 1) * size : page * size] = bytes(size)
    file.write_bytes(content)
    messages = failures(file)
    assert set(messages) == set(NAMES[:4])
    assert "the file cannot be read there (database disk image is malformed)" in messages[NAMES[2]]


def test_a_damaged_journal_is_found_and_a_whole_one_is_not(file):
    store._write_journal(file, [(CONTENT, [PRESSED])], "full")
    assert failures(file) == {}
    file.with_name(f"{file.name}.journal-1.json").write_text("{")
    assert "journal-1.json' of the store is damaged" in failures(file)[NAMES[5]]


def test_a_check_changes_nothing(file):
    before = file.read_bytes()
    list(store_check.checks(file))
    assert file.read_bytes() == before
