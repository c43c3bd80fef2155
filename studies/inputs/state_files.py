"""States of the sensor in a file, which `--responses` takes: a line each, of `solve --json` or `analytic --json`."""

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
    load, response : None where the state is not ok and has none.
    """

    line: int
    status: str
    message: str
    load: Load | None
    response: Response | None


def read(path: Path, design: Design) -> list[State]:
    """The states in a file, which were found for this design with a rigid magnet.

    A file that does not say for which sensor it was made is taken, with a warning.

    Raises
    ------
    BadInput
        The file cannot be read, a line is no state, or one was made for another sensor.
    """
    needed = design_digest.of_mechanics(design)
    found, told = [], True
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
        told = design_digest.check(record, needed, where) and told
        found.append(state)
    if not told:
        console.warn(
            f"{path} does not say for which sensor its states were solved, so a mismatch with this "
            "design cannot be detected"
        )
    return found


def _state(line: int, record: dict[str, Any]) -> State:
    status, message = str(record["status"]), str(record.get("message") or "")
    if status != "ok" and record.get("shift_mm") is None:
        return State(line, status, message, None, None)
    return State(line, status, message, *_sample(record))


def _sample(record: dict[str, Any]) -> tuple[Load, Response]:
    x, y, z = (float(v) for v in record["shift_mm"])
    f_x, f_y, f_n = (float(v) for v in record["force_N"])
    load = Load(
        depth=float(record["depth_mm"]),
        shear_x=float(record["shear_mm"]),
        shear_y=float(record.get("shear_y_mm") or 0.0),
        friction="stick",
        plate_tilt=float(record.get("plate_tilt_rad") or 0.0),
    )
    tilt, tilt_y = float(record["tilt_rad"]), float(record.get("tilt_y_rad") or 0.0)
    radius = float(record.get("contact_radius_mm") or 0.0)
    numbers = (x, y, z, f_x, f_y, f_n, tilt, tilt_y)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not finite")
    return load, Response((f_x, f_y, f_n), (x, y, z), tilt, radius, tilt_y)
