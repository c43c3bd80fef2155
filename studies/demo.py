"""The demonstration: the paper's sensor from CAD to the comparison of formulas and finite elements, in a folder."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fem.accuracy import STANDARD, Accuracy
from fem.solution import Solution
from geometry.design import Design, paper
from geometry.loads import ANSWERED
from geometry.messages import Progress
from studies.fabrication import sensor_parts
from studies.mechanics.path_solver import LoadOutcome
from studies.output import atomic_files, result, vtk_files
from studies.output.provenance import made, versions
from studies.output.records import FlatRow
from studies.simulation import compare, comparison_findings, design_summary
from studies.simulation.compare import Comparison, part

PACKAGES = ("build123d", "trimesh", "pyvista", "pandas", "altair")
"""Packages whose versions the report names, besides those of the finite elements: solids, meshes, tables, plots."""

FILES = {
    "cad/": "beam, silicone, magnet, base and the mould's parts A and B, drawings, and the recipe (README.md); mm",
    "mesh.vtu": "curved tetrahedra of silicone (region 0) and magnet (region 1), mm",
    "press.vtu, shear.vtu": "the deepest press and the farthest shear: displacement and pressure",
    "press.csv, shear.csv": "all states: finite elements and formulas side by side, errors in %",
    "press.png, shear.png": "the same as plots",
    "press_section.png, shear_section.png": "the deformed sections",
}
WRITTEN = (
    *("REPORT.md", "cad/README.md", "mesh.vtu"),
    *(f"{load}{end}" for load in ("press", "shear") for end in (".vtu", ".csv", ".png", "_section.png")),
)
"""Files that `run` writes into its folder, with the one that tells of the sub-folder cad."""

MODELLING = (
    "The silicone is neo-Hookean, nearly incompressible and without hysteresis; E and nu hold at all strains.",
    "The magnet is rigid and bonded on all its faces; the pocket's second pour is silicone like the first.",
    "The base disc is clamped; the plate is flat, rigid and, in the press, free of friction.",
    "In a shear the contact area sticks to the pressed plate, which then moves sideways at constant depth.",
    (
        "The press is axisymmetric: on a frictionless plate this sensor buckles sideways shortly before 3 mm "
        "(`magtip stability paper` computes the depth): the deepest state needs a plate that holds the tip."
    ),
    "Skin that bulges below the base plane lies on it without friction; skin that folds onto itself passes through.",
    "Readings are the component of B that each Hall element senses, from the exact field of a sharp-edged cylinder.",
    "The paper does not give l_t: a uniform bar is assumed, so the magnet moves by H/L of the tip's displacement.",
    "The magnet's height also affects the press force: a taller magnet leaves less silicone above and below it.",
    "The paper does not give that height, so its own agreement with F(d) may be a coincidence.",
)

INTRODUCTION = (
    "Beam D = {D:g} mm, L = {L:g} mm, E = {E:g} MPa; magnet {magnet_diameter:g} x {magnet_height:g} mm. The formulas "
    "are equations (5) to (7) of Chathuranga et al. 2016. Errors are formula against finite elements; those of "
    "readings are in % of full scale (FS), the largest change from rest in these tables."
)


def run(
    folder: Path,
    *,
    accuracy: Accuracy = STANDARD,
    depths: Sequence[float] | None = None,
    shears: Sequence[float] | None = None,
    command: str = "",
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make, mesh and solve the paper's sensor, compare it with the formulas, and write all files into a folder.

    Parameters
    ----------
    folder : an existing folder.
    accuracy, depths, shears : as in `compare.run`.
    command : command line that the report repeats.
    progress : called with the fraction of the work that is done and the name of the current step.

    Returns
    -------
    "status" and "message" of the first step that failed, "summary" of the comparison, "parts", "checks" and "mesh".
    """
    design, show, origin = paper(), progress or _silent, made(command, versions(PACKAGES))
    cad = sensor_parts.build(design, folder / "cad", _part(show, 0.0, 0.15, "CAD"), command=command or "magtip cad")
    mesh = design_summary.build_mesh(design, folder / "mesh.vtu", None, _part(show, 0.15, 0.22, "mesh"))
    comparison = compare.run(design, accuracy=accuracy, progress=part(show, 0.22, 0.93), depths=depths, shears=shears)
    show(0.93, "tables and plots")
    result.write(dataclasses.replace(compare.result_of(design, comparison), design=None), folder, command)
    for name, states in (("press", comparison.pressed), ("shear", comparison.sheared)):
        show(0.95, f"picture: {name}")
        _write_last(folder, name, design, states)
    atomic_files.write_text(folder / "REPORT.md", document(design, comparison, cad, mesh, origin))
    show(1.0, "done")
    outcomes = [(cad["status"], cad["message"]), (mesh["status"], mesh["message"])]
    outcomes += [(row["status"], row["message"]) for row in comparison.press]
    outcomes += [(row["status"], row["message"]) for row in comparison.shear]
    status, message = next((outcome for outcome in outcomes if outcome[0] not in ANSWERED), ("ok", ""))
    return {
        "status": status,
        "message": message,
        "summary": comparison.summary,
        "parts": cad["parts"],
        "checks": cad["checks"],
        "mesh": mesh,
    }


