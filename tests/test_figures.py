"""Figures: what their tables and encodings hold, which points are drawn, and one picture of each kind."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from studies.output import figures
from studies.output.figures import ERROR_EDGES, Guide, Look, heat, plot, spots

CURVES = pd.DataFrame(
    {
        "depth (mm)": [1.0, 2.0, 3.0, np.nan] * 2,
        "force (N)": [1.0, 4.0, np.nan, 2.0, 2.0, 5.0, 7.0, 1.0],
        "series": ["finite elements"] * 4 + ["formula"] * 4,
    }
)
ERRORS = pd.DataFrame(
    {
        "L/D": [1.0, 1.0, 2.0, 2.0],
        "depth/D": [0.1, 0.2, 0.1, 0.2],
        "error (%)": [-60.0, 3.0, np.nan, 12.0],
        "failed": [False, False, True, False],
    }
)
SCALE = figures.SCALE
"""Pixels for a point, before tests make fewer of them."""


def layers(figure):
    """The layers of a figure by the names of their marks, in Vega-Lite's own schema."""
    spec = figure.chart.to_dict()
    parts = (spec.get("spec") or spec).get("layer", [spec])
    return {part["mark"]["type"]: part for part in parts}


def test_a_plot_holds_the_points_that_have_both_coordinates():
    figure = plot("t", "c", CURVES, "depth (mm)", "force (N)")
    assert figure.data["force (N)"].tolist() == [1, 4, 2, 5, 7]
    point = layers(figure)["point"]["encoding"]
    assert (point["x"]["title"], point["y"]["title"]) == ("depth (mm)", "force (N)")
    assert point["color"]["scale"]["domain"] == ["finite elements", "formula"]
    # finite elements and formulas are told apart without colours, too
    assert len(set(point["shape"]["scale"]["range"])) == 2
    assert [one["title"] for one in point["tooltip"]] == ["series", "depth (mm)", "force (N)"]


def test_an_absent_series_leaves_its_colour_to_no_other():
    rows = CURVES[CURVES["series"] == "formula"]
    look = Look(names=("finite elements", "formula"))
    colour = layers(plot("t", "c", rows, "depth (mm)", "force (N)", look))["line"]["encoding"]["color"]
    assert colour["scale"]["domain"] == ["finite elements", "formula"]
    assert colour["legend"]["values"] == ["formula"]


def test_many_points_are_thinned_with_a_sentence_and_keep_their_extremes():
    y = np.random.default_rng(0).permutation(5000) / 5000
    thin = plot("t", "c", pd.DataFrame({"x": np.arange(5000.0), "y": y}), "x", "y", Look(line=False))
    rows = thin.chart.to_dict()["datasets"].popitem()[1]
    drawn = [k for k, row in enumerate(rows) if row["drawn"]]
    assert len(thin.data) == len(rows) == 5000
    assert len(drawn) <= figures.MOST_MARKS
    assert {int(y.argmax()), int(y.argmin()), 0, 4999} <= set(drawn)
    assert thin.notes == (
        f"{len(drawn)} of 5000 points are drawn, evenly chosen from each series; the CSV has all of them.",
    )


def test_a_long_line_is_drawn_whole():
    line = plot("t", "c", pd.DataFrame({"x": np.arange(5000.0), "y": 0.0}), "x", "y")
    assert line.notes == ()
    assert layers(line)["point"]["mark"]["opacity"] == 0


@pytest.mark.parametrize(
    ("look", "scale"), [(Look(log="y"), "log"), (Look(), None), (Look(span=(-10.0, 10.0)), None)]
)
def test_scales(look, scale):
    y = layers(plot("t", "c", CURVES, "depth (mm)", "force (N)", look))["point"]["encoding"]["y"]["scale"]
    assert y.get("type") == scale
    assert y.get("domain") == (list(look.span) if look.span else None)


def test_guides_and_intervals_are_drawn():
    data = CURVES.assign(low=0.5, high=8.0)
    figure = plot("t", "c", data, "depth (mm)", "force (N)", Look(line=False, guides=(Guide("y", 1.0, "bound"),)))
    spec = str(figure.spec())
    assert "bound" in spec
    assert "'field': 'high'" in spec


def test_names_beside_points_and_guides_stand_inside_the_frame():
    look = Look(line=False, log="y", guides=(Guide("y", 0.7, "-3 dB"),))
    named = plot("t", "c", CURVES.assign(label="12"), "depth (mm)", "force (N)", look)
    scales = [layers(named)["point"]["encoding"][way]["scale"] for way in "xy"]
    # a name begins 9 pixels beside its point, and has letters of 7; below a guide it ends after 13
    assert scales[0]["padding"] > 9 + 2 * 7
    assert scales[1]["padding"] > 13


def test_a_map_tells_the_classes_of_errors_apart_and_marks_failed_cases():
    figure = heat("t", "c", ERRORS, ("L/D", "depth/D"), "error (%)", edges=ERROR_EDGES)
    rows = figure.chart.to_dict()["datasets"].popitem()[1]
    assert [row["shade"] for row in rows] == ["below \N{MINUS SIGN}50", "\N{MINUS SIGN}5 to 5", None, "10 to 20"]
    assert list(figure.data) == ["L/D", "depth/D", "error (%)", "failed"]
    assert "datum.failed" in str(figure.spec())


def test_a_map_of_few_values_has_them_as_numbers():
    table = pd.DataFrame({"nu": [0.3, 0.5], "L (mm)": [10, 10], "critical depth (mm)": [1.0, 3.0]})
    ink = layers(heat("t", "c", table, ("nu", "L (mm)"), "critical depth (mm)"))["text"]["encoding"]["color"]
    assert "< 2.0" in ink["condition"]["test"]


def test_names_with_dots_and_brackets_are_columns():
    data = pd.DataFrame({"x [mm]": [1.0, 2.0], "gain over that at 0.1 Hz": [1.0, 2.0]})
    point = layers(plot("t", "c", data, "x [mm]", "gain over that at 0.1 Hz"))["point"]["encoding"]
    assert point["x"]["field"] == r"x \[mm\]"
    assert point["y"]["field"] == r"gain over that at 0\.1 Hz"


def test_nothing_to_draw_is_no_error():
    empty = plot("t", "c", CURVES.assign(**{"force (N)": np.nan}), "depth (mm)", "force (N)")
    assert not len(empty.data)
    empty.chart.to_dict()


@pytest.mark.parametrize(
    "figure",
    [
        plot("Lines", "", CURVES, "depth (mm)", "force (N)", Look(log="y", guides=figures.bands(5, 10))),
        plot("Names", "", CURVES, "force (N)", "series", Look(line=False)),
        plot("Panels", "", CURVES.assign(panel=CURVES["series"]), "depth (mm)", "force (N)", Look(shared=False)),
        heat("Map", "", ERRORS, ("L/D", "depth/D"), "error (%)", edges=ERROR_EDGES),
        heat("Values", "", ERRORS.assign(panel="one"), ("L/D", "depth/D"), "error (%)"),
        spots("Spots", "", ERRORS, ("L/D", "depth/D"), "error (%)", ERROR_EDGES),
    ],
    ids=lambda figure: figure.title,
)
@pytest.mark.usefixtures("drawn_pictures")
def test_a_picture_has_marks_of_the_colours(figure, tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "SCALE", SCALE)
    figures.save(tmp_path / "one.png", [figure], notes=["A sentence."])
    picture = np.asarray(Image.open(tmp_path / "one.png").convert("RGB")).astype(int)
    assert picture.shape[1] > 600
    # neither black, white nor grey
    assert (np.ptp(picture, axis=2) > 60).sum() > 200
