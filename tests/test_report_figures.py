import math

import numpy as np

from studies.report import report_figures
from studies.report.report_figures import Axis, Figure, Panel, series


def figure(*parts):
    return Figure("t", "c", Axis("x"), Axis("y"), (Panel("", parts),))


def test_points_without_a_number_are_left_out_and_lines_run_along_x():
    one = series("a", [3, 1, math.nan, 2], [30, 10, 0, math.inf], names=["c", "a", "n", "b"], low=[1, 2, 3, 4])
    assert one.x == (1, 3)
    assert one.y == (10, 30)
    assert one.names == ("a", "c")
    assert one.low == (2, 1)


def test_many_points_are_thinned_with_a_sentence_and_keep_their_extremes():
    y = np.random.default_rng(0).permutation(5000) / 5000
    thin = report_figures.thinned(figure(series("a", np.arange(5000.0), y, line=False)))
    (one,) = thin.panels[0].series
    assert len(one.y) == 5000
    assert len(one.drawn) <= report_figures.MOST_MARKS
    assert {int(y.argmax()), int(y.argmin()), 0, 4999} <= set(one.drawn)
    assert thin.notes == (
        f"{len(one.drawn)} of 5000 points are drawn, evenly chosen from each series; the CSV has all of them.",
    )


def test_few_points_are_all_drawn():
    whole = figure(series("a", [1, 2], [1, 2]))
    assert report_figures.thinned(whole) is whole


def test_figure_without_a_number_is_empty():
    assert figure(series("a", [1.0], [math.nan])).empty
    assert Figure("t", "c", Axis("x"), Axis("y"), (Panel("", cells=((None,),)),), kind="map").empty
    assert not figure(series("a", [1.0], [0.0])).empty


def test_data_leaves_out_what_is_empty_and_keeps_what_is_false():
    data = figure(series("a", [1, 2], [1, 2], line=False)).data()
    assert data["panels"][0]["series"][0] == {
        "name": "a",
        "x": [1.0, 2.0],
        "y": [1.0, 2.0],
        "line": False,
        "mark": True,
        "style": 0,
        "dash": 0,
        "across": False,
    }
    assert "caption" not in data
