"""Maps of a sweep: values by colours with contours, errors about zero, failed cases hatched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.exploration.sweep_axes import Axis, scale
from studies.exploration.sweep_views import Block, Place, Section
from studies.output.text_tables import with_unit

VALUES, ERRORS = "cividis", "RdBu_r"
"""Colour maps; neither needs red told from green."""
LIMITS = (5.0, 10.0)
"""Errors that have contours, %."""
DASHES = ("solid", "dashed")
FAILED, HATCH, EMPTY = "#d9d9d9", "/////", "#f2f2f2"
USUAL = 97.0
"""Percentage of the magnitudes of the errors that the colours tell apart; the rest has the end's colour."""
NEAR = 1.3
"""Ratio to these errors up to which the greatest one has a colour of its own, too."""
LEAST = 20.0
"""Least end of the colours of errors, %."""
WIDE = 30.0
"""Ratio of the greatest to the least value from which the colours are logarithmic."""
LEAST_LENGTH = 0.25
"""Length from which a contour has a label, relative to the panel's sides."""
MOST_LABELLED = 3
"""Greatest number of columns of maps that have room for labels of contours."""


def draw(figure: Any, panels: Mapping[Place, Any], block: Block, axes: Mapping[str, Axis], inches: float) -> None:
    """Draw a block of maps of one model with its colour bar into the panels at its places, each so wide."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    section = block.section
    x, y = axes[section.view.x], axes[section.view.second]
    norm, extend = _norm(section)
    labelled = block.width <= MOST_LABELLED
    levels = _levels(section, norm, labelled=labelled)
    mesh = None
    for place, panel in panels.items():
        values, failures = section.values[0][place], section.failures[place]
        panel.set_facecolor(EMPTY)
        panel.grid(visible=False)
        shown = np.ma.masked_invalid(values)
        colours = ERRORS if section.error else VALUES
        mesh = panel.pcolormesh(x.edges(), y.edges(), shown, cmap=colours, norm=norm, rasterized=True)
        if (failures > 0).any():
            panel.add_patch(_hatched(x.edges(), y.edges(), failures > 0))
        for way, axis in (("x", x), ("y", y)):
            scale(panel, way, axis, inches if way == "x" else 2.2 if _rows(block) == 1 else 1.6)
        _contours(panel, (x, y), values, levels, error=section.error, labelled=labelled)
    bar = figure.colorbar(mesh, ax=list(panels.values()), extend=extend, pad=0.015, aspect=18 * _rows(block))
    bar.set_label(_title(section), fontsize=11 if _rows(block) > 1 else 10)
    bar.outline.set_linewidth(0.6)
    for level in levels:
        if not section.error or abs(level) in LIMITS:
            ink = "#000000" if section.error else "#ffffff"
            bar.ax.axhline(level, color=ink, linestyle=_dash(level, error=section.error), linewidth=1.1)
    if isinstance(norm, LogNorm):
        bar.ax.yaxis.set_major_locator(FixedLocator(levels))
        bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda at, _: f"{at:g}"))
        bar.ax.yaxis.set_minor_locator(NullLocator())


def _title(section: Section) -> str:
    model = section.models[0]
    of_model = with_unit(f"error of {model}" if section.error else model, section.unit)
    return f"{section.label},\n{of_model}"


def _rows(block: Block) -> int:
    return len(block.panels)


def _dash(level: float, *, error: bool) -> str:
    if not error:
        return "solid"
    return DASHES[LIMITS.index(abs(level))] if abs(level) in LIMITS else "dotted"


def _norm(section: Section) -> tuple[Any, str]:
    """Return the scale of the colours, the same in all panels and pictures, and the ends with arrows."""
    from matplotlib.colors import LogNorm, Normalize

    numbers = section.values[0][np.isfinite(section.values[0])]
    if not len(numbers):
        return error_norm(numbers) if section.error else (Normalize(0, 1), "neither")
    low, high = float(numbers.min()), float(numbers.max())
    if section.error:
        return error_norm(numbers)
    if low > 0 and high > WIDE * low:
        return LogNorm(low, high), "neither"
    return Normalize(low, high if high > low else low + (abs(low) or 1.0)), "neither"


def error_limits(section: Section) -> tuple[float, float]:
    """Return the range of errors that the colours tell apart, %."""
    norm, _ = error_norm(section.numbers)
    return norm.vmin, norm.vmax


def error_norm(errors: Array) -> tuple[Any, str]:
    """Return the scale of the colours of errors, symmetric about zero, and the ends with arrows."""
    from matplotlib.colors import Normalize

    numbers = errors[np.isfinite(errors)]
    limit = LEAST
    if len(numbers):
        usual, most = float(np.percentile(abs(numbers), USUAL)), float(abs(numbers).max())
        limit = max(_round_up(most if most <= NEAR * usual else usual), LEAST)
    return Normalize(-limit, limit), EXTEND[bool((numbers < -limit).any()), bool((numbers > limit).any())]


EXTEND = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}


def _round_up(value: float) -> float:
    """Return the next multiple of 10, of 50 beyond 100, of 500 beyond 1000."""
    step = 10.0 if value <= 100 else 50.0 if value <= 1000 else 500.0
    return float(step * np.ceil(value / step))


def _levels(section: Section, norm: Any, *, labelled: bool) -> list[float]:
    """Return the levels of the contours in rising order; those of errors beyond 10 % only where they have labels."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    low, high = float(norm.vmin), float(norm.vmax)
    if section.error:
        outer = MaxNLocator(nbins=10, steps=[1, 2, 5, 10]).tick_values(low, high) if labelled else []
        beyond = [float(level) for level in outer if abs(level) > LIMITS[-1] and low < level < high]
        return sorted([*beyond, *LIMITS, *(-limit for limit in LIMITS)])
    if low > 0 and high > WIDE * low:
        steps = (1.0, 2.0, 5.0) if high < 300 * low else (1.0, 3.0) if high < 1e5 * low else (1.0,)
        inner = LogLocator(subs=steps).tick_values(low, high)
    else:
        inner = MaxNLocator(nbins=7).tick_values(low, high)
    return [float(level) for level in inner if low < level < high]


