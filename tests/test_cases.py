"""A table of cases: one row in, one row out, the same answers as solves and formulas one at a time."""

import math
import time
from dataclasses import replace
from decimal import Decimal

import numpy as np
import pandas as pd
import pytest

from analytic import beam
from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import BadInput, paper
from geometry.loads import Load
from studies import cases
from studies.mechanics import surrogate_response
from studies.mechanics.path_solver import Answer
from studies.mechanics.study_cases import Problem
from studies.sweeps.study_rows import with_critical


@pytest.fixture
def ask(tmp_path):
    def ask(columns, models=("paper",), **options):
        table = columns if isinstance(columns, pd.DataFrame) else pd.DataFrame(columns)
        return cases.answer(table, models, store=tmp_path / "states.sqlite", **options)

    return ask


def test_each_row_has_its_answers_by_all_models(ask):
    table = pd.DataFrame({"L_mm": [8, 10.0, 8], "E_MPa": [1.0, 2.0, 0.5], "depth_mm": 0.8}, index=["a", "b", "a"])
    found = ask(table, ["fem:quick", "finite", "surrogate"], quantities=["force", "shift"])
    assert list(found.index) == ["a", "b", "a"]
    assert list(found["status"]) == ["ok"] * 3
    assert (found["L_mm"].to_numpy() == table["L_mm"]).all()
    for k, (L, E) in enumerate([(8, 1.0), (10, 2.0), (8, 0.5)]):
        design, load = replace(paper(), L=L, l0=paper().l0 + L - paper().L, E=E), Load(depth=0.8)
        row = found.iloc[k]
        assert row["fem_force_N"] == pytest.approx(solve(design, load, QUICK).response.force[2], rel=1e-9)
        assert row["analytic_force_N"] == pytest.approx(beam.solve(design, load, "finite").force[2], rel=1e-12)
        estimate = surrogate_response.respond(design, load)
        assert row["surrogate_force_N"] == pytest.approx(estimate.response.force[2], rel=1e-9)
        assert row["surrogate_error_estimate"] == pytest.approx(estimate.errors["force"], rel=1e-9)
    # forces are proportional to E: the third row shares the solve of the first
    assert list(found["solve"]) == [1, 2, 1]


def test_errors_are_relative_to_the_reference_that_is_named(ask):
    columns = {"depth_mm": [0.5, 1.0]}
    found = ask(columns, ["paper", "finite", "surrogate"], reference="finite", quantities=["force"])
    of_paper = 100 * (found["analytic_paper_force_N"] / found["analytic_finite_force_N"] - 1)
    assert found["analytic_paper_force_error_percent"].to_numpy() == pytest.approx(of_paper.to_numpy())
    assert "analytic_finite_force_error_percent" not in found
    with pytest.raises(BadInput, match="the reference 'fem' is not among the models"):
        ask(columns, ["paper"], reference="fem")


def test_a_case_that_is_impossible_is_a_row_with_its_reason(ask):
    found = ask({"D_mm": [8, math.nan, -1, "wide"], "depth_mm": [1, 1, 1, 1]}, ["paper"])
    assert list(found["status"]) == ["ok", "bad_input", "bad_input", "bad_input"]
    assert found["analytic_force_N"].notna().tolist() == [True, False, False, False]
    assert found["message"].iloc[1:].str.startswith("D_mm must").all()


@pytest.mark.parametrize("E", [-1.0, 0.0, 1e9, math.inf, math.nan, "x"])
def test_an_impossible_modulus_has_no_force(ask, E):
    """Forces are proportional to E, so that no solve would refuse it."""
    found = ask({"depth_mm": [1.0, 1.0], "E_MPa": [1.0, E]}, ["paper", "surrogate"], quantities=["force"])
    assert list(found["status"]) == ["ok", "bad_input"]
    assert found["message"].iloc[1].startswith("E_MPa must")
    assert found[["analytic_force_N", "surrogate_force_N"]].isna().all(axis=1).tolist() == [False, True]


