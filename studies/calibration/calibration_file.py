"""The file of a calibration, calibration.json, and what the estimated sensor reads, and its readings say, by it.

Its numbers are the nominal design, the polynomials of its mechanics, and the unknowns of
`studies.calibration.sensor_fit` with their covariance.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from analytic import parts
from analytic.decode import Status, field_of
from analytic.hall import converted
from analytic.inverse.response_surface import Mechanics
from analytic.time_series import RelaxingForce, zero_offset
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import OF_TIME, BadInput, Design
from geometry.loads import Load, check_load
from studies.calibration import bench_file, calibrated_forces, force_regression
from studies.calibration.force_regression import Regression
from studies.calibration.sensor_fit import Fit, Sensor, Unknowns
from studies.inputs.option_groups import Decoding, Pose, Reading
from studies.inputs.table_input import COLDEST, HOTTEST, numbers_of
from studies.inputs.user_input import parse_numbers
from studies.mechanics.loading_cycles import MadeStates
from studies.output import atomic_files, console
from studies.output.bounded_files import json_object
from studies.output.figures import table_of
from studies.output.result import Result, of_record
from studies.sensing import decode_readings, field_readings
from studies.sensing.decode_readings import QUANTILE

if TYPE_CHECKING:
    from studies.output.records import FlatRow

OF_ARRAY = "{path} is the calibration of an array: give its design file, with the table [array], to decode or stream"
FORMAT = 2
"""Version of calibration.json: 1 had no digest, and the variances of priors grew, too."""


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


def as_text(
    found: Fit, source: str, lag: float | None, warnings: Sequence[str] = (), failures: Sequence[str] = ()
) -> str:
    """Return the content of calibration.json: what who uses it is warned of; with failures, why nothing may."""
    sensor = found.sensor
    law = {name: np.asarray(value).tolist() for name, value in dataclasses.asdict(sensor.mechanics).items()}
    return _signed({
        "decoder": "model",
        "design": dataclasses.asdict(sensor.design),
        "mechanics_source": source,
        "lag_s": lag,
        "warnings": list(warnings),
        "failures": list(failures),
        "unknowns": unknown_rows(found),
        "covariance": found.covariance.tolist(),
        "growth": found.growth,
        "noise": sensor.noise.tolist(),
        "force_noise_N": sensor.force_noise,
        "force_share": sensor.force_share,
        "temperature_C": sensor.temperature_C,
        "mechanics": law,
    })  # fmt: skip


def array_text(
    array: ArrayDesign, beams: Sequence[dict[str, Any]], warnings: Sequence[str], failures: Sequence[str]
) -> str:
    """Return the content of calibration.json for an array, from the records of its beams."""
    return _signed({
        "decoder": "array",
        "places_mm": array.places.tolist(),
        "poles": array.poles.tolist(),
        "beams": list(beams),
        "warnings": list(warnings),
        "failures": list(failures),
    })  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class ArrayFit:
    """The estimated sensor of each beam of an array.

    places, poles : as in `ArrayDesign`; the magnets of the sensors lie as they do there.
    """

    beams: tuple[Fit, ...]
    places: Array
    poles: Array


def regression_text(found: Regression, lag: float | None, warnings: Sequence[str] = ()) -> str:
    """Return the content of calibration.json for a regression: what who uses it is warned of."""
    record = force_regression.record_of(found)
    return _signed({"decoder": "regression", **record, "lag_s": lag, "warnings": list(warnings), "failures": []})


def _signed(record: dict[str, Any]) -> str:
    record = {"format": FORMAT} | record
    return json.dumps(record | {"digest": digest_of(record)}, indent=1) + "\n"


def digest_of(record: dict[str, Any]) -> str:
    """Return the digest of a calibration's content, which tells whether a number was edited."""
    content = {name: value for name, value in record.items() if name != "digest"}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def read(path: Path) -> Fit:
    """Read calibration.json of a sensor's model.

    Raises
    ------
    BadInput
        As `read_any`, or it holds a regression.
    """
    found = read_any(path)
    if isinstance(found, ArrayFit):
        raise BadInput(OF_ARRAY.format(path=path))
    if isinstance(found, Regression):
        raise BadInput(
            f"{path} holds a regression, which knows neither magnet nor mechanics: give what magtip calibrate writes "
            "with --decoder model, or use it in decode, stream or firmware"
        )
    return found


