"""Scenes at the edge, at quick accuracy, and whether their judges tell wrong from right. All: `magtip extremes`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fem.equilibrium import solve
from fem.levels import QUICK
from geometry.design import LEAST_WALL, BadInput, Design, paper
from geometry.scene import Load
from studies import extremes, judges
from studies.judges import Scene, press
from studies.options import FAILED, GOOD

SCENES = {scene.name: scene for scene in extremes.scenes(quick=True)}
SLOW = {
    "L = D/2 + 0.05 mm: other model",
    "magnet 0.2 mm high to the largest",
    "depth 1e-9 mm, then 3 mm",
    "to the last tenth on the axis",
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
SMALL = Scene("small", press(0.98, 0.99, 1.0), judges.work, 2e-3, QUICK)


@pytest.fixture(scope="module")
def pressed():
    return solve(paper(), Load(depth=1.0), QUICK)


@pytest.mark.parametrize("name", [name for name in SCENES if name not in SLOW | ELSEWHERE])
def test_a_scene_ends_as_it_should(name):
    row = extremes.judge(SCENES[name])
    assert row["passed"], extremes.line(row)


def test_larger_magnets_take_larger_forces():
    finding = judges.ordered("magnet_height", (0.2, 3.0))(replace(SMALL, loads=press(1.0)))
    assert 0.5 < finding.measured < 1
    assert judges.ordered("magnet_height", (3.0, 0.2))(replace(SMALL, loads=press(1.0))).measured > 1


def test_names_are_unique_and_the_full_run_holds_all_of_the_quick_one():
    full = [scene.name for scene in extremes.scenes()]
    assert len(set(full)) == len(full)
    assert set(SCENES) < set(full)
    assert set(SCENES) >= SLOW | ELSEWHERE


def test_samples_are_the_same_in_every_run_and_can_be_made():
    for one, other in zip(extremes.scenes(), extremes.scenes(), strict=True):
        assert (one.name, one.changes, one.loads) == (other.name, other.changes, other.loads)
        if one.name.startswith("sample"):
            assert 0 < one.loads[-1].depth < one.design.L - one.design.magnet_height


@pytest.mark.parametrize("changes", [{}, {"D": 20.0, "L": 12.0}, {"D": 1.0, "L": 2.0, "magnet_diameter": 0.5}])
def test_the_largest_magnet_is_the_largest(changes):
    height = judges.largest_height(changes)
    design = Design(**changes, magnet_height=height, l0=20.0)
    assert design.shape.wall == pytest.approx(LEAST_WALL, abs=1e-6)
    with pytest.raises(BadInput, match="wall"):
        replace(design, magnet_height=height * 1.001)
    assert judges.largest_height({"L": 4.05}) == 0


def test_simpson_integrates_cubics():
    ways = np.linspace(1, 3, 5)
    assert judges.simpson(ways, ways**3) == pytest.approx(20, rel=1e-14)


def test_silicone_inside_out_is_seen(pressed):
    assert judges.folded_share(pressed) == 0
    z = pressed.field.mesh.doflocs[1]
    mirrored = np.stack([0 * z, -2 * z], axis=1)
    assert judges.folded_share(replace(pressed, field=replace(pressed.field, u=mirrored))) == pytest.approx(1)


@pytest.mark.parametrize("message", ["", "1e-07 of the silicone is inside out"])
def test_silicone_inside_out_that_is_not_told_fails_its_scene(monkeypatch, message):
    deep = replace(solve(paper(), Load(depth=3.6), QUICK), message=message)
    monkeypatch.setattr(judges, "follow", lambda _: [deep])
    assert judges.folded(SMALL).measured > 0


def test_a_wrong_force_fails_its_scene(monkeypatch):
    def wrong(*arguments, **options):
        return [replace(s, energy=1.01 * s.energy) for s in trace(*arguments, **options)]

    trace = judges.trace
    monkeypatch.setattr(judges, "trace", wrong)
    row = extremes.judge(SMALL)
    assert not row["passed"]
    assert row["measured"] == pytest.approx(0.01, rel=0.1)


def test_a_state_that_is_not_what_a_fresh_solve_gives_fails(pressed):
    stop = replace(pressed, status="not_converged", message="stopped at depth 1 mm: no convergence")
    scene = replace(SMALL, loads=press(2.0))
    assert judges.stopped(scene, stop).measured < 1e-9
    assert judges.stopped(scene, replace(stop, energy=1.001 * stop.energy)).measured == pytest.approx(1e-3, rel=0.01)
    assert judges.stopped(scene, replace(stop, message="no convergence")).measured == math.inf


def test_what_was_judged_is_what_is_printed(pressed):
    said = "stopped at depth 1 mm: no convergence; unstable since a depth between 0.8 and 0.9 mm"
    state = replace(pressed, status="not_converged", message=said)
    finding = judges.Finding(state, "last good state against a fresh solve to it", 0.01, 1e-6)
    row = extremes._row(SMALL, finding, state.status, said, 1.0)
    assert row["passed"]
    assert math.isnan(row["measured"])
    assert "the message names the depth of the onset (last good state" in extremes.line(row)
    assert "at most" not in extremes.line(row)
    silent = extremes._row(SMALL, finding, state.status, "stopped at depth 1 mm", 1.0)
    assert not silent["passed"]
    assert "0.01, at most 1e-06" in extremes.line(silent)


def test_a_tip_that_gives_way_must_hold_less_energy(pressed):
    for factor in (0.5, 1.5):
        finding = judges.stopped(SMALL, replace(pressed, status="unstable", energy=factor * pressed.energy))
        assert (finding.measured, finding.bound) == (pytest.approx(factor), 1.0)


def test_a_zero_without_a_remedy_fails(pressed):
    silent = replace(pressed, status="no_contact", message="nothing")
    assert judges.stopped(SMALL, silent).measured == math.inf
    assert judges.stopped(SMALL, replace(silent, message="choose model axisymmetric")).measured == 0


def test_wrong_ends_are_rows_that_fail():
    def crash(_):
        raise ZeroDivisionError("division by zero")

    crashed = extremes.judge(replace(SMALL, judge=crash))
    assert (crashed["status"], crashed["passed"]) == ("crashed", False)
    assert "division" in crashed["message"]
    refused = extremes.judge(replace(SMALL, changes={"L": 3.0}))
    assert (refused["status"], refused["passed"]) == ("bad_input", False)
    short = extremes.judge(replace(SMALL, loads=press(1.0, 8.9), magnet="ignored"))
    assert short["status"] == "not_converged"
    assert short["passed"] == ("unstable since" in short["message"])
    unexpected = extremes.judge(replace(SMALL, ends=("not_converged",)))
    assert (unexpected["status"], unexpected["passed"]) == ("ok", False)


def test_the_command_prints_a_row_per_scene_and_writes_the_table(run, strict, monkeypatch, tmp_path):
    small = [SMALL, replace(SMALL, name="refused", changes={"L": 3.0}, ends=("bad_input",))]
    monkeypatch.setattr(extremes, "scenes", lambda quick: small)
    status, out, err = run("extremes", "--quick", "--json", "--out", tmp_path)
    rows = strict(out)
    assert (status, err) == (GOOD, "")
    assert [row["scene"] for row in rows] == ["small", "refused"]
    assert rows[0]["measured"] <= rows[0]["bound"]
    assert (tmp_path / "extremes.csv").read_text("utf-8").count("\n") == 3
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "2 of 2 scenes" in report
    assert "`magtip extremes --quick`" in report


def test_a_failed_scene_is_status_three(run, monkeypatch):
    monkeypatch.setattr(extremes, "scenes", lambda quick: [replace(SMALL, bound=1e-12)])
    status, out, err = run("extremes")
    assert status == FAILED
    assert out.startswith("FAIL  small")
    assert "1 of 1 scenes end wrongly: small" in err
