"""What the pictures of a sweep show: which rows, which quantities, which note."""

import numpy as np
import pytest
from matplotlib import pyplot

from fem.accuracy import QUICK
from geometry.design import paper
from studies.exploration import sweep_pictures, sweep_plot
from studies.exploration.study_cases import Cases, FemModel, Plan
from studies.inputs.study_axes import Factor
from studies.inputs.study_input import grid


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
    """What is handed to the drawing."""
    calls = []
    monkeypatch.setattr(sweep_plot, "draw", lambda *args, **kwargs: calls.append((args, kwargs)) or [])
    return calls


def collected(plan):
    pictures = sweep_pictures.Collected(plan)
    table = table_of(plan)
    # in two batches, the second one short
    cut = plan.count - 1
    for rows in (slice(0, cut), slice(cut, None)):
        pictures.add({name: values[rows] for name, values in table.items()}, np.arange(plan.count)[rows])
    return pictures


def test_all_rows_are_drawn(drawn, tmp_path):
    collected(plan_of(grid({"D": [6.0, 8.0], "depth": [0.5, 1.0, 1.5]}))).draw(tmp_path / "sweep.png")
    (_, columns, axes, (force,)), options = drawn[0]
    assert axes == {"D_mm": [6.0, 8.0], "depth_mm": [0.5, 1.0, 1.5]}
    assert columns["fem_force_N"].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert (force.values, force.errors) == (
        {"FEM": "fem_force_N", "formula paper": "analytic_force_N"},
        {"formula paper": "force_error_percent"},
    )
    assert (options["sampled"], options["notes"]) == (False, [])


def test_a_shear_shows_the_shear_force_first(drawn, tmp_path):
    collected(plan_of(grid({"shear": [0.5, 1.0]}), {"depth": 1.0})).draw(tmp_path / "sweep.png")
    (_, _, _, shown), _ = drawn[0]
    assert shown[0].label == "shear force"


def test_zipped_axes_are_one_axis_with_a_note(drawn, tmp_path):
    factors = (Factor(("D", "L"), ((8.0, 9.0, 10.0), (9.0, 11.0, 11.0))),)
    collected(plan_of(factors, {"depth": 0.5})).draw(tmp_path / "sweep.png")
    (_, _, axes, _), options = drawn[0]
    assert axes == {"D_mm": [8.0, 9.0, 10.0]}
    assert options["notes"] == ["L varies together with D."]


def test_zipped_axes_whose_values_repeat_are_named_by_all_their_values(drawn, tmp_path):
    factors = (Factor(("D", "L"), ((8.0, 8.0, 10.0), (9.0, 11.0, 11.0))), *grid({"depth": [0.5, 1.0]}))
    collected(plan_of(factors)).draw(tmp_path / "sweep.png")
    (_, columns, axes, _), options = drawn[0]
    points = ["8 mm, 9 mm", "8 mm, 11 mm", "10 mm, 11 mm"]
    assert axes == {"$D$, $L$": points, "depth_mm": [0.5, 1.0]}
    assert columns["$D$, $L$"].tolist() == [point for point in points for _ in range(2)]
    assert options["notes"] == []


def test_errors_of_a_force_that_changes_sign_are_over_the_largest_force():
    """The formula is too high everywhere: relative to a pull of 0.1 N, its push of 0.1 N had an error of -200 %."""
    columns = {"fem": np.array([-0.1, 0.0, 0.4, np.nan]), "paper": np.array([0.1, 0.2, 0.5, 1.0])}
    shown = sweep_plot.Shown("press force", "N", {"FEM": "fem", "paper": "paper"}, {"paper": "error"})
    drawn = sweep_pictures._comparable(shown, columns)
    assert drawn.error_unit == "% of the largest value"
    np.testing.assert_allclose(columns[drawn.errors["paper"]], [50, 50, 25, np.nan])


@pytest.mark.parametrize("fem", [[0.1, 0.2], [-0.1, -0.2], [1e-12, 0.2]])
def test_errors_of_a_force_of_one_sign_stay_relative(fem):
    columns = {"fem": np.array(fem), "paper": np.array([np.sign(fem[1]) * 0.3 * (fem[0] != 1e-12) - 1e-13, fem[1]])}
    shown = sweep_plot.Shown("press force", "N", {"FEM": "fem", "paper": "paper"}, {"paper": "error"})
    assert sweep_pictures._comparable(shown, columns) is shown


def test_a_sample_has_all_its_axes(drawn, tmp_path):
    factors = (Factor(("D", "L"), ((8.0, 8.5, 9.0), (9.0, 11.0, 10.0)), sampled=True),)
    collected(plan_of(factors, {"depth": 0.5})).draw(tmp_path / "sweep.png")
    (_, _, axes, _), options = drawn[0]
    assert axes == {"D_mm": [8.0, 8.5, 9.0], "L_mm": [9.0, 11.0, 10.0]}
    assert options["sampled"]


def test_a_huge_study_is_thinned_with_a_note(drawn, monkeypatch, tmp_path):
    monkeypatch.setattr(sweep_pictures, "MOST_DRAWN", 12)
    axes = {"D": [6.0, 8.0], "depth": [0.1 * k for k in range(1, 12)]}
    collected(plan_of(grid(axes))).draw(tmp_path / "sweep.png")
    (_, columns, shown_axes, _), options = drawn[0]
    # both ends stay
    assert shown_axes["depth_mm"] == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9, 1.1])
    assert len(columns["status"]) == 12
    assert options["notes"] == ["Of 11 values of depth, 6 are drawn; the table has all."]


def test_the_pictures_are_written(tmp_path):
    files = collected(plan_of(grid({"D": [6.0, 8.0], "depth": [0.5, 1.0]}))).draw(tmp_path / "sweep.png")
    assert [file.name for file in files] == ["sweep.png"]
    assert files[0].stat().st_size > 10_000
    pyplot.close("all")


def test_a_large_study_shows_one_modulus_and_one_layout(drawn, monkeypatch, tmp_path):
    """Forces are proportional to E, and do not depend on f."""
    monkeypatch.setattr(sweep_pictures, "LARGE", 20)
    plan = plan_of(grid({"E": [0.5, 1.0, 2.0], "f": [5.0, 6.0], "D": [7.0, 8.0], "depth": [0.5, 1.0]}))
    pictures = sweep_pictures.Collected(plan)
    batch = Cases(plan).batch(np.arange(plan.count))
    axes = {f"{name}_{'MPa' if name == 'E' else 'mm'}": values for name, values in batch.axes.items()}
    forces = dict.fromkeys(("fem_force_N", "analytic_force_N", "force_error_percent"), batch.E)
    texts = {name: np.full(plan.count, "ok", dtype=object) for name in ("status", "message")}
    pictures.add(axes | forces | texts, np.arange(plan.count))
    pictures.draw(tmp_path / "sweep.png")
    (_, columns, shown_axes, _), options = drawn[0]
    assert shown_axes == {"D_mm": [7.0, 8.0], "depth_mm": [0.5, 1.0]}
    # the modulus that is nearest to that of the base design
    assert columns["fem_force_N"].tolist() == [1.0] * 4
    assert options["notes"] == [
        "Forces are proportional to E: drawn for E = 1 MPa.",
        "f has no effect on what is shown.",
    ]
