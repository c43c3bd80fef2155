import csv
import math

import pandas as pd
import pytest
from conftest import ROUGH

from analytic import beam, hall
from fem import equilibrium
from geometry.design import Design, paper
from geometry.loads import Load
from studies.cases import answer
from studies.output import result
from studies.simulation import compare, comparison_rows
from studies.simulation.comparison_rows import findings, with_reading_errors

DEPTHS = (0.5, 1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("compare")


@pytest.fixture(scope="module")
def found(folder):
    press, shear = [Load(d) for d in DEPTHS], [Load(0.8, s, friction="stick") for s in (0.0, 1.0)]
    made = compare.run(paper(), (press, shear), accuracy=ROUGH)
    result.write(made, folder, "")
    return made.tables


def test_press_rows_are_the_models_own_answers(found):
    loads = [Load(depth=depth) for depth in DEPTHS]
    for magnet, model in (("rigid", "fem"), ("ignored", "fem_homogeneous")):
        states = equilibrium.trace(paper(), loads, ROUGH, magnet=magnet)
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


def test_a_beam_that_gave_way_has_no_error_along_the_shear():
    names = ("force_x_N", "force_z_N", "force_N", "shift_x_mm", "shift_z_mm", "contact_radius_mm", "tilt_rad")
    values = dict.fromkeys(names, 1.0) | {"shear_mm": [0.0, 1.0, 2.0], "depth_mm": 0.8, "tilt_y_rad": 0.0}
    values |= {"shift_y_mm": 0.0, "error_estimate": 0.01, "sideways_error_estimate": 0.01}
    whole = pd.DataFrame(values).assign(status="ok", message="")
    pushed = whole.assign(force_x_N=[0.0, 0.5, -0.5])
    bare = Design(magnet_diameter=0.0, magnet_height=0.0)
    rows = comparison_rows.table("shear", bare, {"fem": pushed, "fem_homogeneous": whole, "analytic": whole})
    assert rows["force_x_error_percent"].tolist() == pytest.approx([math.nan, 100.0, math.nan], nan_ok=True)
    assert rows["homogeneous_force_x_error_percent"].tolist() == pytest.approx([math.nan, 0.0, 0.0], nan_ok=True)


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


def test_a_chip_has_its_own_columns_in_mT():
    """Fields along its axes and what it sends, in counts; no volts. The formulas stand in for the finite elements."""
    design = Design(hall_layout="tmag5273a1")

    def answered(kind, shears, depth):
        cases = pd.DataFrame({"depth_mm": depth, "shear_mm": shears, "friction": "stick"})
        formula = answer(cases, ["paper"], base=design, quantities=["force", "shift", "tilt", "contact_radius"])
        formula = formula.rename(columns=lambda name: name.removeprefix("analytic_"))
        formula = formula.assign(error_estimate=0.01, sideways_error_estimate=0.01)
        return comparison_rows.table(kind, design, dict.fromkeys(("fem", "fem_homogeneous", "analytic"), formula))

    parts = answered("press", (0.0, 0.0), DEPTHS), answered("shear", (0.0, 1.0), 0.8)
    press, shear = with_reading_errors(design, *parts)
    seen = hall.readings(design, beam.solve(design, Load(depth=1.0)))
    pressed, sheared = press.iloc[1], shear.iloc[1]
    assert pressed["fem_chip_-z_mT"] == pytest.approx(1e3 * seen.B_T[0])
    assert pressed["fem_chip_-z_output_mT"] == pytest.approx(1e3 * seen.output[0])
    assert pressed["fem_chip_-z_output_mT"] != pressed["fem_chip_-z_mT"]
    assert sheared["analytic_chip_x_error_percent_FS"] == pytest.approx(0, abs=1e-9)
    assert not any(name.endswith("_V") or "S1" in name for name in (*press, *shear))
    found = findings(design, press, shear)
    assert found["chip_-z_output_mT_against_force_error_percent_FS"] == pytest.approx(0, abs=1e-9)
    text = " ".join(found["sentences"])
    assert "Output of chip -z" in text
    assert "chip x" in text
    assert "S2" not in text
    lost = findings(design, press, shear.assign(force_x_error_percent=math.nan))
    assert "the beam gave way" in " ".join(lost["sentences"])