def array_of(path: Path, array: ArrayDesign) -> ArrayFit:
    """Read calibration.json of an array.

    Raises
    ------
    BadInput
        The file is no calibration of an array, or one of another array or design.
    """
    found = read_any(path)
    if not isinstance(found, ArrayFit):
        raise BadInput(
            f"{path} is the calibration of one sensor, and this design has a table [array]: calibrate the array, or "
            "take a design file without that table"
        )
    alike = found.places.shape == array.places.shape and np.allclose(found.places, array.places, atol=1e-9)
    if not alike or (found.poles != array.poles).any():
        raise BadInput(f"{path} is the calibration of an array with other places or polarity: give its design file")
    beams = [_for_design(path, fit, array.of_beam(k), reject_ambient=False) for k, fit in enumerate(found.beams)]
    return ArrayFit(tuple(beams), found.places, found.poles)


def read_any(path: Path) -> Fit | Regression | ArrayFit:
    """Read calibration.json.

    Raises
    ------
    BadInput
        The file is no calibration, of another version, edited, or of one that failed.
    """
    give, record = "give calibration.json of magtip calibrate", json_object(path)
    if "format" not in record:
        raise BadInput(f"{path} is no calibration, since it states no format: {give}")
    if record["format"] != FORMAT:
        raise BadInput(f"{path} has format {record['format']!r:.20}; this magtip reads {FORMAT}: calibrate again")
    if record.get("digest") != digest_of(record):
        raise BadInput(f"{path} was edited, since its digest does not match what it holds: calibrate again")
    try:
        found = DECODERS[record.get("decoder", "model")](record)
        failures, warnings = (_texts(record, name) for name in ("failures", "warnings"))
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"{path} is no calibration ({error}): {give}") from None
    if failures:
        raise BadInput(f"{path} is of no use, as magtip calibrate said: {failures[0]}")
    for text in warnings:
        console.warn(f"{path}, as magtip calibrate said: {text}")
    return found


DECODERS: dict[str, Callable[[dict[str, Any]], Fit | Regression | ArrayFit]]
DECODERS = {
    "model": lambda record: _fit_of(record),
    "regression": force_regression.of_record,
    "array": lambda record: _array_of(record),
}
"""What reads the record of each decoder."""


def _texts(record: dict[str, Any], name: str) -> list[str]:
    texts = record[name]
    if not (isinstance(texts, list) and all(isinstance(text, str) for text in texts)):
        raise ValueError(f"{name} must be a list of sentences")
    return texts


def _array_of(record: dict[str, Any]) -> ArrayFit:
    beams = tuple(_fit_of(each) for each in record["beams"])
    places = numbers_of("places_mm", record["places_mm"], len(beams), 2)
    return ArrayFit(beams, places, numbers_of("poles", record["poles"], len(beams)))


def _fit_of(record: dict[str, Any]) -> Fit:
    """Return the sensor of a record; raise ValueError, KeyError or TypeError for what magtip does not write."""
    rows, law, design = record["unknowns"], record["mechanics"], Design(**record["design"])
    count, elements = len(rows), len(parts.of_design(design))
    un = Unknowns(
        tuple(str(row["name"]) for row in rows),
        tuple(str(row["unit"]) for row in rows),
        numbers_of("prior", [row["prior"] for row in rows], count),
        numbers_of("prior_deviation", [row["prior_deviation"] for row in rows], count),
    )
    if not (un.deviation >= 0).all() or len(set(un.names)) < count:
        raise ValueError("deviations must be 0 or more, and names of unknowns differ")
    shapes: dict[str, tuple[int | None, ...]]
    shapes = {"tau": (None, None), "lateral": (None, None), "normal": (None, None)}
    shapes |= {"depth": (None, None), "shear": (None, None), "errors": (5,), "reach": (), "sink": ()}
    fields: Any = {name: numbers_of(name, law[name], *shape) for name, shape in shapes.items()}
    fields |= {name: float(fields[name]) for name in ("reach", "sink")} | {"errors": tuple(fields["errors"].tolist())}
    least, most = (float(end) for end in law["lean"])
    mechanics = Mechanics(**fields, lean=(least, most), slack=float(numbers_of("slack", law["slack"])))
    noise = numbers_of("noise", record["noise"], elements)
    force, share, T_0, growth = (
        float(numbers_of(name, record[name])) for name in ("force_noise_N", "force_share", "temperature_C", "growth")
    )
    if design.temperature != T_0:
        raise ValueError(f"temperature_C must be that of the design, {design.temperature:g}; got {T_0:g}")
    if not (min(*noise.tolist(), force) > 0 and share >= 0 and growth >= 1):
        raise ValueError("errors of readings and forces must be above 0, and growth at least 1")
    sensor = Sensor(design, mechanics, un, noise, force, force_share=share)
    theta = numbers_of("value", [row["value"] for row in rows], count)
    covariance = numbers_of("covariance", record["covariance"], count, count)
    # growth is in the covariance already; of the decoder's own noise it is the factor too
    nothing = np.zeros((0, 3))
    return Fit(sensor, theta, covariance, nothing, nothing, growth, 1.0)


