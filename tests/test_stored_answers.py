"""Verbs ask the store first: a second run solves nothing, and prints the same."""

import contextlib
import sqlite3

import pytest

from studies.mechanics import path_solver, store

QUICK = ("--accuracy", "quick", "--magnet", "ignored")
VERBS = {
    "stability": ("stability", "paper", "--depth", 1, *QUICK),
    "slenderness": ("stability", "paper", "--slenderness", "1", *QUICK),
    "modes": ("modes", "paper", "--count", 3, *QUICK),
}


@pytest.fixture
def solves(monkeypatch):
    """The tasks that are solved."""
    tasks, solve = [], path_solver.solve_task

    def noted(task):
        tasks.append(task)
        return solve(task)

    monkeypatch.setattr(path_solver, "solve_task", noted)
    return tasks


def changed(statement):
    with contextlib.closing(sqlite3.connect(store.default())) as connection, connection:
        connection.execute(statement)


@pytest.mark.parametrize("name", VERBS)
def test_a_second_run_solves_nothing_and_prints_the_same(name, run, solves):
    first = run(*VERBS[name], "--json")
    assert first[0] == 0
    assert solves
    solves.clear()
    assert run(*VERBS[name], "--json") == first
    assert not solves


def test_a_damaged_answer_and_one_that_a_dead_process_left_are_solved_again(run, solves):
    first = run(*VERBS["modes"], "--json")
    changed("UPDATE state SET answer = replace(answer, 'bending', 'torsion')")
    status, out, err = run(*VERBS["modes"], "--json")
    assert (status, out, len(solves)) == (*first[:2], 2)
    assert "is damaged" in err


def test_an_answer_of_another_version_of_the_physics_is_not_used(run, solves, monkeypatch):
    run(*VERBS["modes"])
    monkeypatch.setitem(path_solver.PHYSICS, "modes", path_solver.PHYSICS["modes"] + 1)
    run(*VERBS["modes"])
    assert len(solves) == 2


def test_a_similar_design_shares_its_answer_and_another_store_does_not(run, solves, strict, tmp_path):
    (first,) = strict(run(*VERBS["modes"], "--json")[1])
    # lengths and modulus of a similar design: frequencies go with E^(1/2) / D
    similar = ("--set", "D=16", "--set", "L=18", "--set", "l0=14.4", "--set", "E=4", "--set", "f=4")
    (second,) = strict(run(*VERBS["modes"], *similar, "--json")[1])
    assert len(solves) == 1
    assert second["frequency_Hz"] == pytest.approx(
        [f * (4 / 1.0) ** 0.5 / 2 for f in first["frequency_Hz"]], rel=1e-9
    )
    run(*VERBS["modes"], "--store", tmp_path / "other.sqlite")
    assert len(solves) == 2
