"""A table of cases: one row in, one row out, with the answers of solves and formulas one at a time."""

import json
import math
import time
from dataclasses import asdict, replace
from decimal import Decimal

import numpy as np
import pandas as pd
import pytest
import vl_convert
from stores import temporary

from analytic import beam
from analytic.relaxation_loops import loop
from fem.accuracy import QUICK
from fem.analyses.vibration import vibrating_sensor
from fem.equilibrium import solve
from fem.physics_version import PHYSICS
from fem.scene import Scene
from geometry.design import BadInput, paper
from geometry.loads import Load
from geometry.relaxation import relaxation_of
from studies import cases
from studies.answers import flat_rows, tidy
from studies.beam import surrogate_response
from studies.inputs.study_input import Factor, grid, problem
from studies.mechanics.model import Problem
from studies.mechanics.path_solver import Answer, answer, place
from studies.mechanics.solve_plan import Processes
from studies.mechanics.store import State
from studies.mechanics.study_cases import Cases, Plan, varied
from studies.mechanics.timed_quantities import STILL, PlateMotion
from studies.models import models_of
from studies.models.finite_elements import FemModel
from studies.sweeps import sweep
from studies.sweeps.answer_plot import plot
from studies.sweeps.study_rows import critical_verdict, with_critical


@pytest.fixture
def ask(tmp_path):
    def ask(columns, models=("paper",), **options):
        table = columns if isinstance(columns, pd.DataFrame) else pd.DataFrame(columns)
        return cases.answer(table, models, store=tmp_path / "states.sqlite", **options)

    return ask


def test_each_row_has_its_answers_by_all_models(ask):
    table = pd.DataFrame({"L_mm": [8, 10.0, 8], "E_MPa": [1.0, 2.0, 0.5], "depth_mm": 0.8}, index=["a", "b", "a"])
    found = ask(table, ["fem:quick", "finite", "surrogate"], quantities=["force", "shift", "sideways_stiffness"])
    assert list(found.index) == ["a", "b", "a"]
    assert list(found["status"]) == ["ok"] * 3
    assert (found["L_mm"].to_numpy() == table["L_mm"]).all()
    for k, (L, E) in enumerate([(8, 1.0), (10, 2.0), (8, 0.5)]):
        design, load = replace(paper(), L=L, l0=paper().l0 + L - paper().L, E=E), Load(depth=0.8)
        row = found.iloc[k]
        solved = solve(design, load, QUICK)
        assert row["fem_force_N"] == pytest.approx(solved.response.force[2], rel=1e-9)
        ratio = solved.facts.sideways_stiffness_ratio
        assert row["fem_sideways_stiffness_ratio"] == pytest.approx(ratio, rel=1e-9)
        assert math.isnan(row["surrogate_sideways_stiffness_ratio"])
        assert row["analytic_force_N"] == pytest.approx(beam.solve(design, load, "finite").force[2], rel=1e-12)
        estimate = surrogate_response.respond(design, load)
        assert row["surrogate_force_N"] == pytest.approx(estimate.response.force[2], rel=1e-9)
        assert row["surrogate_error_estimate"] == pytest.approx(estimate.errors["force"], rel=1e-9)
    # forces are proportional to E: the third row shares the solve of the first
    assert list(found["solve"]) == [1, 2, 1]


def test_a_sideways_stiffness_is_computed_where_it_is_asked_for(ask):
    columns = {"depth_mm": [0.3, 0.6]}
    before = ask(columns, ["fem:quick"], quantities=["force"])
    after = ask(columns, ["fem:quick"], quantities=["force", "sideways_stiffness"])
    assert ((after["fem_sideways_stiffness_ratio"] > 0.8) & (after["fem_sideways_stiffness_ratio"] < 1)).all()
    assert (after[["fem_force_N", "status"]] == before[["fem_force_N", "status"]]).all(axis=None)


def test_errors_are_relative_to_the_reference_that_is_named(ask):
    columns = {"depth_mm": [0.5, 1.0]}
    found = ask(columns, ["paper", "finite", "surrogate"], reference="finite", quantities=["force"])
    of_paper = 100 * (found["analytic_paper_force_N"] / found["analytic_finite_force_N"] - 1)
    assert found["analytic_paper_force_error_percent"].to_numpy() == pytest.approx(of_paper.to_numpy())
    assert "analytic_finite_force_error_percent" not in found
    with pytest.raises(BadInput, match="the reference 'fem' is not among the models"):
        ask(columns, ["paper"], reference="fem")


