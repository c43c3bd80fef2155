"""The study of error estimates at reduced size, and whether its statistics tell kept promises from broken ones."""

import json
import math
from dataclasses import replace

import pytest

from fem import equilibrium
from fem.accuracy import LEVELS, QUICK
from fem.analyses import modes, small_shear, stability
from fem.physics_version import PHYSICS
from fem.results.error_estimates import table_rows
from geometry.design import paper
from studies.cli import entry_point
from studies.output import checkpoint, goals
from studies.output.atomic_files import json_line
from studies.output.result import FAILED
from studies.validation import accuracy_study, error_study, error_study_cases
from studies.validation.error_study import QUANTITIES, ROLES, TANGENTS, SolvedState, Task, restored, without_errors


@pytest.fixture(scope="module")
def press():
    return Task(error_study_cases.trial(0, "rigid", "press", "auto"), QUICK)


@pytest.fixture(scope="module")
def known(press):
    return {error_study.key(*solve): error_study.follow(*solve) for solve in press.solves.values()}


def state(true, estimate, **changes):
    """A state whose quantities all have the same true error and estimate."""
    place = {"design": 0, "odd": False, "magnet": "rigid", "level": "quick", "scene": "press", "path": "press"}
    place |= {"model": "axisymmetric", "repeat": 0, "depth_mm": 1.0, "shear_mm": 0.0, "status": "ok", "message": ""}
    errors = {f"{name}_error": true for name in QUANTITIES} | {f"{name}_estimate": estimate for name in QUANTITIES}
    return place | errors | {"commit": ""} | changes


def test_there_are_twelve_designs_and_half_of_them_are_odd():
    designs = error_study_cases.designs()
    assert len(set(designs)) == 12
    assert designs[0] == paper()
    assert sum(error_study_cases.trial(n, "rigid", "press", "auto").odd for n in range(12)) == 6
    assert min(d.nu for d in designs) < 0.47
    assert max(d.nu for d in designs) > 0.4999


@pytest.mark.parametrize("scene", ["press", "stick", "friction", "grip"])
@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_loads_leave_room_for_the_magnet(scene, magnet):
    for n, design in enumerate(error_study_cases.designs()):
        above = design.R - design.magnet_height / 2 if magnet == "rigid" else design.L
        loads = error_study_cases.trial(n, magnet, scene, "auto").loads
        assert all(load.depth <= 0.3001 * above for load in loads)


@pytest.mark.parametrize("magnet", ["rigid", "ignored"])
def test_deep_presses_begin_beyond_the_others_and_leave_silicone(magnet):
    for n, design in enumerate(error_study_cases.designs()):
        press, deep = (error_study_cases.trial(n, magnet, scene, "auto").loads for scene in ("press", "deep"))
        assert deep[0].depth > press[-1].depth
        assert deep[-1].depth <= 0.4501 * (design.L - design.magnet_height * (magnet == "rigid"))


def test_friction_depends_on_the_length_of_steps_and_nothing_else_does():
    for scene, same in (("friction", False), ("stick", True)):
        trial = error_study_cases.trial(0, "rigid", scene, "auto")
        keys = {
            error_study.key(trial, replace(QUICK, friction_step_factor=friction_step_factor))
            for friction_step_factor in (1.0, 0.5)
        }
        assert (len(keys) == 1) is same


def test_rules_and_levels_may_change_without_new_solves():
    """Their modules are no part of the digest: they would be if one of the paths were wrong."""
    apart = (*error_study.ESTIMATING, *error_study.TANGENT_MODULES)
    kept = checkpoint.modules("geometry", "fem", apart=apart)
    assert len(kept) == len(checkpoint.modules("geometry", "fem")) - len(apart)
    assert error_study.code() == checkpoint.digest(kept)


def test_the_study_judges_the_estimates_that_a_user_gets(press, known):
    states = error_study.states_of(press, known)
    solutions = equilibrium.trace(press.trial.design, press.trial.loads, QUICK)
    for one, solution in zip(states, solutions, strict=True):
        assert one["status"] == "ok"
        assert one["force_estimate"] == pytest.approx(solution.estimates.force, rel=1e-9)
        assert one["shift_estimate"] == pytest.approx(solution.estimates.shift, rel=1e-9)
        assert one["force_z_N"] == pytest.approx(solution.response.force[2], rel=1e-9)


def test_quick_presses_of_the_paper_keep_their_promise(press, known):
    for one in error_study.states_of(press, known):
        for name in ("force", "shift"):
            assert one[f"{name}_error"] <= min(one[f"{name}_estimate"], 0.03)


