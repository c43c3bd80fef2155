"""Pictures of a sweep: every case is in one of them, failed ones visibly, and their texts are whole and apart."""

import itertools
import math
import warnings
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

from fem.accuracy import QUICK
from geometry.design import BadInput, paper
from studies.exploration import store, sweep, sweep_plot
from studies.exploration.needed_paths import Processes
from studies.exploration.study_cases import FemModel, Plan
from studies.exploration.sweep_plot import Shown
from studies.inputs.study_input import grid
from studies.output import table_plots
from tests.picture_texts import check_texts

BASE = {"D_mm": 8.0, "L_mm": 9.0, "f_mm": 5.0, "E_MPa": 1.0, "depth_mm": 1.0, "law": "neo-Hookean", "nu": 0.49}
LAWS = {"neo-Hookean": 1.0, "Yeoh": 1.1, "Ogden": 0.9}
FORCE = Shown(
    "press force", "N", {"FEM": "fem_force_N", "paper": "analytic_force_N"}, {"paper": "force_error_percent"}
)
ALL = {
    "D_mm": [6.0, 8.0, 10.0],
    "E_MPa": [0.5, 1.0],
    "depth_mm": [0.5, 1.0, 1.5, 2.0],
    "L_mm": [9.0, 10.0, 11.0, 12.0, 13.0],
    "f_mm": [4.0, 5.0],
}


def spread(low, high, count):
    return np.linspace(low, high, count).tolist()


def columns_of(axes, lose=None, points=None):
    """Columns of a bar that is pressed: the force goes with E D^2 d^1.5 / L, its error with D, L and the depth d."""
    points = list(itertools.product(*axes.values())) if points is None else points
    cases = [BASE | dict(zip(axes, point, strict=True)) for point in points]
    lost = np.array([lose is not None and lose(case) for case in cases])
    v = {name: np.array([case[name] for case in cases]) for name in BASE}
    softness = np.array([LAWS.get(case["law"], 1.0) for case in cases])
    force = softness * v["E_MPa"] * v["D_mm"] ** 2 * v["depth_mm"] ** 1.5 / v["L_mm"] * v["nu"]
    ratio = (0.6 + 0.1 * v["depth_mm"] * v["D_mm"] / v["L_mm"]) / softness
    answers = {
        "fem_force_N": force,
        "analytic_force_N": ratio * force,
        "finite_force_N": 0.98 * force,
        "force_error_percent": 100 * (ratio - 1),
        "finite_force_error_percent": np.full(len(cases), -2.0),
    }
    columns = v | {name: np.where(lost, math.nan, answer) for name, answer in answers.items()}
    columns["status"] = np.where(lost, "not_converged", "ok")
    columns["message"] = np.where(lost, "the press stopped at 62 % of its depth", "")
    return columns


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """Draw, any warning an error, and return the figures."""
    figures = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda self, file, **_: (figures.append(self), save(self, file, dpi=60)))

    def draw(axes, shown=(FORCE,), lose=None, points=None, columns=None, **options):
        del figures[:]
        columns = columns_of(axes, lose, points) if columns is None else columns
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            files = sweep_plot.draw(tmp_path / "sweep.png", columns, axes, shown, **options)
        assert [file.name for file in files] == [
            f"sweep{f'-{k}' if k > 1 else ''}.png" for k in range(1, len(figures) + 1)
        ]
        assert all(file.read_bytes().startswith(b"\x89PNG") for file in files)
        return list(figures)

    return draw


def note(figure):
    return figure.get_supxlabel().replace("\n", " ")


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts() if text.get_text().strip()]


def panels(figure):
    """The panels without the colour bars."""
    return [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]


def named(figure, name):
    return [p for p in panels(figure) if name in p.get_ylabel().replace("\n", " ")]


def points(panel, dashes="-"):
    """Number of the points of the lines with these dashes that have a value."""
    lines = [
        line for line in panel.get_lines() if line.get_transform() == panel.transData and len(line.get_xdata()) > 0
    ]
    own = [line for line in lines if line.get_linestyle() == dashes and not line.get_label().startswith("_alone")]
    return sum(int(np.isfinite(np.asarray(line.get_ydata(), float)).sum()) for line in own)


