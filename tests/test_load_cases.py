"""The verbs solve and analytic: states, forces, tolerances, files, and what is refused."""

import json
import math
import re
from pathlib import Path
from typing import get_args

import pytest

from analytic import beam
from fem.analyses.force_targets import ForceTarget
from fem.solution import Estimates
from geometry import design_digest
from geometry.bad_input import MeshError
from geometry.design import paper
from geometry.loads import Load
from studies.inputs import option_groups
from studies.inputs.option_groups import Method, Motion, Wanted
from studies.mechanics import model_choice
from studies.mechanics.model_choice import Statement
from studies.simulation import compare, load_cases, within_tolerance

QUICK = ("--magnet", "ignored", "--accuracy", "quick")


def test_a_press_has_its_state_as_json(run, strict):
    status, out, err = run("solve", "paper", "--depth", 1, "--json", *QUICK)
    assert (status, err) == (0, "")
    (state,) = strict(out)
    assert (state["status"], state["model"], state["depth_mm"], state["shear_mm"]) == ("ok", "axisymmetric", 1.0, 0.0)
    assert [len(state[key]) for key in ("force_N", "shift_mm")] == [3, 3]
    assert state["force_N"][2] > 0 > state["shift_mm"][2]
    assert 0 < state["contact_radius_mm"] < 4
    assert 0 < state["error_estimate"] < 0.2
    assert [state[key] for key in ("stop", "remark", "onset_depth_from_mm", "inside_out_share")] == [None] * 4


def test_unstable_state_says_since_when(run, strict):
    # a slender beam buckles under a frictionless plate, the later the larger the patch that holds its tip
    flags = ("--model", "harmonic", "--harmonics", 1, "--set", "L=32", "--json", *QUICK)
    status, out, err = run("solve", "paper", "--depths", "0.4,0.8", *flags)
    assert status == 3
    stable, unstable = strict(out)
    assert (stable["status"], unstable["status"], unstable["depth_mm"]) == ("ok", "unstable", 0.8)
    low, high = re.search(r"depth between (\S+) and (\S+) mm", unstable["message"]).groups()
    assert 0.4 <= float(low) < float(high) <= 0.8
    assert unstable["message"] in err


def test_a_design_without_a_magnet_is_all_silicone(run, strict):
    none = ("--set", "magnet_diameter=0", "--set", "magnet_height=0")
    status, out, err = run("sweep", "paper", "--axis", "depth=0.5", *none, "--accuracy", "quick", "--json")
    (row,) = strict(out)
    assert (status, row["fem_force_N"] > 0) == (0, True)
    assert err == "magtip: the design has no magnet (magnet_diameter is 0): it is solved as all silicone\n"


def test_failed_solve_keeps_its_states(run, tmp_path, strict):
    flags = ("--json", "--out", "last.vtu", *QUICK)
    status, out, err = run("solve", "paper", "--depths", "1,8.9", *flags)
    assert status == 3
    reached, last = strict(out)
    assert reached["status"] == "ok"
    assert last["status"] == "not_converged"
    assert 1 < last["depth_mm"] < 8.9
    assert last["message"] in err
    assert err.count("\n") == 1
    assert [path.name for path in tmp_path.glob("[!.]*")] == ["last.vtu"]


def test_a_mesh_that_cannot_be_made_is_a_failed_solve(run, monkeypatch, strict):
    from fem import equilibrium

    (good,) = strict(run("solve", "paper", "--depth", 1, "--json", *QUICK)[1])

    def fail(*_, **__):
        raise MeshError("the section's outline could not be meshed: take a smaller size")

    monkeypatch.setattr(equilibrium, "path_models", fail)
    status, out, err = run("solve", "paper", "--depth", 1, "--json")
    assert (status, err) == (3, "magtip: the section's outline could not be meshed: take a smaller size\n")
    (state,) = strict(out)
    assert set(state) == set(good)
    assert (state["status"], state["force_N"]) == ("not_converged", None)


