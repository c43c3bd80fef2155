"""Means of the errors of the formulas' levels, and the pages of `ladder`."""

import pandas as pd
import pytest
from conftest import ROUGH

from analytic import beam
from fem.accuracy import LEVELS
from fem.equilibrium import solve
from geometry.loads import Load
from studies.output import goals, result
from studies.validation import error_study_cases
from studies.validation.formulas import ladder

PRESS = {"sinking_error": 0.03, "press_force_error": -0.04}
SHEAR = {"sinking_error": 0.01, "press_under_shear_error": 0.02, "shear_force_error": 0.05, "shift_error": 0.01}
SHEAR |= {"tilt_error": -0.1}
SIZES = {"D_mm": 8.0, "L_over_D": 1.125, "magnet_diameter_over_D": 0.5, "magnet_height_over_D": 0.25}


def state(level, depth, shear, errors, design=0, status="ok", message=""):
    place = {"design": design, **SIZES, "depth_over_D": depth, "shear_over_D": shear, "level": level}
    return place | {"outside": "", "status": status, "message": message} | errors


@pytest.fixture
def comparisons():
    """For each level two presses and a shear of one design; of another, a press that no level takes."""
    found = []
    for level in beam.LEVELS:
        found += [state(level, 0.06, 0.0, PRESS), state(level, 0.18, 0.0, PRESS), state(level, 0.12, 0.05, SHEAR)]
        found.append(state(level, 0.06, 0.0, {}, design=1, status="refused", message="it is too deep"))
    return pd.DataFrame(found)


def test_a_mean_is_the_root_mean_square_of_the_states_that_have_the_error(comparisons):
    (means,) = ladder.by_design(comparisons, "finite").to_dict("records")
    assert means["press_force_error_percent"] == pytest.approx(4)
    assert means["sinking_error_percent"] == pytest.approx(100 * ((2 * 0.03**2 + 0.01**2) / 3) ** 0.5)
    assert means["tilt_error_percent"] == pytest.approx(10)
    assert ladder.by_design(comparisons[:1], "paper")["tilt_error_percent"].isna().all()


def test_regions_count_their_states_and_a_refused_one_is_in_none(comparisons):
    best = ladder.summary(comparisons).query("level == 'finite'")
    assert dict(zip(best["region"], best["states"], strict=True)) == {
        "press to 0.06 D": 1,
        "press to D/4": 1,
        "shear of 0.05 D": 1,
        "in its own range": 3,
    }
    assert ladder.by_design(comparisons, "finite")["design"].tolist() == [0]


def test_a_state_without_a_comparison_misses_a_goal(comparisons):
    assert not goals.missed(ladder.goals(comparisons))
    lost = pd.DataFrame([state("paper", 0.06, 0.0, {}, status="not_converged")])
    assert [goal.value for goal in goals.missed(ladder.goals(pd.concat([comparisons, lost])))] == [1]
    refused = comparisons[comparisons["status"] == "refused"]
    assert len(goals.missed(ladder.goals(refused))) == len(beam.LEVELS)


def test_errors_are_those_of_solves_and_formulas(tmp_path, monkeypatch):
    """One design by the engine; the press force before a shear is that of the formula at the same depth."""
    monkeypatch.setitem(LEVELS, "quick", ROUGH)
    rows = ladder.run(lambda share, text: None, quick=True, store=tmp_path / "states.sqlite").frame("ladder")
    assert len(rows) == 14 * len(beam.LEVELS)
    row = rows.query("level == 'finite' and depth_over_D == 0.12 and shear_over_D == 0.15").iloc[0]
    design, load = error_study_cases.designs("ladder")[0], Load(0.96, 1.2, friction="stick")
    exact, formula = solve(design, load, ROUGH).response, beam.solve(design, load, "finite")
    before = beam.solve(design, Load(0.96), "finite").force[2]
    expected = (formula.force[2] - exact.force[2]) / before
    assert row["press_under_shear_error"] == pytest.approx(expected, rel=1e-6)
    assert row["tilt_error"] == pytest.approx((formula.tilt - exact.tilt) * design.R / 1.2, rel=1e-6)


def test_report(comparisons, tmp_path):
    result.write(ladder.result(comparisons), tmp_path, "magtip validate formulas ladder")
    text = (tmp_path / "LADDER.md").read_text("utf-8")
    for level in beam.LEVELS:
        assert f"| {level} | press to 0.06 D | 1 | 4 | 3 |" in text
    assert "- design 1: it is too deep" in text
    assert len((tmp_path / "ladder.csv").read_text("utf-8").splitlines()) == 1 + len(comparisons)
    assert (tmp_path / "ladder.png").is_file()