def _silent(fraction: float, text: str) -> None:
    """Ignore the progress."""


def _part(show: Progress, low: float, high: float, name: str) -> Progress:
    """Return the progress of a step that takes the whole from `low` to `high`."""
    return part(show, low, high, name) or _silent


def _write_last(folder: Path, name: str, design: Design, states: Sequence[LoadOutcome]) -> None:
    """Write the last converged state as a .vtu file and as a picture of its section."""
    from studies.output.solution_pictures import section_picture

    reached: list[Solution] = [state.solution for state in states if state.solution is not None]
    if reached:
        vtk_files.write_field(folder / f"{name}.vtu", reached[-1])
        section_picture(folder / f"{name}_section.png", design, reached[-1])


# REPORT.md


def document(design: Design, comparison: Comparison, cad: FlatRow, mesh: FlatRow, origin: str) -> str:
    """Return the text of REPORT.md: findings, small tables, assumptions, parts and mesh, files, origin."""
    summary = comparison.summary
    press = [row for row in comparison.press if row["status"] in ANSWERED]
    shear = [row for row in comparison.shear if row["status"] in ANSWERED]
    blocks = [
        "# The paper's sensor: formulas against finite elements",
        INTRODUCTION.format(**dataclasses.asdict(design)),
        "## Press",
        _bullets(comparison_findings.sentences("press", summary)),
        _table(press[1::2] if len(press) > 6 else press, _PRESS_COLUMNS),
        "![Force, error, shift and reading against depth](press.png)",
        "## Shear",
        _bullets(comparison_findings.sentences("shear", summary)),
        _table(shear, _SHEAR_COLUMNS),
        "![Force, error, shift, tilt and readings against shear](shear.png)",
        "## How far to trust the finite elements",
        _bullets(comparison_findings.sentences("trust", summary)),
        "| pressed | sheared |\n|---|---|\n| ![pressed](press_section.png) | ![sheared](shear_section.png) |",
        "## What is assumed",
        "The paper does not give these values; change them with `--set NAME=VALUE`.",
        _assumed(design),
        _bullets(MODELLING),
        "## Parts, mould and mesh",
        _bullets(_part_lines(cad, mesh)),
        "## Files",
        _bullets([f"`{name}`: {text}" for name, text in FILES.items()]),
        "## How it was made",
        origin,
    ]
    return "\n\n".join(block for block in blocks if block) + "\n"


