"""Verbs ask the store first: a second run solves nothing, and prints the same."""

import contextlib
import itertools
import sqlite3
from dataclasses import replace

import pytest
from conftest import ROUGH

from fem import equilibrium
from fem.scene import Scene
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import path_solver, store, stored_answers

QUICK = ("--accuracy", "quick", "--magnet", "ignored")
VERBS = {
    "press": ("solve", "paper", "--depths", "0.5,1", *QUICK),
    "shear": ("solve", "paper", "--depth", 0.5, "--shear", 0.3, "--shear-y", 0.4, "--steps", 2, *QUICK),
    "forces": ("solve", "paper", "--forces", "1,2", *QUICK),
    "sheared force": ("solve", "paper", "--force", 2, "--shear-force", 0.5, "--shear-force-y", 0.5, *QUICK),
    "response": ("response", "paper", "--depth", 1, "--friction", "none", "--count", 5, *QUICK),
    "modes": ("modes", "paper", "--count", 3, *QUICK),
}


@pytest.fixture
def solves(monkeypatch):
    """The tasks that are solved."""
    tasks, solve = [], path_solver.solved

    def noted(task, *more):
        tasks.append(task)
        return solve(task, *more)

    monkeypatch.setattr(path_solver, "solved", noted)
    return tasks


def changed(statement):
    with contextlib.closing(sqlite3.connect(store.default())) as connection, connection:
        connection.execute(statement)


@pytest.mark.parametrize("name", VERBS)
def test_a_second_run_solves_nothing_and_prints_the_same(name, run, solves):
    first = run(*VERBS[name], "--json")
    assert first[0] == 0
    assert len(first[1].splitlines()) == (2 if name in ("press", "shear", "forces") else 1)
    assert solves
    solves.clear()
    assert run(*VERBS[name], "--json")[:2] == first[:2]
    assert not solves


def test_a_force_that_no_state_has_is_kept_with_the_nearest_state(run, solves, strict):
    far = ("solve", "paper", "--set", "L=6", "--set", "l0=6", "--forces", "1,5000", *QUICK, "--json")
    run(*far[:-7], "--forces", "1", *QUICK)
    first = run(*far)
    assert [len(task.options["targets"]) for task in solves] == [1, 1]
    assert (first[0], [row["status"] for row in strict(first[1])]) == (3, ["ok", "out_of_reach"])
    assert run(*far)[:2] == first[:2]
    assert len(solves) == 2


def test_other_frequencies_of_a_band_need_no_solve(run, solves, strict):
    run(*VERBS["response"])
    solves.clear()
    (record,) = strict(run(*VERBS["response"][:-6], "--count", 7, *QUICK, "--set", "c=4", "--json")[1])
    assert record["motion"] == "z"
    assert not solves
    run(*VERBS["response"], "--frequencies", "1:500")
    assert len(solves) == 1


def test_a_verb_answers_without_a_store_and_refuses_a_named_one(run, monkeypatch, tmp_path):
    first = run(*VERBS["modes"], "--json")
    (tmp_path / "file").touch()
    monkeypatch.setenv(store.VARIABLE, str(tmp_path / "file" / "states.sqlite"))
    status, out, err = run(*VERBS["modes"], "--json")
    assert (status, out, err.count("\n")) == (*first[:2], 1)
    assert "what is solved here is not kept" in err
    status, out, err = run(*VERBS["modes"], "--store", tmp_path / "file" / "own.sqlite")
    assert (status, out) == (2, "")
    assert "cannot be opened" in err


@pytest.mark.parametrize("kind", ["critical depth", "guided", "small shear"])
def test_an_answer_of_its_own_is_solved_once(kind, kept, solves):
    scene = Scene(replace(paper(), L=20.0), (Load(depth=0.5),), ROUGH, "ignored")
    guided = {"guided": True} if kind == "guided" else None
    place = path_solver.place(scene, "critical depth" if guided else kind, options=guided)
    first = stored_answers.asked(place, kept)
    assert first.status == "ok"
    assert stored_answers.asked(place, kept) == first
    assert len(solves) == 1


def test_where_a_path_stops_is_kept_with_the_state_that_was_reached(kept, solves):
    scene = Scene(replace(paper(), L=6.5, l0=6.0), (Load(depth=6.0),), ROUGH, "ignored")
    (first,) = stored_answers.walked(scene, kept)
    (second,) = stored_answers.walked(scene, kept)
    assert (first.status, len(solves)) == ("not_converged", 1)
    assert "stopped at depth 5." in first.message
    assert second == replace(first, field=None)


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


def test_states_are_shared_with_sweeps_and_a_path_continues_where_it_was_interrupted(
    run, solves, strict, monkeypatch
):
    def interrupted(*_, **__):
        yield from itertools.islice(walk(*_, **__), 1)
        raise KeyboardInterrupt

    walk = equilibrium.walk
    path = ("solve", "paper", "--depths", "0.4,0.6,0.8", *QUICK)
    with monkeypatch.context() as patch:
        patch.setattr(equilibrium, "walk", interrupted)
        status, out, _ = run(*path, "--json")
    assert (status, len(strict(out))) == (130, 1)
    rows = strict(run(*path, "--json")[1])
    assert [load.depth for task in solves for load in task.scene.loads] == [0.4, 0.6, 0.8, 0.6, 0.8]
    (row,) = strict(run("sweep", "paper", "--axis", "depth=0.8", *QUICK, "--json")[1])
    assert (row["fem_force_N"], len(solves)) == (rows[-1]["force_N"][2], 2)


@pytest.mark.parametrize("name", ["press", "sheared force"])
def test_a_picture_of_a_kept_state_needs_a_solve_of_its_body_only(name, run, solves, tmp_path):
    first = run(*VERBS[name], "--json")
    assert run(*VERBS[name], "--json", "--out", tmp_path / "last.vtu")[:2] == first[:2]
    assert len(solves) == 1
    assert (tmp_path / "last.vtu").stat().st_size > 1000


def test_a_way_back_under_friction_is_not_kept(run, solves):
    assert run("solve", "paper", "--depths", "0.5,0.4", "--friction", 0.5, *QUICK)[0] == 0
    assert not solves
    assert not store.default().exists()
