"""Arrays as one sensor: the table [array] of a design file, readings of all beams, and their joint decoding.

Readings stand beam by beam, each beam's elements in their order, with the names b1_S1, b1_S2 and so on. The force of
a frame is the sum over its beams, unknown where that of a beam is, and its status that of the first beam that has
none, else of the first one that is not ok. Beams at rest have forces of noise and tolerances, and are "uncalibrated"
as a single sensor at rest: the frame is so only where no beam bears a load for sure.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analytic import beam_arrays, parts
from analytic.array_stream import ArrayStream, Frame
from analytic.beam_arrays import BeamArray
from analytic.decode import Decoder
from analytic.hall import at_rail
from analytic.inverse.forward_model import model
from geometry.array_design import POLARITIES, ArrayDesign, grid_array, poles_of
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies.inputs.units import quantity
from studies.inputs.user_input import parse_numbers, table_beside
from studies.output import atomic_files
from studies.output.literals import toml
from studies.output.records import FlatRow
from studies.output.result import Result, Table, failure_of
from studies.sensing import decode_readings
from studies.sensing.decode_readings import Source
from studies.sensing.disturbed_loads import loads_of
from studies.sensing.field_readings import pose_of, read_rows, write_rows

if TYPE_CHECKING:
    from analytic.decode import Status
    from studies.inputs.option_groups import Arraying, Decoding, Pose

KEYS: dict[str, Any] = {
    "rows": int, "columns": int, "pitch": float | str, "places": list[str], "polarity": str | list[str],
}  # fmt: skip
"""Keys of the table [array] of a design file."""
MOST = 16
"""Largest number of rows and of columns; their product is the largest number of places."""
WHOLE, FAR_ERROR = 16, 1e-3
"""Number of beams up to which the motion of each magnet counts at all elements, which takes less than 1 ms a frame;
of more, the error over the range that a reach may make: far below the errors of mechanics and elements."""


@dataclass(frozen=True, slots=True)
class Grid:
    """What array is asked for; the pitch in mm, None for 2 D.

    places : of the axes, (x, y), mm, in place of rows, columns and pitch.
    """

    rows: int = 3
    columns: int = 3
    pitch: float | None = None
    polarity: str | tuple[str, ...] = "up"
    places: tuple[tuple[float, float], ...] = ()

    def __len__(self) -> int:
        return len(self.places) or self.rows * self.columns

    @property
    def polarities(self) -> list[str | tuple[str, ...]]:
        """Polarities of different poles that such an array may have, its own one by its own name."""
        size, found = (1, len(self.places)) if self.places else (self.rows, self.columns), dict[Any, Any]()
        for words in POLARITIES[: 1 if self.places else None]:
            found.setdefault(tuple(poles_of(words, *size)), words)
        found[tuple(poles_of(self.polarity, *size))] = self.polarity
        return list(found.values())

    @property
    def words(self) -> str:
        """Number of beams, in words."""
        return f"{len(self.places)} beams" if self.places else f"{self.rows} x {self.columns} beams"

    def pitch_of(self, design: Design) -> float:
        """Return the least distance of two beams, mm; refuse what `ArrayDesign` refuses."""
        own = self.design(design)
        return own.pitch if self.places else 2 * design.D if self.pitch is None else self.pitch

    def design(self, design: Design, polarity: str | tuple[str, ...] | None = None) -> ArrayDesign:
        """Return the array of a design."""
        words = self.polarity if polarity is None else polarity
        if self.places:
            return ArrayDesign(design, np.array(self.places), poles_of(words, 1, len(self.places)))
        return grid_array(design, self.rows, self.columns, 2 * design.D if self.pitch is None else self.pitch, words)

    def array(
        self, coder: Decoder, pitch: float, polarity: str | tuple[str, ...], *, ambient: bool = False
    ) -> BeamArray:
        """Return the array at another pitch, the least distance of two beams, and another polarity.

        ambient : as in `BeamArray`.
        """
        # laws far away need pitches at which no array is built
        own = self.design(coder.forward.design, polarity)
        return BeamArray(coder.forward, own.places / own.pitch, own.poles, pitch, ambient=ambient)


def stated_grid(source: str, given: dict[str, Any] | None = None) -> Grid | None:
    """Return the array of a design file's table [array], with other values `given`; None without any of both."""
    values = table_beside(source, "array", KEYS) | (given or {})
    if not values:
        return None
    for name in ("rows", "columns"):
        if not 1 <= values.get(name, 1) <= MOST:
            raise BadInput(f"{name} of an array must lie between 1 and {MOST}; got {values[name]}")
    if "pitch" in values:
        values["pitch"] = quantity("pitch", values["pitch"], "mm")
    if "places" in values:
        if both := [name for name in ("rows", "columns", "pitch") if name in values]:
            raise BadInput(f"places of an array stand in place of {both[0]}: leave one of them out")
        values["places"] = tuple(map(_place, values["places"]))
        if not 2 <= len(values["places"]) <= MOST**2:
            raise BadInput(f"an array has 2 to {MOST**2} places; got {len(values['places'])}")
    polarity = values.get("polarity", "up")
    if polarity not in POLARITIES:
        listed = polarity.split(",") if isinstance(polarity, str) else polarity
        values["polarity"] = tuple(word.strip() for word in listed)
    elif "places" in values and polarity != "up":
        raise BadInput(f"an array of places has no {polarity}: give its polarity as a list of up and down")
    return Grid(**values)


