"""Scenes at the edge, at quick accuracy, and whether their judges tell wrong from right. All: `magtip validate
extremes`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fem.accuracy import QUICK
from fem.equilibrium import solve
from fem.solution import Facts, Stability
from fem.solve import load_increments
from geometry.design import LEAST_WALL, BadInput, Design, paper
from geometry.loads import Load
from studies.output.result import FAILED, GOOD
from studies.validation.verify import extremes
from studies.validation.verify.extremes import Case, Measurement, press

SCENES = {scene.name: scene for scene in extremes.cases(quick=True)}
SLOW = {
    *("magnet 6.3 mm high", "magnet 6.782 mm high, the largest", "magnet 0.2 mm high to the largest"),
    *("L = D/2 + 0.05 mm: other model", "depth 1e-9 mm, then 3 mm", "depth of 90 % of all silicone on the axis"),
    *("2 to 4.4 mm in one step or 12", "grip to 1.0 D, all silicone"),
}
ELSEWHERE = {
    *("E = 0.001 MPa", "E = 1000 MPa", "D = 1 mm, similar", "D = 50 mm, similar"),
    *("nu = 0.3, depth 0.4 L", "nu = 0.49999, depth 0.4 L"),
}
"""Scenes that other tests hold, or others of their kind."""
ROUGH = {"depth 0.9 L, all silicone": 0.5}
"""A scene of many small increments, and the edge length over D with which it ends as at level quick."""
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


def test_names_are_unique_the_full_run_holds_the_quick_one_and_samples_can_be_made():
    full = extremes.cases()
    assert len({scene.name for scene in full}) == len(full)
    assert {scene.name for scene in full} > set(SCENES) >= SLOW | ELSEWHERE
    for one, other in zip(full, extremes.cases(), strict=True):
        assert (one.name, one.changes, one.loads) == (other.name, other.changes, other.loads)
        if one.name.startswith("sample"):
            assert 0 < one.loads[-1].depth < one.design.L - one.design.magnet_height


def test_a_wrong_force_fails_its_scene(monkeypatch):
    def wrong(*arguments, **options):
        return [replace(s, energy=1.01 * s.energy) for s in trace(*arguments, **options)]

    trace = extremes.trace
    monkeypatch.setattr(extremes, "trace", wrong)
    row = extremes.examine(SMALL)
    assert not row["passed"]
    assert row["measured"] == pytest.approx(0.01, rel=0.1)


def unstable(pressed, low=0.8, high=0.9, **changes):
    return replace(pressed, facts=Facts("", Stability(1), "depth", (low, high)), **changes)


def ended(monkeypatch, *ends):
    """The row of a scene whose path ends so; of several, those on ever other meshes."""
    scene = replace(SMALL, measure=lambda _, states: Measurement("a force", 0.01, 1e-3), ends=("ok", "unstable"))
    states = iter(ends)
    monkeypatch.setattr(extremes, "path", lambda _: [next(states)])
    return extremes.examine(scene)


def test_beyond_an_onset_the_onset_is_measured_on_a_finer_mesh(pressed, monkeypatch):
    near = ended(monkeypatch, unstable(pressed), unstable(pressed, 0.7, 0.75))
    assert (near["verdict"], near["bound"]) == ("pass", extremes.ONSET)
    assert near["measured"] == pytest.approx(0.05 / 0.9)
    assert "a force 0.01, at most 0.001" in near["check"]
    far = ended(monkeypatch, unstable(pressed), unstable(pressed, 0.5, 0.6))
    assert (far["verdict"], far["measured"]) == ("fail", pytest.approx(0.2 / 0.9))
    none = ended(monkeypatch, unstable(pressed), pressed)
    assert (none["verdict"], none["measured"]) == ("fail", math.inf)
    # the path on the finer mesh stops before the onset
    early = replace(pressed, load=Load(depth=0.5), facts=Facts("no_convergence"))
    row = ended(monkeypatch, unstable(pressed), early)
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
    state = unstable(pressed, message="unstable since a depth between 0.8 and 0.9 mm")
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


def test_the_command_prints_and_writes_a_row_per_scene_and_one_that_is_not_judged_is_no_success(
    run, strict, monkeypatch, tmp_path
):
    refused = replace(SMALL, name="refused", changes={"L": 3.0}, ends=("bad_input",))
    monkeypatch.setattr(extremes, "cases", lambda quick: [SMALL, refused])
    status, out, err = run("validate", "verify", "extremes", "--quick", "--json", "--out", tmp_path)
    rows = strict(out)
    assert (status, err, [row["scene"] for row in rows]) == (GOOD, "", ["small", "refused"])
    assert rows[0]["measured"] <= rows[0]["bound"]
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "2 of 2 cases pass, 0 fail, 0 are not judged" in report
    assert f"Made with `magtip validate verify extremes --quick --out {tmp_path}`" in report
    unmeasured = replace(SMALL, name="open", measure=lambda _, states: Measurement("nothing to compare with"))
    monkeypatch.setattr(extremes, "cases", lambda quick: [SMALL, unmeasured, replace(SMALL, name="off", bound=1e-12)])
    status, out, err = run("validate", "verify", "extremes", "--out", tmp_path)
    assert status == FAILED
    assert "not judged  open" in out
    assert "FAIL  off" in out
    assert "2 of 3 are missed: open; off" in err
    report = (tmp_path / "EXTREMES.md").read_text("utf-8")
    assert "1 of 3 cases pass, 1 fail, 1 is not judged" in report
    assert "| not judged |" in report
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
    z = pressed.body.mesh.doflocs[1]
    mirrored = np.stack([0 * z, -2 * z], axis=1)
    assert extremes.folded_share(replace(pressed, field=replace(pressed.body, u=mirrored))) == pytest.approx(1)


def test_inverted_silicone_that_the_state_does_not_report_fails_its_case():
    deep = solve(paper(), Load(depth=3.6), QUICK)
    assert extremes.folded(SMALL, [deep]).measured == 0
    for share in (0.0, 1e-7):
        silent = replace(deep, facts=replace(deep.facts, inverted_share=share))
        assert extremes.folded(SMALL, [silent]).measured > 0


# Cases that stop, become unstable or have no contact


def test_a_state_that_is_not_what_a_fresh_solve_gives_fails_and_a_tip_that_gives_way_must_hold_less_energy(pressed):
    stop, scene = replace(pressed, facts=Facts("no_convergence")), replace(SMALL, loads=press(2.0))
    assert extremes.stopped(scene, stop).measured < 1e-9
    off = extremes.stopped(scene, replace(stop, energy=1.001 * stop.energy)).measured
    assert off == pytest.approx(1e-3, rel=0.01)
    for factor in (0.5, 1.5):
        gave_way = replace(pressed, facts=Facts("", Stability(1)), energy=factor * pressed.energy)
        finding = extremes.stopped(SMALL, gave_way)
        assert (finding.measured, finding.bound) == (pytest.approx(factor), 1.0)


def test_the_model_that_no_contact_points_to_is_tried(pressed):
    far = Case("far", press(1e-9), extremes.work, 0.02, QUICK, magnet="ignored", ends=("no_contact",))
    silent = replace(pressed, load=Load(depth=1e-9), facts=Facts(remark="no_touch"))
    finding = extremes.stopped(far, silent)
    assert finding.measured < 0.02
    deep = extremes.stopped(far, replace(silent, load=Load(depth=1.0)))
    assert deep.measured > 0.02
