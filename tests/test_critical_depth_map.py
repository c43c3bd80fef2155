"""The picture of critical depths over the slenderness: its texts, its numbers, and where a press stays stable."""

import pytest

from geometry.design import paper
from studies.simulation import critical_depths
from tests.picture_texts import check_texts, legend, saved_figures


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


@pytest.mark.parametrize("ratios", [(0.8, 1.5, 3, 5), (0.6, 1, 2, 4, 6, 10), (2, 3)])
def test_short_beams_that_stay_stable_are_marked_and_texts_are_apart(ratios, monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    critical_depths.picture(tmp_path / "stability.png", paper(), [row(ratio) for ratio in ratios])
    check_texts(figures[0])
    assert ("FEM, free tip: stable at least to here" in legend(figures[0])) == (min(ratios) < 1)
    left, _ = figures[0].axes
    assert left.get_xlim()[0] == pytest.approx(min(ratios), rel=0.1)
    assert left.get_xlim()[1] == pytest.approx(max(ratios), rel=0.1)