def _place(text: str) -> tuple[float, float]:
    values = parse_numbers("places", text)
    if len(values) != 2 or not all(map(math.isfinite, values)):
        raise BadInput(f"places of an array are X,Y in mm, such as '12,0'; got {text!r}")
    return values[0], values[1]


def stated_array(source: str, design: Design) -> ArrayDesign | None:
    """Return the array that a design file states, None if it states a single sensor."""
    grid = stated_grid(source)
    return None if grid is None else grid.design(design)


def array_text(grid: Grid) -> str:
    """Return the table [array] of a design file.

    >>> print(array_text(Grid(2, 3, 12.0, "rows")), end="")
    [array]
    rows = 2
    columns = 3
    pitch = 12.0
    polarity = "rows"
    """
    values: dict[str, Any] = {"rows": grid.rows, "columns": grid.columns, "pitch": grid.pitch}
    if grid.places:
        values = {"places": [f"{x},{y}" for x, y in grid.places]}
    values["polarity"] = grid.polarity if isinstance(grid.polarity, str) else list(grid.polarity)
    stated = {key: value for key, value in values.items() if value is not None}
    return "\n".join(["[array]", *toml(stated)]) + "\n"


def grid_of(source: str, options: Arraying) -> Grid:
    """Return the array of the options, and where they name none that of the design file's table [array]."""
    names = ("rows", "columns", "pitch", "polarity")
    given = {name: value for name in names if (value := getattr(options, name)) is not None}
    if not 0 < options.error < 100:
        raise BadInput(f"--error must be above 0 and below 100 percent; got {options.error:g}")
    return stated_grid(source, given) or Grid()


# Readings


def read(array: ArrayDesign, pose: Pose, beam: int | None) -> Result:
    """Return what all beams read where one of them, counted from 1, or all are in a pose, and the rest at rest.

    It refuses what `analytic.beam_arrays.standing` refuses.
    """
    n = len(array)
    beam_arrays.standing(model(array.design), array)
    if beam is not None and not 1 <= beam <= n:
        raise BadInput(f"--beam must lie between 1 and {n}; got {beam}")
    shift, tilt = pose_of(pose)
    moved = np.arange(n) == beam - 1 if beam is not None else np.full(n, True)
    shifts, tilts = moved[:, None] * np.array(shift), moved[:, None] * np.array(tilt)
    whole, own = beam_arrays.readings_in_poses(array, shifts, tilts)
    elements = parts.of_design(array.design)
    null, gain = (np.array([getattr(e, name) for e in elements]) for name in ("null", "gain"))
    volts = elements[0].unit == "V"
    beams: list[FlatRow] = [
        {
            "beam": k + 1,
            "place_mm": array.places[k].tolist(),
            "north": array.of_beam(k).magnet_north,
            "shift_mm": shifts[k].tolist(),
            "rotation_rad": tilts[k].tolist(),
            "readings_T": whole[k].tolist(),
            "by_neighbours_T": (whole[k] - own[k]).tolist(),
            "readings_V": (null + gain * whole[k]).tolist() if volts else None,
            "saturated": at_rail(elements, whole[k][:, None])[:, 0].tolist(),
        }
        for k in range(n)
    ]
    names = [element.name for element in parts.of_design(array)]
    record = {"status": "ok", "beams": beams, "elements": names, "readings_T": whole.ravel().tolist()}
    if volts:
        record["readings_V"] = (null + gain * whole).ravel().tolist()
    values = null + gain * whole if volts else 1e3 * whole
    columns = [f"{element.name}_{'V' if volts else 'mT'}" for element in elements]
    shown = [
        {"beam": row["beam"], "north": row["north"], **_flat("place", row["place_mm"], "mm")}
        | dict(zip(columns, values[k].tolist(), strict=True))
        | {"neighbours_mT": 1e3 * float(np.abs(whole[k] - own[k]).max())}
        for k, row in enumerate(beams)
    ]
    return Result(title="Readings", records=[record], shown=[Table(title="Readings of the beams", rows=shown)])


