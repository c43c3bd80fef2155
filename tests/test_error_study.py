"""The study of error estimates at reduced size, and whether its statistics tell kept promises from broken ones."""

import json
import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from conftest import ROUGH

from fem import equilibrium
from fem.accuracy import LEVELS, QUICK
from fem.analyses import modes, small_shear, stability
from fem.physics_version import PHYSICS
from fem.results.error_estimates import table_rows
from geometry.design import paper
from studies.output import goals, provenance
from studies.output.result import FAILED
from studies.validation import error_study_cases
from studies.validation.error_study_cases import TANGENT_SCENES
from studies.validation.errors import accuracy_study, error_table
from studies.validation.errors.accuracy_study import COUNT, Task, status, tangent_rows
from studies.validation.errors.error_table import QUANTITIES


def task(scene, number=0, fineness=1):
    """A trial of a design at level quick against a reference."""
    trial = error_study_cases.trial(number, "rigid", scene, "auto")
    return Task(trial, QUICK, error_study_cases.reference(scene, fineness))


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """States of the paper's sensor, presses and shears, with their answers at level quick and on a reference."""
    store = tmp_path_factory.mktemp("accuracy") / "states.sqlite"
    paths = [(one, load) for one in (task("press"), task("stick", fineness=0)) for load in one.trial.loads]
    return paths, accuracy_study.solved(paths, store)


def state(true, estimate, **changes):
    """A state whose quantities all have the same true error and estimate."""
    place = {"design": 0, "odd": False, "magnet": "rigid", "level": "quick", "scene": "press", "path": "press"}
    place |= {"model": "axisymmetric", "depth_mm": 1.0, "shear_mm": 0.0, "status": "ok", "message": ""}
    errors = {f"{name}_error": true for name in QUANTITIES} | {f"{name}_estimate": estimate for name in QUANTITIES}
    return place | errors | changes


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_loads_leave_room_for_the_magnet_and_deep_presses_begin_beyond_the_others(magnet):
    for n, design in enumerate(error_study_cases.designs()):
        scenes = ("press", "deep", "stick", "friction", "grip")
        press, deep, *others = (error_study_cases.trial(n, magnet, scene, "auto").loads for scene in scenes)
        above = design.R - design.magnet_height / 2 if magnet == "rigid" else design.L
        assert all(load.depth <= 0.3001 * above for loads in (press, *others) for load in loads)
        assert press[-1].depth < deep[0].depth
        assert deep[-1].depth <= 0.4501 * (design.L - design.magnet_height * (magnet == "rigid"))


def test_the_study_judges_the_estimates_that_a_user_gets_by_the_true_error_to_the_reference(solved):
    """Also in the press before a shear, which is on the mesh of the shears."""
    paths, answers = solved
    states = accuracy_study.compare(paths, *answers)
    assert set(states.status) == {"ok"}
    assert list(states.scene) == [*["press"] * 3, "pressed", "stick", "stick"]
    solutions = [
        s for scene in ("press", "stick") for s in equilibrium.trace(paper(), task(scene).trial.loads, QUICK)
    ]
    for one, solution in zip(states.itertuples(), solutions, strict=True):
        estimates = solution.estimates.force, solution.estimates.shift
        assert (one.force_estimate, one.shift_estimate) == pytest.approx(estimates, rel=1e-6)
        assert one.force_z_N == pytest.approx(solution.response.force[2], rel=1e-8)
    last = states.iloc[2]
    assert states.sideways_estimate.iloc[-1] == pytest.approx(solutions[-1].estimates.sideways, rel=1e-6)
    # quick presses of the paper's sensor keep their promise
    for name in ("force", "shift"):
        assert (states[f"{name}_error"][:3] <= np.minimum(states[f"{name}_estimate"][:3], 0.03)).all()
    off = abs(last["force_z_N"] / last["reference_force_z_N"] - 1)
    assert 0 < last["force_error"] == pytest.approx(off, rel=1e-6)
    assert math.isnan(last["tilt_error"])


