"""Scenes at the edge, at quick accuracy, and whether their judges tell wrong from right. All: `magtip validate
extremes`."""

import math
from dataclasses import replace

import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.solution import Facts
from fem.solve.inertia import Stability
from geometry.design import paper
from geometry.loads import Load
from studies.output.result import FAILED, GOOD
from studies.validation import robustness, robustness_checks
from studies.validation.robustness_checks import Case, press

SCENES = {scene.name: scene for scene in robustness.cases(quick=True)}
SLOW = {
    "L = D/2 + 0.05 mm: other model",
    "magnet 0.2 mm high to the largest",
    "depth 1e-9 mm, then 3 mm",
    "depth of 90 % of all silicone on the axis",
    "2 to 4.4 mm in one step or 12",
    "grip to 1.0 D, all silicone",
}
ELSEWHERE = {
    "E = 0.001 MPa",
    "E = 1000 MPa",
    "D = 1 mm, similar",
    "D = 50 mm, similar",
    "depth 1e-9 mm, all silicone",
}
SMALL = Case("small", press(0.98, 0.99, 1.0), robustness_checks.work, 2e-3, QUICK)


@pytest.fixture(scope="module")
def pressed():
    return solve(paper(), Load(depth=1.0), QUICK)


@pytest.mark.parametrize("name", [name for name in SCENES if name not in SLOW | ELSEWHERE])
def test_a_scene_ends_as_it_should(name):
    row = robustness.examine(SCENES[name])
    assert row["verdict"] == "pass", robustness.line(row)
    assert row["passed"]
    assert row["status"] in SCENES[name].ends
    assert row["measured"] <= row["bound"]


def test_names_are_unique_and_the_full_run_holds_all_of_the_quick_one():
    full = [scene.name for scene in robustness.cases()]
    assert len(set(full)) == len(full)
    assert set(SCENES) < set(full)
    assert set(SCENES) >= SLOW | ELSEWHERE


def test_a_wrong_force_fails_its_scene(monkeypatch):
    def wrong(*arguments, **options):
        return [replace(s, energy=1.01 * s.energy) for s in trace(*arguments, **options)]

    trace = robustness_checks.trace
    monkeypatch.setattr(robustness_checks, "trace", wrong)
    row = robustness.examine(SMALL)
    assert not row["passed"]
    assert row["measured"] == pytest.approx(0.01, rel=0.1)


def off_by_a_percent(_, states):
    return robustness_checks.Measurement(states[-1], "a force", 0.01, 1e-3)


def ended(monkeypatch, *ends):
    """The row of a scene whose path ends so; of several, those on ever other meshes."""
    scene = replace(SMALL, measure=off_by_a_percent)
    states = iter(ends)
    monkeypatch.setattr(robustness_checks, "path", lambda _: [next(states)])
    return robustness.examine(replace(scene, ends=("ok", "unstable")))


def test_beyond_an_onset_the_onset_is_measured_on_a_finer_mesh(pressed, monkeypatch):
    def unstable(low, high):
        return replace(pressed, status="unstable", facts=Facts("", Stability(1), "depth", (low, high)))

    near = ended(monkeypatch, unstable(0.8, 0.9), unstable(0.7, 0.75))
    assert (near["verdict"], near["measured"], near["bound"]) == (
        "pass",
        pytest.approx(0.05 / 0.9),
        robustness_checks.ONSET,
    )
    assert "a force 0.01, at most 0.001" in near["check"]
    far = ended(monkeypatch, unstable(0.8, 0.9), unstable(0.5, 0.6))
    assert (far["verdict"], far["measured"]) == ("fail", pytest.approx(0.2 / 0.9))


def test_an_onset_that_a_finer_mesh_does_not_have_fails(pressed, monkeypatch):
    unstable = replace(pressed, status="unstable", facts=Facts("", Stability(1), "depth", (0.8, 0.9)))
    row = ended(monkeypatch, unstable, pressed)
    assert (row["verdict"], row["measured"]) == ("fail", math.inf)


def test_what_could_not_be_measured_is_neither_pass_nor_fail(pressed, monkeypatch):
    """The path on the finer mesh stops before the onset."""
    unstable = replace(pressed, status="unstable", facts=Facts("", Stability(1), "depth", (0.8, 0.9)))
    early = replace(pressed, status="not_converged", load=Load(depth=0.5), facts=Facts("no_convergence"))
    row = ended(monkeypatch, unstable, early)
    assert (row["verdict"], row["passed"]) == ("not judged", False)
    assert math.isnan(row["measured"])
    assert robustness.line(row).startswith("not judged  small")


