"""The verb store on the command line."""

import contextlib
import json
import sqlite3

import pytest

from studies.mechanics import store, store_check
from studies.mechanics.store import State

CONTENT = {"model": "harmonic", "physics": 1, "nu": 0.45, "shape": {"L": 1.5}}
ANSWER = {"D_mm": 1.0, "E_MPa": 1.0, "response": {"force": [0.0, 0.0, 2.0]}, "message": ""}
PRESSED = State(0.125, 0.0, "ok", "ok", ANSWER, 0.5, "")
FAILED = State(0.25, 0.0, "failed", "not_converged", ANSWER | {"response": None, "message": "stops"}, 0.5, "")


@pytest.fixture
def file(tmp_path):
    file = tmp_path / "s.sqlite"
    with store.opened(file) as kept:
        kept.add(CONTENT, [PRESSED, FAILED])
    return file


def test_a_list_begins_with_its_summary(run, file, strict):
    status, out, err = run("store", "list", "--store", file, "--json")
    summary, *rows = strict(out)
    assert (status, err, summary["states"], len(rows)) == (0, "", 2, 2)
    assert {row["status"] for row in rows} == {"ok", "not_converged"}


def test_a_list_says_if_no_state_meets_the_filters(run, file):
    status, _, err = run("store", "list", "--store", file, "--where", "nu=0.1")
    assert (status, err) == (0, "magtip: no state of the store meets the filters\n")


def test_a_list_of_the_user_s_store_needs_no_option(run):
    with store.opened(store.default()) as kept:
        kept.add(CONTENT, [PRESSED])
    assert json.loads(run("store", "list", "--json")[1].splitlines()[0])["states"] == 1


def test_a_force_that_was_changed_in_the_file_is_no_answer(run, refusal, tmp_path, strict):
    file = tmp_path / "s.sqlite"
    sweep = ("sweep", "paper", "--axis", "depth=0.5", "--accuracy", "quick", "--magnet", "ignored", "--store", file)
    assert run(*sweep)[0] == 0
    with contextlib.closing(sqlite3.connect(file)) as other, other:
        other.execute("UPDATE state SET answer = json_set(answer, '$.response.force[2]', 99.0)")
    assert "its digest does not match what it holds: magtip store check says what to do" in refusal(*sweep, "--json")
    status, out, _ = run("store", "check", "--store", file, "--json")
    assert (status, [row["check"] for row in strict(out) if row["status"] != "ok"]) == (
        3,
        ["answers and positions of states"],
    )
    assert "1 of the listed states are not as they were written" in run("store", "list", "--store", file)[2]
    assert run("store", "prune", "--store", file, "--damaged", "--yes")[0] == 0
    assert run(*sweep)[0] == 0


def test_a_missing_store_is_refused(refusal, tmp_path):
    for action in (["list"], ["check"], ["export", "--out", "x.csv"], ["prune", "--failed"]):
        assert "there is no store" in refusal("store", *action, "--store", tmp_path / "none.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_an_export_is_counted(run, file, tmp_path, strict):
    status, out, _ = run("store", "export", "--store", file, "--out", "states.csv", "--failed", "--json")
    assert (status, strict(out)) == (0, [{"file": "states.csv", "states": 1}])
    assert len((tmp_path / "states.csv").read_text().splitlines()) == 2


def test_an_export_never_replaces_the_store(refusal, file):
    target = file.rename(file.with_suffix(".csv"))
    before = target.read_bytes()
    assert "is also the input" in refusal("store", "export", "--store", target, "--out", target)
    assert target.read_bytes() == before


def test_a_check_ends_with_status_3_and_the_remedy(run, file):
    assert run("store", "check", "--store", file)[0] == 0
    with store.opened(file) as kept:
        kept.add(CONTENT | {"physics": 99}, [PRESSED])
    status, out, err = run("store", "check", "--store", file)
    assert status == 3
    assert "physics versions" in out
    assert "update magtip" in err


def test_prune_removes_with_consent_only(run, file, strict):
    status, out, err = run("store", "prune", "--store", file, "--failed", "--json")
    assert (status, strict(out)[0]["removed"], strict(out)[0]["states"]) == (0, False, 1)
    assert "add --yes" in err
    assert strict(run("store", "prune", "--store", file, "--failed", "--yes", "--json")[1])[0]["removed"] is True
    assert strict(run("store", "list", "--store", file, "--json")[1])[0]["states"] == 1


def test_the_actions_are_listed_with_their_help(run):
    for words in (["store"], ["store", "--help"]):
        status, out, _ = run(*words)
        assert status == 0
        assert [out.index(f"│ {name} ") for name in ("list", "export", "check", "prune")]
        assert "with --yes remove them" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["list", "x"], "store list takes options only: leave out 'x'"),
        (["list", "--limit", "-1"], "--limit must be at least 0"),
        (["list", "--limit", "2.5"], "--limit must be a whole number"),
        (["list", "--were", "nu=1"], "there is no option --were: did you mean --where?"),
        (["export"], "--out"),
    ],
)
def test_bad_input_has_one_sentence(refusal, words, message):
    assert message in refusal("store", *words)


def test_an_interrupted_check_prints_what_is_checked(run, strict, monkeypatch, file):
    real = store_check.checks

    def stops(*args):
        yield next(real(*args))
        raise KeyboardInterrupt

    monkeypatch.setattr(store_check, "checks", stops)
    status, out, err = run("store", "check", "--store", file, "--json")
    assert (status, [row["status"] for row in strict(out)]) == (130, ["ok"])
    assert "1 rows are complete" in err