def test_the_reference_is_the_finest_model_whatever_their_order(ask):
    own = FemModel("coarse", replace(QUICK, section_size=0.25, section_patch=0.03))
    found = ask({"depth_mm": [0.5]}, ["fem:quick", own], quantities=["force"]).iloc[0]
    error = 100 * (found["fem_coarse_force_N"] / found["fem_quick_force_N"] - 1)
    assert found["force_error_percent"] == pytest.approx(error, rel=1e-9)
    assert found["fem_coarse_status"] == found["fem_quick_status"] == "ok"


def test_an_ignored_magnet_is_silicone_for_formulas_too(ask):
    columns = {"depth_mm": [1.0, 1.0], "magnet": ["rigid", "ignored"]}
    found = ask(columns, ["fem:quick", "finite"], quantities=["force", "decoded_force_error"])
    bare = replace(paper(), magnet_diameter=0.0, magnet_height=0.0)
    for design, force in zip([paper(), bare], found["analytic_force_N"], strict=True):
        assert force == pytest.approx(beam.solve(design, Load(1.0), "finite").force[2], rel=1e-12)
    assert found["force_error_percent"].abs().max() < 5
    # its field is there all the same, and the forces behind it are those of the silicone
    assert found["decoded_force_error_percent"].abs().max() < 10


def test_each_model_has_its_own_status(ask):
    """The surrogate refuses the deep press, a formula the tilted plate."""
    found = ask({"depth_mm": [1.0, 2.9]}, ["fem:quick", "surrogate", "finite"], quantities=["force"])
    assert list(found["surrogate_status"]) == ["ok", "bad_input"]
    # so near its critical depth the mesh does not tell whether the press is stable
    assert list(found["fem_status"]) == list(found["status"]) == ["ok", "unknown"]
    assert "the surrogate knows" in found["message"].iloc[1]
    found = ask({"depth_mm": [0.5, 0.5], "plate_tilt_deg": [0.0, 5.0]}, ["surrogate", "finite"], quantities=["force"])
    assert list(found["analytic_status"]) == list(found["status"]) == ["ok", "bad_input"]


def test_columns_of_ones_own_and_versions_come_with_the_answers(ask, capsys):
    own = {"measured_N": [4.0, math.nan, 1.0], "specimen": ["a", "b", "c"], 7: [1, 2, 3]}
    cells = pd.DataFrame({**own, "depth_mm": [1.0, -1.0, 0.5]}, index=[3, 3, 1])
    found = ask(cells, ["fem:quick", "surrogate"], quantities=["force"], progress=True)
    pd.testing.assert_frame_equal(found[list(own)], cells[list(own)])
    assert list(found["status"]) == ["ok", "bad_input", "ok"]
    assert "of 1 solves" in capsys.readouterr().err
    assert found.attrs["versions"]["physics"] == PHYSICS
    assert found.attrs["accuracies"]["quick"] == asdict(QUICK)
    assert found.attrs["columns"]["models"] == {"surrogate": "surrogate_", "quick": "fem_"}
    # as Parquet keeps them
    assert json.loads(json.dumps(found.attrs)) == found.attrs


def test_formulas_alone_open_no_store(ask, tmp_path):
    ask({"depth_mm": [1.0]}, ["paper", "surrogate"], quantities=["force"])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("quantities", [["force", "readings"], ["response", "modes", "critical_depth", "cycle"]])
def test_rows_that_are_all_refused_keep_their_columns(ask, quantities):
    rate = {"speed_mm_per_s": [1.0, 1.0]} if "cycle" in quantities else {}
    models, options = ["fem:quick", "paper", "surrogate"], {"quantities": quantities}
    lost = ask({"depth_mm": ["x", "y"]} | rate, models, **options)
    assert list(lost["status"]) == list(lost["fem_status"]) == ["bad_input"] * 2
    if not rate:
        assert list(lost) == list(ask({"depth_mm": [0.5, 0.5]}, models, **options))


def test_rows_without_a_grip_share_a_problem():
    table = cases.table([(paper(), Load(0.5), "rigid")] * 3)
    factor = Factor(("depth", "grip"), (table["depth_mm"].to_numpy(), table["grip_mm"].to_numpy()))
    assert np.isnan(factor.values[1]).all()
    assert len(Cases(replace(PLAN, factors=(factor,))).distinct_problems()) == 1


