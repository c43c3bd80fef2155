"""Solutions within a tolerance, on the command line and from Python."""

import json

import pytest

from fem.solution import Estimates
from geometry.design import paper
from geometry.loads import Load
from studies.inputs.option_groups import Method
from studies.simulation import load_cases, within_tolerance


def test_solve_says_which_model_a_tolerance_chooses_and_why(run):
    status, out, err = run("solve", "paper", "--depth", "1", "--tolerance", "2%", "--json")
    row = json.loads(out)
    assert status == 0
    assert row["chosen_model"] == "axisymmetric quick"
    assert row["tolerance"] == 0.02
    assert 0 < row["expected_error"] <= 0.02
    assert "tolerance 2 %: axisymmetric quick, because" in err


def test_formulas_answer_in_the_columns_of_finite_elements(run):
    _, out, _ = run("solve", "paper", "--depth", "0.4", "--tolerance", "20%", "--json")
    _, solved, _ = run("solve", "paper", "--depth", "0.4", "--tolerance", "2%", "--json")
    formula, fem = json.loads(out), json.loads(solved)
    assert formula["model"] == formula["chosen_model"] == "formula finite"
    assert set(formula) == set(fem)
    assert formula["force_N"][2] == pytest.approx(fem["force_N"][2], rel=0.2)


def test_a_table_of_formulas_says_so(run):
    _, out, _ = run("solve", "paper", "--depth", "0.4", "--steps", "2", "--tolerance", "20%")
    assert out.startswith("Formulas\n")


def test_a_picture_needs_finite_elements(run, tmp_path):
    _, out, _ = run(
        *("solve", "paper", "--depth", "0.4", "--tolerance", "20%", "--json"), "--out", str(tmp_path / "body.vtu")
    )
    assert json.loads(out)["chosen_model"] == "axisymmetric quick"


@pytest.mark.parametrize(
    "option", [("--accuracy", "fine"), ("--model", "half"), ("--harmonics", "2"), ("--mesh", "a.vtu")]
)
def test_a_tolerance_excludes_the_options_that_it_decides(run, option):
    status, _, err = run("solve", "paper", "--depth", "1", "--tolerance", "1%", *option)
    assert status == 2
    assert f"excludes {' '.join(option)}" in err


@pytest.mark.parametrize("text", ["5", "0", "-1%", "100%", "1%%", "one", "nan", ""])
def test_a_tolerance_that_is_no_share_is_refused(run, text):
    status, _, err = run("solve", "paper", "--depth", "1", f"--tolerance={text}")
    assert status == 2
    assert "such as 1%" in err


def test_an_estimate_beyond_the_tolerance_is_solved_again_at_a_finer_accuracy(monkeypatch, capsys):
    solved = []
    original = load_cases.solve

    def solve(design, loads, method, **options):
        solved.append(method.level)
        return original(design, loads, method, **options)

    monkeypatch.setattr(load_cases, "solve", solve)
    monkeypatch.setattr("fem.equilibrium.estimate_response", estimates)
    method = Method(tolerance="2%")
    loads = [Load(depth=0.4)]
    chosen = within_tolerance.choose(paper(), loads, method, files=False)
    rows = list(
        within_tolerance.solve(paper(), loads, method, chosen, out=None, picture=None, progress=lambda *_: None)
    )
    assert solved == ["quick", "standard"]
    assert rows[0]["chosen_model"] == "axisymmetric standard"
    assert rows[0]["expected_error"] < chosen.choice.bound
    assert "solved again at accuracy standard" in capsys.readouterr().err


def estimates(one, other, load, scene, model):
    """Estimates of 4 % at accuracy quick, and of 1 % at finer ones."""
    value = 0.04 if scene.accuracy.name == "quick" else 0.01
    return Estimates(force=value, shift=value, tilt=None, sideways=None)


def test_compare_takes_a_tolerance(run):
    status, out, err = run("compare", "paper", "--tolerance", "5%", "--json")
    record = json.loads(out)
    assert status == 0
    assert record["chosen_model"].endswith(" quick")
    assert record["tolerance"] == 0.05
    assert f"{record['chosen_model']}, because" in err


def test_compare_refuses_tolerance_and_accuracy_together(run):
    status, _, err = run("compare", "paper", "--tolerance", "5%", "--accuracy", "fine")
    assert status == 2
    assert "excludes --accuracy fine" in err
