"""The picture of a front: range, resolution and size of each point by the surrogate and by finite elements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from studies.output.table_plots import ANALYTIC, FEM, OTHER, legend_columns, log_numbers, sheet
from studies.sizing.front_solves import FrontPoint

PANELS = (
    ("range_z", 1.0, "range in z (N)"),
    ("resolution", 1e3, "resolution at the\nworst pose (mN)"),
    ("outer_size", 1.0, "outer size (mm)"),
)
"""Quantities, the units of their axes, and the names of the axes."""


def draw(path: Path, front: Sequence[FrontPoint]) -> None:
    """Draw all pairs of the three objectives; a line joins the two sources of a point."""
    with sheet(path, 7.0, 3.6) as figure:
        axes = figure.subplots(1, 3)
        for axis, (across, up) in zip(axes, ((0, 1), (2, 1), (2, 0)), strict=True):
            for point in front:
                _draw_point(axis, point, PANELS[across], PANELS[up])
            axis.set_xlabel(PANELS[across][2])
            axis.set_ylabel(PANELS[up][2])
            axis.locator_params(nbins=4)
        for axis in axes[:2]:
            axis.set_yscale("log")
            log_numbers(axis, "y")
        handles, across = legend_columns([_entries(front)], figure.get_figwidth())
        figure.legend(handles=handles, loc="outside upper center", ncols=across, frameon=False)


def _draw_point(axis: Any, point: FrontPoint, across: tuple[str, float, str], up: tuple[str, float, str]) -> None:
    """Draw a point twice, by both sources."""
    places = [
        tuple(unit * _value(values, name) for name, unit, _ in (across, up))
        for values in (point.predicted, point.solved)
    ]
    axis.plot(*zip(*places, strict=True), color="#999999", linewidth=0.8, zorder=1)
    axis.plot(
        *places[0], marker="o", color=ANALYTIC, markerfacecolor="none", linestyle="none", markersize=8, zorder=2
    )
    passed = point.status == "ok"
    axis.plot(*places[1], marker="o" if passed else "X", color=FEM if passed else OTHER, linestyle="none", zorder=3)
    if point.rank == 1:
        axis.plot(*places[1], marker="*", color=FEM, markersize=15, linestyle="none", zorder=4)


def _value(values: dict[str, float], name: str) -> float:
    """Return a value of a point; the resolution is the coarser one of z and x."""
    return max(values["resolution_z"], values["resolution_x"]) if name == "resolution" else values[name]


def _entries(front: Sequence[FrontPoint]) -> list[Any]:
    """Return the entries of the legend."""
    from matplotlib.lines import Line2D

    def entry(label: str, marker: str, colour: str, **more: Any) -> Any:
        return Line2D([], [], marker=marker, color=colour, linestyle="none", label=label, **more)

    entries = [
        entry("surrogate", "o", ANALYTIC, markerfacecolor="none", markersize=8),
        entry("finite elements", "o", FEM),
    ]
    if any(point.status != "ok" for point in front):
        entries.append(entry("failed by finite elements", "X", OTHER))
    if any(point.rank == 1 for point in front):
        entries.append(entry("best variant", "*", FEM, markersize=15))
    return entries
