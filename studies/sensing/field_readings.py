"""Readings of the Hall elements: at one pose of the magnet, and in each state of a file (`magtip readings`).

The field at the points of a table (`magtip field`), and the reader of tables with named columns, come last.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from geometry.design import BadInput, Design
from geometry.loads import ANSWERED, tilts_of
from studies.inputs import table_input, user_input
from studies.inputs.option_groups import FieldLevel, Pose, Reading
from studies.inputs.table_input import State
from studies.output import atomic_files, console
from studies.output.records import FlatRow
from studies.output.result import Result, Table

if TYPE_CHECKING:
    from analytic.hall import Mode, Readings
    from geometry.arrays import Array, Vector


def pose_of(pose: Pose) -> tuple[Vector, tuple[float, float]]:
    """Return shift (x, y, z), mm, and rotation about x and y, rad, of the magnet.

    >>> pose_of(Pose(shift="0.5,0,-1"))
    ((0.5, 0.0, -1.0), (0.0, 0.0))
    """
    x, y, z = vector("--shift", pose.shift, 3)
    rx, ry = vector("--tilt", pose.tilt, 2)
    return (x, y, z), (rx, ry)


def vector(name: str, text: str, count: int) -> list[float]:
    """Parse a text a,b,c of `count` numbers; `name` is the option that messages name."""
    numbers = user_input.parse_numbers(name, text)
    if len(numbers) != count:
        sample = ",".join("xyz"[:count]) if count == 3 else "rx,ry"
        raise BadInput(f"{name} takes {count} numbers, {sample}; got {len(numbers)} in {text!r}")
    return numbers


@dataclass(frozen=True, slots=True)
class Sensing:
    """Options that apply to the readings at every pose.

    mode : "component" for B.n, which an element measures, or "magnitude" for the paper's |B|.
    ambient : uniform ambient field, T.
    noise : random generator for one sample of the elements' noise at each pose; None for no noise.
    """

    level: FieldLevel
    mode: Mode
    ambient: Vector
    noise: np.random.Generator | None


def sensing_of(design: Design, reading: Reading) -> Sensing:
    """Return the options of `magtip readings`; warn if a seed has no effect because the elements have no noise."""
    from analytic.parts import of_design

    bx, by, bz = vector("--ambient", reading.ambient, 3)
    if reading.seed is not None and not reading.seed >= 0:
        raise BadInput(f"--seed must be a whole number of 0 or more; got {reading.seed}")
    noise = None if reading.seed is None else np.random.default_rng(reading.seed)
    if noise is not None and not any(element.noise or element.floor for element in of_design(design)):
        user_input.say_no_effect("--seed", "hall_noise is 0")
    return Sensing(reading.level, reading.mode, (bx, by, bz), noise)


def read_pose(design: Design, shift: Vector, tilt: tuple[float, float], sensing: Sensing) -> FlatRow:
    """Return the readings at a pose: shift (x, y, z), mm, and rotation about x and y, rad.

    Lists hold one value for each element, except for shift, rotation and ambient field.

    tilt_rad, tilt_y_rad : lean of the magnet's axis towards x and y.
    readings_T : B.n, or |B| in mode "magnitude".
    readings_V : outputs in V; None if the outputs of the elements are flux densities, which are in `output_T`.
    noise_V, noise_T, step_T : standard deviation of the noise of one sample, and step of the converter.
    noise_of_readings_T : standard deviation of a reading, from noise, converter and average.
    magnet_gap_mm, wall_gap_mm : distance of the magnet and of the beam's wall from each element.
    """
    from analytic import clearance, hall
    from analytic.parts import of_design

    elements = of_design(design)
    measured = hall.readings(
        design,
        shift=shift,
        tilt=tilt,
        mode=sensing.mode,
        field=sensing.level,
        ambient=sensing.ambient,
        noise=sensing.noise,
    )
    volts = all(unit == "V" for unit in measured.units)
    tilt_x, tilt_y = tilts_of(*tilt)
    places, pose = [element.position for element in elements], (np.array([shift]), np.array([tilt]))
    return {
        "status": "ok",
        "level": sensing.level,
        "mode": sensing.mode,
        "layout": design.hall_layout,
        "shift_mm": list(shift),
        "tilt_rad": tilt_x,
        "tilt_y_rad": tilt_y,
        "rotation_rad": list(tilt),
        "ambient_T": list(sensing.ambient),
        "elements": [element.name for element in elements],
        "readings_T": list(measured.B_T),
        "readings_V": list(measured.V) if volts else None,
        "output_T": None if volts else list(measured.output),
        "noise_V": [element.noise for element in elements] if volts else None,
        "noise_T": [element.noise / element.gain for element in elements],
        "step_T": [element.step / element.gain for element in elements],
        "noise_of_readings_T": [element.noise_T for element in elements],
        "saturated": list(measured.saturated),
        "magnet_gap_mm": [float(clearance.magnet_gaps(design, place, *pose)[0]) for place in places],
        "wall_gap_mm": [float(clearance.wall_gaps(design, place, pose[0])[0]) for place in places],
        "warnings": warnings(design, measured, shift, tilt),
    }


def warnings(design: Design, readings: Readings, shift: Vector, tilt: tuple[float, float]) -> list[str]:
    """Return a sentence for each saturated element and for each collision of magnet or wall."""
    from analytic import clearance, parts

    flags = zip(parts.of_design(design), readings.saturated, strict=True)
    saturated = [f"{element.name} is saturated" for element, at_rail in flags if at_rail]
    return saturated + clearance.warnings(design, shift, tilt)


def columns(design: Design) -> tuple[list[str], str]:
    """Return the elements' names in tables, and the suffix of their outputs: "V", or "output_mT" for a chip.

    >>> columns(Design(hall_layout="tmag5273a1"))
    (['chip_-z', 'chip_x', 'chip_y'], 'output_mT')
    """
    from analytic import parts

    elements = parts.of_design(design)
    return parts.columns(elements), "V" if elements[0].unit == "V" else "output_mT"


def to_magpylib(design: Design, shift: Vector = (0.0, 0.0, 0.0), tilt: tuple[float, float] = (0.0, 0.0)) -> Any:
    """Return magnet and Hall elements as a collection of the library magpylib (which must be installed), in metres.

    The collection has one source, the moved magnet, and one sensor for each element. The z axis of a sensor is the
    direction of its element, so that `collection.sensors[k].getB(collection)[2]` is B.n of element k, T.
    """
    import magpylib
    from scipy.spatial.transform import Rotation

    from analytic.parts import of_design

    if not design.shape.has_magnet:
        raise BadInput("this design has no magnet (magnet_diameter is 0): give it a magnet")
    magnet = magpylib.magnet.Cylinder(
        polarization=(0.0, 0.0, -design.polarisation),
        dimension=(1e-3 * design.magnet_diameter, 1e-3 * design.magnet_height),
        position=[1e-3 * v for v in (shift[0], shift[1], design.H + shift[2])],
        orientation=Rotation.from_rotvec([*tilt, 0.0]),
    )
    sensors = []
    for element in of_design(design):
        orientation = Rotation.align_vectors([element.direction], [[0.0, 0.0, 1.0]])[0]
        position = [1e-3 * v for v in element.position]
        sensors.append(magpylib.Sensor(position=position, orientation=orientation, style_label=element.name))
    return magpylib.Collection(magnet, *sensors)


MOVED = ("depth_mm", "shear_mm", "shear_y_mm")
"""Columns that distinguish the states of a path."""
SHOWN = ("status", *MOVED, "shift_mm", "rotation_rad", "readings_T", "readings_V", "output_T", "saturated")
"""Columns of a table that is not wide."""
EXTRA = ("half_width_V", "half_width_T", "resolution_N")
"""Further columns of such a table, where they are known."""


def of_states(design: Design, file: Path, sensing: Sensing) -> list[FlatRow]:
    """Return the readings of each state, in the order of the file, with its own status, message and load.

    resolution_N : standard deviations of the force along x, y and z that the noise of the readings causes; None if
        the elements have no noise, or if the states do not determine the mechanics (see `resolutions`).
    resolution_N_per_N : the same over the size of the force; None without a force.
    """
    states = table_input.read_states(file, design)
    if not states:
        raise BadInput(f"{file} contains no states: give the output of `magtip solve --json`")
    rows = [_read_state(design, state, sensing, f"{file}, line {state.line}") for state in states]
    for k, (resolution, share) in resolutions(design, states, sensing).items():
        rows[k] |= {"resolution_N": resolution, "resolution_N_per_N": share}
    return rows


def resolutions(
    design: Design, states: Sequence[State], sensing: Sensing
) -> dict[int, tuple[list[float], list[float] | None]]:
    """Return the force resolution of states by their index: along x, y and z, N, and over the size of the force.

    The force between the states follows from polynomials that are fitted to all converged states. The result is empty
    if these contain no presses or no shears, if an element has no noise or lies inside the beam, or if the field is
    not the exact one.
    """
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
        forward = forward_model.model(design, law.tilt, mode=sensing.mode)
    except BadInput:
        return {}
    responses = [response for _, response in samples.values()]
    sigma = force_resolution.at_shifts(forward, law, np.array([response.shift for response in responses]))
    sizes = [math.hypot(*response.force) for response in responses]
    return {
        k: (line.tolist(), (line / size).tolist() if size else None)
        for k, line, size in zip(samples, sigma, sizes, strict=True)
    }


def _read_state(design: Design, state: State, sensing: Sensing, where: str) -> FlatRow:
    resolution = dict.fromkeys(("resolution_N", "resolution_N_per_N"))
    said = {"status": state.status, "message": state.message}
    if state.load is None or state.response is None:
        missing = dict.fromkeys((*SHOWN[1:], "tilt_rad", "tilt_y_rad"))
        return said | missing | resolution | {"warnings": []}
    load, response = state.load, state.response
    try:
        readings = read_pose(design, response.shift, response.rotation, sensing)
    except BadInput as error:
        raise BadInput(f"{where}: {error}") from None
    moved = dict(zip(MOVED, (load.depth, load.shear_x, load.shear_y), strict=True))
    return readings | said | moved | resolution


def study(
    design: Design,
    file: Path,
    sensing: Sensing,
    *,
    wide: bool,
    made: Callable[[list[FlatRow]], list[FlatRow]] = list,
) -> Result:
    """Return the result of `of_states`, as `made` changes its rows; it has failed if no state was reached."""
    rows = made(of_states(design, file, sensing))
    extra = [name for name in EXTRA if any(row.get(name) for row in rows)]
    keys = list(dict.fromkeys([*SHOWN, *extra, *(key for row in rows for key in row if wide)]))
    shown = [{key: row.get(key) for key in keys} for row in rows]
    messages = [
        {key: row[key] for key in MOVED} | {"message": warning} for row in rows for warning in row["warnings"]
    ]
    failed = [row["status"] for row in rows if row["status"] not in ANSWERED]
    said = [f"{len(failed)} of {len(rows)} states failed; the last status is {failed[-1]}"] if failed else []
    lost = len(failed) == len(rows)
    return Result(
        title="Readings",
        records=rows,
        shown=[Table(title="Readings", rows=shown, first=SHOWN[:4])],
        warnings=console.remarks(messages, MOVED, rows),
        remarks=[] if lost else said,
        failures=said if lost else [],
    )


# The field at the points of a table

POINT_COLUMNS = ["x_mm", "y_mm", "z_mm"]
"""Columns of a table of points."""
FIELD_COLUMNS = ["Bx_T", "By_T", "Bz_T"]
"""Columns that `add_field` adds."""


def add_field(design: Design, points: Path, pose: Pose, level: FieldLevel, out: Path | None) -> None:
    """Write the table of points with the columns `FIELD_COLUMNS` added, to a file or to standard output."""
    from analytic import hall

    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    shift, tilt = pose_of(pose)
    head, rows, places = read_rows(points, POINT_COLUMNS, FIELD_COLUMNS)
    try:
        b = hall.field_at(places, design, shift, tilt, field=level)
    except BadInput as error:
        raise BadInput(f"{points}: {error}") from None
    write_rows(target, [*head, *FIELD_COLUMNS], rows, b.tolist())


def write_rows(
    target: Path | None, head: Sequence[str], rows: Sequence[Sequence[str]], added: Iterable[Sequence[Any]]
) -> None:
    """Write rows of a table with values added to a file, or to standard output; numbers keep all their digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    for row, values in zip(rows, added, strict=True):
        cells = (("" if math.isnan(v) else repr(v + 0.0)) if isinstance(v, float) else v for v in values)
        writer.writerow([*row, *cells])
    if target is None:
        print(text.getvalue(), end="", flush=True)
    else:
        atomic_files.write_text(target, text.getvalue())


