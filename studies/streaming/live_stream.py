"""Forces of a sensor while its readings arrive: from bytes to readings, to forces, to a screen, a file or a page.

A row's time is that of its arrival, which may lag by some milliseconds (`JITTER`), unless each frame begins with the
time of the device (`studies.streaming.clocks`). Forces are those of a silicone that relaxes (`analytic.time_series`);
where a time is not known they are those of slow loading, with a status that says so and a wider interval.
"""

from __future__ import annotations

import contextlib
import csv
import math
import select
import signal
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from analytic import parts
from analytic.beam_arrays import readings_in_poses
from analytic.decode import field_of, state
from analytic.hall import at_rail
from analytic.inverse.forward_model import model, readings_at, readings_with_slopes
from analytic.stream import Stream
from analytic.time_series import RelaxingForce
from geometry.array_design import ArrayDesign
from geometry.arrays import Array
from geometry.design import BadInput, Design
from studies import quantities
from studies.inputs.option_groups import Decoding, SourceOfLoad, Streaming
from studies.inputs.units import IN_HEADS
from studies.inputs.user_input import parse_numbers
from studies.output import atomic_files, console
from studies.output.result import Result
from studies.sensing import decode_readings
from studies.sensing.array_readings import ArrayDecoder
from studies.sensitivity.decode_tolerances import AtRest, frame_statuses
from studies.simulation import mechanics_sources
from studies.streaming import frames, recording, sources
from studies.streaming.clocks import Arrival, DeviceClock, Row
from studies.streaming.sources import Decoded, Sink

if TYPE_CHECKING:
    from studies.calibration.force_regression import Regression
    from studies.calibration.sensor_fit import Fit
    from studies.web import explorer_server

JITTER = 0.02
"""Time, s, by which a row may come late without being taken for one after missing rows."""
AXES = "x,y,z"
REDRAW = 0.1
"""Time between two pictures of the screen or the page, s."""
RECENT = 2000
"""Number of rows of which the latency is kept, and of which a zero is taken at most."""
TARE = 0.5
"""Time, s, whose readings a zero takes when it is asked for."""
Sensor = Design | ArrayDesign
FOUND = ("status", *(f"{name}_{axis}_{unit}" for name, unit in (("force", "N"), ("shift", "mm")) for axis in "xyz"))
HALF = ("half_width_x_N", "half_width_y_N", "half_width_z_N")
"""Columns of a row: those of `decode --file`; with a calibration also half of the force's 90 % interval."""


class Nominal:
    """Decodes rows by a design and a level of the formulas, or states; temperatures count in a calibration only."""

    thermal = False

    def __init__(self, design: Design, options: Streaming, jitter: float) -> None:
        source = mechanics_sources.source_of(design, options.source)
        self.said = [*source.said, *[source.warning] * bool(source.warning)]
        coder = decode_readings.prepare(design, source, reject_ambient=options.reject_ambient)
        self.stream = _loaded(Stream(coder, jitter))
        self.columns = (*FOUND, *decode_readings.AMBIENT_COLUMNS * options.reject_ambient)
        self._at_rest = AtRest(self.stream.coder)

    def zero(self, readings: Array, temperatures: Array) -> None:
        self.stream.zero(self._fields(readings))

    def _fields(self, readings: Array) -> Array:
        return field_of(self.stream.coder.forward.elements, readings)

    def rows(self, times: Sequence[float], readings: Array, temperatures: Array) -> Iterator[tuple[Any, ...]]:
        fields = self._fields(readings)
        shares = self._at_rest.probability(fields + self.stream.offset).tolist()
        rows = [self.stream.step(tuple(field), moment) for field, moment in zip(fields.tolist(), times, strict=True)]
        shift = np.array([row.shift for row in rows]).reshape(-1, 3)
        ambient = decode_readings.ambient_columns(self.stream.coder, fields + self.stream.offset, shift).tolist()
        for row, share, each in zip(rows, shares, ambient, strict=True):
            yield self._at_rest.status(row.status, share, math.hypot(*row.force)), *row.force, *row.shift, *each


