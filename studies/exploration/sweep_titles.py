"""Names of axes, values and quantities around the panels of a sweep's pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from studies.exploration.sweep_axes import Axis, turn, wrapped
from studies.exploration.sweep_views import Block, Place


def label(
    panels: Mapping[Place, Any],
    block: Block,
    axes: Mapping[str, Axis],
    above: Block | None,
    below: Block | None,
    size: tuple[float, float],
) -> None:
    """Write names of axes and of panels of a size in inches where they are not repeated from the blocks around."""
    look, (inches, high) = block.section.view, size
    same_x = below is not None and below.section.view.x == look.x and below.width == block.width
    titled = bool(look.across) and not (
        above is not None and not block.wrapped and _columns(above) == _columns(block)
    )
    for (r, c), place in block.places():
        panel = panels[place]
        if inches < 2.5:
            panel.tick_params(labelsize=10)
        lowest = r + 1 == len(block.panels) or block.panels[r + 1][c] is None
        if lowest and not (same_x and r + 1 == len(block.panels)):
            turn(panel, axes[look.x], 0.75 * inches)
            if r + 1 < len(block.panels) and not axes[look.x].texts:
                _label_outside(panel, axes[look.x].label)
            else:
                panel.set_xlabel(axes[look.x].label)
        else:
            panel.tick_params(labelbottom=False)
        if c == 0:
            name = axes[look.second].label if look.maps else block.section.name
            panel.set_ylabel(wrapped(name, 0.9 * high))
        elif look.maps or block.section.error:
            panel.tick_params(labelleft=False)
        if titled and (r == 0 or block.wrapped):
            panel.set_title(_fitted(axes[look.across], place[2], (0.7 if look.maps else 0.85) * inches), fontsize=11)
        if look.down and c + 1 == block.width:
            side = {"rotation": 270, "va": "center", "ha": "left", "fontsize": 11}
            text = _fitted(axes[look.down], place[1], 0.75 * high)
            panel.text(1.03, 0.5, text, transform=panel.transAxes, **side)


def _label_outside(panel: Any, label: str) -> None:
    """Label a horizontal axis above a free place, without room in the layout, so that the rows stay close."""
    for text in panel.get_xticklabels():
        text.set_in_layout(False)
    where: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points", "ha": "center", "va": "top"}
    panel.annotate(label, (0.5, 0), (0, -20), fontsize=12, annotation_clip=False, **where).set_in_layout(False)


def _fitted(axis: Axis, index: int, inches: float) -> str:
    """Return name and value of an axis in as many lines as this length needs."""
    # all panels of an axis have the full name or none
    full = all("\n" not in wrapped(axis.text(k, full=True), inches) for k in range(len(axis)))
    return wrapped(axis.text(index, full=full), inches)


def _columns(block: Block) -> tuple[str, int, tuple[int, ...]]:
    """Return which columns a block has."""
    return block.section.view.across, block.width, tuple(place[2] for place in block.panels[0] if place is not None)


def of_picture(block: Block, axes: Mapping[str, Axis]) -> str | None:
    """Return the values of the axes that are the same in a whole picture and differ between pictures."""
    place = next(place for place in block.panels[0] if place is not None)
    pages = [axes[name] for name in block.section.view.pages]
    if not pages:
        return None
    indices = np.unravel_index(place[0], [len(axis) for axis in pages])
    return ", ".join(axis.text(int(k), full=True) for axis, k in zip(pages, indices, strict=True))