def test_analytic_json(run, strict):
    status, out, err = run("analytic", "paper", "--depth", 2, "--shear", -0.5, "--json")
    assert (status, err) == (0, "")
    (record,) = strict(out)
    expected = beam.solve(paper(), Load(depth=2.0, shear_x=-0.5, friction="stick"))
    assert tuple(record["force_N"]) == expected.force
    assert tuple(record["shift_mm"]) == expected.shift
    assert len(record["readings_T"]) == len(record["readings_V"]) == 3
    assert (record["status"], record["level"], record["shear_mm"]) == ("ok", "paper", -0.5)


def test_analytic_states_say_for_which_sensor_they_are(run, refusal, strict, tmp_path):
    """As those of a solve do: they are read without a warning for their design, and refused for another one."""
    lines = [run("analytic", "paper", "--depth", depth, "--level", "finite", "--json")[1] for depth in (1, 2)]
    (tmp_path / "states.jsonl").write_text("".join(lines))
    (record,) = strict(lines[0])
    assert record["made_for"] == design_digest.label(design_digest.of_mechanics(paper()))["made_for"]
    status, out, err = run("readings", "paper", "--responses", "states.jsonl", "--json")
    assert (status, err) == (0, "")
    assert strict(out)[0]["readings_T"] == record["readings_T"]
    assert "made for another sensor" in refusal(
        "readings", "paper", "--set", "E=0.6", "--responses", "states.jsonl", "--json"
    )
    assert "made_for" not in run("analytic", "paper", "--depth", 1)[1].replace(" ", "_")


@pytest.mark.parametrize(
    ("given", "loads"),
    [
        ({"depth": 1.0, "steps": 2}, [Load(0.5), Load(1.0)]),
        ({"depths": "1,2"}, [Load(1.0), Load(2.0)]),
        ({"depth": 1.0, "load": {"shear": -0.5}}, [Load(1.0, -0.5, friction="stick")]),
        ({"depth": 1.0, "load": {"shear": 1.0, "friction": 0.5}}, [Load(1.0, 1.0, friction=0.5)]),
        ({"depth": 1.0, "load": {"shear": 1.0}, "steps": 2}, [Load(1.0, s, friction="stick") for s in (0.5, 1.0)]),
        ({"load": {"grip": 2.0, "shear": 1.0}}, [Load(0.0, 1.0, grip=2.0)]),
        ({"depth": 1.0, "load": {"shear_y": 0.5}}, [Load(1.0, 0.0, 0.5, friction="stick")]),
        ({"depth": 1.0, "load": {"plate_tilt": 90 / math.pi}}, [Load(1.0, plate_tilt=0.5)]),
    ],
)
def test_options_as_loads(given, loads):
    assert load_cases.loads_of(Motion(**given)) == loads


def test_choices_match_the_solver():
    from fem import accuracy as accuracy_levels
    from fem import scene
    from studies.inputs.user_input import AccuracyName

    assert get_args(option_groups.Model) == get_args(scene.Model)
    assert set(get_args(AccuracyName)) == set(accuracy_levels.LEVELS)


def test_formulas_say_what_is_in_the_way(run, strict):
    status, out, err = run("analytic", "paper", "--depth", 3, "--shear", 2.8, "--set", "c=3", "--json")
    (record,) = strict(out)
    assert status == 0
    assert any("wall overlaps S2" in text for text in record["warnings"])
    assert err.count("warning: ") == len(record["warnings"])
    _, out, err = run("analytic", "paper", "--depth", 3, "--set", "l0=5", "--json")
    assert strict(out)[0]["saturated"] == [True, False, False]
    assert "S1 is saturated" in err


@pytest.mark.parametrize(
    ("motion", "method", "options"),
    [
        ({"depth": 1.0, "load": {"friction": "stick"}}, {}, ["--friction stick"]),
        ({"depth": 1.0, "load": {"friction": "stick", "shear_y": 1.0}}, {}, []),
        ({"depth": 1.0}, {"mesh": Path("m.vtu"), "wanted": Wanted(accuracy="fine")}, ["--accuracy"]),
        ({"depth": 1.0}, {"mesh": Path("m.vtu")}, []),
    ],
)
def test_options_of_a_solve_that_another_makes_useless(motion, method, options):
    assert [option for option, _ in load_cases.ineffective_options(Motion(**motion), Method(**method))] == options


# Forces


TARGET_KEYS = {"target_force_N", "target_shear_force_N"}
STICK = Load(friction="stick")


