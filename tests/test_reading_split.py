"""Errors of the readings: each part has its own cause, and their sum is the whole."""

import dataclasses
import math

import numpy as np
import pytest

from geometry.design import paper
from studies.simulation import beam_cells
from studies.validation import reading_split

approx = pytest.approx


def table(tilt=0.0, aside=0.5, lower=0.4):
    """Two shears and a press of the paper's sensor: the finite elements' poses, and the formula's at (0.5, -0.4)."""
    n = 3
    moved = np.array([1.0, 2.0, 0.0])
    return {
        **{f"{name}_mm": np.full(n, size) for name, size in (("D", 8.0), ("L", 9.0), ("f", 5.0), ("l0", 7.2))},
        "magnet_diameter_mm": np.full(n, 4.0),
        "magnet_height_mm": np.full(n, 2.0),
        "magnet_edge_radius_mm": np.full(n, 0.1),
        "nu": np.full(n, 0.4998),
        "depth_mm": np.full(n, 1.0),
        "shear_mm": moved,
        "status": np.full(n, "ok", dtype=object),
        "fem_force_N": np.ones(n),
        "fem_force_x_N": np.ones(n),
        "fem_shift_x_mm": aside * moved,
        "fem_shift_y_mm": np.zeros(n),
        "fem_shift_z_mm": np.full(n, -lower),
        "fem_tilt_rad": tilt * moved,
        "fem_tilt_y_rad": np.zeros(n),
        "analytic_paper_shift_x_mm": 0.5 * moved,
        "analytic_paper_shift_y_mm": np.zeros(n),
        "analytic_paper_shift_z_mm": np.full(n, -0.4),
        "analytic_paper_tilt_rad": np.zeros(n),
        "analytic_paper_tilt_y_rad": np.zeros(n),
    }


def split(values, design=paper()):
    body = beam_cells.bodies(values)[0]
    grids = [beam_cells.cells(values, body, kind) for kind in ("press", "shear")]
    return reading_split.split_cells(values, grids, design)


def cells(**pose):
    return split(table(**pose))


def largest(rows, part):
    return max(abs(row[f"{part}_percent_FS"]) for row in rows)


def test_the_papers_pose_and_field_have_no_error():
    rows = cells()
    assert len(rows) == 9
    assert largest(rows, "total") == approx(0, abs=1e-6)
    assert largest(rows, "dipole") > 1


@pytest.mark.parametrize(
    ("pose", "part", "other"), [({"tilt": 0.1}, "tilt", "mechanics"), ({"aside": 0.4}, "mechanics", "tilt")]
)
def test_each_part_has_its_cause(pose, part, other):
    rows = cells(**pose)
    assert largest(rows, part) > 1
    assert largest(rows, other) == approx(0, abs=1e-9)


def test_parts_add_up():
    for row in cells(tilt=0.1, aside=0.4, lower=0.3):
        parts = row["mechanics_percent_FS"] + row["tilt_percent_FS"] + row["field_percent_FS"]
        assert row["total_percent_FS"] == approx(parts)


def test_means_are_by_load_and_slenderness():
    means = reading_split.split_means(
        cells(tilt=0.1), {"short": lambda ratio: ratio < 2, "long": lambda ratio: False}
    )
    assert [(mean["load"], mean["slenderness"], mean["states"]) for mean in means] == [
        ("press", "short", 1),
        ("shear", "short", 2),
    ]
    assert means[0]["tilt_percent_FS"] == 0
    assert means[1]["tilt_percent_FS"] > 1


@pytest.mark.parametrize("column", ["fem_shift_x_mm", "fem_shift_z_mm", "analytic_paper_shift_x_mm", "fem_tilt_rad"])
def test_an_unknown_pose_is_no_motion(column):
    values = table(aside=0.4)
    values[column] = np.where(values["shear_mm"] == 2.0, np.nan, values[column])
    rows, whole = split(values), cells(aside=0.4)
    for row in rows:
        assert math.isnan(row["total_percent_FS"]) == (row["shear_over_D"] == 0.25)
    (mean,) = (m for m in reading_split.split_means(rows, {"all": lambda _: True}) if m["load"] == "shear")
    assert mean["states"] == 1
    assert len(rows) == len(whole)


def test_a_press_may_have_no_columns_across():
    values = table()
    for name in ("fem_shift_x_mm", "fem_shift_y_mm", "fem_tilt_rad", "analytic_paper_tilt_rad"):
        values[name] = np.where(values["shear_mm"] == 0, np.nan, values[name])
    assert all(math.isfinite(row["total_percent_FS"]) for row in split(values))


def test_the_sensor_is_that_of_the_study():
    """Its elements' height, and sizes of the magnet that no axis varies."""
    values = {name: column for name, column in table().items() if name not in ("magnet_diameter_mm", "l0_mm")}
    own = dataclasses.replace(paper(), c=3.0, magnet_diameter=3.0)
    sensor = reading_split.sensor(values, 0, own)
    assert (sensor.c, sensor.magnet_diameter, sensor.l0) == (3.0, 3.0, pytest.approx(own.l0))
    by_c = [[row["dipole_percent_FS"] for row in split(values, dataclasses.replace(own, c=c))] for c in (2.0, 3.0)]
    assert by_c[0] != by_c[1]


def test_a_chip_has_its_own_elements():
    rows = split(table(), dataclasses.replace(paper(), hall_layout="tmag5273a1"))
    assert {row["element"] for row in rows} == {"chip x", "chip y", "chip -z"}