def test_a_comparison_that_stops_judges_nothing():
    def compare(scene, states):
        return robustness_checks.Measurement(
            states[-1], "force", robustness_checks.follow(scene, press(8.9), magnet="ignored")[-1].energy
        )

    row = robustness.examine(replace(SMALL, measure=compare))
    assert (row["status"], row["verdict"], row["passed"]) == ("ok", "not judged", False)
    assert row["check"].startswith("no comparison: the other solve stopped at depth")


def test_a_status_that_is_not_in_the_scenes_own_list_fails_whatever_its_message_says(pressed, monkeypatch):
    """What was measured is right, and the message names the depth of the onset: still no end of this scene."""
    said = "unstable since a depth between 0.8 and 0.9 mm"
    state = replace(pressed, status="unstable", message=said, facts=Facts("", Stability(1), "depth", (0.8, 0.9)))
    monkeypatch.setattr(robustness_checks, "path", lambda _: [state])
    row = robustness.examine(
        replace(SMALL, measure=lambda _, states: robustness_checks.Measurement(states[-1], "a force", 0.0))
    )
    assert (row["status"], row["verdict"], row["passed"]) == ("unstable", "fail", False)
    assert row["measured"] == 0


def test_wrong_ends_are_rows_that_fail():
    def crash(*_):
        raise ZeroDivisionError("division by zero")

    crashed = robustness.examine(replace(SMALL, measure=crash))
    assert (crashed["status"], crashed["passed"]) == ("crashed", False)
    assert "division" in crashed["message"]
    refused = robustness.examine(replace(SMALL, changes={"L": 3.0}))
    assert (refused["status"], refused["passed"]) == ("bad_input", False)
    short = robustness.examine(replace(SMALL, loads=press(1.0, 8.9), magnet="ignored"))
    assert (short["status"], short["verdict"]) == ("not_converged", "fail")
    unexpected = robustness.examine(replace(SMALL, ends=("not_converged",)))
    assert (unexpected["status"], unexpected["passed"]) == ("ok", False)


def test_the_command_prints_a_row_per_scene_and_writes_the_table(run, strict, monkeypatch, tmp_path):
    small = [SMALL, replace(SMALL, name="refused", changes={"L": 3.0}, ends=("bad_input",))]
    monkeypatch.setattr(robustness, "cases", lambda quick: small)
    status, out, err = run("validate", "extremes", "--quick", "--json", "--out", tmp_path)
    rows = strict(out)
    assert (status, err) == (GOOD, "")
    assert [row["scene"] for row in rows] == ["small", "refused"]
    assert rows[0]["measured"] <= rows[0]["bound"]
    assert (tmp_path / "extremes.csv").read_text("utf-8").count("\n") == 3
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "2 of 2 cases pass, 0 fail, 0 are not judged" in report
    assert f"Made with `magtip validate extremes --quick --out {tmp_path}`" in report


def test_a_failed_scene_is_status_three(run, monkeypatch):
    monkeypatch.setattr(robustness, "cases", lambda quick: [replace(SMALL, bound=1e-12)])
    status, out, err = run("validate", "extremes")
    assert status == FAILED
    assert out.startswith("FAIL  small")
    assert "1 of 1 cases fail: small" in err


def test_a_scene_that_is_not_judged_is_counted_apart_and_is_no_success(run, monkeypatch, tmp_path):
    def unmeasured(_, states):
        return robustness_checks.Measurement(states[-1], "nothing to compare with", None)

    both = [SMALL, replace(SMALL, name="open", measure=unmeasured)]
    monkeypatch.setattr(robustness, "cases", lambda quick: both)
    status, out, err = run("validate", "extremes", "--out", tmp_path)
    assert status == FAILED
    assert "not judged  open" in out
    assert "1 of 2 cases yield no measurement: open" in err
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "1 of 2 cases pass, 0 fail, 1 is not judged" in report
    assert "| **not judged** |" in report
    verdicts = [line.split(",")[1] for line in (tmp_path / "extremes.csv").read_text("utf-8").splitlines()]
    assert verdicts == ["verdict", "pass", "not judged"]
