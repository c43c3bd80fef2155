from pathlib import Path

import pytest

from studies.report import folder_contents, verdict_figures

RESULTS = Path(__file__).resolve().parent.parent / "results"


def read(name):
    return folder_contents.csv_table(RESULTS / name / f"{name}.csv")


def test_missed_checks_stand_right_of_the_bound():
    table = read("verify")
    (figure,) = verdict_figures.verification(table)
    passed, missed = figure.panels[0].series
    assert max(passed.x) <= 1
    assert len(missed.x) == 3
    assert min(missed.x) > 1
    assert figure.caption.startswith(f"{len(table) - 3} of {len(table)} checks passed")


def test_robustness_has_a_line_for_each_scene():
    table = read("extremes")
    (figure,) = verdict_figures.robustness(table)
    assert len(figure.y.categories) == len(table) == sum(len(one.x) for one in figure.panels[0].series)
    assert "none is missed" in figure.caption


def test_trade_has_the_medians_of_its_page():
    """TRADE.md, press: axisymmetric quick 0.15, standard 0.088 and fine 0.034; finite 0.65."""
    (figure,) = verdict_figures.trade(read("trade"))
    series = {one.name: one for one in figure.panels[0].series}
    assert series["axisymmetric"].y == pytest.approx((0.15, 0.088, 0.034), rel=0.02)
    finite = [name.startswith("formula finite, 31 states") for name in series["formula"].names].index(True)
    assert series["formula"].y[finite] == pytest.approx(0.65, rel=0.02)


def test_accuracy_counts_errors_within_their_estimate():
    (figure,) = verdict_figures.accuracy(read("accuracy"))
    assert {panel.title for panel in figure.panels} >= {"force", "shift", "tilt"}
    share = float(figure.caption.partition(" %")[0])
    assert share > 95


def test_stability_names_the_least_depth():
    (figure,) = verdict_figures.stability(read("stability"))
    free = figure.panels[0].series[0]
    assert f"{min(free.y):.3g} mm" in figure.caption


@pytest.mark.parametrize("name", ["friction", "crosscheck", "field", "ladder"])
def test_other_studies_are_drawn(name):
    (figure,) = getattr(verdict_figures, name)(read(name))
    assert not figure.empty
