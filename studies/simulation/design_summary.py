"""Values that follow from a design, and its mesh: the records of `magtip design` and `magtip mesh`."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from geometry import design_digest
from geometry.bad_input import MeshError
from geometry.base import Base
from geometry.design import BadInput, Design, paper
from geometry.messages import WARNING, Progress
from studies.output import atomic_files, vtk_files
from studies.output.records import FlatRow
from studies.output.result import Block, Result, Table
from studies.quantities import shown

if TYPE_CHECKING:
    from geometry.array_design import ArrayDesign
    from geometry.base import ArrayPlan, Plan


def origin(name: str, design: Design) -> str:
    """Return where a field's value comes from: "paper", "assumed" (the paper leaves it open) or "changed"."""
    spec = next(spec for spec in dataclasses.fields(Design) if spec.name == name)
    if getattr(design, name) != getattr(paper(), name):
        return "changed"
    return "assumed" if spec.metadata["assumed"] else "paper"


def study(
    design: Design,
    base: Base = Base(),
    process: str | None = None,
    rated: tuple[float, float] | None = None,
    array: ArrayDesign | None = None,
    *,
    loaded: bool = False,
) -> Result:
    """Return every value of a design with its source, derived values, assumptions and warnings.

    Parameters
    ----------
    process : that prints the base, if a file states one; the record has it then. None: no file does, and it is fdm.
    rated : required press force and force along the plate, N; None: none are stated.
    array : of such beams, about which a table is added; None: a single sensor.
    loaded : whether finite elements solve for the loaded beam where the store lacks it.
    """
    from analytic.parts import average_warnings
    from geometry.base import plan
    from geometry.fabrication.hall_elements import ShortOfBase
    from studies.mechanics import store as stores
    from studies.simulation import loaded_clearance

    failures: list[str] = []
    base_plan, base_limits_l0 = None, False
    # a design can have a field at the elements but no base that carries them, and the reverse
    try:
        base_plan = plan(design, base, process or "fdm")
    except BadInput as error:
        failures.append(f"the size of the assembled sensor is unknown: {error}")
        base_limits_l0 = isinstance(error, ShortOfBase)
    whole: ArrayPlan | None = None
    found: FlatRow = {}
    beams: list[FlatRow] = []
    if array is not None:
        whole, found, beams, lost = of_array(array, base, process or "fdm")
        failures += lost
    derived, unknown = derived_values(design, whole.one if whole else base_plan, whole)
    derived |= {"process_of_base": process} if process else {}
    gap = None
    if base_plan:
        with stores.opened(None, said=not loaded) as store:
            gap = loaded_clearance.least_gap(design, whole.one if whole else base_plan, store, rated, solve=loaded)
    derived |= {"loaded_gap_mm": gap and gap.value, "loaded_gap_error_mm": gap and gap.error}
    failures += unknown
    said = loaded_clearance.room(gap)
    if gap and gap.why == loaded_clearance.UNSOLVED:
        said = [f"Whether the beam touches what stands beside it under {gap.load} is not solved yet: add --loaded."]
    else:
        failures += loaded_clearance.warning(gap)
    specs = dataclasses.fields(Design)
    unused = design.unused_fields()
    assumed = [spec.name for spec in specs if origin(spec.name, design) == "assumed" and spec.name not in unused]
    # a base asks for more room over the elements than the beam does: one limit of l0, the larger one
    warnings = [*design.warnings(base_limits_l0=base_limits_l0), *average_warnings(design), *failures]
    rows = []
    for spec in specs:
        unit = "" if spec.metadata["unit"] == "1" else spec.metadata["unit"]
        value = shown(getattr(design, spec.name), digits=6, nothing="none")
        source = "unused" if spec.name in unused else origin(spec.name, design)
        row = {"field": spec.name, "value": value, "unit": unit, "source": source, "meaning": spec.metadata["text"]}
        rows.append(row)
    return Result(
        title="Design",
        records=[
            dataclasses.asdict(design)
            | {"derived": derived, "assumed": assumed, "warnings": warnings}
            | ({"array": found | {"beams": beams}} if array is not None else {})
        ],
        shown=[
            Table(title="Design", rows=rows, first=tuple(rows[0])),
            Table(title="Derived", rows=[derived]),
            *_shown_array(found, beams),
            *said,
            *(f"{WARNING}{warning}" for warning in warnings),
        ],
    )


