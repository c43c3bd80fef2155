"""Figures: what their tables and encodings hold, which points are drawn, and one picture of each kind."""

import json

import altair as alt
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from geometry.design import paper
from studies.answers import SweepColumns, prefixes
from studies.inputs import study_input
from studies.inputs.study_input import grid
from studies.mechanics.study_cases import Cases, Plan, completed
from studies.models import models_of
from studies.output import figures
from studies.output.figures import LOG, Figure, panels, styles
from studies.output.maps import ERROR_EDGES, heat, spots
from studies.sensitivity import uncertainty_figures
from studies.simulation import time_figures
from studies.sizing import sizing_figures
from studies.sweeps import sweep, sweep_figures
from studies.sweeps.answer_curves import Axes, curves
from studies.web import folder_contents

CURVES = pd.DataFrame(
    {
        "depth (mm)": [1.0, 2.0, 1.0, 2.0, 3.0],
        "force (N)": [1.0, 4.0, 2.0, 5.0, 7.0],
        "series": ["finite elements"] * 2 + ["formula"] * 3,
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


def lines(data, *more, y="force (N)", log=False):
    """Lines with markers over the depth, in panels if the table has them."""
    up = alt.Y(y, **LOG) if log else y
    marks = alt.Chart().mark_line(point=True).encode(
        x="depth (mm)", y=up, **styles(data["series"])
    )  # fmt: skip
    return alt.layer(*more, marks)


def figure(title, chart, data=CURVES, **how):
    return Figure(title, "", panels(chart, data, **how), data)


def test_a_figure_names_its_axes_and_series_and_says_what_is_read_off():
    (mark,) = layers(figure("t", lines(CURVES))).values()
    encoding = figure("t", lines(CURVES)).spec()["layer"][0]["encoding"]
    assert (encoding["x"]["title"], encoding["y"]["title"]) == ("depth (mm)", "force (N)")
    assert mark["encoding"]["color"]["scale"]["domain"] == ["finite elements", "formula"]
    # finite elements and formulas are told apart without colours, too
    assert len(set(mark["encoding"]["shape"]["scale"]["range"])) == 2
    assert [one["title"] for one in encoding["tooltip"]] == ["series", "depth (mm)", "force (N)"]


def test_titles_and_legends_fit_the_room():
    long = "a series whose name takes most of the width of a figure in a column of text"
    data = pd.DataFrame({"depth (mm)": [1.0, 2.0] * 2, "series": [long] * 2 + ["short"] * 2})
    data["force along the plate, whose title is longer than its axis (N)"] = 1.0
    shown = figure("t", lines(data, y=data.columns[-1]), data)
    whole, half = (shown.spec(width)["layer"][0]["encoding"] for width in (figures.WIDTH, figures.HALF))
    assert " ".join(whole["y"]["title"]) == data.columns[-1]
    assert whole["color"]["legend"]["columns"] == half["color"]["legend"]["columns"] == 1
    assert figure("t", lines(CURVES)).spec()["layer"][0]["encoding"]["shape"]["legend"]["columns"] > 2
    assert half["x"]["axis"]["tickCount"] < whole["x"]["axis"]["tickCount"]
    # a series that is absent leaves its colour to no other, and does not stand in the legend
    absent = alt.Chart(CURVES).mark_point().encode(x="depth (mm)", **styles(["lost", "formula", "finite elements"]))
    colour = Figure("t", "", absent, CURVES).spec()["encoding"]["color"]
    assert colour["legend"]["values"] == ["formula", "finite elements"]
    assert colour["scale"]["range"][1] == figures.COLOURS[1]


def test_many_points_are_thinned_with_a_sentence_and_keep_their_extremes():
    y = np.random.default_rng(0).permutation(5000) / 5000
    thin, note = figures.thinned(pd.DataFrame({"x": np.arange(5000.0), "y": y}), "y")
    drawn = np.flatnonzero(thin["drawn"])
    assert len(thin) == 5000
    assert len(drawn) <= figures.MOST_MARKS
    assert {int(y.argmax()), int(y.argmin()), 0, 4999} <= set(drawn.tolist())
    assert note == (
        f"{len(drawn)} of 5000 points are drawn, evenly chosen from each series; the table has all of them.",
    )
    few, note = figures.thinned(CURVES, "force (N)")
    assert few["drawn"].all()
    assert not note


def test_a_map_tells_the_classes_of_errors_apart_and_marks_failed_cases():
    figure = heat("t", "c", ERRORS, ("L/D", "depth/D"), "error (%)", edges=ERROR_EDGES)
    rows = figure.chart.to_dict()["datasets"].popitem()[1]
    assert [row["shade"] for row in rows] == ["below \N{MINUS SIGN}50", "\N{MINUS SIGN}5 to 5", None, "10 to 20"]
    assert list(figure.data) == ["L/D", "depth/D", "error (%)", "failed"]
    assert "datum.failed" in str(figure.spec())


def test_names_with_dots_and_brackets_are_columns():
    data = pd.DataFrame({"x [mm]": [1.0, 2.0], "gain over that at 0.1 Hz": [1.0, 2.0]})
    point = curves(data, "x [mm]", "gain over that at 0.1 Hz", Axes(line=False))[0].to_dict()["encoding"]
    assert point["x"]["field"] == r"x \[mm\]"
    assert point["y"]["field"] == r"gain over that at 0\.1 Hz"
    assert [one["field"] for one in point["tooltip"]] == [r"x \[mm\]", r"gain over that at 0\.1 Hz"]


@pytest.mark.parametrize(
    "figure",
    [
        figure("Lines", lines(CURVES, *figures.bands())),
        figure("Logarithmic", lines(CURVES, *figures.rule("x", 2.0, "here"), log=True)),
        figure("Names", alt.Chart().mark_point().encode(x="force (N)", y="series")),
        figure("Panels", lines(CURVES), CURVES.assign(panel=CURVES["series"]), own="xy"),
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


@pytest.mark.usefixtures("drawn_pictures")
def test_many_figures_fit_a_page(tmp_path, monkeypatch):
    """Two columns of figures of few panels, and those of many below them; A4 is 1.41 times as high as wide."""
    monkeypatch.setattr(figures, "SCALE", 0.5)
    three = pd.concat([CURVES.assign(panel=name) for name in "abc"])
    whole = [figure(f"{k}", lines(CURVES)) for k in range(4)]
    figures.save(tmp_path / "one.png", [*whole, figure("wide", lines(CURVES), three)])
    width, height = Image.open(tmp_path / "one.png").size
    assert 1.0 < height / width < 2**0.5


def test_labels_of_points_stay_apart_and_inside():
    data = pd.DataFrame(
        {"x": [0.0, 2.0, 2.3, 10.0], "y": [3.0, 1.0, 1.0, 1.0], "label": ["", "first", "second", "last"]}
    )
    # the first label keeps clear of the second point, the last one of the frame
    assert figures.beside(data, "x", "y")["side"].tolist() == ["", "left", "right", "left"]
    base = alt.Chart(data).encode(x="x", y="y")
    assert {layer.to_dict()["mark"]["align"] for layer in figures.labels(base)} == {"left", "right", "center"}


# Figures of the studies: what they hold of the tables that the verbs write, and what they say.


def parse(text):
    """A table as it is read from a CSV file."""
    head, *rows = [line.split(",") for line in text.strip().splitlines()]
    return pd.DataFrame({name: folder_contents.column_of([row[k] for row in rows]) for k, name in enumerate(head)})


def of(figure, **values):
    """The rows of a figure with these values."""
    data = figure.data
    for name, value in values.items():
        data = data[data[name] == value]
    return data


# vibrations and loading cycles

RESPONSE = parse("""
motion,frequency_Hz,force_N_per_mm,S1_V_per_N,S1_per_N_phase_deg,S2_V_per_N,S2_per_N_phase_deg
z,1,5,0.2,170,,
z,10,5,0.3,165,,
z,100,5,0.1,100,,
x,1,5,0.4,-2,0.1,0
x,10,5,0.4,-3,0.1,0
x,100,5,0.2,-90,0.1,0
""")


def test_gains_are_over_the_lowest_frequency_and_phases_are_those_to_the_force():
    gain, phase = time_figures.response(RESPONSE)
    up = of(gain, panel="motion along z")
    assert up["gain per N over that at 1 Hz"].tolist() == pytest.approx([1.0, 1.5, 0.5])
    assert set(of(gain, panel="motion along x")["series"]) == {"S1", "S2"}
    # half a turn is the sign of the reading
    name = "phase to the force (degrees)"
    assert of(phase, panel="motion along z")[name].tolist() == [-10.0, -15.0, -80.0]
    assert of(phase, panel="motion along x", series="S1")[name].tolist() == [-2.0, -3.0, -90.0]
    assert gain.caption.endswith("S2 reads nothing of a motion along z.")


# sizing

FRONT = parse("""
rank,point,status,reason,D_mm,L_mm,magnet,silicone,hall_part,outer_size_mm,fem_range_z_N,fem_resolution_z_mN,range_z_difference_percent
1,1,ok,,8,9,disc 4 x 2,Dragon Skin 30,SS495A,12,6,4,1.5
2,2,ok,,9,9,disc 5 x 2,,SS495A,14,8,9,-2
3,3,ok,whether least_yield is met is unknown,9,8,disc 5 x 2,,SS495A,13,7,8,1
,4,failed,force_z is missed,6,9,,,,9,3,2,-6
""")


def test_front_tells_the_best_from_the_removed_and_from_what_is_unknown():
    resolution, size, differences = sizing_figures.front(FRONT)
    assert resolution.data["series"].tolist() == [
        "best variant",
        "meets all requirements",
        "unknown whether it meets all",
        "removed by finite elements",
    ]
    assert resolution.data["label"].tolist() == ["1", "2", "3", ""]
    assert resolution.data["range z (N)"].tolist() == [6, 8, 7, 3]
    assert resolution.caption.startswith(
        "2 of 4 variants of the front meet all requirements by finite elements; of 1 more"
    )
    assert "D 8 mm, L 9 mm, disc 4 x 2" in resolution.caption
    assert "outer size (mm)" in size.data
    assert "range z, -6 %" in differences.caption
    assert len(differences.data) == 4


# sensitivity


def test_sobol_indices_have_both_orders_and_their_intervals():
    head = "output,input,first_order,first_order_low,first_order_high,total_order,total_order_low,total_order_high"
    rows = ["force_N,E,0.9,0.8,1,0.95,0.9,1", "force_N,nu,0.05,0,0.1,0.1,0.05,0.2", "tilt_rad,E,,,,,,"]
    (figure,) = uncertainty_figures.sobol(
        parse("\n".join([head + ",points,failed", *[f"{row},100,3" for row in rows]]))
    )
    assert set(figure.data["panel"]) == {"force (N)"}
    first = of(figure, series="first order")
    assert first["index (share of the variance)"].tolist() == [0.9, 0.05]
    assert (first["low"].tolist(), first["high"].tolist()) == ([0.8, 0.0], [1.0, 0.1])
    assert "force E (0.95)" in figure.caption
    assert "3 of 100 points failed" in figure.caption


def test_failed_sensors_are_never_below():
    head = "sensor,status,E_MPa,z_sensitivity_V_per_N,z_zeroed_force_error_N,z_recalibrated_force_error_N"
    rows = ["1,ok,1,0.01,0.1,0.001", "2,ok,1,0.02,0.3,0.002", "3,failed,1,,,", "4,ok,1,0.03,0.2,0.003"]
    (figure,) = uncertainty_figures.made_sensors(parse("\n".join([head, *rows])))
    panels = ["sensitivity (V/N)", "force error after zeroing (N)", "force error after recalibration (N)"]
    assert list(dict.fromkeys(figure.data["panel"])) == panels
    zeroed = of(figure, panel=panels[1])
    assert zeroed[uncertainty_figures.VALUE].tolist() == [0.1, 0.2, 0.3]
    assert zeroed[uncertainty_figures.BELOW].tolist() == [25, 50, 75]
    assert "1 failed" in figure.caption


# Figures of sweeps over grids and samples: which rows and quantities, and which notes.


def table(axes, **results):
    """A sweep over a grid: results are functions of the axes."""
    grid = np.meshgrid(*axes.values(), indexing="ij")
    points = {name: values.ravel() for name, values in zip(axes, grid, strict=True)}
    columns = points | {name: np.asarray(rule(*points.values()), dtype=float) for name, rule in results.items()}
    return pd.DataFrame(columns).assign(status="ok")


AXES = {"D_mm": [6.0, 8.0], "L_mm": [9.0, 12.0, 18.0], "depth_mm": [0.5, 1.0]}


def drawn_of(whole):
    """The figures of a table without a record of its run."""
    return sweep_figures.sweep(whole, SweepColumns.of_table(whole.columns))


@pytest.mark.parametrize(("counts", "maps"), [((6, 7), False), ((7, 7), True), ((3, 40), False)])
def test_lines_up_to_six_values_and_maps_beyond(counts, maps):
    axes = {"D_mm": np.linspace(6, 8, counts[0]), "L_mm": np.linspace(9, 20, counts[1])}
    whole = table(axes, fem_force_N=lambda D, L: D / L)
    (figure,) = drawn_of(whole)
    assert len(figure.data) == counts[0] * counts[1]
    assert ("series" not in figure.data) == maps
    if maps:
        # evenly spaced values: round numbers at the axis in place of 6.3333, 6.6667 ...
        assert layers(figure)["rect"]["encoding"]["x"]["type"] == "quantitative"


def test_lines_hold_every_number_of_the_table():
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d / L, analytic_force_N=lambda D, L, d: D * d)
    (figure,) = drawn_of(whole)
    assert list(dict.fromkeys(figure.data["panel"])) == ["D = 6 mm", "D = 8 mm"]
    assert set(figure.data["series"]) == {"L = 9 mm", "L = 12 mm", "L = 18 mm"}
    assert set(figure.data["model"]) == {"finite elements", "formula"}
    expected = [*whole["fem_force_N"], *whole["analytic_force_N"]]
    np.testing.assert_allclose(sorted(figure.data["press force (N)"]), sorted(expected))


def test_shades_of_what_is_left_out_are_those_of_one_model():
    """Models share the colours of an axis; one shade over both of them would jump between their ends."""
    axes = {"L_mm": np.linspace(9, 18, 7), **{name: [1.0, 2.0, 3.0, 4.0] for name in ("D_mm", "nu", "E_MPa")}}
    force = {"fem_force_N": lambda *v: sum(v), "analytic_force_N": lambda *v: 2 * sum(v)}
    (figure,) = drawn_of(table(axes | {"depth_mm": [0.5, 1.0]}, **force))
    assert figure.data["high"].gt(figure.data["low"]).any()
    assert layers(figure)["area"]["encoding"]["detail"]["field"] == "model"


def test_an_axis_of_one_value_shows_the_zero():
    """Vega writes 4 at the only tick of a force of 4.2 N."""
    (figure,) = drawn_of(table({"depth_mm": [1.25]}, fem_force_N=lambda d: 4.2 * d))
    encoding = layers(figure)["line"]["encoding"]
    assert encoding["x"]["scale"] == {"zero": True}
    assert encoding["y"].get("scale", {}).get("zero", True)


def test_map_of_errors_has_each_error_in_its_cell():
    axes = {"L_mm": np.linspace(9, 12, 8), "depth_mm": np.linspace(0.5, 1.0, 7)}
    force = {"fem_force_N": lambda L, d: L * d, "analytic_force_N": lambda L, d: L}
    whole = table(axes, **force, force_error_percent=lambda L, d: L + d - 2)
    value, error = drawn_of(whole)
    assert value.title == "Press force over depth"
    assert set(value.data["panel"]) == {"finite elements", "formula"}
    assert error.title == "Error of the press force, formula"
    off = error.data["L (mm)"] + error.data["depth (mm)"] - 2 - error.data["error (%)"]
    np.testing.assert_allclose(off, 0, atol=1e-9)
    within = 100 * (whole["force_error_percent"] <= 10).mean()
    assert f"{within:.0f} % of the cases are within 10 %" in error.caption


def test_errors_of_a_picture_are_those_of_the_table():
    """The shortest beam's force is a thousand times that of the longest one."""
    whole = table(
        {"L_mm": [6.0, 60.0], "shear_mm": [0.4, 0.8]},
        fem_force_x_N=lambda L, s: s * (6 / L) ** 3,
        analytic_force_x_N=lambda L, s: s * (6 / L) ** 3 * np.where(L > 6, 1.5, 1.02),
        force_x_error_percent=lambda L, s: np.where(L > 6, 50.0, 2.0) + s,
    )
    whole.loc[3, ["force_x_error_percent", "analytic_force_x_N", "fem_force_x_N"]] = [np.nan, 0.1, -0.1]
    whole["error_status"] = ["ok", "ok", "ok", "gave_way"]
    _, error = drawn_of(whole)
    shown = error.data.sort_values(["series", "shear (mm)"], kind="stable")
    assert shown["error (%)"].tolist()[:3] == [2.4, 2.8, 50.4]
    assert shown["failed"].tolist() == [False, False, False, True]
    assert "67 % of the cases are within 10 %" in error.caption


def test_lengths_over_D_are_axes_of_pictures():
    """Where D is the same for all beams, marks of lengths have L/D behind them."""
    axes = {"L_over_D": [1.0, 2.0], "depth_over_D": [0.1, 0.2]}
    whole = table(axes, fem_force_N=lambda L, d: L * d)
    whole.insert(0, "L_mm", 8 * whole["L_over_D"])
    (figure,) = drawn_of(whole)
    assert figure.title == "Press force over depth/D, finite elements"
    assert set(figure.data["series"]) == {"L/D = 1", "L/D = 2"}
    whole = table({"D_mm": [8.0], "L_mm": [8.0, 16.0], "depth_mm": [0.5, 1.0]}, fem_force_N=lambda D, L, d: L * d)
    (figure,) = drawn_of(whole)
    assert set(figure.data["series"]) == {"L = 8 mm (L/D = 1)", "L = 16 mm (L/D = 2)"}


def test_unstable_states_are_open_and_do_not_count():
    forces = {"fem_force_N": lambda L, d: L * d, "analytic_force_N": lambda L, d: L * d}
    whole = table(
        {"L_mm": [9.0, 12.0], "depth_mm": [0.5, 1.0]}, **forces, force_error_percent=lambda L, d: 30 - 25 * d + L / 9
    )
    whole["critical_depth_mm"] = [0.8, 0.8, 0.6, 0.6]
    whole["status"] = ["ok", "unstable"] * 2
    value, error, *_ = drawn_of(whole)
    assert "Over all stable cases: finite elements from 4.5 to 6 N" in value.caption
    assert "0 % of the 2 stable cases are within 10 %" in error.caption
    assert "2 cases that are not known to be stable do not count" in error.caption
    opened = value.data.set_index(["model", "series", "depth (mm)"])["open"]
    # a formula knows no stability
    assert opened["finite elements"].tolist() == [False, False, True, True]
    assert not opened["formula"].any()
    assert error.data["open"].tolist() == [False, False, True, True]
    assert value.data.groupby("series")["limit"].first().to_dict() == {"L = 9 mm": 0.8, "L = 12 mm": 0.6}
    layers = str(value.chart.to_dict())
    assert "!datum.open" in layers
    assert "datum.limit" in layers


def test_failed_cases_are_counted_with_their_cause_and_marked():
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d / L).assign(message="")
    whole.loc[0, ["status", "message"]] = ["bad_input", "the magnet does not fit; take a smaller one"]
    (figure,) = drawn_of(whole)
    assert figure.data["failed"].sum() == 1
    assert figure.notes == (
        "1 of 12 cases failed (bad_input); most often: the magnet does not fit; take a smaller one.",
    )


def test_errors_far_beyond_the_others_stand_at_the_edge_with_a_note():
    errors = [*np.linspace(-20, 20, 40), 5000.0]
    axes = {"depth_mm": np.linspace(0.1, 2, 41)}
    force = dict.fromkeys(("fem_force_N", "analytic_force_N"), lambda d: d)
    whole = table(axes, **force, force_error_percent=lambda d: errors)
    _, error = drawn_of(whole)
    assert "1 error stands at the edge: 5000 %." in error.notes
    assert error.data["error (%)"].max() == 5000
    y = error.chart.to_dict()["layer"][-1]["encoding"]["y"]["scale"]
    assert y["domain"][1] < 30
    assert y["clamp"]


def test_sampled_points_are_shown_over_each_axis():
    rng = np.random.default_rng(0)
    D, L = rng.uniform(5, 10, 40), rng.uniform(10, 20, 40)
    columns = {"D_mm": D, "L_mm": L, "fem_force_N": D / L, "analytic_force_N": D / L}
    columns |= {"force_error_percent": 10 * D - 50, "status": "ok"}
    value, error, spots = drawn_of(pd.DataFrame(columns))
    assert set(value.data["panel"]) == {"D (mm)", "L (mm)"}
    # the axis with the greatest effect comes first
    assert next(iter(error.data["panel"])) == "D (mm)"
    assert len(value.data) == 160
    # over each axis stand the same values: their axis is one
    assert value.chart.to_dict()["resolve"]["scale"] == {"x": "independent"}
    assert list(spots.data)[:2] == ["D (mm)", "L (mm)"]


# What the pictures of a sweep show: which axes, models, rows and quantities, and which note.

NAMED = {
    "surrogate": "surrogate", "paper": "the paper's formula", "tip": "formula, level tip",
    "finite": "formula, level finite", "fem": "finite elements, standard", "quick": "finite elements, quick",
    "fine": "finite elements, fine", "tolerance:1%": "chosen model",
}  # fmt: skip


def studied(names, axes, silent=()):
    """The plan of a study, and its table with numbers of our own under the columns that a sweep writes."""
    plan = completed(Plan(paper(), grid(axes), {}, "rigid", models_of(names), ("force",)))
    points = Cases(plan).batch(np.arange(plan.count)).axes
    table = {name: np.ones(plan.count) for name in sweep.without_rows(plan)}
    table |= {study_input.column(name): values for name, values in points.items()}
    answered = {name: np.full(plan.count, "ok", dtype=object) for name in table if name.endswith("status")}
    table |= answered | {"message": np.full(plan.count, "", dtype=object)}
    for k, (name, prefix) in enumerate(prefixes(plan).items()):
        table[f"{prefix}force_N"] = (k + 1) * sum(points.values())
        if name in silent:
            table[f"{prefix}force_N"] = np.full(plan.count, np.nan)
            table[f"{prefix}status"] = np.full(plan.count, "bad_input", dtype=object)
    return plan, pd.DataFrame(table)


@pytest.mark.parametrize(
    ("names", "judged"),
    [
        (["fem", "surrogate", "finite"], ["surrogate", "finite"]),
        (["quick", "fine", "paper", "tip", "finite"], ["quick", "paper", "tip", "finite"]),
        (["tolerance:1%", "paper"], ["paper"]),
        (["fem"], []),
        (["surrogate"], []),
        (["surrogate", "paper"], []),
        (["paper", "tip", "finite"], []),
    ],
    ids=",".join,
)
@pytest.mark.parametrize("axes", [["depth"], ["D", "depth"], ["L/D", "E", "depth"]], ids=",".join)
def test_axes_are_axes_and_every_model_has_its_curve_and_its_name(names, judged, axes):
    """A column is what the study says: the surrogate's force is no axis, and `finite` not the paper's formula."""
    values = {"D": [6.0, 8.0], "L/D": [1.5, 2.0], "E": [1.0, 2.0], "depth": [0.5, 1.0]}
    plan, table = studied(names, {name: values[name] for name in axes})
    record = json.loads(json.dumps(SweepColumns.of_plan(plan).record))
    study = SweepColumns.of_record(record, table.columns)
    assert study == SweepColumns.of_plan(plan)
    value, *error = sweep_figures.sweep(table, study)
    drawn = value.data.rename(columns={"model" if "model" in value.data else "series": "name"})
    alone = NAMED[names[0]] if len(names) == 1 else ""
    assert value.title == "Press force over depth" + (f", {alone}" if alone else "")
    if not alone:
        assert set(drawn["name"]) == {NAMED[name] for name in names}
    forces = table[[f"{prefix}force_N" for prefix in prefixes(plan).values()]].to_numpy()
    np.testing.assert_allclose(np.sort(drawn["press force (N)"]), np.sort(forces.ravel()))
    assert set(drawn["depth (mm)"]) == {0.5, 1.0}
    assert len(error) == bool(judged)
    if judged:
        shown = error[0].data["model" if len(axes) > 1 else "series"]
        assert set(shown) == {NAMED[name] for name in judged}
    # without the record the axes and the models are the same, and a single level stays unnamed
    known = SweepColumns.of_table(table.columns)
    assert list(known.models.values()) == list(study.models.values())
    assert set(study.axes) <= set(known.axes)


def test_a_model_without_answers_has_no_curve_and_a_sentence():
    plan, table = studied(["fem", "surrogate", "finite"], {"D": [6.0, 8.0], "depth": [0.5, 1.0]}, ["surrogate"])
    value, error = sweep_figures.sweep(table, SweepColumns.of_plan(plan))
    assert set(value.data["model"]) == {"finite elements, standard", "formula, level finite"}
    assert "Without an answer: surrogate in all of 4 cases." in value.notes
    assert set(error.data["model"]) == {"formula, level finite"}


def plan_of(factors, load=None, quantities=("force",)):
    return Plan(paper(), factors, load or {}, "rigid", models_of(["quick", "paper"]), quantities)


def table_of(plan):
    """A table of all cases with made-up results."""
    batch = Cases(plan).batch(np.arange(plan.count))
    n = len(batch)
    units = {"D": "D_mm", "L": "L_mm", "depth": "depth_mm", "shear": "shear_mm"}
    table = {units[name]: values for name, values in batch.axes.items()}
    for name in ("force_N", "force_x_N", "shift_z_mm", "tilt_rad"):
        table |= {f"fem_{name}": np.arange(1.0, n + 1), f"analytic_{name}": np.arange(2.0, n + 2)}
        error = name.removesuffix("_N").removesuffix("_mm").removesuffix("_rad").removesuffix("_z")
        table[f"{error}_error_percent"] = np.linspace(-20, 20, n)
    full = np.full(n, None, dtype=object)
    return table | {"status": np.full(n, "ok", dtype=object), "message": full}


@pytest.fixture
def drawn(monkeypatch):
    """Figures and notes of each picture by its name."""
    calls = {}
    monkeypatch.setattr(figures, "save", lambda path, drawn, notes: calls.update({path.name: (drawn, notes)}))
    return calls


def collected(plan):
    pictures = sweep_figures.Collected(plan)
    table = table_of(plan)
    # in two batches, the second one short
    cut = plan.count - 1
    for rows in (slice(0, cut), slice(cut, None)):
        pictures.add({name: values[rows] for name, values in table.items()}, np.arange(plan.count)[rows])
    return pictures


def test_a_huge_study_is_thinned_with_a_note(drawn, monkeypatch, tmp_path):
    monkeypatch.setattr(sweep_figures, "MOST_DRAWN", 12)
    axes = {"D": [6.0, 8.0], "depth": [0.1 * k for k in range(1, 12)]}
    collected(plan_of(grid(axes))).draw(tmp_path / "sweep.png")
    (force, *_), notes = drawn["sweep.png"]
    # both ends stay
    depths = sorted(set(force.data["depth (mm)"]))
    assert depths == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9, 1.1])
    assert notes == ["Of 11 values of depth, 6 are drawn; the table has all."]


