"""Panels of lines of a sweep: models by dashes, an axis by colours, failed cases as crosses at the lower edge."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from geometry.arrays import Array
from studies.exploration.sweep_axes import Axis, scale
from studies.exploration.sweep_views import MOST_LINES, Block, Place, Section
from studies.output import table_plots
from studies.output.table_plots import COLOURS

MOST_MARKED = 25
"""Greatest number of points of a line with markers; on a denser line they would overlap."""
MOST_WIDE = 3
"""Greatest number of columns with wide panels."""
WIDE = 30.0
"""Ratio of the greatest to the least value from which a range over a logarithmic axis is logarithmic, too."""
BEYOND = 5.0
"""Ratio to the error that 90 % of the cases do not exceed beyond which a plot does not show errors."""
STEP, FOOT = 0.05, 0.04
"""Distance of the crosses of two colours, and of the lowest ones from the edge, as parts of the panel's height."""

DASHES = ("-", "--", ":", "-.")
MARKERS = "os^Dv<"
GREY = "#555555"


def draw(panels: Mapping[Place, Any], block: Block, axes: Mapping[str, Axis], inches: float) -> None:
    """Draw a block of lines into the panels at its places; a panel is about `inches` wide."""
    section, x = block.section, axes[block.section.view.x]
    limits = error_limits(section) if section.error else None
    for place, panel in panels.items():
        if section.error:
            table_plots.bands(panel)
        for m in range(len(section.models)):
            for k in range(1 if section.alike[m] else section.failures.shape[3]):
                _curve(panel, section, x, (*place, k), m, limits)
        scale(panel, "x", x, inches)
        if x.texts or len(x) > MOST_LINES:
            edges = x.edges()
            panel.set_xlim(edges[0], edges[-1])
        elif len(x) > 1 and not x.log:
            pad = 0.04 * float(np.ptp(x.positions))
            panel.set_xlim(x.positions[0] - pad, x.positions[-1] + pad)
        if not any(np.isfinite(values[place]).any() for values in section.values) and not section.error:
            panel.set_yticks([])
        if limits is not None:
            panel.set_ylim(*limits)
        elif _decades(section, axes, place):
            _log_values(panel)
        if panel.get_yscale() == "linear":
            panel.locator_params(axis="y", nbins=5 if block.width <= MOST_WIDE else 4)
        _crosses(panel, section, x.positions, place)


def _curve(
    panel: Any, section: Section, axis: Axis, place: tuple[int, ...], model: int, limits: tuple[float, float] | None
) -> None:
    """Draw the line of one model and colour; points between missing ones are marked, because they have no line."""
    x, y = axis.positions, section.values[model][place]
    marked = len(x) <= MOST_MARKED
    colour, dashes, marker = look(section, model, place[-1])
    style: dict[str, Any]
    if section.spread:
        low, high = (part[place] for part in section.spread[model])
        panel.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
    if limits is not None:
        for beyond, height, arrow in ((y > limits[1], 0.96, "^"), (y < limits[0], 0.04, "v")):
            if beyond.any():
                style = {"color": colour, "transform": panel.get_xaxis_transform(), "label": "_beyond"}
                panel.plot(x[beyond], np.full(beyond.sum(), height), arrow, **style)
        y = np.where((y >= limits[0]) & (y <= limits[1]), y, np.nan)
    face = "white" if section.error or model else colour
    solid = model == 0 or section.error
    style = {"color": colour, "markerfacecolor": face}
    every = marked and (solid or axis.texts or not section.view.second)
    panel.plot(x, y, linestyle="none" if axis.texts else dashes, marker=marker if every else "", **style)
    alone = isolated(y)
    if alone.any() and not every:
        panel.plot(x[alone], y[alone], linestyle="none", marker=marker, label="_alone", **style)


