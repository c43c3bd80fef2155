"""Forces on the command line: the targets of options, the rows and files of states, sentences for what is refused."""

import json

import pytest

from fem.analyses.force_targets import ForceTarget
from geometry.loads import Load
from studies.inputs.option_groups import Motion
from studies.simulation import load_cases

QUICK = ("--magnet", "ignored", "--accuracy", "quick")
TARGET_KEYS = {"target_force_N", "target_shear_force_N"}
STICK = Load(friction="stick")


@pytest.mark.parametrize(
    ("options", "targets"),
    [
        ({"depth": 1.0}, []),
        ({"force": 5.0}, [ForceTarget(5.0)]),
        ({"force": 2.0, "steps": 2}, [ForceTarget(1.0), ForceTarget(2.0)]),
        ({"forces": "5,1"}, [ForceTarget(5.0), ForceTarget(1.0)]),
        ({"force": 5.0, "friction": "0.5"}, [ForceTarget(5.0, None, Load(friction=0.5))]),
        ({"force": 5.0, "shear_force": -1.0}, [ForceTarget(5.0, (-1.0, 0.0), STICK)]),
        (
            {"force": 5.0, "shear_force": 2.0, "shear_force_y": 1.0, "steps": 2},
            [ForceTarget(5.0, (1.0, 0.5), STICK), ForceTarget(5.0, (2.0, 1.0), STICK)],
        ),
    ],
)
def test_options_as_targets(options, targets):
    assert load_cases.targets_of(Motion(**options)) == targets


@pytest.fixture
def solve_keys(run, strict):
    """Keys of a press to a depth."""
    (state,) = strict(run("solve", "paper", "--depth", 0.1, "--json", *QUICK)[1])
    return set(state)


def test_states_have_all_keys_and_those_of_the_target(run, strict, solve_keys):
    status, out, err = run("solve", "paper", "--forces", "1,2", "--json", *QUICK)
    states = strict(out)
    assert (status, err) == (0, "")
    assert all(set(state) == solve_keys | TARGET_KEYS for state in states)
    assert [state["target_force_N"] for state in states] == [1.0, 2.0]
    for state in states:
        assert state["force_N"][2] == pytest.approx(state["target_force_N"], rel=1e-3)
        assert abs(state["force_N"][2] / state["target_force_N"] - 1) < state["error_estimate"]


def test_the_depth_that_is_printed_has_the_force(run, strict):
    (state,) = strict(run("solve", "paper", "--force", 3, "--json", *QUICK)[1])
    (single,) = strict(run("solve", "paper", "--depth", state["depth_mm"], "--json", *QUICK)[1])
    assert single["force_N"][2] == pytest.approx(3.0, rel=1e-3)


def test_a_shear_force_shows_how_the_normal_force_changed(run, tmp_path):
    status, out, _ = run(
        *("solve", "paper", "--force", 1, "--shear-force", 0.1, "--harmonics", 1, "--picture", "shear.png", *QUICK)
    )
    assert status == 0
    assert "target shear force" in out
    assert "The normal force changed from 1 to 0.9" in out
    assert (tmp_path / "shear.png").stat().st_size > 1000


def test_files_show_the_last_state_before_a_force_that_is_not_reached(run, strict, tmp_path):
    status, out, err = run("solve", "paper", "--forces", "1,1e6", "--json", "--out", "body.vtu", *QUICK)
    assert status == 3
    assert [state["target_force_N"] for state in strict(out)] == [1.0]
    assert "does not reach 1e+06 N: its largest force is" in err
    assert err.count("\n") == 1
    assert (tmp_path / "body.vtu").exists()


def test_a_tolerance_chooses_finite_elements_for_the_depth_of_the_force(run, strict, solve_keys):
    """Formulas would meet this tolerance at a depth of this size."""
    status, out, err = run("solve", "paper", "--force", 1, "--tolerance", "20%", "--json")
    (state,) = strict(out)
    assert (status, state["chosen_model"]) == (0, "axisymmetric quick")
    assert set(state) == solve_keys | TARGET_KEYS | {"chosen_model", "tolerance", "expected_error"}
    assert state["force_N"][2] == pytest.approx(1.0, rel=1e-3)
    assert "because this is the cheapest model" in err


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        (("--force", 5, "--depth", 1), ["--force and --depth exclude each other"]),
        (("--forces", "1,2", "--depths", "1,2"), ["--forces and --depths exclude each other"]),
        (("--force", 5, "--forces", "1,2"), ["--force and --forces exclude each other"]),
        (("--force", 0), ["force must be", "above 0", "got 0"]),
        (("--force=-1",), ["above 0", "got -1"]),
        (("--forces", "1,0"), ["above 0", "got 0"]),
        (("--forces", "1,a"), ["--forces", "number", "'a'"]),
        (("--force", 5, "--grip", 2), ["--grip has no plate", "--force"]),
        (("--force", 5, "--shear", 1), ["--shear is a displacement", "--shear-force"]),
        (("--force", 5, "--shear-y", 1), ["--shear-y is a displacement", "--shear-force-y"]),
        (("--shear-force", 1), ["--shear-force", "add --force"]),
        (("--depth", 1, "--shear-force", 1), ["--shear-force", "add --force"]),
        (("--forces", "1,2", "--shear-force", 1), ["--forces is for presses only", "--shear-force"]),
        (("--forces", "1,2", "--steps", 2), ["--forces is for presses only", "--steps"]),
        (("--force", 5, "--shear-force", 3, "--friction", "0.5"), ["0.5 x 5 N = 2.5 N", "got 3 N"]),
        (("--force", 5, "--shear-force", 1, "--friction", "none"), ["frictionless plate carries no shear force"]),
        (("--force", 5, "--plate-tilt", 80), ["--plate-tilt must lie within"]),
        (("--force", 5, "--steps", 0), ["--steps must be"]),
        (("--force", 5, "--tolerance", "1%", "--accuracy", "fine"), ["excludes --accuracy fine"]),
    ],
)
def test_impossible_options_are_a_sentence(refusal, options, parts):
    err = refusal("solve", "paper", *options)
    assert all(part in err for part in parts), err


def test_states_of_forces_are_states_for_other_verbs(run, tmp_path):
    _, out, _ = run("solve", "paper", "--forces", "0.5,1", "--accuracy", "quick", "--json")
    (tmp_path / "states.jsonl").write_text(out)
    status, out, _ = run("readings", "paper", "--responses", "states.jsonl", "--json")
    assert status == 0
    assert len([json.loads(line) for line in out.splitlines()]) == 2
