"""The report of `magtip modes`: natural frequencies, the paper's estimate, and the modes below 600 Hz."""

from __future__ import annotations

from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress
from studies.output.records import FlatRow
from studies.output.result import Result, failure_of

BAND = 600.0
"""Highest frequency at which the paper used its sensor, Hz (section IV.C)."""


def run(design: Design, magnet: Magnet, count: int, depth: float, accuracy: str, progress: Progress) -> Result:
    """Compute the natural frequencies of the free sensor, or of one pressed to a depth, mm.

    The record has lists with a value for each mode, in rising order, which are empty if the status is "failed": the
    press does not reach the depth, or has no natural frequencies there.

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
    found: FlatRow = {"frequency_Hz": [], "frequency_error_estimate": [], "shape": []}
    try:
        solution = modes(design, magnet, count, depth=depth, accuracy=LEVELS[accuracy])
    except BadInput as error:
        status, message = "failed", str(error)
    else:
        found = {
            "frequency_Hz": list(solution.frequency),
            "frequency_error_estimate": list(solution.estimates),
            "shape": list(solution.shape),
        }
        status = solution.status
        message = "; ".join(filter(None, [solution.message, _band_message(solution.frequency, solution.shape)]))
    beam_only, with_magnet = spring_mass(design)
    record = {"status": status, "message": message, "depth_mm": depth, **found}
    record |= {"spring_mass_Hz": beam_only, "spring_mass_with_magnet_Hz": with_magnet}
    return Result(title="Natural frequencies", records=[record], failures=failure_of([record]))


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
