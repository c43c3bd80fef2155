"""The picture of critical depths over the slenderness: its texts, its numbers, and where a press stays stable."""

import pytest

from geometry.design import paper
from studies.simulation import critical_depth_map
from studies.simulation.critical_depth_map import ColumnLoad, CriticalPoint, SlendernessRow
from tests.picture_texts import check_texts, legend, saved_figures


def row(ratio):
    length = 8.0 * ratio
    free = CriticalPoint(
        critical_depth_mm=None if ratio < 1 else length / ratio**2 / 2,
        critical_force_N=None if ratio < 1 else 30 / ratio**2,
        stable_to_mm=length / 2,
    )
    load = ColumnLoad(30 / ratio**2, length / ratio**2 / 2)
    return SlendernessRow(ratio, length, "ignored", "ok", free, CriticalPoint(), load, load, load)


@pytest.mark.parametrize("ratios", [(0.8, 1.5, 3, 5), (0.6, 1, 2, 4, 6, 10), (2, 3)])
def test_short_beams_that_stay_stable_are_marked_and_texts_are_apart(ratios, monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    critical_depth_map.picture(tmp_path / "stability.png", paper(), [row(ratio) for ratio in ratios])
    check_texts(figures[0])
    assert ("FEM, free tip: stable at least to here" in legend(figures[0])) == (min(ratios) < 1)
    left, _ = figures[0].axes
    assert left.get_xlim()[0] == pytest.approx(min(ratios), rel=0.1)
    assert left.get_xlim()[1] == pytest.approx(max(ratios), rel=0.1)
