"""The verbs of mechanics: solve, analytic, stability, modes and compare."""

from __future__ import annotations

import contextlib
from functools import partial
from pathlib import Path
from typing import Annotated

from geometry.design import BadInput, Design
from geometry.loads import Magnet
from studies.cli.command_output import say_if_without_magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of, destination
from studies.inputs import user_input
from studies.inputs.input_warnings import say_no_effect
from studies.inputs.option_groups import (
    ACCURACY,
    DEPTH,
    MAGNET,
    SHEAR,
    SHEAR_Y,
    STANDARD,
    TOLERANCE,
    Method,
    Motion,
    Whole,
)
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console
from studies.output.result import Destination, Result, failure_of, publish, show


def solve(
    source: Source,
    /,
    *,
    motion: Motion = Motion(),
    method: Method = Method(),
    out: Path | None = None,
    picture: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Compute force, shift and tilt of the magnet by finite elements; print each state as soon as it is reached.

    If a solve stops early, the last converged state is printed and the exit status is 3. With --tolerance, formulas
    or the surrogate may replace the finite elements, and all states are printed at the end. With --force the model
    for a tolerance is chosen for the depth that accuracy quick finds, and only among finite elements.

    Parameters
    ----------
    out
        File (.vtu) for the deformed body of the last state.
    picture
        File (.png) for the deformed section of the last state.
    """
    from studies.simulation import load_cases, within_tolerance

    design = design_of(source, sets, method.magnet)
    atomic_files.check_apart([out, picture], [source, method.mesh])
    targets = load_cases.targets_of(motion)
    loads = load_cases.approximate_loads(targets) if targets else load_cases.loads_of(motion)
    for option, reason in load_cases.ineffective_options(motion, method):
        say_no_effect(option, reason)
    with console.progress(as_json=as_json) as progress:
        title, rows = within_tolerance.run(
            design, loads, method, targets, out=out, picture=picture, progress=progress
        )
        with contextlib.closing(rows):
            records = console.stream(
                rows,
                as_json=as_json,
                title=title,
                keys=load_cases.target_columns(targets) if targets else load_cases.columns(loads),
                count=len(loads),
                brief=(*load_cases.UNSHOWN, *load_cases.unshown(targets)),
                first=load_cases.FIRST,
                wide=wide,
            )
    notes = console.remarks(records, load_cases.MOVED) if len(loads) > 1 else []
    if targets and (change := load_cases.change_of_force(records[-1])):
        notes.append(change)
    # the records are printed as soon as they are reached
    result = Result(title=title, records=[], shown=notes, failures=failure_of(records))
    return show(result, Destination(as_json=as_json))


def analytic(
    source: Source,
    /,
    *,
    depth: Annotated[float, DEPTH],
    shear: Annotated[float, SHEAR] = 0.0,
    shear_y: Annotated[float, SHEAR_Y] = 0.0,
    level: str = "paper",
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Compute force, shift of the magnet and readings by formulas; in a shear the tip sticks to the plate.

    Parameters
    ----------
    level
        Formulas, from the simplest to the most complete: paper, column, tip, magnet or finite.
    """
    from studies.simulation import load_cases

    design = design_of(source, sets)
    if level == "paper" and design.law != "neo-hookean":
        say_no_effect("law", "level paper uses E only")
    return publish(
        lambda _: load_cases.analytic(design, depth, (shear, shear_y), level), destination(analytic, locals())
    )


def stability(
    source: Source,
    /,
    *,
    depth: Annotated[float | None, DEPTH] = None,
    magnet: Annotated[Magnet, MAGNET] = "rigid",
    accuracy: Annotated[AccuracyName, ACCURACY] = "standard",
    slenderness: str | None = None,
    out: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Compute the depth at which a press buckles sideways; with --depth also the response to a small shear.

    Parameters
    ----------
    slenderness
        Values a,b,c of L/D: critical depths of beams of these lengths, beside Euler, Engesser and Haringx.
    out
        Folder for table, plot and STABILITY.md of --slenderness.
    """
    from studies.simulation import critical_depths

    design = design_of(source, sets, magnet)
    if slenderness is not None:
        if depth is not None:
            raise BadInput("--depth and --slenderness exclude each other: give only one")
        if "L" in user_input.pairs("--set", sets or [], "D=10"):
            say_no_effect("L", "the lengths come from --slenderness")
        ratios = _slenderness_of(slenderness, design)
        here = destination(stability, locals(), critical_depths.FILES)
        return publish(partial(critical_depths.over_slenderness, design, magnet, accuracy, ratios), here)
    if out is not None:
        raise BadInput("--out works with --slenderness only: add --slenderness 1,2,3")
    return publish(
        partial(critical_depths.at_design, design, magnet, accuracy, depth), destination(stability, locals())
    )


def _slenderness_of(text: str, design: Design) -> list[float]:
    """Return the values of --slenderness."""
    ratios = user_input.parse_numbers("--slenderness", text)
    if not min(ratios) > 0.5:
        raise BadInput(
            f"--slenderness must exceed 0.5, because L must exceed the tip radius D/2; got {min(ratios):g}"
        )
    longest = Design.__dataclass_fields__["L"].metadata["high"]
    if not min(ratios) * design.D <= longest:
        raise BadInput(
            f"--slenderness must be at most {longest / design.D:g} with D = {design.D:g} mm, because L is at most "
            f"{longest:g} mm; got {min(ratios):g}"
        )
    return ratios


def modes(
    source: Source,
    /,
    *,
    count: Whole = 8,
    depth: Annotated[float, DEPTH] = 0.0,
    magnet: Annotated[Magnet, MAGNET] = "rigid",
    accuracy: Annotated[AccuracyName, ACCURACY] = "standard",
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Compute natural frequencies and mode shapes of the sensor, free or pressed against a plate to which it sticks.

    Parameters
    ----------
    count
        Number of modes, 1 to 40; a pair of bending or ovalling modes counts once.
    """
    from studies.simulation import modal_report

    design = design_of(source, sets, magnet)
    study = partial(modal_report.run, design, magnet, count, depth, accuracy)
    return publish(study, destination(modes, locals()))


def compare(
    source: Source,
    /,
    *,
    out: Path | None = None,
    accuracy: Annotated[AccuracyName | None, STANDARD] = None,
    tolerance: Annotated[str | None, TOLERANCE] = None,
    frequency: float | None = None,
    speed: float | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Compare finite elements and formulas in a press and in a shear.

    The press has 12 steps to a depth of 3 D/8, or to 0.6 of the silicone on the axis if that is less. The shear has
    6 steps to 3 D/8 at a third of that depth. For other depths use magtip sweep --axis depth=a,b,c.

    Parameters
    ----------
    out
        Folder for tables and plots.
    frequency
        Also say how the forces differ in small vibrations at this frequency, Hz.
    speed
        Also say how the forces differ if the plate moves with this speed from rest, mm/s.
    """
    from studies.simulation import compare as study
    from studies.simulation import within_tolerance

    here = destination(compare, locals(), study.FILES)
    design = design_of(source, sets)
    say_if_without_magnet(design)
    chosen: within_tolerance.Chosen | None = None
    level: str = accuracy or "standard"
    if tolerance is not None:
        within_tolerance.check_alone({"--accuracy": accuracy})
        chosen = within_tolerance.choose_accuracy(design, study.default_loads(design), tolerance)
        chosen.say()
        level = chosen.choice.level_or_accuracy
    return publish(partial(study.study, design, level, chosen, frequency, speed), here)