def _contours(
    panel: Any, axes: tuple[Axis, Axis], values: Array, levels: Sequence[float], *, error: bool, labelled: bool
) -> None:
    """Draw contours between the centres of the cells."""
    from matplotlib.patheffects import withStroke

    x, y = axes
    finite = values[np.isfinite(values)]
    own = [level for level in levels if len(finite) and finite.min() < level < finite.max()]
    if x.texts or y.texts or min(values.shape) < 2 or not own:
        return
    lines = panel.contour(
        x.positions,
        y.positions,
        np.ma.masked_invalid(values),
        levels=own,
        colors="#000000",
        linestyles=[_dash(level, error=error) for level in own],
        linewidths=[1.3 if error and abs(level) in LIMITS else 1.0 for level in own],
    )
    if not error:
        # black lines need a halo on the dark end of the colours
        lines.set_path_effects([withStroke(linewidth=2.4, foreground="#ffffff")])
    if labelled:
        for text in panel.clabel(lines, fmt="%g %%" if error else "%g", fontsize=9, manual=_middles(lines, panel)):
            text.set_path_effects([withStroke(linewidth=2.4, foreground="#ffffff")])


def _middles(lines: Any, panel: Any) -> list[tuple[float, float]]:
    """Return the points for the labels of contours: near the middle of each level's longest line, if it is long."""
    points = []
    for k, segments in enumerate(lines.allsegs):
        longest = max(segments, key=len, default=np.zeros((0, 2)))
        if len(longest) < 2:
            continue
        at = panel.transAxes.inverted().transform(panel.transData.transform(longest))
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(at, axis=0).T))])
        if along[-1] > LEAST_LENGTH:
            # labels of neighbouring contours stand apart
            x, y = longest[np.searchsorted(along, along[-1] * (0.4, 0.6)[k % 2])]
            points.append((float(x), float(y)))
    return points


def _hatched(x: Array, y: Array, cells: NDArray[np.bool_]) -> Any:
    """Return grey hatched cells as one patch, so that the hatches of neighbours meet."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    corners, codes = [], []
    for j, i in np.argwhere(cells):
        left, right, low, high = x[i], x[i + 1], y[j], y[j + 1]
        corners += [(left, low), (right, low), (right, high), (left, high), (left, low)]
        codes += [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    path = Path(np.array(corners), codes)
    return PathPatch(path, facecolor=FAILED, edgecolor="#6b6b6b", hatch=HATCH, linewidth=0, label="_failed")


def handles(*, errors: Sequence[Section], empty: bool) -> list[Any]:
    """Return the legend entries of the contours of maps of errors, and of places without a value."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = []
    for limit, dash in zip(LIMITS, DASHES, strict=True):
        style: dict[str, Any] = {"color": "#000000", "linestyle": dash, "linewidth": 1.3}
        if any((abs(section.numbers) < limit).any() and (abs(section.numbers) > limit).any() for section in errors):
            entries.append(Line2D([], [], label=f"error ±{limit:g} %", **style))
    if empty:
        entries.append(Patch(facecolor=EMPTY, edgecolor="#bbbbbb", linewidth=0.6, label="no value"))
    return entries


def failed_handle(count: int, total: int, *, maps: bool) -> Any:
    """Return the legend entry of the failed cases."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    label = f"failed ({count} of {total})"
    if maps:
        return Patch(facecolor=FAILED, edgecolor="#6b6b6b", hatch=HATCH, linewidth=0, label=label)
    return Line2D([], [], color="#555555", linestyle="none", marker="x", mew=1.5, label=label)
