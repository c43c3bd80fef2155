"""The vibration of a sensor under one motion of the plate, in numbers and a sentence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from geometry.loads import Load
from studies.output import records
from studies.output.records import FlatRow
from studies.simulation import resonance_peaks, vibration_estimates
from studies.simulation.modal_report import BAND
from studies.simulation.resonance_peaks import Peak
from studies.simulation.response_curves import At, Complex, Curves, mesh_difference

if TYPE_CHECKING:
    from fem.analyses.vibration import VibratingSensor


def _per(unit: str) -> Callable[[tuple[str, list[float | None]]], FlatRow]:
    """Return the function that names the column of readings over a unit by the unit of the readings."""
    return lambda readings: {f"reading_{readings[0]}_per_{unit}": readings[1]}


@dataclass(frozen=True, slots=True)
class MotionReport:
    """The vibration under one motion of the plate; about the free sensor the base is shaken, and there is no force.

    Lists over elements have the order of `element`. Values that lie outside the band, or do not exist, are None.

    Attributes
    ----------
    status, message : of the state at rest; the message also says what the vibration shows.
    motion : "z" or "x".
    force_N : (x, y, z) on the tip at rest.
    stiffness_N_per_mm : force along the motion over its amplitude, at the lowest frequency.
    undamped_Hz : lowest natural frequencies about this state, glued to a plate that does not move, without damping
        and with the long-term modulus; under a shear those of both motions.
    resonance_per_mm_Hz, resonance_per_mm_Q : resonances of the magnet's motion under a plate with a fixed amplitude.
    resonance_per_N_Hz, resonance_per_N_Q : the same under a force with a fixed amplitude on a plate without mass.
    reading_per_mm, reading_per_N : unit of the readings, and readings at the lowest frequency over motion and force.
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

    status: str
    message: str
    motion: str
    depth_mm: float
    shear_mm: float
    shear_y_mm: float
    force_N: list[float]
    lowest_Hz: float
    highest_Hz: float
    stiffness_N_per_mm: float | None
    undamped_Hz: list[float]
    resonance_per_mm_Hz: list[float]
    resonance_per_mm_Q: list[float | None]
    resonance_per_N_Hz: list[float]
    resonance_per_N_Q: list[float | None]
    element: list[str]
    reading_per_mm: tuple[str, list[float | None]] = field(metadata={"columns": _per("mm")})
    reading_per_N: tuple[str, list[float | None]] = field(metadata={"columns": _per("N")})
    bandwidth_per_mm_Hz: list[float | None]
    bandwidth_per_N_Hz: list[float | None]
    accurate_per_N_Hz: list[float | None]
    relative_reading_at_600: list[float | None]
    phase_at_600_deg: list[float | None]
    kept_amplitude_mm: float | None
    kept_amplitude_Hz: float | None
    lift_amplitude_mm: float | None
    lift_amplitude_Hz: float | None
    mesh_difference: float | None
    largest_mesh_difference: float | None
    error_estimate: float | None
    largest_error_estimate: float | None
    reading_error_estimate: float | None
    largest_reading_error_estimate: float | None
    factorisations: int
    reduced_error: float

    def row(self) -> FlatRow:
        """Return the flat row for JSON and for the terminal."""
        return records.flat(self)