def of_design(path: Path, design: Design, *, reject_ambient: bool = False) -> Fit:
    """Read calibration.json for its nominal design, or the design.toml beside it, whose fields of time it takes.

    Raises
    ------
    BadInput
        The file is no calibration by a model, or one of another design.
    """
    return _for_design(path, read(path), design, reject_ambient=reject_ambient)


def decoder_of(path: Path, design: Design, *, reject_ambient: bool = False) -> Fit | Regression:
    """Read calibration.json, of a model or of a regression, as `of_design` does."""
    found = read_any(path)
    if isinstance(found, ArrayFit):
        raise BadInput(OF_ARRAY.format(path=path))
    if isinstance(found, Fit):
        return _for_design(path, found, design, reject_ambient=reject_ambient)
    if reject_ambient:
        raise BadInput(
            f"{path} is a regression, which knows no field beside its bench's, so --reject-ambient cannot be: "
            "calibrate by the model (calibrate --decoder model), or leave it out"
        )
    _check_design(path, design, found.design, found.design)
    return dataclasses.replace(found, design=design)


def regression_of(path: Path, design: Design, *, reject_ambient: bool = False) -> Regression:
    """Read calibration.json of a regression, as `decoder_of` does."""
    found = decoder_of(path, design, reject_ambient=reject_ambient)
    assert isinstance(found, Regression)
    return found


def _for_design(path: Path, found: Fit, design: Design, *, reject_ambient: bool) -> Fit:
    _check_design(path, design, found.sensor.design, found.design)
    time = {name: getattr(design, name) for name in OF_TIME}
    sensor = dataclasses.replace(found.sensor, design=dataclasses.replace(found.sensor.design, **time))
    return dataclasses.replace(found, sensor=sensor, rejects_ambient=reject_ambient)


def _check_design(path: Path, design: Design, *calibrated: Design) -> None:
    """Refuse a design that is neither the nominal one of a calibration nor the estimated one, but for its time."""
    given, nominal, estimated = (dataclasses.asdict(each) for each in (design, *calibrated))
    names = [name for name in given if name not in OF_TIME]
    # a value that was fixed is the same in both
    if not any(all(given[name] == each[name] for name in names) for each in (nominal, estimated)):
        other = [name for name in names if given[name] not in (nominal[name], estimated[name])]
        name = (other or [name for name in names if given[name] != nominal[name]])[0]
        raise BadInput(
            f"{path} is the calibration of another design, whose {name} is {nominal[name]} and not {given[name]}: "
            "give the design that was calibrated, or the design.toml beside the calibration"
        )


def describes(found: Fit, design: Design) -> bool:
    """Return whether a design is the estimated one; its fields of time may be others."""
    return design == dataclasses.replace(found.design, **{name: getattr(design, name) for name in OF_TIME})


# Readings