def test_a_law_without_its_numbers_is_the_neo_hookean_one(ask):
    columns = {"law": ["neo-hookean", "yeoh", "ogden"], "depth_mm": [0.5] * 3}
    found = ask(columns, ["fem:quick", "surrogate"], quantities=["force"])
    assert list(found["solve"]) == [1, 1, 1]
    # a row of a Gaussian process sums terms of up to 4e5 to a number near 1: its rounding errors are as many times
    # those of one number; they differ between the rows on some processors
    surrogate = found["surrogate_force_N"].tolist()
    assert surrogate == pytest.approx([surrogate[0]] * 3, rel=4e5 * np.finfo(float).eps)
    other = ask({"law": ["yeoh"], "yeoh_2": [0.1], "depth_mm": [0.5]}, ["finite"]).iloc[0]
    assert "the formulas use E and nu only, not the law yeoh" in other["message"]


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
    cells = [
        1,
        np.int8(1),
        Decimal("1"),
        "1",
        1j,
        True,
        None,
        pd.NA,
        pd.Timedelta(1),
        Decimal("sNaN"),
        10**5000,
        -(10**400),
    ]
    found = ask({"depth_mm": cells}, quantities=["force"])
    assert list(found["status"]) == ["ok"] * 3 + ["bad_input"] * 9
    assert found["message"].iloc[3] == "depth_mm must be a number; got '1'"
    assert found["message"].iloc[-1] == "depth_mm must be a finite number; got -inf"
    grips = ask(
        {"depth_mm": [1.0] * 5, "grip_mm": [math.nan, None, pd.NA, Decimal("NaN"), "x"]}, quantities=["force"]
    )
    assert list(grips["status"]) == ["ok"] * 4 + ["bad_input"]


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


def test_a_table_of_designs_and_loads_is_solved_with_an_accuracy_of_its_own(ask):
    designs = [paper(), replace(paper(), L=12.0, l0=11.0, nu=0.48)]
    loads = [Load(0.5, 0.2, friction="stick", plate_tilt=0.05), Load(0.0, 0.5, friction="stick", grip=5.0)]
    asked = cases.table(zip(designs, loads, ["rigid", "ignored"], strict=True))
    assert "D_mm" not in asked
    # the elements of the second sensor do not stay in the base of the first
    assert list(asked["l0_mm"]) == [7.2, 11.0]
    coarse = replace(QUICK, name="coarse", section_size=0.2, harmonics=1)
    found = ask(asked, [cases.FemModel("coarse", coarse)], quantities=["force"])
    for k, (design, load, magnet) in enumerate(zip(designs, loads, ["rigid", "ignored"], strict=True)):
        expected = solve(design, load, coarse, magnet=magnet).response.force
        row = found.iloc[k]
        assert [row["fem_force_x_N"], row["fem_force_N"]] == pytest.approx([expected[0], expected[2]], rel=1e-6)


def test_a_table_keeps_what_designs_say_of_their_elements_and_branches(ask):
    designs = [replace(paper(), L=12.0), replace(paper(), prony="0.2:0.1 0.1:1")]
    asked = cases.table([(design, Load(0.5), "rigid") for design in designs])
    assert list(asked["l0_mm"]) == [7.2, 7.2]
    assert list(asked["prony"]) == ["", "0.2:0.1 0.1:1"]
    found = ask(asked, ["paper"], quantities=["force", "readings"])
    assert list(found["l0_mm"]) == [7.2, 7.2]
    wrong = ask(asked.assign(prony=["0.2:x", 1.0]), ["paper"], quantities=["force"])
    assert list(wrong["status"]) == ["bad_input"] * 2


def test_the_tolerance_chooses_for_each_row(ask):
    found = ask({"depth_mm": [0.5, 1.0]}, ["tolerance:5%", "paper"], quantities=["force"])
    assert (found["expected_error"] <= 0.05).all()
    assert found["chosen_force_N"].notna().all()


