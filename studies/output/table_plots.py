"""Plots of the studies' tables. Colours are Okabe and Ito's, which colour-blind readers can tell apart."""

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
"""A figure 7 in wide; at half that width its letters are still 6 points."""


@contextlib.contextmanager
def canvas(path: str | Path, rows: int, columns: int, *, shared: bool = True) -> Iterator[tuple[Any, list[Any]]]:
    """A figure and its axes, written when all is drawn; it leaves matplotlib's global state alone."""
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
"""Errors that are shaded, percent, and the opacity of their greys, each upon those before it."""


def bands(axis: Any) -> None:
    """Shade errors of up to 5 % and 10 %."""
    for error, opacity in BANDS.items():
        axis.axhspan(-error, error, color="#000000", alpha=opacity, linewidth=0)
    axis.axhline(0, color="#777777", linewidth=0.8)


def band_handles() -> list[Any]:
    """Entries of a legend for the shades, as dark as they are in the panels."""
    from matplotlib.patches import Patch

    through, handles = 1.0, []
    for error, opacity in BANDS.items():
        through *= 1 - opacity
        handles.append(Patch(label=f"error within {error} %", color="#000000", alpha=1 - through, linewidth=0))
    return handles


def label(axis: Any, letter: str, text: str) -> None:
    """Name the axis y, and put the panel's letter above it."""
    axis.set_ylabel(text)
    axis.set_title(letter, loc="left", fontweight="bold", fontsize=12)
