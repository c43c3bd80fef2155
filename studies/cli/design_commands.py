"""The verbs of designs and parts: design, cad, board, mesh, catalogue, size."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from geometry.design import BadInput
from geometry.messages import Progress
from studies.cli.parameters import Call, verb
from studies.inputs import user_input
from studies.inputs.option_groups import Fabrication, Sizing
from studies.inputs.user_input import say_no_effect
from studies.output import atomic_files, console
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, check_files, failure_of, publish, show, write

if TYPE_CHECKING:
    from studies.sizing.sizing_study import Settings


@verb("source sets as_json", arrays=True)
def design(call: Call, *, loaded: bool = False) -> int:
    """Show every value of a design with its source, derived values, assumptions and warnings.

    Parameters
    ----------
    loaded
        Solve for the gap between the loaded beam and what stands beside it, if it is not stored; takes seconds.
    """
    from studies.fabrication.sensor_solids import parse_fabrication_choices
    from studies.parts import requirements
    from studies.sensing import array_readings
    from studies.simulation import design_summary

    of_design = user_input.read_design(call.source, call.sets)
    given = user_input.fabrication_of(call.source)
    choices = parse_fabrication_choices(Fabrication(), given=given)
    needed = requirements.stated_requirements(call.source)
    rated = needed.rated if needed else None
    array = array_readings.stated_array(call.source, of_design)
    study = design_summary.study(of_design, choices.base, given.get("process"), rated, array, loaded=loaded)
    return show(study, call.screen)


@verb("source sets wide as_json", arrays=True)
def cad(call: Call, *, out: Path, fabrication: Fabrication = Fabrication()) -> int:
    """Make and check solids, a printable mould and base, an assembly, drawings and a casting recipe.

    Parts are written as .step, .stl and .3mf; start with README.md in the folder.

    Parameters
    ----------
    out
        Output folder.
    """
    from studies.fabrication import design_variants, sensor_parts, sensor_solids
    from studies.parts import catalogues, requirements
    from studies.sensing import array_readings

    design = call.design()
    atomic_files.check_apart(atomic_files.inside(out, sensor_parts.names()), [call.source])
    mix = catalogues.mix_named(fabrication.silicone, design.silicone)
    needed, given = requirements.stated_requirements(call.source), user_input.fabrication_of(call.source)
    rated, array = needed.rated if needed else None, array_readings.stated_array(call.source, design)
    choices = sensor_solids.parse_fabrication_choices(fabrication, mix, given, rated, array)
    axes = design_variants.axes_of(fabrication.axis or [])
    for name, reason in design_variants.idle(design, axes):
        say_no_effect(f"axis {name}", reason)

    def study(progress: Progress) -> Result:
        if not axes:
            return sensor_parts.result_of([sensor_parts.build(design, out, progress, choices, command=call.command)])
        made = list(design_variants.batch(design, axes, out, progress, choices, command=call.command))
        said, lost = design_variants.sentences_of(made), any(each["status"] != "ok" for each in made)
        found = dataclasses.replace(sensor_parts.result_of(made), warnings=(), failures=())
        return dataclasses.replace(found, failures=said) if lost else dataclasses.replace(found, remarks=said)

    return publish(study, call.screen)


@verb("source sets wide as_json", arrays=True)
def board(call: Call, *, out: Path, thickness: float = 1.6, fabrication: Fabrication = Fabrication()) -> int:
    """Make the circuit board under the base: KiCad project, Gerber files, lists for order and assembly, picture.

    The Hall parts are at the places of the design, or of all beams of an array, with capacitors, pull-ups and a
    header. parts.csv lists all that the whole sensor needs; start with BOARD.md in the folder.

    Parameters
    ----------
    out
        Output folder.
    thickness
        Thickness of the board, 0.8 or 1.6 mm.
    """
    from geometry import base
    from studies.fabrication import array_board, board_files, circuit_board, sensor_solids
    from studies.parts import catalogues
    from studies.sensing import array_readings

    if fabrication.axis:
        raise BadInput("board takes no --axis: make one board for each design")
    design, here = call.design(), call.here(board_files.FILES)
    mix = catalogues.mix_named(fabrication.silicone, design.silicone)
    given, array = user_input.fabrication_of(call.source), array_readings.stated_array(call.source, design)
    choices = sensor_solids.parse_fabrication_choices(fabrication, mix, given, array=array)
    title = f"{Path(call.source).stem}: {design.hall_layout}"
    if array:
        whole = base.array_plan(array, choices.base, choices.mold.process)
        made = array_board.board(whole, thickness)
        return publish(
            lambda progress: board_files.study(design, choices, whole.one, made, title, progress, whole), here
        )
    plan, made = circuit_board.plan_and_board(design, choices.base, choices.mold.process, thickness)
    return publish(lambda progress: board_files.study(design, choices, plan, made, title, progress), here)


@verb("source sets as_json")
def mesh(
    call: Call,
    *,
    out: Path,
    size: float | None = None,
    half: bool = False,
    mesher: Literal["revolved", "pytetwild"] = "revolved",
) -> int:
    """Write the tetrahedral mesh of silicone and magnet to a .vtu file and show its quality.

    Parameters
    ----------
    out
        Output file (.vtu).
    size
        Edge length away from small features, mm; default: D/8.
    half
        Mesh only the half at y >= 0.
    mesher
        revolved: the mesh of the models half and full; pytetwild: another program's, for a check by `solve --mesh`.
    """
    from studies.simulation import design_summary

    design = call.design()
    atomic_files.check_apart([out], [call.source])

    def study(progress: Progress) -> Result:
        record = design_summary.build_mesh(design, out, size, progress, half=half, mesher=mesher)
        return Result(title="Mesh", records=[record], failures=failure_of([record]))

    return publish(study, call.screen)


Kind = Annotated[
    Literal["magnets", "hall_parts", "silicones", "published"] | None,
    Parameter(
        name="KIND", help="magnets, hall_parts or silicones, or published (sensors); default: the first three."
    ),
]


@verb("wide as_json")
def catalogue(call: Call, kind: Kind = None, /, *, file: list[Path] | None = None, sized: Path | None = None) -> int:
    """List the magnets, Hall parts and silicones from which sensors are sized, or the figures of published sensors.

    Parameters
    ----------
    file
        TOML file with parts of your own, which are added to the shipped ones or replace those of the same name;
        repeatable.
    sized
        Folder with results of magtip size for the boxes of published sensors, each in a folder that is named as its
        file of requirements: what the best variant reaches stands beside the published figures.
    """
    here = call.screen
    if kind == "published":
        return show(_published(sized), here)
    if sized is not None:
        raise BadInput("--sized goes with published sensors: magtip catalogue published --sized FOLDER")
    from studies.parts import catalogues
    from studies.parts.requirements import CATALOGUES, Requirements

    # the parts do not depend on what a sensor must reach
    parts = catalogues.catalogues_of(Requirements(force_z=1.0, catalogues=tuple(map(str, file or []))))
    records: list[FlatRow] = []
    shown: list[Block] = []
    for each in CATALOGUES if kind is None else (kind,):
        rows = catalogues.rows((*getattr(parts, each), *(parts.left_out if each == "hall_parts" else ())))
        records += [{"kind": each, **row} for row in rows]
        title = f"{each.replace('_', ' ').capitalize()}: {len(rows)}"
        shown.append(Table(title=title, rows=rows, brief=("source", "loss_source"), first=FIRST[each]))
    shown.append("--wide shows the sources; `assumed` names values without a source that was read.")
    return show(Result(title="Catalogue", records=records, shown=shown), here)


def _published(sized: Path | None) -> Result:
    from studies.sizing import published_sensors

    rows = published_sensors.comparison({} if sized is None else published_sensors.reached_in(sized))
    first = ("sensor", "quantity", "unit", "published", "variant")
    table = Table(title="Published sensors", rows=rows, first=first)
    return Result(title=table.title, records=rows, shown=[table, *published_sensors.remarks()])


FIRST = {
    "magnets": ("name", "diameter_mm", "height_mm", "remanence_low_T", "remanence_high_T", "largest_temperature_C"),
    "hall_parts": ("name", "layout", "gain_V_per_mT", "low", "high"),
    "silicones": ("name", "E_low_MPa", "E_MPa", "E_high_MPa", "mixed"),
}
"""Columns that a table must show, by the kind of parts."""
Wanted = Annotated[
    str,
    Parameter(
        name="REQUIREMENTS",
        help="TOML file of requirements; --example prints one with all keys, and what they mean.",
    ),
]


def _settings(options: Sizing) -> Settings:
    from fem.accuracy import LEVELS
    from studies.mechanics.solve_plan import Processes
    from studies.sizing import sizing_study
    from studies.sizing.variant_search import Effort

    effort, level = Effort(options.population, options.generations), LEVELS[options.accuracy]
    made = None
    if options.calibration is not None:
        from studies.calibration import calibration_file

        made = calibration_file.read(options.calibration)
    return sizing_study.Settings(
        effort, level, Processes(options.workers), options.store, options.points, options.sensors, made
    )


@verb("wide as_json")
def size(
    call: Call,
    source: Wanted = "",
    /,
    *,
    out: Path | None = None,
    options: Sizing = Sizing(),
    example: bool = False,
) -> int:
    """Find the variants that meet requirements: a Pareto front of range, resolution and size, confirmed by FEM.

    Magnets, Hall parts and silicones come from catalogues (see magtip catalogue). All points of the front are solved
    by finite elements; those that fail are not ranked. Exit status 3 if no variant meets all requirements: a message
    then says what is impossible, or which candidate comes nearest, and which choices, bounds or pairs of bounds could
    give. After an interruption the same command solves no state again.

    Parameters
    ----------
    out
        Folder for SIZING.md, sizing.json, front.csv, yield.csv, front.png and winner.toml, the best variant as a
        design file; the design file and parts of an earlier sizing are removed from it.
    example
        Print a file of requirements with all keys, to edit, and do nothing else.
    """
    from studies.output.provenance import made, versions
    from studies.parts import requirements
    from studies.sizing import sizing_export, sizing_study

    if example:
        print(requirements.example(), end="")
        return 0
    if not source:
        raise BadInput("size needs a file of requirements and --out FOLDER; size --example prints such a file")
    if out is None:
        raise BadInput("size needs --out FOLDER: add it behind the file of requirements")
    here = call.here(sizing_study.FILES)
    needed = requirements.read_requirements(source)
    settings = _settings(options)
    for warning in needed.warnings():
        console.warn(warning)
    check_files(here)
    atomic_files.check_apart([options.store], [source, options.calibration])
    sizing_export.check_parts(out)
    with atomic_files.filled(out, here.names) as folder, console.progress(as_json=call.as_json) as progress:
        sizing = sizing_study.size(needed, settings, progress=progress)
        # parts of earlier requirements must not stand beside a new result
        sizing_export.remove(folder)
        origin = versions(())
        result = sizing_study.result_of(sizing, origin, here.command, wide=call.wide)
        progress(0.97, "SIZING.md, tables and front.png")
        write(result, folder, here.command)
        if sizing.winner is not None:
            if settings.calibration and not settings.calibration_of(sizing.winner.variant.design):
                said = (
                    "the best variant is not the design that was calibrated: its yield takes twelve planned presses"
                )
                result = replace(result, warnings=[*result.warnings, said])
            winner, said = sizing.winner, made(here.command, origin)
            polarity = winner.array.get("polarity", "")
            sizing_export.write_design(winner.variant, needed, folder, said, polarity=polarity)
            if options.export:
                parts = sizing_export.export(sizing.winner.variant, needed, folder, progress)
                lost = [parts["message"]] if parts["status"] != "ok" else []
                result = replace(
                    result, warnings=[*result.warnings, *parts["warnings"]], failures=[*result.failures, *lost]
                )
        progress(1.0, "complete")
    return show(result, here)
