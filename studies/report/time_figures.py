"""Figures of steady vibrations (verb response) and of loading cycles (verb cycle)."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Array
from studies.report.folder_contents import Table
from studies.report.report_figures import Axis, Figure, Guide, Panel, Series, grouped, numbers, series

BAND = 600.0
"""Frequency up to which the paper used its sensor, Hz."""


def response(table: Table) -> list[Figure]:
    """Return gain and phase of the readings over the frequency, a panel for each motion of the plate."""
    per_N = [name for name in table.columns if name.endswith("_per_N") and np.isfinite(table.floats(name)).any()]
    unit = "N" if per_N else "mm"
    gains = per_N or [
        name for name in table.columns if name.endswith("_per_mm") and not name.startswith(("force", "shift", "tilt"))
    ]
    phases = [f"{name.split('_')[0]}{'_per_N' if per_N else ''}_phase_deg" for name in gains]
    names = [name.split("_")[0] for name in gains]
    first = "over that at the lowest frequency"
    other = "The base is shaken." if not per_N else "Phases are those to the force."
    return [
        Figure(
            f"Readings per {unit} over the frequency",
            f"Gain of each element {first}; 0.707 is a loss of 3 dB. {other}",
            Axis("frequency (Hz)", log=True),
            Axis(f"gain per {unit}, {first}", log=True),
            _panels(table, gains, names, relative=True),
            guides=(Guide("x", BAND, f"{BAND:.0f} Hz"), Guide("y", 2**-0.5, "-3 dB")),
            source=table.name,
            replaces=("response_z.png", "response_x.png"),
        ),
        Figure(
            f"Phase of the readings per {unit}",
            f"Change of the phase from the lowest frequency. {other}",
            Axis("frequency (Hz)", log=True),
            Axis("phase (degrees)"),
            _panels(table, phases, names, relative=False),
            guides=(Guide("x", BAND, f"{BAND:.0f} Hz"),),
            source=table.name,
        ),
    ]


def _panels(table: Table, columns: list[str], names: list[str], *, relative: bool) -> tuple[Panel, ...]:
    """Return a panel for each motion, with columns over or less their values at the lowest frequency."""
    frequency = table.floats("frequency_Hz")
    panels = []
    for motion, rows in grouped(table.texts("motion")).items():
        parts: list[Series] = []
        for k, (column, name) in enumerate(zip(columns, names, strict=True)):
            values = table.floats(column)[rows]
            if np.isfinite(values[0]) and (values[0] or not relative):
                change = values / values[0] if relative else values - values[0]
                parts.append(series(name, frequency[rows], change, k, mark=False))
        panels.append(Panel(f"motion along {motion}", tuple(parts)))
    return tuple(panels)


def cycle(table: Table) -> list[Figure]:
    """Return the loops of force over motion, a panel for each law."""
    sheared = bool((np.abs(table.floats("shear_mm")) > 0).any())
    way, force = ("shear_mm", "force_x_N") if sheared else ("depth_mm", "force_z_N")
    x, y, decoded = table.floats(way), table.floats(force), table.floats("decoded_force_N")
    cycles = table.texts("cycle")
    panels = []
    for law, rows in grouped(table.texts("law")).items():
        parts = []
        for k, (number, members) in enumerate(grouped([cycles[row] for row in rows]).items()):
            own = [rows[i] for i in members]
            parts.append(_loop(f"cycle {number}" if number != "0" else "press", x[own], y[own], k, 0))
            if np.isfinite(decoded[own]).any():
                parts.append(_loop(f"decoded, cycle {number}", x[own], decoded[own], k, 1))
        panels.append(Panel(f"law {law}", tuple(part for part in parts if part.y)))
    return [
        Figure(
            "Loops of the force over the motion",
            "Each cycle has a colour; dashed lines are the force that the readings give by the curve of slow "
            "loading. The table loops.csv has gap, area and dissipated energy of each loop.",
            Axis("shear (mm)" if sheared else "depth (mm)"),
            Axis("force along the shear (N)" if sheared else "press force (N)"),
            tuple(panels),
            source=table.name,
            replaces=("cycle.png",),
        )
    ]


def _loop(name: str, x: Array, y: Array, style: int, dash: int) -> Series:
    """Return a line in the order of time, which a loop does not share with its x."""
    points = [(a, b) for a, b in zip(numbers(x), numbers(y), strict=True) if a is not None and b is not None]
    return Series(name, tuple(a for a, _ in points), tuple(b for _, b in points), mark=False, style=style, dash=dash)
