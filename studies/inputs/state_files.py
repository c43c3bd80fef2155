"""Files of solved states for `--responses`: one line of `solve --json` or `analytic --json` for each state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from geometry import design_digest
from geometry.design import BadInput, Design
from geometry.loads import Load, Response
from studies.inputs import table_input
from studies.output import console


@dataclass(frozen=True, slots=True)
class State:
    """One line of the file.

    Attributes
    ----------
    line : number of the line, from 1.
    load, response : None if the solve failed and the line has no pose.
    """

    line: int
    status: str
    message: str
    load: Load | None
    response: Response | None


def read(path: Path, design: Design) -> list[State]:
    """Read the states in a file, which must have been solved for this design with a rigid magnet.

    If a line does not name its sensor, this cannot be checked: the states are accepted with a warning.
    """
    expected = design_digest.of_mechanics(design)
    states, all_named = [], True
    for line, record in table_input.json_objects(path):
        where = f"{path}, line {line}"
        try:
            state = _state(line, record)
        except BadInput as error:
            raise BadInput(f"{where}: {error}") from None
        except (ValueError, KeyError, TypeError):
            raise BadInput(
                f"{where} is not a state printed by `magtip solve --json`: it must contain status, depth_mm, "
                "shear_mm, force_N, "
                "shift_mm and tilt_rad"
            ) from None
        all_named = design_digest.check(record, expected, where) and all_named
        states.append(state)
    if not all_named:
        console.warn(
            f"{path} does not say for which sensor its states were solved, so a mismatch with this "
            "design cannot be detected"
        )
    return states


def _state(line: int, record: dict[str, Any]) -> State:
    status, message = str(record["status"]), str(record.get("message") or "")
    if status != "ok" and record.get("shift_mm") is None:
        return State(line, status, message, None, None)
    return State(line, status, message, *_load_and_response(record))


def _load_and_response(record: dict[str, Any]) -> tuple[Load, Response]:
    """Return load and response of a record; keys that the formulas do not print count as 0.

    A record without `friction`, of a table made by hand or by magtip 0.2, is of a plate that sticks in a shear.
    """
    x, y, z = (float(v) for v in record["shift_mm"])
    f_x, f_y, f_n = (float(v) for v in record["force_N"])
    friction, grip = record.get("friction"), record.get("grip_mm")
    load = Load(
        depth=float(record["depth_mm"]),
        shear_x=float(record["shear_mm"]),
        shear_y=float(record.get("shear_y_mm") or 0.0),
        friction=("stick" if friction is None else friction) if grip is None else "none",
        plate_tilt=float(record.get("plate_tilt_rad") or 0.0),
        imperfection=float(record.get("imperfection_N") or 0.0),
        grip=None if grip is None else float(grip),
    )
    tilt, tilt_y = float(record["tilt_rad"]), float(record.get("tilt_y_rad") or 0.0)
    radius = float(record.get("contact_radius_mm") or 0.0)
    numbers = (x, y, z, f_x, f_y, f_n, tilt, tilt_y)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not finite")
    return load, Response((f_x, f_y, f_n), (x, y, z), tilt, radius, tilt_y)
