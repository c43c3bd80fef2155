"""The field at points from a table, and the readings of a pose: what `magtip field` and `magtip readings` give."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.design import BadInput, Design
from geometry.loads import tilts_of
from studies.inputs import input_warnings, table_input, user_input
from studies.inputs.option_groups import FieldLevel, Pose
from studies.output import atomic_files

if TYPE_CHECKING:
    import numpy as np

    from analytic.hall import Mode, Readings
    from geometry.arrays import Array


PLACES = ["x_mm", "y_mm", "z_mm"]
FOUND = ["Bx_T", "By_T", "Bz_T"]

Vector = tuple[float, float, float]


def pose_of(pose: Pose) -> tuple[Vector, tuple[float, float]]:
    """Shift, mm, and tilt, rad, of the magnet.

    >>> pose_of(Pose(shift="0.5,0,-1"))
    ((0.5, 0.0, -1.0), (0.0, 0.0))
    """
    x, y, z = vector("--shift", pose.shift, 3)
    rx, ry = vector("--tilt", pose.tilt, 2)
    return (x, y, z), (rx, ry)


def vector(name: str, text: str, count: int) -> list[float]:
    """So many numbers from a text a,b,c."""
    numbers = user_input.parse_numbers(name, text)
    if len(numbers) != count:
        sample = ",".join("xyz"[:count]) if count == 3 else "rx,ry"
        raise BadInput(f"{name} takes {count} numbers, {sample}; got {len(numbers)} in {text!r}")
    return numbers


@dataclass(frozen=True, slots=True)
class Sensing:
    """How readings are taken.

    Attributes
    ----------
    level : of the field.
    mode : "component", B.n as an element reads it, or "magnitude", the paper's |B|.
    ambient : uniform field that is added, T.
    noise : draws a sample of the elements' noise for each pose; None draws none.
    """

    level: FieldLevel
    mode: Mode
    ambient: Vector
    noise: np.random.Generator | None


def sensing_of(design: Design, level: FieldLevel, mode: Mode, ambient: str, seed: int | None) -> Sensing:
    """What the options of `magtip readings` ask for; a seed for elements without noise is said to be in vain."""
    import numpy as np

    from analytic.parts import of_design

    bx, by, bz = vector("--ambient", ambient, 3)
    noise = None if seed is None else np.random.default_rng(_seed(seed))
    if noise is not None and not any(element.noise for element in of_design(design)):
        input_warnings.say_no_effect("--seed", "hall_noise is 0")
    return Sensing(level, mode, (bx, by, bz), noise)


def at(design: Design, shift: Vector, tilt: tuple[float, float], sensing: Sensing) -> dict[str, Any]:
    """What the elements read for a pose, beside what is wrong with it."""
    from analytic import clearance, hall
    from analytic.parts import of_design

    chosen = of_design(design)
    seen = hall.readings(
        design,
        shift=shift,
        tilt=tilt,
        mode=sensing.mode,
        field=sensing.level,
        ambient=sensing.ambient,
        noise=sensing.noise,
    )
    volts = all(unit == "V" for unit in seen.units)
    leaning = tilts_of(*tilt)
    return {
        "status": "ok",
        "level": sensing.level,
        "mode": sensing.mode,
        "layout": design.hall_layout,
        "shift_mm": list(shift),
        "tilt_rad": leaning[0],
        "tilt_y_rad": leaning[1],
        "rotation_rad": list(tilt),
        "ambient_T": list(sensing.ambient),
        "elements": [element.name for element in chosen],
        "readings_T": list(seen.B_T),
        "readings_V": list(seen.V) if volts else None,
        "output_T": None if volts else list(seen.output),
        "noise_V": [element.noise for element in chosen] if volts else None,
        "noise_T": [element.noise / element.gain for element in chosen],
        "step_T": [element.step / element.gain for element in chosen],
        "saturated": list(seen.saturated),
        "magnet_gap_mm": [clearance.magnet_gap(design, element.position, shift, tilt) for element in chosen],
        "wall_gap_mm": [clearance.wall_gap(design, element.position, shift) for element in chosen],
        "warnings": warnings(design, seen, shift, tilt),
    }


def warnings(design: Design, seen: Readings, shift: Vector, tilt: tuple[float, float]) -> list[str]:
    """Which elements are saturated, and what runs into what, in sentences."""
    from analytic import clearance, parts

    chosen = zip(parts.of_design(design), seen.saturated, strict=True)
    full = [f"{element.name} is saturated" for element, at_rail in chosen if at_rail]
    return full + clearance.warnings(design, shift, tilt)


def columns(design: Design) -> tuple[list[str], str]:
    """What tables call the elements, and the ending of their outputs: "V", or "output_mT" of a chip.

    >>> columns(Design(hall_layout="tmag5273a1"))
    (['chip_-z', 'chip_x', 'chip_y'], 'output_mT')
    """
    from analytic import parts

    chosen = parts.of_design(design)
    return parts.columns(chosen), "V" if chosen[0].unit == "V" else "output_mT"


def add_field(design: Design, points: Path, pose: Pose, level: FieldLevel, out: Path | None) -> None:
    """Write the table of points with three columns added, to a file or to standard output.

    Numbers are written so that they read back as they are.

    Raises
    ------
    BadInput
        A file cannot be read or written, is no such table, or a point has no field.
    """
    from analytic import hall

    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    shift, tilt = pose_of(pose)
    head, rows, places = read_points(points)
    try:
        b = hall.field_at(places, design, shift, tilt, field=level)
    except BadInput as error:
        raise BadInput(f"{points}: {error}") from None
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([*head, *FOUND])
    writer.writerows([*row, *map(repr, values)] for row, values in zip(rows, (b + 0.0).tolist(), strict=True))
    if target is None:
        print(text.getvalue(), end="", flush=True)
    else:
        atomic_files.write_text(target, text.getvalue())


def read_points(path: Path) -> tuple[list[str], list[list[str]], Array]:
    """Head and rows of a table as they stand, and the places in it, shape (n, 3), mm."""
    return read_rows(path, PLACES, FOUND)


def read_rows(
    path: Path,
    wanted: list[str],
    added: list[str],
    *,
    holes: bool = False,
    instead: Mapping[str, list[str]] | None = None,
) -> tuple[list[str], list[list[str]], Array]:
    """Head and rows of a table as they stand, and the numbers in the wanted columns, shape (n, len(wanted)).

    Parameters
    ----------
    added : columns that the table will get, and must not have.
    holes : an empty cell or a NaN is a NaN rather than bad input.
    instead : columns that an option would want in their place, by the option.
    """
    import numpy as np

    rows = table_input.csv_rows(path)
    if not rows:
        raise BadInput(f"{path} is empty: its first line must name the columns {','.join(wanted)}")
    head = [name.strip() for name in rows.pop(0)[1]]
    _check_head(path, head, wanted, added, instead or {})
    columns = [head.index(name) for name in wanted]
    values = np.empty((len(rows), len(wanted)))
    for k, (line, row) in enumerate(rows):
        table_input.check_length(path, line, head, row)
        for j, column in enumerate(columns):
            cell = row[column]
            value = table_input.number("nan" if holes and not cell.strip() else cell)
            if value is None or not (math.isfinite(value) or (holes and math.isnan(value))):
                unit = wanted[j].rpartition("_")[2]
                raise BadInput(
                    f"{path}, line {line}: {wanted[j]} must be a finite number of {unit}; got {cell!r}"
                    f"{table_input.comma_remedy(cell)}"
                )
            values[k, j] = value
    return head, [row for _, row in rows], values


def _check_head(
    path: Path, head: list[str], wanted: list[str], added: list[str], instead: Mapping[str, list[str]]
) -> None:
    names = ",".join(wanted)
    missing = [name for name in wanted if name not in head]
    if missing:
        for option, others in instead.items():
            if all(name in head for name in others):
                raise BadInput(f"{path}: the columns are {','.join(others)}, not {names}: add {option}")
        raise BadInput(
            f"{path}: column {missing[0]} is missing: the first line must name {names}; got {','.join(head)}"
        )
    if [name for name in head if name in wanted] != wanted:
        raise BadInput(f"{path}: the columns must stand once each in the order {names}; got {','.join(head)}")
    there = [name for name in added if name in head]
    if there:
        raise BadInput(f"{path}: column {there[0]} exists already and would be added again: remove it")


def _seed(seed: int) -> int:
    if not seed >= 0:
        raise BadInput(f"--seed must be a whole number of 0 or more; got {seed}")
    return seed


def to_magpylib(design: Design, shift: Vector = (0.0, 0.0, 0.0), tilt: tuple[float, float] = (0.0, 0.0)) -> Any:
    """Magnet and Hall elements as a collection of the library magpylib (which must be installed), in metres.

    Its sources are the moved magnet, its sensors one for each element, with the sensor's z along the element's
    direction: `collection.sensors[k].getB(collection)[2]` is B.n of element k, T.

    Raises
    ------
    BadInput
        The design has no magnet.
    """
    import magpylib
    from scipy.spatial.transform import Rotation

    from analytic.parts import of_design

    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0): give it a magnet")
    magnet = magpylib.magnet.Cylinder(
        polarization=(0.0, 0.0, -design.remanence),
        dimension=(1e-3 * design.magnet_diameter, 1e-3 * design.magnet_height),
        position=[1e-3 * v for v in (shift[0], shift[1], design.H + shift[2])],
        orientation=Rotation.from_rotvec([*tilt, 0.0]),
    )
    sensors = []
    for element in of_design(design):
        turn = Rotation.align_vectors([element.direction], [[0.0, 0.0, 1.0]])[0]
        place = [1e-3 * v for v in element.position]
        sensors.append(magpylib.Sensor(position=place, orientation=turn, style_label=element.name))
    return magpylib.Collection(magnet, *sensors)