def test_a_state_that_was_not_reached_is_listed_and_left_out(solved):
    paths, (level, reference) = solved
    stopped = reference.copy()
    stopped.loc[[1, 2], ["status", "message"]] = "not_converged", "stopped at depth 0.3 mm"
    states = accuracy_study.compare(paths[:3], level[:3], stopped[:3])
    assert list(states["status"]) == ["ok", "not_converged", "not_converged"]
    assert {errors["states"] for errors in error_table.summary(states)} == {1}
    assert states["message"][1] == "reference: stopped at depth 0.3 mm"


def test_the_full_study_covers_all_levels_scenes_and_models_and_holds_the_reference_against_a_finer_one():
    made = accuracy_study.tasks()
    assert {task.level.name for task in made} == {*LEVELS, "reference"}
    assert {t.trial.scene for t in made if t.trial.model != "half"} == {"press", "stick", *TANGENT_SCENES}
    assert {t.trial.scene for t in made if t.trial.model == "half"} == {"press", "stick"}
    checked = [one for one in made if one.level.name == "reference"]
    assert {one.trial.scene for one in checked} == {"press", "stick"}
    for one in checked:
        assert one.reference.section_size < one.level.section_size
        assert one.reference.section_patch <= one.level.section_patch
    states = pd.DataFrame([state(0.0, 0.0, level="reference")])
    assert error_table.summary(states) == []
    assert accuracy_study.references(states)[0]["force_percent"] == 0


def test_the_verb_writes_its_files_and_fails_on_a_broken_promise(monkeypatch, tmp_path, run):
    known = pd.DataFrame([state(0.031, 0.04), state(0, 0, status="unstable", message="!")])
    monkeypatch.setattr(
        accuracy_study, "run", lambda progress, quick=False, store=None: accuracy_study.result(known, quick=quick)
    )
    status, out, err = run("validate", "errors", "accuracy", "--out", tmp_path, "--json")
    assert status == FAILED
    assert "largest error: 3.1 %, goal at most 3 %" in err
    assert all(json.loads(line)["quantity"] for line in out.splitlines())
    report = (tmp_path / "ACCURACY.md").read_text("utf-8")
    assert "1 of 2 states compared" in report
    assert "unstable; !" in report
    assert (tmp_path / "errors.png").is_file()
    assert (tmp_path / "accuracy.csv").read_text("utf-8").count("\n") == 3


def rules(*states):
    return error_table.rules(pd.DataFrame(states))


def test_rules_that_cover_too_few_states_are_widened_and_carry_todays_versions(monkeypatch):
    monkeypatch.setattr(provenance, "commit", lambda: "abc")
    found, before = (
        {(row["scene"], row["variant"], row["quantity"]): row for row in rows}
        for rows in (rules(state(0.03, 0.02)), table_rows())
    )
    assert found.keys() == before.keys()
    wider = found["press", "any", "force"]
    assert float(wider["c"]) == pytest.approx(1.5 * float(before["press", "any", "force"]["c"]), rel=5e-3)
    assert (wider["version"], wider["commit"]) == (str(PHYSICS["axisymmetric"]), "abc")
    assert found["deep", "any", "force"] == before["deep", "any", "force"]
    kept = {(row["quantity"], row["c"]) for row in rules(state(0.01, 0.02)) if row["scene"] == "press"}
    assert kept == {(row["quantity"], row["c"]) for row in table_rows() if row["scene"] == "press"}
    unknown = [state(0.01, estimate) for estimate in (math.nan, 0.0)]
    assert rules(*unknown, state(0.03, 0.02)) == list(found.values())
    assert rules(*unknown) == table_rows()


@pytest.mark.parametrize(("other", "expected"), [("ok", "disagrees"), ("unstable", "unstable")])
def test_a_state_that_is_unstable_by_one_solve_only_disagrees(other, expected):
    assert status(other, "unstable", ("", ""))[0] == expected


