"""Common style of the studies' plots, with the colours of Okabe and Ito, distinct for colour-blind readers."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.output.atomic_files import atomic

FEM, HOMOGENEOUS, ANALYTIC, OTHER = "#0072B2", "#009E73", "#D55E00", "#CC79A7"
COLOURS = (FEM, ANALYTIC, HOMOGENEOUS, OTHER, "#E69F00", "#56B4E9", "#000000")

STYLE = {
    "font.size": 12,
    "axes.labelsize": 12,
    "xtick.labelsize": 11,
    "ytick.labelsize": 11,
    "legend.fontsize": 11,
    "lines.linewidth": 1.8,
    "lines.markersize": 5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
}
"""Settings of matplotlib for a figure 7 in wide; the letters still have 6 points when it is printed half as wide."""


@contextlib.contextmanager
def sheet(
    path: str | Path, width: float, height: float, *, dpi: int = 300, style: Mapping[str, Any] | None = None
) -> Iterator[Any]:
    """Yield a figure of a size in inches, and write it at the end; matplotlib's global state stays as it is.

    Parameters
    ----------
    style : settings of matplotlib besides `STYLE`.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with mpl.rc_context({**STYLE, **(style or {})}):
        layout = ConstrainedLayoutEngine()
        figure = Figure(figsize=(width, height), layout=layout)
        FigureCanvasAgg(figure)
        yield figure
        figure.set_dpi(dpi)
        layout.execute(figure)
        # the layout is made once: savefig would draw everything an additional time for it
        figure.set_layout_engine("none")
        with atomic(path) as temporary:
            figure.savefig(temporary, dpi=dpi, pil_kwargs={"compress_level": 2})


@contextlib.contextmanager
def canvas(path: str | Path, rows: int, columns: int, *, shared: bool = True) -> Iterator[tuple[Any, list[Any]]]:
    """Yield a figure with panels in rows and columns, and the panels; write the figure at the end."""
    with sheet(path, 7.0, 2.45 * rows + 0.6) as figure:
        yield figure, figure.subplots(rows, columns, sharex=shared, squeeze=False).ravel().tolist()


FEW_DECADES, SHORT = 2.0, 0.8
"""Lengths of a logarithmic axis, decades, below which it has numbers at 2 and 5 too, and evenly spaced ones."""

SAMPLE, LETTER = 0.62, 0.088
"""Widths of a line in the legend with its margins, and of a letter, in."""

BANDS = {10: 0.06, 5: 0.09}
"""Errors up to which a plot is shaded, percent, and the opacity of the shades, which are drawn one over the other."""


def bands(axis: Any) -> None:
    """Shade the ranges of errors up to 5 % and 10 %."""
    for error, opacity in BANDS.items():
        axis.axhspan(-error, error, color="#000000", alpha=opacity, linewidth=0)
    axis.axhline(0, color="#777777", linewidth=0.8)


def band_handles() -> list[Any]:
    """Return legend entries for the shades, each as dark as in the panels, where the shades overlap."""
    from matplotlib.patches import Patch

    transmitted, handles = 1.0, []
    for error, opacity in BANDS.items():
        transmitted *= 1 - opacity
        handles.append(Patch(label=f"error within {error} %", color="#000000", alpha=1 - transmitted, linewidth=0))
    return handles


def label(axis: Any, letter: str, text: str) -> None:
    """Label the y axis, and write the panel's letter above it."""
    axis.set_ylabel(text)
    axis.set_title(letter, loc="left", fontweight="bold", fontsize=12)


def log_numbers(axis: Any, way: str) -> None:
    """Write plain numbers at a logarithmic axis "x" or "y": each decade, 2 and 5 too, or evenly, by its length."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = sorted(getattr(axis, f"get_{way}lim")())
    decades = math.log10(high / low)
    line = getattr(axis, f"{way}axis")
    if decades < SHORT:
        line.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    else:
        line.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < FEW_DECADES else (1.0,), numticks=20))
    line.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    line.set_minor_formatter(NullFormatter())


def legend_columns(groups: Sequence[Sequence[Any]], width: float) -> tuple[list[Any], int]:
    """Return the entries of a legend, filled up with empty ones, and the number of its columns.

    Groups have columns of their own; there are as few rows as the width in inches allows.
    """
    from matplotlib.lines import Line2D

    rows, columns = 1, []
    for rows in range(1, 1 + max(map(len, groups), default=0)):
        columns = [column for group in groups for column in _columns(group, rows)]
        longest = [max(len(entry.get_label().replace("$", "")) for entry in column) for column in columns]
        if sum(SAMPLE + LETTER * count for count in longest) <= width:
            break
    full = [[*column, *[Line2D([], [], linestyle="none", label=" ")] * (rows - len(column))] for column in columns]
    return [entry for column in full for entry in column], max(len(full), 1)


def _columns(group: Sequence[Any], rows: int) -> list[list[Any]]:
    """Return the entries of a group in columns of nearly equal length."""
    size = -(-len(group) // -(-len(group) // rows))
    return [list(group[k : k + size]) for k in range(0, len(group), size)]
