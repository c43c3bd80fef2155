"""The verbs of one design: in numbers, as solids, as a mesh, and under load."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated, Any, Literal

from geometry.design import BadInput, Design
from geometry.loads import Magnet
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of, judged
from studies.cli.printed_command import command
from studies.inputs import user_input
from studies.inputs.exit_status import FAILED, GOOD
from studies.inputs.input_warnings import say_no_effect
from studies.inputs.option_groups import (
    ACCURACY,
    DEPTH,
    LEVEL,
    MAGNET,
    SHEAR,
    SHEAR_Y,
    FieldLevel,
    Method,
    Motion,
    Pose,
    Whole,
)
from studies.inputs.user_input import AccuracyName
from studies.output import atomic_files, console
from studies.sensing import field_readings
from studies.simulation import design_summary, load_cases, modal_report, stability_report


def design(source: Source, /, *, sets: Sets = None, as_json: AsJson = False) -> int:
    """Every value of a design and where it comes from, derived values, what is assumed, warnings."""
    design_summary.show(user_input.read_design(source, sets or []), as_json=as_json)
    return GOOD


def cad(
    source: Source,
    /,
    *,
    out: Path,
    process: Literal["fdm", "sla"] = "fdm",
    mold: list[str] | None = None,
    base: list[str] | None = None,
    axis: list[str] | None = None,
    tolerance: float | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Solids, printable two-part mould and base, assembly, drawings and a casting recipe; everything is checked.

    Parts are written as .step, .stl and .3mf; start with README.md in the folder.

    Parameters
    ----------
    out
        Folder of the files.
    process
        Filament or resin printing: defaults of fit and walls.
    mold
        A choice about the mould, KEY=VALUE, such as shrink=0.01, columns=3 or split=1; repeatable.
    base
        A choice about the base, KEY=VALUE, such as screw=0 or thickness=5; repeatable.
    axis
        NAME=a,b,c with NAME one of D, L, f, E: a folder for each combination, without picture; repeatable.
    tolerance
        Largest distance of the STL's facets from the surface, mm; D/2000 by default.
    """
    asked = command(cad, locals())
    from studies.fabrication import design_variants, sensor_parts

    given = design_of(source, sets)
    atomic_files.check_apart(atomic_files.inside(out, sensor_parts.names()), [source])
    making = sensor_parts.making_of(process, mold or [], base or [], tolerance)
    axes = design_variants.axes_of(axis or [])
    for name, reason in design_variants.idle(given, axes):
        say_no_effect(f"axis {name}", reason)
    with console.progress(as_json=as_json) as progress:
        if axes:
            records = list(design_variants.batch(given, axes, out, progress, making, command=asked))
        else:
            records = [sensor_parts.build(given, out, progress, making, command=asked)]
    sensor_parts.show(records, as_json=as_json, wide=wide)
    if axes:
        for sentence in design_variants.said(records):
            console.say(f"magtip: {sentence}")
        return FAILED if any(record["status"] != "ok" for record in records) else GOOD
    for warning in records[0]["warnings"]:
        console.say(f"magtip: warning: {warning}")
    return judged(records)


