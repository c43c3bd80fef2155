"""The verb of steady vibration: response."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from geometry.bad_input import SolveFailed
from geometry.design import BadInput
from geometry.loads import Load, Magnet
from studies.cli.command_output import report_failures, say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of
from studies.cli.printed_command import command
from studies.inputs.option_groups import ACCURACY, MAGNET, SHEAR, SHEAR_Y, Whole
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console, run_record

FEWEST, MOST = 2, 10_000
"""Fewest and most frequencies of a table."""


def response(
    source: Source,
    /,
    *,
    depth: Annotated[float | None, Parameter(help="Travel of the plate after first touch, mm; default: 1.")] = None,
    shear: Annotated[float, SHEAR] = 0.0,
    frequencies: str = "1:1000",
    count: Whole = 200,
    shear_y: Annotated[float, SHEAR_Y] = 0.0,
    friction: str | None = None,
    plate_tilt: float = 0.0,
    grip: float | None = None,
    magnet: Annotated[Magnet, MAGNET] = "rigid",
    accuracy: Annotated[AccuracyName, ACCURACY] = "standard",
    extrapolate: Annotated[bool, Parameter(negative="")] = False,
    out: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Compute the steady vibration of the pressed and sheared sensor: volts per mm and per N, resonances, bandwidth.

    The plate vibrates along z and along x about a state at rest, and x is the direction of the shear; --depth 0
    shakes the base of the free sensor. The silicone's loss factor or Prony branches are those of the design.

    Parameters
    ----------
    frequencies
        Lowest and highest frequency, LOW:HIGH, Hz.
    count
        Number of frequencies in the table, spaced evenly on a logarithmic scale; resonances are added to them.
    friction
        stick (the default): the contact area is glued to the plate; none: the plate slides, and moves along z only; a
        Coulomb coefficient, from first touch on: the points in touch stick to the plate that vibrates.
    plate_tilt
        Tilt of the plate's normal from z towards x, degrees.
    grip
        In place of the plate, hold the skin down to this depth below the top, mm; it moves along x.
    extrapolate
        Allow frequencies for which the silicone's branches do not speak, and mark the results.
    out
        Folder for response.csv, ladder.csv and the Bode plots.
    """
    command_line = command(response, locals())
    design = design_of(source, sets, magnet)
    from geometry.loads import check_load
    from geometry.relaxation import check_range
    from studies.simulation import motion_lines
    from studies.simulation import vibration_report as study
    from studies.simulation.load_cases import friction_of, plate_tilt_of

    band = read_band(frequencies)
    depth = (1.0 if grip is None else 0.0) if depth is None else depth
    if not FEWEST <= count <= MOST:
        raise BadInput(f"--count must be between {FEWEST} and {MOST}; got {count}")
    moves, contact = bool(shear or shear_y), friction_of(friction, "stick")
    if grip is None and not depth and moves:
        raise BadInput(f"a shear needs a depth above 0 mm; got --depth 0 --shear {shear or shear_y:g}")
    if grip is None and moves and contact in ("none", 0.0):
        raise BadInput("a shear needs a plate that sticks: leave out --friction none")
    warnings = check_range(design, frequencies=band, beyond=extrapolate)
    if grip is not None:
        if friction is not None:
            raise BadInput("--friction has no meaning with --grip, which has no plate: leave --friction out")
        load = Load(depth, shear, shear_y, plate_tilt=plate_tilt_of(plate_tilt), grip=grip)
    else:
        # the free sensor touches no plate, whose friction and tilt would count
        tilt = plate_tilt_of(plate_tilt) if depth else 0.0
        load = Load(depth, shear, shear_y, friction=contact if depth else "none", plate_tilt=tilt)
    check_load(design, load, magnet)
    say_if_without_magnet(design)
    atomic_files.check_apart(atomic_files.inside(out, (*study.FILES, run_record.NAME)), [source])
    with atomic_files.results(out, study.FILES) as folder, console.progress(as_json=as_json) as progress:
        try:
            report = study.run(design, load, band, count, magnet, accuracy, folder, progress)
        except SolveFailed as error:
            record = {"status": "failed", "message": str(error), "depth_mm": depth, "shear_mm": shear}
            console.report([record], as_json=as_json, title="Vibration")
            return report_failures([record])
        if folder is not None:
            run_record.write(folder, command_line, dataclasses.asdict(design))
    warnings += [text for motion in report.motions for text in motion_lines.mesh_warnings(motion)]
    shared = {"warnings": warnings, "notes": report.notes}
    if as_json:
        console.report([motion.row() | shared for motion in report.motions], as_json=True)
    else:
        for motion in report.motions:
            moved = "grip" if grip is not None else "plate" if depth else "base"
            way = "x, the direction of the shear" if motion.motion == "x" and shear_y else motion.motion
            console.lines(f"The {moved} moves along {way}", motion_lines.lines(motion))
        if report.ladder:
            console.report(
                [rung.row() for rung in report.ladder],
                as_json=False,
                title=f"Shift per N: relative to that at {band[0]:g} Hz, and accurate within 5 % of it",
                wide=wide,
            )
        for note in report.notes:
            console.note(f"{note}.")
    for warning in warnings:
        console.warn(warning)
    return report_failures([motion.row() for motion in report.motions])


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