def test_a_large_study_shows_one_modulus_and_one_layout(drawn, monkeypatch, tmp_path):
    """Forces are proportional to E, and do not depend on f."""
    monkeypatch.setattr(sweep_figures, "LARGE", 20)
    plan = plan_of(grid({"E": [0.5, 1.0, 2.0], "f": [5.0, 6.0], "D": [7.0, 8.0], "depth": [0.5, 1.0]}))
    pictures = sweep_figures.Collected(plan)
    batch = Cases(plan).batch(np.arange(plan.count))
    axes = {f"{name}_{'MPa' if name == 'E' else 'mm'}": values for name, values in batch.axes.items()}
    forces = dict.fromkeys(("fem_force_N", "analytic_force_N", "force_error_percent"), batch.E)
    texts = {name: np.full(plan.count, "ok", dtype=object) for name in ("status", "message")}
    pictures.add(axes | forces | texts, np.arange(plan.count))
    pictures.draw(tmp_path / "sweep.png")
    (force, *_), notes = drawn["sweep.png"]
    assert len(force.data) == 2 * 4
    # the modulus that is nearest to that of the base design
    assert set(force.data["press force (N)"]) == {1.0}
    assert notes == ["Forces are proportional to E: drawn for E = 1 MPa.", "f has no effect on what is shown."]
