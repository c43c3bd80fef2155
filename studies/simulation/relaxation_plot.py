"""The plot of a relaxation test or a dynamic test with the branches fitted to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array
from studies.output.table_plots import ANALYTIC, FEM, canvas, label
from studies.simulation.relaxation_test import Test


def draw(path: str | Path, test: Test, smooth: Array, curve: NDArray[Any], at_points: NDArray[Any]) -> None:
    """Draw a test with the fitted branches: above the moduli, below the loss factor or what the fit leaves over.

    Parameters
    ----------
    smooth : times, s, or frequencies, Hz, of the curve.
    curve, at_points : fitted E(t), or E' + i E'', at `smooth` and at the points of the test, MPa.
    """
    unit = "(MPa)" if test.has_modulus else "(MPa, nominal)"
    with canvas(path, 2, 1) as (figure, axes):
        if test.kind == "dynamic":
            for part, name, colour in ((np.real, "storage", FEM), (np.imag, "loss", ANALYTIC)):
                _points(axes[0], test.at, part(test.values), colour, f"{name}, test")
                axes[0].plot(smooth, part(curve), color=colour, label=f"{name}, fit")
            _points(axes[1], test.at, test.values.imag / test.values.real, FEM, None)
            axes[1].plot(smooth, curve.imag / curve.real, color=FEM)
            axes[0].set_yscale("log")
            label(axes[0], "a", f"modulus {unit}")
            label(axes[1], "b", "loss factor")
            axes[1].set_xlabel("frequency (Hz)")
        else:
            _points(axes[0], test.at, test.values, FEM, "test")
            axes[0].plot(smooth, curve, color=FEM, label="fit")
            left = 100 * (at_points - test.values) / test.values.max()
            axes[1].plot(test.at, left, "o-", color=FEM, markersize=3)
            axes[1].axhline(0, color="#777777", linewidth=0.8)
            label(axes[0], "a", f"{'modulus E(t)' if test.has_modulus else 'stress'} {unit}")
            label(axes[1], "b", "fit less test (% of max.)")
            axes[1].set_xlabel("time (s)")
        axes[0].set_xscale("log")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)


def _points(axis: Any, x: Array, y: Array, colour: str, name: str | None) -> None:
    axis.plot(x, y, "o", color=colour, markerfacecolor="white", label=name, zorder=1)