class Calibrated:
    """Decodes rows by a calibration, with the interval of each force.

    warm : whether the rows have temperatures.
    """

    def __init__(self, found: Fit, jitter: float, *, warm: bool) -> None:
        from studies.calibration import calibrated_forces, calibration_file

        self._fit, self._mechanics, self._file = found, calibrated_forces, calibration_file
        self.columns = (*FOUND, *HALF, *decode_readings.AMBIENT_COLUMNS * found.rejects_ambient)
        self.thermal = calibration_file.is_thermal(found)
        self._warm = warm or not self.thermal
        self.stream = _loaded(Stream(calibrated_forces.coder_of(found, warm=self._warm), jitter))
        self._zeroed: Sequence[str] = ()
        self._count = self._cold = self._unused = 0
        self._rest()

    @property
    def said(self) -> list[str]:
        said = list(self._zeroed)
        if self._cold:
            said.append(self._file.cold_sentence(self._fit, f"{self._cold} of {self._count} rows"))
        if self._unused:
            said.append("the rows have temperatures, but the bench of the calibration had none: they are not used")
        return said

    def _rest(self) -> None:
        """Begin with a silicone that has relaxed."""
        design = self.stream.coder.forward.design
        self._doubted = [RelaxingForce(design, each) for each in decode_readings.doubted_branches(design)]
        self._growth = decode_readings.most_growth(design)

    def _warmer(self, temperatures: Array) -> Array:
        """Return T - T_0 of rows (n,), NaN where it is not known; 0 where it does not matter."""
        return temperatures - self._fit.sensor.temperature_C if self.thermal else np.zeros(len(temperatures))

    def zero(self, readings: Array, temperatures: Array) -> None:
        self._rest()
        self.stream.zero(self._mechanics.fields_of(self._fit, readings, self._warmer(temperatures)))
        self._zeroed = self._mechanics.zero_doubts(self._fit, self.stream.offset, warm=self._warm)

    def rows(self, times: Sequence[float], readings: Array, temperatures: Array) -> Iterator[tuple[Any, ...]]:
        warmer = self._warmer(temperatures)
        self._count += len(warmer)
        self._cold += int(np.isnan(warmer).sum())
        self._unused += 0 if self.thermal else int(np.isfinite(temperatures).sum())
        fields, zeroed = self._mechanics.fields_of(self._fit, readings, warmer), bool(self.stream.offset.any())
        rows = [self.stream.step(tuple(field), moment) for field, moment in zip(fields.tolist(), times, strict=True)]
        shift, force = (np.array([getattr(row, name) for row in rows]).reshape(-1, 3) for name in ("shift", "force"))
        _, slow, load, _ = state(self.stream.coder, np.ascontiguousarray(shift.T))
        # a frozen element's force is not known: it says nothing of what relaxes
        slow[:, [row.status == "frozen" for row in rows]] = np.nan
        known, half = np.isfinite(force).all(axis=1), np.full_like(force, np.nan)
        half[known] = self._mechanics.intervals(
            self._fit,
            [self._fit.covariance],
            shift[known],
            warmer[known],
            zeroed=zeroed,
        )[0]
        off = np.array(
            [self._law_error(*row) for row in zip(times, slow.T, load.T[:, 1:], force, strict=True)], dtype=float
        )
        wide = self._mechanics.relaxing_half_width(half, slow.T, force, off, self._growth)
        ambient = self._mechanics.ambient_columns(
            self._fit, fields + self.stream.offset, shift, warmer, zeroed=zeroed
        ).tolist()
        for row, each, field in zip(rows, wide.tolist(), ambient, strict=True):
            yield row.status, *row.force, *row.shift, *each, *field

    def _law_error(self, moment: float, slow: Array, shear: Array, force: Array) -> float:
        """Return how much a force (3,) may be off, N, because the silicone's law, or the row's time, is not known."""
        found = [law.step(moment, slow, shear) for law in self._doubted]
        if math.isnan(moment):
            return max((law.reach(slow, shear) for law in self._doubted), default=0.0)
        return max((float(np.linalg.norm(each - force)) for each in found), default=0.0)


