"""Plots of a comparison: finite elements and formulas side by side, against depth and against shear."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from geometry.design import Design
from studies.output.table_plots import ANALYTIC, FEM, HOMOGENEOUS, OTHER, band_handles, bands, canvas, label
from studies.sensing.field_readings import columns

Row = Mapping[str, Any]

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
        label(axes[0], "a", "press force (N)")
        _errors(
            axes[1], depth, rows, {"fem": "force_error_percent", "fem_homogeneous": "homogeneous_force_error_percent"}
        )
        label(axes[1], "b", "formula's error (%)")
        _lines(axes[2], depth, rows, three, "shift_z_mm")
        label(axes[2], "c", "magnet shift $z$ (mm)")
        _lines(axes[3], depth, rows, ("fem", "analytic"), f"{first}_mT")
        label(axes[3], "d", f"reading of {first.replace('_', ' ')} (mT)")
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
        label(axes[0], "a", "shear force (N)")
        names = {"fem": "force_x_error_percent", "fem_homogeneous": "homogeneous_force_x_error_percent"}
        _errors(axes[1], way, rows, names)
        label(axes[1], "b", "formula's error (%)")
        _lines(axes[2], way, rows, three, "shift_x_mm")
        label(axes[2], "c", "magnet shift $x$ (mm)")
        degrees = [{f"{m}_tilt_deg": math.degrees(row[f"{m}_tilt_rad"]) for m in three} for row in rows]
        _lines(axes[3], way, degrees, three, "tilt_deg")
        label(axes[3], "d", "magnet tilt (°)")
        for axis, name, letter in zip(axes[4:], columns(design)[0][:2], "ef", strict=True):
            _lines(axis, way, rows, readings, f"{name}_mT")
            label(axis, letter, f"reading of {name.replace('_', ' ')} (mT)")
            _volts(axis, design)
            axis.set_xlabel(f"shear at depth {rows[0]['depth_mm']:.3g} mm (mm)")
        _legend(figure, axes, ("fem", "fem_homogeneous", "untilted", "analytic"))


def _lines(axis: Any, x: Sequence[float], rows: Sequence[Row], models: Sequence[str], name: str) -> None:
    for model in models:
        label, look = MODELS[model]
        axis.plot(x, [row[f"{model}_{name}"] for row in rows], label=label, **look)


def _errors(axis: Any, x: Sequence[float], rows: Sequence[Row], names: Mapping[str, str]) -> None:
    for model, name in names.items():
        axis.plot(x, [row[name] for row in rows], **MODELS[model][1])
    bands(axis)


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