# full names of columns are too long for a report; column and format behind each heading
_PRESS_COLUMNS = {
    "depth (mm)": ("depth_mm", ".2f"),
    "F, FEM with magnet (N)": ("fem_force_N", ".2f"),
    "F, FEM all silicone (N)": ("fem_homogeneous_force_N", ".2f"),
    "F, paper (N)": ("analytic_force_N", ".2f"),
    "error with magnet (%)": ("force_error_percent", "+.0f"),
    "error all silicone (%)": ("homogeneous_force_error_percent", "+.0f"),
    "magnet sinks, FEM (mm)": ("fem_shift_z_mm", ".2f"),
    "paper (mm)": ("analytic_shift_z_mm", ".2f"),
    "S1 error (% FS)": ("analytic_S1_error_percent_FS", "+.0f"),
}
_SHEAR_COLUMNS = {
    "shear (mm)": ("shear_mm", ".2f"),
    "F, FEM with magnet (N)": ("fem_force_x_N", ".2f"),
    "F, FEM all silicone (N)": ("fem_homogeneous_force_x_N", ".2f"),
    "F, paper (N)": ("analytic_force_x_N", ".2f"),
    "error with magnet (%)": ("force_x_error_percent", "+.0f"),
    "error all silicone (%)": ("homogeneous_force_x_error_percent", "+.0f"),
    "S2 error, paper (% FS)": ("analytic_S2_error_percent_FS", "+.0f"),
    "S2 error, tilt left out (% FS)": ("untilted_S2_error_percent_FS", "+.1f"),
}


def _bullets(lines: Sequence[str]) -> str:
    return "\n".join(f"- {line}" for line in lines)


def _table(rows: Sequence[FlatRow], columns: Mapping[str, tuple[str, str]]) -> str:
    """Return a Markdown table; `columns` maps each heading to the row's column and the number format."""
    if not rows:
        return ""
    lines = [list(columns), ["---:"] * len(columns)]
    for row in rows:
        values = [(row[name], form) for name, form in columns.values()]
        lines.append([_number(value, form) for value, form in values])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _number(value: float, form: str) -> str:
    """Format a number: "" for NaN, and no sign for a zero.

    >>> _number(-0.001, "+.1f")
    '0.0'
    """
    text = "" if value != value else f"{value:{form}}"
    return text.lstrip("+-") if text and float(text) == 0 else text


def _assumed(design: Design) -> str:
    """Return a table of all values that the paper does not give; those without an effect in this design say why."""
    unused = design.unused_fields()
    assumed = [spec for spec in dataclasses.fields(design) if design_summary.origin(spec.name, design) == "assumed"]
    lines = ["| value | assumed | meaning |", "|---|---:|---|"]
    for spec in sorted(assumed, key=lambda spec: spec.name in unused):
        unit = "" if spec.metadata["unit"] == "1" else f" {spec.metadata['unit']}"
        value = design_summary.shown(getattr(design, spec.name))
        remark = f"; no effect here: {unused[spec.name]}" if spec.name in unused else ""
        lines.append(f"| {spec.name} | {value}{unit} | {spec.metadata['text']}{remark} |")
    return "\n".join(lines)


def _part_lines(cad: FlatRow, mesh: FlatRow) -> list[str]:
    """Return sentences on the parts, the mould and base, and the mesh."""
    parts, checks = cad["parts"], cad["checks"]
    passed = sum(check["passed"] for check in checks)
    lines = [f"Mould and base: {passed} of {len(checks)} checks passed."]
    if cad["status"] != "ok":
        lines.append(f"CAD: {cad['message']}")
    if parts:
        worst = max(abs(part["relative_error"]) for part in parts)
        lines.append(
            f"{len(parts)} parts, all watertight; their triangles miss the exact volumes by {worst:.1g} at most."
        )
    if mesh["status"] != "ok":
        return [*lines, f"Mesh: {mesh['message']}"]
    error = max(abs(value) for name, value in mesh.items() if name.endswith("_volume_error"))
    lines.append(
        f"Mesh: {mesh['cells']} tetrahedra of second order; volumes right to {error:.1g}; "
        f"least radius ratio {mesh['least_shape']:.2f}, mean {mesh['mean_shape']:.2f} (1 is best)."
    )
    return lines
