"""The file of a calibration, calibration.json: written by magtip calibrate, and decoding of readings by it.

Its numbers are the nominal design, the polynomials of its mechanics, and the unknowns of
`studies.calibration.sensor_fit` with their covariance.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import parts
from analytic.inverse.response_surface import Mechanics
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.calibration import bench_file, sensor_fit
from studies.calibration.sensor_fit import Fit, Sensor, Unknowns
from studies.inputs import table_input
from studies.inputs.option_groups import Decoding
from studies.inputs.user_input import parse_numbers
from studies.output import atomic_files
from studies.output.figures import table_of
from studies.output.result import Result

if TYPE_CHECKING:
    from studies.output.records import FlatRow

FORMAT = 1
"""Version of calibration.json."""


def unknown_rows(found: Fit) -> list[FlatRow]:
    """Return value, standard deviation and prior of each unknown."""
    un = found.sensor.unknowns
    return [
        {"name": name, "unit": unit, "value": value, "deviation": deviation, "prior": prior, "prior_deviation": wide}
        for name, unit, value, deviation, prior, wide in zip(
            un.names, un.units, found.theta.tolist(), found.deviation.tolist(), un.mean.tolist(),
            un.deviation.tolist(), strict=True,
        )
    ]  # fmt: skip


def as_text(found: Fit, source: str, lag: float | None) -> str:
    sensor = found.sensor
    law = {name: np.asarray(value).tolist() for name, value in dataclasses.asdict(sensor.mechanics).items()}
    record = {
        "format": FORMAT,
        "design": dataclasses.asdict(sensor.design),
        "mechanics_source": source,
        "lag_s": lag,
        "unknowns": unknown_rows(found),
        "covariance": found.covariance.tolist(),
        "growth": found.growth,
        "noise": sensor.noise.tolist(),
        "force_noise_N": sensor.force_noise,
        "temperature_C": sensor.temperature_C,
        "mechanics": law,
    }
    return json.dumps(record, indent=1) + "\n"


def read(path: Path) -> Fit:
    """Read calibration.json.

    Raises
    ------
    BadInput
        The file is no calibration, or of another version.
    """
    try:
        record = json.loads(table_input.text_of(path, "JSON"))
        if record["format"] != FORMAT:
            raise BadInput(f"{path} has format {record['format']}; this magtip reads {FORMAT}: calibrate again")
        law: Any = dict(record["mechanics"]) | {"errors": tuple(record["mechanics"]["errors"])}
        law |= {name: np.array(law[name]) for name in ("tau", "lateral", "normal", "depth", "shear")}
        rows = record["unknowns"]
        un = Unknowns(
            tuple(row["name"] for row in rows),
            tuple(row["unit"] for row in rows),
            np.array([row["prior"] for row in rows]),
            np.array([row["prior_deviation"] for row in rows]),
        )
        sensor = Sensor(
            Design(**record["design"]), Mechanics(**law), un, np.array(record["noise"]), record["force_noise_N"],
            temperature_C=record["temperature_C"],
        )  # fmt: skip
        theta = np.array([row["value"] for row in rows])
        # growth is in the covariance already; of the decoder's own noise it is the factor too
        nothing = np.zeros((0, 3))
        return Fit(sensor, theta, np.array(record["covariance"]), nothing, nothing, record["growth"], 1)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, BadInput):
            raise
        raise BadInput(f"{path} is no calibration ({error!r}): give calibration.json of magtip calibrate") from None


DECODED = (
    "status",
    *(
        f"{name}_{axis}_{unit}"
        for name, unit in (("force", "N"), ("half_width", "N"), ("shift", "mm"))
        for axis in "xyz"
    ),
)
"""Columns that decoding by a calibration adds: force, half of its 90 % interval, shift of the magnet."""
WHY = {
    "ok": "",
    "no_pose": "no pose of the magnet explains these readings: the sensor has changed, or a reading is wrong",
    "not_finite": "a reading is missing or not a finite number",
}


def decoded_rows(found: Fit, readings: Array) -> list[FlatRow]:
    """Return the columns DECODED of readings (n, k), in the elements' unit."""
    answer = sensor_fit.decode(found, readings, np.zeros(len(readings)))
    finite, known = (np.asarray(np.isfinite(each).all(axis=1)) for each in (readings, answer.force))
    status = np.where(known, "ok", np.where(finite, "no_pose", "not_finite"))
    shift = np.where(known[:, None], answer.shift, np.nan)
    numbers = np.hstack([answer.force, answer.half_width, shift])
    return [dict(zip(DECODED, (s, *n), strict=True)) for s, n in zip(status.tolist(), numbers.tolist(), strict=True)]


def decode(design: Design, decoding: Decoding, out: Path | None, *, as_json: bool) -> Result:
    """Decode one set of readings, or the rows of a table, by a calibration; without `out` a table is printed.

    Raises
    ------
    BadInput
        The calibration is of another design, an option contradicts it, or the readings cannot be read.
    """
    path = decoding.calibration
    assert path is not None
    for option, given in (
        ("--level", decoding.level),
        ("--responses", decoding.responses),
        ("--tolerance", decoding.tolerances),
        ("--units", decoding.units),
        ("--zero", decoding.zero),
        ("--ignore-tilt", decoding.ignore_tilt),
    ):
        if given:
            raise BadInput(f"{option} has no place beside --calibration, which fixes it: leave it out")
    found = read(path)
    if dataclasses.asdict(found.sensor.design) != dataclasses.asdict(design):
        raise BadInput(f"{path} is the calibration of another design: decode with the design that was calibrated")
    names = parts.columns(parts.of_design(design))
    if decoding.readings is not None:
        values = parse_numbers("--readings", decoding.readings)
        if len(values) != len(names):
            raise BadInput(f"--readings takes {len(names)} numbers, {','.join(names)}; got {len(values)}")
        (row,) = decoded_rows(found, np.array([values]))
        record = {"status": row["status"], "message": WHY[row["status"]], "level": "calibration", "readings": values}
        for name, unit in (("force", "N"), ("half_width", "N"), ("shift", "mm")):
            record[f"{name}_{unit}"] = [row[f"{name}_{axis}_{unit}"] for axis in "xyz"]
        return Result(
            title="Decoded", records=[record], failures=[] if row["status"] == "ok" else [record["message"]]
        )
    assert decoding.file is not None
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    raw, numbers = bench_file.read_readings(decoding.file, design)
    rows = [
        {**texts, **row}
        for texts, row in zip(raw.fillna("").to_dict("records"), decoded_rows(found, numbers), strict=True)
    ]
    table = table_of(rows).to_csv(index=False)
    if target is not None:
        atomic_files.write_text(target, table)
    elif not as_json:
        print(table, end="", flush=True)
    lost = sum(row["status"] != "ok" for row in rows)
    return Result(
        title="Decoded rows",
        records=rows if as_json and target is None else [],
        shown=[],
        remarks=[f"{lost} of {len(rows)} rows have no force"] if lost else [],
        failures=["no row has a force"] if lost == len(rows) else [],
    )
