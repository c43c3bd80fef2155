"""What `magtip response` and `magtip modes` compute: steady vibrations of a sensor, and its natural frequencies.

Beside the finite elements stand oscillators, which `rungs` describes: what one mass on one spring says of the shift
per N.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from analytic.oscillator import moving_mass, natural_frequency, receptance, spring_mass
from fem.scene import MOST_MODES, Scene
from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load, check_load
from geometry.messages import Progress
from geometry.relaxation import Relaxation, check_range, relaxation_notes
from studies.inputs.option_groups import Elements, Vibration
from studies.inputs.study_input import load_of
from studies.mechanics import resonance_peaks
from studies.mechanics import store as stores
from studies.mechanics.path_solver import frequency_unit, place
from studies.mechanics.resonance_peaks import ACCURATE, BAND, Gain, bandwidth, flat_to, peaks
from studies.mechanics.store import Store
from studies.mechanics.stored_answers import asked, vibrating
from studies.output import page_templates
from studies.output.figures import save, table_of
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, Writer, failure_of
from studies.simulation import response_curves, time_figures
from studies.simulation.response_curves import At, Complex, Curves

if TYPE_CHECKING:
    from fem.analyses.vibration import VibratingSensor

FILES = ("response.csv", "ladder.csv", "response_z.png", "response_x.png")
FEWEST, MOST = 2, 10_000
"""Fewest and most frequencies of a table."""
ROUGH = 0.05
"""Relative difference to a coarser mesh, median of all frequencies, beyond which the mesh is too coarse."""
Response = Callable[[Array], Complex]
"""Complex amplitude at frequencies (f,), Hz."""
Models = dict[str, tuple[float, Response]]
"""Natural frequency, Hz, and response of oscillators by their names."""
sentences = partial(page_templates.sentences, Path(__file__).with_name("templates") / "vibration.j2")


def study(design: Design, options: Vibration) -> Callable[[Progress], Result]:
    """Return the study of `magtip response` after a check of its options."""
    band, has_plate = read_band(options.frequencies), "grip" not in options.load
    depth = options.depth if options.depth is not None else 1.0 if has_plate else 0.0
    if not FEWEST <= options.count <= MOST:
        raise BadInput(f"--count must be between {FEWEST} and {MOST}; got {options.count}")
    if not has_plate and "friction" in options.load:
        raise BadInput("--friction has no meaning with --grip, which has no plate: leave --friction out")
    load = load_of({"depth": depth, "friction": "stick" if has_plate else "none", **options.load})
    if has_plate and not depth and load.shear:
        raise BadInput(f"a shear needs a depth above 0 mm; got --depth 0 --shear {load.shear_x or load.shear_y:g}")
    if has_plate and load.shear and load.friction in ("none", 0.0):
        raise BadInput("a shear needs a plate that sticks: leave out --friction none")
    warnings = check_range(design, frequencies=band, beyond=options.extrapolate)
    if has_plate and not depth:
        # the free sensor touches no plate, whose friction and tilt would count
        load = replace(load, friction="none", plate_tilt=0.0)
    check_load(design, load, options.elements.magnet)
    return partial(run, design, load, band, options.count, options.elements, warnings)


def read_band(text: str) -> tuple[float, float]:
    """Return the lowest and the highest frequency of a text LOW:HIGH, Hz.

    >>> read_band("1:1000")
    (1.0, 1000.0)
    """
    parts = text.split(":")
    try:
        low, high = (float(part) for part in parts)
    except ValueError:
        raise BadInput(f"--frequencies must be LOW:HIGH in Hz, such as 1:1000; got {text!r}") from None
    if not 0 < low < high < math.inf:
        raise BadInput(f"--frequencies must rise from above 0 Hz, such as 1:1000; got {text}")
    return low, high


def run(
    design: Design,
    load: Load,
    band: tuple[float, float],
    count: int,
    elements: Elements,
    warnings: Sequence[str],
    progress: Progress,
) -> Result:
    """Compute the vibration about a state; the status of a state that is not reached or not stable is failed.

    The reduced systems from which all frequencies follow come from the store, and are kept there.

    load : press and shear; depth 0 for the free sensor, whose base is shaken.
    count : number of frequencies in the band, Hz, evenly log-spaced; the table has the resonances too.
    warnings : those of the options, which the result repeats.
    """
    try:
        with stores.opened(elements.store) as states:
            motions, tables, pictures, at_rest = _solve(design, load, band, count, elements, states, progress)
            notes = _notes(design, load, at_rest, elements, states)
    except SolveFailed as error:
        record = {"status": "failed", "message": str(error), "depth_mm": load.depth, "shear_mm": load.shear_x}
        return Result(title="Vibration", records=[record], failures=failure_of([record]))
    warned = [*warnings, *(text for motion in motions for text in mesh_warnings(motion))]
    moved = "grip" if load.grip is not None else "plate" if load.depth else "base"
    ways = {"z": "z", "x": "x, the direction of the shear" if load.shear_y else "x"}
    shown: list[Block] = [
        Table(title=f"The {moved} moves along {ways[motion['motion']]}", rows=[lines(motion)]) for motion in motions
    ]
    if "ladder" in tables:
        title = f"Shift per N: relative to that at {band[0]:g} Hz, and accurate within 5 % of it"
        shown.append(Table(title=title, rows=tables["ladder"]))
    return Result(
        title="Vibration",
        records=[motion | {"warnings": warned, "notes": notes} for motion in motions],
        shown=[*shown, *(f"{note}." for note in notes)],
        tables=tables,
        digits=9,
        files=pictures,
        warnings=warned,
        failures=failure_of(motions),
        design=asdict(design),
    )


def _solve(
    design: Design,
    load: Load,
    band: tuple[float, float],
    count: int,
    elements: Elements,
    store: Store,
    progress: Progress,
) -> tuple[list[FlatRow], dict[str, list[FlatRow]], dict[str, Writer], Design]:
    """Return motions, tables, pictures and the design with the modulus at rest; the matrices are free thereafter."""
    from fem.analyses.vibration import check_vibration

    level, magnet = elements.level, elements.magnet
    check_load(design, load, magnet)
    check_vibration(design, load, band, level)
    frequencies = np.geomspace(*band, count)
    # geomspace rounds its ends
    frequencies[[0, -1]] = band
    progress(0.0, "the state and its vibrations")
    sensor = vibrating(design, load, band, level, magnet, store, progress)
    progress(0.7, "resonances")
    at = response_curves.evaluator(design, sensor)
    coarse = {} if sensor.coarser is None else response_curves.evaluator(design, sensor.coarser)(frequencies)
    curves = at(frequencies)
    motions = [report_motion(sensor, at, one, load, coarse.get(one.motion)) for one in curves.values()]
    ladder: list[FlatRow] = []
    models: dict[str, Models] = {}
    for name, stiffness in sensor.static_stiffness().items():
        if stiffness > 0:  # the sensor is stable under a force too
            models[name] = oscillators(design, name, stiffness, sensor.relaxation)
            ladder += rungs(name, models[name], partial(_compliance, at, name), band)
    rows: list[FlatRow] = []
    pictures: dict[str, Writer] = {}
    for name, motion in zip(curves, motions, strict=True):
        tops = [*motion["resonance_per_mm_Hz"], *motion["resonance_per_N_Hz"]]
        table = at(np.union1d(frequencies, tops))[name]
        rows += response_curves.rows(table, coarse.get(name), sensor.scene)
        tops += [rung["peak_Hz"] for rung in ladder if rung["motion"] == name and rung["peak_Hz"] is not None]
        drawn = at(resonance_peaks.around(tops, table.frequency))[name]
        pictures[f"response_{name}.png"] = partial(
            _draw, curves=drawn, scene=sensor.scene, models=models.get(name, {})
        )
    return motions, {"response": rows} | ({"ladder": ladder} if ladder else {}), pictures, sensor.scene.design


def _draw(path: Path, curves: Curves, scene: Scene, models: Models) -> None:
    drawn = time_figures.response(table_of(response_curves.rows(curves, None, scene)))
    if curves.force is not None and models:
        responses = {name: response(curves.frequency) for name, (_, response) in models.items()}
        gains = {"finite elements": np.abs(curves.compliance)}
        gains |= {name: np.abs(response) for name, response in responses.items()}
        undamped = [name for name, response in responses.items() if not np.iscomplex(response).any()]
        drawn.append(time_figures.oscillators(curves.frequency, gains, undamped))
    save(path, drawn)


def _compliance(at: At, motion: str, f: Array) -> Complex:
    return at(f)[motion].compliance


def _notes(design: Design, load: Load, at_rest: Design, elements: Elements, store: Store) -> list[str]:
    free = Scene(at_rest, (Load(),), elements.level, elements.magnet)
    found = asked(place(free, "modes"), store)
    if not found.values:
        raise SolveFailed(found.message)
    unit = frequency_unit(at_rest.D, at_rest.E_now, at_rest.density)
    first = _first([unit * one for one in found.values["frequency"]], found.values["shape"])
    silicone, whole = spring_mass(at_rest)
    return sentences(
        "notes",
        relaxation_notes=relaxation_notes(design),
        load=load,
        natural=" and ".join(f"{first[shape]:.0f} Hz ({shape})" for shape in ("bending", "axial") if shape in first),
        silicone=silicone,
        whole=whole,
    )


# The record of a motion


def report_motion(sensor: VibratingSensor, at: At, curves: Curves, load: Load, coarse: Curves | None) -> FlatRow:
    """Return one motion, whose keys docs/verbs/response.md describes; a value that does not exist is None.

    About the free sensor the base is shaken, and there is no force. Lists over elements have the order of `element`.
    """
    low, high = float(curves.frequency[0]), float(curves.frequency[-1])
    force, scene = sensor.state.response.force, sensor.scene
    numbers = _gains(at, curves, low, high, damped=bool(sensor.relaxation.times))
    stiffness = sensor.static_stiffness().get(curves.motion)
    message = _message(curves, numbers, damped=bool(sensor.relaxation.times), stiffness=stiffness)
    lift = None if curves.normal_force is None else force[2] / curves.normal_force
    errors = {"mesh_difference": None if coarse is None else response_curves.mesh_difference(curves, coarse)}
    errors |= response_curves.error_columns(curves, coarse, scene)
    return {
        "status": sensor.state.status,
        "message": "; ".join(filter(None, [sensor.state.message, message])),
        "motion": curves.motion,
        "depth_mm": load.depth,
        "shear_mm": load.shear_x,
        "shear_y_mm": load.shear_y,
        "force_N": list(force),
        "lowest_Hz": low,
        "highest_Hz": high,
        "stiffness_N_per_mm": None if curves.force is None else float(abs(curves.force[0])),
        "undamped_Hz": [
            f for name, fs in sensor.undamped().items() if curves.motion in name.split(" and ") for f in fs
        ],
        **numbers,
        **_least("kept_amplitude", curves.kept_amplitude, curves.frequency),
        **_least("lift_amplitude", lift, curves.frequency),
        # they depend on the pressures of single points, for whose errors there is no evidence
        **dict.fromkeys(("kept_amplitude_error_estimate", "lift_amplitude_error_estimate")),
        **{key: value for name, each in errors.items() for key, value in _median_and_largest(name, each).items()},
        "factorisations": sensor.factorisations,
        "reduced_error": sensor.error,
    }


def _gains(at: At, curves: Curves, low: float, high: float, *, damped: bool) -> FlatRow:
    motion, free, unit = curves.motion, curves.force is None, curves.units[0]

    def by_element(value: Callable[[int], float | None], *, known: bool = True) -> list[float | None]:
        return [value(k) if known and k in curves.readers else None for k in range(len(curves.names))]

    def of_gain(value: Callable[[Gain], float | None], per: str) -> list[float | None]:
        # about the free sensor there is no force, and no bandwidth either
        return by_element(lambda k: value(lambda f: np.abs(getattr(at(f)[motion], per)[:, k])), known=not free)

    per_mm, per_N = curves.per_mm[0], None if curves.per_N is None else curves.per_N[0]
    by_mm = peaks(lambda f: np.abs(at(f)[motion].along), low, high)
    by_N = [] if free else peaks(lambda f: np.abs(_compliance(at, motion, f)), low, high)
    slow = fast = np.zeros(len(curves.names), dtype=complex)
    if in_band := low <= BAND <= high and not free:
        slow, fast = at(np.array([low, BAND]))[motion].per_N  # type: ignore[misc]
    # the reading may be opposite to the force; only its change counts
    phase = np.degrees(np.angle(np.where(slow.real > 0, 1.0, -1.0) * fast))
    return {
        "resonance_per_mm_Hz": [peak.frequency for peak in by_mm],
        "resonance_per_mm_Q": [peak.Q if damped else None for peak in by_mm],
        "resonance_per_N_Hz": [peak.frequency for peak in by_N],
        "resonance_per_N_Q": [peak.Q if damped else None for peak in by_N],
        "element": list(curves.names),
        f"reading_{unit}_per_mm": by_element(lambda k: float(abs(per_mm[k]))),
        f"reading_{unit}_per_N": [] if per_N is None else by_element(lambda k: float(abs(per_N[k]))),
        "bandwidth_per_mm_Hz": of_gain(lambda gain: bandwidth(gain, low, high), "per_mm"),
        "bandwidth_per_N_Hz": of_gain(lambda gain: bandwidth(gain, low, high), "per_N"),
        "accurate_per_N_Hz": of_gain(lambda gain: flat_to(gain, ACCURATE, low, high), "per_N"),
        "relative_reading_at_600": by_element(lambda k: float(abs(fast[k] / slow[k])), known=in_band),
        "phase_at_600_deg": by_element(lambda k: float(phase[k]), known=in_band),
    }


def _median_and_largest(name: str, values: Array | None) -> FlatRow:
    median, largest = (None, None) if values is None else (float(np.median(values)), float(values.max()))
    return {name: median, f"largest_{name}": largest}


def _least(name: str, values: Array | None, frequency: Array) -> FlatRow:
    if values is None or not np.isfinite(values).any():
        return {f"{name}_mm": None, f"{name}_Hz": None}
    i = int(np.nanargmin(values))
    return {f"{name}_mm": float(values[i]), f"{name}_Hz": float(frequency[i])}


def _message(curves: Curves, numbers: FlatRow, *, damped: bool, stiffness: float | None) -> str:
    per = "per_N" if numbers["resonance_per_N_Hz"] else "per_mm"
    first = curves.readers[0] if curves.readers else 0
    gain, phase = numbers["relative_reading_at_600"][first], numbers["phase_at_600_deg"][first]
    (text,) = sentences(
        "message",
        motion=curves.motion,
        free=curves.force is None,
        stiffness=stiffness,
        damped=damped,
        resonances=list(zip(numbers[f"resonance_{per}_Hz"], numbers[f"resonance_{per}_Q"], strict=True)),
        at_band=None if gain is None else (gain, phase),
        element=curves.names[first],
        lowest=curves.frequency[0],
        band=BAND,
    )
    return text


def lines(motion: FlatRow) -> dict[str, str]:
    """Return the values by their names of a motion; those of a force or of a contact only where there is one."""
    per_mm, per_N = (
        next(key for key in motion if key.startswith("reading_") and key.endswith(f"_per_{what}"))
        for what in ("mm", "N")
    )
    free = motion["stiffness_N_per_mm"] is None
    named = {"unit": per_mm.split("_")[1], "per_mm": motion[per_mm], "per_N": motion[per_N]}
    items = sentences("lines", m=motion, free=free, band=BAND, accurate=ACCURATE, **named)
    return {name: value for name, _, value in (item.partition(": ") for item in items)}


def mesh_warnings(motion: FlatRow) -> list[str]:
    """Return a sentence if the mesh is too coarse for the state at rest, or the difference is not known."""
    return sentences("mesh", motion=motion["motion"], difference=motion["mesh_difference"], rough=ROUGH)


# Oscillators beside the finite elements


def oscillators(design: Design, motion: str, stiffness: float, relaxation: Relaxation) -> Models:
    """Return natural frequency, Hz, and response of each oscillator by its name, of a stiffness in N/mm above 0."""
    natural = natural_frequency(stiffness, moving_mass(design))
    # where the branches do not speak for this frequency, the loss factor is that at the nearest one for which they do
    low, high = relaxation.speaks_for_frequencies
    nearest = min(max(natural, low), high)
    loss = float(relaxation.loss_factor(2 * np.pi * nearest))
    name = f"mass on a spring, loss factor {loss:.3g}"
    name = name if nearest == natural else f"{name} as at {nearest:.3g} Hz"

    def prony(f: Array) -> Complex:
        return receptance(f, natural, relaxation.complex_modulus(2 * np.pi * f) / relaxation.rest)

    silicone, whole = spring_mass(design)
    columns: Models = {
        "the paper's formula": (silicone, lambda f: receptance(f, silicone)),
        "the paper's formula with the magnet's mass": (whole, lambda f: receptance(f, whole)),
    }
    # the paper's formula is that of a column
    return (columns if motion == "z" else {}) | {
        name: (natural, lambda f: receptance(f, natural, 1 + 1j * loss)),
        "mass on a spring with the silicone's branches": (natural, prony),
    }


def rungs(motion: str, models: Models, finite_elements: Response, band: tuple[float, float]) -> list[FlatRow]:
    """Return the rows of ladder.csv: the oscillators and the finite elements.

    natural_Hz : natural frequency without damping; None for the finite elements, which have many.
    peak_Hz, peak_gain, Q : the first resonance inside the band, over the lowest frequency; None without one.
    relative_at_600 : response at 600 Hz over that at the lowest frequency; None outside the band.
    accurate_to_Hz : frequency up to which it changes by less than ACCURATE; None if it does so in the whole band.
    """
    (low, high), rows = band, []
    for name, (natural, response) in (models | {"finite elements": (None, finite_elements)}).items():
        first = float(abs(response(np.array([low]))[0]))

        def gain(f: Array, response: Response = response, first: float = first) -> Array:
            return np.abs(response(f)) / first

        # an undamped resonance has no height
        damped = bool(np.iscomplex(response(np.array([high]))).any())
        peak = next(iter(peaks(gain, low, high)), None) if damped else None
        rows.append({
            "motion": motion,
            "model": name,
            "natural_Hz": natural,
            "peak_Hz": peak and peak.frequency,
            "peak_gain": peak and peak.gain,
            "Q": peak and peak.Q,
            "relative_at_600": float(gain(np.array([BAND]))[0]) if low <= BAND <= high else None,
            "accurate_to_Hz": flat_to(gain, ACCURATE, low, high),
        })  # fmt: skip
    return rows


# Natural frequencies


def natural_frequencies(design: Design, count: int, depth: float, elements: Elements, progress: Progress) -> Result:
    """Compute the natural frequencies of the free sensor, or of one pressed to a depth, mm.

    The record has lists with a value for each mode, in rising order, which are empty if the status is "failed": the
    press does not reach the depth, or has no natural frequencies there.
    """
    if not 1 <= count <= MOST_MODES:
        raise BadInput(f"--count must be between 1 and {MOST_MODES}; got {count}")
    scene = Scene(design, (Load(depth=depth),), elements.level, elements.magnet)
    progress(0.0, "modes of the pressed sensor" if depth else "modes of the free sensor")
    found: FlatRow = {"frequency_Hz": [], "frequency_error_estimate": [], "shape": []}
    with stores.opened(elements.store) as states:
        answer = asked(place(scene, "modes", options={"count": count}), states, ["estimates"])
    status, message = answer.status, answer.message
    if answer.values:
        unit = frequency_unit(design.D, design.E_now, design.density)
        frequency = [unit * one for one in answer.values["frequency"]]
        lists = (frequency, answer.values["estimates"], answer.values["shape"])
        found = dict(zip(found, lists, strict=True))
        first = _first(frequency, answer.values["shape"])
        # A slow load at f excites an undamped oscillator of frequency f1 by 1 / (1 - (f / f1)^2), which is 1.05 at
        # f = 0.22 f1. Ovalling and torsion leave the magnet where it is, so they do not change the readings.
        slow = {shape: f * (1 - 1 / 1.05) ** 0.5 for shape, f in first.items() if shape in ("bending", "axial")}
        said = sentences(
            "modes",
            inside=[f"{shape} {f:.0f} Hz" for shape, f in first.items() if f < BAND],
            slow=[f"{f:.0f} Hz for {shape} motion" for shape, f in slow.items()],
            highest=max(frequency),
            band=BAND,
        )
        message = "; ".join(filter(None, [message, *said]))
    beam_only, with_magnet = spring_mass(design)
    record = {"status": status, "message": message, "depth_mm": depth, **found}
    record |= {"spring_mass_Hz": beam_only, "spring_mass_with_magnet_Hz": with_magnet}
    return Result(title="Natural frequencies", records=[record], failures=failure_of([record]))


def _first(frequencies: Sequence[float], shapes: Sequence[str]) -> dict[str, float]:
    # later entries of a dict replace earlier ones
    return {shape: f for f, shape in reversed(list(zip(frequencies, shapes, strict=True)))}
