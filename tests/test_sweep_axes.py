import numpy as np
import pytest

from studies.exploration import sweep_axes
from studies.exploration.sweep_axes import axis_of


@pytest.mark.parametrize(
    ("column", "label"),
    [
        ("D_mm", "$D$ (mm)"),
        ("depth_mm", "depth $d$ (mm)"),
        ("plate_tilt_deg", "plate tilt (°)"),
        ("hall_gain_V_per_T", "hall gain (V/T)"),
        ("magnet_height_mm", "magnet height (mm)"),
        ("speed_mm_per_s", "speed (mm/s)"),
        ("law", "law"),
        ("nu", r"$\nu$"),
    ],
)
def test_names_have_symbol_and_unit(column, label):
    assert axis_of(column, [1.0, 2.0]).label == label


def test_only_log_spaced_values_have_a_logarithmic_axis():
    assert axis_of("E_MPa", np.geomspace(0.05, 5, 9).tolist()).log
    assert axis_of("E_MPa", [0.1, 1.0, 10.0]).log
    assert not axis_of("E_MPa", [1.0, 2.0, 3.0, 4.0]).log
    assert not axis_of("E_MPa", [0.0, 1.0, 10.0]).log
    assert not axis_of("D_mm", [6.0, 8.0, 10.0, 12.0]).log
    assert not axis_of("law", ["a", "b", "c"]).log


def test_cells_meet_between_the_values_and_hold_them():
    for values in ([1.0, 2.0, 5.0], [0.1, 1.0, 10.0], [8.0], [0.0], ["a", "b"]):
        axis = axis_of("x", values)
        edges = axis.edges()
        assert len(edges) == len(axis) + 1
        assert (edges[:-1] < axis.positions).all()
        assert (axis.positions < edges[1:]).all()


def test_rows_find_their_value():
    numbers = axis_of("D_mm", [10.0, 6.0, 8.0])
    assert sweep_axes.index_of(numbers, np.array([8.0, 10.0 * (1 + 1e-12), 6.0])).tolist() == [1, 2, 0]
    mixed = axis_of("friction", [0.0, 0.3, "stick"])
    assert sweep_axes.index_of(mixed, np.array(["stick", 0.3, "0.3", 0.0], dtype=object)).tolist() == [2, 1, 1, 0]


def test_a_long_name_breaks_before_its_unit():
    assert sweep_axes.wrapped("magnet height = 2 mm", 1.4) == "magnet\nheight = 2 mm"
    assert sweep_axes.wrapped("press force (N)", 2.0) == "press force (N)"