def readings(
    path: Path,
    design: Design,
    pose: Pose,
    load: Sequence[float],
    reading: Reading,
    states: Path | None,
    *,
    wide: bool,
) -> Result:
    """Return what the estimated sensor reads at a pose, under a load of the plate (depth, shears) or in states.

    Raises
    ------
    BadInput
        The calibration is of another design, it does not reach the load, or two of these are given.
    """
    if reading != Reading():
        raise BadInput("--level, --mode, --ambient and --seed have no place beside --calibration: leave them out")
    if sum((pose != Pose(), any(load), states is not None)) > 1:
        raise BadInput("give one of --depth (with --shear), --shift (with --tilt) and --responses")
    found = of_design(path, design)
    nominal, sensing = found.sensor.design, field_readings.sensing_of(found.sensor.design, reading)
    if states is not None:
        return field_readings.study(nominal, states, sensing, wide=wide, made=partial(made_rows, found))
    shift, tilt = field_readings.pose_of(pose)
    if not any(load):
        (row,) = made_rows(found, [field_readings.read_pose(nominal, shift, tilt, sensing)])
        return of_record("Readings", row)
    depth, x, y = load
    if not depth > 0:
        raise BadInput(f"--depth must be above 0 mm, since a plate that does not touch shears nothing; got {depth:g}")
    check_load(nominal, Load(depth, x, y, friction="stick" if x or y else "none"))
    s, t, force = calibrated_forces.poses_of(found.sensor, np.array([load]))
    if np.isnan(s).any():
        raise BadInput(
            f"a depth of {depth:g} mm with a shear of {math.hypot(x, y):g} mm is beyond the mechanics of {path}, in "
            f"which the magnet sinks by up to {found.sensor.mechanics.sink:.3g} mm: give less"
        )
    place = field_readings.read_pose(nominal, tuple(s[0].tolist()), tuple(t[0].tolist()), sensing)
    (row,) = made_rows(found, [place])
    _, _, force, half = found.answers(nominal.E_now, s, t, force)
    known = {"depth_mm": depth, "shear_mm": x, "shear_y_mm": y}
    return of_record("Readings", known | row | {"force_N": force[0].tolist(), "half_width_N": half[0].tolist()})


def made_rows(found: Fit, rows: Sequence[FlatRow]) -> list[FlatRow]:
    """Return rows of `field_readings.read_pose` with what the estimated sensor reads, and half of 90 % intervals."""
    elements = parts.of_design(found.sensor.design)
    posed = [row for row in rows if row["shift_mm"] is not None]
    shift, tilt = (
        np.array([row[name] for row in posed]).reshape(len(posed), -1) for name in ("shift_mm", "rotation_rad")
    )
    raw, half, _, _ = found.answers(found.sensor.design.E_now, shift, tilt, np.zeros_like(shift))
    output, saturated = outputs_of(found, raw)
    unit = elements[0].unit
    made = iter(
        zip(output.tolist(), field_of(elements, output).tolist(), half.tolist(), saturated.tolist(), strict=True)
    )
    answers = []
    for row in rows:
        width = f"half_width_{unit}"
        if row["shift_mm"] is None:
            answers.append(row | {width: None})
            continue
        value, field, wide, flags = next(made)
        full = [f"{e.name} is saturated" for e, flag in zip(elements, flags, strict=True) if flag]
        said = [text for text in row["warnings"] if not text.endswith(" is saturated")]
        answers.append(row | {
            "level": "calibration", "readings_T": field, "readings_V" if unit == "V" else "output_T": value,
            width: wide, "saturated": flags, "warnings": full + said,
        })  # fmt: skip
    return answers


def made_states(found: Fit, design: Design, times: Array, shift: Array, tilt: Array, force: Array) -> MadeStates:
    """Return what the estimated sensor answers in states of a motion from rest, as `loading_cycles.Made` does."""
    raw, _, felt, _ = found.answers(design.E_now, shift, tilt, force)
    outputs, saturated = outputs_of(found, raw)
    readings = np.where(saturated.any(axis=1, keepdims=True), np.nan, outputs)
    answer, law = calibrated_forces.decode(found, readings, np.zeros(len(raw))), RelaxingForce(design)
    # the motion begins at rest
    times, slow, load = (np.insert(each, 0, 0.0, axis=0) for each in (times, answer.force, answer.load))
    rows = zip(times.tolist(), slow, load[:, 1:], strict=True)
    observed = np.array([law.step(*row) for row in rows])
    off = decode_readings.law_errors(design, times, slow, load, observed)[1:]
    half = calibrated_forces.relaxing_half_width(
        answer.half_width, answer.force, observed[1:], off, decode_readings.most_growth(design)
    )
    return MadeStates(felt, outputs, law.slow * answer.force, observed[1:], half)


