"""The verbs of the magnetic field and of the Hall elements, from field and readings to decode, stream and layout."""

from __future__ import annotations

import dataclasses
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from geometry.design import BadInput
from studies.cli.parameters import Call, verb
from studies.inputs import option_groups, user_input
from studies.inputs.option_groups import (
    Basis,
    Calibration,
    Depth,
    LayoutParts,
    Pose,
    Shear,
    ShearY,
    SourceOfLoad,
    TiltSource,
)
from studies.output import atomic_files, console
from studies.output.result import GOOD, Destination, Result, of_record, publish, show

if TYPE_CHECKING:
    from analytic.decode import Decoded, Status
    from geometry.array_design import ArrayDesign
    from geometry.arrays import Array


@verb("source sets")
def field(
    call: Call,
    *,
    points: Path,
    pose: Pose = Pose(),
    level: option_groups.FieldModel = "exact",
    out: Path | None = None,
) -> int:
    """Compute the magnet's field at the points of a table, in the sensor's frame (base at z = 0, beam along z).

    Parameters
    ----------
    points
        CSV file with the columns x_mm,y_mm,z_mm.
    out
        CSV file for the points with Bx_T,By_T,Bz_T added; default: standard output.
    """
    from studies.sensing import field_readings

    # no element takes part, so l0, their distance from the magnet, may be anything
    design = call.design(l0=1000.0)
    atomic_files.check_apart([out], [call.source, points])
    with atomic_files.sole_writer(out):
        field_readings.add_field(design, points, pose, level, out)
    return GOOD


@verb("source sets wide as_json", arrays=True)
def readings(
    call: Call,
    *,
    pose: Pose = Pose(),
    reading: option_groups.Reading = option_groups.Reading(),
    responses: Path | None = None,
    calibration: Calibration | None = None,
    beam: int | None = None,
    depth: Depth = 0.0,
    shear: Shear = 0.0,
    shear_y: ShearY = 0.0,
) -> int:
    """Compute what the Hall elements read after the magnet has moved; check saturation and clearance.

    With --calibration, whose mechanics give the pose, --depth and --shear may stand in place of --shift and --tilt.

    Parameters
    ----------
    responses
        File of states printed by `magtip solve --json` (or `analytic --json`), one per line, in place of --shift
        and --tilt; each state gives a row of readings.
    beam
        Of an array: the beam whose magnet has this pose, counted from 1, the others at rest; default: all of them.
    """
    from studies.sensing import array_readings, field_readings

    here = call.screen
    design, load = call.design(), (depth, shear, shear_y)
    array = array_readings.stated_array(call.source, design)
    if array is not None:
        if calibration or responses or any(load) or reading != option_groups.Reading():
            raise BadInput(
                "the readings of an array take --shift, --tilt and --beam: leave other options out, or take a design "
                "file without [array] for a single beam"
            )
        return show(array_readings.read(array, pose, beam), here)
    if beam is not None:
        raise BadInput("--beam works with the table [array] of a design file: leave it out")
    if calibration is not None:
        from studies.calibration import calibration_file

        found = calibration_file.readings(calibration, design, pose, load, reading, responses, wide=call.wide)
        return show(found, here)
    if any(load):
        raise BadInput(
            "--depth and --shear work with --calibration, whose mechanics give the pose: without one give the states "
            "of magtip solve --json as --responses"
        )
    sensing = field_readings.sensing_of(design, reading)
    if responses is None:
        shift, tilt = field_readings.pose_of(pose)
        row = field_readings.read_pose(design, shift, tilt, sensing)
        return show(of_record("Readings", row), here)
    if pose != Pose():
        raise BadInput("--responses gives shift and tilt of every state: leave --shift and --tilt out")
    return show(field_readings.study(design, responses, sensing, wide=call.wide), here)


