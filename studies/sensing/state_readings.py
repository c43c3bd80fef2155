"""What the Hall elements read in each state of a file: what `magtip readings --responses` gives, a row for each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from geometry.design import BadInput, Design
from studies.inputs import state_files
from studies.inputs.state_files import State
from studies.output import console
from studies.sensing import field_readings
from studies.sensing.field_readings import Sensing

Row = dict[str, Any]

MOVED = ("depth_mm", "shear_mm", "shear_y_mm")
"""Keys that tell the states apart."""
SHOWN = ("status", *MOVED, "shift_mm", "rotation_rad", "readings_T", "readings_V", "output_T", "saturated")
"""Keys that a table shows unless it is wide."""


def of_states(design: Design, file: Path, sensing: Sensing) -> list[Row]:
    """A row for each state, in order, with the state's own status; without readings where it has no pose.

    Raises
    ------
    BadInput
        What `responses.read` refuses, no states, or a pose of the magnet in which there is no field to read.
    """
    found = state_files.read(file, design)
    if not found:
        raise BadInput(f"{file} contains no states: give the output of `magtip solve --json`")
    return [_row(design, state, sensing, f"{file}, line {state.line}") for state in found]


def _row(design: Design, state: State, sensing: Sensing, where: str) -> Row:
    row: Row = {"status": state.status, "message": state.message}
    if state.load is None or state.response is None:
        missing = dict.fromkeys((*SHOWN[1:], "tilt_rad", "tilt_y_rad"))
        return row | missing | {"warnings": []}
    load, response = state.load, state.response
    row |= dict(zip(MOVED, (load.depth, load.shear_x, load.shear_y), strict=True))
    try:
        return field_readings.at(design, response.shift, response.rotation, sensing) | row
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None


def show(rows: Sequence[Row], *, as_json: bool, wide: bool) -> None:
    """Print the rows, and on standard error what is wrong with their poses."""
    keys = list(dict.fromkeys([*SHOWN, *(key for row in rows for key in row if wide)]))
    printed = [row if as_json else {key: row.get(key) for key in keys} for row in rows]
    console.report(printed, as_json=as_json, title="Readings", first=SHOWN[:4], wide=wide)
    told = [{key: row[key] for key in MOVED} | {"message": text} for row in rows for text in row["warnings"]]
    for remark in console.remarks(told, MOVED, rows):
        console.warn(remark)
    failed = [row for row in rows if row["status"] != "ok"]
    if failed:
        console.say(f"magtip: {len(failed)} of {len(rows)} states failed; the last status is {failed[-1]['status']}")