class Regressed:
    """Decodes rows by a regression, without a pose; forces are those of loading as slow as on the bench."""

    columns = (*FOUND, *HALF)

    def __init__(self, found: Regression, jitter: float) -> None:
        from studies.calibration.calibration_file import regression_sentences

        self._found, self._jitter, self.thermal = found, jitter, found.is_thermal
        self._series, self._offset = found.series(jitter), np.zeros(len(found.rest))
        self._zeroed: Sequence[str] = ()
        self._known = self._count = 0
        self._sentences = regression_sentences

    @property
    def said(self) -> list[str]:
        return [*self._zeroed, *self._sentences(self._found, self._known, self._count, timed=True)]

    def zero(self, readings: Array, temperatures: Array) -> None:
        try:
            self._found.check_zero()
        except BadInput as error:  # asked for while rows arrive
            self._zeroed = [str(error)]
            return
        self._offset = self._found.zero_offset(readings)
        self._series, self._zeroed = self._found.series(self._jitter), self._found.zero_doubts(self._offset)

    def rows(self, times: Sequence[float], readings: Array, temperatures: Array) -> Iterator[tuple[Any, ...]]:
        self._count += len(temperatures)
        self._known += int(np.isfinite(temperatures).sum())
        words, force, half = self._found.decode(readings, temperatures, self._offset)
        for moment, row, word, *numbers in zip(times, readings, words, force.tolist(), half.tolist(), strict=True):
            status = self._series.step(moment, row, word)
            each = [[math.nan] * 3] * 2 if status == "frozen" else numbers
            yield status, *each[0], *[math.nan] * 3, *each[1]


class Arrayed:
    """Decodes frames of an array jointly; the force of a row is the sum over its beams, which have columns each."""

    thermal = False

    def __init__(self, array: ArrayDesign, options: Streaming, jitter: float) -> None:
        self.said, rejects = list[str](), options.reject_ambient
        if options.calibration is not None:
            from studies.calibration import calibrated_array, calibration_file

            found = calibration_file.array_of(options.calibration, array)
            self._decoder: ArrayDecoder = calibrated_array.CalibratedArray(
                array, found, jitter, reject_ambient=rejects
            )
        else:
            source = mechanics_sources.source_of(array.design, options.source)
            self.said += [*source.said, *[source.warning] * bool(source.warning)]
            coder = decode_readings.prepare(array.design, source)
            self._decoder = ArrayDecoder(array, coder, frame_statuses(coder), jitter, reject_ambient=rejects)
        self.said += self._decoder.said
        self.columns = self._decoder.columns
        rest = np.zeros((len(array), 3)), np.zeros((len(array), 2))
        # what decodes is compiled before the first frame
        self._decoder.stream.step(readings_in_poses(array, *rest)[0])

    def zero(self, readings: Array, temperatures: Array) -> None:
        self._decoder.zero(self._decoder.fields(readings))

    def rows(self, times: Sequence[float], readings: Array, temperatures: Array) -> Iterator[tuple[Any, ...]]:
        yield from self._decoder.rows(self._decoder.fields(readings), times)


def _loaded(stream: Stream) -> Stream:
    """Load, or after an installation compile, what decodes, so that no frame waits for that."""
    forward = stream.coder.forward
    Stream(stream.coder).step(tuple(readings_with_slopes(forward, np.zeros((3, 1)))[0][:, 0].tolist()), 0.0)
    return stream


