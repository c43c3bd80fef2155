"""What `magtip response` and `magtip modes` compute: steady vibrations of a sensor, and its natural frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from geometry.bad_input import SolveFailed
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress
from geometry.relaxation import relaxation_notes
from studies.mechanics import resonance_peaks
from studies.mechanics.resonance_peaks import BAND
from studies.output.figures import save, table_of
from studies.output.records import FlatRow
from studies.output.result import Block, Lines, Result, Table, Writer, failure_of
from studies.simulation import oscillator_ladder, response_curves, time_figures
from studies.simulation.motion_report import lines, mesh_warnings, report_motion
from studies.simulation.response_curves import At, Curves

if TYPE_CHECKING:
    from fem.accuracy import Accuracy
    from fem.scene import Scene

FILES = ("response.csv", "ladder.csv", "response_z.png", "response_x.png")
"""Files that a folder of results may hold, beside run.json."""


@dataclass(frozen=True, slots=True)
class Vibration:
    """The vibration about a state.

    Attributes
    ----------
    motions : record of each motion.
    rows, ladder : rows of response.csv and ladder.csv.
    pictures : writers by the names of their files.
    at_rest : the design whose modulus is that of the state at rest.
    """

    motions: list[FlatRow]
    rows: list[FlatRow]
    ladder: list[FlatRow]
    pictures: dict[str, Writer]
    at_rest: Design


def run(
    design: Design,
    load: Load,
    band: tuple[float, float],
    count: int,
    magnet: Magnet,
    accuracy: str,
    warnings: Sequence[str],
    progress: Progress,
) -> Result:
    """Compute the vibration about a state; the status of a state that is not reached or not stable is failed.

    Parameters
    ----------
    load : press and shear; depth 0 for the free sensor, whose base is shaken.
    band : lowest and highest frequency, Hz.
    count : number of frequencies, spaced evenly on a logarithmic scale; the table has the resonances too.
    warnings : those of the options, which the result repeats.

    Raises
    ------
    BadInput
        A value is out of range.
    """
    from fem.accuracy import LEVELS

    level = LEVELS[accuracy]
    try:
        found = _solve(design, load, band, count, level, magnet, progress)
        notes = [*_notes(design, load), _free_note(found.at_rest, magnet, level)]
    except SolveFailed as error:
        record = {"status": "failed", "message": str(error), "depth_mm": load.depth, "shear_mm": load.shear_x}
        return Result(title="Vibration", records=[record], failures=failure_of([record]))
    warned = [*warnings, *(text for motion in found.motions for text in mesh_warnings(motion))]
    moved = "grip" if load.grip is not None else "plate" if load.depth else "base"
    ways = {"z": "z", "x": "x, the direction of the shear" if load.shear_y else "x"}
    shown: list[Block] = [
        Lines(f"The {moved} moves along {ways[motion['motion']]}", lines(motion)) for motion in found.motions
    ]
    if found.ladder:
        title = f"Shift per N: relative to that at {band[0]:g} Hz, and accurate within 5 % of it"
        shown.append(Table(title=title, rows=found.ladder))
    return Result(
        title="Vibration",
        records=[motion | {"warnings": warned, "notes": notes} for motion in found.motions],
        shown=[*shown, *(f"{note}." for note in notes)],
        tables={"response": found.rows} | ({"ladder": found.ladder} if found.ladder else {}),
        digits=9,
        files=found.pictures,
        warnings=warned,
        failures=failure_of(found.motions),
        design=asdict(design),
    )


def _solve(
    design: Design,
    load: Load,
    band: tuple[float, float],
    count: int,
    level: Accuracy,
    magnet: Magnet,
    progress: Progress,
) -> Vibration:
    """Compute the vibration; the memory of its matrices is free when this returns."""
    from fem.analyses.vibration import check_vibration, vibrating_sensor

    check_load(design, load, magnet)
    check_vibration(design, load, band, level)
    frequencies = np.geomspace(*band, count)
    # geomspace rounds its ends
    frequencies[[0, -1]] = band
    progress(0.0, "the state and its vibrations on a coarser mesh")
    # the coarser mesh comes first, and is released before the finer one needs its memory
    coarse = _coarse_curves(design, load, band, level, magnet, frequencies)
    progress(0.3, "the state and its vibrations")
    sensor = vibrating_sensor(design, load, band, level, magnet=magnet)
    progress(0.7, "resonances")
    at = response_curves.evaluator(design, sensor)
    curves = at(frequencies)
    motions = [report_motion(sensor, at, one, load, coarse.get(one.motion)) for one in curves.values()]
    ladder: list[FlatRow] = []
    models: dict[str, oscillator_ladder.Models] = {}
    for name, stiffness in sensor.static_stiffness().items():
        if stiffness > 0:  # the sensor is stable under a force too
            models[name] = oscillator_ladder.oscillators(design, name, stiffness, sensor.relaxation)
            ladder += oscillator_ladder.rungs(name, models[name], _per_force(at, name), band)
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
    return Vibration(motions, rows, ladder, pictures, sensor.scene.design)


def _draw(path: Path, curves: Curves, scene: Scene, models: oscillator_ladder.Models) -> None:
    """Write the readings over the frequency, and the magnet's motion beside oscillators where there is a force."""
    drawn = time_figures.response(table_of(response_curves.rows(curves, None, scene)))
    if curves.force is not None and models:
        responses = {name: response(curves.frequency) for name, (_, response) in models.items()}
        gains = {"finite elements": np.abs(curves.along / curves.force)}
        gains |= {name: np.abs(response) for name, response in responses.items()}
        undamped = [name for name, response in responses.items() if not np.iscomplex(response).any()]
        drawn.append(time_figures.oscillators(curves.frequency, gains, undamped))
    save(path, drawn)


