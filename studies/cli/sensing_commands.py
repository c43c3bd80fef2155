"""The verbs of the field and of the Hall elements: field, readings, decode, table, layout."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from geometry.design import BadInput
from studies.cli.command_output import judged, print_record
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of
from studies.cli.printed_command import command
from studies.inputs.exit_status import FAILED, GOOD
from studies.inputs.input_warnings import say_no_effect
from studies.inputs.option_groups import LEVEL, Basis, FieldLevel, Pose, Whole
from studies.output import atomic_files, console


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
    from studies.sensing import field_readings

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
    from studies.sensing import field_readings

    given = design_of(source, sets)
    sensing = field_readings.sensing_of(given, level, mode, ambient, seed)
    if responses is None:
        shift, tilt = field_readings.pose_of(pose)
        print_record(field_readings.at(given, shift, tilt, sensing), "Readings", (), as_json=as_json)
        return GOOD
    if pose != Pose():
        raise BadInput("--responses gives shift and tilt of every state: leave --shift and --tilt out")
    from studies.sensing import state_readings

    rows = state_readings.of_states(given, responses, sensing)
    state_readings.show(rows, as_json=as_json, wide=wide)
    return GOOD if any(row["status"] == "ok" for row in rows) else FAILED


def decode(
    source: Source,
    /,
    *,
    readings: str | None = None,
    file: Path | None = None,
    units: Literal["T", "V"] | None = None,
    level: str | None = None,
    responses: Path | None = None,
    ignore_tilt: bool = False,
    out: Path | None = None,
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """Pose of the magnet and load on the tip from readings, with every other pose that reads alike.

    Exit status 3 if no pose in the workspace gives the readings (of a file: not a single row of it).

    Parameters
    ----------
    readings
        What the elements read, a,b,c in the order S1,S2,S3 (a chip: -z,x,y).
    file
        A .csv file with the columns S1_V,S2_V,S3_V (or _T), decoded row by row as a stream.
    units
        Of the readings: outputs in V or flux densities B.n in T; by default what the elements send.
    level
        Formulas that give tilt and load from the shift; default: paper, which has no tilt and too small a force.
    responses
        States printed by `magtip solve --json` (or `analytic --json`), a line each, that give tilt and load
        instead of formulas.
    ignore_tilt
        Decode as if the magnet did not tilt.
    out
        The .csv file with the results added; standard output by default.
    """
    from studies.sensing import decode_readings

    if (readings is None) == (file is None):
        raise BadInput("give the readings either as --readings a,b,c or as --file FILE.csv")
    if readings is not None and out is not None:
        raise BadInput("--out is for --file FILE.csv: leave it out")
    atomic_files.check_apart([out], [source, file, responses])
    coder = decode_readings.prepare(design_of(source, sets), level, responses, ignore_tilt=ignore_tilt)
    name = decode_readings.level_name(level, responses)
    if readings is not None:
        record = decode_readings.one(coder, readings, units, name)
        console.report([record], as_json=as_json, title="Decoded", brief=["warnings"])
        for warning in record["warnings"]:
            console.warn(warning)
        if record["status"] == "ambiguous":
            console.warn(record["message"])
            return GOOD
        return judged([record])
    assert file is not None
    with atomic_files.sole_writer(out):
        found = decode_readings.table(coder, file, units, out, name, as_json=as_json)
    counts = found.counts
    for warning in found.warnings:
        console.warn(warning)
    if as_json and out is not None:
        console.report([counts], as_json=True)
    for status, count in counts.items():
        if status != "ok":
            why = [decode_readings.WHY[status]]
            if status == "out_of_workspace":
                solved = responses is not None
                why = [
                    f"{n}: {decode_readings.beyond_sentence(coder, end, solved=solved)}"
                    for end, n in found.ends.items()
                ]
            console.say(f"magtip: {count} of {sum(counts.values())} rows {status}: {'; '.join(why)}")
    return GOOD if not counts or {"ok", "ambiguous"} & set(counts) else FAILED


def table(
    source: Source,
    /,
    *,
    out: Path,
    step: float = 0.01,
    level: str | None = None,
    responses: Path | None = None,
    plane: bool = False,
    sets: Sets = None,
    as_json: AsJson = False,
) -> int:
    """The paper's look-up table: B.n of every pose on a grid, T, written as it is made; 2.6 GB at a step of 0.01 mm.

    Interrupted, the same command goes on where it stopped. FILE.json beside the table says what its axes are.

    Parameters
    ----------
    out
        A .npy file, shape (x, y, z, element); read it with numpy.load(FILE, mmap_mode="r").
    step
        Of the grid, mm.
    level, responses
        As in decode, for the tilt; without them the magnet does not tilt.
    plane
        The table of two dimensions that is enough where the magnet does not tilt: B_rho and B_z over (rho, Z).
    """
    from studies.sensing import decode_readings, lookup_table

    given = design_of(source, sets)
    target = lookup_table.target(out, [source, responses])
    model, grid = lookup_table.plan(given, step, level, responses)
    with atomic_files.sole_writer(target), console.progress(as_json=as_json) as progress:
        record = (
            lookup_table.write_plane(model, grid, target)
            if plane
            else lookup_table.write(model, grid, target, progress)
        )
        record["level"] = decode_readings.level_name(level, responses, decode_readings.NO_LEVEL)
    console.report([record], as_json=as_json, title="Table")
    return GOOD


def layout(
    source: Source,
    /,
    *,
    basis: Basis = Basis(),
    search: bool = False,
    ranges: Annotated[list[str] | None, Parameter(name="--range")] = None,
    count: Whole | None = None,
    claim: bool = False,
    out: Path | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """How well the Hall elements tell the magnet's poses apart over the workspace; and a search for better layouts.

    Parameters
    ----------
    search
        Rank layouts over f, l0 and c (of a chip: l0 and chip_x) by what they fail at, then by worst noise; a minute.
    ranges
        Where to search: NAME=LOW,HIGH in mm, or NAME=VALUE to keep it; repeatable.
    count
        How many layouts the search gives, 1 to 16; default: 10.
    claim
        Whether readings are unique, as the paper models them and as elements read them, over c; a minute.
    out
        Folder of layout.csv, layout.png and LAYOUT.md.
    """
    asked = command(layout, locals())
    from studies.sensing import layout_report as texts
    from studies.sensing import layout_search
    from studies.sensing import layout_study as work

    given = design_of(source, sets)
    if ranges and not search:
        raise BadInput("--range says where to search: add --search")
    if count is not None and not search:
        say_no_effect("--count", "it says how many layouts a search gives, and there is no --search")
    atomic_files.check_apart(atomic_files.inside(out, texts.FILES), [source, basis.responses])
    with atomic_files.results(out) as folder, console.progress(as_json=as_json) as progress:
        job = work.Job(
            given, basis, search, tuple(ranges or ()), layout_search.USUAL if count is None else count, claim
        )
        found = work.run(job, progress, folder, asked)
    if as_json:
        console.report([found], as_json=True)
        return GOOD
    console.report([texts.shown(found)], as_json=False, title="Layout")
    if search:
        console.report(texts.shown_search(found["search"]), as_json=False, title="Layouts, the best first", wide=wide)
    if claim:
        console.report(texts.shown_claim(found["claim"]), as_json=False, title="Claim", wide=wide)
    for warning in (*found["hits"], *found["warnings"]):
        console.warn(warning)
    return GOOD
