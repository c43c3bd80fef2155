"""What `magtip modes` says: natural frequencies, the paper's estimate beside them, what is usable to 600 Hz."""

from __future__ import annotations

from typing import Any

from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress

BAND = 600.0
"""Up to where the paper used its sensor, Hz (section IV.C)."""


def run(
    design: Design, magnet: Magnet, count: int, depth: float, accuracy: str, progress: Progress
) -> dict[str, Any]:
    """One record: frequencies in rising order with their shapes, and the spring-mass formula.

    The status is failed where the press does not reach the depth, or is not stable there.

    Raises
    ------
    BadInput
        The count or the depth does not fit.
    """
    from fem.accuracy import LEVELS
    from fem.modes import MOST, modes, spring_mass

    if not 1 <= count <= MOST:
        raise BadInput(f"--count must be between 1 and {MOST}; got {count}")
    check_load(design, Load(depth=depth), magnet)
    progress(0.0, "modes of the pressed sensor" if depth else "modes of the free sensor")
    frequencies: tuple[float, ...] = ()
    errors: tuple[float | None, ...] = ()
    shapes: tuple[str, ...] = ()
    status = "ok"
    try:
        found = modes(design, magnet, count, depth=depth, accuracy=LEVELS[accuracy])
        frequencies, shapes, errors = found.frequency, found.shape, found.estimates
        message = _verdict(frequencies, shapes)
    except BadInput as error:
        status, message = "failed", str(error)
    alone, loaded = spring_mass(design)
    return {
        "status": status,
        "message": message,
        "depth_mm": depth,
        "frequency_Hz": list(frequencies),
        "frequency_error_estimate": list(errors),
        "shape": list(shapes),
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
    if max(frequencies) < BAND:
        below += f" and possibly more (only modes up to {max(frequencies):.0f} Hz are computed: raise --count)"
    return f"{below}; without damping, readings of a slow load are accurate to 5 % up to {flat}" if flat else below
