"""Common style of the studies' plots, with the colours of Okabe and Ito, distinct for colour-blind readers."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
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
def canvas(path: str | Path, rows: int, columns: int, *, shared: bool = True) -> Iterator[tuple[Any, list[Any]]]:
    """Yield a figure and its axes, and write the figure at the end; matplotlib's global state stays as it is."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.45 * rows + 0.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, columns, sharex=shared, squeeze=False).ravel().tolist()
        yield figure, axes
        with atomic(path) as temporary:
            figure.savefig(temporary, dpi=300)


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