# Statistics of the study of error estimates: shares and missed goals


def missed(states):
    """Names of the missed goals."""
    return [str(goal) for goal in goals.missed(error_table.goals(pd.DataFrame(states)))]


def test_shares_and_goals():
    safe = [state(0.010, 0.015) for _ in range(19)]
    assert missed([*safe, state(0.02, 0.015)]) == []
    unsafe = missed([*safe, state(0.02, 0.015), state(0.02, 0.015)])
    assert len(unsafe) == len(QUANTITIES)
    assert "at most the estimate: 90.5 %, goal at least 95 %" in unsafe[0]
    blunt = missed([state(0.001, 0.0031) for _ in range(20)])
    assert all("true error: 0 %, goal at least 50 %" in said for said in blunt)
    assert "largest error: 3.1 %, goal at most 3 %" in missed([state(0.031, 0.04)])[0]


def test_an_unknown_estimate_covers_nothing_and_states_without_a_comparison_miss_a_goal():
    half = missed([state(0.01, e) for e in (0.015, math.nan)] * 4)
    assert all("at most the estimate: 50 %" in said for said in half)
    for ended in ("crashed", "disagrees"):
        lost = missed([state(0.01, 0.015), state(0.0, 0.0, status=ended)])
        assert lost == ["states without a comparison: 1, goal at most 0"]
    assert not missed([state(0.01, 0.015), state(0.0, 0.0, status="unstable")])
    (lost,) = missed([state(0.0, 0.0, status="unstable")] * 9)
    assert lost == "states that are compared: 0 %, goal at least 50 %"


# The trials of critical depths, small shears and frequencies, as the accuracy study runs them


def analysed(scene):
    """The rows of the paper's sensor at level quick against a rough reference, load by load."""
    one = task(scene)._replace(reference=replace(ROUGH, name="reference", harmonics=2))
    return one, [tangent_rows(one, load) for load in one.trial.loads]


def test_the_study_judges_what_a_user_gets_of_critical_states_small_shears_and_frequencies():
    _, ((row,),) = analysed("critical")
    critical = stability.critical(paper(), accuracy=QUICK)
    assert row["status"] == "ok"
    # the loops may be compiled in the second of both solves only
    assert (row["depth"], row["force"]) == pytest.approx((critical.depth, critical.force), rel=1e-11)
    estimates = critical.estimates.depth, critical.estimates.force
    assert (row["depth_estimate"], row["force_estimate"]) == pytest.approx(estimates, rel=1e-7)
    assert row["depth_error"] == pytest.approx(abs(row["depth"] / row["reference_depth"] - 1))
    one, rows = analysed("small shear")
    assert [row["depth_mm"] for (row,) in rows] == [load.depth for load in one.trial.loads]
    (last,) = rows[-1]
    shear = small_shear.small_shear(paper(), last["depth_mm"], accuracy=QUICK)
    for name in ("stiffness", "shift", "tilt"):
        assert last[f"{name}_estimate"] == getattr(shear.estimates, name)
    one, (free, pressed) = analysed("modes")
    assert len(free) == len(pressed) == COUNT
    eight = modes.modes(paper(), count=COUNT, depth=one.trial.loads[1].depth, accuracy=QUICK)
    assert [row["frequency"] for row in pressed] == list(eight.frequency)
    assert [row["frequency_estimate"] for row in pressed] == list(eight.estimates)
    assert {errors["scene"] for errors in error_table.summary(pd.DataFrame(free))} == {"modes"}


def test_a_beam_that_does_not_give_way_is_listed():
    one = task("critical", number=5)
    # with its level as the reference, which is solved in a moment
    one = one._replace(reference=replace(one.level, name="reference"))
    (row,) = tangent_rows(one, one.trial.loads[0])
    assert row["status"] == "stable"
    assert error_table.summary(pd.DataFrame([row])) == []