def test_cells_of_other_kinds_are_named(ask):
    cells = [1, np.int8(1), Decimal("1"), "1", 1j, True, None, pd.NA, pd.Timedelta(1)]
    found = ask({"depth_mm": cells}, quantities=["force"])
    assert list(found["status"]) == ["ok"] * 3 + ["bad_input"] * 6
    assert found["message"].iloc[3] == "depth_mm must be a number; got '1'"


def test_many_rows_of_few_problems_are_quick(ask):
    """Rows of one problem are computed once: 200 000 rows would take minutes one by one."""
    depths = np.tile([0.5, 1.0, 1.5], 70_000)
    begin = time.process_time()
    found = ask({"depth_mm": depths, "L_mm": np.repeat([9.0, 10.0], 105_000)}, quantities=["force"])
    assert time.process_time() - begin < 20
    assert found.groupby(["depth_mm", "L_mm"])["analytic_force_N"].nunique().tolist() == [1] * 6


def test_a_beam_without_a_magnet_says_that_it_has_no_readings(ask):
    found = ask({"depth_mm": 1.0, "magnet_diameter_mm": [4.0, 0.0], "magnet_height_mm": [2.0, 0.0]})
    assert found["message"].tolist() == ["", "without a magnet there are no readings"]
    assert found["analytic_S1_V"].isna().tolist() == [False, True]


def test_no_number_of_a_load_is_taken_for_zero(ask):
    found = ask({"depth_mm": [1, math.nan, 1], "shear_mm": [0.5, 0.5, math.nan]}, ["finite"])
    assert list(found["status"]) == ["ok", "bad_input", "bad_input"]
    assert found["analytic_force_x_N"].isna().tolist() == [False, True, True]


def test_grips_and_presses_stand_in_one_table(ask):
    columns = {
        "depth_mm": [0.5, 0.0],
        "shear_mm": [0.2, 0.5],
        "grip_mm": [math.nan, 5.0],
        "friction": ["stick", "stick"],
    }
    found = ask(columns, ["fem:quick"], quantities=["force"])
    pressed = solve(paper(), Load(0.5, 0.2, friction="stick"), QUICK).response
    gripped = solve(paper(), Load(0.0, 0.5, friction="stick", grip=5.0), QUICK).response
    forces = found[["fem_force_x_N", "fem_force_N"]].to_numpy()
    expected = [[one.force[0], one.force[2]] for one in (pressed, gripped)]
    assert forces == pytest.approx(np.array(expected), rel=1e-6, abs=1e-9)


def test_solved_states_are_kept(ask):
    first = ask({"depth_mm": [0.5]}, ["fem:quick"])
    again = ask({"depth_mm": [0.5]}, ["fem:quick"], workers=0)
    pd.testing.assert_frame_equal(first, again)


def test_a_table_of_designs_and_loads_is_solved_with_an_accuracy_of_its_own(ask):
    designs = [paper(), replace(paper(), L=12.0, l0=11.0, nu=0.48)]
    loads = [Load(0.5, 0.2, friction="stick", plate_tilt=0.05), Load(0.0, 0.5, friction="stick", grip=5.0)]
    asked = cases.table(zip(designs, loads, ["rigid", "ignored"], strict=True))
    assert "D_mm" not in asked
    coarse = replace(QUICK, name="coarse", section_size=0.2, harmonics=1)
    found = ask(asked, [cases.FemModel("coarse", coarse)], quantities=["force"])
    for k, (design, load, magnet) in enumerate(zip(designs, loads, ["rigid", "ignored"], strict=True)):
        expected = solve(design, load, coarse, magnet=magnet).response.force
        row = found.iloc[k]
        assert [row["fem_force_x_N"], row["fem_force_N"]] == pytest.approx([expected[0], expected[2]], rel=1e-6)


