"""The parts `vibration` and `loop`: what a sensor does in time about, or up to, the load of the page.

`vibration` is the steady vibration about the pressed or sheared state at the frequency of the page, in the manner of
`magtip response`: the plate moves along the shear where there is one, else along z; the base of the free sensor is
shaken along x. `loop` is a loading cycle with the
speed of the page, in the manner of `magtip cycle`: first that of a linear spring, then by finite elements.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import relaxation_loops
from fem.accuracy import LEVELS
from fem.analyses.vibration import VibratingSensor, check_vibration, highest_frequency
from fem.results.error_estimates import VibrationQuantity, estimate_vibration
from fem.scene import relaxed
from fem.solve import load_increments
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, Load, Magnet
from geometry.relaxation import range_sentence, relaxation_of
from studies.inputs.option_groups import Elements
from studies.inputs.user_input import AccuracyName
from studies.mechanics import resonance_peaks
from studies.mechanics.cycle_motion import Motion, frequency_of
from studies.mechanics.store import Store
from studies.mechanics.stored_answers import vibrating
from studies.output import page_templates
from studies.simulation import response_curves
from studies.simulation.response_curves import At
from studies.web.explorer_state import ExplorerState, Request
from studies.web.panels import Memory
from studies.web.state_answers import number, stability_key

if TYPE_CHECKING:
    from studies.calibration.sensor_fit import Fit

Data = dict[str, Any]
Rows = list[Data]
LOWEST_ELASTIC = 0.01
"""Lowest frequency of a silicone without branches, Hz: any below the resonances."""
STATIC = 1e-6
"""Frequency over the lowest one at which the vibration is static."""
STEP = 1e-3
"""Relative step in frequency with which a gain is differentiated."""
CYCLES, TOLERANCE = 2, 1e-3
"""Cycles of a loop, the last of which counts: the third differs from it by less than a thousandth. Permitted error of
the force from the time steps."""
LOOP_LEVEL: AccuracyName = "quick"
"""Accuracy of the loop: its gap is a ratio of two forces of one mesh."""


@dataclass(frozen=True, slots=True, eq=False)
class Vibrating:
    """A vibrating sensor with the curves of its readings, here and on a coarser mesh (None if that is not solved)."""

    sensor: VibratingSensor
    at: At
    coarse: At | None
    band: tuple[float, float]


def vibration_panel(request: Request, level: str, memory: Memory) -> Iterator[tuple[str, Data]]:
    """Yield the vibration about a state; its systems stay for other frequencies, those of one state only."""
    state = request.state
    if not state.frequency:
        yield level, refusal("a frequency above 0 Hz gives the vibration about this state")
        return
    key = state.design, state.vibrating_load, state.magnet, level
    try:
        if key not in memory.systems.values:
            memory.systems.values.clear()
        data = vibration(memory.systems.get(key, lambda: prepare(*key, memory.store)), state.frequency)
    except (BadInput, SolveFailed) as error:
        data = refusal(str(error))
    stability = memory.results.values.get(stability_key(state, level), {})
    silicone = rate_sentence(state.design, state.frequency, stability.get("first_mode_hz"))
    yield level, data | {"message": f"{data['message']} {silicone}".strip()}


def loop_panel(request: Request, level: str, memory: Memory) -> Iterator[tuple[str, Data]]:
    """Yield the loop of a linear spring first, and by finite elements at the level of the state."""
    state, made = request.state, request.sensor
    if not state.speed:
        yield level, refusal("a speed above 0 mm/s gives the loop of a loading cycle")
        return
    try:
        motion = motion_of(state)
    except BadInput as error:
        yield level, refusal(str(error))
        return
    key = ("loop", state.design, state.magnet, motion, made is None)
    if key not in memory.results.values:
        yield "linear", linear_loop(state, motion)
    if level == state.level:
        yield level, memory.results.get(key, lambda: loop(state, motion, memory.store, made))


def prepare(design: Design, load: Load, magnet: Magnet, level: str, store: Store) -> Vibrating:
    """Solve for a stable state at rest and its vibrations at all frequencies that branches and mesh carry."""
    accuracy = LEVELS[level]
    relaxation = relaxation_of(design)
    low, high = relaxation.speaks_for_frequencies if relaxation.times else (LOWEST_ELASTIC, math.inf)
    # the sensor is prepared a step farther, for the slope of a gain at the end of the band
    band = low, min(high, highest_frequency(relaxed(design, relaxation), accuracy) / (1 + STEP))
    if not band[0] < band[1]:
        raise BadInput(f"the silicone's branches speak for {low:.3g} to {high:.3g} Hz only, which is no band")
    check_vibration(design, load, band, accuracy)
    prepared = low, band[1] * (1 + STEP)
    sensor = vibrating(design, load, prepared, accuracy, magnet, store)
    coarse = None if sensor.coarser is None else response_curves.evaluator(design, sensor.coarser)
    return Vibrating(sensor, response_curves.evaluator(design, sensor), coarse, band)


def vibration(vibrating: Vibrating, frequency: float) -> Data:
    """Return the part `vibration` at a frequency, Hz: rows of name, unit, value and half width, and a message.

    Gains, phases to the static gain and half widths are those of `magtip response`.
    """
    low, high = vibrating.band
    if not low <= frequency <= high:
        return refusal(
            f"the vibration is known from {low:.3g} to {high:.4g} Hz, for which the silicone's branches speak and "
            f"the mesh is fine enough; the frequency is {frequency:.6g} Hz"
        )
    (load,) = vibrating.sensor.scene.loads
    motion = "x" if load.shears_tip or not load.depth else "z"
    # the static gain first; around the frequency, how much a resonance amplifies an error
    near = frequency * np.array([1 - STEP, 1.0, 1 + STEP])
    one = vibrating.at(np.array([low * STATIC, *near]))[motion]
    other = None if vibrating.coarse is None else vibrating.coarse(one.frequency)[motion]
    static, _, gains, _ = response_curves.rows(one, other, vibrating.sensor.scene)
    columns = {(f"force along {motion}", "N/mm"): ("force_N_per_mm", "force_phase_deg", "error_estimate")}
    for name, unit in [(one.names[k], one.units[k]) for k in one.readers[:1]]:
        columns[f"{name} per N", f"{unit}/N"] = (
            f"{name}_{unit}_per_N",
            f"{name}_per_N_phase_deg",
            "reading_error_estimate",
        )
    if one.force is None:
        columns = {("shift of the magnet", "mm/mm"): ("shift_x_mm_per_mm", "shift_x_phase_deg", "error_estimate")}
    rows: Rows = []
    for (name, unit), (size, phase, estimate) in columns.items():
        gain, turn, error = gains[size], gains[phase] - static[phase], gains[estimate]
        values = {(name, unit): (gain, gain), (f"phase of {name}", "deg"): (turn, math.degrees(1.0))}
        if one.force is not None:  # the static shift of the free sensor is 0
            values[f"{name}, over static", ""] = (gain / static[size],) * 2
        for (row, its_unit), (value, scale) in values.items():
            rows.append(number(row, its_unit, value, None if error is None else error * scale))
    rows += _resonance(vibrating, motion)
    return {"columns": ["finite elements", ""], "rows": rows, "message": _message(vibrating, motion, rows)}


def _resonance(vibrating: Vibrating, motion: str) -> Rows:
    low, high = vibrating.band
    peak, coarse = (
        None if at is None else next(iter(resonance_peaks.peaks(_gain_of(at, motion), low, high)), None)
        for at in (vibrating.at, vibrating.coarse)
    )
    frequency, Q = (None, None) if peak is None else (peak.frequency, peak.Q)
    error = None
    if peak is not None and coarse is not None:
        # the static gain has the error of a compliance, and the square of the frequency goes with a stiffness
        quantity: VibrationQuantity = "shift" if vibrating.sensor.state.load.depth else "base"
        difference = 2 * abs(peak.frequency - coarse.frequency) / peak.frequency
        error = float(
            estimate_vibration(quantity, motion, np.array([difference]), np.ones(1), vibrating.sensor.scene)[0] / 2
        )
    known = {("first resonance", "Hz"): frequency, ("its Q", ""): Q if vibrating.sensor.relaxation.times else None}
    return [
        number(name, unit, value, None if error is None or value is None else error * value)
        for (name, unit), value in known.items()
    ]


def _gain_of(at: At, motion: str) -> Callable[[Array], Array]:
    def gain(f: Array) -> Array:
        one = at(f)[motion]
        return np.asarray(np.abs(one.along if one.force is None else one.along / one.force))

    return gain


def _message(vibrating: Vibrating, motion: str, rows: Rows) -> str:
    none = f" There is no resonance below {vibrating.band[1]:.4g} Hz, where the vibration is known."
    none = none if any(row["name"] == "first resonance" and row["value"] is None for row in rows) else ""
    if not vibrating.sensor.state.load.depth:
        return f"The base of the free sensor is shaken along x; shift is relative to the base.{none}"
    way = "z" if motion == "z" else "the shear"
    contact = "slides" if vibrating.sensor.state.load.friction == "none" else "sticks"
    return (
        f"The plate moves along {way} about this state at rest; contact is frozen and {contact}; "
        "amplitudes are small. "
        f"The resonance is that under a force.{none}"
    )


def refusal(sentence: str) -> Data:
    """Return a part without numbers, and why there are none."""
    return {"columns": ["", ""], "rows": [], "message": f"{page_templates.sentence(sentence)}."}


def rate(design: Design, frequency: float) -> Data | None:
    """Return how the silicone behaves in small vibrations; None at 0 Hz, or where its branches do not speak.

    "storage" is the storage modulus over the one that E is; "gap" that of the loop of a linear spring, a sine, in %
    of full scale (`analytic.relaxation_loops`); inertia and the contact are left out.
    """
    relaxation = relaxation_of(design)
    if not frequency or range_sentence(relaxation, frequencies=[frequency]):
        return None
    modulus = complex(relaxation.complex_modulus(2 * math.pi * frequency))
    return {
        "loss_factor": modulus.imag / modulus.real,
        "storage": modulus.real / (1.0 if design.modulus == "instantaneous" else relaxation.rest),
        "gap": 100 * relaxation_loops.loop(relaxation, frequency, "sine").hysteresis,
    }


def rate_sentence(design: Design, frequency: float, first_mode: float | None) -> str:
    """Return what the silicone does in small vibrations; "" where that is not known."""
    known = rate(design, frequency)
    if known is None:
        return ""
    text = (
        f"At {frequency:g} Hz the loss factor is {known['loss_factor']:.4g}, the silicone is {known['storage']:.4g} "
        f"times as stiff as E, and a linear loop has a gap of {known['gap']:.4g} % of full scale."
    )
    if first_mode and known["loss_factor"]:
        mode, quality = first_mode * math.sqrt(known["storage"]), 1 / known["loss_factor"]
        text += f" With both the first mode is at {mode:.4g} Hz with Q = {quality:.4g}."
    return text


def motion_of(state: ExplorerState) -> Motion:
    """Return the loading cycles at the speed of the page, up to its depth or between both sides of its shear.

    The sensor is a body of revolution, so the direction of the shear does not matter.

    Raises
    ------
    BadInput
        The load makes no cycle, or the branches do not speak for its frequency.
    """
    load = state.load
    if load.plate_tilt:
        raise BadInput("a loading cycle needs an upright plate")
    if not load.depth > 0:
        raise BadInput("a loading cycle needs a depth above 0 mm")
    shear = math.hypot(*load.imposed_shear)
    frequency = frequency_of(state.speed, None, 2 * shear or load.depth)
    motion = Motion(load.depth, shear, load.friction, frequency, cycles=CYCLES)
    if sentence := range_sentence(relaxation_of(state.design), frequencies=[frequency]):
        raise BadInput(f"at this speed a cycle has {frequency:.3g} Hz; {sentence}")
    return motion


def linear_loop(state: ExplorerState, motion: Motion) -> Data:
    """Return the part `loop` of a linear spring of this silicone, in steady cycles."""
    gap = 100 * relaxation_loops.loop(relaxation_of(state.design), motion.frequency, motion.waveform).hysteresis
    text = "That of a linear spring; finite elements follow."
    return _loop_data("linear spring", motion, number("gap at mid-stroke", "%", gap), [], text)


def loop(state: ExplorerState, motion: Motion, store: Store, made: Fit | None = None) -> Data:
    """Return the part `loop` by finite elements; every time step calls the watch of `fem.solve.load_increments`.

    made : calibrated sensor, whose forces these are.
    """
    from studies.mechanics import loading_cycles
    from studies.simulation import cycle_findings

    of_sensor = None
    if made is not None:
        from studies.calibration import calibration_file

        of_sensor = partial(calibration_file.made_states, made)

    static, elements = loading_cycles.Static(made=of_sensor), Elements(magnet=state.magnet, accuracy=LOOP_LEVEL)
    watch = load_increments.report
    cycles = cycle_findings.kept_cycles(
        state.design, motion, static, elements, TOLERANCE, store, lambda share, _: watch(share)
    )
    if cycles.status not in ANSWERED or len(cycles.loops) < CYCLES:
        return refusal(f"the loop is not known: {cycles.message or cycles.status}")
    last = cycles.loops[-1]
    linear = linear_loop(state, motion)["rows"][0]["value"]
    largest = last["largest_N"]
    rows = [
        number("gap of a linear spring", "%", linear),
        number("dissipated", "mJ", last["material_mJ"] + last["friction_mJ"]),
        number("largest force", "N", largest, cycles.time_error * largest),
    ]
    # the gap is the difference of two forces, each with the error of the time steps
    spread = 100 * 2 * cycles.time_error
    text = (
        f"Cycle {CYCLES} of a triangle without inertia, {LOOP_LEVEL} mesh; half widths are those of the time steps."
    )
    text = " ".join(filter(None, [text, f"{cycles.message}." if cycles.message else ""]))
    return _loop_data(
        "finite elements", motion, number("gap at mid-stroke", "%", last["gap_percent"], spread), rows, text
    )


def _loop_data(source: str, motion: Motion, gap: Data, more: Rows, message: str) -> Data:
    rows = [gap, *more, number("cycle lasts", "s", 1 / motion.frequency)]
    return {"columns": [source, ""], "rows": rows, "message": message}