def test_the_true_error_is_that_to_the_reference(press, known):
    last = error_study.states_of(press, known)[-1]
    off = abs(last["force_z_N"] / last["reference_force_z_N"] - 1)
    assert last["force_error"] == pytest.approx(off, rel=1e-6)
    assert last["reference_dofs"] > 10 * last["dofs"]
    assert math.isnan(last["tilt_error"])


def test_a_state_that_was_not_reached_is_listed_and_left_out(press, known):
    name = error_study.key(*press.solves["companion_"])
    lost = replace(known[name][1], status="not_converged", message="stopped at depth 0.3 mm")
    states = error_study.states_of(press, known | {name: [known[name][0], lost]})
    assert [one["status"] for one in states] == ["ok", "not_converged", "not_converged"]
    assert {errors["states"] for errors in accuracy_study.summary(states)} == {1}
    assert states[1]["message"] == "coarser level: stopped at depth 0.3 mm"


def test_a_kept_state_is_read_back(press, known):
    for one in known[error_study.key(*press.solves[""])]:
        assert restored("press", json.loads(json_line(one.kept()))) == one
    crashed = SolvedState("crashed", "RuntimeError: no mesh")
    assert restored("press", crashed.kept()) == crashed


def test_a_stopped_study_goes_on_where_it_was(press, known, monkeypatch, tmp_path):
    monkeypatch.setattr(error_study, "tasks", lambda quick: [press])
    monkeypatch.setattr(error_study, "follow", lambda trial, level: known[error_study.key(trial, level)])
    states = error_study.run(lambda *_: None, folder=tmp_path)
    store = tmp_path / "solves.jsonl"
    lines = store.read_text("utf-8").splitlines()
    other = json.dumps(json.loads(lines[1]) | {"code": "older"})
    store.write_text("\n".join([lines[0], other, lines[2][:40]]) + "\n", "utf-8")
    again = []
    monkeypatch.setattr(
        error_study, "follow", lambda trial, level: again.append(level.name) or known[error_study.key(trial, level)]
    )
    assert list(map(str, error_study.run(lambda *_: None, folder=tmp_path))) == list(map(str, states))
    assert again == ["quick", "reference"]


def test_a_crash_is_a_finding(press, monkeypatch):
    def fail(*args, **options):
        raise RuntimeError("the section's outline could not be meshed")

    monkeypatch.setattr(equilibrium, "walk", fail)
    assert error_study.follow(press.trial, QUICK)[0].status == "crashed"


def test_the_full_study_covers_all_levels_scenes_and_models():
    made = error_study.tasks()
    assert {task.level.name for task in made} == {*LEVELS, "reference"}
    for scene in ("press", "stick", "grip"):
        assert {(t.trial.number, t.trial.magnet) for t in made if t.trial.scene == scene} == {
            (n, magnet) for n in range(12) for magnet in ("rigid", "ignored")
        }
    assert {(t.trial.scene, t.repeat) for t in made if t.trial.model == "half"} == {
        (scene, i) for scene in ("press", "stick") for i in range(3)
    }
    solves = {error_study.key(*t.solves[""]) for t in made if t.trial.model == "half"}
    assert len(solves) == sum(t.trial.model == "half" for t in made)


def test_the_reference_is_held_against_a_finer_one():
    checked = [task for task in error_study.tasks() if task.level.name == "reference"]
    assert {task.trial.scene for task in checked} == {"press", "stick"}
    for task in checked:
        (_, used), (_, finer) = task.solves[""], task.solves["reference_"]
        assert finer.section_size < used.section_size
        assert finer.section_patch <= used.section_patch
    checked_state = state(0.0, 0.0, level="reference")
    assert accuracy_study.summary([checked_state]) == []
    assert accuracy_study.references([checked_state])[0]["force_percent"] == 0


