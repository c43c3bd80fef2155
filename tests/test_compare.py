import csv
import dataclasses
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from analytic import beam, hall
from fem import equilibrium
from fem.accuracy import QUICK
from fem.solution import Estimates, Facts
from geometry.bad_input import MeshError
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from geometry.relaxation import relaxation_of
from studies.mechanics import path_solver
from studies.output import result
from studies.simulation import compare, comparison_rows
from studies.simulation.comparison_rows import findings, sentences, with_reading_errors

DEPTHS = (0.5, 1.0)
BARE = Design(magnet_diameter=0.0, magnet_height=0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("compare")


@pytest.fixture(scope="module")
def found(folder):
    found = compare.run(paper(), accuracy=QUICK, depths=DEPTHS, shears=(0.0, 1.0), shear_depth=0.8)
    made = compare.result_of(paper(), found)
    result.write(made, folder, "")
    return made.tables


def test_press_rows_are_the_models_own_answers(found):
    loads = [Load(depth=depth) for depth in DEPTHS]
    for magnet, model in (("rigid", "fem"), ("ignored", "fem_homogeneous")):
        states = equilibrium.trace(paper(), loads, QUICK, magnet=magnet)
        for row, state in zip(found["press"], states, strict=True):
            assert row[f"{model}_force_N"] == pytest.approx(state.response.force[2], rel=1e-9)
            assert row[f"{model}_shift_z_mm"] == pytest.approx(state.response.shift[2], rel=1e-9)
    for row, load in zip(found["press"], loads, strict=True):
        formula = beam.solve(paper(), load)
        assert row["analytic_force_N"] == formula.force[2]
        assert row["force_error_percent"] == pytest.approx(100 * (formula.force[2] / row["fem_force_N"] - 1))
        seen = hall.readings(paper(), formula)
        assert row["analytic_S1_mT"] == pytest.approx(1e3 * seen.B_T[0])
        assert row["analytic_S1_V"] == pytest.approx(seen.V[0])
        assert row["status"] == "ok"


def test_shear_rows_carry_the_tilt_and_its_absence(found):
    still, moved = found["shear"]
    assert math.isnan(still["force_x_error_percent"])
    assert math.isnan(still["shift_x_error_percent"])
    assert moved["fem_tilt_rad"] > 0.02
    assert moved["analytic_tilt_rad"] == 0
    assert moved["analytic_force_x_N"] == pytest.approx(beam.cantilever_stiffness(paper()))
    shift = (moved["fem_shift_x_mm"], 0.0, moved["fem_shift_z_mm"])
    for name, tilt in (("fem", moved["fem_tilt_rad"]), ("untilted", 0.0)):
        seen = hall.readings(paper(), shift=shift, tilt=(0.0, tilt))
        for k in (1, 2, 3):
            assert moved[f"{name}_S{k}_mT"] == pytest.approx(1e3 * seen.B_T[k - 1])
            assert moved[f"{name}_S{k}_V"] == pytest.approx(seen.V[k - 1])


def test_full_scale_is_the_largest_change_from_rest(found):
    rest = [1e3 * value for value in hall.readings(paper()).B_T]
    rows = [*found["press"], *found["shear"]]
    first = max(abs(row["fem_S1_mT"] - rest[0]) for row in rows)
    others = [row[f"fem_S{k}_mT"] for row in rows for k in (2, 3) if f"fem_S{k}_mT" in row]
    second = max(abs(value - rest[1]) for value in others)
    for k, scale in ((1, first), (2, second), (3, second)):
        row = found["shear"][1]
        for model in ("untilted", "analytic"):
            error = 100 * (row[f"{model}_S{k}_mT"] - row[f"fem_S{k}_mT"]) / scale
            assert row[f"{model}_S{k}_error_percent_FS"] == pytest.approx(error)


def test_tables_name_their_units_and_hold_six_digits(found, folder):
    assert {path.name for path in folder.glob("[!.]*")} == {*compare.FILES, "run.json"}
    units = ("_mm", "_N", "_mT", "_V", "_rad", "_percent", "_percent_FS")
    for name in ("press", "shear"):
        with open(folder / f"{name}.csv", newline="", encoding="utf-8") as file:
            table = list(csv.DictReader(file))
        assert list(table[0]) == list(found[name][0])
        plain = {"status", "message", *(name for name in table[0] if name.endswith("error_estimate"))}
        assert all(column.endswith(units) for column in set(table[0]) - plain)
        for line, row in zip(table, found[name], strict=True):
            for key, value in row.items():
                if isinstance(value, float):
                    assert line[key] == ("" if math.isnan(value) else f"{value:.6g}")


def test_states_out_of_reach_keep_their_rows(monkeypatch):
    real = equilibrium.trace

    def stops(design, loads, *args, **kwargs):
        last = real(design, loads[:1], *args, **kwargs)[0]
        return [
            last,
            dataclasses.replace(last, facts=Facts("no_convergence"), message="stopped at depth 0.9 mm: why"),
        ]

    monkeypatch.setattr(equilibrium, "trace", stops)
    loads = [Load(depth=depth) for depth in (7.5, 0.5, 1.0, 1.5)]
    outcomes = path_solver.follow(paper(), loads, QUICK, "rigid")
    assert [outcome.status for outcome in outcomes] == ["bad_input", "ok", "not_converged", "not_converged"]
    rows = compare.rows_of("press", paper(), loads, outcomes, outcomes)
    assert [math.isnan(row["fem_force_N"]) for row in rows] == [True, False, True, True]
    assert [math.isnan(row["analytic_force_N"]) for row in rows] == [True, False, False, False]
    assert "7.5 mm" in rows[0]["message"]
    assert "stopped at depth 0.9 mm" in rows[3]["message"]
    assert findings(paper(), rows, [])["missing_states"] == 3


def test_a_failed_solve_is_not_hidden_by_an_unstable_one():
    unstable, lost = (
        path_solver.LoadOutcome(None, "unstable", "leans"),
        path_solver.LoadOutcome(None, "not_converged", "stopped"),
    )
    ended = path_solver.LoadOutcome(None, "ok", "")
    load = [Load(depth=0.5)]
    for rigid, bare, status in (
        (unstable, lost, "not_converged"),
        (lost, unstable, "not_converged"),
        (ended, unstable, "unstable"),
        (unstable, ended, "unstable"),
        (ended, ended, "ok"),
    ):
        (row,) = compare.rows_of("press", paper(), load, [rigid], [bare])
        assert row["status"] == status


def test_a_beam_without_a_magnet_has_forces_but_no_readings():
    found = compare.run(BARE, accuracy=QUICK, depths=(0.5,), shears=(0.0,), shear_depth=0.5)
    (row,) = found.press
    assert row["fem_force_N"] == row["fem_homogeneous_force_N"]
    assert math.isnan(row["fem_S1_mT"])
    text = " ".join(sentences("press", found.summary))
    assert "Readings" not in text
    assert "Voltage" not in text
    assert "nan" not in text


def row_of(kind, load, **known):
    """A row of the paper's sensor in which only these columns are known."""
    poses = dict.fromkeys(("fem", "fem_homogeneous", "analytic"))
    estimates = {"error_estimate": 0.01, "homogeneous_error_estimate": math.nan}
    return comparison_rows.row(kind, paper(), load, poses) | estimates | {"status": "ok", "message": ""} | known


def press_row(depth, rigid, homogeneous, volt=0.0):
    formula = beam.solve(paper(), Load(depth=depth))
    volts = hall.readings(paper(), formula).V[0]
    return row_of(
        "press",
        Load(depth=depth),
        fem_force_N=formula.force[2],
        analytic_force_N=formula.force[2],
        force_error_percent=rigid,
        homogeneous_force_error_percent=homogeneous,
        shift_error_percent=50.0,
        fem_S1_V=volts,
        analytic_S1_V=volts + volt,
        analytic_S1_error_percent_FS=9.0,
        analytic_S2_error_percent_FS=-8.0,
    )


def test_sentences_about_the_press_follow_the_figures():
    rows = [press_row(0.5, -60.0, -30.0), press_row(1.0, -40.0, -8.0), press_row(1.5, -30.0, 4.0)]
    found = findings(paper(), rows, [])
    bare, rigid, *_ = sentences("press", found)
    assert "within 5 % of the finite elements at 1.5 mm, and within 10 % at 1 to 1.5 mm" in bare
    assert "worst error is -30 %, at 0.5 mm" in bare
    assert "never within 10 %" in rigid
    assert found["press_error_estimate_percent"] == pytest.approx(1.0)
    good = [press_row(depth, 1.0, 7.0) for depth in (0.5, 1.0)]
    bare, rigid, *_ = sentences("press", findings(paper(), good, []))
    assert "within 5 % of the finite elements at none of the depths, and within 10 % at all depths (0.5 to 1" in bare
    assert "within 5 % of the finite elements at all depths (0.5 to 1 mm)" in rigid


def test_the_papers_claim_about_the_voltage_is_judged():
    agreeing = [press_row(depth, 0.0, 0.0) for depth in (1.0, 2.0, 3.0)]
    found = findings(paper(), agreeing, [])
    assert found["S1_V_against_force_error_percent_FS"] == pytest.approx(0.0, abs=1e-9)
    assert "agrees with the paper" in " ".join(sentences("press", found))
    wrong = [press_row(depth, 0.0, 0.0, volt=0.1) for depth in (1.0, 2.0, 3.0)]
    found = findings(paper(), wrong, [])
    rest, last = hall.readings(paper()).V[0], wrong[-1]["fem_S1_V"]
    assert found["S1_V_against_force_error_percent_FS"] == pytest.approx(100 * 0.1 / (last - rest))
    assert "do not confirm" in " ".join(sentences("press", found))


def test_the_secant_law_is_told_with_its_work_integral():
    found = findings(paper(), [press_row(3.0, 0.0, 0.0)], [])
    assert found["secant_force_N"] == pytest.approx(5 * math.pi)
    assert found["tangent_force_N"] == pytest.approx(3 * math.pi)
    assert found["area_over_hertz"] == pytest.approx(1.25)


def test_default_states_suit_the_design(monkeypatch):
    asked = []

    def nothing(design, loads, *args, **kwargs):
        asked.append(loads)
        raise MeshError("not now")

    monkeypatch.setattr(equilibrium, "trace", nothing)
    compare.run(paper())
    assert [load.depth for load in asked[0]] == pytest.approx([0.25 * k for k in range(1, 13)])
    assert [load.shear_x for load in asked[2]] == pytest.approx([0.5 * k for k in range(7)])
    assert {load.depth for load in asked[2]} == {1.0}
    del asked[:]
    flat = Design(L=4.3, magnet_diameter=0.0, magnet_height=0.0)
    compare.run(flat)
    assert max(load.depth for load in asked[0]) < 0.61 * flat.L


def test_a_chip_has_its_own_columns_in_mT(tmp_path):
    """Fields along its axes and what it sends, in counts; no volts. The formulas stand in for the finite elements."""
    design = Design(hall_layout="tmag5273a1")

    def solved(kind, loads):
        states = [
            SimpleNamespace(response=beam.solve(design, load), estimates=Estimates(force=0.01)) for load in loads
        ]
        outcomes = [path_solver.LoadOutcome(state, "ok", "") for state in states]
        return compare.rows_of(kind, design, loads, outcomes, outcomes)

    press = solved("press", [Load(depth=d) for d in DEPTHS])
    shear = solved("shear", [Load(depth=0.8, shear_x=s, friction="stick") for s in (0.0, 1.0)])
    rows = with_reading_errors(design, [*press, *shear])
    press, shear = rows[:2], rows[2:]
    seen = hall.readings(design, beam.solve(design, Load(depth=1.0)))
    pressed, sheared = press[1], shear[1]
    assert pressed["fem_chip_-z_mT"] == pytest.approx(1e3 * seen.B_T[0])
    assert pressed["fem_chip_-z_output_mT"] == pytest.approx(1e3 * seen.output[0])
    assert pressed["fem_chip_-z_output_mT"] != pressed["fem_chip_-z_mT"]
    assert sheared["analytic_chip_x_error_percent_FS"] == pytest.approx(0, abs=1e-9)
    assert not any(name.endswith("_V") or "S1" in name for name in (*pressed, *sheared))
    found = findings(design, press, shear)
    assert found["chip_-z_output_mT_against_force_error_percent_FS"] == pytest.approx(0, abs=1e-9)
    text = " ".join(found["sentences"])
    assert "Output of chip -z" in text
    assert "chip x" in text
    assert "S2" not in text
    result.write(compare.result_of(design, compare.Comparison(press, shear, found, [], [])), tmp_path, "")
    assert (tmp_path / "press.png").is_file()


ONE = replace(paper(), prony="0.5:2 0:1e-9 0:1e9", modulus="long-term")
TRAVEL = np.array([0.5, 1.0, 2.0])


def test_fast_and_slow_presses_have_both_moduli():
    force = TRAVEL**1.5
    assert comparison_rows.factors(ONE, TRAVEL, force, None, 1e9) == pytest.approx(2, rel=1e-6)
    assert comparison_rows.factors(ONE, TRAVEL, force, None, 1e-9) == pytest.approx(1, rel=1e-6)
    stiff = replace(ONE, modulus="instantaneous")
    assert comparison_rows.factors(stiff, TRAVEL, force, None, 1e-9) == pytest.approx(0.5, rel=1e-6)


def test_a_linear_spring_has_its_closed_form():
    t = TRAVEL / 0.5
    wanted = (0.5 + 0.5 * 2 / t * (1 - np.exp(-t / 2))) / 0.5
    assert comparison_rows.factors(ONE, TRAVEL, 3 * TRAVEL, None, 0.5) == pytest.approx(wanted, rel=1e-12)


def test_a_frequency_has_the_storage_modulus():
    G = relaxation_of(ONE).complex_modulus(2 * math.pi * 0.3)
    assert comparison_rows.factors(ONE, TRAVEL, TRAVEL, 0.3, None) == pytest.approx(G.real / 0.5, rel=1e-12)


def test_rows_without_a_force_have_none_at_a_rate():
    rows = [{"depth_mm": d, "fem_force_N": f} for d, f in ((0.5, 1.0), (1.0, math.nan), (2.0, 4.0))]
    one, lost, last = comparison_rows.with_rate(ONE, "press", rows, None, 1.0)
    assert math.isnan(lost["fem_force_at_rate_N"])
    assert last["fem_force_at_rate_N"] > 4
    assert one["fem_force_at_rate_change_percent"] == pytest.approx(100 * (one["fem_force_at_rate_N"] - 1))
    assert comparison_rows.with_rate(ONE, "press", rows, None, None) == rows
    assert "2 mm" in comparison_rows.rate_sentence(ONE, [one, lost, last], None, 1.0)


@pytest.mark.parametrize(
    ("rate", "part"),
    [
        ((1.0, 1.0), "leave one"),
        ((0.0, None), "above 0 Hz"),
        ((None, -1.0), "above 0 mm/s"),
        ((5e3, None), "not for 5000 Hz"),
    ],
)
def test_impossible_rates_are_refused(rate, part):
    with pytest.raises(BadInput, match=part):
        comparison_rows.check_rate(paper(), 3.0, *rate)


def test_readings_of_several_chips_have_errors_of_full_scale_along_z_and_aside():
    design = Design(hall_layout="tmag5273a1", chip_x=3.0, chip_count=2, l0=7.5)
    rest = comparison_rows.at_rest(design)
    names = ["chip1_-z", "chip1_x", "chip1_y", "chip2_-z", "chip2_x", "chip2_y"]
    changes = dict(zip(names, (1.0, 0.5, 0.0, 2.0, 0.25, 0.1), strict=True))
    row = {f"fem_{name}_mT": rest[k][0] + changes[name] for k, name in enumerate(names)}
    row |= {f"analytic_{name}_mT": row[f"fem_{name}_mT"] + 0.1 for name in names}
    (found,) = with_reading_errors(design, [row])
    assert found["analytic_chip1_-z_error_percent_FS"] == pytest.approx(5.0)
    assert found["analytic_chip2_y_error_percent_FS"] == pytest.approx(20.0)
