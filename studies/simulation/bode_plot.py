"""Bode plot of a vibrating sensor: gain and phase of the readings over the frequency."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.output.table_plots import COLOURS, FEM, label, sheet
from studies.simulation.response_curves import Curves

DASHES = ("-", "--", "-.", ":")
FORMULAS = (("#999999", "--"), ("#000000", ":"), ("#D55E00", "-."), ("#009E73", "--"))
"""Colours and dashes of the oscillators, in their order from the last: the plots along x have the last two only."""
HIGHEST = 2.0
"""Height of the panel of oscillators over the largest damped gain: an undamped one has no largest gain."""


def draw(path: Path, curves: Curves, ladder: Mapping[str, NDArray[np.complex128]]) -> None:
    """Draw readings per N, per mm, their phases, and the largest one beside the oscillators.

    Parameters
    ----------
    ladder : responses of the oscillators at the curves' frequencies; empty where there is no force.
    """
    first, per_N, unit = curves.readers[0], curves.per_N, curves.units[curves.readers[0]]
    beside = per_N is not None and bool(ladder)
    rows = ("ab",) if per_N is None else ("ab", "cc", "dd") if beside else ("ab", "cc")
    with sheet(path, 7.0, 2.3 * len(rows) + 0.4) as figure:
        by_letter = figure.subplot_mosaic("\n".join(rows), sharex=True)
        panels = iter((axis, letter) for letter, axis in by_letter.items())
        for values, per in ((per_N, "N"), (curves.per_mm, "mm")):
            if values is not None:
                axis, letter = next(panels)
                _draw_gains(axis, curves, values)
                axis.set_ylim(*_limits(np.abs(values[:, curves.readers])))
                label(axis, letter, f"reading ({unit}/{per})")
        if beside:
            axis, letter = next(panels)
            assert per_N is not None
            _draw_ladder(axis, curves.frequency, per_N[:, first], ladder, curves.names[first])
            label(axis, letter, "reading per N, relative")
        axis, letter = next(panels)
        for values, name, dashes in (
            (per_N, "per N", "-"),
            (curves.per_mm, "per mm", "--" if per_N is not None else "-"),
        ):
            if values is not None:
                look = {"color": COLOURS[first % len(COLOURS)], "linestyle": dashes}
                axis.plot(
                    curves.frequency,
                    relative_phase(values[:, first]),
                    label=f"{curves.names[first]} {name}",
                    **look,
                )
        axis.legend(frameon=False, fontsize=9)
        label(axis, letter, "phase (degrees)")
        handles, names = by_letter["a"].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside upper center", ncols=len(names), frameon=False)
        for letter, axis in by_letter.items():
            # panels of half the width have other positions than those below them
            axis.tick_params(labelbottom=letter in rows[-1] or letter in "ab")
            if letter in rows[-1] or letter in "ab":
                axis.set_xlabel("frequency (Hz)")


def _draw_ladder(
    axis: Any,
    frequency: NDArray[np.float64],
    reading: NDArray[np.complex128],
    ladder: Mapping[str, NDArray[np.complex128]],
    name: str,
) -> None:
    """Draw a reading per N and the oscillators over their values at the lowest frequency."""
    gain = np.abs(reading / reading[0])
    axis.plot(frequency, gain, color=FEM, label=f"{name}, finite elements")
    highest = float(gain.max())
    for (text, response), (colour, dashes) in zip(ladder.items(), FORMULAS[-len(ladder) :], strict=True):
        values = np.abs(response / response[0])
        if np.iscomplex(response).any():
            highest = max(highest, float(values.max()))
        axis.plot(frequency, values, color=colour, linestyle=dashes, linewidth=1.2, label=text)
    axis.set_yscale("log")
    axis.set_ylim(min(0.5, 0.7 * float(gain.min())), HIGHEST * highest)
    axis.legend(frameon=False, fontsize=9, loc="upper left", handlelength=2.2)


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
