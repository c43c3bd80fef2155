"""The trials of critical depths, small shears and frequencies, as the accuracy study runs them."""

import json
import math

import pytest

from fem.accuracy import LEVELS, QUICK
from fem.analyses import modes, small_shear, stability
from geometry.design import paper
from studies.output.atomic_files import json_line
from studies.validation import accuracy_study, error_study, error_study_cases
from studies.validation.error_study import ROLES, TANGENTS, Task, restored


def solved(scene):
    """The states of the paper's sensor at level quick against a rough reference."""
    task = Task(error_study_cases.trial(0, "rigid", scene, "auto"), QUICK, fineness=0)
    known = {error_study.key(*solve): error_study.follow(*solve) for solve in task.solves.values()}
    return task, error_study.states_of(task, known)


def test_the_study_judges_the_errors_of_a_critical_state_that_a_user_gets():
    _, (state,) = solved("critical")
    critical = stability.critical(paper(), accuracy=QUICK)
    assert state["status"] == "ok"
    # the loops may be compiled in the second of both solves only
    assert (state["depth"], state["force"]) == pytest.approx((critical.depth, critical.force), rel=1e-11)
    estimates = critical.estimates.depth, critical.estimates.force
    assert (state["depth_estimate"], state["force_estimate"]) == pytest.approx(estimates, rel=1e-7)
    assert state["depth_error"] == pytest.approx(abs(state["depth"] / state["reference_depth"] - 1))


def test_the_study_judges_the_errors_of_a_small_shear_that_a_user_gets():
    task, states = solved("small shear")
    assert [state["depth_mm"] for state in states] == [load.depth for load in task.trial.loads]
    shear = small_shear.small_shear(paper(), states[-1]["depth_mm"], accuracy=QUICK)
    for name in ("stiffness", "shift", "tilt"):
        assert states[-1][f"{name}_estimate"] == getattr(shear.estimates, name)


def test_the_study_judges_every_frequency():
    task, states = solved("modes")
    assert len(states) == 2 * error_study.COUNT
    eight = modes.modes(paper(), depth=task.trial.loads[1].depth, accuracy=QUICK)
    pressed = states[error_study.COUNT :]
    assert [one["frequency"] for one in pressed] == list(eight.frequency)
    assert [one["frequency_estimate"] for one in pressed] == list(eight.estimates)
    assert {errors["scene"] for errors in accuracy_study.summary(states)} == {"modes"}


def test_a_kept_tangent_is_read_back():
    trial = error_study_cases.trial(0, "rigid", "small shear", "auto")
    for state in error_study.follow(trial, QUICK):
        assert restored("small shear", json.loads(json_line(state.kept()))) == state


def test_a_beam_that_does_not_give_way_is_listed():
    trial = error_study_cases.trial(5, "rigid", "critical", "auto")
    (stable,) = error_study.follow(trial, QUICK)
    assert stable.status == "stable"
    task = Task(trial, QUICK)
    (state,) = error_study.states_of(task, {error_study.key(*task.solves[role]): [stable] for role in ROLES})
    assert state["status"] == "stable"
    assert accuracy_study.summary([state]) == []


def test_all_designs_are_looked_at_and_quick_takes_one():
    made = [task for task in error_study.tasks() if task.trial.scene in TANGENTS]
    assert {task.level.name for task in made} == set(LEVELS)
    for scene in TANGENTS:
        assert {t.trial.number for t in made if t.trial.scene == scene} == set(range(error_study_cases.DESIGNS))
    short = [task.trial for task in error_study.tasks(quick=True) if task.trial.scene in TANGENTS]
    assert {(trial.scene, trial.number) for trial in short} == {(scene, 0) for scene in TANGENTS}


def test_scenes_have_keys_of_their_own():
    keys = {error_study.key(error_study_cases.trial(0, "rigid", scene, "auto"), QUICK) for scene in TANGENTS}
    assert len(keys) == len(TANGENTS)


def test_what_is_not_a_number_has_no_estimate():
    assert math.isnan(error_study.judged("depth", 1.0, 2.0, None)["depth_estimate"])
