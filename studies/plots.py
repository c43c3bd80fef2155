"""Plots of the studies' tables. Colours are Okabe and Ito's, which colour-blind readers can tell apart."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from geometry.design import Design
from studies.files import atomic

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
    with _figure(path, 2, 2) as (figure, axes):
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
        _lines(axes[3], depth, rows, ("fem", "analytic"), "S1_mT")
        _label(axes[3], "d", "reading of S1 (mT)")
        _volts(axes[3], design)
        for axis in axes:
            axis.set_xlim(left=0)
        for axis in axes[2:]:
            axis.set_xlabel("press depth (mm)")
        _legend(figure, axes, three)


def shear(path: str | Path, design: Design, rows: Sequence[Row]) -> None:
    """Force, its error, shift, tilt and the readings of S1 and S2 against the sideways motion of the plate."""
    with _figure(path, 3, 2) as (figure, axes):
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
        for axis, name, letter in zip(axes[4:], ("S1", "S2"), "ef", strict=True):
            _lines(axis, way, rows, readings, f"{name}_mT")
            _label(axis, letter, f"reading of {name} (mT)")
            _volts(axis, design)
            axis.set_xlabel("shear of the plate (mm)")
        _legend(figure, axes, ("fem", "fem_homogeneous", "untilted", "analytic"))


def sweep(path: str | Path, rows: Sequence[Row], axes: Mapping[str, Sequence[float]]) -> None:
    """Force of both models and the formula's error against the first axis; a line for each combination of others."""
    from matplotlib import colormaps
    from matplotlib.lines import Line2D

    first, *others = axes
    x_name = _column(first)
    groups: dict[tuple[float, ...], list[Row]] = {}
    for row in sorted(rows, key=lambda row: row[x_name]):
        if not math.isnan(row["fem_force_N"]) or not math.isnan(row["analytic_force_N"]):
            groups.setdefault(tuple(row[_column(name)] for name in others), []).append(row)
    names, members = sorted(groups), [groups[name] for name in sorted(groups)]
    few = len(names) <= len(COLOURS)
    spread = [colormaps["viridis"](0.92 * k / max(len(names) - 1, 1)) for k in range(len(names))]
    looks: list[dict[str, Any]] = [{"color": colour, "marker": "o"} for colour in (COLOURS if few else spread)][
        : len(names)
    ]
    with _figure(path, 2, 1) as (figure, (force, error)):
        for k, (group, look) in enumerate(zip(members, looks, strict=True)):
            x = [row[x_name] for row in group]
            force.plot(x, [row["fem_force_N"] for row in group], **look)
            force.plot(x, [row["analytic_force_N"] for row in group], linestyle="--", color=look["color"])
            # errors may coincide, so each line leaves the one before visible
            size = 1 - k / max(len(names) - 1, 1)
            thinner = {"linewidth": 1.4 + 2.6 * size, "markersize": 4.5 + 5 * size, "markerfacecolor": "white"}
            error.plot(x, [row["force_error_percent"] for row in group], **look, **thinner)
        _bands(error)
        _label(force, "a", "press force (N)")
        _label(error, "b", "formula's error (%)")
        error.set_xlabel(f"{_symbol(first)} ({_unit(first).strip()})")
        lost = sum(math.isnan(row["fem_force_N"]) for row in rows)
        if lost:
            force.set_title(f"{lost} of {len(rows)} cases have no FEM result", loc="right", fontsize=10)
        kinds: Any = (("FEM", {"marker": "o"}), ("paper", {"linestyle": "--"}))
        handles = [Line2D([], [], color="#555555", label=text, **look) for text, look in kinds]
        shown = range(len(names)) if few else sorted({round(k * (len(names) - 1) / 6) for k in range(7)})
        for k in shown if others else ():
            text = ", ".join(f"{_symbol(a)} = {v:.4g}{_unit(a)}" for a, v in zip(others, names[k], strict=True))
            handles.append(Line2D([], [], label=text, **looks[k]))
        columns = max(1, 4 - len(others)) if others else 2
        figure.legend(handles=handles, loc="outside upper center", ncols=columns, frameon=False)


def _column(axis: str) -> str:
    return "depth_mm" if axis == "depth" else f"{axis}_{_unit(axis).strip()}"


def _unit(axis: str) -> str:
    return " MPa" if axis == "E" else " mm"


def _symbol(axis: str) -> str:
    return "depth $d$" if axis == "depth" else f"${axis}$"


@contextlib.contextmanager
def _figure(path: str | Path, rows: int, columns: int) -> Iterator[tuple[Any, list[Any]]]:
    """A figure and its axes, written when all is drawn; it leaves matplotlib's global state alone."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.45 * rows + 0.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel().tolist()
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
    _bands(axis)


def _bands(axis: Any) -> None:
    """Shade errors of up to 5 % and 10 %."""
    axis.axhspan(-10, 10, color="#000000", alpha=0.06, linewidth=0)
    axis.axhspan(-5, 5, color="#000000", alpha=0.09, linewidth=0)
    axis.axhline(0, color="#777777", linewidth=0.8)


def _label(axis: Any, letter: str, text: str) -> None:
    axis.set_ylabel(text)
    axis.set_title(letter, loc="left", fontweight="bold", fontsize=12)


def _volts(axis: Any, design: Design) -> None:
    """The element's output on the right; the rails are not drawn."""
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
    columns = 2 if len(names) == 4 else len(names)
    figure.legend([handles[name] for name in names], names, loc="outside upper center", ncols=columns, frameon=False)
