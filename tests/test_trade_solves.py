"""Solves in processes of their own, with their cost."""

import math

import pytest

from fem.accuracy import QUICK
from geometry.loads import Load
from studies.surrogate import surrogate_response
from studies.validation import error_study, trade_cases, trade_solves
from studies.validation.error_study import SolvedState
from studies.validation.error_study_cases import Trial
from studies.validation.trade_solves import Run, measure, solved

TRIAL = trade_cases.trial(0, "press", "axisymmetric")


def test_a_solve_in_its_own_process_gives_the_same_states_and_its_cost():
    run = Run(TRIAL, QUICK)
    answer = solved(TRIAL, measure(run))
    # one of the processes may run compiled loops, which round differently
    for state, again in zip(answer.states, error_study.follow(TRIAL, QUICK), strict=True):
        assert state.response.force == pytest.approx(again.response.force, rel=1e-9)
        assert state.response.shift == pytest.approx(again.response.shift, rel=1e-9)
    assert 0 < answer.cpu_s < 60
    assert 1 < answer.peak_MB < 2000


def test_a_process_that_dies_is_an_answer(monkeypatch):
    monkeypatch.setattr(trade_solves, "LIMIT_S", 0.0)
    (state,) = solved(TRIAL, measure(Run(TRIAL, QUICK))).states
    assert (state.status, state.message) == ("not_finished", "stopped after 0 s")


def test_a_lost_process_has_no_cost_and_is_not_kept(monkeypatch):
    monkeypatch.setattr(trade_solves, "LIMIT_S", 0.0)
    answer = measure(Run(TRIAL, QUICK))
    assert math.isnan(answer["cpu_s"])
    assert not trade_solves.is_kept(Run(TRIAL, QUICK), answer)


def test_what_may_change_without_a_version_is_not_kept():
    assert not any(
        trade_solves.is_kept(Run(TRIAL, level), measure(Run(TRIAL, level))) for level in ("finite", "paper")
    )
    crashed = {"states": [SolvedState("crashed", "IndexError").kept()], "cpu_s": 1.0}
    assert not trade_solves.is_kept(Run(TRIAL, QUICK), crashed)
    assert trade_solves.is_kept(Run(TRIAL, QUICK), {"states": [{"status": "ok"}], "cpu_s": 1.0})


def test_formulas_are_measured_without_a_process():
    answer = solved(TRIAL, measure(Run(TRIAL, "finite")))
    assert [state.status for state in answer.states] == ["ok"] * len(TRIAL.loads)
    assert 0 < answer.cpu_s < 1


def test_a_load_that_a_level_refuses_is_a_state():
    loads = (Load(depth=0.5, shear_x=0.5, friction=0.3),)
    (state,) = trade_solves.follow_formula(Trial(0, TRIAL.design, "rigid", "friction", "auto", loads), "finite")
    assert state.status == "refused"


def test_the_surrogate_is_measured_without_a_process():
    run = Run(trade_cases.trial(0, "glued shear", "auto"), "shipped")
    answer = solved(run.trial, measure(run))
    assert (run.model, run.level) == ("surrogate", "shipped")
    assert [state.response for state in answer.states] == [
        surrogate_response.respond(run.trial.design, load).response for load in run.trial.loads
    ]
    assert 0 < answer.cpu_s < 1


def test_the_surrogate_refuses_what_lies_outside_its_range():
    states = trade_solves.follow_surrogate(trade_cases.trial(1, "press", "auto"))
    assert {(state.status, state.response) for state in states} == {("refused", None)}


def test_keys_tell_model_level_and_load_apart():
    runs = [
        *(Run(trade_cases.trial(0, "press", model), QUICK) for model in ("axisymmetric", "harmonic", "half")),
        *(Run(trade_cases.trial(0, kind, "harmonic"), QUICK) for kind in ("glued shear", "friction")),
        *(Run(TRIAL, level) for level in ("paper", "finite", "shipped")),
    ]
    assert len({run.key for run in runs}) == len(runs)


@pytest.mark.parametrize("method", [QUICK, "finite", "shipped"])
def test_the_text_of_the_progress_names_design_and_method(method):
    assert "design 0" in Run(TRIAL, method).name
