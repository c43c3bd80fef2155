"""Removal of states: only those that are meant, only with consent, and their space is given back."""

import contextlib
import sqlite3

import pytest

from studies.inputs.option_groups import Selection
from studies.mechanics import store, store_file, store_pruning
from studies.mechanics.store import State

CONTENT = {"model": "harmonic", "physics": 1, "nu": 0.45}
PRESSED = State(0.125, 0.0, "ok", "ok", {"response": {"force": [0.0, 0.0, 1.0]}, "message": "x" * 500}, 0.5, "")
FAILED = State(0.25, 0.0, "failed", "not_converged", {"response": None}, 0.5, "")


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "solved.sqlite"
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED, FAILED])
        kept.add_many((CONTENT | {"nu": 0.3, "k": k}, [PRESSED]) for k in range(300))
        kept.add(CONTENT | {"nu": 0.2}, [FAILED])
    return file


def prune(file, *where, yes=False, **filters):
    return store_pruning.prune(Selection(store=file, where=list(where), **filters), yes=yes)


def counts(file):
    with store.opened(file) as kept:
        return kept.counts()


def test_without_consent_states_are_only_counted(file):
    pruning = prune(file, "nu=0.3")
    assert (pruning.removed, pruning.states, pruning.paths, pruning.states_left) == (False, 300, 300, 3)
    assert pruning.solving_s == pytest.approx(150.0)
    assert 0 < pruning.freed_MB < pruning.size_MB
    assert counts(file) == (302, 303)


def test_states_are_removed_and_their_space_is_given_back(file):
    size = file.stat().st_size
    pruning = prune(file, "nu=0.3", yes=True)
    assert (pruning.removed, pruning.states, pruning.paths, pruning.states_left) == (True, 300, 300, 3)
    assert counts(file) == (2, 3)
    assert file.stat().st_size < size / 2
    assert pruning.freed_MB > pruning.size_MB / 2
    with store.opened(file) as kept:
        assert set(kept.states(CONTENT)) == {(0.125, 0.0), (0.25, 0.0)}


def test_a_path_goes_with_its_last_state(file):
    pruning = prune(file, failed=True, yes=True)
    assert (pruning.states, pruning.paths) == (2, 1)
    assert counts(file) == (301, 301)
    with store_file.readable(file) as connection:
        assert connection.execute("SELECT COUNT(*) FROM listed").fetchone() == (301,)


def test_damaged_states_are_removed(file):
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET answer = '{' WHERE outcome = 'failed' AND path = 1")
        other.execute("UPDATE path SET content = '{' WHERE id = 2")
    assert (prune(file, damaged=True).states, prune(file, damaged=True, yes=True).states) == (2, 2)
    assert counts(file) == (301, 301)
    assert prune(file, damaged=True).states == 0


def test_all_states_go_only_by_a_filter(file, refused):
    with refused("prune needs a filter, such as --failed"):
        prune(file, yes=True)
    assert counts(file) == (302, 303)


def test_a_locked_store_keeps_its_states(file, monkeypatch, refused):
    monkeypatch.setattr(store_file, "PATIENCE", 0.05)
    with contextlib.closing(sqlite3.connect(file, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with refused("is locked by another process"):
            prune(file, failed=True, yes=True)
    assert counts(file) == (302, 303)


def test_a_process_that_reads_meanwhile_is_not_disturbed(file):
    with store_file.readable(file) as reader:
        rows = reader.execute("SELECT COUNT(*) FROM state")
        reader.execute("BEGIN")
        assert rows.fetchone() == (303,)
        reader.execute("SELECT COUNT(*) FROM state").fetchone()
        assert prune(file, failed=True, yes=True).states == 2
        assert reader.execute("SELECT COUNT(*) FROM state").fetchone() == (303,)
    assert counts(file) == (301, 301)
