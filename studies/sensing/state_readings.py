"""Readings of the Hall elements in each state of a file: the rows of `magtip readings --responses`."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from geometry.design import BadInput, Design
from geometry.loads import ANSWERED
from studies.inputs import state_files
from studies.inputs.state_files import State
from studies.output import console, records
from studies.output.records import FlatRow
from studies.output.result import Result, Table
from studies.sensing import field_readings
from studies.sensing.field_readings import PoseReadings, Sensing

MOVED = ("depth_mm", "shear_mm", "shear_y_mm")
"""Columns that distinguish the states of a path."""
SHOWN = ("status", *MOVED, "shift_mm", "rotation_rad", "readings_T", "readings_V", "output_T", "saturated")
"""Columns of a table that is not wide."""


@dataclass(frozen=True, slots=True)
class StateReadings:
    """Readings in one state, with the status and the message of the state itself.

    Attributes
    ----------
    readings : None if the state has no pose.
    resolution_N : standard deviations of the force along x, y and z that the noise of the readings causes; None if
        the elements have no noise, or if the states do not determine the mechanics (see `resolutions`).
    resolution_N_per_N : the same over the size of the force; None without a force.
    """

    readings: PoseReadings | None = field(metadata={"prefix": ""})
    status: str
    message: str
    depth_mm: float | None = None
    shear_mm: float | None = None
    shear_y_mm: float | None = None
    resolution_N: list[float] | None = None
    resolution_N_per_N: list[float] | None = None

    @property
    def warnings(self) -> list[str]:
        """Saturated elements and collisions, in sentences."""
        return [] if self.readings is None else self.readings.warnings

    def row(self) -> FlatRow:
        """Return the flat row for tables and JSON."""
        if self.readings is not None:
            return records.flat(self)
        missing = dict.fromkeys((*SHOWN[1:], "tilt_rad", "tilt_y_rad", "resolution_N", "resolution_N_per_N"))
        return {"status": self.status, "message": self.message} | missing | {"warnings": []}


def of_states(design: Design, file: Path, sensing: Sensing) -> list[StateReadings]:
    """Return the readings of each state, in the order of the file.

    Raises
    ------
    BadInput
        `state_files.read` refuses the file, the file contains no states, or the field at a pose is unknown.
    """
    states = state_files.read(file, design)
    if not states:
        raise BadInput(f"{file} contains no states: give the output of `magtip solve --json`")
    read = [_read_state(design, state, sensing, f"{file}, line {state.line}") for state in states]
    known = resolutions(design, states, sensing)
    return [
        dataclasses.replace(one, resolution_N=known[k][0], resolution_N_per_N=known[k][1]) if k in known else one
        for k, one in enumerate(read)
    ]


def resolutions(
    design: Design, states: Sequence[State], sensing: Sensing
) -> dict[int, tuple[list[float], list[float] | None]]:
    """Return the force resolution of states by their index: along x, y and z, N, and over the size of the force.

    The force between the states follows from polynomials that are fitted to all converged states. The result is empty
    if these contain no presses or no shears, if an element has no noise or lies inside the beam, or if the field is
    not the exact one.
    """
    import numpy as np

    from analytic import force_resolution, parts
    from analytic.inverse import forward_model, response_surface

    if sensing.level != "exact" or not all(element.noise_T for element in parts.of_design(design)):
        return {}
    samples = {
        k: (state.load, state.response)
        for k, state in enumerate(states)
        if state.status in ANSWERED and state.load is not None and state.response is not None
    }
    try:
        law = response_surface.of_samples(samples.values())
        forward = forward_model.model(design, law.tau, mode=sensing.mode)
    except BadInput:
        return {}
    responses = [response for _, response in samples.values()]
    sigma = force_resolution.at_shifts(forward, law, np.array([response.shift for response in responses]))
    sizes = [math.hypot(*response.force) for response in responses]
    return {
        k: (line.tolist(), (line / size).tolist() if size else None)
        for k, line, size in zip(samples, sigma, sizes, strict=True)
    }


def _read_state(design: Design, state: State, sensing: Sensing, where: str) -> StateReadings:
    """Return the readings of one state; `where` names its line in messages."""
    if state.load is None or state.response is None:
        return StateReadings(None, state.status, state.message)
    load, response = state.load, state.response
    try:
        readings = field_readings.read_pose(design, response.shift, response.rotation, sensing)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    return StateReadings(readings, state.status, state.message, load.depth, load.shear_x, load.shear_y)


def study(design: Design, file: Path, sensing: Sensing, *, wide: bool) -> Result:
    """Return the result of `of_states`; it has failed if no state was reached."""
    states = of_states(design, file, sensing)
    rows = [state.row() for state in states]
    extra = ["resolution_N"] if any(state.resolution_N for state in states) else []
    keys = list(dict.fromkeys([*SHOWN, *extra, *(key for row in rows for key in row if wide)]))
    shown = [{key: row.get(key) for key in keys} for row in rows]
    messages = [
        {key: row[key] for key in MOVED} | {"message": warning}
        for state, row in zip(states, rows, strict=True)
        for warning in state.warnings
    ]
    failed = [state for state in states if state.status not in ANSWERED]
    said = [f"{len(failed)} of {len(states)} states failed; the last status is {failed[-1].status}"] if failed else []
    lost = len(failed) == len(states)
    return Result(
        title="Readings",
        records=rows,
        shown=[Table(title="Readings", rows=shown, first=SHOWN[:4])],
        warnings=console.remarks(messages, MOVED, rows),
        remarks=[] if lost else said,
        failures=said if lost else [],
    )
