"""The report of `magtip modes`: natural frequencies, the paper's estimate, and the modes below 600 Hz."""

from __future__ import annotations

from dataclasses import dataclass

from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress
from studies.output import records
from studies.output.records import FlatRow

BAND = 600.0
"""Highest frequency at which the paper used its sensor, Hz (section IV.C)."""


@dataclass(frozen=True, slots=True)
class ModalReport:
    """Natural frequencies in rising order.

    Attributes
    ----------
    status : that of the press, or "failed" if it does not reach the depth or has no natural frequencies there.
    depth_mm : depth of the press; 0 for the free sensor.
    frequency_Hz, frequency_error_estimate, shape : one value for each mode; empty if the status is "failed".
    spring_mass_Hz, spring_mass_with_magnet_Hz : the paper's formula, without and with the mass of the magnet.
    """

    status: str
    message: str
    depth_mm: float
    frequency_Hz: list[float]
    frequency_error_estimate: list[float | None]
    shape: list[str]
    spring_mass_Hz: float
    spring_mass_with_magnet_Hz: float

    def row(self) -> FlatRow:
        """Return the flat row for JSON and for the terminal."""
        return records.flat(self)


def run(design: Design, magnet: Magnet, count: int, depth: float, accuracy: str, progress: Progress) -> ModalReport:
    """Compute the natural frequencies of the free sensor, or of one pressed to a depth, mm.

    Raises
    ------
    BadInput
        The number of modes or the depth is out of range.
    """
    from fem.accuracy import LEVELS
    from fem.analyses.modes import MOST, modes, spring_mass

    if not 1 <= count <= MOST:
        raise BadInput(f"--count must be between 1 and {MOST}; got {count}")
    check_load(design, Load(depth=depth), magnet)
    progress(0.0, "modes of the pressed sensor" if depth else "modes of the free sensor")
    frequencies: tuple[float, ...] = ()
    errors: tuple[float | None, ...] = ()
    shapes: tuple[str, ...] = ()
    status: str = "ok"
    try:
        solution = modes(design, magnet, count, depth=depth, accuracy=LEVELS[accuracy])
        frequencies, shapes, errors = solution.frequency, solution.shape, solution.estimates
        status = solution.status
        message = "; ".join(filter(None, [solution.message, _band_message(frequencies, shapes)]))
    except BadInput as error:
        status, message = "failed", str(error)
    beam_only, with_magnet = spring_mass(design)
    return ModalReport(status, message, depth, list(frequencies), list(errors), list(shapes), beam_only, with_magnet)


def _band_message(frequencies: tuple[float, ...], shapes: tuple[str, ...]) -> str:
    """Name the modes below `BAND`, and the highest frequency at which readings are still accurate to 5 %.

    A slow load at frequency f excites an undamped oscillator of frequency f1 by a factor of 1 / (1 - (f / f1)^2). The
    factor reaches 1.05 at f = 0.22 f1.
    """
    # the first mode of each shape: later entries of a dict replace earlier ones
    first = {shape: f for f, shape in reversed(list(zip(frequencies, shapes, strict=True)))}
    inside = [f"{shape} {f:.0f} Hz" for shape, f in first.items() if f < BAND]
    # ovalling and torsion leave the magnet where it is, so they do not change the readings
    accurate_to = {shape: f * (1 - 1 / 1.05) ** 0.5 for shape, f in first.items() if shape in ("bending", "axial")}
    quasi_static = ", ".join(f"{accurate_to[shape]:.0f} Hz for {shape} motion" for shape in accurate_to)
    below = f"below {BAND:.0f} Hz: {', '.join(inside)}" if inside else f"no mode below {BAND:.0f} Hz"
    if max(frequencies) < BAND:
        below += f" and possibly more (only modes up to {max(frequencies):.0f} Hz are computed: raise --count)"
    if not quasi_static:
        return below
    return f"{below}; without damping, readings of a slow load are accurate to 5 % up to {quasi_static}"
