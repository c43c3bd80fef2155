"""The study of cost and error: its plan, a reduced run on two designs, and its files."""

import contextlib
import csv
import io
import json

import pytest

from studies.cli import entry_point
from studies.output import atomic_files, checkpoint
from studies.validation import trade_cases, trade_solves, trade_study
from studies.validation.trade import FILES

COMMAND = ("validate", "trade", "--quick", "--designs", "2", "--json")


def test_the_whole_plan_runs_every_model_at_every_level_that_is_not_excluded():
    planned = trade_study.plan()
    cells = {(one.kind, one.model, one.level) for one in planned.runs}
    excluded = {cell for cell, count in trade_cases.RUNS.items() if count == 0}
    everything = {
        (kind, model, level)
        for kind in trade_cases.KINDS
        for model in trade_cases.MODELS[kind]
        for level in ("quick", "standard", "fine")
    }
    assert {cell for cell in cells if cell[1] not in trade_cases.CALCULATED} == everything - excluded
    surrogate = {(kind, level) for kind, model, level in cells if model == "surrogate"}
    assert surrogate == {("press", "shipped"), ("glued shear", "shipped")}
    assert {level for kind, model, level in cells if model == "formula"} == set(trade_cases.FORMULAS)


def test_every_run_has_a_reference():
    for planned in (trade_study.plan(), trade_study.confirming_plan(), trade_study.plan(2, quick=True)):
        assert {(one.trial.number, one.kind) for one in planned.runs} == set(planned.references)


def test_the_confirming_runs_are_on_other_designs():
    trials = {one.trial.design for one in trade_study.confirming_plan().runs}
    assert len(trials) >= 20
    assert not trials & set(trade_cases.designs())


@pytest.fixture(scope="module")
def reduced(tmp_path_factory):
    """Folder and rows of `magtip validate trade --quick` on two designs."""
    folder = tmp_path_factory.mktemp("trade")
    # of an earlier run with --confirm
    atomic_files.write_text(folder / "confirm.csv", "kind")
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert entry_point.main([*COMMAND, "--out", str(folder)]) == 0
    return folder, [json.loads(line) for line in out.getvalue().splitlines()]


def test_a_reduced_run_measures_errors_and_costs(reduced):
    cell = next(row for row in reduced[1] if (row["kind"], row["model"]) == ("press", "axisymmetric"))
    assert 0 < cell["force_p95_percent"] < 3
    assert cell["cpu_s"] > 0
    assert cell["peak_MB"] > 0


def test_a_reduced_run_writes_all_files(reduced):
    folder, _ = reduced
    assert {path.name for path in folder.glob("[!.]*")} >= set(FILES) - {"confirm.csv"}
    assert not (folder / "confirm.csv").exists()
    table = list(csv.DictReader((folder / "trade.csv").open(encoding="utf-8")))
    assert {row["model"] for row in table} == {"formula", "surrogate", "axisymmetric", "harmonic"}


def test_a_run_that_was_stopped_solves_only_what_is_missing(reduced, monkeypatch):
    again = []
    original = trade_solves.measure
    monkeypatch.setattr(trade_solves, "measure", lambda one: again.append(one.model) or original(one))
    states = trade_study.run(trade_study.plan(2, quick=True), reduced[0])
    assert {state["status"] for state in states} <= {"ok", "refused"}
    assert set(again) == set(trade_cases.CALCULATED)


def test_a_run_names_the_commits_of_its_solves(reduced, monkeypatch):
    monkeypatch.setattr(checkpoint, "commit", lambda: "later")
    states = trade_study.run(trade_study.plan(2, quick=True), reduced[0])
    assert {state["commit"] for state in states if state["model"] in trade_cases.CALCULATED} == {"later"}
    assert "later" not in {state["commit"] for state in states if state["model"] not in trade_cases.CALCULATED}


def test_the_number_of_designs_is_checked(run):
    status, _, err = run("validate", "trade", "--designs", "1")
    assert status == 2
    assert "between 2 and 24; got 1" in err
