"""Plots of the studies' tables. Colours are Okabe and Ito's, which colour-blind readers can tell apart."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from geometry.design import Design
from studies.output.atomic_files import atomic
from studies.sensing.field_readings import columns

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

MODELS = {
    "fem": ("FEM, rigid magnet", {"color": FEM, "marker": "o"}),
    "fem_homogeneous": (
        "FEM, all silicone",
        {"color": HOMOGENEOUS, "marker": "s", "markerfacecolor": "white", "linestyle": "-."},
    ),
    "untilted": ("FEM, tilt left out", {"color": OTHER, "marker": "^", "linestyle": ":"}),
    "analytic": ("paper's formulas", {"color": ANALYTIC, "linestyle": "--"}),
}


def press(path: str | Path, design: Design, rows: Sequence[Row]) -> None:
    """Force, its error, the magnet's shift and the reading of S1 against depth."""
    (first, *_), _ = columns(design)
    with canvas(path, 2, 2) as (figure, axes):
        depth = [row["depth_mm"] for row in rows]
        three = ("fem", "fem_homogeneous", "analytic")
        _lines(axes[0], depth, rows, three, "force_N")
        _label(axes[0], "a", "press force (N)")
        _errors(
            axes[1], depth, rows, {"fem": "force_error_percent", "fem_homogeneous": "homogeneous_force_error_percent"}
        )
        _label(axes[1], "b", "formula's error (%)")
        _lines(axes[2], depth, rows, three, "shift_z_mm")
        _label(axes[2], "c", "magnet shift $z$ (mm)")
        _lines(axes[3], depth, rows, ("fem", "analytic"), f"{first}_mT")
        _label(axes[3], "d", f"reading of {first.replace('_', ' ')} (mT)")
        _volts(axes[3], design)
        for axis in axes:
            axis.set_xlim(left=0)
        for axis in axes[2:]:
            axis.set_xlabel("press depth (mm)")
        _legend(figure, axes, three)


def shear(path: str | Path, design: Design, rows: Sequence[Row]) -> None:
    """Force, its error, shift, tilt and the readings of S1 and S2 against the sideways motion of the plate."""
    with canvas(path, 3, 2) as (figure, axes):
        way = [row["shear_mm"] for row in rows]
        three, readings = ("fem", "fem_homogeneous", "analytic"), ("fem", "untilted", "analytic")
        _lines(axes[0], way, rows, three, "force_x_N")
        _label(axes[0], "a", "shear force (N)")
        names = {"fem": "force_x_error_percent", "fem_homogeneous": "homogeneous_force_x_error_percent"}
        _errors(axes[1], way, rows, names)
        _label(axes[1], "b", "formula's error (%)")
        _lines(axes[2], way, rows, three, "shift_x_mm")
        _label(axes[2], "c", "magnet shift $x$ (mm)")
        degrees = [{f"{m}_tilt_deg": math.degrees(row[f"{m}_tilt_rad"]) for m in three} for row in rows]
        _lines(axes[3], way, degrees, three, "tilt_deg")
        _label(axes[3], "d", "magnet tilt (°)")
        for axis, name, letter in zip(axes[4:], columns(design)[0][:2], "ef", strict=True):
            _lines(axis, way, rows, readings, f"{name}_mT")
            _label(axis, letter, f"reading of {name.replace('_', ' ')} (mT)")
            _volts(axis, design)
            axis.set_xlabel(f"shear at depth {rows[0]['depth_mm']:.3g} mm (mm)")
        _legend(figure, axes, ("fem", "fem_homogeneous", "untilted", "analytic"))


