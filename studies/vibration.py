"""What `magtip modes` says: natural frequencies, the paper's estimate beside them, what is usable to 600 Hz."""

from __future__ import annotations

from typing import Any

from geometry.design import Design
from geometry.scene import Magnet

BAND = 600.0
"""Up to where the paper used its sensor, Hz (section IV.C)."""


def run(design: Design, magnet: Magnet, count: int, depth: float, accuracy: str) -> dict[str, Any]:
    """One record: frequencies in rising order with their shapes, and the spring-mass formula."""
    from fem.levels import LEVELS
    from fem.modes import modes, spring_mass

    found = modes(design, magnet, count, depth=depth, accuracy=LEVELS[accuracy])
    alone, loaded = spring_mass(design)
    return {
        "status": "ok",
        "message": _verdict(found.frequency, found.shape),
        "depth_mm": depth,
        "frequency_Hz": list(found.frequency),
        "shape": list(found.shape),
        "spring_mass_Hz": alone,
        "spring_mass_with_magnet_Hz": loaded,
    }


def _verdict(frequencies: tuple[float, ...], shapes: tuple[str, ...]) -> str:
    """Which modes lie in the paper's band; a reading is true to 5 % up to 0.22 of the first mode that it sees.

    An undamped oscillator exaggerates by 1 / (1 - (f / f1)^2).
    """
    first = {shape: f for f, shape in reversed(list(zip(frequencies, shapes, strict=True)))}
    inside = [f"{shape} {f:.0f} Hz" for shape, f in first.items() if f < BAND]
    true_to = {shape: f * (1 - 1 / 1.05) ** 0.5 for shape, f in first.items() if shape in ("bending", "axial")}
    flat = ", ".join(f"{true_to[shape]:.0f} Hz for {shape} motion" for shape in true_to)
    below = f"below {BAND:.0f} Hz: {', '.join(inside)}" if inside else f"no mode below {BAND:.0f} Hz"
    return f"{below}; without damping, readings are true to 5 % up to {flat}" if flat else below
