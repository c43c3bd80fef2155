"""What the store holds of a solution and of a vibrating sensor, as JSON, and what comes back for a similar design.

A solution keeps all its numbers; the deformed body is not among them. A vibrating sensor keeps the small systems of
its reduced bases, some tens of kB to some MB, from which its motion at every frequency follows.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fem.accuracy import longer_edges
from fem.scene import Scene
from fem.solution import Estimates, Facts, Solution, Stability
from geometry.loads import Load, Response
from geometry.relaxation import relaxation_of
from studies.quantities import stored_parts

if TYPE_CHECKING:
    from fem.analyses.vibration import ReducedBlock, VibratingSensor

ESTIMATED = ("force", "shift", "tilt", "sideways", "contact_radius")
"""Quantities of a state whose estimated errors are stored, beside those of `stored_parts`."""
OF_SOLUTION = ("model", "energy", "dofs", "newton_iterations", "dissipated", "slip_share", "radius_from")
"""Attributes of a solution that are stored beside its response, facts and estimates."""


def recorded(solution: Solution) -> dict[str, Any]:
    """Return all of a solution but its field, as JSON; lengths in mm and energies in mJ are those of its design."""
    estimates, facts = solution.estimates, dataclasses.asdict(solution.facts)
    estimated = (*ESTIMATED, *(part.estimate for part in stored_parts() if part.estimate))
    rest = {"facts": facts, "estimates": dataclasses.asdict(estimates)}
    return {
        "response": dataclasses.asdict(solution.response),
        "error_estimate": estimates.force,
        "message": solution.message,
        "estimates": {name: getattr(estimates, name) for name in estimated},
        "solution": {name: getattr(solution, name) for name in OF_SOLUTION} | rest,
    }


def restored(
    record: Mapping[str, Any], load: Load, length: float, E: float, direction: tuple[float, float] = (1.0, 0.0)
) -> Solution:
    """Return the solution that was recorded, without its field and time, for a similar design under its load.

    length, E : D and modulus of this design over those of the one that was solved.
    direction : unit vector to which the shear is turned, from x.
    """
    values: dict[str, Any] = dict(record["solution"])
    facts: dict[str, Any] = {
        name: tuple(each) if isinstance(each, list) else each for name, each in values.pop("facts").items()
    }
    facts["stability"] = Stability(**facts["stability"])
    if facts["onset_mm"]:
        facts["onset_mm"] = tuple(length * one for one in facts["onset_mm"])
    facts["critical_depth"] = facts["critical_depth"] and length * facts["critical_depth"]
    response = Response.restored(record["response"]).scaled(length, E * length**2)
    values |= {name: E * length**3 * values[name] for name in ("energy", "dissipated")}
    return Solution(
        load=load,
        response=turned(response, direction),
        seconds=0.0,
        facts=Facts(**facts),
        message=record["message"],
        estimates=Estimates(**values.pop("estimates")),
        **values,
    )


def of_similar(message: str, D: float, solved_D: float) -> str:
    """Return the message of an answer for a design of another diameter, mm: its lengths are those of the solve."""
    return f"solved at D = {solved_D:g} mm: {message}" if message and solved_D != D else message


def turned(response: Response, direction: tuple[float, float]) -> Response:
    """Return a response turned from x to a direction, a unit vector."""
    if direction == (1.0, 0.0):
        return response
    c, s = direction
    (fx, fy, fz), (x, y, z) = response.force, response.shift
    return replace(
        response,
        force=(c * fx - s * fy, s * fx + c * fy, fz),
        shift=(c * x - s * y, s * x + c * y, z),
        tilt=c * response.tilt - s * response.tilt_y,
        tilt_y=s * response.tilt + c * response.tilt_y,
    )


# Vibrating sensors


def recorded_sensor(sensor: VibratingSensor) -> dict[str, Any]:
    """Return what `restored_sensor` takes."""
    design, coarser = sensor.scene.design, sensor.coarser
    return {
        "D_mm": design.D,
        "E_MPa": design.E_now,
        "state": recorded(sensor.state),
        "blocks": [_plain(dataclasses.asdict(block)) for block in sensor.reduced_blocks],
        "errors_below": sensor.errors_below.tolist(),
        "coarser": None if coarser is None else recorded_sensor(coarser),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def restored_sensor(
    record: Mapping[str, Any], scene: Scene, load: Load, band: tuple[float, float]
) -> VibratingSensor:
    """Return the sensor that was recorded, for a similar design.

    scene, load : of `fem.analyses.vibration.vibrating_scene`, and its load.
    band : lowest and highest frequency, Hz.
    """
    from fem.analyses.vibration import VibratingSensor

    coarse = replace(scene, accuracy=longer_edges(scene.accuracy))
    coarser = record["coarser"] and restored_sensor(record["coarser"], coarse, load, band)
    design = scene.design
    state = restored(record["state"], load, design.D / record["D_mm"], design.E_now / record["E_MPa"])
    blocks = tuple(_block(block) for block in record["blocks"])
    errors = np.array(record["errors_below"])
    return VibratingSensor(scene, state, relaxation_of(design), band, blocks, errors, coarser)


def _block(record: Mapping[str, Any]) -> ReducedBlock:
    from fem.analyses.vibration import ContactPressure, ReducedBlock
    from fem.solve.reduced_basis import SmallSystem

    def arrays(values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: np.array(value) for name, value in values.items()}

    held, pressure = record["held"], record["pressure"]
    return ReducedBlock(
        motions=tuple(record["motions"]),
        held=None if held is None else np.array(held),
        small=SmallSystem(**arrays(record["small"])),
        pressure=None if pressure is None else ContactPressure(**arrays(pressure)),
        **arrays({name: record[name] for name in ("pose", "undamped")}),
        **{name: record[name] for name in ("factorisations", "error")},
    )