def read_rows(
    path: Path,
    wanted: list[str],
    added: list[str],
    *,
    holes: bool = False,
    instead: Mapping[str, list[str]] | None = None,
) -> tuple[list[str], list[list[str]], Array]:
    """Return head and rows of a table as text, and the numbers in the wanted columns, shape (n, len(wanted)).

    Parameters
    ----------
    added : columns that the caller will add, so that the table must not contain them.
    holes : read an empty cell or a NaN as NaN; default: refuse it.
    instead : for each option, the columns that it would read instead; a message suggests the option.

    A chip's own axes may stand in place of the elements' (-z, x, y): chip_x_T, chip_y_T, chip_z_T.
    """
    table = table_input.Measured(path, comments=False)
    if not table.heads:
        raise BadInput(f"{path} is empty: its first line must name the columns {','.join(wanted)}")
    own = [name.replace("_-z_", "_z_") for name in wanted]
    signs = np.array([1.0 if name == asked else -1.0 for name, asked in zip(own, wanted, strict=True)])
    if (set(own) - set(wanted)) & set(table.heads):
        _check_head(path, table.heads, [own[k - k % 3 + (k + 1) % 3] for k in range(len(own))], added, {})
    else:
        own, signs = wanted, np.ones(len(wanted))
        _check_head(path, table.heads, wanted, added, instead or {})
    table_input.check_rows(path, table.rows)
    values = signs * np.column_stack([table.numbers(name, holes=holes) for name in own])
    return table.heads, [row for _, row in table.rows], values


def _check_head(
    path: Path, head: list[str], wanted: list[str], added: list[str], instead: Mapping[str, list[str]]
) -> None:
    names = ",".join(wanted)
    missing = [name for name in wanted if name not in head]
    if missing:
        for option, alternatives in instead.items():
            if all(name in head for name in alternatives):
                raise BadInput(f"{path}: the columns are {','.join(alternatives)}, not {names}: add {option}")
        raise BadInput(
            f"{path}: column {missing[0]} is missing: the first line must name {names}; got {','.join(head)}"
        )
    if [name for name in head if name in wanted] != wanted:
        raise BadInput(f"{path}: the columns must stand once each in the order {names}; got {','.join(head)}")
    existing = [name for name in added if name in head]
    if existing:
        raise BadInput(f"{path}: column {existing[0]} exists already and would be added again: remove it")
