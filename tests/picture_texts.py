"""Checks of the texts of pictures: whole, and apart from each other."""

import itertools

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text


def check_texts(figure):
    """Every text that is drawn lies in the picture, and none upon another one."""
    texts = []
    with pytest.MonkeyPatch.context() as patch:
        # labels of ticks outside the range of their axis exist, too, but are not drawn
        patch.setattr(Text, "draw", lambda self, renderer: texts.append(self))
        figure.draw_without_rendering()
    texts = [text for text in texts if text.get_visible() and text.get_text().strip()]
    assert texts
    boxes = [(text.get_window_extent(), text) for text in texts]
    for box, text in boxes:
        assert box.x0 >= -1, text
        assert box.y0 >= -1, text
        assert box.x1 <= figure.bbox.width + 1, text
        assert box.y1 <= figure.bbox.height + 1, text
    level = [(box, text) for box, text in boxes if text.get_rotation() in (0, 90, 270)]
    for (one, first), (other, second) in itertools.combinations(level, 2):
        apart = one.x1 <= other.x0 + 1 or other.x1 <= one.x0 + 1 or one.y1 <= other.y0 + 1 or other.y1 <= one.y0 + 1
        assert apart, (first, second)


def saved_figures(monkeypatch):
    """Return the list into which each figure goes that is written from now on, in place of its file."""
    figures = []
    monkeypatch.setattr(Figure, "savefig", lambda self, file, **_: (figures.append(self), file.touch()))
    return figures


def legend(figure):
    """Return the entries of a figure's own legend."""
    return [text.get_text() for text in figure.legends[0].get_texts() if text.get_text().strip()]
