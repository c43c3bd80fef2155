"""Fabrication of one design: solids, mould, checks, drawings, picture and recipe in one folder."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry import base, mold
from geometry.bad_input import MeshError
from geometry.design import Design
from geometry.fabrication import bench_parts, magnet_jig
from geometry.messages import Progress
from studies.fabrication import casting_recipe, parts_list
from studies.fabrication.sensor_solids import (
    COLOURS,
    FabricatedSolids,
    FabricationChoices,
    array_plan_of,
    array_scene,
    casting_parts,
    coloured_parts,
    facet_tolerance,
    make_solids,
    triangulated_parts,
)
from studies.mechanics import store as stores
from studies.output import atomic_files, console, own_files
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table, failure_of
from studies.quantities import shown
from studies.simulation import design_summary, loaded_clearance

if TYPE_CHECKING:
    from build123d import Solid

    from geometry.fabrication.printability import Check
    from studies.fabrication.assembly_picture import Painter, Scene

PICTURE, JIG_PICTURE = "assembly.png", "jig.png"

BOARD, PLATE = "board.dxf", "plate.3mf"

RECIPE = "README.md"
"""The casting recipe; a README.md that magtip did not write is never replaced."""


def build(
    design: Design,
    out: Path,
    progress: Progress,
    choices: FabricationChoices = FabricationChoices(),
    *,
    picture: bool = True,
    command: str = "magtip cad",
) -> FlatRow:
    """Build the solids of a design, check them, and write all files into a folder if every check passes.

    Parameters
    ----------
    picture : whether to draw the assembly; a second process does so, and takes about as long as all other work.
    command : command line that the recipe names as its origin.

    Returns
    -------
    status (ok, failed or bad_input), message, folder, parts, checks, sizes (`design_summary.outer_size`), recipe
    (`casting_recipe.recipe_of`) and warnings; a design that fails a check has no parts, and no file is written.

    Raises
    ------
    BadInput
        A choice is impossible for this design, or the folder cannot be used.
    """
    from studies.fabrication import assembly_picture
    from studies.output.table_files import write_table

    choices = choices.of(design)
    # impossible choices are refused before the folder is made and the CAD kernel is loaded
    mold.sizes(design, choices.mold)
    magnet_jig.planned(design, choices.mold)
    whole, _ = array_plan_of(choices)
    if choices.base.cell:
        bench_parts.load_cell(choices.base.cell)
    if choices.base != base.Base() and not whole:
        base.plan(design, choices.base, choices.mold.process)
    facet_tolerance(design, choices)
    with atomic_files.filled(out) as folder, atomic_files.staged(folder) as stage, contextlib.ExitStack() as stack:
        own_files.check(folder, names())
        # the painter imports VTK while this process imports the CAD kernel
        draw = stack.enter_context(assembly_picture.painter()) if picture else None
        progress(0.0, "solids and mould")
        console.load("build123d", "trimesh")
        solids = make_solids(design, choices)
        known = design_summary.outer_size(design, solids.plan, solids.whole) | {
            "recipe": casting_recipe.recipe_of(design, choices, None if solids.whole else solids.plan)
        }
        row = fabricated("ok", "", folder, known)
        row["warnings"] += [*design.warnings(), *warnings(design, choices, solids)]
        gap = None
        if solids.plan:
            progress(0.1, "the beam under load")
            with stores.opened(None) as store:
                gap = loaded_clearance.least_gap(design, solids.plan, store, choices.rated)
            row["loaded_gap_mm"], row["warnings"] = gap and gap.value, row["warnings"] + loaded_clearance.warning(gap)
        try:
            progress(0.2, "triangles")
            shapes = triangulated_parts(design, choices, solids)
            progress(0.4, "checks")
            checks = run_checks(design, choices, solids, shapes)
            row["checks"] = [dataclasses.asdict(check) for check in checks]
            _refuse_failed(checks)
            row["parts"] = _write(design, choices, solids, shapes, stage, progress)
        except MeshError as error:
            return row | {"status": "failed", "message": str(error)}
        volumes = {part["name"]: part["volume_mm3"] for part in row["parts"] if part["name"] in parts_list.PRINTED}
        board = parts_list.board_of(design, solids.plan, solids.whole)
        listed = parts_list.rows(design, choices, solids.plan, volumes, board, solids.whole)
        write_table(stage / parts_list.FILE, listed)
        if draw:
            progress(0.8, "pictures")
        row["warnings"] += [*_draw(stage, design, choices, solids, draw), *left_over(folder, stage)]
        drawn = [name for name in (PICTURE, JIG_PICTURE) if (stage / name).exists()]
        page = casting_recipe.text(design, choices, row, solids.plan, drawn, command, gap, solids.whole)
        atomic_files.write_text(stage / RECIPE, page)
    return row


def fabricated(status: str, message: str, folder: Path, known: FlatRow | None = None) -> FlatRow:
    """Return the row of a sensor without parts; `known` are its sizes and recipe, if it has solids."""
    nothing: FlatRow = {"parts": [], "checks": []}
    sizes = {"assembled_size_mm": None} if known is None else known
    return {"status": status, "message": message, "folder": folder} | nothing | sizes | {"warnings": []}


def _draw(
    stage: Path, design: Design, choices: FabricationChoices, solids: FabricatedSolids, draw: Painter | None
) -> list[str]:
    """Draw the assembly where there is a base, and the jig; a graphics driver may fail: then a sentence says so."""
    from geometry.fabrication import hall_elements
    from studies.fabrication import assembly_picture

    scenes: dict[str, Scene] = {}
    if solids.plan:
        scenes[PICTURE] = array_scene(solids) or (coloured_parts(solids), hall_elements.places(design))
    if solids.jig:
        scenes[JIG_PICTURE] = casting_parts(design, choices, solids)
    try:
        if draw and scenes:
            for name, picture in zip(scenes, draw(list(scenes.values())), strict=True):
                (stage / name).write_bytes(picture)
    except assembly_picture.NoPictureError as error:
        return [f"no picture: {error}"]
    return []


def _refuse_failed(checks: Sequence[Check]) -> None:
    for check in checks:
        if not check.passed:
            raise MeshError(
                f"check '{check.name}' fails: {shown(check.value, check.unit)}, must be {check.bound}; "
                "no file is written: change the design or the mould"
            )


def names() -> list[str]:
    """Return the names of all files that a folder may have, the recipe first."""
    parts = [f"{name}.{suffix}" for name in COLOURS for suffix in ("step", "stl", "3mf")]
    return [
        RECIPE,
        *parts,
        "assembly.step",
        "mold.step",
        PICTURE,
        JIG_PICTURE,
        "sensor.svg",
        "base.svg",
        "mold.svg",
        "jig.svg",
        "bench.svg",
        BOARD,
        PLATE,
        parts_list.FILE,
    ]


def left_over(folder: Path, stage: Path) -> list[str]:
    """Return a warning of files that an earlier run has left in the folder and this run does not replace."""
    old = [name for name in names()[1:] if (folder / name).exists() and not (stage / name).exists()]
    return [f"{', '.join(old)} are from an earlier run, not of this sensor: delete them"] if old else []


def run_checks(
    design: Design, choices: FabricationChoices, solids: FabricatedSolids, shapes: Mapping[str, tuple[Solid, Any]]
) -> list[Check]:
    """Return all checks of mould, base, jig, stand, fixture and printing."""
    from geometry import base
    from geometry.fabrication import mold_solids

    halves = [part for name, part in solids.mold.items() if name not in ("mold_a", "mold_b")]
    checks = mold_solids.checks(design, choices.mold, solids.A, solids.B, halves)
    if solids.plan:
        checks += base.checks(design, solids.sensor["base"], solids.bodies)
    if solids.whole:
        checks += base.array_checks(solids.whole, solids.bench["array_base"], solids.bodies)
    if solids.jig:
        lengths = magnet_jig.lengths(design, choices.mold)
        checks += magnet_jig.checks(design, choices.mold, lengths, solids.jig, solids.B)
    s = mold.sizes(design, choices.mold)
    checks += bench_parts.stand_checks(s, bench_parts.stand(s), solids.bench["stand"], solids.B)
    if solids.plan and "fixture" in solids.bench:
        fixture = bench_parts.fixture(solids.plan, choices.mold.printing, choices.base.cell)
        checks += bench_parts.fixture_checks(solids.plan, fixture, solids.bench["fixture"], solids.sensor["base"])
    for name in ("base", *solids.mold, *solids.jig, *solids.bench):
        if name in shapes:
            checks += mold_solids.printable(name, shapes[name][1], choices.mold.printing)
    return checks


def _write(
    design: Design,
    choices: FabricationChoices,
    solids: FabricatedSolids,
    shapes: Mapping[str, tuple[Solid, Any]],
    stage: Path,
    progress: Progress,
) -> list[FlatRow]:
    """Write all files but the recipe into the temporary folder `stage`; return the exported parts."""
    from geometry import mold
    from geometry.fabrication import board_drawing, solid_files
    from studies.fabrication import part_drawings

    progress(0.6, "STEP, STL and 3MF")
    exported = solid_files.export(shapes, stage, colours=COLOURS)
    counts = {name: parts_list.count_of(name, choices) for name in parts_list.PRINTED if name in shapes}
    printed = {name: (shapes[name][1], count) for name, count in counts.items()}
    (stage / PLATE).write_bytes(solid_files.plate(printed))
    closed = {name: (part, COLOURS[name]) for name, part in solids.mold.items()}
    (stage / "mold.step").write_bytes(solid_files.step(solid_files.assembly("mold", closed)))
    progress(0.7, "drawings")
    s, pieces = mold.sizes(design, choices.mold), [part for name, part in solids.mold.items() if name != "mold_a"]
    atomic_files.write_text(stage / "mold.svg", part_drawings.mold_sheet(design, choices.mold, s, solids.A, pieces))
    if solids.jig:
        lengths = magnet_jig.lengths(design, choices.mold)
        text = part_drawings.jig_sheet(design, choices.mold, s, lengths, solids.jig, solids.B)
        atomic_files.write_text(stage / "jig.svg", text)
    held = None if solids.whole else solids.plan
    bench = part_drawings.bench_sheet(design, choices.mold, s, held, choices.base.cell, solids)
    atomic_files.write_text(stage / "bench.svg", bench)
    if solids.plan:
        (stage / "assembly.step").write_bytes(
            solid_files.step(solid_files.assembly("sensor", coloured_parts(solids)))
        )
        drawn = design, solids.plan, choices.mold.printing
        whole = (solids.whole, solids.bench["array_base"]) if solids.whole else None
        for name, text in part_drawings.sheets(*drawn, solids.sensor, solids.bodies, whole).items():
            atomic_files.write_text(stage / f"{name}.svg", text)
        atomic_files.write_text(stage / BOARD, board_drawing.board(design, solids.plan, solids.whole))
    return exported


def warnings(design: Design, choices: FabricationChoices, solids: FabricatedSolids) -> list[str]:
    """Return warnings: a base that cannot be made, a plate that would meet the base, details too fine to print."""
    from geometry import base, mold
    from geometry.fabrication import engraved_marks

    s, process = mold.sizes(design, choices.mold), choices.mold.printing
    widths = {"the pin": 2 * s.pin_radius, "a vent": s.vent_diameter, "B's wall": s.wall}
    too_fine = [
        f"{name} is {size:.3g} mm across; {process.name} printing makes {process.detail:g} mm at least"
        for name, size in widths.items()
        if 0 < size < process.detail
    ]
    if pushed := casting_recipe.neighbours_push(design, choices.mold):
        too_fine.append(
            f"the magnets of neighbouring cavities {_moves(pushed)} with {pushed['pair_weights']:.2g} times their "
            "weight: "
            + ("hold each down by its plunger" if solids.jig else "glue them in one after another, held down")
            + " until the glue has cured (see the recipe)"
        )
    too_fine += filter(None, (solids.no_jig, solids.no_array))
    if choices.array and design.shape.has_magnet and not casting_recipe.stands(choices.array):
        too_fine.append(
            f"the magnets of neighbours snap together at a pitch of {choices.array.pitch:g} mm: magtip design says "
            "from which pitch on they do not"
        )
    if (mix := choices.silicone) and not mix["moduli"][0] <= design.E <= mix["moduli"][1]:
        low, high = mix["moduli"]
        too_fine.append(
            f"E = {design.E:g} MPa is not that of {mix['name']}, {low:g} to {high:g} MPa: forces will differ from "
            "those of the design"
        )
    if choices.mold.marks and (no_room := engraved_marks.mold_marks(design, choices.mold, s)[2]):
        too_fine.append(no_room)
    if choices.base.marks and solids.plan and not solids.plan.marks:
        too_fine.append("the rim of the base has no room for its marks: set a larger outer or seat_wall")
    return [*(base.warnings(design) if solids.plan else [solids.missing]), *too_fine]


def _moves(pushed: FlatRow) -> str:
    return " or ".join(word for word, here in (("repel", pushed["alike"]), ("attract", pushed["opposite"])) if here)


def result_of(rows: Sequence[FlatRow]) -> Result:
    """Return the parts and checks of one sensor, or a row for each of several."""
    if len(rows) > 1:
        left_out = ("recipe", "beam_size_mm", "leads_below_base_mm")
        brief = [{name: value for name, value in row.items() if name not in left_out} for row in rows]
        brief = [row | {"parts": len(row["parts"]), "checks": len(row["checks"])} for row in brief]
        return Result(title="Folders", records=list(rows), shown=[Table(title="Folders", rows=brief)])
    (sensor,) = rows
    parts = Table(title=f"Parts in {sensor['folder']}, each .step .stl .3mf", rows=sensor["parts"])
    checks = [
        {"check": each["name"]} | {key: each[key] for key in ("value", "bound", "unit", "passed")}
        for each in sensor["checks"]
    ]
    shown: list[Block] = [
        *([parts] if sensor["parts"] else []),
        Table(title="Checks", rows=checks),
        *([casting_recipe.size_sentence(sensor)] if "beam_size_mm" in sensor else []),
        *([f"Start with {sensor['folder'] / RECIPE}."] if sensor["parts"] else []),
    ]
    said = {"warnings": sensor["warnings"], "failures": failure_of(rows)}
    return Result(title="Parts", records=list(rows), shown=shown, **said)