def outputs_of(found: Fit, raw: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return outputs of the elements (n, k) as their converter sends them, and whether they lie at a rail."""
    elements = parts.of_design(found.sensor.design)
    low, high, step = (np.array([getattr(e, name) for e in elements]) for name in ("low", "high", "step"))
    return converted(raw, low, high, step)


# Decoding

DECODED = (
    "status",
    *(
        f"{name}_{axis}_{unit}"
        for name, unit in (("force", "N"), ("half_width", "N"), ("shift", "mm"))
        for axis in "xyz"
    ),
)
"""Columns that decoding by a calibration adds: force, half of its 90 % interval, shift of the magnet."""
ADDED = {*DECODED, *decode_readings.TIME_COLUMNS, *decode_readings.AMBIENT_COLUMNS}
"""Those that it may add."""


def decoded_rows(
    found: Fit, readings: Array, times: Array | None, warmer: Array, offset: Array | None = None
) -> list[FlatRow]:
    """Return the columns DECODED of readings (n, k), in the elements' unit; with times also `TIME_COLUMNS`.

    An interval grows as its force does by what relaxes, and by what another law would change.

    offset : of a zero, see `decoded_arrays`.
    """
    words, force, half, shift, load, ambient = decoded_arrays(found, readings, warmer, offset)
    columns, numbers = DECODED, [force, half, shift]
    if times is not None:
        coder, field = (
            calibrated_forces.coder_of(found, warm=True),
            calibrated_forces.fields_of(found, readings, warmer),
        )
        total, words, relaxing = decode_readings.over_time(coder, field, times, force, load, words)
        numbers = [
            total,
            calibrated_forces.relaxing_half_width(
                half, force, total, relaxing[:, 3], decode_readings.most_growth(found.design)
            ),
            shift,
            relaxing,
        ]
        columns = (*DECODED, *decode_readings.TIME_COLUMNS)
    columns, numbers = (*columns, *decode_readings.AMBIENT_COLUMNS[: ambient.shape[1]]), [*numbers, ambient]
    return [
        dict(zip(columns, (word, *row), strict=True))
        for word, row in zip(words, np.hstack(numbers).tolist(), strict=True)
    ]


def decoded_arrays(
    found: Fit, readings: Array, warmer: Array, offset: Array | None = None
) -> tuple[list[Any], Array, Array, Array, Array, Array]:
    """Return status, force of slow loading, half of its interval, shift and load (n, 3) of readings (n, k), and
    `decode_readings.AMBIENT_COLUMNS`, (n, 6), or (n, 0) where no field is rejected.

    offset : (k,), T, if a zero was taken: it moves readings, but not the rails of the elements.
    """
    answer = calibrated_forces.decode(found, readings, warmer, offset)
    full = np.asarray(at_rails(found.sensor.design, readings).any(axis=1))
    force, half, shift, load, ambient = (
        np.where(full[:, None], np.nan, each)
        for each in (answer.force, answer.half_width, answer.shift, answer.load, answer.ambient)
    )
    return np.where(full, "saturated", answer.status).tolist(), force, half, shift, load, ambient


def regressed_rows(
    found: Regression, readings: Array, times: Array | None, temperature: Array, offset: Array | None = None
) -> list[FlatRow]:
    """Return the columns of `decoded_rows` by a regression: no shift, and forces of slow loading, with times, too."""
    words, force, half = found.decode(readings, temperature, offset)
    if times is not None:
        words = over_time(found, readings, times, words, force, half)
    unknown = np.full((len(words), 3 if times is None else 3 + len(decode_readings.TIME_COLUMNS)), np.nan)
    columns = DECODED if times is None else (*DECODED, *decode_readings.TIME_COLUMNS)
    return [
        dict(zip(columns, (word, *row), strict=True))
        for word, row in zip(words, np.hstack([force, half, unknown]).tolist(), strict=True)
    ]


def over_time(
    found: Regression, readings: Array, times: Array, words: Sequence[Status], force: Array, half: Array
) -> list[Status]:
    """Return the statuses of rows by those before them; of a frozen one force and half width (n, 3) become NaN."""
    series = found.series()
    said = [series.step(*row) for row in zip(times.tolist(), readings, words, strict=True)]
    frozen = [word == "frozen" for word in said]
    force[frozen] = half[frozen] = np.nan
    return said


def holds_regression(path: Path) -> bool:
    """Return whether a file says that it is the calibration by a regression; `decoder_of` reads it."""
    return json_object(path).get("decoder") == "regression"


def regression_sentences(found: Regression, known: int, count: int, *, timed: bool) -> list[str]:
    """Return what a regression does not know of rows of which some have known temperatures, in words."""
    said = []
    if timed:
        said.append(
            f"a {found.words} gives forces of loading as slow as on the bench: what the silicone relaxes is not known"
        )
    if not found.is_thermal:
        unused = "the rows have temperatures, but the bench of the calibration had none: they are not used"
        return said + [unused] * (known > 0)
    if known < count:
        cold, warm = found.temperature_C
        said.append(
            f"the temperature of {count - known} of {count} rows is not known: their intervals hold from {cold:.3g} "
            f"to {warm:.3g} C, as on the bench"
        )
    return said


def is_thermal(found: Fit | Regression) -> bool:
    """Return whether temperatures of readings count: whether the bench had some."""
    if isinstance(found, Regression):
        return found.is_thermal
    return bool({"remanence_per_K", "gain_per_K"} & {*found.sensor.unknowns.names})


def given_temperature(found: Fit | Regression, temperature: float | None) -> float:
    """Return the temperature, C, that an option gives; NaN without one."""
    if temperature is None:
        return math.nan
    if not is_thermal(found):
        raise BadInput("--temperature has no meaning for a calibration whose bench had no temperatures: leave it out")
    if not COLDEST < temperature < HOTTEST:
        raise BadInput(f"--temperature must lie between {COLDEST:g} and {HOTTEST:g} C; got {temperature:g}")
    return temperature


def cold_sentence(found: Fit, what: str) -> str:
    """Return a sentence on readings whose temperature is not known."""
    wide = QUANTILE * calibrated_forces.UNKNOWN
    return (
        f"the temperature of {what} is not known: it is taken for {found.sensor.temperature_C:g} C, and the "
        f"intervals hold for {wide:.0f} K more or less; give --temperature, or temperatures with the readings"
    )


def warmer_of(found: Fit, temperature: Array) -> tuple[Array, list[str]]:
    """Return T - T_0 of rows (n,), in a gap that of the rows beside it, and a sentence if some or all are missing.

    It is NaN where no row has a temperature, and 0 if the sensor's readings do not depend on it.
    """
    warmer, known = temperature - found.sensor.temperature_C, np.isfinite(temperature)
    if not is_thermal(found):
        unused = "the rows have temperatures, but the bench of the calibration had none: they are not used"
        return np.zeros(len(warmer)), [unused] * bool(known.any())
    if not known.any():
        return warmer, [cold_sentence(found, "the readings")]
    if known.all():
        return warmer, []
    rows = np.arange(len(warmer))
    said = f"{(~known).sum()} of {len(rows)} rows have no temperature: it is interpolated from the rows beside them"
    return np.interp(rows, rows[known], warmer[known]), [said]


def at_rails(design: Design, readings: Array) -> NDArray[np.bool_]:
    """Return which readings (n, k), in the elements' unit, lie at a rail."""
    elements = parts.of_design(design)
    low, high = (np.array([getattr(element, name) for element in elements]) for name in ("low", "high"))
    return np.asarray((readings <= low) | (readings >= high))


def _rows(
    found: Fit | Regression,
    readings: Array,
    times: Array | None,
    temperature: Array,
    at_rest: NDArray[np.bool_] | None = None,
) -> tuple[list[FlatRow], list[str]]:
    """Return decoded rows of readings (n, k) at temperatures (n,), C, and what is to be said of them.

    at_rest : (n,) rows whose readings are taken for those at rest.
    """
    if isinstance(found, Regression):
        known, offset = int(np.isfinite(temperature).sum()), None
        said = regression_sentences(found, known, len(temperature), timed=times is not None)
        if at_rest is not None:
            found.check_zero()
            offset = found.zero_offset(readings_within(found.design, readings[at_rest]))
            said += found.zero_doubts(offset)
        return regressed_rows(found, readings, times, temperature, offset), said
    warmer, said = warmer_of(found, temperature)
    offset, design = None, found.sensor.design
    if at_rest is not None:
        within = readings_within(design, readings[at_rest])
        rest = calibrated_forces.fields_of(found, within, warmer[at_rest])
        offset = zero_offset(calibrated_forces.coder_of(found, warm=True), rest)
        said += calibrated_forces.zero_doubts(found, offset, warm=bool(np.isfinite(warmer).all()))
    rows = decoded_rows(found, readings, times, warmer, offset)
    if times is not None:
        relaxing = np.array([[row[name] for name in decode_readings.TIME_COLUMNS] for row in rows])
        said += decode_readings.law_sentences(design, relaxing)
    return rows, said


def readings_within(design: Design, readings: Array) -> Array:
    """Return readings (n, k), NaN for those at a rail."""
    return np.where(at_rails(design, readings), np.nan, readings)


def _decode_one(found: Fit | Regression, design: Design, text: str, temperature: float) -> Result:
    """Decode one set of readings a,b,c at a temperature, C, NaN if it is not known."""
    names, values = parts.columns(parts.of_design(design)), parse_numbers("--readings", text)
    if len(values) != len(names):
        raise BadInput(f"--readings takes {len(names)} numbers, {','.join(names)}; got {len(values)}")
    (row,), said = _rows(found, np.array([values]), None, np.array([temperature]))
    record = {
        "status": row["status"],
        "message": decode_readings.WHY[row["status"]],
        "level": "regression" if isinstance(found, Regression) else "calibration",
        "readings": values,
    }
    if is_thermal(found):
        record["temperature_C"] = temperature
    for name, unit in (("force", "N"), ("half_width", "N"), ("shift", "mm")):
        record[f"{name}_{unit}"] = [row[f"{name}_{axis}_{unit}"] for axis in "xyz"]
    record |= decode_readings.ambient_record([row[n] for n in decode_readings.AMBIENT_COLUMNS if n in row])
    lost = [] if row["status"] == "ok" else [record["message"]]
    return Result(title="Decoded", records=[record], remarks=said, failures=lost)


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
        ("--level", decoding.source.level),
        ("--responses", decoding.source.responses),
        ("--tolerance", decoding.tolerances),
        ("--units", decoding.units),
        ("--ignore-tilt", decoding.ignore_tilt),
    ):
        if given:
            raise BadInput(f"{option} has no place beside --calibration, which fixes it: leave it out")
    found = decoder_of(path, design, reject_ambient=decoding.reject_ambient)
    warmth = given_temperature(found, decoding.temperature)
    if decoding.readings is not None:
        return _decode_one(found, design, decoding.readings, warmth)
    assert decoding.file is not None
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    raw, numbers, times, temperature = bench_file.read_readings(decoding.file, design)
    if added := [name for name in raw.columns if name in ADDED]:
        raise BadInput(f"{decoding.file} has a column {added[0]} already, which decoding adds: rename or delete it")
    if not math.isnan(warmth):
        if np.isfinite(temperature).any():
            raise BadInput(f"{decoding.file} has temperatures: leave --temperature out")
        temperature = np.full(len(numbers), warmth)
    at_rest = None
    if decoding.zero is not None:
        at_rest = decode_readings.rows_at_rest(decoding, numbers, times, at_rails(design, numbers))
    decoded, said = _rows(found, numbers, times, temperature, at_rest)
    rows = [{**texts, **row} for texts, row in zip(raw.fillna("").to_dict("records"), decoded, strict=True)]
    table = table_of(rows).to_csv(index=False)
    if target is not None:
        atomic_files.write_text(target, table)
    elif not as_json:
        print(table, end="", flush=True)
    counts = Counter(row["status"] for row in rows)
    said += [
        f"{n} of {len(rows)} rows {word}: {decode_readings.WHY[word]}" for word, n in counts.items() if word != "ok"
    ]
    lost = sum(n for word, n in counts.items() if word not in decode_readings.WITH_POSE)
    return Result(
        title="Decoded rows",
        records=rows if as_json and target is None else [],
        shown=[],
        remarks=said,
        failures=["no row has a force"] if lost == len(rows) else [],
    )
