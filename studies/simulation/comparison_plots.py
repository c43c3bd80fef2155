"""Plots of a comparison: finite elements and formulas side by side, against depth and against shear."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from geometry.design import Design
from studies.output.records import FlatRow
from studies.output.table_plots import ANALYTIC, FEM, HOMOGENEOUS, OTHER, band_handles, bands, canvas, label
from studies.sensing.field_readings import columns

MODELS = {
    "fem": ("FEM, rigid magnet", {"color": FEM, "marker": "o"}),
    "fem_homogeneous": (
        "FEM, all silicone",
        {"color": HOMOGENEOUS, "marker": "s", "markerfacecolor": "white", "linestyle": "-."},
    ),
    "untilted": ("FEM, tilt left out", {"color": OTHER, "marker": "^", "linestyle": ":"}),
    "analytic": ("paper's formulas", {"color": ANALYTIC, "linestyle": "--"}),
}


def press(path: str | Path, design: Design, rows: Sequence[FlatRow]) -> None:
    """Force, its error, the magnet's shift and the reading of S1 against depth."""
    (first, *_), _ = columns(design)
    with canvas(path, 2, 2) as (figure, axes):
        depth = [row["depth_mm"] for row in rows]
        _lines(axes[0], depth, _curves(rows, "force_N"))
        label(axes[0], "a", "press force (N)")
        _errors(axes[1], depth, rows, "force")
        label(axes[1], "b", "formula's error (%)")
        _lines(axes[2], depth, _curves(rows, "shift_z_mm"))
        label(axes[2], "c", "magnet shift $z$ (mm)")
        _lines(axes[3], depth, _curves(rows, f"{first}_mT"))
        label(axes[3], "d", f"reading of {first.replace('_', ' ')} (mT)")
        _volts(axes[3], design)
        for axis in axes:
            axis.set_xlim(left=0)
        for axis in axes[2:]:
            axis.set_xlabel("press depth (mm)")
        _legend(figure, axes, ("fem", "fem_homogeneous", "analytic"))


def shear(path: str | Path, design: Design, rows: Sequence[FlatRow]) -> None:
    """Force, its error, shift, tilt and the readings of S1 and S2 against the sideways motion of the plate."""
    with canvas(path, 3, 2) as (figure, axes):
        way, (elements, _) = [row["shear_mm"] for row in rows], columns(design)
        _lines(axes[0], way, _curves(rows, "force_x_N"))
        label(axes[0], "a", "shear force (N)")
        _errors(axes[1], way, rows, "force_x")
        label(axes[1], "b", "formula's error (%)")
        _lines(axes[2], way, _curves(rows, "shift_x_mm"))
        label(axes[2], "c", "magnet shift $x$ (mm)")
        tilts = _curves(rows, "tilt_rad")
        _lines(axes[3], way, {model: [math.degrees(tilt) for tilt in curve] for model, curve in tilts.items()})
        label(axes[3], "d", "magnet tilt (°)")
        for axis, letter, element in zip(axes[4:], "ef", elements[:2], strict=True):
            _lines(axis, way, _curves(rows, f"{element}_mT"))
            label(axis, letter, f"reading of {element.replace('_', ' ')} (mT)")
            _volts(axis, design)
            axis.set_xlabel(f"shear at depth {rows[0]['depth_mm']:.3g} mm (mm)")
        _legend(figure, axes, ("fem", "fem_homogeneous", "untilted", "analytic"))


def _curves(rows: Sequence[FlatRow], column: str) -> dict[str, list[float]]:
    """A quantity of all rows by each model that has it."""
    return {model: [row[f"{model}_{column}"] for row in rows] for model in MODELS if f"{model}_{column}" in rows[0]}


def _lines(axis: Any, x: Sequence[float], curves: Mapping[str, Sequence[float]]) -> None:
    for model, y in curves.items():
        name, look = MODELS[model]
        axis.plot(x, y, label=name, **look)


def _errors(axis: Any, x: Sequence[float], rows: Sequence[FlatRow], quantity: str) -> None:
    """The formula's errors against both finite elements, in the colours of these."""
    for beam, model in (("", "fem"), ("homogeneous_", "fem_homogeneous")):
        axis.plot(x, [row[f"{beam}{quantity}_error_percent"] for row in rows], **MODELS[model][1])
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
        drawn, labels = axis.get_legend_handles_labels()
        handles |= dict(zip(labels, drawn, strict=True))
    names = [MODELS[model][0] for model in models if MODELS[model][0] in handles]
    shown = [handles[name] for name in names] + band_handles()
    figure.legend(handles=shown, loc="outside upper center", ncols=2 if len(names) == 4 else 3, frameon=False)
