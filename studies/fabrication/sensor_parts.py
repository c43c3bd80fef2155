"""A design as things to make: solids, mould, checks, drawings, picture and recipe in one folder."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.fabrication import casting_recipe
from studies.fabrication.fabrication_rows import FabricationRow
from studies.fabrication.sensor_solids import COLOURS, Making, Things, coloured, fineness, shaped, things
from studies.output import atomic_files, console
from studies.output.records import FlatRow
from studies.simulation import design_summary

if TYPE_CHECKING:
    from build123d import Solid

    from geometry.fabrication.printability import Check
    from geometry.fabrication.solid_files import Exported, Facets

PICTURE = "assembly.png"

ALONE = "README.md"
"""The file of a folder that is not replaced unless magtip wrote it."""


def build(
    design: Design,
    out: Path,
    progress: Progress,
    making: Making = Making(),
    *,
    picture: bool = True,
    command: str = "magtip cad",
) -> FabricationRow:
    """Make everything, check it, and write it all if every check passes; into `out`, whose other files stay.

    Parameters
    ----------
    picture : whether to draw one; it takes as long as all the rest of a design, beside it.
    command : that this is run by, for the recipe.

    Raises
    ------
    BadInput
        A choice is impossible, or the folder cannot be used.
    """
    from geometry import mold
    from geometry.fabrication import hall_bodies
    from studies.fabrication import assembly_picture

    mold.sizes(design, making.mold)
    fineness(design, making)
    with atomic_files.filled(out) as folder, atomic_files.staged(folder) as stage, contextlib.ExitStack() as stack:
        refuse_foreign(folder / ALONE)
        draw = stack.enter_context(assembly_picture.painter()) if picture else None
        progress(0.0, "solids and mould")
        console.load("build123d", "trimesh")
        made = things(design, making)
        size, recipe = design_summary.outer_size(design, made.plan), casting_recipe.recipe_of(design, making)
        begun = FabricationRow(
            "ok", "", folder, (), (), size, recipe, (*design.warnings(), *warnings(design, making, made))
        )
        try:
            progress(0.2, "triangles")
            shapes = shaped(design, making, made)
            progress(0.4, "checks")
            begun = dataclasses.replace(begun, checks=tuple(examined(design, making, made, shapes)))
            _refuse_failed(begun.checks)
            parts = tuple(_write(design, making, made, shapes, stage, progress))
        except RuntimeError as error:
            return dataclasses.replace(begun, status="failed", message=str(error))
        missing: list[str] = []
        if draw and made.plan:
            progress(0.8, "picture")
            try:
                (stage / PICTURE).write_bytes(draw(coloured(made), hall_bodies.places(design)))
            except RuntimeError as error:
                missing.append(f"no picture: {error}")
        row = dataclasses.replace(begun, parts=parts, warnings=(*begun.warnings, *missing, *left_over(folder, stage)))
        drawn = PICTURE if (stage / PICTURE).exists() else ""
        page = casting_recipe.text(design, making, row, recipe, size, made.plan, drawn, command)
        atomic_files.write_text(stage / ALONE, page)
    return row


def _refuse_failed(checks: Sequence[Check]) -> None:
    """Nothing is written of a sensor that fails a check."""
    for check in checks:
        if not check.passed:
            raise RuntimeError(
                f"check '{check.name}' fails: {check.value:.3g} {check.unit}, must be {check.bound}; "
                "no file is written: change the design or the mould"
            )


def names() -> list[str]:
    """The files of a folder, the recipe first; which of them there are depends on the design and its mould."""
    parts = [f"{name}.{suffix}" for name in COLOURS for suffix in ("step", "stl", "3mf")]
    return [ALONE, *parts, "assembly.step", "mold.step", PICTURE, "sensor.svg", "base.svg", "mold.svg"]


def left_over(folder: Path, stage: Path) -> list[str]:
    """A warning of files in the folder that an earlier run may have left, and that this one does not replace."""
    old = [name for name in names()[1:] if (folder / name).exists() and not (stage / name).exists()]
    return [f"{', '.join(old)} are from an earlier run, not of this sensor: delete them"] if old else []


def refuse_foreign(readme: Path) -> None:
    """A README.md that magtip did not write is somebody else's: it must not be replaced."""
    if readme.exists() and not readme.read_bytes().startswith(casting_recipe.MARK.encode()):
        raise BadInput(
            f"{str(readme)!r} was not written by magtip cad and would be overwritten: choose another folder"
        )