class Live:
    """The decoder of one stream, and what it has seen.

    times : of the first and the last row that have one, s.
    zero_asked : whether the readings of the last `TARE` are to be taken for those at rest, before the next row.
    """

    def __init__(self, design: Sensor, options: Streaming) -> None:
        # the times of a file, and of a device, are those at which rows were measured
        jitter = 0.0 if options.clock or is_file(options) else JITTER
        self._of_frame, self._warmth = reader(design, options), thermometer(design, options)
        self._decoder: Nominal | Calibrated | Regressed | Arrayed
        if options.calibration is not None and options.source != SourceOfLoad():
            raise BadInput("--calibration gives the mechanics: leave --level and --responses out")
        if options.temperature is not None and (options.calibration is None or isinstance(design, ArrayDesign)):
            raise BadInput("--temperature works with --calibration only, that of a single sensor: leave it out")
        if isinstance(design, ArrayDesign):
            self._decoder = Arrayed(design, options, jitter)
        elif options.calibration is None:
            self._decoder = Nominal(design, options, jitter)
        else:
            from studies.calibration import calibration_file
            from studies.calibration.sensor_fit import Fit

            fit = calibration_file.decoder_of(options.calibration, design, reject_ambient=options.reject_ambient)
            calibration_file.given_temperature(fit, options.temperature)
            if isinstance(fit, Fit):
                self._decoder = Calibrated(fit, jitter, warm=self._warmth is not None)
            else:
                if options.rest:
                    fit.check_zero()
                self._decoder = Regressed(fit, jitter)
        self.design = design
        warm = ["temperature_C"] if self._decoder.thermal else []
        self.columns = ["time_s", *sources.columns(design), *warm, *self._decoder.columns]
        self._count = len(parts.of_design(design))
        self.counts: Counter[str] = Counter()
        self.late: deque[float] = deque(maxlen=RECENT)
        self.times, self._timed = (math.nan, math.nan), 0
        self._recent: deque[tuple[float, tuple[float, ...], float]] = deque(maxlen=RECENT)
        if not 0 <= options.rest < math.inf:
            raise BadInput(f"--zero must be a time of 0 s or more; got {options.rest:g}")
        self._rest, self.zero_asked = options.rest, False

    def rows(self, arrived: Sequence[Row]) -> list[Decoded]:
        """Decode frames; those of the first `rest` seconds make the zero, and give no row."""
        read = self._read(arrived)
        if self._rest:
            # rows without a time stand before those with one
            self._recent += [row for row in read if not row[0] >= self._rest]
            read = [row for row in read if row[0] >= self._rest]
            if not read:
                return []
            if not self._zero(-math.inf):
                raise BadInput(
                    f"--zero {self._rest:g}: an element sent no number within its rails then: check the elements"
                )
            self._rest = 0.0
        self._recent += read
        if self.zero_asked and self._recent and not math.isnan(self._recent[-1][0]):
            # else with the next rows
            self.zero_asked = not self._zero(self._recent[-1][0] - TARE)
        times = [moment for moment, _, _ in read]
        readings = np.array([row for _, row, _ in read]).reshape(-1, self._count)
        decoded = self._decoder.rows(times, readings, np.array([warmth for *_, warmth in read]))
        rows = [
            dict(zip(self.columns, (moment, *row, *([warmth] * self._decoder.thermal), *found), strict=True))
            for (moment, row, warmth), found in zip(read, decoded, strict=True)
        ]
        if known := [moment for moment in times if not math.isnan(moment)]:
            self.times = self.times[0] if self._timed else known[0], known[-1]
            self._timed += len(known)
        self.counts.update(row["status"] for row in rows)
        return rows

    def _read(self, arrived: Sequence[Row]) -> list[tuple[float, tuple[float, ...], float]]:
        """Return time, readings and temperature of frames; NaN for what is not there, and for an infinite number."""
        return [
            (
                moment,
                tuple(v if math.isfinite(v) else math.nan for v in self._of_frame(numbers)),
                math.nan if self._warmth is None else self._warmth(numbers),
            )
            for moment, numbers in arrived
        ]

    def zero_in(self, decoding: Decoding, arrived: Sequence[Row]) -> None:
        """Take the readings of frames within the times of --zero of `decode` for those at rest."""
        read = self._read(arrived)
        times, readings, warmth = (np.array(values) for values in zip(*read, strict=True))
        elements = parts.of_design(self.design)
        full = at_rail(elements, field_of(elements, readings).T).T
        rest = decode_readings.rows_at_rest(decoding, readings, times, full)
        self._decoder.zero(np.where(full, np.nan, readings)[rest], warmth[rest])

    @property
    def remarks(self) -> Sequence[str]:
        asked = "no zero was taken since it was asked for: that takes rows with times, and numbers of all elements"
        return [*self._decoder.said, *[asked] * self.zero_asked]

    @property
    def rate(self) -> float:
        """Return the rows for each second, Hz, among those that have a time."""
        seconds = self.times[1] - self.times[0]
        return (self._timed - 1) / seconds if seconds > 0 else math.nan

    def why_nothing(self, misfit: str) -> str:
        """Return why no row has a force; misfit : why no frame was found."""
        if self._rest and self._recent:
            if all(math.isnan(moment) for moment, _, _ in self._recent):
                return f"no row has a time, which --zero {self._rest:g} needs: give the device's time with --clock"
            return f"the stream ended before --zero {self._rest:g} s: give a shorter time"
        if not self.counts:
            said = f" ({misfit})" if misfit else ""
            return f"no frame was understood{said}: check --frames, --units, --chips and --baud"
        return "no row has a force"

    def _zero(self, begun: float) -> bool:
        """Take the last rows since a time, s, for those at rest; not where an element has no reading in them."""
        chosen = [(row, warmth) for moment, row, warmth in self._recent if not moment < begun]
        rest = np.array([row for row, _ in chosen])
        full = np.array([[e.low, e.high] for e in parts.of_design(self.design)]).T
        rest[(rest <= full[0]) | (rest >= full[1])] = np.nan
        whole = bool(np.isfinite(rest).any(axis=0).all())
        if whole:
            self._decoder.zero(rest, np.array([warmth for _, warmth in chosen]))
        return whole


