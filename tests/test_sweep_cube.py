import itertools

import numpy as np

from studies.exploration import sweep_cube
from studies.exploration.sweep_cube import cube_of

AXES = {"D_mm": [8.0, 6.0], "law": ["b", "a"], "E_MPa": [1.0, 2.0, 3.0]}


def columns_of(axes, order=None, lost=()):
    points = list(itertools.product(*axes.values()))
    points = points if order is None else [points[k] for k in order]
    columns = {name: np.array([p[k] for p in points], dtype=object) for k, name in enumerate(axes)}
    number = np.arange(len(points), dtype=float) if order is None else np.array(order, dtype=float)
    status = np.array(["failed" if point in lost else "ok" for point in points])
    return columns | {"x": number, "status": status}


def test_rows_in_any_order_have_their_place():
    cube = cube_of(columns_of(AXES, order=[3, 0, 11, 5, 1, 2, 4, 6, 7, 8, 9, 10]), AXES)
    # numbers in rising order, texts in that of the study
    assert cube.values("x").tolist() == np.arange(12.0).reshape(2, 2, 3)[::-1].tolist()


def test_zipped_values_that_repeat_are_told_apart_by_the_order_of_the_rows():
    axes = {"D_mm": [8.0, 8.0, 10.0], "E_MPa": [1.0, 2.0]}
    cube = cube_of(columns_of(axes), axes)
    assert cube.axes["D_mm"].values == ("8 (no. 1)", "8 (no. 2)", "10")
    assert cube.values("x").tolist() == [[0, 1], [2, 3], [4, 5]]


def test_failed_cases_have_no_value_and_are_counted():
    cube = cube_of(columns_of(AXES, lost=[(6.0, "a", 2.0)]), AXES)
    assert np.argwhere(np.isnan(cube.values("x"))).tolist() == [[0, 1, 1]]
    assert cube.failures()[0, 1, 1] == cube.failures().sum() == 1


def test_an_axis_has_an_effect_if_a_column_changes_or_one_value_fails_everywhere():
    columns = columns_of({"D_mm": [6.0, 8.0], "E_MPa": [1.0, 2.0]})
    columns |= {"y": np.array([1.0, 1.0 + 1e-9, 2.0, 2.0]), "z": np.ones(4)}
    cube = cube_of(columns, {"D_mm": [6.0, 8.0], "E_MPa": [1.0, 2.0]})
    assert cube.effective(["y"]) == ["D_mm"]
    assert cube.effective(["z"]) == []
    columns["status"] = np.array(["ok", "failed", "ok", "failed"])
    assert cube_of(columns, {"D_mm": [6.0, 8.0], "E_MPa": [1.0, 2.0]}).effective(["z"]) == ["E_MPa"]


def test_folded_and_idle_axes():
    values = np.array([[np.nan, 1.0], [-3.0, 2.0]])
    assert sweep_cube.first(values, [1]).tolist() == [[1.0], [-3.0]]
    assert sweep_cube.extreme(values, [0, 1]).tolist() == [[-3.0]]
    assert sweep_cube.effect(values, 0) == 0.5
