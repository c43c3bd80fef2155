"""The lines that `magtip response` prints for a motion of the plate: each has a name that says what its value is."""

from __future__ import annotations

from collections.abc import Sequence

from studies.output.text_tables import shown
from studies.simulation.modal_report import BAND
from studies.simulation.motion_report import MotionReport
from studies.simulation.resonance_peaks import ACCURATE

Line = tuple[str, str]
"""Name and value with its unit."""
ROUGH = 0.05
"""Relative difference to a coarser mesh, median of all frequencies, beyond which the mesh is too coarse."""


def lines(motion: MotionReport) -> list[Line]:
    """Return the lines of a motion; those of a force or of a contact only where there is one."""
    free = motion.stiffness_N_per_mm is None
    rest = [
        ("press at rest", _with_unit(motion.depth_mm, "mm")),
        ("shear at rest", _shear(motion)),
    ]
    rest.append(("force at rest (x, y, z)", _listed(motion.force_N, "N")))
    band = f"{motion.lowest_Hz:g} to {motion.highest_Hz:g} Hz"
    return [
        ("in short", motion.message),
        *([] if free else rest),
        ("frequencies", band),
        ("natural frequencies, undamped", _listed(motion.undamped_Hz, "Hz")),
        *_resonances("plate" if not free else "base", motion.resonance_per_mm_Hz, motion.resonance_per_mm_Q),
        *([] if free else _resonances("force", motion.resonance_per_N_Hz, motion.resonance_per_N_Q)),
        *_readings(motion),
        *_amplitudes(motion),
        *_errors(motion),
    ]


def _resonances(driven_by: str, frequencies: Sequence[float], quality: Sequence[float | None]) -> list[Line]:
    """Return the line of the resonances under a plate, a base or a force of fixed amplitude."""
    each = [
        f"{_number(f)} Hz" + ("" if Q is None else f" (Q = {Q:.3g})")
        for f, Q in zip(frequencies, quality, strict=True)
    ]
    return [(f"resonances, {driven_by} of fixed amplitude", ", ".join(each) or "none in the band")]


def _readings(motion: MotionReport) -> list[Line]:
    """Return the lines of the readings: at the lowest frequency, bandwidths, and at 600 Hz."""
    slowest = f"{motion.lowest_Hz:g} Hz"
    unit, per_mm = motion.reading_per_mm
    rows = [
        ("elements", ", ".join(motion.element)),
        (f"readings per mm at {slowest}", _listed(per_mm, f"{unit}/mm")),
    ]
    if motion.stiffness_N_per_mm is None:
        return rows
    beyond = f"above {motion.highest_Hz:g}"
    reads = [value is not None for value in per_mm]

    def reached(values: Sequence[float | None]) -> str:
        texts = [
            "-" if not reading else beyond if value is None else _number(value)
            for value, reading in zip(values, reads, strict=True)
        ]
        return f"{', '.join(texts)} Hz"

    rows += [
        (f"readings per N at {slowest}", _listed(motion.reading_per_N[1], f"{unit}/N")),
        ("readings per mm are 3 dB lower at", reached(motion.bandwidth_per_mm_Hz)),
        ("readings per N are 3 dB lower at", reached(motion.bandwidth_per_N_Hz)),
        (f"readings per N are {100 * ACCURATE:g} % off at", reached(motion.accurate_per_N_Hz)),
    ]
    if motion.lowest_Hz <= BAND <= motion.highest_Hz:
        rows += [
            (f"readings per N at {BAND:g} Hz over {slowest}", _listed(motion.relative_reading_at_600)),
            (f"phase to the force at {BAND:g} Hz", _listed(motion.phase_at_600_deg, "°")),
        ]
    return rows


def _shear(motion: MotionReport) -> str:
    """Return the shear at rest, with both components where it is not along x."""
    along_x = _with_unit(motion.shear_mm, "mm")
    return along_x if not motion.shear_y_mm else f"{along_x} along x, {_with_unit(motion.shear_y_mm, 'mm')} along y"


def _amplitudes(motion: MotionReport) -> list[Line]:
    """Return the lines of stiffness and of the amplitudes up to which contact is kept."""
    if motion.stiffness_N_per_mm is None:
        return []
    amplitudes = (
        ("amplitude that opens a quarter of the contact", motion.kept_amplitude_mm, motion.kept_amplitude_Hz),
        ("amplitude that takes the whole normal force", motion.lift_amplitude_mm, motion.lift_amplitude_Hz),
    )
    return [
        (f"stiffness at {motion.lowest_Hz:g} Hz", _with_unit(motion.stiffness_N_per_mm, "N/mm")),
        *(
            (name, f"{_with_unit(value, 'mm')}, the least, at {_with_unit(at, 'Hz')}")
            for name, value, at in amplitudes
            if value is not None
        ),
    ]


def _errors(motion: MotionReport) -> list[Line]:
    """Return the lines of the numerical errors."""
    rows = [
        ("reduced basis", f"{motion.factorisations} factorisations, relative error {motion.reduced_error:.2g}"),
    ]
    what = "shift" if motion.stiffness_N_per_mm is None else "force"
    estimates = (
        (what, motion.error_estimate, motion.largest_error_estimate),
        ("readings per N", motion.reading_error_estimate, motion.largest_reading_error_estimate),
    )
    known = [
        (f"estimated error of the {name}", f"median {100 * median:.2g} %, largest {100 * largest:.2g} %")
        for name, median, largest in estimates
        if median is not None and largest is not None
    ]
    return [*known, *rows]


def mesh_warnings(motion: MotionReport) -> list[str]:
    """Return a sentence if the mesh is too coarse for the state at rest, or the difference is not known."""
    remedy = "take a finer --accuracy or a smaller load"
    if motion.mesh_difference is None:
        return [f"the state is not reached on a coarser mesh, so the error of the mesh is not known: {remedy}"]
    if motion.mesh_difference <= ROUGH:
        return []
    return [
        (
            f"along {motion.motion} the results differ by {100 * motion.mesh_difference:.2g} % from those on a "
            f"coarser mesh (median of all frequencies), by more than {100 * ROUGH:g} %: {remedy}"
        )
    ]


def _number(value: float | None) -> str:
    return shown("", value)


def _with_unit(value: float | None, unit: str) -> str:
    return f"{_number(value)} {unit}"


def _listed(values: Sequence[float | None], unit: str = "") -> str:
    """Return values with their unit; "none" for an empty list, and no unit if there is no number."""
    if not any(value is not None for value in values):
        return ", ".join("-" for _ in values) or "none"
    return f"{', '.join(map(_number, values))} {unit}".strip()
