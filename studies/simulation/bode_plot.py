"""Bode plot of a vibrating sensor: gain and phase of the readings over the frequency."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.output.table_plots import COLOURS, label, log_numbers, sheet
from studies.simulation.response_curves import Curves

LOOKS = (("-", 1.8), ("-", 3.2), ("--", 1.6))
"""Dashes and widths, points, of the elements' lines: of two that read alike by symmetry both remain visible."""
FORMULAS = (("#999999", "--"), ("#E69F00", ":"), ("#CC79A7", "-."), ("#56B4E9", "--"))
"""Colours and dashes of the oscillators, in their order from the last: the plots along x have the last two only."""
HIGHEST = 2.0
"""Height of the panel of oscillators over the largest damped gain: an undamped one has no largest gain."""


def draw(path: Path, curves: Curves, ladder: Mapping[str, NDArray[np.complex128]]) -> None:
    """Draw readings per N, per mm, their phases, and the magnet's shift per N beside the oscillators.

    An element keeps its colour in all panels; the legend names those that do not read the motion.

    Parameters
    ----------
    ladder : responses of the oscillators at the curves' frequencies; empty where there is no force.
    """
    from matplotlib.ticker import MultipleLocator

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
                log_numbers(axis, "y")
                label(axis, letter, f"reading ({unit}/{per})")
        if beside:
            axis, letter = next(panels)
            assert curves.force is not None
            _draw_ladder(axis, curves.frequency, curves.along / curves.force, ladder)
            label(axis, letter, f"shift per N over\nthat at {curves.frequency[0]:.4g} Hz")
        axis, letter = next(panels)
        for values, name, dashes in (
            (per_N, "per N: to the force", "-"),
            (curves.per_mm, "per mm: to the motion", "--" if per_N is not None else "-"),
        ):
            if values is not None:
                look = {"color": COLOURS[first % len(COLOURS)], "linestyle": dashes}
                phase = relative_phase(values[:, first])
                axis.plot(curves.frequency, phase, label=f"{curves.names[first]} {name}", **look)
        axis.legend(frameon=False, fontsize=10)
        label(axis, letter, "phase (degrees)")
        if np.ptp(axis.get_ylim()) > 120:
            axis.yaxis.set_major_locator(MultipleLocator(45))
        _legend(figure, by_letter["a"], curves)
        log_numbers(by_letter["a"], "x")
        for letter, axis in by_letter.items():
            # panels of half the width have other positions than those below them
            axis.tick_params(labelbottom=letter in rows[-1] or letter in "ab")
            if letter in rows[-1] or letter in "ab":
                axis.set_xlabel("frequency (Hz)")


def _legend(figure: Any, axis: Any, curves: Curves) -> None:
    """Write the elements above all panels, and name those that read nothing of this motion."""
    from matplotlib.lines import Line2D

    by_name = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    entries = {name: by_name[name] for name in curves.names if name in by_name}
    idle = [name for name in curves.names if name not in by_name]
    if idle:
        text = f"no reading of a motion along {curves.motion}: {', '.join(idle)}"
        entries[text] = Line2D([], [], linestyle="none")
    figure.legend(entries.values(), entries, loc="outside upper center", ncols=min(len(entries), 6), frameon=False)


def _draw_ladder(
    axis: Any,
    frequency: NDArray[np.float64],
    shift: NDArray[np.complex128],
    ladder: Mapping[str, NDArray[np.complex128]],
) -> None:
    """Draw the magnet's shift per N and that of the oscillators over their values at the lowest frequency."""
    gain = np.abs(shift / shift[0])
    axis.plot(frequency, gain, color="#000000", label="finite elements")
    highest = float(gain.max())
    for (text, response), (colour, dashes) in zip(ladder.items(), FORMULAS[-len(ladder) :], strict=True):
        values = np.abs(response / response[0])
        if np.iscomplex(response).any():
            highest = max(highest, float(values.max()))
        axis.plot(frequency, values, color=colour, linestyle=dashes, linewidth=1.5, label=text)
    axis.set_yscale("log")
    axis.set_ylim(min(0.5, 0.7 * float(gain.min())), HIGHEST * highest)
    log_numbers(axis, "y")
    axis.legend(frameon=False, fontsize=10, loc="upper left", handlelength=2.2)


def relative_phase(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the phase of readings (f,), degrees, continuous, and within a quarter turn of 0 at the lowest frequency.

    The sign of a reading only says to which side the element looks.
    """
    phase = np.unwrap(np.angle(values))
    return np.asarray(np.degrees(phase - np.pi * np.round(phase[0] / np.pi)))


def _draw_gains(axis: Any, curves: Curves, values: NDArray[np.complex128]) -> None:
    """Draw the gain of each element that reads the motion."""
    for k in sorted(curves.readers):
        dashes, width = LOOKS[k % len(LOOKS)]
        look = {"color": COLOURS[k % len(COLOURS)], "linestyle": dashes, "linewidth": width}
        axis.plot(curves.frequency, np.abs(values[:, k]), label=curves.names[k], **look)
    axis.set_xscale("log")
    axis.set_yscale("log")


def _limits(gains: NDArray[np.float64]) -> tuple[float, float]:
    """Return limits around gains, at least a decade apart."""
    low, high = float(gains.min()) / 1.5, float(gains.max()) * 1.5
    return min(low, high / 10), high
