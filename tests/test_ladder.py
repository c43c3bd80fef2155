"""Means of the errors of the formulas' levels, and the pages of `ladder`."""

import pytest

from analytic import beam
from studies.output import goals, result
from studies.validation import ladder

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
    return found


def test_a_mean_is_the_root_mean_square_of_the_states_that_have_the_error(comparisons):
    means = ladder.means(comparisons)
    assert means["press_force_error_percent"] == pytest.approx(4)
    assert means["sinking_error_percent"] == pytest.approx(100 * ((2 * 0.03**2 + 0.01**2) / 3) ** 0.5)
    assert means["tilt_error_percent"] == pytest.approx(10)
    assert ladder.means(comparisons[:1])["tilt_error_percent"] is None


def test_regions_count_their_states_and_a_refused_one_is_in_none(comparisons):
    best = [errors for errors in ladder.summary(comparisons) if errors["level"] == "finite"]
    assert {errors["region"]: errors["states"] for errors in best} == {
        "press to 0.06 D": 1,
        "press to D/4": 1,
        "shear of 0.05 D": 1,
        "in its own range": 3,
    }
    assert [errors["design"] for errors in ladder.by_design(comparisons, "finite")] == [0]


def test_a_state_without_a_comparison_misses_a_goal(comparisons):
    assert not goals.missed(ladder.goals(comparisons))
    lost = state("paper", 0.06, 0.0, {}, status="not_converged")
    assert [goal.value for goal in goals.missed(ladder.goals([*comparisons, lost]))] == [1]
    refused = [c for c in comparisons if c["status"] == "refused"]
    assert len(goals.missed(ladder.goals(refused))) == len(beam.LEVELS)


def test_report(comparisons, tmp_path):
    result.write(ladder.result(comparisons), tmp_path, "magtip validate ladder")
    text = (tmp_path / "LADDER.md").read_text("utf-8")
    for level in beam.LEVELS:
        assert f"| {level} | press to 0.06 D | 1 | 4 | 3 |" in text
    assert "- design 1: it is too deep" in text
    assert len((tmp_path / "ladder.csv").read_text("utf-8").splitlines()) == 1 + len(comparisons)
    assert (tmp_path / "ladder.png").stat().st_size > 10_000