def test_a_plot_has_units_bars_and_a_mark_for_each_answer(ask, tmp_path):
    columns = {"depth_mm": [0.5, 1.0, 2.9], "shear_mm": 0.8, "E_MPa": [1.0, 2.0, 1.0], "measured_N": [0.4, 1.1, 0.3]}
    found = ask(columns, ["surrogate", "finite"], quantities=["force", "shift"])
    chart = plot(found, x="depth_mm", y="force_x_N")
    drawn = chart.to_dict()
    assert vl_convert.vegalite_to_vega(drawn)
    titles = {
        way: {
            layer["encoding"][way]["title"] for layer in drawn["layer"] if "title" in layer["encoding"].get(way, {})
        }
        for way in "xy"
    }
    assert titles == {"x": {"depth (mm)"}, "y": {"force along the shear (N)"}}
    data = chart.data.set_index(["series", "depth (mm)"])
    assert data.loc["surrogate", "failed"].tolist() == [False, False, True]
    # relative to the force along the shear, not to the press force; formulas state no error
    half = found["surrogate_force_x_N"] * found["sideways_error_estimate"]
    bars = data["high"] - data["force along the shear (N)"]
    assert bars["surrogate"].to_numpy() == pytest.approx(half.to_numpy(), nan_ok=True)
    assert bars["formula, level finite"].isna().all()
    shift = plot(found, x="depth_mm", y="surrogate_shift_z_mm", color="E_MPa").data
    size = np.hypot(found["surrogate_shift_z_mm"], found["surrogate_shift_x_mm"]) * found["shift_error_estimate"]
    assert sorted((shift["high"] - shift["low"]).dropna() / 2) == pytest.approx(sorted(size.dropna()))
    assert set(shift["series"]) == {"E = 1 MPa", "E = 2 MPa"}
    # samples are points, which no line joins
    samples = pd.DataFrame(np.random.default_rng(0).random((9, 2)) + 0.5, columns=["depth_mm", "E_MPa"])
    drawn = plot(ask(samples, quantities=["force"]), "depth_mm", "force_N").to_dict()
    assert [layer["mark"]["type"] for layer in drawn["layer"]] == ["point"]
    # a file of the table has lost what belongs to which model, but for the names of the columns
    found.to_csv(tmp_path / "answers.csv")
    read = plot(pd.read_csv(tmp_path / "answers.csv"), "depth_mm", ["surrogate_force_x_N", "measured_N"]).data
    assert set(read["series"]) == {"surrogate", "measured"}


@pytest.mark.parametrize(
    ("models", "bars"),
    [
        (["quick", "finite"], "estimated errors of finite elements."),
        (["surrogate", "finite"], "90 % intervals of the surrogate."),
        (["quick", "surrogate"], "90 % intervals of the surrogate, estimated errors of finite elements."),
        (["paper", "finite"], None),
    ],
)
def test_a_plot_says_what_the_bars_of_its_own_models_are(ask, models, bars):
    found = ask({"depth_mm": [0.5, 1.0]}, models, quantities=["force"])
    title = plot(found, "depth_mm", "force_N").to_dict().get("title", {"text": []})["text"]
    said = [text for text in title if text.startswith("Bars")]
    assert said == ([f"Bars, where longer than the marker: {bars}"] if bars else [])


@pytest.mark.parametrize(
    ("axes", "reason"),
    [
        ({"x": "depth", "y": "force_N"}, "x must be a column of the answers; got 'depth': did you mean depth_mm"),
        ({"x": "depth_mm", "y": "force"}, "the answers have no 'force': did you mean force_N"),
        ({"x": "depth_mm", "y": ["force_N", "shift_z_mm"]}, "force_N and shift_z_mm have other units"),
        ({"x": "depth_mm", "y": "force_N", "color": "depth_mm"}, "depth_mm has 8 values, and 7 colours can be told"),
        ({"x": "depth_mm", "y": 1.0}, "y must be the name of a column, or a list of names; got .1.0."),
        ({"x": "depth_mm", "y": "lost_N"}, "no row has an answer for lost_N: see the columns status and message"),
    ],
)
def test_what_cannot_be_plotted_is_refused(ask, axes, reason):
    found = ask({"depth_mm": np.linspace(0.1, 0.8, 8), "lost_N": math.nan}, quantities=["force", "shift"])
    with pytest.raises(BadInput, match=reason):
        plot(found, **axes)