def crosses(panel):
    return sum(len(line.get_xdata()) for line in panel.get_lines() if line.get_label() == "_failed")


def cells(panel):
    """Numbers of cells with a value and of hatched cells of a map."""
    (mesh,) = [c for c in panel.collections if isinstance(c, QuadMesh)]
    hatched = [patch for patch in panel.patches if isinstance(patch, PathPatch) and patch.get_label() == "_failed"]
    return mesh.get_array().count(), sum(len(patch.get_path().vertices) // 5 for patch in hatched)


@pytest.mark.parametrize("count", range(1, 6))
def test_any_number_of_axes_without_a_warning(drawn, count):
    axes = dict(itertools.islice(ALL.items(), count))
    (figure,) = drawn(axes)
    check_texts(figure)
    effective = math.prod(len(values) for name, values in axes.items() if name != "f_mm")
    assert sum(map(points, named_in_rows(figure, error=False))) == effective
    assert ("$f$ changes nothing" in note(figure)) == (count == 5)


def named_in_rows(figure, *, error):
    """The panels of values, or of errors, which have grey bands."""
    return [p for p in panels(figure) if bool(p.patches) == error]


def test_a_line_has_all_its_points(drawn):
    axes = {"depth_mm": [0.5, 1.0, 2.0], "E_MPa": [1.0, 2.0]}
    (figure,) = drawn(axes)
    force, _ = panels(figure)
    columns = columns_of(axes)
    lines = [line for line in force.get_lines() if line.get_linestyle() == "-"]
    for line, modulus in zip(lines, axes["E_MPa"], strict=True):
        assert list(line.get_ydata()) == pytest.approx(columns["fem_force_N"][columns["E_MPa"] == modulus].tolist())


def test_an_error_that_is_the_same_for_all_colours_is_one_grey_line(drawn):
    (figure,) = drawn({"depth_mm": [0.5, 1.0], "E_MPa": [1.0, 2.0, 3.0]})
    _, error = panels(figure)
    assert [line.get_color() for line in error.get_lines() if line.get_marker() == "o"] == ["#555555"]
    assert "The error of press force is the same for every $E$." in note(figure)


@pytest.mark.parametrize("lose", [None, lambda case: case["depth_mm"] > 0.35 * case["D_mm"]])
def test_two_axes_of_40_values_are_maps_of_all_cases(drawn, lose):
    axes = {"D_mm": spread(4, 16, 40), "depth_mm": spread(0.1, 4, 40)}
    (figure,) = drawn(axes, lose=lose)
    check_texts(figure)
    lost = 0 if lose is None else sum(columns_of(axes, lose)["status"] != "ok")
    assert [cells(panel) for panel in panels(figure)] == [(1600 - lost, lost)] * 2
    assert (f"failed ({lost} of 1600)" in legend(figure)) == (lost > 0)
    assert "error ±5 %" in legend(figure)
    assert panels(figure)[1].get_xlabel() == "$D$ (mm)"


def test_four_axes_show_every_case(drawn):
    axes = {
        "D_mm": ALL["D_mm"],
        "E_MPa": spread(0.3, 2, 4),
        "depth_mm": spread(0.5, 2.5, 5),
        "L_mm": spread(8, 18, 6),
    }
    lose = lambda case: case["L_mm"] < 9 and case["D_mm"] > 9 and case["depth_mm"] > 1.9  # noqa: E731
    (figure,) = drawn(axes, lose=lose)
    check_texts(figure)
    values, errors = named_in_rows(figure, error=False), named_in_rows(figure, error=True)
    assert (len(values), len(errors)) == (20, 5)
    assert sum(map(points, values)) + sum(map(crosses, values)) == 360
    assert [p.get_title() for p in values[:5]] == [f"depth $d$ = {d:g} mm" for d in axes["depth_mm"]]
    assert {text.get_text() for p in values for text in p.texts} == {f"$E$ = {e:.4g} MPa" for e in axes["E_MPa"]}


def test_four_axes_of_maps_show_every_case(drawn):
    axes = {
        "D_mm": spread(4, 14, 8),
        "L_mm": spread(8, 30, 9),
        "depth_mm": spread(0.5, 2.5, 5),
        "nu": [0.4, 0.45, 0.49],
    }
    figures = drawn(axes, lose=lambda case: case["D_mm"] > 13 and case["L_mm"] < 9)
    for figure in figures:
        check_texts(figure)
    counts = [cells(panel) for panel in panels(figures[0])]
    # the error does not depend on nu
    values, errors = counts[:15], counts[15:]
    assert (sum(full for full, _ in values), sum(lost for _, lost in values)) == (1065, 15)
    assert errors == [(71, 1)] * 5


def test_panels_of_many_values_continue_below_and_in_further_pictures(drawn):
    axes = {"D_mm": spread(4, 14, 8), "L_mm": spread(8, 30, 9), "depth_mm": spread(0.5, 2.7, 13)}
    figures = drawn(axes)
    for figure in figures:
        check_texts(figure)
    assert sum(cells(panel)[0] for figure in figures for panel in panels(figure)) == 2 * 8 * 9 * 13
    assert note(figures[0]).endswith(f"Picture 1 of {len(figures)}.")


def test_more_axes_than_pictures_can_show_are_folded_to_their_extremes(drawn, monkeypatch):
    monkeypatch.setattr(sweep_plot, "MOST_PICTURES", 2)
    axes = {"D_mm": [6.0, 8.0], "L_mm": [9.0, 12.0], "E_MPa": [1.0, 2.0], "depth_mm": [0.5, 1.0], "nu": [0.45, 0.49]}
    (figure,) = drawn(axes)
    check_texts(figure)
    folded = "Press force over all values of $\\nu$: lines at the greatest magnitude, shaded from the least"
    assert folded in note(figure)
    (shade, *_), (line, *_) = panels(figure)[0].collections, panels(figure)[0].get_lines()
    columns = columns_of(axes)
    first = (columns["depth_mm"] == 0.5) & (columns["E_MPa"] == 1.0) & (columns["L_mm"] == 9.0)
    forces = columns["fem_force_N"][first].reshape(2, 2)
    assert list(line.get_ydata()) == pytest.approx(forces.max(axis=1).tolist())
    assert min(shade.get_paths()[0].vertices[:, 1]) == pytest.approx(forces.min())


def test_failed_cases_are_crosses_at_the_lower_edge_with_count_and_cause(drawn):
    (figure,) = drawn({"D_mm": [6.0, 8.0, 10.0]}, lose=lambda case: case["D_mm"] == 8.0)
    check_texts(figure)
    assert [crosses(panel) for panel in panels(figure)] == [1, 1]
    assert "failed (1 of 3)" in legend(figure)
    assert "1 of 3 cases failed (not_converged); most often: the press stopped at 62 % of its depth." in note(figure)
    # the points at both sides have no line, so that each has a marker
    assert all("None" not in str(line.get_marker()) for line in panels(figure)[0].get_lines())


def test_errors_far_beyond_the_others_are_arrows_and_a_note(drawn):
    axes = {"D_mm": [float(k) for k in range(6, 30)]}
    columns = columns_of(axes)
    columns["force_error_percent"][[4, 7]] = -900.0, 2500.0
    (figure,) = drawn(axes, columns=columns)
    check_texts(figure)
    error = panels(figure)[1]
    arrows = [(line.get_marker(), *line.get_xdata()) for line in error.get_lines() if line.get_label() == "_beyond"]
    assert sorted(arrows) == [("^", 13.0), ("v", 10.0)]
    assert error.get_ylim()[1] < 100
    assert "2 errors of press force beyond the range of the picture: -900 % to 2500 %." in note(figure)


def test_colours_mean_either_models_or_values_in_one_picture(drawn):
    shown = [FORCE, Shown("ratio", "1", {"FEM": "ratio", "paper": "nu"}, {})]
    axes = {"E_MPa": [1.0, 2.0], "depth_mm": [0.5, 1.0]}
    columns = columns_of(axes) | {"ratio": columns_of(axes)["depth_mm"]}
    figures = drawn(axes, shown, columns=columns)
    assert [bool([text for text in legend(figure) if "$" in text]) for figure in figures] == [True, False]


def test_cases_without_a_result_do_not_hide_those_with_one(drawn):
    (figure,) = drawn({"D_mm": [6.0, 8.0], "f_mm": [4.0, 5.0]}, lose=lambda c: (c["D_mm"], c["f_mm"]) == (6.0, 4.0))
    force, _ = panels(figure)
    assert points(force) == 2
    assert crosses(force) == 1
    assert "$f$ changes nothing" in note(figure)


def test_an_axis_of_which_one_value_has_answers_is_not_called_idle(drawn):
    (figure,) = drawn({"D_mm": [8.0, 100.0], "E_MPa": [0.5, 1.0]}, lose=lambda case: case["D_mm"] > 50)
    assert "changes nothing" not in note(figure)
    assert crosses(panels(figure)[0]) == 2


def test_the_reason_of_failed_cases_is_never_cut(drawn):
    axes = {"D_mm": [6.0, 8.0], "depth_mm": [0.5, 1.0]}
    columns = columns_of(axes, lose=lambda case: case["depth_mm"] > 0.6)
    first = "the depth must be less than 7 mm, the silicone on the axis above and below the magnet, which has 2 mm"
    columns["message"] = np.where(columns["status"] == "ok", "", f"{first}; got 8 mm; take a smaller depth")
    (figure,) = drawn(axes, columns=columns)
    assert note(figure).endswith(f"most often: {first}.")
    check_texts(figure)


def test_a_pure_number_has_no_unit(drawn):
    (figure,) = drawn({"D_mm": [6.0, 8.0]}, shown=(Shown("gain", "1", {"FEM": "fem_force_N"}, {}),))
    assert panels(figure)[0].get_ylabel() == "gain"


@pytest.mark.parametrize("count", [2, 8])
def test_nothing_but_failures(drawn, count):
    axes = {"D_mm": spread(6, 10, 7), "L_mm": spread(9, 12, count)}
    (figure,) = drawn(axes, lose=lambda case: True)
    check_texts(figure)
    first = panels(figure)[0]
    assert (crosses(first) if count == 2 else cells(first)[1]) == 7 * count
    assert f"{7 * count} of {7 * count} cases failed" in note(figure)


def test_a_single_value(drawn):
    (figure,) = drawn({"D_mm": [8.0]})
    check_texts(figure)
    assert points(panels(figure)[0]) == 1
    assert points(panels(figure)[0], "--") == 1


def test_maps_of_large_errors_have_no_legend_for_contours_that_they_do_not_have(drawn):
    axes = {"D_mm": spread(6, 10, 7), "L_mm": spread(20, 40, 8)}
    (figure,) = drawn(axes)
    check_texts(figure)
    assert "No press force by paper has an error within 10 %." in note(figure)
    assert not figure.legends


def test_texts_are_categories_in_the_order_of_the_study(drawn):
    (figure,) = drawn({"law": list(LAWS)})
    check_texts(figure)
    assert [t.get_text() for t in panels(figure)[1].get_xticklabels()] == list(LAWS)
    (both,) = drawn({"law": list(LAWS), "depth_mm": [0.5, 1.0, 2.0]})
    assert [text for text in legend(both) if "law" in text] == [f"law = {law}" for law in LAWS]
    assert panels(both)[1].get_xlabel() == "depth $d$ (mm)"


def test_maps_of_several_models_are_four_in_a_picture(drawn):
    models = {"FEM": "fem_force_N", "formula paper": "analytic_force_N", "formula finite": "finite_force_N"}
    errors = {"formula paper": "force_error_percent", "formula finite": "finite_force_error_percent"}
    axes = {"D_mm": spread(4, 16, 9), "L_mm": spread(9, 40, 12)}
    figures = drawn(axes, [Shown("press force", "N", models, errors)])
    assert [len(panels(figure)) for figure in figures] == [3]
    check_texts(figures[0])
    lines = drawn({"D_mm": [6.0, 8.0], "L_mm": [9.0, 12.0]}, [Shown("press force", "N", models, errors)])
    assert [legend(figure)[:2] for figure in lines] == [["FEM", name] for name in errors]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_sampled_points_are_all_drawn_over_each_axis(drawn, count):
    low = {"D_mm": 6.0, "L_mm": 9.0, "depth_mm": 0.3, "E_MPa": 0.5, "nu": 0.4}
    names = list(low)[:count]
    random = np.random.default_rng(1)
    samples = [
        tuple(low[name] * (1 + share) for name, share in zip(names, row, strict=True))
        for row in random.random((50, count))
    ]
    axes = {name: [point[k] for point in samples] for k, name in enumerate(names)}
    figures = drawn(axes, points=samples, sampled=True, lose=lambda case: case["D_mm"] > 11)
    lost = sum(point[0] > 11 for point in samples)
    for figure in figures:
        check_texts(figure)
    over = [
        p for figure in figures for p in panels(figure) if points(p, "None") + crosses(p) > 0 and not p.collections
    ]
    assert len(over) == 2 * count
    for panel in over:
        fem = [line for line in panel.get_lines() if line.get_marker() in ("o", "^") and len(line.get_xdata()) == 50]
        assert np.isfinite(np.asarray(fem[0].get_ydata(), float)).sum() == 50 - lost
        assert crosses(panel) == lost
    (coloured,) = [p for figure in figures for p in panels(figure) if p.collections]
    assert len(coloured.collections[0].get_offsets()) == 50 - lost


def test_the_grey_bands_are_in_the_legend(drawn):
    (figure,) = drawn({"D_mm": [6.0, 8.0]})
    shades = {patch.get_label(): patch for patch in figure.legends[0].get_patches()}
    # as dark as the bands that lie upon each other
    through = math.prod(1 - patch.get_alpha() for patch in panels(figure)[1].patches)
    assert 1 - shades["error within 5 %"].get_alpha() == pytest.approx(through)
    assert "error within 10 %" in shades
    assert table_plots.STYLE["font.size"] == 12


def test_pictures_of_an_earlier_sweep_do_not_stay(drawn, tmp_path):
    for name in ("sweep-2.png", "sweep-3.png", "other-2.png"):
        (tmp_path / name).write_text("old")
    drawn({"D_mm": [6.0, 8.0]})
    assert sorted(path.name for path in tmp_path.glob("[!.]*")) == ["other-2.png", "sweep.png"]


def test_a_picture_without_a_quantity_is_refused(tmp_path):
    with pytest.raises(BadInput, match="needs an axis, a quantity and a row"):
        sweep_plot.draw(tmp_path / "sweep.png", columns_of({"D_mm": [8.0]}), {"D_mm": [8.0]}, [])


def test_the_pictures_of_a_real_sweep(tmp_path):
    design, load = paper(), {"depth": 1.0}
    models: dict = {"fem": (FemModel("quick", QUICK),), "formulas": ("paper",), "quantities": ("force",)}
    plan = Plan(design, grid({"E": [0.5, 2.0], "f": [5.0, 6.0]}), load, "rigid", **models)
    with store.in_memory() as memory:
        assert len(list(sweep.run(plan, tmp_path, memory, processes=Processes(0)))) > 0
    assert (tmp_path / "sweep.png").stat().st_size > 10_000


def test_errors_of_one_colour_alone_are_drawn(drawn):
    """Without a shear there is no error of the shear force: the others were left out with it."""
    axes = {"depth_mm": [0.5, 1.0], "L_mm": [9.0, 12.0]}
    columns = columns_of(axes)
    columns["force_error_percent"] = np.where(columns["L_mm"] == 9.0, math.nan, -20.0 * columns["depth_mm"])
    (figure,) = drawn(axes, columns=columns)
    lines = [line for line in figure.axes[1].get_lines() if len(line.get_xdata()) == 2]
    assert [-10.0, -20.0] in [list(line.get_ydata()) for line in lines]


def test_errors_name_what_they_are_relative_to(drawn):
    axes = {"depth_mm": [0.5, 1.0], "L_mm": [9.0, 12.0]}
    (figure,) = drawn(axes, [replace(FORCE, error_unit="% of the largest value")])
    assert figure.axes[1].get_ylabel().replace("\n", " ") == "error of press force (% of the largest value)"
