import numpy as np
import pytest

from studies.report import sweep_figures
from studies.report.folder_contents import Table


def table(axes, **results):
    """A sweep over a grid: results are functions of the axes."""
    grid = np.meshgrid(*axes.values(), indexing="ij")
    points = {name: values.ravel() for name, values in zip(axes, grid, strict=True)}
    columns = points | {name: np.asarray(rule(*points.values()), dtype=float) for name, rule in results.items()}
    columns["status"] = np.array(["ok"] * len(next(iter(points.values()))), dtype=object)
    return Table("sweep.csv", {name: np.asarray(values, dtype=object) for name, values in columns.items()})


AXES = {"D_mm": [6.0, 8.0], "L_mm": [9.0, 12.0, 18.0], "depth_mm": [0.5, 1.0]}


def test_depth_is_horizontal_and_the_longest_other_axis_has_colours():
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d / L)
    assert sweep_figures.grid_of(whole) == sweep_figures.Grid("depth_mm", "L_mm", ("D_mm",))


def test_lines_hold_every_number_of_the_table():
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d / L, analytic_force_N=lambda D, L, d: D * d)
    (figure,) = sweep_figures.sweep(whole)
    assert [panel.title for panel in figure.panels] == ["D = 6 mm", "D = 8 mm"]
    values = sorted(y for panel in figure.panels for one in panel.series for y in one.y)
    expected = [*whole.floats("fem_force_N"), *whole.floats("analytic_force_N")]
    np.testing.assert_allclose(values, sorted(expected), rtol=1e-5)


def test_map_of_errors_has_each_error_in_its_cell():
    whole = table(
        {"L_mm": [9.0, 12.0], "depth_mm": [0.5, 1.0]},
        fem_force_N=lambda L, d: L * d,
        force_error_percent=lambda L, d: L + d,
    )
    figure = sweep_figures.sweep(whole)[-1]
    assert figure.kind == "map"
    assert figure.x.categories == ("0.5", "1")
    assert figure.panels[0].cells == ((9.5, 10.0), (12.5, 13.0))
    assert figure.title == "Error of the press force, the formula"
    assert figure.caption.startswith("Error of the formula against finite elements")
    assert "25 % of the cases are within 10 %" not in figure.caption
    assert "50 % of the cases are within 10 %" in figure.caption


def test_failed_case_leaves_its_cell_empty():
    whole = table(
        {"L_mm": [9.0, 12.0], "depth_mm": [0.5, 1.0]},
        fem_force_N=lambda L, d: L * d,
        force_error_percent=lambda L, d: L + d,
    )
    whole.columns["status"][0] = "not_converged"
    figures = sweep_figures.sweep(whole)
    assert figures[-1].panels[0].cells == ((None, 10.0), (12.5, 13.0))
    assert figures[0].notes[-1] == "The table has 4 cases, 1 of them failed."


def test_many_combinations_are_named_as_left_out():
    axes = {"E_MPa": list(np.arange(1.0, 6.0)), "nu": [0.45, 0.48, 0.4998], **AXES}
    whole = table(axes, fem_force_N=lambda E, nu, D, L, d: E * D * d / L)
    (figure,) = sweep_figures.sweep(whole)
    assert len(figure.panels) == sweep_figures.MOST_PANELS
    assert any("combinations of the other axes are drawn" in note for note in figure.notes)


def test_sampled_points_are_shown_over_each_axis():
    rng = np.random.default_rng(0)
    D, L = rng.uniform(5, 10, 40), rng.uniform(10, 20, 40)
    columns = {"D_mm": D, "L_mm": L, "fem_force_N": D / L, "status": np.array(["ok"] * 40, dtype=object)}
    (figure,) = sweep_figures.sweep(Table("sweep.csv", columns))
    assert [panel.x for panel in figure.panels] == ["D (mm)", "L (mm)"]
    assert not figure.shared
    assert len(figure.panels[0].series[0].x) == 40


@pytest.mark.parametrize("status", ["bad_input", "not_converged"])
def test_sweep_of_failures_has_no_figure(status):
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d)
    whole.columns["status"][:] = status
    assert sweep_figures.sweep(whole) == []


def test_errors_of_a_force_that_changes_sign_are_over_the_largest():
    whole = table(
        {"L_mm": [9.0, 12.0], "depth_mm": [0.5, 1.0]},
        fem_force_N=lambda L, d: d - 0.75,
        analytic_force_N=lambda L, d: d,
        force_error_percent=lambda L, d: 100 * (d / (d - 0.75) - 1),
    )
    figure = sweep_figures.sweep(whole)[-1]
    assert figure.value == "error (% of the largest press force)"
    assert {cell for row in figure.panels[0].cells for cell in row} == {300.0}
