"""What `magtip response` computes: the steady vibration of a sensor in numbers, curves and sentences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from geometry.arrays import Array
from geometry.design import BadInput, Design
from geometry.loads import Load, Magnet, check_load
from geometry.messages import Progress
from geometry.relaxation import relaxation_notes
from studies.output.csv_tables import write_table
from studies.simulation import oscillator_ladder, resonance_peaks, response_curves, vibration_estimates
from studies.simulation.motion_report import MotionReport, report_motion
from studies.simulation.oscillator_ladder import Rung
from studies.simulation.response_curves import At, Curves

if TYPE_CHECKING:
    from fem.accuracy import Accuracy
    from fem.scene import Scene

FILES = ("response.csv", "ladder.csv", "response_z.png", "response_x.png")
"""Files that a folder of results may hold, beside run.json."""


@dataclass(frozen=True, slots=True)
class Report:
    """The vibration under all motions.

    Attributes
    ----------
    motions : one for each motion.
    ladder : models of one mass on one spring beside the finite elements.
    notes : what the numbers assume, in sentences.
    """

    motions: list[MotionReport]
    ladder: list[Rung]
    notes: list[str]


def run(
    design: Design,
    load: Load,
    band: tuple[float, float],
    count: int,
    magnet: Magnet,
    accuracy: str,
    folder: Path | None,
    progress: Progress,
) -> Report:
    """Compute the vibration about a state; write tables and plots if a folder is given.

    Parameters
    ----------
    load : press and shear; depth 0 for the free sensor, whose base is shaken.
    band : lowest and highest frequency, Hz.
    count : number of frequencies, spaced evenly on a logarithmic scale; the table has the resonances too.

    Raises
    ------
    BadInput
        A value is out of range, or the state is not reached or not stable.
    """
    from fem.accuracy import LEVELS
    from fem.analyses.vibration import check_vibration, vibrating_sensor

    check_load(design, load, magnet)
    level = LEVELS[accuracy]
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
    ladder: list[Rung] = []
    models: dict[str, oscillator_ladder.Models] = {}
    for motion, stiffness in sensor.static_stiffness().items():
        if stiffness > 0:  # the sensor is stable under a force too
            models[motion] = oscillator_ladder.oscillators(design, motion, stiffness, sensor.relaxation)
            ladder += oscillator_ladder.rungs(motion, models[motion], _per_force(at, motion), band)
    at_rest = sensor.scene.design
    tops = {one.motion: [*one.resonance_per_mm_Hz, *one.resonance_per_N_Hz] for one in motions}
    tabled = {name: at(np.union1d(frequencies, tops[name]))[name] for name in curves}
    drawn = {}
    if folder is not None:
        for name in curves:
            peaks = [*tops[name], *(one.peak_Hz for one in ladder if one.motion == name and one.peak_Hz is not None)]
            drawn[name] = at(resonance_peaks.around(peaks, tabled[name].frequency))[name]
    scene = sensor.scene
    del sensor, at  # their memory is free for the pictures
    notes = [*_notes(design, load), _free_note(at_rest, magnet, level)]
    if folder is not None:
        _write(folder, scene, tabled, drawn, coarse, ladder, models)
    return Report(motions, ladder, notes)


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


def _write(
    folder: Path,
    scene: Scene,
    tabled: Mapping[str, Curves],
    drawn: Mapping[str, Curves],
    coarse: Mapping[str, Curves],
    ladder: list[Rung],
    models: Mapping[str, oscillator_ladder.Models],
) -> None:
    """Write the tables and a plot for each motion; a plot has more frequencies than the table."""
    from studies.simulation import bode_plot

    rows = []
    for motion, one in tabled.items():
        other = coarse.get(motion)
        rows += response_curves.rows(one, other, vibration_estimates.columns(one, other, scene))
    write_table(folder / "response.csv", rows, digits=9)
    if ladder:
        write_table(folder / "ladder.csv", [rung.row() for rung in ladder], digits=9)
    for motion, one in drawn.items():
        responses = {name: response(one.frequency) for name, (_, response) in models.get(motion, {}).items()}
        bode_plot.draw(folder / f"response_{motion}.png", one, responses)
