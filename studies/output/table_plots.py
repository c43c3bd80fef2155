"""Plots of the studies' tables. Colours are Okabe and Ito's, which colour-blind readers can tell apart."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.output.atomic_files import atomic

Row = Mapping[str, Any]

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


def size(path: str | Path, rows: Sequence[Row]) -> None:
    """CPU seconds and peak memory of the half model against its unknowns, on logarithmic axes."""
    n = [row["dofs"] for row in rows]
    solve = [row["cpu_s"] - row["mesh_s"] for row in rows]
    curves = (("solve", solve, FEM, "o", "-"), ("mesh", [row["mesh_s"] for row in rows], ANALYTIC, "s", "--"))
    with canvas(path, 2, 1) as (_, axes):
        for name, y, colour, marker, dashes in curves:
            axes[0].plot(n, y, label=name, color=colour, marker=marker, linestyle=dashes)
        axes[1].plot(n, [row["peak_MB"] for row in rows], label="peak", color=HOMOGENEOUS, marker="^")
        slope = [solve[-1] * (value / n[-1]) for value in n]
        axes[0].plot(n, slope, color="#777777", linestyle=":", label="in proportion to the unknowns")
        label(axes[0], "a", "CPU time (s)")
        label(axes[1], "b", "peak memory (MB)")
        axes[1].set_xlabel("unknowns (1)")
        for axis in axes:
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.legend(frameon=False, loc="upper left")


def friction(path: str | Path, curves: Sequence[Any], loop: Sequence[Any]) -> None:
    """Tangential over normal force against shear for several mu (`coulomb_study.Curve`), and a cycle of states."""
    with canvas(path, 1, 2, shared=False) as (_, axes):
        for curve, colour in zip(curves, COLOURS, strict=False):
            ratio = [a / b for a, b in zip(curve.force_N, curve.normal_N, strict=True)]
            axes[0].plot(curve.shear_mm, ratio, color=colour, marker="o", label=f"$\\mu$ = {curve.mu:g}")
            axes[0].axhline(curve.mu, color=colour, linestyle=":", linewidth=1)
        label(axes[0], "a", "$F_x / F_N$")
        axes[1].plot(
            [s.load.shear_x for s in loop], [s.response.force[0] for s in loop], color=FEM, marker="o", markersize=3
        )
        label(axes[1], "b", f"$F_x$ (N), $\\mu$ = {loop[0].load.friction:g}")
        for axis in axes:
            axis.set_xlabel("shear (mm)")
        axes[0].legend(frameon=False)


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
