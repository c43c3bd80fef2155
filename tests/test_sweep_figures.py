"""None"""

import numpy as np
import pandas as pd
import pytest

from fem.accuracy import QUICK
from geometry.design import paper
from studies.inputs.study_input import grid
from studies.mechanics.study_cases import Cases, FemModel, Plan
from studies.output import figures
from studies.sweeps import sweep_figures
from studies.sweeps.sweep_figures import View


def table(axes, **results):
    """A sweep over a grid: results are functions of the axes."""
    grid = np.meshgrid(*axes.values(), indexing="ij")
    points = {name: values.ravel() for name, values in zip(axes, grid, strict=True)}
    columns = points | {name: np.asarray(rule(*points.values()), dtype=float) for name, rule in results.items()}
    return pd.DataFrame(columns).assign(status="ok")


AXES = {"D_mm": [6.0, 8.0], "L_mm": [9.0, 12.0, 18.0], "depth_mm": [0.5, 1.0]}


def view_of(whole, columns=("fem_force_N",)):
    whole = whole.assign(failed=whole["status"] != "ok")
    return sweep_figures.view(whole, sweep_figures.axes_of(whole), columns)


def test_depth_is_horizontal_and_the_longest_other_axis_has_colours():
    assert view_of(table(AXES, fem_force_N=lambda D, L, d: D * d / L)) == View("depth_mm", "L_mm", ("D_mm",))


@pytest.mark.parametrize(("counts", "maps"), [((6, 7), False), ((7, 7), True), ((3, 40), False)])
def test_lines_up_to_six_values_and_maps_beyond(counts, maps):
    axes = {"D_mm": np.linspace(6, 8, counts[0]), "L_mm": np.linspace(9, 20, counts[1])}
    whole = table(axes, fem_force_N=lambda D, L: D / L)
    assert view_of(whole).maps == maps
    (figure,) = sweep_figures.sweep(whole)
    assert len(figure.data) == counts[0] * counts[1]


def test_axes_without_effect_have_no_part_and_are_named():
    whole = table(AXES, fem_force_N=lambda D, L, d: d * D)
    assert view_of(whole) == View("depth_mm", "D_mm")
    (figure,) = sweep_figures.sweep(whole)
    assert len(figure.data) == 4
    assert figure.notes == ("L changes nothing in the press force.",)


def test_lines_hold_every_number_of_the_table():
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d / L, analytic_force_N=lambda D, L, d: D * d)
    (figure,) = sweep_figures.sweep(whole)
    assert list(dict.fromkeys(figure.data["panel"])) == ["D = 6 mm", "D = 8 mm"]
    assert set(figure.data["series"]) == {"L = 9 mm", "L = 12 mm", "L = 18 mm"}
    assert set(figure.data["model"]) == {"finite elements", "the paper's formula"}
    expected = [*whole["fem_force_N"], *whole["analytic_force_N"]]
    np.testing.assert_allclose(sorted(figure.data["press force (N)"]), sorted(expected))


def test_map_of_errors_has_each_error_in_its_cell():
    axes = {"L_mm": np.linspace(9, 12, 8), "depth_mm": np.linspace(0.5, 1.0, 7)}
    whole = table(axes, fem_force_N=lambda L, d: L * d, force_error_percent=lambda L, d: L + d - 2)
    value, error = sweep_figures.sweep(whole)
    assert value.title == "Press force over depth"
    assert error.title == "Error of the press force, the formula"
    off = error.data["L (mm)"] + error.data["depth (mm)"] - 2 - error.data["error (%)"]
    np.testing.assert_allclose(off, 0, atol=1e-9)
    within = 100 * (whole["force_error_percent"] <= 10).mean()
    assert f"{within:.0f} % of the cases are within 10 %" in error.caption


def test_failed_cases_are_counted_with_their_cause_and_marked():
    whole = table(AXES, fem_force_N=lambda D, L, d: D * d / L).assign(message="")
    whole.loc[0, ["status", "message"]] = ["bad_input", "the magnet does not fit; take a smaller one"]
    (figure,) = sweep_figures.sweep(whole)
    assert figure.data["failed"].sum() == 1
    assert figure.notes == (
        "1 of 12 cases failed (bad_input); most often: the magnet does not fit; take a smaller one.",
    )


def test_many_combinations_are_shown_by_their_extremes():
    axes = {"E_MPa": np.arange(1.0, 6.0), "nu": [0.45, 0.48, 0.4998], **AXES}
    whole = table(axes, fem_force_N=lambda E, nu, D, L, d: E * D * d / L + 1e-3 * nu)
    (figure,) = sweep_figures.sweep(whole)
    assert figure.data["panel"].nunique() <= sweep_figures.MOST_PANELS
    assert any("over all values of nu" in note for note in figure.notes)
    assert figure.data["high"].max() == whole["fem_force_N"].max()
    assert figure.data["low"].min() == whole["fem_force_N"].min()


