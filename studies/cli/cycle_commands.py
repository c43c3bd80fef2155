"""The verb of loading cycles: cycle."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from geometry.bad_input import OutOfReach
from geometry.design import BadInput, Design
from geometry.loads import Magnet, Waveform
from geometry.messages import Progress
from studies.cli.command_output import report_failures, say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of
from studies.cli.printed_command import command
from studies.inputs.option_groups import ACCURACY, DEPTH, MAGNET, Whole
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console, run_record
from studies.output.records import FlatRow

if TYPE_CHECKING:
    from fem.analyses.timed_path import ViscousLaw
    from studies.simulation.cycle_motion import Motion
    from studies.simulation.cycle_report import Cycles

FLAG = Parameter(negative="")


def cycle(
    source: Source,
    /,
    *,
    depth: Annotated[float, DEPTH] = 1.0,
    speed: float | None = None,
    frequency: float | None = None,
    waveform: Waveform = "triangle",
    cycles: Whole = 3,
    hold: float = 0.0,
    shear: float = 0.0,
    friction: str | None = None,
    second_law: Annotated[bool, FLAG] = False,
    gap: float | None = None,
    magnet: Annotated[Magnet, MAGNET] = "rigid",
    accuracy: Annotated[AccuracyName, ACCURACY] = "standard",
    tolerance: float = 1e-3,
    extrapolate: Annotated[bool, FLAG] = False,
    out: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Load and unload the sensor in time: loop of the force, its gap and area, drift, readings, decoded force.

    The silicone's loss factor or Prony branches are those of the design. The plate leaves skin that recovers too
    slowly, and touches it later in the next cycle.

    Parameters
    ----------
    speed
        Mean speed of the plate, mm/s; give this or --frequency.
    frequency
        Cycles per second, without the holds, Hz.
    waveform
        Motion of the plate: triangle (constant speed) or sine.
    cycles
        Number of cycles.
    hold
        Rest of the plate at each end of the stroke, s.
    shear
        After the press, shear the tip along x between plus and minus this, mm; the depth stays.
    friction
        none, stick (during a shear the contact area sticks to the plate), or a Coulomb coefficient, from first
        touch on; default: none for a press, stick for a shear.
    second_law
        Also follow the motion by the law for large rates (Reese and Govindjee), and print the difference.
    gap
        Find the constant loss factor with which the last loop has this gap at mid-stroke, percent of full scale (the
        paper measured less than 10).
    tolerance
        Permitted error of the force from the time steps, over the largest force; at least 1e-7.
    extrapolate
        Allow frequencies and holds for which the silicone's branches do not speak, and mark the results.
    out
        Folder for cycle.csv, loops.csv and cycle.png.
    """
    command_line = command(cycle, locals())
    design = design_of(source, sets, magnet)
    from fem.analyses.timed_path import LEAST_TOLERANCE
    from geometry.loads import check_load
    from geometry.relaxation import check_range
    from studies.simulation import cycle_findings
    from studies.simulation import cycle_report as study
    from studies.simulation.cycle_motion import Motion, frequency_of
    from studies.simulation.load_cases import friction_of

    stroke = abs(2 * shear) or depth
    contact = friction_of(friction, "stick" if shear else "none")
    motion = Motion(depth, shear, contact, frequency_of(speed, frequency, stroke), waveform, cycles, hold)
    if not LEAST_TOLERANCE <= tolerance < 1:
        raise BadInput(f"--tolerance must be at least {LEAST_TOLERANCE:g} and below 1; got {tolerance:g}")
    if gap is not None:
        study.check_gap(design, gap)
    # a load that is impossible comes first: its stroke decides the frequency
    check_load(design, motion.largest, magnet)
    say_if_without_magnet(design)
    holds = [hold] if hold else []
    warnings = check_range(design, times=holds, frequencies=[motion.frequency], beyond=extrapolate)
    atomic_files.check_apart(atomic_files.inside(out, (*study.FILES, run_record.NAME)), [source])
    laws: tuple[ViscousLaw, ...] = ("prony", "finite") if second_law else ("prony",)
    results: list[Cycles] = []
    try:
        with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
            progress(0.0, "the lowest natural frequency")
            lowest = cycle_findings.lowest_frequency(design, magnet)
            warnings += cycle_findings.inertia_warnings(motion, lowest)
            progress(0.0, "the curve of slow loading")
            static = study.static_curve(design, motion, accuracy, magnet)
            for law in laws:
                results.append(study.run(design, motion, law, static, accuracy, magnet, tolerance, progress))
            answer = _search(design, motion, gap, static, accuracy, magnet, tolerance, progress)
            if folder is not None:
                study.write(folder, motion, results)
                run_record.write(folder, command_line, dataclasses.asdict(design))
    except KeyboardInterrupt as stop:
        # a run of the search for a gap has another loss factor: its loops are not those of the design
        if isinstance(stop, study.Interrupted) and len(results) < len(laws):
            results.append(stop.cycles)
        raise KeyboardInterrupt(_report_complete(results, motion, as_json=as_json, wide=wide)) from None
    warnings += [text for one in results for text in cycle_findings.doubts(static, one)]
    notes = cycle_findings.notes(design, motion, static, results[0], lowest)
    if second_law and results[0].loops and results[1].loops:
        notes.append(cycle_findings.difference(results[0], results[1]))
    if as_json:
        record: FlatRow = results[0].row() | answer
        if second_law:
            record["second_law"] = results[1].row()
        shared = {"frequency_Hz": motion.frequency, "warnings": warnings, "notes": notes}
        console.report([record | shared], as_json=True)
    else:
        _report_loops(results, wide=wide)
        for note in [*cycle_findings.findings(results[0]), *([answer["sentence"]] if answer else []), *notes]:
            console.note(f"{note}.")
    for warning in warnings:
        console.warn(warning)
    return report_failures([*(one.row() for one in results), *([answer] if answer else [])])


def _report_loops(results: Sequence[Cycles], *, wide: bool) -> None:
    """Print a table of the loops by each law."""
    for one in results:
        title = "Loops, linear overstresses" if one.law == "prony" else "Loops, law for large rates"
        console.report([row.row() for row in one.loops], as_json=False, title=title, wide=wide)


def _report_complete(results: Sequence[Cycles], motion: Motion, *, as_json: bool, wide: bool) -> str:
    """Print the loops of the cycles that were complete before Ctrl-C; return their number in words."""
    complete = [one for one in results if one.loops]
    if as_json:
        console.report(
            [{"law": one.law, "loops": [row.row() for row in one.loops]} for one in complete], as_json=True
        )
    else:
        _report_loops(complete, wide=wide)
    reached = len(results[-1].loops) if results else 0
    return f"{reached} of {motion.cycles} cycles are complete, and no file is written"


def _search(
    design: Design,
    motion: Motion,
    gap: float | None,
    static: object,
    accuracy: str,
    magnet: Magnet,
    tolerance: float,
    progress: Progress,
) -> FlatRow:
    """Return the loss factor with a gap, its loop and a sentence; nothing if no gap is wanted."""
    from studies.simulation import cycle_report as study

    if gap is None:
        return {}
    assert isinstance(static, study.Static)
    try:
        factor, row = study.loss_factor_of_gap(design, motion, gap, static, accuracy, magnet, tolerance, progress)
    except OutOfReach as error:
        return {"status": "failed", "message": str(error), "sentence": str(error)}
    return {
        "gap_percent": row.gap_percent,
        "loss_factor_of_gap": factor,
        "sentence": (
            f"a gap of {gap:g} % of full scale in cycle {row.cycle} belongs to a constant loss factor of {factor:.3f}"
        ),
    }
