"""Map of the errors of the paper's press formula and voltage over E and the magnet's height."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from geometry.arrays import Array
from studies.output.table_plots import ANALYTIC, canvas, label
from studies.validation.claim_states import Press, with_magnet
from studies.validation.press_errors import (
    BOUND,
    MODULI,
    PUBLISHED,
    error_of_largest,
    formula,
    height_row,
    moduli,
    modulus_interval,
    voltages,
)

LEVELS = (0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 300.0)
"""Bounds of the errors in the map, %."""
FINE = 49
"""Heights of the magnet in the map, between those that are solved."""


def draw(path: Path, presses: Sequence[Press]) -> None:
    """Draw the error of the force, and of S1's voltage with a fitted gain, over the magnet's height and E."""
    known = [press for press in presses if press.complete and press.height]
    bare = [press for press in presses if press.complete and not press.height]
    searched, coarse, tallest = moduli(401), moduli(21), max(press.height for press in presses)
    rows = interpolated(known, np.linspace(known[0].height, known[-1].height, FINE))
    heights, predicted = [press.height for press in rows], formula(rows[0].depth)
    forces = np.array([[error_of_largest(predicted, press.force, E) for press in rows] for E in searched.tolist()])
    curves = [voltages(press) for press in rows]
    outputs = np.array(
        [[c.error(E, any_gain=True) if c.reaches(E) else np.nan for c in curves] for E in coarse.tolist()]
    )
    with canvas(path, 2, 1) as (figure, axes):
        _error_panel(axes[0], "a", "$F_N$", heights, searched, forces)
        drawn = _error_panel(axes[1], "b", "voltage of S1, gain fitted", heights, coarse, outputs)
        for axis in axes:
            _mark_moduli(axis, heights[-1], tallest)
        bounds = [modulus_interval(predicted, p.force, np.full_like(p.depth, BOUND * p.force[-1])) for p in rows]
        for ends in np.array([bound or (np.nan, np.nan) for bound in bounds]).T:
            axes[0].plot(heights, ends, color="black", linewidth=1.2)
        for press in bare:
            interval = height_row(press)
            axes[0].plot([0, 0], [interval.E_from_MPa, interval.E_to_MPa], color="black", linewidth=4)
            axes[0].text(-0.08, 1.25, "no magnet", fontsize=10, va="center")
        axes[1].text(known[0].height + 0.1, 2.2, "(5) ends below the forces of the press", fontsize=10, va="center")
        figure.colorbar(drawn, ax=axes, ticks=LEVELS).set_label("largest error (%)")
        axes[-1].set_xlabel("height of the magnet (mm)")
        figure.legend(handles=_modulus_handles(), loc="outside upper center", ncols=3, frameon=False, fontsize=10)


def _error_panel(axis: Any, letter: str, title: str, heights: Sequence[float], E: Array, errors: Array) -> Any:
    """Draw errors, shape (moduli, heights), %, and return the filled contours."""
    from matplotlib.colors import BoundaryNorm

    axis.set_facecolor("#dddddd")
    drawn = axis.contourf(heights, E, errors, LEVELS, cmap="cividis_r", norm=BoundaryNorm(LEVELS, 256))
    axis.set(yscale="log", ylim=MODULI)
    axis.set_yticks([0.3, 0.5, 1, 2, 3], ["0.3", "0.5", "1", "2", "3"])
    axis.minorticks_off()
    label(axis, letter, "E (MPa)")
    axis.set_title(f"error of {title}, % of the largest", fontsize=11)
    return drawn


def interpolated(presses: Sequence[Press], heights: Array) -> list[Press]:
    """Return presses at other heights of the magnet, interpolated between those that were solved."""
    from scipy.interpolate import PchipInterpolator

    if len(presses) < 2:
        return list(presses)
    solved = [press.height for press in presses]
    # the force grows by orders of magnitude with the height, its logarithm evenly
    force = np.exp(PchipInterpolator(solved, np.log([press.force for press in presses]))(heights))
    sinking = PchipInterpolator(solved, [press.sinking for press in presses])(heights)
    depth = presses[0].depth
    return [
        Press(height, with_magnet(height), depth, by_force, by_sinking, error_estimate=0.0, message="")
        for height, by_force, by_sinking in zip(heights.tolist(), force, sinking, strict=True)
    ]


def _mark_moduli(axis: Any, reached: float, tallest: float) -> None:
    """Mark the published moduli, the paper's E, and the heights whose presses do not reach every depth."""
    for E in PUBLISHED:
        axis.axhline(E, color="black", linestyle=":", linewidth=1.5)
    axis.axhline(1.0, color=ANALYTIC, linewidth=1.5)
    axis.set_xlim(-0.15, tallest)
    if tallest > reached:
        axis.axvspan(reached, tallest, facecolor="#dddddd", edgecolor="#777777", hatch="//", linewidth=0)
        middle = (reached + tallest) / 2
        axis.text(middle, 1.7, "not reached\nby FEM", ha="center", va="center", fontsize=10, backgroundcolor="white")


def _modulus_handles() -> list[Any]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color="black", label="$F_N$ within 5 %"),
        Line2D([], [], color=ANALYTIC, label="the paper's E"),
        Line2D([], [], color="black", linestyle=":", label=f"published: {PUBLISHED[0]:g} to {PUBLISHED[1]:g} MPa"),
    ]