@verb("source sets wide as_json", arrays=True)
def bench(call: Call, *, out: Path | None = None, options: option_groups.Planning = option_groups.Planning()) -> int:
    """Plan the presses of a test stand that tell most about a made sensor, before the first one; simulate them.

    Presses lie within the loads of the design's [requirements]; without any they go to D/8, with as much shear. The
    beams of an array are pressed one after the other.

    Parameters
    ----------
    out
        Folder for plan.csv: what to set, and empty columns for what is measured. Filled in, it is a bench of
        `magtip calibrate`. With --simulate also bench.csv and recording.csv.
    """
    from studies.calibration import simulated_bench
    from studies.parts.part_tolerances import parse_tolerances, parts_of_file
    from studies.parts.requirements import stated_requirements
    from studies.sensing import array_readings

    if options.simulate and out is None:
        raise BadInput("--simulate writes bench.csv and recording.csv: add --out FOLDER")
    for name in ("seed", "reading_noise", "stand_zero", "stand_compliance", "accuracy"):
        if not options.simulate and getattr(options, name) != getattr(option_groups.Planning(), name):
            user_input.say_no_effect(f"--{name.replace('_', '-')}", "it works with --simulate only")
    here = call.here(simulated_bench.FILES, [options.responses])
    design = call.design()
    made = parse_tolerances(options.tolerances or [], design, call.source)
    bought, needed = parts_of_file(design, call.source), stated_requirements(call.source)
    array = array_readings.stated_array(call.source, design)
    return publish(partial(simulated_bench.run, design, made, bought, needed, options, array), here)


@verb("source sets wide as_json", arrays=True)
def calibrate(
    call: Call,
    bench: Annotated[list[Path], Parameter(name="BENCH")],
    /,
    *,
    out: Path | None = None,
    options: option_groups.Calibrating = option_groups.Calibrating(),
) -> int:
    """Estimate a made sensor from what a test stand recorded, and the error of its forces on rows it has not seen.

    A dozen presses with and without shear suffice. Unknown are the silicone's modulus, the magnet's remanence, place
    and tilt, each element's gain and offset, the ambient field, and zero and compliance of the stand.

    Parameters
    ----------
    bench
        CSV files (also .csv.gz), each a run. Heads have their unit as a suffix or in brackets: the readings by the
        names of the elements, S1_V, `S1 [mV]`; forces Fx_N, Fy_N, Fz_N (or load_g), positive along x, y and in
        compression; if measured depth_mm, shear_x_mm, shear_y_mm, time_s, temperature_C (or _K), run. Empty cells are
        allowed.
    out
        Folder for calibration.json, which `decode --calibration` reads, design.toml, CALIBRATION.md, tables, picture;
        of an array one calibration.json with the sensor of each beam.
    """
    from studies.calibration import array_calibration, calibration_study, magnet_scan
    from studies.parts.part_tolerances import parse_tolerances
    from studies.parts.requirements import stated_requirements
    from studies.sensing import array_readings

    names = magnet_scan.FILES if options.scan else calibration_study.FILES
    here = call.here(names, [*bench, options.responses])
    design = call.design()
    if not options.scan:
        made = parse_tolerances(options.tolerances or [], design, call.source)
        needed, array = stated_requirements(call.source), array_readings.stated_array(call.source, design)
        if array is not None:
            return publish(partial(array_calibration.run, array, made, needed, bench, options), here)
        return publish(partial(calibration_study.run, design, made, needed, bench, options, call.command), here)
    if len(bench) > 1 or options != option_groups.Calibrating(scan=True):
        raise BadInput("--scan takes one file and no options of presses: leave the others out")
    return publish(partial(magnet_scan.run, design, bench[0]), here)


