"""The demonstration: the paper's sensor from CAD to the comparison of formulas and finite elements, in a folder."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fem.accuracy import STANDARD, Accuracy
from fem.equilibrium import trace
from geometry.design import Design, paper
from geometry.loads import ANSWERED, Load
from geometry.messages import Progress
from studies.fabrication import sensor_parts
from studies.output import atomic_files, page_templates, result, vtk_files
from studies.output.provenance import made, versions
from studies.output.records import FlatRow
from studies.quantities import shown
from studies.simulation import compare, comparison_rows, design_summary
from studies.simulation.compare import Loads, part

PACKAGES = ("build123d", "trimesh", "pyvista", "pandas", "altair")
"""Packages whose versions the report names, besides those of the finite elements: solids, meshes, tables, plots."""

WRITTEN = (
    *("REPORT.md", "cad/README.md", "mesh.vtu"),
    *(f"{load}{end}" for load in ("press", "shear") for end in (".vtu", ".csv", ".png", "_section.png")),
)
"""Files that `run` writes into its folder, with the one that tells of the sub-folder cad."""


def run(
    folder: Path,
    *,
    accuracy: Accuracy = STANDARD,
    loads: Loads | None = None,
    command: str = "",
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make, mesh and solve the paper's sensor, compare it with the formulas, and write all files into a folder.

    The states come from the user's store and are kept there, as in `compare`. The store holds no deformed body: the
    last state of each load is solved again for its .vtu file and its section, without error estimates.

    Parameters
    ----------
    folder : an existing folder.
    accuracy, loads : as in `compare.run`.
    command : command line that the report repeats.
    progress : called with the fraction of the work that is done and the name of the current step.

    Returns
    -------
    "status" and "message" of the first step that failed, "summary" of the comparison, "parts", "checks" and "mesh".
    """
    design, show, origin = paper(), progress or _silent, made(command, versions(PACKAGES))
    cad = sensor_parts.build(design, folder / "cad", _part(show, 0.0, 0.15, "CAD"), command=command or "magtip cad")
    mesh = design_summary.build_mesh(design, folder / "mesh.vtu", None, _part(show, 0.15, 0.22, "mesh"))
    loads = loads or compare.default_loads(design)
    compared = compare.run(design, loads, accuracy=accuracy, progress=part(show, 0.22, 0.9))
    show(0.9, "tables and plots")
    result.write(dataclasses.replace(compared, design=None), folder, command)
    for name, path in zip(("press", "shear"), loads, strict=True):
        show(0.93, f"picture: {name}")
        states = [row["status"] for row in compared.tables[name]]
        _write_last(
            folder, name, design, accuracy, [load for load, s in zip(path, states, strict=True) if s in ANSWERED]
        )
    atomic_files.write_text(folder / "REPORT.md", document(design, compared.records[0], cad, mesh, origin) + "\n")
    show(1.0, "done")
    steps = [cad, mesh, *compared.tables["press"], *compared.tables["shear"]]
    failed = next((step for step in steps if step["status"] not in ANSWERED), None)
    return {
        "status": failed["status"] if failed else "ok",
        "message": failed["message"] if failed else "",
        "summary": compared.records[0]["summary"],
        "parts": cad["parts"],
        "checks": cad["checks"],
        "mesh": mesh,
    }


def _silent(fraction: float, text: str) -> None:
    """Report nothing."""


def _part(show: Progress, low: float, high: float, name: str) -> Progress:
    return part(show, low, high, name) or _silent


def _write_last(folder: Path, name: str, design: Design, accuracy: Accuracy, reached: Sequence[Load]) -> None:
    from studies.output.solution_pictures import section_picture

    if reached:
        last = trace(design, reached[-1:], accuracy, estimate=False)[-1]
        vtk_files.write_field(folder / f"{name}.vtu", last)
        section_picture(folder / f"{name}_section.png", design, last)


def document(design: Design, comparison: Mapping[str, Any], cad: FlatRow, mesh: FlatRow, origin: str) -> str:
    """Return the text of REPORT.md: findings, small tables, assumptions, parts and mesh, files, origin."""
    press, shear = ([row for row in comparison[name] if row["status"] in ANSWERED] for name in ("press", "shear"))
    unused, assumed = design.unused_fields(), []
    for spec in sorted(dataclasses.fields(design), key=lambda spec: spec.name in unused):
        if design_summary.origin(spec.name, design) == "assumed":
            unit = "" if spec.metadata["unit"] == "1" else f" {spec.metadata['unit']}"
            remark = f"; no effect here: {unused[spec.name]}" if spec.name in unused else ""
            value = shown(getattr(design, spec.name), digits=6, nothing="none")
            assumed.append((spec.name, f"{value}{unit}", f"{spec.metadata['text']}{remark}"))
    findings = {name: comparison_rows.sentences(name, comparison["summary"]) for name in ("press", "shear", "trust")}
    page = {"design": design, "assumed": assumed, "cad": cad, "mesh": mesh, "origin": origin}
    page |= {"findings": findings, "press": press[1::2] if len(press) > 6 else press, "shear": shear}
    return page_templates.rendered(Path(compare.__file__).with_name("templates") / "demo.md.j2", **page)