def _coarse_curves(
    design: Design, load: Load, band: tuple[float, float], level: Accuracy, magnet: Magnet, frequencies: Array
) -> Mapping[str, Curves]:
    """Return the curves of each motion on a coarser mesh; none if the path stops earlier on it."""
    from fem.accuracy import coarser
    from fem.analyses.vibration import vibrating_sensor

    try:
        sensor = vibrating_sensor(design, load, band, coarser(level), magnet=magnet, check=False)
    except BadInput:
        return {}
    return response_curves.evaluator(design, sensor)(frequencies)


def _per_force(at: At, motion: str) -> oscillator_ladder.Response:
    """Return the magnet's shift along a motion over the force along it, as a function of the frequency."""

    def response(f: Array) -> response_curves.Complex:
        curves = at(f)[motion]
        assert curves.force is not None
        return np.asarray(curves.along / curves.force)

    return response


def _notes(design: Design, load: Load) -> list[str]:
    """Return what the numbers assume."""
    if load.grip is not None:
        contact = "the grip moves along x and holds its skin along it; this skin is free along z"
    elif not load.depth:
        contact = "the sensor is free: its base is shaken, and shift and tilt are those relative to the base"
    elif load.coulomb is not None:
        contact = (
            "contact is frozen: points in touch stay in touch, and all of them stick, those that have slipped too: "
            "in small cycles their traction falls until they stick in both halves of a cycle"
        )
    elif load.friction == "stick":
        contact = "contact is frozen: points in touch stay in touch, and the contact area is glued to the plate"
    else:
        contact = (
            "contact is frozen: points in touch stay in touch; without friction an upright plate that moves along x "
            "transmits nothing (--friction stick glues the contact area)"
        )
    if load.shear_y:
        contact += "; x is the direction of the shear"
    if load.depth:
        contact += (
            "; at its edge the pressure at rest is 0, so that every amplitude opens some of it, in proportion up to "
            "half of its area (the columns kept_amplitude_mm and lift_amplitude_mm have the amplitudes that open a "
            "quarter of it, and that take the whole normal force)"
        )
    plate = "the plate is rigid and has no mass; amplitudes are small" if load.depth else "amplitudes are small"
    return [*relaxation_notes(design), contact, plate]


def _free_note(at_rest: Design, magnet: Magnet, level: Accuracy) -> str:
    """Return the natural frequencies of the free sensor at rest, beside the paper's formula."""
    from fem.analyses.modes import modes, spring_mass

    free = modes(at_rest, magnet, 6, accuracy=level, estimate=False)
    first = {shape: f for f, shape in reversed(list(zip(free.frequency, free.shape, strict=True)))}
    named = " and ".join(f"{first[shape]:.0f} Hz ({shape})" for shape in ("bending", "axial") if shape in first)
    silicone, whole = spring_mass(at_rest)
    return (
        f"without damping and with the long-term modulus the free sensor resonates at {named}; the paper's formula "
        f"(970 Hz in the paper) gives {silicone:.0f} Hz, and {whole:.0f} Hz with the magnet's mass"
    )


# Natural frequencies


def natural_frequencies(
    design: Design, magnet: Magnet, count: int, depth: float, accuracy: str, progress: Progress
) -> Result:
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