def mesh(
    source: Source,
    /,
    *,
    out: Path,
    size: float | None = None,
    half: bool = False,
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Write the tetrahedral mesh of silicone and magnet as .vtu, and print its quality.

    Parameters
    ----------
    out
        A .vtu file.
    size
        Edge length away from features, mm; D/8 by default.
    half
        Only the half at y >= 0.
    """
    given = design_of(source, sets)
    atomic_files.check_apart([out], [source])
    with console.progress(as_json=as_json) as progress:
        record = design_summary.build_mesh(given, out, size, progress, half=half)
    console.report([record], as_json=as_json, title="Mesh")
    return judged([record])


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
    """Force, shift and tilt of the magnet by finite elements, each state as soon as it is reached.

    If a solve stops short, the last good state is given, and the exit status is 3.

    Parameters
    ----------
    out
        A .vtu file for the deformed body of the last state.
    picture
        A .png file for the deformed section of the last state.
    """
    given = design_of(source, sets, method.magnet)
    atomic_files.check_apart([out, picture], [source, method.mesh])
    loads = load_cases.loads_of(motion)
    for option, reason in load_cases.in_vain(motion, method):
        say_no_effect(option, reason)
    title, keys = "Finite elements", load_cases.columns(loads)
    with console.progress(as_json=as_json) as progress:
        reached = load_cases.solve(given, loads, method, out=out, picture=picture, progress=progress)
        with contextlib.closing(reached):
            records = console.stream(
                reached,
                as_json=as_json,
                title=title,
                keys=keys,
                count=len(loads),
                brief=load_cases.UNSHOWN,
                first=load_cases.FIRST,
                wide=wide,
            )
    if len(loads) > 1 and not as_json:
        for remark in console.remarks(records, load_cases.MOVED):
            console.note(remark)
    return judged(records)


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
    """Force, shift of the magnet and readings by formulas; the tip sticks to a plate that shears.

    Parameters
    ----------
    level
        Which formulas: paper, column, tip, magnet or finite, each with more in it than the one before.
    """
    given = design_of(source, sets)
    if level == "paper" and given.law != "neo-hookean":
        say_no_effect("law", "the paper's formulas know E only")
    record = load_cases.analytic(given, depth, (shear, shear_y), level)
    _report(record, "Formulas", as_json=as_json)
    return GOOD


def _report(record: dict[str, Any], title: str, *, as_json: bool) -> None:
    """Print a record, its warnings on standard error."""
    brief = {key: value for key, value in record.items() if key not in ("warnings", *load_cases.UNSHOWN)}
    console.report([record if as_json else brief], as_json=as_json, title=title)
    for warning in record["warnings"]:
        console.say(f"magtip: warning: {warning}")


def field(
    source: Source,
    /,
    *,
    points: Path,
    pose: Pose = Pose(),
    level: Annotated[FieldLevel, LEVEL] = "exact",
    out: Path | None = None,
    sets: Sets = None,
) -> int:
    """Add the magnet's field to a table of points in the sensor's frame (base plane z = 0, beam along z).

    Parameters
    ----------
    points
        A .csv file with the columns x_mm,y_mm,z_mm.
    out
        The .csv file with Bx_T,By_T,Bz_T added; standard output by default.
    """
    given = design_of(source, sets)
    atomic_files.check_apart([out], [source, points])
    with atomic_files.sole_writer(out):
        field_readings.add_field(given, points, pose, level, out)
    return GOOD


def readings(
    source: Source,
    /,
    *,
    pose: Pose = Pose(),
    level: Annotated[FieldLevel, LEVEL] = "exact",
    mode: Literal["component", "magnitude"] = "component",
    ambient: str = "0,0,0",
    seed: Whole | None = None,
    responses: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """What the Hall elements read when the magnet has moved, with saturation and clearance.

    Parameters
    ----------
    mode
        B.n as an element reads it, or the paper's |B|.
    ambient
        Uniform field that is added, Bx,By,Bz in T.
    seed
        Draw one sample of the elements' noise with this seed; none by default.
    responses
        States printed by `magtip solve --json` (or `analytic --json`), a line each: a row of readings for each,
        without --shift and --tilt.
    """
    given = design_of(source, sets)
    sensing = field_readings.sensing_of(given, level, mode, ambient, seed)
    if responses is None:
        shift, tilt = field_readings.pose_of(pose)
        _report(field_readings.at(given, shift, tilt, sensing), "Readings", as_json=as_json)
        return GOOD
    if pose != Pose():
        raise BadInput("--responses gives shift and tilt of every state: leave --shift and --tilt out")
    from studies.sensing import state_readings

    rows = state_readings.of_states(given, responses, sensing)
    state_readings.show(rows, as_json=as_json, wide=wide)
    return GOOD if any(row["status"] == "ok" for row in rows) else FAILED


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
    """At which depth a press gives way sideways, free or guided; at a depth, small shear about it.

    Parameters
    ----------
    slenderness
        L/D as numbers a,b,c: the critical depths of beams of these lengths, beside Euler, Engesser and Haringx.
    out
        Folder of their table, plot and STABILITY.md.
    """
    asked = command(stability, locals())
    given = design_of(source, sets, magnet)
    if slenderness is not None:
        if depth is not None:
            raise BadInput("--depth asks for one beam and --slenderness for many: leave one of them out")
        if "L" in user_input.pairs("--set", sets or [], "D=10"):
            say_no_effect("L", "--slenderness gives the lengths")
        return _stability_map(source, given, magnet, accuracy, slenderness, out, asked, as_json=as_json, wide=wide)
    if out is not None:
        raise BadInput("--out is the folder of the table over slenderness: give --slenderness 1,2,3 too")
    with console.progress(as_json=as_json) as progress:
        record = stability_report.run(given, magnet, accuracy, depth, progress)
    console.report([record if as_json else stability_report.shown(record)], as_json=as_json, title="Stability")
    return judged([record])


def _stability_map(
    source: str,
    given: Design,
    magnet: Magnet,
    accuracy: str,
    slenderness: str,
    out: Path | None,
    asked: str,
    *,
    as_json: bool,
    wide: bool,
) -> int:
    ratios = user_input.parse_numbers("--slenderness", slenderness)
    if not min(ratios) > 0.5:
        raise BadInput(f"--slenderness must exceed 0.5, for L exceeds the tip radius D/2; got {min(ratios):g}")
    longest = Design.__dataclass_fields__["L"].metadata["high"]
    if not min(ratios) * given.D <= longest:
        raise BadInput(
            f"--slenderness must be at most {longest / given.D:g} with D = {given.D:g} mm, for L is at most"
            f" {longest:g} mm; got {min(ratios):g}"
        )
    from studies.output.provenance import versions
    from studies.simulation import critical_depth_map as work

    atomic_files.check_apart(atomic_files.inside(out, work.FILES), [source])
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        rows = list(work.run(given, magnet, accuracy, ratios, progress))
        if folder is not None:
            work.write(folder, given, rows, versions(), asked)
    console.report(
        rows,
        as_json=as_json,
        title="Stability over slenderness",
        first=("L_over_D", "status", "critical_depth_mm", "critical_force_N"),
        wide=wide,
    )
    if not as_json:
        for remark in console.remarks(rows, ("L_over_D",)):
            console.note(remark)
    return judged(rows)


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
    """Natural frequencies and shapes of the free sensor, or of one pressed against a plate that it sticks to.

    Parameters
    ----------
    count
        How many, pairs of bending or ovalling modes counted once.
    """
    given = design_of(source, sets, magnet)
    with console.progress(as_json=as_json) as progress:
        record = modal_report.run(given, magnet, count, depth, accuracy, progress)
    console.report([record], as_json=as_json, title="Natural frequencies")
    return judged([record])
