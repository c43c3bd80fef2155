import pytest

from studies.exploration import sweep_views
from studies.exploration.sweep_axes import axis_of
from studies.exploration.sweep_views import View


def axes_of(**counts):
    return {name: axis_of(name, [float(k) for k in range(1, n + 1)]) for name, n in counts.items()}


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        ({"D": 3}, View(False, "D")),
        ({"D": 3, "L": 6}, View(False, "D", "L")),
        ({"D": 40, "L": 6}, View(False, "D", "L")),
        # the longer axis is horizontal, so that the shorter one has colours
        ({"D": 4, "depth": 40}, View(False, "depth", "D")),
        ({"D": 7, "L": 40}, View(True, "D", "L")),
        ({"D": 3, "E": 4, "depth": 5, "L": 6}, View(False, "D", "L", "depth", "E")),
        ({"D": 3, "E": 40, "L": 40}, View(True, "E", "L", "D")),
        ({"D": 3, "E": 2, "d": 4, "L": 5, "f": 2}, View(False, "D", "L", "d", "E", ("f",))),
    ],
)
def test_lines_up_to_six_values_and_maps_beyond(counts, expected):
    assert sweep_views.view(axes_of(**counts), list(counts)) == expected


def test_axes_without_effect_have_no_part():
    axes = axes_of(f=2, E=2)
    assert sweep_views.view(axes, ["E"]) == View(False, "E")
    assert sweep_views.view(axes, []) == View(False, "f")


def test_texts_are_horizontal_only_if_nothing_else_is():
    axes = {"law": axis_of("law", ["a", "b"]), **axes_of(D=2)}
    assert sweep_views.view(axes, ["law", "D"]) == View(False, "D", "law")
    assert sweep_views.view(axes, ["law"]) == View(False, "law")


def test_a_view_without_some_of_its_axes():
    axes = axes_of(D=3, E=4, depth=5, L=6)
    whole = sweep_views.view(axes, list(axes))
    assert sweep_views.pruned(whole, axes, ["D", "depth", "L"]) == View(False, "D", "L", "depth")
    assert sweep_views.pruned(whole, axes, ["D", "E"]) == View(False, "D", "", "E")
    assert sweep_views.pruned(whole, axes, ["E", "L"]) == View(False, "E", "L")
    assert sweep_views.pruned(whole, axes, []) == View(False, "D")


def test_the_number_of_pictures():
    axes = axes_of(D=3, L=6, depth=12, E=7, nu=2)
    count = sweep_views.picture_count
    assert count(View(False, "D", "L", "depth"), axes) == 1
    assert count(View(False, "D", "L", "depth", "E"), axes) == 3 * 2
    assert count(View(False, "D", "L", "depth", "E", ("nu",)), axes) == 3 * 2 * 2