def examined(design: Design, making: Making, made: Things, shapes: Mapping[str, tuple[Solid, Facets]]) -> list[Check]:
    """All checks of mould, base and printing."""
    from geometry import base
    from geometry.fabrication import mold_checks

    halves = [part for name, part in made.mold.items() if name not in ("mold_a", "mold_b")]
    checks = mold_checks.checks(design, making.mold, made.A, made.B, halves)
    if made.plan:
        checks += base.checks(design, made.sensor["base"], made.bodies)
    for name in ("base", *made.mold):
        if name in shapes:
            checks += mold_checks.printable(name, shapes[name][1].mesh, making.mold.printing)
    return checks


def _write(
    design: Design,
    making: Making,
    made: Things,
    shapes: Mapping[str, tuple[Solid, Facets]],
    stage: Path,
    progress: Progress,
) -> list[Exported]:
    """All files but the recipe, into the stage; what was exported."""
    from geometry import mold
    from geometry.fabrication import solid_files
    from studies.fabrication import part_drawings

    progress(0.6, "STEP, STL and 3MF")
    exported = solid_files.export(shapes, stage, colours=COLOURS)
    closed = {name: (part, COLOURS[name]) for name, part in made.mold.items()}
    (stage / "mold.step").write_bytes(solid_files.step(solid_files.assembly("mold", closed)))
    progress(0.7, "drawings")
    s, pieces = mold.sizes(design, making.mold), [part for name, part in made.mold.items() if name != "mold_a"]
    atomic_files.write_text(stage / "mold.svg", part_drawings.mold_sheet(design, making.mold, s, made.A, pieces))
    if made.plan:
        (stage / "assembly.step").write_bytes(solid_files.step(solid_files.assembly("sensor", coloured(made))))
        for name, text in part_drawings.sheets(design, made.plan, made.sensor, made.bodies).items():
            atomic_files.write_text(stage / f"{name}.svg", text)
    return exported


def warnings(design: Design, making: Making, made: Things) -> list[str]:
    """What cannot be made, what a plate would meet, and what is finer than the process makes."""
    from geometry import base, mold

    s, process = mold.sizes(design, making.mold), making.mold.printing
    details = {"the pin": 2 * s.pin_radius, "a vent": s.vent_diameter, "B's wall": s.wall}
    fine = [
        f"{name} is {size:.3g} mm across; {process.name} printing makes {process.detail:g} mm at least"
        for name, size in details.items()
        if 0 < size < process.detail
    ]
    return [*(base.warnings(design) if made.plan else [made.missing]), *fine]


def show(fabricated: Sequence[FabricationRow], *, as_json: bool, wide: bool = False) -> None:
    """Print what was made: the parts and checks of one sensor, or a line for each of several; no warnings."""
    if as_json:
        console.report([each.row() for each in fabricated], as_json=True)
    elif len(fabricated) == 1:
        _show_one(fabricated[0], wide=wide)
    else:
        console.report([_brief(each) for each in fabricated], as_json=False, title="Folders", wide=wide)


def _brief(fabricated: FabricationRow) -> FlatRow:
    """What a row of a table has room for."""
    left_out = ("recipe", "beam_size_mm", "leads_below_base_mm")
    row = {name: value for name, value in fabricated.row().items() if name not in left_out}
    return row | {"parts": len(fabricated.parts), "checks": len(fabricated.checks)}


def _show_one(fabricated: FabricationRow, *, wide: bool) -> None:
    if fabricated.parts:
        title = f"Parts in {fabricated.folder}, each .step .stl .3mf"
        console.report(fabricated.row()["parts"], as_json=False, title=title, wide=wide)
    rows = [
        [check.name, f"{check.value:.3g}", check.bound, check.unit, "yes" if check.passed else "NO"]
        for check in fabricated.checks
    ]
    console.table("Checks", ["check", "value", "bound", "unit", "passed"], rows)
    if fabricated.size is not None:
        console.note(casting_recipe.size_sentence(fabricated.size))
    if fabricated.parts:
        console.note(f"Start with {fabricated.folder / ALONE}.")
