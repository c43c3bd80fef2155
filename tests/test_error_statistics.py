"""Statistics of the study of error estimates: shares, missed goals and mesh noise."""

import math

import pytest

from studies.output import goals
from studies.validation import accuracy_study
from studies.validation.error_study import QUANTITIES


def state(true, estimate, **changes):
    """A state whose quantities all have the same true error and estimate."""
    place = {"design": 0, "odd": False, "magnet": "rigid", "level": "quick", "scene": "press", "path": "press"}
    place |= {"model": "axisymmetric", "repeat": 0, "depth_mm": 1.0, "shear_mm": 0.0, "status": "ok", "message": ""}
    errors = {f"{name}_error": true for name in QUANTITIES} | {f"{name}_estimate": estimate for name in QUANTITIES}
    return place | errors | {"commit": ""} | changes


def solve(force_z=0.0, shift_z=0.0):
    """An answer of the half model to a press."""
    return {"force_x_N": 0.0, "force_z_N": force_z, "shift_x_mm": 0.0, "shift_z_mm": shift_z, "tilt_rad": 0.0}


def missed(states):
    """Names of the missed goals."""
    return [str(goal) for goal in goals.missed(accuracy_study.goals(states))]


def test_shares_and_goals():
    safe = [state(0.010, 0.015) for _ in range(19)]
    assert missed([*safe, state(0.02, 0.015)]) == []
    unsafe = missed([*safe, state(0.02, 0.015), state(0.02, 0.015)])
    assert len(unsafe) == len(QUANTITIES)
    assert "at most the estimate: 90.5 %, goal at least 95 %" in unsafe[0]
    blunt = missed([state(0.001, 0.0031) for _ in range(20)])
    assert all("true error: 0 %, goal at least 50 %" in said for said in blunt)
    assert "largest error: 3.1 %, goal at most 3 %" in missed([state(0.031, 0.04)])[0]


def test_an_unknown_estimate_covers_nothing():
    assert all(
        "at most the estimate: 50 %" in said for said in missed([state(0.01, e) for e in (0.015, math.nan)] * 4)
    )


def test_states_without_a_comparison_miss_a_goal():
    for status in ("not_run", "crashed", "disagrees"):
        lost = missed([state(0.01, 0.015), state(0.0, 0.0, status=status)])
        assert lost == ["states without a comparison: 1, goal at most 0"]
    assert not missed([state(0.01, 0.015), state(0.0, 0.0, status="unstable")])


def test_a_large_error_stays_in_the_statistics():
    assert accuracy_study.summary([state(0.4, 0.015)])[0]["max_percent"] == pytest.approx(40)


def test_mesh_noise_is_the_spread_over_meshes():
    half = [state(0.01, 0.02, model="half", scene="pressed", **solve(f, -1.0)) for f in (0.99, 1.0, 1.01)]
    (force, shift) = accuracy_study.noise(half)
    assert force["mean_percent"] == pytest.approx(1.0)
    assert shift["mean_percent"] == 0.0


def test_depths_of_a_press_are_no_noise():
    """Nor is the tilt that tetrahedra have where there should be none."""
    half = [state(0.01, 0.02, model="half", depth_mm=d, **solve(d, -d)) for d in (1.0, 2.0) for _ in "ab"]
    noise = accuracy_study.noise(half)
    assert [(one["quantity"], one["states"], one["max_percent"]) for one in noise] == [
        ("force", 2, 0.0),
        ("shift", 2, 0.0),
    ]