def look(section: Section, model: int, k: int) -> tuple[str, str, str]:
    """Return colour, dashes and marker of a line."""
    dashes = "-" if section.error else DASHES[model % len(DASHES)]
    if section.view.second and not section.alike[model]:
        return COLOURS[k], dashes, MARKERS[k]
    if section.colours:
        return COLOURS[section.colours[model] % len(COLOURS)], dashes, MARKERS[section.colours[model] % len(MARKERS)]
    return GREY, dashes, MARKERS[model % len(MARKERS)]


def isolated(y: Array) -> Any:
    """Return which points have a value but no neighbour with one, shape (n,).

    >>> isolated(np.array([1.0, np.nan, 2.0, 3.0]))
    array([ True, False, False, False])
    """
    some = np.isfinite(y)
    near = np.zeros(len(y), dtype=bool)
    near[:-1] |= some[1:]
    near[1:] |= some[:-1]
    return some & ~near


def error_limits(section: Section) -> tuple[float, float]:
    """Return the range of errors that all panels share, %; it leaves out few errors far beyond the others."""
    numbers = np.append(section.numbers, [-10.0, 10.0])
    usual = BEYOND * float(np.percentile(abs(numbers), 90))
    inside = numbers[abs(numbers) <= usual]
    low, high = float(inside.min()), float(inside.max())
    return low - 0.06 * (high - low), high + 0.06 * (high - low)


def _decades(section: Section, axes: Mapping[str, Axis], place: Place) -> bool:
    """Return whether values over a logarithmic axis need a logarithmic range."""
    look = section.view
    if not any(name and axes[name].log for name in (look.x, look.second)):
        return False
    numbers = np.concatenate([values[place].ravel() for values in section.values])
    numbers = numbers[np.isfinite(numbers)]
    return bool(len(numbers) and numbers.min() > 0 and numbers.max() > WIDE * numbers.min())


def _crosses(panel: Any, section: Section, x: Array, place: Place) -> None:
    """Draw a cross at the lower edge for each place with failed cases, the colours one above the other."""
    failures = section.failures[place] > 0
    # panels of errors have one range, so that each gets the room that one of them needs
    rows = (section.failures > 0).any(axis=-1).sum(axis=-1).max() if section.error else failures.any(axis=-1).sum()
    if not rows:
        return
    low, high = panel.get_ylim()
    share = FOOT + STEP * float(rows)
    if panel.get_yscale() == "log":
        panel.set_ylim(low * (low / high) ** (share / (1 - share)), high)
    else:
        panel.set_ylim(low - (high - low) * share / (1 - share), high)
    for n, k in enumerate(np.flatnonzero(failures.any(axis=-1))):
        at = x[failures[k]]
        style: dict[str, Any] = {"markersize": 5, "mew": 1.5, "transform": panel.get_xaxis_transform()}
        colour = COLOURS[k] if section.view.second else GREY
        panel.plot(at, np.full(len(at), FOOT + STEP * n), "x", color=colour, label="_failed", **style)


def _log_values(panel: Any) -> None:
    """Make the range of values logarithmic."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    panel.set_yscale("log")
    low, high = panel.get_ylim()
    panel.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0) if high / low < 300 else (1.0,)))
    panel.yaxis.set_minor_locator(NullLocator())
    panel.yaxis.set_major_formatter(FuncFormatter(lambda at, _: f"{at:g}"))


def model_handles(section: Section) -> list[Any]:
    """Return the legend entries of the models."""
    from matplotlib.lines import Line2D

    entries = []
    for m, model in enumerate(section.models):
        colour, dashes, marker = look(section, m, 0) if section.colours else (GREY, DASHES[m % len(DASHES)], "")
        face = colour if m == 0 else "white"
        line = Line2D([], [], color=colour, linestyle=dashes, marker=marker, markerfacecolor=face, label=model)
        entries.append(line)
    return entries


def colour_handles(section: Section, axes: Mapping[str, Axis]) -> list[Any]:
    """Return the legend entries of the values of the axis that has colours."""
    from matplotlib.lines import Line2D

    axis = axes.get(section.view.second)
    if axis is None:
        return []
    return [Line2D([], [], color=COLOURS[k], marker=MARKERS[k], label=axis.text(k)) for k in range(len(axis))]