@pytest.mark.parametrize(
    ("options", "targets"),
    [
        ({"force": 5.0}, [ForceTarget(5.0)]),
        ({"force": 2.0, "steps": 2}, [ForceTarget(1.0), ForceTarget(2.0)]),
        ({"force": 5.0, "load": {"friction": 0.5}}, [ForceTarget(5.0, None, Load(friction=0.5))]),
        ({"force": 5.0, "shear_force": -1.0}, [ForceTarget(5.0, (-1.0, 0.0), STICK)]),
        (
            {"force": 5.0, "shear_force": 2.0, "shear_force_y": 1.0, "steps": 2},
            [ForceTarget(5.0, (s, s / 2), STICK) for s in (1.0, 2.0)],
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


def test_a_shear_force_shows_how_the_plate_held_the_normal_one(run, tmp_path):
    status, out, _ = run(
        *("solve", "paper", "--force", 1, "--shear-force", 0.1, "--harmonics", 1, "--picture", "shear.png", *QUICK)
    )
    assert status == 0
    assert "target shear force" in out
    assert re.search(r"force +0\.1\d*, 0, 1\.?\d* N", out)
    assert "held the normal force of 1 N during the shear of 0.2" in out
    assert (tmp_path / "shear.png").stat().st_size > 1000


def test_a_force_that_is_not_reached_is_a_row_of_how_far_the_press_got(run, strict, tmp_path):
    status, out, err = run("solve", "paper", "--forces", "1,1e6", "--json", "--out", "body.vtu", *QUICK)
    assert status == 3
    reached, nearest = strict(out)
    assert [state["target_force_N"] for state in (reached, nearest)] == [1.0, 1e6]
    assert [state["status"] for state in (reached, nearest)] == ["ok", "out_of_reach"]
    assert f"largest force is {nearest['force_N'][2]:.4g} N at depth {nearest['depth_mm']:.4g} mm" in err
    assert nearest["message"] in err
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
    ("options", "sentence"),
    [
        ("--force 5 --depth 1", "--force and --depth exclude each other"),
        ("--force 5 --forces 1,2", "--force and --forces exclude each other"),
        ("--force 0", "above 0; got 0"),
        ("--forces 1,a", "each value of --forces must be a finite number; got 'a'"),
        ("--force 5 --grip 2", "--grip has no plate"),
        ("--force 5 --shear 1", "--shear is a displacement"),
        ("--shear-force 1", "add --force"),
        ("--forces 1,2 --shear-force 1", "--forces is for presses only"),
        (
            "--force 5 --shear-force 2 --shear-force-y 2 --friction 0.5",
            "= 2.5 N, at which the plate slips; got 2.828",
        ),
        ("--force 5 --shear-force 1 --friction none", "frictionless plate carries no shear force"),
        ("--force 5 --tolerance 1% --accuracy fine", "excludes --accuracy fine"),
        ("--depth 1 --tolerance 1% --model half", "excludes --model half"),
        ("--depth 1 --tolerance 1% --harmonics 2", "excludes --harmonics 2"),
        ("--depth 1 --tolerance 1% --mesh a.vtu", "excludes --mesh a.vtu"),
        ("--depth 1 --tolerance=-1%", "such as 1%"),
        ("--depth 1 --tolerance 100%", "such as 1%"),
        ("--depth 1 --tolerance one", "such as 1%"),
    ],
)
def test_impossible_options_are_a_sentence(refusal, options, sentence):
    assert sentence in refusal("solve", "paper", *options.split())


# Solutions within a tolerance


WITHOUT_SURROGATE = ("--set", "magnet_edge_radius=0.4")
"""A magnet with rounder edges than the surrogate knows."""


def test_formulas_answer_in_the_columns_of_finite_elements(run):
    _, out, _ = run("solve", "paper", "--depth", "0.4", "--tolerance", "20%", "--json")
    _, solved, _ = run("solve", "paper", *WITHOUT_SURROGATE, "--depth", "0.4", "--tolerance", "2%", "--json")
    formula, fem = json.loads(out), json.loads(solved)
    assert formula["model"] == formula["chosen_model"] == "formula finite"
    assert set(formula) == set(fem)
    assert formula["force_N"][2] == pytest.approx(fem["force_N"][2], rel=0.2)


def by_surrogate(monkeypatch):
    """Let the rule have bounds of 2 % for the surrogate in presses to D/4 and in small shears."""
    own = [
        Statement(kind, region, "surrogate", "shipped", 9, 9, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02)
        for kind, region in (("press", "depth to D/4"), ("glued shear", "shear to 0.15 D"))
    ]
    rule = tuple(each for each in model_choice.statements() if each.model != "surrogate")
    monkeypatch.setattr(model_choice, "statements", lambda: (*rule, *own))


def test_the_surrogate_answers_in_the_columns_of_finite_elements(run, monkeypatch):
    by_surrogate(monkeypatch)
    status, out, err = run("solve", "paper", "--depth", "0.8", "--tolerance", "5%", "--json")
    _, solved, _ = run("solve", "paper", "--depth", "0.8", "--json")
    row, fem = json.loads(out), json.loads(solved)
    assert (status, row["status"]) == (0, "ok")
    assert row["model"] == row["chosen_model"] == "surrogate shipped"
    assert "tolerance 5 %: surrogate, because" in err
    assert set(row) - set(fem) == {"chosen_model", "tolerance", "expected_error"}
    assert set(fem) <= set(row)
    assert row["force_N"][2] == pytest.approx(fem["force_N"][2], rel=0.05)
    assert row["largest_strain_percent"] == pytest.approx(fem["largest_strain_percent"], rel=0.2)


def test_a_picture_and_a_comparison_are_not_by_the_surrogate(run, monkeypatch, tmp_path):
    by_surrogate(monkeypatch)
    command = ("solve", "paper", "--depth", "0.8", "--tolerance", "5%", "--json", "--out", str(tmp_path / "body.vtu"))
    assert json.loads(run(*command)[1])["chosen_model"] == "axisymmetric quick"
    chosen = within_tolerance.choose_accuracy(paper(), [[Load(depth=0.8)]], "5%")
    assert chosen.model == "axisymmetric"


@pytest.mark.parametrize(
    ("quick", "finer", "status", "model", "said"),
    [
        (0.04, 0.01, 0, "axisymmetric standard", ""),
        (0.04, 0.04, 3, "axisymmetric fine", "4 %, exceeds the tolerance 2 %"),
        (None, None, 3, "axisymmetric fine", "is unknown"),
    ],
)
def test_an_estimate_beyond_the_tolerance_is_solved_again_finer(monkeypatch, run, quick, finer, status, model, said):
    def estimates(one, other, scene):
        value = quick if scene.accuracy.name == "quick" else finer
        return Estimates(force=value, shift=value, tilt=None, sideways=None)

    monkeypatch.setattr("fem.equilibrium.estimate_state", estimates)
    words = ("solve", "paper", *WITHOUT_SURROGATE, "--depth", "0.4", "--tolerance", "2%", "--json")
    found, out, err = run(*words)
    row = json.loads(out)
    assert (found, row["chosen_model"], row["error_estimate"]) == (status, model, finer)
    assert said in row["message"]
    assert f"solved again at accuracy {model.split()[1]}" in err


@pytest.mark.parametrize("quick", [0.01, 0.06], ids=["met", "refined"])
def test_compare_takes_a_tolerance(run, monkeypatch, quick):
    def estimates(one, other, scene):
        value = quick if scene.accuracy.name == "quick" else 0.01
        return Estimates(force=value, shift=value, tilt=value, sideways=value)

    loads = [Load(0.5), Load(1.0)], [Load(1.0), Load(1.0, 0.5, friction="stick")]
    monkeypatch.setattr("fem.equilibrium.estimate_state", estimates)
    monkeypatch.setattr(compare, "default_loads", lambda _: loads)
    # the states of other tests have other estimates
    words = ("compare", "paper", "--set", f"nu={0.499 + quick / 100}", "--tolerance", "5%", "--json")
    status, out, err = run(*words)
    record = json.loads(out)
    accuracy = "quick" if quick < 0.05 else "standard"
    assert (status, record["tolerance"], record["chosen_model"].split()[1]) == (0, 0.05, accuracy)
    assert "quick, because" in err
    assert ("solved again at accuracy standard" in err) == (accuracy == "standard")