def _flat(name: str, values: Sequence[float], unit: str) -> FlatRow:
    return {f"{name}_{axis}_{unit}": value for axis, value in zip("xyz", values, strict=False)}


# Decoding


FOUND = ("status", *(f"{name}_{axis}_{unit}" for name, unit in (("force", "N"), ("shift", "mm")) for axis in "xyz"))
"""Columns of each beam, behind its name b1_ and so on."""
NET = ("status", "force_x_N", "force_y_N", "force_z_N")
"""Columns of the whole frame."""


def with_reaches(
    coder: Decoder, beams: BeamArray, shares: Sequence[float]
) -> tuple[list[tuple[BeamArray, float]], tuple[float, str]]:
    """Return for each share of the range the beams with the least reach whose error is within it, and that error, N.

    Behind them the range: its force, N, and which one it is, in words.
    """
    loads, full, words = loads_of(coder, None)
    distances, errors = beam_arrays.errors_by_reach(coder, beams, loads.poses.shift)
    least = [int(np.flatnonzero(errors <= share * full)[0]) for share in shares]
    # beyond rounding of the distances
    reaches = np.where(errors > 0, distances * (1 + 1e-6), math.inf).tolist()
    return [(replace(beams, reach=reaches[k]), float(errors[k])) for k in least], (full, words)


def _near(coder: Decoder, beams: BeamArray) -> tuple[BeamArray, list[str]]:
    """Return the beams with the reach that their number needs, and what is to be said of it."""
    if len(beams) <= WHOLE:
        return beams, []
    ((near, error),), (full, words) = with_reaches(coder, beams, [FAR_ERROR])
    said = (
        f"of {len(beams)} beams, magnets farther than {near.reach:.3g} mm count as at rest for a beam: an error of "
        f"some {error:.2g} N, {100 * error / full:.1g} % of {full:.3g} N ({words})"
    )
    return near, [] if math.isinf(near.reach) else [said]


class ArrayDecoder:
    """Decodes frames of an array to rows.

    coder : of one beam. statuses : returns those of a frame's beams, such as
        `studies.sensitivity.decode_tolerances.frame_statuses`.
    jitter : as in `analytic.stream.Stream`.
    reject_ambient : whether a uniform field, the same for all beams, is decoded along.

    Attributes
    ----------
    said : which magnets count as at rest, and the error of that; empty where none does.
    """

    def __init__(
        self,
        array: ArrayDesign,
        coder: Decoder,
        statuses: Callable[[Frame], list[Status]],
        jitter: float = 0.0,
        *,
        reject_ambient: bool = False,
    ) -> None:
        standing = beam_arrays.standing(coder.forward, array, ambient=reject_ambient)
        beams, self.said = _near(coder, standing)
        self.stream = ArrayStream(coder, beams, jitter)
        self._statuses, self._shape = statuses, (len(array), len(coder.forward.elements))
        self.columns = (*NET, *(f"b{k}_{name}" for k in range(1, len(array) + 1) for name in FOUND))

    def fields(self, readings: Array) -> Array:
        """Return the fields (f, n, k), T, of frames of readings (f, n k), in the elements' unit."""
        rows = readings.reshape(-1, self._shape[1])
        return decode_readings.in_tesla(self.stream.coder.forward.elements, rows, None).reshape(-1, *self._shape)

    def zero(self, fields: Array) -> None:
        """Take frames of fields (m, n, k), T, for those of the array at rest."""
        self.stream.zero(fields)

    def frame(self, fields: Array, time: float | None) -> tuple[Frame, list[Status]]:
        """Decode a frame of fields (n, k), T, and return the statuses of its beams."""
        found = self.stream.step(fields, time)
        return found, self._statuses(found)

    def half_widths(self, shift: Array) -> Array | None:
        """Return half of the 90 % intervals (f, n, 3), N, of forces at shifts (f, n, 3), mm; None without any."""
        return None

    def rows(self, fields: Array, times: Sequence[float | None]) -> list[tuple[Any, ...]]:
        """Return the columns of frames of fields (f, n, k), T."""
        return [self.row(*each) for each in zip(fields, times, strict=True)]

    def row(self, fields: Array, time: float | None) -> tuple[Any, ...]:
        """Return the columns of a frame of fields (n, k), T."""
        found, words = self.frame(fields, time)
        beams = zip(words, found.force.tolist(), found.shift.tolist(), strict=True)
        each = [value for word, force, shift in beams for value in (word, *force, *shift)]
        return frame_status(words, found.force), *found.force.sum(axis=0).tolist(), *each