def test_errors_far_beyond_the_others_stand_at_the_edge_with_a_note():
    errors = [*np.linspace(-20, 20, 40), 5000.0]
    axes = {"depth_mm": np.linspace(0.1, 2, 41)}
    whole = table(axes, fem_force_N=lambda d: d, force_error_percent=lambda d: errors)
    _, error = sweep_figures.sweep(whole)
    assert "1 error stands at the edge: 5000 %." in error.notes
    assert error.data["error (%)"].max() == 5000
    y = error.chart.to_dict()["layer"][-1]["encoding"]["y"]["scale"]
    assert y["domain"][1] < 30
    assert y["clamp"]


def test_sampled_points_are_shown_over_each_axis():
    rng = np.random.default_rng(0)
    D, L = rng.uniform(5, 10, 40), rng.uniform(10, 20, 40)
    columns = {"D_mm": D, "L_mm": L, "fem_force_N": D / L, "force_error_percent": 10 * D - 50, "status": "ok"}
    value, error, spots = sweep_figures.sweep(pd.DataFrame(columns))
    assert set(value.data["panel"]) == {"D (mm)", "L (mm)"}
    # the axis with the greatest effect comes first
    assert next(iter(error.data["panel"])) == "D (mm)"
    assert len(value.data) == 80
    assert list(spots.data)[:2] == ["D (mm)", "L (mm)"]


def test_errors_of_a_force_that_changes_sign_are_over_the_largest():
    """The formula is too high everywhere: relative to a pull, its push had a negative error."""
    whole = table(
        {"L_mm": [9.0, 12.0], "depth_mm": [0.5, 1.0]},
        fem_force_N=lambda L, d: d - 0.75,
        analytic_force_N=lambda L, d: d,
        force_error_percent=lambda L, d: 100 * (d / (d - 0.75) - 1),
    )
    figure = sweep_figures.sweep(whole)[-1]
    assert set(figure.data["error (% of the largest press force)"]) == {300.0}


def test_axes_that_vary_together_are_one_axis_with_a_note():
    whole = table({"D_mm": [8.0, 9.0, 10.0]}, fem_force_N=lambda D: D)
    whole.insert(1, "L_mm", [9.0, 11.0, 11.0])
    (figure,) = sweep_figures.sweep(whole)
    assert list(figure.data) == ["D (mm)", "press force (N)", "series"]
    assert figure.notes == ("L varies together with D.",)


def test_log_spaced_values_have_logarithmic_axes():
    whole = table({"D_mm": [0.1, 1.0, 10.0, 100.0]}, fem_force_N=lambda D: D**2)
    (figure,) = sweep_figures.sweep(whole)
    encoding = figure.chart.to_dict()["layer"][-1]["encoding"]
    assert encoding["x"]["scale"]["type"] == encoding["y"]["scale"]["type"] == "log"


# What the pictures of a sweep show: which rows, which quantities, which note.


def plan_of(factors, load=None, quantities=("force",)):
    return Plan(paper(), factors, load or {}, "rigid", (FemModel("quick", QUICK),), ("paper",), quantities)


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


def test_all_rows_are_drawn(drawn, tmp_path):
    collected(plan_of(grid({"D": [6.0, 8.0], "depth": [0.5, 1.0, 1.5]}))).draw(tmp_path / "sweep.png")
    (force, error), notes = drawn["sweep.png"]
    own = force.data[force.data["model"] == "finite elements"]
    assert sorted(own["press force (N)"]) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert set(force.data["model"]) == {"finite elements", "the paper's formula"}
    assert error.title == "Error of the press force, the paper's formula"
    assert notes == []


def test_a_huge_study_is_thinned_with_a_note(drawn, monkeypatch, tmp_path):
    monkeypatch.setattr(sweep_figures, "MOST_DRAWN", 12)
    axes = {"D": [6.0, 8.0], "depth": [0.1 * k for k in range(1, 12)]}
    collected(plan_of(grid(axes))).draw(tmp_path / "sweep.png")
    (force, *_), notes = drawn["sweep.png"]
    # both ends stay
    depths = sorted(set(force.data["depth (mm)"]))
    assert depths == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9, 1.1])
    assert notes == ["Of 11 values of depth, 6 are drawn; the table has all."]


def test_the_pictures_are_written_and_those_of_an_earlier_sweep_do_not_stay(tmp_path):
    (tmp_path / "sweep-2.png").touch()
    files = collected(plan_of(grid({"D": [6.0, 8.0], "depth": [0.5, 1.0]}))).draw(tmp_path / "sweep.png")
    assert files == [tmp_path / "sweep.png"]
    assert files[0].stat().st_size > 10_000
    assert list(tmp_path.glob("*.png")) == files


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
    assert notes == [
        "Forces are proportional to E: drawn for E = 1 MPa.",
        "f has no effect on what is shown.",
    ]
