"""Figures of steady vibrations (verb response) and of loading cycles (verb cycle)."""

from __future__ import annotations

import numpy as np

from geometry.arrays import Array
from studies.report.folder_contents import Table
from studies.report.report_figures import Axis, Figure, Guide, Panel, Series, grouped, numbers, series

BAND = 600.0
"""Frequency up to which the paper used its sensor, Hz."""
LAWS = {"prony": "linear overstresses", "finite": "law for large rates"}
"""Names of the laws of a loading cycle, by the texts of their column."""


def response(table: Table) -> list[Figure]:
    """Return gain and phase of the readings over the frequency, a panel for each motion of the plate."""
    per_N = [name for name in table.columns if name.endswith("_per_N")]
    forced = any(np.isfinite(table.floats(name)).any() for name in per_N)
    unit = "N" if forced else "mm"
    gains = [name for name in per_N if forced] or [
        name for name in table.columns if name.endswith("_per_mm") and not name.startswith(("force", "shift", "tilt"))
    ]
    phases = [f"{name.split('_')[0]}{'_per_N' if forced else ''}_phase_deg" for name in gains]
    names = [name.split("_")[0] for name in gains]
    frequency = table.floats("frequency_Hz")
    known = frequency[np.isfinite(frequency)]
    first = f"over that at {known.min():.4g} Hz" if len(known) else "over that at the lowest frequency"
    shaken = "" if forced else " The base is shaken."
    driver = "force" if forced else "motion of the base"
    idle = _idle(table, gains, names)
    return [
        Figure(
            f"Readings per {unit} over the frequency",
            f"Gain of each element {first}; 0.707 is a loss of 3 dB.{shaken}{idle}",
            Axis("frequency (Hz)", log=True),
            Axis(f"gain per {unit} {first}", log=True),
            _panels(table, gains, names, relative=True),
            guides=(Guide("x", BAND, f"{BAND:.0f} Hz"), Guide("y", 2**-0.5, "-3 dB")),
            source=table.name,
            replaces=("response_z.png", "response_x.png"),
        ),
        Figure(
            f"Phase of the readings per {unit}",
            f"Phase of each reading to the {driver}; below 0 the reading lags behind. Half a turn is taken off where "
            f"an element reads in the opposite sense.{shaken}{idle}",
            Axis("frequency (Hz)", log=True),
            Axis(f"phase to the {driver} (degrees)"),
            _panels(table, phases, names, relative=False),
            guides=(Guide("x", BAND, f"{BAND:.0f} Hz"),),
            source=table.name,
        ),
    ]


def _idle(table: Table, columns: list[str], names: list[str]) -> str:
    """Return a sentence for each motion that some elements do not read."""
    sentences = ""
    for motion, rows in grouped(table.texts("motion")).items():
        silent = [
            name
            for column, name in zip(columns, names, strict=True)
            if not np.isfinite(table.floats(column)[rows]).any()
        ]
        if silent:
            sentences += (
                f" {', '.join(silent)} {'reads' if len(silent) == 1 else 'read'} nothing of a motion along {motion}."
            )
    return sentences


def _panels(table: Table, columns: list[str], names: list[str], *, relative: bool) -> tuple[Panel, ...]:
    """Return a panel for each motion: gains over their values at the lowest frequency, or phases near 0 there."""
    frequency = table.floats("frequency_Hz")
    panels = []
    for motion, rows in grouped(table.texts("motion")).items():
        parts: list[Series] = []
        for k, (column, name) in enumerate(zip(columns, names, strict=True)):
            values = table.floats(column)[rows]
            if np.isfinite(values[0]) and (values[0] or not relative):
                change = values / values[0] if relative else values - 180 * np.round(values[0] / 180)
                # elements that change alike stay visible through the gaps of the dashes
                parts.append(series(name, frequency[rows], change, k, mark=False, dash=k % 4))
        panels.append(Panel(f"motion along {motion}", tuple(parts)))
    return tuple(panels)


def cycle(table: Table) -> list[Figure]:
    """Return the loops of force over motion, a panel for each law."""
    sheared = bool((np.abs(table.floats("shear_mm")) > 0).any())
    ways = ("the way to +x", "the way back") if sheared else ("loading", "unloading")
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
        panels.append(Panel(LAWS.get(law, law), tuple(part for part in parts if part.y)))
    return [
        Figure(
            "Loops of the force over the motion",
            f"Each cycle has a colour; the upper line of its loop is {ways[0]}, the lower one {ways[1]}. Dashed: the "
            "force that is decoded from the readings by the curve of slow loading. The table loops.csv has gap, area "
            "and dissipated energy of each loop.",
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