def frame_status(words: Sequence[Status], force: Array) -> Status:
    """Return the status of a frame from those of its beams and their forces (n, 3), N."""
    if told := [word for word in words if word not in ("ok", "uncalibrated")]:
        # those without a force first
        return min(told, key=lambda word: word in decode_readings.WITH_POSE)
    loaded = any(word == "ok" and each.any() for word, each in zip(words, force, strict=True))
    return "uncalibrated" if "uncalibrated" in words and not loaded else "ok"


def decode_text(decoder: ArrayDecoder, text: str, source: Source) -> Result:
    """Decode one frame a,b,c of all beams."""
    elements, n = decoder.stream.coder.forward.elements, len(decoder.stream.array)
    values = parse_numbers("--readings", text)
    if len(values) != n * len(elements):
        names = ",".join(element.name for element in elements)
        raise BadInput(
            f"--readings takes {n * len(elements)} numbers, {names} of each of {n} beams; got {len(values)}"
        )
    (fields,) = decoder.fields(np.array([values]))
    found, words = decoder.frame(fields, None)
    places = decoder.stream.array.pitch * decoder.stream.array.layout
    beams: list[FlatRow] = [
        {
            "beam": k + 1,
            "status": words[k],
            "message": decode_readings.WHY[words[k]],
            "place_mm": places[k].tolist(),
            "shift_mm": found.shift[k].tolist(),
            "rotation_rad": found.tilt[k].tolist(),
            "force_N": found.force[k].tolist(),
            "depth_mm": float(found.load[k, 0]),
            "shear_mm": float(found.load[k, 1]),
            "shear_y_mm": float(found.load[k, 2]),
        }
        for k in range(n)
    ]
    if (half := decoder.half_widths(found.shift[None])) is not None:
        beams = [row | {"half_width_N": wide} for row, wide in zip(beams, half[0].tolist(), strict=True)]
    status = frame_status(words, found.force)
    record = {
        "status": status,
        "message": decode_readings.WHY[status],
        "level": source.name,
        "level_reason": source.reason,
        "force_N": found.force.sum(axis=0).tolist(),
        "beams": beams,
    }
    lost = [] if status in decode_readings.WITH_POSE else failure_of([record])
    shown = [
        {"beam": row["beam"], "status": row["status"]}
        | _flat("place", row["place_mm"], "mm")
        | _flat("force", row["force_N"], "N")
        | _flat("shift", row["shift_mm"], "mm")
        for row in beams
    ]
    return Result(
        title="Decoded",
        records=[record],
        shown=[Table(title="Decoded beams", rows=shown)],
        warnings=[source.warning] * bool(source.warning),
        remarks=decoder.said,
        failures=lost,
    )


def decode_file(
    array: ArrayDesign, decoder: ArrayDecoder, decoding: Decoding, source: Source, out: Path | None
) -> Result:
    """Decode a table of frames as a stream, and add the columns of `ArrayDecoder`; without `out` it is printed."""
    assert decoding.file is not None
    elements = parts.of_design(array)
    wanted = [f"{name}_{elements[0].unit}" for name in parts.columns(elements)]
    target = None if out is None else atomic_files.check_output_file(out, ".csv")
    added = list(decoder.columns)
    head, rows, values = read_rows(decoding.file, wanted, added, holes=True)
    fields, times = decoder.fields(values), decode_readings.times_of(decoding, head, rows)
    if decoding.zero is not None:
        full = at_rail(elements, fields.reshape(len(rows), -1).T).T
        rest = decode_readings.rows_at_rest(decoding, values, times, full)
        decoder.zero(np.where(full.reshape(fields.shape), np.nan, fields)[rest])
    found = decoder.rows(fields, [None] * len(rows) if times is None else times.tolist())
    write_rows(target, [*head, *added], rows, found)
    counts = Counter(row[0] for row in found)
    said = [f"{n} of {len(rows)} frames {w}: {decode_readings.WHY[w]}" for w, n in counts.items() if w != "ok"]
    known = sum(n for word, n in counts.items() if word in decode_readings.WITH_POSE)
    return Result(
        title="Decoded frames",
        records=[] if target is None else [dict(counts)],
        shown=[],
        warnings=[source.warning] * bool(source.warning),
        remarks=[*source.said, *decoder.said, *said],
        failures=[] if known else ["no frame has the force of all its beams"],
    )
