"""The trials of critical depths, small shears and frequencies, as the accuracy study runs them."""

import json
import math

import pytest

from fem.accuracy import LEVELS, QUICK
from fem.analyses import modes, small_shear, stability
from geometry.design import paper
from studies.output.atomic_files import json_line
from studies.validation import error_statistics, error_study, error_study_cases, error_study_tangents
from studies.validation.error_study import Task
from studies.validation.error_study_records import ROLES, TANGENTS, restored


def solved(scene):
    """The states of the paper's sensor at level quick against a rough reference."""
    task = Task(error_study_tangents.trial(0, "rigid", scene), QUICK, fineness=0)
    return task, error_study.states_of(
        task, {error_study.key(*s): error_study_tangents.follow(*s) for s in task.solves.values()}
    )


def test_the_study_judges_the_errors_of_a_critical_state_that_a_user_gets():
    _, (state,) = solved("critical")
    critical = stability.critical(paper(), accuracy=QUICK)
    depth, force = state.judged
    assert state.status == "ok"
    # the loops may be compiled in the second of both solves only
    assert (depth.value, force.value) == pytest.approx((critical.depth, critical.force), rel=1e-11)
    estimates = critical.estimates.depth, critical.estimates.force
    assert (depth.estimate, force.estimate) == pytest.approx(estimates, rel=1e-7)
    assert depth.error == pytest.approx(abs(depth.value / depth.reference - 1))


def test_the_study_judges_the_errors_of_a_small_shear_that_a_user_gets():
    task, states = solved("small shear")
    assert [state.depth_mm for state in states] == [load.depth for load in task.trial.loads]
    shear = small_shear.small_shear(paper(), states[-1].depth_mm, accuracy=QUICK)
    for judged in states[-1].judged:
        assert judged.estimate == getattr(shear.estimates, judged.quantity)


def test_the_study_judges_every_frequency():
    task, states = solved("modes")
    assert len(states) == 2 * error_study_tangents.COUNT
    eight = modes.modes(paper(), depth=task.trial.loads[1].depth, accuracy=QUICK)
    judged = [state.judged[0] for state in states[error_study_tangents.COUNT :]]
    assert [one.value for one in judged] == list(eight.frequency)
    assert [one.estimate for one in judged] == list(eight.estimates)
    assert {errors.scene for errors in error_statistics.summary(states)} == {"modes"}


def test_a_kept_tangent_is_read_back():
    trial = error_study_tangents.trial(0, "rigid", "small shear")
    for state in error_study_tangents.follow(trial, QUICK):
        assert restored("small shear", json.loads(json_line(state.kept()))) == state


def test_a_beam_that_does_not_give_way_is_listed():
    trial = error_study_tangents.trial(5, "rigid", "critical")
    (stable,) = error_study_tangents.follow(trial, QUICK)
    assert stable.status == "stable"
    (state,) = error_study_tangents.states_of(trial, QUICK, {role: [stable] for role in ROLES})
    assert state.status == "stable"
    assert error_statistics.summary([state]) == []


def test_all_designs_are_looked_at_and_quick_takes_one():
    made = [task for task in error_study.tasks() if task.trial.scene in TANGENTS]
    assert {task.level.name for task in made} == set(LEVELS)
    for scene in TANGENTS:
        assert {t.trial.number for t in made if t.trial.scene == scene} == set(range(error_study_cases.DESIGNS))
    short = [task.trial for task in error_study.tasks(quick=True) if task.trial.scene in TANGENTS]
    assert {(trial.scene, trial.number) for trial in short} == {(scene, 0) for scene in TANGENTS}


def test_scenes_have_keys_of_their_own():
    keys = {error_study.key(error_study_tangents.trial(0, "rigid", scene), QUICK) for scene in TANGENTS}
    assert len(keys) == len(TANGENTS)


def test_what_is_not_a_number_has_no_estimate():
    assert math.isnan(error_study_tangents.judged("depth", 1.0, 2.0, None).estimate)
