"""The picture of critical depths over the slenderness: its texts, its numbers, and where a press stays stable."""

import pytest

from studies.output import figures
from studies.simulation import critical_depths


def row(ratio):
    length = 8.0 * ratio
    return dict.fromkeys(critical_depths.COLUMNS) | {
        "L_over_D": ratio,
        "L_mm": length,
        "status": "ok",
        "critical_depth_mm": None if ratio < 1 else length / ratio**2 / 2,
        "critical_force_N": None if ratio < 1 else 30 / ratio**2,
        "stable_to_mm": length / 2,
        **{f"{formula}_N": 30 / ratio**2 for formula in critical_depths.FORMULAS},
        **{f"{formula}_depth_mm": length / ratio**2 / 2 for formula in critical_depths.FORMULAS},
    }


@pytest.mark.parametrize("ratios", [(0.8, 1.5, 3, 5), (2, 3)])
def test_short_beams_that_stay_stable_are_marked(ratios):
    depth, force = critical_depths.figures(figures.table_of([row(ratio) for ratio in ratios]))
    stable = depth.data["series"] == "finite elements, free tip: stable at least to here"
    assert stable.sum() == sum(ratio < 1 for ratio in ratios)
    assert set(depth.data["L/D"]) == set(ratios)
    # what was not found is not in the legend
    assert not depth.data["series"].str.contains("guided").any()
    assert set(force.data["series"]) == {
        "finite elements, free tip", "Haringx, free tip", "Euler, free tip", "Engesser, free tip"
    }  # fmt: skip
