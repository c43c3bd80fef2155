"""The trials of critical depths, small shears and frequencies, as the accuracy study runs them."""

import math

import pytest

from fem import modes, stability
from fem.accuracy import LEVELS, QUICK
from geometry.design import paper
from studies.validation import error_statistics, error_study, error_study_cases, error_study_tangents
from studies.validation.error_study import Task


def solved(scene):
    """The rows of the paper's sensor at level quick against a rough reference."""
    task = Task(error_study_tangents.trial(0, "rigid", scene), QUICK, fineness=0)
    return task, error_study.rows_of(
        task, {error_study.key(*s): error_study_tangents.follow(*s) for s in task.solves.values()}
    )


def test_the_study_judges_the_errors_of_a_critical_state_that_a_user_gets():
    _, (row,) = solved("critical")
    found = stability.critical(paper(), accuracy=QUICK)
    assert (row["status"], row["depth"], row["force"]) == ("ok", found.depth, found.force)
    assert row["depth_estimate"] == found.estimates.depth
    assert row["force_estimate"] == found.estimates.force
    assert row["depth_error"] == pytest.approx(abs(row["depth"] / row["reference_depth"] - 1))


def test_the_study_judges_the_errors_of_a_small_shear_that_a_user_gets():
    task, rows = solved("small shear")
    assert [row["depth_mm"] for row in rows] == [load.depth for load in task.trial.loads]
    found = stability.small_shear(paper(), rows[-1]["depth_mm"], accuracy=QUICK)
    for name in ("stiffness", "shift", "tilt"):
        assert rows[-1][f"{name}_estimate"] == getattr(found.estimates, name)


def test_the_study_judges_every_frequency():
    task, rows = solved("modes")
    assert len(rows) == 2 * error_study_tangents.COUNT
    found = modes.modes(paper(), depth=task.trial.loads[1].depth, accuracy=QUICK)
    assert [row["frequency"] for row in rows[error_study_tangents.COUNT :]] == list(found.frequency)
    assert [row["frequency_estimate"] for row in rows[error_study_tangents.COUNT :]] == list(found.estimates)
    assert {row["scene"] for row in error_statistics.summary(rows)} == {"modes"}


def test_a_beam_that_does_not_give_way_is_listed():
    trial = error_study_tangents.trial(5, "rigid", "critical")
    (state,) = error_study_tangents.follow(trial, QUICK)
    assert state["status"] == "stable"
    (row,) = error_study_tangents.rows_of(trial, QUICK, {role: [state] for role in ("", "companion_", "reference_")})
    assert row["status"] == "stable"
    assert error_statistics.summary([row]) == []


def test_all_designs_are_looked_at_and_quick_takes_one():
    made = [task for task in error_study.tasks() if task.trial.scene in error_study_tangents.SCENES]
    assert {task.level.name for task in made} == set(LEVELS)
    for scene in error_study_tangents.SCENES:
        assert {t.trial.number for t in made if t.trial.scene == scene} == set(range(error_study_cases.DESIGNS))
    short = [task.trial for task in error_study.tasks(quick=True) if task.trial.scene in error_study_tangents.SCENES]
    assert {(trial.scene, trial.number) for trial in short} == {(scene, 0) for scene in error_study_tangents.SCENES}


def test_scenes_have_keys_of_their_own():
    keys = {
        error_study.key(error_study_tangents.trial(0, "rigid", scene), QUICK) for scene in error_study_tangents.SCENES
    }
    assert len(keys) == len(error_study_tangents.SCENES)


def test_what_is_not_a_number_has_no_estimate():
    assert math.isnan(error_study_tangents._pair("depth", 1.0, 2.0, None)["depth_estimate"])
