"""The verb sweep: its store, what it says of its axes, and models chosen by a tolerance."""

import pytest

from analytic import beam
from geometry.design import paper
from geometry.loads import Load
from studies.mechanics import model_choice, store, surrogate_response
from studies.mechanics.model_choice import Statement


def test_sweeps_in_different_folders_share_the_user_s_store(run, tmp_path):
    command = ("sweep", "paper", "--magnet", "ignored", "--accuracy", "quick", "--axis", "depth=0.5", "--json")
    first = run(*command, "--out", "one")
    assert run(*command, "--out", "two")[1] == first[1]
    assert run(*command, "--store", "own.sqlite", "--out", "three")[0] == 0
    with store.opened(tmp_path / "own.sqlite") as own:
        assert own.counts() == (1, 1)
    assert run(*command, "--store", "one/sweep.csv")[0] == 2


def test_a_sweep_over_f_of_a_chip_says_that_f_changes_nothing(run):
    sweep_f = ("sweep", "paper", "--axis", "f=5,6", "--depth", 0.3, "--accuracy", "quick")
    lines = run(*sweep_f, "--set", "hall_layout=tmag5273a1", "--json")[2].splitlines()
    assert lines == ["magtip: warning: axis f has no effect: the results are the same for all its values"]
    assert run(*sweep_f, "--json")[2] == ""
    assert "axis f has no effect: it changes only columns that --wide, --json and --out show" in run(*sweep_f)[2]


def test_reasons_name_the_axes_that_vary_in_the_whole_table(run):
    axes = ("--axis", "D=8,100", "--axis", "E=0.5,1", "--axis", "depth=1")
    status, _, err = run("sweep", "paper", *axes, "--magnet", "ignored", "--accuracy", "quick", "--json")
    assert status == 3
    assert "magtip: D 100 mm, E 0.5 MPa; D 100 mm, E 1 MPa: L must exceed the tip radius D/2 = 50 mm" in err


def test_unstable_cases_are_counted_beside_the_table(run):
    long = ("--set", "L=24", "--set", "l0=20", "--magnet", "ignored", "--accuracy", "quick")
    status, _, err = run("sweep", "paper", *long, "--axis", "depth=0.5,2", "--json")
    assert status == 0
    assert "magtip: 1 of 2 cases are unstable" in err


def test_a_tolerance_chooses_the_model_of_each_case(run, strict):
    command = ("sweep", "paper", "--tolerance", "20%", "--axis", "depth=0.4,2", "--set", "nu=0.3", "--json")
    status, out, err = run(*command)
    light, deep = strict(out)
    for row in (light, deep):
        assert row["expected_error"] <= 0.2
        assert row["force_error_percent"] == pytest.approx(
            100 * (row["analytic_force_N"] / row["chosen_force_N"] - 1), rel=1e-9
        )
    # formulas are calibrated for nearly incompressible silicone
    assert {light["chosen_model"], deep["chosen_model"]} == {"axisymmetric quick"}
    assert (status, "axisymmetric quick in 2 of 2 cases" in err) == (0, True)
    light, deep = strict(run(*command[:-3], "--json")[1])
    assert (light["chosen_model"], light["solve"]) == ("formula finite", 0)
    own = beam.solve(paper(), Load(depth=0.4), "finite").force[2]
    assert light["chosen_force_N"] == pytest.approx(own, rel=1e-12)


def test_a_tolerance_may_choose_the_surrogate_which_needs_no_solve(run, strict, monkeypatch):
    own = Statement("press", "depth to D/4", "surrogate", "shipped", 9, 9, 0.02, 0.02, 0.02, None, 0.02)
    monkeypatch.setattr(model_choice, "statements", lambda rule=model_choice.statements(): (*rule, own))
    command = ("sweep", "paper", "--tolerance", "5%", "--axis", "depth=0.6,0.8", "--quantities", "force,strain")
    status, out, err = run(*command, "--json")
    rows = strict(out)
    assert (status, "surrogate shipped in 2 of 2 cases" in err) == (0, True)
    for row in rows:
        estimate = surrogate_response.respond(paper(), Load(depth=row["depth_mm"]))
        assert (row["chosen_model"], row["solve"], row["status"]) == ("surrogate shipped", 0, "ok")
        assert row["chosen_force_N"] == pytest.approx(estimate.response.force[2], rel=1e-12)
        assert (row["error_estimate"], row["shift_error_estimate"]) == (
            estimate.errors["force"],
            estimate.errors["shift"],
        )
        assert row["message"].startswith("by the surrogate; 90 % intervals: force +-")


def test_a_case_that_is_not_known_to_meet_the_tolerance_has_failed(run, strict):
    slender = ("--set", "L=24", "--set", "l0=22", "--set", "magnet_edge_radius=0.4")
    axes = ("--axis", "shear=0.4", "--load", "friction=stick", "--depth", "0.8", "--tolerance", "2%", "--json")
    status, out, err = run("sweep", "paper", *slender, *axes)
    (row,) = strict(out)
    assert (status, row["status"]) == (3, "beyond_tolerance")
    assert "error of the force along the shear" in row["message"]
    assert row["chosen_force_N"] > 1
    assert "1 cases are not known to meet the tolerance" in err
