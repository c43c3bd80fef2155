"""The trials of critical depths, small shears and frequencies, as the accuracy study runs them."""

import math

import pytest

from fem import modes, stability
from fem.accuracy import LEVELS, QUICK
from geometry.design import paper
from studies import accuracy, calibration, tangents, trials
from studies.accuracy import Task


def solved(scene):
    """The rows of the paper's sensor at level quick against a rough reference."""
    task = Task(tangents.trial(0, "rigid", scene), QUICK, fineness=0)
    return task, accuracy.rows_of(task, {accuracy.key(*s): tangents.follow(*s) for s in task.solves.values()})


def test_the_study_judges_the_errors_of_a_critical_state_that_a_user_gets():
    _, (row,) = solved("critical")
    found = stability.critical(paper(), accuracy=QUICK)
    assert (row["status"], row["depth"], row["force"]) == ("ok", found.depth, found.force)
    assert row["depth_estimate"] == found.depth_error_estimate
    assert row["force_estimate"] == found.force_error_estimate
    assert row["depth_error"] == pytest.approx(abs(row["depth"] / row["reference_depth"] - 1))


def test_the_study_judges_the_errors_of_a_small_shear_that_a_user_gets():
    task, rows = solved("small shear")
    assert [row["depth_mm"] for row in rows] == [load.depth for load in task.trial.loads]
    found = stability.small_shear(paper(), rows[-1]["depth_mm"], accuracy=QUICK)
    for name in ("stiffness", "shift", "tilt"):
        assert rows[-1][f"{name}_estimate"] == getattr(found, f"{name}_error_estimate")


def test_the_study_judges_every_frequency():
    task, rows = solved("modes")
    assert len(rows) == 2 * tangents.COUNT
    found = modes.modes(paper(), depth=task.trial.loads[1].depth, accuracy=QUICK)
    assert [row["frequency"] for row in rows[tangents.COUNT :]] == list(found.frequency)
    assert [row["frequency_estimate"] for row in rows[tangents.COUNT :]] == list(found.frequency_error_estimate)
    assert {row["scene"] for row in calibration.summary(rows)} == {"modes"}


def test_a_beam_that_does_not_give_way_is_listed():
    trial = tangents.trial(5, "rigid", "critical")
    (state,) = tangents.follow(trial, QUICK)
    assert state["status"] == "stable"
    (row,) = tangents.rows_of(trial, QUICK, {role: [state] for role in ("", "companion_", "reference_")})
    assert row["status"] == "stable"
    assert calibration.summary([row]) == []


def test_all_designs_are_looked_at_and_quick_takes_one():
    made = [task for task in accuracy.tasks() if task.trial.scene in tangents.SCENES]
    assert {task.level.name for task in made} == set(LEVELS)
    for scene in tangents.SCENES:
        assert {t.trial.number for t in made if t.trial.scene == scene} == set(range(trials.DESIGNS))
    short = [task.trial for task in accuracy.tasks(quick=True) if task.trial.scene in tangents.SCENES]
    assert {(trial.scene, trial.number) for trial in short} == {(scene, 0) for scene in tangents.SCENES}


def test_scenes_have_keys_of_their_own():
    keys = {accuracy.key(tangents.trial(0, "rigid", scene), QUICK) for scene in tangents.SCENES}
    assert len(keys) == len(tangents.SCENES)


def test_what_is_not_a_number_has_no_estimate():
    assert math.isnan(tangents._pair("depth", 1.0, 2.0, None)["depth_estimate"])