@verb(
    "source sets as_json",
    out="CSV file for the rows of --file with the results added; default: standard output.",
    at=1,
    arrays=True,
)
def decode(
    call: Call, *, decoding: option_groups.Decoding = option_groups.Decoding(), mcap: Path | None = None
) -> int:
    """Compute the magnet's pose and the load on the tip from readings; list all poses with the same readings.

    The exit status is 3 if no pose in the workspace gives the readings, or only one at which the plate would have to
    pull; with --file, if this holds for all rows.

    Parameters
    ----------
    mcap
        MCAP file for the forces and flux densities of a --file with times, as messages of ROS 2; see magtip stream.
    """
    from studies.parts.part_tolerances import parse_tolerances
    from studies.sensing import array_readings, decode_readings
    from studies.sensitivity import decode_tolerances
    from studies.simulation import mechanics_sources

    readings, file, here = decoding.readings, decoding.file, call.screen
    if (readings is None) == (file is None):
        raise BadInput("give the readings either as --readings a,b,c or as --file FILE.csv")
    if readings is not None and (call.out is not None or decoding.zero is not None):
        raise BadInput(f"{'--zero' if call.out is None else '--out'} works with --file only: leave it out")
    if decoding.temperature is not None and decoding.calibration is None:
        raise BadInput("--temperature works with --calibration only: leave it out")
    atomic_files.check_apart([call.out, mcap], [call.source, file, decoding.source.responses, decoding.calibration])
    design = call.design()
    array = array_readings.stated_array(call.source, design)
    if mcap is not None:
        from studies.streaming import live_stream

        with atomic_files.sole_writer(mcap):
            live_stream.record(array or design, decoding, mcap)
    if array is not None:
        return _decode_array(call, array, decoding)
    if decoding.calibration is not None:
        from studies.calibration import calibration_file

        with atomic_files.sole_writer(call.out):
            return show(calibration_file.decode(design, decoding, call.out, as_json=call.as_json), here)
    made = parse_tolerances(decoding.tolerances or [], design, call.source)
    source = mechanics_sources.source_of(design, decoding.source)
    coder = decode_readings.prepare(
        design, source, ignore_tilt=decoding.ignore_tilt, reject_ambient=decoding.reject_ambient
    )
    if readings is not None:
        answer, field, found = decode_readings.decode_text(coder, readings, decoding, source)
        checked = decode_tolerances.check(coder, field, found, made)
        return show(decode_readings.result(checked.of_one(answer, found.force)), here)

    def check(field: Array, found: Decoded) -> tuple[list[Status], list[str]]:
        checked = decode_tolerances.check(coder, field, found, made)
        return checked.status, checked.warnings(found.force)

    with atomic_files.sole_writer(call.out):
        return show(decode_readings.decode_file(coder, decoding, source, call.out, check, as_json=call.as_json), here)


def _decode_array(call: Call, array: ArrayDesign, decoding: option_groups.Decoding) -> int:
    from studies.parts.part_tolerances import parse_tolerances
    from studies.sensing import array_readings, decode_readings
    from studies.sensitivity import decode_tolerances
    from studies.simulation import mechanics_sources

    if decoding.units:
        raise BadInput("an array is decoded in the elements' unit: leave --units out")
    if decoding.ignore_tilt:
        raise BadInput("an array is decoded with the tilt of its mechanics: leave --ignore-tilt out")
    if decoding.file is not None and call.out is None and call.as_json:
        raise BadInput("the rows of an array go to a table: add --out to --json")
    rejects = decoding.reject_ambient
    if decoding.calibration is not None:
        from studies.calibration import calibrated_array, calibration_file

        if decoding.source != SourceOfLoad() or decoding.tolerances or decoding.temperature is not None:
            raise BadInput(
                "--calibration of an array gives mechanics and sensors: leave --level, --responses, --tolerance and "
                "--temperature out"
            )
        fits = calibration_file.array_of(decoding.calibration, array)
        decoder: array_readings.ArrayDecoder = calibrated_array.CalibratedArray(array, fits, reject_ambient=rejects)
        source = decode_readings.Source("calibration", fits.beams[0].sensor.mechanics, "of each beam")
    else:
        made = parse_tolerances(decoding.tolerances or [], array.design, call.source)
        source = mechanics_sources.source_of(array.design, decoding.source)
        coder = decode_readings.prepare(array.design, source)
        statuses = decode_tolerances.frame_statuses(coder, made)
        decoder = array_readings.ArrayDecoder(array, coder, statuses, reject_ambient=rejects)
    if decoding.readings is not None:
        return show(array_readings.decode_text(decoder, decoding.readings, source), call.screen)
    with atomic_files.sole_writer(call.out):
        return show(array_readings.decode_file(array, decoder, decoding, source, call.out), call.screen)


