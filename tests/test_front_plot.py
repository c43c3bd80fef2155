"""The picture of a front: axes with units, enough numbers, texts that are apart."""

from types import SimpleNamespace

import pytest

from studies.sizing import front_plot
from tests.picture_texts import check_texts, legend, saved_figures


@pytest.mark.parametrize(("coarsest", "status"), [(0.012, "ok"), (0.09, "ok"), (0.9, "failed")])
def test_axes_have_units_and_several_numbers(coarsest, status, monkeypatch, tmp_path):
    figures = saved_figures(monkeypatch)
    front = []
    for rank, share in enumerate((1.0, 0.9, 0.8), start=1):
        values = {
            "range_z": 4.0 * share,
            "resolution_z": coarsest ** (1 / rank) if rank > 1 and coarsest > 0.5 else coarsest * share,
            "resolution_x": 1e-4,
            "outer_size": 17.1 + share,
        }
        solved = values | {"range_z": 4.2 * share}
        front.append(SimpleNamespace(predicted=values, solved=solved, status=status, rank=rank))
    front_plot.draw(tmp_path / "front.png", front)
    (figure,) = figures
    check_texts(figure)
    assert ("failed by finite elements" in legend(figure)) == (status != "ok")
    for axis in figure.axes:
        assert axis.get_xlabel().endswith(("(N)", "(mm)"))
        low, high = axis.get_ylim()
        assert sum(low <= tick <= high for tick in axis.get_yticks()) >= 2
