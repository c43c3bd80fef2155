"""Bode plot of a vibrating sensor: gain and phase of the readings over the frequency."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.output.table_plots import COLOURS, canvas, label
from studies.simulation.response_curves import Curves

DASHES = ("-", "--", "-.", ":")


def draw(path: Path, curves: Curves, ladder: Mapping[str, NDArray[np.complex128]]) -> None:
    """Draw readings per N, per mm, and phases; without a force only per mm.

    Parameters
    ----------
    ladder : responses of the oscillators at the curves' frequencies, which are scaled to the largest reading per N
        at the lowest frequency.
    """
    readers = curves.readers
    first = readers[0]
    per_N = curves.per_N
    with canvas(path, 2 if per_N is None else 3, 1) as (figure, axes):
        panels = iter(zip(axes, "abc", strict=False))
        if per_N is not None:
            axis, letter = next(panels)
            _draw_gains(axis, curves, per_N)
            scale = abs(per_N[0, first])
            for (name, response), dashes in zip(ladder.items(), ("--", "-.", ":", (0, (1, 3))), strict=False):
                gain = scale * np.abs(response) / abs(response[0])
                axis.plot(curves.frequency, gain, color="#777777", linestyle=dashes, linewidth=1.1, label=name)
            axis.set_ylim(*_limits(np.abs(per_N[:, readers])))
            label(axis, letter, f"reading ({curves.units[first]}/N)")
        axis, letter = next(panels)
        _draw_gains(axis, curves, curves.per_mm)
        axis.set_ylim(*_limits(np.abs(curves.per_mm[:, readers])))
        label(axis, letter, f"reading ({curves.units[first]}/mm)")
        axis, letter = next(panels)
        phases = (
            {"per mm": (curves.per_mm, "-")}
            if per_N is None
            else {"per N": (per_N, "-"), "per mm": (curves.per_mm, "--")}
        )
        for name, (values, dashes) in phases.items():
            axis.plot(
                curves.frequency,
                relative_phase(values[:, first]),
                color=COLOURS[first % len(COLOURS)],
                linestyle=dashes,
                label=f"{curves.names[first]} {name}",
            )
        axis.legend(frameon=False)
        label(axis, letter, "phase (degrees)")
        axis.set_xlabel("frequency (Hz)")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=1 if ladder else len(labels), frameon=False)


def relative_phase(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the phase of readings (f,), degrees, continuous, and within a quarter turn of 0 at the lowest frequency.

    The sign of a reading only says to which side the element looks.
    """
    phase = np.unwrap(np.angle(values))
    return np.asarray(np.degrees(phase - np.pi * np.round(phase[0] / np.pi)))


def _draw_gains(axis: Any, curves: Curves, values: NDArray[np.complex128]) -> None:
    """Draw the gain of each element that reads the motion."""
    for rank, k in enumerate(curves.readers):
        look = {"color": COLOURS[k % len(COLOURS)], "linestyle": DASHES[rank % len(DASHES)]}
        axis.plot(curves.frequency, np.abs(values[:, k]), label=curves.names[k], **look)
    axis.set_xscale("log")
    axis.set_yscale("log")


def _limits(gains: NDArray[np.float64]) -> tuple[float, float]:
    """Return limits around gains, at least a decade apart."""
    low, high = float(gains.min()) / 1.5, float(gains.max()) * 1.5
    return min(low, high / 10), high