def test_the_tolerance_chooses_for_each_row(ask):
    found = ask({"depth_mm": [0.5, 1.0]}, ["tolerance:5%", "paper"], quantities=["force"])
    assert (found["expected_error"] <= 0.05).all()
    assert found["chosen_force_N"].notna().all()


def test_a_table_without_rows_has_an_answer_without_rows(ask):
    assert len(ask(pd.DataFrame({"depth_mm": []}))) == 0


def test_a_column_that_stands_twice_is_refused(ask):
    with pytest.raises(BadInput, match="depth_mm stands twice"):
        ask(pd.DataFrame([[1.0, 2.0]], columns=["depth_mm", "depth_mm"]))


@pytest.mark.parametrize(
    ("columns", "options", "reason"),
    [
        ({"depht_mm": [1]}, {}, "there is no field 'depht_mm' .* did you mean depth_mm"),
        ({"depth": [1]}, {}, "did you mean depth_mm"),
        ({"L_mm": [10]}, {}, "neither depth_mm nor grip_mm"),
        ({"depth_mm": [1]}, {"models": "paper"}, "models must be a list of names; got 'paper'"),
        ({"depth_mm": [1]}, {"base": "paper"}, "base must be a geometry.design.Design"),
        ({"depth_mm": [1]}, {"reference": 3}, "reference must be the name of a model"),
        ({"depth_mm": [1]}, {"models": ["fim"]}, "there is no model 'fim'"),
        ({"depth_mm": [1]}, {"models": ["fem", "fem:standard"]}, "given twice"),
        ({"depth_mm": [1]}, {"models": []}, "no model"),
        ({"depth_mm": [1]}, {"quantities": ["modes"]}, "needs finite elements"),
        ({"depth_mm": [1]}, {"models": ["surrogate"], "quantities": ["critical_depth"]}, "needs finite elements"),
        ({"depth_mm": [1]}, {"models": ["fem", "tolerance:1%"]}, "chooses the finite elements"),
    ],
)
def test_what_cannot_be_asked_is_refused(ask, columns, options, reason):
    with pytest.raises(BadInput, match=reason):
        ask(columns, **options)


def test_a_critical_depth_needs_no_load_and_has_its_error(ask):
    """Quick finite elements of a slender beam against standard ones: the difference lies within both estimates."""
    slender = {"L_mm": [32.0], "l0_mm": [30.2]}
    rows = [ask(slender, [f"fem:{level}"], quantities=["critical_depth"]).iloc[0] for level in ("quick", "standard")]
    quick, standard = (row["critical_depth_mm"] for row in rows)
    assert [row["status"] for row in rows] == ["ok", "ok"]
    assert abs(quick / standard - 1) < sum(row["critical_depth_error_estimate"] for row in rows) < 0.05


@pytest.mark.parametrize(
    ("depth", "status", "judged", "text"),
    [
        (0.9, "ok", "ok", ""),
        (1.1, "ok", "unstable", "buckles sideways at 1 mm, now it is 1.1 mm deep"),
        (0.9, "unstable", "unstable", "on the finer mesh of the critical depth it is stable down to 1 mm"),
        (1.1, "not_converged", "not_converged", ""),
    ],
)
def test_a_state_is_called_unstable_where_it_or_the_critical_depth_says_so(depth, status, judged, text):
    critical = Answer(8.0, 1.0, None, "ok", "", 0.01, 0.0, values={"critical_depth_over_D": 1 / 8})
    problem = Problem(paper(), Load(depth), "rigid", "")
    found, message = with_critical(status, critical, problem)
    assert found == judged
    assert text in message


def test_a_search_without_a_critical_depth_says_how_far_it_went():
    none = Answer(8.0, 1.0, None, "ok", "", math.nan, 0.0, values={"stable_to_over_D": 0.25})
    text = "no critical depth down to 2 mm, where the search ends"
    assert with_critical("ok", none, Problem(paper(), Load(1.0), "rigid", "")) == ("ok", text)