def _shown_array(found: FlatRow, beams: Sequence[FlatRow]) -> list[Block]:
    if not found:
        return []
    said = "The tables of the design and of what derives from it, but the assembled size, are of one beam by itself."
    if "critical_pitch_mm" in found:
        critical = found["critical_pitch_mm"]
        snap = "At no pitch from D on do" if math.isnan(critical) else f"Below a pitch of {critical:.4g} mm"
        said = f"{snap} the magnets of neighbours snap together. {said}"
    return [Table(title="Array", rows=[found]), Table(title="Beams", rows=beams), said]


def of_array(
    array: ArrayDesign, choices: Base, process: str
) -> tuple[ArrayPlan | None, FlatRow, list[FlatRow], list[str]]:
    """Return the plan of an array's base, what it is as a whole, a row for each beam, and sentences of what fails.

    base_size_mm : sides of the one base, None where there is none.
    neighbours_mT : largest field of the other magnets at an element at rest, which taring takes off.
    magnets_N, magnets_shift_mm : largest force of the others on a magnet at rest, and how far that shifts it.
    margin, critical_pitch_mm : stiffness left over that of a beam, and the pitch at which it is 0; as all that the
        magnets do, left out without magnets.
    """
    from analytic import beam_arrays
    from analytic.inverse.forward_model import model
    from geometry.base import array_plan

    said, whole = [], None
    try:
        whole = array_plan(array, choices, process)
    except BadInput as error:
        said.append(f"there is no base for the whole array: {error}")
    found: FlatRow = {"pitch_mm": array.pitch, "base_size_mm": list(whole.sides) if whole else None}
    beams: list[FlatRow] = [{"beam": k, "x_mm": x, "y_mm": y} for k, (x, y) in enumerate(array.places.tolist(), 1)]
    if not array.design.shape.has_magnet:
        return whole, found, beams, said
    laid = beam_arrays.of_array(model(array.design), array)
    rest, critical = beam_arrays.rest(laid), beam_arrays.critical_pitch(laid)
    stray = beam_arrays.readings_of_array(laid, np.zeros((1, len(array), 3)), own=False)[0]
    if not rest.margin > 0:
        said.append(
            f"the magnets of neighbours snap together at a pitch of {array.pitch:g} mm: take more than "
            f"{critical:.4g} mm"
        )
    if inside := laid.obstructed():
        said.append(
            f"{inside} lies inside the beam of a neighbour at a pitch of {array.pitch:g} mm: take a larger one"
        )
    forces, shifts = (np.linalg.norm(each, axis=1) for each in (rest.force, rest.shift))
    found |= {
        "critical_pitch_mm": critical,
        "margin": rest.margin,
        "neighbours_mT": 1e3 * float(np.abs(stray).max()),
        "magnets_N": float(forces.max()),
        "magnets_shift_mm": float(shifts.max()),
    }
    for k, row in enumerate(beams):
        row |= {
            "north": array.of_beam(k).magnet_north,
            "neighbours_mT": 1e3 * float(np.abs(stray[k]).max()),
            "magnets_N": float(forces[k]),
            "magnets_shift_mm": float(shifts[k]),
        }
    return whole, found, beams, said


def derived_values(
    design: Design, base_plan: Plan | None, whole: ArrayPlan | None = None
) -> tuple[FlatRow, list[str]]:
    """Return the derived values, and a sentence for each that is unknown or whose element is saturated.

    H_mm : height of the magnet's centre above the base plane.
    wall_mm : thickness of the silicone beside the magnet; None without a magnet.
    S1_mm, S2_mm, S3_mm : positions of the Hall elements.
    rest_readings_T, rest_readings_V, rest_saturated : one value for each element without a load; None if the field
        at an element is unknown, and no volts for a chip.
    hall_part, hall_range, hall_step, hall_noise, hall_reading_noise : the Hall part in use; full scale on both sides
        of the null, step and noise of one value, and noise of a reading, V, or T for a chip; None if unknown.
    magnets_apart_mm : distance of the axes from which two such magnets side by side, as in neighbouring cavities,
        stay where they are put; None without a magnet.
    """
    from analytic import hall
    from analytic.magnet import resting_distance
    from analytic.parts import of_design
    from geometry.cad import beam_volume, magnet_volume

    body, magnet = beam_volume(design.shape), magnet_volume(design.shape) if design.shape.has_magnet else 0.0
    positions, _ = hall.elements(design)
    failures: list[str] = []
    rest = None
    try:
        rest = hall.readings(design)
        names = [element.name for element in of_design(design)]
        failures += [f"{name} is saturated at rest" for name, full in zip(names, rest.saturated, strict=True) if full]
    except BadInput as error:
        failures.append(f"the readings at rest are unknown: {error}")
    derived = {
        "H_mm": design.H,
        "tip_radius_mm": design.R,
        "wall_mm": design.shape.wall,
        "beam_volume_mm3": body,
        "magnet_volume_mm3": magnet,
        "silicone_volume_mm3": body - magnet,
        **outer_size(design, base_plan, whole),
        **{f"S{k}_mm": position for k, position in enumerate(positions.tolist(), 1)},
        "rest_readings_T": rest and list(rest.B_T),
        "rest_readings_V": list(rest.V) if rest is not None and set(rest.units) == {"V"} else None,
        "rest_saturated": rest and list(rest.saturated),
        **hall_part(design),
        "magnets_apart_mm": resting_distance(design),
    }
    return derived, failures


