"""A design in numbers and as a mesh: the records of `magtip design` and `mesh`."""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry import design_digest
from geometry.design import BadInput, Design, paper
from geometry.messages import WARNING, Progress
from studies.output import atomic_files, console, records, vtk_files

if TYPE_CHECKING:
    from geometry.base import Plan


def origin(name: str, design: Design) -> str:
    """Where a field's value comes from: "paper", "assumed" (the paper leaves it open) or "changed"."""
    spec = next(spec for spec in dataclasses.fields(Design) if spec.name == name)
    if getattr(design, name) != getattr(paper(), name):
        return "changed"
    return "assumed" if spec.metadata["assumed"] else "paper"


def shown(value: float | str) -> str:
    """A field's value as a table shows it."""
    return value if isinstance(value, str) else f"{value:g}"


def design_record(design: Design) -> dict[str, Any]:
    """Every field, what follows from them, the names of the assumed ones, and warnings."""
    fields = dataclasses.asdict(design)
    derived, failed = derived_values(design)
    return {
        **fields,
        "derived": derived,
        "assumed": [
            name for name in fields if origin(name, design) == "assumed" and name not in design.unused_fields()
        ],
        "warnings": [*design.warnings(), *failed],
    }


def derived_values(design: Design) -> tuple[dict[str, Any], list[str]]:
    """Heights, volumes, outer size, places and readings at rest of the Hall elements; and why one is missing."""
    from analytic import hall
    from analytic.parts import of_design
    from geometry.base import Base, plan
    from geometry.cad import beam_volume, magnet_volume

    body, magnet = beam_volume(design.shape), magnet_volume(design.shape) if design.shape.has_magnet else 0.0
    positions, _ = hall.elements(design)
    places = dict(zip(("S1_mm", "S2_mm", "S3_mm"), positions.tolist(), strict=True))
    at_rest: dict[str, Any] = {"rest_readings_T": None, "rest_readings_V": None, "rest_saturated": None}
    failed: list[str] = []
    built = None
    try:
        built = plan(design, Base())
    except BadInput as error:
        failed.append(f"the size of the assembled sensor is unknown: {error}")
    try:
        seen = hall.readings(design)
        volts = list(seen.V) if set(seen.units) == {"V"} else None
        at_rest = dict(zip(at_rest, (list(seen.B_T), volts, list(seen.saturated)), strict=True))
        names = [element.name for element in of_design(design)]
        failed += [f"{name} is saturated at rest" for name, full in zip(names, seen.saturated, strict=True) if full]
    except BadInput as error:
        failed.append(f"the readings at rest are unknown: {error}")
    return {
        "H_mm": design.H,
        "tip_radius_mm": design.R,
        "wall_mm": design.shape.wall,
        "beam_volume_mm3": body,
        "magnet_volume_mm3": magnet,
        "silicone_volume_mm3": body - magnet,
        **records.flat(outer_size(design, built)),
        **places,
        **at_rest,
    }, failed


@dataclass(frozen=True, slots=True)
class OuterSize:
    """Outer size of the beam, and with base and Hall elements, (x, y, z) in mm; None without a plan of the base."""

    beam_size_mm: tuple[float, float, float]
    assembled_size_mm: tuple[float, float, float] | None
    leads_below_base_mm: float | None


def outer_size(design: Design, plan: Plan | None) -> OuterSize:
    """Outer size of a sensor on a base."""
    from geometry import base

    size, leads = base.outer_size(design, plan) if plan else (None, None)
    return OuterSize((design.D, design.D, design.L), size, leads)


def show(design: Design, *, as_json: bool) -> None:
    """Print a design."""
    record = design_record(design)
    if as_json:
        console.report([record], as_json=True)
        return
    rows = []
    for spec in dataclasses.fields(Design):
        unit = "" if spec.metadata["unit"] == "1" else spec.metadata["unit"]
        value = shown(getattr(design, spec.name))
        rows.append([spec.name, value, unit, origin(spec.name, design), spec.metadata["text"]])
    console.table("Design", ["field", "value", "unit", "source", "meaning"], rows)
    console.report([record["derived"]], as_json=False, title="Derived")
    for warning in record["warnings"]:
        console.note(f"{WARNING}{warning}")


def build_mesh(
    design: Design, out: Path, size: float | None, progress: Progress, *, half: bool = False
) -> dict[str, Any]:
    """Mesh the sensor, or the half of it at y >= 0, write the mesh, and measure it."""
    file = atomic_files.check_output_file(out, ".vtu")
    length = design.D / 8 if size is None else size
    if not 0.02 * design.D <= length <= design.D:
        raise BadInput(f"size must lie between D/50 = {0.02 * design.D:g} and D = {design.D:g} mm; got {length:g} mm")
    from geometry.mesh import tetrahedra

    with atomic_files.sole_writer(file):
        progress(0.0, "tetrahedra")
        begin = time.perf_counter()
        try:
            made = tetrahedra(
                design.shape, length, half=half, magnet="regions" if design.shape.has_magnet else "none"
            )
        except RuntimeError as error:
            return {"status": "failed", "message": str(error), "file": None, "size_mm": length}
        seconds = time.perf_counter() - begin
        vtk_files.write_mesh(file, made, design_digest.as_numbers(design_digest.of_solid(design.shape)))
    record = {"status": "ok", "message": "", "file": str(file), "size_mm": length, "seconds": seconds}
    return record | mesh_quality(made, design)


def mesh_quality(mesh: Any, design: Design) -> dict[str, Any]:
    """What a mesh of the design in mm is worth, under the names of the command line."""
    from geometry.meshing.mesh_quality import quality

    found = quality(mesh, design.shape)
    return {
        "cells": found.cells,
        "nodes": found.nodes,
        **{f"{name}_volume_mm3": value for name, value in found.volumes.items()},
        **{f"{name}_volume_error": value for name, value in found.volume_errors.items()},
        "base_error": found.base_error,
        "gap_mm": found.gap,
        "least_shape": found.least_shape,
        "mean_shape": found.mean_shape,
        "least_jacobian": found.least_jacobian,
    }
