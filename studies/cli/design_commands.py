"""The verbs of an unloaded design: design, cad, mesh, and cache for the meshes that earlier versions kept."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import Literal

from geometry.messages import Progress
from studies.cli.parameters import AsJson, Sets, Source, Wide, design_of
from studies.cli.printed_command import command
from studies.inputs import user_input
from studies.inputs.input_warnings import say_no_effect
from studies.output import atomic_files
from studies.output.result import Destination, Result, failure_of, publish, show


def design(source: Source, /, *, sets: Sets = None, as_json: AsJson = False) -> int:
    """Show every value of a design with its source, derived values, assumptions and warnings."""
    from studies.simulation import design_summary

    return show(design_summary.study(user_input.read_design(source, sets or [])), Destination(as_json=as_json))


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
    silicone: str | None = None,
    sets: Sets = None,
    wide: Wide = False,
    as_json: AsJson = False,
) -> int:
    """Make and check solids, a printable mould and base, an assembly, drawings and a casting recipe.

    Parts are written as .step, .stl and .3mf; start with README.md in the folder.

    Parameters
    ----------
    out
        Output folder.
    process
        Printing with filament (fdm) or resin (sla); it sets the defaults of fits and walls.
    mold
        Setting of the mould, KEY=VALUE, such as shrink=0.01, columns=3, split=1 or marks=1 (letters);
        repeatable.
    base
        Setting of the base: square or round, or KEY=VALUE, such as outer=16, recess=0.4, screw=0 or marks=1 (grooves
        at +x and +y); repeatable.
    axis
        Values NAME=a,b,c of D, L, f (mm) or E (MPa): one folder for each combination, without picture; repeatable.
    tolerance
        Largest distance of the STL's facets from the surface, mm; default: D/2000.
    silicone
        Name of a silicone of the shipped catalogue, such as "Sylgard 184", whose mix and cure the recipe then states;
        default: the recipe refers to the data sheet.
    """
    command_line = command(cad, locals())
    from studies.fabrication import design_variants, sensor_parts, sensor_solids

    design = design_of(source, sets)
    atomic_files.check_apart(atomic_files.inside(out, sensor_parts.names()), [source])
    from studies.sizing import catalogues

    mix = None if silicone is None else catalogues.silicone_of(silicone)
    choices = sensor_solids.parse_fabrication_choices(process, mold or [], base or [], tolerance, mix)
    axes = design_variants.axes_of(axis or [])
    for name, reason in design_variants.idle(design, axes):
        say_no_effect(f"axis {name}", reason)

    def study(progress: Progress) -> Result:
        if not axes:
            return sensor_parts.result_of([sensor_parts.build(design, out, progress, choices, command=command_line)])
        made = list(design_variants.batch(design, axes, out, progress, choices, command=command_line))
        said, lost = design_variants.sentences_of(made), any(each.status != "ok" for each in made)
        found = dataclasses.replace(sensor_parts.result_of(made), warnings=(), failures=())
        return dataclasses.replace(found, failures=said) if lost else dataclasses.replace(found, remarks=said)

    return publish(study, Destination(as_json=as_json, wide=wide))


def mesh(
    source: Source,
    /,
    *,
    out: Path,
    size: float | None = None,
    half: bool = False,
    mesher: Literal["revolved", "pytetwild"] = "revolved",
    sets: Sets = None,
    as_json: AsJson = False,
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

    design = design_of(source, sets)
    atomic_files.check_apart([out], [source])

    def study(progress: Progress) -> Result:
        record = design_summary.build_mesh(design, out, size, progress, half=half, mesher=mesher).row()
        return Result(title="Mesh", records=[record], failures=failure_of([record]))

    return publish(study, Destination(as_json=as_json))


def cache(*, clear: bool = False, as_json: AsJson = False) -> int:
    """Show the meshes that earlier versions kept on disk (environment: MAGTIP_CACHE). This version keeps none.

    Parameters
    ----------
    clear
        Delete these meshes.
    """
    import platformdirs

    chosen = os.environ.get("MAGTIP_CACHE", "")
    folder = Path(chosen) if chosen else platformdirs.user_cache_path("magtip", appauthor=False)
    files = [file for file in folder.glob("*.mesh") if file.is_file()] if chosen.lower() != "off" else []
    if clear:
        for file in files:
            file.unlink(missing_ok=True)
        files = []
    record = {
        "folder": chosen.lower() if chosen.lower() == "off" else folder,
        "files": len(files),
        "size_MB": sum(file.stat().st_size for file in files) / 1e6,
        "limit_MB": 0.0,
    }
    return show(Result(title="Cache of meshes", records=[record]), Destination(as_json=as_json))