def test_the_verb_writes_its_files_and_fails_on_a_broken_promise(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(
        error_study, "run", lambda *_, **__: [state(0.031, 0.04), state(0, 0, status="unstable", message="!")]
    )
    assert entry_point.main(["validate", "accuracy", "--out", str(tmp_path), "--json"]) == FAILED
    said = capsys.readouterr()
    assert "largest error: 3.1 %, goal at most 3 %" in said.err
    assert all(json.loads(line)["quantity"] for line in said.out.splitlines())
    report = (tmp_path / "ACCURACY.md").read_text("utf-8")
    assert "1 of 2 states compared" in report
    assert "unstable; !" in report
    assert (tmp_path / "errors.png").stat().st_size > 10_000
    assert (tmp_path / "accuracy.csv").read_text("utf-8").count("\n") == 3


def test_rules_that_cover_too_few_states_are_widened_and_carry_todays_versions():
    found, before = (
        {(row["scene"], row["variant"], row["quantity"]): row for row in rows}
        for rows in (accuracy_study.rules([state(0.03, 0.02, commit="abc")]), table_rows())
    )
    assert found.keys() == before.keys()
    wider = found["press", "rigid", "force"]
    assert float(wider["c"]) == pytest.approx(1.5 * float(before["press", "rigid", "force"]["c"]), rel=5e-3)
    assert (wider["version"], wider["commit"]) == (str(PHYSICS["axisymmetric"]), "abc")
    assert found["deep", "rigid", "force"] == before["deep", "rigid", "force"]
    kept = {
        (row["quantity"], row["c"]) for row in accuracy_study.rules([state(0.01, 0.02)]) if row["scene"] == "press"
    }
    assert kept == {(row["quantity"], row["c"]) for row in table_rows() if row["scene"] == "press"}
    unknown = [state(0.01, estimate) for estimate in (math.nan, 0.0)]
    assert accuracy_study.rules([*unknown, state(0.03, 0.02, commit="abc")]) == list(found.values())
    assert accuracy_study.rules(unknown) == table_rows()


def test_no_comparison_is_no_success(tmp_path, capsys):
    assert entry_point.main(["validate", "accuracy", "--quick", "--minutes", "0", "--out", str(tmp_path)]) == FAILED
    assert "states without a comparison: 17, goal at most 0" in capsys.readouterr().err
    assert "All goals are met" not in (tmp_path / "ACCURACY.md").read_text("utf-8")


def test_a_state_that_is_unstable_by_one_solve_only_disagrees(press):
    ok, unstable = SolvedState("ok", ""), SolvedState("unstable", "since 1 mm")
    for solves, status in (((ok, ok, unstable), "disagrees"), ((unstable,) * 3, "unstable")):
        states = dict(zip(ROLES, solves, strict=True))
        assert without_errors(press.trial, QUICK, press.trial.loads[0], states)["status"] == status


# Statistics of the study of error estimates: shares, missed goals and mesh noise


def solve(force_z=0.0, shift_z=0.0):
    """An answer of the half model to a press."""
    return {"force_x_N": 0.0, "force_z_N": force_z, "shift_x_mm": 0.0, "shift_z_mm": shift_z, "tilt_rad": 0.0}


def missed(states):
    """Names of the missed goals."""
    return [str(goal) for goal in goals.missed(accuracy_study.goals(states))]


def test_shares_and_goals():
    safe = [state(0.010, 0.015) for _ in range(19)]
    assert missed([*safe, state(0.02, 0.015)]) == []
    unsafe = missed([*safe, state(0.02, 0.015), state(0.02, 0.015)])
    assert len(unsafe) == len(QUANTITIES)
    assert "at most the estimate: 90.5 %, goal at least 95 %" in unsafe[0]
    blunt = missed([state(0.001, 0.0031) for _ in range(20)])
    assert all("true error: 0 %, goal at least 50 %" in said for said in blunt)
    assert "largest error: 3.1 %, goal at most 3 %" in missed([state(0.031, 0.04)])[0]


def test_an_unknown_estimate_covers_nothing():
    assert all(
        "at most the estimate: 50 %" in said for said in missed([state(0.01, e) for e in (0.015, math.nan)] * 4)
    )


def test_states_without_a_comparison_miss_a_goal():
    for status in ("not_run", "crashed", "disagrees"):
        lost = missed([state(0.01, 0.015), state(0.0, 0.0, status=status)])
        assert lost == ["states without a comparison: 1, goal at most 0"]
    assert not missed([state(0.01, 0.015), state(0.0, 0.0, status="unstable")])


def test_a_large_error_stays_in_the_statistics():
    assert accuracy_study.summary([state(0.4, 0.015)])[0]["max_percent"] == pytest.approx(40)


def test_mesh_noise_is_the_spread_over_meshes():
    half = [state(0.01, 0.02, model="half", scene="pressed", **solve(f, -1.0)) for f in (0.99, 1.0, 1.01)]
    (force, shift) = accuracy_study.noise(half)
    assert force["mean_percent"] == pytest.approx(1.0)
    assert shift["mean_percent"] == 0.0


def test_depths_of_a_press_are_no_noise():
    """Nor is the tilt that tetrahedra have where there should be none."""
    half = [state(0.01, 0.02, model="half", depth_mm=d, **solve(d, -d)) for d in (1.0, 2.0) for _ in "ab"]
    noise = accuracy_study.noise(half)
    assert [(one["quantity"], one["states"], one["max_percent"]) for one in noise] == [
        ("force", 2, 0.0),
        ("shift", 2, 0.0),
    ]


# The trials of critical depths, small shears and frequencies, as the accuracy study runs them


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
