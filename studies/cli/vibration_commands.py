"""The verb of steady vibration: response."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from geometry.design import BadInput
from geometry.loads import Load, Magnet
from studies.cli.command_output import say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of, destination
from studies.inputs.option_groups import ACCURACY, MAGNET, SHEAR, SHEAR_Y, Whole
from studies.inputs.user_input import AccuracyName
from studies.output.result import publish

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
    from geometry.loads import check_load
    from geometry.relaxation import check_range
    from studies.simulation import vibration_report
    from studies.simulation.load_cases import friction_of, plate_tilt_of

    here = destination(response, locals(), vibration_report.FILES)
    design = design_of(source, sets, magnet)
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
    study = partial(vibration_report.run, design, load, band, count, magnet, accuracy, warnings)
    return publish(study, here)


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