def report_motion(sensor: VibratingSensor, at: At, curves: Curves, load: Load, coarse: Curves | None) -> MotionReport:
    """Return the report of one motion.

    Parameters
    ----------
    at : curves of the sensor at any frequencies.
    coarse : the same curves on a coarser mesh, or None.
    """
    motion, free, damped = curves.motion, curves.force is None, bool(sensor.relaxation.times)
    stiffness = sensor.static_stiffness().get(motion)
    low, high = float(curves.frequency[0]), float(curves.frequency[-1])

    def gain(value: Callable[[Curves], Complex]) -> resonance_peaks.Gain:
        return lambda f: np.abs(value(at(f)[motion]))

    by_mm = resonance_peaks.peaks(gain(lambda c: c.along), low, high)
    by_N = [] if free else resonance_peaks.peaks(gain(lambda c: c.along / _known(c.force)), low, high)
    elements = [
        _read_element(k, gain, low, high) if k in curves.readers and not free else _Element()
        for k in range(len(curves.names))
    ]
    at_band = _at_band(at, curves) if low <= BAND <= high and not free else {}
    kept = _least(curves.kept_amplitude, curves.frequency)
    lift = _least(_lift(sensor.state.response.force[2], curves), curves.frequency)
    differences = None if coarse is None else mesh_difference(curves, coarse)
    errors, reading_errors = vibration_estimates.columns(curves, coarse, sensor.scene).values()
    return MotionReport(
        status=sensor.state.status,
        message="; ".join(
            filter(
                None,
                [sensor.state.message, _message(curves, by_N or by_mm, at_band, damped=damped, stiffness=stiffness)],
            )
        ),
        motion=motion,
        depth_mm=load.depth,
        shear_mm=load.shear_x,
        shear_y_mm=load.shear_y,
        force_N=list(sensor.state.response.force),
        lowest_Hz=low,
        highest_Hz=high,
        stiffness_N_per_mm=None if curves.force is None else float(abs(curves.force[0])),
        undamped_Hz=[f for name, fs in sensor.undamped().items() if motion in name.split(" and ") for f in fs],
        resonance_per_mm_Hz=[peak.frequency for peak in by_mm],
        resonance_per_mm_Q=[peak.Q if damped else None for peak in by_mm],
        resonance_per_N_Hz=[peak.frequency for peak in by_N],
        resonance_per_N_Q=[peak.Q if damped else None for peak in by_N],
        element=list(curves.names),
        reading_per_mm=(curves.units[0], _slow(curves.per_mm, curves.readers)),
        reading_per_N=(curves.units[0], _slow(curves.per_N, curves.readers)),
        bandwidth_per_mm_Hz=[element.bandwidth_per_mm for element in elements],
        bandwidth_per_N_Hz=[element.bandwidth_per_N for element in elements],
        accurate_per_N_Hz=[element.accurate_per_N for element in elements],
        relative_reading_at_600=[at_band.get(k, (None, None))[0] for k in range(len(elements))],
        phase_at_600_deg=[at_band.get(k, (None, None))[1] for k in range(len(elements))],
        kept_amplitude_mm=kept[0],
        kept_amplitude_Hz=kept[1],
        lift_amplitude_mm=lift[0],
        lift_amplitude_Hz=lift[1],
        mesh_difference=_median(differences),
        largest_mesh_difference=_largest(differences),
        error_estimate=_median(errors),
        largest_error_estimate=_largest(errors),
        reading_error_estimate=_median(reading_errors),
        largest_reading_error_estimate=_largest(reading_errors),
        factorisations=sensor.factorisations,
        reduced_error=sensor.error,
    )


@dataclass(frozen=True, slots=True)
class _Element:
    """Bandwidths of one element's readings, Hz; None where they exceed the band or the element reads nothing."""

    bandwidth_per_mm: float | None = None
    bandwidth_per_N: float | None = None
    accurate_per_N: float | None = None


def _read_element(
    k: int, gain: Callable[[Callable[[Curves], Complex]], resonance_peaks.Gain], low: float, high: float
) -> _Element:
    """Return the bandwidths of element k."""
    per_mm, per_N = gain(lambda c: c.per_mm[:, k]), gain(lambda c: _known(c.per_N)[:, k])
    return _Element(
        resonance_peaks.bandwidth(per_mm, low, high),
        resonance_peaks.bandwidth(per_N, low, high),
        resonance_peaks.flat_to(per_N, resonance_peaks.ACCURATE, low, high),
    )


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


def _median(values: Array | None) -> float | None:
    return None if values is None else float(np.median(values))


def _largest(values: Array | None) -> float | None:
    return None if values is None else float(values.max())


def _least(values: Array | None, frequency: Array) -> tuple[float | None, float | None]:
    """Return the least of values (f,) and its frequency; None without a finite value."""
    if values is None or not np.isfinite(values).any():
        return None, None
    i = int(np.nanargmin(values))
    return float(values[i]), float(frequency[i])


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
