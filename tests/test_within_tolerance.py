"""Solutions within a tolerance, on the command line and from Python."""

import functools
import json

import pytest

from analytic import buckling
from fem.solution import Estimates
from geometry.design import Design, paper
from geometry.loads import Load
from studies.mechanics import model_choice, surrogate_response
from studies.mechanics.model_choice import Statement
from studies.simulation import compare, within_tolerance

WITHOUT_SURROGATE = ("--set", "magnet_edge_radius=0.4")
"""A magnet with rounder edges than the surrogate knows."""


def test_solve_says_which_model_a_tolerance_chooses_and_why(run):
    status, out, err = run("solve", "paper", *WITHOUT_SURROGATE, "--depth", "1", "--tolerance", "2%", "--json")
    row = json.loads(out)
    assert status == 0
    assert row["chosen_model"] == "axisymmetric quick"
    assert row["tolerance"] == 0.02
    assert 0 < row["expected_error"] <= 0.02
    assert "tolerance 2 %: axisymmetric quick, because" in err


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
    assert "tolerance 5 %: the surrogate, because" in err
    assert set(row) - set(fem) == {"chosen_model", "tolerance", "expected_error"}
    assert set(fem) <= set(row)
    assert row["force_N"][2] == pytest.approx(fem["force_N"][2], rel=0.05)
    assert row["largest_strain_percent"] == pytest.approx(fem["largest_strain_percent"], rel=0.2)


def test_the_error_estimates_of_the_surrogate_are_its_half_widths(run, monkeypatch):
    by_surrogate(monkeypatch)
    _, out, _ = run("solve", "paper", "--depth", "0.8", "--shear", "1", "--tolerance", "9%", "--json")
    row = json.loads(out)
    own = surrogate_response.respond(paper(), Load(depth=0.8, shear_x=1.0, friction="stick"))
    names = ("error_estimate", "shift_error_estimate", "tilt_error_estimate", "sideways_error_estimate")
    assert [row[name] for name in names] == pytest.approx(
        [own.errors[name] for name in ("force", "shift", "tilt", "sideways")]
    )
    assert row["message"].startswith("by the surrogate; 90 % intervals: force +-")


def test_a_picture_and_a_comparison_are_not_by_the_surrogate(run, monkeypatch, tmp_path):
    by_surrogate(monkeypatch)
    command = ("solve", "paper", "--depth", "0.8", "--tolerance", "5%", "--json", "--out", str(tmp_path / "body.vtu"))
    assert json.loads(run(*command)[1])["chosen_model"] == "axisymmetric quick"
    chosen = within_tolerance.choose_accuracy(paper(), [[Load(depth=0.8)]], "5%")
    assert chosen.model_kind == "fem"


def test_a_picture_needs_finite_elements(run, tmp_path):
    _, out, _ = run(
        *("solve", "paper", "--depth", "0.4", "--tolerance", "20%", "--json"), "--out", str(tmp_path / "body.vtu")
    )
    assert json.loads(out)["chosen_model"] == "axisymmetric quick"


@pytest.mark.parametrize(
    "option", [("--accuracy", "fine"), ("--model", "half"), ("--harmonics", "2"), ("--mesh", "a.vtu")]
)
def test_a_tolerance_excludes_the_options_that_it_decides(refusal, option):
    assert f"excludes {' '.join(option)}" in refusal("solve", "paper", "--depth", "1", "--tolerance", "1%", *option)


@pytest.mark.parametrize("text", ["5", "0", "-1%", "100%", "1%%", "one", "nan"])
def test_a_tolerance_that_is_no_share_is_refused(refusal, text):
    for option in ([f"--tolerance={text}"], ["--tolerance", text]):
        assert "such as 1%" in refusal("solve", "paper", "--depth", "1", *option)


def test_an_estimate_beyond_the_tolerance_is_solved_again_at_a_finer_accuracy(monkeypatch, run):
    monkeypatch.setattr("fem.equilibrium.estimate_response", estimates)
    command = ("solve", "paper", *WITHOUT_SURROGATE, "--depth", "0.4", "--tolerance", "2%", "--json")
    _, out, err = run(*command)
    row = json.loads(out)
    assert row["chosen_model"] == "axisymmetric standard"
    assert row["error_estimate"] == 0.01
    assert "at accuracy quick the error estimate of the force, 4 %, exceeds" in err
    assert "solved again at accuracy standard" in err


def estimates(one, other, load, scene, model):
    """Estimates of 4 % at accuracy quick, and of 1 % at finer ones."""
    value = 0.04 if scene.accuracy.name == "quick" else 0.01
    return Estimates(force=value, shift=value, tilt=None, sideways=None)


@pytest.fixture
def few_states(monkeypatch):
    """Let a comparison be one of few states."""
    monkeypatch.setattr(compare, "run", functools.partial(compare.run, depths=(0.5, 1.0), shears=(0.0, 0.5)))


@pytest.mark.usefixtures("few_states")
def test_compare_takes_a_tolerance(run):
    status, out, err = run("compare", "paper", "--tolerance", "5%", "--json")
    record = json.loads(out)
    assert status == 0
    assert record["chosen_model"].endswith(" quick")
    assert record["tolerance"] == 0.05
    assert f"{record['chosen_model']}, because" in err


def test_compare_refuses_tolerance_and_accuracy_together(refusal):
    assert "excludes --accuracy fine" in refusal("compare", "paper", "--tolerance", "5%", "--accuracy", "fine")


@pytest.mark.parametrize("value", [0.04, None])
def test_an_estimate_that_never_meets_the_tolerance_ends_with_status_3(value, run, monkeypatch):
    monkeypatch.setattr(
        "fem.equilibrium.estimate_response", lambda *_: Estimates(force=value, shift=value, tilt=None, sideways=None)
    )
    status, out, err = run("solve", "paper", *WITHOUT_SURROGATE, "--depth", "0.4", "--tolerance", "1%", "--json")
    (row,) = map(json.loads, out.splitlines())
    assert (status, row["status"], row["chosen_model"]) == (3, "beyond_tolerance", "axisymmetric fine")
    words = "is unknown" if value is None else "4 %, exceeds the tolerance 1 %"
    assert words in row["message"]
    assert "solved again at accuracy fine" in err


def test_the_force_along_a_shear_decides_too(run):
    """A slender beam near its buckling load: the force along the shear is a small difference of large ones."""
    slender = ("--set", "L=24", "--set", "l0=22", *WITHOUT_SURROGATE)
    loads = ("--depth", "0.8", "--shear", "0.4", "--tolerance", "5%", "--json")
    status, out, err = run("solve", "paper", *slender, *loads)
    row = json.loads(out)
    assert row["force_N"][0] < 0.3 * buckling.sideways_stiffness(Design(L=24.0, l0=22.0)) * 0.4
    assert "force along the shear" in err
    assert status == (0 if row["status"] == "ok" else 3)
    assert row["sideways_error_estimate"] <= 0.05 or row["status"] == "beyond_tolerance"


@pytest.mark.usefixtures("few_states")
def test_a_comparison_beyond_its_tolerance_ends_with_status_3(run, monkeypatch):
    monkeypatch.setattr(
        "fem.equilibrium.estimate_response", lambda *_: Estimates(force=0.06, shift=0.01, tilt=0.01, sideways=0.01)
    )
    status, _, err = run("compare", "paper", "--tolerance", "5%", "--json")
    assert status == 3
    assert "tolerance 5 %: error_estimate of 6 % exceeds it" in err
