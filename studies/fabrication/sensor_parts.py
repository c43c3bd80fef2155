"""A design as things to make: solids, mould, checks, drawings, picture and recipe in one folder."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.messages import Progress
from studies.fabrication import casting_recipe
from studies.fabrication.sensor_solids import COLOURS, Making, Things, coloured, fineness, shaped, things
from studies.output import atomic_files, console
from studies.simulation import design_summary

if TYPE_CHECKING:
    from build123d import Solid

    from geometry.fabrication.printability import Check
    from geometry.fabrication.solid_files import Facets

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
) -> dict[str, Any]:
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
        record: dict[str, Any] = {"status": "ok", "message": "", "folder": folder, "parts": [], "checks": []}
        record |= design_summary.outer_record(design, made.plan)
        record["recipe"] = casting_recipe.facts(design, making)
        record["warnings"] = [*design.warnings(), *warnings(design, making, made)]
        try:
            progress(0.2, "triangles")
            shapes = shaped(design, making, made)
            progress(0.4, "checks")
            checks = examined(design, making, made, shapes)
            record["checks"] = [dataclasses.asdict(check) for check in checks]
            bad = [check for check in checks if not check.passed]
            if bad:
                raise RuntimeError(
                    f"check '{bad[0].name}' fails: {bad[0].value:.3g} {bad[0].unit}, must be {bad[0].bound}; "
                    "no file is written: change the design or the mould"
                )
            record["parts"] = _write(design, making, made, shapes, stage, progress)
        except RuntimeError as error:
            record["status"], record["message"] = "failed", str(error)
            return record
        if draw and made.plan:
            progress(0.8, "picture")
            try:
                (stage / PICTURE).write_bytes(draw(coloured(made), hall_bodies.places(design)))
            except RuntimeError as error:
                record["warnings"].append(f"no picture: {error}")
        record["warnings"] += left_over(folder, stage)
        drawn = PICTURE if (stage / PICTURE).exists() else ""
        atomic_files.write_text(stage / ALONE, casting_recipe.text(design, making, record, made.plan, drawn, command))
    return record


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
    found = mold_checks.checks(design, making.mold, made.A, made.B, halves)
    if made.plan:
        found += base.checks(design, made.sensor["base"], made.bodies)
    for name in ("base", *made.mold):
        if name in shapes:
            found += mold_checks.printable(name, shapes[name][1].mesh, making.mold.printing)
    return found


def _write(
    design: Design,
    making: Making,
    made: Things,
    shapes: Mapping[str, tuple[Solid, Facets]],
    stage: Path,
    progress: Progress,
) -> list[dict[str, Any]]:
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
    return [dataclasses.asdict(part) for part in exported]


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


def show(records: Sequence[Mapping[str, Any]], *, as_json: bool, wide: bool = False) -> None:
    """Print what was made: the parts and checks of one sensor, or a line for each of several; no warnings."""
    if as_json:
        console.report(records, as_json=True)
    elif len(records) == 1:
        _show_one(records[0], wide=wide)
    else:
        rows = [{**_brief(record), **{name: len(record[name]) for name in ("parts", "checks")}} for record in records]
        console.report(rows, as_json=False, title="Folders", wide=wide)


def _brief(record: Mapping[str, Any]) -> dict[str, Any]:
    """What a row of a table has room for."""
    return {
        key: value for key, value in record.items() if key not in ("recipe", "beam_size_mm", "leads_below_base_mm")
    }


def _show_one(record: Mapping[str, Any], *, wide: bool) -> None:
    if record["parts"]:
        title = f"Parts in {record['folder']}, each .step .stl .3mf"
        console.report(record["parts"], as_json=False, title=title, wide=wide)
    rows = [
        [check["name"], f"{check['value']:.3g}", check["bound"], check["unit"], "yes" if check["passed"] else "NO"]
        for check in record["checks"]
    ]
    console.table("Checks", ["check", "value", "bound", "unit", "passed"], rows)
    console.note(casting_recipe.size(record))
    if record["parts"]:
        console.note(f"Start with {Path(record['folder'], ALONE)}.")