@verb(
    "source sets as_json", out="CSV file for time, readings, status, force and shift of each row.", at=1, arrays=True
)
def stream(
    call: Call,
    *,
    streaming: option_groups.Streaming,
    mcap: Path | None = None,
    frame_id: str = "magtip_tip",
    page: bool = False,
    no_browser: bool = False,
) -> int:
    """Decode readings while they arrive, until the stream ends or Ctrl-C: forces on the screen, in a file, as JSON.

    Bytes that are no frame are dropped and counted. The exit status is 3 if no row has a force.

    Parameters
    ----------
    mcap
        MCAP file for the forces (geometry_msgs/WrenchStamped: what acts on the tip, z along the beam) and the flux
        densities (sensor_msgs/MagneticField).
    frame_id
        Frame of these messages.
    page
        Show the forces on the page of magtip explore, whose sensor is the design, until Ctrl-C.
    no_browser
        Print the address of the page, but do not open it.
    """
    from studies.cli.exploration_commands import serve_page
    from studies.sensing import array_readings
    from studies.streaming import live_stream

    atomic_files.check_apart(
        [call.out, mcap], [call.source, streaming.port, streaming.source.responses, streaming.calibration]
    )
    one = call.design()
    design = array_readings.stated_array(call.source, one) or one
    if frame_id != "magtip_tip" and mcap is None:
        raise BadInput("--frame-id works with --mcap only: leave it out")
    if no_browser and not page:
        raise BadInput("--no-browser works with --page only: leave it out")
    targets = {".csv": call.out, ".mcap": mcap}
    for suffix, path in targets.items():
        if path is not None:
            atomic_files.check_output_file(path, suffix)
    with atomic_files.sole_writer(call.out, mcap):
        live, outputs = (
            live_stream.Live(design, streaming),
            live_stream.Outputs(call.out, mcap, frame_id, call.as_json),
        )
        readings = live_stream.source_of(design, streaming)
        if page:
            result = live_stream.run_with_page(
                live, readings, outputs, partial(serve_page, one, no_browser=no_browser)
            )
        else:
            result = live_stream.run(live, readings, outputs, live_stream.typed_zero(live, streaming))
    # the rows on standard output are all of it
    return show(dataclasses.replace(result, records=[], shown=[]) if call.as_json else result, Destination())


@verb("source sets wide as_json", arrays=True)
def firmware(
    call: Call,
    *,
    out: Path,
    exporting: option_groups.Exporting = option_groups.Exporting(),
    ros2: bool = False,
) -> int:
    """Export the decoder of a design as a C header for a microcontroller, in an Arduino library with test vectors.

    Parameters
    ----------
    out
        Folder of the library: src/magtip_decoder.h, library.properties, examples, extras/test_vectors.csv.
    ros2
        Also write a ROS 2 package, ros2/magtip_sensor, whose node publishes what magtip stream decodes.
    """
    from studies.calibration import calibration_file
    from studies.firmware import decoder_export, regression_export
    from studies.parts.part_tolerances import parse_tolerances
    from studies.parts.requirements import stated_requirements
    from studies.sensing import array_readings
    from studies.streaming import ros2_package

    calibration = exporting.calibration
    here = call.here((*decoder_export.FILES, *ros2_package.FILES), [exporting.source.responses, calibration])
    if calibration is not None and (exporting.source != SourceOfLoad() or exporting.tolerances):
        raise BadInput("--calibration gives mechanics and sensor: leave --level, --responses and --tolerance out")
    decoder_export.bytes_of(exporting.flash)
    design = call.design()
    array = array_readings.stated_array(call.source, design)
    if array is not None and calibration is not None:
        raise BadInput(
            "the calibration of an array has a sensor for each beam, and the decoder in C has one for all: decode by "
            "magtip decode or stream, or leave --calibration out"
        )
    made = parse_tolerances(exporting.tolerances or [], design, call.source)
    needed = stated_requirements(call.source)
    if array is not None and ros2:
        raise BadInput("--ros2 writes a node for one sensor: leave it out, or take a design file without [array]")
    more = ros2_package.files(design, calibration, reject_ambient=exporting.reject_ambient) if ros2 else {}
    if calibration is not None and calibration_file.holds_regression(calibration):
        found = calibration_file.regression_of(calibration, design, reject_ambient=exporting.reject_ambient)
        return publish(partial(regression_export.run, found, exporting.flash, needed, here.command, more), here)
    study = partial(decoder_export.run, design, exporting, made, needed, array, here.command, more)
    return publish(study, here)


