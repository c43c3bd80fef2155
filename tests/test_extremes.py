"""Scenes at the edge, at quick accuracy, and whether their judges tell wrong from right. All: `magtip validate
extremes`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.solution import Facts
from fem.solve import load_increments
from fem.solve.direct_solver import Stability
from geometry.design import LEAST_WALL, BadInput, Design, paper
from geometry.loads import Load
from studies.output.result import FAILED, GOOD, Interrupted
from studies.validation import extremes
from studies.validation.extremes import Case, Measurement, press

SCENES = {scene.name: scene for scene in extremes.cases(quick=True)}
SLOW = {
    "magnet 6.3 mm high",
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
ROUGH = {"magnet 6.782 mm high, the largest": 0.25, "depth 0.9 L, all silicone": 0.5}
"""Scenes of many small increments, and edge lengths over D with which they end as at level quick."""
SMALL = Case("small", press(0.98, 0.99, 1.0), extremes.work, 2e-3, QUICK)


@pytest.fixture(scope="module")
def pressed():
    return solve(paper(), Load(depth=1.0), QUICK)


@pytest.mark.parametrize("name", [name for name in SCENES if name not in SLOW | ELSEWHERE])
def test_a_scene_ends_as_it_should(name):
    accuracy = replace(QUICK, section_size=ROUGH.get(name, QUICK.section_size))
    row = extremes.examine(replace(SCENES[name], accuracy=accuracy))
    assert row["verdict"] == "pass", extremes.line(row)
    assert row["passed"]
    assert row["status"] in SCENES[name].ends
    assert row["measured"] <= row["bound"]


def test_names_are_unique_and_the_full_run_holds_all_of_the_quick_one():
    full = [scene.name for scene in extremes.cases()]
    assert len(set(full)) == len(full)
    assert set(SCENES) < set(full)
    assert set(SCENES) >= SLOW | ELSEWHERE


def test_a_wrong_force_fails_its_scene(monkeypatch):
    def wrong(*arguments, **options):
        return [replace(s, energy=1.01 * s.energy) for s in trace(*arguments, **options)]

    trace = extremes.trace
    monkeypatch.setattr(extremes, "trace", wrong)
    row = extremes.examine(SMALL)
    assert not row["passed"]
    assert row["measured"] == pytest.approx(0.01, rel=0.1)


def off_by_a_percent(_, states):
    return Measurement("a force", 0.01, 1e-3)


def ended(monkeypatch, *ends):
    """The row of a scene whose path ends so; of several, those on ever other meshes."""
    scene = replace(SMALL, measure=off_by_a_percent)
    states = iter(ends)
    monkeypatch.setattr(extremes, "path", lambda _: [next(states)])
    return extremes.examine(replace(scene, ends=("ok", "unstable")))


def test_beyond_an_onset_the_onset_is_measured_on_a_finer_mesh(pressed, monkeypatch):
    def unstable(low, high):
        return replace(pressed, facts=Facts("", Stability(1), "depth", (low, high)))

    near = ended(monkeypatch, unstable(0.8, 0.9), unstable(0.7, 0.75))
    assert (near["verdict"], near["measured"], near["bound"]) == (
        "pass",
        pytest.approx(0.05 / 0.9),
        extremes.ONSET,
    )
    assert "a force 0.01, at most 0.001" in near["check"]
    far = ended(monkeypatch, unstable(0.8, 0.9), unstable(0.5, 0.6))
    assert (far["verdict"], far["measured"]) == ("fail", pytest.approx(0.2 / 0.9))


def test_an_onset_that_a_finer_mesh_does_not_have_fails(pressed, monkeypatch):
    unstable = replace(pressed, facts=Facts("", Stability(1), "depth", (0.8, 0.9)))
    row = ended(monkeypatch, unstable, pressed)
    assert (row["verdict"], row["measured"]) == ("fail", math.inf)


def test_what_could_not_be_measured_is_neither_pass_nor_fail(pressed, monkeypatch):
    """The path on the finer mesh stops before the onset."""
    unstable = replace(pressed, facts=Facts("", Stability(1), "depth", (0.8, 0.9)))
    early = replace(pressed, load=Load(depth=0.5), facts=Facts("no_convergence"))
    row = ended(monkeypatch, unstable, early)
    assert (row["verdict"], row["passed"]) == ("not judged", False)
    assert math.isnan(row["measured"])
    assert extremes.line(row).startswith("not judged  small")


@pytest.fixture
def impatient(monkeypatch):
    """Paths end where an increment of a tenth of D fails."""
    monkeypatch.setattr(load_increments, "SHORTEST", 0.1)


def test_a_comparison_that_stops_judges_nothing(impatient):
    def compare(scene, states):
        return Measurement("force", extremes.follow(scene, press(8.9), magnet="ignored").energy)

    row = extremes.examine(replace(SMALL, measure=compare))
    assert (row["status"], row["verdict"], row["passed"]) == ("ok", "not judged", False)
    assert row["check"].startswith("no comparison: the other solve stopped at depth")


def test_a_status_that_is_not_in_the_scenes_own_list_fails_whatever_its_message_says(pressed, monkeypatch):
    """What was measured is right, and the message names the depth of the onset: still no end of this scene."""
    said = "unstable since a depth between 0.8 and 0.9 mm"
    state = replace(pressed, message=said, facts=Facts("", Stability(1), "depth", (0.8, 0.9)))
    monkeypatch.setattr(extremes, "path", lambda _: [state])
    row = extremes.examine(replace(SMALL, measure=lambda _, states: Measurement("a force", 0.0)))
    assert (row["status"], row["verdict"], row["passed"]) == ("unstable", "fail", False)
    assert row["measured"] == 0


def test_wrong_ends_are_rows_that_fail(impatient):
    def crash(*_):
        raise ZeroDivisionError("division by zero")

    crashed = extremes.examine(replace(SMALL, measure=crash))
    assert (crashed["status"], crashed["passed"]) == ("crashed", False)
    assert "division" in crashed["message"]
    refused = extremes.examine(replace(SMALL, changes={"L": 3.0}))
    assert (refused["status"], refused["passed"]) == ("bad_input", False)
    short = extremes.examine(replace(SMALL, loads=press(1.0, 8.9), magnet="ignored"))
    assert (short["status"], short["verdict"]) == ("not_converged", "fail")
    unexpected = extremes.examine(replace(SMALL, ends=("not_converged",)))
    assert (unexpected["status"], unexpected["passed"]) == ("ok", False)


def test_the_command_prints_a_row_per_scene_and_writes_the_table(run, strict, monkeypatch, tmp_path):
    small = [SMALL, replace(SMALL, name="refused", changes={"L": 3.0}, ends=("bad_input",))]
    monkeypatch.setattr(extremes, "cases", lambda quick: small)
    status, out, err = run("validate", "extremes", "--quick", "--json", "--out", tmp_path)
    rows = strict(out)
    assert (status, err) == (GOOD, "")
    assert [row["scene"] for row in rows] == ["small", "refused"]
    assert rows[0]["measured"] <= rows[0]["bound"]
    assert (tmp_path / "extremes.csv").read_text("utf-8").count("\n") == 3
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "2 of 2 cases pass, 0 fail, 0 are not judged" in report
    assert f"Made with `magtip validate extremes --quick --out {tmp_path}`" in report


def test_a_scene_that_is_not_judged_is_counted_apart_and_is_no_success(run, monkeypatch, tmp_path):
    def unmeasured(_, states):
        return Measurement("nothing to compare with")

    all_three = [SMALL, replace(SMALL, name="open", measure=unmeasured), replace(SMALL, name="off", bound=1e-12)]
    monkeypatch.setattr(extremes, "cases", lambda quick: all_three)
    status, out, err = run("validate", "extremes", "--out", tmp_path)
    assert status == FAILED
    assert "not judged  open" in out
    assert "FAIL  off" in out
    assert "1 of 3 cases yield no measurement: open" in err
    assert "1 of 3 cases fail: off" in err
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "1 of 3 cases pass, 1 fail, 1 is not judged" in report
    assert "| **not judged** |" in report
    verdicts = [line.split(",")[1] for line in (tmp_path / "extremes.csv").read_text("utf-8").splitlines()]
    assert verdicts == ["verdict", "pass", "not judged", "fail"]


# Checks: order of forces, largest magnet, Simpson's rule, inverted silicone


def test_larger_magnets_take_larger_forces(monkeypatch):
    for values, low, high in (((0.2,), 0.5, 1.0), ((4.0,), 1.0, 2.0)):
        monkeypatch.setattr(extremes, "HEIGHTS", values)
        scene = replace(SMALL, loads=press(1.0), changes={"magnet_height": 3.0})
        finding = extremes.ordered(scene, extremes.path(scene))
        assert low < finding.measured < high


@pytest.mark.parametrize("changes", [{}, {"D": 20.0, "L": 12.0}, {"D": 1.0, "L": 2.0, "magnet_diameter": 0.5}])
def test_the_largest_magnet_is_the_largest(changes):
    height = extremes.largest_height(changes)
    design = Design(**changes, magnet_height=height, l0=20.0)
    assert design.shape.wall == pytest.approx(LEAST_WALL, abs=1e-6)
    with pytest.raises(BadInput, match="silicone around it"):
        replace(design, magnet_height=height * 1.001)
    assert extremes.largest_height({"L": 4.05}) == 0


def test_inverted_silicone_is_measured(pressed):
    assert extremes.folded_share(pressed) == 0
    z = pressed.field.mesh.doflocs[1]
    mirrored = np.stack([0 * z, -2 * z], axis=1)
    assert extremes.folded_share(replace(pressed, field=replace(pressed.field, u=mirrored))) == pytest.approx(1)


@pytest.mark.parametrize("share", [0.0, 1e-7])
def test_inverted_silicone_that_the_state_does_not_report_fails_its_case(share):
    deep = solve(paper(), Load(depth=3.6), QUICK)
    assert extremes.folded(SMALL, [deep]).measured == 0
    silent = replace(deep, facts=replace(deep.facts, inverted_share=share))
    assert extremes.folded(SMALL, [silent]).measured > 0


# Cases that stop, become unstable or have no contact


def test_a_state_that_is_not_what_a_fresh_solve_gives_fails(pressed):
    stop = replace(pressed, facts=Facts("no_convergence"))
    scene = replace(SMALL, loads=press(2.0))
    assert extremes.stopped(scene, stop).measured < 1e-9
    assert extremes.stopped(scene, replace(stop, energy=1.001 * stop.energy)).measured == pytest.approx(
        1e-3, rel=0.01
    )


def test_a_tip_that_gives_way_must_hold_less_energy(pressed):
    for factor in (0.5, 1.5):
        finding = extremes.stopped(
            SMALL, replace(pressed, facts=Facts("", Stability(1)), energy=factor * pressed.energy)
        )
        assert (finding.measured, finding.bound) == (pytest.approx(factor), 1.0)


def test_the_model_that_no_contact_points_to_is_tried(pressed):
    far = Case("far", press(1e-9), extremes.work, 0.02, QUICK, magnet="ignored", ends=("no_contact",))
    silent = replace(pressed, load=Load(depth=1e-9), facts=Facts(remark="no_touch"))
    finding = extremes.stopped(far, silent)
    assert finding.measured < 0.02
    deep = extremes.stopped(far, replace(silent, load=Load(depth=1.0)))
    assert deep.measured > 0.02


def test_samples_are_the_same_in_every_run_and_can_be_made():
    for one, other in zip(extremes.cases(), extremes.cases(), strict=True):
        assert (one.name, one.changes, one.loads) == (other.name, other.changes, other.loads)
        if one.name.startswith("sample"):
            assert 0 < one.loads[-1].depth < one.design.L - one.design.magnet_height


def test_an_interruption_has_the_cases_that_are_complete(monkeypatch):
    def stop(case, states):
        raise KeyboardInterrupt

    monkeypatch.setattr(extremes, "cases", lambda quick: [SMALL, replace(SMALL, name="long", measure=stop)])
    with pytest.raises(Interrupted, match="1 rows are complete") as stopped:
        extremes.run(lambda share, text: None)
    assert [row["scene"] for row in stopped.value.result.records] == ["small"]