def reader(design: Sensor, options: Streaming) -> Callable[[Sequence[float]], tuple[float, ...]]:
    """Return the function from the numbers of a frame to readings, in the elements' unit and order.

    Raises
    ------
    BadInput
        The layout of the frames does not fit the design's elements.
    """
    elements = parts.of_design(design)
    unit, factor = elements[0].unit, 1e-6
    if options.frames == "lines":
        units = options.units or unit
        if units not in IN_HEADS[unit]:
            raise BadInput(f"--units {units} is no unit of these elements: choose one of {', '.join(IN_HEADS[unit])}")
        factor = IN_HEADS[unit][units]
        if options.axes is None:
            return lambda numbers: tuple(factor * value for value in numbers[: len(elements)])
    if unit != "T":
        raise BadInput(
            f"{_of_frames(options)} hold the axes of 3-axis chips, but this design reads {len(elements)} "
            "one-axis elements: choose --frames lines, or a chip by --set hall_layout=NAME"
        )
    wanted, mounted = chips(design, options), frames.mounting(options.axes or AXES)
    rows = [(3 * wanted[k // 3], element.direction) for k, element in enumerate(elements)]

    def readings(numbers: Sequence[float]) -> tuple[float, ...]:
        # of what is along the chip's axes, that along the sensor's
        return tuple(
            factor * sum(n * sign * numbers[first + axis] for n, (axis, sign) in zip(along, mounted, strict=True))
            for first, along in rows
        )

    return readings


def thermometer(design: Sensor, options: Streaming) -> Callable[[Sequence[float]], float] | None:
    """Return the function from the numbers of a frame to the temperature of the design's chips, C, if any."""
    if options.temperature is not None:
        warmth = options.temperature
        return lambda numbers: warmth
    if is_table(options):
        return lambda numbers: numbers[-1]
    if options.frames not in ("lines-xyzt", "anyskin"):
        return None
    wanted = chips(design, options)
    # behind x, y and z of all chips
    return lambda numbers: sum(numbers[3 * len(numbers) // 4 + chip] for chip in wanted) / len(wanted)


def chips(design: Sensor, options: Streaming) -> list[int]:
    """Return which chips of a frame are those of the design, counted from 0."""
    count, most = len(parts.of_design(design)) // 3, frames.MOST_CHIPS
    given = [int(number) - 1 for number in parse_numbers("--chips", options.chips)] if options.chips else range(count)
    if len(given) != count or min(given) < 0 or len(set(given)) < count:
        raise BadInput(f"--chips names the {count} chips of the frame that are this design's, from 1; got "
                       f"{options.chips!r}")  # fmt: skip
    needed = max(given) + 1
    width = needed if options.frame_chips is None else options.frame_chips
    if not 1 <= width <= most:
        raise BadInput(f"a frame has 1 to {most} chips; got {width}: check --frame-chips and --chips")
    if width < needed:
        raise BadInput(f"--chips {options.chips} is beyond the {width} chips of a frame: raise --frame-chips")
    return list(given)


def source_of(design: Sensor, options: Streaming) -> sources.Source:
    """Open where the readings come from.

    Raises
    ------
    BadInput
        It cannot be opened, or an option does not fit it.
    """
    _check_fit(options)
    if is_table(options):
        replay = sources.replayed(Path(options.port), design, options.speed)
        if options.temperature is not None and any(math.isfinite(numbers[-1]) for _, numbers in replay.table):
            raise BadInput(f"{options.port} has temperatures: leave --temperature out")
        return replay
    cut = _frames(design, options)
    device = DeviceClock(options.clock) if options.clock else None
    if is_file(options):
        return sources.captured(Path(options.port), cut, device, options.rate, options.speed)
    port = sources.Port(options.port, cut, device or Arrival(), options.baud)
    port.open()
    return port


def _frames(design: Sensor, options: Streaming) -> frames.Frames:
    """Return what cuts the stream into frames."""
    names = parts.columns(parts.of_design(design))
    if options.frames == "lines" and options.axes is None:
        width, needed = len(names), ", ".join(names)
    else:
        width = options.frame_chips or max(chips(design, options)) + 1
        axes = {"lines-xyzt": "x, y, z and temperature", "anyskin": "temperature, x, y and z"}
        needed = f"{axes.get(options.frames, 'x, y and z')} of {width} chip{'s' * (width > 1)}"
        width *= 3 if options.frames == "lines" else 1
    lsb = tuple(parse_numbers("--lsb", options.lsb)) if options.lsb else frames.LSB
    if len(lsb) != 2 or not all(0 < each < math.inf for each in lsb):
        raise BadInput(f"--lsb takes two numbers, uT of a count along x and y, and along z; got {options.lsb!r}")
    if options.clock:
        width, needed = width + 1, f"the device's time, {needed}"
    cut = frames.Frames(options.frames, width, (lsb[0], lsb[1]), needed)
    if options.frames == "aa":
        cut.begin_near(rest_in_frames(design, options, width))
    return cut


def rest_in_frames(design: Sensor, options: Streaming, width: int) -> list[float]:
    """Return what the chips of a frame send at rest, uT along their own x, y and z; 0 for other chips."""
    if isinstance(design, ArrayDesign):
        read = readings_in_poses(design, np.zeros((len(design), 3)), np.zeros((len(design), 2)))[0].reshape(-1, 3)
    else:
        read = readings_at(model(design), np.zeros((3, 1)))[:, 0].reshape(-1, 3)
    found = [0.0] * (3 * width)
    for chip, (down, x, y) in zip(chips(design, options), read.tolist(), strict=True):
        for (axis, sign), value in zip(frames.mounting(options.axes or AXES), (x, y, -down), strict=True):
            found[3 * chip + axis] = 1e6 * sign * value
    return found


def is_file(options: Streaming) -> bool:
    """Return whether the readings are those of a file, which is replayed."""
    return options.port != "-" and Path(options.port).is_file()


def is_table(options: Streaming) -> bool:
    """Return whether this file is a table; with a rate or a clock it holds frames, as a device has sent them."""
    return is_file(options) and options.rate is None and options.clock is None


def _of_frames(options: Streaming) -> str:
    return f"frames of {options.frames}" + (f" with --axes {options.axes}" if options.frames == "lines" else "")


def _check_fit(options: Streaming) -> None:
    """Refuse options that the source of the readings does not have."""
    table, file = is_table(options), is_file(options)
    what = (
        "a table that is replayed"
        if table
        else _of_frames(options)
        if options.axes
        else f"frames of {options.frames}"
    )
    more = "; a file of frames also needs their --rate, or --clock" if table else ""
    of_chips, lines = {"chips", "frame_chips", "axes"}, {"clock", "units", "axes"}
    if options.axes is not None:
        lines |= of_chips
    of_frames = {"lines": lines, "aa": {*of_chips, "lsb"}}.get(options.frames, of_chips)
    if options.frames in ("lines-xyzt", "anyskin") and options.temperature is not None:
        raise BadInput(f"frames of {options.frames} hold temperatures: leave --temperature out")
    fitting = {"speed"} if table else {"frames", *of_frames, *({"speed", "rate"} if file else {"baud"})}
    if file and options.clock is not None:
        fitting -= {"rate"}
    for name in ("frames", "units", "chips", "frame_chips", "axes", "lsb", "clock", "baud", "speed", "rate"):
        default = Streaming.__dataclass_fields__[name].default
        if name not in fitting and getattr(options, name) != default:
            raise BadInput(f"--{name.replace('_', '-')} has no meaning for {what}: leave it out{more}")
    if options.baud < 1:
        raise BadInput(f"--baud must be at least 1 bit per second; got {options.baud}")
    if not (options.speed >= 0 and math.isfinite(options.speed)):
        raise BadInput(f"--speed must be 0 (no waiting) or more; got {options.speed:g}")
    if options.rate is not None and not 0 < options.rate < math.inf:
        raise BadInput(f"--rate must be a number of Hz above 0; got {options.rate:g}")


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where rows go: a CSV file, an MCAP file with its frame, and standard output as JSON or one changing line."""

    csv: Path | None = None
    mcap: Path | None = None
    frame_id: str = ""
    as_json: bool = False

    @contextlib.contextmanager
    def sinks(self, live: Live) -> Iterator[list[Sink]]:
        """Yield the sinks, those of files first; the files grow, and appear under their names at the end."""
        with contextlib.ExitStack() as stack:
            found: list[Sink] = []
            if self.csv is not None:
                part = stack.enter_context(recording.growing(self.csv))
                file = stack.enter_context(part.open("w", encoding="utf-8", newline=""))
                found.append(csv_rows(file, live.columns))
            if self.mcap is not None:
                part = stack.enter_context(recording.growing(self.mcap))
                found.append(stack.enter_context(recording.mcap_file(part, live.design, self.frame_id)))
            yield [*found, json_lines if self.as_json else screen()]
            if not live.counts:
                raise recording.NothingDecoded


def run(
    live: Live, source: sources.Source, outputs: Outputs, *more: Sink, ended: threading.Event | None = None
) -> Result:
    """Decode a stream until it ends, or Ctrl-C, or `ended` is set, and return what was seen.

    more : further sinks.
    """
    ended, lost = ended or threading.Event(), None
    with contextlib.suppress(recording.NothingDecoded), outputs.sinks(live) as sinks, _ended_by_signals(ended):
        try:
            for arrived in source.rows():
                heard = time.monotonic()
                rows = live.rows(arrived)
                for sink in (*sinks, *more):
                    sink(rows)
                if rows:
                    live.late.append(time.monotonic() - heard)
                if ended.is_set():
                    break
        except console.OutputLost as error:  # who read the rows has gone: the files stay
            lost = error
    if lost is not None:
        raise lost
    if live.counts and not outputs.as_json:
        print()
    return summary(live, source)


@contextlib.contextmanager
def _ended_by_signals(ended: threading.Event) -> Iterator[None]:
    """Set an event at Ctrl-C, or when the process is asked to end or loses its terminal, so that files are complete.

    A second Ctrl-C ends the block at once.
    """
    main = threading.current_thread() is threading.main_thread()
    wanted = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if main and hasattr(signal, name)]
    # a process that is to outlive its terminal ignores this
    before = {number: signal.getsignal(number) for number in wanted}
    before = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}

    def end(number: int, frame: FrameType | None) -> None:
        if ended.is_set():
            signal.default_int_handler(number, frame)
        ended.set()

    for number in before:
        signal.signal(number, end)
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def record(design: Sensor, decoding: Decoding, path: Path) -> None:
    """Write the rows of a table with times as an MCAP file.

    Raises
    ------
    BadInput
        There is no table, or an option changes its readings.
    """
    if decoding.file is None:
        raise BadInput("--mcap works with --file only: leave it out")
    if decoding.units or decoding.tolerances or decoding.ignore_tilt:
        raise BadInput("--mcap records a --file as it is: leave --units, --tolerance and --ignore-tilt out")
    atomic_files.check_output_file(path, ".mcap")
    options = Streaming(
        port=str(decoding.file),
        speed=0.0,
        source=decoding.source,
        calibration=decoding.calibration,
        temperature=decoding.temperature,
        reject_ambient=decoding.reject_ambient,
    )
    live, source = Live(design, options), source_of(design, options)
    parts = list(source.rows())
    if decoding.zero is not None:
        live.zero_in(decoding, [row for arrived in parts for row in arrived])
    with atomic_files.atomic(path) as part, recording.mcap_file(part, design, recording.FRAME) as write:
        for arrived in parts:
            write(live.rows(arrived))


def run_with_page(
    live: Live, source: sources.Source, outputs: Outputs, serve: Callable[[explorer_server.Measuring], None]
) -> Result:
    """Decode a stream while `serve` shows it on a page, until Ctrl-C."""
    from studies.web import explorer_server

    outcome: Future[Result] = Future()
    ended = threading.Event()

    def measure(send: Callable[[str], None]) -> None:
        try:
            outcome.set_result(run(live, source, outputs, page(source, send), ended=ended))
        except BaseException as error:  # it is raised where the result is wanted
            outcome.set_exception(error)
        finally:
            send(atomic_files.json_line({"measured": {"rows": [], "lost": source.lost, "ended": True}}))

    def ask_zero() -> None:
        live.zero_asked = True

    serve(explorer_server.Measuring(measure, ended, ask_zero))
    return outcome.result()


def summary(live: Live, source: sources.Source) -> Result:
    """Return the counts of a stream that has ended."""
    total = sum(live.counts.values())
    record = {
        "rows": total,
        "lost_frames": source.lost,
        "seconds": live.times[1] - live.times[0],
        "rate_Hz": live.rate,
        "latency_ms": 1e3 * float(np.quantile(live.late, 0.95)) if live.late else math.nan,
        **{f"rows_{status}": count for status, count in live.counts.items()},
    }
    known = sum(live.counts[status] for status in decode_readings.WITH_POSE)
    remarks = [*live.remarks, *source.remarks]
    remarks += [
        f"{count} of {total} rows {status}: {decode_readings.WHY.get(status, 'no pose explains these readings')}"
        for status, count in live.counts.items()
        if status != "ok"
    ]
    failures = [] if known else [live.why_nothing(source.misfit)]
    return Result(title="Stream", records=[record], remarks=remarks, failures=failures)


# Where rows go


def csv_rows(file: TextIO, columns: Sequence[str]) -> Sink:
    """Return a sink that writes CSV, all digits, an empty cell for no number."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(columns)

    def write(rows: Sequence[Decoded]) -> None:
        for row in rows:
            cells = (v if isinstance(v, str) else "" if math.isnan(v) else repr(v + 0.0) for v in row.values())
            writer.writerow(cells)
        if rows:
            file.flush()

    return write


def json_lines(rows: Sequence[Decoded]) -> None:
    """Print each row as one JSON object."""
    for row in rows:
        sys.stdout.write(atomic_files.json_line(row) + "\n")
    if rows:
        sys.stdout.flush()


def screen() -> Sink:
    """Return a sink that shows the last row on one line of a terminal, some times a second."""
    shown, count = time.monotonic(), 0

    def show(rows: Sequence[Decoded]) -> None:
        nonlocal shown, count
        count += len(rows)
        now = time.monotonic()
        if not rows or now - shown < REDRAW:
            return
        row, rate = rows[-1], count / (now - shown)
        force = "  ".join(f"F{axis} {quantities.shown(row[f'force_{axis}_N'], digits=5):>8}" for axis in "xyz")
        moment = "  no time" if math.isnan(row["time_s"]) else f"{row['time_s']:9.2f}"
        sys.stdout.write(f"\r{moment} s  {force} N  {row['status']:<16} {rate:5.0f} Hz ")
        sys.stdout.flush()
        shown, count = now, 0

    return show


def typed_zero(live: Live, options: Streaming) -> Sink:
    """Return a sink that asks for a zero when the user has typed z and Enter."""
    listens = options.port != "-" and sys.stdin.isatty()

    def look(rows: Sequence[Decoded]) -> None:
        if listens and select.select([sys.stdin], [], [], 0)[0]:
            live.zero_asked = sys.stdin.readline().strip().lower() == "z"

    return look


def page(source: sources.Source, send: Callable[[str], None]) -> Sink:
    """Return a sink that sends rows to the pages, some times a second: at most 20 at once."""
    shown, waiting, count = time.monotonic(), deque[Decoded](maxlen=RECENT), 0

    def show(rows: Sequence[Decoded]) -> None:
        nonlocal shown, count
        waiting.extend(rows)
        count += len(rows)
        now = time.monotonic()
        if now - shown < REDRAW:
            return
        keys = ["time_s", *(f"force_{axis}_N" for axis in "xyz"), *HALF, "status"]
        # the last row always, and every n-th one before it
        chosen = list(waiting)[:: -max(math.ceil(len(waiting) / 20), 1)][::-1]
        listed = [[row.get(key) for key in keys] for row in chosen]
        record = {"rows": listed, "rate": count / (now - shown), "lost": source.lost, "ended": False}
        send(atomic_files.json_line({"measured": record}))
        waiting.clear()
        shown, count = now, 0

    return show