@pytest.mark.parametrize(
    ("names", "ranges", "reason"),
    [
        ([], {}, "no field is given"),
        (["depth"], {}, r"depth has no bounds of its own: give a range, such as depth=\(1, 2\)"),
        (["nu"], {"nu": (0.4, 0.5)}, "nu is given twice"),
        ([], {"D": (10, 6)}, r"the range of D must be \[low, high\] with low < high"),
        ([], {"D": 8}, r"the range of D must be \[low, high\]; got 8"),
        ([], {"law": ("yeoh", "ogden")}, "law has names, not numbers"),
        ([], {"d": (6, 10)}, "there is no axis 'd': did you mean D"),
    ],
)
def test_a_problem_of_samples_is_refused(names, ranges, reason):
    with pytest.raises(BadInput, match=reason):
        problem(*names, **ranges)


@pytest.mark.parametrize(
    ("columns", "options", "reason"),
    [
        (
            {"depht_mm": [1]},
            {},
            "there is no field 'depht_mm' .* did you mean depth_mm, or is it a column of your own",
        ),
        ({"depth_mm": [1], "D": [8]}, {}, "there is no field 'D' .* did you mean D_mm"),
        ({"depth_mm": [1], "silicone": ["Ecoflex"]}, {}, "silicone is a text of the design, .* state it in base"),
        ({"depth_mm": [1], "analytic_force_N": [1]}, {}, "the column analytic_force_N has the name of an answer"),
        ({"depth_mm": [1]}, {"progress": 1}, "progress must be True, or a function .* got 1"),
        ({"L_mm": [10]}, {}, "neither depth_mm nor grip_mm"),
        ({"L_over_D": [1], "L_mm": [9], "depth_mm": [1]}, {}, "L is given twice, as columns L_over_D and L_mm"),
        ({"depth_mm": [1]}, {"models": "paper"}, r"models must be a list of names, such as \['paper'\]; got 'paper'"),
        ({"depth_mm": [1]}, {"models": ["fim"]}, "there is no model 'fim'"),
        (
            {"depth_mm": [1]},
            {"models": ["fem", "fem:standard"]},
            "models fem and fem:standard have one name in tables, standard: give one",
        ),
        ({"depth_mm": [1]}, {"models": ["fem:quick", FemModel("quick", QUICK)]}, "two models have the name quick"),
        ({"depth_mm": [1]}, {"models": ["paper", FemModel("paper", QUICK)]}, "two models have the name paper"),
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
    tables = [ask(slender, [f"fem:{level}"], quantities=["critical_depth"]) for level in ("quick", "standard")]
    assert tidy(tables[0]).part.tolist() == ["critical_depth", "critical_force", "stable_to"]
    rows = [table.iloc[0] for table in tables]
    quick, standard = (row["critical_depth_mm"] for row in rows)
    assert [row["status"] for row in rows] == ["ok", "ok"]
    assert abs(quick / standard - 1) < sum(row["critical_depth_error_estimate"] for row in rows) < 0.05


@pytest.mark.parametrize(
    ("depth", "status", "judged", "text"),
    [
        (0.9, "ok", "ok", ""),
        (1.1, "ok", "unstable", "buckles sideways at 1 mm, now it is 1.1 mm deep"),
        (1.1, "unknown", "unstable", "buckles sideways at 1 mm, now it is 1.1 mm deep"),
        (0.9, "unknown", "ok", "on the finer mesh of the critical depth it is stable down to 1 mm"),
        (0.9, "unstable", "unstable", "on the finer mesh of the critical depth it is stable down to 1 mm"),
        (0.995, "ok", "unknown", "buckles sideways at 1 mm +- 1 %, now it is 0.995 mm deep"),
        (1.005, "ok", "unknown", "buckles sideways at 1 mm +- 1 %"),
        (1.005, "unstable", "unstable", "buckles sideways at 1 mm +- 1 %"),
        (1.1, "not_converged", "not_converged", ""),
    ],
)
def test_a_state_is_called_unstable_where_it_or_the_critical_depth_says_so(depth, status, judged, text):
    critical = Answer(8.0, 1.0, None, "ok", "", 0.01, 0.0, values={"critical_depth_over_D": 1 / 8})
    problem = Problem(paper(), Load(depth), "rigid", "", STILL)
    found, message = with_critical(status, critical, problem)
    assert found == judged
    assert text in message


@pytest.mark.parametrize(
    ("depth", "status", "judged"),
    [(0.5, "ok", "unknown"), (0.999, "ok", "unknown"), (1.001, "ok", "unknown"), (1.1, "unstable", "unstable")],
)
def test_a_critical_depth_of_unknown_error_tells_nothing_from_itself(depth, status, judged):
    critical = Answer(8.0, 1.0, None, "ok", "", math.nan, 0.0, values={"critical_depth_over_D": 1 / 8})
    found, message = with_critical(status, critical, Problem(paper(), Load(depth), "rigid", "", STILL))
    assert found == judged
    assert "at 1 mm with an unknown error" in message


@pytest.mark.parametrize(
    ("load", "judged"),
    [
        (Load(1.1, friction="stick"), "unstable"),
        (Load(1.1, 0.5, friction="stick"), "ok"),
        (Load(1.1, friction=0.3), "ok"),
        (Load(1.1, plate_tilt=0.1), "ok"),
        (Load(1.1, imperfection=1e-3), "ok"),
    ],
)
def test_a_critical_depth_judges_frictionless_presses_only(load, judged):
    """What is glued or rubbed is held, and an imperfection leads to another branch."""
    critical = Answer(8.0, 1.0, None, "ok", "", 0.01, 0.0, values={"critical_depth_over_D": 1 / 8})
    assert with_critical("ok", critical, Problem(paper(), load, "rigid", "", STILL))[0] == judged


@pytest.mark.parametrize(
    ("kept", "ratio", "status"),
    [
        ("ok", 0.3, "ok"),
        ("ok", 0.016, "unknown"),
        ("unstable", -0.016, "unknown"),
        ("unstable", -0.3, "unstable"),
        ("unstable", 0.016, "unstable"),
    ],
)
def test_the_stability_of_a_kept_press_is_judged_where_it_is_read(kept, ratio, status):
    """Stores have presses that were called stable beyond the critical depth, or unstable for another reason."""
    response = {
        "force": [0.0, 0.0, 1.0],
        "shift": [0.0, 0.0, -0.5],
        "tilt": 0.0,
        "contact_radius": 2.0,
        "tilt_y": 0.0,
    }
    values = {"D_mm": 8.0, "E_MPa": 1.0, "response": response, "error_estimate": 0.01, "message": "kept"}
    values |= {"values": {"sideways_stiffness_ratio": ratio, "largest_strain": 0.1}}
    found = answer(State(0.2, 0.0, "ok", kept, values, 1.0, ""), 0.09)
    assert found.status == status
    assert found.values["sideways_half_width"] == pytest.approx(0.08, abs=0.025)
    assert ("sideways is not known: its sideways stiffness is" in found.message) is (status == "unknown")


@pytest.mark.parametrize(
    ("values", "message", "verdict"),
    [
        ({"critical_depth_over_D": 0.1, "stable_to_over_D": 0.1}, "", "buckles"),
        ({"critical_depth_over_D": None, "stable_to_over_D": 0.3}, "", "stable"),
        (
            {"critical_depth_over_D": None, "stable_to_over_D": 0.3},
            "the press does not converge beyond 2 mm",
            "unknown",
        ),
        ({}, "not solved", "unknown"),
    ],
)
def test_a_search_that_ended_early_leaves_unknown_whether_a_press_buckles(values, message, verdict):
    assert critical_verdict(Answer(8.0, 1.0, None, "ok", message, 0.01, 0.0, values=values)) == verdict


# Cases of a study: batches of any cut are the same cases, and codes tell apart what the mechanics depend on.


PLAN = Plan(
    paper(),
    (*grid({"f": [5.0, 6.0], "D": [7.0, 8.0, 3.0]}), Factor(("E", "depth"), ((1.0, 2.0), (0.5, 1.0)))),
    {},
    "rigid",
    models_of(["quick", "paper"]),
    ("force",),
)

NORTH = (Factor(("magnet_north",), (("down", "up"),)),)


def seen(cases, indices):
    """The values, sensors and problems of cases."""
    batch = cases.batch(np.array(indices))
    return [
        (
            {name: values[k] if name == "magnet_north" else float(values[k]) for name, values in batch.axes.items()},
            float(batch.E[k]),
            batch.sensors[batch.sensor[k]],
            batch.problems[batch.problem[k]],
        )
        for k in range(len(batch))
    ]


def test_batches_do_not_depend_on_how_the_study_is_cut():
    cases = Cases(PLAN)
    alone = [seen(Cases(PLAN), [k])[0] for k in range(PLAN.count)]
    together = seen(cases, range(PLAN.count))
    for one, other in zip(alone, together, strict=True):
        assert one[:3] == other[:3]
        # f does not change the mechanics: problems may come from a case with another f
        assert (one[3].load, one[3].message) == (other[3].load, other[3].message)
        if one[3].design is not None:
            assert one[3].design.shape == other[3].design.shape
    part = cases.batch(np.arange(PLAN.count)).part(3, 7)
    assert part.axes["D"].tolist() == [row[0]["D"] for row in alone[3:7]]


def test_f_and_E_make_no_further_problems():
    assert Cases(PLAN).distinct_problems().tolist() == [0, 1, 2, 3, 4, 5]
    only_E = Plan(**{name: getattr(PLAN, name) for name in PLAN.__slots__} | {"factors": grid({"E": [1.0, 2.0]})})
    assert Cases(only_E).distinct_problems().tolist() == [0]
    turned = Plan(**{name: getattr(PLAN, name) for name in PLAN.__slots__} | {"factors": NORTH})
    assert Cases(turned).distinct_problems().tolist() == [0]
    assert [row[2].magnet_north for row in seen(Cases(turned), range(2))] == ["down", "up"]
    lossy = Plan(
        **{name: getattr(PLAN, name) for name in PLAN.__slots__} | {"factors": grid({"loss_factor": [0.1, 0.2]})}
    )
    assert Cases(lossy).distinct_problems().tolist() == [0]
    pushed = Plan(**{name: getattr(only_E, name) for name in PLAN.__slots__} | {"load": {"imperfection": 0.01}})
    # a dead force is not proportional to E
    assert Cases(pushed).distinct_problems().tolist() == [0, 1]


def test_the_elements_stay_in_the_base_unless_l0_varies():
    assert varied(paper(), {"D": 10.0}).l0 == pytest.approx(6.2)
    assert varied(paper(), {"D": 10.0, "l0": 7.0}).l0 == 7.0
    # a higher magnet needs more than the base design's l0 only before the elements are moved away
    base = replace(paper(), l0=1.5)
    assert varied(base, {"L": 12.0, "magnet_height": 4.0}).l0 == pytest.approx(4.5)


# Vibrations and loading cycles: keys of similar designs, answers, and what is refused.


ROUGH = replace(QUICK, name="rough", section_size=0.25, section_patch=0.03, harmonics=1)
LOSSY = replace(paper(), loss_high=2500.0)


def run(design, axes, load, kept, quantities=("response",), accuracy=ROUGH):
    """The flat rows of a sweep."""
    factors = axes if isinstance(axes, tuple) else grid(axes)
    plan = Plan(design, factors, load, "rigid", (FemModel("rough", accuracy),), quantities)
    return [row for table in sweep.run(plan, None, kept, processes=Processes(0)) for row in flat_rows(table)]


def gain_of(load, motion, at):
    """The magnet's shift along a motion over the force, over that at 1 Hz, as a complex number, without splines."""
    shaken = vibrating_sensor(LOSSY, load, (1.0, at), ROUGH).at([1.0, at])
    k, along = shaken.motions.index(motion), ("x", "z").index(motion)
    slow, fast = shaken.shift[:, k, along] / shaken.force[:, k, along]
    return fast / abs(slow) * np.sign(slow.real)


def test_gain_and_phase_are_those_of_the_vibration():
    with temporary() as kept:
        first, _, last = run(
            LOSSY, {"frequency": [600.0, 800.0, 1450.0]}, {"depth": 0.5}, kept, ("force", "response")
        )
        assert kept.counts() == (2, 2), "one static path, and one vibration for all frequencies"
    for row, frequency in ((first, 600.0), (last, 1450.0)):
        gain = gain_of(Load(depth=0.5), "z", frequency)
        assert row["response_gain"] == pytest.approx(abs(gain), rel=2e-4)
        assert row["response_phase_deg"] == pytest.approx(np.degrees(np.angle(gain)), abs=0.02)
    assert first["status"] == "ok"
    # the loss factor of 0.1 makes a resonance of Q = 10
    assert first["response_Q"] == pytest.approx(10, rel=0.1)
    assert np.isnan(first["response_bandwidth_Hz"]), "the mesh carries no frequency with a gain 3 dB lower"


def test_the_loss_factor_and_the_modulus_at_rest_change_the_vibration():
    axes = {"loss_factor": [0.1, 0.2], "modulus": ["long-term", "instantaneous"]}
    with temporary() as kept:
        rows = run(LOSSY, axes, {"depth": 0.5}, kept)
    assert [row["response_Q"] > 7 for row in rows] == [True, True, False, False]
    assert rows[1]["response_resonance_Hz"] < rows[0]["response_resonance_Hz"]
    # the larger loss factor stiffens the silicone by half between 1 Hz and the resonance
    assert 10 < rows[2]["response_bandwidth_Hz"] < 200


def test_a_shear_in_any_direction_is_solved_along_x():
    one, other = (
        place(Scene(paper(), (Load(0.5, x, y, friction="stick"),), ROUGH, "rigid"), "response")
        for x, y in ((0.5, 0.0), (0.3, -0.4))
    )
    assert one.content == other.content


# Cycles

BRANCHES = replace(paper(), prony="0.1:0.05 0.1:0.5 0:1e-3 0:1e3", modulus="instantaneous")


def content_of(design, load, motion):
    """What the answer to a cycle depends on."""
    return place(Scene(design, (load,), QUICK, "rigid"), "cycle", motion).content


def test_similar_designs_with_the_same_product_of_time_and_rate_share_a_cycle():
    load = Load(0.5, 0.3, 0.4, friction="stick")
    slow = replace(BRANCHES, prony="0.1:0.5 0.1:5 0:1e-3 0:1e3")
    assert content_of(BRANCHES, load, PlateMotion(speed=1.0)) == content_of(slow, load, PlateMotion(speed=0.1))
    stiff = replace(BRANCHES, E=3.0, density=900.0)
    assert content_of(BRANCHES, load, PlateMotion(2.0)) == content_of(stiff, load, PlateMotion(2.0))
    assert content_of(BRANCHES, load, PlateMotion(2.0)) != content_of(slow, load, PlateMotion(2.0))
    assert content_of(BRANCHES, load, PlateMotion(2.0)) != content_of(BRANCHES, load, PlateMotion(None, 2.0))
    relaxed = replace(BRANCHES, modulus="long-term")
    assert content_of(BRANCHES, load, PlateMotion(2.0)) != content_of(relaxed, load, PlateMotion(2.0))


def test_a_sweep_has_the_loops_of_a_cycle():
    """The sine's gap is near that of a linear spring, and E scales forces and areas; one path serves both."""
    with temporary() as kept:
        soft, hard = run(
            BRANCHES, {"E": [1.0, 3.0]}, {"depth": 0.5, "frequency": 2.0}, kept, ("force", "cycle"), QUICK
        )
        assert kept.counts() == (2, 2), "the static path and the cycles"
    linear = 100 * loop(relaxation_of(BRANCHES), 2.0, "sine").hysteresis
    assert PHYSICS["cycle"] == 3, "write the answer of the new version here"
    assert soft["loop_gap_percent"] == pytest.approx(linear, rel=0.3)
    assert soft["frequency_Hz"] == 2.0
    assert 0.8 * soft["fem_force_N"] < soft["loop_largest_force_N"] < soft["fem_force_N"]
    for name in ("loop_area_mJ", "loop_largest_force_N"):
        assert hard[name] == pytest.approx(3 * soft[name], rel=1e-9)


@pytest.mark.parametrize(
    ("kind", "load", "motion", "part"),
    [
        ("response", Load(depth=0.5), PlateMotion(5000.0), "known from 1 to"),
        ("response", Load(depth=0.5), PlateMotion(0.5), "got 0.5 Hz: take 1 Hz or more"),
        ("response", Load(depth=0.5, plate_tilt=0.1), PlateMotion(), "needs an upright plate"),
        ("response", Load(depth=0.5, friction=0.3), PlateMotion(), "needs an upright plate"),
        ("cycle", Load(depth=0.5), PlateMotion(), "needs a rate"),
        ("cycle", Load(depth=0.5), PlateMotion(frequency=1e6), "speak for"),
        ("cycle", Load(depth=0.5, plate_tilt=0.1), PlateMotion(1.0), "upright plate"),
        ("cycle", Load(shear_x=0.5, grip=1.0), PlateMotion(1.0), "upright plate"),
    ],
)
def test_what_cannot_vibrate_or_makes_no_cycle_is_refused(kind, load, motion, part):
    with pytest.raises(BadInput, match=part):
        place(Scene(BRANCHES if kind == "cycle" else paper(), (load,), QUICK, "rigid"), kind, motion)