@verb("source sets as_json")
def table(
    call: Call,
    *,
    out: Path,
    step: float = 0.01,
    level: TiltSource | None = None,
    responses: Path | None = None,
    plane: bool = False,
) -> int:
    """Write the paper's look-up table: B.n in T at every pose of a grid (2.6 GB at a step of 0.01 mm).

    After an interruption the same command continues. FILE.json beside the table describes its axes.

    Parameters
    ----------
    out
        Output file (.npy) of shape (x, y, z, element); read it with numpy.load(FILE, mmap_mode="r").
    step
        Step of the grid, mm.
    responses
        File of states printed by `magtip solve --json` (or `analytic --json`), one per line, for the tilt instead of
        formulas.
    plane
        Write a table of two dimensions, B_rho and B_z over (rho, Z); it suffices if the magnet does not tilt.
    """
    from studies.sensing import decode_readings, lookup_table
    from studies.simulation import mechanics_sources

    design = call.design()
    target = lookup_table.target(out, [call.source, responses])
    asked = SourceOfLoad(level=level, responses=responses)
    source = None if asked == SourceOfLoad() else mechanics_sources.source_of(design, asked)
    model, grid = lookup_table.plan(design, step, None if source is None else source.law)
    with atomic_files.sole_writer(target), console.progress(as_json=call.as_json) as progress:
        name = decode_readings.NO_LEVEL if source is None else source.name
        record = (
            lookup_table.write_plane(model, grid, target, name)
            if plane
            else lookup_table.write(model, grid, target, name, progress)
        )
    return show(Result(title="Table", records=[record]), call.screen)


@verb("source sets wide as_json")
def layout(call: Call, *, basis: Basis = Basis(), parts: LayoutParts = LayoutParts(), out: Path | None = None) -> int:
    """Evaluate the layout of the Hall elements: uniqueness, noise, saturation, clearance; search for better layouts.

    Parameters
    ----------
    out
        Folder for layout.csv, layout.png and LAYOUT.md.
    """
    from studies.sensing import layout_report
    from studies.simulation import mechanics_sources

    here = call.here(layout_report.FILES, [basis.source.responses])
    design = call.design()
    if parts.ranges and not parts.search:
        raise BadInput("--range sets the range of a search: add --search")
    if parts.count is not None and not parts.search:
        user_input.say_no_effect("--count", "it works with --search only")
    mechanics = partial(mechanics_sources.source_of, design, basis.source)
    return publish(partial(layout_report.run, design, mechanics, basis, parts), here)


@verb("source sets wide as_json", out="Folder for DISTURB.md and the tables.", arrays=True)
def disturb(call: Call, *, options: option_groups.Disturbing = option_groups.Disturbing()) -> int:
    """Show what the surroundings do to the decoded force, in N: earth's field, iron, other sensors, temperature.

    Errors are those of the design's decoder at loads of its range: of the requirements that the design states, else
    up to a press of 3 D/8 with a shear of D/8. They are given before and after taring, with the share of readings
    whose status is not ok; of an array, whose beams are decoded jointly, also by beam.
    """
    from studies.parts.requirements import stated_requirements
    from studies.sensing import array_readings, disturbances
    from studies.simulation import mechanics_sources

    here = call.here(disturbances.FILES, [options.source.responses])
    design = call.design()
    mechanics = partial(mechanics_sources.source_of, design, options.source)
    array, needed = array_readings.stated_array(call.source, design), stated_requirements(call.source)
    return publish(partial(disturbances.run, design, mechanics, options, needed, array), here)


@verb("source sets wide as_json", out="Folder for ARRAY.md, tables and picture.", arrays=True)
def array(call: Call, *, options: option_groups.Arraying = option_groups.Arraying()) -> int:
    """Show how beams of an array disturb each other: cross-talk, errors over pitch and polarity, forces of magnets.

    Each beam has its own elements below it. Errors are those of a decoder that ignores the neighbours, of one that
    subtracts their fields once, and of one that decodes all beams together: the largest of some random frames of
    loads of the design's range on all beams. A table [array] of a design file has rows, columns, pitch (mm) and
    polarity.
    """
    from geometry import base
    from studies.fabrication.sensor_solids import parse_fabrication_choices
    from studies.parts.requirements import stated_requirements
    from studies.sensing import array_readings, crosstalk
    from studies.simulation import mechanics_sources

    here = call.here(crosstalk.FILES, [options.source.responses])
    design, grid = call.design(), array_readings.grid_of(call.source, options)
    mechanics = partial(mechanics_sources.source_of, design, options.source)
    needed, given = stated_requirements(call.source), user_input.fabrication_of(call.source)
    choices = parse_fabrication_choices(option_groups.Fabrication(), given=given)
    single_base = partial(base.plan, design, choices.base, choices.mold.process)
    return publish(partial(crosstalk.run, design, mechanics, grid, options, needed, single_base), here)
