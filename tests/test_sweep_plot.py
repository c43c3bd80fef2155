"""The picture of a sweep: which axis is shown how, and that any number of axes makes a picture without a warning."""

import itertools
import math
import warnings

import pytest
from matplotlib.figure import Figure

from studies.exploration import sweep_plot
from studies.exploration.sweep_rows import PressAnswer, SweepRow
from studies.output import table_plots

BASE = {"D": 8.0, "L": 9.0, "f": 5.0, "E": 1.0, "depth": 1.0}


def row_of(case, fem_force, analytic_force, error):
    """The row of a case of which the force is known by both models."""
    fem, analytic = (PressAnswer(force, -0.5, 1.0) for force in (fem_force, analytic_force))
    errors = (error, math.nan, math.nan)
    return SweepRow(*case.values(), fem, analytic, *errors, (), 7.2, 0.01, 1, 1.0, "ok", "")


def rows_of(axes, lost=()):
    """Rows of a bar that is pressed: the force goes with E D^2 depth^1.5 / L, its error with D, L and the depth."""
    rows = []
    for point in itertools.product(*axes.values()):
        v = BASE | dict(zip(axes, point, strict=True))
        force = v["E"] * v["D"] ** 2 * v["depth"] ** 1.5 / v["L"]
        ratio = 0.6 + 0.1 * v["depth"] * v["D"] / v["L"]
        figures = (math.nan,) * 3 if point in lost else (force, ratio * force, 100 * (ratio - 1))
        rows.append(row_of(v, *figures))
    return rows


ALL = {
    "D": [6.0, 8.0, 10.0],
    "E": [0.5, 1.0],
    "depth": [0.5, 1.0, 1.5, 2.0],
    "L": [9.0, 10.0, 11.0, 12.0, 13.0],
    "f": [4.0, 5.0],
}


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """Draw, any warning an error, and return the figure."""
    figures = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda self, *a, **k: (figures.append(self), save(self, *a, **k)))

    def draw(axes, **how):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            sweep_plot.draw(tmp_path / "sweep.png", rows_of(axes, **how), axes)
        assert (tmp_path / "sweep.png").read_bytes().startswith(b"\x89PNG")
        return figures[-1]

    return draw


def texts(figure):
    return " ".join([figure.get_supxlabel(), *(text.get_text() for text in figure.legends[0].get_texts())])


def test_roles_of_the_axes():
    look = sweep_plot.view(rows_of(ALL), ALL)
    assert (look.x, look.colour, look.across, look.down, look.idle) == ("D", "L", "depth", "E", ("f",))
    alone = {"f": [4.0, 5.0]}
    assert sweep_plot.view(rows_of(alone), alone).x == "f"
    first = {"f": [4.0, 5.0], "E": [1.0, 2.0]}
    assert sweep_plot.view(rows_of(first), first) == sweep_plot.View("E", "", "", "", (), ("f",))


@pytest.mark.parametrize("count", range(1, 6))
def test_any_number_of_axes_without_a_warning(drawn, count):
    axes = dict(itertools.islice(ALL.items(), count))
    figure = drawn(axes)
    width, height = figure.get_size_inches()
    assert width == 7
    assert height < 12
    lines = [len(panel.get_lines()) for panel in figure.axes]
    # two models of at most six colours, and the axis of no error
    assert max(lines) <= 2 * sweep_plot.MOST_LINES + 1
    legend = figure.legends[0].get_window_extent()
    assert legend.x0 >= 0
    assert legend.x1 <= figure.bbox.width
    assert all(panel.get_position().height > 0.05 for panel in figure.axes)


def test_four_axes_are_small_multiples(drawn):
    axes = {name: ALL[name] for name in ("D", "E", "depth", "L")}
    figure = drawn(axes)
    # a row of forces for each E, one row of errors, which are the same for both; 3 of 4 depths side by side
    assert len(figure.axes) == 9
    assert [panel.get_title() for panel in figure.axes[:3]] == [f"depth $d$ = {d} mm" for d in ("0.5", "1.5", "2")]
    assert "E$ = 0.5 MPa" in figure.axes[0].get_ylabel()
    assert figure.axes[6].get_ylabel() == "formula's error (%)"
    assert "Of 4 values of $d$ 3 are drawn" in texts(figure)
    assert "$L$ = 9 mm" in texts(figure)


def test_a_line_has_all_its_points(drawn):
    axes = {"depth": [0.5, 1.0, 2.0], "E": [1.0, 2.0]}
    force, error = drawn(axes).axes
    assert [list(line.get_ydata()) for line in force.get_lines()[::2]] == [
        [row.fem.force_N for row in rows_of(axes) if row.E_MPa == e] for e in axes["E"]
    ]
    assert force.get_xlabel() == "" or error.get_xlabel() == "depth $d$ (mm)"


def test_an_error_that_is_the_same_for_all_colours_is_one_grey_line(drawn):
    figure = drawn({"depth": [0.5, 1.0], "E": [1.0, 2.0, 3.0]})
    _, error = figure.axes
    curves = [line for line in error.get_lines() if len(line.get_xdata()) == 2 and line.get_marker() == "o"]
    assert [line.get_color() for line in curves] == [sweep_plot.GREY]
    assert "The error is the same for every $E$" in texts(figure)


def test_cases_without_a_result_are_said_and_do_not_hide_others(drawn):
    axes = {"D": [6.0, 8.0], "f": [4.0, 5.0]}
    figure = drawn(axes, lost={(6.0, 4.0)})
    (fem, _), said = figure.axes[0].get_lines(), texts(figure)
    assert not any(map(math.isnan, fem.get_ydata()))
    assert "1 of 4 cases have no FEM result" in said
    assert "$f$ changes neither the force" in said


def test_nothing_but_failures(drawn):
    axes = {"D": [6.0, 8.0]}
    assert "2 of 2 cases" in texts(drawn(axes, lost={(6.0,), (8.0,)}))


def test_the_grey_bands_are_in_the_legend(drawn):
    figure = drawn({"D": [6.0, 8.0]})
    assert "error within 10 % error within 5 %" in texts(figure)
    shades = {patch.get_label(): patch for patch in figure.legends[0].get_patches()}
    # as dark as the bands that lie upon each other
    through = math.prod(1 - patch.get_alpha() for patch in figure.axes[1].patches)
    assert 1 - shades["error within 5 %"].get_alpha() == pytest.approx(through)


def test_an_axis_of_which_one_value_has_answers_is_not_called_idle(drawn):
    axes = {"D": [8.0, 100.0], "E": [0.5, 1.0]}
    assert "changes neither" not in texts(drawn(axes, lost=[(100.0, 0.5), (100.0, 1.0)]))


def test_many_values(drawn):
    axes = {"depth": [0.1 * k for k in range(1, 41)], "E": [0.1 * k for k in range(1, 31)]}
    figure = drawn(axes)
    assert len(figure.axes[0].get_lines()) == 12
    assert "Of 30 values of $E$ 6 are drawn" in texts(figure)
    assert table_plots.STYLE["font.size"] == 12