def hall_part(design: Design) -> FlatRow:
    """Return what is in use of the Hall part, see `derived_values`."""
    from analytic.parts import of_design

    element = of_design(design)[0]
    chip = element.unit == "T"
    many = f"{design.chip_count:g} x " if design.chip_count > 1 else ""
    unit, known = element.unit, element.noise > 0 or element.floor > 0
    return {
        "hall_part": f"{many}{design.chip.name}, {'3-axis chips' if many else 'a 3-axis chip'}"
        if chip
        else "three one-axis elements",
        f"hall_range_{unit}": (element.low - element.null, element.high - element.null),
        f"hall_step_{unit}": element.step,
        f"hall_noise_{unit}": element.noise if known else None,
        f"hall_reading_noise_{unit}": element.noise_T * element.gain if known else None,
    }


def outer_size(design: Design, plan: Plan | None, whole: ArrayPlan | None = None) -> FlatRow:
    """Return the outer sizes (x, y, z), mm, of the beam alone and of the sensor on its base, and the length of the
    Hall elements' leads below the base; None without a `plan` of the base. That of an array is that of `whole`.
    """
    from geometry import base

    size, leads = base.outer_size(design, plan, whole) if plan else (None, None)
    return {
        "beam_size_mm": (design.D, design.D, design.L),
        "assembled_size_mm": size,
        "leads_below_base_mm": leads,
    }


def build_mesh(
    design: Design,
    out: Path,
    size: float | None,
    progress: Progress,
    *,
    half: bool = False,
    mesher: Literal["revolved", "pytetwild"] = "revolved",
) -> FlatRow:
    """Mesh the sensor, or its half at y >= 0, write the mesh to a .vtu file and measure its quality.

    size : edge length away from small features, mm; default: D/8.
    """
    file = atomic_files.check_output_file(out, ".vtu")
    length = design.D / 8 if size is None else size
    if not 0.02 * design.D <= length <= design.D:
        raise BadInput(f"size must lie between D/50 = {0.02 * design.D:g} and D = {design.D:g} mm; got {length:g} mm")
    if mesher == "revolved":
        length = min(length, design.R / 2)  # longer ones are not made, see geometry.mesh
    from geometry.mesh import MagnetCells, tetrahedra
    from geometry.meshing.mesh_import import by_pytetwild
    from geometry.meshing.mesh_quality import quality

    with atomic_files.sole_writer(file):
        progress(0.0, "tetrahedra")
        begin = time.perf_counter()
        try:
            if mesher == "pytetwild":
                mesh = by_pytetwild(design.shape, length, half=half)
            else:
                parts: MagnetCells = "regions" if design.shape.has_magnet else "none"
                mesh = tetrahedra(design.shape, length, half=half, magnet=parts)
        except MeshError as error:
            return {"status": "failed", "message": str(error), "file": None, "size_mm": length}
        seconds = time.perf_counter() - begin
        vtk_files.write_mesh(file, mesh, design_digest.as_numbers(design_digest.of_solid(design.shape)))
    found = quality(mesh, design.shape)
    return {
        "status": "ok",
        "message": "",
        "file": str(file),
        "size_mm": length,
        "seconds": seconds,
        **{name: found[name] for name in ("cells", "nodes")},
        **{f"{name}_volume_mm3": value for name, value in found["volumes"].items()},
        **{f"{name}_volume_error": value for name, value in found["volume_errors"].items()},
        "base_error": found["base_error"],
        "gap_mm": found["gap"],
        **{name: found[name] for name in ("least_shape", "mean_shape", "least_jacobian")},
    }