def fit(
    path: str | Path,
    stretch: Sequence[float],
    stress: Sequence[float],
    smooth: Sequence[float],
    curves: Mapping[str, Sequence[Any]],
) -> None:
    """A uniaxial test with the laws fitted to it, the best first, and what they leave over.

    Parameters
    ----------
    stretch, stress : points of the test, shape (n,), the stress in MPa.
    smooth : stretches of the curves.
    curves : for each law the stress at `smooth` and at `stretch`, MPa.
    """
    largest = max(abs(value) for value in stress)
    order = sorted(range(len(stretch)), key=lambda k: stretch[k])
    with canvas(path, 2, 1) as (figure, axes):
        axes[0].plot(stretch, stress, "o", color="#555555", markerfacecolor="white", label="test", zorder=1)
        for (law, (curve, at)), colour, dashes in zip(curves.items(), COLOURS, ("-", "--", "-.", ":"), strict=False):
            look = {"color": colour, "linestyle": dashes}
            axes[0].plot(smooth, curve, label=law, **look)
            rest = [100 * (at[k] - stress[k]) / largest for k in order]
            axes[1].plot([stretch[k] for k in order], rest, marker="o", markersize=3, **look)
        axes[1].axhline(0, color="#777777", linewidth=0.8)
        _label(axes[0], "a", "nominal stress (MPa)")
        _label(axes[1], "b", "law less test (% of max.)")
        axes[1].set_xlabel("stretch (1)")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside upper center", ncols=len(labels), frameon=False, columnspacing=1.2
        )


def size(path: str | Path, rows: Sequence[Row]) -> None:
    """CPU seconds and peak memory of the half model against its unknowns, on logarithmic axes."""
    n = [row["dofs"] for row in rows]
    solve = [row["cpu_s"] - row["mesh_s"] for row in rows]
    curves = (("solve", solve, FEM, "o", "-"), ("mesh", [row["mesh_s"] for row in rows], ANALYTIC, "s", "--"))
    with canvas(path, 2, 1) as (_, axes):
        for label, y, colour, marker, dashes in curves:
            axes[0].plot(n, y, label=label, color=colour, marker=marker, linestyle=dashes)
        axes[1].plot(n, [row["peak_MB"] for row in rows], label="peak", color=HOMOGENEOUS, marker="^")
        slope = [solve[-1] * (value / n[-1]) for value in n]
        axes[0].plot(n, slope, color="#777777", linestyle=":", label="in proportion to the unknowns")
        _label(axes[0], "a", "CPU time (s)")
        _label(axes[1], "b", "peak memory (MB)")
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
        _label(axes[0], "a", "$F_x / F_N$")
        axes[1].plot(
            [s.load.shear_x for s in loop], [s.response.force[0] for s in loop], color=FEM, marker="o", markersize=3
        )
        _label(axes[1], "b", f"$F_x$ (N), $\\mu$ = {loop[0].load.friction:g}")
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


def _lines(axis: Any, x: Sequence[float], rows: Sequence[Row], models: Sequence[str], name: str) -> None:
    for model in models:
        label, look = MODELS[model]
        axis.plot(x, [row[f"{model}_{name}"] for row in rows], label=label, **look)


def _errors(axis: Any, x: Sequence[float], rows: Sequence[Row], names: Mapping[str, str]) -> None:
    for model, name in names.items():
        axis.plot(x, [row[name] for row in rows], **MODELS[model][1])
    bands(axis)


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


def _label(axis: Any, letter: str, text: str) -> None:
    axis.set_ylabel(text)
    axis.set_title(letter, loc="left", fontweight="bold", fontsize=12)


def _volts(axis: Any, design: Design) -> None:
    """The element's output on the right, where it is a voltage; the rails are not drawn."""
    if columns(design)[1] != "V":
        return
    gain, null = design.hall_gain / 1e3, design.hall_null
    right = axis.secondary_yaxis("right", functions=(lambda b: null + gain * b, lambda v: (v - null) / gain))
    right.spines["right"].set_visible(True)
    right.set_ylabel("output (V)")


def _legend(figure: Any, axes: Sequence[Any], models: Sequence[str]) -> None:
    handles: dict[str, Any] = {}
    for axis in axes:
        found, labels = axis.get_legend_handles_labels()
        handles |= dict(zip(labels, found, strict=True))
    names = [MODELS[model][0] for model in models if MODELS[model][0] in handles]
    shown = [handles[name] for name in names] + band_handles()
    figure.legend(handles=shown, loc="outside upper center", ncols=2 if len(names) == 4 else 3, frameon=False)
