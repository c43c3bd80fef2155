"""The verb of loading cycles: cycle."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from geometry.design import BadInput
from geometry.loads import Magnet, Waveform
from studies.cli.command_output import say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of, destination
from studies.inputs.option_groups import ACCURACY, DEPTH, MAGNET, Whole
from studies.inputs.user_input import AccuracyName
from studies.output.result import publish

if TYPE_CHECKING:
    from fem.analyses.timed_path import ViscousLaw

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
    from fem.analyses.timed_path import LEAST_TOLERANCE
    from geometry.loads import check_load
    from geometry.relaxation import check_range
    from studies.simulation import cycle_findings, cycle_report
    from studies.simulation.cycle_motion import Motion, frequency_of
    from studies.simulation.load_cases import friction_of

    here = destination(cycle, locals(), cycle_findings.FILES)
    design = design_of(source, sets, magnet)
    stroke = abs(2 * shear) or depth
    contact = friction_of(friction, "stick" if shear else "none")
    motion = Motion(depth, shear, contact, frequency_of(speed, frequency, stroke), waveform, cycles, hold)
    if not LEAST_TOLERANCE <= tolerance < 1:
        raise BadInput(f"--tolerance must be at least {LEAST_TOLERANCE:g} and below 1; got {tolerance:g}")
    if gap is not None:
        cycle_report.check_gap(design, gap)
    # a load that is impossible comes first: its stroke decides the frequency
    check_load(design, motion.largest, magnet)
    say_if_without_magnet(design)
    holds = [hold] if hold else []
    warnings = check_range(design, times=holds, frequencies=[motion.frequency], beyond=extrapolate)
    laws: tuple[ViscousLaw, ...] = ("prony", "finite") if second_law else ("prony",)
    study = partial(cycle_findings.study, design, motion, laws, gap, accuracy, magnet, tolerance, warnings)
    return publish(study, here)
