"""The vibration of a sensor under one motion of the plate: the record of `magtip response`, and its lines.

Lists over elements have the order of `element`. Values that lie outside the band, or do not exist, are None.

status, message : of the state at rest; the message also says what the vibration shows.
motion : "z" or "x".
force_N : (x, y, z) on the tip at rest.
stiffness_N_per_mm : force along the motion over its amplitude, at the lowest frequency.
undamped_Hz : lowest natural frequencies about this state, glued to a plate that does not move, without damping
    and with the long-term modulus; under a shear those of both motions.
resonance_per_mm_Hz, resonance_per_mm_Q : resonances of the magnet's motion under a plate with a fixed amplitude.
resonance_per_N_Hz, resonance_per_N_Q : the same under a force with a fixed amplitude on a plate without mass.
reading_V_per_mm, reading_V_per_N : readings (T for a chip) at the lowest frequency over motion and force.
bandwidth_per_mm_Hz, bandwidth_per_N_Hz : frequency at which these are 3 dB lower.
accurate_per_N_Hz : frequency up to which those per N change by less than ACCURATE.
relative_reading_at_600, phase_at_600_deg : readings per N at 600 Hz over those at the lowest frequency, and their
    phase; negative where they lag behind the force.
kept_amplitude_mm, kept_amplitude_Hz : amplitude of the motion at which a quarter of the contact area loses its
    pressure within a cycle, the least one of all frequencies, and its frequency.
lift_amplitude_mm, lift_amplitude_Hz : the same for the whole force; None where the motion does not change it.
mesh_difference, largest_mesh_difference : relative difference of force (of the magnet's shift for the free
    sensor) to a mesh coarser by 1.5: median and largest of all frequencies.
error_estimate, largest_error_estimate : estimated relative error of the same: median and largest of all
    frequencies.
reading_error_estimate, largest_reading_error_estimate : the same of the readings per N.
factorisations, reduced_error : factorisations for all frequencies, and error of the reduced basis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from geometry.loads import Load
from studies.mechanics.resonance_peaks import ACCURATE, BAND, Gain, Peak, bandwidth, flat_to, peaks
from studies.output.records import FlatRow
from studies.output.text_tables import shown
from studies.simulation import response_curves
from studies.simulation.response_curves import At, Complex, Curves

if TYPE_CHECKING:
    from fem.analyses.vibration import VibratingSensor

Line = tuple[str, str]
"""Name and value with its unit."""
ROUGH = 0.05
"""Relative difference to a coarser mesh, median of all frequencies, beyond which the mesh is too coarse."""


def report_motion(sensor: VibratingSensor, at: At, curves: Curves, load: Load, coarse: Curves | None) -> FlatRow:
    """Return the record of one motion; about the free sensor the base is shaken, and there is no force.

    Parameters
    ----------
    at : curves of the sensor at any frequencies.
    coarse : the same curves on a coarser mesh, or None.
    """
    motion, free, damped = curves.motion, curves.force is None, bool(sensor.relaxation.times)
    stiffness = sensor.static_stiffness().get(motion)
    low, high = float(curves.frequency[0]), float(curves.frequency[-1])

    def gain(value: Callable[[Curves], Complex]) -> Gain:
        return lambda f: np.abs(value(at(f)[motion]))

    def of_readers(value: Callable[[int], float | None]) -> list[float | None]:
        # about the free sensor there is no force, and no bandwidth either
        return [value(k) if k in curves.readers and not free else None for k in range(len(curves.names))]

    def per_mm(k: int) -> Gain:
        return gain(lambda c: c.per_mm[:, k])

    def per_N(k: int) -> Gain:
        return gain(lambda c: _known(c.per_N)[:, k])

    by_mm = peaks(gain(lambda c: c.along), low, high)
    by_N = [] if free else peaks(gain(lambda c: c.along / _known(c.force)), low, high)
    at_band = _at_band(at, curves) if low <= BAND <= high and not free else {}
    differences = None if coarse is None else response_curves.mesh_difference(curves, coarse)
    errors = response_curves.error_columns(curves, coarse, sensor.scene)
    message = _message(curves, by_N or by_mm, at_band, damped=damped, stiffness=stiffness)
    return {
        "status": sensor.state.status,
        "message": "; ".join(filter(None, [sensor.state.message, message])),
        "motion": motion,
        "depth_mm": load.depth,
        "shear_mm": load.shear_x,
        "shear_y_mm": load.shear_y,
        "force_N": list(sensor.state.response.force),
        "lowest_Hz": low,
        "highest_Hz": high,
        "stiffness_N_per_mm": None if curves.force is None else float(abs(curves.force[0])),
        "undamped_Hz": [f for name, fs in sensor.undamped().items() if motion in name.split(" and ") for f in fs],
        "resonance_per_mm_Hz": [peak.frequency for peak in by_mm],
        "resonance_per_mm_Q": [peak.Q if damped else None for peak in by_mm],
        "resonance_per_N_Hz": [peak.frequency for peak in by_N],
        "resonance_per_N_Q": [peak.Q if damped else None for peak in by_N],
        "element": list(curves.names),
        f"reading_{curves.units[0]}_per_mm": _slow(curves.per_mm, curves.readers),
        f"reading_{curves.units[0]}_per_N": _slow(curves.per_N, curves.readers),
        "bandwidth_per_mm_Hz": of_readers(lambda k: bandwidth(per_mm(k), low, high)),
        "bandwidth_per_N_Hz": of_readers(lambda k: bandwidth(per_N(k), low, high)),
        "accurate_per_N_Hz": of_readers(lambda k: flat_to(per_N(k), ACCURATE, low, high)),
        "relative_reading_at_600": [at_band.get(k, (None, None))[0] for k in range(len(curves.names))],
        "phase_at_600_deg": [at_band.get(k, (None, None))[1] for k in range(len(curves.names))],
        **_least("kept_amplitude", curves.kept_amplitude, curves.frequency),
        **_least("lift_amplitude", _lift(sensor.state.response.force[2], curves), curves.frequency),
        **_median_and_largest("mesh_difference", differences),
        **{key: value for name, each in errors.items() for key, value in _median_and_largest(name, each).items()},
        "factorisations": sensor.factorisations,
        "reduced_error": sensor.error,
    }


def _at_band(at: At, curves: Curves) -> dict[int, tuple[float | None, float | None]]:
    """Return reading per N at BAND over that at the lowest frequency, and phase to the force, degrees, by element."""
    ends = at(np.array([curves.frequency[0], BAND]))[curves.motion]
    values = _known(ends.per_N)
    answers: dict[int, tuple[float | None, float | None]] = {}
    for k in curves.readers:
        # the reading may be opposite to the force; only its change counts
        sign = 1.0 if values[0, k].real > 0 else -1.0
        phase = np.degrees(np.angle(sign * values[1, k]))
        answers[k] = float(abs(values[1, k] / values[0, k])), float(phase)
    return answers


def _lift(force: float, curves: Curves) -> Array | None:
    """Return the amplitude (f,), mm, at which the normal force, N at rest, falls to 0 within a cycle."""
    return None if curves.normal_force is None else force / curves.normal_force


def _slow(values: Complex | None, readers: list[int]) -> list[float | None]:
    """Return the size of readings (f, k) at the lowest frequency; None where an element reads nothing."""
    if values is None:
        return []
    return [float(abs(values[0, k])) if k in readers else None for k in range(values.shape[1])]


def _known(values: Complex | None) -> Complex:
    assert values is not None
    return values


def _median_and_largest(name: str, values: Array | None) -> FlatRow:
    if values is None:
        return {name: None, f"largest_{name}": None}
    return {name: float(np.median(values)), f"largest_{name}": float(values.max())}


def _least(name: str, values: Array | None, frequency: Array) -> FlatRow:
    """Return the least of values (f,), mm, and its frequency; None without a finite value."""
    if values is None or not np.isfinite(values).any():
        return {f"{name}_mm": None, f"{name}_Hz": None}
    i = int(np.nanargmin(values))
    return {f"{name}_mm": float(values[i]), f"{name}_Hz": float(frequency[i])}


def _message(
    curves: Curves,
    resonances: list[Peak],
    at_band: dict[int, tuple[float | None, float | None]],
    *,
    damped: bool,
    stiffness: float | None,
) -> str:
    """Say what the readings do at 600 Hz, up to which the paper used its sensor, and where they resonate."""
    if stiffness is not None and not stiffness > 0:
        return (
            f"the stiffness along {curves.motion} at rest is {stiffness:.3g} N/mm: the sensor is stable under a "
            "plate that is held, and gives way under a force, so readings per N are not those of a free plate"
        )
    under = "shaken at its base" if curves.force is None else "under a force"
    first = f"{under}, the magnet has no resonance in the band"
    if resonances:
        first = f"{under}, the magnet resonates at {resonances[0].frequency:.0f} Hz"
        if damped and resonances[0].Q is not None:
            first += f" (Q = {resonances[0].Q:.2g})"
    if not at_band:
        return first
    k = curves.readers[0]
    gain, phase = at_band[k]
    assert phase is not None
    return (
        f"at {BAND:.0f} Hz {curves.names[k]} reads {gain:.3g} times as much per N as at {curves.frequency[0]:g} Hz, "
        f"{abs(phase):.0f} degrees {'behind' if phase < 0 else 'ahead of'} the force; {first}"
    )


def lines(motion: FlatRow) -> list[Line]:
    """Return the lines of a motion; those of a force or of a contact only where there is one."""
    free, slowest = motion["stiffness_N_per_mm"] is None, f"{motion['lowest_Hz']:g} Hz"
    unit, per_mm = _readings_per("mm", motion)
    _, per_N = _readings_per("N", motion)
    under_force = [
        (f"readings per N at {slowest}", _listed(per_N, f"{unit}/N")),
        ("readings per mm are 3 dB lower at", _reached(motion, "bandwidth_per_mm_Hz", per_mm)),
        ("readings per N are 3 dB lower at", _reached(motion, "bandwidth_per_N_Hz", per_mm)),
        (f"readings per N are {100 * ACCURATE:g} % off at", _reached(motion, "accurate_per_N_Hz", per_mm)),
    ]
    if motion["lowest_Hz"] <= BAND <= motion["highest_Hz"]:
        under_force += [
            (f"readings per N at {BAND:g} Hz over {slowest}", _listed(motion["relative_reading_at_600"])),
            (f"phase to the force at {BAND:g} Hz", _listed(motion["phase_at_600_deg"], "°")),
        ]
    under_force.append((f"stiffness at {slowest}", _with_unit(motion["stiffness_N_per_mm"], "N/mm")))
    shear = _with_unit(motion["shear_mm"], "mm")
    if motion["shear_y_mm"]:
        shear += f" along x, {_with_unit(motion['shear_y_mm'], 'mm')} along y"
    at_rest = [
        ("press at rest", _with_unit(motion["depth_mm"], "mm")),
        ("shear at rest", shear),
        ("force at rest (x, y, z)", _listed(motion["force_N"], "N")),
    ]
    driven = "base" if free else "plate"
    return [
        ("in short", motion["message"]),
        *([] if free else at_rest),
        ("frequencies", f"{motion['lowest_Hz']:g} to {motion['highest_Hz']:g} Hz"),
        ("natural frequencies, undamped", _listed(motion["undamped_Hz"], "Hz")),
        (f"resonances, {driven} of fixed amplitude", _resonances(motion, "mm")),
        *([] if free else [("resonances, force of fixed amplitude", _resonances(motion, "N"))]),
        ("elements", ", ".join(motion["element"])),
        (f"readings per mm at {slowest}", _listed(per_mm, f"{unit}/mm")),
        *([] if free else under_force),
        *([] if free else _amplitudes(motion)),
        *_errors(motion),
    ]


def _readings_per(what: str, motion: FlatRow) -> tuple[str, list[float | None]]:
    """Return unit and values of the readings per mm or per N."""
    (key,) = [key for key in motion if key.startswith("reading_") and key.endswith(f"_per_{what}")]
    return key.split("_")[1], motion[key]


def _reached(motion: FlatRow, key: str, readings: Sequence[float | None]) -> str:
    """Return frequencies, one for each element; a dash for one that reads nothing."""
    pairs = zip(motion[key], readings, strict=True)
    beyond = f"above {motion['highest_Hz']:g}"
    texts = ["-" if seen is None else beyond if value is None else _number(value) for value, seen in pairs]
    return f"{', '.join(texts)} Hz"


def _resonances(motion: FlatRow, per: str) -> str:
    pairs = zip(motion[f"resonance_per_{per}_Hz"], motion[f"resonance_per_{per}_Q"], strict=True)
    each = [f"{_number(f)} Hz" + ("" if Q is None else f" (Q = {Q:.3g})") for f, Q in pairs]
    return ", ".join(each) or "none in the band"


def _amplitudes(motion: FlatRow) -> list[Line]:
    """Return the lines of the amplitudes up to which contact is kept, where they are known."""
    names = {"kept": "opens a quarter of the contact", "lift": "takes the whole normal force"}
    return [
        (
            f"amplitude that {what}",
            f"{_with_unit(value, 'mm')}, the least, at {_with_unit(motion[f'{name}_amplitude_Hz'], 'Hz')}",
        )
        for name, what in names.items()
        if (value := motion[f"{name}_amplitude_mm"]) is not None
    ]


def _errors(motion: FlatRow) -> list[Line]:
    """Return the lines of the numerical errors."""
    names = {"": "shift" if motion["stiffness_N_per_mm"] is None else "force", "reading_": "readings per N"}
    estimates = [
        (what, motion[f"{name}error_estimate"], motion[f"largest_{name}error_estimate"])
        for name, what in names.items()
    ]
    return [
        *(
            (f"estimated error of the {what}", f"median {100 * median:.2g} %, largest {100 * largest:.2g} %")
            for what, median, largest in estimates
            if median is not None and largest is not None
        ),
        ("reduced basis", f"{motion['factorisations']} factorisations, relative error {motion['reduced_error']:.2g}"),
    ]


def mesh_warnings(motion: FlatRow) -> list[str]:
    """Return a sentence if the mesh is too coarse for the state at rest, or the difference is not known."""
    remedy = "take a finer --accuracy or a smaller load"
    if motion["mesh_difference"] is None:
        return [f"the state is not reached on a coarser mesh, so the error of the mesh is not known: {remedy}"]
    if motion["mesh_difference"] <= ROUGH:
        return []
    return [
        (
            f"along {motion['motion']} the results differ by {100 * motion['mesh_difference']:.2g} % from those on a "
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
